!> When a solve counts as one that gains nothing, and as one whose defect grows.
program test_stagnation
  use gravier_kinds, only: dp
  use gravier_contact_problem, only: contact_problem_t
  use gravier_stagnation, only: stagnation_t
  use gravier_defect_growth, only: defect_growth_t
  use gravier_check, only: check, check_equal, finish_checks
  implicit none
  type(contact_problem_t) :: problem

  allocate (problem%sub(0))
  call check_equal(first_due(.true., 0.0_dp, 1.0_dp), 1020, "with momentum: 1000 after the gain, and as many as before")
  call check_equal(first_due(.false., 0.0_dp, 1.0_dp), 2020, "without, after 2000")
  call check_equal(first_due(.true., 5.0e-4_dp, 1.0_dp), 8050, "four times the longer patience where a small residual is missing")
  call check_equal(first_due(.true., 0.5_dp, 1.0_dp), 1020, "but not where a large one is")
  call check_equal(first_due(.true., 0.0_dp, 0.9995_dp), 0, "a figure that goes on falling is none")
  call check_equal(first_due(.true., 0.0_dp, 0.99999_dp), 1020, "one that falls by less than a tenth is")
  call check_equal(first_due(.true., 0.0_dp, 1.0001_dp, 0.9995_dp), 0, "no stagnation: the figure rises, the error falls")
  call check_equal(first_due(.true., 0.0_dp, 0.9995_dp, 1.0001_dp), 0, "no stagnation: the error rises, the figure falls")
  call check_equal(first_due(.true., 0.0_dp, 1.0_dp, patience=40), 60, "a method of direct solves: 40, and as many as before")
  call check_equal(first_due(.true., 5.0e-4_dp, 1.0_dp, patience=40), 60, "whatever the residual")
  call check_direct()
  call check_last()
  call check_growth()
  call finish_checks()

contains

  !> The first iteration of 20 000, looked at each tenth, at which a figure that falls by a factor an iteration is due; 0 if none
  !> is. The velocity error falls by the same factor, or by its own.
  integer function first_due(accelerated, missing_residual, factor, factor_of_error, patience)
    logical, intent(in) :: accelerated
    real(dp), intent(in) :: missing_residual, factor
    real(dp), intent(in), optional :: factor_of_error
    !> of a method of direct solves
    integer, intent(in), optional :: patience
    real(dp) :: factors(2), figures(2)
    type(stagnation_t) :: stagnation
    integer :: iteration
    logical :: due

    factors(:) = factor
    if (present(factor_of_error)) factors(2) = factor_of_error
    if (present(patience)) stagnation%patience = patience
    first_due = 0
    do iteration = 10, 20000, 10
      figures(:) = factors**iteration
      call stagnation%note(problem, iteration, figures, accelerated, missing_residual, due)
      if (.not. due) cycle
      first_due = iteration
      return
    end do
  end function first_due

  !> Nothing follows a method of direct solves.
  subroutine check_direct()
    type(stagnation_t) :: stagnation

    stagnation%patience = 40
    call check(.not. stagnation%may_begin_last(60, 1), "no plain iterations follow direct solves")
  end subroutine check_direct

  !> Plain iterations that come last, after 1500 others, are as many and 2000 more, whatever they gain. They are tried where a load
  !> can spread so far in them.
  subroutine check_last()
    type(stagnation_t) :: stagnation
    real(dp) :: figures(2)
    integer :: iteration, first
    logical :: due

    call check(stagnation%may_begin_last(1500, 144), "a load spreads over 144 contacts")
    call check(.not. stagnation%may_begin_last(1500, 145), "and over 145 it does not")
    call stagnation%begin_last(1500)
    call check(.not. stagnation%may_begin_last(1500, 1), "the last iterations come once")
    first = 0
    do iteration = 1510, 9000, 10
      figures(:) = 0.9995_dp**iteration
      call stagnation%note(problem, iteration, figures, .false., 0.0_dp, due)
      if (due .and. first == 0) first = iteration
    end do
    call check_equal(first, 5000, "plain iterations that come last end, though they go on gaining")
  end subroutine check_last

  !> A defect that is five times its reference counts as growth after nine iterations above it, and never where it is mended.
  subroutine check_growth()
    type(defect_growth_t) :: growth
    integer :: k

    do k = 1, 12
      call growth%note(.false., k, merge(0.5_dp, 5.0_dp, k == 2), 1.0_dp)
      call check(growth%unmended .eqv. k == 12, "above the reference from the third iteration on")
    end do
    call growth%note(.false., 13, 3.0_dp, 1.0_dp)
    call check(.not. growth%unmended, "above it, but less than four times")
    call growth%note(.true., 14, 5.0_dp, 1.0_dp)
    call check(.not. growth%unmended, "mended by the method")
    call growth%note(.false., 15, 5.0_dp, 1.0_dp)
    call check(.not. growth%unmended, "which begins anew")
  end subroutine check_growth

end program test_stagnation
