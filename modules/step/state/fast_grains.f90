!> Grains whose way in a step is so long that they may go past others, or past a boundary, without a contact.
module gravier_fast_grains
  use gravier_kinds, only: dp, i8
  use gravier_periodic, only: gradient_times
  use gravier_facet, only: near_facets_t, find_facet_normal
  use gravier_stretches, only: stretches_t
  use gravier_body_store, only: body_set_t
  use gravier_boundary, only: boundary_t
  use gravier_decomposition, only: decomposition_t
  use gravier_physics, only: physics_t
  implicit none
  private
  public :: count_fast

  !> part of half of a grain's thickness that a boundary has to go for its way to count
  real(dp), parameter :: least_way = 0.5_dp

contains

  !> Count the grains that move by more than half of their thickness in a step, a ball by more than its radius, beside a cell that
  !> moves, and bodies whose ends go so far beyond their middle by turning: they may pass through others unseen. Grains that come so
  !> much nearer to a boundary which itself goes half as far are among them: it may pass through them. Loads count from the next
  !> step on, of grains and of boundaries: contacts may hold them. Collective.
  integer(i8) function count_fast(decomposition, physics) result(fast)
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics
    type(near_facets_t) :: near
    integer(i8) :: counts(1)
    real(dp) :: gradient(3, 3), centre(3), v(decomposition%nd), place(decomposition%nd), carried(decomposition%nd), half
    type(stretches_t) :: looked_at
    integer, allocatable :: quick(:)
    integer :: s, k, b, r, nd
    logical :: is_fast

    nd = decomposition%nd
    gradient(:, :) = 0.0_dp
    if (decomposition%period%moves) gradient(:, :) = decomposition%period%gradient()
    centre(:) = decomposition%period%centre()
    call find_quick(decomposition, physics%h, quick)
    counts(:) = 0
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        looked_at = owned%awake
        ! a boundary may pass through those that sleep, too
        if (size(quick) > 0) call looked_at%take_all(owned%n)
        do r = 1, looked_at%n
          do k = looked_at%first(r), looked_at%last(r)
            v(:) = owned%velocity(1:nd, k)
            if (decomposition%period%moves) then
              place(:) = owned%position(:, k) - centre(1:nd)
              carried(:) = gradient_times(gradient, place)
              v(:) = v - carried
            end if
            half = decomposition%figures%half_thickness_of(owned, k)
            is_fast = physics%h**2*max(sum(v**2), (owned%radius(k) - half)**2*sum(owned%velocity(nd + 1:, k)**2)) > half**2
            do b = 1, size(quick)
              if (is_fast .or. owned%glued(k) > 0) exit
              is_fast = may_be_passed(owned, k, half, decomposition%boundaries(quick(b)), physics%h, near)
            end do
            if (is_fast) counts(1) = counts(1) + 1
          end do
        end do
      end associate
    end do
    call decomposition%comm%sum_counts(counts)
    fast = counts(1)
  end function count_fast

  !> The boundaries that may go far enough in a step for the thinnest grain of a rank, wherever it is among them.
  pure subroutine find_quick(decomposition, h, quick)
    type(decomposition_t), intent(in) :: decomposition
    !> [s]
    real(dp), intent(in) :: h
    integer, allocatable, intent(out) :: quick(:)
    real(dp) :: least, low(3), high(3), speed
    integer :: found(size(decomposition%boundaries)), b, n

    n = 0
    least = 0.0_dp
    do b = 1, size(found)
      if (.not. moves(decomposition%boundaries(b))) cycle
      if (.not. least > 0.0_dp) call find_extent(decomposition, least, low, high)
      if (.not. least < huge(1.0_dp)) exit
      associate (boundary => decomposition%boundaries(b))
        speed = max(norm2(merge(0.0_dp, boundary%velocity, boundary%free)), norm2(boundary%last_velocity)) + &
          & max(norm2(boundary%spin), norm2(boundary%last_spin))*norm2(max(abs(low - boundary%pivot), abs(high - boundary%pivot)))
        if (h*speed <= least_way*least .and. .not. any(boundary%period > 0.0_dp .and. boundary%drive%turns())) cycle
      end associate
      n = n + 1
      found(n) = b
    end do
    quick = found(1:n)
  end subroutine find_quick

  pure logical function moves(boundary)
    type(boundary_t), intent(in) :: boundary

    moves = boundary%touches()
    if (moves) moves = norm2(boundary%velocity) + norm2(boundary%last_velocity) + norm2(boundary%spin) + &
      & norm2(boundary%last_spin) > 0.0_dp
  end function moves

  !> Half of the thickness of the thinnest grain of a rank, huge where it has none, and the box of the centres of all [m].
  pure subroutine find_extent(decomposition, least, low, high)
    type(decomposition_t), intent(in) :: decomposition
    real(dp), intent(out) :: least, low(3), high(3)
    integer :: s, k, d

    least = huge(1.0_dp)
    low(:) = 0.0_dp
    high(:) = 0.0_dp
    low(1:decomposition%nd) = huge(1.0_dp)
    high(1:decomposition%nd) = -huge(1.0_dp)
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        do k = 1, owned%n
          least = min(least, decomposition%figures%half_thickness_of(owned, k))
          do d = 1, decomposition%nd
            low(d) = min(low(d), owned%position(d, k))
            high(d) = max(high(d), owned%position(d, k))
          end do
        end do
      end associate
    end do
  end subroutine find_extent

  !> Whether a boundary that goes far comes nearer to a grain in a step than half of its thickness, and reaches it.
  logical function may_be_passed(bodies, k, half, boundary, h, near) result(passed)
    type(body_set_t), intent(in) :: bodies
    integer, intent(in) :: k
    !> of the thickness of the grain [m]
    real(dp), intent(in) :: half
    type(boundary_t), intent(in) :: boundary
    !> [s]
    real(dp), intent(in) :: h
    type(near_facets_t), intent(inout) :: near
    real(dp) :: velocity(bodies%nd, 2), normal(bodies%nd), distance, facing(3), way
    integer :: f

    passed = .false.
    call boundary%last_velocity_at(bodies%position(:, k), velocity(:, 1))
    call boundary%velocity_at(bodies%position(:, k), velocity(:, 2))
    velocity(:, 2) = merge(velocity(:, 1), velocity(:, 2), boundary%free(1:bodies%nd))
    way = h*max(norm2(velocity(:, 1)), norm2(velocity(:, 2)))
    if (.not. way > least_way*half) return
    way = way + h*norm2(bodies%velocity(1:bodies%nd, k))
    if (.not. way > half) return
    if (boundary%is_faceted()) then
      call boundary%find_facets(bodies%position(:, k), bodies%radius(k) + way, near)
      do f = 1, near%n
        if (passed) return
        call find_facet_normal(near%corner(:, :, f), facing)
        normal(:) = facing(1:bodies%nd)
        passed = comes_near()
      end do
    else
      call boundary%locate(bodies%position(:, k), distance, normal)
      if (abs(distance) > bodies%radius(k) + way) return
      passed = comes_near()
    end if

  contains

    !> Whether both come nearer along the normal by more than `half`, and the boundary goes more than its part of it.
    pure logical function comes_near()
      real(dp) :: own, of_boundary
      integer :: e

      comes_near = .false.
      own = sum(normal*bodies%velocity(1:bodies%nd, k))
      do e = 1, 2
        of_boundary = sum(normal*velocity(:, e))
        comes_near = comes_near .or. (h*abs(of_boundary) > least_way*half .and. h*abs(of_boundary - own) > half)
      end do
    end function comes_near

  end function may_be_passed

end module gravier_fast_grains
