!> A contact problem in the velocities and impulses of its contacts alone, v = W r + q with any blocks W_ab, packed by contacts:
!> the operator of Delassus, its evaluation, and two measures of how far impulses are from the law, both from r alone.
module gravier_delassus
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t, raise, status_input
  use gravier_text, only: to_text
  use gravier_sparse_rows, only: sparse_rows_t
  use gravier_friction_cone, only: project_on_cone
  implicit none
  private
  public :: delassus_t, most_impulse

  !> impulses, as velocities s |r| relative to max|q|, beyond this are not what loads can make, and rounding leaves too little of v
  real(dp), parameter :: most_impulse = 1.0e8_dp
  !> approach of a contact, relative to max|q|, that the tolerance on the consistent measure allows
  real(dp), parameter :: approach_of_tolerance = 10.0_dp

  type :: delassus_t
    !> of space: 2 or 3, the components (n, t) or (n, t, s) of a contact
    integer :: dimension = 0
    integer :: n_contacts = 0
    !> blocks first(a) to first(a + 1) - 1 couple contact a with others (n_contacts + 1), those of `other` (blocks)
    integer, allocatable :: first(:), other(:)
    !> by columns (dimension**2, blocks) and those of a contact with itself (dimension**2, n_contacts)
    real(dp), allocatable :: coupling(:, :), own(:, :)
    !> velocities without impulses (dimension, n_contacts), coefficients of friction (n_contacts)
    real(dp), allocatable :: q(:, :), mu(:)
    !> mean diagonal of each own block, 1/rho_a (n_contacts)
    real(dp), allocatable :: stiffness(:)
  contains
    procedure :: init => delassus_init
    procedure :: free => delassus_free
    procedure :: velocity => delassus_velocity
    procedure :: measure => delassus_measure
    procedure :: find_extremes => delassus_find_extremes
    procedure :: figure => delassus_figure
  end type delassus_t

