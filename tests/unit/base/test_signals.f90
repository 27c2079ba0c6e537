!> Signals become notes, and the process lives on: a request to stop is taken once, those for checkpoints are counted.
program test_signals
  use, intrinsic :: iso_c_binding, only: c_int, c_funloc, c_funptr
  use gravier_kinds, only: i8
  use gravier_signals, only: catch_signals, release_signals, take_signals
  use gravier_check, only: check, finish_checks
  implicit none
  integer(c_int), parameter :: sigusr1 = 10, sigterm = 15
  integer, volatile :: notes = 0

  interface
    type(c_funptr) function c_signal(number, action) bind(C, name="signal")
      import :: c_int, c_funptr
      implicit none
      integer(c_int), value :: number
      type(c_funptr), value :: action
    end function c_signal

    integer(c_int) function c_raise(number) bind(C, name="raise")
      import :: c_int
      implicit none
      integer(c_int), value :: number
    end function c_raise
  end interface

  call catch_signals()
  call expect(.false., 0_i8, "nothing before a signal")
  call send(sigusr1)
  call expect(.false., 1_i8, "SIGUSR1")
  call expect(.false., 1_i8, "the count stays")
  call send(sigterm)
  call send(sigterm)
  call expect(.true., 1_i8, "SIGTERM twice before it is taken")
  call expect(.false., 1_i8, "both are taken at once")
  call send(sigterm)
  call send(sigusr1)
  call expect(.true., 2_i8, "both signals, a second time each")
  call send(sigterm)
  call catch_signals()
  call expect(.false., 0_i8, "nothing of another run")
  call test_release()
  call finish_checks()

contains

  !> What a program had asked for before holds again.
  subroutine test_release()
    type(c_funptr) :: ignored

    call release_signals()
    ignored = c_signal(sigterm, c_funloc(take_note))
    call catch_signals()
    call send(sigterm)
    call expect(.true., 0_i8, "caught in a run")
    call check(notes == 0, "the program is not told")
    call release_signals()
    call send(sigterm)
    call expect(.false., 0_i8, "not caught after the run")
    call check(notes == 1, "the program is told again")
  end subroutine test_release

  subroutine take_note(number) bind(C)
    integer(c_int), value :: number
    if (number == sigterm) notes = notes + 1
  end subroutine take_note

  subroutine send(number)
    integer(c_int), intent(in) :: number
    call check(c_raise(number) == 0, "sending a signal")
  end subroutine send

  subroutine expect(stop, checkpoints, name)
    logical, intent(in) :: stop
    integer(i8), intent(in) :: checkpoints
    character(len=*), intent(in) :: name
    logical :: found_stop
    integer(i8) :: found_checkpoints

    call take_signals(found_stop, found_checkpoints)
    call check(found_stop .eqv. stop, name//": stop")
    call check(found_checkpoints == checkpoints, name//": checkpoints")
  end subroutine expect

end program test_signals
