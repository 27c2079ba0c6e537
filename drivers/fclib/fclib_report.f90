!> What gravier_fclib reports: a line a solve, the same as CSV, and the performance profile of the methods.
module gravier_fclib_report
  use, intrinsic :: iso_fortran_env, only: output_unit
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_csv_writer, only: csv_writer_t
  use gravier_text, only: to_text
  use gravier_delassus, only: most_impulse
  use gravier_unbounded, only: growth_proven
  use gravier_friction_solver, only: friction_report_t, verdict_solved, verdict_no_solution
  implicit none
  private
  public :: result_t, print_heading, print_result, open_results, add_result, write_profile

  !> One problem solved by one method.
  type :: result_t
    character(len=:), allocatable :: problem, method
    integer :: dimension = 0, contacts = 0
    !> of processor time
    real(dp) :: seconds = 0.0_dp
    type(friction_report_t) :: report
  end type result_t

  character(len=*), parameter :: columns = &
    & "problem,dimension,contacts,method,sweeps,newton_steps,seconds,e,es,converged,verdict,proof"

contains

  subroutine print_heading()
    write (output_unit, "(a, t48, a)") "problem", "contacts  method    sweeps  newton    seconds        e       es  status"
  end subroutine print_heading

  subroutine print_result(result)
    type(result_t), intent(in) :: result
    integer :: width

    width = max(46, len(result%problem))
    write (output_unit, "(a, i9, 2x, a8, 2i8, es11.3, 2es9.1, 2x, a)") result%problem//repeat(" ", width - len(result%problem)), &
      & result%contacts, result%method, result%report%sweeps, result%report%newton_steps, result%seconds, &
      & result%report%literature, result%report%consistent, status_text(result%report)
    flush (output_unit)
  end subroutine print_result

  !> The verdict in words.
  pure function status_text(report) result(text)
    type(friction_report_t), intent(in) :: report
    character(len=:), allocatable :: text

    select case (report%verdict)
    case (verdict_solved)
      text = "converged"
    case (verdict_no_solution)
      text = "no solution found: loads grow without bound, most at contact "//to_text(report%growth%contact)// &
        & trim(merge(" (proven)", "         ", is_proven(report)))
    case default
      text = "NOT CONVERGED"
      if (.not. report%impulse <= most_impulse) text = text//": the impulse of contact "//to_text(report%worst(2))// &
        & " is beyond what loads can make"
    end select
  end function status_text

  !> Whether the growth of the impulses proves that there is no solution.
  pure logical function is_proven(report)
    type(friction_report_t), intent(in) :: report
    is_proven = report%verdict == verdict_no_solution .and. report%growth%kind == growth_proven
  end function is_proven

  !> The verdict in a word, for tables.
  pure function verdict_name(report) result(name)
    type(friction_report_t), intent(in) :: report
    character(len=:), allocatable :: name

    select case (report%verdict)
    case (verdict_solved)
      name = "solved"
    case (verdict_no_solution)
      name = "no_solution"
    case default
      name = "not_converged"
    end select
  end function verdict_name

  subroutine open_results(table, path, error)
    type(csv_writer_t), intent(inout) :: table
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    call table%open(path, columns, error)
  end subroutine open_results

  subroutine add_result(table, result, error)
    type(csv_writer_t), intent(inout) :: table
    type(result_t), intent(in) :: result
    type(error_t), allocatable, intent(inout) :: error

    call table%add(result%problem)
    call table%add(result%dimension)
    call table%add(result%contacts)
    call table%add(result%method)
    call table%add(result%report%sweeps)
    call table%add(result%report%newton_steps)
    call table%add(result%seconds)
    call table%add(result%report%literature)
    call table%add(result%report%consistent)
    call table%add(merge(1, 0, result%report%converged))
    call table%add(verdict_name(result%report))
    call table%add(merge(1, 0, is_proven(result%report)))
    call table%end_row(error)
  end subroutine add_result

  !> Performance profile: for each method the fraction of all problems that it solved within `ratio` times the seconds of the
  !> fastest method that solved them.
  subroutine write_profile(path, methods, results, error)
    character(len=*), intent(in) :: path
    character(len=*), intent(in) :: methods(:)
    !> (methods, problems)
    type(result_t), intent(in) :: results(:, :)
    type(error_t), allocatable, intent(inout) :: error
    !> largest ratio, and points for each factor of 10
    real(dp), parameter :: last = 1.0e4_dp
    integer, parameter :: points = 20
    type(csv_writer_t) :: table
    character(len=:), allocatable :: header
    real(dp) :: ratios(size(results, 1), size(results, 2)), ratio
    integer :: i, m

    header = "ratio"
    do m = 1, size(methods)
      header = header//","//trim(methods(m))
    end do
    ratios = ratios_to_best(results)
    call table%open(path, header, error)
    do i = 0, points*nint(log10(last))
      ratio = 10.0_dp**(real(i, dp)/points)
      call table%add(ratio)
      do m = 1, size(methods)
        call table%add(count(ratios(m, :) <= ratio)/real(size(results, 2), dp))
      end do
      call table%end_row(error)
    end do
    call table%close(error)
  end subroutine write_profile

  !> Seconds of each solve relative to the fastest of its problem; beyond all ratios where it did not converge.
  pure function ratios_to_best(results) result(ratios)
    type(result_t), intent(in) :: results(:, :)
    real(dp) :: ratios(size(results, 1), size(results, 2)), best
    integer :: m, p

    do p = 1, size(results, 2)
      best = huge(best)
      do m = 1, size(results, 1)
        if (results(m, p)%report%converged) best = min(best, results(m, p)%seconds)
      end do
      do m = 1, size(results, 1)
        ratios(m, p) = huge(best)
        if (results(m, p)%report%converged) ratios(m, p) = results(m, p)%seconds/max(best, tiny(best))
        if (results(m, p)%report%converged .and. results(m, p)%seconds <= best) ratios(m, p) = 1.0_dp
      end do
    end do
  end function ratios_to_best

end module gravier_fclib_report
