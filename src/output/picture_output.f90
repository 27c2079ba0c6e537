!> The files of a run for ParaView: bodies.vtkhdf, a point a grain or, where bodies have shapes, their polygons; contacts.vtkhdf, a
!> line a contact; and, where boundaries have facets, boundaries.vtkhdf, a triangle or line a facet, once where none of them moves.
module gravier_picture_output
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_schedule, only: schedule_t
  use gravier_field_list, only: field_list_t
  use gravier_vtkhdf_file, only: vtkhdf_file_t, points_name
  use gravier_config_types, only: config_t
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_body_collector, only: collect_bodies
  use gravier_pair_places, only: has_facets
  use gravier_body_polygons, only: draw_polygons
  use gravier_facet_tables, only: draw_facets, count_facets, facets_move
  use gravier_contact_collector, only: collect_contacts
  use gravier_output, only: output_t, of_states
  implicit none
  private
  public :: picture_output_t

  type, extends(output_t) :: picture_output_t
    private
    type(vtkhdf_file_t) :: bodies, contacts, facets
    !> the facets are to be written with this state
    logical :: facets_due = .false.
  contains
    procedure, nopass :: wanted => picture_output_wanted
    procedure, nopass :: files => picture_output_files
    procedure :: open => picture_output_open
    procedure :: write => picture_output_write
    procedure :: finish => picture_output_finish
  end type picture_output_t

  character(len=*), parameter :: bodies_name = "bodies.vtkhdf", contacts_name = "contacts.vtkhdf", &
    & facets_name = "boundaries.vtkhdf"
  !> what is asked of contacts
  character(len=16), parameter :: contact_fields(5) = [character(len=16) :: points_name, "normal_force", "tangential_force", &
    & "gap", "status"]

