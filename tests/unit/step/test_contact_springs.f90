!> The springs of compliant contacts while they are packed, after a solve, and their energy, on one contact between a grain and what
!> cannot move.
program test_contact_springs
  use gravier_kinds, only: dp
  use gravier_effects, only: effects_t
  use gravier_contact_spring, only: spring_t, spring_step_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_contact_data, only: lanes
  use gravier_neighbour_list, only: pair_memory_t
  use gravier_halo, only: halo_t
  use gravier_physics, only: physics_t
  use gravier_contact_springs, only: pack_spring, conclude_springs, spring_energies
  use gravier_impulse_memory, only: memory_of
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  real(dp), parameter :: rounding = 1.0e-13_dp, h = 0.1_dp, gap = -0.02_dp
  !> of the grain: 2 kg, and a spin that its lever of 0.5 m turns into a tangential velocity
  real(dp), parameter :: mass = 2.0_dp, lever = 0.5_dp
  integer :: dimension

  do dimension = 2, 3
    call test_contact(dimension)
  end do
  call finish_checks()

contains

  !> One contact of a grain with a plane below it, n upwards.
  subroutine make_contact(dimension, problem, halo)
    integer, intent(in) :: dimension
    type(contact_problem_t), intent(out) :: problem
    type(halo_t), intent(out) :: halo
    type(pair_memory_t) :: memory

    call problem%choose_kernels(dimension, effects_t(friction=.true., compliance=.true.))
    memory = memory_of(problem%kernels, .true., .false., .false., .false.)
    call check_equal(memory%n_spring, merge(1, 3, dimension == 2), "entries of an elongation")
    allocate (problem%sub(1), halo%view(1))
    associate (sub => problem%sub(1), kernels => problem%kernels, row => problem%row, list => halo%view(1)%list)
      call list%init(.false., 1)
      call list%add(1, -1, 0)
      call list%finish([1], memory)
      sub%n_contacts = 1
      sub%n_grains = 1
      sub%n_bodies = 1
      sub%n_columns = 2
      allocate (sub%pair(2, lanes), source=1)
      sub%pair(2, 1) = 2
      allocate (sub%hot(lanes, kernels%nh, 1), sub%impulse(lanes, kernels%nc, 1), source=0.0_dp)
      allocate (sub%inverse_mass(kernels%nw, 2), sub%v_global(kernels%nv, 2), source=0.0_dp)
      sub%inverse_mass(1:dimension, 1) = 1.0_dp/mass
      allocate (sub%spring(1))
      sub%gap = [gap]
      sub%source = [1]
      sub%hot(1, dimension, 1) = 1.0_dp
      sub%hot(1, row%lever_i, 1) = lever
      sub%hot(1, row%friction, 1) = 0.5_dp
    end associate
  end subroutine make_contact

  subroutine test_contact(dimension)
    integer, intent(in) :: dimension
    type(contact_problem_t) :: problem
    type(halo_t) :: halo
    type(physics_t) :: physics
    type(spring_t) :: spring
    type(spring_step_t) :: expected
    real(dp) :: law(2), velocity(dimension), energies(2, 2), v(dimension), kept(3), carried(2)
    integer :: d

    call make_contact(dimension, problem, halo)
    physics%h = h
    physics%theta = 0.5_dp
    spring = spring_t(stiffness=[800.0_dp, 300.0_dp], damping=0.2_dp, tangential_damping=0.5_dp, weight=0.5_dp)
    velocity(:) = 0.3_dp
    velocity(1) = -0.4_dp
    expected%spring = spring
    expected%velocity(1:dimension) = velocity
    ! 1/W_nn is the mass; nothing turns
    call expected%damp(1.0_dp/mass, h, gap)
    associate (sub => problem%sub(1), row => problem%row, list => halo%view(1)%list)
      call pack_spring(list, spring_t(), problem%kernels, physics, 1, velocity, sub)
      call check(.not. sub%yields(1), "a rigid contact")
      call check_close(sub%overlap(yielding=.false.), -gap, 0.0_dp, "overlap of a rigid contact")
      call check_close(maxval(abs(sub%hot(1, row%compliance_n:row%compliance_t, 1))), 0.0_dp, 0.0_dp, "has no compliance")
      ! the tangents of n = (0, 1) and (0, 0, 1): t = (-1, 0) and t = (1, 0, 0), s = (0, 1, 0)
      list%spring(1, 1) = 0.01_dp
      if (dimension == 3) list%spring(2, 1) = -0.02_dp
      call pack_spring(list, spring, problem%kernels, physics, 1, velocity, sub)
      call check(sub%yields(1), "a compliant contact")
      call check_close(sub%overlap(yielding=.false.) + abs(sub%overlap(yielding=.true.) + gap), 0.0_dp, 0.0_dp, "its deformation")
      call check_close(sub%stiffest, h*sqrt(400.0_dp), rounding, "step times frequency")
      law(:) = expected%law(1, h, gap)
      call check_close(sub%hot(1, row%compliance_n, 1), law(1), rounding, "normal compliance")
      call check_close(sub%hot(1, row%shift, 1), law(2), rounding, "normal shift")
      law(:) = expected%law(2, h, 0.01_dp)
      call check_close(sub%hot(1, row%compliance_t, 1), law(1), rounding, "tangential compliance")
      call check_close(sub%hot(1, row%shift_t, 1), law(2), rounding, "shift along t")
      if (dimension == 3) law(:) = expected%law(3, h, -0.02_dp)
      if (dimension == 3) call check_close(sub%hot(1, row%shift_s, 1), law(2), rounding, "shift along s")
      ! a length out of the tangent plane is brought into it, and not lost
      if (dimension == 3) then
        list%spring(:, 1) = [0.0_dp, 0.03_dp, 0.04_dp]
        call pack_spring(list, spring, problem%kernels, physics, 1, velocity, sub)
        law(:) = expected%law(3, h, 0.05_dp)
        call check_close(sub%hot(1, row%shift_s, 1), law(2), rounding, "the length of an elongation stays")
      end if

      ! after a solve: v of the contact, r
      sub%v_global(1:dimension, 1) = 0.2_dp
      sub%impulse(1, :, 1) = 0.7_dp
      v(:) = 0.2_dp
      if (dimension == 2) v(2) = -0.2_dp
      call conclude_springs(problem, h, halo%view)
      kept(:) = 0.0_dp
      do d = 2, dimension
        kept(d - 1) = expected%elongation(d, h, 0.7_dp, v(d), slides=.true.)
      end do
      call check_close(maxval(abs(list%spring(:, 1) - kept(1:size(list%spring, 1)))), 0.0_dp, rounding, "elongations are kept")
      call check(list%keeps(1), "a pair with an elongation is kept")
      call spring_energies(problem, 1, halo%view, physics, energies)
      call check_close(energies(1, 1), 400.0_dp*(gap - 0.5_dp*h*velocity(1))**2*merge(1.0_dp, 0.0_dp, gap < 0.5_dp*h*velocity(1)), &
        & rounding, "normal energy at the start")
      call check_close(energies(2, 1), 150.0_dp*sum((sub%spring(1)%stretch(:dimension - 1) - 0.5_dp*h*velocity(2:))**2)* &
        & merge(1.0_dp, 0.0_dp, gap < 0.5_dp*h*velocity(1)), 10*rounding, "tangential energy at the start")
      call check_close(energies(1, 2), 400.0_dp*max(0.0_dp, -gap - 0.5_dp*h*0.2_dp)**2, rounding, "normal energy at the end")
      do d = 2, dimension
        carried(d - 1) = expected%carried(d, h, 0.7_dp, v(d), slides=.true.)
      end do
      call check_close(energies(2, 2), 150.0_dp*sum(carried(1:dimension - 1)**2), 10*rounding, "tangential energy where it slides")
      ! where it sticks, from what it was packed with on: the bodies have moved on, whatever the force is
      sub%hot(1, row%friction, 1) = 2.0_dp
      call conclude_springs(problem, h, halo%view)
      kept(1:2) = sub%spring(1)%stretch
      kept(1:dimension - 1) = kept(1:dimension - 1) + h*v(2:)
      call check_close(maxval(abs(list%spring(:, 1) - kept(1:size(list%spring, 1)))), 0.0_dp, rounding, &
        & "a contact that sticks is stretched by what its bodies move")
      call spring_energies(problem, 1, halo%view, physics, energies)
      call check_close(energies(2, 2), 150.0_dp*sum((kept(1:dimension - 1) - 0.5_dp*h*v(2:))**2), 10*rounding, &
        & "tangential energy where it sticks")
      sub%impulse(:, :, :) = 0.0_dp
      call conclude_springs(problem, h, halo%view)
      call check_close(maxval(abs(list%spring)), 0.0_dp, 0.0_dp, "a contact that carries nothing forgets")
      ! the bodies met half a step before q_m
      call pack_spring(list, spring, problem%kernels, physics, 1, velocity, sub)
      law(:) = expected%law(2, h, gap/velocity(1)*velocity(2))
      call check_close(sub%hot(1, row%shift_t, 1), law(2), rounding, "shift along t of bodies that meet")
    end associate
  end subroutine test_contact

end program test_contact_springs
