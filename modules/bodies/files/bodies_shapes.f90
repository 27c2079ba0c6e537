!> Shapes of bodies in HDF5: /bodies/{shape, scale, orientation}. `shape` holds numbers, k for the k-th of the names that its
!> attribute `names` lists with commas between, and 0 for a disk or a sphere. In 3D `orientation` is that of the axes in which the
!> shapes are written or, where its attribute `axes` is 'principal', that of their principal axes.
module gravier_bodies_shapes
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_hdf5_file, only: h5_file_t
  use gravier_shape_library, only: shape_library_t
  use gravier_shape_names, only: find_shape, shape_names
  use gravier_bodies_data, only: bodies_data_t
  use gravier_bodies_checks, only: check_numbers, quantity, extent
  use gravier_body_turn, only: settle_turn, settle_radius, take_principal_axes, is_fine_turn, fine_turn_text
  implicit none
  private
  public :: read_body_shapes, write_body_shapes

contains

  !> Read shapes, scales and orientations of bodies whose identifiers and radii, 0 where the file has none, are read, and settle the
  !> radii. Errors are the same on all ranks. Collective.
  subroutine read_body_shapes(comm, file, path, first, shapes, bodies, error)
    type(communicator_t), intent(in) :: comm
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: path
    !> row of the first body of this rank, from 0
    integer(i8), intent(in) :: first
    type(shape_library_t), intent(in) :: shapes
    type(bodies_data_t), intent(inout) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    real(dp), allocatable :: scale(:)
    integer(i8), allocatable :: listed(:)
    integer, allocatable :: number(:)

    if (allocated(error)) return
    if (file%exists("/bodies/shape")) then
      call find_named(file, path, shapes, number, error)
      allocate (listed(bodies%n), source=0_i8)
      call file%read_rows("/bodies/shape", first, listed, error)
      call take_numbers(path, listed, number, bodies, error)
      call comm%agree(error)
    end if
    call read_turns(comm, file, path, first, shapes, bodies, error)
    allocate (scale(bodies%n), source=1.0_dp)
    if (file%exists("/bodies/scale")) then
      call file%read_rows("/bodies/scale", first, scale, error)
      call check_numbers(comm, path//": /bodies/scale", 1, bodies%id, scale, extent, error)
    end if
    call settle_radii(path, file%exists("/bodies/scale"), scale, shapes, bodies, error)
    call comm%agree(error)
  end subroutine read_body_shapes

  !> Numbers in the library of the names that the file lists.
  subroutine find_named(file, path, shapes, number, error)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: path
    type(shape_library_t), intent(in) :: shapes
    integer, allocatable, intent(out) :: number(:)
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: names
    integer :: n, k, at, length

    allocate (number(0))
    if (.not. file%has_attribute("/bodies/shape", "names")) then
      call raise(error, status_input, path//": /bodies/shape: no attribute names; the names of the shapes with commas between "// &
        & "were expected in it")
      return
    end if
    call file%read_attribute("/bodies/shape", "names", names, error)
    if (allocated(error)) return
    n = 0
    do k = 1, len_trim(names)
      if (names(k:k) == "," .or. k == len_trim(names)) n = n + 1
    end do
    deallocate (number)
    allocate (number(n), source=0)
    at = 1
    do n = 1, size(number)
      length = index(names(at:)//",", ",") - 1
      k = find_shape(shapes, trim(adjustl(names(at:at + length - 1))))
      if (k == 0) then
        call raise(error, status_input, path//": /bodies/shape: attribute names: "//trim(adjustl(names(at:at + length - 1)))// &
          & ": expected one of the shapes of the scene, "//shape_names(shapes, ", "))
        return
      end if
      number(n) = k
      at = at + length + 1
    end do
  end subroutine find_named

  !> Shapes of the bodies from places in the list of the file.
  subroutine take_numbers(path, listed, number, bodies, error)
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: listed(:)
    !> in the library
    integer, intent(in) :: number(:)
    type(bodies_data_t), intent(inout) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    integer :: i

    if (allocated(error)) return
    do i = 1, bodies%n
      if (listed(i) == 0) cycle
      if (listed(i) < 0 .or. listed(i) > size(number)) then
        call raise(error, status_input, path//": /bodies/shape: id "//to_text(bodies%id(i))//": "//to_text(listed(i))// &
          & ", but a number from 0 to "//to_text(size(number))//", that of the last of its names, was expected")
        return
      end if
      bodies%shape(i) = number(narrow(listed(i)))
    end do
  end subroutine take_numbers

  !> Angles, as a vector or as one column, or quaternions; 0 and 1 where the file has none.
  subroutine read_turns(comm, file, path, first, shapes, bodies, error)
    type(communicator_t), intent(in) :: comm
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: first
    type(shape_library_t), intent(in) :: shapes
    type(bodies_data_t), intent(inout) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    logical :: possible, principal
    integer :: i

    principal = .false.
    if (file%exists("/bodies/orientation")) then
      call read_orientation(file, first, bodies, error)
      call check_numbers(comm, path//": /bodies/orientation", size(bodies%orientation, 1), bodies%id, bodies%orientation, &
        & quantity, error)
      call find_axes(file, path, principal, error)
    end if
    if (.not. allocated(error)) then
      do i = 1, bodies%n
        if (is_fine_turn(bodies%orientation(:, i))) cycle
        call raise(error, status_input, path//": /bodies/orientation: id "//to_text(bodies%id(i))//": "// &
          & to_text(bodies%orientation(1, i))//", but "//fine_turn_text//" was expected")
        exit
      end do
      do i = 1, bodies%n
        call settle_turn(bodies%orientation(:, i), possible)
        if (.not. possible) exit
        if (bodies%shape(i) == 0 .or. principal) cycle
        call take_principal_axes(shapes%shape(bodies%shape(i))%turn, bodies%orientation(:, i))
      end do
      if (i <= bodies%n) call raise(error, status_input, path//": /bodies/orientation: id "//to_text(bodies%id(i))// &
        & ": zero, but a quaternion that is not zero was expected")
    end if
    call comm%agree(error)
  end subroutine read_turns

  subroutine read_orientation(file, first, bodies, error)
    type(h5_file_t), intent(in) :: file
    integer(i8), intent(in) :: first
    type(bodies_data_t), intent(inout) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    real(dp), allocatable :: angle(:)

    if (file%columns("/bodies/orientation") == 0 .and. bodies%dimension == 2) then
      allocate (angle(bodies%n), source=0.0_dp)
      call file%read_rows("/bodies/orientation", first, angle, error)
      bodies%orientation(1, :) = angle
    else
      call file%read_rows("/bodies/orientation", first, bodies%orientation, error)
    end if
  end subroutine read_orientation

  !> Whether orientations are those of principal axes.
  subroutine find_axes(file, path, principal, error)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: path
    logical, intent(out) :: principal
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: axes

    principal = .false.
    if (allocated(error)) return
    if (.not. file%has_attribute("/bodies/orientation", "axes")) return
    call file%read_attribute("/bodies/orientation", "axes", axes, error)
    if (allocated(error)) return
    principal = axes == "principal"
    if (.not. (principal .or. axes == "written")) call raise(error, status_input, path// &
      & ": /bodies/orientation: attribute axes: "//axes//", but principal or written was expected")
  end subroutine find_axes

  !> Radii of bodies with shapes, from what the file says of them.
  subroutine settle_radii(path, scaled, scale, shapes, bodies, error)
    character(len=*), intent(in) :: path
    !> the file has scales
    logical, intent(in) :: scaled
    real(dp), intent(in) :: scale(:)
    type(shape_library_t), intent(in) :: shapes
    type(bodies_data_t), intent(inout) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    logical :: agrees
    integer :: i

    if (allocated(error)) return
    do i = 1, bodies%n
      if (bodies%shape(i) == 0) cycle
      associate (size_of => shapes%shape(bodies%shape(i))%size)
        if (.not. bodies%radius(i) >= 0.0_dp) then
          call raise(error, status_input, path//": /bodies/radius: id "//to_text(bodies%id(i))//": "//to_text(bodies%radius(i))// &
            & ", but 0 or a number above 0 was expected")
          return
        end if
        call settle_radius(size_of, scale(i), scaled, bodies%radius(i), agrees)
        if (agrees) cycle
        call raise(error, status_input, path//": /bodies/radius: id "//to_text(bodies%id(i))//": "//to_text(bodies%radius(i))// &
          & ", but 0, or the radius of the shape at this scale, "//to_text(scale(i)*size_of)//", was expected")
        return
      end associate
    end do
  end subroutine settle_radii

  !> Write shapes, scales and orientations. Collective.
  subroutine write_body_shapes(file, bodies, shapes, error)
    type(h5_file_t), intent(inout) :: file
    type(bodies_data_t), intent(in) :: bodies
    type(shape_library_t), intent(in) :: shapes
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: numbers(bodies%n)
    real(dp), allocatable :: values(:)
    integer :: i

    numbers(:) = bodies%shape
    call file%write_rows("/bodies/shape", numbers, error)
    call file%write_attribute("/bodies/shape", "names", shape_names(shapes, ","), error)
    allocate (values(bodies%n), source=1.0_dp)
    do i = 1, bodies%n
      if (bodies%shape(i) > 0) values(i) = bodies%radius(i)/shapes%shape(bodies%shape(i))%size
    end do
    call file%write_rows("/bodies/scale", values, error)
    if (bodies%dimension == 2) then
      values(:) = bodies%orientation(1, :)
      call file%write_rows("/bodies/orientation", values, error)
      call file%write_attribute("/bodies/orientation", "unit", "rad", error)
    else
      call file%write_rows("/bodies/orientation", bodies%orientation, error)
      call file%write_attribute("/bodies/orientation", "axes", "principal", error)
    end if
  end subroutine write_body_shapes

end module gravier_bodies_shapes
