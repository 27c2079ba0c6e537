!> history.csv: a row a step, or each few steps and where something is counted, the columns of the diagnostics last.
module gravier_history_output
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_schedule, only: schedule_t
  use gravier_csv_writer, only: csv_writer_t, csv_option_t
  use gravier_solve_report, only: solve_converged
  use gravier_config_types, only: config_t
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_output, only: output_t, of_each_step
  implicit none
  private
  public :: history_output_t, open_table

  !> columns of a cell that moves, as far as a scene has them: its strains and its shears
  character(len=*), parameter :: strains(3) = [character(len=13) :: "cell_strain_x", "cell_strain_y", "cell_strain_z"], &
    & shears(3) = [character(len=13) :: "cell_shear_xy", "cell_shear_xz", "cell_shear_yz"], axes = "xyz"

  type, extends(output_t) :: history_output_t
    private
    type(csv_writer_t) :: table
  contains
    procedure, nopass :: wanted => history_output_wanted
    procedure, nopass :: files => history_output_files
    procedure :: open => history_output_open
    procedure :: write => history_output_write
    procedure :: sync => history_output_sync
    procedure :: finish => history_output_finish
  end type history_output_t

  !> with which the history has columns more
  type(csv_option_t), parameter :: column_options(10) = [csv_option_t("entered", "&insertion"), &
    & csv_option_t("kinetic_translation", "&output energy"), csv_option_t("stress_", "&output stress"), &
    & csv_option_t("coordination", "&output structure"), &
    & csv_option_t("force_x:", "&output boundary_forces"), csv_option_t("moment_", "&output boundary_moments"), &
    & csv_option_t("velocity_x:", "&output boundary_power"), &
    & csv_option_t("bonds", "&output bonds"), &
    & csv_option_t("body_", "&output tracked_bodies"), csv_option_t("body_f", "&output tracked_forces")]

