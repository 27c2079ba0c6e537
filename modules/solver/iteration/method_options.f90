!> What a method says of itself, and what the input says to a method.
module gravier_method_options
  use gravier_kinds, only: dp
  implicit none
  private
  public :: method_features_t, method_options_t, held_list_t, default_always, default_on_active

  integer, parameter :: name_length = 16, meaning_length = 120

  !> where acceleration is the default: never, on all problems, on those of active contacts (`contacts` of &enriched) only
  integer, parameter :: default_never = 0, default_always = 1, default_on_active = 2

  !> What a method is called, and what it serves. The input, its checks and its reference are made from this.
  type :: method_features_t
    !> its word in the input, and what the reference says of it
    character(len=name_length) :: name = ""
    character(len=meaning_length) :: meaning = ""
    !> it works on subdomains; without, on one domain only
    logical :: decomposes = .true.
    !> contacts may have moments of rolling and pivoting friction
    logical :: moments = .false.
    !> one of the constants above
    integer :: accelerated_by_default = default_never
    !> it takes a `relaxation` factor, which it adapts itself where none is given; acceleration needs that
    logical :: relaxes = .false.
    !> its search direction is for active contacts unless `contacts` of &enriched says otherwise
    logical :: active_by_default = .false.
    !> its interface problem is for MUMPS alone
    logical :: direct_interface_only = .false.
  end type method_features_t

  !> What &solver and &enriched say to a method.
  type :: method_options_t
    integer :: sweeps = 1
    logical :: acceleration = .false.
    !> a given relaxation factor, in (0, 1]
    logical :: relaxation_given = .false.
    real(dp) :: relaxation = 1.0_dp
    !> search direction l: on active contacts only; given, in units of 1/W_aa or else in kg
    logical :: active_only = .false., direction_given = .false., direction_relative = .true.
    real(dp) :: direction = 0.0_dp
    !> interface problems by conjugate gradients instead of MUMPS, their tolerance and largest number of iterations
    logical :: interface_cg = .false.
    real(dp) :: cg_tolerance = 1.0e-12_dp
    integer :: cg_max_iterations = 10000
  end type method_options_t

  !> An array that a method holds beyond those of all methods, for the report of memory.
  type :: held_t
    character(len=48) :: name = ""
    !> an entry for each contact, or for each body in contact
    logical :: of_contacts = .true.
    !> bytes of a value, values of an entry
    integer :: bytes = 8, values = 0
  end type held_t

  type :: held_list_t
    integer :: n = 0
    type(held_t) :: item(16)
  contains
    procedure :: add => held_list_add
  end type held_list_t

contains

  !> One more array, of `values` numbers of `bytes` for each contact, or for each body in contact.
  pure subroutine held_list_add(self, name, of_contacts, bytes, values)
    class(held_list_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    logical, intent(in) :: of_contacts
    integer, intent(in) :: bytes, values

    self%n = self%n + 1
    self%item(self%n) = held_t(name, of_contacts, bytes, values)
  end subroutine held_list_add

end module gravier_method_options
