!> The contacts of the last step of a simulation as a table of named fields, for whatever file is written of them.
module gravier_contact_collector
  use gravier_kinds, only: dp, i8
  use gravier_body_store, only: body_set_t
  use gravier_boundary, only: boundary_t
  use gravier_neighbour_list, only: neighbour_list_t
  use gravier_halo, only: local_bodies_t, halo_t
  use gravier_contact_kernels, only: kernels_t, contact_arms, lane_of, block_of
  use gravier_contact_places, only: find_contact_place
  use gravier_contact_springs, only: find_elongation
  use gravier_contact_law, only: unused
  use gravier_subproblem, only: subproblem_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_field_list, only: field_list_t
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: collect_contacts, idle, sticking, sliding

  !> values of `status`: no force; a force within the cone of friction; one on it
  integer, parameter :: idle = 0, sticking = 1, sliding = 2

contains

  !> Contacts of this rank: the table `contacts` with the keys `candidate` and `antagonist`, identifiers of bodies or boundaries.
  !> The fields are `normal` (nd), `gap` [m], `impulse` on the candidate (nd; n, t[, s]) [N s], `moment` on it (about n[, t, s])
  !> [N m s], `point` where bodies have shapes (nd) [m], the place of the contact when it was detected, `elongation` of tangential
  !> springs where there are some (nd) [m], the way of the candidate against the antagonist, `normal_force` and
  !> `tangential_force` [N], `status`, and `points` (6) [m], the centre of the candidate and that of the antagonist's nearest image,
  !> or the boundary, at that time.
  subroutine collect_contacts(simulation, names, table)
    type(simulation_t), intent(in) :: simulation
    !> of the fields, in their order; a moment or a point is left out where the kernels have none
    character(len=*), intent(in) :: names(:)
    type(field_list_t), intent(out) :: table
    real(dp), allocatable :: value(:, :)
    integer(i8), allocatable :: whole(:, :)
    integer :: s, k, first, last, n

    associate (problem => simulation%problem, halo => simulation%halo, decomposition => simulation%decomposition)
      n = sum(problem%sub%n_contacts)
      call table%init("contacts", "candidate antagonist", n)
      last = 0
      do s = 1, size(problem%sub)
        call take_keys(problem%sub(s), halo%view(s)%list, halo%view(s)%bodies, decomposition%boundaries, &
          & table%key(:, last + 1:last + problem%sub(s)%n_contacts))
        last = last + problem%sub(s)%n_contacts
      end do
      do k = 1, size(names)
        if (components_of(trim(names(k)), problem, halo) == 0) cycle
        if (names(k) == "status") then
          allocate (whole(1, n))
        else
          allocate (value(components_of(trim(names(k)), problem, halo), n))
        end if
        last = 0
        do s = 1, size(problem%sub)
          first = last + 1
          last = last + problem%sub(s)%n_contacts
          if (allocated(whole)) then
            call take_status(problem%kernels, problem%sub(s), whole(1, first:last))
          else
            call take_field(problem%kernels, problem%sub(s), halo%view(s), simulation%physics%h, trim(names(k)), &
              & value(:, first:last))
          end if
        end do
        if (allocated(whole)) then
          call table%add_whole(trim(names(k)), "", whole, .true.)
        else
          call table%add_reals(trim(names(k)), unit_of(trim(names(k))), value, is_scalar(trim(names(k))))
        end if
      end do
    end associate
  end subroutine collect_contacts

  !> Numbers of a contact in a field, 0 where the scene has none.
  pure integer function components_of(name, problem, halo) result(n)
    character(len=*), intent(in) :: name
    type(contact_problem_t), intent(in) :: problem
    type(halo_t), intent(in) :: halo

    select case (name)
    case ("normal", "impulse")
      n = problem%nd
    case ("moment")
      n = merge(2*problem%nd - 3, 0, problem%has_rolling())
    case ("point")
      n = merge(problem%nd, 0, problem%has_shapes())
    case ("elongation")
      n = merge(problem%nd, 0, halo%memory%n_spring > 0)
    case ("points")
      n = 6
    case default
      n = 1
    end select
  end function components_of

  !> Unit of a field, empty where none is said.
  pure function unit_of(name) result(unit)
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: unit

    select case (name)
    case ("gap", "point", "points", "elongation")
      unit = "m"
    case ("impulse")
      unit = "N s"
    case ("moment")
      unit = "N m s"
    case ("normal_force", "tangential_force")
      unit = "N"
    case default
      unit = ""
    end select
  end function unit_of

  !> Whether a field has one number by its meaning.
  pure logical function is_scalar(name)
    character(len=*), intent(in) :: name
    is_scalar = name == "gap" .or. name == "normal_force" .or. name == "tangential_force" .or. name == "status"
  end function is_scalar

  !> Identifiers of candidate and antagonist of the contacts of a subdomain of this rank.
  subroutine take_keys(sub, list, bodies, boundaries, key)
    type(subproblem_t), intent(in) :: sub
    !> its pairs, and the bodies that they name
    type(neighbour_list_t), intent(in) :: list
    type(body_set_t), intent(in) :: bodies
    type(boundary_t), intent(in) :: boundaries(:)
    !> (2, contacts)
    integer(i8), intent(out) :: key(:, :)
    integer :: c, p

    do c = 1, sub%n_contacts
      p = sub%source(c)
      key(1, c) = bodies%id(list%candidate(p))
      if (list%antagonist(p) > 0) then
        key(2, c) = bodies%id(list%antagonist(p))
      else
        key(2, c) = boundaries(-list%antagonist(p))%id
      end if
    end do
  end subroutine take_keys

  !> A field of the contacts of a subdomain of this rank.
  subroutine take_field(kernels, sub, view, h, name, values)
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(in) :: sub
    !> what this subdomain sees
    type(local_bodies_t), intent(in) :: view
    !> step [s]
    real(dp), intent(in) :: h
    character(len=*), intent(in) :: name
    !> (components, contacts)
    real(dp), intent(out) :: values(:, :)
    integer :: c, nd, nf

    nd = kernels%nd
    nf = kernels%nf
    select case (name)
    case ("normal")
      do c = 1, sub%n_contacts
        values(:, c) = sub%hot(lane_of(c), 1:nd, block_of(c))
      end do
    case ("gap")
      values(1, :) = sub%gap
    case ("impulse")
      do c = 1, sub%n_contacts
        values(1, c) = sub%normal_impulse(c)
        ! without friction there is none along the tangents
        values(2:nf, c) = sub%impulse(lane_of(c), 2:nf, block_of(c))
        values(nf + 1:, c) = 0.0_dp
      end do
    case ("moment")
      call take_moments(sub, nd, kernels%rolling_row, kernels%nc, values)
    case ("normal_force")
      do c = 1, sub%n_contacts
        values(1, c) = sub%normal_impulse(c)/h
      end do
    case ("tangential_force")
      do c = 1, sub%n_contacts
        values(1, c) = tangential_impulse(sub, nf, c)/h
      end do
    case ("point")
      call take_places(kernels, sub, view, values)
    case ("elongation")
      do c = 1, sub%n_contacts
        call find_elongation(view%list, sub, c, values(:, c))
      end do
    case ("points")
      if (kernels%has_shapes()) then
        call take_ways(kernels, sub, view%list, view%bodies, values)
      else
        call take_points(nd, sub, view%list, view%bodies, values)
      end if
    end select
  end subroutine take_field

  !> Moments of the contacts of a subdomain about n[, t, s].
  pure subroutine take_moments(sub, nd, rolling_row, nc, values)
    type(subproblem_t), intent(in) :: sub
    !> space dimension, row of the rolling resistance, components of an impulse
    integer, intent(in) :: nd, rolling_row, nc
    !> (1 or 3, contacts)
    real(dp), intent(out) :: values(:, :)
    real(dp) :: radius
    integer :: c

    do c = 1, sub%n_contacts
      radius = sub%hot(lane_of(c), rolling_row + 1, block_of(c))
      ! that about the normal comes last in a sweep
      values(1, c) = radius*sub%impulse(lane_of(c), nc, block_of(c))
      if (nd == 3) values(2:3, c) = radius*sub%impulse(lane_of(c), 4:5, block_of(c))
    end do
  end subroutine take_moments

  !> Size of the tangential impulse of contact `c` [N s].
  pure real(dp) function tangential_impulse(sub, nf, c) result(tangential)
    type(subproblem_t), intent(in) :: sub
    !> components of a force
    integer, intent(in) :: nf
    integer, intent(in) :: c

    tangential = 0.0_dp
    if (nf > 1) tangential = norm2(sub%impulse(lane_of(c), 2:nf, block_of(c)))
  end function tangential_impulse

  !> Ends of the contacts of a subdomain of this rank; in 2D in the plane z = 0.
  subroutine take_points(nd, sub, list, bodies, point)
    integer, intent(in) :: nd
    type(subproblem_t), intent(in) :: sub
    !> its pairs, and the bodies that they name
    type(neighbour_list_t), intent(in) :: list
    type(body_set_t), intent(in) :: bodies
    !> (6, contacts)
    real(dp), intent(out) :: point(:, :)
    real(dp) :: reach
    integer :: c, p

    point(:, :) = 0.0_dp
    do c = 1, sub%n_contacts
      p = sub%source(c)
      associate (candidate => list%candidate(p), antagonist => list%antagonist(p))
        point(1:nd, c) = bodies%position(:, candidate)
        reach = bodies%radius(candidate) + sub%gap(c)
        if (antagonist > 0) reach = reach + bodies%radius(antagonist)
      end associate
      point(4:3 + nd, c) = point(1:nd, c) - reach*sub%hot(lane_of(c), 1:nd, block_of(c))
    end do
  end subroutine take_points

  !> Where the bodies of the contacts of a subdomain of this rank touch.
  subroutine take_places(kernels, sub, view, place)
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(in) :: sub
    !> what this subdomain sees
    type(local_bodies_t), intent(in) :: view
    !> (nd, contacts)
    real(dp), intent(out) :: place(:, :)
    integer :: c

    do c = 1, sub%n_contacts
      call find_contact_place(kernels, view, sub, c, place(:, c))
    end do
  end subroutine take_places

  !> The same ends as of take_points, of bodies with shapes: from the centre of the candidate to that of the antagonist, whose ways
  !> to the contact are their arms, or to the contact with a boundary.
  subroutine take_ways(kernels, sub, list, bodies, point)
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(in) :: sub
    !> its pairs, and the bodies that they name
    type(neighbour_list_t), intent(in) :: list
    type(body_set_t), intent(in) :: bodies
    !> (6, contacts)
    real(dp), intent(out) :: point(:, :)
    real(dp) :: arm_i(kernels%nd), arm_j(kernels%nd)
    integer :: c, nd

    nd = kernels%nd
    point(:, :) = 0.0_dp
    do c = 1, sub%n_contacts
      call contact_arms(kernels, sub%hot, c, arm_i, arm_j)
      point(1:nd, c) = bodies%position(:, list%candidate(sub%source(c)))
      point(4:3 + nd, c) = point(1:nd, c) + arm_i - arm_j
    end do
  end subroutine take_ways

  !> How the contacts of a subdomain carry: idle, sticking or sliding.
  subroutine take_status(kernels, sub, status)
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(in) :: sub
    !> (contacts)
    integer(i8), intent(out) :: status(:)
    real(dp) :: held, bound
    integer :: c

    do c = 1, sub%n_contacts
      held = sub%impulse(lane_of(c), 1, block_of(c))
      status(c) = idle
      if (.not. held > 0.0_dp) cycle
      status(c) = sliding
      if (kernels%nf == 1) cycle
      bound = (1.0_dp - unused)*sub%hot(lane_of(c), kernels%friction_row, block_of(c))*held
      if (tangential_impulse(sub, kernels%nf, c) < bound) status(c) = sticking
    end do
  end subroutine take_status

end module gravier_contact_collector
