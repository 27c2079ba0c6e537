!> Quantities given in a table against time: linear between the rows, constant before the first. After the last they are constant,
!> or the table begins anew.
module gravier_time_table
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_magnitude, only: is_bounded, bounded_text
  use gravier_random_hash, only: hash_words
  use gravier_csv_table, only: csv_table_t
  implicit none
  private
  public :: time_table_t

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
    procedure :: changes_after => time_table_changes_after
    procedure :: kept_variation => time_table_kept_variation
    procedure :: miss_way => time_table_miss_way
    procedure :: shortest_half_cycle => time_table_shortest_half_cycle
    procedure :: digest => time_table_digest
  end type time_table_t

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

  !> Value of column `k` at a time.
  pure real(dp) function time_table_at(self, k, time) result(value)
    class(time_table_t), intent(in) :: self
    integer, intent(in) :: k
    !> [s]
    real(dp), intent(in) :: time
    integer :: low, high, middle
    real(dp) :: at, share

    low = 1
    high = size(self%time)
    at = time
    if (self%period > 0.0_dp .and. time > self%time(high)) at = self%time(low) + modulo(time - self%time(low), self%period)
    if (at <= self%time(low)) then
      value = self%value(k, low)
    else if (at >= self%time(high)) then
      value = self%value(k, high)
    else
      do while (high - low > 1)
        middle = (low + high)/2
        if (self%time(middle) <= at) then
          low = middle
        else
          high = middle
        end if
      end do
      value = self%value(k, low)
      ! between equal rows the value is theirs, without rounding
      if (.not. abs(self%value(k, high) - value) > 0.0_dp) return
      share = (at - self%time(low))/(self%time(high) - self%time(low))
      value = (1.0_dp - share)*value + share*self%value(k, high)
    end if
  end function time_table_at

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
  !> changes from step to step over that of the changes from row to row. 1 where nothing turns within a step. The table has been
  !> read.
  pure real(dp) function time_table_kept_variation(self, step, steps) result(share)
    class(time_table_t), intent(in) :: self
    !> [s]
    real(dp), intent(in) :: step
    integer, intent(in) :: steps
    !> of a row and of the end, in steps: roundings of times are none
    real(dp), parameter :: rounding = 1.0e-6_dp
    real(dp) :: kept, whole, last, sample, from, to
    integer :: k, row, n

    share = 1.0_dp
    do k = 1, size(self%has)
      if (.not. self%has(k)) cycle
      kept = 0.0_dp
      whole = 0.0_dp
      last = self%at(k, 0.0_dp)
      do row = 1, size(self%time) - 1
        from = max(self%time(row), 0.0_dp)
        to = min(self%time(row + 1), steps*step)
        if (.not. to > from) cycle
        whole = whole + abs(self%at(k, to) - self%at(k, from))
        ! between two rows the first and the last step count
        do n = 1, 2
          if (n == 1) sample = real(ceiling(from/step - rounding, i8), dp)
          if (n == 2) sample = real(floor(to/step + rounding, i8), dp)
          if (sample*step < from - rounding*step .or. sample*step > to + rounding*step) cycle
          kept = kept + abs(self%at(k, sample*step) - last)
          last = self%at(k, sample*step)
        end do
      end do
      if (whole > 0.0_dp) share = min(share, kept/whole)
    end do
  end function time_table_kept_variation

  !> By how much the way that steps make at the rates of column `k` misses the integral of the column at the end of a run, and the
  !> range of that integral at the rows and at the end. Steps make h (theta v(end) + (1 - theta) v(begin)); a jump within a step is
  !> then a ramp of its length, and jumps of a table that repeats may add up. The table has been read.
  pure subroutine time_table_miss_way(self, k, step, theta, steps, missed, range)
    class(time_table_t), intent(in) :: self
    integer, intent(in) :: k, steps
    !> [s], weight of the end of a step
    real(dp), intent(in) :: step, theta
    !> [unit of the column times s]
    real(dp), intent(out) :: missed, range
    real(dp) :: way, exact, begin, low, high, until, corner, last
    integer(i8) :: cycles, turn, n, next
    integer :: row

    until = steps*step
    ! steps without a row inside follow the table
    missed = (theta - 0.5_dp)*step*(self%at(k, until) - self%at(k, 0.0_dp))
    cycles = 0
    if (self%period > 0.0_dp) cycles = int((until - self%time(1))/self%period, i8)
    n = -1
    last = 0.0_dp
    do turn = 0, max(cycles, 0_i8)
      do row = 1, size(self%time)
        corner = self%time(row) + turn*self%period
        if (corner <= 0.0_dp) cycle
        if (corner >= until) exit
        next = int(corner/step, i8)
        if (next /= n) then
          if (n >= 0) missed = missed - trapezium(self, k, last, (n + 1)*step)
          missed = missed + trapezium(self, k, next*step, (next + 1)*step)
          last = next*step
          n = next
        end if
        missed = missed - trapezium(self, k, last, corner)
        last = corner
      end do
    end do
    if (n >= 0) missed = missed - trapezium(self, k, last, (n + 1)*step)
    missed = abs(missed)
    begin = integral(self, k, 0.0_dp)
    exact = integral(self, k, until) - begin
    low = min(0.0_dp, exact)
    high = max(0.0_dp, exact)
    way = 0.0_dp
    do row = 1, size(self%time) - 1
      if (self%time(row) >= until) exit
      way = way + 0.5_dp*(self%time(row + 1) - self%time(row))*(self%value(k, row) + self%value(k, row + 1))
      low = min(low, way - begin)
      high = max(high, way - begin)
    end do
    range = high - low
  end subroutine time_table_miss_way

  !> Integral of column `k` between two times, if it is linear between them [unit of the column times s].
  pure real(dp) function trapezium(self, k, from, to)
    type(time_table_t), intent(in) :: self
    integer, intent(in) :: k
    !> [s]
    real(dp), intent(in) :: from, to
    trapezium = 0.5_dp*(to - from)*(self%at(k, from) + self%at(k, to))
  end function trapezium

  !> Integral of column `k` from the first row to a time [unit of the column times s].
  pure real(dp) function integral(self, k, time) result(sum_until)
    type(time_table_t), intent(in) :: self
    integer, intent(in) :: k
    !> [s]
    real(dp), intent(in) :: time
    real(dp) :: at, cycles
    integer :: row, last

    last = size(self%time)
    at = time
    cycles = 0.0_dp
    if (self%period > 0.0_dp .and. time > self%time(last)) then
      cycles = real(floor((time - self%time(1))/self%period, i8), dp)
      at = time - cycles*self%period
    end if
    sum_until = min(at - self%time(1), 0.0_dp)*self%value(k, 1) + max(at - self%time(last), 0.0_dp)*self%value(k, last)
    do row = 1, last - 1
      associate (from => self%time(row), to => self%time(row + 1))
        if (at > from) sum_until = sum_until + 0.5_dp*(min(at, to) - from)*(self%value(k, row) + self%at(k, min(at, to)))
        sum_until = sum_until + 0.5_dp*cycles*(to - from)*(self%value(k, row) + self%value(k, row + 1))
      end associate
    end do
  end function integral

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
