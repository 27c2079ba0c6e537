!> Surfaces of facets, which may be open, not convex and in several parts: each facet bounds grains on both of its sides.
module gravier_mesh
  use gravier_kinds, only: dp, i8
  use gravier_random_hash, only: hash_words
  use gravier_declared_keys, only: declared_key_t
  use gravier_rotation, only: cross
  use gravier_facet, only: near_facets_t, find_foot, longest_side
  use gravier_facet_tree, only: facet_tree_t, box_distance
  use gravier_surface, only: surface_t, surface_features_t, point_key, facing
  implicit none
  private
  public :: mesh_t, mesh_data_t

  !> Parts of the largest side of the box of a mesh: height of a facet at and below which it has no area to speak of, and rounding
  !> of files of single precision, which does not tell points apart.
  real(dp), parameter :: flattest = 1.0e-8_dp, single_rounding = 2.0e-7_dp

  !> The facets of a mesh in the axes of its file, from the origin of that. They never change, and all copies of a boundary share
  !> them.
  type :: mesh_data_t
    !> (3, dimension, facets) [m]
    real(dp), allocatable :: corner(:, :, :)
    !> box of all facets [m]
    real(dp), private :: low(3) = 0.0_dp, high(3) = 0.0_dp
    !> facets of the file that were left out, since they have no area (in 2D, no length)
    integer, private :: without_area = 0
    type(facet_tree_t), private :: tree
  contains
    procedure :: diagonal => mesh_data_diagonal
  end type mesh_data_t

  !> `edge` holds the first two axes of the file, unit vectors that turn with the boundary.
  type, extends(surface_t) :: mesh_t
    !> what a length of the file is multiplied by [m]
    real(dp), private :: scale = 1.0_dp
    !> associated once the file was read
    type(mesh_data_t), pointer :: data => null()
  contains
    procedure, nopass :: features => mesh_features
    procedure, nopass :: keys => mesh_keys
    procedure :: set => mesh_set
    procedure :: take_facets => mesh_take_facets
    procedure :: locate => mesh_locate
    procedure :: find_facets => mesh_find_facets
    procedure :: parts => mesh_parts
    procedure :: find_box => mesh_find_box
    procedure :: find_middle => mesh_find_middle
    procedure :: half_width => mesh_half_width
    procedure :: way => mesh_way
    procedure :: own_area => mesh_own_area
    procedure :: level => mesh_level
    procedure :: support => mesh_support
    procedure :: n_facets => mesh_n_facets
    procedure :: n_left_out => mesh_n_left_out
    procedure :: get_facet => mesh_get_facet
    procedure :: far_off => mesh_far_off
    procedure :: digest => mesh_digest
    procedure :: find_axes => mesh_find_axes
  end type mesh_t

