!> Frictional contact problems in the HDF5 layout of FCLIB, the field's open collection, as they are read: local problems
!> v = W r + V l + q and global ones (M, H and G). gravier_fclib_writer writes those without the constraints of V or G. Solutions
!> and guesses stand at the root of a file, as libfclib has them; those that older versions put into the group of the problem are
!> read, too. What is wrong with a file ends in status_input and one line that names the dataset.
module gravier_fclib_file
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow, take_count
  use gravier_room, only: room_for
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_sparse_rows, only: sparse_rows_t, compressed_rows, no_columns, half_of, mirrored
  use gravier_communicator, only: communicator_t
  use gravier_finite, only: is_finite
  use gravier_magnitude, only: is_bounded
  use gravier_hdf5_file, only: h5_file_t
  implicit none
  private
  public :: fclib_local_t, fclib_global_t, fclib_rows_t, read_fclib
  public :: by_columns, by_rows, local_group, global_group, name_of_solution, name_of_guess, matrix_info

  !> v = W r + V l + q, of each contact (n, t) or (n, t, s), and bilateral constraints V^T r + R l + s = 0 with multipliers l.
  type :: fclib_local_t
    !> of space: 2 or 3
    integer :: dimension = 0
    !> (dimension*contacts, dimension*contacts)
    type(sparse_rows_t) :: w
    !> V (dimension*contacts, p) and R (p, p), p = 0 without constraints
    type(sparse_rows_t) :: coupling, constraint
    !> (dimension*contacts), (p)
    real(dp), allocatable :: q(:), s(:)
    !> (contacts)
    real(dp), allocatable :: mu(:)
    !> (dimension, contacts) impulses of the solution, or of the first guess, where the file has one
    real(dp), allocatable :: r(:, :)
    !> what of the file was read otherwise than it stands, in a sentence; empty: nothing
    character(len=:), allocatable :: remark
  end type fclib_local_t

  !> M V = H r + G l + f, G^T V + b = 0, v = H^T V + w.
  type :: fclib_global_t
    integer :: dimension = 0
    !> (n, n), (n, dimension*contacts) and (n, p), p = 0 where the file has no G
    type(sparse_rows_t) :: m, h, g
    !> (n), (p), (dimension*contacts), (contacts)
    real(dp), allocatable :: f(:), b(:), w(:), mu(:)
    !> as in fclib_local_t
    real(dp), allocatable :: r(:, :)
    character(len=:), allocatable :: remark
  end type fclib_global_t

  !> What one rank holds of a global problem without G: a block of the unknowns and a block of the contacts, those of rank 0 first.
  type :: fclib_rows_t
    integer :: dimension = 0
    !> f and the velocities of the solution (unknowns of this rank)
    real(dp), allocatable :: f(:), v(:)
    !> entries of each row of M (unknowns of this rank), their columns, 1 being the first unknown of this rank, their values
    integer(i8), allocatable :: mass_entries(:), mass_column(:)
    real(dp), allocatable :: mass(:)
    !> entries of each column of H (dimension*contacts of this rank), their rows from 1 on, their values
    integer(i8), allocatable :: entries(:), row(:)
    real(dp), allocatable :: h(:)
    !> (contacts); the rest (dimension*contacts): w, impulses of the solution and H^T v + w
    real(dp), allocatable :: mu(:), w(:), r(:), u(:)
  end type fclib_rows_t

  !> An open file and where it is, for messages, and what was read otherwise than it stands.
  type :: source_t
    type(h5_file_t) :: file
    character(len=:), allocatable :: path, remark
  contains
    procedure :: refuse => source_refuse
  end type source_t

  !> values of nz that tell how a matrix is stored; others count the entries of triplets
  integer, parameter :: by_columns = -1, by_rows = -2
  !> groups of problems
  character(len=*), parameter :: local_group = "/fclib_local", global_group = "/fclib_global"
  !> impulses of the solution and of the first guess, from the root
  character(len=*), parameter :: name_of_solution = "/solution/r", name_of_guess = "/guesses/1/r"
  !> what FCLIB says of a matrix, beside its entries
  character(len=*), parameter :: matrix_info(4) = [character(len=12) :: "comment", "conditioning", "determinant", "rank"]

