!> The contact problem and what judges it: velocities of the undivided bodies, the residual and the jump do not depend on
!> the decomposition. Impulses and velocities follow from identifiers, so that every decomposition has the same.
program test_contact_problem
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_is_nan, ieee_quiet_nan
  use, intrinsic :: ieee_exceptions, only: ieee_get_halting_mode, ieee_invalid
  use gravier_kinds, only: dp, i8
  use gravier_random_hash, only: hash_uniform
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_contact_problem, only: contact_problem_t
  use gravier_simulation, only: simulation_t
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_test_contact_columns, only: contact_column, put_contact_column, pack_columns, pack_pairs
  use gravier_test_simulations, only: make_lattice
  use gravier_check, only: check, check_close, check_equal, finish_checks
  use gravier_contact_operator, only: find_local_operator
  implicit none

  !> Values of the bodies of a subdomain (nv, n_columns).
  type :: shared_field_t
    real(dp), allocatable :: values(:, :)
  end type shared_field_t

  type(communicator_t), target :: comm
  integer :: dimension, k
  integer, parameter :: counts(*) = [2, 3, 9]

  call start_parallel()
  call comm%init()
  do dimension = 2, 3
    do k = 1, size(counts)
      call test_against_one(dimension, counts(k), 0.3_dp)
      call test_against_one(dimension, counts(k), 0.0_dp)
    end do
    call test_masses(dimension, 0.3_dp)
    call test_masses(dimension, 0.0_dp)
    call test_jump(dimension)
    call test_no_impulse(dimension)
    call test_attractions(dimension)
  end do
  call test_not_finite()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> Impulses that follow from the pair, in the cone of friction.
  subroutine set_impulses(problem)
    type(contact_problem_t), intent(inout) :: problem
    real(dp) :: impulse(problem%nc)
    integer :: s, c, d
    integer(i8) :: pair

    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do c = 1, sub%n_contacts
          pair = 1000*sub%id(sub%pair(1, c)) + sub%id(sub%pair(2, c))
          impulse(1) = max(0.0_dp, hash_uniform(4, pair, 1) - 0.3_dp)
          do d = 2, problem%nc
            impulse(d) = 0.2_dp*impulse(1)*(hash_uniform(4, pair, d) - 0.5_dp)
          end do
          call put_contact_column(impulse, c, sub%impulse)
        end do
      end associate
    end do
  end subroutine set_impulses

  !> Velocities and residual of several subdomains against those of one. Differences are roundings: each velocity is a sum
  !> of some ten terms of size up to 1/m = 2 (disks) or 20 (spheres).
  subroutine test_against_one(dimension, n_subdomains, friction)
    integer, intent(in) :: dimension, n_subdomains
    real(dp), intent(in) :: friction
    real(dp), parameter :: rounding = 1.0e-12_dp
    type(simulation_t) :: one, many
    real(dp) :: residual(2), defect(2)
    real(dp), allocatable :: velocity(:, :), other(:, :)
    integer :: s
    logical :: same

    call make_lattice(comm, dimension, 1, friction, "&solver method = 'nscdd' /", one)
    call make_lattice(comm, dimension, n_subdomains, friction, "&solver method = 'nscdd' /", many)
    call check_equal(many%problem%n_contacts, one%problem%n_contacts, "contacts")
    call set_impulses(one%problem)
    call set_impulses(many%problem)
    ! masses that a method shares out do not count
    do s = 1, size(many%problem%sub)
      call many%problem%sub(s)%share_masses(many%problem%kernels, .true.)
    end do
    call one%problem%evaluate()
    call one%problem%residual(residual(1), defect(1))
    call many%problem%evaluate()
    call many%problem%residual(residual(2), defect(2))
    call check(residual(1) > 0.1_dp, "a residual to speak of")
    call check_close(residual(2), residual(1), rounding*residual(1), "residual")
    call check_close(defect(2), defect(1), rounding*defect(1), "defect")
    call gather_velocities(one%problem, int(one%n_grains), velocity, same)
    call gather_velocities(many%problem, int(many%n_grains), other, same)
    call check(same, "one velocity in all copies, bit for bit")
    call check_close(maxval(abs(other - velocity)), 0.0_dp, rounding, "velocities of the undivided bodies")
    call check_close(square_of(many%problem), square_of(one%problem), rounding*square_of(one%problem), "square of the velocities")
    call check(one%problem%any_impulse(), "some impulse in one subdomain")
    call check(many%problem%any_impulse(), "some impulse in several subdomains")
    call one%free()
    call many%free()
  end subroutine test_against_one

  !> (V, V)_M over all subdomains.
  real(dp) function square_of(problem)
    type(contact_problem_t), intent(in) :: problem
    real(dp) :: parts(size(problem%sub))
    integer :: s

    do s = 1, size(parts)
      parts(s) = problem%sub(s)%product_of(problem%sub(s)%v_global, problem%sub(s)%v_global)
    end do
    square_of = comm%sum_real(parts)
  end function square_of

  !> Attractions as loads, and the impulses on bodies without them: velocities are the same from both, and the reactions are those
  !> of the impulses that are left. What is asked changes nothing of the problem as it was solved.
  subroutine test_attractions(dimension)
    integer, intent(in) :: dimension
    !> as the roundings of `test_against_one`
    real(dp), parameter :: rounding = 1.0e-12_dp
    real(dp), parameter :: load = 0.125_dp
    type(simulation_t) :: sim
    type(shared_field_t), allocatable :: expected(:)
    real(dp) :: free(3), p(dimension)
    integer :: s, b, c, d, k
    logical :: same, alike, as_loads

    call make_lattice(comm, dimension, 3, 0.3_dp, "&solver method = 'nscdd' /", sim)
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s))
        call check(.not. allocated(sub%attraction_load), "no attraction_load without attractions")
        allocate (sub%attraction(size(sub%hot, 1), size(sub%hot, 3)), source=0.0_dp)
        do c = 1, sub%n_contacts
          sub%attraction(lane_of(c), block_of(c)) = load
        end do
      end associate
    end do
    allocate (expected(size(sim%problem%sub)))
    do s = 1, size(sim%problem%sub)
      expected(s)%values = sim%problem%sub(s)%v_free
    end do
    call sim%problem%load_attraction()
    as_loads = .true.
    alike = .true.
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s))
        alike = alike .and. .not. any(abs(sub%impulse) > 0.0_dp)
        do b = 1, sub%n_bodies
          do d = 1, dimension
            free(1) = sub%free_velocity(d, b)
            as_loads = as_loads .and. abs(free(1) - expected(s)%values(d, b)) <= rounding
          end do
        end do
      end associate
    end do
    call check(alike, "a load is no impulse")
    call check(as_loads, "free velocities without attractions")
    call set_impulses(sim%problem)
    call sim%problem%evaluate()
    same = .true.
    alike = .true.
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s), found => expected(s)%values)
        found(:, :) = 0.0_dp
        do c = 1, sub%n_contacts
          ! the normal part alone is less, and the vector with it
          alike = alike .and. abs(sub%normal_impulse(c) - (sub%impulse(lane_of(c), 1, block_of(c)) - load)) <= 0.0_dp
          call sim%problem%impulse_on_candidate(s, c, p)
          alike = alike .and. abs(dot_product(p, sub%hot(lane_of(c), 1:dimension, block_of(c))) - sub%normal_impulse(c)) <= rounding
          alike = alike .and. abs(sum(p**2) - sub%normal_impulse(c)**2 - &
            & sum(sub%impulse(lane_of(c), 2:dimension, block_of(c))**2)) <= rounding
          do k = 1, 2
            found(1:dimension, sub%pair(k, c)) = found(1:dimension, sub%pair(k, c)) + (3 - 2*k)*p
          end do
        end do
        do b = 1, sub%n_bodies
          do d = 1, dimension
            same = same .and. abs(sub%free_velocity(d, b) + sub%inverse_mass(d, b)*sub%contact_reaction(d, b) - &
              & sub%v_global(d, b)) <= rounding
            ! a body of one subdomain has no other reaction
            if (sub%multiplicity(b) == 1) same = same .and. abs(found(d, b) - sub%contact_reaction(d, b)) <= rounding
          end do
        end do
      end associate
    end do
    call check(alike, "impulses on candidates without attractions")
    call check(same, "velocities and reactions without attractions")
    call sim%free()
  end subroutine test_attractions

  !> v_global of every grain in contact, on all ranks, and whether all its copies have the same bits.
  subroutine gather_velocities(problem, n_grains, velocity, same)
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: n_grains
    real(dp), allocatable, intent(out) :: velocity(:, :)
    logical, intent(out) :: same
    real(dp), allocatable :: lowest(:, :)
    integer :: s, b, d

    allocate (velocity(problem%nv, n_grains), lowest(problem%nv, n_grains), source=-huge(1.0_dp))
    do s = 1, size(problem%sub)
      do b = 1, problem%sub(s)%n_bodies
        associate (g => problem%sub(s)%id(b))
          do d = 1, problem%nv
            velocity(d, g) = max(velocity(d, g), problem%sub(s)%v_global(d, b))
            lowest(d, g) = max(lowest(d, g), -problem%sub(s)%v_global(d, b))
          end do
        end associate
      end do
    end do
    same = .true.
    do b = 1, n_grains
      call comm%highest_of(velocity(:, b))
      call comm%highest_of(lowest(:, b))
      if (velocity(1, b) < -0.5_dp*huge(1.0_dp)) velocity(:, b) = 0.0_dp
      if (lowest(1, b) < -0.5_dp*huge(1.0_dp)) lowest(:, b) = 0.0_dp
      same = same .and. all(abs(velocity(:, b) + lowest(:, b)) <= 0.0_dp)
    end do
  end subroutine gather_velocities

  !> Shared masses: each copy has M/m, walls stay heavy, and the local operators follow, by the share of a step that is asked for.
  subroutine test_masses(dimension, friction)
    integer, intent(in) :: dimension
    real(dp), intent(in) :: friction
    type(simulation_t) :: sim
    integer :: s, b, c, round
    real(dp) :: factor, w(2), share(3)
    logical :: right

    call make_lattice(comm, dimension, 9, friction, "&solver method = 'nscdd' /", sim)
    right = .true.
    do round = 1, 3
      do s = 1, size(sim%problem%sub)
        associate (sub => sim%problem%sub(s))
          call sub%share_masses(sim%problem%kernels, round == 2)
          do b = 1, sub%n_columns
            factor = 1.0_dp
            if (round == 2 .and. b <= sub%n_bodies) factor = sub%multiplicity(b)
            right = right .and. all(abs(sub%weight(:, b) - factor*sub%inverse_mass(:, b)) <= &
              & 2*epsilon(1.0_dp)*sub%weight(:, b))
          end do
          share(:) = 1.0_dp
          if (round == 3) then
            share(:) = [0.9_dp, 0.6_dp, 0.3_dp]
            call sub%update_local_operator(sim%problem%kernels, share)
          end if
          do c = 1, sub%n_contacts
            call find_local_operator(sim%problem%kernels, sub%pair, sub%hot, c, sub%weight, w)
            call compare_operator(sim%problem, s, c, w, right)
            right = right .and. abs(sub%hot(lane_of(c), dimension + 2, block_of(c))*w(1) - share(1)) <= 2*epsilon(1.0_dp)
            if (friction > 0.0_dp) right = right .and. &
              & abs(sub%hot(lane_of(c), dimension + 3, block_of(c))*w(2) - share(2)) <= 2*epsilon(1.0_dp)
          end do
        end associate
      end do
    end do
    call check(right, "masses and local operators")
    call sim%free()
  end subroutine test_masses

  !> W_aa is the change of v_a under a unit impulse r_a alone: H^T M^-1 H on the contact's own column.
  subroutine compare_operator(problem, s, c, w, right)
    type(contact_problem_t), intent(inout) :: problem
    integer, intent(in) :: s, c
    real(dp), intent(in) :: w(2)
    !> stays true where they agree
    logical, intent(inout) :: right
    real(dp) :: column(problem%nh, 1), unit(problem%nc, 1), v(problem%nc)
    real(dp), allocatable :: hot(:, :, :), impulse(:, :, :), change(:, :, :)
    integer, allocatable :: pair(:, :)
    integer :: d, nd, side, b

    nd = problem%nd
    associate (sub => problem%sub(s))
      call pack_pairs(sub%pair(:, c:c), pair)
      column(:, 1) = contact_column(sub%hot, c)
      call pack_columns(column, hot)
      do d = 1, problem%nc
        unit(:, :) = 0.0_dp
        unit(d, 1) = 1.0_dp
        call pack_columns(unit, impulse)
        sub%reaction(:, :) = 0.0_dp
        call problem%kernels%add_reaction(pair, hot, impulse, sub%reaction)
        do side = 1, 2
          b = sub%pair(side, c)
          sub%reaction(1:nd, b) = sub%weight(1:nd, b)*sub%reaction(1:nd, b)
          sub%reaction(nd + 1:, b) = sub%weight(problem%nw, b)*sub%reaction(nd + 1:, b)
        end do
        call pack_columns(unit, change)
        call problem%kernels%contact_velocity(pair, hot, sub%reaction, change)
        ! some roundings, relative to the largest entry; the other components do not move
        v(:) = contact_column(change, 1)
        v(d) = v(d) - w(min(d, 2))
        right = right .and. all(abs(v) <= 32*epsilon(1.0_dp)*w(2))
      end do
    end associate
  end subroutine compare_operator

  !> The jump is 0 where the copies agree, and the largest difference of translations over the velocity scale where one
  !> copy is moved off by a known amount; spins do not count.
  subroutine test_jump(dimension)
    integer, intent(in) :: dimension
    type(simulation_t) :: sim
    integer :: s, k

    call make_lattice(comm, dimension, 9, 0.3_dp, "&solver method = 'nscdd' /", sim)
    sim%problem%velocity_scale = 4.0_dp
    do s = 1, size(sim%problem%sub)
      sim%problem%sub(s)%velocity(:, :) = sim%problem%sub(s)%v_free
    end do
    call check_close(sim%problem%jump(), 0.0_dp, 0.0_dp, "no jump")
    do s = 1, size(sim%problem%sub)
      if (sim%problem%sub(s)%subdomain /= 5) cycle
      associate (part => sim%problem%shared%part(s), velocity => sim%problem%sub(s)%velocity)
        call check(part%n_shared > 1, "shared grains in subdomain 5")
        ! differences of 3-4-5: 5; and 2 elsewhere
        velocity(1, part%body(1)) = velocity(1, part%body(1)) + 3.0_dp
        velocity(2, part%body(1)) = velocity(2, part%body(1)) - 4.0_dp
        velocity(2, part%body(2)) = velocity(2, part%body(2)) + 2.0_dp
        do k = 1, part%n_shared
          velocity(dimension + 1:, part%body(k)) = 100.0_dp
        end do
      end associate
    end do
    ! a few roundings of numbers of size 5
    call check_close(sim%problem%jump(), 1.25_dp, 32*epsilon(1.0_dp), "a known jump")
    sim%problem%velocity_scale = 0.0_dp
    call check_close(sim%problem%jump(), 5.0_dp, 64*epsilon(1.0_dp), "a jump without a scale")
    call sim%free()
  end subroutine test_jump

  !> Without impulses the residual is relative to the force scale, and 0 where nothing wants to move.
  subroutine test_no_impulse(dimension)
    integer, intent(in) :: dimension
    type(simulation_t) :: sim
    real(dp) :: residual, defect
    integer :: s

    call make_lattice(comm, dimension, 3, 0.3_dp, "&solver method = 'nscdd' /", sim)
    call check(.not. sim%problem%any_impulse(), "no impulse")
    sim%problem%force_scale = 0.5_dp
    call sim%problem%evaluate()
    call sim%problem%residual(residual, defect)
    call check(defect > 0.0_dp, "grains that press each other")
    call check_close(residual, 2*defect, 0.0_dp, "residual without impulses")
    do s = 1, size(sim%problem%sub)
      sim%problem%sub(s)%v_free(:, :) = 0.0_dp
    end do
    call sim%problem%evaluate()
    call sim%problem%residual(residual, defect)
    call check_close(residual + defect, 0.0_dp, 0.0_dp, "residual of rest")
    call sim%free()
  end subroutine test_no_impulse

  !> One NaN makes the residual NaN on all ranks.
  subroutine test_not_finite()
    type(simulation_t) :: sim
    real(dp) :: residual, defect
    integer :: s
    logical :: halting

    ! builds for debugging stop at the first operation on a NaN
    call ieee_get_halting_mode(ieee_invalid, halting)
    if (halting) return
    call make_lattice(comm, 2, 4, 0.3_dp, "&solver method = 'nscdd' /", sim)
    call set_impulses(sim%problem)
    do s = 1, size(sim%problem%sub)
      if (sim%problem%sub(s)%subdomain == 4) sim%problem%sub(s)%impulse(1, 1, 1) = ieee_value(1.0_dp, ieee_quiet_nan)
    end do
    call sim%problem%evaluate()
    call sim%problem%residual(residual, defect)
    call check(ieee_is_nan(residual) .and. ieee_is_nan(defect), "residual of a NaN")
    call sim%free()
  end subroutine test_not_finite

end program test_contact_problem
