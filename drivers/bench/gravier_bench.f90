!> gravier_bench: kernels, parts of a step and scaling, measured in one run.
program gravier_bench
  use, intrinsic :: iso_fortran_env, only: output_unit, error_unit
  use mpi_f08, only: MPI_COMM_SELF
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_ok, status_input
  use gravier_text, only: to_text
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_command_line, only: leave
  use gravier_file_system, only: check_creatable, remove_file
  use gravier_own_files, only: check_own_files, part_of
  use gravier_output_lock, only: output_lock_t
  use gravier_bench_groups, only: measure_exchange, measure_interface, measure_steps, measure_scaling
  use gravier_bench_kernels, only: kernel_problem_t, kernel_names, make_kernels, measure_kernels, sweep_kernel, &
    & make_effects, measure_effects
  use gravier_bench_options, only: options_t, read_options, usage
  use gravier_bench_record, only: record_t, case_t
  use gravier_bench_triad, only: triad_t, triad_bytes
  implicit none

  type(communicator_t), target :: world, alone
  type(options_t) :: options
  type(record_t) :: record
  type(error_t), allocatable :: error
  integer :: status

  call start_parallel()
  call world%init()
  call alone%init(MPI_COMM_SELF)
  status = status_ok
  call read_options(kernel_names, options, error)
  if (allocated(error)) then
    continue
  else if (options%help) then
    if (world%rank == 0) write (output_unit, "(a)") usage
  else if (options%kernel /= "") then
    call run_kernel()
  else
    call run_all()
  end if
  if (allocated(error)) then
    if (world%rank == 0) write (error_unit, "(a)") "gravier_bench: error: "//error%message
    flush (error_unit)
    status = error%status
  end if
  call alone%free()
  call world%free()
  call stop_parallel()
  call leave(status)

contains

  !> Sweeps of one kernel.
  subroutine run_kernel()
    integer :: contacts

    if (world%rank == 0) then
      call sweep_kernel(options, contacts, error)
      if (.not. allocated(error)) write (output_unit, "(a)") options%kernel//": "//to_text(contacts)//" contacts, "// &
        & to_text(options%sweeps)//" sweeps"
    end if
    call world%agree(error)
  end subroutine run_kernel

  !> All groups, one after the other, and the table. Collective.
  subroutine run_all()
    type(error_t), allocatable :: reason
    type(output_lock_t) :: lock

    if (world%rank == 0) then
      call check_creatable(part_of(options%csv), reason)
      if (allocated(reason)) call raise(error, status_input, "--csv '"//options%csv//"': "//reason%message)
      call remove_file(part_of(options%csv))
    end if
    call world%agree(error)
    call lock%take_file(world, options%csv, "gravier_bench", error)
    if (.not. allocated(error)) call measure_all()
    call lock%release()
  end subroutine run_all

  !> Measure and write. Collective.
  subroutine measure_all()
    call sweep_and_triad()
    if (.not. allocated(error)) call measure_exchange(world, alone, options, record, error)
    call say("exchange")
    if (.not. allocated(error)) call measure_interface(world, alone, options, record, error)
    call say("interface")
    if (.not. allocated(error)) call measure_steps(world, alone, options, record, error)
    call say("step")
    if (.not. allocated(error)) call measure_scaling(world, alone, options, record, error)
    call say("strong_scaling")
    call say("weak_scaling")
    if (allocated(error)) return
    if (world%rank == 0) then
      call record%write(options%csv, error)
      call check_own_files(error)
      if (.not. allocated(error)) write (output_unit, "(a)") "written: "//options%csv
    end if
    call world%agree(error)
  end subroutine measure_all

  !> Rounds of the triad, on one core and on all at once, and of all kernels on one core. Collective.
  subroutine sweep_and_triad()
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
      if (world%size > 1) call note_triad(world, triad, bandwidth)
      if (world%rank > 0) cycle
      call note_triad(alone, triad, bandwidth)
      call measure_kernels(options, problems, bandwidth, record)
      call measure_effects(options, effects, record)
    end do
    call world%barrier_asleep()
    call say("triad")
    call say("kernel_core_cache")
    call say("kernel_last_cache")
    call say("kernel_memory")
    call say("effect")
  end subroutine sweep_and_triad

  !> Bandwidth of the ranks of `comm` at once. Collective over them.
  subroutine note_triad(comm, triad, bandwidth)
    type(communicator_t), intent(in) :: comm
    type(triad_t), intent(inout) :: triad
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

  subroutine say(group)
    character(len=*), intent(in) :: group
    if (world%rank == 0 .and. .not. allocated(error)) call record%print(output_unit, group)
  end subroutine say

end program gravier_bench