contains

  !> Read the problem of a file: `local` or `global` is allocated. Collective; errors are the same on all ranks.
  subroutine read_fclib(comm, path, local, global, error)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    type(fclib_local_t), allocatable, intent(out) :: local
    type(fclib_global_t), allocatable, intent(out) :: global
    type(error_t), allocatable, intent(inout) :: error
    type(source_t) :: source
    type(error_t), allocatable :: ignored

    if (allocated(error)) return
    source%path = path
    source%remark = ""
    call source%file%open(comm, path, error)
    if (allocated(error)) return
    if (source%file%exists(local_group)) then
      allocate (local)
      call read_local(source, local, error)
      call read_impulses(source, local_group, local%dimension, local%mu, local%r, error)
      local%remark = source%remark
    else if (source%file%exists(global_group)) then
      allocate (global)
      call read_global(source, global, error)
      call read_impulses(source, global_group, global%dimension, global%mu, global%r, error)
      global%remark = source%remark
    else
      call source%refuse("expected a group /fclib_local or /fclib_global", error)
    end if
    call source%file%close(ignored)
  end subroutine read_fclib

  !> Raise an error that names the file.
  pure subroutine source_refuse(self, what, error)
    class(source_t), intent(in) :: self
    character(len=*), intent(in) :: what
    type(error_t), allocatable, intent(inout) :: error
    call raise(error, status_input, self%path//": "//what)
  end subroutine source_refuse

  subroutine read_local(source, local, error)
    type(source_t), intent(inout) :: source
    type(fclib_local_t), intent(inout) :: local
    type(error_t), allocatable, intent(inout) :: error
    integer :: n, n_constraints

    call read_contacts(source, "/fclib_local", local%dimension, local%mu, error)
    if (allocated(error)) return
    n = local%dimension*size(local%mu)
    call read_matrix(source, "/fclib_local/W", n, n, local%w, error, symmetric=.true.)
    call read_vector(source, "/fclib_local/vectors/q", n, local%q, error)
    if (source%file%exists("/fclib_local/V")) then
      call read_vector(source, "/fclib_local/vectors/s", -1, local%s, error)
      if (allocated(error)) return
      n_constraints = size(local%s)
      call read_matrix(source, "/fclib_local/V", n, n_constraints, local%coupling, error)
      call read_matrix(source, "/fclib_local/R", n_constraints, n_constraints, local%constraint, error, symmetric=.true.)
    else
      allocate (local%s(0))
      local%coupling = no_columns(n)
      local%constraint = no_columns(0)
    end if
  end subroutine read_local

  !> The impulses of the solution, or of the first guess, at the root of the file or in the group of the problem; not allocated
  !> where there are none.
  subroutine read_impulses(source, group, dimension, mu, r, error)
    type(source_t), intent(inout) :: source
    character(len=*), intent(in) :: group
    integer, intent(in) :: dimension
    !> (contacts)
    real(dp), allocatable, intent(in) :: mu(:)
    !> (dimension, contacts)
    real(dp), allocatable, intent(inout) :: r(:, :)
    type(error_t), allocatable, intent(inout) :: error
    real(dp), allocatable :: values(:)
    character(len=:), allocatable :: dataset
    integer :: a

    if (allocated(error)) return
    dataset = ""
    if (source%file%exists(group//name_of_guess)) dataset = group//name_of_guess
    if (source%file%exists(name_of_guess)) dataset = name_of_guess
    if (source%file%exists(group//name_of_solution)) dataset = group//name_of_solution
    if (source%file%exists(name_of_solution)) dataset = name_of_solution
    if (dataset == "") return
    call read_vector(source, dataset, dimension*size(mu), values, error)
    if (allocated(error)) return
    allocate (r(dimension, size(mu)))
    do a = 1, size(mu)
      r(:, a) = values((a - 1)*dimension + 1:a*dimension)
    end do
  end subroutine read_impulses

  subroutine read_global(source, global, error)
    type(source_t), intent(inout) :: source
    type(fclib_global_t), intent(inout) :: global
    type(error_t), allocatable, intent(inout) :: error
    integer :: n, n_constraints

    call read_contacts(source, "/fclib_global", global%dimension, global%mu, error)
    call read_vector(source, "/fclib_global/vectors/f", -1, global%f, error)
    if (allocated(error)) return
    n = size(global%f)
    n_constraints = 0
    if (source%file%exists("/fclib_global/G")) then
      call read_vector(source, "/fclib_global/vectors/b", -1, global%b, error)
      if (allocated(error)) return
      n_constraints = size(global%b)
      call read_matrix(source, "/fclib_global/G", n, n_constraints, global%g, error)
    else
      global%g = no_columns(n)
      allocate (global%b(0))
    end if
    call read_matrix(source, "/fclib_global/M", n, n, global%m, error, symmetric=.true.)
    call read_matrix(source, "/fclib_global/H", n, global%dimension*size(global%mu), global%h, error)
    call read_vector(source, "/fclib_global/vectors/w", global%dimension*size(global%mu), global%w, error)
  end subroutine read_global

  !> Dimension of space and coefficients of friction, which tell the number of contacts.
  subroutine read_contacts(source, group, dimension, mu, error)
    type(source_t), intent(inout) :: source
    character(len=*), intent(in) :: group
    integer, intent(out) :: dimension
    real(dp), allocatable, intent(inout) :: mu(:)
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: found
    integer :: unknowns

    dimension = 0
    call read_integer(source, group//"/spacedim", found, error)
    if (allocated(error)) return
    if (found /= 2 .and. found /= 3) call source%refuse(group//"/spacedim = "//to_text(found)// &
      & ": expected 2 or 3", error)
    call read_vector(source, group//"/vectors/mu", -1, mu, error)
    if (allocated(error)) return
    call take_count(found*size(mu), source%path//": "//group//": components of the contacts", unknowns, error)
    if (allocated(error)) return
    dimension = narrow(found)
    if (size(mu) == 0) then
      call source%refuse(group//"/vectors/mu: expected at least one contact", error)
    else if (minval(mu) < 0.0_dp) then
      call source%refuse(group//"/vectors/mu: expected coefficients of friction >= 0", error)
    end if
  end subroutine read_contacts

  !> A dataset that holds one integer.
  subroutine read_integer(source, dataset, value, error)
    type(source_t), intent(inout) :: source
    character(len=*), intent(in) :: dataset
    integer(i8), intent(out) :: value
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: one(1)

    one = 0
    call source%file%read_rows(dataset, 0_i8, one, error)
    value = one(1)
  end subroutine read_integer

  !> A vector of finite numbers.
  subroutine read_vector(source, dataset, n, values, error)
    type(source_t), intent(inout) :: source
    character(len=*), intent(in) :: dataset
    !> its length; negative: any
    integer, intent(in) :: n
    real(dp), allocatable, intent(out) :: values(:)
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: found
    integer :: length

    call source%file%row_count(dataset, found, error)
    if (allocated(error)) return
    if (n >= 0 .and. found /= n) then
      call source%refuse(dataset//": "//to_text(found)//" numbers: expected "//to_text(n), error)
      return
    end if
    call take_count(found, source%path//": "//dataset//": numbers", length, error)
    if (allocated(error)) return
    allocate (values(room_for(found, 8, source%path//": "//dataset, error)), source=0.0_dp)
    call source%file%comm%agree(error)
    call source%file%read_rows(dataset, 0_i8, values, error)
    if (allocated(error)) return
    call check_numbers(source, dataset, values, error)
  end subroutine read_vector

  !> Refuse numbers that are not finite, or beyond what products of a few of them survive.
  subroutine check_numbers(source, dataset, values, error)
    type(source_t), intent(in) :: source
    character(len=*), intent(in) :: dataset
    real(dp), intent(in), contiguous :: values(:)
    type(error_t), allocatable, intent(inout) :: error

    if (.not. all(is_finite(values))) then
      call source%refuse(dataset//": expected finite numbers", error)
    else if (.not. all(is_bounded(values))) then
      call source%refuse(dataset//": expected numbers of at most 1e30 in size", error)
    end if
  end subroutine check_numbers

  !> A vector of at least n integers, of which the first n are kept, each in [lowest, highest].
  subroutine read_indices(source, dataset, n, lowest, highest, values, error)
    type(source_t), intent(inout) :: source
    character(len=*), intent(in) :: dataset
    integer, intent(in) :: n, lowest, highest
    integer, allocatable, intent(inout) :: values(:)
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), allocatable :: found(:)
    integer(i8) :: length

    call source%file%row_count(dataset, length, error)
    if (allocated(error)) return
    if (length < n) then
      call source%refuse(dataset//": "//to_text(length)//" numbers: expected "//to_text(n), error)
      return
    end if
    allocate (found(room_for(int(n, i8), 8, source%path//": "//dataset, error)), source=0_i8)
    call source%file%comm%agree(error)
    call source%file%read_rows(dataset, 0_i8, found, error)
    if (allocated(error)) return
    if (any(found < lowest .or. found > highest)) then
      call source%refuse(dataset//": expected numbers from "//to_text(lowest)//" to "//to_text(highest), error)
      return
    end if
    values = narrow(found)
  end subroutine read_indices

  !> A matrix stored in any of the three ways.
  subroutine read_matrix(source, group, n_rows, n_columns, matrix, error, symmetric)
    type(source_t), intent(inout) :: source
    character(len=*), intent(in) :: group
    integer, intent(in) :: n_rows, n_columns
    type(sparse_rows_t), intent(inout) :: matrix
    type(error_t), allocatable, intent(inout) :: error
    !> present: by its meaning it is, so that entries on one side of the diagonal alone are half of it
    logical, intent(in), optional :: symmetric
    integer, allocatable :: row(:), column(:)
    real(dp), allocatable :: value(:)
    integer(i8) :: m, n, nz

    if (allocated(error)) return
    call read_integer(source, group//"/m", m, error)
    call read_integer(source, group//"/n", n, error)
    call read_integer(source, group//"/nz", nz, error)
    if (allocated(error)) return
    if (m /= n_rows .or. n /= n_columns) then
      call source%refuse(group//": a matrix of "//to_text(m)//" rows and "//to_text(n)// &
        & " columns: expected "//to_text(n_rows)//" and "//to_text(n_columns), error)
    else if (nz < by_rows .or. nz > huge(n_rows)) then
      call source%refuse(group//"/nz = "//to_text(nz)// &
        & ": expected -2 (rows), -1 (columns) or the number of triplets", error)
    end if
    if (allocated(error)) return
    select case (narrow(nz))
    case (by_rows)
      call read_compressed(source, group, n_rows, n_columns, row, column, error)
    case (by_columns)
      call read_compressed(source, group, n_columns, n_rows, column, row, error)
    case default
      call read_indices(source, group//"/i", narrow(nz), 0, n_rows - 1, row, error)
      call read_indices(source, group//"/p", narrow(nz), 0, n_columns - 1, column, error)
      if (.not. allocated(error)) then
        row(:) = row + 1
        column(:) = column + 1
      end if
    end select
    if (.not. allocated(error)) call read_entries(source, group//"/x", size(row), value, error)
    if (allocated(error)) return
    matrix = compressed_rows(n_rows, n_columns, row, column, value)
    if (present(symmetric)) call complete_half(source, group, matrix, error)
  end subroutine read_matrix

  !> Mirror a matrix of which the file has one half, and note it.
  subroutine complete_half(source, group, matrix, error)
    type(source_t), intent(inout) :: source
    character(len=*), intent(in) :: group
    type(sparse_rows_t), intent(inout) :: matrix
    type(error_t), allocatable, intent(inout) :: error
    type(sparse_rows_t) :: whole
    character(len=:), allocatable :: side
    integer :: bad_row

    if (half_of(matrix) == 0) return
    side = trim(merge("above", "below", half_of(matrix) > 0))
    call mirrored(matrix, whole, bad_row)
    if (bad_row > 0) then
      call source%refuse(group//": entries "//side//" the diagonal alone, and row "//to_text(bad_row)// &
        & " has one that no positive semidefinite matrix has: expected all entries, or one half of a symmetric matrix", error)
      return
    end if
    matrix = whole
    if (source%remark /= "") source%remark = source%remark//"; "
    source%remark = source%remark//group//" has entries "//side//" the diagonal alone and is read as half of a symmetric matrix"
  end subroutine complete_half

  !> Numbers of the line (row or column) and of the place in it, from 1, of the entries of a matrix compressed by lines.
  subroutine read_compressed(source, group, n_lines, n_places, line, place, error)
    type(source_t), intent(inout) :: source
    character(len=*), intent(in) :: group
    integer, intent(in) :: n_lines, n_places
    integer, allocatable, intent(inout) :: line(:), place(:)
    type(error_t), allocatable, intent(inout) :: error
    integer, allocatable :: start(:)
    integer :: i

    call read_indices(source, group//"/p", n_lines + 1, 0, huge(0), start, error)
    if (allocated(error)) return
    if (start(1) /= 0 .or. any(start(2:) < start(:n_lines))) then
      call source%refuse(group//"/p: expected numbers that rise from 0", error)
      return
    end if
    call read_indices(source, group//"/i", start(n_lines + 1), 0, n_places - 1, place, error)
    if (allocated(error)) return
    place(:) = place + 1
    allocate (line(size(place)))
    do i = 1, n_lines
      line(start(i) + 1:start(i + 1)) = i
    end do
  end subroutine read_compressed

  !> The first n of a vector of at least n finite numbers.
  subroutine read_entries(source, dataset, n, values, error)
    type(source_t), intent(inout) :: source
    character(len=*), intent(in) :: dataset
    integer, intent(in) :: n
    real(dp), allocatable, intent(out) :: values(:)
    type(error_t), allocatable, intent(inout) :: error

    allocate (values(room_for(int(n, i8), 8, source%path//": "//dataset, error)), source=0.0_dp)
    call source%file%comm%agree(error)
    call source%file%read_rows(dataset, 0_i8, values, error)
    if (allocated(error)) return
    call check_numbers(source, dataset, values, error)
  end subroutine read_entries

end module gravier_fclib_file
