!> The point of a simplex of up to four points that is nearest to the origin, by signed volumes (Montanari, Petrinic and Barbieri,
!> ACM Trans. Graph. 36 (2017) 30): where the origin lies beside the simplex, the nearest point is sought in those faces that the
!> origin can be seen from.
module gravier_nearest_simplex
  use gravier_kinds, only: dp
  implicit none
  private
  public :: find_nearest

  !> a volume below this part of the largest of its terms may be rounding
  real(dp), parameter :: vanishing = 16*epsilon(1.0_dp)

contains

  !> Shares of the points in the nearest one, which sum to 1 and are 0 for points that it does not need.
  pure subroutine find_nearest(w, n, share, v)
    !> the points (3, 4), of which the first n are used
    real(dp), intent(in) :: w(3, 4)
    integer, intent(in) :: n
    real(dp), intent(out) :: share(4)
    !> the nearest point
    real(dp), intent(out) :: v(3)

    share(:) = 0.0_dp
    select case (n)
    case (1)
      share(1) = 1.0_dp
      v(:) = w(:, 1)
    case (2)
      call nearest_of_two(w, 1, 2, share, v)
    case (3)
      call nearest_of_three(w, 1, 2, 3, share, v)
    case default
      call nearest_of_four(w, share, v)
    end select
  end subroutine find_nearest

  !> Of a segment. Where the point is near the origin, rounding turns v against the segment, which is taken back.
  pure subroutine nearest_of_two(w, a, b, share, v)
    real(dp), intent(in) :: w(3, 4)
    integer, intent(in) :: a, b
    real(dp), intent(inout) :: share(4)
    real(dp), intent(out) :: v(3)
    real(dp) :: t(3), whole, part_a, part_b

    t(:) = w(:, b) - w(:, a)
    whole = dot_product(t, t)
    part_a = dot_product(w(:, b), t)
    part_b = -dot_product(w(:, a), t)
    share(a) = 0.0_dp
    share(b) = 0.0_dp
    if (.not. part_b > 0.0_dp .or. .not. whole > 0.0_dp) then
      share(a) = 1.0_dp
      v(:) = w(:, a)
    else if (.not. part_a > 0.0_dp) then
      share(b) = 1.0_dp
      v(:) = w(:, b)
    else if (part_a < part_b) then
      share(a) = part_a/whole
      share(b) = 1.0_dp - share(a)
      v(:) = w(:, b) - share(a)*t
      v(:) = v - dot_product(t, v)/whole*t
    else
      share(b) = part_b/whole
      share(a) = 1.0_dp - share(b)
      v(:) = w(:, a) + share(b)*t
      v(:) = v - dot_product(t, v)/whole*t
    end if
  end subroutine nearest_of_two

  !> Of a triangle: areas of the parts that the nearest point of its plane cuts it into, seen along the axis along which the
  !> triangle is largest.
  pure subroutine nearest_of_three(w, a, b, c, share, v)
    real(dp), intent(in) :: w(3, 4)
    integer, intent(in) :: a, b, c
    real(dp), intent(inout) :: share(4)
    real(dp), intent(out) :: v(3)
    real(dp) :: u(3), t(3), normal(3), foot(3), area, part(3), squared
    integer :: x, y, corner(3)

    u(:) = w(:, b) - w(:, a)
    t(:) = w(:, c) - w(:, a)
    normal(1) = u(2)*t(3) - u(3)*t(2)
    normal(2) = u(3)*t(1) - u(1)*t(3)
    normal(3) = u(1)*t(2) - u(2)*t(1)
    squared = dot_product(normal, normal)
    part(:) = -1.0_dp
    if (squared > vanishing**2*dot_product(u, u)*dot_product(t, t)) then
      foot(:) = dot_product(w(:, a), normal)/squared*normal
      x = 2
      y = 3
      area = normal(1)
      if (abs(normal(2)) > abs(area)) then
        x = 3
        y = 1
        area = normal(2)
      end if
      if (abs(normal(3)) > abs(area)) then
        x = 1
        y = 2
        area = normal(3)
      end if
      part(1) = signed_area(w(:, b), w(:, c))/area
      part(2) = signed_area(w(:, c), w(:, a))/area
      part(3) = signed_area(w(:, a), w(:, b))/area
    end if
    if (part(1) > 0.0_dp .and. part(2) > 0.0_dp .and. part(3) > 0.0_dp) then
      share(a) = part(1)
      share(b) = part(2)
      share(c) = part(3)
      ! of a thin triangle the point of these shares is in the plane more exactly than the foot, whose error is that of the normal
      ! times the way to a corner
      v(:) = w(:, a) + part(2)*u + part(3)*t
      v(:) = v - dot_product(u, v)/dot_product(u, u)*u
      call remove_across(u, t, v)
    else
      corner(1) = a
      corner(2) = b
      corner(3) = c
      call nearest_of_sides(w, corner, part, share, v)
    end if

  contains

    !> Twice the area of the triangle of the foot and two points, seen along an axis.
    pure real(dp) function signed_area(p, q) result(found)
      real(dp), intent(in) :: p(3), q(3)
      found = (p(x) - foot(x))*(q(y) - foot(y)) - (p(y) - foot(y))*(q(x) - foot(x))
    end function signed_area

  end subroutine nearest_of_three

  !> Make v normal to the part of t that is normal to u.
  pure subroutine remove_across(u, t, v)
    real(dp), intent(in) :: u(3), t(3)
    real(dp), intent(inout) :: v(3)
    real(dp) :: across(3)

    across(:) = t - dot_product(u, t)/dot_product(u, u)*u
    across(:) = across - dot_product(u, across)/dot_product(u, u)*u
    v(:) = v - dot_product(across, v)/dot_product(across, across)*across
  end subroutine remove_across

  !> Of those sides of a triangle that the origin can be seen from.
  pure subroutine nearest_of_sides(w, corner, part, share, v)
    real(dp), intent(in) :: w(3, 4)
    integer, intent(in) :: corner(3)
    !> at most 0 for corners whose opposite side comes into question
    real(dp), intent(in) :: part(3)
    real(dp), intent(inout) :: share(4)
    real(dp), intent(out) :: v(3)
    real(dp) :: trial(4), u(3), nearest, squared
    integer :: k

    nearest = huge(1.0_dp)
    v(:) = 0.0_dp
    do k = 1, 3
      if (part(k) > 0.0_dp) cycle
      trial(:) = 0.0_dp
      call nearest_of_two(w, corner(mod(k, 3) + 1), corner(mod(k + 1, 3) + 1), trial, u)
      squared = dot_product(u, u)
      if (.not. squared < nearest) cycle
      nearest = squared
      share(:) = trial
      v(:) = u
    end do
  end subroutine nearest_of_sides

  !> Of a tetrahedron; all four shares are above 0 where the origin is inside.
  pure subroutine nearest_of_four(w, share, v)
    real(dp), intent(in) :: w(3, 4)
    real(dp), intent(out) :: share(4)
    real(dp), intent(out) :: v(3)
    integer, parameter :: other(3, 4) = reshape([2, 3, 4, 1, 3, 4, 1, 2, 4, 1, 2, 3], [3, 4])
    real(dp), parameter :: turned(4) = [1.0_dp, -1.0_dp, 1.0_dp, -1.0_dp]
    real(dp) :: volume(4), whole, trial(4), u(3), nearest, squared, doubt
    integer :: k

    do k = 1, 4
      volume(k) = turned(k)*volume_of(w(:, other(1, k)), w(:, other(2, k)), w(:, other(3, k)))
    end do
    whole = sum(volume)
    doubt = vanishing*maxval(abs(w))**3
    share(:) = 0.0_dp
    v(:) = 0.0_dp
    nearest = huge(1.0_dp)
    do k = 1, 4
      ! the volumes have one sign where the origin is inside
      if (sign(1.0_dp, whole)*volume(k) > doubt) cycle
      trial(:) = 0.0_dp
      call nearest_of_three(w, other(1, k), other(2, k), other(3, k), trial, u)
      squared = dot_product(u, u)
      if (.not. squared < nearest) cycle
      nearest = squared
      share(:) = trial
      v(:) = u
    end do
    if (nearest < huge(1.0_dp)) return
    share(:) = volume/whole
  end subroutine nearest_of_four

  !> Six times the volume of the tetrahedron of the origin and three points, with its sign.
  pure real(dp) function volume_of(a, b, c) result(volume)
    real(dp), intent(in) :: a(3), b(3), c(3)
    volume = a(1)*(b(2)*c(3) - b(3)*c(2)) + a(2)*(b(3)*c(1) - b(1)*c(3)) + a(3)*(b(1)*c(2) - b(2)*c(1))
  end function volume_of

end module gravier_nearest_simplex
