!> The points in which two bodies touch, or a body and a boundary, where bodies have shapes.
module gravier_shape_contacts
  use gravier_kinds, only: dp
  use gravier_convex_piece, only: convex_piece_t, list_faces, shares_corner, looks_along, first_of_corner
  use gravier_shape_library, only: shape_library_t, face_points
  use gravier_boundary, only: boundary_t
  use gravier_manifold, only: manifold_t, feature_base
  use gravier_polygon_pair, only: placed_piece_t, place_piece, find_plane_manifold
  use gravier_polyhedron_pair, only: find_halfspace_manifold
  use gravier_facet, only: near_facets_t, find_facet_normal
  use gravier_facet_contacts, only: facet_contacts_t, find_ball_contacts, find_polygon_contacts, find_polyhedron_contacts, &
    & keep_corners
  use gravier_material_filter, only: material_of
  use gravier_decomposition, only: decomposition_t
  use gravier_halo, only: local_bodies_t
  use gravier_seen_body, only: seen_body_t, see_body, turn_manifold, turn_vertex, turn_facets, turn_corners
  use gravier_surface_velocity, only: add_image_velocity
  use gravier_piece_meeting, only: room_t, nearest_t, meet_pieces, find_nearest_points
  use gravier_clear_path, only: clear_path
  use gravier_wall_joints, only: is_in_joint
  use gravier_wall_sheet, only: wall_sheet_t, level, leans
  use gravier_pair_points, only: pair_points_t
  implicit none
  private
  public :: shape_work_t, find_points

  !> points of one pair that are nearer to each other than this, over the radius of the candidate, may be one
  real(dp), parameter :: same = 1.0e-6_dp
  !> largest distance of points at a seam, over the rounding of a piece
  real(dp), parameter :: two_roundings = 2.01_dp
  !> distance, over the rounding of a piece, within which points of two boundaries are one
  real(dp), parameter :: one_place = 1.0e-3_dp

  !> Where contacts attract or yield, corners of a patch that are this near to the line of their neighbours, over the radius, are
  !> left out. Two faces that have shifted a little then have as many attractions or springs as before.
  real(dp), parameter :: straight_joint = 3.0e-3_dp
  !> 1 and some roundings: pieces whose balls are farther apart have no contact
  real(dp), parameter :: apart = 1.0_dp + 1.0e-9_dp

  !> What is made once for many pairs: a disk or a sphere of radius 1 as a piece, room for pieces where bodies are and where they
  !> go, and for facets.
  type :: shape_work_t
    private
    type(convex_piece_t) :: ball
    type(room_t) :: room, ahead
    !> over which bodies go on with their velocities, 0 where these do not count [s]; points with a larger gap are no contacts [m]
    real(dp) :: step = 0.0_dp, alert = 0.0_dp
    type(near_facets_t) :: near, turned
    type(facet_contacts_t) :: facets
  contains
    procedure :: init => shape_work_init
  end type shape_work_t

