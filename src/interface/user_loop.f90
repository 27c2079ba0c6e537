!> A run whose loop is the user's: between two steps it may change drives, loads, velocities and coefficients, put bodies into the
!> scene and take them out of it. What it sets stays until it is set again; no checkpoint keeps it. Every rank makes the same calls
!> with the same values, but for what belongs to the bodies of a rank.
module gravier_user_loop
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text, text_from
  use gravier_random_hash, only: hash_words
  use gravier_magnitude, only: is_bounded, bounded_text
  use gravier_communicator, only: communicator_t
  use gravier_signals, only: release_signals
  use gravier_body_store, only: body_set_t
  use gravier_contact_coefficients, only: coefficients_t
  use gravier_restart, only: restart_t
  use gravier_open_run, only: open_run_t
  implicit none
  private
  public :: user_loop_t, numbers_text

  type :: user_loop_t
    type(communicator_t) :: comm
    type(open_run_t) :: run
    !> boundaries that turned when the run began, about which axes (3, boundaries)
    logical, allocatable :: turns(:, :)
    !> of all that was set: ranks that differ are found by it
    integer(i8) :: settings = 0
    !> of grains with each other
    type(coefficients_t) :: between_grains
    !> since the last step, velocities of bodies were set on this rank; forces were; one of both
    logical, private :: velocities_set = .false., forces_set = .false., bodies_set = .false.
    !> lines about what was set since the last step for the first time, which the log has with the next one
    character(len=:), allocatable, private :: unsaid
    !> why the run is over, where an error has ended it
    type(error_t), allocatable, private :: cause
  contains
    procedure :: open => user_loop_open
    procedure :: goes_on => user_loop_goes_on
    procedure :: step => user_loop_step
    procedure :: stop => user_loop_stop
    procedure :: write_checkpoint => user_loop_write_checkpoint
    procedure :: close => user_loop_close
    procedure :: place => user_loop_place
    procedure :: get_array => user_loop_get_array
    procedure :: check_array => user_loop_check_array
    procedure :: set_array => user_loop_set_array
    procedure :: set_gravity => user_loop_set_gravity
    procedure :: set_friction => user_loop_set_friction
    procedure :: note => user_loop_note
    procedure :: note_setting => user_loop_note_setting
  end type user_loop_t

