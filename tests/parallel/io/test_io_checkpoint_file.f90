!> Checkpoints: bits survive, any number of ranks reads what any number wrote, and the older one survives every failure.
program test_io_checkpoint_file
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan, ieee_negative_inf
  use mpi_f08, only: MPI_Comm, MPI_Comm_split, MPI_Comm_free, MPI_UNDEFINED, MPI_COMM_NULL, operator(/=)
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_input, status_failure
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_file_system, only: remove_file
  use gravier_hdf5_file, only: h5_file_t
  use gravier_checkpoint_file, only: checkpoint_file_t
  use gravier_check, only: check, check_equal, finish_checks
  implicit none
  integer, parameter :: words = 3
  !> what the records are
  character(len=*), parameter :: layout = "grain: id place mass"//new_line("a")//"energy: all of it, 10 words"
  type(communicator_t) :: world
  character(len=:), allocatable :: base

  call start_parallel()
  call world%init()
  base = scratch("io_checkpoint_"//to_text(world%size))
  call test_rank_counts(1)
  call test_rank_counts(3)
  call test_rank_counts(11)
  call test_bits()
  call test_failures_while_writing()
  call test_refused()
  call test_damaged()
  call finish_checks()
  call world%free()
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

  subroutine expect(error, status, message, name)
    type(error_t), allocatable, intent(inout) :: error
    integer, intent(in) :: status
    character(len=*), intent(in) :: message, name

    call check(allocated(error), name//": an error")
    if (.not. allocated(error)) return
    call check_equal(error%status, status, name//": status")
    call check_equal(error%message, message, name//": message")
    deallocate (error)
  end subroutine expect

  !> The first p ranks, when this is one of them.
  subroutine take_some(p, comm)
    integer, intent(in) :: p
    type(communicator_t), intent(inout) :: comm
    type(MPI_Comm) :: some

    call MPI_Comm_split(world%mpi, merge(0, MPI_UNDEFINED, world%rank < p), world%rank, some)
    if (some /= MPI_COMM_NULL) then
      call comm%init(some)
      call MPI_Comm_free(some)
    end if
  end subroutine take_some

  !> Subdomain s has mod(3 s, 5) records.
  pure integer(i8) function count_of(s) result(n)
    integer, intent(in) :: s
    n = mod(3*s, 5)
  end function count_of

  pure function record_of(s, i) result(record)
    integer, intent(in) :: s, i
    integer(i8) :: record(words)
    record(1) = s
    record(2) = -i
    record(3) = transfer(s + 1.0_dp/i, 0_i8)
  end function record_of

  !> What this rank holds of the table.
  subroutine make_table(comm, n_subdomains, records, counts)
    type(communicator_t), intent(in) :: comm
    integer, intent(in) :: n_subdomains
    integer(i8), allocatable, intent(out) :: records(:, :), counts(:)
    integer :: first, last, s, i, n

    first = comm%first_subdomain(comm%rank, n_subdomains)
    last = comm%first_subdomain(comm%rank + 1, n_subdomains) - 1
    allocate (counts(last - first + 1))
    do s = first, last
      counts(s - first + 1) = count_of(s)
    end do
    allocate (records(words, sum(counts)))
    n = 0
    do s = first, last
      do i = 1, int(count_of(s))
        n = n + 1
        records(:, n) = record_of(s, i)
      end do
    end do
  end subroutine make_table

  subroutine write_all(comm, path, n_subdomains, error)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    integer, intent(in) :: n_subdomains
    type(error_t), allocatable, intent(inout) :: error
    type(checkpoint_file_t) :: file
    integer(i8), allocatable :: records(:, :), counts(:)

    call make_table(comm, n_subdomains, records, counts)
    call file%create(comm, path, layout, error)
    call file%write_scalar("step", 12345678901_i8, error)
    call file%write_text("input", "&scene /", error)
    call file%write_array("partition", [3_i8, 1_i8, 4_i8, -1_i8], error)
    call file%write_table("grains", n_subdomains, records, counts, error)
    counts(:) = 0
    call file%write_table("nothing", n_subdomains, records(:, 1:0), counts, error)
    call file%commit(error)
  end subroutine write_all

  subroutine check_all(comm, path, n_subdomains, error)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    integer, intent(in) :: n_subdomains
    type(error_t), allocatable, intent(inout) :: error
    type(checkpoint_file_t) :: file
    character(len=:), allocatable :: text
    integer(i8), allocatable :: values(:), records(:, :), counts(:), expected_records(:, :), expected_counts(:)
    integer(i8) :: n

    call file%open(comm, path, layout, error)
    call file%read_scalar("step", n, error)
    call check_equal(n, 12345678901_i8, "a scalar")
    call file%read_text("input", text, error)
    call check_equal(text, "&scene /", "a text")
    call file%read_array("partition", 4, 4, values, error)
    call check_equal(size(values), 4, "size of an array")
    if (size(values) == 4) call check(all(values == [3, 1, 4, -1]), "an array")
    call file%read_table("grains", n_subdomains, words, records, counts, error)
    call make_table(comm, n_subdomains, expected_records, expected_counts)
    call check_equal(size(counts), size(expected_counts), "number of counts")
    if (size(counts) == size(expected_counts)) call check(all(counts == expected_counts), "counts")
    call check_equal(size(records, 1), words, "words of a record")
    call check_equal(size(records, 2), size(expected_records, 2), "number of records")
    if (size(records) == size(expected_records)) call check(all(records == expected_records), "records")
    call file%read_table("nothing", n_subdomains, words, records, counts, error)
    call check_equal(size(records, 1), words, "words of no record")
    call check_equal(size(records, 2), 0, "no records")
    call file%close(error)
  end subroutine check_all

  !> Written on 1, 2, ... ranks: the same bytes, which every number of ranks reads.
  subroutine test_rank_counts(n_subdomains)
    integer, intent(in) :: n_subdomains
    type(communicator_t) :: comm
    type(error_t), allocatable :: error
    character(len=:), allocatable :: first, other
    logical :: same
    integer :: p

    first = ""
    do p = 1, world%size
      call take_some(p, comm)
      if (comm%alive) call write_all(comm, base//".h5", n_subdomains, error)
      call comm%free()
      call world%barrier()
      call expect_none(error, "writing on "//to_text(p)//" ranks")
      allocate (other, source=content(base//".h5"))
      if (p == 1) first = other
      same = first == other .and. len(first) == len(other)
      deallocate (other)
      call check(same, "the file of 1 rank and of "//to_text(p))
      call read_on_all(n_subdomains)
    end do
  end subroutine test_rank_counts

  subroutine read_on_all(n_subdomains)
    integer, intent(in) :: n_subdomains
    type(communicator_t) :: comm
    type(error_t), allocatable :: error
    integer :: q

    do q = 1, world%size
      call take_some(q, comm)
      if (comm%alive) call check_all(comm, base//".h5", n_subdomains, error)
      call comm%free()
      call expect_none(error, "reading on "//to_text(q)//" ranks")
      call world%barrier()
    end do
  end subroutine read_on_all

  !> Reals of every kind, in scalars and in records, and texts too long for a header.
  subroutine test_bits()
    type(checkpoint_file_t) :: file
    type(error_t), allocatable :: error
    character(len=:), allocatable :: text
    real(dp) :: reals(7), x
    integer(i8), allocatable :: records(:, :), counts(:)
    integer :: i, n

    reals(1:4) = [0.1_dp, -0.0_dp, huge(1.0_dp), 1.0_dp + epsilon(1.0_dp)]
    reals(5) = tiny(1.0_dp)/8
    reals(6) = ieee_value(1.0_dp, ieee_quiet_nan)
    reals(7) = ieee_value(1.0_dp, ieee_negative_inf)
    ! one subdomain, which the last rank owns
    n = merge(1, 0, world%rank == world%size - 1)
    allocate (records(size(reals), n), counts(n), source=1_i8)
    do i = 1, size(reals)
      records(i, :) = transfer(reals(i), 0_i8)
    end do
    call file%create(world, base//".h5", layout, error)
    do i = 1, size(reals)
      call file%write_scalar("real "//to_text(i), reals(i), error)
    end do
    call file%write_scalar("least", -huge(1_i8) - 1_i8, error)
    call file%write_text("long", repeat("0123456789", 10000), error)
    call file%write_text("none", "", error)
    call file%write_table("reals", 1, records, counts, error)
    call file%commit(error)
    call expect_none(error, "writing bits")
    call file%open(world, base//".h5", layout, error)
    do i = 1, size(reals)
      call file%read_scalar("real "//to_text(i), x, error)
      call check_equal(transfer(x, 0_i8), transfer(reals(i), 0_i8), "bits of real "//to_text(i))
    end do
    call file%read_text("long", text, error)
    call check(text == repeat("0123456789", 10000), "a long text")
    call file%read_text("none", text, error)
    call check_equal(len(text), 0, "an empty text")
    call file%read_table("reals", 1, 7, records, counts, error)
    call check_equal(size(records, 2), n, "records of the owner")
    do i = 1, size(records)
      call check_equal(records(i, 1), transfer(reals(i), 0_i8), "bits in a record")
    end do
    call file%close(error)
    call expect_none(error, "reading bits")
  end subroutine test_bits

  !> A failure at any moment leaves the older checkpoint, and no part.
  subroutine test_failures_while_writing()
    type(checkpoint_file_t) :: file
    type(error_t), allocatable :: error
    character(len=:), allocatable :: before
    integer(i8) :: records(words, 2)
    integer(i8), allocatable :: counts(:)

    call write_all(world, base//".h5", 5, error)
    call expect_none(error, "the older checkpoint")
    before = content(base//".h5")
    records = 1
    allocate (counts(world%first_subdomain(world%rank + 1, 5) - world%first_subdomain(world%rank, 5)), source=7_i8)
    call file%create(world, base//".h5", layout, error)
    call file%write_table("grains", 5, records, counts, error)
    call expect(error, status_failure, base//".h5: table grains: the counts of rank 0 do not fit its subdomains and records", &
      & "counts that are wrong")
    call raise(error, status_failure, "as it was")
    call file%commit(error)
    call expect(error, status_failure, "as it was", "a commit after an error")
    call check_older(before)
    ! the name is taken by a directory: only the last step fails
    call world%barrier()
    if (world%rank == 0) call execute_command_line("mkdir -p '"//base//".taken/in'")
    call world%barrier()
    call write_all(world, base//".taken", 5, error)
    call check(allocated(error), "a name that is taken by a directory")
    if (allocated(error)) then
      call check(index(error%message, base//".taken.part: cannot rename to ") == 1, "taken: "//error%message)
      deallocate (error)
    end if
    call write_all(world, base//".h5/none", 5, error)
    call expect(error, status_failure, base//".h5/none.part: cannot create this file: Not a directory", "no such directory")
    call file%commit(error)
    call expect_none(error, "a commit of nothing")
    call check_older(before)
    ! a part that a run left when it died is no obstacle
    call put(base//".h5.part", "rubbish")
    call write_all(world, base//".h5", 5, error)
    call expect_none(error, "a checkpoint over a part that was left")
    call check_older(before)
  end subroutine test_failures_while_writing

  subroutine check_older(before)
    character(len=*), intent(in) :: before
    character(len=:), allocatable :: now
    logical :: exists

    call world%barrier()
    now = content(base//".h5")
    call check(now == before .and. len(now) == len(before), "the older checkpoint is as it was")
    inquire (file=base//".h5.part", exist=exists)
    call check(.not. exists, "no part is left")
    inquire (file=base//".taken.part", exist=exists)
    call check(.not. exists, "no part is left of a name that is taken")
    call world%barrier()
  end subroutine check_older

  !> Files of another kind, and things that are not there.
  subroutine test_refused()
    type(checkpoint_file_t) :: file
    type(h5_file_t) :: other
    type(error_t), allocatable :: error
    integer(i8), allocatable :: records(:, :), counts(:), values(:)
    character(len=:), allocatable :: text
    integer(i8) :: n
    real(dp) :: x

    call write_all(world, base//".h5", 5, error)
    call file%open(world, base//".h5", layout, error)
    call file%read_scalar("steps", n, error)
    call expect(error, status_input, base//".h5: /scalars: attribute steps is missing or not one number of its kind", "no scalar")
    call file%read_scalar("step", x, error)
    call expect(error, status_input, base//".h5: /scalars: attribute step is missing or not one number of its kind", "no real")
    call file%read_text("output", text, error)
    call expect(error, status_input, base//".h5: /texts/output: missing", "no text")
    call file%read_array("parts", 0, 4, values, error)
    call expect(error, status_input, base//".h5: /arrays/parts: missing", "no array")
    call file%read_table("grain", 5, words, records, counts, error)
    call expect(error, status_input, base//".h5: /tables/grain/records: missing", "no table")
    call file%read_table("grains", 6, words, records, counts, error)
    call expect(error, status_input, base//".h5: /tables/grains: 5 subdomains, but 6 were expected", "other subdomains")
    call check_equal(size(records, 2), 0, "no records after a failure")
    call file%read_table("grains", 5, words + 1, records, counts, error)
    call expect(error, status_input, base//".h5: /tables/grains: records of 3 words, but 4 were expected", "wider records")
    call file%read_table("grains", 5, words - 1, records, counts, error)
    call expect(error, status_input, base//".h5: /tables/grains: records of 3 words, but 2 were expected", "narrower records")
    call file%read_array("partition", 5, 9, values, error)
    call expect(error, status_input, base//".h5: /arrays/partition: 4 words, but 5 to 9 were expected", "a longer array")
    call check_equal(size(values), 0, "no words after a failure")
    call file%read_array("partition", 0, 3, values, error)
    call expect(error, status_input, base//".h5: /arrays/partition: 4 words, but 0 to 3 were expected", "a shorter array")
    call file%read_table("grains", 5, words, records, counts, error)
    call expect_none(error, "reading after refusals")
    call file%close(error)

    call file%open(world, base//".none", layout, error)
    call expect(error, status_input, base//".none: cannot read this file: No such file or directory", "no file")
    call put(base//".foreign", "a text")
    call file%open(world, base//".foreign", layout, error)
    call expect(error, status_input, base//".foreign: not an HDF5 file", "a text file")
    call other%create(world, base//".foreign", error)
    call other%close(error)
    call file%open(world, base//".foreign", layout, error)
    call expect(error, status_input, base//".foreign: not a checkpoint", "another HDF5 file")
    call other%create(world, base//".foreign", error)
    call other%make_group("/format", error)
    call other%write_attribute("/format", "name", "gravier checkpoint", error)
    call other%close(error)
    call file%open(world, base//".foreign", layout, error)
    call expect(error, status_input, base//".foreign: a checkpoint of an earlier version of Gravier, which does not say "// &
      & "what its records are", "an earlier version")
    call write_all(world, base//".foreign", 5, error)
    call file%open(world, base//".foreign", layout//" less", error)
    call expect(error, status_input, base//'.foreign: a checkpoint of another version of Gravier: its records are "energy: '// &
      & 'all of it, 10 words", but "energy: all of it, 10 words less" was expected', "another version")
    call file%open(world, base//".foreign", layout(1:20), error)
    call expect(error, status_input, base//'.foreign: a checkpoint of another version of Gravier: its records are "energy: '// &
      & 'all of it, 10 words", but "" was expected', "a version without energy")
    call file%read_table("grains", 5, words, records, counts, error)
    call check_equal(size(records, 2), 0, "no records of a file not open")
    if (allocated(error)) deallocate (error)
  end subroutine test_refused

  !> Cut short at any place, a bit that is another in any table, and counts that do not add up.
  subroutine test_damaged()
    type(checkpoint_file_t) :: file
    type(h5_file_t) :: other
    type(error_t), allocatable :: error
    character(len=:), allocatable :: whole
    character(len=32) :: letters
    integer(i8) :: record(words), four(4)
    integer(i8), allocatable :: records(:, :), counts(:)
    integer :: i

    call write_all(world, base//".h5", 5, error)
    whole = content(base//".h5")
    do i = 1, 9
      call put(base//".cut", whole(1:i*(len(whole) - 1)/9))
      call file%open(world, base//".cut", layout, error)
      call expect(error, status_input, base//".cut: truncated or damaged HDF5 file", "a file cut short")
    end do
    call put(base//".cut", whole(1:4))
    call file%open(world, base//".cut", layout, error)
    call expect(error, status_input, base//".cut: not an HDF5 file", "a file cut within its first bytes")

    record = record_of(3, 3)
    letters(1:24) = transfer(record, letters(1:24))
    call flip("a record", whole, "/tables/grains/records", letters(1:24))
    do i = 1, 4
      four(i) = count_of(i)
    end do
    letters = transfer(four, letters)
    call flip("counts", whole, "/tables/grains/counts", letters)
    four = [3, 1, 4, -1]
    letters = transfer(four, letters)
    call flip("an array", whole, "/arrays/partition", letters)
    call flip("a text", whole, "/texts/input", "&scene /")

    call make_table(world, 5, records, counts)
    call other%create(world, base//".cut", error)
    call other%make_group("/format", error)
    call other%write_attribute("/format", "name", "gravier checkpoint", error)
    call other%write_attribute("/format", "records", layout, error)
    call other%write_rows("/tables/grains/records", records, error)
    counts = counts + 1
    call other%write_rows("/tables/grains/counts", counts, error)
    call other%close(error)
    call file%open(world, base//".cut", layout, error)
    call file%read_table("grains", 5, words, records, counts, error)
    call expect(error, status_input, base//".cut: /tables/grains: the counts of records do not add up to the 10 that are there", &
      & "counts that do not add up")
    call file%close(error)
    call expect_none(error, "closing a damaged file")
  end subroutine test_damaged

  !> Change one bit of what begins with `bytes` in a file: a reader of everything is told the table.
  subroutine flip(name, whole, table, bytes)
    character(len=*), intent(in) :: name, whole, table, bytes
    type(error_t), allocatable :: error
    character(len=:), allocatable :: changed
    integer :: place

    place = index(whole, bytes)
    call check(place > 0, name//": is in the file")
    changed = whole
    changed(place + 2:place + 2) = char(ieor(ichar(whole(place + 2:place + 2)), 16))
    call put(base//".cut", changed)
    call read_everything(base//".cut", error)
    call check(allocated(error), name//": refused")
    if (.not. allocated(error)) return
    call check_equal(error%message, base//".cut: "//table//": its attribute checksum is not that of what it holds: the file is "// &
      & "damaged, or was changed since it was written", name)
    call check_equal(error%status, status_input, name//": status")
  end subroutine flip

  !> All that write_all writes.
  subroutine read_everything(path, error)
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    type(checkpoint_file_t) :: file
    type(error_t), allocatable :: ignored
    integer(i8), allocatable :: records(:, :), counts(:), values(:)
    character(len=:), allocatable :: text

    call file%open(world, path, layout, error)
    call file%read_text("input", text, error)
    call file%read_array("partition", 4, 4, values, error)
    call file%read_table("grains", 5, words, records, counts, error)
    call file%read_table("nothing", 5, words, records, counts, error)
    call file%close(ignored)
  end subroutine read_everything

  !> Rank 0 writes a file, for all to see.
  subroutine put(name, text)
    character(len=*), intent(in) :: name, text
    integer :: unit

    call world%barrier()
    if (world%rank == 0) then
      call remove_file(name)
      open (newunit=unit, file=name, access="stream", form="unformatted", action="write", status="replace")
      write (unit) text
      close (unit)
    end if
    call world%barrier()
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

end program test_io_checkpoint_file
