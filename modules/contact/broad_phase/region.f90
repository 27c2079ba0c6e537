!> What detection needs to know of a partition of space.
module gravier_region
  use gravier_kinds, only: dp
  implicit none
  private
  public :: region_t

  !> A partition of space into numbered subdomains.
  type, abstract :: region_t
  contains
    !> subdomain (from 1) that holds a point
    procedure(owner_of), deferred :: owner
  end type region_t

  abstract interface
    pure integer function owner_of(self, point) result(subdomain)
      import :: region_t, dp
      implicit none
      class(region_t), intent(in) :: self
      !> (nd) [m]
      real(dp), intent(in) :: point(:)
    end function owner_of
  end interface

end module gravier_region
