!> The boundaries that support the bodies of a contact problem: those against which the load presses.
module gravier_supports
  use gravier_kinds, only: dp
  use gravier_contact_kernels, only: lanes
  use gravier_communicator, only: communicator_t
  use gravier_subproblem, only: subproblem_t
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
  subroutine find_supports(sub, comm, load, supports)
    type(subproblem_t), intent(in) :: sub(:)
    type(communicator_t), intent(in) :: comm
    !> change of velocity in a step by loads that are the same for all grains (nd) [m/s]
    real(dp), intent(in) :: load(:)
    type(supports_t), allocatable, intent(out) :: supports(:)
    !> of one subdomain: -n . u and the number of its contacts, by boundary (2 boundaries)
    real(dp), allocatable :: parts(:, :), sums(:)
    real(dp) :: size_of_load
    integer :: s, b, n

    allocate (supports(size(sub)))
    n = 0
    do s = 1, size(supports)
      allocate (supports(s)%column(sub(s)%n_columns), source=.false.)
    end do
    size_of_load = norm2(load)
    if (.not. size_of_load > 0.0_dp) return
    do s = 1, size(supports)
      if (size(sub(s)%boundary) > 0) n = max(n, maxval(sub(s)%boundary))
    end do
    n = nint(comm%highest(real(n, dp)))
    allocate (parts(2*n, size(supports)), sums(2*n))
    parts(:, :) = 0.0_dp
    do s = 1, size(supports)
      call add_contacts(sub(s), load, parts(1:n, s), parts(n + 1:, s))
    end do
    call comm%sum_parts(parts, sums)
    do s = 1, size(supports)
      associate (boundary => sub(s)%boundary)
        do b = sub(s)%n_bodies + 1, sub(s)%n_columns
          supports(s)%column(b) = boundary(b) == 0
          if (boundary(b) > 0) supports(s)%column(b) = sums(boundary(b)) > least_pressing*size_of_load*sums(n + boundary(b))
        end do
      end associate
    end do
  end subroutine find_supports

  !> How a load presses against boundaries that move as prescribed, over the contacts of a subdomain.
  subroutine add_contacts(sub, load, pressing, counts)
    type(subproblem_t), intent(in) :: sub
    !> (nd) [m/s]
    real(dp), intent(in) :: load(:)
    !> sums of -n . u, and the numbers of contacts (boundaries)
    real(dp), intent(inout), contiguous :: pressing(:), counts(:)
    real(dp) :: part
    integer :: g, q

    do g = 1, size(sub%hot, 3)
      do q = 1, min(lanes, sub%n_contacts - (g - 1)*lanes)
        if (maxval(sub%pair(:, (g - 1)*lanes + q)) <= sub%n_bodies) cycle
        part = dot_product(sub%hot(q, 1:size(load), g), load)
        call add(sub%pair(1, (g - 1)*lanes + q), part)
        call add(sub%pair(2, (g - 1)*lanes + q), -part)
      end do
    end do

  contains

    !> A contact of body `b`, where `b` moves as prescribed.
    subroutine add(b, part)
      integer, intent(in) :: b
      real(dp), intent(in) :: part

      if (b <= sub%n_bodies) return
      if (sub%boundary(b) == 0) return
      associate (k => sub%boundary(b))
        pressing(k) = pressing(k) + part
        counts(k) = counts(k) + 1.0_dp
      end associate
    end subroutine add

  end subroutine add_contacts

end module gravier_supports
