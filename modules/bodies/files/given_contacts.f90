!> Contacts with forces that a bodies file gives, from which the first solve of a run starts, and their checks.
module gravier_given_contacts
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_finite, only: is_finite
  use gravier_magnitude, only: is_bounded, bounded_text
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_sparse_exchange, only: sparse_exchange
  use gravier_sorting, only: argsort, find_sorted
  implicit none
  private
  public :: given_contacts_t, name_length, check_given, check_known_bodies, check_pulls, check_points, find_ranks

  !> of the name of a boundary
  integer, parameter :: name_length = 64

  !> a force that pulls by less than this part of it is rounded
  real(dp), parameter :: rounded = 1.0e-6_dp

  !> Contacts of this rank, in the order of the file. They hold forces, and not impulses, so that they do not depend on the time
  !> step.
  type :: given_contacts_t
    !> of this rank, and of all ranks
    integer :: n = 0
    integer(i8) :: total = 0
    !> row of the first contact of this rank, from 0
    integer(i8) :: first = 0
    !> where they come from, for messages
    character(len=:), allocatable :: path
    !> (n): identifier of a body; identifier of another body, or -k for the k-th name in `boundary`
    integer(i8), allocatable :: candidate(:), antagonist(:)
    !> names of boundaries, the same on all ranks
    character(len=name_length), allocatable :: boundary(:)
    !> (dimension, n): unit vector from the antagonist to the candidate
    real(dp), allocatable :: normal(:, :)
    !> (dimension, n): on the candidate, along the axes of space [N]
    real(dp), allocatable :: force(:, :)
    !> (dimension, n): the place of the contact [m]; not allocated where the file has none
    real(dp), allocatable :: point(:, :)
    !> 2D (1, n), 3D (3, n): of rolling and pivoting resistance, on the candidate, along the axes of space [N m]; not allocated
    !> where the file has none
    real(dp), allocatable :: moment(:, :)
    !> (dimension, n): of the tangential spring, the way of the candidate against the antagonist along the axes of space [m]; not
    !> allocated where the file has none
    real(dp), allocatable :: elongation(:, :)
  contains
    procedure :: rename_boundary => given_contacts_rename_boundary
  end type given_contacts_t

