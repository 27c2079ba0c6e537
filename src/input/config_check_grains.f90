!> Rules of what grains are drawn from at random: radii and shapes, of &sample and of &insertion.
module gravier_config_check_grains
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_config_names, only: count_names, has_empty_name
  use gravier_config_types, only: config_t, grains_config_t
  use gravier_config_report, only: report_t, expect, is_given, shown_text
  implicit none
  private
  public :: check_grains, check_shares

contains

  !> Fails (status_input) with the first rule that the grains of a group break. Keys that do not belong to its choices are not
  !> given.
  subroutine check_grains(report, config, group, grains, error)
    !> of the instance of the group
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    character(len=*), intent(in) :: group
    type(grains_config_t), intent(in) :: grains
    type(error_t), allocatable, intent(inout) :: error

    call check_radii(report, group, grains, error)
    call check_grain_shapes(report, config, group, grains, error)
  end subroutine check_grains

  subroutine check_radii(report, group, grains, error)
    type(report_t), intent(in) :: report
    character(len=*), intent(in) :: group
    type(grains_config_t), intent(in) :: grains
    type(error_t), allocatable, intent(inout) :: error

    select case (grains%radii)
    case ("single")
      call expect(report, grains%radius > 0.0_dp, group, "radius", error)
    case ("table")
      call expect(report, grains%radius_table /= "", group, "radius_table", error)
    case default
      call expect(report, grains%radius_min > 0.0_dp, group, "radius_min", error)
      call expect(report, grains%radius_max > 0.0_dp, group, "radius_max", error)
      call expect(report, grains%radius_min <= grains%radius_max, group, "radius_min", error, &
                  "at most radius_max, here "//shown_text(report, group, "radius_max"))
    end select
    if (grains%radii /= "log_normal") return
    call expect(report, grains%radius_mean > 0.0_dp, group, "radius_mean", error)
    call expect(report, grains%radius_mean >= grains%radius_min .and. grains%radius_mean <= grains%radius_max, &
                group, "radius_mean", error, "a radius from radius_min to radius_max, here " &
                //shown_text(report, group, "radius_min")//" and "//shown_text(report, group, "radius_max"))
    call expect(report, grains%radius_deviation > 0.0_dp .and. grains%radius_deviation <= 1.0e3_dp, group, "radius_deviation", &
                error)
  end subroutine check_radii

  !> Names of shapes need a file of shapes, and shares names.
  subroutine check_grain_shapes(report, config, group, grains, error)
    type(report_t), intent(in) :: report
    type(config_t), intent(in) :: config
    character(len=*), intent(in) :: group
    type(grains_config_t), intent(in) :: grains
    type(error_t), allocatable, intent(inout) :: error

    call expect(report, .not. has_empty_name(grains%grain_shapes), group, "grain_shapes", error, &
                "the name of a shape before and behind each comma")
    call expect(report, count_names(grains%grain_shapes) == 0 .or. config%scene%shapes /= "", group, "grain_shapes", error, &
                "shapes of &scene, the path of the file that has them")
    call check_shares(report, group, "grain_shapes", grains%grain_shapes, "grain_shares", grains%grain_shares, error)
  end subroutine check_grain_shapes

  !> Fails (status_input) where shares are given and are not one above 0 for each of the names, of which there are not too many.
  subroutine check_shares(report, group, names_key, names, shares_key, shares, error)
    type(report_t), intent(in) :: report
    !> the group, its key of names and its key of shares
    character(len=*), intent(in) :: group, names_key, shares_key
    !> names with commas or blanks between
    character(len=*), intent(in) :: names
    real(dp), intent(in) :: shares(:)
    type(error_t), allocatable, intent(inout) :: error
    integer :: n

    if (.not. is_given(report, group, shares_key)) return
    n = count_names(names)
    call expect(report, n > 0 .and. n <= size(shares), group, shares_key, error, &
                "it where "//names_key//" has one name to "//to_text(size(shares)))
    n = min(n, size(shares))
    call expect(report, all(shares(:n) > 0.0_dp) .and. .not. any(abs(shares(n + 1:)) > 0.0_dp), group, shares_key, error, &
                "a share above 0 for each of the "//to_text(n)//" "//names_key)
  end subroutine check_shares

end module gravier_config_check_grains
