!> What each subdomain sees: its grains and the ghosts that its pairs need, current after each move; contacts found in the
!> lists while grains move by less than half the skin are those between all grains; lists are made anew when they must be.
program test_neighbourhood
  use gravier_kinds, only: dp, i8
  use gravier_periodic, only: no_shift, shift_code, shift_of_code
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_boundary, only: boundary_t
  use gravier_neighbour_rule, only: rule_dual, rule_primal
  use gravier_decomposition, only: decomposition_t
  use gravier_halo, only: halo_t
  use gravier_removal, only: some_leave, remove_grains, drop_grains
  use gravier_test_scenes, only: cloud_t, near_pair_t, draw, plane, change_shape, make_decomposition
  use gravier_check, only: check, check_equal, finish_checks
  implicit none
  integer, parameter :: n_grains = 220, counts(*) = [1, 2, 7, 12]
  real(dp), parameter :: alert = 0.02_dp, skin = 0.04_dp
  type(communicator_t), target :: comm
  integer :: nd, k, axes

  call start_parallel()
  call comm%init()
  do nd = 2, 3
    do k = 1, size(counts)
      call test_views(nd, 0, counts(k), .false., rule_dual)
      call test_views(nd, 0, counts(k), .true., rule_dual)
      call test_views(nd, 0, counts(k), .true., rule_primal)
    end do
    do axes = 1, 2**nd - 1
      call test_views(nd, axes, 7, .true., rule_dual)
      call test_views(nd, axes, 7, .false., rule_primal)
    end do
  end do
  do axes = 0, 3
    call test_fast_grains(2, axes, 7, rule_dual)
    call test_fast_grains(3, axes, 5, rule_primal)
  end do
  do nd = 2, 3
    do k = 1, size(counts)
      call test_departures(nd, counts(k))
    end do
  end do
  call test_due_grains()
  call test_due_boundaries()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> Build, move by nearly half the skin, refresh, move on, build again.
  subroutine test_views(nd, axes, n_subdomains, by_cells, kind)
    integer, intent(in) :: nd, axes, n_subdomains, kind
    logical, intent(in) :: by_cells
    type(cloud_t) :: cloud
    type(decomposition_t) :: decomposition
    type(halo_t) :: seen
    integer :: t, g, home_of(n_grains)

    call cloud%init(nd, n_grains, 0.03_dp, 0.1_dp, 50 + nd)
    call cloud%make_periodic(axes)
    decomposition%rule = cloud%rule(alert, skin, kind)
    call make_decomposition(comm, cloud, n_subdomains, nd, by_cells, decomposition)
    call check(seen%are_due(decomposition), "lists are due before the first")
    do t = 0, 1
      call wrap(cloud)
      do g = 1, n_grains
        home_of(g) = decomposition%partition%owner(cloud%place(:, g))
      end do
      call decomposition%migrate()
      seen%memory%n_impulse = 2
      call seen%build(decomposition)
      call check_equal(seen%builds, int(t + 1, i8), "lists made")
      call check(.not. seen%are_due(decomposition), "lists are not due when made")
      call check_views(decomposition, seen, cloud, home_of)
      call check_pairs(decomposition, seen, cloud, alert + skin, .true.)
      call move(decomposition, cloud, t, 0.499_dp*skin)
      call check(.not. seen%are_due(decomposition), "lists are not due while grains move by less than half the skin")
      call seen%refresh(decomposition)
      call check_views(decomposition, seen, cloud, home_of)
      call check_pairs(decomposition, seen, cloud, alert, .false.)
      call move(decomposition, cloud, 10 + t, skin)
    end do
  end subroutine test_views

  !> Grains of all speeds: each may go as far as lists leave it, in any direction, and none farther.
  subroutine test_fast_grains(nd, axes, n_subdomains, kind)
    integer, intent(in) :: nd, axes, n_subdomains, kind
    type(cloud_t) :: cloud
    type(decomposition_t) :: decomposition
    type(halo_t) :: seen
    real(dp), parameter :: duration = 0.1_dp, most = 3.0_dp*skin
    real(dp) :: direction(nd), way(n_grains)
    integer :: g, d, s, k, fast

    call cloud%init(nd, n_grains, 0.03_dp, 0.1_dp, 90 + nd)
    call cloud%make_periodic(axes)
    call wrap(cloud)
    decomposition%rule = cloud%rule(alert, skin, kind)
    decomposition%rule%duration = duration
    decomposition%rule%most_travel = most
    call make_decomposition(comm, cloud, n_subdomains, nd, .true., decomposition)
    fast = 0
    do g = 1, n_grains
      way(g) = max(0.5_dp*skin, min(most, duration*2.0_dp*draw(91, g, 1)))
      if (way(g) > 0.5_dp*skin) fast = fast + 1
    end do
    call check(fast > n_grains/2 .and. fast < n_grains .and. any(way >= most), "grains of all speeds")
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        owned%velocity(:, :) = 0.0_dp
        do k = 1, owned%n
          owned%velocity(mod(k, nd) + 1, k) = -2.0_dp*draw(91, int(owned%id(k)), 1)
        end do
      end associate
    end do
    call decomposition%migrate()
    seen%memory%n_impulse = 2
    call seen%build(decomposition)
    do g = 1, n_grains
      do d = 1, nd
        direction(d) = draw(92, g, d) - 0.5_dp
      end do
      cloud%place(:, g) = cloud%place(:, g) + 0.999_dp*way(g)*direction/norm2(direction)
    end do
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        do k = 1, owned%n
          owned%position(:, k) = cloud%place(:, owned%id(k))
        end do
      end associate
    end do
    call check(.not. seen%are_due(decomposition), "grains within the way that they are left")
    call seen%refresh(decomposition)
    call check_pairs(decomposition, seen, cloud, alert, .false.)
    do g = 1, n_grains, 37
      call shift_grain(decomposition, g, 2.01_dp*way(g))
      call check(seen%are_due(decomposition), "a grain that went farther than it was left")
      call shift_grain(decomposition, g, -2.01_dp*way(g))
    end do
  end subroutine test_fast_grains

  subroutine wrap(cloud)
    type(cloud_t), intent(inout) :: cloud
    integer :: g, turns(cloud%nd)

    do g = 1, cloud%n
      call cloud%period%wrap(cloud%place(:, g), turns)
    end do
  end subroutine wrap

  !> Move every grain by `way`, somewhere, and give it a velocity that tells its place.
  subroutine move(decomposition, cloud, t, way)
    type(decomposition_t), intent(inout) :: decomposition
    type(cloud_t), intent(inout) :: cloud
    integer, intent(in) :: t
    real(dp), intent(in) :: way
    real(dp) :: direction(cloud%nd)
    integer :: g, d, s, k

    do g = 1, cloud%n
      do d = 1, cloud%nd
        direction(d) = draw(60 + t, g, d) - 0.5_dp
      end do
      cloud%place(:, g) = cloud%place(:, g) + way*direction/norm2(direction)
    end do
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        do k = 1, owned%n
          owned%position(:, k) = cloud%place(:, owned%id(k))
          owned%velocity(:, k) = 2*owned%position(:, k)
        end do
      end associate
    end do
  end subroutine move

  !> Own grains as they stand in `owned`, and ghosts, once each, where they are, with their owners.
  subroutine check_views(decomposition, seen, cloud, home_of)
    type(decomposition_t), intent(in) :: decomposition
    type(halo_t), intent(in) :: seen
    type(cloud_t), intent(in) :: cloud
    !> subdomain of each grain when the lists were made
    integer, intent(in) :: home_of(:)
    integer :: s, k, times(n_grains)
    logical :: own, ghosts, placed
    real(dp) :: velocity(cloud%nd)

    call check_equal(size(seen%view), size(decomposition%owned), "one view for each subdomain")
    own = .true.
    ghosts = .true.
    placed = .true.
    do s = 1, size(seen%view)
      associate (bodies => seen%view(s)%bodies, owned => decomposition%owned(s), view => seen%view(s))
        own = own .and. size(view%owner) == bodies%n .and. size(view%origin) == bodies%n
        if (.not. own) exit
        times(:) = 0
        own = own .and. count(view%origin > 0) == owned%n
        do k = 1, bodies%n
          times(bodies%id(k)) = times(bodies%id(k)) + 1
          placed = placed .and. all(abs(bodies%position(:, k) - cloud%place(:, bodies%id(k))) <= 0.0_dp)
          if (view%origin(k) > 0) then
            own = own .and. owned%id(view%origin(k)) == bodies%id(k) .and. view%owner(k) == decomposition%subdomain_of(s)
            velocity(:) = owned%velocity(:, view%origin(k))
            placed = placed .and. all(abs(bodies%velocity(:, k) - velocity) <= 0.0_dp)
          else
            ghosts = ghosts .and. view%owner(k) /= decomposition%subdomain_of(s)
            ghosts = ghosts .and. view%owner(k) == home_of(bodies%id(k))
          end if
        end do
        ghosts = ghosts .and. all(times <= 1)
      end associate
    end do
    call check(own, "own grains")
    call check(ghosts, "ghosts once each, with their owners")
    call check(placed, "places and velocities are current")
  end subroutine check_views

  !> The listed pairs within `range` are those between all grains, each in one subdomain: that of its owner point, where
  !> the lists have just been made.
  subroutine check_pairs(decomposition, seen, cloud, range, fresh)
    type(decomposition_t), intent(in) :: decomposition
    type(halo_t), intent(in) :: seen
    type(cloud_t), intent(in) :: cloud
    real(dp), intent(in) :: range
    logical, intent(in) :: fresh
    type(near_pair_t), allocatable :: pairs(:)
    type(near_pair_t) :: pair
    !> times that a pair was found, 27 owner + code of its shift
    integer(i8), allocatable, target :: times(:, :), owner(:, :)
    integer(i8), allocatable :: expected(:, :), right(:, :)
    integer(i8), pointer, contiguous :: counted(:)
    real(dp) :: place(cloud%nd)
    integer :: s, p, code, shift(3)

    allocate (times(n_grains, n_grains), owner(n_grains, n_grains), expected(n_grains, n_grains), right(n_grains, n_grains), &
      & source=0_i8)
    do s = 1, size(seen%view)
      associate (list => seen%view(s)%list, bodies => seen%view(s)%bodies)
        do p = 1, list%n
          pair%i = int(bodies%id(list%candidate(p)))
          pair%j = int(bodies%id(list%antagonist(p)))
          code = no_shift
          if (cloud%period%on()) code = list%shift(p)
          shift(:) = shift_of_code(code)
          pair%shift(:) = shift
          call cloud%find_antagonist(pair, place)
          if (norm2(cloud%place(:, pair%i) - place) - cloud%radius(pair%i) - cloud%radius(pair%j) > range) cycle
          times(pair%i, pair%j) = times(pair%i, pair%j) + 1
          owner(pair%i, pair%j) = 125*decomposition%subdomain_of(s) + code
        end do
      end associate
    end do
    counted(1:n_grains**2) => times
    call comm%sum_counts(counted)
    counted(1:n_grains**2) => owner
    call comm%sum_counts(counted)
    call cloud%near_pairs(range, pairs)
    do p = 1, size(pairs)
      call cloud%find_antagonist(pairs(p), place)
      if (decomposition%rule%kind == rule_dual) then
        place(:) = (cloud%place(:, pairs(p)%i) + place)/2
      else
        place(:) = cloud%place(:, pairs(p)%i)
      end if
      expected(pairs(p)%i, pairs(p)%j) = 1
      right(pairs(p)%i, pairs(p)%j) = 125*decomposition%partition%owner(place) + shift_code(pairs(p)%shift)
    end do
    call check(size(pairs) > 60, "enough pairs to tell")
    call check(all(times == expected), "pairs of all subdomains are those between all grains")
    if (fresh) call check(all(owner == right), "pairs in the subdomains of their owner points")
  end subroutine check_pairs

  !> Grains behind an outlet leave views and lists as they are: the others keep their order, their pairs with what these hold, and
  !> the copies that other subdomains see of them.
  subroutine test_departures(nd, n_subdomains)
    integer, intent(in) :: nd, n_subdomains
    type(cloud_t) :: cloud
    type(decomposition_t) :: decomposition
    type(halo_t) :: seen, before
    real(dp) :: point(nd), normal(nd), mass
    integer(i8) :: n_free, n_glued
    integer :: s, p, g, home_of(n_grains)
    logical :: stays(n_grains)

    call cloud%init(nd, n_grains, 0.03_dp, 0.1_dp, 40 + nd)
    decomposition%rule = cloud%rule(alert, skin, rule_dual)
    point(:) = sum(cloud%place, dim=2)/n_grains
    normal(:) = 0.0_dp
    normal(1) = 1.0_dp
    normal(2) = 0.5_dp
    normal(:) = normal/norm2(normal)
    allocate (decomposition%boundaries(1))
    decomposition%boundaries(1) = plane(1000, point, normal)
    call change_shape("outlet", decomposition%boundaries(1))
    call make_decomposition(comm, cloud, n_subdomains, nd, .true., decomposition)
    do g = 1, n_grains
      home_of(g) = decomposition%partition%owner(cloud%place(:, g))
    end do
    seen%memory%n_impulse = 2
    call seen%build(decomposition)
    do s = 1, size(seen%view)
      do p = 1, seen%view(s)%list%n
        seen%view(s)%list%impulse(:, p) = real(p, dp)
      end do
    end do
    call move(decomposition, cloud, 30, 0.2_dp*skin)
    call seen%refresh(decomposition)
    before = seen
    do g = 1, n_grains
      stays(g) = sum((cloud%place(:, g) - point)*normal) >= 0.0_dp
    end do
    call check(some_leave(decomposition), "departures: some leave")
    call drop_grains(decomposition, seen)
    call remove_grains(decomposition, .false., n_free, n_glued, mass)
    call check_equal(n_free, int(count(.not. stays), i8), "departures: how many leave")
    call check(.not. some_leave(decomposition), "departures: nobody leaves twice")
    call check_lists_without(before, seen, stays)
    call move(decomposition, cloud, 31, 0.2_dp*skin)
    call check(.not. seen%are_due(decomposition), "departures: lists stay valid")
    call seen%refresh(decomposition)
    call check_views(decomposition, seen, cloud, home_of)
    do s = 1, size(seen%view)
      do p = 1, seen%view(s)%bodies%n
        call check(stays(seen%view(s)%bodies%id(p)), "departures: those who left are not seen")
      end do
    end do
    g = findloc(stays, .true., dim=1)
    call shift_grain(decomposition, g, skin)
    call check(seen%are_due(decomposition), "departures: a grain that stayed makes lists due")
  end subroutine test_departures

  !> Views and lists are those before without the grains that have left.
  subroutine check_lists_without(before, seen, stays)
    type(halo_t), intent(in) :: before, seen
    logical, intent(in) :: stays(:)
    integer :: s, p, k, n, i, j, left
    logical :: same

    left = 0
    do s = 1, size(seen%view)
      associate (old => before%view(s), new => seen%view(s))
        n = 0
        same = .true.
        do k = 1, old%bodies%n
          if (.not. stays(old%bodies%id(k))) cycle
          n = n + 1
          if (n > new%bodies%n) exit
          same = same .and. new%bodies%id(n) == old%bodies%id(k) .and. new%owner(n) == old%owner(k)
        end do
        call check(same .and. n == new%bodies%n, "departures: bodies in their order")
        n = 0
        same = .true.
        do p = 1, old%list%n
          i = int(old%bodies%id(old%list%candidate(p)))
          j = int(old%bodies%id(old%list%antagonist(p)))
          if (.not. (stays(i) .and. stays(j))) then
            left = left + 1
            cycle
          end if
          n = n + 1
          if (n > new%list%n) exit
          same = same .and. new%bodies%id(new%list%candidate(n)) == i .and. new%bodies%id(new%list%antagonist(n)) == j
          same = same .and. all(abs(new%list%impulse(:, n) - p) <= 0.0_dp)
        end do
        call check(same .and. n == new%list%n, "departures: pairs in their order, with their impulses")
      end associate
    end do
    call check(comm%total(int(left, i8)) > 20, "departures: pairs go with them")
  end subroutine check_lists_without

  !> One grain, whichever it is, that moves by more than half the skin makes the lists due on all ranks.
  subroutine test_due_grains()
    type(cloud_t) :: cloud
    type(decomposition_t) :: decomposition
    type(halo_t) :: seen
    integer :: g

    call cloud%init(2, n_grains, 0.03_dp, 0.1_dp, 70)
    decomposition%rule = cloud%rule(alert, skin, rule_dual)
    call make_decomposition(comm, cloud, 5, 2, .false., decomposition)
    seen%memory%n_impulse = 2
    call seen%build(decomposition)
    do g = 1, n_grains, 23
      call shift_grain(decomposition, g, 0.49_dp*skin)
      call check(.not. seen%are_due(decomposition), "a grain within half the skin")
      call shift_grain(decomposition, g, 0.02_dp*skin)
      call check(seen%are_due(decomposition), "a grain beyond half the skin")
      call shift_grain(decomposition, g, -0.51_dp*skin)
      call check(.not. seen%are_due(decomposition), "a grain that came back")
    end do
  end subroutine test_due_grains

  subroutine shift_grain(decomposition, g, way)
    type(decomposition_t), intent(inout) :: decomposition
    integer, intent(in) :: g
    real(dp), intent(in) :: way
    integer :: s

    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        where (owned%id == g) owned%position(2, :) = owned%position(2, :) - way
      end associate
    end do
  end subroutine shift_grain

  !> The way of a boundary adds to that of the grains; what its surface does not feel does not count.
  subroutine test_due_boundaries()
    type(boundary_t) :: b
    real(dp), parameter :: floor(3) = [0.0_dp, 0.0_dp, -5.0_dp], up(3) = [0.0_dp, 0.0_dp, 1.0_dp]

    b = plane(1000, floor, up)
    b%velocity(:) = [5.0_dp, 0.0_dp, 0.9_dp]
    call check(.not. due_after(b, 0.0_dp), "a plane that slides and rises by less than the skin")
    b%velocity(:) = [5.0_dp, 0.0_dp, 1.1_dp]
    call check(due_after(b, 0.0_dp), "a plane that rises by more")
    b%velocity(:) = [0.0_dp, 0.0_dp, -0.6_dp]
    call check(.not. due_after(b, 0.39_dp), "a plane and grains, less than the skin")
    call check(due_after(b, 0.41_dp), "a plane and grains, more than the skin")
    call change_shape("outlet", b)
    call check(.not. due_after(b, 0.41_dp), "an outlet has no surface")
    deallocate (b%surface)
    call check(.not. due_after(b, 0.41_dp), "nor has a boundary of grains")
    b = plane(1000, floor, up)
    b%velocity(3) = 8.0_dp
    b%present = .false.
    call check(.not. due_after(b, 0.41_dp), "a boundary that was removed")
    b = plane(1000, floor, up)
    b%spin(1) = 1.0e-3_dp
    call check(due_after(b, 0.0_dp), "a plane that tilts")
    b = plane(1000, floor, [0.0_dp, 0.0_dp, 0.0_dp])
    call change_shape("segment", b)
    b%surface%edge(1, 1) = 2.0_dp
    b%spin(3) = 0.45_dp
    call check(.not. due_after(b, 0.0_dp), "a segment whose end goes less far than the skin")
    b%spin(3) = 0.55_dp
    call check(due_after(b, 0.0_dp), "a segment whose end goes farther")
    b = plane(1000, floor, [0.0_dp, 0.0_dp, 0.0_dp])
    call change_shape("circle", b)
    b%spin(3) = 10.0_dp
    call check(.not. due_after(b, 0.0_dp), "a circle that turns about its centre")
    b%velocity(2) = 1.1_dp
    call check(due_after(b, 0.0_dp), "a circle that moves")
    b = plane(1000, floor, [0.48_dp, 0.6_dp, 0.64_dp])
    call change_shape("cylinder", b)
    b%spin(:) = 1000.0_dp*b%surface%axis
    call check(.not. due_after(b, 0.0_dp), "a drum that turns about its axis")
    b%spin(1) = -10.0_dp
    call check(due_after(b, 0.0_dp), "a drum that tilts")
  end subroutine test_due_boundaries

  !> Whether lists are due when a boundary has moved for a time equal to the skin, and grains by a part of the skin.
  logical function due_after(boundary, part) result(due)
    type(boundary_t), intent(in) :: boundary
    real(dp), intent(in) :: part
    type(cloud_t) :: cloud
    type(decomposition_t) :: decomposition
    type(halo_t) :: seen
    integer :: k

    call cloud%init(3, 20, 0.03_dp, 0.1_dp, 70)
    decomposition%rule = cloud%rule(alert, skin, rule_dual)
    allocate (decomposition%boundaries(2))
    decomposition%boundaries(1) = plane(999, [0.0_dp, 0.0_dp, -9.0_dp], [0.0_dp, 0.0_dp, 1.0_dp])
    decomposition%boundaries(2) = boundary
    call make_decomposition(comm, cloud, 3, 3, .false., decomposition)
    seen%memory%n_impulse = 2
    call seen%build(decomposition)
    ! in several steps, as the axis of a drum picks up roundings
    do k = 1, 300
      call decomposition%boundaries(2)%move(skin/300.0_dp)
    end do
    call move(decomposition, cloud, 1, part*skin)
    due = seen%are_due(decomposition)
  end function due_after

end program test_neighbourhood
