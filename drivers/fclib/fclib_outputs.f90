!> The files that gravier_fclib writes: none of them may be one that it reads, no two of them may be one, and what they replace is
!> of their kind.
module gravier_fclib_outputs
  use gravier_errors, only: error_t, raise, status_input
  use gravier_file_system, only: path_t, place_t, place_of
  use gravier_own_files, only: part_of
  use gravier_table_place, only: check_table_place, check_hdf5_place
  implicit none
  private
  public :: written_path, check_outputs

contains

  !> Where --write puts the problem of a file.
  pure function written_path(directory, path) result(written)
    character(len=*), intent(in) :: directory, path
    character(len=:), allocatable :: written
    written = directory//"/"//path(index(path, "/", back=.true.) + 1:)
  end function written_path

  !> Refuse outputs that would replace an input or each other, by the files themselves, whatever their paths look like.
  subroutine check_outputs(files, csv, profile, directory, error)
    !> inputs
    type(path_t), intent(in) :: files(:)
    !> values of --csv, --profile and --write; empty where not given
    character(len=*), intent(in) :: csv, profile, directory
    type(error_t), allocatable, intent(inout) :: error
    type(place_t) :: inputs(size(files)), outputs(size(files) + 2), parts(size(files) + 2)
    type(path_t) :: paths(size(files) + 2)
    integer :: i, k, n

    do i = 1, size(files)
      inputs(i) = place_of(files(i)%text)
    end do
    n = 0
    do i = 1, merge(size(files), 0, directory /= "")
      call add(written_path(directory, files(i)%text))
      do k = 1, i - 1
        if (outputs(k) == outputs(i)) call raise(error, status_input, "--write '"//directory// &
          & "': expected files of different names, but "//files(k)%text//" and "//files(i)%text//" both become "//paths(i)%text)
      end do
    end do
    if (csv /= "") call add(csv)
    if (profile /= "") call add(profile)
    do k = 1, n
      do i = 1, size(files)
        if (parts(k) == inputs(i)) call raise(error, status_input, files(i)%text// &
          & ": expected a problem elsewhere than where "//paths(k)%text//" is written until it is whole")
        if (.not. outputs(k) == inputs(i)) cycle
        if (k <= size(files) .and. directory /= "") call raise(error, status_input, "--write '"//directory// &
          & "': expected another directory than that of "//files(i)%text//", which "//paths(k)%text//" would replace")
        call raise(error, status_input, paths(k)%text//": expected another file for a table than the problem "//files(i)%text)
      end do
      do i = 1, k - 1
        if (outputs(k) == outputs(i)) call raise(error, status_input, paths(k)%text// &
          & ": expected a file of its own for each of --csv, --profile and the problems of --write")
      end do
    end do
    do k = 1, merge(size(files), 0, directory /= "")
      call check_hdf5_place(paths(k)%text, error)
    end do
    if (csv /= "") call check_table_place(csv, "problem,dimension,", error)
    if (profile /= "") call check_table_place(profile, "ratio,", error)

  contains

    subroutine add(path)
      character(len=*), intent(in) :: path

      n = n + 1
      paths(n)%text = path
      outputs(n) = place_of(path)
      parts(n) = place_of(part_of(path))
    end subroutine add

  end subroutine check_outputs

end module gravier_fclib_outputs
