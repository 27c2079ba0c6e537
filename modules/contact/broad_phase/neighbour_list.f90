!> Near pairs of one subdomain: those that may come into contact before the list is made anew.
module gravier_neighbour_list
  use gravier_kinds, only: dp
  implicit none
  private
  public :: neighbour_list_t, pair_memory_t

  !> What pairs keep from one step to the next.
  type :: pair_memory_t
    !> entries of an impulse, 0 where solves do not start from those of the last step
    integer :: n_impulse = 0
    !> row of the states that laws with a memory give pairs, 0 for none
    integer :: law_row = 0
    !> where bodies may sleep: the row of a mark of pairs whose contact is left out of the problem; 0 where none may
    integer :: touch_row = 0
    !> where bodies have shapes or boundaries facets: the first of two rows of the key that tells a point of a pair from its others,
    !> 0 for no point
    integer :: key_row = 0
    !> entries of the elongation of a tangential spring, 0 where no contact yields
    integer :: n_spring = 0
  contains
    procedure :: n_states => pair_memory_n_states
    procedure :: words => pair_memory_words
  end type pair_memory_t

  !> Pairs in sweep order. The candidate is a grain; of two grains it is that of the lower identifier. A pair of bodies that may
  !> touch in several points stands there as often, one time after the other.
  !> The impulses of the last step stay with the pair: the normal one, then in 2D the tangential one, in 3D the tangential vector in
  !> global axes. So does the elongation of the tangential spring, as a number in 2D, in 3D as a vector in global axes.
  type :: neighbour_list_t
    integer :: n = 0
    type(pair_memory_t) :: memory
    !> place of the candidate among the bodies searched (n)
    integer, allocatable :: candidate(:)
    !> place of the antagonist among the bodies searched, or minus the number of a boundary (n)
    integer, allocatable :: antagonist(:)
    !> periods by which the antagonist's place is shifted to meet the candidate, see shift_code; without periods of no
    !> size (n or 0)
    integer, allocatable :: shift(:)
    !> (entries of an impulse, n) [N s]
    real(dp), allocatable :: impulse(:, :)
    !> (entries of an elongation, n) [m]
    real(dp), allocatable :: spring(:, :)
    !> where some body sleeps, the places of the pairs that are looked at, ascending: those with a grain that is awake (n_watched);
    !> not allocated where all are
    integer, allocatable :: watched(:)
    !> where boundaries have facets, the bodies that may come to touch some, of other subdomains too (bodies searched); else not
    !> allocated
    logical, allocatable :: at_facets(:)
    !> numbers that pairs keep, 0 at first (memory%n_states, n)
    integer, allocatable :: state(:, :)
  contains
    procedure :: init => neighbour_list_init
    procedure :: add => neighbour_list_add
    procedure :: finish => neighbour_list_finish
    procedure :: points_of => neighbour_list_points_of
    procedure :: begins => neighbour_list_begins
    procedure :: same_bodies => neighbour_list_same_bodies
    procedure :: law_state => neighbour_list_law_state
    procedure :: set_law_state => neighbour_list_set_law_state
    procedure :: keeps => neighbour_list_keeps
    procedure :: drop => neighbour_list_drop
    procedure :: n_watched => neighbour_list_n_watched
    procedure :: watched_place => neighbour_list_watched_place
    procedure :: forget_impulses => neighbour_list_forget_impulses
    procedure :: forget_elongations => neighbour_list_forget_elongations
    procedure :: find_kept => neighbour_list_find_kept
  end type neighbour_list_t

