!> The diagnostics there are. A new diagnostic is a file in modules/step/diagnostics and a line here.
module gravier_diagnostic_registry
  use gravier_diagnostic, only: diagnostic_t
  implicit none
  private
  public :: diagnostic_holder_t, registered_diagnostics, diagnostic_place

  type :: diagnostic_holder_t
    class(diagnostic_t), allocatable :: item
  end type diagnostic_holder_t

contains

  !> One diagnostic of each kind, in the order of their columns.
  subroutine registered_diagnostics(diagnostics)
    type(diagnostic_holder_t), allocatable, intent(out) :: diagnostics(:)

    allocate (diagnostics(0))
    !&<
    block; use gravier_energy_balance, only: energy_balance_t; call add(energy_balance_t()); end block
    block; use gravier_mean_stress, only: mean_stress_t; call add(mean_stress_t()); end block
    block; use gravier_contact_structure, only: contact_structure_t; call add(contact_structure_t()); end block
    block; use gravier_boundary_forces, only: boundary_forces_t; call add(boundary_forces_t()); end block
    !&>

  contains

    subroutine add(diagnostic)
      class(diagnostic_t), intent(in) :: diagnostic
      type(diagnostic_holder_t), allocatable :: longer(:)
      integer :: k

      allocate (longer(size(diagnostics) + 1))
      do k = 1, size(diagnostics)
        call move_alloc(diagnostics(k)%item, longer(k)%item)
      end do
      allocate (longer(size(longer))%item, source=diagnostic)
      call move_alloc(longer, diagnostics)
    end subroutine add

  end subroutine registered_diagnostics

  !> Place of the diagnostic with that key among those of `registered_diagnostics`; 0: there is none.
  integer function diagnostic_place(key) result(place)
    character(len=*), intent(in) :: key
    type(diagnostic_holder_t), allocatable :: diagnostics(:)

    call registered_diagnostics(diagnostics)
    do place = size(diagnostics), 1, -1
      associate (features => diagnostics(place)%item%features())
        if (features%key == key) return
      end associate
    end do
  end function diagnostic_place

end module gravier_diagnostic_registry
