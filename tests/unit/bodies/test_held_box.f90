!> Places that boundaries leave to the grains of a sample: clear of surfaces, and seen from a point inside those that hold them.
program test_held_box
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp
  use gravier_boundary, only: boundary_t
  use gravier_surface_registry, only: make_surface
  use gravier_free_places, only: is_clear, is_seen, least_distance
  use gravier_placed_grains, only: sample_box_t
  use gravier_held_box, only: held_box_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  call MPI_Init()
  call test_distances()
  call test_ways()
  call test_box()
  call finish_checks()
  call MPI_Finalize()

contains

  !> A drum of radius 1 about the origin, and a segment in it from (0.2, -0.5) to (0.2, 0.5).
  subroutine make_boundaries(boundaries)
    type(boundary_t), allocatable, intent(out) :: boundaries(:)

    allocate (boundaries(2))
    call make_surface("circle", boundaries(1)%surface)
    boundaries(1)%surface%radius = 1.0_dp
    call make_surface("segment", boundaries(2)%surface)
    boundaries(2)%surface%point(:) = [0.2_dp, -0.5_dp, 0.0_dp]
    boundaries(2)%surface%edge(:, 1) = [0.0_dp, 1.0_dp, 0.0_dp]
  end subroutine make_boundaries

  subroutine test_distances()
    type(boundary_t), allocatable :: boundaries(:)

    call make_boundaries(boundaries)
    call check_close(least_distance(boundaries, [0.0_dp, 0.0_dp]), 0.2_dp, 1.0e-15_dp, "from the segment")
    call check_close(least_distance(boundaries, [-0.9_dp, 0.0_dp]), 0.1_dp, 1.0e-15_dp, "from the drum")
    call check_close(least_distance(boundaries, [-1.5_dp, 0.0_dp]), -0.5_dp, 1.0e-15_dp, "behind the drum")
    call check(is_clear(boundaries, 0.09_dp, [-0.9_dp, 0.0_dp]), "a small grain at the drum")
    call check(.not. is_clear(boundaries, 0.11_dp, [-0.9_dp, 0.0_dp]), "a large grain at the drum")
    call check(.not. is_clear(boundaries, 0.1_dp, [0.25_dp, 0.0_dp]), "a grain behind the segment that touches it")
    boundaries(2)%present = .false.
    call check(is_clear(boundaries, 0.1_dp, [0.25_dp, 0.0_dp]), "the segment is taken away")
    call check(is_clear(boundaries(1:0), 1.0_dp, [0.0_dp, 0.0_dp]), "no boundaries")
  end subroutine test_distances

  subroutine test_ways()
    type(boundary_t), allocatable :: boundaries(:)
    real(dp) :: from(2)

    call make_boundaries(boundaries)
    from(:) = [-0.5_dp, 0.0_dp]
    call check(is_seen(boundaries, from, [0.0_dp, 0.3_dp]), "before the segment")
    call check(is_seen(boundaries, from, from), "the point itself")
    call check(.not. is_seen(boundaries, from, [0.5_dp, 0.0_dp]), "behind the segment")
    call check(is_seen(boundaries, from, [0.5_dp, 0.75_dp]), "past the end of the segment")
    call check(.not. is_seen(boundaries, from, [0.5_dp, 0.7_dp]), "not past its end")
    ! at the other side of a period of 3, of which the image is before the segment
    boundaries(1)%period(1) = 3.0_dp
    boundaries(2)%period(1) = 3.0_dp
    call check(is_seen(boundaries, from, [2.1_dp, 0.0_dp]), "an image that is seen")
    boundaries(1)%period(1) = 0.0_dp
    boundaries(2)%period(1) = 0.0_dp
    boundaries(2)%present = .false.
    call check(is_seen(boundaries, from, [0.5_dp, 0.0_dp]), "a segment that is taken away")
    call check(is_seen(boundaries(1:0), from, [9.0_dp, 0.0_dp]), "no boundaries")
  end subroutine test_ways

  subroutine test_box()
    type(held_box_t) :: box
    real(dp), parameter :: before(2) = [0.0_dp, 0.3_dp], behind(2) = [0.5_dp, 0.0_dp], at(2) = [0.25_dp, 0.0_dp]
    integer :: round

    box%nd = 2
    box%lower(1:2) = -1.0_dp
    box%upper(1:2) = 1.0_dp
    call check(box%leaves_room(0.1_dp, at) .and. box%sample_box_t%leaves_room(0.1_dp, at), "a box without boundaries")
    call make_boundaries(box%boundaries)
    box%inner_point(1:2) = [-0.5_dp, 0.0_dp]
    do round = 1, 2
      box%is_held = round == 2
      call check(box%leaves_room(0.1_dp, before), "before the segment")
      call check(box%leaves_room(0.1_dp, behind) .eqv. round == 1, "behind the segment")
      call check(.not. box%leaves_room(0.1_dp, at), "at the segment")
    end do
    call check_equal(index(box%too_many(0.5_dp), "too many grains for the space inside the boundaries, or"), 1, "held")
    box%is_held = .false.
    call check_equal(index(box%too_many(0.5_dp), "solid fraction 5.00E-01 is too high beside the boundaries"), 1, "not held")
  end subroutine test_box

end program test_held_box
