!> Contact detection: a cell grid finds near pairs (broad phase), then gaps and normals are computed (narrow phase).
module gravier_detection
  use gravier_kinds, only: dp, i8
  use gravier_sorting, only: argsort_rows
  use gravier_body_store, only: body_set_t, wall_set_t
  use gravier_cell_grid, only: cell_grid_t
  use gravier_contact_list, only: contact_list_t
  use gravier_region, only: region_t
  implicit none
  private
  public :: detection_rule_t, detect_contacts, sort_bodies, owner_point
  public :: rule_dual, rule_primal

  !> a contact belongs to the subdomain that holds the midpoint of the centres (paper, section 2.1)
  integer, parameter :: rule_dual = 1
  !> a contact belongs to the subdomain that holds the centre of its candidate
  integer, parameter :: rule_primal = 2

  type :: detection_rule_t
    !> pairs whose gap is at most this are contacts [m]
    real(dp) :: alert_distance = 0.0_dp
    !> largest radius of the scene [m]
    real(dp) :: largest_radius = 0.0_dp
    !> rule_dual or rule_primal
    integer :: kind = rule_dual
  end type detection_rule_t

  !> offsets of the cells searched from a cell besides itself: half of its neighbours, so that a pair is met once
  integer, parameter :: half_stencil(3, 13) = reshape([ &
    & 1, 0, 0, -1, 1, 0, 0, 1, 0, 1, 1, 0, &
    & -1, -1, 1, 0, -1, 1, 1, -1, 1, -1, 0, 1, 0, 0, 1, 1, 0, 1, -1, 1, 1, 0, 1, 1, 1, 1, 1], [3, 13])

