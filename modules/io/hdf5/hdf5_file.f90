!> One HDF5 file shared by all ranks: its storage on the disk (gravier_hdf5_storage), groups (gravier_hdf5_tree), attributes
!> (gravier_hdf5_attributes), rows with their checksums (gravier_hdf5_rows) and tables that grow (gravier_hdf5_tables). These
!> modules, gravier_hdf5_datasets and gravier_hdf5_properties are the only ones of the program that use the HDF5 library. Every
!> procedure with an `error` is collective and leaves the same error on all ranks. What is wrong with a file that is read ends in
!> status_input, what fails while writing in status_failure.
module gravier_hdf5_file
  use gravier_hdf5_storage, only: check_length
  use gravier_hdf5_tables, only: h5_tables_t, table_integer, table_single, table_double
  implicit none
  private
  public :: h5_file_t, check_length
  public :: table_integer, table_single, table_double

  !> An open HDF5 file. Paths start at the root: "/steps/12/bodies/id".
  type, extends(h5_tables_t) :: h5_file_t
  end type h5_file_t

end module gravier_hdf5_file
