!> The laws of a scene: by pairs of materials and, for all other pairs, by default.
!>
!> A default law is an ordinary one of kind `coulomb` with the coefficients of &scene, for pairs of grains, or of the &boundary that
!> takes part.
module gravier_law_set
  use gravier_kinds, only: dp
  use gravier_declared_keys, only: declared_key_t
  use gravier_contact_coefficients, only: coefficients_t
  use gravier_contact_law, only: contact_law_t, contact_pair_t, contact_terms_t
  use gravier_material_filter, only: material_filter_t
  use gravier_law_registry, only: law_holder_t, registered_laws
  implicit none
  private
  public :: law_set_t

  !> keys of a default law, which are components of coefficients_t
  character(len=24), parameter :: coulomb_names(5) = [character(len=24) :: "friction", "restitution", "tangential_restitution", &
    & "rolling_friction", "pivoting_friction"]

  !> A law of the scene.
  type :: scene_law_t
    class(contact_law_t), allocatable :: law
    !> of a law that has the same terms for all its pairs: these, but for the free gap
    type(contact_terms_t) :: terms
  end type scene_law_t

  !> Materials have numbers from 1 on; what has none, 0, is under the default laws.
  type :: law_set_t
    !> laws of pairs of materials so far
    integer :: n = 0
    !> laws of pairs of materials from 1 on; the default law of grains at 0, that of boundary b at -b (-boundaries to laws)
    type(scene_law_t), allocatable :: of(:)
    !> place in `of` of the law of two materials, 0 where a default law holds (materials, materials)
    integer, private, allocatable :: of_pair(:, :)
    !> some law has other terms for each pair
    logical :: varies = .false.
    !> some law has restitution, or a default law had
    logical :: returns = .false.
    !> the largest coefficient of normal restitution of these
    real(dp) :: most_restitution = 0.0_dp
    !> some law attracts, has a memory, has springs, is one of spheres alone
    logical :: attracts = .false., remembers = .false., yields = .false., of_spheres = .false.
    !> some law has pairs that break for good where they open or slide in a step
    logical :: breaks = .false.
    !> smallest slip by which the friction of a law changes [m/s]
    real(dp) :: slip_scale = huge(1.0_dp)
    !> the largest of all laws; range in [m]
    type(coefficients_t) :: largest
    real(dp) :: range = 0.0_dp
    !> of the pairs of materials whose law is no contact
    type(material_filter_t) :: filter
  contains
    procedure :: init => law_set_init
    procedure :: add => law_set_add
    procedure :: set_default => law_set_set_default
    procedure :: number_of => law_set_number_of
    procedure :: default_of => law_set_default_of
    procedure :: varies_at => law_set_varies_at
  end type law_set_t

