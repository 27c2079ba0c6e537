!> Surfaces from STL files, binary and ASCII, and from OBJ files; what is refused, and how.
program test_shape_files
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use, intrinsic :: iso_fortran_env, only: int32, real32
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, status_input
  use gravier_obj_file, only: read_obj
  use gravier_simple_shapes, only: make_polyhedron_of_faces
  use gravier_sharp_polyhedron, only: sharp_polyhedron_t
  use gravier_shape_library, only: body_shape_t
  use gravier_stl_file, only: read_stl
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  character(len=*), parameter :: n = new_line("a")
  !> a tetrahedron with three edges along the axes, of volume 1/6
  character(len=*), parameter :: points_text = "v 0 0 0"//n//"v 1 0 0"//n//"v 0 1.0e0 0"//n//"v 0 0 1 1.0"//n
  real(dp), parameter :: points(3, 4) = reshape([0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1], [3, 4])
  integer, parameter :: faces(3, 4) = reshape([1, 3, 2, 1, 2, 4, 1, 4, 3, 2, 3, 4], [3, 4])
  real(dp), allocatable :: found(:, :)
  integer, allocatable :: first(:), corner(:)

  call MPI_Init()
  call test_obj()
  call test_ascii()
  call test_binary()
  call test_refused_obj()
  call test_refused_stl()
  call finish_checks()
  call MPI_Finalize()

