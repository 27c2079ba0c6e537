!> The points in which a pair of bodies touches, and what is kept with them from one step to the next.
module gravier_pair_points
  use gravier_kinds, only: dp
  use gravier_manifold, only: manifold_t, feature_base
  use gravier_neighbour_list, only: neighbour_list_t
  implicit none
  private
  public :: pair_points_t, carry_memory

  !> directions of normals that are the same
  real(dp), parameter :: same = 1.0e-6_dp
  !> depths that are equal, over the distance of points that are one
  real(dp), parameter :: equal = 1.0e-3_dp
  !> where sides end at round corners, distance of points at a seam, over both roundings: across a corner of four pieces, and where
  !> a seam lies over a seam, until the pieces beside both have a side in common
  real(dp), parameter :: at_round_seams(2) = [1.42_dp, 1.99_dp], at_seams(2) = [1.0_dp, 1.0_dp]
  !> a point is deeper than another where it is so by this part of their distance
  real(dp), parameter :: as_deep = 1.0e-2_dp

  !> Points in ascending order of their keys.
  type :: pair_points_t
    integer :: n = 0
    !> from the centre of the candidate to that of the antagonist, shifted to where they meet; 0 of a boundary [m]
    real(dp) :: way(3) = 0.0_dp
    !> from the antagonist to the candidate (3, n)
    real(dp), allocatable :: normal(:, :)
    !> from the centre of the candidate, half-way between the surfaces (3, n) [m]
    real(dp), allocatable :: point(:, :)
    !> (n) [m]
    real(dp), allocatable :: gap(:)
    !> of the features of the two pieces, and of the pieces (2, n), both above 0
    integer, allocatable :: key(:, :)
    !> pairs of pieces whose cores overlap, and points that a pair has no place for, over all pairs asked for
    integer :: overlapping_cores = 0, left_out = 0
    contains
    procedure :: add => pair_points_add
    procedure :: merge_near => pair_points_merge_near
    procedure :: keep_deepest => pair_points_keep_deepest
  end type pair_points_t

