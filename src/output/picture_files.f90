!> The files of a run for ParaView: bodies.vtkhdf, a point a grain, and contacts.vtkhdf, a line a contact.
module gravier_picture_files
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_vtkhdf_file, only: vtkhdf_file_t, vtk_field_t, vtk_rows_t
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_contact_law, only: unused
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: picture_files_t

  type :: picture_files_t
    private
    type(vtkhdf_file_t) :: bodies, contacts
  contains
    procedure :: open => picture_files_open
    procedure :: write_step => picture_files_write_step
    procedure :: close => picture_files_close
  end type picture_files_t

  character(len=*), parameter :: bodies_name = "bodies.vtkhdf", contacts_name = "contacts.vtkhdf"
  !> of a grain: identifier, subdomain that holds it (from 1), radius, velocity, spin
  type(vtk_field_t), parameter :: body_fields(5) = [vtk_field_t("id", 1, .true.), vtk_field_t("subdomain", 1, .true.), &
    & vtk_field_t("radius"), vtk_field_t("velocity", 3), vtk_field_t("spin", 3)]
  integer, parameter :: n_body_values = 9
  !> of a contact: forces along the normal and across it [N], gap [m], `status`
  type(vtk_field_t), parameter :: contact_fields(4) = [vtk_field_t("normal_force"), vtk_field_t("tangential_force"), &
    & vtk_field_t("gap"), vtk_field_t("status", 1, .true.)]
  integer, parameter :: n_contact_values = 4
  !> values of `status`: no force; a force within the cone of friction; one on it
  integer, parameter :: idle = 0, sticking = 1, sliding = 2

