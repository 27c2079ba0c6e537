!> Points, lines or polygons that change from step to step, in the format VTKHDF of VTK and ParaView (a temporal PolyData).
!> A step is written behind the others, all its tables first; then its time, and the number that says how many steps there are,
!> since readers go by one or the other. A file takes its name with its second step, or when it is closed: of a file with one step
!> VTK reads whatever there is. Whenever the program dies, a reader finds whole steps.
!> Rows are in the order of their keys: nothing tells how many ranks wrote the file.
module gravier_vtkhdf_file
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_errors, only: error_t, raise, status_input
  use gravier_room, only: room_for
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_file_system, only: remove_file
  use gravier_own_files, only: part_of
  use gravier_field_list, only: field_list_t
  use gravier_table_growth, only: growth, chunks_in_block
  use gravier_hdf5_file, only: h5_file_t, table_integer, table_single, table_double
  implicit none
  private
  public :: vtkhdf_file_t, points_name, corners_name

  !> Numbers of each point, line or polygon, as the file keeps them.
  type :: vtk_field_t
    character(len=24) :: name = ""
    !> numbers of it; 1 makes a scalar
    integer :: components = 1
    !> kept as integers
    logical :: whole = .false.
  end type vtk_field_t

  !> An open file.
  type :: vtkhdf_file_t
    !> after `reopen`: the file has the last step that was to stay
    logical :: has_last = .false.
    type(communicator_t), private :: comm
    type(h5_file_t), private :: file
    character(len=:), allocatable, private :: path
    type(vtk_field_t), allocatable, private :: field(:)
    !> place of its cells in the list of topologies, and points of a row, about
    integer, private :: kind = 1, n_points = 1
    !> rows by which the file grows, and what is written
    integer(i8), private :: chunk = 1, steps = 0, rows = 0, points = 0
    !> the file has its name
    logical, private :: shown = .false.
  contains
    procedure :: open => vtkhdf_open
    procedure :: reopen => vtkhdf_reopen
    procedure :: write_step => vtkhdf_write_step
    procedure :: close => vtkhdf_close
  end type vtkhdf_file_t

  !> Rows of a step on all ranks, and their points.
  type :: extent_t
    integer(i8) :: rows = 0, points = 0
  end type extent_t

  !> field of a table that says where its items are (3, 6 or more; items) [m]: a point, the two ends of a line, or the corners of a
  !> polygon; and the field that then follows, the numbers of these corners
  character(len=*), parameter :: points_name = "points", corners_name = "corners"
  character(len=*), parameter :: root = "/VTKHDF", steps_group = "/VTKHDF/Steps", step_table = "/step"
  !> kinds of cells of a PolyData, in the order of the columns of CellOffsets
  character(len=*), parameter :: topologies(4) = [character(len=8) :: "Vertices", "Lines", "Polygons", "Strips"]
  !> rows of a chunk of short tables, and of the others at least and at most (4 GiB bound a chunk)
  integer(i8), parameter :: short_chunk = 512, least_chunk = 2048, greatest_chunk = 67108864
  !> room for the headers of a step
  integer(i8), parameter :: bytes_of_headers = 65536
  !> topologies, and points of most polygons
  integer, parameter :: vertices = 1, polygons = 3, usual_corners = 4

