!> Exchange of records between ranks that do not know beforehand who writes to them.
module gravier_sparse_exchange
  use mpi_f08, only: MPI_Request, MPI_Status, MPI_INTEGER8, MPI_ANY_SOURCE, MPI_STATUS_IGNORE, MPI_STATUSES_IGNORE, &
    & MPI_Issend, MPI_Iprobe, MPI_Recv, MPI_Testall, MPI_Ibarrier, MPI_Test, MPI_Get_count
  use gravier_kinds, only: i8
  use gravier_narrow, only: narrow
  use gravier_communicator, only: communicator_t
  use gravier_sorting, only: argsort
  implicit none
  private
  public :: sparse_exchange, exchange_sorted

  type :: message_t
    integer :: source = 0
    integer(i8), allocatable :: words(:, :)
  end type message_t

  !> two successive exchanges use two tags in turn: a rank may be one exchange ahead of its neighbour
  integer, parameter :: tags(0:1) = [100, 101]

contains

  !> Send each record to the rank it names and receive those sent here. Collective; its cost grows with the
  !> number of ranks really written to (nonblocking consensus of Hoefler, Siebert, Lumsdaine 2010).
  subroutine sparse_exchange(comm, records, destination, received)
    type(communicator_t), intent(in) :: comm
    !> (words of a record, number of records)
    integer(i8), intent(in), contiguous :: records(:, :)
    !> (number of records): ranks from 0
    integer, intent(in), contiguous :: destination(:)
    !> (words of a record, number received), by source rank, then in the order of sending
    integer(i8), allocatable, intent(out) :: received(:, :)

    integer, allocatable :: order(:), target_rank(:)
    integer(i8), allocatable :: keys(:)
    integer(i8), allocatable, asynchronous :: outgoing(:, :)
    integer :: i

    allocate (order(size(destination)), target_rank(size(destination)))
    allocate (outgoing(size(records, 1), size(records, 2)))
    keys = int(destination, i8)
    call argsort(keys, order)
    do i = 1, size(order)
      outgoing(:, i) = records(:, order(i))
      target_rank(i) = destination(order(i))
    end do
    deallocate (keys, order)
    call exchange_sorted(comm, outgoing, target_rank, received)
  end subroutine sparse_exchange

  !> The same for records that stand in the order of the ranks they are sent to. Collective.
  subroutine exchange_sorted(comm, outgoing, target_rank, received)
    type(communicator_t), intent(in) :: comm
    !> (words of a record, number of records); deallocated at the end
    integer(i8), allocatable, intent(inout), asynchronous :: outgoing(:, :)
    !> (number of records): ranks from 0, ascending
    integer, intent(in), contiguous :: target_rank(:)
    !> (words of a record, number received), by source rank, then in the order of sending
    integer(i8), allocatable, intent(out) :: received(:, :)

    integer, allocatable :: first(:), last(:)
    type(message_t), allocatable :: messages(:)
    integer :: n_messages, n_words

    comm%exchanges = mod(comm%exchanges + 1, 2)
    n_words = size(outgoing, 1)
    call find_runs(target_rank, first, last)
    call deliver(comm, outgoing, target_rank, first, last, messages, n_messages)
    ! everything is delivered: the memory of what was sent is free for what has come
    deallocate (outgoing)
    call merge_messages(n_words, messages(1:n_messages), received)
  end subroutine exchange_sorted

  !> First and last place of each run of equal values in ascending `values`.
  pure subroutine find_runs(values, first, last)
    integer, intent(in), contiguous :: values(:)
    integer, allocatable, intent(out) :: first(:), last(:)
    integer :: i, runs

    runs = min(size(values), 1)
    do i = 2, size(values)
      if (values(i) /= values(i - 1)) runs = runs + 1
    end do
    allocate (first(runs), last(runs))
    if (runs == 0) return
    runs = 1
    first(1) = 1
    last(1) = 1
    do i = 2, size(values)
      if (values(i) /= values(i - 1)) then
        runs = runs + 1
        first(runs) = i
      end if
      last(runs) = i
    end do
  end subroutine find_runs

  !> The exchange itself: synchronous sends, receives of whatever arrives, and a barrier that starts on a rank
  !> once its own sends have been received.
  subroutine deliver(comm, outgoing, target_rank, first, last, messages, n_messages)
    type(communicator_t), intent(in) :: comm
    integer(i8), intent(in), asynchronous, contiguous :: outgoing(:, :)
    integer, intent(in), contiguous :: target_rank(:), first(:), last(:)
    type(message_t), allocatable, intent(out) :: messages(:)
    integer, intent(out) :: n_messages

    type(MPI_Request), allocatable :: requests(:)
    type(MPI_Request) :: barrier
    integer(i8), allocatable :: own(:, :)
    integer :: i, n_sends
    logical :: arrived, sent, in_barrier, done

    allocate (messages(2), requests(size(first)))
    n_messages = 0
    n_sends = 0
    do i = 1, size(first)
      if (target_rank(first(i)) == comm%rank) then
        allocate (own, source=outgoing(:, first(i):last(i)))
        call keep(comm%rank, own)
      else
        n_sends = n_sends + 1
        call MPI_Issend(outgoing(:, first(i):last(i)), narrow(size(outgoing, 1, i8)*(last(i) - first(i) + 1)), MPI_INTEGER8, &
          & target_rank(first(i)), tags(comm%exchanges), comm%mpi, requests(n_sends))
      end if
    end do
    if (comm%size == 1) return
    in_barrier = .false.
    done = .false.
    do while (.not. done)
      call receive_one(arrived)
      if (in_barrier) then
        call MPI_Test(barrier, done, MPI_STATUS_IGNORE)
      else if (.not. arrived) then
        call MPI_Testall(n_sends, requests(1:n_sends), sent, MPI_STATUSES_IGNORE)
        if (sent) then
          call MPI_Ibarrier(comm%mpi, barrier)
          in_barrier = .true.
        end if
      end if
    end do

  contains

    subroutine receive_one(found)
      logical, intent(out) :: found
      type(MPI_Status) :: status
      integer(i8), allocatable :: words(:, :)
      integer :: n_words

      call MPI_Iprobe(MPI_ANY_SOURCE, tags(comm%exchanges), comm%mpi, found, status)
      if (.not. found) return
      call MPI_Get_count(status, MPI_INTEGER8, n_words)
      allocate (words(size(outgoing, 1), n_words/size(outgoing, 1)))
      call MPI_Recv(words, n_words, MPI_INTEGER8, status%MPI_SOURCE, tags(comm%exchanges), comm%mpi, MPI_STATUS_IGNORE)
      call keep(status%MPI_SOURCE, words)
    end subroutine receive_one

    subroutine keep(source, words)
      integer, intent(in) :: source
      !> not allocated afterwards
      integer(i8), allocatable, intent(inout) :: words(:, :)
      type(message_t), allocatable :: more(:)
      integer :: k

      if (n_messages == size(messages)) then
        allocate (more(2*n_messages))
        do k = 1, n_messages
          more(k)%source = messages(k)%source
          call move_alloc(messages(k)%words, more(k)%words)
        end do
        call move_alloc(more, messages)
      end if
      n_messages = n_messages + 1
      messages(n_messages)%source = source
      call move_alloc(words, messages(n_messages)%words)
    end subroutine keep

  end subroutine deliver

  !> Put the messages one after the other by source rank. Each is deallocated once it has been copied.
  pure subroutine merge_messages(n_words, messages, received)
    integer, intent(in) :: n_words
    type(message_t), intent(inout) :: messages(:)
    integer(i8), allocatable, intent(out) :: received(:, :)
    integer, allocatable :: order(:)
    integer :: i, j, k, n, next

    n = 0
    do i = 1, size(messages)
      n = n + size(messages(i)%words, 2)
    end do
    allocate (received(n_words, n), order(size(messages)))
    ! few messages: insertion sort by source
    do i = 1, size(messages)
      k = i
      do while (k > 1)
        if (messages(order(k - 1))%source < messages(i)%source) exit
        order(k) = order(k - 1)
        k = k - 1
      end do
      order(k) = i
    end do
    next = 0
    do i = 1, size(messages)
      do j = 1, size(messages(order(i))%words, 2)
        next = next + 1
        received(:, next) = messages(order(i))%words(:, j)
      end do
      deallocate (messages(order(i))%words)
    end do
  end subroutine merge_messages

end module gravier_sparse_exchange
