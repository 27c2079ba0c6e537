!> The diagnostics that a user asks for, and their figures as columns of a table. What is not asked for is neither computed nor
!> kept.
module gravier_diagnostics
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use gravier_kinds, only: dp, i8
  use gravier_timers, only: start_timer, stop_timer, phase_diagnostics
  use gravier_decomposition, only: decomposition_t
  use gravier_physics, only: physics_t
  use gravier_diagnostic, only: diagnostic_features_t, solved_step_t, column_list_t, histogram_t, in_each_step, name_length
  use gravier_diagnostic_registry, only: diagnostic_holder_t, registered_diagnostics
  implicit none
  private
  public :: diagnostics_t, name_length

  !> A diagnostic that is asked for.
  type, extends(diagnostic_holder_t) :: asked_diagnostic_t
    type(diagnostic_features_t) :: features
    !> its last column; its first one is behind the last one before it
    integer :: last = 0
    !> it has measured the present step
    logical :: measured = .false.
  end type asked_diagnostic_t

  type :: diagnostics_t
    !> those that are asked for, in the order of the registry; not allocated before `init`
    type(asked_diagnostic_t), allocatable :: asked(:)
    !> of all columns: names and values of the present step, as far as they are measured
    integer :: n_columns = 0
    !> (n_columns and more)
    character(len=name_length), allocatable :: name(:)
    real(dp), allocatable :: value(:)
  contains
    procedure :: init => diagnostics_init
    procedure :: take => diagnostics_take
    procedure :: take_step => diagnostics_take_step
    procedure :: measure => diagnostics_measure
    procedure :: in_each_step => diagnostics_in_each_step
    procedure :: place => diagnostics_place
    procedure :: in_history => diagnostics_in_history
    procedure :: in_results => diagnostics_in_results
    procedure :: is_absent => diagnostics_is_absent
    procedure :: get_histograms => diagnostics_get_histograms
    procedure :: free => diagnostics_free
    procedure, private :: fill => diagnostics_fill
  end type diagnostics_t

