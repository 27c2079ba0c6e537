!> Materials of what meets, and the pairs of materials whose bodies pass through each other.
module gravier_material_filter
  use gravier_body_store, only: body_set_t
  use gravier_boundary, only: boundary_t
  implicit none
  private
  public :: material_filter_t, material_of

  type :: material_filter_t
    !> whether bodies of two materials pass through each other (materials, materials); not allocated where none do
    logical, allocatable :: passes(:, :)
  contains
    procedure, non_overridable :: add => material_filter_add
    procedure, non_overridable :: lets_pass => material_filter_lets_pass
    procedure, non_overridable :: find_passed => material_filter_find_passed
  end type material_filter_t

contains

  !> Let bodies of materials a and b, of `n` materials, pass through each other.
  pure subroutine material_filter_add(self, a, b, n)
    class(material_filter_t), intent(inout) :: self
    integer, intent(in) :: a, b, n

    if (.not. allocated(self%passes)) allocate (self%passes(n, n), source=.false.)
    self%passes(a, b) = .true.
    self%passes(b, a) = .true.
  end subroutine material_filter_add

  !> Whether two bodies, i of a set and j, a body or boundary -j, pass through each other.
  pure logical function material_filter_lets_pass(self, bodies, boundaries, i, j) result(passes)
    class(material_filter_t), intent(in) :: self
    type(body_set_t), intent(in) :: bodies
    type(boundary_t), intent(in) :: boundaries(:)
    integer, intent(in) :: i, j
    integer :: a, b

    passes = allocated(self%passes)
    if (.not. passes) return
    a = material_of(bodies, boundaries, i)
    b = material_of(bodies, boundaries, j)
    passes = min(a, b) > 0
    if (passes) passes = self%passes(a, b)
  end function material_filter_lets_pass

  !> Which boundaries bodies of a material pass through.
  pure subroutine material_filter_find_passed(self, material, boundaries, passed)
    class(material_filter_t), intent(in) :: self
    !> 0 for none
    integer, intent(in) :: material
    type(boundary_t), intent(in) :: boundaries(:)
    !> (boundaries)
    logical, intent(out) :: passed(:)
    integer :: b

    passed(:) = .false.
    if (.not. allocated(self%passes) .or. material == 0) return
    do b = 1, size(boundaries)
      if (boundaries(b)%material > 0) passed(b) = self%passes(material, boundaries(b)%material)
    end do
  end subroutine material_filter_find_passed

  !> Number of the material of body `k` of a set, or of boundary -k; 0 for none. Grains glued to a boundary that has one are of its
  !> material.
  pure integer function material_of(bodies, boundaries, k) result(material)
    type(body_set_t), intent(in) :: bodies
    type(boundary_t), intent(in) :: boundaries(:)
    integer, intent(in) :: k
    integer :: b

    if (k < 0) then
      material = boundaries(-k)%material
      return
    end if
    material = bodies%material(k)
    b = bodies%glued(k)
    if (b == 0) return
    if (boundaries(b)%material > 0) material = boundaries(b)%material
  end function material_of

end module gravier_material_filter
