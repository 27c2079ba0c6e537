!> Bodies that bonds hold redundantly, and the spin with which they turn as one. Around a ring of bonds the velocities of the bonds
!> have to agree exactly: what contradicts itself makes impulses without bound. The bonds of a group therefore have one spin, which
!> is the one that fits the velocities of their bodies beside each other best. Bodies of a chain are in no group: nothing
!> contradicts there.
module gravier_bonded_groups
  use gravier_kinds, only: dp
  use gravier_rotation, only: cross
  use gravier_disjoint_sets, only: first_of
  use gravier_boundary, only: boundary_t
  use gravier_halo, only: local_bodies_t
  use gravier_physics, only: physics_t
  use gravier_bond_turning, only: find_spin, find_branch
  use gravier_narrow_phase, only: contact_list_t, place_of
  implicit none
  private
  public :: bonded_groups_t, find_bonded_groups

  !> bonds that a body needs so that rings of bonds through it can contradict themselves
  integer, parameter :: most_of_chain = 2
  !> determinant of directions, over the cube of their sum of squares, below which they lie on one line
  real(dp), parameter :: on_line = 1.0e-12_dp

  type :: bonded_groups_t
    !> group of each body of a view, 0 for none
    integer, allocatable :: group(:)
    !> (3, groups) [rad/s]
    real(dp), allocatable :: spin(:, :)
    !> bonds of each group with boundaries (groups)
    integer, allocatable :: held(:)
  contains
    procedure :: find_spin => bonded_groups_find_spin
  end type bonded_groups_t

