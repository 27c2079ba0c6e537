!> Walls without a thickness between bodies: segments and rectangles that lie between two points, and those that do not.
program test_screens
  use gravier_kinds, only: dp
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_flat_piece, only: segment_t, rectangle_t
  use gravier_plane, only: plane_t
  use gravier_screens, only: screens_t
  use gravier_simulation, only: simulation_t
  use gravier_test_simulations, only: make_scene
  use gravier_check, only: check, finish_checks
  implicit none
  type(communicator_t), target :: comm

  call start_parallel()
  call comm%init()
  call test_pieces()
  call test_scene()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  subroutine test_pieces()
    type(segment_t) :: segment
    type(rectangle_t) :: rectangle
    type(plane_t) :: plane

    segment%edge(:, 1) = [0.0_dp, 2.0_dp, 0.0_dp]
    call check(segment%parts([-1.0_dp, 1.0_dp, 0.0_dp], [1.0_dp, 1.0_dp, 0.0_dp]), "across a segment")
    call check(segment%parts([1.0_dp, 1.9_dp, 0.0_dp], [-1.0_dp, 1.9_dp, 0.0_dp]), "the other way")
    call check(segment%parts([-1.0_dp, 0.5_dp, 0.0_dp], [1.0_dp, 3.4_dp, 0.0_dp]), "across it, though one point is beyond its end")
    call check(.not. segment%parts([-1.0_dp, 2.0_dp, 0.0_dp], [1.0_dp, 2.1_dp, 0.0_dp]), "beyond its end")
    call check(.not. segment%parts([-1.0_dp, -0.1_dp, 0.0_dp], [1.0_dp, -0.1_dp, 0.0_dp]), "before its beginning")
    call check(.not. segment%parts([1.0_dp, 1.0_dp, 0.0_dp], [2.0_dp, 1.0_dp, 0.0_dp]), "on one side")
    call check(.not. segment%parts([0.0_dp, 1.0_dp, 0.0_dp], [2.0_dp, 1.0_dp, 0.0_dp]), "from the segment itself")
    rectangle%edge(:, 1) = [2.0_dp, 0.0_dp, 0.0_dp]
    rectangle%edge(:, 2) = [0.0_dp, 3.0_dp, 0.0_dp]
    call check(rectangle%parts([1.0_dp, 2.9_dp, -1.0_dp], [1.0_dp, 2.9_dp, 1.0_dp]), "across a rectangle")
    call check(.not. rectangle%parts([1.0_dp, 3.1_dp, -1.0_dp], [1.0_dp, 3.1_dp, 1.0_dp]), "beyond its second edge")
    call check(.not. rectangle%parts([2.1_dp, 1.0_dp, -1.0_dp], [2.1_dp, 1.0_dp, 1.0_dp]), "beyond its first edge")
    call check(.not. rectangle%parts([1.0_dp, 1.0_dp, 2.0_dp], [1.0_dp, 1.0_dp, 1.0_dp]), "above it")
    call check(.not. plane%parts([1.0_dp, 1.0_dp, -2.0_dp], [1.0_dp, 1.0_dp, 1.0_dp]), "a plane has no other side")
  end subroutine test_pieces

  !> Two grains, between which a segment lies, across the end of a period: one that is there, and one that is not yet.
  subroutine test_scene()
    character(len=*), parameter :: start = "&scene dimension = 2, bodies = 'lattice', lattice_count = 2, 1, radius_min = 0.5, "// &
      & "radius_max = 0.5, gravity = 0, 0, period = 4.2, 0 / &time step = 0.01, steps = 1 / "
    type(simulation_t) :: simulation
    type(screens_t) :: screens
    real(dp) :: branch(2)

    branch(1) = -1.0_dp
    branch(2) = 0.0_dp
    call make_scene(comm, start, simulation)
    call screens%find(simulation%decomposition%boundaries)
    call check(.not. screens%exist, "no wall")
    call simulation%free()
    call make_scene(comm, start//"&boundary shape = 'segment', point = 4.2, -3, end = 4.2, 3 /", simulation)
    associate (owned => simulation%decomposition%owned(1))
      owned%position(1, 1) = -0.5_dp
      owned%position(2, 1) = 1.0_dp
      call screens%find(simulation%decomposition%boundaries)
      call check(screens%exist, "a wall")
      call check(screens%part(simulation%decomposition, owned, 1, 2, owned%position(:, 1), branch), "between them, a period away")
      branch(1) = 1.0_dp
      call check(.not. screens%part(simulation%decomposition, owned, 1, 2, owned%position(:, 1), branch), "not on the other side")
    end associate
    simulation%decomposition%boundaries(:)%present = .false.
    call screens%find(simulation%decomposition%boundaries)
    call check(.not. screens%exist, "a wall that is not there")
    call simulation%free()
  end subroutine test_scene

end program test_screens
