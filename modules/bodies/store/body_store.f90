!> Grains (disks in 2D, spheres in 3D) in packed arrays.
module gravier_body_store
  use gravier_kinds, only: dp, i8
  use gravier_narrow, only: narrow
  implicit none
  private
  public :: body_set_t, append_bodies, place_word, grain_record

  !> first of the words of a record that hold the grain's place
  integer, parameter :: place_word = 6
  !> the words of a record, in their order: the version of checkpoints, which changes with them
  character(len=*), parameter :: grain_record = "id radius mass glued material position velocity image inertia"

  !> Grains of one subdomain, or of any batch. Velocities hold the translation first, then the spin where the
  !> scene has one: (vx, vy[, omega]) in 2D, (vx, vy, vz[, wx, wy, wz]) in 3D, all in global axes.
  type :: body_set_t
    integer :: n = 0
    !> space dimension
    integer :: nd = 0
    !> degrees of freedom of a grain
    integer :: nv = 0
    !> entries of an image: nd in a periodic scene, else 0
    integer :: ni = 0
    !> global, stable identifiers (n)
    integer(i8), allocatable :: id(:)
    !> (nd, n) [m]
    real(dp), allocatable :: position(:, :)
    !> (nv, n) [m/s, rad/s]
    real(dp), allocatable :: velocity(:, :)
    !> (n) [m]
    real(dp), allocatable :: radius(:)
    !> (n) [kg]
    real(dp), allocatable :: mass(:)
    !> about any axis through the centre, of no size where grains do not turn (n or 0) [kg m^2]
    real(dp), allocatable :: inertia(:)
    !> number of the boundary that a grain is glued to, 0 for a free one (n)
    integer, allocatable :: glued(:)
    !> number of its material, 1 at first (n)
    integer, allocatable :: material(:)
    !> periods that lie between a grain's place and the place it would have without periods (ni, n)
    integer, allocatable :: image(:, :)
  contains
    procedure :: init => body_set_init
    procedure :: record_words => body_set_record_words
    procedure :: get_record => body_set_get_record
    procedure :: set_record => body_set_set_record
    procedure :: reorder => body_set_reorder
    procedure :: keep_only => body_set_keep_only
  end type body_set_t

