!> Rules of the &material and &law groups, and of the names of materials.
module gravier_config_check_laws
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_law_set, only: law_set_t
  use gravier_config_types, only: config_t, text_length
  use gravier_config_key, only: key_t, kind_real
  use gravier_config_table, only: keys
  use gravier_config_keys, only: choices_text
  use gravier_config_slots, only: slot_t, slot_of, belongs
  use gravier_config_report, only: report_t, expect, expect_own_name, ordinal
  use gravier_config_laws, only: material_number, collect_laws
  use gravier_config_check_boundary, only: is_pivoting, not_turning
  implicit none
  private
  public :: check_materials, check_laws, names_of_materials

contains

  !> Fails (status_input) with the first rule that a material breaks, and on names of materials that are not there.
  subroutine check_materials(report, config, error)
    !> its instance comes back as 1
    type(report_t), intent(inout) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    character(len=text_length), allocatable :: names(:)
    integer :: i

    allocate (names(size(config%materials)))
    names(:) = config%materials%name
    do i = 1, size(config%materials)
      report%instance = i
      call expect_own_name(report, "material", names(:i), error)
      call expect(report, config%materials(i)%density > 0.0_dp, "material", "density", error)
      call expect(report, config%scene%bodies /= "column" .or. .not. config%materials(i)%density_given, "material", "density", &
                  error, "none where bodies = 'column': mass is the mass of each body")
    end do
    report%instance = 1
    call expect(report, is_known(config, config%scene%wall_material), "scene", "wall_material", error, names_of_materials(config))
    do i = 1, size(config%boundaries)
      report%instance = i
      ! that of &scene is refused there
      call expect(report, is_known(config, config%boundaries(i)%material) .or. .not. config%boundaries(i)%material_given, &
                  "boundary", "material", error, names_of_materials(config))
    end do
    report%instance = 1
  end subroutine check_materials

  !> Is it blank or the name of a material?
  pure logical function is_known(config, name)
    type(config_t), intent(in) :: config
    character(len=*), intent(in) :: name
    is_known = name == ""
    if (.not. is_known) is_known = material_number(config, name) > 0
  end function is_known

  !> The names of all materials, as a message expects one of them.
  pure function names_of_materials(config) result(text)
    type(config_t), intent(in) :: config
    character(len=:), allocatable :: text
    integer :: i

    text = "the name of a &material, and there is none"
    do i = 1, size(config%materials)
      if (i == 1) text = "'"//trim(config%materials(1)%name)//"'"
      if (i > 1) text = text//trim(merge(" or", ",  ", i == size(config%materials)))//" '"//trim(config%materials(i)%name)//"'"
    end do
  end function names_of_materials

  !> Fails (status_input) with the first rule that a law breaks. Keys that do not belong to its kind are not given.
  subroutine check_laws(report, config, error)
    !> its instance comes back as 1
    type(report_t), intent(inout) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    type(law_set_t) :: laws
    integer :: i, k, pair(2), earlier(2)

    do i = 1, size(config%laws)
      report%instance = i
      pair(:) = pair_of(config, i)
      call expect(report, all(pair > 0), "law", "materials", error, names_of_materials(config))
      do k = 1, i - 1
        earlier(:) = pair_of(config, k)
        call expect(report, any(pair /= earlier) .and. any(pair /= earlier(2:1:-1)), "law", "materials", error, &
                    "a pair of its own, but the "//ordinal(k)//" has it too")
      end do
      call check_values(report, config, error)
    end do
    report%instance = 1
    call expect(report, config%solver%criterion /= "error" .or. size(config%laws) == 0, "solver", "criterion", error, &
                "'residual' where there is a &law: the exact solution is that of the scene's law")
    if (allocated(error)) return
    call collect_laws(config, laws)
    do i = 1, size(config%laws)
      report%instance = i
      associate (law => laws%of(i)%law)
        call expect(report, law%fault_key == "", "law", trim(law%fault_key), error, trim(law%fault_expected))
        call expect(report, config%scene%dimension == 3 .or. .not. law%of_spheres, "law", "kind", error, &
                    "a law that holds in 2D, as 'elastic': this one is of spheres")
      end associate
    end do
    report%instance = 1
    call expect(report, config%output%fclib_step == 0 .or. .not. laws%yields, "output", "fclib_step", error, &
                "none where contacts are compliant: problems of FCLIB have rigid ones")
    call expect(report, config%scene%alert_distance >= laws%range .or. .not. config%scene%alert_distance_given, "scene", &
                "alert_distance", error, "at least "//to_text(laws%range, 4)//" m, the largest range of a &law")
  end subroutine check_laws

  !> Numbers of the materials of a law, 0 for an unknown one.
  pure function pair_of(config, i) result(pair)
    type(config_t), intent(in) :: config
    integer, intent(in) :: i
    integer :: pair(2)

    pair(1) = material_number(config, config%laws(i)%materials(1))
    pair(2) = pair(1)
    if (config%laws(i)%materials(2) /= "") pair(2) = material_number(config, config%laws(i)%materials(2))
  end function pair_of

  !> The rules of the keys of the law under check.
  subroutine check_values(report, config, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    !> a copy to point into
    type(config_t), target :: copy
    type(slot_t) :: slot
    integer :: k
    logical :: holds

    copy = config
    do k = 1, size(keys)
      if (keys(k)%group /= "law" .or. keys(k)%kind /= kind_real) cycle
      if (.not. belongs(copy, keys(k), report%instance)) cycle
      slot = slot_of(copy, keys(k), report%instance)
      holds = .true.
      if (index(keys(k)%allowed, "> 0") == 1) holds = slot%real > 0.0_dp
      if (index(keys(k)%allowed, ">= 0") == 1) holds = slot%real >= 0.0_dp
      if (index(keys(k)%allowed, "in ") == 1) holds = is_within(keys(k)%allowed, slot%real)
      call expect(report, holds, "law", trim(keys(k)%name), error)
      if (keys(k)%name == "pivoting_friction") call expect(report, is_pivoting(config%scene%dimension, slot%real), "law", &
        & "pivoting_friction", error, "a finite real number >= 0; 0 where dimension = 2")
      if (any(keys(k)%name == [character(len=17) :: "rolling_friction", "pivoting_friction"])) call expect(report, &
        & config%scene%rotation .or. .not. slot%real > 0.0_dp, "law", trim(keys(k)%name), error, not_turning)
    end do
  end subroutine check_values

  !> Whether a number is in the interval of a rule `in [a, b]` or `in (a, b]`.
  pure logical function is_within(rule, x)
    character(len=*), intent(in) :: rule
    real(dp), intent(in) :: x
    real(dp) :: ends(2)

    read (rule(index(rule, "in ") + 4:len_trim(rule) - 1), *) ends
    is_within = x >= ends(1) .and. x <= ends(2)
    if (index(rule, "(") > 0) is_within = is_within .and. x > ends(1)
  end function is_within

end module gravier_config_check_laws
