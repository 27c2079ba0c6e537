!> Starts that no packing has: bodies that lie in each other, or behind a boundary.
module gravier_start_overlap
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_neighbour_rule, only: neighbour_rule_t
  use gravier_halo, only: local_bodies_t, halo_t
  use gravier_pair_points, only: pair_points_t
  use gravier_shape_contacts, only: shape_work_t, find_points
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: check_start_overlap

  !> fraction of a radius that roundings of the places take
  real(dp), parameter :: rounding = 1.0e-6_dp

  !> An overlap as a fraction of the smaller radius, or of the radius of a grain in a boundary; of a body with a shape half of its
  !> thickness stands for the radius.
  type :: overlap_t
    real(dp) :: share = 0.0_dp
    !> identifiers; the second is 0 in a boundary
    integer(i8) :: id(2) = 0
    !> number of the boundary, also of one that the grain or its partner is glued to; 0: none
    integer :: boundary = 0
  end type overlap_t

contains

  !> Fail (status_input) where two bodies of a scene that has been distributed and has made no step yet overlap by more than
  !> start_overlap allows. The error is that of the largest overlap, the same on all ranks. Collective.
  subroutine check_start_overlap(simulation, error)
    !> comes back as it was
    type(simulation_t), intent(inout) :: simulation
    type(error_t), allocatable, intent(inout) :: error
    type(halo_t) :: touching
    type(neighbour_rule_t) :: rule
    type(overlap_t) :: worst
    real(dp) :: limit, most
    integer(i8) :: number(1)
    integer :: s

    if (allocated(error)) return
    limit = simulation%config%scene%start_overlap + rounding
    associate (decomposition => simulation%decomposition)
      rule = decomposition%rule
      decomposition%rule%alert_distance = 0.0_dp
      decomposition%rule%skin = 0.0_dp
      call touching%build(decomposition)
      decomposition%rule = rule
      number(:) = 0
      do s = 1, size(touching%view)
        call find_worst(simulation, touching%view(s), limit, worst, number(1))
      end do
    end associate
    call simulation%comm%sum_counts(number)
    if (number(1) == 0) return
    most = simulation%comm%highest(worst%share)
    ! where several are as large, the first subdomain that has one speaks
    if (worst%share >= most) call raise(error, status_input, message(simulation, worst, number(1)))
    call simulation%comm%agree(error)
  end subroutine check_start_overlap

  !> Largest overlap in a subdomain, if it exceeds that found so far, and the number of those above the limit.
  subroutine find_worst(simulation, view, limit, worst, number)
    type(simulation_t), intent(in) :: simulation
    type(local_bodies_t), intent(in) :: view
    real(dp), intent(in) :: limit
    type(overlap_t), intent(inout) :: worst
    integer(i8), intent(inout) :: number
    type(overlap_t) :: overlap
    integer :: p

    p = 1
    do while (p <= view%list%n)
      call measure(simulation, view, p, overlap)
      p = p + view%list%points_of(p)
      if (.not. overlap%share > limit) cycle
      number = number + 1
      if (overlap%share > worst%share) worst = overlap
    end do
  end subroutine find_worst

  !> Overlap of pair `p`; none with a boundary that is taken away before the first step.
  subroutine measure(simulation, view, p, overlap)
    type(simulation_t), intent(in) :: simulation
    type(local_bodies_t), intent(in) :: view
    integer, intent(in) :: p
    type(overlap_t), intent(out) :: overlap
    real(dp) :: branch(simulation%decomposition%nd), distance, smaller
    type(pair_points_t) :: points
    type(shape_work_t) :: work
    logical :: has_points
    integer :: i, j

    call view%find_ends(p, i, j)
    associate (bodies => view%bodies, decomposition => simulation%decomposition)
      overlap%id(1) = bodies%id(i)
      has_points = decomposition%no > 0
      if (j < 0) has_points = has_points .or. decomposition%boundaries(-j)%is_faceted()
      if (has_points) then
        if (j < 0) then
          if (decomposition%boundaries(-j)%remove_at <= simulation%time) return
        end if
        call work%init(decomposition%nd, 0.0_dp, counts=.false.)
        call find_points(view, decomposition, p, work, points)
        smaller = decomposition%figures%half_thickness_of(bodies, i)
        if (j > 0) smaller = min(smaller, decomposition%figures%half_thickness_of(bodies, j))
        if (points%n > 0) overlap%share = -minval(points%gap(1:points%n))/smaller
        overlap%boundary = -j
        if (j < 0) return
        overlap%id(2) = bodies%id(j)
        overlap%boundary = max(bodies%glued(i), bodies%glued(j))
        return
      end if
      if (j < 0) then
        if (decomposition%boundaries(-j)%remove_at <= simulation%time) return
        call decomposition%boundaries(-j)%locate(bodies%position(:, i), distance, branch)
        overlap%share = (bodies%radius(i) - distance)/bodies%radius(i)
        overlap%boundary = -j
        return
      end if
      branch(:) = bodies%position(:, i) - bodies%position(:, j)
      if (size(view%list%shift) > 0) call decomposition%period%add_shift(view%list%shift(p), -1, branch)
      overlap%share = (bodies%radius(i) + bodies%radius(j) - norm2(branch))/min(bodies%radius(i), bodies%radius(j))
      overlap%id(2) = bodies%id(j)
      overlap%boundary = max(bodies%glued(i), bodies%glued(j))
    end associate
  end subroutine measure

  !> The line of an error.
  function message(simulation, worst, number) result(text)
    type(simulation_t), intent(in) :: simulation
    type(overlap_t), intent(in) :: worst
    !> of overlaps above the limit
    integer(i8), intent(in) :: number
    character(len=:), allocatable :: text
    character(len=:), allocatable :: glued

    associate (config => simulation%config)
      text = config%file//": &scene start_overlap: "
      glued = ""
      if (worst%boundary > 0) glued = "boundary '"//simulation%decomposition%boundaries(worst%boundary)%name//"'"
      if (worst%id(2) == 0) then
        text = text//"body "//to_text(worst%id(1))//" overlaps "//glued//" by "//percent(worst%share)//" of "// &
          & trim(merge("half of its thickness", "its radius           ", simulation%effects%shapes))
      else
        text = text//"bodies "//to_text(worst%id(1))//" and "//to_text(worst%id(2))
        if (glued /= "") text = text//" (glued to "//glued//")"
        text = text//" overlap by "//percent(worst%share)//" of "// &
          & trim(merge("half of the smaller thickness", "the smaller radius           ", simulation%effects%shapes))
      end if
      text = text//" at the start"
      if (number > 1) text = text//", the most of "//to_text(number)//" pairs"
      text = text//": expected at most "//percent(config%scene%start_overlap)//", which start_overlap sets"
    end associate
  end function message

  function percent(share) result(text)
    real(dp), intent(in) :: share
    character(len=:), allocatable :: text
    character(len=32) :: row

    if (share < 1.0e6_dp) then
      write (row, "(f16.1)") 100.0_dp*share
    else
      row = to_text(100.0_dp*share, 3)
    end if
    text = trim(adjustl(row))//" %"
  end function percent

end module gravier_start_overlap
