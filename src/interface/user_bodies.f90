!> Bodies that the loop of a user puts into a scene and takes out of it, by the ways of insertions and outlets.
module gravier_user_bodies
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_sorting, only: argsort
  use gravier_magnitude, only: is_bounded, is_size, bounded_text, size_text, sharpest, far_text
  use gravier_motion, only: grain_mass
  use gravier_free_places, only: is_clear
  use gravier_inflow, only: placed_t
  use gravier_config_laws, only: density_of
  use gravier_user_loop, only: user_loop_t
  implicit none
  private
  public :: newcomers_t, add_bodies, remove_bodies

  !> Bodies that are to enter: disks or spheres.
  type :: newcomers_t
    !> (n) [m]; [kg], 0 for that of the density of the material
    real(dp), allocatable :: radius(:), mass(:)
    !> (nd, n) [m]; [m/s]
    real(dp), allocatable :: position(:, :), velocity(:, :)
    !> (n)
    integer, allocatable :: material(:)
  end type newcomers_t

contains

  !> Let bodies enter at the start of the next step, as insertions do; they get the next identifiers, in their order. Failures
  !> (status_input): values that no body has; a radius above the largest of the scene; a place that is not free. The same on all
  !> ranks. Collective.
  subroutine add_bodies(loop, bodies, error)
    type(user_loop_t), intent(inout) :: loop
    type(newcomers_t), intent(in) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    type(placed_t) :: given
    integer, allocatable :: turns(:)
    integer :: k, nd

    associate (simulation => loop%run%simulation, decomposition => loop%run%simulation%decomposition)
      nd = decomposition%nd
      if (.not. loop%goes_on()) call raise(error, status_input, &
        & "add_bodies: the run is over; expected a run that goes on")
      if (decomposition%period%moves) call raise(error, status_input, &
        & "add_bodies: the periodic cell of the scene moves; expected one that stays as it is")
      call check_newcomers(loop, bodies, error)
      if (allocated(error)) return
      given%n = size(bodies%radius)
      allocate (given%grain(given%n), given%position(nd, given%n), given%material(given%n), turns(nd))
      given%position(:, :) = bodies%position
      given%material(:) = bodies%material
      do k = 1, given%n
        if (decomposition%ni > 0) call decomposition%period%wrap(given%position(:, k), turns)
        given%grain(k)%radius = bodies%radius(k)
        given%grain(k)%mass = bodies%mass(k)
        if (.not. bodies%mass(k) > 0.0_dp) given%grain(k)%mass = &
          & grain_mass(nd, bodies%radius(k), density_of(simulation%config, max(bodies%material(k), 1)))
        given%grain(k)%velocity(1:nd) = bodies%velocity(:, k)
        if (nd == 3) given%grain(k)%turn(1) = 1.0_dp
      end do
      call check_places(loop, given, error)
      call loop%comm%agree(error)
      if (allocated(error)) return
      call join(simulation%inflow%given, given)
      call loop%note("radius", given%n, bodies%radius)
      call loop%note("mass", given%n, bodies%mass)
      do k = 1, given%n
        call loop%note("position", bodies%material(k), bodies%position(:, k))
        call loop%note("velocity", k, bodies%velocity(:, k))
      end do
    end associate
  end subroutine add_bodies

  !> Refuse numbers that no body of the scene has.
  subroutine check_newcomers(loop, bodies, error)
    type(user_loop_t), intent(in) :: loop
    type(newcomers_t), intent(in) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    integer :: k, most

    if (allocated(error)) return
    associate (simulation => loop%run%simulation)
      most = max(1, size(simulation%config%materials))
      do k = 1, size(bodies%radius)
        if (.not. is_size(bodies%radius(k))) call refuse("radius: expected "//size_text)
        if (bodies%radius(k) > simulation%decomposition%rule%largest_radius) call refuse("radius "//to_text(bodies%radius(k), 7)// &
          & " m: expected at most "//to_text(simulation%decomposition%rule%largest_radius, 7)// &
          & " m, the largest radius of the scene at its start")
        if (.not. abs(bodies%mass(k)) <= 0.0_dp .and. .not. is_size(bodies%mass(k))) call refuse("mass: expected "//size_text)
        if (.not. all(is_bounded(bodies%position(:, k)))) call refuse("position: expected "//bounded_text)
        if (any(abs(bodies%position(:, k)) > sharpest*bodies%radius(k))) call refuse("position: expected at most "// &
          & to_text(sharpest*bodies%radius(k), 4)//" m, "//far_text)
        if (.not. all(is_bounded(bodies%velocity(:, k)))) call refuse("velocity: expected "//bounded_text)
        if (bodies%material(k) < 1 .or. bodies%material(k) > most) call refuse("material "//to_text(bodies%material(k))// &
          & ": expected a number from 1 to "//to_text(most))
      end do
    end associate

  contains

    subroutine refuse(text)
      character(len=*), intent(in) :: text
      call raise(error, status_input, "add_bodies: body "//to_text(k)//": "//text)
    end subroutine refuse

  end subroutine check_newcomers

  !> Refuse places that bodies, boundaries or other newcomers take. What is found on a rank is not known to the others.
  subroutine check_places(loop, given, error)
    type(user_loop_t), intent(in) :: loop
    type(placed_t), intent(in) :: given
    type(error_t), allocatable, intent(inout) :: error
    integer :: k, j, s

    associate (simulation => loop%run%simulation, decomposition => loop%run%simulation%decomposition)
      do k = 1, given%n
        if (.not. is_clear(decomposition%boundaries, given%grain(k)%radius, given%position(:, k))) &
          & call refuse("a boundary of the scene")
        do j = 1, k - 1
          if (meets(given%position(:, j), given%grain(j)%radius)) call refuse("body "//to_text(j)//" of those to add")
        end do
        associate (before => simulation%inflow%given)
          do j = 1, before%n
            if (meets(before%position(:, j), before%grain(j)%radius)) call refuse("a body that was added before")
          end do
        end associate
        do s = 1, size(decomposition%owned)
          do j = 1, decomposition%owned(s)%n
            if (meets(decomposition%owned(s)%position(:, j), decomposition%owned(s)%radius(j))) &
              & call refuse("body "//to_text(decomposition%owned(s)%id(j))//" of the scene")
          end do
        end do
      end do
    end associate

  contains

    !> Whether newcomer k overlaps a body, or its nearest image.
    pure logical function meets(position, radius)
      real(dp), intent(in) :: position(:), radius
      real(dp) :: way(size(position))
      integer :: d

      way(:) = given%position(:, k) - position
      do d = 1, size(way)
        associate (length => loop%run%simulation%decomposition%period%length(d))
          if (length > 0.0_dp) way(d) = way(d) - length*anint(way(d)/length)
        end associate
      end do
      meets = sum(way**2) < (radius + given%grain(k)%radius)**2
    end function meets

    subroutine refuse(other)
      character(len=*), intent(in) :: other
      call raise(error, status_input, "add_bodies: body "//to_text(k)//": it overlaps "//other//"; expected a free place")
    end subroutine refuse

  end subroutine check_places

  !> Add grains behind others.
  subroutine join(given, more)
    type(placed_t), intent(inout) :: given
    type(placed_t), intent(in) :: more
    type(placed_t) :: old

    if (given%n == 0) then
      given = more
      return
    end if
    old = given
    deallocate (given%grain, given%position, given%material)
    given%n = old%n + more%n
    allocate (given%grain(given%n), given%position(size(more%position, 1), given%n), given%material(given%n))
    given%grain(1:old%n) = old%grain(1:old%n)
    given%position(:, 1:old%n) = old%position(:, 1:old%n)
    given%material(1:old%n) = old%material(1:old%n)
    given%grain(old%n + 1:) = more%grain
    given%position(:, old%n + 1:) = more%position
    given%material(old%n + 1:) = more%material
  end subroutine join

  !> Take bodies out of the scene at the start of the next step, as outlets do. Failures (status_input): an identifier that no free
  !> body has, or that stands twice. The same on all ranks. Collective.
  subroutine remove_bodies(loop, id, error)
    type(user_loop_t), intent(inout) :: loop
    integer(i8), intent(in) :: id(:)
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), allocatable :: listed(:), all_ids(:), found(:)
    real(dp), allocatable :: numbers(:)
    integer, allocatable :: order(:)
    integer :: k, s, n, n_before

    associate (decomposition => loop%run%simulation%decomposition)
      if (.not. loop%goes_on()) call raise(error, status_input, &
        & "remove: the run is over; expected a run that goes on")
      if (allocated(error) .or. size(id) == 0) return
      n_before = 0
      if (allocated(decomposition%dismissed)) n_before = size(decomposition%dismissed)
      n = n_before + size(id)
      allocate (listed(n), all_ids(n), order(n), found(size(id)))
      if (n_before > 0) listed(1:n_before) = decomposition%dismissed
      listed(n_before + 1:) = id
      call argsort(listed, order)
      do k = 1, n
        all_ids(k) = listed(order(k))
      end do
      do k = 2, size(all_ids)
        if (all_ids(k) == all_ids(k - 1)) call raise(error, status_input, "remove: body "//to_text(all_ids(k))// &
          & ": removed twice; expected each identifier once")
      end do
      found(:) = 0
      do s = 1, size(decomposition%owned)
        do k = 1, size(id)
          if (any(decomposition%owned(s)%id == id(k) .and. decomposition%owned(s)%glued == 0)) found(k) = 1
        end do
      end do
      call loop%comm%sum_counts(found)
      do k = 1, size(id)
        if (found(k) == 0) call raise(error, status_input, "remove: body "//to_text(id(k))// &
          & ": no free body of the scene; expected an identifier of one")
      end do
      associate (simulation => loop%run%simulation)
        if (any(simulation%cell_drive%driven) .and. n >= simulation%n_grains - simulation%n_glued) call raise(error, status_input, &
          & "remove: no free body would be left in a cell that stresses drive; expected one that stays")
      end associate
      if (allocated(error)) return
      call move_alloc(all_ids, decomposition%dismissed)
      allocate (numbers(size(id)))
      numbers(:) = real(id, dp)
      call loop%note("remove", size(id), numbers)
    end associate
  end subroutine remove_bodies

end module gravier_user_bodies
