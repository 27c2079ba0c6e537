!> What the surface of a boundary is: its place, its keys in the input, and the answers that contacts, lists and checks ask of it.
module gravier_surface
  use gravier_kinds, only: dp, i8
  use gravier_declared_keys, only: declared_key_t
  use gravier_facet, only: near_facets_t
  implicit none
  private
  public :: surface_t, surface_features_t, point_key, set_direction, is_vector, facing

  !> least component along an axis of the unit normal of what faces along it
  real(dp), parameter :: facing = 0.99_dp

  !> how far the edge of a surface that goes round a period may be from it in length and direction, over the period
  real(dp), parameter :: round_error = 1.0e-9_dp

  !> the key that all shapes have
  type(declared_key_t), parameter :: point_key = declared_key_t("point", "3*0", "", "m", &
    & "a point of a plane, of an outlet or of the axis of a cylinder, "// &
    & "the first end of a segment, a corner of a rectangle, the centre of a circle, the origin of the file of a mesh", 3)

  !> What holds for all surfaces of a shape.
  type :: surface_features_t
    !> its word in the input
    character(len=16) :: kind = ""
    !> scenes of two and of three dimensions may have it
    logical :: dimensions(2:3) = .true.
    !> grains can touch it
    logical :: touches = .true.
    !> grains leave the scene behind it
    logical :: lets_out = .false.
    !> it is a plane: it goes on for ever, with one normal
    logical :: endless = .false.
    !> it goes on for ever along `axis`
    logical :: endless_axis = .false.
    !> grains are inside
    logical :: encloses = .false.
    !> it is made of facets that a file has: a grain may touch it in several points
    logical :: faceted = .false.
  end type surface_features_t

  !> A surface where it is now. Its vectors move and turn with the boundary; in 2D their third component is 0. A shape that needs
  !> lengths of its own has them as components of its type.
  type, abstract :: surface_t
    !> the point that the shape names [m]
    real(dp) :: point(3) = 0.0_dp
    !> unit normal towards the free side, or unit vector along an axis; 0 where the shape has neither
    real(dp) :: axis(3) = 0.0_dp
    !> edges from the point, 0 where the shape has none [m]
    real(dp) :: edge(3, 2) = 0.0_dp
    !> 0 where the shape has none [m]
    real(dp) :: radius = 0.0_dp
    !> what `features` says, at hand where it is asked for each grain; set by the registry, which makes surfaces
    type(surface_features_t) :: is = surface_features_t()
  contains
    procedure(surface_features), deferred, nopass :: features
    procedure(surface_keys), deferred, nopass :: keys
    procedure(surface_set), deferred :: set
    procedure(surface_locate), deferred :: locate
    procedure :: take_facets => surface_take_facets
    procedure :: find_facets => surface_find_facets
    procedure :: find_box => surface_find_box
    procedure :: n_facets => surface_n_facets
    procedure :: n_left_out => surface_n_left_out
    procedure :: get_facet => surface_get_facet
    procedure :: find_axes => surface_find_axes
    procedure :: far_off => surface_far_off
    procedure :: digest => surface_digest
    procedure :: find_middle => surface_find_middle
    procedure :: half_width => surface_half_width
    procedure :: edge_round => surface_edge_round
    procedure :: stretch => surface_stretch
    procedure :: way => surface_way
    procedure :: own_area => surface_own_area
    procedure :: share_inside => surface_share_inside
    procedure :: shut => surface_shut
    procedure :: parts => surface_parts
    procedure :: level => surface_level
    procedure :: support => surface_support
  end type surface_t

  abstract interface
    pure function surface_features() result(features)
      import :: surface_features_t
      implicit none
      type(surface_features_t) :: features
    end function surface_features
    !> Its keys. A key that several shapes have is the same in all of them: default, rule, unit and meaning.
    pure subroutine surface_keys(keys)
      import :: declared_key_t
      implicit none
      type(declared_key_t), allocatable, intent(out) :: keys(:)
    end subroutine surface_keys
    !> Take the values of the keys, (3, keys) in their order. Where one cannot be, `wrong` names it and `expected` says what was
    !> expected; blank: what its rule says. A key in braces stands for its value in `expected`.
    pure subroutine surface_set(self, values, wrong, expected)
      import :: surface_t, dp
      implicit none
      class(surface_t), intent(inout) :: self
      real(dp), intent(in), contiguous :: values(:, :)
      character(len=:), allocatable, intent(out) :: wrong, expected
    end subroutine surface_set
    !> Nearest point of the surface to a point that lies `from` the point of the surface: distance from it [m], negative behind a
    !> surface that has a behind, and unit normal there towards the point asked about.
    pure subroutine surface_locate(self, from, distance, normal)
      import :: surface_t, dp
      implicit none
      class(surface_t), intent(in) :: self
      real(dp), intent(in) :: from(3)
      real(dp), intent(out) :: distance, normal(3)
    end subroutine surface_locate
  end interface

