!> The outputs of a run, one by one: which are wanted, when each is due, what the files hold of a scene whose figures are known, and
!> what is left of the files of an earlier run. The tables behind the files have tests of their own.
program test_outputs
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_text, only: to_text, text_from
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_csv_table, only: csv_table_t
  use gravier_hdf5_file, only: h5_file_t
  use gravier_bodies_file, only: bodies_data_t, read_bodies
  use gravier_fclib_file, only: fclib_local_t, fclib_global_t, read_fclib
  use gravier_solve_report, only: solve_converged, solve_exhausted
  use gravier_config, only: config_t, parse_config
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_output, only: output_t, after_solve, of_each_step, of_states, of_checkpoints, of_end
  use gravier_output_registry, only: output_holder_t, registered_outputs
  use gravier_history_output, only: history_output_t
  use gravier_trace_output, only: trace_output_t
  use gravier_results_output, only: results_output_t
  use gravier_picture_output, only: picture_output_t
  use gravier_problem_output, only: problem_output_t
  use gravier_checkpoint_output, only: checkpoint_output_t
  use gravier_final_bodies, only: final_bodies_output_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  character(len=*), parameter :: newline = new_line("a")
  !> a scene of two disks, one upon the other on a floor
  character(len=*), parameter :: scene = "&scene bodies = 'column', column_count = 2, radius = 0.5, mass = 2, "// &
    & "gravity = 0, -10 /"//newline//"&time step = 0.01, steps = 7 /"//newline//"&solver method = 'nscdd', sweeps = 3"
  !> what solves the contacts of a column to rounding
  character(len=*), parameter :: exact = "&solver criterion = 'residual', tolerance = 1e-12, check_every = 1, "// &
    & "method = 'nscdd', acceleration = 'none' /"
  type(communicator_t), target :: comm

  call start_parallel()
  call comm%init()
  call test_wanted()
  call test_history()
  call test_columns_of_diagnostics()
  call test_trace()
  call test_results()
  call test_pictures()
  call test_final_bodies()
  call test_problem()
  call test_checkpoint()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  subroutine parse(text, config)
    character(len=*), intent(in) :: text
    type(config_t), intent(out) :: config
    type(error_t), allocatable :: error

    call parse_config("case", text, config, error)
    call expect_none(error, "the input is in order")
  end subroutine parse

  subroutine make(text, simulation)
    character(len=*), intent(in) :: text
    type(simulation_t), intent(inout) :: simulation
    type(config_t) :: config
    type(error_t), allocatable :: error

    call parse(text, config)
    call simulation%init(comm, config, error)
    call expect_none(error, "the scene is made")
  end subroutine make

  !> The program goes no further where there is an error.
  subroutine expect_none(error, name)
    type(error_t), allocatable, intent(inout) :: error
    character(len=*), intent(in) :: name

    call check(.not. allocated(error), name)
    if (.not. allocated(error)) return
    print "(a)", error%message
    call finish_checks()
  end subroutine expect_none

  subroutine advance(simulation, figures)
    type(simulation_t), intent(inout) :: simulation
    type(step_figures_t), intent(out) :: figures
    type(error_t), allocatable :: error

    call simulation%advance(figures, error)
    call expect_none(error, "a step is made")
  end subroutine advance

  !> Each kind of output asks for nothing but its own key; a stage and a schedule are set by `open`.
  subroutine test_wanted()
    ! in the order of the registry
    character(len=*), parameter :: by_default = "checkpoint history results"
    type(simulation_t) :: simulation

    call check_equal(wanted_by(""), by_default, "outputs of every run")
    call check_equal(wanted_by("vtk = T"), "checkpoint history results picture", "pictures on request")
    call check_equal(wanted_by("trace = T"), "checkpoint history trace results", "a trace on request")
    call check_equal(wanted_by("fclib_step = 3"), "checkpoint history results problem", "a contact problem on request")
    call check_equal(wanted_by("final_bodies = T"), "checkpoint history results bodies", "final bodies on request")
    call make(scene//" /"//newline//"&output every = 3, vtk = T, trace = T, fclib_step = 5, final_bodies = T, "// &
      & "checkpoint_every = 4 /", simulation)
    call check_schedule(simulation, 1, of_checkpoints, " 0 4", "checkpoint")
    call check_schedule(simulation, 4, of_states, " 0 3 6 7", "results")
    call check_schedule(simulation, 5, of_states, " 0 3 6 7", "pictures")
    call check_schedule(simulation, 2, of_each_step, " 0 1 2 3 4 5 6 7", "history")
    call check_schedule(simulation, 3, of_each_step, " 0 1 2 3 4 5 6 7", "trace")
    call check_schedule(simulation, 6, after_solve, " 5", "contact problem")
    call check_schedule(simulation, 7, of_end, "", "final bodies")
    call simulation%free()
  end subroutine test_wanted

  !> Words of the outputs that an input asks for.
  function wanted_by(keys) result(words)
    !> of &output
    character(len=*), intent(in) :: keys
    character(len=:), allocatable :: words
    type(output_holder_t), allocatable :: all_kinds(:)
    type(config_t) :: config
    integer :: k

    call parse(scene//" /"//newline//"&output "//keys//" /", config)
    call registered_outputs(all_kinds)
    words = ""
    do k = 1, size(all_kinds)
      if (.not. all_kinds(k)%output%wanted(config)) cycle
      select type (output => all_kinds(k)%output)
      type is (checkpoint_output_t)
        words = words//" checkpoint"
      type is (results_output_t)
        words = words//" results"
      type is (picture_output_t)
        words = words//" picture"
      type is (history_output_t)
        words = words//" history"
      type is (trace_output_t)
        words = words//" trace"
      type is (problem_output_t)
        words = words//" problem"
      type is (final_bodies_output_t)
        words = words//" bodies"
      end select
    end do
    words = text_from(words, 2)
  end function wanted_by

  !> Open the output of a place in the registry, and close it: its stage and the steps in which it is due.
  subroutine check_schedule(simulation, place, stage, steps, name)
    type(simulation_t), intent(in) :: simulation
    integer, intent(in) :: place, stage
    character(len=*), intent(in) :: steps, name
    type(output_holder_t), allocatable :: all_kinds(:)
    type(error_t), allocatable :: error
    character(len=:), allocatable :: found
    integer :: step

    call registered_outputs(all_kinds)
    associate (output => all_kinds(place)%output)
      call check_equal(output%last, -1, name//": nothing is written")
      call output%open(simulation, "./", "gravier case", error)
      call check_equal(output%stage, stage, name//": stage")
      found = ""
      do step = 0, 7
        if (output%schedule%due(step)) found = found//" "//to_text(step)
      end do
      call check_equal(found, steps, name//": due")
      call output%finish(error)
    end associate
    call expect_none(error, name//": opened and closed")
  end subroutine check_schedule

  !> The next row of a table.
  subroutine next_row(table)
    type(csv_table_t), intent(inout) :: table
    type(error_t), allocatable :: error
    logical :: found

    call table%next_row(found, error)
    call check(found, "there is a row")
    call expect_none(error, "the row is in order")
  end subroutine next_row

  subroutine expect_end(table)
    type(csv_table_t), intent(inout) :: table
    type(error_t), allocatable :: error
    logical :: found

    call table%next_row(found, error)
    call check(.not. found, "there are no more rows")
    call expect_none(error, "the end is in order")
    call table%close()
  end subroutine expect_end

  !> A cell of the present row, by the name of its column.
  subroutine check_cell(table, name, expected)
    type(csv_table_t), intent(in) :: table
    character(len=*), intent(in) :: name
    real(dp), intent(in) :: expected
    type(error_t), allocatable :: error
    real(dp) :: value

    call check(table%column(name) > 0, "column "//name)
    if (table%column(name) == 0) return
    value = -huge(1.0_dp)
    call table%get_real(table%column(name), value, error)
    call expect_none(error, "a number: "//name)
    call check_close(value, expected, 0.0_dp, "column "//name)
  end subroutine check_cell

  !> Figures of a step that are all different.
  subroutine invent(figures)
    type(step_figures_t), intent(out) :: figures

    figures%contacts = 11
    figures%solve%status = solve_converged
    figures%solve%iterations = 13
    figures%solve%residual = 0.5_dp
    figures%solve%velocity_error = 0.25_dp
    figures%solve%velocity_scale = 0.125_dp
    figures%solve%jump = 0.0625_dp
    figures%solve%seconds = 17.5_dp
    figures%max_overlap = 1.5_dp
    figures%kinetic_energy = 2.5_dp
    figures%interface_statistics%bodies = 19
    figures%interface_statistics%neighbours = 23
    figures%interface_statistics%values = 29
    figures%interface_statistics%most_neighbours = 31
    figures%interface_statistics%most_values = 37
    figures%interface_statistics%ghosts = 41
    figures%left = 43
    figures%fast = 47
    figures%listed = .true.
    figures%asleep = 53
  end subroutine invent

  !> Each column of the history has the figure that it is named after. A run that goes on keeps the rows up to its step, one that
  !> begins keeps none.
  subroutine test_history()
    type(simulation_t) :: simulation
    type(step_figures_t) :: figures
    type(error_t), allocatable :: error
    type(csv_table_t) :: table

    call make(scene//" /", simulation)
    call write_rows(simulation, 1, 5)
    call write_rows(simulation, 1, 3)
    call table%open("history.csv", error)
    call expect_none(error, "the history")
    call check_equal(table%column_count(), 28, "columns")
    call next_row(table)
    call invent(figures)
    call check_cell(table, "step", 1.0_dp)
    call check_cell(table, "time", 0.25_dp)
    call check_cell(table, "contacts", 11.0_dp)
    call check_cell(table, "iterations", 13.0_dp)
    call check_cell(table, "sweeps", 39.0_dp)
    call check_cell(table, "residual", 0.5_dp)
    call check_cell(table, "velocity_error", 0.25_dp)
    call check_cell(table, "velocity_scale", 0.125_dp)
    call check_cell(table, "jump", 0.0625_dp)
    call check_cell(table, "max_overlap", 1.5_dp)
    call check_cell(table, "kinetic_energy", 2.5_dp)
    call check_cell(table, "wall_seconds", 3.5_dp)
    call check_cell(table, "interface_bodies", 19.0_dp)
    call check_cell(table, "converged", 1.0_dp)
    call check_cell(table, "grains", 2.0_dp)
    call check_cell(table, "left", 43.0_dp)
    call check_cell(table, "fast", 47.0_dp)
    call check_cell(table, "listed", 1.0_dp)
    call check_cell(table, "divided", 0.0_dp)
    call check_cell(table, "projected", 0.0_dp)
    call check_cell(table, "exchange_messages", 23.0_dp)
    call check_cell(table, "exchange_values", 29.0_dp)
    call check_cell(table, "most_messages", 31.0_dp)
    call check_cell(table, "most_values", 37.0_dp)
    call check_cell(table, "ghosts", 41.0_dp)
    call check_cell(table, "solve_seconds", 17.5_dp)
    call check_cell(table, "sleeping", 53.0_dp)
    call check_cell(table, "woken", 0.0_dp)
    ! the other answers of yes and no
    call next_row(table)
    call check_cell(table, "step", 2.0_dp)
    call check_cell(table, "converged", 0.0_dp)
    call check_cell(table, "listed", 0.0_dp)
    call check_cell(table, "divided", 1.0_dp)
    call check_cell(table, "projected", 0.0_dp)
    call check_cell(table, "woken", 0.0_dp)
    call next_row(table)
    call check_cell(table, "divided", 0.0_dp)
    call check_cell(table, "projected", 1.0_dp)
    call check_cell(table, "woken", 1.0_dp)
    call expect_end(table)
    ! step 2 was the last one before the checkpoint
    simulation%restarted = .true.
    call simulation%note_files("run.log,history.csv")
    simulation%step = 2
    call write_rows(simulation, 3, 4)
    call table%open("history.csv", error)
    call expect_none(error, "the history goes on")
    call next_row(table)
    call next_row(table)
    call check_cell(table, "step", 2.0_dp)
    call check_cell(table, "divided", 1.0_dp)
    call next_row(table)
    call check_cell(table, "step", 3.0_dp)
    call next_row(table)
    call check_cell(table, "step", 4.0_dp)
    call expect_end(table)
    call simulation%free()
  end subroutine test_history

  !> Write the history of the steps from `first` to `last`.
  subroutine write_rows(simulation, first, last)
    type(simulation_t), intent(inout) :: simulation
    integer, intent(in) :: first, last
    type(history_output_t) :: output
    type(step_figures_t) :: figures
    type(error_t), allocatable :: error
    integer :: k

    call output%open(simulation, "./", "gravier case", error)
    call expect_none(error, "the history is opened")
    do k = first, last
      simulation%step = k
      simulation%time = 0.25_dp*simulation%step
      call invent(figures)
      if (k > 1) then
        figures%solve%status = solve_exhausted
        figures%listed = .false.
        figures%divided = k == 2
        figures%projected = k > 2
        figures%tries = merge(2, 1, k > 2)
      end if
      call output%write(simulation, figures, 3.5_dp, error)
    end do
    call output%finish(error)
    call expect_none(error, "the history is written")
  end subroutine write_rows

  !> Diagnostics that are asked for have their columns behind the others.
  subroutine test_columns_of_diagnostics()
    type(simulation_t) :: simulation
    type(history_output_t) :: output
    type(step_figures_t) :: figures
    type(error_t), allocatable :: error
    type(csv_table_t) :: table
    integer :: k

    call make(scene//" /"//newline//"&output stress = T, boundary_forces = T /", simulation)
    do k = 1, simulation%diagnostics%n_columns
      simulation%diagnostics%value(k) = 100.0_dp + k
    end do
    call output%open(simulation, "./", "gravier case", error)
    call invent(figures)
    call output%write(simulation, figures, 3.5_dp, error)
    call output%finish(error)
    call expect_none(error, "a history with diagnostics")
    call table%open("history.csv", error)
    call expect_none(error, "it can be read")
    call check_equal(table%column_count(), 28 + simulation%diagnostics%n_columns, "columns with diagnostics")
    call next_row(table)
    do k = 1, simulation%diagnostics%n_columns
      call check_cell(table, trim(simulation%diagnostics%name(k)), 100.0_dp + k)
    end do
    call expect_end(table)
    call simulation%free()
  end subroutine test_columns_of_diagnostics

  !> A row a check; the error where it is the criterion.
  subroutine test_trace()
    type(simulation_t) :: simulation
    type(csv_table_t) :: table
    type(error_t), allocatable :: error

    call make(scene//" /"//newline//"&output trace = T /", simulation)
    call write_trace(simulation)
    call table%open("trace.csv", error)
    call expect_none(error, "the trace")
    call check_equal(table%column_count(), 5, "columns of a trace")
    call next_row(table)
    call check_cell(table, "step", 4.0_dp)
    call check_cell(table, "iteration", 1.0_dp)
    call check_cell(table, "residual", 12.5_dp)
    call check_cell(table, "velocity_error", 15.5_dp)
    call check_cell(table, "jump", 13.5_dp)
    call next_row(table)
    call check_cell(table, "step", 4.0_dp)
    call check_cell(table, "iteration", 21.0_dp)
    call check_cell(table, "jump", 23.5_dp)
    call expect_end(table)
    call simulation%free()
    call make(scene//", criterion = 'error' /"//newline//"&output trace = T /", simulation)
    call write_trace(simulation)
    call table%open("trace.csv", error)
    call expect_none(error, "the trace with errors")
    call check_equal(table%column_count(), 6, "columns of a trace with errors")
    call next_row(table)
    call check_cell(table, "error", 14.5_dp)
    call check_cell(table, "jump", 13.5_dp)
    call table%close()
    call simulation%free()
  end subroutine test_trace

  !> Write a trace of two checks, in a table with room for three.
  subroutine write_trace(simulation)
    type(simulation_t), intent(inout) :: simulation
    type(trace_output_t) :: output
    type(step_figures_t) :: figures
    type(error_t), allocatable :: error
    integer :: k, n

    simulation%step = 4
    figures%solve%n_trace = 2
    allocate (figures%solve%trace(6, 3), source=0.0_dp)
    do n = 1, 2
      figures%solve%trace(1, n) = 20*n - 19
      do k = 2, 6
        figures%solve%trace(k, n) = 10*n + k + 0.5_dp
      end do
    end do
    call output%open(simulation, "./", "gravier case", error)
    call output%write(simulation, figures, 0.0_dp, error)
    call output%finish(error)
    call expect_none(error, "a trace is written")
  end subroutine write_trace

  subroutine open_file(path, file)
    character(len=*), intent(in) :: path
    type(h5_file_t), intent(inout) :: file
    type(error_t), allocatable :: error

    call file%open(comm, path, error)
    call expect_none(error, path)
  end subroutine open_file

  !> Whether a group has some members, or has none of them.
  subroutine check_members(file, group, names, has)
    type(h5_file_t), intent(inout) :: file
    !> names with blanks between
    character(len=*), intent(in) :: group, names
    logical, intent(in) :: has
    logical :: found
    integer :: first, last

    first = 1
    do while (first <= len(names))
      last = first + index(names(first:)//" ", " ") - 2
      found = file%exists(group//"/"//names(first:last))
      call check(found .eqv. has, group//"/"//names(first:last))
      first = last + 2
    end do
  end subroutine check_members

  subroutine check_attribute(file, path, name, expected)
    type(h5_file_t), intent(inout) :: file
    character(len=*), intent(in) :: path, name
    real(dp), intent(in) :: expected
    type(error_t), allocatable :: error
    real(dp) :: value

    value = -huge(1.0_dp)
    call file%read_attribute(path, name, value, error)
    call expect_none(error, path//", "//name)
    call check_close(value, expected, 0.0_dp, path//", "//name)
  end subroutine check_attribute

  !> A component of a row of a dataset of reals.
  real(dp) function number_of(file, path, row, component) result(number)
    type(h5_file_t), intent(inout) :: file
    character(len=*), intent(in) :: path
    integer, intent(in) :: row, component
    type(error_t), allocatable :: error
    real(dp), allocatable :: columns(:, :), values(:)

    if (file%columns(path) > 0) then
      allocate (columns(file%columns(path), 1), source=-huge(1.0_dp))
      call file%read_rows(path, int(row - 1, i8), columns, error)
      number = columns(component, 1)
    else
      allocate (values(1), source=-huge(1.0_dp))
      call file%read_rows(path, int(row - 1, i8), values, error)
      number = values(1)
    end if
    call expect_none(error, path)
  end function number_of

  !> A row of a dataset of integers.
  integer function whole_of(file, path, row) result(number)
    type(h5_file_t), intent(inout) :: file
    character(len=*), intent(in) :: path
    integer, intent(in) :: row
    type(error_t), allocatable :: error
    integer(i8) :: values(1)

    values(1) = -1
    call file%read_rows(path, int(row - 1, i8), values, error)
    call expect_none(error, path)
    number = int(values(1))
  end function whole_of

  !> What was run, the boundaries, and states with the contacts where they are known and asked for, and with the figures of the
  !> scene as a whole. Those of each boundary are in its table alone.
  subroutine test_results()
    type(simulation_t) :: simulation
    type(results_output_t) :: output
    type(step_figures_t) :: figures
    type(error_t), allocatable :: error
    type(h5_file_t) :: file
    character(len=:), allocatable :: text
    integer(i8) :: dimension

    call make(scene//" /"//newline//"&output contacts = T, structure = T, boundary_forces = T /"//newline// &
      & "&boundary shape = 'segment', point = 3, 1, end = 4, 1, name = 'bar' /", simulation)
    call output%open(simulation, "./", "gravier case", error)
    call output%write(simulation, figures, 0.0_dp, error)
    call check_equal(simulation%last_written, 0, "the start is written")
    call advance(simulation, figures)
    call output%write(simulation, figures, 0.0_dp, error)
    call check_equal(simulation%last_written, 1, "step 1 is written")
    call output%finish(error)
    call expect_none(error, "results are written")
    call open_file("results.h5", file)
    call file%read_attribute("/run", "command", text, error)
    call check_equal(text, "gravier case", "command")
    call file%read_attribute("/run", "dimension", dimension, error)
    call check_equal(dimension, 2_i8, "dimension")
    call expect_none(error, "what was run")
    call check_members(file, "/boundaries", "id name shape normal", .true.)
    call check_close(number_of(file, "/boundaries/normal", 1, 2), 1.0_dp, 0.0_dp, "normal of the floor")
    call check_close(abs(number_of(file, "/boundaries/normal", 2, 1)) + abs(number_of(file, "/boundaries/normal", 2, 2)), 0.0_dp, &
      & 0.0_dp, "a segment has none")
    call check_close(number_of(file, "/steps/0/boundaries/edges", 2, 1), 1.0_dp, 0.0_dp, "its edge")
    call check_members(file, "/steps/0/boundaries", "axis axes", .false.)
    call check_members(file, "/steps/0", "bodies boundaries", .true.)
    ! no contact and no figure is known at the start
    call check_members(file, "/steps/0", "contacts diagnostics", .false.)
    call check(.not. file%has_attribute("/steps/0", "velocity_error"), "nor is the accuracy")
    call check_attribute(file, "/steps/1", "time", 0.01_dp)
    call check_attribute(file, "/steps/1", "velocity_error", simulation%tally%velocity_error)
    call check_attribute(file, "/steps/1", "velocity_scale", simulation%tally%velocity_scale)
    call check_attribute(file, "/steps/1/diagnostics", "coordination", 1.5_dp)
    call check(.not. file%has_attribute("/steps/1/diagnostics", "force_y:bar"), "no force of a boundary among them")
    call check_attribute(file, "/steps/1/diagnostics/force_histogram", "bin_width", 0.1_dp)
    call check_equal(whole_of(file, "/steps/1/contacts/candidate", 1), 1, "the first contact")
    call check_equal(whole_of(file, "/steps/1/contacts/antagonist", 1), 2, "is that of the disks")
    call check_equal(whole_of(file, "/steps/1/contacts/antagonist", 2), 3, "the second one that with the floor")
    call check_members(file, "/steps/1/contacts", "normal impulse gap", .true.)
    call check_members(file, "/steps/1/contacts", "moment", .false.)
    call check_close(number_of(file, "/steps/1/bodies/position", 2, 2), simulation%decomposition%owned(1)%position(2, 2), 0.0_dp, &
      & "place of a disk")
    call check_close(number_of(file, "/steps/1/boundaries/force", 1, 2), simulation%boundary_impulses(2, 1)/0.01_dp, 0.0_dp, &
      & "force on the floor")
    call file%leave()
    call simulation%free()
    call test_results_without_contacts()
  end subroutine test_results

  !> Nothing is there that is not asked for.
  subroutine test_results_without_contacts()
    type(simulation_t) :: simulation
    type(results_output_t) :: output
    type(step_figures_t) :: figures
    type(error_t), allocatable :: error
    type(h5_file_t) :: file

    call make(scene//" /"//newline//"&output contacts = F /", simulation)
    call output%open(simulation, "./", "gravier case", error)
    call advance(simulation, figures)
    call output%write(simulation, figures, 0.0_dp, error)
    call output%finish(error)
    call expect_none(error, "results without contacts are written")
    call open_file("results.h5", file)
    call check_members(file, "/steps/1", "bodies boundaries", .true.)
    ! neither contacts nor diagnostics are asked for, and the start was not written
    call check_members(file, "/steps/1", "contacts diagnostics", .false.)
    call check_members(file, "/steps", "0", .false.)
    call file%leave()
    call simulation%free()
  end subroutine test_results_without_contacts

  !> Points with vectors of three components, in 2D in the plane z = 0; lines from candidate to antagonist.
  subroutine test_pictures()
    type(simulation_t) :: simulation
    type(picture_output_t) :: output
    type(step_figures_t) :: figures
    type(error_t), allocatable :: error
    type(h5_file_t) :: file

    call make("&scene bodies = 'column', column_count = 2, radius = 0.5, mass = 2, gravity = 0, -10, friction = 0.5, "// &
      & "wall_friction = 0.5 /"//newline//"&time step = 0.01, steps = 7 /"//newline// &
      & "&output vtk = T, contacts = T /"//newline//exact, simulation)
    simulation%decomposition%owned(1)%velocity(1, 1) = 0.25_dp
    simulation%decomposition%owned(1)%velocity(2, 1) = 0.5_dp
    simulation%decomposition%owned(1)%velocity(3, 1) = 0.75_dp
    call output%open(simulation, "./", "gravier case", error)
    call output%write(simulation, figures, 0.0_dp, error)
    simulation%decomposition%owned(1)%velocity(:, 1) = 0.0_dp
    call advance(simulation, figures)
    call output%write(simulation, figures, 0.0_dp, error)
    call output%finish(error)
    call expect_none(error, "pictures are written")
    call open_file("bodies.vtkhdf", file)
    call check_close(number_of(file, "/VTKHDF/PointData/velocity", 1, 1), 0.25_dp, 0.0_dp, "velocity along x")
    call check_close(number_of(file, "/VTKHDF/PointData/velocity", 1, 2), 0.5_dp, 0.0_dp, "velocity along y")
    call check_close(number_of(file, "/VTKHDF/PointData/velocity", 1, 3), 0.0_dp, 0.0_dp, "none along z")
    call check_close(number_of(file, "/VTKHDF/PointData/spin", 1, 1), 0.0_dp, 0.0_dp, "no spin about x")
    call check_close(number_of(file, "/VTKHDF/PointData/spin", 1, 3), 0.75_dp, 0.0_dp, "spin about z")
    call check_close(number_of(file, "/VTKHDF/PointData/radius", 2, 1), 0.5_dp, 0.0_dp, "radius")
    call check_equal(whole_of(file, "/VTKHDF/PointData/id", 2), 2, "identifier")
    call check_equal(whole_of(file, "/VTKHDF/PointData/subdomain", 2), 1, "subdomain")
    call check_close(number_of(file, "/VTKHDF/Points", 1, 3), 0.0_dp, 0.0_dp, "the plane z = 0")
    ! places are points, and nothing else
    call check_members(file, "/VTKHDF/PointData", "position", .false.)
    call check_close(number_of(file, "/VTKHDF/Steps/Values", 2, 1), 0.01_dp, 0.0_dp, "time of step 1")
    call file%leave()
    call open_file("contacts.vtkhdf", file)
    call check_close(number_of(file, "/VTKHDF/Steps/Values", 1, 1), 0.01_dp, 0.0_dp, "contacts are not known at the start")
    call check_members(file, "/VTKHDF/CellData", "normal_force tangential_force gap status", .true.)
    ! single precision keeps seven digits
    call check_close(number_of(file, "/VTKHDF/CellData/normal_force", 1, 1), 20.0_dp, 1.0e-5_dp, "weight of one disk")
    call check_close(number_of(file, "/VTKHDF/CellData/normal_force", 2, 1), 40.0_dp, 1.0e-5_dp, "weight of both disks")
    call file%leave()
    call simulation%free()
  end subroutine test_pictures

  !> The scene comes back from its final bodies: grains with their velocities, groups, materials, walls that came with them, and
  !> the period; boundaries of the input do not.
  subroutine test_final_bodies()
    type(simulation_t) :: simulation
    type(final_bodies_output_t) :: output
    type(step_figures_t) :: figures
    type(bodies_data_t) :: data
    type(error_t), allocatable :: error
    integer :: unit

    open (newunit=unit, file="start.csv", action="write", status="replace")
    write (unit, "(a)") "id,radius,mass,shape,group,x,y,vx,vy,omega,nx,ny", "8,0.1,2,grain,0,0.5,1,1,2,3,,", &
      & "3,0.2,4,grain,6,1.5,2,0,0,0,,", "20,,,plane,,0,-1,,,,0,1"
    close (unit)
    call make("&scene bodies = 'file', bodies_file = 'start.csv', gravity = 0, 0, friction = 0.5, period = 4, 0, "// &
      & "period_origin = -1, 0 /"//newline//"&time step = 0.01, steps = 7 /"//newline// &
      & "&boundary shape = 'grains', group = 6 /"//newline//"&boundary shape = 'plane', point = 0, 9, normal = 0, -1 /"//newline// &
      & "&output final_bodies = T /", simulation)
    call output%open(simulation, "./", "gravier case", error)
    call output%write(simulation, figures, 0.0_dp, error)
    call output%finish(error)
    call expect_none(error, "final bodies are written")
    call read_bodies(comm, "final_bodies.h5", 2, data, error)
    call expect_none(error, "final bodies are read")
    call check_equal(data%total, 2_i8, "grains")
    call check_equal(data%id(1), 3_i8, "the identifiers")
    call check_equal(data%id(2), 8_i8, "in their order")
    call check_close(data%position(1, 2), 0.5_dp, 0.0_dp, "place along x")
    call check_close(data%position(2, 2), 1.0_dp, 0.0_dp, "place along y")
    call check_close(data%velocity(1, 2), 1.0_dp, 0.0_dp, "velocity along x")
    call check_close(data%velocity(3, 2), 3.0_dp, 0.0_dp, "spin")
    call check_close(data%radius(1), 0.2_dp, 0.0_dp, "radius")
    call check_close(data%mass(1), 4.0_dp, 0.0_dp, "mass")
    call check_equal(data%group(1), 6, "a glued grain has its group")
    call check_equal(data%group(2), 0, "a free one has none")
    call check_equal(data%material(2), 1, "material")
    call check_equal(data%n_walls, 1, "walls that came with the grains")
    call check_equal(data%wall_id(1), 20_i8, "identifier of a wall")
    call check_close(data%wall_point(2, 1), -1.0_dp, 0.0_dp, "point of a wall")
    call check_close(data%wall_normal(2, 1), 1.0_dp, 0.0_dp, "normal of a wall")
    call check(data%has_box, "the scene is periodic")
    call check_close(data%period(1), 4.0_dp, 0.0_dp, "period")
    call check_close(data%origin(1), -1.0_dp, 0.0_dp, "origin of the period")
    call simulation%free()
  end subroutine test_final_bodies

  !> One disk of 2 kg at rest on a floor, with friction: M V = H r + f with r_n = m g h, in a file of the number of the step.
  subroutine test_problem()
    type(simulation_t) :: simulation
    type(problem_output_t) :: output
    type(step_figures_t) :: figures
    type(fclib_local_t), allocatable :: local
    type(fclib_global_t), allocatable :: whole
    type(error_t), allocatable :: error

    call make("&scene bodies = 'column', column_count = 1, radius = 0.5, mass = 2, gravity = 0, -10, friction = 0.3, "// &
      & "wall_friction = 0.7 /"//newline//"&time step = 0.01, steps = 7 /"//newline//"&output fclib_step = 2 /"//newline// &
      & exact, simulation)
    call output%open(simulation, "./", "gravier case", error)
    call advance(simulation, figures)
    call output%write(simulation, figures, 0.0_dp, error)
    call expect_none(error, "a contact problem is written")
    call read_fclib(comm, "step_1.hdf5", local, whole, error)
    call expect_none(error, "a contact problem is read")
    call check(allocated(whole), "it is a global one")
    if (.not. allocated(whole)) call finish_checks()
    call check_equal(whole%dimension, 2, "dimension")
    call check_equal(size(whole%mu), 1, "contacts")
    call check_close(whole%mu(1), 0.7_dp, 0.0_dp, "friction")
    call check_close(whole%f(2), -0.2_dp, 1.0e-15_dp, "load: m g h")
    call check_close(whole%r(1, 1), 0.2_dp, 1.0e-12_dp, "impulse on it")
    call check_close(whole%r(2, 1), 0.0_dp, 1.0e-12_dp, "and none along the floor")
    call simulation%free()
  end subroutine test_problem

  !> A checkpoint of another run goes when a run begins, and stays when it goes on.
  subroutine test_checkpoint()
    type(simulation_t) :: simulation
    type(checkpoint_output_t) :: output
    type(step_figures_t) :: figures
    type(error_t), allocatable :: error

    call make(scene//" /", simulation)
    call output%open(simulation, "./", "gravier case", error)
    call check(.not. is_there("checkpoint.h5"), "none before it is written")
    call output%write(simulation, figures, 0.0_dp, error)
    call expect_none(error, "a checkpoint is written")
    call check(is_there("checkpoint.h5"), "a checkpoint")
    simulation%restarted = .true.
    call output%open(simulation, "./", "gravier case", error)
    call check(is_there("checkpoint.h5"), "a run that goes on leaves it")
    simulation%restarted = .false.
    call output%open(simulation, "./", "gravier case", error)
    call check(.not. is_there("checkpoint.h5"), "a run that begins does not")
    call expect_none(error, "checkpoints come and go")
    call simulation%free()
  end subroutine test_checkpoint

  logical function is_there(path)
    character(len=*), intent(in) :: path
    inquire (file=path, exist=is_there)
  end function is_there

end program test_outputs
