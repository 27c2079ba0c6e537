!> Reads the text of one value through a namelist read of one internal record, once each of its entries is written as its kind is.
module gravier_config_value
  use gravier_kinds, only: dp
  use gravier_text, only: lower
  use gravier_number_text, only: number_size, is_integer, size_usual, size_tiny
  use gravier_config_types, only: text_length, choice_length
  use gravier_config_key, only: key_t, kind_integer, kind_real, kind_logical, kind_choice
  use gravier_config_keys, only: has_word
  use gravier_config_slots, only: slot_t
  implicit none
  private
  public :: read_value, most_entries

  !> entries of the longest key
  integer, parameter :: most_entries = 8
  !> of texts
  integer, parameter :: most_texts = 3
  !> room for a text whose quotes are all doubled
  integer, parameter :: longest_text = 2*text_length + 2

contains

  !> Reads `key(index) = value` into the variable of the key.
  !> Fails when the value is not of the key's kind, is not finite, does not fit, is not one of the choices or sets nothing.
  subroutine read_value(key, index, value, slot, touched, failed)
    type(key_t), intent(in) :: key
    !> with its parentheses, or empty
    character(len=*), intent(in) :: index
    !> a text without `/` and `&` outside quotes, as scan_groups gives it
    character(len=*), intent(in) :: value
    !> the variable, of the kind and count of the key; unchanged on failure
    type(slot_t), intent(inout) :: slot
    !> the entries that the value sets
    logical, intent(out) :: touched(most_entries)
    logical, intent(out) :: failed

    touched = .false.
    failed = key%count == 1 .and. index /= ""
    if (.not. failed) failed = .not. are_of_kind(key%kind, value)
    if (failed) return
    select case (key%kind)
    case (kind_integer)
      call read_integer(key, index//" = "//value, slot, touched, failed)
    case (kind_real)
      call read_real(key, index//" = "//value, slot, touched, failed)
    case (kind_logical)
      call read_logical(key, index, value, slot, touched, failed)
    case default
      if (key%count == 1) call read_text(key, value, slot, touched, failed)
      if (key%count > 1) call read_texts(index, value, slot, touched, failed)
    end select
  end subroutine read_value

  !> Are the entries set by a value some of the first `count`, and one at least?
  pure logical function fits(touched, count)
    logical, intent(in) :: touched(:)
    integer, intent(in) :: count
    fits = any(touched) .and. .not. any(touched(count + 1:))
  end function fits

  subroutine read_integer(key, assignment, slot, touched, failed)
    type(key_t), intent(in) :: key
    !> from the index on
    character(len=*), intent(in) :: assignment
    type(slot_t), intent(inout) :: slot
    logical, intent(out) :: touched(most_entries)
    logical, intent(out) :: failed
    integer :: values(most_entries), again(most_entries), status

    ! a null value sets nothing: what two reads leave as they found it was not set
    values = 0
    again = 1
    call integers_of_record(assignment, values, status)
    if (status == 0) call integers_of_record(assignment, again, status)
    touched = values == again
    failed = status /= 0 .or. .not. fits(touched, key%count)
    if (failed) return
    if (key%count == 1) slot%integer = values(1)
    if (key%count > 1) where (touched(:key%count)) slot%integers = values(:key%count)
  end subroutine read_integer

  subroutine read_real(key, assignment, slot, touched, failed)
    type(key_t), intent(in) :: key
    !> from the index on
    character(len=*), intent(in) :: assignment
    type(slot_t), intent(inout) :: slot
    logical, intent(out) :: touched(most_entries)
    logical, intent(out) :: failed
    real(dp) :: values(most_entries), again(most_entries)
    integer :: status

    values = 0.0_dp
    again = 1.0_dp
    call reals_of_record(assignment, values, status)
    if (status == 0) call reals_of_record(assignment, again, status)
    failed = status /= 0
    if (failed) return
    touched = abs(values - again) < 0.5_dp
    failed = .not. fits(touched, key%count)
    if (failed) return
    if (key%count == 1) slot%real = values(1)
    if (key%count > 1) where (touched(:key%count)) slot%reals = values(:key%count)
  end subroutine read_real

  subroutine read_logical(key, index, value, slot, touched, failed)
    type(key_t), intent(in) :: key
    !> with its parentheses, or empty
    character(len=*), intent(in) :: index
    character(len=*), intent(in) :: value
    type(slot_t), intent(inout) :: slot
    logical, intent(out) :: touched(most_entries)
    logical, intent(out) :: failed
    logical :: values(most_entries), again(most_entries)
    integer :: status

    values = .false.
    again = .true.
    call logicals_of_record(index//" = "//value, values, status)
    if (status == 0) call logicals_of_record(index//" = "//value, again, status)
    touched = values .eqv. again
    failed = status /= 0 .or. .not. fits(touched, key%count)
    if (failed) return
    if (key%count == 1) slot%logical = values(1)
    if (key%count > 1) where (touched(:key%count)) slot%logicals = values(:key%count)
  end subroutine read_logical

  !> Are the entries of a list, each perhaps after a repeat count and a star, all written as values of a kind are? The intrinsic
  !> read would take `tomato` as true, `1-1` as 0.1 and `inf` as a number. Texts are not looked at.
  pure logical function are_of_kind(kind, list)
    integer, intent(in) :: kind
    character(len=*), intent(in) :: list
    integer :: first, length

    are_of_kind = .true.
    if (all(kind /= [kind_integer, kind_real, kind_logical])) return
    first = 1
    do while (first <= len(list) .and. are_of_kind)
      length = scan(list(first:)//",", " ,") - 1
      associate (entry => list(first:first + length - 1))
        if (length > 0) are_of_kind = is_of_kind(kind, entry(index(entry, "*") + 1:))
      end associate
      first = first + length + 1
    end do
  end function are_of_kind

  !> Is it an integer, a real that is finite, or a word for a logical value?
  pure logical function is_of_kind(kind, text)
    integer, intent(in) :: kind
    character(len=*), intent(in) :: text

    select case (kind)
    case (kind_integer)
      is_of_kind = is_integer(text)
    case (kind_real)
      is_of_kind = any(number_size(text) == [size_usual, size_tiny])
    case default
      is_of_kind = has_word("t f .t. .f. true false .true. .false.", lower(text))
    end select
  end function is_of_kind

  !> A text of at most text_length characters, or one of the choices of the key in any case.
  subroutine read_text(key, value, slot, touched, failed)
    type(key_t), intent(in) :: key
    character(len=*), intent(in) :: value
    type(slot_t), intent(inout) :: slot
    logical, intent(out) :: touched(most_entries)
    logical, intent(out) :: failed
    character(len=longest_text) :: read_one
    integer :: status

    touched = .false.
    failed = .not. is_quoted(value)
    if (failed) return
    call text_of_record("= "//value, read_one, status)
    failed = status /= 0 .or. len_trim(read_one) > text_length
    if (failed) return
    if (key%kind == kind_choice) then
      failed = .not. has_word(trim(key%allowed), lower(trim(read_one)))
      if (.not. failed) slot%choice = lower(trim(read_one))
    else
      slot%text = read_one(:text_length)
    end if
    touched(1) = .not. failed
  end subroutine read_text

  !> Texts in quotes, of at most text_length characters, none of them empty.
  subroutine read_texts(index, value, slot, touched, failed)
    !> with its parentheses, or empty
    character(len=*), intent(in) :: index
    character(len=*), intent(in) :: value
    type(slot_t), intent(inout) :: slot
    logical, intent(out) :: touched(most_entries)
    logical, intent(out) :: failed
    character(len=longest_text) :: values(most_texts), again(most_texts)
    integer :: status, i

    touched = .false.
    failed = .not. is_quoted(value)
    if (failed) return
    values = ""
    again = "?"
    call texts_of_record(index//" = "//value, values, status)
    if (status == 0) call texts_of_record(index//" = "//value, again, status)
    touched(:most_texts) = values == again
    failed = status /= 0 .or. any(len_trim(values) > text_length) .or. any(touched(:most_texts) .and. values == "") &
      & .or. .not. fits(touched, size(slot%texts))
    if (failed) return
    do i = 1, size(slot%texts)
      if (touched(i)) slot%texts(i) = values(i) (:text_length)
    end do
  end subroutine read_texts

  !> Does it begin and end as texts in quotes do, and is it short enough for the reading?
  pure logical function is_quoted(value)
    character(len=*), intent(in) :: value
    integer :: n
    n = len(value)
    is_quoted = .false.
    if (n < 2 .or. n > longest_text) return
    is_quoted = scan(value(1:1), "'""") == 1 .and. scan(value(n:n), "'""") == 1
  end function is_quoted

  subroutine integers_of_record(assignment, value, status)
    !> `(index) = values`
    character(len=*), intent(in) :: assignment
    integer, intent(inout) :: value(most_entries)
    !> not 0: it is not a list of integers
    integer, intent(out) :: status
    character(len=:), allocatable :: record
    namelist /one/ value

    record = "&one value"//assignment//" /"
    read (record, nml=one, iostat=status)
    if (status /= 0) call forget_failed_read()
  end subroutine integers_of_record

  subroutine reals_of_record(assignment, value, status)
    !> `(index) = values`
    character(len=*), intent(in) :: assignment
    real(dp), intent(inout) :: value(most_entries)
    !> not 0: it is not a list of reals
    integer, intent(out) :: status
    character(len=:), allocatable :: record
    namelist /one/ value

    record = "&one value"//assignment//" /"
    read (record, nml=one, iostat=status)
    if (status /= 0) call forget_failed_read()
  end subroutine reals_of_record

  subroutine logicals_of_record(assignment, value, status)
    !> `(index) = values`
    character(len=*), intent(in) :: assignment
    logical, intent(inout) :: value(most_entries)
    !> not 0: it is not a list of logicals
    integer, intent(out) :: status
    character(len=:), allocatable :: record
    namelist /one/ value

    record = "&one value"//assignment//" /"
    read (record, nml=one, iostat=status)
    if (status /= 0) call forget_failed_read()
  end subroutine logicals_of_record

  subroutine text_of_record(assignment, value, status)
    character(len=*), intent(in) :: assignment
    character(len=longest_text), intent(out) :: value
    integer, intent(out) :: status
    character(len=:), allocatable :: record
    namelist /one/ value

    value = ""
    record = "&one value "//assignment//" /"
    read (record, nml=one, iostat=status)
    if (status /= 0) call forget_failed_read()
  end subroutine text_of_record

  subroutine texts_of_record(assignment, value, status)
    !> `(index) = values`
    character(len=*), intent(in) :: assignment
    character(len=longest_text), intent(inout) :: value(most_texts)
    !> not 0: it is not a list of texts
    integer, intent(out) :: status
    character(len=:), allocatable :: record
    namelist /one/ value

    record = "&one value"//assignment//" /"
    read (record, nml=one, iostat=status)
    if (status /= 0) call forget_failed_read()
  end subroutine texts_of_record

  !> A read of no consequence. The library of gfortran 12 keeps the rest of a record that it could not read, as
  !> `1e-` for a real number, and the next namelist read of the program sets nothing and reports success.
  subroutine forget_failed_read()
    character(len=16) :: record
    integer :: value, status
    namelist /one/ value

    value = 0
    record = "&one value = 1 /"
    read (record, nml=one, iostat=status)
    if (status /= 0) value = 0
  end subroutine forget_failed_read

end module gravier_config_value
