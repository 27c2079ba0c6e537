!> The files that a run has in its output directory, before it begins: it must be able to write them, none of them may be one that
!> it reads, and those of an older run that it does not replace are named in the log.
module gravier_output_files
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: text_from
  use gravier_communicator, only: communicator_t
  use gravier_file_system, only: place_of, place_t, check_directory, is_directory
  use gravier_hdf5_file, only: check_length
  use gravier_own_files, only: part_of
  use gravier_table_place, only: may_replace
  use gravier_config_types, only: config_t
  use gravier_output_registry, only: output_holder_t, registered_outputs
  implicit none
  private
  public :: check_paths, check_origins, refuse_directory, older_files, own_files

  !> of every run
  character(len=*), parameter :: log_name = "run.log"

contains

  !> Refuse an output directory that cannot be written to, an output whose place a directory has, and an input that the run would
  !> replace by an output. Rank 0 looks and writes nothing.
  !> Failure: status_input, with the key. Collective.
  subroutine check_paths(comm, config, error)
    type(communicator_t), intent(in) :: comm
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    type(error_t), allocatable :: reason
    character(len=:), allocatable :: names
    integer :: b

    if (allocated(error)) return
    if (comm%rank == 0) then
      call check_directory(trim(config%output%directory), reason)
      if (allocated(reason)) call refuse_directory(config, reason, error)
      names = own_files(config)
      call check_outputs(config, names, error)
      call check_input(config%file, "the case itself")
      if (config%scene%bodies == "file") call check_input(config%scene%bodies_file, "&scene bodies_file")
      call check_input(config%scene%shapes, "&scene shapes")
      call check_input(config%scene%gravity_table, "&scene gravity_table")
      call check_input(config%scene%cell_table, "&scene cell_table")
      call check_input(config%sample%radius_table, "&sample radius_table")
      do b = 1, size(config%boundaries)
        call check_input(config%boundaries(b)%table, "&boundary '"//trim(config%boundaries(b)%name)//"' table")
        call check_input(config%boundaries(b)%file, "&boundary '"//trim(config%boundaries(b)%name)//"' file")
      end do
      do b = 1, size(config%insertions)
        call check_input(config%insertions(b)%radius_table, "&insertion '"//trim(config%insertions(b)%name)//"' radius_table")
      end do
    end if
    call comm%agree(error)

  contains

    subroutine check_input(path, key)
      character(len=*), intent(in) :: path, key
      type(place_t) :: place
      character(len=:), allocatable :: name
      integer :: first

      if (path == "" .or. allocated(error)) return
      place = place_of(trim(path))
      if (.not. place%is_there()) return
      first = 1
      do
        call take_name(names, first, name)
        if (name == "") exit
        if (place_of(trim(config%output%directory)//"/"//name) == place) call raise(error, status_input, &
          & config%file//": "//key//" = '"//trim(path)//"': this run would replace the file by its own "//name// &
          & "; expected a copy in another place, or another `directory` of &output")
      end do
    end subroutine check_input

  end subroutine check_paths

  !> The message of an output directory that a run cannot have.
  subroutine refuse_directory(config, reason, error)
    type(config_t), intent(in) :: config
    !> what the system says
    type(error_t), intent(in) :: reason
    type(error_t), allocatable, intent(inout) :: error

    call raise(error, status_input, config%file//": &output directory = '"//trim(config%output%directory)// &
      & "': expected a directory that can be written to: "//reason%message)
  end subroutine refuse_directory

  !> Refuse outputs whose place a directory has. Not collective.
  subroutine check_outputs(config, names, error)
    type(config_t), intent(in) :: config
    !> of the files, with commas between
    character(len=*), intent(in) :: names
    type(error_t), allocatable, intent(inout) :: error
    type(error_t), allocatable :: reason
    character(len=:), allocatable :: name
    integer :: first

    first = 1
    do
      call take_name(names, first, name)
      if (name == "" .or. allocated(error)) exit
      call check_length(part_of(trim(config%output%directory)//"/"//name), reason)
      if (allocated(reason)) call raise(error, status_input, config%file//": &output directory: "//reason%message)
      if (is_directory(trim(config%output%directory)//"/"//name)) call raise(error, status_input, config%file// &
        & ": &output directory = '"//trim(config%output%directory)//"': a directory in it is called "//name// &
        & ", as a file of this run; expected another name for one of them")
    end do
  end subroutine check_outputs

  !> Refuse outputs whose place a file of another origin has. Files that a restart goes on with are read then, but not the log,
  !> which is added to. Rank 0 looks. Failure: status_input. Collective.
  subroutine check_origins(comm, config, known, error)
    type(communicator_t), intent(in) :: comm
    type(config_t), intent(in) :: config
    !> names of the files that the run goes on with, with commas between; empty for a run that begins
    character(len=*), intent(in) :: known
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: names, name
    integer :: first

    if (allocated(error)) return
    if (comm%rank == 0) then
      names = own_files(config)
      first = 1
      do
        call take_name(names, first, name)
        if (name == "" .or. allocated(error)) exit
        if (name /= log_name .and. index(","//known//",", ","//name//",") > 0) cycle
        if (.not. may_replace(trim(config%output%directory)//"/"//name)) call raise(error, status_input, config%file// &
          & ": &output directory = '"//trim(config%output%directory)//"': the file "//name//" in it is none of this program, "// &
          & "and is not replaced; expected another directory, or another name for that file")
      end do
    end if
    call comm%agree(error)
  end subroutine check_origins

  !> Names of files that an older run has left in the output directory and that this one does not replace, with commas between.
  function older_files(config) result(found)
    type(config_t), intent(in) :: config
    character(len=:), allocatable :: found
    character(len=:), allocatable :: own, names, name
    type(config_t) :: all_asked
    integer :: first
    logical :: exists

    found = ""
    own = ","//own_files(config)//","
    ! an output of this run may write fewer files than that of the older one
    all_asked = config
    all_asked%output%contacts = .true.
    names = own_files(all_asked)//","//file_names(all_asked, wanted=.false.)
    first = 1
    do
      call take_name(names, first, name)
      if (name == "") exit
      if (index(own, ","//name//",") > 0) cycle
      inquire (file=trim(config%output%directory)//"/"//name, exist=exists)
      if (exists) found = found//", "//name
    end do
    found = text_from(found, 3)
  end function older_files

  !> The next of some names, empty after the last.
  pure subroutine take_name(names, first, name)
    !> with commas between
    character(len=*), intent(in) :: names
    !> where it begins, 1 for the first name; moved to where the one after it does
    integer, intent(inout) :: first
    character(len=:), allocatable, intent(out) :: name

    name = ""
    if (first > len(names)) return
    name = names(first:first + index(names(first:)//",", ",") - 2)
    first = first + len(name) + 1
  end subroutine take_name

  !> Names of the files that a run writes, with commas between.
  function own_files(config) result(names)
    type(config_t), intent(in) :: config
    character(len=:), allocatable :: names

    names = log_name//","//file_names(config, wanted=.true.)
  end function own_files

  !> Names of the files of the outputs that the input wants, or does not want, with commas between.
  function file_names(config, wanted) result(names)
    type(config_t), intent(in) :: config
    logical, intent(in) :: wanted
    character(len=:), allocatable :: names
    type(output_holder_t), allocatable :: all_kinds(:)
    integer :: k

    names = ""
    call registered_outputs(all_kinds)
    do k = 1, size(all_kinds)
      associate (item => all_kinds(k)%output)
        if ((item%wanted(config) .eqv. wanted) .and. item%files(config) /= "") names = names//","//item%files(config)
      end associate
    end do
    names = text_from(names, 2)
  end function file_names

end module gravier_output_files
