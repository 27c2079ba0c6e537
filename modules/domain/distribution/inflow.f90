!> Grains that enter the scene. Every rank knows which grains are owed and where they may be placed; subdomains near a region find
!> out which of these places bodies take, and reductions of a word a grain tell all ranks. All then choose alike, and the
!> subdomain that holds the place of a grain owns it.
module gravier_inflow
  use gravier_kinds, only: dp, i8
  use gravier_finite, only: is_finite
  use gravier_body_store, only: body_set_t, append_bodies
  use gravier_placed_grains, only: sample_box_t, placed_grains_t
  use gravier_insertion, only: insertion_t, new_grain_t, candidates_a_grain, insertion_words
  use gravier_free_places, only: is_clear
  use gravier_decomposition, only: decomposition_t
  implicit none
  private
  public :: inflow_t, placed_t, given_words, given_record

  !> words of the account of grains that a loop of the user's own has placed
  integer, parameter :: given_words = 2
  !> what they are, in their order: the version of checkpoints, which changes with them
  character(len=*), parameter :: given_record = "given_entered given_mass"

  !> grains of an insertion whose candidate places are looked at together, at first
  integer, parameter :: looked_at_once = 16

  !> Grains with their centres (nd, n) [m] and materials (n).
  type :: placed_t
    integer :: n = 0
    type(new_grain_t), allocatable :: grain(:)
    real(dp), allocatable :: position(:, :)
    integer, allocatable :: material(:)
  end type placed_t

  type :: inflow_t
    type(insertion_t), allocatable :: insertions(:)
    !> of the next grain: larger than all that the scene has had
    integer(i8) :: next_id = 1
    !> grains that a loop of the user's own has placed, the same on every rank: they enter in the next step, before all others
    type(placed_t) :: given
    !> those of them that have entered, and their mass [kg]
    integer(i8) :: given_entered = 0
    real(dp) :: given_mass = 0.0_dp
  contains
    procedure :: exists => inflow_exists
    procedure :: is_due => inflow_is_due
    procedure :: enter => inflow_enter
    procedure :: awaits => inflow_awaits
    procedure :: is_blocked => inflow_is_blocked
    procedure :: entered => inflow_entered
    procedure :: mass => inflow_mass
    procedure :: get_state => inflow_get_state
    procedure :: set_state => inflow_set_state
  end type inflow_t

  !> The grains that an insertion owes in a step, with a word each: bits of candidate places that are taken, up to `looked_at`.
  type :: owed_t
    type(new_grain_t), allocatable :: grain(:)
    integer(i8), allocatable :: taken(:)
    integer :: looked_at = 0
    !> the bodies of this rank that reach into the region
    type(placed_grains_t) :: near
    !> it owes more than may enter in a step
    logical :: more = .false.
  end type owed_t

