!> Proximal Newton method on the velocities, for tolerances that sweeps do not reach.
!>
!> Outer loop: proximal points, as in gravier_contact_newton; its fixed points are the solutions with Coulomb's exact law, for
!> every weight alpha. Inner loop: semismooth Newton steps on gravier_proximal_law. The impulses of a step, dr = c - L H^T dV, are
!> eliminated contact by contact; with M V = R^d + H r at every point there remains (M + H L H^T) dV = H c, in subdomains
!>   X_L F = sum_E A_E M_L,E^-1 H_E c_E,   dV_E = M_L,E^-1 (H_E c_E - A_E^T F),   M_L,E = M~_E + H_E L_E H_E^T,
!> the interface problem of NSCDD-EP with blocks L for l. Newton's method converges near a solution: accelerated sweeps come
!> first, and again where it makes no progress.
module gravier_newton
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_timers, only: start_timer, stop_timer, phase_factorise, phase_interface_solve, phase_check
  use gravier_contact_kernels, only: kernels_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  use gravier_kept_impulses, only: kept_impulses_t, copy_impulses, restore_impulses
  use gravier_method, only: work_t, start_sweeps
  use gravier_method_options, only: method_features_t, method_options_t, held_list_t
  use gravier_nscdd, only: nscdd_t
  use gravier_proximal_law, only: proximal_law_t, parts_of
  use gravier_proximal_weight, only: proximal_weight_t
  use gravier_sweep_turns, only: sweep_turns_t
  use gravier_enriched_matrix, only: enriched_matrix_t
  use gravier_interface_problem, only: interface_field_t, make_field, chain_differences, load_transpose
  use gravier_interface_direct, only: interface_direct_t
  implicit none
  private
  public :: newton_t

  !> what is left of a defect that has fallen far enough to be progress
  real(dp), parameter :: progress_made = 0.8_dp
  !> most steps to a proximal point
  integer, parameter :: most_inner_steps = 25
  !> what is left of |F| where a proximal point counts as found; what may be left of its lowest value after so many steps
  !> more, or it counts as not found
  real(dp), parameter :: found_point = 0.1_dp, some_gain = 0.7_dp
  integer, parameter :: stall = 4
  !> the line search compares with the greatest of so many last values, and halves the step so often at most
  integer, parameter :: memory = 5, most_halvings = 8
  real(dp), parameter :: sufficient = 1.0e-4_dp

  !> Of one subdomain.
  type :: newton_part_t
    type(proximal_law_t) :: law
    !> Newton's step (lanes, nc, blocks) [N s]; velocities of the contacts [m/s]
    real(dp), allocatable :: step(:, :, :), v(:, :, :)
    !> velocities of the bodies where the sweeps were left (nv, n_columns)
    real(dp), allocatable :: swept_velocity(:, :)
  end type newton_part_t

  type, extends(nscdd_t) :: newton_t
    type(enriched_matrix_t), private :: matrix
    type(interface_direct_t), private :: interface_solver
    type(newton_part_t), allocatable, private :: part(:)
    !> Newton's iterate, the best impulses so far, those where the sweeps were left
    type(kept_impulses_t), allocatable, private :: r(:), best(:), swept(:)
    type(interface_field_t), allocatable, private :: b(:), f(:)
    logical, private :: sweeping = .true.
    type(sweep_turns_t), private :: turns
    !> Newton's steps since the last progress; those of this proximal point
    integer, private :: taken = 0, inner = 0
    type(proximal_weight_t), private :: weight
    !> |F| at the iterate and at the last points of the inner loop, and where it counts as solved [N s]
    real(dp), private :: size_of_f = 0.0_dp, past(memory) = 0.0_dp, goal = 0.0_dp
    !> lowest |F| after each step of the inner loop [N s]
    real(dp), private :: reached(0:most_inner_steps) = 0.0_dp
    !> defects: of the best impulses, of the last centre, of the last progress; the least when the sweeps were left [N s]
    real(dp), private :: least = 0.0_dp, before = 0.0_dp, mark = 0.0_dp, least_swept = 0.0_dp
  contains
    procedure, nopass :: features => newton_features
    procedure :: set => newton_set
    procedure :: held => newton_held
    procedure :: start => newton_start
    procedure :: iterate => newton_iterate
    procedure :: see => newton_see
    procedure :: conclude => newton_conclude
    procedure :: free => newton_free
    procedure :: work_done => newton_work_done
  end type newton_t

