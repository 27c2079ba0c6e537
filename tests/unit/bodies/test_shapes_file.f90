!> Libraries of shapes from text: what a good file says, and every file that is refused, in one line that names file and line.
program test_shapes_file
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, status_input
  use gravier_sharp_polyhedron, only: sharp_polyhedron_t
  use gravier_shape_library, only: body_shape_t, shape_library_t
  use gravier_simple_shapes, only: make_polyhedron_of_faces
  use gravier_shape_names, only: find_shape, shape_names, library_digest
  use gravier_shapes_file, only: parse_shapes
  use gravier_text, only: to_text
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  character(len=*), parameter :: lf = new_line("a"), tab = achar(9), path = "a.shapes"
  real(dp), parameter :: pi = acos(-1.0_dp)
  !> of a few operations
  real(dp), parameter :: rounding_error = 1.0e-14_dp

  call MPI_Init()
  call test_planar()
  call test_layout_of_text()
  call test_usual_rounding()
  call test_digest()
  call test_statements_refused()
  call test_names_refused()
  call test_planar_refused()
  call test_space()
  call test_principal_axes()
  call test_space_refused()
  call test_regular_polygons()
  call test_platonic_solids()
  call test_random_hulls()
  call test_words_refused()
  call test_surface_files()
  call test_surface_files_refused()
  call test_no_faces()
  call finish_checks()
  call MPI_Finalize()

