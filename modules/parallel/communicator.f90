!> The communicator of a run and its collective operations. Results do not depend on the number of ranks:
!> real sums are exact, and maxima and integer sums are exact by nature.
module gravier_communicator
  use, intrinsic :: iso_c_binding, only: c_funloc, c_funptr, c_int
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_value, ieee_quiet_nan
  use mpi_f08, only: MPI_Comm, MPI_Request, MPI_COMM_WORLD, MPI_COMM_NULL, MPI_STATUS_IGNORE, MPI_Init, MPI_Initialized, &
    & MPI_Finalize, MPI_Finalized, MPI_COMM_TYPE_SHARED, MPI_INFO_NULL, MPI_Comm_rank, MPI_Comm_size, MPI_Comm_split_type, &
    & MPI_Comm_dup, MPI_Comm_free, MPI_Allreduce, MPI_Exscan, MPI_Bcast, MPI_Barrier, MPI_Ibarrier, MPI_Test, &
    & MPI_Get_library_version, MPI_MAX_LIBRARY_VERSION_STRING, MPI_INTEGER, MPI_INTEGER8, MPI_DOUBLE_PRECISION, MPI_CHARACTER, &
    & MPI_LOGICAL, MPI_SUM, MPI_MIN, MPI_MAX, MPI_LOR, MPI_BOR, MPI_BXOR
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_errors, only: error_t, raise, status_input, status_failure
  use gravier_process, only: pause_for, end_at_once
  use gravier_lone_process, only: ease_start, start_is_over, n_suggested
  use gravier_exact_sum, only: exact_sum_words, exact_add, exact_value
  implicit none
  private
  public :: communicator_t, start_parallel, join_parallel, stop_parallel, mpi_library

  !> A communicator with its rank and size. `init` duplicates the parent, `free` must be called.
  type :: communicator_t
    type(MPI_Comm) :: mpi
    integer :: rank = 0
    integer :: size = 1
    logical :: alive = .false.
    !> sparse exchanges made so far, shared by the copies of this object
    integer, pointer :: exchanges => null()
  contains
    procedure :: init => communicator_init
    procedure :: init_from => communicator_init_from
    procedure :: free => communicator_free
    procedure :: barrier => communicator_barrier
    procedure :: barrier_asleep => communicator_barrier_asleep
    procedure :: total => communicator_total
    procedure :: offset => communicator_offset
    procedure :: highest => communicator_highest
    procedure :: lowest => communicator_lowest
    procedure :: highest_of => communicator_highest_of
    procedure :: largest => communicator_largest
    procedure :: exclusive_or => communicator_exclusive_or
    procedure :: union_of => communicator_union_of
    procedure :: any_true => communicator_any_true
    procedure :: sum_parts => communicator_sum_parts
    procedure :: sum_real => communicator_sum_real
    procedure :: sum_counts => communicator_sum_counts
    procedure :: broadcast_text => communicator_broadcast_text
    procedure :: agree => communicator_agree
    procedure :: ranks_here => communicator_ranks_here
    procedure :: rank_of => communicator_rank_of
    procedure :: first_subdomain => communicator_first_subdomain
  end type communicator_t

  interface
    integer(c_int) function c_atexit(action) bind(C, name="atexit")
      import :: c_int, c_funptr
      implicit none
      type(c_funptr), value :: action
    end function c_atexit
  end interface

  !> between start_parallel and stop_parallel
  logical :: parallel = .false.

