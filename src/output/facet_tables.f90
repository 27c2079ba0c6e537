!> The facets of boundaries as tables: for results.h5, where they stand once, and for ParaView, where they are now.
module gravier_facet_tables
  use gravier_kinds, only: dp, i8
  use gravier_boundary, only: boundary_t
  use gravier_field_list, only: field_list_t
  use gravier_vtkhdf_file, only: points_name, corners_name
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: describe_facets, draw_facets, count_facets, facets_move

contains

  !> The table `facets`, numbered from 1: the identifier of the `boundary`, and its `corners`, the coordinates of one after the
  !> other, in the axes of the boundary and from its position. The same on all ranks.
  subroutine describe_facets(simulation, table)
    type(simulation_t), intent(in) :: simulation
    type(field_list_t), intent(out) :: table
    integer(i8), allocatable :: boundary(:, :)
    real(dp), allocatable :: corners(:, :)
    real(dp) :: corner(3, simulation%decomposition%nd), axes(3, 3), way(3)
    integer :: b, k, c, d, n, nd

    nd = simulation%decomposition%nd
    associate (boundaries => simulation%decomposition%boundaries)
      n = count_facets(boundaries, .false.)
      call table%init("facets", "number", n)
      table%everywhere = .true.
      allocate (boundary(1, n), corners(nd*nd, n))
      n = 0
      do b = 1, size(boundaries)
        if (.not. boundaries(b)%is_faceted()) cycle
        call boundaries(b)%surface%find_axes(axes)
        do k = 1, boundaries(b)%surface%n_facets()
          n = n + 1
          table%key(1, n) = n
          boundary(1, n) = boundaries(b)%id
          call boundaries(b)%surface%get_facet(k, corner)
          do c = 1, nd
            way(:) = corner(:, c) - boundaries(b)%surface%point
            do d = 1, nd
              corners(nd*(c - 1) + d, n) = dot_product(axes(:, d), way)
            end do
          end do
        end do
      end do
    end associate
    call table%add_whole("boundary", "", boundary, .true.)
    call table%add_reals("corners", "m", corners)
  end subroutine describe_facets

  !> The facets of boundaries that are there, as lines or triangles, on the first rank.
  subroutine draw_facets(simulation, table)
    type(simulation_t), intent(in) :: simulation
    type(field_list_t), intent(out) :: table
    integer(i8), allocatable :: corners(:, :), boundary(:, :), facet(:, :)
    real(dp), allocatable :: points(:, :), velocity(:, :)
    real(dp) :: corner(3, simulation%decomposition%nd), centre(3)
    integer :: b, k, c, n, nd

    nd = simulation%decomposition%nd
    associate (boundaries => simulation%decomposition%boundaries)
      n = 0
      if (simulation%comm%rank == 0) n = count_facets(boundaries, .true.)
      call table%init("boundaries", "id facet", n)
      allocate (points(3*nd, n), corners(1, n), boundary(1, n), facet(1, n), velocity(3, n))
      n = 0
      do b = 1, size(boundaries)
        if (simulation%comm%rank /= 0) exit
        if (.not. (boundaries(b)%is_faceted() .and. boundaries(b)%present)) cycle
        do k = 1, boundaries(b)%surface%n_facets()
          n = n + 1
          table%key(1, n) = boundaries(b)%id
          table%key(2, n) = k
          boundary(1, n) = boundaries(b)%id
          facet(1, n) = k
          corners(1, n) = nd
          call boundaries(b)%surface%get_facet(k, corner)
          centre(:) = sum(corner, 2)/nd
          velocity(:, n) = 0.0_dp
          call boundaries(b)%velocity_at(centre(1:nd), velocity(1:nd, n))
          do c = 1, nd
            points(3*c - 2:3*c, n) = corner(:, c)
          end do
        end do
      end do
    end associate
    call table%add_reals(points_name, "m", points)
    if (nd == 3) call table%add_whole(corners_name, "", corners)
    call table%add_whole("boundary", "", boundary)
    call table%add_whole("facet", "", facet)
    call table%add_reals("velocity", "m/s", velocity)
  end subroutine draw_facets

  !> Facets of all boundaries.
  pure integer function count_facets(boundaries, present_only) result(n)
    type(boundary_t), intent(in) :: boundaries(:)
    !> of those that are there now
    logical, intent(in) :: present_only
    integer :: b

    n = 0
    do b = 1, size(boundaries)
      if (.not. boundaries(b)%is_faceted()) cycle
      if (boundaries(b)%present .or. .not. present_only) n = n + boundaries(b)%surface%n_facets()
    end do
  end function count_facets

  !> Whether facets move or go away in the course of the run, so that one state does not show them.
  pure logical function facets_move(simulation)
    type(simulation_t), intent(in) :: simulation
    integer :: b

    facets_move = .false.
    do b = 1, size(simulation%decomposition%boundaries)
      associate (boundary => simulation%decomposition%boundaries(b))
        if (.not. boundary%is_faceted()) cycle
        facets_move = facets_move .or. boundary%is_driven() .or. boundary%drive%moves() .or. &
          & boundary%remove_at < huge(1.0_dp) .or. boundary%drive%steered
      end associate
    end do
  end function facets_move

end module gravier_facet_tables
