!> Grains that are generated, and the planes around them: lattices of &scene, and the samples of &sample.
module gravier_sample_bodies
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_magnitude, only: sharpest, far_text
  use gravier_communicator, only: communicator_t
  use gravier_bodies_data, only: bodies_data_t, allocate_bodies, allocate_walls, find_own_rows
  use gravier_motion, only: grain_mass
  use gravier_placed_grains, only: sample_box_t
  use gravier_held_box, only: held_box_t
  use gravier_radius_distribution, only: radius_distribution_t
  use gravier_lattice_packing, only: lattice_t, cell_edge
  use gravier_loose_packing, only: place_loosely
  use gravier_config_types, only: config_t, grains_config_t
  use gravier_config_laws, only: density_of
  use gravier_shape_library, only: shape_library_t
  use gravier_sample_shapes, only: draw_shapes
  use gravier_sample_materials, only: draw_materials, draw_velocities
  use gravier_sample_container, only: set_container
  implicit none
  private
  public :: make_lattice, make_sample, set_radii, farthest_place

contains

  !> The lattice of &scene: random radii, as many cells along each axis as it says, a box without lid with its lower
  !> corner at the origin (that of the period), without planes along periodic axes. What a grain gets depends on its
  !> identifier and the seed alone. Errors are the same on all ranks.
  subroutine make_lattice(comm, config, data, error)
    type(communicator_t), intent(in) :: comm
    type(config_t), intent(in) :: config
    type(bodies_data_t), intent(out) :: data
    type(error_t), allocatable, intent(inout) :: error
    type(radius_distribution_t) :: radii
    type(sample_box_t) :: box
    type(lattice_t) :: lattice
    ! the box is made for the cells
    type(error_t), allocatable :: never

    call make_lattice_box(config, box, error)
    if (allocated(error)) return
    radii%kind = "uniform"
    radii%nd = box%nd
    radii%radius_min = config%scene%radius_min
    radii%radius_max = config%scene%radius_max
    data%total = product(int(config%scene%lattice_count(1:box%nd), i8))
    call draw_grains(comm, radii, config%scene%seed, data, error)
    if (allocated(error)) return
    call set_masses(config, data)
    call check_box(comm, config, box, data, error)
    if (allocated(error)) return
    call lattice%init(box, config%scene%radius_max, data%total, never)
    call lattice%place(config%scene%seed, data%id, data%radius, data%position)
    call make_planes(box, .false., data, error)
  end subroutine make_lattice

  !> The box of the lattice, which the period must have room for.
  subroutine make_lattice_box(config, box, error)
    type(config_t), intent(in) :: config
    type(sample_box_t), intent(out) :: box
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: width
    integer :: d

    associate (scene => config%scene)
      box%nd = scene%dimension
      box%lower(:) = scene%period_origin
      box%periodic(:) = scene%period > 0.0_dp
      do d = 1, box%nd
        width = scene%lattice_count(d)*cell_edge(scene%radius_max)
        box%upper(d) = box%lower(d) + width
        if (.not. box%periodic(d) .or. scene%period(d) >= (1.0_dp - 1.0e-9_dp)*width) cycle
        call raise(error, status_input, config%file//": &scene period: expected at least "//to_text(width, 6)// &
          & " m along axis "//to_text(d)//", the width of the lattice")
      end do
    end associate
  end subroutine make_lattice_box

  !> Refuse a box so far from the origin that grains in it could not be told apart. Errors are the same on all ranks. Collective.
  subroutine check_box(comm, config, box, data, error)
    type(communicator_t), intent(in) :: comm
    type(config_t), intent(in) :: config
    class(sample_box_t), intent(in) :: box
    !> radii are known
    type(bodies_data_t), intent(in) :: data
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: corner, far

    corner = max(maxval(abs(box%lower(1:box%nd))), maxval(abs(box%upper(1:box%nd))))
    far = farthest_place(comm, data%radius)
    if (corner > far) call raise(error, status_input, config%file//": &scene period_origin: a box as far as "// &
      & to_text(corner, 4)//" m from the origin: expected at most "//to_text(far, 4)//" m, "//far_text)
  end subroutine check_box

  !> How far from the origin grains may be for rounding not to hide the gaps between them [m]. Collective.
  real(dp) function farthest_place(comm, radius) result(far)
    type(communicator_t), intent(in) :: comm
    !> of the grains of this rank [m]
    real(dp), intent(in) :: radius(:)

    far = huge(1.0_dp)
    if (size(radius) > 0) far = sharpest*minval(radius)
    far = -comm%highest(-far)
  end function farthest_place

  !> The sample of &sample before any preparation: grains with identifiers from 1, and, if not boundaries hold them, a plane on each
  !> side of the box that is not periodic, but a lid only where the grains are to be compacted; the box is that of the period.
  !> Grains with shapes are placed by the balls that hold them. Failure (status_input): a table of radii that cannot be read,
  !> grains that find no place, shapes that the library does not have. Errors are the same on all ranks. Collective.
  subroutine make_sample(comm, config, shapes, data, error)
    type(communicator_t), intent(in) :: comm
    type(config_t), intent(in) :: config
    !> that grains may have; without any all are disks or spheres
    type(shape_library_t), intent(in) :: shapes
    type(bodies_data_t), intent(out) :: data
    type(error_t), allocatable, intent(inout) :: error
    type(radius_distribution_t) :: radii
    type(held_box_t) :: box

    call set_radii(comm, config%sample%grains_config_t, config%scene%dimension, radii, error)
    if (allocated(error)) return
    data%total = config%sample%count
    call draw_grains(comm, radii, config%sample%seed, data, error)
    if (allocated(error)) return
    call draw_materials(config, data)
    call set_masses(config, data)
    box%nd = config%scene%dimension
    box%lower(:) = config%scene%period_origin
    box%upper(:) = box%lower + config%sample%box
    box%periodic(:) = config%scene%period > 0.0_dp
    call check_box(comm, config, box, data, error)
    if (allocated(error)) return
    if (config%sample%arrangement == "lattice") then
      call place_in_lattice(config%sample%seed, radii%largest(), box, data, error)
    else
      if (.not. config%sample%box(box%nd) > 0.0_dp) call set_height(comm, config, data, box)
      call set_container(comm, config, radii%largest(), box, error)
      if (allocated(error)) return
      call place_loosely(comm, box, config%sample%seed, data%id, data%radius, data%position, error)
    end if
    if (allocated(error)) then
      error%message = config%file//": &sample box: "//error%message
      return
    end if
    if (shapes%n > 0) call draw_shapes(comm, config, shapes, data, error)
    if (allocated(error)) return
    call draw_velocities(comm, config, data)
    if (box%is_held) then
      call allocate_walls(data, box%nd, 0, "planes", error)
    else
      call make_planes(box, config%sample%preparation == "compacted", data, error)
    end if
    data%has_box = any(box%periodic)
    data%origin(:) = config%scene%period_origin
    data%period(:) = config%scene%period
  end subroutine make_sample

  !> The distribution of radii that &sample or &insertion asks for. Collective.
  subroutine set_radii(comm, grains, nd, radii, error)
    type(communicator_t), intent(in) :: comm
    type(grains_config_t), intent(in) :: grains
    !> space dimension
    integer, intent(in) :: nd
    type(radius_distribution_t), intent(out) :: radii
    type(error_t), allocatable, intent(inout) :: error

    radii%nd = nd
    radii%kind = grains%radii
    radii%radius = grains%radius
    radii%radius_min = grains%radius_min
    radii%radius_max = grains%radius_max
    radii%radius_mean = grains%radius_mean
    radii%radius_deviation = grains%radius_deviation
    if (grains%radii == "table") call radii%read_table(comm, trim(grains%radius_table), error)
  end subroutine set_radii

  !> Identifiers and radii of the grains of this rank, of `data%total` in all, at rest and of the first material. There is room for
  !> their masses.
  subroutine draw_grains(comm, radii, seed, data, error)
    type(communicator_t), intent(in) :: comm
    type(radius_distribution_t), intent(in) :: radii
    integer, intent(in) :: seed
    type(bodies_data_t), intent(inout) :: data
    type(error_t), allocatable, intent(inout) :: error
    integer(i8) :: first
    integer :: k, n

    call find_own_rows(comm, data%total, radii%nd, "the grains to be made", first, n, error)
    call allocate_bodies(data, radii%nd, n, .true., "the grains to be made", error)
    call comm%agree(error)
    if (allocated(error)) return
    do k = 1, n
      data%id(k) = first + k
      data%radius(k) = radii%draw(data%id(k), seed)
    end do
  end subroutine draw_grains

  !> Masses of the grains as disks or spheres of their materials.
  subroutine set_masses(config, data)
    type(config_t), intent(in) :: config
    type(bodies_data_t), intent(inout) :: data
    integer :: k

    do k = 1, data%n
      data%mass(k) = grain_mass(data%dimension, data%radius(k), density_of(config, data%material(k)))
    end do
  end subroutine set_masses

  !> Put the grains into the cells of a lattice; a box without height becomes as high as the lattice.
  subroutine place_in_lattice(seed, largest, box, data, error)
    integer, intent(in) :: seed
    !> [m]
    real(dp), intent(in) :: largest
    class(sample_box_t), intent(inout) :: box
    type(bodies_data_t), intent(inout) :: data
    type(error_t), allocatable, intent(inout) :: error
    type(lattice_t) :: lattice

    call lattice%init(box, largest, data%total, error)
    if (allocated(error)) return
    call lattice%place(seed, data%id, data%radius, data%position)
    if (.not. box%upper(box%nd) > box%lower(box%nd)) box%upper(box%nd) = box%lower(box%nd) + lattice%height()
  end subroutine place_in_lattice

  !> The height at which the grains fill the fraction of the box that is asked for. Collective.
  subroutine set_height(comm, config, data, box)
    type(communicator_t), intent(in) :: comm
    type(config_t), intent(in) :: config
    type(bodies_data_t), intent(in) :: data
    class(sample_box_t), intent(inout) :: box
    real(dp), allocatable :: mass(:)
    real(dp) :: volume
    integer :: m, nd

    nd = box%nd
    allocate (mass(data%n))
    volume = 0.0_dp
    do m = 1, max(1, size(config%materials))
      mass(:) = merge(data%mass, 0.0_dp, data%material == m)
      volume = volume + comm%sum_real(mass)/density_of(config, m)
    end do
    box%upper(nd) = box%lower(nd) + volume/(config%sample%solid_fraction*product(config%sample%box(1:nd - 1)))
  end subroutine set_height

  !> Planes on the sides of the box that are not periodic, facing inwards: the floor, the two sides across each other axis,
  !> and the lid.
  subroutine make_planes(box, lid, data, error)
    class(sample_box_t), intent(in) :: box
    logical, intent(in) :: lid
    type(bodies_data_t), intent(inout) :: data
    type(error_t), allocatable, intent(inout) :: error
    integer :: d, n, nd

    nd = box%nd
    n = 2*count(.not. box%periodic(1:nd))
    if (.not. (lid .or. box%periodic(nd))) n = n - 1
    call allocate_walls(data, nd, n, "planes", error)
    if (allocated(error)) return
    data%wall_normal(:, :) = 0.0_dp
    n = 0
    if (.not. box%periodic(nd)) call add_plane(nd, 1.0_dp)
    do d = 1, nd - 1
      if (box%periodic(d)) cycle
      call add_plane(d, 1.0_dp)
      call add_plane(d, -1.0_dp)
    end do
    if (lid .and. .not. box%periodic(nd)) call add_plane(nd, -1.0_dp)

  contains

    !> The plane across axis `d` with the normal `sense` along it.
    subroutine add_plane(d, sense)
      integer, intent(in) :: d
      real(dp), intent(in) :: sense

      n = n + 1
      data%wall_id(n) = data%total + n
      data%wall_point(:, n) = box%lower(1:nd)
      if (sense < 0.0_dp) data%wall_point(d, n) = box%upper(d)
      data%wall_normal(d, n) = sense
    end subroutine add_plane

  end subroutine make_planes

end module gravier_sample_bodies
