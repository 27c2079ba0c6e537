!> The results of a run, results.h5: what was run, the walls, and at chosen steps the bodies and the contacts.
!> Rows are in the order of the ids, and nothing in the file tells how many ranks wrote it or when.
module gravier_results_file
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_failure
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_finite, only: is_finite
  use gravier_ordered_rows, only: order_rows, pack_reals, unpack_reals
  use gravier_hdf5_file, only: h5_file_t
  implicit none
  private
  public :: results_file_t, body_rows_t, contact_rows_t, figures_t

  !> The bodies of this rank; SI units. Every array is allocated, without rows where the rank has none.
  type :: body_rows_t
    !> (n): global and stable, >= 1
    integer(i8), allocatable :: id(:)
    !> (dimension, n)
    real(dp), allocatable :: position(:, :)
    !> 2D (3, n): vx, vy, omega; 3D (6, n): vx, vy, vz, wx, wy, wz
    real(dp), allocatable :: velocity(:, :)
    !> (n)
    real(dp), allocatable :: radius(:)
  end type body_rows_t

  !> The contacts of this rank, each contact on one rank only.
  type :: contact_rows_t
    !> (n): ids of the body that touches and of the body or wall that is touched
    integer(i8), allocatable :: candidate(:), antagonist(:)
    !> (dimension, n): unit vectors from the antagonist to the candidate
    real(dp), allocatable :: normal(:, :)
    !> (n)
    real(dp), allocatable :: gap(:)
    !> (dimension, n): n, t[, s]
    real(dp), allocatable :: impulse(:, :)
  end type contact_rows_t

  !> Figures of a step, the same on all ranks.
  type :: figures_t
    !> (n)
    character(len=:), allocatable :: name(:)
    real(dp), allocatable :: value(:)
    !> counts of a histogram, of no size where there is none
    integer(i8), allocatable :: histogram(:)
    real(dp) :: bin_width = 0.0_dp
  end type figures_t

  !> An open results file.
  type :: results_file_t
    private
    type(communicator_t) :: comm
    type(h5_file_t) :: file
    character(len=:), allocatable :: path
    integer :: dimension = 3
  contains
    procedure :: open => results_open
    procedure :: write_walls => results_write_walls
    procedure :: write_step => results_write_step
    procedure :: close => results_close
  end type results_file_t

  !> room for the headers of the groups and datasets of one step
  integer(i8), parameter :: bytes_of_headers = 65536
  integer, parameter :: bytes_of_word = 8
  !> that an attribute takes with its name
  integer, parameter :: words_of_attribute = 32

