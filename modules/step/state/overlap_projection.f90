!> Overlaps that errors of many steps have built up are taken back by moving grains, and boundaries that forces move, not by
!> velocities: a projection of the places on the places without too much overlap. It gives nothing kinetic energy, whatever
!> the time step.
module gravier_overlap_projection
  use gravier_kinds, only: dp
  use gravier_timers, only: start_timer, stop_timer, phase_projection
  use gravier_contact_kernels, only: kernels_t, lanes, lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  use gravier_cell_response, only: subtract_images
  use gravier_boundary, only: boundary_t
  use gravier_decomposition, only: decomposition_t
  use gravier_nscdd, only: average_copies
  use gravier_velocity_return, only: take_displacements
  use gravier_boundary_loads, only: take_boundary_displacements
  implicit none
  private
  public :: project_overlaps

  !> sweeps between two looks at what is left, and at most in one projection: what they leave is for the next steps
  integer, parameter :: check_every = 4, max_sweeps = 200
  !> excess that sweeps may leave, as a part of the overlap allowed, or of the excess at the start where that is larger
  real(dp), parameter :: remainder = 0.1_dp
  !> gap of a contact that is left out, over the overlap allowed
  real(dp), parameter :: out_of_reach = 1.0e9_dp
  !> what bonds may pull with, over the mass that they move times the overlap allowed
  real(dp), parameter :: strength = 1.0e6_dp
  !> times a change of the length of a bond counts in the excess: what sweeps leave of overlaps is for the next steps, what they
  !> leave of bonds stays
  real(dp), parameter :: weight_of_bonds = 100.0_dp

  !> What a projection borrows of a subproblem, its work space, and what it sweeps; src/report/memory_report.f90 counts them.
  type :: borrowed_t
    !> shift and, with friction, mu of each contact (lanes, 1 or 2, blocks)
    real(dp), allocatable :: law(:, :, :)
    !> (lanes, nc, blocks)
    real(dp), allocatable :: impulse(:, :, :), work(:, :, :)
    !> whether a body has moved, or is in a contact that overlaps too much (n_columns); whether a block is swept (blocks)
    logical, allocatable :: is_touched(:), is_swept(:)
    !> first and last block of each run of blocks that are swept (2, n_runs)
    integer, allocatable :: run(:, :)
    integer :: n_runs = 0
  end type borrowed_t

