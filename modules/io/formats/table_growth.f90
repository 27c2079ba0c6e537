!> Room that tables of HDF5 files take as they grow.
module gravier_table_growth
  use gravier_kinds, only: i8
  implicit none
  private
  public :: growth, chunks_in_block

  !> chunks of a table for which the file has room in one block: up to there a program that dies leaves the file whole
  integer, parameter :: chunks_in_block = 128
  !> room for the block that knows the chunks of a table
  integer(i8), parameter :: bytes_of_block = 6144

contains

  !> Bytes by which a table grows from `before` rows by `more`.
  pure integer(i8) function growth(before, more, chunk, width)
    !> rows of a chunk
    integer(i8), intent(in) :: before, more, chunk
    !> bytes of a row
    integer, intent(in) :: width
    integer(i8) :: chunks, known, blocks

    known = (before + chunk - 1)/chunk
    chunks = (before + more + chunk - 1)/chunk - known
    blocks = 0
    if (known == 0) blocks = 1
    ! a full block becomes two, and these want one above them
    if (known + chunks > chunks_in_block) blocks = blocks + 2 + 2*chunks/chunks_in_block
    growth = 0
    if (chunks > 0) growth = chunks*chunk*width + blocks*bytes_of_block
  end function growth

end module gravier_table_growth
