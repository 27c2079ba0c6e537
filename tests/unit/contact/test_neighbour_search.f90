!> A partition of space for tests of the search.
module test_search_region
  use gravier_kinds, only: dp
  use gravier_region, only: region_t
  implicit none
  private
  public :: sites_t

  !> Points belong to the nearest of some sites: a partition that knows no axes.
  type, extends(region_t) :: sites_t
    !> (nd, number of subdomains)
    real(dp), allocatable :: site(:, :)
  contains
    procedure :: owner => sites_owner
  end type sites_t

contains

  pure integer function sites_owner(self, point) result(subdomain)
    class(sites_t), intent(in) :: self
    real(dp), intent(in) :: point(:)
    real(dp) :: least, distance
    integer :: s

    subdomain = 0
    least = huge(1.0_dp)
    do s = 1, size(self%site, 2)
      distance = sum((point - self%site(:, s))**2)
      if (distance < least) then
        least = distance
        subdomain = s
      end if
    end do
  end function sites_owner

end module test_search_region

!> The search for near pairs against the comparison of all pairs, over the subdomains of a partition: every pair once, in
!> the right subdomain, in sweep order, whatever the order of the bodies, the sizes of the grains and the periodic axes.
program test_neighbour_search
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp, i8
  use gravier_periodic, only: period_t, no_shift, shift_code, shift_of_code
  use gravier_body_store, only: body_layout_t, body_set_t
  use gravier_boundary, only: boundary_t
  use gravier_neighbour_list, only: neighbour_list_t, pair_memory_t
  use gravier_neighbour_rule, only: neighbour_rule_t, owner_point, rule_dual, rule_primal
  use gravier_cell_order, only: sweep_order
  use gravier_neighbour_search, only: neighbour_search_t
  use gravier_test_scenes, only: cloud_t, near_pair_t, draw, plane, change_shape
  use test_search_region, only: sites_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  !> from which the cells of orders are counted [m]
  real(dp), parameter :: corner(3) = [0.1_dp, -0.3_dp, 0.7_dp], origin(3) = 0.0_dp
  integer :: k, axes

  call MPI_Init()
  do axes = 0, 3
    call test_random(2, axes, axes)
  end do
  do axes = 0, 7
    call test_random(3, axes, 10 + axes)
  end do
  do k = 2, 3
    call test_sizes(k, 0)
    call test_sizes(k, 2**k - 1)
    call test_far_grains(k)
  end do
  call test_rule()
  call test_range()
  call test_corner_pair(2)
  call test_corner_pair(3)
  call test_boundaries()
  call test_glued()
  call test_few_bodies()
  call test_sweep_order()
  call finish_checks()
  call MPI_Finalize()

