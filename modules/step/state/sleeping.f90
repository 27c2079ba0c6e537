!> Contacts that leave the sweeps while their bodies are at rest, and return when these are disturbed.
!>
!> A body is at rest where the momentum left to it, and the change of the impulses on it, are small: m (|v| + R |w|) <= limit and
!> sum |r_n - r_n of the step before| <= settled limit, limit being the lesser of `speed` times the root mean square of all
!> impulses, which the residual is relative to, and of a `share` of the normal impulses on the body, so that no grain hangs in
!> the air whatever lies next to it; where some law attracts, the momentum is at most that share of the sum H r of the contacts'
!> impulses on it too, which is all that holds a body up: those that cling to each other press each other with more. Each contact
!> counts the steps for which both of its bodies have been at rest; a contact that
!> comes, goes or changes lets them start anew, and so does a boundary that moves. A grain all of whose contacts have counted
!> half of `after` stands still: what the impulses of solves do not balance would else add up, step by step, and sweeps now find
!> impulses that hold a grain without motion. A contact that has counted them all sleeps: no sweep takes it, its impulse stays,
!> and its reaction is part of the velocities from the start of a solve. A solve that misses its tolerance for contacts that
!> sleep wakes them; what moves then moves by the laws of all contacts, and nothing is stopped.
module gravier_sleeping
  use gravier_kinds, only: dp
  use gravier_contact_kernels, only: lanes, n_blocks, lane_of, block_of
  use gravier_body_mass, only: inverse_of_translation
  use gravier_contact_problem, only: contact_problem_t, subproblem_t
  use gravier_boundary, only: boundary_t
  use gravier_neighbour_list, only: neighbour_list_t
  use gravier_halo, only: local_bodies_t, halo_t
  use gravier_narrow_phase, only: contact_list_t
  implicit none
  private
  public :: sleeping_rule_t, count_rest, put_sleepers_last, wake_all

  !> change of the impulses on a body at rest over what momentum it may have; either over the impulses on it at most
  real(dp), parameter :: settled = 10.0_dp, share = 0.1_dp

  !> Sums over the contacts of each body of a subdomain (nv, n_columns).
  type :: sums_t
    real(dp), allocatable :: of(:, :)
  end type sums_t

  type :: sleeping_rule_t
    !> steps at rest after which a contact sleeps; 0: none does
    integer :: after = 0
    !> momentum of a body at rest over the root mean square of the impulses
    real(dp) :: speed = 0.0_dp
  end type sleeping_rule_t

