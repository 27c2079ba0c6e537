!> The columns of the paper, equal disks on a ground whose exact impulses are known, solved by every method.
module gravier_columns_study
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_solve_report, only: solve_report_t
  use gravier_config, only: config_t, parse_config
  use gravier_simulation, only: simulation_t, step_figures_t
  implicit none
  private
  public :: column_t, method_t, methods, sweep_counts, paper_columns, solve_columns

  !> A column and how it is divided.
  type :: column_t
    !> number in the paper, 0 for a column that is not there
    integer :: problem
    integer :: disks, subdomains
  end type column_t

  type :: method_t
    !> as in &solver
    character(len=10) :: name
    !> as in the paper
    character(len=15) :: label
    !> search direction l [kg], as it is written; blank for the methods without
    character(len=4) :: direction
  end type method_t

  type(method_t), parameter :: methods(*) = [ &
    & method_t("nlgs", "NLGS", ""), &
    & method_t("schwarz", "Schwarz-NSCD", ""), &
    & method_t("schwarz_ec", "Schwarz-NSCD-EC", "1"), &
    & method_t("schwarz_ec", "Schwarz-NSCD-EC", "1e4"), &
    & method_t("nscdd", "NSCDD", ""), &
    & method_t("nscdd_ep", "NSCDD-EP", "1"), &
    & method_t("nscdd_ep", "NSCDD-EP", "100"), &
    & method_t("nscdd_ep", "NSCDD-EP", "1e4")]

  !> n_GS, sweeps in one iteration
  integer, parameter :: sweep_counts(*) = [1, 2, 10]

  !> contacts from the ground up {a,b},{c}, and {a,b},{c},{d}
  type(column_t), parameter :: paper_columns(*) = [column_t(1, 3, 2), column_t(2, 4, 3)]

  integer, parameter :: max_iterations = 10000

contains

  !> Solve every column by every method with every number of sweeps. Errors are the same on all ranks. Collective.
  subroutine solve_columns(comm, columns, tolerance, reports, error)
    type(communicator_t), target, intent(in) :: comm
    type(column_t), intent(in) :: columns(:)
    !> on |r - r_exact|/|r_exact|, as it is written
    character(len=*), intent(in) :: tolerance
    !> (sweep_counts, methods, columns), with the trace of every iteration
    type(solve_report_t), allocatable, intent(out) :: reports(:, :, :)
    type(error_t), allocatable, intent(inout) :: error
    integer :: c, m, k

    allocate (reports(size(sweep_counts), size(methods), size(columns)))
    do c = 1, size(columns)
      do m = 1, size(methods)
        do k = 1, size(sweep_counts)
          call solve_one(comm, columns(c), case_text(columns(c), methods(m), sweep_counts(k), tolerance), reports(k, m, c), error)
          if (allocated(error)) return
        end do
      end do
    end do
  end subroutine solve_columns

  !> The input of one case: unit disks under unit gravity, one step of one second from rest.
  pure function case_text(column, method, sweeps, tolerance) result(text)
    type(column_t), intent(in) :: column
    type(method_t), intent(in) :: method
    integer, intent(in) :: sweeps
    character(len=*), intent(in) :: tolerance
    character(len=:), allocatable :: text

    text = "&scene bodies = 'column', column_count = "//to_text(column%disks)//", radius = 1, mass = 1, gravity = 0, -1, 0 / "// &
      & "&time step = 1, steps = 1 / "// &
      & "&solver method = '"//trim(method%name)//"', acceleration = 'none', sweeps = "//to_text(sweeps)// &
      & ", criterion = 'error', tolerance = "//tolerance//", max_iterations = "//to_text(max_iterations)// &
      & ", check_every = 1, warm_start = .false. / "// &
      & "&output trace = .true. / "
    if (method%name /= "nlgs") text = text//"&decomposition grid = 1, "//to_text(column%subdomains)//" / "
    if (method%direction /= "") text = text//"&enriched direction = "//trim(method%direction)//", direction_unit = 'absolute' / "
  end function case_text

  !> Collective.
  subroutine solve_one(comm, column, text, report, error)
    type(communicator_t), target, intent(in) :: comm
    type(column_t), intent(in) :: column
    !> the input
    character(len=*), intent(in) :: text
    type(solve_report_t), intent(out) :: report
    type(error_t), allocatable, intent(inout) :: error
    type(config_t) :: config
    type(simulation_t) :: simulation
    type(step_figures_t) :: figures

    call parse_config("column of "//to_text(column%disks)//" disks", text, config, error)
    call comm%agree(error)
    if (allocated(error)) return
    call simulation%init(comm, config, error)
    if (.not. allocated(error)) call simulation%advance(figures, error)
    if (.not. allocated(error)) report = figures%solve
    call simulation%free()
  end subroutine solve_one

end module gravier_columns_study
