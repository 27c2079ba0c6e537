!> The exact impulses of a column of equal grains at rest under gravity: each contact carries what stands on it.
module gravier_column_solution
  use gravier_kinds, only: dp
  use gravier_narrow, only: narrow
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  use gravier_solve_report, only: exact_solution_t
  implicit none
  private
  public :: column_solution_t

  type, extends(exact_solution_t) :: column_solution_t
    integer :: count = 0
    !> weight of one grain over a step, m g h [N s]
    real(dp) :: unit_impulse = 0.0_dp
  contains
    procedure :: error => column_error
  end type column_solution_t

contains

  !> |r - r_exact| / |r_exact| over all contacts, r_exact = N, N - 1, ..., 1 times m g h from the ground up. Collective.
  real(dp) function column_error(self, problem) result(error)
    class(column_solution_t), intent(in) :: self
    type(contact_problem_t), intent(in) :: problem
    real(dp), allocatable :: parts(:, :)
    real(dp) :: sums(2), exact, impulse(problem%nc)
    integer :: s, c, upper

    allocate (parts(2, size(problem%sub)), source=0.0_dp)
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do c = 1, sub%n_contacts
          ! the grain that stands on the contact: the higher of two, or the one on the ground
          upper = narrow(sub%id(sub%pair(1, c)))
          if (sub%pair(2, c) <= sub%n_bodies) upper = max(upper, narrow(sub%id(sub%pair(2, c))))
          impulse(:) = sub%impulse(lane_of(c), :, block_of(c))
          exact = (self%count - upper + 1)*self%unit_impulse
          parts(1, s) = parts(1, s) + (impulse(1) - exact)**2 + sum(impulse(2:)**2)
          parts(2, s) = parts(2, s) + exact**2
        end do
      end associate
    end do
    call problem%comm%sum_parts(parts, sums)
    error = sqrt(sums(1)/sums(2))
  end function column_error

end module gravier_column_solution
