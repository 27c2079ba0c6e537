!> Records to ranks that do not expect them. Every rank knows by hashing what all ranks send, so that the expected
!> records, and their order, are known everywhere.
program test_sparse_exchange
  use mpi_f08, only: MPI_COMM_WORLD
  use gravier_kinds, only: i8
  use gravier_random_hash, only: hash_uniform
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_sparse_exchange, only: sparse_exchange
  use gravier_check, only: check, check_equal, finish_checks
  implicit none
  !> who writes to whom: to random ranks, to nobody, to oneself, all to one rank, some ranks to their neighbour only
  integer, parameter :: to_random = 1, to_nobody = 2, to_self = 3, to_one = 4, to_next = 5
  integer, parameter :: n_patterns = 5
  type(communicator_t) :: comm, second
  integer :: k

  call start_parallel()
  call comm%init()
  call second%init(MPI_COMM_WORLD)
  do k = 1, n_patterns
    call test_pattern(comm, k, 1000 + k, 50)
  end do
  call test_pattern(comm, to_random, 2000, 20000)
  call test_pattern(comm, to_one, 2001, 20000)
  ! one after the other without a pause, on two communicators: no round may take the messages of another
  do k = 1, 200
    call test_pattern(comm, 1 + mod(k, n_patterns), k, 8)
    if (mod(k, 3) == 0) call test_pattern(second, 1 + mod(k, n_patterns), 500 + k, 3)
  end do
  call finish_checks()
  call second%free()
  call comm%free()
  call stop_parallel()

contains

  !> Records that rank `r` sends in a trial, at most `most`.
  integer function n_records(r, pattern, trial, most)
    integer, intent(in) :: r, pattern, trial, most
    n_records = int((most + 1)*hash_uniform(trial, int(r, i8), 0))
    if (pattern == to_nobody) n_records = 0
    if (pattern == to_next .and. mod(r, 2) == 1) n_records = 0
  end function n_records

  !> Where record `k` of rank `r` goes.
  integer function goes_to(r, k, pattern, trial)
    integer, intent(in) :: r, k, pattern, trial
    select case (pattern)
    case (to_self)
      goes_to = r
    case (to_one)
      goes_to = mod(trial, comm%size)
    case (to_next)
      goes_to = mod(r + 1, comm%size)
    case default
      goes_to = int(comm%size*hash_uniform(trial, int(r, i8), k))
    end select
  end function goes_to

  subroutine test_pattern(over, pattern, trial, most)
    type(communicator_t), intent(in) :: over
    integer, intent(in) :: pattern, trial, most
    integer(i8), allocatable :: records(:, :), received(:, :)
    integer, allocatable :: destination(:)
    integer :: r, k, n
    logical :: right

    n = n_records(over%rank, pattern, trial, most)
    allocate (records(3, n), destination(n))
    do k = 1, n
      destination(k) = goes_to(over%rank, k, pattern, trial)
      records(1, k) = over%rank
      records(2, k) = k
      records(3, k) = -huge(1_i8) + trial
    end do
    call sparse_exchange(over, records, destination, received)
    n = 0
    right = .true.
    do r = 0, over%size - 1
      do k = 1, n_records(r, pattern, trial, most)
        if (goes_to(r, k, pattern, trial) /= over%rank) cycle
        n = n + 1
        if (n > size(received, 2)) cycle
        right = right .and. received(1, n) == r .and. received(2, n) == k .and. received(3, n) == -huge(1_i8) + trial
      end do
    end do
    call check_equal(size(received, 1), 3, "words of a record")
    call check_equal(size(received, 2), n, "records received")
    call check(right, "records by rank, then in the order of sending")
  end subroutine test_pattern

end program test_sparse_exchange
