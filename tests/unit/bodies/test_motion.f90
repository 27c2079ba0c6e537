!> Motion of bodies: masses, inertias, the steps of the Moreau-Jean method.
program test_motion
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp
  use gravier_motion, only: predict_position, advance_position, grain_volume, grain_mass, grain_inertia
  use gravier_check, only: check_close, finish_checks
  implicit none
  real(dp), parameter :: pi = 3.14159265358979323846_dp
  !> a few roundings of numbers of size 1
  real(dp), parameter :: rounding = 8*epsilon(1.0_dp)

  call MPI_Init()
  call test_masses()
  call test_inertia_by_integration()
  call test_positions()
  call test_free_flight()
  call test_spring()
  call finish_checks()
  call MPI_Finalize()

contains

  subroutine test_masses()
    call check_close(grain_volume(2, 2.0_dp), 4*pi, 12*rounding, "area of a disk")
    call check_close(grain_volume(3, 2.0_dp), 32*pi/3, 32*rounding, "volume of a sphere")
    call check_close(grain_mass(2, 2.0_dp, 3.0_dp), 12*pi, 40*rounding, "mass of a disk")
    call check_close(grain_mass(3, 2.0_dp, 3.0_dp), 32*pi, 100*rounding, "mass of a sphere")
    call check_close(grain_inertia(2, 2.0_dp, 3.0_dp), 6.0_dp, 6*rounding, "inertia of a disk")
    call check_close(grain_inertia(3, 2.0_dp, 3.0_dp), 4.8_dp, 5*rounding, "inertia of a sphere")
  end subroutine test_masses

  !> Mass and inertia as sums over thin rings (disk) and thin tubes (sphere) about the axis. The midpoint rule with n
  !> tubes errs by less than 1/n relative, the integrands being smooth but at the rim.
  subroutine test_inertia_by_integration()
    integer, parameter :: n = 20000
    real(dp) :: mass(2:3), inertia(2:3), r, slice
    integer :: k, d

    mass(:) = 0.0_dp
    inertia(:) = 0.0_dp
    do k = 1, n
      r = (k - 0.5_dp)/n
      do d = 2, 3
        slice = 2*pi*r/n
        if (d == 3) slice = slice*2*sqrt(1.0_dp - r**2)
        mass(d) = mass(d) + slice
        inertia(d) = inertia(d) + slice*r**2
      end do
    end do
    do d = 2, 3
      call check_close(grain_mass(d, 1.0_dp, 1.0_dp), mass(d), mass(d)/n, "mass of a unit grain")
      call check_close(grain_inertia(d, 1.0_dp, 1.0_dp), inertia(d)/mass(d), 1.0_dp/n, "inertia of a unit grain")
    end do
  end subroutine test_inertia_by_integration

  subroutine test_positions()
    call check_close(predict_position(1.0_dp, 2.0_dp, 0.25_dp, 0.5_dp), 1.25_dp, rounding, "half a step")
    call check_close(predict_position(1.0_dp, 2.0_dp, 0.25_dp, 1.0_dp), 1.0_dp, 0.0_dp, "implicit Euler detects where it starts")
    call check_close(predict_position(1.0_dp, 2.0_dp, 0.25_dp, 0.75_dp), 1.125_dp, rounding, "a quarter of a step")
    call check_close(advance_position(1.0_dp, 2.0_dp, 0.25_dp, 0.75_dp), 1.375_dp, rounding, "three quarters of a step")
    call check_close(advance_position(1.0_dp, 2.0_dp, 0.25_dp, 1.0_dp), 1.5_dp, rounding, "a whole step")
  end subroutine test_positions

  !> A flight under constant gravity: with theta = 1/2 the method is exact, x = x0 + v0 t + g t^2/2; in general it is off
  !> by (theta - 1/2) g h t. 1000 steps of roundings of numbers below 100.
  subroutine test_free_flight()
    real(dp), parameter :: h = 0.01_dp, g = -9.81_dp, thetas(3) = [0.5_dp, 0.7_dp, 1.0_dp]
    real(dp) :: x, v, t
    integer :: k, i

    do i = 1, 3
      x = 2.0_dp
      v = 30.0_dp
      do k = 1, 1000
        x = predict_position(x, v, h, thetas(i))
        v = v + h*g
        x = advance_position(x, v, h, thetas(i))
      end do
      t = 1000*h
      call check_close(x, 2.0_dp + 30.0_dp*t + 0.5_dp*g*t**2 + (thetas(i) - 0.5_dp)*g*h*t, 1.0e5_dp*epsilon(1.0_dp), &
        & "free flight")
    end do
  end subroutine test_free_flight

  !> A unit mass on a unit spring whose force is taken at q_m: with theta = 1/2 this is a symplectic method, and the
  !> error over one period falls as h^2.
  subroutine test_spring()
    real(dp) :: error(2), x, v, h
    integer :: i, k, n

    do i = 1, 2
      n = 100*i
      h = 2*pi/n
      x = 1.0_dp
      v = 0.0_dp
      do k = 1, n
        x = predict_position(x, v, h, 0.5_dp)
        v = v - h*x
        x = advance_position(x, v, h, 0.5_dp)
      end do
      error(i) = hypot(x - 1.0_dp, v)
    end do
    ! the next term of the expansion is h^2 relative, 0.004
    call check_close(error(1)/error(2), 4.0_dp, 0.02_dp, "second order")
  end subroutine test_spring

end program test_motion
