!> The points in which two bodies touch, or a body and a boundary, where bodies have shapes.
module gravier_shape_contacts
  use gravier_kinds, only: dp
  use gravier_periodic, only: period_t, shift_of_code
  use gravier_convex_piece, only: convex_piece_t
  use gravier_body_store, only: body_set_t
  use gravier_boundary, only: boundary_t
  use gravier_manifold, only: manifold_t, feature_base
  use gravier_polygon_pair, only: placed_piece_t, place_piece, find_polygon_manifold, find_plane_manifold
  use gravier_neighbour_list, only: neighbour_list_t
  use gravier_decomposition, only: decomposition_t
  use gravier_halo, only: local_bodies_t
  implicit none
  private
  public :: pair_points_t, find_points, carry_memory

  !> points of one pair that are nearer to each other than this, over the radius of the candidate, and have the same normal within it,
  !> are one: those where pieces of a cluster meet
  real(dp), parameter :: same = 1.0e-6_dp

  !> Points in ascending order of their keys, and work space.
  type :: pair_points_t
    integer :: n = 0
    !> from the antagonist to the candidate (3, n)
    real(dp), allocatable :: normal(:, :)
    !> from the centre of the candidate, half-way between the surfaces (3, n) [m]
    real(dp), allocatable :: point(:, :)
    !> (n) [m]
    real(dp), allocatable :: gap(:)
    !> of the features of the two pieces, and of the pieces (2, n), both above 0
    integer, allocatable :: key(:, :)
    !> points whose cores overlap, over all pairs asked for
    integer :: overlapping_cores = 0
    type(placed_piece_t) :: a, b
  contains
    procedure :: add => pair_points_add
  end type pair_points_t

