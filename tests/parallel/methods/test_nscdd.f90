!> NSCDD: the copies' velocities after an exchange, momentum, monotone history, one subdomain, any number of ranks.
program test_nscdd
  use mpi_f08, only: MPI_COMM_SELF
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_random_hash, only: hash_uniform
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  use gravier_nlgs, only: nlgs_t
  use gravier_nscdd, only: average_copies
  use gravier_solve, only: solve_contacts
  use gravier_solve_report, only: solve_report_t, solve_converged
  use gravier_simulation, only: simulation_t
  use gravier_test_simulations, only: make_lattice, iterate, same_bits, same_impulses, compare_with_one_rank
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  character(len=*), parameter :: keys = "&solver method = 'nscdd', acceleration = 'none', sweeps = 2 /"
  type(communicator_t), target :: comm, alone
  integer :: dimension, k
  real(dp), parameter :: frictions(*) = [0.0_dp, 0.4_dp]

  call start_parallel()
  call comm%init()
  call alone%init(MPI_COMM_SELF)
  do dimension = 2, 3
    do k = 1, size(frictions)
      call test_average(dimension, frictions(k))
      call test_velocities(dimension, frictions(k))
      call test_one_subdomain(dimension, frictions(k))
      call compare_with_one_rank(dimension, 9, frictions(k), keys, 8, "NSCDD")
    end do
    call test_descent(dimension)
    call test_solution(dimension)
  end do
  call test_jump_and_work()
  call finish_checks()
  call alone%free()
  call comm%free()
  call stop_parallel()

