!> Where single bodies are in each step, how they move, and the forces of their contacts.
module gravier_tracked_bodies
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
  use gravier_kinds, only: dp, i8
  use gravier_text, only: to_text
  use gravier_contact_kernels, only: contact_jacobian, lane_of, block_of
  use gravier_contact_problem, only: contact_problem_t
  use gravier_decomposition, only: decomposition_t
  use gravier_physics, only: physics_t
  use gravier_diagnostic, only: diagnostic_t, diagnostic_features_t, solved_step_t, column_list_t
  implicit none
  private
  public :: tracked_bodies_t

  !> The same on every rank, but for where the bodies are kept.
  type, extends(diagnostic_t) :: tracked_bodies_t
    !> identifiers (bodies)
    integer(i8), allocatable :: id(:)
    !> whether forces and moments are columns, too
    logical :: with_forces = .false.
    !> subdomain of this rank and place in it where each body was found last, 0 on ranks that do not have it (bodies)
    integer, private, allocatable :: subdomain(:), place(:)
    !> whether the scene has each body (bodies)
    logical, private, allocatable :: exists(:)
    !> whether it is glued to a boundary (bodies)
    logical, private, allocatable :: glued(:)
    !> position without periods, velocity and spin at the end of the step; NaN of a body that the scene does not have
    !> (nd + nv, bodies) [m, m/s, rad/s]
    real(dp), private, allocatable :: value(:, :)
    !> mean force and moment of all contacts of each body in the step, about its centre in the middle of the step (nd + number of
    !> spins, bodies) [N, N m]
    real(dp), private, allocatable :: wrench(:, :)
    !> dimension
    integer, private :: nd = 0
  contains
    procedure, nopass :: features => tracked_bodies_features
    procedure :: begin => tracked_bodies_begin
    procedure :: take_step => tracked_bodies_take_step
    procedure :: measure => tracked_bodies_measure
    procedure :: columns => tracked_bodies_columns
  end type tracked_bodies_t

