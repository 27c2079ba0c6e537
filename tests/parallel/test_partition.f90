!> Partitions of space: grids of boxes and shared out cells. Every point has one owner, `near` misses nobody, all ranks
!> have the same partition, parts are balanced, impossible numbers are refused.
program test_partition
  use mpi_f08, only: MPI_COMM_SELF
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, status_input
  use gravier_random_hash, only: hash_uniform
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_body_store, only: body_set_t
  use gravier_partition, only: partition_t, choose_boxes
  use gravier_check, only: check, check_equal, finish_checks
  implicit none
  integer, parameter :: n_grains = 1500
  type(communicator_t) :: comm, alone

  call start_parallel()
  call comm%init()
  call alone%init(MPI_COMM_SELF)
  call test_boxes()
  call test_corners()
  call test_choice()
  call test_too_many_boxes()
  call test_shared_cells(2, 1)
  call test_shared_cells(2, 7)
  call test_shared_cells(2, 30)
  call test_shared_cells(3, 2)
  call test_shared_cells(3, 12)
  call test_all_cells()
  call test_too_many_parts()
  call test_change_of_kind()
  call finish_checks()
  call alone%free()
  call comm%free()
  call stop_parallel()

contains

  !> Uniform in [low, high).
  real(dp) function draw(k, stream, low, high)
    integer, intent(in) :: k, stream
    real(dp), intent(in) :: low, high
    draw = low + (high - low)*hash_uniform(1, int(k, i8), stream)
  end function draw

  subroutine test_boxes()
    call check_boxes(2, 1, 1, 1)
    call check_boxes(2, 4, 3, 1)
    call check_boxes(2, 1, 7, 1)
    call check_boxes(3, 2, 3, 4)
    call check_boxes(3, 5, 1, 2)
  end subroutine test_boxes

  subroutine check_boxes(nd, a, b, c)
    integer, intent(in) :: nd, a, b, c
    type(partition_t) :: partition
    type(error_t), allocatable :: error
    real(dp), parameter :: lower(3) = [-1.0_dp, 0.5_dp, 10.0_dp], upper(3) = [2.0_dp, 4.5_dp, 11.0_dp]
    integer :: boxes(3)

    boxes(1) = a
    boxes(2) = b
    boxes(3) = c
    call partition%init_grid(lower(1:nd), upper(1:nd), boxes, 0.05_dp, error)
    call check(.not. allocated(error), "boxes")
    call check_equal(partition%n_subdomains, a*b*c, "number of boxes")
    call check_owners(partition, lower(1:nd), upper(1:nd), boxes)
    call check_near(partition, lower(1:nd), upper(1:nd))
  end subroutine check_boxes

  !> Points inside belong to the box that holds them, points outside to the box of the nearest point inside.
  subroutine check_owners(partition, lower, upper, boxes)
    type(partition_t), intent(in) :: partition
    real(dp), intent(in) :: lower(:), upper(:)
    integer, intent(in) :: boxes(3)
    real(dp) :: point(size(lower)), x
    integer :: k, d, place, expected, stride
    logical :: right

    right = .true.
    do k = 1, 3000
      expected = 1
      stride = 1
      do d = 1, size(lower)
        point(d) = draw(k, d, 1.5_dp*lower(d) - 0.5_dp*upper(d), 1.5_dp*upper(d) - 0.5_dp*lower(d))
        x = (point(d) - lower(d))/(upper(d) - lower(d))
        place = max(0, min(boxes(d) - 1, floor(x*boxes(d))))
        expected = expected + stride*place
        stride = stride*boxes(d)
      end do
      right = right .and. partition%owner(point) == expected
    end do
    call check(right, "owner of a point, the first axis fastest")
  end subroutine check_owners

  !> `near` lists subdomains of the partition, each once, and among them the owner of every point within reach: random
  !> points on the sphere of that radius and inside, and the points straight along the axes.
  subroutine check_near(partition, lower, upper)
    type(partition_t), intent(in) :: partition
    real(dp), intent(in) :: lower(:), upper(:)
    real(dp) :: point(size(lower)), other(size(lower)), direction(size(lower)), reach
    integer, allocatable :: list(:)
    integer :: k, j, d, n, m
    logical :: complete, once, own

    allocate (list(1))
    complete = .true.
    once = .true.
    own = .true.
    do k = 1, 400
      reach = draw(k, 21, 0.0_dp, 0.7_dp)**3
      do d = 1, size(lower)
        point(d) = draw(k, 10 + d, 1.2_dp*lower(d) - 0.2_dp*upper(d), 1.2_dp*upper(d) - 0.2_dp*lower(d))
      end do
      call partition%near(point, reach, list, n)
      own = own .and. any(list(1:n) == partition%owner(point))
      do j = 1, n
        once = once .and. count(list(1:n) == list(j)) == 1 .and. list(j) >= 1 .and. list(j) <= partition%n_subdomains
      end do
      do j = 1, 40
        if (j <= 2*size(lower)) then
          direction(:) = 0.0_dp
          direction(1 + mod(j, size(lower))) = merge(1.0_dp, -1.0_dp, j > size(lower))
        else
          do d = 1, size(lower)
            direction(d) = draw(100*k + j, 30 + d, -1.0_dp, 1.0_dp)
          end do
          direction(:) = direction/norm2(direction)
          if (mod(j, 2) == 0) direction(:) = direction*draw(100*k + j, 35, 0.0_dp, 1.0_dp)
        end if
        other(:) = point + reach*direction
        m = partition%owner(other)
        complete = complete .and. any(list(1:n) == m)
      end do
    end do
    call check(own, "near: the owner of the point itself")
    call check(once, "near: subdomains of the partition, each once")
    call check(complete, "near: the owner of every point within reach")
    ! nobody is left out by a reach beyond the box
    point(:) = lower
    call partition%near(point, 2*norm2(upper - lower), list, n)
    call check_equal(n, partition%n_subdomains, "near: everybody")
  end subroutine check_near

  !> Corners and faces of boxes, with numbers that are exact: the point belongs to the upper box, and to the last one at
  !> the upper end. Points to both sides are near.
  subroutine test_corners()
    type(partition_t) :: partition
    type(error_t), allocatable :: error
    integer, allocatable :: list(:)
    integer :: n

    allocate (list(0))
    call partition%init_grid([0.0_dp, 0.0_dp], [4.0_dp, 2.0_dp], [4, 2, 1], 0.25_dp, error)
    call check_equal(partition%owner([1.0_dp, 1.0_dp]), 6, "a corner")
    call check_equal(partition%owner([4.0_dp, 2.0_dp]), 8, "the upper corner")
    call check_equal(partition%owner([0.0_dp, 0.0_dp]), 1, "the lower corner")
    call check_equal(partition%owner([-1.0e300_dp, 1.0e300_dp]), 5, "far away")
    call partition%near([1.5_dp, 0.5_dp], 0.4_dp, list, n)
    call check_equal(n, 1, "inside of a box")
    call partition%near([1.5_dp, 0.5_dp], 0.5_dp, list, n)
    call check_equal(n, 6, "to the faces of a box")
    call partition%near([1.0_dp, 1.0_dp], 0.0_dp, list, n)
    call check_equal(n, 4, "at a corner")
  end subroutine test_corners

  !> The boxes chosen have the product asked for, and no other factorisation cuts less.
  subroutine test_choice()
    integer :: n, boxes(3), a, b, c, nd
    real(dp) :: upper(3), least
    real(dp), parameter :: lower(3) = 0.0_dp
    logical :: right

    upper(1) = 3.0_dp
    upper(2) = 1.0_dp
    upper(3) = 2.0_dp
    do nd = 2, 3
      right = .true.
      do n = 1, 60
        boxes(:) = choose_boxes(lower(1:nd), upper(1:nd), n)
        right = right .and. product(boxes) == n .and. (nd == 3 .or. boxes(3) == 1)
        least = huge(1.0_dp)
        do a = 1, n
          do b = 1, n
            do c = 1, n
              if (a*b*c == n .and. (nd == 3 .or. c == 1)) least = min(least, cut(nd, upper, a, b, c))
            end do
          end do
        end do
        ! the same terms in another order
        right = right .and. cut(nd, upper, boxes(1), boxes(2), boxes(3)) <= least*(1.0_dp + 1.0e-12_dp)
      end do
      call check(right, "boxes that cut the least")
    end do
    upper(1) = 100.0_dp
    boxes(:) = choose_boxes(lower(1:2), upper(1:2), 6)
    call check_equal(boxes(1), 6, "slices of what is long")
    boxes(:) = choose_boxes(lower(1:2), lower(1:2), 4)
    call check_equal(product(boxes), 4, "boxes of a point")
  end subroutine test_choice

  !> Surface inside a box that is cut into a x b x c equal ones.
  pure real(dp) function cut(nd, extent, a, b, c)
    integer, intent(in) :: nd, a, b, c
    real(dp), intent(in) :: extent(3)
    real(dp) :: depth
    depth = merge(extent(3), 1.0_dp, nd == 3)
    cut = (a - 1)*extent(2)*depth + (b - 1)*extent(1)*depth
    if (nd == 3) cut = cut + (c - 1)*extent(1)*extent(2)
  end function cut

  subroutine check_refused(error, wanted, most)
    type(error_t), allocatable, intent(in) :: error
    integer, intent(in) :: wanted, most
    character(len=12) :: numbers(2)

    call check(allocated(error), "too many subdomains are refused")
    if (.not. allocated(error)) return
    write (numbers, "(i0)") wanted, most
    call check_equal(error%status, status_input, "too many subdomains: status")
    call check(index(error%message, "subdomains = "//trim(numbers(1))//":") > 0 .and. &
      & index(error%message, "at most "//trim(numbers(2))//" ") > 0, "too many subdomains: "//error%message)
  end subroutine check_refused

  !> 4 x 2 cells of edge 1: 8 boxes are as many as there may be.
  subroutine test_too_many_boxes()
    type(partition_t) :: partition
    type(error_t), allocatable :: error

    call partition%init_grid([0.0_dp, 0.0_dp], [3.5_dp, 1.5_dp], [4, 2, 1], 1.0_dp, error)
    call check(.not. allocated(error), "as many boxes as cells")
    call partition%init_grid([0.0_dp, 0.0_dp], [3.5_dp, 1.5_dp], [3, 3, 1], 1.0_dp, error)
    call check_refused(error, 9, 8)
  end subroutine test_too_many_boxes

  !> Grains of this rank: a heap, denser to one side, on part of the box only. Of `ranks` ranks, or all on this one.
  subroutine make_grains(nd, rank, ranks, bodies)
    integer, intent(in) :: nd, rank, ranks
    type(body_set_t), allocatable, intent(out) :: bodies(:)
    integer :: g, d, s, n

    allocate (bodies(2))
    do s = 1, 2
      n = 0
      do g = 1, n_grains
        if (1 + mod(7*g, 2*ranks) == 2*rank + s) n = n + 1
      end do
      call bodies(s)%init(nd, nd, n)
      n = 0
      do g = 1, n_grains
        if (1 + mod(7*g, 2*ranks) /= 2*rank + s) cycle
        n = n + 1
        bodies(s)%id(n) = g
        bodies(s)%position(1, n) = draw(g, 51, 0.0_dp, 1.0_dp)**2
        do d = 2, nd
          bodies(s)%position(d, n) = draw(g, 50 + d, 0.0_dp, 0.8_dp)
        end do
      end do
    end do
  end subroutine make_grains

  subroutine test_shared_cells(nd, n)
    integer, intent(in) :: nd, n
    type(partition_t) :: partition, serial
    type(error_t), allocatable :: error
    type(body_set_t), allocatable :: bodies(:), all_bodies(:)
    real(dp) :: lower(nd), upper(nd), edge
    integer, allocatable :: list(:)
    integer :: cell, next
    logical :: right

    lower(:) = 0.0_dp
    upper(:) = 1.0_dp
    edge = merge(0.04_dp, 0.12_dp, nd == 2)
    call make_grains(nd, comm%rank, comm%size, bodies)
    call partition%init_graph(comm, lower, upper, edge, bodies, n, error)
    call check(.not. allocated(error), "cells shared out")
    call check_equal(partition%n_subdomains, n, "number of subdomains")
    associate (owner => partition%subdomain_of_cell)
      call check(all(owner >= 1 .and. owner <= n), "every cell has a subdomain")
      ! subdomains are numbered in the order in which cells with grains meet them
      right = .true.
      next = 1
      allocate (list(size(owner)), source=0)
      call count_grains(partition, nd, list)
      do cell = 1, size(owner)
        if (list(cell) == 0) cycle
        right = right .and. owner(cell) <= next
        if (owner(cell) == next) next = next + 1
      end do
      call check(right .and. next == n + 1, "subdomains numbered as the cells meet them, none without grains")
      call check_balance(owner, list, n)
    end associate
    call check_near(partition, lower, upper)
    ! one rank alone, with all grains, finds the same
    call make_grains(nd, 0, 1, all_bodies)
    call serial%init_graph(alone, lower, upper, edge, all_bodies, n, error)
    call check(all(serial%subdomain_of_cell == partition%subdomain_of_cell), "the same on any number of ranks")
  end subroutine test_shared_cells

  !> Grains of each cell.
  subroutine count_grains(partition, nd, counts)
    type(partition_t), intent(in) :: partition
    integer, intent(in) :: nd
    integer, intent(inout) :: counts(:)
    type(body_set_t), allocatable :: bodies(:)
    integer :: s, k, cell

    call make_grains(nd, 0, 1, bodies)
    do s = 1, size(bodies)
      do k = 1, bodies(s)%n
        cell = partition%cells%index_of(bodies(s)%position(:, k))
        counts(cell) = counts(cell) + 1
      end do
    end do
  end subroutine count_grains

  !> METIS allows 3 % over the mean, and a cell cannot be cut: a subdomain may hold one more of the fullest cells. It
  !> says nothing about the lightest one; half of the mean is what one may expect.
  subroutine check_balance(owner, grains, n)
    integer, intent(in) :: owner(:), grains(:), n
    integer :: s, held
    logical :: fair

    fair = .true.
    do s = 1, n
      held = sum(grains, mask=owner == s)
      fair = fair .and. held <= 1.03*n_grains/n + maxval(grains) .and. held >= 0.5*n_grains/n - maxval(grains) .and. held > 0
    end do
    call check(fair, "subdomains hold about as many grains")
    call check_equal(sum(grains), n_grains, "all grains are in cells")
  end subroutine check_balance

  !> A grain in each of 12 cells.
  subroutine make_row(bodies)
    type(body_set_t), allocatable, intent(out) :: bodies(:)
    integer :: k

    allocate (bodies(1))
    call bodies(1)%init(2, 2, merge(12, 0, comm%rank == comm%size - 1))
    do k = 1, bodies(1)%n
      bodies(1)%id(k) = k
      bodies(1)%position(1, k) = k - 0.5_dp
      bodies(1)%position(2, k) = 0.5_dp
    end do
  end subroutine make_row

  !> Two cells for each subdomain: none stays without. As many subdomains as cells: what is owned, is owned by one of
  !> them; METIS leaves some empty. Cells without grains go to a neighbour.
  subroutine test_all_cells()
    type(partition_t) :: partition
    type(error_t), allocatable :: error
    type(body_set_t), allocatable :: bodies(:)
    integer :: k, n
    real(dp) :: point(2)
    integer, allocatable :: met(:)

    call make_row(bodies)
    do n = 6, 12, 6
      call partition%init_graph(comm, [0.0_dp, 0.0_dp], [11.9_dp, 3.9_dp], 1.0_dp, bodies, n, error)
      call check(.not. allocated(error), "cells of a row")
      allocate (met(n), source=0)
      do k = 1, 12
        point(1) = k - 0.5_dp
        point(2) = 0.5_dp
        met(partition%owner(point)) = met(partition%owner(point)) + 1
      end do
      if (n == 6) call check(all(met == 2), "two cells for every subdomain")
      call check(all(partition%subdomain_of_cell >= 1 .and. partition%subdomain_of_cell <= n), "empty cells have a subdomain")
      ! three rows up: the owner of one of the cells that are three steps away, diagonal steps being allowed
      associate (row => partition%subdomain_of_cell(1:12))
        do k = 1, 12
          point(1) = k - 0.5_dp
          point(2) = 3.5_dp
          call check(any(row(max(1, k - 3):min(12, k + 3)) == partition%owner(point)), "an empty cell goes to a near subdomain")
        end do
      end associate
      deallocate (met)
    end do
  end subroutine test_all_cells

  subroutine test_too_many_parts()
    type(partition_t) :: partition
    type(error_t), allocatable :: error
    type(body_set_t), allocatable :: bodies(:)

    call make_row(bodies)
    call partition%init_graph(comm, [0.0_dp, 0.0_dp], [11.9_dp, 3.9_dp], 1.0_dp, bodies, 13, error)
    call check_refused(error, 13, 12)
  end subroutine test_too_many_parts

  !> A partition of cells that becomes one of boxes forgets the cells, and the other way round.
  subroutine test_change_of_kind()
    type(partition_t) :: partition
    type(error_t), allocatable :: error
    type(body_set_t), allocatable :: bodies(:)

    call make_row(bodies)
    call partition%init_graph(comm, [0.0_dp, 0.0_dp], [11.9_dp, 3.9_dp], 1.0_dp, bodies, 12, error)
    call partition%init_grid([0.0_dp, 0.0_dp], [12.0_dp, 4.0_dp], [3, 1, 1], 1.0_dp, error)
    call check_equal(partition%owner([11.0_dp, 1.0_dp]), 3, "boxes after cells")
    call partition%init_graph(comm, [0.0_dp, 0.0_dp], [11.9_dp, 3.9_dp], 1.0_dp, bodies, 6, error)
    call check_equal(partition%owner([11.5_dp, 0.5_dp]), 6, "cells after boxes")
    call check_equal(partition%n_subdomains, 6, "subdomains of cells after boxes")
  end subroutine test_change_of_kind

end program test_partition
