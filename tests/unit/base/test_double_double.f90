!> Twice the working precision, against quadruple precision, which rounds at 2^-113.
program test_double_double
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp, i8
  use gravier_random_hash, only: hash_uniform
  use gravier_double_double, only: extended_product, extended_add
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  integer, parameter :: qp = selected_real_kind(33)
  !> 2^-106
  real(dp), parameter :: unit = 0.25_dp*epsilon(1.0_dp)**2

  call MPI_Init()
  call test_one_product()
  call test_product(40, 7, .false.)
  call test_product(3, 40, .true.)
  call test_product(60, 100, .true.)
  call test_cancellation()
  call test_sum()
  call test_empty()
  call finish_checks()
  call MPI_Finalize()

contains

  !> A number in (1, 2) all of whose bits are random, as a square root's are.
  real(dp) function draw(k, stream)
    integer, intent(in) :: k, stream
    draw = sqrt(1.0_dp + 3*hash_uniform(1, int(k, i8), stream))
  end function draw

  pure real(qp) function value_of(high, low)
    real(dp), intent(in) :: high, low
    value_of = real(high, qp) + real(low, qp)
  end function value_of

  !> Products of two numbers are exact, but for a rounding of the product of their trailing halves, at 2^-104.
  subroutine test_one_product()
    real(dp) :: matrix(1, 1), v(1), zero(1), high(1), low(1)
    real(qp) :: exact, worst
    integer :: k

    zero(:) = 0.0_dp
    worst = 0
    do k = 1, 5000
      matrix(1, 1) = draw(k, 1)
      v(1) = -draw(k, 2)
      call extended_product(matrix, v, zero, high, low)
      exact = real(matrix(1, 1), qp)*v(1)
      worst = max(worst, abs(value_of(high(1), low(1)) - exact)/abs(exact))
    end do
    call check_close(real(worst, dp), 0.0_dp, 6*unit, "products")
  end subroutine test_one_product

  !> y = A v with v = high + low, of one or both signs. Each of the n terms adds a rounding at 2^-106 of the sums so far;
  !> y_low, of size 2^-53, is rounded at each of n additions too: 2 n units of sum |A||v| are safe.
  subroutine test_product(m, n, both_signs)
    integer, intent(in) :: m, n
    logical, intent(in) :: both_signs
    real(dp) :: matrix(m, n), v_high(n), v_low(n), y_high(m), y_low(m)
    real(qp) :: exact, sizes, worst
    integer :: i, j

    do j = 1, n
      v_high(j) = draw(j, 3)
      v_low(j) = v_high(j)*epsilon(1.0_dp)*(hash_uniform(1, int(j, i8), 4) - 0.5_dp)
      do i = 1, m
        matrix(i, j) = draw(i + m*j, 5)
        if (both_signs .and. hash_uniform(1, int(i + m*j, i8), 6) < 0.5_dp) matrix(i, j) = -matrix(i, j)
      end do
    end do
    call extended_product(matrix, v_high, v_low, y_high, y_low)
    worst = 0
    do i = 1, m
      exact = 0
      sizes = 0
      do j = 1, n
        exact = exact + matrix(i, j)*value_of(v_high(j), v_low(j))
        sizes = sizes + abs(real(matrix(i, j), qp)*v_high(j))
      end do
      worst = max(worst, abs(value_of(y_high(i), y_low(i)) - exact)/sizes)
      call check(abs(y_low(i)) <= 0.5_dp*spacing(y_high(i)), "the high part is the nearest number")
    end do
    call check_close(real(worst, dp), 0.0_dp, (6 + 2*n)*unit, "matrix times vector")
  end subroutine test_product

  !> (1 + d) (1 - d) - 1 = -d^2 with d = 2^-27 + 2^-50, exact in 106 bits: nothing of the leading part is left.
  subroutine test_cancellation()
    real(dp) :: matrix(1, 2), v(2), zero(2), high(1), low(1), d

    d = 2.0_dp**(-27) + 2.0_dp**(-50)
    matrix(1, 1) = 1.0_dp + d
    matrix(1, 2) = -1.0_dp
    v(1) = 1.0_dp - d
    v(2) = 1.0_dp
    zero(:) = 0.0_dp
    call extended_product(matrix, v, zero, high, low)
    call check_close(real((value_of(high(1), low(1)) + real(d, qp)**2)/real(d, qp)**2, dp), 0.0_dp, 2*epsilon(1.0_dp), &
      & "what is left of a product")
  end subroutine test_cancellation

  !> Sums of 1000 numbers of both signs and sizes 2^-60 to 1: an error of 2^-105 of the largest partial sum each. In the end
  !> the high part is the number nearest to the sum.
  subroutine test_sum()
    real(dp) :: high, low, x
    real(qp) :: exact, largest
    integer :: k, trial

    do trial = 1, 20
      high = 0.0_dp
      low = 0.0_dp
      exact = 0
      largest = 0
      do k = 1, 1000
        x = scale(draw(k, 10 + trial), -int(60*hash_uniform(2, int(k, i8), trial)))
        if (hash_uniform(3, int(k, i8), trial) < 0.5_dp) x = -x
        call extended_add(high, low, x)
        exact = exact + x
        largest = max(largest, abs(exact))
      end do
      call check_close(real((value_of(high, low) - exact)/largest, dp), 0.0_dp, 2000*unit, "sum")
      call check(abs(low) <= 0.5_dp*spacing(high), "the high part is the nearest number")
    end do
    high = 1.0_dp
    low = 0.0_dp
    call extended_add(high, low, 1.0e-25_dp)
    call check_close(high, 1.0_dp, 0.0_dp, "a small number goes into the low part")
    call check_close(low, 1.0e-25_dp, 0.0_dp, "a small number is kept")
    call extended_add(high, low, -1.0_dp)
    call check_close(high, 1.0e-25_dp, 0.0_dp, "and is what remains")
  end subroutine test_sum

  subroutine test_empty()
    real(dp) :: matrix(2, 0), v(0), high(2), low(2)
    call extended_product(matrix, v, v, high, low)
    call check_equal(count(abs(high) + abs(low) > 0.0_dp), 0, "no columns: zeros")
  end subroutine test_empty

end program test_double_double
