!> Springs with dashpots that make a contact compliant, and what a step makes of them.
!>
!> A spring of stiffness k and a dashpot c act on an elongation x, which along the normal is the gap, with the force -(k x + c x')
!> of a weighted instant of the step. With the elongation x_m at q_m and the velocities v_i and v at the start and at the end,
!>   x_f = x_m - (1 - phi)^2 h v_i + phi^2 h v,   v_f = (1 - phi) v_i + phi v,   r = -h (k x_f + c v_f),   1/2 <= phi <= 1.
!> phi = 1/2 takes the mean of the elongations at both ends of the step: second order, and the energy of a linear spring is kept.
!> phi = 1 damps what the step does not resolve, and tends to the rigid law v + g/h >= 0 as k grows. Solved for v this is
!>   v + s + a r = 0,   a = 1/(h A),   s = (k x_m + (c (1 - phi) - k (1 - phi)^2 h) v_i)/A,   A = k phi^2 h + c phi,
!> the law of a contact with the compliance a [1/kg] and the shift s [m/s].
!>
!> Bodies that meet during a step do so where their gap closes. Along the normal the gap at q_m says where this is. The tangential
!> springs begin there, too: their x_m is the way of the contact from there to the middle of the step.
module gravier_contact_spring
  use gravier_kinds, only: dp
  implicit none
  private
  public :: spring_t, spring_step_t, damping_ratio, rebound_of

  !> The springs of a contact; without stiffness the contact is rigid.
  type :: spring_t
    !> along the normal and the tangents [N/m]
    real(dp) :: stiffness(2) = 0.0_dp
    !> of a spring whose force is K x^(3/2) where it is compressed by x: K, and 0 of a linear one [N/m^(3/2)]
    real(dp) :: hertz = 0.0_dp
    !> of the normal dashpot over that of critical damping; of the tangential dashpot over the normal one
    real(dp) :: damping = 0.0_dp, tangential_damping = 0.0_dp
    !> phi
    real(dp) :: weight = 1.0_dp
  contains
    procedure :: yields => spring_yields
    procedure :: energy => spring_energy
  end type spring_t

  !> The springs of a contact in one step, with what their state after it is made of.
  type :: spring_step_t
    type(spring_t) :: spring
    !> along the normal and the tangents [kg/s]
    real(dp) :: dashpot(2) = 0.0_dp
    !> of the contact at the start of the step: along the normal, then along the tangents [m/s]
    real(dp) :: velocity(3) = 0.0_dp
    !> x_m along the tangents [m]
    real(dp) :: stretch(2) = 0.0_dp
  contains
    procedure :: stretches => spring_step_stretches
    procedure :: damp => spring_step_damp
    procedure :: law => spring_step_law
    procedure :: carried => spring_step_carried
    procedure :: elongation => spring_step_elongation
  end type spring_step_t

  !> step of the integration of an impact over the time sqrt(m/k), and most steps of it
  real(dp), parameter :: fine = 1.0e-3_dp
  integer, parameter :: most_steps = 100000
  !> largest ratio of damping; halvings of the interval in which one is sought
  real(dp), parameter :: most_damping = 50.0_dp
  integer, parameter :: halvings = 45

contains

  pure logical function spring_yields(self) result(yields)
    class(spring_t), intent(in) :: self
    yields = self%stiffness(1) > 0.0_dp
  end function spring_yields

  !> Energy of both springs [J].
  pure real(dp) function spring_energy(self, compression, elongation) result(energy)
    class(spring_t), intent(in) :: self
    !> along the normal, > 0 where the bodies press [m]
    real(dp), intent(in) :: compression
    !> along the tangents [m]
    real(dp), intent(in) :: elongation(:)
    real(dp) :: depth

    depth = max(compression, 0.0_dp)
    if (self%hertz > 0.0_dp) then
      energy = 0.4_dp*self%hertz*depth**2*sqrt(depth)
    else
      energy = 0.5_dp*self%stiffness(1)*depth**2
    end if
    energy = energy + 0.5_dp*self%stiffness(2)*sum(elongation**2)
  end function spring_energy

  !> Set the elongations at q_m of a contact that has kept `kept` of them. A contact that has kept none has none where its bodies
  !> touch, if its velocities bring them together in this step or did so after the q_m of the last one, in which they pressed
  !> nothing then. Otherwise it has none at the start of the step.
  pure subroutine spring_step_stretches(self, kept, h, theta, gap)
    class(spring_step_t), intent(inout) :: self
    !> along the tangents [m]
    real(dp), intent(in) :: kept(2)
    !> [s]; q_m is (1 - theta) h from the start of the step; at q_m [m]
    real(dp), intent(in) :: h, theta, gap
    real(dp) :: since

    self%stretch(:) = kept
    if (maxval(abs(kept)) > 0.0_dp) return
    associate (v => self%velocity)
      since = merge(0.0_dp, (1.0_dp - theta)*h, gap > 0.0_dp)
      ! times are compared as ways, so that nothing is divided by a small velocity
      if (v(1) < 0.0_dp .and. gap > h*v(1) .and. gap < -theta*h*v(1)) since = gap/v(1)
      self%stretch(:) = since*v(2:3)
    end associate
  end subroutine spring_step_stretches

  !> Set the dashpots of a contact whose normal local operator W_nn stands for a mass 1/W_nn. They act while the bodies touch: in a
  !> step in which these meet or part, for the part of it in which the velocity of its start has them overlap.
  pure subroutine spring_step_damp(self, w_nn, h, gap)
    class(spring_step_t), intent(inout) :: self
    !> [1/kg]; [s]; at the middle of the step [m]
    real(dp), intent(in) :: w_nn, h, gap
    real(dp) :: way, part

    way = abs(h*self%velocity(1))
    part = merge(1.0_dp, 0.0_dp, gap <= 0.0_dp)
    if (2.0_dp*abs(gap) < way) part = 0.5_dp - gap/way
    self%dashpot(1) = part*2.0_dp*self%spring%damping*sqrt(self%spring%stiffness(1)/w_nn)
    self%dashpot(2) = self%spring%tangential_damping*self%dashpot(1)
  end subroutine spring_step_damp

  !> The compliance a [1/kg] and the shift s [m/s] of the law along one direction.
  pure function spring_step_law(self, d, h, elongation) result(law)
    class(spring_step_t), intent(in) :: self
    !> direction: 1 along the normal, 2 and 3 along the tangents
    integer, intent(in) :: d
    !> [s]; x_m [m]
    real(dp), intent(in) :: h, elongation
    real(dp) :: law(2)
    real(dp) :: slope, rest

    associate (k => self%spring%stiffness(min(d, 2)), c => self%dashpot(min(d, 2)), phi => self%spring%weight)
      slope = k*phi**2*h + c*phi
      rest = 1.0_dp - phi
      law(1) = 1.0_dp/(h*slope)
      law(2) = (k*elongation + (c*rest - k*rest**2*h)*self%velocity(d))/slope
    end associate
  end function spring_step_law

  !> Elongation x_f of a tangential spring that carries the impulse r, at the weighted instant of the step [m]. While a contact
  !> slides, a linear spring carries r less the force of the dashpot, as in codes of smooth DEM. A spring whose stiffness grows with
  !> the compression carries all of r. Its elongation would otherwise hold the force of the dashpot over the stiffness of this step;
  !> with a larger stiffness in the next steps the spring would push along the sliding.
  pure real(dp) function spring_step_carried(self, d, h, impulse, velocity, slides) result(elongation)
    class(spring_step_t), intent(in) :: self
    !> direction: 2 or 3
    integer, intent(in) :: d
    !> [s], r [N s], v at the end of the step [m/s]
    real(dp), intent(in) :: h, impulse, velocity
    logical, intent(in) :: slides
    real(dp) :: damped

    damped = self%dashpot(2)*((1.0_dp - self%spring%weight)*self%velocity(d) + self%spring%weight*velocity)
    if (slides .and. self%spring%hertz > 0.0_dp) damped = 0.0_dp
    elongation = -(impulse/h + damped)/self%spring%stiffness(2)
  end function spring_step_carried

  !> The same elongation at the q_m of the next step, if the bodies stuck together and their velocity stayed what it is at the end
  !> of this one [m]. A contact that slides on is brought back to its bound by the law of that step.
  pure real(dp) function spring_step_elongation(self, d, h, impulse, velocity, slides) result(elongation)
    class(spring_step_t), intent(in) :: self
    integer, intent(in) :: d
    real(dp), intent(in) :: h, impulse, velocity
    logical, intent(in) :: slides

    associate (phi => self%spring%weight)
      elongation = self%carried(d, h, impulse, velocity, slides) &
        & + h*((1.0_dp - phi**2)*velocity + (1.0_dp - phi)**2*self%velocity(d))
    end associate
  end function spring_step_elongation

  !> The ratio of damping with which an impact returns the part `restitution` of its velocity: the inverse of rebound_of, at most
  !> most_damping.
  pure real(dp) function damping_ratio(restitution, exponent) result(ratio)
    !> above 0, at most 1
    real(dp), intent(in) :: restitution
    !> of the force of the spring as a power of its compression: 1 or 3/2
    real(dp), intent(in) :: exponent
    real(dp) :: low, high
    integer :: k

    ratio = 0.0_dp
    if (restitution >= 1.0_dp) return
    low = 0.0_dp
    high = most_damping
    do k = 1, halvings
      ratio = 0.5_dp*(low + high)
      if (rebound_of(ratio, exponent) > restitution) then
        low = ratio
      else
        high = ratio
      end if
    end do
  end function damping_ratio

  !> The restitution of an impact on a spring of force x^p with a dashpot 2 zeta x^((p-1)/2), which lets go where its force vanishes
  !> (Schwager and Poeschel 2007, Granular Matter 9, 465): x'' = -(x^p + 2 zeta x^((p-1)/2) x') from x = 0, x' = 1, by the
  !> fourth-order method of Runge and Kutta. It does not depend on the velocity of the impact.
  pure real(dp) function rebound_of(ratio, exponent) result(rebound)
    !> zeta, p
    real(dp), intent(in) :: ratio, exponent
    real(dp) :: x, v, h, u(4), a(4), before
    integer :: n

    x = 0.0_dp
    v = 1.0_dp
    h = fine/(1.0_dp + ratio)
    before = v
    do n = 1, most_steps
      u(1) = v
      a(1) = force(x, u(1))
      u(2) = v + 0.5_dp*h*a(1)
      a(2) = force(x + 0.5_dp*h*u(1), u(2))
      u(3) = v + 0.5_dp*h*a(2)
      a(3) = force(x + 0.5_dp*h*u(2), u(3))
      u(4) = v + h*a(3)
      a(4) = force(x + h*u(3), u(4))
      before = v
      x = x + h*(u(1) + 2.0_dp*(u(2) + u(3)) + u(4))/6.0_dp
      v = v + h*(a(1) + 2.0_dp*(a(2) + a(3)) + a(4))/6.0_dp
      if (v < 0.0_dp .and. force(x, v) >= 0.0_dp) exit
    end do
    ! the velocity has its minimum where the force vanishes: an error of a step in time is one of the second order in it
    rebound = -min(v, before)

  contains

    pure real(dp) function force(x, v)
      real(dp), intent(in) :: x, v
      real(dp) :: depth

      depth = max(x, 0.0_dp)
      force = -(depth**exponent + 2.0_dp*ratio*depth**(0.5_dp*(exponent - 1.0_dp))*v)
    end function force

  end function rebound_of

end module gravier_contact_spring
