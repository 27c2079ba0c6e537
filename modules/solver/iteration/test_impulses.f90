!> Test impulses: the projection of the velocity error on the velocities that some impulses make.
!>
!> Let w = W (P(r - (v + s n)/W) - r) be the velocity by which a contact violates its law, and e = V - V* the error. With the set of
!> pressing and sticking contacts known, H^T e = -w there, so that any impulse y gives y . w = -(M^-1 H y, e)_M. Several of them,
!> with the velocities h_i = M^-1 H y_i, give the norm of the projection of e on the span of these velocities:
!>     b_i = y_i . w,   G_ij = (h_i, h_j)_M,   Y^2 = b^T G^+ b.
!>
!> The test impulses are
!>   w/W  local errors;
!>   r    a wrong total load: the impulses on the bodies, without the attractions of contacts. Attractions that hold bodies together
!>        are many times the loads and balance each other, so that r with them would show what they do at surfaces, and no load;
!>   r less earlier impulses, the wave under way: those one iteration before where sweeps are accelerated, which keep them; else
!>        those of some iterations before.
!> See doc/theory.md, section 24.
module gravier_test_impulses
  use gravier_kinds, only: dp
  use gravier_timers, only: start_timer, stop_timer, phase_reduction
  use gravier_contact_kernels, only: kernels_t, lanes, lane_of, block_of
  use gravier_body_mass, only: inverse_products, inverse_of_translation, mass_product
  use gravier_contact_problem, only: contact_problem_t, n_residual_sums
  use gravier_subproblem, only: subproblem_t
  use gravier_moving_cell, only: cell_motion_t
  use gravier_cell_response, only: virial_of
  use gravier_method, only: method_t
  use gravier_levels, only: level_part_t
  use gravier_kept_impulses, only: kept_impulses_t, copy_impulses
  use gravier_islands, only: islands_t, island_part_t, island_sums_t, find_islands
  implicit none
  private
  public :: test_impulses_t, projection_t

  !> fraction of the square of a test's velocity below which what the others have left of it counts as 0
  real(dp), parameter :: rank_cut = 1.0e-10_dp
  !> plain sweeps: ratio between the iterations at which impulses are copied, and the first of them
  real(dp), parameter :: copy_ratio = 4.0_dp/3.0_dp
  integer, parameter :: first_copy = 2
  !> test impulses; places of the sums, the first of which make the residual: the powers y . w, the products of the velocities that
  !> test impulses make
  integer, parameter :: n_tests = 3, at_powers = n_residual_sums, at_products = at_powers + n_tests, &
    & n_products = n_tests*(n_tests + 1)/2, n_sums = at_products + n_products
  !> rounding of a sum of impulses that balance each other, over these; part of the mass of all grains in contact from which on an
  !> island is not looked at by itself
  real(dp), parameter :: rounding = 1.0e-12_dp, most_of_mass = 0.5_dp
  !> sums over an island: the powers, the products, its mass, what bounds its error where rest is admissible, and r . W r
  integer, parameter :: at_mass = n_tests + n_products + 1, at_rest = at_mass + 1, at_terms = at_rest + 1, n_island_sums = at_terms

  !> What is held for one subdomain.
  type :: test_part_t
    !> H y of the tests w/W and r less earlier impulses, summed over copies of bodies (nv, n_columns) [N s, N m s]
    real(dp), allocatable :: local(:, :), recent(:, :)
    !> where contacts attract, the impulses on the bodies (lanes, nc, blocks) [N s], and H of them (nv, n_columns) [N s, N m s]
    real(dp), allocatable :: on_bodies(:, :, :), load(:, :)
    !> P - r of the contacts where stresses drive the cell, else of no block (lanes, nc, blocks) [N s]
    real(dp), allocatable :: kept(:, :, :)
  end type test_part_t

  !> What test impulses find.
  type :: projection_t
    !> Y^2 [J]; the largest |w| of a contact [m/s]
    real(dp) :: square = 0.0_dp, largest_violation = 0.0_dp
    !> as `residual` of the problem returns them
    real(dp) :: residual = 0.0_dp, defect = 0.0_dp
  end type projection_t

  type :: test_impulses_t
    !> iteration at which the earlier impulses were copied, 0 for none; that of the next copy
    integer, private :: taken_at = 0, next_copy = first_copy
    type(test_part_t), allocatable, private :: part(:)
    !> earlier impulses of each subdomain, where the method keeps none
    type(kept_impulses_t), allocatable, private :: previous(:)
  contains
    procedure :: start => test_impulses_start
    procedure :: keep_copy => test_impulses_keep_copy
    procedure :: begin_anew => test_impulses_begin_anew
    procedure :: take_earlier => test_impulses_take_earlier
    procedure :: project => test_impulses_project
    procedure :: project_islands => test_impulses_project_islands
    procedure, private :: has_copy => test_impulses_has_copy
  end type test_impulses_t

