!> Values on shared bodies: the plan of the exchange, what passes, and sums over the copies in subdomain order.
!> Bodies are shared by random subsets of subdomains that every rank knows by hashing.
program test_shared_exchange
  use gravier_kinds, only: dp, i8
  use gravier_random_hash, only: hash_uniform
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_shared_exchange, only: shared_exchange_t, shared_part_t
  use gravier_check, only: check, check_equal, finish_checks
  implicit none
  integer, parameter :: n_grains = 150, most_sharers = 9
  type(communicator_t) :: comm
  integer :: k

  call start_parallel()
  call comm%init()
  ! fewer subdomains than ranks, as many, several on each rank
  do k = 1, 3
    call test_exchange(2, 6, k)
    call test_exchange(4, 3, 10 + k)
    call test_exchange(9, 1, 20 + k)
    call test_exchange(23, 6, 30 + k)
  end do
  call test_nothing_shared()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> Whether subdomain `s` of `n` holds a copy of body `id`: about half of the bodies are shared, some by nine.
  logical function holds(s, id, n, trial)
    integer, intent(in) :: s, id, n, trial
    integer :: wanted, t, met

    wanted = min(n, 1 + int(most_sharers*hash_uniform(trial, int(id, i8), 1)**2))
    ! the first `wanted` subdomains after a random one, with gaps where there are many
    holds = .false.
    met = 0
    t = int(n*hash_uniform(trial, int(id, i8), 2))
    do while (met < wanted)
      if (mod(t, n) + 1 == s) holds = .true.
      met = met + 1
      t = t + 1
      if (n > 2*most_sharers .and. hash_uniform(trial, int(id, i8), 2 + met) < 0.5_dp) t = t + 1
    end do
  end function holds

  !> Component `i` of the copy of body `id` in subdomain `s`, over many orders of magnitude.
  real(dp) function value_of(s, id, i, trial)
    integer, intent(in) :: s, id, i, trial
    integer(i8) :: counter
    counter = int(id, i8)*1000 + s
    value_of = scale(hash_uniform(trial, counter, 10*i) - 0.5_dp, int(60*hash_uniform(trial, counter, 10*i + 1)))
  end function value_of

  subroutine test_exchange(n, width, trial)
    integer, intent(in) :: n, width, trial
    type(shared_exchange_t) :: shared
    type(shared_part_t), allocatable :: part(:)
    integer, allocatable :: id(:, :)
    integer :: p, round

    call make_parts(n, trial, part, id)
    call shared%init(comm, part, n, width)
    do p = 1, size(shared%part)
      call check_plan(shared%part(p), id(:, p), n, trial)
    end do
    do round = 1, 3
      call load_all(shared, id, width, trial + round)
      call shared%pass()
      do p = 1, size(shared%part)
        call check_passed(shared, p, id(:, p), trial + round)
        call check_sums(shared, p, id(:, p), trial + round)
      end do
    end do
    call check_traffic(shared, n, width, 3)
    ! the plan of another step takes the place of the first
    call make_parts(n, trial + 100, part, id)
    call shared%init(comm, part, n, width)
    call load_all(shared, id, width, trial)
    call shared%pass()
    do p = 1, size(shared%part)
      call check_sums(shared, p, id(:, p), trial)
    end do
    call check_traffic(shared, n, width, 1)
  end subroutine test_exchange

  !> Parts of this rank, and the identifiers of the bodies of each in an order of its own (0 beyond the last).
  subroutine make_parts(n, trial, part, id)
    integer, intent(in) :: n, trial
    type(shared_part_t), allocatable, intent(out) :: part(:)
    integer, allocatable, intent(out) :: id(:, :)
    integer :: start, p, s, g, k, t, n_bodies, n_shared, copies, place(n_grains)
    integer :: body(n_grains), first(n_grains + 1), sharer(n_grains*most_sharers)

    start = comm%first_subdomain(comm%rank, n)
    allocate (part(comm%first_subdomain(comm%rank + 1, n) - start))
    allocate (id(n_grains, size(part)), source=0)
    do p = 1, size(part)
      s = start + p - 1
      n_bodies = 0
      do k = 1, n_grains
        ! 37 and 150 have no common divisor: every identifier once, in no order
        g = 1 + mod(37*k + s, n_grains)
        if (.not. holds(s, g, n, trial)) cycle
        n_bodies = n_bodies + 1
        id(n_bodies, p) = g
        place(g) = n_bodies
      end do
      n_shared = 0
      k = 0
      do g = 1, n_grains
        if (.not. holds(s, g, n, trial)) cycle
        copies = 0
        do t = 1, n
          if (holds(t, g, n, trial)) copies = copies + 1
        end do
        if (copies < 2) cycle
        n_shared = n_shared + 1
        body(n_shared) = place(g)
        first(n_shared) = k + 1
        do t = 1, n
          if (.not. holds(t, g, n, trial)) cycle
          k = k + 1
          sharer(k) = t
        end do
      end do
      first(n_shared + 1) = k + 1
      part(p)%subdomain = s
      part(p)%n_shared = n_shared
      allocate (part(p)%body(n_shared), source=body(1:n_shared))
      allocate (part(p)%first(n_shared + 1), source=first(1:n_shared + 1))
      allocate (part(p)%sharer(k), source=sharer(1:k))
    end do
  end subroutine make_parts

  !> Slots, rungs and neighbours agree with the sharers.
  subroutine check_plan(part, id, n, trial)
    type(shared_part_t), intent(in) :: part
    integer, intent(in) :: id(:), n, trial
    integer :: k, j, s, last
    logical :: right

    right = .true.
    do k = 1, part%n_shared
      right = right .and. part%multiplicity(k) >= 2 .and. part%sharer(part%first(k) + part%copy_rank(k) - 1) == part%subdomain
      do j = part%first(k), part%first(k + 1) - 1
        right = right .and. holds(part%sharer(j), id(part%body(k)), n, trial)
        if (part%sharer(j) == part%subdomain) then
          right = right .and. part%slot(j) == 0
        else
          right = right .and. part%slot(j) >= 1 .and. part%slot(j) <= part%n_slots
          if (right) right = part%slot_shared(part%slot(j)) == k
          s = findloc_of(part%neighbour, part%sharer(j))
          right = right .and. s > 0
          if (right) right = part%slot(j) >= part%neighbour_first(s) .and. part%slot(j) < part%neighbour_first(s + 1)
        end if
      end do
    end do
    call check(right, "slots and rungs agree with the sharers")
    right = part%n_slots == count(part%slot > 0) .and. size(part%slot_shared) == part%n_slots
    right = right .and. part%neighbour_first(1) == 1 .and. part%neighbour_first(size(part%neighbour) + 1) == part%n_slots + 1
    do s = 1, size(part%neighbour)
      if (s > 1) right = right .and. part%neighbour(s) > part%neighbour(s - 1)
      last = 0
      do j = part%neighbour_first(s), part%neighbour_first(s + 1) - 1
        right = right .and. id(part%body(part%slot_shared(j))) > last
        last = id(part%body(part%slot_shared(j)))
      end do
      right = right .and. last > 0
    end do
    call check(right, "slots by neighbour, then by identifier")
  end subroutine check_plan

  !> Place of a value, 0 where absent.
  integer function findloc_of(list, value) result(place)
    integer, intent(in) :: list(:), value
    do place = size(list), 1, -1
      if (list(place) == value) return
    end do
    place = 0
  end function findloc_of

  subroutine load_all(shared, id, width, trial)
    type(shared_exchange_t), intent(inout) :: shared
    integer, intent(in) :: id(:, :), width, trial
    ! one row more than is sent
    real(dp) :: field(width + 1, n_grains)
    integer :: p, b, i

    do p = 1, size(shared%part)
      field(:, :) = huge(1.0_dp)
      do b = 1, count(id(:, p) > 0)
        do i = 1, width
          field(i, b) = value_of(shared%part(p)%subdomain, id(b, p), i, trial)
        end do
      end do
      call shared%load(p, field)
    end do
  end subroutine load_all

  !> Every slot holds the value of the copy it stands for.
  subroutine check_passed(shared, p, id, trial)
    type(shared_exchange_t), intent(in) :: shared
    integer, intent(in) :: p, id(:), trial
    integer :: k, j, i
    logical :: right

    right = .true.
    associate (part => shared%part(p))
      do k = 1, part%n_shared
        do j = part%first(k), part%first(k + 1) - 1
          if (part%slot(j) == 0) cycle
          do i = 1, shared%width
            right = right .and. same_bits(part%recv(i, part%slot(j)), value_of(part%sharer(j), id(part%body(k)), i, trial))
          end do
        end do
      end do
    end associate
    call check(right, "each slot holds the value of its copy")
  end subroutine check_passed

  !> The sum over the copies has the bits of the sum in ascending order of subdomains, on every copy.
  subroutine check_sums(shared, p, id, trial)
    type(shared_exchange_t), intent(in) :: shared
    integer, intent(in) :: p, id(:), trial
    real(dp) :: value(shared%width + 1), expected
    integer :: k, j, i
    logical :: right

    right = .true.
    associate (part => shared%part(p))
      do k = 1, part%n_shared
        do i = 1, shared%width
          value(i) = value_of(part%subdomain, id(part%body(k)), i, trial)
        end do
        value(shared%width + 1) = -7.0_dp
        call shared%add_copies(p, k, value)
        do i = 1, shared%width
          expected = 0.0_dp
          do j = part%first(k), part%first(k + 1) - 1
            expected = expected + value_of(part%sharer(j), id(part%body(k)), i, trial)
          end do
          right = right .and. same_bits(value(i), expected)
        end do
        right = right .and. same_bits(value(shared%width + 1), -7.0_dp)
      end do
    end associate
    call check(right, "sums over the copies in subdomain order, bit for bit")
    call check_fields(shared, p, id, trial)
  end subroutine check_sums

  !> The same of all shared bodies at once, as sums and as means.
  subroutine check_fields(shared, p, id, trial)
    type(shared_exchange_t), intent(in) :: shared
    integer, intent(in) :: p, id(:), trial
    real(dp) :: sums(shared%width, n_grains), means(shared%width, n_grains), expected
    integer :: k, j, i
    logical :: right(2)

    right(:) = .true.
    associate (part => shared%part(p))
      sums(:, :) = 0.0_dp
      do k = 1, part%n_shared
        do i = 1, shared%width
          sums(i, part%body(k)) = value_of(part%subdomain, id(part%body(k)), i, trial)
        end do
      end do
      means(:, :) = sums
      call shared%sum_copies(p, sums, mean=.false.)
      call shared%sum_copies(p, means, mean=.true.)
      do k = 1, part%n_shared
        do i = 1, shared%width
          expected = 0.0_dp
          do j = part%first(k), part%first(k + 1) - 1
            expected = expected + value_of(part%sharer(j), id(part%body(k)), i, trial)
          end do
          right(1) = right(1) .and. same_bits(sums(i, part%body(k)), expected)
          right(2) = right(2) .and. same_bits(means(i, part%body(k)), expected/part%multiplicity(k))
        end do
      end do
    end associate
    call check(right(1), "sums of all shared bodies")
    call check(right(2), "means of all shared bodies")
  end subroutine check_fields

  pure logical function same_bits(a, b)
    real(dp), intent(in) :: a, b
    same_bits = transfer(a, 0_i8) == transfer(b, 0_i8)
  end function same_bits

  !> One message a pass to each rank that holds a copy, and nothing but the slots of its subdomains.
  subroutine check_traffic(shared, n, width, passes)
    type(shared_exchange_t), intent(in) :: shared
    integer, intent(in) :: n, width, passes
    logical :: met(0:comm%size - 1)
    integer :: p, j, r
    integer(i8) :: slots

    met(:) = .false.
    slots = 0
    do p = 1, size(shared%part)
      do j = 1, size(shared%part(p)%neighbour)
        r = comm%rank_of(shared%part(p)%neighbour(j), n)
        if (r == comm%rank) cycle
        met(r) = .true.
        slots = slots + shared%part(p)%neighbour_first(j + 1) - shared%part(p)%neighbour_first(j)
      end do
    end do
    call check_equal(shared%messages, int(passes*count(met), i8), "messages sent")
    call check_equal(shared%values, passes*width*slots, "values sent")
  end subroutine check_traffic

  !> No shared body at all, and ranks without a subdomain.
  subroutine test_nothing_shared()
    type(shared_exchange_t) :: shared
    type(shared_part_t), allocatable :: part(:)
    real(dp) :: field(2, 5)
    integer :: p

    allocate (part(comm%first_subdomain(comm%rank + 1, 3) - comm%first_subdomain(comm%rank, 3)))
    do p = 1, size(part)
      part(p)%subdomain = comm%first_subdomain(comm%rank, 3) + p - 1
      allocate (part(p)%body(0), part(p)%sharer(0))
      allocate (part(p)%first(1), source=1)
    end do
    field(:, :) = 1.0_dp
    call shared%init(comm, part, 3, 2)
    do p = 1, size(shared%part)
      call shared%load(p, field)
    end do
    call shared%pass()
    call check_equal(shared%messages, 0_i8, "nothing shared: no message")
  end subroutine test_nothing_shared

end program test_shared_exchange