contains

  !> Grains of radii from 0.02 to 0.1, by both rules, in one subdomain and in seven.
  subroutine test_random(nd, axes, seed)
    integer, intent(in) :: nd, axes, seed
    type(cloud_t) :: cloud

    call cloud%init(nd, 150, 0.02_dp, 0.1_dp, seed)
    call cloud%make_periodic(axes)
    call compare_rules(cloud, 0.02_dp, 0.03_dp)
  end subroutine test_random

  !> Radii from 0.001 to 0.1, each grain near the surface of one before it, so that neighbours are of all sizes.
  subroutine test_sizes(nd, axes)
    integer, intent(in) :: nd, axes
    type(cloud_t) :: cloud
    integer :: g, parent, d, turns(nd)
    real(dp) :: way(nd)

    call cloud%init(nd, 500, 0.0_dp, 1.0_dp, 31)
    call cloud%make_periodic(axes)
    do g = 1, cloud%n
      cloud%radius(g) = 0.1_dp*0.01_dp**draw(32, g, 1)
      if (g < 6) cycle
      parent = 1 + int((g - 1)*draw(32, g, 2))
      do d = 1, nd
        way(d) = draw(32, g, 2 + d) - 0.5_dp
      end do
      cloud%place(:, g) = cloud%place(:, parent) + 1.002_dp*(cloud%radius(g) + cloud%radius(parent))*way/norm2(way)
      call cloud%period%wrap(cloud%place(:, g), turns)
    end do
    call check(maxval(cloud%radius) > 50*minval(cloud%radius), "grains of very different sizes")
    call compare_rules(cloud, 0.0005_dp, 0.0005_dp)
  end subroutine test_sizes

  subroutine compare_rules(cloud, alert, skin)
    type(cloud_t), intent(in) :: cloud
    real(dp), intent(in) :: alert, skin
    type(sites_t) :: sites, whole
    type(body_set_t) :: bodies
    integer :: kind

    call make_sites(cloud%nd, 1, whole)
    call make_sites(cloud%nd, 7, sites)
    call shuffled_bodies(cloud, 1, bodies)
    do kind = rule_dual, rule_primal
      call compare(cloud, bodies, cloud%rule(alert, skin, kind), whole)
      call compare(cloud, bodies, cloud%rule(alert, skin, kind), sites)
    end do
    call test_input_order(cloud, cloud%rule(alert, skin, rule_dual), sites)
  end subroutine compare_rules

  subroutine make_sites(nd, n, sites)
    integer, intent(in) :: nd, n
    type(sites_t), intent(out) :: sites
    integer :: s, d

    allocate (sites%site(nd, n))
    do s = 1, n
      do d = 1, nd
        sites%site(d, s) = draw(500, s, d)
      end do
    end do
  end subroutine make_sites

  !> All grains, in an order of their own; the number of grains must have no divisor of the step.
  subroutine shuffled_bodies(cloud, step, bodies)
    type(cloud_t), intent(in) :: cloud
    integer, intent(in) :: step
    type(body_set_t), intent(inout) :: bodies
    integer :: order(cloud%n), k

    call cloud%bodies(cloud%nd, 1, 1, bodies)
    do k = 1, cloud%n
      order(k) = 1 + mod(step*k, cloud%n)
    end do
    call bodies%reorder(order)
  end subroutine shuffled_bodies

  subroutine find_homes(bodies, region, owned)
    type(body_set_t), intent(in) :: bodies
    type(sites_t), intent(in) :: region
    integer, allocatable, intent(out) :: owned(:)
    integer :: k

    allocate (owned(bodies%n))
    do k = 1, bodies%n
      owned(k) = region%owner(bodies%position(:, k))
    end do
  end subroutine find_homes

  !> Two planes, one of them with grains behind it.
  subroutine make_two_planes(nd, boundaries)
    integer, intent(in) :: nd
    type(boundary_t), intent(out) :: boundaries(2)
    real(dp) :: normal(nd), point(nd)

    normal(:) = 0.0_dp
    point(:) = 0.0_dp
    normal(nd) = 1.0_dp
    boundaries(1) = plane(1001, point, normal)
    normal(1) = 0.6_dp
    normal(nd) = 0.8_dp
    point(1) = 0.3_dp
    boundaries(2) = plane(1002, point, normal)
  end subroutine make_two_planes

  !> Pairs of all subdomains against all pairs.
  subroutine compare(cloud, bodies, rule, region)
    type(cloud_t), intent(in) :: cloud
    type(body_set_t), intent(in) :: bodies
    type(neighbour_rule_t), intent(in) :: rule
    type(sites_t), intent(in) :: region
    type(neighbour_list_t) :: list
    type(boundary_t), target :: boundaries(2)
    !> subdomain of each pair found, and of each grain near a boundary; -1 where it was found twice
    integer, allocatable :: found(:, :, :), near(:, :), owned(:)
    integer :: s, p, i, j
    logical :: right, ordered

    call make_two_planes(cloud%nd, boundaries)
    call find_homes(bodies, region, owned)
    allocate (found(cloud%n, cloud%n, 0:124), near(cloud%n, 2), source=0)
    right = .true.
    ordered = .true.
    do s = 1, size(region%site, 2)
      call find_pairs(neighbour_search_t(rule, cloud%period, boundaries, s, corner=corner), bodies, owned, &
        & region, pair_memory_t(3), list)
      right = right .and. size(list%candidate) == list%n .and. size(list%impulse, 1) == 3 .and. size(list%impulse, 2) == list%n
      right = right .and. size(list%shift) == merge(list%n, 0, cloud%period%on()) .and. all(abs(list%impulse) <= 0.0_dp)
      do p = 1, list%n
        i = int(bodies%id(list%candidate(p)))
        j = list%antagonist(p)
        if (j < 0) then
          near(i, -j) = merge(s, -1, near(i, -j) == 0)
        else
          j = int(bodies%id(j))
          right = right .and. i < j
          associate (owner => found(i, j, code_of(list, p)))
            owner = merge(s, -1, owner == 0)
          end associate
        end if
      end do
      ordered = ordered .and. in_sweep_order(cloud, bodies, rule, list)
    end do
    call check(right, "sizes; the candidate has the lower identifier")
    call check(ordered, "pairs by cell of the owner point, candidate, antagonist with boundaries first")
    call check_pairs(cloud, rule, region, found)
    call check_near(cloud, rule, region, boundaries, near)
  end subroutine compare

  pure integer function code_of(list, p)
    type(neighbour_list_t), intent(in) :: list
    integer, intent(in) :: p
    code_of = no_shift
    if (size(list%shift) > 0) code_of = list%shift(p)
  end function code_of

  subroutine check_pairs(cloud, rule, region, found)
    type(cloud_t), intent(in) :: cloud
    type(neighbour_rule_t), intent(in) :: rule
    type(sites_t), intent(in) :: region
    integer, intent(in) :: found(:, :, 0:)
    type(near_pair_t), allocatable :: pairs(:)
    real(dp) :: point(cloud%nd), other(cloud%nd)
    integer :: p, turns(cloud%nd), across
    logical :: once, owned

    call cloud%near_pairs(rule%alert_distance + rule%skin, pairs)
    once = .true.
    owned = .true.
    across = 0
    do p = 1, size(pairs)
      point(:) = cloud%place(:, pairs(p)%i)
      call cloud%find_antagonist(pairs(p), other)
      if (rule%kind == rule_dual) point(:) = (point + other)/2
      call cloud%period%wrap(point, turns)
      associate (owner => found(pairs(p)%i, pairs(p)%j, shift_code(pairs(p)%shift)))
        once = once .and. owner > 0
        owned = owned .and. owner == region%owner(point)
      end associate
      if (any(pairs(p)%shift /= 0)) across = across + 1
    end do
    call check(once .and. count(found /= 0) == size(pairs), "every near pair once, and no other")
    call check(owned, "each pair in the subdomain of its owner point")
    call check(size(pairs) > 100, "enough pairs to tell")
    if (cloud%period%on()) call check(across > 5, "enough pairs across periods to tell")
  end subroutine check_pairs

  subroutine check_near(cloud, rule, region, boundaries, near)
    type(cloud_t), intent(in) :: cloud
    type(neighbour_rule_t), intent(in) :: rule
    type(sites_t), intent(in) :: region
    type(boundary_t), intent(in) :: boundaries(:)
    integer, intent(in) :: near(:, :)
    integer :: g, b, nd
    logical :: right

    nd = cloud%nd
    right = .true.
    do g = 1, cloud%n
      do b = 1, size(boundaries)
        if (dot_product(cloud%place(:, g) - boundaries(b)%surface%point(1:nd), boundaries(b)%surface%axis(1:nd)) - &
          & cloud%radius(g) <= rule%alert_distance + rule%skin) then
          right = right .and. near(g, b) == region%owner(cloud%place(:, g))
        else
          right = right .and. near(g, b) == 0
        end if
      end do
    end do
    call check(right, "grains near boundaries, each in the subdomain of its centre")
  end subroutine check_near

  !> Whether pairs ascend by cell of the point, candidate, antagonist (minus the number of a boundary).
  logical function in_sweep_order(cloud, bodies, rule, list) result(ordered)
    type(cloud_t), intent(in) :: cloud
    type(body_set_t), intent(in) :: bodies
    type(neighbour_rule_t), intent(in) :: rule
    type(neighbour_list_t), intent(in) :: list
    integer(i8) :: key(5, list%n)
    real(dp) :: point(cloud%nd, list%n), other(cloud%nd), edge
    integer :: p, d, shift(3)

    ordered = .true.
    if (list%n == 0) return
    key(:, :) = 0
    do p = 1, list%n
      point(:, p) = bodies%position(:, list%candidate(p))
      key(4, p) = bodies%id(list%candidate(p))
      key(5, p) = list%antagonist(p)
      if (list%antagonist(p) < 0) cycle
      key(5, p) = bodies%id(list%antagonist(p))
      shift(:) = shift_of_code(code_of(list, p))
      other(:) = bodies%position(:, list%antagonist(p)) + shift(1:cloud%nd)*cloud%period%length(1:cloud%nd)
      if (rule%kind == rule_dual) point(:, p) = 0.5_dp*(point(:, p) + other)
    end do
    edge = 2.0_dp*rule%mean_radius + rule%alert_distance
    do d = 1, cloud%nd
      ! half of the cells lie before the corner; farther out are the first ones, and the numbers of cells begin again
      key(4 - d, :) = mod(int(max((point(d, :) - corner(d))/edge + 2.0_dp**18, 0.0_dp), i8), 2_i8**19)
    end do
    do p = 2, list%n
      do d = 1, 5
        if (key(d, p - 1) == key(d, p)) cycle
        ordered = ordered .and. key(d, p - 1) < key(d, p)
        exit
      end do
    end do
  end function in_sweep_order

  !> The same bodies in another order give the same pairs in the same order.
  subroutine test_input_order(cloud, rule, region)
    type(cloud_t), intent(in) :: cloud
    type(neighbour_rule_t), intent(in) :: rule
    type(sites_t), intent(in) :: region
    type(body_set_t) :: bodies(2)
    type(neighbour_list_t) :: list(2)
    type(boundary_t), target :: boundaries(2)
    integer, allocatable :: owned(:)
    integer :: s, k, p
    logical :: same

    call make_two_planes(cloud%nd, boundaries)
    same = .true.
    do s = 1, size(region%site, 2)
      do k = 1, 2
        call shuffled_bodies(cloud, merge(53, 67, k == 1), bodies(k))
        call find_homes(bodies(k), region, owned)
        call find_pairs(neighbour_search_t(rule, cloud%period, boundaries, s), bodies(k), owned, region, pair_memory_t(1), list(k))
      end do
      same = same .and. list(1)%n == list(2)%n
      if (.not. same) exit
      do p = 1, list(1)%n
        same = same .and. antagonist_id(bodies(1), list(1), p) == antagonist_id(bodies(2), list(2), p)
        same = same .and. code_of(list(1), p) == code_of(list(2), p)
        same = same .and. bodies(1)%id(list(1)%candidate(p)) == bodies(2)%id(list(2)%candidate(p))
      end do
    end do
    call check(same, "the order of the bodies does not matter")
  end subroutine test_input_order

  !> Identifier of a grain, or minus the number of a boundary.
  pure integer(i8) function antagonist_id(bodies, list, p) result(id)
    type(body_set_t), intent(in) :: bodies
    type(neighbour_list_t), intent(in) :: list
    integer, intent(in) :: p
    id = list%antagonist(p)
    if (id > 0) id = bodies%id(list%antagonist(p))
  end function antagonist_id

  !> Grains 1000 km away, on either side, change nothing for the others, and find each other.
  subroutine test_far_grains(nd)
    integer, intent(in) :: nd
    type(cloud_t) :: cloud
    integer :: k, g

    do k = 1, 3
      call cloud%init(nd, 151, 0.02_dp, 0.1_dp, 40 + k)
      if (k /= 2) cloud%place(1, 7) = 1.0e6_dp
      if (k /= 1) cloud%place(nd, 8) = -1.0e6_dp
      if (k == 3) then
        do g = 100, 120
          cloud%place(:, g) = cloud%place(:, g) - 1.0e6_dp
        end do
      end if
      call compare_rules(cloud, 0.02_dp, 0.03_dp)
    end do
  end subroutine test_far_grains

  subroutine test_rule()
    type(neighbour_rule_t) :: rule

    rule%alert_distance = 0.25_dp
    rule%skin = 0.5_dp
    rule%largest_radius = 2.0_dp
    rule%mean_radius = 1.5_dp
    rule%largest_extent = 2.25_dp
    call check_close(rule%range(), 0.75_dp, 0.0_dp, "range of the lists")
    call check_close(rule%reach(1.0_dp, 0.0_dp), 1.875_dp, 0.0_dp, "reach of a midpoint")
    rule%kind = rule_primal
    call check_close(rule%reach(1.0_dp, 0.0_dp), 3.75_dp, 0.0_dp, "reach of a candidate")
    ! 8 s of way, at most 0.5 m
    rule%duration = 8.0_dp
    rule%most_travel = 0.5_dp
    call check_close(rule%margin(0.015625_dp), 0.25_dp, 0.0_dp, "margin of a slow grain")
    call check_close(rule%margin(0.046875_dp), 0.375_dp, 0.0_dp, "margin of a fast grain")
    call check_close(rule%margin(1.0_dp), 0.5_dp, 0.0_dp, "largest margin")
    call check_close(rule%reach(1.0_dp, 1.0_dp), 4.0_dp, 0.0_dp, "reach of a fast candidate")
    call check_close(rule%range(), 1.25_dp, 0.0_dp, "range of the lists of fast grains")
    call check_close(rule%cell_edge(), 5.25_dp, 0.0_dp, "edge of a cell of a subdomain, primal")
    rule%kind = rule_dual
    call check_close(rule%cell_edge(), 4.75_dp, 0.0_dp, "edge of a cell of a subdomain, dual")
    call check_close(rule%sweep_edge(), 3.25_dp, 0.0_dp, "edge of a cell of the sweep")
    call check_point(rule_dual, 1.5_dp, 3.5_dp, "midpoint")
    call check_point(rule_primal, 1.0_dp, 2.0_dp, "candidate")
  end subroutine test_rule

  subroutine check_point(kind, x, y, name)
    integer, intent(in) :: kind
    real(dp), intent(in) :: x, y
    character(len=*), intent(in) :: name
    real(dp), parameter :: candidate(2) = [1.0_dp, 2.0_dp], antagonist(2) = [2.0_dp, 5.0_dp]
    real(dp) :: point(2)

    point(:) = owner_point(kind, candidate, antagonist)
    call check_close(point(1), x, 0.0_dp, name//", x")
    call check_close(point(2), y, 0.0_dp, name//", y")
  end subroutine check_point

  !> Grains of radius 1 at `x` (nd, n), in one subdomain.
  subroutine unit_bodies(x, bodies)
    real(dp), intent(in) :: x(:, :)
    type(body_set_t), intent(inout) :: bodies
    integer :: k

    call bodies%init(body_layout_t(size(x, 1), size(x, 1), 0), size(x, 2))
    do k = 1, bodies%n
      bodies%id(k) = 10 - k
      bodies%position(:, k) = x(:, k)
    end do
    bodies%velocity(:, :) = 0.0_dp
    bodies%radius(:) = 1.0_dp
    bodies%mass(:) = 1.0_dp
    bodies%glued(:) = 0
  end subroutine unit_bodies

  !> Pairs of unit grains and boundaries with a range of 1/2.
  subroutine list_units(bodies, boundaries, period, list)
    type(body_set_t), intent(in) :: bodies
    type(boundary_t), intent(in), target :: boundaries(:)
    type(period_t), intent(in) :: period
    type(neighbour_list_t), intent(inout) :: list
    type(neighbour_rule_t) :: rule
    type(sites_t) :: whole
    integer :: owned(bodies%n)

    rule%alert_distance = 0.125_dp
    rule%skin = 0.375_dp
    rule%largest_radius = 1.0_dp
    rule%mean_radius = 1.0_dp
    call make_sites(bodies%nd, 1, whole)
    owned(:) = 1
    call find_pairs(neighbour_search_t(rule, period, boundaries, 1), bodies, owned, whole, pair_memory_t(1), list)
  end subroutine list_units

  !> A gap equal to alert distance and skin is listed, a larger one is not; all numbers are exact in binary.
  subroutine test_range()
    real(dp), parameter :: high = 50.0_dp, more = 1.0e-9_dp
    call check_equal(count_pairs(0.0_dp, high, 2.5_dp, high), 1, "grains at the range")
    call check_equal(count_pairs(0.0_dp, high, 2.5_dp + more, high), 0, "grains beyond it")
    call check_equal(count_pairs(0.0_dp, high, 0.0_dp, high), 1, "coincident centres")
    call check_equal(count_pairs(0.0_dp, 1.5_dp, 9.0_dp, high), 1, "ground at the range")
    call check_equal(count_pairs(0.0_dp, 1.5_dp + more, 9.0_dp, high), 0, "ground beyond it")
    call check_equal(count_pairs(0.0_dp, -3.0_dp, 9.0_dp, high), 1, "a grain behind the plane")
    call check_equal(count_pairs(0.0_dp, 1.0_dp, 2.0_dp, 1.0_dp), 3, "two grains on the ground")
  end subroutine test_range

  !> Pairs of two grains and the ground.
  integer function count_pairs(x1, y1, x2, y2)
    real(dp), intent(in) :: x1, y1, x2, y2
    type(body_set_t) :: bodies
    type(neighbour_list_t) :: list
    type(period_t) :: period
    type(boundary_t) :: ground(1)
    real(dp) :: x(2, 2)

    x(1, 1) = x1
    x(2, 1) = y1
    x(1, 2) = x2
    x(2, 2) = y2
    call unit_bodies(x, bodies)
    ground(1) = plane(100, [0.0_dp, 0.0_dp], [0.0_dp, 1.0_dp])
    call list_units(bodies, ground, period, list)
    count_pairs = list%n
  end function count_pairs

  !> Two grains at opposite corners of a periodic cell meet across all axes at once.
  subroutine test_corner_pair(nd)
    integer, intent(in) :: nd
    type(body_set_t) :: bodies
    type(neighbour_list_t) :: list
    type(period_t) :: period
    type(boundary_t) :: none(0)
    real(dp) :: x(nd, 2)
    integer :: shift(3)

    period%length(1:nd) = 16.0_dp
    period%origin(1:nd) = -3.0_dp
    x(:, 1) = -2.5_dp
    x(:, 2) = 12.5_dp
    call unit_bodies(x, bodies)
    call list_units(bodies, none, period, list)
    call check_equal(list%n, 1, "one pair across a corner")
    if (list%n /= 1) return
    call check(bodies%id(list%candidate(1)) == 8 .and. bodies%id(list%antagonist(1)) == 9, "the candidate is the lower one")
    shift(:) = shift_of_code(list%shift(1))
    call check(all(shift(1:nd) == 1) .and. all(shift(nd + 1:) == 0), "shift of the antagonist")
  end subroutine test_corner_pair

  !> Boundaries that are there and have a surface, by their numbers; the one inside of which a grain is, too.
  subroutine test_boundaries()
    type(body_set_t) :: bodies
    type(neighbour_list_t) :: list
    type(period_t) :: period
    type(boundary_t) :: boundaries(5)
    integer :: b

    call unit_bodies(reshape([0.0_dp, 1.0_dp], [2, 1]), bodies)
    do b = 1, 5
      boundaries(b) = plane(100 + b, [0.0_dp, 0.0_dp], [0.0_dp, 1.0_dp])
    end do
    boundaries(1)%present = .false.
    deallocate (boundaries(2)%surface)
    call change_shape("outlet", boundaries(3))
    call change_shape("circle", boundaries(4))
    boundaries(4)%surface%axis(:) = 0.0_dp
    boundaries(4)%surface%radius = 2.5_dp
    call list_units(bodies, boundaries, period, list)
    call check_equal(list%n, 2, "boundaries with a surface that are there")
    if (list%n /= 2) return
    call check_equal(list%antagonist(1), -5, "minus the number of a boundary: they ascend")
    call check_equal(list%antagonist(2), -4, "the circle")
  end subroutine test_boundaries

  !> Glued grains have pairs with free ones only.
  subroutine test_glued()
    type(body_set_t) :: bodies
    type(neighbour_list_t) :: list
    type(period_t) :: period
    type(boundary_t) :: ground(1)

    ground(1) = plane(100, [0.0_dp, 0.0_dp], [0.0_dp, 1.0_dp])
    call unit_bodies(reshape([0.0_dp, 1.0_dp, 2.0_dp, 1.0_dp, 1.0_dp, 2.5_dp], [2, 3]), bodies)
    bodies%glued(1:2) = 1
    call list_units(bodies, ground, period, list)
    call check_equal(list%n, 2, "two glued grains and a free one")
    call check(all(list%candidate == 3) .and. all(list%antagonist > 0), "pairs of the free one")
  end subroutine test_glued

  !> No grain, and one grain, of no size too.
  subroutine test_few_bodies()
    type(body_set_t) :: bodies
    type(neighbour_list_t) :: list
    type(neighbour_rule_t) :: point_like
    type(period_t) :: period
    type(boundary_t), target :: ground(1)
    type(sites_t) :: whole
    real(dp) :: x(2, 1)
    integer, parameter :: owned(2) = 1

    ground(1) = plane(100, [0.0_dp, 0.0_dp], [0.0_dp, 1.0_dp])
    call unit_bodies(x(:, 1:0), bodies)
    call list_units(bodies, ground, period, list)
    call check_equal(list%n, 0, "no grain, no pair")
    x(:, :) = 1.0_dp
    call unit_bodies(x, bodies)
    call list_units(bodies, ground, period, list)
    call check_equal(list%n, 1, "one grain on the ground")
    call check_equal(list%antagonist(1), -1, "the ground is minus its number")
    call check_equal(list%candidate(1), 1, "the grain is the candidate")
    call unit_bodies(reshape([1.0_dp, 2.0_dp, 1.0_dp, 2.0_dp], [2, 2]), bodies)
    bodies%radius(:) = 0.0_dp
    call make_sites(2, 1, whole)
    call find_pairs(neighbour_search_t(point_like, period, ground, 1), bodies, owned, whole, pair_memory_t(1), list)
    call check_equal(list%n, 1, "points that coincide")
  end subroutine test_few_bodies

  !> Along x first, then up; by identifier within a cell.
  subroutine test_sweep_order()
    real(dp) :: points(2, 6)
    integer(i8) :: id(1, 6)
    integer :: order(6)
    integer, parameter :: expected(6) = [3, 1, 6, 5, 2, 4]

    points(1, :) = [-0.5_dp, 0.5_dp, -0.75_dp, 1.5_dp, -0.5_dp, 8.5_dp]
    points(2, :) = [-0.5_dp, 0.5_dp, -0.25_dp, 0.5_dp, 0.5_dp, -0.5_dp]
    id(1, :) = [5_i8, 1_i8, 3_i8, 2_i8, 9_i8, 4_i8]
    call sweep_order(points, origin(1:2), 1.0_dp, id, order)
    call check(all(order == expected), "sweep order")
    ! in two cells, whose border no other point decides on
    points(1, 1:2) = [0.95_dp, 1.05_dp]
    points(2, 1:2) = 0.0_dp
    id(1, 1:2) = [2_i8, 1_i8]
    call sweep_order(points(:, 1:2), origin(1:2), 1.0_dp, id(:, 1:2), order(1:2))
    call check(all(order(1:2) == [1, 2]), "sweep order of two points alone")
    call test_many_in_a_cell()
  end subroutine test_sweep_order

  !> Points of one cell are sorted by their identifiers, few as well as many.
  subroutine test_many_in_a_cell()
    integer, parameter :: n(3) = [2, 32, 500]
    real(dp), allocatable :: points(:, :)
    integer(i8), allocatable :: id(:, :)
    integer, allocatable :: order(:)
    integer :: k, j
    logical :: sorted

    do k = 1, size(n)
      allocate (points(3, n(k)), id(2, n(k)), order(n(k)))
      points(:, :) = 0.5_dp
      do j = 1, n(k)
        id(1, j) = mod(7*j, 5)
        id(2, j) = n(k) - j
      end do
      call sweep_order(points, origin, 1.0_dp, id, order)
      sorted = .true.
      do j = 2, n(k)
        sorted = sorted .and. (id(1, order(j)) > id(1, order(j - 1)) .or. &
          & (id(1, order(j)) == id(1, order(j - 1)) .and. id(2, order(j)) > id(2, order(j - 1))))
      end do
      call check(sorted, "points of a cell by their identifiers")
      deallocate (points, id, order)
    end do
  end subroutine test_many_in_a_cell

  !> One search, as of a subdomain.
  subroutine find_pairs(search, bodies, owned, region, memory, list)
    type(neighbour_search_t), intent(in) :: search
    type(body_set_t), intent(in) :: bodies
    integer, intent(in), contiguous :: owned(:)
    type(sites_t), intent(in) :: region
    type(pair_memory_t), intent(in) :: memory
    type(neighbour_list_t), intent(inout) :: list
    call search%find(bodies, owned, region, memory, list)
  end subroutine find_pairs

end program test_neighbour_search
