!> Random and degenerate pairs of convex polyhedra: the distance of the cores, proved for every pair by duality and for some
!> compared with quadruple precision; what a manifold must be; no corner of two parallel faces without a point; nothing that jumps
!> along a line. Arguments: count of pairs, seed.
program test_polyhedron_fuzz
  use mpi_f08, only: MPI_Init, MPI_Finalize, MPI_Comm_rank, MPI_Comm_size, MPI_COMM_WORLD
  use gravier_kinds, only: dp, i8
  use gravier_check, only: check, check_close, finish_checks
  use gravier_convex_distance, only: placed_pair_t, core_distance_t, find_core_distance, place_a, place_b
  use gravier_convex_piece, only: convex_piece_t
  use gravier_fuzz_pairs, only: fuzz_library_t, make_library, draw_pair, families, family_names, parallel_faces, &
    & parallel_edges
  use gravier_hull_oracle, only: find_hull_distance, qp
  use gravier_manifold, only: manifold_t, most_points
  use gravier_polyhedra, only: draws_t, vector_t
  use gravier_polyhedron_pair, only: find_polyhedron_manifold
  use gravier_shape_library, only: body_shape_t
  implicit none
  !> one pair of so many is compared with quadruple precision
  integer, parameter :: compared = 499
  !> error of a distance, in parts of the size of the pair
  real(dp), parameter :: exact = 1.0e-12_dp
  type :: tally_t
    !> pairs, overlaps, steps and the most of them, points
    integer(i8) :: pairs = 0, overlaps = 0, steps = 0, most_steps = 0, points = 0, contacts = 0
    !> largest gap of duality in parts of what rounding allows, error of distance and of the normal times the distance in parts of
    !> the size
    real(dp) :: duality = 0.0_dp, distance = 0.0_dp, normal = 0.0_dp
  end type tally_t
  type(fuzz_library_t) :: library
  type(tally_t) :: tally(families)
  type(draws_t) :: draws
  integer :: count, seed, rank, ranks, k, family, lines = 0, jumps = 0

  call MPI_Init()
  call MPI_Comm_rank(MPI_COMM_WORLD, rank)
  call MPI_Comm_size(MPI_COMM_WORLD, ranks)
  count = argument(1, 40000)
  ! of this seed come two pairs that a search with less care for rounding gets wrong
  seed = argument(2, 11)
  if (rank == 0) print "(2(a, i0))", "pairs ", count, ", seed ", seed
  draws%seed = seed
  call make_library(draws, library)
  draws%seed = seed + 1000*(rank + 1)
  do k = 1, count/ranks
    family = modulo(k, families) + 1
    call try_pair(k, family, tally(family))
  end do
  do k = 1, max(20, count/ranks/5000)
    call try_line()
  end do
  call check(40*jumps <= lines + 40, "what the points of a line carry jumps in few lines")
  if (rank == 0) call report()
  call finish_checks()
  call MPI_Finalize()

