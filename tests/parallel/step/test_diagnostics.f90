!> Diagnostics of a test's own.
module own_diagnostics
  use gravier_kinds, only: dp, i8
  use gravier_decomposition, only: decomposition_t
  use gravier_physics, only: physics_t
  use gravier_diagnostic, only: diagnostic_t, diagnostic_features_t, solved_step_t, column_list_t, histogram_t, &
    & in_written_steps
  implicit none
  private
  public :: counter_t, least_t

  !> Counts how often it is called, and the free grains that it sees.
  type, extends(diagnostic_t) :: counter_t
    integer :: begun = 0, taken = 0, measured = 0
    integer(i8) :: free_grains = 0
  contains
    procedure, nopass :: features => counter_features
    procedure :: begin => counter_begin
    procedure :: take_step => counter_take_step
    procedure :: measure => counter_measure
    procedure :: columns => counter_columns
    procedure :: get_histogram => counter_get_histogram
  end type counter_t

  !> One with what every diagnostic must have, and nothing else.
  type, extends(diagnostic_t) :: least_t
    real(dp) :: time = -1.0_dp
  contains
    procedure, nopass :: features => least_features
    procedure :: measure => least_measure
    procedure :: columns => least_columns
  end type least_t

contains

  pure function counter_features() result(features)
    type(diagnostic_features_t) :: features
    features%key = "counter"
    features%measures = in_written_steps
  end function counter_features

  subroutine counter_begin(self, decomposition, physics)
    class(counter_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics

    associate (unused => physics)
    end associate
    self%begun = self%begun + decomposition%nd
  end subroutine counter_begin

  subroutine counter_take_step(self, step)
    class(counter_t), intent(inout) :: self
    type(solved_step_t), intent(in) :: step
    self%taken = self%taken + 1
    self%free_grains = step%n_free
  end subroutine counter_take_step

  subroutine counter_measure(self, step)
    class(counter_t), intent(inout) :: self
    type(solved_step_t), intent(in) :: step
    self%measured = self%measured + 1
    self%free_grains = step%n_free
  end subroutine counter_measure

  subroutine counter_columns(self, list)
    class(counter_t), intent(in) :: self
    type(column_list_t), intent(inout) :: list
    call list%add("begun", real(self%begun, dp))
    call list%add("taken", real(self%taken, dp))
    call list%add("measured", real(self%measured, dp))
  end subroutine counter_columns

  subroutine counter_get_histogram(self, histogram)
    class(counter_t), intent(in) :: self
    type(histogram_t), allocatable, intent(out) :: histogram

    allocate (histogram)
    histogram%name = "calls"
    histogram%bin_width = 0.5_dp
    allocate (histogram%counts(2))
    histogram%counts(1) = self%taken
    histogram%counts(2) = self%measured
  end subroutine counter_get_histogram

  pure function least_features() result(features)
    type(diagnostic_features_t) :: features
    features%key = "least"
  end function least_features

  subroutine least_measure(self, step)
    class(least_t), intent(inout) :: self
    type(solved_step_t), intent(in) :: step
    self%time = step%time
  end subroutine least_measure

  subroutine least_columns(self, list)
    class(least_t), intent(in) :: self
    type(column_list_t), intent(inout) :: list
    call list%add("start_of_step", self%time)
  end subroutine least_columns

end module own_diagnostics

!> Diagnostics as a whole: the registry, what is asked for and what is not, when each is called, columns, histograms and states.
program test_diagnostics
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_diagnostic, only: diagnostic_features_t, column_list_t, histogram_t, solved_step_t, in_each_step, in_written_steps
  use gravier_diagnostic_registry, only: diagnostic_holder_t, registered_diagnostics, diagnostic_place
  use gravier_diagnostics, only: diagnostics_t
  use gravier_boundary_forces, only: boundary_forces_t
  use gravier_boundary_moments, only: boundary_moments_t
  use gravier_tracked_bodies, only: tracked_bodies_t
  use gravier_contact_structure, only: contact_structure_t
  use gravier_simulation, only: simulation_t, step_figures_t
  use own_diagnostics, only: counter_t, least_t
  use gravier_test_simulations, only: make_scene
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  character(len=*), parameter :: case_text = "&scene bodies = 'lattice', lattice_count = 3, 2, radius_min = 0.1, "// &
    & "radius_max = 0.1 / &boundary shape = 'plane', normal = 0, 1, name = 'a,b""c' / &time step = 0.01, steps = 9 / "// &
    & "&solver method = 'nscdd' / &decomposition subdomains = 2 /"
  type(communicator_t), target :: comm

  call start_parallel()
  call comm%init()
  call test_registry()
  call test_columns()
  call test_calls()
  call test_histograms()
  call test_asked()
  call test_boundary_forces()
  call test_tracked_bodies()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  subroutine advance(sim)
    type(simulation_t), intent(inout) :: sim
    type(step_figures_t) :: figures
    type(error_t), allocatable :: error

    call sim%advance(figures, error)
    call check(.not. allocated(error), "a step is made")
  end subroutine advance

  !> Each diagnostic is found by its key, and says what it should.
  subroutine test_registry()
    type(diagnostic_holder_t), allocatable :: all_kinds(:)
    type(diagnostic_features_t) :: features
    integer(i8), allocatable :: words(:), again(:)
    integer :: k

    call registered_diagnostics(all_kinds)
    call check(size(all_kinds) >= 4, "the diagnostics there are")
    do k = 1, size(all_kinds)
      features = all_kinds(k)%diagnostic%features()
      call check(features%key /= "" .and. features%meaning /= "", "a key and its meaning")
      call check_equal(diagnostic_place(trim(features%key)), k, "no other one has the key "//features%key)
      call check(features%measures == in_each_step .or. features%measures == in_written_steps, "when it measures")
      call check((features%n_words > 0) .eqv. (features%array /= "" .and. features%record /= ""), "its words have names")
      ! a state goes there and back
      allocate (words(features%n_words), again(features%n_words))
      call all_kinds(k)%diagnostic%get_state(words)
      call all_kinds(k)%diagnostic%set_state(words)
      call all_kinds(k)%diagnostic%get_state(again)
      call check(all(words == again), "state of "//features%key)
      deallocate (words, again)
    end do
    call check_equal(diagnostic_place("nothing"), 0, "no diagnostic has that key")
  end subroutine test_registry

  !> Lists grow, and tensors go row by row.
  subroutine test_columns()
    type(column_list_t) :: list
    real(dp) :: tensor(2, 2)
    integer :: k

    do k = 1, 50
      call list%add("column "//achar(32 + k), real(k, dp))
    end do
    call check_equal(list%n, 50, "columns")
    call check_equal(trim(list%name(17)), "column 1", "a name")
    do k = 1, 50
      call check_close(list%value(k), real(k, dp), 0.0_dp, "a value")
    end do
    call list%clear()
    tensor(1, :) = [1.0_dp, 2.0_dp]
    tensor(2, :) = [3.0_dp, 4.0_dp]
    call list%add_tensor("t", tensor)
    call check_equal(list%n, 4, "entries of a tensor")
    call check_equal(trim(list%name(2))//" "//trim(list%name(3)), "t_xy t_yx", "row by row")
    call check_close(list%value(2), 2.0_dp, 0.0_dp, "the first row comes first")
  end subroutine test_columns

  !> Diagnostics of one's own: `begin` once, `take_step` in each step, `measure` as each says. A column of written steps is none of
  !> the history, and is in the results of the steps that are written alone.
  subroutine test_calls()
    type(simulation_t) :: sim
    type(diagnostic_holder_t) :: list(3)
    type(histogram_t), allocatable :: histograms(:)
    integer :: k

    call make_scene(comm, case_text//" &output every = 2 /", sim)
    allocate (list(1)%diagnostic, source=counter_t())
    allocate (list(2)%diagnostic, source=boundary_moments_t())
    allocate (list(3)%diagnostic, source=least_t())
    call sim%diagnostics%take(sim%decomposition, sim%physics, list, [.true., .false., .true.])
    call check_equal(size(sim%diagnostics%asked), 2, "two of three are asked for")
    call check(allocated(list(2)%diagnostic), "the other one is left")
    call check_equal(sim%diagnostics%n_columns, 4, "their columns")
    call check_equal(sim%diagnostics%place("least"), 2, "place by key")
    call check_equal(sim%diagnostics%place("energy"), 0, "not asked for")
    do k = 1, 3
      call check(.not. sim%diagnostics%in_results(k), "nothing is measured before the first step")
      call check(.not. sim%diagnostics%in_history(k), "columns of written steps are not in the history")
    end do
    call check(sim%diagnostics%in_history(4), "those of each step are")
    call advance(sim)
    call check_values(sim, 1.0_dp, 0.0_dp, 0.0_dp)
    call check(.not. sim%diagnostics%in_results(1) .and. sim%diagnostics%in_results(4), "step 1 is not written")
    call advance(sim)
    call check_values(sim, 2.0_dp, 1.0_dp, 0.01_dp)
    call check(sim%diagnostics%in_results(1) .and. sim%diagnostics%in_results(4), "step 2 is")
    call advance(sim)
    call check_values(sim, 3.0_dp, 1.0_dp, 0.02_dp)
    call check(.not. sim%diagnostics%in_results(1), "and step 3 is not")
    select type (item => sim%diagnostics%asked(1)%diagnostic)
    type is (counter_t)
      call check_equal(item%free_grains, 6_i8, "the step shows what there is")
    end select
    call sim%diagnostics%get_histograms(histograms)
    call check_equal(size(histograms), 0, "neither has a histogram")
    call sim%diagnostics%free()
    call check_equal(sim%diagnostics%n_columns, 0, "nothing is left")
    call sim%free()
  end subroutine test_calls

  !> The columns of test_calls.
  subroutine check_values(sim, taken, measured, time)
    type(simulation_t), intent(in) :: sim
    real(dp), intent(in) :: taken, measured, time

    call check_close(sim%diagnostics%value(1), 2.0_dp, 0.0_dp, "begun once, in two dimensions")
    call check_close(sim%diagnostics%value(2), taken, 0.0_dp, "steps taken")
    call check_close(sim%diagnostics%value(3), measured, 0.0_dp, "steps measured")
    call check_close(sim%diagnostics%value(4), time, 1.0e-15_dp, "start of the step")
  end subroutine check_values

  !> Histograms are those of the present step, in the order of the diagnostics.
  subroutine test_histograms()
    type(simulation_t) :: sim
    type(diagnostic_holder_t) :: list(2)
    type(histogram_t), allocatable :: histograms(:)

    call make_scene(comm, case_text//" &output every = 2 /", sim)
    allocate (list(1)%diagnostic, source=contact_structure_t())
    allocate (list(2)%diagnostic, source=counter_t())
    call sim%diagnostics%take(sim%decomposition, sim%physics, list, [.true., .true.])
    call sim%diagnostics%get_histograms(histograms)
    call check_equal(size(histograms), 0, "no histogram before the first step")
    call advance(sim)
    call sim%diagnostics%get_histograms(histograms)
    call check_equal(size(histograms), 1, "step 1 is not written")
    call check_equal(histograms(1)%name, "force_histogram", "the histogram of each step")
    call advance(sim)
    call sim%diagnostics%get_histograms(histograms)
    call check_equal(size(histograms), 2, "step 2 is")
    call check_equal(histograms(1)%name//" "//histograms(2)%name, "force_histogram calls", "histograms in their order")
    call check_close(histograms(2)%bin_width, 0.5_dp, 0.0_dp, "width of the bins of the second one")
    call check_equal(histograms(2)%counts(1), 2_i8, "its first bin")
    call check_equal(histograms(2)%counts(2), 1_i8, "its second bin")
    call sim%free()
  end subroutine test_histograms

  !> What is not asked for is not there, whatever else is.
  subroutine test_asked()
    type(simulation_t) :: sim
    type(diagnostics_t) :: unused
    type(histogram_t), allocatable :: histograms(:)
    integer :: k
    logical :: of_stress

    call make_scene(comm, case_text, sim)
    call check_equal(size(sim%diagnostics%asked), 0, "none is asked for")
    call check_equal(sim%diagnostics%n_columns, 0, "and there are no columns")
    call advance(sim)
    call check_equal(sim%diagnostics%n_columns, 0, "nor after a step")
    call sim%free()
    call make_scene(comm, case_text//" &output stress = T, structure = T /", sim)
    call check_equal(size(sim%diagnostics%asked), 2, "two are asked for")
    call check_equal(sim%diagnostics%n_columns, 7 + 13, "columns of stress and of structure")
    call check_equal(trim(sim%diagnostics%name(1)), "stress_xx", "in the order of the registry")
    call advance(sim)
    of_stress = .true.
    do k = 1, sim%diagnostics%n_columns
      of_stress = of_stress .and. sim%diagnostics%in_history(k) .and. sim%diagnostics%in_results(k)
    end do
    call check(of_stress, "each step measures them, for history and results")
    call sim%diagnostics%get_histograms(histograms)
    call check_equal(size(histograms), 1, "one histogram")
    call check_equal(histograms(1)%name, "force_histogram", "of the normal forces")
    call check_close(histograms(1)%bin_width, 0.1_dp, 0.0_dp, "width of its bins")
    call sim%free()
    call check_equal(unused%place("stress"), 0, "one that was never made has none")
    call unused%get_histograms(histograms)
    call check_equal(size(histograms), 0, "and no histogram")
  end subroutine test_asked

  !> Names as columns can have them; forces and places of the step, which hold for no scene as a whole.
  subroutine test_boundary_forces()
    type(simulation_t) :: sim
    real(dp) :: weight, place(3)
    integer :: k

    call make_scene(comm, case_text//" &output boundary_forces = T /", sim)
    call check_equal(sim%diagnostics%n_columns, 4*size(sim%decomposition%boundaries), "force and place of each boundary")
    k = 4*size(sim%decomposition%boundaries) - 3
    call check_equal(trim(sim%diagnostics%name(k)), "force_x:a_b_c", "no comma and no quote")
    call check_equal(trim(sim%diagnostics%name(k + 3)), "position_y:a_b_c", "places behind forces")
    do while (sim%step < 9)
      call advance(sim)
    end do
    weight = sim%boundary_impulses(2, size(sim%decomposition%boundaries))/sim%physics%h
    call check_close(sim%diagnostics%value(k + 1), weight, 0.0_dp, "impulse over step")
    call sim%decomposition%boundaries(size(sim%decomposition%boundaries))%find_place(place)
    call check_close(sim%diagnostics%value(k + 3), place(2), 0.0_dp, "its place")
    call check(sim%diagnostics%in_history(k) .and. .not. sim%diagnostics%in_results(k), "they are in the history alone")
    call sim%free()
    call make_scene(comm, case_text// &
      & " &boundary shape = 'plane', normal = 0, 1, point = 1, -9, velocity = 0.5, 0, name = 'belt' / "// &
      & "&output boundary_forces = T /", sim)
    call advance(sim)
    k = 4*size(sim%decomposition%boundaries) - 1
    call check_equal(trim(sim%diagnostics%name(k)), "position_x:belt", "a boundary that moves")
    call check_close(sim%diagnostics%value(k), 1.005_dp, 1.0e-15_dp, "its place is that of the end of the step")
    call sim%free()
    call make_scene(comm, case_text//" &output boundary_forces = T, boundary_moments = T /", sim)
    k = 4*size(sim%decomposition%boundaries) + 1
    call check_equal(sim%diagnostics%n_columns, k - 1 + size(sim%decomposition%boundaries), "a moment of each boundary")
    call check_equal(trim(sim%diagnostics%name(sim%diagnostics%n_columns)), "moment_z:a_b_c", "about the third axis")
    call sim%free()
  end subroutine test_boundary_forces

  !> A body that is found again where it went, and one that the scene does not have.
  subroutine test_tracked_bodies()
    type(simulation_t), target :: sim
    type(tracked_bodies_t) :: tracked
    type(column_list_t) :: list
    type(solved_step_t) :: step
    integer :: s, k

    call make_scene(comm, case_text, sim)
    step%decomposition => sim%decomposition
    allocate (tracked%id(2))
    tracked%id(:) = [4_i8, 99_i8]
    do s = 1, size(sim%decomposition%owned)
      associate (owned => sim%decomposition%owned(s))
        do k = 1, owned%n
          owned%velocity(:, k) = 0.0_dp
          owned%velocity(1, k) = real(owned%id(k), dp)
        end do
      end associate
    end do
    call tracked%begin(sim%decomposition, sim%physics)
    call tracked%columns(list)
    call check_equal(list%n, 2*(2 + sim%decomposition%nv), "columns")
    call check_equal(trim(list%name(1))//" "//trim(list%name(4))//" "//trim(list%name(list%n)), &
      & "body_x:4 body_vy:4 body_vy:99", "names")
    call check_close(list%value(3), 4.0_dp, 0.0_dp, "its velocity")
    call check(ieee_is_nan(list%value(list%n)), "a body that is not there")
    ! two bodies change their places
    do s = 1, size(sim%decomposition%owned)
      associate (owned => sim%decomposition%owned(s))
        do k = 1, owned%n
          if (owned%id(k) == 4 .or. owned%id(k) == 1) owned%id(k) = 5_i8 - owned%id(k)
        end do
      end associate
    end do
    call tracked%measure(step)
    call list%clear()
    call tracked%columns(list)
    call check_close(list%value(3), 1.0_dp, 0.0_dp, "it is found in another place")
    call sim%free()
    call test_tracked_forces()
  end subroutine test_tracked_bodies

  !> A disk between the floor and one above it has the difference of both forces, and its momentum changes by it.
  subroutine test_tracked_forces()
    type(simulation_t), target :: sim
    real(dp) :: before, mass, largest
    integer :: k, step

    call make_scene(comm, case_text//" &output tracked_bodies = 2, 99, tracked_forces = T / &insertion name = 'more', "// &
      & "radius = 0.1, rate = 1.0, lower = 0.1, 2, upper = 0.5, 3 /", sim)
    call check_equal(sim%diagnostics%n_columns, 2*(2 + 2*sim%decomposition%nv), "columns of forces, too")
    k = 3 + sim%decomposition%nv
    call check_equal(trim(sim%diagnostics%name(k)), "body_fx:2", "the first of them")
    mass = acos(-1.0_dp)*0.01_dp*sim%config%scene%density
    before = 0.0_dp
    largest = 0.0_dp
    do step = 1, 9
      call advance(sim)
      call check_close(sim%diagnostics%value(k + 1), mass*((sim%diagnostics%value(4) - before)/0.01_dp - &
        & sim%physics%gravity(2)), 1.0e-11_dp*mass, "its momentum changes by the force and its weight")
      before = sim%diagnostics%value(4)
      largest = max(largest, sim%diagnostics%value(k + 1))
    end do
    call check(largest > 0.1_dp*mass, "the floor holds it")
    call check(ieee_is_nan(sim%diagnostics%value(sim%diagnostics%n_columns)), "a body that is not there has no force")
    call sim%free()
  end subroutine test_tracked_forces

end program test_diagnostics

