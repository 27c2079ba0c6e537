!> Problems of frictional contact read from files, solved and timed by the methods asked for.
module gravier_fclib_study
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_magnitude, only: is_size, size_text
  use gravier_communicator, only: communicator_t
  use gravier_fclib_file, only: fclib_local_t, fclib_global_t, read_fclib
  use gravier_condensation, only: multipliers_t, condense, eliminate_constraints
  use gravier_delassus, only: delassus_t
  use gravier_friction_solver, only: friction_control_t, friction_report_t, solve_friction
  implicit none
  private
  public :: problem_t, read_problem, solve_timed

  !> A problem reduced to its contacts, as in files and packed, and the multipliers of the bilateral constraints that it is rid of.
  type :: problem_t
    type(fclib_local_t), allocatable :: local
    type(delassus_t) :: packed
    type(multipliers_t) :: multipliers
    !> W is that of the file, entry by entry
    logical :: same_matrix = .false.
  end type problem_t

  !> solves shorter than this are repeated for so long, and the median of their times is taken [s]
  real(dp), parameter :: short = 0.02_dp
  integer, parameter :: most_repeats = 101

contains

  !> Read a problem and reduce it to its contacts. Every message begins with the path. Collective.
  subroutine read_problem(comm, path, problem, error)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    type(problem_t), intent(inout) :: problem
    type(error_t), allocatable, intent(inout) :: error
    type(fclib_global_t), allocatable :: global
    type(error_t), allocatable :: reason

    call read_fclib(comm, path, problem%local, global, error)
    if (allocated(error)) return
    if (allocated(global)) then
      allocate (problem%local)
      call condense(global, problem%local, problem%multipliers, reason)
      if (allocated(global%r)) problem%local%r = global%r
      problem%local%remark = global%remark
    else
      problem%same_matrix = problem%local%remark == "" .and. size(problem%local%s) == 0
      call eliminate_constraints(problem%local, problem%multipliers, reason)
    end if
    associate (local => problem%local)
      call problem%packed%init(local%dimension, local%w, local%q, local%mu, reason)
    end associate
    call check_sizes(problem%packed, reason)
    if (allocated(reason)) call raise(error, status_input, path//": "//reason%message)
  end subroutine read_problem

  !> Refuse a problem whose measures overflow or are lost beside 0.
  subroutine check_sizes(packed, error)
    type(delassus_t), intent(in) :: packed
    type(error_t), allocatable, intent(inout) :: error
    integer :: a

    if (allocated(error)) return
    do a = 1, packed%n_contacts
      if (.not. is_size(packed%stiffness(a))) call raise(error, status_input, "contact "//to_text(a)//": mean diagonal of W is "// &
        & to_text(packed%stiffness(a))//": expected "//size_text)
    end do
    if (maxval(abs(packed%q)) > 0.0_dp .and. .not. is_size(maxval(abs(packed%q)))) call raise(error, status_input, &
      & "velocities without impulses of at most "//to_text(maxval(abs(packed%q)))//": expected 0, or "//size_text)
  end subroutine check_sizes

  !> Solve; processor time of the solve alone.
  subroutine solve_timed(problem, control, start, r, report, seconds, error)
    type(delassus_t), intent(in) :: problem
    type(friction_control_t), intent(in) :: control
    !> impulses to start from, result (dimension, contacts)
    real(dp), intent(in), contiguous :: start(:, :)
    real(dp), intent(out), contiguous :: r(:, :)
    type(friction_report_t), intent(out) :: report
    real(dp), intent(out) :: seconds
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: times(most_repeats), before, after
    integer :: n

    seconds = 0.0_dp
    r(:, :) = start
    n = 0
    do while (n < most_repeats .and. .not. allocated(error))
      r(:, :) = start
      call cpu_time(before)
      call solve_friction(problem, control, r, report, error)
      call cpu_time(after)
      n = n + 1
      times(n) = after - before
      if (sum(times(1:n)) >= short) exit
    end do
    if (n > 0) seconds = median(times(1:n))
  end subroutine solve_timed

  pure real(dp) function median(values)
    real(dp), intent(in) :: values(:)
    real(dp) :: sorted(size(values)), value
    integer :: i, j

    sorted = values
    do i = 2, size(sorted)
      value = sorted(i)
      j = i
      do while (j > 1)
        if (sorted(j - 1) <= value) exit
        sorted(j) = sorted(j - 1)
        j = j - 1
      end do
      sorted(j) = value
    end do
    median = sorted((size(sorted) + 1)/2)
  end function median

end module gravier_fclib_study
