!> Random scenes for tests: what a grain has follows from its number, so that every rank knows all of them.
module gravier_test_scenes
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_random_hash, only: hash_uniform
  use gravier_periodic, only: period_t
  use gravier_communicator, only: communicator_t
  use gravier_body_store, only: body_layout_t, body_set_t
  use gravier_boundary, only: boundary_t
  use gravier_facing_planes, only: faces_along
  use gravier_surface, only: surface_t
  use gravier_surface_registry, only: make_surface
  use gravier_neighbour_rule, only: neighbour_rule_t
  use gravier_box_counts, only: choose_boxes
  use gravier_decomposition, only: decomposition_t
  use gravier_check, only: check
  implicit none
  private
  public :: cloud_t, near_pair_t, draw, plane, change_shape, make_decomposition

  !> Grains in the unit box, some of which overlap. The identifier of a grain is its number.
  type :: cloud_t
    integer :: nd = 2, n = 0
    !> (nd, n), (n) [m]
    real(dp), allocatable :: place(:, :), radius(:)
    type(period_t) :: period
  contains
    procedure :: init => cloud_init
    procedure :: make_periodic => cloud_make_periodic
    procedure :: rule => cloud_rule
    procedure :: bodies => cloud_bodies
    procedure :: near_pairs => cloud_near_pairs
    procedure :: find_antagonist => cloud_find_antagonist
  end type cloud_t

  !> Grains i < j whose surfaces are near, j being shifted by whole periods.
  type :: near_pair_t
    integer :: i = 0, j = 0, shift(3) = 0
    real(dp) :: gap = 0.0_dp
  end type near_pair_t

