!> The regions of means that an input asks for.
module gravier_scene_regions
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_periodic, only: period_t
  use gravier_mean_region, only: unbounded
  use gravier_region_means, only: region_means_t
  use gravier_diagnostic_registry, only: diagnostic_holder_t
  use gravier_config_types, only: config_t
  implicit none
  private
  public :: make_region_means, check_mean_regions

  character(len=*), parameter :: axes = "xyz"

contains

  !> The diagnostic of the regions, not allocated where there are none.
  subroutine make_region_means(config, holder)
    type(config_t), intent(in) :: config
    type(diagnostic_holder_t), intent(out) :: holder
    type(region_means_t), allocatable :: means
    integer :: r

    if (size(config%regions) == 0) return
    allocate (means)
    allocate (means%region(size(config%regions)))
    do r = 1, size(means%region)
      associate (region => means%region(r), given => config%regions(r))
        region%name = trim(given%name)
        region%lower(:) = given%lower
        region%upper(:) = given%upper
        region%bins = merge(given%bins, 0, given%bins_given)
        region%axis = index(axes, trim(given%axis))
        region%sample_every = merge(given%sample_every, 0, given%sample_every_given)
      end associate
    end do
    call move_alloc(means, holder%diagnostic)
  end subroutine make_region_means

  !> Refuse regions that are longer than a period of the scene, in which a grain would be twice, and those that are farther than
  !> two periods from the cell.
  subroutine check_mean_regions(config, period, error)
    type(config_t), intent(in) :: config
    type(period_t), intent(in) :: period
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: low, high
    logical :: fits
    integer :: r, d

    do r = 1, size(config%regions)
      do d = 1, config%scene%dimension
        if (.not. period%length(d) > 0.0_dp) cycle
        low = config%regions(r)%lower(d)
        high = config%regions(r)%upper(d)
        if (.not. low > -unbounded) low = period%origin(d)
        if (.not. high < unbounded) high = period%origin(d) + period%length(d)
        fits = high > low .and. high - low <= period%length(d)*(1.0_dp + 1.0e-9_dp)
        if (fits .and. abs(low - period%origin(d)) <= 2.0_dp*period%length(d)) cycle
        call raise(error, status_input, config%file//": &region '"//trim(config%regions(r)%name)//"': from "//to_text(low, 4)// &
          & " m to "//to_text(high, 4)//" m along "//axes(d:d)//": expected a region with an inside, no longer than the "// &
          & "period, "//to_text(period%length(d), 4)//" m, and within two periods of the cell; a side that is left out is "// &
          & "that of the cell")
        return
      end do
    end do
  end subroutine check_mean_regions

end module gravier_scene_regions
