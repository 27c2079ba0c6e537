!> Requests that reach a run as signals: SIGTERM asks it to stop, SIGUSR1 to write a checkpoint. The handlers only leave
!> a note, which the time loop takes when it likes. A write that nobody reads, or that is beyond the limit of a file, does not end
!> the process by SIGPIPE or SIGXFSZ: it fails, and whoever writes learns of it. What other signals do is left as it is.
module gravier_signals
  use, intrinsic :: iso_c_binding, only: c_int, c_intptr_t, c_funptr, c_funloc
  use gravier_kinds, only: i8
  implicit none
  private
  public :: catch_signals, release_signals, take_signals

  ! Linux numbers
  integer(c_int), parameter :: sigusr1 = 10, sigpipe = 13, sigterm = 15, sigxfsz = 25
  !> SIG_IGN, as an address
  integer(c_intptr_t), parameter :: ignore = 1
  !> SIGTERM arrived since take_signals was called last
  logical, volatile :: stop_asked = .false.
  !> SIGUSR1 that arrived since the start
  integer(i8), volatile :: checkpoints_asked = 0
  !> what SIGTERM, SIGUSR1, SIGPIPE and SIGXFSZ did before
  type(c_funptr) :: before(4)

  interface
    type(c_funptr) function c_signal(number, action) bind(C, name="signal")
      import :: c_int, c_funptr
      implicit none
      integer(c_int), value :: number
      type(c_funptr), value :: action
    end function c_signal
  end interface

contains

  !> Note SIGTERM and SIGUSR1 from now on instead of dying of them; none is noted yet. Interrupted system calls go on.
  subroutine catch_signals()
    stop_asked = .false.
    checkpoints_asked = 0
    before(1) = c_signal(sigterm, c_funloc(ask_stop))
    before(2) = c_signal(sigusr1, c_funloc(ask_checkpoint))
    before(3) = c_signal(sigpipe, transfer(ignore, before(3)))
    before(4) = c_signal(sigxfsz, transfer(ignore, before(4)))
  end subroutine catch_signals

  !> Let these signals do again what they did before catch_signals.
  subroutine release_signals()
    type(c_funptr) :: ignored

    ignored = c_signal(sigterm, before(1))
    ignored = c_signal(sigusr1, before(2))
    ignored = c_signal(sigpipe, before(3))
    ignored = c_signal(sigxfsz, before(4))
  end subroutine release_signals

  !> Whether this process was asked to stop since the last call, and how many times it was asked for a checkpoint since
  !> catch_signals. Not collective: a launcher may signal one rank only, or several, of which one learns of it a step after
  !> another, so that the ranks have to agree before they act. The largest count of a rank grows once a request.
  subroutine take_signals(stop, checkpoints)
    logical, intent(out) :: stop
    integer(i8), intent(out) :: checkpoints

    stop = stop_asked
    if (stop) stop_asked = .false.
    checkpoints = checkpoints_asked
  end subroutine take_signals

  subroutine ask_stop(number) bind(C)
    integer(c_int), value :: number
    stop_asked = number == sigterm
  end subroutine ask_stop

  subroutine ask_checkpoint(number) bind(C)
    integer(c_int), value :: number
    if (number == sigusr1) checkpoints_asked = checkpoints_asked + 1
  end subroutine ask_checkpoint

end module gravier_signals
