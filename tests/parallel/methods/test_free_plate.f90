!> A plate that is free along one axis only, shared between subdomains and pushed by grains: all methods find the same
!> velocities, and no component of inverse mass zero moves or stops a run.
module free_plate
  use gravier_effects, only: effects_t
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_random_hash, only: hash_uniform
  use gravier_communicator, only: communicator_t
  use gravier_shared_exchange, only: shared_part_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  use gravier_method, only: method_t
  use gravier_enriched_matrix, only: enriched_matrix_t
  use gravier_nlgs, only: nlgs_t
  use gravier_nscdd, only: nscdd_t
  use gravier_schwarz, only: schwarz_t, relaxation_t
  use gravier_schwarz_ec, only: schwarz_ec_t
  use gravier_nscdd_ep, only: nscdd_ep_t
  use gravier_interface_direct, only: interface_direct_t
  use gravier_interface_cg, only: interface_cg_t
  use gravier_solve, only: solve_contacts
  use gravier_solve_report, only: solve_control_t, solve_report_t, solve_converged
  use gravier_test_contact_columns, only: pack_columns, pack_pairs
  use gravier_check, only: check, check_close, check_equal
  implicit none
  private
  public :: comm, alone, test_methods, test_matrix
  !> grains in a row, one above the other in pairs: the lower ones on the plate; three subdomains along the row
  integer, parameter :: n_columns = 9, n_grains = 2*n_columns, n_parts = 3, plate = n_grains + 1
  type(communicator_t), target :: comm, alone

