!> What is said of a solve that failed: the contacts in which it did.
module gravier_failed_contact
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_unconverged
  use gravier_text, only: to_text
  use gravier_finite, only: has_finite_square
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  use gravier_solve_report, only: solve_diverged, solve_unbounded
  implicit none
  private
  public :: find_cause, find_divergence, find_largest_impulse

contains

  !> Where a solve has failed that ended so; not allocated after other ends. Collective.
  subroutine find_cause(problem, status, cause)
    type(contact_problem_t), intent(in) :: problem
    !> of the report of the solve
    integer, intent(in) :: status
    character(len=:), allocatable, intent(inout) :: cause

    if (status == solve_diverged) call find_divergence(problem, cause)
    if (status == solve_unbounded) call find_largest_impulse(problem, cause)
  end subroutine find_cause

  !> After a solve that diverged: the first contact, in the order of the subdomains, whose impulse or velocities are not finite or
  !> have squares that are not. Collective.
  subroutine find_divergence(problem, cause)
    type(contact_problem_t), intent(in) :: problem
    !> not allocated where there is none
    character(len=:), allocatable, intent(inout) :: cause
    type(error_t), allocatable :: found
    integer :: s, c

    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do c = 1, sub%n_contacts
          associate (pair => sub%pair(:, c), impulse => sub%impulse(lane_of(c), :, block_of(c)))
            if (all(has_finite_square(impulse)) .and. all(has_finite_square(sub%velocity(:, pair)))) cycle
            call raise(found, status_unconverged, "contact of bodies "//to_text(sub%id(pair(1)))//" and "// &
              & to_text(sub%id(pair(2)))//": an impulse or a velocity whose square is not a finite number")
          end associate
        end do
      end associate
    end do
    call problem%comm%agree(found)
    if (allocated(found)) cause = found%message
  end subroutine find_divergence

  !> After a solve whose impulses grow without bound: the contact with the largest one. Collective.
  subroutine find_largest_impulse(problem, cause)
    type(contact_problem_t), intent(in) :: problem
    !> not allocated where there is none
    character(len=:), allocatable, intent(inout) :: cause
    type(error_t), allocatable :: found
    real(dp) :: largest, size_of
    integer :: s, c, k

    largest = -1.0_dp
    do k = 1, 2
      do s = 1, size(problem%sub)
        associate (sub => problem%sub(s))
          do c = 1, sub%n_contacts
            size_of = norm2(sub%impulse(lane_of(c), :, block_of(c)))
            if (k == 1) then
              largest = max(largest, size_of)
            else if (size_of >= largest .and. .not. allocated(found)) then
              call raise(found, status_unconverged, "largest impulse: contact of bodies "//to_text(sub%id(sub%pair(1, c)))// &
                & " and "//to_text(sub%id(sub%pair(2, c))))
            end if
          end do
        end associate
      end do
      if (k == 1) largest = problem%comm%highest(largest)
    end do
    call problem%comm%agree(found)
    if (allocated(found)) cause = found%message
  end subroutine find_largest_impulse

end module gravier_failed_contact
