!> Space that repeats itself along some axes. The cell that repeats may deform: its edges a along x, b in the plane of x and y, and
!> c change with time, and images of bodies move with the velocity that the edges give them.
module gravier_periodic
  use gravier_kinds, only: dp, i8
  implicit none
  private
  public :: period_t, wrap, gradient_times, no_shift, shift_code, shift_of_code, most_images, period_words, period_record

  !> Bodies are kept in the box [origin, origin + length) along each axis whose length is not 0. The images of a place x are
  !> x + n1 a + n2 b + n3 c with whole numbers n and the edges
  !>     a = (length(1), 0, 0),  b = (tilt(1), length(2), 0),  c = (tilt(2), tilt(3), length(3)).
  type :: period_t
    !> [m]
    real(dp) :: length(3) = 0.0_dp, origin(3) = 0.0_dp
    !> what the edges have along other axes: b along x, c along x, c along y [m]
    real(dp) :: tilt(3) = 0.0_dp
    !> rates of the lengths and tilts [m/s]
    real(dp) :: length_rate(3) = 0.0_dp, tilt_rate(3) = 0.0_dp
    !> rates of shear xy, xz and yz, integrated since the start of the scene
    real(dp) :: shear(3) = 0.0_dp
    !> whether lengths or tilts change in this scene
    logical :: moves = .false.
    !> whether a length would have come to 0 or below; it keeps its last value above 0
    logical :: collapsed = .false.
  contains
    procedure :: on => period_on
    procedure :: wrap => period_wrap
    procedure :: add_shift => period_add_shift
    procedure :: add_velocity => period_add_velocity
    procedure :: find_images => period_find_images
    procedure :: gradient => period_gradient
    procedure :: set_gradient => period_set_gradient
    procedure :: unwrap => period_unwrap
    procedure :: centre => period_centre
    procedure :: move => period_move
    procedure :: straighten => period_straighten
    procedure :: strain_since => period_strain_since
    procedure :: get_state => period_get_state
    procedure :: set_state => period_set_state
  end type period_t

  !> code of the shift by no period
  integer, parameter :: no_shift = 62
  !> images of a place that may lie near the cell
  integer, parameter :: most_images = 125
  !> words of the state of a cell, and what they are: the version of checkpoints, which changes with them
  integer, parameter :: period_words = 18
  character(len=*), parameter :: period_record = "length origin tilt length_rate tilt_rate shear"

