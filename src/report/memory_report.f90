!> What a run keeps in memory, array by array.
module gravier_memory_report
  use gravier_kinds, only: dp, i8
  use gravier_contact_spring, only: spring_step_t
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_body_store, only: body_layout_t
  use gravier_method_options, only: held_list_t
  use gravier_simulation, only: simulation_t
  implicit none
  private
  public :: memory_report_t, report_memory, item_bytes, peak_memory

  !> A kind of item, the bytes of one, array by array, and how many all ranks keep.
  type :: item_t
    character(len=:), allocatable :: name, arrays
    integer(i8) :: bytes = 0, number = 0
  contains
    procedure :: add => item_add
  end type item_t

  type :: memory_report_t
    type(item_t) :: items(5)
    !> bytes of all ranks, and of the rank with most
    integer(i8) :: total = 0, most = 0
    !> what a rank is expected to hold at most [MiB]
    real(dp) :: peak = 0.0_dp
  end type memory_report_t

  !> a table that is written is in memory once, and its widest column this often besides: as records, and on several ranks as what
  !> is sent or received; to find the order of its rows takes so many words of a row
  integer, parameter :: column_copies(2) = [1, 2], ordering_words = 3
  !> words of a row of a picture: of a grain and of a contact
  integer, parameter :: picture_words(2) = [13, 12]
  !> holes in the heap, over what is held
  real(dp), parameter :: holes = 0.2_dp
  !> of libraries when they write for the first time, on one rank and on several [MiB]
  real(dp), parameter :: of_first_output(2) = [4.0_dp, 8.0_dp]
  real(dp), parameter :: bytes_of_mebibyte = 1048576.0_dp

