!> What a study of accuracy leaves: accuracy.csv, one row a run or a check, accuracy_summary.csv and a table for the reader.
module gravier_accuracy_report
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_statistics, only: median, slope
  use gravier_csv_writer, only: csv_writer_t
  use gravier_build_info, only: version, revision, compiler, build_type
  use gravier_machine, only: processor_model, compiler_flags, date_text
  use gravier_accuracy_study, only: study_t
  use gravier_accuracy_motion, only: unknown
  use gravier_accuracy_run, only: run_t
  use gravier_accuracy_measure, only: case_run_t, case_solve_t
  implicit none
  private
  public :: write_runs, write_solves, print_solves, summary_t

  character(len=*), parameter :: case_columns = "title,kind,variant,method,acceleration,dimension,grains,contacts,subdomains,"// &
    & "ranks,tolerance,step,theta"
  character(len=*), parameter :: machine_columns = "machine,compiler,flags,build,version,revision,date"
  !> decades of the criterion that the summary of a solve goes through
  integer, parameter :: n_decades = 12

  type :: summary_row_t
    character(len=:), allocatable :: variant, figure
    real(dp) :: value = 0.0_dp
  end type summary_row_t

  !> A few figures of each variant.
  type :: summary_t
    integer :: n = 0
    type(summary_row_t), allocatable :: rows(:)
  contains
    procedure :: note => summary_note
    procedure :: print => summary_print
    procedure :: write => summary_write
  end type summary_t

