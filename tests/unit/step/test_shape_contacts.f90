!> Points of pairs of bodies with shapes: boxes, disks and spheres on each other, across a period, and on a plane.
program test_shape_contacts
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_body_store, only: body_layout_t
  use gravier_periodic, only: shift_code
  use gravier_neighbour_list, only: pair_memory_t
  use gravier_shapes_file, only: parse_shapes
  use gravier_decomposition, only: decomposition_t
  use gravier_halo, only: local_bodies_t
  use gravier_pair_points, only: pair_points_t
  use gravier_shape_contacts, only: shape_work_t, find_points
  use gravier_manifold, only: manifold_t
  use gravier_seen_body, only: seen_body_t, see_body
  use gravier_piece_meeting, only: room_t, meet_pieces
  use gravier_clear_path, only: clear_path
  use gravier_physics, only: physics_t
  use gravier_narrow_phase, only: contact_list_t, find_contacts
  use gravier_test_scenes, only: plane
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  character(len=*), parameter :: lf = new_line("a")
  real(dp), parameter :: tight = 1.0e-13_dp, gap = 0.004_dp, alert = 0.01_dp
  !> places in the list that a pair has
  integer, parameter :: room = 8

  call test_boxes(2)
  call test_boxes(3)
  call test_few_places()
  call test_turned()
  call test_balls(2)
  call test_balls(3)
  call test_plane(2)
  call test_plane(3)
  call test_period()
  call test_passing(2)
  call test_passing(3)
  call test_contacts(2)
  call test_contacts(3)
  call finish_checks()

