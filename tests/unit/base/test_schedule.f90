!> Schedules: each so many steps, one step, the last step, and the start.
program test_schedule
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_schedule, only: schedule_t
  use gravier_check, only: check, check_equal, finish_checks
  implicit none

  call MPI_Init()
  call check_equal(steps_of(schedule_t()), "", "never by default")
  call check_equal(steps_of(schedule_t(every=3)), " 0 3 6 9", "each third step, from the start on")
  call check_equal(steps_of(schedule_t(every=1)), " 0 1 2 3 4 5 6 7 8 9 10", "each step")
  call check_equal(steps_of(schedule_t(at=4)), " 4", "one step")
  call check_equal(steps_of(schedule_t(last=10)), " 10", "the last step, and not the start")
  call check_equal(steps_of(schedule_t(every=4, last=10)), " 0 4 8 10", "each fourth step and the last one")
  call check_equal(steps_of(schedule_t(every=5, at=3, last=10)), " 0 3 5 10", "all three")
  call finish_checks()
  call MPI_Finalize()

contains

  !> Numbers of the steps up to 10 in which something is due.
  function steps_of(schedule) result(text)
    type(schedule_t), intent(in) :: schedule
    character(len=:), allocatable :: text
    character(len=4) :: number
    integer :: step

    text = ""
    do step = 0, 10
      write (number, "(i0)") step
      if (schedule%due(step)) text = text//" "//trim(number)
    end do
  end function steps_of

end program test_schedule
