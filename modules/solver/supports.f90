!> The boundaries that support the bodies of a contact problem: those against which the load presses.
module gravier_supports
  use gravier_kinds, only: dp
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  implicit none
  private
  public :: supports_t, find_supports

  !> mean of -n . u/|u| over the contacts of a boundary from which on it supports, u the change of velocity by the load in a step
  real(dp), parameter :: least_pressing = 0.3_dp

  !> Of one subdomain.
  type :: supports_t
    !> what moves as prescribed and supports (n_columns)
    logical, allocatable :: column(:)
  end type supports_t

contains

  !> Find them by the mean over the contacts of each boundary. Without a uniform load nothing supports. Collective.
  subroutine find_supports(problem, supports)
    type(contact_problem_t), intent(in) :: problem
    type(supports_t), allocatable, intent(out) :: supports(:)
    !> of one subdomain: -n . u and the number of its contacts, by boundary (2 boundaries)
    real(dp), allocatable :: parts(:, :), sums(:)
    real(dp) :: load
    integer :: s, b, c, n

    allocate (supports(size(problem%sub)))
    n = 0
    do s = 1, size(supports)
      allocate (supports(s)%column(problem%sub(s)%n_columns), source=.false.)
    end do
    load = norm2(problem%load(1:problem%kernels%nd))
    if (.not. load > 0.0_dp) return
    do s = 1, size(supports)
      if (size(problem%sub(s)%boundary) > 0) n = max(n, maxval(problem%sub(s)%boundary))
    end do
    n = nint(problem%comm%highest(real(n, dp)))
    allocate (parts(2*n, size(supports)), sums(2*n))
    parts(:, :) = 0.0_dp
    do s = 1, size(supports)
      do c = 1, problem%sub(s)%n_contacts
        call add_pressing(problem%sub(s)%pair(1, c), -1.0_dp)
        call add_pressing(problem%sub(s)%pair(2, c), 1.0_dp)
      end do
    end do
    call problem%comm%sum_parts(parts, sums)
    do s = 1, size(supports)
      associate (sub => problem%sub(s))
        do b = sub%n_bodies + 1, sub%n_columns
          supports(s)%column(b) = sums(sub%boundary(b)) > least_pressing*load*sums(n + sub%boundary(b))
        end do
      end associate
    end do

  contains

    !> A contact with body `b`, from which its normal points where `side` is 1.
    subroutine add_pressing(b, side)
      integer, intent(in) :: b
      real(dp), intent(in) :: side
      integer :: d, k

      associate (sub => problem%sub(s))
        if (b <= sub%n_bodies) return
        k = sub%boundary(b)
        do d = 1, problem%kernels%nd
          parts(k, s) = parts(k, s) - side*sub%hot(lane_of(c), d, block_of(c))*problem%load(d)
        end do
        parts(n + k, s) = parts(n + k, s) + 1.0_dp
      end associate
    end subroutine add_pressing

  end subroutine find_supports

end module gravier_supports