contains

  subroutine shape_work_init(self, nd, step, counts)
    class(shape_work_t), intent(inout) :: self
    !> 2 or 3
    integer, intent(in) :: nd
    !> [s]; 0 where only the places count
    real(dp), intent(in) :: step
    !> it matters in how many points faces touch: some bodies attract each other, or have springs
    logical, intent(in) :: counts

    self%step = step
    self%room%straight = merge(straight_joint, 0.0_dp, counts)
    self%ball%rounding = 1.0_dp
    if (allocated(self%ball%vertex)) deallocate (self%ball%vertex, self%ball%corner, self%ball%face_first, &
      & self%ball%neighbour_first, self%ball%face_vertex, self%ball%neighbour, self%ball%face_normal)
    allocate (self%ball%vertex(nd, 1), self%ball%corner(nd, 1), source=0.0_dp)
    allocate (self%ball%face_first(1), self%ball%neighbour_first(2), source=1)
    allocate (self%ball%face_vertex(0), self%ball%neighbour(0), self%ball%face_normal(3, 0))
    call list_faces(self%ball)
  end subroutine shape_work_init

  !> The points of pair `p` of a view whose gap is at most the alert distance; at most as many as the pair has places in the list,
  !> those with the smallest gaps.
  subroutine find_points(view, decomposition, p, work, points)
    type(local_bodies_t), intent(in) :: view
    type(decomposition_t), intent(in) :: decomposition
    integer, intent(in) :: p
    !> initialised
    type(shape_work_t), intent(inout) :: work
    type(pair_points_t), intent(inout) :: points
    type(seen_body_t) :: candidate, antagonist
    real(dp) :: way(decomposition%nd), seam(2)
    integer :: i, j

    points%n = 0
    points%way(:) = 0.0_dp
    work%alert = decomposition%alert_distance()
    call view%find_ends(p, i, j)
    associate (bodies => view%bodies)
      if (j > 0) then
        call view%find_way(p, decomposition%period, way)
        if (norm2(way) > bodies%radius(i) + bodies%radius(j) + work%alert) return
        call see_body(bodies, i, candidate)
        call see_body(bodies, j, antagonist)
        antagonist%centre(1:decomposition%nd) = way
        points%way(:) = antagonist%centre
        if (view%period%moves) call add_image_velocity(view, p, antagonist%velocity(1:decomposition%nd))
        call touch_body(decomposition%shapes, candidate, antagonist, work, points)
      else
        call see_body(bodies, i, candidate)
        if (allocated(decomposition%rule%filter%passes)) &
          & candidate%material = material_of(bodies, decomposition%boundaries, i)
        call touch_boundary(decomposition, candidate, bodies%position(:, i), -j, work, points)
      end if
      seam(:) = 0.0_dp
      seam(1) = seam_of(decomposition%shapes, candidate)
      if (j > 0) seam(2) = seam_of(decomposition%shapes, antagonist)
      call points%merge_near(same*bodies%radius(i), seam, decomposition%shapes%are_round)
    end associate
    call points%keep_deepest(view%list%points_of(p))
  end subroutine find_points

  !> The points of two bodies, piece by piece.
  subroutine touch_body(shapes, a, b, work, points)
    type(shape_library_t), intent(in) :: shapes
    type(seen_body_t), intent(in) :: a, b
    type(shape_work_t), intent(inout) :: work
    type(pair_points_t), intent(inout) :: points
    logical :: several
    integer :: k, number(2)

    number(:) = 1
    several = shapes%n_pieces(a%shape)*shapes%n_pieces(b%shape) > 1 .and. a%shape > 0
    if (a%shape == 0) then
      call touch(work%ball)
    else
      do k = 1, shapes%n_pieces(a%shape)
        number(1) = k
        call touch(shapes%shape(a%shape)%piece(k))
      end do
    end if

  contains

    subroutine touch(piece)
      type(convex_piece_t), intent(in) :: piece
      integer :: l

      if (b%shape == 0) then
        call touch_piece(piece, work%ball, a, b, number, work, points)
      else
        do l = 1, shapes%n_pieces(b%shape)
          number(2) = l
          associate (other => shapes%shape(b%shape)%piece(l))
            ! bodies of one piece each are near to each other by their own balls
            if (several) then
              if (are_apart(piece, other)) cycle
            end if
            call touch_piece(piece, other, a, b, number, work, points)
          end associate
        end do
      end if
    end subroutine touch

    !> Whether the balls that hold two pieces are farther apart than contacts are wide.
    pure logical function are_apart(one, other)
      type(convex_piece_t), intent(in) :: one, other
      real(dp) :: at_one(3), at_other(3)

      call turn_vertex(one%middle, a, at_one)
      call turn_vertex(other%middle, b, at_other)
      are_apart = norm2(b%centre + at_other - a%centre - at_one) > apart*(a%radius*one%reach + b%radius*other%reach + work%alert)
    end function are_apart

  end subroutine touch_body

  !> The points of two pieces, with the gaps of those that go past each other widened.
  subroutine touch_piece(piece_a, piece_b, a, b, number, work, points)
    type(convex_piece_t), intent(in) :: piece_a, piece_b
    type(seen_body_t), intent(in) :: a, b
    !> of each piece
    integer, intent(in) :: number(2)
    type(shape_work_t), intent(inout) :: work
    type(pair_points_t), intent(inout) :: points
    type(manifold_t) :: manifold

    call meet_pieces(piece_a, piece_b, a, b, work%alert, work%room, manifold)
    if (work%step > 0.0_dp) call clear_path(piece_a, piece_b, work%step, a, b, work%ahead, manifold)
    call points%add(manifold, number(1), number(2))
  end subroutine touch_piece

  !> The points with a boundary: a plane, a surface that ends at straight edges, one that is round, or one of facets.
  subroutine touch_boundary(decomposition, a, centre, j, work, points)
    type(decomposition_t), intent(in) :: decomposition
    type(seen_body_t), intent(in) :: a
    !> of the body (nd) [m]
    real(dp), intent(in), contiguous :: centre(:)
    !> number of the boundary
    integer, intent(in) :: j
    type(shape_work_t), intent(inout) :: work
    type(pair_points_t), intent(inout) :: points

    associate (boundary => decomposition%boundaries(j))
      if (.not. boundary%present) return
      if (boundary%is_faceted()) then
        call touch_mesh(decomposition, a, centre, j, work, points)
      else
        call touch_surface(decomposition, a, centre, j, work, points)
      end if
    end associate
  end subroutine touch_boundary

  !> The points with a boundary of facets.
  subroutine touch_mesh(decomposition, a, centre, j, work, points)
    type(decomposition_t), intent(in) :: decomposition
    type(seen_body_t), intent(in) :: a
    !> of the body (nd) [m]
    real(dp), intent(in), contiguous :: centre(:)
    !> number of the boundary
    integer, intent(in) :: j
    type(shape_work_t), intent(inout) :: work
    type(pair_points_t), intent(inout) :: points
    integer :: k

    call decomposition%boundaries(j)%find_facets(centre, a%radius + work%alert, work%near)
    do k = 1, decomposition%shapes%n_pieces(a%shape)
      if (work%near%n == 0) exit
      if (a%shape == 0) then
        call touch(work%ball)
      else
        call touch(decomposition%shapes%shape(a%shape)%piece(k))
      end if
    end do

  contains

    subroutine touch(piece)
      type(convex_piece_t), intent(in) :: piece
      integer :: l

      call find_facet_contacts(piece, a, size(centre), work)
      do l = 1, work%facets%n
        call pass_rim(piece, work%facets%corner(:, 1:size(centre), l), work%facets%manifold(l))
        call points%add(work%facets%manifold(l), k, mod(work%facets%facet(l), feature_base))
      end do
    end subroutine touch

    !> The rim of a mesh is no obstacle where another boundary goes on, nor to what goes past it.
    subroutine pass_rim(piece, corners, manifold)
      type(convex_piece_t), intent(in) :: piece
      !> of the facet, with its edge as far as the wall goes on along it
      real(dp), intent(in), contiguous :: corners(:, :)
      type(manifold_t), intent(inout) :: manifold
      type(wall_sheet_t) :: sheet
      real(dp) :: of_facet(3)

      call find_facet_normal(corners, of_facet)
      if (.not. leans(manifold%normal, of_facet)) return
      call sheet%init(decomposition%boundaries(j), j, centre, corners)
      call leave_joints(decomposition, centre, piece, a, sheet, work, manifold)
      if (work%step > 0.0_dp) call clear_path(piece, sheet%piece, work%step, a, sheet%seen, work%ahead, manifold)
    end subroutine pass_rim

  end subroutine touch_mesh

  !> The points with a plane, a surface that ends at straight edges, or one that is round.
  subroutine touch_surface(decomposition, a, centre, j, work, points)
    type(decomposition_t), intent(in) :: decomposition
    type(seen_body_t), intent(in) :: a
    !> of the body (nd) [m]
    real(dp), intent(in), contiguous :: centre(:)
    !> number of the boundary
    integer, intent(in) :: j
    type(shape_work_t), intent(inout) :: work
    type(pair_points_t), intent(inout) :: points
    type(wall_sheet_t) :: sheet
    real(dp) :: normal(size(centre)), distance, corners(3, 4)
    integer :: k, n

    associate (boundary => decomposition%boundaries(j))
      call boundary%locate(centre, distance, normal)
      if (distance - a%radius > work%alert) return
      call boundary%find_corners(centre, n, corners)
      if (n > 0) call sheet%init(boundary, j, centre, corners(:, 1:n))
    end associate
    do k = 1, decomposition%shapes%n_pieces(a%shape)
      if (a%shape == 0) then
        call touch(work%ball)
      else
        call touch(decomposition%shapes%shape(a%shape)%piece(k))
      end if
    end do

  contains

    subroutine touch(piece)
      type(convex_piece_t), intent(in) :: piece
      type(manifold_t) :: manifold

      associate (boundary => decomposition%boundaries(j))
        if (boundary%is_plane()) then
          call touch_plane(piece, a, normal, distance, work%alert, work%room%a, manifold)
        else if (n > 0) then
          call meet_pieces(piece, sheet%piece, a, sheet%seen, work%alert, work%room, manifold)
          call leave_joints(decomposition, centre, piece, a, sheet, work, manifold)
          if (work%step > 0.0_dp) call clear_path(piece, sheet%piece, work%step, a, sheet%seen, work%ahead, manifold)
        else
          call touch_round_surface(piece, a, centre, boundary, work%alert, k, points)
          return
        end if
      end associate
      call points%add(manifold, k, 1)
    end subroutine touch

  end subroutine touch_surface

  !> Where a side leans over a sheet and touches its edge, it is not stopped there if the wall goes on upwards.
  subroutine leave_joints(decomposition, centre, piece, a, sheet, work, manifold)
    type(decomposition_t), intent(in) :: decomposition
    !> of the body (nd) [m]
    real(dp), intent(in), contiguous :: centre(:)
    type(convex_piece_t), intent(in) :: piece
    type(seen_body_t), intent(in) :: a
    type(wall_sheet_t), intent(in) :: sheet
    type(shape_work_t), intent(inout) :: work
    type(manifold_t), intent(inout) :: manifold
    type(nearest_t) :: near
    real(dp) :: edge(size(centre)), tolerance
    logical :: passed(size(decomposition%boundaries))

    if (manifold%n == 0) return
    if (.not. sheet%leans_at_edge(manifold%normal)) return
    call find_nearest_points(piece, sheet%piece, a, sheet%seen, work%room, near)
    if (near%overlap) return
    tolerance = one_place*a%radius*piece%rounding
    edge(:) = centre + near%point(1:size(centre)) - 0.5_dp*(near%gap + a%radius*piece%rounding)*near%normal(1:size(centre))
    call decomposition%rule%filter%find_passed(a%material, decomposition%boundaries, passed)
    if (is_in_joint(decomposition%boundaries, sheet%boundary, edge, manifold%normal, tolerance, level, passed)) &
      & call keep_corners(sheet%corner, tolerance, level, manifold)
  end subroutine leave_joints

  !> The contacts of a piece with the facets near its body, in global axes.
  subroutine find_facet_contacts(piece, a, nd, work)
    type(convex_piece_t), intent(in) :: piece
    type(seen_body_t), intent(in) :: a
    integer, intent(in) :: nd
    !> `near` is set, and `facets` afterwards
    type(shape_work_t), intent(inout) :: work
    real(dp) :: vertex(3)
    integer :: k

    if (size(piece%vertex, 2) == 1) then
      call turn_vertex(piece%vertex(:, 1), a, vertex)
      call find_ball_contacts(vertex, a%radius*piece%rounding, work%near, work%alert, work%facets)
    else if (nd == 2) then
      work%room%a%reaches_out = piece%reaches_out
      call place_piece(piece%vertex, piece%corner, piece%rounding, a%radius, a%angle, a%centre(1:2), work%room%a)
      call find_polygon_contacts(work%room%a, work%near, work%alert, work%facets)
    else
      call turn_facets(a%axes, work%near, work%turned)
      call find_polyhedron_contacts(piece, a%radius, work%turned, work%alert, face_points(piece), work%facets)
      do k = 1, work%facets%n
        call turn_manifold(a%axes, work%facets%manifold(k))
        call turn_corners(a%axes, work%facets%corner(:, :, k))
      end do
    end if
  end subroutine find_facet_contacts

  subroutine touch_plane(piece, a, normal, distance, alert, placed, manifold)
    type(convex_piece_t), intent(in) :: piece
    type(seen_body_t), intent(in) :: a
    !> (nd), and distance of the centre of the body [m]
    real(dp), intent(in), contiguous :: normal(:)
    real(dp), intent(in) :: distance, alert
    type(placed_piece_t), intent(inout) :: placed
    type(manifold_t), intent(inout) :: manifold
    real(dp) :: turned(3)
    integer :: k

    if (size(normal) == 2) then
      placed%reaches_out = piece%reaches_out
      call place_piece(piece%vertex, piece%corner, piece%rounding, a%radius, a%angle, a%centre(1:2), placed)
      call find_plane_manifold(placed, normal, -distance, alert, manifold)
      return
    end if
    do k = 1, 3
      turned(k) = sum(a%axes(:, k)*normal)
    end do
    call find_halfspace_manifold(piece, a%radius, turned, distance, alert, face_points(piece), manifold)
    call turn_manifold(a%axes, manifold)
  end subroutine touch_plane

  !> The points with a round surface: corners, each with its nearest vertex, of a polygon the nearest and the nearer of those beside
  !> it.
  subroutine touch_round_surface(piece, a, centre, boundary, alert, number, points)
    type(convex_piece_t), intent(in) :: piece
    type(seen_body_t), intent(in) :: a
    real(dp), intent(in) :: centre(:)
    type(boundary_t), intent(in) :: boundary
    real(dp), intent(in) :: alert
    !> of the piece
    integer, intent(in) :: number
    type(pair_points_t), intent(inout) :: points
    type(manifold_t) :: manifold
    real(dp) :: gap(size(piece%vertex, 2)), normal(size(centre)), vertex(3), along(3)
    integer :: v, k, nd, nearest, beside

    nd = size(centre)
    do v = 1, size(gap)
      call locate_vertex()
    end do
    nearest = minloc(gap, dim=1)
    beside = nearest
    if (nd == 2) then
      beside = mod(nearest, size(gap)) + 1
      v = mod(nearest + size(gap) - 2, size(gap)) + 1
      if (gap(v) < gap(beside)) beside = v
    end if
    do v = 1, size(gap)
      if (gap(v) > alert .or. (nd == 2 .and. v /= nearest .and. v /= beside)) cycle
      if (.not. is_nearest_of_corner(v)) cycle
      call locate_vertex()
      if (nd == 3 .and. v /= nearest) then
        do k = 1, 3
          along(k) = -dot_product(normal, a%axes(:, k))
        end do
        if (.not. looks_along(piece, v, along)) cycle
      end if
      manifold%n = 1
      manifold%normal(1:nd) = normal
      manifold%gap(1) = gap(v)
      manifold%point(:, 1) = vertex
      manifold%point(1:nd, 1) = vertex(1:nd) - (a%radius*piece%rounding + 0.5_dp*gap(v))*normal
      manifold%key(1) = feature_base*first_of_corner(piece, v)
      call points%add(manifold, number, 1)
    end do

  contains

    pure logical function is_nearest_of_corner(v)
      integer, intent(in) :: v
      integer :: w

      is_nearest_of_corner = .false.
      do w = first_of_corner(piece, v), size(gap)
        if (.not. shares_corner(piece, v, w)) exit
        if (gap(w) < gap(v) .or. (w < v .and. gap(w) <= gap(v))) return
      end do
      is_nearest_of_corner = .true.
    end function is_nearest_of_corner

    !> Where vertex v is from the centre, and the surface from there.
    subroutine locate_vertex()
      real(dp) :: distance, at(size(centre))

      call turn_vertex(piece%vertex(:, v), a, vertex)
      at(:) = centre + vertex(1:nd)
      call boundary%locate(at, distance, normal)
      gap(v) = distance - a%radius*piece%rounding
    end subroutine locate_vertex

  end subroutine touch_round_surface

  !> How far apart the points of two pieces may be at a seam of a cluster [m]: both roundings. Disks, spheres and capsules have no
  !> seams.
  pure real(dp) function seam_of(shapes, seen) result(seam)
    type(shape_library_t), intent(in) :: shapes
    type(seen_body_t), intent(in) :: seen
    integer :: k

    seam = 0.0_dp
    if (seen%shape == 0) return
    associate (piece => shapes%shape(seen%shape)%piece)
      if (size(piece) == 1) return
      do k = 1, size(piece)
        if (size(piece(k)%vertex, 2) > 2) seam = max(seam, two_roundings*seen%radius*piece(k)%rounding)
      end do
    end associate
  end function seam_of

end module gravier_shape_contacts
