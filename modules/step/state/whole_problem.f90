!> The contact problem of all bodies after a step that was solved without those that sleep: for diagnostics and files.
module gravier_whole_problem
  use gravier_kinds, only: dp, i8
  use gravier_sorting, only: argsort, find_sorted
  use gravier_shared_exchange, only: shared_exchange_t
  use gravier_boundary, only: boundary_words
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  use gravier_decomposition, only: decomposition_t
  use gravier_halo, only: halo_t
  use gravier_interface, only: interface_statistics_t
  use gravier_physics, only: physics_t
  use gravier_problem_builder, only: build_problem
  use gravier_boundary_loads, only: sum_boundary_impulses
  use gravier_impulse_memory, only: recall_impulses
  implicit none
  private
  public :: build_whole, make_whole, take_whole

  !> What is put aside of a view while its bodies count as awake: the laws are asked anew, and their pairs keep what they kept.
  type :: asleep_t
    real(dp), allocatable :: wakes_at(:)
    integer, allocatable :: watched(:), state(:, :)
  end type asleep_t

contains

  !> Build it from the views of the step, with the impulses that their pairs keep. Grains that were solved have the velocities of
  !> the solve, and those that sleep none: the impulses that they keep balance their loads only about. Collective.
  subroutine build_whole(decomposition, halo, physics, solved, whole)
    type(decomposition_t), intent(in) :: decomposition
    !> comes back as it was
    type(halo_t), intent(inout) :: halo
    type(physics_t), intent(in) :: physics
    type(contact_problem_t), intent(in) :: solved
    type(contact_problem_t), intent(inout) :: whole
    type(interface_statistics_t) :: ignored
    type(asleep_t) :: aside(size(halo%view))
    integer :: s

    do s = 1, size(halo%view)
      associate (view => halo%view(s))
        call move_alloc(view%bodies%wakes_at, aside(s)%wakes_at)
        allocate (view%bodies%wakes_at(view%n_bodies()), source=0.0_dp)
        call move_alloc(view%list%watched, aside(s)%watched)
        aside(s)%state = view%list%state
      end associate
    end do
    call build_problem(decomposition, halo, solved%kernels, physics, whole, ignored)
    ! a pair that keeps nothing was solved and carries nothing: the whole of its attraction pulls
    do s = 1, size(whole%sub)
      whole%sub(s)%impulse(:, :, :) = 0.0_dp
    end do
    call recall_impulses(halo%view, whole)
    call whole%evaluate()
    do s = 1, size(halo%view)
      call take_velocities(solved%sub(s), whole%sub(s))
      associate (view => halo%view(s))
        call move_alloc(aside(s)%wakes_at, view%bodies%wakes_at)
        call move_alloc(aside(s)%watched, view%list%watched)
        call move_alloc(aside(s)%state, view%list%state)
      end associate
    end do
  end subroutine build_whole

  !> Let the problem of all bodies take the place of the one that was solved, after a step: boundaries have moved on from where the
  !> views have the grains, and go back for it. Collective.
  subroutine make_whole(decomposition, halo, physics, boundary_impulses, problem, is_whole)
    !> comes back as it was
    type(decomposition_t), intent(inout) :: decomposition
    type(halo_t), intent(inout) :: halo
    type(physics_t), intent(in) :: physics
    !> of the contacts on each boundary (nd, boundaries) [N s]
    real(dp), allocatable, intent(inout) :: boundary_impulses(:, :)
    type(contact_problem_t), intent(inout) :: problem
    logical, intent(out) :: is_whole
    type(contact_problem_t) :: whole
    integer(i8) :: state(boundary_words, size(decomposition%boundaries))
    integer :: b

    do b = 1, size(decomposition%boundaries)
      call decomposition%boundaries(b)%get_state(state(:, b))
      call decomposition%boundaries(b)%move(-physics%theta*physics%h)
    end do
    call build_whole(decomposition, halo, physics, problem, whole)
    call sum_boundary_impulses(decomposition, whole, boundary_impulses)
    call take_whole(whole, problem, is_whole)
    do b = 1, size(decomposition%boundaries)
      call decomposition%boundaries(b)%set_state(state(:, b))
    end do
  end subroutine make_whole

  !> Velocities of the grains of a subdomain as they were solved; 0 of those that were left out.
  subroutine take_velocities(solved, whole)
    type(subproblem_t), intent(in) :: solved
    type(subproblem_t), intent(inout) :: whole
    integer(i8), allocatable :: id(:)
    integer, allocatable :: order(:)
    integer :: b, k

    allocate (order(solved%n_grains), id(solved%n_grains))
    call argsort(solved%id(1:solved%n_grains), order)
    do b = 1, solved%n_grains
      id(b) = solved%id(order(b))
    end do
    do b = 1, whole%n_grains
      k = find_sorted(id, whole%id(b))
      whole%v_global(:, b) = 0.0_dp
      if (k > 0) whole%v_global(:, b) = solved%v_global(:, order(k))
    end do
  end subroutine take_velocities

  !> Let the problem of all bodies take the place of the one that was solved.
  subroutine take_whole(whole, problem, is_whole)
    !> is left empty
    type(contact_problem_t), intent(inout) :: whole
    type(contact_problem_t), intent(inout) :: problem
    logical, intent(out) :: is_whole
    type(subproblem_t), allocatable :: sub(:)
    type(shared_exchange_t) :: shared

    call move_alloc(whole%sub, sub)
    call whole%shared%move_to(shared)
    call problem%shared%free()
    problem = whole
    call move_alloc(sub, problem%sub)
    call shared%move_to(problem%shared)
    is_whole = .true.
  end subroutine take_whole

end module gravier_whole_problem
