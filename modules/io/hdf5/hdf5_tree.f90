!> An HDF5 file as a tree of groups, which may appear only when they are complete.
module gravier_hdf5_tree
  use hdf5, only: H5_INDEX_NAME_F, H5_ITER_INC_F, h5gclose_f, h5gcreate_anon_f, h5gcreate_f, h5gn_members_f, h5ldelete_f, &
    & h5lexists_f, h5lget_name_by_idx_f, h5ocopy_f, h5odecr_refcount_f, h5oincr_refcount_f, h5olink_f, h5pclose_f, hid_t, hsize_t
  use gravier_errors, only: error_t
  use gravier_hdf5_properties, only: of_group, ask_for_one_block
  use gravier_hdf5_storage, only: h5_storage_t, bytes_of_link
  implicit none
  private
  public :: h5_tree_t

  !> The groups of an open HDF5 file. Paths start at the root: "/steps/12/bodies/id".
  type, extends(h5_storage_t) :: h5_tree_t
    private
    !> the group that begin_group started, not yet seen by readers
    integer(hid_t) :: hidden = -1
    character(len=:), allocatable :: hidden_path
  contains
    procedure :: make_group => h5_make_group
    procedure :: begin_group => h5_begin_group
    procedure :: commit_group => h5_commit_group
    procedure :: abandon_group => h5_abandon_group
    procedure :: remove_group => h5_remove_group
    procedure :: take_over => h5_take_over

    procedure :: exists => h5_exists
    procedure :: member_count => h5_member_count
    procedure :: member => h5_member

    !> for the types that extend this one
    procedure :: locate => h5_locate
    procedure :: make_groups_above => h5_make_groups_above
  end type h5_tree_t

