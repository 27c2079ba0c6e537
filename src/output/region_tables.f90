!> Means over the regions of the input as tables for results.h5, a row a bin.
module gravier_region_tables
  use gravier_kinds, only: dp, i8
  use gravier_field_list, only: field_list_t
  use gravier_region_samples, only: region_figures_t
  use gravier_region_means, only: region_means_t, regions_key
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: collect_regions

contains

  !> A table a region, by its name, whose rows are its bins in their order, or the region as a whole: `bin`, `lower` and `upper`,
  !> the corners (nd) [m], `volume`, `grains`, `solid_fraction`, `velocity` (nd) [m/s], `granular_temperature` [m^2/s^2], `stress`
  !> (nd**2, row by row) [Pa, N/m in 2D], `contacts_per_grain`; of regions that are sampled `samples`, the steps that the others are
  !> means of. Not allocated where there are no regions, or no step was made yet. The samples begin anew. The same on all ranks.
  !> Collective.
  subroutine collect_regions(simulation, tables)
    type(simulation_t), intent(inout) :: simulation
    type(field_list_t), allocatable, intent(out) :: tables(:)
    type(region_figures_t), allocatable :: figures(:)
    integer :: place, r

    place = simulation%diagnostics%place(regions_key)
    if (place == 0 .or. .not. allocated(simulation%problem%sub)) return
    select type (means => simulation%diagnostics%asked(place)%diagnostic)
    type is (region_means_t)
      call means%find_profiles(simulation%decomposition, simulation%halo, simulation%problem, simulation%physics%h, figures)
      allocate (tables(size(figures)))
      do r = 1, size(figures)
        call fill_table(means%region(r)%name, simulation%decomposition%nd == 2, means%region(r)%sample_every > 0, figures(r), &
          & tables(r))
      end do
    end select
  end subroutine collect_regions

  subroutine fill_table(name, planar, sampled, figures, table)
    character(len=*), intent(in) :: name
    !> two dimensions, in which a volume is an area and a stress a force over a length; means over steps
    logical, intent(in) :: planar, sampled
    !> its numbers are moved
    type(region_figures_t), intent(inout) :: figures
    type(field_list_t), intent(out) :: table
    real(dp), allocatable :: rows(:, :)
    integer(i8), allocatable :: whole(:, :)
    integer :: a, b, k, nd

    nd = size(figures%velocity, 1)
    call table%init(name, "bin", figures%n)
    table%everywhere = .true.
    do k = 1, figures%n
      table%key(1, k) = k
    end do
    call table%add_reals("lower", "m", figures%lower)
    call table%add_reals("upper", "m", figures%upper)
    call add("volume", trim(merge("m^2", "m^3", planar)), figures%volume)
    allocate (whole(1, figures%n))
    if (sampled) then
      whole(:, :) = figures%samples
      call table%add_whole("samples", "", whole, .true.)
      call add("grains", "", figures%grains)
    else
      whole(1, :) = nint(figures%grains, i8)
      call table%add_whole("grains", "", whole, .true.)
    end if
    call add("solid_fraction", "", figures%solid_fraction)
    call table%add_reals("velocity", "m/s", figures%velocity)
    call add("granular_temperature", "m^2/s^2", figures%granular_temperature)
    allocate (rows(nd**2, figures%n))
    do k = 1, figures%n
      do a = 1, nd
        do b = 1, nd
          rows((a - 1)*nd + b, k) = figures%stress(a, b, k)
        end do
      end do
    end do
    call table%add_reals("stress", trim(merge("N/m", "Pa ", planar)), rows)
    call add("contacts_per_grain", "", figures%contacts_per_grain)

  contains

    !> A number a bin.
    subroutine add(field, unit, values)
      character(len=*), intent(in) :: field, unit
      real(dp), intent(in) :: values(:)
      real(dp), allocatable :: one(:, :)

      allocate (one(1, size(values)))
      one(1, :) = values
      call table%add_reals(field, unit, one, .true.)
    end subroutine add

  end subroutine fill_table

end module gravier_region_tables
