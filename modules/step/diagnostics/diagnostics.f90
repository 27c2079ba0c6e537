!> The figures of a step that a user asks for, as columns of a table. What is not asked for is neither computed nor kept.
module gravier_diagnostics
  use gravier_kinds, only: dp, i8
  use gravier_boundary, only: boundary_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_decomposition, only: decomposition_t
  use gravier_neighbourhood, only: neighbourhoods_t
  use gravier_physics, only: physics_t
  use gravier_energy_balance, only: energy_balance_t
  use gravier_mean_stress, only: mean_stress_t
  use gravier_contact_structure, only: contact_structure_t
  implicit none
  private
  public :: diagnostics_t, name_length

  !> of the name of a column; what is longer is cut
  integer, parameter :: name_length = 256
  !> columns that hold for the scene as a whole are no more
  integer, parameter :: most_of_scene = 64

  type :: diagnostics_t
    !> allocated where asked for; the same on every rank
    type(energy_balance_t), allocatable :: energy
    type(mean_stress_t), allocatable :: stress
    type(contact_structure_t), allocatable :: structure
    !> forces on boundaries and their places are asked for
    logical :: boundary_forces = .false.
    !> values are those of a step
    logical :: measured = .false.
    !> of the columns, and of them of those that hold for the scene as a whole: the first ones
    integer :: n_columns = 0, n_of_scene = 0
    !> (n_columns and more)
    character(len=name_length), allocatable :: name(:)
    real(dp), allocatable :: value(:)
  contains
    procedure :: init => diagnostics_init
    procedure :: take_step => diagnostics_take_step
    procedure :: measure => diagnostics_measure
    procedure, private :: add => diagnostics_add
    procedure, private :: add_tensor => diagnostics_add_tensor
    procedure, private :: fill => diagnostics_fill
  end type diagnostics_t