contains

  !> Create the files, or go on with those of a run that was interrupted. Collective.
  subroutine picture_files_open(self, simulation, directory, error)
    class(picture_files_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    !> with a slash at its end
    character(len=*), intent(in) :: directory
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: states, bodies

    states = 2
    associate (output => simulation%config%output)
      if (output%every > 0) states = states + simulation%config%time%steps/output%every
      bodies = max(simulation%n_grains, 1_i8)
      call open_one(self%bodies, simulation, directory//bodies_name, 1, body_fields, states*bodies, error)
      ! a dense packing has about two contacts a disk, three a sphere
      if (output%contacts) call open_one(self%contacts, simulation, directory//contacts_name, 2, contact_fields, &
        & states*bodies*simulation%decomposition%nd, error)
    end associate
  end subroutine picture_files_open

  subroutine open_one(file, simulation, path, n_points, field, expected, error)
    type(vtkhdf_file_t), intent(inout) :: file
    type(simulation_t), intent(in) :: simulation
    character(len=*), intent(in) :: path
    integer, intent(in) :: n_points
    type(vtk_field_t), intent(in) :: field(:)
    integer(i8), intent(in) :: expected
    type(error_t), allocatable, intent(inout) :: error

    if (simulation%restarted) then
      call file%reopen(simulation%comm, path, n_points, field, expected, simulation%step, error)
    else
      call file%open(simulation%comm, path, n_points, field, expected, error)
    end if
  end subroutine open_one

  !> Write the present state; its contacts too, where they are known: not at the start. Collective.
  subroutine picture_files_write_step(self, simulation, error)
    class(picture_files_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    type(error_t), allocatable, intent(inout) :: error
    type(vtk_rows_t) :: rows

    call collect_bodies(simulation, rows)
    call self%bodies%write_step(simulation%step, simulation%time, rows, error)
    if (.not. (simulation%config%output%contacts .and. allocated(simulation%problem%sub))) return
    call collect_contacts(simulation, rows)
    call self%contacts%write_step(simulation%step, simulation%time, rows, error)
  end subroutine picture_files_write_step

  !> Collective.
  subroutine picture_files_close(self, error)
    class(picture_files_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error

    call self%bodies%close(error)
    call self%contacts%close(error)
  end subroutine picture_files_close

  !> Grains of this rank; in 2D in the plane z = 0.
  subroutine collect_bodies(simulation, rows)
    type(simulation_t), intent(in) :: simulation
    type(vtk_rows_t), intent(out) :: rows
    integer :: s, k, n, nd, nv

    nd = simulation%decomposition%nd
    nv = simulation%decomposition%nv
    n = sum(simulation%decomposition%home%n)
    allocate (rows%key(1, n))
    allocate (rows%point(3, n), rows%value(n_body_values, n), source=0.0_dp)
    n = 0
    do s = 1, size(simulation%decomposition%home)
      associate (home => simulation%decomposition%home(s))
        do k = 1, home%n
          n = n + 1
          rows%key(1, n) = home%id(k)
          rows%point(1:nd, n) = home%position(:, k)
          rows%value(1, n) = real(home%id(k), dp)
          rows%value(2, n) = real(simulation%decomposition%subdomain_of(s), dp)
          rows%value(3, n) = home%radius(k)
          rows%value(4:3 + nd, n) = home%velocity(1:nd, k)
          ! in 2D about z
          if (nv > nd) rows%value(merge(9, 7, nd == 2):9, n) = home%velocity(nd + 1:nv, k)
        end do
      end associate
    end do
  end subroutine collect_bodies

  !> Contacts of this rank, from the centre of the candidate to that of the antagonist's nearest image, or to the boundary, where
  !> they were detected: in the middle of the step.
  subroutine collect_contacts(simulation, rows)
    type(simulation_t), intent(in) :: simulation
    type(vtk_rows_t), intent(out) :: rows
    integer :: s, c, n

    n = sum(simulation%problem%sub%n_contacts)
    allocate (rows%key(2, n))
    allocate (rows%point(6, n), rows%value(n_contact_values, n), source=0.0_dp)
    n = 0
    do s = 1, size(simulation%problem%sub)
      do c = 1, simulation%problem%sub(s)%n_contacts
        n = n + 1
        call draw_contact(simulation, s, c, rows%key(:, n), rows%point(:, n))
        call value_contact(simulation, s, c, rows%value(:, n))
      end do
    end do
  end subroutine collect_contacts

  !> Identifiers and ends of a contact.
  subroutine draw_contact(simulation, s, c, key, point)
    type(simulation_t), intent(in) :: simulation
    integer, intent(in) :: s, c
    integer(i8), intent(out) :: key(2)
    real(dp), intent(inout) :: point(6)
    real(dp) :: reach
    integer :: p, nd

    nd = simulation%problem%kernels%nd
    associate (sub => simulation%problem%sub(s), view => simulation%neighbourhoods%view(s))
      p = sub%source(c)
      associate (candidate => view%list%candidate(p), antagonist => view%list%antagonist(p))
        key(1) = view%bodies%id(candidate)
        point(1:nd) = view%bodies%position(:, candidate)
        reach = view%bodies%radius(candidate) + sub%gap(c)
        if (antagonist > 0) then
          key(2) = view%bodies%id(antagonist)
          reach = reach + view%bodies%radius(antagonist)
        else
          key(2) = simulation%decomposition%boundaries(-antagonist)%id
        end if
      end associate
      point(4:3 + nd) = point(1:nd) - reach*sub%hot(lane_of(c), 1:nd, block_of(c))
    end associate
  end subroutine draw_contact

  !> Forces, gap and state of a contact.
  subroutine value_contact(simulation, s, c, value)
    type(simulation_t), intent(in) :: simulation
    integer, intent(in) :: s, c
    real(dp), intent(inout) :: value(n_contact_values)
    real(dp) :: held, tangential
    integer :: status

    associate (sub => simulation%problem%sub(s), kernels => simulation%problem%kernels, q => lane_of(c), g => block_of(c))
      held = sub%impulse(q, 1, g)
      tangential = 0.0_dp
      status = idle
      if (held > 0.0_dp) status = sliding
      if (kernels%nf > 1) then
        tangential = norm2(sub%impulse(q, 2:kernels%nf, g))
        if (held > 0.0_dp .and. tangential < (1.0_dp - unused)*sub%hot(q, kernels%friction_row, g)*held) status = sticking
      end if
      value(1) = sub%normal_impulse(c)/simulation%physics%h
      value(2) = tangential/simulation%physics%h
      value(3) = sub%gap(c)
      value(4) = real(status, dp)
    end associate
  end subroutine value_contact

end module gravier_picture_files