contains

  !> The groups of a view.
  subroutine find_bonded_groups(view, boundaries, physics, found, groups)
    type(local_bodies_t), intent(in) :: view
    type(boundary_t), intent(in) :: boundaries(:)
    type(physics_t), intent(in) :: physics
    type(contact_list_t), intent(in) :: found
    type(bonded_groups_t), intent(out) :: groups
    integer, allocatable :: bonds(:), root(:)
    integer :: f, i, j, n

    allocate (bonds(view%n_bodies()), root(view%n_bodies()), groups%group(view%n_bodies()), source=0)
    do f = 1, found%n
      if (.not. is_first_bond(view, found, f)) cycle
      call find_ends(view, found, f, i, j)
      bonds(i) = bonds(i) + 1
      if (j > 0) bonds(j) = bonds(j) + 1
    end do
    do f = 1, found%n
      if (.not. is_first_bond(view, found, f)) cycle
      call find_ends(view, found, f, i, j)
      if (found%boundary(f) > 0 .or. j <= 0) cycle
      if (max(bonds(i), bonds(j)) > most_of_chain) call join(i, j, root)
    end do
    n = 0
    do i = 1, size(root)
      if (root(i) == 0) cycle
      if (first_of(i, root) == i) then
        n = n + 1
        groups%group(i) = n
      end if
    end do
    do i = 1, size(root)
      if (root(i) > 0) groups%group(i) = groups%group(first_of(i, root))
    end do
    allocate (groups%spin(3, n), source=0.0_dp)
    allocate (groups%held(n), source=0)
    if (n > 0) call find_spins(view, boundaries, physics, found, groups)
  end subroutine find_bonded_groups

  !> The one spin of both bodies of contact `f`. It is that of their group, with which a boundary turns that holds it by two bonds
  !> or more. Bodies with several contacts between them have the mean of theirs, if a contact beside `f` is a bond. It is not known
  !> of a single bond, as in a chain, and of other contacts between bodies that no bonds make one.
  pure subroutine bonded_groups_find_spin(self, view, boundaries, found, f, known, spin)
    class(bonded_groups_t), intent(in) :: self
    type(local_bodies_t), intent(in) :: view
    type(boundary_t), intent(in) :: boundaries(:)
    type(contact_list_t), intent(in) :: found
    integer, intent(in) :: f
    logical, intent(out) :: known
    real(dp), intent(out) :: spin(3)
    real(dp) :: other(3)
    integer :: i, j, g

    call find_ends(view, found, f, i, j)
    g = self%group(i)
    if (g == 0 .and. j > 0) g = self%group(max(j, 1))
    known = .false.
    spin(:) = 0.0_dp
    if (found%boundary(f) > 0) then
      if (g > 0 .and. found%terms(f)%joins) known = self%held(g) >= 2
      if (known .or. has_bond_beside(view, found, f)) then
        known = .true.
        spin(:) = boundaries(found%boundary(f))%last_spin
      end if
    else if (g > 0 .and. self%group(i) == self%group(max(j, 1))) then
      known = .true.
      spin(:) = self%spin(:, g)
    else if (has_bond_beside(view, found, f)) then
      known = .true.
      call find_spin(view, boundaries, i, spin)
      call find_spin(view, boundaries, j, other)
      spin(:) = 0.5_dp*(spin + other)
    end if
  end subroutine bonded_groups_find_spin

  !> Whether the pair of contact `f` has a bond beside it. The contacts of a pair follow each other.
  pure logical function has_bond_beside(view, found, f) result(has)
    type(local_bodies_t), intent(in) :: view
    type(contact_list_t), intent(in) :: found
    integer, intent(in) :: f
    integer :: other, way

    has = .false.
    do way = -1, 1, 2
      other = f + way
      do while (other >= 1 .and. other <= found%n)
        if (.not. is_same_pair(view, found, other, f)) exit
        has = has .or. found%terms(other)%joins
        other = other + way
      end do
    end do
  end function has_bond_beside

  !> Fit the spins of all groups. A group that has two bonds or more with boundaries turns as the first of these does.
  subroutine find_spins(view, boundaries, physics, found, groups)
    type(local_bodies_t), intent(in) :: view
    type(boundary_t), intent(in) :: boundaries(:)
    type(physics_t), intent(in) :: physics
    type(contact_list_t), intent(in) :: found
    type(bonded_groups_t), intent(inout) :: groups
    real(dp) :: matrix(3, 3, size(groups%spin, 2)), right(3, size(groups%spin, 2)), branch(3), v(3), turning(3)
    integer :: holder(size(groups%spin, 2)), f, i, j, g, d

    matrix(:, :, :) = 0.0_dp
    right(:, :) = 0.0_dp
    holder(:) = huge(1)
    do f = 1, found%n
      if (.not. is_first_bond(view, found, f)) cycle
      call find_ends(view, found, f, i, j)
      if (found%boundary(f) > 0) then
        g = groups%group(i)
        if (g == 0 .and. j > 0) g = groups%group(max(j, 1))
        if (g == 0) cycle
        groups%held(g) = groups%held(g) + 1
        holder(g) = min(holder(g), found%boundary(f))
        cycle
      end if
      g = groups%group(i)
      if (g == 0 .or. g /= groups%group(j)) cycle
      call find_branch(view, physics, found%source(f), place_of(view, found, f, joined=.true.), branch, v)
      turning(:) = cross(branch, v)
      right(:, g) = right(:, g) + turning
      do d = 1, 3
        matrix(d, d, g) = matrix(d, d, g) + sum(branch**2)
        matrix(:, d, g) = matrix(:, d, g) - branch(d)*branch
      end do
    end do
    do g = 1, size(groups%held)
      if (groups%held(g) >= 2) then
        groups%spin(:, g) = boundaries(holder(g))%last_spin
      else if (view%bodies%nd == 2) then
        groups%spin(3, g) = right(3, g)/matrix(3, 3, g)
      else
        call solve(matrix(:, :, g), right(:, g), groups%spin(:, g))
      end if
    end do
  end subroutine find_spins

  !> x of matrix x = right by Cramer's rule; 0 where all branches lie on one line.
  pure subroutine solve(matrix, right, x)
    real(dp), intent(in) :: matrix(3, 3), right(3)
    real(dp), intent(out) :: x(3)
    real(dp) :: one(3), two(3), three(3), determinant

    one(:) = cross(matrix(:, 2), matrix(:, 3))
    two(:) = cross(matrix(:, 3), matrix(:, 1))
    three(:) = cross(matrix(:, 1), matrix(:, 2))
    determinant = sum(matrix(:, 1)*one)
    x(:) = 0.0_dp
    if (.not. determinant > on_line*(matrix(1, 1) + matrix(2, 2) + matrix(3, 3))**3) return
    x(1) = sum(one*right)/determinant
    x(2) = sum(two*right)/determinant
    x(3) = sum(three*right)/determinant
  end subroutine solve

  !> Bodies of contact `f`; the antagonist is 0 where it is a boundary.
  pure subroutine find_ends(view, found, f, i, j)
    type(local_bodies_t), intent(in) :: view
    type(contact_list_t), intent(in) :: found
    integer, intent(in) :: f
    integer, intent(out) :: i, j

    call view%find_ends(found%source(f), i, j)
    j = max(j, 0)
  end subroutine find_ends

  !> Whether contact `f` is a bond, and the first of its pair.
  pure logical function is_first_bond(view, found, f) result(first)
    type(local_bodies_t), intent(in) :: view
    type(contact_list_t), intent(in) :: found
    integer, intent(in) :: f
    integer :: other

    first = found%terms(f)%joins
    other = f - 1
    do while (first .and. other >= 1)
      if (.not. is_same_pair(view, found, other, f)) exit
      first = .not. found%terms(other)%joins
      other = other - 1
    end do
  end function is_first_bond

  !> Whether two contacts are of the same pair.
  pure logical function is_same_pair(view, found, other, f) result(same)
    type(local_bodies_t), intent(in) :: view
    type(contact_list_t), intent(in) :: found
    integer, intent(in) :: other, f

    same = view%list%same_bodies(found%source(f), found%source(other))
  end function is_same_pair

  !> Put two bodies into one group: a root is the lowest of its bodies.
  pure subroutine join(i, j, root)
    integer, intent(in) :: i, j
    integer, intent(inout) :: root(:)
    integer :: a, b

    if (root(i) == 0) root(i) = i
    if (root(j) == 0) root(j) = j
    a = first_of(i, root)
    b = first_of(j, root)
    root(max(a, b)) = min(a, b)
    root(i) = min(a, b)
    root(j) = min(a, b)
  end subroutine join

end module gravier_bonded_groups
