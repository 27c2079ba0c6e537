!> Quantities given in a table against time: linear between the rows, constant before the first. After the last they are constant,
!> or the table begins anew.
!>
!> A step takes means over a time of its own length, so that nothing is lost of a quantity that jumps or turns within it. What acts
!> during a step has its mean over the step: impulses add up to the integral of the table. What moves something, as h/2 times the
!> sum of its values at both ends of a step, has at the end of a step the mean over the time from half a step before to half a step
!> after it: ways add up to the mean of the integrals of the table up to these two times. A mean between two rows is the value in
!> the middle, and one between equal rows is theirs to the last bit.
module gravier_time_table
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_magnitude, only: is_bounded, bounded_text
  use gravier_random_hash, only: hash_words
  use gravier_csv_table, only: csv_table_t
  implicit none
  private
  public :: time_table_t

  !> steps, and at most so many cycles, in which the ups and downs of a table that begins anew are looked at
  real(dp), parameter :: some_steps = 20.0_dp, most_cycles = 100.0_dp
  !> of a time, in steps
  real(dp), parameter :: rounding = 1.0e-6_dp

  !> Columns of a CSV file with a header; `time` is one of them.
  type :: time_table_t
    !> (rows), ascending [s]
    real(dp), allocatable :: time(:)
    !> (columns asked for, rows)
    real(dp), allocatable :: value(:, :)
    !> whether the file has the column (columns asked for)
    logical, allocatable :: has(:)
    !> time from the first row to the last, after which the table begins anew; 0 where it does not [s]
    real(dp) :: period = 0.0_dp
  contains
    procedure :: read => time_table_read
    procedure :: at => time_table_at
    procedure :: mean => time_table_mean
    procedure :: rate_at => time_table_rate_at
    procedure :: load_of => time_table_load_of
    procedure :: changes_after => time_table_changes_after
    procedure :: kept_variation => time_table_kept_variation
    procedure :: shortest_half_cycle => time_table_shortest_half_cycle
    procedure :: digest => time_table_digest
  end type time_table_t

  !> Where a time lies in a table: the row before it, 0 before the first; the time in the first cycle [s]; cycles that lie between.
  type :: place_t
    integer :: row = 0
    real(dp) :: at = 0.0_dp
    integer(i8) :: cycle = 0
  end type place_t

