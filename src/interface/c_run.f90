!> The C interface of a run, which gravier.h describes and the Python class gravier.Simulation uses: how it is opened, stepped and
!> closed, and its figures. Handles point to a user_loop_t. Every function that can fail returns 0 or the exit status of its error,
!> whose line gravier_error tells; none ends the process.
module gravier_c_run
  use, intrinsic :: iso_c_binding, only: c_associated, c_double, c_f_pointer, c_int, c_int64_t, c_null_ptr, c_ptr
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input, status_failure
  use gravier_abandon, only: end_all_ranks
  use gravier_communicator, only: join_parallel, stop_parallel
  use gravier_solve_report, only: solve_converged
  use gravier_run_tally, only: relative_error
  use gravier_restart, only: restart_t
  use gravier_user_loop, only: user_loop_t
  use gravier_c_handle, only: is_open, keep_open, forget_open, find_loop
  use gravier_c_text, only: told, text_of
  implicit none
  private
  public :: gravier_open, gravier_step, gravier_stop, gravier_checkpoint, gravier_close, gravier_finalize, gravier_abort
  public :: gravier_whole, gravier_real, gravier_sum, gravier_highest

  !> bits of the options of gravier_open
  integer, parameter :: restart_bit = 0, quiet_bit = 1, forces_bit = 2, changed_bit = 3

  !> MPI was started here
  logical :: started = .false.

