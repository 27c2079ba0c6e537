!> A periodic cell that moves in the loop of a user: its edges, and the rates and stresses that move it.
module gravier_user_cell
  use gravier_kinds, only: dp
  use gravier_text, only: text_from
  use gravier_errors, only: error_t, raise, status_input
  use gravier_magnitude, only: is_bounded, bounded_text
  use gravier_cell_drive, only: cell_components, cell_component, component_row, component_column, stress_sign
  use gravier_scene_cell, only: rate_columns, stress_columns
  use gravier_user_loop, only: user_loop_t, numbers_text
  implicit none
  private
  public :: get_cell, set_cell

  character(len=*), parameter :: lengths(3) = ["length_x", "length_y", "length_z"], tilts(3) = ["tilt_xy", "tilt_xz", "tilt_yz"], &
    & strains(3) = ["strain_x", "strain_y", "strain_z"], shears(3) = ["shear_xy", "shear_xz", "shear_yz"]
  character(len=*), parameter :: still_text = "cell: that of the scene does not move; expected a periodic cell that moves in "// &
    & "the case"

contains

  !> A quantity of the cell now: a length or a tilt of its edges [m], a strain or a shear since the start of the scene, a rate
  !> [1/s], or a stress that is held [Pa, N/m in 2D], 0 where a component has a rate. Failure (status_input): an unknown name, a
  !> cell that does not move.
  subroutine get_cell(loop, name, value, error)
    type(user_loop_t), intent(in) :: loop
    character(len=*), intent(in) :: name
    real(dp), intent(out) :: value
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: gradient(3, 3), strain(3)
    integer :: c, k

    value = 0.0_dp
    associate (simulation => loop%run%simulation, nd => loop%run%simulation%decomposition%nd)
      if (.not. simulation%decomposition%period%moves) call raise(error, status_input, still_text)
      if (allocated(error)) return
      gradient(:, :) = simulation%decomposition%period%gradient()
      strain(:) = simulation%cell_strain()
      do k = 1, cell_components(nd)
        c = cell_component(k, nd)
        associate (a => component_row(c), b => component_column(c))
          if (name == rate_columns(c)) value = gradient(a, b)
          if (name == stress_columns(c) .and. simulation%cell_drive%driven(a, b)) value = stress_sign(a, b)* &
            & simulation%cell_drive%stress(a, b)
          if (a == b) then
            if (name == lengths(c)) value = simulation%decomposition%period%length(c)
            if (name == strains(c)) value = strain(c)
          else
            if (name == tilts(c - 3)) value = simulation%decomposition%period%tilt(c - 3)
            if (name == shears(c - 3)) value = simulation%decomposition%period%shear(c - 3)
          end if
        end associate
      end do
      if (.not. is_known(name, nd)) call raise(error, status_input, "cell: "//name//": unknown; expected one of "//known(nd))
    end associate
  end subroutine get_cell

  !> Set a rate, or a stress that is held, from the next step on. Failures (status_input): an unknown name, a cell that does not
  !> move, a component that is moved in another way or by a table or across an axis without a period, a number that is none to
  !> reckon with, a pressure below 0.
  subroutine set_cell(loop, name, value, error)
    type(user_loop_t), intent(inout) :: loop
    character(len=*), intent(in) :: name
    real(dp), intent(in) :: value
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: values(1)
    integer :: c, k, n

    associate (drive => loop%run%simulation%cell_drive, nd => loop%run%simulation%decomposition%nd, &
      & period => loop%run%simulation%decomposition%period)
      if (.not. period%moves) call raise(error, status_input, still_text)
      n = cell_components(nd)
      do k = n, 1, -1
        if (name == rate_columns(cell_component(k, nd)) .or. name == stress_columns(cell_component(k, nd))) exit
      end do
      if (index(settable(nd)//",", " "//name//",") == 0) call raise(error, status_input, "cell: "//name//" cannot be set; "// &
        & "expected one of"//settable(nd))
      if (.not. is_bounded(value)) call raise(error, status_input, "cell: "//name//" is not a number to reckon with; expected "// &
        & bounded_text)
      if (allocated(error)) return
      c = cell_component(k, nd)
      associate (a => component_row(c), b => component_column(c), is_rate => name == rate_columns(c))
        if (allocated(drive%table%has)) then
          if (drive%table%has(k) .or. drive%table%has(n + k)) call raise(error, status_input, "cell: "//name// &
            & ": cell_table moves this component; expected a table without it")
        end if
        if (is_rate .and. drive%driven(a, b)) call raise(error, status_input, "cell: "//name// &
          & ": a stress drives this component; expected "//trim(stress_columns(c)))
        if (.not. (is_rate .or. drive%driven(a, b))) call raise(error, status_input, "cell: "//name// &
          & ": no stress drives this component in the case; expected "//trim(rate_columns(c)))
        if (.not. (period%length(a) > 0.0_dp .and. period%length(b) > 0.0_dp)) call raise(error, status_input, "cell: "//name// &
          & ": expected a component along axes that are periodic")
        if (.not. is_rate .and. a == b .and. value < 0.0_dp) call raise(error, status_input, "cell: "//name// &
          & ": expected a pressure >= 0")
        if (allocated(error)) return
        if (is_rate) drive%rate(a, b) = value
        if (.not. is_rate) drive%stress(a, b) = stress_sign(a, b)*value
      end associate
    end associate
    values(1) = value
    call loop%note("cell "//name, 0, values)
    call loop%note_setting(name//" of the cell", numbers_text(values))
  end subroutine set_cell

  !> What a cell of `nd` dimensions has by name.
  pure logical function is_known(name, nd)
    character(len=*), intent(in) :: name
    integer, intent(in) :: nd
    is_known = index(" "//known(nd)//",", " "//name//",") > 0
  end function is_known

  pure function known(nd) result(names)
    integer, intent(in) :: nd
    character(len=:), allocatable :: names
    integer :: c, k

    names = settable(nd)
    do k = 1, cell_components(nd)
      c = cell_component(k, nd)
      if (c <= 3) names = names//", "//trim(lengths(c))//", "//trim(strains(c))
      if (c > 3) names = names//", "//trim(tilts(c - 3))//", "//trim(shears(c - 3))
    end do
    names = text_from(names, 2)
  end function known

  !> With a blank before each of them.
  pure function settable(nd) result(names)
    integer, intent(in) :: nd
    character(len=:), allocatable :: names
    integer :: k

    names = ""
    do k = 1, cell_components(nd)
      names = names//" "//trim(rate_columns(cell_component(k, nd)))//", "//trim(stress_columns(cell_component(k, nd)))//","
    end do
    names = names(:len(names) - 1)
  end function settable

end module gravier_user_cell