contains

  !> Give a boundary another name, if contacts have it.
  subroutine given_contacts_rename_boundary(self, name, new)
    class(given_contacts_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    !> cut to the length of names
    character(len=*), intent(in) :: new
    integer :: k

    if (.not. allocated(self%boundary)) return
    do k = 1, size(self%boundary)
      if (self%boundary(k) == name) self%boundary(k) = new(:min(len(new), name_length))
    end do
  end subroutine given_contacts_rename_boundary

  !> Refuse identifiers and numbers that are none of a contact, and make normals unit vectors. Errors are the same on all ranks.
  !> Collective.
  subroutine check_given(comm, contacts, error)
    type(communicator_t), intent(in) :: comm
    type(given_contacts_t), intent(inout) :: contacts
    type(error_t), allocatable, intent(inout) :: error
    integer :: k

    if (.not. allocated(error)) then
      do k = 1, contacts%n
        call check_pair(contacts, k, error)
        call check_vector(contacts, "normal", contacts%normal(:, k), k, error)
        call check_vector(contacts, "force", contacts%force(:, k), k, error)
        if (allocated(contacts%point)) call check_vector(contacts, "point", contacts%point(:, k), k, error)
        if (allocated(contacts%moment)) call check_vector(contacts, "moment", contacts%moment(:, k), k, error)
        if (allocated(contacts%elongation)) call check_vector(contacts, "elongation", contacts%elongation(:, k), k, error)
        if (allocated(error)) exit
        if (.not. maxval(abs(contacts%normal(:, k))) > 0.0_dp) then
          call raise(error, status_input, row_text(contacts, "normal", k)//"zero, but a normal that is not zero was expected")
          exit
        end if
        contacts%normal(:, k) = contacts%normal(:, k)/maxval(abs(contacts%normal(:, k)))
        contacts%normal(:, k) = contacts%normal(:, k)/norm2(contacts%normal(:, k))
      end do
    end if
    call comm%agree(error)
  end subroutine check_given

  subroutine check_pair(contacts, k, error)
    type(given_contacts_t), intent(in) :: contacts
    integer, intent(in) :: k
    type(error_t), allocatable, intent(inout) :: error

    associate (candidate => contacts%candidate(k), antagonist => contacts%antagonist(k))
      if (candidate < 1) then
        call raise(error, status_input, row_text(contacts, "candidate", k)//to_text(candidate)// &
          & ", but the identifier of a body was expected")
      else if (antagonist == 0 .or. antagonist == candidate .or. antagonist < -size(contacts%boundary)) then
        call raise(error, status_input, row_text(contacts, "antagonist", k)//to_text(antagonist)// &
          & ", but the identifier of another body was expected, or -1 to -"//to_text(size(contacts%boundary))// &
          & " for a name in /contacts/boundaries")
      end if
    end associate
  end subroutine check_pair

  subroutine check_vector(contacts, name, vector, k, error)
    type(given_contacts_t), intent(in) :: contacts
    !> of the dataset
    character(len=*), intent(in) :: name
    real(dp), intent(in) :: vector(:)
    integer, intent(in) :: k
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    if (.not. all(is_finite(vector))) then
      call raise(error, status_input, row_text(contacts, name, k)//"NaN or infinity, but finite numbers were expected")
    else if (.not. all(is_bounded(vector))) then
      call raise(error, status_input, row_text(contacts, name, k)//to_text(maxval(abs(vector)))//" in size, but "//bounded_text// &
        & " was expected")
    end if
  end subroutine check_vector

  !> What a message about contact `k` of this rank begins with.
  pure function row_text(contacts, name, k) result(text)
    type(given_contacts_t), intent(in) :: contacts
    character(len=*), intent(in) :: name
    integer, intent(in) :: k
    character(len=:), allocatable :: text
    text = contacts%path//": /contacts/"//name//": row "//to_text(contacts%first + k - 1)//" (counted from 0): "
  end function row_text

  !> Refuse contacts of bodies that are not there; the first such row is named. Errors are the same on all ranks. Collective.
  subroutine check_known_bodies(comm, id, contacts, error)
    type(communicator_t), intent(in) :: comm
    !> of the bodies of this rank
    integer(i8), intent(in) :: id(:)
    type(given_contacts_t), intent(in) :: contacts
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), allocatable :: asked(:, :), known(:, :), received(:, :), sorted(:), keys(:)
    integer, allocatable :: order(:), rank(:)
    integer(i8) :: row, which
    integer :: k, n

    if (allocated(error)) return
    if (contacts%total == 0) return
    ! a rank by identifier is told of the bodies, and asked for those of contacts
    allocate (known(1, size(id)), source=0_i8)
    known(1, :) = id
    call find_ranks(comm, known, rank)
    call sparse_exchange(comm, known, rank, received)
    keys = received(1, :)
    allocate (order(size(keys)))
    call argsort(keys, order)
    sorted = keys(order)
    n = contacts%n + count(contacts%antagonist > 0)
    allocate (asked(2, n))
    n = 0
    do k = 1, contacts%n
      call ask(contacts%candidate(k))
      if (contacts%antagonist(k) > 0) call ask(contacts%antagonist(k))
    end do
    call find_ranks(comm, asked, rank)
    call sparse_exchange(comm, asked, rank, received)
    row = huge(row)
    which = 0
    do k = 1, size(received, 2)
      if (find_sorted(sorted, received(1, k)) > 0 .or. received(2, k) >= row) cycle
      row = received(2, k)
      which = received(1, k)
    end do
    call refuse_first()

  contains

    !> Ask for a body of contact `k`.
    subroutine ask(body)
      integer(i8), intent(in) :: body

      n = n + 1
      asked(1, n) = body
      asked(2, n) = contacts%first + k - 1
    end subroutine ask

    !> The error of the first row, whatever rank knows of it.
    subroutine refuse_first()
      integer(i8) :: first

      first = -comm%largest(-row)
      if (first == huge(first)) return
      if (row == first) call raise(error, status_input, contacts%path//": /contacts: row "//to_text(row)// &
        & " (counted from 0): body "//to_text(which)//": expected the identifier of a body in /bodies/id")
      call comm%agree(error)
    end subroutine refuse_first

  end subroutine check_known_bodies

  !> The rank that knows of an identifier, the first word of each record.
  pure subroutine find_ranks(comm, records, rank)
    type(communicator_t), intent(in) :: comm
    integer(i8), intent(in) :: records(:, :)
    integer, allocatable, intent(out) :: rank(:)
    integer :: k

    allocate (rank(size(records, 2)))
    do k = 1, size(rank)
      rank(k) = narrow(mod(records(1, k), int(comm%size, i8)))
    end do
  end subroutine find_ranks

  !> Refuse forces that pull, where no law of the scene attracts. Errors are the same on all ranks. Collective.
  subroutine check_pulls(comm, contacts, error)
    type(communicator_t), intent(in) :: comm
    type(given_contacts_t), intent(in) :: contacts
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: pressing
    integer :: k

    if (.not. allocated(error)) then
      do k = 1, contacts%n
        pressing = sum(contacts%force(:, k)*contacts%normal(:, k))
        if (pressing >= -rounded*norm2(contacts%force(:, k))) cycle
        call raise(error, status_input, row_text(contacts, "force", k)//"it pulls along the normal by "//to_text(-pressing, 4)// &
          & " N, but a force that presses was expected where no law attracts")
        exit
      end do
    end if
    call comm%agree(error)
  end subroutine check_pulls

  !> Refuse contacts without places, where two bodies may touch in several points. Errors are the same on all ranks.
  subroutine check_points(contacts, error)
    type(given_contacts_t), intent(in) :: contacts
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error) .or. contacts%total == 0 .or. allocated(contacts%point)) return
    call raise(error, status_input, contacts%path//": /contacts/point: missing; the places of the contacts were expected where "// &
      & "bodies have shapes or boundaries facets")
  end subroutine check_points

end module gravier_given_contacts
