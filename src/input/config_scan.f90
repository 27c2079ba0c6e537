!> Splits the text of an input file into namelist groups and their assignments, without reading the values.
module gravier_config_scan
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: lower, to_text
  implicit none
  private
  public :: group_text_t, assignment_t, scan_t, scan_groups, excerpt

  !> A group of the file.
  type :: group_text_t
    !> lower case
    character(len=:), allocatable :: name
    !> number among the groups of that name
    integer :: instance = 1
    !> where it starts
    integer :: line = 0
  end type group_text_t

  !> One `key(index) = value` of the file.
  type :: assignment_t
    !> lower case
    character(len=:), allocatable :: group, key
    !> number of the group among those of that name
    integer :: instance = 1
    !> with its parentheses, empty when there is none
    character(len=:), allocatable :: index
    !> one line, without comments and without the commas at the end; may be empty
    character(len=:), allocatable :: value
  end type assignment_t

  !> What a file holds, in its order: the first n_ entries are used.
  type :: scan_t
    integer :: n_groups = 0, n_assignments = 0
    type(group_text_t), allocatable :: groups(:)
    type(assignment_t), allocatable :: assignments(:)
  contains
    procedure :: change => scan_change
  end type scan_t

  !> The text under way and the position of the next character.
  type :: cursor_t
    character(len=:), allocatable :: file, text
    integer :: at = 1
    !> lines that end before position `counted`
    integer :: lines = 0, counted = 1
    !> a place where a value is put together, as long as the text
    character(len=:), allocatable :: buffer
  end type cursor_t

  character(len=*), parameter :: tab = achar(9), newline = achar(10), carriage = achar(13)
  character(len=*), parameter :: blanks = " "//tab//newline//carriage
  character(len=*), parameter :: letters = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
  character(len=*), parameter :: name_characters = letters//"0123456789_"
  !> what an editor may put in front of a text in UTF-8
  character(len=*), parameter :: byte_order_mark = char(239)//char(187)//char(191)
  !> longest piece of a file that a message quotes
  integer, parameter :: excerpt_length = 80

