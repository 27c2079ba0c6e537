!> What all formats of bodies files share: which rows a rank reads, unit vectors of any size, identifiers that appear twice; and the
!> lock of a place where a program writes.
program test_io_bodies_data
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, status_input
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_bodies_data, only: bodies_data_t, allocate_bodies, allocate_walls, find_own_rows, data_bytes, make_unit, &
    & check_unique_ids
  use gravier_output_lock, only: output_lock_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  type(communicator_t) :: comm

  call start_parallel()
  call comm%init()
  call check_rows(0_i8)
  call check_rows(3_i8)
  call check_rows(1001_i8)
  call check_units()
  call check_identifiers()
  call check_lock()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> Blocks of rows follow on each other, are all rows, and differ by one at most.
  subroutine check_rows(total)
    integer(i8), intent(in) :: total
    type(error_t), allocatable :: error
    integer(i8) :: first
    integer :: n

    call find_own_rows(comm, total, 2, "rows", first, n, error)
    call check(.not. allocated(error), "rows of a rank")
    call check_equal(first, comm%offset(int(n, i8)), "they begin where those of the ranks before end")
    call check_equal(comm%total(int(n, i8)), total, "all rows are somebody's")
    call check(comm%highest(real(n, dp)) + comm%highest(-real(n, dp)) <= 1.0_dp, "blocks differ by one row at most")
  end subroutine check_rows

  !> Vectors whose squares have no number have a direction all the same; the zero vector has none.
  subroutine check_units()
    real(dp) :: v(2)
    integer :: k
    real(dp), parameter :: sizes(3) = [1.0e-300_dp, 1.0_dp, 1.0e300_dp]
    logical :: possible

    do k = 1, size(sizes)
      v(1) = -3.0_dp*sizes(k)
      v(2) = 4.0_dp*sizes(k)
      call make_unit(v, possible)
      call check(possible, "a vector has a direction")
      call check_close(maxval(abs(v - [-0.6_dp, 0.8_dp])), 0.0_dp, 4*epsilon(1.0_dp), "its direction")
    end do
    v(:) = 0.0_dp
    call make_unit(v, possible)
    call check(.not. possible, "no vector, no direction")
  end subroutine check_units

  !> The least identifier that appears twice is named, wherever its rows are, and whether bodies or walls have it.
  subroutine check_identifiers()
    integer, parameter :: n = 5
    type(bodies_data_t) :: bodies
    type(error_t), allocatable :: error
    integer :: k

    call allocate_bodies(bodies, 3, n, .true., "bodies", error)
    call allocate_walls(bodies, 3, 1, "bodies", error)
    call check_equal(size(bodies%velocity, 1), 6, "velocities and spins in space")
    call check(all(abs(bodies%velocity) <= 0.0_dp) .and. all(bodies%group == 0) .and. all(bodies%material == 1), &
      & "bodies at rest, free, of the first material")
    call check(data_bytes(3) > data_bytes(2), "spheres take more than disks")
    bodies%wall_id(1) = 1000
    do k = 1, n
      bodies%id(k) = 100*k + comm%rank
    end do
    call check_unique_ids(comm, "bodies", bodies, error)
    call check(.not. allocated(error), "identifiers of their own")
    ! on the last rank, a body as the wall and one as another body
    if (comm%rank == comm%size - 1) bodies%id(4:5) = [1000_i8, 200_i8]
    call check_unique_ids(comm, "bodies", bodies, error)
    call check(allocated(error), "identifiers that appear twice")
    if (.not. allocated(error)) return
    call check_equal(error%status, status_input, "are bad input")
    call check(index(error%message, "id "//to_text(200)//" ") > 0, "the least one is named: "//error%message)
  end subroutine check_identifiers

  !> A lock is taken, says who holds it, can be given back and taken again; a place that is not there cannot be locked.
  subroutine check_lock()
    type(output_lock_t) :: lock
    type(error_t), allocatable :: error
    integer :: length
    logical :: is_there

    call lock%take_file(comm, "locked.txt", "the test of locks", error)
    call check(.not. allocated(error), "a lock")
    ! a process that opens and closes the file of its own lock gives the lock back: it is not read here
    inquire (file=".locked.txt.lock", exist=is_there, size=length)
    if (comm%rank == 0) call check(is_there .and. length > 0, "a file beside the one that is locked says who holds it")
    call lock%release()
    call lock%take_directory(comm, ".", "the test of locks", error)
    call check(.not. allocated(error), "the lock of the directory")
    call lock%release()
    call lock%take_directory(comm, "./no_such_directory", "the test of locks", error)
    call check(allocated(error), "there is no lock of a directory that is not there")
  end subroutine check_lock

end program test_io_bodies_data
