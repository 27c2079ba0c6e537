!> The results of a run, results.h5: what was run, the boundaries, and at chosen steps the bodies, the boundaries and the
!> contacts.
!> Rows are in the order of the ids, and nothing in the file tells how many ranks wrote it or when.
module gravier_results_file
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_errors, only: error_t, raise, status_input, status_failure
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_finite, only: is_finite
  use gravier_ordered_rows, only: order_rows, pack_reals, unpack_reals
  use gravier_hdf5_file, only: h5_file_t
  implicit none
  private
  public :: results_file_t, body_rows_t, contact_rows_t, boundary_rows_t, figures_t, accuracy_t

  !> The bodies of this rank; SI units. Every array but `image` is allocated, without rows where the rank has none.
  type :: body_rows_t
    !> (n): global and stable, >= 1
    integer(i8), allocatable :: id(:)
    !> (dimension, n)
    real(dp), allocatable :: position(:, :)
    !> 2D (3, n): vx, vy, omega; 3D (6, n): vx, vy, vz, wx, wy, wz
    real(dp), allocatable :: velocity(:, :)
    !> (n)
    real(dp), allocatable :: radius(:)
    !> (dimension, n): how many periods the centre has gone along each axis; allocated on all ranks or on none
    integer, allocatable :: image(:, :)
  end type body_rows_t

  !> All boundaries, the same on all ranks.
  type :: boundary_rows_t
    !> (n)
    integer(i8), allocatable :: id(:)
    !> (dimension, n): its point, and for a plane the unit normal towards the free side (not allocated: not written)
    real(dp), allocatable :: position(:, :), normal(:, :)
    !> 2D (3, n), 3D (6, n), as those of bodies
    real(dp), allocatable :: velocity(:, :)
    !> (dimension, n), N: what the bodies exert on it
    real(dp), allocatable :: force(:, :)
  end type boundary_rows_t

  !> The contacts of this rank, each contact on one rank only.
  type :: contact_rows_t
    !> (n): ids of the body that touches and of the body or boundary that is touched
    integer(i8), allocatable :: candidate(:), antagonist(:)
    !> (dimension, n): unit vectors from the antagonist to the candidate
    real(dp), allocatable :: normal(:, :)
    !> (n)
    real(dp), allocatable :: gap(:)
    !> (dimension, n): n, t[, s]
    real(dp), allocatable :: impulse(:, :)
    !> moments on the candidate [N m s]: 2D (1, n), 3D (3, n): about n, t, s; allocated on all ranks or on none
    real(dp), allocatable :: moment(:, :)
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

  !> How exact the velocities of a step are: the estimated error, and what it was compared with [m/s].
  type :: accuracy_t
    real(dp) :: velocity_error = 0.0_dp, velocity_scale = 0.0_dp
  end type accuracy_t

  !> An open results file.
  type :: results_file_t
    private
    type(communicator_t) :: comm
    type(h5_file_t) :: file
    character(len=:), allocatable :: path
    integer :: dimension = 3
  contains
    procedure :: open => results_open
    procedure :: reopen => results_reopen
    procedure :: write_boundaries => results_write_boundaries
    procedure :: write_step => results_write_step
    procedure :: close => results_close
  end type results_file_t

  !> room for the headers of the groups and datasets of one step
  integer(i8), parameter :: bytes_of_headers = 65536
  integer, parameter :: bytes_of_word = 8
  !> steps for which /steps has room in one block: up to there a program that dies leaves the file whole
  integer, parameter :: steps_in_block = 1000
  !> that an attribute takes with its name
  integer, parameter :: words_of_attribute = 32

