!> Sanity of an input file whose values have all been read: one message for each rule.
module gravier_config_check
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_config_types, only: config_t
  use gravier_config_keys, only: key_t, keys, find_key, expected_text, choices_text
  implicit none
  private
  public :: given_t, check_dimension, check_config, grid_product

  !> Whether a key of the table is in the file, and how.
  type :: given_t
    !> the entries that are set
    logical :: entries(3) = .false.
    !> `key = value` as the file has it; several, separated by commas, when the entries were set one by one
    character(len=:), allocatable :: shown
  end type given_t

  !> What every check needs to make its message.
  type :: report_t
    character(len=:), allocatable :: file
    !> as the table of keys
    type(given_t), allocatable :: given(:)
  end type report_t

contains

  !> Fails unless dimension is 2 or 3, which other defaults and rules depend on.
  subroutine check_dimension(config, given, error)
    type(config_t), intent(in) :: config
    !> shape (number of keys)
    type(given_t), intent(in) :: given(:)
    type(error_t), allocatable, intent(inout) :: error
    type(report_t) :: report

    report%file = config%file
    report%given = given
    call expect(report, any(config%scene%dimension == [2, 3]), "scene", "dimension", error)
  end subroutine check_dimension

  !> Fails (status_input) with the first rule that the input breaks.
  subroutine check_config(config, given, error)
    !> with defaults settled
    type(config_t), intent(in) :: config
    !> shape (number of keys)
    type(given_t), intent(in) :: given(:)
    type(error_t), allocatable, intent(inout) :: error
    type(report_t) :: report

    report%file = config%file
    report%given = given
    call check_required(report, config, error)
    call check_bodies_keys(report, config, error)
    call check_scene(report, config, error)
    if (config%scene%bodies == "column") call check_column(report, config, error)
    if (config%scene%bodies == "lattice") call check_lattice(report, config, error)
    call check_time(report, config, error)
    call check_solver(report, config, error)
    call check_decomposition(report, config, error)
    call check_method(report, config, error)
    call check_enriched(report, config, error)
    call check_output(report, config, error)
  end subroutine check_config

  !> Keys that have no default.
  subroutine check_required(report, config, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    logical :: needed
    integer :: k

    do k = 1, size(keys)
      needed = keys(k)%required .or. (keys(k)%note == "required" .and. keys(k)%bodies == config%scene%bodies)
      if (.not. needed .or. any(report%given(k)%entries)) cycle
      call raise(error, status_input, report%file//": &"//trim(keys(k)%group)//" "//trim(keys(k)%name) &
                 //" is missing: expected "//expected_text(keys(k))//needed_by(keys(k)))
    end do
  end subroutine check_required

  pure function needed_by(key) result(text)
    type(key_t), intent(in) :: key
    character(len=:), allocatable :: text
    text = ""
    if (key%bodies /= "") text = ", required by bodies = "//choices_text(key%bodies)
  end function needed_by

  !> Keys that belong to another kind of bodies.
  subroutine check_bodies_keys(report, config, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    integer :: k

    do k = 1, size(keys)
      if (keys(k)%bodies == "" .or. .not. any(report%given(k)%entries)) cycle
      if (index(keys(k)%bodies, trim(config%scene%bodies)) > 0) cycle
      call raise(error, status_input, report%file//": &scene "//report%given(k)%shown//": "//trim(keys(k)%name) &
                 //" belongs to bodies = "//choices_text(keys(k)%bodies)//", expected without it where bodies = '" &
                 //trim(config%scene%bodies)//"'")
    end do
  end subroutine check_bodies_keys

  subroutine check_scene(report, config, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error

    associate (scene => config%scene)
      call expect(report, scene%dimension == 3 .or. .not. abs(scene%gravity(3)) > 0.0_dp, "scene", "gravity", error, &
                  "a third component of 0 where dimension = 2")
      call expect(report, scene%bodies /= "file" .or. scene%bodies_file /= "", "scene", "bodies_file", error)
      call expect(report, scene%density > 0.0_dp, "scene", "density", error)
      call expect(report, scene%friction >= 0.0_dp, "scene", "friction", error)
      call expect(report, scene%wall_friction >= 0.0_dp, "scene", "wall_friction", error)
      call expect(report, scene%alert_distance >= 0.0_dp .or. .not. scene%alert_given, "scene", "alert_distance", error)
    end associate
  end subroutine check_scene

  subroutine check_column(report, config, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error

    associate (scene => config%scene)
      call expect(report, scene%column_count >= 1, "scene", "column_count", error)
      call expect(report, scene%radius > 0.0_dp, "scene", "radius", error)
      call expect(report, scene%mass > 0.0_dp, "scene", "mass", error)
    end associate
  end subroutine check_column

  subroutine check_lattice(report, config, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error

    associate (scene => config%scene)
      call expect(report, positive(scene%lattice_count, scene%dimension), "scene", "lattice_count", error, &
                  counts_text(scene%dimension))
      call expect(report, grid_product(scene%lattice_count) > 0, "scene", "lattice_count", error, &
                  "at most "//to_text(huge(1))//" bodies")
      call expect(report, scene%radius_min > 0.0_dp, "scene", "radius_min", error)
      call expect(report, scene%radius_max > 0.0_dp, "scene", "radius_max", error)
      call expect(report, scene%radius_min <= scene%radius_max, "scene", "radius_min", error, &
                  "at most radius_max, here "//report%given(find_key("scene", "radius_max"))%shown)
    end associate
  end subroutine check_lattice

  subroutine check_time(report, config, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error

    call expect(report, config%time%step > 0.0_dp, "time", "step", error)
    call expect(report, config%time%steps >= 0, "time", "steps", error)
    call expect(report, config%time%theta >= 0.5_dp .and. config%time%theta <= 1.0_dp, "time", "theta", error)
  end subroutine check_time

  subroutine check_solver(report, config, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error

    associate (solver => config%solver)
      call expect(report, solver%criterion /= "error" .or. config%scene%bodies == "column", "solver", "criterion", error, &
                  "'residual': the exact solution, and so the error, is known for bodies = 'column' only")
      call expect(report, solver%tolerance > 0.0_dp, "solver", "tolerance", error)
      call expect(report, solver%max_iterations >= 1, "solver", "max_iterations", error)
      call expect(report, solver%sweeps >= 1, "solver", "sweeps", error)
      call expect(report, solver%relaxation > 0.0_dp .and. solver%relaxation <= 1.0_dp, "solver", "relaxation", error)
      call expect(report, solver%check_every >= 1, "solver", "check_every", error)
    end associate
  end subroutine check_solver

  subroutine check_decomposition(report, config, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error

    associate (parts => config%decomposition)
      call expect(report, parts%subdomains >= 1, "decomposition", "subdomains", error)
      call expect(report, parts%repartition_every >= 0, "decomposition", "repartition_every", error)
      if (all(parts%grid == 0)) return
      call expect(report, parts%partition == "grid", "decomposition", "grid", error, &
                  "no grid where partition = '"//trim(parts%partition)//"': give subdomains, or partition = 'grid'")
      call expect(report, positive(parts%grid, config%scene%dimension), "decomposition", "grid", error, &
                  counts_text(config%scene%dimension))
      call expect(report, grid_product(parts%grid) > 0, "decomposition", "grid", error, &
                  "at most "//to_text(huge(1))//" subdomains")
      call expect(report, parts%subdomains == grid_product(parts%grid), "decomposition", "subdomains", error, &
                  to_text(grid_product(parts%grid))//", the product of "//report%given(find_key("decomposition", "grid"))%shown)
    end associate
  end subroutine check_decomposition

  !> One domain for nlgs.
  subroutine check_method(report, config, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: key

    if (config%solver%method /= "nlgs") return
    key = "subdomains"
    if (.not. is_given(report, "decomposition", key)) key = "grid"
    call expect(report, config%decomposition%subdomains == 1, "decomposition", key, error, &
                "one subdomain where &solver method = 'nlgs'; for several use method = 'nscdd' or 'schwarz'")
  end subroutine check_method

  subroutine check_enriched(report, config, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error

    associate (enriched => config%enriched)
      call expect(report, enriched%direction >= 0.0_dp, "enriched", "direction", error)
      call expect(report, enriched%cg_tolerance > 0.0_dp .and. enriched%cg_tolerance < 1.0_dp, "enriched", "cg_tolerance", &
                  error)
      call expect(report, enriched%cg_max_iterations >= 1, "enriched", "cg_max_iterations", error)
    end associate
  end subroutine check_enriched

  subroutine check_output(report, config, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error

    call expect(report, config%output%directory /= "", "output", "directory", error)
    call expect(report, config%output%every >= 0, "output", "every", error)
  end subroutine check_output

  !> Fails with `FILE: &group key = VALUE: expected ...` unless the rule holds.
  subroutine expect(report, holds, group, key, error, what)
    type(report_t), intent(in) :: report
    logical, intent(in) :: holds
    character(len=*), intent(in) :: group, key
    type(error_t), allocatable, intent(inout) :: error
    !> what is expected; the words of the table of keys by default
    character(len=*), intent(in), optional :: what
    character(len=:), allocatable :: shown, expected
    integer :: k

    if (holds) return
    k = find_key(group, key)
    shown = key
    if (allocated(report%given(k)%shown)) shown = report%given(k)%shown
    expected = expected_text(keys(k))
    if (present(what)) expected = what
    call raise(error, status_input, report%file//": &"//group//" "//shown//": expected "//expected)
  end subroutine expect

  pure logical function is_given(report, group, key)
    type(report_t), intent(in) :: report
    character(len=*), intent(in) :: group, key
    is_given = any(report%given(find_key(group, key))%entries)
  end function is_given

  !> Are the counts along each axis positive, the third one 1 in 2D?
  pure logical function positive(counts, dimension)
    !> shape (3)
    integer, intent(in) :: counts(:)
    integer, intent(in) :: dimension
    positive = all(counts >= 1) .and. (dimension == 3 .or. counts(3) == 1)
  end function positive

  pure function counts_text(dimension) result(text)
    integer, intent(in) :: dimension
    character(len=:), allocatable :: text
    text = to_text(dimension)//" integers >= 1 where dimension = "//to_text(dimension)
  end function counts_text

  !> Product of counts; 0 when one is not positive or when the product exceeds the largest integer.
  pure integer function grid_product(counts) result(total)
    !> shape (3)
    integer, intent(in) :: counts(:)
    total = 0
    if (any(counts < 1)) return
    if (product(real(counts, dp)) <= real(huge(1), dp)) total = product(counts)
  end function grid_product

end module gravier_config_check
