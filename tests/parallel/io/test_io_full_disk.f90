!> A disk that fills up, on a small file system of memory that root may mount (skipped, and said so, where it may not):
!> every writer ends in one error on all ranks, and what was written before stays readable.
program test_io_full_disk
  use, intrinsic :: iso_fortran_env, only: output_unit
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, status_failure
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_file_system, only: make_directory, remove_file
  use gravier_hdf5_file, only: h5_file_t
  use gravier_results_file, only: results_file_t
  use gravier_test_results_rows, only: body_rows_t, run_of, write_rows
  use gravier_bodies_data, only: bodies_data_t, allocate_bodies, allocate_walls
  use gravier_bodies_file, only: read_bodies, write_bodies
  use gravier_checkpoint_file, only: checkpoint_file_t
  use gravier_csv_writer, only: csv_writer_t
  use gravier_check, only: check, check_equal, finish_checks
  implicit none
  !> bytes of the file system
  integer, parameter :: disk_size = 1048576
  type(communicator_t) :: comm
  character(len=:), allocatable :: disk
  logical :: mounted

  call start_parallel()
  call comm%init()
  disk = scratch("io_full_disk_"//to_text(comm%size))
  call mount(mounted)
  if (mounted) then
    call test_results()
    call test_without_reservation()
    call test_create()
    call test_bodies()
    call test_checkpoint()
    call test_csv()
    call test_resume()
    call unmount()
  else
    if (comm%rank == 0) write (output_unit, "(a)") "SKIPPED: no permission to mount a small file system; full disks are NOT tested"
    call check(.true., "skipped")
  end if
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

  subroutine mount(done)
    logical, intent(out) :: done
    type(error_t), allocatable :: error
    integer :: stat

    stat = 1
    if (comm%rank == 0) then
      call make_directory(disk, error)
      ! what a test that died may have left
      call execute_command_line("umount '"//disk//"' 2> /dev/null", exitstat=stat)
      call execute_command_line("mount -t tmpfs -o size="//to_text(disk_size)//" gravier '"//disk//"' 2> /dev/null", &
        & exitstat=stat)
    end if
    done = comm%any_true(stat == 0)
  end subroutine mount

  subroutine unmount()
    call comm%barrier()
    if (comm%rank == 0) call execute_command_line("umount '"//disk//"'")
  end subroutine unmount

  subroutine expect(error, part, name)
    type(error_t), allocatable, intent(inout) :: error
    character(len=*), intent(in) :: part, name
    character(len=:), allocatable :: first

    call check(allocated(error), name//": an error")
    first = ""
    if (allocated(error)) first = error%message
    call comm%broadcast_text(first, 0)
    if (.not. allocated(error)) return
    call check_equal(error%message, first, name//": the same error on all ranks")
    call check_equal(error%status, status_failure, name//": status")
    call check(index(error%message, part) > 0, name//': "'//part//'" in: '//error%message)
    call check(index(error%message, disk) == 1, name//": names the file: "//error%message)
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

  !> Fill the disk but for `left` bytes (-1: empty it again).
  subroutine fill(left)
    integer, intent(in) :: left

    call comm%barrier()
    if (comm%rank == 0) call fill_alone(left)
    call comm%barrier()
  end subroutine fill

  !> The same, by one rank and without the others.
  subroutine fill_alone(left)
    integer, intent(in) :: left
    character(len=1024) :: block
    integer :: unit, i

    call remove_file(disk//"/filler")
    if (left < 0) return
    block = "filler"
    open (newunit=unit, file=disk//"/filler", access="stream", form="unformatted", action="write")
    do i = 1, (free_bytes() - left)/len(block)
      write (unit) block
    end do
    close (unit)
  end subroutine fill_alone

  integer function free_bytes()
    integer :: unit

    call execute_command_line("df -k --output=avail '"//disk//"' | tail -1 > '"//disk//".free'")
    open (newunit=unit, file=disk//".free", action="read", status="old")
    read (unit, *) free_bytes
    close (unit, status="delete")
    free_bytes = 1024*free_bytes
  end function free_bytes

  !> n bodies on each rank but the first of several.
  subroutine make_bodies(n, bodies)
    integer, intent(in) :: n
    type(body_rows_t), intent(out) :: bodies
    integer :: i, own

    own = n
    if (comm%size > 1 .and. comm%rank == 0) own = 0
    allocate (bodies%id(own), bodies%position(3, own), bodies%velocity(6, own), bodies%radius(own))
    do i = 1, own
      bodies%id(i) = int(comm%rank, i8)*n + i
    end do
    bodies%radius = 0.5_dp
    bodies%position = 0.25_dp
    bodies%velocity = -1
  end subroutine make_bodies

  !> Steps until the disk is full: the error comes before anything is written, earlier steps stay, and once there is
  !> room again the run can go on.
  subroutine test_results()
    type(results_file_t) :: results
    type(error_t), allocatable :: error
    type(body_rows_t) :: bodies
    integer :: step

    call make_bodies(1000, bodies)
    call results%open(comm, disk//"/results.h5", run_of("&scene /", 3), error)
    call expect_none(error, "a results file on a disk with room")
    do step = 1, 100
      call write_rows(results, step, 0.01_dp*step, bodies, error)
      if (allocated(error)) exit
    end do
    call check(step > 1 .and. step < 100, "steps until the disk is full")
    call expect(error, "results.h5: no space left on device: ", "a step on a full disk")
    call fill(4096)
    call write_rows(results, step, 0.01_dp*step, bodies, error)
    call expect(error, "what was written before stays readable", "a step on a fuller disk")
    call results%close(error)
    call expect_none(error, "closing on a full disk")
    call check_steps(step - 1)

    call fill(-1)
    call results%open(comm, disk//"/results.h5", run_of("&scene /", 3), error)
    call write_rows(results, 1, 0.01_dp, bodies, error)
    call fill(4096)
    call write_rows(results, 2, 0.02_dp, bodies, error)
    call expect(error, "no space left on device: ", "a step while the disk is full")
    call fill(-1)
    call write_rows(results, 2, 0.02_dp, bodies, error)
    call results%close(error)
    call expect_none(error, "a step once there is room again")
    call check_steps(2)
    if (comm%rank == 0) call remove_file(disk//"/results.h5")
  end subroutine test_results

  !> The results hold exactly these steps, whole.
  subroutine check_steps(n_steps)
    integer, intent(in) :: n_steps
    type(h5_file_t) :: file
    type(error_t), allocatable :: error
    real(dp), allocatable :: velocity(:, :)
    integer(i8) :: n
    integer :: step

    call file%open(comm, disk//"/results.h5", error)
    call check_equal(file%member_count("/steps"), n_steps, "number of steps in the file")
    do step = 1, n_steps
      call file%row_count("/steps/"//to_text(step)//"/bodies/velocity", n, error)
      call check_equal(n, 1000_i8*max(1, comm%size - 1), "rows of a step")
      allocate (velocity(6, n), source=0.0_dp)
      call file%read_rows("/steps/"//to_text(step)//"/bodies/velocity", 0_i8, velocity, error)
      call check(all(velocity < -0.5_dp), "content of a step")
      deallocate (velocity)
    end do
    call file%close(error)
    call expect_none(error, "reading after a full disk")
  end subroutine check_steps

  !> Should a reservation not have helped: a write that fails is an error on all ranks, and groups committed stay.
  subroutine test_without_reservation()
    type(h5_file_t) :: file
    type(error_t), allocatable :: error
    real(dp), allocatable :: x(:)
    integer :: step
    logical :: exists

    allocate (x(20000/comm%size*(1 + comm%rank)), source=1.0_dp)
    call file%create(comm, disk//"/plain.h5", error)
    call file%show(error)
    do step = 1, 100
      call file%begin_group("/"//to_text(step), error)
      call file%write_rows("/"//to_text(step)//"/x", x, error)
      if (allocated(error)) exit
      call file%commit_group(error)
      if (allocated(error)) exit
    end do
    call check(step > 1 .and. step < 100, "groups until the disk is full")
    call check(allocated(error), "an error on a full disk, without reservation")
    if (allocated(error)) deallocate (error)
    call file%close(error)
    call expect_none(error, "closing after a write that failed")
    call file%open(comm, disk//"/plain.h5", error)
    call check_equal(file%member_count("/"), step - 1, "groups in the file")
    x = 0
    call file%read_rows("/"//to_text(step - 1)//"/x", comm%offset(size(x, kind=i8)), x, error)
    call check(all(x > 0.5_dp), "content of the last group")
    call file%close(error)
    call expect_none(error, "reading after a write that failed")
    if (comm%rank == 0) call remove_file(disk//"/plain.h5")

    ! the error shows at once, not only when the group is committed
    call file%create(comm, disk//"/plain.h5", error)
    call file%begin_group("/group", error)
    call fill(4096)
    call file%write_rows("/group/x", x, error)
    call expect(error, "plain.h5: /group/x: cannot write this dataset: is the disk full?", "rows on a full disk")
    call file%discard()
    call fill(-1)
    inquire (file=disk//"/plain.h5", exist=exists)
    call check(.not. exists, "a file that is not whole has no name")
    inquire (file=disk//"/plain.h5.part", exist=exists)
    call check(.not. exists, "a file that was given up is removed")
  end subroutine test_without_reservation

  !> No room even for an empty file.
  subroutine test_create()
    type(h5_file_t) :: file
    type(results_file_t) :: results
    type(error_t), allocatable :: error

    call fill(4096)
    call file%create(comm, disk//"/new.h5", error)
    call expect(error, "no space left on device: ", "a new file on a full disk")
    call check(.not. file%is_open(), "not open")
    call fill(100000)
    call results%open(comm, disk//"/new.h5", run_of(repeat("x", 200000), 2), error)
    call expect(error, "no space left on device: ", "results on a full disk")
    call results%close(error)
    call expect_none(error, "closing results never begun")
    call fill(-1)
    if (comm%rank == 0) call remove_file(disk//"/new.h5")
  end subroutine test_create

  !> The older file stays.
  subroutine test_bodies()
    type(error_t), allocatable :: error
    type(bodies_data_t) :: found
    logical :: exists

    call write_some(10, error)
    call expect_none(error, "bodies on a disk with room")
    call fill(80000)
    call write_some(1000, error)
    call expect(error, "bodies.h5.part: no space left on device: ", "bodies on a full disk")
    inquire (file=disk//"/bodies.h5.part", exist=exists)
    call check(.not. exists, "no unfinished file is left")
    call read_bodies(comm, disk//"/bodies.h5", 3, found, error)
    call expect_none(error, "reading the older bodies")
    call check_equal(found%total, 10_i8*max(1, comm%size - 1), "number of the older bodies")
    call fill(-1)
  end subroutine test_bodies

  subroutine write_some(n, error)
    integer, intent(in) :: n
    type(error_t), allocatable, intent(inout) :: error
    type(body_rows_t) :: bodies
    type(bodies_data_t) :: data

    call make_bodies(n, bodies)
    call allocate_bodies(data, 3, size(bodies%id), .false., "a test", error)
    call allocate_walls(data, 3, 0, "a test", error)
    if (allocated(error)) return
    data%id(:) = bodies%id
    data%position(:, :) = bodies%position
    data%velocity(:, :) = bodies%velocity
    data%radius(:) = bodies%radius
    call write_bodies(comm, disk//"/bodies.h5", data, error)
  end subroutine write_some

  !> The older checkpoint stays, whether it is the table or the commit that fails.
  subroutine test_checkpoint()
    type(checkpoint_file_t) :: file
    type(error_t), allocatable :: error
    integer(i8), allocatable :: records(:, :), counts(:)
    integer(i8) :: step
    logical :: exists

    call write_checkpoint(1_i8, 10, error)
    call expect_none(error, "a checkpoint on a disk with room")
    call fill(100000)
    call write_checkpoint(2_i8, 20000, error)
    call expect(error, "checkpoint.h5.part: no space left on device: ", "a table on a full disk")
    call fill(4096)
    call write_checkpoint(2_i8, 10, error)
    call expect(error, "checkpoint.h5.part: no space left on device: ", "a checkpoint on a full disk")
    inquire (file=disk//"/checkpoint.h5.part", exist=exists)
    call check(.not. exists, "no unfinished checkpoint is left")
    call file%open(comm, disk//"/checkpoint.h5", "grains: 5 steps", error)
    call file%read_scalar("step", step, error)
    call check_equal(step, 1_i8, "the older checkpoint")
    call file%read_table("grains", comm%size, 5, records, counts, error)
    call check_equal(size(records, 2), 10, "its records")
    call file%close(error)
    call expect_none(error, "reading the older checkpoint")
    call fill(-1)
    if (comm%rank == 0) call remove_file(disk//"/checkpoint.h5")
  end subroutine test_checkpoint

  !> n records on each rank.
  subroutine write_checkpoint(step, n, error)
    integer(i8), intent(in) :: step
    integer, intent(in) :: n
    type(error_t), allocatable, intent(inout) :: error
    type(checkpoint_file_t) :: file
    integer(i8), allocatable :: records(:, :)
    integer(i8) :: counts(1)

    counts = n
    allocate (records(5, n), source=step)
    call file%create(comm, disk//"/checkpoint.h5", "grains: 5 steps", error)
    call file%write_scalar("step", step, error)
    call file%write_table("grains", comm%size, records, counts, error)
    call file%commit(error)
  end subroutine write_checkpoint

  !> A table that cannot be copied stays as it was.
  subroutine test_resume()
    type(csv_writer_t) :: table
    type(error_t), allocatable :: error
    integer :: row, before, after
    logical :: exists

    call comm%barrier()
    if (comm%rank > 0) return
    call fill_alone(-1)
    call table%open(disk//"/long.csv", "step,x", error)
    do row = 1, 5000
      call table%add(row)
      call table%add(0.123456789_dp*row)
      call table%end_row(error)
    end do
    call table%close(error)
    inquire (file=disk//"/long.csv", size=before)
    call fill_alone(8192)
    call table%resume(disk//"/long.csv", "step,x", 4000, error)
    call check(allocated(error), "resuming on a full disk: an error")
    if (allocated(error)) then
      call check(index(error%message, disk//"/long.csv.part: cannot write to this file: no space left on device") == 1, &
        & "resuming on a full disk: "//error%message)
      deallocate (error)
    end if
    inquire (file=disk//"/long.csv", size=after)
    call check_equal(after, before, "the table is as it was")
    inquire (file=disk//"/long.csv.part", exist=exists)
    call check(.not. exists, "no part of a table is left")
    call check(.not. table%is_open(), "a table not resumed is not open")
    call fill_alone(-1)
    call table%resume(disk//"/long.csv", "step,x", 4000, error)
    call table%close(error)
    call expect_none(error, "resuming once there is room")
    inquire (file=disk//"/long.csv", size=after)
    call check(after < before, "later rows are gone")
  end subroutine test_resume

  !> The table ends with the last complete row.
  subroutine test_csv()
    type(csv_writer_t) :: table
    type(error_t), allocatable :: error
    character(len=100) :: line
    integer :: row, unit, stat, n

    call fill(4096)
    row = 0
    if (comm%rank == 0) then
      call table%open(disk//"/history.csv", "step,time", error)
      do row = 1, 1000
        call table%add(row)
        call table%add(0.001_dp*row)
        call table%end_row(error)
        if (allocated(error)) exit
      end do
      call check(row > 10 .and. row < 1000, "rows until the disk is full")
    end if
    call comm%agree(error)
    call expect(error, "history.csv: cannot write to this file: no space left on device", "a table on a full disk")
    call table%close(error)
    call expect_none(error, "closing the table")
    if (comm%rank > 0) return
    open (newunit=unit, file=disk//"/history.csv", action="read", status="old")
    n = -1
    do
      read (unit, "(a)", iostat=stat) line
      if (stat /= 0) exit
      n = n + 1
    end do
    close (unit)
    call check_equal(n, row - 1, "rows in the table")
    call check(index(line, to_text(row - 1)//",") == 1, "the last row: "//line)
    call check_equal(len_trim(line), len(to_text(row - 1)//","//to_text(0.001_dp*(row - 1), 17)), "the last row is whole")
  end subroutine test_csv

end program test_io_full_disk