contains

  !> A whole number of the command line.
  integer function argument(place, default) result(value)
    integer, intent(in) :: place, default
    character(len=20) :: text
    integer :: stat

    value = default
    if (command_argument_count() < place) return
    call get_command_argument(place, text)
    read (text, *, iostat=stat) value
    if (stat /= 0) value = default
  end function argument

  !> One random pair.
  subroutine try_pair(k, family, found)
    integer, intent(in) :: k, family
    type(tally_t), intent(inout) :: found
    type(body_shape_t), pointer :: a, b
    type(placed_pair_t) :: pair
    type(core_distance_t) :: core
    type(manifold_t) :: manifold
    real(dp) :: alert
    character(len=60) :: name

    write (name, "(2a, i0)") trim(family_names(family)), ", pair ", k
    call draw_pair(draws, library, family, a, b, pair)
    call find_core_distance(a%piece(1), b%piece(1), pair, huge(1.0_dp), core)
    found%pairs = found%pairs + 1
    found%steps = found%steps + core%steps
    found%most_steps = max(found%most_steps, int(core%steps, i8))
    if (.not. core%overlap) call prove(a%piece(1), b%piece(1), pair, core, name, found)
    if (modulo(k, compared) == 0) call compare(a%piece(1), b%piece(1), pair, core, name, found)
    if (family /= 4 .and. family /= 5) call check(.not. core%overlap, trim(name)//": cores that are apart")
    if (core%overlap) found%overlaps = found%overlaps + 1
    alert = 10.0_dp**draws%between(-4.0_dp, -0.5_dp)
    ! some are just within reach
    if (modulo(k, 4) == 1 .and. .not. core%overlap) alert = core%distance - pair%radius_a*a%piece(1)%rounding - &
      & pair%radius_b*b%piece(1)%rounding + 1.0e-6_dp
    call find_polyhedron_manifold(a%piece(1), b%piece(1), pair, alert, merge(most_points, 4, modulo(k, 2) == 0), &
      & manifold)
    found%points = found%points + manifold%n
    if (manifold%n > 0) found%contacts = found%contacts + 1
    call examine(a%piece(1), b%piece(1), pair, core, alert, manifold, name)
    if (family == parallel_faces .and. .not. core%overlap) call find_missing(a, b, pair, core, name)
    if (family == parallel_edges .and. .not. core%overlap) call find_single(a%piece(1), b%piece(1), pair, core, name)
  end subroutine try_pair

  !> Proof by duality: the points are in the hulls of the cores, so that the distance is not above theirs; a slab across the normal
  !> lies between the cores, so that it is not below its width. Shares may be below 0 by rounding.
  subroutine prove(a, b, pair, core, name, found)
    type(convex_piece_t), intent(in) :: a, b
    type(placed_pair_t), intent(in) :: pair
    type(core_distance_t), intent(in) :: core
    character(len=*), intent(in) :: name
    type(tally_t), intent(inout) :: found
    real(dp) :: x(3), y(3), u(3), low, high, total, room
    integer :: k

    x(:) = 0.0_dp
    y(:) = 0.0_dp
    do k = 1, core%n
      call place_a(a, pair, core%vertex_a(k), u)
      x(:) = x + core%share(k)*u
      call place_b(b, pair, core%vertex_b(k), u)
      y(:) = y + core%share(k)*u
    end do
    total = sum(core%share(1:core%n))
    low = huge(1.0_dp)
    do k = 1, size(a%vertex, 2)
      call place_a(a, pair, k, u)
      low = min(low, dot_product(core%normal, u))
    end do
    high = -huge(1.0_dp)
    do k = 1, size(b%vertex, 2)
      call place_b(b, pair, k, u)
      high = max(high, dot_product(core%normal, u))
    end do
    associate (scale => pair%radius_a + pair%radius_b)
      ! of a way of less than 1e-7 of the size rounding tells the direction less well
      room = exact*scale + 1.0e-19_dp*scale**2/core%distance
      found%duality = max(found%duality, abs(core%distance - (low - high))/room)
      if (.not. abs(core%distance - (low - high)) <= room) call check_close(core%distance, low - high, room, &
        & trim(name)//": width of the slab")
      if (minval(core%share(1:core%n)) < -exact .or. abs(total - 1.0_dp) > exact) call check(.false., trim(name)//": shares")
      if (norm2(x - core%point_a) > 10*exact*scale .or. norm2(y - core%point_b) > 10*exact*scale .or. &
        & abs(norm2(core%point_a - core%point_b) - core%distance) > exact*scale .or. &
        & abs(norm2(core%normal) - 1.0_dp) > exact) call check(.false., trim(name)//": nearest points")
    end associate
  end subroutine prove

  !> Comparison with quadruple precision.
  subroutine compare(a, b, pair, core, name, found)
    type(convex_piece_t), intent(in) :: a, b
    type(placed_pair_t), intent(in) :: pair
    type(core_distance_t), intent(in) :: core
    character(len=*), intent(in) :: name
    type(tally_t), intent(inout) :: found
    real(qp) :: x(3, size(a%vertex, 2)), y(3, size(b%vertex, 2)), v(3), distance
    real(dp) :: turned
    integer :: k, d
    logical :: sure

    do k = 1, size(x, 2)
      x(:, k) = pair%radius_a*real(a%vertex(:, k), qp)
    end do
    do k = 1, size(y, 2)
      y(:, k) = pair%way
      do d = 1, 3
        y(:, k) = y(:, k) + pair%radius_b*real(b%vertex(d, k), qp)*pair%rotation(:, d)
      end do
    end do
    call find_hull_distance(x, y, v, sure)
    call check(sure, trim(name)//": the oracle knows")
    distance = sqrt(dot_product(v, v))
    associate (scale => pair%radius_a + pair%radius_b)
      if (core%overlap) then
        call check(distance <= 1.0e-10_qp*scale, trim(name)//": cores overlap")
        return
      end if
      found%distance = max(found%distance, abs(core%distance - real(distance, dp))/scale)
      call check_close(core%distance, real(distance, dp), exact*scale, trim(name)//": distance")
      turned = real(norm2(core%normal - v/distance)*distance, dp)
      found%normal = max(found%normal, turned/scale)
      ! a bound on the distance bounds the way: |v - v*|^2 <= |v|^2 - v.w
      call check(turned <= 1.0e-9_dp*scale, trim(name)//": normal")
    end associate
  end subroutine compare

  !> What holds for every manifold.
  subroutine examine(a, b, pair, core, alert, manifold, name)
    type(convex_piece_t), intent(in) :: a, b
    type(placed_pair_t), intent(in) :: pair
    type(core_distance_t), intent(in) :: core
    real(dp), intent(in) :: alert
    type(manifold_t), intent(in) :: manifold
    character(len=*), intent(in) :: name
    real(dp) :: reach, gap
    integer :: k

    reach = pair%radius_a*a%rounding + pair%radius_b*b%rounding
    gap = core%distance - reach
    call expect(manifold%cores_overlap .eqv. core%overlap, name, "overlap told")
    if (core%overlap) call expect(manifold%n > 0, name, "overlap without a point")
    if (.not. core%overlap) call expect((manifold%n > 0) .eqv. (gap < alert), name, "points within the alert distance")
    if (manifold%n == 0) return
    call expect(abs(norm2(manifold%normal) - 1.0_dp) <= exact, name, "unit normal")
    do k = 1, manifold%n
      call expect(manifold%gap(k) < alert, name, "gap below the alert distance")
      call expect(all(manifold%key(1:k - 1) < manifold%key(k)), name, "ascending keys")
      ! several points are corners of a patch, at whose rim the pieces may be apart
      if (core%overlap .and. manifold%n == 1) call expect(are_cores_there(a, b, pair, manifold), name, &
        & "the point of an overlap is between points of both cores")
      if (core%overlap) cycle
      call expect(norm2(manifold%point(:, k)) <= pair%radius_a + abs(alert), name, "point in the ball of a")
      call expect(norm2(manifold%point(:, k) - pair%way) <= pair%radius_b + abs(alert), name, "point in the ball of b")
    end do
    if (core%overlap) return
    call expect(norm2(manifold%normal - core%normal) <= exact, name, "normal of the nearest points")
    ! the deepest point is the exact one, but for corners that are blended, and gaps that count as equal
    call expect(abs(minval(manifold%gap(1:manifold%n)) - gap) <= 0.0301_dp*reach + exact*(pair%radius_a + pair%radius_b), name, &
      & "deepest point")
  end subroutine examine

  !> Whether the ends of the way through the only point of a manifold are points of the cores, but for corners that are blended and
  !> faces that are flat to a millionth.
  pure logical function are_cores_there(a, b, pair, manifold)
    type(convex_piece_t), intent(in) :: a, b
    type(placed_pair_t), intent(in) :: pair
    type(manifold_t), intent(in) :: manifold
    real(dp) :: room, x(3), out(3), on_a(3), on_b(3)
    integer :: f

    ! the sharp corner is farther out than the rounding
    room = 3.0_dp*(pair%radius_a*a%rounding + pair%radius_b*b%rounding) + 1.0e-6_dp*(pair%radius_a + pair%radius_b)
    on_a(:) = manifold%point(:, 1) + (0.5_dp*manifold%gap(1) + pair%radius_a*a%rounding)*manifold%normal
    on_b(:) = manifold%point(:, 1) - (0.5_dp*manifold%gap(1) + pair%radius_b*b%rounding)*manifold%normal
    are_cores_there = .true.
    do f = 1, size(a%face_normal, 2)
      call place_a(a, pair, a%face_vertex(a%face_first(f)), x)
      are_cores_there = are_cores_there .and. dot_product(a%face_normal(:, f), on_a - x) <= room
    end do
    do f = 1, size(b%face_normal, 2)
      call place_b(b, pair, b%face_vertex(b%face_first(f)), x)
      out(:) = matmul(pair%rotation, b%face_normal(:, f))
      are_cores_there = are_cores_there .and. dot_product(out, on_b - x) <= room
    end do
  end function are_cores_there

  !> Count what is wrong; what is right needs no text put together.
  subroutine expect(condition, name, what)
    logical, intent(in) :: condition
    character(len=*), intent(in) :: name, what
    if (.not. condition) call check(.false., trim(name)//": "//what)
  end subroutine expect

  !> Corners of the common part of two parallel faces, found by trying all pairs of sides of the sharp prisms: each has a point.
  subroutine find_missing(a, b, pair, core, name)
    type(body_shape_t), intent(in) :: a, b
    type(placed_pair_t), intent(in) :: pair
    type(core_distance_t), intent(in) :: core
    character(len=*), intent(in) :: name
    type(manifold_t) :: manifold
    real(dp) :: line(3, 64), corner(2), det, room
    integer :: n, i, j, k
    logical :: found

    ! the nearest points are in the faces across the third axis
    if (abs(abs(core%normal(3)) - 1.0_dp) > exact) return
    call find_polyhedron_manifold(a%piece(1), b%piece(1), pair, core%distance + 1.0_dp, most_points, manifold)
    n = 0
    call add_lines(a%piece(1), pair%radius_a, .false., pair, line, n)
    call add_lines(b%piece(1), pair%radius_b, .true., pair, line, n)
    room = 3.0e-5_dp*(pair%radius_a + pair%radius_b)
    do i = 2, n
      do j = 1, i - 1
        det = line(1, i)*line(2, j) - line(2, i)*line(1, j)
        if (abs(det) < 1.0e-3_dp) cycle
        corner(1) = (line(3, i)*line(2, j) - line(2, i)*line(3, j))/det
        corner(2) = (line(1, i)*line(3, j) - line(3, i)*line(1, j))/det
        if (any(corner(1)*line(1, 1:n) + corner(2)*line(2, 1:n) > line(3, 1:n) + 1.0e-9_dp)) cycle
        found = .false.
        do k = 1, manifold%n
          found = found .or. norm2(manifold%point(1:2, k) - corner) <= room
        end do
        if (.not. found) call check(.false., trim(name)//": a corner of parallel faces without a point")
      end do
    end do
    tally(parallel_faces)%points = tally(parallel_faces)%points + manifold%n
  end subroutine find_missing

  !> Prisms whose edges along the third axis are nearest to each other, or such an edge and a side, touch all along the common
  !> stretch of both: a point at each of its ends, at least.
  subroutine find_single(a, b, pair, core, name)
    type(convex_piece_t), intent(in) :: a, b
    type(placed_pair_t), intent(in) :: pair
    type(core_distance_t), intent(in) :: core
    character(len=*), intent(in) :: name
    type(manifold_t) :: manifold
    real(dp) :: low, high

    if (abs(core%normal(3)) > exact) return
    low = max(pair%radius_a*minval(a%vertex(3, :)), pair%way(3) + pair%radius_b*minval(b%vertex(3, :)))
    high = min(pair%radius_a*maxval(a%vertex(3, :)), pair%way(3) + pair%radius_b*maxval(b%vertex(3, :)))
    if (high - low < 1.0e-3_dp) return
    call find_polyhedron_manifold(a, b, pair, core%distance + 1.0_dp, most_points, manifold)
    call expect(manifold%n >= 2, name, "edges side by side with a single point")
    if (manifold%n < 2) return
    associate (along => manifold%point(3, 1:manifold%n))
      ! both ends are there, but for their blending
      call expect(maxval(along) - minval(along) >= high - low - exact, name, "edges side by side without a point at one end")
    end associate
  end subroutine find_single

  !> Sides of a prism's faces across the third axis as lines n . x = d.
  subroutine add_lines(piece, radius, placed, pair, line, n)
    type(convex_piece_t), intent(in) :: piece
    real(dp), intent(in) :: radius
    !> whether the piece is b
    logical, intent(in) :: placed
    type(placed_pair_t), intent(in) :: pair
    real(dp), intent(inout) :: line(:, :)
    integer, intent(inout) :: n
    real(dp) :: u(3)
    integer :: f

    do f = 1, size(piece%face_normal, 2)
      if (abs(piece%face_normal(3, f)) > 0.5_dp) cycle
      u(:) = piece%face_normal(:, f)
      n = n + 1
      line(3, n) = radius*(dot_product(u, piece%vertex(:, piece%face_vertex(piece%face_first(f)))) + piece%rounding)
      if (placed) then
        u(:) = u(1)*pair%rotation(:, 1) + u(2)*pair%rotation(:, 2) + u(3)*pair%rotation(:, 3)
        line(3, n) = line(3, n) + dot_product(u, pair%way)
      end if
      line(1:2, n) = u(1:2)
    end do
  end subroutine add_lines

  !> A body that slides and turns past another in small steps: neither the normal nor what the points can carry jumps.
  subroutine try_line()
    integer, parameter :: steps = 2000
    real(dp), parameter :: alert = 0.05_dp, step = 2.0e-5_dp
    type(body_shape_t), pointer :: a, b
    type(placed_pair_t) :: pair, before
    type(manifold_t) :: manifold
    type(vector_t) :: way, axis
    real(dp) :: spin(3, 3), normal(3), carried(6), last_normal(3), last_carried(6), reach, turn, worst
    integer :: k, met

    call draw_pair(draws, library, merge(6, 1, draws%uniform() < 0.5_dp), a, b, pair)
    way = draws%direction()
    axis = draws%direction()
    call make_spin(axis, step, spin)
    reach = pair%radius_a*a%piece(1)%rounding + pair%radius_b*b%piece(1)%rounding
    worst = 0.0_dp
    met = 0
    do k = 1, steps
      before = pair
      call advance(pair, way, step, spin)
      call find_polyhedron_manifold(a%piece(1), b%piece(1), pair, alert, most_points, manifold)
      if (manifold%n == 0 .or. manifold%cores_overlap) then
        met = 0
        cycle
      end if
      normal(:) = manifold%normal
      call find_carried(manifold, alert, pair%radius_a + pair%radius_b, carried)
      if (met > 0) then
        turn = norm2(normal - last_normal)*(minval(manifold%gap(1:manifold%n)) + reach)
        ! a step shifts nearest points by as much, and turns the bodies, whose points are up to two sizes away
        if (turn > 5.0_dp*step) call check(parts_of(a, b, before, way, axis, step, last_normal) <= 0.5_dp*turn, &
          & "line: the normal jumps")
        worst = max(worst, maxval(abs(carried - last_carried)))
      end if
      last_normal(:) = normal
      last_carried(:) = carried
      met = met + 1
    end do
    ! a patch of one face or edge of each body may give way to one of others, whose far points have gaps above the least
    lines = lines + 1
    if (worst > 0.2_dp*(pair%radius_a + pair%radius_b)) jumps = jumps + 1
  end subroutine try_line

  !> Shift and turn the second body by a step.
  subroutine advance(pair, way, step, spin)
    type(placed_pair_t), intent(inout) :: pair
    type(vector_t), intent(in) :: way
    real(dp), intent(in) :: step, spin(3, 3)
    real(dp) :: turned(3, 3)

    pair%way(:) = pair%way + step*way%x
    turned(:, :) = matmul(spin, pair%rotation)
    pair%rotation(:, :) = turned
  end subroutine advance

  !> Largest turn of the normal times the distance in one of 64 parts of a step. Edges that are nearly parallel turn their common
  !> normal fast: parts of the step then turn it by parts. What jumps does so in one of them.
  real(dp) function parts_of(a, b, before, way, axis, step, first_normal) result(largest)
    type(body_shape_t), intent(in) :: a, b
    type(placed_pair_t), intent(in) :: before
    type(vector_t), intent(in) :: way, axis
    real(dp), intent(in) :: step, first_normal(3)
    integer, parameter :: parts = 64
    type(placed_pair_t) :: pair
    type(core_distance_t) :: core
    real(dp) :: spin(3, 3), last(3)
    integer :: k

    call make_spin(axis, step/parts, spin)
    pair = before
    last(:) = first_normal
    largest = 0.0_dp
    do k = 1, parts
      call advance(pair, way, step/parts, spin)
      call find_core_distance(a%piece(1), b%piece(1), pair, huge(1.0_dp), core)
      largest = max(largest, norm2(core%normal - last)*core%distance)
      last(:) = core%normal
    end do
  end function parts_of

  subroutine make_spin(axis, angle, spin)
    type(vector_t), intent(in) :: axis
    real(dp), intent(in) :: angle
    real(dp), intent(out) :: spin(3, 3)
    integer :: k

    ! to first order, and made orthogonal to second
    spin(:, :) = 0.0_dp
    do k = 1, 3
      spin(k, k) = 1.0_dp
    end do
    spin(1, 2) = -angle*axis%x(3)
    spin(2, 3) = -angle*axis%x(1)
    spin(3, 1) = -angle*axis%x(2)
    spin(2, 1) = angle*axis%x(3)
    spin(3, 2) = angle*axis%x(1)
    spin(1, 3) = angle*axis%x(2)
  end subroutine make_spin

  !> How far to each side the resultant of a manifold can be: points with more than the least gap reach less far, by so much that
  !> one at the alert distance counts for nothing.
  subroutine find_carried(manifold, alert, scale, carried)
    type(manifold_t), intent(in) :: manifold
    real(dp), intent(in) :: alert, scale
    real(dp), intent(out) :: carried(6)
    integer :: d, k

    carried(:) = -huge(1.0_dp)
    do k = 1, manifold%n
      do d = 1, 3
        associate (loss => 4*scale/alert*(manifold%gap(k) - minval(manifold%gap(1:manifold%n))))
          carried(d) = max(carried(d), manifold%point(d, k) - loss)
          carried(d + 3) = max(carried(d + 3), -manifold%point(d, k) - loss)
        end associate
      end do
    end do
  end subroutine find_carried

  !> What was found, family by family.
  subroutine report()
    integer :: f

    print "(2(i0, a))", lines, " lines, in ", jumps, " of them what the points carry jumps"
    print "(a)", "family                     pairs  overlaps  steps  most  points   duality  distance    normal"
    do f = 1, families
      associate (t => tally(f))
        print "(a24, i8, i10, f7.2, i6, f8.2, 3es10.2)", family_names(f), t%pairs, t%overlaps, &
          & t%steps/real(max(1_i8, t%pairs), dp), t%most_steps, t%points/real(max(1_i8, t%contacts), dp), &
          & t%duality, t%distance, t%normal
      end associate
    end do
  end subroutine report

end program test_polyhedron_fuzz
