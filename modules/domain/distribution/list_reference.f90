!> Bodies and boundaries as they were when neighbour lists were made, which tells later whether these are still valid.
module gravier_list_reference
  use gravier_kinds, only: dp, i8
  use gravier_body_store, only: body_set_t
  use gravier_boundary, only: boundary_t, boundary_words
  implicit none
  private
  public :: reference_t, note_bodies, note_boundaries, way_of

  !> The grains of a subdomain when its list was made: their places (nd, n) [m] and speeds (n) [m/s].
  type :: reference_t
    real(dp), allocatable :: position(:, :), speed(:)
  end type reference_t

contains

  !> Keep the grains of a subdomain as they are now.
  subroutine note_bodies(owned, reference)
    type(body_set_t), intent(in) :: owned
    type(reference_t), intent(out) :: reference
    integer :: k

    reference%position = owned%position
    allocate (reference%speed(owned%n))
    do k = 1, owned%n
      reference%speed(k) = norm2(owned%velocity(1:owned%nd, k))
    end do
  end subroutine note_bodies

  !> Keep the boundaries as they are now. What never changes of them, such as the facets of a mesh, is copied the first time; the
  !> rows of their tables are not.
  subroutine note_boundaries(boundaries, reference)
    type(boundary_t), intent(in) :: boundaries(:)
    type(boundary_t), allocatable, intent(inout) :: reference(:)
    integer(i8) :: words(boundary_words)
    integer :: b

    if (allocated(reference)) then
      if (size(reference) /= size(boundaries)) deallocate (reference)
    end if
    if (.not. allocated(reference)) then
      reference = boundaries
      do b = 1, size(reference)
        associate (table => reference(b)%drive%table)
          if (allocated(table%has)) deallocate (table%time, table%value, table%has)
        end associate
      end do
    end if
    do b = 1, size(boundaries)
      call boundaries(b)%get_state(words)
      call reference(b)%set_state(words)
    end do
  end subroutine note_boundaries

  !> How far the surface of a boundary has moved at most [m]. The axis of a drum, which turns about it, picks up roundings,
  !> which are no tilt.
  pure real(dp) function way_of(now, before) result(way)
    type(boundary_t), intent(in) :: now, before
    !> [rad]
    real(dp), parameter :: tilt_of_roundings = 1.0e-11_dp

    way = 0.0_dp
    if (.not. now%touches()) return
    if (norm2(now%surface%axis - before%surface%axis) > tilt_of_roundings) then
      ! a plane or a cylinder that tilts moves without bound
      way = huge(1.0_dp)
    else
      way = now%surface%way(before%surface)
    end if
  end function way_of

end module gravier_list_reference
