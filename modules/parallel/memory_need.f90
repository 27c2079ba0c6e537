!> Memory that is asked for before it is allocated.
module gravier_memory_need
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_failure
  use gravier_room, only: free_memory, process_limit, bytes_text
  use gravier_communicator, only: communicator_t
  implicit none
  private
  public :: check_memory

contains

  !> Refuse what cannot have the memory it needs: that of its machine is not free, or a rank may not have so much (status_failure).
  !> Errors are the same on all ranks. Collective.
  subroutine check_memory(comm, what, number, bytes_each, error)
    type(communicator_t), intent(in) :: comm
    !> the items that want it, for the message: file, key, number
    character(len=*), intent(in) :: what
    !> of the items of all ranks, spread evenly, and the least that each takes
    real(dp), intent(in) :: number
    integer, intent(in) :: bytes_each
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: need
    integer(i8) :: free, limit
    integer :: neighbours

    neighbours = comm%ranks_here()
    if (.not. allocated(error)) then
      need = number*bytes_each/comm%size
      free = free_memory()
      limit = process_limit()
      if (free > 0 .and. need*neighbours > real(free, dp)) then
        call refuse(need*neighbours, "on this machine, where "//bytes_text(real(free, dp))//" are free")
      else if (need > real(limit, dp)) then
        call refuse(need, "on a rank, which may still have "//bytes_text(real(limit, dp))//" (ulimit -v)")
      end if
    end if
    call comm%agree(error)

  contains

    subroutine refuse(bytes, place)
      real(dp), intent(in) :: bytes
      character(len=*), intent(in) :: place

      call raise(error, status_failure, what//": at least "//bytes_text(bytes)//" of memory are needed "//place)
    end subroutine refuse

  end subroutine check_memory

end module gravier_memory_need
