!> Pieces that end: segments of a line in 2D, rectangles of a plane in 3D. Grains touch them from both sides.
module gravier_flat_piece
  use gravier_kinds, only: dp
  use gravier_magnitude, only: is_size
  use gravier_rotation, only: cross
  use gravier_declared_keys, only: declared_key_t
  use gravier_surface, only: surface_t, surface_features_t, point_key, is_vector
  implicit none
  private
  public :: segment_t, rectangle_t

  !> shortest edge
  character(len=*), parameter :: shortest = "1e-30 m"
  !> largest cosine of the angle between the edges of a rectangle
  real(dp), parameter :: right_angle = 1.0e-6_dp

  !> From `point`, an end, along the first edge.
  type, extends(surface_t) :: segment_t
  contains
    procedure, nopass :: features => segment_features
    procedure, nopass :: keys => segment_keys
    procedure :: set => segment_set
    procedure :: locate => segment_locate
    procedure :: parts => segment_parts
  end type segment_t

  !> From `point`, a corner, along both edges.
  type, extends(surface_t) :: rectangle_t
  contains
    procedure, nopass :: features => rectangle_features
    procedure, nopass :: keys => rectangle_keys
    procedure :: set => rectangle_set
    procedure :: locate => rectangle_locate
    procedure :: own_area => rectangle_own_area
    procedure :: parts => rectangle_parts
  end type rectangle_t

