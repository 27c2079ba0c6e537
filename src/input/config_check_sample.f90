!> Rules of the &sample group.
module gravier_config_check_sample
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_surface_registry, only: wall_of_bodies
  use gravier_config_types, only: config_t
  use gravier_config_laws, only: material_number
  use gravier_config_names, only: count_names, get_name, has_empty_name
  use gravier_config_check_grains, only: check_grains, check_shares
  use gravier_config_check_laws, only: names_of_materials
  use gravier_config_report, only: report_t, expect, miss, is_given, shown_text
  implicit none
  private
  public :: check_sample

contains

  !> Fails (status_input) with the first rule that the sample breaks. Keys that do not belong to its choices are not given.
  subroutine check_sample(report, config, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error

    call expect(report, config%sample%count >= 1, "sample", "count", error)
    call check_grains(report, config, "sample", config%sample%grains_config_t, error)
    call check_grain_materials(report, config, error)
    call expect(report, all(config%sample%velocity_spread >= 0.0_dp), "sample", "velocity_spread", error)
    call check_box(report, config, error)
    call check_preparation(report, config, error)
    if (config%sample%container == "boundaries") call check_container(report, config, error)
    call expect(report, config%sample%file /= "", "sample", "file", error)
    call expect(report, has_ending(config%sample%file, ".h5") .or. has_ending(config%sample%file, ".hdf5"), "sample", "file", &
                error, "a name with the ending .h5 or .hdf5")
  end subroutine check_sample

  pure logical function has_ending(file, ending)
    character(len=*), intent(in) :: file, ending
    integer :: n
    n = len_trim(file)
    has_ending = .false.
    if (n > len(ending)) has_ending = file(n - len(ending) + 1:n) == ending
  end function has_ending

  !> Each name is that of a material, and shares have names.
  subroutine check_grain_materials(report, config, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: name
    integer :: k

    associate (names => config%sample%grain_materials)
      call expect(report, .not. has_empty_name(names), "sample", "grain_materials", error, &
                  "the name of a material before and behind each comma")
      do k = 1, count_names(names)
        call get_name(names, k, name)
        call expect(report, material_number(config, name) > 0, "sample", "grain_materials", error, names_of_materials(config))
      end do
      call check_shares(report, "sample", "grain_materials", names, "material_shares", config%sample%material_shares, error)
    end associate
  end subroutine check_grain_materials

  !> The box fits the period; what it leaves open is its last size, which another key or the grains give.
  subroutine check_box(report, config, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    integer :: nd

    nd = config%scene%dimension
    associate (sample => config%sample, period => config%scene%period)
      call expect(report, all(sample%box >= 0.0_dp), "sample", "box", error)
      if (any(.not. sample%box(:nd - 1) > 0.0_dp)) &
        call miss(report, "sample", "box", error, "each axis that is not periodic but the last")
      call expect(report, all(sample%box(:nd - 1) > 0.0_dp), "sample", "box", error, &
                  "sizes > 0, of which the last may be 0")
      call expect(report, all(period <= 0.0_dp .or. abs(sample%box - period) <= 0.0_dp), "sample", "box", error, &
                  "the same sizes as &scene "//shown_text(report, "scene", "period")//" along each axis that is periodic")
      call expect(report, sample%box(nd) <= 0.0_dp .or. .not. is_given(report, "sample", "solid_fraction"), &
                  "sample", "solid_fraction", error, "none where the last size of the box is given")
      call expect(report, sample%solid_fraction > 0.0_dp .and. sample%solid_fraction < 0.6_dp, &
                  "sample", "solid_fraction", error)
    end associate
  end subroutine check_box

  subroutine check_preparation(report, config, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    integer :: nd

    nd = config%scene%dimension
    associate (sample => config%sample)
      call expect(report, sample%preparation /= "settled" .or. config%scene%gravity(nd) < 0.0_dp, &
                  "sample", "preparation", error, "another one where gravity does not point down the last axis")
      call expect(report, sample%preparation /= "settled" .or. config%scene%gravity_table == "", "scene", "gravity_table", error, &
                  "none where preparation = 'settled': bodies come to rest under a constant gravity")
      call expect(report, sample%preparation /= "settled" .or. config%scene%period(nd) <= 0.0_dp, &
                  "sample", "preparation", error, "another one where the last axis is periodic")
      call expect(report, sample%preparation /= "compacted" .or. any(config%scene%period(:nd) <= 0.0_dp), &
                  "sample", "preparation", error, "another one where every axis is periodic, or a run with &scene "// &
                  "cell_pressure from a sample with preparation = 'none', which compacts the cell, and "// &
                  "&output final_bodies, which writes it")
      call expect(report, sample%preparation /= "compacted" .or. sample%pressure > 0.0_dp, "sample", "pressure", error)
      call expect(report, sample%rest_tolerance > 0.0_dp, "sample", "rest_tolerance", error)
      call expect(report, sample%max_steps >= 1, "sample", "max_steps", error)
    end associate
  end subroutine check_preparation

  !> Boundaries that hold the grains are there, with a box that says where to look for places.
  subroutine check_container(report, config, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error

    associate (sample => config%sample)
      call expect(report, size(config%boundaries) > 0, "sample", "container", error, "'box' where the case has no &boundary")
      call expect(report, all(config%boundaries%shape /= wall_of_bodies), "sample", "container", error, &
                  "'box' where a &boundary has shape = 'wall': boundaries that hold the grains leave no other walls")
      call expect(report, sample%preparation /= "compacted", "sample", "container", error, &
                  "'box' where preparation = 'compacted': the planes of the box compact the grains")
      call expect(report, sample%arrangement == "loose", "sample", "container", error, &
                  "'box' where arrangement = 'lattice': a lattice fills the whole box")
      call expect(report, sample%box(config%scene%dimension) > 0.0_dp, "sample", "box", error, &
                  "sizes > 0 along all axes where container = 'boundaries'")
    end associate
  end subroutine check_container

end module gravier_config_check_sample
