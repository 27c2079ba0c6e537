!> Random numbers from (seed, counter, stream): range, reproducibility, moments, independence of neighbours.
!> Statistics are those of a fixed sample: bounds are five to six standard deviations of what true randomness gives.
program test_random_hash
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp, i8
  use gravier_random_hash, only: hash_uniform, hash_rows
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  integer, parameter :: n = 65536
  !> two samples
  real(dp), allocatable :: x(:), y(:)

  call MPI_Init()
  allocate (x(n), y(n))
  call test_range()
  call test_arguments()
  call test_moments()
  call test_bins()
  call test_neighbours()
  call test_grid()
  call test_no_repeats()
  call test_rows()
  call finish_checks()
  call MPI_Finalize()

contains

  !> n numbers of consecutive identifiers from `from`.
  subroutine draw(sample, seed, from, stream)
    real(dp), intent(out) :: sample(:)
    integer, intent(in) :: seed, stream
    integer(i8), intent(in) :: from
    integer :: k
    do k = 1, n
      sample(k) = hash_uniform(seed, from + k, stream)
    end do
  end subroutine draw

  !> The checksum of a table is that of its parts, and another with any bit, and any two rows in each other's place.
  subroutine test_rows()
    integer(i8) :: table(3, 40), changed(3, 40), digest
    integer :: i, k, bit
    logical :: differs

    do i = 1, size(table, 2)
      do k = 1, 3
        table(k, i) = 3*i + k
      end do
    end do
    digest = hash_rows(table, 7_i8)
    call check_equal(ieor(hash_rows(table(:, 1:13), 7_i8), hash_rows(table(:, 14:), 20_i8)), digest, "a table in two parts")
    call check_equal(hash_rows(table(:, 1:0), 7_i8), 0_i8, "no rows")
    differs = hash_rows(table, 8_i8) /= digest
    do i = 1, size(table, 2)
      do k = 1, 3
        do bit = 0, 63
          changed = table
          changed(k, i) = ieor(changed(k, i), shiftl(1_i8, bit))
          differs = differs .and. hash_rows(changed, 7_i8) /= digest
        end do
      end do
      if (i == 1) cycle
      changed = table
      changed(:, i) = table(:, i - 1)
      changed(:, i - 1) = table(:, i)
      differs = differs .and. hash_rows(changed, 7_i8) /= digest
    end do
    call check(differs, "another place, another bit, other order: another checksum")
  end subroutine test_rows

  subroutine test_range()
    integer(i8), parameter :: counters(*) = [0_i8, 1_i8, -1_i8, 1000003_i8, -1000003_i8, 2_i8**31, 2_i8**32, 2_i8**62, -2_i8**62]
    integer, parameter :: seeds(*) = [0, 1, -1, 42, huge(1), -huge(1)]
    real(dp) :: value
    integer :: c, s, stream
    logical :: inside

    inside = .true.
    do c = 1, size(counters)
      do s = 1, size(seeds)
        do stream = -2, 5
          value = hash_uniform(seeds(s), counters(c), stream)
          inside = inside .and. value > 0.0_dp .and. value < 1.0_dp
        end do
      end do
    end do
    call check(inside, "in the open interval (0, 1), whatever the arguments")
  end subroutine test_range

  subroutine test_arguments()
    real(dp) :: value
    integer(i8) :: k
    logical :: same, differs

    same = .true.
    differs = .true.
    do k = 1, 1000
      value = hash_uniform(5, k, 2)
      ! other calls in between leave no trace
      differs = differs .and. abs(value - hash_uniform(6, k, 2)) > 0.0_dp
      differs = differs .and. abs(value - hash_uniform(5, k, 3)) > 0.0_dp
      differs = differs .and. abs(value - hash_uniform(5, k + 1, 2)) > 0.0_dp
      same = same .and. abs(value - hash_uniform(5, k, 2)) <= 0.0_dp
    end do
    call check(same, "the same for the same arguments")
    call check(differs, "another for another seed, stream or counter")
  end subroutine test_arguments

  !> Mean 1/2 and variance 1/12; standard deviations of the sample's are 1/sqrt(12 n) and 1/sqrt(180 n).
  subroutine test_moments()
    real(dp) :: mean
    integer :: seed, stream

    do seed = 0, 3
      do stream = 0, 3
        call draw(x, seed, 0_i8, stream)
        mean = sum(x)/n
        call check_close(mean, 0.5_dp, 5/sqrt(12.0_dp*n), "mean")
        call check_close(sum((x - mean)**2)/n, 1/12.0_dp, 5/sqrt(180.0_dp*n), "variance")
      end do
    end do
  end subroutine test_moments

  !> Counts of 64 equal intervals, of the leading bits and of bits further down. Chi-square of 63 degrees of freedom has
  !> the mean 63 and the variance 126.
  subroutine test_bins()
    integer :: place, k, counts(64), seed

    do seed = 1, 4
      call draw(x, seed, 0_i8, 0)
      do place = 0, 36, 6
        counts(:) = 0
        do k = 1, n
          call add_one(counts(1 + int(modulo(x(k)*2.0_dp**place, 1.0_dp)*64)))
        end do
        call check_close(chi_square(counts), 63.0_dp, 6*sqrt(126.0_dp), "intervals equally full")
      end do
    end do
  end subroutine test_bins

  subroutine add_one(counter)
    integer, intent(inout) :: counter
    counter = counter + 1
  end subroutine add_one

  real(dp) function chi_square(counts)
    integer, intent(in) :: counts(:)
    real(dp) :: expected
    expected = sum(counts)/real(size(counts), dp)
    chi_square = sum((counts - expected)**2)/expected
  end function chi_square

  !> Correlation of two samples; for independent ones its standard deviation is 1/sqrt(n).
  real(dp) function correlation()
    correlation = 12*(sum((x - 0.5_dp)*(y - 0.5_dp))/n)
  end function correlation

  subroutine test_neighbours()
    real(dp), parameter :: bound = 6/sqrt(real(n, dp))
    integer(i8) :: lag

    call draw(x, 3, 0_i8, 1)
    do lag = 1, 8
      call draw(y, 3, lag, 1)
      call check_close(correlation(), 0.0_dp, bound, "neighbouring identifiers")
    end do
    do lag = 4, 24, 4
      call draw(y, 3, 2_i8**lag, 1)
      call check_close(correlation(), 0.0_dp, bound, "identifiers a power of two apart")
    end do
    do lag = 1, 6
      call draw(y, 3, 0_i8, 1 + int(lag))
      call check_close(correlation(), 0.0_dp, bound, "neighbouring streams")
      call draw(y, 3 + int(lag), 0_i8, 1)
      call check_close(correlation(), 0.0_dp, bound, "neighbouring seeds")
    end do
  end subroutine test_neighbours

  !> Pairs of numbers of neighbouring identifiers, streams and seeds over 16 x 16 squares.
  subroutine test_grid()
    call draw(x, 3, 0_i8, 1)
    call draw(y, 3, 1_i8, 1)
    call check_close(squares(), 255.0_dp, 6*sqrt(510.0_dp), "squares of neighbouring identifiers")
    call draw(y, 3, 0_i8, 2)
    call check_close(squares(), 255.0_dp, 6*sqrt(510.0_dp), "squares of neighbouring streams")
    call draw(y, 4, 0_i8, 1)
    call check_close(squares(), 255.0_dp, 6*sqrt(510.0_dp), "squares of neighbouring seeds")
  end subroutine test_grid

  real(dp) function squares()
    integer :: counts(256), k

    counts(:) = 0
    do k = 1, n
      call add_one(counts(1 + int(16*x(k)) + 16*int(16*y(k))))
    end do
    squares = chi_square(counts)
  end function squares

  !> Of 65536 numbers of 52 bits, two are equal with a probability of 5e-7.
  subroutine test_no_repeats()
    integer, allocatable :: place(:), next(:)
    integer :: k, other, bin
    logical :: repeated

    allocate (place(0:n - 1), next(n))
    call draw(x, 1, 0_i8, 0)
    place(:) = 0
    repeated = .false.
    do k = 1, n
      bin = int(n*x(k))
      other = place(bin)
      do while (other > 0)
        repeated = repeated .or. abs(x(other) - x(k)) <= 0.0_dp
        other = next(other)
      end do
      next(k) = place(bin)
      place(bin) = k
    end do
    call check(.not. repeated, "no number twice")
  end subroutine test_no_repeats

end program test_random_hash
