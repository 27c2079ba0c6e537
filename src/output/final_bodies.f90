!> final_bodies.h5: the bodies of a simulation and the forces between them as a bodies file from which another scene starts.
module gravier_final_bodies
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_config_types, only: config_t
  use gravier_bodies_data, only: bodies_data_t, allocate_bodies, allocate_shapes, allocate_walls
  use gravier_bodies_hdf5, only: write_bodies_hdf5, holds_bodies
  use gravier_contact_forces, only: list_forces
  use gravier_surface_registry, only: wall_of_bodies
  use gravier_scene_boundaries, only: wall_name
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_output, only: output_t, of_end
  implicit none
  private
  public :: write_final_bodies, final_bodies_output_t

  type, extends(output_t) :: final_bodies_output_t
    private
    character(len=:), allocatable :: path
  contains
    procedure, nopass :: wanted => final_bodies_wanted
    procedure, nopass :: files => final_bodies_files
    procedure :: open => final_bodies_open
    procedure :: write => final_bodies_write
  end type final_bodies_output_t

contains

  pure logical function final_bodies_wanted(config) result(wanted)
    type(config_t), intent(in) :: config
    wanted = config%output%final_bodies
  end function final_bodies_wanted

  pure function final_bodies_files(config) result(names)
    type(config_t), intent(in) :: config
    character(len=:), allocatable :: names

    associate (unused => config)
    end associate
    names = "final_bodies.h5"
  end function final_bodies_files

  subroutine final_bodies_open(self, simulation, directory, command, error)
    class(final_bodies_output_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    character(len=*), intent(in) :: directory, command
    type(error_t), allocatable, intent(inout) :: error

    associate (unused => simulation, unused_command => command, unused_error => error)
    end associate
    self%stage = of_end
    self%path = directory//"final_bodies.h5"
  end subroutine final_bodies_open

  subroutine final_bodies_write(self, simulation, figures, seconds, error)
    class(final_bodies_output_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: simulation
    type(step_figures_t), intent(in) :: figures
    real(dp), intent(in) :: seconds
    type(error_t), allocatable, intent(inout) :: error

    associate (unused => figures, unused_seconds => seconds)
    end associate
    call write_final_bodies(simulation, self%path, simulation%config%output%final_forces, "gravier", error)
  end subroutine final_bodies_write

  !> Write grains with their shapes, the walls that came with them, where they are now, the period and, on request, the contacts
  !> that press, with their forces. Other boundaries of the input file are not written: the next input file has its own. Contacts
  !> name them. A run that goes on from a checkpoint and makes no step knows no forces: a file that holds its state already is left
  !> as it is. Collective; errors are the same on all ranks.
  subroutine write_final_bodies(simulation, path, with_forces, made_by, error)
    type(simulation_t), intent(in) :: simulation
    character(len=*), intent(in) :: path
    !> those of the last step, where this run has made one
    logical, intent(in) :: with_forces
    !> the program
    character(len=*), intent(in) :: made_by
    type(error_t), allocatable, intent(inout) :: error
    type(bodies_data_t) :: data
    integer, allocatable :: walls(:)
    integer :: s, k, n, nd, nv, w

    if (allocated(error)) return
    associate (decomposition => simulation%decomposition)
      nd = decomposition%nd
      nv = decomposition%nv
      call allocate_bodies(data, nd, sum(decomposition%owned%n), .true., path, error)
      if (decomposition%no > 0) call allocate_shapes(data, path, error)
      call find_walls(simulation, walls)
      call allocate_walls(data, nd, size(walls), path, error)
      call simulation%comm%agree(error)
      if (allocated(error)) return
      data%made_by = made_by
      data%total = simulation%n_grains
      n = 0
      do s = 1, size(decomposition%owned)
        associate (owned => decomposition%owned(s))
          do k = 1, owned%n
            n = n + 1
            data%id(n) = owned%id(k)
            data%position(:, n) = owned%position(:, k)
            data%velocity(1:nv, n) = owned%velocity(:, k)
            data%radius(n) = owned%radius(k)
            data%mass(n) = owned%mass(k)
            data%material(n) = owned%material(k)
            if (owned%no > 0) then
              data%shape(n) = owned%shape(k)
              data%orientation(:, n) = owned%orientation(:, k)
            end if
            if (owned%glued(k) > 0) data%group(n) = decomposition%boundaries(owned%glued(k))%group
          end do
        end associate
      end do
      do w = 1, size(walls)
        associate (wall => decomposition%boundaries(walls(w)))
          data%wall_id(w) = wall%id
          data%wall_point(:, w) = wall%surface%point(1:nd)
          data%wall_normal(:, w) = wall%surface%axis(1:nd)
        end associate
      end do
      data%has_box = decomposition%period%on()
      data%origin(:) = decomposition%period%origin
      data%period(:) = decomposition%period%length
      data%has_edges = decomposition%period%moves
      data%tilt(:) = decomposition%period%tilt
      data%length_rate(:) = decomposition%period%length_rate
      data%tilt_rate(:) = decomposition%period%tilt_rate
      if (allocated(simulation%problem%sub)) then
        if (with_forces) call list_forces(simulation%problem, decomposition, simulation%halo, simulation%physics%h, data%contacts)
      else if (simulation%restarted) then
        if (holds_bodies(simulation%comm, path, decomposition%shapes, data)) return
      end if
      do w = 1, size(walls)
        associate (wall => decomposition%boundaries(walls(w)))
          call data%contacts%rename_boundary(wall%name, wall_name(wall%id))
        end associate
      end do
      call write_bodies_hdf5(simulation%comm, path, data, error, decomposition%shapes)
    end associate
  end subroutine write_final_bodies

  !> Numbers of the boundaries that are walls of the bodies: those that no group of the case is, and of those that one is what has
  !> not been removed.
  pure subroutine find_walls(simulation, walls)
    type(simulation_t), intent(in) :: simulation
    integer, allocatable, intent(out) :: walls(:)
    logical :: is_wall(size(simulation%decomposition%boundaries))
    integer :: b, n

    n = simulation%n_walls
    is_wall(:) = simulation%decomposition%boundaries%present
    do b = 1, size(simulation%config%boundaries)
      if (simulation%config%boundaries(b)%shape /= wall_of_bodies) is_wall(n + b) = .false.
    end do
    allocate (walls(count(is_wall)))
    n = 0
    do b = 1, size(is_wall)
      if (.not. is_wall(b)) cycle
      n = n + 1
      walls(n) = b
    end do
  end subroutine find_walls

end module gravier_final_bodies
