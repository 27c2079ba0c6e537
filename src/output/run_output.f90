!> The outputs that a run asks for, opened, written and closed together.
module gravier_run_output
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_communicator, only: communicator_t
  use gravier_timers, only: start_timer, stop_timer, phase_output
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_output, only: after_solve, of_states, of_checkpoints, of_end
  use gravier_output_registry, only: output_holder_t, registered_outputs
  implicit none
  private
  public :: run_output_t

  type :: run_output_t
    private
    type(communicator_t), pointer :: comm => null()
    !> those that are wanted
    type(output_holder_t), allocatable :: output(:)
  contains
    procedure :: open => run_output_open
    procedure :: due => run_output_due
    procedure :: write => run_output_write
    procedure :: finish => run_output_finish
  end type run_output_t

contains

  !> Open the outputs that the input asks for in the output directory, which exists. Collective; errors are the same on all ranks.
  subroutine run_output_open(self, simulation, command, error)
    class(run_output_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    !> the command line of the program
    character(len=*), intent(in) :: command
    type(error_t), allocatable, intent(inout) :: error
    type(output_holder_t), allocatable :: all_kinds(:)
    logical, allocatable :: wanted(:)
    integer :: k, n

    self%comm => simulation%comm
    call registered_outputs(all_kinds)
    allocate (wanted(size(all_kinds)))
    do k = 1, size(all_kinds)
      wanted(k) = all_kinds(k)%output%wanted(simulation%config)
    end do
    allocate (self%output(count(wanted)))
    n = 0
    do k = 1, size(all_kinds)
      if (.not. wanted(k)) cycle
      n = n + 1
      call move_alloc(all_kinds(k)%output, self%output(n)%output)
      call self%output(n)%output%open(simulation, trim(simulation%config%output%directory)//"/", command, error)
      call self%comm%agree(error)
    end do
  end subroutine run_output_open

  !> Whether some output of a stage is due in a step.
  pure logical function run_output_due(self, stage, step) result(due)
    class(run_output_t), intent(in) :: self
    !> one of the constants of gravier_output
    integer, intent(in) :: stage
    integer, intent(in) :: step
    integer :: k

    due = .false.
    do k = 1, size(self%output)
      associate (item => self%output(k)%output)
        due = due .or. (item%stage == stage .and. item%schedule%due(step))
      end associate
    end do
  end function run_output_due

  !> Write the outputs of a stage that are due in the present step and not written yet. Collective; rank 0 may have an error before,
  !> and all ranks have the same one afterwards where something was due.
  subroutine run_output_write(self, stage, simulation, figures, seconds, error, always)
    class(run_output_t), intent(inout) :: self
    !> one of the constants of gravier_output
    integer, intent(in) :: stage
    type(simulation_t), intent(inout) :: simulation
    !> of the step, and its wall time [s]; defaults at the start
    type(step_figures_t), intent(in) :: figures
    real(dp), intent(in) :: seconds
    type(error_t), allocatable, intent(inout) :: error
    !> whether they are due or not
    logical, intent(in), optional :: always
    logical :: all_due, wrote
    integer :: k

    call start_timer(phase_output)
    all_due = .false.
    wrote = .false.
    if (present(always)) all_due = always
    do k = 1, size(self%output)
      associate (item => self%output(k)%output)
        if (item%stage /= stage .or. item%last == simulation%step) cycle
        if (.not. (all_due .or. item%schedule%due(simulation%step))) cycle
        ! contacts of bodies that sleep come back for whoever writes contacts
        if (any(stage == [after_solve, of_states, of_end])) call simulation%make_whole()
        if (stage == of_checkpoints) call sync(self, error)
        ! before the first one rank 0 may have an error alone, as of a line of the log
        if (.not. wrote) call self%comm%agree(error)
        call item%write(simulation, figures, seconds, error)
        call self%comm%agree(error)
        item%last = simulation%step
        wrote = .true.
      end associate
    end do
    call stop_timer(phase_output)
  end subroutine run_output_write

  !> Bring the tables to the disk: a checkpoint goes on from their rows. Collective; errors are the same on all ranks.
  subroutine sync(self, error)
    class(run_output_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    integer :: k

    do k = 1, size(self%output)
      call self%output(k)%output%sync(error)
      call self%comm%agree(error)
    end do
  end subroutine sync

  !> Write the last state and what belongs to the end, and close. Collective; errors are the same on all ranks.
  subroutine run_output_finish(self, simulation, keep_last, error)
    class(run_output_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: simulation
    !> whether the present state is one to keep
    logical, intent(in) :: keep_last
    type(error_t), allocatable, intent(inout) :: error
    type(step_figures_t) :: none
    integer :: k

    if (keep_last) then
      call self%write(of_states, simulation, none, 0.0_dp, error, always=.true.)
      call self%write(of_end, simulation, none, 0.0_dp, error, always=.true.)
    end if
    do k = 1, size(self%output)
      call self%output(k)%output%finish(error)
    end do
    call self%comm%agree(error)
  end subroutine run_output_finish

end module gravier_run_output
