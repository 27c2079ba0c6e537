!> Volume, centre and inertia of bodies of density 1, and their principal axes.
module gravier_mass_properties
  use gravier_kinds, only: dp
  use gravier_rotation, only: cross
  use gravier_spatial, only: triple_product
  use gravier_sharp_polyhedron, only: sharp_polyhedron_t
  implicit none
  private
  public :: mass_t, mass_of_polyhedron, mass_of_capsule, mass_of_sum, find_principal_axes

  !> A body of density 1; lengths are those of its points.
  type :: mass_t
    real(dp) :: volume = 0.0_dp
    real(dp) :: centre(3) = 0.0_dp
    !> tensor of inertia about the centre
    real(dp) :: inertia(3, 3) = 0.0_dp
  end type mass_t

  real(dp), parameter :: pi = acos(-1.0_dp)
  !> sweeps of Jacobi's method, which needs fewer than ten
  integer, parameter :: most_sweeps = 30

contains

  !> Those of a polyhedron, exact: sums over the tetrahedra that triangles of its surface span with a point inside. (The second
  !> moments of a tetrahedron are those of Tonon, J. Math. Stat. 1 (2005) 8; the sums are those of Mirtich, J. Graph. Tools 1 (1996)
  !> 31.)
  pure function mass_of_polyhedron(polyhedron) result(mass)
    type(sharp_polyhedron_t), intent(in) :: polyhedron
    type(mass_t) :: mass
    real(dp) :: inside(3), x(3, 3), total(3), six, first(3), second(3, 3)
    integer :: f, k, i, j

    inside(:) = sum(polyhedron%vertex, 2)/size(polyhedron%vertex, 2)
    first(:) = 0.0_dp
    second(:, :) = 0.0_dp
    do f = 1, size(polyhedron%face_first) - 1
      x(:, 1) = polyhedron%vertex(:, polyhedron%face_vertex(polyhedron%face_first(f))) - inside
      do k = polyhedron%face_first(f) + 2, polyhedron%face_first(f + 1) - 1
        x(:, 2) = polyhedron%vertex(:, polyhedron%face_vertex(k - 1)) - inside
        x(:, 3) = polyhedron%vertex(:, polyhedron%face_vertex(k)) - inside
        six = triple_product(x(:, 1), x(:, 2), x(:, 3))
        total(:) = x(:, 1) + x(:, 2) + x(:, 3)
        mass%volume = mass%volume + six/6
        first(:) = first + six/24*total
        do j = 1, 3
          do i = 1, 3
            second(i, j) = second(i, j) + six/120*(total(i)*total(j) + x(i, 1)*x(j, 1) + x(i, 2)*x(j, 2) + x(i, 3)*x(j, 3))
          end do
        end do
      end do
    end do
    if (.not. mass%volume > 0.0_dp) return
    first(:) = first/mass%volume
    mass%centre(:) = inside + first
    call inertia_of_moments(second, mass%volume, first, mass%inertia)
  end function mass_of_polyhedron

  !> The tensor of inertia about the centre, from second moments about another point.
  pure subroutine inertia_of_moments(second, volume, centre, inertia)
    !> integrals of x x^T
    real(dp), intent(in) :: second(3, 3)
    !> the centre seen from that point
    real(dp), intent(in) :: volume, centre(3)
    real(dp), intent(out) :: inertia(3, 3)
    real(dp) :: about(3, 3)
    integer :: i, j

    do j = 1, 3
      do i = 1, 3
        about(i, j) = second(i, j) - volume*centre(i)*centre(j)
      end do
    end do
    do i = 1, 3
      inertia(:, i) = -0.5_dp*(about(:, i) + about(i, :))
      inertia(i, i) = inertia(i, i) + about(1, 1) + about(2, 2) + about(3, 3)
    end do
  end subroutine inertia_of_moments

  !> Those of all points within a distance of a segment: a capsule, or a sphere where both ends are one point.
  pure function mass_of_capsule(ends, radius) result(mass)
    !> (3, 2)
    real(dp), intent(in) :: ends(:, :), radius
    type(mass_t) :: mass
    real(dp) :: length, axis(3), rod, ball, along, across
    integer :: i, j

    mass%centre(:) = 0.5_dp*(ends(:, 1) + ends(:, 2))
    length = norm2(ends(:, 2) - ends(:, 1))
    axis(:) = 0.0_dp
    if (length > 0.0_dp) axis(:) = (ends(:, 2) - ends(:, 1))/length
    rod = pi*radius**2*length
    ball = 4*pi/3*radius**3
    mass%volume = rod + ball
    along = rod*radius**2/2 + ball*2*radius**2/5
    ! the centre of a half-ball is 3/8 of the radius from its flat side
    across = rod*(length**2/12 + radius**2/4) + ball*(2*radius**2/5 + length**2/4 + 3*length*radius/8)
    do j = 1, 3
      do i = 1, 3
        mass%inertia(i, j) = (along - across)*axis(i)*axis(j)
      end do
      mass%inertia(j, j) = mass%inertia(j, j) + across
    end do
  end function mass_of_capsule

  !> Those of several bodies together that do not overlap (the theorem of Huygens and Steiner). The centre is found from that of the
  !> first one, so that bodies far from the origin keep their digits.
  pure function mass_of_sum(masses) result(mass)
    type(mass_t), intent(in) :: masses(:)
    type(mass_t) :: mass
    real(dp) :: way(3)
    integer :: k, i, j

    do k = 1, size(masses)
      mass%volume = mass%volume + masses(k)%volume
      mass%centre(:) = mass%centre + masses(k)%volume*(masses(k)%centre - masses(1)%centre)
    end do
    if (.not. mass%volume > 0.0_dp) return
    mass%centre(:) = masses(1)%centre + mass%centre/mass%volume
    do k = 1, size(masses)
      way(:) = masses(k)%centre - mass%centre
      mass%inertia(:, :) = mass%inertia + masses(k)%inertia
      do j = 1, 3
        do i = 1, 3
          mass%inertia(i, j) = mass%inertia(i, j) - masses(k)%volume*way(i)*way(j)
        end do
        mass%inertia(j, j) = mass%inertia(j, j) + masses(k)%volume*dot_product(way, way)
      end do
    end do
  end function mass_of_sum

  !> Principal moments and axes by Jacobi's method. Of all orders and signs those are taken that turn the body least: axis k is the
  !> one along which axis k of the body was, the greatest component deciding first. So a body that is given in principal axes keeps
  !> them.
  pure subroutine find_principal_axes(inertia, moment, axes)
    real(dp), intent(in) :: inertia(3, 3)
    real(dp), intent(out) :: moment(3)
    !> axis k in column k; right-handed
    real(dp), intent(out) :: axes(3, 3)
    real(dp) :: a(3, 3), small
    integer :: sweep, p, q, k

    a(:, :) = inertia
    axes(:, :) = 0.0_dp
    do k = 1, 3
      axes(k, k) = 1.0_dp
    end do
    small = epsilon(1.0_dp)*(a(1, 1) + a(2, 2) + a(3, 3))
    do sweep = 1, most_sweeps
      ! what rounding has left where a body is given in principal axes must not turn it
      if (max(abs(a(1, 2)), abs(a(1, 3)), abs(a(2, 3))) <= merge(100*small, 0.01_dp*small, sweep == 1)) exit
      do p = 1, 2
        do q = p + 1, 3
          if (abs(a(p, q)) > 0.0_dp) call turn_plane(p, q, a, axes)
        end do
      end do
    end do
    do k = 1, 3
      moment(k) = a(k, k)
    end do
    call order_axes(moment, axes)
  end subroutine find_principal_axes

  !> One rotation of Jacobi's method, after which a(p, q) = 0.
  pure subroutine turn_plane(p, q, a, axes)
    integer, intent(in) :: p, q
    real(dp), intent(inout) :: a(3, 3), axes(3, 3)
    real(dp) :: half, t, c, s, column(3)

    half = 0.5_dp*(a(q, q) - a(p, p))
    t = a(p, q)/(abs(half) + hypot(half, a(p, q)))
    if (half < 0.0_dp) t = -t
    c = 1.0_dp/sqrt(1.0_dp + t*t)
    s = t*c
    column(:) = a(:, p)
    a(:, p) = c*column - s*a(:, q)
    a(:, q) = s*column + c*a(:, q)
    column(:) = a(p, :)
    a(p, :) = c*column - s*a(q, :)
    a(q, :) = s*column + c*a(q, :)
    a(p, q) = 0.0_dp
    a(q, p) = 0.0_dp
    column(:) = axes(:, p)
    axes(:, p) = c*column - s*axes(:, q)
    axes(:, q) = s*column + c*axes(:, q)
  end subroutine turn_plane

  !> The order and the signs that find_principal_axes tells of.
  pure subroutine order_axes(moment, axes)
    real(dp), intent(inout) :: moment(3), axes(3, 3)
    real(dp) :: old_moment(3), old_axes(3, 3)
    real(dp) :: last(3), greatest
    logical :: free(3, 3)
    integer :: k, i, j, place(2)

    old_moment(:) = moment
    old_axes(:, :) = axes
    free(:, :) = .true.
    place(:) = 1
    do k = 1, 3
      greatest = -1.0_dp
      do j = 1, 3
        do i = 1, 3
          if (.not. (free(i, j) .and. abs(old_axes(i, j)) > greatest)) cycle
          greatest = abs(old_axes(i, j))
          place(1) = i
          place(2) = j
        end do
      end do
      free(place(1), :) = .false.
      free(:, place(2)) = .false.
      moment(place(1)) = old_moment(place(2))
      axes(:, place(1)) = sign(1.0_dp, old_axes(place(1), place(2)))*old_axes(:, place(2))
    end do
    ! the product of the first two is the third or its opposite
    last(:) = cross(axes(:, 1), axes(:, 2))
    axes(:, 3) = last
  end subroutine order_axes

end module gravier_mass_properties