contains

  pure logical function picture_output_wanted(config) result(wanted)
    type(config_t), intent(in) :: config
    wanted = config%output%vtk
  end function picture_output_wanted

  pure function picture_output_files(config) result(names)
    type(config_t), intent(in) :: config
    character(len=:), allocatable :: names

    names = bodies_name//","//facets_name
    if (config%output%contacts) names = names//","//contacts_name
  end function picture_output_files

  !> Create the files, or go on with those of a run that was interrupted. Collective.
  subroutine picture_output_open(self, simulation, directory, command, error)
    class(picture_output_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    character(len=*), intent(in) :: directory, command
    type(error_t), allocatable, intent(inout) :: error
    type(field_list_t) :: table
    integer(i8) :: states, bodies

    associate (unused => command)
    end associate
    self%stage = of_states
    if (simulation%restarted) self%last = simulation%last_written
    states = 2
    associate (output => simulation%config%output)
      self%schedule = schedule_t(every=output%every, last=simulation%config%time%steps)
      if (output%every > 0) states = states + simulation%config%time%steps/output%every
      bodies = max(simulation%n_grains, 1_i8)
      call draw_bodies(simulation, table)
      call open_one(self%bodies, simulation, directory, bodies_name, table, states*bodies, error)
      ! a run that ended in the step of its checkpoint has written this state
      if (self%bodies%has_last) self%last = simulation%step
      if (has_facets(simulation%decomposition%boundaries)) then
        call draw_facets(simulation, table)
        self%facets_due = facets_move(simulation) .or. .not. simulation%goes_on_with(facets_name)
        call open_one(self%facets, simulation, directory, facets_name, table, merge(states, 1_i8, facets_move(simulation))* &
          & count_facets(simulation%decomposition%boundaries, .false.), error)
      end if
      if (.not. output%contacts) return
      ! a dense packing has about two contacts a disk, three a sphere
      call describe_contacts(table)
      call open_one(self%contacts, simulation, directory, contacts_name, table, states*bodies*simulation%decomposition%nd, error)
    end associate
  end subroutine picture_output_open

  !> Create a file, or go on with it.
  subroutine open_one(file, simulation, directory, name, table, expected, error)
    type(vtkhdf_file_t), intent(inout) :: file
    type(simulation_t), intent(in) :: simulation
    character(len=*), intent(in) :: directory, name
    !> with the fields of the file
    type(field_list_t), intent(in) :: table
    !> rows of all states together, about
    integer(i8), intent(in) :: expected
    type(error_t), allocatable, intent(inout) :: error

    if (simulation%goes_on_with(name)) then
      call file%reopen(simulation%comm, directory//name, table, expected, simulation%step, error)
    else
      call file%open(simulation%comm, directory//name, table, expected, error)
    end if
  end subroutine open_one

  !> Write the present state; its contacts too, where they are known: not at the start. Collective.
  subroutine picture_output_write(self, simulation, figures, seconds, error)
    class(picture_output_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: simulation
    type(step_figures_t), intent(in) :: figures
    real(dp), intent(in) :: seconds
    type(error_t), allocatable, intent(inout) :: error
    type(field_list_t) :: table

    associate (unused => figures, unused_seconds => seconds)
    end associate
    call draw_bodies(simulation, table)
    call self%bodies%write_step(simulation%step, simulation%time, table, error)
    self%facets_due = self%facets_due .or. facets_move(simulation)
    if (self%facets_due) then
      call draw_facets(simulation, table)
      call self%facets%write_step(simulation%step, simulation%time, table, error)
      self%facets_due = facets_move(simulation)
    end if
    if (.not. (simulation%config%output%contacts .and. allocated(simulation%problem%sub))) return
    call collect_contacts(simulation, contact_fields, table)
    call self%contacts%write_step(simulation%step, simulation%time, table, error)
  end subroutine picture_output_write

  !> Collective.
  subroutine picture_output_finish(self, error)
    class(picture_output_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error

    call self%bodies%close(error)
    call self%facets%close(error)
    call self%contacts%close(error)
  end subroutine picture_output_finish

  !> Bodies of this rank as points or polygons, with vectors of three components; in 2D in the plane z = 0.
  subroutine draw_bodies(simulation, table)
    type(simulation_t), intent(in) :: simulation
    type(field_list_t), intent(out) :: table
    type(field_list_t) :: points

    if (simulation%effects%shapes) then
      call draw_points(simulation, points)
      call draw_polygons(simulation, points, table)
    else
      call draw_points(simulation, table)
    end if
  end subroutine draw_bodies

  !> Bodies as points.
  subroutine draw_points(simulation, table)
    type(simulation_t), intent(in) :: simulation
    type(field_list_t), intent(out) :: table
    type(field_list_t) :: bodies
    real(dp), allocatable :: points(:, :), velocity(:, :), spin(:, :)
    integer(i8), allocatable :: id(:, :), subdomain(:, :)
    integer :: n, nd, s, f

    call collect_bodies(simulation, bodies)
    n = bodies%n_items()
    nd = simulation%decomposition%nd
    allocate (points(3, n), velocity(3, n), spin(3, n), source=0.0_dp)
    points(1:nd, :) = bodies%field(bodies%place("position"))%value
    associate (v => bodies%field(bodies%place("velocity"))%value)
      velocity(1:nd, :) = v(1:nd, :)
      ! in 2D about z
      spin(merge(3, 1, nd == 2):3, :) = v(nd + 1:, :)
    end associate
    id = bodies%key
    call table%init("bodies", "id", n)
    table%key(:, :) = bodies%key
    call table%add_reals(points_name, "m", points)
    call table%add_whole("id", "", id)
    allocate (subdomain(1, n))
    n = 0
    do s = 1, size(simulation%decomposition%owned)
      subdomain(1, n + 1:n + simulation%decomposition%owned(s)%n) = simulation%decomposition%subdomain_of(s)
      n = n + simulation%decomposition%owned(s)%n
    end do
    call table%add_whole("subdomain", "", subdomain)
    call table%add_reals("velocity", "m/s", velocity)
    call table%add_reals("spin", "rad/s", spin)
    ! what the points are not made of is drawn as it is
    do f = 1, bodies%n_fields
      associate (field => bodies%field(f))
        select case (field%name)
        case ("position", "velocity", "image")
          cycle
        end select
        if (allocated(field%value)) call table%add_reals(field%name, field%unit, field%value)
        if (allocated(field%whole)) call table%add_whole(field%name, field%unit, field%whole)
      end associate
    end do
  end subroutine draw_points

  !> The fields of contacts, without a contact: there is none before the first step.
  subroutine describe_contacts(table)
    type(field_list_t), intent(out) :: table
    real(dp), allocatable :: value(:, :)
    integer(i8), allocatable :: whole(:, :)
    integer :: k

    call table%init("contacts", "candidate antagonist", 0)
    do k = 1, size(contact_fields)
      if (contact_fields(k) == "status") then
        allocate (whole(1, 0))
        call table%add_whole(trim(contact_fields(k)), "", whole)
      else
        allocate (value(merge(6, 1, contact_fields(k) == points_name), 0))
        call table%add_reals(trim(contact_fields(k)), "", value)
      end if
    end do
  end subroutine describe_contacts

end module gravier_picture_output
