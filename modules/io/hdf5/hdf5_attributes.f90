!> Attributes of the groups and datasets of an HDF5 file.
module gravier_hdf5_attributes
  use, intrinsic :: iso_c_binding, only: c_char, c_loc, c_null_char, c_null_ptr, c_ptr
  use hdf5, only: H5P_DEFAULT_F, H5S_SCALAR_F, H5T_FLOAT_F, H5T_IEEE_F64LE, H5T_INTEGER_F, H5T_NO_CLASS_F, H5T_STD_I64LE, &
    & H5T_STRING_F, H5_INTEGER_KIND, H5_REAL_KIND, h5aclose_f, h5acreate_f, h5aexists_by_name_f, h5aget_space_f, &
    & h5aget_type_f, h5aopen_by_name_f, h5aopen_f, h5aread_f, h5awrite_f, h5dvlen_reclaim_f, h5kind_to_type, h5oclose_f, &
    & h5oopen_f, h5sclose_f, h5screate_f, h5screate_simple_f, h5sget_simple_extent_npoints_f, h5tclose_f, h5tget_class_f, &
    & h5tget_size_f, h5tis_variable_str_f, hid_t, hsize_t, size_t
  use gravier_kinds, only: dp, i4, i8
  use gravier_errors, only: error_t
  use gravier_system_calls, only: text_at
  use gravier_hdf5_properties, only: text_type, is_ascii
  use gravier_hdf5_tree, only: h5_tree_t
  implicit none
  private
  public :: h5_attributes_t, attach_integer

  type, extends(h5_tree_t) :: h5_attributes_t
  contains
    !> write_attribute(path, name, value, error): attach a value, the same on all ranks, to a group or dataset
    generic :: write_attribute => write_text, write_i4, write_i8, write_i8_list, write_real
    procedure, private :: write_text => h5_write_text
    procedure, private :: write_i4 => h5_write_i4
    procedure, private :: write_i8 => h5_write_i8
    procedure, private :: write_i8_list => h5_write_i8_list
    procedure, private :: write_real => h5_write_real
    procedure :: change_attribute => h5_change_attribute

    !> read_attribute(path, name, value, error)
    generic :: read_attribute => read_text, read_i8, read_real
    procedure, private :: read_text => h5_read_text
    procedure, private :: read_i8 => h5_read_i8
    procedure, private :: read_real => h5_read_real

    procedure :: has_attribute => h5_has_attribute

    procedure, private :: write_value
    procedure, private :: read_value
  end type h5_attributes_t

  !> The value of an attribute in memory.
  type :: value_t
    !> of the value in the file and in memory
    integer(hid_t) :: file_type = -1, memory_type = -1
    !> of a list; 0 of a scalar
    integer :: length = 0
    type(c_ptr) :: buffer = c_null_ptr
  end type value_t

  !> longest text kept in an object header, whose messages hold 64 KiB; longer ones go to a heap
  integer, parameter :: longest_inline_text = 60000

