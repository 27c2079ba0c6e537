!> Rules of the &boundary groups.
module gravier_config_check_boundary
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_surface, only: surface_t
  use gravier_surface_registry, only: glued_grains, wall_of_bodies
  use gravier_given_contacts, only: name_length
  use gravier_boundary_forces, only: name_in_columns
  use gravier_contact_coefficients, only: coefficients_t
  use gravier_config_types, only: config_t, boundary_config_t, text_length
  use gravier_wall_side, only: wall_side_t, wall_side_of
  use gravier_config_surfaces, only: set_surface, surface_value, shapes_in
  use gravier_config_keys, only: choices_text, has_word
  use gravier_config_report, only: report_t, expect, expect_own_name, miss, is_given, shown_text, ordinal
  implicit none
  private
  public :: check_boundaries, check_contact, is_pivoting, not_turning

  !> what `is_pivoting` wants
  character(len=*), parameter :: pivoting_text = "a finite real number >= 0; 0 where dimension = 2"
  !> what is expected of resistances to rolling and pivoting where rotation = .false.
  character(len=*), parameter :: not_turning = "0 where rotation = .false.: bodies that do not turn do not roll"

contains

  !> Fails (status_input) with the first rule that a boundary breaks. Keys that do not belong to its shape are not given.
  subroutine check_boundaries(report, config, error)
    !> its instance comes back as 1
    type(report_t), intent(inout) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    character(len=text_length), allocatable :: names(:)
    character(len=name_length), allocatable :: columns(:)
    integer :: i

    allocate (names(size(config%boundaries)), columns(size(config%boundaries)))
    names(:) = config%boundaries%name
    do i = 1, size(config%boundaries)
      columns(i) = name_in_columns(trim(names(i)))
    end do
    do i = 1, size(config%boundaries)
      report%instance = i
      call expect_own_name(report, "boundary", names(:i), error)
      call check_columns(report, names(:i), columns(:i), error)
      call check_group(report, config%boundaries(:i), error)
      call check_shape(report, config, config%boundaries(i), error)
      call check_wall(report, config, i, error)
      call check_size(report, config%boundaries(i), error)
      call check_free(report, config%boundaries(i), error)
      call check_oscillation(report, config%boundaries(i), error)
      call check_loads(report, config%scene%dimension, config%boundaries(i), error)
      call check_contact(report, config%scene%dimension, config%scene%rotation, config%boundaries(i)%contact, "boundary", "", &
        & error)
      call expect(report, config%boundaries(i)%remove_at >= 0.0_dp, "boundary", "remove_at", error)
      if (allocated(error)) return
    end do
    report%instance = 1
  end subroutine check_boundaries

  !> The name of the last of some boundaries is as short as files have it, and no other name is the same in names of columns.
  subroutine check_columns(report, names, columns, error)
    type(report_t), intent(in) :: report
    !> as the input has them, and as columns have them
    character(len=*), intent(in) :: names(:), columns(:)
    type(error_t), allocatable, intent(inout) :: error
    integer :: n, i

    n = size(names)
    if (len_trim(names(n)) > name_length) call expect(report, .false., "boundary", "name", error, &
      & "at most "//to_text(name_length)//" characters, here "//to_text(len_trim(names(n))))
    do i = 1, n - 1
      if (columns(i) == columns(n)) call expect(report, .false., "boundary", "name", error, &
        & "a name of its own in the columns of history.csv, but the "//ordinal(i)//" is '"//trim(columns(n))//"' there too")
    end do
  end subroutine check_columns

  !> The last of some boundaries has a group of grains of its own.
  subroutine check_group(report, boundaries, error)
    type(report_t), intent(in) :: report
    type(boundary_config_t), intent(in) :: boundaries(:)
    type(error_t), allocatable, intent(inout) :: error
    integer :: n, i

    n = size(boundaries)
    if (boundaries(n)%shape /= glued_grains) return
    do i = 1, n - 1
      if (boundaries(i)%shape /= glued_grains .or. boundaries(i)%group /= boundaries(n)%group) cycle
      call expect(report, .false., "boundary", "group", error, "a group of its own, but the "//ordinal(i)//" has it too")
    end do
  end subroutine check_group

  subroutine check_shape(report, config, boundary, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    type(boundary_config_t), intent(in) :: boundary
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: shapes

    shapes = shapes_in(config%scene%dimension)
    call expect(report, has_word(shapes, boundary%shape), "boundary", "shape", error, &
                choices_text(shapes)//" where dimension = "//merge("2", "3", config%scene%dimension == 2))
    call expect(report, boundary%shape /= glued_grains .or. config%scene%bodies == "file", "boundary", "shape", error, &
                "another shape where bodies = '"//trim(config%scene%bodies)//"': the groups of grains come from a bodies file")
  end subroutine check_shape

  !> A wall of the bodies is named, and no other boundary is this wall.
  subroutine check_wall(report, config, i, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    !> number of the boundary
    integer, intent(in) :: i
    type(error_t), allocatable, intent(inout) :: error
    type(wall_side_t) :: side
    integer :: k

    associate (boundary => config%boundaries(i))
      if (boundary%shape /= wall_of_bodies .or. allocated(error)) return
      call expect(report, config%scene%bodies /= "none", "boundary", "shape", error, &
                  "another shape where bodies = 'none': no walls come with the bodies")
      side = wall_side_of(boundary%wall, config%scene%dimension)
      call expect(report, side%axis > 0 .or. side%id > 0, "boundary", "wall", error, &
                  "a side, such as '+x' or '-y', or the identifier of a wall")
      do k = 1, i - 1
        if (config%boundaries(k)%shape == wall_of_bodies .and. config%boundaries(k)%wall == boundary%wall) call expect(report, &
          & .false., "boundary", "wall", error, "a wall of its own, but the "//ordinal(k)//" has it too")
      end do
    end associate
  end subroutine check_wall

  !> Where it is and how large.
  subroutine check_size(report, boundary, error)
    type(report_t), intent(in) :: report
    type(boundary_config_t), intent(in) :: boundary
    type(error_t), allocatable, intent(inout) :: error
    class(surface_t), allocatable :: surface
    character(len=:), allocatable :: wrong, expected
    integer :: first, last

    if (allocated(error)) return
    if (boundary%shape == glued_grains) call expect(report, boundary%group >= 1, "boundary", "group", error)
    call set_surface(boundary, surface, wrong, expected)
    if (wrong == "") return
    ! a key in braces stands for its value
    first = index(expected, "{")
    last = index(expected, "}")
    if (first > 0) expected = expected(:first - 1)//shown_text(report, "boundary", expected(first + 1:last - 1))// &
      & expected(last + 1:)
    if (expected == "") call expect(report, .false., "boundary", wrong, error)
    if (expected /= "") call expect(report, .false., "boundary", wrong, error, expected)
  end subroutine check_size

  !> Mass and rotation of a boundary that forces move, and of others.
  subroutine check_free(report, boundary, error)
    type(report_t), intent(in) :: report
    type(boundary_config_t), intent(in) :: boundary
    type(error_t), allocatable, intent(inout) :: error
    logical :: is_absent

    if (.not. any(boundary%free)) then
      is_absent = .not. is_given(report, "boundary", "mass")
      call expect(report, is_absent, "boundary", "mass", error, "none where no component is free")
      return
    end if
    call miss(report, "boundary", "mass", error, shown_text(report, "boundary", "free"))
    call expect(report, boundary%mass > 0.0_dp, "boundary", "mass", error)
    call expect(report, all(abs(boundary%rotation) <= 0.0_dp), "boundary", "rotation", error, &
                "0 where a component of the translation is free")
  end subroutine check_free

  !> An oscillation has a frequency and moves nothing that forces move. What belongs to it, or to a table, stands beside it.
  subroutine check_oscillation(report, boundary, error)
    type(report_t), intent(in) :: report
    type(boundary_config_t), intent(in) :: boundary
    type(error_t), allocatable, intent(inout) :: error

    call expect(report, .not. any(boundary%free .and. abs(boundary%oscillation) > 0.0_dp), "boundary", "oscillation", error, &
                "0 along each component that is free")
    call expect(report, .not. (any(boundary%free) .and. any(abs(boundary%rotation_oscillation) > 0.0_dp)), "boundary", &
                "rotation_oscillation", error, "0 where a component of the translation is free")
    if (any(abs(boundary%oscillation) > 0.0_dp) .or. any(abs(boundary%rotation_oscillation) > 0.0_dp)) then
      call expect(report, boundary%frequency > 0.0_dp, "boundary", "frequency", error, "> 0 where the boundary oscillates")
    else
      call expect(report, abs(boundary%frequency) <= 0.0_dp, "boundary", "frequency", error, "0 without an oscillation")
      call expect(report, abs(boundary%phase) <= 0.0_dp, "boundary", "phase", error, "0 without an oscillation")
    end if
    call expect(report, boundary%table /= "" .or. .not. boundary%table_repeats, "boundary", "table_repeats", error, &
                ".false. without a table")
  end subroutine check_oscillation

  !> Loads without effect: on what is not free.
  subroutine check_loads(report, dimension, boundary, error)
    type(report_t), intent(in) :: report
    integer, intent(in) :: dimension
    type(boundary_config_t), intent(in) :: boundary
    type(error_t), allocatable, intent(inout) :: error
    type(wall_side_t) :: side
    real(dp) :: normal(3)

    call expect(report, all(boundary%free .or. abs(boundary%force) <= 0.0_dp), "boundary", "force", error, &
                "0 along each component that is not free")
    normal = surface_value(boundary, "normal")
    if (boundary%shape == wall_of_bodies) then
      ! that of an identifier comes with the bodies
      side = wall_side_of(boundary%wall, dimension)
      normal(:) = merge(1.0_dp, 0.0_dp, side%axis == 0)
      if (side%axis > 0) normal(side%axis) = 1.0_dp
    end if
    call expect(report, any(abs(normal) > 0.0_dp .and. boundary%free) .or. abs(boundary%pressure) <= 0.0_dp, "boundary", &
                "pressure", error, "0 where no component along normal is free")
  end subroutine check_loads

  !> Whether a coefficient of pivoting friction makes sense: disks do not pivot.
  pure logical function is_pivoting(dimension, coefficient)
    integer, intent(in) :: dimension
    real(dp), intent(in) :: coefficient
    is_pivoting = coefficient >= 0.0_dp .and. (dimension == 3 .or. coefficient <= 0.0_dp)
  end function is_pivoting

  !> Coefficients of contact that a group has under keys that begin with a prefix.
  subroutine check_contact(report, dimension, turns, contact, group, prefix, error)
    type(report_t), intent(in) :: report
    integer, intent(in) :: dimension
    !> bodies do
    logical, intent(in) :: turns
    type(coefficients_t), intent(in) :: contact
    character(len=*), intent(in) :: group, prefix
    type(error_t), allocatable, intent(inout) :: error

    call expect(report, contact%friction >= 0.0_dp, group, prefix//"friction", error)
    call expect(report, contact%restitution >= 0.0_dp .and. contact%restitution <= 1.0_dp, group, prefix//"restitution", error)
    call expect(report, contact%tangential_restitution >= 0.0_dp .and. contact%tangential_restitution <= 1.0_dp, group, &
                prefix//"tangential_restitution", error)
    call expect(report, contact%rolling_friction >= 0.0_dp, group, prefix//"rolling_friction", error)
    call expect(report, is_pivoting(dimension, contact%pivoting_friction), group, prefix//"pivoting_friction", error, &
                pivoting_text)
    call expect(report, turns .or. .not. contact%rolling_friction > 0.0_dp, group, prefix//"rolling_friction", error, not_turning)
    call expect(report, turns .or. .not. contact%pivoting_friction > 0.0_dp, group, prefix//"pivoting_friction", error, not_turning)
  end subroutine check_contact

end module gravier_config_check_boundary