contains

  !> Pack a problem. A contact that its own impulse cannot move raises an error.
  subroutine delassus_init(self, dimension, w, q, mu, error)
    class(delassus_t), intent(inout) :: self
    integer, intent(in) :: dimension
    !> (dimension*contacts, dimension*contacts)
    type(sparse_rows_t), intent(in) :: w
    !> (dimension*contacts), (contacts)
    real(dp), intent(in), contiguous :: q(:), mu(:)
    type(error_t), allocatable, intent(inout) :: error
    integer :: a, i

    if (allocated(error)) return
    call self%free()
    self%dimension = dimension
    self%n_contacts = size(mu)
    allocate (self%q(dimension, size(mu)), self%stiffness(size(mu)), self%own(dimension**2, size(mu)))
    self%mu = mu
    call find_blocks(self, w)
    call fill_blocks(self, w)
    do a = 1, self%n_contacts
      self%q(:, a) = q((a - 1)*dimension + 1:a*dimension)
      self%stiffness(a) = 0.0_dp
      do i = 1, dimension
        self%stiffness(a) = self%stiffness(a) + self%own(1 + (i - 1)*(dimension + 1), a)/dimension
      end do
      if (.not. (self%own(1, a) > 0.0_dp .and. self%stiffness(a) > 0.0_dp)) call raise(error, status_input, "contact "// &
        & to_text(a)//": normal and mean diagonal of W are "//to_text(self%own(1, a))//" and "//to_text(self%stiffness(a))// &
        & ": expected > 0")
    end do
  end subroutine delassus_init

  !> List the pairs of contacts that entries other than 0 couple.
  subroutine find_blocks(self, w)
    type(delassus_t), intent(inout) :: self
    type(sparse_rows_t), intent(in) :: w
    integer, allocatable :: seen_from(:), found(:)
    integer :: a, b, k, n, pass

    allocate (self%first(self%n_contacts + 1), seen_from(self%n_contacts), found(0))
    do pass = 1, 2
      seen_from(:) = 0
      n = 0
      do a = 1, self%n_contacts
        self%first(a) = n + 1
        do k = w%start((a - 1)*self%dimension + 1), w%start(a*self%dimension + 1) - 1
          b = (w%column(k) - 1)/self%dimension + 1
          if (b == a .or. seen_from(b) == a .or. abs(w%value(k)) <= 0.0_dp) cycle
          seen_from(b) = a
          n = n + 1
          if (pass == 2) found(n) = b
        end do
      end do
      self%first(self%n_contacts + 1) = n + 1
      if (pass == 1) then
        deallocate (found)
        allocate (found(n))
      end if
    end do
    call move_alloc(found, self%other)
    allocate (self%coupling(self%dimension**2, n))
  end subroutine find_blocks

  subroutine fill_blocks(self, w)
    type(delassus_t), intent(inout) :: self
    type(sparse_rows_t), intent(in) :: w
    integer, allocatable :: place(:)
    integer :: a, b, i, k, d, entry

    d = self%dimension
    allocate (place(self%n_contacts))
    place(:) = 0
    self%coupling(:, :) = 0.0_dp
    self%own(:, :) = 0.0_dp
    do a = 1, self%n_contacts
      do k = self%first(a), self%first(a + 1) - 1
        place(self%other(k)) = k
      end do
      do i = 1, d
        do k = w%start((a - 1)*d + i), w%start((a - 1)*d + i + 1) - 1
          b = (w%column(k) - 1)/d + 1
          entry = i + mod(w%column(k) - 1, d)*d
          if (b == a) then
            self%own(entry, a) = self%own(entry, a) + w%value(k)
          else if (abs(w%value(k)) > 0.0_dp) then
            self%coupling(entry, place(b)) = self%coupling(entry, place(b)) + w%value(k)
          end if
        end do
      end do
    end do
  end subroutine fill_blocks

  subroutine delassus_free(self)
    class(delassus_t), intent(inout) :: self

    self%dimension = 0
    self%n_contacts = 0
    if (allocated(self%first)) deallocate (self%first)
    if (allocated(self%other)) deallocate (self%other)
    if (allocated(self%coupling)) deallocate (self%coupling)
    if (allocated(self%own)) deallocate (self%own)
    if (allocated(self%q)) deallocate (self%q)
    if (allocated(self%mu)) deallocate (self%mu)
    if (allocated(self%stiffness)) deallocate (self%stiffness)
  end subroutine delassus_free

  !> v = W r + q.
  pure subroutine delassus_velocity(self, r, v)
    class(delassus_t), intent(in) :: self
    !> (dimension, contacts)
    real(dp), intent(in), contiguous :: r(:, :)
    real(dp), intent(out), contiguous :: v(:, :)

    if (self%dimension == 2) then
      call multiply_2d(self%first, self%other, self%coupling, self%own, self%q, r, v)
    else
      call multiply_3d(self%first, self%other, self%coupling, self%own, self%q, r, v)
    end if
  end subroutine delassus_velocity

  pure subroutine multiply_2d(first, other, coupling, own, q, r, v)
    integer, intent(in), contiguous :: first(:), other(:)
    real(dp), intent(in), contiguous :: coupling(:, :), own(:, :), q(:, :), r(:, :)
    real(dp), intent(out), contiguous :: v(:, :)
    real(dp) :: s1, s2, x1, x2
    integer :: a, k

    do a = 1, size(first) - 1
      x1 = r(1, a)
      x2 = r(2, a)
      s1 = q(1, a) + own(1, a)*x1 + own(3, a)*x2
      s2 = q(2, a) + own(2, a)*x1 + own(4, a)*x2
      do k = first(a), first(a + 1) - 1
        x1 = r(1, other(k))
        x2 = r(2, other(k))
        s1 = s1 + coupling(1, k)*x1 + coupling(3, k)*x2
        s2 = s2 + coupling(2, k)*x1 + coupling(4, k)*x2
      end do
      v(1, a) = s1
      v(2, a) = s2
    end do
  end subroutine multiply_2d

  pure subroutine multiply_3d(first, other, coupling, own, q, r, v)
    integer, intent(in), contiguous :: first(:), other(:)
    real(dp), intent(in), contiguous :: coupling(:, :), own(:, :), q(:, :), r(:, :)
    real(dp), intent(out), contiguous :: v(:, :)
    real(dp) :: s1, s2, s3, x1, x2, x3
    integer :: a, k

    do a = 1, size(first) - 1
      x1 = r(1, a)
      x2 = r(2, a)
      x3 = r(3, a)
      s1 = q(1, a) + own(1, a)*x1 + own(4, a)*x2 + own(7, a)*x3
      s2 = q(2, a) + own(2, a)*x1 + own(5, a)*x2 + own(8, a)*x3
      s3 = q(3, a) + own(3, a)*x1 + own(6, a)*x2 + own(9, a)*x3
      do k = first(a), first(a + 1) - 1
        x1 = r(1, other(k))
        x2 = r(2, other(k))
        x3 = r(3, other(k))
        s1 = s1 + coupling(1, k)*x1 + coupling(4, k)*x2 + coupling(7, k)*x3
        s2 = s2 + coupling(2, k)*x1 + coupling(5, k)*x2 + coupling(8, k)*x3
        s3 = s3 + coupling(3, k)*x1 + coupling(6, k)*x2 + coupling(9, k)*x3
      end do
      v(1, a) = s1
      v(2, a) = s2
      v(3, a) = s3
    end do
  end subroutine multiply_3d

  !> Two measures of the natural map, with De Saxce's velocities v^ = v + mu |v_t| n and the projection P on the cones:
  !> literature = |r - P(r - v^)| / max(|q|, |r|, |v|), which depends on units, and
  !> consistent = |s (r - P(r - v^/s))| / |q|, s the stiffness of each contact, which does not.
  pure subroutine delassus_measure(self, r, v, literature, consistent)
    class(delassus_t), intent(in) :: self
    !> impulses and their velocities W r + q (dimension, contacts)
    real(dp), intent(in), contiguous :: r(:, :), v(:, :)
    real(dp), intent(out) :: literature, consistent
    real(dp) :: shifted(self%dimension), image(self%dimension), scale
    integer :: a

    literature = 0.0_dp
    consistent = 0.0_dp
    do a = 1, self%n_contacts
      shifted = v(:, a)
      shifted(1) = shifted(1) + self%mu(a)*norm2(v(2:, a))
      image = r(:, a) - shifted
      call project_on_cone(image, self%mu(a))
      literature = literature + sum((r(:, a) - image)**2)
      image = r(:, a) - shifted/self%stiffness(a)
      call project_on_cone(image, self%mu(a))
      consistent = consistent + self%stiffness(a)**2*sum((r(:, a) - image)**2)
    end do
    scale = norm2(self%q)
    consistent = ratio(sqrt(consistent), scale)
    literature = ratio(sqrt(literature), max(scale, norm2(r), norm2(v)))
  end subroutine delassus_measure

  !> Largest velocity of approach max(-v_n, 0), and largest impulse as a velocity s |r|, both relative to max|q|, with their
  !> contacts.
  pure subroutine delassus_find_extremes(self, r, v, approach, impulse, contacts)
    class(delassus_t), intent(in) :: self
    !> impulses and their velocities W r + q (dimension, contacts)
    real(dp), intent(in), contiguous :: r(:, :), v(:, :)
    real(dp), intent(out) :: approach, impulse
    !> that of the approach, that of the impulse; 0 where there is none
    integer, intent(out) :: contacts(2)
    real(dp) :: scale, load
    integer :: a

    approach = 0.0_dp
    impulse = 0.0_dp
    contacts = 0
    scale = 0.0_dp
    do a = 1, self%n_contacts
      scale = max(scale, norm2(self%q(:, a)))
      load = self%stiffness(a)*norm2(r(:, a))
      ! what is not a number is the largest
      if (.not. -v(1, a) <= approach) then
        approach = -v(1, a)
        contacts(1) = a
      end if
      if (.not. load <= impulse) then
        impulse = load
        contacts(2) = a
      end if
    end do
    approach = ratio(approach, scale)
    impulse = ratio(impulse, scale)
  end subroutine delassus_find_extremes

  !> What a tolerance is compared with: the consistent measure, or a tenth of the largest velocity of approach, relative to max|q|,
  !> if that is larger. No tolerance is met where an impulse is beyond what loads can make: rounding hides its velocities then.
  pure real(dp) function delassus_figure(self, r, v) result(figure)
    class(delassus_t), intent(in) :: self
    !> impulses and their velocities W r + q (dimension, contacts)
    real(dp), intent(in), contiguous :: r(:, :), v(:, :)
    real(dp) :: ignored, approach, impulse
    integer :: contacts(2)

    call self%measure(r, v, ignored, figure)
    call self%find_extremes(r, v, approach, impulse, contacts)
    ! what is not a number meets no tolerance, wherever it is
    if (.not. (ieee_is_finite(figure) .and. ieee_is_finite(approach) .and. ieee_is_finite(impulse))) then
      figure = huge(figure)
      return
    end if
    figure = max(figure, approach/approach_of_tolerance)
    if (impulse > most_impulse .and. any(abs(self%q) > 0.0_dp)) figure = huge(figure)
  end function delassus_figure

  !> A defect relative to its scale; 0 where there is none.
  elemental real(dp) function ratio(defect, scale)
    real(dp), intent(in) :: defect, scale
    ratio = defect
    if (scale > 0.0_dp) ratio = defect/scale
  end function ratio

end module gravier_delassus
