!> Whether the impulses in a column of equal grains are known: each contact bears what is above it, at rest under gravity alone.
module gravier_known_column
  use gravier_kinds, only: dp
  use gravier_config_types, only: config_t, boundary_config_t
  implicit none
  private
  public :: what_else_acts

contains

  !> What acts on the column of a case beside gravity, in words that begin with "where"; empty where nothing does. Of several things
  !> the function names one. It does not look at the direction of gravity.
  pure function what_else_acts(config) result(words)
    type(config_t), intent(in) :: config
    character(len=:), allocatable :: words
    integer :: b

    words = ""
    do b = 1, size(config%boundaries)
      if (.not. is_ground_at_rest(config%boundaries(b))) words = "where there is a boundary beside the ground, or the ground "// &
        & "moves or goes away"
    end do
    if (config%scene%gravity_table /= "" .or. any(abs(config%scene%body_force) > 0.0_dp)) &
      & words = "where a gravity_table or a body_force acts"
    if (size(config%laws) > 0) words = "where there is a &law"
    if (size(config%insertions) > 0) words = "where grains enter"
  end function what_else_acts

  !> Whether a boundary names the ground of the column, and leaves it where it is.
  pure logical function is_ground_at_rest(boundary)
    type(boundary_config_t), intent(in) :: boundary

    is_ground_at_rest = boundary%shape == "wall" .and. .not. (boundary%remove_at_given .or. boundary%table /= "" .or. &
      & any(boundary%free) .or. boundary%frequency > 0.0_dp .or. &
      & any(abs(boundary%velocity) > 0.0_dp) .or. any(abs(boundary%rotation) > 0.0_dp))
  end function is_ground_at_rest

end module gravier_known_column
