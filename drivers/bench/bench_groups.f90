!> The groups of measurements that step whole scenes. On several ranks the first one measures alone while the others sleep,
!> then all of them measure together, round by round.
module gravier_bench_groups
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_communicator, only: communicator_t
  use gravier_bench_options, only: options_t
  use gravier_bench_packing, only: packing_t, make_packing
  use gravier_bench_record, only: record_t, case_t
  use gravier_bench_scene, only: bench_scene_t, step_times_t
  implicit none
  private
  public :: measure_exchange, measure_interface, measure_steps, measure_scaling

  !> subdomains of the exchange, of the interface problems and of the scaling of one problem; of the weak scaling, a rank
  integer, parameter :: exchange_subdomains = 64, interface_subdomains = 4, scaling_subdomains = 8, weak_subdomains = 4
  !> iterations of a step that is taken for its interface problem
  integer, parameter :: interface_iterations = 5
  !> spheres of the interface problems; the last of them not in a quick run
  integer, parameter :: interface_spheres(*) = [500, 2000, 8000]

contains

  !> Let the other ranks know how the turn of the first one ended, asleep until it has. Collective.
  subroutine end_turn(world, error)
    type(communicator_t), intent(in) :: world
    type(error_t), allocatable, intent(inout) :: error

    call world%barrier_asleep()
    call world%agree(error)
  end subroutine end_turn

  !> Averages over the copies of shared bodies. Collective.
  subroutine measure_exchange(world, alone, options, record, error)
    type(communicator_t), target, intent(in) :: world, alone
    type(options_t), intent(in) :: options
    type(record_t), intent(inout) :: record
    type(error_t), allocatable, intent(inout) :: error
    type(bench_scene_t) :: single, common
    type(packing_t) :: packing
    integer :: r

    packing = make_packing(3, max(options%spheres/5, 8*exchange_subdomains))
    packing%method = "nscdd"
    packing%subdomains = exchange_subdomains
    packing%iterations = 1
    if (world%rank == 0) call single%init(packing, alone, "exchange", "average_copies", error)
    call end_turn(world, error)
    if (world%size > 1) call common%init(packing, world, "exchange", "average_copies", error)
    if (allocated(error)) return
    do r = 1, options%rounds
      if (world%rank == 0) call single%measure_exchange(options%seconds, record)
      call end_turn(world, error)
      if (world%size > 1) call common%measure_exchange(options%seconds, record)
    end do
    call single%simulation%free()
    call common%simulation%free()
  end subroutine measure_exchange

  !> Interface problems of growing size by both solvers. Collective.
  subroutine measure_interface(world, alone, options, record, error)
    type(communicator_t), target, intent(in) :: world, alone
    type(options_t), intent(in) :: options
    type(record_t), intent(inout) :: record
    type(error_t), allocatable, intent(inout) :: error
    type(bench_scene_t), allocatable :: single(:), common(:)
    integer :: k, r, n

    n = 1
    do k = 2, size(interface_spheres) - merge(1, 0, options%quick)
      if (interface_spheres(k) <= options%spheres) n = k
    end do
    allocate (single(2*n), common(2*n))
    do k = 1, 2*n
      if (world%rank == 0) call make(single(k), alone)
      call end_turn(world, error)
      if (world%size > 1) call make(common(k), world)
    end do
    do r = 1, options%rounds
      do k = 1, 2*n
        if (allocated(error)) return
        if (world%rank == 0) call single(k)%measure_interface(record, error)
        call end_turn(world, error)
        if (world%size > 1) call common(k)%measure_interface(record, error)
      end do
    end do
    do k = 1, 2*n
      call single(k)%simulation%free()
      call common(k)%simulation%free()
    end do

  contains

    !> Of each size MUMPS, then the conjugate gradient.
    subroutine make(scene, comm)
      type(bench_scene_t), intent(inout) :: scene
      type(communicator_t), target, intent(in) :: comm
      type(packing_t) :: packing

      if (allocated(error)) return
      packing = make_packing(3, interface_spheres((k + 1)/2))
      packing%method = "nscdd_ep"
      packing%interface = merge("mumps", "cg   ", mod(k, 2) == 1)
      packing%subdomains = interface_subdomains
      packing%iterations = interface_iterations
      call scene%init(packing, comm, "interface", packing%interface, error)
      if (.not. allocated(error)) scene%of%size = scene%unknowns()
    end subroutine make

  end subroutine measure_interface

  !> Steps of scenes of growing size on one core, by NLGS. The other ranks sleep. Collective.
  subroutine measure_steps(world, alone, options, record, error)
    type(communicator_t), target, intent(in) :: world, alone
    type(options_t), intent(in) :: options
    type(record_t), intent(inout) :: record
    type(error_t), allocatable, intent(inout) :: error

    if (world%rank == 0) call measure_alone(alone, options, record, error)
    call end_turn(world, error)
  end subroutine measure_steps

  subroutine measure_alone(alone, options, record, error)
    type(communicator_t), target, intent(in) :: alone
    type(options_t), intent(in) :: options
    type(record_t), intent(inout) :: record
    type(error_t), allocatable, intent(inout) :: error
    type(bench_scene_t), allocatable :: scenes(:)
    type(packing_t) :: packing
    type(step_times_t) :: times
    integer :: k, r, n

    allocate (scenes(merge(2, 3, options%quick)))
    n = max(8, options%spheres/10**(size(scenes) - 1))
    do k = 1, size(scenes)
      packing = make_packing(3, n)
      packing%iterations = options%iterations
      call scenes(k)%init(packing, alone, "step", "nlgs", error)
      n = min(10*n, options%spheres)
    end do
    do r = 1, options%rounds
      do k = 1, size(scenes)
        if (allocated(error)) return
        call scenes(k)%measure_step(record, times, error)
        call scenes(k)%measure_output(options%csv//".states", times%step, record, error)
        call scenes(k)%measure_detection(record)
      end do
    end do
    do k = 1, size(scenes)
      call scenes(k)%simulation%free()
    end do
  end subroutine measure_alone

  !> One problem on one rank and on all of them, and problems that grow with the ranks. Collective.
  subroutine measure_scaling(world, alone, options, record, error)
    type(communicator_t), target, intent(in) :: world, alone
    type(options_t), intent(in) :: options
    type(record_t), intent(inout) :: record
    type(error_t), allocatable, intent(inout) :: error
    type(bench_scene_t) :: single, common, share, whole
    type(step_times_t) :: one, all_ranks
    integer :: r, n

    n = options%spheres/merge(1, 5, options%quick)
    if (world%rank == 0) call make(single, alone, 1, scaling_subdomains, "strong_scaling")
    if (world%rank == 0) call make(share, alone, 1, weak_subdomains, "weak_scaling")
    call end_turn(world, error)
    if (world%size > 1) then
      call make(common, world, 1, scaling_subdomains, "strong_scaling")
      call make(whole, world, world%size, weak_subdomains*world%size, "weak_scaling")
    end if
    do r = 1, options%rounds
      call compare(single, common)
      if (world%rank == 0 .and. world%size > 1 .and. .not. allocated(error)) then
        call record%note(common%of, "speedup_solve", "1", one%solve/all_ranks%solve)
        call record%note(common%of, "speedup_step", "1", one%step/all_ranks%step)
      end if
      call compare(share, whole)
      if (world%rank == 0 .and. world%size > 1 .and. .not. allocated(error)) then
        call record%note(whole%of, "efficiency_solve", "1", one%solve/all_ranks%solve)
        call record%note(whole%of, "efficiency_step", "1", one%step/all_ranks%step)
      end if
    end do
    call single%simulation%free()
    call share%simulation%free()
    call common%simulation%free()
    call whole%simulation%free()

  contains

    subroutine make(scene, comm, longer, subdomains, group)
      type(bench_scene_t), intent(inout) :: scene
      type(communicator_t), target, intent(in) :: comm
      integer, intent(in) :: longer, subdomains
      character(len=*), intent(in) :: group
      type(packing_t) :: packing

      packing = make_packing(3, n, longer)
      packing%method = "nscdd"
      packing%subdomains = subdomains
      packing%iterations = options%iterations
      call scene%init(packing, comm, group, "nscdd", error)
    end subroutine make

    !> A step of one scene on the first rank, then of another on all.
    subroutine compare(first, second)
      type(bench_scene_t), intent(inout) :: first, second

      if (allocated(error)) return
      if (world%rank == 0) call first%measure_step(record, one, error)
      call end_turn(world, error)
      if (world%size > 1 .and. .not. allocated(error)) call second%measure_step(record, all_ranks, error)
    end subroutine compare

  end subroutine measure_scaling

end module gravier_bench_groups
