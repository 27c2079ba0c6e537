!> The single bodies that an input asks for in the history of a run.
module gravier_scene_tracks
  use gravier_kinds, only: i8
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_tracked_bodies, only: tracked_bodies_t
  use gravier_diagnostic_registry, only: diagnostic_holder_t
  use gravier_config_types, only: config_t
  implicit none
  private
  public :: make_tracked_bodies, check_tracked_bodies

contains

  !> The diagnostic of the tracked bodies, not allocated where there are none.
  subroutine make_tracked_bodies(config, holder)
    type(config_t), intent(in) :: config
    type(diagnostic_holder_t), intent(out) :: holder
    type(tracked_bodies_t), allocatable :: tracked
    integer :: b, n

    n = count(config%output%tracked_bodies > 0)
    if (n == 0) return
    allocate (tracked)
    allocate (tracked%id(n))
    tracked%with_forces = config%output%tracked_forces
    n = 0
    do b = 1, size(config%output%tracked_bodies)
      if (config%output%tracked_bodies(b) == 0) cycle
      n = n + 1
      tracked%id(n) = config%output%tracked_bodies(b)
    end do
    call move_alloc(tracked, holder%diagnostic)
  end subroutine make_tracked_bodies

  !> Refuse an identifier that no body has, unless bodies enter later. Errors are the same on all ranks. Collective.
  subroutine check_tracked_bodies(comm, config, id, error)
    type(communicator_t), intent(in) :: comm
    type(config_t), intent(in) :: config
    !> of the bodies of this rank
    integer(i8), intent(in) :: id(:)
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: found(size(config%output%tracked_bodies))
    integer :: b

    if (size(config%insertions) > 0 .or. .not. any(config%output%tracked_bodies > 0)) return
    do b = 1, size(found)
      found(b) = count(id == config%output%tracked_bodies(b), kind=i8)
    end do
    call comm%sum_counts(found)
    do b = 1, size(found)
      if (config%output%tracked_bodies(b) == 0 .or. found(b) > 0 .or. allocated(error)) cycle
      call raise(error, status_input, config%file//": &output tracked_bodies = "//to_text(config%output%tracked_bodies(b))// &
        & ": expected the identifiers of bodies of the scene")
    end do
  end subroutine check_tracked_bodies

end module gravier_scene_tracks
