!> The shapes of boundaries there are. A new shape is a file in modules/bodies/shapes and a line here.
module gravier_surface_registry
  use gravier_declared_keys, only: declared_key_t, collected_keys_t
  use gravier_surface, only: surface_t, surface_features_t
  implicit none
  private
  public :: surface_holder_t, registered_surfaces, make_surface, surface_keys, glued_grains

  !> the word for a boundary that has no surface, but a group of grains that are glued to it
  character(len=*), parameter :: glued_grains = "grains"

  type :: surface_holder_t
    class(surface_t), allocatable :: surface
  end type surface_holder_t

contains

  !> One surface of each shape.
  subroutine registered_surfaces(surfaces)
    type(surface_holder_t), allocatable, intent(out) :: surfaces(:)

    allocate (surfaces(0))
    !&<
    block; use gravier_plane, only: plane_t; call add(plane_t()); end block
    block; use gravier_flat_piece, only: segment_t; call add(segment_t()); end block
    block; use gravier_flat_piece, only: rectangle_t; call add(rectangle_t()); end block
    block; use gravier_drum, only: circle_t; call add(circle_t()); end block
    block; use gravier_drum, only: cylinder_t; call add(cylinder_t()); end block
    block; use gravier_plane, only: outlet_t; call add(outlet_t()); end block
    !&>

  contains

    subroutine add(surface)
      class(surface_t), intent(in) :: surface
      type(surface_holder_t), allocatable :: longer(:)
      integer :: k

      allocate (longer(size(surfaces) + 1))
      do k = 1, size(surfaces)
        call move_alloc(surfaces(k)%surface, longer(k)%surface)
      end do
      allocate (longer(size(longer))%surface, source=surface)
      call move_alloc(longer, surfaces)
    end subroutine add

  end subroutine registered_surfaces

  !> A surface of a shape by its word; not allocated for another word.
  subroutine make_surface(kind, surface)
    character(len=*), intent(in) :: kind
    class(surface_t), allocatable, intent(out) :: surface
    type(surface_holder_t), allocatable :: surfaces(:)
    type(surface_features_t) :: features
    integer :: k

    call registered_surfaces(surfaces)
    do k = 1, size(surfaces)
      features = surfaces(k)%surface%features()
      if (features%kind == kind) call move_alloc(surfaces(k)%surface, surface)
      if (allocated(surface)) return
    end do
  end subroutine make_surface

  !> The keys of all shapes, each once, and the words of the shapes.
  subroutine surface_keys(collected)
    type(collected_keys_t), intent(out) :: collected
    type(surface_holder_t), allocatable :: surfaces(:)
    type(surface_features_t) :: features
    type(declared_key_t), allocatable :: own(:)
    integer :: k

    call registered_surfaces(surfaces)
    do k = 1, size(surfaces)
      features = surfaces(k)%surface%features()
      call surfaces(k)%surface%keys(own)
      call collected%add(trim(features%kind), own)
    end do
  end subroutine surface_keys

end module gravier_surface_registry
