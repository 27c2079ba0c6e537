!> The table of the loops over contacts: which procedure sweeps, which takes a residual, and so on, and the sizes of the packed
!> arrays that they work on. The table is filled once a run (gravier_contact_kernels), so that no loop branches on options.
module gravier_kernel_table
  use gravier_kinds, only: dp
  use gravier_contact_data, only: packed_layout_t
  implicit none
  private
  public :: kernel_table_t

  abstract interface
    !> One Gauss-Seidel sweep: updates velocity and impulse; sums = (sum of |r - y|^2, sum of |r|^2) over the contacts, y being
    !> the impulse that the sweep started from.
    pure subroutine sweep_kernel(n_grouped, pair, hot, weight, velocity, impulse, sums)
      import :: dp
      implicit none
      !> contacts in whole blocks without common bodies
      integer, intent(in) :: n_grouped
      integer, intent(in), contiguous :: pair(:, :)
      real(dp), intent(in), contiguous :: hot(:, :, :), weight(:, :)
      real(dp), intent(inout), contiguous :: velocity(:, :), impulse(:, :, :)
      real(dp), intent(out) :: sums(2)
    end subroutine sweep_kernel
    !> The same sweep, which also keeps the velocity of each contact as it was when its law was solved.
    pure subroutine recording_kernel(n_grouped, pair, hot, weight, velocity, impulse, sums, law_velocity)
      import :: dp
      implicit none
      !> contacts in whole blocks without common bodies
      integer, intent(in) :: n_grouped
      integer, intent(in), contiguous :: pair(:, :)
      real(dp), intent(in), contiguous :: hot(:, :, :), weight(:, :)
      real(dp), intent(inout), contiguous :: velocity(:, :), impulse(:, :, :)
      real(dp), intent(out) :: sums(2)
      real(dp), intent(inout), contiguous :: law_velocity(:, :, :)
    end subroutine recording_kernel
    !> The sweep starts from y = r + beta (r - previous), under which the velocities are, and leaves r in `previous`.
    pure subroutine momentum_kernel(n_grouped, pair, hot, weight, velocity, impulse, sums, beta, previous)
      import :: dp
      implicit none
      !> contacts in whole blocks without common bodies
      integer, intent(in) :: n_grouped
      integer, intent(in), contiguous :: pair(:, :)
      real(dp), intent(in), contiguous :: hot(:, :, :), weight(:, :)
      real(dp), intent(inout), contiguous :: velocity(:, :), impulse(:, :, :)
      real(dp), intent(out) :: sums(2)
      real(dp), intent(in) :: beta
      real(dp), intent(inout), contiguous :: previous(:, :, :)
    end subroutine momentum_kernel
    !> The sweep starts from extrapolated impulses and keeps the velocities.
    pure subroutine momentum_recording_kernel(n_grouped, pair, hot, weight, velocity, impulse, sums, beta, previous, law_velocity)
      import :: dp
      implicit none
      !> contacts in whole blocks without common bodies
      integer, intent(in) :: n_grouped
      integer, intent(in), contiguous :: pair(:, :)
      real(dp), intent(in), contiguous :: hot(:, :, :), weight(:, :)
      real(dp), intent(inout), contiguous :: velocity(:, :), impulse(:, :, :)
      real(dp), intent(out) :: sums(2)
      real(dp), intent(in) :: beta
      real(dp), intent(inout), contiguous :: previous(:, :, :)
      real(dp), intent(inout), contiguous :: law_velocity(:, :, :)
    end subroutine momentum_recording_kernel
    !> reaction := reaction + H impulse.
    pure subroutine reaction_kernel(pair, hot, impulse, reaction)
      import :: dp
      implicit none
      integer, intent(in), contiguous :: pair(:, :)
      real(dp), intent(in), contiguous :: hot(:, :, :), impulse(:, :, :)
      real(dp), intent(inout), contiguous :: reaction(:, :)
    end subroutine reaction_kernel
    !> contact_velocity := H^T velocity.
    pure subroutine velocity_kernel(pair, hot, velocity, contact_velocity)
      import :: dp
      implicit none
      integer, intent(in), contiguous :: pair(:, :)
      real(dp), intent(in), contiguous :: hot(:, :, :), velocity(:, :)
      real(dp), intent(inout), contiguous :: contact_velocity(:, :, :)
    end subroutine velocity_kernel
    !> 1/W_nn and, where the law has them, 1/W_tt and 1/W_rr into `hot`, times the share of each that sweeps take.
    pure subroutine operator_kernel(pair, hot, weight, share)
      import :: dp
      implicit none
      integer, intent(in), contiguous :: pair(:, :)
      real(dp), intent(inout), contiguous :: hot(:, :, :)
      real(dp), intent(in), contiguous :: weight(:, :)
      real(dp), intent(in) :: share(3)
    end subroutine operator_kernel
    !> sums = (sum of |r - P|^2, sum of |r|^2, sum of r_n times the shift), P being the local solve with the undivided local
    !> operator.
    pure subroutine residual_kernel(pair, hot, weight, velocity, impulse, sums)
      import :: dp
      implicit none
      integer, intent(in), contiguous :: pair(:, :)
      real(dp), intent(in), contiguous :: hot(:, :, :), weight(:, :), velocity(:, :), impulse(:, :, :)
      real(dp), intent(out) :: sums(3)
    end subroutine residual_kernel
    !> What the estimate of the velocity error needs (gravier_velocity_error), w = W (P - r) being the velocity by which a contact
    !> misses its law and W its undivided local operator: r . w of each contact, H y of the test impulses P - r and r - previous,
    !> added to `local` and `recent`, and sums. `largest` is raised to the largest |w|^2.
    pure subroutine tests_kernel(pair, hot, weight, velocity, impulse, on_bodies, previous, power, local, recent, kept, sums, &
      & largest)
      import :: dp
      implicit none
      integer, intent(in), contiguous :: pair(:, :)
      real(dp), intent(in), contiguous :: hot(:, :, :), weight(:, :), velocity(:, :)
      !> (lanes, nc, blocks); on_bodies: r without the attractions, which is `impulse` itself where there are none; previous: those
      !> of an earlier iteration [N s]
      real(dp), intent(in), contiguous :: impulse(:, :, :), on_bodies(:, :, :), previous(:, :, :)
      !> (lanes, blocks) [J]
      real(dp), intent(inout), contiguous :: power(:, :)
      !> (nv, n_columns) [N s, N m s]
      real(dp), intent(inout), contiguous :: local(:, :), recent(:, :)
      !> P - r (lanes, nc, blocks), or of no block where nobody asks for it [N s]
      real(dp), intent(inout), contiguous :: kept(:, :, :)
      !> the three of a residual; of y . w with the tests P - r, on_bodies and r - previous
      real(dp), intent(out) :: sums(6)
      real(dp), intent(inout) :: largest
    end subroutine tests_kernel
    !> powers = y . w of each contact, with w and the tests y of `tests_kernel`: P - r, on_bodies and r - previous; behind them
    !> r . W r, with the undivided local operator W.
    pure subroutine powers_kernel(pair, hot, weight, velocity, impulse, on_bodies, previous, powers)
      import :: dp
      implicit none
      integer, intent(in), contiguous :: pair(:, :)
      real(dp), intent(in), contiguous :: hot(:, :, :), weight(:, :), velocity(:, :)
      !> (lanes, nc, blocks) [N s]
      real(dp), intent(in), contiguous :: impulse(:, :, :), on_bodies(:, :, :), previous(:, :, :)
      !> (lanes, 4, blocks) [J]
      real(dp), intent(inout), contiguous :: powers(:, :, :)
    end subroutine powers_kernel
  end interface

  type, extends(packed_layout_t) :: kernel_table_t
    procedure(sweep_kernel), pointer, nopass :: sweep => null()
    procedure(recording_kernel), pointer, nopass :: sweep_recording => null()
    procedure(momentum_kernel), pointer, nopass :: sweep_momentum => null()
    procedure(momentum_recording_kernel), pointer, nopass :: sweep_momentum_recording => null()
    procedure(reaction_kernel), pointer, nopass :: add_reaction => null()
    procedure(velocity_kernel), pointer, nopass :: contact_velocity => null()
    procedure(operator_kernel), pointer, nopass :: set_operators => null()
    procedure(residual_kernel), pointer, nopass :: residual => null()
    procedure(tests_kernel), pointer, nopass :: make_tests => null()
    procedure(powers_kernel), pointer, nopass :: find_powers => null()
  end type kernel_table_t

end module gravier_kernel_table
