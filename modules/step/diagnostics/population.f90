!> How many free grains a scene has had, and what mass, at least and at most since its start: whether it was filled or drained.
module gravier_population
  use gravier_kinds, only: dp, i8
  implicit none
  private
  public :: population_t, population_words, population_record

  !> words of its state
  integer, parameter :: population_words = 4
  !> what they are, in their order: the version of checkpoints, which changes with them
  character(len=*), parameter :: population_record = "fewest most lightest heaviest"

  type :: population_t
    !> free grains
    integer(i8) :: fewest = huge(1_i8), most = -1
    !> their mass [kg]
    real(dp) :: lightest = huge(1.0_dp), heaviest = -1.0_dp
  contains
    procedure :: note => population_note
    procedure :: get_state => population_get_state
    procedure :: set_state => population_set_state
  end type population_t

contains

  !> Take the grains of a step into account, or of the start.
  pure subroutine population_note(self, grains, mass)
    class(population_t), intent(inout) :: self
    integer(i8), intent(in) :: grains
    !> [kg]
    real(dp), intent(in) :: mass

    self%fewest = min(self%fewest, grains)
    self%most = max(self%most, grains)
    self%lightest = min(self%lightest, mass)
    self%heaviest = max(self%heaviest, mass)
  end subroutine population_note

  pure subroutine population_get_state(self, words)
    class(population_t), intent(in) :: self
    integer(i8), intent(out) :: words(population_words)

    words(1) = self%fewest
    words(2) = self%most
    words(3) = transfer(self%lightest, 0_i8)
    words(4) = transfer(self%heaviest, 0_i8)
  end subroutine population_get_state

  pure subroutine population_set_state(self, words)
    class(population_t), intent(inout) :: self
    integer(i8), intent(in) :: words(population_words)

    self%fewest = words(1)
    self%most = words(2)
    self%lightest = transfer(words(3), 0.0_dp)
    self%heaviest = transfer(words(4), 0.0_dp)
  end subroutine population_set_state

end module gravier_population
