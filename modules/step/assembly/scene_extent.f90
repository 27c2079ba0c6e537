!> The space that a scene takes along the axes, and within boundaries that enclose it.
module gravier_scene_extent
  use gravier_kinds, only: dp
  use gravier_orientation, only: shape_axes
  use gravier_shape_library, only: shape_library_t
  use gravier_body_store, only: body_set_t
  use gravier_boundary, only: boundary_t
  use gravier_facing_planes, only: find_facing_planes
  use gravier_decomposition, only: decomposition_t
  implicit none
  private
  public :: find_extent, share_inside

contains

  !> Where the scene begins and ends along each axis, and its length there: the period, or else the way between the planes that
  !> shut it in. In the place of planes that are not there it ends at the outermost points of the grains, or, if that is asked for,
  !> where a circle or a cylinder along an axis ends that encloses it. Planes that have turned count where they are at the middle of
  !> the other axes. No length where nothing bounds it. Collective.
  subroutine find_extent(decomposition, enclosed, low, high, length)
    type(decomposition_t), intent(in) :: decomposition
    !> it fills the circles and cylinders that enclose it
    logical, intent(in) :: enclosed
    !> (nd) [m]
    real(dp), intent(out) :: low(:), high(:), length(:)
    real(dp) :: extremes(2*decomposition%nd), reach(2*decomposition%nd)
    real(dp) :: middle(3)
    integer :: s, k, d, nd

    nd = decomposition%nd
    extremes(:) = -huge(1.0_dp)
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        do k = 1, owned%n
          call find_reach(decomposition%shapes, owned, k, reach)
          extremes(1:nd) = max(extremes(1:nd), reach(1:nd) - owned%position(:, k))
          extremes(nd + 1:) = max(extremes(nd + 1:), reach(nd + 1:) + owned%position(:, k))
        end do
      end associate
    end do
    call decomposition%comm%highest_of(extremes)
    middle(:) = 0.0_dp
    do d = 1, nd
      call find_facing_planes(decomposition%boundaries, d, middle, low(d), high(d))
      if (low(d) > -huge(1.0_dp)) extremes(d) = -low(d)
      if (high(d) < huge(1.0_dp)) extremes(nd + d) = high(d)
    end do
    do d = 1, nd
      if (min(extremes(d), extremes(nd + d)) > -huge(1.0_dp)) middle(d) = 0.5_dp*(extremes(nd + d) - extremes(d))
    end do
    do d = 1, nd
      if (decomposition%period%length(d) > 0.0_dp) then
        low(d) = decomposition%period%origin(d)
        length(d) = decomposition%period%length(d)
        high(d) = low(d) + length(d)
        cycle
      end if
      call find_facing_planes(decomposition%boundaries, d, middle, low(d), high(d))
      if (enclosed) call shut(decomposition%boundaries, d, low(d), high(d))
      if (.not. low(d) > -huge(1.0_dp)) low(d) = min(-extremes(d), high(d))
      if (.not. high(d) < huge(1.0_dp)) high(d) = max(extremes(nd + d), low(d))
      ! neither planes nor grains
      if (.not. low(d) < huge(1.0_dp)) low(d) = 0.0_dp
      if (.not. abs(high(d)) < huge(1.0_dp)) high(d) = low(d)
      length(d) = max(high(d) - low(d), 0.0_dp)
    end do
  end subroutine find_extent

  !> No farther along an axis than the boundaries that enclose grains.
  pure subroutine shut(boundaries, axis, low, high)
    type(boundary_t), intent(in) :: boundaries(:)
    integer, intent(in) :: axis
    !> [m]
    real(dp), intent(inout) :: low, high
    integer :: b

    do b = 1, size(boundaries)
      if (boundaries(b)%present .and. allocated(boundaries(b)%surface)) call boundaries(b)%surface%shut(axis, low, high)
    end do
  end subroutine shut

  !> The share of a box that is inside the boundaries that enclose grains: inside that of them which leaves least of it.
  pure real(dp) function share_inside(boundaries, low, high) result(share)
    type(boundary_t), intent(in) :: boundaries(:)
    !> corners (nd) [m]
    real(dp), intent(in) :: low(:), high(:)
    real(dp) :: from(3), to(3)
    integer :: b

    from(:) = 0.0_dp
    to(:) = 1.0_dp
    from(1:size(low)) = low
    to(1:size(high)) = high
    share = 1.0_dp
    do b = 1, size(boundaries)
      if (.not. (boundaries(b)%present .and. allocated(boundaries(b)%surface))) cycle
      share = min(share, boundaries(b)%surface%share_inside(from, to))
    end do
  end function share_inside

  !> How far body `k` reaches from its centre, against each axis and then along each [m].
  pure subroutine find_reach(shapes, bodies, k, reach)
    type(shape_library_t), intent(in) :: shapes
    type(body_set_t), intent(in) :: bodies
    integer, intent(in) :: k
    !> (2 nd)
    real(dp), intent(out) :: reach(:)
    real(dp) :: axes(3, 3), at(bodies%nd)
    integer :: p, v, d, nd

    reach(:) = bodies%radius(k)
    if (bodies%no == 0) return
    if (bodies%shape(k) == 0) return
    nd = bodies%nd
    call shape_axes(bodies%orientation(:, k), axes)
    reach(:) = -huge(1.0_dp)
    associate (shape => shapes%shape(bodies%shape(k)))
      do p = 1, size(shape%piece)
        do v = 1, size(shape%piece(p)%vertex, 2)
          do d = 1, nd
            at(d) = sum(axes(d, 1:nd)*shape%piece(p)%vertex(:, v))
          end do
          reach(1:nd) = max(reach(1:nd), bodies%radius(k)*(shape%piece(p)%rounding - at))
          reach(nd + 1:) = max(reach(nd + 1:), bodies%radius(k)*(shape%piece(p)%rounding + at))
        end do
      end do
    end associate
  end subroutine find_reach

end module gravier_scene_extent
