!> Grains placed in a box: no overlap, across periodic sides too, all inside, and the same bits on any number of ranks, however
!> the grains are spread over them: every rank also places all grains alone.
program test_loose_packing
  use mpi_f08, only: MPI_COMM_SELF
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, status_input
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_random_hash, only: hash_uniform
  use gravier_motion, only: grain_mass
  use gravier_placed_grains, only: sample_box_t
  use gravier_loose_packing, only: place_loosely
  use gravier_lattice_packing, only: lattice_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  !> how grains are spread over the ranks
  integer, parameter :: in_blocks = 1, in_turn = 2, on_last = 3
  !> identifiers need not be consecutive, nor start at 1
  integer(i8), parameter :: id_step = 7, id_first = 2_i8**40
  logical, parameter :: all_solid(3) = .false., all_periodic(3) = .true., last_solid(3) = [.true., .true., .false.], &
    & first_periodic(3) = [.true., .false., .false.]
  type(communicator_t) :: comm, alone

  call start_parallel()
  call comm%init()
  call alone%init(MPI_COMM_SELF)
  call test_equal(2, all_solid, 0.45_dp, in_blocks)
  call test_equal(2, all_periodic, 0.5_dp, in_turn)
  call test_equal(3, all_solid, 0.2_dp, in_turn)
  call test_equal(3, last_solid, 0.3_dp, in_blocks)
  call test_equal(3, all_periodic, 0.3_dp, on_last)
  call test_ratio(2, all_periodic)
  call test_ratio(2, first_periodic)
  call test_ratio(3, last_solid)
  call test_one_grain()
  call test_nothing()
  call test_refusals()
  call test_lattice(2)
  call test_lattice(3)
  call test_lattice_refusals()
  call finish_checks()
  call alone%free()
  call comm%free()
  call stop_parallel()

