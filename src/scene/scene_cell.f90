!> A periodic cell that deforms: what moves it, and scenes that cannot stand in one.
module gravier_scene_cell
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_periodic, only: period_t
  use gravier_cell_drive, only: cell_drive_t
  use gravier_config_types, only: config_t, scene_config_t
  implicit none
  private
  public :: cell_moves, make_cell_drive, check_cell

  character(len=1), parameter :: axes(3) = ["x", "y", "z"]
  !> a component along each of the entries of a shear: row and column of the velocity gradient
  integer, parameter :: row(3) = [1, 1, 2], column(3) = [2, 3, 3]
  !> subdomains whose partition every rank knows whole
  integer, parameter :: most_subdomains = 4096

contains

  !> Whether the input moves the cell.
  pure logical function cell_moves(config)
    type(scene_config_t), intent(in) :: config

    cell_moves = any(abs(config%cell_strain_rate) > 0.0_dp) .or. any(abs(config%cell_shear_rate) > 0.0_dp) .or. &
      & any(config%cell_pressure > 0.0_dp) .or. any(abs(config%cell_shear_stress) > 0.0_dp)
  end function cell_moves

  !> What moves the cell. A shear stress drives the cell along itself: it is held where the contacts resist with a negative
  !> component of the mean stress, in which compression is positive.
  pure subroutine make_cell_drive(config, drive)
    type(scene_config_t), intent(in) :: config
    type(cell_drive_t), intent(out) :: drive
    integer :: d

    drive%inertia = config%cell_inertia
    do d = 1, 3
      drive%rate(d, d) = config%cell_strain_rate(d)
      drive%stress(d, d) = config%cell_pressure(d)
      drive%driven(d, d) = config%cell_pressure(d) > 0.0_dp
      drive%rate(row(d), column(d)) = config%cell_shear_rate(d)
      drive%stress(row(d), column(d)) = -config%cell_shear_stress(d)
      drive%driven(row(d), column(d)) = abs(config%cell_shear_stress(d)) > 0.0_dp
    end do
  end subroutine make_cell_drive

  !> Refuse cells that move along axes without a period, and what does not go with them.
  subroutine check_cell(config, period, n_boundaries, error)
    type(config_t), intent(in) :: config
    type(period_t), intent(in) :: period
    integer, intent(in) :: n_boundaries
    type(error_t), allocatable, intent(inout) :: error
    integer :: d

    if (.not. cell_moves(config%scene)) return
    associate (scene => config%scene, length => period%length)
      do d = 1, 3
        call check_axis(abs(scene%cell_strain_rate(d)) > 0.0_dp .or. scene%cell_pressure(d) > 0.0_dp, "cell_strain_rate", d, d)
        call check_axis(abs(scene%cell_shear_rate(d)) > 0.0_dp .or. abs(scene%cell_shear_stress(d)) > 0.0_dp, &
          & "cell_shear_rate", row(d), column(d))
      end do
      if (n_boundaries > 0) call refuse("&boundary", "a cell without boundaries and outlets")
      if (size(config%insertions) > 0) call refuse("&insertion", "a cell that no grains enter")
      if (size(config%regions) > 0) call refuse("&region", "no regions of means")
      if (config%solver%sleeping) call refuse("&solver sleeping = .true.", ".false.")
      if (config%solver%method == "newton" .and. (any(scene%cell_pressure > 0.0_dp) .or. &
        & any(abs(scene%cell_shear_stress) > 0.0_dp))) call refuse("&solver method = 'newton'", &
        & "a method that sweeps where stresses drive the cell")
      if (config%output%final_bodies .and. (any(abs(scene%cell_shear_rate) > 0.0_dp) .or. &
        & any(abs(scene%cell_shear_stress) > 0.0_dp))) call refuse("&output final_bodies = .true.", &
        & ".false., since a bodies file holds no sheared cell")
      if (config%decomposition%subdomains > most_subdomains) call refuse("&decomposition subdomains = "// &
        & to_text(config%decomposition%subdomains), to_text(most_subdomains)//" at most")
    end associate

  contains

    subroutine check_axis(moves, key, a, b)
      logical, intent(in) :: moves
      character(len=*), intent(in) :: key
      integer, intent(in) :: a, b
      integer :: axis

      if (.not. moves .or. (period%length(a) > 0.0_dp .and. period%length(b) > 0.0_dp)) return
      axis = merge(b, a, period%length(a) > 0.0_dp)
      call raise(error, status_input, config%file//": &scene "//key//", or a stress in its place: expected a period along "// &
        & axes(axis))
    end subroutine check_axis

    subroutine refuse(what, expected)
      character(len=*), intent(in) :: what, expected

      call raise(error, status_input, config%file//": "//what//": expected "//expected//" in a periodic cell that moves")
    end subroutine refuse

  end subroutine check_cell

end module gravier_scene_cell
