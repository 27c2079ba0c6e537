!> The part of a body that lies in a box with sides along the axes.
!>
!> The part of a convex piece below planes that cross at right angles, one an axis at most, is the sum of the cones from a point
!> that all of these planes have in common to what they leave of its sides: what they cut open lies in planes through that point,
!> and its cones have no volume. A box takes the difference of such parts. Boxes that fill space therefore have all of a body.
module gravier_body_part
  use gravier_kinds, only: dp
  use gravier_orientation, only: shape_axes
  use gravier_spatial, only: triple_product
  use gravier_convex_piece, only: convex_piece_t
  use gravier_shape_library, only: body_shape_t
  implicit none
  private
  public :: turned_body_t, ball_below

  !> slices of a capsule between its ends, and of each of its round ends
  integer, parameter :: slices = 16
  real(dp), parameter :: pi = acos(-1.0_dp)

  !> A body with a shape, turned and at its size, about its centre.
  type :: turned_body_t
    integer :: nd = 0
    !> box around it (nd) [m]
    real(dp) :: low(3) = 0.0_dp, high(3) = 0.0_dp
    !> of the sum of its pieces [m^3, m^2 in 2D]
    real(dp), private :: volume = 0.0_dp
    !> [m]
    real(dp), private :: radius = 0.0_dp
    !> sharp corners of piece p: corner(:, first(p):first(p + 1) - 1); both have room for more [m]
    integer, private, allocatable :: first(:)
    real(dp), private, allocatable :: corner(:, :)
  contains
    procedure :: turn => turned_body_turn
    procedure :: share_between => turned_body_share_between
    procedure, private :: below => turned_body_below
  end type turned_body_t