contains

  !> Take the facets of a file; without effect on a shape that is not faceted.
  subroutine surface_take_facets(self, corner)
    class(surface_t), intent(inout) :: self
    !> (3, 2 or 3 by the dimension, facets) [unit of the file]
    real(dp), intent(in), contiguous :: corner(:, :, :)

    associate (unused_self => self, unused => corner)
    end associate
  end subroutine surface_take_facets

  !> Add the facets that are within `reach` of a point to those found; a shape that is not faceted has none.
  pure subroutine surface_find_facets(self, from, reach, near)
    class(surface_t), intent(in) :: self
    !> from the point of the surface [m]
    real(dp), intent(in) :: from(3)
    !> [m]
    real(dp), intent(in) :: reach
    !> seen from the point asked about
    type(near_facets_t), intent(inout) :: near

    associate (unused_self => self, unused_from => from, unused_reach => reach, unused_near => near)
    end associate
  end subroutine surface_find_facets

  !> Corners between which a surface that ends lies, but for its radius.
  pure subroutine surface_find_box(self, n, corner)
    class(surface_t), intent(in) :: self
    integer, intent(out) :: n
    !> the first n [m]
    real(dp), intent(out) :: corner(3, 8)
    integer :: k

    n = 4
    corner(:, :) = 0.0_dp
    do k = 0, 3
      corner(:, k + 1) = self%point
      if (k == 1 .or. k == 3) corner(:, k + 1) = corner(:, k + 1) + self%edge(:, 1)
      if (k >= 2) corner(:, k + 1) = corner(:, k + 1) + self%edge(:, 2)
    end do
  end subroutine surface_find_box

  !> Facets that the surface has, 0 of a shape that is not faceted.
  pure integer function surface_n_facets(self) result(n)
    class(surface_t), intent(in) :: self

    associate (unused => self)
    end associate
    n = 0
  end function surface_n_facets

  !> Facets of the file that the surface does not have, since they have no area or, in 2D, no length.
  pure integer function surface_n_left_out(self) result(n)
    class(surface_t), intent(in) :: self

    associate (unused => self)
    end associate
    n = 0
  end function surface_n_left_out

  !> Where the corners of facet `k` are; without effect on a shape that is not faceted.
  pure subroutine surface_get_facet(self, k, corner)
    class(surface_t), intent(in) :: self
    integer, intent(in) :: k
    !> (3, 2 or 3) [m]
    real(dp), intent(inout) :: corner(:, :)

    associate (unused_self => self, unused_k => k, unused => corner)
    end associate
  end subroutine surface_get_facet

  !> The axes of the file of a faceted shape as they lie now, one a column; the global ones for other shapes.
  pure subroutine surface_find_axes(self, axes)
    class(surface_t), intent(in) :: self
    real(dp), intent(out) :: axes(3, 3)
    integer :: d

    associate (unused => self)
    end associate
    axes(:, :) = 0.0_dp
    do d = 1, 3
      axes(d, d) = 1.0_dp
    end do
  end subroutine surface_find_axes

  !> Largest coordinate or length of the surface [m].
  pure real(dp) function surface_far_off(self) result(far_off)
    class(surface_t), intent(in) :: self
    far_off = max(maxval(abs(self%point)), maxval(abs(self%edge)), self%radius)
  end function surface_far_off

  !> A number that tells the contents of the file of a faceted shape from others; 0 without one.
  pure integer(i8) function surface_digest(self) result(digest)
    class(surface_t), intent(in) :: self

    associate (unused => self)
    end associate
    digest = 0
  end function surface_digest

  !> Middle of a surface that ends [m].
  pure subroutine surface_find_middle(self, middle)
    class(surface_t), intent(in) :: self
    real(dp), intent(out) :: middle(3)
    middle(:) = self%point + 0.5_dp*(self%edge(:, 1) + self%edge(:, 2))
  end subroutine surface_find_middle

  !> Half of what a surface that ends takes along axis `d`, in any position that it may turn to [m].
  pure real(dp) function surface_half_width(self, d, turns) result(half)
    class(surface_t), intent(in) :: self
    integer, intent(in) :: d
    logical, intent(in) :: turns

    if (turns) then
      half = self%radius + 0.5_dp*sqrt(sum(self%edge**2))
    else
      half = self%radius + 0.5_dp*sum(abs(self%edge(d, :)))
    end if
  end function surface_half_width

  !> The edge that goes once round a period along axis `d`, so that the surface has no end there: 0 where there is none, or where
  !> the other edge goes along that axis too.
  pure integer function surface_edge_round(self, d, period) result(edge)
    class(surface_t), intent(in) :: self
    integer, intent(in) :: d
    !> [m]
    real(dp), intent(in) :: period
    real(dp) :: round(3)
    integer :: k

    edge = 0
    if (.not. period > 0.0_dp .or. self%radius > 0.0_dp) return
    round(:) = 0.0_dp
    round(d) = period
    do k = 1, 2
      if (maxval(abs(abs(self%edge(:, k)) - round)) <= round_error*period .and. &
        & abs(self%edge(d, 3 - k)) <= round_error*period) edge = k
    end do
  end function surface_edge_round

  !> A corner and the edges from it, those that go round a period three times as long: what is near the middle, and smaller than the
  !> period, is far from their ends.
  pure subroutine surface_stretch(self, period, corner, edge)
    class(surface_t), intent(in) :: self
    !> 0 along axes that are not periodic [m]
    real(dp), intent(in) :: period(3)
    !> from any point [m]
    real(dp), intent(inout) :: corner(3)
    real(dp), intent(out) :: edge(3, 2)
    integer :: d, k

    edge(:, :) = self%edge
    do d = 1, 3
      k = self%edge_round(d, period(d))
      if (k == 0) cycle
      corner(:) = corner - self%edge(:, k)
      edge(:, k) = 3.0_dp*self%edge(:, k)
    end do
  end subroutine surface_stretch

  !> How far some point of the surface has moved at most, without a tilt of `axis` [m]: a rigid motion takes some corner farthest.
  pure real(dp) function surface_way(self, before) result(way)
    class(surface_t), intent(in) :: self, before
    real(dp) :: corner(3)
    integer :: k

    way = 0.0_dp
    do k = 0, 3
      corner(:) = self%point - before%point
      if (k == 1 .or. k == 3) corner(:) = corner + self%edge(:, 1) - before%edge(:, 1)
      if (k >= 2) corner(:) = corner + self%edge(:, 2) - before%edge(:, 2)
      way = max(way, norm2(corner))
    end do
  end function surface_way

  !> Area that a load on the surface works on [m^2, m in 2D]; 0 for a shape without edges, whose load works on an area of the scene.
  pure real(dp) function surface_own_area(self) result(area)
    class(surface_t), intent(in) :: self
    area = norm2(self%edge(:, 1))
  end function surface_own_area

  !> The share of a box that is inside the surface: all of it where the surface does not enclose.
  pure real(dp) function surface_share_inside(self, low, high) result(share)
    class(surface_t), intent(in) :: self
    !> corners (3) [m]
    real(dp), intent(in) :: low(3), high(3)

    share = 1.0_dp
    ! the box and the surface do not matter to one that does not enclose
    associate (unused => low(1) + high(1) + self%radius)
    end associate
  end function surface_share_inside

  !> Make a box along an axis no larger than the surface that encloses it; as it is where the surface does not enclose.
  pure subroutine surface_shut(self, axis, low, high)
    class(surface_t), intent(in) :: self
    integer, intent(in) :: axis
    !> [m]
    real(dp), intent(inout) :: low, high

    associate (unused => self%point(axis) + low + high)
    end associate
  end subroutine surface_shut

  !> Whether it is a wall without a thickness that lies between two points.
  pure logical function surface_parts(self, from, to) result(parts)
    class(surface_t), intent(in) :: self
    !> from the point of the surface (3) [m]
    real(dp), intent(in) :: from(3), to(3)

    parts = .false.
    associate (unused => from(1) + to(1) + self%radius)
    end associate
  end function surface_parts

  !> Where the surface stands along an axis, if it faces along it.
  pure subroutine surface_level(self, axis, level, known)
    class(surface_t), intent(in) :: self
    integer, intent(in) :: axis
    !> [m]
    real(dp), intent(out) :: level
    logical, intent(out) :: known
    real(dp) :: size_of_edges

    size_of_edges = norm2(self%edge)
    level = self%point(axis) + 0.5_dp*sum(self%edge(axis, :))
    known = size_of_edges > 0.0_dp .and. all(abs(self%edge(axis, :)) <= (1.0_dp - facing)*size_of_edges)
  end subroutine surface_level

  !> Height of the lowest point at which a surface that ends carries grains [m], huge where it carries none.
  pure real(dp) function surface_support(self, axis, up) result(support)
    class(surface_t), intent(in) :: self
    !> of the fall
    integer, intent(in) :: axis
    !> 1 or -1: sense of the axis that is up
    real(dp), intent(in) :: up

    support = huge(1.0_dp)
    if (abs(self%axis(axis)) < facing) support = up*self%point(axis) + sum(min(up*self%edge(axis, :), 0.0_dp)) - self%radius
  end function surface_support

  !> A vector of length 1, whatever its length was: squares of very large or small components would be lost.
  pure subroutine set_direction(vector, unit)
    !> not 0
    real(dp), intent(in) :: vector(3)
    real(dp), intent(out) :: unit(3)

    unit(:) = vector/maxval(abs(vector))
    unit(:) = unit/norm2(unit)
  end subroutine set_direction

  !> Whether a vector is not 0.
  pure logical function is_vector(vector)
    real(dp), intent(in) :: vector(:)
    is_vector = any(abs(vector) > 0.0_dp)
  end function is_vector

end module gravier_surface
