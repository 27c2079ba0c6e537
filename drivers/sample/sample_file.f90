!> From an input file to the bodies file of gravier_sample.
module gravier_sample_file
  use gravier_errors, only: error_t, raise, status_ok, status_input
  use gravier_allocator_tuning, only: give_back_arrays
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_timers, only: reset_timers
  use gravier_own_files, only: check_own_files
  use gravier_output_lock, only: output_lock_t
  use gravier_bodies_file, only: bodies_data_t, write_bodies
  use gravier_shape_library, only: shape_library_t
  use gravier_shapes_file, only: read_shapes
  use gravier_config, only: config_t
  use gravier_read_case, only: read_config
  use gravier_run_log, only: run_log_t
  use gravier_run_memory, only: check_written_sample
  use gravier_sample_bodies, only: make_sample
  use gravier_sample_place, only: sample_program, check_place, open_log
  use gravier_sample_preparation, only: prepare_sample
  implicit none
  private
  public :: write_sample

contains

  !> From an input file to a bodies file. Everything that can be refused is refused before a file is touched. Errors are the
  !> same on all ranks. Collective.
  subroutine write_sample(comm, path, status, error)
    type(communicator_t), target, intent(in) :: comm
    character(len=*), intent(in) :: path
    !> for the program to leave with, where nothing fails
    integer, intent(out) :: status
    type(error_t), allocatable, intent(inout) :: error
    type(config_t) :: config
    type(run_log_t) :: log
    type(output_lock_t) :: lock

    status = status_ok
    call reset_timers()
    call log%init(comm)
    call read_config(comm, path, config, error)
    if (allocated(error)) return
    if (config%scene%bodies /= "sample") then
      call raise(error, status_input, path//": &scene bodies = '"//trim(config%scene%bodies)//"': expected 'sample'")
      return
    end if
    ! what enters while a run goes on is no part of a sample, and nobody reads means
    deallocate (config%insertions, config%regions)
    allocate (config%insertions(0), config%regions(0))
    call check_place(comm, config, error)
    call lock%take_file(comm, trim(config%sample%file), "gravier_sample "//path, error)
    if (.not. allocated(error)) then
      if (config%sample%preparation == "none") then
        call write_unprepared(comm, config, log, error)
      else
        call prepare_sample(comm, config, log, status, error)
      end if
    end if
    call log%close(error)
    call comm%agree(error)
    call lock%release()
  end subroutine write_sample

  !> Write the sample as it is generated. Collective.
  subroutine write_unprepared(comm, config, log, error)
    type(communicator_t), intent(in) :: comm
    type(config_t), intent(in) :: config
    type(run_log_t), intent(inout) :: log
    type(error_t), allocatable, intent(inout) :: error
    type(bodies_data_t) :: data
    type(shape_library_t) :: shapes

    call give_back_arrays()
    call check_written_sample(comm, config, error)
    if (allocated(error)) return
    if (config%scene%shapes /= "") call read_shapes(comm, trim(config%scene%shapes), config%scene%dimension, shapes, error)
    if (allocated(error)) return
    call make_sample(comm, config, shapes, data, error)
    if (allocated(error)) return
    data%made_by = sample_program
    call open_log(config, log, error)
    call write_bodies(comm, trim(config%sample%file), data, error, shapes)
    call check_own_files(error)
    call comm%agree(error)
    if (.not. allocated(error)) call log%line("finished    "//to_text(data%total)//" grains, "//to_text(data%n_walls)// &
      & " planes; written to "//trim(config%sample%file), error)
  end subroutine write_unprepared

end module gravier_sample_file