contains

  !> Count the steps at rest of the contacts of a solved problem, before its impulses are kept. Collective.
  subroutine count_rest(rule, boundaries, woken, halo, problem)
    type(sleeping_rule_t), intent(in) :: rule
    type(boundary_t), intent(in) :: boundaries(:)
    !> contacts that slept were woken: nothing is stopped. Else grains at rest stand still: their v_global becomes zero
    logical, intent(in) :: woken
    type(halo_t), intent(inout) :: halo
    !> v_global is evaluated, and `reaction` what it is evaluated with
    type(contact_problem_t), intent(inout) :: problem
    type(sums_t) :: sums(size(problem%sub))
    integer :: s, b

    do s = 1, size(problem%sub)
      call sum_impulses(boundaries, halo%view(s)%list, problem%sub(s), problem%kernels%nv, sums(s))
    end do
    call sum_over_copies(problem, sums)
    do s = 1, size(problem%sub)
      call count_steps(rule%after, rule%speed*problem%impulse_scale, boundaries, halo%view(s)%list, problem%sub(s), &
        & problem%kernels%nd, sums(s))
    end do
    if (woken) return
    call sum_over_copies(problem, sums)
    do s = 1, size(problem%sub)
      do b = 1, problem%sub(s)%n_grains
        if (.not. sums(s)%of(1, b) > 0.0_dp) problem%sub(s)%v_global(:, b) = 0.0_dp
      end do
    end do
  end subroutine count_rest

  !> Put the contacts that have been at rest for `after` steps behind the others; so many of them stay before that these fill
  !> whole blocks. A contact with a boundary that moves as prescribed does not sleep.
  subroutine put_sleepers_last(view, boundaries, after, found)
    type(local_bodies_t), intent(in) :: view
    type(boundary_t), intent(in) :: boundaries(:)
    integer, intent(in) :: after
    type(contact_list_t), intent(inout) :: found
    type(contact_list_t) :: old
    logical, allocatable :: asleep(:)
    integer :: c, b, n, round

    allocate (asleep(found%n))
    do c = 1, found%n
      asleep(c) = view%list%state(view%list%memory%rest_row, found%source(c)) >= after
      b = found%boundary(c)
      if (b > 0) asleep(c) = asleep(c) .and. .not. boundaries(b)%is_moved()
    end do
    found%n_awake = min(found%n, lanes*n_blocks(count(.not. asleep)))
    n = found%n_awake - count(.not. asleep)
    do c = 1, found%n
      if (n == 0) exit
      if (.not. asleep(c)) cycle
      asleep(c) = .false.
      n = n - 1
    end do
    if (found%n_awake == found%n) return
    old = found
    n = 0
    do round = 1, 2
      do c = 1, found%n
        if (asleep(c) .neqv. round == 2) cycle
        n = n + 1
        found%source(n) = old%source(c)
        found%boundary(n) = old%boundary(c)
        found%gap(n) = old%gap(c)
        found%normal(:, n) = old%normal(:, c)
        if (size(old%terms) > 0) found%terms(n) = old%terms(c)
        if (size(old%spring) > 0) found%spring(n) = old%spring(c)
        if (size(old%place) > 0) found%place(n) = old%place(c)
      end do
    end do
  end subroutine put_sleepers_last

  !> No contact is at rest any more.
  pure subroutine wake_all(halo)
    type(halo_t), intent(inout) :: halo
    integer :: s

    if (.not. allocated(halo%view)) return
    do s = 1, size(halo%view)
      associate (list => halo%view(s)%list)
        list%state(list%memory%rest_row, :) = 0
      end associate
    end do
  end subroutine wake_all

  !> Sum over the copies of each body. Collective.
  subroutine sum_over_copies(problem, sums)
    type(contact_problem_t), intent(inout) :: problem
    type(sums_t), intent(inout) :: sums(:)
    integer :: s

    do s = 1, size(problem%sub)
      call problem%shared%load(s, sums(s)%of)
    end do
    call problem%shared%pass()
    do s = 1, size(problem%sub)
      call problem%shared%sum_copies(s, sums(s)%of, mean=.false.)
    end do
  end subroutine sum_over_copies

  !> Into the first two rows: normal impulses on each body, and by how much they have changed since the step before. Under a
  !> boundary that moves they count as changed.
  subroutine sum_impulses(boundaries, list, sub, nv, sums)
    type(boundary_t), intent(in) :: boundaries(:)
    type(neighbour_list_t), intent(in) :: list
    type(subproblem_t), intent(in) :: sub
    !> degrees of freedom of a body, those of an exchange
    integer, intent(in) :: nv
    type(sums_t), intent(out) :: sums
    real(dp) :: r, change
    integer :: c, k

    allocate (sums%of(nv, sub%n_columns), source=0.0_dp)
    do c = 1, sub%n_contacts
      r = sub%impulse(lane_of(c), 1, block_of(c))
      change = abs(r - list%impulse(1, sub%source(c)))
      if (is_moved(boundaries, sub, sub%pair(1, c)) .or. is_moved(boundaries, sub, sub%pair(2, c))) change = r
      do k = 1, 2
        sums%of(1, sub%pair(k, c)) = sums%of(1, sub%pair(k, c)) + r
        sums%of(2, sub%pair(k, c)) = sums%of(2, sub%pair(k, c)) + change
      end do
    end do
  end subroutine sum_impulses

  !> Whether column `b` is a boundary that moves as prescribed.
  pure logical function is_moved(boundaries, sub, b)
    type(boundary_t), intent(in) :: boundaries(:)
    type(subproblem_t), intent(in) :: sub
    integer, intent(in) :: b

    is_moved = .false.
    if (b > sub%n_grains) is_moved = boundaries(sub%boundary(b))%is_moved()
  end function is_moved

  !> Count the steps at rest, and put the number of the contacts of each body that have not counted half of `after` into the
  !> first row of the sums, which comes as sum_impulses and sum_over_copies leave it.
  subroutine count_steps(after, limit, boundaries, list, sub, nd, sums)
    integer, intent(in) :: after
    !> momentum of a body at rest [N s]
    real(dp), intent(in) :: limit
    type(boundary_t), intent(in) :: boundaries(:)
    type(neighbour_list_t), intent(inout) :: list
    type(subproblem_t), intent(in) :: sub
    !> space dimension
    integer, intent(in) :: nd
    type(sums_t), intent(inout) :: sums
    logical, allocatable :: rests(:)
    integer, allocatable :: steps(:)
    real(dp) :: reaction(nd)
    integer :: c, b, d, row

    allocate (rests(sub%n_columns), steps(sub%n_contacts))
    do b = 1, sub%n_columns
      rests(b) = .not. is_moved(boundaries, sub, b)
      if (b > sub%n_bodies) cycle
      rests(b) = max(momentum(b), sums%of(2, b)/settled) <= min(limit, share*sums%of(1, b))
      if (.not. allocated(sub%attraction_load)) cycle
      do d = 1, nd
        reaction(d) = sub%contact_reaction(d, b)
      end do
      rests(b) = rests(b) .and. momentum(b) <= share*norm2(reaction)
    end do
    row = list%memory%rest_row
    do c = 1, sub%n_contacts
      steps(c) = 0
      if (rests(sub%pair(1, c)) .and. rests(sub%pair(2, c))) steps(c) = min(after, list%state(row, sub%source(c)) + 1)
    end do
    list%state(row, :) = 0
    sums%of(:, :) = 0.0_dp
    do c = 1, sub%n_contacts
      list%state(row, sub%source(c)) = steps(c)
      if (2*steps(c) >= after) cycle
      sums%of(1, sub%pair(1, c)) = sums%of(1, sub%pair(1, c)) + 1.0_dp
      sums%of(1, sub%pair(2, c)) = sums%of(1, sub%pair(2, c)) + 1.0_dp
    end do

  contains

    !> m (|v| + R |w|) of body `b` [N s].
    pure real(dp) function momentum(b)
      integer, intent(in) :: b
      real(dp) :: speed

      speed = norm2(sub%v_global(1:nd, b))
      if (b <= sub%n_grains) speed = speed + sub%radius(b)*norm2(sub%v_global(nd + 1:, b))
      momentum = inverse_of_translation(sub%inverse_mass(:, b), nd)
      if (momentum > 0.0_dp) momentum = speed/momentum
    end function momentum

  end subroutine count_steps

end module gravier_sleeping
