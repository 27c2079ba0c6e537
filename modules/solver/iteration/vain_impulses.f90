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
!> For compliant contacts the law holds for v + s + a r, and A loses z a r for the impulses r: springs give way before impulses grow
!> without bound. Their shifts are speeds of the problem, since springs drive bodies that are at rest; so are shifts in a periodic
!> cell that moves.
module gravier_vain_impulses
  use gravier_kinds, only: dp
  use gravier_contact_kernels, only: lane_of, block_of, project_on_cones
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  use gravier_kept_impulses, only: kept_impulses_t, copy_impulses, restore_impulses
  implicit none
  private
  public :: are_in_vain, speed_against

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
    integer :: s

    call copy_impulses(problem, now)
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        sub%impulse(:, :, :) = sub%impulse - earlier(s)%value
        call project_on_cones(problem%kernels, sub%n_contacts, sub%hot, sub%impulse)
      end associate
    end do
    in_vain = exceeds_bound(problem, now)
    call restore_impulses(problem, now)
    call problem%evaluate()
  end function are_in_vain

  !> The largest speed at which something prescribed works against the impulse of a contact, along that impulse: a boundary, or the
  !> shift of the law [m/s]. A contact without an impulse whose bodies approach needs one along its normal. Where the speed is
  !> within the accuracy of a solve, so is any contradiction of what is prescribed. With v_global evaluated. Collective.
  real(dp) function speed_against(problem) result(speed)
    type(contact_problem_t), intent(in) :: problem
    real(dp), allocatable :: prescribed(:, :), v(:, :, :), now(:, :, :)
    real(dp) :: z(problem%nf), impulse
    integer :: s, b, c, d

    speed = 0.0_dp
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s), kernels => problem%kernels)
        allocate (prescribed, mold=sub%v_free)
        allocate (v, now, mold=sub%impulse)
        prescribed(:, :) = 0.0_dp
        do b = sub%n_grains + 1, sub%n_columns
          do d = 1, kernels%nv
            if (.not. sub%moves(d, b)) prescribed(d, b) = sub%v_free(d, b)
          end do
        end do
        call sub%contact_velocity(kernels, prescribed, v)
        call sub%contact_velocity(kernels, sub%v_global, now)
        do c = 1, sub%n_contacts
          associate (contact => sub%hot(lane_of(c), :, block_of(c)))
            z(:) = sub%impulse(lane_of(c), 1:kernels%nf, block_of(c))
            if (all(abs(z) <= 0.0_dp) .and. now(lane_of(c), 1, block_of(c)) + contact(kernels%row%shift) < 0.0_dp) z(1) = 1.0_dp
            impulse = norm2(z)
            if (impulse > 0.0_dp) speed = max(speed, -(dot_product(z, v(lane_of(c), 1:kernels%nf, block_of(c))) &
              & + work_of_shift(problem, contact, z))/impulse)
          end associate
        end do
        deallocate (prescribed, v, now)
      end associate
    end do
    speed = problem%comm%highest(speed)
  end function speed_against

  !> Whether z, which stands in the place of the impulses, asks for velocities far beyond those of the problem. Collective.
  logical function exceeds_bound(problem, impulses) result(exceeds)
    type(contact_problem_t), intent(inout) :: problem
    !> r of the subdomains of this rank
    type(kept_impulses_t), intent(in) :: impulses(:)
    !> A and sum |P| (2, subdomains)
    real(dp) :: parts(2, size(problem%sub)), sums(2), fastest
    integer :: s

    parts(:, :) = 0.0_dp
    fastest = 0.0_dp
    do s = 1, size(problem%sub)
      call problem%own_reactions(s)
      call add_work(problem, problem%sub(s), impulses(s)%value, parts(1, s))
      call problem%shared%load(s, problem%sub(s)%reaction)
    end do
    call problem%shared%pass()
    do s = 1, size(problem%sub)
      call problem%shared%sum_copies(s, problem%sub(s)%reaction, mean=.false.)
      call add_reactions(problem, problem%sub(s), parts(2, s), fastest)
    end do
    call problem%comm%sum_parts(parts, sums)
    fastest = problem%comm%highest(fastest)
    exceeds = sums(1) > 0.0_dp .and. sums(1) > beyond*fastest*sums(2)
  end function exceeds_bound

  !> A of a subdomain, whose `reaction` is H z of its own contacts [J].
  pure subroutine add_work(problem, sub, r, work)
    type(contact_problem_t), intent(in) :: problem
    type(subproblem_t), intent(in) :: sub
    !> impulses (lanes, nc, blocks) [N s]
    real(dp), intent(in), contiguous :: r(:, :, :)
    real(dp), intent(inout) :: work
    integer :: b, c, d

    ! boundaries that forces move along some axes move as prescribed along the others
    do b = sub%n_grains + 1, sub%n_columns
      do d = 1, problem%nv
        if (.not. sub%moves(d, b)) work = work - sub%reaction(d, b)*sub%v_free(d, b)
      end do
    end do
    do c = 1, sub%n_contacts
      associate (z => sub%impulse(lane_of(c), 1:problem%nf, block_of(c)))
        work = work - work_of_shift(problem, sub%hot(lane_of(c), :, block_of(c)), z)
      end associate
    end do
    if (.not. allocated(sub%spring)) return
    associate (row => problem%row, nd => problem%nd)
      do c = 1, sub%n_contacts
        associate (z => sub%impulse(lane_of(c), :, block_of(c)), contact => sub%hot(lane_of(c), :, block_of(c)))
          work = work - z(1)*contact(row%compliance_n)*r(lane_of(c), 1, block_of(c)) &
            & - sum(z(2:nd)*contact(row%compliance_t)*r(lane_of(c), 2:nd, block_of(c)))
        end associate
      end do
    end associate
  end subroutine add_work

  !> z s of a contact with the shift s of its law, along the normal and, where the scene has such, along the tangents [J].
  pure real(dp) function work_of_shift(problem, contact, z) result(work)
    type(contact_problem_t), intent(in) :: problem
    !> its data
    real(dp), intent(in) :: contact(:)
    !> impulse [N s]
    real(dp), intent(in) :: z(:)

    associate (row => problem%row)
      work = z(1)*contact(row%shift)
      if (row%shift_t > 0) work = work + sum(z(2:)*contact(row%shift_t:row%shift_t + size(z) - 2))
    end associate
  end function work_of_shift

  !> |P| of a subdomain, whose `reaction` is H z of all contacts, a copy of a shared body counting with its part; the moment of a
  !> grain counts as a force at its rim, and the speed of its rim as one [N s], [m/s].
  pure subroutine add_reactions(problem, sub, total, fastest)
    type(contact_problem_t), intent(in) :: problem
    type(subproblem_t), intent(in) :: sub
    real(dp), intent(inout) :: total, fastest
    real(dp) :: reaction(problem%nd), speed
    integer :: b, c, nd

    nd = problem%nd
    do c = 1, merge(sub%n_contacts, 0, allocated(sub%spring) .or. problem%cell_moves())
      if (.not. (sub%yields(c) .or. problem%cell_moves())) cycle
      fastest = max(fastest, abs(sub%hot(lane_of(c), problem%row%shift, block_of(c))))
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
