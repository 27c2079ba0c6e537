!> Who owns which grain and who sees which: every grain once, in the subdomain of its centre; every contact found by its
!> owner in what it sees, whatever the partition. Places follow from identifiers, so that every rank knows them all.
program test_decomposition
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_random_hash, only: hash_uniform
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_body_store, only: body_set_t
  use gravier_cell_grid, only: cell_grid_t
  use gravier_contact_list, only: contact_list_t
  use gravier_detection, only: detect_contacts, sort_bodies, owner_point, rule_dual, rule_primal
  use gravier_partition, only: choose_boxes
  use gravier_decomposition, only: decomposition_t, neighbourhood_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  integer, parameter :: n_grains = 160, n_walls = 2
  type(communicator_t), target :: comm
  integer :: nd, k
  integer, parameter :: counts(*) = [1, 2, 7, 12]

  call start_parallel()
  call comm%init()
  call test_init()
  call test_bounding_box()
  do nd = 2, 3
    do k = 1, size(counts)
      call test_settle(nd, counts(k), .false.)
      call test_settle(nd, counts(k), .true.)
      call test_look_around(nd, counts(k), .false., rule_dual)
      call test_look_around(nd, counts(k), .true., rule_dual)
      call test_look_around(nd, counts(k), .false., rule_primal)
      call test_look_around(nd, counts(k), .true., rule_primal)
    end do
  end do
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> Radii from 0.03 to 0.12.
  real(dp) function radius_of(g)
    integer, intent(in) :: g
    radius_of = 0.03_dp + 0.09_dp*hash_uniform(1, int(g, i8), 1)**2
  end function radius_of

  !> Centre of grain `g` at time `t`: in the unit box at time 0, then anywhere around it, far away now and then.
  pure subroutine find_place(g, t, place)
    integer, intent(in) :: g, t
    !> (nd)
    real(dp), intent(out) :: place(:)
    integer :: d

    do d = 1, size(place)
      place(d) = hash_uniform(2 + t, int(g, i8), d)
      if (t > 0) place(d) = 1.6_dp*place(d) - 0.3_dp
      if (t > 0 .and. mod(g, 20) == 0) place(d) = 100*place(d) - 50.0_dp
    end do
  end subroutine find_place

  !> A decomposition of the grains at their places at time 0, by boxes or by cells.
  subroutine make(nd, n_subdomains, by_cells, decomposition)
    integer, intent(in) :: nd, n_subdomains
    logical, intent(in) :: by_cells
    type(decomposition_t), intent(out) :: decomposition
    type(body_set_t) :: newcomers(1)
    type(error_t), allocatable :: error
    real(dp) :: lower(nd), upper(nd)
    integer, allocatable :: weights(:)
    integer :: boxes(3), g, n

    call decomposition%init(comm, n_subdomains, nd, nd)
    decomposition%rule%alert_distance = 0.02_dp
    do g = 1, n_grains
      decomposition%rule%largest_radius = max(decomposition%rule%largest_radius, radius_of(g))
    end do
    ! the last rank brings nobody, unless it is alone
    n = 0
    do g = 1, n_grains
      if (mod(g, max(1, comm%size - 1)) == comm%rank) n = n + 1
    end do
    call newcomers(1)%init(nd, nd, n)
    n = 0
    do g = 1, n_grains
      if (mod(g, max(1, comm%size - 1)) /= comm%rank) cycle
      n = n + 1
      newcomers(1)%id(n) = id_of(g)
      call find_place(g, 0, newcomers(1)%position(:, n))
      newcomers(1)%velocity(:, n) = 2*newcomers(1)%position(:, n)
      newcomers(1)%radius(n) = radius_of(g)
      newcomers(1)%mass(n) = g
      newcomers(1)%inertia(n) = -g
    end do
    call decomposition%bounding_box(newcomers, lower, upper)
    if (by_cells) then
      allocate (weights(newcomers(1)%n), source=1)
      call decomposition%partition%init_graph(comm, lower, upper, 0.15_dp, newcomers(1)%position, weights, n_subdomains, error)
    else
      boxes(:) = choose_boxes(lower, upper, n_subdomains)
      call decomposition%partition%init_grid(lower, upper, boxes, 0.1_dp, error)
    end if
    call check(.not. allocated(error), "partition")
    call make_walls(nd, decomposition)
    call decomposition%settle(newcomers(1))
  end subroutine make

  !> Identifiers are in another order than grains.
  integer(i8) function id_of(g)
    integer, intent(in) :: g
    id_of = 1 + mod(63*g, n_grains)
  end function id_of

  subroutine make_walls(nd, decomposition)
    integer, intent(in) :: nd
    type(decomposition_t), intent(inout) :: decomposition

    associate (walls => decomposition%walls)
      walls%n = n_walls
      allocate (walls%id(n_walls))
      allocate (walls%point(nd, n_walls), walls%normal(nd, n_walls), source=0.0_dp)
      walls%id(1) = n_grains + 1
      walls%id(2) = n_grains + 2
      walls%normal(nd, 1) = 1.0_dp
      walls%normal(1, 2) = 0.6_dp
      walls%normal(nd, 2) = 0.8_dp
      ! some grains are far behind this one
      walls%point(1, 2) = 0.4_dp
    end associate
  end subroutine make_walls

  subroutine test_init()
    type(decomposition_t) :: decomposition
    integer :: s, homes
    integer(i8) :: total

    call decomposition%init(comm, 7, 3, 6)
    homes = size(decomposition%home)
    total = comm%total(int(homes, i8))
    call check_equal(total, 7_i8, "one home for each subdomain")
    call check_equal(decomposition%first, comm%first_subdomain(comm%rank, 7), "first subdomain of the rank")
    do s = 1, homes
      call check(decomposition%home(s)%n == 0 .and. decomposition%home(s)%nd == 3 .and. decomposition%home(s)%nv == 6, &
        & "an empty home")
    end do
  end subroutine test_init

  !> Grains of all ranks, radii included.
  subroutine test_bounding_box()
    type(decomposition_t) :: decomposition
    type(body_set_t) :: bodies(2)
    real(dp) :: lower(2), upper(2)
    integer :: r

    call decomposition%init(comm, 1, 2, 2)
    call bodies(1)%init(2, 2, 0)
    call bodies(2)%init(2, 2, 0)
    call decomposition%bounding_box(bodies, lower, upper)
    call check_close(maxval(abs(lower)), 0.0_dp, 0.0_dp, "nobody: lower corner")
    call check_close(maxval(abs(upper - 1.0_dp)), 0.0_dp, 0.0_dp, "nobody: upper corner")
    do r = 0, comm%size - 1
      call bodies(2)%init(2, 2, merge(2, 0, comm%rank == r))
      if (comm%rank == r) then
        bodies(2)%position(:, 1) = [-5.0_dp, 2.0_dp]
        bodies(2)%position(:, 2) = [-4.5_dp, 3.0_dp]
        bodies(2)%radius(1) = 0.25_dp
        bodies(2)%radius(2) = 1.0_dp
      end if
      call decomposition%bounding_box(bodies, lower, upper)
      call check_close(lower(1), -5.5_dp, 0.0_dp, "left end")
      call check_close(lower(2), 1.75_dp, 0.0_dp, "lower end")
      call check_close(upper(1), -3.5_dp, 0.0_dp, "right end")
      call check_close(upper(2), 4.0_dp, 0.0_dp, "upper end")
    end do
  end subroutine test_bounding_box

  !> Grains come home, move, come home again.
  subroutine test_settle(nd, n_subdomains, by_cells)
    integer, intent(in) :: nd, n_subdomains
    logical, intent(in) :: by_cells
    type(decomposition_t) :: decomposition
    integer :: t, s, k, g

    call make(nd, n_subdomains, by_cells, decomposition)
    call check_homes(decomposition, 0)
    do t = 1, 4
      do s = 1, size(decomposition%home)
        associate (home => decomposition%home(s))
          do k = 1, home%n
            g = nint(home%mass(k))
            call find_place(g, t, home%position(:, k))
          end do
        end associate
      end do
      call decomposition%settle()
      call check_homes(decomposition, t)
    end do
    ! nobody has moved since
    call decomposition%settle()
    call check_homes(decomposition, 4)
  end subroutine test_settle

  !> Every grain once, with all that is its own, in the subdomain of its centre, by ascending identifier.
  subroutine check_homes(decomposition, t)
    type(decomposition_t), intent(in) :: decomposition
    integer, intent(in) :: t
    integer(i8) :: met(n_grains)
    integer :: s, k, g
    logical :: own, placed, ordered

    met(:) = 0
    own = .true.
    placed = .true.
    ordered = .true.
    do s = 1, size(decomposition%home)
      associate (home => decomposition%home(s))
        do k = 1, home%n
          g = nint(home%mass(k))
          met(g) = met(g) + 1
          own = own .and. is_grain(home, k, g, t)
          placed = placed .and. decomposition%partition%owner(home%position(:, k)) == decomposition%first + s - 1
          if (k > 1) ordered = ordered .and. home%id(k) > home%id(k - 1)
        end do
      end associate
    end do
    call comm%sum_counts(met)
    call check(all(met == 1), "every grain once")
    call check(own, "every grain with all that is its own")
    call check(placed, "every grain in the subdomain of its centre")
    call check(ordered, "by ascending identifier")
  end subroutine check_homes

  !> Numbers are made twice: a rounding of 100 m at most may lie between.
  logical function is_grain(bodies, k, g, t)
    type(body_set_t), intent(in) :: bodies
    integer, intent(in) :: k, g, t
    real(dp) :: place(bodies%nd)

    call find_place(g, t, place)
    is_grain = bodies%id(k) == id_of(g) .and. all(abs(bodies%position(:, k) - place) <= 100*epsilon(1.0_dp))
    call find_place(g, 0, place)
    is_grain = is_grain .and. all(abs(bodies%velocity(:, k) - 2*place) <= 4*epsilon(1.0_dp))
    is_grain = is_grain .and. abs(bodies%radius(k) - radius_of(g)) <= epsilon(1.0_dp) .and. abs(bodies%inertia(k) + g) <= 0.0_dp
  end function is_grain

  !> What each subdomain sees is its own grains, as they stand in `home`, and ghosts, once each, with their owners; and
  !> the contacts that subdomains find in what they see are those between all grains.
  subroutine test_look_around(nd, n_subdomains, by_cells, kind)
    integer, intent(in) :: nd, n_subdomains, kind
    logical, intent(in) :: by_cells
    type(decomposition_t) :: decomposition
    type(neighbourhood_t), allocatable :: seen(:)
    integer :: s, k, n
    logical :: own, ghosts

    call make(nd, n_subdomains, by_cells, decomposition)
    decomposition%rule%kind = kind
    call decomposition%look_around(seen)
    call check_equal(size(seen), size(decomposition%home), "one neighbourhood for each subdomain")
    own = .true.
    ghosts = .true.
    do s = 1, size(seen)
      associate (bodies => seen(s)%bodies, home => decomposition%home(s))
        n = home%n
        own = own .and. bodies%n >= n .and. size(seen(s)%home) == bodies%n .and. size(seen(s)%origin) == bodies%n
        if (.not. own) exit
        own = own .and. all(bodies%id(1:n) == home%id) .and. all(seen(s)%home(1:n) == decomposition%first + s - 1)
        do k = 1, n
          own = own .and. seen(s)%origin(k) == k
        end do
        do k = n + 1, bodies%n
          ghosts = ghosts .and. seen(s)%origin(k) == 0 .and. is_grain(bodies, k, nint(bodies%mass(k)), 0)
          ghosts = ghosts .and. seen(s)%home(k) == decomposition%partition%owner(bodies%position(:, k))
          ghosts = ghosts .and. seen(s)%home(k) /= decomposition%first + s - 1 .and. count(bodies%id == bodies%id(k)) == 1
        end do
      end associate
    end do
    call check(own, "own grains first")
    call check(ghosts, "ghosts once each, with their owners")
    call check_contacts(decomposition, seen)
  end subroutine test_look_around

  subroutine check_contacts(decomposition, seen)
    type(decomposition_t), intent(in) :: decomposition
    type(neighbourhood_t), intent(in) :: seen(:)
    type(body_set_t) :: bodies
    type(contact_list_t) :: contacts
    type(cell_grid_t) :: grid
    integer, allocatable :: order(:), first(:)
    !> owners added up over the times that a pair was found: (lower identifier, higher one or number of a wall)
    integer(i8), allocatable :: found(:, :), expected(:, :)
    integer :: s, c, j

    allocate (found(n_grains, n_grains + n_walls), expected(n_grains, n_grains + n_walls), source=0_i8)
    do s = 1, size(seen)
      bodies = seen(s)%bodies
      call sort_bodies(bodies, 2*decomposition%rule%largest_radius + decomposition%rule%alert_distance, grid, order, first)
      call bodies%reorder(order)
      call detect_contacts(bodies, grid, first, decomposition%walls, decomposition%partition, decomposition%first + s - 1, &
        & decomposition%rule, contacts)
      do c = 1, contacts%n
        j = n_grains - contacts%antagonist(c)
        if (contacts%antagonist(c) > 0) j = int(bodies%id(contacts%antagonist(c)))
        associate (times => found(bodies%id(contacts%candidate(c)), j))
          times = times + decomposition%first + s - 1
        end associate
      end do
    end do
    do j = 1, n_grains + n_walls
      call comm%sum_counts(found(:, j))
    end do
    call find_all_pairs(decomposition, expected)
    call check(count(expected > 0) > 100, "enough contacts to tell")
    call check(all(found == expected), "contacts of all subdomains are those between all grains")
  end subroutine check_contacts

  !> Owner of the contact of each pair of grains, and of grains with walls, 0 where there is none.
  subroutine find_all_pairs(decomposition, owner)
    type(decomposition_t), intent(in) :: decomposition
    integer(i8), intent(out) :: owner(:, :)
    real(dp), dimension(decomposition%nd) :: a, b, point
    real(dp) :: height
    integer :: i, j, w

    owner(:, :) = 0
    associate (rule => decomposition%rule, walls => decomposition%walls)
      do i = 1, n_grains
        call find_place(i, 0, a)
        do w = 1, n_walls
          height = dot_product(a - walls%point(:, w), walls%normal(:, w))
          if (height - radius_of(i) > rule%alert_distance) cycle
          ! a centre behind the wall decides itself
          b(:) = a - max(height, 0.0_dp)*walls%normal(:, w)
          point(:) = owner_point(rule%kind, a, b, .true.)
          owner(id_of(i), n_grains + w) = decomposition%partition%owner(point)
        end do
        do j = 1, n_grains
          if (id_of(j) <= id_of(i)) cycle
          call find_place(j, 0, b)
          if (norm2(a - b) - radius_of(i) - radius_of(j) > rule%alert_distance) cycle
          point(:) = owner_point(rule%kind, a, b, .false.)
          owner(id_of(i), id_of(j)) = decomposition%partition%owner(point)
        end do
      end do
    end associate
  end subroutine find_all_pairs

end program test_decomposition
