!> When the contacts that sleep wake in the course of a solve.
program test_waking
  use gravier_kinds, only: dp
  use gravier_waking, only: wake_is_due
  use gravier_check, only: check, finish_checks
  implicit none
  logical :: many
  integer :: k

  do k = 1, 2
    many = k == 1
    ! the residual is above its tolerance: where the defect lies decides
    call check(.not. wake_is_due(0.49_dp, .false., .false., many), "the others have most of the defect")
    call check(.not. wake_is_due(0.49_dp, .false., .true., many), "the others have most of the defect, later")
    call check(wake_is_due(0.51_dp, .false., .false., many), "those that sleep have most of the defect")
    call check(wake_is_due(0.1_dp, .true., .true., many), "the velocity error is known to be too large")
  end do
  call check(.not. wake_is_due(0.9_dp, .true., .false., .true.), "the velocity error is not known yet")
  call check(wake_is_due(0.1_dp, .true., .false., .false.), "the velocity error is not known yet, but few sleep")
  call finish_checks()
end program test_waking
