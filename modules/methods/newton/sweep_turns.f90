!> How long Newton's method sweeps, and how many of its own steps it makes before it sweeps again.
!>
!> Sweeps and steps take turns. In the first turns sweeps are accelerated and end where a window of them brings little; the windows
!> double from turn to turn. In later turns sweeps are plain, and their number doubles: where accelerated sweeps oscillate, plain
!> ones still progress slowly.
module gravier_sweep_turns
  use gravier_kinds, only: dp
  implicit none
  private
  public :: sweep_turns_t

  !> turns of accelerated sweeps; in later ones they are plain
  integer, parameter :: accelerated_turns = 3
  !> iterations of a window of sweeps in the first turn, doubled in the next ones; what is left of its least change if they do well
  integer, parameter :: first_window = 100
  real(dp), parameter :: little_gain = 0.5_dp
  !> plain sweeps of the first turn that has them, doubled from turn to turn, so often at most
  integer, parameter :: plain_sweeps = 4000, most_doublings = 6
  !> Newton's steps without progress that end the first turn, doubled in the next ones, and those that end a turn of plain sweeps
  integer, parameter :: first_patience = 100, late_patience = 40

  type :: sweep_turns_t
    !> turns that are over; sweeps of this one
    integer, private :: turn = 0, taken = 0
    !> lowest change of this window of sweeps and of the last [N^2 s^2]
    real(dp), private :: lowest = huge(1.0_dp), last_lowest = huge(1.0_dp)
  contains
    procedure :: accelerate => sweep_turns_accelerate
    procedure :: patience => sweep_turns_patience
    procedure :: count_sweep => sweep_turns_count_sweep
    procedure :: finish => sweep_turns_finish
  end type sweep_turns_t

contains

  !> Whether the sweeps of this turn are accelerated.
  pure logical function sweep_turns_accelerate(self) result(accelerate)
    class(sweep_turns_t), intent(in) :: self
    accelerate = self%turn < accelerated_turns
  end function sweep_turns_accelerate

  !> Newton's steps without progress after which sweeps come next.
  pure integer function sweep_turns_patience(self) result(patience)
    class(sweep_turns_t), intent(in) :: self
    patience = merge(first_patience*2**min(self%turn, accelerated_turns), late_patience, self%accelerate())
  end function sweep_turns_patience

  !> Take note of a sweep.
  pure subroutine sweep_turns_count_sweep(self, change, over)
    class(sweep_turns_t), intent(inout) :: self
    !> |r - y|^2 by it, of accelerated sweeps [N^2 s^2]
    real(dp), intent(in) :: change
    !> whether windows of sweeps have come to bring little, or the plain sweeps of a turn are done
    logical, intent(out) :: over

    over = .false.
    self%taken = self%taken + 1
    if (.not. self%accelerate()) then
      over = self%taken == plain_sweeps*2**min(self%turn - accelerated_turns, most_doublings)
      return
    end if
    self%lowest = min(self%lowest, change)
    if (mod(self%taken, first_window*2**self%turn) /= 0) return
    over = self%lowest > little_gain**2*self%last_lowest
    self%last_lowest = self%lowest
    self%lowest = huge(1.0_dp)
  end subroutine sweep_turns_count_sweep

  !> The next turn begins.
  pure subroutine sweep_turns_finish(self)
    class(sweep_turns_t), intent(inout) :: self

    self%turn = self%turn + 1
    self%taken = 0
    self%lowest = huge(1.0_dp)
    self%last_lowest = huge(1.0_dp)
  end subroutine sweep_turns_finish

end module gravier_sweep_turns
