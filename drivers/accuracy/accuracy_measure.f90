!> All runs of a study, in rounds, and how far they are from what is exact or tight.
module gravier_accuracy_measure
  use, intrinsic :: iso_fortran_env, only: output_unit
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_config, only: config_t
  use gravier_solve_report, only: solve_report_t
  use gravier_simulation, only: simulation_t
  use gravier_accuracy_study, only: study_t
  use gravier_accuracy_motion, only: state_t, distance_t, exact_motion_t, compare_states, unknown
  use gravier_accuracy_run, only: run_t, run_case_in_memory, solve_first_step, find_quantities
  implicit none
  private
  public :: case_run_t, case_solve_t, check_scenes, measure_runs, measure_solves

  !> A run of the study, made `repeats` times.
  type :: case_run_t
    !> without its states
    type(run_t) :: run
    type(distance_t) :: distance
    !> of the mean stress, relative in the Frobenius norm; of the means of quantities, relative
    real(dp) :: stress_error = unknown
    real(dp), allocatable :: errors(:)
    !> (repeats) [s]
    real(dp), allocatable :: solve_seconds(:), run_seconds(:)
  end type case_run_t

  !> A solve of the study.
  type :: case_solve_t
    type(run_t) :: run
    type(solve_report_t) :: report
    !> of rank 0 until each check, without those of checks (checks, repeats) [s]
    real(dp), allocatable :: seconds(:, :)
  end type case_solve_t

