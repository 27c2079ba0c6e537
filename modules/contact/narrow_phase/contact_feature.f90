!> What two pieces touch each other with: the face, edge or vertex of each that lies across a common normal.
module gravier_contact_feature
  use gravier_kinds, only: dp
  use gravier_convex_piece, only: convex_piece_t, shares_corner
  use gravier_polygon_clip, only: one_place
  implicit none
  private
  public :: placement_t, feature_t, frame_t
  public :: find_feature, lay_out_feature, drop_inner, edge_number, face_number, turn_back

  !> Where a piece is: its lengths times a radius, its axes as columns, its centre [m].
  type :: placement_t
    real(dp) :: radius = 1.0_dp, rotation(3, 3) = 0.0_dp, centre(3) = 0.0_dp
  end type placement_t

  !> A part of a piece: a vertex, an edge or a face.
  type :: feature_t
    !> number of the face, or 0
    integer :: face = 0
    !> the vertex that is farthest, and the other end of an edge, or 0
    integer :: vertex = 0, other = 0
    !> corners
    integer :: n = 1
    !> where its piece is; `find_feature` leaves it to its caller
    type(placement_t) :: at
  end type feature_t

  !> Axes across a common normal, where their origin is, and up to which gap points count in it.
  type :: frame_t
    real(dp) :: origin(3), normal(3), first(3), second(3)
    !> points whose gap is this or more are no contacts [m]
    real(dp) :: alert = 0.0_dp
  end type frame_t

  !> A side of a face or an edge, seen from the plane of contact.
  type :: side_t
    !> from one corner to the next, in the axes and the unit of length of the piece
    real(dp) :: way(3)
    !> of the angle between the side and the plane of contact
    real(dp) :: sine
  end type side_t

  !> a face or edge within this angle of the plane of contact is one that the other piece touches as a whole: its sine and cosine
  real(dp), parameter :: most_sine = 0.2_dp
  real(dp), parameter :: least_cosine = sqrt(1.0_dp - most_sine**2)
  !> angle at which a side has no share of its sharp corners any more [rad]
  real(dp), parameter :: blend_angle = 0.02_dp
  !> a corner turns inwards where the sine of its turn is below the opposite of this
  real(dp), parameter :: inner = 1.0e-9_dp

