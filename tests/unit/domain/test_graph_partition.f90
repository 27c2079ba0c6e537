!> Graph partition: parts in range, about equal, few edges cut, the same for the same graph.
program test_graph_partition
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: i4
  use gravier_errors, only: error_t
  use gravier_graph_partition, only: partition_graph
  use gravier_check, only: check, check_equal, finish_checks
  implicit none

  call MPI_Init()
  call test_grid(1)
  call test_grid(2)
  call test_grid(4)
  call test_grid(7)
  call test_grid(16)
  call test_weights()
  call test_edge_weights()
  call test_no_edges()
  call finish_checks()
  call MPI_Finalize()

contains

  !> A grid of 16 x 16 vertices, each tied to those left, right, below and above.
  subroutine make_grid(first, neighbour)
    integer(i4), allocatable, intent(out) :: first(:), neighbour(:)
    integer, parameter :: side = 16, dx(4) = [-1, 1, 0, 0], dy(4) = [0, 0, -1, 1]
    integer :: x, y, k, n

    allocate (first(side**2 + 1), neighbour(4*side*(side - 1)))
    n = 0
    do y = 1, side
      do x = 1, side
        first((y - 1)*side + x) = n + 1
        do k = 1, 4
          if (min(x + dx(k), y + dy(k)) < 1 .or. max(x + dx(k), y + dy(k)) > side) cycle
          n = n + 1
          neighbour(n) = (y + dy(k) - 1)*side + x + dx(k)
        end do
      end do
    end do
    first(side**2 + 1) = n + 1
  end subroutine make_grid

  !> Parts of equal weights: METIS keeps each within 3 % of the mean, or one vertex where that is more. Straight bands cut
  !> 16 edges (n - 1) times, random parts 480 (1 - 1/n): half as many again as the bands is a partition still.
  subroutine test_grid(n_parts)
    integer, intent(in) :: n_parts
    integer(i4), allocatable :: first(:), neighbour(:), weight(:), edge_weight(:), part(:), again(:)
    type(error_t), allocatable :: error
    integer :: p, v, k, cut, most, least

    call make_grid(first, neighbour)
    allocate (weight(256), edge_weight(size(neighbour)), source=1_i4)
    allocate (part(256), again(256), source=0_i4)
    call partition_graph(first, neighbour, weight, edge_weight, n_parts, part, error)
    call check(.not. allocated(error), "partition of a grid")
    call check(all(part >= 1 .and. part <= n_parts), "parts in range")
    least = 256
    most = 0
    do p = 1, n_parts
      least = min(least, count(part == p))
      most = max(most, count(part == p))
    end do
    call check(most <= max(ceiling(1.03*256/n_parts), 256/n_parts + 1), "no part too heavy")
    call check(least >= 1, "no part empty")
    cut = 0
    do v = 1, 256
      do k = first(v), first(v + 1) - 1
        if (part(neighbour(k)) /= part(v)) cut = cut + 1
      end do
    end do
    call check(cut/2 <= 24*(n_parts - 1), "few edges cut")
    ! the graph is given back as it was, and gives the same parts
    call check_equal(int(first(1)), 1, "numbers from 1")
    call check(all(neighbour >= 1 .and. neighbour <= 256), "neighbours from 1")
    call partition_graph(first, neighbour, weight, edge_weight, n_parts, again, error)
    call check(all(again == part), "the same graph, the same parts")
  end subroutine test_grid

  !> A path of ten vertices of weight 1, but for the first one of weight 9: two parts of weight 9 have one place to cut.
  subroutine test_weights()
    integer(i4), allocatable :: first(:), neighbour(:), weight(:), edge_weight(:), part(:)
    type(error_t), allocatable :: error
    integer :: v

    allocate (first(11), neighbour(18), weight(10), edge_weight(18), part(10))
    first(1) = 1
    do v = 1, 10
      first(v + 1) = first(v) + merge(1, 2, v == 1 .or. v == 10)
      if (v > 1) neighbour(first(v)) = v - 1
      if (v < 10) neighbour(first(v + 1) - 1) = v + 1
    end do
    weight(:) = 1
    weight(1) = 9
    edge_weight(:) = 1
    call partition_graph(first, neighbour, weight, edge_weight, 2, part, error)
    call check(.not. allocated(error), "partition of a path")
    call check(all(part(2:) == part(2)) .and. part(1) /= part(2), "vertex weights decide the balance")
  end subroutine test_weights

  !> A ring of four vertices, heavy edges between 1 and 2 and between 3 and 4, or the other two: the light ones are cut.
  subroutine test_edge_weights()
    integer(i4) :: first(5), neighbour(8), weight(4), edge_weight(8), part(4)
    type(error_t), allocatable :: error
    integer :: k

    weight(:) = 1
    do k = 0, 1
      first(:) = [1, 3, 5, 7, 9]
      neighbour(:) = [2, 4, 1, 3, 2, 4, 1, 3]
      if (k == 0) edge_weight(:) = [9, 1, 9, 1, 1, 9, 1, 9]
      if (k == 1) edge_weight(:) = [1, 9, 1, 9, 9, 1, 9, 1]
      call partition_graph(first, neighbour, weight, edge_weight, 2, part, error)
      call check(.not. allocated(error), "partition of a ring")
      call check(part(1) == part(merge(2, 4, k == 0)) .and. part(3) == part(merge(4, 2, k == 0)) .and. part(1) /= part(3), &
        & "heavy edges are not cut")
    end do
  end subroutine test_edge_weights

  !> Vertices without any edge are shared out all the same.
  subroutine test_no_edges()
    integer(i4), allocatable :: first(:), neighbour(:), weight(:), edge_weight(:), part(:)
    type(error_t), allocatable :: error
    integer :: p

    allocate (first(7), source=1_i4)
    allocate (neighbour(0), edge_weight(0), part(6))
    allocate (weight(6), source=1_i4)
    call partition_graph(first, neighbour, weight, edge_weight, 3, part, error)
    call check(.not. allocated(error), "partition without edges")
    do p = 1, 3
      call check_equal(count(part == p), 2, "vertices without edges are shared out")
    end do
  end subroutine test_no_edges

end program test_graph_partition
