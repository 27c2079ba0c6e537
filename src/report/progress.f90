!> What a person is told while a run goes on, and how often: a live line on a terminal, lines at growing intervals in a log, and of
!> each kind of warning the first ones, then the 10th, the 20th, the 50th and so on.
module gravier_progress
  use gravier_kinds, only: dp, i8
  use gravier_text, only: to_text
  use gravier_timers, only: clock
  implicit none
  private
  public :: progress_t, duration_text
  public :: warn_unconverged, warn_fast, warn_lowered, warn_acceleration, warn_relaxation, warn_partition, warn_springs
  public :: warn_deep, warn_fallen, note_balance, note_scale

  integer, parameter :: warn_unconverged = 1, warn_fast = 2, warn_lowered = 3, warn_acceleration = 4, warn_relaxation = 5, &
    & warn_partition = 6, warn_springs = 7, warn_deep = 8, warn_fallen = 9, note_balance = 10, note_scale = 11
  integer, parameter :: n_kinds = 11
  !> what the closing line calls them; a note is not counted there
  character(len=*), parameter :: kind_names(9) = [character(len=44) :: "solves above the tolerance", &
    & "grains too fast for the step", "search directions lowered", "Nesterov momentum suspended", "relaxation factors lowered", &
    & "partitions refused", "springs too stiff for the step", "contacts pressed deep into bodies", &
    & "grains fallen below all boundaries"]
  !> said in full, of each kind
  integer(i8), parameter :: first_ones = 5
  !> lines of steps that are always written
  integer, parameter :: first_lines = 10
  !> between two live lines, and between two lines of a log at least [s]; later ones after a part of the time so far
  real(dp), parameter :: live_interval = 0.2_dp, log_interval = 1.0_dp, part_of_time = 0.02_dp
  !> within a solve, between two lines of a log at least [s]; later ones after a part of the time of the solve so far
  real(dp), parameter :: solve_interval = 5.0_dp
  !> steps that the time of a step is averaged over
  integer, parameter :: memory = 50

  type :: progress_t
    private
    real(dp) :: start = 0.0_dp, last_line = 0.0_dp, last_live = 0.0_dp
    !> end of the last step, last line within a solve [s]
    real(dp) :: step_end = 0.0_dp, last_solve_line = 0.0_dp
    integer :: lines = 0, steps = 0
    !> mean of the last steps [s]
    real(dp) :: seconds_a_step = 0.0_dp
    integer(i8) :: counts(n_kinds) = 0, said(n_kinds) = 0
  contains
    procedure :: begin => progress_begin
    procedure :: note_step => progress_note_step
    procedure :: line_due => progress_line_due
    procedure :: live_due => progress_live_due
    procedure :: solve_line_due => progress_solve_line_due
    procedure :: remaining => progress_remaining
    procedure :: warn => progress_warn
    procedure :: warnings => progress_warnings
  end type progress_t

