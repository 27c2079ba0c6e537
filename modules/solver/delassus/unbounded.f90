!> Contact problems without a solution, told by impulses that grow without bound.
!>
!> Where v = W r + q and the law contradict each other, iterations add nearly the same impulses z in each window of sweeps, and z
!> tends to impulses in the cones that bodies balance, W z = 0, while z.q < 0: they push where bodies or walls of prescribed
!> velocity approach, to no avail (the same holds for convex problems and other methods: G. Banjac, P. Goulart, B. Stellato and S.
!> Boyd, Infeasibility detection in the alternating direction method of multipliers for convex optimization, J. Optim. Theory Appl.
!> 183, 2019). Any z gives a bound. With z >= 0 along the normals alone, a solution has v_n >= 0 and so
!>
!>     0 <= z.v = z.W r + z.q,   -z.q <= r.W^T z <= max(s |r|) sum(|W^T z|/s),
!>
!> s the stiffness of each contact. Loads that do not grow need max(s |r|) >= -z.q/sum(|W^T z|/s) =: B max|q|. A heavy body on a
!> light one needs a B of their ratio of masses. Where B is beyond what loads make in other problems, and what is left of W^T z
!> besides is no more than roundings may be, this proves that there is no solution. With friction in z it does not: z.v may be
!> negative where contacts slip. Then it marks iterations that grow for ever, as long as contacts keep their states.
module gravier_unbounded
  use gravier_kinds, only: dp
  use gravier_delassus, only: delassus_t, most_impulse
  use gravier_friction_cone, only: project_on_cone
  implicit none
  private
  public :: growth_none, growth_marked, growth_proven, growth_t, find_growth, note_growth

  !> no sign of growth without bound; W z = 0 and z.q < 0 with friction in z; a proof
  integer, parameter :: growth_none = 0, growth_marked = 1, growth_proven = 2
  !> marks one after the other that end an iteration
  integer, parameter :: enough_marks = 2
  !> roundings of W z up to which it counts as 0, for a mark and for a proof
  real(dp), parameter :: nearly_balanced = 1.0e6_dp, balanced = 1.0e2_dp

  !> What is known of the growth of impulses.
  type :: growth_t
    !> growth_none, growth_marked or growth_proven
    integer :: kind = growth_none
    !> marks one after the other
    integer :: marks = 0
    !> impulses that a solution would need at least, as velocities s |r| relative to max|q|
    real(dp) :: bound = 0.0_dp
    !> contact whose impulse grows most, as s |z|
    integer :: contact = 0
  contains
    procedure :: ends => growth_ends
  end type growth_t

  !> Sums over contacts from which the bound follows. Sums and maxima over parts of a problem add up to those of the whole.
  type :: ray_sums_t
    !> z.q, and what it may be wrong by
    real(dp), private :: work = 0.0_dp, work_error = 0.0_dp
    !> sums of |W z|/s, and of what it may be wrong by
    real(dp), private :: motion = 0.0_dp, rounding = 0.0_dp
    !> max|q|
    real(dp), private :: speed = 0.0_dp
    !> largest s |z|, and its contact
    real(dp), private :: largest = 0.0_dp
    integer :: contact = 0
  contains
    procedure :: add => ray_sums_add
    procedure :: bound => ray_sums_bound
    procedure :: tells => ray_sums_tells
  end type ray_sums_t

