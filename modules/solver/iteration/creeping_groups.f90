!> Contacts that creep: where a solve gains nothing any more, the groups of contacts whose impulses still change.
!>
!> With friction, impulses that hold a group of bodies together are not unique from some tens of bodies on. Iterations then move
!> along the solutions, or around them, without an end. The contacts that take part nearly all stick, and join in groups. What is
!> found here says how large such groups are, and by how much the velocities of their bodies differ between two iterates: no
!> velocity of theirs is known more exactly.
module gravier_creeping_groups
  use gravier_kinds, only: dp, i8
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_body_mass, only: apply_inverse_mass
  use gravier_communicator, only: communicator_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  use gravier_kept_impulses, only: kept_impulses_t, copy_impulses, restore_impulses
  use gravier_disjoint_sets, only: first_of, join_sets
  implicit none
  private
  public :: creep_t, find_creep

  !> share of the square of all changes that the contacts which creep have
  real(dp), parameter :: most_of_change = 0.9_dp
  !> halvings of the interval in which the least change of these contacts lies
  integer, parameter :: halvings = 50
  !> a contact sticks where its tangential impulse is below this part of what friction allows
  real(dp), parameter :: sticking = 1.0_dp - 1.0e-6_dp

  !> Contacts that creep in a solve.
  type :: creep_t
    !> contacts, and those of them that stick
    integer(i8) :: contacts = 0, stuck = 0
    !> of the largest group, looked for in each subdomain by itself: contacts and grains
    integer(i8) :: group_contacts = 0, group_grains = 0
    !> root mean square over the grains of that group of what their velocities have changed by [m/s]
    real(dp) :: change = 0.0_dp
  end type creep_t

