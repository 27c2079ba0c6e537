!> Size and orientation of bodies with shapes, as files say them in several ways.
module gravier_body_turn
  use gravier_kinds, only: dp
  use gravier_quaternion, only: multiply_quaternions
  use gravier_bodies_data, only: make_unit
  implicit none
  private
  public :: settle_turn, settle_radius, take_principal_axes, is_fine_turn, fine_turn_text

  !> angles beyond it have lost the digits that tell how a body stands [rad]
  real(dp), parameter :: largest_angle = 1.0e8_dp
  character(len=*), parameter :: fine_turn_text = "an angle of at most 1e8 in size"

  !> what a quaternion may differ from length 1 and be left as it is: rounding of a time stepper, which a file gives back to the bit
  real(dp), parameter :: unit_enough = 1.0e-12_dp
  !> relative difference of radii that mean the same
  real(dp), parameter :: same_radius = 1.0e-9_dp

contains

  !> Whether a turn has its digits: quaternions have them at any size.
  pure logical function is_fine_turn(turn)
    !> (1) in 2D, (4) in 3D
    real(dp), intent(in) :: turn(:)
    is_fine_turn = size(turn) == 4 .or. abs(turn(1)) <= largest_angle
  end function is_fine_turn

  !> Scale a quaternion to length 1, unless it has it; angles are left as they are.
  pure subroutine settle_turn(turn, possible)
    !> (1) in 2D, (4) in 3D
    real(dp), intent(inout) :: turn(:)
    !> false for the quaternion 0
    logical, intent(out) :: possible

    possible = .true.
    if (size(turn) == 1) return
    if (abs(norm2(turn) - 1.0_dp) > unit_enough) call make_unit(turn, possible)
  end subroutine settle_turn

  !> From the turn of the axes in which a shape is written to that of its principal axes. A shape that is written in its principal
  !> axes leaves the turn as it is, to the bit.
  pure subroutine take_principal_axes(shape_turn, turn)
    !> of the principal axes in the others
    real(dp), intent(in) :: shape_turn(4)
    !> (1) in 2D, (4) in 3D
    real(dp), intent(inout), contiguous :: turn(:)
    real(dp) :: given(4)

    if (size(turn) == 1 .or. .not. maxval(abs(shape_turn(2:4))) > 0.0_dp) return
    given(:) = turn
    call multiply_quaternions(given, shape_turn, turn)
  end subroutine take_principal_axes

  !> The radius of a body with a shape: what is given, else scale times the size of the shape.
  pure subroutine settle_radius(size_of_shape, scale, scale_given, radius, agrees)
    real(dp), intent(in) :: size_of_shape, scale
    logical, intent(in) :: scale_given
    !> 0 where it is not given
    real(dp), intent(inout) :: radius
    !> false where both are given and differ
    logical, intent(out) :: agrees
    real(dp) :: from_scale

    from_scale = scale*size_of_shape
    agrees = .true.
    if (.not. radius > 0.0_dp) then
      radius = from_scale
    else if (scale_given) then
      agrees = abs(radius - from_scale) <= same_radius*radius
    end if
  end subroutine settle_radius

end module gravier_body_turn
