!> The one place where a method is chosen.
module gravier_scheme_choice
  use gravier_config_types, only: config_t, enriched_config_t
  use gravier_scheme, only: scheme_t
  use gravier_nlgs, only: nlgs_t
  use gravier_nscdd, only: nscdd_t
  use gravier_nscdd_ep, only: nscdd_ep_t
  use gravier_newton, only: newton_t
  use gravier_schwarz, only: schwarz_t
  use gravier_schwarz_ec, only: schwarz_ec_t
  use gravier_enriched_matrix, only: search_direction_t
  use gravier_interface_problem, only: interface_solver_t
  use gravier_interface_cg, only: interface_cg_t
  use gravier_interface_direct, only: interface_direct_t
  implicit none
  private
  public :: choose_scheme

contains

  !> Make the method that &solver and &enriched ask for.
  subroutine choose_scheme(config, scheme)
    type(config_t), intent(in) :: config
    class(scheme_t), allocatable, intent(out) :: scheme
    type(nscdd_ep_t), allocatable :: dual
    type(schwarz_t), allocatable :: schwarz
    type(schwarz_ec_t), allocatable :: corrected

    select case (config%solver%method)
    case ("schwarz")
      allocate (schwarz)
      schwarz%relaxation = config%solver%relaxation
      call move_alloc(schwarz, scheme)
    case ("schwarz_ec")
      allocate (corrected)
      corrected%relaxation = config%solver%relaxation
      corrected%matrix%direction = direction_of(config%enriched)
      call move_alloc(corrected, scheme)
    case ("nscdd")
      allocate (nscdd_t :: scheme)
    case ("nscdd_ep")
      allocate (dual)
      dual%matrix%direction = direction_of(config%enriched)
      call choose_interface_solver(config%enriched, dual%interface_solver)
      call move_alloc(dual, scheme)
    case ("newton")
      allocate (newton_t :: scheme)
    case default
      allocate (nlgs_t :: scheme)
    end select
    scheme%sweeps = config%solver%sweeps
    scheme%momentum%on = config%solver%acceleration == "momentum" .or. config%solver%method == "newton"
  end subroutine choose_scheme

  pure type(search_direction_t) function direction_of(enriched) result(direction)
    type(enriched_config_t), intent(in) :: enriched
    direction%value = enriched%direction
    direction%relative = enriched%direction_unit == "relative"
    direction%active_only = enriched%contacts == "active"
  end function direction_of

  subroutine choose_interface_solver(enriched, solver)
    type(enriched_config_t), intent(in) :: enriched
    class(interface_solver_t), allocatable, intent(out) :: solver
    type(interface_cg_t), allocatable :: cg

    if (enriched%interface == "cg") then
      allocate (cg)
      cg%tolerance = enriched%cg_tolerance
      cg%max_iterations = enriched%cg_max_iterations
      call move_alloc(cg, solver)
    else
      allocate (interface_direct_t :: solver)
    end if
  end subroutine choose_interface_solver

end module gravier_scheme_choice