contains

  pure function tracked_bodies_features() result(features)
    type(diagnostic_features_t) :: features

    features%key = "tracked_bodies"
    features%meaning = "place and motion of single bodies"
    ! results.h5 has those of all bodies
    features%of_scene = .false.
    features%may_be_absent = .true.
  end function tracked_bodies_features

  !> Find the bodies. Collective.
  subroutine tracked_bodies_begin(self, decomposition, physics)
    class(tracked_bodies_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics

    associate (unused => physics)
    end associate
    self%nd = decomposition%nd
    allocate (self%subdomain(size(self%id)), self%place(size(self%id)), source=0)
    allocate (self%exists(size(self%id)), self%glued(size(self%id)))
    allocate (self%wrench(decomposition%nv, merge(size(self%id), 0, self%with_forces)), source=0.0_dp)
    allocate (self%value(self%nd + decomposition%nv, size(self%id)))
    call search(self, decomposition)
    call gather(self, decomposition)
  end subroutine tracked_bodies_begin

  !> Sum the forces of the contacts on each body, exactly the same whatever the number of ranks. Collective.
  subroutine tracked_bodies_take_step(self, step)
    class(tracked_bodies_t), intent(inout) :: self
    type(solved_step_t), intent(in) :: step
    real(dp) :: parts(size(self%wrench), size(step%problem%sub)), sums(size(self%wrench))
    integer :: s, c, b, i, j, n, first

    if (.not. self%with_forces) return
    n = size(self%wrench, 1)
    parts(:, :) = 0.0_dp
    do s = 1, size(step%problem%sub)
      associate (sub => step%problem%sub(s), view => step%halo%view(s), id => step%halo%view(s)%bodies%id)
        do c = 1, sub%n_contacts
          call view%find_ends(sub%source(c), i, j)
          do b = 1, size(self%id)
            first = (b - 1)*n
            if (id(i) == self%id(b)) call add_contact(step%problem, s, c, 1, parts(first + 1:first + n, s))
            ! a boundary has a number below 0
            if (j <= 0) cycle
            if (id(j) == self%id(b)) call add_contact(step%problem, s, c, 2, parts(first + 1:first + n, s))
          end do
        end do
      end associate
    end do
    call step%decomposition%comm%sum_parts(parts, sums)
    do b = 1, size(self%id)
      self%wrench(:, b) = sums((b - 1)*n + 1:b*n)/step%physics%h
    end do
  end subroutine tracked_bodies_take_step

  !> Add the impulse of a contact, without what an attraction hides of it, on its candidate (1) or antagonist (2), and its moment.
  pure subroutine add_contact(problem, s, c, side, impulse)
    type(contact_problem_t), intent(in) :: problem
    !> subdomain and contact
    integer, intent(in) :: s, c, side
    !> without friction contacts turn no body: its last entries are left [N s, N m s]
    real(dp), intent(inout) :: impulse(:)
    real(dp) :: jacobian(problem%nc, problem%nv, 2), r(problem%nc)
    integer :: d

    associate (sub => problem%sub(s))
      call contact_jacobian(problem%kernels, sub%hot, c, jacobian(:, :, 1), jacobian(:, :, 2))
      r(:) = sub%impulse(lane_of(c), :, block_of(c))
      r(1) = sub%normal_impulse(c)
      do d = 1, min(problem%nv, size(impulse))
        impulse(d) = impulse(d) + sum(jacobian(:, d, side)*r)
      end do
    end associate
  end subroutine add_contact

  !> Measure each body. Bodies are looked for only where one of them is no longer where it was, or may have entered. Collective.
  subroutine tracked_bodies_measure(self, step)
    class(tracked_bodies_t), intent(inout) :: self
    type(solved_step_t), intent(in) :: step
    logical :: existed(size(self%id))

    existed(:) = self%exists
    call gather(self, step%decomposition)
    if (.not. (any(existed .and. .not. self%exists) .or. step%others .and. .not. all(self%exists))) return
    call search(self, step%decomposition)
    call gather(self, step%decomposition)
  end subroutine tracked_bodies_measure

  !> Find where this rank has the bodies.
  subroutine search(self, decomposition)
    type(tracked_bodies_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    integer :: s, k, b

    self%place(:) = 0
    do s = 1, size(decomposition%owned)
      do k = 1, decomposition%owned(s)%n
        do b = 1, size(self%id)
          if (decomposition%owned(s)%id(k) /= self%id(b)) cycle
          self%subdomain(b) = s
          self%place(b) = k
        end do
      end do
    end do
  end subroutine search

  !> Collect the values of the bodies that are where they were found last. Collective.
  subroutine gather(self, decomposition)
    type(tracked_bodies_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    !> the values of each body, and 1 where there are some, 2 of a body that is glued
    real(dp) :: parts((size(self%value, 1) + 1)*size(self%id), size(decomposition%owned))
    real(dp) :: sums((size(self%value, 1) + 1)*size(self%id))
    integer :: b, n, first

    n = size(self%value, 1)
    parts(:, :) = 0.0_dp
    do b = 1, size(self%id)
      if (.not. is_kept(self, decomposition, b)) cycle
      associate (bodies => decomposition%owned(self%subdomain(b)), k => self%place(b), part => parts(:, self%subdomain(b)))
        first = (b - 1)*(n + 1)
        part(first + 1:first + self%nd) = bodies%position(:, k)
        part(first + self%nd + 1:first + n) = bodies%velocity(:, k)
        if (bodies%ni > 0) call decomposition%period%unwrap(bodies%image(:, k), part(first + 1:first + self%nd), &
          & part(first + self%nd + 1:first + 2*self%nd))
        part(first + n + 1) = merge(2.0_dp, 1.0_dp, bodies%glued(k) > 0)
      end associate
    end do
    call decomposition%comm%sum_parts(parts, sums)
    do b = 1, size(self%id)
      first = (b - 1)*(n + 1)
      self%exists(b) = sums(first + n + 1) > 0.0_dp
      self%glued(b) = sums(first + n + 1) > 1.5_dp
      self%value(:, b) = sums(first + 1:first + n)
      if (.not. self%exists(b)) self%value(:, b) = ieee_value(0.0_dp, ieee_quiet_nan)
    end do
  end subroutine gather

  !> Whether this rank has a body where it was found last.
  pure logical function is_kept(self, decomposition, b)
    type(tracked_bodies_t), intent(in) :: self
    type(decomposition_t), intent(in) :: decomposition
    !> number of the body
    integer, intent(in) :: b

    is_kept = .false.
    if (self%place(b) == 0) return
    associate (bodies => decomposition%owned(self%subdomain(b)))
      if (self%place(b) > bodies%n) return
      is_kept = bodies%id(self%place(b)) == self%id(b)
    end associate
  end function is_kept

  !> Columns with the names of a bodies file and the identifier; forces and moments follow. A glued body has no moment of its own.
  subroutine tracked_bodies_columns(self, list)
    class(tracked_bodies_t), intent(in) :: self
    type(column_list_t), intent(inout) :: list
    character(len=5) :: names(9)
    character(len=2) :: forces(6)
    real(dp) :: value
    integer :: b, i

    names(:) = ["x    ", "y    ", "z    ", "vx   ", "vy   ", "vz   ", "wx   ", "wy   ", "wz   "]
    forces(:) = ["fx", "fy", "fz", "mx", "my", "mz"]
    if (self%nd == 2) names(1:5) = ["x    ", "y    ", "vx   ", "vy   ", "omega"]
    if (self%nd == 2) forces(3) = "mz"
    do b = 1, size(self%id)
      do i = 1, size(self%value, 1)
        call list%add("body_"//trim(names(i))//":"//to_text(self%id(b)), self%value(i, b))
      end do
      if (.not. self%with_forces) cycle
      do i = 1, size(self%wrench, 1)
        value = self%wrench(i, b)
        if (.not. self%exists(b) .or. (self%glued(b) .and. i > self%nd)) value = ieee_value(0.0_dp, ieee_quiet_nan)
        call list%add("body_"//forces(i)//":"//to_text(self%id(b)), value)
      end do
    end do
  end subroutine tracked_bodies_columns

end module gravier_tracked_bodies
