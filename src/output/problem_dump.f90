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
  use gravier_contact_kernels, only: contact_jacobian, tangents, lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  use gravier_field_list, only: field_list_t
  use gravier_fclib_file, only: fclib_rows_t
  use gravier_fclib_writer, only: write_fclib_global
  use gravier_body_collector, only: collect_problem_bodies
  use gravier_contact_collector, only: collect_contacts
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
    type(field_list_t) :: bodies, contacts
    type(places_t) :: places(size(simulation%problem%sub))
    character(len=1), parameter :: no_fields(0) = ""

    if (allocated(error)) return
    rows%dimension = simulation%problem%nd
    ! a projection of overlaps has used the velocities for its own
    call simulation%problem%evaluate()
    call collect_problem_bodies(simulation%problem, bodies)
    call bodies%order(simulation%comm)
    call take_bodies(bodies, rows)
    call number_bodies(simulation%problem, bodies, places)
    call collect_contacts(simulation, no_fields, contacts)
    call add_columns(simulation%problem, places, contacts)
    call contacts%order(simulation%comm)
    call take_contacts(contacts, rows%dimension, simulation%problem%nv, rows)
    call write_fclib_global(simulation%comm, path, rows, error)
  end subroutine write_problem

  !> Whether item `k` of ordered bodies is the first copy of its body.
  pure logical function is_first(bodies, k)
    type(field_list_t), intent(in) :: bodies
    integer, intent(in) :: k

    is_first = k == 1
    if (.not. is_first) is_first = bodies%key(1, k - 1) /= bodies%key(1, k)
  end function is_first

  !> Masses, loads and velocities of the bodies of this rank, each once.
  subroutine take_bodies(bodies, rows)
    !> ordered; copies of a body stand together
    type(field_list_t), intent(in) :: bodies
    type(fclib_rows_t), intent(inout) :: rows
    integer :: k, n, nv

    associate (load => bodies%field(bodies%place("load"))%value, velocity => bodies%field(bodies%place("velocity"))%value)
      nv = size(load, 1)
      n = 0
      do k = 1, bodies%n_items()
        if (is_first(bodies, k)) n = n + 1
      end do
      allocate (rows%f(nv*n), rows%v(nv*n))
      n = 0
      do k = 1, bodies%n_items()
        if (.not. is_first(bodies, k)) cycle
        rows%f(n + 1:n + nv) = load(:, k)
        rows%v(n + 1:n + nv) = velocity(:, k)
        n = n + nv
      end do
    end associate
    call take_masses(bodies, nv, rows)
  end subroutine take_bodies

  !> Rows of the mass matrix of the bodies of this rank, each once: its diagonal, and what is not zero of the inertia beside it.
  subroutine take_masses(bodies, nv, rows)
    !> ordered; copies of a body stand together
    type(field_list_t), intent(in) :: bodies
    integer, intent(in) :: nv
    type(fclib_rows_t), intent(inout) :: rows
    real(dp) :: matrix(nv, nv)
    integer :: k, d, e, n, row, round

    allocate (rows%mass_entries(size(rows%f)))
    do round = 1, 2
      rows%mass_entries(:) = 0
      n = 0
      row = 0
      do k = 1, bodies%n_items()
        if (.not. is_first(bodies, k)) cycle
        call mass_matrix(bodies, k, matrix)
        do d = 1, nv
          do e = 1, nv
            if (d /= e .and. .not. abs(matrix(e, d)) > 0.0_dp) cycle
            n = n + 1
            rows%mass_entries(row + d) = rows%mass_entries(row + d) + 1
            if (round == 1) cycle
            rows%mass_column(n) = row + e
            rows%mass(n) = matrix(e, d)
          end do
        end do
        row = row + nv
      end do
      if (round == 1) allocate (rows%mass_column(n), rows%mass(n))
    end do
  end subroutine take_masses

  !> The mass matrix of item `k` of the bodies.
  subroutine mass_matrix(bodies, k, matrix)
    type(field_list_t), intent(in) :: bodies
    integer, intent(in) :: k
    !> (nv, nv)
    real(dp), intent(out) :: matrix(:, :)
    integer :: d

    matrix(:, :) = 0.0_dp
    do d = 1, size(matrix, 1)
      matrix(d, d) = bodies%field(bodies%place("mass"))%value(d, k)
    end do
    if (bodies%place("inertia") == 0) return
    associate (inertia => bodies%field(bodies%place("inertia"))%value(:, k))
      matrix(4, 5) = inertia(1)
      matrix(4, 6) = inertia(2)
      matrix(5, 6) = inertia(3)
    end associate
    matrix(5, 4) = matrix(4, 5)
    matrix(6, 4) = matrix(4, 6)
    matrix(6, 5) = matrix(5, 6)
  end subroutine mass_matrix

  !> Number the bodies in the order of their identifiers, and tell all copies. Collective.
  subroutine number_bodies(problem, bodies, places)
    type(contact_problem_t), intent(in) :: problem
    !> ordered; copies of a body stand together
    type(field_list_t), intent(in) :: bodies
    type(places_t), intent(inout) :: places(:)
    integer(i8), allocatable :: answers(:, :), received(:, :)
    integer, allocatable :: destination(:)
    integer(i8) :: place
    integer :: s, k

    do s = 1, size(places)
      allocate (places(s)%place(problem%sub(s)%n_bodies))
    end do
    allocate (answers(3, bodies%n_items()), destination(bodies%n_items()))
    place = 0
    do k = 1, bodies%n_items()
      if (is_first(bodies, k)) place = place + 1
    end do
    place = problem%comm%offset(place)
    associate (owned => bodies%field(bodies%place("place"))%whole)
      do k = 1, bodies%n_items()
        if (is_first(bodies, k)) place = place + 1
        destination(k) = narrow(owned(1, k))
        answers(1:2, k) = owned(2:3, k)
        answers(3, k) = place
      end do
    end associate
    call sparse_exchange(problem%comm, answers, destination, received)
    do k = 1, size(received, 2)
      places(narrow(received(1, k)))%place(narrow(received(2, k))) = received(3, k)
    end do
  end subroutine number_bodies

  !> Add to the contacts of this rank what a global problem has of them: `bodies` (2), the places of candidate and antagonist, 0 for
  !> what moves as prescribed; mu; by component w, r and u (nd each); the rows of H^T, by component those of both sides (2 nd nv).
  subroutine add_columns(problem, places, contacts)
    type(contact_problem_t), intent(in) :: problem
    type(places_t), intent(in) :: places(:)
    type(field_list_t), intent(inout) :: contacts
    integer(i8), allocatable :: bodies(:, :)
    real(dp), allocatable :: mu(:, :), w(:, :), r(:, :), u(:, :), h(:, :)
    integer :: s, c, k, n, nd, nv

    nd = problem%nd
    nv = problem%nv
    n = contacts%n_items()
    allocate (bodies(2, n), source=0_i8)
    allocate (mu(1, n), w(nd, n), r(nd, n), u(nd, n), h(2*nd*nv, n), source=0.0_dp)
    n = 0
    do s = 1, size(places)
      associate (sub => problem%sub(s))
        do c = 1, sub%n_contacts
          n = n + 1
          do k = 1, 2
            if (sub%pair(k, c) <= sub%n_bodies) bodies(k, n) = places(s)%place(sub%pair(k, c))
          end do
          if (problem%nc > 1) mu(1, n) = sub%hot(lane_of(c), problem%friction_row, block_of(c))
          k = min(nd, problem%nc)
          r(1:k, n) = sub%impulse(lane_of(c), 1:k, block_of(c))
          call take_rows(problem, sub, c, w(:, n), u(:, n), h(:, n))
        end do
      end associate
    end do
    call contacts%add_whole("bodies", "", bodies)
    call contacts%add_reals("mu", "", mu)
    call contacts%add_reals("w", "m/s", w)
    call contacts%add_reals("r", "N s", r)
    call contacts%add_reals("u", "m/s", u)
    call contacts%add_reals("h", "", h)
  end subroutine add_columns

  !> w, u = H^T v + w and the rows of H^T of contact `c`, with the velocities of what cannot move in w.
  subroutine take_rows(problem, sub, c, w, u, h)
    type(contact_problem_t), intent(in) :: problem
    type(subproblem_t), intent(in) :: sub
    integer, intent(in) :: c
    !> (nd), (nd), (2 nd nv) by component, then by side
    real(dp), intent(inout) :: w(:), u(:), h(:)
    real(dp) :: jacobian(problem%nd, problem%nv, 2)
    integer :: side, body, d, k, at, nd, nv

    nd = problem%nd
    nv = problem%nv
    call full_jacobian(problem, sub, c, jacobian)
    w(1) = sub%hot(lane_of(c), nd + 1, block_of(c))
    associate (row => problem%shift_row)
      if (row > 0) w(2:) = sub%hot(lane_of(c), row + 1:row + nd - 1, block_of(c))
    end associate
    u(:) = w
    do side = 1, 2
      body = sub%pair(side, c)
      do d = 1, nv
        u(:) = u + jacobian(:, d, side)*sub%v_global(d, body)
        if (sub%moves(d, body)) cycle
        w(:) = w + jacobian(:, d, side)*sub%v_free(d, body)
        jacobian(:, d, side) = 0.0_dp
      end do
    end do
    at = 0
    do k = 1, nd
      do side = 1, 2
        h(at + 1:at + nv) = jacobian(k, :, side)
        at = at + nv
      end do
    end do
  end subroutine take_rows

  !> Rows of H^T of all components of contact `c`, of candidate and antagonist; without friction, too.
  subroutine full_jacobian(problem, sub, c, jacobian)
    type(contact_problem_t), intent(in) :: problem
    type(subproblem_t), intent(in) :: sub
    integer, intent(in) :: c
    !> (nd, nv, 2)
    real(dp), intent(out), contiguous :: jacobian(:, :, :)
    real(dp) :: normal(size(jacobian, 1)), t(3), s(3)
    integer :: nc

    nc = problem%nc
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

  !> The columns of the contacts of this rank, compressed.
  subroutine take_contacts(contacts, nd, nv, rows)
    !> ordered
    type(field_list_t), intent(in) :: contacts
    integer, intent(in) :: nd, nv
    type(fclib_rows_t), intent(inout) :: rows
    integer :: c, n, round

    n = contacts%n_items()
    allocate (rows%mu(n), rows%w(nd*n), rows%r(nd*n), rows%u(nd*n))
    allocate (rows%entries(nd*n), source=0_i8)
    do c = 1, n
      rows%mu(c) = contacts%field(contacts%place("mu"))%value(1, c)
      rows%w((c - 1)*nd + 1:c*nd) = contacts%field(contacts%place("w"))%value(:, c)
      rows%r((c - 1)*nd + 1:c*nd) = contacts%field(contacts%place("r"))%value(:, c)
      rows%u((c - 1)*nd + 1:c*nd) = contacts%field(contacts%place("u"))%value(:, c)
    end do
    do round = 1, 2
      n = 0
      associate (bodies => contacts%field(contacts%place("bodies"))%whole, h => contacts%field(contacts%place("h"))%value)
        do c = 1, contacts%n_items()
          call take_entries(c, bodies(:, c), h(:, c))
        end do
      end associate
      if (round == 1) allocate (rows%row(n), rows%h(n))
    end do

  contains

    !> Count the entries of a contact in H, or take them, those of a column in the order of their rows.
    subroutine take_entries(c, bodies, h)
      integer, intent(in) :: c
      integer(i8), intent(in) :: bodies(2)
      real(dp), intent(in) :: h(nv, 2, nd)
      integer :: k, side, first, d, column

      first = merge(2, 1, bodies(2) < bodies(1))
      do k = 1, nd
        column = (c - 1)*nd + k
        do side = first, 3 - first, 3 - 2*first
          do d = 1, nv
            if (.not. (bodies(side) > 0 .and. abs(h(d, side, k)) > 0.0_dp)) cycle
            n = n + 1
            if (round == 1) cycle
            rows%entries(column) = rows%entries(column) + 1
            rows%row(n) = (bodies(side) - 1)*nv + d
            rows%h(n) = h(d, side, k)
          end do
        end do
      end do
    end subroutine take_entries

  end subroutine take_contacts

end module gravier_problem_dump
