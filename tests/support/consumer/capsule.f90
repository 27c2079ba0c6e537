!> A shape of one's own: a capsule, all points within a radius of a segment. Grains are outside.
module capsule
  use gravier_kinds, only: dp
  use gravier_declared_keys, only: declared_key_t
  use gravier_surface, only: surface_t, surface_features_t, point_key
  implicit none
  private
  public :: capsule_t

  !> `point` and the first edge are the segment.
  type, extends(surface_t) :: capsule_t
  contains
    procedure, nopass :: features => capsule_features
    procedure, nopass :: keys => capsule_keys
    procedure :: set => capsule_set
    procedure :: locate => capsule_locate
  end type capsule_t

contains

  pure function capsule_features() result(features)
    type(surface_features_t) :: features
    features = surface_features_t("capsule")
  end function capsule_features

  pure subroutine capsule_keys(keys)
    type(declared_key_t), allocatable, intent(out) :: keys(:)

    allocate (keys(3))
    keys(1) = point_key
    keys(2) = declared_key_t("end", "", "", "m", "the second end, another than `point`", 3)
    keys(3) = declared_key_t("half_thickness", "", "> 0", "m", "distance of the surface from the segment")
  end subroutine capsule_keys

  pure subroutine capsule_set(self, values, wrong, expected)
    class(capsule_t), intent(inout) :: self
    real(dp), intent(in), contiguous :: values(:, :)
    character(len=:), allocatable, intent(out) :: wrong, expected

    wrong = ""
    expected = ""
    self%point(:) = values(:, 1)
    self%edge(:, 1) = values(:, 2) - values(:, 1)
    self%radius = values(1, 3)
    if (.not. norm2(self%edge(:, 1)) > 0.0_dp) then
      wrong = "end"
      expected = "another point than point"
    else if (.not. self%radius > 0.0_dp) then
      wrong = "half_thickness"
    end if
  end subroutine capsule_set

  pure subroutine capsule_locate(self, from, distance, normal)
    class(capsule_t), intent(in) :: self
    real(dp), intent(in) :: from(3)
    real(dp), intent(out) :: distance, normal(3)
    real(dp) :: share

    share = dot_product(from, self%edge(:, 1))/dot_product(self%edge(:, 1), self%edge(:, 1))
    normal(:) = from - min(max(share, 0.0_dp), 1.0_dp)*self%edge(:, 1)
    distance = norm2(normal)
    normal(:) = normal/max(distance, tiny(1.0_dp))
    distance = distance - self%radius
  end subroutine capsule_locate

end module capsule
