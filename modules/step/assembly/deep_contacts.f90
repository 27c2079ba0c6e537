!> Contacts that are pressed so deep that bodies may come out on the other side of each other.
module gravier_deep_contacts
  use gravier_kinds, only: dp, i8
  use gravier_contact_problem, only: contact_problem_t
  use gravier_decomposition, only: decomposition_t
  use gravier_halo, only: halo_t
  implicit none
  private
  public :: deep_contacts_t

  !> A contact is deep from this overlap on, over the half thickness of the thinner body. Two equal slabs that overlap by twice
  !> their half thickness have their centres in one plane: nothing tells any more on which side they were.
  real(dp), parameter :: deep = 0.5_dp
  !> deformation of compliant contacts, over the mean radius, from which on balls are looked at
  real(dp), parameter :: soft = 0.05_dp

  type :: deep_contacts_t
    !> how many there are
    integer(i8) :: number = 0
    !> largest overlap of all contacts over the half thickness of the thinner body, 0 where nothing overlaps
    real(dp) :: deepest = 0.0_dp
  contains
    procedure :: find => deep_contacts_find
  end type deep_contacts_t

contains

  !> Count the contacts whose overlap is half of the half thickness of the thinner body or more, and find the largest overlap over
  !> that half thickness. Planes, which stop whatever is behind them, have no such contacts. Disks and spheres are looked at where
  !> they are soft: overlaps of rigid ones are projected. Collective.
  subroutine deep_contacts_find(self, decomposition, halo, problem, deformation)
    class(deep_contacts_t), intent(out) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(halo_t), intent(in) :: halo
    type(contact_problem_t), intent(in) :: problem
    !> of compliant contacts so far, at most, the same on all ranks [m]
    real(dp), intent(in) :: deformation
    integer(i8) :: counts(1)
    real(dp) :: share
    integer :: s, c, i, j

    if (decomposition%no == 0 .and. .not. deformation > soft*decomposition%rule%mean_radius) return
    counts(:) = 0
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s), view => halo%view(s))
        do c = 1, sub%n_contacts
          if (.not. sub%gap(c) < 0.0_dp) cycle
          i = view%list%candidate(sub%source(c))
          j = view%list%antagonist(sub%source(c))
          share = -sub%gap(c)/decomposition%figures%half_thickness_of(view%bodies, i)
          if (j > 0) then
            share = max(share, -sub%gap(c)/decomposition%figures%half_thickness_of(view%bodies, j))
          else if (decomposition%boundaries(-j)%is_plane()) then
            cycle
          end if
          self%deepest = max(self%deepest, share)
          if (share >= deep) counts(1) = counts(1) + 1
        end do
      end associate
    end do
    call problem%comm%sum_counts(counts)
    self%number = counts(1)
    self%deepest = problem%comm%highest(self%deepest)
  end subroutine deep_contacts_find

end module gravier_deep_contacts