contains

  !> Ask for groups of figures, of a scene as it starts. Collective.
  subroutine diagnostics_init(self, decomposition, energy, stress, structure, boundary_forces)
    class(diagnostics_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    logical, intent(in) :: energy, stress, structure, boundary_forces
    real(dp) :: nothing(decomposition%nd, size(decomposition%boundaries))
    integer :: nd, room

    nd = decomposition%nd
    if (allocated(self%name)) deallocate (self%name, self%value)
    if (allocated(self%energy)) deallocate (self%energy)
    if (allocated(self%stress)) deallocate (self%stress)
    if (allocated(self%structure)) deallocate (self%structure)
    self%boundary_forces = boundary_forces
    if (energy) then
      allocate (self%energy)
      call self%energy%begin(decomposition)
    end if
    if (stress) then
      allocate (self%stress)
      allocate (self%stress%stress(nd, nd), source=0.0_dp)
    end if
    if (structure) then
      allocate (self%structure)
      allocate (self%structure%fabric(nd, nd), source=0.0_dp)
    end if
    self%measured = .false.
    self%n_columns = 0
    if (.not. (energy .or. stress .or. structure .or. boundary_forces)) return
    room = most_of_scene + 2*nd*size(decomposition%boundaries)
    allocate (self%name(room), self%value(room))
    nothing(:, :) = 0.0_dp
    call self%fill(decomposition%boundaries, nothing, 1.0_dp)
  end subroutine diagnostics_init

  !> What has to be taken while the views hold the velocities of the start of the step, bodies those of its end and the
  !> places of its middle. Collective.
  subroutine diagnostics_take_step(self, decomposition, neighbourhoods, physics, problem, impulses, time, some_left)
    class(diagnostics_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(neighbourhoods_t), intent(in) :: neighbourhoods
    type(physics_t), intent(in) :: physics
    type(contact_problem_t), intent(in) :: problem
    !> of the contacts on each boundary (nd, boundaries) [N s]
    real(dp), intent(in), contiguous :: impulses(:, :)
    !> start of the step [s]
    real(dp), intent(in) :: time
    !> grains were taken out of the scene in this step
    logical, intent(in) :: some_left

    if (allocated(self%energy)) call self%energy%take_step(decomposition, neighbourhoods, physics, problem, impulses, time, &
      & some_left)
  end subroutine diagnostics_take_step

  !> Measure the rest at the end of the step and fill the columns. Collective.
  subroutine diagnostics_measure(self, decomposition, physics, problem, impulses, n_free)
    class(diagnostics_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics
    type(contact_problem_t), intent(inout) :: problem
    !> of the contacts on each boundary (nd, boundaries) [N s]
    real(dp), intent(in), contiguous :: impulses(:, :)
    !> free grains of the scene
    integer(i8), intent(in) :: n_free

    if (self%n_columns == 0) return
    if (allocated(self%energy)) call self%energy%take_places(decomposition, physics)
    if (allocated(self%stress)) call self%stress%measure(decomposition, problem, physics%h)
    if (allocated(self%structure)) call self%structure%measure(problem, n_free, physics%h)
    call self%fill(decomposition%boundaries, impulses, physics%h)
    self%measured = .true.
  end subroutine diagnostics_measure

  !> Names and values of all columns.
  subroutine diagnostics_fill(self, boundaries, impulses, h)
    class(diagnostics_t), intent(inout) :: self
    type(boundary_t), intent(in) :: boundaries(:)
    !> of the grains on the boundaries in a step (nd, boundaries) [N s]
    real(dp), intent(in), contiguous :: impulses(:, :)
    !> [s]
    real(dp), intent(in) :: h
    integer :: b

    self%n_columns = 0
    if (allocated(self%energy)) call add_energy(self, self%energy)
    if (allocated(self%stress)) call add_stress(self, self%stress)
    if (allocated(self%structure)) call add_structure(self, self%structure)
    self%n_of_scene = self%n_columns
    if (.not. self%boundary_forces) return
    do b = 1, size(boundaries)
      call add_boundary(self, boundaries(b), impulses(:, b), h)
    end do
  end subroutine diagnostics_fill

  subroutine add_energy(self, energy)
    class(diagnostics_t), intent(inout) :: self
    type(energy_balance_t), intent(in) :: energy

    call self%add("kinetic_translation", energy%translation)
    call self%add("kinetic_rotation", energy%rotation)
    call self%add("kinetic_boundaries", energy%boundaries)
    call self%add("potential_energy", energy%potential)
    call self%add("load_work", energy%load_work)
    call self%add("boundary_work", energy%boundary_work)
    call self%add("dissipated_normal", energy%dissipated_normal)
    call self%add("dissipated_friction", energy%dissipated_friction)
    call self%add("carried_away", energy%carried_away)
    call self%add("energy_error", energy%error())
  end subroutine add_energy

  subroutine add_stress(self, stress)
    class(diagnostics_t), intent(inout) :: self
    type(mean_stress_t), intent(in) :: stress

    call self%add_tensor("stress", stress%stress)
    call self%add("pressure", stress%pressure())
    call self%add("volume", stress%volume)
    call self%add("solid_fraction", stress%solid_fraction)
  end subroutine add_stress

  subroutine add_structure(self, structure)
    class(diagnostics_t), intent(inout) :: self
    type(contact_structure_t), intent(in) :: structure

    call self%add("coordination", structure%coordination)
    call self%add("mechanical_coordination", structure%mechanical_coordination)
    call self%add("rattlers", real(structure%rattlers, dp))
    call self%add_tensor("fabric", structure%fabric)
    call self%add("carrying_fraction", structure%carrying_fraction)
    call self%add("sliding_fraction", structure%sliding_fraction)
    call self%add("force_mean", structure%force_mean)
    call self%add("force_deviation", structure%force_deviation)
    call self%add("force_max", structure%force_max)
    call self%add("overlap_mean", structure%overlap_mean)
  end subroutine add_structure

  !> Force of the grains on a boundary, and where it is.
  subroutine add_boundary(self, boundary, impulse, h)
    class(diagnostics_t), intent(inout) :: self
    type(boundary_t), intent(in) :: boundary
    !> (nd) [N s]
    real(dp), intent(in), contiguous :: impulse(:)
    !> [s]
    real(dp), intent(in) :: h
    character(len=*), parameter :: axes = "xyz"
    character(len=len(boundary%name)) :: name
    real(dp) :: place(3)
    integer :: d

    call boundary%find_place(place)
    name = boundary%name
    ! a cell of the head of a table holds neither
    do d = 1, len(name)
      if (scan(name(d:d), ',"') > 0) name(d:d) = "_"
    end do
    do d = 1, size(impulse)
      call self%add("force_"//axes(d:d)//":"//name, impulse(d)/h)
    end do
    do d = 1, size(impulse)
      call self%add("position_"//axes(d:d)//":"//name, place(d))
    end do
  end subroutine add_boundary

  !> Add the next column.
  subroutine diagnostics_add(self, name, value)
    class(diagnostics_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(dp), intent(in) :: value

    self%n_columns = self%n_columns + 1
    self%name(self%n_columns) = name
    self%value(self%n_columns) = value
  end subroutine diagnostics_add

  !> Columns name_xx, name_xy, ..., row by row.
  subroutine diagnostics_add_tensor(self, name, tensor)
    class(diagnostics_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    !> (nd, nd)
    real(dp), intent(in) :: tensor(:, :)
    character(len=*), parameter :: axes = "xyz"
    integer :: a, b

    do a = 1, size(tensor, 1)
      do b = 1, size(tensor, 2)
        call self%add(name//"_"//axes(a:a)//axes(b:b), tensor(a, b))
      end do
    end do
  end subroutine diagnostics_add_tensor

end module gravier_diagnostics
