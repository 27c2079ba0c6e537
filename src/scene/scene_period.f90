!> Boundaries of scenes that repeat themselves: those that would meet their own images are refused.
module gravier_scene_period
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_boundary, only: boundary_t
  use gravier_surface, only: surface_features_t
  use gravier_config_types, only: config_t
  use gravier_scene, only: scene_t
  implicit none
  private
  public :: check_in_period

  character(len=1), parameter :: axes(3) = ["x", "y", "z"]
  !> smallest component of a direction that counts
  real(dp), parameter :: straight = 1.0e-9_dp

contains

  !> Refuse boundaries that are not the same one period farther: planes across a periodic axis, what turns an endless surface
  !> across one, finite shapes, meshes and turning glued grains that take more than a period. Glued grains of this rank are checked.
  subroutine check_in_period(config, scene, reach, error)
    type(config_t), intent(in) :: config
    type(scene_t), intent(in) :: scene
    !> diameter of the largest grain and range of the lists [m]
    real(dp), intent(in) :: reach
    type(error_t), allocatable, intent(inout) :: error
    type(surface_features_t) :: features
    integer :: b, d

    do d = 1, config%scene%dimension
      if (.not. scene%period%length(d) > 0.0_dp) cycle
      do b = 1, size(scene%boundaries)
        associate (boundary => scene%boundaries(b))
          if (boundary%is_glued()) then
            if (turns_across(boundary, d) .and. .not. room_for_glued(scene, b, d, reach)) call refuse(boundary, &
              & "turning grains nearer to an image of the pivot than half the period of "//to_text(scene%period%length(d), 4)// &
              & " m, less a radius and the range of the lists, along")
            cycle
          end if
          features = boundary%surface%features()
          if (features%endless) then
            if (abs(boundary%surface%axis(d)) > straight) call refuse(boundary, "a normal at right angles to")
            if (turns_across(boundary, d)) call refuse(boundary, "no rotation but about")
          else if (features%endless_axis) then
            call check_cylinder(boundary)
          else
            call check_width(boundary)
          end if
        end associate
      end do
    end do

  contains

    subroutine check_width(boundary)
      type(boundary_t), intent(in) :: boundary
      character(len=:), allocatable :: or_edge
      real(dp) :: width

      width = 2.0_dp*boundary%half_width(d)
      if (features%faceted .and. .not. boundary%drive%turns()) then
        if (width > (1.0_dp + straight)*scene%period%length(d)) call refuse(boundary, "a width of at most the period of "// &
          & to_text(scene%period%length(d), 4)//" m, here "//to_text(width, 4)//" m, along")
        return
      end if
      ! an edge round the period has no end
      if (boundary%surface%edge_round(d, scene%period%length(d)) > 0 .and. .not. boundary%drive%turns()) return
      if (.not. features%encloses) width = width + reach
      if (.not. width > scene%period%length(d)) return
      or_edge = ""
      if (.not. (boundary%surface%radius > 0.0_dp .or. boundary%drive%turns())) or_edge = ", or an edge of that length along it"
      call refuse(boundary, "a width, with a diameter of the largest grain and the range of the lists, of at most the "// &
        & "period of "//to_text(scene%period%length(d), 4)//" m"//or_edge//", here "//to_text(width, 4)//" m, along")
    end subroutine check_width

    !> A cylinder lies along the axis or across it, and does not tilt.
    subroutine check_cylinder(boundary)
      type(boundary_t), intent(in) :: boundary
      integer :: k

      do k = 1, 3
        if (boundary%drive%turns_about(k) .and. abs(boundary%surface%axis(k)) < 1.0_dp - straight) &
          & call refuse(boundary, "no rotation but about its axis, near")
      end do
      if (abs(boundary%surface%axis(d)) >= 1.0_dp - straight) return
      if (abs(boundary%surface%axis(d)) > straight) call refuse(boundary, "an axis along, or at right angles to,")
      call check_width(boundary)
    end subroutine check_cylinder

    subroutine refuse(boundary, expected)
      type(boundary_t), intent(in) :: boundary
      character(len=*), intent(in) :: expected

      call raise(error, status_input, config%file//": boundary '"//boundary%name//"': expected "//expected// &
        & " the periodic axis "//axes(d))
    end subroutine refuse

  end subroutine check_in_period

  !> Whether the grains of this rank that are glued to boundary b stay within half a period along axis d of its pivot.
  pure logical function room_for_glued(scene, b, d, reach) result(has_room)
    type(scene_t), intent(in) :: scene
    integer, intent(in) :: b, d
    !> diameter of the largest grain and range of the lists [m]
    real(dp), intent(in) :: reach
    real(dp) :: arm, length
    integer :: k

    has_room = .true.
    length = scene%period%length(d)
    do k = 1, scene%grains%n
      if (scene%grains%glued(k) /= b) cycle
      arm = scene%grains%position(d, k) - scene%boundaries(b)%pivot(d)
      arm = abs(arm - length*anint(arm/length)) + 0.5_dp*reach
      has_room = has_room .and. arm < 0.5_dp*length
    end do
  end function room_for_glued

  !> Whether a boundary turns, now or later, so that places along axis `d` count.
  pure logical function turns_across(boundary, d)
    type(boundary_t), intent(in) :: boundary
    integer, intent(in) :: d
    integer :: k

    turns_across = .false.
    do k = 1, 3
      if (k /= d .and. boundary%drive%turns_about(k)) turns_across = .true.
    end do
  end function turns_across

end module gravier_scene_period
