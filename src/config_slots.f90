!> Where the value of each key of the table lives in a config_t.
module gravier_config_slots
  use gravier_kinds, only: dp
  use gravier_config_types, only: config_t, text_length, choice_length
  use gravier_config_keys, only: key_t
  implicit none
  private
  public :: slot_t, slot_of

  !> The variable behind a key: the one pointer that fits the key's kind and count is associated.
  type :: slot_t
    integer, pointer :: integer => null()
    integer, pointer :: integers(:) => null()
    real(dp), pointer :: real => null()
    real(dp), pointer :: reals(:) => null()
    logical, pointer :: logical => null()
    character(len=choice_length), pointer :: choice => null()
    character(len=text_length), pointer :: text => null()
  end type slot_t

contains

  !> The variable of a key of the table in a config_t, which must live as long as the slot is used.
  function slot_of(config, key) result(slot)
    type(config_t), target, intent(inout) :: config
    type(key_t), intent(in) :: key
    type(slot_t) :: slot

    select case (key%group)
    case ("scene")
      call scene_slot(config, key%name, slot)
    case ("time")
      call time_slot(config, key%name, slot)
    case ("solver")
      call solver_slot(config, key%name, slot)
    case ("decomposition")
      call decomposition_slot(config, key%name, slot)
    case ("enriched")
      call enriched_slot(config, key%name, slot)
    case ("output")
      call output_slot(config, key%name, slot)
    end select
  end function slot_of

  subroutine scene_slot(config, name, slot)
    type(config_t), target, intent(inout) :: config
    character(len=*), intent(in) :: name
    type(slot_t), intent(inout) :: slot

    select case (name)
    case ("title"); slot%text => config%scene%title
    case ("dimension"); slot%integer => config%scene%dimension
    case ("gravity"); slot%reals => config%scene%gravity
    case ("bodies"); slot%choice => config%scene%bodies
    case ("bodies_file"); slot%text => config%scene%bodies_file
    case ("column_count"); slot%integer => config%scene%column_count
    case ("radius"); slot%real => config%scene%radius
    case ("mass"); slot%real => config%scene%mass
    case ("density"); slot%real => config%scene%density
    case ("lattice_count"); slot%integers => config%scene%lattice_count
    case ("radius_min"); slot%real => config%scene%radius_min
    case ("radius_max"); slot%real => config%scene%radius_max
    case ("seed"); slot%integer => config%scene%seed
    case ("friction"); slot%real => config%scene%friction
    case ("wall_friction"); slot%real => config%scene%wall_friction
    case ("alert_distance"); slot%real => config%scene%alert_distance
    end select
  end subroutine scene_slot

  subroutine time_slot(config, name, slot)
    type(config_t), target, intent(inout) :: config
    character(len=*), intent(in) :: name
    type(slot_t), intent(inout) :: slot

    select case (name)
    case ("step"); slot%real => config%time%step
    case ("steps"); slot%integer => config%time%steps
    case ("theta"); slot%real => config%time%theta
    end select
  end subroutine time_slot

  subroutine solver_slot(config, name, slot)
    type(config_t), target, intent(inout) :: config
    character(len=*), intent(in) :: name
    type(slot_t), intent(inout) :: slot

    select case (name)
    case ("method"); slot%choice => config%solver%method
    case ("criterion"); slot%choice => config%solver%criterion
    case ("tolerance"); slot%real => config%solver%tolerance
    case ("max_iterations"); slot%integer => config%solver%max_iterations
    case ("sweeps"); slot%integer => config%solver%sweeps
    case ("relaxation"); slot%real => config%solver%relaxation
    case ("check_every"); slot%integer => config%solver%check_every
    case ("warm_start"); slot%logical => config%solver%warm_start
    case ("on_failure"); slot%choice => config%solver%on_failure
    end select
  end subroutine solver_slot

  subroutine decomposition_slot(config, name, slot)
    type(config_t), target, intent(inout) :: config
    character(len=*), intent(in) :: name
    type(slot_t), intent(inout) :: slot

    select case (name)
    case ("partition"); slot%choice => config%decomposition%partition
    case ("kind"); slot%choice => config%decomposition%kind
    case ("grid"); slot%integers => config%decomposition%grid
    case ("subdomains"); slot%integer => config%decomposition%subdomains
    case ("repartition_every"); slot%integer => config%decomposition%repartition_every
    end select
  end subroutine decomposition_slot

  subroutine enriched_slot(config, name, slot)
    type(config_t), target, intent(inout) :: config
    character(len=*), intent(in) :: name
    type(slot_t), intent(inout) :: slot

    select case (name)
    case ("direction"); slot%real => config%enriched%direction
    case ("direction_unit"); slot%choice => config%enriched%direction_unit
    case ("contacts"); slot%choice => config%enriched%contacts
    case ("interface"); slot%choice => config%enriched%interface
    case ("cg_tolerance"); slot%real => config%enriched%cg_tolerance
    case ("cg_max_iterations"); slot%integer => config%enriched%cg_max_iterations
    end select
  end subroutine enriched_slot

  subroutine output_slot(config, name, slot)
    type(config_t), target, intent(inout) :: config
    character(len=*), intent(in) :: name
    type(slot_t), intent(inout) :: slot

    select case (name)
    case ("directory"); slot%text => config%output%directory
    case ("every"); slot%integer => config%output%every
    case ("contacts"); slot%logical => config%output%contacts
    case ("trace"); slot%logical => config%output%trace
    case ("final_bodies"); slot%logical => config%output%final_bodies
    end select
  end subroutine output_slot

end module gravier_config_slots
