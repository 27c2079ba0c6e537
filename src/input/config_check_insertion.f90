!> Rules of the &insertion groups. What asks for radii of a table, for shapes or for boundaries is for the scene.
module gravier_config_check_insertion
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_config_types, only: config_t, insertion_config_t, text_length
  use gravier_config_report, only: report_t, expect, expect_own_name, shown_text
  use gravier_config_check_grains, only: check_grains
  use gravier_config_laws, only: material_number
  use gravier_config_check_laws, only: names_of_materials
  implicit none
  private
  public :: check_insertions

contains

  !> Fails (status_input) with the first rule that an insertion breaks, and on a scene without grains in which none enter.
  subroutine check_insertions(report, config, error)
    !> its instance comes back as 1
    type(report_t), intent(inout) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    character(len=text_length), allocatable :: names(:)
    integer :: i

    if (config%scene%bodies == "none" .and. size(config%insertions) == 0) then
      call raise(error, status_input, report%file// &
        & ": group &insertion is missing: expected &insertion ... /, required by bodies = 'none'")
    end if
    call expect(report, config%scene%bodies /= "none" .or. config%decomposition%partition == "grid" .or. &
                config%decomposition%subdomains == 1, "decomposition", "partition", error, &
                "'grid' where bodies = 'none': METIS finds no grains to distribute")
    allocate (names(size(config%insertions)))
    names(:) = config%insertions%name
    do i = 1, size(config%insertions)
      report%instance = i
      call expect_own_name(report, "insertion", names(:i), error)
      call check_region(report, config, config%insertions(i), error)
      call check_rate(report, config%insertions(i), error)
      call expect(report, all(config%insertions(i)%velocity_spread >= 0.0_dp), "insertion", "velocity_spread", error)
      call check_material(report, config, config%insertions(i), error)
      call check_grains(report, config, "insertion", config%insertions(i)%grains_config_t, error)
      if (allocated(error)) return
    end do
    report%instance = 1
  end subroutine check_insertions

  !> A region has an inside.
  subroutine check_region(report, config, insertion, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(insertion_config_t), intent(in) :: insertion
    type(error_t), allocatable, intent(inout) :: error
    integer :: nd

    nd = config%scene%dimension
    if (insertion%region == "box") then
      call expect(report, all(insertion%upper(:nd) > insertion%lower(:nd)), "insertion", "upper", error, &
                  "components above those of lower, here "//shown_text(report, "insertion", "lower"))
    else
      call expect(report, insertion%region_radius > 0.0_dp, "insertion", "region_radius", error)
    end if
  end subroutine check_region

  !> How much enters, and when.
  subroutine check_rate(report, insertion, error)
    type(report_t), intent(in) :: report
    type(insertion_config_t), intent(in) :: insertion
    type(error_t), allocatable, intent(inout) :: error

    call expect(report, insertion%rate > 0.0_dp .or. .not. insertion%rate_given, "insertion", "rate", error)
    call expect(report, insertion%mass_rate > 0.0_dp .or. .not. insertion%mass_rate_given, "insertion", "mass_rate", error)
    call expect(report, .not. (insertion%rate_given .and. insertion%mass_rate_given), "insertion", "mass_rate", error, &
                "it in the place of rate, here "//shown_text(report, "insertion", "rate"))
    call expect(report, insertion%count >= 1 .or. .not. insertion%count_given, "insertion", "count", error)
    call expect(report, insertion%mass > 0.0_dp .or. .not. insertion%mass_given, "insertion", "mass", error)
    call expect(report, insertion%start >= 0.0_dp, "insertion", "start", error)
    call expect(report, insertion%end > insertion%start .or. .not. insertion%end_given, "insertion", "end", error, &
                "a time later than start, here "//shown_text(report, "insertion", "start"))
  end subroutine check_rate

  subroutine check_material(report, config, insertion, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(insertion_config_t), intent(in) :: insertion
    type(error_t), allocatable, intent(inout) :: error

    if (.not. insertion%material_given) return
    call expect(report, material_number(config, insertion%material) > 0, "insertion", "material", error, names_of_materials(config))
  end subroutine check_material

end module gravier_config_check_insertion
