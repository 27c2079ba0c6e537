!> What tells whether neighbour lists are still valid: bodies and boundaries as they were, and how far a surface has moved since.
program test_list_reference
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp
  use gravier_body_store, only: body_set_t, body_layout_t
  use gravier_boundary, only: boundary_t
  use gravier_surface_registry, only: make_surface
  use gravier_list_reference, only: reference_t, note_bodies, note_boundaries, way_of
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  call MPI_Init()
  call test_bodies()
  call test_boundaries()
  call test_tilt()
  call finish_checks()
  call MPI_Finalize()

contains

  subroutine test_bodies()
    type(body_layout_t) :: layout
    type(body_set_t) :: owned
    type(reference_t) :: reference

    layout%nd = 2
    layout%nv = 3
    call owned%init(layout, 1)
    owned%position(:, 1) = [1.0_dp, 2.0_dp]
    owned%velocity(:, 1) = [3.0_dp, 4.0_dp, 100.0_dp]
    call note_bodies(owned, reference)
    owned%position(:, 1) = 0.0_dp
    call check_close(reference%position(2, 1), 2.0_dp, 0.0_dp, "where a body was")
    call check_close(reference%speed(1), 5.0_dp, 1.0e-15_dp, "how fast its centre was")
  end subroutine test_bodies

  !> A reference is moved with what it refers to, and has no rows of its table.
  subroutine test_boundaries()
    type(boundary_t) :: boundaries(2)
    type(boundary_t), allocatable :: reference(:)
    integer :: b

    do b = 1, 2
      call make_surface("segment", boundaries(b)%surface)
      boundaries(b)%surface%edge(1:2, 1) = [1.0_dp, 0.0_dp]
      allocate (boundaries(b)%drive%table%time(2), boundaries(b)%drive%table%value(1, 2), boundaries(b)%drive%table%has(1))
    end do
    boundaries(1)%velocity(1) = 7.0_dp
    call note_boundaries(boundaries, reference)
    call check_equal(size(reference), 2, "one of each")
    call check(.not. allocated(reference(1)%drive%table%value), "no rows of a table")
    call check(allocated(boundaries(1)%drive%table%value), "the boundary itself keeps them")
    call check_close(reference(1)%velocity(1), 7.0_dp, 0.0_dp, "its velocity")
    call boundaries(2)%shift([0.3_dp, 0.4_dp])
    call check_close(way_of(boundaries(1), reference(1)), 0.0_dp, 0.0_dp, "the way of one that stands")
    call check_close(way_of(boundaries(2), reference(2)), 0.5_dp, 1.0e-15_dp, "the way of one that moved")
    boundaries(1)%velocity(1) = 9.0_dp
    boundaries(2)%present = .false.
    call note_boundaries(boundaries, reference)
    call check_close(way_of(boundaries(2), reference(2)), 0.0_dp, 0.0_dp, "the way since it was noted again")
    call check_close(reference(1)%velocity(1), 9.0_dp, 0.0_dp, "its velocity when it was noted again")
    call check(.not. reference(2)%present .and. reference(1)%present, "what was taken away")
    call check_close(reference(2)%surface%point(1), 0.3_dp, 0.0_dp, "where it is when it is noted again")
  end subroutine test_boundaries

  !> A plane that tilts moves without bound.
  subroutine test_tilt()
    type(boundary_t) :: boundaries(1)
    type(boundary_t), allocatable :: reference(:)

    call make_surface("plane", boundaries(1)%surface)
    boundaries(1)%surface%axis(:) = [0.0_dp, 1.0_dp, 0.0_dp]
    call note_boundaries(boundaries, reference)
    boundaries(1)%surface%axis(:) = [1.0e-12_dp, 1.0_dp, 0.0_dp]
    call check_close(way_of(boundaries(1), reference(1)), 0.0_dp, 1.0e-15_dp, "roundings of an axis")
    boundaries(1)%surface%axis(:) = [0.6_dp, 0.8_dp, 0.0_dp]
    call check(way_of(boundaries(1), reference(1)) > 1.0e300_dp, "an axis that tilts")
  end subroutine test_tilt

end program test_list_reference
