!> Whether something costly is tried where it has been in vain: exponential backoff. Passes over layers (gravier_layered_start) are
!> given up in flows, in which no load waits to be carried; a second method (gravier_fallback) fails where friction leaves
!> velocities undetermined. Turns are the steps of a run, or the solves that a second method might take over.
module gravier_backoff
  use gravier_kinds, only: i8
  use gravier_narrow, only: narrow
  implicit none
  private
  public :: backoff_t, backoff_words, backoff_record

  !> words of its state
  integer, parameter :: backoff_words = 2
  !> what they are, in their order: the version of checkpoints, which changes with them
  character(len=*), parameter :: backoff_record = "given_up next_turn"
  !> So many tries may be in vain one after the other without a pause: a scene that settles keeps one pass in several.
  integer, parameter :: patience = 4
  !> The next one in vain is followed by `first_pause` turns without a try. Each further one is followed by twice as many, and by
  !> `longest_pause` at most.
  integer, parameter :: first_pause = 2, longest_pause = 64

  type :: backoff_t
    !> tries in vain that one of use makes good; by default all
    integer :: forgiven = huge(1)
    !> tries in vain that are not made good; it stays as it is once the pause is longest
    integer, private :: given_up = 0
    !> turn from which on there may be a try
    integer, private :: next_turn = 0
  contains
    procedure :: allows => backoff_allows
    procedure :: note => backoff_note
    procedure :: get_state => backoff_get_state
    procedure :: set_state => backoff_set_state
  end type backoff_t

contains

  !> Whether there may be a try in this turn.
  pure logical function backoff_allows(self, turn) result(allows)
    class(backoff_t), intent(in) :: self
    integer, intent(in) :: turn

    allows = turn >= self%next_turn
  end function backoff_allows

  !> Take note of a turn: whether there was a try, and whether it was of use.
  pure subroutine backoff_note(self, turn, tried, kept)
    class(backoff_t), intent(inout) :: self
    integer, intent(in) :: turn
    logical, intent(in) :: tried, kept

    if (.not. tried) return
    if (kept) then
      self%given_up = max(self%given_up - self%forgiven, 0)
    else if (self%given_up < patience) then
      self%given_up = self%given_up + 1
    else
      self%next_turn = turn + 1 + min(longest_pause, first_pause*2**(self%given_up - patience))
      if (self%next_turn <= turn + longest_pause) self%given_up = self%given_up + 1
    end if
  end subroutine backoff_note

  pure subroutine backoff_get_state(self, words)
    class(backoff_t), intent(in) :: self
    integer(i8), intent(out) :: words(backoff_words)

    words(1) = self%given_up
    words(2) = self%next_turn
  end subroutine backoff_get_state

  pure subroutine backoff_set_state(self, words)
    class(backoff_t), intent(inout) :: self
    integer(i8), intent(in) :: words(backoff_words)

    self%given_up = narrow(words(1))
    self%next_turn = narrow(words(2))
  end subroutine backoff_set_state

end module gravier_backoff
