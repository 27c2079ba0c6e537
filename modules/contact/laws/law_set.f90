!> The laws of a scene by pairs of materials.
module gravier_law_set
  use gravier_kinds, only: dp
  use gravier_contact_coefficients, only: coefficients_t
  use gravier_contact_law, only: law_key_t
  use gravier_law_registry, only: law_holder_t, registered_laws
  implicit none
  private
  public :: law_set_t

  !> Materials have numbers from 1 on; what has none, 0, is under the values of the scene.
  type :: law_set_t
    !> laws so far
    integer :: n = 0
    type(law_holder_t), allocatable :: of(:)
    !> place in `of` of the law of two materials, 0 where the scene's values hold (materials, materials)
    integer, allocatable :: of_pair(:, :)
    !> some law attracts, has a memory
    logical :: attracts = .false., remembers = .false.
    !> the largest of all laws; range in [m]
    type(coefficients_t) :: largest
    real(dp) :: range = 0.0_dp
  contains
    procedure :: init => law_set_init
    procedure :: add => law_set_add
    procedure :: number_of => law_set_number_of
  end type law_set_t

contains

  !> No law yet, for so many materials and at most so many laws.
  subroutine law_set_init(self, n_materials, n_laws)
    class(law_set_t), intent(out) :: self
    integer, intent(in) :: n_materials, n_laws

    allocate (self%of_pair(n_materials, n_materials), source=0)
    allocate (self%of(n_laws))
  end subroutine law_set_init

  !> Add the law of materials a and b: of a registered kind, with values under the names of keys.
  subroutine law_set_add(self, a, b, kind, names, values)
    class(law_set_t), intent(inout) :: self
    integer, intent(in) :: a, b
    character(len=*), intent(in) :: kind
    !> (keys): among them those of the law
    character(len=*), intent(in) :: names(:)
    real(dp), intent(in) :: values(:)
    type(law_holder_t), allocatable :: laws(:)
    type(law_key_t), allocatable :: keys(:)
    real(dp), allocatable :: own(:)
    integer :: l, k, at

    call registered_laws(laws)
    do l = 1, size(laws)
      if (laws(l)%law%kind() /= kind) cycle
      call laws(l)%law%keys(keys)
      allocate (own(size(keys)))
      do k = 1, size(keys)
        do at = 1, size(names)
          if (names(at) == keys(k)%name) own(k) = values(at)
        end do
      end do
      call laws(l)%law%set(own)
      self%n = self%n + 1
      call move_alloc(laws(l)%law, self%of(self%n)%law)
      exit
    end do
    self%of_pair(a, b) = self%n
    self%of_pair(b, a) = self%n
    associate (law => self%of(self%n)%law)
      self%attracts = self%attracts .or. law%attracts
      self%remembers = self%remembers .or. law%remembers
      call self%largest%raise_to(law%largest)
      self%range = max(self%range, law%range)
    end associate
  end subroutine law_set_add

  !> Place of the law of two materials, 0 where the scene's values hold.
  pure integer function law_set_number_of(self, a, b) result(l)
    class(law_set_t), intent(in) :: self
    integer, intent(in) :: a, b

    l = 0
    if (min(a, b) > 0) l = self%of_pair(a, b)
  end function law_set_number_of

end module gravier_law_set
