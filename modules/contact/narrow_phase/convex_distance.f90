!> The distance of two convex cores in space, exact up to rounding (GJK: Gilbert, Johnson and Keerthi 1988).
!>
!> The point nearest to the origin in the set of all differences of a point of one core and one of the other is found by simplices
!> of up to four such differences, with signed volumes (Montanari, Petrinic and Barbieri, ACM Trans. Graph. 36 (2017) 30). Nothing
!> is kept between calls, so that the same two places give the same bits; vertices that are equally far in a direction give way to
!> the lowest of them.
module gravier_convex_distance
  use gravier_kinds, only: dp
  use gravier_convex_piece, only: convex_piece_t, find_support
  use gravier_nearest_simplex, only: find_nearest
  implicit none
  private
  public :: placed_pair_t, core_distance_t
  public :: find_core_distance, support_a, support_b, place_a, place_b

  !> Two pieces, where they are.
  type :: placed_pair_t
    !> radii of the two bodies [m]
    real(dp) :: radius_a = 1.0_dp, radius_b = 1.0_dp
    !> axes of b, one a column, and its centre, in the axes of a and from the centre of a [m]
    real(dp) :: rotation(3, 3) = 0.0_dp, way(3) = 0.0_dp
    !> Corners of a patch that are this near to the line of their neighbours, in parts of the smaller radius, are left out where
    !> there are more than those of the simpler face; 0: none are. Faces equal but for errors of solves touch as equal ones.
    real(dp) :: straight = 0.0_dp
  end type placed_pair_t

  !> How far two cores are from each other.
  type :: core_distance_t
    !> they are farther than what was asked about: nothing else is known
    logical :: beyond = .false.
    !> they overlap, or are closer than rounding lets tell: the rest is not known
    logical :: overlap = .false.
    !> [m]
    real(dp) :: distance = 0.0_dp
    !> unit vector from the nearest point of b to that of a
    real(dp) :: normal(3) = 0.0_dp
    !> the nearest points, in the axes of a from its centre [m]
    real(dp) :: point_a(3) = 0.0_dp, point_b(3) = 0.0_dp
    !> vertices whose hulls the nearest points are in: how many pairs, their numbers and shares, which sum to 1
    integer :: n = 0
    integer :: vertex_a(4) = 0, vertex_b(4) = 0
    real(dp) :: share(4) = 0.0_dp
    !> differences looked at
    integer :: steps = 0
  end type core_distance_t

  !> squared sine of an angle of a triangle that is thin
  real(dp), parameter :: thin = 1.0e-6_dp
  !> steps of a search that may go back
  integer, parameter :: most_back = 8
  !> more steps than a search takes
  integer, parameter :: most_steps = 200
  !> a length beyond all others whose fourth power can be had [m]
  real(dp), parameter :: endless = 1.0e70_dp
  !> below this distance, in parts of the size of the differences, cores count as overlapping
  real(dp), parameter :: touching = 1.0e-11_dp