contains

  pure integer function pair_memory_n_states(self) result(n)
    class(pair_memory_t), intent(in) :: self
    n = max(self%law_row, self%touch_row)
    if (self%key_row > 0) n = max(n, self%key_row + 1)
  end function pair_memory_n_states

  !> Words of what is kept with a pair.
  pure integer function pair_memory_words(self) result(n)
    class(pair_memory_t), intent(in) :: self
    n = self%n_impulse + self%n_spring + self%n_states()
  end function pair_memory_words

  !> Whether two places are of the same bodies.
  pure logical function neighbour_list_same_bodies(self, p, q) result(same)
    class(neighbour_list_t), intent(in) :: self
    integer, intent(in) :: p, q
    same = self%candidate(p) == self%candidate(q) .and. self%antagonist(p) == self%antagonist(q)
  end function neighbour_list_same_bodies

  !> What the law of pair `p` remembers; 0 where no law does.
  pure integer function neighbour_list_law_state(self, p) result(state)
    class(neighbour_list_t), intent(in) :: self
    integer, intent(in) :: p

    state = 0
    if (self%memory%law_row > 0) state = self%state(self%memory%law_row, p)
  end function neighbour_list_law_state

  !> Let the law of pair `p` remember, where some law does.
  pure subroutine neighbour_list_set_law_state(self, p, state)
    class(neighbour_list_t), intent(inout) :: self
    integer, intent(in) :: p, state
    if (self%memory%law_row > 0) self%state(self%memory%law_row, p) = state
  end subroutine neighbour_list_set_law_state

  !> Whether pair `p` keeps something from the last step.
  pure logical function neighbour_list_keeps(self, p) result(keeps)
    class(neighbour_list_t), intent(in) :: self
    integer, intent(in) :: p
    integer :: e

    keeps = .true.
    do e = 1, size(self%impulse, 1)
      if (abs(self%impulse(e, p)) > 0.0_dp) return
    end do
    do e = 1, size(self%state, 1)
      if (self%state(e, p) /= 0) return
    end do
    do e = 1, size(self%spring, 1)
      if (abs(self%spring(e, p)) > 0.0_dp) return
    end do
    keeps = .false.
  end function neighbour_list_keeps

  !> Places of the pairs that keep something from the last step.
  pure subroutine neighbour_list_find_kept(self, kept)
    class(neighbour_list_t), intent(in) :: self
    !> ascending
    integer, allocatable, intent(out) :: kept(:)
    integer, allocatable :: place(:)
    integer :: p, n

    allocate (place(self%n))
    n = 0
    do p = 1, self%n
      if (.not. self%keeps(p)) cycle
      n = n + 1
      place(n) = p
    end do
    kept = place(1:n)
  end subroutine neighbour_list_find_kept

  !> An empty list with room for `room` pairs.
  subroutine neighbour_list_init(self, periodic, room)
    class(neighbour_list_t), intent(inout) :: self
    logical, intent(in) :: periodic
    integer, intent(in) :: room

    self%n = 0
    if (allocated(self%candidate)) deallocate (self%candidate, self%antagonist, self%shift)
    if (allocated(self%impulse)) deallocate (self%impulse, self%spring, self%state)
    if (allocated(self%watched)) deallocate (self%watched)
    if (allocated(self%at_facets)) deallocate (self%at_facets)
    allocate (self%candidate(room), self%antagonist(room), self%shift(merge(room, 0, periodic)))
  end subroutine neighbour_list_init

  !> Add a pair; the room doubles where needed.
  subroutine neighbour_list_add(self, candidate, antagonist, shift)
    class(neighbour_list_t), intent(inout) :: self
    integer, intent(in) :: candidate, antagonist, shift

    if (self%n == size(self%candidate)) then
      call lengthen(self%candidate, self%n)
      call lengthen(self%antagonist, self%n)
      if (size(self%shift) > 0) call lengthen(self%shift, self%n)
    end if
    self%n = self%n + 1
    self%candidate(self%n) = candidate
    self%antagonist(self%n) = antagonist
    if (size(self%shift) > 0) self%shift(self%n) = shift
  end subroutine neighbour_list_add

  subroutine lengthen(list, n)
    integer, allocatable, intent(inout) :: list(:)
    integer, intent(in) :: n
    integer, allocatable :: longer(:)

    allocate (longer(2*n + 16))
    longer(1:n) = list(1:n)
    call move_alloc(longer, list)
  end subroutine lengthen

  !> How often the pair that begins at place `p` stands there.
  pure integer function neighbour_list_points_of(self, p) result(points)
    class(neighbour_list_t), intent(in) :: self
    integer, intent(in) :: p

    points = 1
    do while (p + points <= self%n)
      if (self%candidate(p + points) /= self%candidate(p) .or. self%antagonist(p + points) /= self%antagonist(p)) exit
      if (size(self%shift) > 0) then
        if (self%shift(p + points) /= self%shift(p)) exit
      end if
      points = points + 1
    end do
  end function neighbour_list_points_of

  !> Whether a pair begins at place `p`, so that the place before is one of another pair.
  pure logical function neighbour_list_begins(self, p) result(begins)
    class(neighbour_list_t), intent(in) :: self
    integer, intent(in) :: p

    begins = p == 1
    if (begins) return
    begins = self%candidate(p - 1) /= self%candidate(p) .or. self%antagonist(p - 1) /= self%antagonist(p)
    if (size(self%shift) > 0 .and. .not. begins) begins = self%shift(p - 1) /= self%shift(p)
  end function neighbour_list_begins

  !> Put the pairs in the order order(1), order(2), ..., give back spare room and set all that pairs keep to zero.
  subroutine neighbour_list_finish(self, order, memory)
    class(neighbour_list_t), intent(inout) :: self
    !> places of the pairs as they were added, each as often as the pair is to stand in the list
    integer, intent(in), contiguous :: order(:)
    type(pair_memory_t), intent(in) :: memory

    call permute(self%candidate, order)
    call permute(self%antagonist, order)
    if (size(self%shift) > 0) call permute(self%shift, order)
    self%n = size(order)
    self%memory = memory
    allocate (self%impulse(memory%n_impulse, self%n), source=0.0_dp)
    allocate (self%spring(memory%n_spring, self%n), source=0.0_dp)
    allocate (self%state(memory%n_states(), self%n), source=0)
  end subroutine neighbour_list_finish

  !> Drop the pairs of bodies that are gone; the others stay in their order, with what they keep. Spare room stays.
  subroutine neighbour_list_drop(self, place)
    class(neighbour_list_t), intent(inout) :: self
    !> new place of each body searched, 0 for those that are gone
    integer, intent(in), contiguous :: place(:)
    integer :: p, n, i, j

    n = 0
    do p = 1, self%n
      i = place(self%candidate(p))
      j = self%antagonist(p)
      if (j > 0) j = place(j)
      if (i == 0 .or. j == 0) cycle
      n = n + 1
      self%candidate(n) = i
      self%antagonist(n) = j
      if (n == p) cycle
      if (size(self%shift) > 0) self%shift(n) = self%shift(p)
      self%impulse(:, n) = self%impulse(:, p)
      self%spring(:, n) = self%spring(:, p)
      self%state(:, n) = self%state(:, p)
    end do
    self%n = n
    if (allocated(self%watched)) deallocate (self%watched)
    if (.not. allocated(self%at_facets)) return
    ! bodies move up, in their order
    do i = 1, size(place)
      if (place(i) > 0) self%at_facets(place(i)) = self%at_facets(i)
    end do
  end subroutine neighbour_list_drop

  !> Pairs that are looked at.
  pure integer function neighbour_list_n_watched(self) result(n)
    class(neighbour_list_t), intent(in) :: self
    n = self%n
    if (allocated(self%watched)) n = size(self%watched)
  end function neighbour_list_n_watched

  !> Place of pair `k` of those that are looked at.
  pure integer function neighbour_list_watched_place(self, k) result(p)
    class(neighbour_list_t), intent(in) :: self
    integer, intent(in) :: k
    p = k
    if (allocated(self%watched)) p = self%watched(k)
  end function neighbour_list_watched_place

  !> Set the impulses of the pairs that are looked at to zero.
  pure subroutine neighbour_list_forget_impulses(self)
    class(neighbour_list_t), intent(inout) :: self
    integer :: k

    if (allocated(self%watched)) then
      do k = 1, size(self%watched)
        self%impulse(:, self%watched(k)) = 0.0_dp
      end do
    else
      self%impulse(:, :) = 0.0_dp
    end if
  end subroutine neighbour_list_forget_impulses

  !> Set the elongations of the pairs that are looked at to zero.
  pure subroutine neighbour_list_forget_elongations(self)
    class(neighbour_list_t), intent(inout) :: self
    integer :: k

    if (allocated(self%watched)) then
      do k = 1, size(self%watched)
        self%spring(:, self%watched(k)) = 0.0_dp
      end do
    else
      self%spring(:, :) = 0.0_dp
    end if
  end subroutine neighbour_list_forget_elongations

  subroutine permute(list, order)
    integer, allocatable, intent(inout) :: list(:)
    integer, intent(in), contiguous :: order(:)
    integer, allocatable :: permuted(:)
    integer :: k

    allocate (permuted(size(order)))
    do k = 1, size(order)
      permuted(k) = list(order(k))
    end do
    call move_alloc(permuted, list)
  end subroutine permute

end module gravier_neighbour_list
