!> The matrices M + H l H^T: search directions, solutions, what is factorised again, the recording sweeps.
program test_enriched_matrix
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_random_hash, only: hash_uniform
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_contact_problem, only: contact_problem_t
  use gravier_enriched_matrix, only: enriched_matrix_t
  use gravier_simulation, only: simulation_t
  use gravier_test_contact_columns, only: contact_column
  use gravier_test_simulations, only: make_lattice, iterate
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  character(len=*), parameter :: keys = "&solver method = 'nscdd', sweeps = 2 /"
  type(communicator_t), target :: comm
  integer :: dimension, k
  real(dp), parameter :: frictions(*) = [0.0_dp, 0.4_dp]

  call start_parallel()
  call comm%init()
  do dimension = 2, 3
    do k = 1, size(frictions)
      call test_solution(dimension, frictions(k), 5.0_dp, .true., .false.)
      call test_solution(dimension, frictions(k), 5.0_dp, .false., .false.)
      call test_solution(dimension, frictions(k), 1000.0_dp, .true., .true.)
      call test_solution(dimension, frictions(k), 0.0_dp, .true., .false.)
      call test_factorisations(dimension, frictions(k))
    end do
  end do
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> l of every component, and y = (M + H l H^T)^-1 b, put back into the matrix. For roundings relative to b the condition
  !> does not count: what is left is the backward error of the factorisation, some n roundings of |A| |y|.
  subroutine test_solution(dimension, friction, l, relative, active)
    integer, intent(in) :: dimension
    real(dp), intent(in) :: friction, l
    logical, intent(in) :: relative, active
    type(simulation_t) :: sim
    type(enriched_matrix_t) :: matrix
    type(error_t), allocatable :: error
    real(dp), allocatable :: y(:, :), b(:, :), v(:, :, :)
    real(dp) :: scale
    integer :: s, g, d, nv
    logical :: changed

    call make_lattice(comm, dimension, 9, friction, keys, sim)
    call iterate(sim, 10)
    matrix%direction%value = l
    matrix%direction%relative = relative
    matrix%direction%active_only = active
    call matrix%start(sim%problem, error)
    call matrix%update(sim%problem, changed, error)
    call check(.not. allocated(error), "matrices")
    nv = sim%problem%nv
    do s = 1, size(sim%problem%sub)
      call check_direction(sim%problem, s, l, relative, active, matrix)
      associate (sub => sim%problem%sub(s))
        allocate (y(nv, sub%n_columns), b(nv, sub%n_columns))
        allocate (v, mold=sub%impulse)
        do g = 1, sub%n_columns
          do d = 1, nv
            y(d, g) = 2*hash_uniform(9, sub%id(g), d) - 1.0_dp
          end do
        end do
        y(:, sub%n_bodies + 1:) = 0.0_dp
        ! b = M y + H l H^T y; what is pushed on walls is lost
        call sim%problem%kernels%contact_velocity(sub%pair, sub%hot, y, v)
        v(:, :, :) = matrix%part(s)%direction*v
        b(:, :) = 0.0_dp
        call sim%problem%kernels%add_reaction(sub%pair, sub%hot, v, b)
        do g = 1, sub%n_bodies
          do d = 1, nv
            b(d, g) = b(d, g) + y(d, g)/sub%weight(min(d, sim%problem%nw), g)
          end do
        end do
        scale = maxval(abs(b))
        b(:, sub%n_bodies + 1:) = 100.0_dp
        call matrix%solve(sim%problem%sub(s), s, b, error)
        ! M is above 0.4 kg (translation) or 5e-4 kg m^2 (spin): the error in y is the rounding of b over that
        call check_close(maxval(abs(b - y)), 0.0_dp, 1.0e5_dp*epsilon(1.0_dp)*max(scale, 1.0_dp), "solution; walls at rest")
        deallocate (y, b, v)
      end associate
    end do
    call check(.not. allocated(error), "solutions")
    call matrix%free()
    call sim%free()
  end subroutine test_solution

  !> l, or l/W_aa with the masses of the undivided bodies; on active contacts only: r_n > 0 for the normal component,
  !> |r_t| < mu r_n for the tangential ones.
  subroutine check_direction(problem, s, l, relative, active, matrix)
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: s
    real(dp), intent(in) :: l
    logical, intent(in) :: relative, active
    type(enriched_matrix_t), intent(in) :: matrix
    real(dp) :: expected(2), w(2), hot(problem%nh), impulse(problem%nc), found(problem%nc)
    integer :: c, d, closed, sliding, sticking
    logical :: right

    right = .true.
    closed = 0
    sliding = 0
    sticking = 0
    associate (sub => problem%sub(s), direction => matrix%part(s)%direction, kernels => problem%kernels)
      do c = 1, sub%n_contacts
        hot(:) = contact_column(sub%hot, c)
        impulse(:) = contact_column(sub%impulse, c)
        found(:) = contact_column(direction, c)
        expected(:) = l
        if (relative) then
          w(:) = sub%inverse_mass(1, sub%pair(1, c)) + sub%inverse_mass(1, sub%pair(2, c))
          if (kernels%nc > 1) w(2) = w(2) + sub%inverse_mass(kernels%nw, sub%pair(1, c))*hot(kernels%nd + 4)**2 + &
            & sub%inverse_mass(kernels%nw, sub%pair(2, c))*hot(kernels%nd + 5)**2
          expected(:) = l/w
        end if
        if (active) then
          if (impulse(1) <= 0.0_dp) then
            expected(:) = 0.0_dp
          else
            closed = closed + 1
            if (kernels%nc > 1) then
              if (norm2(impulse(2:)) >= hot(kernels%nh)*impulse(1)) then
                expected(2) = 0.0_dp
                sliding = sliding + 1
              else
                sticking = sticking + 1
              end if
            end if
          end if
        end if
        do d = 1, kernels%nc
          right = right .and. abs(found(d) - expected(min(d, 2))) <= 16*epsilon(1.0_dp)*expected(min(d, 2))
        end do
      end do
      call check(right, "search direction")
      if (active .and. sub%n_contacts > 10) call check(closed > 0 .and. closed < sub%n_contacts, "open and closed contacts")
      if (active .and. kernels%nc > 1 .and. sub%n_contacts > 25) call check(sliding > 0 .and. sticking > 0, "sliding and sticking")
    end associate
  end subroutine check_direction

  !> Factorised once for a problem and its l; again where l is new or, with active contacts only, where those changed; not
  !> for a new start on the same problem.
  subroutine test_factorisations(dimension, friction)
    integer, intent(in) :: dimension
    real(dp), intent(in) :: friction
    type(simulation_t) :: sim
    type(enriched_matrix_t) :: matrix
    type(error_t), allocatable :: error
    integer(i8) :: mine
    integer :: s
    logical :: changed

    call make_lattice(comm, dimension, 9, friction, keys, sim)
    mine = 0
    do s = 1, size(sim%problem%sub)
      call sim%problem%sub(s)%share_masses(sim%problem%kernels, .true.)
      if (sim%problem%sub(s)%n_bodies > 0) mine = mine + 1
    end do
    call matrix%start(sim%problem, error)
    call matrix%update(sim%problem, changed, error)
    call expect(matrix, changed, mine, mine, mine > 0, "first")
    call matrix%update(sim%problem, changed, error)
    call expect(matrix, changed, mine, mine, .false., "again")
    call matrix%start(sim%problem, error)
    call matrix%update(sim%problem, changed, error)
    call expect(matrix, changed, mine, mine, .false., "a new start")
    matrix%direction%value = 2.0_dp
    call matrix%update(sim%problem, changed, error)
    call expect(matrix, changed, mine, 2*mine, mine > 0, "another l")
    ! no impulse: nothing is active, and l vanishes everywhere
    matrix%direction%active_only = .true.
    call matrix%update(sim%problem, changed, error)
    call expect(matrix, changed, mine, 3*mine, mine > 0, "active contacts")
    call matrix%update(sim%problem, changed, error)
    call expect(matrix, changed, mine, 3*mine, .false., "the same active contacts")
    do s = 1, size(sim%problem%sub)
      ! one contact of one subdomain becomes active
      if (s == 1 .and. sim%problem%sub(s)%n_contacts > 0) sim%problem%sub(s)%impulse(1, 1, 1) = 1.0_dp
    end do
    call matrix%update(sim%problem, changed, error)
    call expect(matrix, changed, mine, 3*mine + min(mine, 1_i8), mine > 0, "one more active contact")
    do s = 1, size(sim%problem%sub)
      call sim%problem%sub(s)%share_masses(sim%problem%kernels, .false.)
    end do
    call matrix%update(sim%problem, changed, error)
    call check(changed .or. mine == 0, "other masses: changed")
    call check(.not. allocated(error), "no error")
    call matrix%free()
    call sim%free()
  end subroutine test_factorisations

  subroutine expect(matrix, changed, analyses, factorisations, anew, name)
    type(enriched_matrix_t), intent(in) :: matrix
    logical, intent(in) :: changed, anew
    integer(i8), intent(in) :: analyses, factorisations
    character(len=*), intent(in) :: name
    integer(i8) :: found(2)

    call matrix%counts(found(1), found(2))
    call check_equal(found(1), analyses, name//": analyses")
    call check_equal(found(2), factorisations, name//": factorisations")
    call check(changed .eqv. anew, name//": changed")
  end subroutine expect

end program test_enriched_matrix