contains

  !> Create the file with /run (what was run) and an empty /steps. Collective.
  subroutine results_open(self, comm, path, version, command, input_text, dimension, error)
    class(results_file_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    !> of the program
    character(len=*), intent(in) :: version
    !> the command line, without the number of ranks
    character(len=*), intent(in) :: command
    !> the input file, whole
    character(len=*), intent(in) :: input_text
    !> 2 or 3
    integer, intent(in) :: dimension
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    self%comm = comm
    self%path = path
    self%dimension = dimension
    call self%file%create(comm, path, error)
    call self%file%reserve(bytes_of_headers + len(version) + len(command) + len(input_text), error)
    call self%file%make_group("/run", error)
    call self%file%write_attribute("/run", "version", version, error)
    call self%file%write_attribute("/run", "command", command, error)
    call self%file%write_attribute("/run", "input_text", input_text, error)
    call self%file%write_attribute("/run", "dimension", dimension, error)
    call self%file%make_group("/steps", error)
    call self%file%flush(error)
  end subroutine results_open

  !> Write /walls, once. Collective.
  subroutine results_write_walls(self, id, point, normal, error)
    class(results_file_t), intent(inout) :: self
    !> (walls), the same on all ranks
    integer(i8), intent(in), contiguous :: id(:)
    !> (dimension, walls): a point of each plane, and unit vectors towards the free side
    real(dp), intent(in), contiguous :: point(:, :), normal(:, :)
    type(error_t), allocatable, intent(inout) :: error
    integer :: n

    if (allocated(error)) return
    call check_finite(self, "/walls/point", self%dimension, point, id, error)
    call check_finite(self, "/walls/normal", self%dimension, normal, id, error)
    call self%comm%agree(error)
    n = merge(size(id), 0, self%comm%rank == 0)
    call self%file%reserve(bytes_of_headers + bytes_of_word*size(id, kind=i8)*(1 + 2*self%dimension), error)
    call self%file%begin_group("/walls", error)
    call self%file%write_rows("/walls/id", id(1:n), error)
    call self%file%write_rows("/walls/point", point(:, 1:n), error)
    call self%file%write_attribute("/walls/point", "unit", "m", error)
    call self%file%write_rows("/walls/normal", normal(:, 1:n), error)
    call finish(self, error)
  end subroutine results_write_walls

  !> Write /steps/<step>. Nothing of the step is in the file when this fails, and what was there stays readable.
  !> Failure (status_failure): a number that is not finite, a disk that is full, a step written before. Collective.
  subroutine results_write_step(self, step, time, bodies, error, contacts, figures)
    class(results_file_t), intent(inout) :: self
    integer, intent(in) :: step
    !> s
    real(dp), intent(in) :: time
    type(body_rows_t), intent(in) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    !> present on all ranks or on none
    type(contact_rows_t), intent(in), optional :: contacts
    type(figures_t), intent(in), optional :: figures
    type(body_rows_t) :: sorted_bodies
    type(contact_rows_t) :: sorted_contacts
    character(len=:), allocatable :: group
    integer(i8) :: words

    if (allocated(error)) return
    group = "/steps/"//to_text(step)
    if (.not. is_finite(time)) call raise_not_finite(self, group//", attribute time", "", error)
    call sort_bodies(self, bodies, sorted_bodies)
    call check_bodies(self, group//"/bodies", sorted_bodies, error)
    words = self%comm%total(size(bodies%id, kind=i8))*(2 + size(bodies%position, 1) + size(bodies%velocity, 1))
    if (present(contacts)) then
      call sort_contacts(self, contacts, sorted_contacts)
      call check_contacts(self, group//"/contacts", sorted_contacts, error)
      words = words + self%comm%total(size(contacts%gap, kind=i8))*(3 + 2*self%dimension)
    end if
    if (present(figures)) words = words + size(figures%histogram) + words_of_attribute*size(figures%value)
    call self%comm%agree(error)

    call self%file%reserve(bytes_of_headers + bytes_of_word*words, error)
    call self%file%begin_group(group, error)
    call self%file%write_attribute(group, "step", step, error)
    call self%file%write_attribute(group, "time", time, error)
    call write_bodies(self%file, group//"/bodies", sorted_bodies, error)
    if (present(contacts)) call write_contacts(self%file, group//"/contacts", sorted_contacts, error)
    if (present(figures)) call write_figures(self, group//"/diagnostics", figures, error)
    call finish(self, error)
  end subroutine results_write_step

  !> Close; without effect on a file not open. Collective.
  subroutine results_close(self, error)
    class(results_file_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    call self%file%close(error)
  end subroutine results_close

  !> Show the group that was begun, or drop it after an error.
  subroutine finish(self, error)
    type(results_file_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) then
      call self%file%abandon_group()
    else
      call self%file%commit_group(error)
    end if
  end subroutine finish

  subroutine write_bodies(file, group, bodies, error)
    type(h5_file_t), intent(inout) :: file
    character(len=*), intent(in) :: group
    type(body_rows_t), intent(in) :: bodies
    type(error_t), allocatable, intent(inout) :: error

    call file%make_group(group, error)
    call file%write_rows(group//"/id", bodies%id, error)
    call file%write_rows(group//"/position", bodies%position, error)
    call file%write_attribute(group//"/position", "unit", "m", error)
    call file%write_rows(group//"/velocity", bodies%velocity, error)
    call file%write_attribute(group//"/velocity", "unit", "m/s, rad/s", error)
    call file%write_rows(group//"/radius", bodies%radius, error)
    call file%write_attribute(group//"/radius", "unit", "m", error)
  end subroutine write_bodies

  subroutine write_contacts(file, group, contacts, error)
    type(h5_file_t), intent(inout) :: file
    character(len=*), intent(in) :: group
    type(contact_rows_t), intent(in) :: contacts
    type(error_t), allocatable, intent(inout) :: error

    call file%make_group(group, error)
    call file%write_rows(group//"/candidate", contacts%candidate, error)
    call file%write_rows(group//"/antagonist", contacts%antagonist, error)
    call file%write_rows(group//"/normal", contacts%normal, error)
    call file%write_rows(group//"/gap", contacts%gap, error)
    call file%write_attribute(group//"/gap", "unit", "m", error)
    call file%write_rows(group//"/impulse", contacts%impulse, error)
    call file%write_attribute(group//"/impulse", "unit", "N s", error)
  end subroutine write_contacts

  !> Figures as attributes of a group, and the histogram.
  subroutine write_figures(self, group, figures, error)
    type(results_file_t), intent(inout) :: self
    character(len=*), intent(in) :: group
    type(figures_t), intent(in) :: figures
    type(error_t), allocatable, intent(inout) :: error
    integer :: k, n

    call self%file%make_group(group, error)
    do k = 1, size(figures%value)
      call self%file%write_attribute(group, trim(figures%name(k)), figures%value(k), error)
    end do
    if (size(figures%histogram) == 0) return
    n = merge(size(figures%histogram), 0, self%comm%rank == 0)
    call self%file%write_rows(group//"/force_histogram", figures%histogram(1:n), error)
    call self%file%write_attribute(group//"/force_histogram", "bin_width", figures%bin_width, error)
  end subroutine write_figures

  !> The bodies of all ranks in the order of the ids, cut into equal blocks.
  subroutine sort_bodies(self, bodies, sorted)
    type(results_file_t), intent(in) :: self
    type(body_rows_t), intent(in) :: bodies
    type(body_rows_t), intent(out) :: sorted
    integer(i8), allocatable :: records(:, :), ordered(:, :)
    real(dp), allocatable :: column(:, :)
    integer :: nd, nv

    nd = size(bodies%position, 1)
    nv = size(bodies%velocity, 1)
    allocate (records(2 + nd + nv, size(bodies%id)))
    records(1, :) = bodies%id
    call pack_reals(nd, bodies%position, 2, records)
    call pack_reals(nv, bodies%velocity, 2 + nd, records)
    call pack_reals(1, bodies%radius, 2 + nd + nv, records)
    call order_rows(self%comm, 1, records, ordered)
    sorted%id = ordered(1, :)
    call unpack_reals(ordered, 2, nd, sorted%position)
    call unpack_reals(ordered, 2 + nd, nv, sorted%velocity)
    call unpack_reals(ordered, 2 + nd + nv, 1, column)
    sorted%radius = column(1, :)
  end subroutine sort_bodies

  !> The contacts of all ranks in the order of candidate, then antagonist, cut into nearly equal blocks.
  subroutine sort_contacts(self, contacts, sorted)
    type(results_file_t), intent(in) :: self
    type(contact_rows_t), intent(in) :: contacts
    type(contact_rows_t), intent(out) :: sorted
    integer(i8), allocatable :: records(:, :), ordered(:, :)
    real(dp), allocatable :: column(:, :)
    integer :: nd

    nd = self%dimension
    allocate (records(3 + 2*nd, size(contacts%candidate)))
    records(1, :) = contacts%candidate
    records(2, :) = contacts%antagonist
    call pack_reals(nd, contacts%normal, 3, records)
    call pack_reals(nd, contacts%impulse, 3 + nd, records)
    call pack_reals(1, contacts%gap, 3 + 2*nd, records)
    call order_rows(self%comm, 2, records, ordered)
    sorted%candidate = ordered(1, :)
    sorted%antagonist = ordered(2, :)
    call unpack_reals(ordered, 3, nd, sorted%normal)
    call unpack_reals(ordered, 3 + nd, nd, sorted%impulse)
    call unpack_reals(ordered, 3 + 2*nd, 1, column)
    sorted%gap = column(1, :)
  end subroutine sort_contacts

  subroutine check_bodies(self, group, bodies, error)
    type(results_file_t), intent(in) :: self
    character(len=*), intent(in) :: group
    type(body_rows_t), intent(in) :: bodies
    type(error_t), allocatable, intent(inout) :: error

    call check_finite(self, group//"/position", self%dimension, bodies%position, bodies%id, error)
    call check_finite(self, group//"/velocity", size(bodies%velocity, 1), bodies%velocity, bodies%id, error)
    call check_finite(self, group//"/radius", 1, bodies%radius, bodies%id, error)
  end subroutine check_bodies

  subroutine check_contacts(self, group, contacts, error)
    type(results_file_t), intent(in) :: self
    character(len=*), intent(in) :: group
    type(contact_rows_t), intent(in) :: contacts
    type(error_t), allocatable, intent(inout) :: error

    call check_finite(self, group//"/normal", self%dimension, contacts%normal, contacts%candidate, error)
    call check_finite(self, group//"/impulse", self%dimension, contacts%impulse, contacts%candidate, error)
    call check_finite(self, group//"/gap", 1, contacts%gap, contacts%candidate, error)
  end subroutine check_contacts

  !> Refuse NaN and infinity; the error names the file, the dataset and the id of the row.
  subroutine check_finite(self, dataset, n_columns, values, id, error)
    type(results_file_t), intent(in) :: self
    character(len=*), intent(in) :: dataset
    integer, intent(in) :: n_columns
    !> (rows)
    integer(i8), intent(in), contiguous :: id(:)
    real(dp), intent(in) :: values(n_columns, size(id))
    type(error_t), allocatable, intent(inout) :: error
    integer :: i

    if (allocated(error)) return
    do i = 1, size(id)
      if (all(is_finite(values(:, i)))) cycle
      call raise_not_finite(self, dataset, ", row of id "//to_text(id(i)), error)
      return
    end do
  end subroutine check_finite

  subroutine raise_not_finite(self, place, row, error)
    type(results_file_t), intent(in) :: self
    character(len=*), intent(in) :: place, row
    type(error_t), allocatable, intent(inout) :: error
    call raise(error, status_failure, self%path//": "//place//row//": NaN or infinity, but finite numbers were expected; "// &
      & "nothing of it is written")
  end subroutine raise_not_finite

end module gravier_results_file
