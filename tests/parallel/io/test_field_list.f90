!> Tables of named fields: what they hold, and that ordering them over all ranks keeps each item whole.
program test_field_list
  use gravier_kinds, only: dp, i8
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_field_list, only: field_list_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  integer, parameter :: n_items = 37
  character(len=5), parameter :: labels(3) = [character(len=5) :: "one", "two", "three"]
  type(communicator_t) :: world

  call start_parallel()
  call world%init()
  call test_fields()
  call test_order(1)
  call test_order(2)
  call test_no_items()
  call finish_checks()
  call world%free()
  call stop_parallel()

contains

  !> Names, shapes and words; fields stay as they are while the list grows.
  subroutine test_fields()
    type(field_list_t) :: table
    real(dp), allocatable :: value(:, :)
    integer(i8), allocatable :: whole(:, :)
    integer :: k

    call table%init("things", "id", 3)
    call check_equal(table%name, "things", "name of the table")
    call check_equal(table%n_items(), 3, "items")
    call check_equal(size(table%key_name), 1, "one key")
    call check(.not. table%everywhere, "items are those of a rank by default")
    do k = 1, 20
      allocate (value(2, 3), source=real(k, dp))
      call table%add_reals("field "//achar(64 + k), "m", value)
      call check(.not. allocated(value), "numbers are moved, not copied")
    end do
    allocate (whole(1, 3), source=7_i8)
    call table%add_whole("count", "", whole, .true.)
    call check_equal(table%n_fields, 21, "fields")
    call check_equal(table%words(), 1 + 2*20 + 1, "words of an item")
    call check_equal(table%place("field C"), 3, "place of a field")
    call check_equal(table%place("field"), 0, "no such field")
    call check_close(table%field(3)%value(2, 3), 3.0_dp, 0.0_dp, "its numbers")
    call check_equal(table%field(3)%components(), 2, "its components")
    call check(.not. table%field(3)%scalar, "rows of two")
    call check(table%field(21)%scalar, "one number an item")
    call check_equal(table%field(21)%unit, "", "no unit")
    call table%add_texts("label", labels)
    call check_equal(table%field(22)%text(3), "three", "a text")
    call check_equal(table%field(22)%components(), 0, "texts have no numbers")
    call check_equal(table%words(), 1 + 2*20 + 1 + 1, "five characters take a word")
    call table%init("others", "first second", 0)
    call check_equal(table%n_fields, 0, "a table begun anew has no field")
    call check_equal(trim(table%key_name(1))//"/"//trim(table%key_name(2)), "first/second", "names of two keys")
  end subroutine test_fields

  !> Items fall to ranks by their number; ordered they are in the order of their keys, and each has its own numbers.
  subroutine test_order(n_keys)
    integer, intent(in) :: n_keys
    type(field_list_t) :: table
    real(dp), allocatable :: value(:, :)
    integer(i8), allocatable :: whole(:, :)
    integer(i8) :: before
    integer :: g, n
    logical :: same

    n = 0
    do g = 1, n_items
      if (mod(7*g, world%size) == world%rank) n = n + 1
    end do
    if (n_keys == 1) call table%init("items", "id", n)
    if (n_keys == 2) call table%init("items", "one two", n)
    allocate (value(2, n), whole(1, n))
    n = 0
    do g = n_items, 1, -1
      if (mod(7*g, world%size) /= world%rank) cycle
      n = n + 1
      ! pairs (1, 3), (1, 2), (1, 1), (2, 6), ... in the order of their numbers from behind
      table%key(1, n) = merge(g, (g + 2)/3, n_keys == 1)
      if (n_keys == 2) table%key(2, n) = g
      value(1, n) = 0.5_dp*g
      value(2, n) = -1.5_dp*g
      whole(1, n) = 100_i8*g
    end do
    call table%add_reals("value", "s", value)
    call table%add_whole("whole", "", whole, .true.)
    call table%order(world)
    call check_equal(world%total(int(table%n_items(), i8)), int(n_items, i8), "no item is lost")
    call check_equal(table%name, "items", "name")
    call check_equal(size(table%key, 1), n_keys, "keys")
    call check_equal(trim(table%key_name(n_keys)), merge("id ", "two", n_keys == 1), "name of the last key")
    call check_equal(table%field(1)%name//" "//table%field(1)%unit, "value s", "name and unit of a field")
    call check(table%field(2)%scalar .and. .not. table%field(1)%scalar, "shapes")
    before = world%offset(int(table%n_items(), i8))
    same = .true.
    do g = 1, table%n_items()
      same = same .and. table%key(n_keys, g) == before + g
      same = same .and. abs(table%field(1)%value(1, g) - 0.5_dp*table%key(n_keys, g)) <= 0.0_dp
      same = same .and. abs(table%field(1)%value(2, g) + 1.5_dp*table%key(n_keys, g)) <= 0.0_dp
      same = same .and. table%field(2)%whole(1, g) == 100*table%key(n_keys, g)
    end do
    call check(same, "items in the order of their keys, each with its numbers")
  end subroutine test_order

  !> No rank has an item.
  subroutine test_no_items()
    type(field_list_t) :: table
    real(dp), allocatable :: value(:, :)

    call table%init("nothing", "id", 0)
    allocate (value(3, 0))
    call table%add_reals("value", "m", value)
    call table%order(world)
    call check_equal(table%n_items(), 0, "nothing is ordered")
    call check_equal(table%field(1)%components(), 3, "and keeps its shape")
  end subroutine test_no_items

end program test_field_list
