!> gravier_sample SAMPLE.nml: generates the grains of &sample, prepares them, and writes them to a bodies file.
program gravier_sample
  use, intrinsic :: iso_fortran_env, only: output_unit, error_unit
  use gravier_errors, only: error_t, raise, status_ok, status_input
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_timers, only: reset_timers
  use gravier_file_system, only: make_directory
  use gravier_own_files, only: check_own_files
  use gravier_output_lock, only: output_lock_t
  use gravier_bodies_data, only: bodies_data_t
  use gravier_bodies_hdf5, only: write_bodies_hdf5
  use gravier_command_line, only: argument, leave
  use gravier_config, only: config_t
  use gravier_run, only: read_config
  use gravier_run_log, only: run_log_t
  use gravier_start_lines, only: banner_text
  use gravier_sample_bodies, only: make_sample
  use gravier_sample_preparation, only: prepare_sample, open_log
  implicit none

  character(len=*), parameter :: nl = new_line("a")
  character(len=*), parameter :: usage = &
    & "usage: gravier_sample SAMPLE.nml      generate the grains of &sample, settle or compact them as it says, and write"//nl// &
    & "                                      them to its bodies file (mpirun -n RANKS gravier_sample SAMPLE.nml)"//nl// &
    & "       gravier_sample --version | --help"//nl// &
    & "exit status: 0 done and at rest; 2 bad input or usage; 3 not at rest; 4 anything else"

  type(communicator_t), target :: comm
  type(error_t), allocatable :: error
  character(len=:), allocatable :: word
  integer :: status

  call start_parallel()
  call comm%init()
  status = status_ok
  word = ""
  if (command_argument_count() > 0) word = argument(1)
  if (command_argument_count() /= 1) then
    call raise(error, status_input, "expected one input file, but "//to_text(command_argument_count())// &
      & " arguments are given; see gravier_sample --help")
  else if (word == "--help" .or. word == "-h") then
    if (comm%rank == 0) write (output_unit, "(a)") usage
  else if (word == "--version") then
    if (comm%rank == 0) write (output_unit, "(a)", advance="no") banner_text()
  else if (index(word, "-") == 1) then
    call raise(error, status_input, "unknown option "//word//"; see gravier_sample --help")
  else
    call write_sample(word, status, error)
  end if
  if (allocated(error)) then
    if (comm%rank == 0) write (error_unit, "(a)") "gravier_sample: error: "//error%message
    flush (error_unit)
    status = error%status
  end if
  call comm%free()
  call stop_parallel()
  call leave(status)

contains

  !> From an input file to a bodies file. Everything that can be refused is refused before a file is touched. Collective.
  subroutine write_sample(path, status, error)
    character(len=*), intent(in) :: path
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
    call prepare_directory(config, error)
    call lock%take_file(comm, trim(config%sample%file), "gravier_sample "//path, error)
    if (.not. allocated(error)) then
      if (config%sample%preparation == "none") then
        call write_unprepared(config, log, error)
      else
        call prepare_sample(comm, config, log, status, error)
      end if
    end if
    call log%close(error)
    call comm%agree(error)
    call lock%release()
  end subroutine write_sample

  !> Write the sample as it is generated. Collective.
  subroutine write_unprepared(config, log, error)
    type(config_t), intent(in) :: config
    type(run_log_t), intent(inout) :: log
    type(error_t), allocatable, intent(inout) :: error
    type(bodies_data_t) :: data

    call make_sample(comm, config, data, error)
    if (allocated(error)) return
    call open_log(config, log, error)
    call write_bodies_hdf5(comm, trim(config%sample%file), data, error)
    call check_own_files(error)
    call comm%agree(error)
    if (.not. allocated(error)) call log%line("finished    "//to_text(data%total)//" grains, "//to_text(data%n_walls)// &
      & " planes; written to "//trim(config%sample%file), error)
  end subroutine write_unprepared

  !> Make the directory of the bodies file, or say why it cannot be used. Collective.
  subroutine prepare_directory(config, error)
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    type(error_t), allocatable :: reason
    character(len=:), allocatable :: directory

    if (comm%rank == 0) then
      directory = config%sample%file(1:index(config%sample%file, "/", back=.true.))
      if (directory == "") directory = "."
      call make_directory(directory, reason)
      if (allocated(reason)) call raise(error, status_input, config%file//": &sample file = '"//trim(config%sample%file)// &
        & "': expected a file in a directory that can be written to: "//reason%message)
    end if
    call comm%agree(error)
  end subroutine prepare_directory

end program gravier_sample
