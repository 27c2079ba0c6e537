!> The points of a pair: how they are gathered, joined and dropped, and what is carried to them from the step before.
program test_pair_points
  use gravier_kinds, only: dp
  use gravier_manifold, only: manifold_t, feature_base
  use gravier_neighbour_list, only: neighbour_list_t, pair_memory_t
  use gravier_pair_points, only: pair_points_t, carry_memory
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  call test_add()
  call test_merge()
  call test_deepest()
  call test_same_keys()
  call test_new_keys()
  call test_other_pairs()
  call finish_checks()

contains

  !> A manifold of some points along x with gaps and keys.
  pure type(manifold_t) function manifold_of(x, gap, key) result(manifold)
    real(dp), intent(in) :: x(:), gap(:)
    integer, intent(in) :: key(:)

    manifold%n = size(x)
    manifold%normal(2) = 1.0_dp
    manifold%point(:, 1:size(x)) = 0.0_dp
    manifold%point(1, 1:size(x)) = x
    manifold%gap(1:size(x)) = gap
    manifold%key(1:size(x)) = key
  end function manifold_of

  subroutine test_add()
    type(pair_points_t) :: points
    type(manifold_t) :: manifold
    integer :: k

    manifold = manifold_of([0.0_dp, 1.0_dp, 2.0_dp], [0.1_dp, 0.2_dp, 0.3_dp], [5, 6, 9])
    manifold%cores_overlap = .true.
    do k = 1, 10
      call points%add(manifold, k, 3)
    end do
    call check_equal(points%n, 30, "points of ten pairs of pieces")
    call check_close(points%point(1, 30), 2.0_dp, 0.0_dp, "the last one")
    call check_equal(points%key(1, 2), 7, "keys begin with 1")
    call check_equal(points%key(2, 30), 10*feature_base + 3, "the pieces of a point")
    call check_equal(points%overlapping_cores, 10, "pairs of pieces whose cores overlap")
    manifold%n = 0
    call points%add(manifold, 1, 1)
    call check_equal(points%overlapping_cores, 10, "those that touch alone")
  end subroutine test_add

  !> Where two pieces of a cluster meet, the deeper point stays; points of one pair of pieces are never joined.
  subroutine test_merge()
    type(pair_points_t) :: points
    type(manifold_t) :: turned

    call points%add(manifold_of([0.0_dp, 1.0_dp], [0.1_dp, 0.2_dp], [1, 2]), 1, 1)
    call points%add(manifold_of([1.0_dp, 2.0_dp], [0.15_dp, 0.3_dp], [3, 4]), 2, 1)
    call points%merge_near(1.0e-6_dp, [0.0_dp, 0.0_dp], .false.)
    call check_equal(points%n, 3, "two points are one")
    call check_close(points%gap(2), 0.15_dp, 0.0_dp, "the deeper one stays")
    call check_close(points%gap(3), 0.3_dp, 0.0_dp, "and the others")
    points%n = 0
    call points%add(manifold_of([1.0_dp, 1.0_dp], [0.1_dp, 0.2_dp], [1, 2]), 1, 1)
    call points%merge_near(1.0e-6_dp, [0.0_dp, 0.0_dp], .false.)
    call check_equal(points%n, 2, "points of one pair of pieces")
    points%n = 0
    call points%add(manifold_of([0.0_dp, 1.0_dp], [-0.3_dp, -0.2_dp], [1, 2]), 1, 1)
    call points%add(manifold_of([1.15_dp, 2.0_dp], [-0.1_dp, -0.3_dp], [3, 4]), 2, 1)
    call points%merge_near(1.0e-6_dp, [0.0_dp, 0.0_dp], .false.)
    call check_equal(points%n, 3, "points nearer to each other than the overlap")
    points%n = 0
    turned = manifold_of([1.0_dp], [0.1_dp], [1])
    call points%add(turned, 1, 1)
    turned%normal(:) = [1.0_dp, 0.0_dp, 0.0_dp]
    call points%add(turned, 2, 1)
    call points%merge_near(1.0e-6_dp, [0.0_dp, 0.0_dp], .false.)
    call check_equal(points%n, 2, "points with other normals")
    call check_seam()
  end subroutine test_merge

  !> Points at 0 and 1 of one piece, at 1 and 1.2 or at 1.2 and 2 of another, with seams of 0.3: those at 1.2 are one with that at 1
  !> unless both pieces have a point there, whichever of the two there is deeper by rounding.
  subroutine check_seam()
    type(pair_points_t) :: points
    real(dp), parameter :: seam(2) = [0.3_dp, 0.0_dp], rounding(3) = [0.0_dp, 1.0e-15_dp, -1.0e-15_dp]
    real(dp) :: gaps(2)
    integer :: k

    call points%add(manifold_of([0.0_dp, 1.0_dp], [-0.1_dp, -0.05_dp], [1, 2]), 1, 1)
    call points%add(manifold_of([1.2_dp, 2.0_dp], [-0.04_dp, -0.01_dp], [3, 4]), 2, 1)
    call points%merge_near(1.0e-6_dp, seam, .false.)
    call check_equal(points%n, 3, "points at a seam are one")
    call check_close(points%gap(2), -0.05_dp, 0.0_dp, "the deeper one at a seam")
    do k = 1, size(rounding)
      points%n = 0
      gaps(1) = -0.05_dp + rounding(k)
      gaps(2) = -0.04_dp
      call points%add(manifold_of([0.0_dp, 1.0_dp], [-0.1_dp, -0.05_dp], [1, 2]), 1, 1)
      call points%add(manifold_of([1.0_dp, 1.2_dp], gaps, [3, 4]), 2, 1)
      call points%merge_near(1.0e-6_dp, seam, .false.)
      call check_equal(points%n, 3, "a piece has two points beside each other")
      call check_close(points%gap(2), -0.05_dp, 0.0_dp, "of points that are one and as deep the first")
      call check_equal(points%key(2, 2), feature_base + 1, "it is that of the first piece")
      call check_close(points%gap(3), -0.04_dp, 0.0_dp, "the other one of the second piece")
    end do
    points%n = 0
    call points%add(manifold_of([0.0_dp, 1.0_dp], [-0.1_dp, -0.05_dp], [1, 2]), 1, 1)
    call points%add(manifold_of([1.2_dp, 2.0_dp], [-0.04_dp, -0.01_dp], [3, 4]), 2, 2)
    call points%merge_near(1.0e-6_dp, seam, .false.)
    call check_equal(points%n, 4, "a seam beside a body of one piece")
    call points%merge_near(1.0e-6_dp, [0.3_dp, 0.25_dp], .false.)
    call check_equal(points%n, 3, "a seam over a seam")
    ! where sides end at round corners, the points of a seam become one half-way between them, whichever is deeper
    do k = -1, 1, 2
      points%n = 0
      gaps(1) = -0.1_dp
      gaps(2) = -0.1_dp + 0.01_dp*k
      call points%add(manifold_of([0.0_dp, 0.9_dp], gaps, [1, 2]), 1, 1)
      gaps(1) = -0.1_dp - 0.01_dp*k
      gaps(2) = -0.1_dp
      call points%add(manifold_of([1.1_dp, 2.0_dp], gaps, [1, 2]), 2, 1)
      call points%merge_near(1.0e-6_dp, [0.25_dp, 0.0_dp], .true.)
      call check_equal(points%n, 3, "both ends and the seam")
      call check_close(points%point(1, 2), 1.0_dp, 1.0e-15_dp, "half-way between the points of the seam")
      call check_close(points%gap(2), -0.1_dp, 1.0e-15_dp, "its gap is the mean")
    end do
    ! a seam over a seam that is shifted by nearly both roundings: one point as long as the pieces beside have no side in common
    points%n = 0
    gaps(:) = -0.05_dp
    call points%add(manifold_of([0.0_dp, 0.9_dp], gaps, [1, 2]), 1, 1)
    call points%add(manifold_of([1.29_dp, 2.0_dp], gaps, [1, 2]), 2, 2)
    call points%merge_near(1.0e-6_dp, [0.201_dp, 0.201_dp], .true.)
    call check_equal(points%n, 3, "a seam over a seam with round corners")
    points%n = 0
    call points%add(manifold_of([0.0_dp, 0.9_dp], gaps, [1, 2]), 1, 1)
    call points%add(manifold_of([1.1_dp, 1.11_dp], gaps, [1, 2]), 2, 1)
    call points%add(manifold_of([1.31_dp, 2.0_dp], gaps, [1, 2]), 2, 2)
    call points%merge_near(1.0e-6_dp, [0.201_dp, 0.201_dp], .true.)
    call check_equal(points%n, 4, "with a side in common both points of it stay apart")
    ! across a corner where two pieces meet, whose roundings are 0.1 along both axes of the plane
    points%n = 0
    gaps(:) = -0.01_dp
    call points%add(manifold_of([0.0_dp, 0.9_dp], gaps, [1, 2]), 1, 1)
    call points%add(manifold_of([1.18_dp, 2.0_dp], gaps, [1, 2]), 2, 1)
    call points%merge_near(1.0e-6_dp, [0.201_dp, 0.0_dp], .true.)
    call check_equal(points%n, 3, "a corner of four pieces")
  end subroutine check_seam

  subroutine test_deepest()
    type(pair_points_t) :: points

    call points%add(manifold_of([0.0_dp, 1.0_dp, 2.0_dp, 3.0_dp], [0.2_dp, -0.1_dp, 0.3_dp, 0.1_dp], [1, 2, 3, 4]), 1, 1)
    call points%keep_deepest(4)
    call check_equal(points%n, 4, "room for all")
    call points%keep_deepest(2)
    call check_equal(points%n, 2, "room for two")
    call check(points%key(1, 1) == 3 .and. points%key(1, 2) == 5, "the deepest, in their order")
  end subroutine test_deepest

  !> A list of one pair that keeps `m` points, and of one more pair behind it.
  subroutine make_list(m, list)
    integer, intent(in) :: m
    type(neighbour_list_t), intent(out) :: list
    type(pair_memory_t) :: memory
    integer, allocatable :: order(:)

    memory%n_impulse = 2
    memory%law_row = 1
    memory%key_row = 2
    call list%init(.false., 2)
    call list%add(1, 2, 0)
    call list%add(1, 3, 0)
    allocate (order(m + 1), source=1)
    order(m + 1) = 2
    call list%finish(order, memory)
  end subroutine make_list

  subroutine keep(list, p, impulse, law)
    type(neighbour_list_t), intent(inout) :: list
    integer, intent(in) :: p, law
    real(dp), intent(in) :: impulse

    list%impulse(1, p) = impulse
    list%impulse(2, p) = -impulse
    list%state(1, p) = law
  end subroutine keep

  !> Impulses and states follow the keys of their points, whatever the places.
  subroutine test_same_keys()
    type(neighbour_list_t) :: list
    type(pair_points_t) :: points

    call make_list(3, list)
    call check_equal(list%points_of(1), 3, "a pair stands there three times")
    call check_equal(list%points_of(4), 1, "another pair once")
    call points%add(manifold_of([0.0_dp, 1.0_dp], [0.0_dp, 0.0_dp], [4, 8]), 1, 1)
    call carry_memory(points, 1, list)
    call keep(list, 1, 10.0_dp, 1)
    call keep(list, 2, 20.0_dp, 2)
    ! a point comes before both, and the first goes
    points%n = 0
    call points%add(manifold_of([0.0_dp, 1.0_dp], [0.0_dp, 0.0_dp], [2, 8]), 1, 1)
    call carry_memory(points, 1, list)
    call check_close(list%impulse(1, 2), 20.0_dp, 0.0_dp, "the point that stays keeps its impulse")
    call check_equal(list%state(1, 2), 2, "and its state")
    call check_close(list%impulse(2, 1), -10.0_dp, 0.0_dp, "the new one takes what the lost one leaves")
    points%n = 0
    call points%add(manifold_of([0.0_dp], [0.0_dp], [8]), 1, 1)
    call carry_memory(points, 1, list)
    call check_close(list%impulse(1, 1), 20.0_dp, 0.0_dp, "it moves to the first place")
    call check(.not. any(abs(list%impulse(:, 2:3)) > 0.0_dp) .and. all(list%state(:, 2:3) == 0), "the other places are empty")
    points%n = 0
    call carry_memory(points, 1, list)
    call check(all(list%state(:, 1:3) == 0) .and. .not. any(abs(list%impulse(:, 1:3)) > 0.0_dp), "nothing is kept without points")
  end subroutine test_same_keys

  subroutine test_new_keys()
    type(neighbour_list_t) :: list
    type(pair_points_t) :: points

    call make_list(2, list)
    call points%add(manifold_of([0.0_dp, 1.0_dp], [0.0_dp, 0.0_dp], [4, 8]), 1, 1)
    call carry_memory(points, 1, list)
    call check(.not. any(abs(list%impulse(:, 1:2)) > 0.0_dp), "new points start from nothing")
    call keep(list, 1, 10.0_dp, 1)
    points%n = 0
    call points%add(manifold_of([0.0_dp, 1.0_dp], [0.0_dp, 0.0_dp], [5, 9]), 2, 1)
    call carry_memory(points, 1, list)
    call check_close(list%impulse(1, 1), 10.0_dp, 0.0_dp, "the first new point takes the first lost one's")
    call check(list%state(2, 1) == 6 .and. list%state(3, 1) == 2*feature_base + 1, "the keys are those of now")
    ! a polygon rolls over the corner that bears it: both points have new keys, and the other one is in the air before and behind
    call keep(list, 1, 0.0_dp, 0)
    call keep(list, 2, 10.0_dp, 0)
    points%n = 0
    call points%add(manifold_of([1.0_dp, 2.0_dp], [0.0_dp, 0.1_dp], [6, 10]), 2, 1)
    call carry_memory(points, 1, list)
    call check_close(list%impulse(1, 1), 10.0_dp, 0.0_dp, "the corner that bears keeps what it held")
    call check_close(list%impulse(1, 2), 0.0_dp, 0.0_dp, "the next one has nothing")
    ! a bond without a load goes to the corner that touches, too, and before a load
    call keep(list, 1, 10.0_dp, 0)
    call keep(list, 2, 0.0_dp, 1)
    points%n = 0
    call points%add(manifold_of([1.0_dp, 2.0_dp], [0.0_dp, 0.1_dp], [7, 11]), 2, 1)
    call carry_memory(points, 1, list)
    call check(list%state(1, 1) == 1 .and. list%state(1, 2) == 0, "a bond stays at the corner that touches, beside a load")
    call keep(list, 1, 0.0_dp, 0)
    call keep(list, 2, 0.0_dp, 1)
    points%n = 0
    call points%add(manifold_of([1.0_dp, 2.0_dp], [0.0_dp, 0.1_dp], [8, 12]), 2, 1)
    call carry_memory(points, 1, list)
    call check(list%state(1, 1) == 1 .and. list%state(1, 2) == 0, "a bond without a load, too")
    call keep(list, 2, 5.0_dp, 1)
    points%n = 0
    call points%add(manifold_of([1.0_dp, 2.0_dp], [0.1_dp, 0.0_dp], [9, 13]), 2, 1)
    call carry_memory(points, 1, list)
    call check_close(list%impulse(1, 2), 5.0_dp, 0.0_dp, "what is alike but for a load: the deeper one takes the load")
    call keep(list, 1, 10.0_dp, 0)
    call keep(list, 2, 0.0_dp, 1)
    points%n = 0
    call points%add(manifold_of([1.0_dp], [0.0_dp], [15]), 2, 1)
    call carry_memory(points, 1, list)
    call check(list%state(1, 1) == 1, "of two that held something the bond stays")
  end subroutine test_new_keys

  !> Other pairs of the list are left alone.
  subroutine test_other_pairs()
    type(neighbour_list_t) :: list
    type(pair_points_t) :: points

    call make_list(2, list)
    call keep(list, 3, 7.0_dp, 5)
    list%state(2:3, 3) = 1
    call points%add(manifold_of([0.0_dp], [0.0_dp], [4]), 1, 1)
    call carry_memory(points, 1, list)
    call check(abs(list%impulse(1, 3) - 7.0_dp) < 0.5_dp .and. list%state(1, 3) == 5, "what another pair keeps")
  end subroutine test_other_pairs

end program test_pair_points
