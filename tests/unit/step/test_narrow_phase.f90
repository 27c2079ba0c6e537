!> Which near pairs are contacts, with gaps, normals and terms; which law a pair has, and the velocities that it sees.
!> The pairs are put together by hand, and what is expected follows from the places.
program test_narrow_phase
  use gravier_body_store, only: body_layout_t
  use gravier_kinds, only: dp
  use gravier_periodic, only: shift_code
  use gravier_contact_coefficients, only: coefficients_t
  use gravier_contact_law, only: contact_pair_t
  use gravier_decomposition, only: decomposition_t
  use gravier_neighbour_list, only: pair_memory_t
  use gravier_halo, only: local_bodies_t
  use gravier_surface_velocity, only: round_place, find_start_velocity, find_surface_velocity, find_wall_point
  use gravier_pair_laws, only: set_default_laws, boundary_of, law_of, terms_of, find_pair_velocity, evaluate_pair
  use gravier_physics, only: physics_t
  use gravier_bond_turning, only: find_bond_velocity
  use gravier_bonded_groups, only: bonded_groups_t, find_bonded_groups
  use gravier_narrow_phase, only: contact_list_t, find_contacts
  use gravier_test_scenes, only: plane
  use gravier_test_law_names, only: add_law
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  !> some roundings of places of the order of one
  real(dp), parameter :: rounding = 8*epsilon(1.0_dp)
  character(len=*), parameter :: coulomb_keys = "friction rolling_friction pivoting_friction restitution tangential_restitution"

  call check_gaps(2)
  call check_gaps(3)
  call check_periods()
  call check_restitution()
  call check_materials()
  call check_memory()
  call check_terms()
  call check_watched()
  call check_velocities()
  call check_turning_boundary()
  call check_start_velocities()
  call check_bond_velocities()
  call check_bonded_groups()
  call finish_checks()