contains

  !> Begin a run on the communicator of the loop, which is initialised. Errors are the same on all ranks; after one, `close` gives
  !> back what is held. Collective.
  subroutine user_loop_open(self, path, command, restart, quiet, forces, error)
    class(user_loop_t), target, intent(inout) :: self
    !> of the input file; who runs it, for the record
    character(len=*), intent(in) :: path, command
    type(restart_t), intent(in) :: restart
    !> the log goes to its file alone; bodies have forces that the loop applies
    logical, intent(in) :: quiet, forces
    type(error_t), allocatable, intent(inout) :: error
    integer :: b, k

    call self%run%begin(self%comm, path, command, restart, error, quiet)
    if (allocated(error)) return
    associate (boundaries => self%run%simulation%decomposition%boundaries)
      allocate (self%turns(3, size(boundaries)))
      do b = 1, size(boundaries)
        do k = 1, 3
          self%turns(k, b) = boundaries(b)%drive%turns_about(k)
        end do
      end do
    end associate
    self%unsaid = ""
    self%between_grains = self%run%simulation%config%scene%contact
    if (forces) call self%run%simulation%take_forces()
  end subroutine user_loop_open

  !> Whether there is a step to make. The same on all ranks.
  logical function user_loop_goes_on(self) result(goes_on)
    class(user_loop_t), intent(in) :: self

    goes_on = .not. allocated(self%cause)
    if (goes_on) goes_on = self%run%goes_on()
  end function user_loop_goes_on

  !> Make one step. Failures: as of the program; status_input where the run is over, or where ranks have set different values.
  !> Collective.
  subroutine user_loop_step(self, error)
    class(user_loop_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: mark(5)

    if (.not. self%goes_on()) then
      call raise(error, status_input, "step: the run is over after step "//to_text(self%run%simulation%step)// &
        & "; expected a run that goes on")
      return
    end if
    ! words of 52 bits are exact as reals
    mark(1) = real(ibits(self%settings, 0, 52), dp)
    mark(2) = -mark(1)
    ! a rank sets what belongs to its own bodies, and may have none
    mark(3) = merge(1.0_dp, 0.0_dp, self%velocities_set)
    mark(4) = merge(1.0_dp, 0.0_dp, self%bodies_set)
    mark(5) = merge(1.0_dp, 0.0_dp, self%forces_set)
    call self%comm%highest_of(mark)
    if (abs(mark(1) + mark(2)) > 0.0_dp) then
      call raise(error, status_input, "step: ranks have set different drives, loads, coefficients or bodies; "// &
        & "expected the same calls with the same values on all ranks")
      return
    end if
    self%run%simulation%velocities_set = mark(3) > 0.0_dp
    if (mark(4) > 0.0_dp) call self%run%simulation%wake()
    if (mark(5) > 0.0_dp) call self%note_setting("forces of bodies", "")
    self%velocities_set = .false.
    self%forces_set = .false.
    self%bodies_set = .false.
    if (self%unsaid /= "") call self%run%tell(self%unsaid, error)
    self%unsaid = ""
    if (.not. allocated(error)) call self%run%step(error)
    if (allocated(error)) self%cause = error
  end subroutine user_loop_step

  !> End the run after the present step, for a reason that the log tells. Without effect once the run is over. Collective.
  subroutine user_loop_stop(self, reason, error)
    class(user_loop_t), intent(inout) :: self
    character(len=*), intent(in) :: reason
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(self%cause)) return
    call wake_where_set(self)
    call self%run%stop(reason, error)
    if (allocated(error)) self%cause = error
  end subroutine user_loop_stop

  !> Write a checkpoint of the present step. Failures (status_input): the run is over; velocities were set, whose energy the balance
  !> takes with the next step; bodies were added or removed, which enter and leave with the next step and would be lost. Collective.
  subroutine user_loop_write_checkpoint(self, error)
    class(user_loop_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error

    if (.not. self%goes_on()) then
      call raise(error, status_input, "checkpoint: the run is over after step "//to_text(self%run%simulation%step)// &
        & "; expected a run that goes on")
      return
    end if
    associate (simulation => self%run%simulation)
      if (self%comm%any_true(self%velocities_set)) then
        call raise(error, status_input, "checkpoint: velocities were set, which take effect with the next step; expected a "// &
          & "checkpoint before that, or after that step")
        return
      end if
      if (simulation%inflow%given%n > 0 .or. allocated(simulation%decomposition%dismissed)) then
        call raise(error, status_input, "checkpoint: bodies that were added or removed enter or leave at the start of the next "// &
          & "step; expected a checkpoint before these calls, or after that step")
        return
      end if
    end associate
    call wake_where_set(self)
    call self%run%write_checkpoint(error)
    if (allocated(error)) self%cause = error
  end subroutine user_loop_write_checkpoint

  !> What is written before the next step has all bodies awake where a rank has set velocities or forces of some, as that step will
  !> have them: whichever rank holds them. Collective.
  subroutine wake_where_set(self)
    class(user_loop_t), intent(inout) :: self

    if (self%comm%any_true(self%bodies_set)) call self%run%simulation%wake()
  end subroutine wake_where_set

  !> End the run as the program does, and give back what it holds. Collective.
  subroutine user_loop_close(self, error)
    class(user_loop_t), intent(inout) :: self
    !> of the beginning; else that of the step that failed, or what happens now
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(self%cause) .and. .not. allocated(error)) error = self%cause
    if (.not. allocated(error)) call wake_where_set(self)
    call self%run%finish(error)
    call release_signals()
    call self%comm%free()
  end subroutine user_loop_close

  !> Take a value that was set into the account of settings.
  pure subroutine user_loop_note(self, what, number, values)
    class(user_loop_t), intent(inout) :: self
    !> what was set, and of which boundary, 0 for none
    character(len=*), intent(in) :: what
    integer, intent(in) :: number
    real(dp), intent(in) :: values(:)
    integer(i8) :: words(2 + len(what) + size(values))
    integer :: k

    words(1) = self%settings
    words(2) = number
    do k = 1, len(what)
      words(2 + k) = iachar(what(k:k))
    end do
    do k = 1, size(values)
      words(2 + len(what) + k) = transfer(values(k), 0_i8)
    end do
    self%settings = hash_words(words)
  end subroutine user_loop_note

  !> Remember that the loop has set something that acts until it is set again, and have the log say so the first time.
  pure subroutine user_loop_note_setting(self, what, values)
    class(user_loop_t), intent(inout) :: self
    !> its numbers; empty where there are too many
    character(len=*), intent(in) :: what, values

    associate (simulation => self%run%simulation)
      if (index(", "//simulation%set_by_loop//",", ", "//what//",") > 0) return
      if (simulation%set_by_loop /= "") simulation%set_by_loop = simulation%set_by_loop//", "
      simulation%set_by_loop = simulation%set_by_loop//what
      self%unsaid = self%unsaid//"loop        sets "//what//" from step "//to_text(simulation%step + 1)//" on"
      if (values /= "") self%unsaid = self%unsaid//", at first to "//values
      self%unsaid = self%unsaid//"; a restart begins without it"//new_line("a")
    end associate
  end subroutine user_loop_note_setting

  !> Numbers with blanks between.
  pure function numbers_text(values) result(text)
    real(dp), intent(in) :: values(:)
    character(len=:), allocatable :: text
    integer :: k

    text = ""
    do k = 1, size(values)
      text = text//" "//to_text(values(k), 4)
    end do
    text = text_from(text, 2)
  end function numbers_text

  !> Number of a boundary by its name. Failure: status_input, with the names there are.
  subroutine user_loop_place(self, name, b, error)
    class(user_loop_t), intent(in) :: self
    character(len=*), intent(in) :: name
    !> 0 after a failure
    integer, intent(out) :: b
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: names
    integer :: k

    b = 0
    names = ""
    associate (boundaries => self%run%simulation%decomposition%boundaries)
      do k = 1, size(boundaries)
        if (boundaries(k)%name == name) b = k
        names = names//merge(", ", "  ", k > 1)//boundaries(k)%name
      end do
    end associate
    if (names == "") names = "  a scene with boundaries"
    if (b == 0) call raise(error, status_input, "boundary '"//name//"': no boundary has this name; expected one of "//names(3:))
  end subroutine user_loop_place

  !> A field of the bodies of subdomain `s` of this rank that holds reals, as it is stored: (entries, bodies), (1, bodies) of single
  !> numbers. It is valid until the next step. Null for an unknown name.
  subroutine user_loop_get_array(self, name, s, values)
    class(user_loop_t), target, intent(in) :: self
    character(len=*), intent(in) :: name
    integer, intent(in) :: s
    real(dp), pointer, intent(out) :: values(:, :)
    type(body_set_t), pointer :: owned

    owned => self%run%simulation%decomposition%owned(s)
    values => null()
    select case (name)
    case ("position")
      values => owned%position
    case ("velocity")
      values => owned%velocity
    case ("force")
      values => owned%force
    case ("orientation")
      values => owned%orientation
    case ("radius")
      values(1:1, 1:owned%n) => owned%radius
    case ("mass")
      values(1:1, 1:owned%n) => owned%mass
    case ("inertia")
      values(1:1, 1:size(owned%inertia)) => owned%inertia
    end select
  end subroutine user_loop_get_array

  !> Whether velocities and spins, or applied forces, of the bodies of subdomain `s` of this rank can be set to some values.
  !> Failures (status_input): another field, another shape, no forces in this run, a value that is none to reckon with.
  subroutine user_loop_check_array(self, name, s, values, error)
    class(user_loop_t), intent(in) :: self
    character(len=*), intent(in) :: name
    integer, intent(in) :: s
    !> (entries, bodies)
    real(dp), intent(in), contiguous :: values(:, :)
    type(error_t), allocatable, intent(inout) :: error
    integer :: k, rows

    associate (owned => self%run%simulation%decomposition%owned(s))
      select case (name)
      case ("velocity")
        rows = owned%nv
      case ("force")
        rows = owned%nd
        if (owned%na == 0) call raise(error, status_input, &
          & "force: this run has no applied forces; expected a simulation that was opened with them")
      case default
        call raise(error, status_input, name//": cannot be set; expected one of velocity, force")
      end select
      if (allocated(error)) return
      if (size(values, 1) /= rows .or. size(values, 2) /= owned%n) then
        call raise(error, status_input, name//": an array of "//to_text(size(values, 2))//" bodies with "// &
          & to_text(size(values, 1))//" numbers each; expected "//to_text(owned%n)//" bodies with "//to_text(rows)//" numbers each")
        return
      end if
      do k = 1, owned%n
        if (all(is_bounded(values(:, k)))) cycle
        call raise(error, status_input, name//" of body "//to_text(owned%id(k))//": not a number to reckon with; expected "// &
          & bounded_text)
        return
      end do
    end associate
  end subroutine user_loop_check_array

  !> Set velocities and spins, or applied forces, of the bodies of subdomain `s` of this rank. Glued bodies keep their velocities.
  !> Failures: as of `check_array`.
  subroutine user_loop_set_array(self, name, s, values, error)
    class(user_loop_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer, intent(in) :: s
    !> (entries, bodies)
    real(dp), intent(in), contiguous :: values(:, :)
    type(error_t), allocatable, intent(inout) :: error
    integer :: k

    call self%check_array(name, s, values, error)
    if (.not. self%goes_on() .and. .not. allocated(error)) call raise(error, status_input, name//": the run is over after step "// &
      & to_text(self%run%simulation%step)//"; expected a run that goes on")
    if (allocated(error)) return
    associate (owned => self%run%simulation%decomposition%owned(s))
      if (name == "force") then
        owned%force(:, :) = values
        self%forces_set = .true.
      else
        do k = 1, owned%n
          if (owned%glued(k) == 0) owned%velocity(:, k) = values(:, k)
        end do
        self%velocities_set = .true.
      end if
      self%bodies_set = .true.
    end associate
  end subroutine user_loop_set_array

  !> Set gravity from the next step on. Failures (status_input): a table gives it; a value that is none to reckon with.
  subroutine user_loop_set_gravity(self, gravity, error)
    class(user_loop_t), intent(inout) :: self
    !> (nd) [m/s^2]
    real(dp), intent(in) :: gravity(:)
    type(error_t), allocatable, intent(inout) :: error

    associate (simulation => self%run%simulation, nd => self%run%simulation%decomposition%nd)
      if (size(gravity) /= nd) call raise(error, status_input, "gravity: "//to_text(size(gravity))//" numbers; expected "// &
        & to_text(nd))
      if (.not. all(is_bounded(gravity))) call raise(error, status_input, "gravity: not a number to reckon with; expected "// &
        & bounded_text)
      if (allocated(simulation%gravity_table%has)) call raise(error, status_input, &
        & "gravity: gravity_table gives it; expected a case without this table")
      if (allocated(error)) return
      simulation%physics%gravity(1:nd) = gravity
      call simulation%wake()
      call self%note("gravity", 0, gravity)
      call self%note_setting("gravity", numbers_text(gravity))
    end associate
  end subroutine user_loop_set_gravity

  !> Set the coefficient of friction between grains (b = 0), or between grains and boundary b. Failures (status_input): a value
  !> below 0; laws of materials, which have coefficients of their own; a scene whose contacts have no friction, and others that lack
  !> what the coefficient would bring.
  subroutine user_loop_set_friction(self, b, friction, error)
    class(user_loop_t), intent(inout) :: self
    integer, intent(in) :: b
    real(dp), intent(in) :: friction
    type(error_t), allocatable, intent(inout) :: error
    type(coefficients_t) :: contact
    real(dp) :: value(1)

    associate (simulation => self%run%simulation)
      contact = self%between_grains
      if (b > 0) contact = simulation%decomposition%boundaries(b)%contact
      if (.not. (friction >= 0.0_dp .and. is_bounded(friction))) call raise(error, status_input, &
        & "friction: expected a number from 0 to 1e30")
      if (simulation%physics%laws%n > 0) call raise(error, status_input, &
        & "friction: laws of materials have their own; expected a case without &law")
      if (.not. simulation%effects%friction) call raise(error, status_input, &
        & "friction: no contact of the scene has friction; expected a case in which some coefficient is above 0")
      if (contact%tangential_restitution > 0.0_dp .and. .not. simulation%effects%tangential_restitution) call raise(error, &
        & status_input, "friction: tangential_restitution acts where a case has friction; expected a coefficient above 0 there")
      if (allocated(error)) return
      contact%friction = friction
      if (b > 0) simulation%decomposition%boundaries(b)%contact = contact
      if (b == 0) self%between_grains = contact
      call simulation%physics%laws%set_default(b, contact)
      call simulation%wake()
      value(1) = friction
      call self%note("friction", b, value)
      if (b == 0) call self%note_setting("friction between grains", numbers_text(value))
      if (b > 0) call self%note_setting("friction of boundary '"//simulation%decomposition%boundaries(b)%name//"'", &
        & numbers_text(value))
    end associate
  end subroutine user_loop_set_friction

end module gravier_user_loop
