!> The impulses that the first solve of a run starts from, where its bodies file gives forces of contacts. They enter the memory
!> that carries impulses from step to step, so that nothing else knows where they come from. The tangential springs of contacts that
!> yield have the elongations given, or else are stretched so far that they carry the tangential forces.
!>
!> A given contact belongs to the contact of the first step that has the same two bodies or the same body and boundary and a normal
!> within a right angle of its own; of several the nearest one. Rank `mod(candidate, ranks)` brings the two together: it is told of
!> the given contacts by the ranks that have read them, and of the pairs that touch by the ranks of their subdomains.
module gravier_given_impulses
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_sorting, only: argsort_rows, first_not_before
  use gravier_communicator, only: communicator_t
  use gravier_sparse_exchange, only: sparse_exchange
  use gravier_ordered_rows, only: pack_reals
  use gravier_given_contacts, only: given_contacts_t, find_ranks
  use gravier_boundary, only: boundary_t
  use gravier_contact_kernels, only: kernels_t, lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  use gravier_neighbour_list, only: neighbour_list_t
  use gravier_decomposition, only: decomposition_t
  use gravier_halo, only: local_bodies_t
  use gravier_physics, only: physics_t
  use gravier_contact_springs, only: stretch_spring, put_elongation
  use gravier_contact_places, only: find_contact_place
  implicit none
  private
  public :: take_given_impulses, started_t

  !> What a start from given contacts has come to, the same on all ranks.
  type :: started_t
    !> contacts given, and those of them that the first step has
    integer(i8) :: given = 0, matched = 0
    !> their part of the sum of the normal forces
    real(dp) :: share = 0.0_dp
  end type started_t

  !> words of a record before its numbers: candidate, antagonist, subdomain of its rank, row; numbers in space
  integer, parameter :: n_words = 4, n_numbers = 15
  !> in the place of an elongation that is not given [m]
  real(dp), parameter :: not_given = huge(1.0_dp)

