!> How many bonds are intact. Bonds are counted with the pairs that keep them, of which each is in the list of one subdomain, so
!> that those between bodies that sleep are among them.
module gravier_intact_bonds
  use gravier_kinds, only: dp, i8
  use gravier_decomposition, only: decomposition_t
  use gravier_halo, only: halo_t
  use gravier_law_set, only: law_set_t
  use gravier_pair_laws, only: law_of
  use gravier_diagnostic, only: diagnostic_t, diagnostic_features_t, solved_step_t, column_list_t
  implicit none
  private
  public :: intact_bonds_t, count_bonds

  type, extends(diagnostic_t) :: intact_bonds_t
    !> at the end of the step; between bodies with shapes each point of contact has one
    integer(i8) :: bonds = 0
  contains
    procedure, nopass :: features => intact_bonds_features
    procedure :: measure => intact_bonds_measure
    procedure :: columns => intact_bonds_columns
  end type intact_bonds_t

contains

  pure function intact_bonds_features() result(features)
    type(diagnostic_features_t) :: features

    features%key = "bonds"
    features%meaning = "write the number of intact bonds of each step"
  end function intact_bonds_features

  subroutine intact_bonds_measure(self, step)
    class(intact_bonds_t), intent(inout) :: self
    type(solved_step_t), intent(in) :: step

    self%bonds = count_bonds(step%halo, step%decomposition, step%physics%laws)
  end subroutine intact_bonds_measure

  !> Bonds of all ranks at the end of a step. Collective.
  integer(i8) function count_bonds(halo, decomposition, laws) result(bonds)
    type(halo_t), intent(in) :: halo
    type(decomposition_t), intent(in) :: decomposition
    type(law_set_t), intent(in) :: laws
    integer :: s, p, l

    bonds = 0
    if (.not. laws%breaks) return
    do s = 1, size(halo%view)
      associate (view => halo%view(s))
        do p = 1, view%list%n
          if (view%list%state(view%list%memory%law_row, p) == 0) cycle
          l = law_of(view, decomposition%boundaries, laws, p)
          if (laws%of(l)%law%breaks) bonds = bonds + 1
        end do
      end associate
    end do
    bonds = decomposition%comm%total(bonds)
  end function count_bonds

  subroutine intact_bonds_columns(self, list)
    class(intact_bonds_t), intent(in) :: self
    type(column_list_t), intent(inout) :: list

    call list%add("bonds", real(self%bonds, dp))
  end subroutine intact_bonds_columns

end module gravier_intact_bonds
