!> The contacts of a solved step as contacts with forces, from which another run can start: what gravier_given_impulses takes.
module gravier_contact_forces
  use gravier_kinds, only: dp, i8
  use gravier_given_contacts, only: given_contacts_t
  use gravier_contact_kernels, only: global_moment, lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  use gravier_decomposition, only: decomposition_t
  use gravier_halo, only: halo_t
  use gravier_contact_places, only: find_contact_place
  use gravier_contact_springs, only: find_elongation
  implicit none
  private
  public :: list_forces

contains

  !> The contacts of this rank that press, subdomain by subdomain in the order of the lists. Collective.
  subroutine list_forces(problem, decomposition, halo, h, contacts)
    !> solved
    type(contact_problem_t), intent(in) :: problem
    type(decomposition_t), intent(in) :: decomposition
    type(halo_t), intent(in) :: halo
    !> step [s]
    real(dp), intent(in) :: h
    type(given_contacts_t), intent(out) :: contacts
    integer, allocatable :: order(:)
    integer :: s, k, c, b, n, nd

    associate (boundaries => decomposition%boundaries)
      nd = problem%nd
      n = 0
      do s = 1, size(problem%sub)
        do c = 1, problem%sub(s)%n_contacts
          if (presses(problem%sub(s), c)) n = n + 1
        end do
      end do
      contacts%n = n
      contacts%total = problem%comm%total(int(n, i8))
      allocate (contacts%candidate(n), contacts%antagonist(n), contacts%normal(nd, n), contacts%force(nd, n), contacts%point(nd, n))
      if (problem%has_rolling()) allocate (contacts%moment(2*nd - 3, n))
      if (halo%memory%n_spring > 0) allocate (contacts%elongation(nd, n))
      allocate (contacts%boundary(size(boundaries)))
      do b = 1, size(boundaries)
        contacts%boundary(b) = boundaries(b)%name
      end do
      n = 0
      do s = 1, size(problem%sub)
        associate (sub => problem%sub(s), view => halo%view(s))
          call order_by_lists(sub, view%list%n, order)
          do k = 1, size(order)
            c = order(k)
            if (.not. presses(sub, c)) cycle
            n = n + 1
            contacts%candidate(n) = view%bodies%id(view%list%candidate(sub%source(c)))
            ! minus the number of a boundary
            contacts%antagonist(n) = view%list%antagonist(sub%source(c))
            if (contacts%antagonist(n) > 0) contacts%antagonist(n) = view%bodies%id(view%list%antagonist(sub%source(c)))
            contacts%normal(:, n) = sub%hot(lane_of(c), 1:nd, block_of(c))
            call problem%impulse_on_candidate(s, c, contacts%force(:, n))
            contacts%force(:, n) = contacts%force(:, n)/h
            call find_contact_place(problem%kernels, view, sub, c, contacts%point(:, n))
            if (allocated(contacts%elongation)) call find_elongation(view%list, sub, c, contacts%elongation(:, n))
            if (.not. allocated(contacts%moment)) cycle
            call global_moment(problem%kernels, sub%hot, sub%impulse, c, contacts%moment(:, n))
            contacts%moment(:, n) = contacts%moment(:, n)/h
          end do
        end associate
      end do
    end associate
  end subroutine list_forces

  !> Whether the bodies of a contact press each other in the solve, attractions among what presses them.
  pure logical function presses(sub, c)
    type(subproblem_t), intent(in) :: sub
    integer, intent(in) :: c
    presses = sub%impulse(lane_of(c), 1, block_of(c)) > 0.0_dp
  end function presses

  !> The contacts of a subdomain in the order of its list, in which the points of a pair do not depend on the order of sweeps.
  pure subroutine order_by_lists(sub, n_pairs, order)
    type(subproblem_t), intent(in) :: sub
    integer, intent(in) :: n_pairs
    integer, allocatable, intent(out) :: order(:)
    integer :: contact_of(n_pairs), c, p, n

    contact_of(:) = 0
    do c = 1, sub%n_contacts
      contact_of(sub%source(c)) = c
    end do
    allocate (order(sub%n_contacts))
    n = 0
    do p = 1, n_pairs
      if (contact_of(p) == 0) cycle
      n = n + 1
      order(n) = contact_of(p)
    end do
  end subroutine order_by_lists

end module gravier_contact_forces