contains

  !> The points of pair `p` of a view whose gap is at most the alert distance; at most as many as the pair has places in the list,
  !> those with the smallest gaps.
  subroutine find_points(view, decomposition, p, points)
    type(local_bodies_t), intent(in) :: view
    type(decomposition_t), intent(in) :: decomposition
    integer, intent(in) :: p
    type(pair_points_t), intent(inout) :: points
    integer :: j

    points%n = 0
    j = view%list%antagonist(p)
    if (j > 0) then
      call touch_body(view, decomposition, p, points)
    else
      call touch_boundary(view%bodies, view%list%candidate(p), decomposition, decomposition%boundaries(-j), points)
    end if
    call merge_points(same*view%bodies%radius(view%list%candidate(p)), points)
    call keep_deepest(view%list%points_of(p), points)
  end subroutine find_points

  !> The points with another body.
  subroutine touch_body(view, decomposition, p, points)
    type(local_bodies_t), intent(in) :: view
    type(decomposition_t), intent(in) :: decomposition
    integer, intent(in) :: p
    type(pair_points_t), intent(inout) :: points
    type(manifold_t) :: manifold
    real(dp) :: way(decomposition%nd), here(decomposition%nd)
    integer :: k, l, i, j

    here(:) = 0.0_dp
    i = view%list%candidate(p)
    j = view%list%antagonist(p)
    associate (bodies => view%bodies)
      way(:) = bodies%position(:, j) - bodies%position(:, i)
      if (size(view%list%shift) > 0) call add_shift(decomposition%period, view%list%shift(p), way)
      if (norm2(way) > bodies%radius(i) + bodies%radius(j) + decomposition%rule%alert_distance) return
      do k = 1, n_pieces(decomposition, bodies, i)
        call place(decomposition, bodies, i, k, here, points%a)
        do l = 1, n_pieces(decomposition, bodies, j)
          call place(decomposition, bodies, j, l, way, points%b)
          call find_polygon_manifold(points%a, points%b, decomposition%rule%alert_distance, manifold)
          call points%add(manifold, k, l)
        end do
      end do
    end associate
  end subroutine touch_body

  !> The points with a boundary: a plane, a surface that ends at straight edges, or one that is round.
  subroutine touch_boundary(bodies, i, decomposition, boundary, points)
    type(body_set_t), intent(in) :: bodies
    integer, intent(in) :: i
    type(decomposition_t), intent(in) :: decomposition
    type(boundary_t), intent(in) :: boundary
    type(pair_points_t), intent(inout) :: points
    type(manifold_t) :: manifold
    real(dp) :: normal(decomposition%nd), here(decomposition%nd), distance, corners(3, 4), flat(2, 4)
    integer :: k, n

    if (.not. boundary%present) return
    call boundary%locate(bodies%position(:, i), distance, normal)
    if (distance - bodies%radius(i) > decomposition%rule%alert_distance) return
    call boundary%find_corners(bodies%position(:, i), n, corners)
    flat(:, :) = corners(1:2, :)
    here(:) = 0.0_dp
    do k = 1, n_pieces(decomposition, bodies, i)
      call place(decomposition, bodies, i, k, here, points%a)
      if (boundary%is_plane()) then
        call find_plane_manifold(points%a, normal, -distance, decomposition%rule%alert_distance, manifold)
        call points%add(manifold, k, 1)
      else if (n > 0) then
        call place_piece(flat(:, 1:n), flat(:, 1:n), 0.0_dp, 1.0_dp, 0.0_dp, here, points%b)
        call find_polygon_manifold(points%a, points%b, decomposition%rule%alert_distance, manifold)
        call points%add(manifold, k, 1)
      else
        call touch_round_surface(bodies%position(:, i), boundary, decomposition%rule%alert_distance, k, points)
      end if
    end do
  end subroutine touch_boundary

  !> The points of a placed piece with a round surface: its vertices, of a piece with more than two the nearest and the nearer of
  !> those beside it.
  subroutine touch_round_surface(centre, boundary, alert, piece, points)
    real(dp), intent(in) :: centre(:)
    type(boundary_t), intent(in) :: boundary
    real(dp), intent(in) :: alert
    integer, intent(in) :: piece
    type(pair_points_t), intent(inout) :: points
    type(manifold_t) :: manifold(points%a%n)
    real(dp) :: distance, normal(size(centre)), at(size(centre))
    integer :: v, nearest, beside, chosen(2)

    do v = 1, points%a%n
      at(:) = centre + points%a%vertex(:, v)
      call boundary%locate(at, distance, normal)
      manifold(v)%gap(1) = distance - points%a%rounding
      manifold(v)%normal(1:size(normal)) = normal
      manifold(v)%point(1:size(normal), 1) = points%a%vertex(:, v) - (points%a%rounding + 0.5_dp*manifold(v)%gap(1))*normal
      manifold(v)%key(1) = feature_base*v
      if (manifold(v)%gap(1) <= alert) manifold(v)%n = 1
    end do
    nearest = 1
    do v = 2, points%a%n
      if (manifold(v)%gap(1) < manifold(nearest)%gap(1)) nearest = v
    end do
    beside = mod(nearest, points%a%n) + 1
    v = mod(nearest + points%a%n - 2, points%a%n) + 1
    if (manifold(v)%gap(1) < manifold(beside)%gap(1)) beside = v
    chosen(1) = min(nearest, beside)
    chosen(2) = max(nearest, beside)
    call points%add(manifold(chosen(1)), piece, 1)
    if (chosen(2) > chosen(1)) call points%add(manifold(chosen(2)), piece, 1)
  end subroutine touch_round_surface

  pure integer function n_pieces(decomposition, bodies, k) result(n)
    type(decomposition_t), intent(in) :: decomposition
    type(body_set_t), intent(in) :: bodies
    integer, intent(in) :: k

    n = 1
    if (bodies%shape(k) > 0) n = size(decomposition%shapes%shape(bodies%shape(k))%piece)
  end function n_pieces

  !> Put piece `piece` of body `k` in its place, the centre of the body being at `centre`.
  subroutine place(decomposition, bodies, k, piece, centre, placed)
    type(decomposition_t), intent(in) :: decomposition
    type(body_set_t), intent(in) :: bodies
    integer, intent(in) :: k, piece
    real(dp), intent(in), contiguous :: centre(:)
    type(placed_piece_t), intent(inout) :: placed
    !> a disk is the rounding of its centre
    real(dp), parameter :: point(2, 1) = 0.0_dp

    if (bodies%shape(k) == 0) then
      call place_piece(point, point, 1.0_dp, bodies%radius(k), 0.0_dp, centre, placed)
    else
      associate (this => decomposition%shapes%shape(bodies%shape(k))%piece(piece))
        call place_piece(this%vertex, this%corner, this%rounding, bodies%radius(k), bodies%orientation(1, k), centre, placed)
      end associate
    end if
  end subroutine place

  !> Take the shift of the antagonist into account in the way from the candidate to it.
  pure subroutine add_shift(period, code, way)
    type(period_t), intent(in) :: period
    integer, intent(in) :: code
    !> (nd) [m]
    real(dp), intent(inout) :: way(:)
    integer :: shift(3), d

    shift(:) = shift_of_code(code)
    do d = 1, size(way)
      way(d) = way(d) + shift(d)*period%length(d)
    end do
  end subroutine add_shift

  !> Add the points of two pieces.
  subroutine pair_points_add(self, manifold, piece_a, piece_b)
    class(pair_points_t), intent(inout) :: self
    type(manifold_t), intent(in) :: manifold
    integer, intent(in) :: piece_a, piece_b
    integer :: k

    if (.not. allocated(self%gap)) allocate (self%normal(3, 8), self%point(3, 8), self%gap(8), self%key(2, 8))
    if (self%n + manifold%n > size(self%gap)) call lengthen(self, self%n + manifold%n)
    do k = 1, manifold%n
      self%n = self%n + 1
      self%normal(:, self%n) = manifold%normal
      self%point(:, self%n) = manifold%point(:, k)
      self%gap(self%n) = manifold%gap(k)
      self%key(1, self%n) = manifold%key(k) + 1
      self%key(2, self%n) = feature_base*piece_a + piece_b
    end do
    if (manifold%n > 0 .and. manifold%cores_overlap) self%overlapping_cores = self%overlapping_cores + 1
  end subroutine pair_points_add

  subroutine lengthen(self, least)
    type(pair_points_t), intent(inout) :: self
    integer, intent(in) :: least
    real(dp), allocatable :: normal(:, :), point(:, :), gap(:)
    integer, allocatable :: key(:, :)
    integer :: room

    room = max(least, 2*size(self%gap))
    allocate (normal(3, room), point(3, room), gap(room), key(2, room))
    normal(:, 1:self%n) = self%normal(:, 1:self%n)
    point(:, 1:self%n) = self%point(:, 1:self%n)
    gap(1:self%n) = self%gap(1:self%n)
    key(:, 1:self%n) = self%key(:, 1:self%n)
    call move_alloc(normal, self%normal)
    call move_alloc(point, self%point)
    call move_alloc(gap, self%gap)
    call move_alloc(key, self%key)
  end subroutine lengthen

  !> Of points that are one, keep the deepest, of several the first.
  pure subroutine merge_points(near, points)
    !> [m]
    real(dp), intent(in) :: near
    type(pair_points_t), intent(inout) :: points
    logical :: dropped(points%n)
    integer :: k, l

    if (points%n < 2) return
    if (points%key(2, 1) == points%key(2, points%n)) return
    dropped(:) = .false.
    do k = 1, points%n
      do l = k + 1, points%n
        if (points%key(2, k) == points%key(2, l)) cycle
        if (dropped(k) .or. dropped(l)) cycle
        if (maxval(abs(points%point(:, k) - points%point(:, l))) > near) cycle
        if (maxval(abs(points%normal(:, k) - points%normal(:, l))) > same) cycle
        dropped(l) = points%gap(l) >= points%gap(k)
        dropped(k) = .not. dropped(l)
      end do
    end do
    call drop(dropped, points)
  end subroutine merge_points

  !> Keep at most so many points, those with the smallest gaps.
  pure subroutine keep_deepest(most, points)
    integer, intent(in) :: most
    type(pair_points_t), intent(inout) :: points
    logical :: dropped(points%n)
    integer :: k, l, shallowest

    if (points%n <= most) return
    dropped(:) = .false.
    do k = 1, points%n - most
      shallowest = 0
      do l = 1, points%n
        if (dropped(l)) cycle
        if (shallowest == 0) shallowest = l
        if (points%gap(l) >= points%gap(shallowest)) shallowest = l
      end do
      dropped(shallowest) = .true.
    end do
    call drop(dropped, points)
  end subroutine keep_deepest

  pure subroutine drop(dropped, points)
    logical, intent(in) :: dropped(:)
    type(pair_points_t), intent(inout) :: points
    integer :: k, n

    n = 0
    do k = 1, points%n
      if (dropped(k)) cycle
      n = n + 1
      points%normal(:, n) = points%normal(:, k)
      points%point(:, n) = points%point(:, k)
      points%gap(n) = points%gap(k)
      points%key(:, n) = points%key(:, k)
    end do
    points%n = n
  end subroutine drop

  !> Bring the impulses and states that the pair at place `p` keeps to the points of now: to those with the same keys first, then
  !> what is left, in its order, to the new points. Points take the places of the pair in their order.
  pure subroutine carry_memory(points, p, list)
    type(pair_points_t), intent(in) :: points
    integer, intent(in) :: p
    type(neighbour_list_t), intent(inout) :: list
    integer, allocatable :: source(:)
    logical, allocatable :: taken(:)
    real(dp), allocatable :: impulse(:, :)
    integer, allocatable :: state(:, :)
    integer :: k, l, m, row

    m = list%points_of(p)
    row = list%memory%key_row
    if (points%n == 0 .and. all(list%state(row, p:p + m - 1) == 0)) return
    if (are_the_same()) return
    impulse = list%impulse(:, p:p + m - 1)
    state = list%state(:, p:p + m - 1)
    allocate (source(points%n), source=0)
    allocate (taken(m), source=.false.)
    do k = 1, points%n
      do l = 1, m
        if (any(state(row:row + 1, l) /= points%key(:, k))) cycle
        source(k) = l
        taken(l) = .true.
      end do
    end do
    l = 0
    do k = 1, points%n
      if (source(k) > 0) cycle
      do while (l < m)
        l = l + 1
        if (taken(l) .or. state(row, l) == 0) cycle
        source(k) = l
        taken(l) = .true.
        exit
      end do
    end do
    list%impulse(:, p:p + m - 1) = 0.0_dp
    list%state(:, p:p + m - 1) = 0
    do k = 1, points%n
      if (source(k) > 0) then
        list%impulse(:, p + k - 1) = impulse(:, source(k))
        list%state(:, p + k - 1) = state(:, source(k))
      end if
      list%state(row:row + 1, p + k - 1) = points%key(:, k)
    end do

  contains

    !> Whether the pair keeps just these points.
    pure logical function are_the_same()
      integer :: k

      are_the_same = .true.
      do k = 1, m
        if (k <= points%n) then
          are_the_same = are_the_same .and. all(list%state(row:row + 1, p + k - 1) == points%key(:, k))
        else
          are_the_same = are_the_same .and. list%state(row, p + k - 1) == 0
        end if
      end do
    end function are_the_same

  end subroutine carry_memory

end module gravier_shape_contacts
