!> Where gravier_sample writes: the bodies file, and the log beside it. Files that another program has made are not replaced.
module gravier_sample_place
  use mpi_f08, only: MPI_COMM_SELF
  use gravier_errors, only: error_t, raise, status_input
  use gravier_communicator, only: communicator_t
  use gravier_file_system, only: make_directory, file_length
  use gravier_hdf5_file, only: h5_file_t
  use gravier_table_place, only: begins_with
  use gravier_config, only: config_t
  use gravier_run_log, only: run_log_t
  implicit none
  private
  public :: sample_program, check_place, open_log

  !> what the bodies file says of its origin
  character(len=*), parameter :: sample_program = "gravier_sample"
  !> how the first line of the log begins
  character(len=*), parameter :: own_line = "sample      of "//sample_program//" from"

contains

  !> Make the directory of the bodies file, and refuse (status_input) one that cannot be used, and a bodies file or a log that this
  !> program has not made. Empty files may be replaced. Collective.
  subroutine check_place(comm, config, error)
    type(communicator_t), intent(in) :: comm
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
      if (.not. allocated(error)) call refuse_others(trim(config%sample%file), config, error)
      if (.not. allocated(error)) call refuse_others(log_name(config), config, error)
    end if
    call comm%agree(error)
  end subroutine check_place

  !> Refuse a file that is there, is not empty and is not of this program.
  subroutine refuse_others(path, config, error)
    character(len=*), intent(in) :: path
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error

    if (file_length(path) == 0) return
    if (path == log_name(config)) then
      if (begins_with(path, own_line)) return
    else
      if (says_own(path)) return
    end if
    call raise(error, status_input, config%file//": &sample file = '"//trim(config%sample%file)//"': there is a file "//path// &
      & " of another kind or origin, which is not replaced; expected the name of no file, or of one that "// &
      & sample_program//" has made")
  end subroutine refuse_others

  !> Whether an HDF5 file says that this program has made it.
  logical function says_own(path) result(own)
    character(len=*), intent(in) :: path
    type(communicator_t) :: alone
    type(h5_file_t) :: file
    type(error_t), allocatable :: error
    character(len=:), allocatable :: made_by

    own = .false.
    call alone%init(MPI_COMM_SELF)
    call file%open(alone, path, error)
    if (allocated(error)) return
    if (file%has_attribute("/", "made_by")) then
      call file%read_attribute("/", "made_by", made_by, error)
      own = .not. allocated(error) .and. made_by == sample_program
    end if
    call file%close(error)
    call alone%free()
  end function says_own

  !> The log that goes with the bodies file: its name with the ending .log.
  pure function log_name(config) result(name)
    type(config_t), intent(in) :: config
    character(len=:), allocatable :: name

    associate (file => config%sample%file)
      name = file(1:index(file, ".", back=.true.))//"log"
    end associate
  end function log_name

  !> Open the log. Its first line says whose it is. Collective.
  subroutine open_log(config, log, error)
    type(config_t), intent(in) :: config
    type(run_log_t), intent(inout) :: log
    type(error_t), allocatable, intent(inout) :: error

    call log%open(log_name(config), .false., error)
    call log%line(own_line//" "//config%file, error)
    call log%comm%agree(error)
  end subroutine open_log

end module gravier_sample_place
