!> A table of bodies, one row each, as a table of the polygons that pictures show of them.
module gravier_body_polygons
  use gravier_kinds, only: dp, i8
  use gravier_field_list, only: field_list_t
  use gravier_vtkhdf_file, only: points_name, corners_name
  use gravier_simulation, only: simulation_t
  use gravier_body_outlines, only: outline_t, make_outlines, place_polygon
  implicit none
  private
  public :: draw_polygons

contains

  !> Rows of the bodies of this rank, subdomain after subdomain, as rows of their polygons: points, their number, and all fields of
  !> the body but its points. The keys are those of the body and the number of the polygon.
  subroutine draw_polygons(simulation, bodies, table)
    type(simulation_t), intent(in) :: simulation
    type(field_list_t), intent(in) :: bodies
    type(field_list_t), intent(out) :: table
    type(outline_t), allocatable :: outline(:)
    real(dp), allocatable :: points(:, :)
    integer(i8), allocatable :: corners(:, :)
    integer, allocatable :: body(:)
    integer :: s, k, c, n, i, most

    call make_outlines(simulation%decomposition%shapes, simulation%decomposition%nd, outline)
    call count_polygons(simulation, outline, n, most)
    call table%init("bodies", "id cell", n)
    allocate (points(3*most, n), corners(1, n), body(n))
    n = 0
    i = 0
    do s = 1, size(simulation%decomposition%owned)
      associate (owned => simulation%decomposition%owned(s))
        do k = 1, owned%n
          i = i + 1
          do c = 1, outline(owned%shape(k))%n
            n = n + 1
            body(n) = i
            table%key(1, n) = owned%id(k)
            table%key(2, n) = c
            call place_polygon(outline(owned%shape(k)), c, owned, k, points(:, n), corners(1, n))
          end do
        end do
      end associate
    end do
    call table%add_reals(points_name, "m", points)
    call table%add_whole(corners_name, "", corners)
    call copy_fields(bodies, body, table)
  end subroutine draw_polygons

  !> Polygons of this rank, and the most points that a polygon of any shape has.
  subroutine count_polygons(simulation, outline, n, most)
    type(simulation_t), intent(in) :: simulation
    !> by shape, from 0
    type(outline_t), intent(in) :: outline(0:)
    integer, intent(out) :: n, most
    integer :: s, k, c

    n = 0
    most = 0
    do k = 0, ubound(outline, 1)
      do c = 1, outline(k)%n
        most = max(most, outline(k)%first(c + 1) - outline(k)%first(c))
      end do
    end do
    do s = 1, size(simulation%decomposition%owned)
      associate (owned => simulation%decomposition%owned(s))
        do k = 1, owned%n
          n = n + outline(owned%shape(k))%n
        end do
      end associate
    end do
  end subroutine count_polygons

  !> Fields of bodies but for their points, each polygon with those of its body.
  subroutine copy_fields(bodies, body, table)
    type(field_list_t), intent(in) :: bodies
    !> of each polygon
    integer, intent(in) :: body(:)
    type(field_list_t), intent(inout) :: table
    real(dp), allocatable :: value(:, :)
    integer(i8), allocatable :: whole(:, :)
    integer :: f, n

    do f = 1, bodies%n_fields
      associate (field => bodies%field(f))
        if (field%name == points_name) cycle
        if (allocated(field%value)) then
          allocate (value(field%components(), size(body)))
          do n = 1, size(body)
            value(:, n) = field%value(:, body(n))
          end do
          call table%add_reals(field%name, field%unit, value)
        else
          allocate (whole(field%components(), size(body)))
          do n = 1, size(body)
            whole(:, n) = field%whole(:, body(n))
          end do
          call table%add_whole(field%name, field%unit, whole)
        end if
      end associate
    end do
  end subroutine copy_fields

end module gravier_body_polygons