contains

  !> A number in [0, 1).
  pure real(dp) function draw(seed, g, stream)
    integer, intent(in) :: seed, g, stream
    draw = hash_uniform(seed, int(g, i8), stream)
  end function draw

  subroutine cloud_init(self, nd, n, smallest, largest, seed)
    class(cloud_t), intent(inout) :: self
    integer, intent(in) :: nd, n, seed
    !> radii [m]
    real(dp), intent(in) :: smallest, largest
    type(period_t) :: none
    integer :: g, d

    self%nd = nd
    self%n = n
    self%period = none
    if (allocated(self%place)) deallocate (self%place, self%radius)
    allocate (self%place(nd, n), self%radius(n))
    do g = 1, n
      self%radius(g) = smallest + (largest - smallest)*draw(seed, g, 1)**2
      do d = 1, nd
        self%place(d, g) = draw(seed, g, 1 + d)
      end do
    end do
  end subroutine cloud_init

  !> Make the axes of bits 0, 1, 2 of `axes` periodic, of period 1.
  subroutine cloud_make_periodic(self, axes)
    class(cloud_t), intent(inout) :: self
    integer, intent(in) :: axes
    integer :: d

    do d = 1, self%nd
      if (btest(axes, d - 1)) self%period%length(d) = 1.0_dp
    end do
  end subroutine cloud_make_periodic

  pure function cloud_rule(self, alert, skin, kind) result(rule)
    class(cloud_t), intent(in) :: self
    real(dp), intent(in) :: alert, skin
    integer, intent(in) :: kind
    type(neighbour_rule_t) :: rule

    rule%alert_distance = alert
    rule%skin = skin
    rule%largest_radius = maxval(self%radius)
    rule%mean_radius = sum(self%radius)/self%n
    rule%kind = kind
  end function cloud_rule

  !> Grains first, first + step, ... with `nv` degrees of freedom.
  subroutine cloud_bodies(self, nv, first, step, bodies)
    class(cloud_t), intent(in) :: self
    integer, intent(in) :: nv, first, step
    type(body_set_t), intent(inout) :: bodies
    integer :: g, d, n

    call bodies%init(body_layout_t(self%nd, nv, merge(self%nd, 0, self%period%on())), max(0, (self%n - first + step)/step))
    bodies%glued(:) = 0
    bodies%image(:, :) = 0
    n = 0
    do g = first, self%n, step
      n = n + 1
      bodies%id(n) = g
      bodies%position(:, n) = self%place(:, g)
      bodies%radius(n) = self%radius(g)
      bodies%mass(n) = 1.0_dp + draw(4, g, 5)
      if (nv > self%nd) bodies%inertia(n) = 0.1_dp + draw(4, g, 6)
      do d = 1, nv
        bodies%velocity(d, n) = draw(4, g, 6 + d) - 0.5_dp
      end do
    end do
  end subroutine cloud_bodies

  !> Compare all pairs: those whose gap is at most `range`.
  subroutine cloud_near_pairs(self, range, pairs)
    class(cloud_t), intent(in) :: self
    !> [m]
    real(dp), intent(in) :: range
    type(near_pair_t), allocatable, intent(out) :: pairs(:)
    type(near_pair_t) :: pair
    real(dp) :: place(self%nd)
    integer :: i, j, x, y, z, n, turns(3), round

    turns(:) = merge(1, 0, self%period%length > 0.0_dp)
    do round = 1, 2
      n = 0
      do i = 1, self%n
        do j = i + 1, self%n
          do z = -turns(3), turns(3)
            do y = -turns(2), turns(2)
              do x = -turns(1), turns(1)
                pair%i = i
                pair%j = j
                pair%shift(1) = x
                pair%shift(2) = y
                pair%shift(3) = z
                call self%find_antagonist(pair, place)
                pair%gap = norm2(self%place(:, i) - place) - self%radius(i) - self%radius(j)
                if (pair%gap > range) cycle
                n = n + 1
                if (round == 2) pairs(n) = pair
              end do
            end do
          end do
        end do
      end do
      if (round == 1) allocate (pairs(n))
    end do
  end subroutine cloud_near_pairs

  !> Place of the antagonist of a pair, shifted to where it meets the candidate.
  pure subroutine cloud_find_antagonist(self, pair, place)
    class(cloud_t), intent(in) :: self
    type(near_pair_t), intent(in) :: pair
    !> (nd) [m]
    real(dp), intent(out) :: place(:)
    place(:) = self%place(:, pair%j) + pair%shift(1:self%nd)*self%period%length(1:self%nd)
  end subroutine cloud_find_antagonist

  !> A plane at rest.
  function plane(id, point, normal) result(boundary)
    integer, intent(in) :: id
    !> (nd)
    real(dp), intent(in) :: point(:), normal(:)
    type(boundary_t) :: boundary

    boundary%id = id
    call make_surface("plane", boundary%surface)
    boundary%surface%point(1:size(point)) = point
    boundary%pivot(:) = boundary%surface%point
    boundary%surface%axis(1:size(normal)) = normal
    boundary%faces = faces_along(boundary)
  end function plane

  !> Give a boundary another shape, in its place.
  subroutine change_shape(kind, boundary)
    character(len=*), intent(in) :: kind
    type(boundary_t), intent(inout) :: boundary
    class(surface_t), allocatable :: surface

    call make_surface(kind, surface)
    if (allocated(boundary%surface)) then
      surface%point(:) = boundary%surface%point
      surface%axis(:) = boundary%surface%axis
      surface%edge(:, :) = boundary%surface%edge
      surface%radius = boundary%surface%radius
    end if
    call move_alloc(surface, boundary%surface)
    boundary%faces = faces_along(boundary)
  end subroutine change_shape

  !> Share a cloud out, by boxes or by cells. The last rank brings nobody, unless it is alone. Collective.
  subroutine make_decomposition(comm, cloud, n_subdomains, nv, by_cells, decomposition)
    type(communicator_t), target, intent(in) :: comm
    type(cloud_t), intent(in) :: cloud
    integer, intent(in) :: n_subdomains, nv
    logical, intent(in) :: by_cells
    !> its rule and its boundaries are left as they are
    type(decomposition_t), intent(inout) :: decomposition
    type(body_set_t) :: newcomers(1)
    type(error_t), allocatable :: error
    real(dp) :: lower(cloud%nd), upper(cloud%nd)
    integer, allocatable :: weights(:)
    integer :: bringing, boxes(3)

    bringing = max(1, comm%size - 1)
    call cloud%bodies(nv, merge(comm%rank + 1, cloud%n + 1, comm%rank < bringing), bringing, newcomers(1))
    call decomposition%init(comm, n_subdomains, newcomers(1), cloud%period)
    call decomposition%bounding_box(newcomers, lower, upper)
    decomposition%partition%period(:) = cloud%period%length
    call decomposition%partition%set_box(lower, upper)
    if (by_cells) then
      allocate (weights(newcomers(1)%n), source=1)
      call decomposition%partition%init_graph(comm, 0.15_dp, newcomers(1)%position, weights, n_subdomains, error)
    else
      boxes(:) = choose_boxes(lower, upper, n_subdomains, cloud%period%length)
      call decomposition%partition%init_grid(boxes, 0.1_dp, error)
    end if
    call check(.not. allocated(error), "partition")
    call decomposition%migrate(newcomers(1))
  end subroutine make_decomposition

end module gravier_test_scenes
