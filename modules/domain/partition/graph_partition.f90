!> Partition of a graph into parts of equal weight: the only module that knows METIS (5.1, 32-bit indices).
module gravier_graph_partition
  use, intrinsic :: iso_c_binding, only: c_int32_t, c_int, c_ptr, c_null_ptr, c_loc
  use gravier_errors, only: error_t, raise, status_failure
  use gravier_text, only: to_text
  use gravier_kinds, only: i4
  implicit none
  private
  public :: partition_graph

  integer(c_int), parameter :: metis_ok = 1_c_int
  !> size of METIS's options and places in it, from 1
  integer, parameter :: n_options = 40, option_numbering = 18, option_seed = 9

  interface
    function metis_setdefaultoptions(options) bind(c, name="METIS_SetDefaultOptions") result(stat)
      import :: c_int32_t, c_int
      implicit none
      integer(c_int32_t), intent(out) :: options(*)
      integer(c_int) :: stat
    end function metis_setdefaultoptions

    function metis_partgraphkway(nvtxs, ncon, xadj, adjncy, vwgt, vsize, adjwgt, nparts, tpwgts, ubvec, options, &
        & objval, part) bind(c, name="METIS_PartGraphKway") result(stat)
      import :: c_int32_t, c_int, c_ptr
      implicit none
      integer(c_int32_t), intent(in) :: nvtxs, ncon
      integer(c_int32_t), intent(inout) :: xadj(*), adjncy(*)
      type(c_ptr), value :: vwgt, vsize, adjwgt
      integer(c_int32_t), intent(in) :: nparts
      type(c_ptr), value :: tpwgts, ubvec
      integer(c_int32_t), intent(in) :: options(*)
      integer(c_int32_t), intent(out) :: objval
      integer(c_int32_t), intent(out) :: part(*)
      integer(c_int) :: stat
    end function metis_partgraphkway
  end interface

contains

  !> Cut a graph into `n_parts` parts. The result depends on the arguments alone (the seed is fixed).
  subroutine partition_graph(first, neighbour, vertex_weight, edge_weight, n_parts, part, error)
    !> first neighbour of each vertex, from 1, and one more entry (vertices + 1); METIS renumbers it while it works,
    !> and puts it back
    integer(c_int32_t), intent(inout), contiguous :: first(:)
    !> vertices from 1; each edge stands twice (2 edges)
    integer(c_int32_t), intent(inout), contiguous :: neighbour(:)
    integer(c_int32_t), intent(in), contiguous, target :: vertex_weight(:), edge_weight(:)
    integer, intent(in) :: n_parts
    !> (vertices) from 1
    integer(c_int32_t), intent(out), contiguous :: part(:)
    type(error_t), allocatable, intent(inout) :: error
    integer(c_int32_t) :: options(n_options), cut
    integer(c_int) :: stat

    part(:) = 1
    ! METIS divides by zero where there is one part
    if (n_parts == 1) return
    stat = metis_setdefaultoptions(options)
    options(option_numbering) = 1_c_int32_t
    options(option_seed) = 42_c_int32_t
    stat = metis_partgraphkway(size(part, kind=c_int32_t), 1_c_int32_t, first, neighbour, c_loc(vertex_weight), &
      & c_null_ptr, c_loc(edge_weight), int(n_parts, c_int32_t), c_null_ptr, c_null_ptr, options, cut, part)
    if (stat /= metis_ok) call raise(error, status_failure, "graph partition (METIS) failed with status "// &
      & to_text(int(stat, i4))//" for "//to_text(size(part))//" cells and "//to_text(n_parts)//" subdomains")
  end subroutine partition_graph

end module gravier_graph_partition