contains

  !> Start MPI, unless it is running. A process that ends before stop_parallel, by a library that gives up, has status_failure.
  subroutine start_parallel()
    logical :: running, eased(n_suggested)
    integer(c_int) :: ignored

    if (.not. parallel) ignored = c_atexit(c_funloc(end_early))
    parallel = .true.
    call MPI_Initialized(running)
    if (running) return
    call ease_start(eased)
    call MPI_Init()
    call start_is_over(eased)
  end subroutine start_parallel

  !> Start MPI for a library in the process of another program, unless that has started it. Failure (status_input): MPI has been
  !> ended.
  subroutine join_parallel(started, error)
    !> MPI was started here, and is to be ended by stop_parallel; kept where it was
    logical, intent(inout) :: started
    type(error_t), allocatable, intent(inout) :: error
    logical :: running, ended

    call MPI_Finalized(ended)
    if (ended) call raise(error, status_input, "MPI has been ended in this process; expected one in which it runs or can be "// &
      & "started")
    if (allocated(error)) return
    call MPI_Initialized(running)
    if (running) return
    call start_parallel()
    started = .true.
  end subroutine join_parallel

  !> End MPI.
  subroutine stop_parallel()
    parallel = .false.
    call MPI_Finalize()
  end subroutine stop_parallel

  !> What the C library calls when the process ends.
  subroutine end_early() bind(C)
    if (parallel) call end_at_once(status_failure)
  end subroutine end_early

  !> First line of what the MPI library says of itself.
  function mpi_library() result(text)
    character(len=:), allocatable :: text
    character(len=MPI_MAX_LIBRARY_VERSION_STRING) :: buffer
    integer :: length
    call MPI_Get_library_version(buffer, length)
    text = buffer(1:length)
    if (scan(text, ","//new_line("a")) > 0) text = text(1:scan(text, ","//new_line("a")) - 1)
  end function mpi_library

  !> Duplicate `parent` (the world by default). Collective.
  subroutine communicator_init(self, parent)
    class(communicator_t), intent(inout) :: self
    type(MPI_Comm), intent(in), optional :: parent

    call self%free()
    if (present(parent)) then
      call MPI_Comm_dup(parent, self%mpi)
    else
      call MPI_Comm_dup(MPI_COMM_WORLD, self%mpi)
    end if
    call MPI_Comm_rank(self%mpi, self%rank)
    call MPI_Comm_size(self%mpi, self%size)
    allocate (self%exchanges)
    self%exchanges = 0
    self%alive = .true.
  end subroutine communicator_init

  !> Duplicate a communicator by its handle, the integer that Fortran and C (MPI_Comm_c2f) have for it. Collective.
  subroutine communicator_init_from(self, handle, error)
    class(communicator_t), intent(inout) :: self
    integer, intent(in) :: handle
    !> it is none, on this process: input
    type(error_t), allocatable, intent(inout) :: error
    type(MPI_Comm) :: parent

    if (handle == MPI_COMM_NULL%mpi_val) then
      call raise(error, status_input, "communicator: MPI_COMM_NULL; expected one that has this process")
      return
    end if
    parent%mpi_val = handle
    call self%init(parent)
  end subroutine communicator_init_from

  subroutine communicator_free(self)
    class(communicator_t), intent(inout) :: self
    if (.not. self%alive) return
    call MPI_Comm_free(self%mpi)
    deallocate (self%exchanges)
    self%alive = .false.
  end subroutine communicator_free

  subroutine communicator_barrier(self)
    class(communicator_t), intent(in) :: self
    call MPI_Barrier(self%mpi)
  end subroutine communicator_barrier

  !> A barrier in which a rank that waits leaves its processor to others. It takes up to some milliseconds longer.
  subroutine communicator_barrier_asleep(self)
    class(communicator_t), intent(in) :: self
    integer(c_int), parameter :: nap = 2000_c_int
    type(MPI_Request) :: request
    logical :: done

    call MPI_Ibarrier(self%mpi, request)
    do
      call MPI_Test(request, done, MPI_STATUS_IGNORE)
      if (done) exit
      call pause_for(nap)
    end do
  end subroutine communicator_barrier_asleep

  !> Sum of `n` over the ranks.
  integer(i8) function communicator_total(self, n) result(total)
    class(communicator_t), intent(in) :: self
    integer(i8), intent(in) :: n
    call MPI_Allreduce(n, total, 1, MPI_INTEGER8, MPI_SUM, self%mpi)
  end function communicator_total

  !> Sum of `n` over the ranks before this one.
  integer(i8) function communicator_offset(self, n) result(offset)
    class(communicator_t), intent(in) :: self
    integer(i8), intent(in) :: n
    offset = 0
    call MPI_Exscan(n, offset, 1, MPI_INTEGER8, MPI_SUM, self%mpi)
    if (self%rank == 0) offset = 0
  end function communicator_offset

  real(dp) function communicator_highest(self, x) result(highest)
    class(communicator_t), intent(in) :: self
    real(dp), intent(in) :: x
    call MPI_Allreduce(x, highest, 1, MPI_DOUBLE_PRECISION, MPI_MAX, self%mpi)
  end function communicator_highest

  real(dp) function communicator_lowest(self, x) result(lowest)
    class(communicator_t), intent(in) :: self
    real(dp), intent(in) :: x
    call MPI_Allreduce(x, lowest, 1, MPI_DOUBLE_PRECISION, MPI_MIN, self%mpi)
  end function communicator_lowest

  !> Element by element maximum over the ranks, in place.
  subroutine communicator_highest_of(self, x)
    class(communicator_t), intent(in) :: self
    real(dp), intent(inout), contiguous :: x(:)
    real(dp), allocatable :: highest(:)
    allocate (highest(size(x)))
    call MPI_Allreduce(x, highest, size(x), MPI_DOUBLE_PRECISION, MPI_MAX, self%mpi)
    x(:) = highest
  end subroutine communicator_highest_of

  !> Largest of integers, one a rank. Collective.
  integer(i8) function communicator_largest(self, n) result(largest)
    class(communicator_t), intent(in) :: self
    integer(i8), intent(in) :: n
    call MPI_Allreduce(n, largest, 1, MPI_INTEGER8, MPI_MAX, self%mpi)
  end function communicator_largest

  !> Exclusive or of the bits of words, one a rank. Collective.
  integer(i8) function communicator_exclusive_or(self, word) result(combined)
    class(communicator_t), intent(in) :: self
    integer(i8), intent(in) :: word
    call MPI_Allreduce(word, combined, 1, MPI_INTEGER8, MPI_BXOR, self%mpi)
  end function communicator_exclusive_or

  !> The bits that words have on some rank, word by word, in place. Collective.
  subroutine communicator_union_of(self, words)
    class(communicator_t), intent(in) :: self
    integer(i8), intent(inout), contiguous :: words(:)
    integer(i8) :: own(size(words))

    own(:) = words
    call MPI_Allreduce(own, words, size(words), MPI_INTEGER8, MPI_BOR, self%mpi)
  end subroutine communicator_union_of

  logical function communicator_any_true(self, flag) result(any_true)
    class(communicator_t), intent(in) :: self
    logical, intent(in) :: flag
    call MPI_Allreduce(flag, any_true, 1, MPI_LOGICAL, MPI_LOR, self%mpi)
  end function communicator_any_true

  !> Exact sums over all subdomains of all ranks.
  subroutine communicator_sum_parts(self, parts, sums)
    class(communicator_t), intent(in) :: self
    !> (number of sums, number of subdomains of this rank): the terms
    real(dp), intent(in), contiguous :: parts(:, :)
    !> (number of sums)
    real(dp), intent(out), contiguous :: sums(:)
    integer(i8), allocatable :: words(:, :), total(:, :)
    integer :: i, s

    if (self%size == 1 .and. size(parts, 2) == 1) then
      ! one term is its own sum
      do i = 1, size(sums)
        sums(i) = parts(i, 1)
        if (.not. ieee_is_finite(sums(i))) sums(i) = ieee_value(sums(i), ieee_quiet_nan)
      end do
      return
    end if
    allocate (words(exact_sum_words, size(sums)), source=0_i8)
    allocate (total(exact_sum_words, size(sums)))
    do s = 1, size(parts, 2)
      do i = 1, size(sums)
        call exact_add(words(:, i), parts(i, s))
      end do
    end do
    call MPI_Allreduce(words, total, size(words), MPI_INTEGER8, MPI_SUM, self%mpi)
    do i = 1, size(sums)
      sums(i) = exact_value(total(:, i))
    end do
  end subroutine communicator_sum_parts

  !> Exact sum of one number per subdomain.
  real(dp) function communicator_sum_real(self, part) result(total)
    class(communicator_t), intent(in) :: self
    !> (number of subdomains of this rank)
    real(dp), intent(in), contiguous :: part(:)
    real(dp) :: parts(1, size(part)), sums(1)
    parts(1, :) = part
    call self%sum_parts(parts, sums)
    total = sums(1)
  end function communicator_sum_real

  !> Element by element sum of counts over the ranks, in place.
  subroutine communicator_sum_counts(self, counts)
    class(communicator_t), intent(in) :: self
    integer(i8), intent(inout), contiguous :: counts(:)
    integer(i8), allocatable :: total(:)
    allocate (total(size(counts)))
    call MPI_Allreduce(counts, total, size(counts), MPI_INTEGER8, MPI_SUM, self%mpi)
    counts(:) = total
  end subroutine communicator_sum_counts

  !> Give every rank the text held by `root`.
  subroutine communicator_broadcast_text(self, text, root)
    class(communicator_t), intent(in) :: self
    character(len=:), allocatable, intent(inout) :: text
    integer, intent(in) :: root
    integer :: length

    length = 0
    if (self%rank == root .and. allocated(text)) length = len(text)
    call MPI_Bcast(length, 1, MPI_INTEGER, root, self%mpi)
    if (self%rank /= root) then
      if (allocated(text)) deallocate (text)
      allocate (character(len=length) :: text)
    end if
    if (length > 0) call MPI_Bcast(text, length, MPI_CHARACTER, root, self%mpi)
  end subroutine communicator_broadcast_text

  !> Make one error known to all: every rank leaves with that of the lowest rank that has one. Collective.
  subroutine communicator_agree(self, error)
    class(communicator_t), intent(in) :: self
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: message
    integer :: mine, first, status

    mine = merge(self%rank, self%size, allocated(error))
    call MPI_Allreduce(mine, first, 1, MPI_INTEGER, MPI_MIN, self%mpi)
    if (first == self%size) return
    if (self%rank == first) then
      status = error%status
      message = error%message
    end if
    call MPI_Bcast(status, 1, MPI_INTEGER, first, self%mpi)
    call self%broadcast_text(message, first)
    if (.not. allocated(error)) allocate (error)
    error%status = status
    error%message = message
  end subroutine communicator_agree

  !> How many ranks share the memory of this machine. Collective.
  integer function communicator_ranks_here(self) result(n)
    class(communicator_t), intent(in) :: self
    type(MPI_Comm) :: here

    call MPI_Comm_split_type(self%mpi, MPI_COMM_TYPE_SHARED, self%rank, MPI_INFO_NULL, here)
    call MPI_Comm_size(here, n)
    call MPI_Comm_free(here)
  end function communicator_ranks_here

  !> Rank that owns a subdomain: each rank owns a block of consecutive ones.
  pure integer function communicator_rank_of(self, subdomain, n_subdomains) result(rank)
    class(communicator_t), intent(in) :: self
    !> from 1
    integer, intent(in) :: subdomain
    !> of the whole scene
    integer, intent(in) :: n_subdomains
    rank = narrow((int(subdomain, i8)*self%size - 1)/n_subdomains)
  end function communicator_rank_of

  !> First subdomain of `rank`; its last is the first of the next rank less one.
  pure integer function communicator_first_subdomain(self, rank, n_subdomains) result(first)
    class(communicator_t), intent(in) :: self
    integer, intent(in) :: rank, n_subdomains
    first = narrow(int(n_subdomains, i8)*rank/self%size) + 1
  end function communicator_first_subdomain

end module gravier_communicator
