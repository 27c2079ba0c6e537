!> Boundaries: nearest points of every shape, prescribed motion, forces, states.
program test_boundary
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_boundary, only: boundary_t, boundary_words
  use gravier_boundary_drive, only: drive_names
  use gravier_surface, only: surface_features_t
  use gravier_surface_registry, only: surface_holder_t, registered_surfaces, make_surface
  use gravier_test_scenes, only: draw, change_shape
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  real(dp), parameter :: pi = acos(-1.0_dp)
  !> a few roundings of numbers of size 1
  real(dp), parameter :: rounding = 16*epsilon(1.0_dp)

  call MPI_Init()
  call test_plane()
  call test_segment()
  call test_rectangle()
  call test_circle()
  call test_cylinder()
  call test_nearest()
  call test_kinds()
  call test_velocity()
  call test_rotation_2d()
  call test_rotation_3d()
  call test_axis_of_rotation()
  call test_drives(2)
  call test_drives(3)
  call test_oscillation()
  call test_forces()
  call test_shift()
  call test_state()
  call finish_checks()
  call MPI_Finalize()

contains

  subroutine check_vector(value, expected, tolerance, name)
    real(dp), intent(in) :: value(:), expected(:), tolerance
    character(len=*), intent(in) :: name
    integer :: d

    do d = 1, size(value)
      call check_close(value(d), expected(d), tolerance, name//", component "//achar(48 + d))
    end do
  end subroutine check_vector

  subroutine check_located(boundary, x, distance, normal, name)
    type(boundary_t), intent(in) :: boundary
    !> (nd)
    real(dp), intent(in) :: x(:), distance, normal(:)
    character(len=*), intent(in) :: name
    real(dp) :: found, found_normal(size(x))

    call boundary%locate(x, found, found_normal)
    call check_close(found, distance, rounding, name//": distance")
    call check_vector(found_normal, normal, rounding, name//": normal")
  end subroutine check_located

  subroutine test_plane()
    type(boundary_t) :: b

    call make_surface("plane", b%surface)
    b%surface%point(1:2) = [1.0_dp, 2.0_dp]
    b%surface%axis(1:2) = [0.6_dp, 0.8_dp]
    call check_located(b, [1.6_dp, 2.8_dp], 1.0_dp, [0.6_dp, 0.8_dp], "before a plane")
    call check_located(b, [0.4_dp, 1.2_dp], -1.0_dp, [0.6_dp, 0.8_dp], "behind a plane")
    call change_shape("outlet", b)
    call check_located(b, [0.4_dp, 1.2_dp], -1.0_dp, [0.6_dp, 0.8_dp], "behind an outlet")
    call change_shape("plane", b)
    b%surface%point(:) = [0.0_dp, 0.0_dp, 1.0_dp]
    b%surface%axis(:) = [0.0_dp, 0.0_dp, -1.0_dp]
    call check_located(b, [7.0_dp, 8.0_dp, -1.0_dp], 2.0_dp, [0.0_dp, 0.0_dp, -1.0_dp], "below a lid")
  end subroutine test_plane

  subroutine test_segment()
    type(boundary_t) :: b

    call make_surface("segment", b%surface)
    b%surface%point(1:2) = [1.0_dp, 1.0_dp]
    b%surface%edge(1:2, 1) = [2.0_dp, 0.0_dp]
    call check_located(b, [2.0_dp, 1.5_dp], 0.5_dp, [0.0_dp, 1.0_dp], "above a segment")
    call check_located(b, [2.0_dp, 0.5_dp], 0.5_dp, [0.0_dp, -1.0_dp], "below a segment")
    call check_located(b, [3.75_dp, 2.0_dp], 1.25_dp, [0.6_dp, 0.8_dp], "beyond the second end")
    call check_located(b, [0.25_dp, 0.0_dp], 1.25_dp, [-0.6_dp, -0.8_dp], "before the first end")
    call check_located(b, [1.0_dp, 3.0_dp], 2.0_dp, [0.0_dp, 1.0_dp], "at the first end")
    call check_located(b, [1.5_dp, 1.0_dp], 0.0_dp, [0.0_dp, -1.0_dp], "on a segment")
    call check_located(b, [5.0_dp, 1.0_dp], 2.0_dp, [1.0_dp, 0.0_dp], "in line with a segment")
  end subroutine test_segment

  subroutine test_rectangle()
    type(boundary_t) :: b
    real(dp) :: x(3)

    call make_surface("rectangle", b%surface)
    b%surface%point(:) = [1.0_dp, 1.0_dp, 1.0_dp]
    b%surface%edge(:, 1) = [2.0_dp, 0.0_dp, 0.0_dp]
    b%surface%edge(:, 2) = [0.0_dp, 3.0_dp, 0.0_dp]
    call check_located(b, [2.0_dp, 3.0_dp, 1.5_dp], 0.5_dp, [0.0_dp, 0.0_dp, 1.0_dp], "above a face")
    call check_located(b, [2.0_dp, 3.0_dp, 0.5_dp], 0.5_dp, [0.0_dp, 0.0_dp, -1.0_dp], "below a face")
    call check_located(b, [0.25_dp, 2.0_dp, 2.0_dp], 1.25_dp, [-0.6_dp, 0.0_dp, 0.8_dp], "off the first edge")
    call check_located(b, [3.75_dp, 2.0_dp, 0.0_dp], 1.25_dp, [0.6_dp, 0.0_dp, -0.8_dp], "off the opposite edge")
    call check_located(b, [2.0_dp, 4.75_dp, 2.0_dp], 1.25_dp, [0.0_dp, 0.6_dp, 0.8_dp], "off another edge")
    call check_located(b, [5.0_dp, 5.0_dp, 2.0_dp], sqrt(6.0_dp), &
      & [2.0_dp, 1.0_dp, 1.0_dp]/sqrt(6.0_dp), "off the far corner")
    call check_located(b, [-1.0_dp, -1.0_dp, 0.0_dp], 3.0_dp, [-2.0_dp, -2.0_dp, -1.0_dp]/3.0_dp, "off the corner")
    call check_located(b, [2.0_dp, 2.0_dp, 1.0_dp], 0.0_dp, [0.0_dp, 0.0_dp, 1.0_dp], "on a face")
    ! edges along no axis
    b%surface%edge(:, 1) = [2.0_dp, 2.0_dp, 0.0_dp]
    b%surface%edge(:, 2) = [1.0_dp, -1.0_dp, 2.0_dp]
    x(:) = b%surface%point + 0.3_dp*b%surface%edge(:, 1) + 0.9_dp*b%surface%edge(:, 2) + [1.0_dp, -1.0_dp, -1.0_dp]
    call check_located(b, x, sqrt(3.0_dp), &
      & [1.0_dp, -1.0_dp, -1.0_dp]/sqrt(3.0_dp), "before a tilted face")
  end subroutine test_rectangle

  subroutine test_circle()
    type(boundary_t) :: b

    call make_surface("circle", b%surface)
    b%surface%point(1:2) = [1.0_dp, 1.0_dp]
    b%surface%radius = 2.0_dp
    call check_located(b, [1.6_dp, 1.8_dp], 1.0_dp, [-0.6_dp, -0.8_dp], "in a circle")
    call check_located(b, [2.8_dp, 3.4_dp], -1.0_dp, [-0.6_dp, -0.8_dp], "out of a circle")
    call check_located(b, [1.0_dp, 1.0_dp], 2.0_dp, [1.0_dp, 0.0_dp], "centre of a circle")
  end subroutine test_circle

  !> Along z, and along a diagonal.
  subroutine test_cylinder()
    type(boundary_t) :: b
    real(dp), parameter :: axis(3) = [0.6_dp, 0.0_dp, 0.8_dp], out(3) = [0.8_dp, 0.0_dp, -0.6_dp]
    real(dp) :: distance, normal(3), x(3)

    call make_surface("cylinder", b%surface)
    b%surface%point(:) = [1.0_dp, 1.0_dp, 5.0_dp]
    b%surface%radius = 2.0_dp
    b%surface%axis(:) = [0.0_dp, 0.0_dp, 1.0_dp]
    call check_located(b, [1.6_dp, 1.8_dp, -7.0_dp], 1.0_dp, [-0.6_dp, -0.8_dp, 0.0_dp], "in a cylinder")
    call check_located(b, [2.8_dp, 3.4_dp, 9.0_dp], -1.0_dp, [-0.6_dp, -0.8_dp, 0.0_dp], "out of a cylinder")
    b%surface%axis(:) = axis
    x(:) = b%surface%point - 3.0_dp*axis + 0.5_dp*out
    call check_located(b, x, 1.5_dp, -out, "in a tilted cylinder")
    b%surface%axis(:) = [0.0_dp, 0.0_dp, 1.0_dp]
    call b%locate([1.0_dp, 1.0_dp, 3.0_dp], distance, normal)
    call check_close(distance, 2.0_dp, rounding, "axis of a cylinder: distance")
    call check_close(norm2(normal), 1.0_dp, rounding, "axis of a cylinder: a unit normal")
    ! where the axis is along x the normal must not be
    b%surface%axis(:) = [1.0_dp, 0.0_dp, 0.0_dp]
    call b%locate([3.0_dp, 1.0_dp, 5.0_dp], distance, normal)
    call check_close(distance, 2.0_dp, rounding, "axis along x: distance")
    call check_close(norm2(normal), 1.0_dp, rounding, "axis along x: a unit normal")
    call check_close(normal(1), 0.0_dp, rounding, "axis along x: a normal across it")
  end subroutine test_cylinder

  !> No point of a surface is nearer than the one found, and the one found lies on it.
  subroutine test_nearest()
    type(boundary_t) :: b
    real(dp) :: x(3), normal(3), distance, foot(3), other(3), share(2)
    integer :: k, i, j, d
    logical :: nearest, on_surface

    call make_surface("rectangle", b%surface)
    b%surface%point(:) = [0.2_dp, 0.3_dp, 0.4_dp]
    b%surface%edge(:, 1) = [0.4_dp, 0.2_dp, 0.1_dp]
    b%surface%edge(:, 2) = [-0.1_dp, 0.3_dp, -0.2_dp]
    nearest = .true.
    on_surface = .true.
    do k = 1, 200
      do d = 1, 3
        x(d) = draw(9, k, d)
      end do
      call b%locate(x, distance, normal)
      foot(:) = x - distance*normal
      do d = 1, 2
        share(d) = sum((foot - b%surface%point)*b%surface%edge(:, d))/sum(b%surface%edge(:, d)**2)
      end do
      other(:) = b%surface%point + share(1)*b%surface%edge(:, 1) + share(2)*b%surface%edge(:, 2)
      on_surface = on_surface .and. norm2(foot - other) < 1.0e-12_dp .and. all(abs(share - 0.5_dp) < 0.5_dp + 1.0e-12_dp)
      do i = 0, 10
        do j = 0, 10
          other(:) = b%surface%point + 0.1_dp*i*b%surface%edge(:, 1) + 0.1_dp*j*b%surface%edge(:, 2)
          nearest = nearest .and. norm2(x - other) >= distance - rounding
        end do
      end do
    end do
    call check(on_surface, "the foot lies on the rectangle")
    call check(nearest, "no point of the rectangle is nearer")
  end subroutine test_nearest

  !> Each registered shape under its word, and glued grains, which have no surface.
  subroutine test_kinds()
    type(boundary_t) :: b
    type(surface_holder_t), allocatable :: surfaces(:)
    type(surface_features_t) :: features
    integer :: k

    call check(b%is_glued() .and. b%shape_name() == "grains", "a boundary without a surface")
    call check(.not. (b%touches() .or. b%lets_out() .or. b%is_plane()), "glued grains have no surface to touch")
    call registered_surfaces(surfaces)
    call check_equal(size(surfaces), 7, "registered shapes")
    do k = 1, size(surfaces)
      features = surfaces(k)%surface%features()
      call make_surface(trim(features%kind), b%surface)
      b%present = .true.
      call check(b%shape_name() == features%kind .and. .not. b%is_glued(), "name of "//features%kind)
      call check(b%touches() .neqv. b%lets_out(), "grains touch a boundary or leave by it")
      call check(b%is_plane() .eqv. (features%kind == "plane"), "planes")
      b%present = .false.
      call check(.not. b%touches(), "nothing touches what is not there")
    end do
    call make_surface("sphinx", b%surface)
    call check(.not. allocated(b%surface), "no shape of another word")
    call check(.not. b%is_driven() .and. .not. b%drive%turns(), "a boundary at rest")
    b%free(2) = .true.
    b%drive%spin(3) = -1.0_dp
    call check(b%is_driven() .and. b%drive%turns(), "free, turning")
  end subroutine test_kinds

  subroutine test_velocity()
    type(boundary_t) :: b
    real(dp) :: v(3)

    b%pivot(:) = [1.0_dp, 0.0_dp, 0.0_dp]
    b%velocity(:) = [0.5_dp, 0.25_dp, 2.0_dp]
    b%spin(:) = [0.0_dp, 0.0_dp, 2.0_dp]
    call b%velocity_at([2.0_dp, 3.0_dp], v(1:2))
    call check_vector(v(1:2), [-5.5_dp, 2.25_dp], rounding, "velocity of a point in the plane")
    b%spin(:) = [1.0_dp, 2.0_dp, 3.0_dp]
    call b%velocity_at([2.0_dp, 3.0_dp, -1.0_dp], v)
    call check_vector(v, [-10.5_dp, 4.25_dp, 3.0_dp], rounding, "velocity of a point in space")
    b%last_velocity(:) = [1.0_dp, 0.0_dp, 0.0_dp]
    b%last_spin(:) = [0.0_dp, 0.0_dp, 2.0_dp]
    call b%last_velocity_at([2.0_dp, 3.0_dp, -1.0_dp], v)
    call check_vector(v, [-5.0_dp, 2.0_dp, 0.0_dp], rounding, "velocity at the start of the step")
  end subroutine test_velocity

  !> A quarter turn in one step; points of the boundary and carried ones stay together.
  subroutine test_rotation_2d()
    type(boundary_t) :: b
    real(dp) :: x(2), tip(3)

    call make_surface("segment", b%surface)
    b%surface%point(1:2) = [2.0_dp, 0.0_dp]
    b%surface%edge(1:2, 1) = [1.0_dp, 0.0_dp]
    b%surface%axis(1:2) = [0.0_dp, 1.0_dp]
    b%pivot(1:2) = [1.0_dp, 0.0_dp]
    b%spin(3) = 0.5_dp*pi/0.25_dp
    b%velocity(1:2) = [4.0_dp, 8.0_dp]
    x(:) = [3.0_dp, 0.0_dp]
    call b%carry(0.25_dp, x)
    call b%move(0.25_dp)
    call check_vector(x, [2.0_dp, 4.0_dp], rounding, "a point carried")
    call check_vector(b%surface%point, [2.0_dp, 3.0_dp, 0.0_dp], rounding, "its point")
    call check_vector(b%pivot, [2.0_dp, 2.0_dp, 0.0_dp], 0.0_dp, "its pivot")
    call check_vector(b%surface%edge(:, 1), [0.0_dp, 1.0_dp, 0.0_dp], rounding, "its edge")
    call check_vector(b%surface%axis, [-1.0_dp, 0.0_dp, 0.0_dp], rounding, "its normal")
    tip(:) = b%surface%point + b%surface%edge(:, 1)
    call check_vector(tip(1:2), x, rounding, "the end that was carried")
  end subroutine test_rotation_2d

  !> Many steps make one whole turn about a diagonal; lengths and angles stay, and the velocity is that of the motion.
  subroutine test_rotation_3d()
    type(boundary_t) :: b, start
    real(dp) :: x(3), before(3), v(3), away(3), tip(3)
    integer, parameter :: n = 1000
    real(dp), parameter :: h = 1.0_dp/n
    integer :: k

    call make_surface("rectangle", b%surface)
    b%surface%point(:) = [0.5_dp, -0.25_dp, 0.75_dp]
    b%surface%edge(:, 1) = [1.0_dp, 0.0_dp, 0.0_dp]
    b%surface%edge(:, 2) = [0.0_dp, 0.0_dp, 2.0_dp]
    b%pivot(:) = [0.25_dp, 0.25_dp, 0.0_dp]
    b%spin(:) = 2.0_dp*pi/sqrt(3.0_dp)
    start = b
    x(:) = b%surface%point + b%surface%edge(:, 2)
    do k = 1, n
      before(:) = x
      call b%velocity_at(x, v)
      call b%carry(h, x)
      call b%move(h)
      if (k /= 333) cycle
      ! the chord differs from the arc by a second-order term, w^2 r h^2/2 with w below 7 and r below 3
      away(:) = (x - before)/h
      call check_vector(away, v, 0.5_dp*49.0_dp*3.0_dp*h, "velocity of the motion")
      call check(norm2(b%surface%point - start%surface%point) > 0.1_dp, "it has turned")
      tip(:) = b%surface%point + b%surface%edge(:, 2)
      call check_vector(x, tip, n*rounding, "carried with it")
    end do
    tip(:) = start%surface%point + start%surface%edge(:, 2)
    call check_vector(b%surface%point, start%surface%point, n*rounding, "a whole turn: point")
    call check_vector(b%surface%edge(:, 1), start%surface%edge(:, 1), n*rounding, "a whole turn: first edge")
    call check_vector(b%surface%edge(:, 2), start%surface%edge(:, 2), n*rounding, "a whole turn: second edge")
    call check_vector(x, tip, n*rounding, "a whole turn: a point carried")
    call check_close(sum(b%surface%edge(:, 1)*b%surface%edge(:, 2)), 0.0_dp, n*rounding, "edges at right angles")
  end subroutine test_rotation_3d

  !> A cylinder that turns about its axis stays as it is, bit for bit: its surface does not move.
  subroutine test_axis_of_rotation()
    type(boundary_t) :: b
    integer :: k

    call make_surface("cylinder", b%surface)
    b%surface%axis(:) = [0.0_dp, 1.0_dp, 0.0_dp]
    b%spin(:) = [0.0_dp, 0.7_dp, 0.0_dp]
    do k = 1, 100
      call b%move(0.013_dp)
    end do
    call check_vector(b%surface%axis, [0.0_dp, 1.0_dp, 0.0_dp], 0.0_dp, "axis of a drum")
    call check_vector(b%surface%point, [0.0_dp, 0.0_dp, 0.0_dp], 0.0_dp, "point of a drum")
  end subroutine test_axis_of_rotation

  !> Each column of a table drives its own quantity; the others keep their constants.
  subroutine test_drives(nd)
    integer, intent(in) :: nd
    character(len=*), parameter :: file = "drives.csv"
    character(len=:), allocatable :: names
    type(boundary_t) :: b
    type(error_t), allocatable :: error
    integer :: unit, k, first, last, n
    real(dp) :: force(3), found(10), expected(10)

    names = drive_names(nd)
    n = merge(6, 10, nd == 2)
    first = 1
    do k = 1, n
      last = first + index(names(first:)//" ", " ") - 2
      open (newunit=unit, file=file, status="replace", action="write")
      write (unit, "(a)") "time,"//names(first:last), "0,0", "2,200"
      close (unit)
      first = last + 2
      call make_constants(b)
      call b%drive%table%read(file, names, .false., error)
      call check(.not. allocated(error), "table of drives")
      if (allocated(error)) return
      call b%prescribe(nd, 1.0_dp, 0.1_dp)
      expected(1:3) = [11.0_dp, 12.0_dp, 13.0_dp]
      if (nd == 3) expected(4:10) = [14.0_dp, 15.0_dp, 16.0_dp, 17.0_dp, 18.0_dp, 19.0_dp, 20.0_dp]
      if (nd == 2) expected(3:6) = [16.0_dp, 17.0_dp, 18.0_dp, 20.0_dp]
      expected(k) = 100.0_dp
      found(1:nd) = b%velocity(1:nd)
      if (nd == 2) found(3) = b%spin(3)
      if (nd == 3) found(4:6) = b%spin
      b%drive%spin(:) = 0.0_dp
      call check(b%drive%turns() .eqv. (k > nd .and. k <= merge(3, 6, nd == 2)), "turning by a column")
      b%free(:) = .true.
      call b%applied_force(nd, 1.05_dp, 0.1_dp, 0.0_dp, force(1:nd))
      found(n - nd:n - 1) = force(1:nd)
      call b%applied_force(nd, 1.05_dp, 0.1_dp, 2.0_dp, force(1:nd))
      ! the axis is the first one
      found(n) = (force(1) - found(n - nd))/2.0_dp
      call check_vector(found(1:n), expected(1:n), 100*rounding, "driven by "//names)
      call check(b%load_changes(1.1_dp, 0.1_dp) .eqv. k >= n - nd, "a load that changes by a column of a table")
      call check(b%load_changes(2.1_dp, 0.1_dp) .eqv. k >= n - nd, "a load that changed within the step before")
      call check(.not. b%load_changes(2.2_dp, 0.1_dp), "a load after the last row of a table")
      b%free(:) = .false.
      call check(.not. b%load_changes(1.1_dp, 0.1_dp), "a load that moves nothing")
    end do
  end subroutine test_drives

  subroutine make_constants(b)
    type(boundary_t), intent(out) :: b

    call make_surface("plane", b%surface)
    b%surface%axis(1) = 1.0_dp
    b%drive%velocity(:) = [11.0_dp, 12.0_dp, 13.0_dp]
    b%drive%spin(:) = [14.0_dp, 15.0_dp, 16.0_dp]
    b%drive%force(:) = [17.0_dp, 18.0_dp, 19.0_dp]
    b%drive%pressure = 20.0_dp
  end subroutine make_constants

  !> An oscillation is added to a constant and to a table, moves the surface by its amplitude and back, and turns about one axis.
  subroutine test_oscillation()
    integer, parameter :: steps = 400
    real(dp), parameter :: pi = 4.0_dp*atan(1.0_dp)
    type(boundary_t) :: b
    real(dp) :: times(2), place(3), low, high
    integer :: k

    call make_surface("plane", b%surface)
    call check(.not. (b%drive%moves() .or. b%drive%changes()), "nothing moves")
    b%drive%velocity(:) = [0.0_dp, 1.0_dp, 0.0_dp]
    call check(b%drive%moves() .and. .not. b%drive%changes(), "a constant motion")
    b%drive%oscillation(2) = 0.5_dp
    b%drive%frequency = 2.0_dp
    b%drive%phase = 0.25_dp*pi
    call check(b%drive%changes() .and. b%drive%changes_after(1.0e9_dp) .and. .not. b%drive%turns(), "it goes on for ever")
    ! 1 + A 2 pi f cos(2 pi f t + pi/4), where f t is 1/8 and then 3/8 beyond whole periods
    call check_close(b%drive%velocity_at(2, 1.0e6_dp + 0.0625_dp, 0.01_dp), 1.0_dp, 1.0e-8_dp, "velocity where it turns round")
    call check_close(b%drive%velocity_at(2, 0.1875_dp, 0.01_dp), 1.0_dp - 2.0_dp*pi, 1.0e-14_dp, "velocity half-way")
    call check_close(b%drive%velocity_at(1, 0.1875_dp, 0.01_dp), 0.0_dp, 0.0_dp, "velocity along another axis")
    call check_close(b%drive%time_beside(0.0625_dp, 9.0_dp), 0.1875_dp, 0.0_dp, "a quarter of a period later")
    call check_close(b%drive%time_beside(0.0625_dp, -9.0_dp), -0.0625_dp, 0.0_dp, "a quarter of a period before")
    call check_close(b%drive%time_beside(0.0625_dp, 0.0625_dp), 0.125_dp, 0.0_dp, "less than a quarter of a period later")
    call b%drive%find_extremes(times)
    do k = 1, 2
      call check_close(abs(b%drive%velocity_at(2, times(k), 0.01_dp) - 1.0_dp), 2.0_dp*pi, 1.0e-14_dp, "velocity at an extreme")
      call check(times(k) >= 0.0_dp .and. times(k) < 0.5_dp, "extremes of the first period")
    end do
    b%drive%velocity(2) = 0.0_dp
    b%drive%rotation_oscillation(3) = 0.1_dp
    call check(b%drive%turns() .and. b%drive%turns_about(3) .and. .not. b%drive%turns_about(1), "it turns about one axis")
    call check_close(b%drive%spin_at(3, 0.1875_dp, 0.01_dp), -0.4_dp*pi, 1.0e-14_dp, "rate of rotation")
    b%drive%rotation_oscillation(3) = 0.0_dp
    low = 0.0_dp
    high = 0.0_dp
    do k = 1, steps
      ! velocities in the middle of steps
      call b%prescribe(2, 0.5_dp*(k - 0.5_dp)/steps, 0.5_dp/steps)
      call b%move(0.5_dp/steps)
      call b%find_place(place)
      low = min(low, place(2))
      high = max(high, place(2))
    end do
    call check_close(place(2), 0.0_dp, 1.0e-14_dp, "back after a period")
    call check_close(high - low, 1.0_dp, 1.0e-4_dp, "twice the amplitude")
  end subroutine test_oscillation

  !> Forces act on free components only, whose velocities are not prescribed.
  subroutine test_forces()
    type(boundary_t) :: b
    real(dp) :: force(3)

    call make_constants(b)
    b%surface%axis(:) = [0.0_dp, 0.6_dp, 0.8_dp]
    b%free(2) = .true.
    call b%prescribe(3, 0.0_dp, 0.1_dp)
    call check_vector(b%velocity, [11.0_dp, 0.0_dp, 13.0_dp], 0.0_dp, "prescribed components")
    call b%applied_force(3, 0.0_dp, 0.1_dp, 0.5_dp, force)
    call check_vector(force, [0.0_dp, 24.0_dp, 0.0_dp], 100*rounding, "force on the free component")
    b%free(:) = .false.
    b%drive%spin(:) = 0.0_dp
    call check(.not. b%drive%turns() .and. .not. b%is_driven(), "neither turning nor free")
    b%drive%spin(1) = 1.0_dp
    call check(b%drive%turns(), "turning by a constant")
  end subroutine test_forces

  !> Everything that time changes comes back bit for bit, and nothing else does.
  subroutine test_state()
    type(boundary_t) :: b, back
    integer(i8) :: words(boundary_words), again(boundary_words)
    integer :: k

    call make_surface("rectangle", b%surface)
    call make_surface("rectangle", back%surface)
    do k = 1, 3
      b%surface%point(k) = draw(1, k, 1)
      b%surface%axis(k) = draw(1, k, 2)
      b%surface%edge(k, 1) = draw(1, k, 3)
      b%surface%edge(k, 2) = draw(1, k, 4)
      b%pivot(k) = draw(1, k, 5)
      b%velocity(k) = draw(1, k, 6)
      b%spin(k) = draw(1, k, 7)
      b%last_velocity(k) = draw(1, k, 8)
      b%last_spin(k) = draw(1, k, 9)
    end do
    b%present = .false.
    call b%get_state(words)
    back%contact%friction = 0.5_dp
    call back%set_state(words)
    call back%get_state(again)
    call check(all(words == again), "words of a state")
    call check_vector(back%surface%point, b%surface%point, 0.0_dp, "state: point")
    call check_vector(back%surface%axis, b%surface%axis, 0.0_dp, "state: axis")
    call check_vector(back%surface%edge(:, 1), b%surface%edge(:, 1), 0.0_dp, "state: first edge")
    call check_vector(back%surface%edge(:, 2), b%surface%edge(:, 2), 0.0_dp, "state: second edge")
    call check_vector(back%pivot, b%pivot, 0.0_dp, "state: pivot")
    call check_vector(back%velocity, b%velocity, 0.0_dp, "state: velocity")
    call check_vector(back%spin, b%spin, 0.0_dp, "state: spin")
    call check_vector(back%last_velocity, b%last_velocity, 0.0_dp, "state: velocity before")
    call check_vector(back%last_spin, b%last_spin, 0.0_dp, "state: spin before")
    call check(.not. back%present, "state: removed")
    call check_close(back%contact%friction, 0.5_dp, 0.0_dp, "properties stay")
  end subroutine test_state

  !> Put elsewhere, it keeps its directions and velocities.
  subroutine test_shift()
    type(boundary_t) :: b

    call make_surface("segment", b%surface)
    b%surface%point(1:2) = [2.0_dp, 0.5_dp]
    b%surface%edge(1:2, 1) = [1.0_dp, 0.0_dp]
    b%pivot(1:2) = [1.0_dp, 0.25_dp]
    b%velocity(1:2) = [4.0_dp, 8.0_dp]
    call b%shift([0.5_dp, -1.0_dp])
    call check_vector(b%surface%point, [2.5_dp, -0.5_dp, 0.0_dp], 0.0_dp, "shift: point")
    call check_vector(b%pivot, [1.5_dp, -0.75_dp, 0.0_dp], 0.0_dp, "shift: pivot")
    call check_vector(b%surface%edge(:, 1), [1.0_dp, 0.0_dp, 0.0_dp], 0.0_dp, "shift: edge")
    call check_vector(b%velocity, [4.0_dp, 8.0_dp, 0.0_dp], 0.0_dp, "shift: velocity")
  end subroutine test_shift

end program test_boundary
