!> Figures of a step, and the check that they are numbers.
module gravier_step_figures
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, raise, status_failure
  use gravier_text, only: to_text
  use gravier_finite, only: is_finite
  use gravier_solve_report, only: solve_report_t
  use gravier_decomposition, only: decomposition_t
  use gravier_interface, only: interface_statistics_t
  use gravier_given_impulses, only: started_t
  use gravier_deep_contacts, only: deep_contacts_t
  use gravier_cell_drive, only: check_cell_size
  use gravier_diagnostics, only: diagnostics_t
  implicit none
  private
  public :: step_figures_t

  !> Figures of a step, the same on every rank.
  type :: step_figures_t
    type(solve_report_t) :: solve
    type(interface_statistics_t) :: interface_statistics
    integer(i8) :: contacts = 0
    !> grains that left by an outlet; grains that move by more than half of their thickness, a ball by its radius, in a step
    integer(i8) :: left = 0, fast = 0
    !> mass of those that left [kg]
    real(dp) :: left_mass = 0.0_dp
    !> where bodies have shapes, contacts that are pressed deep for the thinner body
    type(deep_contacts_t) :: deep
    !> grains that have entered, and their mass [kg]
    integer(i8) :: entered = 0
    real(dp) :: entered_mass = 0.0_dp
    !> the neighbour lists were made anew; space was divided anew, or should have been
    logical :: listed = .false., divided = .false.
    !> why the old partition stays where space should have been divided anew
    character(len=:), allocatable :: refusal
    !> seconds in sweeps since the partition before this one, the most over the mean, of the ranks and of the subdomains; where
    !> space was divided anew
    real(dp) :: rank_balance = 1.0_dp, subdomain_balance = 1.0_dp
    !> contacts that were left out, because their bodies sleep; how often the step was solved, anew where bodies woke
    integer(i8) :: asleep = 0
    integer :: tries = 1
    !> of the first step, where a file gives contacts with forces: what the solve started from
    type(started_t) :: started
    !> places were projected, because some overlap exceeded what is allowed
    logical :: projected = .false.
    !> of rigid contacts [m], 0 where nothing overlaps; [J]
    real(dp) :: max_overlap = 0.0_dp, kinetic_energy = 0.0_dp
    !> after a solve that diverged to NaN or infinity: a contact where it did; after one whose impulses grow without bound: the
    !> contact with the largest
    character(len=:), allocatable :: cause
  contains
    procedure :: uncertain_velocity => step_figures_uncertain_velocity
    procedure :: check_numbers => step_figures_check_numbers
  end type step_figures_t

  !> times the estimated velocity error, a mean by mass, by which what a contact does is taken to be wrong at most
  real(dp), parameter :: trusted = 10.0_dp
  !> rounding of velocities, over what the largest impulses of a step give to a grain
  real(dp), parameter :: rounding = 1.0e-12_dp

contains

  !> The velocity up to which the solve may be wrong about what a contact does: the larger of what it errs by as a whole and of the
  !> most by which a contact violates its law. The velocity scale limits it, because an error that is not known is a huge number
  !> [m/s].
  pure real(dp) function step_figures_uncertain_velocity(self, of_bonds) result(uncertain)
    class(step_figures_t), intent(in) :: self
    !> what the strength of bonds gives to the mean grain in a step [m/s]
    real(dp), intent(in) :: of_bonds

    associate (solve => self%solve)
      uncertain = min(max(trusted*solve%velocity_error, solve%violation), solve%velocity_scale)
    end associate
    uncertain = max(uncertain, rounding*of_bonds)
  end function step_figures_uncertain_velocity

  !> Fail (status_failure) where a figure of the step is NaN or infinite. Errors are the same on all ranks. Collective.
  subroutine step_figures_check_numbers(self, decomposition, diagnostics, step, error)
    class(step_figures_t), intent(in) :: self
    type(decomposition_t), intent(in) :: decomposition
    type(diagnostics_t), intent(in) :: diagnostics
    !> steps made with this one
    integer, intent(in) :: step
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: place(3)
    integer :: s, k, b

    if (.not. is_finite(self%kinetic_energy)) then
      do s = 1, size(decomposition%owned)
        associate (owned => decomposition%owned(s))
          do k = 1, owned%n
            if (.not. is_finite(owned%mass(k)*sum(owned%velocity(:, k)**2))) &
              & call refuse("kinetic energy of body "//to_text(owned%id(k)))
          end do
        end associate
      end do
      call decomposition%comm%agree(error)
    end if
    do b = 1, size(decomposition%boundaries)
      associate (boundary => decomposition%boundaries(b))
        call boundary%find_place(place)
        if (.not. (all(is_finite(place)) .and. all(is_finite(boundary%velocity)))) &
          & call refuse("motion of boundary '"//boundary%name//"'")
      end associate
    end do
    if (decomposition%period%moves) call check_cell_size(decomposition, step, error)
    if (.not. is_finite(self%kinetic_energy)) call refuse("kinetic energy")
    if (.not. is_finite(self%max_overlap)) call refuse("largest overlap")
    if (.not. is_finite(self%solve%residual)) call refuse("residual")
    if (.not. is_finite(self%solve%jump)) call refuse("jump")
    do k = 1, diagnostics%n_columns
      if (.not. (is_finite(diagnostics%value(k)) .or. diagnostics%is_absent(k))) call refuse(trim(diagnostics%name(k)))
    end do

  contains

    subroutine refuse(what)
      character(len=*), intent(in) :: what

      call raise(error, status_failure, "step "//to_text(step)//": "//what//": not a finite number; expected speeds, "// &
        & "loads and a &time step that give finite ones")
    end subroutine refuse

  end subroutine step_figures_check_numbers

end module gravier_step_figures
