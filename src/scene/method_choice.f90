!> From the input to a method: the options of &solver and &enriched.
module gravier_method_choice
  use gravier_config_types, only: config_t
  use gravier_method_options, only: method_options_t
  use gravier_method_registry, only: make_method
  use gravier_method, only: method_t
  implicit none
  private
  public :: choose_scheme

contains

  !> Make the method that &solver and &enriched ask for.
  subroutine choose_scheme(config, method)
    type(config_t), intent(in) :: config
    class(method_t), allocatable, intent(out) :: method
    type(method_options_t) :: options

    associate (solver => config%solver, enriched => config%enriched)
      options%sweeps = solver%sweeps
      options%acceleration = solver%acceleration == "momentum"
      options%relaxation_given = solver%relaxation_given
      options%relaxation = solver%relaxation
      options%active_only = enriched%contacts == "active"
      options%direction_given = enriched%direction_given
      options%direction_relative = enriched%direction_unit == "relative"
      options%direction = enriched%direction
      options%interface_cg = enriched%interface == "cg"
      options%cg_tolerance = enriched%cg_tolerance
      options%cg_max_iterations = enriched%cg_max_iterations
      call make_method(trim(solver%method), options, method)
    end associate
  end subroutine choose_scheme

end module gravier_method_choice
