!> Whether passes over layers (gravier_layered_start) are tried in a scene: where some were given up one after the other, as in a
!> flow, in which no load waits to be carried, the solves of the next steps make none (exponential backoff).
module gravier_pass_backoff
  use gravier_kinds, only: i8
  use gravier_narrow, only: narrow
  implicit none
  private
  public :: pass_backoff_t, pass_backoff_words, pass_backoff_record

  !> words of its state
  integer, parameter :: pass_backoff_words = 2
  !> what they are, in their order: the version of checkpoints, which changes with them
  character(len=*), parameter :: pass_backoff_record = "given_up next_step"
  !> So many passes may be given up one after the other without a pause, because a scene that settles keeps one pass in several.
  integer, parameter :: patience = 4
  !> The next pass that is given up is followed by `first_pause` steps without a pass. Each further one is followed by twice as
  !> many, and by `longest_pause` at most.
  integer, parameter :: first_pause = 2, longest_pause = 64

  type :: pass_backoff_t
    private
    !> passes given up since the last one that a solve went on from; it stays as it is once the pause is longest
    integer :: given_up = 0
    !> step from which on a pass may be tried
    integer :: next_step = 0
  contains
    procedure :: allows => pass_backoff_allows
    procedure :: note => pass_backoff_note
    procedure :: get_state => pass_backoff_get_state
    procedure :: set_state => pass_backoff_set_state
  end type pass_backoff_t

contains

  !> Whether the solve of a step may try a pass.
  pure logical function pass_backoff_allows(self, step) result(allows)
    class(pass_backoff_t), intent(in) :: self
    integer, intent(in) :: step

    allows = step >= self%next_step
  end function pass_backoff_allows

  !> Take note of the solve of a step: whether it tried a pass, and went on from it.
  pure subroutine pass_backoff_note(self, step, tried, kept)
    class(pass_backoff_t), intent(inout) :: self
    integer, intent(in) :: step
    logical, intent(in) :: tried, kept

    if (.not. tried) return
    if (kept) then
      self%given_up = 0
    else if (self%given_up < patience) then
      self%given_up = self%given_up + 1
    else
      self%next_step = step + 1 + min(longest_pause, first_pause*2**(self%given_up - patience))
      if (self%next_step <= step + longest_pause) self%given_up = self%given_up + 1
    end if
  end subroutine pass_backoff_note

  pure subroutine pass_backoff_get_state(self, words)
    class(pass_backoff_t), intent(in) :: self
    integer(i8), intent(out) :: words(pass_backoff_words)

    words(1) = self%given_up
    words(2) = self%next_step
  end subroutine pass_backoff_get_state

  pure subroutine pass_backoff_set_state(self, words)
    class(pass_backoff_t), intent(inout) :: self
    integer(i8), intent(in) :: words(pass_backoff_words)

    self%given_up = narrow(words(1))
    self%next_step = narrow(words(2))
  end subroutine pass_backoff_set_state

end module gravier_pass_backoff