contains

  !> Write the runs, and sum them up. Not collective: on one rank.
  subroutine write_runs(study, cases, reference, ranks, summary, error)
    type(study_t), intent(in) :: study
    !> (values, variants)
    type(case_run_t), intent(in) :: cases(:, :)
    !> where it is tight: the last row
    type(case_run_t), intent(in) :: reference
    integer, intent(in) :: ranks
    type(summary_t), intent(out) :: summary
    type(error_t), allocatable, intent(inout) :: error
    type(csv_writer_t) :: table
    character(len=:), allocatable :: header
    integer :: v, k, q

    header = case_columns//",vary,value,knee,steps,iterations,failed,residual,largest_overlap,mean_radius,position_error,"// &
      & "position_error_max,velocity_error,force_error,stress_error"
    do q = 1, size(study%quantities)
      header = header//","//study%quantities(q)%text//","//study%quantities(q)%text//"_error"
    end do
    header = header//",solve_seconds,solve_seconds_low,solve_seconds_high,run_seconds,run_seconds_low,run_seconds_high,repeats,"// &
      & machine_columns
    call table%open(study%directory//"/accuracy.csv", header, error)
    do v = 1, size(cases, 2)
      do k = 1, size(cases, 1)
        call write_row(table, study, study%variants(v)%name, study%values(k)%text, cases(k, v), ranks, error)
      end do
    end do
    if (study%reference == "tight") call write_row(table, study, study%tight%name, "", reference, ranks, error)
    call table%close(error)
    do v = 1, size(cases, 2)
      call sum_up(study, study%variants(v)%name, cases(:, v), summary)
      call note_failed(summary, study%variants(v)%name, sum(cases(:, v)%run%failed))
    end do
    if (study%reference == "tight") call note_failed(summary, study%tight%name, reference%run%failed)
  end subroutine write_runs

  subroutine write_row(table, study, name, value, of, ranks, error)
    type(csv_writer_t), intent(inout) :: table
    type(study_t), intent(in) :: study
    !> of the variant; of the key that is varied, as it is written
    character(len=*), intent(in) :: name, value
    type(case_run_t), intent(in) :: of
    integer, intent(in) :: ranks
    type(error_t), allocatable, intent(inout) :: error
    integer :: q

    call add_case(table, study, name, of%run, ranks)
    call table%add(study%vary)
    call table%add(value)
    call table%add(study%knee)
    call add_figures(table, of)
    do q = 1, size(study%quantities)
      call table%add(of%run%means(q))
      call add_known(table, of%errors(q))
    end do
    call add_seconds(table, of%solve_seconds)
    call add_seconds(table, of%run_seconds)
    call table%add(size(of%solve_seconds))
    call add_machine(table)
    call table%end_row(error)
  end subroutine write_row

  subroutine add_case(table, study, name, run, ranks)
    type(csv_writer_t), intent(inout) :: table
    type(study_t), intent(in) :: study
    !> of the variant
    character(len=*), intent(in) :: name
    type(run_t), intent(in) :: run
    integer, intent(in) :: ranks

    call table%add(study%title)
    call table%add(study%kind)
    call table%add(name)
    call table%add(trim(run%config%solver%method))
    call table%add(trim(run%config%solver%acceleration))
    call table%add(run%config%scene%dimension)
    call table%add(run%grains)
    call table%add(run%contacts)
    call table%add(run%subdomains)
    call table%add(ranks)
    call table%add(run%config%solver%tolerance)
    call table%add(run%config%time%step)
    call table%add(run%config%time%theta)
  end subroutine add_case

  !> What every run has.
  subroutine add_figures(table, of)
    type(csv_writer_t), intent(inout) :: table
    type(case_run_t), intent(in) :: of

    call table%add(of%run%steps)
    call table%add(of%run%iterations)
    call table%add(of%run%failed)
    call table%add(of%run%residual)
    call table%add(of%run%overlap)
    call table%add(of%run%mean_radius)
    call add_known(table, of%distance%position)
    call add_known(table, of%distance%position_max)
    call add_known(table, of%distance%velocity)
    call add_known(table, of%run%force_error)
    call add_known(table, of%stress_error)
  end subroutine add_figures

  !> A figure, or an empty cell for one that is not known.
  subroutine add_known(table, value)
    type(csv_writer_t), intent(inout) :: table
    real(dp), intent(in) :: value

    if (value < 0.0_dp) then
      call table%add("")
    else
      call table%add(value)
    end if
  end subroutine add_known

  !> Median, least and greatest.
  subroutine add_seconds(table, seconds)
    type(csv_writer_t), intent(inout) :: table
    real(dp), intent(in) :: seconds(:)

    call table%add(median(seconds))
    call table%add(minval(seconds))
    call table%add(maxval(seconds))
  end subroutine add_seconds

  subroutine add_machine(table)
    type(csv_writer_t), intent(inout) :: table

    call table%add(processor_model())
    call table%add(compiler)
    call table%add(compiler_flags())
    call table%add(build_type)
    call table%add(version)
    call table%add(revision)
    call table%add(date_text())
  end subroutine add_machine

  !> Order of convergence over steps, knee over tolerances, growth of the cost over anything else.
  subroutine sum_up(study, name, cases, summary)
    type(study_t), intent(in) :: study
    !> of the variant
    character(len=*), intent(in) :: name
    !> (values)
    type(case_run_t), intent(in) :: cases(:)
    type(summary_t), intent(inout) :: summary
    real(dp) :: x(size(cases)), y(size(cases))
    integer :: k, q

    do k = 1, size(cases)
      x(k) = study%value_of(k)
    end do
    select case (study%vary)
    case ("step")
      y(:) = cases%distance%position
      call note_slope(summary, name, "order_position", x, y)
      y(:) = cases%distance%velocity
      call note_slope(summary, name, "order_velocity", x, y)
    case ("tolerance")
      if (study%reference /= "tight") return
      do q = 1, size(study%quantities)
        do k = 1, size(cases)
          y(k) = cases(k)%errors(q)
        end do
        call note_knee(summary, name, study%quantities(q)%text, place_of_knee(x, y, study%knee), x, cases)
      end do
      y(:) = cases%stress_error
      call note_knee(summary, name, "stress", place_of_knee(x, y, study%knee), x, cases)
    case default
      if (maxval(cases%run%grains) > minval(cases%run%grains)) x(:) = real(cases%run%grains, dp)
      y(:) = real(cases%run%iterations, dp)
      call note_slope(summary, name, "growth_iterations", x, y)
      do k = 1, size(cases)
        y(k) = median(cases(k)%solve_seconds)
      end do
      call note_slope(summary, name, "growth_seconds", x, y)
    end select
  end subroutine sum_up

  !> Slope of ln y over ln x, over the points where both are positive; two are needed.
  subroutine note_slope(summary, name, figure, x, y)
    type(summary_t), intent(inout) :: summary
    character(len=*), intent(in) :: name, figure
    real(dp), intent(in) :: x(:), y(:)
    real(dp) :: log_x(size(x)), log_y(size(x))
    integer :: k, n

    n = 0
    do k = 1, size(x)
      if (.not. (x(k) > 0.0_dp .and. y(k) > 0.0_dp)) cycle
      n = n + 1
      log_x(n) = log(x(k))
      log_y(n) = log(y(k))
    end do
    if (n > 1) call summary%note(name, figure, slope(log_x(1:n), log_y(1:n)))
  end subroutine note_slope

  !> Place of the largest tolerance such that with it and all smaller ones the error is at most `limit`; 0 for none.
  pure integer function place_of_knee(tolerances, errors, limit) result(place)
    real(dp), intent(in) :: tolerances(:), errors(:), limit
    logical :: good
    integer :: k

    place = 0
    do k = 1, size(tolerances)
      good = all(errors >= 0.0_dp .and. errors <= limit .or. tolerances > tolerances(k))
      if (.not. good) cycle
      if (place == 0) place = k
      if (tolerances(k) > tolerances(place)) place = k
    end do
  end function place_of_knee

  !> How many solves missed their tolerance, where some have: orders and knees are not those of such runs.
  subroutine note_failed(summary, name, failed)
    type(summary_t), intent(inout) :: summary
    character(len=*), intent(in) :: name
    integer, intent(in) :: failed

    if (failed > 0) call summary%note(name, "failed_solves", real(failed, dp))
  end subroutine note_failed

  subroutine note_knee(summary, name, quantity, k, x, cases)
    type(summary_t), intent(inout) :: summary
    character(len=*), intent(in) :: name, quantity
    !> place of the knee, 0 for none
    integer, intent(in) :: k
    real(dp), intent(in) :: x(:)
    type(case_run_t), intent(in) :: cases(:)

    if (k == 0) return
    call summary%note(name, "knee:"//quantity, x(k))
    call summary%note(name, "knee_seconds:"//quantity, median(cases(k)%solve_seconds))
  end subroutine note_knee

  !> Write the solves, one row a check, and sum them up: what it takes to each decade. Not collective: on one rank.
  subroutine write_solves(study, cases, ranks, summary, error)
    type(study_t), intent(in) :: study
    !> (variants)
    type(case_solve_t), intent(in) :: cases(:)
    integer, intent(in) :: ranks
    type(summary_t), intent(out) :: summary
    type(error_t), allocatable, intent(inout) :: error
    type(csv_writer_t) :: table
    integer :: v, k

    call table%open(study%directory//"/accuracy.csv", case_columns//",iteration,residual,jump,error,seconds,seconds_low,"// &
      & "seconds_high,repeats,"//machine_columns, error)
    do v = 1, size(cases)
      associate (of => cases(v))
        do k = 1, of%report%n_trace
          call add_case(table, study, study%variants(v)%name, of%run, ranks)
          call table%add(nint(of%report%trace(1, k)))
          call table%add(of%report%trace(2, k))
          call table%add(of%report%trace(3, k))
          call add_known(table, of%report%trace(4, k))
          call add_seconds(table, of%seconds(k, :))
          call table%add(study%repeats)
          call add_machine(table)
          call table%end_row(error)
        end do
        call sum_up_solve(study%variants(v)%name, of, summary)
      end associate
    end do
    call table%close(error)
  end subroutine write_solves

  !> Iterations and seconds to each decade.
  subroutine sum_up_solve(name, of, summary)
    character(len=*), intent(in) :: name
    type(case_solve_t), intent(in) :: of
    type(summary_t), intent(inout) :: summary
    integer :: d, k

    do d = 1, n_decades
      k = first_check(of, d)
      if (k == 0) exit
      call summary%note(name, "iterations_to_1e-"//to_text(d), of%report%trace(1, k))
      call summary%note(name, "seconds_to_1e-"//to_text(d), median(of%seconds(k, :)))
    end do
  end subroutine sum_up_solve

  !> The first check at which what the tolerance is compared with is at most 10^-d; 0 for none.
  pure integer function first_check(of, d) result(k)
    type(case_solve_t), intent(in) :: of
    integer, intent(in) :: d
    integer :: row

    row = merge(4, 2, of%run%config%solver%criterion == "error")
    do k = 1, of%report%n_trace
      if (of%report%trace(row, k) <= 10.0_dp**(-d)) return
    end do
    k = 0
  end function first_check

  !> Print the iterations of solves to each decade.
  subroutine print_solves(unit, study, cases)
    integer, intent(in) :: unit
    type(study_t), intent(in) :: study
    !> (variants)
    type(case_solve_t), intent(in) :: cases(:)
    character(len=8) :: cells(n_decades)
    integer :: v, d, k

    do d = 1, n_decades
      cells(d) = "1e-"//to_text(d)
    end do
    write (unit, "(2x, a, t28, 12(1x, a))") "iterations to", (adjustr(cells(d)), d=1, n_decades)
    do v = 1, size(cases)
      do d = 1, n_decades
        k = first_check(cases(v), d)
        cells(d) = "-"
        if (k > 0) cells(d) = to_text(nint(cases(v)%report%trace(1, k)))
      end do
      write (unit, "(2x, a, t28, 12(1x, a))") study%variants(v)%name, (adjustr(cells(d)), d=1, n_decades)
    end do
  end subroutine print_solves

  subroutine summary_note(self, variant, figure, value)
    class(summary_t), intent(inout) :: self
    character(len=*), intent(in) :: variant, figure
    real(dp), intent(in) :: value
    type(summary_row_t), allocatable :: longer(:)
    integer :: k

    if (.not. allocated(self%rows)) allocate (self%rows(32))
    if (self%n == size(self%rows)) then
      allocate (longer(2*self%n))
      do k = 1, self%n
        longer(k) = self%rows(k)
      end do
      call move_alloc(longer, self%rows)
    end if
    self%n = self%n + 1
    self%rows(self%n)%variant = variant
    self%rows(self%n)%figure = figure
    self%rows(self%n)%value = value
  end subroutine summary_note

  subroutine summary_print(self, unit)
    class(summary_t), intent(in) :: self
    integer, intent(in) :: unit
    integer :: k

    do k = 1, self%n
      write (unit, "(2x, a, t32, a, t64, es11.3)") self%rows(k)%variant, self%rows(k)%figure, self%rows(k)%value
    end do
  end subroutine summary_print

  !> Write the table. Not collective: on one rank.
  subroutine summary_write(self, path, error)
    class(summary_t), intent(in) :: self
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    type(csv_writer_t) :: table
    integer :: k

    call table%open(path, "variant,figure,value,"//machine_columns, error)
    do k = 1, self%n
      call table%add(self%rows(k)%variant)
      call table%add(self%rows(k)%figure)
      call table%add(self%rows(k)%value)
      call add_machine(table)
      call table%end_row(error)
    end do
    call table%close(error)
  end subroutine summary_write

end module gravier_accuracy_report
