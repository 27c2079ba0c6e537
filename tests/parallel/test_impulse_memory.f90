!> Impulses from one step to the next: contacts that persist start from what they had, in whatever subdomain they are now.
!> All grains fly at one velocity, so that pairs persist while they cross subdomains.
program test_impulse_memory
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_random_hash, only: hash_uniform
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_motion, only: advance_position
  use gravier_contact_kernels, only: tangents
  use gravier_problem_builder, only: take_velocities
  use gravier_impulse_memory, only: impulse_memory_t
  use gravier_config, only: config_t, parse_config
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_check, only: check, check_equal, finish_checks
  implicit none
  character(len=*), parameter :: newline = new_line("a")
  !> walls of a lattice have the identifiers that follow the grains'
  integer, parameter :: most_walls = 5
  type(communicator_t), target :: comm
  integer :: dimension
  !> contacts that moved to another subdomain
  integer(i8) :: moved

  call start_parallel()
  call comm%init()
  do dimension = 2, 3
    moved = 0
    call test_persistence(dimension, 1, 0.3_dp, "partition = 'grid'")
    call check_equal(comm%total(moved), 0_i8, "one subdomain: none to move to")
    call test_persistence(dimension, 7, 0.3_dp, "partition = 'grid'")
    call test_persistence(dimension, 7, 0.0_dp, "partition = 'grid'")
    call test_persistence(dimension, 7, 0.3_dp, "partition = 'metis'")
    call test_persistence(dimension, 7, 0.3_dp, "partition = 'grid', kind = 'primal'")
    call test_persistence(dimension, 7, 0.3_dp, "partition = 'metis', repartition_every = 1")
    call check(comm%total(moved) > 20, "contacts move to other subdomains")
  end do
  call test_nothing_kept()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  subroutine make(dimension, n_subdomains, friction, decomposition, sim)
    integer, intent(in) :: dimension, n_subdomains
    real(dp), intent(in) :: friction
    character(len=*), intent(in) :: decomposition
    type(simulation_t), intent(inout) :: sim
    type(config_t) :: config
    type(error_t), allocatable :: error
    character(len=:), allocatable :: lattice
    integer :: s

    lattice = "lattice_count = 9, 8, gravity = 0, 0"
    if (dimension == 3) lattice = "lattice_count = 5, 4, 4, gravity = 0, 0, 0"
    call parse_config("lattice", "&scene dimension = "//to_text(dimension)//", bodies = 'lattice', "//lattice// &
      & ", radius_min = 0.05, radius_max = 0.1, alert_distance = 0.07, friction = "//to_text(friction)//" /"//newline// &
      & "&time step = 0.5, steps = 2, theta = 0.6 / &solver method = 'nscdd' /"//newline// &
      & "&decomposition subdomains = "//to_text(n_subdomains)//", "//decomposition//" /", config, error)
    call check(.not. allocated(error), "configuration")
    call sim%init(comm, config, error)
    call check(.not. allocated(error), "scene")
    do s = 1, size(sim%decomposition%home)
      associate (home => sim%decomposition%home(s))
        home%velocity(:, :) = 0.0_dp
        home%velocity(1, :) = 0.31_dp
        home%velocity(2, :) = 0.17_dp
      end associate
    end do
  end subroutine make

  !> What the pair (i, j) is given: the normal impulse, none for every fourth pair, and a force along the contact of which
  !> the tangential part is taken. In the plane the tangential impulse is `along(1)`.
  pure subroutine draw(i, j, normal, along)
    integer, intent(in) :: i, j
    real(dp), intent(out) :: normal, along(3)
    integer :: d
    integer(i8) :: pair

    pair = 10000_i8*i + j
    normal = hash_uniform(5, pair, 1)
    if (mod(i + j, 4) == 0) normal = 0.0_dp
    do d = 1, 3
      along(d) = hash_uniform(5, pair, 1 + d) - 0.5_dp
    end do
  end subroutine draw

  !> Give every contact its impulse, and note who owns it.
  subroutine give_impulses(sim, owner)
    type(simulation_t), intent(inout) :: sim
    integer(i8), intent(inout), contiguous :: owner(:, :)
    real(dp) :: normal, along(3), t(3), u(3)
    integer :: s, c, i, j

    owner(:, :) = 0
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s), kernels => sim%problem%kernels)
        do c = 1, sub%n_contacts
          i = int(sub%id(sub%pair(1, c)))
          j = int(sub%id(sub%pair(2, c)))
          owner(i, j) = sub%subdomain
          call draw(i, j, normal, along)
          sub%impulse(1, c) = normal
          if (kernels%nc == 2) sub%impulse(2, c) = along(1)
          if (kernels%nc < 3) cycle
          call tangents(sub%hot(1:3, c), t, u)
          sub%impulse(2, c) = sum(along*t)
          sub%impulse(3, c) = sum(along*u)
        end do
        sub%v_global(:, :) = sub%v_free
      end associate
    end do
    do j = 1, size(owner, 2)
      call comm%sum_counts(owner(:, j))
    end do
  end subroutine give_impulses

  !> Two steps of the flight: what is kept at the end of the first is what the second starts from.
  subroutine test_persistence(dimension, n_subdomains, friction, decomposition)
    integer, intent(in) :: dimension, n_subdomains
    real(dp), intent(in) :: friction
    character(len=*), intent(in) :: decomposition
    type(simulation_t) :: sim
    type(error_t), allocatable :: error
    type(step_figures_t) :: figures
    integer(i8), allocatable :: owner(:, :)
    integer :: s

    call make(dimension, n_subdomains, friction, decomposition, sim)
    call sim%assemble(figures)
    allocate (owner(sim%n_grains, sim%n_grains + most_walls))
    call give_impulses(sim, owner)
    call check(count(owner > 0) > 50, "enough contacts to tell")
    ! what a step does after its solve
    call sim%memory%keep(sim%problem, sim%decomposition%walls, sim%decomposition%rule%kind, sim%physics%h, 0.6_dp)
    call take_velocities(sim%decomposition, sim%physics, sim%problem)
    do s = 1, size(sim%decomposition%home)
      associate (home => sim%decomposition%home(s))
        home%position(:, :) = advance_position(home%position, home%velocity(1:dimension, :), sim%physics%h, 0.6_dp)
      end associate
    end do
    sim%step = 1
    call sim%assemble(figures)
    call check(.not. allocated(error), "second step")
    call check_recalled(sim, owner)
    call sim%free()
  end subroutine test_persistence

  !> Contacts that were there start from their impulses, others from zero. The normal impulse, and the tangential one in
  !> the plane, are the same numbers. In space the tangential force is projected on the new tangent plane; centres are some
  !> 0.1 apart at places below 3, so that normals are off by 3 eps/0.1 and a few such errors add up.
  subroutine check_recalled(sim, owner)
    type(simulation_t), intent(in) :: sim
    integer(i8), intent(in) :: owner(:, :)
    real(dp), parameter :: rounding = 200*epsilon(1.0_dp)
    real(dp) :: normal, along(3), t(3), u(3), difference(3)
    integer :: s, c, i, j
    integer(i8) :: fresh
    logical :: same, zero

    same = .true.
    zero = .true.
    fresh = 0
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s), nc => sim%problem%kernels%nc)
        do c = 1, sub%n_contacts
          i = int(sub%id(sub%pair(1, c)))
          j = int(sub%id(sub%pair(2, c)))
          call draw(i, j, normal, along)
          if (owner(i, j) == 0 .or. .not. normal > 0.0_dp) then
            zero = zero .and. all(abs(sub%impulse(:, c)) <= 0.0_dp)
            if (owner(i, j) == 0) fresh = fresh + 1
            cycle
          end if
          if (owner(i, j) /= sub%subdomain) moved = moved + 1
          same = same .and. abs(sub%impulse(1, c) - normal) <= 0.0_dp
          if (nc == 2) same = same .and. abs(sub%impulse(2, c) - along(1)) <= 0.0_dp
          if (nc < 3) cycle
          call tangents(sub%hot(1:3, c), t, u)
          difference(:) = sub%impulse(2, c)*t + sub%impulse(3, c)*u - (along - sum(along*sub%hot(1:3, c))*sub%hot(1:3, c))
          same = same .and. all(abs(difference) <= rounding)
        end do
      end associate
    end do
    call check(same, "contacts that persist start from their impulses")
    call check(zero, "contacts without an impulse start from zero")
    call check(comm%total(fresh) > 0, "some contacts are new")
  end subroutine check_recalled

  !> Nothing kept yet: nothing is recalled, and a memory that was emptied gives nothing.
  subroutine test_nothing_kept()
    type(simulation_t) :: sim
    type(impulse_memory_t) :: memory
    type(step_figures_t) :: figures
    integer :: s

    call make(2, 3, 0.3_dp, "partition = 'grid'", sim)
    call sim%assemble(figures)
    call memory%recall(sim%decomposition, sim%problem)
    call check(.not. sim%problem%any_impulse(), "nothing kept, nothing recalled")
    call memory%keep(sim%problem, sim%decomposition%walls, sim%decomposition%rule%kind, 0.5_dp, 0.6_dp)
    call check_equal(size(memory%records, 2), 0, "zero impulses are not kept")
    call memory%recall(sim%decomposition, sim%problem)
    call check(.not. sim%problem%any_impulse(), "zeros kept, zeros recalled")
    do s = 1, size(sim%problem%sub)
      sim%problem%sub(s)%impulse(1, :) = 1.0_dp
      sim%problem%sub(s)%v_global(:, :) = 0.0_dp
    end do
    call memory%keep(sim%problem, sim%decomposition%walls, sim%decomposition%rule%kind, 0.5_dp, 0.6_dp)
    call check_equal(comm%total(size(memory%records, 2, kind=i8)), sim%problem%n_contacts, "all impulses are kept")
    call sim%free()
  end subroutine test_nothing_kept

end program test_impulse_memory
