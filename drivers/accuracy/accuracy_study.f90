!> The study of gravier_accuracy, and the cases that it makes of one.
module gravier_accuracy_study
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_command_line, only: positive_real
  use gravier_config, only: config_t, parse_config
  use gravier_config_scan, only: assignment_t
  implicit none
  private
  public :: study_t, variant_t, text_t, append, duration_of, same_time

  type :: text_t
    character(len=:), allocatable :: text
  end type text_t

  !> A case with keys of its own.
  type :: variant_t
    character(len=:), allocatable :: name
    type(assignment_t), allocatable :: changes(:)
  end type variant_t

  type :: study_t
    character(len=:), allocatable :: file, title, directory
    !> path and content of the case
    character(len=:), allocatable :: case, case_text
    !> solve or run; tight, exact or none
    character(len=:), allocatable :: kind, reference
    !> the key that is varied, its group, and its values as they are written; blank and none for a solve
    character(len=:), allocatable :: vary, vary_group
    type(text_t), allocatable :: values(:)
    !> columns of history.csv whose means are compared
    type(text_t), allocatable :: quantities(:)
    integer :: samples = 1, repeats = 3
    real(dp) :: knee = 0.01_dp
    type(variant_t), allocatable :: variants(:)
    !> the run that others are compared with
    type(variant_t) :: tight
  contains
    procedure :: make_config => study_make_config
    procedure :: make_reference => study_make_reference
    procedure :: value_of => study_value_of
    procedure :: complain => study_complain
  end type study_t

  !> durations that agree so well, relative to the longer one, are the same
  real(dp), parameter :: same_time = 1.0e-9_dp

contains

  !> Fail with `FILE: &study key ...: expected ...`.
  subroutine study_complain(self, shown, expected, error)
    class(study_t), intent(in) :: self
    !> key, or key and value
    character(len=*), intent(in) :: shown, expected
    type(error_t), allocatable, intent(inout) :: error
    call raise(error, status_input, self%file//": &study "//shown//": expected "//expected)
  end subroutine study_complain

  !> The case of variant `v` with value `k` of the key that is varied.
  subroutine study_make_config(self, v, k, config, error)
    class(study_t), intent(in) :: self
    integer, intent(in) :: v, k
    type(config_t), intent(out) :: config
    type(error_t), allocatable, intent(inout) :: error
    type(assignment_t), allocatable :: changes(:)
    real(dp) :: duration
    integer :: steps

    call parse_changed(self, self%variants(v)%name, self%variants(v)%changes, config, error)
    if (allocated(error) .or. self%vary == "") return
    changes = self%variants(v)%changes
    call append(changes, change_of(self%vary_group, self%vary, self%values(k)%text))
    if (self%vary == "step" .and. self%value_of(k) > 0.0_dp) then
      duration = duration_of(config)
      steps = nint(min(duration/self%value_of(k), 0.5_dp*huge(1)))
      if (abs(steps*self%value_of(k) - duration) > same_time*duration) then
        call self%complain("values: "//self%values(k)%text, "steps that divide the duration of the case, "// &
          & to_text(duration, 6)//" s", error)
        return
      end if
      call append(changes, change_of("time", "steps", to_text(steps)))
    end if
    call parse_changed(self, self%variants(v)%name, changes, config, error)
    if (.not. allocated(error)) call check_samples(self, config, error)
  end subroutine study_make_config

  pure function change_of(group, key, value) result(change)
    character(len=*), intent(in) :: group, key, value
    type(assignment_t) :: change
    change%group = group
    change%key = key
    change%index = ""
    change%value = value
  end function change_of

  !> The case that others are compared with.
  subroutine study_make_reference(self, config, error)
    class(study_t), intent(in) :: self
    type(config_t), intent(out) :: config
    type(error_t), allocatable, intent(inout) :: error

    call parse_changed(self, self%tight%name, self%tight%changes, config, error)
    if (.not. allocated(error)) call check_samples(self, config, error)
  end subroutine study_make_reference

  subroutine parse_changed(study, name, changes, config, error)
    type(study_t), intent(in) :: study
    character(len=*), intent(in) :: name
    type(assignment_t), intent(in) :: changes(:)
    type(config_t), intent(out) :: config
    type(error_t), allocatable, intent(inout) :: error
    call parse_config(study%file//": '"//name//"' of "//study%case, study%case_text, config, error, changes)
  end subroutine parse_changed

  subroutine check_samples(study, config, error)
    type(study_t), intent(in) :: study
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error

    if (config%time%steps < 1) then
      call raise(error, status_input, config%file//": &time steps = "//to_text(config%time%steps)//": expected an integer >= 1")
    else if (study%kind == "run" .and. mod(config%time%steps, study%samples) /= 0) then
      call study%complain("samples = "//to_text(study%samples), "a divisor of all numbers of steps, "// &
        & to_text(config%time%steps)//" among them", error)
    end if
  end subroutine check_samples

  !> Value `k` of the key that is varied as a number, its place in the list where it is none.
  pure real(dp) function study_value_of(self, k) result(value)
    class(study_t), intent(in) :: self
    integer, intent(in) :: k

    value = positive_real(self%values(k)%text)
    if (.not. value > 0.0_dp) value = real(k, dp)
  end function study_value_of

  pure subroutine append(items, item)
    type(assignment_t), allocatable, intent(inout) :: items(:)
    type(assignment_t), intent(in) :: item
    type(assignment_t), allocatable :: longer(:)
    integer :: k

    allocate (longer(size(items) + 1))
    do k = 1, size(items)
      longer(k) = items(k)
    end do
    longer(size(longer)) = item
    call move_alloc(longer, items)
  end subroutine append

  !> [s]
  pure real(dp) function duration_of(config) result(duration)
    type(config_t), intent(in) :: config
    duration = config%time%step*config%time%steps
  end function duration_of

end module gravier_accuracy_study
