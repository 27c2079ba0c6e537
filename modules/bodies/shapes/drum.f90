!> Round surfaces with the grains inside: circles in 2D, endless cylinders in 3D.
module gravier_drum
  use gravier_kinds, only: dp
  use gravier_declared_keys, only: declared_key_t
  use gravier_surface, only: surface_t, surface_features_t, point_key, set_direction, is_vector
  implicit none
  private
  public :: circle_t, cylinder_t

  !> a radius is the same key in both
  type(declared_key_t), parameter :: radius_key = declared_key_t("radius", "", "> 0", "m", "radius; the grains are inside")

  !> what an axis that is along a coordinate axis may lack of it; lines through a box along each of two axes
  real(dp), parameter :: straight = 1.0e-9_dp
  integer, parameter :: lines = 100

  type, extends(surface_t) :: circle_t
  contains
    procedure, nopass :: features => circle_features
    procedure, nopass :: keys => circle_keys
    procedure :: set => circle_set
    procedure :: locate => drum_locate
    procedure :: share_inside => drum_share_inside
    procedure :: shut => drum_shut
  end type circle_t

  !> `axis` is a unit vector along it.
  type, extends(circle_t) :: cylinder_t
  contains
    procedure, nopass :: features => cylinder_features
    procedure, nopass :: keys => cylinder_keys
    procedure :: set => cylinder_set
  end type cylinder_t

