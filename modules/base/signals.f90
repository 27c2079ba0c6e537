!> Requests that reach a run as signals: SIGTERM asks it to stop, SIGUSR1 to write a checkpoint. The handlers only leave
!> a note, which the time loop takes when it likes; what other signals do is left as it is.
module gravier_signals
  use, intrinsic :: iso_c_binding, only: c_int, c_funptr, c_funloc
  implicit none
  private
  public :: catch_signals, take_signal

  ! Linux numbers
  integer(c_int), parameter :: sigusr1 = 10, sigterm = 15
  !> what arrived since take_signal was called last
  logical, volatile :: stop_asked = .false., checkpoint_asked = .false.

  interface
    type(c_funptr) function c_signal(number, action) bind(C, name="signal")
      import :: c_int, c_funptr
      implicit none
      integer(c_int), value :: number
      type(c_funptr), value :: action
    end function c_signal
  end interface

contains

  !> Note SIGTERM and SIGUSR1 from now on instead of dying of them. Interrupted system calls go on.
  subroutine catch_signals()
    type(c_funptr) :: ignored

    ignored = c_signal(sigterm, c_funloc(ask_stop))
    ignored = c_signal(sigusr1, c_funloc(ask_checkpoint))
  end subroutine catch_signals

  !> Whether this process was asked to stop, or to write a checkpoint, since the last call. Not collective: a launcher
  !> may signal one rank only, or several at different times, so that the ranks have to agree before they act.
  subroutine take_signal(stop, checkpoint)
    logical, intent(out) :: stop, checkpoint

    stop = stop_asked
    if (stop) stop_asked = .false.
    checkpoint = checkpoint_asked
    if (checkpoint) checkpoint_asked = .false.
  end subroutine take_signal

  subroutine ask_stop(number) bind(C)
    integer(c_int), value :: number
    stop_asked = number == sigterm
  end subroutine ask_stop

  subroutine ask_checkpoint(number) bind(C)
    integer(c_int), value :: number
    checkpoint_asked = number == sigusr1
  end subroutine ask_checkpoint

end module gravier_signals
