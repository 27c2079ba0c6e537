!> Boundaries: rigid bodies of simple shapes that bound the grains and are driven by what the user prescribes. There
!> are few of them, and every rank knows them all.
module gravier_boundary
  use gravier_kinds, only: dp, i8
  use gravier_rotation, only: make_rotation, rotate, rigid_velocity
  use gravier_contact_coefficients, only: coefficients_t
  use gravier_boundary_drive, only: boundary_drive_t
  use gravier_surface, only: surface_t
  use gravier_facet, only: near_facets_t
  use gravier_surface_registry, only: glued_grains
  implicit none
  private
  public :: boundary_t

  !> A boundary. In 2D vectors have a third component of 0, and spins only a third one.
  type :: boundary_t
    integer(i8) :: id = 0
    character(len=:), allocatable :: name
    !> where it is and what it is; not allocated for grains that are glued to each other, which have no other surface
    class(surface_t), allocatable :: surface
    !> axis that a plane faces along as it was made, negative where it faces down the axis; 0 of all else (gravier_facing_planes)
    integer :: faces = 0
    !> grains: their group in the bodies file
    integer :: group = 0
    !> the point it turns about [m]
    real(dp) :: pivot(3) = 0.0_dp
    !> at the present time [m/s], [rad/s]
    real(dp) :: velocity(3) = 0.0_dp, spin(3) = 0.0_dp
    !> at the start of the step [m/s], [rad/s]
    real(dp) :: last_velocity(3) = 0.0_dp, last_spin(3) = 0.0_dp
    !> its prescribed motion and loads
    type(boundary_drive_t) :: drive
    !> components of translation that forces move
    logical :: free(3) = .false.
    !> inertia against forces [kg]
    real(dp) :: mass = 0.0_dp
    !> with grains
    type(coefficients_t) :: contact
    !> number of its material, 0 for none
    integer :: material = 0
    !> [s]
    real(dp) :: remove_at = huge(1.0_dp)
    !> false once removed
    logical :: present = .true.
    !> of the scene, 0 along axes that are not periodic: what has a finite extent acts on the image of a grain that is nearest [m]
    real(dp) :: period(3) = 0.0_dp
  contains
    procedure :: shape_name => boundary_shape_name
    procedure :: touches => boundary_touches
    procedure :: lets_out => boundary_lets_out
    procedure :: is_plane => boundary_is_plane
    procedure :: is_glued => boundary_is_glued
    procedure :: is_faceted => boundary_is_faceted
    procedure :: find_facets => boundary_find_facets
    procedure :: lies_between => boundary_lies_between
    procedure :: find_place => boundary_find_place
    procedure :: is_driven => boundary_is_driven
    procedure :: is_moved => boundary_is_moved
    procedure :: half_width => boundary_half_width
    procedure :: find_image
    procedure :: locate => boundary_locate
    procedure :: has_corners => boundary_has_corners
    procedure :: find_corners => boundary_find_corners
    procedure :: velocity_at => boundary_velocity_at
    procedure :: last_velocity_at => boundary_last_velocity_at
    procedure :: prescribe => boundary_prescribe
    procedure :: applied_force => boundary_applied_force
    procedure :: load_changes => boundary_load_changes
    procedure :: load_axis => boundary_load_axis
    procedure :: move => boundary_move
    procedure :: carry => boundary_carry
    procedure :: shift => boundary_shift
    procedure :: get_state => boundary_get_state
    procedure :: set_state => boundary_set_state
  end type boundary_t

  !> words of the state of a boundary
  integer, parameter, public :: boundary_words = 28
  !> what they are, in their order: the version of checkpoints, which changes with them
  character(len=*), parameter, public :: boundary_record = &
    & "present point axis edges pivot velocity spin last_velocity last_spin"

