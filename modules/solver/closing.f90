!> What a residual below the tolerance does not tell: momenta with which bodies go against contacts. A residual goes by the lighter
!> of two bodies, and by impulses with attractions in them: it knows little of what a heavy body, or one in strong bonds, lacks.
module gravier_closing
  use gravier_kinds, only: dp, i8
  use gravier_contact_kernels, only: kernels_t, lanes, n_blocks, lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t, subproblem_t
  implicit none
  private
  public :: find_closing

  !> contacts between a contact and the heaviest body that is seen to lean on it
  integer, parameter :: reach = 16

  !> Of each body of a subdomain, the heaviest that leans on it, or itself.
  type :: leaning_t
    !> velocity by which each contact may miss its law, see `velocity_at` (n_contacts) [m/s]
    real(dp), allocatable :: missed(:)
    !> mass of each body, 0 of what cannot move (n_columns) [kg]
    real(dp), allocatable :: own(:)
    !> mass, or the share of it that leans, in the first row [kg], and velocity [m/s, rad/s], both (nv, n_columns)
    real(dp), allocatable :: mass(:, :), velocity(:, :)
    !> mass that each body has handed on already (n_columns) [kg]
    real(dp), allocatable :: handed_on(:)
    !> sum of the impulses that press on each body, in all copies (n_columns) [N s]
    real(dp), allocatable :: pressed(:)
  end type leaning_t