contains

  !> Make those that are asked for, of a scene as it starts, and take over those that groups of their own ask for. Collective.
  subroutine diagnostics_init(self, decomposition, physics, asked, more)
    class(diagnostics_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics
    !> (registered diagnostics)
    logical, intent(in) :: asked(:)
    !> not allocated where there is none; is emptied
    type(diagnostic_holder_t), intent(inout) :: more(:)
    type(diagnostic_holder_t), allocatable :: all_kinds(:), list(:)
    logical, allocatable :: taken(:)
    integer :: k

    call registered_diagnostics(all_kinds)
    allocate (list(size(all_kinds) + size(more)))
    allocate (taken(size(list)))
    taken(1:size(asked)) = asked
    do k = 1, size(all_kinds)
      call move_alloc(all_kinds(k)%diagnostic, list(k)%diagnostic)
    end do
    do k = 1, size(more)
      taken(size(all_kinds) + k) = allocated(more(k)%diagnostic)
      call move_alloc(more(k)%diagnostic, list(size(all_kinds) + k)%diagnostic)
    end do
    call self%take(decomposition, physics, list, taken)
  end subroutine diagnostics_init

  !> Take over those of a list that are asked for, of a scene as it starts. Collective.
  subroutine diagnostics_take(self, decomposition, physics, list, asked)
    class(diagnostics_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics
    !> is emptied
    type(diagnostic_holder_t), intent(inout) :: list(:)
    logical, intent(in) :: asked(:)
    integer :: k, n

    call self%free()
    allocate (self%asked(count(asked)))
    n = 0
    do k = 1, size(list)
      if (.not. asked(k)) cycle
      n = n + 1
      call move_alloc(list(k)%diagnostic, self%asked(n)%diagnostic)
      self%asked(n)%features = self%asked(n)%diagnostic%features()
      call self%asked(n)%diagnostic%begin(decomposition, physics)
    end do
    call self%fill()
  end subroutine diagnostics_take

  !> What has to be taken before the step is over. Collective.
  subroutine diagnostics_take_step(self, step)
    class(diagnostics_t), intent(inout) :: self
    type(solved_step_t), intent(in) :: step
    integer :: k

    if (.not. allocated(self%asked)) return
    call start_timer(phase_diagnostics)
    do k = 1, size(self%asked)
      call self%asked(k)%diagnostic%take_step(step)
    end do
    call stop_timer(phase_diagnostics)
  end subroutine diagnostics_take_step

  !> Whether some diagnostic looks at each step.
  pure logical function diagnostics_in_each_step(self) result(are)
    class(diagnostics_t), intent(in) :: self
    integer :: k

    are = .false.
    if (.not. allocated(self%asked)) return
    do k = 1, size(self%asked)
      are = are .or. self%asked(k)%features%measures == in_each_step
    end do
  end function diagnostics_in_each_step

  !> Measure the step at its end, those of written steps only where it is one, and fill the columns. Collective.
  subroutine diagnostics_measure(self, step, written)
    class(diagnostics_t), intent(inout) :: self
    type(solved_step_t), intent(in) :: step
    !> the state after the step will be written
    logical, intent(in) :: written
    integer :: k

    if (.not. allocated(self%asked)) return
    call start_timer(phase_diagnostics)
    do k = 1, size(self%asked)
      associate (one => self%asked(k))
        one%measured = written .or. one%features%measures == in_each_step
        if (one%measured) call one%diagnostic%measure(step)
      end associate
    end do
    call self%fill()
    call stop_timer(phase_diagnostics)
  end subroutine diagnostics_measure

  !> Names and values of all columns.
  subroutine diagnostics_fill(self)
    class(diagnostics_t), intent(inout) :: self
    type(column_list_t) :: list
    integer :: k

    call move_alloc(self%name, list%name)
    call move_alloc(self%value, list%value)
    do k = 1, size(self%asked)
      call self%asked(k)%diagnostic%columns(list)
      self%asked(k)%last = list%n
    end do
    self%n_columns = list%n
    call move_alloc(list%name, self%name)
    call move_alloc(list%value, self%value)
  end subroutine diagnostics_fill

  !> Place among `asked` of the diagnostic with that key; 0 where it is not asked for.
  pure integer function diagnostics_place(self, key) result(place)
    class(diagnostics_t), intent(in) :: self
    character(len=*), intent(in) :: key

    place = 0
    if (.not. allocated(self%asked)) return
    do place = size(self%asked), 1, -1
      if (self%asked(place)%features%key == key) return
    end do
  end function diagnostics_place

  !> Whether column `k` has a value in each step.
  pure logical function diagnostics_in_history(self, k) result(is_in)
    class(diagnostics_t), intent(in) :: self
    integer, intent(in) :: k
    is_in = self%asked(owner_of(self, k))%features%measures == in_each_step
  end function diagnostics_in_history

  !> Whether column `k` holds for the scene as a whole and for the present step.
  pure logical function diagnostics_in_results(self, k) result(is_in)
    class(diagnostics_t), intent(in) :: self
    integer, intent(in) :: k

    associate (owner => self%asked(owner_of(self, k)))
      is_in = owner%features%of_scene .and. owner%measured
    end associate
  end function diagnostics_in_results

  !> Whether column `k` describes what the scene does not have in the present step.
  pure logical function diagnostics_is_absent(self, k) result(is_absent)
    class(diagnostics_t), intent(in) :: self
    integer, intent(in) :: k
    is_absent = self%asked(owner_of(self, k))%features%may_be_absent .and. ieee_is_nan(self%value(k))
  end function diagnostics_is_absent

  !> Place among `asked` of the diagnostic that column `k` belongs to.
  pure integer function owner_of(self, k) result(owner)
    class(diagnostics_t), intent(in) :: self
    integer, intent(in) :: k

    do owner = 1, size(self%asked) - 1
      if (k <= self%asked(owner)%last) return
    end do
  end function owner_of

  !> Histograms of the present step, in the order of the diagnostics.
  subroutine diagnostics_get_histograms(self, histograms)
    class(diagnostics_t), intent(in) :: self
    !> of no size where there are none
    type(histogram_t), allocatable, intent(out) :: histograms(:)
    type(histogram_t), allocatable :: one, longer(:)
    integer :: k

    allocate (histograms(0))
    if (.not. allocated(self%asked)) return
    do k = 1, size(self%asked)
      if (.not. self%asked(k)%measured) cycle
      call self%asked(k)%diagnostic%get_histogram(one)
      if (.not. allocated(one)) cycle
      allocate (longer(size(histograms) + 1))
      longer(1:size(histograms)) = histograms
      longer(size(longer)) = one
      call move_alloc(longer, histograms)
    end do
  end subroutine diagnostics_get_histograms

  !> Give back what is held.
  subroutine diagnostics_free(self)
    class(diagnostics_t), intent(inout) :: self

    if (allocated(self%asked)) deallocate (self%asked)
    if (allocated(self%name)) deallocate (self%name)
    if (allocated(self%value)) deallocate (self%value)
    self%n_columns = 0
  end subroutine diagnostics_free

end module gravier_diagnostics
