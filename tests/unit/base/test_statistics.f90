!> Medians and slopes against values by hand.
program test_statistics
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp
  use gravier_statistics, only: median, slope
  use gravier_check, only: check_close, finish_checks
  implicit none

  real(dp), parameter :: rounding = 1.0e-15_dp

  call MPI_Init()
  call check_close(median([3.0_dp]), 3.0_dp, 0.0_dp, "median of one")
  call check_close(median([3.0_dp, 1.0_dp]), 2.0_dp, 0.0_dp, "median of two")
  call check_close(median([5.0_dp, 1.0_dp, 4.0_dp]), 4.0_dp, 0.0_dp, "median of three")
  call check_close(median([9.0_dp, 1.0_dp, 4.0_dp, 2.0_dp]), 3.0_dp, 0.0_dp, "median of four")
  call check_close(slope([0.0_dp, 1.0_dp, 2.0_dp], [1.0_dp, 3.0_dp, 5.0_dp]), 2.0_dp, rounding, "slope of a line")
  ! means 1 and 4/3: ((-1)(-4/3) + (1)(5/3))/2
  call check_close(slope([0.0_dp, 1.0_dp, 2.0_dp], [0.0_dp, 1.0_dp, 3.0_dp]), 1.5_dp, rounding, "slope by least squares")
  call check_close(slope([1.0_dp, 1.0_dp], [0.0_dp, 1.0_dp]), 0.0_dp, 0.0_dp, "one abscissa")
  call finish_checks()
  call MPI_Finalize()
end program test_statistics
