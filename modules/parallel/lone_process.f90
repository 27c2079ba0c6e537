!> A process that no launcher of MPI has started. Open MPI starts a daemon for it and looks for networks, which takes longer than
!> many a run; alone it needs neither. What the user's environment says stays. Other libraries of MPI do not look at these names.
module gravier_lone_process
  use gravier_process, only: suggest_environment
  implicit none
  private
  public :: ease_start

  !> Names of which a launcher sets one: of PMIx (mpirun, prterun, srun), of PMI (Hydra, srun, Flux), of mpirun and of Cray's aprun
  !> and PALS.
  character(len=*), parameter :: launchers(*) = [character(len=21) :: "PMIX_RANK", "PMIX_NAMESPACE", "PMI_RANK", "PMI_FD", &
    & "OMPI_COMM_WORLD_SIZE", "SLURM_STEP_ID", "FLUX_TASK_RANK", "ALPS_APP_PE", "PALS_RANKID"]

contains

  !> Suggest to Open MPI how it starts a process that is alone; before MPI_Init.
  subroutine ease_start()
    integer :: k, length

    do k = 1, size(launchers)
      call get_environment_variable(trim(launchers(k)), length=length)
      if (length > 0) return
    end do
    call suggest_environment("OMPI_MCA_ess_singleton_isolated", "1")
    call suggest_environment("OMPI_MCA_pml", "ob1")
  end subroutine ease_start

end module gravier_lone_process
