!> Planes, in 2D lines: half-spaces that bound the grains, and outlets, behind which grains leave the scene.
module gravier_plane
  use gravier_kinds, only: dp
  use gravier_declared_keys, only: declared_key_t
  use gravier_surface, only: surface_t, surface_features_t, point_key, set_direction, is_vector, facing
  implicit none
  private
  public :: plane_t, outlet_t

  !> `axis` is the unit normal towards the free side.
  type, extends(surface_t) :: plane_t
  contains
    procedure, nopass :: features => plane_features
    procedure, nopass :: keys => plane_keys
    procedure :: set => plane_set
    procedure :: locate => plane_locate
    procedure :: way => plane_way
    procedure :: level => plane_level
  end type plane_t

  type, extends(plane_t) :: outlet_t
  contains
    procedure, nopass :: features => outlet_features
  end type outlet_t

contains

  pure function plane_features() result(features)
    type(surface_features_t) :: features
    features = surface_features_t("plane", endless=.true.)
  end function plane_features

  pure function outlet_features() result(features)
    type(surface_features_t) :: features
    features = surface_features_t("outlet", endless=.true., touches=.false., lets_out=.true.)
  end function outlet_features

  pure subroutine plane_keys(keys)
    type(declared_key_t), allocatable, intent(out) :: keys(:)

    allocate (keys(2))
    keys(1) = point_key
    keys(2) = declared_key_t("normal", "", "not all 0", "", "direction towards the free side, of any length", 3)
  end subroutine plane_keys

  pure subroutine plane_set(self, values, wrong, expected)
    class(plane_t), intent(inout) :: self
    real(dp), intent(in), contiguous :: values(:, :)
    character(len=:), allocatable, intent(out) :: wrong, expected

    wrong = ""
    expected = ""
    self%point(:) = values(:, 1)
    if (is_vector(values(:, 2))) then
      call set_direction(values(:, 2), self%axis)
    else
      wrong = "normal"
    end if
  end subroutine plane_set

  pure subroutine plane_locate(self, from, distance, normal)
    class(plane_t), intent(in) :: self
    real(dp), intent(in) :: from(3)
    real(dp), intent(out) :: distance, normal(3)

    distance = sum(from*self%axis)
    normal(:) = self%axis
  end subroutine plane_locate

  pure real(dp) function plane_way(self, before) result(way)
    class(plane_t), intent(in) :: self
    class(surface_t), intent(in) :: before
    way = abs(sum((self%point - before%point)*self%axis))
  end function plane_way

  pure subroutine plane_level(self, axis, level, known)
    class(plane_t), intent(in) :: self
    integer, intent(in) :: axis
    real(dp), intent(out) :: level
    logical, intent(out) :: known

    level = self%point(axis)
    known = abs(self%axis(axis)) > facing
  end subroutine plane_level

end module gravier_plane
