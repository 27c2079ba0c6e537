!> The interface problem X_eta F = b: its operator, the direct and the iterative solution, the closed form at l = 0.
program test_interface
  use mpi_f08, only: MPI_COMM_SELF
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, status_failure
  use gravier_random_hash, only: hash_uniform
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_contact_problem, only: contact_problem_t
  use gravier_enriched_matrix, only: enriched_matrix_t
  use gravier_interface_problem, only: interface_field_t, make_field, chain_differences, load_transpose, dot_field
  use gravier_interface_cg, only: interface_cg_t
  use gravier_interface_direct, only: interface_direct_t
  use gravier_simulation, only: simulation_t
  use gravier_test_simulations, only: make_lattice, iterate, same_bits
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  character(len=*), parameter :: keys = "&solver method = 'nscdd' /"
  type(communicator_t), target :: comm, alone
  integer :: dimension, k
  real(dp), parameter :: directions(*) = [0.0_dp, 0.5_dp, 20.0_dp]

  call start_parallel()
  call comm%init()
  call alone%init(MPI_COMM_SELF)
  do dimension = 2, 3
    call test_multipliers(dimension)
    call test_operator(dimension)
    do k = 1, size(directions)
      call test_solutions(dimension, 0.3_dp, directions(k))
    end do
    call test_solutions(dimension, 0.0_dp, directions(3))
    call test_any_ranks(dimension, 1.0_dp)
    call test_closed_form(dimension)
  end do
  call test_limits()
  call test_no_interface()
  call finish_checks()
  call alone%free()
  call comm%free()
  call stop_parallel()