contains

  !> A rectangle, a cluster of two squares, a disk and a capsule: sizes, areas and moments that are known.
  subroutine test_planar()
    type(shape_library_t) :: library
    type(error_t), allocatable :: error

    call parse_shapes(path, "# four shapes"//lf//"shape brick"//lf//"rounding 0.01"//lf//"polygon 0 0 4 0 4 2 0 2"//lf// &
      & "shape two"//lf//"polygon 0 0 1 0 1 1 0 1"//lf//"polygon 1 0 2 0 2 1 1 1"//lf//"shape coin"//lf//"disk 5 5 0.5"//lf// &
      & "shape pill"//lf//"capsule -1 0 1 0 0.5"//lf, 2, library, error)
    call check(.not. allocated(error), "a good file")
    if (allocated(error)) return
    call check_equal(library%n, 4, "number of shapes")
    call check_equal(shape_names(library, " "), "brick two coin pill", "names")
    call check_equal(find_shape(library, "coin"), 3, "a shape by its name")
    call check_equal(find_shape(library, "coi"), 0, "no shape of that name")
    associate (brick => library%shape(1), two => library%shape(2), coin => library%shape(3), pill => library%shape(4))
      call check_close(brick%size, sqrt(5.0_dp), rounding_error, "size of a rectangle")
      call check_close(brick%volume*brick%size**2, 8.0_dp, 10*rounding_error, "area of a rectangle")
      call check_close(brick%inertia(1)*brick%size**2, (4.0_dp**2 + 2.0_dp**2)/12, 10*rounding_error, "inertia of a rectangle")
      call check_close(brick%piece(1)%rounding*brick%size, 0.01_dp, rounding_error, "a rounding that is said")
      call check_equal(size(two%piece), 2, "pieces of a cluster")
      call check_close(two%volume*two%size**2, 2.0_dp, 10*rounding_error, "area of a cluster")
      call check_close(two%inertia(1)*two%size**2, (2.0_dp**2 + 1.0_dp)/12, 10*rounding_error, "inertia of a cluster")
      call check_close(coin%size, 0.5_dp, rounding_error, "size of a disk")
      call check_close(coin%volume, pi, 10*rounding_error, "area of a disk of radius 1")
      call check_close(pill%size, 1.5_dp, rounding_error, "size of a capsule")
      call check_close(pill%volume*pill%size**2, 2.0_dp + 0.25_dp*pi, 10*rounding_error, "area of a capsule")
    end associate
  end subroutine test_planar

  !> Numbers over several lines, tabs, ends of lines with CR, comments behind statements, no end of the last line.
  subroutine test_layout_of_text()
    type(shape_library_t) :: plain, other
    type(error_t), allocatable :: error

    call parse_shapes(path, "shape a"//lf//"polygon 0 0 1 0 0 1"//lf, 2, plain, error)
    call parse_shapes(path, char(239)//char(187)//char(191)//" shape"//tab//"a  # a triangle"//achar(13)//lf//lf//"polygon"//lf// &
      & "0 0 # first"//lf//"  "//tab//"1 0"//achar(13)//lf//"# none"//lf//"0.0 1e0", 2, other, error)
    call check(.not. allocated(error), "a strange but good file")
    if (allocated(error)) return
    call check(library_digest(plain) == library_digest(other), "the same library in another layout")
  end subroutine test_layout_of_text

  !> Without a word about it the rounding is 1e-3 of the size, wherever the shape lies in its file.
  subroutine test_usual_rounding()
    type(shape_library_t) :: library
    type(error_t), allocatable :: error

    call parse_shapes(path, "shape a"//lf//"polygon 0 0 4 0 4 2 0 2"//lf//"shape b"//lf// &
      & "polygon 1000 1000 1004 1000 1004 1002 1000 1002"//lf//"capsule 1000 1001 1004 1001 0.5", 2, library, error)
    call check(.not. allocated(error), "no rounding said")
    if (allocated(error)) return
    call check_close(library%shape(1)%piece(1)%rounding, 1.0e-3_dp, rounding_error, "the usual rounding")
    call check_close(library%shape(2)%piece(1)%rounding, 1.0e-3_dp, rounding_error, "of the polygon of a cluster")
    call check_close(library%shape(2)%piece(2)%rounding*library%shape(2)%size, 0.5_dp, rounding_error, "radius of a capsule")
  end subroutine test_usual_rounding

  !> Libraries that differ in a name, a number or an order have other digests.
  subroutine test_digest()
    character(len=*), parameter :: corners = "polygon 0 0 1 0 0 1"//lf
    character(len=*), parameter :: text(6) = [character(len=80) :: "shape a"//lf//corners, "shape b"//lf//corners, &
      & "shape a"//lf//"polygon 0 0 1 0 0 1.5", "shape a"//lf//"rounding 0.01"//lf//corners, &
      & "shape a"//lf//corners//"shape b"//lf//corners, "shape a"//lf//"polygon 0 0 2 0 0 2"]
    type(shape_library_t) :: one, other
    type(error_t), allocatable :: error
    integer :: i, k

    do i = 1, size(text)
      do k = 1, size(text)
        call parse_shapes(path, trim(text(i)), 2, one, error)
        call parse_shapes(path, trim(text(k)), 2, other, error)
        if (allocated(error)) then
          call check(.false., error%message)
          return
        end if
        call check((library_digest(one) == library_digest(other)) .eqv. i == k, "digests of libraries that differ")
      end do
    end do
  end subroutine test_digest

  subroutine test_statements_refused()
    call refuse("", 2, "a.shapes: no shapes: expected shape and a name")
    call refuse("# nothing"//lf, 2, "a.shapes: no shapes")
    call refuse("polygon 0 0 1 0 0 1", 2, "line 1: polygon: expected shape and a name before it")
    call refuse("1 2 3", 2, 'line 1: "1": expected shape and a name before any number')
    call refuse("shape a"//lf//"1 2 3", 2, &
      & 'line 2: "1": expected shape, rounding, polygon, disk, capsule, regular or random_hull')
    call refuse("shape a"//lf//lf//"polygn 0 0 1 0 0 1", 2, &
      & 'line 3: "polygn": expected shape, rounding, polygon, disk, capsule, regular or random_hull')
    call refuse("shape a"//lf//"hull 0 0 1 0 0 1", 2, &
      & 'line 2: "hull": expected shape, rounding, polygon, disk, capsule, regular or random_hull')
    call refuse("shape a"//lf//"polygon 0 0 1 0 0 one", 2, 'line 2: "one": expected a finite number')
    call refuse("shape a"//lf//"polygon 0 0 1 0"//lf//"0 nan", 2, 'line 3: "nan": expected a finite number')
    call refuse("shape a"//lf//"polygon 0 0 1 0 0 1e400", 2, 'line 2: "1e400": expected a number of at most 1e30 in size')
    call refuse("shape a"//lf//"polygon 0 0 1 0 0 -1e31", 2, 'line 2: "-1e31": expected a number of at most 1e30 in size')
    call refuse("shape a", 2, "line 1: shape a: expected a piece or several behind it")
    call refuse("shape a"//lf//"rounding 1"//lf//"shape b"//lf//"disk 0 0 1", 2, "line 1: shape a: expected a piece or several")
    call refuse("shape a"//lf//"disk 0 0 1"//lf//"rounding 0.1", 2, "line 3: rounding: expected once, before the pieces")
    call refuse("shape a"//lf//"rounding 0.1"//lf//"rounding 0.1"//lf//"disk 0 0 1", 2, "line 3: rounding: expected once")
    call refuse("shape a"//lf//"rounding"//lf//"disk 0 0 1", 2, "line 2: rounding with 0 numbers: expected one number")
    call refuse("shape a"//lf//"rounding 0"//lf//"disk 0 0 1", 2, &
      & "line 2: rounding 0.00000000E+00: expected a number from 1e-30")
  end subroutine test_statements_refused

  subroutine test_names_refused()
    character(len=*), parameter :: disk = lf//"disk 0 0 1"//lf

    call refuse("shape"//disk, 2, "line 1: shape: expected a name behind it")
    call refuse("shape plane"//disk, 2, "line 1: shape plane: expected another name")
    call refuse("shape Disk"//disk, 2, "line 1: shape Disk: expected another name")
    call refuse("shape sphere"//disk, 2, "line 1: shape sphere: expected another name")
    call refuse("shape grain"//disk, 2, "line 1: shape grain: expected another name")
    call refuse("shape two words"//disk, 2, "line 1: shape two words: expected a name of at most 64 characters without blanks")
    call refuse("shape a,b"//disk, 2, "without blanks, commas and quotes")
    call refuse("shape "//repeat("a", 65)//disk, 2, "a name of at most 64 characters")
    call refuse("shape a"//disk//"shape b"//disk//"shape a"//disk, 2, "line 5: shape a: expected a name that no shape above has")
  end subroutine test_names_refused

  subroutine test_planar_refused()
    call refuse("shape a"//lf//"polygon 0 0 1 0", 2, "line 2: polygon with 4 numbers: expected x and y of three corners or more")
    call refuse("shape a"//lf//"polygon 0 0 1 0 0 1 1", 2, "line 2: polygon with 7 numbers: expected x and y of three corners")
    call refuse("shape a"//lf//"disk 0 0", 2, "line 2: disk with 2 numbers: expected x, y and a radius")
    call refuse("shape a"//lf//"capsule 0 0 1 0", 2, "line 2: capsule with 4 numbers: expected x and y of both ends and a radius")
    call refuse("shape a"//lf//"disk 0 0 0", 2, "line 2: disk with a radius of 0.00000000E+00: expected a number from 1e-30")
    call refuse("shape a"//lf//"capsule 0 0 1 0 -1", 2, "line 2: capsule with a radius of -1.00000000E+00: expected a number")
    call refuse("shape a"//lf//"capsule 0 0 0 0 1", 2, "line 2: shape a: a capsule of length 0: expected two ends")
    call refuse("shape a"//lf//"polygon 0 0 2 0 1 0.5 0 2", 2, "line 2: shape a: a polygon that is not convex")
    call refuse("shape a"//lf//"polygon 0 0 1 0 2 0", 2, "line 2: shape a: a polygon without area")
    call refuse("shape a"//lf//"polygon 0 0 0 0 0 0", 2, "line 2: shape a: a polygon without area")
    call refuse("shape a"//lf//"polygon 0 0 1 0 1 0 0 1", 2, "line 2: shape a: corners 2 and 3 of a polygon in the same place")
    call refuse("shape a"//lf//"rounding 0.6"//lf//"polygon 0 0 1 0 1 1 0 1", 2, "line 3: shape a: a rounding of")
    call refuse("shape a"//lf//"disk 0 0 1000"//lf//"polygon 0 0 1 0 1 1 0 1", 2, "line 3: shape a: a rounding of")
  end subroutine test_planar_refused

  !> A box, a tetrahedron, a capsule, a sphere and a cluster: sizes, volumes and moments that are known.
  subroutine test_space()
    type(shape_library_t) :: library
    type(error_t), allocatable :: error

    call parse_shapes(path, "shape box"//lf//"rounding 0.01"//lf//"box 4 2 4"//lf//"shape tetra"//lf//"hull 1 1 1  1 -1 -1"//lf// &
      & "  -1 1 -1"//lf//"  -1 -1 1"//lf//"shape pill"//lf//"capsule 0 0 -1 0 0 1 0.5"//lf//"shape ball"//lf//"sphere 1 2 3 0.5"// &
      & lf//"shape pair"//lf//"box 1 1 1 0.5 0 0"//lf//"box 1 1 1 -0.5 0 0", 3, library, error)
    call check(.not. allocated(error), "a good file in space")
    if (allocated(error)) call check(.false., error%message)
    if (allocated(error)) return
    associate (box => library%shape(1), tetra => library%shape(2), pill => library%shape(3), ball => library%shape(4), &
      & pair => library%shape(5))
      call check_close(box%size, 3.0_dp, rounding_error, "size of a box")
      call check_close(box%volume*box%size**3, 32.0_dp, 100*rounding_error, "volume of a box")
      call check_close(box%inertia(2)*box%size**2, (4.0_dp**2 + 4.0_dp**2)/12, 100*rounding_error, "largest inertia of a box")
      call check_close(box%piece(1)%rounding*box%size, 0.01_dp, rounding_error, "a rounding that is said")
      call check_close(tetra%size, sqrt(3.0_dp), 10*rounding_error, "size of a tetrahedron")
      call check_close(tetra%volume*tetra%size**3, 8.0_dp/3.0_dp, 100*rounding_error, "volume of a tetrahedron")
      call check_close(tetra%piece(1)%rounding, 1.0e-3_dp, rounding_error, "the usual rounding")
      call check_close(pill%size, 1.5_dp, rounding_error, "size of a capsule")
      call check_close(pill%volume*pill%size**3, pi*0.25_dp*2 + pi/6, 100*rounding_error, "volume of a capsule")
      call check_close(ball%volume, 4.0_dp/3.0_dp*pi, 100*rounding_error, "volume of a sphere of radius 1")
      call check_equal(size(pair%piece), 2, "pieces of a cluster of boxes")
      call check_close(pair%size, sqrt(1.5_dp), 10*rounding_error, "size of a cluster")
      call check_close(pair%inertia(3)*pair%size**2, 5.0_dp/12, 100*rounding_error, "inertia of a cluster across its axis")
      call check_close(pair%inertia(1)*pair%size**2, 1.0_dp/6, 100*rounding_error, "inertia of a cluster about its axis")
    end associate
  end subroutine test_space

  !> A box that is written askew has the shape of one that is not, and the quaternion that turns it to where it was written.
  subroutine test_principal_axes()
    real(dp), parameter :: angle = 0.3_dp
    character(len=24) :: number
    character(len=:), allocatable :: text
    type(shape_library_t) :: straight, askew
    type(error_t), allocatable :: error
    real(dp) :: corner(3), across
    integer :: k, d, v

    text = "shape b"//lf//"hull"
    do k = 0, 7
      do d = 1, 3
        corner(d) = (4 - d)*(2*ibits(k, d - 1, 1) - 1)
      end do
      across = cos(angle)*corner(1) - sin(angle)*corner(2)
      corner(2) = sin(angle)*corner(1) + cos(angle)*corner(2)
      corner(1) = across
      do d = 1, 3
        write (number, "(es24.16)") corner(d)
        text = text//" "//number
      end do
    end do
    call parse_shapes(path, text, 3, askew, error)
    call parse_shapes(path, "shape b"//lf//"box 6 4 2", 3, straight, error)
    call check(.not. allocated(error), "a box askew")
    if (allocated(error)) return
    associate (one => straight%shape(1), other => askew%shape(1))
      do d = 1, 3
        call check_close(other%inertia(d), one%inertia(d), 10*rounding_error, "a principal moment")
      end do
      call check_close(other%turn(1), cos(angle/2), 10*rounding_error, "real part of the turn")
      call check_close(other%turn(4), sin(angle/2), 10*rounding_error, "turn about the third axis")
      call check(all(abs(other%turn(2:3)) <= 10*rounding_error), "no turn about the others")
      call check(all(abs(one%turn(2:4)) <= 0.0_dp), "no turn of what is written in principal axes")
      do v = 1, size(other%piece(1)%corner, 2)
        do d = 1, 3
          call check_close(abs(other%piece(1)%corner(d, v)), (4 - d)/sqrt(14.0_dp), 10*rounding_error, "a corner in principal axes")
        end do
      end do
    end associate
  end subroutine test_principal_axes

  subroutine test_space_refused()
    call refuse("shape a"//lf//"polygon 0 0 1 0 0 1", 3, &
      & 'line 2: "polygon": expected shape, rounding, hull, box, sphere, capsule, file, tetrahedron, cube, '// &
      & "octahedron, dodecahedron, icosahedron or random_hull")
    call refuse("shape a"//lf//"hull 0 0 0 1 0 0 0 1 0", 3, &
      & "line 2: hull with 9 numbers: expected x, y and z of four corners or more")
    call refuse("shape a"//lf//"hull 0 0 0 1 0 0 0 1 0 1", 3, "line 2: hull with 10 numbers: expected x, y and z of four corners")
    call refuse("shape a"//lf//"hull 0 0 0 1 0 0 0 1 0 1 1 0", 3, "line 2: shape a: ")
    call refuse("shape a"//lf//"box 1 1", 3, &
      & "line 2: box with 2 numbers: expected three lengths, and perhaps x, y and z of the centre")
    call refuse("shape a"//lf//"box 1 0 1", 3, &
      & "line 2: box with a length of 0.00000000E+00: expected a number from 1e-30 to 1e30")
    call refuse("shape a"//lf//"sphere 0 0 1", 3, "line 2: sphere with 3 numbers: expected x, y, z and a radius")
    call refuse("shape a"//lf//"sphere 0 0 0 0", 3, "line 2: sphere with a radius of 0.00000000E+00: expected a number")
    call refuse("shape a"//lf//"capsule 0 0 0 1 0 0", 3, &
      & "line 2: capsule with 6 numbers: expected x, y and z of both ends and a radius")
    call refuse("shape a"//lf//"capsule 0 0 0 0 0 0 1", 3, "line 2: shape a: a capsule of length 0: expected two ends")
    call refuse("shape a"//lf//"rounding 0.6"//lf//"box 1 1 1", 3, "line 3: shape a: the rounding of ")
    call refuse("shape a"//lf//"sphere 0 0 0 1000"//lf//"box 1 1 1", 3, "line 3: shape a: the rounding of ")
  end subroutine test_space_refused

  subroutine write_file(name, text)
    character(len=*), intent(in) :: name, text
    integer :: unit

    open (newunit=unit, file=name, access="stream", form="unformatted", status="replace", action="write")
    write (unit) text
    close (unit)
  end subroutine write_file

  !> A tetrahedron with three edges along the axes, or one whose fourth point lies elsewhere, as the text of an OBJ file.
  function tetrahedron(last, faces) result(text)
    !> coordinates of the fourth point; lines of faces
    character(len=*), intent(in) :: last, faces
    character(len=:), allocatable :: text

    text = "v 0 0 0"//lf//"v 1 0 0"//lf//"v 0 1 0"//lf//"v "//last//lf//faces
  end function tetrahedron

  !> Areas, sides and places of regular polygons are those of geometry, and the lowest side lies along the first axis.
  subroutine test_regular_polygons()
    type(shape_library_t) :: library
    type(error_t), allocatable :: error
    integer :: n
    real(dp) :: low

    do n = 3, 12
      call parse_shapes(path, "shape a"//lf//"regular "//to_text(n)//" 0.3"//lf//"shape b"//lf//"regular "//to_text(n)// &
        & " 0.3 5 7", 2, library, error)
      call check(.not. allocated(error), "a regular polygon")
      if (allocated(error)) return
      associate (one => library%shape(1), other => library%shape(2))
        call check_equal(size(one%piece(1)%corner, 2), n, "corners of a regular polygon")
        call check_close(one%size, 0.3_dp, rounding_error, "radius of a regular polygon")
        call check_close(one%volume, 0.5_dp*n*sin(2*pi/n), 10*rounding_error, "area of a regular polygon")
        low = minval(one%piece(1)%corner(2, :))
        call check_close(low, -cos(pi/n), 10*rounding_error, "height of the lowest side")
        call check_equal(count(abs(one%piece(1)%corner(2, :) - low) < 1.0e-12_dp), 2, "corners of the lowest side")
        call check_close(other%size, one%size, 100*rounding_error, "a polygon about a point")
      end associate
    end do
  end subroutine test_regular_polygons

  !> Corners, faces and volumes of the Platonic solids in a sphere of radius 1.
  subroutine test_platonic_solids()
    character(len=12), parameter :: name(5) = [character(len=12) :: "tetrahedron", "cube", "octahedron", "dodecahedron", &
      & "icosahedron"]
    integer, parameter :: corners(5) = [4, 8, 6, 20, 12], faces(5) = [4, 6, 8, 12, 20]
    real(dp), parameter :: volume(5) = [8*sqrt(3.0_dp)/27, 8*sqrt(3.0_dp)/9, 4.0_dp/3, &
      & (15 + 7*sqrt(5.0_dp))/4*(4/(sqrt(3.0_dp)*(1 + sqrt(5.0_dp))))**3, 5*(3 + sqrt(5.0_dp))/12*(4/sqrt(10 + 2*sqrt(5.0_dp)))**3]
    type(shape_library_t) :: library
    type(error_t), allocatable :: error
    integer :: k

    do k = 1, 5
      call parse_shapes(path, "shape a"//lf//trim(name(k))//" 0.2 1 2 3", 3, library, error)
      call check(.not. allocated(error), name(k))
      if (allocated(error)) return
      associate (shape => library%shape(1))
        call check_equal(size(shape%piece(1)%vertex, 2), corners(k), trim(name(k))//": corners")
        call check_equal(size(shape%piece(1)%face_first) - 1, faces(k), trim(name(k))//": faces")
        call check_close(shape%size, 0.2_dp, 100*rounding_error, trim(name(k))//": radius")
        call check_close(shape%volume, volume(k), 100*rounding_error, trim(name(k))//": volume")
        call check_close(shape%inertia(1), shape%inertia(3), 100*rounding_error, trim(name(k))//": equal moments")
      end associate
    end do
    ! two cubes of edge 1 side by side
    call parse_shapes(path, "shape a"//lf//"cube 0.86602540378443865"//lf//"cube 0.86602540378443865 1 0 0", 3, library, error)
    call check(.not. allocated(error), "two cubes")
    if (allocated(error)) return
    call check_close(library%shape(1)%size, sqrt(1.5_dp), 100*rounding_error, "size of two cubes")
    call check_close(library%shape(1)%volume*1.5_dp**1.5_dp, 2.0_dp, 100*rounding_error, "volume of two cubes")
  end subroutine test_platonic_solids

  !> Stones of a hundred seeds: all corners on the ellipsoid, the same again for the same seed, another one for another.
  subroutine test_random_hulls()
    type(shape_library_t) :: library, again, planar
    type(error_t), allocatable :: error
    integer :: seed

    do seed = 1, 100
      call parse_shapes(path, "shape a"//lf//"random_hull "//to_text(seed)//" 12 1 1 1"//lf//"shape b"//lf//"random_hull "// &
        & to_text(seed)//" 20 3 2 1 9 9 9", 3, library, error)
      if (.not. allocated(error)) call parse_shapes(path, "shape a"//lf//"random_hull "//to_text(seed)//" 7 2 1", 2, planar, error)
      if (allocated(error)) then
        call check(.false., error%message)
        return
      end if
      associate (ball => library%shape(1), flat => library%shape(2))
        ! the smallest ball of 12 corners has about half its volume in their hull
        call check(ball%volume*ball%size**3 > 1.5_dp .and. ball%volume*ball%size**3 < 4*pi/3, "volume of a stone")
        call check(flat%volume*flat%size**3 > 10.0_dp .and. flat%volume*flat%size**3 < 8*pi, "volume of a flat stone")
        call check(ball%size >= 1.0_dp - rounding_error .and. ball%size < 1.5_dp, "size of a stone")
      end associate
      call check_equal(size(planar%shape(1)%piece(1)%corner, 2), 7, "corners of a stone in the plane")
    end do
    call parse_shapes(path, "shape a"//lf//"random_hull 100 12 1 1 1"//lf//"shape b"//lf//"random_hull 100 20 3 2 1 9 9 9", 3, &
      & again, error)
    call check(library_digest(again) == library_digest(library), "the same seeds")
    call parse_shapes(path, "shape a"//lf//"random_hull 101 12 1 1 1"//lf//"shape b"//lf//"random_hull 100 20 3 2 1 9 9 9", 3, &
      & again, error)
    call check(library_digest(again) /= library_digest(library), "other seeds")
  end subroutine test_random_hulls

  subroutine test_words_refused()
    call refuse("shape a"//lf//"regular 5", 2, &
      & "line 2: regular with 1 numbers: expected a number of corners and a radius, and perhaps")
    call refuse("shape a"//lf//"regular 2 1", 2, &
      & "line 2: regular with corners 2.00000E+00: expected a whole number from 3 to 1000")
    call refuse("shape a"//lf//"regular 4.5 1", 2, &
      & "line 2: regular with corners 4.50000E+00: expected a whole number from 3 to 1000")
    call refuse("shape a"//lf//"regular 5 0", 2, "line 2: regular with a length of 0.00000000E+00: expected a number from 1e-30")
    call refuse("shape a"//lf//"cube 1 2", 3, &
      & "line 2: cube with 2 numbers: expected a radius, and perhaps x, y and z of the centre")
    call refuse("shape a"//lf//"cube -1", 3, "line 2: cube with a length of -1.00000000E+00: expected a number from 1e-30")
    call refuse("shape a"//lf//"cube 1", 2, 'line 2: "cube": expected shape')
    call refuse("shape a"//lf//"random_hull 1 12 1 1", 3, &
      & "line 2: random_hull with 4 numbers: expected a seed, a number of corners")
    call refuse("shape a"//lf//"random_hull -1 12 1 1 1", 3, &
      & "random_hull with a seed -1.00000E+00: expected a whole number from 0")
    call refuse("shape a"//lf//"random_hull 1e12 12 1 1 1", 3, &
      & "random_hull with a seed 1.00000E+12: expected a whole number from 0")
    call refuse("shape a"//lf//"random_hull 1 3 1 1 1", 3, &
      & "random_hull with corners 3.00000E+00: expected a whole number from 4")
    call refuse("shape a"//lf//"random_hull 1 12 1 0 1", 3, "random_hull with a length of 0.00000000E+00: expected")
    call refuse("shape a"//lf//"rounding 0.5"//lf//"cube 0.5", 3, "too large")
  end subroutine test_words_refused

  !> A body of a file is that of the same points, and may be a piece of a cluster.
  subroutine test_surface_files()
    character(len=*), parameter :: outwards = "f 1 3 2"//lf//"f 1 2 4"//lf//"f 1 4 3"//lf//"f 2 3 4"//lf
    type(shape_library_t) :: file, hull
    type(error_t), allocatable :: error

    call write_file("a surface.obj", tetrahedron("0 0 1", outwards))
    call parse_shapes(path, "shape a"//lf//"file a surface.obj  # it is"//lf//"shape b"//lf//"rounding 0.01"//lf// &
      & "file a surface.obj"//lf//"sphere 0 0 5 1", 3, file, error)
    call check(.not. allocated(error), "a file of a surface")
    if (allocated(error)) call check(.false., error%message)
    if (allocated(error)) return
    call parse_shapes(path, "shape a"//lf//"hull 0 0 0 1 0 0 0 1 0 0 0 1", 3, hull, error)
    associate (one => file%shape(1), other => hull%shape(1))
      call check_close(one%size, other%size, rounding_error, "size of a surface")
      call check_close(one%volume*one%size**3, 1.0_dp/6, rounding_error, "volume of a surface")
      call check_close(one%piece(1)%rounding, 1.0e-3_dp, rounding_error, "the usual rounding of a surface")
    end associate
    call check_equal(size(file%shape(2)%piece), 2, "a surface as a piece of a cluster")
    call check_close(file%shape(2)%piece(1)%rounding*file%shape(2)%size, 0.01_dp, rounding_error, "its rounding")
  end subroutine test_surface_files

  subroutine test_surface_files_refused()
    character(len=*), parameter :: shape = "shape a"//lf//"file a.obj"
    character(len=*), parameter :: outwards = "f 1 3 2"//lf//"f 1 2 4"//lf//"f 1 4 3"//lf//"f 2 3 4"//lf

    call refuse("shape a"//lf//"file", 3, "line 2: shape a: file : expected a path that ends with .stl or .obj")
    call refuse("shape a"//lf//"file a.ply", 3, "line 2: shape a: file a.ply: expected a path that ends with .stl or .obj")
    call refuse("shape a"//lf//"file none.stl", 3, "line 2: shape a: none.stl: cannot read this file: No such file")
    call refuse("shape a"//lf//"file a.obj"//lf//"1 2 3", 3, 'line 3: "1": expected shape, rounding, hull')
    call write_file("a.obj", tetrahedron("0 0 x", outwards))
    call refuse(shape, 3, 'line 2: shape a: a.obj: line 4: "x", but a number was expected')
    call write_file("a.obj", tetrahedron("0 0 1e31", outwards))
    call refuse(shape, 3, "line 2: shape a: a.obj: a coordinate of 1.00000000E+31 in size: expected a number of at most 1e30")
    call write_file("a.obj", tetrahedron("0 0 1", "f 1 2 3"//lf//"f 1 4 2"//lf//"f 1 3 4"//lf//"f 2 4 3"//lf))
    call refuse(shape, 3, "line 2: shape a: a.obj: the surface is inside out")
    call write_file("a.obj", tetrahedron("0 0 1", "f 1 3 2"//lf//"f 1 2 4"//lf//"f 1 4 3"//lf))
    call refuse(shape, 3, "line 2: shape a: a.obj: ")
    call write_file("a.obj", tetrahedron("1 1 0", outwards))
    call refuse(shape, 3, "line 2: shape a: a.obj: ")
    call write_file("a.obj", tetrahedron("0 0 1", outwards))
    call refuse("shape a"//lf//"rounding 0.3"//lf//"file a.obj", 3, "line 3: shape a: a.obj: the rounding of ")
    call write_file("a.stl", "solid a"//lf//"facet"//lf//repeat("vertex 0 0 0"//lf, 2)//"endfacet"//lf//"facet"//lf// &
      & repeat("vertex 0 0 0"//lf, 4)//"endfacet"//lf)
    call refuse("shape a"//lf//"file a.stl", 3, "line 2: shape a: a.stl: line 5: a facet of 2 corners, but 3 were expected")
    ! a binary file: a head, the number 1, three reals of a normal, nine of corners, the first not a number, two bytes
    call write_file("a.stl", repeat(" ", 80)//achar(1)//repeat(achar(0), 3)//repeat(achar(0), 12)//achar(0)//achar(0)// &
      & char(192)//achar(127)//repeat(achar(0), 32)//repeat(achar(0), 2))
    call refuse("shape a"//lf//"file a.stl", 3, "line 2: shape a: a.stl: triangle 1: a coordinate that is not finite")
    ! an octahedron whose last point lies inside the hull of the others
    call write_file("a.obj", "v 1 0 0"//lf//"v 0 1 0"//lf//"v -1 0 0"//lf//"v 0 -1 0"//lf//"v 0 0 1"//lf//"v 0 0 0.3"//lf// &
      & "f 1 2 5"//lf//"f 2 3 5"//lf//"f 3 4 5"//lf//"f 4 1 5"//lf//"f 2 1 6"//lf//"f 3 2 6"//lf//"f 4 3 6"//lf//"f 1 4 6"//lf)
    call refuse(shape, 3, "line 2: shape a: a.obj: the body is not convex")
  end subroutine test_surface_files_refused

  subroutine test_no_faces()
    type(body_shape_t) :: shape
    type(error_t), allocatable :: error
    real(dp), parameter :: point(3, 1) = 0.0_dp
    integer, parameter :: none(0) = 0

    call make_polyhedron_of_faces("a", sharp_polyhedron_t(point, [1], none), 0.1_dp, shape, error)
    call check(allocated(error), "a surface without faces")
    if (allocated(error)) call check(index(error%message, ": no faces") > 0, "a surface without faces: "//error%message)
  end subroutine test_no_faces

  subroutine refuse(text, dimension, part)
    character(len=*), intent(in) :: text
    integer, intent(in) :: dimension
    !> of the message
    character(len=*), intent(in) :: part
    type(shape_library_t) :: library
    type(error_t), allocatable :: error

    call parse_shapes(path, text, dimension, library, error)
    call check(allocated(error), "refused: "//part)
    if (.not. allocated(error)) return
    call check_equal(error%status, status_input, "status of "//part)
    call check(index(error%message, part) > 0, "'"//part//"' in: "//error%message)
    call check(index(error%message, path//": ") == 1, "names the file: "//error%message)
    call check(index(error%message, lf) == 0, "one line: "//error%message)
  end subroutine refuse

end program test_shapes_file
