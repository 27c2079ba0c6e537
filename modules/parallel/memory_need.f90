!> Memory that is asked for before it is allocated, and the end of a program to which the system gives none.
module gravier_memory_need
  use, intrinsic :: iso_c_binding, only: c_int
  use, intrinsic :: iso_fortran_env, only: error_unit
  use mpi_f08, only: MPI_COMM_WORLD, MPI_Abort, MPI_Comm_size, MPI_Finalized, MPI_Initialized
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_failure
  use gravier_room, only: free_memory, process_limit, bytes_text
  use gravier_communicator, only: communicator_t
  implicit none
  private
  public :: check_memory

  interface
    subroutine c_exit_now(status) bind(C, name="_exit")
      import :: c_int
      implicit none
      integer(c_int), value :: status
    end subroutine c_exit_now
  end interface

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

  !> What compiled code calls, in the place of the procedure of GNU Fortran's library, where an allocation without stat= fails: one
  !> line and status_failure, instead of a backtrace and 1. Of other compilers nothing calls it.
  subroutine allocation_failed(place, text, bytes) bind(C, name="_gfortran_os_error_at")
    use, intrinsic :: iso_c_binding, only: c_associated, c_ptr, c_size_t
    !> texts of the library, of no use to a reader
    type(c_ptr), value :: place, text
    integer(c_size_t), value :: bytes

    ! they are there in any case
    if (c_associated(place) .or. c_associated(text)) continue
    call end_without_memory(bytes_text(real(bytes, dp))//" ")
  end subroutine allocation_failed

  !> The same for temporaries.
  subroutine temporary_failed(text) bind(C, name="_gfortran_os_error")
    use, intrinsic :: iso_c_binding, only: c_associated, c_ptr
    type(c_ptr), value :: text

    if (c_associated(text)) continue
    call end_without_memory("")
  end subroutine temporary_failed

  !> End all ranks: one of them cannot go on.
  subroutine end_without_memory(amount)
    character(len=*), intent(in) :: amount
    character(len=200) :: program_name
    integer :: n_ranks
    logical :: started, ended

    call get_command_argument(0, program_name)
    write (error_unit, "(a)") trim(program_name(index(program_name, "/", back=.true.) + 1:))//": error: out of memory: "//amount// &
      & "cannot be had; more ranks on more machines share a scene out"
    flush (error_unit)
    n_ranks = 1
    call MPI_Initialized(started)
    call MPI_Finalized(ended)
    if (started .and. .not. ended) call MPI_Comm_size(MPI_COMM_WORLD, n_ranks)
    if (n_ranks > 1) call MPI_Abort(MPI_COMM_WORLD, status_failure)
    call c_exit_now(int(status_failure, c_int))
  end subroutine end_without_memory

end module gravier_memory_need
