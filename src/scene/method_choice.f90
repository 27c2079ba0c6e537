!> From the input to a method and to the one that takes over where it stagnates: the options of &solver and &enriched.
module gravier_method_choice
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_effects, only: effects_t
  use gravier_config_types, only: config_t
  use gravier_method_options, only: method_options_t, method_features_t
  use gravier_method_registry, only: make_method, features_of, quoted_names, with_moments
  use gravier_method, only: method_t
  use gravier_fallback, only: fallback_t
  implicit none
  private
  public :: choose_scheme, choose_fallback, check_moments

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

  !> Make the method that takes over solves of the first one that stagnate, where there is to be one.
  subroutine choose_fallback(config, fallback)
    type(config_t), intent(in) :: config
    type(fallback_t), intent(inout) :: fallback
    type(method_options_t) :: options

    call fallback%free()
    associate (solver => config%solver)
      if (solver%fallback == "none" .or. solver%fallback == solver%method) return
      fallback%most_contacts = solver%fallback_contacts
      options%sweeps = solver%sweeps
      call make_method(trim(solver%fallback), options, fallback%method)
    end associate
  end subroutine choose_fallback

  !> Some methods, and files of FCLIB, are for two or three components a contact.
  subroutine check_moments(config, effects, error)
    type(config_t), intent(in) :: config
    type(effects_t), intent(in) :: effects
    type(error_t), allocatable, intent(inout) :: error
    type(method_features_t) :: features

    if (.not. effects%rolling) return
    features = features_of(trim(config%solver%method))
    if (.not. features%moments) call raise(error, status_input, config%file//": &solver method = '"//trim(config%solver%method)// &
      & "': expected "//quoted_names(with_moments, "'", "or")//" with rolling or pivoting friction")
    if (config%output%fclib_step > 0) call raise(error, status_input, config%file//": &output fclib_step = "// &
      & to_text(config%output%fclib_step)//": expected 0 with rolling or pivoting friction, which a file of FCLIB cannot say")
  end subroutine check_moments

end module gravier_method_choice
