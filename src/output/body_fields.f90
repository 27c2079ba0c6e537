!> The fields of a body that files may have: the one list of their names, units and shapes, and the one place that takes their
!> values from where grains are held.
module gravier_body_fields
  use gravier_kinds, only: dp, i8
  use gravier_body_store, only: body_set_t
  use gravier_decomposition, only: decomposition_t
  implicit none
  private
  public :: body_field_t, list_body_fields, take_real_field, take_whole_field

  !> A field of a body.
  type :: body_field_t
    character(len=16) :: name = "", unit = ""
    !> numbers of a body; 0 where the scene has no such field
    integer :: components = 1
    !> integers, not reals
    logical :: whole = .false.
    !> results.h5 has it
    logical :: in_results = .true.
  end type body_field_t

contains

  !> All fields, in the order in which files have them.
  pure subroutine list_body_fields(decomposition, fields)
    type(decomposition_t), intent(in) :: decomposition
    type(body_field_t), allocatable, intent(out) :: fields(:)
    integer :: nd

    nd = decomposition%nd
    allocate (fields(7))
    fields(1) = body_field_t("position", "m", nd)
    ! 2D vx, vy, omega; 3D vx, vy, vz, wx, wy, wz; spins are 0 where nothing turns a grain
    fields(2) = body_field_t("velocity", "m/s, rad/s", 3*nd - 3)
    fields(3) = body_field_t("radius", "m")
    fields(4) = body_field_t("mass", "kg")
    ! its number among the &material groups
    fields(5) = body_field_t("material", "", whole=.true.)
    ! how many periods the centre has gone along each axis
    fields(6) = body_field_t("image", "", decomposition%ni, whole=.true.)
    ! the one that holds it, which the results do not depend on
    fields(7) = body_field_t("subdomain", "", whole=.true., in_results=.false.)
  end subroutine list_body_fields

  !> Reals of the grains of one subdomain.
  pure subroutine take_real_field(grains, name, values)
    type(body_set_t), intent(in) :: grains
    character(len=*), intent(in) :: name
    !> (components, grains)
    real(dp), intent(out) :: values(:, :)

    select case (name)
    case ("position")
      values(:, :) = grains%position
    case ("velocity")
      values(1:grains%nv, :) = grains%velocity
      values(grains%nv + 1:, :) = 0.0_dp
    case ("radius")
      values(1, :) = grains%radius
    case ("mass")
      values(1, :) = grains%mass
    end select
  end subroutine take_real_field

  !> Integers of the grains of one subdomain.
  pure subroutine take_whole_field(grains, name, subdomain, values)
    type(body_set_t), intent(in) :: grains
    character(len=*), intent(in) :: name
    !> its number, from 1
    integer, intent(in) :: subdomain
    !> (components, grains)
    integer(i8), intent(out) :: values(:, :)

    select case (name)
    case ("material")
      values(1, :) = grains%material
    case ("image")
      values(:, :) = grains%image
    case ("subdomain")
      values(1, :) = subdomain
    end select
  end subroutine take_whole_field

end module gravier_body_fields
