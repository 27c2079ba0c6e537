!> The situations in which solves start: impulses and free velocities that one of them begins with, and its name.
module gravier_error_situations
  use gravier_kinds, only: dp, i8
  use gravier_text, only: to_text
  use gravier_random_hash, only: hash_uniform, hash_words
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  use gravier_simulation, only: simulation_t
  use gravier_error_plan, only: situation_t, start_cold, start_lost, start_turned, start_loose
  use gravier_error_fields, only: field_t, set_impulses, scale_of
  implicit none
  private
  public :: cold_text, name_of, prepare

  !> A solve from zero impulses, by name.
  character(len=*), parameter :: cold_text = "zero impulses"
  !> seed of what is random
  integer, parameter :: seed = 20

contains

  !> As the tables have it.
  function name_of(situation) result(name)
    type(situation_t), intent(in) :: situation
    character(len=:), allocatable :: name

    select case (situation%start)
    case (start_lost)
      name = number_text(100.0_dp*situation%amount)//" % of the impulses lost"
    case (start_turned)
      name = "gravity turned by "//number_text(situation%amount)//" degrees"
    case (start_loose)
      name = "velocities of "//number_text(situation%amount)//" g h at random"
    case default
      name = cold_text
    end select
  end function name_of

  !> A whole number without decimals.
  function number_text(value) result(text)
    real(dp), intent(in) :: value
    character(len=:), allocatable :: text

    if (abs(value - nint(value)) <= 1.0e-9_dp*abs(value)) then
      text = to_text(nint(value))
    else
      text = to_text(value, 3)
    end if
  end function number_text

  !> Impulses and free velocities at the start of a situation.
  subroutine prepare(situation, simulation, solved)
    type(situation_t), intent(in) :: situation
    type(simulation_t), intent(inout) :: simulation
    !> not used from zero impulses
    type(field_t), allocatable, intent(in) :: solved(:)

    if (situation%start == start_cold) then
      call set_impulses(simulation%problem)
      return
    end if
    call set_impulses(simulation%problem, solved)
    select case (situation%start)
    case (start_lost)
      call lose_impulses(simulation%problem, situation%amount)
    case (start_turned)
      call turn_gravity(simulation, situation%amount)
    case default
      call stir(simulation%problem, situation%amount*scale_of(simulation))
    end select
  end subroutine prepare

  !> Set a fraction of the impulses to zero, chosen by the names of the bodies.
  subroutine lose_impulses(problem, share)
    type(contact_problem_t), intent(inout) :: problem
    real(dp), intent(in) :: share
    integer(i8) :: pair(2), name
    integer :: s, c

    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do c = 1, sub%n_contacts
          pair(1) = min(sub%id(sub%pair(1, c)), sub%id(sub%pair(2, c)))
          pair(2) = max(sub%id(sub%pair(1, c)), sub%id(sub%pair(2, c)))
          name = iand(hash_words(pair), shiftr(huge(1_i8), 1))
          if (hash_uniform(seed, name, 1) < share) sub%impulse(lane_of(c), :, block_of(c)) = 0.0_dp
        end do
      end associate
    end do
  end subroutine lose_impulses

  !> Turn gravity about an axis across the vertical one and x: free velocities of the grains get h (g' - g).
  subroutine turn_gravity(simulation, angle)
    type(simulation_t), intent(inout) :: simulation
    !> [degrees]
    real(dp), intent(in) :: angle
    real(dp) :: turned(3), radians
    integer :: s, b, nd

    nd = simulation%problem%nd
    radians = angle*acos(-1.0_dp)/180.0_dp
    associate (g => simulation%physics%gravity)
      turned(1:nd) = g(1:nd)
      turned(1) = cos(radians)*g(1) - sin(radians)*g(nd)
      turned(nd) = sin(radians)*g(1) + cos(radians)*g(nd)
      do s = 1, size(simulation%problem%sub)
        associate (sub => simulation%problem%sub(s))
          do b = 1, sub%n_grains
            sub%v_free(1:nd, b) = sub%v_free(1:nd, b) + simulation%physics%h*(turned(1:nd) - g(1:nd))
          end do
        end associate
      end do
    end associate
  end subroutine turn_gravity

  !> Add to the free velocity of each grain, along each axis, a number between -speed and speed.
  subroutine stir(problem, speed)
    type(contact_problem_t), intent(inout) :: problem
    !> [m/s]
    real(dp), intent(in) :: speed
    integer :: s, b, d

    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do b = 1, sub%n_grains
          do d = 1, problem%nd
            sub%v_free(d, b) = sub%v_free(d, b) + speed*(2.0_dp*hash_uniform(seed, sub%id(b), d) - 1.0_dp)
          end do
        end do
      end associate
    end do
  end subroutine stir

end module gravier_error_situations
