!> When the contacts that sleep wake in the course of a solve.
program test_waking
  use gravier_kinds, only: dp
  use gravier_waking, only: waking_t
  use gravier_check, only: check, finish_checks
  implicit none
  type(waking_t) :: waking

  ! the residual is above its tolerance: where the defect lies decides, trusted or not
  call check(.not. waking%is_due(0.49_dp, .false., .false., 8.0_dp), "the others have most of the defect")
  call check(.not. waking%is_due(0.49_dp, .false., .true., 8.0_dp), "the others have most of the defect, later")
  call check(waking%is_due(0.51_dp, .false., .false., 8.0_dp), "those that sleep have most of it")
  ! the residual is within its tolerance
  call check(.not. waking%is_due(0.9_dp, .true., .false., 8.0_dp), "the velocity error is not known yet")
  call check(.not. waking%is_due(0.1_dp, .true., .true., 8.0_dp), "the first error that is known")
  call check(.not. waking%is_due(0.1_dp, .true., .true., 6.7_dp), "the error falls")
  call check(waking%is_due(0.1_dp, .true., .true., 5.8_dp), "the error has hardly fallen")
  waking = waking_t()
  call check(waking%is_due(0.9_dp, .true., .true., 8.0_dp), "those that sleep have most of the defect")
  call finish_checks()
end program test_waking