contains

  !> Make room for `n` grains of `nv` degrees of freedom in `nd` dimensions, with `ni` entries of an image.
  subroutine body_set_init(self, nd, nv, ni, n)
    class(body_set_t), intent(inout) :: self
    integer, intent(in) :: nd, nv, ni, n

    self%n = n
    self%nd = nd
    self%nv = nv
    self%ni = ni
    if (allocated(self%id)) deallocate (self%id, self%position, self%velocity, self%radius, self%mass, self%inertia, self%glued, &
      & self%material, self%image)
    allocate (self%id(n), self%position(nd, n), self%velocity(nv, n), self%radius(n), self%mass(n), &
      & self%inertia(merge(n, 0, nv > nd)), self%glued(n), self%image(ni, n))
    allocate (self%material(n), source=1)
  end subroutine body_set_init

  !> Words of one grain when it travels between subdomains.
  pure integer function body_set_record_words(self) result(words)
    class(body_set_t), intent(in) :: self
    words = place_word - 1 + self%nd + self%nv + self%ni + merge(1, 0, self%nv > self%nd)
  end function body_set_record_words

  !> Write grain `k` into `record` (record_words).
  pure subroutine body_set_get_record(self, k, record)
    class(body_set_t), intent(in) :: self
    integer, intent(in) :: k
    integer(i8), intent(out) :: record(:)
    integer :: d

    record(1) = self%id(k)
    record(2) = transfer(self%radius(k), 0_i8)
    record(3) = transfer(self%mass(k), 0_i8)
    record(4) = self%glued(k)
    record(5) = self%material(k)
    do d = 1, self%nd
      record(place_word - 1 + d) = transfer(self%position(d, k), 0_i8)
    end do
    do d = 1, self%nv
      record(place_word - 1 + self%nd + d) = transfer(self%velocity(d, k), 0_i8)
    end do
    do d = 1, self%ni
      record(place_word - 1 + self%nd + self%nv + d) = self%image(d, k)
    end do
    if (self%nv > self%nd) record(self%record_words()) = transfer(self%inertia(k), 0_i8)
  end subroutine body_set_get_record

  !> Read grain `k` from `record` (record_words).
  pure subroutine body_set_set_record(self, k, record)
    class(body_set_t), intent(inout) :: self
    integer, intent(in) :: k
    integer(i8), intent(in) :: record(:)
    integer :: d

    self%id(k) = record(1)
    self%radius(k) = transfer(record(2), 0.0_dp)
    self%mass(k) = transfer(record(3), 0.0_dp)
    self%glued(k) = narrow(record(4))
    self%material(k) = narrow(record(5))
    do d = 1, self%nd
      self%position(d, k) = transfer(record(place_word - 1 + d), 0.0_dp)
    end do
    do d = 1, self%nv
      self%velocity(d, k) = transfer(record(place_word - 1 + self%nd + d), 0.0_dp)
    end do
    do d = 1, self%ni
      self%image(d, k) = narrow(record(place_word - 1 + self%nd + self%nv + d))
    end do
    if (self%nv > self%nd) self%inertia(k) = transfer(record(self%record_words()), 0.0_dp)
  end subroutine body_set_set_record

  !> Keep the grains order(1), order(2), ... in this order; `order` may leave some out.
  subroutine body_set_reorder(self, order)
    class(body_set_t), intent(inout) :: self
    integer, intent(in), contiguous :: order(:)
    type(body_set_t) :: old
    integer :: k

    old = self
    call self%init(old%nd, old%nv, old%ni, size(order))
    do k = 1, size(order)
      self%id(k) = old%id(order(k))
      self%position(:, k) = old%position(:, order(k))
      self%velocity(:, k) = old%velocity(:, order(k))
      self%radius(k) = old%radius(order(k))
      self%mass(k) = old%mass(order(k))
      if (self%nv > self%nd) self%inertia(k) = old%inertia(order(k))
      self%glued(k) = old%glued(order(k))
      self%material(k) = old%material(order(k))
      self%image(:, k) = old%image(:, order(k))
    end do
  end subroutine body_set_reorder

  !> Drop the grains whose mask is false.
  subroutine body_set_keep_only(self, mask)
    class(body_set_t), intent(inout) :: self
    !> (n)
    logical, intent(in), contiguous :: mask(:)
    integer, allocatable :: kept(:)
    integer :: k, n

    allocate (kept(count(mask)))
    n = 0
    do k = 1, self%n
      if (.not. mask(k)) cycle
      n = n + 1
      kept(n) = k
    end do
    call self%reorder(kept)
  end subroutine body_set_keep_only

  !> Add the grains of `more` behind those of `bodies`.
  subroutine append_bodies(bodies, more)
    type(body_set_t), intent(inout) :: bodies
    type(body_set_t), intent(in) :: more
    type(body_set_t) :: old
    integer :: n

    if (more%n == 0) return
    old = bodies
    n = old%n
    call bodies%init(more%nd, more%nv, more%ni, n + more%n)
    if (n > 0) then
      bodies%id(1:n) = old%id
      bodies%position(:, 1:n) = old%position
      bodies%velocity(:, 1:n) = old%velocity
      bodies%radius(1:n) = old%radius
      bodies%mass(1:n) = old%mass
      if (bodies%nv > bodies%nd) bodies%inertia(1:n) = old%inertia
      bodies%glued(1:n) = old%glued
      bodies%material(1:n) = old%material
      bodies%image(:, 1:n) = old%image
    end if
    bodies%id(n + 1:) = more%id
    bodies%position(:, n + 1:) = more%position
    bodies%velocity(:, n + 1:) = more%velocity
    bodies%radius(n + 1:) = more%radius
    bodies%mass(n + 1:) = more%mass
    if (bodies%nv > bodies%nd) bodies%inertia(n + 1:) = more%inertia
    bodies%glued(n + 1:) = more%glued
    bodies%material(n + 1:) = more%material
    bodies%image(:, n + 1:) = more%image
  end subroutine append_bodies

end module gravier_body_store
