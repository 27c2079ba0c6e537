!> The files of this process: each is written aside, under its name with ".part" behind, and takes its name when it is whole. The
!> process remembers which files it has named or gone on with, so that it can tell at its end whether they are still those under
!> their names. Not collective: the rank that writes calls.
module gravier_own_files
  use gravier_errors, only: error_t, raise, status_failure
  use gravier_file_system, only: place_t, place_of, replace_file, remove_file
  implicit none
  private
  public :: part_of, give_name, note_own, remove_own, check_own_files, forget_own_files

  type :: own_file_t
    character(len=:), allocatable :: path
    type(place_t) :: place
  end type own_file_t

  !> those of this process
  type(own_file_t), allocatable :: own(:)
  integer :: n_own = 0

contains

  !> Where a file is written until it is whole.
  pure function part_of(path) result(part)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: part
    part = path//".part"
  end function part_of

  !> Give the file that was written aside its name, in one indivisible operation and once it is on the disk; an older file of that
  !> name goes. Failure: status_failure, with the system's reason; what was written aside is removed, an older file stays.
  subroutine give_name(path, error)
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    call replace_file(part_of(path), path, error)
    if (allocated(error)) then
      call remove_file(part_of(path))
    else
      call note_own(path)
    end if
  end subroutine give_name

  !> Remember the file that a name leads to now as one of this process.
  subroutine note_own(path)
    character(len=*), intent(in) :: path
    type(own_file_t), allocatable :: longer(:)
    integer :: k

    if (.not. allocated(own)) allocate (own(16))
    do k = 1, n_own
      if (own(k)%path == path) exit
    end do
    if (k > size(own)) then
      allocate (longer(2*size(own)))
      longer(1:n_own) = own
      call move_alloc(longer, own)
    end if
    n_own = max(n_own, k)
    own(k)%path = path
    own(k)%place = place_of(path)
  end subroutine note_own

  !> Remove a file of this process, if it is there, and forget it.
  subroutine remove_own(path)
    character(len=*), intent(in) :: path
    integer :: k

    call remove_file(path)
    do k = 1, n_own
      if (own(k)%path /= path) cycle
      own(k) = own(n_own)
      n_own = n_own - 1
      exit
    end do
  end subroutine remove_own

  !> Check that the files of this process are still those under their names. Failure (status_failure): another one is, or none.
  subroutine check_own_files(error)
    type(error_t), allocatable, intent(inout) :: error
    type(place_t) :: now
    integer :: k

    do k = 1, n_own
      now = place_of(own(k)%path)
      if (now%is_there() .and. now == own(k)%place) cycle
      call raise(error, status_failure, own(k)%path// &
        & ": the file that was written under this name is not there any more: it was removed, or another program has replaced it")
    end do
  end subroutine check_own_files

  !> Forget the files of a run that is over: another one may follow in this process.
  subroutine forget_own_files()
    n_own = 0
  end subroutine forget_own_files

end module gravier_own_files
