!> What bodies that sleep bear of the contacts that are left out of the problem: the sum of their impulses, `held`, with its owner.
!>
!> A contact is left out when the last of its bodies falls asleep, and comes back when the first of them wakes. None of its bodies
!> has moved then, so that `held` takes its impulse up when it leaves, and gives the same one back when it returns: the impulse from
!> which the next solve starts. The pair has a mark in the meantime.
module gravier_borne_impulses
  use gravier_kinds, only: dp, i8
  use gravier_sparse_exchange, only: sparse_exchange
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  use gravier_neighbour_list, only: neighbour_list_t
  use gravier_decomposition, only: decomposition_t
  use gravier_halo, only: local_bodies_t
  implicit none
  private
  public :: contacts_t, impulses_t, find_seen, find_borne, leave_out, take_back

  !> Some of the contacts of a subdomain.
  type :: contacts_t
    !> (n_contacts)
    logical, allocatable :: are(:)
  end type contacts_t

  !> Impulses on the bodies of a set, with their moments (nv, n) [N s, N m s].
  type :: impulses_t
    real(dp), allocatable :: on(:, :)
  end type impulses_t

contains

  !> Places in the view of the grains behind the columns of a subdomain, 0 for a boundary.
  pure subroutine find_seen(list, sub, seen)
    type(neighbour_list_t), intent(in) :: list
    type(subproblem_t), intent(in) :: sub
    !> (n_columns)
    integer, allocatable, intent(out) :: seen(:)
    integer :: c, k, b

    allocate (seen(sub%n_columns), source=0)
    do c = 1, sub%n_contacts
      do k = 1, 2
        b = sub%pair(k, c)
        if (b > sub%n_grains) then
          if (sub%boundary(b) > 0) cycle
        end if
        seen(b) = merge(list%candidate(sub%source(c)), list%antagonist(sub%source(c)), k == 1)
      end do
    end do
  end subroutine find_seen

  !> Sums over some contacts of their impulses on the grains that sleep in the problem, or on all grains. Collective.
  subroutine find_borne(decomposition, views, problem, some, all_grains, borne)
    type(decomposition_t), intent(in) :: decomposition
    type(local_bodies_t), intent(in) :: views(:)
    type(contact_problem_t), intent(in) :: problem
    !> contacts that count, of each subdomain of this rank
    type(contacts_t), intent(in) :: some(:)
    logical, intent(in) :: all_grains
    !> of the owned grains of each subdomain of this rank, with the degrees of freedom of the problem
    type(impulses_t), intent(out) :: borne(:)
    type(impulses_t) :: part(size(problem%sub))
    integer(i8), allocatable :: records(:, :), received(:, :)
    integer, allocatable :: destination(:), seen(:)
    integer :: s, b, d, h, k, n, round, place

    do round = 1, 2
      n = 0
      do s = 1, size(problem%sub)
        if (.not. any(some(s)%are)) cycle
        associate (sub => problem%sub(s), view => views(s))
          if (round == 1) call sum_impulses(problem, s, some(s)%are, part(s)%on)
          call find_seen(view%list, sub, seen)
          do b = merge(1, sub%n_grains + 1, all_grains), sub%n_columns
            if (seen(b) == 0 .or. .not. any(abs(part(s)%on(:, b)) > 0.0_dp)) cycle
            n = n + 1
            if (round == 1) cycle
            destination(n) = decomposition%comm%rank_of(view%owner(seen(b)), decomposition%n_subdomains)
            records(1, n) = view%owner(seen(b))
            records(2, n) = view%bodies%id(seen(b))
            do d = 1, problem%nv
              records(2 + d, n) = transfer(part(s)%on(d, b), 0_i8)
            end do
          end do
        end associate
      end do
      if (round == 1) allocate (records(2 + problem%nv, n), destination(n))
    end do
    call sparse_exchange(decomposition%comm, records, destination, received)
    do s = 1, size(borne)
      allocate (borne(s)%on(problem%nv, decomposition%owned(s)%n), source=0.0_dp)
    end do
    do k = 1, size(received, 2)
      call decomposition%find_owned(received(1:2, k), h, place)
      do d = 1, problem%nv
        borne(h)%on(d, place) = borne(h)%on(d, place) + transfer(received(2 + d, k), 0.0_dp)
      end do
    end do
  end subroutine find_borne

  !> H r of some contacts of subdomain `s` of this rank.
  pure subroutine sum_impulses(problem, s, some, reaction)
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: s
    logical, intent(in), contiguous :: some(:)
    !> (nv, n_columns)
    real(dp), allocatable, intent(out) :: reaction(:, :)
    real(dp), allocatable :: impulse(:, :, :)
    integer :: c

    associate (sub => problem%sub(s))
      allocate (impulse, mold=sub%impulse)
      impulse(:, :, :) = 0.0_dp
      do c = 1, sub%n_contacts
        if (.not. some(c)) cycle
        impulse(lane_of(c), :, block_of(c)) = sub%impulse(lane_of(c), :, block_of(c))
        impulse(lane_of(c), 1, block_of(c)) = sub%normal_impulse(c)
      end do
      allocate (reaction(problem%nv, sub%n_columns), source=0.0_dp)
      call sub%add_reaction(problem%kernels, impulse, reaction)
    end associate
  end subroutine sum_impulses

  !> Leave contacts of a solved problem out of the next ones: what sleeps bears their impulses from now on. Collective.
  subroutine leave_out(problem, leaving, views, decomposition)
    type(contact_problem_t), intent(in) :: problem
    !> contacts all of whose grains sleep now, of each subdomain of this rank
    type(contacts_t), intent(in) :: leaving(:)
    type(local_bodies_t), intent(inout) :: views(:)
    type(decomposition_t), intent(inout) :: decomposition
    call change_held(problem, leaving, 1, views, decomposition)
  end subroutine leave_out

  !> Give back what was borne of the contacts that are in a problem again, in which the impulses kept have just been recalled.
  !> Collective.
  subroutine take_back(problem, views, decomposition)
    type(contact_problem_t), intent(in) :: problem
    type(local_bodies_t), intent(inout) :: views(:)
    type(decomposition_t), intent(inout) :: decomposition
    type(contacts_t) :: returning(size(problem%sub))
    integer :: s, c

    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s), list => views(s)%list)
        allocate (returning(s)%are(sub%n_contacts))
        do c = 1, sub%n_contacts
          returning(s)%are(c) = list%state(list%memory%touch_row, sub%source(c)) == 1
        end do
      end associate
    end do
    call change_held(problem, returning, 0, views, decomposition)
  end subroutine take_back

  !> Mark contacts as left out (1) or as solved (0), and add their impulses to what sleeping bodies bear, or take them away.
  !> Collective.
  subroutine change_held(problem, some, mark, views, decomposition)
    type(contact_problem_t), intent(in) :: problem
    type(contacts_t), intent(in) :: some(:)
    integer, intent(in) :: mark
    type(local_bodies_t), intent(inout) :: views(:)
    type(decomposition_t), intent(inout) :: decomposition
    type(impulses_t) :: borne(size(decomposition%owned))
    integer :: s, c, k
    logical :: changes

    changes = .false.
    do s = 1, size(some)
      changes = changes .or. any(some(s)%are)
    end do
    if (.not. decomposition%comm%any_true(changes)) return
    call find_borne(decomposition, views, problem, some, mark == 1, borne)
    do s = 1, size(some)
      associate (list => views(s)%list)
        do c = 1, size(some(s)%are)
          if (some(s)%are(c)) list%state(list%memory%touch_row, problem%sub(s)%source(c)) = mark
        end do
      end associate
    end do
    do s = 1, size(borne)
      associate (owned => decomposition%owned(s))
        do k = 1, owned%n
          if (.not. owned%sleeps(k) .or. .not. any(abs(borne(s)%on(:, k)) > 0.0_dp)) cycle
          owned%held(1:problem%nv, k) = owned%held(1:problem%nv, k) + (2*mark - 1)*borne(s)%on(:, k)
          owned%steady(k) = .false.
        end do
      end associate
    end do
  end subroutine change_held

end module gravier_borne_impulses
