!> Impulses kept from one step to the next, so that a solve starts from those of contacts that persist. They stay with the
!> pairs of the neighbour lists, as the states of pairs do; gravier_memory_carrying brings both to lists that are made anew.
module gravier_impulse_memory
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_sorting, only: argsort_rows, first_not_before
  use gravier_contact_kernels, only: kernels_t, lanes, n_blocks, project_tangential, tangential_vectors, &
    & moment_vectors, project_moments
  use gravier_contact_problem, only: contact_problem_t
  use gravier_neighbour_list, only: pair_memory_t
  use gravier_halo, only: local_bodies_t
  implicit none
  private
  public :: memory_of, impulse_entries, keep_impulses, recall_impulses, list_impulses, match_impulses, pair_record

  !> the words of a record of list_impulses, in their order: the version of checkpoints, which changes with them
  character(len=*), parameter :: pair_record = "candidate antagonist impulse elongation states"

contains

  !> What pairs have to keep.
  pure type(pair_memory_t) function memory_of(kernels, warm_start, remembers, may_sleep, has_points) result(memory)
    type(kernels_t), intent(in) :: kernels
    !> solves start from the impulses of the last step; some law remembers; bodies may sleep; pairs may touch in several points
    logical, intent(in) :: warm_start, remembers, may_sleep, has_points

    memory%n_impulse = merge(impulse_entries(kernels), 0, warm_start)
    memory%law_row = merge(1, 0, remembers)
    if (may_sleep) memory%touch_row = memory%law_row + 1
    if (has_points) memory%key_row = memory%n_states() + 1
    if (kernels%row%compliance_t > 0) memory%n_spring = merge(1, 3, kernels%nd == 2)
  end function memory_of

  !> Entries of an impulse kept with a pair: (n), (n, t), or n and the tangential vector; with rolling also the moment of disks
  !> over R*, or its vector.
  pure integer function impulse_entries(kernels) result(n)
    type(kernels_t), intent(in) :: kernels

    n = kernels%nc
    if (kernels%nf == 3) n = merge(7, 4, kernels%rolling_row > 0)
  end function impulse_entries

  !> Keep the impulses of a solved problem with the pairs of the lists, whose memory has them. Between bodies that sleep they stay.
  subroutine keep_impulses(problem, views)
    type(contact_problem_t), intent(in) :: problem
    type(local_bodies_t), intent(inout) :: views(:)
    integer :: s, c, q, g
    real(dp) :: vector(lanes, 3), moment(lanes, 3)
    logical :: rolls

    rolls = problem%has_rolling()
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s), list => views(s)%list)
        call list%forget_impulses()
        do g = 1, n_blocks(sub%n_contacts)
          if (problem%nf == 3) call tangential_vectors(sub%hot(:, :, g), sub%impulse(:, :, g), vector)
          if (problem%nf == 3 .and. rolls) call moment_vectors(sub%hot(:, :, g), sub%impulse(:, :, g), moment)
          do q = 1, lanes
            ! without a normal impulse the tangential one is a zero of either sign, which no checkpoint tells apart; contacts of
            ! no effect have none
            if (.not. sub%impulse(q, 1, g) > 0.0_dp) cycle
            c = (g - 1)*lanes + q
            if (problem%nf < 3) then
              list%impulse(:, sub%source(c)) = sub%impulse(q, :, g)
            else
              list%impulse(1, sub%source(c)) = sub%impulse(q, 1, g)
              list%impulse(2:4, sub%source(c)) = vector(q, :)
              if (rolls) list%impulse(5:7, sub%source(c)) = moment(q, :)
            end if
          end do
        end do
      end associate
    end do
  end subroutine keep_impulses

  !> Start the contacts from the impulses kept; a tangential vector is projected on the tangent plane of now; a
  !> moment keeps its vector. Contacts that pressed nothing start as they were packed.
  subroutine recall_impulses(views, problem)
    type(local_bodies_t), intent(in) :: views(:)
    type(contact_problem_t), intent(inout) :: problem
    integer :: s, c, q, g
    real(dp) :: vector(lanes, 3), moment(lanes, 3)
    logical :: rolls

    rolls = problem%has_rolling()
    vector(:, :) = 0.0_dp
    moment(:, :) = 0.0_dp
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s), list => views(s)%list)
        do g = 1, n_blocks(sub%n_contacts)
          do q = 1, min(lanes, sub%n_contacts - (g - 1)*lanes)
            c = (g - 1)*lanes + q
            associate (kept => list%impulse(:, sub%source(c)))
              if (problem%nf == 3) vector(q, :) = kept(2:4)
              if (problem%nf == 3 .and. rolls) moment(q, :) = kept(5:7)
              if (.not. kept(1) > 0.0_dp) cycle
              sub%impulse(q, 1, g) = kept(1)
              if (problem%nf < 3) sub%impulse(q, 2:, g) = kept(2:)
            end associate
          end do
          ! contacts of no effect have no normal, and no frame
          if (problem%nf == 3) call project_tangential(sub%hot(:, :, g), vector, sub%impulse(:, :, g))
          if (problem%nf == 3 .and. rolls) call project_moments(sub%hot(:, :, g), moment, sub%impulse(:, :, g))
          sub%impulse(q:, :, g) = 0.0_dp
        end do
      end associate
    end do
  end subroutine recall_impulses

  !> Identifiers of candidate and antagonist, the impulse, the elongation of a spring and the states, for pairs of a list; the
  !> antagonist of a boundary is minus its number.
  subroutine list_impulses(view, lead, pairs, records)
    type(local_bodies_t), intent(in) :: view
    !> words left free before those of a record
    integer, intent(in) :: lead
    !> places of the pairs in the list
    integer, intent(in), contiguous :: pairs(:)
    !> (lead + 2 + words of the memory, pairs)
    integer(i8), allocatable, intent(out) :: records(:, :)
    integer :: p, e, n

    associate (list => view%list)
      allocate (records(lead + 2 + list%memory%words(), size(pairs)))
      do n = 1, size(pairs)
        p = pairs(n)
        records(lead + 1, n) = view%bodies%id(list%candidate(p))
        records(lead + 2, n) = antagonist_id(view, p)
        do e = 1, size(list%impulse, 1)
          records(lead + 2 + e, n) = transfer(list%impulse(e, p), 0_i8)
        end do
        do e = 1, size(list%spring, 1)
          records(lead + 2 + size(list%impulse, 1) + e, n) = transfer(list%spring(e, p), 0_i8)
        end do
        records(lead + 3 + list%memory%words() - list%memory%n_states():, n) = list%state(:, p)
      end do
    end associate
  end subroutine list_impulses

  pure integer(i8) function antagonist_id(view, p) result(id)
    type(local_bodies_t), intent(in) :: view
    integer, intent(in) :: p
    integer :: i, j

    call view%find_ends(p, i, j)
    id = j
    if (j > 0) id = view%bodies%id(j)
  end function antagonist_id

  !> Give impulses and states to the pairs of a list that have the same bodies; what the records do not have stays.
  subroutine match_impulses(records, kept, view)
    !> (2 + words of `kept`, n): candidate, antagonist, impulse, elongation, states
    integer(i8), intent(in), contiguous :: records(:, :)
    type(pair_memory_t), intent(in) :: kept
    type(local_bodies_t), intent(inout) :: view
    integer(i8), allocatable :: keys(:, :)
    integer, allocatable :: order(:)
    integer :: p, k, e, repeated

    allocate (keys(2, size(records, 2)), order(size(records, 2)))
    keys(:, :) = records(1:2, :)
    call argsort_rows(keys, order)
    associate (list => view%list)
      repeated = 0
      do p = 1, list%n
        ! the points of a pair get its records in their order
        if (p > 1) repeated = merge(repeated + 1, 0, list%candidate(p) == list%candidate(max(p - 1, 1)) .and. &
          & list%antagonist(p) == list%antagonist(max(p - 1, 1)))
        k = find_pair(keys, order, view%bodies%id(list%candidate(p)), antagonist_id(view, p), repeated)
        if (k == 0) cycle
        do e = 1, min(list%memory%n_impulse, kept%n_impulse)
          list%impulse(e, p) = transfer(records(2 + e, k), 0.0_dp)
        end do
        do e = 1, min(list%memory%n_spring, kept%n_spring)
          list%spring(e, p) = transfer(records(2 + kept%n_impulse + e, k), 0.0_dp)
        end do
        call take_state(list%memory%law_row, kept%law_row)
        call take_state(list%memory%touch_row, kept%touch_row)
        call take_state(list%memory%key_row, kept%key_row)
        if (list%memory%key_row > 0) call take_state(list%memory%key_row + 1, kept%key_row + 1)
      end do
    end associate

  contains

    subroutine take_state(row, row_kept)
      integer, intent(in) :: row, row_kept

      if (row > 0 .and. row_kept > 0) view%list%state(row, p) = narrow(records(2 + kept%words() - kept%n_states() + row_kept, k))
    end subroutine take_state

  end subroutine match_impulses

  !> Place of a record of a pair among keys that `order` sorts, or 0: of the first one, or of that `repeated` behind it.
  pure integer function find_pair(keys, order, candidate, antagonist, repeated) result(place)
    integer(i8), intent(in), contiguous :: keys(:, :)
    integer, intent(in), contiguous :: order(:)
    integer(i8), intent(in) :: candidate, antagonist
    integer, intent(in) :: repeated
    integer(i8) :: key(2)
    integer :: low

    key(1) = candidate
    key(2) = antagonist
    low = first_not_before(keys, order, key)
    place = 0
    if (low + repeated > size(order)) return
    if (keys(1, order(low + repeated)) == candidate .and. keys(2, order(low + repeated)) == antagonist) &
      & place = order(low + repeated)
  end function find_pair

end module gravier_impulse_memory
