!> Flat parts of walls as pieces: segments, facets and rectangles of boundaries that move.
program test_wall_sheet
  use gravier_kinds, only: dp
  use gravier_boundary, only: boundary_t
  use gravier_wall_sheet, only: wall_sheet_t, level
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  real(dp), parameter :: rounding = 1.0e-14_dp

  call test_sheet(2, [1.0_dp, 1.0_dp, 0.0_dp, 3.0_dp, 1.0_dp, 0.0_dp])
  call test_sheet(3, [0.0_dp, 0.0_dp, 1.0_dp, 2.0_dp, 0.0_dp, 1.0_dp, 1.0_dp, 2.0_dp, 1.0_dp])
  call test_sheet(3, [0.0_dp, 0.0_dp, 1.0_dp, 2.0_dp, 0.0_dp, 1.0_dp, 2.0_dp, 2.0_dp, 1.0_dp, 0.0_dp, 2.0_dp, 1.0_dp])
  call finish_checks()

contains

  !> A level sheet: its corners, faces, neighbours and normal, the velocity that its boundary has there, and normals that lean.
  subroutine test_sheet(nd, coordinates)
    integer, intent(in) :: nd
    !> of the corners, in order around it, from the centre of a body
    real(dp), intent(in) :: coordinates(:)
    real(dp), parameter :: body(3) = [0.5_dp, -0.25_dp, 2.0_dp], spin = 3.0_dp
    type(boundary_t) :: boundary
    type(wall_sheet_t) :: sheet
    real(dp) :: corners(3, size(coordinates)/3), middle(3), place(3), expected(3), lying(3), upright(3)
    integer :: k, n

    n = size(corners, 2)
    do k = 1, n
      corners(:, k) = coordinates(3*k - 2:3*k)
    end do
    middle(:) = sum(corners, dim=2)/n
    place(:) = middle
    place(1:nd) = middle(1:nd) + body(1:nd)
    boundary%last_velocity(:) = [0.1_dp, 0.2_dp, 0.0_dp]
    boundary%last_spin(3) = spin
    boundary%pivot(:) = 0.0_dp
    call sheet%init(boundary, 7, body(1:nd), corners)
    call check_equal(sheet%boundary, 7, "number of the boundary")
    call check_equal(size(sheet%piece%vertex, 2), n, "corners of the piece")
    do k = 1, n
      expected(:) = corners(:, k)
      lying(:) = sheet%seen%centre
      lying(1:nd) = lying(1:nd) + sheet%seen%radius*sheet%piece%vertex(:, k)
      call check(all(abs(lying - expected) <= rounding), "a corner")
    end do
    expected(1) = 0.1_dp - spin*place(2)
    expected(2) = 0.2_dp + spin*place(1)
    expected(3) = 0.0_dp
    call check(all(abs(sheet%seen%velocity(1:nd) - expected(1:nd)) <= 10*rounding), "its velocity")
    call check_close(sheet%seen%spin(3), spin, 0.0_dp, "its spin")
    upright(:) = 0.0_dp
    upright(nd) = 1.0_dp
    lying(:) = 0.0_dp
    lying(1) = 1.0_dp
    call check_close(abs(dot_product(sheet%normal, upright)), 1.0_dp, rounding, "its normal")
    expected(:) = cos(0.5_dp*level)*upright + sin(0.5_dp*level)*lying
    call check(.not. sheet%leans_at_edge(expected), "a normal of its face")
    expected(:) = sin(2.0_dp*level)*lying - cos(2.0_dp*level)*upright
    call check(sheet%leans_at_edge(expected), "a normal at its edge")
    if (nd == 3) call test_faces(sheet, n)
  end subroutine test_sheet

  !> Two faces that look to either side, and neighbours in ascending order.
  subroutine test_faces(sheet, n)
    type(wall_sheet_t), intent(in) :: sheet
    integer, intent(in) :: n
    integer :: k, next, last

    associate (piece => sheet%piece)
      call check(all(abs(piece%face_normal(:, 1) - [0.0_dp, 0.0_dp, 1.0_dp]) <= rounding), "the upper face")
      call check(all(abs(piece%face_normal(:, 2) - [0.0_dp, 0.0_dp, -1.0_dp]) <= rounding), "the lower face")
      do k = 1, 3
        call check_equal(piece%face_first(k), (k - 1)*n + 1, "corners of the faces")
      end do
      do k = 1, n
        next = mod(k, n) + 1
        last = mod(k + n - 2, n) + 1
        call check_equal(piece%face_vertex(k), k, "around the upper face")
        call check_equal(piece%face_vertex(n + k), n + 1 - k, "around the lower face")
        call check_equal(piece%neighbour_first(k), 2*k - 1, "neighbours of a corner")
        call check_equal(piece%neighbour(2*k - 1), min(next, last), "the first neighbour")
        call check_equal(piece%neighbour(2*k), max(next, last), "the second neighbour")
      end do
      call check_equal(piece%neighbour_first(n + 1), 2*n + 1, "the end of the neighbours")
    end associate
  end subroutine test_faces

end program test_wall_sheet