contains

  !> The distance of the cores of two pieces.
  pure subroutine find_core_distance(a, b, pair, beyond, found)
    type(convex_piece_t), intent(in) :: a, b
    type(placed_pair_t), intent(in) :: pair
    !> distance above which the search may end early [m]
    real(dp), intent(in) :: beyond
    type(core_distance_t), intent(out) :: found
    real(dp) :: w(3, 4), x(3, 4), y(3), v(3), u(3), share(4), squared, along, size_squared
    integer :: i, j, n, back
    logical :: done

    v(:) = -pair%way
    if (.not. dot_product(v, v) > 0.0_dp) v(3) = 1.0_dp
    n = 0
    size_squared = 0.0_dp
    squared = huge(1.0_dp)
    along = 0.0_dp
    back = 0
    done = .false.
    do while (found%steps < most_steps)
      found%steps = found%steps + 1
      call support_a(a, v, i)
      call support_b(b, pair, v, j)
      call place_a(a, pair, i, x(:, n + 1))
      call place_b(b, pair, j, y)
      w(:, n + 1) = x(:, n + 1) - y
      along = dot_product(v, w(:, n + 1))
      ! the difference that is farthest along -v bounds the distance from below
      if (along > 0.0_dp .and. along*along > min(beyond, endless)**2*dot_product(v, v)) then
        found%beyond = .true.
        return
      end if
      size_squared = max(size_squared, dot_product(w(:, n + 1), w(:, n + 1)))
      done = is_known(found, n, i, j)
      if (n > 0) done = done .or. squared - along <= 4*epsilon(1.0_dp)*sqrt(squared*size_squared)
      if (.not. done) then
        call find_nearest(w, n + 1, share, u)
        ! a difference without a share changes nothing; some steps may seem to go back by rounding
        if (n > 0 .and. dot_product(u, u) >= squared) back = back + 1
        done = .not. share(n + 1) > 0.0_dp .or. back > most_back
      end if
      if (done) exit
      n = n + 1
      found%vertex_a(n) = i
      found%vertex_b(n) = j
      v(:) = u
      call drop_idle(found, n, share, w, x)
      squared = dot_product(v, v)
      if (n == 4 .or. squared <= touching**2*size_squared) exit
    end do
    found%n = n
    ! a slab across v that is not half as wide as the distance: the origin is in a simplex too flat to tell
    if (n == 4 .or. squared <= touching**2*size_squared .or. (done .and. along < 0.5_dp*squared)) then
      found%overlap = .true.
      return
    end if
    call finish(w(:, 1:n), x(:, 1:n), v, found)
  end subroutine find_core_distance

  !> Whether the difference of two vertices is in the simplex.
  pure logical function is_known(found, n, i, j)
    type(core_distance_t), intent(in) :: found
    integer, intent(in) :: n, i, j
    integer :: k

    is_known = .false.
    do k = 1, n
      is_known = is_known .or. (found%vertex_a(k) == i .and. found%vertex_b(k) == j)
    end do
  end function is_known

  !> Leave the vertices without a share out of the simplex.
  pure subroutine drop_idle(found, n, share, w, x)
    type(core_distance_t), intent(inout) :: found
    integer, intent(inout) :: n
    real(dp), intent(in) :: share(4)
    real(dp), intent(inout) :: w(3, 4), x(3, 4)
    integer :: k, m

    m = 0
    do k = 1, n
      if (.not. share(k) > 0.0_dp) cycle
      m = m + 1
      found%share(m) = share(k)
      if (m == k) cycle
      found%vertex_a(m) = found%vertex_a(k)
      found%vertex_b(m) = found%vertex_b(k)
      w(:, m) = w(:, k)
      x(:, m) = x(:, k)
    end do
    n = m
  end subroutine drop_idle

  !> Nearest points, distance and normal from the vertices that take part. The way between the points is made normal to both
  !> features up to rounding, once as a whole and once more as a unit vector, which matters where it is short.
  pure subroutine finish(w, x, v, found)
    !> differences and vertices of a (3, n)
    real(dp), intent(in) :: w(:, :), x(:, :)
    !> the nearest difference
    real(dp), intent(inout) :: v(3)
    type(core_distance_t), intent(inout) :: found
    integer :: k

    call make_normal(w, found%n, v)
    call settle_shares(w, v, found)
    found%normal(:) = v/sqrt(dot_product(v, v))
    call make_normal(w, found%n, found%normal)
    found%normal(:) = found%normal/sqrt(dot_product(found%normal, found%normal))
    ! the vertex with the largest share is the nearest to the foot
    k = maxloc(found%share(1:found%n), 1)
    found%distance = dot_product(found%normal, w(:, k))
    found%point_a(:) = x(:, 1)
    do k = 2, found%n
      found%point_a(:) = found%point_a + found%share(k)*(x(:, k) - x(:, 1))
    end do
    found%point_b(:) = found%point_a - found%distance*found%normal
  end subroutine finish

  !> Make v normal to the sides u and t of a simplex.
  pure subroutine make_normal(w, n, v)
    real(dp), intent(in) :: w(:, :)
    !> corners: 1 to 3
    integer, intent(in) :: n
    real(dp), intent(inout) :: v(3)
    real(dp) :: u(3), t(3), uu, ut, tt, det, along_u, along_t

    if (n == 1) return
    u(:) = w(:, 2) - w(:, 1)
    uu = dot_product(u, u)
    if (.not. uu > 0.0_dp) return
    along_u = dot_product(u, v)
    if (n == 2) then
      v(:) = v - along_u/uu*u
      return
    end if
    t(:) = w(:, 3) - w(:, 1)
    ut = dot_product(u, t)
    tt = dot_product(t, t)
    det = uu*tt - ut*ut
    ! of a thin triangle the search knows the normal better than squares of its sides
    if (det <= thin*uu*tt) return
    along_t = dot_product(t, v)
    v(:) = v - (tt*along_u - ut*along_t)/det*u - (uu*along_t - ut*along_u)/det*t
  end subroutine make_normal

  !> Correct the shares so that they give v. What they miss is resolved along one side of the simplex and across it, because this is
  !> accurate for thin triangles too.
  pure subroutine settle_shares(w, v, found)
    real(dp), intent(in) :: w(:, :)
    real(dp), intent(in) :: v(3)
    type(core_distance_t), intent(inout) :: found
    real(dp) :: u(3), t(3), missing(3), part, along, squared
    integer :: k

    if (found%n == 1) return
    u(:) = w(:, 2) - w(:, 1)
    squared = dot_product(u, u)
    if (.not. squared > 0.0_dp) return
    missing(:) = v - w(:, 1)
    do k = 2, found%n
      missing(:) = missing - found%share(k)*(w(:, k) - w(:, 1))
    end do
    if (found%n == 3) then
      t(:) = w(:, 3) - w(:, 1)
      along = dot_product(u, t)/squared
      t(:) = t - along*u
      part = dot_product(t, t)
      if (part > 0.0_dp) then
        part = dot_product(t, missing)/part
        found%share(3) = found%share(3) + part
        found%share(2) = found%share(2) - part*along
        missing(:) = missing - part*t
      end if
    end if
    found%share(2) = found%share(2) + dot_product(u, missing)/squared
    found%share(1) = 1.0_dp - sum(found%share(2:found%n))
  end subroutine settle_shares

  !> The vertex of a that is farthest along -v.
  pure subroutine support_a(a, v, i)
    type(convex_piece_t), intent(in) :: a
    real(dp), intent(in) :: v(3)
    integer, intent(out) :: i
    real(dp) :: along(3)

    along(:) = -v
    call find_support(a, along, i)
  end subroutine support_a

  !> The vertex of b that is farthest along v.
  pure subroutine support_b(b, pair, v, j)
    type(convex_piece_t), intent(in) :: b
    type(placed_pair_t), intent(in) :: pair
    real(dp), intent(in) :: v(3)
    integer, intent(out) :: j
    real(dp) :: along(3)
    integer :: k

    do k = 1, 3
      along(k) = pair%rotation(1, k)*v(1) + pair%rotation(2, k)*v(2) + pair%rotation(3, k)*v(3)
    end do
    call find_support(b, along, j)
  end subroutine support_b

  !> Vertex i of a in the axes of a [m].
  pure subroutine place_a(a, pair, i, x)
    type(convex_piece_t), intent(in) :: a
    type(placed_pair_t), intent(in) :: pair
    integer, intent(in) :: i
    real(dp), intent(out) :: x(3)
    x(:) = pair%radius_a*a%vertex(:, i)
  end subroutine place_a

  !> Vertex j of b in the axes of a, from the centre of a [m].
  pure subroutine place_b(b, pair, j, x)
    type(convex_piece_t), intent(in) :: b
    type(placed_pair_t), intent(in) :: pair
    integer, intent(in) :: j
    real(dp), intent(out) :: x(3)
    real(dp) :: u(3)
    integer :: k

    u(:) = pair%radius_b*b%vertex(:, j)
    do k = 1, 3
      x(k) = pair%way(k) + (pair%rotation(k, 1)*u(1) + pair%rotation(k, 2)*u(2) + pair%rotation(k, 3)*u(3))
    end do
  end subroutine place_b

end module gravier_convex_distance
