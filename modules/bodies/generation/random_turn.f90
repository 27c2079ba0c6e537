!> Orientations all of which are as likely.
module gravier_random_turn
  use gravier_kinds, only: dp, i8
  use gravier_random_hash, only: hash_uniform
  implicit none
  private
  public :: random_turn

  real(dp), parameter :: whole_turn = 2.0_dp*acos(-1.0_dp)

contains

  !> An angle or a unit quaternion for a body. Quaternions are evenly spread over the sphere in four dimensions: the squares of the
  !> lengths of their first and last two components are uniform, and so are two angles.
  pure subroutine random_turn(seed, id, stream, turn)
    integer, intent(in) :: seed
    integer(i8), intent(in) :: id
    !> this stream of random numbers is drawn from and, in space, the next two
    integer, intent(in) :: stream
    !> (1) in 2D [rad], (4) in 3D
    real(dp), intent(out) :: turn(:)
    real(dp) :: share, first, second

    first = whole_turn*hash_uniform(seed, id, stream)
    if (size(turn) == 1) then
      turn(1) = first
      return
    end if
    second = whole_turn*hash_uniform(seed, id, stream + 1)
    share = hash_uniform(seed, id, stream + 2)
    turn(1) = sqrt(share)*cos(first)
    turn(2) = sqrt(share)*sin(first)
    turn(3) = sqrt(1.0_dp - share)*cos(second)
    turn(4) = sqrt(1.0_dp - share)*sin(second)
  end subroutine random_turn

end module gravier_random_turn
