!> A region of means, a box with sides along the axes that may be cut into equal bins along one of them, and which parts of bodies
!> and of branches of contacts lie in it.
module gravier_mean_region
  use gravier_kinds, only: dp, i4, i8
  use gravier_shape_library, only: body_shape_t
  use gravier_body_part, only: turned_body_t, ball_below
  implicit none
  private
  public :: mean_region_t, region_grid_t, share_list_t, unbounded, region_words

  !> coordinate of a side that a region does not have [m]
  real(dp), parameter :: unbounded = 1.0e30_dp
  !> characters of a name at most, of which a word of 8 bytes has so many
  integer, parameter :: region_name_length = 64, word_characters = 8
  !> words that say what is asked of a region: its name, its corners, axis, bins and sample_every
  integer, parameter :: region_words = region_name_length/word_characters + 6 + 3
  !> what rounding may take of a period that a region spans
  real(dp), parameter :: nearly = 1.0e-9_dp
  !> parts of a branch in a box and its images: branches are shorter than half a period, so that there are two along an axis
  integer, parameter :: max_parts = 8
  !> shares for which a list has room at first
  integer, parameter :: first_room = 16

  !> A region as it is given.
  type :: mean_region_t
    character(len=:), allocatable :: name
    !> corners, -unbounded and unbounded where there is no side [m]
    real(dp) :: lower(3) = -unbounded, upper(3) = unbounded
    !> axis along which there are bins, and how many; 0: none
    integer :: axis = 0, bins = 0
    !> steps from one sample of the bins to the next, of which the bins of a written state are the mean; 0: they are of its step
    integer :: sample_every = 0
  contains
    procedure :: make_grid => mean_region_make_grid
    procedure :: get_words => mean_region_get_words
  end type mean_region_t

  !> Which bins take how much of something.
  type :: share_list_t
    integer :: n = 0
    !> (n and more)
    integer, allocatable :: bin(:)
    real(dp), allocatable :: share(:)
  end type share_list_t

  !> The bins of a region in a scene as it is: all of it in one, or those along an axis.
  type :: region_grid_t
    integer :: nd = 0
    !> axis of the bins, and their number
    integer :: axis = 1, n = 1
    !> corners of the space that the region takes (nd), and the places of the sides of bins along their axis (0:n) [m]
    real(dp), allocatable :: lower(:), upper(:), side(:)
    !> volume of each bin (n) [m^3, m^2 in 2D]
    real(dp), allocatable :: volume(:)
    !> whether bodies end at the sides of each axis: not where there is no side, and not where the region spans a period (nd)
    logical, private, allocatable :: cuts_low(:), cuts_high(:)
    !> after which the region repeats itself along each axis, 0 where it does not (nd) [m]
    real(dp), allocatable :: period(:)
  contains
    procedure :: bin_of => region_grid_bin_of
    procedure :: share_ball => region_grid_share_ball
    procedure :: share_body => region_grid_share_body
    procedure :: share_segment => region_grid_share_segment
    procedure, private :: cut => region_grid_cut
    procedure, private :: place => region_grid_place
  end type region_grid_t