contains

  !> Make the scenes of a study of runs, and refuse what only they tell: quantities that there are not, motions that are not
  !> known exactly. Errors are the same on all ranks. Collective.
  subroutine check_scenes(comm, study, error)
    type(communicator_t), target, intent(in) :: comm
    type(study_t), intent(in) :: study
    type(error_t), allocatable, intent(inout) :: error
    type(config_t) :: config
    type(state_t), allocatable :: states(:)
    integer :: v, k

    call study%make_config(1, 1, config, error)
    if (allocated(error)) return
    call check_quantities(comm, study, config, error)
    if (study%reference /= "exact") return
    do v = 1, size(study%variants)
      do k = 1, size(study%values)
        if (allocated(error)) return
        call study%make_config(v, k, config, error)
        if (.not. allocated(error)) call exact_states(comm, study, config, states, error)
      end do
    end do
  end subroutine check_scenes

  subroutine check_quantities(comm, study, config, error)
    type(communicator_t), target, intent(in) :: comm
    type(study_t), intent(in) :: study
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    type(simulation_t) :: simulation
    type(config_t) :: measured
    character(len=:), allocatable :: names
    integer :: places(size(study%quantities)), q, k

    measured = config
    call measured%output%ask("stress")
    call measured%output%ask("boundary_forces")
    call simulation%init(comm, measured, error)
    if (allocated(error)) return
    call find_quantities(simulation, study%quantities, places)
    names = "kinetic_energy max_overlap contacts"
    do k = 1, simulation%diagnostics%n_columns
      names = names//" "//trim(simulation%diagnostics%name(k))
    end do
    do q = 1, size(places)
      if (places(q) == 0) call study%complain("quantities: '"//study%quantities(q)%text//"'", "some of "//names, error)
    end do
    call simulation%free()
  end subroutine check_quantities

  !> The states of an exact motion at the samples of a run. Collective.
  subroutine exact_states(comm, study, config, states, error)
    type(communicator_t), target, intent(in) :: comm
    type(study_t), intent(in) :: study
    type(config_t), intent(in) :: config
    type(state_t), allocatable, intent(out) :: states(:)
    type(error_t), allocatable, intent(inout) :: error
    type(simulation_t) :: simulation
    type(exact_motion_t) :: motion
    logical :: known
    integer :: i

    call simulation%init(comm, config, error)
    if (allocated(error)) return
    call motion%init(simulation, known)
    call simulation%free()
    if (.not. known) then
      call study%complain("reference = 'exact'", "'tight' or 'none': exact is the motion of a column, and of one grain that "// &
        & "falls straight upon one plane at rest", error)
      return
    end if
    allocate (states(study%samples))
    do i = 1, study%samples
      call motion%at(i*(config%time%steps/study%samples)*config%time%step, states(i))
    end do
  end subroutine exact_states

  !> Run every variant with every value, the reference first; in rounds, so that what the machine does besides falls on all alike.
  !> Errors are the same on all ranks. Collective.
  subroutine measure_runs(comm, study, cases, reference, error)
    type(communicator_t), target, intent(in) :: comm
    type(study_t), intent(in) :: study
    !> (values, variants)
    type(case_run_t), allocatable, intent(out) :: cases(:, :)
    !> where it is tight
    type(case_run_t), intent(out) :: reference
    type(error_t), allocatable, intent(inout) :: error
    type(config_t) :: config
    type(run_t) :: run, tight
    integer :: v, k, r

    allocate (cases(size(study%values), size(study%variants)))
    if (study%reference == "tight") then
      call study%make_reference(config, error)
      if (.not. allocated(error)) call run_case_in_memory(comm, config, study%samples, study%quantities, tight, error)
      if (allocated(error)) return
      call say(comm, study%tight%name, "", tight)
    end if
    do r = 1, study%repeats
      do k = 1, size(study%values)
        do v = 1, size(study%variants)
          if (allocated(error)) return
          call study%make_config(v, k, config, error)
          if (.not. allocated(error)) call run_case_in_memory(comm, config, study%samples, study%quantities, run, error)
          if (allocated(error)) return
          if (r == 1) then
            call judge(comm, study, run, tight, cases(k, v), error)
            call say(comm, study%variants(v)%name, study%vary//" = "//study%values(k)%text//", ", run)
          end if
          cases(k, v)%solve_seconds(r) = run%solve_seconds
          cases(k, v)%run_seconds(r) = run%run_seconds
        end do
      end do
    end do
    if (study%reference /= "tight") return
    allocate (reference%solve_seconds(1), source=tight%solve_seconds)
    allocate (reference%run_seconds(1), source=tight%run_seconds)
    allocate (reference%errors(size(study%quantities)), source=unknown)
    deallocate (tight%states)
    reference%run = tight
  end subroutine measure_runs

  !> Compare a run, and keep what is kept of it. Collective.
  subroutine judge(comm, study, run, reference, of, error)
    type(communicator_t), target, intent(in) :: comm
    type(study_t), intent(in) :: study
    type(run_t), intent(inout) :: run
    !> where it is tight
    type(run_t), intent(in) :: reference
    type(case_run_t), intent(inout) :: of
    type(error_t), allocatable, intent(inout) :: error
    type(state_t), allocatable :: exact(:)
    integer :: q

    allocate (of%errors(size(study%quantities)), source=unknown)
    allocate (of%solve_seconds(study%repeats), of%run_seconds(study%repeats), source=0.0_dp)
    select case (study%reference)
    case ("exact")
      call exact_states(comm, study, run%config, exact, error)
      if (.not. allocated(error)) call compare_states(comm, run%states, exact, of%distance)
    case ("tight")
      call compare_states(comm, run%states, reference%states, of%distance)
      if (allocated(run%stress) .and. allocated(reference%stress)) &
        & of%stress_error = relative(norm2(run%stress - reference%stress), norm2(reference%stress))
      do q = 1, size(of%errors)
        of%errors(q) = relative(abs(run%means(q) - reference%means(q)), abs(reference%means(q)))
      end do
    end select
    deallocate (run%states)
    of%run = run
  end subroutine judge

  !> `unknown` where there is nothing to relate to.
  pure real(dp) function relative(difference, reference)
    real(dp), intent(in) :: difference, reference
    relative = unknown
    if (reference > 0.0_dp) relative = difference/reference
  end function relative

  !> A line on the terminal.
  subroutine say(comm, name, value, run)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: name, value
    type(run_t), intent(in) :: run
    character(len=:), allocatable :: text

    if (comm%rank /= 0) return
    text = "  "//name//": "//value//to_text(run%iterations)//" iterations, "//to_text(run%solve_seconds, 3)//" s in solves"
    if (run%failed > 0) text = text//", *** "//to_text(run%failed)//" of them missed their tolerance"
    if (run%diverged) text = text//", the last one DIVERGED"
    write (output_unit, "(a)") text
    flush (output_unit)
  end subroutine say

  !> Solve the first step of every variant, in rounds. Errors are the same on all ranks. Collective.
  subroutine measure_solves(comm, study, cases, error)
    type(communicator_t), target, intent(in) :: comm
    type(study_t), intent(in) :: study
    !> (variants)
    type(case_solve_t), allocatable, intent(out) :: cases(:)
    type(error_t), allocatable, intent(inout) :: error
    type(config_t) :: config
    integer :: v, r

    allocate (cases(size(study%variants)))
    do r = 1, study%repeats
      do v = 1, size(study%variants)
        if (allocated(error)) return
        call study%make_config(v, 1, config, error)
        if (.not. allocated(error)) call solve_first_step(comm, config, cases(v)%run, cases(v)%report, error)
        if (allocated(error)) return
        associate (of => cases(v))
          if (r == 1) call say(comm, study%variants(v)%name, "", of%run)
          if (r == 1) allocate (of%seconds(of%report%n_trace, study%repeats))
          of%seconds(:, r) = of%report%trace(6, 1:of%report%n_trace)
        end associate
      end do
    end do
  end subroutine measure_solves

end module gravier_accuracy_measure
