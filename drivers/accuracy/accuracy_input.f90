!> What the namelist of a study of gravier_accuracy says.
module gravier_accuracy_input
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_command_line, only: positive_integer, positive_real
  use gravier_config, only: config_t, parse_config
  use gravier_config_scan, only: scan_t, assignment_t, scan_groups, excerpt
  use gravier_config_table, only: keys, fill_keys
  use gravier_config_keys, only: has_word, choices_text
  use gravier_read_case, only: read_input
  use gravier_accuracy_study, only: study_t, variant_t, text_t, append, duration_of, same_time
  implicit none
  private
  public :: read_study

  character(len=*), parameter :: study_keys = "title case directory kind vary values reference samples repeats quantities knee"
  !> those that a solve has no use for
  character(len=*), parameter :: run_keys = "vary values reference samples quantities knee"
  !> groups that have no place in a variant: where results go, and those that stand several times or are made before
  character(len=*), parameter :: other_groups = "output boundary sample material law insertion region"
  !> what keys of variants and `vary` are
  character(len=*), parameter :: key_text = &
    & "a key of a case, but of &output, &boundary, &sample, &material, &law, &insertion or &region"

contains

  !> Read a study and its case; every case that it makes is parsed, so that what can be refused is refused here. Errors are
  !> the same on all ranks. Collective.
  subroutine read_study(comm, path, study, error)
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    type(study_t), intent(out) :: study
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: text

    call read_input(comm, path, text, error)
    if (allocated(error)) return
    study%file = path
    call parse_study(text, study, error)
    if (allocated(error)) return
    call read_input(comm, study%case, study%case_text, error)
    if (.not. allocated(error)) call try_cases(study, error)
    call comm%agree(error)
  end subroutine read_study

  subroutine parse_study(text, study, error)
    character(len=*), intent(in) :: text
    type(study_t), intent(inout) :: study
    type(error_t), allocatable, intent(inout) :: error
    type(scan_t) :: found
    integer :: i

    call fill_keys()
    study%title = ""
    study%case = ""
    study%directory = "accuracy"
    study%kind = ""
    study%reference = ""
    study%vary = ""
    study%vary_group = ""
    allocate (study%values(0), study%quantities(0))
    call scan_groups(study%file, text, found, error)
    if (.not. allocated(error)) call check_groups(study, found, error)
    if (allocated(error)) return
    do i = 1, found%n_assignments
      call check_twice(study, found, i, error)
      if (found%assignments(i)%group == "study") call take_key(study, found%assignments(i), error)
      if (allocated(error)) return
    end do
    call check_study(study, found, error)
    if (.not. allocated(error)) call take_variants(study, found, error)
    if (.not. allocated(error)) call check_variants(study, error)
  end subroutine parse_study

  !> One &study, at most one &reference.
  subroutine check_groups(study, found, error)
    type(study_t), intent(in) :: study
    type(scan_t), intent(in) :: found
    type(error_t), allocatable, intent(inout) :: error
    integer :: g

    do g = 1, found%n_groups
      associate (group => found%groups(g))
        if (.not. has_word("study reference variant", group%name)) then
          call raise(error, status_input, study%file//": unknown group &"//excerpt(group%name)// &
            & ": expected one of &study &reference &variant")
        else if (group%instance > 1 .and. group%name /= "variant") then
          call raise(error, status_input, study%file//": group &"//group%name//" is given twice (again in line "// &
            & to_text(group%line)//"): expected once")
        end if
      end associate
    end do
    if (.not. has_group(found, "study")) call raise(error, status_input, study%file// &
      & ": group &study is missing: expected &study ... /")
  end subroutine check_groups

  pure logical function has_group(found, name)
    type(scan_t), intent(in) :: found
    character(len=*), intent(in) :: name
    integer :: g

    has_group = .false.
    do g = 1, found%n_groups
      if (found%groups(g)%name == name) has_group = .true.
    end do
  end function has_group

  !> Refuse assignment `i` if an earlier one of its group sets the same.
  subroutine check_twice(study, found, i, error)
    type(study_t), intent(in) :: study
    type(scan_t), intent(in) :: found
    integer, intent(in) :: i
    type(error_t), allocatable, intent(inout) :: error
    integer :: k

    associate (item => found%assignments(i))
      do k = 1, i - 1
        associate (other => found%assignments(k))
          if (other%group == item%group .and. other%instance == item%instance .and. other%key == item%key .and. &
            & other%index == item%index) call refuse(study, item, "once, but it is given twice", error)
        end associate
      end do
    end associate
  end subroutine check_twice

  !> Fail with `FILE: &group key = VALUE: expected ...`.
  subroutine refuse(study, item, expected, error)
    type(study_t), intent(in) :: study
    type(assignment_t), intent(in) :: item
    character(len=*), intent(in) :: expected
    type(error_t), allocatable, intent(inout) :: error

    call raise(error, status_input, study%file//": &"//item%group//" "//item%key//item%index//" = "//excerpt(item%value)// &
      & ": expected "//expected)
  end subroutine refuse

  subroutine take_key(study, item, error)
    type(study_t), intent(inout) :: study
    type(assignment_t), intent(in) :: item
    type(error_t), allocatable, intent(inout) :: error

    if (item%index /= "") then
      call refuse(study, item, item%key//" without an index", error)
      return
    end if
    select case (item%key)
    case ("title")
      call take_text(study, item, study%title, error)
    case ("case")
      call take_text(study, item, study%case, error)
      if (study%case == "") call refuse(study, item, "the path of a case", error)
    case ("directory")
      call take_text(study, item, study%directory, error)
      if (study%directory == "") call refuse(study, item, "a directory", error)
    case ("kind")
      call take_word(study, item, "solve run", study%kind, error)
    case ("reference")
      call take_word(study, item, "tight exact none", study%reference, error)
    case ("vary")
      call take_text(study, item, study%vary, error)
      study%vary_group = group_of(study%vary)
      if (study%vary_group == "" .or. study%vary == "steps" .or. study%vary == "title") call refuse(study, item, &
        & key_text//", and not 'steps', which follow from 'step'", error)
    case ("values")
      call split(item%value, study%values)
      if (size(study%values) == 0) call refuse(study, item, "values, with commas between", error)
    case ("quantities")
      call take_texts(study, item, study%quantities, error)
    case ("samples", "repeats")
      call take_count(study, item, error)
    case ("knee")
      study%knee = positive_real(item%value)
      if (.not. (study%knee > 0.0_dp .and. study%knee < 1.0_dp)) call refuse(study, item, "a finite real number in (0, 1)", error)
    case default
      call raise(error, status_input, study%file//": unknown key '"//excerpt(item%key)//"' in &study: expected one of "//study_keys)
    end select
  end subroutine take_key

  subroutine take_count(study, item, error)
    type(study_t), intent(inout) :: study
    type(assignment_t), intent(in) :: item
    type(error_t), allocatable, intent(inout) :: error
    integer :: n

    n = positive_integer(item%value)
    if (n == 0) call refuse(study, item, "an integer >= 1", error)
    if (item%key == "samples") study%samples = n
    if (item%key == "repeats") study%repeats = n
  end subroutine take_count

  subroutine take_text(study, item, text, error)
    type(study_t), intent(in) :: study
    type(assignment_t), intent(in) :: item
    character(len=:), allocatable, intent(inout) :: text
    type(error_t), allocatable, intent(inout) :: error
    logical :: failed

    call unquote(item%value, text, failed)
    if (failed) call refuse(study, item, "a text in quotes", error)
  end subroutine take_text

  subroutine take_word(study, item, words, word, error)
    type(study_t), intent(in) :: study
    type(assignment_t), intent(in) :: item
    !> separated by blanks
    character(len=*), intent(in) :: words
    character(len=:), allocatable, intent(inout) :: word
    type(error_t), allocatable, intent(inout) :: error
    logical :: failed

    call unquote(item%value, word, failed)
    if (failed .or. .not. has_word(words, word)) call refuse(study, item, choices_text(words), error)
  end subroutine take_word

  subroutine take_texts(study, item, texts, error)
    type(study_t), intent(in) :: study
    type(assignment_t), intent(in) :: item
    type(text_t), allocatable, intent(inout) :: texts(:)
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: text
    logical :: failed
    integer :: k

    call split(item%value, texts)
    do k = 1, size(texts)
      call unquote(texts(k)%text, text, failed)
      if (failed) call refuse(study, item, "texts in quotes, with commas between", error)
      texts(k)%text = text
    end do
  end subroutine take_texts

  !> A text without its quotes, those inside it single.
  pure subroutine unquote(value, text, failed)
    character(len=*), intent(in) :: value
    character(len=:), allocatable, intent(inout) :: text
    logical, intent(out) :: failed
    integer :: i, n

    n = len(value)
    failed = n < 2
    if (.not. failed) failed = scan(value(1:1), "'""") /= 1 .or. value(n:n) /= value(1:1)
    if (failed) return
    text = ""
    i = 2
    do while (i < n)
      text = text//value(i:i)
      i = i + merge(2, 1, value(i:i) == value(1:1))
    end do
    text = trim(text)
  end subroutine unquote

  !> The items of a list, separated by commas that are outside of quotes.
  pure subroutine split(list, items)
    character(len=*), intent(in) :: list
    type(text_t), allocatable, intent(out) :: items(:)
    type(text_t) :: found(len(list) + 1)
    character(len=1) :: quote
    integer :: i, first, n

    quote = ""
    first = 1
    n = 0
    do i = 1, len(list) + 1
      if (i <= len(list)) then
        if (quote == "" .and. scan(list(i:i), "'""") == 1) then
          quote = list(i:i)
        else if (list(i:i) == quote) then
          quote = ""
        end if
        if (list(i:i) /= "," .or. quote /= "") cycle
      end if
      n = n + 1
      found(n)%text = trim(adjustl(list(first:i - 1)))
      first = i + 1
    end do
    if (n == 1 .and. list == "") n = 0
    items = found(1:n)
  end subroutine split

  !> The group of a case that has a key, of the groups that a variant may change; blank where none has it.
  pure function group_of(key) result(group)
    character(len=*), intent(in) :: key
    character(len=:), allocatable :: group
    integer :: k

    group = ""
    do k = 1, size(keys)
      if (keys(k)%name /= key .or. has_word(other_groups, trim(keys(k)%group))) cycle
      group = trim(keys(k)%group)
      return
    end do
  end function group_of

  !> What must be there and what must not, and the reference where none is given.
  subroutine check_study(study, found, error)
    type(study_t), intent(inout) :: study
    type(scan_t), intent(in) :: found
    type(error_t), allocatable, intent(inout) :: error
    integer :: i

    if (study%case == "") call study%complain("case is missing", "the path of a case", error)
    if (study%kind == "") call study%complain("kind is missing", choices_text("solve run"), error)
    if (study%kind == "solve") then
      do i = 1, found%n_assignments
        associate (item => found%assignments(i))
          if (item%group == "study" .and. has_word(run_keys, item%key)) call refuse(study, item, &
            & "without it, where kind = 'solve'", error)
        end associate
      end do
      if (study%reference == "") study%reference = "none"
    else
      if (study%vary == "") call study%complain("vary is missing", "a key of the case, required by kind = 'run'", error)
      if (size(study%values) == 0) call study%complain("values is missing", "values of '"//study%vary// &
        & "', required by kind = 'run'", error)
      if (study%reference == "") study%reference = trim(merge("none ", "tight", study%vary_group == "scene"))
      if (study%reference == "tight" .and. study%vary_group == "scene") call study%complain("reference = 'tight'", &
        & "'exact' or 'none', since '"//study%vary//"' changes the scene", error)
      if (study%reference == "exact" .and. size(study%quantities) > 0) call study%complain("quantities", &
        & "without it, where reference = 'exact': exact positions and velocities are known, and nothing else", error)
    end if
    if (has_group(found, "reference") .and. study%reference /= "tight") call raise(error, status_input, study%file// &
      & ": group &reference belongs to kind = 'run' and reference = 'tight', expected without it")
  end subroutine check_study

  !> The variants and the reference, with the groups of the case for their keys. Without variants the case is the only one.
  subroutine take_variants(study, found, error)
    type(study_t), intent(inout) :: study
    type(scan_t), intent(in) :: found
    type(error_t), allocatable, intent(inout) :: error
    integer :: n, g, i

    n = 0
    do g = 1, found%n_groups
      if (found%groups(g)%name == "variant") n = n + 1
    end do
    allocate (study%variants(max(n, 1)))
    do g = 1, size(study%variants)
      study%variants(g)%name = ""
      allocate (study%variants(g)%changes(0))
    end do
    if (n == 0) study%variants(1)%name = "case"
    study%tight%name = "reference"
    allocate (study%tight%changes(0))
    do i = 1, found%n_assignments
      associate (item => found%assignments(i))
        if (item%group == "variant") call take_change(study, study%variants(item%instance), item, error)
        if (item%group == "reference") call take_change(study, study%tight, item, error)
      end associate
    end do
  end subroutine take_variants

  subroutine take_change(study, variant, item, error)
    type(study_t), intent(in) :: study
    type(variant_t), intent(inout) :: variant
    type(assignment_t), intent(in) :: item
    type(error_t), allocatable, intent(inout) :: error
    type(assignment_t) :: change

    if (allocated(error)) return
    if (item%group == "variant" .and. item%key == "name") then
      call take_text(study, item, variant%name, error)
      if (variant%name == "") call refuse(study, item, "a name", error)
      return
    end if
    change = item
    change%group = group_of(item%key)
    change%instance = 1
    if (change%group == "") then
      call raise(error, status_input, study%file//": unknown key '"//excerpt(item%key)//"' in &"//item%group// &
        & ": expected "//key_text)
    else if (item%index /= "") then
      call refuse(study, item, item%key//" without an index: with all its entries, which replace those of the case", error)
    else if (item%group == "variant" .and. (item%key == study%vary .or. (item%key == "steps" .and. study%vary == "step"))) then
      call refuse(study, item, "without it, since &study vary = '"//study%vary//"'", error)
    else if (change%group == "scene" .and. study%reference == "tight") then
      call refuse(study, item, "no key of &scene, where reference = 'tight'", error)
    end if
    call append(variant%changes, change)
  end subroutine take_change

  !> Names that are there, and different.
  subroutine check_variants(study, error)
    type(study_t), intent(in) :: study
    type(error_t), allocatable, intent(inout) :: error
    integer :: k, j

    do k = 1, size(study%variants)
      if (study%variants(k)%name == "") call raise(error, status_input, study%file//": &variant (number "//to_text(k)// &
        & ") name is missing: expected a name of its own")
      do j = 1, k - 1
        if (study%variants(j)%name == study%variants(k)%name) call raise(error, status_input, study%file//": &variant name = '"// &
          & excerpt(study%variants(k)%name)//"': expected a name of its own")
      end do
    end do
  end subroutine check_variants

  !> Parse every case of the study.
  subroutine try_cases(study, error)
    type(study_t), intent(in) :: study
    type(error_t), allocatable, intent(inout) :: error
    type(config_t) :: config, tight
    integer :: v, k

    call parse_config(study%case, study%case_text, config, error)
    if (.not. allocated(error) .and. study%reference == "tight") call study%make_reference(tight, error)
    do v = 1, size(study%variants)
      do k = 1, max(1, size(study%values))
        if (allocated(error)) return
        call study%make_config(v, k, config, error)
        if (allocated(error) .or. study%reference /= "tight") cycle
        if (abs(duration_of(config) - duration_of(tight)) > same_time*duration_of(config)) call raise(error, status_input, &
          & study%file//": &reference step, steps: expected the duration of '"//study%variants(v)%name//"', "// &
          & to_text(duration_of(config), 6)//" s; it is "//to_text(duration_of(tight), 6)//" s")
      end do
    end do
    if (allocated(error)) return
    if (study%reference == "tight" .and. size(study%tight%changes) == 0) call raise(error, status_input, study%file// &
      & ": group &reference is missing: expected keys of a run that is tighter than the others, or reference = 'none'")
  end subroutine try_cases

end module gravier_accuracy_input
