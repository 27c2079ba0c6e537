!> Memory: arrays that are too large are an error, not the end of the program, and amounts read well.
program test_room
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, status_failure
  use gravier_room, only: make_room, free_memory, process_limit, bytes_text
  use gravier_check, only: check, check_equal, finish_checks
  implicit none
  !> more than addresses reach
  integer(i8), parameter :: too_many = 2_i8**58
  integer(i8), allocatable :: words(:), rows(:, :)
  real(dp), allocatable :: reals(:), columns(:, :)
  integer, allocatable :: numbers(:)
  type(error_t), allocatable :: error

  call MPI_Init()
  call make_room(rows, 3, 4_i8, "rows", error)
  call check_equal(size(rows), 12, "room for rows")
  call check(all(rows == 0), "zeros")
  call make_room(words, too_many, "file: words", error)
  call expect("file: words: out of memory: 2.3 EB cannot be had")
  call make_room(rows, 2, too_many/2, "rows", error)
  call expect("rows: out of memory: 2.3 EB cannot be had")
  call make_room(reals, too_many, "reals", error)
  call expect("reals: out of memory: 2.3 EB cannot be had")
  call make_room(columns, 2, too_many/2, "columns", error)
  call expect("columns: out of memory: 2.3 EB cannot be had")
  call make_room(numbers, too_many, "numbers", error)
  call expect("numbers: out of memory: 1.2 EB cannot be had")
  call check_equal(size(words) + size(rows) + size(reals) + size(columns) + size(numbers), 0, "what failed is empty")
  call check(free_memory() > 2_i8**20, "some memory is free")
  call check(process_limit() > 2_i8**20, "and a process may have it")
  call check_equal(bytes_text(0.0_dp), "0.0 kB", "none")
  call check_equal(bytes_text(1.26e6_dp), "1.3 MB", "megabytes")
  call check_equal(bytes_text(999.96e6_dp), "1.0 GB", "nearly the next unit")
  call check_equal(bytes_text(5.5e11_dp), "550.0 GB", "gigabytes")
  call check_equal(bytes_text(1.0e24_dp), "1000000.0 EB", "beyond all units")
  call finish_checks()
  call MPI_Finalize()

contains

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