contains

  !> Whether some axis is periodic.
  pure logical function period_on(self)
    class(period_t), intent(in) :: self
    period_on = any(self%length > 0.0_dp)
  end function period_on

  !> Bring a point into the cell, last axis first, because edges have parts along the axes before theirs.
  pure subroutine period_wrap(self, x, turns)
    class(period_t), intent(in) :: self
    !> (nd) [m]
    real(dp), intent(inout) :: x(:)
    !> (nd): periods taken away along each axis
    integer, intent(out) :: turns(:)
    real(dp) :: inside
    integer :: d

    do d = size(x), 1, -1
      call wrap(x(d), self%origin(d), self%length(d), inside, turns(d))
      x(d) = inside
      if (.not. self%moves .or. turns(d) == 0) cycle
      if (d == 3) x(1:2) = x(1:2) - turns(3)*self%tilt(2:3)
      if (d == 2) x(1) = x(1) - turns(2)*self%tilt(1)
    end do
  end subroutine period_wrap

  !> Move a place, or a way, by the shift of a code times `sense`.
  pure subroutine period_add_shift(self, code, sense, x)
    class(period_t), intent(in) :: self
    integer, intent(in) :: code
    !> 1, or -1 for the opposite way
    integer, intent(in) :: sense
    !> (nd) [m]
    real(dp), intent(inout) :: x(:)
    integer :: shift(3)

    shift(:) = shift_of_code(code)
    shift(:) = sense*shift
    call add_edges(shift, self%length, self%tilt, x)
  end subroutine period_add_shift

  !> Add the velocity with which images by a shift move.
  pure subroutine period_add_velocity(self, shift, v)
    class(period_t), intent(in) :: self
    !> periods along each axis
    integer, intent(in) :: shift(3)
    !> (nd) [m/s]
    real(dp), intent(inout) :: v(:)

    call add_edges(shift, self%length_rate, self%tilt_rate, v)
  end subroutine period_add_velocity

  !> x := x + shift(1) a + shift(2) b + shift(3) c.
  pure subroutine add_edges(shift, length, tilt, x)
    integer, intent(in) :: shift(3)
    real(dp), intent(in) :: length(3), tilt(3)
    real(dp), intent(inout) :: x(:)
    real(dp) :: way(3)
    integer :: d

    way(1) = shift(1)*length(1) + shift(2)*tilt(1) + shift(3)*tilt(2)
    way(2) = shift(2)*length(2) + shift(3)*tilt(3)
    way(3) = shift(3)*length(3)
    do d = 1, size(x)
      x(d) = x(d) + way(d)
    end do
  end subroutine add_edges

  !> Move a place out of the cell by the periods that `wrap` has taken away, and give a velocity what they change by.
  pure subroutine period_unwrap(self, turns, x, v)
    class(period_t), intent(in) :: self
    !> (nd): periods along each axis
    integer, intent(in) :: turns(:)
    !> (nd) [m]
    real(dp), intent(inout) :: x(:)
    !> (nd) [m/s]
    real(dp), intent(inout), optional :: v(:)
    integer :: shift(3)

    shift(:) = 0
    shift(1:size(turns)) = turns
    call add_edges(shift, self%length, self%tilt, x)
    if (present(v)) call self%add_velocity(shift, v)
  end subroutine period_unwrap

  !> Shifts that bring a place of the cell to the cell or within `margin` of it, in ascending order; `margin` is less than half of
  !> each length.
  pure subroutine period_find_images(self, x, margin, shifts, n)
    class(period_t), intent(in) :: self
    !> (nd) in the cell [m]
    real(dp), intent(in) :: x(:)
    real(dp), intent(in) :: margin
    !> the first n are set
    integer, intent(out) :: shifts(3, most_images), n
    integer :: x_range(2), y_range(2), z_range(2), i, j, k
    real(dp) :: place(3)

    place(:) = 0.0_dp
    place(1:size(x)) = x
    n = 0
    z_range(:) = 0
    if (size(x) == 3) z_range(:) = shifts_along(3, place(3))
    do k = z_range(1), z_range(2)
      y_range(:) = shifts_along(2, place(2) + k*self%tilt(3))
      do j = y_range(1), y_range(2)
        x_range(:) = shifts_along(1, place(1) + k*self%tilt(2) + j*self%tilt(1))
        do i = x_range(1), x_range(2)
          n = n + 1
          shifts(1, n) = i
          shifts(2, n) = j
          shifts(3, n) = k
        end do
      end do
    end do

  contains

    !> The first and the last number of lengths that bring a coordinate near the box.
    pure function shifts_along(d, at) result(range)
      integer, intent(in) :: d
      real(dp), intent(in) :: at
      integer :: range(2), farthest

      range(:) = 0
      if (.not. self%length(d) > 0.0_dp) return
      farthest = merge(2, 1, self%moves)
      range(1) = max(-farthest, ceiling((self%origin(d) - margin - at)/self%length(d)))
      range(2) = min(farthest, floor((self%origin(d) + self%length(d) + margin - at)/self%length(d)))
    end function shifts_along

  end subroutine period_find_images

  !> Gradient G of the velocity field that carries the cell, image velocity = G . shift; 0 beyond the diagonal and along axes that
  !> are not periodic [1/s].
  pure function period_gradient(self) result(g)
    class(period_t), intent(in) :: self
    real(dp) :: g(3, 3)
    integer :: d

    g(:, :) = 0.0_dp
    do d = 1, 3
      if (self%length(d) > 0.0_dp) g(d, d) = self%length_rate(d)/self%length(d)
    end do
    if (self%length(2) > 0.0_dp) g(1, 2) = (self%tilt_rate(1) - g(1, 1)*self%tilt(1))/self%length(2)
    if (.not. self%length(3) > 0.0_dp) return
    g(2, 3) = (self%tilt_rate(3) - g(2, 2)*self%tilt(3))/self%length(3)
    g(1, 3) = (self%tilt_rate(2) - g(1, 1)*self%tilt(2) - g(1, 2)*self%tilt(3))/self%length(3)
  end function period_gradient

  !> Let the edges move with the velocity gradient `g`.
  pure subroutine period_set_gradient(self, g)
    class(period_t), intent(inout) :: self
    !> 0 below the diagonal [1/s]
    real(dp), intent(in) :: g(3, 3)
    integer :: d

    do d = 1, 3
      self%length_rate(d) = g(d, d)*self%length(d)
    end do
    self%tilt_rate(1) = g(1, 1)*self%tilt(1) + g(1, 2)*self%length(2)
    self%tilt_rate(2) = g(1, 1)*self%tilt(2) + g(1, 2)*self%tilt(3) + g(1, 3)*self%length(3)
    self%tilt_rate(3) = g(2, 2)*self%tilt(3) + g(2, 3)*self%length(3)
  end subroutine period_set_gradient

  !> G x of a velocity gradient that is 0 below the diagonal.
  pure function gradient_times(g, x) result(v)
    !> [1/s]
    real(dp), intent(in) :: g(3, 3)
    !> (nd) [m]
    real(dp), intent(in) :: x(:)
    real(dp) :: v(size(x))
    integer :: d, e

    do d = 1, size(x)
      v(d) = 0.0_dp
      do e = d, size(x)
        v(d) = v(d) + g(d, e)*x(e)
      end do
    end do
  end function gradient_times

  !> The middle of the box, which stays where it is while the cell deforms [m].
  pure function period_centre(self) result(centre)
    class(period_t), intent(in) :: self
    real(dp) :: centre(3)

    centre(:) = self%origin + 0.5_dp*self%length
  end function period_centre

  !> Rates of shear xy, xz and yz [1/s].
  pure subroutine find_shear_rate(cell, rate)
    type(period_t), intent(in) :: cell
    real(dp), intent(out) :: rate(3)
    real(dp) :: g(3, 3)

    g(:, :) = cell%gradient()
    rate(1:2) = g(1, 2:3)
    rate(3) = g(2, 3)
  end subroutine find_shear_rate

  !> Move the edges for a time at their rates, and count the shear. A cell that would collapse stays as it is, and says so.
  pure subroutine period_move(self, duration)
    class(period_t), intent(inout) :: self
    !> [s]
    real(dp), intent(in) :: duration
    real(dp) :: rate(3)

    if (.not. self%moves) return
    self%collapsed = self%collapsed .or. any(self%length > 0.0_dp .and. .not. self%length + duration*self%length_rate > 0.0_dp)
    if (self%collapsed) return
    call find_shear_rate(self, rate)
    self%shear(:) = self%shear + duration*rate
    self%length(:) = self%length + duration*self%length_rate
    self%origin(:) = self%origin - 0.5_dp*duration*self%length_rate
    self%tilt(:) = self%tilt + duration*self%tilt_rate
  end subroutine period_move

  !> Take other edges of the same lattice, whose tilts are at most half a length: c - k(3) b, then c - k(2) a and b - k(1) a. Shifts
  !> n become n(2) + k(3) n(3), then n(1) + k(1) n(2) + k(2) n(3).
  pure subroutine period_straighten(self, k)
    class(period_t), intent(inout) :: self
    integer, intent(out) :: k(3)

    k(:) = 0
    if (.not. self%moves) return
    k(3) = whole(self%tilt(3), self%length(2))
    self%tilt(2) = self%tilt(2) - k(3)*self%tilt(1)
    self%tilt(3) = self%tilt(3) - k(3)*self%length(2)
    self%tilt_rate(2) = self%tilt_rate(2) - k(3)*self%tilt_rate(1)
    self%tilt_rate(3) = self%tilt_rate(3) - k(3)*self%length_rate(2)
    k(2) = whole(self%tilt(2), self%length(1))
    k(1) = whole(self%tilt(1), self%length(1))
    self%tilt(1:2) = self%tilt(1:2) - k(1:2)*self%length(1)
    self%tilt_rate(1:2) = self%tilt_rate(1:2) - k(1:2)*self%length_rate(1)
  end subroutine period_straighten

  !> Whole lengths in a tilt that is longer than half of one.
  pure integer function whole(tilt, length)
    real(dp), intent(in) :: tilt, length

    whole = 0
    if (length > 0.0_dp .and. abs(tilt) > 0.5_dp*length) whole = nint(tilt/length)
  end function whole

  !> F = (edges now) (edges then)^-1 of the same lattice, which takes an image that moves with the cell from then to now.
  pure function period_strain_since(self, then) result(f)
    class(period_t), intent(in) :: self
    type(period_t), intent(in) :: then
    real(dp) :: f(3, 3)
    integer :: d

    f(:, :) = 0.0_dp
    do d = 1, 3
      f(d, d) = 1.0_dp
      if (self%length(d) > 0.0_dp) f(d, d) = self%length(d)/then%length(d)
    end do
    if (self%length(2) > 0.0_dp) f(1, 2) = (self%tilt(1) - f(1, 1)*then%tilt(1))/then%length(2)
    if (.not. self%length(3) > 0.0_dp) return
    f(2, 3) = (self%tilt(3) - f(2, 2)*then%tilt(3))/then%length(3)
    f(1, 3) = (self%tilt(2) - f(1, 1)*then%tilt(2) - f(1, 2)*then%tilt(3))/then%length(3)
  end function period_strain_since

  !> All that moves, bit for bit.
  pure subroutine period_get_state(self, words)
    class(period_t), intent(in) :: self
    integer(i8), intent(out) :: words(period_words)
    real(dp) :: reals(period_words)
    integer :: k

    reals(1:3) = self%length
    reals(4:6) = self%origin
    reals(7:9) = self%tilt
    reals(10:12) = self%length_rate
    reals(13:15) = self%tilt_rate
    reals(16:18) = self%shear
    do k = 1, period_words
      words(k) = transfer(reals(k), 0_i8)
    end do
  end subroutine period_get_state

  pure subroutine period_set_state(self, words)
    class(period_t), intent(inout) :: self
    integer(i8), intent(in) :: words(period_words)
    real(dp) :: reals(period_words)
    integer :: k

    do k = 1, period_words
      reals(k) = transfer(words(k), 0.0_dp)
    end do
    self%length(:) = reals(1:3)
    self%origin(:) = reals(4:6)
    self%tilt(:) = reals(7:9)
    self%length_rate(:) = reals(10:12)
    self%tilt_rate(:) = reals(13:15)
    self%shear(:) = reals(16:18)
  end subroutine period_set_state

  !> The image of `x` in [origin, origin + period), also after rounding, and the whole periods between: `x` is about
  !> inside + turns*period. A coordinate more than 2^30 periods away has turns +-huge(1); one that is not a number goes to
  !> `origin`.
  elemental subroutine wrap(x, origin, period, inside, turns)
    !> [m]; period 0: the axis is not periodic, inside is x
    real(dp), intent(in) :: x, origin, period
    real(dp), intent(out) :: inside
    integer, intent(out) :: turns
    real(dp), parameter :: far = 2.0_dp**30
    real(dp) :: apart

    inside = x
    turns = 0
    if (.not. period > 0.0_dp) return
    apart = x - origin
    if (abs(apart)*(1.0_dp/far) < period) then
      turns = floor(apart/period)
      if (turns /= 0) inside = x - turns*period
    else
      turns = merge(huge(1), -huge(1), apart > 0.0_dp)
      inside = origin + modulo(apart, period)
    end if
    ! rounding may have put it one period off
    if (inside < origin) then
      inside = inside + period
      if (abs(turns) < huge(1)) turns = turns - 1
    end if
    if (inside >= origin + period) then
      inside = inside - period
      if (abs(turns) < huge(1)) turns = turns + 1
    end if
    if (.not. (inside >= origin .and. inside < origin + period)) inside = origin
  end subroutine wrap

  !> One number for a shift of -2 to 2 periods along each axis.
  pure integer function shift_code(shift) result(code)
    integer, intent(in) :: shift(3)
    code = (shift(1) + 2) + 5*(shift(2) + 2) + 25*(shift(3) + 2)
  end function shift_code

  pure function shift_of_code(code) result(shift)
    integer, intent(in) :: code
    integer :: shift(3)

    shift(1) = mod(code, 5) - 2
    shift(2) = mod(code/5, 5) - 2
    shift(3) = code/25 - 2
  end function shift_of_code

end module gravier_periodic
