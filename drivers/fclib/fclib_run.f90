!> What gravier_fclib does: read problems, solve them, judge and write what was found.
module gravier_fclib_run
  use, intrinsic :: iso_fortran_env, only: output_unit, error_unit
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, status_unconverged
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_file_system, only: path_t, make_directory
  use gravier_own_files, only: check_own_files
  use gravier_output_lock, only: output_lock_t
  use gravier_csv_writer, only: csv_writer_t
  use gravier_fclib_file, only: name_of_solution, name_of_guess
  use gravier_fclib_writer, only: write_fclib_local, fclib_origin_t
  use gravier_friction_solver, only: friction_control_t, verdict_no_solution
  use gravier_fclib_options, only: options_t
  use gravier_fclib_outputs, only: written_path, check_outputs
  use gravier_fclib_study, only: problem_t, read_problem, solve_timed
  use gravier_fclib_report, only: result_t, print_heading, print_result, open_results, add_result, write_profile
  implicit none
  private
  public :: run_study

  character(len=*), parameter :: nl = new_line("a")

contains

  !> Read every problem, take the places that are written to, then solve. Collective.
  subroutine run_study(comm, options, files, status, error)
    type(communicator_t), intent(in) :: comm
    type(options_t), intent(in) :: options
    type(path_t), intent(in) :: files(:)
    integer, intent(inout) :: status
    type(error_t), allocatable, intent(inout) :: error
    type(problem_t) :: problem
    type(output_lock_t) :: directory_lock, csv_lock, profile_lock
    character(len=:), allocatable :: notes
    integer :: p

    if (comm%rank == 0) call check_outputs(files, options%csv, options%profile, options%directory, error)
    call comm%agree(error)
    notes = ""
    do p = 1, size(files)
      call read_problem(comm, files(p)%text, problem, error)
      if (allocated(error)) return
      notes = notes//notes_on(options, files(p)%text, problem)
    end do
    if (comm%rank == 0) write (error_unit, "(a)", advance="no") notes
    if (options%directory /= "") then
      if (comm%rank == 0) call make_directory(options%directory, error)
      call comm%agree(error)
      call directory_lock%take_directory(comm, options%directory, "gravier_fclib", error)
    end if
    if (options%csv /= "") call csv_lock%take_file(comm, options%csv, "gravier_fclib", error)
    if (options%profile /= "") call profile_lock%take_file(comm, options%profile, "gravier_fclib", error)
    if (.not. allocated(error)) call solve_all(comm, options, files, status, error)
    call directory_lock%release()
    call csv_lock%release()
    call profile_lock%release()
  end subroutine run_study

  !> Solve every problem by every method, and write what was asked for. Collective.
  subroutine solve_all(comm, options, files, status, error)
    type(communicator_t), intent(in) :: comm
    type(options_t), intent(in) :: options
    type(path_t), intent(in) :: files(:)
    integer, intent(inout) :: status
    type(error_t), allocatable, intent(inout) :: error
    type(problem_t) :: problem
    type(result_t), allocatable :: results(:, :)
    type(csv_writer_t) :: table
    integer :: p, failed, unbounded

    if (comm%rank == 0) then
      if (options%csv /= "") call open_results(table, options%csv, error)
      if (.not. allocated(error)) call print_heading()
    end if
    call comm%agree(error)
    allocate (results(size(options%methods), size(files)))
    do p = 1, size(files)
      call read_problem(comm, files(p)%text, problem, error)
      if (allocated(error)) return
      call solve_problem(comm, options, files(p)%text, problem, results(:, p), table, error)
    end do
    failed = count(.not. results%report%converged)
    unbounded = count(results%report%verdict == verdict_no_solution)
    if (failed > 0) status = status_unconverged
    if (comm%rank == 0) then
      if (table%is_open()) call table%close(error)
      if (options%profile /= "") call write_profile(options%profile, options%methods, results, error)
      call check_own_files(error)
      if (failed > 0) write (output_unit, "(a)") "*** "//to_text(failed)//" of "//to_text(size(results))// &
        & " solves did NOT reach the tolerance "//to_text(options%tolerance, 2)
      if (unbounded > 0) write (output_unit, "(a)") "*** "//to_text(unbounded)//" of "//to_text(size(results))// &
        & " solves found NO solution: loads grow without bound"
      flush (output_unit)
    end if
    call comm%agree(error)
  end subroutine solve_all

  !> Lines to say of a problem once all files are read: what was read otherwise than it stands, and that --warm has nothing to start
  !> from.
  function notes_on(options, path, problem) result(notes)
    type(options_t), intent(in) :: options
    character(len=*), intent(in) :: path
    type(problem_t), intent(in) :: problem
    character(len=:), allocatable :: notes

    notes = ""
    if (problem%local%remark /= "") notes = "gravier_fclib: note: "//path//": "//problem%local%remark//nl
    if (options%warm .and. .not. allocated(problem%local%r)) notes = notes//"gravier_fclib: note: "//path// &
      & ": --warm found neither "//name_of_solution//" nor "//name_of_guess//": the solve starts from zero impulses"//nl
  end function notes_on

  !> One problem by every method. Collective.
  subroutine solve_problem(comm, options, path, problem, results, table, error)
    type(communicator_t), intent(in) :: comm
    type(options_t), intent(in) :: options
    character(len=*), intent(in) :: path
    type(problem_t), intent(inout) :: problem
    !> (methods)
    type(result_t), intent(inout) :: results(:)
    type(csv_writer_t), intent(inout) :: table
    type(error_t), allocatable, intent(inout) :: error
    type(friction_control_t) :: control
    real(dp), allocatable :: start(:, :), r(:, :), v(:, :), l(:)
    character(len=:), allocatable :: name
    integer :: m

    name = path(index(path, "/", back=.true.) + 1:)
    control%tolerance = options%tolerance
    control%max_iterations = options%max_iterations
    allocate (start(problem%local%dimension, size(problem%local%mu)))
    allocate (r, v, mold=start)
    start(:, :) = 0.0_dp
    if (options%warm .and. allocated(problem%local%r)) start(:, :) = problem%local%r
    do m = 1, size(options%methods)
      control%method = trim(options%methods(m))
      results(m)%problem = name
      results(m)%method = control%method
      results(m)%dimension = problem%local%dimension
      results(m)%contacts = size(problem%local%mu)
      call solve_timed(problem%packed, control, start, r, results(m)%report, results(m)%seconds, error)
      call comm%agree(error)
      if (allocated(error)) return
      if (comm%rank /= 0) cycle
      call print_result(results(m))
      if (table%is_open()) call add_result(table, results(m), error)
    end do
    call comm%agree(error)
    if (options%directory == "" .or. allocated(error)) return
    call problem%packed%velocity(r, v)
    call problem%multipliers%evaluate(r, l)
    problem%local%r = r
    call write_fclib_local(comm, written_path(options%directory, path), problem%local, error, velocity=v, multipliers=l, &
      & origin=fclib_origin_t(path, problem%same_matrix))
  end subroutine solve_problem

end module gravier_fclib_run
