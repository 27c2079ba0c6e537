!> The results of a run, results.h5: what was run, tables that hold for the whole run, and at chosen steps tables, figures and
!> histograms. Rows are in the order of their keys, and nothing in the file tells how many ranks wrote it or when. The tables are
!> lists of named fields: nothing here knows what their items are.
module gravier_results_file
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_input, status_failure
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_finite, only: is_finite
  use gravier_field_list, only: field_t, field_list_t
  use gravier_hdf5_file, only: h5_file_t
  use gravier_run_provenance, only: provenance_t, make_restarts, note_restart
  implicit none
  private
  public :: results_file_t, figures_t, histogram_rows_t, accuracy_t

  !> Counts of equal bins that begin at 0.
  type :: histogram_rows_t
    !> of the dataset
    character(len=:), allocatable :: name
    integer(i8), allocatable :: counts(:)
    real(dp) :: bin_width = 0.0_dp
  end type histogram_rows_t

  !> Figures of a step, the same on all ranks.
  type :: figures_t
    !> (n)
    character(len=:), allocatable :: name(:)
    real(dp), allocatable :: value(:)
    !> of no size where there are none
    type(histogram_rows_t), allocatable :: histogram(:)
  end type figures_t

  !> How exact the velocities of a step are: the estimated error, and what it was compared with [m/s].
  type :: accuracy_t
    real(dp) :: velocity_error = 0.0_dp, velocity_scale = 0.0_dp
  end type accuracy_t

  !> An open results file.
  type :: results_file_t
    !> after `reopen`: the file has the last step that was to stay
    logical :: has_last = .false.
    type(communicator_t), private :: comm
    type(h5_file_t), private :: file
    character(len=:), allocatable, private :: path
    !> of the step that is being written
    character(len=:), allocatable, private :: group
  contains
    procedure :: open => results_open
    procedure :: reopen => results_reopen
    procedure :: write_table => results_write_table
    procedure :: write_tables => results_write_tables
    !> a step: begin_step, then its tables, figures and regions in any order, then end_step
    procedure :: begin_step => results_begin_step
    procedure :: write_step_table => results_write_step_table
    procedure :: write_step_figures => results_write_step_figures
    procedure :: write_step_regions => results_write_step_regions
    procedure :: end_step => results_end_step
    procedure :: close => results_close
  end type results_file_t

  !> room for the headers of the groups and datasets of one step but those of its tables
  integer(i8), parameter :: bytes_of_headers = 65536
  !> the same for one table
  integer(i8), parameter :: bytes_of_table = 32768
  integer, parameter :: bytes_of_word = 8
  !> steps for which /steps has room in one block: up to there a program that dies leaves the file whole
  integer, parameter :: steps_in_block = 1000
  !> that an attribute takes with its name
  integer, parameter :: words_of_attribute = 32

