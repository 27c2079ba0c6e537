!> The end of a program to which the system gives no memory: one line and status_failure on all ranks. The linker gives the calls of
!> malloc and realloc in the program's own code to the two procedures here (ld --wrap), also those that compilers make for
!> allocate, assignments and temporaries, of which some are not checked. What must fail softly asks room_for first. What libraries
!> allocate is theirs.
module gravier_own_allocations
  use, intrinsic :: iso_c_binding, only: c_associated, c_ptr, c_size_t
  use, intrinsic :: iso_fortran_env, only: error_unit
  use mpi_f08, only: MPI_COMM_WORLD, MPI_Abort, MPI_Comm_size, MPI_Finalized, MPI_Initialized
  use gravier_kinds, only: dp
  use gravier_errors, only: status_failure
  use gravier_process, only: end_at_once
  use gravier_room, only: bytes_text
  implicit none
  private
  public :: own_malloc, own_realloc

  interface
    type(c_ptr) function real_malloc(bytes) bind(C, name="__real_malloc")
      import :: c_ptr, c_size_t
      implicit none
      integer(c_size_t), value :: bytes
    end function real_malloc

    type(c_ptr) function real_realloc(address, bytes) bind(C, name="__real_realloc")
      import :: c_ptr, c_size_t
      implicit none
      type(c_ptr), value :: address
      integer(c_size_t), value :: bytes
    end function real_realloc
  end interface

  !> the program is ending: its last line may want memory, too
  logical :: is_ending = .false.

contains

  recursive type(c_ptr) function own_malloc(bytes) result(address) bind(C, name="__wrap_malloc")
    integer(c_size_t), value :: bytes

    address = real_malloc(bytes)
    if (bytes /= 0 .and. .not. c_associated(address)) call end_without_memory(bytes)
  end function own_malloc

  recursive type(c_ptr) function own_realloc(old, bytes) result(address) bind(C, name="__wrap_realloc")
    type(c_ptr), value :: old
    integer(c_size_t), value :: bytes

    address = real_realloc(old, bytes)
    if (bytes /= 0 .and. .not. c_associated(address)) call end_without_memory(bytes)
  end function own_realloc

  !> End all ranks: one of them cannot go on.
  recursive subroutine end_without_memory(bytes)
    integer(c_size_t), intent(in) :: bytes
    character(len=200) :: program_name
    real(dp) :: amount
    integer :: n_ranks
    logical :: started, ended

    if (is_ending) call end_at_once(status_failure)
    is_ending = .true.
    ! C counts without a sign
    amount = real(bytes, dp)
    if (bytes < 0) amount = amount + 2.0_dp**bit_size(bytes)
    call get_command_argument(0, program_name)
    write (error_unit, "(a)") trim(program_name(index(program_name, "/", back=.true.) + 1:))//": error: out of memory: "// &
      & bytes_text(amount)//" could not be allocated; use more ranks on more machines"
    flush (error_unit)
    n_ranks = 1
    call MPI_Initialized(started)
    call MPI_Finalized(ended)
    if (started .and. .not. ended) call MPI_Comm_size(MPI_COMM_WORLD, n_ranks)
    if (n_ranks > 1) call MPI_Abort(MPI_COMM_WORLD, status_failure)
    call end_at_once(status_failure)
  end subroutine end_without_memory

end module gravier_own_allocations
