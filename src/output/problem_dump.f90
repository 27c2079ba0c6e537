!> The contact problem of a step as a global problem of FCLIB: M V = H r + f, v = H^T V + w, with its solution.
!>
!> Bodies stand in the order of their identifiers, contacts in that of candidate and antagonist, so that the file depends neither
!> on the decomposition nor on the ranks. What moves as prescribed, and the shift of the normal velocities, are in w. A component
!> that cannot move has mass 1 and no entry in H. Contacts without friction have tangential components, too, with mu = 0.
!> Attractions are loads: they are in f, and r has r_n + h F.
module gravier_problem_dump
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_errors, only: error_t
  use gravier_sparse_exchange, only: sparse_exchange
  use gravier_ordered_rows, only: order_rows
  use gravier_contact_kernels, only: contact_jacobian, tangents, lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t, subproblem_t
  use gravier_fclib_file, only: fclib_rows_t, write_fclib_global
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: write_problem

  !> Of a subdomain: places of its bodies in the global problem, from 1 on (n_bodies).
  type :: places_t
    integer(i8), allocatable :: place(:)
  end type places_t

contains

  !> Write the problem of the last step with the impulses found. Collective; errors are the same on all ranks.
  subroutine write_problem(simulation, path, error)
    type(simulation_t), intent(inout) :: simulation
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    type(fclib_rows_t) :: rows
    type(places_t) :: bodies(size(simulation%problem%sub))

    if (allocated(error)) return
    rows%dimension = simulation%problem%kernels%nd
    ! a projection of overlaps has used the velocities for its own
    call simulation%problem%evaluate()
    call order_bodies(simulation%problem, bodies, rows)
    call order_contacts(simulation, bodies, rows)
    call write_fclib_global(simulation%comm, path, rows, error)
  end subroutine write_problem

  !> Number the bodies, and take their masses, loads and velocities. Collective.
  subroutine order_bodies(problem, bodies, rows)
    type(contact_problem_t), intent(in) :: problem
    type(places_t), intent(inout) :: bodies(:)
    type(fclib_rows_t), intent(inout) :: rows
    integer(i8), allocatable :: records(:, :), ordered(:, :), answers(:, :), received(:, :)
    integer, allocatable :: destination(:)
    integer(i8) :: place
    real(dp) :: mass
    integer :: s, b, d, k, n, nv

    nv = problem%kernels%nv
    n = sum(problem%sub%n_bodies)
    allocate (records(4 + 3*nv, n))
    n = 0
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do b = 1, sub%n_bodies
          n = n + 1
          records(1, n) = sub%id(b)
          records(2, n) = problem%comm%rank
          records(3, n) = s
          records(4, n) = b
          do d = 1, nv
            mass = 1.0_dp
            if (sub%moves(d, b)) mass = 1.0_dp/sub%inverse_mass(min(d, problem%kernels%nw), b)
            records(4 + d, n) = transfer(mass, 0_i8)
            records(4 + nv + d, n) = transfer(mass*sub%v_free(d, b), 0_i8)
            records(4 + 2*nv + d, n) = transfer(sub%v_global(d, b), 0_i8)
          end do
        end do
        allocate (bodies(s)%place(sub%n_bodies))
      end associate
    end do
    call order_rows(problem%comm, 1, records, ordered)
    n = size(ordered, 2)
    k = 0
    if (n > 0) k = 1 + count(ordered(1, 2:) /= ordered(1, :n - 1))
    allocate (answers(3, n), destination(n), rows%mass(nv*k), rows%f(nv*k), rows%v(nv*k))
    place = problem%comm%offset(int(k, i8))
    b = 0
    do k = 1, n
      if (k == 1 .or. ordered(1, max(k - 1, 1)) /= ordered(1, k)) then
        place = place + 1
        do d = 1, nv
          rows%mass(b + d) = transfer(ordered(4 + d, k), 0.0_dp)
          rows%f(b + d) = transfer(ordered(4 + nv + d, k), 0.0_dp)
          rows%v(b + d) = transfer(ordered(4 + 2*nv + d, k), 0.0_dp)
        end do
        b = b + nv
      end if
      destination(k) = narrow(ordered(2, k))
      answers(1:2, k) = ordered(3:4, k)
      answers(3, k) = place
    end do
    call sparse_exchange(problem%comm, answers, destination, received)
    do k = 1, size(received, 2)
      bodies(narrow(received(1, k)))%place(narrow(received(2, k))) = received(3, k)
    end do
  end subroutine order_bodies

  !> Columns of H, w, mu and the impulses of all contacts. Collective.
  subroutine order_contacts(simulation, bodies, rows)
    type(simulation_t), intent(in) :: simulation
    type(places_t), intent(in) :: bodies(:)
    type(fclib_rows_t), intent(inout) :: rows
    integer(i8), allocatable :: records(:, :), ordered(:, :)
    integer :: s, c, p, n, nd, nv, words

    nd = simulation%problem%kernels%nd
    nv = simulation%problem%kernels%nv
    words = 5 + nd*(3 + 2*nv)
    allocate (records(words, sum(simulation%problem%sub%n_contacts)), source=0_i8)
    n = 0
    do s = 1, size(bodies)
      associate (sub => simulation%problem%sub(s), view => simulation%neighbourhoods%view(s))
        do c = 1, sub%n_contacts
          n = n + 1
          p = sub%source(c)
          records(1, n) = view%bodies%id(view%list%candidate(p))
          if (view%list%antagonist(p) > 0) then
            records(2, n) = view%bodies%id(view%list%antagonist(p))
          else
            records(2, n) = simulation%decomposition%boundaries(-view%list%antagonist(p))%id
          end if
          call pack_contact(simulation%problem, sub, bodies(s), c, records(:, n))
        end do
      end associate
    end do
    call order_rows(simulation%comm, 2, records, ordered)
    call unpack_contacts(ordered, nd, nv, rows)
  end subroutine order_contacts

  !> Bodies, mu, and by component w, r, v and the rows of H^T of contact `c`, from word 3 on.
  subroutine pack_contact(problem, sub, bodies, c, record)
    type(contact_problem_t), intent(in) :: problem
    type(subproblem_t), intent(in) :: sub
    type(places_t), intent(in) :: bodies
    integer, intent(in) :: c
    integer(i8), intent(inout), contiguous :: record(:)
    real(dp) :: jacobian(problem%kernels%nd, problem%kernels%nv, 2), w(problem%kernels%nd), u(problem%kernels%nd), r
    integer :: side, body, d, k, at, nd, nv, nc

    nd = problem%kernels%nd
    nv = problem%kernels%nv
    nc = problem%kernels%nc
    call full_jacobian(problem, sub, c, jacobian)
    w(:) = 0.0_dp
    w(1) = sub%hot(lane_of(c), nd + 1, block_of(c))
    associate (row => problem%kernels%shift_row)
      if (row > 0) w(2:) = sub%hot(lane_of(c), row + 1:row + nd - 1, block_of(c))
    end associate
    u(:) = w
    do side = 1, 2
      body = sub%pair(side, c)
      if (body <= sub%n_bodies) record(2 + side) = bodies%place(body)
      do d = 1, nv
        u(:) = u + jacobian(:, d, side)*sub%v_global(d, body)
        if (sub%moves(d, body)) cycle
        w(:) = w + jacobian(:, d, side)*sub%v_free(d, body)
        jacobian(:, d, side) = 0.0_dp
      end do
    end do
    if (nc > 1) record(5) = transfer(sub%hot(lane_of(c), problem%kernels%friction_row, block_of(c)), 0_i8)
    at = 5
    do k = 1, nd
      r = 0.0_dp
      if (k <= nc) r = sub%impulse(lane_of(c), k, block_of(c))
      record(at + 1) = transfer(w(k), 0_i8)
      record(at + 2) = transfer(r, 0_i8)
      record(at + 3) = transfer(u(k), 0_i8)
      at = at + 3
      do side = 1, 2
        do d = 1, nv
          record(at + d) = transfer(jacobian(k, d, side), 0_i8)
        end do
        at = at + nv
      end do
    end do
  end subroutine pack_contact

  !> Rows of H^T of all components of contact `c`, of candidate and antagonist; without friction, too.
  subroutine full_jacobian(problem, sub, c, jacobian)
    type(contact_problem_t), intent(in) :: problem
    type(subproblem_t), intent(in) :: sub
    integer, intent(in) :: c
    !> (nd, nv, 2)
    real(dp), intent(out), contiguous :: jacobian(:, :, :)
    real(dp) :: normal(size(jacobian, 1)), t(3), s(3)
    integer :: nc

    nc = problem%kernels%nc
    jacobian(:, :, :) = 0.0_dp
    call contact_jacobian(problem%kernels, sub%hot, c, jacobian(1:nc, :, 1), jacobian(1:nc, :, 2))
    if (nc > 1) return
    normal(:) = sub%hot(lane_of(c), 1:size(normal), block_of(c))
    if (size(normal) == 2) then
      jacobian(2, 1, 1) = -normal(2)
      jacobian(2, 2, 1) = normal(1)
    else
      call tangents(normal, t, s)
      jacobian(2, :, 1) = t
      jacobian(3, :, 1) = s
    end if
    jacobian(2:, :, 2) = -jacobian(2:, :, 1)
  end subroutine full_jacobian

  !> The columns of this rank from its records.
  subroutine unpack_contacts(records, nd, nv, rows)
    integer(i8), intent(in), contiguous :: records(:, :)
    integer, intent(in) :: nd, nv
    type(fclib_rows_t), intent(inout) :: rows
    integer(i8) :: place
    real(dp) :: x
    integer :: c, k, side, d, at, column, n, first, round

    n = size(records, 2)
    allocate (rows%mu(n), rows%w(nd*n), rows%r(nd*n), rows%u(nd*n))
    allocate (rows%entries(nd*n), source=0_i8)
    do round = 1, 2
      n = 0
      do c = 1, size(records, 2)
        call unpack(c)
      end do
      if (round == 1) allocate (rows%row(n), rows%h(n))
    end do

  contains

    subroutine unpack(c)
      integer, intent(in) :: c

      rows%mu(c) = transfer(records(5, c), 0.0_dp)
      ! entries of a column in the order of their rows
      first = merge(2, 1, records(4, c) < records(3, c))
      do k = 1, nd
        column = (c - 1)*nd + k
        at = 5 + (k - 1)*(3 + 2*nv)
        rows%w(column) = transfer(records(at + 1, c), 0.0_dp)
        rows%r(column) = transfer(records(at + 2, c), 0.0_dp)
        rows%u(column) = transfer(records(at + 3, c), 0.0_dp)
        do side = first, 3 - first, 3 - 2*first
          place = records(2 + side, c)
          do d = 1, nv
            x = transfer(records(at + 3 + (side - 1)*nv + d, c), 0.0_dp)
            if (.not. (place > 0 .and. abs(x) > 0.0_dp)) cycle
            n = n + 1
            if (round == 1) cycle
            rows%entries(column) = rows%entries(column) + 1
            rows%row(n) = (place - 1)*nv + d
            rows%h(n) = x
          end do
        end do
      end do
    end subroutine unpack

  end subroutine unpack_contacts

end module gravier_problem_dump
