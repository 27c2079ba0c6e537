!> The loops over contacts: relaxations a second of each kernel, in cache and out of it, and the bytes that they stream; and what
!> each effect of a scene costs, against the same contacts without it.
module gravier_bench_kernels
  use mpi_f08, only: MPI_Wtime, MPI_COMM_SELF
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_communicator, only: communicator_t
  use gravier_text, only: to_text
  use gravier_contact_coefficients, only: coefficients_t
  use gravier_effects, only: effects_t
  use gravier_contact_data, only: contact_rows_t
  use gravier_contact_kernels, only: kernels_t
  use gravier_subproblem, only: subproblem_t
  use gravier_method, only: start_sweeps
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_machine, only: last_cache
  use gravier_bench_options, only: options_t
  use gravier_bench_packing, only: packing_t, make_packing, make_simulation
  use gravier_bench_record, only: record_t, case_t
  implicit none
  private
  public :: kernel_problem_t, kernel_names, make_kernels, measure_kernels, sweep_kernel, make_effects, measure_effects

  integer, parameter :: name_length = 32
  character(len=name_length), parameter :: kernel_names(*) = [character(len=name_length) :: &
    & "2d_frictionless", "2d_friction", "2d_shaped", "3d_frictionless", "3d_friction", "3d_shaped"]
  !> what effects add to a dimension, and the place in this list of what each is compared with
  character(len=24), parameter :: effect_names(*) = [character(len=24) :: &
    & "frictionless", "frictionless_restitution", "friction", "friction_restitution", "friction_tangential", "friction_rolling", &
    & "friction_tangential_roll", "shaped"]
  integer, parameter :: effect_base(size(effect_names)) = [1, 1, 1, 3, 3, 3, 3, 3]
  !> versions of a kernel: as it is; recording the velocities which solved the laws; from extrapolated impulses
  integer, parameter :: plain = 1, recording = 2, momentum = 3
  !> what each adds to the name of a kernel
  character(len=*), parameter :: version_names(3) = [character(len=10) :: "", "_recording", "_momentum"]
  character(len=*), parameter :: places(3) = [character(len=12) :: "core_cache", "last_cache", "memory"]

  !> contacts a grain in packings of some size, walls included
  real(dp), parameter :: contacts_2d = 1.95_dp, contacts_3d = 3.35_dp
  !> contacts of a problem in the first caches of a core, and fraction of the last cache that one beyond them takes
  integer, parameter :: few_contacts = 2000
  real(dp), parameter :: share_of_cache = 0.1_dp
  !> coefficients of rolling and pivoting
  real(dp), parameter :: rolling_friction = 0.1_dp
  !> the largest problem streams so many times the last cache
  integer, parameter :: times_cache = 4

  !> One kernel, in its versions, and contacts for it.
  type :: kernel_problem_t
    character(len=name_length) :: name
    character(len=12) :: place
    type(kernels_t) :: kernels
    !> one
    type(subproblem_t), allocatable :: sub(:)
    !> what recording writes, and what momentum reads and writes (lanes, nc, blocks)
    real(dp), allocatable :: law_velocity(:, :, :), previous(:, :, :)
  contains
    procedure :: sweep_once
    procedure :: streamed
    procedure :: bytes_of_contact
  end type kernel_problem_t

