!> The C interface of the scene of a run (gravier_c_run), between two steps: bodies, boundaries, the cell, loads and coefficients.
module gravier_c_scene
  use, intrinsic :: iso_c_binding, only: c_char, c_double, c_int, c_int64_t, c_loc, c_null_ptr, c_ptr
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_body_store, only: body_set_t
  use gravier_user_loop, only: user_loop_t
  use gravier_user_bodies, only: newcomers_t, add_bodies, remove_bodies
  use gravier_user_boundaries, only: get_boundary, set_boundary
  use gravier_user_cell, only: get_cell, set_cell
  use gravier_c_handle, only: find_loop
  use gravier_c_text, only: told, text_of, put_text
  implicit none
  private
  public :: gravier_array, gravier_check_array, gravier_set_array, gravier_set_gravity, gravier_set_friction
  public :: gravier_boundary, gravier_boundary_name, gravier_get_boundary, gravier_set_boundary
  public :: gravier_get_cell, gravier_set_cell
  public :: gravier_add_bodies, gravier_remove_bodies

  !> kinds of the numbers of an array
  integer(c_int), parameter :: kind_double = 0, kind_int64 = 1, kind_int32 = 2

  !> the name that was asked for last
  character(kind=c_char), allocatable, target :: last_name(:)

contains

  !> A field of the bodies of a subdomain of this rank, where it is stored: valid until the next step.
  integer(c_int) function gravier_array(handle, name, subdomain, address, shape, kind) result(status) bind(C, name="gravier_array")
    type(c_ptr), value :: handle
    !> text of C
    type(c_ptr), value :: name
    !> from 0
    integer(c_int), value :: subdomain
    type(c_ptr), intent(out) :: address
    !> bodies, entries of each
    integer(c_int64_t), intent(out) :: shape(2)
    integer(c_int), intent(out) :: kind
    type(user_loop_t), pointer :: loop
    type(body_set_t), pointer :: owned
    real(dp), pointer :: values(:, :)
    type(error_t), allocatable :: error

    address = c_null_ptr
    shape(1) = 0
    shape(2) = 1
    kind = kind_int32
    call find_subdomain(handle, subdomain, loop, error)
    if (.not. allocated(error)) then
      owned => loop%run%simulation%decomposition%owned(subdomain + 1)
      shape(1) = owned%n
      select case (text_of(name))
      case ("id")
        kind = kind_int64
        if (owned%n > 0) address = c_loc(owned%id(1))
      case ("material")
        if (owned%n > 0) address = c_loc(owned%material(1))
      case ("glued")
        if (owned%n > 0) address = c_loc(owned%glued(1))
      case default
        call loop%get_array(text_of(name), subdomain + 1, values)
        kind = kind_double
        if (associated(values)) then
          shape(1) = size(values, 2)
          shape(2) = size(values, 1)
          if (size(values) > 0) address = c_loc(values(1, 1))
        else
          call raise(error, status_input, "array '"//text_of(name)//"': unknown; gravier.h has the names")
        end if
      end select
    end if
    status = told(error)
  end function gravier_array

  !> Whether `gravier_set_array` takes these values.
  integer(c_int) function gravier_check_array(handle, name, subdomain, values, shape) result(status) &
    & bind(C, name="gravier_check_array")
    type(c_ptr), value :: handle
    !> text of C
    type(c_ptr), value :: name
    !> from 0
    integer(c_int), value :: subdomain
    !> bodies, entries of each
    integer(c_int64_t), intent(in) :: shape(2)
    real(c_double), intent(in) :: values(shape(2), shape(1))
    type(user_loop_t), pointer :: loop
    type(error_t), allocatable :: error

    call find_subdomain(handle, subdomain, loop, error)
    if (.not. allocated(error)) call loop%check_array(text_of(name), subdomain + 1, values, error)
    status = told(error)
  end function gravier_check_array

  !> Set velocities or applied forces of the bodies of a subdomain of this rank.
  integer(c_int) function gravier_set_array(handle, name, subdomain, values, shape) result(status) bind(C, name="gravier_set_array")
    type(c_ptr), value :: handle
    !> text of C
    type(c_ptr), value :: name
    !> from 0
    integer(c_int), value :: subdomain
    !> bodies, entries of each
    integer(c_int64_t), intent(in) :: shape(2)
    real(c_double), intent(in) :: values(shape(2), shape(1))
    type(user_loop_t), pointer :: loop
    type(error_t), allocatable :: error

    call find_subdomain(handle, subdomain, loop, error)
    if (.not. allocated(error)) call loop%set_array(text_of(name), subdomain + 1, values, error)
    status = told(error)
  end function gravier_set_array

  !> Set gravity. The same on all ranks.
  integer(c_int) function gravier_set_gravity(handle, values, n) result(status) bind(C, name="gravier_set_gravity")
    type(c_ptr), value :: handle
    integer(c_int), value :: n
    real(c_double), intent(in) :: values(n)
    type(user_loop_t), pointer :: loop
    type(error_t), allocatable :: error

    call find_loop(handle, loop, error)
    if (.not. allocated(error)) call loop%set_gravity(values, error)
    status = told(error)
  end function gravier_set_gravity

  !> Set the friction between grains. The same on all ranks.
  integer(c_int) function gravier_set_friction(handle, value) result(status) bind(C, name="gravier_set_friction")
    type(c_ptr), value :: handle
    real(c_double), value :: value
    type(user_loop_t), pointer :: loop
    type(error_t), allocatable :: error

    call find_loop(handle, loop, error)
    if (.not. allocated(error)) call loop%set_friction(0, value, error)
    status = told(error)
  end function gravier_set_friction

  !> A quantity of the periodic cell by its name.
  integer(c_int) function gravier_get_cell(handle, name, value) result(status) bind(C, name="gravier_get_cell")
    type(c_ptr), value :: handle
    !> text of C
    type(c_ptr), value :: name
    real(c_double), intent(out) :: value
    type(user_loop_t), pointer :: loop
    type(error_t), allocatable :: error

    value = 0.0_dp
    call find_loop(handle, loop, error)
    if (.not. allocated(error)) call get_cell(loop, text_of(name), value, error)
    status = told(error)
  end function gravier_get_cell

  !> Set a rate or a stress of the periodic cell. The same on all ranks.
  integer(c_int) function gravier_set_cell(handle, name, value) result(status) bind(C, name="gravier_set_cell")
    type(c_ptr), value :: handle
    !> text of C
    type(c_ptr), value :: name
    real(c_double), value :: value
    type(user_loop_t), pointer :: loop
    type(error_t), allocatable :: error

    call find_loop(handle, loop, error)
    if (.not. allocated(error)) call set_cell(loop, text_of(name), value, error)
    status = told(error)
  end function gravier_set_cell

  !> Number of a boundary, from 0, by its name.
  integer(c_int) function gravier_boundary(handle, name, number) result(status) bind(C, name="gravier_boundary")
    type(c_ptr), value :: handle
    !> text of C
    type(c_ptr), value :: name
    integer(c_int), intent(out) :: number
    type(user_loop_t), pointer :: loop
    type(error_t), allocatable :: error
    integer :: b

    b = 0
    call find_loop(handle, loop, error)
    if (.not. allocated(error)) call loop%place(text_of(name), b, error)
    number = int(b - 1, c_int)
    status = told(error)
  end function gravier_boundary

  !> Name of boundary `number`, from 0, valid until the next call; null where there is none, which the last error tells.
  type(c_ptr) function gravier_boundary_name(handle, number) result(name) bind(C, name="gravier_boundary_name")
    type(c_ptr), value :: handle
    integer(c_int), value :: number
    type(user_loop_t), pointer :: loop
    type(error_t), allocatable :: error

    name = c_null_ptr
    call find_numbered(handle, number, loop, error)
    if (told(error) /= 0) return
    call put_text(loop%run%simulation%decomposition%boundaries(number + 1)%name, last_name)
    name = c_loc(last_name)
  end function gravier_boundary_name

  !> A quantity of a boundary by its name.
  integer(c_int) function gravier_get_boundary(handle, number, name, values, n) result(status) bind(C, name="gravier_get_boundary")
    type(c_ptr), value :: handle
    !> from 0
    integer(c_int), value :: number
    !> text of C
    type(c_ptr), value :: name
    !> the first n are set
    real(c_double), intent(out) :: values(3)
    integer(c_int), intent(out) :: n
    type(user_loop_t), pointer :: loop
    type(error_t), allocatable :: error
    real(dp), allocatable :: found(:)

    values(:) = 0.0_dp
    n = 0
    call find_numbered(handle, number, loop, error)
    if (.not. allocated(error)) call get_boundary(loop, number + 1, text_of(name), found, error)
    if (.not. allocated(error)) then
      n = int(size(found), c_int)
      values(1:n) = found
    end if
    status = told(error)
  end function gravier_get_boundary

  !> Set a drive or the friction of a boundary. The same on all ranks.
  integer(c_int) function gravier_set_boundary(handle, number, name, values, n) result(status) bind(C, name="gravier_set_boundary")
    type(c_ptr), value :: handle
    !> from 0
    integer(c_int), value :: number
    !> text of C
    type(c_ptr), value :: name
    integer(c_int), value :: n
    real(c_double), intent(in) :: values(n)
    type(user_loop_t), pointer :: loop
    type(error_t), allocatable :: error

    call find_numbered(handle, number, loop, error)
    if (.not. allocated(error)) call set_boundary(loop, number + 1, text_of(name), values, error)
    status = told(error)
  end function gravier_set_boundary

  !> Let bodies enter in the next step. The same on all ranks. Collective.
  integer(c_int) function gravier_add_bodies(handle, n, radius, mass, material, position, velocity) result(status) &
    & bind(C, name="gravier_add_bodies")
    type(c_ptr), value :: handle
    integer(c_int), value :: n
    !> [m]; [kg], 0 for that of the density
    real(c_double), intent(in) :: radius(n), mass(n)
    integer(c_int), intent(in) :: material(n)
    !> numbers of one body after those of another [m], [m/s]
    real(c_double), intent(in) :: position(*), velocity(*)
    type(user_loop_t), pointer :: loop
    type(error_t), allocatable :: error
    type(newcomers_t) :: bodies
    integer :: nd, k

    call find_counted(handle, n, loop, error)
    if (.not. allocated(error)) then
      nd = loop%run%simulation%decomposition%nd
      allocate (bodies%radius(n), bodies%mass(n), bodies%material(n), bodies%position(nd, n), bodies%velocity(nd, n))
      bodies%radius(:) = radius
      bodies%mass(:) = mass
      bodies%material(:) = material
      do k = 1, n
        bodies%position(:, k) = position((k - 1)*nd + 1:k*nd)
        bodies%velocity(:, k) = velocity((k - 1)*nd + 1:k*nd)
      end do
      call add_bodies(loop, bodies, error)
    end if
    status = told(error)
  end function gravier_add_bodies

  !> Take bodies out in the next step. The same on all ranks. Collective.
  integer(c_int) function gravier_remove_bodies(handle, n, id) result(status) bind(C, name="gravier_remove_bodies")
    type(c_ptr), value :: handle
    integer(c_int), value :: n
    integer(c_int64_t), intent(in) :: id(n)
    type(user_loop_t), pointer :: loop
    type(error_t), allocatable :: error

    call find_counted(handle, n, loop, error)
    if (.not. allocated(error)) call remove_bodies(loop, id, error)
    status = told(error)
  end function gravier_remove_bodies

  !> The run of a handle, which has a subdomain of this number, from 0, on this rank.
  subroutine find_subdomain(handle, subdomain, loop, error)
    type(c_ptr), intent(in) :: handle
    integer(c_int), intent(in) :: subdomain
    type(user_loop_t), pointer, intent(out) :: loop
    type(error_t), allocatable, intent(inout) :: error

    call find_loop(handle, loop, error)
    if (allocated(error)) return
    associate (n => size(loop%run%simulation%decomposition%owned))
      if (subdomain < 0 .or. subdomain >= n) call raise(error, status_input, "subdomain "//to_text(subdomain)// &
        & ": this rank has "//to_text(n)//"; expected a number from 0 on")
    end associate
  end subroutine find_subdomain

  !> The run of a handle, which has a boundary of this number, from 0.
  subroutine find_numbered(handle, number, loop, error)
    type(c_ptr), intent(in) :: handle
    integer(c_int), intent(in) :: number
    type(user_loop_t), pointer, intent(out) :: loop
    type(error_t), allocatable, intent(inout) :: error

    call find_loop(handle, loop, error)
    if (allocated(error)) return
    associate (n => size(loop%run%simulation%decomposition%boundaries))
      if (number < 0 .or. number >= n) call raise(error, status_input, "boundary "//to_text(number)//": the scene has "// &
        & to_text(n)//"; expected a number from 0 on")
    end associate
  end subroutine find_numbered

  !> The run of a handle, to which so many bodies are named.
  subroutine find_counted(handle, n, loop, error)
    type(c_ptr), intent(in) :: handle
    integer(c_int), intent(in) :: n
    type(user_loop_t), pointer, intent(out) :: loop
    type(error_t), allocatable, intent(inout) :: error

    call find_loop(handle, loop, error)
    if (n < 0) call raise(error, status_input, "n = "//to_text(n)//" bodies: expected 0 or more")
  end subroutine find_counted

end module gravier_c_scene
