!> Keys of the input that modules declare for themselves: a law, a shape. A registry collects them, each once.
module gravier_declared_keys
  implicit none
  private
  public :: declared_key_t, collected_key_t, collected_keys_t, kind_length

  !> room for the words of all kinds of a registry, with blanks between
  integer, parameter :: kind_length = 160

  !> A key whose values are real numbers.
  type :: declared_key_t
    character(len=24) :: name
    !> as it would be typed after the equal sign; blank: each group must give it
    character(len=16) :: default
    !> the rule of each value: "", "> 0", ">= 0", "in [a, b]", "in (a, b]", or "not all 0" for several
    character(len=16) :: allowed
    character(len=24) :: unit
    character(len=200) :: meaning
    !> number of values
    integer :: count = 1
  end type declared_key_t

  !> A key with the kinds that have it.
  type :: collected_key_t
    type(declared_key_t) :: key
    !> with blanks between
    character(len=kind_length) :: kinds = ""
  end type collected_key_t

  !> The keys of all kinds of a registry in the order in which they were declared first, and the words of the kinds.
  type :: collected_keys_t
    type(collected_key_t), allocatable :: keys(:)
    !> with blanks between
    character(len=kind_length) :: kinds = ""
  contains
    procedure :: add => collected_keys_add
    procedure :: find => collected_keys_find
  end type collected_keys_t

contains

  !> Add a kind with its keys. A key that several kinds have is the same in all of them: default, rule, unit and meaning.
  pure subroutine collected_keys_add(self, kind, keys)
    class(collected_keys_t), intent(inout) :: self
    character(len=*), intent(in) :: kind
    type(declared_key_t), intent(in) :: keys(:)
    type(collected_key_t), allocatable :: longer(:)
    integer :: k, at, n

    if (.not. allocated(self%keys)) allocate (self%keys(0))
    self%kinds = adjustl(trim(self%kinds)//" "//kind)
    do k = 1, size(keys)
      at = self%find(keys(k)%name)
      if (at == 0) then
        n = size(self%keys)
        allocate (longer(n + 1))
        longer(1:n) = self%keys
        longer(n + 1)%key = keys(k)
        call move_alloc(longer, self%keys)
        at = n + 1
      end if
      self%keys(at)%kinds = adjustl(trim(self%keys(at)%kinds)//" "//kind)
    end do
  end subroutine collected_keys_add

  !> Place of a key among those collected, 0 where none has the name.
  pure integer function collected_keys_find(self, name) result(at)
    class(collected_keys_t), intent(in) :: self
    character(len=*), intent(in) :: name

    do at = size(self%keys), 1, -1
      if (self%keys(at)%key%name == name) return
    end do
  end function collected_keys_find

end module gravier_declared_keys