contains

  !> Read the columns `names` of a file, as far as it has them. Failure: status_input, with file, line, column and what
  !> was expected. Not collective.
  subroutine time_table_read(self, path, names, repeats, error)
    class(time_table_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    !> of the columns besides time, with a blank between two
    character(len=*), intent(in) :: names
    !> whether the table begins anew after its last row, which then has to be as the first
    logical, intent(in) :: repeats
    type(error_t), allocatable, intent(inout) :: error
    type(csv_table_t) :: table
    integer, allocatable :: column(:)
    integer :: time_column, k

    if (allocated(self%time)) deallocate (self%time, self%value)
    if (allocated(self%has)) deallocate (self%has)
    if (allocated(error)) return
    call table%open(path, error)
    if (allocated(error)) return
    time_column = table%column("time")
    if (time_column == 0) call table%refuse_file("column time is missing; known are time "//names, error)
    call find_columns(table, names, column)
    do k = 1, table%column_count()
      if (k == time_column .or. any(k == column)) cycle
      call table%refuse_file("column "//table%column_name(k)//" is unknown here; known are time "//names, error)
    end do
    self%has = column > 0
    if (.not. any(self%has)) call table%refuse_file("no column besides time; known are "//names, error)
    allocate (self%time(0), self%value(size(column), 0))
    call read_rows(self, table, time_column, column, error)
    self%period = 0.0_dp
    if (repeats) call join_ends(self, table, error)
    call table%close()
  end subroutine time_table_read

  !> Let the table begin anew after its last row.
  subroutine join_ends(self, table, error)
    type(time_table_t), intent(inout) :: self
    type(csv_table_t), intent(inout) :: table
    type(error_t), allocatable, intent(inout) :: error
    integer :: n

    if (allocated(error)) return
    n = size(self%time)
    if (n < 2) then
      call table%refuse_file("a table that repeats has one row; expected two or more", error)
    else if (any(abs(self%value(:, n) - self%value(:, 1)) > 0.0_dp)) then
      call table%refuse_file("a table that repeats ends with another row than it begins with; expected the values of the first "// &
        & "row in the last", error)
    else
      self%period = self%time(n) - self%time(1)
    end if
  end subroutine join_ends

  !> Places of columns in the table, 0 for those that it does not have.
  subroutine find_columns(table, names, column)
    type(csv_table_t), intent(in) :: table
    character(len=*), intent(in) :: names
    integer, allocatable, intent(out) :: column(:)
    integer :: k, n, first, last

    n = 1
    do k = 1, len(names)
      if (names(k:k) == " ") n = n + 1
    end do
    allocate (column(n))
    first = 1
    do k = 1, n
      last = first + index(names(first:)//" ", " ") - 2
      column(k) = table%column(names(first:last))
      first = last + 2
    end do
  end subroutine find_columns

  subroutine read_rows(self, table, time_column, column, error)
    type(time_table_t), intent(inout) :: self
    type(csv_table_t), intent(inout) :: table
    integer, intent(in) :: time_column
    integer, intent(in) :: column(:)
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: time, row(size(column))
    integer :: n, k
    logical :: found

    n = 0
    do
      call table%next_row(found, error)
      if (allocated(error) .or. .not. found) exit
      call read_number(table, time_column, time, error)
      row(:) = 0.0_dp
      do k = 1, size(column)
        if (column(k) > 0) call read_number(table, column(k), row(k), error)
      end do
      if (allocated(error)) exit
      if (n > 0) then
        if (time <= self%time(n)) call table%refuse(time_column, "a time later than that of the row above", error)
      end if
      call add_row(self, n, time, row)
    end do
    call set_room(self, n, n)
    if (n == 0 .and. .not. allocated(error)) call table%refuse_file("no rows; at least one was expected", error)
  end subroutine read_rows

  subroutine read_number(table, column, value, error)
    type(csv_table_t), intent(in) :: table
    integer, intent(in) :: column
    real(dp), intent(inout) :: value
    type(error_t), allocatable, intent(inout) :: error

    call table%get_real(column, value, error)
    if (.not. allocated(error) .and. .not. is_bounded(value)) call table%refuse(column, bounded_text, error)
  end subroutine read_number

  subroutine add_row(self, n, time, row)
    type(time_table_t), intent(inout) :: self
    integer, intent(inout) :: n
    real(dp), intent(in) :: time, row(:)

    if (n == size(self%time)) call set_room(self, n, 2*n + 16)
    n = n + 1
    self%time(n) = time
    self%value(:, n) = row
  end subroutine add_row

  !> Keep the first `n` rows, with room for `room`.
  subroutine set_room(self, n, room)
    type(time_table_t), intent(inout) :: self
    integer, intent(in) :: n, room
    real(dp), allocatable :: time(:), value(:, :)

    allocate (time(room), value(size(self%value, 1), room))
    time(1:n) = self%time(1:n)
    value(:, 1:n) = self%value(:, 1:n)
    call move_alloc(time, self%time)
    call move_alloc(value, self%value)
  end subroutine set_room

  !> Where a time lies in the table.
  pure type(place_t) function place_of(self, time) result(place)
    type(time_table_t), intent(in) :: self
    !> [s]
    real(dp), intent(in) :: time
    real(dp) :: since
    integer :: high, middle

    high = size(self%time)
    place%at = time
    if (self%period > 0.0_dp .and. time >= self%time(high)) then
      since = modulo(time - self%time(1), self%period)
      place%cycle = nint((time - self%time(1) - since)/self%period, i8)
      place%at = self%time(1) + since
    else if (place%at >= self%time(high)) then
      place%row = high
      return
    end if
    do while (high - place%row > 1)
      middle = (place%row + high)/2
      if (self%time(middle) <= place%at) then
        place%row = middle
      else
        high = middle
      end if
    end do
  end function place_of

  !> Value of column `k` behind a row and before the next one.
  pure real(dp) function value_behind(self, k, row, at) result(value)
    type(time_table_t), intent(in) :: self
    integer, intent(in) :: k
    !> 0 before the first row
    integer, intent(in) :: row
    !> in the first cycle [s]
    real(dp), intent(in) :: at
    real(dp) :: share

    value = self%value(k, max(row, 1))
    if (row == 0 .or. row == size(self%time)) return
    ! between equal rows the value is theirs, without rounding
    if (.not. abs(self%value(k, row + 1) - value) > 0.0_dp) return
    share = min((at - self%time(row))/(self%time(row + 1) - self%time(row)), 1.0_dp)
    value = (1.0_dp - share)*value + share*self%value(k, row + 1)
  end function value_behind

  !> Value of column `k` at a time.
  pure real(dp) function time_table_at(self, k, time) result(value)
    class(time_table_t), intent(in) :: self
    integer, intent(in) :: k
    !> [s]
    real(dp), intent(in) :: time

    associate (place => place_of(self, time))
      value = value_behind(self, k, place%row, place%at)
    end associate
  end function time_table_at

  !> Mean of column `k` from a time to a later one; the value of the time where both are one. It takes a look at each row between
  !> them, and at each row of the table where they are more than a cycle apart.
  pure real(dp) function time_table_mean(self, k, from, to) result(mean)
    class(time_table_t), intent(in) :: self
    integer, intent(in) :: k
    !> [s]
    real(dp), intent(in) :: from, to
    type(place_t) :: first, last
    real(dp) :: area
    integer :: n

    first = place_of(self, from)
    last = place_of(self, to)
    n = size(self%time)
    if (first%row == last%row .and. first%cycle == last%cycle) then
      mean = value_behind(self, k, first%row, first%at + 0.5_dp*(last%at - first%at))
      return
    end if
    ! what differs from the first value is added up, so that equal rows have no rounding
    mean = value_behind(self, k, first%row, first%at)
    area = 0.5_dp*(self%time(first%row + 1) - first%at)*(self%value(k, first%row + 1) - mean)
    if (first%cycle == last%cycle) then
      area = area + area_between(self, k, first%row + 1, last%row, mean)
    else
      area = area + area_between(self, k, first%row + 1, n, mean) + area_between(self, k, 1, last%row, mean)
      if (last%cycle - first%cycle > 1) area = area + real(last%cycle - first%cycle - 1, dp)*area_between(self, k, 1, n, mean)
    end if
    area = area + 0.5_dp*(last%at - self%time(last%row))*((self%value(k, last%row) - mean) + &
      & (value_behind(self, k, last%row, last%at) - mean))
    mean = mean + area/(to - from)
  end function time_table_mean

  !> Integral, from one row to another, of what column `k` is above a value [unit of the column times s].
  pure real(dp) function area_between(self, k, first, last, value) result(area)
    type(time_table_t), intent(in) :: self
    integer, intent(in) :: k, first, last
    real(dp), intent(in) :: value
    integer :: row

    area = 0.0_dp
    do row = first, last - 1
      area = area + 0.5_dp*(self%time(row + 1) - self%time(row))*((self%value(k, row) - value) + (self%value(k, row + 1) - value))
    end do
  end function area_between

  !> What column `k` prescribes at the end of a step, of what moves something: the mean over the time from half a step before it to
  !> half a step after it. At the time 0 it is that of the half step that follows: the way is that of the table from the start.
  pure real(dp) function time_table_rate_at(self, k, time, step) result(rate)
    class(time_table_t), intent(in) :: self
    integer, intent(in) :: k
    !> [s]
    real(dp), intent(in) :: time, step

    rate = self%mean(k, max(time - 0.5_dp*step, min(time, 0.0_dp)), time + 0.5_dp*step)
  end function time_table_rate_at

  !> What column `k` makes act in the step that ends at a time: the mean over this step.
  pure real(dp) function time_table_load_of(self, k, time, step) result(load)
    class(time_table_t), intent(in) :: self
    integer, intent(in) :: k
    !> [s]
    real(dp), intent(in) :: time, step

    load = self%mean(k, time - step, time)
  end function time_table_load_of

  !> Whether some quantity has another value later than it has at a time. The table has been read.
  pure logical function time_table_changes_after(self, time) result(changes)
    class(time_table_t), intent(in) :: self
    !> [s]
    real(dp), intent(in) :: time
    integer :: row, k

    changes = .false.
    do k = 1, size(self%has)
      if (.not. self%has(k)) cycle
      do row = size(self%time), 1, -1
        if (.not. (self%time(row) > time .or. self%period > 0.0_dp)) exit
        changes = changes .or. abs(self%value(k, row) - self%at(k, time)) > 0.0_dp
      end do
    end do
  end function time_table_changes_after

  !> What steps keep of the ups and downs of the quantities until some step, for the quantity that loses most: the sum of the
  !> changes from step to step over that of the changes from row to row. Near 1 where nothing turns within a step. Of a table that
  !> begins anew, some steps or the first two cycles count. The table has been read.
  pure real(dp) function time_table_kept_variation(self, n_rates, step, steps) result(share)
    class(time_table_t), intent(in) :: self
    !> columns that move something, which come first; the others act
    integer, intent(in) :: n_rates
    !> [s]
    real(dp), intent(in) :: step
    integer, intent(in) :: steps
    real(dp) :: kept, whole, last, until, begin
    integer :: k, row, n, next, near, cycles, turn

    share = 1.0_dp
    until = steps*step
    cycles = 1
    if (self%period > 0.0_dp) then
      cycles = 1 + ceiling(min(some_steps*step/self%period, most_cycles))
      until = min(until, self%time(1) + cycles*self%period)
    end if
    do k = 1, size(self%has)
      if (.not. self%has(k)) cycle
      kept = 0.0_dp
      whole = 0.0_dp
      last = self%at(k, 0.0_dp)
      next = 1
      do turn = 0, cycles - 1
        begin = turn*self%period
        do row = 1, size(self%time)
          ! between two rows all is linear in time, but for the means of the steps beside them
          near = floor(min(max(begin + self%time(row), 0.0_dp), until)/step)
          do n = max(next, near - 1), min(near + 2, floor(until/step + rounding))
            kept = kept + abs(step_mean(n) - last)
            last = step_mean(n)
            next = n + 1
          end do
          if (row == size(self%time)) exit
          associate (from => max(begin + self%time(row), 0.0_dp), to => min(begin + self%time(row + 1), until))
            if (to > from) whole = whole + abs(self%at(k, to) - self%at(k, from))
          end associate
        end do
      end do
      kept = kept + abs(self%at(k, until) - last)
      if (whole > 0.0_dp) share = min(share, kept/whole)
    end do

  contains

    pure real(dp) function step_mean(n)
      integer, intent(in) :: n

      if (k <= n_rates) then
        step_mean = self%rate_at(k, n*step, step)
      else
        step_mean = self%load_of(k, n*step, step)
      end if
    end function step_mean

  end function time_table_kept_variation

  !> A number that tells tables of other columns, times or values apart; the table has been read.
  pure integer(i8) function time_table_digest(self) result(digest)
    class(time_table_t), intent(in) :: self
    integer(i8), allocatable :: words(:)
    integer :: row, k, n

    allocate (words(size(self%has) + size(self%time) + size(self%value)))
    words(1:size(self%has)) = merge(1_i8, 0_i8, self%has)
    n = size(self%has)
    do row = 1, size(self%time)
      n = n + 1
      words(n) = transfer(self%time(row), 0_i8)
      do k = 1, size(self%value, 1)
        n = n + 1
        words(n) = transfer(self%value(k, row), 0_i8)
      end do
    end do
    digest = hash_words(words)
  end function time_table_digest

  !> Shortest time between two turns of a quantity, from a highest value to a lowest or back; huge where there are fewer than two.
  !> In a table that begins anew its first turn follows its last one [s].
  pure real(dp) function time_table_shortest_half_cycle(self, column) result(shortest)
    class(time_table_t), intent(in) :: self
    integer, intent(in) :: column
    real(dp) :: last, first, change
    integer :: row, rows, turns, before

    shortest = huge(shortest)
    rows = size(self%time)
    turns = 0
    before = 0
    last = 0.0_dp
    first = 0.0_dp
    do row = 2, rows
      change = self%value(column, row) - self%value(column, row - 1)
      if (.not. abs(change) > 0.0_dp) cycle
      if (before /= 0 .and. before /= merge(1, -1, change > 0.0_dp)) then
        turns = turns + 1
        if (turns == 1) first = self%time(row - 1)
        if (turns > 1) shortest = min(shortest, self%time(row - 1) - last)
        last = self%time(row - 1)
      end if
      before = merge(1, -1, change > 0.0_dp)
    end do
    if (self%period > 0.0_dp .and. turns > 1) shortest = min(shortest, first + self%period - last)
    if (self%period > 0.0_dp .and. turns == 1) shortest = min(shortest, last - self%time(1), self%time(rows) - last)
  end function time_table_shortest_half_cycle

end module gravier_time_table
