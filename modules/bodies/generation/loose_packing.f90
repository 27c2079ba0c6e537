!> Grains placed without overlap at random in a box. Where a grain comes to lie depends on the seed, the box and all
!> identifiers and radii, never on the number of ranks or on which rank asks for it.
module gravier_loose_packing
  use gravier_kinds, only: dp, i4, i8
  use gravier_narrow, only: narrow
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_random_hash, only: hash_uniform
  use gravier_communicator, only: communicator_t
  use gravier_motion, only: grain_mass
  use gravier_bricks, only: outbox_t, bricks_t
  use gravier_placed_grains, only: sample_box_t, placed_grains_t
  implicit none
  private
  public :: place_loosely

  !> Grains of radii from R/2^(k/4) down to R/2^((k + 1)/4) are class k, R the largest radius; the last has all that are
  !> smaller. Classes are placed one after the other, since large grains would find no place after small ones. Grains of four
  !> classes are kept in one table of cells.
  integer, parameter :: classes_per_table = 4
  integer, parameter :: last_of_classes = 30*classes_per_table
  !> fewest places tried in a round by all grains together, and most by one grain
  integer, parameter :: fewest_trials = 1000, most_trials = 1000
  !> rounds after which a class is given up
  integer, parameter :: most_rounds = 2000

  !> The state of a placement on one rank.
  type :: placement_t
    class(sample_box_t), allocatable :: box
    type(bricks_t) :: bricks
    integer :: seed = 0
    !> of all grains of all ranks [m]
    real(dp) :: largest = 0.0_dp
    !> grains of this rank: (n), (n) [m], (nd, n) [m]
    integer(i8), allocatable :: id(:)
    real(dp), allocatable :: radius(:), position(:, :)
    !> class being placed, and those of its grains on this rank that have no place yet
    integer :: size_class = 0
    integer, allocatable :: waiting(:)
    !> places that each waiting grain tried in earlier rounds and tries in this one
    integer :: tried = 0, trials = 0
    !> grains that are in the brick of this rank or reach into it, table by table from 0
    type(placed_grains_t), allocatable :: placed(:)
    !> proposals of a round that are in the brick of this rank or reach into it
    type(placed_grains_t) :: rivals
  contains
    procedure :: class_of => placement_class_of
    procedure :: class_radius => placement_class_radius
    procedure :: reach => placement_reach
    procedure :: trial_place => placement_trial_place
    procedure :: choose_waiting => placement_choose_waiting
    procedure :: release => placement_release
  end type placement_t

