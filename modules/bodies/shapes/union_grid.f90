!> Mass, centre and inertia of a union of convex pieces that may overlap.
!>
!> The union is cut by parallel lines through the middles of a grid of squares; along each line the integrals are exact. The error
!> is that of the rule of the middle across the lines: it was measured on spheres, alone and in overlapping pairs, as less than
!> 0.5 n^(-3/2) of the volume and of the moments of inertia, with n lines along the longer side.
module gravier_union_grid
  use gravier_kinds, only: dp
  use gravier_convex_piece, only: convex_piece_t
  use gravier_mass_properties, only: mass_t, inertia_of_moments
  implicit none
  private
  public :: mass_on_grid

contains

  !> Those of the union, of density 1.
  pure function mass_on_grid(pieces, n) result(mass)
    !> in common axes
    type(convex_piece_t), intent(in) :: pieces(:)
    !> lines along the longer side
    integer, intent(in) :: n
    type(mass_t) :: mass
    real(dp) :: low(3), high(3), step, place(3), first(3), second(3, 3), cut(2, size(pieces))
    integer :: i, j, k, n_cuts, longer

    call find_extent(pieces, low, high)
    longer = 2
    if (high(3) - low(3) > high(2) - low(2)) longer = 3
    step = (high(longer) - low(longer))/n
    first(:) = 0.0_dp
    second(:, :) = 0.0_dp
    place(:) = 0.0_dp
    if (.not. step > 0.0_dp) return
    do j = 1, ceiling((high(3) - low(3))/step - 1.0e-6_dp)
      do i = 1, ceiling((high(2) - low(2))/step - 1.0e-6_dp)
        place(2) = low(2) + (i - 0.5_dp)*step
        place(3) = low(3) + (j - 0.5_dp)*step
        n_cuts = 0
        do k = 1, size(pieces)
          call add_cut(pieces(k), place, cut, n_cuts)
        end do
        call join_cuts(cut, n_cuts)
        do k = 1, n_cuts
          call add_moments(cut(:, k), place(2:3), mass%volume, first, second)
        end do
      end do
    end do
    mass%volume = mass%volume*step**2
    if (.not. mass%volume > 0.0_dp) return
    mass%centre(:) = first*step**2/mass%volume
    second(:, :) = second*step**2
    call inertia_of_moments(second, mass%volume, mass%centre, mass%inertia)
  end function mass_on_grid

  !> The box that holds the pieces.
  pure subroutine find_extent(pieces, low, high)
    type(convex_piece_t), intent(in) :: pieces(:)
    real(dp), intent(out) :: low(3), high(3)
    integer :: k, v

    low(:) = huge(1.0_dp)
    high(:) = -huge(1.0_dp)
    do k = 1, size(pieces)
      do v = 1, size(pieces(k)%vertex, 2)
        low(:) = min(low, pieces(k)%vertex(:, v) - pieces(k)%rounding, pieces(k)%corner(:, v))
        high(:) = max(high, pieces(k)%vertex(:, v) + pieces(k)%rounding, pieces(k)%corner(:, v))
      end do
    end do
  end subroutine find_extent

  !> The moments of a stretch of a line along the first axis.
  pure subroutine add_moments(stretch, place, length, first, second)
    !> its ends, and its other two coordinates
    real(dp), intent(in) :: stretch(2), place(2)
    real(dp), intent(inout) :: length, first(3), second(3, 3)
    real(dp) :: moment(0:2)
    integer :: k

    do k = 0, 2
      moment(k) = (stretch(2)**(k + 1) - stretch(1)**(k + 1))/(k + 1)
    end do
    length = length + moment(0)
    first(1) = first(1) + moment(1)
    first(2:3) = first(2:3) + moment(0)*place
    second(1, 1) = second(1, 1) + moment(2)
    second(1, 2:3) = second(1, 2:3) + moment(1)*place
    second(2:3, 1) = second(1, 2:3)
    do k = 1, 2
      second(2:3, k + 1) = second(2:3, k + 1) + moment(0)*place(k)*place
    end do
  end subroutine add_moments

  !> Where a line along the first axis is in a piece, added to a list in ascending order.
  pure subroutine add_cut(piece, place, cut, n)
    type(convex_piece_t), intent(in) :: piece
    real(dp), intent(in) :: place(3)
    real(dp), intent(inout) :: cut(:, :)
    integer, intent(inout) :: n
    real(dp) :: found(2)
    integer :: k

    if (size(piece%face_normal, 2) > 0) then
      found(:) = cut_of_polyhedron(piece, place)
    else
      found(:) = cut_of_capsule(piece, place)
    end if
    if (.not. found(2) > found(1)) return
    k = n
    do while (k > 0)
      if (cut(1, k) <= found(1)) exit
      cut(:, k + 1) = cut(:, k)
      k = k - 1
    end do
    cut(:, k + 1) = found
    n = n + 1
  end subroutine add_cut

  !> Make one of stretches that overlap.
  pure subroutine join_cuts(cut, n)
    real(dp), intent(inout) :: cut(:, :)
    integer, intent(inout) :: n
    integer :: k, m

    m = min(n, 1)
    do k = 2, n
      if (cut(1, k) <= cut(2, m)) then
        cut(2, m) = max(cut(2, m), cut(2, k))
      else
        m = m + 1
        cut(:, m) = cut(:, k)
      end if
    end do
    n = m
  end subroutine join_cuts

  !> The stretch between all faces, at their places without rounding.
  pure function cut_of_polyhedron(piece, place) result(cut)
    type(convex_piece_t), intent(in) :: piece
    real(dp), intent(in) :: place(3)
    real(dp) :: cut(2), room
    integer :: f

    cut(:) = [-huge(1.0_dp), huge(1.0_dp)]
    do f = 1, size(piece%face_normal, 2)
      associate (normal => piece%face_normal(:, f))
        room = dot_product(normal, piece%vertex(:, piece%face_vertex(piece%face_first(f))) - place) + piece%rounding
        if (normal(1) > epsilon(1.0_dp)) then
          cut(2) = min(cut(2), room/normal(1))
        else if (normal(1) < -epsilon(1.0_dp)) then
          cut(1) = max(cut(1), room/normal(1))
        else if (room < 0.0_dp) then
          cut(:) = 0.0_dp
          return
        end if
      end associate
    end do
  end function cut_of_polyhedron

  !> The stretch within a distance of a segment: from the first to the last of its points in the balls at the ends and in the rod.
  pure function cut_of_capsule(piece, place) result(cut)
    type(convex_piece_t), intent(in) :: piece
    real(dp), intent(in) :: place(3)
    real(dp) :: cut(2), from(3), axis(3), a, b, c, root, x, along, length
    integer :: v, k

    cut(:) = [huge(1.0_dp), -huge(1.0_dp)]
    do v = 1, size(piece%vertex, 2)
      from(:) = place - piece%vertex(:, v)
      c = piece%rounding**2 - from(2)**2 - from(3)**2
      if (c <= 0.0_dp) cycle
      cut(1) = min(cut(1), piece%vertex(1, v) - sqrt(c))
      cut(2) = max(cut(2), piece%vertex(1, v) + sqrt(c))
    end do
    if (size(piece%vertex, 2) < 2) return
    ! the endless cylinder: a x^2 + 2 b x + c = 0
    axis(:) = piece%vertex(:, 2) - piece%vertex(:, 1)
    length = norm2(axis)
    axis(:) = axis/length
    from(:) = place - piece%vertex(:, 1)
    along = dot_product(axis, from)
    a = 1.0_dp - axis(1)**2
    b = from(1) - along*axis(1)
    c = dot_product(from, from) - along**2 - piece%rounding**2
    root = b*b - a*c
    if (a <= epsilon(1.0_dp) .or. root <= 0.0_dp) return
    do k = -1, 1, 2
      x = (-b + k*sqrt(root))/a
      if (along + x*axis(1) < 0.0_dp .or. along + x*axis(1) > length) cycle
      cut(1) = min(cut(1), x)
      cut(2) = max(cut(2), x)
    end do
  end function cut_of_capsule

end module gravier_union_grid