contains

  !> What is asked of the region, bit by bit: two regions that differ in anything have other words.
  pure subroutine mean_region_get_words(self, words)
    class(mean_region_t), intent(in) :: self
    integer(i8), intent(out) :: words(region_words)
    character(len=region_name_length) :: name
    integer :: k, at

    name = self%name
    at = region_name_length/word_characters
    do k = 1, at
      words(k) = transfer(name((k - 1)*word_characters + 1:k*word_characters), 0_i8)
    end do
    do k = 1, 3
      words(at + k) = transfer(self%lower(k), 0_i8)
      words(at + 3 + k) = transfer(self%upper(k), 0_i8)
    end do
    words(at + 7) = self%axis
    words(at + 8) = self%bins
    words(at + 9) = self%sample_every
  end subroutine mean_region_get_words

  !> The space that the region takes in a scene: sides that it does not have are those of the scene.
  pure subroutine mean_region_make_grid(self, low, high, period, binned, grid)
    class(mean_region_t), intent(in) :: self
    !> of the scene along each axis (nd) [m]
    real(dp), intent(in) :: low(:), high(:)
    !> of the scene, 0 along axes that are not periodic (nd) [m]
    real(dp), intent(in) :: period(:)
    !> cut into its bins, not as a whole
    logical, intent(in) :: binned
    type(region_grid_t), intent(out) :: grid
    real(dp) :: volume
    integer :: nd, d, k

    nd = size(low)
    grid%nd = nd
    if (binned .and. self%bins > 0) then
      grid%axis = self%axis
      grid%n = self%bins
    end if
    grid%lower = low
    grid%upper = high
    grid%period = period
    allocate (grid%cuts_low(nd), grid%cuts_high(nd))
    volume = 1.0_dp
    do d = 1, nd
      if (self%lower(d) > -unbounded) grid%lower(d) = self%lower(d)
      if (self%upper(d) < unbounded) grid%upper(d) = self%upper(d)
      grid%upper(d) = max(grid%upper(d), grid%lower(d))
      grid%cuts_low(d) = self%lower(d) > -unbounded .or. period(d) > 0.0_dp
      grid%cuts_high(d) = self%upper(d) < unbounded .or. period(d) > 0.0_dp
      if (period(d) > 0.0_dp .and. grid%upper(d) - grid%lower(d) >= period(d)*(1.0_dp - nearly)) then
        ! bins of a whole period still have sides
        grid%upper(d) = grid%lower(d) + period(d)
        grid%cuts_low(d) = d == grid%axis .and. grid%n > 1
        grid%cuts_high(d) = grid%cuts_low(d)
        volume = volume*period(d)
      else
        volume = volume*(grid%upper(d) - grid%lower(d))
      end if
    end do
    allocate (grid%volume(grid%n), source=volume/grid%n)
    allocate (grid%side(0:grid%n))
    associate (from => grid%lower(grid%axis), to => grid%upper(grid%axis))
      do k = 0, grid%n
        grid%side(k) = from + (to - from)*(real(k, dp)/grid%n)
      end do
    end associate
  end subroutine mean_region_make_grid

  !> The bin that holds a point, 0 for one outside. Lower sides belong to a bin, upper ones do not.
  pure integer function region_grid_bin_of(self, x) result(bin)
    class(region_grid_t), intent(in) :: self
    !> (nd) [m]
    real(dp), intent(in) :: x(:)
    real(dp) :: y
    integer :: d

    bin = 0
    do d = 1, self%nd
      if (d == self%axis) cycle
      if (.not. (self%cuts_low(d) .or. self%cuts_high(d))) cycle
      y = image_above(x(d), self%lower(d), self%period(d))
      if (self%cuts_low(d) .and. y < self%lower(d)) return
      if (self%cuts_high(d) .and. y >= self%upper(d)) return
    end do
    d = self%axis
    y = image_above(x(d), self%lower(d), self%period(d))
    if (self%cuts_low(d) .and. y < self%lower(d)) return
    ! what rounding puts on the end of a period is in the last bin
    if (self%cuts_high(d) .and. y >= self%upper(d) .and. &
      & .not. (self%period(d) > 0.0_dp .and. self%upper(d) - self%lower(d) >= self%period(d))) return
    bin = self%place(y)
  end function region_grid_bin_of

  !> The bin along the axis at `y`, the first or the last one beyond the sides.
  pure integer function region_grid_place(self, y) result(bin)
    class(region_grid_t), intent(in) :: self
    !> [m]
    real(dp), intent(in) :: y
    real(dp) :: length

    length = self%side(self%n) - self%side(0)
    bin = 1
    if (.not. length > 0.0_dp) return
    bin = 1 + int(min(max((y - self%side(0))/length, 0.0_dp), 1.0_dp)*self%n, i4)
    bin = min(bin, self%n)
    ! what the division rounds
    if (y < self%side(bin - 1) .and. bin > 1) bin = bin - 1
    if (y >= self%side(bin) .and. bin < self%n) bin = bin + 1
  end function region_grid_place

  !> The point y = x + k period with from <= y < from + period; x without a period.
  pure real(dp) function image_above(x, from, period) result(y)
    real(dp), intent(in) :: x, from, period

    y = x
    if (.not. period > 0.0_dp) return
    ! rounding must not put it below the side
    y = max(x - period*floor((x - from)/period), from)
  end function image_above

  !> The parts of the volume of a ball, a disk in 2D, in the bins. Exact where sides of one axis cut it; the part beyond sides of
  !> several axes is the product of their parts, so that the bins and boxes that fill space together have the whole ball.
  pure subroutine region_grid_share_ball(self, x, radius, list)
    class(region_grid_t), intent(in) :: self
    !> (nd) [m]
    real(dp), intent(in) :: x(:), radius
    !> bins may stand twice
    type(share_list_t), intent(inout) :: list
    real(dp) :: others, before, behind
    integer :: d, image, k, first, last, bin

    list%n = 0
    others = 1.0_dp
    do d = 1, self%nd
      if (d == self%axis) cycle
      call find_images(self, d, x(d) - radius, x(d) + radius, first, last)
      before = 0.0_dp
      do image = first, last
        before = before + self%cut(d, x(d) - image*self%period(d), radius)
      end do
      others = others*before
      if (.not. others > 0.0_dp) return
    end do
    d = self%axis
    call find_images(self, d, x(d) - radius, x(d) + radius, first, last)
    do image = first, last
      associate (y => x(d) - image*self%period(d))
        bin = self%place(y - radius)
        before = 0.0_dp
        if (self%cuts_low(d) .or. bin > 1) before = ball_below(self%side(bin - 1), y, radius, self%nd)
        do k = bin, self%place(y + radius)
          behind = 1.0_dp
          if (self%cuts_high(d) .or. k < self%n) behind = ball_below(self%side(k), y, radius, self%nd)
          call add_share(list, k, (behind - before)*others)
          before = behind
        end do
      end associate
    end do
  end subroutine region_grid_share_ball

  !> The parts of the volume of a body with a shape in the bins: exact wherever sides cut its polygons and polyhedra.
  pure subroutine region_grid_share_body(self, x, shape, body, list)
    class(region_grid_t), intent(in) :: self
    !> its centre (nd) [m]
    real(dp), intent(in) :: x(:)
    type(body_shape_t), intent(in) :: shape
    type(turned_body_t), intent(in) :: body
    !> bins may stand twice
    type(share_list_t), intent(inout) :: list
    real(dp), dimension(self%nd) :: from, to
    integer, dimension(self%nd) :: image, first, last
    integer :: d, k

    list%n = 0
    do d = 1, self%nd
      call find_images(self, d, x(d) + body%low(d), x(d) + body%high(d), first(d), last(d))
    end do
    if (any(first > last)) return
    image(:) = first
    images: do
      do d = 1, self%nd
        associate (y => x(d) - image(d)*self%period(d))
          from(d) = merge(self%lower(d) - y, -unbounded, self%cuts_low(d))
          to(d) = merge(self%upper(d) - y, unbounded, self%cuts_high(d))
        end associate
      end do
      d = self%axis
      associate (y => x(d) - image(d)*self%period(d))
        do k = self%place(y + body%low(d)), self%place(y + body%high(d))
          if (self%cuts_low(d) .or. k > 1) from(d) = self%side(k - 1) - y
          to(d) = merge(self%side(k) - y, unbounded, self%cuts_high(d) .or. k < self%n)
          call add_share(list, k, body%share_between(shape, from, to))
        end do
      end associate
      do d = 1, self%nd
        image(d) = image(d) + 1
        if (image(d) <= last(d)) cycle images
        image(d) = first(d)
      end do
      return
    end do images
  end subroutine region_grid_share_body

  !> The part of a ball between the sides of the region along an axis that has no bins.
  pure real(dp) function region_grid_cut(self, d, x, radius) result(part)
    class(region_grid_t), intent(in) :: self
    integer, intent(in) :: d
    !> [m]
    real(dp), intent(in) :: x, radius

    part = 1.0_dp
    if (self%cuts_high(d)) part = ball_below(self%upper(d), x, radius, self%nd)
    if (self%cuts_low(d)) part = part - ball_below(self%lower(d), x, radius, self%nd)
  end function region_grid_cut

  !> Images of the region, by whole periods along axis `d`, that something between two places may reach.
  pure subroutine find_images(grid, d, from, to, first, last)
    type(region_grid_t), intent(in) :: grid
    integer, intent(in) :: d
    !> [m]
    real(dp), intent(in) :: from, to
    integer, intent(out) :: first, last

    first = 0
    last = 0
    if (.not. grid%period(d) > 0.0_dp .or. .not. grid%cuts_low(d)) return
    first = ceiling((from - grid%upper(d))/grid%period(d))
    last = floor((to - grid%lower(d))/grid%period(d))
  end subroutine find_images

  !> The parts of a segment in the bins.
  pure subroutine region_grid_share_segment(self, from, to, list)
    class(region_grid_t), intent(in) :: self
    !> ends (nd) [m]
    real(dp), intent(in) :: from(:), to(:)
    !> bins may stand twice
    type(share_list_t), intent(inout) :: list
    !> of the way from one end to the other, within the sides of all axes but that of the bins
    real(dp) :: within(2, max_parts)
    real(dp) :: part(2), low, high
    integer :: d, image, k, j, first, last, n

    list%n = 0
    n = 1
    within(:, 1) = [0.0_dp, 1.0_dp]
    do d = 1, self%nd
      if (d == self%axis) cycle
      call keep_within(self, d, from(d), to(d), within, n)
    end do
    if (n == 0) return
    d = self%axis
    low = min(from(d), to(d))
    high = max(from(d), to(d))
    call find_images(self, d, low, high, first, last)
    do image = first, last
      associate (shift => image*self%period(d))
        do k = self%place(low - shift), self%place(high - shift)
          part(:) = part_between(from(d) - shift, to(d) - shift, &
            & merge(self%side(k - 1), -unbounded, self%cuts_low(d) .or. k > 1), &
            & merge(self%side(k), unbounded, self%cuts_high(d) .or. k < self%n))
          do j = 1, n
            call add_share(list, k, min(part(2), within(2, j)) - max(part(1), within(1, j)))
          end do
        end do
      end associate
    end do
  end subroutine region_grid_share_segment

  !> Keep what of the parts of a segment lies between the sides of an axis.
  pure subroutine keep_within(grid, d, from, to, within, n)
    type(region_grid_t), intent(in) :: grid
    integer, intent(in) :: d
    !> ends [m]
    real(dp), intent(in) :: from, to
    real(dp), intent(inout) :: within(2, max_parts)
    integer, intent(inout) :: n
    real(dp) :: kept(2, max_parts), part(2)
    integer :: image, first, last, j, m

    call find_images(grid, d, min(from, to), max(from, to), first, last)
    m = 0
    do image = first, last
      associate (shift => image*grid%period(d))
        part(:) = part_between(from - shift, to - shift, merge(grid%lower(d), -unbounded, grid%cuts_low(d)), &
          & merge(grid%upper(d), unbounded, grid%cuts_high(d)))
      end associate
      do j = 1, n
        if (m == max_parts .or. min(part(2), within(2, j)) <= max(part(1), within(1, j))) cycle
        m = m + 1
        kept(1, m) = max(part(1), within(1, j))
        kept(2, m) = min(part(2), within(2, j))
      end do
    end do
    n = m
    within(:, :n) = kept(:, :n)
  end subroutine keep_within

  !> The part of the way from one end to the other, 0 to 1, that lies between two sides; of no length where none does. A way along
  !> the sides that lies on one of them is above it.
  pure function part_between(from, to, low, high) result(part)
    !> [m]
    real(dp), intent(in) :: from, to, low, high
    real(dp) :: part(2)

    part(:) = [0.0_dp, 1.0_dp]
    if (from < to) then
      if (low >= to .or. high <= from) then
        part(2) = 0.0_dp
        return
      end if
      if (low > from) part(1) = (low - from)/(to - from)
      if (high < to) part(2) = (high - from)/(to - from)
    else if (from > to) then
      if (low >= from .or. high <= to) then
        part(2) = 0.0_dp
        return
      end if
      if (high < from) part(1) = (from - high)/(from - to)
      if (low > to) part(2) = (from - low)/(from - to)
    else if (from < low .or. from >= high) then
      part(2) = 0.0_dp
    end if
  end function part_between

  !> Add a share above 0 to a list.
  pure subroutine add_share(list, bin, share)
    type(share_list_t), intent(inout) :: list
    integer, intent(in) :: bin
    real(dp), intent(in) :: share
    integer, allocatable :: bins(:)
    real(dp), allocatable :: shares(:)

    if (.not. share > 0.0_dp) return
    if (.not. allocated(list%bin)) allocate (list%bin(first_room), list%share(first_room))
    if (list%n == size(list%bin)) then
      allocate (bins(2*list%n), shares(2*list%n))
      bins(1:list%n) = list%bin
      shares(1:list%n) = list%share
      call move_alloc(bins, list%bin)
      call move_alloc(shares, list%share)
    end if
    list%n = list%n + 1
    list%bin(list%n) = bin
    list%share(list%n) = share
  end subroutine add_share

end module gravier_mean_region
