!> A process that no launcher of MPI has started. Open MPI starts a daemon for it and looks for networks, which takes longer than
!> many a run; alone it needs neither. What the user's environment says stays. Other libraries of MPI do not look at these names.
module gravier_lone_process
  use gravier_process, only: suggest_environment, forget_environment
  implicit none
  private
  public :: ease_start, start_is_over, n_suggested

  !> Names of which a launcher sets one: of PMIx (mpirun, prterun, srun), of PMI (Hydra, srun, Flux), of mpirun and of Cray's aprun
  !> and PALS.
  character(len=*), parameter :: launchers(*) = [character(len=21) :: "PMIX_RANK", "PMIX_NAMESPACE", "PMI_RANK", "PMI_FD", &
    & "OMPI_COMM_WORLD_SIZE", "SLURM_STEP_ID", "FLUX_TASK_RANK", "ALPS_APP_PE", "PALS_RANKID"]
  !> What is suggested: names and values. The last one holds as long as the process goes on, for it is read where the first file
  !> is opened. Isolated processes have one directory of Open MPI in common. Shared file pointers in memory ("sm") would keep files
  !> there, which the first process that ends removes under the others. Those beside a file ("lockedfile") leave a file for each
  !> process that is killed, and those of their own ("individual") two, which the next process there removes. No shared file
  !> pointer is in use here.
  character(len=*), parameter :: suggested(2, 3) = reshape([character(len=31) :: &
    & "OMPI_MCA_ess_singleton_isolated", "1", "OMPI_MCA_pml", "ob1", "OMPI_MCA_sharedfp", "individual"], [2, 3])
  !> suggestions, and how many of them count for MPI_Init alone
  integer, parameter :: n_suggested = size(suggested, 2), n_for_start = 2

contains

  !> Suggest to Open MPI how it starts a process that is alone; before MPI_Init.
  subroutine ease_start(eased)
    !> which of the suggestions are new
    logical, intent(out) :: eased(n_suggested)
    integer :: k, length

    eased(:) = .false.
    do k = 1, size(launchers)
      call get_environment_variable(trim(launchers(k)), length=length)
      if (length > 0) return
    end do
    do k = 1, n_suggested
      call suggest_environment(trim(suggested(1, k)), trim(suggested(2, k)), eased(k))
    end do
  end subroutine ease_start

  !> Forget after MPI_Init the suggestions that count for it alone: programs that this process starts would find them.
  subroutine start_is_over(eased)
    !> of `ease_start`
    logical, intent(in) :: eased(n_suggested)
    integer :: k

    do k = 1, n_for_start
      if (eased(k)) call forget_environment(trim(suggested(1, k)))
    end do
  end subroutine start_is_over

end module gravier_lone_process
