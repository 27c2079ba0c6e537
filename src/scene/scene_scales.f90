!> The scales of a scene before its first step: grains, loads, speeds and rates, each the largest that time tables bring about.
module gravier_scene_scales
  use gravier_kinds, only: dp
  use gravier_motion, only: grain_volume
  use gravier_boundary, only: boundary_t
  use gravier_physics, only: physics_t
  use gravier_cell_drive, only: cell_drive_t
  use gravier_imposed_motion, only: imposed_motion_t, find_imposed
  use gravier_load_areas, only: find_load_areas
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: scene_scales_t

  !> least component along an axis of the normal of a plane that faces along it, and of one that carries grains
  real(dp), parameter :: carrying = 0.1_dp
  !> steps between two rows of a table from which on both are looked at
  real(dp), parameter :: close_rows = 0.125_dp
  real(dp), parameter :: pi = acos(-1.0_dp)
  !> fraction of space that grains fill in a square or cubic lattice: a looser scene has room to fall into
  real(dp), parameter :: loosest(2:3) = [pi/4.0_dp, pi/6.0_dp]

  !> The same on all ranks. What a scene does not have is 0.
  type :: scene_scales_t
    !> of the mean grain [m], [kg/m^3, kg/m^2 in 2D]; smallest radius, or half thickness, of the grains that are not glued [m]
    real(dp) :: diameter = 0.0_dp, density = 0.0_dp, smallest = 0.0_dp
    !> density of the grains of each material by the masses of a bodies file (materials, at least one); 0 without such a file, and
    !> of a material without grains [kg/m^3, kg/m^2 in 2D]
    real(dp), allocatable :: densities(:)
    !> acceleration by gravity and the force on volumes [m/s^2]; height that grains have to fall [m]
    real(dp) :: acceleration(3) = 0.0_dp, fall = 0.0_dp
    !> largest speed of a grain that enters, where it has fallen to the lowest support [m/s]
    real(dp) :: entering_speed = 0.0_dp
    !> largest pressure on a boundary that forces move [Pa, N/m in 2D], and which
    real(dp) :: pressure = 0.0_dp
    integer :: pressed = 0
    !> what that pressure does to the mean grain in a step [m/s]
    real(dp) :: load = 0.0_dp
    !> boundary that its largest load gives the least velocity in a step, and that [m/s]
    integer :: heaviest = 0
    real(dp) :: gain = 0.0_dp
    !> largest difference of imposed velocities [m/s], and the boundary that moves fastest then
    real(dp), private :: drive = 0.0_dp
    integer :: driver = 0
    !> that boundary's speed over its way to the one that faces it [1/s]; it moves along itself
    real(dp) :: rate = 0.0_dp
    logical :: shear = .false.
    !> largest imposed speed of a boundary [m/s], and which
    real(dp) :: speed = 0.0_dp
    integer :: fastest = 0
  contains
    procedure :: find => scene_scales_find
    procedure :: inertial_number => scene_scales_inertial_number
    procedure :: relative_step => scene_scales_relative_step
  end type scene_scales_t

  !> Where grains are, free ones and those of each boundary.
  type :: extent_t
    !> corners of the box of the free grains, radii included [m]
    real(dp) :: low(3) = 0.0_dp, high(3) = 0.0_dp
    !> that the free grains fill [m^3, m^2 in 2D]
    real(dp) :: volume = 0.0_dp
    !> mean place of the grains that are glued to each boundary, 0 without (3, boundaries) [m]
    real(dp), allocatable :: middle(:, :)
    !> there are such grains (boundaries)
    logical, allocatable :: has_glued(:)
  end type extent_t

