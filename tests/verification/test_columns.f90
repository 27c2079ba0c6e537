!> The columns of the paper: iteration counts of every method, exact impulses, rate of the Gauss-Seidel sweeps.
program test_columns
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_config, only: config_t, parse_config
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_solve_report, only: solve_converged
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  character(len=*), parameter :: newline = new_line("a")
  integer, parameter :: n_gs(3) = [1, 2, 10]

  !> A row of the table of iteration counts: three numbers of sweeps for 3 disks in 2 subdomains, then for 4 in 3.
  type :: row_t
    character(len=16) :: method = ""
    !> l [kg], where the method has it
    real(dp) :: direction = 0.0_dp
    integer :: iterations(3, 2) = 0
  end type row_t

  !> Counts until the relative error on the impulses is below 1e-6. NLGS is one domain. Made independently of this
  !> program by a direct implementation of the equations.
  type(row_t), parameter :: table(8) = [ &
    & row_t("nlgs", 0.0_dp, reshape([48, 24, 5, 87, 44, 9], [3, 2])), &
    & row_t("schwarz", 0.0_dp, reshape([65, 48, 39, 132, 107, 95], [3, 2])), &
    & row_t("schwarz_ec", 1.0_dp, reshape([61, 46, 39, 125, 105, 95], [3, 2])), &
    & row_t("schwarz_ec", 1.0e4_dp, reshape([41, 40, 39, 96, 95, 95], [3, 2])), &
    & row_t("nscdd", 0.0_dp, reshape([101, 81, 75, 225, 197, 188], [3, 2])), &
    & row_t("nscdd_ep", 1.0_dp, reshape([54, 37, 32, 91, 68, 60], [3, 2])), &
    & row_t("nscdd_ep", 100.0_dp, reshape([16, 9, 5, 16, 10, 6], [3, 2])), &
    & row_t("nscdd_ep", 1.0e4_dp, reshape([14, 8, 3, 14, 8, 3], [3, 2]))]

  type(communicator_t), target :: comm
  integer :: k

  call MPI_Init()
  call comm%init()
  do k = 1, size(table)
    call check_counts(table(k), "mumps", "grid")
    if (table(k)%method == "nscdd_ep") call check_counts(table(k), "cg", "grid")
    call check_impulses(table(k), 2)
    call check_impulses(table(k), 3)
  end do
  call check_newton()
  call check_rates()
  call comm%free()
  call finish_checks()
  call MPI_Finalize()