contains

  !> Grains at rest of radius 0.1 at places, above a plane at height 0 and, of number 2, one that is turned on request.
  subroutine make(nd, places, view, decomposition)
    integer, intent(in) :: nd
    !> (nd, n)
    real(dp), intent(in) :: places(:, :)
    type(local_bodies_t), intent(out) :: view
    type(decomposition_t), intent(out) :: decomposition
    real(dp) :: normal(nd), point(nd)
    integer :: k

    decomposition%nd = nd
    decomposition%nv = 3*nd - 3
    decomposition%rule%alert_distance = 0.01_dp
    point(:) = 0.0_dp
    normal(:) = 0.0_dp
    normal(nd) = 1.0_dp
    allocate (decomposition%boundaries(2))
    decomposition%boundaries(1) = plane(101, point, normal)
    point(nd) = -1.0_dp
    decomposition%boundaries(2) = plane(102, point, normal)
    call view%bodies%init(body_layout_t(nd, 3*nd - 3, 0), size(places, 2))
    do k = 1, size(places, 2)
      view%bodies%id(k) = k
    end do
    view%bodies%position(:, :) = places
    view%bodies%velocity(:, :) = 0.0_dp
    view%bodies%radius(:) = 0.1_dp
    view%bodies%mass(:) = 1.0_dp
    view%bodies%inertia(:) = 1.0_dp
    view%bodies%glued(:) = 0
  end subroutine make

  !> A list of pairs; boundaries are negative.
  subroutine list(view, pairs, memory, shifts)
    type(local_bodies_t), intent(inout) :: view
    !> (2, n)
    integer, intent(in) :: pairs(:, :)
    type(pair_memory_t), intent(in) :: memory
    !> codes of shifts (n)
    integer, intent(in), optional :: shifts(:)
    integer :: p, order(size(pairs, 2))

    call view%list%init(present(shifts), 1)
    do p = 1, size(pairs, 2)
      order(p) = p
      if (present(shifts)) then
        call view%list%add(pairs(1, p), pairs(2, p), shifts(p))
      else
        call view%list%add(pairs(1, p), pairs(2, p), 0)
      end if
    end do
    call view%list%finish(order, memory)
  end subroutine list

  !> Gaps within the alert distance, normals from antagonist to candidate; coincident centres; a plane that is gone.
  subroutine check_gaps(nd)
    integer, intent(in) :: nd
    type(local_bodies_t) :: view
    type(decomposition_t) :: decomposition
    type(physics_t) :: physics
    type(contact_list_t) :: found
    real(dp) :: places(nd, 6), along(nd), up(nd)

    along(:) = 0.0_dp
    along(1) = 0.6_dp
    along(nd) = 0.8_dp
    up(:) = 0.0_dp
    up(nd) = 1.0_dp
    places(:, 1) = 0.3_dp*up
    places(:, 2) = places(:, 1) + 0.209_dp*along
    places(:, 3) = places(:, 1) - 0.19_dp*along
    places(:, 4) = places(:, 1) + 0.211_dp*along
    places(:, 5) = 0.095_dp*up
    places(:, 6) = places(:, 5)
    call make(nd, places, view, decomposition)
    call list(view, reshape([1, 2, 1, 3, 1, 4, 5, -1, 1, -1, 5, 6, 5, -2], [2, 7]), pair_memory_t())
    call find_contacts(view, decomposition, physics, found)
    call check_equal(found%n, 4, "contacts: those within the alert distance")
    call check(all(found%source(1:4) == [1, 2, 4, 6]), "they are found at their places in the list")
    call check_close(found%gap(1), 0.009_dp, rounding, "an open gap")
    call check_close(found%gap(2), -0.01_dp, rounding, "an overlap")
    call check_close(found%gap(3), -0.005_dp, rounding, "an overlap with a plane")
    call check_close(found%gap(4), -0.2_dp, rounding, "coincident centres")
    call check_close(maxval(abs(found%normal(:, 1) + along)), 0.0_dp, 100*rounding, "normal: from the antagonist to the candidate")
    call check_close(maxval(abs(found%normal(:, 2) - along)), 0.0_dp, 100*rounding, "normal: the other way")
    call check_close(maxval(abs(found%normal(:, 3) - up)), 0.0_dp, rounding, "normal of a plane")
    call check_close(maxval(abs(found%normal(:, 4) - up)), 0.0_dp, 0.0_dp, "coincident centres are parted along the vertical")
    call check_equal(size(found%terms), 0, "no laws, no terms")
    view%list%watched = [2, 3, 6]
    call find_contacts(view, decomposition, physics, found)
    call check_equal(found%n, 2, "of some pairs alone, those that are contacts")
    call check(all(found%source(1:2) == [2, 6]), "at their places in the whole list")
    deallocate (view%list%watched)
    decomposition%boundaries(1)%present = .false.
    call find_contacts(view, decomposition, physics, found)
    call check_equal(found%n, 3, "a boundary that is removed has no contacts")
  end subroutine check_gaps

  !> The antagonist is shifted by whole periods to where it meets the candidate.
  subroutine check_periods()
    type(local_bodies_t) :: view
    type(decomposition_t) :: decomposition
    type(physics_t) :: physics
    type(contact_list_t) :: found
    integer :: codes(1)

    codes(1) = shift_code([-1, 0, 0])
    call make(2, reshape([0.05_dp, 0.5_dp, 1.952_dp, 0.5_dp], [2, 2]), view, decomposition)
    decomposition%period%length(1) = 2.1_dp
    call list(view, reshape([1, 2], [2, 1]), pair_memory_t(), codes)
    call find_contacts(view, decomposition, physics, found)
    call check_equal(found%n, 1, "a contact across a period")
    if (found%n < 1) return
    call check_close(found%gap(1), -0.002_dp, rounding, "its gap")
    call check_close(found%normal(1, 1), 1.0_dp, rounding, "its normal points from the image to the candidate")
  end subroutine check_periods

  !> A law with restitution acts in the step in which bodies touch, whatever the alert distance; boundaries have values of their
  !> own.
  subroutine check_restitution()
    type(local_bodies_t) :: view
    type(decomposition_t) :: decomposition
    type(physics_t) :: physics
    type(contact_list_t) :: found

    call make(2, reshape([0.0_dp, 0.105_dp, 0.205_dp, 0.105_dp], [2, 2]), view, decomposition)
    call list(view, reshape([1, 2, 1, -1], [2, 2]), pair_memory_t())
    decomposition%boundaries(1)%contact = coefficients_t(friction=0.0_dp, tangential_restitution=0.7_dp)
    call set_default_laws(physics%laws, coefficients_t(friction=0.2_dp, restitution=0.5_dp), decomposition%boundaries)
    call find_contacts(view, decomposition, physics, found)
    call check_equal(found%n, 1, "an open pair with restitution is no contact")
    if (found%n == 1) call check_equal(found%source(1), 2, "tangential restitution without friction is none")
    call physics%laws%set_default(1, coefficients_t(friction=0.1_dp, tangential_restitution=0.7_dp))
    call find_contacts(view, decomposition, physics, found)
    call check_equal(found%n, 0, "with friction the boundary's is")
    physics%h = 0.1_dp
    view%bodies%velocity(1, 2) = -0.09_dp
    call find_contacts(view, decomposition, physics, found)
    call check_equal(found%n, 0, "a pair that comes together by nine tenths of its gap in half a step is no contact")
    view%bodies%velocity(1, 2) = -0.11_dp
    call find_contacts(view, decomposition, physics, found)
    call check_equal(found%n, 1, "a pair that touches within half a step is one")
    view%bodies%velocity(1, 2) = 0.0_dp
    view%bodies%position(1, 2) = 0.2_dp*(1.0_dp - epsilon(1.0_dp))
    call find_contacts(view, decomposition, physics, found)
    call check_equal(found%n, 1, "a pair that touches is a contact")
    associate (terms => terms_of(physics%laws, law_of(view, decomposition%boundaries, physics%laws, 1), -0.25_dp))
      call check_close(terms%restitution, 0.5_dp, 0.0_dp, "grains have the coefficients of the scene")
      call check_close(terms%free_gap, 0.0_dp, 0.0_dp, "an overlap gives no free_gap")
    end associate
    associate (terms => terms_of(physics%laws, law_of(view, decomposition%boundaries, physics%laws, 2), 0.25_dp))
      call check_close(terms%friction, 0.1_dp, 0.0_dp, "a boundary has its own")
      call check_close(terms%free_gap, 0.25_dp, 0.0_dp, "an open gap is the free_gap")
    end associate
  end subroutine check_restitution

  !> The boundary and the law of pairs with glued grains, in either order of the two.
  subroutine check_materials()
    type(local_bodies_t) :: view
    type(decomposition_t) :: decomposition
    type(physics_t) :: physics

    call make(2, reshape([0.0_dp, 0.2_dp, 0.2_dp, 0.2_dp, 0.4_dp, 0.2_dp], [2, 3]), view, decomposition)
    view%bodies%glued(2) = 2
    view%bodies%material(3) = 3
    call list(view, reshape([1, 2, 2, 3, 1, 3, 1, -1], [2, 4]), pair_memory_t())
    call check_equal(boundary_of(view, 1), 2, "the antagonist is glued")
    call check_equal(boundary_of(view, 2), 2, "the candidate is glued")
    call check_equal(boundary_of(view, 3), 0, "two free grains")
    call check_equal(boundary_of(view, 4), 1, "a boundary")
    call physics%laws%init(3, 3)
    call set_default_laws(physics%laws, coefficients_t(), decomposition%boundaries)
    call add_law(physics%laws, 1, 2, "coulomb", coulomb_keys, [0.3_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp])
    call add_law(physics%laws, 1, 3, "frictionless", "restitution", [0.0_dp])
    call check_equal(law_of(view, decomposition%boundaries, physics%laws, 1), -2, &
      & "both are of the first material, which has no law: the default law of the boundary")
    call check_equal(law_of(view, decomposition%boundaries, physics%laws, 2), 2, "materials 1 and 3")
    decomposition%boundaries(2)%material = 2
    call check_equal(law_of(view, decomposition%boundaries, physics%laws, 1), 1, "a glued grain is of the boundary's material")
    call check_equal(law_of(view, decomposition%boundaries, physics%laws, 2), -2, &
      & "the other pair is under the default law of its boundary then")
    call check_equal(law_of(view, decomposition%boundaries, physics%laws, 4), -1, &
      & "the plane has no material, and a default law of its own")
    decomposition%boundaries(1)%material = 3
    call check_equal(law_of(view, decomposition%boundaries, physics%laws, 4), 2, "materials of grain and plane")
  end subroutine check_materials

  !> Beyond the alert distance a pair is a contact while it remembers something: a bridge between grains that part.
  subroutine check_memory()
    type(local_bodies_t) :: view
    type(decomposition_t) :: decomposition
    type(physics_t) :: physics
    type(contact_list_t) :: found
    type(pair_memory_t) :: memory
    real(dp) :: force

    call make(2, reshape([0.0_dp, 0.5_dp, 0.23_dp, 0.5_dp], [2, 2]), view, decomposition)
    view%bodies%radius(2) = 0.12_dp
    memory%law_row = 1
    call list(view, reshape([1, 2], [2, 1]), memory)
    call physics%laws%init(1, 1)
    call add_law(physics%laws, 1, 1, "capillary", "friction capillarity decay_length debonding_distance", &
      & [0.3_dp, 50.0_dp, 0.02_dp, 0.05_dp])
    decomposition%rule%alert_distance = 0.001_dp
    call find_contacts(view, decomposition, physics, found)
    call check_equal(found%n, 0, "a pair that has not touched is far")
    view%list%state(1, 1) = 1
    call find_contacts(view, decomposition, physics, found)
    call check_equal(found%n, 1, "a bridge beyond the alert distance")
    if (found%n < 1) return
    ! the geometric mean of the radii, and a gap of half the decay length
    force = 50.0_dp*sqrt(0.1_dp*0.12_dp)*exp(-0.5_dp)
    call check_close(found%terms(1)%attraction, force, 100*rounding*force, "its force")
    call check_close(found%terms(1)%free_gap, 0.01_dp, rounding, "its free_gap")
    ! overlaps: the full force
    view%bodies%position(1, 2) = 0.2_dp
    call find_contacts(view, decomposition, physics, found)
    call check_close(found%terms(1)%attraction, 50.0_dp*sqrt(0.1_dp*0.12_dp), rounding*force, "the force of an overlap")
    view%bodies%position(1, 2) = 0.3_dp
    call find_contacts(view, decomposition, physics, found)
    call check_equal(found%n, 0, "a bridge that breaks is no contact any more")
    call check_equal(view%list%state(1, 1), 0, "and is forgotten")
  end subroutine check_memory

  !> Each contact has the terms of its own law, also where a pair between two contacts is none, and the boundary that takes part.
  subroutine check_terms()
    type(local_bodies_t) :: view
    type(decomposition_t) :: decomposition
    type(physics_t) :: physics
    type(contact_list_t) :: found

    call make(2, reshape([0.0_dp, 0.5_dp, 0.2_dp, 0.5_dp, 0.9_dp, 0.5_dp, 0.0_dp, 0.7_dp], [2, 4]), view, decomposition)
    view%bodies%material(4) = 2
    view%bodies%glued(4) = 2
    decomposition%boundaries(2)%material = 2
    call list(view, reshape([1, 2, 1, 3, 1, 4], [2, 3]), pair_memory_t(law_row=1))
    call physics%laws%init(2, 2)
    call add_law(physics%laws, 1, 1, "capillary", "friction capillarity decay_length debonding_distance", &
      & [0.3_dp, 50.0_dp, 0.02_dp, 0.05_dp])
    call add_law(physics%laws, 1, 2, "coulomb", coulomb_keys, [0.4_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp])
    call find_contacts(view, decomposition, physics, found)
    call check_equal(found%n, 2, "contacts under two laws")
    if (found%n /= 2) return
    call check(all(found%source(1:2) == [1, 3]), "their places in the list")
    call check(all(found%boundary(1:2) == [0, 2]), "the boundary of a glued grain, and none")
    call check_close(found%terms(1)%friction, 0.3_dp, 0.0_dp, "friction of the first")
    call check_close(found%terms(1)%attraction, 50.0_dp*0.1_dp, rounding*5.0_dp, "attraction of the first")
    call check_close(found%terms(2)%friction, 0.4_dp, 0.0_dp, "friction of the second")
    call check_close(found%terms(2)%attraction, 0.0_dp, 0.0_dp, "the second attracts nothing")
  end subroutine check_terms

  !> What is forgotten of the pairs that are looked at alone; where a body has gone, all are looked at, with what they keep.
  subroutine check_watched()
    type(local_bodies_t) :: view
    type(decomposition_t) :: decomposition
    integer :: p

    call make(2, reshape([0.0_dp, 0.5_dp, 0.2_dp, 0.5_dp, 0.4_dp, 0.5_dp, 0.6_dp, 0.5_dp], [2, 4]), view, decomposition)
    call list(view, reshape([1, 2, 1, -1, 2, 3, 3, 4], [2, 4]), pair_memory_t(n_impulse=2, n_spring=1))
    associate (pairs => view%list)
      do p = 1, 4
        pairs%impulse(:, p) = real(p, dp)
        pairs%spring(:, p) = -real(p, dp)
      end do
      call check_equal(pairs%n_watched(), 4, "all pairs are looked at")
      call check_equal(pairs%watched_place(3), 3, "each at its place")
      pairs%watched = [2, 4]
      call check_equal(pairs%n_watched(), 2, "pairs that are looked at")
      call check_equal(pairs%watched_place(2), 4, "place of the last of them")
      call pairs%forget_impulses()
      call check(all(nint(pairs%impulse(2, 1:4)) == [1, 0, 3, 0]), "they forget their impulses, the others do not")
      call check(all(nint(pairs%spring(1, 1:4)) == [-1, -2, -3, -4]), "and no elongation")
      call pairs%forget_elongations()
      call check(all(nint(pairs%spring(1, 1:4)) == [-1, 0, -3, 0]), "they forget their elongations, the others do not")
      call pairs%drop([1, 2, 3, 0])
      call check_equal(pairs%n, 3, "pairs of bodies that stay")
      call check_equal(pairs%n_watched(), 3, "all of which are looked at")
      call check(all(nint(pairs%impulse(1, 1:3)) == [1, 0, 3]), "with what they keep")
      call pairs%forget_impulses()
      call pairs%forget_elongations()
      call check_close(maxval(abs(pairs%impulse(:, 1:3))), 0.0_dp, 0.0_dp, "until all forget their impulses")
      call check_close(maxval(abs(pairs%spring(:, 1:3))), 0.0_dp, 0.0_dp, "and their elongations")
    end associate
  end subroutine check_watched

  !> Normal velocity and slip of two grains that move and turn, against velocities of their points of contact.
  subroutine check_velocities()
    type(local_bodies_t) :: view
    type(decomposition_t) :: decomposition
    type(physics_t) :: physics
    type(contact_pair_t) :: pair
    real(dp) :: v(3), w(3), n(3), places(3, 2)

    call physics%laws%init(1, 1)
    call add_law(physics%laws, 1, 1, "coulomb", coulomb_keys, [0.3_dp, 0.11_dp, 0.12_dp, 0.0_dp, 0.0_dp])
    n = [0.6_dp, 0.0_dp, 0.8_dp]
    places(:, 1) = [0.0_dp, 0.0_dp, 1.0_dp]
    places(:, 2) = places(:, 1) - 0.2_dp*n
    call make(3, places, view, decomposition)
    view%bodies%velocity(:, 1) = [1.0_dp, 2.0_dp, 3.0_dp, 4.0_dp, 5.0_dp, 6.0_dp]
    view%bodies%velocity(:, 2) = [0.5_dp, -1.0_dp, 0.25_dp, -2.0_dp, 3.0_dp, 1.0_dp]
    call list(view, reshape([1, 2], [2, 1]), pair_memory_t())
    call find_pair_velocity(view, decomposition%boundaries, 1, round_place(view, 1, pair%gap, n, joined=.false.), n, pair)
    call evaluate_pair(view, physics%laws%of(1)%law, 1, pair)
    ! V + w x (-0.1 n) of the first grain, less V + w x (0.1 n) of the second
    v = cross([4.0_dp, 5.0_dp, 6.0_dp], n)
    w = cross([-2.0_dp, 3.0_dp, 1.0_dp], n)
    v = [0.5_dp, 3.0_dp, 2.75_dp] - 0.1_dp*(v + w)
    call check_close(pair%normal_velocity, dot_product(v, n), 10*rounding, "normal velocity: positive where they part")
    call check_close(pair%slip, norm2(v - dot_product(v, n)*n), 10*rounding, "slip")
    call check_close(pair%terms%rolling_friction, 0.11_dp, 0.0_dp, "rolling friction of the law")
    call check_close(pair%terms%pivoting_friction, 0.12_dp, 0.0_dp, "pivoting friction of the law")
    call check_close(pair%radius, 0.1_dp, rounding, "radius of the pair")
    ! in the plane a spin is about z: the point of contact below the disk goes to the right
    call make(2, reshape([0.0_dp, 0.1_dp], [2, 1]), view, decomposition)
    view%bodies%velocity(:, 1) = [0.3_dp, -0.2_dp, 5.0_dp]
    call list(view, reshape([1, -1], [2, 1]), pair_memory_t())
    call find_pair_velocity(view, decomposition%boundaries, 1, round_place(view, 1, pair%gap, [0.0_dp, 1.0_dp], joined=.false.), &
      & [0.0_dp, 1.0_dp], pair)
    call check_close(pair%normal_velocity, -0.2_dp, rounding, "a disk approaches a plane")
    call check_close(pair%slip, 0.8_dp, rounding, "and slips: 0.3 + 5 0.1")
    decomposition%boundaries(1)%last_velocity(1) = 0.8_dp
    call find_pair_velocity(view, decomposition%boundaries, 1, round_place(view, 1, pair%gap, [0.0_dp, 1.0_dp], joined=.false.), &
      & [0.0_dp, 1.0_dp], pair)
    call check_close(pair%slip, 0.0_dp, rounding, "a plane that moves with it")
  end subroutine check_velocities

  !> Two spheres that turn as one about a line through the origin, w x r at the start of the step: with the velocity of their bond
  !> they end on their circles, w x r again. The velocity of a bond to what turns as a boundary is that of the centre of the sphere.
  subroutine check_bond_velocities()
    type(local_bodies_t) :: view
    type(decomposition_t) :: decomposition
    type(physics_t) :: physics
    real(dp), parameter :: spin(3) = [3.0_dp, -2.0_dp, 1.5_dp], h = 0.05_dp
    real(dp) :: start(3, 2), moving(3, 2), places(3, 2), velocity(3), ahead(3), arm(3), exact(3), turned(3), n(3), gap
    integer :: k

    physics%h = h
    start(:, 1) = [0.3_dp, 0.4_dp, -0.2_dp]
    start(:, 2) = start(:, 1) + 0.23_dp*[0.6_dp, 0.0_dp, 0.8_dp]
    do k = 1, 2
      call turn(spin, start(:, k), moving(:, k))
      places(:, k) = start(:, k) + 0.5_dp*h*moving(:, k)
    end do
    call make(3, places, view, decomposition)
    do k = 1, 2
      view%bodies%velocity(1:3, k) = moving(:, k)
      view%bodies%velocity(4:6, k) = spin
    end do
    call list(view, reshape([1, 2], [2, 1]), pair_memory_t())
    arm(:) = places(:, 1) - places(:, 2)
    gap = norm2(arm) - 0.2_dp
    n(:) = arm/norm2(arm)
    call find_bond_velocity(view, decomposition%boundaries, physics, 1, round_place(view, 1, gap, n, joined=.true.), velocity)
    call turn(spin, arm, exact)
    exact(:) = exact + velocity
    ahead(:) = arm + 0.5_dp*h*exact
    call check_close(norm2(ahead), 0.23_dp, 10*rounding, "spheres that turn as one keep their distance")
    call turn(spin, ahead, turned)
    call check_close(maxval(abs(exact - turned)), 0.0_dp, 10*rounding, "and their velocity turns with them")
    ! the second one is part of a boundary that turns about the origin as before
    view%bodies%glued(2) = 2
    decomposition%boundaries(2)%last_spin(:) = spin
    decomposition%boundaries(2)%pivot(:) = 0.0_dp
    call find_bond_velocity(view, decomposition%boundaries, physics, 1, round_place(view, 1, gap, n, joined=.true.), velocity)
    call turn(spin, places(:, 1), exact)
    exact(:) = exact + velocity
    ahead(:) = places(:, 1) + 0.5_dp*h*exact
    call check_close(norm2(ahead), norm2(start(:, 1)), 10*rounding, "a sphere goes round with a glued one")
    ! slow turning is left alone
    view%bodies%glued(2) = 0
    view%bodies%velocity(:, :) = 1.0e-4_dp*view%bodies%velocity
    call find_bond_velocity(view, decomposition%boundaries, physics, 1, round_place(view, 1, gap, n, joined=.true.), velocity)
    call check_close(maxval(abs(velocity)), 0.0_dp, 0.0_dp, "what hardly turns has bonds at rest")
  end subroutine check_bond_velocities

  !> Four spheres that are bonded to each other, each to all others, turn as one whatever their spins; two that hang on one of them
  !> in a row are a chain but for the bond with it. A body with two bonds to a boundary turns as that does.
  subroutine check_bonded_groups()
    type(local_bodies_t) :: view
    type(decomposition_t) :: decomposition
    type(physics_t) :: physics
    type(contact_list_t) :: found
    type(bonded_groups_t) :: groups
    real(dp), parameter :: turning(3) = [3.0_dp, -2.0_dp, 1.5_dp]
    real(dp) :: places(3, 6), spin(3)
    integer :: k, pairs(2, 10)
    logical :: known

    places(:, :) = 0.0_dp
    places(1, 2) = 0.2_dp
    places(2, 3) = 0.2_dp
    places(3, 4) = 0.2_dp
    places(3, 5) = 0.4_dp
    places(3, 6) = 0.6_dp
    call make(3, places, view, decomposition)
    do k = 1, 6
      call turn(turning, places(:, k), view%bodies%velocity(1:3, k))
      view%bodies%velocity(4:6, k) = 10.0_dp*k
    end do
    pairs = reshape([1, 2, 1, 3, 1, 4, 2, 3, 2, 4, 3, 4, 4, 5, 5, 6, 1, -1, 2, -2], [2, 10])
    call list(view, pairs, pair_memory_t())
    physics%theta = 1.0_dp
    physics%h = 0.0_dp
    found%n = 10
    found%source = [(k, k=1, 10)]
    found%boundary = [0, 0, 0, 0, 0, 0, 0, 0, 1, 2]
    allocate (found%gap(10), found%normal(3, 10), found%terms(10), found%place(0))
    do k = 1, 10
      found%gap(k) = 0.0_dp
      found%normal(:, k) = [0.0_dp, 0.0_dp, 1.0_dp]
      if (k < 9) then
        found%normal(:, k) = places(:, pairs(1, k)) - places(:, pairs(2, k))
        found%gap(k) = norm2(found%normal(:, k)) - 0.2_dp
        found%normal(:, k) = found%normal(:, k)/norm2(found%normal(:, k))
      end if
      found%terms(k)%joins = k < 9
    end do
    call find_bonded_groups(view, decomposition%boundaries, physics, found, groups)
    call check(all(groups%group == [1, 1, 1, 1, 1, 0]), "three bonds make a group, a chain none")
    call groups%find_spin(view, decomposition%boundaries, found, 4, known, spin)
    call check(known, "a bond of the group")
    call check_close(maxval(abs(spin - turning)), 0.0_dp, 1.0e-12_dp, "its spin is that of the places")
    call groups%find_spin(view, decomposition%boundaries, found, 8, known, spin)
    call check(.not. known, "a bond of the chain")
    found%terms(9:10)%joins = .true.
    decomposition%boundaries(1)%last_spin(3) = 7.0_dp
    call find_bonded_groups(view, decomposition%boundaries, physics, found, groups)
    call groups%find_spin(view, decomposition%boundaries, found, 4, known, spin)
    call check_close(spin(3), 7.0_dp, 0.0_dp, "a group that boundaries hold by two bonds turns as the first of them")
    found%source(8:10) = 8
    found%boundary(8:10) = 0
    found%terms(8:10)%joins = [.true., .false., .false.]
    call find_bonded_groups(view, decomposition%boundaries, physics, found, groups)
    call groups%find_spin(view, decomposition%boundaries, found, 8, known, spin)
    call check(.not. known, "a bond beside contacts that are none")
    call groups%find_spin(view, decomposition%boundaries, found, 10, known, spin)
    call check(known, "a contact of a pair that has a bond")
    call check_close(spin(3), 55.0_dp, 0.0_dp, "it turns with the mean of both bodies")
  end subroutine check_bonded_groups

  !> spin x arm
  pure subroutine turn(spin, arm, velocity)
    real(dp), intent(in) :: spin(3), arm(3)
    real(dp), intent(out) :: velocity(3)

    velocity(1) = spin(2)*arm(3) - spin(3)*arm(2)
    velocity(2) = spin(3)*arm(1) - spin(1)*arm(3)
    velocity(3) = spin(1)*arm(2) - spin(2)*arm(1)
  end subroutine turn

  pure function cross(a, b) result(c)
    real(dp), intent(in) :: a(3), b(3)
    real(dp) :: c(3)
    c(1) = a(2)*b(3) - a(3)*b(2)
    c(2) = a(3)*b(1) - a(1)*b(3)
    c(3) = a(1)*b(2) - a(2)*b(1)
  end function cross

  !> A glued grain moves with the boundary that turns, and not with a spin of its own, whether it is candidate or antagonist.
  subroutine check_turning_boundary()
    type(local_bodies_t) :: view
    type(decomposition_t) :: decomposition
    type(physics_t) :: physics
    type(contact_pair_t) :: pair
    real(dp) :: n(2)
    integer :: order

    call physics%laws%init(1, 1)
    call add_law(physics%laws, 1, 1, "coulomb", coulomb_keys, [0.3_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp])
    ! the free grain at (1, 0.2) lies on the glued one at (1, 0); the boundary turns about the origin by 3 rad/s
    do order = 1, 2
      if (order == 1) then
        call make(2, reshape([1.0_dp, 0.0_dp, 1.0_dp, 0.2_dp], [2, 2]), view, decomposition)
      else
        call make(2, reshape([1.0_dp, 0.2_dp, 1.0_dp, 0.0_dp], [2, 2]), view, decomposition)
      end if
      view%bodies%glued(order) = 2
      view%bodies%velocity(:, order) = 1.0e3_dp
      view%bodies%velocity(:, 3 - order) = [0.5_dp, 0.0_dp, 0.0_dp]
      decomposition%boundaries(2)%last_velocity(:) = 0.0_dp
      decomposition%boundaries(2)%last_spin(3) = 3.0_dp
      decomposition%boundaries(2)%pivot(:) = 0.0_dp
      call list(view, reshape([1, 2], [2, 1]), pair_memory_t())
      n(1) = 0.0_dp
      n(2) = merge(-1.0_dp, 1.0_dp, order == 1)
      call find_pair_velocity(view, decomposition%boundaries, 1, round_place(view, 1, pair%gap, n, joined=.false.), n, pair)
      ! at (1, 0.1) the boundary has the velocity (-0.3, 3)
      call check_close(pair%slip, 0.8_dp, 10*rounding, "slip against a glued grain, in either order")
      call check_close(pair%normal_velocity, -3.0_dp, 10*rounding, "approach of a glued grain, in either order")
    end do
  end subroutine check_turning_boundary

  !> Velocities at the start of a step: of a grain that turns, of a glued one and of a boundary.
  subroutine check_start_velocities()
    type(local_bodies_t) :: view
    type(decomposition_t) :: decomposition
    real(dp) :: v(3), w(2), point(2)

    call make(2, reshape([1.0_dp, 0.15_dp, 1.0_dp, 0.35_dp], [2, 2]), view, decomposition)
    call list(view, reshape([1, -1, 1, 2], [2, 2]), pair_memory_t())
    view%bodies%velocity(:, 1) = [0.5_dp, -0.25_dp, 2.0_dp]
    view%bodies%velocity(:, 2) = [1.0_dp, 0.5_dp, -1.0_dp]
    decomposition%boundaries(1)%last_velocity(2) = 0.125_dp
    decomposition%boundaries(2)%last_spin(3) = 3.0_dp
    decomposition%boundaries(2)%pivot(:) = 0.0_dp
    call find_wall_point(view, 1, 0.05_dp, [0.0_dp, 1.0_dp], point)
    call check_close(point(1), 1.0_dp, rounding, "point of a wall below a grain")
    call check_close(point(2), 0.0_dp, rounding, "its height")
    call find_start_velocity(view, decomposition%boundaries, 1, point, v)
    call check_close(v(3), 2.0_dp, 0.0_dp, "spin of a grain")
    call find_start_velocity(view, decomposition%boundaries, -1, point, v)
    call check_close(v(2), 0.125_dp, 0.0_dp, "velocity of a boundary")
    call check_close(v(3), 0.0_dp, 0.0_dp, "a boundary's velocity has no spin")
    call find_surface_velocity(view, decomposition%boundaries, 1, [0.0_dp, -0.1_dp], w)
    call check_close(w(1), 0.7_dp, rounding, "the spin carries the point below")
    view%bodies%glued(1) = 2
    call find_surface_velocity(view, decomposition%boundaries, 1, [0.0_dp, -0.1_dp], w)
    call check_close(w(1), -0.15_dp, rounding, "a glued grain turns with its boundary, along x")
    call check_close(w(2), 3.0_dp, rounding, "and along y")
  end subroutine check_start_velocities

end program test_narrow_phase
