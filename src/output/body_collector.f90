!> The bodies of a simulation as tables of named fields, for whatever file is written of them.
module gravier_body_collector
  use gravier_periodic, only: shift_code
  use gravier_kinds, only: dp, i8
  use gravier_boundary, only: boundary_t
  use gravier_body_mass, only: invert_symmetric, multiply_symmetric
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  use gravier_body_store, only: collect_fields
  use gravier_field_list, only: field_list_t
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: collect_cell, collect_bodies, collect_boundaries, collect_problem_bodies

contains

  !> Grains owned by this rank: the table `bodies` with the key `id`, the fields that gravier_body_store has for files and, where
  !> some are glued to boundaries, `boundary`: the identifier of the boundary that a grain is part of, 0 of a free one.
  subroutine collect_bodies(simulation, table)
    type(simulation_t), intent(in) :: simulation
    type(field_list_t), intent(out) :: table
    integer(i8), allocatable :: boundary(:, :)
    integer :: s, k, n

    associate (owned => simulation%decomposition%owned, boundaries => simulation%decomposition%boundaries)
      call table%init("bodies", "id", sum(owned%n))
      n = 0
      do s = 1, size(owned)
        do k = 1, owned(s)%n
          n = n + 1
          table%key(1, n) = owned(s)%id(k)
        end do
      end do
      call collect_fields(simulation%decomposition%layout(), owned, table)
      if (.not. has_glued(boundaries)) return
      allocate (boundary(1, sum(owned%n)), source=0_i8)
      n = 0
      do s = 1, size(owned)
        do k = 1, owned(s)%n
          n = n + 1
          if (owned(s)%glued(k) > 0) boundary(1, n) = boundaries(owned(s)%glued(k))%id
        end do
      end do
    end associate
    call table%add_whole("boundary", "", boundary, .true.)
  end subroutine collect_bodies

  pure logical function has_glued(boundaries)
    type(boundary_t), intent(in) :: boundaries(:)
    integer :: b

    has_glued = .false.
    do b = 1, size(boundaries)
      has_glued = has_glued .or. boundaries(b)%is_glued()
    end do
  end function has_glued

  !> Where all boundaries are, how they move and what the grains did to them in the last step: the table `boundaries` with the key
  !> `id`, the same on all ranks.
  subroutine collect_boundaries(simulation, table)
    type(simulation_t), intent(in) :: simulation
    type(field_list_t), intent(out) :: table
    real(dp), allocatable :: position(:, :), normal(:, :), velocity(:, :), force(:, :)
    real(dp) :: place(3)
    integer :: b, nd, n

    nd = simulation%decomposition%nd
    associate (boundaries => simulation%decomposition%boundaries)
      n = size(boundaries)
      call table%init("boundaries", "id", n)
      table%everywhere = .true.
      allocate (position(nd, n), normal(nd, n), velocity(3*nd - 3, n), force(nd, n))
      do b = 1, n
        table%key(1, b) = boundaries(b)%id
        call boundaries(b)%find_place(place)
        position(:, b) = place(1:nd)
        normal(:, b) = 0.0_dp
        if (boundaries(b)%is_plane()) normal(:, b) = boundaries(b)%surface%axis(1:nd)
        call boundaries(b)%velocity_at(position(:, b), velocity(1:nd, b))
        velocity(nd + 1:, b) = boundaries(b)%spin(merge(3, 1, nd == 2):)
        force(:, b) = simulation%boundary_impulses(:, b)/simulation%physics%h
      end do
    end associate
    call table%add_reals("position", "m", position)
    call table%add_reals("normal", "", normal)
    call table%add_reals("velocity", "m/s, rad/s", velocity)
    call table%add_reals("force", "N", force)
    call collect_lie(simulation%decomposition%boundaries, nd, table)
  end subroutine collect_boundaries

  !> How boundaries lie now, where they have what can turn: `edges` of segments and rectangles from their positions, one after the
  !> other; `axis`, along which cylinders go on for ever; `axes` of the files of those that have facets, one after the other.
  subroutine collect_lie(boundaries, nd, table)
    type(boundary_t), intent(in) :: boundaries(:)
    integer, intent(in) :: nd
    type(field_list_t), intent(inout) :: table
    real(dp), allocatable :: edges(:, :), axis(:, :), axes(:, :)
    real(dp) :: along(3, 3)
    logical :: has(3)
    integer :: b, d

    has(:) = .false.
    allocate (edges(nd*(nd - 1), size(boundaries)), axis(nd, size(boundaries)), axes(nd*nd, size(boundaries)), source=0.0_dp)
    do b = 1, size(boundaries)
      if (.not. allocated(boundaries(b)%surface)) cycle
      associate (surface => boundaries(b)%surface)
        if (surface%is%faceted) then
          call surface%find_axes(along)
          do d = 1, nd
            axes(nd*(d - 1) + 1:nd*d, b) = along(1:nd, d)
          end do
          has(3) = .true.
        else if (surface%is%endless_axis) then
          axis(:, b) = surface%axis(1:nd)
          has(2) = .true.
        else if (.not. surface%is%endless .and. any(abs(surface%edge) > 0.0_dp)) then
          do d = 1, nd - 1
            edges(nd*(d - 1) + 1:nd*d, b) = surface%edge(1:nd, d)
          end do
          has(1) = .true.
        end if
      end associate
    end do
    if (has(1)) call table%add_reals("edges", "m", edges)
    if (has(2)) call table%add_reals("axis", "", axis)
    if (has(3)) call table%add_reals("axes", "", axes)
  end subroutine collect_lie

  !> The edges of the periodic cell and their rates, the corner of the box that grains are kept in and, along each axis, its length:
  !> an item an axis.
  subroutine collect_cell(simulation, table)
    type(simulation_t), intent(in) :: simulation
    type(field_list_t), intent(out) :: table
    real(dp), allocatable :: edge(:, :), velocity(:, :), origin(:, :)
    integer :: d, nd, shift(3)

    nd = simulation%decomposition%nd
    call table%init("cell", "axis", nd)
    table%everywhere = .true.
    allocate (edge(nd, nd), velocity(nd, nd), source=0.0_dp)
    allocate (origin(1, nd))
    associate (period => simulation%decomposition%period)
      do d = 1, nd
        table%key(1, d) = d
        shift(:) = 0
        shift(d) = 1
        call period%add_shift(shift_code(shift), 1, edge(:, d))
        call period%add_velocity(shift, velocity(:, d))
        origin(1, d) = period%origin(d)
      end do
    end associate
    call table%add_reals("edge", "m", edge)
    call table%add_reals("velocity", "m/s", velocity)
    call table%add_reals("origin", "m", origin)
  end subroutine collect_cell

  !> Bodies that the contacts of this rank's subdomains act on and that can move, boundaries included, one item a copy: the table
  !> `bodies` with the key `id`, `place` (rank, subdomain of the rank, number there), `mass` (1 for what cannot move), the diagonal
  !> of M, `load` f = M v_f and `velocity` of the last solve, each of nv components, and `inertia`, the entries xy, xz and yz of M
  !> among spins in space, where bodies have shapes.
  subroutine collect_problem_bodies(problem, table)
    type(contact_problem_t), intent(in) :: problem
    type(field_list_t), intent(out) :: table
    real(dp), allocatable :: mass(:, :), load(:, :), velocity(:, :), inertia(:, :)
    integer(i8), allocatable :: place(:, :)
    integer :: s, b, d, n, nv

    nv = problem%nv
    n = sum(problem%sub%n_bodies)
    call table%init("bodies", "id", n)
    allocate (place(3, n), mass(nv, n), load(nv, n), velocity(nv, n), inertia(merge(3, 0, problem%nw == 9), n))
    n = 0
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do b = 1, sub%n_bodies
          n = n + 1
          table%key(1, n) = sub%id(b)
          place(1, n) = problem%comm%rank
          place(2, n) = s
          place(3, n) = b
          velocity(:, n) = sub%v_global(1:nv, b)
          do d = 1, nv
            mass(d, n) = 1.0_dp
            if (sub%moves(d, b)) mass(d, n) = 1.0_dp/sub%inverse_mass(min(d, problem%nw), b)
            load(d, n) = mass(d, n)*sub%v_free(d, b)
          end do
          if (size(inertia, 1) > 0) call take_inertia(sub, b, mass(4:6, n), inertia(:, n), load(4:6, n))
        end do
      end associate
    end do
    call table%add_whole("place", "", place)
    call table%add_reals("mass", "kg, kg m^2", mass)
    call table%add_reals("load", "N s, N m s", load)
    call table%add_reals("velocity", "m/s, rad/s", velocity)
    if (size(inertia, 1) > 0) call table%add_reals("inertia", "kg m^2", inertia)
  end subroutine collect_problem_bodies

  !> The inertia of body `b` in space, which may have a shape, and the load on its spin; of one that cannot turn, what is there
  !> stays.
  pure subroutine take_inertia(sub, b, diagonal, inertia, load)
    type(subproblem_t), intent(in) :: sub
    integer, intent(in) :: b
    !> entries xx, yy and zz; xy, xz and yz [kg m^2]; [N m s]
    real(dp), intent(inout) :: diagonal(3)
    real(dp), intent(out) :: inertia(3)
    real(dp), intent(inout) :: load(3)
    real(dp) :: entries(6)

    inertia(:) = 0.0_dp
    if (.not. sub%moves(4, b)) return
    call invert_symmetric(sub%inverse_mass(4:9, b), entries)
    call multiply_symmetric(entries, sub%v_free(4:6, b), load)
    diagonal(:) = entries(1:3)
    inertia(:) = entries(4:6)
  end subroutine take_inertia

end module gravier_body_collector