contains

  !> Create the file, without steps, in place of an older one. Collective.
  subroutine vtkhdf_open(self, comm, path, table, expected, error)
    class(vtkhdf_file_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    !> its fields are those of all steps; the first one is that of the points
    type(field_list_t), intent(in) :: table
    !> rows of all steps together, about; the same on all ranks
    integer(i8), intent(in) :: expected
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    call set_up(self, comm, path, table)
    self%chunk = min(max(least_chunk, expected/chunks_in_block), greatest_chunk)
    call self%file%create(comm, path, error, chunks_in_block)
    call self%file%reserve(bytes_of_headers, error)
    call self%file%make_group(root, error)
    call self%file%write_attribute(root, "Version", [2_i8, 0_i8], error)
    call self%file%write_attribute(root, "Type", "PolyData", error)
    call make_tables(self, error, check=.false.)
    call self%file%flush(error)
    if (allocated(error)) then
      call self%file%discard()
    else if (comm%rank == 0) then
      ! the new file is shown once it has steps: until then none is there
      call remove_file(path)
    end if
  end subroutine vtkhdf_open

  !> Note what the file is made of.
  subroutine set_up(self, comm, path, table)
    type(vtkhdf_file_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    type(field_list_t), intent(in) :: table
    integer :: k, first

    self%comm = comm
    self%path = path
    if (has_corners(table)) then
      self%kind = polygons
      self%n_points = usual_corners
    else
      self%n_points = table%field(1)%components()/3
      self%kind = self%n_points
    end if
    first = first_field(table)
    if (allocated(self%field)) deallocate (self%field)
    allocate (self%field(table%n_fields - first + 1))
    do k = 1, size(self%field)
      associate (field => table%field(first + k - 1))
        self%field(k)%name = field%name
        self%field(k)%components = field%components()
        self%field(k)%whole = allocated(field%whole)
      end associate
    end do
    self%steps = 0
    self%rows = 0
    self%points = 0
    self%shown = .false.
  end subroutine set_up

  !> Whether the items of a table are polygons.
  pure logical function has_corners(table)
    type(field_list_t), intent(in) :: table

    has_corners = .false.
    if (table%n_fields > 1) has_corners = table%field(2)%name == corners_name
  end function has_corners

  !> Place of the first field that is not one of points.
  pure integer function first_field(table) result(first)
    type(field_list_t), intent(in) :: table
    first = merge(3, 2, has_corners(table))
  end function first_field

  !> Where the fields are.
  pure function data_group(self) result(group)
    type(vtkhdf_file_t), intent(in) :: self
    character(len=:), allocatable :: group
    group = "PointData"
    if (self%kind /= vertices) group = "CellData"
  end function data_group

  !> Make the tables of the file, or check those of a file to go on with.
  subroutine make_tables(self, error, check)
    type(vtkhdf_file_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    logical, intent(in) :: check
    integer :: k, np

    np = self%n_points
    call table(root//"/NumberOfPoints", 0, table_integer, short_chunk, self%steps)
    call table(root//"/Points", 3, table_single, np*self%chunk, self%points)
    do k = 1, size(topologies)
      associate (group => root//"/"//trim(topologies(k)), chunk => merge(self%chunk, short_chunk, k == self%kind), &
        & rows => merge(self%rows, 0_i8, k == self%kind), points => merge(self%points, 0_i8, k == self%kind))
        call table(group//"/NumberOfCells", 0, table_integer, short_chunk, self%steps)
        call table(group//"/NumberOfConnectivityIds", 0, table_integer, short_chunk, self%steps)
        call table(group//"/Connectivity", 0, table_integer, merge(np*chunk, chunk, k == self%kind), points)
        call table(group//"/Offsets", 0, table_integer, chunk, rows + self%steps)
      end associate
    end do
    call table(steps_group//"/Values", 0, table_double, short_chunk, self%steps)
    if (.not. check) call self%file%write_attribute(steps_group, "NSteps", 0_i8, error)
    call table(steps_group//"/PartOffsets", 0, table_integer, short_chunk, self%steps)
    call table(steps_group//"/NumberOfParts", 0, table_integer, short_chunk, self%steps)
    call table(steps_group//"/PointOffsets", 0, table_integer, short_chunk, self%steps)
    call table(steps_group//"/CellOffsets", size(topologies), table_integer, short_chunk, self%steps)
    call table(steps_group//"/ConnectivityIdOffsets", size(topologies), table_integer, short_chunk, self%steps)
    do k = 1, size(self%field)
      associate (field => self%field(k), name => data_group(self)//"/"//trim(self%field(k)%name))
        call table(root//"/"//name, merge(0, field%components, field%components == 1), &
          & merge(table_integer, table_single, field%whole), self%chunk, self%rows)
        call table(steps_group//"/"//data_group(self)//"Offsets/"//trim(field%name), 0, table_integer, short_chunk, &
          & self%steps)
      end associate
    end do
    ! for those who go on with the file: the numbers of the steps
    call table(step_table, 0, table_integer, short_chunk, self%steps)

  contains

    !> One table: its columns, what it holds, rows by which it grows, and rows that it has at least.
    subroutine table(path, n_columns, kind, rows_a_chunk, n_rows)
      character(len=*), intent(in) :: path
      integer, intent(in) :: n_columns, kind
      integer(i8), intent(in) :: rows_a_chunk, n_rows

      if (check) then
        call self%file%check_table(path, n_columns, kind, n_rows, error)
      else
        call self%file%make_table(path, n_columns, kind, rows_a_chunk, error)
      end if
    end subroutine table

  end subroutine make_tables

  !> Go on with a file that a run left, with its name or before it has one: steps above `last_step` are forgotten, and written over.
  !> Without such a file, create it. Failure (status_input): a file that is damaged or has not these fields. Collective.
  subroutine vtkhdf_reopen(self, comm, path, table, expected, last_step, error)
    class(vtkhdf_file_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    !> as for open
    type(field_list_t), intent(in) :: table
    integer(i8), intent(in) :: expected
    integer, intent(in) :: last_step
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), allocatable :: step(:)
    integer(i8) :: written
    logical :: named, begun
    integer :: k

    if (allocated(error)) return
    named = exists(comm, path)
    begun = exists(comm, part_of(path))
    if (.not. (named .or. begun)) then
      call self%open(comm, path, table, expected, error)
      return
    end if
    call set_up(self, comm, path, table)
    ! for reading first: in a file open for writing HDF5 makes room for all rows that a damaged table says it has
    if (named) then
      call self%file%open(comm, path, error)
    else
      call self%file%open(comm, part_of(path), error)
    end if
    call self%file%read_attribute(steps_group, "NSteps", written, error)
    do k = 1, size(self%field)
      if (allocated(error)) exit
      if (self%file%exists(root//"/"//data_group(self)//"/"//trim(self%field(k)%name))) cycle
      call raise(error, status_input, path//": no field "//trim(self%field(k)%name)//", but one was expected")
    end do
    if (.not. allocated(error)) call self%file%check_table(step_table, 0, table_integer, written, error)
    if (.not. allocated(error)) then
      allocate (step(room_for(written, storage_size(step)/8, path//": "//step_table, error)))
      call self%file%read_rows(step_table, 0_i8, step, error)
    end if
    if (.not. allocated(error)) self%steps = count(step <= last_step, kind=i8)
    if (.not. allocated(error)) self%has_last = any(step == last_step)
    call find_rows(self, written, error)
    call make_tables(self, error, check=.true.)
    call self%file%leave()
    if (allocated(error)) then
      error%status = status_input
      return
    end if
    call self%file%reopen(comm, path, error, aside=.not. named)
    if (named) call self%file%hide(error)
    call self%file%change_attribute(steps_group, "NSteps", self%steps, error)
    call self%file%flush(error)
    call cut_steps(self, error)
    call self%file%flush(error)
    if (self%steps > 1) call self%file%show(error)
    self%shown = self%steps > 1 .and. .not. allocated(error)
  end subroutine vtkhdf_reopen

  !> Whether there is a file, as rank 0 sees it. Collective.
  logical function exists(comm, path)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path

    exists = .false.
    if (comm%rank == 0) inquire (file=path, exist=exists)
    exists = comm%any_true(exists)
  end function exists

  !> Cut the tables that tell readers how many steps or parts there are.
  subroutine cut_steps(self, error)
    type(vtkhdf_file_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    integer :: k

    call self%file%cut_rows(steps_group//"/Values", self%steps, error)
    call self%file%cut_rows(root//"/NumberOfPoints", self%steps, error)
    do k = 1, size(topologies)
      call self%file%cut_rows(root//"/"//trim(topologies(k))//"/NumberOfCells", self%steps, error)
      call self%file%cut_rows(root//"/"//trim(topologies(k))//"/NumberOfConnectivityIds", self%steps, error)
    end do
  end subroutine cut_steps

  !> Rows of the steps that stay.
  subroutine find_rows(self, written, error)
    type(vtkhdf_file_t), intent(inout) :: self
    integer(i8), intent(in) :: written
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: last(1), cells(size(topologies), 1)

    self%rows = 0
    self%points = 0
    if (allocated(error) .or. self%steps == 0 .or. self%steps > written) return
    call self%file%read_rows(steps_group//"/PointOffsets", self%steps - 1, last, error)
    self%points = last(1)
    call self%file%read_rows(root//"/NumberOfPoints", self%steps - 1, last, error)
    self%points = self%points + last(1)
    call self%file%read_rows(steps_group//"/CellOffsets", self%steps - 1, cells, error)
    self%rows = cells(self%kind, 1)
    call self%file%read_rows(root//"/"//trim(topologies(self%kind))//"/NumberOfCells", self%steps - 1, last, error)
    self%rows = self%rows + last(1)
  end subroutine find_rows

  !> Write a step behind the others. The first one has rows: before it, a step without rows is left out (VTK's reader looks for the
  !> cells of a step that follows only empty ones in the wrong place). Collective; a failure leaves the steps before as they are.
  subroutine vtkhdf_write_step(self, step, time, table, error)
    class(vtkhdf_file_t), intent(inout) :: self
    integer, intent(in) :: step
    !> s
    real(dp), intent(in) :: time
    !> items of this rank, with the fields that the file was opened with; afterwards in their order
    type(field_list_t), intent(inout) :: table
    type(error_t), allocatable, intent(inout) :: error
    integer, allocatable :: corners(:)
    real(dp), allocatable :: part(:, :)
    real(dp) :: now(1, 1)
    type(extent_t) :: total
    integer :: k

    if (allocated(error)) return
    total%rows = self%comm%total(int(table%n_items(), i8))
    if (self%rows + total%rows == 0) return
    call table%order(self%comm)
    call split_points(self, table, corners, part)
    total%points = self%comm%total(size(part, 2, kind=i8))
    call self%file%reserve(bytes_of_headers + bytes_of_step(self, total), error)
    call self%file%put_rows(root//"/Points", self%points, part, error)
    do k = 1, size(self%field)
      associate (name => root//"/"//data_group(self)//"/"//trim(self%field(k)%name), &
        & field => table%field(first_field(table) + k - 1))
        if (self%field(k)%whole) then
          call self%file%put_rows(name, self%rows, field%whole, error)
        else
          call self%file%put_rows(name, self%rows, field%value, error)
        end if
      end associate
    end do
    call write_cells(self, corners, total, error)
    call write_offsets(self, step, total, error)
    call self%file%flush(error)
    now = time
    call self%file%put_rows(steps_group//"/Values", self%steps, now(:, 1:merge(1, 0, self%comm%rank == 0)), error)
    call self%file%flush(error)
    call self%file%change_attribute(steps_group, "NSteps", self%steps + 1, error)
    call self%file%flush(error)
    if (allocated(error)) return
    self%steps = self%steps + 1
    self%rows = self%rows + total%rows
    self%points = self%points + total%points
    if (self%shown .or. self%steps < 2) return
    call self%file%show(error)
    self%shown = .true.
  end subroutine vtkhdf_write_step

  !> How many points each item of a table has, and all of them one after the other.
  pure subroutine split_points(self, table, corners, part)
    type(vtkhdf_file_t), intent(in) :: self
    type(field_list_t), intent(in) :: table
    !> (items)
    integer, allocatable, intent(out) :: corners(:)
    !> (3, points)
    real(dp), allocatable, intent(out) :: part(:, :)
    integer :: i, k, n

    allocate (corners(table%n_items()), source=self%n_points)
    if (self%kind == polygons) corners(:) = narrow(table%field(2)%whole(1, :))
    allocate (part(3, sum(corners)))
    n = 0
    do i = 1, size(corners)
      do k = 1, corners(i)
        n = n + 1
        part(:, n) = table%field(1)%value(3*k - 2:3*k, i)
      end do
    end do
  end subroutine split_points

  !> Bytes by which the tables grow with a step of so many rows and points: whole chunks, and the blocks that know them.
  pure integer(i8) function bytes_of_step(self, total) result(bytes)
    type(vtkhdf_file_t), intent(in) :: self
    type(extent_t), intent(in) :: total
    integer :: k

    ! with one row a step: points, cells, connectivities and offsets of the topologies but one, six tables of the steps, step
    bytes = (3*size(topologies) + 5 + size(self%field))*growth(self%steps, 1_i8, short_chunk, 8) + &
      & 2*growth(self%steps, 1_i8, short_chunk, 8*size(topologies))
    associate (np => self%n_points)
      bytes = bytes + growth(self%points, total%points, np*self%chunk, 12) + growth(self%points, total%points, np*self%chunk, 8) + &
        & growth(self%rows + self%steps, total%rows + 1, self%chunk, 8)
    end associate
    do k = 1, size(self%field)
      bytes = bytes + growth(self%rows, total%rows, self%chunk, self%field(k)%components*merge(8, 4, self%field(k)%whole))
    end do
  end function bytes_of_step

  !> One cell a row, of its points; no cell of the other kinds.
  subroutine write_cells(self, corners, total, error)
    type(vtkhdf_file_t), intent(inout) :: self
    !> points of the rows of this rank
    integer, intent(in) :: corners(:)
    !> of all ranks
    type(extent_t), intent(in) :: total
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), allocatable :: connectivity(:, :), offsets(:, :)
    integer(i8) :: before
    integer :: i, k, first

    before = self%comm%offset(int(sum(corners), i8))
    ! rank 0 writes the 0 that offsets begin with
    first = merge(0, 1, self%comm%rank == 0)
    allocate (connectivity(1, sum(corners)), offsets(1, first:size(corners)))
    do i = 1, size(connectivity, 2)
      connectivity(1, i) = before + i - 1
    end do
    if (first == 0) offsets(1, 0) = 0
    do i = 1, size(corners)
      before = before + corners(i)
      offsets(1, i) = before
    end do
    do k = 1, size(topologies)
      associate (group => root//"/"//trim(topologies(k)))
        if (k == self%kind) then
          call self%file%put_rows(group//"/Connectivity", self%points, connectivity, error)
          call self%file%put_rows(group//"/Offsets", self%rows + self%steps, offsets, error)
        else
          call put_number(self, group//"/Offsets", 0_i8, error)
        end if
        call put_number(self, group//"/NumberOfCells", merge(total%rows, 0_i8, k == self%kind), error)
        call put_number(self, group//"/NumberOfConnectivityIds", merge(total%points, 0_i8, k == self%kind), error)
      end associate
    end do
  end subroutine write_cells

  !> Where the rows of the step begin.
  subroutine write_offsets(self, step, total, error)
    type(vtkhdf_file_t), intent(inout) :: self
    integer, intent(in) :: step
    type(extent_t), intent(in) :: total
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: cells(size(topologies), 1), connectivity(size(topologies), 1)
    integer :: k, n

    n = merge(1, 0, self%comm%rank == 0)
    cells = 0
    cells(self%kind, 1) = self%rows
    connectivity = 0
    connectivity(self%kind, 1) = self%points
    call put_number(self, root//"/NumberOfPoints", total%points, error)
    call put_number(self, steps_group//"/PartOffsets", self%steps, error)
    call put_number(self, steps_group//"/NumberOfParts", 1_i8, error)
    call put_number(self, steps_group//"/PointOffsets", self%points, error)
    call self%file%put_rows(steps_group//"/CellOffsets", self%steps, cells(:, 1:n), error)
    call self%file%put_rows(steps_group//"/ConnectivityIdOffsets", self%steps, connectivity(:, 1:n), error)
    do k = 1, size(self%field)
      call put_number(self, steps_group//"/"//data_group(self)//"Offsets/"//trim(self%field(k)%name), self%rows, error)
    end do
    call put_number(self, step_table, int(step, i8), error)
  end subroutine write_offsets

  !> The row of this step in a table with one number a step.
  subroutine put_number(self, path, number, error)
    type(vtkhdf_file_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: number
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: value(1, 1)

    value = number
    call self%file%put_rows(path, self%steps, value(:, 1:merge(1, 0, self%comm%rank == 0)), error)
  end subroutine put_number

  !> Close. A file without a step is removed; one that has no name yet takes it, or stays aside where something failed before.
  !> Without effect on a file not open. Collective.
  subroutine vtkhdf_close(self, error)
    class(vtkhdf_file_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error

    if (self%steps == 0) then
      call self%file%discard()
    else if (allocated(error)) then
      ! what was written of a step that failed is behind the whole ones, and a restart goes on from these
      call self%file%leave()
    else
      call self%file%close(error)
    end if
  end subroutine vtkhdf_close

end module gravier_vtkhdf_file
