!> The weight of proximal points: it falls while points are found in few steps, and rises where they are not.
program test_proximal_weight
  use gravier_kinds, only: dp
  use gravier_proximal_weight, only: proximal_weight_t
  use gravier_check, only: check_close, finish_checks
  implicit none

  type(proximal_weight_t) :: weight
  integer :: k

  call check_close(weight%alpha, 1.0e-2_dp, 0.0_dp, "at the start")
  call weight%adapt(.true., 2)
  call check_close(weight%alpha, 1.0e-3_dp, 1.0e-17_dp, "very few steps")
  call weight%adapt(.true., 6)
  call check_close(weight%alpha, 5.0e-4_dp, 1.0e-17_dp, "few steps")
  call weight%adapt(.true., 12)
  call check_close(weight%alpha, 5.0e-4_dp, 1.0e-17_dp, "some steps leave it")
  call weight%adapt(.true., 13)
  call check_close(weight%alpha, 7.5e-4_dp, 1.0e-17_dp, "many steps")
  call weight%adapt(.false., 3)
  call check_close(weight%alpha, 3.75e-3_dp, 1.0e-17_dp, "a point that was not found")
  call weight%adapt(.true., 1)
  call check_close(weight%alpha, 1.875e-3_dp, 1.0e-17_dp, "it does not drop at once to where a point was not found")
  do k = 1, 12
    call weight%adapt(.false., 25)
  end do
  call check_close(weight%alpha, 10.0_dp, 0.0_dp, "its upper bound")
  do k = 1, 60
    call weight%adapt(.true., 3)
  end do
  call check_close(weight%alpha, 1.0e-10_dp, 0.0_dp, "its lower bound")
  call finish_checks()

end program test_proximal_weight
