!> The least memory that a run takes, or a sample, known before its grains are made.
module gravier_run_memory
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_memory_need, only: check_memory
  use gravier_bodies_data, only: data_bytes
  use gravier_insertion, only: insertion_t
  use gravier_config_types, only: config_t
  implicit none
  private
  public :: check_planned_grains, check_read_grains, check_entering_grains, check_written_sample

  !> bytes of a grain that touches no other, with its copies on the way from the scene to the first step, in 2D and 3D, without spin
  !> and with it. The peaks of runs grow by 524, 629, 640 and 860 a grain (test_run_memory.py)
  integer, parameter :: run_bytes(2:3, 0:1) = reshape([520, 625, 635, 855], [2, 2])
  !> bytes of a grain that is made and written, in 2D and 3D. In a lattice its way to the file takes the most. Loosely placed grains
  !> take more while they try places, and those of one radius, which all try at once, the most. Peaks are above these figures by
  !> 1 to 3 %, and by a third where radii differ a lot (test_run_memory.py)
  integer, parameter :: sample_bytes(2:3, 3) = reshape([215, 325, 230, 325, 340, 420], [2, 3])

contains

  !> Refuse grains that the input asks for by number and that the machine has no memory for (status_failure). Errors are the same on
  !> all ranks. Collective.
  subroutine check_planned_grains(comm, config, error)
    type(communicator_t), intent(in) :: comm
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: key
    real(dp) :: number

    select case (config%scene%bodies)
    case ("column")
      key = "&scene column_count"
      number = config%scene%column_count
    case ("lattice")
      key = "&scene lattice_count"
      number = product(real(config%scene%lattice_count(1:config%scene%dimension), dp))
    case ("sample")
      key = "&sample count"
      number = config%sample%count
    case default
      return
    end select
    call check_asked(comm, config, key, number, bytes_of_grain(config), error)
  end subroutine check_planned_grains

  !> The same for a sample that is written as it is made. Collective.
  subroutine check_written_sample(comm, config, error)
    type(communicator_t), intent(in) :: comm
    type(config_t), intent(in) :: config
    type(error_t), allocatable, intent(inout) :: error
    integer :: kind

    kind = 1
    if (config%sample%arrangement == "loose") kind = merge(3, 2, config%sample%radii == "single")
    call check_asked(comm, config, "&sample count", real(config%sample%count, dp), &
      & sample_bytes(config%scene%dimension, kind), error)
  end subroutine check_written_sample

  !> Refuse a number of grains that a key asks for where there is no memory for them. Collective.
  subroutine check_asked(comm, config, key, number, bytes_each, error)
    type(communicator_t), intent(in) :: comm
    type(config_t), intent(in) :: config
    !> with its group
    character(len=*), intent(in) :: key
    real(dp), intent(in) :: number
    integer, intent(in) :: bytes_each
    type(error_t), allocatable, intent(inout) :: error

    call check_memory(comm, config%file//": "//key//": "//number_text(number)//" grains", number, bytes_each, error)
  end subroutine check_asked

  !> The same for grains that were read: what a run takes besides. Collective.
  subroutine check_read_grains(comm, config, number, error)
    type(communicator_t), intent(in) :: comm
    type(config_t), intent(in) :: config
    !> of all ranks
    integer(i8), intent(in) :: number
    type(error_t), allocatable, intent(inout) :: error

    call check_memory(comm, trim(config%scene%bodies_file)//": "//to_text(number)//" grains", real(number, dp), &
      & bytes_of_grain(config) - data_bytes(config%scene%dimension), error)
  end subroutine check_read_grains

  !> The same for grains that are to enter until the end of the run, as far as their number is bounded. How many of them a scene
  !> with outlets has at once is not known. Collective.
  subroutine check_entering_grains(comm, config, insertions, error)
    type(communicator_t), intent(in) :: comm
    type(config_t), intent(in) :: config
    type(insertion_t), intent(in) :: insertions(:)
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: number
    integer :: i

    if (any(config%boundaries%shape == "outlet")) return
    do i = 1, size(insertions)
      if (allocated(error)) return
      number = insertions(i)%planned(config%time%steps*config%time%step)
      if (.not. number < huge(1.0_dp)) cycle
      call check_asked(comm, config, "&insertion '"//insertions(i)%name//"'", number, bytes_of_grain(config), error)
    end do
  end subroutine check_entering_grains

  !> The least bytes that a run takes for a grain.
  pure integer function bytes_of_grain(config) result(least)
    type(config_t), intent(in) :: config

    least = run_bytes(config%scene%dimension, merge(1, 0, config%scene%contact%friction > 0.0_dp .and. size(config%materials) == 0))
  end function bytes_of_grain

  !> A number of grains, whole as long as it can be counted.
  pure function number_text(number) result(text)
    real(dp), intent(in) :: number
    character(len=:), allocatable :: text

    if (number < 1.0e18_dp) then
      text = to_text(nint(number, i8))
    else
      text = to_text(number, 3)
    end if
  end function number_text

end module gravier_run_memory
