!> Exact sums: the same bits in any order and grouping, results known exactly, ends of the range of reals.
program test_exact_sum
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_is_nan, ieee_quiet_nan, ieee_positive_inf, ieee_negative_inf
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp, i8
  use gravier_random_hash, only: hash_uniform
  use gravier_exact_sum, only: exact_sum_words, exact_add, exact_value
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  !> 113 bits
  integer, parameter :: qp = selected_real_kind(33)

  call MPI_Init()
  call test_order()
  call test_grouping()
  call test_cancellation()
  call test_integers()
  call test_tenths()
  call test_against_quadruple()
  call test_every_exponent()
  call test_subnormals()
  call test_signs()
  call test_range()
  call test_not_finite()
  call finish_checks()
  call MPI_Finalize()

contains

  real(dp) function sum_of(x)
    real(dp), intent(in) :: x(:)
    integer(i8) :: words(exact_sum_words)
    integer :: k

    words(:) = 0
    do k = 1, size(x)
      call exact_add(words, x(k))
    end do
    sum_of = exact_value(words)
  end function sum_of

  real(dp) function sum_of_two(a, b)
    real(dp), intent(in) :: a, b
    real(dp) :: x(2)
    x(1) = a
    x(2) = b
    sum_of_two = sum_of(x)
  end function sum_of_two

  real(dp) function sum_of_three(a, b, c)
    real(dp), intent(in) :: a, b, c
    real(dp) :: x(3)
    x(1) = a
    x(2) = b
    x(3) = c
    sum_of_three = sum_of(x)
  end function sum_of_three

  !> Exact equality, bit for bit.
  subroutine check_bits(value, expected, name)
    real(dp), intent(in) :: value, expected
    character(len=*), intent(in) :: name
    call check_equal(transfer(value, 0_i8), transfer(expected, 0_i8), name)
  end subroutine check_bits

  !> Reals of both signs with binary exponents from -lowest to highest.
  subroutine fill(x, seed, lowest, highest)
    real(dp), intent(out) :: x(:)
    integer, intent(in) :: seed, lowest, highest
    integer :: k, e

    do k = 1, size(x)
      e = -lowest + int((highest + lowest)*hash_uniform(seed, int(k, i8), 1))
      x(k) = scale(0.5_dp + 0.5_dp*hash_uniform(seed, int(k, i8), 2), e)
      if (hash_uniform(seed, int(k, i8), 3) < 0.5_dp) x(k) = -x(k)
    end do
  end subroutine fill

  !> 30 random orders of 400 terms that span 2^-1000 to 2^1000, and of 400 terms of like size.
  subroutine test_order()
    real(dp) :: x(400), y(400)
    real(dp) :: first
    integer :: trial, k, j, width

    do width = 10, 1000, 990
      call fill(x, width, width, width)
      first = sum_of(x)
      do trial = 1, 30
        y(:) = x
        do k = size(x), 2, -1
          j = 1 + int(k*hash_uniform(trial, int(k, i8), 4))
          call swap(y(k), y(j))
        end do
        call check_bits(sum_of(y), first, "any order")
      end do
    end do
  end subroutine test_order

  subroutine swap(a, b)
    real(dp), intent(inout) :: a, b
    real(dp) :: c
    c = a
    a = b
    b = c
  end subroutine swap

  !> Sums of sums: words add up as integers, whatever each group holds.
  subroutine test_grouping()
    real(dp) :: x(400)
    integer(i8) :: words(exact_sum_words), groups(exact_sum_words, 7)
    integer :: k

    call fill(x, 3, 600, 600)
    groups(:, :) = 0
    do k = 1, size(x)
      call exact_add(groups(:, 1 + int(7*hash_uniform(9, int(k, i8), 1))), x(k))
    end do
    words(:) = sum(groups, dim=2)
    call check_bits(exact_value(words), sum_of(x), "any grouping")
  end subroutine test_grouping

  subroutine test_cancellation()
    real(dp) :: x(400)
    integer :: k

    call check_bits(sum_of([1.0e300_dp, 1.0_dp, -1.0e300_dp]), 1.0_dp, "1e300 + 1 - 1e300")
    call check_bits(sum_of([1.0_dp, 1.0e300_dp, -1.0e-300_dp, -1.0e300_dp, -1.0_dp]), -1.0e-300_dp, "all but the smallest cancel")
    call fill(x(1:200), 5, 900, 900)
    do k = 1, 200
      x(401 - k) = -x(k)
    end do
    call check_bits(sum_of(x), 0.0_dp, "terms and their opposites: +0")
    call check_bits(sum_of_three(x(1), 0.375_dp, -x(1)), 0.375_dp, "what is left")
  end subroutine test_cancellation

  !> k 2^-40 for k = 1 to n sum to n (n + 1) 2^-41, a real.
  subroutine test_integers()
    integer(i8) :: words(exact_sum_words)
    integer(i8), parameter :: n = 20000
    integer(i8) :: k

    words(:) = 0
    do k = 1, n
      call exact_add(words, scale(real(k, dp), -40))
    end do
    call check_bits(exact_value(words), scale(real(n*(n + 1), dp), -41), "an exact rational sum")
  end subroutine test_integers

  !> The real 0.1 is 0.1 + 5.6e-18, so ten of them are 1 + 5.6e-17: nearer to 1 than to 1 + 2.2e-16.
  subroutine test_tenths()
    real(dp) :: x(10)
    x(:) = 0.1_dp
    call check_bits(sum_of(x), 1.0_dp, "ten tenths")
  end subroutine test_tenths

  !> 1000 terms in (-2, 2) that are multiples of 2^-60 at least: less than 2^12 in sum, so 113 bits hold every partial
  !> sum. What is promised is one unit in the last place.
  subroutine test_against_quadruple()
    real(dp) :: x(1000), expected
    real(qp) :: exact
    integer :: trial

    do trial = 1, 20
      call fill(x, 100 + trial, 6, 2)
      exact = sum(real(x, qp))
      expected = real(exact, dp)
      call check_close(sum_of(x), expected, spacing(expected), "quadruple precision")
    end do
  end subroutine test_against_quadruple

  !> One term alone comes back as it is: all mantissa bits set and one bit set, at every exponent, both signs.
  subroutine test_every_exponent()
    integer(i8) :: words(exact_sum_words)
    real(dp) :: x(2)
    integer :: e, k
    logical :: same

    same = .true.
    do e = -1021, 1024
      x(1) = scale(1.0_dp - epsilon(1.0_dp)/2, e)
      x(2) = -scale(0.5_dp, e)
      do k = 1, 2
        words(:) = 0
        call exact_add(words, x(k))
        same = same .and. transfer(exact_value(words), 0_i8) == transfer(x(k), 0_i8)
      end do
    end do
    call check(same, "one term of every exponent")
  end subroutine test_every_exponent

  subroutine test_subnormals()
    real(dp) :: smallest, x(1000)

    smallest = transfer(1_i8, 0.0_dp)
    x(:) = smallest
    call check_bits(sum_of(x), transfer(1000_i8, 0.0_dp), "1000 times the smallest real")
    call check_bits(sum_of_two(tiny(1.0_dp), -smallest), transfer(transfer(tiny(1.0_dp), 0_i8) - 1, 0.0_dp), &
      & "the largest subnormal")
    call check_bits(sum_of_two(smallest, -smallest), 0.0_dp, "subnormals cancel")
    call check_bits(sum_of_three(1.0_dp, smallest, -1.0_dp), smallest, "a subnormal beside 1")
    call check_bits(sum_of_three(-1.0_dp, -smallest, 1.0_dp), -smallest, "a negative subnormal beside 1")
  end subroutine test_subnormals

  subroutine test_signs()
    real(dp) :: x(300), y(300)
    integer :: trial

    do trial = 1, 20
      call fill(x, 200 + trial, 300, 300)
      y(:) = -x
      call check_bits(sum_of(y), -sum_of(x), "opposite terms, opposite sum")
    end do
    call check_bits(sum_of([-3.0_dp, 1.0_dp]), -2.0_dp, "a negative sum")
    call check_bits(sum_of(x(1:0)), 0.0_dp, "no terms")
    call check_bits(sum_of([-0.0_dp, -0.0_dp]), 0.0_dp, "negative zeros")
  end subroutine test_signs

  !> Partial sums may leave the range of reals, as long as the sum is in it.
  subroutine test_range()
    real(dp), parameter :: most = huge(1.0_dp)
    call check_bits(sum_of([most, most, most, -most, -most]), most, "huge + huge + huge - huge - huge")
    call check_bits(sum_of([-most, -most, most]), -most, "-huge - huge + huge")
  end subroutine test_range

  subroutine test_not_finite()
    real(dp) :: infinity, nan

    infinity = ieee_value(infinity, ieee_positive_inf)
    nan = ieee_value(nan, ieee_quiet_nan)
    call check(ieee_is_nan(sum_of_two(1.0_dp, nan)), "a NaN")
    call check(ieee_is_nan(sum_of_three(infinity, 1.0_dp, 2.0_dp)), "an infinity")
    call check(ieee_is_nan(sum_of_two(infinity, ieee_value(nan, ieee_negative_inf))), "opposite infinities")
    call check_bits(sum_of_two(1.0_dp, 2.0_dp), 3.0_dp, "the next sum starts anew")
  end subroutine test_not_finite

end program test_exact_sum
