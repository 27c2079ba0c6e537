!> The boundaries that support the bodies of a contact problem: those against which the load presses.
module gravier_supports
  use gravier_kinds, only: dp
  use gravier_contact_kernels, only: lanes
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
    real(dp) :: load, pressing
    integer :: s, b, g, q, n

    allocate (supports(size(problem%sub)))
    n = 0
    do s = 1, size(supports)
      allocate (supports(s)%column(problem%sub(s)%n_columns), source=.false.)
    end do
    load = norm2(problem%load(1:problem%nd))
    if (.not. load > 0.0_dp) return
    do s = 1, size(supports)
      if (size(problem%sub(s)%boundary) > 0) n = max(n, maxval(problem%sub(s)%boundary))
    end do
    n = nint(problem%comm%highest(real(n, dp)))
    allocate (parts(2*n, size(supports)), sums(2*n))
    parts(:, :) = 0.0_dp
    do s = 1, size(supports)
      associate (sub => problem%sub(s))
        do g = 1, size(sub%hot, 3)
          do q = 1, min(lanes, sub%n_contacts - (g - 1)*lanes)
            if (maxval(sub%pair(:, (g - 1)*lanes + q)) <= sub%n_bodies) cycle
            pressing = dot_product(sub%hot(q, 1:problem%nd, g), problem%load(1:problem%nd))
            call add_pressing(sub%pair(1, (g - 1)*lanes + q), pressing)
            call add_pressing(sub%pair(2, (g - 1)*lanes + q), -pressing)
          end do
        end do
      end associate
    end do
    call problem%comm%sum_parts(parts, sums)
    do s = 1, size(supports)
      associate (sub => problem%sub(s))
        do b = sub%n_bodies + 1, sub%n_columns
          supports(s)%column(b) = sub%boundary(b) == 0
          if (sub%boundary(b) > 0) supports(s)%column(b) = sums(sub%boundary(b)) > least_pressing*load*sums(n + sub%boundary(b))
        end do
      end associate
    end do

  contains

    !> A contact of body `b` against which a load presses, where `b` moves as prescribed.
    subroutine add_pressing(b, pressing)
      integer, intent(in) :: b
      real(dp), intent(in) :: pressing

      if (b <= problem%sub(s)%n_bodies) return
      if (problem%sub(s)%boundary(b) == 0) return
      associate (k => problem%sub(s)%boundary(b))
        parts(k, s) = parts(k, s) + pressing
        parts(n + k, s) = parts(n + k, s) + 1.0_dp
      end associate
    end subroutine add_pressing

  end subroutine find_supports

end module gravier_supports
