!> Corners of a face as seen from the plane of contact: those inside of the others go, whatever corner their list begins with, and
!> corners at one place count as one.
program test_contact_feature
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp
  use gravier_contact_feature, only: drop_inner
  use gravier_check, only: check, check_equal, finish_checks
  implicit none
  !> corners nearer than this are at one place
  real(dp), parameter :: near = 1.0e-9_dp
  !> a square with a corner that turns inwards at one side, and one that has gone past its neighbour
  real(dp), parameter :: dented(2, 5) = reshape([0.0_dp, 0.0_dp, 1.0_dp, 0.0_dp, 1.0_dp, 1.0_dp, 0.5_dp, 0.9_dp, &
    & 0.0_dp, 1.0_dp], [2, 5])
  real(dp), parameter :: crossed(2, 5) = reshape([0.0_dp, 0.0_dp, 1.0_dp, 0.0_dp, 0.9_dp, 1.1_dp, 1.1_dp, 0.9_dp, &
    & 0.0_dp, 1.0_dp], [2, 5])
  !> a triangle with a corner within one of its sides, and one inside
  real(dp), parameter :: lined(2, 5) = reshape([0.0_dp, 0.0_dp, 0.5_dp, 0.0_dp, 1.0_dp, 0.0_dp, 0.4_dp, 0.4_dp, &
    & 0.0_dp, 1.0_dp], [2, 5])
  !> a triangle with a small one in place of a corner: the sides go round twice, and all turns are to the same side
  real(dp), parameter :: looped(2, 5) = reshape([0.0_dp, 0.2_dp, 2.0_dp, 0.0_dp, 1.0_dp, 1.0_dp, 0.99_dp, 0.9_dp, &
    & 1.1_dp, 0.99_dp], [2, 5])

  call MPI_Init()
  call test_convex()
  call test_hull(dented, [1, 2, 3, 5], "a dent")
  call test_hull(crossed, [1, 2, 4, 3, 5], "two corners that went past each other")
  call test_hull(looped, [1, 2, 5, 3], "a loop of three corners")
  call test_hull(lined, [1, 2, 3, 5], "a corner in line with others, and a dent")
  call test_one_place()
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
    call drop_inner(1.0_dp, near, m, vertex, place)
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
        call drop_inner(real(sense, dp), near, m, vertex, place)
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

  !> Two corners at one place stay both, in their order, whichever side of each other rounding puts them on, beside a dent and
  !> without one.
  subroutine test_one_place()
    real(dp) :: corner(2, 6), place(3, 6)
    integer :: m, vertex(6), i, j, k, first
    logical :: right

    do i = -2, 2
      do j = -2, 2
        corner(:, :) = 0.0_dp
        corner(1, 2:4) = 1.0_dp
        corner(2, 3:6) = 1.0_dp
        corner(1, 4) = 1.0_dp + i*epsilon(1.0_dp)
        corner(2, 4) = 1.0_dp + j*epsilon(1.0_dp)
        place(:, :) = 0.0_dp
        place(1:2, 1:5) = corner(:, 1:5)
        vertex(:) = [1, 2, 3, 4, 5, 6]
        m = 5
        call drop_inner(1.0_dp, near, m, vertex, place)
        call check(m == 5 .and. all(vertex == [1, 2, 3, 4, 5, 6]), "two corners at one place")
        corner(:, 5) = [0.5_dp, 0.9_dp]
        do first = 0, 5
          do k = 1, 6
            vertex(k) = modulo(first + k, 6) + 1
            place(1:2, k) = corner(:, vertex(k))
          end do
          m = 6
          call drop_inner(1.0_dp, near, m, vertex, place)
          call check_equal(m, 5, "two corners at one place, and a dent: how many are kept")
          right = .true.
          do k = 1, m
            right = right .and. vertex(modulo(k, m) + 1) == modulo(merge(5, vertex(k), vertex(k) == 4), 6) + 1
          end do
          call check(right, "two corners at one place, and a dent: their order")
        end do
      end do
    end do
  end subroutine test_one_place

  !> Corners in a line have no hull, and stay.
  subroutine test_line()
    real(dp) :: place(3, 4)
    integer :: m, vertex(4)

    place(:, :) = 0.0_dp
    place(1, :) = [0.0_dp, 2.0_dp, 1.0_dp, 3.0_dp]
    vertex(:) = [1, 2, 3, 4]
    m = 4
    call drop_inner(1.0_dp, near, m, vertex, place)
    call check(m >= 3, "corners in a line")
  end subroutine test_line

end program test_contact_feature
