!> Memory: arrays that are too large are an error, not the end of the program, and amounts read well.
program test_room
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, status_failure
  use gravier_file_system, only: make_directory, remove_file
  use gravier_room, only: room_for, free_memory, group_memory, process_limit, bytes_text
  use gravier_check, only: check, check_equal, finish_checks
  implicit none
  !> more than addresses reach
  integer(i8), parameter :: too_many = 2_i8**58
  type(error_t), allocatable :: error

  call MPI_Init()
  call check_equal(room_for(4_i8, 24, "rows", error), 4_i8, "room for rows")
  call check_equal(room_for(0_i8, 8, "rows", error), 0_i8, "room for none")
  call check(.not. allocated(error), "no error")
  call check_equal(room_for(too_many, 8, "file: words", error), 0_i8, "no room")
  call check_equal(room_for(4_i8, 24, "rows", error), 0_i8, "no room after an error")
  call expect("file: words: out of memory: 2.3 EB could not be allocated")
  call check_equal(room_for(too_many, 4, "numbers", error), 0_i8, "no room for small ones")
  call expect("numbers: out of memory: 1.2 EB could not be allocated")
  call check_equal(room_for(huge(too_many), 16, "more than can be counted", error), 0_i8, "no room for so many")
  call expect("more than can be counted: out of memory: 147.6 EB could not be allocated")
  call check(free_memory() > 2_i8**20, "some memory is free")
  call check(process_limit() > 2_i8**20, "and a process may have it")
  call test_groups()
  call check_equal(bytes_text(0.0_dp), "0.0 kB", "none")
  call check_equal(bytes_text(1.26e6_dp), "1.3 MB", "megabytes")
  call check_equal(bytes_text(999.96e6_dp), "1.0 GB", "nearly the next unit")
  call check_equal(bytes_text(5.5e11_dp), "550.0 GB", "gigabytes")
  call check_equal(bytes_text(1.0e24_dp), "1.0E+06 EB", "beyond all units")
  call check_equal(bytes_text(1.0e22_dp), "1.0E+04 EB", "ten thousand of the largest unit")
  call finish_checks()
  call MPI_Finalize()

contains

  !> Control groups: what files take in memory is free, in both versions.
  subroutine test_groups()
    character(len=*), parameter :: names(5) = [character(len=21) :: "memory.max", "memory.current", "memory.stat", &
      & "memory.limit_in_bytes", "memory.usage_in_bytes"]
    integer :: k

    call make_directory("group", error)
    do k = 1, size(names)
      call remove_file("group/"//trim(names(k)))
    end do
    call check_equal(group_memory("group", 1), huge(1_i8), "no group has no limit")
    call write_line("group/memory.max", "max")
    call check_equal(group_memory("group", 1), huge(1_i8), "a group without a limit")
    call write_line("group/memory.max", "8000000000")
    call write_line("group/memory.current", "7000000000")
    call check_equal(group_memory("group", 1), 1000000000_i8, "without statistics")
    call write_line("group/memory.stat", "anon 900"//new_line("a")//"inactive_file 5000000000"//new_line("a")// &
      & "active_file 1000000")
    call check_equal(group_memory("group", 1), 6001000000_i8, "files in memory are given back")
    call write_line("group/memory.limit_in_bytes", "100")
    call write_line("group/memory.usage_in_bytes", "90")
    call write_line("group/memory.stat", "inactive_file 1"//new_line("a")//"total_inactive_file 20"//new_line("a")// &
      & "total_active_file 5")
    call check_equal(group_memory("group", 2), 35_i8, "the first version")
  end subroutine test_groups

  subroutine write_line(path, text)
    character(len=*), intent(in) :: path, text
    integer :: unit

    open (newunit=unit, file=path, action="write", status="replace")
    write (unit, "(a)") text
    close (unit)
  end subroutine write_line

  !> The same error is wanted; it is taken away.
  subroutine expect(message)
    character(len=*), intent(in) :: message

    call check(allocated(error), message)
    if (.not. allocated(error)) return
    call check_equal(error%message, message, "message")
    call check_equal(error%status, status_failure, "status")
    deallocate (error)
  end subroutine expect

end program test_room
