!> Boundaries in the loop of a user: where they are, what grains do to them, and their drives.
module gravier_user_boundaries
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_magnitude, only: is_bounded, bounded_text
  use gravier_boundary, only: boundary_t
  use gravier_boundary_drive, only: drives_velocity, drives_spin, drives_force, drives_pressure
  use gravier_scene_boundaries, only: check_pressed
  use gravier_user_loop, only: user_loop_t, numbers_text
  implicit none
  private
  public :: get_boundary, set_boundary

  character(len=*), parameter :: readable = "position, normal, velocity, spin, force, applied_force, pressure, friction", &
    & settable = "velocity, spin, applied_force, pressure, friction"
  character(len=1), parameter :: axes(3) = ["x", "y", "z"]

contains

  !> A quantity of boundary `b` now; `force` is what grains did to it in the last step, velocity and spin are those of the last
  !> step. Failure (status_input): an unknown name.
  subroutine get_boundary(loop, b, name, values, error)
    type(user_loop_t), intent(in) :: loop
    integer, intent(in) :: b
    character(len=*), intent(in) :: name
    !> one number for each axis; of a spin in the plane, a pressure or a coefficient, one
    real(dp), allocatable, intent(out) :: values(:)
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: place(3)
    integer :: nd

    associate (simulation => loop%run%simulation, boundary => loop%run%simulation%decomposition%boundaries(b))
      nd = simulation%decomposition%nd
      select case (name)
      case ("position")
        call boundary%find_place(place)
        values = place(1:nd)
      case ("normal")
        place(:) = 0.0_dp
        if (boundary%is_plane()) place(:) = boundary%surface%axis
        values = place(1:nd)
      case ("velocity")
        values = boundary%velocity(1:nd)
      case ("spin")
        values = boundary%spin(merge(3, 1, nd == 2):)
      case ("force")
        values = simulation%boundary_impulses(:, b)/simulation%physics%h
      case ("applied_force")
        values = boundary%drive%force(1:nd)
      case ("pressure")
        allocate (values(1), source=boundary%drive%pressure)
      case ("friction")
        allocate (values(1), source=boundary%contact%friction)
      case default
        call raise(error, status_input, "boundary '"//boundary%name//"': "//name//": unknown; expected one of "//readable)
      end select
    end associate
  end subroutine get_boundary

  !> Set a drive or the friction of boundary `b` from the next step on. Failures (status_input): an unknown name, another count of
  !> numbers, a number that is none to reckon with, a component that a table or a force gives or that the boundary does not have.
  subroutine set_boundary(loop, b, name, values, error)
    type(user_loop_t), intent(inout) :: loop
    integer, intent(in) :: b
    character(len=*), intent(in) :: name
    real(dp), intent(in) :: values(:)
    type(error_t), allocatable, intent(inout) :: error
    integer :: nd, expected

    nd = loop%run%simulation%decomposition%nd
    associate (boundary => loop%run%simulation%decomposition%boundaries(b))
      select case (name)
      case ("velocity", "applied_force")
        expected = nd
      case ("spin")
        expected = 2*nd - 3
      case ("pressure", "friction")
        expected = 1
      case default
        call refuse(boundary, name, "cannot be set; expected one of "//settable, error)
        return
      end select
      if (size(values) /= expected) call refuse(boundary, name, "has "//to_text(size(values))//" numbers; expected "// &
        & to_text(expected), error)
      if (.not. all(is_bounded(values))) call refuse(boundary, name, "is not a number to reckon with; expected "// &
        & bounded_text, error)
      if (allocated(error)) return
      select case (name)
      case ("velocity")
        call set_velocity(boundary, values, error)
      case ("spin")
        call set_spin(boundary, loop%turns(4 - size(values):, b), values, error)
      case ("applied_force")
        call set_force(boundary, values, error)
      case ("pressure")
        call check_pressure(boundary, error)
        if (.not. allocated(error)) call check_pressed(loop%run%simulation%decomposition%boundaries, b, nd, &
          & loop%run%simulation%decomposition%period%length, error)
        if (.not. allocated(error)) boundary%drive%pressure = values(1)
      case ("friction")
        call loop%set_friction(b, values(1), error)
        if (allocated(error)) error%message = "boundary '"//boundary%name//"': "//error%message
      end select
      if (allocated(error) .or. name == "friction") return
      boundary%drive%steered = .true.
    end associate
    call loop%run%simulation%wake()
    call loop%note(name, b, values)
    call loop%note_setting(name//" of boundary '"//loop%run%simulation%decomposition%boundaries(b)%name//"'", numbers_text(values))
  end subroutine set_boundary

  subroutine set_velocity(boundary, values, error)
    type(boundary_t), intent(inout) :: boundary
    !> one for each axis [m/s]
    real(dp), intent(in) :: values(:)
    type(error_t), allocatable, intent(inout) :: error
    integer :: d

    do d = 1, size(values)
      if (boundary%free(d) .and. abs(values(d)) > 0.0_dp) call refuse(boundary, "velocity", "along "//axes(d)// &
        & ": forces move it; expected 0 there", error)
      if (boundary%drive%gives(drives_velocity, d)) call refuse(boundary, "velocity", "along "//axes(d)// &
        & ": its table gives it; expected a boundary without this column", error)
      if (abs(boundary%drive%oscillation(d)) > 0.0_dp) call refuse(boundary, "velocity", "along "//axes(d)// &
        & ": it oscillates; expected a boundary without an oscillation along this axis", error)
    end do
    if (.not. allocated(error)) boundary%drive%velocity(1:size(values)) = values
  end subroutine set_velocity

  subroutine set_spin(boundary, turns, values, error)
    type(boundary_t), intent(inout) :: boundary
    !> whether the case turns the boundary about each axis of `values`
    logical, intent(in) :: turns(:)
    !> about z, or about each axis in space [rad/s]
    real(dp), intent(in) :: values(:)
    type(error_t), allocatable, intent(inout) :: error
    integer :: d, k

    do d = 1, size(values)
      k = 3 - size(values) + d
      if (boundary%drive%gives(drives_spin, k)) call refuse(boundary, "spin", "about "//axes(k)// &
        & ": its table gives it; expected a boundary without this column", error)
      if (abs(boundary%drive%rotation_oscillation(k)) > 0.0_dp) call refuse(boundary, "spin", "about "//axes(k)// &
        & ": it oscillates; expected a boundary without an oscillation about this axis", error)
      if (abs(values(d)) > 0.0_dp .and. .not. turns(d)) call refuse(boundary, "spin", "about "//axes(k)// &
        & ": the boundary does not turn about it in the case; expected 0, or a rotation in the case", error)
    end do
    if (.not. allocated(error)) boundary%drive%spin(4 - size(values):) = values
  end subroutine set_spin

  subroutine set_force(boundary, values, error)
    type(boundary_t), intent(inout) :: boundary
    !> one for each axis [N]
    real(dp), intent(in) :: values(:)
    type(error_t), allocatable, intent(inout) :: error
    integer :: d

    do d = 1, size(values)
      if (.not. boundary%free(d) .and. abs(values(d)) > 0.0_dp) call refuse(boundary, "applied_force", "along "//axes(d)// &
        & ": not a free component; expected 0 there", error)
      if (boundary%drive%gives(drives_force, d)) call refuse(boundary, "applied_force", "along "//axes(d)// &
        & ": its table gives it; expected a boundary without this column", error)
    end do
    if (.not. allocated(error)) boundary%drive%force(1:size(values)) = values
  end subroutine set_force

  !> Refuse a pressure on what does not move along its normal, or has it from a table.
  subroutine check_pressure(boundary, error)
    type(boundary_t), intent(in) :: boundary
    type(error_t), allocatable, intent(inout) :: error
    logical :: pressed

    pressed = boundary%is_plane()
    if (pressed) pressed = any(boundary%free .and. abs(boundary%surface%axis) > 0.0_dp)
    if (.not. pressed) call refuse(boundary, "pressure", "is for a plane of which a component along its normal is free", error)
    if (boundary%drive%gives(drives_pressure, 1)) call refuse(boundary, "pressure", &
      & "is given by its table; expected a boundary without this column", error)
  end subroutine check_pressure

  subroutine refuse(boundary, name, text, error)
    type(boundary_t), intent(in) :: boundary
    !> of the quantity
    character(len=*), intent(in) :: name, text
    type(error_t), allocatable, intent(inout) :: error

    call raise(error, status_input, "boundary '"//boundary%name//"': "//name//" "//text)
  end subroutine refuse

end module gravier_user_boundaries