contains

  !> Take a body of a shape.
  pure subroutine turned_body_turn(self, shape, nd, radius, orientation)
    class(turned_body_t), intent(inout) :: self
    type(body_shape_t), intent(in) :: shape
    integer, intent(in) :: nd
    !> [m]; as bodies store it
    real(dp), intent(in) :: radius, orientation(:)
    real(dp) :: axes(3, 3), round, side(3)
    logical :: cut(3)
    integer :: p, v, d, n

    self%nd = nd
    self%radius = radius
    call shape_axes(orientation, axes)
    n = 0
    do p = 1, size(shape%piece)
      n = n + size(shape%piece(p)%corner, 2)
    end do
    if (allocated(self%first)) then
      if (size(self%first) <= size(shape%piece) .or. size(self%corner, 2) < n) deallocate (self%first, self%corner)
    end if
    if (.not. allocated(self%first)) allocate (self%first(size(shape%piece) + 1), self%corner(3, n))
    self%first(1) = 1
    self%low(:) = huge(1.0_dp)
    self%high(:) = -huge(1.0_dp)
    n = 0
    do p = 1, size(shape%piece)
      associate (piece => shape%piece(p))
        round = 0.0_dp
        if (size(piece%corner, 2) <= 2) round = radius*piece%rounding
        do v = 1, size(piece%corner, 2)
          n = n + 1
          self%corner(:, n) = 0.0_dp
          do d = 1, nd
            self%corner(d, n) = radius*sum(axes(d, 1:nd)*piece%corner(:, v))
          end do
          self%low(:) = min(self%low, self%corner(:, n) - round)
          self%high(:) = max(self%high, self%corner(:, n) + round)
        end do
        self%first(p + 1) = n + 1
      end associate
    end do
    cut(:) = .false.
    side(:) = 0.0_dp
    self%volume = self%below(shape, side, cut)
  end subroutine turned_body_turn

  !> The share of the body between two corners of a box, about the centre of the body. It is 1 where all of it is inside.
  pure real(dp) function turned_body_share_between(self, shape, from, to) result(share)
    class(turned_body_t), intent(in) :: self
    type(body_shape_t), intent(in) :: shape
    !> (nd) [m]
    real(dp), intent(in) :: from(:), to(:)
    real(dp) :: side(3), part
    logical :: cut(3)
    integer :: choice, d, term

    share = 0.0_dp
    if (any(to <= self%low(1:self%nd)) .or. any(from >= self%high(1:self%nd))) return
    share = 1.0_dp
    if (all(from <= self%low(1:self%nd)) .and. all(to >= self%high(1:self%nd))) return
    share = 0.0_dp
    choices: do choice = 0, 2**self%nd - 1
      term = 1
      side(:) = 0.0_dp
      cut(:) = .false.
      do d = 1, self%nd
        if (btest(choice, d - 1)) then
          ! nothing is below a side that the body is above
          if (from(d) <= self%low(d)) cycle choices
          term = -term
          side(d) = from(d)
          cut(d) = .true.
        else if (to(d) < self%high(d)) then
          side(d) = to(d)
          cut(d) = .true.
        end if
      end do
      part = self%volume
      if (any(cut)) part = self%below(shape, side, cut)
      share = share + term*part
    end do choices
    share = share/self%volume
  end function turned_body_share_between

  !> The volume below sides along some axes.
  pure real(dp) function turned_body_below(self, shape, side, cut) result(volume)
    class(turned_body_t), intent(in) :: self
    type(body_shape_t), intent(in) :: shape
    !> where there is a side, else 0 [m]
    real(dp), intent(in) :: side(3)
    !> whether there is one
    logical, intent(in) :: cut(3)
    integer :: p

    volume = 0.0_dp
    do p = 1, size(shape%piece)
      associate (piece => shape%piece(p), corner => self%corner(:, self%first(p):self%first(p + 1) - 1))
        if (size(piece%corner, 2) <= 2) then
          volume = volume + round_below(corner, self%radius*piece%rounding, self%nd, side, cut)
        else if (self%nd == 2) then
          volume = volume + polygon_below(corner, side, cut)
        else
          volume = volume + polyhedron_below(piece, corner, side, cut)
        end if
      end associate
    end do
  end function turned_body_below

  !> The area of a polygon below sides.
  pure real(dp) function polygon_below(corner, side, cut) result(area)
    !> anticlockwise (3, n)
    real(dp), intent(in) :: corner(:, :), side(3)
    logical, intent(in) :: cut(3)
    real(dp) :: edge(3, 16)
    integer :: v, n

    area = 0.0_dp
    do v = 1, size(corner, 2)
      edge(:, 1) = corner(:, v) - side
      edge(:, 2) = corner(:, mod(v, size(corner, 2)) + 1) - side
      n = 2
      call keep_below(cut, .false., edge, n)
      if (n == 2) area = area + 0.5_dp*(edge(1, 1)*edge(2, 2) - edge(2, 1)*edge(1, 2))
    end do
  end function polygon_below

  !> The volume of a polyhedron below sides.
  pure real(dp) function polyhedron_below(piece, corner, side, cut) result(volume)
    type(convex_piece_t), intent(in) :: piece
    !> (3, n)
    real(dp), intent(in) :: corner(:, :), side(3)
    logical, intent(in) :: cut(3)
    ! a cut adds a corner at most for each, where rounding makes an edge in the plane cross it several times
    real(dp) :: face(3, 8*piece%largest_face)
    integer :: f, k, n

    volume = 0.0_dp
    do f = 1, size(piece%face_first) - 1
      n = piece%face_first(f + 1) - piece%face_first(f)
      do k = 1, n
        face(:, k) = corner(:, piece%face_vertex(piece%face_first(f) + k - 1)) - side
      end do
      call keep_below(cut, .true., face, n)
      do k = 2, n - 1
        volume = volume + triple_product(face(:, 1), face(:, k), face(:, k + 1))/6.0_dp
      end do
    end do
  end function polyhedron_below

  !> Keep what of a convex polygon, or of a segment, is below 0 along the axes that are cut.
  pure subroutine keep_below(cut, closed, point, n)
    logical, intent(in) :: cut(3)
    !> a polygon, not a segment
    logical, intent(in) :: closed
    !> room for eight times as many
    real(dp), intent(inout) :: point(:, :)
    integer, intent(inout) :: n
    real(dp) :: kept(3, size(point, 2))
    integer :: d, k, m, next

    do d = 1, 3
      if (.not. cut(d)) cycle
      m = 0
      do k = 1, n
        if (point(d, k) <= 0.0_dp) then
          m = m + 1
          kept(:, m) = point(:, k)
        end if
        if (k == n .and. .not. closed) exit
        next = mod(k, n) + 1
        if ((point(d, k) > 0.0_dp) .eqv. (point(d, next) > 0.0_dp)) cycle
        m = m + 1
        kept(:, m) = point(:, k) + (point(d, k)/(point(d, k) - point(d, next)))*(point(:, next) - point(:, k))
        kept(d, m) = 0.0_dp
      end do
      n = m
      point(:, 1:n) = kept(:, 1:n)
    end do
  end subroutine keep_below

  !> The volume of a capsule, or of a disk or a ball, below sides: the product of its parts below each.
  pure real(dp) function round_below(ends, radius, nd, side, cut) result(volume)
    !> (3, 1 or 2)
    real(dp), intent(in) :: ends(:, :), radius
    integer, intent(in) :: nd
    real(dp), intent(in) :: side(3)
    logical, intent(in) :: cut(3)
    integer :: d

    volume = merge(pi*radius**2, 4.0_dp*pi*radius**3/3.0_dp, nd == 2)
    if (size(ends, 2) == 2) volume = volume + norm2(ends(:, 2) - ends(:, 1))*merge(2.0_dp*radius, pi*radius**2, nd == 2)
    do d = 1, nd
      if (.not. cut(d)) cycle
      if (size(ends, 2) == 1) then
        volume = volume*ball_below(side(d), ends(d, 1), radius, nd)
      else
        volume = volume*capsule_below(side(d), ends, d, radius, nd)
      end if
    end do
  end function round_below

  !> The part of a capsule on the lower side of a plane, by slices across it: to about 1e-4.
  pure real(dp) function capsule_below(plane, ends, d, radius, nd) result(part)
    !> [m]
    real(dp), intent(in) :: plane, ends(:, :)
    !> axis of the plane
    integer, intent(in) :: d
    real(dp), intent(in) :: radius
    integer, intent(in) :: nd
    real(dp) :: way(3), length, tilt, angle, width, total
    integer :: k

    way(:) = ends(:, 2) - ends(:, 1)
    length = norm2(way)
    way(:) = way/length
    tilt = sqrt(max(1.0_dp - way(d)**2, 0.0_dp))
    part = 0.0_dp
    total = 0.0_dp
    do k = 1, slices
      call add_slice(ends(d, 1) + (k - 0.5_dp)/slices*length*way(d), radius, length/slices, part, total)
      angle = 0.5_dp*pi*(k - 0.5_dp)/slices
      width = radius*cos(angle)
      call add_slice(ends(d, 1) - radius*sin(angle)*way(d), width, 0.5_dp*pi*width/slices, part, total)
      call add_slice(ends(d, 2) + radius*sin(angle)*way(d), width, 0.5_dp*pi*width/slices, part, total)
    end do
    part = part/total

  contains

    !> a ball of one axis less: what of it is below the plane, and all of it
    pure subroutine add_slice(x, half, thickness, below, all_of_it)
      real(dp), intent(in) :: x, half, thickness
      real(dp), intent(inout) :: below, all_of_it

      all_of_it = all_of_it + thickness*half**(nd - 1)
      below = below + thickness*half**(nd - 1)*ball_below(plane, x, half*tilt, nd - 1)
    end subroutine add_slice

  end function capsule_below

  !> The part of a ball, a disk or a segment on the lower side of a plane: 1/2 + t (3 - t^2)/4, 1/2 + (t sqrt(1 - t^2) + asin t)/pi
  !> or 1/2 + t/2, with t the distance of the plane from the centre in radii (volumes of segments of balls).
  pure real(dp) function ball_below(plane, x, radius, nd) result(part)
    !> [m]
    real(dp), intent(in) :: plane, x, radius
    integer, intent(in) :: nd
    real(dp) :: t

    part = 0.0_dp
    if (plane <= x - radius) return
    part = 1.0_dp
    if (plane >= x + radius) return
    t = min(max((plane - x)/radius, -1.0_dp), 1.0_dp)
    select case (nd)
    case (1)
      part = 0.5_dp + 0.5_dp*t
    case (2)
      part = 0.5_dp + (t*sqrt(1.0_dp - t**2) + asin(t))/pi
    case default
      part = 0.5_dp + 0.25_dp*t*(3.0_dp - t**2)
    end select
  end function ball_below

end module gravier_body_part
