!> Volume, thickness, inertia and free rotation of bodies, whatever their shapes.
module gravier_body_figures
  use gravier_kinds, only: dp
  use gravier_motion, only: grain_volume, free_spin, inertia_in_global_axes, spin_energy
  use gravier_shape_library, only: shape_library_t
  use gravier_body_store, only: body_set_t
  implicit none
  private
  public :: body_figures_t

  !> What holds for all bodies of a shape. Without shapes there are no arrays, and bodies are disks or spheres.
  type :: body_figures_t
    private
    !> volume of a body of radius 1 (shapes)
    real(dp), allocatable :: volume(:)
    !> half of the least width of a body of radius 1 (shapes)
    real(dp), allocatable :: half_thickness(:)
    !> principal moments of inertia over the largest (3, shapes)
    real(dp), allocatable :: principal(:, :)
  contains
    procedure :: init => body_figures_init
    procedure :: volume_of => body_figures_volume_of
    procedure :: half_thickness_of => body_figures_half_thickness_of
    procedure :: add_rotation => body_figures_add_rotation
    procedure :: find_inverse_inertia => body_figures_find_inverse_inertia
    procedure :: turn_freely => body_figures_turn_freely
  end type body_figures_t

contains

  subroutine body_figures_init(self, shapes)
    class(body_figures_t), intent(inout) :: self
    type(shape_library_t), intent(in) :: shapes
    integer :: k

    if (allocated(self%volume)) deallocate (self%volume, self%half_thickness, self%principal)
    if (shapes%n == 0) return
    allocate (self%volume(shapes%n), self%half_thickness(shapes%n), self%principal(3, shapes%n))
    do k = 1, shapes%n
      self%volume(k) = shapes%volume_of(k)
      self%half_thickness(k) = shapes%half_thickness_of(k)
      self%principal(:, k) = shapes%shape(k)%inertia/maxval(shapes%shape(k)%inertia)
    end do
  end subroutine body_figures_init

  !> Volume of body `k` [m^3, m^2 in 2D].
  pure real(dp) function body_figures_volume_of(self, bodies, k) result(volume)
    class(body_figures_t), intent(in) :: self
    type(body_set_t), intent(in) :: bodies
    integer, intent(in) :: k

    if (bodies%no > 0) then
      if (bodies%shape(k) > 0) then
        volume = self%volume(bodies%shape(k))*bodies%radius(k)**bodies%nd
        return
      end if
    end if
    volume = grain_volume(bodies%nd, bodies%radius(k))
  end function body_figures_volume_of

  !> Half of the thickness of body `k` where it is thinnest, the radius of a disk or a sphere [m].
  pure real(dp) function body_figures_half_thickness_of(self, bodies, k) result(half)
    class(body_figures_t), intent(in) :: self
    type(body_set_t), intent(in) :: bodies
    integer, intent(in) :: k

    half = bodies%radius(k)
    if (bodies%no == 0) return
    if (bodies%shape(k) > 0) half = self%half_thickness(bodies%shape(k))*half
  end function body_figures_half_thickness_of

  !> Add the energy that body `k` has at a spin [J]; none where bodies do not turn.
  pure subroutine body_figures_add_rotation(self, bodies, k, velocity, energy)
    class(body_figures_t), intent(in) :: self
    type(body_set_t), intent(in) :: bodies
    integer, intent(in) :: k
    !> (nv) [m/s, rad/s]
    real(dp), intent(in), contiguous :: velocity(:)
    real(dp), intent(inout) :: energy
    real(dp) :: principal(3)

    if (bodies%nv == bodies%nd) return
    if (bodies%no == 4) then
      if (bodies%shape(k) > 0) then
        principal(:) = bodies%inertia(k)*self%principal(:, bodies%shape(k))
        energy = energy + spin_energy(principal, bodies%orientation(:, k), velocity(4:6))
        return
      end if
    end if
    energy = energy + 0.5_dp*bodies%inertia(k)*sum(velocity(bodies%nd + 1:)**2)
  end subroutine body_figures_add_rotation

  !> One over the inertia of body `k`: a number or, in space with shapes, the entries xx, yy, zz, xy, xz and yz of a symmetric
  !> matrix in global axes [1/(kg m^2)].
  pure subroutine body_figures_find_inverse_inertia(self, bodies, k, inverse)
    class(body_figures_t), intent(in) :: self
    type(body_set_t), intent(in) :: bodies
    integer, intent(in) :: k
    !> (1 or 6)
    real(dp), intent(out), contiguous :: inverse(:)
    real(dp) :: principal(3), entries(6)

    inverse(:) = 0.0_dp
    if (size(inverse) == 1) then
      inverse(1) = 1.0_dp/bodies%inertia(k)
    else if (bodies%shape(k) == 0) then
      inverse(1:3) = 1.0_dp/bodies%inertia(k)
    else
      principal(:) = 1.0_dp/(bodies%inertia(k)*self%principal(:, bodies%shape(k)))
      call inertia_in_global_axes(principal, bodies%orientation(:, k), entries)
      inverse(:) = entries
    end if
  end subroutine body_figures_find_inverse_inertia

  !> The spin of body `k` after a time without moments: that of before but of bodies in space with unlike moments of inertia.
  pure subroutine body_figures_turn_freely(self, bodies, k, duration, velocity)
    class(body_figures_t), intent(in) :: self
    !> at the middle of the step
    type(body_set_t), intent(in) :: bodies
    integer, intent(in) :: k
    !> [s]
    real(dp), intent(in) :: duration
    !> (nv) [m/s, rad/s]
    real(dp), intent(inout), contiguous :: velocity(:)

    if (bodies%no < 4) return
    if (bodies%shape(k) > 0) call free_spin(self%principal(:, bodies%shape(k)), bodies%orientation(:, k), duration, velocity(4:6))
  end subroutine body_figures_turn_freely

end module gravier_body_figures