contains

  pure function mesh_features() result(features)
    type(surface_features_t) :: features
    features = surface_features_t("mesh", faceted=.true.)
  end function mesh_features

  pure subroutine mesh_keys(keys)
    type(declared_key_t), allocatable, intent(out) :: keys(:)

    allocate (keys(2))
    keys(1) = point_key
    keys(2) = declared_key_t("scale", "1", "> 0", "m", "length of the unit of the file of a mesh")
  end subroutine mesh_keys

  pure subroutine mesh_set(self, values, wrong, expected)
    class(mesh_t), intent(inout) :: self
    real(dp), intent(in), contiguous :: values(:, :)
    character(len=:), allocatable, intent(out) :: wrong, expected

    wrong = ""
    expected = ""
    self%point(:) = values(:, 1)
    self%scale = values(1, 2)
    self%edge(:, :) = 0.0_dp
    self%edge(1, 1) = 1.0_dp
    self%edge(2, 2) = 1.0_dp
    if (.not. self%scale > 0.0_dp) wrong = "scale"
  end subroutine mesh_set

  !> Take the facets of a file, in its unit, but for those without area. The data stay until the program ends.
  subroutine mesh_take_facets(self, corner)
    class(mesh_t), intent(inout) :: self
    !> (3, 2 or 3, facets)
    real(dp), intent(in), contiguous :: corner(:, :, :)
    real(dp) :: extent
    integer :: k, n

    allocate (self%data)
    associate (data => self%data)
      extent = 0.0_dp
      do k = 1, 3
        extent = max(extent, maxval(corner(k, :, :)) - minval(corner(k, :, :)))
      end do
      n = 0
      do k = 1, size(corner, 3)
        if (height_of(corner(:, :, k)) > flattest*extent) n = n + 1
      end do
      allocate (data%corner(3, size(corner, 2), n))
      data%without_area = size(corner, 3) - n
      n = 0
      do k = 1, size(corner, 3)
        if (.not. height_of(corner(:, :, k)) > flattest*extent) cycle
        n = n + 1
        data%corner(:, :, n) = self%scale*corner(:, :, k)
      end do
      if (n == 0) return
      do k = 1, 3
        data%low(k) = minval(data%corner(k, :, :))
        data%high(k) = maxval(data%corner(k, :, :))
      end do
      call data%tree%build(data%corner)
    end associate
  end subroutine mesh_take_facets

  !> Length of the diagonal of the box [m].
  pure real(dp) function mesh_data_diagonal(self) result(diagonal)
    class(mesh_data_t), intent(in) :: self
    diagonal = sqrt(sum((self%high - self%low)**2))
  end function mesh_data_diagonal

  !> Height of a triangle over its longest side, length of a segment.
  pure real(dp) function height_of(corner) result(height)
    real(dp), intent(in), contiguous :: corner(:, :)
    real(dp) :: ab(3), ac(3), normal(3)

    height = longest_side(corner)
    if (size(corner, 2) == 2 .or. .not. height > 0.0_dp) return
    ab(:) = (corner(:, 2) - corner(:, 1))/height
    ac(:) = (corner(:, 3) - corner(:, 1))/height
    normal(:) = cross(ab, ac)
    height = norm2(normal)*height
  end function height_of

  !> The axes of the file as they lie now, one a column; they are at right angles whatever roundings turns have added up.
  pure subroutine mesh_find_axes(self, axes)
    class(mesh_t), intent(in) :: self
    real(dp), intent(out) :: axes(3, 3)

    axes(:, 1) = self%edge(:, 1)/norm2(self%edge(:, 1))
    axes(:, 2) = self%edge(:, 2) - dot_product(self%edge(:, 2), axes(:, 1))*axes(:, 1)
    axes(:, 2) = axes(:, 2)/norm2(axes(:, 2))
    axes(:, 3) = cross(axes(:, 1), axes(:, 2))
  end subroutine mesh_find_axes

  !> A way in the axes of the file.
  pure subroutine turn_back(axes, way, turned)
    real(dp), intent(in) :: axes(3, 3), way(3)
    real(dp), intent(out) :: turned(3)
    integer :: d

    do d = 1, 3
      turned(d) = axes(1, d)*way(1) + axes(2, d)*way(2) + axes(3, d)*way(3)
    end do
  end subroutine turn_back

  !> A way of the axes of the file in global axes.
  pure subroutine turn(axes, way, turned)
    real(dp), intent(in) :: axes(3, 3), way(3)
    real(dp), intent(out) :: turned(3)
    integer :: d

    do d = 1, 3
      turned(d) = axes(d, 1)*way(1) + axes(d, 2)*way(2) + axes(d, 3)*way(3)
    end do
  end subroutine turn

  !> Add the facets that are within `reach` of a point.
  pure subroutine mesh_find_facets(self, from, reach, near)
    class(mesh_t), intent(in) :: self
    !> from the point of the surface [m]
    real(dp), intent(in) :: from(3)
    real(dp), intent(in) :: reach
    type(near_facets_t), intent(inout) :: near
    integer, allocatable :: number(:)
    real(dp) :: axes(3, 3), place(3), way(3), corner(3, size(self%data%corner, 2)), foot(3)
    integer :: n, k, c, where_foot_is

    associate (data => self%data)
      near%tolerance = single_rounding*maxval(data%high - data%low)
      call self%find_axes(axes)
      call turn_back(axes, from, place)
      if (box_distance(data%low, data%high, place) > reach) return
      call data%tree%find(place, reach, n, number)
      do k = 1, n
        do c = 1, size(corner, 2)
          way(:) = data%corner(:, c, number(k)) - place
          call turn(axes, way, corner(:, c))
        end do
        call find_foot(corner, foot, where_foot_is)
        if (norm2(foot) <= reach) call near%add(number(k), corner)
      end do
    end associate
  end subroutine mesh_find_facets

  !> The nearest point, sought within twice as far as before until there is one.
  pure subroutine mesh_locate(self, from, distance, normal)
    class(mesh_t), intent(in) :: self
    real(dp), intent(in) :: from(3)
    real(dp), intent(out) :: distance, normal(3)
    type(near_facets_t) :: near
    real(dp) :: axes(3, 3), place(3), foot(3), size_of_box, reach
    integer :: k, where_foot_is

    call self%find_axes(axes)
    size_of_box = self%data%diagonal()
    call turn_back(axes, from, place)
    reach = box_distance(self%data%low, self%data%high, place) + 1.0e-3_dp*size_of_box
    do while (near%n == 0)
      call self%find_facets(from, reach, near)
      reach = 2.0_dp*reach
    end do
    distance = huge(1.0_dp)
    normal(:) = 0.0_dp
    do k = 1, near%n
      call find_foot(near%corner(:, :, k), foot, where_foot_is)
      if (.not. norm2(foot) < distance) cycle
      distance = norm2(foot)
      normal(:) = -foot
    end do
    if (distance > 0.0_dp) normal(:) = normal/distance
  end subroutine mesh_locate

  !> Whether a facet lies between two points.
  pure logical function mesh_parts(self, from, to) result(parts)
    class(mesh_t), intent(in) :: self
    !> from the point of the surface (3) [m]
    real(dp), intent(in) :: from(3), to(3)
    real(dp) :: axes(3, 3), place(3), other(3)

    call self%find_axes(axes)
    call turn_back(axes, from, place)
    call turn_back(axes, to, other)
    parts = self%data%tree%parts(self%data%corner, place, other)
  end function mesh_parts

  !> Corners of the box of the facets, which turns with them.
  pure subroutine mesh_find_box(self, n, corner)
    class(mesh_t), intent(in) :: self
    integer, intent(out) :: n
    real(dp), intent(out) :: corner(3, 8)
    real(dp) :: axes(3, 3), place(3)
    integer :: k, d

    call self%find_axes(axes)
    n = 8
    do k = 1, n
      do d = 1, 3
        place(d) = merge(self%data%high(d), self%data%low(d), btest(k - 1, d - 1))
      end do
      call turn(axes, place, corner(:, k))
      corner(:, k) = self%point + corner(:, k)
    end do
  end subroutine mesh_find_box

  pure subroutine mesh_find_middle(self, middle)
    class(mesh_t), intent(in) :: self
    real(dp), intent(out) :: middle(3)
    real(dp) :: axes(3, 3), place(3)

    call self%find_axes(axes)
    place(:) = 0.5_dp*(self%data%low + self%data%high)
    call turn(axes, place, middle)
    middle(:) = self%point + middle
  end subroutine mesh_find_middle

  pure real(dp) function mesh_half_width(self, d, turns) result(half)
    class(mesh_t), intent(in) :: self
    integer, intent(in) :: d
    logical, intent(in) :: turns
    real(dp) :: corner(3, 8)
    integer :: n

    if (turns) then
      half = 0.5_dp*self%data%diagonal()
    else
      call self%find_box(n, corner)
      half = 0.5_dp*(maxval(corner(d, :)) - minval(corner(d, :)))
    end if
  end function mesh_half_width

  pure real(dp) function mesh_way(self, before) result(way)
    class(mesh_t), intent(in) :: self
    class(surface_t), intent(in) :: before
    real(dp) :: corner(3, 8), corner_before(3, 8)
    integer :: n, k

    call self%find_box(n, corner)
    call before%find_box(n, corner_before)
    way = 0.0_dp
    do k = 1, n
      way = max(way, norm2(corner(:, k) - corner_before(:, k)))
    end do
  end function mesh_way

  !> A mesh has no side that loads work on: these work on an area of the scene.
  pure real(dp) function mesh_own_area(self) result(area)
    class(mesh_t), intent(in) :: self

    associate (unused => self)
    end associate
    area = 0.0_dp
  end function mesh_own_area

  pure subroutine mesh_level(self, axis, level, known)
    class(mesh_t), intent(in) :: self
    integer, intent(in) :: axis
    real(dp), intent(out) :: level
    logical, intent(out) :: known
    real(dp) :: middle(3)

    call self%find_middle(middle)
    level = middle(axis)
    known = 2.0_dp*self%half_width(axis, .false.) <= (1.0_dp - facing)*self%data%diagonal()
  end subroutine mesh_level

  pure real(dp) function mesh_support(self, axis, up) result(support)
    class(mesh_t), intent(in) :: self
    integer, intent(in) :: axis
    real(dp), intent(in) :: up
    real(dp) :: corner(3, 8)
    integer :: n

    call self%find_box(n, corner)
    support = minval(up*corner(axis, :))
  end function mesh_support

  pure integer function mesh_n_facets(self) result(n)
    class(mesh_t), intent(in) :: self
    n = size(self%data%corner, 3)
  end function mesh_n_facets

  pure integer function mesh_n_left_out(self) result(n)
    class(mesh_t), intent(in) :: self
    n = self%data%without_area
  end function mesh_n_left_out

  pure subroutine mesh_get_facet(self, k, corner)
    class(mesh_t), intent(in) :: self
    integer, intent(in) :: k
    real(dp), intent(inout) :: corner(:, :)
    real(dp) :: axes(3, 3), place(3)
    integer :: c

    call self%find_axes(axes)
    do c = 1, size(corner, 2)
      call turn(axes, self%data%corner(:, c, k), place)
      corner(:, c) = self%point + place
    end do
  end subroutine mesh_get_facet

  pure real(dp) function mesh_far_off(self) result(far_off)
    class(mesh_t), intent(in) :: self
    real(dp) :: corner(3, 8)
    integer :: n

    call self%find_box(n, corner)
    far_off = max(maxval(abs(corner)), maxval(abs(self%point)))
  end function mesh_far_off

  !> A number that tells this mesh from others.
  pure integer(i8) function mesh_digest(self) result(digest)
    class(mesh_t), intent(in) :: self
    integer(i8), allocatable :: word(:)
    integer :: k, c, d, n

    associate (corner => self%data%corner)
      allocate (word(size(corner)))
      n = 0
      do k = 1, size(corner, 3)
        do c = 1, size(corner, 2)
          do d = 1, 3
            n = n + 1
            word(n) = transfer(corner(d, c, k), 0_i8)
          end do
        end do
      end do
    end associate
    digest = hash_words(word)
  end function mesh_digest

end module gravier_mesh