contains

  !> No law yet but default laws without friction and restitution, for so many materials and at most so many laws.
  subroutine law_set_init(self, n_materials, n_laws)
    class(law_set_t), intent(out) :: self
    integer, intent(in) :: n_materials, n_laws

    allocate (self%of_pair(n_materials, n_materials), source=0)
    allocate (self%of(0:n_laws))
    call self%set_default(0, coefficients_t())
  end subroutine law_set_init

  !> Set the default law of pairs of grains, or of pairs in which boundary `b` takes part.
  subroutine law_set_set_default(self, b, coefficients)
    class(law_set_t), intent(inout) :: self
    !> 0 for grains
    integer, intent(in) :: b
    type(coefficients_t), intent(in) :: coefficients
    type(scene_law_t), allocatable :: longer(:)
    real(dp) :: values(size(coulomb_names))
    integer :: l

    if (.not. allocated(self%of)) allocate (self%of(0:0))
    if (-b < lbound(self%of, 1)) then
      allocate (longer(-b:ubound(self%of, 1)))
      do l = lbound(self%of, 1), ubound(self%of, 1)
        call move_law(self%of(l), longer(l))
      end do
      call move_alloc(longer, self%of)
    end if
    values(1) = coefficients%friction
    values(2) = coefficients%restitution
    values(3) = coefficients%tangential_restitution
    values(4) = coefficients%rolling_friction
    values(5) = coefficients%pivoting_friction
    self%returns = self%returns .or. any(values(2:3) > 0.0_dp)
    self%most_restitution = max(self%most_restitution, coefficients%restitution)
    call make_law("coulomb", coulomb_names, values, self%of(-b))
  end subroutine law_set_set_default

  pure subroutine move_law(from, to)
    type(scene_law_t), intent(inout) :: from, to

    if (allocated(from%law)) call move_alloc(from%law, to%law)
    to%terms = from%terms
  end subroutine move_law

  !> A law of a registered kind, with values under the names of keys.
  subroutine make_law(kind, names, values, one)
    character(len=*), intent(in) :: kind
    !> (keys): among them those of the law
    character(len=*), intent(in) :: names(:)
    real(dp), intent(in) :: values(:)
    type(scene_law_t), intent(inout) :: one
    type(law_holder_t), allocatable :: laws(:)
    type(declared_key_t), allocatable :: keys(:)
    type(contact_pair_t) :: pair
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
      call move_alloc(laws(l)%law, one%law)
      exit
    end do
    if (.not. one%law%is_constant) return
    pair%terms%rolling_friction = one%law%largest%rolling_friction
    pair%terms%pivoting_friction = one%law%largest%pivoting_friction
    call one%law%evaluate(pair)
    one%terms = pair%terms
  end subroutine make_law

  !> Add the law of materials a and b: of a registered kind, with values under the names of keys.
  subroutine law_set_add(self, a, b, kind, names, values)
    class(law_set_t), intent(inout) :: self
    integer, intent(in) :: a, b
    character(len=*), intent(in) :: kind
    !> (keys): among them those of the law
    character(len=*), intent(in) :: names(:)
    real(dp), intent(in) :: values(:)

    self%n = self%n + 1
    call make_law(kind, names, values, self%of(self%n))
    self%of_pair(a, b) = self%n
    self%of_pair(b, a) = self%n
    associate (law => self%of(self%n)%law)
      self%attracts = self%attracts .or. law%attracts
      self%remembers = self%remembers .or. law%remembers
      self%breaks = self%breaks .or. law%breaks
      self%slip_scale = min(self%slip_scale, law%slip_scale)
      if (law%passes) call self%filter%add(a, b, size(self%of_pair, 1))
      self%yields = self%yields .or. law%yields
      self%of_spheres = self%of_spheres .or. law%of_spheres
      self%varies = self%varies .or. .not. law%is_constant
      self%returns = self%returns .or. max(law%largest%restitution, law%largest%tangential_restitution) > 0.0_dp
      call self%largest%raise_to(law%largest)
      self%most_restitution = max(self%most_restitution, law%largest%restitution)
      self%range = max(self%range, law%range)
    end associate
  end subroutine law_set_add

  !> Place of the law of two materials, 0 where a default law holds.
  pure integer function law_set_number_of(self, a, b) result(l)
    class(law_set_t), intent(in) :: self
    integer, intent(in) :: a, b

    l = 0
    if (min(a, b) > 0) l = self%of_pair(a, b)
  end function law_set_number_of

  !> Place of the default law of pairs of grains, b = 0, or of pairs in which boundary `b` takes part; a boundary that has none is
  !> under that of grains.
  pure integer function law_set_default_of(self, b) result(l)
    class(law_set_t), intent(in) :: self
    integer, intent(in) :: b

    l = 0
    if (.not. allocated(self%of)) return
    if (-b < lbound(self%of, 1)) return
    if (allocated(self%of(-b)%law)) l = -b
  end function law_set_default_of

  !> Whether the law at place `l` has other terms for each pair.
  pure logical function law_set_varies_at(self, l) result(varies)
    class(law_set_t), intent(in) :: self
    integer, intent(in) :: l

    varies = self%varies
    if (varies) varies = .not. self%of(l)%law%is_constant
  end function law_set_varies_at

end module gravier_law_set
