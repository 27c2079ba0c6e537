!> From the solved problem of a step back to the grains: velocities, and displacements of projections, to their owners.
module gravier_velocity_return
  use gravier_kinds, only: dp, i8
  use gravier_orientation, only: turn_orientation, orientation_matrix
  use gravier_sparse_exchange, only: sparse_exchange
  use gravier_contact_problem, only: contact_problem_t
  use gravier_body_store, only: body_set_t
  use gravier_decomposition, only: decomposition_t
  use gravier_physics, only: physics_t
  use gravier_cell_drive, only: carry_grains
  implicit none
  private
  public :: take_velocities, take_displacements, find_senders

contains

  !> Velocities at the end of the step: those of the solved problem (v_global) for grains in contact, free ones for
  !> the others. What sleeps stands still.
  !> A shared grain whose owner has no contact on it gets its velocity from its first sharer. Grains glued to
  !> a boundary are left. In a cell that moves grains are carried along, and v_global is that of grains carried along. Collective.
  subroutine take_velocities(decomposition, physics, problem)
    type(decomposition_t), intent(inout) :: decomposition
    type(physics_t), intent(in) :: physics
    type(contact_problem_t), intent(in) :: problem
    integer :: s, k, r

    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        do r = 1, owned%awake%n
          do k = owned%awake%first(r), owned%awake%last(r)
            if (owned%glued(k) == 0 .and. .not. owned%sleeps(k)) call physics%accelerate(decomposition%figures, owned, k, &
              & owned%velocity(:, k))
          end do
        end do
      end associate
    end do
    if (problem%cell_moves()) call carry_grains(decomposition, problem%cell)
    call bring_home(decomposition, problem, displace=.false.)
  end subroutine take_velocities

  !> Move the grains in contact by what v_global holds in the place of velocities [m], and turn those with shapes [rad], which takes
  !> and gives no energy. Collective.
  subroutine take_displacements(decomposition, problem)
    type(decomposition_t), intent(inout) :: decomposition
    type(contact_problem_t), intent(in) :: problem
    call bring_home(decomposition, problem, displace=.true.)
  end subroutine take_displacements

  !> Bring v_global of the grains in contact to their owners: in this subdomain by their places, in others by
  !> records (owner, grain, velocity). Collective.
  subroutine bring_home(decomposition, problem, displace)
    type(decomposition_t), intent(inout) :: decomposition
    type(contact_problem_t), intent(in) :: problem
    !> they are displacements, not velocities
    logical, intent(in) :: displace
    integer(i8), allocatable :: records(:, :), received(:, :)
    integer, allocatable :: destination(:)
    real(dp) :: v(problem%nv)
    integer :: s, b, k, d, h, place

    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do b = 1, sub%n_grains
          if (sub%place(b) > 0) call put(s, sub%place(b), sub%v_global(:, b))
        end do
      end associate
    end do
    call list_returns(decomposition, problem, records, destination)
    call sparse_exchange(decomposition%comm, records, destination, received)
    do k = 1, size(received, 2)
      call decomposition%find_owned(received(1:2, k), h, place)
      do d = 1, size(v)
        v(d) = transfer(received(2 + d, k), 0.0_dp)
      end do
      call put(h, place, v)
    end do

  contains

    subroutine put(h, place, v)
      !> subdomain of this rank, and place there
      integer, intent(in) :: h, place
      !> (nv)
      real(dp), intent(in) :: v(:)

      associate (owned => decomposition%owned(h))
        if (displace) then
          owned%position(:, place) = owned%position(:, place) + v(1:decomposition%nd)
          if (owned%no > 0) call turn_body(owned, place, v(decomposition%nd + 1:))
        else
          owned%velocity(1:size(v), place) = v
        end if
      end associate
    end subroutine put

  end subroutine bring_home

  !> Turn body `k` at once. In space its spin turns with it: in the axes of the body, and so in its energy, it stays what it is.
  pure subroutine turn_body(bodies, k, angle)
    type(body_set_t), intent(inout) :: bodies
    integer, intent(in) :: k
    !> (1 or 3) about the axes [rad]
    real(dp), intent(in) :: angle(:)
    real(dp) :: axes(3, 3), spin(3)
    integer :: d

    if (bodies%no < 4) then
      call turn_orientation(bodies%orientation(:, k), angle, 1.0_dp)
      return
    end if
    call orientation_matrix(bodies%orientation(:, k), axes)
    do d = 1, 3
      spin(d) = sum(axes(:, d)*bodies%velocity(4:6, k))
    end do
    call turn_orientation(bodies%orientation(:, k), angle, 1.0_dp)
    if (bodies%shape(k) == 0) return
    call orientation_matrix(bodies%orientation(:, k), axes)
    do d = 1, 3
      bodies%velocity(3 + d, k) = sum(axes(d, :)*spin)
    end do
  end subroutine turn_body

  !> Records (owner, grain, velocity) of the grains in contact that are owned by none of their sharers, from the first of
  !> them.
  subroutine list_returns(decomposition, problem, records, destination)
    type(decomposition_t), intent(in) :: decomposition
    type(contact_problem_t), intent(in) :: problem
    integer(i8), allocatable, intent(out) :: records(:, :)
    integer, allocatable, intent(out) :: destination(:)
    logical, allocatable :: sends(:)
    integer :: s, b, d, n, round

    do round = 1, 2
      n = 0
      do s = 1, size(problem%sub)
        associate (sub => problem%sub(s))
          call find_senders(problem, s, sends)
          do b = 1, sub%n_grains
            if (.not. sends(b)) cycle
            n = n + 1
            if (round == 1) cycle
            destination(n) = decomposition%comm%rank_of(sub%owner(b), decomposition%n_subdomains)
            records(1, n) = sub%owner(b)
            records(2, n) = sub%id(b)
            do d = 1, problem%nv
              records(2 + d, n) = transfer(sub%v_global(d, b), 0_i8)
            end do
          end do
        end associate
      end do
      if (round == 1) allocate (records(2 + problem%nv, n), destination(n))
    end do
  end subroutine list_returns

  !> Which grains of subdomain `s` of this rank are owned by none of their sharers, so that this one, the first of them, tells the
  !> owner what becomes of them.
  subroutine find_senders(problem, s, sends)
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: s
    !> (n_bodies)
    logical, allocatable, intent(out) :: sends(:)
    integer :: b, k

    associate (sub => problem%sub(s), part => problem%shared%part(s))
      allocate (sends(sub%n_bodies), source=.false.)
      do b = 1, sub%n_grains
        sends(b) = sub%place(b) == 0
      end do
      do k = 1, part%n_shared
        b = part%body(k)
        if (b > sub%n_grains) cycle
        sends(b) = part%copy_rank(k) == 1 .and. .not. any(part%sharer(part%first(k):part%first(k + 1) - 1) == sub%owner(b))
      end do
    end associate
  end subroutine find_senders

end module gravier_velocity_return
