!> Cells of a row of a bodies table, with the ranges of what they say.
module gravier_bodies_cells
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_magnitude, only: is_bounded, is_size, bounded_text, size_text
  use gravier_csv_table, only: csv_table_t
  implicit none
  private
  public :: read_id, read_number, read_positive, read_numbers, read_quantities, expect_nothing

contains

  subroutine read_id(table, column, id, error)
    type(csv_table_t), intent(in) :: table
    integer, intent(in) :: column
    integer(i8), intent(inout) :: id
    type(error_t), allocatable, intent(inout) :: error

    call table%get_integer(column, id, error)
    if (allocated(error)) return
    if (id < 1) call table%refuse(column, "an id >= 1", error)
  end subroutine read_id

  !> Read the number of the group that a grain is glued to, or of its material; a cell that is empty or missing is the least.
  subroutine read_number(table, column, what, least, number, error)
    type(csv_table_t), intent(in) :: table
    integer, intent(in) :: column
    !> for messages
    character(len=*), intent(in) :: what
    integer, intent(in) :: least
    integer, intent(out) :: number
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: value

    number = least
    if (table%is_empty(column)) return
    call table%get_integer(column, value, error)
    if (allocated(error)) return
    if (value < least .or. value > huge(number)) then
      call table%refuse(column, what//" from "//to_text(least)//" to "//to_text(huge(number)), error)
    else
      number = narrow(value)
    end if
  end subroutine read_number

  subroutine read_positive(table, column, expected, value, error)
    type(csv_table_t), intent(in) :: table
    integer, intent(in) :: column
    character(len=*), intent(in) :: expected
    real(dp), intent(inout) :: value
    type(error_t), allocatable, intent(inout) :: error

    call table%get_real(column, value, error)
    if (allocated(error)) return
    if (value <= 0) call table%refuse(column, expected, error)
    if (.not. is_size(value)) call table%refuse(column, size_text, error)
  end subroutine read_positive

  !> Read numbers from several columns; a cell that is empty or missing leaves its value, unless it is required.
  subroutine read_numbers(table, columns, required, values, error)
    type(csv_table_t), intent(in) :: table
    integer, intent(in) :: columns(:)
    logical, intent(in) :: required
    real(dp), intent(inout) :: values(:)
    type(error_t), allocatable, intent(inout) :: error
    integer :: k

    do k = 1, size(columns)
      if (table%is_empty(columns(k)) .and. .not. required) cycle
      call table%get_real(columns(k), values(k), error)
    end do
  end subroutine read_numbers

  !> Read numbers that are places or velocities, in the same way.
  subroutine read_quantities(table, columns, required, values, error)
    type(csv_table_t), intent(in) :: table
    integer, intent(in) :: columns(:)
    logical, intent(in) :: required
    real(dp), intent(inout) :: values(:)
    type(error_t), allocatable, intent(inout) :: error
    integer :: k

    call read_numbers(table, columns, required, values, error)
    if (allocated(error)) return
    do k = 1, size(columns)
      if (.not. is_bounded(values(k))) call table%refuse(columns(k), bounded_text, error)
    end do
  end subroutine read_quantities

  !> Refuse what has no meaning in a row: a number that is not 0.
  subroutine expect_nothing(table, columns, row, error)
    type(csv_table_t), intent(in) :: table
    !> 0 for a column that the file does not have
    integer, intent(in) :: columns(:)
    !> what the row is, for the message
    character(len=*), intent(in) :: row
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: value
    integer :: k

    do k = 1, size(columns)
      if (table%is_empty(columns(k))) cycle
      value = 0.0_dp
      call table%get_real(columns(k), value, error)
      if (abs(value) > 0.0_dp) call table%refuse(columns(k), "an empty cell or 0 in the row of "//row, error)
    end do
  end subroutine expect_nothing

end module gravier_bodies_cells