contains

  !> The problem in `n_subdomains` (1 or 3). The plate is free along the last axis and driven along the first one.
  subroutine make(over, dimension, n_subdomains, friction, problem)
    type(communicator_t), target, intent(in) :: over
    integer, intent(in) :: dimension, n_subdomains
    real(dp), intent(in) :: friction
    type(contact_problem_t), intent(out) :: problem
    type(shared_part_t), allocatable :: part(:)
    integer :: s, first, last

    problem%comm => over
    call problem%choose_kernels(dimension, effects_t(friction=friction > 0.0_dp))
    problem%n_subdomains = n_subdomains
    first = over%first_subdomain(over%rank, n_subdomains)
    last = over%first_subdomain(over%rank + 1, n_subdomains) - 1
    allocate (problem%sub(last - first + 1), part(last - first + 1))
    do s = first, last
      call make_part(problem, s, friction, problem%sub(s - first + 1), part(s - first + 1))
    end do
    call problem%shared%init(over, part, n_subdomains, problem%nv)
    problem%n_contacts = 4*n_columns - 2
    problem%force_scale = 1.0_dp
    problem%rounded_scale = 1.0_dp
    problem%velocity_scale = 1.0_dp
  end subroutine make

  !> Contacts of one subdomain: of grain k of the lower row with the plate, with grain k of the upper row, and of both with
  !> the next of their row, in the subdomain of column k.
  subroutine make_part(problem, subdomain, friction, sub, part)
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: subdomain
    real(dp), intent(in) :: friction
    type(subproblem_t), intent(inout) :: sub
    type(shared_part_t), intent(inout) :: part
    real(dp), allocatable :: hot(:, :), impulse(:, :)
    integer, allocatable :: pair(:, :)
    integer :: number_of(plate), pairs(2, 4*n_columns), c, k, n, g, b, d, nd, first, last, n_sharers

    nd = problem%nd
    first = 1 + (subdomain - 1)*n_columns/problem%n_subdomains
    last = subdomain*n_columns/problem%n_subdomains
    n = 0
    do k = first, last
      call add(k, plate)
      call add(n_columns + k, k)
      if (k == n_columns) cycle
      call add(k + 1, k)
      call add(n_columns + k + 1, n_columns + k)
    end do
    number_of(:) = 0
    do c = 1, n
      number_of(pairs(:, c)) = 1
    end do
    sub%subdomain = subdomain
    sub%n_bodies = sum(number_of)
    sub%n_columns = sub%n_bodies
    sub%n_contacts = n
    allocate (sub%id(sub%n_bodies), sub%owner(sub%n_bodies), sub%multiplicity(sub%n_bodies))
    allocate (sub%v_free(problem%nv, sub%n_bodies), source=0.0_dp)
    allocate (sub%velocity, sub%v_global, sub%reaction, mold=sub%v_free)
    allocate (sub%inverse_mass(problem%nw, sub%n_bodies), source=0.0_dp)
    allocate (sub%weight, mold=sub%inverse_mass)
    allocate (pair(2, n), hot(problem%nh, n), impulse(problem%nc, n), sub%gap(n))
    part%subdomain = subdomain
    allocate (part%body(plate), part%first(plate + 1), part%sharer(n_parts*plate), source=1)
    n_sharers = 0
    b = 0
    do g = 1, plate
      if (number_of(g) == 0) cycle
      b = b + 1
      number_of(g) = b
      sub%id(b) = g
      sub%owner(b) = subdomain
      call share(g, b)
      do d = 1, nd
        sub%v_free(d, b) = 2*hash_uniform(1, int(g, i8), d) - 1.0_dp
      end do
      if (g == plate) then
        sub%v_free(:, b) = 0.0_dp
        sub%v_free(1, b) = 0.3_dp
        sub%inverse_mass(nd, b) = 0.4_dp
      else
        sub%v_free(nd, b) = sub%v_free(nd, b) - 1.0_dp
        sub%inverse_mass(1:nd, b) = 1.0_dp + hash_uniform(2, int(g, i8), 1)
        if (problem%nw > nd) sub%inverse_mass(nd + 1, b) = 2.5_dp*sub%inverse_mass(1, b)
      end if
    end do
    hot(:, :) = 0.0_dp
    impulse(:, :) = 0.0_dp
    sub%gap(:) = 0.0_dp
    do c = 1, n
      pair(:, c) = number_of(pairs(:, c))
      call set_contact(pairs(:, c), hot(:, c))
    end do
    call pack_pairs(pair, sub%pair)
    call pack_columns(hot, sub%hot)
    call pack_columns(impulse, sub%impulse)

  contains

    subroutine add(i, j)
      integer, intent(in) :: i, j
      n = n + 1
      pairs(1, n) = i
      pairs(2, n) = j
    end subroutine add

    !> The subdomains that body `g` has contacts in: that of its column and that of the one before.
    subroutine share(g, b)
      integer, intent(in) :: g, b
      integer :: s, column
      logical :: here

      column = g - merge(n_columns, 0, g > n_columns)
      sub%multiplicity(b) = 0
      do s = 1, problem%n_subdomains
        here = g == plate .or. s == owned(column, problem%n_subdomains) .or. s == owned(max(column - 1, 1), problem%n_subdomains)
        if (here) sub%multiplicity(b) = sub%multiplicity(b) + 1
        if (here) part%sharer(n_sharers + sub%multiplicity(b)) = s
      end do
      if (sub%multiplicity(b) == 1) return
      n_sharers = n_sharers + sub%multiplicity(b)
      part%n_shared = part%n_shared + 1
      part%body(part%n_shared) = b
      part%first(part%n_shared + 1) = n_sharers + 1
    end subroutine share

    !> Normals near the axis of a row or of a column, oblique to the axis along which the plate is free.
    subroutine set_contact(ij, hot)
      integer, intent(in) :: ij(2)
      real(dp), intent(inout) :: hot(:)
      integer :: d

      do d = 1, nd
        hot(d) = 0.9_dp*(hash_uniform(3, int(100*ij(1) + ij(2), i8), d) - 0.5_dp)
      end do
      if (ij(2) == plate .or. ij(1) == ij(2) + n_columns) then
        hot(nd) = 1.0_dp
      else
        hot(1) = 1.0_dp
      end if
      hot(1:nd) = hot(1:nd)/norm2(hot(1:nd))
      if (problem%nc == 1) return
      hot(nd + 4) = 0.8_dp
      if (ij(2) /= plate) hot(nd + 5) = 0.8_dp
      hot(nd + 6) = friction
    end subroutine set_contact

  end subroutine make_part

  !> Subdomain of a column.
  pure integer function owned(column, n_subdomains)
    integer, intent(in) :: column, n_subdomains
    owned = 1 + (column - 1)*n_subdomains/n_columns
  end function owned

  subroutine test_methods(dimension, friction)
    integer, intent(in) :: dimension
    real(dp), intent(in) :: friction
    type(contact_problem_t) :: problem
    type(nlgs_t) :: nlgs
    type(nscdd_t) :: nscdd
    type(schwarz_t) :: schwarz
    type(schwarz_ec_t) :: schwarz_ec
    type(nscdd_ep_t) :: direct, cg
    real(dp) :: wanted(6, plate)
    character(len=:), allocatable :: name
    integer :: s

    name = to_text(dimension)//"D, friction "//to_text(friction)//": "
    call make(alone, dimension, 1, friction, problem)
    call solve(problem, nlgs, name//"nlgs")
    call gather(problem, wanted)
    call check_close(wanted(1, plate), 0.3_dp, 0.0_dp, name//"the plate keeps its speed along the axis it is driven on")
    call check(wanted(dimension, plate) < -0.1_dp, name//"the plate gives way along its free axis")
    ! 3 copies with the whole mass each: loads go a part of the way
    schwarz%relaxation = relaxation_t(0.4_dp, automatic=.false.)
    schwarz_ec%relaxation = relaxation_t(0.4_dp, automatic=.false.)
    ! with friction, the iterates of NSCDD-EP settle only where l follows the active contacts
    direct%matrix%direction%active_only = .true.
    direct%matrix%direction%value = 30.0_dp
    cg%matrix%direction = direct%matrix%direction
    allocate (interface_direct_t :: direct%interface_solver)
    allocate (interface_cg_t :: cg%interface_solver)
    call compare(nscdd, "nscdd")
    call compare(schwarz, "schwarz")
    do s = 1, size(schwarz%load)
      associate (load => schwarz%load(s)%value, part => problem%shared%part(s))
        call check_close(maxval(abs(load(1:dimension - 1, part%n_shared))), 0.0_dp, 0.0_dp, &
          & name//"no loads where the plate is held")
      end associate
    end do
    call compare(schwarz_ec, "schwarz_ec")
    call compare(direct, "nscdd_ep")
    call compare(cg, "nscdd_ep, conjugate gradient")

  contains

    !> Three subdomains against one, twice: the second solve starts from the impulses of the first.
    subroutine compare(method, word)
      class(method_t), intent(inout) :: method
      character(len=*), intent(in) :: word
      real(dp) :: found(6, plate)
      integer :: round

      call make(comm, dimension, n_parts, friction, problem)
      do round = 1, 2
        if (round == 2) call disturb(problem)
        call solve(problem, method, name//word)
        call gather(problem, found)
        call check_close(maxval(abs(found - wanted)), 0.0_dp, 1.0e-8_dp, name//word//": velocities of one domain")
      end do
      call method%free()
    end subroutine compare

  end subroutine test_methods

  !> (M + H l H^T) y = b, with b made from a y that is zero where nothing moves: found again whatever b is there.
  subroutine test_matrix(dimension, friction)
    integer, intent(in) :: dimension
    real(dp), intent(in) :: friction
    type(contact_problem_t) :: problem
    type(enriched_matrix_t) :: matrix
    type(error_t), allocatable :: error
    real(dp), allocatable :: y(:, :), b(:, :), force(:, :), v(:, :, :)
    integer :: s, g, d
    logical :: changed

    call make(comm, dimension, n_parts, friction, problem)
    do s = 1, size(problem%sub)
      call problem%sub(s)%share_masses(problem%kernels, .true.)
    end do
    call matrix%start(problem, error)
    call matrix%update(problem, changed, error)
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        allocate (y, b, force, mold=sub%v_free)
        allocate (v, mold=sub%impulse)
        do g = 1, sub%n_bodies
          do d = 1, problem%nv
            y(d, g) = merge(2*hash_uniform(9, sub%id(g), d) - 1.0_dp, 0.0_dp, sub%moves(d, g))
          end do
          b(:, g) = y(:, g)
          call sub%multiply_mass(g, b(:, g))
        end do
        call problem%kernels%contact_velocity(sub%pair, sub%hot, y, v)
        v(:, :, :) = matrix%part(s)%direction*v
        force(:, :) = 0.0_dp
        call problem%kernels%add_reaction(sub%pair, sub%hot, v, force)
        b(:, :) = b + force
        call matrix%solve(problem%sub(s), s, b, error)
        call check_close(maxval(abs(b - y)), 0.0_dp, 1.0e-13_dp, "matrix of a plate that is held along some axes")
        deallocate (y, b, force, v)
      end associate
    end do
    call check(.not. allocated(error), "matrices of a plate that is held along some axes")
    call matrix%free()
  end subroutine test_matrix

  !> Move all impulses off the solution.
  subroutine disturb(problem)
    type(contact_problem_t), intent(inout) :: problem
    integer :: s
    do s = 1, size(problem%sub)
      problem%sub(s)%impulse(:, :, :) = 1.1_dp*problem%sub(s)%impulse
    end do
  end subroutine disturb

  subroutine solve(problem, method, name)
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(inout) :: method
    character(len=*), intent(in) :: name
    type(solve_control_t) :: control
    type(solve_report_t) :: report
    type(error_t), allocatable :: error

    method%sweeps = 5
    control%tolerance = 1.0e-12_dp
    control%max_iterations = 3000
    call solve_contacts(problem, method, control, report, error)
    call check(.not. allocated(error), name//": no error")
    call check_equal(report%status, solve_converged, name//": converges")
  end subroutine solve

  !> v_global of every body, on all ranks.
  subroutine gather(problem, velocity)
    type(contact_problem_t), intent(inout) :: problem
    real(dp), intent(out) :: velocity(6, plate)
    integer :: s, b

    call problem%evaluate()
    velocity(:, :) = -huge(1.0_dp)
    do s = 1, size(problem%sub)
      do b = 1, problem%sub(s)%n_bodies
        velocity(1:problem%nv, problem%sub(s)%id(b)) = problem%sub(s)%v_global(:, b)
      end do
    end do
    do b = 1, plate
      call problem%comm%highest_of(velocity(:, b))
    end do
    velocity(problem%nv + 1:, :) = 0.0_dp
  end subroutine gather

end module free_plate

program test_free_plate
  use mpi_f08, only: MPI_COMM_SELF
  use gravier_communicator, only: start_parallel, stop_parallel
  use gravier_check, only: finish_checks
  use gravier_kinds, only: dp
  use free_plate, only: comm, alone, test_methods, test_matrix
  implicit none
  integer :: dimension

  call start_parallel()
  call comm%init()
  call alone%init(MPI_COMM_SELF)
  do dimension = 2, 3
    call test_matrix(dimension, 0.0_dp)
    call test_matrix(dimension, 0.2_dp)
    ! what is sent depends on the number of components of a velocity: two ranks send the fewest and the most, four ranks the most
    if (comm%size == 1 .or. (comm%size == 2 .and. dimension == 2)) call test_methods(dimension, 0.0_dp)
    if (comm%size == 1 .or. dimension == 3) call test_methods(dimension, 0.2_dp)
  end do
  call finish_checks()
  call alone%free()
  call comm%free()
  call stop_parallel()
end program test_free_plate
