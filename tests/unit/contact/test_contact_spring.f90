!> Springs of contacts against formulas: the law of a step, elongations after it, dashpots, energies, and the restitution of
!> impacts.
program test_contact_spring
  use gravier_kinds, only: dp
  use gravier_contact_spring, only: spring_t, spring_step_t, damping_ratio, rebound_of
  use gravier_check, only: check, check_close, finish_checks
  implicit none

  real(dp), parameter :: rounding = 1.0e-13_dp

  call test_law_of_a_step()
  call test_elongation()
  call test_dashpot()
  call test_stretches()
  call test_energy()
  call test_rebound()
  call finish_checks()

contains

  !> Springs with numbers of size 1.
  type(spring_step_t) function step_with(phi) result(step)
    real(dp), intent(in) :: phi

    step%spring = spring_t(stiffness=[3.0_dp, 2.0_dp], damping=0.3_dp, tangential_damping=0.5_dp, weight=phi)
    step%dashpot(:) = [0.7_dp, 0.4_dp]
    step%velocity(:) = [-0.6_dp, 0.9_dp, 0.2_dp]
  end function step_with

  !> With v = -s - a r the force of spring and dashpot at the weighted instant is r/h; phi = 1 without a dashpot is the rigid law
  !> v + g/h with the compliance 1/(h^2 k).
  subroutine test_law_of_a_step()
    type(spring_step_t) :: step
    real(dp), parameter :: h = 0.3_dp, x = -0.25_dp, r = 0.8_dp
    real(dp) :: law(2), v, x_f, v_f, phi
    integer :: k, d

    do k = 0, 4
      phi = 0.5_dp + 0.125_dp*k
      step = step_with(phi)
      do d = 1, 3
        law(:) = step%law(d, h, x)
        v = -law(2) - law(1)*r
        x_f = x - (1.0_dp - phi)**2*h*step%velocity(d) + phi**2*h*v
        v_f = (1.0_dp - phi)*step%velocity(d) + phi*v
        call check_close(-h*(step%spring%stiffness(min(d, 2))*x_f + step%dashpot(min(d, 2))*v_f), r, rounding, "force of a spring")
      end do
    end do
    step%dashpot(:) = 0.0_dp
    law(:) = step%law(1, h, x)
    call check_close(law(1), 1.0_dp/(h**2*3.0_dp), rounding, "compliance at phi = 1")
    call check_close(law(2), x/h, rounding, "shift at phi = 1")
  end subroutine test_law_of_a_step

  !> A spring that sticks has moved with the contact; one that slides carries the impulse that it is given.
  subroutine test_elongation()
    type(spring_step_t) :: step
    real(dp), parameter :: h = 0.3_dp, x = 0.15_dp, r = -0.4_dp
    real(dp) :: law(2), v, after, x_f, phi
    integer :: k

    do k = 0, 2
      phi = 0.5_dp + 0.25_dp*k
      step = step_with(phi)
      law(:) = step%law(2, h, x)
      v = -law(2) - law(1)*r
      call check_close(step%elongation(2, h, r, v, slides=.false.), x + h*v, rounding, "elongation of a spring that sticks")
      ! v and r need not go together where it slides: the elongation at the weighted instant gives the force
      v = 0.37_dp
      after = step%elongation(2, h, r, v, slides=.true.)
      x_f = after - h*v - (1.0_dp - phi)**2*h*step%velocity(2) + phi**2*h*v
      call check_close(-h*(2.0_dp*x_f + step%dashpot(2)*((1.0_dp - phi)*step%velocity(2) + phi*v)), r, rounding, &
        & "force of a spring that slides")
      ! one that grows with the compression carries all of it, without the dashpot, where it slides and there alone
      step%spring%hertz = 1.0_dp
      x_f = step%elongation(2, h, r, v, slides=.true.) - h*v - (1.0_dp - phi)**2*h*step%velocity(2) + phi**2*h*v
      call check_close(-h*2.0_dp*x_f, r, rounding, "force of a spring of Mindlin that slides")
      call check_close(step%elongation(2, h, r, v, slides=.false.), after, 0.0_dp, "of one that sticks")
    end do
  end subroutine test_elongation

  !> c = 2 zeta sqrt(k m), for the part of the step in which bodies touch.
  subroutine test_dashpot()
    type(spring_step_t) :: step
    real(dp), parameter :: full = 2.0_dp*0.3_dp*1.5_dp
    real(dp), parameter :: w = 3.0_dp/1.5_dp**2

    step = step_with(0.5_dp)
    call step%damp(w, 0.1_dp, -1.0_dp)
    call check_close(step%dashpot(1), full, rounding, "dashpot of bodies that touch")
    call check_close(step%dashpot(2), 0.5_dp*full, rounding, "tangential dashpot")
    call step%damp(w, 0.1_dp, 1.0_dp)
    call check_close(step%dashpot(1), 0.0_dp, 0.0_dp, "dashpot of bodies apart")
    ! they move by 0.06 in the step and meet after a quarter of it
    call step%damp(w, 0.1_dp, -0.015_dp)
    call check_close(step%dashpot(1), 0.75_dp*full, rounding, "dashpot of bodies that meet early")
    call step%damp(w, 0.1_dp, 0.015_dp)
    call check_close(step%dashpot(1), 0.25_dp*full, rounding, "dashpot of bodies that meet late")
    call check(step%spring%yields(), "a spring yields")
    step%spring%stiffness(:) = 0.0_dp
    call check(.not. step%spring%yields(), "without stiffness a contact is rigid")
  end subroutine test_dashpot

  !> Elongations at q_m of a contact that may have kept none; h = 0.2 s, theta = 0.75: q_m is 0.05 s after the start of the step.
  subroutine test_stretches()
    type(spring_step_t) :: step

    step%velocity(:) = [-2.0_dp, 3.0_dp, -1.0_dp]
    call stretch_is(step, [0.4_dp, 0.3_dp], -0.08_dp, [0.4_dp, 0.3_dp], "what was kept stays")
    call stretch_is(step, [0.0_dp, 0.0_dp], -0.08_dp, [0.12_dp, -0.04_dp], "bodies that met before q_m")
    call stretch_is(step, [0.0_dp, 0.0_dp], 0.2_dp, [-0.3_dp, 0.1_dp], "bodies that meet after q_m")
    call stretch_is(step, [0.0_dp, 0.0_dp], 0.32_dp, [0.0_dp, 0.0_dp], "bodies that do not meet in this step")
    call stretch_is(step, [0.0_dp, 0.0_dp], -0.38_dp, [0.57_dp, -0.19_dp], "bodies that met in the last step")
    call stretch_is(step, [0.0_dp, 0.0_dp], -0.42_dp, [0.15_dp, -0.05_dp], "bodies that met before")
    step%velocity(1) = 0.0_dp
    call stretch_is(step, [0.0_dp, 0.0_dp], -0.1_dp, [0.15_dp, -0.05_dp], "bodies that keep their distance")
    call stretch_is(step, [0.0_dp, 0.0_dp], 0.1_dp, [0.0_dp, 0.0_dp], "bodies that stay apart")
  end subroutine test_stretches

  subroutine stretch_is(step, kept, gap, stretch, what)
    type(spring_step_t), intent(inout) :: step
    real(dp), intent(in) :: kept(2), gap, stretch(2)
    character(len=*), intent(in) :: what

    call step%stretches(kept, 0.2_dp, 0.75_dp, gap)
    call check_close(maxval(abs(step%stretch - stretch)), 0.0_dp, rounding, what)
  end subroutine stretch_is

  subroutine test_energy()
    type(spring_t) :: spring

    spring = spring_t(stiffness=[3.0_dp, 2.0_dp])
    call check_close(spring%energy(0.2_dp, [0.3_dp, -0.4_dp]), 1.5_dp*0.04_dp + 0.25_dp, rounding, "energy of linear springs")
    call check_close(spring%energy(-0.2_dp, [0.0_dp, 0.0_dp]), 0.0_dp, 0.0_dp, "energy of an open contact")
    spring%hertz = 5.0_dp
    call check_close(spring%energy(0.25_dp, [0.0_dp, 0.0_dp]), 0.4_dp*5.0_dp*0.25_dp**2*0.5_dp, rounding, "energy of Hertz")
  end subroutine test_energy

  !> Schwager and Poeschel 2007: with Omega = sqrt(|1 - zeta^2|),
  !>   zeta < sqrt(1/2):     exp(-zeta/Omega (pi - atan(2 zeta Omega/(1 - 2 zeta^2)))),
  !>   zeta < 1:             exp(-zeta/Omega atan(2 zeta Omega/(2 zeta^2 - 1))),
  !>   above:                exp(-zeta/Omega log((zeta + Omega)/(zeta - Omega))).
  subroutine test_rebound()
    real(dp), parameter :: pi = acos(-1.0_dp), ratios(6) = [0.0_dp, 0.1_dp, 0.5_dp, 0.9_dp, 1.5_dp, 4.0_dp]
    real(dp) :: omega, formula
    integer :: k

    do k = 1, size(ratios)
      associate (zeta => ratios(k))
        omega = sqrt(abs(1.0_dp - zeta**2))
        if (zeta < sqrt(0.5_dp)) then
          formula = exp(-zeta/omega*(pi - atan(2.0_dp*zeta*omega/(1.0_dp - 2.0_dp*zeta**2))))
        else if (zeta < 1.0_dp) then
          formula = exp(-zeta/omega*atan(2.0_dp*zeta*omega/(2.0_dp*zeta**2 - 1.0_dp)))
        else
          formula = exp(-zeta/omega*log((zeta + omega)/(zeta - omega)))
        end if
        ! the step of the integration is 1/1000: what its last part misses is of the order of its square
        call check_close(rebound_of(zeta, 1.0_dp), formula, 1.0e-6_dp, "restitution of a spring and a dashpot")
        if (zeta > 0.0_dp) call check_close(damping_ratio(formula, 1.0_dp), zeta, 1.0e-4_dp*(1.0_dp + zeta), "ratio of damping")
      end associate
    end do
    call check_close(rebound_of(0.0_dp, 1.5_dp), 1.0_dp, 1.0e-6_dp, "restitution of Hertz without a dashpot")
    call check_close(rebound_of(damping_ratio(0.4_dp, 1.5_dp), 1.5_dp), 0.4_dp, 1.0e-6_dp, "restitution of Hertz")
    call check_close(damping_ratio(1.0_dp, 1.0_dp), 0.0_dp, 0.0_dp, "no damping")
  end subroutine test_rebound

end program test_contact_spring
