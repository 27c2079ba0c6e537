!> Grains that enter a scene while a run goes on: how many are owed, what each of them is, and the places that it may take. All of
!> it is a function of the seed, of the number of the insertion, and of the numbers of grains and of candidate places: it depends
!> neither on ranks nor on restarts. Grains enter in the order of their numbers. The one whose turn it is keeps its radius until a
!> place is found for it, so that the distribution of what has entered is the one asked for however dense the region is.
module gravier_insertion
  use gravier_kinds, only: dp, i8
  use gravier_random_hash, only: hash_uniform
  use gravier_random_turn, only: random_turn
  use gravier_shares, only: kind_at
  use gravier_finite, only: is_finite
  use gravier_motion, only: grain_volume
  use gravier_radius_distribution, only: radius_distribution_t
  implicit none
  private
  public :: insertion_t, new_grain_t, candidates_a_grain, most_a_step, insertion_words, insertion_record

  !> candidate places of a grain in a step: one bit of a word each
  integer, parameter :: candidates_a_grain = 60
  !> grains of an insertion that may enter in a step
  integer, parameter :: most_a_step = 1000
  !> words of the account of an insertion
  integer, parameter :: insertion_words = 5
  !> what they are, in their order: the version of checkpoints, which changes with them
  character(len=*), parameter :: insertion_record = "entered mass drawn put_off held_back"
  !> fraction of a grain that roundings of times take
  real(dp), parameter :: rounding = 1.0e-6_dp
  !> streams of random numbers of an insertion, and how many it has
  integer, parameter :: of_radius = 0, of_shape = 1, of_velocity = 2, of_turn = 5, of_place = 8, n_streams = 16
  real(dp), parameter :: whole_turn = 2.0_dp*acos(-1.0_dp)

  !> A grain that is to enter.
  type :: new_grain_t
    !> from 1, in the order of entry
    integer(i8) :: number = 0
    !> [m], [kg]
    real(dp) :: radius = 0.0_dp, mass = 0.0_dp
    !> number in the library of shapes, 0 for a disk or a sphere
    integer :: shape = 0
    !> [m/s]
    real(dp) :: velocity(3) = 0.0_dp
    !> an angle, or a unit quaternion [rad or 1]
    real(dp) :: turn(4) = 0.0_dp
  end type new_grain_t

  !> What is asked for, set by the caller, and the account of what has entered.
  type :: insertion_t
    character(len=:), allocatable :: name
    !> space dimension; place among the insertions of the scene, from 1
    integer :: nd = 3, place_in_scene = 1
    integer :: seed = 1
    !> a ball, else a box
    logical :: in_ball = .false.
    !> corners of the box, or of the box about the ball [m]
    real(dp) :: lower(3) = 0.0_dp, upper(3) = 0.0_dp
    type(radius_distribution_t) :: radii
    !> [kg/m^3, kg/m^2 in 2D], and number of the material
    real(dp) :: density = 1.0_dp
    integer :: material = 1
    !> shapes to draw from by their numbers in the library, 0 for a disk or a sphere; fractions up to each; volumes at a radius of 1
    !> (shapes); without shapes all are disks or spheres
    integer, allocatable :: shape(:)
    real(dp), allocatable :: bound(:), unit_volume(:)
    !> most by which a component is above or below the velocity [m/s]
    real(dp) :: velocity(3) = 0.0_dp, spread(3) = 0.0_dp
    !> grains [1/s] and mass [kg/s] owed by time; huge where no such rate is asked for
    real(dp) :: rate = huge(1.0_dp), mass_rate = huge(1.0_dp)
    !> [s]; grains enter in the steps that end after the one and begin before the other
    real(dp) :: start = 0.0_dp, end = huge(1.0_dp)
    !> after which it ends, and mass beyond which no grain enters [kg]
    integer(i8) :: most_grains = huge(1_i8)
    real(dp) :: most_mass = huge(1.0_dp)
    ! ---- the account
    !> grains that have entered, and their mass [kg]
    integer(i8) :: entered = 0
    real(dp) :: mass = 0.0_dp
    !> candidate places that have been drawn; steps in which a grain was put off, since none of its places was free
    integer(i8) :: drawn = 0, put_off = 0
    !> steps in which as many entered as may in a step, and more were owed
    integer(i8) :: held_back = 0
  contains
    procedure :: grain => insertion_grain
    procedure :: owes => insertion_owes
    procedure :: list_owed => insertion_list_owed
    procedure :: grains_behind => insertion_grains_behind
    procedure :: mass_behind => insertion_mass_behind
    procedure :: is_complete => insertion_is_complete
    procedure :: awaits => insertion_awaits
    procedure :: place => insertion_place
    procedure :: mean_mass => insertion_mean_mass
    procedure :: planned => insertion_planned
    procedure :: volume => insertion_volume
    procedure :: get_state => insertion_get_state
    procedure :: set_state => insertion_set_state
    procedure :: room_for => insertion_room_for
    procedure, private :: stream => insertion_stream
  end type insertion_t

