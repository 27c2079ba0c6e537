!> Files of mesh walls: triangles of an STL or OBJ file in space, lines of an OBJ file or of a table of points in the plane.
module gravier_mesh_file
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_magnitude, only: is_bounded, bounded_text
  use gravier_text, only: to_text, lower
  use gravier_csv_table, only: csv_table_t
  use gravier_stl_file, only: read_stl
  use gravier_obj_file, only: read_obj, read_obj_lines
  use gravier_ear_clipping, only: clip_ears
  implicit none
  private
  public :: read_mesh

  !> endings of files
  character(len=*), parameter :: stl = ".stl", obj = ".obj", csv = ".csv"

contains

  !> The facets of a file, by the end of its name. In 2D lines become segments, in 3D faces of more than three corners become
  !> triangles. Failures (status_input): no such file, another ending, what the readers of these files refuse, a coordinate that is
  !> too large, in 2D one along the third axis. Not collective.
  subroutine read_mesh(path, dimension, facet, error)
    character(len=*), intent(in) :: path
    !> 2 or 3
    integer, intent(in) :: dimension
    !> (3, dimension, facets) [unit of the file]
    real(dp), allocatable, intent(out) :: facet(:, :, :)
    type(error_t), allocatable, intent(inout) :: error
    real(dp), allocatable :: point(:, :)
    integer, allocatable :: first(:), corner(:)
    character(len=:), allocatable :: ending

    if (allocated(error)) return
    ending = lower(path(max(1, len(path) - 3):))
    if (dimension == 3 .and. ending == stl) then
      call read_stl(path, point, first, corner, error)
    else if (dimension == 3 .and. ending == obj) then
      call read_obj(path, point, first, corner, error)
    else if (dimension == 2 .and. ending == obj) then
      call read_obj_lines(path, point, first, corner, error)
    else if (dimension == 2 .and. ending == csv) then
      call read_points(path, point, first, corner, error)
    else if (dimension == 2) then
      call raise(error, status_input, path//": expected a path that ends with .csv or .obj in 2D")
    else
      call raise(error, status_input, path//": expected a path that ends with .stl or .obj in 3D")
    end if
    if (allocated(error)) return
    call check_points(path, dimension, point, error)
    if (allocated(error)) return
    if (dimension == 2) then
      call cut_lines(point, first, corner, facet)
    else
      call cut_faces(path, point, first, corner, facet, error)
    end if
  end subroutine read_mesh

  !> Refuse coordinates that are too large, and points that are not in the plane of a scene.
  subroutine check_points(path, dimension, point, error)
    character(len=*), intent(in) :: path
    integer, intent(in) :: dimension
    real(dp), intent(in) :: point(:, :)
    type(error_t), allocatable, intent(inout) :: error
    integer :: k

    do k = 1, size(point, 2)
      if (.not. all(is_bounded(point(:, k)))) then
        call raise(error, status_input, path//": point "//to_text(k)//": a coordinate of "//to_text(maxval(abs(point(:, k))))// &
          & " in size: expected "//bounded_text)
      else if (dimension == 2 .and. abs(point(3, k)) > 0.0_dp) then
        call raise(error, status_input, path//": point "//to_text(k)//": z = "//to_text(point(3, k))// &
          & ": expected 0 in 2D")
      end if
      if (allocated(error)) return
    end do
  end subroutine check_points

  !> One line through the points of a table with the columns x and y. A row whose point is that of the first one closes it.
  subroutine read_points(path, point, first, corner, error)
    character(len=*), intent(in) :: path
    real(dp), allocatable, intent(out) :: point(:, :)
    integer, allocatable, intent(out) :: first(:), corner(:)
    type(error_t), allocatable, intent(inout) :: error
    type(csv_table_t) :: table
    real(dp), allocatable :: longer(:, :)
    integer :: n, k, column(3)
    logical :: found

    call table%open(path, error)
    if (allocated(error)) return
    column(1) = table%column("x")
    column(2) = table%column("y")
    ! a table that has it is one of points of a plane where it is 0 everywhere
    column(3) = table%column("z")
    if (any(column(1:2) == 0)) call table%refuse_file("columns x and y were expected", error)
    allocate (point(3, 16), source=0.0_dp)
    n = 0
    do
      call table%next_row(found, error)
      if (allocated(error) .or. .not. found) exit
      if (n == size(point, 2)) then
        allocate (longer(3, 2*n), source=0.0_dp)
        longer(:, 1:n) = point
        call move_alloc(longer, point)
      end if
      n = n + 1
      do k = 1, 3
        if (column(k) > 0) call table%get_real(column(k), point(k, n), error)
      end do
    end do
    call table%close()
    if (n < 2 .and. .not. allocated(error)) call table%refuse_file("two points or more were expected", error)
    if (allocated(error)) return
    allocate (longer(3, n))
    longer(:, :) = point(:, 1:n)
    call move_alloc(longer, point)
    allocate (first(2), corner(n))
    first(1) = 1
    first(2) = n + 1
    do k = 1, n
      corner(k) = k
    end do
  end subroutine read_points

  !> The segments of lines.
  pure subroutine cut_lines(point, first, corner, facet)
    real(dp), intent(in) :: point(:, :)
    integer, intent(in) :: first(:), corner(:)
    real(dp), allocatable, intent(out) :: facet(:, :, :)
    integer :: f, c, n

    allocate (facet(3, 2, size(corner) - (size(first) - 1)))
    n = 0
    do f = 1, size(first) - 1
      do c = first(f), first(f + 1) - 2
        n = n + 1
        facet(:, 1, n) = point(:, corner(c))
        facet(:, 2, n) = point(:, corner(c + 1))
      end do
    end do
  end subroutine cut_lines

  !> The triangles of faces.
  subroutine cut_faces(path, point, first, corner, facet, error)
    character(len=*), intent(in) :: path
    real(dp), intent(in) :: point(:, :)
    integer, intent(in) :: first(:), corner(:)
    real(dp), allocatable, intent(out) :: facet(:, :, :)
    type(error_t), allocatable, intent(inout) :: error
    real(dp), allocatable :: face(:, :)
    integer, allocatable :: triangle(:, :)
    integer :: f, c, k, n
    logical :: is_simple

    allocate (facet(3, 3, size(corner) - 2*(size(first) - 1)))
    n = 0
    do f = 1, size(first) - 1
      allocate (face(3, first(f + 1) - first(f)))
      do c = 1, size(face, 2)
        face(:, c) = point(:, corner(first(f) + c - 1))
      end do
      call clip_ears(face, triangle, is_simple)
      if (.not. is_simple) then
        call raise(error, status_input, path//": face "//to_text(f)//": a polygon that crosses itself: expected one that does not")
        return
      end if
      do k = 1, size(triangle, 2)
        n = n + 1
        do c = 1, 3
          facet(:, c, n) = face(:, triangle(c, k))
        end do
      end do
      deallocate (face)
    end do
  end subroutine cut_faces

end module gravier_mesh_file
