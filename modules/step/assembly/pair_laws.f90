!> The laws of the pairs of a subdomain: which one is theirs, its terms over a step, what the pair remembers of it.
module gravier_pair_laws
  use gravier_kinds, only: dp
  use gravier_boundary, only: boundary_t
  use gravier_contact_law, only: contact_pair_t
  use gravier_law_set, only: law_set_t
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  use gravier_neighbourhood, only: neighbourhood_t, neighbourhoods_t
  implicit none
  private
  public :: boundary_of, law_of, evaluate_pair, conclude_pairs

contains

  !> Number of the boundary that takes part in pair `p`, by itself or by a grain glued to it; 0 between free grains.
  pure integer function boundary_of(view, p) result(b)
    type(neighbourhood_t), intent(in) :: view
    integer, intent(in) :: p

    if (view%list%antagonist(p) < 0) then
      b = -view%list%antagonist(p)
    else
      b = max(view%bodies%glued(view%list%candidate(p)), view%bodies%glued(view%list%antagonist(p)))
    end if
  end function boundary_of

  !> Place of the law of pair `p` among the laws of the scene, 0 where the scene's values hold.
  pure integer function law_of(view, boundaries, laws, p) result(l)
    type(neighbourhood_t), intent(in) :: view
    type(boundary_t), intent(in) :: boundaries(:)
    type(law_set_t), intent(in) :: laws
    integer, intent(in) :: p

    l = 0
    if (laws%n == 0) return
    l = laws%number_of(material_of(view, boundaries, view%list%candidate(p)), &
      & material_of(view, boundaries, view%list%antagonist(p)))
  end function law_of

  !> Number of the material of grain `k` of a view, or of boundary -k. Grains glued to a boundary that has one are of its material.
  pure integer function material_of(view, boundaries, k) result(material)
    type(neighbourhood_t), intent(in) :: view
    type(boundary_t), intent(in) :: boundaries(:)
    integer, intent(in) :: k
    integer :: b

    if (k < 0) then
      material = boundaries(-k)%material
      return
    end if
    material = view%bodies%material(k)
    b = view%bodies%glued(k)
    if (b == 0) return
    if (boundaries(b)%material > 0) material = boundaries(b)%material
  end function material_of

  !> The terms of pair `p` over a step under law `l`, and its state.
  pure subroutine evaluate_pair(view, boundaries, laws, l, p, normal, pair)
    type(neighbourhood_t), intent(in) :: view
    type(boundary_t), intent(in) :: boundaries(:)
    type(law_set_t), intent(in) :: laws
    integer, intent(in) :: l, p
    !> (nd) from the antagonist to the candidate
    real(dp), intent(in) :: normal(:)
    !> with its gap, its state and whether the step is the first
    type(contact_pair_t), intent(inout) :: pair
    real(dp) :: v(size(normal)), w(size(normal)), arm(size(normal))
    integer :: i, j

    i = view%list%candidate(p)
    j = view%list%antagonist(p)
    pair%radius = view%bodies%radius(i)
    arm(:) = -view%bodies%radius(i)*normal
    call find_surface_velocity(view, boundaries, i, arm, v)
    if (j > 0) then
      pair%radius = sqrt(view%bodies%radius(i)*view%bodies%radius(j))
      arm(:) = view%bodies%radius(j)*normal
      call find_surface_velocity(view, boundaries, j, arm, w)
    else
      arm(:) = view%bodies%position(:, i) - (view%bodies%radius(i) + pair%gap)*normal
      call boundaries(-j)%last_velocity_at(arm, w)
    end if
    v(:) = v - w
    pair%normal_velocity = sum(v*normal)
    pair%slip = norm2(v - pair%normal_velocity*normal)
    pair%terms%play = max(pair%gap, 0.0_dp)
    associate (law => laws%of(l)%law)
      pair%terms%rolling_friction = law%largest%rolling_friction
      pair%terms%pivoting_friction = law%largest%pivoting_friction
      call law%evaluate(pair)
    end associate
  end subroutine evaluate_pair

  !> Velocity of grain `k` at the start of the step, at the point of its surface that `arm` leads to from its centre.
  pure subroutine find_surface_velocity(view, boundaries, k, arm, v)
    type(neighbourhood_t), intent(in) :: view
    type(boundary_t), intent(in) :: boundaries(:)
    integer, intent(in) :: k
    !> (nd) [m]
    real(dp), intent(in) :: arm(:)
    !> (nd) [m/s]
    real(dp), intent(out) :: v(:)
    real(dp) :: point(size(arm))
    integer :: nd

    nd = size(arm)
    if (view%bodies%glued(k) > 0) then
      point(:) = view%bodies%position(:, k) + arm
      call boundaries(view%bodies%glued(k))%last_velocity_at(point, v)
      return
    end if
    v(:) = view%bodies%velocity(1:nd, k)
    associate (spin => view%bodies%velocity(nd + 1:, k))
      if (size(spin) == 1) then
        v(1) = v(1) - spin(1)*arm(2)
        v(2) = v(2) + spin(1)*arm(1)
      else if (size(spin) == 3) then
        v(1) = v(1) + spin(2)*arm(3) - spin(3)*arm(2)
        v(2) = v(2) + spin(3)*arm(1) - spin(1)*arm(3)
        v(3) = v(3) + spin(1)*arm(2) - spin(2)*arm(1)
      end if
    end associate
  end subroutine find_surface_velocity

  !> The states of the pairs of a solved problem, whose impulses are those of the solve.
  subroutine conclude_pairs(problem, boundaries, laws, neighbourhoods)
    type(contact_problem_t), intent(in) :: problem
    type(boundary_t), intent(in) :: boundaries(:)
    type(law_set_t), intent(in) :: laws
    type(neighbourhoods_t), intent(inout) :: neighbourhoods
    type(contact_pair_t) :: pair
    integer :: s, c, q, g, l, p

    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s), view => neighbourhoods%view(s))
        do c = 1, sub%n_contacts
          p = sub%source(c)
          l = law_of(view, boundaries, laws, p)
          if (l == 0) cycle
          q = lane_of(c)
          g = block_of(c)
          pair%state = view%list%state(view%list%memory%law_row, p)
          pair%gap = sub%gap(c)
          pair%normal = sub%impulse(q, 1, g)
          pair%tangential = norm2(sub%impulse(q, 2:problem%kernels%nf, g))
          pair%terms%friction = 0.0_dp
          if (problem%kernels%nf > 1) pair%terms%friction = sub%hot(q, problem%kernels%friction_row, g)
          call laws%of(l)%law%conclude(pair)
          view%list%state(view%list%memory%law_row, p) = pair%state
        end do
      end associate
    end do
  end subroutine conclude_pairs

end module gravier_pair_laws