contains

  !> Find the scales of a scene that has been distributed. Collective.
  subroutine scene_scales_find(self, simulation)
    class(scene_scales_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    type(extent_t) :: extent
    real(dp), allocatable :: times(:)

    self%diameter = simulation%velocity_scale%diameter
    call find_densities(simulation, self%densities)
    if (.not. self%diameter > 0.0_dp) return
    self%density = simulation%velocity_scale%mass/grain_volume(simulation%decomposition%nd, 0.5_dp*self%diameter)
    call find_extent(simulation, extent, self%smallest)
    call find_times(simulation, times)
    call scan(self, simulation, extent, times)
    call find_fall(self, simulation, extent)
    call find_entering(self, simulation, extent)
  end subroutine scene_scales_find

  !> I = rate d sqrt(rho/P); 0 where one of them is not known.
  pure real(dp) function scene_scales_inertial_number(self) result(inertial)
    class(scene_scales_t), intent(in) :: self

    inertial = 0.0_dp
    if (self%pressure > 0.0_dp) inertial = self%rate*self%diameter*sqrt(self%density/self%pressure)
  end function scene_scales_inertial_number

  !> a = h sqrt(P/rho)/d, the step in units of the time that the pressure gives the grains.
  pure real(dp) function scene_scales_relative_step(self, h) result(a)
    class(scene_scales_t), intent(in) :: self
    !> [s]
    real(dp), intent(in) :: h
    a = h*sqrt(self%pressure/self%density)/self%diameter
  end function scene_scales_relative_step

  !> Densities of the materials by masses and volumes of their grains, where a file gives the bodies. Collective.
  subroutine find_densities(simulation, densities)
    type(simulation_t), intent(in) :: simulation
    !> (materials, at least one)
    real(dp), allocatable, intent(out) :: densities(:)
    real(dp), allocatable :: parts(:, :), sums(:)
    real(dp) :: volume
    integer :: s, k, m, n

    n = max(1, size(simulation%config%materials))
    allocate (densities(n), source=0.0_dp)
    if (simulation%config%scene%bodies /= "file") return
    allocate (parts(2*n, size(simulation%decomposition%owned)), source=0.0_dp)
    allocate (sums(2*n))
    do s = 1, size(parts, 2)
      associate (owned => simulation%decomposition%owned(s))
        do k = 1, owned%n
          volume = grain_volume(owned%nd, owned%radius(k))
          if (owned%no > 0) then
            if (owned%shape(k) > 0) volume = simulation%decomposition%shapes%volume_of(owned%shape(k))*owned%radius(k)**owned%nd
          end if
          m = max(1, min(owned%material(k), n))
          parts(m, s) = parts(m, s) + owned%mass(k)
          parts(n + m, s) = parts(n + m, s) + volume
        end do
      end associate
    end do
    call simulation%comm%sum_parts(parts, sums)
    where (sums(n + 1:) > 0.0_dp) densities = sums(1:n)/sums(n + 1:)
  end subroutine find_densities

  !> Places of the grains and the smallest radius, of bodies with shapes half of the least thickness, in one pass. Collective.
  subroutine find_extent(simulation, extent, smallest)
    type(simulation_t), intent(in) :: simulation
    type(extent_t), intent(out) :: extent
    !> [m]
    real(dp), intent(out) :: smallest
    real(dp), allocatable :: parts(:, :), sums(:)
    real(dp) :: far(7)
    integer :: s, k, b, n, nd

    nd = simulation%decomposition%nd
    n = size(simulation%decomposition%boundaries)
    allocate (parts(1 + 4*n, size(simulation%decomposition%owned)), source=0.0_dp)
    allocate (sums(1 + 4*n))
    far(:) = -huge(1.0_dp)
    do s = 1, size(simulation%decomposition%owned)
      associate (owned => simulation%decomposition%owned(s))
        do k = 1, owned%n
          b = owned%glued(k)
          if (b > 0) then
            parts(4*b - 2, s) = parts(4*b - 2, s) + 1.0_dp
            parts(4*b - 1:4*b - 2 + nd, s) = parts(4*b - 1:4*b - 2 + nd, s) + owned%position(:, k)
            cycle
          end if
          parts(1, s) = parts(1, s) + simulation%decomposition%figures%volume_of(owned, k)
          far(1:nd) = max(far(1:nd), owned%radius(k) - owned%position(:, k))
          far(4:3 + nd) = max(far(4:3 + nd), owned%radius(k) + owned%position(:, k))
          far(7) = max(far(7), -simulation%decomposition%figures%half_thickness_of(owned, k))
        end do
      end associate
    end do
    call simulation%comm%highest_of(far)
    call simulation%comm%sum_parts(parts, sums)
    smallest = 0.0_dp
    if (far(7) < 0.0_dp .and. far(7) > -huge(1.0_dp)) then
      smallest = -far(7)
      extent%low(1:nd) = -far(1:nd)
      extent%high(1:nd) = far(4:3 + nd)
    end if
    extent%volume = sums(1)
    allocate (extent%middle(3, n), source=0.0_dp)
    allocate (extent%has_glued(n))
    do b = 1, n
      extent%has_glued(b) = sums(4*b - 2) > 0.0_dp
      if (extent%has_glued(b)) extent%middle(1:nd, b) = sums(4*b - 1:4*b - 2 + nd)/sums(4*b - 2)
    end do
  end subroutine find_extent

  !> Ends of steps at which something that tables give may be largest: those of the first and the last step, and those beside the
  !> rows, since means over a step are largest where it has a row in the middle or at an end. Of an oscillation its first two
  !> extremes, in either direction.
  subroutine find_times(simulation, times)
    type(simulation_t), intent(in) :: simulation
    !> in no order [s]
    real(dp), allocatable, intent(out) :: times(:)
    real(dp), allocatable :: found(:)
    real(dp) :: end_time, extreme(2)
    integer :: b, n, room

    end_time = simulation%config%time%steps*simulation%config%time%step
    room = 2
    if (allocated(simulation%gravity_table%time)) room = room + 4*size(simulation%gravity_table%time)
    if (allocated(simulation%cell_drive%table%time)) room = room + 4*size(simulation%cell_drive%table%time)
    do b = 1, size(simulation%decomposition%boundaries)
      associate (table => simulation%decomposition%boundaries(b)%drive%table)
        if (allocated(table%time)) room = room + 4*size(table%time)
      end associate
      if (simulation%decomposition%boundaries(b)%drive%oscillates()) room = room + 2
    end do
    allocate (found(room))
    found(1) = min(simulation%config%time%step, end_time)
    found(2) = end_time
    n = 2
    if (allocated(simulation%gravity_table%time)) call add_rows(simulation%gravity_table%time)
    if (allocated(simulation%cell_drive%table%time)) call add_rows(simulation%cell_drive%table%time)
    do b = 1, size(simulation%decomposition%boundaries)
      associate (table => simulation%decomposition%boundaries(b)%drive%table)
        if (allocated(table%time)) call add_rows(table%time)
      end associate
      if (.not. simulation%decomposition%boundaries(b)%drive%oscillates()) cycle
      call simulation%decomposition%boundaries(b)%drive%find_extremes(extreme)
      found(n + 1:n + 2) = min(extreme, end_time)
      n = n + 2
    end do
    allocate (times(n))
    times(:) = found(1:n)

  contains

    !> Rows that are closer to each other than a part of a step count once.
    subroutine add_rows(rows)
      real(dp), intent(in) :: rows(:)
      real(dp) :: h, last
      integer :: k, side

      h = simulation%config%time%step
      last = -huge(last)
      do k = 1, size(rows)
        if (rows(k) < last + close_rows*h .and. k < size(rows)) cycle
        last = rows(k)
        do side = -1, 2
          n = n + 1
          found(n) = min(max(last + 0.5_dp*side*h, 0.0_dp), end_time)
        end do
      end do
    end subroutine add_rows

  end subroutine find_times

  !> The largest loads and speeds of the steps that end at the times given.
  subroutine scan(self, simulation, extent, times)
    type(scene_scales_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    type(extent_t), intent(in) :: extent
    real(dp), intent(in) :: times(:)
    type(boundary_t) :: boundaries(size(simulation%decomposition%boundaries))
    type(physics_t) :: physics
    type(imposed_motion_t) :: motion
    type(cell_drive_t) :: cell_drive
    real(dp) :: area(size(simulation%decomposition%boundaries)), acceleration(3), pressure, speed
    !> velocity that the largest load of a boundary gives it in a step [m/s]
    real(dp) :: gain(size(simulation%decomposition%boundaries))
    integer :: k, b, d, nd

    nd = simulation%decomposition%nd
    boundaries(:) = simulation%decomposition%boundaries
    physics = simulation%physics
    cell_drive = simulation%cell_drive
    gain(:) = 0.0_dp
    call find_load_areas(simulation%decomposition, area)
    do k = 1, size(times)
      if (allocated(simulation%gravity_table%has)) then
        do d = 1, nd
          if (simulation%gravity_table%has(d)) physics%gravity(d) = simulation%gravity_table%load_of(d, times(k), physics%h)
        end do
      end if
      if (allocated(cell_drive%table%has)) call cell_drive%begin_step(simulation%decomposition%period, nd, simulation%mass, &
        & physics%h, times(k), physics%cell)
      acceleration(:) = physics%gravity + physics%body_force/self%density
      acceleration(nd + 1:) = 0.0_dp
      if (norm2(acceleration) > norm2(self%acceleration)) self%acceleration(:) = acceleration
      do b = 1, size(boundaries)
        call boundaries(b)%prescribe(nd, times(k), physics%h)
        if (boundaries(b)%lets_out()) cycle
        pressure = simulation%velocity_scale%pressure_of(nd, boundaries(b), times(k), physics%h, area(b))
        if (pressure > self%pressure) then
          self%pressure = pressure
          self%pressed = b
        end if
        if (pressure > 0.0_dp) then
          self%load = max(self%load, physics%h*pressure*min(area(b), self%diameter**(nd - 1))/simulation%velocity_scale%mass)
          gain(b) = max(gain(b), physics%h*pressure*area(b)/boundaries(b)%mass)
        end if
        speed = imposed_speed(boundaries(b), simulation%velocity_scale%lever(b))
        if (speed > self%speed) then
          self%speed = speed
          self%fastest = b
        end if
      end do
      call find_imposed(nd, boundaries, simulation%velocity_scale%lever, simulation%velocity_scale%diameter, physics, motion)
      if (motion%difference > self%drive) then
        self%drive = motion%difference
        call find_rate(self, boundaries, simulation%velocity_scale%lever, extent)
      end if
    end do
    if (any(gain > 0.0_dp)) then
      self%heaviest = minloc(gain, dim=1, mask=gain > 0.0_dp)
      self%gain = gain(self%heaviest)
    end if
  end subroutine scan

  !> Speed of the fastest point of a boundary, as far as it is imposed [m/s].
  pure real(dp) function imposed_speed(boundary, lever) result(speed)
    type(boundary_t), intent(in) :: boundary
    !> [m]
    real(dp), intent(in) :: lever
    speed = norm2(merge(0.0_dp, boundary%velocity, boundary%free)) + norm2(boundary%spin)*lever
  end function imposed_speed

  !> The boundary that drives with the velocities that they have, and the rate that it gives the grains between it and the
  !> farthest one that faces it.
  subroutine find_rate(self, boundaries, lever, extent)
    type(scene_scales_t), intent(inout) :: self
    type(boundary_t), intent(in) :: boundaries(:)
    real(dp), intent(in) :: lever(:)
    type(extent_t), intent(in) :: extent
    real(dp) :: speed, place, other, height, velocity(3)
    integer :: b, axis
    logical :: known

    self%driver = 0
    self%rate = 0.0_dp
    self%shear = .false.
    speed = 0.0_dp
    do b = 1, size(boundaries)
      if (boundaries(b)%lets_out() .or. imposed_speed(boundaries(b), lever(b)) <= speed) cycle
      speed = imposed_speed(boundaries(b), lever(b))
      self%driver = b
    end do
    if (self%driver == 0) return
    associate (driver => boundaries(self%driver))
      if (any(abs(driver%spin) > 0.0_dp)) return
      axis = 0
      if (self%pressed > 0) axis = boundaries(self%pressed)%load_axis()
      if (driver%is_plane() .or. driver%is_driven()) axis = driver%load_axis()
      if (axis == 0) return
      call find_place(driver, self%driver, axis, extent, place, known)
      if (.not. known) return
      height = 0.0_dp
      do b = 1, size(boundaries)
        if (b == self%driver) cycle
        call find_place(boundaries(b), b, axis, extent, other, known)
        if (known) height = max(height, abs(other - place))
      end do
      if (.not. height > 0.0_dp) return
      self%rate = self%drive/height
      velocity(:) = merge(0.0_dp, driver%velocity, driver%free)
      self%shear = norm2(velocity) > 2.0_dp*abs(velocity(axis))
    end associate
  end subroutine find_rate

  !> Where a boundary stands along an axis, if it has a place there.
  pure subroutine find_place(boundary, b, axis, extent, place, known)
    type(boundary_t), intent(in) :: boundary
    !> its number
    integer, intent(in) :: b, axis
    type(extent_t), intent(in) :: extent
    !> [m]
    real(dp), intent(out) :: place
    logical, intent(out) :: known

    if (boundary%is_glued()) then
      place = extent%middle(axis, b)
      known = extent%has_glued(b)
    else
      call boundary%surface%level(axis, place, known)
    end if
  end subroutine find_place

  !> Height that the grains have to fall: that of the topmost one above the lowest support, as far as the grains do not fill it.
  subroutine find_fall(self, simulation, extent)
    type(scene_scales_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    type(extent_t), intent(in) :: extent
    real(dp) :: up, top, support, height, footprint
    integer :: axis, b, d, nd

    self%fall = 0.0_dp
    nd = simulation%decomposition%nd
    if (.not. (norm2(self%acceleration) > 0.0_dp .and. extent%volume > 0.0_dp)) return
    axis = maxloc(abs(self%acceleration), dim=1)
    up = -sign(1.0_dp, self%acceleration(axis))
    top = max(up*extent%low(axis), up*extent%high(axis))
    support = huge(1.0_dp)
    do b = 1, size(simulation%decomposition%boundaries)
      support = min(support, support_of(simulation%decomposition%boundaries(b), b, axis, up, extent))
    end do
    if (.not. support < top) return
    height = top - support
    footprint = 1.0_dp
    do d = 1, nd
      if (d == axis) cycle
      if (simulation%decomposition%period%length(d) > 0.0_dp) then
        footprint = footprint*simulation%decomposition%period%length(d)
      else
        footprint = footprint*(extent%high(d) - extent%low(d))
      end if
    end do
    self%fall = min(height*(1.0_dp - extent%volume/(footprint*height*loosest(nd))), height - self%diameter)
    self%fall = max(self%fall, 0.0_dp)
  end subroutine find_fall

  !> The largest speed of a grain that enters: that which it has then, and what it gains as it falls to the lowest support.
  subroutine find_entering(self, simulation, extent)
    class(scene_scales_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    type(extent_t), intent(in) :: extent
    type(extent_t) :: region
    real(dp) :: up, top, support, fall
    integer :: axis, i, b

    self%entering_speed = 0.0_dp
    axis = maxloc(abs(self%acceleration), dim=1)
    up = -sign(1.0_dp, self%acceleration(axis))
    region = extent
    do i = 1, size(simulation%inflow%insertions)
      associate (insertion => simulation%inflow%insertions(i))
        region%low(:) = insertion%lower
        region%high(:) = insertion%upper
        top = max(up*region%low(axis), up*region%high(axis))
        support = huge(1.0_dp)
        do b = 1, size(simulation%decomposition%boundaries)
          support = min(support, support_of(simulation%decomposition%boundaries(b), b, axis, up, region))
        end do
        fall = 0.0_dp
        if (support < top) fall = max(top - support - self%diameter, 0.0_dp)
        self%entering_speed = max(self%entering_speed, sqrt(sum((abs(insertion%velocity) + insertion%spread)**2) + &
          & 2.0_dp*norm2(self%acceleration)*fall))
      end associate
    end do
  end subroutine find_entering

  !> Height of the lowest point of a boundary that carries grains, below the middle of the grains where it is a plane; huge
  !> where it carries none [m].
  pure real(dp) function support_of(boundary, b, axis, up, extent) result(support)
    type(boundary_t), intent(in) :: boundary
    !> its number; axis of the fall
    integer, intent(in) :: b, axis
    !> 1 or -1: sense of the axis that is up
    real(dp), intent(in) :: up
    type(extent_t), intent(in) :: extent
    real(dp) :: middle(3)

    support = huge(1.0_dp)
    if (boundary%is_glued()) then
      if (extent%has_glued(b)) support = up*extent%middle(axis, b)
    else if (boundary%is_plane()) then
      associate (plane => boundary%surface)
        if (up*plane%axis(axis) < carrying) return
        middle(:) = 0.5_dp*(extent%low + extent%high)
        support = up*(middle(axis) + sum(plane%axis*(plane%point - middle))/plane%axis(axis))
      end associate
    else if (.not. boundary%lets_out()) then
      support = boundary%surface%support(axis, up)
    end if
  end function support_of

end module gravier_scene_scales
