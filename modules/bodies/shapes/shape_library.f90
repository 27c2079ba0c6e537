!> The shapes that bodies of a scene have, each known once and shared by all bodies that have it, at any size.
module gravier_shape_library
  use gravier_kinds, only: dp
  use gravier_motion, only: grain_inertia
  use gravier_convex_piece, only: convex_piece_t
  use gravier_piece_width, only: half_width_of
  implicit none
  private
  public :: body_shape_t, shape_library_t, point_counts_t, boundary_number, face_points, most_of_face

  !> stands for a boundary in the place of the number of a shape
  integer, parameter :: boundary_number = -1
  !> points in which two pieces touch at most, by the vertices of the one that has fewer: a vertex, an edge or a face in the plane,
  !> and a face in space, which has more if it has more corners
  integer, parameter :: of_vertex = 1, of_edge = 2, of_face = 8, most_of_face = 64
  !> pairs of pieces that two bodies touch with at most, besides as many as both have pieces
  integer, parameter :: more_pairs = 4

  !> A rigid body of radius 1: the ball of that radius about the centre of mass holds all of it. Its axes are the principal ones.
  type :: body_shape_t
    character(len=:), allocatable :: name
    !> one piece, or the pieces of a cluster
    type(convex_piece_t), allocatable :: piece(:)
    !> volume (area in 2D)
    real(dp) :: volume = 0.0_dp
    !> half of the least width of its thinnest piece; found when a library takes the shape
    real(dp) :: half_thickness = 1.0_dp
    !> principal moments of inertia of a body of mass 1, in 2D the first alone
    real(dp) :: inertia(3) = 0.0_dp
    !> radius of that ball in the length unit of the file that the shape comes from
    real(dp) :: size = 1.0_dp
    !> in 3D, the unit quaternion that turns these axes to where they lie in those of the file; its real part comes first
    real(dp) :: turn(4) = [1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp]
  contains
    procedure :: least_rounding => body_shape_least_rounding
  end type body_shape_t

  !> In how many points bodies may touch.
  type :: point_counts_t
    !> number of pieces of a shape, and of points of one of them (0 to number of shapes)
    integer, allocatable :: pieces(:), points(:)
  contains
    procedure :: between => point_counts_between
  end type point_counts_t

  !> Shapes by number, from 1; the number 0 stands for disks and spheres.
  type :: shape_library_t
    integer :: n = 0
    !> room for more than n
    type(body_shape_t), allocatable :: shape(:)
    type(point_counts_t) :: counts
    !> whether flat sides end where round corners begin
    logical :: are_round = .false.
  contains
    procedure :: add => shape_library_add
    procedure :: find => shape_library_find
    procedure :: n_pieces => shape_library_n_pieces
    procedure :: volume_of => shape_library_volume_of
    procedure :: half_thickness_of => shape_library_half_thickness_of
    procedure :: inertia => shape_library_inertia
    procedure :: keep_round => shape_library_keep_round
  end type shape_library_t

