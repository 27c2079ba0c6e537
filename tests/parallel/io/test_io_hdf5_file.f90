!> The HDF5 adapter: round trips on any number of ranks, groups that appear when complete, and files that are no good.
program test_io_hdf5_file
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, status_input, status_failure
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_hdf5_datasets, only: chunk_rows
  use gravier_hdf5_file, only: h5_file_t, table_integer, table_double
  use gravier_check, only: check, check_equal, finish_checks
  use hdf5, only: hid_t, h5fopen_f, h5fclose_f, h5dopen_f, h5dclose_f, H5F_ACC_RDONLY_F
  implicit none
  type(communicator_t) :: comm
  character(len=:), allocatable :: path

  call start_parallel()
  call comm%init()
  path = scratch("io_hdf5_file_"//to_text(comm%size)//".h5")
  call test_rows()
  call test_chunks()
  call test_attributes()
  call test_groups()
  call test_refused_reads()
  call test_refused_writes()
  call test_bad_files()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> A path for files of this test.
  function scratch(name) result(path)
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: path
    character(len=1000) :: directory
    integer :: length, stat

    call get_environment_variable("GRAVIER_TEST_DIR", directory, length, stat)
    path = name
    if (stat == 0 .and. length > 0) path = directory(1:length)//"/"//name
  end function scratch

  !> The same error is wanted on every rank; it is taken away.
  subroutine expect(error, status, part, name)
    type(error_t), allocatable, intent(inout) :: error
    integer, intent(in) :: status
    character(len=*), intent(in) :: part, name
    character(len=:), allocatable :: first

    call check(allocated(error), name//": an error")
    first = ""
    if (allocated(error)) first = error%message
    call comm%broadcast_text(first, 0)
    if (.not. allocated(error)) return
    call check_equal(error%message, first, name//": the same error on all ranks")
    call check_equal(error%status, status, name//": status")
    call check(index(error%message, part) > 0, name//': "'//part//'" in: '//error%message)
    call check(index(error%message, new_line("a")) == 0, name//": one line")
    deallocate (error)
  end subroutine expect

  subroutine expect_none(error, name)
    type(error_t), allocatable, intent(inout) :: error
    character(len=*), intent(in) :: name

    if (allocated(error)) then
      call check(.false., name//": "//error%message)
      deallocate (error)
    else
      call check(.true., name)
    end if
  end subroutine expect_none

  !> Rank r writes r rows (rank 0 of several none); every rank reads another block, and all rows.
  subroutine test_rows()
    type(h5_file_t) :: file
    type(error_t), allocatable :: error
    integer(i8), allocatable :: id(:)
    real(dp), allocatable :: x(:), xyz(:, :)
    integer(i8) :: first, total, n
    integer :: rows

    rows = 5*comm%rank
    if (comm%size == 1) rows = 5
    call make_rows(comm%offset(int(rows, i8)), rows, id, x, xyz)
    call file%create(comm, path, error)
    call check(file%is_open(), "open after create")
    call file%write_rows("/group/id", id, error)
    call file%write_rows("/group/x", x, error)
    call file%write_rows("/group/xyz", xyz, error)
    call file%write_rows("/none/id", id(1:0), error)
    call file%write_rows("/none/xyz", xyz(:, 1:0), error)
    call file%close(error)
    call check(.not. file%is_open(), "not open after close")
    call file%close(error)
    call expect_none(error, "writing rows")

    total = comm%total(int(rows, i8))
    call file%open(comm, path, error)
    call expect_none(error, "opening")
    call check(file%exists("/"), "the root exists")
    call check(file%exists("/group"), "a group exists")
    call check(file%exists("/group/id"), "a dataset exists")
    call check(.not. file%exists("/group/i"), "part of a name does not exist")
    call check(.not. file%exists("/a/b"), "nothing exists in a group that does not")
    call check(.not. file%exists("/group/id/x"), "nothing exists in a dataset")
    call check_equal(file%columns("/group/x"), 0, "columns of a vector")
    call check_equal(file%columns("/group/xyz"), 3, "columns of a table")
    call check_equal(file%columns("/none/xyz"), 3, "columns of an empty table")
    call check_equal(file%columns("/group"), -1, "columns of a group")
    call check_equal(file%columns("/missing"), -1, "columns of nothing")
    call check_equal(file%member_count("/group"), 3, "members of a group")
    call check_equal(file%member("/group", 2), "x", "second member of a group")
    call file%row_count("/none/xyz", n, error)
    call check_equal(n, 0_i8, "rows of an empty table")
    call file%row_count("/group/xyz", n, error)
    call check_equal(n, total, "rows of a table")

    ! the blocks in the reverse order of the ranks
    first = total*(comm%size - 1 - comm%rank)/comm%size
    call read_and_check(file, first, int(total*(comm%size - comm%rank)/comm%size - first), error)
    ! all rows on all ranks, rows on the last rank only, none at all
    call read_and_check(file, 0_i8, int(total), error)
    call read_and_check(file, 0_i8, merge(int(total), 0, comm%rank == comm%size - 1), error)
    call read_and_check(file, 0_i8, 0, error)
    call file%close(error)
    call expect_none(error, "reading rows")
  end subroutine test_rows

  subroutine make_rows(first, n, id, x, xyz)
    integer(i8), intent(in) :: first
    integer, intent(in) :: n
    integer(i8), allocatable, intent(out) :: id(:)
    real(dp), allocatable, intent(out) :: x(:), xyz(:, :)
    integer :: i

    allocate (id(n), x(n), xyz(3, n))
    do i = 1, n
      id(i) = 9007199254740993_i8 + first + i
      x(i) = 1.0_dp/(first + i)
      xyz(:, i) = x(i)
      xyz(3, i) = -x(i)
    end do
  end subroutine make_rows

  subroutine read_and_check(file, first, n, error)
    type(h5_file_t), intent(in) :: file
    integer(i8), intent(in) :: first
    integer, intent(in) :: n
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), allocatable :: id(:), id_found(:)
    real(dp), allocatable :: x(:), xyz(:, :), x_found(:), xyz_found(:, :)

    call make_rows(first, n, id, x, xyz)
    allocate (id_found(n), source=0_i8)
    allocate (x_found(n), xyz_found(3, n), source=0.0_dp)
    call file%read_rows("/group/id", first, id_found, error)
    call file%read_rows("/group/x", first, x_found, error)
    call file%read_rows("/group/xyz", first, xyz_found, error)
    call check(all(id_found == id), "integers read")
    call check(all(same(x_found, x)), "reals read")
    call check(all(same(xyz_found, xyz)), "columns of reals read")
  end subroutine read_and_check

  !> The rows of a chunk of a vector, of a table and of a dataset without chunks, as they were asked for, on every rank.
  subroutine test_chunks()
    type(h5_file_t) :: file
    type(error_t), allocatable :: error
    integer(hid_t) :: raw
    integer(i8) :: rows(3)
    real(dp) :: value(1)
    integer :: k, stat
    character(len=*), parameter :: name(3) = [character(len=6) :: "vector", "table", "fixed"]

    call file%create(comm, path, error)
    call file%make_table("/vector", 0, table_integer, 1000_i8, error)
    call file%make_table("/table", 3, table_double, 70_i8, error)
    value(1) = comm%rank
    call file%write_rows("/fixed", value, error)
    call file%close(error)
    call expect_none(error, "tables")
    call h5fopen_f(path, H5F_ACC_RDONLY_F, raw, stat)
    do k = 1, size(name)
      rows(k) = rows_of_chunk(raw, trim(name(k)))
    end do
    call h5fclose_f(raw, stat)
    call check_equal(rows(1), 1000_i8, "rows of a chunk of a vector")
    call check_equal(rows(2), 70_i8, "rows of a chunk of a table")
    call check_equal(rows(3), 1_i8, "rows of a chunk where there are none")
  end subroutine test_chunks

  integer(i8) function rows_of_chunk(raw, name) result(rows)
    integer(hid_t), intent(in) :: raw
    character(len=*), intent(in) :: name
    integer(hid_t) :: dataset
    integer :: stat

    call h5dopen_f(raw, name, dataset, stat)
    rows = chunk_rows(dataset)
    call h5dclose_f(dataset, stat)
  end function rows_of_chunk

  subroutine test_attributes()
    type(h5_file_t) :: file
    type(error_t), allocatable :: error
    character(len=:), allocatable :: text, long_text
    real(dp) :: x
    integer(i8) :: n

    long_text = repeat("&scene title = 'long' /"//new_line("a"), 5000)
    call file%create(comm, path, error)
    call file%make_group("/run/deep", error)
    call file%write_attribute("/run", "text", "two words  ", error)
    call file%write_attribute("/run", "lines", "one"//new_line("a")//"two"//new_line("a"), error)
    call file%write_attribute("/run", "empty", "", error)
    call file%write_attribute("/run", "long", long_text, error)
    call file%write_attribute("/run/deep", "small", 7, error)
    call file%write_attribute("/run/deep", "large", 9007199254740993_i8, error)
    call file%write_attribute("/run/deep", "list", [1_i8, 2_i8], error)
    call file%write_attribute("/run/deep", "real", 1.0_dp/3, error)
    call file%close(error)
    call expect_none(error, "writing attributes")

    call file%open(comm, path, error)
    call file%read_attribute("/run", "text", text, error)
    call check(text == "two words  " .and. len(text) == 11, "text with blanks at its end")
    call file%read_attribute("/run", "lines", text, error)
    call check_equal(text, "one"//new_line("a")//"two"//new_line("a"), "text of several lines")
    call file%read_attribute("/run", "empty", text, error)
    call check_equal(len(text), 0, "empty text")
    call file%read_attribute("/run", "long", text, error)
    call check(text == long_text .and. len(text) == len(long_text), "long text")
    call file%read_attribute("/run/deep", "small", n, error)
    call check_equal(n, 7_i8, "small integer")
    call file%read_attribute("/run/deep", "large", n, error)
    call check_equal(n, 9007199254740993_i8, "large integer")
    call file%read_attribute("/run/deep", "real", x, error)
    call check(same(x, 1.0_dp/3), "real")
    call expect_none(error, "reading attributes")
    call file%read_attribute("/run", "missing", text, error)
    call expect(error, status_input, path//": /run: attribute missing is missing", "a missing attribute")
    call file%read_attribute("/nowhere", "text", text, error)
    call expect(error, status_input, path//": /nowhere: attribute text", "an attribute of nothing")
    call file%read_attribute("/run", "text", n, error)
    call expect(error, status_input, "not one number", "a text read as a number")
    call file%read_attribute("/run/deep", "small", text, error)
    call expect(error, status_input, "not one text", "a number read as a text")
    call file%read_attribute("/run/deep", "list", n, error)
    call expect(error, status_input, "not one number", "a list read as a number")
    call file%close(error)
  end subroutine test_attributes

  !> A group begun is in the file only once it is committed.
  subroutine test_groups()
    type(h5_file_t) :: file
    type(error_t), allocatable :: error
    character(len=:), allocatable :: text
    integer(i8) :: ids(2)

    ids = comm%rank
    call file%create(comm, path, error)
    call file%make_group("/steps", error)
    call file%begin_group("/steps/1", error)
    call file%write_attribute("/steps/1", "name", "first", error)
    call file%make_group("/steps/1/bodies", error)
    call file%write_rows("/steps/1/bodies/id", ids, error)
    call check(file%exists("/steps/1/bodies/id"), "the group is there for who writes it")
    call check_equal(file%member_count("/steps"), 0, "but not for others")
    call file%commit_group(error)
    call check_equal(file%member_count("/steps"), 1, "a group committed is there for all")
    call file%begin_group("/steps/2", error)
    call file%write_rows("/steps/2/id", ids, error)
    call file%abandon_group()
    call file%begin_group("/steps/3", error)
    call file%write_rows("/steps/3/id", ids, error)
    call file%flush(error)
    call expect_none(error, "writing groups")
    call file%begin_group("/steps/1", error)
    call expect(error, status_failure, path//": /steps/1: is in the file already", "a group twice")
    call file%begin_group("/steps/4", error)
    call file%close(error)
    call expect_none(error, "closing with a group begun")

    call file%open(comm, path, error)
    call check_equal(file%member_count("/steps"), 1, "only what was committed is in the file")
    call file%read_attribute("/steps/1", "name", text, error)
    call check_equal(text, "first", "attribute of a group committed")
    ids = -1
    call file%read_rows("/steps/1/bodies/id", 2_i8*comm%rank, ids, error)
    call check(all(ids == comm%rank), "rows of a group committed")
    call file%close(error)
    call expect_none(error, "reading groups")
  end subroutine test_groups

  subroutine test_refused_reads()
    type(h5_file_t) :: file
    type(error_t), allocatable :: error
    real(dp) :: x(2), xyz(3, 2), xy(2, 2)
    integer(i8) :: id(2), n

    x = 0
    xyz = 0
    xy = 0
    id = 0
    call file%create(comm, path, error)
    call file%write_rows("/x", x, error)
    call file%write_rows("/xyz", xyz, error)
    call file%write_rows("/id", id, error)
    call file%close(error)
    call file%open(comm, path, error)
    call expect_none(error, "a file to be misread")
    call file%read_rows("/y", 0_i8, x, error)
    call expect(error, status_input, path//": /y: missing", "a missing dataset")
    call file%row_count("/y", n, error)
    call expect(error, status_input, path//": /y: missing", "rows of a missing dataset")
    call file%row_count("/", n, error)
    call expect(error, status_input, "/: a dataset was expected, but it is none or damaged", "rows of a group")
    call file%read_rows("/xyz", 0_i8, x, error)
    call expect(error, status_input, "/xyz: a dataset of shape (N, 3), but a dataset of shape (N) was", "a table as vector")
    call file%read_rows("/xyz", 0_i8, xy, error)
    call expect(error, status_input, "/xyz: a dataset of shape (N, 3), but a dataset of shape (N, 2)", "too few columns")
    call file%read_rows("/x", 0_i8, id, error)
    call expect(error, status_input, "/x: not made of integers", "reals as integers")
    call file%read_rows("/id", 0_i8, x, error)
    call expect_none(error, "integers as reals")
    call file%read_rows("/x", 2_i8*comm%size - 1_i8, x, error)
    call expect(error, status_input, "were asked for, but it has "//to_text(2*comm%size), "rows beyond the end")
    ! one rank alone asks for too much
    call file%read_rows("/x", merge(-1_i8, 0_i8, comm%rank == comm%size - 1), x, error)
    call expect(error, status_input, "rows -1 to 0 were asked for", "rows before the beginning")
    call file%write_rows("/new", x, error)
    call check(allocated(error), "writing to a file opened for reading")
    if (allocated(error)) deallocate (error)
    call file%close(error)
  end subroutine test_refused_reads

  subroutine test_refused_writes()
    type(h5_file_t) :: file
    type(error_t), allocatable :: error
    real(dp) :: x(2)
    real(dp), allocatable :: tables(:, :)

    x = 0
    allocate (tables(merge(2, 3, comm%rank == 1), 2), source=0.0_dp)
    call file%create(comm, path//"/none.h5", error)
    call expect(error, status_failure, "none.h5.part: cannot create this file: Not a directory", "no such directory")
    call check(.not. file%is_open(), "not open after a failure")
    call file%create(comm, path, error)
    call file%write_rows("/x", x, error)
    call expect_none(error, "a first dataset")
    call file%write_rows("/x", x, error)
    call expect(error, status_failure, path//": /x: cannot make this dataset", "a dataset twice")
    call file%make_group("/x", error)
    call expect(error, status_failure, path//": /x: cannot make this group", "a group in the place of a dataset")
    call file%write_attribute("/y", "name", "value", error)
    call expect(error, status_failure, path//": /y: cannot write attribute name", "an attribute of nothing")
    if (comm%size > 1) then
      call file%write_rows("/t", tables, error)
      call expect(error, status_failure, "/t: the number of columns differs between ranks", "ranks that disagree")
    end if
    call file%write_rows("/more/x", x, error)
    call file%close(error)
    call expect_none(error, "going on after refusals")
  end subroutine test_refused_writes

  !> None of these may hang or bring the program down.
  subroutine test_bad_files()
    type(h5_file_t) :: file
    type(error_t), allocatable :: error
    character(len=:), allocatable :: whole, bad
    real(dp) :: x(1000)
    integer :: i, n

    bad = path//".bad"
    call file%open(comm, path//".none", error)
    call expect(error, status_input, path//".none: cannot read this file: No such file", "a missing file")
    call put(bad, "")
    call file%open(comm, bad, error)
    call expect(error, status_input, bad//": not an HDF5 file", "an empty file")
    call put(bad, repeat("id,x,y,radius"//new_line("a"), 100))
    call file%open(comm, bad, error)
    call expect(error, status_input, bad//": not an HDF5 file", "a text file")
    call file%open(comm, "/", error)
    call expect(error, status_input, "/: ", "a directory")

    x = comm%rank
    call file%create(comm, path, error)
    call file%write_rows("/group/x", x, error)
    call file%close(error)
    call expect_none(error, "a whole file")
    whole = content(path)
    n = len(whole)
    do i = 1, 4
      ! all but the last byte, a third, a 27th, and less than the first header
      call put(bad, whole(1:merge(n - 1, n/3**(2*i - 3), i == 1)))
      call file%open(comm, bad, error)
      call expect(error, status_input, bad//": truncated or damaged HDF5 file", "a truncated file")
      call check(.not. file%is_open(), "a truncated file is not open")
    end do
    ! everything but the first block lost
    call put(bad, whole(1:96)//repeat(achar(0), n - 96))
    call file%open(comm, bad, error)
    if (.not. allocated(error)) call file%read_rows("/group/x", 0_i8, x, error)
    call expect(error, status_input, bad//": ", "a damaged file")
    call file%close(error)
    call expect_none(error, "after damaged files")
  end subroutine test_bad_files

  !> Rank 0 writes a file, for all to see.
  subroutine put(name, text)
    character(len=*), intent(in) :: name, text
    integer :: unit

    call comm%barrier()
    if (comm%rank == 0) then
      open (newunit=unit, file=name, access="stream", form="unformatted", action="write", status="replace")
      write (unit) text
      close (unit)
    end if
    call comm%barrier()
  end subroutine put

  function content(name) result(text)
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: text
    integer :: unit, length

    open (newunit=unit, file=name, access="stream", form="unformatted", action="read", status="old")
    inquire (unit=unit, size=length)
    allocate (character(len=length) :: text)
    read (unit) text
    close (unit)
  end function content

  !> Equality bit by bit.
  elemental logical function same(a, b)
    real(dp), intent(in) :: a, b
    same = transfer(a, 0_i8) == transfer(b, 0_i8)
  end function same

end program test_io_hdf5_file