contains

  pure function circle_features() result(features)
    type(surface_features_t) :: features
    features = surface_features_t("circle", dimensions=[.true., .false.], encloses=.true.)
  end function circle_features

  pure function cylinder_features() result(features)
    type(surface_features_t) :: features
    features = surface_features_t("cylinder", dimensions=[.false., .true.], encloses=.true., endless_axis=.true.)
  end function cylinder_features

  pure subroutine circle_keys(keys)
    type(declared_key_t), allocatable, intent(out) :: keys(:)

    allocate (keys(2))
    keys(1) = point_key
    keys(2) = radius_key
  end subroutine circle_keys

  pure subroutine cylinder_keys(keys)
    type(declared_key_t), allocatable, intent(out) :: keys(:)

    allocate (keys(3))
    keys(1) = point_key
    keys(2) = declared_key_t("axis", "", "not all 0", "", "direction of the axis, of any length", 3)
    keys(3) = radius_key
  end subroutine cylinder_keys

  pure subroutine circle_set(self, values, wrong, expected)
    class(circle_t), intent(inout) :: self
    real(dp), intent(in), contiguous :: values(:, :)
    character(len=:), allocatable, intent(out) :: wrong, expected

    wrong = ""
    expected = ""
    self%point(:) = values(:, 1)
    self%radius = values(1, 2)
    if (.not. self%radius > 0.0_dp) wrong = "radius"
  end subroutine circle_set

  pure subroutine cylinder_set(self, values, wrong, expected)
    class(cylinder_t), intent(inout) :: self
    real(dp), intent(in), contiguous :: values(:, :)
    character(len=:), allocatable, intent(out) :: wrong, expected

    wrong = ""
    expected = ""
    self%point(:) = values(:, 1)
    self%radius = values(1, 3)
    if (.not. is_vector(values(:, 2))) then
      wrong = "axis"
      return
    end if
    call set_direction(values(:, 2), self%axis)
    if (.not. self%radius > 0.0_dp) wrong = "radius"
  end subroutine cylinder_set

  pure subroutine drum_locate(self, from, distance, normal)
    class(circle_t), intent(in) :: self
    real(dp), intent(in) :: from(3)
    real(dp), intent(out) :: distance, normal(3)
    real(dp) :: across(3), length

    across(:) = from - sum(from*self%axis)*self%axis
    length = norm2(across)
    distance = self%radius - length
    if (length > 0.0_dp) then
      normal(:) = -across/length
    else
      normal(:) = any_across(self%axis)
    end if
  end subroutine drum_locate

  !> The share of a box that is inside: exact where the axis is along one of the box, else of `lines` times `lines` lines through
  !> the box that cross the axis.
  pure real(dp) function drum_share_inside(self, low, high) result(share)
    class(circle_t), intent(in) :: self
    real(dp), intent(in) :: low(3), high(3)
    real(dp), dimension(3) :: from, to
    real(dp), dimension(2) :: least, most
    integer :: main, a, b

    share = 1.0_dp
    main = along(self%axis)
    a = mod(max(main, 1), 3) + 1
    b = mod(a, 3) + 1
    from(:) = low - self%point
    to(:) = high - self%point
    if (main == 0) then
      share = share_of_lines(self, from, to)
    else if (to(a) > from(a) .and. to(b) > from(b)) then
      least(1) = from(a)
      least(2) = from(b)
      most(1) = to(a)
      most(2) = to(b)
      share = area_in_disk(self%radius, least, most)/product(most - least)
    end if
  end function drum_share_inside

  !> A box is no wider than a drum whose axis is along one of the box.
  pure subroutine drum_shut(self, axis, low, high)
    class(circle_t), intent(in) :: self
    integer, intent(in) :: axis
    real(dp), intent(inout) :: low, high

    if (along(self%axis) == 0 .or. along(self%axis) == axis) return
    low = max(low, self%point(axis) - self%radius)
    high = min(high, self%point(axis) + self%radius)
  end subroutine drum_shut

  !> The coordinate axis that an axis is along, 0 for one that is oblique; the third one for a circle.
  pure integer function along(axis)
    real(dp), intent(in) :: axis(3)
    along = 3
    if (any(abs(axis) > 0.0_dp)) along = maxloc(abs(axis), dim=1)
    if (any(abs(axis) > 0.0_dp) .and. norm2(axis) - abs(axis(along)) > straight) along = 0
  end function along

  !> The area of a rectangle within a disk about the origin: the integral over x of the upper bound of y less that of the lower.
  pure real(dp) function area_in_disk(radius, low, high) result(area)
    !> [m]
    real(dp), intent(in) :: radius, low(2), high(2)
    real(dp) :: from, to

    from = min(max(low(1), -radius), radius)
    to = min(max(high(1), -radius), radius)
    area = radius**2*(below(high(2)/radius, from/radius, to/radius) - below(low(2)/radius, from/radius, to/radius))

  contains

    !> Integral from x to z of y, cut to the unit disk.
    pure real(dp) function below(y, x, z)
      real(dp), intent(in) :: y, x, z
      below = sign(1.0_dp, y)*(from_middle(abs(y), z) - from_middle(abs(y), x))
    end function below

    !> Integral from 0 to x of the smaller of y and sqrt(1 - t^2).
    pure real(dp) function from_middle(y, x) result(integral)
      real(dp), intent(in) :: y, x
      real(dp) :: width

      width = 0.0_dp
      if (y < 1.0_dp) width = sqrt(1.0_dp - y**2)
      integral = y*min(abs(x), width)
      if (abs(x) > width) integral = integral + arc(abs(x)) - arc(width)
      integral = sign(integral, x)
    end function from_middle

    !> Integral from 0 to x of sqrt(1 - t^2).
    pure real(dp) function arc(x)
      real(dp), intent(in) :: x
      arc = 0.5_dp*(x*sqrt(max(0.0_dp, 1.0_dp - x**2)) + asin(min(x, 1.0_dp)))
    end function arc

  end function area_in_disk

  !> The share of lines through a box that is inside: lines along the coordinate axis that is most across the axis of the drum.
  pure real(dp) function share_of_lines(self, low, high) result(share)
    class(circle_t), intent(in) :: self
    !> from the point of the drum (3) [m]
    real(dp), intent(in) :: low(3), high(3)
    real(dp) :: x(3), across(3), slope(3), half, middle, square
    integer :: d, a, b, k, j

    d = minloc(abs(self%axis), dim=1)
    a = mod(d, 3) + 1
    b = mod(a, 3) + 1
    share = 1.0_dp
    if (.not. high(d) > low(d)) return
    share = 0.0_dp
    ! part of a unit vector along the line that is across the axis of the drum
    slope(:) = -self%axis(d)*self%axis
    slope(d) = slope(d) + 1.0_dp
    do j = 1, lines
      do k = 1, lines
        x(d) = 0.0_dp
        x(a) = low(a) + (high(a) - low(a))*(k - 0.5_dp)/lines
        x(b) = low(b) + (high(b) - low(b))*(j - 0.5_dp)/lines
        across(:) = x - sum(x*self%axis)*self%axis
        middle = -sum(across*slope)/sum(slope**2)
        square = (self%radius**2 - sum((across + middle*slope)**2))/sum(slope**2)
        if (.not. square > 0.0_dp) cycle
        half = sqrt(square)
        share = share + max(0.0_dp, min(high(d), middle + half) - max(low(d), middle - half))
      end do
    end do
    share = share/(real(lines, dp)**2*(high(d) - low(d)))
  end function share_of_lines

  !> A unit vector across a unit vector; the first one across zero.
  pure function any_across(axis) result(normal)
    real(dp), intent(in) :: axis(3)
    real(dp) :: normal(3)
    integer :: least

    least = minloc(abs(axis), dim=1)
    normal(:) = -axis(least)*axis
    normal(least) = normal(least) + 1.0_dp
    normal(:) = normal/norm2(normal)
  end function any_across

end module gravier_drum