contains

  !> Sort bodies into the order of the cells of a grid over them, then by identifier: an order that depends on the
  !> set of bodies alone. `first` gives the first body of each cell, with one more entry at the end.
  subroutine sort_bodies(bodies, edge, grid, order, first)
    type(body_set_t), intent(in) :: bodies
    !> smallest edge of a cell [m]
    real(dp), intent(in) :: edge
    type(cell_grid_t), intent(out) :: grid
    !> (n) permutation to apply
    integer, allocatable, intent(out) :: order(:)
    !> (cells + 1)
    integer, allocatable, intent(out) :: first(:)
    integer(i8), allocatable :: keys(:, :)
    real(dp) :: lower(bodies%nd), upper(bodies%nd)
    integer :: k, cell

    allocate (order(bodies%n), keys(2, bodies%n))
    if (bodies%n == 0) then
      allocate (first(2), source=1)
      return
    end if
    lower(:) = minval(bodies%position, dim=2)
    upper(:) = maxval(bodies%position, dim=2)
    call grid%init(lower, upper, edge, 4_i8*bodies%n + 64_i8)
    allocate (first(grid%cells() + 1), source=0)
    do k = 1, bodies%n
      cell = grid%index_of(bodies%position(:, k))
      keys(1, k) = cell
      keys(2, k) = bodies%id(k)
      first(cell + 1) = first(cell + 1) + 1
    end do
    call argsort_rows(keys, order)
    first(1) = 1
    do cell = 1, grid%cells()
      first(cell + 1) = first(cell) + first(cell + 1)
    end do
  end subroutine sort_bodies

  !> Contacts of subdomain `subdomain` among `bodies` (sorted by sort_bodies with the same grid) and walls.
  subroutine detect_contacts(bodies, grid, first, walls, region, subdomain, rule, contacts)
    !> its grains and those of its neighbourhood, at q_m
    type(body_set_t), intent(in) :: bodies
    type(cell_grid_t), intent(in) :: grid
    integer, intent(in), contiguous :: first(:)
    type(wall_set_t), intent(in) :: walls
    class(region_t), intent(in) :: region
    integer, intent(in) :: subdomain
    type(detection_rule_t), intent(in) :: rule
    !> sorted by cell, then candidate, then antagonist with walls first
    type(contact_list_t), intent(inout) :: contacts
    integer :: place(3), other(3), x, y, z, k, cell

    call contacts%init(bodies%nd, 4*bodies%n + 16)
    if (bodies%n == 0) return
    do z = 0, grid%n(3) - 1
      do y = 0, grid%n(2) - 1
        do x = 0, grid%n(1) - 1
          place(1) = x
          place(2) = y
          place(3) = z
          cell = grid%flat(place)
          if (first(cell) == first(cell + 1)) cycle
          call search_walls(first(cell), first(cell + 1) - 1)
          call search_pairs(first(cell), first(cell + 1) - 1, first(cell), first(cell + 1) - 1, same=.true.)
          do k = 1, merge(4, 13, bodies%nd == 2)
            other(:) = place + half_stencil(:, k)
            if (any(other < 0) .or. any(other >= grid%n)) cycle
            call search_pairs(first(cell), first(cell + 1) - 1, first(grid%flat(other)), &
              & first(grid%flat(other) + 1) - 1, same=.false.)
          end do
        end do
      end do
    end do
    call sort_contacts(bodies, grid, walls, contacts)

  contains

    subroutine search_walls(from, to)
      integer, intent(in) :: from, to
      integer :: b, w
      real(dp) :: height, foot(bodies%nd), point(bodies%nd)

      do b = from, to
        do w = 1, walls%n
          height = dot_product(bodies%position(:, b) - walls%point(:, w), walls%normal(:, w))
          if (height - bodies%radius(b) > rule%alert_distance) cycle
          ! a centre that has got behind the wall decides itself, so that the owner never lies far from the grain
          foot(:) = bodies%position(:, b) - max(height, 0.0_dp)*walls%normal(:, w)
          point(:) = owner_point(rule%kind, bodies%position(:, b), foot, .true.)
          if (region%owner(point) /= subdomain) cycle
          call add(b, -w, height - bodies%radius(b), walls%normal(:, w), point)
        end do
      end do
    end subroutine search_walls

    subroutine search_pairs(from_a, to_a, from_b, to_b, same)
      integer, intent(in) :: from_a, to_a, from_b, to_b
      logical, intent(in) :: same
      integer :: a, b

      do a = from_a, to_a
        do b = merge(a + 1, from_b, same), to_b
          call test_pair(a, b)
        end do
      end do
    end subroutine search_pairs

    subroutine test_pair(a, b)
      integer, intent(in) :: a, b
      integer :: i, j
      real(dp) :: branch(bodies%nd), normal(bodies%nd), point(bodies%nd), reach, distance

      reach = bodies%radius(a) + bodies%radius(b) + rule%alert_distance
      branch(:) = bodies%position(:, a) - bodies%position(:, b)
      if (dot_product(branch, branch) > reach**2) return
      i = merge(a, b, bodies%id(a) < bodies%id(b))
      j = a + b - i
      branch(:) = bodies%position(:, i) - bodies%position(:, j)
      distance = norm2(branch)
      point(:) = owner_point(rule%kind, bodies%position(:, i), bodies%position(:, j), .false.)
      if (region%owner(point) /= subdomain) return
      if (distance > 0.0_dp) then
        normal(:) = branch/distance
      else
        ! coincident centres have no normal: take the vertical, so that the law can part them
        normal(:) = 0.0_dp
        normal(bodies%nd) = 1.0_dp
      end if
      call add(i, j, distance - bodies%radius(i) - bodies%radius(j), normal, point)
    end subroutine test_pair

    subroutine add(candidate, antagonist, gap, normal, point)
      integer, intent(in) :: candidate, antagonist
      real(dp), intent(in) :: gap, normal(:), point(:)

      call contacts%reserve()
      contacts%n = contacts%n + 1
      contacts%candidate(contacts%n) = candidate
      contacts%antagonist(contacts%n) = antagonist
      contacts%gap(contacts%n) = gap
      contacts%normal(:, contacts%n) = normal
      contacts%point(:, contacts%n) = point
    end subroutine add

  end subroutine detect_contacts

  !> The point whose subdomain owns a contact: the midpoint of the centres, or the projection on a wall (dual);
  !> the centre of the candidate (primal).
  pure function owner_point(kind, candidate, antagonist, is_wall) result(point)
    integer, intent(in) :: kind
    !> centre of the candidate (nd) [m]
    real(dp), intent(in) :: candidate(:)
    !> centre of the antagonist, or the projection of the candidate's centre on the wall (nd) [m]
    real(dp), intent(in) :: antagonist(:)
    logical, intent(in) :: is_wall
    real(dp) :: point(size(candidate))

    if (kind == rule_primal) then
      point(:) = candidate
    else if (is_wall) then
      point(:) = antagonist
    else
      point(:) = 0.5_dp*(candidate + antagonist)
    end if
  end function owner_point

  !> Order of the sweep: by cell of the owner point, then candidate, then antagonist with walls first.
  subroutine sort_contacts(bodies, grid, walls, contacts)
    type(body_set_t), intent(in) :: bodies
    type(cell_grid_t), intent(in) :: grid
    type(wall_set_t), intent(in) :: walls
    type(contact_list_t), intent(inout) :: contacts
    integer(i8), allocatable :: keys(:, :)
    integer, allocatable :: order(:)
    integer :: c

    allocate (keys(3, contacts%n), order(contacts%n))
    do c = 1, contacts%n
      keys(1, c) = grid%index_of(contacts%point(:, c))
      keys(2, c) = bodies%id(contacts%candidate(c))
      if (contacts%antagonist(c) < 0) then
        keys(3, c) = -walls%id(-contacts%antagonist(c))
      else
        keys(3, c) = bodies%id(contacts%antagonist(c))
      end if
    end do
    call argsort_rows(keys, order)
    call contacts%reorder(order)
  end subroutine sort_contacts

end module gravier_detection
