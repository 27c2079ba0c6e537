!> Quaternions: from axes and back for turns of every kind, products as one turn after the other.
program test_quaternion
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp
  use gravier_orientation, only: orientation_matrix
  use gravier_quaternion, only: multiply_quaternions, find_quaternion
  use gravier_check, only: check, check_close, finish_checks
  implicit none
  !> of some tens of operations with numbers of at most 4
  real(dp), parameter :: rounding = 1.0e-14_dp

  call MPI_Init()
  call test_there_and_back()
  call test_product()
  call finish_checks()
  call MPI_Finalize()

contains

  !> A quaternion whose components are in the ratio of four whole numbers.
  pure subroutine make(whole, q)
    integer, intent(in) :: whole(4)
    real(dp), intent(out) :: q(4)

    q(:) = real(whole, dp)
    q(:) = q/norm2(q)
  end subroutine make

  !> All turns by ratios from -2 to 2: half turns about any axis are among them, and any component is the largest of some. Of the
  !> two quaternions of a turn that with a real part of 0 or more comes back.
  subroutine test_there_and_back()
    real(dp) :: q(4), found(4), axes(3, 3)
    integer :: i, whole(4)

    do i = 0, 5**4 - 1
      whole(1) = mod(i, 5) - 2
      whole(2) = mod(i/5, 5) - 2
      whole(3) = mod(i/25, 5) - 2
      whole(4) = mod(i/125, 5) - 2
      if (all(whole == 0)) cycle
      call make(whole, q)
      call orientation_matrix(q, axes)
      call find_quaternion(axes, found)
      call check(found(1) >= 0.0_dp, "a real part of 0 or more")
      call check_close(abs(sum(found*q)), 1.0_dp, rounding, "the same turn or its opposite")
      call check_close(norm2(found), 1.0_dp, rounding, "of length 1")
    end do
  end subroutine test_there_and_back

  !> The axes of a product are those of the second factor, turned by the first.
  subroutine test_product()
    real(dp), dimension(4) :: a, b, c
    real(dp) :: axes_a(3, 3), axes_b(3, 3), axes_c(3, 3), expected
    integer :: i, k, d, whole(4)

    do i = 1, 40
      whole(1) = mod(7*i, 11) - 5
      whole(2) = mod(3*i, 7) - 3
      whole(3) = mod(5*i, 13) - 6
      whole(4) = 1
      call make(whole, a)
      whole(1) = mod(2*i, 9) - 4
      call make(whole, b)
      call multiply_quaternions(a, b, c)
      call orientation_matrix(a, axes_a)
      call orientation_matrix(b, axes_b)
      call orientation_matrix(c, axes_c)
      do k = 1, 3
        do d = 1, 3
          expected = sum(axes_a(d, :)*axes_b(:, k))
          call check_close(axes_c(d, k), expected, rounding, "an axis of a product")
        end do
      end do
    end do
  end subroutine test_product

end program test_quaternion
