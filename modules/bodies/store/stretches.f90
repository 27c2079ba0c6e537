!> Stretches of places: which bodies of a set a step has to go through. Whoever goes through bodies makes two loops,
!>
!>     do r = 1, awake%n
!>       do k = awake%first(r), awake%last(r)
!>
!> Without sleep there is one stretch with all of them.
module gravier_stretches
  use gravier_kinds, only: dp
  implicit none
  private
  public :: stretches_t

  type :: stretches_t
    integer :: n = 0
    !> places where each begins and ends (n), in ascending order
    integer, allocatable :: first(:), last(:)
  contains
    procedure :: take_all => stretches_take_all
    procedure :: have_all => stretches_have_all
    procedure :: leave_out => stretches_leave_out
  end type stretches_t

contains

  !> One stretch with all places.
  pure subroutine stretches_take_all(self, places)
    class(stretches_t), intent(inout) :: self
    !> their number
    integer, intent(in) :: places

    if (self%have_all(places)) return
    call make_room(self, 1)
    self%first(1) = 1
    self%last(1) = places
  end subroutine stretches_take_all

  !> Whether there is one stretch, with all places.
  pure logical function stretches_have_all(self, places) result(all_are)
    class(stretches_t), intent(in) :: self
    !> their number
    integer, intent(in) :: places

    all_are = .false.
    if (self%n == 1) all_are = self%last(1) - self%first(1) + 1 == places
  end function stretches_have_all

  !> The places whose value is not above 0.
  pure subroutine stretches_leave_out(self, value)
    class(stretches_t), intent(inout) :: self
    real(dp), intent(in), contiguous :: value(:)
    integer :: k, n, round
    logical :: is_in, was_in

    do round = 1, 2
      n = 0
      was_in = .false.
      do k = 1, size(value)
        is_in = .not. value(k) > 0.0_dp
        if (is_in .and. .not. was_in) n = n + 1
        if (round == 2) then
          if (is_in .and. .not. was_in) self%first(n) = k
          if (is_in) self%last(n) = k
        end if
        was_in = is_in
      end do
      if (round == 1) call make_room(self, n)
    end do
  end subroutine stretches_leave_out

  !> Make room for `n` stretches.
  pure subroutine make_room(self, n)
    class(stretches_t), intent(inout) :: self
    integer, intent(in) :: n

    if (allocated(self%first)) then
      if (size(self%first) < n) deallocate (self%first, self%last)
    end if
    if (.not. allocated(self%first)) allocate (self%first(n), self%last(n))
    self%n = n
  end subroutine make_room

end module gravier_stretches
