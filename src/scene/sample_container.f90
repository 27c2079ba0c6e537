!> The boundaries of a case as a sample sees them when it is made: what its grains keep clear of, and what may hold them.
module gravier_sample_container
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_bodies_data, only: bodies_data_t
  use gravier_free_places, only: least_distance
  use gravier_held_box, only: held_box_t
  use gravier_surface_registry, only: glued_grains, wall_of_bodies
  use gravier_config_types, only: config_t
  use gravier_scene_boundaries, only: make_boundaries
  implicit none
  private
  public :: set_container, hold_still

contains

  !> Give the box of a sample the boundaries of the case with a surface of their own, where they are at the start, and the inner
  !> point. Failure (status_input): a boundary that cannot be read, an inner point on which the largest grain would touch a boundary
  !> that is to hold it. Errors are the same on all ranks. Collective.
  subroutine set_container(comm, config, largest, box, error)
    type(communicator_t), intent(in) :: comm
    type(config_t), intent(in) :: config
    !> radius of the largest grain of all ranks [m]
    real(dp), intent(in) :: largest
    type(held_box_t), intent(inout) :: box
    type(error_t), allocatable, intent(inout) :: error
    type(config_t) :: own
    type(bodies_data_t) :: none
    real(dp) :: distance
    integer :: b

    own = config
    call keep_surfaces(config, own)
    if (size(own%boundaries) == 0) return
    call make_boundaries(comm, own, none, box%boundaries, error)
    if (allocated(error)) return
    do b = 1, size(box%boundaries)
      box%boundaries(b)%period(:) = config%scene%period
    end do
    box%is_held = config%sample%container == "boundaries"
    if (.not. box%is_held) return
    box%inner_point(:) = merge(config%sample%inner_point, 0.5_dp*(box%lower + box%upper), config%sample%inner_point_given)
    distance = least_distance(box%boundaries, box%inner_point(1:box%nd))
    if (distance < largest) call raise(error, status_input, config%file//": &sample inner_point: expected a point inside the "// &
      & "boundaries, where the largest grain with a radius of "//to_text(largest, 3)//" m has room, but it lies "// &
      & to_text(abs(distance), 3)//" m "//trim(merge("behind", "from  ", distance < 0.0_dp))//" the nearest boundary")
  end subroutine set_container

  !> Those boundaries of a configuration alone that have a surface of their own.
  subroutine keep_surfaces(config, own)
    type(config_t), intent(in) :: config
    type(config_t), intent(inout) :: own
    logical :: kept(size(config%boundaries))
    integer :: b, n

    kept(:) = config%boundaries%shape /= glued_grains .and. config%boundaries%shape /= wall_of_bodies
    deallocate (own%boundaries)
    allocate (own%boundaries(count(kept)))
    n = 0
    do b = 1, size(kept)
      if (.not. kept(b)) cycle
      n = n + 1
      own%boundaries(n) = config%boundaries(b)
    end do
  end subroutine keep_surfaces

  !> Let the boundaries of a configuration stand still for as long as a sample is prepared.
  pure subroutine hold_still(config)
    type(config_t), intent(inout) :: config
    integer :: b

    do b = 1, size(config%boundaries)
      associate (boundary => config%boundaries(b))
        boundary%velocity(:) = 0.0_dp
        boundary%rotation(:) = 0.0_dp
        boundary%oscillation(:) = 0.0_dp
        boundary%rotation_oscillation(:) = 0.0_dp
        boundary%free(:) = .false.
        boundary%force(:) = 0.0_dp
        boundary%pressure = 0.0_dp
        boundary%table = ""
        boundary%remove_at = huge(boundary%remove_at)
      end associate
    end do
  end subroutine hold_still

end module gravier_sample_container
