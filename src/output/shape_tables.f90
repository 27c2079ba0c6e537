!> The shapes of the bodies as tables for results.h5, where they stand once: shapes, their pieces, the vertices of these and, in
!> space, their faces. Lengths are those of a body of radius 1, in its principal axes from its centre of mass.
module gravier_shape_tables
  use gravier_kinds, only: dp, i8
  use gravier_shape_library, only: shape_library_t, body_shape_t
  use gravier_field_list, only: field_list_t
  implicit none
  private
  public :: describe_shapes

contains

  !> Tables of a library: `shapes`, `pieces`, `vertices` and, in 3D, `faces` and `face_vertices`. Rows are numbered from 1, and name
  !> the shapes, pieces, faces and vertices that they belong to by these numbers.
  subroutine describe_shapes(library, nd, table)
    type(shape_library_t), intent(in) :: library
    integer, intent(in) :: nd
    type(field_list_t), allocatable, intent(out) :: table(:)

    allocate (table(merge(3, 5, nd == 2)))
    call fill_tables(library%shape(1:library%n), nd, table)
  end subroutine describe_shapes

  subroutine fill_tables(library, nd, table)
    type(body_shape_t), intent(in) :: library(:)
    integer, intent(in) :: nd
    type(field_list_t), intent(inout) :: table(:)
    integer :: n_pieces, n_vertices, n_faces, n_corners, k, p

    n_pieces = 0
    n_vertices = 0
    n_faces = 0
    n_corners = 0
    do k = 1, size(library)
      n_pieces = n_pieces + size(library(k)%piece)
      do p = 1, size(library(k)%piece)
        associate (piece => library(k)%piece(p))
          n_vertices = n_vertices + size(piece%vertex, 2)
          if (nd == 2) cycle
          n_faces = n_faces + size(piece%face_first) - 1
          n_corners = n_corners + size(piece%face_vertex)
        end associate
      end do
    end do
    call begin(table(1), "shapes", size(library))
    call begin(table(2), "pieces", n_pieces)
    call begin(table(3), "vertices", n_vertices)
    call add_shapes(library, nd, table(1))
    call add_pieces(library, table(2))
    call add_vertices(library, nd, table(3))
    if (nd == 2) return
    call begin(table(4), "faces", n_faces)
    call begin(table(5), "face_vertices", n_corners)
    call add_faces(library, table(4), table(5))
  end subroutine fill_tables

  subroutine begin(table, name, n)
    type(field_list_t), intent(inout) :: table
    character(len=*), intent(in) :: name
    integer, intent(in) :: n
    integer :: k

    call table%init(name, "number", n)
    table%everywhere = .true.
    do k = 1, n
      table%key(1, k) = k
    end do
  end subroutine begin

  subroutine add_shapes(library, nd, table)
    type(body_shape_t), intent(in) :: library(:)
    integer, intent(in) :: nd
    type(field_list_t), intent(inout) :: table
    character(len=64) :: name(size(library))
    real(dp), allocatable :: extent(:, :), volume(:, :), inertia(:, :), turn(:, :)
    integer :: k

    allocate (extent(1, size(library)), volume(1, size(library)), inertia(merge(1, 3, nd == 2), size(library)))
    allocate (turn(4, size(library)))
    do k = 1, size(library)
      associate (shape => library(k))
        name(k) = shape%name
        extent(1, k) = shape%size
        volume(1, k) = shape%volume
        inertia(:, k) = shape%inertia(1:size(inertia, 1))
        turn(:, k) = shape%turn
      end associate
    end do
    call table%add_texts("name", name)
    call table%add_reals("size", "m", extent, .true.)
    call table%add_reals("volume", "", volume, .true.)
    call table%add_reals("inertia", "", inertia)
    if (nd == 3) call table%add_reals("turn", "", turn)
  end subroutine add_shapes

  subroutine add_pieces(library, table)
    type(body_shape_t), intent(in) :: library(:)
    type(field_list_t), intent(inout) :: table
    integer(i8), allocatable :: shape(:, :)
    real(dp), allocatable :: rounding(:, :)
    integer :: k, p, n

    allocate (shape(1, table%n_items()), rounding(1, table%n_items()))
    n = 0
    do k = 1, size(library)
      do p = 1, size(library(k)%piece)
        n = n + 1
        shape(1, n) = k
        rounding(1, n) = library(k)%piece(p)%rounding
      end do
    end do
    call table%add_whole("shape", "", shape, .true.)
    call table%add_reals("rounding", "", rounding, .true.)
  end subroutine add_pieces

  subroutine add_vertices(library, nd, table)
    type(body_shape_t), intent(in) :: library(:)
    integer, intent(in) :: nd
    type(field_list_t), intent(inout) :: table
    integer(i8), allocatable :: piece(:, :)
    real(dp), allocatable :: vertex(:, :), corner(:, :)
    integer :: k, p, v, n, n_pieces

    allocate (piece(1, table%n_items()), vertex(nd, table%n_items()), corner(nd, table%n_items()))
    n = 0
    n_pieces = 0
    do k = 1, size(library)
      do p = 1, size(library(k)%piece)
        n_pieces = n_pieces + 1
        do v = 1, size(library(k)%piece(p)%vertex, 2)
          n = n + 1
          piece(1, n) = n_pieces
          vertex(:, n) = library(k)%piece(p)%vertex(:, v)
          corner(:, n) = library(k)%piece(p)%corner(:, v)
        end do
      end do
    end do
    call table%add_whole("piece", "", piece, .true.)
    call table%add_reals("vertex", "", vertex)
    call table%add_reals("corner", "", corner)
  end subroutine add_vertices

  subroutine add_faces(library, faces, corners)
    type(body_shape_t), intent(in) :: library(:)
    type(field_list_t), intent(inout) :: faces, corners
    integer(i8), allocatable :: piece_of(:, :), face_of(:, :), vertex_of(:, :)
    real(dp), allocatable :: normal(:, :)
    integer :: k, p, f, c, n_pieces, n_faces, n_corners, n_vertices

    allocate (piece_of(1, faces%n_items()), normal(3, faces%n_items()))
    allocate (face_of(1, corners%n_items()), vertex_of(1, corners%n_items()))
    n_pieces = 0
    n_vertices = 0
    n_faces = 0
    n_corners = 0
    do k = 1, size(library)
      do p = 1, size(library(k)%piece)
        n_pieces = n_pieces + 1
        associate (piece => library(k)%piece(p))
          do f = 1, size(piece%face_first) - 1
            n_faces = n_faces + 1
            piece_of(1, n_faces) = n_pieces
            normal(:, n_faces) = piece%face_normal(:, f)
            do c = piece%face_first(f), piece%face_first(f + 1) - 1
              n_corners = n_corners + 1
              face_of(1, n_corners) = n_faces
              vertex_of(1, n_corners) = n_vertices + piece%face_vertex(c)
            end do
          end do
          n_vertices = n_vertices + size(piece%vertex, 2)
        end associate
      end do
    end do
    call faces%add_whole("piece", "", piece_of, .true.)
    call faces%add_reals("normal", "", normal)
    call corners%add_whole("face", "", face_of, .true.)
    call corners%add_whole("vertex", "", vertex_of, .true.)
  end subroutine add_faces

end module gravier_shape_tables