contains

  !> Make ready for a solve.
  subroutine test_impulses_start(self, problem)
    class(test_impulses_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem

    allocate (self%part(size(problem%sub)), self%previous(size(problem%sub)))
  end subroutine test_impulses_start

  !> Keep a copy of the impulses after an iteration, where one is due and the method keeps none.
  subroutine test_impulses_keep_copy(self, problem, method, iteration)
    class(test_impulses_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    class(method_t), intent(in) :: method
    integer, intent(in) :: iteration

    if (method%acceleration%extrapolates() .or. iteration < self%next_copy) return
    self%next_copy = max(iteration + 1, nint(iteration*copy_ratio))
    self%taken_at = iteration
    call copy_impulses(problem, self%previous)
  end subroutine test_impulses_keep_copy

  !> The iterations begin anew from other impulses, after `iteration` of them.
  subroutine test_impulses_begin_anew(self, iteration)
    class(test_impulses_t), intent(inout) :: self
    integer, intent(in) :: iteration

    self%taken_at = 0
    self%next_copy = iteration + first_copy
  end subroutine test_impulses_begin_anew

  !> Copies of the impulses of an earlier iteration, if there are any.
  subroutine test_impulses_take_earlier(self, problem, method, iteration, earlier, are_known)
    class(test_impulses_t), intent(in) :: self
    type(contact_problem_t), intent(in) :: problem
    class(method_t), intent(in) :: method
    !> iterations made
    integer, intent(in) :: iteration
    !> of the subdomains of this rank
    type(kept_impulses_t), intent(out) :: earlier(:)
    logical, intent(out) :: are_known
    integer :: s

    are_known = iteration > 0 .and. (method%acceleration%extrapolates() .or. self%has_copy(iteration))
    if (.not. are_known) return
    do s = 1, size(problem%sub)
      if (method%acceleration%extrapolates()) then
        earlier(s)%value = method%acceleration%part(s)%impulse
      else
        earlier(s)%value = self%previous(s)%value
      end if
    end do
  end subroutine test_impulses_take_earlier

  !> Whether there is a copy of impulses from before an iteration.
  pure logical function test_impulses_has_copy(self, iteration) result(has_copy)
    class(test_impulses_t), intent(in) :: self
    integer, intent(in) :: iteration
    has_copy = self%taken_at > 0 .and. self%taken_at < iteration
  end function test_impulses_has_copy

  !> Y and the largest violation, and the residual with them, with v_global and the reactions evaluated: one pass over the contacts
  !> and one reduction. The powers r . w of the contacts are left to the levels. Collective.
  subroutine test_impulses_project(self, problem, method, iteration, levels, found)
    class(test_impulses_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(in) :: method
    integer, intent(in) :: iteration
    !> of the subdomains of this rank
    type(level_part_t), intent(inout) :: levels(:)
    type(projection_t), intent(out) :: found
    !> the sums, and the virials of the tests, one after the other
    real(dp) :: parts(n_sums + n_tests*problem%cell%n_driven(), size(problem%sub)), largest(1)
    real(dp) :: sums(size(parts, 1))
    integer :: s

    parts(:, :) = 0.0_dp
    largest(1) = 0.0_dp
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s), part => self%part(s))
        call make_room(part, problem, sub, levels(s)%power)
        if (problem%rest_is_admissible) parts(n_residual_sums, s) = sub%product_of(sub%v_global, sub%v_global)
        if (allocated(sub%attraction)) call take_attractions_off(sub, part)
        if (sub%n_contacts == 0) cycle
        ! without earlier impulses the third test impulse is 0, which tells nothing
        if (method%acceleration%extrapolates() .and. iteration > 0) then
          call test(problem%kernels, sub, part, method%acceleration%part(s)%impulse, levels(s)%power, parts(:, s), largest(1))
        else if (self%has_copy(iteration)) then
          call test(problem%kernels, sub, part, self%previous(s)%value, levels(s)%power, parts(:, s), largest(1))
        else
          call test(problem%kernels, sub, part, sub%impulse, levels(s)%power, parts(:, s), largest(1))
        end if
      end associate
    end do
    if (problem%n_subdomains > 1) call sum_motions(problem, self%part)
    do s = 1, size(problem%sub)
      ! the products (h_i, h_j)_M of the velocities h = M^-1 H y, i <= j
      associate (sub => problem%sub(s), part => self%part(s), products => parts(at_products + 1:n_sums, s))
        if (allocated(part%load)) then
          call inverse_products(sub%inverse_mass, sub%multiplicity(1:sub%n_bodies), part%local, part%load, part%recent, &
            & products, sub%concern)
        else
          call inverse_products(sub%inverse_mass, sub%multiplicity(1:sub%n_bodies), part%local, sub%reaction, part%recent, &
            & products, sub%concern)
        end if
      end associate
    end do
    call start_timer(phase_reduction)
    call problem%comm%sum_parts(parts, sums)
    call problem%comm%highest_of(largest)
    call stop_timer(phase_reduction)
    call problem%take_residual(sums(1:n_residual_sums), found%residual, found%defect)
    if (problem%cell_is_driven()) call add_cell(problem%cell, sums(n_sums + 1:), sums(at_products + 1:n_sums))
    found%square = projection_of(sums(at_powers + 1:at_products), sums(at_products + 1:n_sums), 0.0_dp)
    found%largest_violation = sqrt(largest(1))
  end subroutine test_impulses_project

  !> The largest error of an island by its own projection, after `project` [m/s]: Y over the root of the mass, or the bound by rest
  !> where that is smaller. The mean over all bodies tells that of an island with most of the mass, which has no part. Collective.
  real(dp) function test_impulses_project_islands(self, problem, method, iteration, mass) result(error)
    class(test_impulses_t), intent(in) :: self
    type(contact_problem_t), intent(inout) :: problem
    class(method_t), intent(in) :: method
    !> that of `project`
    integer, intent(in) :: iteration
    !> of the grains in contact [kg]
    real(dp), intent(in) :: mass
    type(islands_t) :: islands
    type(island_sums_t) :: sums(size(problem%sub))
    real(dp) :: square
    integer :: s, i

    call find_islands(problem, most_of_mass*mass, islands)
    do s = 1, size(sums)
      allocate (sums(s)%value(n_island_sums, islands%part(s)%n), source=0.0_dp)
      associate (part => self%part(s), sub => problem%sub(s), value => sums(s)%value)
        if (method%acceleration%extrapolates() .and. iteration > 0) then
          call add_contacts(part, problem%kernels, sub, islands, s, method%acceleration%part(s)%impulse, value)
        else if (self%has_copy(iteration)) then
          call add_contacts(part, problem%kernels, sub, islands, s, self%previous(s)%value, value)
        else
          call add_contacts(part, problem%kernels, sub, islands, s, sub%impulse, value)
        end if
        if (allocated(part%load)) then
          call add_bodies(sub, problem%nd, part, part%load, islands%part(s), value)
        else
          call add_bodies(sub, problem%nd, part, sub%reaction, islands%part(s), value)
        end if
      end associate
    end do
    call islands%complete(problem, n_island_sums, sums)
    error = 0.0_dp
    do s = 1, size(sums)
      do i = 1, islands%part(s)%n
        associate (value => sums(s)%value(:, i))
          if (.not. value(at_mass) > 0.0_dp) cycle
          square = projection_of(value(1:n_tests), value(n_tests + 1:at_mass - 1), rounding**2*value(at_terms))
          if (problem%rest_is_admissible) square = min(square, max(0.0_dp, value(at_rest)))
          error = max(error, square/value(at_mass))
        end associate
      end do
    end do
    error = sqrt(problem%comm%highest(error))
  end function test_impulses_project_islands

  !> Add what the contacts of islands say: y . w of the tests, and twice the power of impulses on shifts.
  subroutine add_contacts(part, kernels, sub, islands, s, previous, sums)
    type(test_part_t), intent(in) :: part
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(in) :: sub
    type(islands_t), intent(in) :: islands
    !> number of the subdomain on this rank
    integer, intent(in) :: s
    !> earlier impulses (lanes, nc, blocks) [N s]
    real(dp), intent(in), contiguous :: previous(:, :, :)
    !> (n_island_sums, islands)
    real(dp), intent(inout), contiguous :: sums(:, :)

    if (allocated(part%on_bodies)) then
      call add_with(part%on_bodies)
    else
      call add_with(sub%impulse)
    end if

  contains

    subroutine add_with(on_bodies)
      !> impulses on the bodies
      real(dp), intent(in), contiguous :: on_bodies(:, :, :)
      !> blocks of contacts that are looked at together
      integer, parameter :: together = 4
      real(dp) :: powers(lanes, n_tests + 1, together)
      integer :: from, to, c, i, q, g, island(lanes*together)

      do from = 1, size(sub%hot, 3), together
        to = min(from + together - 1, size(sub%hot, 3))
        island(:) = 0
        do c = (from - 1)*lanes + 1, min(to*lanes, sub%n_contacts)
          i = islands%of_contact(s, sub, c)
          if (i == 0) cycle
          if (islands%part(s)%is_small(i)) island(c - (from - 1)*lanes) = i
        end do
        if (.not. any(island > 0)) cycle
        call kernels%find_powers(sub%pair(:, (from - 1)*lanes + 1:to*lanes), sub%hot(:, :, from:to), &
          & sub%inverse_mass, sub%v_global, sub%impulse(:, :, from:to), on_bodies(:, :, from:to), previous(:, :, from:to), &
          & powers(:, :, 1:to - from + 1))
        do c = (from - 1)*lanes + 1, min(to*lanes, sub%n_contacts)
          i = island(c - (from - 1)*lanes)
          if (i == 0) cycle
          q = lane_of(c)
          g = block_of(c)
          sums(1:n_tests, i) = sums(1:n_tests, i) + powers(q, 1:n_tests, g - from + 1)
          sums(at_terms, i) = sums(at_terms, i) + powers(q, n_tests + 1, g - from + 1)
          sums(at_rest, i) = sums(at_rest, i) + 2.0_dp*sub%impulse(q, 1, g)*sub%hot(q, kernels%nd + 1, g)
        end do
      end do
    end subroutine add_with

  end subroutine add_contacts

  !> Add what the bodies of islands say: the products of the velocities of the tests, the mass, and the square of the velocity.
  subroutine add_bodies(sub, nd, part, load, islands, sums)
    type(subproblem_t), intent(in) :: sub
    !> 2 or 3
    integer, intent(in) :: nd
    type(test_part_t), intent(in) :: part
    !> H of the impulses on the bodies (nv, n_columns) [N s, N m s]
    real(dp), intent(in), contiguous :: load(:, :)
    type(island_part_t), intent(in) :: islands
    !> (n_island_sums, islands)
    real(dp), intent(inout), contiguous :: sums(:, :)
    real(dp) :: products(n_products), factor(1), mass
    integer :: b, i

    factor(1) = 1.0_dp
    do b = 1, sub%n_bodies
      if (.not. islands%is_small(islands%of_body(b))) cycle
      mass = inverse_of_translation(sub%inverse_mass(:, b), nd)
      if (.not. mass > 0.0_dp) cycle
      if (allocated(sub%concern)) factor(1) = sub%concern(b)
      mass = factor(1)/(mass*sub%multiplicity(b))
      call inverse_products(sub%inverse_mass(:, b:b), sub%multiplicity(b:b), part%local(:, b:b), load(:, b:b), &
        & part%recent(:, b:b), products, factor)
      i = islands%of_body(b)
      sums(n_tests + 1:at_mass - 1, i) = sums(n_tests + 1:at_mass - 1, i) + products
      sums(at_mass, i) = sums(at_mass, i) + mass
      sums(at_rest, i) = sums(at_rest, i) + &
        & factor(1)*mass_product(sub%inverse_mass(:, b), sub%v_global(:, b), sub%v_global(:, b))/sub%multiplicity(b)
    end do
  end subroutine add_bodies

  !> H y of a subdomain's tests at 0; the first time room is made for them and for the powers at contacts.
  subroutine make_room(part, problem, sub, power)
    type(test_part_t), intent(inout) :: part
    type(contact_problem_t), intent(in) :: problem
    type(subproblem_t), intent(in) :: sub
    real(dp), allocatable, intent(inout) :: power(:, :)

    if (.not. allocated(part%local)) then
      associate (blocks => size(sub%hot, 3))
        allocate (part%local(problem%nv, sub%n_columns), part%recent(problem%nv, sub%n_columns))
        allocate (power(lanes, blocks))
        allocate (part%kept(lanes, problem%nc, merge(blocks, 0, problem%cell_is_driven())))
      end associate
    end if
    part%local(:, :) = 0.0_dp
    part%recent(:, :) = 0.0_dp
  end subroutine make_room

  !> The impulses on the bodies of a subdomain whose contacts attract, and their reactions.
  subroutine take_attractions_off(sub, part)
    type(subproblem_t), intent(in) :: sub
    type(test_part_t), intent(inout) :: part

    part%on_bodies = sub%impulse
    part%on_bodies(:, 1, :) = part%on_bodies(:, 1, :) - sub%attraction
    part%load = sub%reaction + sub%attraction_load
  end subroutine take_attractions_off

  !> Add what the contacts of a subdomain say.
  subroutine test(kernels, sub, part, previous, power, sums, largest)
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(in) :: sub
    type(test_part_t), intent(inout) :: part
    !> earlier impulses (lanes, nc, blocks) [N s]
    real(dp), intent(in), contiguous :: previous(:, :, :)
    !> r . w (lanes, blocks) [J]
    real(dp), intent(inout), contiguous :: power(:, :)
    !> (n_sums)
    real(dp), intent(inout), contiguous :: sums(:)
    real(dp), intent(inout) :: largest

    if (allocated(part%on_bodies)) then
      call test_with(part%on_bodies)
    else
      call test_with(sub%impulse)
    end if

  contains

    subroutine test_with(on_bodies)
      !> impulses on the bodies
      real(dp), intent(in), contiguous :: on_bodies(:, :, :)
      real(dp) :: found(3 + n_tests)

      call kernels%make_tests(sub%pair, sub%hot, sub%inverse_mass, sub%v_global, sub%impulse, on_bodies, previous, &
        & power, part%local, part%recent, part%kept, found, largest)
      sums(1:3) = found(1:3)
      sums(at_powers + 1:at_products) = found(4:)
      if (size(part%kept, 3) > 0) call find_virials(sub, kernels%nf, part%kept, on_bodies, previous, sums(n_sums + 1:))
    end subroutine test_with

  end subroutine test

  !> The virials of the tests of a subdomain.
  pure subroutine find_virials(sub, nf, local, on_bodies, previous, virials)
    type(subproblem_t), intent(in) :: sub
    !> components of an impulse that are a force's
    integer, intent(in) :: nf
    !> (lanes, nc, blocks) [N s]
    real(dp), intent(in), contiguous :: local(:, :, :), on_bodies(:, :, :), previous(:, :, :)
    !> (components that stresses drive, tests) [N m s]
    real(dp), intent(out) :: virials(size(sub%cell%lever, 3), n_tests)
    real(dp) :: before(size(virials, 1))

    virials(:, 1) = virial_of(sub, nf, local)
    virials(:, 2) = virial_of(sub, nf, on_bodies)
    virials(:, 3) = virial_of(sub, nf, sub%impulse)
    before(:) = virial_of(sub, nf, previous)
    virials(:, 3) = virials(:, 3) - before
  end subroutine find_virials

  !> Add to the products of the velocities of tests what the cell has of them.
  pure subroutine add_cell(motion, virials, products)
    type(cell_motion_t), intent(in) :: motion
    !> (components that stresses drive, tests) [N m s]
    real(dp), intent(in) :: virials(count(motion%driven), n_tests)
    !> columns of the upper triangle of G [J]
    real(dp), intent(inout), contiguous :: products(:)
    real(dp) :: inertia(size(virials, 1))
    integer :: i, j, k, at

    inertia(:) = pack(motion%inertia, motion%driven)
    at = 0
    do j = 1, n_tests
      do i = 1, j
        at = at + 1
        do k = 1, size(inertia)
          products(at) = products(at) + virials(k, i)*virials(k, j)/inertia(k)
        end do
      end do
    end do
  end subroutine add_cell

  !> Sum H y over the copies of bodies; that of the impulses themselves is the reaction, which is summed. Collective.
  subroutine sum_motions(problem, part)
    type(contact_problem_t), intent(inout) :: problem
    type(test_part_t), intent(inout) :: part(:)
    integer :: s

    do s = 1, size(part)
      call problem%shared%load(s, part(s)%local)
    end do
    call problem%shared%pass()
    do s = 1, size(part)
      call problem%shared%sum_copies(s, part(s)%local, mean=.false.)
      call problem%shared%load(s, part(s)%recent)
    end do
    call problem%shared%pass()
    do s = 1, size(part)
      call problem%shared%sum_copies(s, part(s)%recent, mean=.false.)
    end do
  end subroutine sum_motions

  !> b^T G^+ b [J]: the tests are taken one after the other, next the one of which those taken have left most, as in a Cholesky
  !> factorisation with pivots. What little is left of a test that is nearly a sum of others counts as none.
  pure real(dp) function projection_of(b, products, least) result(square)
    !> (n_tests); columns of the upper triangle of G
    real(dp), intent(in), contiguous :: b(:), products(:)
    !> square of a velocity up to which a test counts as none [J]
    real(dp), intent(in) :: least
    real(dp) :: left(n_tests, n_tests), power(n_tests), share(n_tests)
    integer :: i, j, k, at

    at = 0
    do j = 1, n_tests
      do i = 1, j
        at = at + 1
        left(i, j) = products(at)
        left(j, i) = products(at)
      end do
    end do
    power(:) = b
    share(:) = 0.0_dp
    do i = 1, n_tests
      if (left(i, i) > least) share(i) = 1.0_dp/left(i, i)
    end do
    square = 0.0_dp
    do k = 1, n_tests
      i = 1
      do j = 2, n_tests
        if (left(j, j)*share(j) > left(i, i)*share(i)) i = j
      end do
      if (.not. left(i, i)*share(i) > rank_cut) return
      square = square + power(i)**2/left(i, i)
      power(:) = power - left(:, i)*(power(i)/left(i, i))
      do j = 1, n_tests
        if (j /= i) left(:, j) = left(:, j) - left(:, i)*(left(i, j)/left(i, i))
      end do
      share(i) = 0.0_dp
      left(:, i) = 0.0_dp
      left(i, :) = 0.0_dp
    end do
  end function projection_of

end module gravier_test_impulses