contains

  !> Create the file with /run (what was run) and an empty /steps. It takes its name, and the place of an older file, when
  !> it is complete. Collective.
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
    call self%file%make_group("/steps", error, members=steps_in_block)
    call self%file%show(error)
  end subroutine results_open

  !> Go on with a file that a run left: steps above `last_step` are removed, and more can be written. Failure, with what
  !> is there left alone: status_input for a file that is damaged or not the results of a run, status_failure for one that
  !> cannot be written to. Collective.
  subroutine results_reopen(self, comm, path, last_step, error)
    class(results_file_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    integer, intent(in) :: last_step
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: dimension
    integer, allocatable :: later(:)
    integer :: i, n_later

    if (allocated(error)) return
    self%comm = comm
    self%path = path
    ! for reading first: in a file open for writing HDF5 makes room for all rows that a damaged dataset says it has
    call self%file%open(comm, path, error)
    if (allocated(error)) return
    call self%file%read_attribute("/run", "dimension", dimension, error)
    call find_later_steps(self, last_step, later, n_later, error)
    call self%file%leave()
    if (allocated(error)) then
      error%status = status_input
      return
    end if
    call self%file%reopen(comm, path, error)
    self%dimension = narrow(dimension)
    call self%file%reserve(bytes_of_headers, error)
    do i = 1, n_later
      call self%file%remove_group("/steps/"//to_text(later(i)), error)
    end do
    call self%file%flush(error)
  end subroutine results_reopen

  !> Steps above `last_step`, once all that are to stay were found to be what they should.
  subroutine find_later_steps(self, last_step, later, n_later, error)
    type(results_file_t), intent(in) :: self
    integer, intent(in) :: last_step
    !> (n_later at least)
    integer, allocatable, intent(out) :: later(:)
    integer, intent(out) :: n_later
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: name
    integer(i8) :: step, n_bodies
    integer :: i, number, members, stat

    n_later = 0
    if (allocated(error)) return
    if (.not. self%file%exists("/steps")) then
      call raise(error, status_input, self%path//": /steps: missing, but the results of a run were expected")
      return
    end if
    members = self%file%member_count("/steps")
    if (members < 0) then
      call raise(error, status_input, self%path//": /steps: damaged or no group, but the results of a run were expected")
      return
    end if
    allocate (later(members))
    do i = 1, size(later)
      name = self%file%member("/steps", i)
      stat = 1
      if (len(name) > 0 .and. len(name) < 11 .and. verify(name, "0123456789") == 0) read (name, *, iostat=stat) number
      if (stat /= 0) then
        call raise(error, status_input, self%path//': /steps: a member "'//name//'", but numbers of steps were expected')
      else if (number > last_step) then
        n_later = n_later + 1
        later(n_later) = number
      else
        call self%file%read_attribute("/steps/"//name, "step", step, error)
        call self%file%row_count("/steps/"//name//"/bodies/radius", n_bodies, error)
        if (allocated(error)) return
        if (step /= number) call raise(error, status_input, self%path//": /steps/"//name//": step "//to_text(step)//" inside")
      end if
      if (allocated(error)) return
    end do
  end subroutine find_later_steps

  !> Write /boundaries, once. Collective.
  subroutine results_write_boundaries(self, id, name, shape, normal, error)
    class(results_file_t), intent(inout) :: self
    !> (boundaries), the same on all ranks
    integer(i8), intent(in), contiguous :: id(:)
    !> (boundaries): as in the input
    character(len=*), intent(in), contiguous :: name(:), shape(:)
    !> (dimension, boundaries): unit vectors towards the free side at the start, zero where a shape has none
    real(dp), intent(in), contiguous :: normal(:, :)
    type(error_t), allocatable, intent(inout) :: error
    integer :: n

    if (allocated(error)) return
    call check_finite(self, "/boundaries/normal", self%dimension, normal, id, error)
    call self%comm%agree(error)
    n = merge(size(id), 0, self%comm%rank == 0)
    call self%file%reserve(bytes_of_headers + size(id, kind=i8)*(bytes_of_word*(1 + self%dimension) + len(name) + len(shape)), &
      & error)
    call self%file%begin_group("/boundaries", error)
    call self%file%write_rows("/boundaries/id", id(1:n), error)
    call self%file%write_rows("/boundaries/name", name(1:n), error)
    call self%file%write_rows("/boundaries/shape", shape(1:n), error)
    call self%file%write_rows("/boundaries/normal", normal(:, 1:n), error)
    call finish(self, error)
  end subroutine results_write_boundaries

  !> Write /steps/<step>. Nothing of the step is in the file when this fails, and what was there stays readable.
  !> Failure (status_failure): a number that is not finite, a disk that is full, a step written before. Collective.
  subroutine results_write_step(self, step, time, bodies, error, contacts, boundaries, figures, accuracy)
    class(results_file_t), intent(inout) :: self
    integer, intent(in) :: step
    !> s
    real(dp), intent(in) :: time
    type(body_rows_t), intent(in) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    !> present on all ranks or on none
    type(contact_rows_t), intent(in), optional :: contacts
    type(boundary_rows_t), intent(in), optional :: boundaries
    type(figures_t), intent(in), optional :: figures
    !> of a state that a solve has led to
    type(accuracy_t), intent(in), optional :: accuracy
    type(body_rows_t) :: sorted_bodies
    type(contact_rows_t) :: sorted_contacts
    character(len=:), allocatable :: group
    integer(i8) :: words

    if (allocated(error)) return
    group = "/steps/"//to_text(step)
    if (.not. is_finite(time)) call raise_not_finite(self, group//", attribute time", "", error)
    if (present(accuracy)) then
      if (.not. (is_finite(accuracy%velocity_error) .and. is_finite(accuracy%velocity_scale))) &
        & call raise_not_finite(self, group//", attribute velocity_error or velocity_scale", "", error)
    end if
    call sort_bodies(self, bodies, sorted_bodies)
    call check_bodies(self, group//"/bodies", sorted_bodies, error)
    words = self%comm%total(size(bodies%id, kind=i8))*(2 + 2*size(bodies%position, 1) + size(bodies%velocity, 1))
    if (present(contacts)) then
      call sort_contacts(self, contacts, sorted_contacts)
      call check_contacts(self, group//"/contacts", sorted_contacts, error)
      words = words + self%comm%total(size(contacts%gap, kind=i8))*(3 + 2*self%dimension + moment_entries(contacts))
    end if
    if (present(boundaries)) then
      call check_boundaries(self, group//"/boundaries", boundaries, error)
      words = words + size(boundaries%id)*6*self%dimension
    end if
    if (present(figures)) words = words + size(figures%histogram) + words_of_attribute*size(figures%value)
    call self%comm%agree(error)

    call self%file%reserve(bytes_of_headers + bytes_of_word*words, error)
    call self%file%begin_group(group, error)
    call self%file%write_attribute(group, "step", step, error)
    call self%file%write_attribute(group, "time", time, error)
    if (present(accuracy)) then
      call self%file%write_attribute(group, "velocity_error", accuracy%velocity_error, error)
      call self%file%write_attribute(group, "velocity_scale", accuracy%velocity_scale, error)
    end if
    call write_bodies(self%file, group//"/bodies", sorted_bodies, error)
    if (present(boundaries)) call write_boundary_rows(self, group//"/boundaries", boundaries, error)
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
    integer(i8), allocatable :: image(:, :)

    call file%make_group(group, error)
    call file%write_rows(group//"/id", bodies%id, error)
    call file%write_rows(group//"/position", bodies%position, error)
    call file%write_attribute(group//"/position", "unit", "m", error)
    call file%write_rows(group//"/velocity", bodies%velocity, error)
    call file%write_attribute(group//"/velocity", "unit", "m/s, rad/s", error)
    call file%write_rows(group//"/radius", bodies%radius, error)
    call file%write_attribute(group//"/radius", "unit", "m", error)
    if (allocated(bodies%image)) then
      image = bodies%image
      call file%write_rows(group//"/image", image, error)
    end if
  end subroutine write_bodies

  !> Rank 0 writes for all.
  subroutine write_boundary_rows(self, group, boundaries, error)
    type(results_file_t), intent(inout) :: self
    character(len=*), intent(in) :: group
    type(boundary_rows_t), intent(in) :: boundaries
    type(error_t), allocatable, intent(inout) :: error
    integer :: n

    n = merge(size(boundaries%id), 0, self%comm%rank == 0)
    call self%file%make_group(group, error)
    call self%file%write_rows(group//"/id", boundaries%id(1:n), error)
    call self%file%write_rows(group//"/position", boundaries%position(:, 1:n), error)
    call self%file%write_attribute(group//"/position", "unit", "m", error)
    if (allocated(boundaries%normal)) call self%file%write_rows(group//"/normal", boundaries%normal(:, 1:n), error)
    call self%file%write_rows(group//"/velocity", boundaries%velocity(:, 1:n), error)
    call self%file%write_attribute(group//"/velocity", "unit", "m/s, rad/s", error)
    call self%file%write_rows(group//"/force", boundaries%force(:, 1:n), error)
    call self%file%write_attribute(group//"/force", "unit", "N", error)
  end subroutine write_boundary_rows

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
    if (.not. allocated(contacts%moment)) return
    call file%write_rows(group//"/moment", contacts%moment, error)
    call file%write_attribute(group//"/moment", "unit", "N m s", error)
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
    integer :: nd, nv, ni

    nd = size(bodies%position, 1)
    nv = size(bodies%velocity, 1)
    ni = 0
    if (allocated(bodies%image)) ni = nd
    allocate (records(2 + nd + nv + ni, size(bodies%id)))
    records(1, :) = bodies%id
    call pack_reals(nd, bodies%position, 2, records)
    call pack_reals(nv, bodies%velocity, 2 + nd, records)
    call pack_reals(1, bodies%radius, 2 + nd + nv, records)
    if (ni > 0) records(3 + nd + nv:, :) = bodies%image
    call order_rows(self%comm, 1, records, ordered)
    sorted%id = ordered(1, :)
    call unpack_reals(ordered, 2, nd, sorted%position)
    call unpack_reals(ordered, 2 + nd, nv, sorted%velocity)
    call unpack_reals(ordered, 2 + nd + nv, 1, column)
    sorted%radius = column(1, :)
    if (ni > 0) sorted%image = narrow(ordered(3 + nd + nv:, :))
  end subroutine sort_bodies

  !> Components of a moment, 0 where there are none.
  pure integer function moment_entries(contacts) result(n)
    type(contact_rows_t), intent(in) :: contacts

    n = 0
    if (allocated(contacts%moment)) n = size(contacts%moment, 1)
  end function moment_entries

  !> The contacts of all ranks in the order of candidate, then antagonist, cut into nearly equal blocks.
  subroutine sort_contacts(self, contacts, sorted)
    type(results_file_t), intent(in) :: self
    type(contact_rows_t), intent(in) :: contacts
    type(contact_rows_t), intent(out) :: sorted
    integer(i8), allocatable :: records(:, :), ordered(:, :)
    real(dp), allocatable :: column(:, :)
    integer :: nd, nm

    nd = self%dimension
    nm = moment_entries(contacts)
    allocate (records(3 + 2*nd + nm, size(contacts%candidate)))
    records(1, :) = contacts%candidate
    records(2, :) = contacts%antagonist
    call pack_reals(nd, contacts%normal, 3, records)
    call pack_reals(nd, contacts%impulse, 3 + nd, records)
    call pack_reals(1, contacts%gap, 3 + 2*nd, records)
    if (nm > 0) call pack_reals(nm, contacts%moment, 4 + 2*nd, records)
    call order_rows(self%comm, 2, records, ordered)
    sorted%candidate = ordered(1, :)
    sorted%antagonist = ordered(2, :)
    call unpack_reals(ordered, 3, nd, sorted%normal)
    call unpack_reals(ordered, 3 + nd, nd, sorted%impulse)
    call unpack_reals(ordered, 3 + 2*nd, 1, column)
    sorted%gap = column(1, :)
    if (nm > 0) call unpack_reals(ordered, 4 + 2*nd, nm, sorted%moment)
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

  subroutine check_boundaries(self, group, boundaries, error)
    type(results_file_t), intent(in) :: self
    character(len=*), intent(in) :: group
    type(boundary_rows_t), intent(in) :: boundaries
    type(error_t), allocatable, intent(inout) :: error

    call check_finite(self, group//"/position", self%dimension, boundaries%position, boundaries%id, error)
    if (allocated(boundaries%normal)) then
      call check_finite(self, group//"/normal", self%dimension, boundaries%normal, boundaries%id, error)
    end if
    call check_finite(self, group//"/velocity", size(boundaries%velocity, 1), boundaries%velocity, boundaries%id, error)
    call check_finite(self, group//"/force", self%dimension, boundaries%force, boundaries%id, error)
  end subroutine check_boundaries

  subroutine check_contacts(self, group, contacts, error)
    type(results_file_t), intent(in) :: self
    character(len=*), intent(in) :: group
    type(contact_rows_t), intent(in) :: contacts
    type(error_t), allocatable, intent(inout) :: error

    call check_finite(self, group//"/normal", self%dimension, contacts%normal, contacts%candidate, error)
    call check_finite(self, group//"/impulse", self%dimension, contacts%impulse, contacts%candidate, error)
    if (allocated(contacts%moment)) call check_finite(self, group//"/moment", size(contacts%moment, 1), contacts%moment, &
      & contacts%candidate, error)
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