contains

  !> Splits a text into groups and assignments. Groups and keys are not compared with any table.
  !> Fails (status_input) on an empty file, on text outside groups, on a group not closed, on a quote not closed on its
  !> line, and on anything else than assignments in a group.
  subroutine scan_groups(file, text, found, error)
    !> path, for messages
    character(len=*), intent(in) :: file
    character(len=*), intent(in) :: text
    type(scan_t), intent(out) :: found
    type(error_t), allocatable, intent(inout) :: error
    type(cursor_t) :: cursor

    call start(cursor, found, file, text)
    do
      call skip_blanks(cursor, " ")
      if (at_end(cursor) .or. allocated(error)) exit
      call scan_group(cursor, found, error)
    end do
    if (found%n_groups == 0) call fail(cursor, "empty file: expected namelist groups, &scene and &time at least", error)
  end subroutine scan_groups

  !> Puts assignments in place of those to the same keys, into groups that are made where they are missing.
  subroutine scan_change(self, changes)
    class(scan_t), intent(inout) :: self
    type(assignment_t), intent(in) :: changes(:)
    type(scan_t) :: changed
    integer :: i, k

    allocate (changed%groups(self%n_groups + size(changes)), changed%assignments(self%n_assignments + size(changes)))
    do i = 1, self%n_groups
      changed%groups(i) = self%groups(i)
    end do
    changed%n_groups = self%n_groups
    do i = 1, self%n_assignments
      if (is_changed(self%assignments(i), changes)) cycle
      changed%n_assignments = changed%n_assignments + 1
      changed%assignments(changed%n_assignments) = self%assignments(i)
    end do
    do k = 1, size(changes)
      do i = 1, changed%n_groups
        if (changed%groups(i)%name == changes(k)%group) exit
      end do
      changed%groups(i)%name = changes(k)%group
      changed%n_groups = max(i, changed%n_groups)
      changed%n_assignments = changed%n_assignments + 1
      changed%assignments(changed%n_assignments) = changes(k)
    end do
    self%n_groups = changed%n_groups
    self%n_assignments = changed%n_assignments
    call move_alloc(changed%groups, self%groups)
    call move_alloc(changed%assignments, self%assignments)
  end subroutine scan_change

  !> Does one of the changes set the same key?
  pure logical function is_changed(item, changes)
    type(assignment_t), intent(in) :: item, changes(:)
    integer :: k
    is_changed = .false.
    do k = 1, size(changes)
      if (item%group == changes(k)%group .and. item%key == changes(k)%key) is_changed = .true.
    end do
  end function is_changed

  subroutine start(cursor, found, file, text)
    type(cursor_t), intent(out) :: cursor
    type(scan_t), intent(inout) :: found
    character(len=*), intent(in) :: file, text

    cursor%file = file
    cursor%text = text
    cursor%buffer = text
    if (index(text, byte_order_mark) == 1) cursor%at = len(byte_order_mark) + 1
    allocate (found%groups(occurrences(text, "&")))
    allocate (found%assignments(occurrences(text, "=")))
  end subroutine start

  !> Scans `&name key = value ... /`.
  subroutine scan_group(cursor, found, error)
    type(cursor_t), intent(inout) :: cursor
    type(scan_t), intent(inout) :: found
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: group
    integer :: line

    line = line_of(cursor)
    ! not counted again for the next group
    cursor%lines = line - 1
    cursor%counted = cursor%at
    if (next(cursor) /= "&") then
      call fail(cursor, "not a namelist: line "//to_text(line)//": '"//excerpt(rest_of_line(cursor)) &
                //"' stands outside a group (a group is &name key = value ... /, and a text needs quotes)", error)
      return
    end if
    cursor%at = cursor%at + 1
    call take_name(cursor, group)
    call add_group(cursor, found, group, line, error)
    do
      if (allocated(error)) return
      call skip_blanks(cursor, ",")
      if (at_group_end(cursor)) exit
      call scan_assignment(cursor, found, group, error)
    end do
    call close_group(cursor, group, line, error)
  end subroutine scan_group

  subroutine add_group(cursor, found, name, line, error)
    type(cursor_t), intent(in) :: cursor
    type(scan_t), intent(inout) :: found
    character(len=*), intent(in) :: name
    integer, intent(in) :: line
    type(error_t), allocatable, intent(inout) :: error
    integer :: i

    if (name == "") call fail(cursor, "line "//to_text(line)//": expected the name of a group after &", error)
    associate (group => found%groups(found%n_groups + 1))
      group%name = name
      group%line = line
      do i = found%n_groups, 1, -1
        if (found%groups(i)%name /= name) cycle
        group%instance = found%groups(i)%instance + 1
        exit
      end do
    end associate
    found%n_groups = found%n_groups + 1
  end subroutine add_group

  !> Passes the `/` or `&end` of a group; fails at another group and at the end of the text.
  subroutine close_group(cursor, group, line, error)
    type(cursor_t), intent(inout) :: cursor
    character(len=*), intent(in) :: group
    !> where the group starts
    integer, intent(in) :: line
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: name, place

    if (next(cursor) == "/") then
      cursor%at = cursor%at + 1
      return
    end if
    place = "the end of the file"
    if (.not. at_end(cursor)) then
      cursor%at = cursor%at + 1
      call take_name(cursor, name)
      if (name == "end") return
      place = "&"//excerpt(name)//" (line "//to_text(line_of(cursor))//")"
    end if
    call fail(cursor, "group &"//excerpt(group)//" (line "//to_text(line)//") is not closed: expected / before " &
              //place, error)
  end subroutine close_group

  !> Scans one `key(index) = value`.
  subroutine scan_assignment(cursor, found, group, error)
    type(cursor_t), intent(inout) :: cursor
    type(scan_t), intent(inout) :: found
    character(len=*), intent(in) :: group
    type(error_t), allocatable, intent(inout) :: error
    type(assignment_t) :: item

    if (.not. starts_assignment(cursor)) then
      call fail(cursor, "&"//excerpt(group)//" (line "//to_text(line_of(cursor))//"): expected key = value, found '" &
                //excerpt(rest_of_line(cursor))//"'", error)
      return
    end if
    item%group = group
    item%instance = found%groups(found%n_groups)%instance
    call take_name(cursor, item%key)
    call take_index(cursor, item%index)
    call skip_blanks(cursor, " ")
    cursor%at = cursor%at + 1
    call take_value(cursor, item, error)
    found%n_assignments = found%n_assignments + 1
    found%assignments(found%n_assignments) = item
  end subroutine scan_assignment

  !> Does `name =` or `name(index) =` stand at the cursor? The cursor does not move.
  logical function starts_assignment(cursor)
    type(cursor_t), intent(inout) :: cursor
    character(len=:), allocatable :: name, place
    integer :: at

    starts_assignment = .false.
    if (verify(next(cursor), letters) /= 0) return
    at = cursor%at
    call take_name(cursor, name)
    call take_index(cursor, place)
    call skip_blanks(cursor, " ")
    starts_assignment = next(cursor) == "="
    cursor%at = at
  end function starts_assignment

  !> Moves past letters, digits and underscores; the name comes in lower case.
  subroutine take_name(cursor, name)
    type(cursor_t), intent(inout) :: cursor
    character(len=:), allocatable, intent(out) :: name
    integer :: length

    length = verify(cursor%text(cursor%at:), name_characters) - 1
    if (length < 0) length = len(cursor%text) - cursor%at + 1
    name = lower(cursor%text(cursor%at:cursor%at + length - 1))
    cursor%at = cursor%at + length
  end subroutine take_name

  !> Moves past `(...)` and what blanks are before it; does not move, and gives '', when there is none on this line.
  subroutine take_index(cursor, place)
    type(cursor_t), intent(inout) :: cursor
    character(len=:), allocatable, intent(out) :: place
    integer :: first, last

    place = ""
    first = cursor%at - 1 + verify(cursor%text(cursor%at:), " "//tab)
    if (first < cursor%at) return
    if (cursor%text(first:first) /= "(") return
    last = first - 1 + scan(cursor%text(first:), ")"//newline)
    if (last < first) return
    if (cursor%text(last:last) /= ")") return
    place = cursor%text(first:last)
    cursor%at = last + 1
  end subroutine take_index

  !> Moves to the next assignment or to the end of the group and gives what is before, on one line, without comments.
  !> Fails on a quote that is not closed on its line.
  subroutine take_value(cursor, item, error)
    type(cursor_t), intent(inout) :: cursor
    !> its value is set; the rest serves messages
    type(assignment_t), intent(inout) :: item
    type(error_t), allocatable, intent(inout) :: error
    integer :: n, length

    n = 0
    do while (.not. at_group_end(cursor))
      if (next(cursor) == "'" .or. next(cursor) == '"') then
        length = quoted_length(cursor)
      else if (is_separator(next(cursor))) then
        call take_separators(cursor, n)
        cycle
      else if (starts_assignment(cursor)) then
        exit
      else
        length = bare_length(cursor)
      end if
      if (length == 0) call fail(cursor, "&"//excerpt(item%group)//" "//excerpt(item%key//item%index)//" = " &
                                 //excerpt(rest_of_line(cursor))//": expected a quote that closes on its line (line " &
                                 //to_text(line_of(cursor))//")", error)
      if (allocated(error)) exit
      cursor%buffer(n + 1:n + length) = cursor%text(cursor%at:cursor%at + length - 1)
      n = n + length
      cursor%at = cursor%at + length
    end do
    item%value = without_end_commas(cursor%buffer(:n))
  end subroutine take_value

  !> Moves past blanks, ends of lines, commas and comments; the buffer gets the commas, or one blank.
  subroutine take_separators(cursor, n)
    type(cursor_t), intent(inout) :: cursor
    !> used length of the buffer
    integer, intent(inout) :: n
    integer :: first, commas

    first = cursor%at
    commas = 0
    do
      call skip_blanks(cursor, " ")
      if (next(cursor) /= ",") exit
      commas = commas + 1
      n = n + 1
      cursor%buffer(n:n) = ","
      cursor%at = cursor%at + 1
    end do
    if (n == 0 .or. cursor%at - first == commas) return
    n = n + 1
    cursor%buffer(n:n) = " "
  end subroutine take_separators

  !> Length of the quoted text at the cursor with its quotes, doubled quotes counted; 0 if it does not end on its line.
  integer function quoted_length(cursor) result(length)
    type(cursor_t), intent(in) :: cursor
    character(len=1) :: quote
    integer :: at, step

    length = 0
    quote = next(cursor)
    at = cursor%at
    do
      step = scan(cursor%text(at + 1:), quote//newline)
      if (step == 0) return
      at = at + step
      if (cursor%text(at:at) /= quote) return
      if (character_at(cursor, at + 1) /= quote) exit
      at = at + 1
    end do
    length = at - cursor%at + 1
  end function quoted_length

  !> Length of what stands at the cursor up to a separator, a quote, a comment or the end of the group.
  integer function bare_length(cursor) result(length)
    type(cursor_t), intent(in) :: cursor
    length = scan(cursor%text(cursor%at:), blanks//",!'""/&") - 1
    if (length < 0) length = len(cursor%text) - cursor%at + 1
  end function bare_length

  !> Moves past blanks, ends of lines, comments and one more character that is to be skipped.
  subroutine skip_blanks(cursor, also)
    type(cursor_t), intent(inout) :: cursor
    character(len=1), intent(in) :: also
    integer :: length

    do while (.not. at_end(cursor))
      if (next(cursor) == "!") then
        length = index(cursor%text(cursor%at:), newline)
        if (length == 0) length = len(cursor%text) - cursor%at + 1
        cursor%at = cursor%at + length
      else if (scan(next(cursor), blanks//also) == 1) then
        cursor%at = cursor%at + 1
      else
        exit
      end if
    end do
  end subroutine skip_blanks

  !> Is this a `/`, the start of another group or of `&end`, or the end of the text?
  logical function at_group_end(cursor)
    type(cursor_t), intent(in) :: cursor
    at_group_end = at_end(cursor)
    if (.not. at_group_end) at_group_end = next(cursor) == "/" .or. next(cursor) == "&"
  end function at_group_end

  pure logical function at_end(cursor)
    type(cursor_t), intent(in) :: cursor
    at_end = cursor%at > len(cursor%text)
  end function at_end

  pure logical function is_separator(character)
    character(len=1), intent(in) :: character
    is_separator = scan(character, blanks//",!") == 1
  end function is_separator

  !> The character at the cursor, a blank after the end of the text.
  pure character(len=1) function next(cursor)
    type(cursor_t), intent(in) :: cursor
    next = character_at(cursor, cursor%at)
  end function next

  pure character(len=1) function character_at(cursor, at)
    type(cursor_t), intent(in) :: cursor
    integer, intent(in) :: at
    character_at = " "
    if (at <= len(cursor%text)) character_at = cursor%text(at:at)
  end function character_at

  pure function rest_of_line(cursor) result(rest)
    type(cursor_t), intent(in) :: cursor
    character(len=:), allocatable :: rest
    integer :: length
    length = scan(cursor%text(cursor%at:), newline//carriage) - 1
    if (length < 0) length = len(cursor%text) - cursor%at + 1
    rest = trim(cursor%text(cursor%at:cursor%at + length - 1))
  end function rest_of_line

  pure integer function line_of(cursor)
    type(cursor_t), intent(in) :: cursor
    line_of = 1 + cursor%lines + occurrences(cursor%text(cursor%counted:cursor%at - 1), newline)
  end function line_of

  pure integer function occurrences(text, character)
    character(len=*), intent(in) :: text
    character(len=1), intent(in) :: character
    integer :: i
    occurrences = 0
    do i = 1, len(text)
      if (text(i:i) == character) occurrences = occurrences + 1
    end do
  end function occurrences

  pure function without_end_commas(text) result(kept)
    character(len=*), intent(in) :: text
    character(len=:), allocatable :: kept
    kept = text(:verify(text, " ,", back=.true.))
  end function without_end_commas

  !> A piece of the file that fits in a message: at most 80 characters, none of them a control character.
  pure function excerpt(text) result(piece)
    character(len=*), intent(in) :: text
    character(len=:), allocatable :: piece
    integer :: i

    piece = text
    if (len(text) > excerpt_length) piece = text(:excerpt_length)//"..."
    do i = 1, len(piece)
      if (iachar(piece(i:i)) < 32 .or. iachar(piece(i:i)) == 127) piece(i:i) = " "
    end do
  end function excerpt

  subroutine fail(cursor, message, error)
    type(cursor_t), intent(in) :: cursor
    character(len=*), intent(in) :: message
    type(error_t), allocatable, intent(inout) :: error
    call raise(error, status_input, cursor%file//": "//message)
  end subroutine fail

end module gravier_config_scan