contains

  !> Pieces of the shape of a number; a disk or a sphere is one.
  pure integer function shape_library_n_pieces(self, number) result(n_pieces)
    class(shape_library_t), intent(in) :: self
    integer, intent(in) :: number

    n_pieces = 1
    if (number > 0) n_pieces = size(self%shape(number)%piece)
  end function shape_library_n_pieces

  !> Volume, area in 2D, of a body of radius 1 of the shape of a number above 0.
  pure real(dp) function shape_library_volume_of(self, number) result(volume)
    class(shape_library_t), intent(in) :: self
    integer, intent(in) :: number
    volume = self%shape(number)%volume
  end function shape_library_volume_of

  !> Half of the thickness of a body of radius 1 of the shape of a number where it is thinnest; 1 of disks and spheres.
  pure real(dp) function shape_library_half_thickness_of(self, number) result(half)
    class(shape_library_t), intent(in) :: self
    integer, intent(in) :: number

    half = 1.0_dp
    if (number > 0) half = self%shape(number)%half_thickness
  end function shape_library_half_thickness_of

  !> The least rounding of its pieces with edges or corners; huge without any [radii].
  pure real(dp) function body_shape_least_rounding(self) result(least)
    class(body_shape_t), intent(in) :: self
    integer :: p

    least = huge(1.0_dp)
    do p = 1, size(self%piece)
      if (size(self%piece(p)%vertex, 2) > 1) least = min(least, self%piece(p)%rounding)
    end do
  end function body_shape_least_rounding

  !> Let flat sides end where their round corners begin, whatever they lie on. Springs of contacts need it: a point of contact that
  !> goes from a round corner out to a sharp one as a side turns changes the gap though no body moves there, and gives energy or
  !> takes it.
  pure subroutine shape_library_keep_round(self)
    class(shape_library_t), intent(inout) :: self
    integer :: k, p

    self%are_round = .true.
    do k = 1, self%n
      do p = 1, size(self%shape(k)%piece)
        self%shape(k)%piece(p)%reaches_out = .false.
      end do
    end do
  end subroutine shape_library_keep_round

  !> Largest principal moment of inertia of a body [kg m^2].
  pure real(dp) function shape_library_inertia(self, number, dimension, radius, mass) result(inertia)
    class(shape_library_t), intent(in) :: self
    !> of its shape, 0 of a disk or a sphere; of space
    integer, intent(in) :: number, dimension
    !> [m], [kg]
    real(dp), intent(in) :: radius, mass

    if (number > 0) then
      inertia = mass*radius**2*maxval(self%shape(number)%inertia)
    else
      inertia = grain_inertia(dimension, radius, mass)
    end if
  end function shape_library_inertia

  !> Add a shape to a library; its number is the next one.
  subroutine shape_library_add(self, shape)
    class(shape_library_t), intent(inout) :: self
    type(body_shape_t), intent(in) :: shape
    type(body_shape_t), allocatable :: longer(:)
    integer :: k

    if (.not. allocated(self%shape)) then
      allocate (self%shape(4))
      self%counts%pieces = [1]
      self%counts%points = [of_vertex]
    end if
    if (self%n == size(self%shape)) then
      allocate (longer(2*self%n))
      longer(1:self%n) = self%shape
      call move_alloc(longer, self%shape)
    end if
    self%n = self%n + 1
    self%shape(self%n) = shape
    do k = 1, size(shape%piece)
      associate (least => self%shape(self%n)%half_thickness)
        least = min(least, half_width_of(shape%piece(k)))
      end associate
    end do
    call lengthen(self%counts%pieces, size(shape%piece))
    call lengthen(self%counts%points, of_vertex)
    do k = 1, size(shape%piece)
      associate (most => self%counts%points(self%n + 1), vertex => shape%piece(k)%vertex)
        if (size(vertex, 2) > 1) most = max(most, of_edge)
        if (size(vertex, 2) > 2 .and. size(vertex, 1) == 3) most = max(most, face_points(shape%piece(k)))
      end associate
    end do
  end subroutine shape_library_add

  subroutine lengthen(list, last)
    integer, allocatable, intent(inout) :: list(:)
    integer, intent(in) :: last
    integer, allocatable :: longer(:)

    allocate (longer(size(list) + 1))
    longer(1:size(list)) = list
    longer(size(longer)) = last
    call move_alloc(longer, list)
  end subroutine lengthen

  !> The number of the shape of a name, 0 where there is none.
  pure integer function shape_library_find(self, name) result(number)
    class(shape_library_t), intent(in) :: self
    character(len=*), intent(in) :: name

    do number = 1, self%n
      if (self%shape(number)%name == name) return
    end do
    number = 0
  end function shape_library_find

  !> The points in which a piece in space may touch with its faces. Two faces that lie on each other touch at the corners of their
  !> common part: a face within a larger one at all of its own, if it has no more than most_of_face.
  pure integer function face_points(piece)
    type(convex_piece_t), intent(in) :: piece

    face_points = min(most_of_face, max(of_face, piece%largest_face))
  end function face_points

  !> The points in which bodies of two shapes may touch: a pair keeps as many impulses.
  pure integer function point_counts_between(self, a, b) result(points)
    class(point_counts_t), intent(in) :: self
    !> numbers of the shapes, 0 for disks and spheres; b may be boundary_number
    integer, intent(in) :: a, b
    integer :: pieces_b

    points = self%points(a + 1)
    pieces_b = 1
    if (b /= boundary_number) then
      associate (other => self%points(b + 1))
        points = merge(max(points, other), min(points, other), min(points, other) >= of_face)
      end associate
      pieces_b = self%pieces(b + 1)
    end if
    points = points*min(self%pieces(a + 1)*pieces_b, self%pieces(a + 1) + pieces_b + more_pairs)
  end function point_counts_between

end module gravier_shape_library
