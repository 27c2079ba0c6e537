!> Contacts of one subdomain as detected: who touches whom, and where.
module gravier_contact_list
  use gravier_kinds, only: dp
  implicit none
  private
  public :: contact_list_t

  !> Contacts in sweep order. The normal points from the antagonist to the candidate. The candidate is a grain;
  !> of two grains it is that of the lower identifier.
  type :: contact_list_t
    integer :: n = 0
    !> place of the candidate among the bodies searched (n)
    integer, allocatable :: candidate(:)
    !> place of the antagonist among the bodies searched, or minus the number of a wall (n)
    integer, allocatable :: antagonist(:)
    !> (nd, n)
    real(dp), allocatable :: normal(:, :)
    !> distance of the surfaces at the configuration of detection, negative where they overlap (n) [m]
    real(dp), allocatable :: gap(:)
    !> the point that decides who owns the contact (nd, n) [m]
    real(dp), allocatable :: point(:, :)
  contains
    procedure :: init => contact_list_init
    procedure :: reserve => contact_list_reserve
    procedure :: reorder => contact_list_reorder
  end type contact_list_t

contains

  !> An empty list with room for `room` contacts.
  subroutine contact_list_init(self, nd, room)
    class(contact_list_t), intent(inout) :: self
    integer, intent(in) :: nd, room

    self%n = 0
    if (allocated(self%gap)) deallocate (self%candidate, self%antagonist, self%normal, self%gap, self%point)
    allocate (self%candidate(room), self%antagonist(room), self%normal(nd, room), self%gap(room), self%point(nd, room))
  end subroutine contact_list_init

  !> Make sure that one more contact finds room; the room doubles.
  subroutine contact_list_reserve(self)
    class(contact_list_t), intent(inout) :: self
    type(contact_list_t) :: old
    integer :: n

    n = self%n
    if (n < size(self%gap)) return
    old = self
    call self%init(size(old%normal, 1), max(16, 2*n))
    self%n = n
    self%candidate(1:n) = old%candidate(1:n)
    self%antagonist(1:n) = old%antagonist(1:n)
    self%normal(:, 1:n) = old%normal(:, 1:n)
    self%gap(1:n) = old%gap(1:n)
    self%point(:, 1:n) = old%point(:, 1:n)
  end subroutine contact_list_reserve

  !> Put the contacts in the order order(1), order(2), ... and give back spare room.
  subroutine contact_list_reorder(self, order)
    class(contact_list_t), intent(inout) :: self
    !> (n) a permutation
    integer, intent(in), contiguous :: order(:)
    type(contact_list_t) :: old
    integer :: c

    old = self
    call self%init(size(old%normal, 1), size(order))
    self%n = size(order)
    do c = 1, self%n
      self%candidate(c) = old%candidate(order(c))
      self%antagonist(c) = old%antagonist(order(c))
      self%normal(:, c) = old%normal(:, order(c))
      self%gap(c) = old%gap(order(c))
      self%point(:, c) = old%point(:, order(c))
    end do
  end subroutine contact_list_reorder

end module gravier_contact_list
