!> Partitions of space: grids of boxes, shared out cells, on one level and on two, with and without periodic axes. Every point
!> has one owner, `near` misses nobody, all ranks agree, parts are balanced, impossible numbers are refused, and a partition
!> that was saved answers as before.
program test_partition
  use mpi_f08, only: MPI_COMM_SELF
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, status_input
  use gravier_random_hash, only: hash_uniform
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_sparse_exchange, only: sparse_exchange
  use gravier_box_counts, only: choose_boxes, check_subdomains
  use gravier_partition, only: partition_t
  use gravier_cell_levels, only: share_out
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  integer, parameter :: n_grains = 1500
  !> places of a lattice along each axis, and points of a pile
  integer, parameter :: side = 64, most_in_pile = 16
  type(communicator_t) :: comm, alone

  call start_parallel()
  call comm%init()
  call alone%init(MPI_COMM_SELF)
  call test_boxes()
  call test_corners()
  call test_choice()
  call test_periodic_choice()
  call test_too_many_boxes()
  call test_shared_cells(2, 1)
  call test_shared_cells(2, 7)
  call test_shared_cells(2, 30)
  call test_shared_cells(3, 2)
  call test_shared_cells(3, 12)
  call test_all_cells()
  call test_too_many_parts()
  call test_change_of_kind()
  call test_periodic_boxes()
  call test_extremes()
  call test_weights()
  call test_share_out()
  call test_piles()
  call test_levels(2, 40, .false.)
  call test_levels(2, 25, .true.)
  call test_levels(3, 16, .true.)
  call test_levels(3, 33, .false.)
  call test_periodic_neighbours()
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
    call partition%set_box(lower(1:nd), upper(1:nd))
    call partition%init_grid(boxes, 0.05_dp, error)
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
    call partition%set_box([0.0_dp, 0.0_dp], [4.0_dp, 2.0_dp])
    call partition%init_grid([4, 2, 1], 0.25_dp, error)
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

    call partition%set_box([0.0_dp, 0.0_dp], [3.5_dp, 1.5_dp])
    call partition%init_grid([4, 2, 1], 1.0_dp, error)
    call check(.not. allocated(error), "as many boxes as cells")
    call partition%init_grid([3, 3, 1], 1.0_dp, error)
    call check_refused(error, 9, 8)
  end subroutine test_too_many_boxes

  !> Grains of rank `rank` of `ranks`: a heap, denser to one side, on part of the box only, each of weight 1.
  subroutine make_grains(nd, rank, ranks, points, weights)
    integer, intent(in) :: nd, rank, ranks
    real(dp), allocatable, intent(out) :: points(:, :)
    integer, allocatable, intent(out) :: weights(:)
    integer :: g, d, n, round

    do round = 1, 2
      n = 0
      do g = 1, n_grains
        if (mod(7*g, ranks) /= rank) cycle
        n = n + 1
        if (round == 1) cycle
        points(1, n) = draw(g, 51, 0.0_dp, 1.0_dp)**2
        do d = 2, nd
          points(d, n) = draw(g, 50 + d, 0.0_dp, 0.8_dp)
        end do
      end do
      if (round == 1) allocate (points(nd, n))
    end do
    allocate (weights(n), source=1)
  end subroutine make_grains

  subroutine test_shared_cells(nd, n)
    integer, intent(in) :: nd, n
    type(partition_t) :: partition, serial
    type(error_t), allocatable :: error
    real(dp), allocatable :: points(:, :)
    integer, allocatable :: weights(:), list(:)
    real(dp) :: lower(nd), upper(nd), edge
    integer :: cell, next
    logical :: right

    lower(:) = 0.0_dp
    upper(:) = 1.0_dp
    edge = merge(0.04_dp, 0.12_dp, nd == 2)
    call make_grains(nd, comm%rank, comm%size, points, weights)
    call partition%set_box(lower, upper)
    call partition%init_graph(comm, edge, points, weights, n, error)
    call check(.not. allocated(error), "cells shared out")
    call check_equal(partition%n_subdomains, n, "number of subdomains")
    associate (owner => partition%groups%maps(1)%subdomain)
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
    call check_saved(partition, nd)
    ! one rank alone, with all grains, finds the same
    call make_grains(nd, 0, 1, points, weights)
    call serial%set_box(lower, upper)
    call serial%init_graph(alone, edge, points, weights, n, error)
    call check(all(serial%groups%maps(1)%subdomain == partition%groups%maps(1)%subdomain), "the same on any number of ranks")
  end subroutine test_shared_cells

  !> Grains of each cell.
  subroutine count_grains(partition, nd, counts)
    type(partition_t), intent(in) :: partition
    integer, intent(in) :: nd
    integer, intent(inout) :: counts(:)
    real(dp), allocatable :: points(:, :)
    integer, allocatable :: weights(:)
    integer :: k, cell, place(3)

    call make_grains(nd, 0, 1, points, weights)
    do k = 1, size(weights)
      call partition%cells%locate(points(:, k), place)
      cell = partition%cells%cell_at(place)
      counts(cell) = counts(cell) + 1
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

  !> A grain in each of 12 cells, on the last rank.
  subroutine make_row(points, weights)
    real(dp), allocatable, intent(out) :: points(:, :)
    integer, allocatable, intent(out) :: weights(:)
    integer :: k

    allocate (points(2, merge(12, 0, comm%rank == comm%size - 1)), weights(merge(12, 0, comm%rank == comm%size - 1)))
    do k = 1, size(weights)
      weights(k) = 1
      points(1, k) = k - 0.5_dp
      points(2, k) = 0.5_dp
    end do
  end subroutine make_row

  !> Two cells for each subdomain: none stays without. As many subdomains as cells: what is owned, is owned by one of
  !> them; METIS leaves some empty. Cells without grains go to a neighbour.
  subroutine test_all_cells()
    type(partition_t) :: partition
    type(error_t), allocatable :: error
    real(dp), allocatable :: points(:, :)
    integer, allocatable :: weights(:)
    integer :: k, n
    real(dp) :: point(2)
    integer, allocatable :: met(:)

    call make_row(points, weights)
    call partition%set_box([0.0_dp, 0.0_dp], [11.9_dp, 3.9_dp])
    do n = 6, 12, 6
      call partition%init_graph(comm, 1.0_dp, points, weights, n, error)
      call check(.not. allocated(error), "cells of a row")
      allocate (met(n), source=0)
      do k = 1, 12
        point(1) = k - 0.5_dp
        point(2) = 0.5_dp
        met(partition%owner(point)) = met(partition%owner(point)) + 1
      end do
      if (n == 6) call check(all(met == 2), "two cells for every subdomain")
      associate (owner => partition%groups%maps(1)%subdomain)
        call check(all(owner >= 1 .and. owner <= n), "empty cells have a subdomain")
      end associate
      ! three rows up: the owner of one of the cells that are three steps away, diagonal steps being allowed
      associate (row => partition%groups%maps(1)%subdomain(1:12))
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
    real(dp), allocatable :: points(:, :)
    integer, allocatable :: weights(:)

    call make_row(points, weights)
    call partition%set_box([0.0_dp, 0.0_dp], [11.9_dp, 3.9_dp])
    call partition%init_graph(comm, 1.0_dp, points, weights, 13, error)
    call check_refused(error, 13, 12)
  end subroutine test_too_many_parts

  !> A partition of cells that becomes one of boxes forgets the cells, and the other way round.
  subroutine test_change_of_kind()
    type(partition_t) :: partition
    type(error_t), allocatable :: error
    real(dp), allocatable :: points(:, :)
    integer, allocatable :: weights(:)

    call make_row(points, weights)
    call partition%set_box([0.0_dp, 0.0_dp], [11.9_dp, 3.9_dp])
    call partition%init_graph(comm, 1.0_dp, points, weights, 12, error)
    call partition%set_box([0.0_dp, 0.0_dp], [12.0_dp, 4.0_dp])
    call partition%init_grid([3, 1, 1], 1.0_dp, error)
    call check_equal(partition%owner([11.0_dp, 1.0_dp]), 3, "boxes after cells")
    call partition%set_box([0.0_dp, 0.0_dp], [11.9_dp, 3.9_dp])
    call partition%init_graph(comm, 1.0_dp, points, weights, 6, error)
    call check_equal(partition%owner([11.5_dp, 0.5_dp]), 6, "cells after boxes")
    call check_equal(partition%n_subdomains, 6, "subdomains of cells after boxes")
  end subroutine test_change_of_kind

  !> Boxes on periodic axes: images have the same owner, and `near` looks through the faces.
  subroutine test_periodic_boxes()
    type(partition_t) :: partition
    type(error_t), allocatable :: error
    integer, allocatable :: list(:)
    integer :: n

    allocate (list(0))
    partition%period(1) = 4.0_dp
    call partition%set_box([0.0_dp, 0.0_dp], [4.0_dp, 2.0_dp])
    call partition%init_grid([4, 2, 1], 0.25_dp, error)
    call check_equal(partition%owner([4.0_dp, 2.0_dp]), 5, "the upper end is the lower end")
    call check_equal(partition%owner([-0.5_dp, 0.5_dp]), 4, "left of the box")
    call check_equal(partition%owner([9.5_dp, 5.0_dp]), 6, "two periods right, above")
    call check_equal(partition%relay([9.5_dp, 5.0_dp]), 6, "boxes need no relay")
    call partition%near([0.25_dp, 0.5_dp], 0.3_dp, list, n)
    call check(n == 2 .and. any(list(1:n) == 1) .and. any(list(1:n) == 4), "near through a face")
    call partition%near([0.5_dp, 0.5_dp], 1.9_dp, list, n)
    call check_equal(n, 8, "near all around")
    call check_near(partition, [0.0_dp, 0.0_dp], [4.0_dp, 2.0_dp])
    call check_saved(partition, 2)
    partition%period(:) = 1.7_dp
    call partition%set_box([0.3_dp, -1.0_dp, 0.1_dp], [2.0_dp, 0.7_dp, 1.8_dp])
    call partition%init_grid([3, 1, 2], 0.05_dp, error)
    call check_near(partition, [0.3_dp, -1.0_dp, 0.1_dp], [2.0_dp, 0.7_dp, 1.8_dp])
    call check_images(partition, 3)
  end subroutine test_periodic_boxes

  !> Points of the box, and their images within the roundings of a few periods: the same owner, unless a border is near.
  subroutine check_images(partition, nd)
    type(partition_t), intent(in) :: partition
    integer, intent(in) :: nd
    real(dp) :: point(nd), image(nd)
    integer, allocatable :: list(:)
    integer :: k, d, n
    logical :: same

    allocate (list(8))
    same = .true.
    do k = 1, 1000
      do d = 1, nd
        point(d) = draw(k, 60 + d, partition%lower(d), partition%upper(d))
        image(d) = point(d) + (mod(k*d, 7) - 3)*partition%period(d)
      end do
      call partition%near(point, 1.0e-12_dp, list, n)
      if (n == 1) same = same .and. partition%owner(image) == partition%owner(point)
    end do
    call check(same, "images have the owner of the point")
  end subroutine check_images

  !> Two boxes on a periodic axis meet twice: the other axis is cut although it is longer across.
  subroutine test_periodic_choice()
    integer :: boxes(3)

    boxes(:) = choose_boxes([0.0_dp, 0.0_dp], [1.5_dp, 1.0_dp], 2)
    call check(all(boxes == [2, 1, 1]), "the cut across the long axis")
    boxes(:) = choose_boxes([0.0_dp, 0.0_dp], [1.5_dp, 1.0_dp], 2, [1.5_dp, 0.0_dp])
    call check(all(boxes == [1, 2, 1]), "not where it has to be cut twice")
    boxes(:) = choose_boxes([0.0_dp, 0.0_dp], [1.5_dp, 1.0_dp], 2, [1.5_dp, 1.0_dp])
    call check(all(boxes == [2, 1, 1]), "both axes cut twice")
    ! a large prime, and many factors: at once
    boxes(:) = choose_boxes([0.0_dp, 0.0_dp], [1.0_dp, 2.0_dp], 2147483647)
    call check(all(boxes == [1, 2147483647, 1]), "boxes of a large prime")
    boxes(:) = choose_boxes([0.0_dp, 0.0_dp, 0.0_dp], [1.0_dp, 1.0_dp, 1.0_dp], 1073741824)
    call check(all(boxes == 1024), "boxes of a power of two")
  end subroutine test_periodic_choice

  !> Extents and numbers that integers and reals cannot count.
  subroutine test_extremes()
    type(partition_t) :: partition
    type(error_t), allocatable :: error
    real(dp), parameter :: far(3) = 8.0e307_dp
    real(dp) :: points(3, 2)

    call check_subdomains(-far, far, 1.0e-3_dp, huge(1), error)
    call check(.not. allocated(error), "cells without number")
    call check_subdomains([0.0_dp, 0.0_dp, 0.0_dp], [2.0e3_dp, 2.0e3_dp, 2.0e3_dp], 1.0_dp, huge(1), error)
    call check(.not. allocated(error), "more cells than integers")
    call partition%set_box([0.0_dp, 0.0_dp, 0.0_dp], [1.0_dp, 1.0_dp, 1.0_dp])
    call partition%init_grid([100000, 100000, 100000], 0.1_dp, error)
    call check(allocated(error), "a product of boxes without number")
    deallocate (error)
    points(:, 1) = -far
    points(:, 2) = far
    call partition%set_box(-far, far)
    call partition%init_graph(comm, 1.0e-3_dp, points, [1, 1], 2, error)
    call check(.not. allocated(error), "a graph of cells without number")
    call check(partition%owner(points(:, 1)) /= partition%owner(points(:, 2)), "parts of a scene without number")
  end subroutine test_extremes

  !> A row of 60 cells of weight 1, the last ten of weight 31 by their contacts (300 + 60 in all): parts of equal weight hold
  !> unequal numbers of cells. A grain of a contact of weight 0 counts for nothing.
  subroutine test_weights()
    type(partition_t) :: partition
    type(error_t), allocatable :: error
    real(dp), allocatable :: points(:, :)
    integer, allocatable :: weights(:)
    real(dp) :: point(2)
    integer :: k, n, held(4)

    n = merge(71, 0, comm%rank == 0)
    allocate (points(2, n), weights(n))
    do k = 1, n
      points(1, k) = min(k, 60) - 0.5_dp
      points(2, k) = 0.5_dp
      weights(k) = 1
      if (k <= 60) cycle
      points(1, k) = k - 10 - 0.3_dp
      weights(k) = merge(30, 0, k <= 70)
    end do
    if (n > 0) points(2, 71) = 3.5_dp
    call partition%set_box([0.0_dp, 0.0_dp], [59.9_dp, 3.9_dp])
    call partition%init_graph(comm, 1.0_dp, points, weights, 4, error)
    call check(.not. allocated(error), "weighted points")
    held(:) = 0
    do k = 1, 60
      point(1) = k - 0.5_dp
      point(2) = 0.5_dp
      associate (part => partition%owner(point))
        held(part) = held(part) + merge(31, 1, k > 50)
      end associate
    end do
    ! 3 % over the mean of 90, and one of the heaviest cells
    call check(maxval(held) <= 1.03*90 + 31 .and. minval(held) > 0, "weights decide the balance")
  end subroutine test_weights

  !> The largest share is below the mean times total/(total - groups); nobody gets more than it may.
  subroutine test_share_out()
    integer(i8) :: weight(40), most(40)
    integer :: counts(40), k

    do k = 1, 40
      weight(k) = int(draw(k, 91, 1.0_dp, 40.0_dp)**3, i8) + 1
    end do
    most(:) = 1000000
    call share_out(weight, most, 1300, counts)
    call check_equal(sum(counts), 1300, "subdomains shared out")
    call check(all(counts >= 1), "at least one each")
    call check(maxval(real(weight, dp)/counts) <= real(sum(weight), dp)/(1300 - 40), "the largest share")
    most(:) = 3
    call share_out(weight, most, 118, counts)
    call check(sum(counts) == 118 .and. all(counts >= 1 .and. counts <= 3), "as many as there may be")
    call share_out(weight, most, 40, counts)
    call check(all(counts == 1), "one each")
    call share_out(weight, most, 120, counts)
    call check(all(counts == 3), "all that there may be")
  end subroutine test_share_out

  !> A small bound on the cells of a graph: two levels. Points reach their owner by relay, each has exactly one, loads are
  !> bounded, `near` is complete around the points of this rank, and nothing depends on the number of ranks.
  subroutine test_levels(nd, n, is_periodic)
    integer, intent(in) :: nd, n
    logical, intent(in) :: is_periodic
    type(partition_t) :: partition, serial
    type(error_t), allocatable :: error
    real(dp), allocatable :: points(:, :)
    integer, allocatable :: weights(:)
    real(dp) :: lower(nd), upper(nd), edge

    lower(:) = 0.0_dp
    upper(:) = 1.0_dp
    edge = merge(0.008_dp, 0.03_dp, nd == 2)
    partition%cell_limit = 128
    if (is_periodic) partition%period(1) = 1.0_dp
    if (is_periodic) partition%period(nd) = 1.0_dp
    call make_grains(nd, comm%rank, comm%size, points, weights)
    call partition%set_box(lower, upper)
    call partition%init_graph(comm, edge, points, weights, n, error)
    call check(.not. allocated(error), "cells shared out on two levels")
    if (allocated(error)) return
    call check(partition%groups%n > 1 .and. partition%cells%split > 1, "there are two levels")
    call check(partition%cells%cells() <= 128, "cells of the first level")
    call make_grains(nd, 0, 1, points, weights)
    serial%cell_limit = partition%cell_limit
    serial%period(:) = partition%period
    call serial%set_box(lower, upper)
    call serial%init_graph(alone, edge, points, weights, n, error)
    call check_levels(partition, serial, points)
    call check_loads(serial, points, n)
    call check_near(serial, lower, upper)
    call check_far(partition, serial, points, edge)
    call check_routes(partition, serial, nd)
    call check_saved(partition, nd)
  end subroutine test_levels

  !> Two levels, and points that pile up: each place of a lattice has one point, and sixteen on a quarter of the square. Groups
  !> hold cells of both kinds, and all the points of a piece count.
  subroutine test_piles()
    type(partition_t) :: partition
    type(error_t), allocatable :: error
    integer, parameter :: n_points = side**2*(3 + most_in_pile)/4
    real(dp), allocatable :: points(:, :)
    integer, allocatable :: weights(:)
    integer :: x, y, k, n

    allocate (points(2, n_points), weights(n_points))
    n = 0
    do y = 1, side
      do x = 1, side
        do k = 1, merge(most_in_pile, 1, (4*(x - 1))/side == 1)
          n = n + 1
          points(1, n) = (x - 0.5_dp)/side
          points(2, n) = (y - 0.5_dp)/side
        end do
      end do
    end do
    weights(:) = 1
    partition%cell_limit = 128
    call partition%set_box([0.0_dp, 0.0_dp], [1.0_dp, 1.0_dp])
    call partition%init_graph(alone, 1.0_dp/side, points, weights, 12, error)
    call check(.not. allocated(error), "piles shared out on two levels")
    if (allocated(error)) return
    call check(partition%groups%n > 1 .and. partition%cells%split > 1, "there are two levels of piles")
    call check_loads(partition, points, 12)
  end subroutine test_piles

  !> What this rank knows, it knows as one rank alone does; it knows the points of its own subdomains.
  subroutine check_levels(partition, serial, points)
    type(partition_t), intent(in) :: partition, serial
    real(dp), intent(in) :: points(:, :)
    integer :: k, owner, all_owner
    integer(i8) :: unknown
    logical :: same, own, relayed

    same = .true.
    own = .true.
    relayed = .true.
    do k = 1, size(points, 2)
      owner = partition%owner(points(:, k))
      all_owner = serial%owner(points(:, k))
      same = same .and. (owner == 0 .or. owner == all_owner) .and. all_owner >= 1 .and. all_owner <= partition%n_subdomains
      if (comm%rank_of(all_owner, partition%n_subdomains) == comm%rank) own = own .and. owner == all_owner
      associate (relay => partition%relay(points(:, k)))
        relayed = relayed .and. relay == serial%relay(points(:, k))
        if (comm%rank_of(relay, partition%n_subdomains) == comm%rank) relayed = relayed .and. owner > 0
      end associate
    end do
    call check(same, "two levels: the same on any number of ranks")
    unknown = comm%total(int(count(partition%groups%known == 0), i8))
    ! ten groups in the plane do not all touch those of one rank of four
    if (comm%size == 4 .and. partition%nd == 2 .and. partition%n_subdomains == 40) &
      & call check(unknown > 0, "two levels: no rank knows all maps")
    if (comm%size == 1) call check_equal(unknown, 0_i8, "two levels: one rank knows all maps")
    call check(own, "two levels: a rank knows its own points")
    call check(relayed, "two levels: the relay knows the owner")
  end subroutine check_levels

  !> The shares of the groups differ from the mean by total/(total - groups) at most, METIS allows 3 %, and a piece cannot be
  !> cut: a subdomain may hold one more of the fullest pieces. Where a part has few pieces METIS may miss by one more.
  subroutine check_loads(serial, points, n)
    type(partition_t), intent(in) :: serial
    real(dp), intent(in) :: points(:, :)
    integer, intent(in) :: n
    integer, allocatable :: held(:), in_piece(:)
    integer :: k, fullest, place(3), number
    real(dp) :: bound

    allocate (held(n), source=0)
    fullest = 0
    do k = 1, size(points, 2)
      held(serial%owner(points(:, k))) = held(serial%owner(points(:, k))) + 1
    end do
    allocate (in_piece(serial%cells%cells()*int(serial%cells%pieces())), source=0)
    do k = 1, size(points, 2)
      call serial%cells%locate(points(:, k), place)
      number = (serial%cells%cell_at(place) - 1)*int(serial%cells%pieces()) + 1 + serial%cells%piece_at(place)
      in_piece(number) = in_piece(number) + 1
    end do
    fullest = maxval(in_piece)
    bound = 1.03_dp*size(points, 2)/(n - serial%groups%n) + 2*fullest
    call check(maxval(held) <= bound, "two levels: the fullest subdomain")
    call check_equal(count(held == 0), 0, "two levels: no subdomain is empty")
  end subroutine check_loads

  !> Around the points of its own subdomains a rank knows all that are near, up to the edge.
  subroutine check_far(partition, serial, points, edge)
    type(partition_t), intent(in) :: partition, serial
    real(dp), intent(in) :: points(:, :), edge
    integer, allocatable :: list(:), all_list(:)
    real(dp), allocatable :: point(:)
    integer :: k, j, n, all_n
    logical :: complete

    allocate (list(4), all_list(4), point(size(points, 1)))
    complete = .true.
    do k = 1, size(points, 2)
      point(:) = points(:, k)
      if (comm%rank_of(serial%owner(point), partition%n_subdomains) /= comm%rank) cycle
      call partition%near(point, edge, list, n)
      call serial%near(point, edge, all_list, all_n)
      complete = complete .and. n == all_n
      do j = 1, n
        complete = complete .and. list(j) > 0 .and. any(all_list(1:all_n) == list(j))
      end do
    end do
    call check(complete, "two levels: near its own points a rank misses nobody")
  end subroutine check_far

  !> Points anywhere, outside too, sent to the relay, then to the owner: each arrives once, where one rank alone says.
  subroutine check_routes(partition, serial, nd)
    type(partition_t), intent(in) :: partition, serial
    integer, intent(in) :: nd
    integer(i8), allocatable :: records(:, :), received(:, :)
    integer, allocatable :: destination(:)
    integer :: k, hop, owner
    real(dp) :: point(nd)
    logical :: right

    allocate (received(1, 300))
    do k = 1, 300
      received(1, k) = 300*comm%rank + k
    end do
    do hop = 1, 2
      call move_alloc(received, records)
      allocate (destination(size(records, 2)))
      do k = 1, size(destination)
        point(:) = anywhere(nd, int(records(1, k)))
        owner = partition%owner(point)
        if (owner == 0 .and. hop == 1) owner = partition%relay(point)
        call check(owner > 0, "two levels: a relay that does not know")
        destination(k) = comm%rank_of(owner, partition%n_subdomains)
      end do
      call sparse_exchange(comm, records, destination, received)
      deallocate (destination)
    end do
    right = .true.
    do k = 1, size(received, 2)
      point(:) = anywhere(nd, int(received(1, k)))
      owner = serial%owner(point)
      right = right .and. comm%rank_of(owner, partition%n_subdomains) == comm%rank
      right = right .and. partition%owner(point) == owner
    end do
    call check(right, "two levels: points arrive at their owner")
    call check_equal(comm%total(int(size(received, 2), i8)), 300_i8*comm%size, "two levels: all points arrive")
  end subroutine check_routes

  function anywhere(nd, k) result(point)
    integer, intent(in) :: nd, k
    real(dp) :: point(nd)
    integer :: d
    do d = 1, nd
      point(d) = draw(k, 70 + d, -0.5_dp, 1.5_dp)
    end do
  end function anywhere

  !> A partition made anew from the words that its subdomains and its head were stored in gives the same answers.
  subroutine check_saved(partition, nd)
    type(partition_t), intent(in) :: partition
    integer, intent(in) :: nd
    type(partition_t) :: other
    integer(i8), allocatable :: head(:), map(:), words(:), longer(:)
    integer, allocatable :: counts(:), list(:), other_list(:)
    real(dp) :: point(nd)
    integer :: s, k, first, n, other_n
    logical :: same

    call partition%get_head(head)
    first = comm%first_subdomain(comm%rank, partition%n_subdomains)
    allocate (counts(comm%first_subdomain(comm%rank + 1, partition%n_subdomains) - first), words(0))
    do s = 1, size(counts)
      call partition%get_map(first + s - 1, map)
      counts(s) = size(map)
      allocate (longer(size(words) + size(map)))
      longer(1:size(words)) = words
      longer(size(words) + 1:) = map
      call move_alloc(longer, words)
    end do
    call other%restore(comm, head, words, counts)
    call check_equal(other%n_subdomains, partition%n_subdomains, "subdomains restored")
    call check_close(norm2(other%period - partition%period), 0.0_dp, 0.0_dp, "period restored")
    call check(all(other%boxes == partition%boxes), "boxes restored")
    allocate (list(8), other_list(8))
    same = .true.
    do k = 1, 2000
      point(:) = anywhere(nd, k)
      same = same .and. other%owner(point) == partition%owner(point) .and. other%relay(point) == partition%relay(point)
      call partition%near(point, 0.03_dp, list, n)
      call other%near(point, 0.03_dp, other_list, other_n)
      same = same .and. n == other_n
      if (n == other_n) same = same .and. all(list(1:n) == other_list(1:n))
    end do
    call check(same, "the same answers when restored")
  end subroutine check_saved

  !> A ring of 12 cells: two parts are two arcs, and cells 1 and 12 are neighbours. METIS has no reason to cut between them,
  !> as it does where the ends are apart; weights of the edges say where: 12 and 1 are heavy.
  subroutine test_periodic_neighbours()
    type(partition_t) :: partition
    type(error_t), allocatable :: error
    real(dp), allocatable :: points(:, :)
    integer, allocatable :: weights(:), list(:)
    integer :: n

    call make_row(points, weights)
    if (size(weights) > 0) weights(:) = [30, 10, 10, 1, 10, 10, 10, 10, 1, 10, 10, 30]
    partition%period(1) = 12.0_dp
    call partition%set_box([0.0_dp, 0.0_dp], [12.0_dp, 0.9_dp])
    call partition%init_graph(comm, 1.0_dp, points, weights, 2, error)
    call check(.not. allocated(error), "cells of a ring")
    call check_equal(partition%cells%n(1), 12, "whole cells fill the period")
    call check_equal(partition%owner([0.5_dp, 0.5_dp]), partition%owner([11.5_dp, 0.5_dp]), "a ring is not cut where it is heavy")
    call check_equal(partition%owner([12.5_dp, 0.5_dp]), partition%owner([0.5_dp, 0.5_dp]), "an image in the ring")
    allocate (list(4))
    call partition%near([0.25_dp, 0.5_dp], 12.0_dp, list, n)
    call check_equal(n, 2, "near: both arcs once")
    call check_saved(partition, 2)
  end subroutine test_periodic_neighbours

end program test_partition
