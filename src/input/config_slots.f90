!> Where the value of each key of the table lives in a config_t.
module gravier_config_slots
  use gravier_kinds, only: dp
  use gravier_contact_coefficients, only: coefficients_t
  use gravier_diagnostic_registry, only: diagnostic_place
  use gravier_config_types, only: config_t, grains_config_t, text_length, choice_length
  use gravier_config_key, only: key_t
  use gravier_config_table, only: groups, keys, surface_rows
  use gravier_config_keys, only: find_group, find_key, has_word
  implicit none
  private
  public :: slot_t, slot_of, group_count, belongs, chosen_word

  !> The variable behind a key: of the pointers to values, the one that fits the key's kind and count is associated.
  type :: slot_t
    integer, pointer :: integer => null()
    integer, pointer :: integers(:) => null()
    real(dp), pointer :: real => null()
    real(dp), pointer :: reals(:) => null()
    logical, pointer :: logical => null()
    logical, pointer :: logicals(:) => null()
    character(len=choice_length), pointer :: choice => null()
    character(len=text_length), pointer :: text => null()
    character(len=text_length), pointer :: texts(:) => null()
    !> is the key in the file? associated where the config_t has room for the answer
    logical, pointer :: given => null()
  end type slot_t

contains

  !> The variable of a key of the table in a config_t, which must live as long as the slot is used.
  function slot_of(config, key, instance) result(slot)
    type(config_t), target, intent(inout) :: config
    type(key_t), intent(in) :: key
    !> which of the groups of that name, 1 for a group that stands once
    integer, intent(in) :: instance
    type(slot_t) :: slot

    select case (key%group)
    case ("scene")
      call scene_slot(config, key%name, slot)
    case ("boundary")
      call boundary_slot(config, instance, key%name, slot)
    case ("sample")
      call sample_slot(config, key%name, slot)
    case ("insertion")
      call insertion_slot(config, instance, key%name, slot)
    case ("material")
      call material_slot(config, instance, key%name, slot)
    case ("law")
      call law_slot(config, instance, key%name, slot)
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
    case ("region")
      call region_slot(config, instance, key%name, slot)
    end select
  end function slot_of

  !> How many groups of a name count: each &boundary, &insertion, &material, &law and &region of the file, &sample where it belongs,
  !> one of any other.
  pure integer function group_count(config, group)
    type(config_t), intent(in) :: config
    character(len=*), intent(in) :: group
    integer :: g

    g = find_group(group)
    group_count = 1
    if (groups(g)%bodies /= "" .and. groups(g)%bodies /= config%scene%bodies) group_count = 0
    if (group == "boundary") group_count = size(config%boundaries)
    if (group == "insertion") group_count = size(config%insertions)
    if (group == "material") group_count = size(config%materials)
    if (group == "law") group_count = size(config%laws)
    if (group == "region") group_count = size(config%regions)
  end function group_count

  !> Does a key belong to its group as the choice stands on which that hangs?
  logical function belongs(config, key, instance)
    type(config_t), target, intent(inout) :: config
    type(key_t), intent(in) :: key
    !> as in slot_of
    integer, intent(in) :: instance
    belongs = key%chooser == ""
    if (.not. belongs) belongs = has_word(key%chosen, chosen_word(config, key, instance))
  end function belongs

  !> The word chosen for the key on which it hangs whether a key belongs to its group.
  function chosen_word(config, key, instance) result(word)
    type(config_t), target, intent(inout) :: config
    !> with a chooser
    type(key_t), intent(in) :: key
    !> as in slot_of
    integer, intent(in) :: instance
    character(len=:), allocatable :: word
    type(slot_t) :: slot
    slot = slot_of(config, keys(find_key(key%group, key%chooser)), instance)
    word = trim(slot%choice)
  end function chosen_word

  subroutine scene_slot(config, name, slot)
    type(config_t), target, intent(inout) :: config
    character(len=*), intent(in) :: name
    type(slot_t), intent(inout) :: slot

    select case (name)
    case ("title"); slot%text => config%scene%title
    case ("dimension"); slot%integer => config%scene%dimension
    case ("gravity"); slot%reals => config%scene%gravity
    case ("gravity_table"); slot%text => config%scene%gravity_table
    case ("body_force"); slot%reals => config%scene%body_force
    case ("bodies"); slot%choice => config%scene%bodies
    case ("bodies_file"); slot%text => config%scene%bodies_file
    case ("shapes"); slot%text => config%scene%shapes
    case ("column_count"); slot%integer => config%scene%column_count
    case ("radius"); slot%real => config%scene%radius
    case ("mass"); slot%real => config%scene%mass
    case ("density"); slot%real => config%scene%density
    case ("lattice_count"); slot%integers => config%scene%lattice_count
    case ("radius_min"); slot%real => config%scene%radius_min
    case ("radius_max"); slot%real => config%scene%radius_max
    case ("seed"); slot%integer => config%scene%seed
    case ("wall_material"); slot%text => config%scene%wall_material
    case ("rotation"); slot%logical => config%scene%rotation
    case ("period"); slot%reals => config%scene%period
    case ("period_origin"); slot%reals => config%scene%period_origin
    case ("alert_distance"); slot%real => config%scene%alert_distance
    case ("skin"); slot%real => config%scene%skin
    case ("list_steps"); slot%real => config%scene%list_steps
    case ("overlap_allowed"); slot%real => config%scene%overlap_allowed
    case ("overlap_projection"); slot%logical => config%scene%overlap_projection
    case ("start_overlap"); slot%real => config%scene%start_overlap
    end select
    select case (name)
    case ("alert_distance"); slot%given => config%scene%alert_given
    case ("skin"); slot%given => config%scene%skin_given
    case ("overlap_allowed"); slot%given => config%scene%overlap_given
    end select
    call contact_slot(config%scene%contact, name, slot)
    if (index(name, "wall_") == 1) call contact_slot(config%scene%wall_contact, name(6:), slot)
  end subroutine scene_slot

  subroutine contact_slot(contact, name, slot)
    type(coefficients_t), target, intent(inout) :: contact
    character(len=*), intent(in) :: name
    type(slot_t), intent(inout) :: slot

    select case (name)
    case ("friction"); slot%real => contact%friction
    case ("restitution"); slot%real => contact%restitution
    case ("tangential_restitution"); slot%real => contact%tangential_restitution
    case ("rolling_friction"); slot%real => contact%rolling_friction
    case ("pivoting_friction"); slot%real => contact%pivoting_friction
    end select
  end subroutine contact_slot

  subroutine boundary_slot(config, instance, name, slot)
    type(config_t), target, intent(inout) :: config
    !> number of the boundary
    integer, intent(in) :: instance
    character(len=*), intent(in) :: name
    type(slot_t), intent(inout) :: slot
    integer :: at

    at = surface_rows%find(name)
    if (at > 0) then
      if (surface_rows%keys(at)%key%count == 1) slot%real => config%boundaries(instance)%value(1, at)
      if (surface_rows%keys(at)%key%count > 1) slot%reals => config%boundaries(instance)%value(:, at)
      return
    end if
    select case (name)
    case ("name"); slot%text => config%boundaries(instance)%name
    case ("shape"); slot%choice => config%boundaries(instance)%shape
    case ("group"); slot%integer => config%boundaries(instance)%group
    case ("file"); slot%text => config%boundaries(instance)%file
    case ("velocity"); slot%reals => config%boundaries(instance)%velocity
    case ("rotation"); slot%reals => config%boundaries(instance)%rotation
    case ("pivot"); slot%reals => config%boundaries(instance)%pivot
    case ("free"); slot%logicals => config%boundaries(instance)%free
    case ("force"); slot%reals => config%boundaries(instance)%force
    case ("pressure"); slot%real => config%boundaries(instance)%pressure
    case ("mass"); slot%real => config%boundaries(instance)%mass
    case ("table"); slot%text => config%boundaries(instance)%table
    case ("material"); slot%text => config%boundaries(instance)%material
    case ("remove_at"); slot%real => config%boundaries(instance)%remove_at
    end select
    select case (name)
    case ("pivot"); slot%given => config%boundaries(instance)%pivot_given
    case ("friction"); slot%given => config%boundaries(instance)%contact_given%friction
    case ("restitution"); slot%given => config%boundaries(instance)%contact_given%restitution
    case ("tangential_restitution"); slot%given => config%boundaries(instance)%contact_given%tangential_restitution
    case ("rolling_friction"); slot%given => config%boundaries(instance)%contact_given%rolling_friction
    case ("pivoting_friction"); slot%given => config%boundaries(instance)%contact_given%pivoting_friction
    case ("material"); slot%given => config%boundaries(instance)%material_given
    case ("remove_at"); slot%given => config%boundaries(instance)%remove_given
    end select
    call contact_slot(config%boundaries(instance)%contact, name, slot)
  end subroutine boundary_slot

  subroutine sample_slot(config, name, slot)
    type(config_t), target, intent(inout) :: config
    character(len=*), intent(in) :: name
    type(slot_t), intent(inout) :: slot

    select case (name)
    case ("arrangement"); slot%choice => config%sample%arrangement
    case ("preparation"); slot%choice => config%sample%preparation
    case ("count"); slot%integer => config%sample%count
    case ("box"); slot%reals => config%sample%box
    case ("solid_fraction"); slot%real => config%sample%solid_fraction
    case ("pressure"); slot%real => config%sample%pressure
    case ("rest_tolerance"); slot%real => config%sample%rest_tolerance
    case ("max_steps"); slot%integer => config%sample%max_steps
    case ("file"); slot%text => config%sample%file
    end select
    call grains_slot(config%sample%grains_config_t, name, slot)
  end subroutine sample_slot

  !> What groups that draw grains at random have in common.
  subroutine grains_slot(grains, name, slot)
    type(grains_config_t), target, intent(inout) :: grains
    character(len=*), intent(in) :: name
    type(slot_t), intent(inout) :: slot

    select case (name)
    case ("radii"); slot%choice => grains%radii
    case ("radius"); slot%real => grains%radius
    case ("radius_min"); slot%real => grains%radius_min
    case ("radius_max"); slot%real => grains%radius_max
    case ("radius_mean"); slot%real => grains%radius_mean
    case ("radius_deviation"); slot%real => grains%radius_deviation
    case ("radius_table"); slot%text => grains%radius_table
    case ("grain_shapes"); slot%text => grains%grain_shapes
    case ("grain_shares"); slot%reals => grains%grain_shares
    case ("seed"); slot%integer => grains%seed
    end select
  end subroutine grains_slot

  subroutine insertion_slot(config, instance, name, slot)
    type(config_t), target, intent(inout) :: config
    !> number of the insertion
    integer, intent(in) :: instance
    character(len=*), intent(in) :: name
    type(slot_t), intent(inout) :: slot

    select case (name)
    case ("name"); slot%text => config%insertions(instance)%name
    case ("region"); slot%choice => config%insertions(instance)%region
    case ("lower"); slot%reals => config%insertions(instance)%lower
    case ("upper"); slot%reals => config%insertions(instance)%upper
    case ("centre"); slot%reals => config%insertions(instance)%centre
    case ("region_radius"); slot%real => config%insertions(instance)%region_radius
    case ("rate"); slot%real => config%insertions(instance)%rate
    case ("mass_rate"); slot%real => config%insertions(instance)%mass_rate
    case ("count"); slot%integer => config%insertions(instance)%count
    case ("mass"); slot%real => config%insertions(instance)%mass
    case ("start"); slot%real => config%insertions(instance)%start
    case ("end"); slot%real => config%insertions(instance)%end
    case ("velocity"); slot%reals => config%insertions(instance)%velocity
    case ("velocity_spread"); slot%reals => config%insertions(instance)%velocity_spread
    case ("material"); slot%text => config%insertions(instance)%material
    end select
    select case (name)
    case ("rate"); slot%given => config%insertions(instance)%rate_given
    case ("mass_rate"); slot%given => config%insertions(instance)%mass_rate_given
    case ("count"); slot%given => config%insertions(instance)%count_given
    case ("mass"); slot%given => config%insertions(instance)%mass_given
    case ("end"); slot%given => config%insertions(instance)%end_given
    case ("material"); slot%given => config%insertions(instance)%material_given
    end select
    call grains_slot(config%insertions(instance)%grains_config_t, name, slot)
  end subroutine insertion_slot

  subroutine material_slot(config, instance, name, slot)
    type(config_t), target, intent(inout) :: config
    !> number of the material
    integer, intent(in) :: instance
    character(len=*), intent(in) :: name
    type(slot_t), intent(inout) :: slot

    select case (name)
    case ("name"); slot%text => config%materials(instance)%name
    case ("density"); slot%real => config%materials(instance)%density
    end select
    if (name == "density") slot%given => config%materials(instance)%density_given
  end subroutine material_slot

  subroutine law_slot(config, instance, name, slot)
    type(config_t), target, intent(inout) :: config
    !> number of the group
    integer, intent(in) :: instance
    character(len=*), intent(in) :: name
    type(slot_t), intent(inout) :: slot

    select case (name)
    case ("materials"); slot%texts => config%laws(instance)%materials
    case ("kind"); slot%choice => config%laws(instance)%kind
    case default; slot%real => config%laws(instance)%value(find_key("law", name) - find_key("law", "kind"))
    end select
  end subroutine law_slot

  subroutine time_slot(config, name, slot)
    type(config_t), target, intent(inout) :: config
    character(len=*), intent(in) :: name
    type(slot_t), intent(inout) :: slot

    select case (name)
    case ("step"); slot%real => config%time%step
    case ("steps"); slot%integer => config%time%steps
    case ("theta"); slot%real => config%time%theta
    case ("rest_energy"); slot%real => config%time%rest_energy
    case ("stop_boundary"); slot%text => config%time%stop_boundary
    case ("stop_displacement"); slot%real => config%time%stop_displacement
    case ("stop_grains_at_most"); slot%integer => config%time%stop_grains_at_most
    case ("stop_grains_at_least"); slot%integer => config%time%stop_grains_at_least
    case ("stop_mass_at_most"); slot%real => config%time%stop_mass_at_most
    case ("stop_mass_at_least"); slot%real => config%time%stop_mass_at_least
    end select
    select case (name)
    case ("stop_displacement"); slot%given => config%time%displacement_given
    case ("stop_grains_at_most"); slot%given => config%time%grains_at_most_given
    case ("stop_grains_at_least"); slot%given => config%time%grains_at_least_given
    case ("stop_mass_at_most"); slot%given => config%time%mass_at_most_given
    case ("stop_mass_at_least"); slot%given => config%time%mass_at_least_given
    end select
  end subroutine time_slot

  subroutine solver_slot(config, name, slot)
    type(config_t), target, intent(inout) :: config
    character(len=*), intent(in) :: name
    type(slot_t), intent(inout) :: slot

    select case (name)
    case ("method"); slot%choice => config%solver%method
    case ("criterion"); slot%choice => config%solver%criterion
    case ("accuracy"); slot%real => config%solver%accuracy
    case ("tolerance"); slot%real => config%solver%tolerance
    case ("max_iterations"); slot%integer => config%solver%max_iterations
    case ("sweeps"); slot%integer => config%solver%sweeps
    case ("relaxation"); slot%real => config%solver%relaxation
    case ("acceleration"); slot%choice => config%solver%acceleration
    case ("velocity_scale"); slot%real => config%solver%velocity_scale
    case ("check_every"); slot%integer => config%solver%check_every
    case ("warm_start"); slot%logical => config%solver%warm_start
    case ("layered_start"); slot%logical => config%solver%layered_start
    case ("sleeping"); slot%logical => config%solver%sleeping
    case ("sleep_after"); slot%integer => config%solver%sleep_after
    case ("sleep_speed"); slot%real => config%solver%sleep_speed
    case ("on_failure"); slot%choice => config%solver%on_failure
    end select
    if (name == "tolerance") slot%given => config%solver%tolerance_given
    if (name == "relaxation") slot%given => config%solver%relaxation_given
    if (name == "velocity_scale") slot%given => config%solver%velocity_scale_given
    if (name == "sleep_speed") slot%given => config%solver%sleep_given
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
    case ("repartition_imbalance"); slot%real => config%decomposition%repartition_imbalance
    end select
    if (name == "grid") slot%given => config%decomposition%grid_given
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
    if (name == "direction") slot%given => config%enriched%direction_given
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
    case ("final_forces"); slot%logical => config%output%final_forces
    case ("checkpoint_every"); slot%integer => config%output%checkpoint_every
    case ("fclib_step"); slot%integer => config%output%fclib_step
    case ("checkpoint_seconds"); slot%real => config%output%checkpoint_seconds
    case ("walltime"); slot%real => config%output%walltime
    case ("vtk"); slot%logical => config%output%vtk
    case default
      ! the other keys ask for diagnostics
      slot%logical => config%output%diagnostics(diagnostic_place(name))
    end select
  end subroutine output_slot

  subroutine region_slot(config, instance, name, slot)
    type(config_t), target, intent(inout) :: config
    !> number of the region
    integer, intent(in) :: instance
    character(len=*), intent(in) :: name
    type(slot_t), intent(inout) :: slot

    select case (name)
    case ("name"); slot%text => config%regions(instance)%name
    case ("lower"); slot%reals => config%regions(instance)%lower
    case ("upper"); slot%reals => config%regions(instance)%upper
    case ("bins"); slot%integer => config%regions(instance)%bins
    case ("axis"); slot%choice => config%regions(instance)%axis
    end select
    select case (name)
    case ("lower"); slot%given => config%regions(instance)%lower_given
    case ("upper"); slot%given => config%regions(instance)%upper_given
    case ("bins"); slot%given => config%regions(instance)%bins_given
    case ("axis"); slot%given => config%regions(instance)%axis_given
    end select
  end subroutine region_slot

end module gravier_config_slots