contains

  !> The word for what it is.
  pure function boundary_shape_name(self) result(name)
    class(boundary_t), intent(in) :: self
    character(len=:), allocatable :: name

    name = glued_grains
    if (.not. allocated(self%surface)) return
    name = trim(self%surface%is%kind)
  end function boundary_shape_name

  !> Whether grains can have a contact with its surface.
  pure logical function boundary_touches(self)
    class(boundary_t), intent(in) :: self

    boundary_touches = self%present .and. allocated(self%surface)
    if (boundary_touches) boundary_touches = self%surface%is%touches
  end function boundary_touches

  !> Whether grains leave the scene behind it, while it is there or not.
  pure logical function boundary_lets_out(self)
    class(boundary_t), intent(in) :: self

    boundary_lets_out = allocated(self%surface)
    if (boundary_lets_out) boundary_lets_out = self%surface%is%lets_out
  end function boundary_lets_out

  !> Whether it is a plane that grains can touch, while it is there or not.
  pure logical function boundary_is_plane(self)
    class(boundary_t), intent(in) :: self

    boundary_is_plane = allocated(self%surface)
    if (boundary_is_plane) boundary_is_plane = self%surface%is%endless .and. self%surface%is%touches
  end function boundary_is_plane

  !> Whether it is a group of grains that are glued to each other.
  pure logical function boundary_is_glued(self)
    class(boundary_t), intent(in) :: self
    boundary_is_glued = .not. allocated(self%surface)
  end function boundary_is_glued

  !> Whether it is made of facets, so that a grain may touch it in several points; while it is there or not.
  pure logical function boundary_is_faceted(self)
    class(boundary_t), intent(in) :: self

    boundary_is_faceted = allocated(self%surface)
    if (boundary_is_faceted) boundary_is_faceted = self%surface%is%faceted
  end function boundary_is_faceted

  !> Whether forces move it.
  pure logical function boundary_is_driven(self)
    class(boundary_t), intent(in) :: self
    boundary_is_driven = any(self%free)
  end function boundary_is_driven

  !> Whether it moves now, but for what forces make of it.
  pure logical function boundary_is_moved(self)
    class(boundary_t), intent(in) :: self
    boundary_is_moved = any(abs(self%velocity) > 0.0_dp .and. .not. self%free) .or. any(abs(self%spin) > 0.0_dp)
  end function boundary_is_moved

  !> The point that its shape names; of glued grains, the pivot [m].
  pure subroutine boundary_find_place(self, place)
    class(boundary_t), intent(in) :: self
    real(dp), intent(out) :: place(3)

    place(:) = self%pivot
    if (allocated(self%surface)) place(:) = self%surface%point
  end subroutine boundary_find_place

  !> Half of what a surface that ends takes along axis `d`, in any position that it may turn to [m].
  pure real(dp) function boundary_half_width(self, d) result(half)
    class(boundary_t), intent(in) :: self
    integer, intent(in) :: d
    half = self%surface%half_width(d, self%drive%turns())
  end function boundary_half_width

  !> The image of a point that is nearest to the middle of a surface that ends, or to the pivot of glued grains. What is endless
  !> takes the point as it is.
  pure subroutine find_image(self, x, image)
    class(boundary_t), intent(in) :: self
    !> (nd) [m]
    real(dp), intent(in) :: x(:)
    real(dp), intent(out) :: image(3)
    real(dp) :: middle(3)
    integer :: d

    image(:) = 0.0_dp
    image(1:size(x)) = x
    if (.not. any(self%period > 0.0_dp)) return
    middle(:) = self%pivot
    if (allocated(self%surface)) then
      if (self%surface%is%endless) return
      call self%surface%find_middle(middle)
    end if
    do d = 1, size(x)
      if (self%period(d) > 0.0_dp) image(d) = x(d) - self%period(d)*anint((x(d) - middle(d))/self%period(d))
    end do
  end subroutine find_image

  !> Nearest point of its surface: distance from it, negative behind a surface that has a behind, and unit normal there towards
  !> `x`. Glued grains have no surface to ask for.
  pure subroutine boundary_locate(self, x, distance, normal)
    class(boundary_t), intent(in) :: self
    !> (nd) [m]
    real(dp), intent(in) :: x(:)
    real(dp), intent(out) :: distance
    !> (nd)
    real(dp), intent(out) :: normal(:)
    real(dp) :: from(3), away(3)

    call find_image(self, x, from)
    from(:) = from - self%surface%point
    call self%surface%locate(from, distance, away)
    normal(:) = away(1:size(x))
  end subroutine boundary_locate

  !> The facets within `reach` of a point, seen from there, of a faceted surface. One that does not turn may be as wide as the
  !> period, so that its images are looked at as well. In 2D facets that continue each other are one.
  pure subroutine boundary_find_facets(self, x, reach, near)
    class(boundary_t), intent(in) :: self
    !> (nd) [m], and [m]; what `near` held is lost
    real(dp), intent(in) :: x(:), reach
    type(near_facets_t), intent(inout) :: near
    real(dp) :: image(3), from(3)
    !> `seen`: images of the surface that have facets there
    integer :: images(3), i, j, k, before, seen

    near%n = 0
    seen = 0
    call find_image(self, x, image)
    images(:) = merge(1, 0, self%period > 0.0_dp .and. .not. self%drive%turns())
    do k = -images(3), images(3)
      do j = -images(2), images(2)
        do i = -images(1), images(1)
          from(1) = image(1) + i*self%period(1)
          from(2) = image(2) + j*self%period(2)
          from(3) = image(3) + k*self%period(3)
          from(:) = from - self%surface%point
          before = near%n
          call self%surface%find_facets(from, reach, near)
          if (near%n > before) seen = seen + 1
        end do
      end do
    end do
    if (seen > 1) call near%number_images()
    if (size(x) == 2) call near%join_lines()
  end subroutine boundary_find_facets

  !> Whether its surface, which has no thickness, lies between two points: the line from one to the other goes through it. A mesh
  !> that does not turn may be as wide as the period, so that its images are looked at as well.
  pure logical function boundary_lies_between(self, place, branch) result(between)
    class(boundary_t), intent(in) :: self
    !> a point, and the way to it from the other one (nd) [m]
    real(dp), intent(in) :: place(:), branch(:)
    real(dp) :: image(3), from(3), to(3)
    integer :: images(3), i, j, k

    call find_image(self, place, image)
    image(:) = image - self%surface%point
    images(:) = merge(1, 0, self%period > 0.0_dp .and. self%surface%is%faceted .and. .not. self%drive%turns())
    between = .false.
    do k = -images(3), images(3)
      do j = -images(2), images(2)
        do i = -images(1), images(1)
          from(1) = image(1) + i*self%period(1)
          from(2) = image(2) + j*self%period(2)
          from(3) = image(3) + k*self%period(3)
          to(:) = from
          to(1:size(branch)) = from(1:size(branch)) - branch
          between = self%surface%parts(from, to)
          if (between) return
        end do
      end do
    end do
  end function boundary_lies_between

  !> Whether its surface is a segment or a rectangle.
  pure logical function boundary_has_corners(self)
    class(boundary_t), intent(in) :: self

    boundary_has_corners = allocated(self%surface)
    if (boundary_has_corners) boundary_has_corners = .not. (self%surface%is%endless .or. self%surface%is%faceted) .and. &
      & any(abs(self%surface%edge) > 0.0_dp)
  end function boundary_has_corners

  !> The corners of a surface that ends, in order around it, from a point: two of a segment, four of a rectangle; none of what goes
  !> on for ever, is round or has facets.
  pure subroutine boundary_find_corners(self, x, n, corners)
    class(boundary_t), intent(in) :: self
    !> (nd) [m]
    real(dp), intent(in) :: x(:)
    integer, intent(out) :: n
    !> (3, n), those of the image that is nearest to the point, without ends where it goes round a period [m]
    real(dp), intent(out) :: corners(3, 4)
    real(dp) :: from(3), edge(3, 2)

    n = 0
    corners(:, :) = 0.0_dp
    if (.not. self%has_corners()) return
    call find_image(self, x, from)
    n = merge(2, 4, .not. any(abs(self%surface%edge(:, 2)) > 0.0_dp))
    corners(:, 1) = self%surface%point - from
    call self%surface%stretch(self%period, corners(:, 1), edge)
    corners(:, 2) = corners(:, 1) + edge(:, 1)
    corners(:, 3) = corners(:, 2) + edge(:, 2)
    corners(:, 4) = corners(:, 1) + edge(:, 2)
  end subroutine boundary_find_corners

  !> Velocity of the material point at `x` [m/s].
  pure subroutine boundary_velocity_at(self, x, velocity)
    class(boundary_t), intent(in) :: self
    !> (nd) [m]
    real(dp), intent(in) :: x(:)
    !> (nd)
    real(dp), intent(out) :: velocity(:)
    real(dp) :: image(3)

    call find_image(self, x, image)
    call rigid_velocity(image, self%pivot, self%velocity, self%spin, velocity)
  end subroutine boundary_velocity_at

  !> The same with velocity and spin at the start of the step.
  pure subroutine boundary_last_velocity_at(self, x, velocity)
    class(boundary_t), intent(in) :: self
    !> (nd) [m]
    real(dp), intent(in) :: x(:)
    !> (nd)
    real(dp), intent(out) :: velocity(:)
    real(dp) :: image(3)

    call find_image(self, x, image)
    call rigid_velocity(image, self%pivot, self%last_velocity, self%last_spin, velocity)
  end subroutine boundary_last_velocity_at

  !> Set the prescribed velocity and spin of the end of a step; free components are left.
  pure subroutine boundary_prescribe(self, nd, time, step)
    class(boundary_t), intent(inout) :: self
    integer, intent(in) :: nd
    !> [s]
    real(dp), intent(in) :: time, step
    integer :: d

    do d = 1, nd
      if (.not. self%free(d)) self%velocity(d) = self%drive%velocity_at(d, time, step)
    end do
    do d = merge(3, 1, nd == 2), 3
      self%spin(d) = self%drive%spin_at(d, time, step)
    end do
  end subroutine boundary_prescribe

  !> Force of the user on the free components in the step that ends at a time [N].
  pure subroutine boundary_applied_force(self, nd, time, step, area, force)
    class(boundary_t), intent(in) :: self
    integer, intent(in) :: nd
    !> [s]; the area that a pressure works on [m^2, m in 2D]
    real(dp), intent(in) :: time, step, area
    !> (nd); 0 on other components
    real(dp), intent(out) :: force(:)
    real(dp) :: normal(3)
    integer :: d

    force(:) = 0.0_dp
    normal(:) = 0.0_dp
    if (allocated(self%surface)) normal(:) = self%surface%axis
    do d = 1, nd
      if (.not. self%free(d)) cycle
      force(d) = self%drive%force_at(d, time, step) + self%drive%pressure_at(time, step)*area*normal(d)
    end do
  end subroutine boundary_applied_force

  !> Whether the force or the pressure that moves it in the step that ends at a time differs from that of the step before.
  pure logical function boundary_load_changes(self, time, step) result(changes)
    class(boundary_t), intent(in) :: self
    !> [s]
    real(dp), intent(in) :: time, step
    integer :: d

    changes = .false.
    if (.not. (self%is_driven() .and. self%drive%changes())) return
    changes = abs(self%drive%pressure_at(time, step) - self%drive%pressure_at(time - step, step)) > 0.0_dp
    do d = 1, 3
      if (self%free(d)) changes = changes .or. &
        & abs(self%drive%force_at(d, time, step) - self%drive%force_at(d, time - step, step)) > 0.0_dp
    end do
  end function boundary_load_changes

  !> Axis along which forces move the boundary: of a plane that of its normal, else that of the largest given force among
  !> the free ones.
  pure integer function boundary_load_axis(self) result(axis)
    class(boundary_t), intent(in) :: self
    integer :: d

    if (self%is_plane()) then
      axis = maxloc(abs(self%surface%axis), dim=1)
      return
    end if
    axis = findloc(self%free, .true., dim=1)
    do d = axis + 1, 3
      if (self%free(d) .and. abs(self%drive%force(d)) > abs(self%drive%force(max(axis, 1)))) axis = d
    end do
    axis = max(axis, 1)
  end function boundary_load_axis

  !> Move the boundary with its velocity and spin for a time.
  pure subroutine boundary_move(self, duration)
    class(boundary_t), intent(inout) :: self
    !> [s]
    real(dp), intent(in) :: duration
    real(dp) :: turn(3, 3), angle(3)

    if (allocated(self%surface)) then
      associate (surface => self%surface)
        if (any(abs(self%spin) > 0.0_dp)) then
          angle(:) = self%spin*duration
          call make_rotation(angle, turn)
          surface%point(:) = surface%point - self%pivot
          call rotate(turn, surface%point)
          surface%point(:) = surface%point + self%pivot
          call rotate(turn, surface%axis)
          call rotate(turn, surface%edge(:, 1))
          call rotate(turn, surface%edge(:, 2))
        end if
        surface%point(:) = surface%point + duration*self%velocity
      end associate
    end if
    self%pivot(:) = self%pivot + duration*self%velocity
  end subroutine boundary_move

  !> Move a point with the boundary for a time; the boundary itself has not moved yet.
  pure subroutine boundary_carry(self, duration, x)
    class(boundary_t), intent(in) :: self
    real(dp), intent(in) :: duration
    !> (nd) [m]
    real(dp), intent(inout) :: x(:)
    real(dp) :: place(3), arm(3), turn(3, 3), angle(3)
    integer :: nd

    nd = size(x)
    if (any(abs(self%spin) > 0.0_dp)) then
      call find_image(self, x, place)
      arm(:) = place - self%pivot
      angle(:) = self%spin*duration
      call make_rotation(angle, turn)
      call rotate(turn, arm)
      ! the image that was moved, back to where the point was
      x(:) = self%pivot(1:nd) + arm(1:nd) + (x - place(1:nd))
    end if
    x(:) = x + duration*self%velocity(1:nd)
  end subroutine boundary_carry

  !> Put the boundary elsewhere, with the velocity that it has.
  pure subroutine boundary_shift(self, way)
    class(boundary_t), intent(inout) :: self
    !> (nd) [m]
    real(dp), intent(in) :: way(:)

    if (allocated(self%surface)) self%surface%point(1:size(way)) = self%surface%point(1:size(way)) + way
    self%pivot(1:size(way)) = self%pivot(1:size(way)) + way
  end subroutine boundary_shift

  !> Everything of a boundary that time changes, bit for bit.
  pure subroutine boundary_get_state(self, words)
    class(boundary_t), intent(in) :: self
    integer(i8), intent(out) :: words(boundary_words)
    real(dp) :: state(boundary_words - 1)
    integer :: k

    state(:) = 0.0_dp
    call self%find_place(state(1:3))
    if (allocated(self%surface)) then
      state(4:6) = self%surface%axis
      state(7:9) = self%surface%edge(:, 1)
      state(10:12) = self%surface%edge(:, 2)
    end if
    state(13:15) = self%pivot
    state(16:18) = self%velocity
    state(19:21) = self%spin
    state(22:24) = self%last_velocity
    state(25:27) = self%last_spin
    words(1) = merge(1_i8, 0_i8, self%present)
    do k = 1, size(state)
      words(1 + k) = transfer(state(k), 0_i8)
    end do
  end subroutine boundary_get_state

  pure subroutine boundary_set_state(self, words)
    class(boundary_t), intent(inout) :: self
    integer(i8), intent(in) :: words(boundary_words)
    real(dp) :: state(boundary_words - 1)
    integer :: k

    do k = 1, size(state)
      state(k) = transfer(words(1 + k), 0.0_dp)
    end do
    self%present = words(1) == 1
    if (allocated(self%surface)) then
      self%surface%point(:) = state(1:3)
      self%surface%axis(:) = state(4:6)
      self%surface%edge(:, 1) = state(7:9)
      self%surface%edge(:, 2) = state(10:12)
    end if
    self%pivot(:) = state(13:15)
    self%velocity(:) = state(16:18)
    self%spin(:) = state(19:21)
    self%last_velocity(:) = state(22:24)
    self%last_spin(:) = state(25:27)
  end subroutine boundary_set_state

end module gravier_boundary