contains

  !> A box of edges a, b and c, its corner away from the origin.
  type(sample_box_t) function make_box(nd, periodic, a, b, c) result(box)
    integer, intent(in) :: nd
    logical, intent(in) :: periodic(3)
    real(dp), intent(in) :: a, b, c
    box%nd = nd
    box%lower(:) = [-1.5_dp, 0.25_dp, 3.0_dp]
    box%upper(1) = box%lower(1) + a
    box%upper(2) = box%lower(2) + b
    box%upper(3) = box%lower(3) + c
    box%periodic(:) = periodic
  end function make_box

  !> Rank that has grain `k` of `n`.
  integer function rank_of(k, n, spread) result(rank)
    integer, intent(in) :: k, n, spread
    select case (spread)
    case (in_blocks)
      rank = ((k - 1)*comm%size)/n
    case (in_turn)
      rank = mod(k, comm%size)
    case default
      rank = comm%size - 1
    end select
  end function rank_of

  !> Those of `n` grains that this rank has.
  subroutine find_own(n, spread, own)
    integer, intent(in) :: n, spread
    integer(i8), allocatable, intent(out) :: own(:)
    integer :: k, m, pass

    do pass = 1, 2
      m = 0
      do k = 1, n
        if (rank_of(k, n, spread) /= comm%rank) cycle
        m = m + 1
        if (pass == 2) own(m) = k
      end do
      if (pass == 1) allocate (own(m))
    end do
  end subroutine find_own

  !> Grains of one radius, and of radii from 0.8 to 1.2 of it, in a box that is longer along its first axis.
  subroutine test_equal(nd, periodic, fraction, spread)
    integer, intent(in) :: nd, spread
    logical, intent(in) :: periodic(3)
    real(dp), intent(in) :: fraction
    integer, parameter :: n = 800
    real(dp) :: radius(n), edge
    integer :: k, width

    do width = 0, 1
      edge = 0.0_dp
      do k = 1, n
        radius(k) = 0.02_dp*(1.0_dp + width*(0.4_dp*hash_uniform(1, int(k, i8), 0) - 0.2_dp))
        edge = edge + grain_mass(nd, radius(k), 1.0_dp)
      end do
      edge = (edge/fraction/2)**(1.0_dp/nd)
      call check_placement(make_box(nd, periodic, 2*edge, edge, edge), radius, spread, "narrow distribution")
    end do
  end subroutine test_equal

  !> Radii of 1, 0.1 and 0.01 in a box hardly wider than the largest grain, so that grains meet their own images.
  subroutine test_ratio(nd, periodic)
    integer, intent(in) :: nd
    logical, intent(in) :: periodic(3)
    real(dp) :: radius(903)

    radius(:) = 0.01_dp
    radius(5:900:29) = 0.1_dp
    radius([3, 450, 903]) = 1.0_dp
    call check_placement(make_box(nd, periodic, 8.0_dp, 2.05_dp, 2.1_dp), radius, in_turn, "radii of 1 to 100")
  end subroutine test_ratio

  !> Place grains on the ranks and alone; compare and check.
  subroutine check_placement(box, radius, spread, name)
    type(sample_box_t), intent(in) :: box
    real(dp), intent(in) :: radius(:)
    integer, intent(in) :: spread
    character(len=*), intent(in) :: name
    type(error_t), allocatable :: error
    integer(i8), allocatable :: own(:), id(:)
    real(dp), allocatable :: own_radius(:), position(:, :), expected(:, :)
    integer :: k
    logical :: same

    call find_own(size(radius), spread, own)
    id = id_first + id_step*own
    allocate (own_radius(size(own)), position(box%nd, size(own)), expected(box%nd, size(radius)))
    own_radius(:) = radius(own)
    call place_loosely(comm, box, 11, id, own_radius, position, error)
    call check(.not. allocated(error), name//": placed")
    deallocate (id)
    allocate (id(size(radius)))
    do k = 1, size(radius)
      id(k) = id_first + id_step*k
    end do
    deallocate (own_radius)
    allocate (own_radius, source=radius)
    call place_loosely(alone, box, 11, id, own_radius, expected, error)
    call check(.not. allocated(error), name//": placed alone")
    same = .true.
    do k = 1, size(own)
      same = same .and. all(abs(position(:, k) - expected(:, own(k))) <= 0.0_dp)
    end do
    call check(same, name//": the same bits as on one rank")
    call check_inside(box, radius, expected, name)
    call check(smallest_gap(box, radius, expected) >= -1e-14_dp, name//": no overlap")
  end subroutine check_placement

  !> Centres in the box along periodic axes, grains in the box along the others, to a rounding.
  subroutine check_inside(box, radius, position, name)
    type(sample_box_t), intent(in) :: box
    real(dp), intent(in) :: radius(:), position(:, :)
    character(len=*), intent(in) :: name
    integer :: d

    do d = 1, box%nd
      if (box%periodic(d)) then
        call check(all(position(d, :) >= box%lower(d)) .and. all(position(d, :) < box%upper(d)), name//": in the period")
      else
        call check(all(position(d, :) - radius >= box%lower(d) - 1e-14_dp) .and. &
          & all(position(d, :) + radius <= box%upper(d) + 1e-14_dp), name//": inside")
      end if
    end do
  end subroutine check_inside

  !> Smallest gap between two grains, and between a grain and an image.
  real(dp) function smallest_gap(box, radius, position) result(gap)
    type(sample_box_t), intent(in) :: box
    real(dp), intent(in) :: radius(:), position(:, :)
    real(dp) :: shift(3)
    integer :: i, j, k, a, b, images(3)

    images(:) = merge(1, 0, box%periodic)
    images(box%nd + 1:) = 0
    gap = huge(1.0_dp)
    do k = -images(3), images(3)
      do j = -images(2), images(2)
        do i = -images(1), images(1)
          shift(1) = i*(box%upper(1) - box%lower(1))
          shift(2) = j*(box%upper(2) - box%lower(2))
          shift(3) = k*(box%upper(3) - box%lower(3))
          do b = 1, size(radius)
            do a = 1, b
              if (a == b .and. i == 0 .and. j == 0 .and. k == 0) cycle
              gap = min(gap, norm2(position(:, a) + shift(1:box%nd) - position(:, b)) - radius(a) - radius(b))
            end do
          end do
        end do
      end do
    end do
  end function smallest_gap

  !> One grain fills a box without play.
  subroutine test_one_grain()
    type(sample_box_t) :: box
    type(error_t), allocatable :: error
    integer(i8) :: id(1)
    real(dp) :: radius(1), position(3, 1)
    integer :: n

    n = merge(1, 0, comm%rank == comm%size - 1)
    id(:) = 5
    radius(:) = 0.5_dp
    box = make_box(3, all_solid, 1.0_dp, 1.0_dp, 1.0_dp)
    call place_loosely(comm, box, 1, id(1:n), radius(1:n), position(:, 1:n), error)
    call check(.not. allocated(error), "one grain: placed")
    if (n == 1) position(:, 1) = position(:, 1) - 0.5_dp*(box%lower + box%upper)
    if (n == 1) call check_close(maxval(abs(position)), 0.0_dp, 1e-15_dp, "one grain: in the middle")
  end subroutine test_one_grain

  subroutine test_nothing()
    type(error_t), allocatable :: error
    integer(i8) :: id(0)
    real(dp) :: radius(0), position(2, 0)
    call place_loosely(comm, make_box(2, all_solid, 1.0_dp, 1.0_dp, 1.0_dp), 1, id, radius, position, error)
    call check(.not. allocated(error), "no grains")
  end subroutine test_nothing

  !> Too many grains, and grains that are too large: an error on every rank.
  subroutine test_refusals()
    integer, parameter :: n = 600
    integer(i8), allocatable :: id(:)
    real(dp), allocatable :: radius(:), position(:, :)
    type(error_t), allocatable :: error

    call find_own(n, in_blocks, id)
    allocate (radius(size(id)), position(2, size(id)))
    radius(:) = sqrt(0.7_dp/(n*acos(-1.0_dp)))
    call place_loosely(comm, make_box(2, all_periodic, 1.0_dp, 1.0_dp, 1.0_dp), 1, id, radius, position, error)
    call expect(error, "solid fraction 7.00E-01 is too high: of 600 grains, ")
    where (id == n) radius(:) = 0.5001_dp
    call place_loosely(comm, make_box(2, all_periodic, 2.0_dp, 1.0_dp, 1.0_dp), 1, id, radius, position, error)
    call expect(error, "m wide along axis 2")
  end subroutine test_refusals

  subroutine expect(error, part)
    type(error_t), allocatable, intent(inout) :: error
    character(len=*), intent(in) :: part

    call check(allocated(error), "an error: "//part)
    if (.not. allocated(error)) return
    call check_equal(error%status, status_input, "status: "//part)
    call check(index(error%message, part) > 0, "'"//part//"' in: "//error%message)
    deallocate (error)
  end subroutine expect

  !> One grain a cell, with room, in rows from the bottom; 38 grains in 4 (or 4 by 3) cells a layer.
  subroutine test_lattice(nd)
    integer, intent(in) :: nd
    integer, parameter :: n = 38
    real(dp), parameter :: edge = 1.05_dp*2*0.3_dp
    type(sample_box_t) :: box
    type(lattice_t) :: lattice
    type(error_t), allocatable :: error
    integer(i8) :: id(n)
    real(dp) :: radius(n), position(nd, n), single(nd, 1)
    integer :: k

    do k = 1, n
      id(k) = k
      radius(k) = 0.3_dp - 0.2_dp*hash_uniform(2, id(k), 0)
    end do
    ! whole cells along the first axis, whatever the rounding of the width
    box = make_box(nd, last_solid, 4*edge, 3.9_dp*edge, 0.0_dp)
    if (nd == 2) box%upper(2) = box%lower(2)
    call lattice%init(box, 0.3_dp, int(n, i8), error)
    call check(.not. allocated(error), "lattice: made")
    call check_equal(lattice%cells(1), 4_i8, "lattice: cells of a row")
    call check_equal(lattice%cells(nd), merge(10_i8, 4_i8, nd == 2), "lattice: layers")
    call check_close(lattice%height(), lattice%cells(nd)*edge, 1e-14_dp, "lattice: height")
    call lattice%place(5, id, radius, position)
    box%upper(nd) = box%lower(nd) + lattice%height()
    call check_inside(box, radius, position, "lattice")
    call check(smallest_gap(box, radius, position) >= -1e-14_dp, "lattice: no overlap")
    call check(all(position(nd, 1:4) < box%lower(nd) + edge), "lattice: the first row is at the bottom")
    call check(position(nd, n) > box%lower(nd) + (lattice%cells(nd) - 1)*edge, "lattice: the last one is at the top")
    call lattice%place(5, id(17:17), radius(17:17), single)
    call check(all(abs(single(:, 1) - position(:, 17)) <= 0.0_dp), "lattice: a grain by itself")
    box%upper(nd) = box%lower(nd) + (1.0_dp - 1e-6_dp)*lattice%height()
    call lattice%init(box, 0.3_dp, int(n, i8), error)
    call expect(error, "m high, but a lattice of 38 grains is")
  end subroutine test_lattice

  subroutine test_lattice_refusals()
    type(lattice_t) :: lattice
    type(error_t), allocatable :: error
    integer :: k

    call lattice%init(make_box(3, all_solid, 1.0_dp, 0.6_dp, 1.0_dp), 0.3_dp, 1_i8, error)
    call expect(error, "m wide along axis 2")
    call lattice%init(make_box(3, all_solid, 1e9_dp, 1e9_dp, 1.0_dp), 0.3_dp, 10_i8, error)
    call check(.not. allocated(error), "a few grains in a wide box")
    call check_close(lattice%height(), 0.63_dp, 1e-15_dp, "height of one layer")
    ! the difference of the corners may be a rounding less than whole cells
    do k = 1, 60
      call lattice%init(make_box(2, all_solid, k*lattice%edge, 0.0_dp, 0.0_dp), 0.3_dp, 1000_i8, error)
      call check_equal(lattice%cells(1), int(k, i8), "whole cells in the width")
    end do
  end subroutine test_lattice_refusals

end program test_loose_packing
