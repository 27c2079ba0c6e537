!> Walls without a thickness between bodies: segments and rectangles that lie between two points, and those that do not.
program test_screens
  use gravier_kinds, only: dp
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_flat_piece, only: segment_t, rectangle_t
  use gravier_plane, only: plane_t
  use gravier_mesh, only: mesh_t
  use gravier_neighbour_list, only: neighbour_list_t, pair_memory_t
  use gravier_halo, only: local_bodies_t
  use gravier_screens, only: screens_t
  use gravier_simulation, only: simulation_t
  use gravier_test_simulations, only: make_scene
  use gravier_check, only: check, finish_checks
  implicit none
  type(communicator_t), target :: comm

  call start_parallel()
  call comm%init()
  call test_pieces()
  call test_meshes()
  call test_departure()
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

  !> A square of two triangles that share a diagonal, and a broken line; turned by a quarter they part other points.
  subroutine test_meshes()
    type(mesh_t) :: square, line
    real(dp) :: corner(3, 3, 2), ends(3, 2, 2), from(3), to(3)
    integer :: k

    corner(:, :, :) = 0.0_dp
    corner(1:2, 2, 1) = [1.0_dp, 0.0_dp]
    corner(1:2, 3, 1) = [1.0_dp, 1.0_dp]
    ! the other way round
    corner(1:2, 2, 2) = [0.0_dp, 1.0_dp]
    corner(1:2, 3, 2) = [1.0_dp, 1.0_dp]
    square%edge(1, 1) = 1.0_dp
    square%edge(2, 2) = 1.0_dp
    call square%take_facets(corner)
    do k = 0, 10
      from(1:2) = 0.1_dp*k
      from(3) = -1.0_dp
      to(:) = from
      to(3) = 1.0_dp
      call check(square%parts(from, to), "through the diagonal of a square")
      from(2) = 0.0_dp
      to(2) = 1.0_dp
      call check(square%parts(to, from), "through its middle, the other way")
    end do
    call check(.not. square%parts([1.1_dp, 0.5_dp, -1.0_dp], [1.1_dp, 0.5_dp, 1.0_dp]), "beside it")
    call check(.not. square%parts([0.5_dp, -0.2_dp, -1.0_dp], [0.5_dp, 0.1_dp, 1.0_dp]), "past its side")
    call check(.not. square%parts([0.2_dp, 0.5_dp, 0.1_dp], [0.9_dp, 0.5_dp, 1.0_dp]), "above it")
    square%edge(:, 1) = [0.0_dp, 0.0_dp, 1.0_dp]
    call check(.not. square%parts([0.5_dp, 0.5_dp, -1.0_dp], [0.5_dp, 0.5_dp, 1.0_dp]), "along a square that has turned")
    call check(square%parts([-1.0_dp, 0.5_dp, 0.5_dp], [1.0_dp, 0.5_dp, 0.5_dp]), "through a square that has turned")
    ends(:, :, :) = 0.0_dp
    ends(1, 2, 1) = 1.0_dp
    ends(1, 1, 2) = 1.0_dp
    ends(1:2, 2, 2) = [2.0_dp, 2.0_dp]
    line%edge(1, 1) = 1.0_dp
    line%edge(2, 2) = 1.0_dp
    call line%take_facets(ends)
    call check(line%parts([0.5_dp, -0.1_dp, 0.0_dp], [0.5_dp, 0.1_dp, 0.0_dp]), "through the first part of a line")
    call check(line%parts([2.5_dp, 1.9_dp, 0.0_dp], [1.5_dp, 1.9_dp, 0.0_dp]), "through the second")
    call check(.not. line%parts([2.5_dp, 2.1_dp, 0.0_dp], [1.5_dp, 2.1_dp, 0.0_dp]), "beyond its end")
    call check(.not. line%parts([1.5_dp, -0.1_dp, 0.0_dp], [1.5_dp, 0.1_dp, 0.0_dp]), "beyond the first, below the second")
    call check(line%parts([0.9_dp, 0.1_dp, 0.0_dp], [1.1_dp, -0.1_dp, 0.0_dp]), "through its corner")
  end subroutine test_meshes

  !> Bodies that stay when others leave take along whether they are near facets.
  subroutine test_departure()
    type(neighbour_list_t) :: list
    integer :: none(0)

    call list%init(.false., 1)
    call list%finish(none, pair_memory_t())
    allocate (list%at_facets(3))
    list%at_facets(1) = .true.
    list%at_facets(2) = .false.
    list%at_facets(3) = .true.
    call list%drop([0, 1, 2])
    call check(.not. list%at_facets(1) .and. list%at_facets(2), "nearness of bodies that have moved up")
  end subroutine test_departure

  !> Two grains, between which a segment lies, across the end of a period: one that is there, and one that is not yet.
  subroutine test_scene()
    character(len=*), parameter :: start = "&scene dimension = 2, bodies = 'lattice', lattice_count = 2, 1, radius_min = 0.5, "// &
      & "radius_max = 0.5, gravity = 0, 0, period = 4.2, 0 / &time step = 0.01, steps = 1 / "
    type(simulation_t) :: simulation
    type(screens_t) :: screens
    type(local_bodies_t) :: view
    real(dp) :: branch(2), place(2)
    integer :: faces

    branch(1) = -1.0_dp
    branch(2) = 0.0_dp
    call make_scene(comm, start, simulation)
    call screens%find(simulation%decomposition%boundaries)
    call check(.not. screens%exist, "no wall")
    call simulation%free()
    place(1) = -0.5_dp
    place(2) = 1.0_dp
    call view%list%init(.true., 1)
    call view%list%add(1, 2, 0)
    call make_scene(comm, start//"&boundary shape = 'segment', point = 4.2, -3, end = 4.2, 3 /", simulation)
    view%bodies = simulation%decomposition%owned(1)
    call screens%find(simulation%decomposition%boundaries)
    call check(screens%exist, "a wall")
    call check(screens%part(simulation%decomposition, view, 1, place, branch), "between them, a period away")
    branch(1) = 1.0_dp
    call check(.not. screens%part(simulation%decomposition, view, 1, place, branch), "not on the other side")
    simulation%decomposition%boundaries(:)%present = .false.
    call screens%find(simulation%decomposition%boundaries)
    call check(.not. screens%exist, "a wall that is not there")
    call simulation%free()
    ! a mesh is looked at between bodies that both may touch it alone
    open (newunit=faces, file="wall.csv", action="write", status="replace")
    write (faces, "(a)") "x,y", "0,-3", "0,3"
    close (faces)
    call make_scene(comm, start//"&boundary shape = 'mesh', file = 'wall.csv', point = 4.2, 0 /", simulation)
    call screens%find(simulation%decomposition%boundaries)
    call check(screens%exist, "a mesh")
    branch(1) = -1.0_dp
    allocate (view%list%at_facets(2))
    do faces = 0, 3
      view%list%at_facets(1) = btest(faces, 0)
      view%list%at_facets(2) = btest(faces, 1)
      call check(screens%part(simulation%decomposition, view, 1, place, branch) .eqv. faces == 3, "where both are near")
    end do
    branch(1) = 1.0_dp
    call check(.not. screens%part(simulation%decomposition, view, 1, place, branch), "not on the other side of the mesh")
    call simulation%free()
  end subroutine test_scene

end program test_screens
