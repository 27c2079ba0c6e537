!> What the study of the columns leaves: a table for the reader and two tables as CSV.
module gravier_columns_report
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_csv_writer, only: csv_writer_t
  use gravier_solve_report, only: solve_report_t, solve_converged, solve_diverged
  use gravier_columns_study, only: column_t, method_t, methods, sweep_counts
  implicit none
  private
  public :: write_table, write_csv

  !> widths in the table: of the names of methods, and of a number
  integer, parameter :: name_width = 24, number_width = 10
  !> significant digits of errors and residuals: few enough to be the same on any machine
  integer, parameter :: digits = 4

contains

  !> Print iterations, methods down, columns and n_GS across.
  subroutine write_table(unit, columns, tolerance, reports)
    integer, intent(in) :: unit
    type(column_t), intent(in) :: columns(:)
    character(len=*), intent(in) :: tolerance
    !> (sweep_counts, methods, columns)
    type(solve_report_t), intent(in) :: reports(:, :, :)
    character(len=:), allocatable :: line
    integer :: c, m, k

    write (unit, "(a)") "DDM iterations (n_GS sweeps, then an exchange) until |r - r_exact|/|r_exact| < "//tolerance, ""
    line = repeat(" ", name_width)
    do c = 1, size(columns)
      line = line//right(title(columns(c)), size(sweep_counts)*number_width)
    end do
    write (unit, "(a)") line
    line = left("n_GS", name_width)
    do c = 1, size(columns)
      do k = 1, size(sweep_counts)
        line = line//right(to_text(sweep_counts(k)), number_width)
      end do
    end do
    write (unit, "(a)") line, repeat("-", len(line))
    do m = 1, size(methods)
      line = left(name_of(methods(m)), name_width)
      do c = 1, size(columns)
        do k = 1, size(sweep_counts)
          line = line//right(count_text(reports(k, m, c)), number_width)
        end do
      end do
      write (unit, "(a)") line
    end do
    write (unit, "(a)") ""
  end subroutine write_table

  pure function title(column) result(text)
    type(column_t), intent(in) :: column
    character(len=:), allocatable :: text
    text = to_text(column%disks)//" disks, "//to_text(column%subdomains)//" subdomains"
  end function title

  pure function name_of(method) result(text)
    type(method_t), intent(in) :: method
    character(len=:), allocatable :: text
    text = trim(method%label)
    if (method%direction /= "") text = text//", l = "//trim(method%direction)
  end function name_of

  !> Iterations of a solve, or why it did not converge.
  pure function count_text(report) result(text)
    type(solve_report_t), intent(in) :: report
    character(len=:), allocatable :: text
    text = to_text(report%iterations)
    if (report%status == solve_converged) return
    text = ">"//text
    if (report%status == solve_diverged) text = "diverged"
  end function count_text

  pure function left(text, width) result(padded)
    character(len=*), intent(in) :: text
    integer, intent(in) :: width
    character(len=:), allocatable :: padded
    padded = text//repeat(" ", max(width - len(text), 0))
  end function left

  pure function right(text, width) result(padded)
    character(len=*), intent(in) :: text
    integer, intent(in) :: width
    character(len=:), allocatable :: padded
    padded = repeat(" ", max(width - len(text), 1))//text
  end function right

  !> Write DIRECTORY/columns_table.csv and DIRECTORY/columns_error.csv. Not collective: on one rank.
  subroutine write_csv(directory, columns, reports, error)
    character(len=*), intent(in) :: directory
    type(column_t), intent(in) :: columns(:)
    !> (sweep_counts, methods, columns)
    type(solve_report_t), intent(in) :: reports(:, :, :)
    type(error_t), allocatable, intent(inout) :: error
    type(csv_writer_t) :: table, errors
    integer :: c, m, k

    call table%open(directory//"/columns_table.csv", "problem,disks,subdomains,method,l,n_gs,iterations,converged", error)
    call errors%open(directory//"/columns_error.csv", "problem,method,l,n_gs,iteration,error,residual", error)
    do c = 1, size(columns)
      do m = 1, size(methods)
        do k = 1, size(sweep_counts)
          call table%add(columns(c)%problem)
          call table%add(columns(c)%disks)
          call table%add(columns(c)%subdomains)
          call add_case(table, methods(m), sweep_counts(k))
          call table%add(reports(k, m, c)%iterations)
          call table%add(merge(1, 0, reports(k, m, c)%status == solve_converged))
          call table%end_row(error)
          call write_trace(errors, columns(c), methods(m), sweep_counts(k), reports(k, m, c), error)
        end do
      end do
    end do
    call table%close(error)
    call errors%close(error)
  end subroutine write_csv

  subroutine add_case(table, method, sweeps)
    type(csv_writer_t), intent(inout) :: table
    type(method_t), intent(in) :: method
    integer, intent(in) :: sweeps
    call table%add(trim(method%name))
    call table%add(trim(method%direction))
    call table%add(sweeps)
  end subroutine add_case

  !> One row an iteration, from 0, the start.
  subroutine write_trace(errors, column, method, sweeps, report, error)
    type(csv_writer_t), intent(inout) :: errors
    type(column_t), intent(in) :: column
    type(method_t), intent(in) :: method
    integer, intent(in) :: sweeps
    type(solve_report_t), intent(in) :: report
    type(error_t), allocatable, intent(inout) :: error
    integer :: k

    do k = 1, report%n_trace
      call errors%add(column%problem)
      call add_case(errors, method, sweeps)
      call errors%add(nint(report%trace(1, k)))
      call errors%add(to_text(report%trace(4, k), digits))
      call errors%add(to_text(report%trace(2, k), digits))
      call errors%end_row(error)
    end do
  end subroutine write_trace

end module gravier_columns_report