contains

  !> A problem with shared masses, impulses, and its matrices.
  subroutine prepare(over, dimension, n_subdomains, friction, l, sim, matrix)
    type(communicator_t), target, intent(in) :: over
    integer, intent(in) :: dimension, n_subdomains
    real(dp), intent(in) :: friction, l
    type(simulation_t), intent(inout) :: sim
    type(enriched_matrix_t), intent(inout) :: matrix
    type(error_t), allocatable :: error
    logical :: changed

    call make_lattice(over, dimension, n_subdomains, friction, keys, sim)
    call iterate(sim, 2)
    matrix%direction%value = l
    call matrix%start(sim%problem, error)
    call matrix%update(sim%problem, changed, error)
    call check(.not. allocated(error), "matrices")
  end subroutine prepare

  !> Body values that differ from copy to copy, into body_work.
  subroutine fill(problem, trial, matrix)
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: trial
    type(enriched_matrix_t), intent(inout) :: matrix
    integer :: s, b, d

    do s = 1, size(problem%sub)
      matrix%part(s)%body_work(:, :) = 0.0_dp
      do b = 1, problem%sub(s)%n_bodies
        do d = 1, problem%nv
          matrix%part(s)%body_work(d, b) = copy_of(problem%sub(s)%id(b), problem%sub(s)%subdomain, d, trial)
        end do
      end do
    end do
  end subroutine fill

  pure real(dp) function copy_of(id, subdomain, d, trial)
    integer(i8), intent(in) :: id
    integer, intent(in) :: subdomain, d, trial
    copy_of = 2*hash_uniform(20 + trial, 100*id + subdomain, d) - 1.0_dp
  end function copy_of

  !> f := A y of random body values.
  subroutine make_random(problem, trial, matrix, f)
    type(contact_problem_t), intent(inout) :: problem
    integer, intent(in) :: trial
    type(enriched_matrix_t), intent(inout) :: matrix
    type(interface_field_t), allocatable, intent(out) :: f(:)

    call make_field(problem%shared, f)
    call fill(problem, trial, matrix)
    call chain_differences(problem%shared, matrix, f)
  end subroutine make_random

  !> A ties each copy to the next of the chain: the value of a sharer less that of the next one, the same on both sides;
  !> A^T takes it back, (A y) . f = y . (A^T f) over all copies.
  subroutine test_multipliers(dimension)
    integer, intent(in) :: dimension
    type(simulation_t) :: sim
    type(enriched_matrix_t) :: matrix
    type(interface_field_t), allocatable :: f(:), g(:)
    real(dp), allocatable :: part(:)
    real(dp) :: upper, lower, scalar
    integer :: s, k, d, at, most
    logical :: right

    call prepare(comm, dimension, 9, 0.3_dp, 1.0_dp, sim, matrix)
    call make_random(sim%problem, 1, matrix, f)
    call make_random(sim%problem, 2, matrix, g)
    right = .true.
    most = 1
    do s = 1, size(f)
      associate (part => sim%problem%shared%part(s), sub => sim%problem%sub(s))
        do k = 1, part%n_shared
          most = max(most, part%multiplicity(k))
          at = part%first(k) + part%copy_rank(k) - 1
          do d = 1, sim%problem%nv
            upper = 0.0_dp
            lower = 0.0_dp
            if (part%copy_rank(k) < part%multiplicity(k)) upper = copy_of(sub%id(part%body(k)), sub%subdomain, d, 1) - &
              & copy_of(sub%id(part%body(k)), part%sharer(at + 1), d, 1)
            if (part%copy_rank(k) > 1) lower = copy_of(sub%id(part%body(k)), part%sharer(at - 1), d, 1) - &
              & copy_of(sub%id(part%body(k)), sub%subdomain, d, 1)
            right = right .and. abs(f(s)%upper(d, k) - upper) <= 2*epsilon(1.0_dp)
            right = right .and. abs(f(s)%lower(d, k) - lower) <= 2*epsilon(1.0_dp)
          end do
        end do
      end associate
    end do
    call check(right, "differences along the chains")
    call check(comm%highest(real(most, dp)) > 2.5_dp, "chains of three copies and more")
    ! the sides of a multiplier have the same bits
    call check_sides(sim%problem, f)
    ! body_work := A^T g, against random values 1
    allocate (part(size(f)), source=0.0_dp)
    do s = 1, size(f)
      call load_transpose(sim%problem%shared, s, g(s), matrix)
      associate (sub => sim%problem%sub(s))
        do k = 1, sub%n_bodies
          do d = 1, sim%problem%nv
            part(s) = part(s) + matrix%part(s)%body_work(d, k)*copy_of(sub%id(k), sub%subdomain, d, 1)
          end do
        end do
      end associate
    end do
    scalar = dot_field(sim%problem, f, g)
    ! some thousand terms of size 1
    call check_close(comm%sum_real(part), scalar, 1000*epsilon(1.0_dp), "A and A^T are adjoint")
    call matrix%free()
    call sim%free()
  end subroutine test_multipliers

  !> Whether both subdomains of a multiplier hold it with the same bits.
  subroutine check_sides(problem, f)
    type(contact_problem_t), intent(inout) :: problem
    type(interface_field_t), intent(in) :: f(:)
    integer :: s, k, at
    logical :: same

    do s = 1, size(f)
      associate (part => problem%shared%part(s))
        do k = 1, part%n_slots
          part%send(:, k) = f(s)%upper(:, part%slot_shared(k))
        end do
      end associate
    end do
    call problem%shared%pass()
    same = .true.
    do s = 1, size(f)
      associate (part => problem%shared%part(s))
        do k = 1, part%n_shared
          at = part%first(k) + part%copy_rank(k) - 1
          if (part%copy_rank(k) == 1) then
            same = same .and. maxval(abs(f(s)%lower(:, k))) <= 0.0_dp
          else
            same = same .and. same_bits(f(s)%lower(:, k:k), part%recv(:, part%slot(at - 1):part%slot(at - 1)))
          end if
          if (part%copy_rank(k) == part%multiplicity(k)) same = same .and. maxval(abs(f(s)%upper(:, k))) <= 0.0_dp
        end do
      end associate
    end do
    call check(same, "both sides of a multiplier have the same bits")
  end subroutine check_sides

  !> xf := X f. Each part is made of tested ones.
  subroutine apply(problem, matrix, f, xf)
    type(contact_problem_t), intent(inout) :: problem
    type(enriched_matrix_t), intent(inout) :: matrix
    type(interface_field_t), intent(in) :: f(:)
    type(interface_field_t), allocatable, intent(out) :: xf(:)
    type(error_t), allocatable :: error
    integer :: s

    do s = 1, size(f)
      call load_transpose(problem%shared, s, f(s), matrix)
      call matrix%solve(problem%sub(s), s, matrix%part(s)%body_work, error)
    end do
    call make_field(problem%shared, xf)
    call chain_differences(problem%shared, matrix, xf)
    call check(.not. allocated(error), "X f")
  end subroutine apply

  !> X is symmetric and positive definite.
  subroutine test_operator(dimension)
    integer, intent(in) :: dimension
    type(simulation_t) :: sim
    type(enriched_matrix_t) :: matrix
    type(interface_field_t), allocatable :: f(:), g(:), xf(:), xg(:)
    real(dp) :: fxg, gxf

    call prepare(comm, dimension, 9, 0.3_dp, 3.0_dp, sim, matrix)
    call make_random(sim%problem, 1, matrix, f)
    call make_random(sim%problem, 2, matrix, g)
    call apply(sim%problem, matrix, f, xf)
    call apply(sim%problem, matrix, g, xg)
    fxg = dot_field(sim%problem, f, xg)
    gxf = dot_field(sim%problem, g, xf)
    call check_close(fxg, gxf, 1.0e-11_dp*dot_field(sim%problem, f, xf), "X is symmetric")
    call check(dot_field(sim%problem, f, xf) > 0.0_dp, "X is positive")
    call check(dot_field(sim%problem, g, xg) > 0.0_dp, "X is positive for another field")
    call matrix%free()
    call sim%free()
  end subroutine test_operator

  !> Largest difference of two fields, relative to the largest value of the first. Collective.
  real(dp) function distance(problem, a, b)
    type(contact_problem_t), intent(in) :: problem
    type(interface_field_t), intent(in) :: a(:), b(:)
    real(dp) :: sizes(2)
    integer :: s

    sizes(:) = 0.0_dp
    do s = 1, size(a)
      if (size(a(s)%upper) == 0) cycle
      sizes(1) = max(sizes(1), maxval(abs(a(s)%upper - b(s)%upper)), maxval(abs(a(s)%lower - b(s)%lower)))
      sizes(2) = max(sizes(2), maxval(abs(a(s)%upper)))
    end do
    call problem%comm%highest_of(sizes)
    distance = sizes(1)/sizes(2)
  end function distance

  !> Both solutions of X F = b with b = X f come back to f, and agree. The conjugate gradient stops at 1e-14 |b|: with a
  !> condition of some thousand of X, F is good to 1e-10 at least. The direct one is refined, and good to all digits that
  !> b has: 1e-16 times the condition.
  subroutine test_solutions(dimension, friction, l)
    integer, intent(in) :: dimension
    real(dp), intent(in) :: friction, l
    type(simulation_t) :: sim
    type(enriched_matrix_t) :: matrix
    type(interface_direct_t) :: direct
    type(interface_cg_t) :: cg
    type(interface_field_t), allocatable :: f(:), b(:), by_cg(:), by_factors(:)
    type(error_t), allocatable :: error

    call prepare(comm, dimension, 9, friction, l, sim, matrix)
    call make_random(sim%problem, 1, matrix, f)
    call apply(sim%problem, matrix, f, b)
    call make_field(sim%problem%shared, by_factors)
    call make_field(sim%problem%shared, by_cg)
    call direct%prepare(sim%problem, matrix, error)
    call direct%solve(sim%problem, matrix, b, by_factors, error)
    call check(.not. allocated(error), "direct solution")
    cg%tolerance = 1.0e-14_dp
    call cg%prepare(sim%problem, matrix, error)
    call cg%solve(sim%problem, matrix, b, by_cg, error)
    call check(.not. allocated(error), "iterative solution")
    call check_close(distance(sim%problem, by_factors, by_cg), 0.0_dp, 1.0e-10_dp, "direct and iterative solution")
    call check_close(distance(sim%problem, f, by_factors), 0.0_dp, 1.0e-12_dp, "direct solution")
    call check_sides(sim%problem, by_factors)
    call check_sides(sim%problem, by_cg)
    if (l > 0.0_dp) then
      call check(cg%iterations > 1, "iterations of the conjugate gradient")
    else
      ! relative to its diagonal, X has the eigenvalues of chains of m links, 1 - cos(k pi/m): some ten different ones
      call check(cg%iterations <= 12, "iterations of the conjugate gradient at l = 0")
    end if
    call check_equal(direct%factor%factorisations, 1_i8, "factorisations of X")
    ! the same matrix once more, and the solution as a guess
    call direct%prepare(sim%problem, matrix, error)
    call check_equal(direct%factor%factorisations, 1_i8, "the same X is not factorised again")
    cg%iterations = 0
    cg%tolerance = 1.0e-8_dp
    call cg%solve(sim%problem, matrix, b, by_cg, error)
    call check_equal(cg%iterations, 0_i8, "a guess that is the solution")
    call direct%free()
    call cg%free()
    call matrix%free()
    call sim%free()
  end subroutine test_solutions

  !> The solutions have the bits that one rank alone finds: the direct one, being refined beyond working precision, and the
  !> conjugate gradient, whose scalar products are exact.
  subroutine test_any_ranks(dimension, l)
    integer, intent(in) :: dimension
    real(dp), intent(in) :: l
    type(interface_field_t), allocatable :: f(:), g(:), f_alone(:), g_alone(:)
    integer :: s, first
    logical :: same(2)

    call solve_over(comm, dimension, l, f, g)
    call solve_over(alone, dimension, l, f_alone, g_alone)
    first = comm%first_subdomain(comm%rank, 9)
    same(:) = .true.
    do s = 1, size(f)
      same(1) = same(1) .and. same_bits(f(s)%upper, f_alone(first + s - 1)%upper)
      same(2) = same(2) .and. same_bits(g(s)%upper, g_alone(first + s - 1)%upper)
    end do
    call check(same(1), "direct solution: the bits of one rank alone")
    call check(same(2), "conjugate gradient: the bits of one rank alone")
  end subroutine test_any_ranks

  !> Solve for a random right-hand side, by factors and by conjugate gradient.
  subroutine solve_over(over, dimension, l, f, g)
    type(communicator_t), target, intent(in) :: over
    integer, intent(in) :: dimension
    real(dp), intent(in) :: l
    type(interface_field_t), allocatable, intent(out) :: f(:), g(:)
    type(simulation_t) :: sim
    type(enriched_matrix_t) :: matrix
    type(interface_direct_t) :: direct
    type(interface_cg_t) :: cg
    type(interface_field_t), allocatable :: b(:)
    type(error_t), allocatable :: error

    call prepare(over, dimension, 9, 0.3_dp, l, sim, matrix)
    call make_random(sim%problem, 4, matrix, b)
    call make_field(sim%problem%shared, f)
    call make_field(sim%problem%shared, g)
    call direct%prepare(sim%problem, matrix, error)
    call direct%solve(sim%problem, matrix, b, f, error)
    call cg%solve(sim%problem, matrix, b, g, error)
    call check(.not. allocated(error), "solutions over any ranks")
    call direct%free()
    call matrix%free()
    call sim%free()
  end subroutine solve_over

  !> With l = 0 the solution of X F = sum A M~^-1 (R + R^d) makes V - M~^-1 A^T F the mean of the copies (paper, (11)).
  subroutine test_closed_form(dimension)
    integer, intent(in) :: dimension
    type(simulation_t) :: sim
    type(enriched_matrix_t) :: matrix
    type(interface_direct_t) :: direct
    type(interface_field_t), allocatable :: b(:), f(:)
    type(error_t), allocatable :: error
    real(dp) :: mean, velocity
    integer :: s, k, d, j
    logical :: right

    call prepare(comm, dimension, 9, 0.3_dp, 0.0_dp, sim, matrix)
    call make_random(sim%problem, 5, matrix, b)
    call make_field(sim%problem%shared, f)
    call direct%prepare(sim%problem, matrix, error)
    call direct%solve(sim%problem, matrix, b, f, error)
    call check(.not. allocated(error), "closed form")
    right = .true.
    do s = 1, size(f)
      associate (part => sim%problem%shared%part(s), sub => sim%problem%sub(s))
        do k = 1, part%n_shared
          do d = 1, sim%problem%nv
            mean = 0.0_dp
            do j = part%first(k), part%first(k + 1) - 1
              mean = mean + copy_of(sub%id(part%body(k)), part%sharer(j), d, 5)
            end do
            mean = mean/part%multiplicity(k)
            velocity = copy_of(sub%id(part%body(k)), sub%subdomain, d, 5) - &
              & sub%weight(min(d, sim%problem%nw), part%body(k))*(f(s)%upper(d, k) - f(s)%lower(d, k))
            right = right .and. abs(velocity - mean) <= 100*epsilon(1.0_dp)
          end do
        end do
      end associate
    end do
    call check(right, "l = 0: the mean of the copies")
    call direct%free()
    call matrix%free()
    call sim%free()
  end subroutine test_closed_form

  !> A conjugate gradient that may not go on says so; one with nothing to solve does nothing.
  subroutine test_limits()
    type(simulation_t) :: sim
    type(enriched_matrix_t) :: matrix
    type(interface_cg_t) :: cg
    type(interface_field_t), allocatable :: b(:), f(:)
    type(error_t), allocatable :: error
    integer :: s

    call prepare(comm, 2, 9, 0.3_dp, 20.0_dp, sim, matrix)
    call make_random(sim%problem, 1, matrix, b)
    call make_field(sim%problem%shared, f)
    cg%max_iterations = 3
    call cg%solve(sim%problem, matrix, b, f, error)
    call check(allocated(error), "too few iterations are an error on every rank")
    if (allocated(error)) call check_equal(error%status, status_failure, "status of too few iterations")
    call check_equal(cg%iterations, 3_i8, "iterations until the limit")
    if (allocated(error)) deallocate (error)
    do s = 1, size(b)
      b(s)%upper(:, :) = 0.0_dp
      b(s)%lower(:, :) = 0.0_dp
      f(s)%upper(:, :) = 0.0_dp
      f(s)%lower(:, :) = 0.0_dp
    end do
    call cg%free()
    call cg%solve(sim%problem, matrix, b, f, error)
    call check(.not. allocated(error) .and. cg%iterations == 0, "nothing to solve")
    call matrix%free()
    call sim%free()
  end subroutine test_limits

  !> One subdomain has no interface, and nothing is solved.
  subroutine test_no_interface()
    type(simulation_t) :: sim
    type(enriched_matrix_t) :: matrix
    type(interface_direct_t) :: direct
    type(interface_cg_t) :: cg
    type(interface_field_t), allocatable :: b(:), f(:)
    type(error_t), allocatable :: error

    call prepare(comm, 2, 1, 0.3_dp, 1.0_dp, sim, matrix)
    call make_field(sim%problem%shared, f)
    call make_field(sim%problem%shared, b)
    call direct%prepare(sim%problem, matrix, error)
    call direct%solve(sim%problem, matrix, b, f, error)
    call cg%prepare(sim%problem, matrix, error)
    call cg%solve(sim%problem, matrix, b, f, error)
    call check(.not. allocated(error), "no interface, no error")
    call check_equal(direct%iterations + cg%iterations, 0_i8, "no interface, no iteration")
    call check_close(dot_field(sim%problem, f, f), 0.0_dp, 0.0_dp, "no interface, no multiplier")
    call direct%free()
    call matrix%free()
    call sim%free()
  end subroutine test_no_interface

end program test_interface
