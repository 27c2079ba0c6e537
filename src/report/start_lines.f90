!> What the log of a run begins with: the program, the scene, its decomposition and what its effects cost.
module gravier_start_lines
  use gravier_kinds, only: i8
  use gravier_text, only: to_text, text_from
  use gravier_communicator, only: mpi_library
  use gravier_boundary, only: boundary_t
  use gravier_build_info, only: version, revision, compiler, build_type, hdf5_version, mumps_version, metis_version
  use gravier_effects, only: effects_t, n_effects, effect_name_length
  use gravier_simulation, only: simulation_t
  use gravier_memory_report, only: item_bytes
  use gravier_cell_lines, only: cell_start_lines
  implicit none
  private
  public :: banner_text, start_lines

  character(len=*), parameter :: newline = new_line("a")

contains

  !> Name, version and libraries of the program, in lines.
  function banner_text() result(text)
    character(len=:), allocatable :: text
    text = "Gravier "//version//" ("//revision//"), dense granular matter by nonsmooth contact dynamics"//newline// &
      & "built by "//compiler//", "//build_type//"; "//mpi_library()//", HDF5 "//hdf5_version//", MUMPS "//mumps_version// &
      & ", METIS "//metis_version//newline
  end function banner_text

  !> Case, ranks, bodies and effects, a line each, up to the head of the options in force.
  function start_lines(simulation, ranks) result(text)
    type(simulation_t), intent(in) :: simulation
    integer, intent(in) :: ranks
    character(len=:), allocatable :: text

    associate (config => simulation%config, decomposition => simulation%decomposition)
      text = trim("case        "//config%file//"  "//config%scene%title)//newline// &
        & "ranks       "//to_text(ranks)//", subdomains "//to_text(decomposition%n_subdomains)// &
        & " ("//boxes_text(simulation)//", "//trim(config%decomposition%kind)//" rule)"//newline
      if (ranks > decomposition%n_subdomains) text = text//"warning     "//to_text(ranks - decomposition%n_subdomains)// &
        & " ranks own no subdomain and stay idle"//newline
      text = text//"bodies      "//to_text(simulation%n_grains)//" grains, "//to_text(size(decomposition%boundaries))// &
        & trim(merge(" boundary  ", " boundaries", size(decomposition%boundaries) == 1))//newline// &
        & "effects     "//to_text(config%scene%dimension)//"D: "//effects_text(simulation%effects, .true.)//newline// &
        & "off         "//effects_text(simulation%effects, .false.)//newline// &
        & "unknowns    "//cost_text(simulation)//newline
      text = text//cell_start_lines(simulation)//mesh_lines(decomposition%boundaries)
      if (config%solver%sleeping) text = text//"sleeping    bodies at rest for "//to_text(config%solver%sleep_after)// &
        & " steps stand still and leave the contact problem until something disturbs them"//newline
    end associate
    text = text//"options in force"//newline
  end function start_lines

  !> A line for each boundary that has facets.
  function mesh_lines(boundaries) result(text)
    type(boundary_t), intent(in) :: boundaries(:)
    character(len=:), allocatable :: text
    integer :: b

    text = ""
    do b = 1, size(boundaries)
      if (.not. boundaries(b)%is_faceted()) cycle
      text = text//"mesh        '"//boundaries(b)%name//"': "//to_text(boundaries(b)%surface%n_facets())//" facets"
      if (boundaries(b)%surface%n_left_out() > 0) text = text//"; "//to_text(boundaries(b)%surface%n_left_out())// &
        & " more are left out, which have no area"
      text = text//newline
    end do
  end function mesh_lines

  !> How space is divided.
  function boxes_text(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text
    integer :: d

    if (simulation%decomposition%partition%n_cells() > 0) then
      text = "METIS on "//to_text(simulation%decomposition%partition%n_cells())//" cells"
      return
    end if
    text = "grid "//to_text(simulation%decomposition%partition%boxes(1))
    do d = 2, simulation%decomposition%nd
      text = text//" x "//to_text(simulation%decomposition%partition%boxes(d))
    end do
  end function boxes_text

  !> Names of the effects that the scene has, or of those that it could have and does not pay for.
  function effects_text(effects, wanted) result(text)
    type(effects_t), intent(in) :: effects
    logical, intent(in) :: wanted
    character(len=:), allocatable :: text
    character(len=effect_name_length) :: names(n_effects)
    logical :: on(n_effects)
    integer :: k

    call effects%list(names, on)
    text = ""
    do k = 1, n_effects
      if (on(k) .eqv. wanted) text = text//", "//trim(names(k))
    end do
    if (text == "") text = ", nothing"
    text = text_from(text, 3)
  end function effects_text

  !> What the effects cost.
  function cost_text(simulation) result(text)
    type(simulation_t), intent(in) :: simulation
    character(len=:), allocatable :: text
    integer(i8) :: contact, body, copy

    call item_bytes(simulation, contact, body, copy)
    associate (kernels => simulation%problem%kernels)
      text = to_text(kernels%nv)//" degrees of freedom a grain, "//to_text(kernels%nc)//" unknowns a contact, "// &
        & to_text(contact)//" bytes a contact, "//to_text(body)//" bytes a body in contact, "//to_text(copy)// &
        & " bytes a copy of a shared body and exchange"
    end associate
  end function cost_text

end module gravier_start_lines
