!> What every method is: something that improves the impulses of a contact problem by iterations.
module gravier_scheme
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_timers, only: start_timer, stop_timer, phase_sweep
  use gravier_contact_problem, only: contact_problem_t
  implicit none
  private
  public :: scheme_t, work_t, start_velocities, sweep_all

  !> What a method has done since it was made, for the closing table of a run.
  type :: work_t
    integer(i8) :: solves = 0, iterations = 0
    !> sweeps, and contacts relaxed on this rank
    integer(i8) :: sweeps = 0, relaxations = 0
    integer(i8) :: interface_solves = 0, interface_iterations = 0
    integer(i8) :: analyses = 0, factorisations = 0
  end type work_t

  type, abstract :: scheme_t
    !> n_GS: sweeps of one iteration
    integer :: sweeps = 1
    type(work_t) :: work
  contains
    procedure(start_solve), deferred :: start
    procedure(iterate_once), deferred :: iterate
    procedure :: free => scheme_free
    procedure :: work_done => scheme_work_done
  end type scheme_t

  abstract interface
    !> Make ready for a new problem, from the impulses it holds. Collective; an error is the same on all ranks.
    subroutine start_solve(self, problem, error)
      import :: scheme_t, contact_problem_t, error_t
      implicit none
      class(scheme_t), intent(inout) :: self
      type(contact_problem_t), intent(inout) :: problem
      type(error_t), allocatable, intent(inout) :: error
    end subroutine start_solve
    !> One iteration: sweeps in every subdomain, then one exchange. Collective; an error is the same on all ranks.
    subroutine iterate_once(self, problem, measure, jump, error)
      import :: scheme_t, contact_problem_t, error_t, dp
      implicit none
      class(scheme_t), intent(inout) :: self
      type(contact_problem_t), intent(inout) :: problem
      !> whether `jump` is asked for
      logical, intent(in) :: measure
      !> velocity jump between copies after the sweeps, see contact_problem_t%jump; 0 where not measured
      real(dp), intent(out) :: jump
      type(error_t), allocatable, intent(inout) :: error
    end subroutine iterate_once
  end interface

contains

  !> Give back what the method holds; methods that hold something override it.
  subroutine scheme_free(self)
    class(scheme_t), intent(inout) :: self
    self%work = work_t()
  end subroutine scheme_free

  !> Work done since the method was made; methods with factors of their own override it.
  type(work_t) function scheme_work_done(self) result(work)
    class(scheme_t), intent(in) :: self
    work = self%work
  end function scheme_work_done

  !> Masses as the method wants them, and velocities that agree with the impulses in all copies.
  subroutine start_velocities(problem, shared_masses)
    type(contact_problem_t), intent(inout) :: problem
    !> masses shared between the copies of a body (dual Schur methods), or whole in each
    logical, intent(in) :: shared_masses
    logical :: warm
    integer :: s

    warm = problem%any_impulse()
    if (warm) call problem%evaluate()
    do s = 1, size(problem%sub)
      call problem%sub(s)%share_masses(shared_masses)
      if (warm) then
        problem%sub(s)%velocity(:, :) = problem%sub(s)%v_global
      else
        problem%sub(s)%velocity(:, :) = problem%sub(s)%v_free
      end if
    end do
  end subroutine start_velocities

  !> Sweeps in every subdomain of this rank.
  subroutine sweep_all(scheme, problem)
    class(scheme_t), intent(inout) :: scheme
    type(contact_problem_t), intent(inout) :: problem
    integer :: s, k

    call start_timer(phase_sweep)
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do k = 1, scheme%sweeps
          call problem%kernels%sweep(sub%n_grouped, sub%pair, sub%hot, sub%weight, sub%velocity, sub%impulse)
        end do
        scheme%work%relaxations = scheme%work%relaxations + int(scheme%sweeps, i8)*sub%n_contacts
      end associate
    end do
    scheme%work%sweeps = scheme%work%sweeps + scheme%sweeps
    scheme%work%iterations = scheme%work%iterations + 1
    call stop_timer(phase_sweep)
  end subroutine sweep_all

end module gravier_scheme
