!> Islands: the bodies that impulses of contacts join. Contacts with what is prescribed join nothing, nor do contacts without an
!> impulse, so that no impulse of one island has an effect on another.
!>
!> A mean over all bodies hides what is wrong in a small island beside large ones. What is summed over the contacts and bodies of
!> each island by itself does not.
module gravier_islands
  use gravier_kinds, only: dp, i8
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_timers, only: start_timer, stop_timer, phase_reduction
  use gravier_narrow, only: narrow
  use gravier_disjoint_sets, only: join_sets, number_sets
  use gravier_body_mass, only: inverse_of_translation
  use gravier_communicator, only: communicator_t
  use gravier_shared_exchange, only: shared_exchange_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  implicit none
  private
  public :: islands_t, island_part_t, island_sums_t, find_islands

  !> Islands that lie in several subdomains are summed in so many places at most, and in `places_a_piece` for each of their pieces.
  !> Those that share a place count as one.
  integer, parameter :: most_places = 61, places_a_piece = 4

  !> The islands of one subdomain: those that lie in several have a piece in each.
  type :: island_part_t
    !> number of islands and pieces
    integer :: n = 0
    !> island of each body (n_bodies)
    integer, allocatable :: of_body(:)
    !> mass of the bodies of each island, in all subdomains (n) [kg]
    real(dp), allocatable :: mass(:)
    !> whether that is less than what `find_islands` was given (n)
    logical, allocatable :: is_small(:)
    !> place at which an island in several subdomains is summed, 0 of one that lies in this alone (n)
    integer, allocatable, private :: place(:)
  end type island_part_t

  !> Sums over the islands of one subdomain.
  type :: island_sums_t
    !> (sums, islands)
    real(dp), allocatable :: value(:, :)
  end type island_sums_t

  type :: islands_t
    !> one a subdomain of this rank
    type(island_part_t), allocatable :: part(:)
    !> places at which islands in several subdomains are summed
    integer, private :: n_places = 0
  contains
    procedure :: of_contact => islands_of_contact
    procedure :: complete => islands_complete
  end type islands_t