contains

  !> Open a run; the handle is null after an error. Collective.
  integer(c_int) function gravier_open(path, command, options, communicator, handle) result(status) bind(C, name="gravier_open")
    !> texts of C: the input file, and who runs it
    type(c_ptr), value :: path, command
    integer(c_int), value :: options
    !> null, or the address of an integer that names a communicator
    type(c_ptr), value :: communicator
    type(c_ptr), intent(out) :: handle
    type(user_loop_t), pointer :: loop
    type(error_t), allocatable :: error, later
    integer(c_int), pointer :: number

    handle = c_null_ptr
    if (is_open()) call raise(error, status_input, "open: a simulation is open in this process; expected that it is closed before")
    call join_parallel(started, error)
    if (.not. allocated(error)) then
      allocate (loop)
      if (c_associated(communicator)) then
        call c_f_pointer(communicator, number)
        call loop%comm%init_from(number, error)
      else
        call loop%comm%init()
      end if
      if (.not. allocated(error)) call loop%open(text_of(path), text_of(command), &
        & restart_t(btest(options, restart_bit), btest(options, changed_bit)), btest(options, quiet_bit), &
        & btest(options, forces_bit), error)
      if (allocated(error)) then
        later = error
        if (loop%comm%alive) call loop%close(later)
        deallocate (loop)
      else
        handle = keep_open(loop)
      end if
    end if
    status = told(error)
  end function gravier_open

  !> Make a step. Collective.
  integer(c_int) function gravier_step(handle) result(status) bind(C, name="gravier_step")
    type(c_ptr), value :: handle
    type(user_loop_t), pointer :: loop
    type(error_t), allocatable :: error

    call find_loop(handle, loop, error)
    if (.not. allocated(error)) call loop%step(error)
    status = told(error)
  end function gravier_step

  !> End the run after the present step. Collective.
  integer(c_int) function gravier_stop(handle, reason) result(status) bind(C, name="gravier_stop")
    type(c_ptr), value :: handle
    !> text of C, for the log
    type(c_ptr), value :: reason
    type(user_loop_t), pointer :: loop
    type(error_t), allocatable :: error

    call find_loop(handle, loop, error)
    if (.not. allocated(error)) call loop%stop(text_of(reason), error)
    status = told(error)
  end function gravier_stop

  !> Write a checkpoint. Collective.
  integer(c_int) function gravier_checkpoint(handle) result(status) bind(C, name="gravier_checkpoint")
    type(c_ptr), value :: handle
    type(user_loop_t), pointer :: loop
    type(error_t), allocatable :: error

    call find_loop(handle, loop, error)
    if (.not. allocated(error)) call loop%write_checkpoint(error)
    status = told(error)
  end function gravier_checkpoint

  !> End a run and give back all that it holds; the status is the one that the program would exit with. Collective.
  integer(c_int) function gravier_close(handle) result(status) bind(C, name="gravier_close")
    type(c_ptr), value :: handle
    type(user_loop_t), pointer :: loop
    type(error_t), allocatable :: error
    integer :: ended

    call find_loop(handle, loop, error)
    ended = 0
    if (.not. allocated(error)) then
      call loop%close(error)
      ended = loop%run%status
      deallocate (loop)
      call forget_open()
    end if
    status = told(error)
    if (.not. allocated(error)) status = int(ended, c_int)
  end function gravier_close

  !> End MPI where it was started here. Collective.
  subroutine gravier_finalize() bind(C, name="gravier_finalize")
    if (started) call stop_parallel()
    started = .false.
  end subroutine gravier_finalize

  !> End all ranks at once with status 4: this one cannot go on. Not collective.
  subroutine gravier_abort() bind(C, name="gravier_abort")
    call end_all_ranks(status_failure)
  end subroutine gravier_abort

  !> A whole number of a run by its name.
  integer(c_int) function gravier_whole(handle, name, value) result(status) bind(C, name="gravier_whole")
    type(c_ptr), value :: handle
    !> text of C
    type(c_ptr), value :: name
    integer(c_int64_t), intent(out) :: value
    type(user_loop_t), pointer :: loop
    type(error_t), allocatable :: error

    value = 0
    call find_loop(handle, loop, error)
    if (.not. allocated(error)) call find_whole(loop, text_of(name), value, error)
    status = told(error)
  end function gravier_whole

  subroutine find_whole(loop, name, value, error)
    type(user_loop_t), intent(in) :: loop
    character(len=*), intent(in) :: name
    integer(c_int64_t), intent(inout) :: value
    type(error_t), allocatable, intent(inout) :: error

    associate (simulation => loop%run%simulation, figures => loop%run%figures)
      select case (name)
      case ("goes_on")
        value = merge(1, 0, loop%goes_on())
      case ("step")
        value = simulation%step
      case ("steps")
        value = simulation%config%time%steps
      case ("dimension")
        value = simulation%decomposition%nd
      case ("velocity_entries")
        value = simulation%decomposition%nv
      case ("subdomains")
        value = size(simulation%decomposition%owned)
      case ("boundaries")
        value = size(simulation%decomposition%boundaries)
      case ("rank")
        value = loop%comm%rank
      case ("ranks")
        value = loop%comm%size
      case ("restarted")
        value = merge(1, 0, simulation%restarted)
      case ("bodies")
        value = simulation%n_grains
      case ("contacts")
        value = figures%contacts
      case ("iterations")
        value = figures%solve%iterations
      case ("converged")
        value = merge(1, 0, figures%solve%status == solve_converged)
      case ("left")
        value = figures%left
      case ("entered")
        value = figures%entered
      case default
        call raise(error, status_input, "whole number '"//name//"': unknown; gravier.h has the names")
      end select
    end associate
  end subroutine find_whole

  !> A real number of a run by its name.
  integer(c_int) function gravier_real(handle, name, value) result(status) bind(C, name="gravier_real")
    type(c_ptr), value :: handle
    !> text of C
    type(c_ptr), value :: name
    real(c_double), intent(out) :: value
    type(user_loop_t), pointer :: loop
    type(error_t), allocatable :: error

    value = 0.0_dp
    call find_loop(handle, loop, error)
    if (.not. allocated(error)) call find_real(loop, text_of(name), value, error)
    status = told(error)
  end function gravier_real

  subroutine find_real(loop, name, value, error)
    type(user_loop_t), intent(in) :: loop
    character(len=*), intent(in) :: name
    real(dp), intent(inout) :: value
    type(error_t), allocatable, intent(inout) :: error
    integer :: k

    associate (simulation => loop%run%simulation, figures => loop%run%figures)
      select case (name)
      case ("time")
        value = simulation%time
      case ("time_step")
        value = simulation%physics%h
      case ("theta")
        value = simulation%physics%theta
      case ("gravity_x")
        value = simulation%physics%gravity(1)
      case ("gravity_y")
        value = simulation%physics%gravity(2)
      case ("gravity_z")
        value = simulation%physics%gravity(3)
      case ("friction")
        value = loop%between_grains%friction
      case ("kinetic_energy")
        value = simulation%balance%kinetic
      case ("max_overlap")
        value = figures%max_overlap
      case ("residual")
        value = figures%solve%residual
      case ("velocity_error")
        value = relative_error(figures%solve)
      case default
        do k = simulation%diagnostics%n_columns, 1, -1
          if (simulation%diagnostics%name(k) == name) exit
        end do
        if (k == 0) call raise(error, status_input, "real number '"//name//"': unknown; gravier.h has the names, and "// &
          & "options of &output add those of their columns in history.csv")
        if (k > 0) value = simulation%diagnostics%value(k)
      end select
    end associate
  end subroutine find_real

  !> Sums over the ranks, in place, that do not depend on their order. Collective.
  subroutine gravier_sum(handle, n, values) bind(C, name="gravier_sum")
    type(c_ptr), value :: handle
    integer(c_int), value :: n
    real(c_double), intent(inout) :: values(n)
    type(user_loop_t), pointer :: loop
    type(error_t), allocatable :: error
    real(dp) :: parts(n, 1)
    integer(c_int) :: status

    call find_loop(handle, loop, error)
    status = told(error)
    if (status /= 0) return
    parts(:, 1) = values
    call loop%comm%sum_parts(parts, values)
  end subroutine gravier_sum

  !> The highest values over the ranks, in place. Collective.
  subroutine gravier_highest(handle, n, values) bind(C, name="gravier_highest")
    type(c_ptr), value :: handle
    integer(c_int), value :: n
    real(c_double), intent(inout) :: values(n)
    type(user_loop_t), pointer :: loop
    type(error_t), allocatable :: error
    integer(c_int) :: status

    call find_loop(handle, loop, error)
    status = told(error)
    if (status == 0) call loop%comm%highest_of(values)
  end subroutine gravier_highest

end module gravier_c_run
