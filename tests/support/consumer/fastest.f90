!> A diagnostic of one's own: the largest speed of a free grain, in each step.
module fastest
  use gravier_kinds, only: dp
  use gravier_diagnostic, only: diagnostic_t, diagnostic_features_t, solved_step_t, column_list_t
  implicit none
  private
  public :: fastest_t

  type, extends(diagnostic_t) :: fastest_t
    !> the same on every rank [m/s]
    real(dp) :: speed = 0.0_dp
  contains
    procedure, nopass :: features => fastest_features
    procedure :: measure => fastest_measure
    procedure :: columns => fastest_columns
  end type fastest_t

contains

  pure function fastest_features() result(features)
    type(diagnostic_features_t) :: features

    features%key = "fastest"
    features%meaning = "write the largest speed of a free grain"
  end function fastest_features

  subroutine fastest_measure(self, step)
    class(fastest_t), intent(inout) :: self
    type(solved_step_t), intent(in) :: step
    real(dp) :: speed
    integer :: s, k

    speed = 0.0_dp
    do s = 1, size(step%decomposition%owned)
      associate (owned => step%decomposition%owned(s))
        do k = 1, owned%n
          if (owned%glued(k) == 0) speed = max(speed, norm2(owned%velocity(1:owned%nd, k)))
        end do
      end associate
    end do
    self%speed = step%decomposition%comm%highest(speed)
  end subroutine fastest_measure

  subroutine fastest_columns(self, list)
    class(fastest_t), intent(in) :: self
    type(column_list_t), intent(inout) :: list

    call list%add("fastest_grain", self%speed)
  end subroutine fastest_columns

end module fastest
