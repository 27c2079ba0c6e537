!> Writes frictional contact problems in the HDF5 layout of FCLIB: local ones and global ones without bilateral constraints, each
!> with its solution. gravier_fclib_file reads them.
module gravier_fclib_writer
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_communicator, only: communicator_t
  use gravier_file_system, only: file_length
  use gravier_hdf5_file, only: h5_file_t
  use gravier_fclib_file, only: fclib_local_t, fclib_rows_t, by_columns, by_rows, local_group, global_group, name_of_solution, &
    & matrix_info
  implicit none
  private
  public :: write_fclib_local, write_fclib_global, fclib_origin_t

  !> The file that a problem was read from, whose `info` a new one keeps.
  type :: fclib_origin_t
    character(len=:), allocatable :: path
    !> W is the same, so that what the file says of it is kept, too
    logical :: same_matrix = .false.
  end type fclib_origin_t

contains

  !> Write a local problem without constraints, W by compressed rows, and its solution if there is one. Collective, the same on all
  !> ranks.
  subroutine write_fclib_local(comm, path, local, error, velocity, multipliers, origin)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    !> where `r` is allocated it is written as the solution
    type(fclib_local_t), intent(in) :: local
    type(error_t), allocatable, intent(inout) :: error
    !> (dimension, contacts) W r + q
    real(dp), intent(in), contiguous, optional :: velocity(:, :)
    !> of the constraints that the problem was rid of; none is not written (p)
    real(dp), intent(in), contiguous, optional :: multipliers(:)
    type(fclib_origin_t), intent(in), optional :: origin
    type(h5_file_t) :: file
    integer(i8) :: bytes
    logical :: mine

    if (allocated(error)) return
    mine = comm%rank == 0
    call file%create(comm, path, error)
    bytes = 16_i8*size(local%w%value) + 40_i8*size(local%q) + 65536_i8
    if (present(multipliers)) bytes = bytes + 8_i8*size(multipliers)
    ! what is kept of a file is not longer than the file
    if (present(origin)) bytes = bytes + file_length(origin%path)
    call file%reserve(bytes, error)
    call write_integer("/fclib_local/spacedim", local%dimension)
    call write_integer("/fclib_local/W/m", local%w%n_rows)
    call write_integer("/fclib_local/W/n", local%w%n_columns)
    call write_integer("/fclib_local/W/nzmax", size(local%w%value))
    call write_integer("/fclib_local/W/nz", by_rows)
    call write_indices("/fclib_local/W/p", local%w%start)
    call write_indices("/fclib_local/W/i", local%w%column)
    call write_reals("/fclib_local/W/x", local%w%value)
    call write_reals("/fclib_local/vectors/q", local%q)
    call write_reals("/fclib_local/vectors/mu", local%mu)
    if (allocated(local%r)) call write_columns(name_of_solution, local%r)
    if (present(velocity)) call write_columns("/solution/u", velocity)
    if (present(multipliers)) then
      if (size(multipliers) > 0) call write_reals("/solution/l", multipliers)
    end if
    if (present(origin)) call keep_info(comm, origin, file, error)
    call file%close(error)

  contains

    subroutine write_integer(dataset, value)
      character(len=*), intent(in) :: dataset
      integer, intent(in) :: value
      integer(i8) :: rows(1)
      rows(1) = value
      call file%write_rows(dataset, rows(1:merge(1, 0, mine)), error)
    end subroutine write_integer

    !> Numbers that count from 1 here and from 0 in the file.
    subroutine write_indices(dataset, values)
      character(len=*), intent(in) :: dataset
      integer, intent(in), contiguous :: values(:)
      integer(i8), allocatable :: rows(:)

      allocate (rows(size(values)))
      rows(:) = values - 1
      call file%write_rows(dataset, rows(1:merge(size(rows), 0, mine)), error)
    end subroutine write_indices

    subroutine write_reals(dataset, values)
      character(len=*), intent(in) :: dataset
      real(dp), intent(in), contiguous :: values(:)
      call file%write_rows(dataset, values(1:merge(size(values), 0, mine)), error)
    end subroutine write_reals

    subroutine write_columns(dataset, values)
      character(len=*), intent(in) :: dataset
      real(dp), intent(in), contiguous :: values(:, :)
      real(dp), allocatable :: numbers(:)

      allocate (numbers(size(values)))
      call flatten(values, numbers)
      call write_reals(dataset, numbers)
    end subroutine write_columns

  end subroutine write_fclib_local

  !> What the file of origin says of the problem and of W. Collective.
  subroutine keep_info(comm, origin, file, error)
    type(communicator_t), intent(in) :: comm
    type(fclib_origin_t), intent(in) :: origin
    type(h5_file_t), intent(inout) :: file
    type(error_t), allocatable, intent(inout) :: error
    type(h5_file_t) :: source
    type(error_t), allocatable :: ignored
    integer :: k

    call source%open(comm, origin%path, error)
    if (allocated(error)) return
    call file%take_over(source, local_group//"/info", local_group//"/info", error)
    if (.not. source%exists(local_group)) call file%take_over(source, global_group//"/info", local_group//"/info", error)
    do k = 1, merge(size(matrix_info), 0, origin%same_matrix)
      call file%take_over(source, local_group//"/W/"//trim(matrix_info(k)), local_group//"/W/"//trim(matrix_info(k)), error)
    end do
    call source%close(ignored)
  end subroutine keep_info

  !> The numbers of a table, column after column.
  pure subroutine flatten(table, values)
    real(dp), intent(in), contiguous :: table(:, :)
    real(dp), intent(out), contiguous :: values(:)
    integer :: a

    do a = 1, size(table, 2)
      values((a - 1)*size(table, 1) + 1:a*size(table, 1)) = table(:, a)
    end do
  end subroutine flatten

  !> Write a global problem, M by compressed rows and H by compressed columns, with its solution. Collective; errors are the same
  !> on all ranks.
  subroutine write_fclib_global(comm, path, rows, error)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    type(fclib_rows_t), intent(in) :: rows
    type(error_t), allocatable, intent(inout) :: error
    type(h5_file_t) :: file
    integer(i8) :: n, columns, entries
    integer(i8), allocatable :: place(:)

    if (allocated(error)) return
    n = comm%total(size(rows%f, kind=i8))
    columns = comm%total(size(rows%w, kind=i8))
    entries = comm%total(size(rows%h, kind=i8)) + comm%total(size(rows%mass, kind=i8))
    place = comm%offset(size(rows%f, kind=i8)) + rows%mass_column
    call file%create(comm, path, error)
    call file%reserve(48_i8*(n + columns) + 16_i8*entries + 65536_i8, error)
    call write_integer("/fclib_global/spacedim", int(rows%dimension, i8))
    call write_matrix("/fclib_global/M", by_rows, n, rows%mass_entries, place, rows%mass)
    call write_matrix("/fclib_global/H", by_columns, columns, rows%entries, rows%row, rows%h)
    call file%write_rows("/fclib_global/vectors/f", rows%f, error)
    call file%write_rows("/fclib_global/vectors/w", rows%w, error)
    call file%write_rows("/fclib_global/vectors/mu", rows%mu, error)
    call file%write_rows("/solution/v", rows%v, error)
    call file%write_rows(name_of_solution, rows%r, error)
    call file%write_rows("/solution/u", rows%u, error)
    call file%close(error)

  contains

    !> One number, by rank 0.
    subroutine write_integer(dataset, value)
      character(len=*), intent(in) :: dataset
      integer(i8), intent(in) :: value
      integer(i8) :: values(1)

      values(1) = value
      call file%write_rows(dataset, values(1:merge(1, 0, comm%rank == 0)), error)
    end subroutine write_integer

    !> A matrix of n rows, compressed by lines (rows or columns).
    subroutine write_matrix(group, kind, n_columns, length, places, values)
      character(len=*), intent(in) :: group
      integer, intent(in) :: kind
      integer(i8), intent(in) :: n_columns
      !> entries of each line of this rank; their places in the lines, from 1 on
      integer(i8), intent(in), contiguous :: length(:), places(:)
      real(dp), intent(in), contiguous :: values(:)
      integer(i8), allocatable :: start(:)
      integer :: i

      allocate (start(size(length) + 1))
      start(1) = comm%offset(size(values, kind=i8))
      do i = 1, size(length)
        start(i + 1) = start(i) + length(i)
      end do
      call write_integer(group//"/m", n)
      call write_integer(group//"/n", n_columns)
      call write_integer(group//"/nzmax", comm%total(size(values, kind=i8)))
      call write_integer(group//"/nz", int(kind, i8))
      ! the last rank writes the end of the last line
      call file%write_rows(group//"/p", start(1:size(length) + merge(1, 0, comm%rank == comm%size - 1)), error)
      start = places - 1
      call file%write_rows(group//"/i", start, error)
      call file%write_rows(group//"/x", values, error)
    end subroutine write_matrix

  end subroutine write_fclib_global

end module gravier_fclib_writer
