!> What has been measured: values round by round, and their table.
module gravier_bench_record
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_statistics, only: median
  use gravier_csv_writer, only: csv_writer_t
  use gravier_build_info, only: version, revision, compiler, build_type
  use gravier_machine, only: processor_model, compiler_flags, date_text
  implicit none
  private
  public :: record_t, case_t

  integer, parameter :: name_length = 32

  !> What a value belongs to.
  type :: case_t
    character(len=name_length) :: group = "", name = ""
    !> contacts, grains or unknowns, as the group has it
    integer(i8) :: size = 0
    integer :: ranks = 1
  end type case_t

  type :: row_t
    type(case_t) :: of
    character(len=name_length) :: quantity = "", unit = ""
    real(dp), allocatable :: values(:)
  end type row_t

  type :: record_t
    private
    integer :: n = 0
    type(row_t), allocatable :: rows(:)
  contains
    procedure :: note => record_note
    procedure :: print => record_print
    procedure :: write => record_write
  end type record_t

contains

  !> Add a value to its row, which is made at the first one.
  subroutine record_note(self, of, quantity, unit, value)
    class(record_t), intent(inout) :: self
    type(case_t), intent(in) :: of
    character(len=*), intent(in) :: quantity, unit
    real(dp), intent(in) :: value
    type(row_t), allocatable :: longer(:)
    integer :: k

    do k = 1, self%n
      if (same(self%rows(k)%of, of) .and. self%rows(k)%quantity == quantity) exit
    end do
    if (k > self%n) then
      if (.not. allocated(self%rows)) allocate (self%rows(64))
      if (self%n == size(self%rows)) then
        allocate (longer(2*self%n))
        longer(1:self%n) = self%rows
        call move_alloc(longer, self%rows)
      end if
      self%n = k
      self%rows(k)%of = of
      self%rows(k)%quantity = quantity
      self%rows(k)%unit = unit
      allocate (self%rows(k)%values(0))
    end if
    call append(self%rows(k)%values, value)
  end subroutine record_note

  pure subroutine append(values, value)
    real(dp), allocatable, intent(inout) :: values(:)
    real(dp), intent(in) :: value
    real(dp), allocatable :: longer(:)
    integer :: n

    n = size(values)
    allocate (longer(n + 1))
    longer(1:n) = values
    longer(n + 1) = value
    call move_alloc(longer, values)
  end subroutine append

  pure logical function same(a, b)
    type(case_t), intent(in) :: a, b
    same = a%group == b%group .and. a%name == b%name .and. a%size == b%size .and. a%ranks == b%ranks
  end function same

  !> Print the rows of a group: medians, and in brackets the least and the greatest value. What is the same in every round is
  !> left to the table.
  subroutine record_print(self, unit, group)
    class(record_t), intent(in) :: self
    integer, intent(in) :: unit
    character(len=*), intent(in) :: group
    integer :: k

    write (unit, "(a)") group
    do k = 1, self%n
      associate (row => self%rows(k))
        if (row%of%group /= group) cycle
        if (size(row%values) > 1 .and. .not. maxval(row%values) > minval(row%values)) cycle
        write (unit, "(2x, a26, i10, i3, 2x, a26, es11.3, '  [', es10.3, ',', es10.3, ']  ', a)") row%of%name(1:26), row%of%size, &
          & row%of%ranks, row%quantity(1:26), median(row%values), minval(row%values), maxval(row%values), trim(row%unit)
      end associate
    end do
    flush (unit)
  end subroutine record_print

  !> Write the table. Not collective: on one rank.
  subroutine record_write(self, path, error)
    class(record_t), intent(in) :: self
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    type(csv_writer_t) :: table
    integer :: k

    call table%open(path, "group,case,size,ranks,quantity,unit,median,low,high,repeats,machine,compiler,flags,build,version,"// &
      & "revision,date", error)
    do k = 1, self%n
      associate (row => self%rows(k))
        call table%add(trim(row%of%group))
        call table%add(trim(row%of%name))
        call table%add(row%of%size)
        call table%add(row%of%ranks)
        call table%add(trim(row%quantity))
        call table%add(trim(row%unit))
        call table%add(median(row%values))
        call table%add(minval(row%values))
        call table%add(maxval(row%values))
        call table%add(size(row%values))
      end associate
      call table%add(processor_model())
      call table%add(compiler)
      call table%add(compiler_flags())
      call table%add(build_type)
      call table%add(version)
      call table%add(revision)
      call table%add(date_text())
      call table%end_row(error)
    end do
    call table%close(error)
  end subroutine record_write

end module gravier_bench_record
