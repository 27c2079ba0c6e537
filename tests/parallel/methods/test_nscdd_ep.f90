!> NSCDD-EP: l = 0, the enriched interface condition after each iteration, impulses fed back, fixed points, both interface solvers,
!> work, any number of ranks.
program test_nscdd_ep
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  use gravier_method, only: method_t
  use gravier_nscdd_ep, only: nscdd_ep_t
  use gravier_solve, only: solve_contacts
  use gravier_solve_report, only: solve_report_t, solve_converged
  use gravier_simulation, only: simulation_t
  use gravier_test_simulations, only: make_lattice, iterate, same_bits, same_impulses, compare_with_one_rank
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  character(len=*), parameter :: plain = "&solver method = 'nscdd', sweeps = 2, acceleration = 'none' /"
  character(len=*), parameter :: enriched = &
    & "&solver method = 'nscdd_ep', sweeps = 2, acceleration = 'none' / &enriched direction = "
  type(communicator_t), target :: comm
  integer :: dimension, k
  real(dp), parameter :: frictions(*) = [0.0_dp, 0.4_dp]

  call start_parallel()
  call comm%init()
  do dimension = 2, 3
    do k = 1, size(frictions)
      call test_zero(dimension, frictions(k))
      call test_condition(dimension, frictions(k), "1 /")
      call test_feedback(dimension, frictions(k), "direction = 3, contacts = 'active' /")
      call test_feedback(dimension, frictions(k), "direction = 1e6, contacts = 'active' /")
      call test_feedback(dimension, frictions(k), "interface = 'cg' /")
      call test_condition(dimension, frictions(k), "0.5, direction_unit = 'absolute' /")
      call compare_with_one_rank(dimension, 9, frictions(k), enriched//"1 /", 4, "direct")
      call compare_with_one_rank(dimension, 9, frictions(k), enriched//"1, contacts = 'active' /", 4, "direct, active")
    end do
    call test_solvers(dimension, 0.4_dp)
    call compare_with_one_rank(dimension, 5, 0.4_dp, enriched//"1, interface = 'cg' /", 2, "conjugate gradient")
    call test_fixed_point(dimension)
  end do
  call test_work()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> Largest difference of the impulses of two runs. Collective.
  real(dp) function distance(a, b)
    type(contact_problem_t), intent(in) :: a, b
    integer :: s

    distance = 0.0_dp
    do s = 1, size(a%sub)
      if (a%sub(s)%n_contacts > 0) distance = max(distance, maxval(abs(a%sub(s)%impulse - b%sub(s)%impulse)))
    end do
    distance = a%comm%highest(distance)
  end function distance

  !> l = 0 is NSCDD, bit for bit; l > 0 is not.
  subroutine test_zero(dimension, friction)
    integer, intent(in) :: dimension
    real(dp), intent(in) :: friction
    type(simulation_t) :: nscdd, zero, some
    integer :: s
    logical :: same

    call make_lattice(comm, dimension, 9, friction, plain, nscdd)
    call make_lattice(comm, dimension, 9, friction, enriched//"0 /", zero)
    call make_lattice(comm, dimension, 9, friction, enriched//"1 /", some)
    call iterate(nscdd, 10)
    call iterate(zero, 10)
    call iterate(some, 10)
    same = .true.
    do s = 1, size(nscdd%problem%sub)
      same = same .and. same_impulses(nscdd%problem%sub(s), zero%problem%sub(s))
      same = same .and. same_bits(nscdd%problem%sub(s)%velocity, zero%problem%sub(s)%velocity)
    end do
    call check(same, "l = 0 is NSCDD, bit for bit")
    call check(distance(nscdd%problem, some%problem) > 1.0e-3_dp, "l > 0 does something")
    call nscdd%free()
    call zero%free()
    call some%free()
  end subroutine test_zero

  !> What an iteration must end with (paper, (24)-(29)): F such that the enriched velocities
  !>   V~_E = M_eta,E^-1 [ R_E^d + H_E (r_E + l_E v_E) - A_E^T F ]
  !> are the same in all copies, and M~_E V_E = R_E^d + H_E r_E - A_E^T F. F follows from V_E: it has no effect but on
  !> shared bodies, and sums to zero over the copies.
  subroutine test_condition(dimension, friction, direction)
    integer, intent(in) :: dimension
    real(dp), intent(in) :: friction
    character(len=*), intent(in) :: direction
    type(simulation_t) :: sim
    type(error_t), allocatable :: error
    real(dp) :: jump
    integer :: n

    call make_lattice(comm, dimension, 9, friction, enriched//direction, sim)
    ! the second round starts from impulses
    do n = 1, 4
      if (mod(n, 2) == 1) call sim%method%start(sim%problem, error)
      call sim%method%iterate(sim%problem, .false., jump, error)
      call check(.not. allocated(error), "iteration")
      call check_condition(sim)
    end do
    call sim%free()
  end subroutine test_condition

  subroutine check_condition(sim)
    type(simulation_t), intent(inout) :: sim
    !> velocities and impulses of size 1 to 10, solved with M_eta whose condition is some hundred
    real(dp), parameter :: rounding = 1.0e-11_dp
    real(dp), allocatable :: force(:, :), total(:)
    type(error_t), allocatable :: error
    integer :: s, b, d, k, nd, nv
    logical :: own, balanced

    nd = sim%problem%nd
    nv = sim%problem%nv
    own = .true.
    balanced = .true.
    select type (method => sim%method)
    type is (nscdd_ep_t)
      do s = 1, size(sim%problem%sub)
        call sim%problem%own_reactions(s)
        associate (sub => sim%problem%sub(s), part => method%matrix%part(s))
          ! A^T F = M~ (V_free - V) + H r, into `reaction`, and M~ V + H l v
          do b = 1, sub%n_bodies
            do d = 1, nv
              associate (weight => sub%weight(min(d, size(sub%weight, 1)), b))
                sub%reaction(d, b) = sub%reaction(d, b) + (sub%v_free(d, b) - sub%velocity(d, b))/weight
              end associate
            end do
            if (sub%multiplicity(b) == 1) own = own .and. all(abs(sub%reaction(:, b)) <= rounding)
          end do
          allocate (force(nv, sub%n_columns), source=0.0_dp)
          part%contact_work(:, :, :) = part%direction*part%law_velocity
          call sim%problem%kernels%add_reaction(sub%pair, sub%hot, part%contact_work, force)
          do b = 1, sub%n_bodies
            do d = 1, nv
              force(d, b) = force(d, b) + sub%velocity(d, b)/sub%weight(min(d, size(sub%weight, 1)), b)
            end do
          end do
          call method%matrix%solve(sim%problem%sub(s), s, force, error)
          part%body_work(:, :) = force
          deallocate (force)
        end associate
        call sim%problem%shared%load(s, sim%problem%sub(s)%reaction)
      end do
      call check(.not. allocated(error), "enriched velocities")
      call check(own, "multipliers act on shared bodies only")
      call sim%problem%shared%pass()
      allocate (total(nv))
      do s = 1, size(sim%problem%sub)
        do k = 1, sim%problem%shared%part(s)%n_shared
          total(:) = sim%problem%sub(s)%reaction(:, sim%problem%shared%part(s)%body(k))
          call sim%problem%shared%add_copies(s, k, total)
          balanced = balanced .and. all(abs(total) <= rounding)
        end do
        call sim%problem%shared%load(s, method%matrix%part(s)%body_work)
      end do
      call check(balanced, "multipliers sum to zero over the copies")
      call sim%problem%shared%pass()
      own = .true.
      do s = 1, size(sim%problem%sub)
        associate (part => sim%problem%shared%part(s), work => method%matrix%part(s)%body_work)
          do k = 1, part%n_slots
            own = own .and. all(abs(part%recv(:, k) - work(:, part%body(part%slot_shared(k)))) <= 10*rounding)
          end do
        end associate
      end do
      call check(own, "enriched velocities are the same in all copies")
    class default
      call check(.false., "an NSCDD-EP method")
    end select
  end subroutine check_condition

  !> With l on active contacts, an iteration is one of NSCDD and a correction under which the energy does not rise; after it the
  !> velocities of all copies are those of the undivided bodies under all impulses, and impulses are in their cones.
  subroutine test_feedback(dimension, friction, keys)
    integer, intent(in) :: dimension
    real(dp), intent(in) :: friction
    character(len=*), intent(in) :: keys
    type(simulation_t) :: nscdd, ep
    type(error_t), allocatable :: error
    real(dp) :: jump, reached(2), gained
    integer :: n, s

    call make_lattice(comm, dimension, 9, friction, plain, nscdd)
    call make_lattice(comm, dimension, 9, friction, &
      & "&solver method = 'nscdd_ep', sweeps = 2, acceleration = 'none' / &enriched "//keys, ep)
    call ep%method%start(ep%problem, error)
    gained = 0.0_dp
    do n = 1, 6
      do s = 1, size(ep%problem%sub)
        nscdd%problem%sub(s)%impulse(:, :, :) = ep%problem%sub(s)%impulse
      end do
      call nscdd%method%start(nscdd%problem, error)
      call nscdd%method%iterate(nscdd%problem, .false., jump, error)
      call ep%method%iterate(ep%problem, .false., jump, error)
      call check(.not. allocated(error), "iteration")
      reached(1) = energy(nscdd%problem)
      reached(2) = energy(ep%problem)
      ! energies are sums of some hundred terms of size 1 to 100
      call check(reached(2) <= reached(1) + 1.0e-11_dp*abs(reached(1)), "the correction does not raise the energy")
      gained = gained + reached(1) - reached(2)
      call check_feedback(ep%problem)
    end do
    call check(gained > 1.0e-6_dp*abs(reached(2)), "the correction lowers the energy")
    call nscdd%free()
    call ep%free()
  end subroutine test_feedback

  !> 1/2 r.W r + r.(v^d + shift) = r.(v + v^d)/2 + r.shift of the impulses of all subdomains.
  real(dp) function energy(problem)
    type(contact_problem_t), intent(inout) :: problem
    real(dp), allocatable :: v(:, :, :), mean(:, :), part(:)
    integer :: s

    call problem%evaluate()
    allocate (part(size(problem%sub)))
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s), nd => problem%nd)
        allocate (v, mold=sub%impulse)
        v(:, :, :) = 0.0_dp
        mean = 0.5_dp*(sub%v_global + sub%v_free)
        call problem%kernels%contact_velocity(sub%pair, sub%hot, mean, v)
        part(s) = sum(sub%impulse*v) + sum(sub%impulse(:, 1, :)*sub%hot(:, nd + 1, :))
        deallocate (v, mean)
      end associate
    end do
    energy = problem%comm%sum_real(part)
  end function energy

  subroutine check_feedback(problem)
    type(contact_problem_t), intent(inout) :: problem
    logical :: agree, allowed
    integer :: s, c, q, g

    agree = .true.
    allowed = .true.
    call problem%evaluate()
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s), kernels => problem%kernels)
        agree = agree .and. all(abs(sub%velocity - sub%v_global) <= 1.0e-11_dp)
        do c = 1, sub%n_contacts
          q = lane_of(c)
          g = block_of(c)
          allowed = allowed .and. sub%impulse(q, 1, g) >= 0.0_dp
          if (kernels%nc > 1) allowed = allowed .and. &
            & norm2(sub%impulse(q, 2:, g)) <= sub%hot(q, kernels%nh, g)*sub%impulse(q, 1, g) + 1.0e-13_dp
        end do
      end associate
    end do
    call check(agree, "velocities are those under all impulses")
    call check(allowed, "impulses are in their cones")
  end subroutine check_feedback

  !> The iterates of both interface solvers agree. F is good to 1e-12 times the condition of X at each iteration.
  subroutine test_solvers(dimension, friction)
    integer, intent(in) :: dimension
    real(dp), intent(in) :: friction
    type(simulation_t) :: direct, cg

    call make_lattice(comm, dimension, 5, friction, enriched//"2 /", direct)
    call make_lattice(comm, dimension, 5, friction, enriched//"2, interface = 'cg' /", cg)
    call iterate(direct, 3)
    call iterate(cg, 3)
    call check_close(distance(direct%problem, cg%problem), 0.0_dp, 1.0e-8_dp, "direct and iterative interface solves")
    associate (work => cg%method%work_done())
      call check(work%interface_iterations > work%interface_solves, "iterations of the conjugate gradient")
    end associate
    call direct%free()
    call cg%free()
  end subroutine test_solvers

  !> The solution of the contact problem is a fixed point: from impulses of a residual 1e-10, iterations stay where NSCDD
  !> ended. Impulses are of size 1, the error some ten times the residual.
  subroutine test_fixed_point(dimension)
    integer, intent(in) :: dimension
    type(simulation_t) :: nscdd, ep
    type(solve_report_t) :: report
    type(error_t), allocatable :: error
    real(dp) :: residual, defect
    integer :: s

    call make_lattice(comm, dimension, 9, 0.0_dp, plain, nscdd)
    call make_lattice(comm, dimension, 9, 0.0_dp, enriched//"1 /", ep)
    nscdd%control%tolerance = 1.0e-10_dp
    call solve_contacts(nscdd%problem, nscdd%method, nscdd%control, report, error)
    call check_equal(report%status, solve_converged, "NSCDD converges")
    do s = 1, size(ep%problem%sub)
      ep%problem%sub(s)%impulse(:, :, :) = nscdd%problem%sub(s)%impulse
    end do
    call iterate(ep, 10)
    call check_close(distance(nscdd%problem, ep%problem), 0.0_dp, 1.0e-7_dp, "the solution is a fixed point")
    call ep%problem%evaluate()
    call ep%problem%residual(residual, defect)
    call check_close(residual, 0.0_dp, 1.0e-8_dp, "residual at a fixed point")
    call nscdd%free()
    call ep%free()
  end subroutine test_fixed_point

  !> One factorisation for each subdomain and one of X for a solve; none for another solve of the same problem.
  subroutine test_work()
    type(simulation_t) :: sim
    integer :: s
    integer(i8) :: mine

    call make_lattice(comm, 2, 9, 0.4_dp, enriched//"1 /", sim)
    mine = 0
    do s = 1, size(sim%problem%sub)
      if (sim%problem%sub(s)%n_bodies > 0) mine = mine + 1
    end do
    call iterate(sim, 4)
    call expect(sim%method, 1, 4, mine)
    call iterate(sim, 3)
    call expect(sim%method, 2, 7, mine)
    call sim%free()
  end subroutine test_work

  subroutine expect(method, solves, iterations, factorisations)
    class(method_t), intent(in) :: method
    integer, intent(in) :: solves, iterations
    integer(i8), intent(in) :: factorisations

    associate (work => method%work_done())
      call check_equal(work%solves, int(solves, i8), "solves")
      call check_equal(work%iterations, int(iterations, i8), "iterations")
      call check_equal(work%interface_solves, int(iterations, i8), "interface solves")
      call check_equal(work%factorisations, factorisations, "factorisations of the subdomains of this rank")
      call check_equal(work%analyses, factorisations, "analyses of the subdomains of this rank")
    end associate
  end subroutine expect

end program test_nscdd_ep
