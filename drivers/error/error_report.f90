!> What gravier_error leaves: a table, one row a state that was looked at.
module gravier_error_report
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_csv_writer, only: csv_writer_t
  use gravier_build_info, only: version, revision, compiler, build_type
  use gravier_machine, only: processor_model, compiler_flags, date_text
  use gravier_error_plan, only: plan_t, row_t
  implicit none
  private
  public :: write_rows, print_rows

  character(len=*), parameter :: header = "title,method,situation,step,iterations,residual,true_error,estimate,projection,"// &
    & "levels,bound,depth,velocity_scale,mass,grains,contacts,subdomains,ranks,sweeps,seconds,layered,layered_sweeps,"// &
    & "reference_residual,reference_estimate,reference_spread,reference_iterations,"// &
    & "machine,compiler,flags,build,version,revision,date"

contains

  !> Write the rows. Not collective: on one rank.
  subroutine write_rows(path, plan, rows, ranks, error)
    character(len=*), intent(in) :: path
    type(plan_t), intent(in) :: plan
    type(row_t), intent(in) :: rows(:)
    integer, intent(in) :: ranks
    type(error_t), allocatable, intent(inout) :: error
    type(csv_writer_t) :: table
    integer :: k

    call table%open(path, header, error)
    do k = 1, size(rows)
      associate (row => rows(k))
        call table%add(trim(plan%config%scene%title))
        call table%add(trim(plan%config%solver%method))
        call table%add(row%situation)
        call table%add(row%step)
        call table%add(row%iterations)
        call table%add(row%residual)
        call table%add(row%true_error)
        call table%add(row%estimate)
        call table%add(row%projection)
        call table%add(row%levels)
        call table%add(row%bound)
        call table%add(row%depth)
        call table%add(row%scale)
        call table%add(row%mass)
        call table%add(row%grains)
        call table%add(row%contacts)
        call table%add(plan%config%decomposition%subdomains)
        call table%add(ranks)
        call table%add(row%sweeps)
        call table%add(row%seconds)
        call table%add(row%layered)
        call table%add(row%layered_sweeps)
        call table%add(row%reference%residual)
        call table%add(row%reference%estimate)
        call table%add(row%reference%spread)
        call table%add(row%reference%iterations)
      end associate
      call table%add(processor_model())
      call table%add(compiler)
      call table%add(compiler_flags())
      call table%add(build_type)
      call table%add(version)
      call table%add(revision)
      call table%add(date_text())
      call table%end_row(error)
    end do
    call table%close(error)
  end subroutine write_rows

  !> A line a row, errors in units of the velocity scale.
  subroutine print_rows(unit, rows)
    integer, intent(in) :: unit
    type(row_t), intent(in) :: rows(:)
    character(len=12) :: numbers(3)
    integer :: k

    write (unit, "(a)") "  step  iterations  true error  estimate    ratio       situation (errors in units of the velocity scale)"
    do k = 1, size(rows)
      associate (row => rows(k))
        numbers(:) = "-"
        if (row%scale > 0.0_dp) numbers(1) = to_text(row%true_error/row%scale, 3)
        if (row%scale > 0.0_dp) numbers(2) = to_text(row%estimate/row%scale, 3)
        if (row%true_error > 0.0_dp) numbers(3) = to_text(row%estimate/row%true_error, 3)
        write (unit, "(i6,i10,4x,3a,a)") row%step, row%iterations, numbers, row%situation
      end associate
    end do
  end subroutine print_rows

end module gravier_error_report