contains

  !> Whether an iteration may end: a proof, or marks enough.
  pure logical function growth_ends(self)
    class(growth_t), intent(in) :: self
    growth_ends = self%kind == growth_proven .or. self%marks >= enough_marks
  end function growth_ends

  !> Add a contact.
  pure subroutine ray_sums_add(self, contact, stiffness, q, z, wz, wz_error)
    class(ray_sums_t), intent(inout) :: self
    integer, intent(in) :: contact
    !> s
    real(dp), intent(in) :: stiffness
    !> velocity without impulses, change of impulse, W z of the contact (dimension)
    real(dp), intent(in) :: q(:), z(:), wz(:)
    !> what W z may be wrong by
    real(dp), intent(in) :: wz_error
    real(dp) :: length

    length = norm2(z)
    self%work = self%work + dot_product(z, q)
    self%work_error = self%work_error + epsilon(length)*length*norm2(q)
    self%motion = self%motion + norm2(wz)/stiffness
    self%rounding = self%rounding + wz_error/stiffness
    self%speed = max(self%speed, norm2(q))
    if (stiffness*length > self%largest) then
      self%largest = stiffness*length
      self%contact = contact
    end if
  end subroutine ray_sums_add

  !> The bound B; 0 where z.q is not negative beyond rounding.
  pure real(dp) function ray_sums_bound(self) result(bound)
    class(ray_sums_t), intent(in) :: self

    bound = 0.0_dp
    if (self%work + self%work_error < 0.0_dp .and. self%motion + self%rounding > 0.0_dp) &
      & bound = -(self%work + self%work_error)/((self%motion + self%rounding)*self%speed)
  end function ray_sums_bound

  !> Whether z speaks against a solution: it needs impulses beyond those of loads, and bodies balance it but for so many roundings.
  pure logical function ray_sums_tells(self, roundings) result(tells)
    class(ray_sums_t), intent(in) :: self
    real(dp), intent(in) :: roundings
    tells = self%bound() > most_impulse .and. self%motion <= roundings*self%rounding
  end function ray_sums_tells

  !> Take the look at a change of impulses into account: a proof stays, marks count one after the other.
  subroutine note_growth(problem, change, growth)
    type(delassus_t), intent(in) :: problem
    !> what a window of an iteration added to the impulses; of no use after (dimension, contacts)
    real(dp), intent(inout), contiguous :: change(:, :)
    type(growth_t), intent(inout) :: growth
    type(growth_t) :: seen

    call find_growth(problem, change, seen)
    if (seen%kind == growth_marked) seen%marks = growth%marks + 1
    if (growth%kind /= growth_proven) growth = seen
  end subroutine note_growth

  !> What a change of impulses says: first its part in the cones, then, where that has a bound beyond loads, its normal part.
  subroutine find_growth(problem, change, growth)
    type(delassus_t), intent(in) :: problem
    !> the change in, its normal part or its part in the cones out (dimension, contacts)
    real(dp), intent(inout), contiguous :: change(:, :)
    type(growth_t), intent(out) :: growth
    type(ray_sums_t) :: sums
    integer :: a

    do a = 1, problem%n_contacts
      call project_on_cone(change(:, a), problem%mu(a))
    end do
    ! most changes of iterations that converge end here
    if (.not. sum(change*problem%q) < 0.0_dp) return
    call sum_ray(problem, change, .false., sums)
    growth%bound = sums%bound()
    growth%contact = sums%contact
    if (.not. sums%tells(nearly_balanced)) return
    growth%kind = growth_marked
    change(2:, :) = 0.0_dp
    call sum_ray(problem, change, .true., sums)
    if (.not. sums%tells(balanced)) return
    growth%kind = growth_proven
    growth%bound = sums%bound()
    growth%contact = sums%contact
  end subroutine find_growth

  !> The sums of z, with W z or W^T z.
  subroutine sum_ray(problem, z, transposed, sums)
    type(delassus_t), intent(in) :: problem
    !> (dimension, contacts)
    real(dp), intent(in), contiguous :: z(:, :)
    logical, intent(in) :: transposed
    type(ray_sums_t), intent(out) :: sums
    real(dp), allocatable :: wz(:, :), wz_error(:)
    integer :: a, k

    allocate (wz(size(z, 1), size(z, 2)), wz_error(size(z, 2)))
    wz(:, :) = 0.0_dp
    wz_error(:) = 0.0_dp
    do a = 1, problem%n_contacts
      call add_block(a, a, problem%own(:, a))
      do k = problem%first(a), problem%first(a + 1) - 1
        call add_block(a, problem%other(k), problem%coupling(:, k))
      end do
    end do
    do a = 1, problem%n_contacts
      call sums%add(a, problem%stiffness(a), problem%q(:, a), z(:, a), wz(:, a), wz_error(a))
    end do

  contains

    !> Block `w`, by columns, of row `i` and column `j`.
    subroutine add_block(i, j, w)
      integer, intent(in) :: i, j
      real(dp), intent(in) :: w(:)
      integer :: l, m, to, from, d

      d = problem%dimension
      to = merge(j, i, transposed)
      from = merge(i, j, transposed)
      do m = 1, d
        do l = 1, d
          if (transposed) then
            wz(m, to) = wz(m, to) + w(l + (m - 1)*d)*z(l, from)
          else
            wz(l, to) = wz(l, to) + w(l + (m - 1)*d)*z(m, from)
          end if
        end do
      end do
      wz_error(to) = wz_error(to) + epsilon(w)*norm2(w)*norm2(z(:, from))
    end subroutine add_block

  end subroutine sum_ray

end module gravier_unbounded
