!> Whether the terms of a law depend on the relative velocity of a pair is what the law says of itself: pairs of laws that do not
!> see it are evaluated without one.
program test_seen_velocity
  use gravier_kinds, only: dp
  use gravier_declared_keys, only: declared_key_t
  use gravier_contact_law, only: contact_pair_t
  use gravier_law_registry, only: law_holder_t, registered_laws
  use gravier_check, only: check, check_equal, finish_checks
  implicit none

  type(law_holder_t), allocatable :: laws(:)
  type(declared_key_t), allocatable :: keys(:)
  real(dp), allocatable :: values(:)
  integer :: l, k, seeing

  call registered_laws(laws)
  seeing = 0
  do l = 1, size(laws)
    call laws(l)%law%keys(keys)
    if (allocated(values)) deallocate (values)
    allocate (values(size(keys)))
    do k = 1, size(keys)
      values(k) = 0.4_dp + 0.05_dp*k
    end do
    call laws(l)%law%set(values)
    if (laws(l)%law%is_constant) cycle
    call check(differs(l, 0.0_dp, 0.0_dp, -0.7_dp, 1.3_dp) .eqv. laws(l)%law%sees_velocity, &
      & trim(laws(l)%law%kind())//" sees velocities, or says that it does not")
    if (laws(l)%law%sees_velocity) seeing = seeing + 1
  end do
  call check_equal(seeing, 2, "laws that see velocities: velocity and hertz")
  call finish_checks()

contains

  !> Whether law `l` makes something else of a pair with one velocity than of the same pair with another.
  logical function differs(l, normal, slip, other_normal, other_slip)
    integer, intent(in) :: l
    real(dp), intent(in) :: normal, slip, other_normal, other_slip
    type(contact_pair_t) :: pair, other

    pair%gap = -0.01_dp
    pair%radius = 0.5_dp
    pair%h = 0.1_dp
    pair%reduced_radius = 0.25_dp
    pair%reduced_mass = 2.0_dp
    other = pair
    pair%normal_velocity = normal
    pair%slip = slip
    other%normal_velocity = other_normal
    other%slip = other_slip
    call laws(l)%law%evaluate(pair)
    call laws(l)%law%evaluate(other)
    differs = abs(pair%terms%friction - other%terms%friction) + abs(pair%terms%restitution - other%terms%restitution) &
      & + abs(pair%terms%attraction - other%terms%attraction) + abs(pair%terms%free_gap - other%terms%free_gap) &
      & + abs(pair%spring%stiffness(1) - other%spring%stiffness(1)) + abs(pair%spring%stiffness(2) - other%spring%stiffness(2)) &
      & + abs(pair%spring%damping - other%spring%damping) + real(abs(pair%state - other%state), dp) > 0.0_dp
  end function differs

end program test_seen_velocity
