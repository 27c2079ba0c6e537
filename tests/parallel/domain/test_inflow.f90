!> Grains enter in free places only, each in the subdomain that holds its place, the same grains in the same places however space is
!> divided.
program test_inflow
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_body_store, only: body_layout_t, body_set_t
  use gravier_periodic, only: period_t
  use gravier_box_counts, only: choose_boxes
  use gravier_boundary, only: boundary_t
  use gravier_surface_registry, only: make_surface
  use gravier_insertion, only: insertion_words, new_grain_t
  use gravier_decomposition, only: decomposition_t
  use gravier_free_places, only: is_clear
  use gravier_inflow, only: inflow_t, given_words
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  real(dp), parameter :: h = 1.0e-3_dp
  type(communicator_t), target :: comm
  type(period_t) :: none, cell
  integer :: nd
  integer(i8) :: digest

  call start_parallel()
  call comm%init()
  cell%length(1) = 1.0_dp
  do nd = 2, 3
    digest = 0
    call test_entry(nd, 1, none, digest)
    call test_entry(nd, 4, none, digest)
    call test_entry(nd, 7, none, digest)
    digest = 0
    call test_entry(nd, 1, cell, digest)
    call test_entry(nd, 6, cell, digest)
  end do
  call test_given()
  call test_full()
  call test_state()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> A box of unit size in subdomains, with a floor and a large body in the middle.
  subroutine make(nd, n_subdomains, period, decomposition)
    integer, intent(in) :: nd, n_subdomains
    type(period_t), intent(in) :: period
    type(decomposition_t), intent(out) :: decomposition
    type(body_set_t) :: body
    type(error_t), allocatable :: error
    real(dp) :: lower(nd), upper(nd)
    integer :: boxes(3)

    allocate (decomposition%boundaries(1))
    call make_surface("plane", decomposition%boundaries(1)%surface)
    decomposition%boundaries(1)%surface%axis(nd) = 1.0_dp
    call decomposition%init(comm, n_subdomains, body_layout_t(nd, 3*nd - 3, merge(nd, 0, period%on())), period)
    lower(:) = 0.0_dp
    upper(:) = 1.0_dp
    decomposition%partition%period(:) = period%length
    boxes(:) = choose_boxes(lower, upper, n_subdomains, period%length)
    call decomposition%partition%set_box(lower, upper)
    call decomposition%partition%init_grid(boxes, 0.01_dp, error)
    call check(.not. allocated(error), "a partition")
    call body%init(decomposition%layout(), merge(1, 0, comm%rank == 0))
    if (body%n == 1) then
      body%id(:) = 5
      body%radius(:) = 0.2_dp
      body%mass(:) = 1.0_dp
      body%inertia(:) = 1.0_dp
      body%glued(:) = 0
      body%position(:, 1) = 0.5_dp
      ! next to the side across which the scene repeats
      if (period%on()) body%position(1, 1) = 0.95_dp
      body%velocity(:, :) = 0.0_dp
      body%image(:, :) = 0
    end if
    call decomposition%migrate(body)
  end subroutine make

  !> A box and a ball in it that let grains in.
  subroutine open_up(nd, inflow)
    integer, intent(in) :: nd
    type(inflow_t), intent(out) :: inflow
    integer :: i

    allocate (inflow%insertions(2))
    inflow%next_id = 11
    do i = 1, 2
      associate (insertion => inflow%insertions(i))
        insertion%name = "feed"
        insertion%nd = nd
        insertion%place_in_scene = i
        insertion%rate = 20000.0_dp
        insertion%radii%nd = nd
        insertion%radii%kind = "uniform"
        insertion%radii%radius_min = 0.01_dp
        insertion%radii%radius_max = 0.03_dp
        insertion%lower(1:nd) = 0.0_dp
        insertion%lower(nd) = -0.1_dp
        insertion%upper(1:nd) = 1.0_dp
        insertion%velocity(1:nd) = 0.5_dp
      end associate
    end do
    inflow%insertions(2)%in_ball = .true.
    inflow%insertions(2)%lower(1:nd) = 0.3_dp
    inflow%insertions(2)%upper(1:nd) = 0.9_dp
  end subroutine open_up

  !> Grains of three steps: nothing overlaps, owners hold them, and sums do not depend on the number of subdomains.
  subroutine test_entry(nd, n_subdomains, period, digest)
    integer, intent(in) :: nd, n_subdomains
    type(period_t), intent(in) :: period
    !> of the places of an earlier call; 0 for none
    integer(i8), intent(inout) :: digest
    type(decomposition_t) :: decomposition
    type(inflow_t) :: inflow
    real(dp), allocatable :: places(:, :), radii(:)
    integer(i8) :: counts(1), own
    integer :: step, s, k, d

    call make(nd, n_subdomains, period, decomposition)
    call open_up(nd, inflow)
    do step = 0, 2
      call inflow%enter(decomposition, step*h, h)
    end do
    call check(inflow%entered() > 60, "grains have entered")
    call check_equal(inflow%next_id, 11 + inflow%entered(), "each has an identifier of its own")
    counts(1) = sum(decomposition%owned%n)
    call comm%sum_counts(counts)
    call check_equal(counts(1), 1 + inflow%entered(), "each is owned once")
    ! rank 0 has the large body, which is known
    call check_close(decomposition%free_mass(), 1.0_dp + inflow%mass(), 1.0e-12_dp*inflow%mass(), "mass")
    own = 0
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        do k = 1, owned%n
          call check_equal(decomposition%partition%owner(owned%position(:, k)), decomposition%subdomain_of(s), "owner")
          if (k > 1) call check(owned%id(k) > owned%id(k - 1), "bodies in the order of their identifiers")
          if (owned%id(k) <= 10) cycle
          call check(owned%position(nd, k) >= owned%radius(k), "above the floor")
          call check(is_clear(decomposition%boundaries, owned%radius(k), owned%position(:, k)), "clear of boundaries")
          call check_close(owned%velocity(1, k), 0.5_dp, 0.0_dp, "velocity")
          call check(owned%inertia(k) > 0.0_dp, "inertia")
          do d = 1, nd
            own = ieor(own, ishftc(transfer(owned%position(d, k), 0_i8), d) + owned%id(k))
          end do
        end do
      end associate
    end do
    own = comm%exclusive_or(own)
    if (digest /= 0) call check_equal(own, digest, "the same places in other subdomains")
    digest = own
    call gather(decomposition, nd, places, radii)
    call check_apart(places, radii, period)
  end subroutine test_entry

  !> Places and radii of all bodies, on every rank.
  subroutine gather(decomposition, nd, places, radii)
    type(decomposition_t), intent(in) :: decomposition
    integer, intent(in) :: nd
    real(dp), allocatable, intent(out) :: places(:, :), radii(:)
    integer(i8) :: counts(1)
    real(dp), allocatable :: row(:)
    integer :: s, k, n

    counts(1) = sum(decomposition%owned%n)
    call comm%sum_counts(counts)
    allocate (places(nd, counts(1)), radii(counts(1)))
    places(:, :) = -huge(1.0_dp)
    radii(:) = -huge(1.0_dp)
    n = int(comm%offset(int(sum(decomposition%owned%n), i8)))
    do s = 1, size(decomposition%owned)
      do k = 1, decomposition%owned(s)%n
        n = n + 1
        places(:, n) = decomposition%owned(s)%position(:, k)
        radii(n) = decomposition%owned(s)%radius(k)
      end do
    end do
    do k = 1, nd
      row = places(k, :)
      call comm%highest_of(row)
      places(k, :) = row
    end do
    call comm%highest_of(radii)
  end subroutine gather

  !> No two bodies or images overlap.
  subroutine check_apart(places, radii, period)
    real(dp), intent(in) :: places(:, :), radii(:)
    type(period_t), intent(in) :: period
    real(dp) :: way(size(places, 1)), gap
    integer :: i, j

    gap = huge(1.0_dp)
    do i = 1, size(radii)
      do j = 1, i - 1
        way(:) = places(:, i) - places(:, j)
        if (period%on()) way(1) = way(1) - anint(way(1))
        gap = min(gap, norm2(way) - radii(i) - radii(j))
      end do
    end do
    call check(gap >= -1.0e-15_dp, "nothing overlaps")
  end subroutine check_apart

  !> Grains of a loop enter in two steps: the first two get the next identifiers, in their order, wherever they lie, and the third
  !> one the identifier behind these.
  subroutine test_given()
    type(decomposition_t) :: decomposition
    type(inflow_t) :: inflow
    integer(i8) :: at(4)
    integer :: step, s, k

    call make(2, 4, none, decomposition)
    inflow%next_id = 11
    do step = 1, 2
      inflow%given%n = 3 - step
      if (.not. allocated(inflow%given%grain)) allocate (inflow%given%grain(2))
      inflow%given%grain(1) = new_grain_t(radius=0.01_dp, mass=0.25_dp)
      inflow%given%grain(2) = new_grain_t(radius=0.02_dp, mass=0.5_dp)
      inflow%given%position = reshape([0.1_dp, 0.9_dp, 0.9_dp, 0.1_dp], [2, 2])
      if (step == 2) inflow%given%position(1, 1) = 0.2_dp
      inflow%given%material = [1, 1]
      call inflow%enter(decomposition, 0.0_dp, h)
    end do
    at(:) = 0
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        do k = 1, owned%n
          at(4) = at(4) + 1
          if (norm2(owned%position(:, k) - [0.1_dp, 0.9_dp]) < 0.01_dp) at(1) = owned%id(k)
          if (norm2(owned%position(:, k) - [0.9_dp, 0.1_dp]) < 0.01_dp) at(2) = owned%id(k)
          if (norm2(owned%position(:, k) - [0.2_dp, 0.9_dp]) < 0.01_dp) at(3) = owned%id(k)
        end do
      end associate
    end do
    call comm%sum_counts(at)
    call check(all(at == [11_i8, 12_i8, 13_i8, 4_i8]), "identifiers of the grains of a loop, one after the other")
    call check_equal(inflow%next_id, 14_i8, "the next one")
    call check_equal(inflow%entered(), 3_i8, "grains of a loop that have entered")
    call check_close(inflow%mass(), 1.0_dp, 0.0_dp, "their mass")
  end subroutine test_given

  !> Where there is no place, grains are put off, and nothing changes but the count of that.
  subroutine test_full()
    type(decomposition_t) :: decomposition
    type(inflow_t) :: inflow, closed

    call make(2, 4, none, decomposition)
    call open_up(2, inflow)
    inflow%insertions(1)%lower(1:2) = 0.4_dp
    inflow%insertions(1)%upper(1:2) = 0.6_dp
    inflow%insertions(2)%rate = 0.0_dp
    call inflow%enter(decomposition, 0.0_dp, h)
    call check_equal(inflow%entered(), 0_i8, "none enters")
    call check_equal(inflow%insertions(1)%put_off, 1_i8, "one step is counted")
    call check_equal(inflow%insertions(2)%put_off, 0_i8, "but not of one that owes nothing")
    call check_equal(inflow%next_id, 11_i8, "identifiers wait")
    call check_equal(inflow%insertions(1)%grains_behind(h), 20_i8, "what is owed")
    call check(.not. closed%exists() .and. closed%entered() == 0, "no insertion")
    call closed%enter(decomposition, 0.0_dp, h)
  end subroutine test_full

  subroutine test_state()
    type(inflow_t) :: inflow, again
    integer(i8), allocatable :: words(:)
    logical :: sound

    call open_up(2, inflow)
    inflow%insertions(2)%entered = 3
    inflow%insertions(2)%mass = 0.25_dp
    inflow%given_entered = 5
    inflow%given_mass = 0.75_dp
    call inflow%get_state(words)
    call check_equal(size(words), given_words + 2*insertion_words, "words of an account for a loop and of two insertions")
    call open_up(2, again)
    call again%set_state(words, sound)
    call check(sound, "accounts")
    call check_equal(again%entered(), 8_i8, "grains, of a loop as well")
    call check_equal(again%given_entered, 5_i8, "grains of a loop")
    call check_close(again%mass(), 1.0_dp, 0.0_dp, "mass")
    words(given_words + insertion_words + 1) = -1
    call again%set_state(words, sound)
    call check(.not. sound, "a damaged account")
    words(given_words + insertion_words + 1) = 0
    words(1) = -1
    call again%set_state(words, sound)
    call check(.not. sound, "a damaged account of a loop")
  end subroutine test_state

end program test_inflow
