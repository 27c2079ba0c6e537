!> A first solve from forces that a file gives: what a solved step lists is what another run starts from, whatever ranks read it, in
!> whatever order and whichever of two bodies comes first.
program test_given_impulses
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_random_hash, only: hash_uniform
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_sparse_exchange, only: sparse_exchange
  use gravier_ordered_rows, only: pack_reals, unpack_reals
  use gravier_given_contacts, only: given_contacts_t
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_impulse_memory, only: recall_impulses
  use gravier_contact_places, only: find_contact_place
  use gravier_contact_forces, only: list_forces
  use gravier_given_impulses, only: take_given_impulses, started_t
  use gravier_config, only: config_t, parse_config
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_test_contact_columns, only: contact_column, put_contact_column
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  character(len=*), parameter :: newline = new_line("a")
  !> impulses of a subdomain
  type :: kept_t
    real(dp), allocatable :: value(:, :, :)
  end type kept_t

  type(communicator_t), target :: comm
  integer :: dimension

  call start_parallel()
  call comm%init()
  do dimension = 2, 3
    call test_round_trip(dimension, 1, "friction = 0.3")
    call test_round_trip(dimension, 7, "friction = 0.3")
    call test_round_trip(dimension, 7, "friction = 0.0")
    call test_round_trip(dimension, 5, "friction = 0.3, rolling_friction = 0.1")
    ! attractions of 0.25 N s, so that some forces pull
    call test_round_trip(dimension, 3, "&"//newline//"&material name = 'wet' /"//newline// &
      & "&law materials = 'wet', 'wet', kind = 'adhesive', friction = 0.3, adhesion = 0.5, adhesion_range = 0.07 /")
    call test_no_match(dimension)
  end do
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> A lattice of grains whose contacts of the first step are found.
  subroutine make(dimension, n_subdomains, law, sim)
    integer, intent(in) :: dimension, n_subdomains
    character(len=*), intent(in) :: law
    type(simulation_t), intent(inout) :: sim
    type(config_t) :: config
    type(error_t), allocatable :: error
    type(step_figures_t) :: figures
    character(len=:), allocatable :: lattice, keys, groups

    ! keys of &scene, or further groups
    keys = law
    groups = ""
    if (law(1:1) == "&") then
      keys = "friction = 0.0"
      groups = law(2:)
    end if
    lattice = "lattice_count = 9, 8, gravity = 0, 0"
    if (dimension == 3) lattice = "lattice_count = 5, 4, 4, gravity = 0, 0, 0"
    call parse_config("lattice", "&scene dimension = "//to_text(dimension)//", bodies = 'lattice', "//lattice// &
      & ", radius_min = 0.05, radius_max = 0.1, alert_distance = 0.07, "//keys//" /"//groups//newline// &
      & "&time step = 0.5, steps = 2 / &solver method = 'nscdd' /"//newline// &
      & "&decomposition subdomains = "//to_text(n_subdomains)//" /", config, error)
    call check(.not. allocated(error), "configuration")
    call sim%init(comm, config, error)
    if (allocated(error)) then
      call check(.false., error%message)
      return
    end if
    call sim%assemble(figures)
  end subroutine make

  !> Impulses by the pair, the same whatever subdomain has it; every fourth pair has none.
  subroutine give_impulses(sim)
    type(simulation_t), intent(inout) :: sim
    real(dp) :: impulse(sim%problem%nc)
    integer(i8) :: pair
    integer :: s, c, e

    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s))
        do c = 1, sub%n_contacts
          pair = 10000*sub%id(sub%pair(1, c)) + sub%id(sub%pair(2, c))
          do e = 1, size(impulse)
            impulse(e) = hash_uniform(3, pair, e) - merge(0.0_dp, 0.5_dp, e == 1)
          end do
          if (mod(pair, 4_i8) == 0) impulse(:) = 0.0_dp
          call put_contact_column(impulse, c, sub%impulse)
        end do
      end associate
    end do
  end subroutine give_impulses

  !> Forget the impulses of a problem and the memory of its lists.
  subroutine forget(sim)
    type(simulation_t), intent(inout) :: sim
    integer :: s

    do s = 1, size(sim%problem%sub)
      sim%problem%sub(s)%impulse(:, :, :) = 0.0_dp
      sim%halo%view(s)%list%impulse(:, :) = 0.0_dp
    end do
  end subroutine forget

  !> The same contacts in another order, spread over the ranks by turns; of every other pair of bodies the other one is the
  !> candidate.
  subroutine shuffle(contacts, shuffled)
    type(given_contacts_t), intent(in) :: contacts
    type(given_contacts_t), intent(out) :: shuffled
    integer(i8), allocatable :: records(:, :), received(:, :)
    integer, allocatable :: rank(:)
    integer :: k, nd, nm

    nd = size(contacts%normal, 1)
    nm = 0
    if (allocated(contacts%moment)) nm = size(contacts%moment, 1)
    allocate (records(2 + 3*nd + nm, contacts%n), rank(contacts%n))
    do k = 1, contacts%n
      records(1, k) = contacts%candidate(k)
      records(2, k) = contacts%antagonist(k)
      rank(k) = mod(7*k, comm%size)
    end do
    call pack_reals(nd, contacts%normal, 3, records)
    call pack_reals(nd, contacts%force, 3 + nd, records)
    call pack_reals(nd, contacts%point, 3 + 2*nd, records)
    if (nm > 0) call pack_reals(nm, contacts%moment, 3 + 3*nd, records)
    call sparse_exchange(comm, records, rank, received)
    shuffled = given_contacts_t()
    shuffled%n = size(received, 2)
    shuffled%total = contacts%total
    shuffled%first = comm%offset(int(shuffled%n, i8))
    shuffled%boundary = contacts%boundary
    shuffled%candidate = received(1, :)
    shuffled%antagonist = received(2, :)
    call unpack_reals(received, 3, nd, shuffled%normal)
    call unpack_reals(received, 3 + nd, nd, shuffled%force)
    call unpack_reals(received, 3 + 2*nd, nd, shuffled%point)
    if (nm > 0) call unpack_reals(received, 3 + 3*nd, nm, shuffled%moment)
    do k = 1, shuffled%n
      if (shuffled%antagonist(k) < 0 .or. mod(k, 2) == 0) cycle
      shuffled%candidate(k) = received(2, k)
      shuffled%antagonist(k) = received(1, k)
      shuffled%normal(:, k) = -shuffled%normal(:, k)
      shuffled%force(:, k) = -shuffled%force(:, k)
      if (nm > 0) shuffled%moment(:, k) = -shuffled%moment(:, k)
    end do
  end subroutine shuffle

  !> Forces are sums of three products of numbers below 1 and are taken apart by as many: 64 roundings are more than they can be
  !> off. Moments are divided by lengths of 0.025 and more, which adds a rounding.
  subroutine test_round_trip(dimension, n_subdomains, law)
    integer, intent(in) :: dimension, n_subdomains
    character(len=*), intent(in) :: law
    type(simulation_t) :: sim
    type(given_contacts_t) :: listed, shuffled
    type(started_t) :: started
    type(kept_t), allocatable :: before(:)
    real(dp) :: place(dimension), way(dimension)
    real(dp), allocatable :: found(:), expected(:)
    integer(i8) :: pressing
    integer :: s, c
    logical :: same, on_surface

    call make(dimension, n_subdomains, law, sim)
    call give_impulses(sim)
    call list_forces(sim%problem, sim%decomposition, sim%halo, 0.5_dp, listed)
    allocate (before(size(sim%problem%sub)))
    pressing = 0
    on_surface = .true.
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s), view => sim%halo%view(s))
        before(s)%value = sub%impulse
        do c = 1, sub%n_contacts
          if (sub%impulse(lane_of(c), 1, block_of(c)) > 0.0_dp) pressing = pressing + 1
          call find_contact_place(sim%problem%kernels, view, sub, c, place)
          way(:) = view%bodies%position(:, view%list%candidate(sub%source(c))) - place
          on_surface = on_surface .and. abs(norm2(way) - view%bodies%radius(view%list%candidate(sub%source(c))) - &
            & 0.5_dp*sub%gap(c)) <= 64*epsilon(1.0_dp)
        end do
      end associate
    end do
    call check(on_surface, "places are half-way between the surfaces")
    call check_equal(listed%total, comm%total(pressing), "contacts that press are listed")
    call check(listed%total > 50, "enough of them to tell")
    call shuffle(listed, shuffled)
    call forget(sim)
    sim%physics%h = 0.5_dp
    call take_given_impulses(shuffled, sim%decomposition, sim%physics, sim%problem, sim%halo%view, started)
    call recall_impulses(sim%halo%view, sim%problem)
    call check_equal(started%given, listed%total, "contacts given")
    call check_equal(started%matched, listed%total, "contacts matched")
    call check_close(started%share, 1.0_dp, 4*epsilon(1.0_dp), "share of the normal forces")
    same = .true.
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s))
        do c = 1, sub%n_contacts
          found = contact_column(sub%impulse, c)
          expected = contact_column(before(s)%value, c)
          same = same .and. all(abs(found - expected) <= 64*epsilon(1.0_dp))
        end do
      end associate
    end do
    call check(same, "the impulses come back, "//law)
    call sim%free()
  end subroutine test_round_trip

  !> Boundaries that are not there, pairs that do not touch and normals turned round match nothing; the rest does.
  subroutine test_no_match(dimension)
    integer, intent(in) :: dimension
    type(simulation_t) :: sim
    type(given_contacts_t) :: listed
    type(started_t) :: started
    integer(i8) :: lost
    integer :: k

    call make(dimension, 4, "friction = 0.3", sim)
    call give_impulses(sim)
    call list_forces(sim%problem, sim%decomposition, sim%halo, 0.5_dp, listed)
    lost = 0
    do k = 1, listed%n
      if (listed%antagonist(k) == -1) lost = lost + 1
      if (listed%antagonist(k) < 0) cycle
      select case (mod(k, 4))
      case (0)
        ! the last grain touches none of the first row
        if (listed%candidate(k) > 4) cycle
        listed%antagonist(k) = sim%n_grains
        lost = lost + 1
      case (1)
        listed%normal(:, k) = -listed%normal(:, k)
        lost = lost + 1
      end select
    end do
    listed%boundary(1) = "elsewhere"
    call forget(sim)
    sim%physics%h = 0.5_dp
    call take_given_impulses(listed, sim%decomposition, sim%physics, sim%problem, sim%halo%view, started)
    call check(comm%total(lost) > 10, "enough contacts that match nothing")
    call check_equal(started%matched, listed%total - comm%total(lost), "contacts matched, of "//to_text(listed%total))
    call check(started%share < 0.95_dp, "share of the normal forces")
    call sim%free()
  end subroutine test_no_match

end program test_given_impulses
