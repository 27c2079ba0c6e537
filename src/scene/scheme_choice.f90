!> The one place where a method is chosen.
module gravier_scheme_choice
  use gravier_kinds, only: dp
  use gravier_text, only: to_text
  use gravier_config_types, only: config_t, solver_config_t, enriched_config_t
  use gravier_scheme, only: scheme_t
  use gravier_nlgs, only: nlgs_t
  use gravier_nscdd, only: nscdd_t
  use gravier_nscdd_ep, only: nscdd_ep_t
  use gravier_newton, only: newton_t
  use gravier_schwarz, only: schwarz_t, relaxation_t
  use gravier_schwarz_ec, only: schwarz_ec_t
  use gravier_enriched_matrix, only: search_direction_t
  use gravier_interface_problem, only: interface_solver_t
  use gravier_interface_cg, only: interface_cg_t
  use gravier_interface_direct, only: interface_direct_t
  implicit none
  private
  public :: choose_scheme

  !> l that is chosen where none is given [1/W_aa]: of nscdd_ep on active contacts and on all contacts, of schwarz_ec
  real(dp), parameter :: active_direction = 100.0_dp, careful_direction = 0.3_dp, schwarz_direction = 3.0_dp

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
      schwarz%relaxation = relaxation_of(config%solver)
      call move_alloc(schwarz, scheme)
    case ("schwarz_ec")
      allocate (corrected)
      corrected%relaxation = relaxation_of(config%solver)
      corrected%matrix%direction = direction_of(config%enriched, schwarz_direction, schwarz_direction)
      call move_alloc(corrected, scheme)
    case ("nscdd")
      allocate (nscdd_t :: scheme)
    case ("nscdd_ep")
      allocate (dual)
      dual%matrix%direction = direction_of(config%enriched, active_direction, careful_direction)
      call choose_interface_solver(config%enriched, dual%interface_solver)
      call move_alloc(dual, scheme)
    case ("newton")
      allocate (newton_t :: scheme)
    case default
      allocate (nlgs_t :: scheme)
    end select
    scheme%direction_text = ""
    select type (scheme)
    type is (nscdd_ep_t)
      scheme%direction_text = direction_text(scheme%matrix%direction)
    type is (schwarz_ec_t)
      scheme%direction_text = direction_text(scheme%matrix%direction)
    end select
    scheme%sweeps = config%solver%sweeps
    scheme%momentum%on = config%solver%acceleration == "momentum" .or. config%solver%method == "newton"
  end subroutine choose_scheme

  !> A given factor is fixed.
  pure type(relaxation_t) function relaxation_of(solver) result(relaxation)
    type(solver_config_t), intent(in) :: solver
    relaxation%automatic = .not. solver%relaxation_given
    if (solver%relaxation_given) relaxation%factor = solver%relaxation
  end function relaxation_of

  !> The search direction of &enriched, or one that serves on packings (doc/methods.md has the measurements).
  pure type(search_direction_t) function direction_of(enriched, on_active, on_all) result(direction)
    type(enriched_config_t), intent(in) :: enriched
    !> l of the method on active contacts and on all [1/W_aa]
    real(dp), intent(in) :: on_active, on_all

    direction%active_only = enriched%contacts == "active"
    direction%automatic = .not. enriched%direction_given
    if (direction%automatic) then
      direction%value = merge(on_active, on_all, direction%active_only)
    else
      direction%value = enriched%direction
      direction%relative = enriched%direction_unit == "relative"
    end if
  end function direction_of

  !> As the log says it: `l = 100/W_aa (automatic), active contacts`.
  function direction_text(direction) result(text)
    type(search_direction_t), intent(in) :: direction
    character(len=:), allocatable :: text

    text = "l = "//to_text(direction%value, 3)//trim(merge("/W_aa", " kg  ", direction%relative))
    if (direction%automatic) text = text//" (automatic)"
    text = text//trim(merge(", active contacts", ", all contacts   ", direction%active_only))
  end function direction_text

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
