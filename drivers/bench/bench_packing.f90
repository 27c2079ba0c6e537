!> Dense packings made without a run: grains of almost one size, nearly touching, on the densest lattice, in a box that
!> fits. The spread of the radii decides which of the 12 (in 2D 6) nearest pairs are within the alert distance: so many that
!> a grain far from the walls has 3.5 contacts (in 2D 2) of its own, as in settled packings. Order and layout of everything
!> are the program's own: the grains go through its scene, its neighbour lists and its builder.
module gravier_bench_packing
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_random_hash, only: hash_uniform
  use gravier_communicator, only: communicator_t
  use gravier_body_store, only: body_set_t
  use gravier_config, only: config_t, parse_config
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: packing_t, make_packing, make_simulation, reset_grains

  !> largest radius and step [m, s]; smallest radius, and shift of the places at random, relative to the largest radius
  real(dp), parameter :: radius = 0.01_dp, step = 1.0e-3_dp, smallest = 0.98_dp, jitter = 0.001_dp
  !> of the lattice, relative to the largest radius: no two grains overlap
  real(dp), parameter :: spacing = 2.0_dp + 2.0_dp*jitter
  !> gap within which the fraction wanted of the nearest pairs lies: the sum of two radii has a triangular distribution
  real(dp), parameter :: alert_2d = spacing - 2.0_dp + (1.0_dp - smallest)*1.1835_dp
  real(dp), parameter :: alert_3d = spacing - 2.0_dp + (1.0_dp - smallest)*1.0871_dp
  !> velocities at the start: neighbours approach each other along every axis by so many alert distances a step, and each
  !> component is changed at random by up to the second number of them, so that some contacts press, slip or are open
  real(dp), parameter :: approach = 1.0_dp, agitation = 2.0_dp

  type :: packing_t
    !> space dimension
    integer :: nd = 3
    !> grains along each axis, 1 beyond nd
    integer :: count(3) = 1
    logical :: friction = .true.
    character(len=10) :: method = "nlgs"
    integer :: subdomains = 1, iterations = 100
    !> of nscdd_ep
    character(len=5) :: interface = "mumps"
  contains
    procedure :: grains => packing_grains
    procedure :: place => packing_place
  end type packing_t