contains

  !> The largest momentum with which a body goes against a contact under v_global, relative to `scale_of`. A contact misses its law
  !> by the velocity at which it closes, or opens though it holds an impulse. The body is one of the two, or the heaviest that leans
  !> on one of them through `reach` contacts with impulses; it counts with the least of that velocity, of the same between it and
  !> the other side of the contact, and of its own along the normal. 0 where it is rounding, or found to be at most `allowed`
  !> without a search for heavy bodies. Collective.
  real(dp) function find_closing(problem, allowed) result(closing)
    !> v_global as `evaluate` has made it, impulse_scale as `residual` has
    type(contact_problem_t), intent(inout) :: problem
    real(dp), intent(in) :: allowed
    type(leaning_t) :: heaviest(size(problem%sub))
    real(dp) :: scale, most(2)
    integer :: s

    scale = max(scale_of(problem), tiny(1.0_dp))
    most(:) = 0.0_dp
    do s = 1, size(problem%sub)
      call find_most(problem%kernels, problem%sub(s), heaviest(s), most)
    end do
    call problem%comm%highest_of(most)
    closing = 0.0_dp
    if (most(1)*most(2) <= max(allowed*scale, problem%rounded_defect())) return
    call start_leaning(problem, heaviest)
    closing = largest_pressing(problem, heaviest)
    ! the bodies of the contacts alone may say enough: no search then
    if (closing <= max(allowed*scale, problem%rounded_defect())) then
      call find_heaviest(problem, allowed*scale/most(2), heaviest)
      closing = largest_pressing(problem, heaviest)
    end if
    if (closing <= problem%rounded_defect()) closing = 0.0_dp
    closing = closing/scale
  end function find_closing

  !> The largest momentum with which a body goes against a contact [N s]. Collective.
  real(dp) function largest_pressing(problem, heaviest) result(largest)
    type(contact_problem_t), intent(in) :: problem
    type(leaning_t), intent(in) :: heaviest(:)
    integer :: s, c

    largest = 0.0_dp
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s), mass => heaviest(s)%mass)
        do c = 1, sub%n_contacts
          if (abs(heaviest(s)%missed(c))*max(mass(1, sub%pair(1, c)), mass(1, sub%pair(2, c))) <= largest) cycle
          largest = max(largest, pressing(problem%kernels, sub, heaviest(s), c))
        end do
      end associate
    end do
    largest = problem%comm%highest(largest)
  end function largest_pressing

  !> What closing momenta are compared with: the larger of the largest |R^d| of a body in contact and the root mean square of the
  !> impulses; where there are attractions without them, and the impulses, of which errors are a part then, up to the sum of all
  !> |R^d| at most [N s]. Collective.
  real(dp) function scale_of(problem) result(scale)
    type(contact_problem_t), intent(in) :: problem
    !> sums of squared impulses and of |R^d| of each subdomain
    real(dp) :: parts(2, size(problem%sub)), sums(2), largest
    integer :: s, c
    logical :: attracts

    attracts = .false.
    if (size(problem%sub) > 0) attracts = allocated(problem%sub(1)%attraction)
    scale = max(problem%force_scale, problem%impulse_scale)
    if (.not. problem%comm%any_true(attracts)) return
    parts(:, :) = 0.0_dp
    largest = 0.0_dp
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do c = 1, sub%n_contacts
          parts(1, s) = parts(1, s) + (sub%impulse(lane_of(c), 1, block_of(c)) - sub%attraction(lane_of(c), block_of(c)))**2 &
            & + sum(sub%impulse(lane_of(c), 2:, block_of(c))**2)
        end do
        call add_loads(sub, problem%kernels%nd, parts(2, s), largest)
      end associate
    end do
    call problem%comm%sum_parts(parts, sums)
    scale = max(problem%comm%highest(largest), min(sums(2), sqrt(sums(1)/real(max(1_i8, problem%n_contacts), dp))))
  end function scale_of

  !> |R^d| of the bodies of a subdomain without attractions [N s], of shared ones a part for each copy; what moves as prescribed
  !> counts with the heaviest body.
  subroutine add_loads(sub, nd, total, largest)
    type(subproblem_t), intent(in) :: sub
    integer, intent(in) :: nd
    !> added to, and raised [N s]
    real(dp), intent(inout) :: total, largest
    real(dp) :: load(nd), size_of_load, heaviest
    integer :: b, d

    heaviest = 0.0_dp
    do b = 1, sub%n_columns
      do d = 1, nd
        load(d) = sub%v_free(d, b) - sub%inverse_mass(d, b)*sub%pull(d, b)
        if (b <= sub%n_bodies .and. .not. sub%moves(d, b)) load(d) = 0.0_dp
      end do
      if (b <= sub%n_bodies) then
        heaviest = max(heaviest, mass(sub, nd, b))
        size_of_load = mass(sub, nd, b)*norm2(load)
        total = total + size_of_load/sub%multiplicity(b)
      else
        size_of_load = heaviest*norm2(load)
        total = total + size_of_load
      end if
      largest = max(largest, size_of_load)
    end do
  end subroutine add_loads

  !> The masses of the bodies and what the contacts miss, and the largest of both, to which `most` is raised [kg], [m/s].
  subroutine find_most(kernels, sub, heaviest, most)
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(in) :: sub
    type(leaning_t), intent(inout) :: heaviest
    real(dp), intent(inout) :: most(2)
    integer :: b, c, q, g

    allocate (heaviest%own(sub%n_columns), heaviest%missed(sub%n_contacts))
    do b = 1, sub%n_columns
      heaviest%own(b) = mass(sub, kernels%nd, b)
      most(1) = max(most(1), heaviest%own(b))
    end do
    do g = 1, n_blocks(sub%n_contacts)
      do q = 1, min(lanes, sub%n_contacts - (g - 1)*lanes)
        c = (g - 1)*lanes + q
        heaviest%missed(c) = velocity_at(kernels%nd, sub, c, q, g)
        if (abs(heaviest%missed(c)) > most(2)) most(2) = max(most(2), abs(missed_velocity(kernels, sub, heaviest%missed(c), c)))
      end do
    end do
  end subroutine find_most

  !> Mass of body `b`, 0 of what cannot move [kg].
  pure real(dp) function mass(sub, nd, b)
    type(subproblem_t), intent(in) :: sub
    integer, intent(in) :: nd, b
    real(dp) :: inverse

    inverse = maxval(sub%inverse_mass(1:nd, b))
    mass = 0.0_dp
    if (inverse > 0.0_dp) mass = 1.0_dp/inverse
  end function mass

  !> v_n + s of contact `c`, in lane `q` of block `g`; 0 of one that opens and holds no impulse [m/s].
  pure real(dp) function velocity_at(nd, sub, c, q, g) result(v)
    integer, intent(in) :: nd
    type(subproblem_t), intent(in) :: sub
    integer, intent(in) :: c, q, g
    integer :: d

    v = sub%hot(q, nd + 1, g)
    do d = 1, nd
      v = v + sub%hot(q, d, g)*(sub%v_global(d, sub%pair(1, c)) - sub%v_global(d, sub%pair(2, c)))
    end do
    if (v > 0.0_dp .and. .not. sub%impulse(q, 1, g) > 0.0_dp) v = 0.0_dp
  end function velocity_at

  !> Velocity by which contact `c` misses its law along the normal, `v` or what of it the impulse could take: below 0 where it
  !> closes, above where it opens though it holds an impulse [m/s].
  pure real(dp) function missed_velocity(kernels, sub, v, c) result(missed)
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(in) :: sub
    !> of `velocity_at`
    real(dp), intent(in) :: v
    integer, intent(in) :: c
    real(dp) :: w(2)

    missed = v
    if (.not. v > 0.0_dp) return
    call sub%local_operator(kernels, c, sub%inverse_mass, w)
    missed = min(v, sub%impulse(lane_of(c), 1, block_of(c))*w(1))
  end function missed_velocity

  !> Each body alone.
  subroutine start_leaning(problem, heaviest)
    type(contact_problem_t), intent(in) :: problem
    type(leaning_t), intent(inout) :: heaviest(:)
    integer :: s

    do s = 1, size(heaviest)
      associate (sub => problem%sub(s))
        allocate (heaviest(s)%mass(problem%kernels%nv, sub%n_columns), source=0.0_dp)
        heaviest(s)%mass(1, :) = heaviest(s)%own
        heaviest(s)%velocity = sub%v_global
        allocate (heaviest(s)%handed_on(sub%n_columns), source=0.0_dp)
      end associate
    end do
  end subroutine start_leaning

  !> The heaviest body that leans on each, through `reach` contacts at most. Collective.
  subroutine find_heaviest(problem, least, heaviest)
    type(contact_problem_t), intent(inout) :: problem
    !> mass below which a body is not handed on: it would not press by more than is allowed [kg]
    real(dp), intent(in) :: least
    type(leaning_t), intent(inout) :: heaviest(:)
    integer :: s, step
    logical :: changed

    do s = 1, size(heaviest)
      call sum_impulses(problem%sub(s), heaviest(s)%pressed)
    end do
    do step = 1, reach
      changed = .false.
      do s = 1, size(heaviest)
        call lean(problem%sub(s), least, heaviest(s), changed)
      end do
      if (.not. problem%comm%any_true(changed)) return
      call agree_on_copies(problem, heaviest)
    end do
  end subroutine find_heaviest

  !> The impulses that press on each body of a subdomain; of shared bodies copies are taken to bear alike.
  subroutine sum_impulses(sub, pressed)
    type(subproblem_t), intent(in) :: sub
    real(dp), allocatable, intent(out) :: pressed(:)
    real(dp) :: r
    integer :: c, k, b

    allocate (pressed(sub%n_columns), source=0.0_dp)
    do c = 1, sub%n_contacts
      r = max(0.0_dp, sub%impulse(lane_of(c), 1, block_of(c)))
      do k = 1, 2
        pressed(sub%pair(k, c)) = pressed(sub%pair(k, c)) + r
      end do
    end do
    do b = 1, sub%n_bodies
      pressed(b) = sub%multiplicity(b)*pressed(b)
    end do
  end subroutine sum_impulses

  !> Hand heavy bodies on, from each body to those it presses on: the share of the mass that goes with the share of the impulses on
  !> the body, the whole where a chain hands it on.
  subroutine lean(sub, least, heaviest, changed)
    type(subproblem_t), intent(in) :: sub
    real(dp), intent(in) :: least
    type(leaning_t), intent(inout) :: heaviest
    logical, intent(inout) :: changed
    !> mass and velocity at the start of this step
    real(dp), allocatable :: before(:), velocity(:, :)
    !> the body has something to hand on that it has not handed on before
    logical, allocatable :: news(:)
    real(dp) :: r, handed
    integer :: c, k, i, j

    allocate (before, source=heaviest%mass(1, :))
    allocate (news(sub%n_columns))
    news(:) = before > max(least, heaviest%handed_on)
    if (.not. any(news)) return
    allocate (velocity, source=heaviest%velocity)
    do c = 1, sub%n_contacts
      if (.not. (news(sub%pair(1, c)) .or. news(sub%pair(2, c)))) cycle
      r = sub%impulse(lane_of(c), 1, block_of(c))
      if (.not. r > 0.0_dp) cycle
      do k = 1, 2
        i = sub%pair(k, c)
        j = sub%pair(3 - k, c)
        ! on what cannot move nothing leans that would go through it, nor does it hand anything on
        if (.not. (news(j) .and. heaviest%own(i) > 0.0_dp)) cycle
        handed = before(j)*min(1.0_dp, 2.0_dp*r/heaviest%pressed(j))
        if (.not. handed > max(least, heaviest%mass(1, i))) cycle
        heaviest%mass(1, i) = handed
        heaviest%velocity(:, i) = velocity(:, j)
        changed = .true.
      end do
    end do
    heaviest%handed_on(:) = before
  end subroutine lean

  !> All copies of a body take the heaviest that any of them knows. Collective.
  subroutine agree_on_copies(problem, heaviest)
    type(contact_problem_t), intent(inout) :: problem
    type(leaning_t), intent(inout) :: heaviest(:)
    !> slot of the copy that knows it, 0 for the own one
    type :: slots_t
      integer, allocatable :: of_body(:)
    end type slots_t
    type(slots_t) :: slot(size(heaviest))
    integer :: s, j, b

    do s = 1, size(heaviest)
      call problem%shared%load(s, heaviest(s)%mass)
    end do
    call problem%shared%pass()
    do s = 1, size(heaviest)
      allocate (slot(s)%of_body(problem%sub(s)%n_columns), source=0)
      associate (part => problem%shared%part(s))
        do j = 1, part%n_slots
          b = part%slot_body(j)
          if (.not. part%recv(1, j) > heaviest(s)%mass(1, b)) cycle
          heaviest(s)%mass(1, b) = part%recv(1, j)
          slot(s)%of_body(b) = j
        end do
      end associate
      call problem%shared%load(s, heaviest(s)%velocity)
    end do
    call problem%shared%pass()
    do s = 1, size(heaviest)
      do b = 1, problem%sub(s)%n_columns
        if (slot(s)%of_body(b) > 0) heaviest(s)%velocity(:, b) = problem%shared%part(s)%recv(:, slot(s)%of_body(b))
      end do
    end do
  end subroutine agree_on_copies

  !> The largest momentum with which a body goes against contact `c` [N s].
  pure real(dp) function pressing(kernels, sub, heaviest, c)
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(in) :: sub
    type(leaning_t), intent(in) :: heaviest
    integer, intent(in) :: c
    real(dp) :: missed, along(2), heavy, side, v
    integer :: k, d, nd

    nd = kernels%nd
    pressing = 0.0_dp
    missed = missed_velocity(kernels, sub, heaviest%missed(c), c)
    do k = 1, 2
      along(k) = 0.0_dp
      do d = 1, nd
        along(k) = along(k) + sub%hot(lane_of(c), d, block_of(c))*sub%v_global(d, sub%pair(k, c))
      end do
    end do
    do k = 1, 2
      pressing = max(pressing, heaviest%own(sub%pair(k, c))*min(abs(missed), abs(along(k))))
      heavy = 0.0_dp
      do d = 1, nd
        heavy = heavy + sub%hot(lane_of(c), d, block_of(c))*heaviest%velocity(d, sub%pair(k, c))
      end do
      side = merge(1.0_dp, -1.0_dp, k == 1)
      v = sign(1.0_dp, missed)*(side*(heavy - along(3 - k)) + sub%hot(lane_of(c), nd + 1, block_of(c)))
      pressing = max(pressing, heaviest%mass(1, sub%pair(k, c))*min(abs(missed), abs(heavy), v))
    end do
  end function pressing

end module gravier_closing
