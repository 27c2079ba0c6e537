!> Signals become notes that are taken once, and the process lives on.
program test_signals
  use, intrinsic :: iso_c_binding, only: c_int
  use gravier_signals, only: catch_signals, take_signal
  use gravier_check, only: check, finish_checks
  implicit none
  integer(c_int), parameter :: sigusr1 = 10, sigterm = 15

  interface
    integer(c_int) function c_raise(number) bind(C, name="raise")
      import :: c_int
      implicit none
      integer(c_int), value :: number
    end function c_raise
  end interface

  call catch_signals()
  call expect(.false., .false., "nothing before a signal")
  call send(sigusr1)
  call expect(.false., .true., "SIGUSR1")
  call expect(.false., .false., "a note is taken once")
  call send(sigterm)
  call send(sigterm)
  call expect(.true., .false., "SIGTERM twice before it is taken")
  call expect(.false., .false., "both are taken at once")
  call send(sigterm)
  call send(sigusr1)
  call expect(.true., .true., "both signals, a second time each")
  call finish_checks()

contains

  subroutine send(number)
    integer(c_int), intent(in) :: number
    call check(c_raise(number) == 0, "sending a signal")
  end subroutine send

  subroutine expect(stop, checkpoint, name)
    logical, intent(in) :: stop, checkpoint
    character(len=*), intent(in) :: name
    logical :: found_stop, found_checkpoint

    call take_signal(found_stop, found_checkpoint)
    call check(found_stop .eqv. stop, name//": stop")
    call check(found_checkpoint .eqv. checkpoint, name//": checkpoint")
  end subroutine expect

end program test_signals
