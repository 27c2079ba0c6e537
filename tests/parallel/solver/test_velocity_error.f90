!> The estimate of the velocity error, the ways it rests on, and a pass over layers, on a column of disks, where all of them are
!> known:
!> impulses a share of the exact ones leave every disk with the same velocity.
program test_velocity_error
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_config, only: config_t, parse_config
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_contact_kernels, only: lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  use gravier_kept_impulses, only: kept_impulses_t
  use gravier_test_impulses, only: test_impulses_t
  use gravier_velocity_error, only: velocity_error_t, copies_ready
  use gravier_islands, only: islands_t, find_islands
  use gravier_ways, only: ways_t, list_closed, shorten_ways, unreached
  use gravier_layered_start, only: carry_loads
  use gravier_backoff, only: backoff_words
  use gravier_layer_trial, only: layer_trial_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  character(len=*), parameter :: newline = new_line("a")
  real(dp), parameter :: gravity = 9.81_dp, step = 1.0e-3_dp, mass = 2.0_dp, radius = 0.5_dp
  type(communicator_t), target :: comm

  call start_parallel()
  call comm%init()
  call test_ways(1)
  call test_ways(4)
  call test_gaps(1)
  call test_gaps(4)
  call test_share(1)
  call test_share(4)
  call test_exact()
  call test_self_stress(1)
  call test_self_stress(4)
  call test_attraction(1)
  call test_attraction(4)
  call test_start(is_uneven=.false.)
  call test_start(is_uneven=.true.)
  call test_islands(1)
  call test_islands(4)
  call test_slow(1)
  call test_slow(4)
  call test_restless(1)
  call test_restless(4)
  call test_copies()
  call test_decomposition()
  call test_layers(1)
  call test_layers(4)
  call test_cuts_of_layers()
  call test_pauses()
  call test_passes_kept(1)
  call test_passes_kept(4)
  call test_pass_in_vain()
  call test_pass_given_up()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> A column of disks on the ground in the first step, divided along its height, and groups of the case besides.
  subroutine make(count, n_subdomains, sim, groups)
    integer, intent(in) :: count, n_subdomains
    type(simulation_t), intent(inout) :: sim
    character(len=*), intent(in), optional :: groups
    type(config_t) :: config
    type(error_t), allocatable :: error
    type(step_figures_t) :: figures
    character(len=:), allocatable :: others

    others = ""
    if (present(groups)) others = groups//newline
    call parse_config("column", others//"&scene bodies = 'column', column_count = "//to_text(count)// &
      & ", radius = "//to_text(radius)//", mass = "//to_text(mass)//" / &time step = "//to_text(step)// &
      & ", steps = 1 / &solver method = 'nscdd' /"//newline// &
      & "&decomposition subdomains = "//to_text(n_subdomains)//", grid = 1, "//to_text(n_subdomains)//" /", config, error)
    call check(.not. allocated(error), "configuration")
    call sim%init(comm, config, error)
    call sim%assemble(figures)
    call check(.not. allocated(error), "assembly")
    call sim%method%start(sim%problem, error)
    call check(.not. allocated(error), "start")
  end subroutine make

  !> Place of body `b` from the ground, 0 of the ground itself.
  integer function place(problem, s, b, count)
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: s, b, count
    place = merge(int(problem%sub(s)%id(b)), 0, problem%sub(s)%id(b) <= count)
  end function place

  !> A share of the impulses that carry the weight.
  subroutine set_impulses(problem, count, share)
    type(contact_problem_t), intent(inout) :: problem
    integer, intent(in) :: count
    real(dp), intent(in) :: share
    integer :: s, c, lower

    do s = 1, size(problem%sub)
      associate (sub => problem%sub(s))
        do c = 1, sub%n_contacts
          lower = min(place(problem, s, sub%pair(1, c), count), place(problem, s, sub%pair(2, c), count))
          sub%impulse(lane_of(c), 1, block_of(c)) = share*(count - lower)*mass*gravity*step
        end do
      end associate
    end do
    call problem%evaluate()
  end subroutine set_impulses

  !> Ways counted in contacts, and in lengths of which a diameter is one; nothing leads to what is cut off.
  subroutine test_ways(n_subdomains)
    integer, intent(in) :: n_subdomains
    integer, parameter :: count = 23
    type(simulation_t) :: sim
    type(ways_t), allocatable :: ways(:)
    real(dp) :: expected
    integer :: s, b, kind

    call make(count, n_subdomains, sim)
    do kind = 1, 2
      allocate (ways(size(sim%problem%sub)))
      if (kind == 1) call list_closed(sim%problem, ways)
      if (kind == 2) call list_closed(sim%problem, ways, unit=2*radius)
      do s = 1, size(ways)
        call check(all(ways(s)%length >= unreached), "no way is known before a root is")
        ways(s)%length(sim%problem%sub(s)%n_bodies + 1:) = 0.0_dp
      end do
      call shorten_ways(sim%problem%comm, sim%problem%shared, ways)
      do s = 1, size(ways)
        do b = 1, sim%problem%sub(s)%n_bodies
          expected = place(sim%problem, s, b, count)
          ! the contact with the ground has the length of a radius
          if (kind == 2) expected = expected - 0.5_dp
          call check_close(ways(s)%length(b), expected, 1e-12_dp*count, "way of disk "//to_text(place(sim%problem, s, b, count)))
        end do
      end do
      deallocate (ways)
    end do
    call sim%free()
  end subroutine test_ways

  !> Gaps that close within less than a tenth of the velocity that errors are compared with do not cut a column off its ground; of
  !> others that no impulse crosses, the disks above have no way to it.
  subroutine test_gaps(n_subdomains)
    integer, intent(in) :: n_subdomains
    integer, parameter :: count = 23, cut = 11
    type(simulation_t) :: sim
    type(ways_t), allocatable :: ways(:)
    integer :: s, b, c, k

    call make(count, n_subdomains, sim)
    do k = 1, 2
      allocate (ways(size(sim%problem%sub)))
      do s = 1, size(ways)
        associate (sub => sim%problem%sub(s))
          do c = 1, sub%n_contacts
            if (min(place(sim%problem, s, sub%pair(1, c), count), place(sim%problem, s, sub%pair(2, c), count)) /= cut) cycle
            sub%gap(c) = merge(0.09_dp, 0.11_dp, k == 1)*sim%problem%error_scale*step
            sub%hot(lane_of(c), sim%problem%row%shift, block_of(c)) = sub%gap(c)/step
          end do
        end associate
      end do
      call list_closed(sim%problem, ways)
      do s = 1, size(ways)
        ways(s)%length(sim%problem%sub(s)%n_bodies + 1:) = 0.0_dp
      end do
      call shorten_ways(sim%problem%comm, sim%problem%shared, ways)
      do s = 1, size(ways)
        do b = 1, sim%problem%sub(s)%n_bodies
          call check((ways(s)%length(b) < unreached) .eqv. (k == 1 .or. place(sim%problem, s, b, count) <= cut), &
            & "way of disk "//to_text(place(sim%problem, s, b, count)))
        end do
      end do
      deallocate (ways)
    end do
    call sim%free()
  end subroutine test_gaps

  !> Nine tenths of the exact impulses: everything falls with a tenth of g h. Y and C are that exactly, because the velocities that
  !> the impulses make are uniform; all sink as one, and the estimate is the smaller of E and C.
  subroutine test_share(n_subdomains)
    integer, intent(in) :: n_subdomains
    integer, parameter :: count = 40
    real(dp), parameter :: expected = 0.1_dp*gravity*step
    type(simulation_t) :: sim
    type(velocity_error_t) :: velocity
    real(dp) :: residual, defect, alone, alone_defect
    integer :: s

    call make(count, n_subdomains, sim)
    call velocity%start(sim%problem, 0.1_dp*sim%problem%error_scale)
    call check(sim%problem%rest_is_admissible, "rest is admissible on a ground at rest")
    call check_close(velocity%mass, count*mass, 1e-12_dp*count*mass, "mass")
    call set_impulses(sim%problem, count, 0.9_dp)
    call velocity%assess(sim%problem, sim%method, 0, residual, defect)
    call check_close(velocity%projection, expected, 1e-9_dp*expected, "Y of a uniform velocity")
    call check_close(velocity%bound_by_rest, expected, 1e-9_dp*expected, "C of a uniform velocity")
    ! the disk on the ground violates its law by what it falls with, the others by nothing
    call check_close(velocity%largest_violation, expected, 1e-9_dp*expected, "largest violation")
    call velocity%add_levels(sim%problem, sim%method)
    call check_equal(velocity%levels%most_depth, count, "depth")
    ! the power at the ground over 0.65 of its force is what all sink with
    call check_close(velocity%levels%error, expected/0.65_dp, 1e-9_dp*expected, "L of a uniform velocity")
    call velocity%levels%follow(sim%problem, velocity%largest_violation)
    call check_close(velocity%levels%fastest_body, expected/0.65_dp, 1e-9_dp*expected, "each disk sinks by as much")
    call check_close(velocity%levels%mean_of_bodies, expected/0.65_dp, 1e-9_dp*expected, "mean over disks that sink by as much")
    ! more than the disks move with, which is the velocity itself
    call check_close(velocity%levels%fastest_that_moves, expected, 1e-9_dp*expected, "each disk moves with the smaller of the two")
    call check_close(velocity%estimate(), expected, 1e-9_dp*expected, "estimate")
    ! Y counts 3.2 times and L 4 times where errors are compared with what is allowed
    call check_close(velocity%criterion(), hypot(3.2_dp, 4.0_dp/0.65_dp)*expected, 1e-9_dp*expected, "criterion")
    ! the residual of an assessment is that of the problem
    call sim%problem%residual(alone, alone_defect)
    call check_close(residual, alone, 1e-12_dp*alone, "residual")
    call check_close(defect, alone_defect, 1e-12_dp*alone_defect, "defect")
    ! with earlier impulses, which tell something else, Y is as large: the impulses alone see all of a uniform velocity
    do s = 1, size(sim%problem%sub)
      associate (impulse => sim%problem%sub(s)%impulse)
        sim%method%acceleration%part(s)%impulse = impulse*(1.0_dp + 0.5_dp*sin(impulse/(mass*gravity*step)))
      end associate
    end do
    call velocity%assess(sim%problem, sim%method, 1, residual, defect)
    call check_close(velocity%projection, expected, 1e-9_dp*expected, "Y with earlier impulses")
    ! C of bodies at rest whose impulses work on shifts
    sim%problem%kinetic = 0.0_dp
    sim%problem%shift_power = 0.5_dp*count*mass*expected**2
    call velocity%bound(sim%problem)
    call check_close(velocity%bound_by_rest, expected, 1e-9_dp*expected, "C of shifts")
    call sim%free()
  end subroutine test_share

  !> A column in two parts, of which one has nine tenths of the impulses that carry it, and the other falls as it should. The mean
  !> over both hides a part of the error of the one, which its island has by itself.
  subroutine test_islands(n_subdomains)
    integer, intent(in) :: n_subdomains
    integer, parameter :: count = 23, cut = 11
    real(dp), parameter :: expected = 0.1_dp*gravity*step
    type(simulation_t) :: sim
    type(velocity_error_t) :: velocity
    type(islands_t) :: islands
    real(dp) :: residual, defect, error
    integer :: s, c, b, lower, first

    call make(count, n_subdomains, sim)
    call velocity%start(sim%problem, 0.1_dp*sim%problem%error_scale)
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s))
        do c = 1, sub%n_contacts
          lower = min(place(sim%problem, s, sub%pair(1, c), count), place(sim%problem, s, sub%pair(2, c), count))
          ! on the disks above, so small impulses that they are nothing but what joins them
          sub%impulse(lane_of(c), 1, block_of(c)) = merge(0.9_dp*(cut - lower), 1.0e-20_dp, lower < cut)*mass*gravity*step
          if (lower /= cut) cycle
          ! the contact of both parts is open
          sub%impulse(lane_of(c), 1, block_of(c)) = 0.0_dp
          sub%gap(c) = 2.0_dp*gravity*step**2
          sub%hot(lane_of(c), sim%problem%row%shift, block_of(c)) = sub%gap(c)/step
        end do
      end associate
    end do
    call sim%problem%evaluate()
    call find_islands(sim%problem, 11.5_dp*mass, islands)
    do s = 1, size(sim%problem%sub)
      ! the island of the first body of a subdomain is 1, and so are those of the others on its side of the cut
      first = place(sim%problem, s, 1, count)
      call check_close(islands%part(s)%mass(1), merge(count - cut, cut, first > cut)*mass, 1e-12_dp*mass, "mass of an island")
      call check(islands%part(s)%is_small(1) .eqv. first <= cut, "the lower part is the small one")
      do b = 1, sim%problem%sub(s)%n_bodies
        call check((islands%part(s)%of_body(b) == 1) .eqv. ((place(sim%problem, s, b, count) > cut) .eqv. (first > cut)), &
          & "island of disk "//to_text(place(sim%problem, s, b, count)))
      end do
    end do
    call velocity%assess(sim%problem, sim%method, 0, residual, defect)
    call check_close(velocity%projection, sqrt(real(cut, dp)/count)*expected, 1e-9_dp*expected, "Y of both parts")
    error = velocity%tests%project_islands(sim%problem, sim%method, 0, velocity%mass)
    call check_close(error, expected, 1e-9_dp*expected, "Y of the lower part")
    error = velocity%tests%project_islands(sim%problem, sim%method, 0, 1.9_dp*cut*mass)
    call check_close(error, 0.0_dp, 1e-9_dp*expected, "no Y of parts with more than half of a mass")
    call sim%free()
  end subroutine test_islands

  !> Impulses that are wrong from contact to contact: all parts of the estimate are the same in one subdomain and in several.
  subroutine test_decomposition()
    real(dp) :: one(6), four(6)
    integer :: k

    call assess_wrong(1, one)
    call assess_wrong(4, four)
    do k = 1, size(one)
      call check_close(four(k), one(k), 1e-10_dp*one(k), "part "//to_text(k)//" of the estimate in four subdomains")
    end do
  end subroutine test_decomposition

  !> Y, L, the largest violation, the residual, how fast the fastest body sinks and how fast bodies do in the mean.
  subroutine assess_wrong(n_subdomains, found)
    integer, intent(in) :: n_subdomains
    real(dp), intent(out) :: found(6)
    integer, parameter :: count = 40
    type(simulation_t) :: sim
    type(velocity_error_t) :: velocity
    real(dp) :: defect
    integer :: s, g, q

    call make(count, n_subdomains, sim)
    call velocity%start(sim%problem, 0.1_dp*sim%problem%error_scale)
    call set_impulses(sim%problem, count, 0.9_dp)
    do s = 1, size(sim%problem%sub)
      associate (impulse => sim%problem%sub(s)%impulse)
        do g = 1, size(impulse, 3)
          do q = 1, size(impulse, 1)
            ! larger and smaller in turn, by the size of the impulse itself
            impulse(q, 1, g) = impulse(q, 1, g)*(1.0_dp + 0.3_dp*sin(impulse(q, 1, g)/(mass*gravity*step)))
          end do
        end do
      end associate
    end do
    call sim%problem%evaluate()
    call velocity%assess(sim%problem, sim%method, 0, found(4), defect)
    call velocity%add_levels(sim%problem, sim%method)
    found(1) = velocity%projection
    found(2) = velocity%levels%error
    found(3) = velocity%largest_violation
    call velocity%levels%follow(sim%problem, velocity%largest_violation)
    found(5) = velocity%levels%fastest_body
    found(6) = velocity%levels%mean_of_bodies
    call sim%free()
  end subroutine assess_wrong

  !> The exact impulses: nothing is left.
  subroutine test_exact()
    integer, parameter :: count = 40
    type(simulation_t) :: sim
    type(velocity_error_t) :: velocity
    real(dp) :: residual, defect

    call make(count, 4, sim)
    call velocity%start(sim%problem, 0.1_dp*sim%problem%error_scale)
    call set_impulses(sim%problem, count, 1.0_dp)
    call velocity%assess(sim%problem, sim%method, 0, residual, defect)
    call velocity%add_levels(sim%problem, sim%method)
    call check(velocity%estimate() <= 1e-9_dp*gravity*step, "estimate of the exact impulses: "//to_text(velocity%estimate(), 3))
    call check(velocity%criterion() <= 1e-6_dp*gravity*step, "criterion of the exact impulses")
    call sim%free()
  end subroutine test_exact

  !> Nine tenths of the exact impulses in contacts that attract each other with up to a hundred times the weight of a disk. Test
  !> impulses are those on the bodies, so that the estimate is that without attractions. Before waves have gone down the column and
  !> up it is C.
  subroutine test_attraction(n_subdomains)
    integer, intent(in) :: n_subdomains
    integer, parameter :: count = 40
    real(dp), parameter :: expected = 0.1_dp*gravity*step
    type(simulation_t) :: sim
    type(velocity_error_t) :: velocity
    real(dp) :: residual, defect
    integer :: s

    call make(count, n_subdomains, sim)
    call set_impulses(sim%problem, count, 0.9_dp)
    sim%problem%attracts = .true.
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s))
        ! larger and smaller from contact to contact
        sub%attraction = 50.0_dp*mass*gravity*step*(1.0_dp + sin(sub%impulse(:, 1, :)/(mass*gravity*step)))
        where (sub%impulse(:, 1, :) <= 0.0_dp) sub%attraction = 0.0_dp
      end associate
    end do
    call sim%problem%load_attraction()
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s))
        sub%impulse(:, 1, :) = sub%impulse(:, 1, :) + sub%attraction
      end associate
    end do
    call sim%problem%evaluate()
    call velocity%start(sim%problem, 0.1_dp*sim%problem%error_scale)
    call velocity%assess(sim%problem, sim%method, 0, residual, defect)
    call check_close(velocity%projection, expected, 1e-9_dp*expected, "Y where contacts attract")
    ! a small Y and no levels: E is below C
    velocity%projection = 0.1_dp*expected
    call velocity%add_levels(sim%problem, sim%method)
    velocity%levels%error = 0.0_dp
    velocity%levels%fastest = 0.0_dp
    call check_close(velocity%estimate(), expected, 1e-9_dp*expected, "the estimate is C before waves have come back")
    call check_close(velocity%criterion(), expected, 1e-9_dp*expected, "and what ends a solve is no less")
    call velocity%assess(sim%problem, sim%method, 2*count, residual, defect)
    velocity%projection = 0.1_dp*expected
    call velocity%add_levels(sim%problem, sim%method)
    velocity%levels%error = 0.0_dp
    call check_close(velocity%estimate(), 0.32_dp*expected, 1e-9_dp*expected, "and E afterwards")
    call sim%free()
  end subroutine test_attraction

  !> A column below a fixed lid: the last change is a stress that moves nearly nothing, but its power is not small. The projection
  !> on it would be a hundred times the velocity of all disks, which is the error; C bounds it.
  subroutine test_self_stress(n_subdomains)
    integer, intent(in) :: n_subdomains
    integer, parameter :: count = 10
    real(dp), parameter :: expected = 0.1_dp*gravity*step, stress = mass*gravity*step
    type(simulation_t) :: sim
    type(velocity_error_t) :: velocity
    real(dp) :: residual, defect
    integer :: s, c, a, b

    call make(count, n_subdomains, sim, "&boundary shape = 'plane', point = 0, "//to_text(2*count*radius)//", normal = 0, -1 /")
    call check(sim%method%acceleration%on, "sweeps are accelerated")
    call set_impulses(sim%problem, count, 0.9_dp)
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s), previous => sim%method%acceleration%part(s)%impulse)
        do c = 1, sub%n_contacts
          a = place(sim%problem, s, sub%pair(1, c), count)
          b = place(sim%problem, s, sub%pair(2, c), count)
          ! the lid carries nothing
          if (max(a, b) == count .and. min(a, b) == 0) sub%impulse(lane_of(c), 1, block_of(c)) = 0.0_dp
          previous(lane_of(c), 1, block_of(c)) = sub%impulse(lane_of(c), 1, block_of(c)) - stress
          if (min(a, b) == 1) previous(lane_of(c), 1, block_of(c)) = previous(lane_of(c), 1, block_of(c)) - 1.0e-3_dp*stress
        end do
      end associate
    end do
    call sim%problem%evaluate()
    call velocity%start(sim%problem, 0.1_dp*sim%problem%error_scale)
    call velocity%assess(sim%problem, sim%method, 1, residual, defect)
    call check_close(velocity%bound_by_rest, expected, 1e-9_dp*expected, "C below a lid")
    call check_close(velocity%projection, expected, 1e-9_dp*expected, "Y is at most C")
    call sim%free()
  end subroutine test_self_stress

  !> Starts are compared by the estimate, and by the criterion where few heavy bodies have most of the mass.
  subroutine test_start(is_uneven)
    logical, intent(in) :: is_uneven
    integer, parameter :: count = 40
    type(simulation_t) :: sim
    type(velocity_error_t) :: velocity
    real(dp) :: residual, defect
    integer :: s

    call make(count, 1, sim)
    do s = 1, size(sim%problem%sub)
      if (is_uneven) sim%problem%sub(s)%inverse_mass(:, 1) = 1.0e-3_dp*sim%problem%sub(s)%inverse_mass(:, 1)
    end do
    call velocity%start(sim%problem, 0.1_dp*sim%problem%error_scale)
    call set_impulses(sim%problem, count, 0.9_dp)
    call velocity%assess(sim%problem, sim%method, 0, residual, defect)
    call velocity%add_levels(sim%problem, sim%method)
    call check(velocity%criterion() > 1.5_dp*velocity%estimate(), "the criterion is more than the estimate")
    call check_close(velocity%measure_of_start(), merge(velocity%criterion(), velocity%estimate(), is_uneven), 0.0_dp, &
      & "what a start is judged by")
    call sim%free()
  end subroutine test_start

  !> One disk of many that moves: C ends a solve only where the fastest is below half of the error allowed.
  subroutine test_slow(n_subdomains)
    integer, intent(in) :: n_subdomains
    type(simulation_t) :: sim
    type(velocity_error_t) :: velocity
    integer :: s, b, k

    call make(40, n_subdomains, sim)
    call velocity%start(sim%problem, 0.1_dp*sim%problem%error_scale)
    do k = 1, 2
      do s = 1, size(sim%problem%sub)
        associate (sub => sim%problem%sub(s))
          sub%v_global(:, :) = 0.0_dp
          do b = 1, sub%n_grains
            if (int(sub%id(b)) == 17) sub%v_global(2, b) = -merge(0.049_dp, 0.051_dp, k == 1)*sim%problem%error_scale
          end do
        end associate
      end do
      call check(velocity%all_are_slow(sim%problem) .eqv. k == 1, "one disk of many, case "//to_text(k))
    end do
    call sim%free()
  end subroutine test_slow

  !> All sink by a thousandth of g h, and how fast each body does is not asked for. Where one moves sideways by more than a fiftieth
  !> of g h among those nearly at rest, it is.
  subroutine test_restless(n_subdomains)
    integer, intent(in) :: n_subdomains
    integer, parameter :: count = 40
    real(dp), parameter :: sinks = 1.0e-3_dp*gravity*step/0.65_dp
    type(simulation_t) :: sim
    type(velocity_error_t) :: velocity
    real(dp) :: residual, defect
    integer :: s, b, k

    call make(count, n_subdomains, sim)
    call velocity%start(sim%problem, 0.1_dp*sim%problem%error_scale)
    do k = 1, 2
      call set_impulses(sim%problem, count, 0.999_dp)
      do s = 1, size(sim%problem%sub)
        associate (sub => sim%problem%sub(s))
          do b = 1, sub%n_grains
            if (int(sub%id(b)) == 17) sub%v_global(1, b) = merge(0.019_dp, 0.021_dp, k == 1)*sim%problem%error_scale
          end do
        end associate
      end do
      call velocity%assess(sim%problem, sim%method, 100, residual, defect)
      call velocity%add_levels(sim%problem, sim%method)
      call check_close(velocity%levels%fastest_body, merge(count, 1, k == 1)*sinks, 1e-6_dp*sinks, &
        & "how fast bodies sink, case "//to_text(k))
    end do
    call sim%free()
  end subroutine test_restless

  !> Earlier impulses: those that accelerated sweeps keep, or a copy from an iteration before.
  subroutine test_copies()
    type(simulation_t) :: sim
    type(test_impulses_t) :: tests
    type(kept_impulses_t), allocatable :: earlier(:)
    logical :: are_known
    integer :: s

    call make(5, 4, sim)
    allocate (earlier(size(sim%problem%sub)))
    call tests%start(sim%problem)
    call set_impulses(sim%problem, 5, 0.5_dp)
    call tests%take_earlier(sim%problem, sim%method, 0, earlier, are_known)
    call check(.not. are_known, "nothing is known before the first iteration")
    call tests%take_earlier(sim%problem, sim%method, 1, earlier, are_known)
    call check(are_known, "accelerated sweeps keep the impulses of the iteration before")
    do s = 1, size(earlier)
      call check(all(abs(earlier(s)%value - sim%method%acceleration%part(s)%impulse) <= 0.0_dp), "which are those")
    end do
    sim%method%acceleration%on = .false.
    call tests%take_earlier(sim%problem, sim%method, 1, earlier, are_known)
    call check(.not. are_known, "plain sweeps keep none")
    call tests%keep_copy(sim%problem, sim%method, 1)
    call tests%keep_copy(sim%problem, sim%method, 2)
    call set_impulses(sim%problem, 5, 1.0_dp)
    call tests%take_earlier(sim%problem, sim%method, 2, earlier, are_known)
    call check(.not. are_known, "a copy of the same iteration is no earlier one")
    call tests%take_earlier(sim%problem, sim%method, 3, earlier, are_known)
    call check(are_known, "a copy of the iteration before is one")
    do s = 1, size(earlier)
      call check(all(abs(2.0_dp*earlier(s)%value - sim%problem%sub(s)%impulse) <= 1e-12_dp), "and has the impulses of then")
    end do
    call tests%begin_anew(3)
    call tests%take_earlier(sim%problem, sim%method, 4, earlier, are_known)
    call check(.not. are_known, "what begins anew has no earlier impulses")
    call sim%free()
  end subroutine test_copies

  !> A pass over layers leaves a column of 100 with less than a tenth of g h; a column of 20 is not deep enough for one.
  subroutine test_layers(n_subdomains)
    integer, intent(in) :: n_subdomains
    integer, parameter :: count = 100
    type(simulation_t) :: sim
    type(velocity_error_t) :: velocity
    real(dp) :: residual, defect, sweeps
    logical :: carried

    call make(count, n_subdomains, sim)
    call velocity%start(sim%problem, 0.1_dp*sim%problem%error_scale)
    call carry_loads(sim%problem, 25.0_dp, sim%method%work, sweeps, carried)
    call check(sweeps >= 20.0_dp .and. sweeps <= 1.5_dp*200.0_dp, "sweeps of a pass: "//to_text(sweeps, 3))
    call check(carried, "all layers are held by what lies below")
    call sim%problem%evaluate()
    call velocity%assess(sim%problem, sim%method, 0, residual, defect)
    call check(velocity%bound_by_rest <= 0.1_dp*gravity*step, "velocities after a pass: "//to_text(velocity%bound_by_rest, 3))
    call sim%free()
    call make(count/5, n_subdomains, sim)
    call carry_loads(sim%problem, 25.0_dp, sim%method%work, sweeps, carried)
    call check_close(sweeps, 0.0_dp, 0.0_dp, "no pass on what is not deep")
    call sim%free()
  end subroutine test_layers

  !> A cut through the first disk of a layer: in one of its subdomains that disk has a contact of the layer above alone. It moves in
  !> both all the same, and no load is lost.
  subroutine test_cuts_of_layers()
    type(simulation_t) :: sim
    real(dp) :: sweeps, fastest
    logical :: carried
    integer :: count, s

    ! the cut passes through another place of a layer with each number
    do count = 100, 110, 2
      call make(count, 2, sim)
      call carry_loads(sim%problem, 25.0_dp, sim%method%work, sweeps, carried)
      call sim%problem%evaluate()
      fastest = 0.0_dp
      do s = 1, size(sim%problem%sub)
        associate (sub => sim%problem%sub(s))
          fastest = max(fastest, maxval(abs(sub%v_global(2, 1:sub%n_grains))))
        end associate
      end do
      call check(carried .and. fastest <= 0.5_dp*gravity*step, "fastest disk of a column of "//to_text(count)//" over g h: "// &
        & to_text(fastest/(gravity*step), 3))
      call sim%free()
    end do
  end subroutine test_cuts_of_layers

  !> A step makes no pass while the stepper pauses. One from which the solve goes on ends the row of those that were given up.
  subroutine test_pauses()
    integer, parameter :: count = 100
    type(simulation_t) :: sim
    type(step_figures_t) :: figures
    type(error_t), allocatable :: error
    integer(i8) :: words(backoff_words)

    call make(count, 1, sim)
    words(1) = 3
    words(2) = 1
    call sim%pass_backoff%set_state(words)
    call sim%advance(figures, error)
    call check(.not. allocated(error) .and. figures%solve%layered_sweeps <= 0.0_dp, "no pass before step 1")
    call sim%free()
    call make(count, 1, sim)
    words(2) = 0
    call sim%pass_backoff%set_state(words)
    call sim%advance(figures, error)
    call check(.not. allocated(error) .and. figures%solve%layered, "a solve goes on from its pass")
    call sim%pass_backoff%get_state(words)
    call check(words(1) == 0, "none was given up since")
    call sim%free()
    call make(count, 1, sim)
    call sim%pass_backoff%get_state(words)
    call check(words(1) == 0 .and. words(2) == 0, "a new scene knows of no passes")
    call sim%free()
  end subroutine test_pauses

  !> Iterations, a check after the last of them, and what a trial of passes over layers makes of it.
  subroutine go_on(first, last, sim, velocity, trial, anew)
    integer, intent(in) :: first, last
    type(simulation_t), intent(inout) :: sim
    type(velocity_error_t), intent(inout) :: velocity
    type(layer_trial_t), intent(inout) :: trial
    logical, intent(out) :: anew
    type(error_t), allocatable :: error
    real(dp) :: jump, residual, defect
    integer :: k

    do k = first, last
      call check(trial%calls(k) .eqv. k == last, "a trial calls for a check after the last iteration")
      call sim%method%iterate(sim%problem, k == last, jump, error)
    end do
    call sim%problem%evaluate()
    call velocity%assess(sim%problem, sim%method, last, residual, defect)
    call trial%advance(sim%problem, sim%method, velocity, last, anew, error)
    call check(.not. allocated(error), "a trial of a pass")
  end subroutine go_on

  !> A trial of passes in a cold solve of a column of 100, of which the velocity error may be a millionth of its scale; a heavy disk
  !> lies on top on request.
  subroutine begin_trial(n_subdomains, heavy, sim, velocity, trial)
    integer, intent(in) :: n_subdomains
    logical, intent(in) :: heavy
    type(simulation_t), intent(inout) :: sim
    type(velocity_error_t), intent(inout) :: velocity
    type(layer_trial_t), intent(inout) :: trial
    integer, parameter :: count = 100
    integer :: s, b

    call make(count, n_subdomains, sim)
    do s = 1, size(sim%problem%sub)
      associate (sub => sim%problem%sub(s))
        do b = 1, sub%n_grains
          if (heavy .and. place(sim%problem, s, b, count) == count) sub%inverse_mass(:, b) = 1.0e-3_dp*sub%inverse_mass(:, b)
        end do
      end associate
    end do
    call velocity%start(sim%problem, 1.0e-6_dp*sim%problem%error_scale)
    call trial%start(sim%problem, 1.0_dp, 1.0e-6_dp)
  end subroutine begin_trial

  !> Relaxations of a method so far, over all ranks, as sweeps over all contacts.
  real(dp) function sweeps_of(sim) result(sweeps)
    type(simulation_t), intent(in) :: sim
    integer(i8) :: relaxations(1)

    relaxations(1) = sim%method%work%relaxations
    call comm%sum_counts(relaxations)
    sweeps = real(relaxations(1), dp)/real(sim%problem%n_contacts, dp)
  end function sweeps_of

  !> A first pass over a deep column lowers the error and is kept, and a second one then lowers what it has left. Sweeps count those
  !> of both, and all is one solve.
  subroutine test_passes_kept(n_subdomains)
    integer, intent(in) :: n_subdomains
    type(simulation_t) :: sim
    type(velocity_error_t) :: velocity
    type(layer_trial_t) :: trial
    integer(i8) :: solves
    real(dp) :: first, before
    logical :: anew

    call begin_trial(n_subdomains, .false., sim, velocity, trial)
    solves = sim%method%work%solves
    call go_on(1, copies_ready, sim, velocity, trial, anew)
    call check(anew .and. trial%layered .and. trial%sweeps > 0.0_dp, "a pass is tried")
    first = trial%sweeps
    ! sweeps of the pass, and those of two iterations
    call check_close(sweeps_of(sim), first + copies_ready, 1.0e-9_dp*first, "relaxations of one pass")
    call go_on(copies_ready + 1, copies_ready + 6, sim, velocity, trial, anew)
    before = sweeps_of(sim)
    call check(anew .and. trial%layered .and. trial%sweeps > first, "it is kept, and another one is tried")
    call check_close(before, trial%sweeps + copies_ready + 6, 1.0e-9_dp*before, "relaxations of both passes")
    call check_equal(sim%method%work%solves, solves, "one solve")
    call sim%free()
  end subroutine test_passes_kept

  !> A pass that has brought nothing is undone, and none is tried after it: the impulses are those of another solve that has made
  !> the iterations before the pass.
  subroutine test_pass_in_vain()
    type(simulation_t) :: sim, other
    type(velocity_error_t) :: velocity, ignored
    type(layer_trial_t) :: trial, none
    type(error_t), allocatable :: error
    real(dp) :: sweeps, jump
    logical :: anew
    integer :: s, k

    call begin_trial(4, .false., sim, velocity, trial)
    call begin_trial(4, .false., other, ignored, none)
    do k = 1, copies_ready
      call other%method%iterate(other%problem, k == copies_ready, jump, error)
    end do
    call go_on(1, copies_ready, sim, velocity, trial, anew)
    call check(anew .and. trial%layered, "a pass is tried")
    sweeps = trial%sweeps
    ! as if it had left nothing
    do s = 1, size(sim%problem%sub)
      sim%problem%sub(s)%impulse(:, :, :) = 0.0_dp
    end do
    call sim%method%start(sim%problem, error)
    call check(.not. allocated(error), "a start from nothing")
    call go_on(copies_ready + 1, copies_ready + 6, sim, velocity, trial, anew)
    call check(anew .and. .not. trial%layered, "a pass that has brought nothing is not kept")
    call check_close(trial%sweeps, sweeps, 0.0_dp, "but its sweeps were made")
    do s = 1, size(sim%problem%sub)
      call check(all(abs(sim%problem%sub(s)%impulse - other%problem%sub(s)%impulse) <= 0.0_dp), "impulses before the pass")
    end do
    call other%free()
    call sim%free()
  end subroutine test_pass_in_vain

  !> Under a heavy disk layers converge slowly: the pass is given up, the solve goes on from the impulses before it, and none is
  !> tried later on.
  subroutine test_pass_given_up()
    type(simulation_t) :: sim
    type(velocity_error_t) :: velocity
    type(layer_trial_t) :: trial
    type(kept_impulses_t), allocatable :: before(:)
    type(error_t), allocatable :: error
    real(dp) :: jump, residual, defect, sweeps
    logical :: anew
    integer :: s, k

    call begin_trial(4, .true., sim, velocity, trial)
    allocate (before(size(sim%problem%sub)))
    do k = 1, 40
      call sim%method%iterate(sim%problem, .true., jump, error)
      if (k /= copies_ready .and. k < 40) cycle
      call sim%problem%evaluate()
      call velocity%assess(sim%problem, sim%method, k, residual, defect)
      do s = 1, size(before)
        before(s)%value = sim%problem%sub(s)%impulse
      end do
      call trial%advance(sim%problem, sim%method, velocity, k, anew, error)
      call check(.not. (allocated(error) .or. trial%layered), "a solve without a pass")
      do s = 1, size(before)
        call check(all(abs(sim%problem%sub(s)%impulse - before(s)%value) <= 0.0_dp), "goes on from the impulses before it")
      end do
      call check(anew .eqv. k == copies_ready, "a pass is tried once")
      if (k == copies_ready) sweeps = trial%sweeps
    end do
    call check(sweeps > 0.0_dp, "sweeps of a pass that was given up")
    call check_close(trial%sweeps, sweeps, 0.0_dp, "there are no others")
    call sim%free()
  end subroutine test_pass_given_up

end program test_velocity_error
