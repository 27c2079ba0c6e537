!> How momentum chooses its extrapolation from the changes it sees: memory, margin, plain iterations.
program test_momentum
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp, i8
  use gravier_acceleration, only: acceleration_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  call MPI_Init()
  call test_decay()
  call test_growth_between_iterations()
  call test_growth_between_windows()
  call test_idle_windows()
  call test_end_for_good()
  call test_few_contacts()
  call finish_checks()
  call MPI_Finalize()

contains

  !> While changes decay, beta follows Nesterov's sequence up to the margin, which narrows to 0.01.
  subroutine test_decay()
    type(acceleration_t) :: momentum
    real(dp) :: change, t, next
    integer :: k

    change = 1.0_dp
    t = 1.0_dp
    call check(momentum%whole(), "decay: the first iteration takes whole local solves")
    do k = 1, 19
      call momentum%steer(change)
      call check(momentum%whole(), "decay: the first window takes whole local solves")
      next = 0.5_dp*(1.0_dp + sqrt(1.0_dp + 4.0_dp*t**2))
      call check_close(momentum%beta, (t - 1.0_dp)/next, 1e-15_dp, "decay: beta of the sequence")
      t = next
      change = 0.9_dp*change
    end do
    do k = 20, 2000
      call momentum%steer(change)
      call check(.not. momentum%whole(), "decay: later windows take shares")
      change = 0.9_dp*change
    end do
    call check_close(momentum%beta, 0.99_dp, 1e-15_dp, "decay: beta in the end")
    call check_equal(momentum%plain, 0, "decay: no plain iterations")
  end subroutine test_decay

  !> Growth by more than 2 % shortens the memory by a twentieth; less growth does not.
  subroutine test_growth_between_iterations()
    type(acceleration_t) :: momentum, grown
    integer :: k

    do k = 1, 6
      call momentum%steer(1.0_dp)
    end do
    grown = momentum
    call momentum%steer(1.01_dp)
    call grown%steer(1.03_dp)
    call check(grown%beta > 0.0_dp, "growth: some memory is kept")
    call check_close(grown%t, 0.5_dp*(1.0_dp + sqrt(1.0_dp + 4.0_dp*(0.95_dp*sequence(6))**2)), 1e-14_dp, "growth: memory")
    call check_close(momentum%t, sequence(7), 1e-14_dp, "growth: slight growth forgets nothing")
  end subroutine test_growth_between_iterations

  !> t after n iterations.
  pure real(dp) function sequence(n) result(t)
    integer, intent(in) :: n
    integer :: k

    t = 1.0_dp
    do k = 1, n
      t = 0.5_dp*(1.0_dp + sqrt(1.0_dp + 4.0_dp*t**2))
    end do
  end function sequence

  !> Windows that grow, too slowly for one iteration to tell, take beta to zero within five.
  subroutine test_growth_between_windows()
    type(acceleration_t) :: momentum
    real(dp) :: change
    integer :: k

    change = 1.0_dp
    do k = 1, 100
      change = 1.01_dp*change
      call momentum%steer(change)
    end do
    call check_close(momentum%beta, 0.0_dp, tiny(1.0_dp), "windows that grow: beta")
    do k = 1, 200
      change = 0.97_dp*change
      call momentum%steer(change)
    end do
    call check(momentum%beta > 0.5_dp, "windows that shrink again: beta")
  end subroutine test_growth_between_windows

  !> Ten windows without a fifth less: momentum begins anew, three times. Then come as many plain iterations as there were, and
  !> momentum again, which may begin anew as often.
  subroutine test_idle_windows()
    type(acceleration_t) :: momentum
    integer :: k, plain

    do k = 1, 879
      call momentum%steer(1.0_dp)
      if (k == 220 .or. k == 440 .or. k == 660) then
        call check_close(momentum%beta, 0.0_dp, tiny(1.0_dp), "idle: momentum begins anew")
      else if (mod(k, 220) > 1) then
        call check(momentum%beta > 0.0_dp, "idle: momentum until the limit")
      end if
      call check(momentum%whole() .eqv. mod(k, 220) < 20, "idle: the first window after a start takes whole local solves")
    end do
    plain = 0
    do k = 880, 1759
      call momentum%steer(1.0_dp)
      if (abs(momentum%beta) <= 0.0_dp .and. momentum%resting .and. momentum%whole()) plain = plain + 1
    end do
    call check_equal(plain, 880, "idle: plain iterations")
    call momentum%steer(1.0_dp)
    call check(.not. momentum%resting, "idle: the last impulses are kept again")
    call check_close(momentum%beta, 0.0_dp, tiny(1.0_dp), "idle: nothing to extrapolate from yet")
    do k = 1761, 1959
      call momentum%steer(1.0_dp)
    end do
    call check(momentum%beta > 0.5_dp, "idle: momentum again")
    call momentum%steer(1.0_dp)
    call check_close(momentum%beta, 0.0_dp, tiny(1.0_dp), "idle: momentum begins anew again")
    call check(.not. momentum%resting, "idle: without plain iterations")
  end subroutine test_idle_windows

  !> An end for good leaves plain iterations alone, until the next solve.
  subroutine test_end_for_good()
    type(acceleration_t) :: momentum
    integer :: k

    momentum%on = .true.
    do k = 1, 30
      call momentum%steer(0.9_dp**k)
    end do
    call check(momentum%extrapolates(), "end: accelerated before")
    call momentum%end_for_good()
    call check(.not. momentum%extrapolates(), "end: not accelerated after")
    do k = 31, 5000
      call momentum%steer(0.9_dp**k)
      call check(momentum%resting .and. momentum%whole(), "end: plain iterations")
    end do
  end subroutine test_end_for_good

  !> With few contacts growth shortens the memory by three tenths, and windows are shorter.
  subroutine test_few_contacts()
    type(acceleration_t) :: few, many
    integer :: k

    call few%choose_steering(99_i8)
    call many%choose_steering(100_i8)
    do k = 1, 9
      call few%steer(1.0_dp)
      call many%steer(1.0_dp)
    end do
    call check(few%whole() .and. many%whole(), "few contacts: the first window takes whole local solves")
    call few%steer(1.03_dp)
    call many%steer(1.03_dp)
    call check(many%whole() .and. .not. few%whole(), "few contacts: the first window is shorter")
    call check_close(few%t, 0.5_dp*(1.0_dp + sqrt(1.0_dp + 4.0_dp*(0.7_dp*sequence(9))**2)), 1e-14_dp, "few contacts: memory")
    call check_close(many%t, 0.5_dp*(1.0_dp + sqrt(1.0_dp + 4.0_dp*(0.95_dp*sequence(9))**2)), 1e-14_dp, "many contacts: memory")
    do k = 11, 2000
      call few%steer(0.9_dp**k)
    end do
    call check_close(few%beta, 0.98_dp, 1e-15_dp, "few contacts: beta in the end")
  end subroutine test_few_contacts

end program test_momentum
