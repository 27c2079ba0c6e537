!> A start that carries loads across: impulses layer by layer from the free surface to the supports.
!>
!> Plain sweeps carry a load one grain further each, accelerated ones 0.35 diameters each. From a cold start a packing of height H
!> therefore takes a number of iterations in proportion to H. Here the packing is cut into layers by the way to its supports. Each
!> layer in turn is solved by accelerated sweeps on what lies below, which stands still; the force that it exerts is then handed
!> to the next layer. All layers together take a number of sweeps over the whole packing that does not depend on H.
!>
!>   way     length of the shortest way from a body to a boundary that supports (gravier_supports) over closed contacts, in mean
!>           diameters
!>   layer   `thickness` diameters of way; the first is the farthest. A contact belongs to the layer of its farther body.
!>   halo    the bodies of the next `halo` diameters below a layer move with it; their impulses are thrown away afterwards.
!>
!> A layer whose sweeps converge slowly does not stand still when it is done. All further layers would then be loaded with its
!> error, and sweeps over the whole scene would take longer to mend it than to carry the load without a pass. The pass is given up.
!>
!> Subdomains go through the layers together; a layer is solved by iterations of NSCDD. Results do not depend on ranks. See
!> doc/theory.md, section 25.
module gravier_layered_start
  use gravier_kinds, only: dp
  use gravier_timers, only: start_timer, stop_timer, phase_sweep
  use gravier_contact_kernels, only: kernels_t, lanes, n_blocks, lane_of, block_of
  use gravier_body_mass, only: add_inverse_mass
  use gravier_communicator, only: communicator_t
  use gravier_shared_exchange, only: shared_exchange_t
  use gravier_contact_problem, only: contact_problem_t
  use gravier_subproblem, only: subproblem_t
  use gravier_acceleration, only: acceleration_t
  use gravier_method, only: work_t
  use gravier_sweep_order, only: group_contacts
  use gravier_supports, only: supports_t, find_supports
  use gravier_ways, only: ways_t, list_closed, shorten_ways, unreached
  implicit none
  private
  public :: carry_loads

  !> of a layer and of the halo below it, in mean diameters
  real(dp), parameter :: thickness = 6.0_dp, halo = 3.0_dp
  !> relative change of the impulses of a layer by a sweep at which the layer is done; layers above whose number it falls with the
  !> cube, because each hands its error on; sweeps of a layer at least
  real(dp), parameter :: change_allowed = 9.0e-4_dp, few_layers = 12.0_dp
  integer, parameter :: least_sweeps = 20
  !> A layer that is not done after so many sweeps ends the pass: the first number times the logarithm of one over the change above,
  !> or the second one times the longest way in mean diameters, whichever is more.
  real(dp), parameter :: slow_fall = 10.0_dp, worth_of_way = 0.5_dp

  !> What one subdomain holds while the layers are gone through.
  type :: layers_t
    !> way to a root [mean diameters], layer from 0, the roots and other prescribed bodies in a last one (n_columns)
    real(dp), allocatable :: way(:)
    integer, allocatable :: layer(:)
    !> the longest way of the scene [mean diameters]
    real(dp) :: longest = 0.0_dp
    !> contacts by layer, and the first of each layer (layers + 1)
    integer, allocatable :: contact(:), first(:)
    !> the layer at work, and the shortest way of a body of its halo [mean diameters]
    integer :: at_work = 0
    real(dp) :: lowest = 0.0_dp
    !> velocity under the impulses of the layers done (nv, n_columns)
    real(dp), allocatable :: loaded(:, :)
    !> work space: velocity and weight in a layer, impulses it hands on (nv or nw, n_columns)
    real(dp), allocatable :: velocity(:, :), weight(:, :), reaction(:, :)
    !> bodies of a layer that move, and their velocities one iteration before (nv, size(movable))
    integer, allocatable :: movable(:)
    real(dp), allocatable :: previous(:, :)
    !> contacts of a layer and of its halo, in sweep order; those of the layer alone are marked
    integer, allocatable :: taken(:)
    logical, allocatable :: own(:)
    integer :: n_grouped = 0
    integer, allocatable :: pair(:, :)
    real(dp), allocatable :: hot(:, :, :), impulse(:, :, :), last_impulse(:, :, :), start_impulse(:, :, :)
  contains
    procedure :: moves => layers_moves
  end type layers_t

