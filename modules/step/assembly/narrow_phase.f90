!> The contacts of a subdomain: those of its near pairs that are within the alert distance, with gaps, normals and the terms of
!> their laws.
module gravier_narrow_phase
  use gravier_kinds, only: dp
  use gravier_periodic, only: period_t, shift_of_code
  use gravier_boundary, only: boundary_t
  use gravier_contact_law, only: contact_pair_t, contact_terms_t
  use gravier_decomposition, only: decomposition_t
  use gravier_halo, only: local_bodies_t
  use gravier_pair_laws, only: law_of, terms_of, evaluate_pair
  use gravier_physics, only: physics_t
  implicit none
  private
  public :: contact_list_t, find_contacts

  !> Gaps and normals of the pairs of a list that are contacts.
  type :: contact_list_t
    integer :: n = 0
    !> those that do not sleep: the first ones, in whole blocks where others follow
    integer :: n_awake = 0
    !> place in the list (n)
    integer, allocatable :: source(:)
    !> (n) [m], (nd, n)
    real(dp), allocatable :: gap(:), normal(:, :)
    !> where some law has other terms for each pair (n)
    type(contact_terms_t), allocatable :: terms(:)
  end type contact_list_t

contains

  !> Narrow phase: gaps and normals of the near pairs, of which those within the alert distance are contacts. A law with
  !> restitution acts from the moment of touching on (Moreau 1988), so that its contacts have no positive gap.
  subroutine find_contacts(view, decomposition, physics, found)
    type(local_bodies_t), intent(inout) :: view
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics
    type(contact_list_t), intent(inout) :: found
    integer :: p, i, j, nd, row
    real(dp) :: branch(decomposition%nd), normal(decomposition%nd), distance, gap, alert
    type(contact_terms_t) :: terms

    nd = decomposition%nd
    if (allocated(found%source)) deallocate (found%source, found%gap, found%normal, found%terms)
    allocate (found%source(view%list%n), found%gap(view%list%n), found%normal(nd, view%list%n))
    allocate (found%terms(merge(view%list%n, 0, physics%laws%varies)))
    found%n = 0
    row = view%list%memory%law_row
    alert = decomposition%rule%alert_distance
    do p = 1, view%list%n
      i = view%list%candidate(p)
      j = view%list%antagonist(p)
      if (j > 0) then
        branch(:) = view%bodies%position(:, i) - view%bodies%position(:, j)
        if (size(view%list%shift) > 0) call shift_back(decomposition%period, view%list%shift(p), branch)
        distance = norm2(branch)
        gap = distance - view%bodies%radius(i) - view%bodies%radius(j)
        if (is_far()) cycle
        if (distance > 0.0_dp) then
          normal(:) = branch/distance
        else
          ! coincident centres have no normal: take the vertical, so that the law can part them
          normal(:) = 0.0_dp
          normal(nd) = 1.0_dp
        end if
      else
        if (.not. decomposition%boundaries(-j)%present) cycle
        call decomposition%boundaries(-j)%locate(view%bodies%position(:, i), distance, normal)
        gap = distance - view%bodies%radius(i)
        if (is_far()) cycle
      end if
      call find_terms()
      if (is_far()) cycle
      if (gap > 0.0_dp .and. (terms%restitution > 0.0_dp .or. terms%tangential_restitution > 0.0_dp)) cycle
      found%n = found%n + 1
      found%source(found%n) = p
      found%gap(found%n) = gap
      found%normal(:, found%n) = normal
      if (size(found%terms) > 0) found%terms(found%n) = terms
    end do
    found%n_awake = found%n

  contains

    !> Whether the pair is no contact: beyond the alert distance, and with nothing to remember.
    logical function is_far()
      is_far = gap > alert
      if (is_far .and. row > 0) is_far = view%list%state(row, p) == 0
    end function is_far

    subroutine find_terms()
      type(contact_pair_t) :: pair
      integer :: l

      l = law_of(view, decomposition%boundaries, physics%laws, p)
      if (.not. physics%laws%varies_at(l)) then
        terms = terms_of(physics%laws, l, gap)
        return
      end if
      pair%first = physics%first
      pair%gap = gap
      if (row > 0) pair%state = view%list%state(row, p)
      call evaluate_pair(view, decomposition%boundaries, physics%laws, l, p, normal, pair)
      if (row > 0) view%list%state(row, p) = pair%state
      terms = pair%terms
    end subroutine find_terms

  end subroutine find_contacts

  !> Take the shift of the antagonist into account in the way from it to the candidate.
  pure subroutine shift_back(period, code, branch)
    type(period_t), intent(in) :: period
    integer, intent(in) :: code
    !> (nd) [m]
    real(dp), intent(inout) :: branch(:)
    integer :: shift(3), d

    shift(:) = shift_of_code(code)
    do d = 1, size(branch)
      branch(d) = branch(d) - shift(d)*period%length(d)
    end do
  end subroutine shift_back

end module gravier_narrow_phase
