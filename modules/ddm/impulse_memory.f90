!> Impulses kept from one step to the next, so that a solve starts from those of contacts that persist.
module gravier_impulse_memory
  use gravier_kinds, only: dp, i8
  use gravier_sorting, only: argsort_rows
  use gravier_sparse_exchange, only: sparse_exchange
  use gravier_contact_kernels, only: tangents
  use gravier_contact_problem, only: contact_problem_t, subproblem_t
  use gravier_body_store, only: wall_set_t
  use gravier_detection, only: owner_point
  use gravier_motion, only: predict_position, advance_position
  use gravier_decomposition, only: decomposition_t
  implicit none
  private
  public :: impulse_memory_t

  !> Impulses of the contacts of this rank at the end of a step. A record is: identifiers of the candidate and the
  !> antagonist, the point that will decide the owner of the contact in the next step (nd), the normal impulse and
  !> the tangential one (a number in 2D, a vector in global axes in 3D).
  type :: impulse_memory_t
    integer :: nd = 2, nt = 0
    integer(i8), allocatable :: records(:, :)
  contains
    procedure :: keep => impulse_memory_keep
    procedure :: recall => impulse_memory_recall
  end type impulse_memory_t

contains

  !> Keep the impulses of a solved problem (non-zero ones). v_global must be that of the impulses.
  subroutine impulse_memory_keep(self, problem, walls, kind, h, theta)
    class(impulse_memory_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    type(wall_set_t), intent(in) :: walls
    !> rule that gives contacts to subdomains, see gravier_detection
    integer, intent(in) :: kind
    !> [s]
    real(dp), intent(in) :: h, theta
    real(dp) :: point(problem%kernels%nd)
    integer :: s, c, n

    self%nd = problem%kernels%nd
    self%nt = merge(0, 2*self%nd - 3, problem%kernels%nc == 1)
    n = 0
    do s = 1, size(problem%sub)
      n = n + count(problem%sub(s)%impulse(1, :) > 0.0_dp)
    end do
    if (allocated(self%records)) deallocate (self%records)
    allocate (self%records(3 + self%nd + self%nt, n))
    n = 0
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do c = 1, sub%n_contacts
          if (.not. sub%impulse(1, c) > 0.0_dp) cycle
          n = n + 1
          self%records(1, n) = sub%id(sub%pair(1, c))
          self%records(2, n) = sub%id(sub%pair(2, c))
          call next_point(sub, c, walls, kind, h, theta, point)
          call write_impulse(self, sub, c, point, self%records(:, n))
        end do
      end associate
    end do
  end subroutine impulse_memory_keep

  !> Where the point that decides the owner of contact `c` will be at the next detection.
  subroutine next_point(sub, c, walls, kind, h, theta, point)
    type(subproblem_t), intent(in) :: sub
    integer, intent(in) :: c, kind
    type(wall_set_t), intent(in) :: walls
    real(dp), intent(in) :: h, theta
    real(dp), intent(out), contiguous :: point(:)
    real(dp) :: candidate(size(point)), antagonist(size(point))
    integer :: w

    call next_place(sub, sub%pair(1, c), h, theta, candidate)
    w = sub%pair(2, c) - sub%n_bodies
    if (w > 0) then
      antagonist(:) = candidate - max(dot_product(candidate - walls%point(:, w), walls%normal(:, w)), 0.0_dp)*walls%normal(:, w)
    else
      call next_place(sub, sub%pair(2, c), h, theta, antagonist)
    end if
    point(:) = owner_point(kind, candidate, antagonist, w > 0)
  end subroutine next_point

  subroutine next_place(sub, b, h, theta, place)
    type(subproblem_t), intent(in) :: sub
    integer, intent(in) :: b
    real(dp), intent(in) :: h, theta
    real(dp), intent(out) :: place(:)
    integer :: d
    real(dp) :: q

    do d = 1, size(place)
      q = advance_position(sub%position(d, b), sub%v_global(d, b), h, theta)
      place(d) = predict_position(q, sub%v_global(d, b), h, theta)
    end do
  end subroutine next_place

  subroutine write_impulse(self, sub, c, point, record)
    class(impulse_memory_t), intent(in) :: self
    type(subproblem_t), intent(in) :: sub
    integer, intent(in) :: c
    real(dp), intent(in) :: point(:)
    integer(i8), intent(inout) :: record(:)
    real(dp) :: t(3), s(3), p(3)
    integer :: d

    do d = 1, self%nd
      record(2 + d) = transfer(point(d), 0_i8)
    end do
    record(3 + self%nd) = transfer(sub%impulse(1, c), 0_i8)
    if (self%nt == 1) then
      record(4 + self%nd) = transfer(sub%impulse(2, c), 0_i8)
    else if (self%nt == 3) then
      call tangents(sub%hot(1:3, c), t, s)
      p(:) = sub%impulse(2, c)*t + sub%impulse(3, c)*s
      do d = 1, 3
        record(3 + self%nd + d) = transfer(p(d), 0_i8)
      end do
    end if
  end subroutine write_impulse

  !> Bring each impulse to the subdomain that owns its contact now, and start the contacts from them. Collective.
  subroutine impulse_memory_recall(self, decomposition, problem)
    class(impulse_memory_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(contact_problem_t), intent(inout) :: problem
    integer(i8), allocatable :: records(:, :), received(:, :), mine(:, :), keys(:, :)
    integer, allocatable :: destination(:), order(:), first(:)
    real(dp) :: point(self%nd)
    integer :: k, d, s, n_words, owner

    if (.not. allocated(self%records)) return
    n_words = size(self%records, 1)
    allocate (records(n_words + 1, size(self%records, 2)), destination(size(self%records, 2)))
    do k = 1, size(self%records, 2)
      do d = 1, self%nd
        point(d) = transfer(self%records(2 + d, k), 0.0_dp)
      end do
      owner = decomposition%partition%owner(point)
      destination(k) = decomposition%comm%rank_of(owner, decomposition%n_subdomains)
      records(1, k) = owner
      records(2:, k) = self%records(:, k)
    end do
    call sparse_exchange(decomposition%comm, records, destination, received)
    allocate (order(size(received, 2)), keys(3, size(received, 2)), mine(n_words + 1, size(received, 2)))
    keys(:, :) = received(1:3, :)
    call argsort_rows(keys, order)
    do k = 1, size(order)
      mine(:, k) = received(:, order(k))
    end do
    allocate (first(size(problem%sub) + 1))
    k = 1
    do s = 1, size(problem%sub)
      first(s) = k
      do while (k <= size(mine, 2))
        if (mine(1, k) /= problem%sub(s)%subdomain) exit
        k = k + 1
      end do
      first(s + 1) = k
      call match(self, mine(:, first(s):first(s + 1) - 1), problem%sub(s))
    end do
  end subroutine impulse_memory_recall

  !> Start the contacts of a subdomain from the impulses remembered for the same pairs.
  subroutine match(self, mine, sub)
    class(impulse_memory_t), intent(in) :: self
    !> sorted by candidate and antagonist, the second and third words
    integer(i8), intent(in), contiguous :: mine(:, :)
    type(subproblem_t), intent(inout) :: sub
    integer :: c, k

    do c = 1, sub%n_contacts
      k = find_pair(mine, sub%id(sub%pair(1, c)), sub%id(sub%pair(2, c)))
      if (k > 0) call read_impulse(self, mine(2:, k), sub%hot(:, c), sub%impulse(:, c))
    end do
  end subroutine match

  pure integer function find_pair(mine, candidate, antagonist) result(place)
    integer(i8), intent(in), contiguous :: mine(:, :)
    integer(i8), intent(in) :: candidate, antagonist
    integer :: low, high

    low = 1
    high = size(mine, 2)
    do while (low <= high)
      place = (low + high)/2
      if (mine(2, place) == candidate .and. mine(3, place) == antagonist) return
      if (mine(2, place) < candidate .or. (mine(2, place) == candidate .and. mine(3, place) < antagonist)) then
        low = place + 1
      else
        high = place - 1
      end if
    end do
    place = 0
  end function find_pair

  !> The remembered impulse in the contact's present frame; a tangential vector is projected on the tangent plane.
  pure subroutine read_impulse(self, record, hot, impulse)
    class(impulse_memory_t), intent(in) :: self
    integer(i8), intent(in) :: record(:)
    real(dp), intent(in), contiguous :: hot(:)
    real(dp), intent(inout) :: impulse(:)
    real(dp) :: t(3), s(3), p(3)
    integer :: d

    impulse(1) = transfer(record(3 + self%nd), 0.0_dp)
    if (self%nt == 1) then
      impulse(2) = transfer(record(4 + self%nd), 0.0_dp)
    else if (self%nt == 3) then
      do d = 1, 3
        p(d) = transfer(record(3 + self%nd + d), 0.0_dp)
      end do
      call tangents(hot(1:3), t, s)
      impulse(2) = dot_product(p, t)
      impulse(3) = dot_product(p, s)
    end if
  end subroutine read_impulse

end module gravier_impulse_memory
