!> Dense direct solution of small systems: the only module that knows LAPACK.
module gravier_dense_direct
  use gravier_kinds, only: dp
  implicit none
  private
  public :: solve_dense, projected_square

  interface
    subroutine dgesv(n, nrhs, a, lda, ipiv, b, ldb, info)
      import :: dp
      implicit none
      integer, intent(in) :: n, nrhs, lda, ldb
      real(dp), intent(inout) :: a(lda, *), b(ldb, *)
      integer, intent(out) :: ipiv(*), info
    end subroutine dgesv
    subroutine dsyev(jobz, uplo, n, a, lda, w, work, lwork, info)
      import :: dp
      implicit none
      character, intent(in) :: jobz, uplo
      integer, intent(in) :: n, lda, lwork
      real(dp), intent(inout) :: a(lda, *)
      real(dp), intent(out) :: w(*), work(*)
      integer, intent(out) :: info
    end subroutine dsyev
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

  !> b^T G^+ b, the square of the length of what b is made of in the span of vectors whose products are G; G is brought to a
  !> diagonal of ones first. A vector without length counts as none. 0 where the eigenvalues cannot be found.
  real(dp) function projected_square(g, b, cut) result(square)
    !> symmetric, not negative (n, n); (n)
    real(dp), intent(in), contiguous :: g(:, :), b(:)
    !> share of the largest eigenvalue below which one counts as 0
    real(dp), intent(in) :: cut
    real(dp) :: scaled(size(b), size(b)), scale(size(b)), values(size(b)), work(8*size(b))
    integer :: i, j, info

    square = 0.0_dp
    do i = 1, size(b)
      scale(i) = 0.0_dp
      if (g(i, i) > 0.0_dp) scale(i) = 1.0_dp/sqrt(g(i, i))
    end do
    do j = 1, size(b)
      do i = 1, size(b)
        scaled(i, j) = scale(i)*g(i, j)*scale(j)
      end do
    end do
    call dsyev("V", "U", size(b), scaled, size(b), values, work, size(work), info)
    if (info /= 0) return
    do i = 1, size(b)
      if (values(i) > cut*values(size(b))) square = square + sum(scaled(:, i)*scale*b)**2/values(i)
    end do
  end function projected_square

end module gravier_dense_direct
