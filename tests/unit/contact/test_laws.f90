!> The laws of contact against their formulas: keys, terms of a pair, memories, and the laws of a scene by pairs of materials.
program test_laws
  use gravier_kinds, only: dp
  use gravier_declared_keys, only: declared_key_t, collected_keys_t
  use gravier_contact_coefficients, only: coefficients_t
  use gravier_contact_law, only: contact_law_t, contact_pair_t, unused, rounded_gap
  use gravier_coulomb_law, only: coulomb_law_t
  use gravier_frictionless_law, only: frictionless_law_t
  use gravier_none_law, only: none_law_t
  use gravier_material_filter, only: material_filter_t, material_of
  use gravier_body_store, only: body_set_t, body_layout_t
  use gravier_boundary, only: boundary_t
  use gravier_velocity_law, only: velocity_law_t
  use gravier_adhesive_law, only: adhesive_law_t
  use gravier_capillary_law, only: capillary_law_t
  use gravier_bonded_law, only: bonded_law_t
  use gravier_contact_spring, only: damping_ratio
  use gravier_elastic_law, only: elastic_law_t
  use gravier_hertz_law, only: hertz_law_t
  use gravier_law_registry, only: law_holder_t, registered_laws, law_keys
  use gravier_law_set, only: law_set_t
  use gravier_test_law_names, only: name_length, split_names, add_law
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  !> some roundings of numbers of the order of one
  real(dp), parameter :: rounding = 4*epsilon(1.0_dp)

  call check_registry()
  call check_coefficients()
  call check_coulomb()
  call check_velocity()
  call check_adhesive()
  call check_capillary()
  call check_bonded()
  call check_elastic()
  call check_hertz()
  call check_law_set()
  call check_defaults()
  call check_none()
  call finish_checks()

