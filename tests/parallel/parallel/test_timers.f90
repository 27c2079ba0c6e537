!> Timers of phases: each measures what it encloses, and the figures over the ranks.
program test_timers
  use mpi_f08, only: MPI_Wtime
  use gravier_kinds, only: dp
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_timers, only: start_timer, stop_timer, reset_timers, gather_timers, phase_names, n_phases, &
    & phase_bodies, phase_neighbourhood, phase_detection, phase_interface, phase_setup, phase_sweep, phase_exchange, &
    & phase_factorise, phase_interface_solve, phase_check, phase_reduction, phase_projection, phase_diagnostics, &
    & phase_output
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  !> seconds that a phase takes at least on rank 0
  real(dp), parameter :: unit = 0.005_dp
  type(communicator_t) :: comm

  call start_parallel()
  call comm%init()
  call test_phases()
  call test_figures()
  call test_nesting()
  call test_reset()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  subroutine wait_for(seconds)
    real(dp), intent(in) :: seconds
    real(dp) :: start
    start = MPI_Wtime()
    do while (MPI_Wtime() - start < seconds)
    end do
  end subroutine wait_for

  !> Numbers and names, each once.
  subroutine test_phases()
    integer, parameter :: phases(*) = [phase_bodies, phase_neighbourhood, phase_detection, phase_interface, phase_setup, &
      & phase_sweep, phase_exchange, phase_factorise, phase_interface_solve, phase_check, phase_reduction, phase_projection, &
      & phase_diagnostics, phase_output]
    integer :: k, j

    call check_equal(size(phases), n_phases, "number of phases")
    do k = 1, n_phases
      call check_equal(count(phases == k), 1, "every number once")
      call check(len_trim(phase_names(k)) > 0, "every phase has a name")
      do j = 1, k - 1
        call check(phase_names(j) /= phase_names(k), "every name once")
      end do
    end do
    call check_equal(phase_names(phase_factorise), "factorisation", "name of the factorisation")
    call check_equal(phase_names(phase_interface_solve), "interface solve", "name of the interface solve")
    call check_equal(phase_names(phase_output), "output", "name of the output")
  end subroutine test_phases

  !> Rank r spends (r + 1) units in one phase, in two stretches, and another phase starts within the first. The clock
  !> is read within and around each stretch: what the timer says lies between the two.
  subroutine test_figures()
    real(dp), dimension(n_phases) :: mean, least, most
    real(dp) :: inner, outer, from, half

    call reset_timers()
    inner = 0.0_dp
    outer = MPI_Wtime()
    half = 0.5_dp*unit*(comm%rank + 1)
    call start_timer(phase_sweep)
    from = MPI_Wtime()
    call wait_for(half)
    ! the phase within may last: a rank that is stopped there waits for a processor
    inner = inner + (MPI_Wtime() - from)
    call start_timer(phase_check)
    call stop_timer(phase_check)
    call stop_timer(phase_sweep)
    call start_timer(phase_sweep)
    from = MPI_Wtime()
    call wait_for(half)
    inner = inner + (MPI_Wtime() - from)
    call stop_timer(phase_sweep)
    outer = MPI_Wtime() - outer
    call gather_timers(comm, mean, least, most)
    ! differences of clock readings: a microsecond is far more than their rounding
    call check(least(phase_sweep) <= mean(phase_sweep) + 1.0e-6_dp, "least <= mean")
    call check(mean(phase_sweep) <= most(phase_sweep) + 1.0e-6_dp, "mean <= most")
    call check(least(phase_sweep) >= comm%lowest(inner) - 1.0e-6_dp, "least of the phase")
    call check(least(phase_sweep) <= comm%lowest(outer) + 1.0e-6_dp, "least of the phase, no more")
    call check(most(phase_sweep) >= comm%highest(inner) - 1.0e-6_dp, "most of the phase")
    call check(most(phase_sweep) <= comm%highest(outer) + 1.0e-6_dp, "most of the phase, no more")
    call check(mean(phase_sweep) >= sum_over_ranks(inner)/comm%size - 1.0e-6_dp, "mean of the phase")
    call check(mean(phase_sweep) <= sum_over_ranks(outer)/comm%size + 1.0e-6_dp, "mean of the phase, no more")
    call check(most(phase_check) <= comm%highest(outer), "a phase within a phase")
    call check_close(most(phase_output), 0.0_dp, 0.0_dp, "a phase that has not run")
  end subroutine test_figures

  !> The time of a phase within another is its own alone, and a phase that an error has left ends with the one around it.
  subroutine test_nesting()
    real(dp), dimension(n_phases) :: mean, least, most
    real(dp) :: whole

    call reset_timers()
    whole = MPI_Wtime()
    call start_timer(phase_setup)
    call start_timer(phase_check)
    call wait_for(4.0_dp*unit)
    call start_timer(phase_reduction)
    call stop_timer(phase_setup)
    whole = MPI_Wtime() - whole
    call start_timer(phase_output)
    call wait_for(unit)
    call stop_timer(phase_output)
    call gather_timers(comm, mean, least, most)
    call check(least(phase_check) >= 4.0_dp*unit, "the phase within")
    call check(most(phase_setup) < comm%highest(whole) - 4.0_dp*unit + 1.0e-6_dp, "the phase around, less the one within")
    call check(most(phase_setup) + most(phase_check) < comm%highest(whole) + 1.0e-6_dp .or. comm%size > 1, "no more than both")
    call check(most(phase_check) < comm%highest(whole) + 1.0e-6_dp, "the phase within ends with the one around")
  end subroutine test_nesting

  real(dp) function sum_over_ranks(x)
    real(dp), intent(in) :: x
    real(dp) :: part(1)
    part(1) = x
    sum_over_ranks = comm%sum_real(part)
  end function sum_over_ranks

  subroutine test_reset()
    real(dp), dimension(n_phases) :: mean, least, most

    call start_timer(phase_output)
    call wait_for(unit)
    call stop_timer(phase_output)
    call reset_timers()
    call gather_timers(comm, mean, least, most)
    call check_close(maxval(abs(mean)), 0.0_dp, 0.0_dp, "mean after a reset")
    call check_close(maxval(abs(least)), 0.0_dp, 0.0_dp, "least after a reset")
    call check_close(maxval(abs(most)), 0.0_dp, 0.0_dp, "most after a reset")
  end subroutine test_reset

end program test_timers
