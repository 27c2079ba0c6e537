!> How a cell that moves and the contacts of a step act on each other (gravier_moving_cell): impulses move the components that
!> stresses drive, and the motion of the cell is a shift of the law of each contact.
module gravier_cell_response
  use gravier_kinds, only: dp
  use gravier_periodic, only: gradient_times
  use gravier_contact_kernels, only: contact_tangents, lanes, lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  implicit none
  private
  public :: start_response, respond, carry_along, image_velocity, subtract_images, virial_of

contains

  !> Make ready for a solve, whose contacts are packed, and let the cell move as the present impulses have it. Collective.
  subroutine start_response(problem)
    type(contact_problem_t), intent(inout) :: problem
    integer :: s

    do s = 1, size(problem%sub)
      call prepare(problem, problem%sub(s))
    end do
    problem%cell%now(:, :) = problem%cell%free
    call respond(problem)
  end subroutine start_response

  !> What the cell adds without contacts, which is all where no stress drives it, and the levers of what stresses drive.
  pure subroutine prepare(problem, sub)
    type(contact_problem_t), intent(in) :: problem
    type(subproblem_t), intent(inout) :: sub
    real(dp) :: frame(problem%nd, problem%nd), added(problem%nd)
    integer :: c, d, k, a, b

    associate (row => problem%row, motion => problem%cell, nf => problem%nf)
      allocate (sub%cell%free(lanes, nf, size(sub%hot, 3)), sub%cell%lever(lanes, nf, count(motion%driven), size(sub%hot, 3)), &
        & source=0.0_dp)
      do c = 1, sub%n_contacts
        call find_axes(sub, c, frame)
        added(:) = motion%added(motion%free, sub%cell%branch(:, c), sub%cell%way(:, c))
        associate (q => lane_of(c), g => block_of(c))
          do d = 1, nf
            sub%cell%free(q, d, g) = sub%cell%shift(d, c) + sum(added*frame(:, d))
            sub%hot(q, merge(row%shift, row%shift_t + d - 2, d == 1), g) = sub%cell%free(q, d, g)
            k = 0
            do b = 1, problem%nd
              do a = 1, b
                if (.not. motion%driven(a, b)) cycle
                k = k + 1
                sub%cell%lever(q, d, k, g) = frame(a, d)*sub%cell%branch(b, c)
              end do
            end do
          end do
        end associate
      end do
    end associate
  end subroutine prepare

  !> Let what stresses drive move as the present impulses have it, and tell the contacts. It is called between iterations, which see
  !> a cell that moves as before. Collective.
  subroutine respond(problem)
    type(contact_problem_t), intent(inout) :: problem
    real(dp) :: parts(count(problem%cell%driven), size(problem%sub)), virial(count(problem%cell%driven))
    real(dp) :: change(count(problem%cell%driven))
    integer :: s, a, b, k

    if (.not. problem%cell%is_driven) return
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        parts(:, s) = virial_of(sub, problem%nf, sub%impulse)
        if (.not. allocated(sub%attraction)) cycle
        do k = 1, size(parts, 1)
          parts(k, s) = parts(k, s) - sum(sub%attraction*sub%cell%lever(:, 1, k, :))
        end do
      end associate
    end do
    call problem%comm%sum_parts(parts, virial)
    k = 0
    do b = 1, problem%nd
      do a = 1, b
        if (.not. problem%cell%driven(a, b)) cycle
        k = k + 1
        change(k) = virial(k)/problem%cell%inertia(a, b)
        problem%cell%now(a, b) = problem%cell%free(a, b) + change(k)
      end do
    end do
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s), row => problem%row)
        call set_shifts(sub, problem%nf, row%shift, row%shift_t, change)
      end associate
    end do
  end subroutine respond

  !> Sums over the contacts of a subdomain of p_a l_b, which are K times the change of the gradient that impulses p make [N m s].
  pure function virial_of(sub, nf, impulse) result(virial)
    type(subproblem_t), intent(in) :: sub
    !> components of an impulse that are a force's
    integer, intent(in) :: nf
    !> (lanes, nc, blocks) [N s]
    real(dp), intent(in), contiguous :: impulse(:, :, :)
    !> of the components that stresses drive
    real(dp) :: virial(size(sub%cell%lever, 3))
    integer :: g, k, d

    virial(:) = 0.0_dp
    do g = 1, size(impulse, 3)
      do k = 1, size(virial)
        do d = 1, nf
          virial(k) = virial(k) + sum(impulse(:, d, g)*sub%cell%lever(:, d, k, g))
        end do
      end do
    end do
  end function virial_of

  !> The shifts of the contacts of a subdomain where contacts have changed the gradients by `change`.
  pure subroutine set_shifts(sub, nf, shift, shift_t, change)
    type(subproblem_t), intent(inout) :: sub
    !> components of a force; rows of the shifts
    integer, intent(in) :: nf, shift, shift_t
    !> (components that stresses drive) [1/s]
    real(dp), intent(in) :: change(:)
    integer :: g, k, d, at

    do g = 1, size(sub%hot, 3)
      do d = 1, nf
        at = merge(shift, shift_t + d - 2, d == 1)
        sub%hot(:, at, g) = sub%cell%free(:, d, g)
        do k = 1, size(change)
          sub%hot(:, at, g) = sub%hot(:, at, g) + change(k)*sub%cell%lever(:, d, k, g)
        end do
      end do
    end do
  end subroutine set_shifts

  !> Carry the grains of a solved problem along with the change of the cell's velocity: v_global is theirs then.
  pure subroutine carry_along(problem)
    type(contact_problem_t), intent(inout) :: problem
    real(dp) :: change(3, 3), carried(problem%nd)
    integer :: s, b, nd

    nd = problem%nd
    change(:, :) = problem%cell%now - problem%cell%before
    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do b = 1, sub%n_grains
          carried(:) = gradient_times(change, sub%cell%place(:, b))
          sub%v_global(1:nd, b) = sub%v_global(1:nd, b) + carried
        end do
      end associate
    end do
  end subroutine carry_along

  !> Velocity of the image that contact `c` meets, besides that of the antagonist, where the cell moves with the gradient `g`: along
  !> n, t and s [m/s].
  pure function image_velocity(sub, nd, c, g) result(velocity)
    type(subproblem_t), intent(in) :: sub
    integer, intent(in) :: nd, c
    real(dp), intent(in) :: g(3, 3)
    real(dp) :: velocity(nd), frame(nd, nd), v(nd)
    integer :: d

    call find_axes(sub, c, frame)
    v(:) = gradient_times(g, sub%cell%way(:, c))
    do d = 1, nd
      velocity(d) = sum(v*frame(:, d))
    end do
  end function image_velocity

  !> Relative velocities of the contacts of a solved subdomain: from those of grains that are carried along, those of the images
  !> that contacts meet are taken.
  pure subroutine subtract_images(problem, s, v)
    type(contact_problem_t), intent(in) :: problem
    !> subdomain of this rank
    integer, intent(in) :: s
    !> H^T V (lanes, nc, blocks) [m/s]
    real(dp), intent(inout), contiguous :: v(:, :, :)
    real(dp) :: image(problem%nd)
    integer :: c

    do c = 1, problem%sub(s)%n_contacts
      image(:) = image_velocity(problem%sub(s), problem%nd, c, problem%cell%now)
      associate (nf => problem%nf, q => lane_of(c), g => block_of(c))
        v(q, 1:nf, g) = v(q, 1:nf, g) - image(1:nf)
      end associate
    end do
  end subroutine subtract_images

  !> The axes n, t and s of contact `c`, a column each.
  pure subroutine find_axes(sub, c, frame)
    type(subproblem_t), intent(in) :: sub
    integer, intent(in) :: c
    real(dp), intent(out) :: frame(:, :)
    real(dp) :: t(3), s(3)
    integer :: nd

    nd = size(frame, 1)
    frame(:, 1) = sub%hot(lane_of(c), 1:nd, block_of(c))
    if (nd == 2) then
      frame(1, 2) = -frame(2, 1)
      frame(2, 2) = frame(1, 1)
    else
      call contact_tangents(sub%hot, c, t, s)
      frame(:, 2) = t
      frame(:, 3) = s
    end if
  end subroutine find_axes

end module gravier_cell_response
