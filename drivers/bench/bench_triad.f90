!> Bandwidth of memory by the triad a = b + s c.
module gravier_bench_triad
  use mpi_f08, only: MPI_Wtime
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_machine, only: last_cache
  use gravier_room, only: free_memory
  implicit none
  private
  public :: triad_t, triad_bytes

  !> counted an element: two numbers read, one written. Where the line to be written is read first (write-allocate), memory
  !> moves 32
  integer, parameter :: triad_bytes = 24

  type :: triad_t
    real(dp), allocatable, private :: a(:), b(:), c(:)
  contains
    procedure :: init => triad_init
    procedure :: elements => triad_elements
    procedure :: run => triad_run
    procedure, private :: once => triad_once
  end type triad_t

  !> taken to be free where the system does not tell
  integer(i8), parameter :: usual_memory = 4294967296_i8

contains

  !> Three arrays of `n` numbers; with n = 0 as many as fill the last cache four times, or a quarter of the free memory of each
  !> of the ranks where that is less.
  subroutine triad_init(self, n, ranks)
    class(triad_t), intent(inout) :: self
    integer, intent(in) :: n, ranks
    integer(i8) :: bytes
    integer :: length

    length = n
    if (n == 0) then
      bytes = free_memory()
      if (bytes == 0) bytes = usual_memory
      bytes = min(4*last_cache(), bytes/(4*ranks))
      length = narrow(min(bytes/triad_bytes, int(huge(0), i8)))
    end if
    allocate (self%a(length), self%b(length), self%c(length))
    self%a(:) = 0.0_dp
    self%b(:) = 1.0_dp
    self%c(:) = 2.0_dp
  end subroutine triad_init

  pure integer function triad_elements(self) result(n)
    class(triad_t), intent(in) :: self
    n = size(self%a)
  end function triad_elements

  !> Bytes a second over at least so many seconds, of this rank.
  real(dp) function triad_run(self, seconds) result(rate)
    class(triad_t), intent(inout) :: self
    !> [s]
    real(dp), intent(in) :: seconds
    real(dp) :: start, now
    integer :: n

    n = 0
    start = MPI_Wtime()
    do
      call self%once(0.5_dp)
      n = n + 1
      now = MPI_Wtime()
      if (now - start >= seconds .and. now > start) exit
    end do
    rate = real(triad_bytes, dp)*size(self%a)*n/(now - start)
  end function triad_run

  subroutine triad_once(self, factor)
    class(triad_t), intent(inout) :: self
    real(dp), intent(in) :: factor
    integer :: k

    do k = 1, size(self%a)
      self%a(k) = self%b(k) + factor*self%c(k)
    end do
  end subroutine triad_once

end module gravier_bench_triad
