!> The safeguard of the enriched methods: a search direction l under which the changes of the impulses grow is lowered, down to
!> l = 0, which is the method without enrichment, and the solve goes on from impulses kept before the growth.
!>
!> Watched is the change |r - y|^2 of the first sweep of each iteration, over all subdomains, summed over windows of iterations.
!> Three windows in a row of which each exceeds the one before, the last by more than a factor 2 the one before the first, halve
!> l: at most 20 iterations after the growth sets in, where it is that fast. Growth by orders of magnitude, as of an l far too
!> large, does not wait for the end of a window. Changes that neither grow nor fall, of some percent of the impulses at each
!> iteration, are those of a cycle, of an l far too large as well. Growth that no l mends is for the method to say (`give_up`).
module gravier_direction_guard
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use gravier_kinds, only: dp
  use gravier_contact_problem, only: contact_problem_t
  use gravier_kept_impulses, only: kept_impulses_t, copy_impulses, restore_impulses
  implicit none
  private
  public :: direction_guard_t

  !> iterations of a window, growing windows in a row that lower l, and least growth over them
  integer, parameter :: window = 5, growing_windows = 3
  real(dp), parameter :: growth = 2.0_dp
  !> change, times the largest before growth set in, that lowers l at once
  real(dp), parameter :: explosion = 1.0e6_dp
  !> windows without one below `progress` times the lowest, and changes over impulses squared, that are a cycle
  integer, parameter :: idle_windows = 20
  real(dp), parameter :: progress = 0.8_dp, much = 1.0e-3_dp
  !> factors of l for windows that grow, and for the other two; and times that l is lowered before it is set to 0
  real(dp), parameter :: less = 0.5_dp, far_less = 1.0_dp/16.0_dp
  integer, parameter :: most_lowerings = 12
  !> no window yet
  real(dp), parameter :: unknown = huge(1.0_dp)

  type :: direction_guard_t
    !> what is left of l in this solve, and times that l was lowered in it
    real(dp) :: factor = 1.0_dp
    integer :: lowered = 0
    type(kept_impulses_t), allocatable, private :: kept(:)
    !> |r - y|^2: largest before growth set in, largest of this window, sums over this window, the last, and the one before growth
    real(dp), private :: reference = 0.0_dp, largest = 0.0_dp, now = 0.0_dp, last = unknown, before = unknown
    real(dp), private :: lowest = unknown
    !> iterations of the window, windows grown in a row, windows since the lowest
    integer, private :: iterations = 0, grown = 0, idle = 0
  contains
    procedure :: start => direction_guard_start
    procedure :: watch => direction_guard_watch
    procedure :: give_up => direction_guard_give_up
  end type direction_guard_t

contains

  !> Begin a solve: the whole of l, from the impulses that the problem holds.
  subroutine direction_guard_start(self, problem)
    class(direction_guard_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem

    if (allocated(self%kept)) deallocate (self%kept)
    allocate (self%kept(size(problem%sub)))
    call copy_impulses(problem, self%kept)
    self%factor = 1.0_dp
    self%lowered = 0
    self%reference = problem%force_scale**2*real(problem%n_contacts, dp)
    call open_windows(self)
  end subroutine direction_guard_start

  pure subroutine open_windows(guard)
    type(direction_guard_t), intent(inout) :: guard
    guard%now = 0.0_dp
    guard%largest = 0.0_dp
    guard%last = unknown
    guard%before = unknown
    guard%lowest = unknown
    guard%iterations = 0
    guard%grown = 0
    guard%idle = 0
  end subroutine open_windows

  !> Judge an iteration. If l is lowered, the impulses of the problem are those kept, and the caller must start its velocities
  !> and matrices anew. Collective.
  subroutine direction_guard_watch(self, problem, lowered)
    class(direction_guard_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    logical, intent(out) :: lowered
    real(dp) :: sums(2)

    lowered = .false.
    call problem%sum_progress(sums)
    if (.not. ieee_is_finite(sums(1))) then
      call lower(self, problem, far_less, lowered)
    else if (self%reference > 0.0_dp .and. sums(1) > explosion*self%reference) then
      call lower(self, problem, far_less, lowered)
    else
      self%largest = max(self%largest, sums(1))
      self%now = self%now + sums(1)
      self%iterations = self%iterations + 1
      if (self%iterations == window) call close_window(self, problem, sums(2), lowered)
    end if
  end subroutine direction_guard_watch

  !> Set l to 0 for the rest of the solve, as `watch` does where it lowers l.
  subroutine direction_guard_give_up(self, problem, lowered)
    class(direction_guard_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    logical, intent(out) :: lowered
    call lower(self, problem, 0.0_dp, lowered)
  end subroutine direction_guard_give_up

  subroutine close_window(guard, problem, impulses, lowered)
    type(direction_guard_t), intent(inout) :: guard
    type(contact_problem_t), intent(inout) :: problem
    !> |r|^2 [N^2 s^2]
    real(dp), intent(in) :: impulses
    logical, intent(inout) :: lowered

    if (guard%now > guard%last) then
      guard%grown = guard%grown + 1
    else
      guard%grown = 0
      guard%before = guard%now
      guard%reference = max(guard%reference, guard%largest)
      call copy_impulses(problem, guard%kept)
    end if
    guard%idle = guard%idle + 1
    if (guard%now < progress*guard%lowest) then
      guard%lowest = guard%now
      guard%idle = 0
    end if
    if (guard%grown >= growing_windows .and. guard%now/growth > guard%before) then
      call lower(guard, problem, less, lowered)
      return
    else if (guard%idle >= idle_windows .and. guard%now > window*much*impulses) then
      call lower(guard, problem, far_less, lowered)
      return
    end if
    guard%last = guard%now
    guard%now = 0.0_dp
    guard%largest = 0.0_dp
    guard%iterations = 0
  end subroutine close_window

  subroutine lower(guard, problem, factor, lowered)
    type(direction_guard_t), intent(inout) :: guard
    type(contact_problem_t), intent(inout) :: problem
    real(dp), intent(in) :: factor
    logical, intent(out) :: lowered

    call restore_impulses(problem, guard%kept)
    guard%lowered = guard%lowered + 1
    guard%factor = factor*guard%factor
    if (guard%lowered >= most_lowerings) guard%factor = 0.0_dp
    call open_windows(guard)
    lowered = .true.
  end subroutine lower

end module gravier_direction_guard