contains

  pure function newton_features() result(features)
    type(method_features_t) :: features
    features = method_features_t(name="newton", &
      & meaning="accelerated sweeps of NSCDD and, where they stagnate, a proximal Newton method", moments=.true., &
      & direct_interface_only=.true.)
  end function newton_features

  subroutine newton_set(self, options)
    class(newton_t), intent(inout) :: self
    type(method_options_t), intent(in) :: options

    call self%nscdd_t%set(options)
    self%acceleration%on = .true.
  end subroutine newton_set

  pure subroutine newton_held(self, nc, nv, held)
    class(newton_t), intent(in) :: self
    integer, intent(in) :: nc, nv
    type(held_list_t), intent(inout) :: held

    call self%nscdd_t%held(nc, nv, held)
    call held%add("impulses of Newton's method", .true., 8, 4*nc)
    call held%add("velocity of Newton's method", .true., 8, nc)
    call held%add("law of Newton's method", .true., 8, 5*nc + nc**2 + parts_of(nc, nv))
    call held%add("state of Newton's method", .true., 4, parts_of(nc, nv) + 1)
    call held%add("velocity of the sweeps of Newton's method", .false., 8, nv)
    call held%add("velocity of Newton's steps", .false., 8, nv)
  end subroutine newton_held

  subroutine newton_start(self, problem, error)
    class(newton_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    type(error_t), allocatable, intent(inout) :: error
    integer :: s

    if (allocated(error)) return
    self%acceleration%on = .true.
    call self%nscdd_t%start(problem, error)
    self%persists = .true.
    self%matrix%general = .true.
    call self%matrix%start(problem, error)
    call problem%comm%agree(error)
    if (allocated(error)) return
    call make_field(problem%shared, self%b)
    call make_field(problem%shared, self%f)
    if (allocated(self%part)) deallocate (self%part, self%r, self%best, self%swept)
    allocate (self%part(size(problem%sub)), self%r(size(problem%sub)), self%best(size(problem%sub)), self%swept(size(problem%sub)))
    call copy_impulses(problem, self%best)
    do s = 1, size(self%part)
      call make_room(problem%kernels, problem%sub(s), self%part(s))
    end do
    self%turns = sweep_turns_t()
    self%least = huge(1.0_dp)
    call begin_sweeps(self)
  end subroutine newton_start

  !> Room for the steps in a subdomain, and its law.
  subroutine make_room(kernels, sub, part)
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(in) :: sub
    type(newton_part_t), intent(inout) :: part

    call part%law%init(kernels, sub)
    allocate (part%step, part%v, mold=sub%impulse)
    part%step(:, :, :) = 0.0_dp
    part%v(:, :, :) = 0.0_dp
    allocate (part%swept_velocity, mold=sub%velocity)
  end subroutine make_room

  !> Sweeps come next.
  subroutine begin_sweeps(self)
    class(newton_t), intent(inout) :: self

    self%sweeping = .true.
    self%acceleration%on = self%turns%accelerate()
    self%check_next = .false.
    self%keeps_best = .true.
  end subroutine begin_sweeps

  subroutine newton_iterate(self, problem, measure, jump, error)
    class(newton_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    logical, intent(in) :: measure
    real(dp), intent(out) :: jump
    type(error_t), allocatable, intent(inout) :: error
    logical :: over

    jump = 0.0_dp
    if (allocated(error)) return
    if (self%sweeping) then
      call self%nscdd_t%iterate(problem, measure, jump, error)
      call self%turns%count_sweep(self%acceleration%change, over)
      if (over) call begin_steps(self, problem)
    else
      call make_step(self, problem, measure, jump)
    end if
  end subroutine newton_iterate

  !> Newton's steps come next, from where the sweeps have come to. Collective.
  subroutine begin_steps(self, problem)
    class(newton_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    real(dp) :: defect
    integer :: s

    self%sweeping = .false.
    self%check_next = .true.
    self%taken = 0
    self%weight = proximal_weight_t()
    call keep_best(self, problem, defect)
    call copy_impulses(problem, self%r)
    call copy_impulses(problem, self%swept)
    do s = 1, size(self%part)
      associate (part => self%part(s), sub => problem%sub(s))
        part%swept_velocity(:, :) = sub%velocity
      end associate
    end do
    self%least_swept = self%least
    self%mark = defect
    self%before = defect
    call restart_point(self, problem, moves=.true.)
    call take_best(self, problem)
  end subroutine begin_steps

  !> Newton's method for the proximal point starts from its centre. Collective.
  subroutine restart_point(self, problem, moves)
    class(newton_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    !> the iterate is the next centre
    logical, intent(in) :: moves
    integer :: s

    do s = 1, size(self%part)
      if (moves) self%part(s)%law%centre(:, :, :) = self%r(s)%value
      self%r(s)%value(:, :, :) = self%part(s)%law%centre
    end do
    call restore_impulses(problem, self%r)
    call evaluate(self, problem, self%size_of_f)
    self%inner = 0
    self%past(:) = 0.0_dp
    self%goal = found_point*self%size_of_f
    self%reached(0) = self%size_of_f
  end subroutine restart_point

  !> |F| at the impulses of the problem. Collective.
  subroutine evaluate(self, problem, size_of_f)
    class(newton_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    real(dp), intent(out) :: size_of_f
    real(dp) :: squares(size(problem%sub))
    integer :: s

    call problem%evaluate()
    do s = 1, size(problem%sub)
      associate (part => self%part(s), sub => problem%sub(s))
        call sub%contact_velocity(problem%kernels, sub%v_global, part%v)
        call part%law%evaluate(problem%kernels, sub, part%v, self%weight%alpha, squares(s))
      end associate
    end do
    size_of_f = sqrt(problem%comm%sum_real(squares))
  end subroutine evaluate

  !> One step of Newton's method, and what follows from it. The impulses left in the problem are the best so far. Collective.
  subroutine make_step(self, problem, measure, jump)
    class(newton_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    logical, intent(in) :: measure
    real(dp), intent(inout) :: jump
    type(error_t), allocatable :: singular
    real(dp) :: defect

    if (problem%cell_is_driven()) call follow_cell(self, problem)
    self%past(1 + mod(self%inner, memory)) = self%size_of_f
    call find_step(self, problem, singular)
    self%inner = self%inner + 1
    self%taken = self%taken + 1
    self%work%iterations = self%work%iterations + 1
    self%work%interface_solves = self%work%interface_solves + 1
    if (measure .and. .not. allocated(singular)) jump = problem%jump()
    call start_timer(phase_check)
    if (.not. allocated(singular)) call search_line(self, problem)
    call keep_best(self, problem, defect)
    self%reached(self%inner) = min(self%reached(self%inner - 1), self%size_of_f)
    if (allocated(singular) .or. self%size_of_f <= self%goal .or. is_stuck(self)) call end_point(self, problem, defect)
    call take_best(self, problem)
    if (self%sweeping) call resume_sweeps(self, problem)
    call stop_timer(phase_check)
  end subroutine make_step

  !> The cell has answered to the best impulses: measure them, and F at the iterate, anew under its present motion. Collective.
  subroutine follow_cell(self, problem)
    class(newton_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    real(dp) :: ignored

    call problem%evaluate()
    call problem%residual(ignored, self%least)
    call restore_impulses(problem, self%r)
    call evaluate(self, problem, self%size_of_f)
  end subroutine follow_cell

  !> Sweeps go on from where they were left, or, plain ones, from the best impulses if Newton's steps have found them. Collective.
  subroutine resume_sweeps(self, problem)
    class(newton_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    integer :: s

    if (self%acceleration%on .or. .not. self%least < self%least_swept) then
      call restore_impulses(problem, self%swept)
      do s = 1, size(self%part)
        ! operators of accelerated sweeps are relaxed
        if (.not. self%acceleration%on) call problem%sub(s)%share_masses(problem%kernels, .true.)
        problem%sub(s)%velocity(:, :) = self%part(s)%swept_velocity
      end do
    else
      call start_sweeps(self, problem, shared_masses=.true.)
    end if
  end subroutine resume_sweeps

  !> Whether the proximal point is not in reach.
  pure logical function is_stuck(self)
    class(newton_t), intent(in) :: self
    is_stuck = self%inner == most_inner_steps
    if (self%inner > stall) is_stuck = is_stuck .or. self%reached(self%inner) > some_gain*self%reached(self%inner - stall)
  end function is_stuck

  !> The step of the impulses, into `step`, with the velocities that it gives the copies. Collective.
  subroutine find_step(self, problem, singular)
    class(newton_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    !> allocated, on all ranks, where a matrix was
    type(error_t), allocatable, intent(inout) :: singular
    integer :: s

    call start_timer(phase_factorise)
    do s = 1, size(problem%sub)
      call self%part(s)%law%linearise(problem%kernels, problem%sub(s), self%weight%alpha)
      call self%matrix%factorise_blocks(problem%kernels, problem%sub(s), s, self%part(s)%law%slope, singular)
    end do
    call problem%comm%agree(singular)
    if (.not. allocated(singular)) call self%interface_solver%prepare(problem, self%matrix, singular)
    call stop_timer(phase_factorise)
    if (allocated(singular)) return
    call start_timer(phase_interface_solve)
    if (problem%n_subdomains > 1) call find_multipliers(self, problem, singular)
    do s = 1, size(problem%sub)
      call load_transpose(problem%shared, s, self%f(s), self%matrix)
      associate (part => self%part(s), sub => problem%sub(s), work => self%matrix%part(s)%body_work)
        work(:, :) = -work
        call sub%add_reaction(problem%kernels, part%law%offset, work)
        call self%matrix%solve(problem%sub(s), s, work, singular)
        call sub%contact_velocity(problem%kernels, work, part%v)
        call part%law%find_step(part%v, part%step)
        sub%velocity(:, :) = sub%v_global + work
      end associate
    end do
    call problem%comm%agree(singular)
    call stop_timer(phase_interface_solve)
  end subroutine find_step

  !> Multipliers that keep the copies of bodies together, into `f`. Collective.
  subroutine find_multipliers(self, problem, error)
    class(newton_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    type(error_t), allocatable, intent(inout) :: error
    integer :: s

    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s), work => self%matrix%part(s)%body_work)
        work(:, :) = 0.0_dp
        call sub%add_reaction(problem%kernels, self%part(s)%law%offset, work)
        call self%matrix%solve(problem%sub(s), s, work, error)
      end associate
    end do
    call chain_differences(problem%shared, self%matrix, self%b)
    call problem%comm%agree(error)
    if (allocated(error)) return
    call self%interface_solver%solve(problem, self%matrix, self%b, self%f, error)
  end subroutine find_multipliers

  !> Go along the step: all of it, or half and so on until F falls below a reference, or to where it was least. Collective.
  subroutine search_line(self, problem)
    class(newton_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    real(dp) :: length, best_length, least, reference
    integer :: k

    reference = maxval(self%past)
    length = 1.0_dp
    best_length = 0.0_dp
    least = huge(least)
    do k = 1, most_halvings
      call go(length)
      if (self%size_of_f < least) then
        least = self%size_of_f
        best_length = length
      end if
      if (self%size_of_f <= (1.0_dp - sufficient*length)*reference) exit
      length = 0.5_dp*length
    end do
    if (k > most_halvings) call go(best_length)
    call copy_impulses(problem, self%r)

  contains

    subroutine go(part_of_step)
      real(dp), intent(in) :: part_of_step
      integer :: i

      call restore_impulses(problem, self%r)
      if (part_of_step > 0.0_dp) then
        do i = 1, size(self%part)
          call problem%sub(i)%add_impulses(part_of_step, self%part(i)%step)
        end do
      end if
      call evaluate(self, problem, self%size_of_f)
    end subroutine go

  end subroutine search_line

  !> Project the impulses of the problem on Coulomb's cones, outside of which iterates may lie, and keep them if they are the
  !> best so far. Collective.
  subroutine keep_best(self, problem, defect)
    class(newton_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    !> of these impulses [N s]
    real(dp), intent(out) :: defect
    real(dp) :: ignored
    integer :: s

    do s = 1, size(problem%sub)
      call problem%sub(s)%project_impulses(problem%kernels)
    end do
    call problem%evaluate()
    call problem%residual(ignored, defect)
    call self%see(problem, defect)
  end subroutine keep_best

  !> Keep the impulses of the problem if they are the best so far.
  subroutine newton_see(self, problem, defect)
    class(newton_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    real(dp), intent(in) :: defect

    if (.not. defect < self%least) return
    self%least = defect
    call copy_impulses(problem, self%best)
  end subroutine newton_see

  !> The impulses of the problem are the best so far.
  subroutine take_best(self, problem)
    class(newton_t), intent(in) :: self
    type(contact_problem_t), intent(inout) :: problem

    call restore_impulses(problem, self%best)
  end subroutine take_best

  !> The iterate becomes the next centre if it is worth it, alpha goes with the steps taken; where all that has brought no
  !> progress, sweeps come next. Collective.
  subroutine end_point(self, problem, defect)
    class(newton_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    !> of the iterate [N s]
    real(dp), intent(in) :: defect
    logical :: found, moves

    found = self%size_of_f <= self%goal
    call self%weight%adapt(found, self%inner)
    if (defect < progress_made*self%mark) then
      self%mark = defect
      self%taken = 0
    else if (self%taken >= self%turns%patience()) then
      call self%turns%finish()
      call begin_sweeps(self)
      return
    end if
    moves = found .or. defect < self%before
    self%before = defect
    call restart_point(self, problem, moves)
  end subroutine end_point

  !> The end of a solve without success. Collective.
  subroutine newton_conclude(self, problem)
    class(newton_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    real(dp) :: ignored

    call keep_best(self, problem, ignored)
    call take_best(self, problem)
    call problem%evaluate()
  end subroutine newton_conclude

  subroutine newton_free(self)
    class(newton_t), intent(inout) :: self
    call self%matrix%free()
    call self%interface_solver%free()
    if (allocated(self%part)) deallocate (self%part, self%r, self%best, self%swept, self%b, self%f)
    self%work = work_t()
  end subroutine newton_free

  type(work_t) function newton_work_done(self) result(work)
    class(newton_t), intent(in) :: self
    work = self%work
    call self%matrix%counts(work%analyses, work%factorisations)
    work%interface_iterations = self%interface_solver%iterations
  end function newton_work_done

end module gravier_newton
