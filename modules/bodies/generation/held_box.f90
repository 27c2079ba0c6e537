!> Boxes with boundaries in or around them, which grains keep clear of, and which may hold the grains.
module gravier_held_box
  use gravier_kinds, only: dp
  use gravier_boundary, only: boundary_t
  use gravier_free_places, only: is_clear, is_seen
  use gravier_placed_grains, only: sample_box_t
  implicit none
  private
  public :: held_box_t

  type, extends(sample_box_t) :: held_box_t
    type(boundary_t), allocatable :: boundaries(:)
    !> whether they hold the grains, each of which then has to be in sight of the inner point
    logical :: is_held = .false.
    !> [m]
    real(dp) :: inner_point(3) = 0.0_dp
  contains
    procedure :: leaves_room => held_box_leaves_room
    procedure :: too_many => held_box_too_many
  end type held_box_t

contains

  !> Whether boundaries leave room for a grain at a place: it overlaps none of them, and where they hold the grains none lies
  !> between the inner point and the place.
  pure logical function held_box_leaves_room(self, radius, position) result(room)
    class(held_box_t), intent(in) :: self
    !> [m]; (nd) [m]
    real(dp), intent(in) :: radius, position(:)

    room = .true.
    if (.not. allocated(self%boundaries)) return
    room = is_clear(self%boundaries, radius, position)
    if (room .and. self%is_held) room = is_seen(self%boundaries, self%inner_point(1:self%nd), position)
  end function held_box_leaves_room

  !> What is wrong where grains find no places.
  pure function held_box_too_many(self, fraction) result(text)
    class(held_box_t), intent(in) :: self
    !> that all grains fill of the box
    real(dp), intent(in) :: fraction
    character(len=:), allocatable :: text

    if (self%is_held) then
      text = "too many grains for the space inside the boundaries, or a box that has little of this space"
    else
      text = self%sample_box_t%too_many(fraction)
      if (allocated(self%boundaries)) text = text//" beside the boundaries of the case, or these leave little of the box"
    end if
  end function held_box_too_many

end module gravier_held_box
