!> The common part of two convex polygons in a plane (Sutherland and Hodgman 1974).
module gravier_polygon_clip
  use gravier_kinds, only: dp
  implicit none
  private
  public :: clip_polygon, room_for_clip, one_place

  !> a corner that is beyond a side by less than this part of the size of the polygon lies on it: where two edges are parallel and
  !> nearest to each other, they lie on one line, seen along the normal, and rounding is not to put one beside the other
  real(dp), parameter :: on_side = 1.0e-13_dp
  !> corners that are nearer to each other than this part of the size of their piece are at one place, as those that blending has
  !> brought to their common sharp corner: rounding turns the side between them
  real(dp), parameter :: one_place = 1.0e-9_dp

contains

  !> Corners that the common part of polygons of n and m corners can have, and some more for polygons that rounding bends.
  pure integer function room_for_clip(n, m)
    integer, intent(in) :: n, m
    room_for_clip = 2*(n + m)
  end function room_for_clip

  !> Clip a polygon, or a segment as a polygon of two corners, against a convex one. What lies on a side of it, but for rounding, is
  !> common to both. Sides between corners at one place do not clip.
  pure subroutine clip_polygon(subject, clip, sense, least, n, place, label)
    !> corners in turn, first and second coordinate in the first two rows (3, corners)
    real(dp), intent(in) :: subject(:, :), clip(:, :)
    !> 1.0 where the corners of `clip` are anticlockwise, -1.0 where they are clockwise
    real(dp), intent(in) :: sense
    !> corners of `clip` this near to each other are at one place
    real(dp), intent(in) :: least
    !> corners of the common part
    integer, intent(out) :: n
    !> (2, room)
    real(dp), intent(out) :: place(:, :)
    !> whose side leads from a corner to the next: k that of the subject from its corner k on, -k that of `clip` (room)
    integer, intent(out) :: label(:)
    real(dp) :: way(2), height(size(label)), old(2, size(label)), part, room
    integer :: old_label(size(label)), s, k, next, m
    logical :: within(size(label))

    room = on_side*maxval(abs(clip(1:2, :)))
    n = size(subject, 2)
    do k = 1, n
      place(:, k) = subject(1:2, k)
      label(k) = k
    end do
    do s = 1, size(clip, 2)
      next = mod(s, size(clip, 2)) + 1
      way(1) = sense*(clip(1, next) - clip(1, s))
      way(2) = sense*(clip(2, next) - clip(2, s))
      if (max(abs(way(1)), abs(way(2))) <= least) cycle
      m = 0
      do k = 1, n
        height(k) = way(1)*(place(2, k) - clip(2, s)) - way(2)*(place(1, k) - clip(1, s))
        within(k) = height(k) >= -room*(abs(way(1)) + abs(way(2)))
        if (within(k)) m = m + 1
      end do
      if (m == n) cycle
      if (m == 0) then
        n = 0
        return
      end if
      old(:, 1:n) = place(:, 1:n)
      old_label(1:n) = label(1:n)
      m = 0
      do k = 1, n
        next = merge(1, k + 1, k == n)
        if (within(k)) call put(old(:, k), old_label(k), m, place, label)
        if (within(k) .eqv. within(next)) cycle
        part = min(max(height(k)/(height(k) - height(next)), 0.0_dp), 1.0_dp)
        way(:) = old(:, k) + part*(old(:, next) - old(:, k))
        call put(way, merge(-s, old_label(k), within(k)), m, place, label)
      end do
      n = m
    end do

  end subroutine clip_polygon

  !> Add a corner where there is room.
  pure subroutine put(corner, name, m, place, label)
    real(dp), intent(in) :: corner(2)
    integer, intent(in) :: name
    integer, intent(inout) :: m
    real(dp), intent(inout) :: place(:, :)
    integer, intent(inout) :: label(:)

    if (m == size(label)) return
    m = m + 1
    place(:, m) = corner
    label(m) = name
  end subroutine put

end module gravier_polygon_clip
