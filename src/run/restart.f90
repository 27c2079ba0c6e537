!> Whether a run goes on from a checkpoint, and from which.
module gravier_restart
  implicit none
  private
  public :: restart_t

  type :: restart_t
    !> go on from the checkpoint in the output directory, if there is one
    logical :: asked = .false.
    !> also from one that was written with other loads, drives and coefficients of contact
    logical :: accepts = .false.
  end type restart_t

end module gravier_restart
