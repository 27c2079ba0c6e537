!> What the table of groups and keys of an input file says of each of them.
module gravier_config_key
  use gravier_declared_keys, only: kind_length
  implicit none
  private
  public :: group_t, key_t
  public :: kind_integer, kind_real, kind_logical, kind_choice, kind_text

  !> what a value is
  integer, parameter :: kind_integer = 1
  integer, parameter :: kind_real = 2
  integer, parameter :: kind_logical = 3
  !> one of a few words, in quotes
  integer, parameter :: kind_choice = 4
  !> any text, in quotes
  integer, parameter :: kind_text = 5

  !> A namelist group.
  type :: group_t
    character(len=16) :: name
    !> must the file have it?
    logical :: required
    character(len=120) :: meaning
    !> may it stand more than once?
    logical :: repeated = .false.
    !> the kind of bodies (&scene bodies) to which the group belongs, and which requires it; blank: all
    character(len=16) :: bodies = ""
  end type group_t

  !> A key of a group.
  type :: key_t
    character(len=16) :: group
    character(len=28) :: name
    !> one of the kind_ constants
    integer :: kind
    !> the default, as it would be typed after the equal sign
    character(len=16) :: default
    !> a choice: the words, separated by blanks; otherwise a rule that follows "a finite real number", "an integer"
    character(len=kind_length) :: allowed
    character(len=400) :: meaning
    !> number of entries
    integer :: count = 1
    !> of several reals or logicals: the entries that may differ from 0 and .false. in 2D
    integer :: planar = 2
    character(len=24) :: unit = ""
    !> replaces the default in the reference where no constant can say it
    character(len=56) :: note = ""
    !> the choice of the same group on which it hangs whether the key may be given; blank: always
    character(len=16) :: chooser = ""
    !> the words of that choice to which the key belongs, separated by blanks
    character(len=kind_length) :: chosen = ""
    !> must each group give it? with the note "required" only: a key that has the note and a chooser, where it belongs
    logical :: required = .false.
  end type key_t

end module gravier_config_key
