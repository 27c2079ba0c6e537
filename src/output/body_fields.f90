!> The fields of a body that files may have: those that every file has in a shape of its own, and those that the table of fields in
!> body_store.fypp marks as written, which need no line here.
module gravier_body_fields
  use gravier_kinds, only: dp, i8
  use gravier_body_store, only: body_layout_t, body_set_t, written_field_t => body_field_t, written_fields
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
    !> its place among the written fields of the table, 0 for the others
    integer :: written = 0
    !> results.h5 has it
    logical :: in_results = .true.
  end type body_field_t

contains

  !> All fields, in the order in which files have them.
  pure subroutine list_body_fields(decomposition, fields)
    type(decomposition_t), intent(in) :: decomposition
    type(body_field_t), allocatable, intent(out) :: fields(:)
    type(written_field_t), allocatable :: written(:)
    integer :: nd, k

    nd = decomposition%nd
    call written_fields(written)
    allocate (fields(5 + size(written)))
    fields(1) = body_field_t("position", "m", nd)
    ! 2D vx, vy, omega; 3D vx, vy, vz, wx, wy, wz; spins are 0 where nothing turns a grain
    fields(2) = body_field_t("velocity", "m/s, rad/s", 3*nd - 3)
    fields(3) = body_field_t("radius", "m")
    do k = 1, size(written)
      fields(3 + k) = body_field_t(written(k)%name, written(k)%unit, entries_of(decomposition, written(k)%name), &
        & written(k)%whole, written=k)
    end do
    k = 3 + size(written)
    ! how many periods the centre has gone along each axis
    fields(k + 1) = body_field_t("image", "", decomposition%ni, whole=.true.)
    ! the one that holds it, which the results do not depend on
    fields(k + 2) = body_field_t("subdomain", "", whole=.true., in_results=.false.)
  end subroutine list_body_fields

  !> Numbers of a body in a field of the table.
  pure integer function entries_of(decomposition, field) result(entries)
    type(decomposition_t), intent(in) :: decomposition
    character(len=*), intent(in) :: field
    type(body_layout_t) :: layout
    character(len=:), allocatable :: name
    integer :: f, bytes

    layout = decomposition%layout()
    f = 0
    do
      f = f + 1
      call layout%describe_field(f, name, bytes, entries)
      if (name == field .or. len(name) == 0) return
    end do
  end function entries_of

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
    case ("image")
      values(:, :) = grains%image
    case ("subdomain")
      values(1, :) = subdomain
    end select
  end subroutine take_whole_field

end module gravier_body_fields
