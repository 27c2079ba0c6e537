!> Figures, drawn by the Python scripts of the drivers.
module gravier_drawing
  use gravier_errors, only: error_t, raise, status_failure
  use gravier_text, only: to_text, shell_word
  use gravier_file_system, only: remove_file
  use gravier_command_line, only: argument
  use gravier_build_info, only: drivers_directory, share_directory
  implicit none
  private
  public :: draw_figure

  !> exit status of the shell that found no Python to draw with
  integer, parameter :: no_python = 126

contains

  !> Draw DIRECTORY/NAME.png and DIRECTORY/NAME.svg from the tables in a directory, by the script plot_NAME.py and a Python that
  !> has matplotlib. An installation, wherever it was put, draws with the script beside it, a build with that of the source tree.
  !> Call it on one rank, after the end of MPI, which need not bear the start of another process. Failure: status_failure.
  subroutine draw_figure(name, directory, error)
    character(len=*), intent(in) :: name, directory
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: script
    integer :: failed, status

    ! none is better than that of other tables
    call remove_file(directory//"/"//name//".png")
    call remove_file(directory//"/"//name//".svg")
    script = name//"/plot_"//name//".py"
    status = 0
    call execute_command_line("program=$(command -v "//shell_word(argument(0))//"); program=$(readlink -f ""$program""); "// &
      & "script=$(dirname ""$program"")/"//shell_word(share_directory//"/"//script)//"; [ -e ""$script"" ] || script="// &
      & shell_word(drivers_directory//"/"//script)//"; for python in ""$GRAVIER_PYTHON"" python3 /usr/bin/python3; do "// &
      & """$python"" -c 'import matplotlib' >/dev/null 2>&1 && exec ""$python"" ""$script"" "//shell_word(directory)// &
      & "; done; exit "//to_text(no_python), exitstat=status, cmdstat=failed)
    if (failed /= 0) then
      call raise(error, status_failure, "the figure is NOT drawn: no shell could be started")
    else if (status == no_python) then
      call raise(error, status_failure, "the figure is NOT drawn: neither $GRAVIER_PYTHON nor python3 has matplotlib")
    else if (status /= 0) then
      call raise(error, status_failure, "the figure is NOT drawn: "//script//" "//directory//" ended with status "// &
        & to_text(status))
    end if
  end subroutine draw_figure

end module gravier_drawing