contains

  !> Bytes of the arrays of an assembled simulation, counted from their shapes. Collective.
  subroutine report_memory(simulation, libraries, report)
    type(simulation_t), intent(in) :: simulation
    !> held by this rank before there was a scene [MiB]
    real(dp), intent(in) :: libraries
    type(memory_report_t), intent(out) :: report
    integer(i8) :: counts(5), most
    integer :: k

    call describe(simulation, report%items)
    call count_items(simulation, counts)
    most = 0
    do k = 1, size(counts)
      most = most + counts(k)*report%items(k)%bytes
    end do
    ! the start, which a check makes too, or the steps
    report%peak = simulation%comm%highest(of_first_output(merge(2, 1, simulation%comm%size > 1)) + &
      & max(peak_memory(), libraries + (1.0_dp + holes)*real(most + max(written_bytes(simulation, counts), &
      & solve_bytes(simulation, counts)), dp)/bytes_of_mebibyte))
    report%most = simulation%comm%largest(most)
    call simulation%comm%sum_counts(counts)
    do k = 1, size(counts)
      report%items(k)%number = counts(k)
      report%total = report%total + counts(k)*report%items(k)%bytes
    end do
  end subroutine report_memory

  !> Bytes of the copies of a state that is written.
  integer(i8) function written_bytes(simulation, counts) result(bytes)
    type(simulation_t), intent(in) :: simulation
    !> of the items of this rank
    integer(i8), intent(in) :: counts(5)
    integer :: of_grain, of_contact, copies

    copies = column_copies(merge(2, 1, simulation%comm%size > 1))
    associate (nd => simulation%decomposition%nd, output => simulation%config%output)
      of_grain = 2 + nd + (3*nd - 3) + merge(nd, 0, simulation%decomposition%ni > 0)
      of_contact = merge(3 + 2*nd + merge(2*nd - 3, 0, simulation%problem%has_rolling()), 0, output%contacts)
      bytes = 8*max(counts(5)*(of_grain + copies*(3*nd - 3) + ordering_words), &
        & counts(1)*merge(of_contact + copies*nd + ordering_words, 0, output%contacts))
      if (.not. output%vtk) return
      ! points are made from the rows of the bodies; of a line both ends are taken out of its row
      bytes = max(bytes, 8*counts(5)*(of_grain + picture_words(1) + 3*copies + ordering_words))
      if (output%contacts) bytes = max(bytes, 8*counts(1)*(picture_words(2) + 6*(1 + copies) + ordering_words))
    end associate
  end function written_bytes

  !> Bytes of what a solve keeps beside its method: velocities of two iterations, powers of contacts, impulses of two iterations.
  integer(i8) function solve_bytes(simulation, counts) result(bytes)
    type(simulation_t), intent(in) :: simulation
    !> of the items of this rank
    integer(i8), intent(in) :: counts(5)

    associate (kernels => simulation%problem%kernels)
      bytes = 8*(counts(3)*2*kernels%nv + counts(1)*(1 + 2*kernels%nc))
    end associate
  end function solve_bytes

  !> Bytes of a contact, of a body in contact, and of what an exchange sends of a copy of a shared body.
  subroutine item_bytes(simulation, contact, body, copy)
    type(simulation_t), intent(in) :: simulation
    integer(i8), intent(out) :: contact, body, copy
    type(item_t) :: items(5)

    call describe(simulation, items)
    contact = items(1)%bytes
    body = items(3)%bytes
    copy = simulation%problem%nv*storage_size(0.0_dp)/8
  end subroutine item_bytes

  !> The arrays of each kind of item.
  subroutine describe(simulation, items)
    type(simulation_t), intent(in) :: simulation
    type(item_t), intent(inout) :: items(5)
    type(held_list_t) :: held

    call simulation%method%held(simulation%problem%nc, simulation%problem%nv, held)
    call describe_contact(simulation, held, items(1))
    items(2)%name = "near pair"
    call items(2)%add("pair", 4, 2)
    call items(2)%add("periods between them", 4, merge(1, 0, simulation%decomposition%ni > 0))
    call items(2)%add("impulse", 8, simulation%halo%memory%n_impulse)
    call items(2)%add("elongation of its spring", 8, simulation%halo%memory%n_spring)
    call items(2)%add("whether a body is awake", 4, merge(1, 0, simulation%halo%memory%touch_row > 0))
    call items(2)%add("state of its law", 4, simulation%halo%memory%n_states())
    call describe_body(simulation, held, items(3))
    items(4)%name = "grain seen, ghosts included"
    call add_grain(simulation, items(4))
    call items(4)%add("owner", 4, 2)
    items(5)%name = "grain owned"
    call add_grain(simulation, items(5))
    call items(5)%add("reference", 8, simulation%decomposition%nd + 1)
  end subroutine describe

  !> What is kept of a contact; `held` is what the method holds.
  subroutine describe_contact(simulation, held, item)
    type(simulation_t), intent(in) :: simulation
    type(held_list_t), intent(in) :: held
    type(item_t), intent(inout) :: item

    associate (kernels => simulation%problem%kernels)
      item%name = "contact"
      call item%add("pair", 4, 2)
      call item%add("coefficients of sweeps", 8, kernels%nh)
      call item%add("impulse", 8, kernels%nc)
      if (simulation%physics%laws%attracts) call item%add("attraction", 8, 1)
      if (simulation%physics%laws%yields) call item%add("spring", 8, storage_size(spring_step_t())/64)
      call item%add("gap", 8, 1)
      call item%add("place in the list of pairs", 4, 1)
      ! a projection of places borrows these
      if (simulation%overlap_allowed < huge(1.0_dp)) &
        & call item%add("projections of overlaps", 2, 4*(merge(2, 1, kernels%nf > 1) + 2*kernels%nc) + 1)
      call add_held(item, held, of_contacts=.true.)
    end associate
  end subroutine describe_contact

  !> What is kept of a body in contact; `held` is what the method holds.
  subroutine describe_body(simulation, held, item)
    type(simulation_t), intent(in) :: simulation
    type(held_list_t), intent(in) :: held
    type(item_t), intent(inout) :: item

    associate (kernels => simulation%problem%kernels)
      item%name = "body in contact, in each subdomain"
      call item%add("id", 8, 1)
      call item%add("subdomain that owns it", 4, 1)
      call item%add("place among those owned", 4, 1)
      call item%add("number of subdomains that share it", 4, 1)
      call item%add("radius", 8, 1)
      call item%add("velocity without contacts", 8, kernels%nv)
      if (simulation%physics%laws%attracts) call item%add("impulses of attractions", 8, kernels%nv)
      call item%add("velocity in the subdomain", 8, kernels%nv)
      call item%add("velocity of the whole body", 8, kernels%nv)
      call item%add("sum of impulses", 8, kernels%nv)
      call add_held(item, held, of_contacts=.false.)
      call item%add("inverse mass", 8, kernels%nw)
      call item%add("inverse mass of its part", 8, kernels%nw)
      if (simulation%overlap_allowed < huge(1.0_dp)) call item%add("projections of overlaps", 4, 1)
    end associate
  end subroutine describe_body

  !> What the method holds for each contact, or for each body.
  subroutine add_held(item, held, of_contacts)
    type(item_t), intent(inout) :: item
    type(held_list_t), intent(in) :: held
    logical, intent(in) :: of_contacts
    integer :: k

    do k = 1, held%n
      associate (array => held%item(k))
        if (array%of_contacts .eqv. of_contacts) call item%add(trim(array%name), array%bytes, array%values)
      end associate
    end do
  end subroutine add_held

  !> The fields of a grain.
  subroutine add_grain(simulation, item)
    type(simulation_t), intent(in) :: simulation
    type(item_t), intent(inout) :: item
    type(body_layout_t) :: layout
    !> fields that sleeping has
    character(len=*), parameter :: of_sleep(5) = [character(len=8) :: "rest", "wakes_at", "held", "stirred", "wandered"]
    character(len=:), allocatable :: name
    integer :: f, bytes, entries, sleep

    layout = simulation%decomposition%layout()
    f = 0
    sleep = 0
    do
      f = f + 1
      call layout%describe_field(f, name, bytes, entries)
      if (len(name) == 0) exit
      if (any(of_sleep == name)) then
        sleep = sleep + bytes*entries
      else
        call item%add(name, bytes, entries)
      end if
    end do
    call item%add("sleep", 1, sleep)
  end subroutine add_grain

  !> Add an array of so many entries an item; one without entries is not kept at all.
  subroutine item_add(self, name, bytes, entries)
    class(item_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer, intent(in) :: bytes, entries

    if (.not. allocated(self%arrays)) self%arrays = ""
    if (entries == 0) return
    if (len(self%arrays) > 0) self%arrays = self%arrays//", "
    self%arrays = self%arrays//name//" "//to_text(bytes*entries)
    self%bytes = self%bytes + bytes*entries
  end subroutine item_add

  subroutine count_items(simulation, counts)
    type(simulation_t), intent(in) :: simulation
    !> of this rank
    integer(i8), intent(out) :: counts(5)
    integer :: s

    counts(:) = 0
    do s = 1, size(simulation%problem%sub)
      associate (sub => simulation%problem%sub(s), view => simulation%halo%view(s))
        counts(1) = counts(1) + sub%n_contacts
        counts(2) = counts(2) + view%list%n
        counts(3) = counts(3) + sub%n_columns
        counts(4) = counts(4) + view%n_bodies()
        counts(5) = counts(5) + simulation%decomposition%owned(s)%n
      end associate
    end do
  end subroutine count_items

  !> Most memory that this process has held so far [MiB], as Linux counts it; 0 where the system does not tell.
  real(dp) function peak_memory() result(mebibytes)
    character(len=120) :: line
    integer :: unit, stat, kibibytes

    mebibytes = 0.0_dp
    open (newunit=unit, file="/proc/self/status", action="read", status="old", iostat=stat)
    if (stat /= 0) return
    do
      read (unit, "(a)", iostat=stat) line
      if (stat /= 0) exit
      if (line(1:6) /= "VmHWM:") cycle
      read (line(7:), *, iostat=stat) kibibytes
      if (stat == 0) mebibytes = kibibytes/1024.0_dp
      exit
    end do
    close (unit)
  end function peak_memory

end module gravier_memory_report