contains

  !> Every run has one.
  pure logical function history_output_wanted(config) result(wanted)
    type(config_t), intent(in) :: config
    wanted = config%output%every >= 0
  end function history_output_wanted

  pure function history_output_files(config) result(names)
    type(config_t), intent(in) :: config
    character(len=:), allocatable :: names

    associate (unused => config)
    end associate
    names = "history.csv"
  end function history_output_files

  subroutine history_output_open(self, simulation, directory, command, error)
    class(history_output_t), intent(inout) :: self
    type(simulation_t), intent(in) :: simulation
    character(len=*), intent(in) :: directory, command
    type(error_t), allocatable, intent(inout) :: error

    associate (unused => command)
    end associate
    self%stage = of_each_step
    self%schedule = schedule_t(every=1)
    self%table%every = simulation%config%output%history_every
    call open_table(self%table, directory, "history.csv", history_header(simulation), simulation, error)
  end subroutine history_output_open

  !> Begin a table, or go on with it behind the step of the simulation. Rank 0 writes, and may fail.
  subroutine open_table(table, directory, name, header, simulation, error)
    type(csv_writer_t), intent(inout) :: table
    character(len=*), intent(in) :: directory, name, header
    type(simulation_t), intent(in) :: simulation
    type(error_t), allocatable, intent(inout) :: error

    if (simulation%comm%rank /= 0) return
    if (simulation%goes_on_with(name)) then
      call table%resume(directory//name, header, simulation%step, error, column_options)
    else
      call table%open(directory//name, header, error)
    end if
  end subroutine open_table

  !> Names of the columns, in the order in which `history_output_write` adds their cells.
  pure function history_header(simulation) result(header)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: header
    integer :: k

    header = "step,time,contacts,iterations,sweeps,residual,velocity_error,velocity_scale,jump,max_overlap,"// &
      & "kinetic_energy,wall_seconds,interface_bodies,converged,grains,left,fast,listed,divided,projected,"// &
      & "exchange_messages,exchange_values,most_messages,most_values,ghosts,solve_seconds,sleeping,woken"
    if (simulation%effects%removal) header = header//",left_mass"
    if (simulation%inflow%exists()) header = header//",entered,entered_mass"
    if (simulation%decomposition%period%moves) then
      do k = 1, simulation%decomposition%nd
        header = header//","//strains(k)
      end do
      do k = 1, merge(1, 3, simulation%decomposition%nd == 2)
        header = header//","//shears(k)
      end do
    end if
    if (allocated(simulation%gravity_table%has)) then
      do k = 1, simulation%decomposition%nd
        header = header//",gravity_"//axes(k:k)
      end do
    end if
    do k = 1, simulation%diagnostics%n_columns
      if (simulation%diagnostics%in_history(k)) header = header//","//trim(simulation%diagnostics%name(k))
    end do
  end function history_header

  !> Write the row of a step, on rank 0.
  subroutine history_output_write(self, simulation, figures, seconds, error)
    class(history_output_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: simulation
    type(step_figures_t), intent(in) :: figures
    real(dp), intent(in) :: seconds
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: strain(3)
    integer :: k

    if (simulation%comm%rank /= 0) return
    associate (table => self%table, solve => figures%solve, interface_statistics => figures%interface_statistics)
      call table%drop_row()
      call table%add(simulation%step)
      call table%add(simulation%time)
      call table%add(figures%contacts)
      call table%add(solve%iterations)
      call table%add(solve%iterations*simulation%config%solver%sweeps)
      call table%add(solve%residual)
      call table%add(solve%velocity_error)
      call table%add(solve%velocity_scale)
      call table%add(solve%jump)
      call table%add(figures%max_overlap)
      call table%add(figures%kinetic_energy)
      call table%add(seconds)
      call table%add(interface_statistics%bodies)
      call table%add(merge(1, 0, solve%status == solve_converged))
      call table%add(simulation%n_grains)
      call table%add(figures%left)
      call table%add(figures%fast)
      call table%add(merge(1, 0, figures%listed))
      call table%add(merge(1, 0, figures%divided))
      call table%add(merge(1, 0, figures%projected))
      call table%add(interface_statistics%neighbours)
      call table%add(interface_statistics%values)
      call table%add(interface_statistics%most_neighbours)
      call table%add(interface_statistics%most_values)
      call table%add(interface_statistics%ghosts)
      call table%add(solve%seconds)
      call table%add(figures%asleep)
      call table%add(figures%tries - 1)
      if (simulation%effects%removal) call table%add(figures%left_mass)
      if (simulation%inflow%exists()) then
        call table%add(figures%entered)
        call table%add(figures%entered_mass)
      end if
      if (simulation%decomposition%period%moves) then
        strain(:) = simulation%cell_strain()
        do k = 1, simulation%decomposition%nd
          call table%add(strain(k))
        end do
        do k = 1, merge(1, 3, simulation%decomposition%nd == 2)
          call table%add(simulation%decomposition%period%shear(k))
        end do
      end if
      if (allocated(simulation%gravity_table%has)) then
        do k = 1, simulation%decomposition%nd
          call table%add(simulation%physics%gravity(k))
        end do
      end if
      do k = 1, simulation%diagnostics%n_columns
        if (simulation%diagnostics%in_history(k)) call table%add(simulation%diagnostics%value(k))
      end do
      ! another row waits, since it may be that of the last step
      if (mod(simulation%step, table%every) == 0 .or. simulation%step == 1 .or. counts_something(figures)) call table%end_row(error)
    end associate
  end subroutine history_output_write

  !> Whether a step has counts that are added up over rows, or a solve that missed its goal: such a step has a row in any case.
  pure logical function counts_something(figures) result(counts)
    type(step_figures_t), intent(in) :: figures
    counts = figures%left > 0 .or. figures%entered > 0 .or. figures%fast > 0 .or. figures%solve%status /= solve_converged
  end function counts_something

  subroutine history_output_sync(self, error)
    class(history_output_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    call self%table%sync(error)
  end subroutine history_output_sync

  subroutine history_output_finish(self, error)
    class(history_output_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    call self%table%keep_row(error)
    call self%table%close(error)
  end subroutine history_output_finish

end module gravier_history_output
