!> What the C library does with memory that is given back.
module gravier_allocator_tuning
  use, intrinsic :: iso_c_binding, only: c_int
  implicit none
  private
  public :: keep_heap, give_back_arrays

  ! parameters of the GNU C library's mallopt
  integer(c_int), parameter :: trim_threshold = -1, mmap_threshold = -3, mmap_max = -4

  interface
    integer(c_int) function c_mallopt(parameter, value) bind(C, name="mallopt")
      import :: c_int
      implicit none
      integer(c_int), value :: parameter, value
    end function c_mallopt
  end interface

contains

  !> Keep memory that is deallocated for the next allocation, instead of giving it back to the system: each step makes its
  !> arrays anew, and pages fresh from the system have to be cleared one by one first. The peak is what it was.
  subroutine keep_heap()
    integer(c_int) :: ignored

    ignored = c_mallopt(trim_threshold, -1_c_int)
    ignored = c_mallopt(mmap_max, 0_c_int)
  end subroutine keep_heap

  !> Give each array of a megabyte or more back to the system where it is deallocated, in a program that makes its arrays once.
  !> By itself the C library gives arrays back until one of up to 32 MiB is deallocated. It keeps arrays of that size from then on,
  !> and the peak depends on how they fit between others.
  subroutine give_back_arrays()
    integer(c_int) :: ignored

    ignored = c_mallopt(mmap_threshold, 2_c_int**20)
  end subroutine give_back_arrays

end module gravier_allocator_tuning
