!> What an input file gives, key by key, and the messages that quote it.
module gravier_config_report
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_config_table, only: groups, keys
  use gravier_config_keys, only: find_group, find_key, expected_text
  implicit none
  private
  public :: given_t, report_t, expect, expect_own_name, miss, is_given, reaches, shown_text, label, ordinal

  !> Whether a key of the table is in a group of the file, and how.
  type :: given_t
    !> the entries that are set
    logical :: entries(8) = .false.
    !> an entry is set by its index
    logical :: by_index = .false.
    !> `key = value` as the file has it; several, separated by commas, when the entries were set one by one
    character(len=:), allocatable :: shown
    !> what stands after the equal sign, of the last entry given
    character(len=:), allocatable :: value
  end type given_t

  !> What every check needs to make its message.
  type :: report_t
    !> path of the file
    character(len=:), allocatable :: file
    !> shape (number of keys, largest number of groups of one name): the groups of a name in the order of the file
    type(given_t), allocatable :: given(:, :)
    !> the group under check among those of its name
    integer :: instance = 1
  end type report_t

contains

  !> Fails with `FILE: &group key = VALUE: expected ...` unless the rule holds.
  subroutine expect(report, holds, group, key, error, what)
    type(report_t), intent(in) :: report
    logical, intent(in) :: holds
    character(len=*), intent(in) :: group, key
    type(error_t), allocatable, intent(inout) :: error
    !> what is expected; the words of the table of keys by default
    character(len=*), intent(in), optional :: what
    character(len=:), allocatable :: expected

    if (holds) return
    expected = expected_text(keys(find_key(group, key)))
    if (present(what)) expected = what
    call raise(error, status_input, report%file//": "//label(report, group)//" "//shown_text(report, group, key) &
               //": expected "//expected)
  end subroutine expect

  !> Fails unless the group under check, the last of some, has a name and no other has the same.
  subroutine expect_own_name(report, group, names, error)
    type(report_t), intent(in) :: report
    character(len=*), intent(in) :: group
    !> of the groups up to the one under check
    character(len=*), intent(in) :: names(:)
    type(error_t), allocatable, intent(inout) :: error
    integer :: i, n

    n = size(names)
    call expect(report, names(n) /= "", group, "name", error)
    do i = 1, n - 1
      ! texts are made where they are needed alone: there are as many pairs of groups as their number squared
      if (names(i) == names(n)) call expect(report, .false., group, "name", error, &
        & "a name of its own, but the "//ordinal(i)//" has it too")
    end do
  end subroutine expect_own_name

  !> Fails with `FILE: &group key is missing: expected ..., required by ...` unless the key is given.
  subroutine miss(report, group, key, error, required_by)
    type(report_t), intent(in) :: report
    character(len=*), intent(in) :: group, key
    type(error_t), allocatable, intent(inout) :: error
    !> what asks for the key; empty when the group does
    character(len=*), intent(in) :: required_by
    character(len=:), allocatable :: reason

    if (is_given(report, group, key)) return
    reason = ""
    if (required_by /= "") reason = ", required by "//required_by
    call raise(error, status_input, report%file//": "//label(report, group)//" "//key//" is missing: expected " &
               //expected_text(keys(find_key(group, key)))//reason)
  end subroutine miss

  pure logical function is_given(report, group, key)
    type(report_t), intent(in) :: report
    character(len=*), intent(in) :: group, key
    is_given = any(report%given(find_key(group, key), report%instance)%entries)
  end function is_given

  !> Whether a list sets an entry, which would keep its default otherwise. It need not if it is not given, or is given by indices.
  pure logical function reaches(report, group, key, entry)
    type(report_t), intent(in) :: report
    character(len=*), intent(in) :: group, key
    integer, intent(in) :: entry

    associate (given => report%given(find_key(group, key), report%instance))
      reaches = given%entries(entry) .or. given%by_index .or. .not. any(given%entries)
    end associate
  end function reaches

  !> A key as the file has it, or its name when it is not given.
  pure function shown_text(report, group, key) result(text)
    type(report_t), intent(in) :: report
    character(len=*), intent(in) :: group, key
    character(len=:), allocatable :: text

    text = key
    associate (given => report%given(find_key(group, key), report%instance))
      if (allocated(given%shown)) text = given%shown
    end associate
  end function shown_text

  !> The group under check: `&scene`, `&boundary (the 2nd, 'lid')`, or `&boundary (the 2nd)` when it has no name.
  pure function label(report, group) result(text)
    type(report_t), intent(in) :: report
    character(len=*), intent(in) :: group
    character(len=:), allocatable :: text
    integer :: k

    text = "&"//trim(group)
    if (.not. groups(find_group(group))%repeated) return
    text = text//" (the "//ordinal(report%instance)
    k = find_key(group, "name")
    if (k > 0) then
      if (allocated(report%given(k, report%instance)%value)) text = text//", "//report%given(k, report%instance)%value
    end if
    text = text//")"
  end function label

  !> 1st, 2nd, 3rd, 4th, 11th, 21st ...
  pure function ordinal(n) result(text)
    integer, intent(in) :: n
    character(len=:), allocatable :: text
    character(len=2), parameter :: endings(0:3) = ["th", "st", "nd", "rd"]
    integer :: last

    last = mod(n, 10)
    if (last > 3 .or. mod(n, 100)/10 == 1) last = 0
    text = to_text(n)//endings(last)
  end function ordinal

end module gravier_config_report
