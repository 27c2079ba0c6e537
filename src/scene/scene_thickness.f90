!> How thin the bodies of a scene are on average.
module gravier_scene_thickness
  use gravier_kinds, only: dp
  use gravier_communicator, only: communicator_t
  use gravier_scene, only: scene_t
  implicit none
  private
  public :: mean_half_thickness

contains

  !> Mean of half of the thickness of the grains where they are thinnest, of disks and spheres the radius; where grains enter, at
  !> most that of the thinnest of their shapes at the mean radius. Without shapes the mean radius [m]. Collective.
  real(dp) function mean_half_thickness(comm, scene) result(mean)
    type(communicator_t), intent(in) :: comm
    type(scene_t), intent(in) :: scene
    real(dp) :: half(scene%grains%n), entering
    integer :: k, p

    mean = scene%mean_radius
    if (.not. scene%effects%shapes) return
    do k = 1, scene%grains%n
      half(k) = scene%grains%radius(k)*scene%shapes%half_thickness_of(scene%grains%shape(k))
    end do
    if (scene%n_grains > 0) mean = comm%sum_real(half)/real(scene%n_grains, dp)
    do p = 1, size(scene%insertions)
      if (.not. allocated(scene%insertions(p)%shape)) cycle
      do k = 1, size(scene%insertions(p)%shape)
        entering = scene%insertions(p)%radii%moment(1)*scene%shapes%half_thickness_of(scene%insertions(p)%shape(k))
        mean = min(mean, entering)
      end do
    end do
  end function mean_half_thickness

end module gravier_scene_thickness
