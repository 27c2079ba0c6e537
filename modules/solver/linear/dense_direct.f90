!> Dense direct solution of small systems: the only module that knows LAPACK.
module gravier_dense_direct
  use gravier_kinds, only: dp
  implicit none
  private
  public :: solve_dense

  interface
    subroutine dgesv(n, nrhs, a, lda, ipiv, b, ldb, info)
      import :: dp
      implicit none
      integer, intent(in) :: n, nrhs, lda, ldb
      real(dp), intent(inout) :: a(lda, *), b(ldb, *)
      integer, intent(out) :: ipiv(*), info
    end subroutine dgesv
  end interface

contains

  !> Solve A x = b by factors with row exchanges.
  subroutine solve_dense(a, b, regular)
    !> (n, n), lost
    real(dp), intent(inout), contiguous :: a(:, :)
    !> right-hand side in, solution out (n)
    real(dp), intent(inout), contiguous :: b(:)
    !> no pivot is 0; if not, `b` is not changed
    logical, intent(out) :: regular
    integer, allocatable :: pivot(:)
    integer :: info

    allocate (pivot(size(b)))
    call dgesv(size(b), 1, a, max(size(b), 1), pivot, b, max(size(b), 1), info)
    regular = info == 0
  end subroutine solve_dense

end module gravier_dense_direct
