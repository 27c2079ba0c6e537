!> From a &boundary group to the surface of the boundary.
module gravier_config_surfaces
  use gravier_kinds, only: dp
  use gravier_declared_keys, only: declared_key_t
  use gravier_surface, only: surface_t, surface_features_t
  use gravier_surface_registry, only: surface_holder_t, registered_surfaces, make_surface, glued_grains, wall_of_bodies
  use gravier_config_types, only: boundary_config_t
  use gravier_config_table, only: surface_rows
  implicit none
  private
  public :: set_surface, surface_value, shapes_in

contains

  !> The surface that a group asks for, not allocated for glued grains and walls of the bodies. Where a value cannot be, `wrong`
  !> names its key and `expected` says what was expected; blank: what the rule of the key says.
  subroutine set_surface(config, surface, wrong, expected)
    type(boundary_config_t), intent(in) :: config
    class(surface_t), allocatable, intent(out) :: surface
    character(len=:), allocatable, intent(out) :: wrong, expected
    type(declared_key_t), allocatable :: own(:)
    real(dp), allocatable :: values(:, :)
    integer :: k

    wrong = ""
    expected = ""
    call make_surface(trim(config%shape), surface)
    if (.not. allocated(surface)) return
    call surface%keys(own)
    allocate (values(3, size(own)))
    do k = 1, size(own)
      values(:, k) = config%value(:, surface_rows%find(own(k)%name))
    end do
    call surface%set(values, wrong, expected)
  end subroutine set_surface

  !> Values of a key of some shape, 0 where they are not given.
  function surface_value(config, name) result(values)
    type(boundary_config_t), intent(in) :: config
    character(len=*), intent(in) :: name
    real(dp) :: values(3)

    values(:) = config%value(:, surface_rows%find(name))
  end function surface_value

  !> The words of the shapes in scenes of a dimension, with blanks between.
  function shapes_in(dimension) result(words)
    integer, intent(in) :: dimension
    character(len=:), allocatable :: words
    type(surface_holder_t), allocatable :: surfaces(:)
    type(surface_features_t) :: features
    integer :: k

    call registered_surfaces(surfaces)
    words = ""
    do k = 1, size(surfaces)
      features = surfaces(k)%surface%features()
      if (features%dimensions(dimension)) words = words//trim(features%kind)//" "
    end do
    words = words//glued_grains//" "//wall_of_bodies
  end function shapes_in

end module gravier_config_surfaces
