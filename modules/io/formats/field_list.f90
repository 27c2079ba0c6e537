!> A table of items as a list of named fields: what the files of a run are given. Each field has a name, a unit, its numbers of each
!> item; the keys of the items say in which order they stand. Nothing here knows what the items are.
module gravier_field_list
  use gravier_kinds, only: dp, i8
  use gravier_communicator, only: communicator_t
  use gravier_ordered_rows, only: row_order_t
  implicit none
  private
  public :: field_t, field_list_t

  !> Numbers, or a text, of each item.
  type :: field_t
    character(len=:), allocatable :: name
    !> as an attribute says it; empty: none is said
    character(len=:), allocatable :: unit
    !> one number an item, not a row with one number
    logical :: scalar = .false.
    !> one of the three is allocated: reals or integers (components, items), or texts (items)
    real(dp), allocatable :: value(:, :)
    integer(i8), allocatable :: whole(:, :)
    character(len=:), allocatable :: text(:)
  contains
    procedure :: components => field_components
  end type field_t

  !> A table. Its items are those of this rank, or the same on all ranks.
  type :: field_list_t
    !> of the table
    character(len=:), allocatable :: name
    !> the same on all ranks: rank 0 writes for all
    logical :: everywhere = .false.
    !> names of the keys (keys); the keys themselves, the first one >= 0 (keys, items)
    character(len=24), allocatable :: key_name(:)
    integer(i8), allocatable :: key(:, :)
    !> the first n_fields of `field` are its fields
    integer :: n_fields = 0
    type(field_t), allocatable :: field(:)
  contains
    procedure :: init => field_list_init
    procedure :: n_items => field_list_n_items
    procedure :: place => field_list_place
    procedure :: add_reals => field_list_add_reals
    procedure :: add_whole => field_list_add_whole
    procedure :: add_texts => field_list_add_texts
    procedure :: words => field_list_words
    procedure :: order => field_list_order
    procedure, private :: next => field_list_next
  end type field_list_t

contains

  !> Numbers of an item, 0 of a text.
  pure integer function field_components(self) result(n)
    class(field_t), intent(in) :: self

    n = 0
    if (allocated(self%value)) n = size(self%value, 1)
    if (allocated(self%whole)) n = size(self%whole, 1)
  end function field_components

  !> Begin a table of `n` items without fields; the caller sets the keys.
  subroutine field_list_init(self, name, key_names, n)
    class(field_list_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    !> one or two, with a blank between
    character(len=*), intent(in) :: key_names
    integer, intent(in) :: n
    integer :: gap

    self%name = name
    self%everywhere = .false.
    self%n_fields = 0
    if (allocated(self%field)) deallocate (self%field)
    if (allocated(self%key)) deallocate (self%key, self%key_name)
    gap = index(trim(key_names), " ")
    allocate (self%field(8), self%key_name(merge(2, 1, gap > 0)))
    self%key_name(1) = key_names
    if (gap > 0) self%key_name(1) = key_names(1:gap - 1)
    if (gap > 0) self%key_name(2) = key_names(gap + 1:)
    allocate (self%key(size(self%key_name), n), source=0_i8)
  end subroutine field_list_init

  !> Items of this rank.
  pure integer function field_list_n_items(self) result(n)
    class(field_list_t), intent(in) :: self
    n = size(self%key, 2)
  end function field_list_n_items

  !> Place of the field with that name, 0 where there is none.
  pure integer function field_list_place(self, name) result(place)
    class(field_list_t), intent(in) :: self
    character(len=*), intent(in) :: name

    do place = self%n_fields, 1, -1
      if (self%field(place)%name == name) return
    end do
  end function field_list_place

  !> Begin the next field.
  subroutine field_list_next(self, name, unit, scalar)
    class(field_list_t), intent(inout) :: self
    character(len=*), intent(in) :: name, unit
    logical, intent(in), optional :: scalar
    type(field_t), allocatable :: longer(:)
    integer :: k

    if (self%n_fields == size(self%field)) then
      allocate (longer(2*self%n_fields))
      do k = 1, self%n_fields
        call move_field(self%field(k), longer(k))
      end do
      call move_alloc(longer, self%field)
    end if
    self%n_fields = self%n_fields + 1
    associate (field => self%field(self%n_fields))
      field%name = name
      field%unit = unit
      if (present(scalar)) field%scalar = scalar
    end associate
  end subroutine field_list_next

  !> Move a field without a copy of its numbers.
  subroutine move_field(from, to)
    type(field_t), intent(inout) :: from, to

    call move_alloc(from%name, to%name)
    call move_alloc(from%unit, to%unit)
    to%scalar = from%scalar
    if (allocated(from%value)) call move_alloc(from%value, to%value)
    if (allocated(from%whole)) call move_alloc(from%whole, to%whole)
    if (allocated(from%text)) call move_alloc(from%text, to%text)
  end subroutine move_field

  !> Add a field of reals, which are moved.
  subroutine field_list_add_reals(self, name, unit, value, scalar)
    class(field_list_t), intent(inout) :: self
    character(len=*), intent(in) :: name, unit
    !> (components, items)
    real(dp), allocatable, intent(inout) :: value(:, :)
    !> .false. unless present
    logical, intent(in), optional :: scalar

    call self%next(name, unit, scalar)
    call move_alloc(value, self%field(self%n_fields)%value)
  end subroutine field_list_add_reals

  !> Add a field of integers, which are moved.
  subroutine field_list_add_whole(self, name, unit, whole, scalar)
    class(field_list_t), intent(inout) :: self
    character(len=*), intent(in) :: name, unit
    !> (components, items)
    integer(i8), allocatable, intent(inout) :: whole(:, :)
    !> .false. unless present
    logical, intent(in), optional :: scalar

    call self%next(name, unit, scalar)
    call move_alloc(whole, self%field(self%n_fields)%whole)
  end subroutine field_list_add_whole

  !> Add a field of texts, of a table that is the same on all ranks.
  subroutine field_list_add_texts(self, name, text)
    class(field_list_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    !> (items)
    character(len=*), intent(in) :: text(:)
    integer :: k

    call self%next(name, "", .true.)
    associate (field => self%field(self%n_fields))
      allocate (character(len=len(text)) :: field%text(size(text)))
      do k = 1, size(text)
        field%text(k) = text(k)
      end do
    end associate
  end subroutine field_list_add_texts

  !> Words of 64 bits that an item takes, keys included; texts by their length.
  pure integer function field_list_words(self) result(words)
    class(field_list_t), intent(in) :: self
    integer :: k

    words = size(self%key, 1)
    do k = 1, self%n_fields
      words = words + self%field(k)%components()
      if (allocated(self%field(k)%text)) words = words + (len(self%field(k)%text) + 7)/8
    end do
  end function field_list_words

  !> Put the items of all ranks in the order of their keys, cut into nearly equal blocks; items with the same first key stay
  !> together. One field after the other is sent, so that the table is never in memory twice. A table with texts cannot be
  !> ordered. Collective.
  subroutine field_list_order(self, comm)
    class(field_list_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    type(row_order_t) :: order
    integer :: k

    call order%find(comm, self%key)
    do k = 1, self%n_fields
      if (allocated(self%field(k)%value)) then
        call order%put_reals(self%field(k)%value)
      else
        call order%put_words(self%field(k)%whole)
      end if
    end do
  end subroutine field_list_order

end module gravier_field_list
