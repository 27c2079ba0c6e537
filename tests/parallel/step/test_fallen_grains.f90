!> Grains that have fallen below all boundaries, in several subdomains: which count, when they are looked at, and by how many they
!> have become more.
program test_fallen_grains
  use gravier_kinds, only: dp, i8
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_fallen_grains, only: fallen_grains_t
  use gravier_simulation, only: simulation_t
  use gravier_test_simulations, only: make_scene
  use gravier_check, only: check, check_equal, finish_checks
  implicit none

  integer, parameter :: n = 12
  !> [m]
  real(dp), parameter :: radius = 0.1_dp
  character(len=*), parameter :: row = "&scene bodies = 'lattice', lattice_count = 12, 1, radius_min = 0.1, radius_max = 0.1 / "// &
    & "&boundary name = 'ledge', shape = 'segment', point = -1.0, 0.0, end = 1.0, 0.0 / &time step = 0.5, steps = 4 / "// &
    & "&decomposition subdomains = 3 / &solver method = 'schwarz' / "
  type(communicator_t), target :: comm
  type(simulation_t) :: sim
  type(fallen_grains_t) :: fallen
  !> the ledge is the last boundary
  integer :: last

  call start_parallel()
  call comm%init()
  call make_scene(comm, row, sim)
  last = size(sim%decomposition%boundaries)
  call check(last > 1, "the lattice has walls of its own")
  call place_grains(every=2)
  call fallen%look(sim%decomposition, sim%physics, .false.)
  call check_equal(fallen%number, 0_i8, "above a plane that faces up")
  sim%decomposition%boundaries(1:last - 1)%present = .false.
  call fallen%look(sim%decomposition, sim%physics, .false.)
  call check_equal(fallen%number, int(n/2, i8), "below the ledge, and going down")
  call check_equal(fallen%first, 2_i8, "lowest identifier")
  call fallen%look(sim%decomposition, sim%physics, .true.)
  call check_equal(fallen%number, 0_i8, "where gravity changes, they may come back")
  call fallen%note_step(150, sim%decomposition, sim%physics, .false.)
  call check_equal(fallen%more, 0_i8, "not looked at")
  call fallen%note_step(200, sim%decomposition, sim%physics, .false.)
  call check_equal(fallen%more, int(n/2, i8), "more than ever before")
  call place_grains(every=1)
  call fallen%note_step(300, sim%decomposition, sim%physics, .false.)
  ! the first one is as high as the ledge with its uppermost point
  call check_equal(fallen%more, int(n/2 - 1, i8), "more than before")
  call fallen%note_step(400, sim%decomposition, sim%physics, .false.)
  call check_equal(fallen%more, 0_i8, "no more than before")
  sim%decomposition%boundaries(last)%present = .false.
  call fallen%look(sim%decomposition, sim%physics, .false.)
  call check_equal(fallen%number, 0_i8, "without a boundary")
  call finish_checks()
  call sim%free()
  call comm%free()
  call stop_parallel()

contains

  !> Grain k is k radii below the ledge, and one in `every` goes down.
  subroutine place_grains(every)
    integer, intent(in) :: every
    integer :: s, k

    do s = 1, size(sim%decomposition%owned)
      associate (bodies => sim%decomposition%owned(s))
        do k = 1, bodies%n
          bodies%position(2, k) = -radius*real(bodies%id(k), dp)
          bodies%velocity(:, k) = 0.0_dp
          bodies%velocity(2, k) = merge(-1.0_dp, 1.0_dp, mod(bodies%id(k), int(every, i8)) == 0)
        end do
      end associate
    end do
  end subroutine place_grains

end program test_fallen_grains
