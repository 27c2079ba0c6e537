!> The bodies of a simulation as tables of named fields, for whatever file is written of them.
module gravier_body_collector
  use gravier_kinds, only: dp, i8
  use gravier_contact_problem, only: contact_problem_t
  use gravier_body_fields, only: body_field_t, list_body_fields, take_real_field, take_whole_field
  use gravier_field_list, only: field_list_t
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: collect_bodies, collect_boundaries, collect_problem_bodies

contains

  !> Grains at home on this rank: the table `bodies` with the key `id`.
  subroutine collect_bodies(simulation, table, names)
    type(simulation_t), intent(in) :: simulation
    type(field_list_t), intent(out) :: table
    !> those of the fields, in their order; absent: all that results.h5 has
    character(len=*), intent(in), optional :: names(:)
    type(body_field_t), allocatable :: fields(:)
    integer :: s, k, f, n

    associate (decomposition => simulation%decomposition)
      call table%init("bodies", "id", sum(decomposition%home%n))
      n = 0
      do s = 1, size(decomposition%home)
        do k = 1, decomposition%home(s)%n
          n = n + 1
          table%key(1, n) = decomposition%home(s)%id(k)
        end do
      end do
      call list_body_fields(decomposition, fields)
      if (present(names)) then
        do k = 1, size(names)
          do f = 1, size(fields)
            if (fields(f)%name == names(k)) call add_field(simulation, fields(f), table)
          end do
        end do
      else
        do f = 1, size(fields)
          if (fields(f)%in_results .and. fields(f)%components > 0) call add_field(simulation, fields(f), table)
        end do
      end if
    end associate
  end subroutine collect_bodies

  !> Add a field of the grains.
  subroutine add_field(simulation, field, table)
    type(simulation_t), intent(in) :: simulation
    type(body_field_t), intent(in) :: field
    type(field_list_t), intent(inout) :: table
    real(dp), allocatable :: value(:, :), written(:, :)
    integer(i8), allocatable :: whole(:, :)
    integer :: s, first, last
    logical :: scalar

    scalar = field%components == 1
    if (field%whole) then
      allocate (whole(field%components, table%n_items()))
    else
      allocate (value(field%components, table%n_items()))
    end if
    last = 0
    do s = 1, size(simulation%decomposition%home)
      associate (home => simulation%decomposition%home(s))
        first = last + 1
        last = last + home%n
        if (field%written > 0) then
          call home%get_written(field%written, written)
          if (field%whole) whole(:, first:last) = nint(written, i8)
          if (.not. field%whole) value(:, first:last) = written
        else if (field%whole) then
          call take_whole_field(home, field%name, simulation%decomposition%subdomain_of(s), whole(:, first:last))
        else
          call take_real_field(home, field%name, value(:, first:last))
        end if
      end associate
    end do
    if (field%whole) then
      call table%add_whole(trim(field%name), trim(field%unit), whole, scalar)
    else
      call table%add_reals(trim(field%name), trim(field%unit), value, scalar)
    end if
  end subroutine add_field

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
        velocity(1:nd, b) = boundaries(b)%velocity(1:nd)
        velocity(nd + 1:, b) = boundaries(b)%spin(merge(3, 1, nd == 2):)
        force(:, b) = simulation%boundary_impulses(:, b)/simulation%physics%h
      end do
    end associate
    call table%add_reals("position", "m", position)
    call table%add_reals("normal", "", normal)
    call table%add_reals("velocity", "m/s, rad/s", velocity)
    call table%add_reals("force", "N", force)
  end subroutine collect_boundaries

  !> Bodies that the contacts of this rank's subdomains act on and that can move, boundaries included, one item a copy: the table
  !> `bodies` with the key `id`, `place` (rank, subdomain of the rank, number there), `mass` (1 for what cannot move), `load`
  !> f = M v_f and `velocity` of the last solve, each of nv components.
  subroutine collect_problem_bodies(problem, table)
    type(contact_problem_t), intent(in) :: problem
    type(field_list_t), intent(out) :: table
    real(dp), allocatable :: mass(:, :), load(:, :), velocity(:, :)
    integer(i8), allocatable :: place(:, :)
    integer :: s, b, d, n, nv

    nv = problem%kernels%nv
    n = sum(problem%sub%n_bodies)
    call table%init("bodies", "id", n)
    allocate (place(3, n), mass(nv, n), load(nv, n), velocity(nv, n))
    n = 0
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do b = 1, sub%n_bodies
          n = n + 1
          table%key(1, n) = sub%id(b)
          place(1, n) = problem%comm%rank
          place(2, n) = s
          place(3, n) = b
          do d = 1, nv
            mass(d, n) = 1.0_dp
            if (sub%moves(d, b)) mass(d, n) = 1.0_dp/sub%inverse_mass(min(d, problem%kernels%nw), b)
            load(d, n) = mass(d, n)*sub%v_free(d, b)
            velocity(d, n) = sub%v_global(d, b)
          end do
        end do
      end associate
    end do
    call table%add_whole("place", "", place)
    call table%add_reals("mass", "kg, kg m^2", mass)
    call table%add_reals("load", "N s, N m s", load)
    call table%add_reals("velocity", "m/s, rad/s", velocity)
  end subroutine collect_problem_bodies

end module gravier_body_collector
