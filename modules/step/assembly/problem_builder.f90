!> From grains in their places to the packed contact problem of a step.
module gravier_problem_builder
  use gravier_kinds, only: dp
  use gravier_timers, only: start_timer, stop_timer, phase_detection, phase_interface, phase_setup
  use gravier_body_figures, only: body_figures_t
  use gravier_boundary, only: boundary_t
  use gravier_contact_kernels, only: kernels_t, lane_of, block_of
  use gravier_body_mass, only: inverse_of_translation
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  use gravier_decomposition, only: decomposition_t
  use gravier_halo, only: local_bodies_t, halo_t
  use gravier_physics, only: physics_t
  use gravier_narrow_phase, only: contact_list_t, find_contacts
  use gravier_contact_packing, only: numbers_t, pack_contacts
  use gravier_interface, only: interface_statistics_t, find_interface, count_figures
  implicit none
  private
  public :: build_problem

contains

  !> Find the contacts among the near pairs at the present places (q_m) and pack them, subdomain by subdomain. Impulses
  !> start from zero. Boundaries hold the velocities that they have at the end of the step as far as no contact acts on
  !> them. Collective.
  subroutine build_problem(decomposition, halo, kernels, physics, problem, figures)
    type(decomposition_t), intent(in) :: decomposition
    !> states of pairs are those of the step afterwards
    type(halo_t), intent(inout) :: halo
    type(kernels_t), intent(in) :: kernels
    type(physics_t), intent(in) :: physics
    type(contact_problem_t), intent(inout) :: problem
    type(interface_statistics_t), intent(out) :: figures
    type(contact_list_t) :: found
    integer :: s, b

    problem%comm => decomposition%comm
    call problem%take_kernels(kernels)
    problem%n_subdomains = decomposition%n_subdomains
    problem%cell = physics%cell
    if (allocated(problem%sub)) deallocate (problem%sub)
    allocate (problem%sub(size(halo%view)))
    do s = 1, size(problem%sub)
      associate (view => halo%view(s))
        call start_timer(phase_detection)
        call find_contacts(view, decomposition, physics, found)
        call stop_timer(phase_detection)
        call start_timer(phase_setup)
        problem%sub(s)%subdomain = decomposition%subdomain_of(s)
        call pack_subproblem(view, found, decomposition, kernels, physics, problem%sub(s))
        call stop_timer(phase_setup)
      end associate
    end do
    call start_timer(phase_interface)
    call find_interface(decomposition, problem)
    call count_figures(decomposition, halo%view, problem, figures)
    problem%attracts = physics%laws%attracts
    problem%carries = .false.
    do b = 1, merge(size(decomposition%boundaries), 0, physics%laws%breaks)
      problem%carries = problem%carries .or. decomposition%boundaries(b)%present .and. decomposition%boundaries(b)%is_moved()
    end do
    if (problem%attracts) call problem%load_attraction()
    call find_scales(problem)
    call stop_timer(phase_interface)
  end subroutine build_problem

  !> Number the bodies that contacts touch and pack bodies and contacts. Free grains come first, in the order in which contacts
  !> meet them, so that a sweep walks through memory (number_shared_first then puts shared ones before the others); then
  !> boundaries that forces move, then columns of bodies with prescribed velocities: one a boundary, one a grain that sleeps, and
  !> one a contact where the boundary turns.
  subroutine pack_subproblem(view, found, decomposition, kernels, physics, sub)
    type(local_bodies_t), intent(in) :: view
    type(contact_list_t), intent(inout) :: found
    type(decomposition_t), intent(in) :: decomposition
    type(kernels_t), intent(in) :: kernels
    type(physics_t), intent(in) :: physics
    type(subproblem_t), intent(inout) :: sub
    type(numbers_t) :: numbers
    integer :: c, p, b, n, n_asleep

    associate (list => view%list, boundaries => decomposition%boundaries)
      allocate (numbers%of_grain(view%n_bodies()), numbers%of_boundary(size(boundaries)), source=0)
      n = 0
      n_asleep = 0
      sub%n_grains = 0
      do c = 1, found%n
        p = found%source(c)
        call number(list%candidate(p))
        if (list%antagonist(p) > 0) call number(list%antagonist(p))
        b = found%boundary(c)
        if (b == 0) cycle
        numbers%of_boundary(b) = 1
        if (boundaries(b)%drive%turns()) n = n + 1
      end do
      sub%n_contacts = found%n
      sub%overlapping_cores = found%overlapping_cores
      sub%points_left_out = found%points_left_out
      sub%stretched_bonds = found%stretched_bonds
      sub%n_bodies = sub%n_grains
      do b = 1, size(boundaries)
        if (numbers%of_boundary(b) == 0 .or. .not. boundaries(b)%is_driven()) cycle
        sub%n_bodies = sub%n_bodies + 1
        numbers%of_boundary(b) = sub%n_bodies
      end do
      sub%n_columns = sub%n_bodies
      do b = 1, size(boundaries)
        if (numbers%of_boundary(b) == 0 .or. boundaries(b)%is_driven() .or. boundaries(b)%drive%turns()) cycle
        sub%n_columns = sub%n_columns + 1
        numbers%of_boundary(b) = sub%n_columns
      end do
      ! the last column of a boundary is known now
      if (n_asleep > 0) where (numbers%of_grain < 0) numbers%of_grain = sub%n_columns - numbers%of_grain
      sub%n_columns = sub%n_columns + n_asleep
      call allocate_bodies(kernels, sub%n_columns + n, sub)
      if (any(abs(physics%body_force) > 0.0_dp)) allocate (sub%volume(sub%n_grains))
      if (decomposition%na > 0) allocate (sub%applied(decomposition%na, sub%n_grains))
      call pack_grains(view, numbers%of_grain, decomposition%figures, kernels, physics, sub)
      if (physics%cell%moves) then
        call sub%cell%init(kernels%nd, found%n, sub%n_grains)
        call pack_places(view, numbers%of_grain, sub%cell%place)
      end if
      do b = 1, size(boundaries)
        if (numbers%of_boundary(b) == 0 .or. boundaries(b)%drive%turns()) cycle
        call pack_boundary(boundaries(b), b, numbers%of_boundary(b), decomposition%n_subdomains, kernels, sub)
      end do
    end associate
    call pack_contacts(view, found, decomposition%boundaries, numbers, kernels, physics, sub)

  contains

    !> Give grain `k` the next number, unless it has one or is part of a boundary; of those that sleep, the next one below 0.
    subroutine number(k)
      integer, intent(in) :: k

      if (numbers%of_grain(k) /= 0 .or. view%bodies%glued(k) > 0) return
      if (view%bodies%sleeps(k)) then
        n_asleep = n_asleep + 1
        numbers%of_grain(k) = -n_asleep
      else
        sub%n_grains = sub%n_grains + 1
        numbers%of_grain(k) = sub%n_grains
      end if
    end subroutine number

  end subroutine pack_subproblem

  subroutine allocate_bodies(kernels, n_columns, sub)
    type(kernels_t), intent(in) :: kernels
    integer, intent(in) :: n_columns
    type(subproblem_t), intent(inout) :: sub

    allocate (sub%id(n_columns), sub%owner(sub%n_bodies), sub%place(sub%n_grains), sub%radius(sub%n_grains))
    allocate (sub%v_free(kernels%nv, n_columns), sub%inverse_mass(kernels%nw, n_columns), source=0.0_dp)
    ! what the solve sets before it reads them
    allocate (sub%velocity(kernels%nv, n_columns), sub%v_global(kernels%nv, n_columns), sub%reaction(kernels%nv, n_columns), &
      & sub%weight(kernels%nw, n_columns))
    allocate (sub%multiplicity(sub%n_bodies), source=1)
    allocate (sub%boundary(sub%n_grains + 1:n_columns), source=0)
  end subroutine allocate_bodies

  subroutine pack_grains(view, number_of, figures, kernels, physics, sub)
    type(local_bodies_t), intent(in) :: view
    integer, intent(in), contiguous :: number_of(:)
    type(body_figures_t), intent(in) :: figures
    type(kernels_t), intent(in) :: kernels
    type(physics_t), intent(in) :: physics
    type(subproblem_t), intent(inout) :: sub
    integer :: k, b

    do k = 1, size(number_of)
      b = number_of(k)
      if (b == 0) cycle
      sub%id(b) = view%bodies%id(k)
      if (b > sub%n_grains) cycle
      sub%owner(b) = view%owner(k)
      sub%place(b) = view%origin(k)
      sub%radius(b) = view%bodies%radius(k)
      sub%v_free(:, b) = view%bodies%velocity(1:kernels%nv, k)
      call physics%accelerate(figures, view%bodies, k, sub%v_free(:, b))
      associate (before => view%bodies%velocity(1:kernels%nd, k), after => sub%v_free(1:kernels%nd, b))
        sub%largest_term = max(sub%largest_term, view%bodies%mass(k)*max(norm2(before), norm2(after - before)))
      end associate
      call physics%find_inverse_mass(figures, view%bodies, k, sub%inverse_mass(:, b))
      if (allocated(sub%volume)) sub%volume(b) = figures%volume_of(view%bodies, k)
      if (allocated(sub%applied)) sub%applied(:, b) = physics%h*view%bodies%force(:, k)/view%bodies%mass(k)
    end do
  end subroutine pack_grains

  !> Places of the grains in a cell that moves.
  pure subroutine pack_places(view, number_of, place)
    type(local_bodies_t), intent(in) :: view
    integer, intent(in), contiguous :: number_of(:)
    !> (nd, grains) [m]
    real(dp), intent(inout), contiguous :: place(:, :)
    real(dp) :: centre(3)
    integer :: k

    centre(:) = view%period%centre()
    do k = 1, size(number_of)
      if (number_of(k) > 0) place(:, number_of(k)) = view%bodies%position(:, k) - centre(1:size(place, 1))
    end do
  end subroutine pack_places

  !> A boundary as a column. One that forces move is a body shared by the subdomains that touch it, with one of all
  !> subdomains to keep account of them.
  subroutine pack_boundary(boundary, b, column, n_subdomains, kernels, sub)
    type(boundary_t), intent(in) :: boundary
    integer, intent(in) :: b, column, n_subdomains
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(inout) :: sub
    integer :: d

    sub%id(column) = boundary%id
    sub%boundary(column) = b
    sub%v_free(1:kernels%nd, column) = boundary%velocity(1:kernels%nd)
    if (column > sub%n_bodies) return
    sub%owner(column) = mod(b - 1, n_subdomains) + 1
    do d = 1, kernels%nd
      if (.not. boundary%free(d)) cycle
      sub%inverse_mass(d, column) = 1.0_dp/boundary%mass
      sub%largest_term = max(sub%largest_term, boundary%mass*abs(boundary%last_velocity(d)), &
        & boundary%mass*abs(boundary%velocity(d) - boundary%last_velocity(d)))
    end do
  end subroutine pack_boundary

  !> Scales of the residual, of the jump and of roundings: largest |R^d|, over the components that can move, largest free speed,
  !> and largest term of R^d of a body in contact. What moves as prescribed counts with the mass of the heaviest grain that it may
  !> strike; a body that is no disk or sphere, with the speed of its farthest point; a spring that is compressed, with the impulse
  !> that it gives where nothing moves. Collective.
  subroutine find_scales(problem)
    type(contact_problem_t), intent(inout) :: problem
    real(dp) :: scales(3), moving(problem%nd), rim, speed, lightest, inverse
    integer :: s, b, c, d, nd

    nd = problem%nd
    scales(:) = 0.0_dp
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        lightest = huge(1.0_dp)
        do b = 1, sub%n_bodies
          rim = 0.0_dp
          if (problem%has_shapes() .and. b <= sub%n_grains) rim = sub%radius(b)*norm2(sub%v_free(nd + 1:, b))
          scales(2) = max(scales(2), norm2(sub%v_free(1:nd, b)) + rim)
          moving(:) = sub%v_free(1:nd, b)
          do d = 1, nd
            if (.not. sub%moves(d, b)) moving(d) = 0.0_dp
          end do
          inverse = inverse_of_translation(sub%inverse_mass(:, b), nd)
          if (.not. inverse > 0.0_dp) cycle
          scales(1) = max(scales(1), (norm2(moving) + rim)/inverse)
          lightest = min(lightest, inverse)
        end do
        do b = sub%n_bodies + 1, sub%n_columns
          speed = norm2(sub%v_free(1:nd, b))
          scales(1) = max(scales(1), speed/lightest)
          scales(2) = max(scales(2), speed)
        end do
        do c = 1, merge(sub%n_contacts, 0, allocated(sub%spring))
          if (.not. sub%yields(c)) cycle
          associate (contact => sub%hot(lane_of(c), :, block_of(c)), row => problem%row)
            scales(1) = max(scales(1), -contact(row%shift)/contact(row%compliance_n))
          end associate
        end do
        do c = 1, merge(sub%n_contacts, 0, problem%cell_moves())
          moving(:) = problem%cell%added(problem%cell%free, sub%cell%branch(:, c), sub%cell%way(:, c))
          speed = norm2(moving)
          scales(1) = max(scales(1), speed/lightest)
          scales(2) = max(scales(2), speed)
        end do
        scales(3) = max(scales(3), sub%largest_term)
        if (allocated(sub%attraction)) scales(3) = max(scales(3), maxval(sub%attraction))
      end associate
    end do
    call problem%comm%highest_of(scales)
    problem%force_scale = scales(1)
    problem%velocity_scale = scales(2)
    problem%rounded_scale = max(scales(1), scales(3))
  end subroutine find_scales

end module gravier_problem_builder
