!> Contact fields by columns, one a contact, and packed in blocks of lanes as the kernels take them (gravier_contact_kernels).
module gravier_test_contact_columns
  use gravier_kinds, only: dp, i8
  use gravier_contact_kernels, only: lanes, n_blocks, lane_of, block_of
  implicit none
  private
  public :: contact_column, put_contact_column, same_contacts, pack_columns, pack_pairs

contains

  !> What a packed field (lanes, n, blocks) holds of contact `c`: (n).
  pure function contact_column(field, c) result(column)
    real(dp), intent(in) :: field(:, :, :)
    integer, intent(in) :: c
    real(dp) :: column(size(field, 2))
    column(:) = field(lane_of(c), :, block_of(c))
  end function contact_column

  pure subroutine put_contact_column(column, c, field)
    !> (n)
    real(dp), intent(in) :: column(:)
    integer, intent(in) :: c
    !> (lanes, n, blocks)
    real(dp), intent(inout) :: field(:, :, :)
    field(lane_of(c), :, block_of(c)) = column
  end subroutine put_contact_column

  !> Whether two packed fields have the same bits for each of the first `n_contacts` contacts, and room for no other number.
  pure logical function same_contacts(a, b, n_contacts)
    !> (lanes, n, blocks)
    real(dp), intent(in) :: a(:, :, :), b(:, :, :)
    integer, intent(in) :: n_contacts
    integer :: c, k

    same_contacts = all(shape(a) == shape(b)) .and. size(a, 1) == lanes .and. size(a, 3) == n_blocks(n_contacts)
    if (.not. same_contacts) return
    do c = 1, n_contacts
      do k = 1, size(a, 2)
        same_contacts = same_contacts .and. transfer(a(lane_of(c), k, block_of(c)), 0_i8) == &
          & transfer(b(lane_of(c), k, block_of(c)), 0_i8)
      end do
    end do
  end function same_contacts

  !> Columns in blocks of lanes, the last block filled with zeros.
  pure subroutine pack_columns(columns, field)
    !> (n, n_contacts)
    real(dp), intent(in) :: columns(:, :)
    !> (lanes, n, blocks)
    real(dp), allocatable, intent(out) :: field(:, :, :)
    integer :: c

    allocate (field(lanes, size(columns, 1), n_blocks(size(columns, 2))), source=0.0_dp)
    do c = 1, size(columns, 2)
      call put_contact_column(columns(:, c), c, field)
    end do
  end subroutine pack_columns

  !> Pairs of bodies, followed by contacts of the first body with itself until blocks are full.
  pure subroutine pack_pairs(pairs, packed)
    !> (2, n_contacts)
    integer, intent(in) :: pairs(:, :)
    !> (2, lanes*blocks)
    integer, allocatable, intent(out) :: packed(:, :)

    allocate (packed(2, lanes*n_blocks(size(pairs, 2))), source=1)
    packed(:, 1:size(pairs, 2)) = pairs
  end subroutine pack_pairs

end module gravier_test_contact_columns
