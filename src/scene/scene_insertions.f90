!> From &insertion groups to the grains that enter a scene.
module gravier_scene_insertions
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_magnitude, only: sharpest, far_text
  use gravier_communicator, only: communicator_t
  use gravier_periodic, only: period_t
  use gravier_boundary, only: boundary_t
  use gravier_shape_library, only: shape_library_t
  use gravier_insertion, only: insertion_t
  use gravier_free_places, only: is_clear
  use gravier_config_types, only: config_t, insertion_config_t
  use gravier_config_laws, only: material_number, density_of
  use gravier_sample_bodies, only: set_radii
  use gravier_sample_shapes, only: choose_shapes
  implicit none
  private
  public :: make_insertions, check_regions

  !> places of a region that are tried to find out whether boundaries leave it any
  integer, parameter :: trials = 1000

contains

  !> The insertions of a configuration, with nothing entered. Failure (status_input): a table of radii that cannot be read, shapes
  !> that the library does not have, a region without room for the largest grain, or far off. Errors are the same on all ranks.
  !> Collective.
  subroutine make_insertions(comm, config, shapes, insertions, error)
    type(communicator_t), intent(in) :: comm
    type(config_t), intent(in) :: config
    type(shape_library_t), intent(in) :: shapes
    type(insertion_t), allocatable, intent(out) :: insertions(:)
    type(error_t), allocatable, intent(inout) :: error
    integer :: i, k

    allocate (insertions(size(config%insertions)))
    do i = 1, size(insertions)
      associate (insertion => insertions(i), given => config%insertions(i))
        insertion%place_in_scene = i
        call set_insertion(config%scene%dimension, given, insertion)
        call set_radii(comm, given%grains_config_t, insertion%nd, insertion%radii, error)
        if (given%material_given) insertion%material = material_number(config, given%material)
        insertion%density = density_of(config, insertion%material)
        if (shapes%n > 0) then
          call choose_shapes(config, label(config, i), given%grains_config_t, shapes, insertion%shape, insertion%bound, error)
          if (allocated(error)) return
          allocate (insertion%unit_volume(size(insertion%shape)), source=0.0_dp)
          do k = 1, size(insertion%shape)
            if (insertion%shape(k) > 0) insertion%unit_volume(k) = shapes%volume_of(insertion%shape(k))
          end do
        end if
        call check_room(config, i, insertion, error)
        if (allocated(error)) return
      end associate
    end do
  end subroutine make_insertions

  !> What the group says without tables, shapes and materials.
  subroutine set_insertion(nd, given, insertion)
    integer, intent(in) :: nd
    type(insertion_config_t), intent(in) :: given
    type(insertion_t), intent(inout) :: insertion

    insertion%name = trim(given%name)
    insertion%nd = nd
    insertion%seed = given%seed
    insertion%in_ball = given%region == "ball"
    insertion%lower(:) = given%lower
    insertion%upper(:) = given%upper
    if (insertion%in_ball) then
      insertion%lower(1:nd) = given%centre(1:nd) - given%region_radius
      insertion%upper(1:nd) = given%centre(1:nd) + given%region_radius
    end if
    insertion%velocity(:) = given%velocity
    insertion%spread(:) = given%velocity_spread
    if (given%rate_given) insertion%rate = given%rate
    if (given%mass_rate_given) insertion%mass_rate = given%mass_rate
    if (given%count_given) insertion%most_grains = given%count
    if (given%mass_given) insertion%most_mass = given%mass
    insertion%start = given%start
    if (given%end_given) insertion%end = given%end
  end subroutine set_insertion

  !> How messages call an insertion.
  function label(config, i) result(text)
    type(config_t), intent(in) :: config
    integer, intent(in) :: i
    character(len=:), allocatable :: text
    text = config%file//": &insertion '"//trim(config%insertions(i)%name)//"'"
  end function label

  !> Refuse a region that the largest grain has no room in, and one that is far off.
  subroutine check_room(config, i, insertion, error)
    type(config_t), intent(in) :: config
    integer, intent(in) :: i
    type(insertion_t), intent(in) :: insertion
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: far, corner

    if (allocated(error)) return
    if (.not. insertion%room_for(insertion%radii%largest())) call raise(error, status_input, label(config, i)// &
      & ": expected a region with room for the largest grain, of diameter "//to_text(2.0_dp*insertion%radii%largest(), 4)//" m")
    far = sharpest*insertion%radii%smallest()
    corner = max(maxval(abs(insertion%lower(1:insertion%nd))), maxval(abs(insertion%upper(1:insertion%nd))))
    if (corner > far) call raise(error, status_input, label(config, i)//": a region as far as "//to_text(corner, 4)// &
      & " m from the origin: expected at most "//to_text(far, 4)//" m, "//far_text)
  end subroutine check_room

  !> Refuse regions that leave the period, and those in which boundaries leave no place to the smallest grain, where they
  !> do not move. Errors are the same on all ranks.
  subroutine check_regions(config, insertions, period, boundaries, error)
    type(config_t), intent(in) :: config
    type(insertion_t), intent(in) :: insertions(:)
    type(period_t), intent(in) :: period
    type(boundary_t), intent(in) :: boundaries(:)
    type(error_t), allocatable, intent(inout) :: error
    real(dp), allocatable :: position(:)
    integer :: i, c, d
    logical :: clear

    do i = 1, size(insertions)
      associate (insertion => insertions(i))
        do d = 1, insertion%nd
          if (.not. period%length(d) > 0.0_dp) cycle
          if (insertion%lower(d) < period%origin(d) - 1.0e-9_dp*period%length(d) .or. &
            & insertion%upper(d) > period%origin(d) + (1.0_dp + 1.0e-9_dp)*period%length(d)) call raise(error, status_input, &
            & label(config, i)//": expected a region in the period along axis "//to_text(d)//", from "// &
            & to_text(period%origin(d), 6)//" to "//to_text(period%origin(d) + period%length(d), 6)//" m")
        end do
        if (any_moves(boundaries)) cycle
        allocate (position(insertion%nd))
        clear = .false.
        do c = 1, trials
          call insertion%place(int(c, i8), insertion%radii%smallest(), position)
          clear = is_clear(boundaries, insertion%radii%smallest(), position)
          if (clear) exit
        end do
        deallocate (position)
        if (.not. clear) call raise(error, status_input, label(config, i)// &
          & ": expected a region in which boundaries and outlets leave room for grains: in "//to_text(trials)// &
          & " places of it the smallest grain overlaps one")
      end associate
      if (allocated(error)) return
    end do
  end subroutine check_regions

  !> Whether some boundary moves or is taken away later, so that a region may become free.
  pure logical function any_moves(boundaries) result(moves)
    type(boundary_t), intent(in) :: boundaries(:)
    integer :: b

    moves = .false.
    do b = 1, size(boundaries)
      moves = moves .or. boundaries(b)%is_driven() .or. boundaries(b)%is_moved() .or. boundaries(b)%drive%moves() .or. &
        & boundaries(b)%remove_at < huge(1.0_dp)
    end do
  end function any_moves

end module gravier_scene_insertions