contains

  !> Two bodies whose sides are 2 long, or of radius 1 without a shape: the first in the origin, the second at a place; a plane at
  !> the height -1 - gap. The pair has a number of places in the list.
  subroutine make(nd, shapes, place, places, view, decomposition, work, shift)
    integer, intent(in) :: nd
    !> 0 or 1 for each of both
    integer, intent(in) :: shapes(2)
    !> (nd)
    real(dp), intent(in) :: place(:)
    integer, intent(in) :: places
    type(local_bodies_t), intent(out) :: view
    type(decomposition_t), intent(out) :: decomposition
    type(shape_work_t), intent(out) :: work
    !> code of the shift of the second
    integer, intent(in), optional :: shift
    type(error_t), allocatable :: error
    type(pair_memory_t) :: memory
    real(dp) :: normal(nd), point(nd)
    integer :: k, order(2*places)

    decomposition%nd = nd
    decomposition%nv = 3*nd - 3
    decomposition%rule%alert_distance = alert
    if (nd == 2) then
      call parse_shapes("a.shapes", "shape box"//lf//"polygon -1 -1 1 -1 1 1 -1 1", 2, decomposition%shapes, error)
    else
      call parse_shapes("a.shapes", "shape box"//lf//"box 2 2 2", 3, decomposition%shapes, error)
    end if
    call check(.not. allocated(error), "a library")
    if (allocated(error)) call check(.false., error%message)
    point(:) = 0.0_dp
    normal(:) = 0.0_dp
    normal(nd) = 1.0_dp
    point(nd) = -1.0_dp - gap
    allocate (decomposition%boundaries(1))
    decomposition%boundaries(1) = plane(101, point, normal)
    call view%bodies%init(body_layout_t(nd, 3*nd - 3, 0, merge(1, 4, nd == 2)), 2)
    view%bodies%position(:, 1) = 0.0_dp
    view%bodies%position(:, 2) = place
    view%bodies%orientation(:, :) = 0.0_dp
    if (nd == 3) view%bodies%orientation(1, :) = 1.0_dp
    view%bodies%shape(:) = shapes
    do k = 1, 2
      view%bodies%radius(k) = 1.0_dp
      if (shapes(k) > 0) view%bodies%radius(k) = sqrt(real(nd, dp))
    end do
    call view%list%init(present(shift), 2)
    call view%list%add(1, 2, merge_shift(shift))
    call view%list%add(1, -1, merge_shift())
    order(1:places) = 1
    order(places + 1:) = 2
    call view%list%finish(order, memory)
    call work%init(nd, 0.0_dp, counts=.false.)
  end subroutine make

  !> A code of a shift, 0 where there is none.
  pure integer function merge_shift(shift) result(code)
    integer, intent(in), optional :: shift

    code = 0
    if (present(shift)) code = shift
  end function merge_shift

  !> A box above another, shifted sideways by half a side.
  subroutine test_boxes(nd)
    integer, intent(in) :: nd
    type(local_bodies_t) :: view
    type(decomposition_t) :: decomposition
    type(shape_work_t) :: work
    type(pair_points_t) :: points
    real(dp) :: place(nd)
    integer :: k

    place(:) = 0.0_dp
    place(1) = 1.0_dp
    place(nd) = 2.0_dp + gap
    call make(nd, [1, 1], place, room, view, decomposition, work)
    call find_points(view, decomposition, 1, work, points)
    call check_equal(points%n, 2**(nd - 1), "boxes touch with their common side")
    do k = 1, points%n
      call check_close(points%gap(k), gap, tight, "boxes: the gap")
      call check_close(points%normal(nd, k), -1.0_dp, tight, "boxes: the normal to the first")
      call check_close(points%point(nd, k), 1.0_dp + 0.5_dp*gap, tight, "boxes: half-way between both")
      call check(all(points%key(:, k) > 0), "boxes: keys are above 0")
    end do
    call check_close(minval(points%point(1, 1:points%n)), 0.0_dp, tight, "where the second begins")
    call check_close(maxval(points%point(1, 1:points%n)), 1.0_dp, tight, "where the first ends")
    place(nd) = 2.0_dp + 2*alert
    view%bodies%position(:, 2) = place
    call find_points(view, decomposition, 1, work, points)
    call check_equal(points%n, 0, "boxes farther than the alert distance")
    place(nd) = 5.0_dp
    view%bodies%position(:, 2) = place
    call find_points(view, decomposition, 1, work, points)
    call check_equal(points%n, 0, "boxes whose balls do not touch")
  end subroutine test_boxes

  !> A box whose lower side is flush with the upper side of the other slides towards it: they do not meet, and the contact of their
  !> corners leaves the velocity free. A box that is lower strikes the side; one that is so fast that it is behind the other at the
  !> end of the step does, too.
  subroutine test_passing(nd)
    integer, intent(in) :: nd
    type(local_bodies_t) :: view
    type(decomposition_t) :: decomposition
    type(shape_work_t) :: work
    type(manifold_t) :: seen, cleared
    real(dp), parameter :: h = 0.1_dp
    real(dp) :: place(nd)

    place(:) = 0.0_dp
    place(1) = 2.0_dp + 0.5_dp*gap
    place(nd) = -2.0_dp
    call make(nd, [1, 1], place, room, view, decomposition, work)
    view%bodies%velocity(:, :) = 0.0_dp
    view%bodies%velocity(1, 1) = 2.0_dp*gap/h
    call go_on(view, decomposition, h, seen, cleared)
    call check_equal(seen%n, merge(1, 2, nd == 2), "corners or edges that face each other")
    call check(seen%normal(1) < -0.3_dp .and. seen%normal(nd) > 0.3_dp, "obliquely")
    call check(cleared%gap(1) > seen%gap(1), "boxes go past each other")
    call check_close(minval(cleared%gap(1:seen%n)), -2.0_dp*gap*seen%normal(1), tight, "with the velocity that they have")
    view%bodies%position(nd, 2) = place(nd) + 1.0e-9_dp
    call go_on(view, decomposition, h, seen, cleared)
    call check_equal(seen%n, merge(1, 2, nd == 2), "sides do not meet beyond their cores")
    call check(seen%normal(1) < -0.3_dp .and. seen%normal(nd) > 0.3_dp, "but corners, obliquely")
    view%bodies%position(nd, 2) = place(nd) + 0.1_dp*gap
    call go_on(view, decomposition, h, seen, cleared)
    call check(seen%n > 0, "a box that is lower")
    call check_close(cleared%gap(1), seen%gap(1), 0.0_dp, "it strikes the other")
    view%bodies%velocity(1, 1) = 20.0_dp/h
    view%bodies%position(nd, 2) = place(nd) + 0.5_dp
    call go_on(view, decomposition, h, seen, cleared)
    call check(seen%n > 0, "a box that strikes the side")
    call check_close(cleared%gap(1), seen%gap(1), 0.0_dp, "however fast it is")
    ! one that comes down on the other is not let in, by however little
    view%bodies%position(:, 2) = 0.0_dp
    view%bodies%position(nd, 2) = -2.0_dp - gap
    view%bodies%velocity(1, 1) = 0.0_dp
    view%bodies%velocity(nd, 1) = -(gap + 1.0e-5_dp)/h
    call go_on(view, decomposition, h, seen, cleared)
    call check(seen%n > 1, "a box that comes down")
    call check_close(cleared%gap(1), seen%gap(1), 0.0_dp, "it is stopped where it touches")
  end subroutine test_passing

  !> The points of the two bodies, and with their paths looked at.
  subroutine go_on(view, decomposition, h, seen, cleared)
    type(local_bodies_t), intent(in) :: view
    type(decomposition_t), intent(in) :: decomposition
    real(dp), intent(in) :: h
    type(manifold_t), intent(out) :: seen, cleared
    type(seen_body_t) :: a, b
    type(room_t) :: places

    call see_body(view%bodies, 1, a)
    call see_body(view%bodies, 2, b)
    b%centre(1:decomposition%nd) = view%bodies%position(:, 2)
    associate (piece => decomposition%shapes%shape(1)%piece(1))
      call meet_pieces(piece, piece, a, b, alert, places, seen)
      cleared = seen
      call clear_path(piece, piece, h, a, b, places, cleared)
    end associate
  end subroutine go_on

  !> A pair with fewer places in the list keeps the deepest points: a box that leans.
  subroutine test_few_places()
    real(dp), parameter :: angle = 0.001_dp
    type(local_bodies_t) :: view
    type(decomposition_t) :: decomposition
    type(shape_work_t) :: work
    type(pair_points_t) :: points

    call make(2, [1, 1], [0.0_dp, 2.0_dp + gap], 1, view, decomposition, work)
    view%bodies%orientation(1, 2) = angle
    call find_points(view, decomposition, 1, work, points)
    call check_equal(points%n, 1, "one place, one point")
    call check(points%point(1, 1) < -0.9_dp, "the lower side of the box that leans")
    call check_close(points%gap(1), gap - angle, 1.0e-4_dp, "its gap")
  end subroutine test_few_places

  !> A box on its edge above a box: one point.
  subroutine test_turned()
    type(local_bodies_t) :: view
    type(decomposition_t) :: decomposition
    type(shape_work_t) :: work
    type(pair_points_t) :: points
    real(dp) :: rounding

    call make(2, [1, 1], [0.5_dp, 2.4_dp], room, view, decomposition, work)
    view%bodies%orientation(1, 2) = 0.25_dp*acos(-1.0_dp)
    associate (piece => decomposition%shapes%shape(1)%piece(1))
      rounding = piece%rounding*view%bodies%radius(2)
    end associate
    ! the corner is round: it ends before the sharp one does
    view%bodies%position(2, 2) = 1.0_dp + gap + sqrt(2.0_dp) - (sqrt(2.0_dp) - 1.0_dp)*rounding
    call find_points(view, decomposition, 1, work, points)
    call check_equal(points%n, 1, "a corner on a side")
    call check_close(points%gap(1), gap, tight, "its gap")
    call check_close(points%point(1, 1), 0.5_dp, tight, "below the centre")
  end subroutine test_turned

  !> A disk or sphere on a box, and the other way round.
  subroutine test_balls(nd)
    integer, intent(in) :: nd
    type(local_bodies_t) :: view
    type(decomposition_t) :: decomposition
    type(shape_work_t) :: work
    type(pair_points_t) :: points
    real(dp) :: place(nd)

    place(:) = 0.25_dp
    place(nd) = 2.0_dp + gap
    call make(nd, [1, 0], place, room, view, decomposition, work)
    call find_points(view, decomposition, 1, work, points)
    call check_equal(points%n, 1, "a ball on a box")
    call check_close(points%gap(1), gap, tight, "a ball on a box: the gap")
    call check_close(points%point(1, 1), 0.25_dp, tight, "a ball on a box: below its centre")
    call make(nd, [0, 1], place, room, view, decomposition, work)
    call find_points(view, decomposition, 1, work, points)
    call check_equal(points%n, 1, "a box on a ball")
    call check_close(points%gap(1), gap, tight, "a box on a ball: the gap")
    call check_close(points%point(1, 1), 0.0_dp, tight, "a box on a ball: above its centre")
    call check_close(points%normal(nd, 1), -1.0_dp, tight, "a box on a ball: the normal")
    place(:) = 0.0_dp
    place(1) = 0.6_dp*(2.0_dp + gap)
    place(nd) = 0.8_dp*(2.0_dp + gap)
    call make(nd, [0, 0], place, room, view, decomposition, work)
    call find_points(view, decomposition, 1, work, points)
    call check_equal(points%n, 1, "a ball on a ball")
    call check_close(points%gap(1), gap, tight, "a ball on a ball: the gap")
    call check_close(points%normal(1, 1), -0.6_dp, tight, "a ball on a ball: the normal")
    call check_close(points%point(nd, 1), 0.8_dp*(1.0_dp + 0.5_dp*gap), tight, "a ball on a ball: half-way between")
  end subroutine test_balls

  !> A box and a ball above a plane.
  subroutine test_plane(nd)
    integer, intent(in) :: nd
    type(local_bodies_t) :: view
    type(decomposition_t) :: decomposition
    type(shape_work_t) :: work
    type(pair_points_t) :: points
    real(dp) :: place(nd)
    integer :: k

    place(:) = 10.0_dp
    call make(nd, [1, 0], place, room, view, decomposition, work)
    call find_points(view, decomposition, room + 1, work, points)
    call check_equal(points%n, 2**(nd - 1), "a box on a plane")
    do k = 1, points%n
      call check_close(points%gap(k), gap, tight, "a box on a plane: the gap")
      call check_close(points%normal(nd, k), 1.0_dp, tight, "a box on a plane: the normal of the plane")
      call check_close(abs(points%point(1, k)), 1.0_dp, tight, "a box on a plane: its corners")
    end do
    call make(nd, [0, 0], place, room, view, decomposition, work)
    call find_points(view, decomposition, room + 1, work, points)
    call check_equal(points%n, 1, "a ball on a plane")
    call check_close(points%gap(1), gap, tight, "a ball on a plane: the gap")
    call check_close(points%point(nd, 1), -1.0_dp - 0.5_dp*gap, tight, "a ball on a plane: the point")
  end subroutine test_plane

  !> A box that meets another across the end of a period.
  subroutine test_period()
    type(local_bodies_t) :: view
    type(decomposition_t) :: decomposition
    type(shape_work_t) :: work
    type(pair_points_t) :: points
    integer :: k

    call make(2, [1, 1], [-8.0_dp + gap, 0.5_dp], room, view, decomposition, work, shift_code([1, 0, 0]))
    decomposition%period%length(1) = 10.0_dp
    call find_points(view, decomposition, 1, work, points)
    call check_equal(points%n, 2, "boxes across a period")
    do k = 1, points%n
      call check_close(points%gap(k), gap, 10*tight, "across a period: the gap")
      call check_close(points%normal(1, k), -1.0_dp, tight, "across a period: the normal")
    end do
  end subroutine test_period

  !> The contacts of two pairs: each pair stands in the list as often as it may have points, and has contacts in the first of these
  !> places. A box lies on a plane, and bears another one with a half of its side.
  subroutine test_contacts(nd)
    integer, intent(in) :: nd
    type(local_bodies_t) :: view
    type(decomposition_t) :: decomposition
    type(physics_t) :: physics
    type(shape_work_t) :: work
    type(contact_list_t) :: found
    real(dp) :: place(nd)
    integer :: k, m, order(2*room)

    place(:) = 0.0_dp
    place(1) = 1.0_dp
    place(nd) = 2.0_dp + gap
    call make(nd, [1, 1], place, room, view, decomposition, work)
    decomposition%no = merge(1, 4, nd == 2)
    view%bodies%glued(:) = 0
    ! with keys that tell the points of a pair
    call view%list%init(.false., 2)
    call view%list%add(1, 2, merge_shift())
    call view%list%add(1, -1, merge_shift())
    do k = 1, 2*room
      order(k) = 1 + (k - 1)/room
    end do
    call view%list%finish(order, pair_memory_t(key_row=1))
    call find_contacts(view, decomposition, physics, found)
    m = 2**(nd - 1)
    call check_equal(found%n, 2*m, "contacts of two pairs of boxes")
    do k = 1, m
      call check_equal(found%source(k), k, "contacts of a pair: their places in the list")
      call check_equal(found%source(m + k), room + k, "contacts of the next pair: their places in the list")
      call check(found%boundary(k) == 0 .and. found%boundary(m + k) == 1, "the boundary of a contact")
      call check_close(found%normal(nd, m + k) - found%normal(nd, k), 2.0_dp, tight, "normals down to the first, up from the plane")
      call check_close(found%place(k)%arm_i(nd), 1.0_dp + 0.5_dp*gap, tight, "the arm of the first box")
      call check_close(found%place(k)%arm_j(nd), -1.0_dp - 0.5_dp*gap, tight, "the arm of the second box")
      call check_close(found%place(k)%arm_i(1) - found%place(k)%arm_j(1), 1.0_dp, tight, "arms to one place")
      call check_close(found%place(m + k)%arm_i(nd), -1.0_dp - 0.5_dp*gap, tight, "the arm to the plane")
      call check_close(found%place(m + k)%on_wall(nd), -1.0_dp - 0.5_dp*gap, tight, "the place on the plane: the end of the arm")
    end do
    ! the places of the second pair alone
    allocate (view%list%watched(room))
    do k = 1, room
      view%list%watched(k) = room + k
    end do
    call find_contacts(view, decomposition, physics, found)
    call check_equal(found%n, m, "contacts of the pair that is looked at")
    call check(all(found%source(1:m) > room), "which is the second one")
  end subroutine test_contacts

end program test_shape_contacts