contains

  pure function segment_features() result(features)
    type(surface_features_t) :: features
    features = surface_features_t("segment", dimensions=[.true., .false.])
  end function segment_features

  pure function rectangle_features() result(features)
    type(surface_features_t) :: features
    features = surface_features_t("rectangle", dimensions=[.false., .true.])
  end function rectangle_features

  pure subroutine segment_keys(keys)
    type(declared_key_t), allocatable, intent(out) :: keys(:)

    allocate (keys(2))
    keys(1) = point_key
    keys(2) = declared_key_t("end", "", "", "m", "the second end, another than `point`", 3)
  end subroutine segment_keys

  pure subroutine rectangle_keys(keys)
    type(declared_key_t), allocatable, intent(out) :: keys(:)

    allocate (keys(3))
    keys(1) = point_key
    keys(2) = declared_key_t("edge_a", "", "not all 0", "m", "an edge, from the corner `point`", 3)
    keys(3) = declared_key_t("edge_b", "", "not all 0", "m", &
      & "the other edge from the corner `point`, at right angles to `edge_a` within 1e-6", 3)
  end subroutine rectangle_keys

  pure subroutine segment_set(self, values, wrong, expected)
    class(segment_t), intent(inout) :: self
    real(dp), intent(in), contiguous :: values(:, :)
    character(len=:), allocatable, intent(out) :: wrong, expected

    wrong = ""
    expected = ""
    self%point(:) = values(:, 1)
    self%edge(:, 1) = values(:, 2) - values(:, 1)
    if (is_length(self%edge(:, 1))) return
    wrong = "end"
    expected = "a point at least "//shortest//" from point"
    if (.not. is_vector(self%edge(:, 1))) expected = "another point than point"
  end subroutine segment_set

  pure subroutine rectangle_set(self, values, wrong, expected)
    class(rectangle_t), intent(inout) :: self
    real(dp), intent(in), contiguous :: values(:, :)
    character(len=:), allocatable, intent(out) :: wrong, expected

    wrong = ""
    expected = ""
    self%point(:) = values(:, 1)
    self%edge(:, :) = values(:, 2:3)
    if (.not. is_vector(self%edge(:, 1))) then
      wrong = "edge_a"
    else if (.not. is_vector(self%edge(:, 2))) then
      wrong = "edge_b"
    else if (.not. is_length(self%edge(:, 1))) then
      wrong = "edge_a"
      expected = "a length of at least "//shortest
    else if (.not. is_length(self%edge(:, 2))) then
      wrong = "edge_b"
      expected = "a length of at least "//shortest
    else if (.not. abs(cosine(self%edge(:, 1), self%edge(:, 2))) <= right_angle) then
      wrong = "edge_b"
      expected = "an edge at right angles to {edge_a}, within 1e-6"
    end if
  end subroutine rectangle_set

  pure subroutine segment_locate(self, from, distance, normal)
    class(segment_t), intent(in) :: self
    real(dp), intent(in) :: from(3)
    real(dp), intent(out) :: distance, normal(3)

    normal(:) = from - share_along(from, self%edge(:, 1))*self%edge(:, 1)
    call part(from, self%edge(:, 1), [0.0_dp, 0.0_dp, 1.0_dp], distance, normal)
  end subroutine segment_locate

  pure subroutine rectangle_locate(self, from, distance, normal)
    class(rectangle_t), intent(in) :: self
    real(dp), intent(in) :: from(3)
    real(dp), intent(out) :: distance, normal(3)

    normal(:) = from - share_along(from, self%edge(:, 1))*self%edge(:, 1)
    normal(:) = normal - share_along(from, self%edge(:, 2))*self%edge(:, 2)
    call part(from, self%edge(:, 1), self%edge(:, 2), distance, normal)
  end subroutine rectangle_locate

  pure real(dp) function rectangle_own_area(self) result(area)
    class(rectangle_t), intent(in) :: self
    area = norm2(self%edge(:, 1))*norm2(self%edge(:, 2))
  end function rectangle_own_area

  pure logical function segment_parts(self, from, to) result(parts)
    class(segment_t), intent(in) :: self
    real(dp), intent(in) :: from(3), to(3)
    real(dp) :: normal(3), at(3)

    normal(:) = 0.0_dp
    normal(1) = -self%edge(2, 1)
    normal(2) = self%edge(1, 1)
    call cross_plane(normal, from, to, at, parts)
    if (parts) parts = is_on_edge(at, self%edge(:, 1))
  end function segment_parts

  pure logical function rectangle_parts(self, from, to) result(parts)
    class(rectangle_t), intent(in) :: self
    real(dp), intent(in) :: from(3), to(3)
    real(dp) :: normal(3), at(3)

    normal(:) = cross(self%edge(:, 1), self%edge(:, 2))
    call cross_plane(normal, from, to, at, parts)
    if (parts) parts = is_on_edge(at, self%edge(:, 1))
    if (parts) parts = is_on_edge(at, self%edge(:, 2))
  end function rectangle_parts

  !> Where the way between two points crosses the plane through the origin, if they are on its two sides.
  pure subroutine cross_plane(normal, from, to, at, crosses)
    real(dp), intent(in) :: normal(3), from(3), to(3)
    real(dp), intent(out) :: at(3)
    logical, intent(out) :: crosses
    real(dp) :: first, second

    first = sum(normal*from)
    second = sum(normal*to)
    crosses = (first > 0.0_dp .and. second < 0.0_dp) .or. (first < 0.0_dp .and. second > 0.0_dp)
    at(:) = 0.0_dp
    if (crosses) at(:) = from + first/(first - second)*(to - from)
  end subroutine cross_plane

  !> Whether the foot of a point on the line of an edge is on the edge.
  pure logical function is_on_edge(at, edge)
    real(dp), intent(in) :: at(3), edge(3)
    real(dp) :: along

    along = sum(at*edge)
    is_on_edge = along >= 0.0_dp .and. along <= sum(edge*edge)
  end function is_on_edge

  !> Length and direction of a vector from the foot of a point; on the surface the direction is the normal across two vectors.
  pure subroutine part(from, a, b, distance, normal)
    real(dp), intent(in) :: from(3), a(3), b(3)
    real(dp), intent(out) :: distance
    !> the vector in, the direction out
    real(dp), intent(inout) :: normal(3)
    real(dp) :: across(3)

    distance = norm2(normal)
    ! less is rounding, and has no direction
    if (distance > 8.0_dp*epsilon(1.0_dp)*norm2(from)) then
      normal(:) = normal/distance
    else
      across(:) = cross(a, b)
      normal(:) = across/norm2(across)
    end if
  end subroutine part

  !> Where the foot of `from` lies along an edge, in [0, 1].
  pure real(dp) function share_along(from, edge) result(share)
    real(dp), intent(in) :: from(3), edge(3)
    share = min(max(sum(from*edge)/sum(edge*edge), 0.0_dp), 1.0_dp)
  end function share_along

  !> Whether a vector is long enough for its square to count.
  pure logical function is_length(vector)
    !> [m]
    real(dp), intent(in) :: vector(3)
    is_length = is_size(maxval(abs(vector)))
  end function is_length

  !> Cosine of the angle between two vectors other than 0, of any length that a number can say.
  pure real(dp) function cosine(a, b)
    real(dp), intent(in) :: a(3), b(3)
    real(dp) :: u(3), v(3)

    u = a/maxval(abs(a))
    v = b/maxval(abs(b))
    cosine = dot_product(u, v)/(norm2(u)*norm2(v))
  end function cosine

end module gravier_flat_piece