contains

  subroutine progress_begin(self)
    class(progress_t), intent(inout) :: self

    self%start = clock()
    self%last_line = self%start
    self%last_live = self%start - live_interval
    self%step_end = self%start
    self%last_solve_line = self%start
  end subroutine progress_begin

  !> A step is over that took so many seconds.
  subroutine progress_note_step(self, seconds)
    class(progress_t), intent(inout) :: self
    real(dp), intent(in) :: seconds

    self%steps = self%steps + 1
    self%step_end = clock()
    self%last_solve_line = self%step_end
    self%seconds_a_step = self%seconds_a_step + (seconds - self%seconds_a_step)/min(self%steps, memory)
  end subroutine progress_note_step

  !> Whether a line of a log is due now; if so, it counts as written.
  logical function progress_line_due(self, ends) result(due)
    class(progress_t), intent(inout) :: self
    !> the last step, or one to be told of in any case
    logical, intent(in) :: ends
    real(dp) :: now

    now = clock()
    due = ends .or. self%lines < first_lines .or. now - self%last_line >= max(log_interval, part_of_time*(now - self%start))
    if (.not. due) return
    self%lines = self%lines + 1
    self%last_line = now
  end function progress_line_due

  !> Whether the live line is due again; if so, it counts as written.
  logical function progress_live_due(self) result(due)
    class(progress_t), intent(inout) :: self
    real(dp) :: now

    now = clock()
    due = now - self%last_live >= live_interval
    if (due) self%last_live = now
  end function progress_live_due

  !> Whether a line within a solve is due now; if so, it counts as written.
  logical function progress_solve_line_due(self, seconds) result(due)
    class(progress_t), intent(inout) :: self
    !> since the end of the last step [s]
    real(dp), intent(out) :: seconds
    real(dp) :: now

    now = clock()
    seconds = now - self%step_end
    due = now - self%last_solve_line >= max(solve_interval, part_of_time*seconds)
    if (due) self%last_solve_line = now
  end function progress_solve_line_due

  !> Wall time that so many more steps take, in words.
  function progress_remaining(self, steps) result(text)
    class(progress_t), intent(in) :: self
    integer, intent(in) :: steps
    character(len=:), allocatable :: text
    text = duration_text(steps*self%seconds_a_step)
  end function progress_remaining

  !> A time in two units, as 2 h 05 min.
  pure function duration_text(seconds) result(text)
    real(dp), intent(in) :: seconds
    character(len=:), allocatable :: text
    character(len=32) :: row
    integer(i8) :: whole

    whole = nint(min(max(seconds, 0.0_dp), 1.0e15_dp), i8)
    if (seconds < 9.95_dp) then
      write (row, "(f4.1,' s')") max(seconds, 0.0_dp)
    else if (whole < 60) then
      write (row, "(i0,' s')") whole
    else if (whole < 3600) then
      write (row, "(i0,' min ',i2.2,' s')") whole/60, mod(whole, 60_i8)
    else if (whole < 86400) then
      write (row, "(i0,' h ',i2.2,' min')") whole/3600, mod(whole, 3600_i8)/60
    else
      write (row, "(i0,' d ',i2.2,' h')") whole/86400, mod(whole, 86400_i8)/3600
    end if
    text = trim(adjustl(row))
  end function duration_text

  !> Note `number` warnings of a kind; whether they are to be said, and what is to be added to the words.
  subroutine progress_warn(self, kind, number, say, addition)
    class(progress_t), intent(inout) :: self
    integer, intent(in) :: kind
    integer(i8), intent(in) :: number
    logical, intent(out) :: say
    character(len=:), allocatable, intent(out) :: addition

    self%counts(kind) = self%counts(kind) + number
    self%said(kind) = self%said(kind) + 1
    say = worth_saying(self%said(kind))
    addition = ""
    if (self%said(kind) == first_ones) then
      addition = "; further notes of this kind appear ever more rarely"
      if (kind <= size(kind_names)) addition = "; further warnings of this kind appear ever more rarely, the end counts all"
    end if
    if (self%said(kind) > first_ones) addition = "; the "//to_text(self%said(kind))//"th of this kind"
  end subroutine progress_warn

  !> The first ones, and 1, 2 and 5 times each power of ten.
  pure logical function worth_saying(number)
    integer(i8), intent(in) :: number
    integer(i8) :: digit

    digit = number
    do while (mod(digit, 10_i8) == 0 .and. digit > 0)
      digit = digit/10
    end do
    worth_saying = number <= first_ones .or. digit == 1 .or. digit == 2 .or. digit == 5
  end function worth_saying

  !> Counts of the warnings, empty where there were none.
  function progress_warnings(self) result(text)
    class(progress_t), intent(in) :: self
    character(len=:), allocatable :: text
    integer :: k

    text = ""
    do k = 1, size(kind_names)
      if (self%counts(k) == 0) cycle
      if (len(text) > 0) text = text//", "
      text = text//trim(kind_names(k))//" "//to_text(self%counts(k))
    end do
  end function progress_warnings

end module gravier_progress
