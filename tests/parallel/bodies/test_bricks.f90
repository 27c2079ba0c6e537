!> Bricks of a box: every rank has one, each point of the box belongs to one rank, and records go to every rank that has a point
!> within reach, once, over the ends of periodic axes too; outboxes that grow deliver what was put in them.
program test_bricks
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  use gravier_communicator, only: communicator_t
  use gravier_random_hash, only: hash_uniform
  use gravier_placed_grains, only: sample_box_t
  use gravier_bricks, only: outbox_t, bricks_t
  use gravier_check, only: check, check_equal, finish_checks
  implicit none

  type(communicator_t) :: comm
  integer, parameter :: counts(7) = [1, 2, 4, 6, 7, 12, 60]
  integer :: nd, k

  call MPI_Init()
  call comm%init()
  do nd = 2, 3
    do k = 1, size(counts)
      call test_box(nd, counts(k), .false., 0.2_dp)
      call test_box(nd, counts(k), .true., 0.2_dp)
      ! around the whole period
      call test_box(nd, counts(k), .true., 0.95_dp)
    end do
  end do
  call test_cuts()
  call test_exchange()
  call comm%free()
  call finish_checks()
  call MPI_Finalize()

contains

  !> A box of 2 by 1 by 1.5, periodic along the first axis or along none.
  subroutine make_box(nd, periodic, box)
    integer, intent(in) :: nd
    logical, intent(in) :: periodic
    type(sample_box_t), intent(out) :: box

    box%nd = nd
    box%lower(:) = [-1.0_dp, 0.0_dp, 0.5_dp]
    box%upper(:) = [1.0_dp, 1.0_dp, 2.0_dp]
    box%periodic(1) = periodic
  end subroutine make_box

  !> A point of the box at random.
  subroutine draw_point(box, k, x)
    type(sample_box_t), intent(in) :: box
    integer, intent(in) :: k
    real(dp), intent(out) :: x(:)
    integer :: d

    do d = 1, size(x)
      x(d) = box%lower(d) + (box%upper(d) - box%lower(d))*hash_uniform(31, int(k, i8), d)
    end do
  end subroutine draw_point

  subroutine test_box(nd, n_bricks, periodic, reach)
    integer, intent(in) :: nd, n_bricks
    logical, intent(in) :: periodic
    real(dp), intent(in) :: reach
    integer, parameter :: n_points = 300
    type(sample_box_t) :: box
    type(bricks_t) :: bricks
    type(outbox_t) :: outbox
    real(dp) :: x(nd), y(nd), way(nd)
    integer(i8) :: record(1)
    logical :: met(0:n_bricks - 1), inside, told
    integer :: k, j, rank

    call make_box(nd, periodic, box)
    call bricks%init(box, n_bricks)
    call check_equal(product(bricks%n), n_bricks, "as many bricks as asked for")
    met(:) = .false.
    inside = .true.
    do k = 1, 10*n_points
      call draw_point(box, k, x)
      rank = bricks%rank_of(x)
      inside = inside .and. rank >= 0 .and. rank < n_bricks
      if (inside) met(rank) = .true.
    end do
    call check(inside, "every point has a rank")
    call check(all(met), "every rank has points")
    told = .true.
    do k = 1, n_points
      call draw_point(box, k, x)
      call outbox%init(1, 1)
      record(1) = k
      call bricks%add_within_reach(x, reach, record, outbox)
      told = told .and. any(outbox%destination(1:outbox%n) == bricks%rank_of(x)) .and. all(outbox%records(1, 1:outbox%n) == k)
      do j = 1, n_points
        call draw_point(box, n_points + j, y)
        way(:) = y - x
        if (periodic) way(1) = way(1) - 2.0_dp*anint(way(1)/2.0_dp)
        if (all(abs(way) <= reach)) told = told .and. count(outbox%destination(1:outbox%n) == bricks%rank_of(y)) == 1
      end do
    end do
    call check(told, "every rank within reach is told, once")
  end subroutine test_box

  !> The longest edge of a brick is cut first.
  subroutine test_cuts()
    type(sample_box_t) :: box
    type(bricks_t) :: bricks

    call make_box(3, .false., box)
    call bricks%init(box, 2)
    call check(all(bricks%n == [2, 1, 1]), "two bricks")
    call bricks%init(box, 6)
    call check(all(bricks%n == [3, 1, 2]), "six bricks")
  end subroutine test_cuts

  !> Each rank sends each rank (including itself) records that say who sent them, more than it has room for at first.
  subroutine test_exchange()
    integer, parameter :: each = 5
    type(outbox_t) :: outbox
    integer(i8), allocatable :: received(:, :)
    integer(i8) :: record(3)
    logical :: found(each, 0:comm%size - 1), once
    integer :: rank, k

    call outbox%init(3, 2)
    do k = 1, each
      do rank = 0, comm%size - 1
        record(1) = comm%rank
        record(2) = k
        record(3) = rank
        call outbox%add(rank, record)
      end do
    end do
    call check_equal(outbox%n, each*comm%size, "records in the outbox")
    call outbox%exchange(comm, received)
    call check_equal(size(received, 2), each*comm%size, "records received")
    found(:, :) = .false.
    once = .true.
    do k = 1, size(received, 2)
      once = once .and. received(3, k) == comm%rank .and. .not. found(narrow(received(2, k)), narrow(received(1, k)))
      found(narrow(received(2, k)), narrow(received(1, k))) = .true.
    end do
    call check(once .and. all(found), "each record arrives once")
    call outbox%init(2, 0)
    call outbox%exchange(comm, received)
    call check_equal(size(received, 2), 0, "nothing sent")
  end subroutine test_exchange

end program test_bricks
