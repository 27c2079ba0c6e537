!> A partition of space for tests of detection.
module test_detection_region
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

end module test_detection_region

!> Contact detection against the comparison of all pairs, over the subdomains of partitions: every contact once, in the
!> right subdomain, with the right geometry, in an order that the order of the bodies does not change.
program test_detection
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_random_hash, only: hash_uniform
  use gravier_body_store, only: body_set_t, wall_set_t
  use gravier_region, only: region_t
  use gravier_cell_grid, only: cell_grid_t
  use gravier_contact_list, only: contact_list_t
  use gravier_detection, only: detection_rule_t, detect_contacts, sort_bodies, owner_point, rule_dual, rule_primal
  use gravier_partition, only: partition_t
  use test_detection_region, only: sites_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  integer :: k

  call MPI_Init()
  do k = 1, 4
    call test_random(2, 0.02_dp, k)
    call test_random(3, 0.02_dp, 10 + k)
  end do
  ! far alert: more contacts than the list has room for at first
  call test_random(2, 0.5_dp, 21)
  call test_random(3, 0.5_dp, 22)
  call test_random(2, 0.0_dp, 23)
  call test_sorted_bodies()
  call test_alert_distance()
  call test_coincident_centres(2)
  call test_coincident_centres(3)
  call test_owner_point()
  call test_few_bodies()
  call finish_checks()
  call MPI_Finalize()

