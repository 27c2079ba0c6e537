!> The contacts of a subdomain: those of its near pairs that are within the alert distance, with gaps, normals and the terms of
!> their laws.
module gravier_narrow_phase
  use gravier_kinds, only: dp
  use gravier_contact_spring, only: spring_t
  use gravier_contact_law, only: contact_law_t, contact_pair_t, contact_terms_t
  use gravier_decomposition, only: decomposition_t
  use gravier_neighbour_list, only: neighbour_list_t
  use gravier_halo, only: local_bodies_t
  use gravier_wall_joints, only: joints_t, has_other
  use gravier_screens, only: screens_t
  use gravier_surface_velocity, only: contact_place_t, round_place, round_normal_velocity
  use gravier_pair_points, only: pair_points_t, carry_memory
  use gravier_shape_contacts, only: shape_work_t, find_points
  use gravier_pair_laws, only: boundary_of, law_of, terms_of, find_pair_velocity, evaluate_pair, sends_back
  use gravier_physics, only: physics_t
  implicit none
  private
  public :: contact_list_t, find_contacts, place_of

  !> Gaps and normals of the pairs of a list that are contacts.
  type :: contact_list_t
    integer :: n = 0
    !> place in the list (n)
    integer, allocatable :: source(:)
    !> the boundary that takes part, by itself or by a grain glued to it; 0 between free grains (n)
    integer, allocatable :: boundary(:)
    !> (n) [m], (nd, n)
    real(dp), allocatable :: gap(:), normal(:, :)
    !> place of each contact of the sweep among those found, once they are packed (n)
    integer, allocatable :: order(:)
    !> where some law has other terms for each pair (n)
    type(contact_terms_t), allocatable :: terms(:)
    !> where some law has springs (n)
    type(spring_t), allocatable :: spring(:)
    !> where bodies have shapes (n)
    type(contact_place_t), allocatable :: place(:)
    !> pairs of pieces whose cores overlap: more than their roundings; points that pairs have no place for
    integer :: overlapping_cores = 0, points_left_out = 0
    !> contacts whose intact bond is stretched, see `is_stretched`
    integer :: stretched_bonds = 0
  end type contact_list_t

