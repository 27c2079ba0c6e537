!> Room on a disk: reserved behind the end of a file, and taken by it.
module gravier_disk_space
  use, intrinsic :: iso_c_binding, only: c_int, c_int64_t
  use gravier_kinds, only: i8
  use gravier_errors, only: error_t, raise, status_failure
  use gravier_text, only: to_text
  use gravier_system_calls, only: c_close, c_fallocate, c_fstatvfs, c_ftruncate, c_lseek, c_open, c_text, last_error, reason, &
    & o_wronly, falloc_fl_keep_size, seek_end, eintr, enospc, enosys, eopnotsupp, statvfs_words
  implicit none
  private
  public :: reserve_space, give_back_space, extend_file

contains

  !> Reserve disk space beyond the end of a file, leaving its length as it is, so that writing it later cannot fail
  !> for want of space. Where the file system knows no reservation, only compare with the space that is free now.
  !> Failure: status_failure; the file is as it was, and so is what was reserved before.
  subroutine reserve_space(path, bytes, error, start, held)
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: bytes
    type(error_t), allocatable, intent(inout) :: error
    !> also reserve what is missing between this place (from 0) and the end
    integer(i8), intent(in), optional :: start
    !> up to this place space was reserved before
    integer(i8), intent(in), optional :: held
    integer(c_int) :: descriptor, number, ignored
    integer(c_int64_t) :: length, first

    if (allocated(error) .or. bytes <= 0) return
    descriptor = c_open(c_text(path), o_wronly, 0_c_int)
    if (descriptor < 0) then
      call raise(error, status_failure, path//": cannot write to this file: "//reason(last_error()))
      return
    end if
    length = c_lseek(descriptor, 0_c_int64_t, seek_end)
    first = length
    if (present(start)) first = min(first, int(start, c_int64_t))
    number = allocate_range(descriptor, first, length + bytes)
    if (number == enosys .or. number == eopnotsupp) number = compare_with_free(descriptor, bytes)
    if (number /= 0) then
      ! some file systems keep the part that did fit: give it back
      ignored = c_ftruncate(descriptor, length)
      if (present(held)) then
        if (held > length) ignored = allocate_range(descriptor, length, int(held, c_int64_t))
      end if
      call raise(error, status_failure, path//": "//reason(number)//": "//to_text(bytes)// &
        & " bytes needed; what was written before stays readable")
    end if
    ignored = c_close(descriptor)
  end subroutine reserve_space

  !> Give back the space that was reserved behind the end of a file.
  subroutine give_back_space(path)
    character(len=*), intent(in) :: path
    integer(c_int) :: descriptor, ignored

    descriptor = c_open(c_text(path), o_wronly, 0_c_int)
    if (descriptor < 0) return
    ignored = c_ftruncate(descriptor, c_lseek(descriptor, 0_c_int64_t, seek_end))
    ignored = c_close(descriptor)
  end subroutine give_back_space

  !> Give a file at least `length` bytes, zeros behind its end. Failure: status_failure, with the system's reason.
  subroutine extend_file(path, length, error)
    character(len=*), intent(in) :: path
    integer(i8), intent(in) :: length
    type(error_t), allocatable, intent(inout) :: error
    integer(c_int) :: descriptor, number, ignored

    if (allocated(error)) return
    number = 0
    descriptor = c_open(c_text(path), o_wronly, 0_c_int)
    if (descriptor < 0) then
      number = last_error()
    else
      if (c_lseek(descriptor, 0_c_int64_t, seek_end) < length) then
        if (c_ftruncate(descriptor, int(length, c_int64_t)) /= 0) number = last_error()
      end if
      ignored = c_close(descriptor)
    end if
    if (number /= 0) call raise(error, status_failure, path//": cannot write to this file: "//reason(number))
  end subroutine extend_file

  !> Reserve bytes [first, last) of an open file; the result is the system's error number, 0 for success.
  integer(c_int) function allocate_range(descriptor, first, last) result(number)
    integer(c_int), intent(in) :: descriptor
    integer(c_int64_t), intent(in) :: first, last

    do
      number = 0
      if (c_fallocate(descriptor, falloc_fl_keep_size, first, last - first) /= 0) number = last_error()
      if (number /= eintr) return
    end do
  end function allocate_range

  !> ENOSPC when the file system of an open file has less free space than `bytes`, else 0.
  integer(c_int) function compare_with_free(descriptor, bytes) result(number)
    integer(c_int), intent(in) :: descriptor
    integer(i8), intent(in) :: bytes
    integer(c_int64_t) :: status(statvfs_words)

    number = 0
    if (c_fstatvfs(descriptor, status) /= 0) return
    ! words of struct statvfs: 2 is the size of a block, 5 the number of blocks free to this user
    if (status(5) < bytes/max(status(2), 1_c_int64_t) + 1) number = enospc
  end function compare_with_free

end module gravier_disk_space