contains

  !> Put impulses of given forces over a step into the memory of the pairs that touch, and stretch their springs. Collective.
  subroutine take_given_impulses(given, decomposition, physics, problem, views, started)
    type(given_contacts_t), intent(in) :: given
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics
    !> of the first step
    type(contact_problem_t), intent(inout) :: problem
    type(local_bodies_t), intent(inout) :: views(:)
    type(started_t), intent(out) :: started
    integer(i8), allocatable :: records(:, :), pairs(:, :), mine(:, :)
    real(dp), allocatable :: pressing(:)
    integer :: k

    call pack_given(given, decomposition%boundaries, records)
    call list_pairs(problem, views, pairs)
    call bring_together(decomposition%comm, records, pairs, mine)
    allocate (pressing(size(mine, 2)))
    call add_all(decomposition, physics, problem, pairs, mine, views, pressing)
    started%given = given%total
    started%matched = decomposition%comm%total(count(pressing >= 0.0_dp, kind=i8))
    if (started%matched == 0) return
    pressing(:) = max(pressing, 0.0_dp)
    started%share = decomposition%comm%sum_real(pressing)
    deallocate (pressing)
    allocate (pressing(given%n))
    do k = 1, given%n
      pressing(k) = abs(sum(given%force(:, k)*given%normal(:, k)))
    end do
    started%share = started%share/max(decomposition%comm%sum_real(pressing), tiny(physics%h))
  end subroutine take_given_impulses

  !> The given contacts of this rank as records: candidate, antagonist (minus the number of a boundary of the scene), 0, row,
  !> normal, force, point, moment and elongation. Of two bodies the candidate is that of the lower identifier. Boundaries that the
  !> scene does not have are left out.
  subroutine pack_given(given, boundaries, records)
    type(given_contacts_t), intent(in) :: given
    type(boundary_t), intent(in) :: boundaries(:)
    integer(i8), allocatable, intent(out) :: records(:, :)
    integer(i8), allocatable :: packed(:, :)
    real(dp) :: numbers(n_numbers, 1)
    integer :: number_of(size(given%boundary)), b, k, n, nd
    logical :: turned

    number_of(:) = 0
    do k = 1, size(given%boundary)
      do b = 1, size(boundaries)
        if (boundaries(b)%name == given%boundary(k)) number_of(k) = b
      end do
    end do
    allocate (packed(n_words + n_numbers, given%n), source=0_i8)
    n = 0
    do k = 1, given%n
      associate (candidate => given%candidate(k), antagonist => given%antagonist(k))
        turned = antagonist > 0 .and. antagonist < candidate
        if (antagonist > 0) then
          packed(1, n + 1) = min(candidate, antagonist)
          packed(2, n + 1) = max(candidate, antagonist)
        else if (number_of(narrow(-antagonist)) == 0) then
          cycle
        else
          packed(1, n + 1) = candidate
          packed(2, n + 1) = -number_of(narrow(-antagonist))
        end if
      end associate
      n = n + 1
      packed(4, n) = given%first + k
      nd = size(given%normal, 1)
      numbers(:, :) = 0.0_dp
      numbers(1:nd, 1) = merge(-given%normal(:, k), given%normal(:, k), turned)
      numbers(4:3 + nd, 1) = merge(-given%force(:, k), given%force(:, k), turned)
      if (allocated(given%point)) numbers(7:6 + nd, 1) = given%point(:, k)
      if (allocated(given%moment)) numbers(10:9 + size(given%moment, 1), 1) = merge(-given%moment(:, k), given%moment(:, k), turned)
      numbers(13, 1) = not_given
      if (allocated(given%elongation)) numbers(13:12 + nd, 1) = merge(-given%elongation(:, k), given%elongation(:, k), turned)
      call pack_reals(n_numbers, numbers, n_words + 1, packed(:, n:n))
    end do
    records = packed(:, 1:n)
  end subroutine pack_given

  !> The contacts of this rank as (4, contacts): candidate, antagonist, subdomain of this rank, contact; sorted.
  subroutine list_pairs(problem, views, pairs)
    type(contact_problem_t), intent(in) :: problem
    type(local_bodies_t), intent(in) :: views(:)
    integer(i8), allocatable, intent(out) :: pairs(:, :)
    integer(i8), allocatable :: unsorted(:, :)
    integer, allocatable :: order(:)
    integer :: s, c, n, k

    allocate (unsorted(4, sum(problem%sub%n_contacts)))
    n = 0
    do s = 1, size(problem%sub)
      associate (view => views(s), sub => problem%sub(s))
        do c = 1, sub%n_contacts
          n = n + 1
          associate (i => view%list%candidate(sub%source(c)), j => view%list%antagonist(sub%source(c)))
            unsorted(1, n) = view%bodies%id(i)
            unsorted(2, n) = j
            if (j > 0) unsorted(2, n) = view%bodies%id(j)
            unsorted(3, n) = s
            unsorted(4, n) = c
          end associate
        end do
      end associate
    end do
    allocate (order(n), pairs(4, n))
    call argsort_rows(unsorted, order)
    do k = 1, n
      pairs(:, k) = unsorted(:, order(k))
    end do
  end subroutine list_pairs

  !> Bring the records of pairs that touch to the ranks of their subdomains. Collective.
  subroutine bring_together(comm, records, pairs, mine)
    type(communicator_t), intent(in) :: comm
    !> of pack_given; of list_pairs
    integer(i8), intent(in), contiguous :: records(:, :), pairs(:, :)
    !> records of this rank, with their subdomains, in the order of pairs and rows
    integer(i8), allocatable, intent(out) :: mine(:, :)
    integer(i8), allocatable :: asks(:, :), given(:, :), asked(:, :), keys(:, :), answers(:, :), arrived(:, :)
    integer, allocatable :: order(:), destination(:)
    integer :: k, n, place

    ! a pair that touches in several points asks once
    allocate (asks(n_words, size(pairs, 2)))
    n = 0
    do k = 1, size(pairs, 2)
      if (k > 1) then
        if (all(pairs(1:3, k) == pairs(1:3, max(k - 1, 1)))) cycle
      end if
      n = n + 1
      asks(1:3, n) = pairs(1:3, k)
      asks(4, n) = comm%rank
    end do
    call find_ranks(comm, asks(:, 1:n), destination)
    call sparse_exchange(comm, asks(:, 1:n), destination, asked)
    call find_ranks(comm, records, destination)
    call sparse_exchange(comm, records, destination, given)
    keys = asked(1:2, :)
    allocate (order(size(keys, 2)), answers(size(given, 1), size(given, 2)))
    deallocate (destination)
    allocate (destination(size(given, 2)))
    call argsort_rows(keys, order)
    n = 0
    do k = 1, size(given, 2)
      place = first_not_before(keys, order, given(1:2, k))
      if (place > size(order)) cycle
      place = order(place)
      if (any(keys(:, place) /= given(1:2, k))) cycle
      n = n + 1
      answers(:, n) = given(:, k)
      answers(3, n) = asked(3, place)
      destination(n) = narrow(asked(4, place))
    end do
    call sparse_exchange(comm, answers(:, 1:n), destination(1:n), arrived)
    keys = arrived(1:4, :)
    deallocate (order)
    allocate (order(size(keys, 2)), mine(size(arrived, 1), size(arrived, 2)))
    call argsort_rows(keys, order)
    do k = 1, size(order)
      mine(:, k) = arrived(:, order(k))
    end do
  end subroutine bring_together

  !> Add the forces of records to the contacts that they belong to.
  subroutine add_all(decomposition, physics, problem, pairs, records, views, pressing)
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics
    type(contact_problem_t), intent(inout) :: problem
    !> of list_pairs; of bring_together
    integer(i8), intent(in), contiguous :: pairs(:, :), records(:, :)
    type(local_bodies_t), intent(inout) :: views(:)
    !> (records): normal forces in size, -1 of records that belong to none [N]
    real(dp), intent(out) :: pressing(:)
    integer, allocatable :: order(:)
    real(dp) :: numbers(n_numbers)
    integer :: k, e, c, s

    allocate (order(size(pairs, 2)))
    do k = 1, size(order)
      order(k) = k
    end do
    pressing(:) = -1.0_dp
    do k = 1, size(records, 2)
      do e = 1, n_numbers
        numbers(e) = transfer(records(n_words + e, k), 0.0_dp)
      end do
      s = narrow(records(3, k))
      call find_nearest(decomposition, problem, views, pairs, first_not_before(pairs, order, records(1:3, k)), numbers, c)
      if (c == 0) cycle
      pressing(k) = abs(sum(numbers(1:3)*numbers(4:6)))
      if (problem%sub(s)%yields(c)) then
        if (numbers(13) < not_given) then
          associate (nd => problem%nd)
            call put_elongation(views(s)%list, problem%sub(s), c, numbers(1:nd), numbers(13:12 + nd))
          end associate
        else
          call elongate(problem%sub(s), c, numbers(1:6), views(s)%list)
        end if
      end if
      numbers(4:6) = physics%h*numbers(4:6)
      numbers(10:12) = physics%h*numbers(10:12)
      call add_impulse(problem%kernels, problem%sub(s), c, numbers, views(s)%list)
    end do
    do s = 1, size(problem%sub)
      call settle(problem%sub(s), views(s)%list)
      do c = 1, problem%sub(s)%n_contacts
        if (problem%sub(s)%yields(c)) call stretch_spring(views(s)%list, problem%kernels, physics, c, problem%sub(s))
      end do
    end do
  end subroutine add_all

  !> Stretch the tangential spring of a contact, as its pair keeps it, by a force over the stiffness. If the normal spring presses
  !> less than the force needs, the contact slides in the step, which brings the spring back to the bound of friction.
  pure subroutine elongate(sub, c, numbers, list)
    type(subproblem_t), intent(in) :: sub
    integer, intent(in) :: c
    !> normal and force of a record [N]
    real(dp), intent(in) :: numbers(6)
    type(neighbour_list_t), intent(inout) :: list

    associate (normal => numbers(1:3), force => numbers(4:6), stiffness => sub%spring(c)%spring%stiffness(2), &
      & kept => list%spring(:, sub%source(c)))
      if (.not. stiffness > 0.0_dp) return
      if (size(kept) == 1) then
        kept(1) = kept(1) - (normal(1)*force(2) - normal(2)*force(1))/stiffness
      else
        kept(:) = kept - (force - sum(force*normal)*normal)/stiffness
      end if
    end associate
  end subroutine elongate

  !> Of the contacts of a pair, the nearest one to a place whose normal is within a right angle of that given; 0 for none.
  subroutine find_nearest(decomposition, problem, views, pairs, first, numbers, nearest)
    type(decomposition_t), intent(in) :: decomposition
    type(contact_problem_t), intent(in) :: problem
    type(local_bodies_t), intent(in) :: views(:)
    !> of list_pairs, and the first contact of the pair
    integer(i8), intent(in), contiguous :: pairs(:, :)
    integer, intent(in) :: first
    !> of a record
    real(dp), intent(in) :: numbers(n_numbers)
    integer, intent(out) :: nearest
    real(dp) :: place(problem%nd), way(problem%nd), least
    integer :: k, c, s, nd

    nd = problem%nd
    nearest = 0
    least = huge(least)
    do k = first, size(pairs, 2)
      if (any(pairs(1:3, k) /= pairs(1:3, first))) exit
      s = narrow(pairs(3, k))
      c = narrow(pairs(4, k))
      associate (sub => problem%sub(s))
        if (.not. sum(sub%hot(lane_of(c), 1:nd, block_of(c))*numbers(1:nd)) > 0.0_dp) cycle
        call find_contact_place(problem%kernels, views(s), sub, c, place)
      end associate
      way(:) = place - numbers(7:6 + nd)
      associate (length => decomposition%period%length(1:nd))
        where (length > 0.0_dp) way = way - length*anint(way/length)
      end associate
      if (sum(way**2) >= least) cycle
      least = sum(way**2)
      nearest = c
    end do
  end subroutine find_nearest

  !> Add the impulse of a record to the memory of a contact: its normal part as it is, its tangential part as warm starts keep it.
  pure subroutine add_impulse(kernels, sub, c, numbers, list)
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(in) :: sub
    integer, intent(in) :: c
    !> of a record, with impulses in the place of forces
    real(dp), intent(in) :: numbers(n_numbers)
    type(neighbour_list_t), intent(inout) :: list
    real(dp) :: normal(3), given(3), pressing, radius

    normal(:) = numbers(1:3)
    given(:) = numbers(4:6)
    pressing = sum(given*normal)
    radius = 1.0_dp
    if (kernels%has_rolling()) radius = sub%hot(lane_of(c), kernels%row%rolling_radius, block_of(c))
    associate (impulse => list%impulse(:, sub%source(c)))
      impulse(1) = impulse(1) + pressing
      select case (kernels%nf)
      case (2)
        impulse(2) = impulse(2) + normal(1)*given(2) - normal(2)*given(1)
        if (size(impulse) > 2) impulse(3) = impulse(3) + numbers(10)/radius
      case (3)
        impulse(2:4) = impulse(2:4) + given - pressing*normal
        if (size(impulse) > 4) impulse(5:7) = impulse(5:7) + numbers(10:12)/radius
      end select
    end associate
  end subroutine add_impulse

  !> Memory holds impulses of solves, which are those on the bodies and the attractions, and none where nothing presses.
  pure subroutine settle(sub, list)
    type(subproblem_t), intent(in) :: sub
    type(neighbour_list_t), intent(inout) :: list
    integer :: c

    do c = 1, sub%n_contacts
      associate (impulse => list%impulse(:, sub%source(c)))
        if (.not. any(abs(impulse) > 0.0_dp)) cycle
        if (allocated(sub%attraction)) impulse(1) = impulse(1) + sub%attraction(lane_of(c), block_of(c))
        if (.not. impulse(1) > 0.0_dp) impulse(:) = 0.0_dp
      end associate
    end do
  end subroutine settle

end module gravier_given_impulses
