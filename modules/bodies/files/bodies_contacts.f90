!> Contacts of a bodies file in HDF5: /contacts/{candidate, antagonist, boundaries, normal, force, point, moment, elongation}.
!> `antagonist` is the identifier of a body or, -k, the k-th of the names that `boundaries` lists, one a line.
module gravier_bodies_contacts
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_room, only: room_for
  use gravier_communicator, only: communicator_t
  use gravier_hdf5_file, only: h5_file_t
  use gravier_ordered_rows, only: order_rows, pack_reals, unpack_reals
  use gravier_given_contacts, only: given_contacts_t, name_length, check_given
  implicit none
  private
  public :: contact_sets, read_contacts, write_contacts, contact_words

  character(len=*), parameter :: contact_sets(8) = [character(len=10) :: "candidate", "antagonist", "boundaries", "normal", &
    & "force", "point", "moment", "elongation"]
  character(len=*), parameter :: newline = new_line("a")

contains

  !> Words of a contact in a file, at most.
  pure integer function contact_words(dimension) result(words)
    integer, intent(in) :: dimension
    words = 2 + 4*dimension + (2*dimension - 3)
  end function contact_words

  !> Read the rows of this rank, and check them. Failure: status_input, with file, dataset, row, and what was expected. Collective.
  subroutine read_contacts(comm, file, path, dimension, contacts, error)
    type(communicator_t), intent(in) :: comm
    !> with a group /contacts of known members
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: path
    !> 2 or 3
    integer, intent(in) :: dimension
    type(given_contacts_t), intent(out) :: contacts
    type(error_t), allocatable, intent(inout) :: error

    contacts%path = path
    call find_lengths(file, path, contacts%total, error)
    call take_block(comm, path, dimension, contacts, error)
    call read_names(file, path, contacts, error)
    if (allocated(error)) return
    call file%read_rows("/contacts/candidate", contacts%first, contacts%candidate, error)
    call file%read_rows("/contacts/antagonist", contacts%first, contacts%antagonist, error)
    call file%read_rows("/contacts/normal", contacts%first, contacts%normal, error)
    call file%read_rows("/contacts/force", contacts%first, contacts%force, error)
    if (file%exists("/contacts/point")) then
      allocate (contacts%point(dimension, contacts%n), source=0.0_dp)
      call file%read_rows("/contacts/point", contacts%first, contacts%point, error)
    end if
    if (file%exists("/contacts/moment")) then
      allocate (contacts%moment(2*dimension - 3, contacts%n), source=0.0_dp)
      call file%read_rows("/contacts/moment", contacts%first, contacts%moment, error)
    end if
    if (file%exists("/contacts/elongation")) then
      allocate (contacts%elongation(dimension, contacts%n), source=0.0_dp)
      call file%read_rows("/contacts/elongation", contacts%first, contacts%elongation, error)
    end if
    call check_given(comm, contacts, error)
  end subroutine read_contacts

  !> Rows of the datasets, which must be equal.
  subroutine find_lengths(file, path, total, error)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: path
    integer(i8), intent(out) :: total
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: rows
    integer :: k

    total = 0
    do k = 1, size(contact_sets)
      if (contact_sets(k) == "boundaries") cycle
      associate (name => "/contacts/"//trim(contact_sets(k)))
        if (any(contact_sets(k) == [character(len=10) :: "point", "moment", "elongation"])) then
          if (.not. file%exists(name)) cycle
        end if
        call file%row_count(name, rows, error)
        if (allocated(error)) return
        if (k == 1) total = rows
        if (rows == total) cycle
        call raise(error, status_input, path//": "//name//": "//to_text(rows)//" rows, but /contacts/candidate has "// &
          & to_text(total))
      end associate
      return
    end do
  end subroutine find_lengths

  !> The block of rows of this rank, and room for it.
  subroutine take_block(comm, path, dimension, contacts, error)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    integer, intent(in) :: dimension
    type(given_contacts_t), intent(inout) :: contacts
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: each, rest, next

    if (allocated(error)) return
    each = contacts%total/comm%size
    rest = mod(contacts%total, int(comm%size, i8))
    contacts%first = each*comm%rank + rest*comm%rank/comm%size
    next = each*(comm%rank + 1) + rest*(comm%rank + 1)/comm%size
    contacts%n = narrow(room_for(next - contacts%first, 8*contact_words(dimension), path//": /contacts", error))
    allocate (contacts%candidate(contacts%n), contacts%antagonist(contacts%n), source=0_i8)
    allocate (contacts%normal(dimension, contacts%n), contacts%force(dimension, contacts%n), source=0.0_dp)
    call comm%agree(error)
  end subroutine take_block

  subroutine read_names(file, path, contacts, error)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: path
    type(given_contacts_t), intent(inout) :: contacts
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: text
    integer :: at, length, n

    allocate (contacts%boundary(0))
    if (allocated(error)) return
    if (.not. file%exists("/contacts/boundaries")) return
    call file%read_long_text("/contacts/boundaries", text, error)
    if (allocated(error)) return
    deallocate (contacts%boundary)
    n = 1
    do at = 1, len(text)
      if (text(at:at) == newline) n = n + 1
    end do
    allocate (contacts%boundary(n))
    at = 1
    do n = 1, size(contacts%boundary)
      length = index(text(at:)//newline, newline) - 1
      if (length > name_length) then
        call raise(error, status_input, path//": /contacts/boundaries: name "//to_text(n)//": "//to_text(length)// &
          & " letters, but at most "//to_text(name_length)//" were expected")
        return
      end if
      contacts%boundary(n) = text(at:at + length - 1)
      at = at + length + 1
    end do
  end subroutine read_names

  !> Write the contacts of all ranks in the order of candidate and antagonist; those of one pair, which one rank holds, stay in
  !> theirs. Collective.
  subroutine write_contacts(comm, file, contacts, error)
    type(communicator_t), intent(in) :: comm
    type(h5_file_t), intent(inout) :: file
    !> with points; names of the boundaries are the same on all ranks
    type(given_contacts_t), intent(in) :: contacts
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), allocatable :: records(:, :), ordered(:, :)
    integer(i8), allocatable :: id(:)
    real(dp), allocatable :: vectors(:, :)
    integer :: k, nd, nm, ne

    if (allocated(error)) return
    nd = size(contacts%normal, 1)
    nm = 0
    if (allocated(contacts%moment)) nm = size(contacts%moment, 1)
    ne = 0
    if (allocated(contacts%elongation)) ne = nd
    allocate (records(3 + 3*nd + nm + ne, contacts%n))
    do k = 1, contacts%n
      records(1, k) = contacts%candidate(k)
      records(2, k) = contacts%antagonist(k)
      records(3, k) = k
    end do
    call pack_reals(nd, contacts%normal, 4, records)
    call pack_reals(nd, contacts%force, 4 + nd, records)
    call pack_reals(nd, contacts%point, 4 + 2*nd, records)
    if (nm > 0) call pack_reals(nm, contacts%moment, 4 + 3*nd, records)
    if (ne > 0) call pack_reals(ne, contacts%elongation, 4 + 3*nd + nm, records)
    call order_rows(comm, 3, records, ordered)
    call file%make_group("/contacts", error)
    id = ordered(1, :)
    call file%write_rows("/contacts/candidate", id, error)
    id = ordered(2, :)
    call file%write_rows("/contacts/antagonist", id, error)
    if (comm%any_true(any(id < 0))) call write_names(comm, file, contacts%boundary, error)
    call unpack_reals(ordered, 4, nd, vectors)
    call file%write_rows("/contacts/normal", vectors, error)
    call unpack_reals(ordered, 4 + nd, nd, vectors)
    call file%write_rows("/contacts/force", vectors, error)
    call file%write_attribute("/contacts/force", "unit", "N", error)
    call unpack_reals(ordered, 4 + 2*nd, nd, vectors)
    call file%write_rows("/contacts/point", vectors, error)
    call file%write_attribute("/contacts/point", "unit", "m", error)
    if (nm > 0) then
      call unpack_reals(ordered, 4 + 3*nd, nm, vectors)
      call file%write_rows("/contacts/moment", vectors, error)
      call file%write_attribute("/contacts/moment", "unit", "N m", error)
    end if
    if (ne > 0) then
      call unpack_reals(ordered, 4 + 3*nd + nm, ne, vectors)
      call file%write_rows("/contacts/elongation", vectors, error)
      call file%write_attribute("/contacts/elongation", "unit", "m", error)
    end if
  end subroutine write_contacts

  subroutine write_names(comm, file, names, error)
    type(communicator_t), intent(in) :: comm
    type(h5_file_t), intent(inout) :: file
    character(len=*), intent(in) :: names(:)
    type(error_t), allocatable, intent(inout) :: error
    character(len=sum(len_trim(names)) + size(names)) :: text(1)
    integer :: k, at

    text(1) = ""
    at = 1
    do k = 1, size(names)
      text(1) (at:) = trim(names(k))//newline
      at = at + len_trim(names(k)) + 1
    end do
    ! the last name ends the text
    text(1) (at - 1:) = ""
    call file%write_rows("/contacts/boundaries", text(1:merge(1, 0, comm%rank == 0)), error)
  end subroutine write_names

end module gravier_bodies_contacts
