!> Contacts with forces in bodies files: a round trip on any number of ranks gives the same file, and its checks.
program test_io_bodies_contacts
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, status_input
  use gravier_text, only: to_text
  use gravier_random_hash, only: hash_uniform
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_hdf5_file, only: h5_file_t
  use gravier_given_contacts, only: given_contacts_t, check_given, check_known_bodies, check_pulls, find_ranks
  use gravier_bodies_contacts, only: read_contacts, write_contacts, contact_words
  use gravier_check, only: check, check_equal, finish_checks
  implicit none
  !> bodies 1 to n in a row and a ground; body k touches the next one in one point or two, and the ground
  integer, parameter :: n_bodies = 23
  type(communicator_t) :: comm
  character(len=:), allocatable :: path
  character(len=1000) :: directory
  integer :: stat

  call start_parallel()
  call comm%init()
  call get_environment_variable("GRAVIER_TEST_DIR", directory, status=stat)
  if (stat /= 0) directory = "."
  path = trim(directory)//"/io_bodies_contacts_"//to_text(comm%size)//".h5"
  call test_round_trip(2, .true., .true.)
  call test_round_trip(3, .true., .false.)
  call test_round_trip(3, .false., .true.)
  call test_round_trip(3, .false., .false.)
  call test_checks()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> Number of a contact by its bodies and its place among those of its pair, from which all of its numbers are drawn.
  pure integer(i8) function number_of(candidate, antagonist, place) result(number)
    integer(i8), intent(in) :: candidate, antagonist
    integer, intent(in) :: place

    number = 1000*candidate + 10*antagonist + place
  end function number_of

  !> Each rank makes those of some bodies, the last ones first.
  subroutine make(nd, with_moment, with_elongation, contacts)
    integer, intent(in) :: nd
    logical, intent(in) :: with_moment, with_elongation
    type(given_contacts_t), intent(out) :: contacts
    !> candidate, antagonist, place among those of the pair
    integer(i8) :: a, row(3, 3*n_bodies)
    integer :: n, k, d

    n = 0
    do k = n_bodies, 1, -1
      if (mod(k, comm%size) /= comm%rank) cycle
      row(1, n + 1:n + 3) = k
      row(2, n + 1) = -1 - mod(k, 2)
      row(2, n + 2:n + 3) = k + 1
      row(3, n + 1:n + 2) = 1
      row(3, n + 3) = 2
      n = n + merge(1, merge(3, 2, mod(k, 3) == 0), k == n_bodies)
    end do
    contacts%n = n
    contacts%total = comm%total(int(n, i8))
    contacts%candidate = row(1, 1:n)
    contacts%antagonist = row(2, 1:n)
    allocate (contacts%boundary(2))
    contacts%boundary(1) = "ground, of stone"
    contacts%boundary(2) = "wall"
    allocate (contacts%normal(nd, n), contacts%force(nd, n), contacts%point(nd, n))
    if (with_moment) allocate (contacts%moment(2*nd - 3, n))
    if (with_elongation) allocate (contacts%elongation(nd, n))
    do k = 1, n
      a = number_of(row(1, k), row(2, k), int(row(3, k)))
      do d = 1, nd
        contacts%normal(d, k) = 0.1_dp + hash_uniform(1, a, d)
        contacts%force(d, k) = hash_uniform(2, a, d)
        contacts%point(d, k) = hash_uniform(3, a, d)
      end do
      contacts%normal(:, k) = contacts%normal(:, k)/norm2(contacts%normal(:, k))
      do d = 1, merge(2*nd - 3, 0, with_moment)
        contacts%moment(d, k) = hash_uniform(4, a, d)
      end do
      do d = 1, merge(nd, 0, with_elongation)
        contacts%elongation(d, k) = hash_uniform(5, a, d)
      end do
    end do
  end subroutine make

  !> What is read are the same contacts in the order of candidate, antagonist and place, in blocks by rank. A normal that was a unit
  !> vector is one to two roundings.
  subroutine test_round_trip(nd, with_moment, with_elongation)
    integer, intent(in) :: nd
    logical, intent(in) :: with_moment, with_elongation
    type(given_contacts_t) :: contacts, back
    type(h5_file_t) :: file
    type(error_t), allocatable :: error
    integer(i8) :: a, last(2)
    integer :: k, d, place
    logical :: same, sorted

    call make(nd, with_moment, with_elongation, contacts)
    call file%create(comm, path, error)
    call file%reserve(65536_i8 + 8*contacts%total*contact_words(nd), error)
    call write_contacts(comm, file, contacts, error)
    call file%close(error)
    call check(.not. allocated(error), "written")
    call file%open(comm, path, error)
    call read_contacts(comm, file, path, nd, back, error)
    call check(.not. allocated(error), "read")
    call file%close(error)
    call check_equal(back%total, contacts%total, "contacts")
    call check_equal(comm%total(int(back%n, i8)), contacts%total, "contacts of all ranks")
    call check_equal(back%first, comm%offset(int(back%n, i8)), "first row of a rank")
    call check_equal(size(back%boundary), 2, "names")
    call check(all(back%boundary == contacts%boundary), "names of boundaries")
    call check(allocated(back%point), "places")
    call check(allocated(back%moment) .eqv. with_moment, "moments")
    call check(allocated(back%elongation) .eqv. with_elongation, "elongations")
    same = .true.
    sorted = .true.
    last(:) = 0
    place = 1
    do k = 1, back%n
      place = merge(place + 1, 1, back%candidate(k) == last(1) .and. back%antagonist(k) == last(2))
      if (back%candidate(k) == last(1)) sorted = sorted .and. back%antagonist(k) >= last(2)
      sorted = sorted .and. back%candidate(k) >= last(1)
      last(1) = back%candidate(k)
      last(2) = back%antagonist(k)
      ! a block may begin with the second point of a pair
      if (k == 1 .and. mod(last(1), 3_i8) == 0) cycle
      a = number_of(last(1), last(2), place)
      do d = 1, nd
        same = same .and. abs(back%force(d, k) - hash_uniform(2, a, d)) <= 0.0_dp
        same = same .and. abs(back%point(d, k) - hash_uniform(3, a, d)) <= 0.0_dp
        if (with_elongation) same = same .and. abs(back%elongation(d, k) - hash_uniform(5, a, d)) <= 0.0_dp
        if (with_moment .and. d <= 2*nd - 3) same = same .and. abs(back%moment(d, k) - hash_uniform(4, a, d)) <= 0.0_dp
      end do
      same = same .and. abs(norm2(back%normal(:, k)) - 1.0_dp) <= 2*epsilon(1.0_dp)
    end do
    call check(same, "numbers of the contacts")
    call check(sorted, "in the order of candidates and antagonists")
  end subroutine test_round_trip

  subroutine test_checks()
    type(given_contacts_t) :: contacts
    type(error_t), allocatable :: error
    integer(i8), allocatable :: id(:), ids(:, :)
    integer, allocatable :: rank(:)
    integer :: k

    allocate (ids(1, (n_bodies - 1 - comm%rank)/comm%size + 1))
    do k = 1, size(ids, 2)
      ids(1, k) = comm%rank + 1 + (k - 1)*comm%size
    end do
    id = ids(1, :)
    call make(2, .false., .false., contacts)
    contacts%path = "file"
    call find_ranks(comm, ids, rank)
    call check(all(rank >= 0 .and. rank < comm%size), "ranks that know of bodies")
    call check_known_bodies(comm, id, contacts, error)
    call check_given(comm, contacts, error)
    call check(.not. allocated(error), "good contacts pass")
    call check_pulls(comm, contacts, error)
    call check(.not. allocated(error), "forces that press pass")
    contacts%normal(:, :) = -contacts%normal
    call check_pulls(comm, contacts, error)
    call expect("/contacts/force: row 0", error)
    where (contacts%candidate == 4) contacts%candidate = n_bodies + 3
    call check_known_bodies(comm, id, contacts, error)
    call expect("body 26", error)
    deallocate (contacts%boundary)
    allocate (contacts%boundary(1))
    contacts%boundary(1) = "ground"
    call check_given(comm, contacts, error)
    call expect("/contacts/antagonist", error)
  end subroutine test_checks

  !> An error, the same on all ranks; it is taken away.
  subroutine expect(part, error)
    character(len=*), intent(in) :: part
    type(error_t), allocatable, intent(inout) :: error

    call check(allocated(error), part//": an error")
    if (.not. allocated(error)) return
    call check_equal(error%status, status_input, part//": status")
    call check(index(error%message, "file: "//"/contacts") == 1 .and. index(error%message, part) > 0, part//" in: "//error%message)
    deallocate (error)
  end subroutine expect

end program test_io_bodies_contacts
