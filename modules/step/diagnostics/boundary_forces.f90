!> What the grains do to each boundary in a step, and where it is.
module gravier_boundary_forces
  use gravier_kinds, only: dp
  use gravier_decomposition, only: decomposition_t
  use gravier_physics, only: physics_t
  use gravier_diagnostic, only: diagnostic_t, diagnostic_features_t, solved_step_t, column_list_t, name_length
  implicit none
  private
  public :: boundary_forces_t, name_in_columns

  !> Of each boundary, the same on every rank.
  type, extends(diagnostic_t) :: boundary_forces_t
    !> as columns can have them (boundaries)
    character(len=name_length), allocatable :: name(:)
    !> mean force of the grains in the step [N], and a point of the boundary at its end [m] (nd, boundaries)
    real(dp), private, allocatable :: force(:, :), position(:, :)
  contains
    procedure, nopass :: features => boundary_forces_features
    procedure :: begin => boundary_forces_begin
    procedure :: measure => boundary_forces_measure
    procedure :: columns => boundary_forces_columns
  end type boundary_forces_t

contains

  pure function boundary_forces_features() result(features)
    type(diagnostic_features_t) :: features

    features%key = "boundary_forces"
    features%meaning = "write force and place of each boundary"
    ! results.h5 has both in the table of the boundaries
    features%of_scene = .false.
  end function boundary_forces_features

  !> The name of a boundary in the names of its columns: a cell of the head of a table holds neither a comma nor a quote.
  pure function name_in_columns(name) result(text)
    character(len=*), intent(in) :: name
    character(len=len(name)) :: text
    integer :: k

    text = name
    do k = 1, len_trim(name)
      if (scan(name(k:k), ',"') > 0) text(k:k) = "_"
    end do
  end function name_in_columns

  !> Take the names of the boundaries.
  subroutine boundary_forces_begin(self, decomposition, physics)
    class(boundary_forces_t), intent(inout) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(physics_t), intent(in) :: physics
    real(dp) :: place(3)
    integer :: b

    associate (boundaries => decomposition%boundaries, unused => physics)
      allocate (self%name(size(boundaries)))
      allocate (self%force(decomposition%nd, size(boundaries)), self%position(decomposition%nd, size(boundaries)), source=0.0_dp)
      do b = 1, size(boundaries)
        self%name(b) = name_in_columns(boundaries(b)%name)
        call boundaries(b)%find_place(place)
        self%position(:, b) = place(1:decomposition%nd)
      end do
    end associate
  end subroutine boundary_forces_begin

  subroutine boundary_forces_measure(self, step)
    class(boundary_forces_t), intent(inout) :: self
    type(solved_step_t), intent(in) :: step
    real(dp) :: place(3)
    integer :: b

    do b = 1, size(self%force, 2)
      self%force(:, b) = step%boundary_impulses(:, b)/step%physics%h
      call step%decomposition%boundaries(b)%find_place(place)
      self%position(:, b) = place(1:size(self%position, 1))
    end do
  end subroutine boundary_forces_measure

  subroutine boundary_forces_columns(self, list)
    class(boundary_forces_t), intent(in) :: self
    type(column_list_t), intent(inout) :: list
    character(len=*), parameter :: axes = "xyz"
    integer :: b, d

    do b = 1, size(self%force, 2)
      do d = 1, size(self%force, 1)
        call list%add("force_"//axes(d:d)//":"//trim(self%name(b)), self%force(d, b))
      end do
      do d = 1, size(self%force, 1)
        call list%add("position_"//axes(d:d)//":"//trim(self%name(b)), self%position(d, b))
      end do
    end do
  end subroutine boundary_forces_columns

end module gravier_boundary_forces
