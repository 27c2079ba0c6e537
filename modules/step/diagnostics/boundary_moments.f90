!> The moment of the contacts on each boundary about its pivot, as a drum, a vane or the cylinder of a shear cell feels it.
module gravier_boundary_moments
  use gravier_kinds, only: dp
  use gravier_rotation, only: cross
  use gravier_contact_kernels, only: lanes, lane_of, block_of, moment_vectors
  use gravier_contact_problem, only: contact_problem_t
  use gravier_contact_places, only: find_contact_place
  use gravier_boundary, only: boundary_t
  use gravier_decomposition, only: decomposition_t
  use gravier_halo, only: local_bodies_t
  use gravier_physics, only: physics_t
  use gravier_diagnostic, only: diagnostic_t, diagnostic_features_t, solved_step_t, column_list_t, name_length
  use gravier_boundary_forces, only: name_in_columns
  implicit none
  private
  public :: boundary_moments_t

  !> Of each boundary, the same on every rank.
  type, extends(diagnostic_t) :: boundary_moments_t
    !> as columns can have them (boundaries)
    character(len=name_length), private, allocatable :: name(:)
    !> mean moment of the contacts in the step about the place of the pivot at q_m: about the third axis in 2D, about three in 3D
    !> (1 or 3, boundaries) [N m]
    real(dp), allocatable :: moment(:, :)
    !> of the middle of the step (3, boundaries) [m]
    real(dp), private, allocatable :: pivot(:, :)
  contains
    procedure, nopass :: features => boundary_moments_features
    procedure :: begin => boundary_moments_begin
    procedure :: take_step => boundary_moments_take_step
    procedure :: measure => boundary_moments_measure
    procedure :: columns => boundary_moments_columns
  end type boundary_moments_t

contains

  pure function boundary_moments_features() result(features)
    type(diagnostic_features_t) :: features

    features%key = "boundary_moments"
    features%meaning = "write the moment of the contacts on each boundary about its pivot"
    features%of_scene = .false.
  end function boundary_moments_features

  !> Take the names of the boundaries.
  subroutine boundary_moments_begin(self, decomposition, physics)
    class(boundary_moments_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics
    integer :: b

    associate (boundaries => decomposition%boundaries, unused => physics)
      allocate (self%name(size(boundaries)))
      allocate (self%moment(2*decomposition%nd - 3, size(boundaries)), self%pivot(3, size(boundaries)), source=0.0_dp)
      do b = 1, size(boundaries)
        self%name(b) = name_in_columns(boundaries(b)%name)
      end do
    end associate
  end subroutine boundary_moments_begin

  !> Keep the pivots of the middle of the step, where contacts have their places: projections of overlaps may shift them.
  subroutine boundary_moments_take_step(self, step)
    class(boundary_moments_t), intent(inout) :: self
    type(solved_step_t), intent(in) :: step
    integer :: b

    do b = 1, size(self%pivot, 2)
      self%pivot(:, b) = step%decomposition%boundaries(b)%pivot
    end do
  end subroutine boundary_moments_take_step

  !> Sum the moments of the contacts, exactly the same whatever the number of ranks. Collective.
  subroutine boundary_moments_measure(self, step)
    class(boundary_moments_t), intent(inout) :: self
    type(solved_step_t), intent(in) :: step
    real(dp) :: parts(size(self%moment), size(step%problem%sub)), sums(size(self%moment)), moment(3)
    integer :: s, c, b, n, first

    if (size(self%moment) == 0) return
    n = size(self%moment, 1)
    parts(:, :) = 0.0_dp
    do s = 1, size(step%problem%sub)
      associate (sub => step%problem%sub(s))
        do c = 1, sub%n_contacts
          if (all(sub%pair(:, c) <= sub%n_grains)) cycle
          b = sub%boundary(sub%pair(merge(2, 1, sub%pair(2, c) > sub%n_grains), c))
          if (b == 0) cycle
          call find_moment(step%problem, step%halo%view(s), s, c, step%decomposition%boundaries(b), self%pivot(:, b), moment)
          if (sub%pair(2, c) > sub%n_grains) moment(:) = -moment
          first = (b - 1)*n
          parts(first + 1:first + n, s) = parts(first + 1:first + n, s) + moment(4 - n:3)
        end do
      end associate
    end do
    call step%decomposition%comm%sum_parts(parts, sums)
    do b = 1, size(self%moment, 2)
      self%moment(:, b) = sums((b - 1)*n + 1:b*n)/step%physics%h
    end do
  end subroutine boundary_moments_measure

  !> Moment of the impulse of a contact on its candidate about the pivot of a boundary, with the moments of rolling and pivoting
  !> friction [N m s].
  pure subroutine find_moment(problem, view, s, c, boundary, pivot, moment)
    type(contact_problem_t), intent(in) :: problem
    type(local_bodies_t), intent(in) :: view
    !> subdomain and contact
    integer, intent(in) :: s, c
    type(boundary_t), intent(in) :: boundary
    !> in the middle of the step [m]
    real(dp), intent(in) :: pivot(3)
    real(dp), intent(out) :: moment(3)
    real(dp) :: p(3), place(3), arm(3), rolling(lanes, 3)
    integer :: d

    p(:) = 0.0_dp
    place(:) = 0.0_dp
    associate (sub => problem%sub(s), nd => problem%nd, row => problem%row, q => lane_of(c), g => block_of(c))
      call problem%impulse_on_candidate(s, c, p(1:nd))
      call find_contact_place(problem%kernels, view, sub, c, place(1:nd))
      ! disks and spheres touch a boundary on its surface; all other contacts are half-way between the surfaces
      if (row%arm_i == 0 .and. view%list%antagonist(sub%source(c)) < 0) &
        & place(1:nd) = place(1:nd) - 0.5_dp*sub%gap(c)*sub%hot(q, 1:nd, g)
      call boundary%find_image(place(1:nd), arm)
      arm(:) = arm - pivot
      ! a plane has no middle: its image is the one nearest to the pivot
      if (boundary%is_plane()) then
        do d = 1, nd
          if (boundary%period(d) > 0.0_dp) arm(d) = arm(d) - boundary%period(d)*anint(arm(d)/boundary%period(d))
        end do
      end if
      moment(:) = cross(arm, p)
      if (row%rolling_radius == 0) return
      if (nd == 2) then
        moment(3) = moment(3) + sub%hot(q, row%rolling_radius, g)*sub%impulse(q, 3, g)
      else
        call moment_vectors(sub%hot(:, :, g), sub%impulse(:, :, g), rolling)
        moment(:) = moment + sub%hot(q, row%rolling_radius, g)*rolling(q, :)
      end if
    end associate
  end subroutine find_moment

  subroutine boundary_moments_columns(self, list)
    class(boundary_moments_t), intent(in) :: self
    type(column_list_t), intent(inout) :: list
    character(len=*), parameter :: axes = "xyz"
    integer :: b, d, axis

    do b = 1, size(self%moment, 2)
      do d = 1, size(self%moment, 1)
        axis = 3 - size(self%moment, 1) + d
        call list%add("moment_"//axes(axis:axis)//":"//trim(self%name(b)), self%moment(d, b))
      end do
    end do
  end subroutine boundary_moments_columns

end module gravier_boundary_moments