contains

  !> Give the keys of a law values by their names; others get their defaults.
  subroutine set_law(law, text, values)
    class(contact_law_t), intent(inout) :: law
    !> names with blanks between
    character(len=*), intent(in) :: text
    real(dp), intent(in) :: values(:)
    character(len=name_length), allocatable :: names(:)
    type(declared_key_t), allocatable :: keys(:)
    real(dp), allocatable :: own(:)
    integer :: k, i

    call split_names(text, names)
    call law%keys(keys)
    allocate (own(size(keys)))
    do k = 1, size(keys)
      own(k) = 0.0_dp
      if (keys(k)%default /= "") read (keys(k)%default, *) own(k)
      do i = 1, size(names)
        if (keys(k)%name == names(i)) own(k) = values(i)
      end do
    end do
    do i = 1, size(names)
      call check(any(keys%name == names(i)), law%kind()//" has the key "//trim(names(i)))
    end do
    call law%set(own)
  end subroutine set_law

  !> An ordinary pair, as evaluate takes it.
  type(contact_pair_t) function pair_at(gap) result(pair)
    !> [m]
    real(dp), intent(in) :: gap
    pair%gap = gap
    pair%radius = 0.25_dp
    pair%terms%free_gap = max(gap, 0.0_dp)
  end function pair_at

  !> Each law under its word, and every key once, with the laws that have it.
  subroutine check_registry()
    character(len=*), parameter :: words = "coulomb frictionless none velocity adhesive capillary bonded elastic hertz"
    type(law_holder_t), allocatable :: laws(:)
    type(collected_keys_t) :: collected
    type(declared_key_t), allocatable :: own(:)
    integer :: n, l, k, i, holders

    call registered_laws(laws)
    call law_keys(collected)
    n = size(collected%keys)
    call check_equal(size(laws), 9, "laws")
    call check_equal(collected%kinds, words, "words of the laws, in the order of the registry")
    do i = 1, n
      call check_equal(count(collected%keys(1:n)%key%name == collected%keys(i)%key%name), 1, &
        & "a key is there once: "//collected%keys(i)%key%name)
      holders = 0
      do l = 1, size(laws)
        call laws(l)%law%keys(own)
        do k = 1, size(own)
          if (own(k)%name /= collected%keys(i)%key%name) cycle
          holders = holders + 1
          call check(index(" "//collected%keys(i)%kinds, " "//trim(laws(l)%law%kind())) > 0, "the key knows the laws that have it")
          call check(own(k)%default == collected%keys(i)%key%default .and. own(k)%allowed == collected%keys(i)%key%allowed &
            & .and. own(k)%unit == collected%keys(i)%key%unit .and. own(k)%meaning == collected%keys(i)%key%meaning, &
            & "a key is the same in all laws")
        end do
      end do
      call check_equal(holders, words_in(collected%keys(i)%kinds), "and no others: "//collected%keys(i)%key%name)
    end do
    do i = 1, n
      if (collected%keys(i)%key%name == "restitution") call check_equal(collected%keys(i)%kinds, "coulomb frictionless velocity", &
        & "laws with restitution")
      if (collected%keys(i)%key%name == "rolling_friction") call check_equal(collected%keys(i)%kinds, &
        & "coulomb velocity adhesive capillary bonded elastic hertz", "laws that resist rolling")
    end do
  end subroutine check_registry

  pure integer function words_in(text)
    character(len=*), intent(in) :: text
    integer :: k
    words_in = 0
    do k = 1, len_trim(text)
      if (text(k:k) == " ") words_in = words_in + 1
    end do
    words_in = words_in + 1
  end function words_in

  !> Each coefficient is raised by itself.
  subroutine check_coefficients()
    type(coefficients_t) :: a, b, c

    a = coefficients_t(friction=0.1_dp, restitution=0.9_dp, tangential_restitution=0.2_dp, rolling_friction=0.8_dp, &
      & pivoting_friction=0.3_dp)
    b = coefficients_t(friction=0.7_dp, restitution=0.3_dp, tangential_restitution=0.6_dp, rolling_friction=0.4_dp, &
      & pivoting_friction=0.5_dp)
    c = a
    call a%raise_to(b)
    call check_close(a%friction, 0.7_dp, 0.0_dp, "friction is raised")
    call check_close(a%restitution, 0.9_dp, 0.0_dp, "restitution stays")
    call check_close(a%tangential_restitution, 0.6_dp, 0.0_dp, "tangential restitution is raised")
    call check_close(a%rolling_friction, 0.8_dp, 0.0_dp, "rolling friction stays")
    call check_close(a%pivoting_friction, 0.5_dp, 0.0_dp, "pivoting friction is raised")
    call b%raise_to(c)
    call check(abs(b%friction - a%friction) + abs(b%restitution - a%restitution) + abs(b%tangential_restitution - &
      & a%tangential_restitution) + abs(b%rolling_friction - a%rolling_friction) + abs(b%pivoting_friction - &
      & a%pivoting_friction) <= 0.0_dp, "either way round")
  end subroutine check_coefficients

  !> Constant terms; without friction nothing sends a tangential velocity back.
  subroutine check_coulomb()
    type(coulomb_law_t) :: coulomb, smooth
    type(frictionless_law_t) :: frictionless
    type(contact_pair_t) :: pair

    call set_law(coulomb, "friction restitution tangential_restitution rolling_friction pivoting_friction", &
      & [0.4_dp, 0.5_dp, 0.6_dp, 0.7_dp, 0.8_dp])
    pair = pair_at(0.0_dp)
    call coulomb%evaluate(pair)
    call check_terms(pair, 0.4_dp, 0.0_dp, 0.0_dp, "coulomb")
    call check_close(pair%terms%restitution, 0.5_dp, 0.0_dp, "coulomb: restitution")
    call check_close(pair%terms%tangential_restitution, 0.6_dp, 0.0_dp, "coulomb: tangential restitution")
    call check_close(coulomb%largest%friction, 0.4_dp, 0.0_dp, "coulomb: largest friction")
    call check_close(coulomb%largest%rolling_friction, 0.7_dp, 0.0_dp, "coulomb: rolling friction")
    call check_close(coulomb%largest%pivoting_friction, 0.8_dp, 0.0_dp, "coulomb: pivoting friction")
    call check(.not. (coulomb%attracts .or. coulomb%remembers), "coulomb: no attraction, no memory")
    call set_law(smooth, "tangential_restitution", [0.6_dp])
    pair = pair_at(0.0_dp)
    call smooth%evaluate(pair)
    call check_close(pair%terms%tangential_restitution, 0.0_dp, 0.0_dp, "no tangential restitution without friction")
    call set_law(frictionless, "restitution", [0.3_dp])
    pair = pair_at(0.0_dp)
    call frictionless%evaluate(pair)
    call check_terms(pair, 0.0_dp, 0.0_dp, 0.0_dp, "frictionless")
    call check_close(pair%terms%restitution, 0.3_dp, 0.0_dp, "frictionless: restitution")
    call check_close(frictionless%largest%restitution, 0.3_dp, 0.0_dp, "frictionless: largest restitution")
  end subroutine check_coulomb

  subroutine check_terms(pair, friction, attraction, free_gap, what)
    type(contact_pair_t), intent(in) :: pair
    real(dp), intent(in) :: friction, attraction, free_gap
    character(len=*), intent(in) :: what

    call check_close(pair%terms%friction, friction, rounding, what//": friction")
    call check_close(pair%terms%attraction, attraction, rounding*max(attraction, 1.0_dp), what//": attraction")
    call check_close(pair%terms%free_gap, free_gap, 0.0_dp, what//": free_gap")
  end subroutine check_terms

  !> mu = mu_d + (mu_s - mu_d) exp(-v_t/v_s), mu_s at rest and mu_d far above v_s.
  subroutine check_velocity()
    type(velocity_law_t) :: law
    type(contact_pair_t) :: pair
    real(dp), parameter :: slips(4) = [0.0_dp, 0.01_dp, 0.05_dp, 100.0_dp]
    real(dp), parameter :: frictions(4) = [0.6_dp, 0.2_dp + 0.4_dp*exp(-0.2_dp), 0.2_dp + 0.4_dp*exp(-1.0_dp), 0.2_dp]
    integer :: k

    call set_law(law, "static_friction dynamic_friction slip_scale restitution tangential_restitution", &
      & [0.6_dp, 0.2_dp, 0.05_dp, 0.1_dp, 0.7_dp])
    do k = 1, size(slips)
      pair = pair_at(0.0_dp)
      pair%slip = slips(k)
      call law%evaluate(pair)
      call check_terms(pair, frictions(k), 0.0_dp, 0.0_dp, "velocity")
      call check_close(pair%terms%restitution, 0.1_dp, 0.0_dp, "velocity: restitution")
      call check_close(pair%terms%tangential_restitution, 0.7_dp, 0.0_dp, "velocity: tangential restitution")
    end do
    call check_close(law%largest%friction, 0.6_dp, 0.0_dp, "velocity: the largest friction is the larger one")
    call set_law(law, "static_friction dynamic_friction slip_scale", [0.1_dp, 0.3_dp, 1.0_dp])
    call check_close(law%largest%friction, 0.3_dp, 0.0_dp, "velocity: whichever that is")
  end subroutine check_velocity

  !> A constant attraction up to the range, at overlaps as well.
  subroutine check_adhesive()
    type(adhesive_law_t) :: law
    type(contact_pair_t) :: pair
    real(dp), parameter :: gaps(5) = [-0.2_dp, 0.0_dp, 0.01_dp, 0.0100001_dp, 1.0_dp]
    integer :: k

    call set_law(law, "friction adhesion adhesion_range rolling_friction", &
      & [0.3_dp, 7.0_dp, 0.01_dp, 0.2_dp])
    do k = 1, size(gaps)
      pair = pair_at(gaps(k))
      call law%evaluate(pair)
      call check_terms(pair, 0.3_dp, merge(7.0_dp, 0.0_dp, k <= 3), max(gaps(k), 0.0_dp), "adhesive")
    end do
    call check_close(law%range, 0.01_dp, 0.0_dp, "adhesive: range")
    call check_close(law%largest%rolling_friction, 0.2_dp, 0.0_dp, "adhesive: rolling friction")
    call check(law%attracts .and. .not. law%remembers, "adhesive: an attraction without a memory")
    pair%state = 5
    pair%normal = 1.0_dp
    call law%conclude(pair)
    call check_equal(pair%state, 0, "a law without a memory keeps no state")
  end subroutine check_adhesive

  !> F = kappa R exp(-gap/lambda) once a bridge has formed, until it breaks; kappa R at overlaps.
  subroutine check_capillary()
    type(capillary_law_t) :: law
    type(contact_pair_t) :: pair
    real(dp), parameter :: kappa = 20.0_dp, lambda = 0.002_dp, broken = 0.005_dp
    real(dp) :: force

    call set_law(law, "friction capillarity decay_length debonding_distance", &
      & [0.3_dp, kappa, lambda, broken])
    force = kappa*0.25_dp
    pair = pair_at(0.003_dp)
    call law%evaluate(pair)
    call check_terms(pair, 0.3_dp, 0.0_dp, 0.003_dp, "capillary: bodies that have not touched have no bridge")
    pair = pair_at(-0.1_dp)
    call law%evaluate(pair)
    call check_terms(pair, 0.3_dp, force, 0.0_dp, "capillary: an overlap does not raise the attraction")
    call check_equal(pair%state, 1, "capillary: bodies that touch have a bridge")
    pair = pair_at(0.2_dp*rounded_gap)
    call law%evaluate(pair)
    call check_equal(pair%state, 1, "capillary: bodies that touch but for rounding have a bridge")
    pair = pair_at(0.3_dp*rounded_gap)
    call law%evaluate(pair)
    call check_equal(pair%state, 0, "capillary: a gap beyond rounding is one")
    pair = pair_at(0.004_dp)
    pair%state = 1
    call law%evaluate(pair)
    call check_terms(pair, 0.3_dp, force*exp(-2.0_dp), 0.004_dp, "capillary: a bridge that is stretched")
    pair = pair_at(0.0051_dp)
    pair%state = 1
    call law%evaluate(pair)
    call check_terms(pair, 0.3_dp, 0.0_dp, 0.0051_dp, "capillary: a bridge that breaks")
    call check_equal(pair%state, 0, "capillary: it is broken")
    ! a contact that carries an impulse has touched, and one that carries none keeps what it has
    pair = pair_at(0.001_dp)
    pair%normal = 1.0e-9_dp
    call law%conclude(pair)
    call check_equal(pair%state, 1, "capillary: an impulse makes a bridge")
    pair%normal = 0.0_dp
    call law%conclude(pair)
    call check_equal(pair%state, 1, "capillary: a pair without an impulse keeps its bridge")
    pair = pair_at(0.006_dp)
    pair%normal = 1.0_dp
    call law%conclude(pair)
    call check_equal(pair%state, 0, "capillary: none forms beyond the debonding distance")
    call check(law%attracts .and. law%remembers, "capillary: an attraction with a memory")
    call check_close(law%range, broken, 0.0_dp, "capillary: range")
  end subroutine check_capillary

  !> Bonds are made in the first step only; one that opens or slides is broken for good.
  subroutine check_bonded()
    type(bonded_law_t) :: law
    type(contact_pair_t) :: pair

    call set_law(law, "friction bond_strength bond_friction bond_distance", &
      & [0.3_dp, 9.0_dp, 0.8_dp, 0.01_dp])
    call check_close(law%largest%friction, 0.8_dp, 0.0_dp, "bonded: the larger friction")
    pair = pair_at(0.005_dp)
    call law%evaluate(pair)
    call check_terms(pair, 0.3_dp, 0.0_dp, 0.005_dp, "bonded: no bond after the first step")
    pair = pair_at(0.005_dp)
    pair%first = .true.
    call law%evaluate(pair)
    call check_terms(pair, 0.8_dp, 9.0_dp, 0.0_dp, "bonded: a bond holds the distance, without free_gap")
    call check_equal(pair%state, 1, "bonded: the bond is remembered")
    pair = pair_at(0.011_dp)
    pair%first = .true.
    call law%evaluate(pair)
    call check_terms(pair, 0.3_dp, 0.0_dp, 0.011_dp, "bonded: no bond beyond the distance")
    ! r~_n = r_n + h F: a bond under a tension less than h F has r~_n > 0
    pair%state = 1
    pair%uncertain = 0.02_dp
    pair%motion = 0.03_dp
    pair%normal = 2.0_dp
    pair%tangential = 1.6_dp*(1.0_dp - 2*unused)
    call law%conclude(pair)
    call check_equal(pair%state, 1, "bonded: a bond below its shear strength stays, whatever the solve leaves of velocities")
    call check(.not. pair%doubtful, "bonded: it is not in doubt")
    pair%tangential = 1.6_dp
    pair%motion = 0.02_dp
    call law%conclude(pair)
    call check_equal(pair%state, 1, "bonded: a bond at its shear strength that does not slide stays")
    call check(pair%doubtful, "bonded: it is in doubt")
    pair%motion = 0.03_dp
    call law%conclude(pair)
    call check_equal(pair%state, 0, "bonded: a bond at its shear strength that slides breaks")
    call check(.not. pair%doubtful, "bonded: there is no doubt about that")
    pair%state = 1
    pair%normal = 0.0_dp
    pair%tangential = 0.0_dp
    pair%motion = 0.02_dp
    call law%conclude(pair)
    call check_equal(pair%state, 1, "bonded: a bond at its strength that does not open stays")
    pair%motion = 0.03_dp
    call law%conclude(pair)
    call check_equal(pair%state, 0, "bonded: a bond at its strength that opens breaks")
    call law%conclude(pair)
    call check_equal(pair%state, 0, "bonded: a broken bond stays broken")
    call check_opening(law)
  end subroutine check_bonded

  !> Bonds at their limit that open by a quarter of what a solve may be wrong, step after step.
  subroutine check_opening(law)
    type(bonded_law_t), intent(in) :: law
    type(contact_pair_t) :: pair
    integer :: k

    pair%state = 1
    pair%uncertain = 0.02_dp
    pair%motion = 0.005_dp
    pair%parting = 0.005_dp
    do k = 1, 20
      call law%conclude(pair)
    end do
    call check_equal(pair%state, 1, "opening: nothing is counted where bodies do not move")
    call check(pair%doubtful, "opening: it is in doubt")
    pair%in_motion = .true.
    do k = 1, 8
      call law%conclude(pair)
      call check(pair%state > 0 .and. pair%doubtful, "opening: a bond stays that has opened by less than two errors")
    end do
    pair%parting = -0.005_dp
    do k = 1, 20
      call law%conclude(pair)
    end do
    call check_equal(pair%state, 1, "opening: it has come back, and there is nothing less than that")
    pair%parting = 0.005_dp
    do k = 1, 8
      call law%conclude(pair)
    end do
    pair%normal = 1.0_dp
    call law%conclude(pair)
    call check_equal(pair%state, 1, "opening: a bond that holds again has opened by nothing")
    pair%normal = 0.0_dp
    do k = 1, 9
      call law%conclude(pair)
    end do
    call check_equal(pair%state, 0, "opening: it breaks once it has opened by more")
    call check(.not. pair%doubtful, "opening: there is no doubt about that")
    pair%state = 1
    pair%uncertain = 0.0_dp
    pair%motion = 0.0_dp
    call law%conclude(pair)
    call check_equal(pair%state, 1, "opening: without errors and motion it stays")
  end subroutine check_opening

  !> Stiffness as it is given, or by a number, a pressure and a breadth; which of them is wanted.
  subroutine check_elastic()
    type(elastic_law_t) :: law
    type(contact_pair_t) :: pair

    call set_law(law, &
      & "friction normal_stiffness stiffness_ratio spring_restitution tangential_damping spring_theta pull_off_force", &
      & [0.3_dp, 2.0e4_dp, 0.5_dp, 0.6_dp, 0.4_dp, 0.7_dp, 0.2_dp])
    call check(law%yields .and. law%attracts .and. .not. law%is_constant .and. .not. law%remembers, "what the law says of itself")
    call check(law%fault_key == "", "no fault")
    pair = pair_at(-0.01_dp)
    call law%evaluate(pair)
    call check_close(pair%spring%stiffness(1), 2.0e4_dp, 0.0_dp, "normal stiffness")
    call check_close(pair%spring%stiffness(2), 1.0e4_dp, rounding*1.0e4_dp, "tangential stiffness")
    call check_close(pair%spring%damping, damping_ratio(0.6_dp, 1.0_dp), 0.0_dp, "ratio of damping")
    call check_close(pair%spring%tangential_damping, 0.4_dp, 0.0_dp, "tangential damping")
    call check_close(pair%spring%weight, 0.7_dp, 0.0_dp, "weight")
    call check_close(pair%spring%hertz, 0.0_dp, 0.0_dp, "a linear spring")
    call check_close(pair%terms%friction, 0.3_dp, 0.0_dp, "friction")
    call check_close(pair%terms%attraction, 0.2_dp, 0.0_dp, "attraction of bodies that touch")
    pair = pair_at(0.2_dp*rounded_gap)
    call law%evaluate(pair)
    call check_close(pair%terms%attraction, 0.2_dp, 0.0_dp, "attraction of bodies that touch but for rounding")
    pair = pair_at(0.3_dp*rounded_gap)
    call law%evaluate(pair)
    call check_close(pair%terms%attraction, 0.0_dp, 0.0_dp, "no attraction of bodies apart")
    call set_law(law, "stiffness_number stiffness_pressure", [1.0e4_dp, 50.0_dp])
    pair%breadth = 0.02_dp
    call law%evaluate(pair)
    call check_close(pair%spring%stiffness(1), 1.0e4_dp, rounding*1.0e4_dp, "stiffness by number, pressure and breadth")
    call check(.not. law%attracts .and. law%fault_key == "", "without attraction, without fault")
    call set_law(law, "friction", [0.3_dp])
    call check_equal(law%fault_key, "normal_stiffness", "no stiffness")
    call set_law(law, "normal_stiffness stiffness_number stiffness_pressure", [1.0_dp, 1.0_dp, 1.0_dp])
    call check_equal(law%fault_key, "stiffness_number", "two stiffnesses")
    call set_law(law, "stiffness_number", [1.0_dp])
    call check_equal(law%fault_key, "stiffness_pressure", "a number without a pressure")
  end subroutine check_elastic

  !> Chords of the law of Hertz, and Mindlin's stiffness, at the compression of now or the one that is coming.
  subroutine check_hertz()
    type(hertz_law_t) :: law
    type(contact_pair_t) :: pair
    real(dp), parameter :: young = 1.0e6_dp, poisson = 0.3_dp, radius = 0.1_dp, mass = 0.5_dp
    real(dp) :: k, depth

    call set_law(law, "young_modulus poisson_ratio", [young, poisson])
    k = 4.0_dp/3.0_dp*young/(2.0_dp*(1.0_dp - poisson**2))*sqrt(radius)
    pair = pair_at(-0.01_dp)
    pair%reduced_radius = radius
    pair%reduced_mass = mass
    pair%h = 1.0e-3_dp
    call law%evaluate(pair)
    call check_close(pair%spring%hertz, k, rounding*k, "K")
    call check_close(pair%spring%stiffness(1), k*0.1_dp, rounding*k, "the chord at a compression of 0.01")
    call check_close(pair%spring%stiffness(2)/(1.5_dp*pair%spring%stiffness(1)), 2.0_dp*(1.0_dp - poisson)/(2.0_dp - poisson), &
      & rounding, "Mindlin's ratio of the stiffnesses at rest")
    ! a contact that closes at 2 m/s, at most by 2 mm in the step; an impact would be deeper
    pair = pair_at(0.001_dp)
    pair%reduced_radius = radius
    pair%reduced_mass = mass
    pair%h = 1.0e-3_dp
    pair%normal_velocity = -2.0_dp
    call law%evaluate(pair)
    call check_close(pair%spring%stiffness(1), k*sqrt(0.002_dp), rounding*k, "the chord of a contact that closes")
    pair%h = 1.0_dp
    depth = (1.25_dp*mass*4.0_dp/k)**0.4_dp
    call law%evaluate(pair)
    call check_close(pair%spring%stiffness(1), k*sqrt(depth), rounding*k, "the chord of an impact")
    pair%normal_velocity = 1.0_dp
    call law%evaluate(pair)
    call check(pair%spring%stiffness(1) > 0.0_dp .and. pair%spring%stiffness(1) < 1.0e-4_dp*k*sqrt(radius), "hardly any, but some")
  end subroutine check_hertz

  !> Pairs of materials in either order; what has no material, or no law, is under the scene's values.
  subroutine check_law_set()
    character(len=*), parameter :: names = "adhesion_range friction restitution adhesion"
    type(law_set_t) :: laws
    type(contact_pair_t) :: pair

    call laws%init(3, 2)
    call check_equal(laws%number_of(1, 2), 0, "no law yet")
    call add_law(laws, 1, 2, "adhesive", names, [0.02_dp, 0.4_dp, 0.9_dp, 5.0_dp])
    call check(laws%attracts .and. .not. laws%remembers, "the set attracts as its law")
    call add_law(laws, 3, 3, "frictionless", names, [0.5_dp, 0.6_dp, 0.25_dp, 1.0_dp])
    call check_equal(laws%number_of(1, 2), 1, "the first law")
    call check_equal(laws%number_of(2, 1), 1, "the first law, the other way round")
    call check_equal(laws%number_of(3, 3), 2, "the second law")
    call check_equal(laws%number_of(1, 1), 0, "a pair without a law")
    call check_equal(laws%number_of(2, 3), 0, "another one")
    call check_equal(laws%number_of(0, 2), 0, "a body without a material")
    call check_equal(laws%number_of(3, 0), 0, "the other body")
    call check_close(laws%largest%friction, 0.4_dp, 0.0_dp, "largest friction of all laws")
    call check_close(laws%largest%restitution, 0.25_dp, 0.0_dp, "largest restitution of all laws")
    call check_close(laws%range, 0.02_dp, 0.0_dp, "largest range of all laws")
    pair = pair_at(0.01_dp)
    call laws%of(1)%law%evaluate(pair)
    call check_terms(pair, 0.4_dp, 5.0_dp, 0.01_dp, "values go to keys by their names")
  end subroutine check_law_set

  !> Default laws of grains and of boundaries, beside laws of materials and without any.
  subroutine check_defaults()
    type(law_set_t) :: laws

    call check_equal(laws%default_of(2), 0, "a set that was given nothing")
    call laws%set_default(0, coefficients_t(friction=0.3_dp, rolling_friction=0.07_dp))
    call check_close(laws%of(0)%terms%friction, 0.3_dp, 0.0_dp, "friction of grains, of a set without other laws")
    call check_close(laws%of(0)%terms%rolling_friction, 0.07_dp, 0.0_dp, "rolling friction of grains")
    call laws%init(2, 1)
    call check_close(laws%of(0)%terms%friction, 0.0_dp, 0.0_dp, "no friction at first")
    call add_law(laws, 1, 2, "frictionless", "restitution", [0.25_dp])
    call check(.not. (laws%varies .or. laws%varies_at(1)), "laws with the same terms for all pairs")
    call laws%set_default(2, coefficients_t(friction=0.5_dp, restitution=0.1_dp, tangential_restitution=0.2_dp))
    call check_equal(laws%default_of(2), -2, "a boundary with a law of its own")
    call check_equal(laws%default_of(1), 0, "a boundary that has none is under that of grains")
    call check_equal(laws%default_of(7), 0, "another one")
    call check_close(laws%of(-2)%terms%tangential_restitution, 0.2_dp, 0.0_dp, "tangential restitution of a boundary")
    call check_close(laws%of(1)%terms%restitution, 0.25_dp, 0.0_dp, "the law of two materials stays")
    call laws%set_default(1, coefficients_t(tangential_restitution=0.2_dp))
    call check_close(laws%of(-1)%terms%tangential_restitution, 0.0_dp, 0.0_dp, "none without friction")
    call check_close(laws%of(-2)%terms%friction, 0.5_dp, 0.0_dp, "the law of the other boundary stays")
    call check_close(laws%largest%friction, 0.0_dp, 0.0_dp, "default laws do not count among those of materials")
    call laws%init(2, 1)
    call add_law(laws, 1, 1, "velocity", "static_friction dynamic_friction slip_scale restitution tangential_restitution", &
      & [0.5_dp, 0.3_dp, 1.0_dp, 0.0_dp, 0.0_dp])
    call check(laws%varies .and. laws%varies_at(1) .and. .not. laws%varies_at(0), "a law whose terms depend on the pair")
  end subroutine check_defaults

  !> Bodies of two materials whose law is no contact pass through each other, and others do not.
  subroutine check_none()
    type(law_set_t) :: laws
    type(none_law_t) :: law
    real(dp) :: nothing(0)
    type(contact_pair_t) :: pair
    type(body_set_t) :: bodies
    type(boundary_t) :: boundaries(2)

    call law%set(nothing)
    call check(law%passes .and. law%is_constant .and. .not. law%remembers, "none: its bodies pass")
    pair = pair_at(0.01_dp)
    call law%evaluate(pair)
    call check_terms(pair, 0.0_dp, 0.0_dp, 0.01_dp, "none: nothing is added to a pair")
    call laws%init(3, 2)
    call add_law(laws, 1, 1, "coulomb", "friction", [0.5_dp])
    call check(.not. allocated(laws%filter%passes), "none: without it there is nothing to ask")
    call add_law(laws, 3, 2, "none", "friction", [0.5_dp])
    call check_close(laws%largest%friction, 0.5_dp, 0.0_dp, "none: it has no friction")
    ! bodies of materials 1, 2, 3, none, and 2 glued to boundaries 1 (without a material) and 2 (of material 3)
    call bodies%init(body_layout_t(2, 3, 0), 6)
    bodies%material(1:6) = [1, 2, 3, 0, 2, 2]
    bodies%glued(1:6) = [0, 0, 0, 0, 1, 2]
    boundaries(2)%material = 3
    call check_equal(material_of(bodies, boundaries, 5), 2, "a glued grain keeps its material where the boundary has none")
    call check_equal(material_of(bodies, boundaries, 6), 3, "a glued grain is of the material of its boundary")
    call check_equal(material_of(bodies, boundaries, -2), 3, "a boundary has its own")
    associate (filter => laws%filter)
      call check(filter%lets_pass(bodies, boundaries, 2, 3) .and. filter%lets_pass(bodies, boundaries, 3, 2), "none: either order")
      call check(.not. filter%lets_pass(bodies, boundaries, 1, 2), "none: another pair meets")
      call check(.not. filter%lets_pass(bodies, boundaries, 3, 3), "none: equal materials meet")
      call check(.not. filter%lets_pass(bodies, boundaries, 4, 3), "none: what has no material meets all")
      call check(filter%lets_pass(bodies, boundaries, 3, 5), "none: a glued grain")
      call check_passed(filter, boundaries)
      call check(filter%lets_pass(bodies, boundaries, 2, -2), "none: a boundary")
      call check(.not. filter%lets_pass(bodies, boundaries, 3, -2), "none: a boundary of an equal material")
      call check(.not. filter%lets_pass(bodies, boundaries, 2, -1), "none: a boundary without a material")
    end associate
    call check_filter(bodies, boundaries)
  end subroutine check_none

  !> The boundaries that bodies of a material pass through: of one without a material and one of material 3 the second, by bodies
  !> of material 2 alone.
  subroutine check_passed(filter, boundaries)
    type(material_filter_t), intent(in) :: filter
    type(boundary_t), intent(in) :: boundaries(2)
    type(material_filter_t) :: none
    logical :: passed(2)
    integer :: material

    do material = 0, 3
      call filter%find_passed(material, boundaries, passed)
      call check(.not. passed(1), "none: a boundary without a material is passed by nothing")
      call check(passed(2) .eqv. material == 2, "none: a boundary that bodies pass through")
    end do
    call none%find_passed(2, boundaries, passed)
    call check(.not. any(passed), "none: no law lets anything pass")
  end subroutine check_passed

  !> A filter by itself: nothing passes until a pair is added.
  subroutine check_filter(bodies, boundaries)
    type(body_set_t), intent(in) :: bodies
    type(boundary_t), intent(in) :: boundaries(:)
    type(material_filter_t) :: filter

    call check(.not. filter%lets_pass(bodies, boundaries, 1, 2), "a filter lets nothing pass at first")
    call filter%add(1, 2, 3)
    call check(filter%lets_pass(bodies, boundaries, 1, 2), "and what is added then")
    call filter%add(3, 3, 3)
    call check(filter%lets_pass(bodies, boundaries, 1, 2) .and. filter%lets_pass(bodies, boundaries, 3, 3), "and both of two")
  end subroutine check_filter

end program test_laws