contains

  !> Solve one step of a column of unit disks, m = g = h = 1.
  subroutine solve_column(disks, subdomains, dimension, options, simulation, figures, acceleration)
    integer, intent(in) :: disks, subdomains, dimension
    !> keys of &solver, then whole groups
    character(len=*), intent(in) :: options
    type(simulation_t), intent(inout) :: simulation
    type(step_figures_t), intent(out) :: figures
    !> none unless given
    character(len=*), intent(in), optional :: acceleration
    type(config_t) :: config
    type(error_t), allocatable :: error
    character(len=:), allocatable :: text, word

    word = "none"
    if (present(acceleration)) word = acceleration
    text = "&scene dimension = "//to_text(dimension)//", bodies = 'column', column_count = "//to_text(disks)// &
      & trim(merge(", gravity = 0, -1 /   ", ", gravity = 0, 0, -1 /", dimension == 2))//newline// &
      & "&time step = 1.0, steps = 1 /"//newline// &
      & "&decomposition subdomains = "//to_text(subdomains)//" /"//newline//"&solver acceleration = '"//word// &
      & "', "//options//newline
    call parse_config("column", text, config, error)
    if (.not. allocated(error)) call simulation%init(comm, config, error)
    if (.not. allocated(error)) call simulation%advance(figures, error)
    if (allocated(error)) then
      call check(.false., text//error%message)
    else
      call check(.true., "solved")
    end if
  end subroutine solve_column

  function method_text(row, sweeps, interface) result(text)
    type(row_t), intent(in) :: row
    integer, intent(in) :: sweeps
    character(len=*), intent(in) :: interface
    character(len=:), allocatable :: text
    text = "method = '"//trim(row%method)//"', sweeps = "//to_text(sweeps)//", criterion = 'error', check_every = 1"
    text = text//", tolerance = TOLERANCE, max_iterations = 10000 /"//newline//"&enriched direction = "// &
      & to_text(row%direction, 3)//", direction_unit = 'absolute', interface = '"//interface//"' /"
  end function method_text

  function with_tolerance(options, tolerance) result(text)
    character(len=*), intent(in) :: options, tolerance
    character(len=:), allocatable :: text
    integer :: at
    at = index(options, "TOLERANCE")
    text = options(1:at - 1)//tolerance//options(at + 9:)
  end function with_tolerance

  !> Every cell of a row of the table, exactly.
  subroutine check_counts(row, interface, partition)
    type(row_t), intent(in) :: row
    character(len=*), intent(in) :: interface, partition
    type(simulation_t) :: simulation
    type(step_figures_t) :: figures
    integer :: problem, k, subdomains

    do problem = 1, 2
      subdomains = merge(1, problem + 1, row%method == "nlgs")
      do k = 1, 3
        call solve_column(problem + 2, subdomains, 2, with_tolerance(method_text(row, n_gs(k), interface), "1e-6"), &
          & simulation, figures)
        call check_equal(figures%solve%iterations, row%iterations(k, problem), trim(row%method)//" l = "// &
          & to_text(row%direction, 2)//", "//interface//", "//partition//", problem "//to_text(problem)//", n_GS = "// &
          & to_text(n_gs(k)))
        call simulation%free()
      end do
    end do
  end subroutine check_counts

  !> Impulses 3, 2, 1 and 4, 3, 2, 1 to 1e-10 at tolerance 1e-12 (the norm of the impulses is below 6, so that the
  !> tolerance promises 6e-12), and no motion.
  subroutine check_impulses(row, dimension)
    type(row_t), intent(in) :: row
    integer, intent(in) :: dimension
    type(simulation_t) :: simulation
    type(step_figures_t) :: figures
    integer :: problem, s, c, upper

    do problem = 1, 2
      call solve_column(problem + 2, merge(1, problem + 1, row%method == "nlgs"), dimension, &
        & with_tolerance(method_text(row, 2, "mumps"), "1e-12"), simulation, figures)
      call check_equal(figures%solve%status, solve_converged, trim(row%method)//" converges to 1e-12")
      do s = 1, size(simulation%problem%sub)
        associate (sub => simulation%problem%sub(s))
          do c = 1, sub%n_contacts
            upper = int(sub%id(sub%pair(1, c)))
            if (sub%pair(2, c) <= sub%n_bodies) upper = int(max(sub%id(sub%pair(1, c)), sub%id(sub%pair(2, c))))
            call check_close(sub%impulse(lane_of(c), 1, block_of(c)), real(problem + 3 - upper, dp), 1.0e-10_dp, &
              & "impulse below disk "//to_text(upper))
          end do
        end associate
      end do
      do s = 1, size(simulation%decomposition%owned)
        call check(all(abs(simulation%decomposition%owned(s)%velocity) < 1.0e-10_dp), "the column stays at rest")
      end do
      call simulation%free()
    end do
  end subroutine check_impulses

  !> Where sweeps do well, Newton's method is NSCDD with momentum, iteration by iteration; its impulses are the exact ones.
  subroutine check_newton()
    type(row_t), parameter :: row = row_t("newton", 0.0_dp)
    type(simulation_t) :: simulation
    type(step_figures_t) :: figures
    character(len=120) :: options
    integer :: problem, k, iterations

    do problem = 1, 2
      do k = 1, 3
        options = "sweeps = "//to_text(n_gs(k))//", criterion = 'error', check_every = 1, tolerance = 1e-6, "// &
          & "max_iterations = 10000 /"
        call solve_column(problem + 2, problem + 1, 2, "method = 'newton', "//trim(options), simulation, figures)
        iterations = figures%solve%iterations
        call simulation%free()
        call solve_column(problem + 2, problem + 1, 2, "method = 'nscdd', "//trim(options), simulation, figures, "momentum")
        call check_equal(iterations, figures%solve%iterations, "newton, problem "//to_text(problem)//", n_GS = "// &
          & to_text(n_gs(k)))
        call simulation%free()
      end do
    end do
    call check_impulses(row, 2)
    call check_impulses(row, 3)
  end subroutine check_newton

  !> The error of NLGS on a column of N shrinks by cos^2(pi/2N) a sweep. It is measured between two checks 10 sweeps
  !> apart where the error is about 1e-8: far above rounding (1e-16) and after all faster modes have died out.
  subroutine check_rates()
    type(simulation_t) :: simulation
    type(step_figures_t) :: figures
    real(dp), parameter :: pi = acos(-1.0_dp)
    real(dp) :: rate
    integer :: disks, last

    do disks = 3, merge(64, 12, comm%size == 1)
      call solve_column(disks, 1, 2, "method = 'nlgs', criterion = 'error', tolerance = 1e-8, max_iterations = 100000, "// &
        & "check_every = 10 / &output trace = .true. /", simulation, figures)
      last = figures%solve%n_trace
      rate = (figures%solve%trace(4, last)/figures%solve%trace(4, last - 1))**0.1_dp
      call check_close(rate, cos(pi/(2*disks))**2, 1.0e-6_dp, "rate of NLGS on a column of "//to_text(disks))
      call simulation%free()
    end do
  end subroutine check_rates

end program test_columns
