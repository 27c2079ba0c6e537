!> Shapes and orientations of the grains of a sample. What a grain gets depends on its identifier and the seed alone.
module gravier_sample_shapes
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_random_hash, only: hash_uniform
  use gravier_communicator, only: communicator_t
  use gravier_bodies_data, only: bodies_data_t, allocate_shapes
  use gravier_shape_library, only: shape_library_t
  use gravier_shape_names, only: find_shape, shape_names
  use gravier_random_turn, only: random_turn
  use gravier_shares, only: accumulate, kind_at
  use gravier_config_types, only: config_t, grains_config_t
  use gravier_config_names, only: count_names, get_name
  use gravier_config_laws, only: density_of
  implicit none
  private
  public :: draw_shapes, choose_shapes

  !> stream of random numbers that shapes are drawn from; those of radii and places are 0 and above, those of turns below
  integer, parameter :: stream_of_shapes = -1
  integer, parameter :: stream_of_turns = -4

contains

  !> Give grains shapes, orientations that are all as likely, and masses. Failure (status_input): a name that the library does not
  !> have. Errors are the same on all ranks. Collective.
  subroutine draw_shapes(comm, config, shapes, data, error)
    type(communicator_t), intent(in) :: comm
    type(config_t), intent(in) :: config
    !> one shape or more
    type(shape_library_t), intent(in) :: shapes
    !> identifiers, radii, materials and the masses of disks or spheres are known
    type(bodies_data_t), intent(inout) :: data
    type(error_t), allocatable, intent(inout) :: error
    integer, allocatable :: number(:)
    real(dp), allocatable :: bound(:)
    integer :: k

    call choose_shapes(config, config%file//": &sample", config%sample%grains_config_t, shapes, number, bound, error)
    call allocate_shapes(data, "the grains to be made", error)
    call comm%agree(error)
    if (allocated(error)) return
    do k = 1, data%n
      data%shape(k) = number(kind_at(bound, hash_uniform(config%sample%seed, data%id(k), stream_of_shapes)))
      if (data%shape(k) == 0) cycle
      call random_turn(config%sample%seed, data%id(k), stream_of_turns, data%orientation(:, k))
      data%mass(k) = density_of(config, data%material(k))*shapes%volume_of(data%shape(k))*data%radius(k)**data%dimension
    end do
  end subroutine draw_shapes

  !> The shapes to draw from by their numbers in the library, 0 for a disk or a sphere, and the cumulative fraction of each.
  subroutine choose_shapes(config, label, grains, shapes, number, bound, error)
    type(config_t), intent(in) :: config
    !> file and group, for messages
    character(len=*), intent(in) :: label
    type(grains_config_t), intent(in) :: grains
    type(shape_library_t), intent(in) :: shapes
    integer, allocatable, intent(out) :: number(:)
    real(dp), allocatable, intent(out) :: bound(:)
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: name
    integer :: k, n

    n = count_names(grains%grain_shapes)
    allocate (number(merge(n, shapes%n, n > 0)), bound(merge(n, shapes%n, n > 0)))
    do k = 1, size(number)
      number(k) = k
      if (n == 0) cycle
      call get_name(trim(grains%grain_shapes), k, name)
      call find_number(config, label, shapes, name, number(k), error)
    end do
    bound(:) = 1.0_dp
    associate (shares => grains%grain_shares)
      if (any(shares > 0.0_dp)) bound(:) = shares(:n)
    end associate
    call accumulate(bound)
  end subroutine choose_shapes

  !> The number of a shape by its name.
  subroutine find_number(config, label, shapes, name, number, error)
    type(config_t), intent(in) :: config
    character(len=*), intent(in) :: label
    type(shape_library_t), intent(in) :: shapes
    character(len=*), intent(in) :: name
    integer, intent(out) :: number
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: ball

    ball = trim(merge("disk  ", "sphere", config%scene%dimension == 2))
    number = find_shape(shapes, name)
    if (number == 0 .and. name /= ball) call raise(error, status_input, label//" grain_shapes: '"//name// &
      & "': expected "//ball//" or one of the shapes of "//trim(config%scene%shapes)//", "//shape_names(shapes, ", "))
  end subroutine find_number

end module gravier_sample_shapes
