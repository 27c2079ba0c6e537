!> What the log says of a periodic cell that moves or is sheared: its edges and what moves it before a run, its strains after it.
module gravier_cell_lines
  use gravier_kinds, only: dp
  use gravier_text, only: to_text
  use gravier_cell_drive, only: cell_components, cell_component, component_row, component_column, stress_sign
  use gravier_scene_cell, only: rate_columns, stress_columns
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: cell_start_lines, cell_strain_lines

  character(len=*), parameter :: newline = new_line("a")
  character(len=1), parameter :: axes(3) = ["x", "y", "z"]
  character(len=2), parameter :: planes(3) = ["xy", "xz", "yz"]
  !> digits of numbers
  integer, parameter :: digits = 4

contains

  !> Lengths and tilts of the edges, and the rates and stresses that move them; a line, or nothing where the cell stays as it is.
  function cell_start_lines(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text, drives
    integer :: c, d, k, n

    text = ""
    associate (period => simulation%decomposition%period, drive => simulation%cell_drive, nd => simulation%decomposition%nd)
      if (.not. period%moves) return
      n = cell_components(nd)
      do d = 1, nd
        text = text//", "//axes(d)//" "//to_text(period%length(d), digits)
      end do
      text = "cell        lengths [m]: "//text(3:)
      if (any(abs(period%tilt) > 0.0_dp)) then
        text = text//"; tilts [m]: "//planes(1)//" "//to_text(period%tilt(1), digits)
        do k = 2, merge(1, 3, nd == 2)
          text = text//", "//planes(k)//" "//to_text(period%tilt(k), digits)
        end do
      end if
      drives = ""
      do k = 1, n
        c = cell_component(k, nd)
        associate (a => component_row(c), b => component_column(c))
          if (in_table(k)) then
            drives = drives//", "//trim(rate_columns(c))//" of the table"
          else if (in_table(n + k)) then
            drives = drives//", "//trim(stress_columns(c))//" of the table"
          else if (drive%driven(a, b)) then
            drives = drives//", "//trim(stress_columns(c))//" = "//to_text(stress_sign(a, b)*drive%stress(a, b), digits)// &
              & unit(nd)
          else if (abs(drive%rate(a, b)) > 0.0_dp) then
            drives = drives//", "//trim(rate_columns(c))//" = "//to_text(drive%rate(a, b), digits)//" 1/s"
          end if
        end associate
      end do
      if (drives == "") drives = "  nothing"
      text = text//"; moved by "//drives(3:)//newline
    end associate

  contains

    logical function in_table(column)
      integer, intent(in) :: column

      in_table = .false.
      if (allocated(simulation%cell_drive%table%has)) in_table = simulation%cell_drive%table%has(column)
    end function in_table

  end function cell_start_lines

  !> Strains and shears since the start of the scene; a line, or nothing where the cell does not move.
  function cell_strain_lines(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text
    real(dp) :: strain(3)
    integer :: d

    text = ""
    if (.not. simulation%decomposition%period%moves) return
    strain(:) = simulation%cell_strain()
    text = ""
    associate (nd => simulation%decomposition%nd)
      do d = 1, nd
        text = text//", "//axes(d)//" "//to_text(strain(d), digits)
      end do
      text = "cell        since the start of the scene strained by "//text(3:)//" and sheared by "//planes(1)//" "// &
        & to_text(simulation%decomposition%period%shear(1), digits)
      do d = 2, merge(1, 3, nd == 2)
        text = text//", "//planes(d)//" "//to_text(simulation%decomposition%period%shear(d), digits)
      end do
    end associate
    text = text//newline
  end function cell_strain_lines

  pure function unit(nd) result(text)
    integer, intent(in) :: nd
    character(len=:), allocatable :: text
    text = trim(merge(" N/m", " Pa ", nd == 2))
  end function unit

end module gravier_cell_lines
