!> Bodies files: reading in either format, writing in HDF5.
module gravier_bodies_file
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: lower
  use gravier_communicator, only: communicator_t
  use gravier_shape_library, only: shape_library_t
  use gravier_bodies_data, only: bodies_data_t, check_unique_ids
  use gravier_bodies_csv, only: read_bodies_csv
  use gravier_bodies_hdf5, only: read_bodies_hdf5, write_bodies_hdf5
  implicit none
  private
  public :: bodies_data_t, read_bodies, write_bodies

contains

  !> Read a bodies file: HDF5 or CSV by the ending of its name. Rank r of p gets rows [total r/p, total (r+1)/p) and all
  !> walls; no rank ever holds more. Failure: status_input with one line that names the file, the column or dataset, the
  !> line, row or id, and what was expected; the same on all ranks. Collective.
  subroutine read_bodies(comm, path, dimension, bodies, error, shapes)
    type(communicator_t), intent(in) :: comm
    !> ends with .h5, .hdf5 or .csv
    character(len=*), intent(in) :: path
    !> 2 or 3
    integer, intent(in) :: dimension
    type(bodies_data_t), intent(out) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    !> that bodies may have; without it all are disks or spheres
    type(shape_library_t), intent(in), optional :: shapes
    type(shape_library_t) :: library

    if (allocated(error)) return
    if (present(shapes)) library = shapes
    select case (ending(path))
    case (".csv")
      call read_bodies_csv(comm, path, dimension, library, bodies, error)
    case (".h5", ".hdf5")
      call read_bodies_hdf5(comm, path, dimension, library, bodies, error)
    case default
      call raise(error, status_input, path//": the name of a bodies file must end with .h5, .hdf5 or .csv")
    end select
    call check_unique_ids(comm, path, bodies, error)
  end subroutine read_bodies

  !> Write a bodies file in HDF5, in the order of the ids whatever rank holds which body: identifiers, positions, velocities, radii,
  !> groups, materials and walls are allocated, and masses on all ranks or on none. It appears under its name only when complete.
  !> Failure: status_failure, the same on all ranks; an older file of that name stays. Collective.
  subroutine write_bodies(comm, path, bodies, error, shapes)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    !> those of this rank; the same walls and box on all ranks
    type(bodies_data_t), intent(in) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    !> of the bodies, where they have any
    type(shape_library_t), intent(in), optional :: shapes
    call write_bodies_hdf5(comm, path, bodies, error, shapes)
  end subroutine write_bodies

  !> What follows the last point of a name, in lower case, with the point.
  pure function ending(path) result(text)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: text
    integer :: point

    text = ""
    point = index(path, ".", back=.true.)
    if (point > 0) text = lower(path(point:))
  end function ending

end module gravier_bodies_file