contains

  !> Move grains and boundaries that forces move so that no overlap exceeds `allowed`, as far as sweeps of nonlinear
  !> Gauss-Seidel lead there: displacements in the metric of the masses, M d = H p with p >= 0 orthogonal to
  !> n.(d_i - d_j) + gap + allowed >= 0, in all subdomains with shared masses as in NSCDD; for boundaries, see
  !> weigh_boundaries. They are scaled down together so that nothing moves by more than half the alert distance (or
  !> `allowed`): what is no contact now cannot come to overlap. Boundaries that move as prescribed, and such components, stay.
  !> Compliant contacts are left out: their overlap is deformation. Contacts that intact bonds hold keep the gaps that they have, in
  !> either direction: p >= -P with a P that no displacement needs.
  !> Sweeps go over the contacts that overlap too much and over those of bodies that have moved. All others would give nothing: they
  !> have room, and nothing has moved there.
  !> The problem comes back as it was but for velocities, masses and local operators, with the lengths of the displacements of all
  !> grains summed up: the same sum on any number of ranks. Collective.
  subroutine project_overlaps(decomposition, problem, h, allowed, shifts)
    type(decomposition_t), intent(inout) :: decomposition
    !> of a step that is over; gaps at its q_m, velocities at its end
    type(contact_problem_t), intent(inout) :: problem
    !> [s], [m]
    real(dp), intent(in) :: h, allowed
    !> sum of the lengths by which grains are moved [m]
    real(dp), intent(out) :: shifts
    type(borrowed_t) :: borrowed(size(problem%sub))
    real(dp) :: enough, factor
    integer :: s, k
    logical :: has_driven

    call start_timer(phase_projection)
    has_driven = has_free(decomposition%boundaries)
    do s = 1, size(problem%sub)
      call lend(problem, s, h, allowed, borrowed(s))
    end do
    if (has_driven) call weigh_boundaries(problem, size(decomposition%boundaries))
    do s = 1, size(problem%sub)
      call take_blocks(problem%kernels, problem%sub(s), borrowed(s))
    end do
    enough = remainder*max(allowed, excess(problem, borrowed))
    do k = 1, max_sweeps
      do s = 1, size(problem%sub)
        call sweep_runs(problem%kernels, borrowed(s), problem%sub(s))
      end do
      call average_copies(problem)
      if (mod(k, check_every) > 0) cycle
      do s = 1, size(problem%sub)
        call take_blocks(problem%kernels, problem%sub(s), borrowed(s))
      end do
      if (excess(problem, borrowed) <= enough) exit
    end do
    factor = reduction(problem, max(0.5_dp*decomposition%alert_distance(), allowed))
    do s = 1, size(problem%sub)
      problem%sub(s)%v_global(:, :) = factor*problem%sub(s)%velocity
      call give_back(problem, s, borrowed(s))
    end do
    shifts = lengths(problem)
    call take_displacements(decomposition, problem)
    if (has_driven) call take_boundary_displacements(decomposition, problem)
    call stop_timer(phase_projection)
  end subroutine project_overlaps

  !> Whether forces move some boundary along some axis.
  pure logical function has_free(boundaries)
    type(boundary_t), intent(in) :: boundaries(:)
    integer :: d

    has_free = .false.
    do d = 1, 3
      has_free = has_free .or. any(boundaries%free(d))
    end do
  end function has_free

  !> One sweep over the blocks that are swept.
  subroutine sweep_runs(kernels, borrowed, sub)
    type(kernels_t), intent(in) :: kernels
    type(borrowed_t), intent(in) :: borrowed
    type(subproblem_t), intent(inout) :: sub
    real(dp) :: sums(2)
    integer :: k, n_grouped

    do k = 1, borrowed%n_runs
      associate (first => borrowed%run(1, k), last => borrowed%run(2, k))
        n_grouped = min(max(sub%n_grouped - (first - 1)*lanes, 0), (last - first + 1)*lanes)
        call kernels%sweep(n_grouped, sub%pair(:, (first - 1)*lanes + 1:last*lanes), sub%hot(:, :, first:last), sub%weight, &
          & sub%velocity, sub%impulse(:, :, first:last), sums)
      end associate
    end do
  end subroutine sweep_runs

  !> Take up the blocks that hold a contact of a body that has moved or overlaps too much, with the local operators of all copies.
  subroutine take_blocks(kernels, sub, borrowed)
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(inout) :: sub
    type(borrowed_t), intent(inout) :: borrowed
    real(dp), parameter :: whole(3) = 1.0_dp
    integer :: b, c, g

    do b = 1, sub%n_bodies
      if (.not. borrowed%is_touched(b)) borrowed%is_touched(b) = any(abs(sub%velocity(:, b)) > 0.0_dp)
    end do
    borrowed%n_runs = 0
    do g = 1, size(sub%hot, 3)
      if (.not. borrowed%is_swept(g)) then
        do c = (g - 1)*lanes + 1, min(g*lanes, sub%n_contacts)
          if (borrowed%is_touched(sub%pair(1, c)) .or. borrowed%is_touched(sub%pair(2, c))) borrowed%is_swept(g) = .true.
        end do
        if (.not. borrowed%is_swept(g)) cycle
        call kernels%set_operators(sub%pair(:, (g - 1)*lanes + 1:g*lanes), sub%hot(:, :, g:g), sub%weight, whole)
        ! contacts of no effect are all zero
        if (g*lanes > sub%n_contacts) sub%hot(lane_of(sub%n_contacts) + 1:, :, g) = 0.0_dp
      end if
      associate (n => borrowed%n_runs)
        if (n > 0) then
          if (borrowed%run(2, n) == g - 1) then
            borrowed%run(2, n) = g
            cycle
          end if
        end if
        n = n + 1
        borrowed%run(:, n) = g
      end associate
    end do
  end subroutine take_blocks

  !> Largest overlap beyond what is allowed, and change of the length of a bond, under the displacements of now [m]. Collective.
  real(dp) function excess(problem, borrowed)
    type(contact_problem_t), intent(in) :: problem
    type(borrowed_t), intent(inout) :: borrowed(:)
    integer :: s, k, c, nd

    nd = problem%nd
    excess = 0.0_dp
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do k = 1, borrowed(s)%n_runs
          associate (first => borrowed(s)%run(1, k), last => borrowed(s)%run(2, k))
            call problem%kernels%contact_velocity(sub%pair(:, (first - 1)*lanes + 1:last*lanes), sub%hot(:, :, first:last), &
              & sub%velocity, borrowed(s)%work(:, :, first:last))
            ! lanes without a contact hold zeros
            excess = max(excess, -minval(borrowed(s)%work(:, 1, first:last) + sub%hot(:, nd + 1, first:last)))
            if (.not. allocated(sub%joins)) cycle
            do c = (first - 1)*lanes + 1, min(last*lanes, sub%n_contacts)
              if (sub%joins(c)) excess = max(excess, weight_of_bonds*abs(borrowed(s)%work(lane_of(c), 1, block_of(c))))
            end do
          end associate
        end do
      end associate
    end do
    excess = problem%comm%highest(excess)
  end function excess

  !> Factor that brings all displacements within `limit` [m]. Collective.
  real(dp) function reduction(problem, limit)
    type(contact_problem_t), intent(in) :: problem
    real(dp), intent(in) :: limit
    real(dp) :: longest
    integer :: s, b, nd

    nd = problem%nd
    longest = 0.0_dp
    do s = 1, size(problem%sub)
      do b = 1, problem%sub(s)%n_bodies
        longest = max(longest, norm2(problem%sub(s)%velocity(1:nd, b)))
      end do
    end do
    longest = problem%comm%highest(longest)
    reduction = 1.0_dp
    if (longest > limit) reduction = limit/longest
  end function reduction

  !> Sum of the lengths by which grains are moved, a grain that several subdomains share counting in equal parts [m]. Collective.
  real(dp) function lengths(problem)
    type(contact_problem_t), intent(in) :: problem
    real(dp) :: part(size(problem%sub))
    integer :: s, b, nd

    nd = problem%nd
    part(:) = 0.0_dp
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do b = 1, sub%n_grains
          part(s) = part(s) + norm2(sub%v_global(1:nd, b))/sub%multiplicity(b)
        end do
      end associate
    end do
    lengths = problem%comm%sum_real(part)
  end function lengths

  !> Make a subproblem one of displacements: frictionless, from rest, with the gaps that the next step would find in the
  !> place of velocities. Bodies in contacts that overlap too much are touched.
  subroutine lend(problem, s, h, allowed, borrowed)
    type(contact_problem_t), intent(inout) :: problem
    integer, intent(in) :: s
    real(dp), intent(in) :: h, allowed
    type(borrowed_t), intent(out) :: borrowed
    integer :: b, c, nd

    nd = problem%nd
    associate (sub => problem%sub(s))
      allocate (borrowed%law(lanes, merge(2, 1, problem%nf > 1), size(sub%hot, 3)))
      allocate (borrowed%work, mold=sub%impulse)
      call sub%contact_velocity(problem%kernels, sub%v_global, borrowed%work)
      if (problem%cell_moves()) call subtract_images(problem, s, borrowed%work)
      call move_alloc(sub%impulse, borrowed%impulse)
      allocate (sub%impulse, mold=borrowed%impulse)
      allocate (borrowed%is_touched(sub%n_columns), borrowed%is_swept(size(sub%hot, 3)), source=.false.)
      allocate (borrowed%run(2, (size(sub%hot, 3) + 1)/2))
      borrowed%law(:, 1, :) = sub%hot(:, nd + 1, :)
      do c = 1, sub%n_contacts
        associate (gap => sub%hot(lane_of(c), nd + 1, block_of(c)))
          gap = sub%gap(c) + h*borrowed%work(lane_of(c), 1, block_of(c)) + allowed
          if (sub%yields(c)) gap = out_of_reach*allowed
          if (gap < 0.0_dp .and. .not. sub%is_bonded(c)) then
            borrowed%is_touched(sub%pair(1, c)) = .true.
            borrowed%is_touched(sub%pair(2, c)) = .true.
          end if
        end associate
      end do
      borrowed%is_touched(sub%n_bodies + 1:) = .false.
      if (problem%nf > 1) then
        ! nothing turns then, and no moment is needed
        borrowed%law(:, 2, :) = sub%hot(:, problem%friction_row, :)
        sub%hot(:, problem%friction_row, :) = 0.0_dp
      end if
      sub%velocity(:, :) = 0.0_dp
      sub%impulse(:, :, :) = 0.0_dp
      if (allocated(sub%joins)) call hold_bonds(nd, allowed, sub)
      do b = 1, sub%n_bodies
        sub%weight(:, b) = sub%multiplicity(b)*sub%inverse_mass(:, b)
      end do
      sub%weight(:, sub%n_bodies + 1:) = sub%inverse_mass(:, sub%n_bodies + 1:)
    end associate
  end subroutine lend

  !> Let bonds pull as well as press. Sweeps keep r~ = p + P >= 0, and add what they change of it to the displacements.
  subroutine hold_bonds(nd, allowed, sub)
    integer, intent(in) :: nd
    !> [m]
    real(dp), intent(in) :: allowed
    type(subproblem_t), intent(inout) :: sub
    real(dp) :: lightness
    integer :: c

    do c = 1, sub%n_contacts
      if (.not. sub%is_bonded(c)) cycle
      sub%hot(lane_of(c), nd + 1, block_of(c)) = 0.0_dp
      lightness = max(maxval(sub%inverse_mass(1:nd, sub%pair(1, c))), maxval(sub%inverse_mass(1:nd, sub%pair(2, c))))
      if (lightness > 0.0_dp) sub%impulse(lane_of(c), 1, block_of(c)) = strength*allowed/lightness
    end do
  end subroutine hold_bonds

  !> Undo `lend`, but for masses and velocities.
  subroutine give_back(problem, s, borrowed)
    type(contact_problem_t), intent(inout) :: problem
    integer, intent(in) :: s
    type(borrowed_t), intent(inout) :: borrowed
    integer :: nd

    nd = problem%nd
    associate (sub => problem%sub(s))
      sub%hot(:, nd + 1, :) = borrowed%law(:, 1, :)
      if (problem%nf > 1) sub%hot(:, problem%friction_row, :) = borrowed%law(:, 2, :)
      call move_alloc(borrowed%impulse, sub%impulse)
    end associate
  end subroutine give_back

  !> Give each boundary that forces move the mass of the grains that it touches, on its free components. Its own, which its
  !> inertia asks for, would hold a packing as a fixed wall does: the sweeps have to carry a displacement through it. As heavy
  !> as one more layer of grains it gives way as they do. All subdomains give it the same one. Collective.
  subroutine weigh_boundaries(problem, n_boundaries)
    type(contact_problem_t), intent(inout) :: problem
    integer, intent(in) :: n_boundaries
    real(dp) :: parts(n_boundaries, size(problem%sub)), masses(n_boundaries)
    integer :: s, c, k, b

    parts(:, :) = 0.0_dp
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do c = 1, sub%n_contacts
          do k = 1, 2
            b = sub%pair(k, c)
            if (b <= sub%n_grains .or. b > sub%n_bodies) cycle
            parts(sub%boundary(b), s) = parts(sub%boundary(b), s) + 1.0_dp/sub%inverse_mass(1, sub%pair(3 - k, c))
          end do
        end do
      end associate
    end do
    call problem%comm%sum_parts(parts, masses)
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do b = sub%n_grains + 1, sub%n_bodies
          where (sub%inverse_mass(:, b) > 0.0_dp) sub%weight(:, b) = sub%multiplicity(b)/masses(sub%boundary(b))
        end do
      end associate
    end do
  end subroutine weigh_boundaries

end module gravier_overlap_projection