contains

  !> Make a group, and those above it that are missing.
  subroutine h5_make_group(self, path, error, members)
    class(h5_tree_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    !> keep room for so many members, 1500 at most, in one block: to show one more of them is then a single write
    integer, intent(in), optional :: members
    integer :: stat

    if (allocated(error)) return
    call self%make_groups_above(path)
    call make_one_group(self, path, stat, members)
    if (stat < 0) call self%fail(path, "cannot make this group", error)
    call self%comm%agree(error)
  end subroutine h5_make_group

  !> Make the groups above `path` that are missing; what fails, fails again with `path`.
  subroutine h5_make_groups_above(self, path)
    class(h5_tree_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer :: i, ignored
    logical :: there

    do i = 2, len(path)
      if (path(i:i) /= "/") cycle
      there = self%exists(path(1:i - 1))
      if (.not. there) call make_one_group(self, path(1:i - 1), ignored)
    end do
  end subroutine h5_make_groups_above

  subroutine make_one_group(self, path, stat, members)
    class(h5_tree_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer, intent(out) :: stat
    integer, intent(in), optional :: members
    integer(hid_t) :: place, group, creation
    character(len=:), allocatable :: name
    integer :: ignored

    call self%locate(path, place, name)
    creation = of_group()
    if (present(members)) call ask_for_one_block(creation, members)
    call h5gcreate_f(place, name, group, stat, gcpl_id=creation)
    call h5pclose_f(creation, ignored)
    if (stat == 0) call h5gclose_f(group, ignored)
  end subroutine make_one_group

  !> Start a group that appears in the file only with commit_group; until then every path at or below `path` leads
  !> into it. Should the program die meanwhile, the file is what it was before.
  subroutine h5_begin_group(self, path, error)
    class(h5_tree_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    integer(hid_t) :: creation
    integer :: stat, ignored

    if (allocated(error)) return
    call self%abandon_group()
    if (self%exists(path)) call self%fail(path, "is in the file already", error)
    if (.not. allocated(error)) then
      creation = of_group()
      call h5gcreate_anon_f(self%root(), self%hidden, stat, gcpl_id=creation)
      call h5pclose_f(creation, ignored)
      if (stat < 0) then
        self%hidden = -1
        call self%fail(path, "cannot make this group", error)
      else
        self%hidden_path = path
      end if
    end if
    call self%comm%agree(error)
  end subroutine h5_begin_group

  !> Show the group that begin_group started: first its content is brought to the disk, then its name, which is one write
  !> where the group above has room for it in one block. Whenever the program dies, a reader finds the group whole or not.
  subroutine h5_commit_group(self, error)
    class(h5_tree_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error
    integer :: stat, ignored

    ! counted as if it had its name, so that the name changes nothing in it
    if (.not. allocated(error)) call h5oincr_refcount_f(self%hidden, ignored)
    call self%flush(error)
    call self%reserve(bytes_of_link, error)
    if (allocated(error)) then
      if (self%hidden >= 0) call h5odecr_refcount_f(self%hidden, ignored)
      call self%abandon_group()
      return
    end if
    call self%make_groups_above(self%hidden_path)
    call h5olink_f(self%hidden, self%root(), self%hidden_path, stat)
    if (stat < 0) call self%fail(self%hidden_path, "cannot make this group", error)
    call h5odecr_refcount_f(self%hidden, ignored)
    call self%comm%agree(error)
    call self%abandon_group()
    call self%flush(error)
  end subroutine h5_commit_group

  !> Let go of the group that begin_group started; HDF5 drops its content if it has no name yet. Collective.
  subroutine h5_abandon_group(self)
    class(h5_tree_t), intent(inout) :: self
    integer :: ignored

    if (self%hidden < 0) return
    call h5gclose_f(self%hidden, ignored)
    self%hidden = -1
    deallocate (self%hidden_path)
  end subroutine h5_abandon_group

  !> Remove a group and all that is in it; the file can use its room again.
  subroutine h5_remove_group(self, path, error)
    class(h5_tree_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    integer(hid_t) :: place
    character(len=:), allocatable :: name
    integer :: stat

    if (allocated(error)) return
    call self%locate(path, place, name)
    call h5ldelete_f(place, name, stat)
    if (stat < 0) call self%fail(path, "cannot remove this group", error)
    call self%comm%agree(error)
  end subroutine h5_remove_group

  !> Copy a group or dataset of another open file, with all that is in it and its attributes, if it has one of that path.
  subroutine h5_take_over(self, source, path, target_path, error)
    class(h5_tree_t), intent(inout) :: self
    class(h5_tree_t), intent(in) :: source
    !> in the other file, and here
    character(len=*), intent(in) :: path, target_path
    type(error_t), allocatable, intent(inout) :: error
    integer(hid_t) :: from, to
    character(len=:), allocatable :: name, target_name
    integer :: stat

    if (allocated(error)) return
    if (.not. source%exists(path)) return
    call source%locate(path, from, name)
    call self%make_groups_above(target_path)
    call self%locate(target_path, to, target_name)
    call h5ocopy_f(from, name, to, target_name, stat)
    if (stat < 0) call self%fail(target_path, "cannot copy "//path//" of "//source%where_it_is(), error)
    call self%comm%agree(error)
  end subroutine h5_take_over

  !> Where HDF5 finds `path`: a place and a name relative to it.
  subroutine h5_locate(self, path, place, name)
    class(h5_tree_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(hid_t), intent(out) :: place
    character(len=:), allocatable, intent(out) :: name

    place = self%root()
    name = path
    if (self%hidden < 0) return
    if (path == self%hidden_path) then
      place = self%hidden
      name = "."
    else if (index(path, self%hidden_path//"/") == 1) then
      place = self%hidden
      name = path(len(self%hidden_path) + 2:)
    end if
  end subroutine h5_locate

  !> True when the file has a group or dataset at `path`. Not collective.
  logical function h5_exists(self, path) result(exists)
    class(h5_tree_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(hid_t) :: place
    character(len=:), allocatable :: name
    integer :: i, stat

    call self%locate(path, place, name)
    exists = .true.
    ! every link on the way must exist before the next one may be asked for
    do i = 2, len(name)
      if (i < len(name) .and. name(min(i + 1, len(name)):min(i + 1, len(name))) /= "/") cycle
      call h5lexists_f(place, name(1:i), exists, stat)
      if (stat < 0) exists = .false.
      if (.not. exists) return
    end do
    if (len(name) == 1 .and. name /= "/" .and. name /= ".") call h5lexists_f(place, name, exists, stat)
  end function h5_exists

  !> Number of groups and datasets in a group, -1 of anything else. Not collective.
  integer function h5_member_count(self, path) result(n)
    class(h5_tree_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(hid_t) :: place
    character(len=:), allocatable :: name
    integer :: stat

    call self%locate(path, place, name)
    call h5gn_members_f(place, name, n, stat)
    if (stat < 0) n = -1
  end function h5_member_count

  !> Name of the i-th group or dataset in a group, in alphabetic order. Not collective.
  function h5_member(self, path, i) result(member)
    class(h5_tree_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer, intent(in) :: i
    character(len=:), allocatable :: member
    integer(hid_t) :: place
    character(len=:), allocatable :: name
    character(len=255) :: buffer
    integer :: stat

    call self%locate(path, place, name)
    call h5lget_name_by_idx_f(place, name, H5_INDEX_NAME_F, H5_ITER_INC_F, int(i - 1, hsize_t), buffer, stat)
    if (stat < 0) buffer = ""
    member = trim(buffer)
  end function h5_member

end module gravier_hdf5_tree
