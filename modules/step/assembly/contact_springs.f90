!> The springs of compliant contacts: what they add to the packed contacts of a step, how far they are stretched after it, and their
!> energy. Elongations along the tangents stay with the pairs of the neighbour lists (gravier_neighbour_list), as numbers in the
!> plane and as vectors in space; those along the normal are the gaps.
module gravier_contact_springs
  use gravier_kinds, only: dp
  use gravier_contact_spring, only: spring_t
  use gravier_contact_law, only: unused
  use gravier_contact_kernels, only: kernels_t, lane_of, block_of, contact_tangents, lanes
  use gravier_contact_operator, only: find_local_operator
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  use gravier_cell_response, only: subtract_images
  use gravier_neighbour_list, only: neighbour_list_t
  use gravier_halo, only: local_bodies_t
  use gravier_physics, only: physics_t
  implicit none
  private
  public :: pack_spring, stretch_spring, conclude_springs, measure_springs, spring_energies, find_elongation, put_elongation

  !> The most that a contact counts of h^2 k W_nn: springs that are stiffer are as rigid contacts for the step, whose forces do not
  !> depend on how stiff they are.
  real(dp), parameter :: most_stiffness = 20.0_dp

contains

  !> Give contact `c` its springs: shifts and compliances. The contact is packed but for these and for its local operator; a rigid
  !> contact comes back as it was, without compliance.
  subroutine pack_spring(list, spring, kernels, physics, c, velocity, sub)
    type(neighbour_list_t), intent(in) :: list
    type(spring_t), intent(in) :: spring
    type(kernels_t), intent(in) :: kernels
    type(physics_t), intent(in) :: physics
    integer, intent(in) :: c
    !> of the contact at the start of the step (nd) [m/s]
    real(dp), intent(in) :: velocity(:)
    type(subproblem_t), intent(inout) :: sub
    real(dp) :: w(2), law(2)

    associate (q => lane_of(c), g => block_of(c), row => kernels%row, own => sub%spring(c), h => physics%h)
      sub%hot(q, row%compliance_n:row%compliance_t, g) = 0.0_dp
      own%spring = spring
      if (.not. spring%yields()) return
      own%velocity(1:size(velocity)) = velocity
      call find_local_operator(kernels, sub%pair, sub%hot, c, sub%inverse_mass, w)
      call own%damp(w(1), h, sub%gap(c))
      sub%stiffest = max(sub%stiffest, h*sqrt(spring%stiffness(1)*w(1)))
      if (sub%gap(c) < 0.0_dp) then
        sub%stiffness = sub%stiffness + min(h**2*spring%stiffness(1)*w(1), most_stiffness)
        sub%n_springs = sub%n_springs + 1
      end if
      law(:) = own%law(1, h, sub%gap(c))
      sub%hot(q, row%compliance_n, g) = law(1)
      sub%hot(q, row%shift, g) = law(2)
    end associate
    call stretch_spring(list, kernels, physics, c, sub)
  end subroutine pack_spring

  !> Stretch the tangential spring of contact `c` by what its pair keeps: shifts and compliance along the tangents. Its velocity
  !> and its dashpots are packed.
  subroutine stretch_spring(list, kernels, physics, c, sub)
    type(neighbour_list_t), intent(in) :: list
    type(kernels_t), intent(in) :: kernels
    type(physics_t), intent(in) :: physics
    integer, intent(in) :: c
    type(subproblem_t), intent(inout) :: sub
    real(dp) :: law(2), kept(2)
    integer :: d

    associate (q => lane_of(c), g => block_of(c), row => kernels%row, own => sub%spring(c), h => physics%h)
      kept(:) = kept_elongation(list, sub, c, kernels%nd)
      call own%stretches(kept, h, physics%theta, sub%gap(c))
      do d = 2, kernels%nd
        law(:) = own%law(d, h, own%stretch(d - 1))
        sub%hot(q, row%compliance_t, g) = law(1)
        sub%hot(q, row%shift_t + d - 2, g) = law(2)
        ! a cell that moves adds its own shift to that of the law
        call sub%cell%keep_shift(d, c, law(2))
      end do
    end associate
  end subroutine stretch_spring

  !> The largest deformation of compliant contacts [m], and how stiff they are for the step, h sqrt(k/m), both raised to what they
  !> are in this problem. Collective.
  subroutine measure_springs(problem, deformation, stiffest)
    type(contact_problem_t), intent(in) :: problem
    real(dp), intent(inout) :: deformation, stiffest
    real(dp) :: largest(2)
    integer :: s

    largest(1) = deformation
    largest(2) = stiffest
    do s = 1, size(problem%sub)
      largest(1) = max(largest(1), problem%sub(s)%overlap(yielding=.true.))
      largest(2) = max(largest(2), problem%sub(s)%stiffest)
    end do
    call problem%comm%highest_of(largest)
    deformation = largest(1)
    stiffest = largest(2)
  end subroutine measure_springs

  !> Elongation of the tangential spring of contact `c` in its frame [m]. In space the vector that is kept is brought into the
  !> tangent plane of now, its length unchanged.
  pure function kept_elongation(list, sub, c, nd) result(elongation)
    type(neighbour_list_t), intent(in) :: list
    type(subproblem_t), intent(in) :: sub
    integer, intent(in) :: c, nd
    !> along t and s; 0 along s in the plane
    real(dp) :: elongation(2)
    real(dp) :: t(3), s(3), length

    elongation(:) = 0.0_dp
    associate (kept => list%spring(:, sub%source(c)))
      if (nd == 2) then
        elongation(1) = kept(1)
      else
        length = norm2(kept)
        if (.not. length > 0.0_dp) return
        call contact_tangents(sub%hot, c, t, s)
        elongation(1) = sum(kept*t)
        elongation(2) = sum(kept*s)
        if (norm2(elongation) > 0.0_dp) elongation(:) = elongation*(length/norm2(elongation))
      end if
    end associate
  end function kept_elongation

  !> Elongation that the pair of contact `c` keeps, along the axes of space: the way of the candidate against the antagonist [m].
  pure subroutine find_elongation(list, sub, c, elongation)
    type(neighbour_list_t), intent(in) :: list
    type(subproblem_t), intent(in) :: sub
    integer, intent(in) :: c
    !> (nd)
    real(dp), intent(out) :: elongation(:)

    associate (kept => list%spring(:, sub%source(c)), n => sub%hot(lane_of(c), 1:size(elongation), block_of(c)))
      if (size(elongation) == 2) then
        elongation(1) = -n(2)*kept(1)
        elongation(2) = n(1)*kept(1)
      else
        elongation(:) = kept
      end if
    end associate
  end subroutine find_elongation

  !> Let the pair of contact `c` keep an elongation along the axes of space [m], without its part along a normal, which need not be
  !> that of now: like what is kept from step to step, it turns with the contact.
  pure subroutine put_elongation(list, sub, c, normal, elongation)
    type(neighbour_list_t), intent(inout) :: list
    type(subproblem_t), intent(in) :: sub
    integer, intent(in) :: c
    !> (nd)
    real(dp), intent(in) :: normal(:), elongation(:)

    associate (kept => list%spring(:, sub%source(c)))
      if (size(elongation) == 2) then
        kept(1) = normal(1)*elongation(2) - normal(2)*elongation(1)
      else
        kept(:) = elongation - sum(elongation*normal)*normal
      end if
    end associate
  end subroutine put_elongation

  !> Keep the elongations of the springs of a solved problem with the pairs of the lists, as they are at the q_m of the next step;
  !> v_global is evaluated. A contact that sticks is stretched by what its bodies move, whatever the solve has left between its
  !> velocity and its force: an elongation that fitted the force would move away from the bodies step by step. One that slides has
  !> the elongation that its force has, and one that carries nothing forgets. In space an elongation turns with the bodies about the
  !> normal, half of the way before they stretch it and half after: so it does no work.
  subroutine conclude_springs(problem, h, views)
    type(contact_problem_t), intent(in) :: problem
    !> [s]
    real(dp), intent(in) :: h
    type(local_bodies_t), intent(inout) :: views(:)
    real(dp), allocatable :: v(:, :, :)
    real(dp) :: elongation(2), t(3), s(3)
    logical :: slides
    integer :: k, c, d, nd

    nd = problem%nd
    do k = 1, size(problem%sub)
      associate (sub => problem%sub(k), list => views(k)%list)
        allocate (v, mold=sub%impulse)
        call list%forget_elongations()
        call sub%contact_velocity(problem%kernels, sub%v_global, v)
        if (problem%cell_moves()) call subtract_images(problem, k, v)
        do c = 1, sub%n_contacts
          associate (q => lane_of(c), g => block_of(c), own => sub%spring(c))
            if (.not. (sub%yields(c) .and. sub%impulse(q, 1, g) > 0.0_dp)) cycle
            slides = uses_its_friction(sub, problem%kernels, c)
            elongation(:) = own%stretch(1:2)
            if (nd == 3) call turn_with_bodies(sub, problem%kernels, c, 0.5_dp*h, elongation)
            do d = 2, nd
              elongation(d - 1) = elongation(d - 1) + h*v(q, d, g)
              if (slides) elongation(d - 1) = own%elongation(d, h, sub%impulse(q, d, g), v(q, d, g), slides)
            end do
          end associate
          if (nd == 2) then
            list%spring(1, sub%source(c)) = elongation(1)
          else
            call turn_with_bodies(sub, problem%kernels, c, 0.5_dp*h, elongation)
            call contact_tangents(sub%hot, c, t, s)
            list%spring(:, sub%source(c)) = elongation(1)*t + elongation(2)*s
          end if
        end do
        deallocate (v)
      end associate
    end do
  end subroutine conclude_springs

  !> Turn an elongation about the normal as its bodies do in a time h: by the mean of their spins. If bodies do not turn, it stays.
  pure subroutine turn_with_bodies(sub, kernels, c, h, elongation)
    type(subproblem_t), intent(in) :: sub
    type(kernels_t), intent(in) :: kernels
    integer, intent(in) :: c
    !> negative: back [s]
    real(dp), intent(in) :: h
    !> along t and s [m]
    real(dp), intent(inout) :: elongation(2)
    real(dp) :: angle, along_t

    if (kernels%nv == kernels%nd) return
    associate (n => sub%hot(lane_of(c), 1:3, block_of(c)), i => sub%pair(1, c), j => sub%pair(2, c))
      angle = 0.5_dp*h*sum(n*(sub%v_global(kernels%nd + 1:, i) + sub%v_global(kernels%nd + 1:, j)))
    end associate
    along_t = cos(angle)*elongation(1) - sin(angle)*elongation(2)
    elongation(2) = sin(angle)*elongation(1) + cos(angle)*elongation(2)
    elongation(1) = along_t
  end subroutine turn_with_bodies

  !> Whether a contact that presses uses its friction, and slides.
  pure logical function uses_its_friction(sub, kernels, c)
    type(subproblem_t), intent(in) :: sub
    type(kernels_t), intent(in) :: kernels
    integer, intent(in) :: c

    associate (q => lane_of(c), g => block_of(c))
      uses_its_friction = norm2(sub%impulse(q, 2:kernels%nd, g)) >= (1.0_dp - unused)*sub%hot(q, kernels%row%friction, g)* &
        & sub%impulse(q, 1, g)
    end associate
  end function uses_its_friction

  !> Energies of the springs of a subdomain at the start and at the end of a solved step, along the normal and along the tangents,
  !> once `conclude_springs` was called. The spring of a contact that slides has the elongation that its force has all the time.
  subroutine spring_energies(problem, k, views, physics, energies)
    type(contact_problem_t), intent(in) :: problem
    !> place of the subdomain among those of this rank
    integer, intent(in) :: k
    type(local_bodies_t), intent(in) :: views(:)
    type(physics_t), intent(in) :: physics
    !> (along the normals and along the tangents; at the start and at the end) [J]
    real(dp), intent(out) :: energies(2, 2)
    real(dp) :: v(lanes, problem%nc, size(problem%sub(k)%hot, 3)), elongation(2), before, after
    logical :: slides
    integer :: c, d

    energies(:, :) = 0.0_dp
    associate (sub => problem%sub(k), nd => problem%nd, h => physics%h, theta => physics%theta)
      call sub%contact_velocity(problem%kernels, sub%v_global, v)
      if (problem%cell_moves()) call subtract_images(problem, k, v)
      do c = 1, sub%n_contacts
        if (.not. sub%yields(c)) cycle
        associate (q => lane_of(c), g => block_of(c), own => sub%spring(c))
          before = -(sub%gap(c) - (1.0_dp - theta)*h*own%velocity(1))
          after = -(sub%gap(c) + theta*h*v(q, 1, g))
          elongation(:) = 0.0_dp
          energies(1, 1) = energies(1, 1) + own%spring%energy(before, elongation)
          energies(1, 2) = energies(1, 2) + own%spring%energy(after, elongation)
          elongation(:nd - 1) = own%stretch(:nd - 1) - (1.0_dp - theta)*h*own%velocity(2:nd)
          if (before > 0.0_dp) energies(2, 1) = energies(2, 1) + own%spring%energy(0.0_dp, elongation)
          if (.not. sub%impulse(q, 1, g) > 0.0_dp) cycle
          slides = uses_its_friction(sub, problem%kernels, c)
          elongation(:) = kept_elongation(views(k)%list, sub, c, nd)
          if (nd == 3) call turn_with_bodies(sub, problem%kernels, c, -0.5_dp*h, elongation)
          do d = 2, nd
            if (slides) then
              elongation(d - 1) = own%carried(d, h, sub%impulse(q, d, g), v(q, d, g), slides)
            else
              elongation(d - 1) = elongation(d - 1) - (1.0_dp - theta)*h*v(q, d, g)
            end if
          end do
          energies(2, 2) = energies(2, 2) + own%spring%energy(0.0_dp, elongation)
        end associate
      end do
    end associate
  end subroutine spring_energies

end module gravier_contact_springs
