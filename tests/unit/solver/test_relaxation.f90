!> How the automatic under-relaxation of the Schwarz methods answers to the changes it sees.
program test_relaxation
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp
  use gravier_schwarz, only: relaxation_t
  use gravier_check, only: check, check_close, finish_checks
  implicit none

  call MPI_Init()
  call test_decay()
  call test_smooth_growth()
  call test_alternating_growth()
  call test_growth_that_stops()
  call test_cycle()
  call finish_checks()
  call MPI_Finalize()

contains

  !> One number d_k = smooth**k + small*alternating**k as the change of iteration k.
  subroutine follow(relaxation, smooth, small, alternating, first, last)
    type(relaxation_t), intent(inout) :: relaxation
    real(dp), intent(in) :: smooth, small, alternating
    integer, intent(in) :: first, last
    real(dp) :: d, before
    integer :: k

    do k = first, last
      d = smooth**k + small*alternating**k
      before = 0.0_dp
      if (k > 1) before = smooth**(k - 1) + small*alternating**(k - 1)
      call relaxation%adapt(d**2, d*before)
    end do
  end subroutine follow

  !> Changes that decay, along with each other or alternating, leave the factor at 1 exactly.
  subroutine test_decay()
    type(relaxation_t) :: smooth, alternating

    smooth = relaxation_t(least=0.1_dp)
    call follow(smooth, 0.95_dp, 0.0_dp, 1.0_dp, 1, 200)
    call check_close(smooth%factor, 1.0_dp, 0.0_dp, "smooth decay")
    alternating = relaxation_t(least=0.1_dp)
    call follow(alternating, 0.95_dp, 1.0_dp, -0.9_dp, 1, 200)
    call check_close(alternating%factor, 1.0_dp, 0.0_dp, "alternating decay")
  end subroutine test_decay

  !> Changes that grow along with each other are none of its business: a smaller share would not end that.
  subroutine test_smooth_growth()
    type(relaxation_t) :: relaxation

    relaxation = relaxation_t(least=0.1_dp)
    call follow(relaxation, 1.2_dp, 0.0_dp, 1.0_dp, 1, 40)
    call check_close(relaxation%factor, 1.0_dp, 0.0_dp, "smooth growth")
  end subroutine test_smooth_growth

  !> An alternating part that grows by a fifth an iteration is answered when it shows, again and again down to the least.
  subroutine test_alternating_growth()
    type(relaxation_t) :: relaxation

    relaxation = relaxation_t(least=0.3_dp)
    call follow(relaxation, 1.0_dp, 1e-3_dp, -1.2_dp, 1, 25)
    call check_close(relaxation%factor, 1.0_dp, 0.0_dp, "alternating growth: not before it is a part of the change")
    call follow(relaxation, 1.0_dp, 1e-3_dp, -1.2_dp, 26, 34)
    call check(relaxation%factor < 1.0_dp, "alternating growth: the factor falls")
    call follow(relaxation, 1.0_dp, 1e-3_dp, -1.2_dp, 35, 80)
    call check_close(relaxation%factor, 0.3_dp, 0.0_dp, "alternating growth: the least factor")
  end subroutine test_alternating_growth

  !> Growth that ends when the factor falls lowers it once.
  subroutine test_growth_that_stops()
    type(relaxation_t) :: relaxation
    real(dp) :: d, before
    integer :: k

    relaxation = relaxation_t(least=0.1_dp)
    d = 1.0_dp
    before = 0.0_dp
    do k = 1, 100
      call relaxation%adapt(d**2, d*before)
      before = d
      ! unstable at 1, stable at 0.8: the factor of the mode is 1 - 2.2 relaxation
      d = (1.0_dp - 2.2_dp*relaxation%factor)*d
    end do
    call check_close(relaxation%factor, 0.8_dp, 0.0_dp, "growth that stops: the factor")
    call check(abs(d) < 1e-3_dp, "growth that stops: the mode")
  end subroutine test_growth_that_stops

  !> Changes that go to and fro and neither grow nor fall lower the factor, once in 20 iterations; those that fall by a hundredth
  !> each time, or pause, do not.
  subroutine test_cycle()
    type(relaxation_t) :: relaxation
    integer :: k

    relaxation = relaxation_t(least=0.1_dp)
    call follow(relaxation, 0.0_dp, 1.0_dp, -1.0_dp, 1, 21)
    call check_close(relaxation%factor, 1.0_dp, 0.0_dp, "a cycle: not before 20 iterations")
    call follow(relaxation, 0.0_dp, 1.0_dp, -1.0_dp, 22, 22)
    call check(relaxation%grows, "a cycle: changes that stay")
    call check_close(relaxation%factor, 0.8_dp, 0.0_dp, "a cycle: after 20 iterations")
    call follow(relaxation, 0.0_dp, 1.0_dp, -1.0_dp, 23, 42)
    call check_close(relaxation%factor, 0.8_dp, 0.0_dp, "a cycle: not before 20 more")
    call follow(relaxation, 0.0_dp, 1.0_dp, -1.0_dp, 43, 43)
    call check_close(relaxation%factor, 0.64_dp, 1e-15_dp, "a cycle: and again")
    relaxation = relaxation_t(least=0.1_dp)
    call follow(relaxation, 0.0_dp, 1.0_dp, -0.99_dp, 1, 400)
    call check_close(relaxation%factor, 1.0_dp, 0.0_dp, "changes that fall by a hundredth")
    relaxation = relaxation_t(least=0.1_dp)
    call relaxation%adapt(1.0_dp, 0.0_dp)
    do k = 1, 100
      call relaxation%adapt(1.0_dp, merge(-0.4_dp, -1.0_dp, mod(k, 10) == 0))
    end do
    call check_close(relaxation%factor, 1.0_dp, 0.0_dp, "changes that pause now and then")
  end subroutine test_cycle

end program test_relaxation
