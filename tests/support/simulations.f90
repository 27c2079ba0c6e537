!> Scenes of the program for tests: of any input, and a lattice of random grains that press each other; iterations of its method,
!> and the bits that any number of ranks give.
module gravier_test_simulations
  use mpi_f08, only: MPI_COMM_SELF
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_random_hash, only: hash_uniform
  use gravier_communicator, only: communicator_t
  use gravier_subproblem, only: subproblem_t
  use gravier_config, only: config_t, parse_config
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_test_contact_columns, only: same_contacts
  use gravier_check, only: check
  implicit none
  private
  public :: make_scene, make_lattice, iterate, same_bits, same_impulses, compare_with_one_rank

  character(len=*), parameter :: newline = new_line("a")

contains

  !> The scene of the text of an input file, before its first step.
  subroutine make_scene(comm, text, sim)
    type(communicator_t), target, intent(in) :: comm
    character(len=*), intent(in) :: text
    type(simulation_t), intent(out) :: sim
    type(config_t) :: config
    type(error_t), allocatable :: error

    call parse_config("case", text, config, error)
    if (.not. allocated(error)) call sim%init(comm, config, error)
    call check(.not. allocated(error), "the scene is made")
    if (allocated(error)) print "(a)", error%message
  end subroutine make_scene

  !> A lattice of random grains near each other, with an alert distance that makes them all touch: the velocities that
  !> follow from their identifiers press some together and part others.
  subroutine make_lattice(over, dimension, n_subdomains, friction, keys, sim)
    type(communicator_t), target, intent(in) :: over
    integer, intent(in) :: dimension, n_subdomains
    real(dp), intent(in) :: friction
    !> of the groups &solver and &enriched
    character(len=*), intent(in) :: keys
    type(simulation_t), intent(inout) :: sim
    type(config_t) :: config
    type(error_t), allocatable :: error
    type(step_figures_t) :: figures
    character(len=:), allocatable :: counts
    integer :: s, b, d

    counts = "9, 8"
    if (dimension == 3) counts = "5, 4, 4"
    call parse_config("lattice", "&scene dimension = "//to_text(dimension)//", bodies = 'lattice', lattice_count = "//counts// &
      & ", radius_min = 0.05, radius_max = 0.1, density = 100, alert_distance = 0.07, friction = "//to_text(friction)//" /"// &
      & newline//"&time step = 1, steps = 1, theta = 1 /"//newline//keys//newline// &
      & "&decomposition subdomains = "//to_text(n_subdomains)//" /", config, error)
    call check(.not. allocated(error), "configuration")
    call sim%init(over, config, error)
    call sim%assemble(figures)
    call check(.not. allocated(error), "assembly")
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s))
        do b = 1, sub%n_bodies
          do d = 1, sim%problem%nv
            sub%v_free(d, b) = 2*hash_uniform(3, sub%id(b), d) - 1.0_dp
          end do
        end do
      end associate
    end do
  end subroutine make_lattice

  !> Start a solve from the impulses of the problem and do `n` iterations.
  subroutine iterate(sim, n)
    type(simulation_t), intent(inout) :: sim
    integer, intent(in) :: n
    type(error_t), allocatable :: error
    real(dp) :: jump
    integer :: k

    call sim%method%start(sim%problem, error)
    do k = 1, n
      call sim%method%iterate(sim%problem, .false., jump, error)
    end do
    call check(.not. allocated(error), "iterations")
  end subroutine iterate

  pure logical function same_bits(a, b)
    real(dp), intent(in) :: a(:, :), b(:, :)
    integer :: i, j

    same_bits = size(a) == size(b)
    if (.not. same_bits) return
    do j = 1, size(a, 2)
      do i = 1, size(a, 1)
        same_bits = same_bits .and. transfer(a(i, j), 0_i8) == transfer(b(i, j), 0_i8)
      end do
    end do
  end function same_bits

  !> Whether two copies of a subdomain have the same impulses, contact by contact, bit for bit.
  pure logical function same_impulses(a, b)
    type(subproblem_t), intent(in) :: a, b
    same_impulses = a%n_contacts == b%n_contacts .and. same_contacts(a%impulse, b%impulse, a%n_contacts)
  end function same_impulses

  !> Whether the subdomains of this rank have the bits after `n` iterations that one rank alone gives them.
  subroutine compare_with_one_rank(dimension, n_subdomains, friction, keys, n, name)
    integer, intent(in) :: dimension, n_subdomains, n
    real(dp), intent(in) :: friction
    !> as in make_lattice
    character(len=*), intent(in) :: keys, name
    type(communicator_t), target :: comm, alone
    type(simulation_t) :: many, one
    integer :: s, first
    logical :: same

    call comm%init()
    call alone%init(MPI_COMM_SELF)
    call make_lattice(comm, dimension, n_subdomains, friction, keys, many)
    call make_lattice(alone, dimension, n_subdomains, friction, keys, one)
    call iterate(many, n)
    call iterate(one, n)
    first = many%decomposition%first
    same = .true.
    do s = 1, size(many%problem%sub)
      same = same .and. same_impulses(many%problem%sub(s), one%problem%sub(first + s - 1))
      same = same .and. same_bits(many%problem%sub(s)%velocity, one%problem%sub(first + s - 1)%velocity)
    end do
    call check(same, name//": the bits of one rank alone")
    call many%free()
    call one%free()
    call alone%free()
    call comm%free()
  end subroutine compare_with_one_rank

end module gravier_test_simulations
