!> Names of the keys of laws for tests, given as one text with blanks between.
module gravier_test_law_names
  use gravier_kinds, only: dp
  use gravier_law_set, only: law_set_t
  implicit none
  private
  public :: name_length, split_names, add_law

  integer, parameter :: name_length = 24

contains

  !> The names in a text.
  pure subroutine split_names(text, names)
    !> with one blank between names
    character(len=*), intent(in) :: text
    character(len=name_length), allocatable, intent(out) :: names(:)
    integer :: k, n, start

    n = 1
    do k = 1, len(text)
      if (text(k:k) == " ") n = n + 1
    end do
    allocate (names(n))
    start = 1
    do k = 1, n
      n = index(text(start:)//" ", " ") - 1
      names(k) = text(start:start + n - 1)
      start = start + n + 1
    end do
  end subroutine split_names

  !> Add the law of materials a and b with the values of named keys; those of resistance to rolling and pivoting are 0 unless named.
  subroutine add_law(laws, a, b, kind, text, values)
    type(law_set_t), intent(inout) :: laws
    integer, intent(in) :: a, b
    character(len=*), intent(in) :: kind, text
    !> (names)
    real(dp), intent(in) :: values(:)
    character(len=name_length), allocatable :: names(:)
    real(dp) :: all_values(size(values) + 2)

    ! of two keys of one name the last one counts
    call split_names("rolling_friction pivoting_friction "//text, names)
    all_values(1:2) = 0.0_dp
    all_values(3:) = values
    call laws%add(a, b, kind, names, all_values)
  end subroutine add_law

end module gravier_test_law_names