contains

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

  !> Of points that are one, where pieces of a cluster meet, keep the deepest, of several the first. Where bodies overlap, the point
  !> of a corner lies half of the overlap away from it, in a direction that differs between pieces by their tilt: points that are
  !> nearer to each other than the overlap are one, too. At a seam of two pieces with sides their points are apart by both roundings
  !> once the body leans: they are one at any lean, so that neither forces at a seam nor their number jump with it. Two points of
  !> which both pieces have one are none at a seam. What is kept depends on rounding nowhere but where two points at a seam are
  !> equally deep. Where sides end at round corners, points at a seam are apart without a lean, too: they become one half-way
  !> between them, whose gap has no kink where a body that rocks changes from one to the other.
  pure subroutine pair_points_merge_near(points, near, seam, are_round)
    class(pair_points_t), intent(inout) :: points
    !> points of two pairs of pieces nearer to each other than this, with the same normal, are one [m]
    real(dp), intent(in) :: near
    !> the same for two pieces of the candidate, and of the antagonist, that touch one piece; 0 of a body of one piece [m]
    real(dp), intent(in) :: seam(2)
    !> whether sides end at round corners
    logical, intent(in) :: are_round
    logical :: dropped(points%n)
    integer :: kept(points%n), k, l

    if (points%n < 2) return
    if (points%key(2, 1) == points%key(2, points%n)) return
    do k = 1, points%n
      kept(k) = k
    end do
    if (are_round .and. maxval(seam) > near) call join_seams(points, seam, kept)
    do k = 1, points%n
      do l = k + 1, points%n
        if (kept(k) /= k .or. kept(l) /= l .or. points%key(2, k) == points%key(2, l)) cycle
        if (.not. are_within(points, k, l, max(near, -points%gap(k), -points%gap(l)))) cycle
        if (is_before(points, near, k, l)) then
          where (kept == l) kept = k
        else
          where (kept == k) kept = l
        end if
      end do
    end do
    dropped(:) = .false.
    if (.not. are_round .and. maxval(seam) > near) then
      do k = 1, points%n
        do l = k + 1, points%n
          if (kept(k) /= k .or. kept(l) /= l) cycle
          if (.not. are_within(points, k, l, maxval(seam))) cycle
          if (.not. are_within(points, k, l, seam_between(points, kept, seam, at_seams, k, l))) cycle
          dropped(merge(l, k, is_before(points, near, k, l))) = .true.
        end do
      end do
    end if
    do k = 1, points%n
      dropped(k) = dropped(k) .or. kept(k) /= k
    end do
    call drop(dropped, points)
  end subroutine pair_points_merge_near

  !> Put the points of each seam half-way between them, into the place of the first.
  pure subroutine join_seams(points, seam, kept)
    class(pair_points_t), intent(inout) :: points
    !> [m]
    real(dp), intent(in) :: seam(2)
    !> the point that each is one with: itself before
    integer, intent(inout) :: kept(:)
    integer :: number(points%n), k, l

    number(:) = 1
    do k = 1, points%n
      do l = k + 1, points%n
        if (kept(k) /= k .or. kept(l) /= l) cycle
        if (.not. are_within(points, k, l, maxval(at_round_seams)*maxval(seam))) cycle
        if (.not. are_within(points, k, l, seam_between(points, kept, seam, at_round_seams, k, l))) cycle
        points%point(:, k) = (number(k)*points%point(:, k) + number(l)*points%point(:, l))/(number(k) + number(l))
        points%gap(k) = (number(k)*points%gap(k) + number(l)*points%gap(l))/(number(k) + number(l))
        number(k) = number(k) + number(l)
        kept(l) = k
      end do
    end do
  end subroutine join_seams

  !> Whether two points with the same normal are so near to each other.
  pure logical function are_within(points, k, l, apart)
    class(pair_points_t), intent(in) :: points
    integer, intent(in) :: k, l
    real(dp), intent(in) :: apart

    are_within = sum((points%point(:, k) - points%point(:, l))**2) <= apart**2
    if (are_within) are_within = maxval(abs(points%normal(:, k) - points%normal(:, l))) <= same
  end function are_within

  !> Whether point `k` is deeper than `l`, or as deep and before it. Depths are rounded, so that this is an order.
  pure logical function is_before(points, near, k, l)
    class(pair_points_t), intent(in) :: points
    real(dp), intent(in) :: near
    integer, intent(in) :: k, l
    real(dp) :: one, other

    one = anint(points%gap(k)/(equal*near))
    other = anint(points%gap(l)/(equal*near))
    is_before = one < other .or. (k < l .and. one <= other)
  end function is_before

  !> How far apart points `k` and `l` may be to be one at a seam: 0 if a pair of pieces has both, be it by points that are one with
  !> them [m].
  pure real(dp) function seam_between(points, kept, seam, over, k, l) result(apart)
    class(pair_points_t), intent(in) :: points
    !> the point that each is one with
    integer, intent(in) :: kept(:)
    !> [m]; factors at one seam and where a seam of the one lies over a seam of the other
    real(dp), intent(in) :: seam(2), over(2)
    integer, intent(in) :: k, l
    integer :: m, n
    logical :: shares

    shares = .false.
    apart = 0.0_dp
    do m = 1, points%n
      if (kept(m) /= k) cycle
      do n = 1, points%n
        if (kept(n) /= l) cycle
        associate (one => points%key(2, m), other => points%key(2, n))
          if (one == other) then
            apart = 0.0_dp
            return
          end if
          if (one/feature_base == other/feature_base) then
            apart = max(apart, over(1)*seam(2))
            shares = .true.
          else if (mod(one, feature_base) == mod(other, feature_base)) then
            apart = max(apart, over(1)*seam(1))
            shares = .true.
          end if
        end associate
      end do
    end do
    ! no piece touches both: a seam of the one lies over a seam of the other
    if (.not. shares) apart = over(2)*minval(seam)
  end function seam_between

  !> Keep at most so many points, those with the smallest gaps.
  pure subroutine pair_points_keep_deepest(points, most)
    class(pair_points_t), intent(inout) :: points
    integer, intent(in) :: most
    logical :: dropped(points%n)
    integer :: k, l, shallowest

    if (points%n <= most) return
    points%left_out = points%left_out + points%n - most
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
  end subroutine pair_points_keep_deepest

  pure subroutine drop(dropped, points)
    logical, intent(in) :: dropped(:)
    class(pair_points_t), intent(inout) :: points
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

  !> Bring the impulses, elongations and states that the pair at place `p` keeps to the points of now: to those with the same keys
  !> first. What is left goes to the new points, in its order where they are as many and all of it is alike: loaded or not, with a
  !> state of the law or without. Otherwise the deepest of them takes what bore most, and so on: where a point becomes two, the one
  !> that stays is the deeper one, whatever the order of the keys, and a polygon that rolls over a corner keeps what this corner
  !> held though both its points have new keys. Points take the places of the pair in their order.
  pure subroutine carry_memory(points, p, list)
    type(pair_points_t), intent(in) :: points
    integer, intent(in) :: p
    type(neighbour_list_t), intent(inout) :: list
    integer :: source(points%n)
    real(dp), allocatable :: impulse(:, :), spring(:, :), load(:)
    integer, allocatable :: state(:, :)
    logical, allocatable :: has_state(:)
    integer :: k, m, row

    m = list%points_of(p)
    row = list%memory%key_row
    if (points%n == 0 .and. all(list%state(row, p:p + m - 1) == 0)) return
    if (are_the_same()) return
    impulse = list%impulse(:, p:p + m - 1)
    spring = list%spring(:, p:p + m - 1)
    state = list%state(:, p:p + m - 1)
    if (size(impulse, 1) > 0) then
      load = impulse(1, :)
    else
      load = norm2(spring, dim=1)
    end if
    allocate (has_state(m))
    do k = 1, m
      has_state(k) = any(state(1:row - 1, k) /= 0)
    end do
    call find_sources(points, state(row:row + 1, :), has_state, load, source)
    list%impulse(:, p:p + m - 1) = 0.0_dp
    list%spring(:, p:p + m - 1) = 0.0_dp
    list%state(:, p:p + m - 1) = 0
    do k = 1, points%n
      if (source(k) > 0) then
        list%impulse(:, p + k - 1) = impulse(:, source(k))
        list%spring(:, p + k - 1) = spring(:, source(k))
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

  !> The place among what a pair keeps that each point takes from, 0 where nothing is left for it.
  pure subroutine find_sources(points, key, has_state, load, source)
    type(pair_points_t), intent(in) :: points
    !> keys of what is kept (2, m), the first 0 where nothing is
    integer, intent(in) :: key(:, :)
    !> whether its law has a state, such as a bond, which counts more than any load (m)
    logical, intent(in) :: has_state(:)
    !> its normal impulse [N s] or, where none are kept, the length of its elongation [m] (m)
    real(dp), intent(in) :: load(:)
    !> (points)
    integer, intent(out) :: source(:)
    logical :: taken(size(load)), loaded(size(load)), as_many
    integer :: k, l

    source(:) = 0
    taken(:) = key(1, :) == 0
    do k = 1, points%n
      do l = 1, size(load)
        ! images of one facet have one key, and keep their order
        if (any(key(:, l) /= points%key(:, k)) .or. taken(l)) cycle
        source(k) = l
        taken(l) = .true.
        exit
      end do
    end do
    as_many = count(source == 0) == count(.not. taken)
    loaded(:) = load > 0.0_dp
    if (as_many) as_many = are_alike(has_state) .and. are_alike(loaded)
    do
      k = deepest_new()
      l = heaviest_left()
      if (k == 0 .or. l == 0) exit
      source(k) = l
      taken(l) = .true.
    end do

  contains

    !> Whether all that is left has the same answer.
    pure logical function are_alike(answer)
      logical, intent(in) :: answer(:)
      are_alike = all(answer .or. taken) .or. .not. any(answer .and. .not. taken)
    end function are_alike

    !> The deepest point without a source, the first of those as deep; 0 where all have one.
    pure integer function deepest_new() result(found)
      integer :: k

      found = 0
      do k = 1, points%n
        if (source(k) > 0) cycle
        if (found > 0) then
          if (as_many) return
          if (points%gap(k) >= points%gap(found) - as_deep*norm2(points%point(:, k) - points%point(:, found))) cycle
        end if
        found = k
      end do
    end function deepest_new

    !> What is left of the pair and bore most, the first of several; 0 where nothing is left.
    pure integer function heaviest_left() result(found)
      integer :: l

      found = 0
      do l = 1, size(load)
        if (taken(l)) cycle
        if (found > 0) then
          if (as_many .or. (has_state(found) .and. .not. has_state(l))) cycle
          if ((has_state(found) .eqv. has_state(l)) .and. load(l) <= load(found)) cycle
        end if
        found = l
      end do
    end function heaviest_left

  end subroutine find_sources

end module gravier_pair_points
