!> Collective operations: sums that do not depend on the ranks, errors that all agree on, blocks of subdomains.
program test_communicator
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_is_nan, ieee_quiet_nan
  use mpi_f08, only: MPI_COMM_SELF, MPI_COMM_NULL
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_input, status_failure
  use gravier_random_hash, only: hash_uniform
  use gravier_exact_sum, only: exact_sum_words, exact_add, exact_value
  use gravier_communicator, only: communicator_t, start_parallel, join_parallel, stop_parallel, mpi_library
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  type(communicator_t) :: comm
  type(error_t), allocatable :: error
  logical :: started = .false.
  integer :: n

  call join_parallel(started, error)
  call check(started .and. .not. allocated(error), "MPI is started")
  started = .false.
  call join_parallel(started, error)
  call check(.not. (started .or. allocated(error)), "MPI runs")
  call start_parallel()
  call comm%init()
  do n = 1, 40
    call test_sum_parts(n)
  end do
  call test_not_finite()
  call test_counts()
  call test_extremes()
  call test_agree()
  call test_broadcast()
  call test_blocks()
  call test_barrier_asleep()
  call test_self()
  call test_handle()
  call test_twice()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> A communicator by its handle.
  subroutine test_handle()
    type(communicator_t) :: own
    type(error_t), allocatable :: wrong

    call own%init_from(MPI_COMM_NULL%mpi_val, wrong)
    call check(allocated(wrong), "no communicator")
    if (allocated(wrong)) call check(wrong%status == status_input .and. &
      & wrong%message == "communicator: MPI_COMM_NULL; expected one that has this process", "a line for no communicator")
    call own%init_from(MPI_COMM_SELF%mpi_val, error)
    call check(own%size == 1 .and. own%rank == 0, "the communicator of a rank by itself, by its handle")
    call own%free()
  end subroutine test_handle

  !> Term `i` of subdomain `s`: both signs, over 400 binary orders of magnitude, so that the order of additions matters.
  real(dp) function term(s, i)
    integer, intent(in) :: s, i
    term = scale(hash_uniform(1, int(s, i8), 2*i) - 0.5_dp, int(400*hash_uniform(1, int(s, i8), 2*i + 1)) - 200)
  end function term

  !> `n` subdomains with three terms each, in blocks over the ranks: the bits of one rank alone.
  subroutine test_sum_parts(n)
    integer, intent(in) :: n
    real(dp) :: sums(3), expected
    real(dp), allocatable :: parts(:, :), part(:)
    integer(i8) :: words(exact_sum_words)
    integer :: first, last, s, i

    first = comm%first_subdomain(comm%rank, n)
    last = comm%first_subdomain(comm%rank + 1, n) - 1
    allocate (parts(3, last - first + 1), part(last - first + 1))
    do s = first, last
      do i = 1, 3
        parts(i, s - first + 1) = term(s, i)
      end do
      part(s - first + 1) = term(s, 2)
    end do
    call comm%sum_parts(parts, sums)
    do i = 1, 3
      words(:) = 0
      do s = 1, n
        call exact_add(words, term(s, i))
      end do
      expected = exact_value(words)
      call check_equal(transfer(sums(i), 0_i8), transfer(expected, 0_i8), "sum of parts, bit for bit")
    end do
    call check_equal(transfer(comm%sum_real(part), 0_i8), transfer(sums(2), 0_i8), "sum of one number, bit for bit")
  end subroutine test_sum_parts

  !> A NaN on the last rank makes its own sum a NaN everywhere, and no other.
  subroutine test_not_finite()
    real(dp) :: parts(2, 1), sums(2)

    parts(:, :) = 1.0_dp
    if (comm%rank == comm%size - 1) parts(2, 1) = ieee_value(1.0_dp, ieee_quiet_nan)
    call comm%sum_parts(parts, sums)
    call check_close(sums(1), real(comm%size, dp), 0.0_dp, "sum beside a NaN")
    call check(ieee_is_nan(sums(2)), "sum with a NaN on one rank")
  end subroutine test_not_finite

  !> Rank r gives r + 3 (and more than 2^31 of them).
  subroutine test_counts()
    integer(i8), parameter :: many = 3000000000_i8
    integer(i8) :: counts(2), expected
    integer :: r

    expected = 0
    do r = 0, comm%rank - 1
      expected = expected + (r + 3)*many
    end do
    call check_equal(comm%offset((comm%rank + 3)*many), expected, "sum over the ranks before")
    do r = comm%rank, comm%size - 1
      expected = expected + (r + 3)*many
    end do
    call check_equal(comm%total((comm%rank + 3)*many), expected, "sum over the ranks")
    counts(1) = comm%rank
    counts(2) = (comm%rank + 3)*many
    call comm%sum_counts(counts)
    call check_equal(counts(1), int(comm%size*(comm%size - 1)/2, i8), "first count")
    call check_equal(counts(2), expected, "second count")
  end subroutine test_counts

  subroutine test_extremes()
    real(dp) :: x(2)

    call check_close(comm%highest(-1.0_dp - comm%rank), -1.0_dp, 0.0_dp, "highest")
    call check_close(comm%lowest(-1.0_dp - comm%rank), -real(comm%size, dp), 0.0_dp, "lowest")
    x(1) = comm%rank
    x(2) = -comm%rank - 5.0_dp
    call comm%highest_of(x)
    call check_close(x(1), comm%size - 1.0_dp, 0.0_dp, "highest of the first")
    call check_close(x(2), -5.0_dp, 0.0_dp, "highest of the second")
    call check(comm%any_true(comm%rank == comm%size - 1), "true on the last rank")
    call check(.not. comm%any_true(.false.), "true on no rank")
  end subroutine test_extremes

  !> For every lowest rank with an error: all leave with its status and message, whatever the ranks after it say.
  subroutine test_agree()
    type(error_t), allocatable :: error
    integer :: lowest

    call comm%agree(error)
    call check(.not. allocated(error), "no error on any rank")
    do lowest = 0, comm%size - 1
      if (allocated(error)) deallocate (error)
      if (comm%rank == lowest) call raise(error, status_input, "the cause "//repeat("x", 300)//".")
      if (comm%rank > lowest) call raise(error, status_failure, "another")
      call comm%agree(error)
      call check(allocated(error), "an error on every rank")
      if (.not. allocated(error)) cycle
      call check_equal(error%status, status_input, "status of the lowest rank")
      call check_equal(error%message, "the cause "//repeat("x", 300)//".", "message of the lowest rank")
      call check_equal(len(error%message), 311, "length of the message")
    end do
  end subroutine test_agree

  subroutine test_broadcast()
    character(len=:), allocatable :: text
    integer :: root

    do root = 0, comm%size - 1
      text = "of another rank"
      if (comm%rank == root) text = "of the root "
      call comm%broadcast_text(text, root)
      call check_equal(text, "of the root", "text of the root")
      call check_equal(len(text), 12, "length of the text")
      if (comm%rank == root) text = ""
      call comm%broadcast_text(text, root)
      call check_equal(len(text), 0, "empty text")
    end do
  end subroutine test_broadcast

  !> Up to 40 subdomains over up to 8 ranks: blocks follow each other, hold every subdomain once, differ by one at most,
  !> and rank_of says the same as first_subdomain.
  subroutine test_blocks()
    type(communicator_t) :: other
    integer :: n_subdomains, ranks, r, s, first, next, least, most
    logical :: right

    right = .true.
    do ranks = 1, 8
      other%size = ranks
      do n_subdomains = 1, 40
        next = 1
        least = n_subdomains
        most = 0
        do r = 0, ranks - 1
          first = other%first_subdomain(r, n_subdomains)
          right = right .and. first == next
          next = other%first_subdomain(r + 1, n_subdomains)
          least = min(least, next - first)
          most = max(most, next - first)
          do s = first, next - 1
            right = right .and. other%rank_of(s, n_subdomains) == r
          end do
        end do
        right = right .and. next == n_subdomains + 1 .and. most - least <= 1
      end do
      ! products beyond 2^31
      s = huge(1) - 1
      right = right .and. other%rank_of(s, s) == ranks - 1 .and. other%first_subdomain(ranks, s) == huge(1)
    end do
    call check(right, "blocks of subdomains")
  end subroutine test_blocks

  !> No rank leaves before the last one has come, which takes its time. The ranks of a machine have one clock.
  subroutine test_barrier_asleep()
    integer(i8) :: start, came, left, second

    call system_clock(start, second)
    came = start
    do while (comm%rank == comm%size - 1 .and. came - start < second/20)
      call system_clock(came)
    end do
    call comm%barrier_asleep()
    call system_clock(left)
    call check(left >= comm%largest(came), "a barrier")
    call comm%barrier_asleep()
  end subroutine test_barrier_asleep

  !> A communicator of its own for each rank.
  subroutine test_self()
    type(communicator_t) :: alone

    call alone%init(MPI_COMM_SELF)
    call check_equal(alone%rank, 0, "rank alone")
    call check_equal(alone%size, 1, "size alone")
    call check_equal(alone%total(7_i8), 7_i8, "total alone")
    call check_equal(alone%offset(7_i8), 0_i8, "offset alone")
    call alone%free()
    call check(.not. alone%alive, "freed")
    call alone%free()
  end subroutine test_self

  !> Starting MPI twice, making a communicator twice, a name for the library.
  subroutine test_twice()
    call start_parallel()
    call comm%init()
    call check(comm%alive .and. comm%size >= 1 .and. comm%rank < comm%size, "made again")
    call comm%barrier()
    call check(len(mpi_library()) > 0, "the library has a name")
    call check(scan(mpi_library(), ","//new_line("a")) == 0, "in one line")
  end subroutine test_twice

end program test_communicator
