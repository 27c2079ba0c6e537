!> What every diagnostic is: a group of figures of a step that a user asks for by one key of &output. A diagnostic says its key,
!> when it measures and what it keeps for a checkpoint. It looks at a solved step and gives its figures as columns with names.
module gravier_diagnostic
  use gravier_kinds, only: dp, i8
  use gravier_contact_problem, only: contact_problem_t
  use gravier_decomposition, only: decomposition_t
  use gravier_halo, only: halo_t
  use gravier_physics, only: physics_t
  implicit none
  private
  public :: diagnostic_t, diagnostic_features_t, solved_step_t, column_list_t, histogram_t
  public :: in_each_step, in_written_steps, name_length

  !> when a diagnostic measures: in each step, so that its columns are in history.csv and in results.h5; or in the steps alone whose
  !> state is written, so that they are in results.h5 only
  integer, parameter :: in_each_step = 1, in_written_steps = 2
  !> of the name of a column; what is longer is cut
  integer, parameter :: name_length = 256
  !> columns for which a list has room at first
  integer, parameter :: first_room = 16

  !> What a diagnostic says of itself.
  type :: diagnostic_features_t
    !> key of &output, .false. by default, that asks for it, or the group of its own that does; the meaning of the key, for the
    !> reference of keys
    character(len=28) :: key = ""
    character(len=120) :: meaning = ""
    !> in_each_step or in_written_steps
    integer :: measures = in_each_step
    !> its columns hold for the scene as a whole, and are written to results.h5; others are in history.csv alone
    logical :: of_scene = .true.
    !> what its columns describe may be absent; they are NaN then
    logical :: may_be_absent = .false.
    !> words of 64 bits that a checkpoint keeps, 0: it has no past; the name of their array in the file, and what they are, one by
    !> one: with the text a checkpoint changes its version
    integer :: n_words = 0
    character(len=28) :: array = ""
    character(len=200) :: record = ""
  end type diagnostic_features_t

  !> A step that is solved, as diagnostics see it. They change nothing of it: the problem is theirs for its exchange alone.
  type :: solved_step_t
    !> owned grains and boundaries, with the velocities of the end of the step; in `take_step` places are those of its middle, in
    !> `measure` those of its end
    type(decomposition_t), pointer :: decomposition => null()
    !> the views have the velocities of the start of the step and the places of its middle
    type(halo_t), pointer :: halo => null()
    type(physics_t), pointer :: physics => null()
    type(contact_problem_t), pointer :: problem => null()
    !> of the contacts on each boundary (nd, boundaries) [N s]
    real(dp), pointer, contiguous :: boundary_impulses(:, :) => null()
    !> start of the step [s]
    real(dp) :: time = 0.0_dp
    !> free grains of the scene
    integer(i8) :: n_free = 0
    !> grains were taken out of the scene in this step, or have entered it
    logical :: others = .false.
  end type solved_step_t

  !> Columns of a table: names and values.
  type :: column_list_t
    integer :: n = 0
    !> (n and more)
    character(len=name_length), allocatable :: name(:)
    real(dp), allocatable :: value(:)
  contains
    procedure :: clear => column_list_clear
    procedure :: add => column_list_add
    procedure :: add_tensor => column_list_add_tensor
  end type column_list_t

  !> Counts of equal bins that begin at 0.
  type :: histogram_t
    !> of the dataset in results.h5
    character(len=:), allocatable :: name
    integer(i8), allocatable :: counts(:)
    real(dp) :: bin_width = 0.0_dp
  end type histogram_t

  !> The same on every rank. `features`, `measure` and `columns` are what a diagnostic must have.
  type, abstract :: diagnostic_t
  contains
    procedure(features_interface), deferred, nopass :: features
    procedure(measure_interface), deferred :: measure
    procedure(columns_interface), deferred :: columns
    procedure :: begin => diagnostic_begin
    procedure :: take_step => diagnostic_take_step
    procedure :: get_histogram => diagnostic_get_histogram
    procedure :: get_state => diagnostic_get_state
    procedure :: set_state => diagnostic_set_state
  end type diagnostic_t

  abstract interface
    !> What it is, whatever its state.
    pure function features_interface() result(features)
      import :: diagnostic_features_t
      implicit none
      type(diagnostic_features_t) :: features
    end function features_interface

    !> Measure the step when it is over, in the steps of `features%measures`. Collective.
    subroutine measure_interface(self, step)
      import :: diagnostic_t, solved_step_t
      implicit none
      class(diagnostic_t), intent(inout) :: self
      type(solved_step_t), intent(in) :: step
    end subroutine measure_interface

    !> Add names and values of its columns, the same names in the same order from `begin` on.
    subroutine columns_interface(self, list)
      import :: diagnostic_t, column_list_t
      implicit none
      class(diagnostic_t), intent(in) :: self
      type(column_list_t), intent(inout) :: list
    end subroutine columns_interface
  end interface

contains

  !> Begin with the scene as it is: allocate, and take what later steps are compared with. By default nothing. Collective.
  subroutine diagnostic_begin(self, decomposition, physics)
    class(diagnostic_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics

    associate (unused_self => self, unused => decomposition, unused_physics => physics)
    end associate
  end subroutine diagnostic_begin

  !> Take into account what is gone when the step is over; called in every step. By default nothing. Collective.
  subroutine diagnostic_take_step(self, step)
    class(diagnostic_t), intent(inout) :: self
    type(solved_step_t), intent(in) :: step

    associate (unused_self => self, unused => step)
    end associate
  end subroutine diagnostic_take_step

  !> A histogram beside the columns; not allocated, the default: there is none.
  subroutine diagnostic_get_histogram(self, histogram)
    class(diagnostic_t), intent(in) :: self
    type(histogram_t), allocatable, intent(out) :: histogram

    associate (unused_self => self, unused => histogram)
    end associate
  end subroutine diagnostic_get_histogram

  !> Its state bit by bit, `features%n_words` words; by default none.
  pure subroutine diagnostic_get_state(self, words)
    class(diagnostic_t), intent(in) :: self
    !> (n_words)
    integer(i8), intent(out) :: words(:)

    associate (unused_self => self)
    end associate
    words(:) = 0
  end subroutine diagnostic_get_state

  !> Take a state that `get_state` gave.
  pure subroutine diagnostic_set_state(self, words)
    class(diagnostic_t), intent(inout) :: self
    !> (n_words)
    integer(i8), intent(in) :: words(:)

    associate (unused_self => self, unused => words)
    end associate
  end subroutine diagnostic_set_state

  !> Forget all columns.
  pure subroutine column_list_clear(self)
    class(column_list_t), intent(inout) :: self
    self%n = 0
  end subroutine column_list_clear

  !> Add the next column.
  pure subroutine column_list_add(self, name, value)
    class(column_list_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(dp), intent(in) :: value
    character(len=name_length), allocatable :: longer(:)
    real(dp), allocatable :: more(:)

    if (.not. allocated(self%name)) allocate (self%name(first_room), self%value(first_room))
    if (self%n == size(self%name)) then
      allocate (longer(2*self%n), more(2*self%n))
      longer(1:self%n) = self%name
      more(1:self%n) = self%value
      call move_alloc(longer, self%name)
      call move_alloc(more, self%value)
    end if
    self%n = self%n + 1
    self%name(self%n) = name
    self%value(self%n) = value
  end subroutine column_list_add

  !> Add columns name_xx, name_xy, ..., row by row.
  pure subroutine column_list_add_tensor(self, name, tensor)
    class(column_list_t), intent(inout) :: self
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
  end subroutine column_list_add_tensor

end module gravier_diagnostic
