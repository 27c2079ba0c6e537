!> The shapes that bodies of a scene have, each known once and shared by all bodies that have it, at any size.
module gravier_shape_library
  use gravier_kinds, only: dp
  use gravier_convex_piece, only: convex_piece_t
  implicit none
  private
  public :: body_shape_t, shape_library_t

  !> A rigid body of radius 1: the ball of that radius about the centre of mass holds all of it. Its axes are the principal ones.
  type :: body_shape_t
    character(len=:), allocatable :: name
    !> one piece, or the pieces of a cluster
    type(convex_piece_t), allocatable :: piece(:)
    !> volume (area in 2D)
    real(dp) :: volume = 0.0_dp
    !> principal moments of inertia of a body of mass 1, in 2D the first alone
    real(dp) :: inertia(3) = 0.0_dp
    !> radius of that ball in the length unit of the file that the shape comes from
    real(dp) :: size = 1.0_dp
  end type body_shape_t

  !> Shapes by number, from 1; the number 0 stands for disks and spheres.
  type :: shape_library_t
    integer :: n = 0
    type(body_shape_t), allocatable :: shape(:)
  end type shape_library_t

end module gravier_shape_library
