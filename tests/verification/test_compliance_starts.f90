!> The forces of compliant contacts do not depend on where a solve starts: from zero and from impulses at random, far from the
!> solution, at high friction, each method finds the same ones.
program test_compliance_starts
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_random_hash, only: hash_uniform
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_config, only: config_t, parse_config
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_contact_data, only: lane_of, block_of
  use gravier_contact_kernels, only: project_on_cones
  use gravier_solve, only: solve_contacts
  use gravier_solve_report, only: solve_report_t, solve_converged
  use gravier_check, only: check, check_close, finish_checks
  implicit none
  character(len=*), parameter :: newline = new_line("a")
  !> steps in which the lattice falls together; random starts
  integer, parameter :: steps = 120, starts = 3
  !> tolerance of the residual; share of the largest impulse that solves to it may differ by
  real(dp), parameter :: tolerance = 1.0e-13_dp, same = 1.0e-8_dp
  type(communicator_t), target :: comm

  call start_parallel()
  call comm%init()
  call test_starts(2, "nlgs", 1)
  call test_starts(3, "nlgs", 1)
  call test_starts(2, "nscdd", 6)
  call test_starts(3, "nscdd", 8)
  call test_starts(3, "schwarz", 8)
  call test_starts(3, "newton", 8)
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  subroutine test_starts(dimension, method, subdomains)
    integer, intent(in) :: dimension, subdomains
    character(len=*), intent(in) :: method
    type(simulation_t) :: sim
    type(config_t) :: config
    type(error_t), allocatable :: error
    type(step_figures_t) :: figures
    type(solve_report_t) :: report
    !> impulses of this start, and of the first one
    real(dp), allocatable :: found(:), first(:)
    real(dp) :: most, differs
    character(len=:), allocatable :: count
    integer :: k

    count = "10, 10"
    if (dimension == 3) count = "5, 5, 5"
    ! h sqrt(k/m) is about 2, at a friction of 1
    call parse_config("starts", "&scene bodies = 'lattice', dimension = "//to_text(dimension)//", lattice_count = "//count// &
      & ", radius_min = 0.008, radius_max = 0.012, wall_material = 'm' / &material name = 'm' /"//newline// &
      & "&law materials = 'm', kind = 'elastic', friction = 1.0, normal_stiffness = "//merge("3.0e6", "4.0e4", dimension == 2)// &
      & " / &time step = 5.0e-4, steps = "//to_text(steps + 1)//" /"//newline// &
      & "&solver method = '"//method//"', criterion = 'residual', tolerance = "//to_text(tolerance)// &
      & ", max_iterations = 5000 / &decomposition subdomains = "//to_text(subdomains)//" /", config, error)
    if (allocated(error)) print "(a)", error%message
    call check(.not. allocated(error), "configuration")
    call sim%init(comm, config, error)
    do k = 1, steps
      call sim%advance(figures, error)
    end do
    call sim%assemble(figures)
    call check(.not. allocated(error), "steps")
    allocate (first(0))
    do k = 0, starts
      call set_impulses(sim, k)
      call solve_contacts(sim%problem, sim%method, sim%control, report, error, sim%exact)
      call check(.not. allocated(error) .and. report%status == solve_converged, method//": a solve from start "//to_text(k))
      call take_impulses(sim, found)
      if (k == 0) call move_alloc(found, first)
      if (k == 0) cycle
      most = 0.0_dp
      differs = 0.0_dp
      if (size(first) > 0) most = maxval(abs(first))
      if (size(first) > 0) differs = maxval(abs(found - first))
      most = comm%highest(most)
      call check(most > 0.0_dp, method//": there are forces")
      call check_close(comm%highest(differs)/most, 0.0_dp, same, method//" in "//to_text(dimension)//"D: impulses from start "// &
        & to_text(k))
    end do
    call sim%free()
  end subroutine test_starts

  !> Zero at first, else numbers at random within the cones, as large as the largest impulses are.
  subroutine set_impulses(sim, start)
    type(simulation_t), intent(inout) :: sim
    integer, intent(in) :: start
    integer :: s, c, d

    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s))
        sub%impulse(:, :, :) = 0.0_dp
        if (start == 0) cycle
        do c = 1, sub%n_contacts
          do d = 1, size(sub%impulse, 2)
            sub%impulse(lane_of(c), d, block_of(c)) = 0.1_dp*(2.0_dp*hash_uniform(start, 10*sub%id(sub%pair(1, c)) + d, c) - 1.0_dp)
          end do
        end do
        call project_on_cones(sim%problem%kernels, sub%n_contacts, sub%hot, sub%impulse)
      end associate
    end do
  end subroutine set_impulses

  subroutine take_impulses(sim, found)
    type(simulation_t), intent(in) :: sim
    !> of the contacts of this rank
    real(dp), allocatable, intent(out) :: found(:)
    integer :: s, n, d, g

    n = 0
    do s = 1, size(sim%problem%sub)
      n = n + size(sim%problem%sub(s)%impulse)
    end do
    allocate (found(n))
    n = 0
    do s = 1, size(sim%problem%sub)
      associate (impulse => sim%problem%sub(s)%impulse)
        do g = 1, size(impulse, 3)
          do d = 1, size(impulse, 2)
            found(n + 1:n + size(impulse, 1)) = impulse(:, d, g)
            n = n + size(impulse, 1)
          end do
        end do
      end associate
    end do
  end subroutine take_impulses

end program test_compliance_starts
