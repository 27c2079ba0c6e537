!> Distributions of radii from which the grains of a sample are drawn. The radius of a grain is a function of its identifier
!> and of the seed alone.
module gravier_radius_distribution
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_magnitude, only: is_size, size_text
  use gravier_random_hash, only: hash_uniform, hash_words
  use gravier_communicator, only: communicator_t
  use gravier_csv_table, only: csv_table_t
  use gravier_motion, only: grain_mass
  implicit none
  private
  public :: radius_distribution_t

  !> stream of random numbers that radii are drawn from; places are drawn from the streams above
  integer, parameter :: stream_of_radii = 0
  !> a log-normal distribution is integrated over so many standard deviations on either side: 1e-19 is left out
  real(dp), parameter :: tail = 9.0_dp
  !> standard deviation of ln(r) at and below which all radii are the mean
  real(dp), parameter :: least_deviation = 1.0e-12_dp

  !> A distribution by number. The caller sets the components that its kind asks for, or reads the table.
  type :: radius_distribution_t
    !> single: `radius`;
    !> uniform: every radius from `radius_min` to `radius_max` as likely;
    !> uniform_volume: equal volume (area in 2D) of grains in equal intervals of radius from `radius_min` to `radius_max`,
    !>   the density by number being proportional to r^-nd;
    !> log_normal: ln(r/radius_mean) is normal with the mean 0 and the standard deviation `radius_deviation`, cut at
    !>   `radius_min` and `radius_max`, where 0 < radius_min <= radius_mean <= radius_max;
    !> table: the radii of a file, each with its share by number
    character(len=16) :: kind = "single"
    !> space dimension, 2 or 3
    integer :: nd = 3
    !> [m]; a table sets the bounds itself
    real(dp) :: radius = 0.0_dp, radius_min = 0.0_dp, radius_max = 0.0_dp
    !> median of log_normal before it is cut [m], and standard deviation of ln r
    real(dp) :: radius_mean = 0.0_dp, radius_deviation = 0.0_dp
    !> radii of the table [m], and the fraction of grains with this radius or one of an earlier row; the last is 1
    real(dp), allocatable, private :: table_radius(:), cumulated_share(:)
  contains
    procedure :: read_table => distribution_read_table
    procedure :: draw => distribution_draw
    procedure :: quantile => distribution_quantile
    procedure :: moment => distribution_moment
    procedure :: mean_volume => distribution_mean_volume
    procedure :: smallest => distribution_smallest
    procedure :: largest => distribution_largest
    procedure :: digest => distribution_digest
    procedure, private :: density
  end type radius_distribution_t

