!> Rules of the &region groups. Periods, which may come from a bodies file, are for the scene.
module gravier_config_check_region
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_mean_region, only: unbounded
  use gravier_config_types, only: config_t, region_config_t, text_length
  use gravier_config_report, only: report_t, expect, expect_own_name, miss, shown_text
  implicit none
  private
  public :: check_regions

  !> of a name, which begins names of columns and of groups of files
  integer, parameter :: longest_name = 64
  !> of a region
  integer, parameter :: most_bins = 10000
  character(len=*), parameter :: letters = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"

contains

  !> Fails (status_input) with the first rule that a region breaks.
  subroutine check_regions(report, config, error)
    !> its instance comes back as 1
    type(report_t), intent(inout) :: report
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    character(len=text_length), allocatable :: names(:)
    integer :: i

    allocate (names(size(config%regions)))
    names(:) = config%regions%name
    do i = 1, size(config%regions)
      report%instance = i
      call check_name(report, trim(config%regions(i)%name), error)
      call expect_own_name(report, "region", names(:i), error)
      call check_box(report, config%scene%dimension, config%regions(i), error)
      call check_bins(report, config%scene%dimension, config%regions(i), error)
      call check_samples(report, config%output%every, config%regions(i), error)
      if (allocated(error)) return
    end do
    report%instance = 1
  end subroutine check_regions

  !> Names of columns can be made of the name of a region.
  subroutine check_name(report, name, error)
    type(report_t), intent(in) :: report
    character(len=*), intent(in) :: name
    type(error_t), allocatable, intent(inout) :: error
    logical :: fits

    fits = len(name) <= longest_name .and. verify(name, letters//"0123456789_") == 0 .and. scan(name, letters) == 1
    call expect(report, fits, "region", "name", error, "letters, digits and underscores after a letter, at most 64 of them")
  end subroutine check_name

  !> A box has an inside.
  subroutine check_box(report, nd, region, error)
    type(report_t), intent(in) :: report
    integer, intent(in) :: nd
    type(region_config_t), intent(in) :: region
    type(error_t), allocatable, intent(inout) :: error

    call expect(report, all(region%lower(:nd) < unbounded), "region", "lower", error, "components below 1e30")
    call expect(report, all(region%upper(:nd) > -unbounded), "region", "upper", error, "components above -1e30")
    call expect(report, all(region%upper(:nd) > region%lower(:nd)), "region", "upper", error, &
                "components above those of lower, here "//shown_text(report, "region", "lower"))
  end subroutine check_box

  !> Bins along an axis that the scene has.
  subroutine check_bins(report, nd, region, error)
    type(report_t), intent(in) :: report
    integer, intent(in) :: nd
    type(region_config_t), intent(in) :: region
    type(error_t), allocatable, intent(inout) :: error

    call expect(report, region%bins >= 1 .and. region%bins <= most_bins, "region", "bins", error)
    if (region%bins_given) call miss(report, "region", "axis", error, "bins")
    if (region%axis_given) call miss(report, "region", "bins", error, "axis")
    call expect(report, nd == 3 .or. region%axis /= "z", "region", "axis", error, "'x' or 'y' in 2D")
  end subroutine check_bins

  !> Samples that come at least once from one written state to the next.
  subroutine check_samples(report, every, region, error)
    type(report_t), intent(in) :: report
    !> steps from one written state to the next, 0: the last one alone
    integer, intent(in) :: every
    type(region_config_t), intent(in) :: region
    type(error_t), allocatable, intent(inout) :: error

    if (.not. region%sample_every_given) return
    call expect(report, region%sample_every >= 1, "region", "sample_every", error)
    call expect(report, every == 0 .or. region%sample_every <= every, "region", "sample_every", error, "at most the steps "// &
                "between two written states, here "//shown_text(report, "output", "every"))
  end subroutine check_samples

end module gravier_config_check_region
