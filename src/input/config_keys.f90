!> Looks up groups and keys of an input file in their table, and says what their values must be.
module gravier_config_keys
  use gravier_text, only: to_text
  use gravier_config_types, only: text_length
  use gravier_config_key, only: key_t, kind_integer, kind_real, kind_logical, kind_choice
  use gravier_config_table, only: groups, keys
  implicit none
  private
  public :: find_group, find_key, nearest_group, nearest_key, has_word, choices_text, expected_text

contains

  !> Position of a group in the table, 0 if there is none of that (lower case) name.
  pure integer function find_group(name) result(at)
    character(len=*), intent(in) :: name
    do at = size(groups), 1, -1
      if (groups(at)%name == name) return
    end do
  end function find_group

  !> Position of a key in the table, 0 if there is none of that group and name (lower case).
  pure integer function find_key(group, name) result(at)
    character(len=*), intent(in) :: group, name
    do at = size(keys), 1, -1
      if (keys(at)%group == group .and. keys(at)%name == name) return
    end do
  end function find_key

  !> The group whose name is nearest, 0 if none is near.
  pure integer function nearest_group(name) result(at)
    character(len=*), intent(in) :: name
    integer :: i, distance, least
    at = 0
    least = farthest(name) + 1
    if (least == 0) return
    do i = 1, size(groups)
      distance = edit_distance(name, trim(groups(i)%name))
      if (distance >= least) cycle
      least = distance
      at = i
    end do
  end function nearest_group

  !> The key of the group whose name is nearest, 0 if none is near.
  pure integer function nearest_key(group, name) result(at)
    character(len=*), intent(in) :: group, name
    integer :: i, distance, least
    at = 0
    least = farthest(name) + 1
    if (least == 0) return
    do i = 1, size(keys)
      if (keys(i)%group /= group) cycle
      distance = edit_distance(name, trim(keys(i)%name))
      if (distance >= least) cycle
      least = distance
      at = i
    end do
  end function nearest_key

  !> Edits within which a name still looks like a misspelling; negative for a name longer than any in the table.
  pure integer function farthest(name)
    character(len=*), intent(in) :: name
    farthest = max(1, len(name)/3)
    if (len(name) > 2*len(keys%name)) farthest = -1
  end function farthest

  !> Insertions, deletions, replacements and swaps of neighbours that lead from one name to the other.
  pure integer function edit_distance(from, to) result(distance)
    character(len=*), intent(in) :: from, to
    integer :: d(0:len(from), 0:len(to)), i, j, change

    do i = 0, len(from)
      d(i, 0) = i
    end do
    do j = 1, len(to)
      d(0, j) = j
      do i = 1, len(from)
        change = merge(0, 1, from(i:i) == to(j:j))
        d(i, j) = min(d(i - 1, j) + 1, d(i, j - 1) + 1, d(i - 1, j - 1) + change)
        if (swapped(from, to, i, j)) d(i, j) = min(d(i, j), d(max(i - 2, 0), max(j - 2, 0)) + 1)
      end do
    end do
    distance = d(len(from), len(to))
  end function edit_distance

  !> Are the two characters that end at i and at j the same two, swapped?
  pure logical function swapped(from, to, i, j)
    character(len=*), intent(in) :: from, to
    integer, intent(in) :: i, j
    swapped = .false.
    if (i < 2 .or. j < 2) return
    swapped = from(i:i) == to(j - 1:j - 1) .and. from(i - 1:i - 1) == to(j:j)
  end function swapped

  !> Is it one of some words?
  pure logical function has_word(words, word)
    !> separated by blanks
    character(len=*), intent(in) :: words
    character(len=*), intent(in) :: word
    has_word = word /= "" .and. index(trim(word), " ") == 0 .and. index(" "//words//" ", " "//trim(word)//" ") > 0
  end function has_word

  !> Words separated by blanks as a quoted list: 'a', 'b' or 'c'.
  pure function choices_text(words) result(text)
    character(len=*), intent(in) :: words
    character(len=:), allocatable :: text
    character(len=:), allocatable :: rest
    integer :: blank

    rest = trim(words)
    text = ""
    do
      blank = index(rest, " ")
      if (blank == 0) exit
      if (len(text) > 0) text = text//", "
      text = text//"'"//rest(:blank - 1)//"'"
      rest = trim(adjustl(rest(blank:)))
    end do
    if (len(text) > 0) text = text//" or "
    text = text//"'"//rest//"'"
  end function choices_text

  !> What a value of the key must be: "a finite real number > 0 (m)", "'a' or 'b'".
  pure function expected_text(key) result(text)
    type(key_t), intent(in) :: key
    character(len=:), allocatable :: text

    select case (key%kind)
    case (kind_integer)
      text = number_text("an integer", "integers", key)
    case (kind_real)
      text = number_text("a finite real number", "finite real numbers", key)
    case (kind_logical)
      text = ".true. or .false."
      if (key%count > 1) text = "at most "//to_text(key%count)//" of "//text
    case (kind_choice)
      text = choices_text(key%allowed)
    case default
      text = "a text in quotes"
      if (key%count > 1) text = "at most "//to_text(key%count)//" texts in quotes, none of them empty"
      if (key%allowed /= "") text = text//", "//trim(key%allowed)
      text = text//", at most "//to_text(text_length)//" characters"
    end select
  end function expected_text

  pure function number_text(one, several, key) result(text)
    !> the kind in words, for a single value and for several
    character(len=*), intent(in) :: one, several
    type(key_t), intent(in) :: key
    character(len=:), allocatable :: text

    text = one
    if (key%count > 1) text = "at most "//to_text(key%count)//" "//several
    if (key%allowed /= "") text = text//" "//trim(key%allowed)
    if (key%unit /= "") text = text//" ("//trim(key%unit)//")"
  end function number_text

end module gravier_config_keys
