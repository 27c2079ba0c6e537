!> The projections on Coulomb's cone: cuts, the projection by parts with its derivative, the Euclidean one.
program test_friction_cone
  use gravier_kinds, only: dp
  use gravier_friction_cone, only: cut_to_disc, cut_to_interval, cut_to_ball, project_by_parts, project_on_cone, is_open, &
    & sticks, slides
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  real(dp), parameter :: rounding = 1.0e-14_dp

  call test_cuts()
  call test_states()
  call test_derivative()
  call test_euclidean()
  call finish_checks()

contains

  subroutine test_cuts()
    real(dp) :: t, s, part(2)

    call check_close(cut_to_interval(2.0_dp, 3.0_dp), 2.0_dp, rounding, "cut from above")
    call check_close(cut_to_interval(2.0_dp, -3.0_dp), -2.0_dp, rounding, "cut from below")
    call check_close(cut_to_interval(2.0_dp, -1.5_dp), -1.5_dp, rounding, "within the interval")
    t = 3.0_dp
    s = -4.0_dp
    part(1) = t
    part(2) = s
    call cut_to_disc(10.0_dp, t, s)
    call check_close(t, 3.0_dp, rounding, "within the disc")
    call cut_to_disc(2.0_dp, t, s)
    call check_close(t, 1.2_dp, rounding, "cut to the disc, t")
    call check_close(s, -1.6_dp, rounding, "cut to the disc, s")
    call cut_to_ball(10.0_dp, part)
    call check_close(part(2), -4.0_dp, rounding, "within the ball")
    call cut_to_ball(2.0_dp, part)
    call check_close(hypot(part(1) - t, part(2) - s), 0.0_dp, rounding, "the ball of two dimensions is the disc")
    call cut_to_disc(0.0_dp, t, s)
    call check_close(abs(t) + abs(s), 0.0_dp, rounding, "nothing is left without friction")
    call cut_to_disc(0.0_dp, t, s)
    call check_close(abs(t) + abs(s), 0.0_dp, rounding, "nothing divides by zero")
  end subroutine test_cuts

  subroutine test_states()
    real(dp) :: x(3), along(2), kept, alone(1)
    integer :: state

    along(:) = 0.0_dp
    kept = 0.0_dp
    x(:) = [-1.0_dp, 2.0_dp, 3.0_dp]
    call project_by_parts(0.5_dp, x, state, along, kept)
    call check_equal(state, is_open, "a contact that parts is open")
    call check_close(norm2(x), 0.0_dp, rounding, "an open contact carries nothing")
    x(:) = [4.0_dp, 1.0_dp, -1.0_dp]
    call project_by_parts(0.5_dp, x, state, along, kept)
    call check_equal(state, sticks, "a contact within its cone sticks")
    call check_close(norm2(x - [4.0_dp, 1.0_dp, -1.0_dp]), 0.0_dp, rounding, "what sticks is left")
    x(:) = [4.0_dp, 3.0_dp, -4.0_dp]
    call project_by_parts(0.5_dp, x, state, along, kept)
    call check_equal(state, slides, "a contact beyond its cone slides")
    call check_close(norm2(x - [4.0_dp, 1.2_dp, -1.6_dp]), 0.0_dp, rounding, "what slides is cut to the disc")
    call check_close(norm2(along - [0.6_dp, -0.8_dp]), 0.0_dp, rounding, "direction of sliding")
    call check_close(kept, 0.4_dp, rounding, "part that is kept")
    x(:) = [4.0_dp, 0.0_dp, 0.0_dp]
    call project_by_parts(0.0_dp, x, state, along, kept)
    call check_close(norm2(along) + kept, 0.0_dp, rounding, "no direction without friction and slip")
    alone(1) = 4.0_dp
    call project_by_parts(0.0_dp, alone, state, along(1:0), kept)
    call check_equal(state, sticks, "a contact without tangential part holds")
  end subroutine test_states

  !> dP against differences where the contact slides.
  subroutine test_derivative()
    real(dp), parameter :: mu = 0.3_dp, step = 1.0e-6_dp
    real(dp) :: x(3), up(3), down(3), along(2), kept, spare(2), ignored, expected(2), across(3)
    integer :: state, k

    x(:) = [2.0_dp, 1.5_dp, -0.7_dp]
    along(:) = 0.0_dp
    kept = 0.0_dp
    up(:) = x
    call project_by_parts(mu, up, state, along, kept)
    do k = 1, 3
      up(:) = x
      down(:) = x
      up(k) = x(k) + step
      down(k) = x(k) - step
      call project_by_parts(mu, up, state, spare, ignored)
      call project_by_parts(mu, down, state, spare, ignored)
      across(:) = 0.0_dp
      if (k > 1) across(k) = 1.0_dp
      expected(:) = mu*along
      if (k > 1) expected(:) = kept*(across(2:3) - along*dot_product(along, across(2:3)))
      call check_close(norm2((up(2:3) - down(2:3))/(2.0_dp*step) - expected), 0.0_dp, 1.0e-8_dp, "derivative of the projection")
    end do
  end subroutine test_derivative

  !> The projection is the nearest point: what it takes away is at a right angle to it, in the polar cone.
  subroutine test_euclidean()
    real(dp), parameter :: mu = 0.5_dp
    real(dp) :: x(3), p(3)

    x(:) = [1.0_dp, 2.0_dp, -1.0_dp]
    p(:) = x
    call project_on_cone(p, mu)
    call check_close(dot_product(x - p, p), 0.0_dp, rounding, "what is taken away is at a right angle")
    call check_close(norm2(p(2:3)), mu*p(1), rounding, "the projection is on the cone")
    p(:) = [-3.0_dp, 1.0_dp, 0.0_dp]
    call project_on_cone(p, mu)
    call check(all(abs(p) <= 0.0_dp), "the polar cone goes to the tip")
    p(:) = [3.0_dp, 1.0_dp, 0.5_dp]
    call project_on_cone(p, mu)
    call check_close(norm2(p - [3.0_dp, 1.0_dp, 0.5_dp]), 0.0_dp, rounding, "points of the cone stay")
  end subroutine test_euclidean

end program test_friction_cone
