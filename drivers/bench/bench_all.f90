!> What one run of gravier_bench measures: one kernel, or all groups and their table.
module gravier_bench_all
  use, intrinsic :: iso_fortran_env, only: output_unit
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t
  use gravier_file_system, only: check_creatable, remove_file
  use gravier_own_files, only: check_own_files, part_of
  use gravier_table_place, only: check_table_place
  use gravier_output_lock, only: output_lock_t
  use gravier_bench_groups, only: measure_exchange, measure_interface, measure_steps, measure_scaling
  use gravier_bench_kernels, only: kernel_problem_t, make_kernels, measure_kernels, sweep_kernel, make_effects, measure_effects
  use gravier_bench_options, only: options_t
  use gravier_bench_record, only: record_t, case_t
  use gravier_bench_triad, only: triad_t, triad_bytes
  implicit none
  private
  public :: run_kernel, run_all

contains

  !> Sweeps of one kernel. Errors are the same on all ranks. Collective.
  subroutine run_kernel(world, options, error)
    type(communicator_t), intent(in) :: world
    type(options_t), intent(in) :: options
    type(error_t), allocatable, intent(inout) :: error
    integer :: contacts

    if (world%rank == 0) then
      call sweep_kernel(options, contacts, error)
      if (.not. allocated(error)) write (output_unit, "(a)") options%kernel//": "//to_text(contacts)//" contacts, "// &
        & to_text(options%sweeps)//" sweeps"
    end if
    call world%agree(error)
  end subroutine run_kernel

  !> All groups, one after the other, and the table. Errors are the same on all ranks. Collective.
  subroutine run_all(world, alone, options, error)
    !> all ranks, and this one
    type(communicator_t), target, intent(in) :: world, alone
    type(options_t), intent(in) :: options
    type(error_t), allocatable, intent(inout) :: error
    type(record_t) :: record
    type(error_t), allocatable :: reason
    type(output_lock_t) :: lock

    if (world%rank == 0) then
      call check_creatable(part_of(options%csv), reason)
      if (allocated(reason)) call raise(error, status_input, "--csv '"//options%csv//"': "//reason%message)
      call remove_file(part_of(options%csv))
      call check_table_place(options%csv, "group,case,size,", error)
    end if
    call world%agree(error)
    call lock%take_file(world, options%csv, "gravier_bench", error)
    if (.not. allocated(error)) call measure_all(world, alone, options, record, error)
    call lock%release()
  end subroutine run_all

  !> Measure and write. Collective.
  subroutine measure_all(world, alone, options, record, error)
    type(communicator_t), target, intent(in) :: world, alone
    type(options_t), intent(in) :: options
    type(record_t), intent(inout) :: record
    type(error_t), allocatable, intent(inout) :: error
    call sweep_and_triad(world, alone, options, record, error)
    if (.not. allocated(error)) call measure_exchange(world, alone, options, record, error)
    call say(world, record, "exchange", error)
    if (.not. allocated(error)) call measure_interface(world, alone, options, record, error)
    call say(world, record, "interface", error)
    if (.not. allocated(error)) call measure_steps(world, alone, options, record, error)
    call say(world, record, "step", error)
    if (.not. allocated(error)) call measure_scaling(world, alone, options, record, error)
    call say(world, record, "strong_scaling", error)
    call say(world, record, "weak_scaling", error)
    if (allocated(error)) return
    if (world%rank == 0) then
      call record%write(options%csv, error)
      call check_own_files(error)
      if (.not. allocated(error)) write (output_unit, "(a)") "written: "//options%csv
    end if
    call world%agree(error)
  end subroutine measure_all

  !> Rounds of the triad, on one core and on all at once, and of all kernels on one core. Collective.
  subroutine sweep_and_triad(world, alone, options, record, error)
    type(communicator_t), target, intent(in) :: world, alone
    type(options_t), intent(in) :: options
    type(record_t), intent(inout) :: record
    type(error_t), allocatable, intent(inout) :: error
    type(kernel_problem_t), allocatable :: problems(:), effects(:)
    type(triad_t) :: triad
    real(dp) :: bandwidth
    integer :: r

    call triad%init(options%triad, world%size)
    if (world%rank == 0) call make_kernels(options, problems, error)
    if (world%rank == 0) call make_effects(options, effects, error)
    do r = 1, options%rounds
      call world%barrier_asleep()
      call world%agree(error)
      if (allocated(error)) return
      if (world%size > 1) call note_triad(world, options, triad, record, bandwidth)
      if (world%rank > 0) cycle
      call note_triad(alone, options, triad, record, bandwidth)
      call measure_kernels(options, problems, bandwidth, record)
      call measure_effects(options, effects, record)
    end do
    call world%barrier_asleep()
    call say(world, record, "triad", error)
    call say(world, record, "kernel_core_cache", error)
    call say(world, record, "kernel_last_cache", error)
    call say(world, record, "kernel_memory", error)
    call say(world, record, "effect", error)
  end subroutine sweep_and_triad

  !> Bandwidth of the ranks of `comm` at once. Collective over them.
  subroutine note_triad(comm, options, triad, record, bandwidth)
    type(communicator_t), intent(in) :: comm
    type(options_t), intent(in) :: options
    type(triad_t), intent(inout) :: triad
    type(record_t), intent(inout) :: record
    !> [B/s]
    real(dp), intent(out) :: bandwidth
    real(dp) :: own(1)
    type(case_t) :: of

    call comm%barrier()
    own(1) = triad%run(options%seconds)
    bandwidth = comm%sum_real(own)
    of = case_t("triad", "triad", int(triad%elements(), i8), comm%size)
    call record%note(of, "bandwidth", "B/s", bandwidth)
    call record%note(of, "bytes_per_element", "B", real(triad_bytes, dp))
  end subroutine note_triad

  !> Print the figures of a group, unless something has failed.
  subroutine say(world, record, group, error)
    type(communicator_t), intent(in) :: world
    type(record_t), intent(in) :: record
    character(len=*), intent(in) :: group
    type(error_t), allocatable, intent(in) :: error
    if (world%rank == 0 .and. .not. allocated(error)) call record%print(output_unit, group)
  end subroutine say

end module gravier_bench_all