contains

  !> Random sequential addition, largest grains first, in rounds: every grain without a place tries some random places; the
  !> first that is clear of all placed grains becomes its proposal; a proposal stands unless it overlaps one of a larger
  !> grain, or one of a grain of the same radius and a smaller identifier. Grains of one radius fill up to about 0.35 of a
  !> large box in 3D and 0.53 in 2D, wider distributions more. Places where boundaries leave no room are not tried. Failure
  !> (status_input, without the name of a file or key): a grain wider than the box, or grains that find no place. Errors are the
  !> same on all ranks. Collective.
  subroutine place_loosely(comm, box, seed, id, radius, position, error)
    type(communicator_t), intent(in) :: comm
    class(sample_box_t), intent(in) :: box
    integer, intent(in) :: seed
    !> identifiers of the grains of this rank, no two alike on any ranks (n)
    integer(i8), intent(in), contiguous :: id(:)
    !> (n) [m]
    real(dp), intent(in), contiguous :: radius(:)
    !> centres, (nd, n) [m]; lower <= position < upper along periodic axes; undefined after an error
    real(dp), intent(out), contiguous :: position(:, :)
    type(error_t), allocatable, intent(inout) :: error
    type(placement_t) :: placement
    integer :: size_class, last_class
    integer(i8) :: left

    position(:, :) = 0.0_dp
    if (allocated(error)) return
    if (comm%total(size(id, kind=i8)) == 0) return
    placement%largest = comm%highest(maxval(radius))
    call check_width(box, placement%largest, error)
    if (allocated(error)) return
    allocate (placement%box, source=box)
    placement%seed = seed
    placement%id = id
    placement%radius = radius
    placement%position = position
    call placement%bricks%init(box, comm%size)
    last_class = placement%class_of(comm%lowest(minval(radius)))
    allocate (placement%placed(0:last_class/classes_per_table))
    do size_class = 0, last_class
      call place_class(comm, placement, size_class, left)
      if (left > 0) then
        call raise_too_dense(comm, box, radius, placement%class_radius(size_class + 1), left, error)
        return
      end if
    end do
    position(:, :) = placement%position
  end subroutine place_loosely

  !> The largest grain fits into the box.
  subroutine check_width(box, largest, error)
    type(sample_box_t), intent(in) :: box
    real(dp), intent(in) :: largest
    type(error_t), allocatable, intent(inout) :: error
    integer :: d

    do d = 1, box%nd
      if (2.0_dp*largest > box%upper(d) - box%lower(d)) then
        call raise(error, status_input, "the box is "//to_text(box%upper(d) - box%lower(d))//" m wide along axis "// &
          & to_text(d)//", but the largest grain has a diameter of "//to_text(2.0_dp*largest)//" m")
      end if
    end do
  end subroutine check_width

  !> Say how full the box was to be. Collective.
  subroutine raise_too_dense(comm, box, radius, least, left, error)
    type(communicator_t), intent(in) :: comm
    class(sample_box_t), intent(in) :: box
    real(dp), intent(in), contiguous :: radius(:)
    !> radius above which grains were tried [m], and those of them without a place
    real(dp), intent(in) :: least
    integer(i8), intent(in) :: left
    type(error_t), allocatable, intent(inout) :: error
    real(dp), allocatable :: volume(:)
    real(dp) :: fraction
    integer(i8) :: total, tried
    integer :: k

    allocate (volume(size(radius)))
    do k = 1, size(radius)
      volume(k) = grain_mass(box%nd, radius(k), 1.0_dp)
    end do
    fraction = comm%sum_real(volume)/box%volume()
    total = comm%total(size(radius, kind=i8))
    tried = comm%total(count(radius > least, kind=i8))
    call raise(error, status_input, box%too_many(fraction)//": of "//to_text(total)//" grains, the largest "//to_text(tried)// &
      & " were tried, and "//to_text(left)//" of these found no place; random places take up to "// &
      & merge("0.53", "0.35", box%nd == 2)//" of grains of one radius, less in a narrow box")
  end subroutine raise_too_dense

  !> Give the grains of one class their places. Collective.
  subroutine place_class(comm, self, size_class, left)
    type(communicator_t), intent(in) :: comm
    type(placement_t), intent(inout) :: self
    integer, intent(in) :: size_class
    !> grains of all ranks that found no place
    integer(i8), intent(out) :: left
    integer(i8) :: wanted, history(most_rounds)
    integer :: round
    logical, allocatable :: clear(:)

    self%size_class = size_class
    self%tried = 0
    if (mod(size_class, classes_per_table) == 0) &
      & call self%placed(size_class/classes_per_table)%init(self%box, self%class_radius(size_class), .false.)
    call self%choose_waiting()
    left = comm%total(size(self%waiting, kind=i8))
    wanted = max(left, int(fewest_trials, i8))
    do round = 1, most_rounds
      if (left == 0) return
      history(round) = left
      if (is_hopeless(self%box%nd, history(1:round))) return
      self%trials = narrow(min(wanted/left, int(most_trials, i8)))
      call find_clear_places(comm, self, clear)
      call settle_proposals(comm, self, clear)
      self%tried = self%tried + self%trials
      left = comm%total(size(self%waiting, kind=i8))
    end do
  end subroutine place_class

  !> Whether what is left will not find places. Below the fraction where a box is full, the number of grains left after t
  !> rounds falls faster than t^(-1/nd), or t^(-1/(nd + 1)) for grains of many radii: to 0.5 (2D) or 0.6 (3D) when t grows
  !> eightfold.
  pure logical function is_hopeless(nd, left)
    integer, intent(in) :: nd
    !> before each round
    integer(i8), intent(in), contiguous :: left(:)
    integer, parameter :: earliest_round = 128, fewest_left = 100
    integer :: round

    round = size(left)
    is_hopeless = .false.
    if (round < earliest_round) return
    is_hopeless = left(round) >= fewest_left .and. 10*left(round) > merge(5, 6, nd == 2)*left(round/8)
  end function is_hopeless

  !> Find the first trial of each waiting grain that is clear of all placed grains, and make it its position. Collective.
  subroutine find_clear_places(comm, self, clear)
    type(communicator_t), intent(in) :: comm
    type(placement_t), intent(inout) :: self
    !> whether there is one, (size of waiting)
    logical, allocatable, intent(out) :: clear(:)
    integer(i8), allocatable :: received(:, :)
    type(outbox_t) :: trials, answers
    real(dp) :: position(self%box%nd)
    integer(i8) :: record(4 + self%box%nd)
    integer :: w, t, g

    call trials%init(size(record), size(self%waiting)*self%trials)
    do w = 1, size(self%waiting)
      g = self%waiting(w)
      do t = 1, self%trials
        call self%trial_place(g, self%tried + t, position)
        if (.not. self%box%leaves_room(self%radius(g), position)) cycle
        record(1) = comm%rank
        record(2) = w
        record(3) = t
        record(4) = word_of(self%radius(g))
        record(5:) = word_of(position)
        call trials%add(self%bricks%rank_of(position), record)
      end do
    end do
    call trials%exchange(comm, received)
    call answers%init(2, size(received, 2)/4 + 1)
    do t = 1, size(received, 2)
      position(:) = real_of(received(5:, t))
      if (is_clear(self, real_of(received(4, t)), position)) call answers%add(narrow(received(1, t)), received(2:3, t))
    end do
    call answers%exchange(comm, received)
    call take_first_trials(self, received, clear)
  end subroutine find_clear_places

  !> Move each waiting grain to the first of its trials that are among the answers.
  subroutine take_first_trials(self, answers, clear)
    type(placement_t), intent(inout) :: self
    !> (waiting grain, trial)
    integer(i8), intent(in), contiguous :: answers(:, :)
    logical, allocatable, intent(out) :: clear(:)
    integer, allocatable :: first(:)
    integer :: k, w

    allocate (first(size(self%waiting)), source=huge(1))
    do k = 1, size(answers, 2)
      w = narrow(answers(1, k))
      first(w) = min(first(w), narrow(answers(2, k)))
    end do
    clear = first < huge(1)
    do w = 1, size(first)
      if (clear(w)) call self%trial_place(self%waiting(w), self%tried + first(w), self%position(:, self%waiting(w)))
    end do
  end subroutine take_first_trials

  !> Whether a grain of the present class overlaps no placed one.
  pure logical function is_clear(self, radius, position)
    type(placement_t), intent(in) :: self
    real(dp), intent(in) :: radius, position(:)
    integer :: table

    is_clear = .false.
    do table = 0, self%size_class/classes_per_table
      if (self%placed(table)%blocks(0_i8, radius, position)) return
    end do
    is_clear = .true.
  end function is_clear

  !> Let the proposals of the grains that found a clear place stand or fall; grains whose proposal stands are placed and no
  !> longer wait. Collective.
  subroutine settle_proposals(comm, self, clear)
    type(communicator_t), intent(in) :: comm
    type(placement_t), intent(inout) :: self
    !> (size of waiting)
    logical, intent(in), contiguous :: clear(:)
    integer(i8), allocatable :: proposals(:, :), verdicts(:, :)
    type(outbox_t) :: outbox
    integer(i8) :: record(4 + self%box%nd)
    integer :: w, g

    call outbox%init(size(record), count(clear))
    do w = 1, size(clear)
      if (.not. clear(w)) cycle
      g = self%waiting(w)
      record(1) = comm%rank
      record(2) = w
      record(3) = self%id(g)
      record(4) = word_of(self%radius(g))
      record(5:) = word_of(self%position(:, g))
      call self%bricks%add_within_reach(self%position(:, g), self%reach(self%radius(g)), record, outbox)
    end do
    call outbox%exchange(comm, proposals)
    call judge_proposals(comm, self, proposals, outbox)
    call outbox%exchange(comm, verdicts)
    call take_verdicts(self, verdicts)
  end subroutine settle_proposals

  !> Place the grains that reach into the brick of this rank, and release those of this rank.
  subroutine take_verdicts(self, verdicts)
    type(placement_t), intent(inout) :: self
    !> those of judge_proposals
    integer(i8), intent(in), contiguous :: verdicts(:, :)
    logical :: placed(size(self%waiting))
    real(dp) :: position(self%box%nd)
    integer :: table, k

    placed(:) = .false.
    table = self%size_class/classes_per_table
    do k = 1, size(verdicts, 2)
      if (verdicts(1, k) == 0) then
        position(:) = real_of(verdicts(4:, k))
        call self%placed(table)%insert(verdicts(2, k), real_of(verdicts(3, k)), position)
      else
        placed(verdicts(1, k)) = .true.
      end if
    end do
    call self%release(placed)
  end subroutine take_verdicts

  !> Judge the proposals in the brick of this rank. Of one that stands, a record that begins with its place among the waiting
  !> goes to the rank of the grain, and one that begins with 0 to every rank whose brick it reaches; identifier, radius and
  !> centre follow.
  subroutine judge_proposals(comm, self, proposals, outbox)
    type(communicator_t), intent(in) :: comm
    type(placement_t), intent(inout) :: self
    !> (rank, place among its waiting grains, identifier, radius, centre)
    integer(i8), intent(in), contiguous :: proposals(:, :)
    type(outbox_t), intent(inout) :: outbox
    real(dp) :: position(self%box%nd), radius
    integer(i8) :: record(3 + self%box%nd)
    integer :: k

    call self%rivals%init(self%box, self%class_radius(self%size_class), .true.)
    do k = 1, size(proposals, 2)
      position(:) = real_of(proposals(5:, k))
      call self%rivals%insert(proposals(3, k), real_of(proposals(4, k)), position)
    end do
    call outbox%init(size(record), 2*size(proposals, 2))
    do k = 1, size(proposals, 2)
      radius = real_of(proposals(4, k))
      position(:) = real_of(proposals(5:, k))
      if (self%bricks%rank_of(position) /= comm%rank) cycle
      if (self%rivals%blocks(proposals(3, k), radius, position)) cycle
      record(:) = proposals(2:, k)
      call outbox%add(narrow(proposals(1, k)), record)
      record(1) = 0
      call self%bricks%add_within_reach(position, self%reach(radius), record, outbox)
    end do
  end subroutine judge_proposals

  !> Class of a radius.
  pure integer function placement_class_of(self, radius) result(size_class)
    class(placement_t), intent(in) :: self
    real(dp), intent(in) :: radius

    size_class = int(min(classes_per_table*log(self%largest/radius)/log(2.0_dp), real(last_of_classes, dp)), i4)
  end function placement_class_of

  !> Largest radius of a class, to a rounding [m].
  pure real(dp) function placement_class_radius(self, size_class) result(radius)
    class(placement_t), intent(in) :: self
    integer, intent(in) :: size_class
    radius = self%largest*0.5_dp**(size_class/real(classes_per_table, dp))
  end function placement_class_radius

  !> Distance within which a grain of the present class may overlap grains of this class or of those after it [m].
  pure real(dp) function placement_reach(self, radius) result(reach)
    class(placement_t), intent(in) :: self
    real(dp), intent(in) :: radius
    reach = radius + self%class_radius(self%size_class)
  end function placement_reach

  !> Let all grains of this rank that are of the present class wait.
  pure subroutine placement_choose_waiting(self)
    class(placement_t), intent(inout) :: self
    integer, allocatable :: chosen(:)
    integer :: k, n

    allocate (chosen(size(self%radius)))
    n = 0
    do k = 1, size(self%radius)
      if (self%class_of(self%radius(k)) /= self%size_class) cycle
      n = n + 1
      chosen(n) = k
    end do
    if (allocated(self%waiting)) deallocate (self%waiting)
    allocate (self%waiting(n))
    self%waiting(:) = chosen(1:n)
  end subroutine placement_choose_waiting

  !> Take the grains that were placed out of `waiting`.
  pure subroutine placement_release(self, placed)
    class(placement_t), intent(inout) :: self
    !> (size of waiting)
    logical, intent(in), contiguous :: placed(:)
    integer, allocatable :: left(:)
    integer :: w, n

    allocate (left(count(.not. placed)))
    n = 0
    do w = 1, size(placed)
      if (placed(w)) cycle
      n = n + 1
      left(n) = self%waiting(w)
    end do
    call move_alloc(left, self%waiting)
  end subroutine placement_release

  !> Place that grain `g` of this rank tries as its number `trial` [m].
  pure subroutine placement_trial_place(self, g, trial, position)
    class(placement_t), intent(in) :: self
    !> trial from 1
    integer, intent(in) :: g, trial
    !> (nd)
    real(dp), intent(out) :: position(:)
    real(dp) :: x(3)
    integer :: d

    ! stream 0 is that of radii, and 1 to 3 those of lattices
    do d = 1, self%box%nd
      x(d) = hash_uniform(self%seed, self%id(g), 3*trial + d)
    end do
    call self%box%random_place(self%radius(g), x, position)
  end subroutine placement_trial_place

  !> The word that a real travels in.
  elemental integer(i8) function word_of(x) result(word)
    real(dp), intent(in) :: x
    word = transfer(x, 0_i8)
  end function word_of

  !> The real in a word.
  elemental real(dp) function real_of(word) result(x)
    integer(i8), intent(in) :: word
    x = transfer(word, 0.0_dp)
  end function real_of

end module gravier_loose_packing
