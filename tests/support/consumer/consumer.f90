!> A program on an installed Gravier that reaches each library below it: MPI, HDF5, MUMPS and METIS.
program consumer
  use, intrinsic :: iso_c_binding, only: c_int32_t
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_hdf5_file, only: h5_file_t
  use gravier_sparse_direct, only: sparse_factor_t
  use gravier_graph_partition, only: partition_graph
  implicit none
  type(communicator_t) :: world
  type(error_t), allocatable :: error
  type(h5_file_t) :: file
  type(sparse_factor_t) :: factor
  real(dp) :: b(2, 1)
  integer(c_int32_t) :: first(5), neighbour(6), part(4)

  call start_parallel()
  call world%init()
  call file%create(world, "consumer.h5", error)
  call file%close(error)
  call factor%init_local(error)
  ! diag(2, 4) x = (2, 4)
  call factor%factorise(2, [1, 2], [1, 2], [2.0_dp, 4.0_dp], error)
  b(:, 1) = [2.0_dp, 4.0_dp]
  call factor%solve(b, error)
  call factor%free()
  ! the chain 1 - 2 - 3 - 4 in two parts of two
  first = [1, 2, 4, 6, 7]
  neighbour = [2, 1, 3, 2, 4, 3]
  call partition_graph(first, neighbour, [1, 1, 1, 1], [1, 1, 1, 1, 1, 1], 2, part, error)
  call world%free()
  call stop_parallel()

  if (allocated(error)) print "(a)", error%message
  if (allocated(error)) stop 1
  if (maxval(abs(b - 1.0_dp)) > 1.0e-12_dp) stop 2
  if (part(1) /= part(2) .or. part(3) /= part(4) .or. part(1) == part(3)) stop 3
  print "(a)", "consumer: done"
end program consumer
