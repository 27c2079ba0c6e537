!> Areas that loads on boundaries work on.
module gravier_load_areas
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_failure
  use gravier_facing_planes, only: find_facing_planes, is_pressed
  use gravier_decomposition, only: decomposition_t
  use gravier_scene_extent, only: find_extent, share_inside
  implicit none
  private
  public :: facing_area, find_load_areas, check_load_areas

contains

  !> Area that a pressure on plane `b` works on, that of the plane itself where it leans [m^2, m in 2D]; 0 for another boundary, and
  !> where the scene is open across the load: no pressure works there (check_load_areas).
  pure real(dp) function facing_area(decomposition, b) result(area)
    type(decomposition_t), intent(in) :: decomposition
    integer, intent(in) :: b
    real(dp), parameter :: open_axis(3) = 0.0_dp

    area = 0.0_dp
    if (decomposition%boundaries(b)%is_plane()) area = load_area(decomposition, b, open_axis)
  end function facing_area

  !> Area that a load on boundary `b` works on: of a plane that of a pressure, of a segment or rectangle its own, of another shape
  !> that of the scene across the load [m^2, m in 2D].
  pure real(dp) function load_area(decomposition, b, extent) result(area)
    type(decomposition_t), intent(in) :: decomposition
    integer, intent(in) :: b
    !> lengths of the scene along axes without a period and without two planes that face each other [m]
    real(dp), intent(in) :: extent(:)
    real(dp) :: place(3)

    area = 0.0_dp
    associate (boundary => decomposition%boundaries(b))
      place(:) = boundary%pivot
      if (allocated(boundary%surface)) then
        area = boundary%surface%own_area()
        place(:) = boundary%surface%point
      end if
      if (area > 0.0_dp) return
      area = area_across(decomposition, boundary%load_axis(), place, extent)
      if (boundary%is_plane()) area = area/abs(boundary%surface%axis(boundary%load_axis()))
    end associate
  end function load_area

  !> Area of the scene across axis `main` at a place: along every other axis the period, the way between the two planes that face
  !> each other across it, or what is given for an open axis [m^2, m in 2D].
  pure real(dp) function area_across(decomposition, main, place, extent) result(area)
    type(decomposition_t), intent(in) :: decomposition
    integer, intent(in) :: main
    !> [m]
    real(dp), intent(in) :: place(3), extent(:)
    real(dp) :: low, high
    integer :: d

    area = 1.0_dp
    associate (boundaries => decomposition%boundaries, length => decomposition%period%length)
      do d = 1, decomposition%nd
        if (d == main) cycle
        call find_facing_planes(boundaries, d, place, low, high)
        if (length(d) > 0.0_dp) then
          area = area*length(d)
        else if (low > -huge(1.0_dp) .and. high < huge(1.0_dp)) then
          area = area*max(high - low, 0.0_dp)
        else
          area = area*extent(d)
        end if
      end do
    end associate
  end function area_across

  !> Areas that the loads on boundaries work on. Where a scene is open across a load, or shut in by other boundaries than planes,
  !> its grains tell how far it goes: at least as far as the load works. Circles and cylinders leave a part of that.
  !> Collective.
  subroutine find_load_areas(decomposition, area)
    type(decomposition_t), intent(in) :: decomposition
    !> (boundaries) [m^2, m in 2D]; 0 where no force moves the boundary, and where there is no grain
    real(dp), intent(out) :: area(:)
    real(dp), dimension(decomposition%nd) :: low, high, extent
    integer :: b
    logical :: known

    area(:) = 0.0_dp
    extent(:) = 0.0_dp
    known = .false.
    do b = 1, size(area)
      if (.not. decomposition%boundaries(b)%is_driven()) cycle
      area(b) = load_area(decomposition, b, extent)
      if (area(b) > 0.0_dp .or. known) cycle
      call find_extent(decomposition, .false., low, high, extent)
      known = .true.
      area(b) = load_area(decomposition, b, extent)*share_inside(decomposition%boundaries, low, high)
    end do
  end subroutine find_load_areas

  !> Fails (status_failure) where the area of a pressure is not known any more, because planes have turned away from each other.
  !> The same on all ranks.
  subroutine check_load_areas(decomposition, error)
    type(decomposition_t), intent(in) :: decomposition
    type(error_t), allocatable, intent(inout) :: error
    character(len=1), parameter :: axes(3) = ["x", "y", "z"]
    real(dp) :: low, high
    integer :: b, d

    do b = 1, size(decomposition%boundaries)
      associate (boundary => decomposition%boundaries(b))
        if (.not. (boundary%present .and. boundary%is_plane() .and. is_pressed(boundary))) cycle
        do d = 1, decomposition%nd
          if (d == boundary%load_axis() .or. decomposition%period%length(d) > 0.0_dp) cycle
          call find_facing_planes(decomposition%boundaries, d, boundary%surface%point, low, high)
          if (low > -huge(1.0_dp) .and. high < huge(1.0_dp)) cycle
          call raise(error, status_failure, "boundary '"//boundary%name//"': pressure: expected two planes that face "// &
            & "each other along "//axes(d)//", but one of them has turned by more than 84 degrees, so that the area is not known")
          return
        end do
      end associate
    end do
  end subroutine check_load_areas

end module gravier_load_areas