contains

  real(dp) function draw(trial, k, stream)
    integer, intent(in) :: trial, k, stream
    draw = hash_uniform(trial, int(k, i8), stream)
  end function draw

  !> 150 grains, radii from 0.02 to 0.15, in a unit box that some stick out of; identifiers in no order, with gaps.
  subroutine make_scene(nd, trial, bodies, walls)
    integer, intent(in) :: nd, trial
    type(body_set_t), intent(out) :: bodies
    type(wall_set_t), intent(out) :: walls
    integer, parameter :: n = 150
    integer :: b, d

    call bodies%init(nd, nd, n)
    do b = 1, n
      bodies%id(b) = 3_i8*mod(67*b + trial, n) + 10
      bodies%radius(b) = 0.02_dp + 0.13_dp*draw(trial, b, 1)**(6 - nd - mod(trial, 2))
      do d = 1, nd
        bodies%position(d, b) = draw(trial, b, 1 + d)
        bodies%velocity(d, b) = 0.0_dp
      end do
      bodies%mass(b) = 1.0_dp
      bodies%inertia(b) = 1.0_dp
    end do
    walls%n = 3
    allocate (walls%id(3), walls%point(nd, 3), walls%normal(nd, 3))
    walls%id(1) = 1001
    walls%id(2) = 1003
    walls%id(3) = 1002
    walls%point(:, :) = 0.0_dp
    walls%point(1, 2) = 1.0_dp
    walls%normal(:, :) = 0.0_dp
    walls%normal(nd, 1) = 1.0_dp
    walls%normal(1, 2) = -1.0_dp
    walls%normal(1, 3) = 0.6_dp
    walls%normal(nd, 3) = 0.8_dp
    ! some grains are behind this one
    walls%point(1, 3) = 0.3_dp
  end subroutine make_scene

  subroutine test_random(nd, alert, trial)
    integer, intent(in) :: nd, trial
    real(dp), intent(in) :: alert
    type(body_set_t) :: bodies
    type(wall_set_t) :: walls
    type(detection_rule_t) :: rule
    type(partition_t) :: grid
    type(sites_t) :: sites, whole
    type(error_t), allocatable :: error
    real(dp) :: lower(nd), upper(nd)
    integer :: s, d, kind, boxes(3)

    call make_scene(nd, trial, bodies, walls)
    rule%alert_distance = alert
    rule%largest_radius = maxval(bodies%radius)
    lower(:) = 0.0_dp
    upper(:) = 1.0_dp
    boxes(1) = 3
    boxes(2) = 2
    boxes(3) = nd - 1
    call grid%init_grid(lower, upper, boxes, 0.1_dp, error)
    allocate (whole%site(nd, 1), source=0.0_dp)
    allocate (sites%site(nd, 7))
    do s = 1, 7
      do d = 1, nd
        sites%site(d, s) = draw(trial + 500, s, d)
      end do
    end do
    do kind = rule_dual, rule_primal
      rule%kind = kind
      call compare(bodies, walls, rule, whole, 1)
      call compare(bodies, walls, rule, grid, 6*(nd - 1))
      call compare(bodies, walls, rule, sites, 7)
    end do
    call test_input_order(bodies, walls, rule, sites, trial)
  end subroutine test_random

  !> Contacts of all subdomains against all pairs.
  subroutine compare(bodies, walls, rule, region, n_subdomains)
    type(body_set_t), intent(in) :: bodies
    type(wall_set_t), intent(in) :: walls
    type(detection_rule_t), intent(in) :: rule
    class(region_t), intent(in) :: region
    integer, intent(in) :: n_subdomains
    type(body_set_t) :: sorted
    type(contact_list_t) :: contacts
    type(cell_grid_t) :: grid
    integer, allocatable :: order(:), first(:), found(:, :)
    integer :: s, c, i, j
    logical :: right, owned, ordered

    sorted = bodies
    call sort_bodies(sorted, 2*rule%largest_radius + rule%alert_distance, grid, order, first)
    call sorted%reorder(order)
    ! found(i, j): times that bodies i and j (or wall -j) were found
    allocate (found(sorted%n, -walls%n:sorted%n), source=0)
    right = .true.
    owned = .true.
    ordered = .true.
    do s = 1, n_subdomains
      call detect_contacts(sorted, grid, first, walls, region, s, rule, contacts)
      do c = 1, contacts%n
        i = contacts%candidate(c)
        j = contacts%antagonist(c)
        found(i, j) = found(i, j) + 1
        if (j > 0) right = right .and. sorted%id(i) < sorted%id(j)
        right = right .and. right_geometry(sorted, walls, contacts, c)
        owned = owned .and. right_owner(sorted, walls, rule, region, contacts, c) == s
        if (c > 1) ordered = ordered .and. precedes(sorted, walls, grid, contacts, c - 1, c)
      end do
      right = right .and. size(contacts%gap) == contacts%n
    end do
    call check(right, "normal, gap and point of each contact; the candidate has the lower identifier")
    call check(owned, "each contact in the subdomain of its point")
    call check(ordered, "contacts by cell, candidate, antagonist with walls first")
    call check_all_pairs(sorted, walls, rule, found)
  end subroutine compare

  subroutine check_all_pairs(bodies, walls, rule, found)
    type(body_set_t), intent(in) :: bodies
    type(wall_set_t), intent(in) :: walls
    type(detection_rule_t), intent(in) :: rule
    integer, allocatable, intent(in) :: found(:, :)
    integer :: i, j, expected, n_contacts
    real(dp) :: gap
    logical :: same

    same = .true.
    n_contacts = 0
    do i = 1, bodies%n
      do j = -walls%n, bodies%n
        if (j == 0) cycle
        if (j < 0) then
          gap = dot_product(bodies%position(:, i) - walls%point(:, -j), walls%normal(:, -j)) - bodies%radius(i)
        else
          gap = norm2(bodies%position(:, i) - bodies%position(:, j)) - bodies%radius(i) - bodies%radius(j)
        end if
        expected = merge(1, 0, gap <= rule%alert_distance)
        if (j > 0) then
          if (bodies%id(i) >= bodies%id(j)) expected = 0
        end if
        n_contacts = n_contacts + expected
        same = same .and. found(i, j) == expected
      end do
    end do
    call check(same, "every contact once, and no other")
    call check(n_contacts > 50, "enough contacts to tell")
  end subroutine check_all_pairs

  !> Gap and normal, times the distance, are differences of coordinates below 2: a few roundings, absolute.
  pure logical function right_geometry(bodies, walls, contacts, c) result(right)
    type(body_set_t), intent(in) :: bodies
    type(wall_set_t), intent(in) :: walls
    type(contact_list_t), intent(in) :: contacts
    integer, intent(in) :: c
    real(dp), parameter :: rounding = 16*epsilon(1.0_dp)
    real(dp) :: branch(bodies%nd), distance
    integer :: j

    j = contacts%antagonist(c)
    associate (x => bodies%position(:, contacts%candidate(c)), radius => bodies%radius(contacts%candidate(c)))
      if (j < 0) then
        distance = dot_product(x - walls%point(:, -j), walls%normal(:, -j))
        right = abs(contacts%gap(c) - (distance - radius)) <= rounding
        right = right .and. all(abs(contacts%normal(:, c) - walls%normal(:, -j)) <= 0.0_dp)
      else
        branch(:) = x - bodies%position(:, j)
        distance = norm2(branch)
        right = abs(contacts%gap(c) - (distance - radius - bodies%radius(j))) <= rounding
        right = right .and. all(abs(contacts%normal(:, c)*distance - branch) <= rounding)
      end if
    end associate
  end function right_geometry

  !> The subdomain that should own contact `c`, from the definition of the rule.
  integer function right_owner(bodies, walls, rule, region, contacts, c) result(subdomain)
    type(body_set_t), intent(in) :: bodies
    type(wall_set_t), intent(in) :: walls
    type(detection_rule_t), intent(in) :: rule
    class(region_t), intent(in) :: region
    type(contact_list_t), intent(in) :: contacts
    integer, intent(in) :: c
    real(dp) :: point(bodies%nd)
    integer :: i, j

    i = contacts%candidate(c)
    j = contacts%antagonist(c)
    point(:) = bodies%position(:, i)
    if (rule%kind == rule_dual .and. j > 0) point(:) = (point + bodies%position(:, j))/2
    ! the foot on the wall, or the centre itself where it has got behind the wall
    if (rule%kind == rule_dual .and. j < 0) point(:) = point - &
      & max(0.0_dp, dot_product(point - walls%point(:, -j), walls%normal(:, -j)))*walls%normal(:, -j)
    subdomain = region%owner(point)
    ! the point given with the contact is that one: roundings of coordinates below 2
    if (any(abs(point - contacts%point(:, c)) > 16*epsilon(1.0_dp))) subdomain = 0
  end function right_owner

  !> Whether contact `a` comes before `b` in the order of the sweep.
  logical function precedes(bodies, walls, grid, contacts, a, b)
    type(body_set_t), intent(in) :: bodies
    type(wall_set_t), intent(in) :: walls
    type(cell_grid_t), intent(in) :: grid
    type(contact_list_t), intent(in) :: contacts
    integer, intent(in) :: a, b
    integer(i8) :: key(3, 2)
    integer :: k, c

    do k = 1, 2
      c = merge(a, b, k == 1)
      key(1, k) = grid%index_of(contacts%point(:, c))
      key(2, k) = bodies%id(contacts%candidate(c))
      key(3, k) = contacts%antagonist(c)
      if (key(3, k) > 0) then
        key(3, k) = bodies%id(contacts%antagonist(c))
      else
        key(3, k) = -walls%id(-contacts%antagonist(c))
      end if
    end do
    precedes = .false.
    do k = 1, 3
      if (key(k, 1) == key(k, 2)) cycle
      precedes = key(k, 1) < key(k, 2)
      return
    end do
  end function precedes

  !> The same bodies in another order give the same contacts, in the same order, bit for bit.
  subroutine test_input_order(bodies, walls, rule, region, trial)
    type(body_set_t), intent(in) :: bodies
    type(wall_set_t), intent(in) :: walls
    type(detection_rule_t), intent(in) :: rule
    class(region_t), intent(in) :: region
    integer, intent(in) :: trial
    type(body_set_t) :: sorted(2)
    type(contact_list_t) :: contacts(2)
    type(cell_grid_t) :: grid
    integer, allocatable :: order(:), first(:)
    integer :: s, c, k, shuffle(bodies%n)
    logical :: same

    do k = 1, bodies%n
      shuffle(k) = 1 + mod(53*k + trial, bodies%n)
    end do
    same = .true.
    do s = 1, 7
      do k = 1, 2
        sorted(k) = bodies
        if (k == 2) call sorted(k)%reorder(shuffle)
        call sort_bodies(sorted(k), 2*rule%largest_radius + rule%alert_distance, grid, order, first)
        call sorted(k)%reorder(order)
        call detect_contacts(sorted(k), grid, first, walls, region, s, rule, contacts(k))
      end do
      same = same .and. all(sorted(1)%id == sorted(2)%id) .and. contacts(1)%n == contacts(2)%n
      if (.not. same) exit
      do c = 1, contacts(1)%n
        same = same .and. contacts(1)%candidate(c) == contacts(2)%candidate(c)
        same = same .and. contacts(1)%antagonist(c) == contacts(2)%antagonist(c)
        same = same .and. abs(contacts(1)%gap(c) - contacts(2)%gap(c)) <= 0.0_dp
        same = same .and. all(abs(contacts(1)%normal(:, c) - contacts(2)%normal(:, c)) <= 0.0_dp)
      end do
    end do
    call check(same, "the order of the bodies does not matter")
  end subroutine test_input_order

  !> Bodies by cell, then identifier; `first` delimits the cells.
  subroutine test_sorted_bodies()
    type(body_set_t) :: bodies
    type(wall_set_t) :: walls
    type(cell_grid_t) :: grid
    integer, allocatable :: order(:), first(:)
    integer :: cell, k
    logical :: right

    call make_scene(3, 77, bodies, walls)
    call sort_bodies(bodies, 0.3_dp, grid, order, first)
    call bodies%reorder(order)
    right = first(1) == 1 .and. size(first) == grid%cells() + 1
    if (right) right = first(grid%cells() + 1) == bodies%n + 1
    do cell = 1, grid%cells()
      do k = first(cell), first(cell + 1) - 1
        right = right .and. grid%index_of(bodies%position(:, k)) == cell
        if (k > first(cell)) right = right .and. bodies%id(k) > bodies%id(k - 1)
      end do
    end do
    call check(right, "bodies by cell, then identifier")
    call check(grid%edge >= 0.3_dp, "cells no smaller than asked for")
  end subroutine test_sorted_bodies

  !> Contacts of two grains at `x` and of the ground, all numbers being exact in binary.
  integer function count_contacts(x, alert)
    real(dp), intent(in) :: x(2, 2), alert
    type(body_set_t) :: bodies
    type(wall_set_t) :: walls
    type(detection_rule_t) :: rule
    type(contact_list_t) :: contacts

    call make_pair(x, bodies, walls)
    rule%alert_distance = alert
    call detect(bodies, walls, rule, contacts)
    count_contacts = contacts%n
  end function count_contacts

  subroutine make_pair(x, bodies, walls)
    real(dp), intent(in) :: x(:, :)
    type(body_set_t), intent(out) :: bodies
    type(wall_set_t), intent(out) :: walls
    integer :: b

    call bodies%init(size(x, 1), size(x, 1), size(x, 2))
    do b = 1, bodies%n
      bodies%id(b) = 10 - b
      bodies%position(:, b) = x(:, b)
    end do
    bodies%velocity(:, :) = 0.0_dp
    bodies%radius(:) = 1.0_dp
    bodies%mass(:) = 1.0_dp
    bodies%inertia(:) = 1.0_dp
    walls%n = 1
    allocate (walls%id(1), source=100_i8)
    allocate (walls%point(size(x, 1), 1), walls%normal(size(x, 1), 1), source=0.0_dp)
    walls%normal(size(x, 1), 1) = 1.0_dp
  end subroutine make_pair

  subroutine detect(bodies, walls, rule, contacts)
    type(body_set_t), intent(inout) :: bodies
    type(wall_set_t), intent(in) :: walls
    type(detection_rule_t), intent(in) :: rule
    type(contact_list_t), intent(out) :: contacts
    type(cell_grid_t) :: grid
    type(sites_t) :: whole
    integer, allocatable :: order(:), first(:)

    allocate (whole%site(bodies%nd, 1), source=0.0_dp)
    call sort_bodies(bodies, 2.0_dp + rule%alert_distance, grid, order, first)
    call bodies%reorder(order)
    call detect_contacts(bodies, grid, first, walls, whole, 1, rule, contacts)
  end subroutine detect

  !> A gap equal to the alert distance is a contact, a larger one is not.
  subroutine test_alert_distance()
    real(dp), parameter :: high = 50.0_dp, more = 1.0e-9_dp
    call check_equal(count_contacts(reshape([0.0_dp, high, 2.5_dp, high], [2, 2]), 0.5_dp), 1, "grains at the alert distance")
    call check_equal(count_contacts(reshape([0.0_dp, high, 2.5_dp + more, high], [2, 2]), 0.5_dp), 0, "grains beyond it")
    call check_equal(count_contacts(reshape([0.0_dp, high, 2.0_dp, high], [2, 2]), 0.0_dp), 1, "grains that just touch")
    call check_equal(count_contacts(reshape([0.0_dp, 1.5_dp, 9.0_dp, high], [2, 2]), 0.5_dp), 1, "ground at the alert distance")
    call check_equal(count_contacts(reshape([0.0_dp, 1.5_dp + more, 9.0_dp, high], [2, 2]), 0.5_dp), 0, "ground beyond it")
    call check_equal(count_contacts(reshape([0.0_dp, -3.0_dp, 9.0_dp, high], [2, 2]), 0.5_dp), 1, "a grain behind the wall")
    call check_equal(count_contacts(reshape([0.0_dp, 1.0_dp, 2.0_dp, 1.0_dp], [2, 2]), 0.0_dp), 3, "two grains on the ground")
  end subroutine test_alert_distance

  subroutine test_coincident_centres(nd)
    integer, intent(in) :: nd
    type(body_set_t) :: bodies
    type(wall_set_t) :: walls
    type(detection_rule_t) :: rule
    type(contact_list_t) :: contacts
    real(dp) :: x(nd, 2)
    integer :: d

    x(:, :) = 30.0_dp
    call make_pair(x, bodies, walls)
    call detect(bodies, walls, rule, contacts)
    call check_equal(contacts%n, 1, "coincident centres touch")
    if (contacts%n /= 1) return
    call check_close(contacts%gap(1), -2.0_dp, 0.0_dp, "gap of coincident centres")
    do d = 1, nd
      call check_close(contacts%normal(d, 1), merge(1.0_dp, 0.0_dp, d == nd), 0.0_dp, "normal of coincident centres")
    end do
  end subroutine test_coincident_centres

  subroutine test_owner_point()
    call check_point(rule_dual, .false., 1.5_dp, 3.5_dp, "midpoint")
    call check_point(rule_dual, .true., 2.0_dp, 5.0_dp, "foot on a wall")
    call check_point(rule_primal, .false., 1.0_dp, 2.0_dp, "candidate")
    call check_point(rule_primal, .true., 1.0_dp, 2.0_dp, "candidate at a wall")
  end subroutine test_owner_point

  subroutine check_point(kind, is_wall, x, y, name)
    integer, intent(in) :: kind
    logical, intent(in) :: is_wall
    real(dp), intent(in) :: x, y
    character(len=*), intent(in) :: name
    real(dp), parameter :: candidate(2) = [1.0_dp, 2.0_dp], antagonist(2) = [2.0_dp, 5.0_dp]
    real(dp) :: point(2)

    point(:) = owner_point(kind, candidate, antagonist, is_wall)
    call check_close(point(1), x, 0.0_dp, name//", x")
    call check_close(point(2), y, 0.0_dp, name//", y")
  end subroutine check_point

  !> No grain, and one grain.
  subroutine test_few_bodies()
    type(body_set_t) :: bodies
    type(wall_set_t) :: walls
    type(detection_rule_t) :: rule
    type(contact_list_t) :: contacts
    real(dp) :: x(2, 1)

    call make_pair(x(:, 1:0), bodies, walls)
    call detect(bodies, walls, rule, contacts)
    call check_equal(contacts%n, 0, "no grain, no contact")
    x(:, :) = 1.0_dp
    call make_pair(x, bodies, walls)
    call detect(bodies, walls, rule, contacts)
    call check_equal(contacts%n, 1, "one grain on the ground")
    call check_equal(contacts%antagonist(1), -1, "the ground is minus its number")
    call check_equal(contacts%candidate(1), 1, "the grain is the candidate")
  end subroutine test_few_bodies

end program test_detection
