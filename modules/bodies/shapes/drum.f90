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

  type, extends(surface_t) :: circle_t
  contains
    procedure, nopass :: features => circle_features
    procedure, nopass :: keys => circle_keys
    procedure :: set => circle_set
    procedure :: locate => drum_locate
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
