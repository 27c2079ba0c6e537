!> Into how many boxes a scene is cut along each axis, and how many subdomains it has room for.
module gravier_box_counts
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_cell_grid, only: count_along
  implicit none
  private
  public :: choose_boxes, check_subdomains, refuse_too_many

contains

  !> Boxes along each axis for `n_subdomains`: of all factorisations, the one that cuts the least surface.
  pure function choose_boxes(lower, upper, n_subdomains, period) result(boxes)
    !> (nd) [m]
    real(dp), intent(in) :: lower(:), upper(:)
    integer, intent(in) :: n_subdomains
    !> (nd at least) [m], 0 along axes that are not periodic: along the others two boxes or more meet at the ends too
    real(dp), intent(in), optional :: period(:)
    integer :: boxes(3), counts(3), cuts(3)
    integer :: i, j
    integer, allocatable :: divisor(:)
    real(dp) :: extent(3), cut, least

    extent(:) = 1.0_dp
    extent(1:size(lower)) = max(upper - lower, tiny(1.0_dp))
    extent(:) = extent/maxval(extent(1:size(lower)))
    boxes(:) = 1
    boxes(1) = n_subdomains
    least = huge(1.0_dp)
    call list_divisors(n_subdomains, divisor)
    do i = 1, size(divisor)
      do j = 1, size(divisor)
        if (mod(n_subdomains/divisor(i), divisor(j)) /= 0) cycle
        counts(1) = divisor(i)
        counts(2) = divisor(j)
        counts(3) = (n_subdomains/divisor(i))/divisor(j)
        if (size(lower) == 2 .and. counts(3) > 1) cycle
        cuts(:) = counts - 1
        if (present(period)) then
          where (counts(1:size(lower)) > 1 .and. period(1:size(lower)) > 0.0_dp) cuts(1:size(lower)) = counts(1:size(lower))
        end if
        cut = cuts(1)*extent(2)*extent(3) + cuts(2)*extent(1)*extent(3) + cuts(3)*extent(1)*extent(2)
        if (cut < least) then
          least = cut
          boxes(:) = counts
        end if
      end do
    end do
  end function choose_boxes

  !> Divisors of `n`, ascending.
  pure subroutine list_divisors(n, divisor)
    integer, intent(in) :: n
    integer, allocatable, intent(out) :: divisor(:)
    integer :: low(2000), high(2000), k, n_low, n_high

    n_low = 0
    n_high = 0
    k = 1
    ! an integer has fewer than 2000 divisors
    do while (k <= n/k)
      if (mod(n, k) == 0) then
        n_low = n_low + 1
        low(n_low) = k
        if (n/k /= k) then
          n_high = n_high + 1
          high(n_high) = n/k
        end if
      end if
      k = k + 1
    end do
    allocate (divisor(n_low + n_high))
    divisor(1:n_low) = low(1:n_low)
    divisor(n_low + 1:) = high(n_high:1:-1)
  end subroutine list_divisors

  !> Refuse more subdomains than the scene has cells; cheap, whatever their number. Failure: status_input.
  subroutine check_subdomains(lower, upper, edge, n_subdomains, error)
    !> (nd) [m]
    real(dp), intent(in) :: lower(:), upper(:)
    !> edge of a detection cell [m]
    real(dp), intent(in) :: edge
    integer, intent(in) :: n_subdomains
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: cells
    integer :: d

    cells = 1.0_dp
    do d = 1, size(lower)
      cells = min(cells*count_along(lower(d), upper(d), edge), real(huge(1), dp))
    end do
    call refuse_too_many(n_subdomains, int(cells, i8), error)
  end subroutine check_subdomains

  !> Refuse more subdomains than there are cells for them. Failure: status_input.
  subroutine refuse_too_many(n_subdomains, n_cells, error)
    integer, intent(in) :: n_subdomains
    integer(i8), intent(in) :: n_cells
    type(error_t), allocatable, intent(inout) :: error

    if (n_subdomains > n_cells) call raise(error, status_input, "&decomposition subdomains = "//to_text(n_subdomains)// &
      & ": the scene is too small for so many subdomains; expected at most "//to_text(n_cells)//" for this scene")
  end subroutine refuse_too_many

end module gravier_box_counts
