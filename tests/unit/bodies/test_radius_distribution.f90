!> Radii of samples: bounds, moments against analytic values, and tables. Means of samples of n grains may differ from the mean
!> of the distribution by five standard deviations, 5 sqrt((<x^2> - <x>^2)/n).
program test_radius_distribution
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t, status_input
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_radius_distribution, only: radius_distribution_t
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  integer, parameter :: n = 20000
  real(dp), parameter :: pi = acos(-1.0_dp)
  character(len=*), parameter :: lf = new_line("a")
  type(communicator_t) :: comm
  character(len=:), allocatable :: path

  call start_parallel()
  call comm%init()
  path = scratch("radii.csv")
  call test_single()
  call test_uniform()
  call test_uniform_volume(2)
  call test_uniform_volume(3)
  call test_log_normal()
  call test_narrow()
  call test_seeds()
  call test_table()
  call test_bad_tables()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> A path for files of this test.
  function scratch(name) result(path)
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: path
    character(len=1000) :: directory
    integer :: length, stat

    call get_environment_variable("GRAVIER_TEST_DIR", directory, length, stat)
    path = name
    if (stat == 0 .and. length > 0) path = directory(1:length)//"/"//name
  end function scratch

  type(radius_distribution_t) function between(kind, nd, low, high) result(distribution)
    character(len=*), intent(in) :: kind
    integer, intent(in) :: nd
    real(dp), intent(in) :: low, high
    distribution%kind = kind
    distribution%nd = nd
    distribution%radius_min = low
    distribution%radius_max = high
  end function between

  !> Draw n radii; check their bounds, and the means of r and of r^nd against the moments.
  subroutine check_sample(distribution, name)
    type(radius_distribution_t), intent(in) :: distribution
    character(len=*), intent(in) :: name
    real(dp), allocatable :: r(:)
    real(dp) :: mean, deviation
    integer :: k, power

    allocate (r(n))
    do k = 1, n
      r(k) = distribution%draw(int(k, i8), 3)
    end do
    call check(minval(r) >= distribution%smallest() .and. maxval(r) <= distribution%largest(), name//": bounds")
    do power = 1, distribution%nd, distribution%nd - 1
      mean = distribution%moment(power)
      deviation = sqrt((distribution%moment(2*power) - mean**2)/n)
      call check_close(sum(r**power)/n, mean, 5*deviation + 1e-12_dp*mean, name//": mean of a sample")
    end do
  end subroutine check_sample

  subroutine test_single()
    type(radius_distribution_t) :: distribution

    distribution%radius = 0.25_dp
    distribution%nd = 2
    call check_close(distribution%draw(7_i8, 1), 0.25_dp, 0.0_dp, "single")
    call check_close(distribution%mean_volume(), pi/16, 1e-15_dp, "single: area")
    distribution%nd = 3
    call check_close(distribution%mean_volume(), pi/48, 1e-15_dp, "single: volume")
    call check_close(distribution%largest(), 0.25_dp, 0.0_dp, "single: largest")
    call check_close(distribution%smallest(), 0.25_dp, 0.0_dp, "single: smallest")
  end subroutine test_single

  !> <r> = (a + b)/2, <r^3> = (b^4 - a^4)/(4 (b - a)).
  subroutine test_uniform()
    type(radius_distribution_t) :: distribution

    distribution = between("uniform", 3, 1.0_dp, 3.0_dp)
    call check_close(distribution%moment(1), 2.0_dp, 1e-11_dp, "uniform: mean radius")
    call check_close(distribution%mean_volume(), 4*pi/3*10, 1e-10_dp, "uniform: mean volume")
    call check_close(distribution%quantile(0.25_dp), 1.5_dp, 1e-15_dp, "uniform: quantile")
    call check_sample(distribution, "uniform")
  end subroutine test_uniform

  !> <r> = (b - a) a b 2/(b^2 - a^2) = 2 a b/(a + b) in 3D, ln(b/a) a b/(b - a) in 2D;
  !> <r^nd> = (b - a)/int r^-nd. The volume of the grains below r grows in proportion to r - a.
  subroutine test_uniform_volume(nd)
    integer, intent(in) :: nd
    real(dp), parameter :: a = 0.5_dp, b = 10.0_dp
    type(radius_distribution_t) :: distribution
    real(dp) :: r, below(3), volume
    integer :: k, part

    distribution = between("uniform_volume", nd, a, b)
    if (nd == 3) then
      call check_close(distribution%moment(1), 2*a*b/(a + b), 1e-11_dp, "uniform_volume 3D: mean radius")
      call check_close(distribution%moment(3), 2*(a*b)**2/(a + b), 1e-9_dp, "uniform_volume 3D: mean cube")
    else
      call check_close(distribution%moment(1), log(b/a)*a*b/(b - a), 1e-11_dp, "uniform_volume 2D: mean radius")
      call check_close(distribution%moment(2), a*b, 1e-9_dp, "uniform_volume 2D: mean square")
    end if
    call check_close(distribution%quantile(1e-17_dp), a, 1e-12_dp, "uniform_volume: lower bound")
    call check_close(distribution%quantile(1.0_dp), b, 1e-12_dp, "uniform_volume: upper bound")
    call check_sample(distribution, "uniform_volume")
    ! shares of volume by quantiles at the middles of equal shares by number: second-order quadrature over u
    below(:) = 0.0_dp
    volume = 0.0_dp
    do k = 1, 100*n
      r = distribution%quantile((k - 0.5_dp)/(100*n))
      volume = volume + r**nd
      do part = 1, 3
        if (r < a + part*(b - a)/4) below(part) = below(part) + r**nd
      end do
    end do
    do part = 1, 3
      call check_close(below(part)/volume, part/4.0_dp, 1e-4_dp, "uniform_volume: volume below a radius")
    end do
  end subroutine test_uniform_volume

  !> Moments of ln r without a cut: <r^k> = m^k exp(k^2 s^2/2); with the cut at z = -1 and 2,
  !> <r^k> = m^k exp(k^2 s^2/2) (F(2 - k s) - F(-1 - k s))/(F(2) - F(-1)), F the normal distribution function.
  subroutine test_log_normal()
    real(dp), parameter :: m = 2.0_dp, s = 0.3_dp
    type(radius_distribution_t) :: distribution
    integer :: k

    distribution = between("log_normal", 3, 1e-3_dp, 1e3_dp)
    distribution%radius_mean = m
    distribution%radius_deviation = s
    do k = 1, 6
      call check_close(distribution%moment(k)/(m**k*exp(0.5_dp*(k*s)**2)), 1.0_dp, 1e-10_dp, "log_normal: moment")
    end do
    call check_close(distribution%quantile(0.5_dp), m, 1e-14_dp, "log_normal: median")
    call check_close(distribution%quantile(0.5_dp*erfc(-sqrt(0.5_dp))), m*exp(s), 1e-13_dp, "log_normal: one deviation")
    call check_sample(distribution, "log_normal")
    distribution%radius_min = m*exp(-s)
    distribution%radius_max = m*exp(2*s)
    do k = 1, 6
      call check_close(distribution%moment(k)/(m**k*exp(0.5_dp*(k*s)**2)), (normal(2 - k*s) - normal(-1 - k*s))/ &
        & (normal(2.0_dp) - normal(-1.0_dp)), 1e-10_dp, "cut log_normal: moment")
    end do
    call check_sample(distribution, "cut log_normal")
  end subroutine test_log_normal

  real(dp) function normal(z)
    real(dp), intent(in) :: z
    normal = 0.5_dp*erfc(-z*sqrt(0.5_dp))
  end function normal

  !> Distributions of no width are single radii.
  subroutine test_narrow()
    type(radius_distribution_t) :: distribution
    character(len=16), parameter :: kinds(3) = [character(len=16) :: "uniform", "uniform_volume", "log_normal"]
    integer :: k

    do k = 1, 3
      distribution = between(trim(kinds(k)), 3, 0.7_dp, 0.7_dp)
      distribution%radius_mean = 0.7_dp
      distribution%radius_deviation = 0.1_dp
      call check_close(distribution%draw(5_i8, 1), 0.7_dp, 1e-15_dp, trim(kinds(k))//": no width")
      call check_close(distribution%moment(3), 0.343_dp, 1e-13_dp, trim(kinds(k))//": no width, mean cube")
    end do
    distribution = between("log_normal", 3, 0.1_dp, 1.0_dp)
    distribution%radius_mean = 0.7_dp
    call check_close(distribution%draw(5_i8, 1), 0.7_dp, 0.0_dp, "log_normal: no deviation")
    call check_close(distribution%moment(1), 0.7_dp, 1e-14_dp, "log_normal: no deviation, mean")
  end subroutine test_narrow

  subroutine test_seeds()
    type(radius_distribution_t) :: distribution

    distribution = between("uniform", 3, 1.0_dp, 3.0_dp)
    call check_close(distribution%draw(9_i8, 4), distribution%draw(9_i8, 4), 0.0_dp, "the same for the same grain")
    call check(abs(distribution%draw(9_i8, 4) - distribution%draw(9_i8, 5)) > 0.0_dp, "another seed")
    call check(abs(distribution%draw(9_i8, 4) - distribution%draw(8_i8, 4)) > 0.0_dp, "another grain")
  end subroutine test_seeds

  subroutine put(text)
    character(len=*), intent(in) :: text
    integer :: unit

    open (newunit=unit, file=path, access="stream", form="unformatted", action="write", status="replace")
    write (unit) text
    close (unit)
  end subroutine put

  !> Columns in any order, shares to any scale; rows without a share are never drawn. Counts are binomial.
  subroutine test_table()
    type(radius_distribution_t) :: distribution
    type(error_t), allocatable :: error
    integer :: counts(3), k, row
    real(dp) :: r
    logical :: known

    call put("share,radius"//lf//"0,9"//lf//"1,2"//lf//"5,0.5"//lf//"0,0.1"//lf//"4,3"//lf//"0,7"//lf)
    call distribution%read_table(comm, path, error)
    call check(.not. allocated(error), "table: read")
    call check_close(distribution%smallest(), 0.5_dp, 0.0_dp, "table: smallest")
    call check_close(distribution%largest(), 3.0_dp, 0.0_dp, "table: largest")
    call check_close(distribution%moment(1), 0.2_dp + 0.25_dp + 1.2_dp, 1e-14_dp, "table: mean radius")
    counts(:) = 0
    known = .true.
    do k = 1, n
      r = distribution%draw(int(k, i8), 3)
      row = 1
      if (r < 1.0_dp) row = 2
      if (r > 2.5_dp) row = 3
      known = known .and. (abs(r - 2.0_dp) <= 0.0_dp .or. abs(r - 0.5_dp) <= 0.0_dp .or. abs(r - 3.0_dp) <= 0.0_dp)
      counts(row) = counts(row) + 1
    end do
    call check(known, "table: radii of rows with a share")
    call check_close(real(counts(1), dp), 0.1_dp*n, 5*sqrt(0.1_dp*0.9_dp*n), "table: first share")
    call check_close(real(counts(2), dp), 0.5_dp*n, 5*sqrt(0.5_dp*0.5_dp*n), "table: second share")
    call check_close(real(counts(3), dp), 0.4_dp*n, 5*sqrt(0.4_dp*0.6_dp*n), "table: third share")
    call check_long_table(distribution)
  end subroutine test_table

  !> More rows than are read at once, with shares whose sum is beyond the range of reals.
  subroutine check_long_table(distribution)
    type(radius_distribution_t), intent(inout) :: distribution
    type(error_t), allocatable :: error
    character(len=:), allocatable :: text
    character(len=20) :: line
    integer :: k

    text = "radius,share"//lf
    do k = 1, 100
      write (line, "(i0, a)") k, ",1e307"
      text = text//trim(line)//lf
    end do
    call put(text)
    call distribution%read_table(comm, path, error)
    call check(.not. allocated(error), "long table: read")
    call check_close(distribution%moment(1), 50.5_dp, 1e-11_dp, "long table: mean radius")
    call check_close(distribution%quantile(0.355_dp), 36.0_dp, 0.0_dp, "long table: quantile")
  end subroutine check_long_table

  subroutine test_bad_tables()
    call expect("radius,share"//lf//"1,0"//lf, "a row with a share above 0 was expected")
    call expect("radius,share"//lf, "a row with a share above 0 was expected")
    call expect("radius,share"//lf//"1,-1"//lf, 'line 2: column share: "-1", but a share of 0 or more was expected')
    call expect("radius,share"//lf//"1,1"//lf//"0,1"//lf, 'line 3: column radius: "0", but a radius above 0 was expected')
    call expect("radius,share"//lf//"x,1"//lf, "column radius")
    call expect("radius,share"//lf//"1"//lf, "line 2: 1 cells")
    call expect("radius"//lf//"1"//lf, "expected to name the columns radius, share")
    call expect("radius,share,more"//lf//"1,1,1"//lf, "expected to name the columns radius, share")
    call expect("", "empty")
  end subroutine test_bad_tables

  subroutine expect(text, part)
    character(len=*), intent(in) :: text, part
    type(radius_distribution_t) :: distribution
    type(error_t), allocatable :: error

    call put(text)
    call distribution%read_table(comm, path, error)
    call check(allocated(error), "bad table: "//part)
    if (.not. allocated(error)) return
    call check_equal(error%status, status_input, "bad table: status")
    call check(index(error%message, path) == 1 .and. index(error%message, part) > 0, "'"//part//"' in: "//error%message)
  end subroutine expect

end program test_radius_distribution
