!> The search direction of the enriched methods, r~ - r + l (v~ - v) = 0 with l >= 0.
module gravier_search_direction
  use gravier_kinds, only: dp
  use gravier_text, only: to_text
  use gravier_method_options, only: method_options_t
  implicit none
  private
  public :: search_direction_t, chosen_direction

  type :: search_direction_t
    !> l, in units of 1/W_aa or in kg
    real(dp) :: value = 1.0_dp
    !> chosen here, not by the input
    logical :: automatic = .false.
    logical :: relative = .true.
    !> l on active contacts only: r_n > 0 for the normal part, |r_t| < mu r_n for the tangential one
    logical :: active_only = .false.
  contains
    procedure :: text => search_direction_text
  end type search_direction_t

contains

  !> The search direction that is asked for, or one that serves on packings (doc/methods.md has the measurements).
  pure type(search_direction_t) function chosen_direction(options, on_active, on_all) result(direction)
    type(method_options_t), intent(in) :: options
    !> l of the method on active contacts and on all where none is given [1/W_aa]
    real(dp), intent(in) :: on_active, on_all

    direction%active_only = options%active_only
    direction%automatic = .not. options%direction_given
    if (direction%automatic) then
      direction%value = merge(on_active, on_all, direction%active_only)
    else
      direction%value = options%direction
      direction%relative = options%direction_relative
    end if
  end function chosen_direction

  !> As the log says it: `l = 1.00E+002/W_aa (automatic), active contacts`.
  function search_direction_text(self) result(text)
    class(search_direction_t), intent(in) :: self
    character(len=:), allocatable :: text

    text = "l = "//to_text(self%value, 3)//trim(merge("/W_aa", " kg  ", self%relative))
    if (self%automatic) text = text//" (automatic)"
    text = text//trim(merge(", active contacts", ", all contacts   ", self%active_only))
  end function search_direction_text

end module gravier_search_direction