contains

  !> Find the islands of a problem. A contact joins two bodies that can move where it has an impulse. Collective.
  subroutine find_islands(problem, most, islands)
    type(contact_problem_t), intent(inout) :: problem
    !> mass below which an island is small [kg]
    real(dp), intent(in) :: most
    type(islands_t), intent(out) :: islands
    type(island_sums_t) :: mass(size(problem%sub))
    integer :: s

    allocate (islands%part(size(problem%sub)))
    do s = 1, size(problem%sub)
      call join_bodies(problem%sub(s), islands%part(s))
    end do
    if (problem%n_subdomains > 1) call find_places(problem%sub, problem%comm, problem%shared, islands)
    do s = 1, size(mass)
      call add_masses(problem%sub(s), problem%nd, islands%part(s), mass(s))
    end do
    call islands%complete(problem, 1, mass)
    do s = 1, size(mass)
      islands%part(s)%mass = mass(s)%value(1, :)
      islands%part(s)%is_small = islands%part(s)%mass < most
    end do
  end subroutine find_islands

  !> The islands of a subdomain.
  subroutine join_bodies(sub, part)
    type(subproblem_t), intent(in) :: sub
    type(island_part_t), intent(out) :: part
    integer :: b, c

    allocate (part%of_body(sub%n_bodies))
    do b = 1, sub%n_bodies
      part%of_body(b) = b
    end do
    do c = 1, sub%n_contacts
      if (maxval(sub%pair(:, c)) > sub%n_bodies) cycle
      if (.not. abs(sub%impulse(lane_of(c), 1, block_of(c))) > 0.0_dp) cycle
      call join_sets(sub%pair(1, c), sub%pair(2, c), part%of_body)
    end do
    call number_sets(part%of_body, part%n)
    allocate (part%place(part%n), source=0)
  end subroutine join_bodies

  !> The masses of the islands of a subdomain, a copy of a shared body counting with its part.
  pure subroutine add_masses(sub, nd, part, mass)
    type(subproblem_t), intent(in) :: sub
    !> 2 or 3
    integer, intent(in) :: nd
    type(island_part_t), intent(in) :: part
    !> of one sum [kg]
    type(island_sums_t), intent(inout) :: mass
    real(dp) :: inverse
    integer :: b

    allocate (mass%value(1, part%n), source=0.0_dp)
    do b = 1, sub%n_bodies
      inverse = inverse_of_translation(sub%inverse_mass(:, b), nd)
      if (.not. inverse > 0.0_dp) cycle
      associate (total => mass%value(1, part%of_body(b)))
        total = total + 1.0_dp/(inverse*sub%multiplicity(b))
      end associate
    end do
  end subroutine add_masses

  !> Places of the islands that lie in several subdomains, by the least identifier of the bodies that these share. Collective.
  subroutine find_places(sub, comm, shared, islands)
    type(subproblem_t), intent(in) :: sub(:)
    type(communicator_t), intent(in) :: comm
    type(shared_exchange_t), intent(inout) :: shared
    type(islands_t), intent(inout) :: islands
    type :: labels_t
      !> least identifier of each island, huge of one that lies in this subdomain alone (islands)
      real(dp), allocatable :: of_island(:)
    end type labels_t
    type(labels_t) :: label(size(islands%part))
    real(dp), allocatable :: field(:, :)
    integer(i8) :: pieces(1)
    integer :: s, b, i, j
    logical :: changed

    do s = 1, size(label)
      associate (part => islands%part(s), copies => shared%part(s))
        allocate (label(s)%of_island(part%n), source=huge(1.0_dp))
        do j = 1, copies%n_shared
          b = copies%body(j)
          i = part%of_body(b)
          label(s)%of_island(i) = min(label(s)%of_island(i), real(sub(s)%id(b), dp))
        end do
      end associate
    end do
    do
      do s = 1, size(label)
        associate (part => islands%part(s), copies => shared%part(s))
          allocate (field(shared%width, sub(s)%n_columns), source=0.0_dp)
          do j = 1, copies%n_shared
            field(1, copies%body(j)) = label(s)%of_island(part%of_body(copies%body(j)))
          end do
          call shared%load(s, field)
          deallocate (field)
        end associate
      end do
      call shared%pass()
      changed = .false.
      do s = 1, size(label)
        associate (part => islands%part(s), copies => shared%part(s))
          do j = 1, copies%n_slots
            i = part%of_body(copies%slot_body(j))
            if (.not. copies%recv(1, j) < label(s)%of_island(i)) cycle
            label(s)%of_island(i) = copies%recv(1, j)
            changed = .true.
          end do
        end associate
      end do
      if (.not. comm%any_true(changed)) exit
    end do
    pieces(1) = 0
    do s = 1, size(label)
      pieces(1) = pieces(1) + count(label(s)%of_island < huge(1.0_dp))
    end do
    call comm%sum_counts(pieces)
    islands%n_places = narrow(min(places_a_piece*pieces(1), int(most_places, i8)))
    do s = 1, size(label)
      do i = 1, islands%part(s)%n
        if (label(s)%of_island(i) < huge(1.0_dp)) islands%part(s)%place(i) = 1 + &
          & narrow(modulo(mixed(nint(label(s)%of_island(i), i8)), int(islands%n_places, i8)))
      end do
    end do
  end subroutine find_places

  !> A number made of an identifier, whose remainders are spread whatever the identifiers have in common.
  pure integer(i8) function mixed(id)
    integer(i8), intent(in) :: id
    !> of the generator of Park and Miller
    integer(i8), parameter :: multiplier = 48271_i8, prime = 2147483647_i8
    integer :: k

    mixed = id
    do k = 1, 2
      mixed = modulo(modulo(mixed, prime)*multiplier, prime)
      mixed = ieor(mixed, shiftr(mixed, 13))
    end do
  end function mixed

  !> The island of contact `c` of a subdomain, 0 where none of its bodies can move.
  pure integer function islands_of_contact(self, s, sub, c) result(island)
    class(islands_t), intent(in) :: self
    !> number of the subdomain on this rank
    integer, intent(in) :: s
    type(subproblem_t), intent(in) :: sub
    integer, intent(in) :: c
    integer :: b

    island = 0
    b = minval(sub%pair(:, c))
    if (b <= sub%n_bodies) island = self%part(s)%of_body(b)
  end function islands_of_contact

  !> Complete sums over islands that lie in several subdomains: each of their pieces gets those of the whole. Collective.
  subroutine islands_complete(self, problem, n, sums)
    class(islands_t), intent(in) :: self
    type(contact_problem_t), intent(in) :: problem
    !> sums of an island
    integer, intent(in) :: n
    !> of the subdomains of this rank, which may have none
    type(island_sums_t), intent(inout) :: sums(:)
    !> (sums and places, subdomains)
    real(dp), allocatable :: parts(:, :), total(:)
    integer :: s, i, at

    if (self%n_places == 0) return
    allocate (parts(n*self%n_places, size(sums)), source=0.0_dp)
    allocate (total(n*self%n_places))
    do s = 1, size(sums)
      do i = 1, self%part(s)%n
        at = n*(self%part(s)%place(i) - 1)
        if (at >= 0) parts(at + 1:at + n, s) = parts(at + 1:at + n, s) + sums(s)%value(:, i)
      end do
    end do
    call start_timer(phase_reduction)
    call problem%comm%sum_parts(parts, total)
    call stop_timer(phase_reduction)
    do s = 1, size(sums)
      do i = 1, self%part(s)%n
        at = n*(self%part(s)%place(i) - 1)
        if (at >= 0) sums(s)%value(:, i) = total(at + 1:at + n)
      end do
    end do
  end subroutine islands_complete

end module gravier_islands
