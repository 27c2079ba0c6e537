!> Shapes of the plane: convex polygons with rounded corners, disks and capsules as pieces, and bodies made of one or several of
!> them.
module gravier_polygon
  use gravier_kinds, only: dp
  use gravier_text, only: to_text
  use gravier_convex_piece, only: convex_piece_t, bound_piece
  use gravier_shape_library, only: body_shape_t
  implicit none
  private
  public :: flat_piece_t, polygon_piece, round_piece, make_flat_shape

  real(dp), parameter :: pi = acos(-1.0_dp)
  !> sine of the least angle between neighbouring sides of a polygon, and the least side over the largest extension
  real(dp), parameter :: least_turn = 1.0e-6_dp, least_side = 1.0e-9_dp

  !> A piece in the length unit of its user, with its area and moments: those of the sharp polygon, or of the round piece.
  type :: flat_piece_t
    type(convex_piece_t) :: piece
    real(dp) :: area = 0.0_dp
    real(dp) :: centroid(2) = 0.0_dp
    !> integral of the squared distance from the centroid
    real(dp) :: moment = 0.0_dp
  end type flat_piece_t

contains

  !> The piece of a convex polygon.
  pure subroutine polygon_piece(corners, rounding, made, message)
    !> (2, n) in either sense of rotation
    real(dp), intent(in) :: corners(:, :)
    !> of the corners: above 0, small enough to leave something of each side
    real(dp), intent(in) :: rounding
    type(flat_piece_t), intent(out) :: made
    !> why there is no such polygon, without a full stop; empty where there is
    character(len=:), allocatable, intent(out) :: message
    real(dp) :: corner(2, size(corners, 2))
    integer :: k, n

    n = size(corners, 2)
    message = ""
    if (n < 3) then
      message = "a polygon of "//to_text(n)//" corners: expected at least 3"
      return
    end if
    corner(:, :) = corners
    call measure(corner, made)
    if (made%area < 0.0_dp) then
      do k = 1, n
        corner(:, k) = corners(:, n + 1 - k)
      end do
      call measure(corner, made)
    end if
    call check_convex(corner, made%area, message)
    if (len(message) == 0) call shrink(corner, rounding, made%piece, message)
  end subroutine polygon_piece

  !> A disk, or a capsule: all points within a radius of a point, or of the segment between two.
  pure subroutine round_piece(ends, radius, made, message)
    !> (2, 1 or 2)
    real(dp), intent(in) :: ends(:, :)
    real(dp), intent(in) :: radius
    type(flat_piece_t), intent(out) :: made
    !> why there is no such piece, without a full stop; empty where there is
    character(len=:), allocatable, intent(out) :: message
    real(dp) :: length

    message = ""
    if (.not. radius > 0.0_dp) then
      message = "a radius of "//to_text(radius, 6)//": expected more than 0"
      return
    end if
    length = norm2(ends(:, size(ends, 2)) - ends(:, 1))
    if (size(ends, 2) == 2 .and. .not. length > least_side*radius) then
      message = "a capsule of length 0: expected two ends"
      return
    end if
    made%piece%rounding = radius
    made%piece%vertex = ends
    made%piece%corner = ends
    made%centroid(:) = 0.5_dp*(ends(:, 1) + ends(:, size(ends, 2)))
    made%area = pi*radius**2 + 2.0_dp*radius*length
    ! two half disks, whose centres of mass lie 4 r/(3 pi) from their flat sides, and a rectangle
    made%moment = pi*radius**4/2.0_dp + pi*radius**2*length**2/4.0_dp + 4.0_dp*radius**3*length/3.0_dp &
      & + 2.0_dp*radius*length*(length**2 + 4.0_dp*radius**2)/12.0_dp
  end subroutine round_piece

  !> A body of one or several pieces. Its mass properties are those of the sum of its pieces: where pieces overlap, the common part
  !> counts with each of them.
  pure subroutine make_flat_shape(name, made, shape)
    character(len=*), intent(in) :: name
    type(flat_piece_t), intent(in) :: made(:)
    type(body_shape_t), intent(out) :: shape
    real(dp) :: centre(2), area, moment, size_of
    integer :: k, v

    area = sum(made%area)
    centre(:) = 0.0_dp
    do k = 1, size(made)
      ! from the first piece, so that pieces far from the origin keep their digits
      centre(:) = centre + made(k)%area*(made(k)%centroid - made(1)%centroid)
    end do
    centre(:) = made(1)%centroid + centre/area
    moment = 0.0_dp
    size_of = 0.0_dp
    allocate (shape%piece(size(made)))
    do k = 1, size(made)
      moment = moment + made(k)%moment + made(k)%area*sum((made(k)%centroid - centre)**2)
      shape%piece(k) = made(k)%piece
      associate (piece => shape%piece(k))
        do v = 1, size(piece%vertex, 2)
          piece%vertex(:, v) = piece%vertex(:, v) - centre
          piece%corner(:, v) = piece%corner(:, v) - centre
          size_of = max(size_of, norm2(piece%corner(:, v)), norm2(piece%vertex(:, v)) + piece%rounding)
        end do
      end associate
    end do
    shape%name = name
    shape%size = size_of
    shape%volume = area/size_of**2
    shape%inertia(1) = moment/area/size_of**2
    do k = 1, size(made)
      shape%piece(k)%vertex(:, :) = shape%piece(k)%vertex/size_of
      shape%piece(k)%corner(:, :) = shape%piece(k)%corner/size_of
      shape%piece(k)%rounding = shape%piece(k)%rounding/size_of
      call bound_piece(shape%piece(k))
    end do
  end subroutine make_flat_shape

  !> Area, below 0 for corners in clockwise order, centroid and moment of a polygon.
  pure subroutine measure(corner, made)
    real(dp), intent(in) :: corner(:, :)
    type(flat_piece_t), intent(inout) :: made
    real(dp) :: a(2), b(2), twice
    integer :: k, n

    n = size(corner, 2)
    made%area = 0.0_dp
    made%centroid(:) = 0.0_dp
    made%moment = 0.0_dp
    ! from the first corner, so that a place far from the origin costs no digits
    do k = 2, n - 1
      a(:) = corner(:, k) - corner(:, 1)
      b(:) = corner(:, k + 1) - corner(:, 1)
      twice = a(1)*b(2) - a(2)*b(1)
      made%area = made%area + 0.5_dp*twice
      made%centroid(:) = made%centroid + twice*(a + b)/6.0_dp
      made%moment = made%moment + twice*(sum(a*a) + sum(a*b) + sum(b*b))/12.0_dp
    end do
    if (.not. abs(made%area) > 0.0_dp) return
    made%centroid(:) = made%centroid/made%area
    made%moment = made%moment - made%area*sum(made%centroid**2)
    made%centroid(:) = made%centroid + corner(:, 1)
  end subroutine measure

  !> Refuse what is not a convex polygon with corners in anticlockwise order.
  pure subroutine check_convex(corner, area, message)
    real(dp), intent(in) :: corner(:, :), area
    character(len=:), allocatable, intent(inout) :: message
    real(dp) :: side(2), next(2), turn, extension, angle
    integer :: k, n

    n = size(corner, 2)
    extension = max(maxval(corner(1, :)) - minval(corner(1, :)), maxval(corner(2, :)) - minval(corner(2, :)))
    if (.not. area > least_side*extension**2) then
      message = "a polygon without area"
      return
    end if
    do k = 1, n
      if (norm2(corner(:, following(k, n)) - corner(:, k)) > least_side*extension) cycle
      message = "corners "//to_text(k)//" and "//to_text(following(k, n))//" of a polygon in the same place"
      return
    end do
    angle = 0.0_dp
    do k = 1, n
      side(:) = corner(:, following(k, n)) - corner(:, k)
      next(:) = corner(:, following(following(k, n), n)) - corner(:, following(k, n))
      turn = side(1)*next(2) - side(2)*next(1)
      if (.not. turn > least_turn*norm2(side)*norm2(next)) then
        message = "a polygon that is not convex, or straight, at corner "//to_text(following(k, n))//" in anticlockwise order"
        return
      end if
      angle = angle + atan2(turn, sum(side*next))
    end do
    if (angle > 3.0_dp*pi) message = "a polygon that crosses itself"
  end subroutine check_convex

  !> The core: sides moved inwards by the rounding.
  pure subroutine shrink(corner, rounding, piece, message)
    real(dp), intent(in) :: corner(:, :), rounding
    type(convex_piece_t), intent(inout) :: piece
    character(len=:), allocatable, intent(inout) :: message
    real(dp) :: before(2), after(2), turn
    integer :: k, n

    n = size(corner, 2)
    piece%rounding = rounding
    piece%corner = corner
    piece%vertex = corner
    if (.not. rounding > 0.0_dp) then
      message = "a rounding of "//to_text(rounding, 6)//": expected more than 0"
      return
    end if
    do k = 1, n
      before(:) = corner(:, k) - corner(:, preceding(k, n))
      after(:) = corner(:, following(k, n)) - corner(:, k)
      before(:) = before/norm2(before)
      after(:) = after/norm2(after)
      ! along the inner normals of both sides by the rounding: (after - before)/sin of the turn between them
      turn = before(1)*after(2) - before(2)*after(1)
      piece%vertex(:, k) = corner(:, k) + rounding*(after - before)/turn
    end do
    do k = 1, n
      after(:) = corner(:, following(k, n)) - corner(:, k)
      before(:) = piece%vertex(:, following(k, n)) - piece%vertex(:, k)
      if (sum(before*after) > 0.0_dp) cycle
      message = "a rounding of "//to_text(rounding, 6)//" that leaves nothing of the side after corner "//to_text(k)
      return
    end do
  end subroutine shrink

  pure integer function following(k, n)
    integer, intent(in) :: k, n
    following = mod(k, n) + 1
  end function following

  pure integer function preceding(k, n)
    integer, intent(in) :: k, n
    preceding = mod(k + n - 2, n) + 1
  end function preceding

end module gravier_polygon
