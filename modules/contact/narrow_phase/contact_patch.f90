!> Points of a contact before they become a manifold: collected, thinned out to as many as wanted, and put into order.
module gravier_contact_patch
  use gravier_kinds, only: dp
  use gravier_contact_feature, only: frame_t
  use gravier_manifold, only: manifold_t, most_points
  implicit none
  private
  public :: patch_point_t, add_point, keep_outline, leave_corners, fill_manifold

  !> A point of a patch.
  type :: patch_point_t
    !> along the axes of the frame and its normal [m]
    real(dp) :: place(3)
    real(dp) :: gap
    integer :: key
  end type patch_point_t

  !> lengths that differ by less than this part of the size of the pair are equal, so that rounding does not decide
  real(dp), parameter :: equal = 1.0e-5_dp

contains

  !> Add a point, unless its gap is too large. Two points at one place, or of one key, become one with the smaller gap and the lower
  !> key, unless a third has that key.
  pure subroutine add_point(new, alert, size_of_pair, n, point)
    type(patch_point_t), intent(in) :: new
    !> [m]
    real(dp), intent(in) :: alert, size_of_pair
    integer, intent(inout) :: n
    type(patch_point_t), intent(inout) :: point(:)
    integer :: k

    if (.not. new%gap < alert) return
    do k = 1, n
      if (new%key /= point(k)%key) then
        if (abs(new%place(1) - point(k)%place(1)) > equal*size_of_pair) cycle
        if (abs(new%place(2) - point(k)%place(2)) > equal*size_of_pair) cycle
      end if
      if (new%gap < point(k)%gap) then
        point(k)%place(:) = new%place
        point(k)%gap = new%gap
      end if
      if (all(point(1:n)%key /= new%key)) point(k)%key = min(point(k)%key, new%key)
      return
    end do
    if (n == size(point)) return
    n = n + 1
    point(n) = new
  end subroutine add_point

  !> Keep those points that the convex hull of all has as corners (A. M. Andrew, Inf. Process. Lett. 9 (1979) 216): forces there can
  !> be any that forces at all points can. The chain goes along the longest way between two points: along a side that is across it,
  !> rounding would decide which point comes first.
  pure subroutine keep_outline(near, n, point)
    !> points this near to the line of two others lie on it [m]
    real(dp), intent(in) :: near
    integer, intent(inout) :: n
    type(patch_point_t), intent(inout) :: point(:)
    integer :: order(n), chain(2*n), k, m, first
    real(dp) :: axis(2), along(n), across(n)

    if (n < 3) return
    call find_longest(n, point, axis)
    do k = 1, n
      along(k) = axis(1)*point(k)%place(1) + axis(2)*point(k)%place(2)
      across(k) = axis(1)*point(k)%place(2) - axis(2)*point(k)%place(1)
    end do
    call argsort(along, across, order)
    m = 0
    first = 1
    do k = 1, n
      call extend(order(k), first, m, chain)
    end do
    first = m
    do k = n - 1, 1, -1
      call extend(order(k), first, m, chain)
    end do
    call keep_only(chain(1:m), n, point)

  contains

    !> Go on with the chain to a point, past those that do not stick out to its right.
    pure subroutine extend(next, first, m, chain)
      integer, intent(in) :: next
      !> place behind which the chain may be shortened
      integer, intent(in) :: first
      integer, intent(inout) :: m, chain(:)
      real(dp) :: u(2), v(2)

      do while (m > first)
        u(:) = point(chain(m))%place(1:2) - point(chain(m - 1))%place(1:2)
        v(:) = point(next)%place(1:2) - point(chain(m - 1))%place(1:2)
        if (u(1)*v(2) - u(2)*v(1) > near*norm2(v)) exit
        m = m - 1
      end do
      m = m + 1
      chain(m) = next
    end subroutine extend

  end subroutine keep_outline

  !> The way between two points of which each is the farthest from the other.
  pure subroutine find_longest(n, point, way)
    !> 1 or more
    integer, intent(in) :: n
    type(patch_point_t), intent(in) :: point(:)
    real(dp), intent(out) :: way(2)
    real(dp) :: length, longest
    integer :: here, there, k

    way(:) = 0.0_dp
    longest = -1.0_dp
    there = 1
    do
      here = there
      length = longest
      do k = 1, n
        associate (square => sum((point(k)%place(1:2) - point(here)%place(1:2))**2))
          if (.not. square > longest) cycle
          longest = square
          way(:) = point(k)%place(1:2) - point(here)%place(1:2)
          there = k
        end associate
      end do
      if (.not. longest > length) return
    end do
  end subroutine find_longest

  !> Of the corners of a convex patch leave out those that are almost on the line of their neighbours, the straightest first, as
  !> long as there are more than some. Two faces that are equal but for a small shift and turn have up to all corners of both.
  pure subroutine leave_corners(near, least, n, point)
    !> corners this near to the line of their neighbours may go [m]
    real(dp), intent(in) :: near
    !> how many stay at least
    integer, intent(in) :: least
    integer, intent(inout) :: n
    type(patch_point_t), intent(inout) :: point(:)
    integer :: order(n), k, m, straightest
    real(dp) :: angle(n), centre(2), off(n)

    if (n <= max(least, 2)) return
    do k = 1, 2
      centre(k) = sum(point(1:n)%place(k))/n
    end do
    do k = 1, n
      angle(k) = atan2(point(k)%place(2) - centre(2), point(k)%place(1) - centre(1))
    end do
    off(:) = 0.0_dp
    call argsort(angle, off, order)
    m = n
    do while (m > max(least, 2))
      do k = 1, m
        off(k) = distance_from_line(point(order(k)), point(order(modulo(k - 2, m) + 1)), point(order(modulo(k, m) + 1)))
      end do
      straightest = minloc(off(1:m), 1)
      if (off(straightest) > near) exit
      order(straightest:m - 1) = order(straightest + 1:m)
      m = m - 1
    end do
    call keep_only(order(1:m), n, point)
  end subroutine leave_corners

  !> How far a corner is from the line of two others, across the normal [m].
  pure real(dp) function distance_from_line(corner, before, after) result(distance)
    type(patch_point_t), intent(in) :: corner, before, after
    real(dp) :: u(2), v(2)

    u(:) = after%place(1:2) - before%place(1:2)
    v(:) = corner%place(1:2) - before%place(1:2)
    distance = abs(u(1)*v(2) - u(2)*v(1))/max(norm2(u), tiny(distance))
  end function distance_from_line

  !> Keep some of the points, in their order.
  pure subroutine keep_only(places, n, point)
    integer, intent(in) :: places(:)
    integer, intent(inout) :: n
    type(patch_point_t), intent(inout) :: point(:)
    integer :: k, m

    m = 0
    do k = 1, n
      if (.not. any(places == k)) cycle
      m = m + 1
      point(m) = point(k)
    end do
    n = m
  end subroutine keep_only

  !> Order of a few numbers, ascending; where they are equal that of the second ones, and then their own.
  pure subroutine argsort(value, second, order)
    real(dp), intent(in) :: value(:), second(:)
    integer, intent(out) :: order(:)
    integer :: k, l

    do k = 1, size(value)
      l = k
      do while (l > 1)
        if (.not. is_before(k, order(l - 1))) exit
        order(l) = order(l - 1)
        l = l - 1
      end do
      order(l) = k
    end do

  contains

    pure logical function is_before(a, b)
      integer, intent(in) :: a, b

      is_before = value(a) < value(b)
      if (.not. is_before .and. .not. value(b) < value(a)) is_before = second(a) < second(b)
    end function is_before

  end subroutine argsort

  !> The manifold of the points: at most `most` of them, in ascending order of their keys.
  pure subroutine fill_manifold(frame, size_of_pair, same_gap, most, n, point, manifold)
    type(frame_t), intent(in) :: frame
    real(dp), intent(in) :: size_of_pair
    !> points whose gaps differ by less are equally deep [m]
    real(dp), intent(in) :: same_gap
    integer, intent(in) :: most
    integer, intent(inout) :: n
    type(patch_point_t), intent(inout) :: point(:)
    type(manifold_t), intent(inout) :: manifold
    integer :: k

    call sort_points(n, point)
    if (n > min(most, most_points)) then
      if (most <= 4) then
        call keep_four(most, size_of_pair, same_gap, n, point)
      else
        do while (n > min(most, most_points))
          call drop_one(size_of_pair, same_gap, n, point)
        end do
      end if
    end if
    manifold%n = n
    do k = 1, n
      manifold%point(:, k) = frame%origin + point(k)%place(1)*frame%first + point(k)%place(2)*frame%second + &
        & point(k)%place(3)*frame%normal
      manifold%gap(k) = point(k)%gap
      manifold%key(k) = point(k)%key
    end do
  end subroutine fill_manifold

  !> Ascending keys.
  pure subroutine sort_points(n, point)
    integer, intent(in) :: n
    type(patch_point_t), intent(inout) :: point(:)
    type(patch_point_t) :: moved
    integer :: j, k

    do k = 2, n
      moved = point(k)
      j = k
      do while (j > 1)
        if (point(j - 1)%key <= moved%key) exit
        point(j) = point(j - 1)
        j = j - 1
      end do
      point(j) = moved
    end do
  end subroutine sort_points

  !> Of more points keep the deepest, the one farthest from it, the one farthest from the line of both, and the one farthest from
  !> the line on its other side. Differences that rounding could make do not count: ties go to the lowest key.
  pure subroutine keep_four(most, size_of_pair, same_gap, n, point)
    integer, intent(in) :: most
    real(dp), intent(in) :: size_of_pair, same_gap
    integer, intent(inout) :: n
    type(patch_point_t), intent(inout) :: point(:)
    real(dp) :: value(n), size_of(n), way(2), base(2), room
    integer :: chosen(4), k, m
    logical :: kept(n)

    room = equal*size_of_pair
    do k = 1, n
      value(k) = -point(k)%gap
    end do
    chosen(1) = first_greatest(value, same_gap)
    base(:) = point(chosen(1))%place(1:2)
    do k = 1, n
      value(k) = norm2(point(k)%place(1:2) - base)
    end do
    chosen(2) = first_greatest(value, room)
    way(:) = point(chosen(2))%place(1:2) - base
    way(:) = way/max(norm2(way), tiny(room))
    do k = 1, n
      value(k) = way(1)*(point(k)%place(2) - base(2)) - way(2)*(point(k)%place(1) - base(1))
    end do
    size_of(:) = abs(value)
    chosen(3) = first_greatest(size_of, room)
    value(:) = -sign(1.0_dp, value(chosen(3)))*value
    chosen(4) = first_greatest(value, room)
    ! nothing lies on the other side: the point that is farthest from the three
    if (value(chosen(4)) <= room) chosen(4) = farthest_of(chosen(1:3), n, point, room)
    kept(:) = .false.
    do k = 1, min(most, 4)
      kept(chosen(k)) = .true.
    end do
    m = 0
    do k = 1, n
      if (.not. kept(k)) cycle
      m = m + 1
      point(m) = point(k)
    end do
    n = m
  end subroutine keep_four

  !> The first of those values that are greatest but for a difference that does not count.
  pure integer function first_greatest(value, room) result(place)
    real(dp), intent(in) :: value(:), room
    real(dp) :: greatest

    greatest = maxval(value)
    do place = 1, size(value)
      if (value(place) >= greatest - room) return
    end do
    place = 1
  end function first_greatest

  !> The point whose nearest chosen one is farthest.
  pure integer function farthest_of(chosen, n, point, room) result(place)
    integer, intent(in) :: chosen(:), n
    type(patch_point_t), intent(in) :: point(:)
    real(dp), intent(in) :: room
    real(dp) :: value(n), way(2)
    integer :: k, j

    do k = 1, n
      value(k) = huge(1.0_dp)
      do j = 1, size(chosen)
        way(:) = point(k)%place(1:2) - point(chosen(j))%place(1:2)
        value(k) = min(value(k), norm2(way))
      end do
    end do
    place = first_greatest(value, room)
  end function farthest_of

  !> Leave out the point that is nearest to another one, but never the deepest; of the two the one with the higher key.
  pure subroutine drop_one(size_of_pair, same_gap, n, point)
    real(dp), intent(in) :: size_of_pair, same_gap
    integer, intent(inout) :: n
    type(patch_point_t), intent(inout) :: point(:)
    real(dp) :: depth(n), square, least
    integer :: k, j, deepest, out

    do k = 1, n
      depth(k) = -point(k)%gap
    end do
    deepest = first_greatest(depth, same_gap)
    ! the square of the least distance so far, but for a difference that does not count
    least = huge(1.0_dp)
    out = n
    do k = 2, n
      do j = 1, k - 1
        square = (point(k)%place(1) - point(j)%place(1))**2 + (point(k)%place(2) - point(j)%place(2))**2
        if (square >= least) cycle
        least = max(sqrt(square) - equal*size_of_pair, 0.0_dp)**2
        out = merge(j, k, k == deepest)
      end do
    end do
    point(out:n - 1) = point(out + 1:n)
    n = n - 1
  end subroutine drop_one

end module gravier_contact_patch