contains

  !> Whether grains enter by insertions at some time.
  pure logical function inflow_exists(self) result(exists)
    class(inflow_t), intent(in) :: self

    exists = .false.
    if (allocated(self%insertions)) exists = size(self%insertions) > 0
  end function inflow_exists

  !> Whether grains may enter in the next step.
  pure logical function inflow_is_due(self) result(due)
    class(inflow_t), intent(in) :: self

    due = self%exists() .or. self%given%n > 0
  end function inflow_is_due

  !> Whether grains are to enter after a time.
  pure logical function inflow_awaits(self, time) result(awaits)
    class(inflow_t), intent(in) :: self
    !> [s]
    real(dp), intent(in) :: time
    integer :: k

    awaits = self%given%n > 0
    if (.not. self%exists()) return
    do k = 1, size(self%insertions)
      awaits = awaits .or. self%insertions(k)%awaits(time)
    end do
  end function inflow_awaits

  !> Whether some insertion is under way and not complete: where none `awaits`, it has no places for its grains.
  pure logical function inflow_is_blocked(self, time) result(is_blocked)
    class(inflow_t), intent(in) :: self
    !> [s]
    real(dp), intent(in) :: time
    integer :: k

    is_blocked = .false.
    if (.not. self%exists()) return
    do k = 1, size(self%insertions)
      associate (insertion => self%insertions(k))
        is_blocked = is_blocked .or. (time >= insertion%start .and. time < insertion%end .and. .not. insertion%is_complete())
      end associate
    end do
  end function inflow_is_blocked

  !> Grains that have entered so far.
  pure integer(i8) function inflow_entered(self) result(entered)
    class(inflow_t), intent(in) :: self

    entered = self%given_entered
    if (self%exists()) entered = entered + sum(self%insertions%entered)
  end function inflow_entered

  !> Their mass [kg].
  pure real(dp) function inflow_mass(self) result(mass)
    class(inflow_t), intent(in) :: self

    mass = self%given_mass
    if (self%exists()) mass = mass + sum(self%insertions%mass)
  end function inflow_mass

  !> The accounts of the grains that a loop has placed and of all insertions, as words of a checkpoint.
  pure subroutine inflow_get_state(self, words)
    class(inflow_t), intent(in) :: self
    !> (given_words and insertion_words times insertions)
    integer(i8), allocatable, intent(out) :: words(:)
    integer :: i, first

    allocate (words(given_words + insertion_words*size(self%insertions)))
    words(1) = self%given_entered
    words(2) = transfer(self%given_mass, 0_i8)
    do i = 1, size(self%insertions)
      first = given_words + (i - 1)*insertion_words + 1
      call self%insertions(i)%get_state(words(first:first + insertion_words - 1))
    end do
  end subroutine inflow_get_state

  !> Take the accounts from the words of a checkpoint, or find out that they are none.
  pure subroutine inflow_set_state(self, words, sound)
    class(inflow_t), intent(inout) :: self
    integer(i8), intent(in) :: words(given_words + insertion_words*size(self%insertions))
    logical, intent(out) :: sound
    logical :: fine
    integer :: i, first

    self%given_entered = words(1)
    self%given_mass = transfer(words(2), 0.0_dp)
    ! the word of a mass below 0 is below 0 too
    sound = self%next_id > 0 .and. minval(words(1:given_words)) >= 0 .and. is_finite(self%given_mass)
    do i = 1, size(self%insertions)
      first = given_words + (i - 1)*insertion_words + 1
      call self%insertions(i)%set_state(words(first:first + insertion_words - 1), fine)
      sound = sound .and. fine
    end do
  end subroutine inflow_set_state

  !> Let grains enter in a step, whose bodies are where gaps are measured. A grain for which none of its candidate places is free is
  !> put off to the next step, with all that come after it. Without a grain that is owed nothing is computed or sent. Collective.
  subroutine inflow_enter(self, decomposition, time, step)
    class(inflow_t), intent(inout) :: self
    type(decomposition_t), intent(inout) :: decomposition
    !> at the start of the step, and its length [s]
    real(dp), intent(in) :: time, step
    type(owed_t), allocatable :: owed(:)
    type(placed_t) :: placed
    integer(i8), allocatable :: words(:)
    integer :: i, first, n

    if (self%given%n > 0) call enter_given(self, decomposition)
    if (.not. self%exists()) return
    allocate (owed(size(self%insertions)))
    n = 0
    do i = 1, size(owed)
      call self%insertions(i)%list_owed(time, step, owed(i)%grain, owed(i)%more)
      n = n + size(owed(i)%grain)
    end do
    if (n == 0) return
    allocate (placed%grain(n), placed%position(decomposition%nd, n), placed%material(n))
    allocate (words(looked_at_once*size(owed)), source=0_i8)
    first = 1
    do i = 1, size(owed)
      associate (own => owed(i))
        allocate (own%taken(size(own%grain)), source=0_i8)
        if (size(own%grain) > 0) call collect_near(self%insertions(i), decomposition, maxval(own%grain%radius), own%near)
        n = min(looked_at_once, size(own%grain))
        call find_taken(self%insertions(i), own, n)
        words(first:first + n - 1) = own%taken(1:n)
        first = first + n
      end associate
    end do
    call decomposition%comm%union_of(words(1:first - 1))
    first = 1
    do i = 1, size(owed)
      n = owed(i)%looked_at
      owed(i)%taken(1:n) = words(first:first + n - 1)
      first = first + n
      call let_in(self%insertions(i), owed(i), decomposition, placed)
    end do
    if (placed%n > 0) call create_bodies(decomposition, placed, self%next_id)
    self%next_id = self%next_id + placed%n
  end subroutine inflow_enter

  !> Let the grains enter that were given with their places.
  subroutine enter_given(self, decomposition)
    class(inflow_t), intent(inout) :: self
    type(decomposition_t), intent(inout) :: decomposition

    call create_bodies(decomposition, self%given, self%next_id)
    self%next_id = self%next_id + self%given%n
    self%given_entered = self%given_entered + self%given%n
    self%given_mass = self%given_mass + sum(self%given%grain(1:self%given%n)%mass)
    self%given%n = 0
  end subroutine enter_given

  !> Place the grains that an insertion owes, whose first ones have been looked at on all ranks. As most insertions that fill their
  !> region find places for few, the others are looked at as it comes to them, twice as many each time. Collective.
  subroutine let_in(insertion, owed, decomposition, placed)
    type(insertion_t), intent(inout) :: insertion
    type(owed_t), intent(inout) :: owed
    type(decomposition_t), intent(in) :: decomposition
    type(placed_t), intent(inout) :: placed
    integer :: first
    logical :: found

    first = 1
    do
      call choose_places(insertion, owed, first, decomposition, placed, found)
      if (.not. found .or. owed%looked_at == size(owed%grain)) exit
      first = owed%looked_at + 1
      call find_taken(insertion, owed, min(2*owed%looked_at, size(owed%grain)))
      call decomposition%comm%union_of(owed%taken(first:owed%looked_at))
    end do
    if (.not. found) insertion%put_off = insertion%put_off + 1
    if (found .and. owed%more) insertion%held_back = insertion%held_back + 1
    insertion%drawn = insertion%drawn + int(size(owed%grain), i8)*candidates_a_grain
  end subroutine let_in

  !> Candidate places that bodies of this rank take, of the grains up to one.
  subroutine find_taken(insertion, owed, last)
    type(insertion_t), intent(in) :: insertion
    type(owed_t), intent(inout) :: owed
    integer, intent(in) :: last
    real(dp) :: position(insertion%nd)
    integer :: first, k, c

    first = owed%looked_at + 1
    owed%looked_at = last
    if (owed%near%n == 0) return
    do k = first, last
      do c = 1, candidates_a_grain
        call insertion%place(candidate_of(insertion, k, c), owed%grain(k)%radius, position)
        if (owed%near%blocks(0_i8, owed%grain(k)%radius, position)) owed%taken(k) = ibset(owed%taken(k), c - 1)
      end do
    end do
  end subroutine find_taken

  !> Number of candidate place `c` of the `k`th grain of a step.
  pure integer(i8) function candidate_of(insertion, k, c) result(number)
    type(insertion_t), intent(in) :: insertion
    integer, intent(in) :: k, c
    number = insertion%drawn + (k - 1)*candidates_a_grain + c
  end function candidate_of

  !> The bodies of this rank that reach into a region, and those of their images that do.
  subroutine collect_near(insertion, decomposition, radius, near)
    type(insertion_t), intent(in) :: insertion
    type(decomposition_t), intent(in) :: decomposition
    !> of the largest grain that is owed [m]
    real(dp), intent(in) :: radius
    type(placed_grains_t), intent(inout) :: near
    type(sample_box_t) :: box
    real(dp) :: largest, x(insertion%nd), image(insertion%nd), length(insertion%nd)
    integer :: s, k, i, d, nd, turns(insertion%nd)

    nd = insertion%nd
    length(:) = decomposition%period%length(1:nd)
    largest = radius
    do s = 1, size(decomposition%owned)
      if (decomposition%owned(s)%n > 0) largest = max(largest, maxval(decomposition%owned(s)%radius))
    end do
    box%nd = nd
    box%lower(1:nd) = insertion%lower(1:nd) - largest
    box%upper(1:nd) = insertion%upper(1:nd) + largest
    call near%init(box, largest, .false.)
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        do k = 1, owned%n
          x(:) = owned%position(:, k)
          ! the image next to the region comes first
          where (length > 0.0_dp) x = x - length*anint((x - 0.5_dp*(insertion%lower(1:nd) + insertion%upper(1:nd)))/ &
            & merge(length, 1.0_dp, length > 0.0_dp))
          do i = 0, merge(3**nd - 1, 0, decomposition%period%on())
            do d = 1, nd
              turns(d) = mod(i/3**(d - 1) + 1, 3) - 1
            end do
            if (any(turns /= 0 .and. .not. length > 0.0_dp)) cycle
            image(:) = x + turns*length
            if (any(image < insertion%lower(1:nd) - owned%radius(k) .or. image > insertion%upper(1:nd) + owned%radius(k))) cycle
            call near%insert(owned%id(k), owned%radius(k), image)
          end do
        end do
      end associate
    end do
  end subroutine collect_near

  !> Place grains that have been looked at one after the other, from one on and up to the first that finds no place.
  subroutine choose_places(insertion, owed, first, decomposition, placed, found)
    type(insertion_t), intent(inout) :: insertion
    type(owed_t), intent(in) :: owed
    integer, intent(in) :: first
    type(decomposition_t), intent(in) :: decomposition
    type(placed_t), intent(inout) :: placed
    !> whether all of them have found places
    logical, intent(out) :: found
    real(dp) :: position(decomposition%nd)
    integer :: k, c

    found = .true.
    do k = first, owed%looked_at
      associate (grain => owed%grain(k))
        found = .false.
        do c = 1, candidates_a_grain
          if (btest(owed%taken(k), c - 1)) cycle
          call insertion%place(candidate_of(insertion, k, c), grain%radius, position)
          found = is_apart(placed, grain%radius, position) .and. is_clear(decomposition%boundaries, grain%radius, position)
          if (found) exit
        end do
        if (.not. found) return
        placed%n = placed%n + 1
        placed%grain(placed%n) = grain
        placed%position(:, placed%n) = position
        placed%material(placed%n) = insertion%material
        insertion%entered = insertion%entered + 1
        insertion%mass = insertion%mass + grain%mass
      end associate
    end do
  end subroutine choose_places

  !> Whether a place overlaps none of those that have been chosen.
  pure logical function is_apart(placed, radius, position) result(apart)
    type(placed_t), intent(in) :: placed
    !> [m]; (nd) [m]
    real(dp), intent(in) :: radius, position(:)
    integer :: k

    apart = .false.
    do k = 1, placed%n
      if (sum((position - placed%position(:, k))**2) < (radius + placed%grain(k)%radius)**2) return
    end do
    apart = .true.
  end function is_apart

  !> Make the bodies of the grains that have been placed, where a subdomain of this rank holds their places. Their identifiers are
  !> larger than all others, so that bodies stay in the order of theirs, and each in its place.
  subroutine create_bodies(decomposition, placed, first_id)
    type(decomposition_t), intent(inout) :: decomposition
    type(placed_t), intent(in) :: placed
    !> of the first of them; the others follow
    integer(i8), intent(in) :: first_id
    type(body_set_t) :: newcomers
    integer :: home(placed%n), s, k, n

    do k = 1, placed%n
      home(k) = decomposition%partition%owner(placed%position(:, k)) - decomposition%first + 1
    end do
    do s = 1, size(decomposition%owned)
      call newcomers%init(decomposition%layout(), count(home == s))
      n = 0
      do k = 1, placed%n
        if (home(k) /= s) cycle
        n = n + 1
        newcomers%id(n) = first_id + k - 1
        call set_body(decomposition, placed, k, newcomers, n)
      end do
      call append_bodies(decomposition%owned(s), newcomers)
    end do
  end subroutine create_bodies

  !> Set all fields of a body but the identifier.
  subroutine set_body(decomposition, placed, k, bodies, n)
    type(decomposition_t), intent(in) :: decomposition
    type(placed_t), intent(in) :: placed
    !> the grain, and the body
    integer, intent(in) :: k, n
    type(body_set_t), intent(inout) :: bodies
    integer :: nd

    nd = bodies%nd
    associate (grain => placed%grain(k))
      bodies%radius(n) = grain%radius
      bodies%mass(n) = grain%mass
      bodies%glued(n) = 0
      bodies%material(n) = placed%material(k)
      bodies%position(:, n) = placed%position(:, k)
      bodies%velocity(:, n) = 0.0_dp
      bodies%velocity(1:nd, n) = grain%velocity(1:nd)
      bodies%image(:, n) = 0
      if (bodies%no > 0) then
        bodies%shape(n) = grain%shape
        bodies%orientation(:, n) = grain%turn(1:bodies%no)
      end if
      if (bodies%nv == nd) return
      bodies%inertia(n) = decomposition%shapes%inertia(grain%shape, nd, grain%radius, grain%mass)
    end associate
  end subroutine set_body

end module gravier_inflow
