!> From &material and &law groups to the laws of a scene.
module gravier_config_laws
  use gravier_kinds, only: dp
  use gravier_law_set, only: law_set_t
  use gravier_config_types, only: config_t
  use gravier_config_key, only: kind_real
  use gravier_config_table, only: keys
  implicit none
  private
  public :: material_number, density_of, collect_laws

contains

  !> Number of a material, 0 for a name that none has.
  pure integer function material_number(config, name) result(k)
    type(config_t), intent(in) :: config
    character(len=*), intent(in) :: name

    do k = size(config%materials), 1, -1
      if (config%materials(k)%name == name) return
    end do
  end function material_number

  !> Density of a material; without materials, that of the scene [kg/m^3, kg/m^2 in 2D].
  pure real(dp) function density_of(config, material) result(density)
    type(config_t), intent(in) :: config
    integer, intent(in) :: material

    density = config%scene%density
    if (size(config%materials) > 0) density = config%materials(material)%density
  end function density_of

  !> The laws of a configuration that was checked, as far as it names known materials.
  subroutine collect_laws(config, laws)
    type(config_t), intent(in) :: config
    type(law_set_t), intent(out) :: laws
    character(len=len(keys%name)), allocatable :: names(:)
    integer :: i, k, b, n

    allocate (names(count(keys%group == "law" .and. keys%kind == kind_real)))
    n = 0
    do k = 1, size(keys)
      if (keys(k)%group /= "law" .or. keys(k)%kind /= kind_real) cycle
      n = n + 1
      names(n) = keys(k)%name
    end do
    call laws%init(size(config%materials), size(config%laws))
    do i = 1, size(config%laws)
      associate (law => config%laws(i))
        b = 1
        if (law%materials(2) /= "") b = 2
        call laws%add(material_number(config, law%materials(1)), material_number(config, law%materials(b)), trim(law%kind), &
          & names, law%value)
      end associate
    end do
  end subroutine collect_laws

end module gravier_config_laws
