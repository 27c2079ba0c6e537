!> Contact problems of a step without a solution, told by what iterations add to the impulses.
!>
!> Where walls close on grains, no velocities obey the law. Iterations then add nearly the same impulses z in each window. The free
!> bodies balance z, P = H z -> 0 there, while the walls, which move as prescribed, work against it: z . H^T V < 0 of theirs. They
!> push to no avail. Any z >= 0 along the normals gives a bound. A solution has v_n + s >= 0 with the shift s, and so
!>
!>     0 <= z . (v + s) = sum over free bodies (P . V) - A,   A = -(sum over prescribed bodies (P . V) + sum z s),
!>     A <= max|V| sum |P|.
!>
!> A solution needs bodies as fast as max|V| >= A/sum|P|. Where that is far beyond the speeds of the problem, there is none. With
!> friction in z this is a sign and no proof, as in gravier_unbounded, which looks at the matrix of a problem in the same way.
!> A over the impulses on boundaries is the mean speed by which these work against z. Where it is within the accuracy of a solve, the
!> contradiction is, too.
!> For compliant contacts the law holds for v + s + a r, and A loses z a r for the impulses r: springs give way before impulses grow
!> without bound. Their shifts are speeds of the problem, since springs drive bodies that are at rest; so are shifts in a periodic
!> cell that moves.
module gravier_vain_impulses
  use gravier_kinds, only: dp
  use gravier_contact_kernels, only: lane_of, block_of, project_on_cones
  use gravier_contact_problem, only: contact_problem_t, subproblem_t
  implicit none
  private
  public :: kept_impulses_t, are_in_vain, speed_against

  !> Impulses of a subdomain (lanes, nc, blocks) [N s].
  type :: kept_impulses_t
    real(dp), allocatable :: value(:, :, :)
  end type kept_impulses_t

  !> What impulses z do: A [J], sum |P| over what can move, sum |z| over the contacts of boundaries [N s]; the largest speed of the
  !> problem [m/s].
  type :: effect_t
    real(dp) :: work = 0.0_dp, on_bodies = 0.0_dp, on_boundaries = 0.0_dp, fastest = 0.0_dp
  end type effect_t

  !> speed that a solution would need, over the largest speed of the problem, from which on there is none
  real(dp), parameter :: beyond = 20.0_dp

