!> Corners of a face as seen from the plane of contact: those inside of the others go, whatever corner their list begins with.
program test_contact_feature
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp
  use gravier_contact_feature, only: drop_inner
  use gravier_check, only: check, check_equal, finish_checks
  implicit none
  !> a square with a corner that turns inwards at one side, and one that has gone past its neighbour
  real(dp), parameter :: dented(2, 5) = reshape([0.0_dp, 0.0_dp, 1.0_dp, 0.0_dp, 1.0_dp, 1.0_dp, 0.5_dp, 0.9_dp, &
    & 0.0_dp, 1.0_dp], [2, 5])
  real(dp), parameter :: crossed(2, 5) = reshape([0.0_dp, 0.0_dp, 1.0_dp, 0.0_dp, 0.9_dp, 1.1_dp, 1.1_dp, 0.9_dp, &
    & 0.0_dp, 1.0_dp], [2, 5])

  call MPI_Init()
  call test_convex()
  call test_hull(dented, [1, 2, 3, 5], "a dent")
  call test_hull(crossed, [1, 2, 4, 3, 5], "two corners that went past each other")
  call test_line()
  call finish_checks()
  call MPI_Finalize()

contains

  !> What is convex stays as it is, corners in line included.
  subroutine test_convex()
    real(dp) :: place(3, 5)
    integer :: m, vertex(5)

    place(:, :) = 0.0_dp
    place(1:2, :) = reshape([0.0_dp, 0.0_dp, 0.5_dp, 0.0_dp, 1.0_dp, 0.0_dp, 1.0_dp, 1.0_dp, 0.0_dp, 1.0_dp], [2, 5])
    vertex(:) = [4, 7, 1, 9, 2]
    m = 5
    call drop_inner(1.0_dp, m, vertex, place)
    call check(m == 5 .and. all(vertex == [4, 7, 1, 9, 2]), "a convex face")
  end subroutine test_convex

  !> The corners kept, in order around the face, from every first corner on and in both senses.
  subroutine test_hull(corner, kept, what)
    real(dp), intent(in) :: corner(:, :)
    integer, intent(in) :: kept(:)
    character(len=*), intent(in) :: what
    real(dp) :: place(3, 5)
    integer :: m, vertex(5), first, k, from, sense
    logical :: right

    do sense = -1, 1, 2
      do first = 1, 5
        do k = 1, 5
          from = modulo(first + sense*k, 5) + 1
          vertex(k) = from
          place(1:2, k) = corner(:, from)
          place(3, k) = from
        end do
        m = 5
        call drop_inner(real(sense, dp), m, vertex, place)
        call check_equal(m, size(kept), what//": how many corners are kept")
        from = 1
        do k = 1, size(kept)
          if (kept(k) == vertex(1)) from = k
        end do
        right = .true.
        do k = 1, min(m, size(kept))
          right = right .and. vertex(k) == kept(modulo(from - 1 + sense*(k - 1), size(kept)) + 1)
          right = right .and. nint(place(3, k)) == vertex(k)
        end do
        call check(right, what//": their order")
      end do
    end do
  end subroutine test_hull

  !> Corners in a line have no hull, and stay.
  subroutine test_line()
    real(dp) :: place(3, 4)
    integer :: m, vertex(4)

    place(:, :) = 0.0_dp
    place(1, :) = [0.0_dp, 2.0_dp, 1.0_dp, 3.0_dp]
    vertex(:) = [1, 2, 3, 4]
    m = 4
    call drop_inner(1.0_dp, m, vertex, place)
    call check(m >= 3, "corners in a line")
  end subroutine test_line

end program test_contact_feature
