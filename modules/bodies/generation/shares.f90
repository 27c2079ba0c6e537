!> Kinds that grains are dealt out to at random, each with a share of them by number: shapes, materials.
module gravier_shares
  use gravier_kinds, only: dp
  implicit none
  private
  public :: accumulate, kind_at

contains

  !> Make of the share of each kind the fraction of the grains that has this kind or one before it; the last is 1.
  pure subroutine accumulate(share)
    !> (kinds), above 0, to any scale
    real(dp), intent(inout) :: share(:)
    integer :: k

    ! shares may be so large that their sum is none
    share(:) = share/maxval(share)
    do k = 2, size(share)
      share(k) = share(k - 1) + share(k)
    end do
    share(:) = share/share(size(share))
  end subroutine accumulate

  !> The place of the kind that a number draws: the first whose bound is above it, or the last.
  pure integer function kind_at(bound, u) result(place)
    !> as `accumulate` makes them
    real(dp), intent(in) :: bound(:)
    !> in (0, 1), all as likely
    real(dp), intent(in) :: u

    do place = 1, size(bound) - 1
      if (bound(place) > u) return
    end do
  end function kind_at

end module gravier_shares