contains

  !> Whether the impulses have grown in vain since earlier ones: no solution is to be found. Impulses and velocities stay as they
  !> are. Collective.
  logical function are_in_vain(problem, earlier) result(in_vain)
    type(contact_problem_t), intent(inout) :: problem
    !> of the subdomains of this rank
    type(kept_impulses_t), intent(in) :: earlier(:)
    type(kept_impulses_t) :: now(size(problem%sub))
    type(effect_t) :: effect
    integer :: s

    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        now(s)%value = sub%impulse
        sub%impulse(:, :, :) = sub%impulse - earlier(s)%value
        call project_on_cones(problem%kernels, sub%n_contacts, sub%hot, sub%impulse)
      end associate
    end do
    call find_effect(problem, now, effect)
    in_vain = effect%work > 0.0_dp .and. effect%work > beyond*effect%fastest*effect%on_bodies
    do s = 1, size(problem%sub)
      problem%sub(s)%impulse(:, :, :) = now(s)%value
    end do
    call problem%evaluate()
  end function are_in_vain

  !> The mean speed of boundaries that work against the impulses, which are the weights [m/s]; 0 where nothing works against them,
  !> and beyond all speeds where something else than boundaries does. Collective.
  real(dp) function speed_against(problem) result(speed)
    type(contact_problem_t), intent(inout) :: problem
    type(kept_impulses_t) :: now(size(problem%sub))
    type(effect_t) :: effect
    integer :: s

    do s = 1, size(problem%sub)
      now(s)%value = problem%sub(s)%impulse
    end do
    call find_effect(problem, now, effect)
    speed = merge(huge(speed), 0.0_dp, effect%work > 0.0_dp)
    if (effect%on_boundaries > 0.0_dp) speed = max(0.0_dp, effect%work/effect%on_boundaries)
    call problem%evaluate()
  end function speed_against

  !> The effect of z, which stands in the place of the impulses. Collective.
  subroutine find_effect(problem, impulses, effect)
    type(contact_problem_t), intent(inout) :: problem
    !> r of the subdomains of this rank
    type(kept_impulses_t), intent(in) :: impulses(:)
    type(effect_t), intent(out) :: effect
    !> A, sum |z| on boundaries and sum |P| (3, subdomains)
    real(dp) :: parts(3, size(problem%sub)), sums(3)
    integer :: s

    parts(:, :) = 0.0_dp
    do s = 1, size(problem%sub)
      call problem%own_reactions(s)
      call add_work(problem, problem%sub(s), impulses(s)%value, parts(1, s))
      call add_boundaries(problem, problem%sub(s), parts(2, s))
      call problem%shared%load(s, problem%sub(s)%reaction)
    end do
    call problem%shared%pass()
    do s = 1, size(problem%sub)
      call problem%shared%sum_copies(s, problem%sub(s)%reaction, mean=.false.)
      call add_reactions(problem, problem%sub(s), parts(3, s), effect%fastest)
    end do
    call problem%comm%sum_parts(parts, sums)
    effect%work = sums(1)
    effect%on_boundaries = sums(2)
    effect%on_bodies = sums(3)
    effect%fastest = problem%comm%highest(effect%fastest)
  end subroutine find_effect

  !> A of a subdomain, whose `reaction` is H z of its own contacts [J].
  pure subroutine add_work(problem, sub, r, work)
    type(contact_problem_t), intent(in) :: problem
    type(subproblem_t), intent(in) :: sub
    !> impulses (lanes, nc, blocks) [N s]
    real(dp), intent(in), contiguous :: r(:, :, :)
    real(dp), intent(inout) :: work
    integer :: b, c, d

    ! boundaries that forces move along some components move as prescribed along the others
    do b = sub%n_grains + 1, sub%n_columns
      do d = 1, problem%kernels%nv
        if (.not. sub%moves(d, b)) work = work - sub%reaction(d, b)*sub%v_free(d, b)
      end do
    end do
    do c = 1, sub%n_contacts
      work = work - sub%impulse(lane_of(c), 1, block_of(c))*sub%hot(lane_of(c), problem%kernels%nd + 1, block_of(c))
    end do
    if (.not. allocated(sub%spring)) return
    associate (row => problem%kernels%row, nd => problem%kernels%nd)
      do c = 1, sub%n_contacts
        associate (z => sub%impulse(lane_of(c), :, block_of(c)), contact => sub%hot(lane_of(c), :, block_of(c)))
          work = work - z(1)*contact(row%compliance_n)*r(lane_of(c), 1, block_of(c)) &
            & - sum(z(2:nd)*(contact(row%shift_t:row%shift_t + nd - 2) &
            &                + contact(row%compliance_t)*r(lane_of(c), 2:nd, block_of(c))))
        end associate
      end do
    end associate
  end subroutine add_work

  !> |z| of the contacts of a subdomain that boundaries have.
  pure subroutine add_boundaries(problem, sub, total)
    type(contact_problem_t), intent(in) :: problem
    type(subproblem_t), intent(in) :: sub
    real(dp), intent(inout) :: total
    integer :: c

    do c = 1, sub%n_contacts
      if (maxval(sub%pair(:, c)) > sub%n_grains) &
        & total = total + norm2(sub%impulse(lane_of(c), 1:problem%kernels%nf, block_of(c)))
    end do
  end subroutine add_boundaries

  !> |P| of a subdomain, whose `reaction` is H z of all contacts, a copy of a shared body counting with its part; the moment of a
  !> grain counts as a force at its rim, and the speed of its rim as one [N s], [m/s].
  pure subroutine add_reactions(problem, sub, total, fastest)
    type(contact_problem_t), intent(in) :: problem
    type(subproblem_t), intent(in) :: sub
    real(dp), intent(inout) :: total, fastest
    real(dp) :: reaction(problem%kernels%nd), speed
    integer :: b, c, nd

    nd = problem%kernels%nd
    do c = 1, merge(sub%n_contacts, 0, allocated(sub%spring) .or. problem%cell%moves)
      if (.not. (sub%yields(c) .or. problem%cell%moves)) cycle
      fastest = max(fastest, abs(sub%hot(lane_of(c), problem%kernels%row%shift, block_of(c))))
    end do
    do b = 1, sub%n_columns
      speed = norm2(sub%v_free(1:nd, b))
      if (b <= sub%n_grains) speed = speed + sub%radius(b)*norm2(sub%v_free(nd + 1:, b))
      fastest = max(fastest, speed)
      if (b > sub%n_bodies) cycle
      reaction(:) = merge(sub%reaction(1:nd, b), 0.0_dp, sub%inverse_mass(1:nd, b) > 0.0_dp)
      total = total + norm2(reaction)/sub%multiplicity(b)
      if (b <= sub%n_grains) total = total + norm2(sub%reaction(nd + 1:, b))/(sub%radius(b)*sub%multiplicity(b))
    end do
  end subroutine add_reactions

end module gravier_vain_impulses
