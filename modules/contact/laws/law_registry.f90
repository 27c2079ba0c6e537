!> The laws of contact there are. A new law is a file in modules/contact/laws and a line here.
module gravier_law_registry
  use gravier_contact_law, only: contact_law_t, contact_terms_t, law_key_t
  implicit none
  private
  public :: law_holder_t, registered_key_t, registered_laws, registered_keys, kind_length

  !> room for all kinds, with blanks between
  integer, parameter :: kind_length = 160

  type :: law_holder_t
    class(contact_law_t), allocatable :: law
    !> of a law that has the same terms for all its pairs: these, but for the play
    type(contact_terms_t) :: terms
  end type law_holder_t

  !> A key with the kinds of law that have it.
  type :: registered_key_t
    type(law_key_t) :: key
    !> with blanks between
    character(len=kind_length) :: kinds = ""
  end type registered_key_t

contains

  !> One law of each kind.
  subroutine registered_laws(laws)
    type(law_holder_t), allocatable, intent(out) :: laws(:)

    allocate (laws(0))
    !&<
    block; use gravier_coulomb_law, only: coulomb_law_t; call add(coulomb_law_t()); end block
    block; use gravier_frictionless_law, only: frictionless_law_t; call add(frictionless_law_t()); end block
    block; use gravier_velocity_law, only: velocity_law_t; call add(velocity_law_t()); end block
    block; use gravier_adhesive_law, only: adhesive_law_t; call add(adhesive_law_t()); end block
    block; use gravier_capillary_law, only: capillary_law_t; call add(capillary_law_t()); end block
    block; use gravier_bonded_law, only: bonded_law_t; call add(bonded_law_t()); end block
    !&>

  contains

    subroutine add(law)
      class(contact_law_t), intent(in) :: law
      type(law_holder_t), allocatable :: longer(:)
      integer :: k

      allocate (longer(size(laws) + 1))
      do k = 1, size(laws)
        call move_alloc(laws(k)%law, longer(k)%law)
      end do
      allocate (longer(size(longer))%law, source=law)
      call move_alloc(longer, laws)
    end subroutine add

  end subroutine registered_laws

  !> The keys of all laws, each once, and all kinds.
  subroutine registered_keys(keys, n, kinds)
    !> (n and more)
    type(registered_key_t), allocatable, intent(out) :: keys(:)
    integer, intent(out) :: n
    !> with blanks between
    character(len=kind_length), intent(out) :: kinds
    type(law_holder_t), allocatable :: laws(:)
    type(law_key_t), allocatable :: own(:)
    integer :: l, k, at, round

    call registered_laws(laws)
    do round = 1, 2
      n = 0
      kinds = ""
      do l = 1, size(laws)
        kinds = adjustl(trim(kinds)//" "//laws(l)%law%kind())
        call laws(l)%law%keys(own)
        do k = 1, size(own)
          if (round == 1) n = n + 1
          if (round == 2) call note(own(k), laws(l)%law%kind())
        end do
      end do
      if (round == 1) allocate (keys(n))
    end do

  contains

    subroutine note(key, kind)
      type(law_key_t), intent(in) :: key
      character(len=*), intent(in) :: kind

      do at = 1, n
        if (keys(at)%key%name == key%name) exit
      end do
      if (at > n) keys(at)%key = key
      n = max(n, at)
      keys(at)%kinds = adjustl(trim(keys(at)%kinds)//" "//kind)
    end subroutine note

  end subroutine registered_keys

end module gravier_law_registry