contains

  !> First stream of a kind of random numbers.
  pure integer function insertion_stream(self, kind) result(stream)
    class(insertion_t), intent(in) :: self
    integer, intent(in) :: kind
    stream = n_streams*self%place_in_scene + kind
  end function insertion_stream

  !> The grain of that number.
  pure type(new_grain_t) function insertion_grain(self, number) result(grain)
    class(insertion_t), intent(in) :: self
    integer(i8), intent(in) :: number
    real(dp) :: volume
    integer :: d, k

    grain%number = number
    grain%radius = self%radii%quantile(hash_uniform(self%seed, number, self%stream(of_radius)))
    volume = grain_volume(self%nd, grain%radius)
    if (self%nd == 3) grain%turn(1) = 1.0_dp
    if (allocated(self%shape)) then
      k = kind_at(self%bound, hash_uniform(self%seed, number, self%stream(of_shape)))
      grain%shape = self%shape(k)
      if (grain%shape > 0) then
        volume = self%unit_volume(k)*grain%radius**self%nd
        call random_turn(self%seed, number, self%stream(of_turn), grain%turn(1:merge(1, 4, self%nd == 2)))
      end if
    end if
    grain%mass = self%density*volume
    do d = 1, self%nd
      grain%velocity(d) = self%velocity(d)
      if (self%spread(d) > 0.0_dp) grain%velocity(d) = self%velocity(d) + &
        & self%spread(d)*(2.0_dp*hash_uniform(self%seed, number, self%stream(of_velocity) + d - 1) - 1.0_dp)
    end do
  end function insertion_grain

  !> Whether a grain is owed once others have entered. A grain is owed when all of it is.
  pure logical function insertion_owes(self, entered, mass, next, until) result(owes)
    class(insertion_t), intent(in) :: self
    !> grains that have entered, and their mass [kg]
    integer(i8), intent(in) :: entered
    real(dp), intent(in) :: mass
    !> mass of the next one [kg]
    real(dp), intent(in) :: next
    !> [s]
    real(dp), intent(in) :: until
    real(dp) :: duration

    duration = min(until, self%end) - self%start
    owes = duration > 0.0_dp .and. entered < self%most_grains .and. mass + (1.0_dp - rounding)*next <= self%most_mass
    if (self%rate < huge(1.0_dp)) owes = owes .and. entered + (1.0_dp - rounding) <= self%rate*duration
    if (self%mass_rate < huge(1.0_dp)) owes = owes .and. mass + (1.0_dp - rounding)*next <= self%mass_rate*duration
  end function insertion_owes

  !> The grains that are owed in a step, as many as may enter in one, and whether more are owed.
  pure subroutine insertion_list_owed(self, time, step, grains, more)
    class(insertion_t), intent(in) :: self
    !> at the start of the step, and its length [s]
    real(dp), intent(in) :: time, step
    type(new_grain_t), allocatable, intent(out) :: grains(:)
    logical, intent(out) :: more
    type(new_grain_t), allocatable :: owed(:)
    type(new_grain_t) :: next
    real(dp) :: mass
    integer :: n

    allocate (owed(most_a_step))
    n = 0
    mass = self%mass
    more = .false.
    do while (time < self%end)
      next = self%grain(self%entered + n + 1)
      if (.not. self%owes(self%entered + n, mass, next%mass, time + step)) exit
      more = n == most_a_step
      if (more) exit
      n = n + 1
      owed(n) = next
      mass = mass + next%mass
    end do
    grains = owed(1:n)
  end subroutine insertion_list_owed

  !> Grains by which it is behind its rate; 0 without a rate of grains.
  pure integer(i8) function insertion_grains_behind(self, time) result(behind)
    class(insertion_t), intent(in) :: self
    !> [s]
    real(dp), intent(in) :: time
    real(dp) :: owed

    behind = 0
    if (.not. self%rate < huge(1.0_dp) .or. self%is_complete()) return
    owed = min(self%rate*max(min(time, self%end) - self%start, 0.0_dp) + rounding, real(self%most_grains, dp))
    ! the bound on the mass lets in about so many more
    if (self%most_mass < huge(1.0_dp)) owed = min(owed, self%entered + max(1.0_dp, (self%most_mass - self%mass)/self%mean_mass()))
    if (self%owes(self%entered, self%mass, 0.0_dp, time)) behind = int(owed, i8) - self%entered
  end function insertion_grains_behind

  !> Mass by which it is behind its rate of mass, where that is a grain or more [kg]; 0 without a rate of mass.
  pure real(dp) function insertion_mass_behind(self, time) result(behind)
    class(insertion_t), intent(in) :: self
    !> [s]
    real(dp), intent(in) :: time
    type(new_grain_t) :: next

    behind = 0.0_dp
    if (.not. self%mass_rate < huge(1.0_dp)) return
    next = self%grain(self%entered + 1)
    if (self%owes(self%entered, self%mass, next%mass, time)) behind = min(self%mass_rate*(min(time, self%end) - self%start), &
      & self%most_mass) - self%mass
  end function insertion_mass_behind

  !> Whether as many grains have entered as its bounds allow.
  pure logical function insertion_is_complete(self) result(is_complete)
    class(insertion_t), intent(in) :: self
    type(new_grain_t) :: next

    is_complete = self%entered >= self%most_grains
    if (is_complete .or. .not. self%most_mass < huge(1.0_dp)) return
    next = self%grain(self%entered + 1)
    is_complete = self%mass + (1.0_dp - rounding)*next%mass > self%most_mass
  end function insertion_is_complete

  !> Whether grains are to enter later: it has not begun, or its rate owes none now and will owe some. One that finds no places
  !> awaits nothing.
  pure logical function insertion_awaits(self, time) result(awaits)
    class(insertion_t), intent(in) :: self
    !> [s]
    real(dp), intent(in) :: time

    awaits = time < self%end .and. .not. self%is_complete()
    if (.not. awaits .or. time < self%start) return
    awaits = min(self%rate, self%mass_rate) < huge(1.0_dp) .and. self%grains_behind(time) == 0 .and. &
      & .not. self%mass_behind(time) > 0.0_dp
  end function insertion_awaits

  !> A place for a grain, wholly in the region: all are as likely.
  pure subroutine insertion_place(self, candidate, radius, position)
    class(insertion_t), intent(in) :: self
    !> number of the candidate
    integer(i8), intent(in) :: candidate
    !> of the grain [m]
    real(dp), intent(in) :: radius
    !> (nd) [m]
    real(dp), intent(out) :: position(:)
    real(dp) :: x(3), way, across
    integer :: d

    x(:) = 0.0_dp
    do d = 1, self%nd
      x(d) = hash_uniform(self%seed, candidate, self%stream(of_place) + d - 1)
    end do
    if (.not. self%in_ball) then
      do d = 1, self%nd
        position(d) = self%lower(d) + radius + x(d)*max(self%upper(d) - self%lower(d) - 2.0_dp*radius, 0.0_dp)
      end do
      return
    end if
    way = max(0.5_dp*(self%upper(1) - self%lower(1)) - radius, 0.0_dp)*x(1)**(1.0_dp/self%nd)
    position(:) = 0.5_dp*(self%lower(1:self%nd) + self%upper(1:self%nd))
    across = way
    if (self%nd == 3) then
      across = way*sqrt(1.0_dp - (2.0_dp*x(3) - 1.0_dp)**2)
      position(3) = position(3) + way*(2.0_dp*x(3) - 1.0_dp)
    end if
    position(1) = position(1) + across*cos(whole_turn*x(2))
    position(2) = position(2) + across*sin(whole_turn*x(2))
  end subroutine insertion_place

  !> Mean mass of its grains [kg].
  pure real(dp) function insertion_mean_mass(self) result(mass)
    class(insertion_t), intent(in) :: self
    real(dp) :: unit, below
    integer :: k

    unit = grain_volume(self%nd, 1.0_dp)
    if (allocated(self%shape)) then
      below = 0.0_dp
      unit = 0.0_dp
      do k = 1, size(self%shape)
        unit = unit + (self%bound(k) - below)*merge(self%unit_volume(k), grain_volume(self%nd, 1.0_dp), self%shape(k) > 0)
        below = self%bound(k)
      end do
    end if
    mass = self%density*unit*self%radii%moment(self%nd)
  end function insertion_mean_mass

  !> Grains that are to have entered by a time, about; huge where nothing bounds their number.
  pure real(dp) function insertion_planned(self, time) result(number)
    class(insertion_t), intent(in) :: self
    !> [s]
    real(dp), intent(in) :: time
    real(dp) :: duration

    duration = max(min(time, self%end) - self%start, 0.0_dp)
    number = huge(1.0_dp)
    if (self%is_complete()) number = real(self%entered, dp)
    if (self%most_grains < huge(1_i8)) number = min(number, real(self%most_grains, dp))
    if (self%most_mass < huge(1.0_dp)) number = min(number, self%most_mass/self%mean_mass())
    if (self%rate < huge(1.0_dp)) number = min(number, self%rate*duration)
    if (self%mass_rate < huge(1.0_dp)) number = min(number, self%mass_rate*duration/self%mean_mass())
  end function insertion_planned

  !> Volume of the region [m^3], area in 2D [m^2].
  pure real(dp) function insertion_volume(self) result(volume)
    class(insertion_t), intent(in) :: self

    volume = product(self%upper(1:self%nd) - self%lower(1:self%nd))
    if (self%in_ball) volume = grain_volume(self%nd, 0.5_dp*(self%upper(1) - self%lower(1)))
  end function insertion_volume

  !> Whether a grain has room in the region.
  pure logical function insertion_room_for(self, radius) result(has_room)
    class(insertion_t), intent(in) :: self
    !> [m]
    real(dp), intent(in) :: radius
    has_room = all(self%upper(1:self%nd) - self%lower(1:self%nd) >= 2.0_dp*radius*(1.0_dp - rounding))
  end function insertion_room_for

  !> The account as words of a checkpoint.
  pure subroutine insertion_get_state(self, words)
    class(insertion_t), intent(in) :: self
    integer(i8), intent(out) :: words(insertion_words)

    words(1) = self%entered
    words(2) = transfer(self%mass, 0_i8)
    words(3) = self%drawn
    words(4) = self%put_off
    words(5) = self%held_back
  end subroutine insertion_get_state

  !> Take an account from the words of a checkpoint, or find out that it is none.
  pure subroutine insertion_set_state(self, words, sound)
    class(insertion_t), intent(inout) :: self
    integer(i8), intent(in) :: words(insertion_words)
    logical, intent(out) :: sound

    self%entered = words(1)
    self%mass = transfer(words(2), 0.0_dp)
    self%drawn = words(3)
    self%put_off = words(4)
    self%held_back = words(5)
    ! the word of a mass below 0 is below 0 too
    sound = minval(words) >= 0 .and. is_finite(self%mass)
  end subroutine insertion_set_state

end module gravier_insertion