contains

  !> Text of any length, as a string of fixed length where it fits into the header of the object.
  subroutine h5_write_text(self, path, name, value, error)
    class(h5_attributes_t), intent(in) :: self
    character(len=*), intent(in) :: path, name, value
    type(error_t), allocatable, intent(inout) :: error
    character(kind=c_char, len=:), allocatable, target :: letters
    type(c_ptr), target :: address
    integer(hid_t) :: type
    integer :: stat

    if (allocated(error)) return
    letters = value//c_null_char
    address = c_loc(letters)
    if (len(value) > longest_inline_text) then
      type = text_type(0, is_ascii(value))
      call self%write_value(path, name, value_t(type, type, 0, c_loc(address)), error)
    else
      type = text_type(max(1, len(value)), is_ascii(value))
      call self%write_value(path, name, value_t(type, type, 0, address), error)
    end if
    call h5tclose_f(type, stat)
  end subroutine h5_write_text

  subroutine h5_write_i4(self, path, name, value, error)
    class(h5_attributes_t), intent(in) :: self
    character(len=*), intent(in) :: path, name
    integer(i4), intent(in) :: value
    type(error_t), allocatable, intent(inout) :: error
    call self%write_attribute(path, name, int(value, i8), error)
  end subroutine h5_write_i4

  subroutine h5_write_i8(self, path, name, value, error)
    class(h5_attributes_t), intent(in) :: self
    character(len=*), intent(in) :: path, name
    integer(i8), intent(in) :: value
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), target :: copy

    copy = value
    call self%write_value(path, name, value_t(H5T_STD_I64LE, h5kind_to_type(i8, H5_INTEGER_KIND), 0, c_loc(copy)), error)
  end subroutine h5_write_i8

  subroutine h5_write_i8_list(self, path, name, value, error)
    class(h5_attributes_t), intent(in) :: self
    character(len=*), intent(in) :: path, name
    !> not empty
    integer(i8), intent(in) :: value(:)
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), target :: copy(size(value))

    copy = value
    call self%write_value(path, name, value_t(H5T_STD_I64LE, h5kind_to_type(i8, H5_INTEGER_KIND), size(copy), c_loc(copy)), error)
  end subroutine h5_write_i8_list

  subroutine h5_write_real(self, path, name, value, error)
    class(h5_attributes_t), intent(in) :: self
    character(len=*), intent(in) :: path, name
    real(dp), intent(in) :: value
    type(error_t), allocatable, intent(inout) :: error
    real(dp), target :: copy

    copy = value
    call self%write_value(path, name, value_t(H5T_IEEE_F64LE, h5kind_to_type(dp, H5_REAL_KIND), 0, c_loc(copy)), error)
  end subroutine h5_write_real

  !> Give an integer attribute that is there another value, in its place.
  subroutine h5_change_attribute(self, path, name, value, error)
    class(h5_attributes_t), intent(in) :: self
    character(len=*), intent(in) :: path, name
    integer(i8), intent(in) :: value
    type(error_t), allocatable, intent(inout) :: error
    integer(hid_t) :: place, object, attribute
    integer(i8), target :: copy
    character(len=:), allocatable :: object_name
    type(c_ptr) :: address
    integer :: stat, ignored

    if (allocated(error)) return
    copy = value
    address = c_loc(copy)
    call self%locate(path, place, object_name)
    call h5oopen_f(place, object_name, object, stat)
    if (stat == 0) then
      call h5aopen_f(object, name, attribute, stat)
      if (stat == 0) then
        call h5awrite_f(attribute, h5kind_to_type(i8, H5_INTEGER_KIND), address, stat)
        call h5aclose_f(attribute, ignored)
      end if
      call h5oclose_f(object, ignored)
    end if
    if (stat < 0) call self%fail(path, "cannot write attribute "//name, error)
    call self%comm%agree(error)
  end subroutine h5_change_attribute

  !> Attach an integer to an object that is open.
  subroutine attach_integer(object, name, value, stat)
    integer(hid_t), intent(in) :: object
    character(len=*), intent(in) :: name
    integer(i8), intent(in) :: value
    !> below 0 after a failure
    integer, intent(out) :: stat
    integer(i8), target :: copy

    copy = value
    call attach(object, name, value_t(H5T_STD_I64LE, h5kind_to_type(i8, H5_INTEGER_KIND), 0, c_loc(copy)), stat)
  end subroutine attach_integer

  subroutine attach(object, name, value, stat)
    integer(hid_t), intent(in) :: object
    character(len=*), intent(in) :: name
    type(value_t), intent(in) :: value
    integer, intent(out) :: stat
    integer(hid_t) :: space, attribute
    integer(hsize_t) :: extent(1)
    type(c_ptr) :: address
    integer :: ignored

    address = value%buffer
    if (value%length == 0) then
      call h5screate_f(H5S_SCALAR_F, space, ignored)
    else
      extent = int(value%length, hsize_t)
      call h5screate_simple_f(1, extent, space, ignored)
    end if
    call h5acreate_f(object, name, value%file_type, space, attribute, stat)
    if (stat == 0) then
      call h5awrite_f(attribute, value%memory_type, address, stat)
      call h5aclose_f(attribute, ignored)
    end if
    call h5sclose_f(space, ignored)
  end subroutine attach

  !> Write one attribute.
  subroutine write_value(self, path, name, value, error)
    class(h5_attributes_t), intent(in) :: self
    character(len=*), intent(in) :: path, name
    type(value_t), intent(in) :: value
    type(error_t), allocatable, intent(inout) :: error
    integer(hid_t) :: place, object
    character(len=:), allocatable :: object_name
    integer :: stat, ignored

    if (allocated(error)) return
    call self%locate(path, place, object_name)
    call h5oopen_f(place, object_name, object, stat)
    if (stat == 0) then
      call attach(object, name, value, stat)
      call h5oclose_f(object, ignored)
    end if
    if (stat < 0) call self%fail(path, "cannot write attribute "//name, error)
    call self%comm%agree(error)
  end subroutine write_value

  subroutine h5_read_i8(self, path, name, value, error)
    class(h5_attributes_t), intent(in) :: self
    character(len=*), intent(in) :: path, name
    integer(i8), intent(out) :: value
    type(error_t), allocatable, intent(inout) :: error
    integer(i8), target :: copy

    copy = 0
    call self%read_value(path, name, H5T_INTEGER_F, h5kind_to_type(i8, H5_INTEGER_KIND), c_loc(copy), error)
    value = copy
  end subroutine h5_read_i8

  subroutine h5_read_real(self, path, name, value, error)
    class(h5_attributes_t), intent(in) :: self
    character(len=*), intent(in) :: path, name
    real(dp), intent(out) :: value
    type(error_t), allocatable, intent(inout) :: error
    real(dp), target :: copy

    copy = 0
    call self%read_value(path, name, H5T_FLOAT_F, h5kind_to_type(dp, H5_REAL_KIND), c_loc(copy), error)
    value = copy
  end subroutine h5_read_real

  !> Read one number of the given class.
  subroutine read_value(self, path, name, data_class, memory_type, buffer, error)
    class(h5_attributes_t), intent(in) :: self
    character(len=*), intent(in) :: path, name
    integer, intent(in) :: data_class
    integer(hid_t), intent(in) :: memory_type
    type(c_ptr), intent(in) :: buffer
    type(error_t), allocatable, intent(inout) :: error
    integer(hid_t) :: attribute, type
    type(c_ptr) :: address
    integer :: found, stat, ignored

    if (allocated(error)) return
    address = buffer
    call open_attribute(self, path, name, attribute, type, found, stat)
    if (stat == 0) then
      if (found /= data_class) stat = -1
      if (.not. is_scalar(attribute)) stat = -1
      if (stat == 0) call h5aread_f(attribute, memory_type, address, stat)
      call h5tclose_f(type, ignored)
      call h5aclose_f(attribute, ignored)
    end if
    if (stat < 0) call self%fail(path, "attribute "//name//" is missing or not one number of its kind", error)
    call self%comm%agree(error)
  end subroutine read_value

  !> Text of fixed or variable length, without the padding.
  subroutine h5_read_text(self, path, name, value, error)
    class(h5_attributes_t), intent(in) :: self
    character(len=*), intent(in) :: path, name
    character(len=:), allocatable, intent(out) :: value
    type(error_t), allocatable, intent(inout) :: error
    integer(hid_t) :: attribute, type
    logical :: variable
    integer :: found, stat, ignored

    value = ""
    if (allocated(error)) return
    call open_attribute(self, path, name, attribute, type, found, stat)
    if (stat == 0) then
      if (found /= H5T_STRING_F) stat = -1
      if (.not. is_scalar(attribute)) stat = -1
      if (stat == 0) call h5tis_variable_str_f(type, variable, stat)
      if (stat == 0 .and. variable) call read_variable_text(attribute, type, value, stat)
      if (stat == 0 .and. .not. variable) call read_fixed_text(attribute, type, value, stat)
      call h5tclose_f(type, ignored)
      call h5aclose_f(attribute, ignored)
    end if
    if (stat < 0) call self%fail(path, "attribute "//name//" is missing or not one text", error)
    call self%comm%agree(error)
  end subroutine h5_read_text

  !> True when the object at `path` has an attribute of this name. Not collective.
  logical function h5_has_attribute(self, path, name) result(has)
    class(h5_attributes_t), intent(in) :: self
    character(len=*), intent(in) :: path, name
    integer(hid_t) :: place
    character(len=:), allocatable :: object_name
    integer :: stat

    has = .false.
    if (.not. self%exists(path)) return
    call self%locate(path, place, object_name)
    call h5aexists_by_name_f(place, object_name, name, has, stat)
    if (stat < 0) has = .false.
  end function h5_has_attribute

  subroutine read_fixed_text(attribute, type, value, stat)
    integer(hid_t), intent(in) :: attribute, type
    character(len=:), allocatable, intent(inout) :: value
    integer, intent(out) :: stat
    character(kind=c_char, len=:), allocatable, target :: letters
    type(c_ptr) :: address
    integer(size_t) :: length

    call h5tget_size_f(type, length, stat)
    if (stat < 0) return
    allocate (character(kind=c_char, len=length) :: letters)
    address = c_loc(letters)
    call h5aread_f(attribute, type, address, stat)
    if (stat == 0) value = up_to_null(letters)
  end subroutine read_fixed_text

  subroutine read_variable_text(attribute, type, value, stat)
    integer(hid_t), intent(in) :: attribute, type
    character(len=:), allocatable, intent(inout) :: value
    integer, intent(out) :: stat
    type(c_ptr), target :: text
    type(c_ptr) :: address
    integer(hid_t) :: space
    integer :: ignored

    text = c_null_ptr
    address = c_loc(text)
    call h5aread_f(attribute, type, address, stat)
    if (stat < 0) return
    value = text_at(text)
    call h5aget_space_f(attribute, space, ignored)
    call h5dvlen_reclaim_f(type, space, H5P_DEFAULT_F, address, ignored)
    call h5sclose_f(space, ignored)
  end subroutine read_variable_text

  pure function up_to_null(letters) result(text)
    character(len=*), intent(in) :: letters
    character(len=:), allocatable :: text
    integer :: n

    n = index(letters, c_null_char) - 1
    if (n < 0) n = len(letters)
    text = letters(1:n)
  end function up_to_null

  !> Open an attribute and its type; stat < 0 when there is none.
  subroutine open_attribute(self, path, name, attribute, type, data_class, stat)
    type(h5_attributes_t), intent(in) :: self
    character(len=*), intent(in) :: path, name
    integer(hid_t), intent(out) :: attribute, type
    integer, intent(out) :: data_class, stat
    integer(hid_t) :: place
    character(len=:), allocatable :: object_name
    integer :: ignored

    attribute = -1
    type = -1
    data_class = H5T_NO_CLASS_F
    stat = -1
    if (.not. self%exists(path)) return
    call self%locate(path, place, object_name)
    call h5aopen_by_name_f(place, object_name, name, attribute, stat)
    if (stat < 0) return
    call h5aget_type_f(attribute, type, stat)
    if (stat == 0) call h5tget_class_f(type, data_class, stat)
    if (stat < 0) call h5aclose_f(attribute, ignored)
  end subroutine open_attribute

  logical function is_scalar(attribute)
    integer(hid_t), intent(in) :: attribute
    integer(hid_t) :: space
    integer(hsize_t) :: n_points
    integer :: stat

    is_scalar = .false.
    call h5aget_space_f(attribute, space, stat)
    if (stat < 0) return
    call h5sget_simple_extent_npoints_f(space, n_points, stat)
    is_scalar = stat == 0 .and. n_points == 1
    call h5sclose_f(space, stat)
  end function is_scalar

end module gravier_hdf5_attributes
