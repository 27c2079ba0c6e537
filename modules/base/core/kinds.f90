!> Working precision and integer kinds of the whole program.
module gravier_kinds
  use, intrinsic :: iso_fortran_env, only: real64, int32, int64
  implicit none
  private
  public :: dp, i4, i8

  !> working precision
  integer, parameter :: dp = real64
  integer, parameter :: i4 = int32
  !> body identifiers, global counts and record words
  integer, parameter :: i8 = int64

end module gravier_kinds