contains

  !> Replace the impulses of the problem by those of a pass over all layers, which starts from them. Nothing changes where no
  !> boundary supports the load, or the longest way is too short. Collective.
  subroutine carry_loads(problem, least_way, work, sweeps, carried)
    !> with a uniform load
    type(contact_problem_t), intent(inout) :: problem
    !> longest way from which on it is worth while [mean diameters]
    real(dp), intent(in) :: least_way
    !> takes the relaxations
    type(work_t), intent(inout) :: work
    !> over all contacts, that relax as many as the pass did; 0 where there are no layers
    real(dp), intent(out) :: sweeps
    !> all layers are done; otherwise there are none, or the pass was given up, and the caller has to restore the impulses
    logical, intent(out) :: carried
    type(layers_t) :: layers(size(problem%sub))
    real(dp) :: relaxed(1, size(problem%sub)), sums(1)
    integer :: n_layers, l, s, inner, most_sweeps
    real(dp) :: change

    sweeps = 0.0_dp
    carried = .false.
    call find_ways(problem, layers)
    call cut_layers(problem%sub, problem%comm, least_way, layers, n_layers)
    if (n_layers < 2) return
    call start_timer(phase_sweep)
    call start_velocities(problem, layers)
    change = change_allowed*min(1.0_dp, few_layers/n_layers)**3
    most_sweeps = nint(max(-slow_fall*log(change), worth_of_way*thickness*n_layers))
    relaxed(:, :) = 0.0_dp
    do l = 0, n_layers - 1
      do s = 1, size(layers)
        call take_layer(problem%kernels, problem%sub(s), problem%shared, l, s, layers(s))
      end do
      call solve_layer(problem, change, most_sweeps, layers, inner, carried)
      do s = 1, size(layers)
        relaxed(1, s) = relaxed(1, s) + real(inner, dp)*size(layers(s)%taken)
      end do
      if (.not. carried) exit
      call hand_on(problem, layers)
    end do
    call stop_timer(phase_sweep)
    work%relaxations = work%relaxations + nint(sum(relaxed), kind(work%relaxations))
    call problem%comm%sum_parts(relaxed, sums)
    sweeps = sums(1)/max(1.0_dp, real(problem%n_contacts, dp))
  end subroutine carry_loads

  !> The way of every body to the boundaries that support it. Collective.
  subroutine find_ways(problem, layers)
    type(contact_problem_t), intent(inout) :: problem
    type(layers_t), intent(inout) :: layers(:)
    type(supports_t), allocatable :: supports(:)
    type(ways_t) :: ways(size(layers))
    integer :: s

    call find_supports(problem%sub, problem%comm, problem%load(1:problem%nd), supports)
    call list_closed(problem, ways, unit=mean_diameter(problem%sub, problem%comm))
    do s = 1, size(layers)
      where (supports(s)%column) ways(s)%length = 0.0_dp
    end do
    call shorten_ways(problem%comm, problem%shared, ways)
    do s = 1, size(layers)
      call move_alloc(ways(s)%length, layers(s)%way)
    end do
  end subroutine find_ways

  !> Mean diameter of the grains [m]. Collective.
  real(dp) function mean_diameter(sub, comm)
    type(subproblem_t), intent(in) :: sub(:)
    type(communicator_t), intent(in) :: comm
    !> radii and number of the grains
    real(dp) :: parts(2, size(sub)), sums(2)
    integer :: s

    do s = 1, size(sub)
      parts(1, s) = sum(sub(s)%radius)
      parts(2, s) = sub(s)%n_grains
    end do
    call comm%sum_parts(parts, sums)
    mean_diameter = 2.0_dp*sums(1)/max(1.0_dp, sums(2))
  end function mean_diameter

  !> The layer of every body and the contacts of every layer. Collective.
  subroutine cut_layers(sub, comm, least_way, layers, n_layers)
    type(subproblem_t), intent(in) :: sub(:)
    type(communicator_t), intent(in) :: comm
    !> [mean diameters]
    real(dp), intent(in) :: least_way
    type(layers_t), intent(inout) :: layers(:)
    !> 0 where no body has a way to a support that is so long
    integer, intent(out) :: n_layers
    integer, allocatable :: next(:)
    real(dp) :: longest
    integer :: s, b, c, l

    longest = 0.0_dp
    do s = 1, size(layers)
      do b = 1, sub(s)%n_bodies
        if (layers(s)%way(b) < unreached) longest = max(longest, layers(s)%way(b))
      end do
    end do
    longest = comm%highest(longest)
    n_layers = 0
    if (longest < least_way) return
    n_layers = ceiling(longest/thickness)
    if (n_layers < 2) return
    do s = 1, size(layers)
      associate (own => sub(s), this => layers(s))
        ! what hangs on nothing comes first
        this%way(1:own%n_bodies) = min(this%way(1:own%n_bodies), longest)
        this%longest = longest
        allocate (this%layer(own%n_columns), source=n_layers)
        do b = 1, own%n_bodies
          this%layer(b) = min(n_layers - 1, floor((longest - this%way(b))/thickness))
        end do
        allocate (this%first(0:n_layers), this%contact(own%n_contacts), next(0:n_layers), source=0)
        do c = 1, own%n_contacts
          l = min(this%layer(own%pair(1, c)), this%layer(own%pair(2, c)))
          next(l) = next(l) + 1
        end do
        this%first(0) = 1
        do l = 1, n_layers
          this%first(l) = this%first(l - 1) + next(l - 1)
        end do
        next(:) = this%first
        do c = 1, own%n_contacts
          l = min(this%layer(own%pair(1, c)), this%layer(own%pair(2, c)))
          this%contact(next(l)) = c
          next(l) = next(l) + 1
        end do
        deallocate (next)
      end associate
    end do
  end subroutine cut_layers

  !> The velocities under the impulses that there are; nothing moves yet but what is prescribed. Collective.
  subroutine start_velocities(problem, layers)
    type(contact_problem_t), intent(inout) :: problem
    type(layers_t), intent(inout) :: layers(:)
    integer :: s

    call problem%evaluate()
    do s = 1, size(layers)
      associate (sub => problem%sub(s), this => layers(s))
        this%loaded = sub%v_global
        this%velocity = sub%v_free
        this%velocity(:, 1:sub%n_bodies) = 0.0_dp
        allocate (this%weight, mold=sub%weight)
        this%weight(:, :) = 0.0_dp
        allocate (this%reaction, mold=sub%reaction)
        allocate (this%movable(0))
      end associate
    end do
  end subroutine start_velocities

  !> Pack layer `l` with its halo: what moves, and the contacts of that. Masses of shared bodies are divided among their copies.
  subroutine take_layer(kernels, sub, shared, l, s, this)
    type(kernels_t), intent(in) :: kernels
    type(subproblem_t), intent(in) :: sub
    type(shared_exchange_t), intent(in) :: shared
    integer, intent(in) :: l, s
    type(layers_t), intent(inout) :: this
    integer, allocatable :: found(:), pair(:, :), order(:)
    integer :: k

    associate (part => shared%part(s))
      call start_layer(this, l)
      call find_contacts(sub, this, found)
      call list_movable(sub, part%body(1:part%n_shared), this, found)
      allocate (pair(2, size(found)), order(size(found)))
      do k = 1, size(found)
        pair(:, k) = sub%pair(:, found(k))
      end do
      call group_contacts(pair, sub%n_bodies, order, this%n_grouped)
      if (allocated(this%taken)) deallocate (this%taken)
      allocate (this%taken(size(found)))
      do k = 1, size(found)
        this%taken(k) = found(order(k))
      end do
      call pack_contacts(sub, this)
      if (size(found) > 0) call set_operators(kernels, size(found), this%pair, this%hot, this%weight)
    end associate
  end subroutine take_layer

  !> Layer `l` is the one at work: what moved in the one before stands still again.
  subroutine start_layer(this, l)
    type(layers_t), intent(inout) :: this
    integer, intent(in) :: l
    integer :: k

    do k = 1, size(this%movable)
      this%weight(:, this%movable(k)) = 0.0_dp
      this%velocity(:, this%movable(k)) = 0.0_dp
    end do
    this%at_work = l
    this%lowest = 0.0_dp
    if (l < ubound(this%first, 1) - 1) this%lowest = this%longest - thickness*(l + 1) - halo
  end subroutine start_layer

  !> Whether body `b` moves in the layer at work: it is of that layer or of its halo.
  pure logical function layers_moves(self, b) result(moves)
    class(layers_t), intent(in) :: self
    integer, intent(in) :: b

    associate (l => self%at_work)
      moves = self%layer(b) == l .or. &
        & (self%layer(b) == l + 1 .and. l + 1 < ubound(self%first, 1) .and. self%way(b) >= self%lowest)
    end associate
  end function layers_moves

  !> The contacts of the layer at work, and those of the next one where one of the bodies moves.
  subroutine find_contacts(sub, this, found)
    type(subproblem_t), intent(in) :: sub
    type(layers_t), intent(in) :: this
    integer, allocatable, intent(out) :: found(:)
    integer, allocatable :: list(:)
    integer :: c, k, n, next

    associate (l => this%at_work)
      next = min(l + 2, ubound(this%first, 1))
      allocate (list(this%first(next) - this%first(l)))
      n = 0
      do k = this%first(l), this%first(next) - 1
        c = this%contact(k)
        if (k >= this%first(l + 1)) then
          if (.not. (this%moves(sub%pair(1, c)) .or. this%moves(sub%pair(2, c)))) cycle
        end if
        n = n + 1
        list(n) = c
      end do
    end associate
    found = list(1:n)
  end subroutine find_contacts

  !> The bodies of these contacts that move, with their weights and velocities. A body that subdomains share moves in all of them,
  !> also where none of its contacts is taken: its copies are averaged.
  subroutine list_movable(sub, shared, this, found)
    type(subproblem_t), intent(in) :: sub
    !> bodies of this subdomain that others have, too
    integer, intent(in), contiguous :: shared(:)
    type(layers_t), intent(inout) :: this
    integer, intent(in), contiguous :: found(:)
    integer, allocatable :: list(:)
    integer :: i, k, m

    allocate (list(size(shared) + 2*size(found)))
    m = 0
    do i = 1, size(shared)
      call take(shared(i))
    end do
    do i = 1, size(found)
      do k = 1, 2
        if (sub%pair(k, found(i)) <= sub%n_bodies) call take(sub%pair(k, found(i)))
      end do
    end do
    this%movable = list(1:m)
    if (allocated(this%previous)) deallocate (this%previous)
    allocate (this%previous(size(this%velocity, 1), m))
    do k = 1, m
      this%previous(:, k) = this%velocity(:, this%movable(k))
    end do

  contains

    !> Let body `b` move, if it does in this layer and is not listed.
    subroutine take(b)
      integer, intent(in) :: b

      if (.not. this%moves(b) .or. any(this%weight(:, b) > 0.0_dp)) return
      m = m + 1
      list(m) = b
      this%weight(:, b) = sub%multiplicity(b)*sub%inverse_mass(:, b)
      this%velocity(:, b) = this%loaded(:, b)
    end subroutine take

  end subroutine list_movable

  !> The contacts taken, in sweep order and in blocks; the rest of the last block has no effect.
  subroutine pack_contacts(sub, this)
    type(subproblem_t), intent(in) :: sub
    type(layers_t), intent(inout) :: this
    integer :: c, q, g, i, n

    n = size(this%taken)
    if (allocated(this%pair)) deallocate (this%pair, this%hot, this%impulse, this%own)
    allocate (this%pair(2, lanes*n_blocks(n)), source=1)
    allocate (this%hot(lanes, size(sub%hot, 2), n_blocks(n)), this%impulse(lanes, size(sub%impulse, 2), n_blocks(n)), &
      & source=0.0_dp)
    allocate (this%own(n))
    do i = 1, n
      c = this%taken(i)
      q = lane_of(i)
      g = block_of(i)
      this%pair(:, i) = sub%pair(:, c)
      this%hot(q, :, g) = sub%hot(lane_of(c), :, block_of(c))
      this%impulse(q, :, g) = sub%impulse(lane_of(c), :, block_of(c))
      this%own(i) = min(this%layer(sub%pair(1, c)), this%layer(sub%pair(2, c))) == this%at_work
    end do
    this%last_impulse = this%impulse
    this%start_impulse = this%impulse
  end subroutine pack_contacts

  !> Local operators of n > 0 contacts with the weights of what moves.
  subroutine set_operators(kernels, n, pair, hot, weight)
    type(kernels_t), intent(in) :: kernels
    integer, intent(in) :: n
    integer, intent(in), contiguous :: pair(:, :)
    real(dp), intent(inout), contiguous :: hot(:, :, :)
    real(dp), intent(in), contiguous :: weight(:, :)
    real(dp) :: whole(3)

    whole(:) = 1.0_dp
    call kernels%set_operators(pair, hot, weight, whole)
    hot(lane_of(n) + 1:, :, block_of(n)) = 0.0_dp
  end subroutine set_operators

  !> Accelerated sweeps over the contacts taken, and the exchange of NSCDD after each. Collective.
  subroutine solve_layer(problem, change, most_sweeps, layers, inner, done)
    type(contact_problem_t), intent(inout) :: problem
    !> of the impulses by a sweep, relative, at which the layer is done
    real(dp), intent(in) :: change
    !> sweeps after which the layer is left as it is
    integer, intent(in) :: most_sweeps
    type(layers_t), intent(inout) :: layers(:)
    !> sweeps made
    integer, intent(out) :: inner
    !> the change is reached
    logical, intent(out) :: done
    type(acceleration_t) :: acceleration
    real(dp) :: parts(2, size(layers)), sums(2), v
    integer :: s, i, d

    do inner = 1, most_sweeps
      parts(:, :) = 0.0_dp
      do s = 1, size(layers)
        associate (this => layers(s))
          do i = 1, size(this%movable)
            do d = 1, size(this%velocity, 1)
              v = this%velocity(d, this%movable(i))
              this%velocity(d, this%movable(i)) = v + acceleration%beta*(v - this%previous(d, i))
              this%previous(d, i) = v
            end do
          end do
          if (size(this%taken) > 0) call problem%kernels%sweep_momentum(this%n_grouped, this%pair, this%hot, this%weight, &
            & this%velocity, this%impulse, parts(:, s), acceleration%beta, this%last_impulse)
          if (problem%n_subdomains > 1) call problem%shared%load(s, this%velocity)
        end associate
      end do
      if (problem%n_subdomains > 1) then
        call problem%shared%pass()
        do s = 1, size(layers)
          call problem%shared%sum_copies(s, layers(s)%velocity, mean=.true.)
        end do
      end if
      call problem%comm%sum_parts(parts, sums)
      done = inner >= least_sweeps .and. sums(1) <= change**2*sums(2)
      if (done) return
      call acceleration%steer(sums(1))
    end do
    inner = most_sweeps
  end subroutine solve_layer

  !> Keep the impulses of the layer's own contacts, and load all bodies with what they have changed by. Collective.
  subroutine hand_on(problem, layers)
    type(contact_problem_t), intent(inout) :: problem
    type(layers_t), intent(inout) :: layers(:)
    integer :: s, i, q, g

    do s = 1, size(layers)
      associate (this => layers(s), sub => problem%sub(s))
        this%impulse(:, :, :) = this%impulse - this%start_impulse
        do i = 1, size(this%taken)
          q = lane_of(i)
          g = block_of(i)
          if (this%own(i)) then
            associate (impulse => sub%impulse(lane_of(this%taken(i)), :, block_of(this%taken(i))))
              impulse(:) = this%start_impulse(q, :, g) + this%impulse(q, :, g)
            end associate
          else
            this%impulse(q, :, g) = 0.0_dp
          end if
        end do
        this%reaction(:, :) = 0.0_dp
        if (size(this%taken) > 0) call problem%kernels%add_reaction(this%pair, this%hot, this%impulse, this%reaction)
        if (problem%n_subdomains > 1) call problem%shared%load(s, this%reaction)
      end associate
    end do
    if (problem%n_subdomains > 1) then
      call problem%shared%pass()
      do s = 1, size(layers)
        call problem%shared%sum_copies(s, layers(s)%reaction, mean=.false.)
      end do
    end if
    do s = 1, size(layers)
      call load_bodies(problem%sub(s), layers(s))
    end do
  end subroutine hand_on

  !> Add to the velocities of the bodies what their reactions make of them.
  pure subroutine load_bodies(sub, this)
    type(subproblem_t), intent(in) :: sub
    type(layers_t), intent(inout) :: this
    integer :: b

    do b = 1, sub%n_bodies
      call add_inverse_mass(sub%inverse_mass(:, b), this%reaction(:, b), this%loaded(:, b))
    end do
  end subroutine load_bodies

end module gravier_layered_start
