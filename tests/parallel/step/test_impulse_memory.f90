!> Impulses from one step to the next: contacts that persist start from what they had, in whatever subdomain they are now.
!> In scenes, all grains fly at one velocity, so that pairs persist while they cross subdomains.
program test_impulse_memory
  use gravier_effects, only: effects_t
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_random_hash, only: hash_uniform
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_motion, only: advance_position
  use gravier_contact_kernels, only: kernels_t, contact_tangents, lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  use gravier_neighbour_rule, only: rule_dual, rule_primal
  use gravier_decomposition, only: decomposition_t
  use gravier_halo, only: local_bodies_t, halo_t
  use gravier_physics, only: physics_t
  use gravier_interface, only: interface_statistics_t
  use gravier_problem_builder, only: build_problem
  use gravier_velocity_return, only: take_velocities
  use gravier_impulse_memory, only: impulse_entries, keep_impulses, recall_impulses, list_impulses
  use gravier_memory_carrying, only: carry_memory
  use gravier_config, only: config_t, parse_config
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_test_scenes, only: cloud_t, draw_number => draw, make_decomposition
  use gravier_test_contact_columns, only: contact_column, put_contact_column
  use gravier_check, only: check, check_equal, finish_checks
  implicit none
  character(len=*), parameter :: newline = new_line("a")
  !> walls of a lattice have the identifiers that follow the grains'
  integer, parameter :: most_walls = 5
  type(communicator_t), target :: comm
  integer :: dimension, axes
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
  do dimension = 2, 3
    do axes = 0, 2**dimension - 1
      call test_new_partition(dimension, axes, rule_dual)
    end do
    call test_new_partition(dimension, 0, rule_primal)
    call test_new_partition(dimension, 3, rule_primal)
  end do
  call test_turned_frames()
  call test_rolling()
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
    do s = 1, size(sim%decomposition%owned)
      associate (owned => sim%decomposition%owned(s))
        owned%velocity(:, :) = 0.0_dp
        owned%velocity(1, :) = 0.31_dp
        owned%velocity(2, :) = 0.17_dp
      end associate
    end do
  end subroutine make

  !> What the pair (i, j) is given: the normal impulse and a force along the contact of which the tangential part is taken,
  !> none for every fourth pair. In the plane the tangential impulse is `along(1)`.
  pure subroutine draw(i, j, normal, along)
    integer, intent(in) :: i, j
    real(dp), intent(out) :: normal, along(3)
    integer :: d
    integer(i8) :: pair

    pair = 10000_i8*i + j
    normal = hash_uniform(5, pair, 1)
    do d = 1, 3
      along(d) = hash_uniform(5, pair, 1 + d) - 0.5_dp
    end do
    if (mod(i + j, 4) > 0) return
    normal = 0.0_dp
    along(:) = 0.0_dp
  end subroutine draw

  !> Give every contact its impulse, and note who owns it.
  subroutine give_impulses(sim, owner)
    type(simulation_t), intent(inout) :: sim
    integer(i8), intent(inout), contiguous :: owner(:, :)
    real(dp) :: normal, along(3), t(3), u(3), impulse(3)
    integer :: s, c, i, j

    owner(:, :) = 0
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s), kernels => sim%problem%kernels)
        do c = 1, sub%n_contacts
          i = int(sub%id(sub%pair(1, c)))
          j = int(sub%id(sub%pair(2, c)))
          owner(i, j) = sub%subdomain
          call draw(i, j, normal, along)
          impulse(1) = normal
          impulse(2) = along(1)
          if (kernels%nc == 3) then
            call contact_tangents(sub%hot, c, t, u)
            impulse(2) = sum(along*t)
            impulse(3) = sum(along*u)
          end if
          call put_contact_column(impulse(1:kernels%nc), c, sub%impulse)
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
    call keep_impulses(sim%problem, sim%halo%view)
    call take_velocities(sim%decomposition, sim%physics, sim%problem)
    do s = 1, size(sim%decomposition%owned)
      associate (owned => sim%decomposition%owned(s))
        owned%position(:, :) = advance_position(owned%position, owned%velocity(1:dimension, :), sim%physics%h, 0.6_dp)
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
    real(dp), allocatable :: impulse(:), hot(:)
    integer :: s, c, i, j
    integer(i8) :: fresh
    logical :: same, zero

    same = .true.
    zero = .true.
    fresh = 0
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s), nc => sim%problem%nc)
        do c = 1, sub%n_contacts
          i = int(sub%id(sub%pair(1, c)))
          j = int(sub%id(sub%pair(2, c)))
          call draw(i, j, normal, along)
          impulse = contact_column(sub%impulse, c)
          if (owner(i, j) == 0 .or. .not. normal > 0.0_dp) then
            zero = zero .and. all(abs(impulse) <= 0.0_dp)
            if (owner(i, j) == 0) fresh = fresh + 1
            cycle
          end if
          if (owner(i, j) /= sub%subdomain) moved = moved + 1
          same = same .and. abs(impulse(1) - normal) <= 0.0_dp
          if (nc == 2) same = same .and. abs(impulse(2) - along(1)) <= 0.0_dp
          if (nc < 3) cycle
          call contact_tangents(sub%hot, c, t, u)
          hot = contact_column(sub%hot, c)
          difference(:) = impulse(2)*t + impulse(3)*u - (along - sum(along*hot(1:3))*hot(1:3))
          same = same .and. all(abs(difference) <= rounding)
        end do
      end associate
    end do
    call check(same, "contacts that persist start from their impulses")
    call check(zero, "contacts without an impulse start from zero")
    call check(comm%total(fresh) > 0, "some contacts are new")
  end subroutine check_recalled

  !> Impulses kept with the pairs of lists, and carried to the lists of a new partition after all grains have moved on: every
  !> pair that is still near has its own, and none is lost.
  subroutine test_new_partition(nd, axes, kind)
    integer, intent(in) :: nd, axes, kind
    type(cloud_t) :: cloud
    type(decomposition_t) :: decomposition, other
    type(halo_t) :: before, after
    integer(i8), allocatable :: owner(:, :)
    integer(i8) :: counts(3)
    integer :: s, k

    call cloud%init(nd, 220, 0.03_dp, 0.1_dp, 80 + nd)
    call cloud%make_periodic(axes)
    decomposition%rule = cloud%rule(0.02_dp, 0.04_dp, kind)
    call make_decomposition(comm, cloud, 7, nd, .false., decomposition)
    before%memory%n_impulse = 4
    call before%build(decomposition)
    allocate (owner(cloud%n, cloud%n), source=0_i8)
    call fill_lists(before, owner)
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        do k = 1, owned%n
          owned%position(1, k) = owned%position(1, k) + 0.3_dp
        end do
      end associate
    end do
    call before%refresh(decomposition)
    call make_decomposition(comm, cloud, 7, nd, .true., other)
    decomposition%partition = other%partition
    call decomposition%migrate()
    after%memory%n_impulse = 4
    call after%build(decomposition)
    call carry_memory(decomposition, before%view, after)
    call count_pairs(decomposition, after, owner, counts)
    call check(count(owner > 0) > 60, "new partition: enough pairs to tell")
    call check_equal(counts(1), 0_i8, "new partition: pairs with another impulse than theirs")
    call check_equal(counts(2), int(count(owner > 0), i8), "new partition: pairs that are still there")
    call check(counts(3) > 20, "new partition: pairs that belong to another subdomain now")
  end subroutine test_new_partition

  !> Give every pair of the lists its impulse, and note who owns it.
  subroutine fill_lists(halo, owner)
    type(halo_t), intent(inout) :: halo
    integer(i8), intent(inout), contiguous :: owner(:, :)
    integer :: s, p, e, i, j

    do s = 1, size(halo%view)
      associate (list => halo%view(s)%list, id => halo%view(s)%bodies%id)
        do p = 1, list%n
          i = int(id(list%candidate(p)))
          j = int(id(list%antagonist(p)))
          owner(i, j) = 100*(comm%rank + 1) + s
          do e = 1, 4
            list%impulse(e, p) = given(i, j, e)
          end do
        end do
      end associate
    end do
    do j = 1, size(owner, 2)
      call comm%sum_counts(owner(:, j))
    end do
  end subroutine fill_lists

  pure real(dp) function given(i, j, entry)
    integer, intent(in) :: i, j, entry
    given = draw_number(6, 1000*i + j, entry)
    if (entry > 1) given = given - 0.5_dp
  end function given

  !> Pairs whose impulse is wrong, that were there before, and of these the ones of another subdomain than before.
  subroutine count_pairs(decomposition, halo, owner, counts)
    type(decomposition_t), intent(in) :: decomposition
    type(halo_t), intent(in) :: halo
    integer(i8), intent(in) :: owner(:, :)
    integer(i8), intent(out) :: counts(3)
    integer :: s, p, e, i, j
    logical :: right

    counts(:) = 0
    do s = 1, size(halo%view)
      associate (list => halo%view(s)%list, id => halo%view(s)%bodies%id)
        do p = 1, list%n
          i = int(id(list%candidate(p)))
          j = int(id(list%antagonist(p)))
          right = .true.
          do e = 1, 4
            right = right .and. abs(list%impulse(e, p) - merge(given(i, j, e), 0.0_dp, owner(i, j) > 0)) <= 0.0_dp
          end do
          if (.not. right) counts(1) = counts(1) + 1
          if (owner(i, j) == 0) cycle
          counts(2) = counts(2) + 1
          if (owner(i, j) /= 100*(comm%rank + 1) + s) counts(3) = counts(3) + 1
        end do
      end associate
    end do
    call decomposition%comm%sum_counts(counts)
  end subroutine count_pairs

  !> While lists last, normals turn: what is recalled is the tangential vector that was kept, projected on the tangent plane
  !> of now. Contacts that were not there start from zero.
  subroutine test_turned_frames()
    type(cloud_t) :: cloud
    type(decomposition_t) :: decomposition
    type(halo_t) :: seen
    type(kernels_t) :: kernels
    type(physics_t) :: physics
    type(contact_problem_t) :: problem
    type(interface_statistics_t) :: figures
    real(dp), allocatable :: kept(:, :, :)
    integer :: s, k, d

    call cloud%init(3, 220, 0.03_dp, 0.1_dp, 91)
    decomposition%rule = cloud%rule(0.02_dp, 0.04_dp, rule_dual)
    call make_decomposition(comm, cloud, 5, 6, .false., decomposition)
    call kernels%choose(3, effects_t(friction=.true.))
    call check_equal(impulse_entries(kernels), 4, "entries of an impulse in space with friction")
    seen%memory%n_impulse = 4
    call seen%build(decomposition)
    call build_problem(decomposition, seen, kernels, physics, problem, figures)
    ! the tangential vector of each pair (3, candidate, antagonist)
    allocate (kept(3, cloud%n, cloud%n), source=0.0_dp)
    call set_tangential(problem, kept)
    call keep_impulses(problem, seen%view)
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        do k = 1, owned%n
          do d = 1, 3
            owned%position(d, k) = owned%position(d, k) + 0.02_dp*(draw_number(8, int(owned%id(k)), d) - 0.5_dp)
          end do
        end do
      end associate
    end do
    call check(.not. seen%are_due(decomposition), "turned frames: the lists last")
    call seen%refresh(decomposition)
    call build_problem(decomposition, seen, kernels, physics, problem, figures)
    call recall_impulses(seen%view, problem)
    call check_projected(problem, kept)
  end subroutine test_turned_frames

  !> Moments of spheres come back as they were kept, to a few roundings of numbers of size 1.
  subroutine test_rolling()
    type(cloud_t) :: cloud
    type(decomposition_t) :: decomposition
    type(halo_t) :: seen
    type(kernels_t) :: kernels
    type(physics_t) :: physics
    type(contact_problem_t) :: problem
    type(interface_statistics_t) :: figures
    real(dp), allocatable :: before(:, :, :)
    real(dp) :: impulse(6)
    integer :: s, c, e

    call cloud%init(3, 220, 0.03_dp, 0.1_dp, 91)
    decomposition%rule = cloud%rule(0.02_dp, 0.04_dp, rule_dual)
    call make_decomposition(comm, cloud, 5, 6, .false., decomposition)
    call kernels%choose(3, effects_t(friction=.true., rolling=.true.))
    call check_equal(impulse_entries(kernels), 7, "entries of an impulse in space with rolling")
    seen%memory%n_impulse = 7
    call seen%build(decomposition)
    call build_problem(decomposition, seen, kernels, physics, problem, figures)
    do s = 1, size(problem%sub)
      do c = 1, problem%sub(s)%n_contacts
        do e = 1, 6
          impulse(e) = 0.1_dp + hash_uniform(6, int(c, i8), e)
        end do
        call put_contact_column(impulse, c, problem%sub(s)%impulse)
      end do
    end do
    call keep_impulses(problem, seen%view)
    do s = 1, size(problem%sub)
      before = problem%sub(s)%impulse
      problem%sub(s)%impulse(:, :, :) = 0.0_dp
      call recall_impulses(seen%view, problem)
      call check(all(abs(problem%sub(s)%impulse - before) <= 32*epsilon(1.0_dp)), "forces and moments come back")
    end do
  end subroutine test_rolling

  subroutine set_tangential(problem, kept)
    type(contact_problem_t), intent(inout) :: problem
    real(dp), intent(inout) :: kept(:, :, :)
    real(dp) :: t(3), u(3), impulse(3)
    integer :: s, c, i, j, e

    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do c = 1, sub%n_contacts
          i = int(sub%id(sub%pair(1, c)))
          j = int(sub%id(sub%pair(2, c)))
          do e = 1, 3
            impulse(e) = given(i, j, e)
          end do
          call put_contact_column(impulse, c, sub%impulse)
          call contact_tangents(sub%hot, c, t, u)
          kept(:, i, j) = impulse(2)*t + impulse(3)*u
        end do
      end associate
    end do
  end subroutine set_tangential

  !> A few roundings of numbers of size 1.
  subroutine check_projected(problem, kept)
    type(contact_problem_t), intent(in) :: problem
    real(dp), intent(in) :: kept(:, :, :)
    real(dp) :: t(3), u(3), expected(3), found(3), impulse(problem%nc), hot(problem%nh)
    integer(i8) :: turned, fresh
    integer :: s, c, i, j
    logical :: right

    right = .true.
    turned = 0
    fresh = 0
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do c = 1, sub%n_contacts
          i = int(sub%id(sub%pair(1, c)))
          j = int(sub%id(sub%pair(2, c)))
          impulse(:) = contact_column(sub%impulse, c)
          hot(:) = contact_column(sub%hot, c)
          if (.not. any(abs(kept(:, i, j)) > 0.0_dp)) then
            right = right .and. all(abs(impulse) <= 0.0_dp)
            fresh = fresh + 1
            cycle
          end if
          call contact_tangents(sub%hot, c, t, u)
          found(:) = impulse(2)*t + impulse(3)*u
          expected(:) = kept(:, i, j) - sum(kept(:, i, j)*hot(1:3))*hot(1:3)
          right = right .and. norm2(found - expected) <= 32*epsilon(1.0_dp)
          right = right .and. abs(impulse(1) - given(i, j, 1)) <= 0.0_dp
          if (norm2(expected - kept(:, i, j)) > 1.0e-3_dp) turned = turned + 1
        end do
      end associate
    end do
    call check(right, "turned frames: tangential vectors projected, new contacts at zero")
    call check(comm%total(turned) > 20, "turned frames: enough contacts have turned")
    call check(comm%total(fresh) > 0, "turned frames: some contacts are new")
  end subroutine check_projected

  !> Nothing kept yet: nothing is recalled, nothing gathered; zeros are not gathered either, all others are.
  subroutine test_nothing_kept()
    type(simulation_t) :: sim
    type(step_figures_t) :: figures
    integer(i8) :: gathered
    integer :: s, c

    call make(2, 3, 0.3_dp, "partition = 'grid'", sim)
    call sim%assemble(figures)
    call recall_impulses(sim%halo%view, sim%problem)
    call check(.not. sim%problem%any_impulse(), "nothing kept, nothing recalled")
    call gather(sim, gathered)
    call check_equal(gathered, 0_i8, "zero impulses are not gathered")
    do s = 1, size(sim%problem%sub)
      do c = 1, sim%problem%sub(s)%n_contacts
        sim%problem%sub(s)%impulse(lane_of(c), 1, block_of(c)) = 1.0_dp
      end do
    end do
    call keep_impulses(sim%problem, sim%halo%view)
    call gather(sim, gathered)
    call check_equal(comm%total(gathered), sim%problem%n_contacts, "all impulses are gathered")
    call sim%free()
  end subroutine test_nothing_kept

  !> The records of all pairs of this rank that keep something.
  subroutine gather(sim, n)
    type(simulation_t), intent(in) :: sim
    integer(i8), intent(out) :: n
    integer(i8), allocatable :: records(:, :)
    integer, allocatable :: kept(:)
    integer :: s

    n = 0
    do s = 1, size(sim%halo%view)
      call sim%halo%view(s)%list%find_kept(kept)
      call list_impulses(sim%halo%view(s), 0, kept, records)
      call check_equal(size(records, 1), 4, "words of a record")
      n = n + size(records, 2)
    end do
  end subroutine gather

end program test_impulse_memory