contains

  !> The copies of a body take one velocity, bit for bit, that is the mean of theirs; momentum, with M/m in each, stays.
  !> Velocities are below 1: their sums are off by m roundings, m <= 9.
  subroutine test_average(dimension, friction)
    integer, intent(in) :: dimension
    real(dp), intent(in) :: friction
    real(dp), parameter :: rounding = 9*epsilon(1.0_dp)
    type(simulation_t) :: sim
    real(dp) :: before(6), after(6), expected
    integer :: s, b, d, k, j
    logical :: mean, same, unshared

    call make_lattice(comm, dimension, 9, friction, keys, sim)
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s))
        call sub%share_masses(sim%problem%kernels, .true.)
        do b = 1, sub%n_bodies
          do d = 1, sim%problem%nv
            sub%velocity(d, b) = copy_of(sub%id(b), sub%subdomain, d)
          end do
        end do
      end associate
    end do
    call find_momentum(sim%problem, before)
    call average_copies(sim%problem)
    call find_momentum(sim%problem, after)
    mean = .true.
    unshared = .true.
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s), part => sim%problem%shared%part(s))
        do k = 1, part%n_shared
          b = part%body(k)
          do d = 1, sim%problem%nv
            expected = 0.0_dp
            do j = part%first(k), part%first(k + 1) - 1
              expected = expected + copy_of(sub%id(b), part%sharer(j), d)
            end do
            expected = expected/part%multiplicity(k)
            mean = mean .and. abs(sub%velocity(d, b) - expected) <= rounding
          end do
        end do
        do b = 1, sub%n_bodies
          if (sub%multiplicity(b) > 1) cycle
          do d = 1, sim%problem%nv
            unshared = unshared .and. abs(sub%velocity(d, b) - copy_of(sub%id(b), sub%subdomain, d)) <= 0.0_dp
          end do
        end do
      end associate
    end do
    call check(mean, "the mean of the copies")
    call check(unshared, "bodies without copies stay")
    call check_copies(sim%problem, same)
    call check(same, "copies with the same bits")
    ! some hundred bodies of mass below 5 each
    do d = 1, sim%problem%nv
      call check_close(after(d), before(d), 500*rounding, "momentum")
    end do
    call sim%free()
  end subroutine test_average

  pure real(dp) function copy_of(id, subdomain, d)
    integer(i8), intent(in) :: id
    integer, intent(in) :: subdomain, d
    copy_of = 2*hash_uniform(8, 100*id + subdomain, d) - 1.0_dp
  end function copy_of

  !> Momentum of all copies, each with its share of the mass.
  subroutine find_momentum(problem, momentum)
    type(contact_problem_t), intent(in) :: problem
    real(dp), intent(out) :: momentum(6)
    real(dp), allocatable :: parts(:, :)
    integer :: s, b, d

    allocate (parts(6, size(problem%sub)), source=0.0_dp)
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do b = 1, sub%n_bodies
          do d = 1, problem%nv
            parts(d, s) = parts(d, s) + sub%velocity(d, b)/sub%weight(min(d, problem%nw), b)
          end do
        end do
      end associate
    end do
    call problem%comm%sum_parts(parts, momentum)
  end subroutine find_momentum

  !> Whether all copies of each body have a velocity with the same bits.
  subroutine check_copies(problem, same)
    type(contact_problem_t), intent(inout) :: problem
    logical, intent(out) :: same
    integer :: s, j, b

    do s = 1, size(problem%sub)
      call problem%shared%load(s, problem%sub(s)%velocity)
    end do
    call problem%shared%pass()
    same = .true.
    do s = 1, size(problem%sub)
      associate (part => problem%shared%part(s))
        do j = 1, part%n_slots
          b = part%body(part%slot_shared(j))
          same = same .and. same_bits(part%recv(:, j:j), problem%sub(s)%velocity(:, b:b))
        end do
      end associate
    end do
    same = .not. problem%comm%any_true(.not. same)
  end subroutine check_copies

  !> After an iteration every copy has the velocity of the undivided body under all impulses (paper, (10)-(11)): cold, and
  !> from impulses at the start. 1/m is below 2.5 (disks) or 25 (spheres), impulses below 10, and errors of ten iterations
  !> add up.
  subroutine test_velocities(dimension, friction)
    integer, intent(in) :: dimension
    real(dp), intent(in) :: friction
    real(dp), parameter :: rounding = 1.0e-12_dp
    type(simulation_t) :: sim
    type(error_t), allocatable :: error
    integer :: s, round
    logical :: same

    call make_lattice(comm, dimension, 9, friction, keys, sim)
    do round = 1, 2
      call iterate(sim, 10)
      call sim%problem%evaluate()
      same = .true.
      do s = 1, size(sim%problem%sub)
        same = same .and. all(abs(sim%problem%sub(s)%velocity - sim%problem%sub(s)%v_global) <= rounding)
      end do
      call check(same, "velocities of the undivided bodies")
      ! a start from these impulses has these velocities
      call sim%method%start(sim%problem, error)
      same = .true.
      do s = 1, size(sim%problem%sub)
        same = same .and. same_bits(sim%problem%sub(s)%velocity, sim%problem%sub(s)%v_global)
      end do
      call check(same, "velocities at a warm start")
    end do
    call sim%free()
  end subroutine test_velocities

  !> One subdomain: NLGS, bit for bit.
  subroutine test_one_subdomain(dimension, friction)
    integer, intent(in) :: dimension
    real(dp), intent(in) :: friction
    type(simulation_t) :: sim
    type(nlgs_t) :: nlgs
    type(error_t), allocatable :: error
    type(subproblem_t) :: before
    real(dp) :: jump
    integer :: s, k

    call make_lattice(comm, dimension, 1, friction, keys, sim)
    call iterate(sim, 6)
    do s = 1, size(sim%problem%sub)
      before = sim%problem%sub(s)
      sim%problem%sub(s)%impulse(:, :, :) = 0.0_dp
    end do
    nlgs%sweeps = 2
    call nlgs%start(sim%problem, error)
    do k = 1, 6
      call nlgs%iterate(sim%problem, .false., jump, error)
    end do
    do s = 1, size(sim%problem%sub)
      call check(same_impulses(sim%problem%sub(s), before), "one subdomain: NLGS, bit for bit")
    end do
    call sim%free()
  end subroutine test_one_subdomain

  !> Without friction the contact problem minimises E(r) = r.W r/2 + r.(H^T V_free + shift) on r >= 0, and the problems with
  !> shared masses majorise it: E falls at every iteration, up to its own rounding.
  subroutine test_descent(dimension)
    integer, intent(in) :: dimension
    type(simulation_t) :: sim
    type(error_t), allocatable :: error
    real(dp) :: energy, next, jump
    integer :: k
    logical :: falls

    call make_lattice(comm, dimension, 9, 0.0_dp, keys, sim)
    call sim%method%start(sim%problem, error)
    energy = 0.0_dp
    falls = .true.
    do k = 1, 60
      call sim%method%iterate(sim%problem, .false., jump, error)
      next = energy_of(sim%problem)
      if (k < 10) call check(next < energy, "energy falls")
      falls = falls .and. next <= energy + 1.0e-12_dp*abs(energy)
      energy = next
    end do
    call check(falls, "energy never rises")
    call sim%free()
  end subroutine test_descent

  real(dp) function energy_of(problem) result(energy)
    type(contact_problem_t), intent(inout) :: problem
    real(dp), allocatable :: part(:), v(:, :, :)
    integer :: s, b, nd

    nd = problem%nd
    call problem%evaluate()
    allocate (part(size(problem%sub)), source=0.0_dp)
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        ! every copy has the whole reaction: each counts for 1/m
        do b = 1, sub%n_bodies
          part(s) = part(s) + 0.5_dp*sub%inverse_mass(1, b)*sum(sub%reaction(1:nd, b)**2)/sub%multiplicity(b)
        end do
        allocate (v, mold=sub%impulse)
        call problem%kernels%contact_velocity(sub%pair, sub%hot, sub%v_free, v)
        part(s) = part(s) + sum(sub%impulse(:, 1, :)*(v(:, 1, :) + sub%hot(:, nd + 1, :)))
        deallocate (v)
      end associate
    end do
    energy = problem%comm%sum_real(part)
  end function energy_of

  !> The method ends where NLGS on one domain does. Without friction the velocities are unique; at a residual of 1e-9 they
  !> are off by the impulses' errors, some ten times that, over masses down to 0.05.
  subroutine test_solution(dimension)
    integer, intent(in) :: dimension
    type(simulation_t) :: many, one
    type(solve_report_t) :: report
    type(error_t), allocatable :: error
    real(dp), allocatable :: velocity(:, :), other(:, :)

    call make_lattice(comm, dimension, 9, 0.0_dp, keys, many)
    call make_lattice(alone, dimension, 1, 0.0_dp, "&solver acceleration = 'none' /", one)
    many%control%tolerance = 1.0e-9_dp
    one%control%tolerance = 1.0e-9_dp
    call solve_contacts(many%problem, many%method, many%control, report, error)
    call check_equal(report%status, solve_converged, "NSCDD converges")
    call solve_contacts(one%problem, one%method, one%control, report, error)
    call check_equal(report%status, solve_converged, "NLGS converges")
    call collect(many%problem, int(many%n_grains), velocity)
    call collect(one%problem, int(one%n_grains), other)
    call check_close(maxval(abs(velocity - other)), 0.0_dp, 1.0e-6_dp, "one solution")
    call many%free()
    call one%free()
  end subroutine test_solution

  !> v_global of all grains in contact, zeros elsewhere, on every rank of the problem.
  subroutine collect(problem, n_grains, velocity)
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: n_grains
    real(dp), allocatable, intent(out) :: velocity(:, :)
    integer :: s, b, g

    allocate (velocity(problem%nv, n_grains), source=-huge(1.0_dp))
    do s = 1, size(problem%sub)
      do b = 1, problem%sub(s)%n_bodies
        velocity(:, problem%sub(s)%id(b)) = problem%sub(s)%v_global(:, b)
      end do
    end do
    do g = 1, n_grains
      call problem%comm%highest_of(velocity(:, g))
      if (velocity(1, g) < -1.0e300_dp) velocity(:, g) = 0.0_dp
    end do
  end subroutine collect

  !> The jump is that of the copies after the sweeps, where asked for; work is counted.
  subroutine test_jump_and_work()
    type(simulation_t) :: sim
    type(error_t), allocatable :: error
    real(dp) :: jump
    integer :: s
    integer(i8) :: contacts

    call make_lattice(comm, 2, 9, 0.4_dp, keys, sim)
    call sim%method%start(sim%problem, error)
    call sim%method%iterate(sim%problem, .false., jump, error)
    call check_close(jump, 0.0_dp, 0.0_dp, "no jump unless asked for")
    call sim%method%iterate(sim%problem, .true., jump, error)
    call check(jump > 0.01_dp, "copies differ after the sweeps")
    call check_close(sim%problem%jump(), 0.0_dp, 0.0_dp, "and agree after the exchange")
    contacts = 0
    do s = 1, size(sim%problem%sub)
      contacts = contacts + sim%problem%sub(s)%n_contacts
    end do
    associate (work => sim%method%work_done())
      call check_equal(work%solves, 1_i8, "solves")
      call check_equal(work%iterations, 2_i8, "iterations")
      call check_equal(work%sweeps, 4_i8, "sweeps")
      call check_equal(work%relaxations, 4*contacts, "relaxations of this rank")
      call check_equal(work%interface_solves, 2_i8, "interface solves")
    end associate
    call sim%free()
  end subroutine test_jump_and_work

end program test_nscdd
