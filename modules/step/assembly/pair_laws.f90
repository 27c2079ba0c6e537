!> The laws of the pairs of a subdomain: which one is theirs, its terms over a step, what the pair remembers of it.
module gravier_pair_laws
  use gravier_kinds, only: dp
  use gravier_contact_coefficients, only: coefficients_t
  use gravier_boundary, only: boundary_t
  use gravier_contact_law, only: contact_law_t, contact_pair_t, contact_terms_t
  use gravier_law_set, only: law_set_t
  use gravier_material_filter, only: material_of
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  use gravier_cell_response, only: subtract_images
  use gravier_halo, only: local_bodies_t
  use gravier_surface_velocity, only: contact_place_t, find_start_velocity, find_surface_velocity, add_image_velocity
  implicit none
  private
  public :: set_default_laws, boundary_of, law_of, terms_of, find_pair_velocity, evaluate_pair, conclude_pairs, &
    & bonds_at_limit, sends_back

contains

  !> Set the default laws: of pairs of grains, and of each boundary by its own coefficients.
  subroutine set_default_laws(laws, between_grains, boundaries)
    type(law_set_t), intent(inout) :: laws
    type(coefficients_t), intent(in) :: between_grains
    type(boundary_t), intent(in) :: boundaries(:)
    integer :: b

    call laws%set_default(0, between_grains)
    do b = 1, size(boundaries)
      call laws%set_default(b, boundaries(b)%contact)
    end do
  end subroutine set_default_laws

  !> Number of the boundary that takes part in pair `p`, by itself or by a grain glued to it; 0 between free grains.
  pure integer function boundary_of(view, p) result(b)
    type(local_bodies_t), intent(in) :: view
    integer, intent(in) :: p
    integer :: i, j

    call view%find_ends(p, i, j)
    if (j < 0) then
      b = -j
    else
      b = max(view%bodies%glued(i), view%bodies%glued(j))
    end if
  end function boundary_of

  !> Place of the law of pair `p` in the set of laws: that of its materials, or the default law of the boundary that takes part or
  !> of grains.
  pure integer function law_of(view, boundaries, laws, p) result(l)
    type(local_bodies_t), intent(in) :: view
    type(boundary_t), intent(in) :: boundaries(:)
    type(law_set_t), intent(in) :: laws
    integer, intent(in) :: p
    integer :: i, j

    l = 0
    if (laws%n > 0) then
      call view%find_ends(p, i, j)
      l = laws%number_of(material_of(view%bodies, boundaries, i), material_of(view%bodies, boundaries, j))
    end if
    if (l == 0) l = laws%default_of(boundary_of(view, p))
  end function law_of

  !> The terms of a pair over a step under law `l`, which has the same for all its pairs. A set that was given no law knows neither
  !> friction nor restitution.
  pure type(contact_terms_t) function terms_of(laws, l, gap) result(terms)
    type(law_set_t), intent(in) :: laws
    integer, intent(in) :: l
    !> [m]
    real(dp), intent(in) :: gap

    if (allocated(laws%of)) terms = laws%of(l)%terms
    terms%free_gap = max(gap, 0.0_dp)
  end function terms_of

  !> Whether a contact under these terms sends bodies back.
  pure logical function sends_back(terms)
    type(contact_terms_t), intent(in) :: terms

    sends_back = terms%restitution > 0.0_dp .or. terms%tangential_restitution > 0.0_dp
  end function sends_back

  !> Relative velocity of pair `p` at the start of a step, for laws that see it.
  pure subroutine find_pair_velocity(view, boundaries, p, place, normal, pair)
    type(local_bodies_t), intent(in) :: view
    type(boundary_t), intent(in) :: boundaries(:)
    integer, intent(in) :: p
    type(contact_place_t), intent(in) :: place
    !> (nd) from the antagonist to the candidate
    real(dp), intent(in) :: normal(:)
    !> gets its normal velocity and its slip
    type(contact_pair_t), intent(inout) :: pair
    real(dp) :: v(size(normal)), w(size(normal))
    integer :: i, j, nd

    nd = size(normal)
    call view%find_ends(p, i, j)
    call find_surface_velocity(view, boundaries, i, place%arm_i(1:nd), v)
    if (j > 0) then
      call find_surface_velocity(view, boundaries, j, place%arm_j(1:nd), w)
      call add_image_velocity(view, p, w)
    else
      call find_start_velocity(view, boundaries, j, place%on_wall(1:nd), w)
    end if
    v(:) = v - w
    pair%normal_velocity = sum(v*normal)
    pair%slip = norm2(v - pair%normal_velocity*normal)
  end subroutine find_pair_velocity

  !> The terms of pair `p` over a step under a law, and its state.
  pure subroutine evaluate_pair(view, law, p, pair)
    type(local_bodies_t), intent(in) :: view
    class(contact_law_t), intent(in) :: law
    integer, intent(in) :: p
    !> with its gap, its state and whether the step is the first; and its velocity, if the law sees it
    type(contact_pair_t), intent(inout) :: pair
    integer :: i, j

    call view%find_ends(p, i, j)
    pair%radius = view%bodies%radius(i)
    if (j > 0) pair%radius = sqrt(view%bodies%radius(i)*view%bodies%radius(j))
    if (law%yields) call find_reduced(view, i, j, size(view%bodies%position, 1), pair)
    pair%terms%free_gap = max(pair%gap, 0.0_dp)
    pair%terms%rolling_friction = law%largest%rolling_friction
    pair%terms%pivoting_friction = law%largest%pivoting_friction
    call law%evaluate(pair)
  end subroutine evaluate_pair

  !> What springs ask of a pair: radius and mass of one sphere that meets a plane as the two bodies meet each other, and the breadth
  !> of the contact. A boundary is plane and cannot move; a grain that is part of one cannot move either.
  pure subroutine find_reduced(view, i, j, nd, pair)
    type(local_bodies_t), intent(in) :: view
    integer, intent(in) :: i, j, nd
    !> with its radius
    type(contact_pair_t), intent(inout) :: pair
    real(dp) :: inverse

    pair%breadth = merge(1.0_dp, 2.0_dp*pair%radius, nd == 2)
    pair%reduced_radius = view%bodies%radius(i)
    inverse = 0.0_dp
    if (view%bodies%glued(i) == 0) inverse = 1.0_dp/view%bodies%mass(i)
    if (j > 0) then
      pair%reduced_radius = view%bodies%radius(i)*view%bodies%radius(j)/(view%bodies%radius(i) + view%bodies%radius(j))
      if (view%bodies%glued(j) == 0) inverse = inverse + 1.0_dp/view%bodies%mass(j)
    end if
    pair%reduced_mass = 1.0_dp/inverse
  end subroutine find_reduced

  !> The states of the pairs of a solved problem, whose impulses and velocities are those of the solve.
  subroutine conclude_pairs(problem, boundaries, laws, uncertain, in_motion, views, doubtful)
    type(contact_problem_t), intent(in) :: problem
    type(boundary_t), intent(in) :: boundaries(:)
    type(law_set_t), intent(in) :: laws
    !> velocity up to which the solve may be wrong about what a contact does [m/s]
    real(dp), intent(in) :: uncertain
    !> bodies move by more than errors of the solve are compared with
    logical, intent(in) :: in_motion
    type(local_bodies_t), intent(inout) :: views(:)
    !> some bond is at its limit, and the solve is not exact enough to tell whether it breaks
    logical, intent(out) :: doubtful
    real(dp), allocatable :: v(:, :, :)
    type(contact_pair_t) :: pair
    integer :: s, c, q, g, l, p

    doubtful = .false.
    pair%uncertain = uncertain
    pair%in_motion = in_motion
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s), view => views(s), nf => problem%nf)
        if (laws%breaks) call find_slips(problem, s, v)
        do c = 1, sub%n_contacts
          p = sub%source(c)
          l = law_of(view, boundaries, laws, p)
          q = lane_of(c)
          g = block_of(c)
          pair%state = view%list%law_state(p)
          pair%gap = sub%gap(c)
          pair%normal = sub%impulse(q, 1, g)
          pair%tangential = norm2(sub%impulse(q, 2:nf, g))
          if (laws%breaks) then
            pair%parting = v(q, 1, g)
            pair%motion = hypot(max(pair%parting, 0.0_dp), norm2(v(q, 2:nf, g)))
          end if
          call laws%of(l)%law%conclude(pair)
          call view%list%set_law_state(p, pair%state)
          doubtful = doubtful .or. pair%doubtful
        end do
      end associate
    end do
    if (laws%breaks) doubtful = problem%comm%any_true(doubtful)
  end subroutine conclude_pairs

  !> Whether an intact bond is at its limit in a solved problem. Collective.
  logical function bonds_at_limit(problem, boundaries, laws, views) result(are_at_limit)
    type(contact_problem_t), intent(in) :: problem
    type(boundary_t), intent(in) :: boundaries(:)
    type(law_set_t), intent(in) :: laws
    type(local_bodies_t), intent(in) :: views(:)
    type(contact_pair_t) :: pair
    integer :: s, c, q, g, l, p

    are_at_limit = .false.
    ! whatever moves is in doubt
    pair%uncertain = huge(1.0_dp)
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s), view => views(s), nf => problem%nf)
        do c = 1, sub%n_contacts
          p = sub%source(c)
          l = law_of(view, boundaries, laws, p)
          if (.not. laws%of(l)%law%breaks) cycle
          q = lane_of(c)
          g = block_of(c)
          pair%state = view%list%law_state(p)
          pair%normal = sub%impulse(q, 1, g)
          pair%tangential = norm2(sub%impulse(q, 2:nf, g))
          call laws%of(l)%law%conclude(pair)
          are_at_limit = are_at_limit .or. pair%doubtful
        end do
      end associate
    end do
    are_at_limit = problem%comm%any_true(are_at_limit)
  end function bonds_at_limit

  !> Velocities of the contacts of a solved subdomain beside those that their laws ask for where the bodies stay joined.
  subroutine find_slips(problem, s, v)
    type(contact_problem_t), intent(in) :: problem
    !> place of the subdomain among those of this rank
    integer, intent(in) :: s
    !> (lanes, nc, blocks) [m/s]
    real(dp), allocatable, intent(out) :: v(:, :, :)
    integer :: last

    associate (sub => problem%sub(s), row => problem%row)
      allocate (v, mold=sub%impulse)
      call sub%contact_velocity(problem%kernels, sub%v_global, v)
      if (problem%cell_moves()) call subtract_images(problem, s, v)
      v(:, 1, :) = v(:, 1, :) + sub%hot(:, row%shift, :)
      if (row%shift_t == 0) return
      last = problem%nf - 2
      v(:, 2:2 + last, :) = v(:, 2:2 + last, :) + sub%hot(:, row%shift_t:row%shift_t + last, :)
    end associate
  end subroutine find_slips

end module gravier_pair_laws