contains

  !> Create the file with /run (what was run) and an empty /steps. It takes its name, and the place of an older file, when
  !> it is complete. Collective.
  subroutine results_open(self, comm, path, run, error)
    class(results_file_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    !> the same on all ranks
    type(provenance_t), intent(in) :: run
    type(error_t), allocatable, intent(inout) :: error
    character(len=1), parameter :: axes(3) = ["x", "y", "z"]
    integer :: d

    if (allocated(error)) return
    self%comm = comm
    self%path = path
    call self%file%create(comm, path, error)
    call self%file%reserve(bytes_of_headers + run%bytes(), error)
    call self%file%make_group("/run", error)
    call run%write(self%file, "/run", error)
    call self%file%write_attribute("/run", "dimension", run%dimension, error)
    do d = 1, run%dimension
      if (.not. run%period(d) > 0.0_dp) cycle
      call self%file%write_attribute("/run", "period_"//axes(d), run%period(d), error)
      call self%file%write_attribute("/run", "origin_"//axes(d), run%origin(d), error)
    end do
    call make_restarts(self%file, error)
    call self%file%make_group("/steps", error, members=steps_in_block)
    call self%file%show(error)
  end subroutine results_open

  !> Go on with a file that a run left: steps above `last_step` are removed, and more can be written. What is run from the next step
  !> on is kept as /run/restarts/STEP; what was run from a step on that is removed goes with it. Failure, with what
  !> is there left alone: status_input for a file that is damaged or not the results of a run, status_failure for one that
  !> cannot be written to. Collective.
  subroutine results_reopen(self, comm, path, last_step, witness, error, run)
    class(results_file_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    integer, intent(in) :: last_step
    !> a dataset that every step has, by its path in the step
    character(len=*), intent(in) :: witness
    type(error_t), allocatable, intent(inout) :: error
    !> where a step follows
    type(provenance_t), intent(in), optional :: run
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
    call find_later_steps(self, last_step, witness, later, n_later, error)
    if (.not. allocated(error)) self%has_last = self%file%exists("/steps/"//to_text(last_step))
    call self%file%leave()
    if (allocated(error)) then
      error%status = status_input
      return
    end if
    call self%file%reopen(comm, path, error)
    call self%file%reserve(bytes_of_headers, error)
    do i = 1, n_later
      call self%file%remove_group("/steps/"//to_text(later(i)), error)
    end do
    call note_restart(self%file, last_step + 1, error, run)
    call self%file%flush(error)
  end subroutine results_reopen

  !> Steps above `last_step`, once all that are to stay were found to be what they should.
  subroutine find_later_steps(self, last_step, witness, later, n_later, error)
    type(results_file_t), intent(in) :: self
    integer, intent(in) :: last_step
    character(len=*), intent(in) :: witness
    !> (n_later at least)
    integer, allocatable, intent(out) :: later(:)
    integer, intent(out) :: n_later
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: name
    integer(i8) :: step, n_rows
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
        call self%file%row_count("/steps/"//name//"/"//witness, n_rows, error)
        if (allocated(error)) return
        if (step /= number) call raise(error, status_input, self%path//": /steps/"//name//": step "//to_text(step)//" inside")
      end if
      if (allocated(error)) return
    end do
  end subroutine find_later_steps

  !> Write a table that holds for the whole run, once, as /NAME. It is the same on all ranks. Failure: as of a step. Collective.
  subroutine results_write_table(self, table, error)
    class(results_file_t), intent(inout) :: self
    type(field_list_t), intent(in) :: table
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    call check_table(self, "/"//table%name, table, error)
    call self%comm%agree(error)
    call self%file%reserve(bytes_of_headers + bytes_of_word*int(table%n_items(), i8)*table%words(), error)
    call self%file%begin_group("/"//table%name, error)
    call write_fields(self, "/"//table%name, table, error)
    call finish(self, error)
  end subroutine results_write_table

  !> Write tables that hold for the whole run and belong together, once: the first as /NAME, the others in this group by their
  !> names. They are the same on all ranks. Failure: as of a step. Collective.
  subroutine results_write_tables(self, table, error)
    class(results_file_t), intent(inout) :: self
    type(field_list_t), intent(in) :: table(:)
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: group
    integer(i8) :: words
    integer :: k

    if (allocated(error)) return
    group = "/"//table(1)%name
    words = 0
    do k = 1, size(table)
      call check_table(self, group//"/"//table(k)%name, table(k), error)
      words = words + int(table(k)%n_items(), i8)*table(k)%words()
    end do
    call self%comm%agree(error)
    call self%file%reserve(bytes_of_headers + bytes_of_word*words, error)
    call self%file%begin_group(group, error)
    call write_fields(self, group, table(1), error)
    do k = 2, size(table)
      call self%file%make_group(group//"/"//table(k)%name, error)
      call write_fields(self, group//"/"//table(k)%name, table(k), error)
    end do
    call finish(self, error)
  end subroutine results_write_tables

  !> Begin /steps/<step>, which is in the file once end_step has ended. After a failure nothing of the step is there, and
  !> what was there stays readable. Failure of these procedures (status_failure): a number that is not finite, a disk that is full,
  !> a step written before. Collective.
  subroutine results_begin_step(self, step, time, error, accuracy)
    class(results_file_t), intent(inout) :: self
    integer, intent(in) :: step
    !> s
    real(dp), intent(in) :: time
    type(error_t), allocatable, intent(inout) :: error
    !> of a state that a solve has led to
    type(accuracy_t), intent(in), optional :: accuracy

    if (allocated(error)) return
    self%group = "/steps/"//to_text(step)
    if (.not. is_finite(time)) call raise_not_finite(self, self%group//", attribute time", "", error)
    if (present(accuracy)) then
      if (.not. (is_finite(accuracy%velocity_error) .and. is_finite(accuracy%velocity_scale))) &
        & call raise_not_finite(self, self%group//", attribute velocity_error or velocity_scale", "", error)
    end if
    call self%comm%agree(error)
    call self%file%reserve(bytes_of_headers, error)
    call self%file%begin_group(self%group, error)
    call self%file%write_attribute(self%group, "step", step, error)
    call self%file%write_attribute(self%group, "time", time, error)
    if (.not. present(accuracy)) return
    call self%file%write_attribute(self%group, "velocity_error", accuracy%velocity_error, error)
    call self%file%write_attribute(self%group, "velocity_scale", accuracy%velocity_scale, error)
  end subroutine results_begin_step

  !> Write a table of the step. Collective.
  subroutine results_write_step_table(self, table, error)
    class(results_file_t), intent(inout) :: self
    !> afterwards in the order of its keys, unless it is the same on all ranks
    type(field_list_t), intent(inout) :: table
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: n_items

    if (allocated(error)) return
    n_items = table%n_items()
    if (.not. table%everywhere) then
      n_items = self%comm%total(n_items)
      call table%order(self%comm)
    end if
    call check_table(self, self%group//"/"//table%name, table, error)
    call self%comm%agree(error)
    call self%file%reserve(bytes_of_table + bytes_of_word*n_items*table%words(), error)
    call self%file%make_group(self%group//"/"//table%name, error)
    call write_fields(self, self%group//"/"//table%name, table, error)
  end subroutine results_write_step_table

  !> Write tables that stand together in the group `regions` of the step. Collective.
  subroutine results_write_step_regions(self, region, error)
    class(results_file_t), intent(inout) :: self
    !> the same on all ranks
    type(field_list_t), intent(in) :: region(:)
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: group
    integer(i8) :: bytes
    integer :: k

    if (allocated(error)) return
    group = self%group//"/regions"
    bytes = 0
    do k = 1, size(region)
      call check_table(self, group//"/"//region(k)%name, region(k), error)
      bytes = bytes + bytes_of_table + bytes_of_word*int(region(k)%n_items(), i8)*region(k)%words()
    end do
    call self%comm%agree(error)
    call self%file%reserve(bytes, error)
    call self%file%make_group(group, error)
    do k = 1, size(region)
      call self%file%make_group(group//"/"//region(k)%name, error)
      call write_fields(self, group//"/"//region(k)%name, region(k), error)
    end do
  end subroutine results_write_step_regions

  !> Show the step that was begun; drop it after an error. Collective.
  subroutine results_end_step(self, error)
    class(results_file_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error

    call finish(self, error)
  end subroutine results_end_step

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
      call self%file%give_back()
    else
      call self%file%commit_group(error)
    end if
  end subroutine finish

  !> The datasets of a table, a field each, with their units. Of a table that is the same on all ranks rank 0 writes all rows.
  subroutine write_fields(self, group, table, error)
    type(results_file_t), intent(inout) :: self
    character(len=*), intent(in) :: group
    type(field_list_t), intent(in) :: table
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), allocatable :: key(:)
    integer :: k, n

    n = table%n_items()
    if (table%everywhere .and. self%comm%rank > 0) n = 0
    do k = 1, size(table%key_name)
      key = table%key(k, 1:n)
      call self%file%write_rows(group//"/"//trim(table%key_name(k)), key, error)
    end do
    do k = 1, table%n_fields
      associate (field => table%field(k))
        call write_field(self%file, group//"/"//field%name, field, n, error)
        if (field%unit /= "") call self%file%write_attribute(group//"/"//field%name, "unit", field%unit, error)
      end associate
    end do
  end subroutine write_fields

  !> The first `n` items of a field as a dataset.
  subroutine write_field(file, path, field, n, error)
    type(h5_file_t), intent(inout) :: file
    character(len=*), intent(in) :: path
    type(field_t), intent(in) :: field
    integer, intent(in) :: n
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(field%text)) then
      call file%write_rows(path, field%text(1:n), error)
    else if (allocated(field%value)) then
      if (field%scalar) then
        call write_reals(file, path, n, field%value, error)
      else
        call file%write_rows(path, field%value(:, 1:n), error)
      end if
    else if (field%scalar) then
      call write_integers(file, path, n, field%whole, error)
    else
      call file%write_rows(path, field%whole(:, 1:n), error)
    end if
  end subroutine write_field

  !> One real an item.
  subroutine write_reals(file, path, n, values, error)
    type(h5_file_t), intent(inout) :: file
    character(len=*), intent(in) :: path
    integer, intent(in) :: n
    real(dp), intent(in) :: values(n)
    type(error_t), allocatable, intent(inout) :: error
    call file%write_rows(path, values, error)
  end subroutine write_reals

  !> One integer an item.
  subroutine write_integers(file, path, n, values, error)
    type(h5_file_t), intent(inout) :: file
    character(len=*), intent(in) :: path
    integer, intent(in) :: n
    integer(i8), intent(in) :: values(n)
    type(error_t), allocatable, intent(inout) :: error
    call file%write_rows(path, values, error)
  end subroutine write_integers

  !> Write figures of the step as attributes of its group `diagnostics`, and the histograms there. Collective.
  subroutine results_write_step_figures(self, figures, error)
    class(results_file_t), intent(inout) :: self
    !> the same on all ranks
    type(figures_t), intent(in) :: figures
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: group
    integer :: k, n

    if (allocated(error)) return
    group = self%group//"/diagnostics"
    call self%file%reserve(bytes_of_table + bytes_of_word*int(words_of(figures), i8), error)
    call self%file%make_group(group, error)
    do k = 1, size(figures%value)
      call self%file%write_attribute(group, trim(figures%name(k)), figures%value(k), error)
    end do
    do k = 1, size(figures%histogram)
      associate (histogram => figures%histogram(k))
        n = merge(size(histogram%counts), 0, self%comm%rank == 0)
        call self%file%write_rows(group//"/"//histogram%name, histogram%counts(1:n), error)
        call self%file%write_attribute(group//"/"//histogram%name, "bin_width", histogram%bin_width, error)
      end associate
    end do
  end subroutine results_write_step_figures

  !> Words that figures take.
  pure integer function words_of(figures) result(words)
    type(figures_t), intent(in) :: figures
    integer :: k

    words = words_of_attribute*size(figures%value)
    do k = 1, size(figures%histogram)
      words = words + size(figures%histogram(k)%counts)
    end do
  end function words_of

  !> Refuse NaN and infinity in the fields of a table, in their order; the error names the file, the dataset and the first key of
  !> the row.
  subroutine check_table(self, group, table, error)
    type(results_file_t), intent(in) :: self
    character(len=*), intent(in) :: group
    type(field_list_t), intent(in) :: table
    type(error_t), allocatable, intent(inout) :: error
    integer :: k, i

    do k = 1, table%n_fields
      associate (field => table%field(k))
        if (.not. allocated(field%value)) cycle
        do i = 1, table%n_items()
          if (allocated(error)) return
          if (.not. all(is_finite(field%value(:, i)))) call raise_not_finite(self, group//"/"//field%name, &
            & ", row of id "//to_text(table%key(1, i)), error)
        end do
      end associate
    end do
  end subroutine check_table

  subroutine raise_not_finite(self, place, row, error)
    type(results_file_t), intent(in) :: self
    character(len=*), intent(in) :: place, row
    type(error_t), allocatable, intent(inout) :: error
    call raise(error, status_failure, self%path//": "//place//row//": NaN or infinity, but finite numbers were expected; "// &
      & "nothing of it is written")
  end subroutine raise_not_finite

end module gravier_results_file