contains

  !> One sweep over all contacts.
  subroutine sweep_once(self, version)
    class(kernel_problem_t), intent(inout) :: self
    integer, intent(in) :: version
    real(dp) :: sums(2)

    associate (sub => self%sub(1))
      select case (version)
      case (recording)
        call self%kernels%sweep_recording(sub%n_grouped, sub%pair, sub%hot, sub%weight, sub%velocity, sub%impulse, sums, &
          & self%law_velocity)
      case (momentum)
        call self%kernels%sweep_momentum(sub%n_grouped, sub%pair, sub%hot, sub%weight, sub%velocity, sub%impulse, sums, &
          & 0.0_dp, self%previous)
      case default
        call self%kernels%sweep(sub%n_grouped, sub%pair, sub%hot, sub%weight, sub%velocity, sub%impulse, sums)
      end select
    end associate
  end subroutine sweep_once

  !> Bytes that one sweep moves at least, each array once: of a contact pair and contact data read, impulses read and written, law
  !> velocities written, previous impulses read and written; of a body velocities read and written, weights read. Lanes of
  !> the last block that hold no contact count too.
  pure integer(i8) function streamed(self, version) result(bytes)
    class(kernel_problem_t), intent(in) :: self
    integer, intent(in) :: version
    integer(i8) :: words

    associate (sub => self%sub(1))
      words = size(sub%hot, kind=i8) + 2*size(sub%impulse, kind=i8) + 2*size(sub%velocity, kind=i8) + size(sub%weight, kind=i8)
      if (version == recording) words = words + size(self%law_velocity, kind=i8)
      if (version == momentum) words = words + 2*size(self%previous, kind=i8)
      bytes = words*(storage_size(sub%hot)/8) + size(sub%pair, kind=i8)*(storage_size(sub%pair)/8)
    end associate
  end function streamed

  !> All kernels, each with three problems, on this rank. Not collective.
  subroutine make_kernels(options, problems, error)
    type(options_t), intent(in) :: options
    type(kernel_problem_t), allocatable, intent(out) :: problems(:)
    type(error_t), allocatable, intent(inout) :: error
    integer :: k, p, n

    allocate (problems(size(places)*size(kernel_names)))
    do k = 1, size(kernel_names)
      do p = 1, size(places)
        n = few_contacts
        if (options%contacts > 0) n = min(n, options%contacts)
        if (p > 1) n = wanted_contacts(options, problems(3*k - 2), p == 3)
        call make_problem(trim(kernel_names(k)), n, problems(3*k - 3 + p), error)
        if (allocated(error)) return
        problems(3*k - 3 + p)%place = places(p)
      end do
    end do
  end subroutine make_kernels

  !> Contacts of the problems out of the first caches, from the bytes of a small one.
  integer function wanted_contacts(options, small, largest) result(n)
    type(options_t), intent(in) :: options
    type(kernel_problem_t), intent(in) :: small
    !> out of all caches
    logical, intent(in) :: largest
    real(dp) :: per_cache

    per_cache = real(last_cache(), dp)*small%sub(1)%n_contacts/small%streamed(plain)
    if (.not. largest) then
      n = nint(share_of_cache*per_cache)
      if (options%contacts > 0) n = min(n, options%contacts)
    else if (options%contacts > 0) then
      n = options%contacts
    else
      n = max(1000000, nint(times_cache*per_cache))
    end if
  end function wanted_contacts

  !> One problem an effect and dimension, in the last cache, on this rank. Not collective.
  subroutine make_effects(options, problems, error)
    type(options_t), intent(in) :: options
    type(kernel_problem_t), allocatable, intent(out) :: problems(:)
    type(error_t), allocatable, intent(inout) :: error
    type(kernel_problem_t) :: small
    integer :: k, nd, n

    allocate (problems(2*size(effect_names)))
    if (allocated(error)) return
    do nd = 2, 3
      n = few_contacts
      if (options%contacts > 0) n = min(n, options%contacts)
      call make_problem(to_text(nd)//"d_friction", n, small, error)
      if (allocated(error)) return
      n = wanted_contacts(options, small, .false.)
      deallocate (small%sub, small%law_velocity, small%previous)
      do k = 1, size(effect_names)
        call make_problem(to_text(nd)//"d_"//trim(effect_names(k)), n, problems((nd - 2)*size(effect_names) + k), error)
        if (allocated(error)) return
      end do
    end do
  end subroutine make_effects

  !> A problem of about `n` contacts for the kernel of a name, with the masses and velocities that a solve starts from. All of a
  !> dimension have the same contacts: restitution is another shift, tangential restitution is that of no velocity.
  subroutine make_problem(name, n, problem, error)
    character(len=*), intent(in) :: name
    integer, intent(in) :: n
    type(kernel_problem_t), intent(inout) :: problem
    type(error_t), allocatable, intent(inout) :: error
    type(communicator_t), target :: alone
    type(packing_t) :: packing
    type(simulation_t) :: simulation
    type(step_figures_t) :: figures
    type(effects_t) :: effects
    type(coefficients_t) :: contact

    if (index(name, "2d") == 1) then
      packing = make_packing(2, nint(n/contacts_2d))
    else
      packing = make_packing(3, nint(n/contacts_3d))
    end if
    packing%friction = index(name, "frictionless") == 0
    call alone%init(MPI_COMM_SELF)
    call make_simulation(packing, alone, simulation, error)
    if (.not. allocated(error)) then
      effects = simulation%effects
      effects%tangential_restitution = index(name, "tangential") > 0
      effects%rolling = index(name, "roll") > 0
      call simulation%problem%choose_kernels(packing%nd, effects)
      contact = simulation%config%scene%contact
      contact%rolling_friction = rolling_friction
      contact%pivoting_friction = rolling_friction
      call simulation%physics%laws%set_default(0, contact)
      call simulation%assemble(figures)
      associate (sub => simulation%problem%sub(1))
        if (index(name, "restitution") > 0) sub%hot(:, packing%nd + 1, :) = 0.5_dp*sub%hot(:, packing%nd + 1, :)
      end associate
      if (index(name, "shaped") > 0) call let_touch_anywhere(packing%nd, effects, simulation%problem%kernels, &
        & simulation%problem%sub(1))
      call start_sweeps(simulation%method, simulation%problem, shared_masses=.false.)
      problem%name = name
      problem%kernels = simulation%problem%kernels
      call move_alloc(simulation%problem%sub, problem%sub)
      allocate (problem%law_velocity, problem%previous, source=problem%sub(1)%impulse)
    end if
    call simulation%free()
    call alone%free()
  end subroutine make_problem

  !> The same contacts for the kernels of bodies with shapes, which may touch anywhere on them: the arms are those of the grains,
  !> and the inverse inertia is a matrix. Each pair touches in one point, so that no two contacts in a row share their bodies.
  subroutine let_touch_anywhere(nd, effects, kernels, sub)
    integer, intent(in) :: nd
    !> of the scene
    type(effects_t), intent(in) :: effects
    !> those of the packed contacts on entry, those of shapes on return
    type(kernels_t), intent(inout) :: kernels
    type(subproblem_t), intent(inout) :: sub
    real(dp), allocatable :: round(:, :, :), inverse(:, :)
    type(contact_rows_t) :: row
    type(effects_t) :: shaped
    integer :: d

    row = kernels%row
    shaped = effects
    shaped%shapes = .true.
    call kernels%choose(nd, shaped)
    call move_alloc(sub%hot, round)
    allocate (sub%hot(size(round, 1), kernels%nh, size(round, 3)), source=0.0_dp)
    sub%hot(:, 1:nd, :) = round(:, 1:nd, :)
    sub%hot(:, kernels%row%shift, :) = round(:, row%shift, :)
    sub%hot(:, kernels%row%friction, :) = round(:, row%friction, :)
    if (nd == 2) then
      sub%hot(:, kernels%row%lever_i, :) = round(:, row%lever_i, :)
      sub%hot(:, kernels%row%lever_j, :) = round(:, row%lever_j, :)
      return
    end if
    do d = 0, 2
      sub%hot(:, kernels%row%arm_i + d, :) = -round(:, row%lever_i, :)*round(:, 1 + d, :)
      sub%hot(:, kernels%row%arm_j + d, :) = round(:, row%lever_j, :)*round(:, 1 + d, :)
    end do
    call move_alloc(sub%inverse_mass, inverse)
    deallocate (sub%weight)
    allocate (sub%inverse_mass(kernels%nw, size(inverse, 2)), sub%weight(kernels%nw, size(inverse, 2)), source=0.0_dp)
    sub%inverse_mass(1:3, :) = inverse(1:3, :)
    do d = 4, 6
      sub%inverse_mass(d, :) = inverse(4, :)
    end do
  end subroutine let_touch_anywhere

  !> One round over all problems: rates, and what they are of the bandwidth of this round. Not collective.
  subroutine measure_kernels(options, problems, bandwidth, record)
    type(options_t), intent(in) :: options
    type(kernel_problem_t), intent(inout) :: problems(:)
    !> of the triad on one core [B/s]
    real(dp), intent(in) :: bandwidth
    type(record_t), intent(inout) :: record
    type(case_t) :: of
    real(dp) :: rate, bytes
    integer :: k, version

    do k = 1, size(problems)
      associate (problem => problems(k))
        do version = 1, size(version_names)
          of = case_t("kernel_"//trim(problem%place), trim(problem%name)//version_names(version), &
            & int(problem%sub(1)%n_contacts, i8), 1)
          rate = relaxation_rate(problem, version, options%seconds)
          bytes = real(problem%streamed(version), dp)/problem%sub(1)%n_contacts
          call record%note(of, "relaxations", "1/s", rate)
          call record%note(of, "bytes_per_relaxation", "B", bytes)
          call record%note(of, "ratio_to_triad", "1", rate*bytes/bandwidth)
          call record%note(of, "bodies", "1", real(problem%sub(1)%n_columns, dp))
          call record%note(of, "share_of_pressing_contacts", "1", &
            & real(count(problem%sub(1)%impulse(:, 1, :) > 0.0_dp), dp)/problem%sub(1)%n_contacts)
        end do
      end associate
    end do
  end subroutine measure_kernels

  !> One round over all effects: what a relaxation and a contact take, and what they take of the same without the effect. Not
  !> collective.
  subroutine measure_effects(options, problems, record)
    type(options_t), intent(in) :: options
    type(kernel_problem_t), intent(inout) :: problems(:)
    type(record_t), intent(inout) :: record
    type(case_t) :: of
    real(dp) :: seconds(size(problems)), bytes(size(problems))
    integer :: k, base

    do k = 1, size(problems)
      seconds(k) = 1.0_dp/relaxation_rate(problems(k), plain, options%seconds)
      bytes(k) = problems(k)%bytes_of_contact()
      base = effect_base(mod(k - 1, size(effect_names)) + 1) + (k - 1)/size(effect_names)*size(effect_names)
      of = case_t("effect", trim(problems(k)%name), int(problems(k)%sub(1)%n_contacts, i8), 1)
      call record%note(of, "seconds_per_relaxation", "s", seconds(k))
      call record%note(of, "unknowns", "1", real(problems(k)%kernels%nc, dp))
      call record%note(of, "bytes_per_contact", "B", bytes(k))
      call record%note(of, "seconds_over_without", "1", seconds(k)/seconds(base))
      call record%note(of, "bytes_over_without", "1", bytes(k)/bytes(base))
    end do
  end subroutine measure_effects

  !> Bytes that a sweep knows of a contact, from the sizes of the arrays.
  pure real(dp) function bytes_of_contact(self) result(bytes)
    class(kernel_problem_t), intent(in) :: self

    associate (sub => self%sub(1))
      bytes = real(storage_size(sub%hot)/8*(size(sub%hot) + size(sub%impulse)) + storage_size(sub%pair)/8*size(sub%pair), dp) &
        & /size(sub%pair, 2)
    end associate
  end function bytes_of_contact

  !> Relaxations a second, over at least so many seconds after one sweep that brings the data near.
  real(dp) function relaxation_rate(problem, version, seconds) result(rate)
    type(kernel_problem_t), intent(inout) :: problem
    integer, intent(in) :: version
    real(dp), intent(in) :: seconds
    real(dp) :: start, now
    integer :: k, together, n

    call problem%sweep_once(version)
    ! the clock is read once in so many relaxations
    together = 1 + 100000/problem%sub(1)%n_contacts
    n = 0
    start = MPI_Wtime()
    do
      do k = 1, together
        call problem%sweep_once(version)
      end do
      n = n + together
      now = MPI_Wtime()
      if (now - start >= seconds .and. now > start) exit
    end do
    rate = real(problem%sub(1)%n_contacts, dp)*n/(now - start)
  end function relaxation_rate

  !> So many sweeps of one kernel and nothing else: what counts instructions compares two numbers of sweeps.
  subroutine sweep_kernel(options, contacts, error)
    !> with a kernel and a number of sweeps
    type(options_t), intent(in) :: options
    !> contacts there are
    integer, intent(out) :: contacts
    type(error_t), allocatable, intent(inout) :: error
    type(kernel_problem_t) :: problem
    integer :: k, n

    n = few_contacts
    if (options%contacts > 0) n = options%contacts
    contacts = 0
    call make_problem(options%kernel, n, problem, error)
    if (allocated(error)) return
    contacts = problem%sub(1)%n_contacts
    do k = 1, options%sweeps
      call problem%sweep_once(merge(recording, plain, options%recording))
    end do
  end subroutine sweep_kernel

end module gravier_bench_kernels