contains

  !> The feature that lies across a direction and has the given vertices: the face most along the direction, else the edge most
  !> across it, each within an angle, else a vertex. Ties go to the lowest number.
  pure subroutine find_feature(piece, along, known, feature)
    type(convex_piece_t), intent(in) :: piece
    !> unit vector out of the piece, in its axes
    real(dp), intent(in) :: along(3)
    !> vertices nearest to the other piece; numbers may come twice
    integer, intent(in) :: known(:)
    type(feature_t), intent(out) :: feature
    real(dp) :: greatest, found
    integer :: f, k

    feature%vertex = known(1)
    greatest = least_cosine
    do k = piece%vertex_face_first(known(1)), piece%vertex_face_first(known(1) + 1) - 1
      f = piece%vertex_face(k)
      found = along(1)*piece%face_normal(1, f) + along(2)*piece%face_normal(2, f) + along(3)*piece%face_normal(3, f)
      if (found <= greatest) cycle
      if (.not. has_all(piece, f, known)) cycle
      greatest = found
      feature%face = f
    end do
    if (feature%face > 0) then
      feature%n = piece%face_first(feature%face + 1) - piece%face_first(feature%face)
      return
    end if
    call find_edge(piece, along, known, feature)
  end subroutine find_feature

  !> The edge most across a direction, of those that have the given vertices. Between vertices of one corner there is none.
  pure subroutine find_edge(piece, along, known, feature)
    type(convex_piece_t), intent(in) :: piece
    real(dp), intent(in) :: along(3)
    integer, intent(in) :: known(:)
    type(feature_t), intent(inout) :: feature
    real(dp) :: least, found, side(3)
    integer :: e, k

    least = most_sine
    do e = piece%neighbour_first(feature%vertex), piece%neighbour_first(feature%vertex + 1) - 1
      k = piece%neighbour(e)
      if (any(known /= feature%vertex .and. known /= k)) cycle
      if (shares_corner(piece, feature%vertex, k)) cycle
      side(:) = piece%vertex(:, k) - piece%vertex(:, feature%vertex)
      found = sine_of(side, along)
      if (found >= least) cycle
      least = found
      feature%other = k
      feature%n = 2
    end do
  end subroutine find_edge

  !> Whether a face has all of some vertices.
  pure logical function has_all(piece, f, known)
    type(convex_piece_t), intent(in) :: piece
    integer, intent(in) :: f, known(:)
    integer :: k, i

    has_all = .true.
    do i = 1, size(known)
      has_all = .false.
      do k = piece%vertex_face_first(known(i)), piece%vertex_face_first(known(i) + 1) - 1
        if (piece%vertex_face(k) == f) has_all = .true.
      end do
      if (.not. has_all) return
    end do
  end function has_all

  !> Sine of the angle between a side and the plane across a unit vector; 0 for a side without length.
  pure real(dp) function sine_of(side, along)
    real(dp), intent(in) :: side(3), along(3)
    real(dp) :: length

    length = sqrt(dot_product(side, side))
    sine_of = 0.0_dp
    if (length > 0.0_dp) sine_of = abs(dot_product(side, along))/length
  end function sine_of

  !> Corners of a face or an edge in the axes of a frame, blended: between those of the core and the sharp ones, the nearer to these
  !> the more a side lies in the plane of contact.
  pure subroutine lay_out_feature(piece, feature, frame, m, vertex, place)
    type(convex_piece_t), intent(in) :: piece
    type(feature_t), intent(in) :: feature
    type(frame_t), intent(in) :: frame
    !> corners: those of the feature, but for some that blending has put inside
    integer, intent(out) :: m
    !> numbers of the corners' vertices (m or more)
    integer, intent(out) :: vertex(:)
    !> along both axes of the frame and its normal (3, m or more) [m]
    real(dp), intent(out) :: place(:, :)
    type(side_t) :: side(feature%n)
    real(dp) :: along(3), x(3), y(3)
    integer :: k, last

    m = feature%n
    if (feature%face > 0) then
      vertex(1:m) = piece%face_vertex(piece%face_first(feature%face):piece%face_first(feature%face + 1) - 1)
    else
      vertex(1) = min(feature%vertex, feature%other)
      vertex(2) = max(feature%vertex, feature%other)
    end if
    call turn_back(feature%at, frame%normal, along)
    do k = 1, m
      side(k)%way(:) = piece%vertex(:, vertex(mod(k, m) + 1)) - piece%vertex(:, vertex(k))
      side(k)%sine = sine_of(side(k)%way, along)
    end do
    do k = 1, m
      x(:) = piece%vertex(:, vertex(k))
      last = mod(k + m - 2, m) + 1
      if (piece%reaches_out .and. min(side(last)%sine, side(k)%sine) < blend_angle) then
        if (feature%face > 0) then
          call blend_in_face(piece, feature%face, vertex(k), along, side(last), side(k), x)
        else
          call blend_along(piece, vertex(k), side(k), x)
        end if
      end if
      call place_point(feature%at, x, y)
      y(:) = y - frame%origin
      place(1, k) = dot_product(y, frame%first)
      place(2, k) = dot_product(y, frame%second)
      place(3, k) = dot_product(y, frame%normal)
    end do
    if (feature%face > 0 .and. m > 3) call drop_inner(sign(1.0_dp, dot_product(along, piece%face_normal(:, feature%face))), &
      & one_place*feature%at%radius, m, vertex, place)
  end subroutine lay_out_feature

  !> Leave out corners where a polygon turns inwards, as it may beside a corner of which one side only was lengthened: what is left
  !> are the corners of its convex hull, whatever corner the list begins with, and whichever way round it goes. Corners at one place
  !> stay or go together: rounding turns the side between them to anywhere.
  pure subroutine drop_inner(sense, least, m, vertex, place)
    !> 1.0 for a polygon that is anticlockwise, -1.0 for one that is clockwise
    real(dp), intent(in) :: sense
    !> corners this near to each other are at one place [m]
    real(dp), intent(in) :: least
    integer, intent(inout) :: m, vertex(:)
    real(dp), intent(inout) :: place(:, :)

    if (turns_inwards(sense, least, place(1:2, 1:m))) call keep_hull(sense, least, m, vertex, place)
  end subroutine drop_inner

  !> Keep the corners of the convex hull of a polygon.
  pure subroutine keep_hull(sense, least, m, vertex, place)
    real(dp), intent(in) :: sense, least
    integer, intent(inout) :: m, vertex(:)
    real(dp), intent(inout) :: place(:, :)
    integer :: hull(m), at(m), number(m), n, k, j, i, last
    real(dp) :: spot(2, m), height(m)

    n = 0
    do k = 1, m
      do i = 1, n
        if (max(abs(place(1, k) - spot(1, i)), abs(place(2, k) - spot(2, i))) <= least) exit
      end do
      at(k) = i
      if (i > n) then
        n = i
        spot(:, i) = place(1:2, k)
      end if
      number(k) = vertex(k)
      height(k) = place(3, k)
    end do
    call find_outline(sense, spot(:, 1:n), n, hull)
    if (n < 3) return
    m = 0
    do k = 1, n
      ! from the first of those that follow each other
      do j = 1, size(at)
        last = merge(size(at), j - 1, j == 1)
        if (at(j) == hull(k) .and. at(last) /= hull(k)) exit
      end do
      do last = j, j + size(at) - 1
        i = mod(last - 1, size(at)) + 1
        if (at(i) /= hull(k)) cycle
        m = m + 1
        vertex(m) = number(i)
        place(1:2, m) = spot(:, hull(k))
        place(3, m) = height(i)
      end do
    end do
  end subroutine keep_hull

  !> The corners of the convex hull of places apart from each other, in turn from the lowest number on (R. A. Jarvis, Inf. Process.
  !> Lett. 2 (1973) 18).
  pure subroutine find_outline(sense, place, n, hull)
    real(dp), intent(in) :: sense, place(:, :)
    !> corners of the hull; 0 where it does not close, as for corners in a line
    integer, intent(out) :: n, hull(:)
    integer :: chain(size(hull)), k, next, first
    real(dp) :: arriving(2)

    arriving(1) = 0.0_dp
    arriving(2) = -sense
    next = minloc(place(1, :), 1)
    n = 0
    do while (all(chain(1:n) /= next))
      k = next
      n = n + 1
      chain(n) = k
      next = next_on_hull(sense, place, k, arriving)
      if (next == 0) then
        n = 0
        return
      end if
      arriving(:) = place(:, next) - place(:, k)
    end do
    first = n
    do while (chain(first) /= next)
      first = first - 1
    end do
    n = n - first + 1
    k = minloc(chain(first:first + n - 1), 1)
    do next = 1, n
      hull(next) = chain(first + modulo(next + k - 2, n))
    end do
  end subroutine find_outline

  !> Whether some corner of a polygon turns inwards, or its sides go round more than once, as where three corners that blending has
  !> brought near to each other make a loop.
  pure logical function turns_inwards(sense, least, place)
    !> length up to which sides do not count
    real(dp), intent(in) :: sense, least
    real(dp), intent(in) :: place(:, :)
    real(dp) :: u(2), v(2)
    integer :: k, rounds

    do k = size(place, 2), 1, -1
      u(:) = place(:, merge(1, k + 1, k == size(place, 2))) - place(:, k)
      if (max(abs(u(1)), abs(u(2))) > least) exit
    end do
    turns_inwards = .true.
    rounds = 0
    do k = 1, size(place, 2)
      v(:) = place(:, merge(1, k + 1, k == size(place, 2))) - place(:, k)
      if (max(abs(v(1)), abs(v(2))) <= least) cycle
      if (is_inner(u, v)) return
      rounds = rounds + merge(1, 0, u(1) >= 0.0_dp .and. v(1) < 0.0_dp)
      u(:) = v
    end do
    turns_inwards = rounds > 1

  contains

    pure logical function is_inner(u, v)
      real(dp), intent(in) :: u(2), v(2)
      is_inner = sense*(u(1)*v(2) - u(2)*v(1)) < 0.0_dp
      if (is_inner) is_inner = sense*sine(u, v) < -inner
    end function is_inner

  end function turns_inwards

  !> The corner of the convex hull that follows corner `k` of it: the outermost, or the nearest of those in line with it. 0 where
  !> all others are where the hull comes from.
  pure integer function next_on_hull(sense, place, k, arriving) result(next)
    real(dp), intent(in) :: sense, place(:, :)
    integer, intent(in) :: k
    !> side of the hull before corner `k`
    real(dp), intent(in) :: arriving(2)
    real(dp) :: u(2), v(2), nearest
    integer :: j, outermost

    outermost = 0
    v(:) = 0.0_dp
    do j = 1, size(place, 2)
      if (j == k) cycle
      u(:) = place(:, j) - place(:, k)
      if (dot_product(arriving, u) < 0.0_dp .and. abs(sine(arriving, u)) <= inner) cycle
      if (outermost > 0 .and. sense*(v(1)*u(2) - v(2)*u(1)) >= 0.0_dp) cycle
      outermost = j
      v(:) = u
    end do
    next = outermost
    nearest = dot_product(v, v)
    do j = 1, size(place, 2)
      if (j == k .or. j == outermost) cycle
      u(:) = place(:, j) - place(:, k)
      if (dot_product(u, u) >= nearest) cycle
      v(:) = place(:, outermost) - place(:, j)
      if (dot_product(u, v) <= 0.0_dp) cycle
      if (sense*sine(u, v) < -inner) cycle
      next = j
      nearest = dot_product(u, u)
    end do
  end function next_on_hull

  !> Sine of the angle from one vector to another, neither of which is 0.
  pure real(dp) function sine(u, v)
    real(dp), intent(in) :: u(2), v(2)
    sine = (u(1)*v(2) - u(2)*v(1))/sqrt(dot_product(u, u)*dot_product(v, v))
  end function sine

  !> Move a corner of a face towards its sharp place: within the face where both of its sides lie in the plane of contact, along a
  !> side where only that one does.
  pure subroutine blend_in_face(piece, f, v, along, before, behind, x)
    type(convex_piece_t), intent(in) :: piece
    !> face, corner
    integer, intent(in) :: f, v
    !> normal of the plane of contact
    real(dp), intent(in) :: along(3)
    !> sides of the face that end and begin at the corner
    type(side_t), intent(in) :: before, behind
    real(dp), intent(inout) :: x(3)
    real(dp) :: way(3), long_before, long_behind, part_before, part_behind, share_before, share_behind, share

    way(:) = piece%corner(:, v) - piece%vertex(:, v)
    way(:) = way - dot_product(way, piece%face_normal(:, f))*piece%face_normal(:, f)
    long_before = sqrt(dot_product(before%way, before%way))
    long_behind = sqrt(dot_product(behind%way, behind%way))
    if (.not. min(long_before, long_behind) > 0.0_dp) return
    part_before = dot_product(way, before%way)/long_before
    part_behind = dot_product(way, behind%way)/long_behind
    share_before = share_of(before%sine, abs(part_before), piece%rounding)
    share_behind = share_of(behind%sine, abs(part_behind), piece%rounding)
    share = min(share_before*share_behind, share_of(sine_of(way, along), sqrt(dot_product(way, way)), piece%rounding))
    x(:) = x + share*way + share_before*(1.0_dp - share_behind)*part_before/long_before*before%way + &
      & (1.0_dp - share_before)*share_behind*part_behind/long_behind*behind%way
  end subroutine blend_in_face

  !> Move an end of an edge towards its sharp place.
  pure subroutine blend_along(piece, v, side, x)
    type(convex_piece_t), intent(in) :: piece
    integer, intent(in) :: v
    type(side_t), intent(in) :: side
    real(dp), intent(inout) :: x(3)
    real(dp) :: way(3), squared

    way(:) = piece%corner(:, v) - piece%vertex(:, v)
    squared = dot_product(side%way, side%way)
    if (squared > 0.0_dp) way(:) = dot_product(way, side%way)/squared*side%way
    x(:) = x + share_of(side%sine, sqrt(dot_product(way, way)), piece%rounding)*way
  end subroutine blend_along

  !> Share of a way to a sharp corner, by the sine of the angle out of the plane of contact. Long ways, of thin corners, get theirs
  !> at smaller angles, so that no corner is moved out of the plane by more than a two-hundredth of the rounding.
  pure real(dp) function share_of(sine, length, rounding)
    real(dp), intent(in) :: sine, length, rounding
    real(dp) :: over

    ! segments and rectangles have no rounding, and no way
    over = 1.0_dp
    if (length > rounding) over = length/rounding
    share_of = max(0.0_dp, 1.0_dp - sine/blend_angle*over)
  end function share_of

  !> Number of an edge among the features of a piece: behind those of the vertices, by its place in the list of neighbours of its
  !> lower end; of the lower end where there is no such edge.
  pure integer function edge_number(piece, v, w)
    type(convex_piece_t), intent(in) :: piece
    integer, intent(in) :: v, w
    integer :: k

    edge_number = min(v, w) - 1
    do k = piece%neighbour_first(min(v, w)), piece%neighbour_first(min(v, w) + 1) - 1
      if (piece%neighbour(k) /= max(v, w)) cycle
      edge_number = size(piece%vertex, 2) + k - 1
      return
    end do
  end function edge_number

  !> Number of a face among the features of a piece, behind those of the edges.
  pure integer function face_number(piece, f)
    type(convex_piece_t), intent(in) :: piece
    integer, intent(in) :: f
    face_number = size(piece%vertex, 2) + size(piece%neighbour) + f - 1
  end function face_number

  !> Where a point of a piece is [m].
  pure subroutine place_point(at, point, x)
    type(placement_t), intent(in) :: at
    real(dp), intent(in) :: point(3)
    real(dp), intent(out) :: x(3)
    real(dp) :: u(3)
    integer :: k

    u(:) = at%radius*point
    do k = 1, 3
      x(k) = at%centre(k) + (at%rotation(k, 1)*u(1) + at%rotation(k, 2)*u(2) + at%rotation(k, 3)*u(3))
    end do
  end subroutine place_point

  !> A direction in the axes of a piece.
  pure subroutine turn_back(at, v, u)
    type(placement_t), intent(in) :: at
    real(dp), intent(in) :: v(3)
    real(dp), intent(out) :: u(3)
    integer :: k

    do k = 1, 3
      u(k) = at%rotation(1, k)*v(1) + at%rotation(2, k)*v(2) + at%rotation(3, k)*v(3)
    end do
  end subroutine turn_back

end module gravier_contact_feature
