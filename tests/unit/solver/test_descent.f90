!> What a run notes of the history of its solves, and what it makes of it for other tolerances.
program test_descent
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp, i8
  use gravier_convergence_history, only: convergence_history_t, effort_t, tenfold, unknown_effort
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  real(dp), parameter :: rounding = 1.0e-12_dp

  call MPI_Init()
  call test_levels()
  call test_exponential()
  call test_power_law()
  call test_warm_solves()
  call test_failed_solves()
  call test_first_checks_only()
  call test_seconds()
  call finish_checks()
  call MPI_Finalize()

contains

  !> A figure at a level counts, the first one stays, and what lies above all levels is the start.
  subroutine test_levels()
    type(convergence_history_t) :: history

    call history%note(0, 1.0_dp, 1.0e-3_dp)
    call check_equal(history%first(tenfold), -1, "above all levels")
    call history%note(10, 2.0e-2_dp, 1.0e-3_dp)
    call history%note(20, 1.0e-2_dp, 1.0e-3_dp)
    call history%note(30, 5.0e-2_dp, 1.0e-3_dp)
    call history%note(40, 2.0e-3_dp, 1.0e-3_dp)
    call history%note(50, 9.0e-4_dp, 1.0e-3_dp)
    call check_equal(history%first(tenfold), 20, "ten times the tolerance")
    call check_equal(history%first(1), 40, "half a decade above it")
    call check_equal(history%first(0), 50, "the tolerance")
  end subroutine test_levels

  !> Add solves whose figure at iteration i, checked every `every` of them, is `figure`(i); they give up after 10^5.
  subroutine add_solves(effort, number, every, figure)
    type(effort_t), intent(inout) :: effort
    integer, intent(in) :: number, every
    interface
      pure real(dp) function figure(i)
        import :: dp
        implicit none
        integer, intent(in) :: i
      end function figure
    end interface
    type(convergence_history_t) :: history
    integer :: k, i

    do k = 1, number
      history = convergence_history_t(first_check=every)
      i = 0
      do
        call history%note(i, figure(i), 1.0e-4_dp)
        if (figure(i) <= 1.0e-4_dp .or. i >= 100000) exit
        i = i + every
      end do
      call effort%add(history, i, figure(i), 1.0_dp, 0.25_dp)
    end do
  end subroutine add_solves

  !> A decade in 100 iterations from 0.1 on: 300 to 1e-4, 250 and 200 to half a decade and a decade above it. To 1e-5 it is 400,
  !> from 300 + 0.8*100 to twice 300*300/200.
  subroutine test_exponential()
    type(effort_t) :: effort

    call add_solves(effort, 3, 1, exponential)
    call check_equal(effort%iterations, 900_i8, "exponential: iterations")
    call check_close(effort%looser(), 600.0_dp, rounding, "exponential: looser")
    call check_range(effort, .true., 300.0_dp, 900.0_dp, "exponential: looser")
    call check_range(effort, .false., 3.0_dp*380.0_dp, 3.0_dp*900.0_dp, "exponential: tighter")
  end subroutine test_exponential

  pure real(dp) function exponential(i)
    integer, intent(in) :: i
    exponential = 0.1_dp*10.0_dp**(-0.01_dp*i)*(1.0_dp + rounding)**(-10)
  end function exponential

  !> Check the ends of an interval.
  subroutine check_range(effort, looser, least, most, what)
    type(effort_t), intent(in) :: effort
    logical, intent(in) :: looser
    real(dp), intent(in) :: least, most
    character(len=*), intent(in) :: what
    real(dp) :: found(2)

    if (looser) then
      call effort%looser_range(found(1), found(2))
    else
      call effort%tighter_range(found(1), found(2))
    end if
    call check_close(found(1), least, 1.0e-3_dp*abs(least) + rounding, what//", lower end")
    call check_close(found(2), most, 1.0e-3_dp*abs(most) + rounding, what//", upper end")
  end subroutine check_range

  !> Iterations as the inverse of the figure: ten times as many for each decade, half of the upper end.
  subroutine test_power_law()
    type(effort_t) :: effort

    call add_solves(effort, 2, 1, power_law)
    call check_close(effort%looser(), 2.0_dp*999.0_dp, rounding, "power law: looser")
    call check_range(effort, .false., 2.0e4_dp*1.72_dp, 2.0_dp*2.0e5_dp, "power law: tighter")
    call check_range(effort, .true., 999.0_dp, 2.0_dp*9999.0_dp, "power law: looser")
    call check_close(effort%worst, 1.0e-4_dp, 1.0e-8_dp, "power law: largest figure at the end")
  end subroutine test_power_law

  pure real(dp) function power_law(i)
    integer, intent(in) :: i
    power_law = 1.0_dp/(1.0_dp + i)
  end function power_law

  !> Solves that start below ten times the tolerance: one check each at the looser one; a solve that has nothing to do has
  !> nothing to do there either.
  subroutine test_warm_solves()
    type(effort_t) :: effort

    call add_solves(effort, 5, 10, warm)
    call check_close(effort%looser(), 50.0_dp, rounding, "warm solves: looser")
    call check(.not. effort%often_idle(), "no solve is idle")
    call add_solves(effort, 1, 10, idle)
    call check(.not. effort%often_idle(), "a sixth of the solves is idle")
    call add_solves(effort, 4, 10, idle)
    call check(effort%often_idle(), "half of the solves are idle")
    call check_close(effort%looser(), 50.0_dp, rounding, "idle solves: looser")
    call check_range(effort, .true., 25.0_dp, real(effort%iterations, dp), "idle solves: looser")
    call check_equal(effort%solves, 10_i8, "warm and idle solves")
  end subroutine test_warm_solves

  pure real(dp) function warm(i)
    integer, intent(in) :: i
    warm = 5.0e-4_dp*10.0_dp**(-0.01_dp*i)
  end function warm

  pure real(dp) function idle(i)
    integer, intent(in) :: i
    idle = 1.0e-5_dp/(1.0_dp + i)
  end function idle

  !> One solve that stalls above the tolerance, one above ten times of it: what they would have taken is not known.
  subroutine test_failed_solves()
    type(effort_t) :: effort

    call add_solves(effort, 4, 10, exponential)
    call add_solves(effort, 1, 1000, stalls)
    call check_range(effort, .false., unknown_effort, unknown_effort, "one solve failed: tighter")
    call check_close(effort%looser(), 800.0_dp + 1000.0_dp, rounding, "one solve failed: looser")
    call add_solves(effort, 1, 1000, stalls_early)
    call check_close(effort%looser(), unknown_effort, rounding, "a solve that stalls early: looser")
    call check_range(effort, .true., unknown_effort, unknown_effort, "a solve that stalls early: looser")
    call check_equal(effort%unreached(tenfold), 1_i8, "a solve that stalls early")
  end subroutine test_failed_solves

  pure real(dp) function stalls(i)
    integer, intent(in) :: i
    stalls = max(1.0_dp/(1.0_dp + i), 5.0e-4_dp)
  end function stalls

  pure real(dp) function stalls_early(i)
    integer, intent(in) :: i
    stalls_early = max(1.0_dp/(1.0_dp + i), 5.0e-3_dp)
  end function stalls_early

  !> Where all solves end at their first check nothing is seen of a decay: a looser goal takes none of their iterations or all of
  !> them. Without solves nothing is known.
  subroutine test_first_checks_only()
    type(effort_t) :: effort

    call check_range(effort, .false., unknown_effort, unknown_effort, "no solves: tighter")
    call add_solves(effort, 5, 1000, exponential)
    call check_range(effort, .false., unknown_effort, unknown_effort, "first checks only: tighter")
    call check_range(effort, .true., 0.0_dp, 5000.0_dp, "first checks only: looser")
    call check_close(effort%looser(), 5000.0_dp, rounding, "first checks only: looser")
  end subroutine test_first_checks_only

  !> A quarter of a second before the iterations of each solve, three quarters for them.
  subroutine test_seconds()
    type(effort_t) :: effort

    call add_solves(effort, 2, 1, exponential)
    call check_close(effort%seconds, 2.0_dp, rounding, "seconds")
    call check_close(effort%seconds_of(450.0_dp), 0.5_dp + 1.5_dp*450.0_dp/600.0_dp, rounding, "seconds of fewer iterations")
    call check_close(effort%seconds_of(unknown_effort), unknown_effort, rounding, "seconds of unknown iterations")
  end subroutine test_seconds

end program test_descent
