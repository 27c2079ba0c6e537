!> Who owns which grain: every grain once, in the subdomain of its centre, wrapped into the period, whatever the partition.
!> Places follow from identifiers, so that every rank knows them all.
program test_decomposition
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_random_hash, only: hash_uniform
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_body_store, only: body_layout_t, body_set_t
  use gravier_periodic, only: period_t
  use gravier_box_counts, only: choose_boxes
  use gravier_decomposition, only: decomposition_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  integer, parameter :: n_grains = 160
  type(communicator_t), target :: comm
  type(period_t) :: none, cell
  integer :: nd, k, axes
  integer, parameter :: counts(*) = [1, 2, 7, 12]

  call start_parallel()
  call comm%init()
  call test_init()
  call test_bounding_box()
  call test_deliver()
  do nd = 2, 3
    do k = 1, size(counts)
      call test_settle(nd, counts(k), .false., none)
      call test_settle(nd, counts(k), .true., none)
    end do
    do axes = 1, 2**nd - 1
      call choose_period(axes, cell)
      call test_settle(nd, 7, .false., cell)
      call test_settle(nd, 7, .true., cell)
    end do
  end do
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> Radii from 0.03 to 0.12.
  pure real(dp) function radius_of(g)
    integer, intent(in) :: g
    radius_of = 0.03_dp + 0.09_dp*hash_uniform(1, int(g, i8), 1)**2
  end function radius_of

  !> Centre of grain `g` at time `t`: in the unit box at time 0, then anywhere around it, far away now and then.
  pure subroutine find_place(g, t, place)
    integer, intent(in) :: g, t
    !> (nd)
    real(dp), intent(out) :: place(:)
    integer :: d

    do d = 1, size(place)
      place(d) = hash_uniform(2 + t, int(g, i8), d)
      if (t > 0) place(d) = 1.6_dp*place(d) - 0.3_dp
      if (t > 0 .and. mod(g, 20) == 0) place(d) = 100*place(d) - 50.0_dp
    end do
  end subroutine find_place

  !> Periods along the axes of bits 0, 1, 2 of `axes`.
  subroutine choose_period(axes, period)
    integer, intent(in) :: axes
    type(period_t), intent(out) :: period
    integer :: d

    do d = 1, 3
      if (.not. btest(axes, d - 1)) cycle
      period%length(d) = 1.0_dp + 0.25_dp*d
      period%origin(d) = -0.125_dp*d
    end do
  end subroutine choose_period

  !> A decomposition of the grains at their places at time 0, by boxes or by cells.
  subroutine make(nd, n_subdomains, by_cells, period, decomposition)
    integer, intent(in) :: nd, n_subdomains
    logical, intent(in) :: by_cells
    type(period_t), intent(in) :: period
    type(decomposition_t), intent(out) :: decomposition
    type(body_set_t) :: newcomers(1)
    type(error_t), allocatable :: error
    real(dp) :: lower(nd), upper(nd)
    integer, allocatable :: weights(:)
    integer :: boxes(3), g, n

    call decomposition%init(comm, n_subdomains, body_layout_t(nd, nd, merge(nd, 0, period%on())), period)
    ! the last rank brings nobody, unless it is alone
    n = 0
    do g = 1, n_grains
      if (mod(g, max(1, comm%size - 1)) == comm%rank) n = n + 1
    end do
    call newcomers(1)%init(decomposition%layout(), n)
    n = 0
    do g = 1, n_grains
      if (mod(g, max(1, comm%size - 1)) /= comm%rank) cycle
      n = n + 1
      newcomers(1)%id(n) = id_of(g)
      call find_place(g, 0, newcomers(1)%position(:, n))
      newcomers(1)%velocity(:, n) = 2*newcomers(1)%position(:, n)
      newcomers(1)%radius(n) = radius_of(g)
      newcomers(1)%mass(n) = g
      newcomers(1)%glued(n) = mod(g, 3)
      newcomers(1)%image(:, n) = g
    end do
    call decomposition%bounding_box(newcomers, lower, upper)
    decomposition%partition%period(:) = period%length
    call decomposition%partition%set_box(lower, upper)
    if (by_cells) then
      allocate (weights(n), source=1)
      call decomposition%partition%init_graph(comm, 0.15_dp, newcomers(1)%position, weights, n_subdomains, error)
    else
      boxes(:) = choose_boxes(lower, upper, n_subdomains, period%length)
      call decomposition%partition%init_grid(boxes, 0.1_dp, error)
    end if
    call check(.not. allocated(error), "partition")
    call decomposition%migrate(newcomers(1))
  end subroutine make

  !> Identifiers are in another order than grains.
  pure integer(i8) function id_of(g)
    integer, intent(in) :: g
    id_of = 1 + mod(63*g, n_grains)
  end function id_of

  subroutine test_init()
    type(decomposition_t) :: decomposition
    integer :: s, homes
    integer(i8) :: total

    call decomposition%init(comm, 7, body_layout_t(3, 6, 0), none)
    homes = size(decomposition%owned)
    total = comm%total(int(homes, i8))
    call check_equal(total, 7_i8, "one owned for each subdomain")
    call check_equal(decomposition%first, comm%first_subdomain(comm%rank, 7), "first subdomain of the rank")
    do s = 1, homes
      call check(decomposition%owned(s)%n == 0 .and. decomposition%owned(s)%nd == 3 .and. decomposition%owned(s)%nv == 6 .and. &
        & decomposition%owned(s)%ni == 0, "an empty owned")
      call check_equal(decomposition%subdomain_of(s), decomposition%first + s - 1, "number of a subdomain")
    end do
    call choose_period(2, cell)
    call decomposition%init(comm, 7, body_layout_t(3, 6, 3), cell)
    call check_equal(decomposition%ni, 3, "grains of a periodic scene have images")
  end subroutine test_init

  !> Grains of all ranks, radii included.
  subroutine test_bounding_box()
    type(decomposition_t) :: decomposition
    type(body_set_t) :: bodies(2)
    real(dp) :: lower(2), upper(2)
    integer :: r

    call decomposition%init(comm, 1, body_layout_t(2, 2, 0), none)
    call bodies(1)%init(body_layout_t(2, 2, 0), 0)
    call bodies(2)%init(body_layout_t(2, 2, 0), 0)
    call decomposition%bounding_box(bodies, lower, upper)
    call check_close(maxval(abs(lower)), 0.0_dp, 0.0_dp, "nobody: lower corner")
    call check_close(maxval(abs(upper - 1.0_dp)), 0.0_dp, 0.0_dp, "nobody: upper corner")
    do r = 0, comm%size - 1
      call bodies(2)%init(body_layout_t(2, 2, 0), merge(2, 0, comm%rank == r))
      if (comm%rank == r) then
        bodies(2)%position(:, 1) = [-5.0_dp, 2.0_dp]
        bodies(2)%position(:, 2) = [-4.5_dp, 3.0_dp]
        bodies(2)%radius(1) = 0.25_dp
        bodies(2)%radius(2) = 1.0_dp
      end if
      call decomposition%bounding_box(bodies, lower, upper)
      call check_close(lower(1), -5.5_dp, 0.0_dp, "left end")
      call check_close(lower(2), 1.75_dp, 0.0_dp, "lower end")
      call check_close(upper(1), -3.5_dp, 0.0_dp, "right end")
      call check_close(upper(2), 4.0_dp, 0.0_dp, "upper end")
    end do
    call choose_period(2, cell)
    call decomposition%init(comm, 1, body_layout_t(2, 2, 2), cell)
    call decomposition%bounding_box(bodies, lower, upper)
    call check_close(lower(1), -5.5_dp, 0.0_dp, "left end beside a period")
    call check_close(lower(2), -0.25_dp, 0.0_dp, "lower end of a period")
    call check_close(upper(2), 1.25_dp, 0.0_dp, "upper end of a period")
  end subroutine test_bounding_box

  !> Grains come to their owners, move, and come to their owners again.
  subroutine test_settle(nd, n_subdomains, by_cells, period)
    integer, intent(in) :: nd, n_subdomains
    logical, intent(in) :: by_cells
    type(period_t), intent(in) :: period
    type(decomposition_t) :: decomposition
    integer :: t, s, k, g

    call make(nd, n_subdomains, by_cells, period, decomposition)
    call check_homes(decomposition, 0)
    do t = 1, 4
      do s = 1, size(decomposition%owned)
        associate (owned => decomposition%owned(s))
          do k = 1, owned%n
            g = nint(owned%mass(k))
            call find_place(g, t, owned%position(:, k))
            ! as if it had come from the place of grain g in the first cell without a jump
            owned%image(:, k) = g
          end do
        end associate
      end do
      call decomposition%migrate()
      call check_homes(decomposition, t)
    end do
    ! nobody has moved since
    call decomposition%migrate()
    call check_homes(decomposition, 4)
  end subroutine test_settle

  !> Every grain once, with all that is its own, in the subdomain of its centre, by ascending identifier.
  subroutine check_homes(decomposition, t)
    type(decomposition_t), intent(in) :: decomposition
    integer, intent(in) :: t
    integer(i8) :: met(n_grains)
    integer :: s, k, g
    logical :: own, placed, ordered

    met(:) = 0
    own = .true.
    placed = .true.
    ordered = .true.
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        do k = 1, owned%n
          g = nint(owned%mass(k))
          met(g) = met(g) + 1
          own = own .and. is_grain(decomposition, owned, k, g, t)
          placed = placed .and. decomposition%partition%owner(owned%position(:, k)) == decomposition%first + s - 1
          if (k > 1) ordered = ordered .and. owned%id(k) > owned%id(k - 1)
        end do
      end associate
    end do
    call comm%sum_counts(met)
    call check(all(met == 1), "every grain once")
    call check(own, "every grain with all that is its own")
    call check(placed, "every grain in the subdomain of its centre")
    call check(ordered, "by ascending identifier")
  end subroutine check_homes

  !> Numbers are made twice: some roundings of 100 m at most may lie between.
  pure logical function is_grain(decomposition, bodies, k, g, t)
    type(decomposition_t), intent(in) :: decomposition
    type(body_set_t), intent(in) :: bodies
    integer, intent(in) :: k, g, t
    real(dp) :: place(bodies%nd), apart(bodies%nd)
    integer :: nd

    nd = bodies%nd
    call find_place(g, t, place)
    apart(:) = bodies%position(:, k) - place
    is_grain = bodies%id(k) == id_of(g) .and. bodies%glued(k) == mod(g, 3)
    if (bodies%ni > 0) then
      associate (length => decomposition%period%length(1:nd), origin => decomposition%period%origin(1:nd))
        apart(:) = apart + (bodies%image(:, k) - g)*length
        is_grain = is_grain .and. all(length <= 0.0_dp .or. &
          & (bodies%position(:, k) >= origin .and. bodies%position(:, k) < origin + length))
        is_grain = is_grain .and. all(length > 0.0_dp .or. bodies%image(:, k) == g)
      end associate
    end if
    is_grain = is_grain .and. all(abs(apart) <= 200*epsilon(1.0_dp))
    call find_place(g, 0, place)
    is_grain = is_grain .and. all(abs(bodies%velocity(:, k) - 2*place) <= 4*epsilon(1.0_dp))
    is_grain = is_grain .and. abs(bodies%radius(k) - radius_of(g)) <= epsilon(1.0_dp) .and. abs(bodies%mass(k) - g) <= 0.0_dp
  end function is_grain

  !> Records go to the ranks of the subdomains that hold their points, whoever has them.
  subroutine test_deliver()
    type(decomposition_t) :: decomposition
    integer(i8), allocatable :: records(:, :), received(:, :)
    integer(i8) :: met(1)
    real(dp) :: point(2)
    integer :: g, n, d
    logical :: right

    call make(2, 5, .true., none, decomposition)
    n = count_own(comm%rank)
    allocate (records(4, n))
    n = 0
    do g = 1, n_grains
      if (mod(g, comm%size) /= comm%rank) cycle
      n = n + 1
      call find_place(g, 1, point)
      records(1, n) = 0
      records(2, n) = g
      do d = 1, 2
        records(2 + d, n) = transfer(point(d), 0_i8)
      end do
    end do
    call decomposition%deliver(3, records, received)
    right = .true.
    do n = 1, size(received, 2)
      call find_place(int(received(2, n)), 1, point)
      right = right .and. decomposition%partition%owner(point) == received(1, n)
      right = right .and. comm%rank_of(int(received(1, n)), 5) == comm%rank
    end do
    met(1) = sum(received(2, :))
    call comm%sum_counts(met)
    call check(right, "records at the subdomains of their points")
    call check_equal(met(1), int(n_grains, i8)*(n_grains + 1)/2, "every record once")
  end subroutine test_deliver

  integer function count_own(rank)
    integer, intent(in) :: rank
    integer :: g

    count_own = 0
    do g = 1, n_grains
      if (mod(g, comm%size) == rank) count_own = count_own + 1
    end do
  end function count_own

end program test_decomposition
