!> Near pairs of one subdomain: those that may come into contact before the list is made anew.
module gravier_neighbour_list
  use gravier_kinds, only: dp
  implicit none
  private
  public :: neighbour_list_t

  !> Pairs in sweep order. The candidate is a grain; of two grains it is that of the lower identifier. The impulses of
  !> the last step stay with the pair: the normal one, then in 2D the tangential one, in 3D the tangential vector in
  !> global axes.
  type :: neighbour_list_t
    integer :: n = 0
    !> pairs have states
    logical :: remembers = .false.
    !> place of the candidate among the bodies searched (n)
    integer, allocatable :: candidate(:)
    !> place of the antagonist among the bodies searched, or minus the number of a boundary (n)
    integer, allocatable :: antagonist(:)
    !> periods by which the antagonist's place is shifted to meet the candidate, see shift_code; without periods of no
    !> size (n or 0)
    integer, allocatable :: shift(:)
    !> (entries of an impulse, n) [N s]; the last entry is the number of steps at rest where contacts may sleep
    real(dp), allocatable :: impulse(:, :)
    !> what pairs remember under laws with a memory, 0 at first; without such laws of no size (n or 0)
    integer, allocatable :: state(:)
  contains
    procedure :: init => neighbour_list_init
    procedure :: add => neighbour_list_add
    procedure :: finish => neighbour_list_finish
    procedure :: keeps => neighbour_list_keeps
    procedure :: n_kept => neighbour_list_n_kept
  end type neighbour_list_t

contains

  !> Whether pair `p` keeps something from the last step: an impulse, steps at rest or a state.
  pure logical function neighbour_list_keeps(self, p) result(keeps)
    class(neighbour_list_t), intent(in) :: self
    integer, intent(in) :: p

    keeps = any(abs(self%impulse(:, p)) > 0.0_dp)
    if (size(self%state) > 0) keeps = keeps .or. self%state(p) /= 0
  end function neighbour_list_keeps

  !> Pairs that keep something from the last step.
  pure integer function neighbour_list_n_kept(self) result(n)
    class(neighbour_list_t), intent(in) :: self
    integer :: p

    n = 0
    do p = 1, self%n
      if (self%keeps(p)) n = n + 1
    end do
  end function neighbour_list_n_kept

  !> An empty list with room for `room` pairs.
  subroutine neighbour_list_init(self, periodic, room)
    class(neighbour_list_t), intent(inout) :: self
    logical, intent(in) :: periodic
    integer, intent(in) :: room

    self%n = 0
    if (allocated(self%candidate)) deallocate (self%candidate, self%antagonist, self%shift)
    if (allocated(self%impulse)) deallocate (self%impulse, self%state)
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

  !> Put the pairs in the order order(1), order(2), ..., give back spare room and set impulses and states to zero.
  subroutine neighbour_list_finish(self, order, n_impulse, remembers)
    class(neighbour_list_t), intent(inout) :: self
    !> (n) a permutation
    integer, intent(in), contiguous :: order(:)
    !> entries of an impulse
    integer, intent(in) :: n_impulse
    !> pairs have states
    logical, intent(in) :: remembers

    call permute(self%candidate, order)
    call permute(self%antagonist, order)
    if (size(self%shift) > 0) call permute(self%shift, order)
    allocate (self%impulse(n_impulse, self%n), source=0.0_dp)
    self%remembers = remembers
    allocate (self%state(merge(self%n, 0, remembers)), source=0)
  end subroutine neighbour_list_finish

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