contains

  !> Narrow phase: gaps and normals of the near pairs that are looked at, of which those within the alert distance are contacts.
  !> Those that are open under a law with restitution are none if their bodies do not come to touch within half a step.
  subroutine find_contacts(view, decomposition, physics, found)
    type(local_bodies_t), intent(inout) :: view
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics
    type(contact_list_t), intent(inout) :: found
    integer :: nd, room

    nd = decomposition%nd
    room = view%list%n_watched()
    if (allocated(found%source)) deallocate (found%source, found%boundary, found%gap, found%normal, found%terms, &
      & found%spring, found%place)
    if (allocated(found%order)) deallocate (found%order)
    allocate (found%source(room), found%boundary(room), found%gap(room), found%normal(nd, room))
    allocate (found%terms(merge(room, 0, physics%laws%varies)))
    allocate (found%spring(merge(room, 0, physics%laws%yields)))
    allocate (found%place(merge(room, 0, decomposition%no > 0)))
    found%n = 0
    found%overlapping_cores = 0
    found%points_left_out = 0
    found%stretched_bonds = 0
    if (decomposition%no > 0) then
      call find_contacts_of_shapes(view, decomposition, physics, found)
    else
      call find_round_contacts(view, decomposition, physics, found)
    end if
  end subroutine find_contacts

  !> The contacts of disks or spheres: one a pair, but for boundaries of facets, of which a grain may touch several.
  subroutine find_round_contacts(view, decomposition, physics, found)
    type(local_bodies_t), intent(inout) :: view
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics
    type(contact_list_t), intent(inout) :: found
    type(shape_work_t) :: work
    integer :: w, p, i, j, c, nd
    real(dp) :: branch(decomposition%nd), distance, gap, alert
    type(joints_t) :: joints
    type(screens_t) :: screens

    nd = decomposition%nd
    alert = decomposition%alert_distance()
    call joints%find(decomposition%boundaries)
    call screens%find(decomposition%boundaries)
    call work%init(nd, physics%h, counts=.false.)
    do w = 1, view%list%n_watched()
      p = view%list%watched_place(w)
      i = view%list%candidate(p)
      j = view%list%antagonist(p)
      ! a contact is written behind the last one of the list, which then takes it or not
      c = found%n + 1
      if (j > 0) then
        branch(:) = view%bodies%position(:, i) - view%bodies%position(:, j)
        if (size(view%list%shift) > 0) call decomposition%period%add_shift(view%list%shift(p), -1, branch)
        distance = norm2(branch)
        gap = distance - view%bodies%radius(i) - view%bodies%radius(j)
        if (is_far(view%list, p, gap, alert)) cycle
        if (screens%exist) then
          if (screens%part(decomposition, view, p, view%bodies%position(:, i), branch)) cycle
        end if
        if (distance > 0.0_dp) then
          found%normal(:, c) = branch/distance
        else
          ! coincident centres have no normal: take the vertical, so that the law can part them
          found%normal(:, c) = 0.0_dp
          found%normal(nd, c) = 1.0_dp
        end if
      else
        if (.not. decomposition%boundaries(-j)%present) cycle
        if (decomposition%boundaries(-j)%is_faceted()) then
          if (view%list%begins(p)) call find_facet_contacts(view, decomposition, physics, p, joints, work, found)
          cycle
        end if
        call decomposition%boundaries(-j)%locate(view%bodies%position(:, i), distance, found%normal(:, c))
        gap = distance - view%bodies%radius(i)
        if (is_far(view%list, p, gap, alert)) cycle
        if (joints%exist .and. .not. remembers(view%list, p)) then
          if (has_other(decomposition, joints, view%bodies, i, -j, gap, found%normal(:, c))) cycle
        end if
      end if
      found%source(c) = p
      found%gap(c) = gap
      call add_contact(view, decomposition, physics, found)
    end do
  end subroutine find_round_contacts

  !> The contacts of a disk or a sphere with a boundary of facets, whose pair begins at place `p`.
  subroutine find_facet_contacts(view, decomposition, physics, p, joints, work, found)
    type(local_bodies_t), intent(inout) :: view
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics
    integer, intent(in) :: p
    !> of the boundaries
    type(joints_t), intent(in) :: joints
    type(shape_work_t), intent(inout) :: work
    type(contact_list_t), intent(inout) :: found
    type(pair_points_t) :: points
    integer :: i, j, k

    call view%find_ends(p, i, j)
    call find_points(view, decomposition, p, work, points)
    call carry_memory(points, p, view%list)
    do k = 1, points%n
      call write_point(points, k, p, found)
      if (joints%exist .and. .not. remembers(view%list, p + k - 1)) then
        associate (c => found%n + 1)
          if (has_other(decomposition, joints, view%bodies, i, -j, found%gap(c), found%normal(:, c))) cycle
        end associate
      end if
      call add_contact(view, decomposition, physics, found)
    end do
    found%overlapping_cores = found%overlapping_cores + points%overlapping_cores
    found%points_left_out = found%points_left_out + points%left_out
  end subroutine find_facet_contacts

  !> The contacts of bodies with shapes: a pair has as many places in the list as it may have points.
  subroutine find_contacts_of_shapes(view, decomposition, physics, found)
    type(local_bodies_t), intent(inout) :: view
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics
    type(contact_list_t), intent(inout) :: found
    type(pair_points_t) :: points
    type(shape_work_t) :: work
    type(screens_t) :: screens
    integer :: w, p, k

    call screens%find(decomposition%boundaries)
    call work%init(decomposition%nd, physics%h, counts=physics%laws%attracts .or. physics%laws%yields)
    w = 1
    do while (w <= view%list%n_watched())
      p = view%list%watched_place(w)
      call find_points(view, decomposition, p, work, points)
      call carry_memory(points, p, view%list)
      do k = 1, points%n
        if (screens%exist) then
          if (is_screened(screens, decomposition, view, p, points, k)) cycle
        end if
        call write_point(points, k, p, found)
        found%place(found%n + 1) = place_of_point(view, decomposition%nd, p, points, k)
        call add_contact(view, decomposition, physics, found)
      end do
      w = w + view%list%points_of(p)
    end do
    found%overlapping_cores = points%overlapping_cores
    found%points_left_out = points%left_out
  end subroutine find_contacts_of_shapes

  !> Whether a wall without a thickness lies between two bodies at point `k` of pair `p`: between their surfaces there, as far as
  !> these reach into the wall, and between their centres. Thin bodies that lie on each other near a wall have it beside both.
  pure logical function is_screened(screens, decomposition, view, p, points, k) result(screened)
    type(screens_t), intent(in) :: screens
    type(decomposition_t), intent(in) :: decomposition
    type(local_bodies_t), intent(in) :: view
    integer, intent(in) :: p, k
    type(pair_points_t), intent(in) :: points
    !> part of the smaller radius that the bodies are thick there
    real(dp), parameter :: depth = 0.05_dp
    real(dp) :: branch(decomposition%nd), place(decomposition%nd)
    integer :: i, j

    screened = .false.
    call view%find_ends(p, i, j)
    if (j < 0) return
    associate (nd => decomposition%nd)
      branch(:) = (max(points%gap(k), 0.0_dp) + 2.0_dp*depth*min(view%bodies%radius(i), view%bodies%radius(j)))* &
        & points%normal(1:nd, k)
      place(:) = view%bodies%position(:, i) + points%point(1:nd, k) + 0.5_dp*branch
    end associate
    screened = screens%part(decomposition, view, p, place, branch)
    if (.not. screened) return
    branch(:) = view%bodies%position(:, i) - view%bodies%position(:, j)
    if (size(view%list%shift) > 0) call decomposition%period%add_shift(view%list%shift(p), -1, branch)
    screened = screens%part(decomposition, view, p, view%bodies%position(:, i), branch)
  end function is_screened

  !> Write point `k` of pair `p` behind the last contact of the list.
  pure subroutine write_point(points, k, p, found)
    type(pair_points_t), intent(in) :: points
    integer, intent(in) :: k, p
    type(contact_list_t), intent(inout) :: found

    associate (c => found%n + 1, nd => size(found%normal, 1))
      found%source(c) = p + k - 1
      found%gap(c) = points%gap(k)
      found%normal(:, c) = points%normal(1:nd, k)
    end associate
  end subroutine write_point

  !> Where point `k` of pair `p` is: both bodies have it at one place, half-way between their surfaces. What sticks to a boundary
  !> that turns would drift if the boundary had it on its surface, by half the gap or overlap times the angle.
  pure type(contact_place_t) function place_of_point(view, nd, p, points, k) result(place)
    type(local_bodies_t), intent(in) :: view
    integer, intent(in) :: nd, p, k
    type(pair_points_t), intent(in) :: points
    integer :: i, j

    place%arm_i(:) = points%point(:, k)
    call view%find_ends(p, i, j)
    if (j > 0) then
      place%arm_j(:) = points%point(:, k) - points%way
    else
      place%on_wall(1:nd) = view%bodies%position(:, i) + points%point(1:nd, k)
    end if
  end function place_of_point

  !> Whether a pair is no contact: beyond the alert distance, and with nothing to remember.
  pure logical function is_far(list, p, gap, alert)
    type(neighbour_list_t), intent(in) :: list
    integer, intent(in) :: p
    !> [m]
    real(dp), intent(in) :: gap, alert

    is_far = gap > alert
    if (is_far) is_far = .not. remembers(list, p)
  end function is_far

  !> Whether the law of a pair has something to remember: a bond, or a bridge.
  pure logical function remembers(list, p)
    type(neighbour_list_t), intent(in) :: list
    integer, intent(in) :: p

    remembers = list%law_state(p) /= 0
  end function remembers

  !> Add the contact that was written behind the last one of the list, within the alert distance or with something to remember,
  !> if it is one under its law.
  subroutine add_contact(view, decomposition, physics, found)
    type(local_bodies_t), intent(inout) :: view
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics
    !> contact n + 1 has its source, gap and normal, and its place where bodies have shapes
    type(contact_list_t), intent(inout) :: found

    if (physics%laws%varies) then
      call add_with_terms(view, decomposition, physics, found)
    else
      associate (p => found%source(found%n + 1), gap => found%gap(found%n + 1))
        ! where some law has restitution; the law of a contact that is closed is looked up where its terms are packed
        if (physics%laws%returns .and. gap > 0.0_dp) then
          if (is_idle(view, decomposition, physics, found, terms_of(physics%laws, law_of(view, decomposition%boundaries, &
            & physics%laws, p), gap))) return
        end if
      end associate
      call keep_contact(view, found)
    end if
  end subroutine add_contact

  !> The same in a scene where some law has other terms for each pair. Such a law asks for more than the gap: it gives the contact
  !> its terms and springs, and the pair its state.
  subroutine add_with_terms(view, decomposition, physics, found)
    type(local_bodies_t), intent(inout) :: view
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics
    type(contact_list_t), intent(inout) :: found
    type(contact_pair_t) :: pair
    real(dp) :: gap
    integer :: c, p, l

    c = found%n + 1
    p = found%source(c)
    gap = found%gap(c)
    l = law_of(view, decomposition%boundaries, physics%laws, p)
    if (physics%laws%varies_at(l)) then
      pair%first = physics%first
      pair%h = physics%h
      pair%gap = gap
      pair%state = view%list%law_state(p)
      if (physics%laws%of(l)%law%sees_velocity) call find_pair_velocity(view, decomposition%boundaries, p, &
        & place_of(view, found, c, joined=.false.), found%normal(:, c), pair)
      call evaluate_pair(view, physics%laws%of(l)%law, p, pair)
      call view%list%set_law_state(p, pair%state)
    else
      pair%terms = terms_of(physics%laws, l, gap)
    end if
    if (is_far(view%list, p, gap, decomposition%alert_distance())) return
    if (gap > 0.0_dp) then
      if (is_idle(view, decomposition, physics, found, pair%terms)) return
    end if
    call keep_contact(view, found)
    if (is_stretched(physics%laws%of(l)%law, pair, decomposition%alert_distance())) &
      & found%stretched_bonds = found%stretched_bonds + 1
    found%terms(c) = pair%terms
    if (size(found%spring) > 0) found%spring(c) = pair%spring
  end subroutine add_with_terms

  !> Whether an intact bond has a gap beyond those at which pairs are bonded, and beyond half of the alert distance: errors of
  !> solves have added up, and a bond is lost where its pair leaves the range of contacts.
  pure logical function is_stretched(law, pair, alert)
    class(contact_law_t), intent(in) :: law
    type(contact_pair_t), intent(in) :: pair
    !> [m]
    real(dp), intent(in) :: alert

    is_stretched = law%breaks .and. pair%state /= 0 .and. pair%gap > max(law%range, 0.5_dp*alert)
  end function is_stretched

  !> Whether an open contact, written behind the last one of the list, does nothing in this step under its terms. Restitution acts
  !> at the moment of touching (Moreau 1988). A step has the impacts of the half step before its middle, whose contacts are closed,
  !> and of the half step after it, so that impacts are early as often as late. Impacts of bodies with shapes are late, because a
  !> look ahead would stop these bodies at joints of what they slide over.
  pure logical function is_idle(view, decomposition, physics, found, terms)
    type(local_bodies_t), intent(in) :: view
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics
    type(contact_list_t), intent(in) :: found
    type(contact_terms_t), intent(in) :: terms
    integer :: i, j

    is_idle = sends_back(terms)
    if (.not. is_idle) return
    associate (c => found%n + 1)
      if (decomposition%no > 0) then
        call view%find_ends(found%source(c), i, j)
        if (view%bodies%shape(i) > 0) return
        if (j > 0) then
          if (view%bodies%shape(j) > 0) return
        end if
      end if
      is_idle = found%gap(c) + 0.5_dp*physics%h*round_normal_velocity(view, decomposition%boundaries, found%source(c), &
        & found%normal(:, c)) > 0.0_dp
    end associate
  end function is_idle

  !> Take the contact that was written behind the last one into the list.
  pure subroutine keep_contact(view, found)
    type(local_bodies_t), intent(in) :: view
    type(contact_list_t), intent(inout) :: found

    found%n = found%n + 1
    found%boundary(found%n) = boundary_of(view, found%source(found%n))
  end subroutine keep_contact

  !> Where contact `f` of those found is.
  pure type(contact_place_t) function place_of(view, found, f, joined) result(place)
    type(local_bodies_t), intent(in) :: view
    type(contact_list_t), intent(in) :: found
    integer, intent(in) :: f
    !> its bodies are joined
    logical, intent(in) :: joined

    if (size(found%place) > 0) then
      place = found%place(f)
    else
      place = round_place(view, found%source(f), found%gap(f), found%normal(:, f), joined)
    end if
  end function place_of

end module gravier_narrow_phase
