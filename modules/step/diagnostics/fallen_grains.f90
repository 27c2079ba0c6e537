!> Grains that have fallen below all boundaries. No boundary lies under them any more, so that they fall for ever.
module gravier_fallen_grains
  use gravier_kinds, only: dp, i8
  use gravier_boundary, only: boundary_t
  use gravier_decomposition, only: decomposition_t
  use gravier_physics, only: physics_t
  implicit none
  private
  public :: fallen_grains_t

  !> steps from one look to the next
  integer, parameter :: looks_every = 100
  !> component of a unit vector below which it counts as 0
  real(dp), parameter :: level = 1.0e-6_dp

  type :: fallen_grains_t
    !> in the state of the last look
    integer(i8) :: number = 0
    !> the lowest identifier among them; 0 for none
    integer(i8) :: first = 0
    !> by how many they have become more than ever before in the last step
    integer(i8) :: more = 0
    integer(i8), private :: most = 0
  contains
    procedure :: note_step => fallen_grains_note_step
    procedure :: look => fallen_grains_look
  end type fallen_grains_t

contains

  !> Look at the grains after every hundredth step, and find how many more there are. Collective.
  subroutine fallen_grains_note_step(self, step, decomposition, physics, turns)
    class(fallen_grains_t), intent(inout) :: self
    integer, intent(in) :: step
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics
    !> gravity changes in the course of the run
    logical, intent(in) :: turns

    self%more = 0
    if (mod(step, looks_every) /= 0) return
    call self%look(decomposition, physics, turns)
    self%more = max(0_i8, self%number - self%most)
    self%most = max(self%most, self%number)
  end subroutine fallen_grains_note_step

  !> Count the grains that move down and whose highest point is lower than all boundaries. Down is the direction of gravity. There
  !> are none without gravity or where it changes, with a body force, in a scene that is periodic along gravity, where a plane faces
  !> up or a cylinder is inclined, and where an outlet takes grains. Collective.
  subroutine fallen_grains_look(self, decomposition, physics, turns)
    class(fallen_grains_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics
    !> gravity changes in the course of the run
    logical, intent(in) :: turns
    real(dp) :: down(3), floor, first
    integer :: nd, s, k, r
    logical :: applies

    self%number = 0
    self%first = 0
    applies = norm2(physics%gravity) > 0.0_dp .and. .not. (turns .or. any(abs(physics%body_force) > 0.0_dp))
    if (applies) down(:) = physics%gravity/norm2(physics%gravity)
    if (applies) applies = .not. any(decomposition%period%length > 0.0_dp .and. abs(down) > level)
    ! ranks that have come to differ by the loop of a user go through the same messages
    if (.not. decomposition%comm%any_true(applies)) return
    floor = merge(-huge(1.0_dp), huge(1.0_dp), applies)
    if (.not. applies) down(:) = 0.0_dp
    do k = 1, size(decomposition%boundaries)
      floor = max(floor, lowest_place(decomposition%boundaries(k), down))
    end do
    nd = decomposition%nd
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        do k = 1, owned%n
          if (owned%glued(k) == 0) cycle
          floor = max(floor, dot_product(owned%position(:, k), down(1:nd)) + owned%radius(k))
        end do
      end associate
    end do
    floor = decomposition%comm%highest(floor)
    ! no boundary is there, or one that ends nowhere
    if (abs(floor) > 0.5_dp*huge(1.0_dp)) return
    first = huge(1.0_dp)
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        do r = 1, owned%awake%n
          do k = owned%awake%first(r), owned%awake%last(r)
            if (owned%glued(k) > 0) cycle
            if (dot_product(owned%position(:, k), down(1:nd)) - owned%radius(k) <= floor) cycle
            if (.not. dot_product(owned%velocity(1:nd, k), down(1:nd)) > 0.0_dp) cycle
            self%number = self%number + 1
            first = min(first, real(owned%id(k), dp))
          end do
        end do
      end associate
    end do
    self%number = decomposition%comm%total(self%number)
    first = decomposition%comm%lowest(first)
    if (self%number > 0) self%first = nint(first, i8)
  end subroutine fallen_grains_look

  !> How far a boundary reaches down [m]: huge where it has no lowest point or takes grains, -huge where it cannot stop what falls.
  pure real(dp) function lowest_place(boundary, down) result(lowest)
    type(boundary_t), intent(in) :: boundary
    !> unit vector
    real(dp), intent(in) :: down(3)
    real(dp) :: corner(3, 8)
    integer :: n, k

    lowest = -huge(1.0_dp)
    if (boundary%lets_out()) then
      lowest = huge(1.0_dp)
    else if (boundary%touches()) then
      associate (surface => boundary%surface)
        if (surface%is%endless) then
          if (dot_product(surface%axis, down) < -level) lowest = huge(1.0_dp)
        else if (surface%is%endless_axis .and. abs(dot_product(surface%axis, down)) > level) then
          ! upright, it is like a plane that faces across
          if (abs(dot_product(surface%axis, down)) < 1.0_dp - level) lowest = huge(1.0_dp)
        else
          call surface%find_box(n, corner)
          do k = 1, n
            lowest = max(lowest, dot_product(down, corner(:, k)) + surface%radius)
          end do
        end if
      end associate
    end if
  end function lowest_place

end module gravier_fallen_grains