contains

  subroutine write_file(file, text)
    character(len=*), intent(in) :: file, text
    integer :: unit

    open (newunit=unit, file=file, access="stream", status="replace", action="write")
    write (unit) text
    close (unit)
  end subroutine write_file

  !> That what was read is the tetrahedron.
  subroutine check_body(error, name)
    type(error_t), allocatable, intent(inout) :: error
    character(len=*), intent(in) :: name
    type(body_shape_t) :: shape

    if (allocated(error)) print "(a)", error%message
    call check(.not. allocated(error), name)
    if (allocated(error)) return
    call make_polyhedron_of_faces(name, sharp_polyhedron_t(found, first, corner), 0.01_dp, shape, error)
    call check(.not. allocated(error), name//": a body")
    if (allocated(error)) return
    call check_close(shape%volume*shape%size**3, 1/6.0_dp, 1.0e-14_dp, name//": volume")
  end subroutine check_body

  subroutine test_obj()
    type(error_t), allocatable :: error

    call write_file("a.obj", "# a comment"//n//"o body"//n//points_text//"vn 0 0 1"//n//n//"f 1 3 2 # base"//n// &
      & "f 1//1 2//1 4//1"//achar(13)//n//"f 1/1/1 4/2/1 3/3/1"//n//"  f -3 -2 -1")
    call read_obj("a.obj", found, first, corner, error)
    call check_body(error, "obj")
    call check_equal(size(found, 2), 4, "obj: points")
    call check(all(first == [1, 4, 7, 10, 13]), "obj: faces")
    call check(all(corner == reshape(faces, [12])), "obj: corners")
  end subroutine test_obj

  !> The ASCII text of some faces.
  function ascii_of(last) result(text)
    integer, intent(in) :: last
    character(len=:), allocatable :: text
    character(len=60) :: line
    integer :: f, k

    text = "solid a tetrahedron"//n
    do f = 1, last
      text = text//"  facet normal 0 0 0"//n//"    outer loop"//n
      do k = 1, 3
        write (line, "(a, 3es14.6)") "      vertex ", points(:, faces(k, f))
        text = text//trim(line)//n
      end do
      text = text//"    endloop"//n//"  endfacet"//n
    end do
    text = text//"endsolid"//n
  end function ascii_of

  subroutine test_ascii()
    type(error_t), allocatable :: error

    call write_file("a.stl", ascii_of(4))
    call read_stl("a.stl", found, first, corner, error)
    call check_body(error, "ascii stl")
    call check_equal(size(found, 2), 12, "ascii stl: points")
  end subroutine test_ascii

  subroutine write_binary(file, count)
    character(len=*), intent(in) :: file
    !> as the head tells
    integer, intent(in) :: count
    character(len=80) :: head
    integer :: unit, f, k

    head = "solid that a binary file may begin with too"
    open (newunit=unit, file=file, access="stream", status="replace", action="write")
    write (unit) head, int(count, int32)
    do f = 1, 4
      write (unit) real([0, 0, 0], real32)
      do k = 1, 3
        write (unit) real(points(:, faces(k, f)), real32)
      end do
      write (unit) "  "
    end do
    close (unit)
  end subroutine write_binary

  subroutine test_binary()
    type(error_t), allocatable :: error

    call write_binary("b.stl", 4)
    call read_stl("b.stl", found, first, corner, error)
    call check_body(error, "binary stl")
    call check(all(abs(found(:, 5) - [1.0_dp, 0.0_dp, 0.0_dp]) <= 0.0_dp), "binary stl: a point")
  end subroutine test_binary

  subroutine check_message(error, expected)
    type(error_t), allocatable, intent(inout) :: error
    character(len=*), intent(in) :: expected

    call check(allocated(error), "refused: "//expected)
    if (.not. allocated(error)) return
    call check_equal(error%message, expected, "message")
    call check_equal(error%status, status_input, "status")
    deallocate (error)
  end subroutine check_message

  subroutine refuse_obj(text, expected)
    character(len=*), intent(in) :: text, expected
    type(error_t), allocatable :: error

    call write_file("a.obj", text)
    call read_obj("a.obj", found, first, corner, error)
    call check_message(error, expected)
  end subroutine refuse_obj

  subroutine refuse_stl(text, expected)
    character(len=*), intent(in) :: text, expected
    type(error_t), allocatable :: error

    call write_file("a.stl", text)
    call read_stl("a.stl", found, first, corner, error)
    call check_message(error, expected)
  end subroutine refuse_stl

  subroutine test_refused_obj()
    type(error_t), allocatable :: error

    call refuse_obj("", "a.obj: no line of a face, ""f i j k"", was found")
    call refuse_obj(points_text, "a.obj: no line of a face, ""f i j k"", was found")
    call refuse_obj("v 0 0"//n, "a.obj: line 1: """", but a number was expected")
    call refuse_obj("v 0 0 x"//n, "a.obj: line 1: ""x"", but a number was expected")
    call refuse_obj(points_text//"f 1 2", "a.obj: line 5: a face of 2 corners, but 3 or more were expected")
    call refuse_obj(points_text//"f 1 2 5", "a.obj: line 5: ""5"", but the number of a point was expected, from 1 to 4")
    call refuse_obj(points_text//"f 1 2 -5", "a.obj: line 5: ""-5"", but the number of a point was expected, from 1 to 4")
    call refuse_obj(points_text//"f 1 2 /3", "a.obj: line 5: ""/3"", but the number of a point was expected, from 1 to 4")
    call read_obj("none.obj", found, first, corner, error)
    call check(allocated(error), "no such file")
  end subroutine test_refused_obj

  subroutine test_refused_stl()
    type(error_t), allocatable :: error
    character(len=:), allocatable :: text

    call refuse_stl("", "a.stl: no STL file: it is no text that begins with ""solid"", and its length of 0 bytes is not "// &
      & "that of a binary file")
    call refuse_stl("solid"//n//"endsolid"//n, "a.stl: no triangle")
    text = ascii_of(1)
    call refuse_stl(text(1:index(text, "endloop") - 6), "a.stl: line 6: the file ends within a facet")
    call refuse_stl("solid"//n//"facet"//n//"vertex 0 0 1"//n, "a.stl: line 3: the file ends within a facet")
    call refuse_stl("solid"//n//"facet"//n//"vertex 0 0 1"//n//"vertex 0 1 1"//n//"endfacet"//n, &
      & "a.stl: line 5: a facet of 2 corners, but 3 were expected")
    call refuse_stl("solid"//n//"facet"//n//"vertex 0 0 1"//n//"vertex 0 1 1"//n//"vertex 1 1 1"//n// &
      & "vertex 1 0 1"//n//"endfacet"//n, "a.stl: line 6: a fourth corner of a facet, but 3 were expected")
    call refuse_stl("solid"//n//"facet"//n//"vertex 0 0 1"//n//"vertex 0 0 1"//n//"vertex 0 nan 1"//n, &
      & "a.stl: line 5: ""nan"", but a number was expected")
    call refuse_stl("solid"//n//"facet"//n//"vertex 0 0 1"//n//"vertex 0 0 1"//n//"vertex 0 0 1"//n//"vertices"//n, &
      & "a.stl: line 6: ""vertices"", but facet, outer loop, vertex, endloop, endfacet or endsolid was expected")
    call refuse_stl("solid"//n//"vertex 0 0 1"//n//"vertex 0 0 1"//n//"vertex 0 0 1"//n, &
      & "a.stl: line 2: a corner outside of a facet")
    call refuse_stl("solid"//n//"facet"//n//"vertex 0 0 1"//n//"vertex 0 0 1"//n//"facet"//n//"vertex 0 0 1"//n, &
      & "a.stl: line 5: a facet within a facet, but endfacet was expected")
    call refuse_stl("solid"//n//"endfacet"//n//"facet"//n//"vertex 0 0 1"//n//"vertex 0 0 1"//n//"vertex 0 0 1"//n, &
      & "a.stl: line 2: endfacet without a facet")
    call refuse_stl("solid"//n//"facet"//n//"vertex 0 0 1 7"//n//"vertex 0 0 1"//n//"vertex 0 0 1"//n, &
      & "a.stl: line 3: ""7"" after the three numbers of a corner")
    call write_binary("b.stl", 5)
    call read_stl("b.stl", found, first, corner, error)
    call check_message(error, "b.stl: no STL file: it is no text that begins with ""solid"", and its length of 284 bytes "// &
      & "is not that of a binary file of 5 triangles, 334")
  end subroutine test_refused_stl

end program test_shape_files
