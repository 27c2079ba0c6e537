!> The motion of a periodic cell that deforms, as the contacts of a step feel it.
!>
!> The cell moves with the velocity gradient G: images by a way D move with the velocity G D. Contacts across the period meet such
!> images, so that the relative velocity of any contact is v = H^T V - G D, with the way D from the antagonist to its image that the
!> candidate meets, 0 within the cell. Where G changes in a step, grains are carried along, V := V + (G' - G) x with the places x
!> from the middle of the cell. With the branch l from the antagonist's image to the candidate, and velocities V to which this is
!> still to be added, v = H^T V + (G' - G) l - G D: what is added to H^T V is a constant of the contact, as a shift of its law is.
!>
!> A component of G is given, or a stress s drives it. Then it has an inertia K, and the mean stress of the contacts resists,
!> K (G' - G) = sum over the contacts of p l^T - h V s: the virial on the left of a Cauchy stress, compression positive, that is
!> held (M. Parrinello and A. Rahman, J. Appl. Phys. 52, 1981). The solve finds such a component along with the impulses.
module gravier_moving_cell
  use gravier_kinds, only: dp
  use gravier_periodic, only: gradient_times
  implicit none
  private
  public :: cell_motion_t, cell_contacts_t

  !> Of a step, the same on every rank. Matrices are 0 below the diagonal.
  type :: cell_motion_t
    !> the cell of the scene moves; stresses drive some component
    logical :: moves = .false., is_driven = .false.
    logical :: driven(3, 3) = .false.
    !> velocity gradient at the start of the step, at its end without contacts, and at its end [1/s]
    real(dp) :: before(3, 3) = 0.0_dp, free(3, 3) = 0.0_dp, now(3, 3) = 0.0_dp
    !> norm of the rates that a table gives, the larger one of some steps before and after the step; 0 without a table [1/s]
    real(dp) :: fastest = 0.0_dp
    !> of the components that stresses drive [kg m^2]
    real(dp) :: inertia(3, 3) = 1.0_dp
    !> stress held times the step, of the components that it drives [Pa s, N s/m in 2D]
    real(dp) :: impulse(3, 3) = 0.0_dp
  contains
    procedure :: added => cell_motion_added
    procedure :: n_driven => cell_motion_n_driven
  end type cell_motion_t

  !> What a subdomain knows of its contacts and grains in a cell that moves; not allocated in others.
  type :: cell_contacts_t
    !> from the image of the antagonist to the candidate, and from the antagonist to that image (nd, contacts) [m]
    real(dp), allocatable :: branch(:, :), way(:, :)
    !> what the law alone adds to the velocity, along n, t and s (nd, contacts) [m/s]
    real(dp), allocatable :: shift(:, :)
    !> of the grains at q_m, from the middle of the cell (nd, grains) [m]
    real(dp), allocatable :: place(:, :)
    !> what is added to the velocities where contacts do not move the cell, with the shift of the law (lanes, nf, blocks) [m/s]; and
    !> along n, t and s, l_b of each component ab that a stress drives (lanes, nf, components, blocks) [m]
    real(dp), allocatable :: free(:, :, :), lever(:, :, :, :)
  contains
    procedure :: init => cell_contacts_init
    procedure :: keep_shift => cell_contacts_keep_shift
  end type cell_contacts_t

contains

  !> Room for so many contacts and grains.
  pure subroutine cell_contacts_init(self, nd, n_contacts, n_grains)
    class(cell_contacts_t), intent(inout) :: self
    !> 2 or 3
    integer, intent(in) :: nd
    integer, intent(in) :: n_contacts, n_grains

    allocate (self%branch(nd, n_contacts), self%way(nd, n_contacts), self%shift(nd, n_contacts))
    allocate (self%place(nd, n_grains))
  end subroutine cell_contacts_init

  !> Where the cell moves, keep what the law alone adds to component `d` of the velocity of contact `c`.
  pure subroutine cell_contacts_keep_shift(self, d, c, shift)
    class(cell_contacts_t), intent(inout) :: self
    integer, intent(in) :: d, c
    !> [m/s]
    real(dp), intent(in) :: shift
    if (allocated(self%shift)) self%shift(d, c) = shift
  end subroutine cell_contacts_keep_shift

  !> Components of the gradient that stresses drive.
  pure integer function cell_motion_n_driven(self) result(n_driven)
    class(cell_motion_t), intent(in) :: self
    n_driven = count(self%driven)
  end function cell_motion_n_driven

  !> What a cell that has come to the gradient `g` adds to the velocity H^T V of a contact, V before grains are carried along [m/s].
  pure function cell_motion_added(self, g, branch, way) result(added)
    class(cell_motion_t), intent(in) :: self
    real(dp), intent(in) :: g(3, 3)
    !> (nd)
    real(dp), intent(in) :: branch(:), way(:)
    real(dp) :: added(size(branch)), carried(size(branch)), change(3, 3)

    change(:, :) = g - self%before
    added(:) = gradient_times(change, branch)
    carried(:) = gradient_times(self%before, way)
    added(:) = added - carried
  end function cell_motion_added

end module gravier_moving_cell