contains

  !> A packing of about `n` grains, as long along each axis, or `longer` times as many and as long along the first one.
  pure type(packing_t) function make_packing(nd, n, longer) result(packing)
    integer, intent(in) :: nd, n
    integer, intent(in), optional :: longer
    real(dp) :: edge

    packing%nd = nd
    if (nd == 2) then
      edge = (n*sqrt(0.75_dp))**(1.0_dp/2.0_dp)
    else
      edge = (n*sqrt(0.5_dp))**(1.0_dp/3.0_dp)
    end if
    packing%count(1:nd - 1) = max(2, nint(edge))
    packing%count(nd) = max(2, ceiling(n/real(packing%count(1), dp)**(nd - 1)))
    if (present(longer)) packing%count(1) = longer*packing%count(1)
  end function make_packing

  pure integer(i8) function packing_grains(self) result(n)
    class(packing_t), intent(in) :: self
    n = product(int(self%count, i8))
  end function packing_grains

  !> Place of a grain at q_m, where contacts are found, and its velocity at the start of a step: functions of its identifier
  !> alone. Rows of disks lie in the gaps of the row below, layers of spheres, square ones, in the gaps of the layer below: a
  !> face-centred cubic lattice.
  pure subroutine packing_place(self, id, position, velocity)
    class(packing_t), intent(in) :: self
    integer(i8), intent(in) :: id
    !> (nd) [m], (nv) [m/s, rad/s]
    real(dp), intent(out) :: position(:), velocity(:)
    integer(i8) :: cell
    integer :: d, place(3)

    cell = id - 1
    do d = 1, 3
      place(d) = narrow(mod(cell, int(self%count(d), i8)))
      cell = cell/self%count(d)
    end do
    velocity(:) = 0.0_dp
    do d = 1, self%nd
      position(d) = 1.0_dp + jitter + place(d)*pitch(self%nd, d) + jitter*(hash_uniform(2, id, d) - 0.5_dp)
      if (d < self%nd) position(d) = position(d) + 0.5_dp*spacing*mod(place(self%nd), 2)
      velocity(d) = alert(self%nd)*radius/step*(agitation*(2.0_dp*hash_uniform(3, id, d) - 1.0_dp) + &
        & approach*(0.5_dp*(self%count(d) - 1) - place(d)))
    end do
    position(:) = radius*position
  end subroutine packing_place

  !> From a row or layer to the next along axis `d`, relative to the largest radius.
  pure real(dp) function pitch(nd, d)
    integer, intent(in) :: nd, d
    pitch = spacing
    if (d == nd) pitch = spacing*merge(sqrt(0.75_dp), sqrt(0.5_dp), nd == 2)
  end function pitch

  !> Alert distance, relative to the largest radius.
  pure real(dp) function alert(nd)
    integer, intent(in) :: nd
    alert = merge(alert_2d, alert_3d, nd == 2)
  end function alert

  !> The scene of a packing, ready for its first step. Errors are the same on all ranks of `comm`. Collective over them.
  subroutine make_simulation(packing, comm, simulation, error)
    type(packing_t), intent(in) :: packing
    type(communicator_t), target, intent(in) :: comm
    type(simulation_t), intent(inout) :: simulation
    type(error_t), allocatable, intent(inout) :: error
    type(config_t) :: config
    type(body_set_t) :: made, grains
    integer :: k

    if (allocated(error)) return
    call parse_config("packing", case_text(packing), config, error)
    call comm%agree(error)
    if (.not. allocated(error)) call simulation%make(comm, config, made, error)
    if (allocated(error)) return
    call grains%init(made, made%n)
    grains%id(:) = made%id
    grains%radius(:) = made%radius
    grains%mass(:) = made%mass
    grains%inertia(:) = made%inertia
    grains%glued(:) = 0
    do k = 1, grains%n
      call packing%place(grains%id(k), grains%position(:, k), grains%velocity(:, k))
      grains%position(:, k) = grains%position(:, k) - 0.5_dp*step*grains%velocity(1:packing%nd, k)
    end do
    call fit_box(packing, simulation)
    call simulation%start(grains, error)
  end subroutine make_simulation

  !> The input of a packing: the radii are those of the program's lattice, whose places are then replaced.
  pure function case_text(packing) result(text)
    type(packing_t), intent(in) :: packing
    character(len=:), allocatable :: text
    integer :: d

    text = "&scene dimension = "//to_text(packing%nd)//", bodies = 'lattice', lattice_count ="
    do d = 1, packing%nd
      text = text//" "//to_text(packing%count(d))
    end do
    text = text//", radius_min = "//to_text(smallest*radius)//", radius_max = "//to_text(radius)//", alert_distance = "// &
      & to_text(alert(packing%nd)*radius)//", friction = "//merge("0.5", "0.0", packing%friction)// &
      & ", overlap_projection = .false. / &time step = "//to_text(step)//", steps = 1 / "// &
      & "&solver method = '"//trim(packing%method)//"', acceleration = 'none', criterion = 'residual', tolerance = 1e-30, "// &
      & "max_iterations = "//to_text(packing%iterations)//" / "
    if (packing%method /= "nlgs") text = text//"&decomposition subdomains = "//to_text(packing%subdomains)//" / "
    if (packing%method == "nscdd_ep") text = text//"&enriched direction = 0.3, interface = '"//trim(packing%interface)//"' / "
  end function case_text

  !> Bring the upper planes of the lattice's box to the packing.
  subroutine fit_box(packing, simulation)
    type(packing_t), intent(in) :: packing
    type(simulation_t), intent(inout) :: simulation
    integer :: b, d

    associate (boundaries => simulation%decomposition%boundaries)
      do b = 1, size(boundaries)
        do d = 1, packing%nd
          if (boundaries(b)%surface%axis(d) < 0.0_dp) boundaries(b)%surface%point(d) = radius*(packing%count(d) + 0.5_dp)*spacing
        end do
      end do
    end associate
  end subroutine fit_box

  !> Grains to where they were at the start of the first step, or in the middle of it, with the velocities of its start: the
  !> next step is the same again, but for the impulses that it starts from.
  subroutine reset_grains(packing, simulation, middle)
    type(packing_t), intent(in) :: packing
    type(simulation_t), intent(inout) :: simulation
    logical, intent(in) :: middle
    integer :: s, k

    do s = 1, size(simulation%decomposition%owned)
      associate (owned => simulation%decomposition%owned(s))
        do k = 1, owned%n
          call packing%place(owned%id(k), owned%position(:, k), owned%velocity(:, k))
          if (.not. middle) owned%position(:, k) = owned%position(:, k) - 0.5_dp*step*owned%velocity(1:packing%nd, k)
        end do
      end associate
    end do
  end subroutine reset_grains

end module gravier_bench_packing