contains

  !> Find what has changed since earlier impulses. Impulses stay as they are. Collective.
  subroutine find_creep(problem, earlier, creep)
    type(contact_problem_t), intent(inout) :: problem
    !> of the subdomains of this rank
    type(kept_impulses_t), intent(in) :: earlier(:)
    type(creep_t), intent(out) :: creep
    type(kept_impulses_t) :: now(size(problem%sub))
    integer :: s

    if (problem%friction_row == 0) return
    call copy_impulses(problem, now)
    do s = 1, size(problem%sub)
      call problem%sub(s)%take_impulses_off(earlier(s)%value)
    end do
    call describe_changes(problem, now, creep)
    call restore_impulses(problem, now)
    call problem%evaluate()
  end subroutine find_creep

  !> What creeps where the impulses are changes. Collective.
  subroutine describe_changes(problem, now, creep)
    type(contact_problem_t), intent(inout) :: problem
    !> the impulses themselves
    type(kept_impulses_t), intent(in) :: now(:)
    type(creep_t), intent(inout) :: creep
    type(creep_t) :: group(size(problem%sub))
    integer(i8) :: counts(2)
    real(dp) :: least
    integer :: s

    call find_least_change(problem%sub, problem%comm, problem%nf, least)
    if (.not. least > 0.0_dp) return
    counts(:) = 0
    do s = 1, size(problem%sub)
      call count_creeping(problem%sub(s), problem%nf, problem%friction_row, now(s)%value, least, counts)
      call problem%own_reactions(s)
      call problem%shared%load(s, problem%sub(s)%reaction)
    end do
    call problem%comm%sum_counts(counts)
    creep%contacts = counts(1)
    creep%stuck = counts(2)
    call problem%shared%pass()
    do s = 1, size(problem%sub)
      call problem%shared%sum_copies(s, problem%sub(s)%reaction, mean=.false.)
      call find_largest_group(problem%sub(s), problem%nd, problem%nf, least, group(s))
    end do
    creep%group_contacts = problem%comm%largest(max(0_i8, maxval(group%group_contacts)))
    ! of groups that are as large, the most grains and the largest change
    creep%group_grains = problem%comm%largest(max(0_i8, maxval(group%group_grains, &
      & mask=group%group_contacts == creep%group_contacts)))
    creep%change = problem%comm%highest(max(0.0_dp, maxval(group%change, mask=group%group_contacts == creep%group_contacts)))
  end subroutine describe_changes

  !> The change from which on contacts have most_of_change of the square of all changes; 0 where nothing changes. Collective.
  subroutine find_least_change(sub, comm, nf, least)
    !> whose impulses are changes
    type(subproblem_t), intent(in) :: sub(:)
    type(communicator_t), intent(in) :: comm
    !> components of an impulse that are a force's
    integer, intent(in) :: nf
    real(dp), intent(out) :: least
    real(dp) :: high, middle, all_squares
    integer :: s, c, k

    high = 0.0_dp
    do s = 1, size(sub)
      do c = 1, sub(s)%n_contacts
        high = max(high, force(sub(s)%impulse, nf, c))
      end do
    end do
    high = comm%highest(high)
    least = 0.0_dp
    if (.not. high > 0.0_dp) return
    all_squares = squares_from(sub, comm, nf, 0.0_dp)
    do k = 1, halvings
      middle = 0.5_dp*(least + high)
      if (squares_from(sub, comm, nf, middle) >= most_of_change*all_squares) then
        least = middle
      else
        high = middle
      end if
    end do
  end subroutine find_least_change

  !> Sum of the squares of the changes that are not below `least`. Collective.
  real(dp) function squares_from(sub, comm, nf, least) result(total)
    type(subproblem_t), intent(in) :: sub(:)
    type(communicator_t), intent(in) :: comm
    integer, intent(in) :: nf
    real(dp), intent(in) :: least
    real(dp) :: parts(1, size(sub)), sums(1), change
    integer :: s, c

    parts(:, :) = 0.0_dp
    do s = 1, size(sub)
      do c = 1, sub(s)%n_contacts
        change = force(sub(s)%impulse, nf, c)
        if (change >= least) parts(1, s) = parts(1, s) + change**2
      end do
    end do
    call comm%sum_parts(parts, sums)
    total = sums(1)
  end function squares_from

  !> Size of the impulse of a contact, without its moments [N s].
  pure real(dp) function force(impulse, nf, c)
    !> (lanes, nc, blocks)
    real(dp), intent(in), contiguous :: impulse(:, :, :)
    integer, intent(in) :: nf, c
    integer :: d

    force = 0.0_dp
    do d = 1, nf
      force = force + impulse(lane_of(c), d, block_of(c))**2
    end do
    force = sqrt(force)
  end function force

  !> Add the contacts of a subdomain that creep, and those of them that stick.
  pure subroutine count_creeping(sub, nf, friction_row, now, least, counts)
    !> whose impulses are changes
    type(subproblem_t), intent(in) :: sub
    !> of the layout of the packed arrays
    integer, intent(in) :: nf, friction_row
    !> the impulses themselves
    real(dp), intent(in), contiguous :: now(:, :, :)
    real(dp), intent(in) :: least
    integer(i8), intent(inout) :: counts(2)
    real(dp) :: tangential, allowed
    integer :: c, d

    do c = 1, sub%n_contacts
      if (force(sub%impulse, nf, c) < least) cycle
      counts(1) = counts(1) + 1
      allowed = sub%hot(lane_of(c), friction_row, block_of(c))*now(lane_of(c), 1, block_of(c))
      tangential = 0.0_dp
      do d = 2, nf
        tangential = tangential + now(lane_of(c), d, block_of(c))**2
      end do
      if (sqrt(tangential) < sticking*allowed) counts(2) = counts(2) + 1
    end do
  end subroutine count_creeping

  !> The grains that contacts which creep join, in groups: the one with most contacts. Impulses and reactions are those of the
  !> changes.
  pure subroutine find_largest_group(sub, nd, nf, least, group)
    type(subproblem_t), intent(in) :: sub
    !> of the layout of the packed arrays
    integer, intent(in) :: nd, nf
    real(dp), intent(in) :: least
    type(creep_t), intent(out) :: group
    !> a grain of the same group, itself for the first one; contacts and grains of the groups, by their first grains
    integer :: first(sub%n_grains), contacts(sub%n_grains), grains(sub%n_grains)
    real(dp) :: squares(sub%n_grains), v(size(sub%reaction, 1))
    integer :: b, c, i, j

    do b = 1, sub%n_grains
      first(b) = b
    end do
    do c = 1, sub%n_contacts
      if (force(sub%impulse, nf, c) < least) cycle
      i = group_of(sub%pair(1, c))
      j = group_of(sub%pair(2, c))
      if (min(i, j) > 0) call join_sets(i, j, first)
    end do
    do b = 1, sub%n_grains
      first(b) = group_of(b)
    end do
    contacts(:) = 0
    grains(:) = 0
    squares(:) = 0.0_dp
    do c = 1, sub%n_contacts
      if (force(sub%impulse, nf, c) < least) cycle
      i = max(group_of(sub%pair(1, c)), group_of(sub%pair(2, c)))
      if (i > 0) contacts(i) = contacts(i) + 1
    end do
    do b = 1, sub%n_grains
      call apply_inverse_mass(sub%inverse_mass(:, b), sub%reaction(:, b), v)
      grains(first(b)) = grains(first(b)) + 1
      squares(first(b)) = squares(first(b)) + sum(v(1:nd)**2)
    end do
    if (sub%n_grains == 0) return
    b = maxloc(contacts, 1)
    if (contacts(b) == 0) return
    group%group_contacts = contacts(b)
    group%group_grains = grains(b)
    group%change = sqrt(squares(b)/grains(b))

  contains

    !> The first grain of the group of a column, 0 for what is no grain.
    pure integer function group_of(column) result(b)
      integer, intent(in) :: column

      b = 0
      if (column > sub%n_grains) return
      b = first_of(column, first)
    end function group_of

  end subroutine find_largest_group

end module gravier_creeping_groups