contains

  !> Become the table of a CSV file with the columns radius [m] and share (by number, to any scale). Failure (status_input):
  !> a file that cannot be read, a column that is missing or unknown, radius <= 0, share < 0, no share above 0. Errors are the
  !> same on all ranks. Collective.
  subroutine distribution_read_table(self, comm, path, error)
    class(radius_distribution_t), intent(inout) :: self
    type(communicator_t), intent(in) :: comm
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    type(csv_table_t) :: table
    real(dp), allocatable :: share(:)

    self%kind = "table"
    call table%open(path, error)
    call check_columns(table, error)
    call read_rows(table, self%table_radius, share, error)
    call table%close()
    call comm%agree(error)
    if (allocated(error)) return
    self%radius_min = minval(self%table_radius, share > 0.0_dp)
    self%radius_max = maxval(self%table_radius, share > 0.0_dp)
    call cumulate(share, self%cumulated_share)
  end subroutine distribution_read_table

  subroutine check_columns(table, error)
    type(csv_table_t), intent(in) :: table
    type(error_t), allocatable, intent(inout) :: error

    if (allocated(error)) return
    if (table%column("radius") > 0 .and. table%column("share") > 0 .and. table%column_count() == 2) return
    call table%refuse_file("the first line was expected to name the columns radius, share and no others", error)
  end subroutine check_columns

  !> Read radii and shares.
  subroutine read_rows(table, radius, share, error)
    type(csv_table_t), intent(inout) :: table
    real(dp), allocatable, intent(out) :: radius(:), share(:)
    type(error_t), allocatable, intent(inout) :: error
    logical :: found
    integer :: n

    allocate (radius(16), share(16))
    n = 0
    do
      call table%next_row(found, error)
      if (.not. found .or. allocated(error)) exit
      n = n + 1
      call make_room(n, radius)
      call make_room(n, share)
      call table%get_real(table%column("radius"), radius(n), error)
      call table%get_real(table%column("share"), share(n), error)
      if (allocated(error)) exit
      if (radius(n) <= 0.0_dp) call table%refuse(table%column("radius"), "a radius above 0", error)
      if (.not. is_size(radius(n))) call table%refuse(table%column("radius"), size_text, error)
      if (share(n) < 0.0_dp) call table%refuse(table%column("share"), "a share of 0 or more", error)
    end do
    if (allocated(error)) return
    call cut(n, radius)
    call cut(n, share)
    if (.not. any(share > 0.0_dp)) call table%refuse_file("a row with a share above 0 was expected", error)
  end subroutine read_rows

  !> Double the size of an array when it is less than `n`.
  pure subroutine make_room(n, array)
    integer, intent(in) :: n
    real(dp), allocatable, intent(inout) :: array(:)
    real(dp), allocatable :: longer(:)

    if (n <= size(array)) return
    allocate (longer(2*n), source=0.0_dp)
    longer(1:size(array)) = array
    call move_alloc(longer, array)
  end subroutine make_room

  !> Keep the first `n` entries.
  pure subroutine cut(n, array)
    integer, intent(in) :: n
    real(dp), allocatable, intent(inout) :: array(:)
    real(dp), allocatable :: shorter(:)

    allocate (shorter(n))
    shorter(:) = array(1:n)
    call move_alloc(shorter, array)
  end subroutine cut

  !> Running sums over the whole sum. They are summed in units of the largest share: no overflow.
  pure subroutine cumulate(share, cumulated)
    real(dp), intent(in) :: share(:)
    real(dp), allocatable, intent(out) :: cumulated(:)
    integer :: k

    cumulated = share/maxval(share)
    do k = 2, size(share)
      cumulated(k) = cumulated(k - 1) + cumulated(k)
    end do
    cumulated(:) = cumulated/cumulated(size(cumulated))
  end subroutine cumulate

  !> Radius of grain `id` [m].
  pure real(dp) function distribution_draw(self, id, seed) result(radius)
    class(radius_distribution_t), intent(in) :: self
    integer(i8), intent(in) :: id
    integer, intent(in) :: seed
    radius = self%quantile(hash_uniform(seed, id, stream_of_radii))
  end function distribution_draw

  !> Radius below which the share `u`, 0 < u < 1, of the grains is [m].
  pure real(dp) function distribution_quantile(self, u) result(radius)
    class(radius_distribution_t), intent(in) :: self
    real(dp), intent(in) :: u

    select case (self%kind)
    case ("uniform")
      radius = self%radius_min + (self%radius_max - self%radius_min)*u
    case ("uniform_volume")
      ! F(r) = (1 - (a/r)^m)/(1 - (a/b)^m) with m = nd - 1
      radius = self%radius_min*(1.0_dp - u*(1.0_dp - (self%radius_min/self%radius_max)**(self%nd - 1)))** &
        & (-1.0_dp/(self%nd - 1))
      radius = min(max(radius, self%radius_min), self%radius_max)
    case ("log_normal")
      radius = log_normal_quantile(self, u)
    case ("table")
      radius = self%table_radius(first_above(self%cumulated_share, u))
    case default
      radius = self%radius
    end select
  end function distribution_quantile

  !> Quantile of the cut log-normal distribution, by bisection of its distribution function in the normal variable
  !> ln(r/radius_mean)/radius_deviation.
  pure real(dp) function log_normal_quantile(self, u) result(radius)
    type(radius_distribution_t), intent(in) :: self
    real(dp), intent(in) :: u
    real(dp) :: low, high, middle, share
    integer :: k

    radius = self%radius_mean
    if (self%radius_deviation <= least_deviation) return
    low = max(-tail, log(self%radius_min/self%radius_mean)/self%radius_deviation)
    high = min(tail, log(self%radius_max/self%radius_mean)/self%radius_deviation)
    share = (1.0_dp - u)*normal_share(low) + u*normal_share(high)
    ! 18/2^57 is a rounding of 1
    do k = 1, 57
      middle = 0.5_dp*(low + high)
      if (normal_share(middle) < share) then
        low = middle
      else
        high = middle
      end if
    end do
    radius = self%radius_mean*exp(self%radius_deviation*0.5_dp*(low + high))
    radius = min(max(radius, self%radius_min), self%radius_max)
  end function log_normal_quantile

  !> Distribution function of the standard normal distribution.
  pure real(dp) function normal_share(z) result(share)
    real(dp), intent(in) :: z
    share = 0.5_dp*erfc(-z*sqrt(0.5_dp))
  end function normal_share

  !> First place in ascending `values` of a value above `u`; the last one is above.
  pure integer function first_above(values, u) result(high)
    real(dp), intent(in), contiguous :: values(:)
    real(dp), intent(in) :: u
    integer :: low, middle

    low = 1
    high = size(values)
    do while (low < high)
      middle = (low + high)/2
      if (values(middle) > u) then
        high = middle
      else
        low = middle + 1
      end if
    end do
  end function first_above

  !> Mean of r^power over the grains [m^power].
  pure real(dp) function distribution_moment(self, power) result(moment)
    class(radius_distribution_t), intent(in) :: self
    integer, intent(in) :: power
    integer :: k

    select case (self%kind)
    case ("uniform", "uniform_volume", "log_normal")
      moment = integrated_moment(self, power)
    case ("table")
      moment = self%cumulated_share(1)*self%table_radius(1)**power
      do k = 2, size(self%table_radius)
        moment = moment + (self%cumulated_share(k) - self%cumulated_share(k - 1))*self%table_radius(k)**power
      end do
    case default
      moment = self%radius**power
    end select
  end function distribution_moment

  !> Mean of r^power of a distribution with a density, by Gauss's rule of three points on 512 panels of equal width in ln r:
  !> relative error below 1e-12 for radii of up to nine decades.
  pure real(dp) function integrated_moment(self, power) result(moment)
    type(radius_distribution_t), intent(in) :: self
    integer, intent(in) :: power
    integer, parameter :: n_panels = 512
    real(dp), parameter :: point(3) = [-sqrt(0.6_dp), 0.0_dp, sqrt(0.6_dp)], weight(3) = [5.0_dp, 8.0_dp, 5.0_dp]
    real(dp) :: low, high, r, grains, total, highest
    integer :: k, p

    low = log(self%radius_min)
    high = log(self%radius_max)
    if (self%kind == "log_normal") then
      low = max(low, log(self%radius_mean) - tail*self%radius_deviation)
      high = min(high, log(self%radius_mean) + tail*self%radius_deviation)
    end if
    highest = exp(high)
    grains = 0.0_dp
    total = 0.0_dp
    do k = 1, n_panels
      do p = 1, 3
        r = exp(low + (high - low)*(k - 0.5_dp + 0.5_dp*point(p))/n_panels)
        grains = grains + weight(p)*self%density(r)
        total = total + weight(p)*self%density(r)*(r/highest)**power
      end do
    end do
    moment = highest**power*total/grains
  end function integrated_moment

  !> Number of grains by ln r, to any scale.
  pure real(dp) function density(self, r)
    class(radius_distribution_t), intent(in) :: self
    real(dp), intent(in) :: r

    select case (self%kind)
    case ("uniform")
      density = r/self%radius_max
    case ("uniform_volume")
      density = (r/self%radius_min)**(1 - self%nd)
    case default
      density = 1.0_dp
      ! below that ln(r/radius_mean) is rounding
      if (self%radius_deviation > least_deviation) density = exp(-0.5_dp*(log(r/self%radius_mean)/self%radius_deviation)**2)
    end select
  end function density

  !> Mean volume of a grain [m^3], or area [m^2] in 2D.
  pure real(dp) function distribution_mean_volume(self) result(volume)
    class(radius_distribution_t), intent(in) :: self
    volume = grain_mass(self%nd, 1.0_dp, 1.0_dp)*self%moment(self%nd)
  end function distribution_mean_volume

  !> Bound from below of the radii drawn [m].
  pure real(dp) function distribution_smallest(self) result(radius)
    class(radius_distribution_t), intent(in) :: self
    radius = self%radius_min
    if (self%kind == "single") radius = self%radius
  end function distribution_smallest

  !> Bound from above of the radii drawn [m].
  pure real(dp) function distribution_largest(self) result(radius)
    class(radius_distribution_t), intent(in) :: self
    radius = self%radius_max
    if (self%kind == "single") radius = self%radius
  end function distribution_largest

  !> A number that tells tables from each other.
  pure integer(i8) function distribution_digest(self) result(digest)
    class(radius_distribution_t), intent(in) :: self
    integer(i8), allocatable :: words(:)
    integer :: k, n

    digest = 0
    if (.not. allocated(self%table_radius)) return
    n = size(self%table_radius)
    allocate (words(2*n))
    do k = 1, n
      words(k) = transfer(self%table_radius(k), 0_i8)
      words(n + k) = transfer(self%cumulated_share(k), 0_i8)
    end do
    digest = hash_words(words)
  end function distribution_digest

end module gravier_radius_distribution
