!> A periodic cell that deforms: what moves it, and scenes that cannot stand in one.
module gravier_scene_cell
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_periodic, only: period_t
  use gravier_body_store, only: body_set_t
  use gravier_bodies_data, only: bodies_data_t
  use gravier_cell_drive, only: cell_drive_t, cell_components, cell_component, component_row, component_column, stress_sign, &
    & carry_bodies
  use gravier_config_types, only: config_t, scene_config_t
  implicit none
  private
  public :: cell_moves, make_cell_drive, set_period, stop_cell, check_cell, rate_columns, stress_columns

  character(len=1), parameter :: axes(3) = ["x", "y", "z"]
  !> columns of a table: the rate of a component, and the stress in its place
  character(len=*), parameter :: rate_columns(6) = [character(len=15) :: "strain_rate_x", "strain_rate_y", "strain_rate_z", &
    & "shear_rate_xy", "shear_rate_xz", "shear_rate_yz"]
  character(len=*), parameter :: stress_columns(6) = [character(len=15) :: "pressure_x", "pressure_y", "pressure_z", &
    & "shear_stress_xy", "shear_stress_xz", "shear_stress_yz"]
  !> subdomains whose partition every rank knows whole
  integer, parameter :: most_subdomains = 4096

contains

  !> Whether the input moves the cell.
  pure logical function cell_moves(config)
    type(scene_config_t), intent(in) :: config

    cell_moves = any(abs(config%cell_strain_rate) > 0.0_dp) .or. any(abs(config%cell_shear_rate) > 0.0_dp) .or. &
      & any(config%cell_pressure > 0.0_dp) .or. any(abs(config%cell_shear_stress) > 0.0_dp) .or. config%cell_table /= ""
  end function cell_moves

  !> What moves the cell. Failure: status_input, of a table. Not collective.
  subroutine make_cell_drive(config, drive, error)
    type(config_t), intent(in) :: config
    type(cell_drive_t), intent(out) :: drive
    type(error_t), allocatable, intent(inout) :: error
    integer :: d

    associate (scene => config%scene)
      drive%inertia = scene%cell_inertia
      do d = 1, 3
        drive%rate(d, d) = scene%cell_strain_rate(d)
        drive%stress(d, d) = stress_sign(d, d)*scene%cell_pressure(d)
        drive%driven(d, d) = scene%cell_pressure(d) > 0.0_dp
        associate (a => component_row(3 + d), b => component_column(3 + d))
          drive%rate(a, b) = scene%cell_shear_rate(d)
          drive%stress(a, b) = stress_sign(a, b)*scene%cell_shear_stress(d)
          drive%driven(a, b) = abs(scene%cell_shear_stress(d)) > 0.0_dp
        end associate
      end do
      if (scene%cell_table /= "") call read_table(config, drive, error)
    end associate
  end subroutine make_cell_drive

  !> Read the table of rates and stresses. A component has one column, and no key beside it.
  subroutine read_table(config, drive, error)
    type(config_t), intent(in) :: config
    type(cell_drive_t), intent(inout) :: drive
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: names
    logical :: moved(3, 3)
    integer :: c, k, n

    associate (nd => config%scene%dimension, table => drive%table)
      moved(:, :) = drive%moved(nd)
      n = cell_components(nd)
      names = trim(rate_columns(1))
      do k = 2, n
        names = names//" "//trim(rate_columns(cell_component(k, nd)))
      end do
      do k = 1, n
        names = names//" "//trim(stress_columns(cell_component(k, nd)))
      end do
      call table%read(trim(config%scene%cell_table), names, config%scene%cell_table_repeats, error)
      if (allocated(error)) return
      do k = 1, n
        if (.not. (table%has(k) .or. table%has(n + k))) cycle
        c = cell_component(k, nd)
        if (table%has(k) .and. table%has(n + k)) call refuse("columns "//trim(rate_columns(c))//" and "//trim(stress_columns(c)), &
          & "one of them")
        if (moved(component_row(c), component_column(c))) call refuse("column "//trim(merge(rate_columns(c), stress_columns(c), &
          & table%has(k))), "none, since a key of &scene moves this component of the cell")
        if (c <= 3 .and. any(table%value(n + k, :) < 0.0_dp)) call refuse("column "//trim(stress_columns(c))//": "// &
          & to_text(minval(table%value(n + k, :)), 4), "pressures >= 0")
        drive%driven(component_row(c), component_column(c)) = table%has(n + k)
      end do
    end associate

  contains

    subroutine refuse(what, expected)
      character(len=*), intent(in) :: what, expected

      call raise(error, status_input, trim(config%scene%cell_table)//": "//what//": expected "//expected)
    end subroutine refuse

  end subroutine read_table

  !> The period of the input file, else that of the bodies file, whose cell may be sheared and may move. Not collective.
  subroutine set_period(config, data, period, error)
    type(config_t), intent(in) :: config
    type(bodies_data_t), intent(in) :: data
    type(period_t), intent(inout) :: period
    type(error_t), allocatable, intent(inout) :: error
    integer :: turns(3)

    period%moves = cell_moves(config%scene) .or. any(abs(data%tilt) > 0.0_dp)
    period%length(:) = config%scene%period
    period%origin(:) = config%scene%period_origin
    if (period%on() .and. data%has_edges) call raise(error, status_input, config%file//": &scene period: expected none, since "// &
      & trim(config%scene%bodies_file)//" has the edges of the cell")
    if (period%on() .or. .not. data%has_box) return
    period%length(:) = data%period
    period%origin(:) = data%origin
    period%tilt(:) = data%tilt
    period%length_rate(:) = data%length_rate
    period%tilt_rate(:) = data%tilt_rate
    call period%straighten(turns)
  end subroutine set_period

  !> Stop a cell that moved and stays as it is from now on. Its grains are carried along with the change of its velocity.
  subroutine stop_cell(period, grains)
    type(period_t), intent(inout) :: period
    type(body_set_t), intent(inout) :: grains
    real(dp) :: centre(3), change(3, 3)

    if (.not. (any(abs(period%length_rate) > 0.0_dp) .or. any(abs(period%tilt_rate) > 0.0_dp))) return
    centre(:) = period%centre()
    change(:, :) = period%gradient()
    change(:, :) = -change
    call carry_bodies(centre, change, grains)
    period%length_rate(:) = 0.0_dp
    period%tilt_rate(:) = 0.0_dp
  end subroutine stop_cell

  !> Refuse cells that move along axes without a period, and what does not go with them.
  subroutine check_cell(config, drive, period, n_boundaries, error)
    type(config_t), intent(in) :: config
    type(cell_drive_t), intent(in) :: drive
    type(period_t), intent(in) :: period
    integer, intent(in) :: n_boundaries
    type(error_t), allocatable, intent(inout) :: error
    logical :: moved(3, 3)
    integer :: d

    moved(:, :) = drive%moved(config%scene%dimension)
    do d = 1, 3
      call check_stop("strain", d, d, config%time%stop_cell_strain(d))
      call check_stop("shear", component_row(3 + d), component_column(3 + d), config%time%stop_cell_shear(d))
    end do
    if (.not. period%moves) return
    do d = 1, 3
      if (moved(d, d)) call check_axis("strain", d, d)
      associate (a => component_row(3 + d), b => component_column(3 + d))
        if (moved(a, b)) call check_axis("shear", a, b)
      end associate
    end do
    if (n_boundaries > 0) call refuse("&boundary", "no boundaries and outlets")
    if (size(config%insertions) > 0) call refuse("&insertion", "no insertion of grains")
    if (size(config%regions) > 0) call refuse("&region", "no regions of means")
    if (config%solver%sleeping) call refuse("&solver sleeping = .true.", ".false.")
    if (config%solver%method == "newton" .and. any(drive%driven)) call raise(error, status_input, config%file// &
      & ": &solver method = 'newton': expected another method where stresses drive the periodic cell")
    if (config%decomposition%subdomains > most_subdomains) call refuse("&decomposition subdomains = "// &
      & to_text(config%decomposition%subdomains), to_text(most_subdomains)//" at most")

  contains

    !> A strain that ends the run is that of a component that moves. What the keys of a case say of it was checked before.
    subroutine check_stop(kind, a, b, ends)
      character(len=*), intent(in) :: kind
      integer, intent(in) :: a, b
      real(dp), intent(in) :: ends

      if (abs(ends) > 0.0_dp .and. .not. moved(a, b)) call raise(error, status_input, config%file//": &time stop_cell_"//kind// &
        & ": expected 0 for components of the cell that neither a key of &scene nor "//trim(config%scene%cell_table)//" moves")
    end subroutine check_stop

    subroutine check_axis(kind, a, b)
      character(len=*), intent(in) :: kind
      integer, intent(in) :: a, b
      integer :: axis

      if (period%length(a) > 0.0_dp .and. period%length(b) > 0.0_dp) return
      axis = merge(b, a, period%length(a) > 0.0_dp)
      call raise(error, status_input, config%file//": &scene cell_"//kind//"_rate, or a stress in its place: expected a period "// &
        & "along "//axes(axis))
    end subroutine check_axis

    subroutine refuse(what, expected)
      character(len=*), intent(in) :: what, expected

      call raise(error, status_input, config%file//": "//what//": expected "//expected//" in a periodic cell that "// &
        & trim(merge("moves     ", "is sheared", cell_moves(config%scene))))
    end subroutine refuse

  end subroutine check_cell

end module gravier_scene_cell
