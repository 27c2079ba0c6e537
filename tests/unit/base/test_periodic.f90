!> Coordinates along periodic axes: always inside, also after rounding, and whole periods away.
program test_periodic
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp, i8
  use gravier_random_hash, only: hash_uniform
  use gravier_periodic, only: period_t, wrap, shift_code, shift_of_code, no_shift, most_images, period_words, &
    & gradient_times
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  call MPI_Init()
  call test_values()
  call test_rounding()
  call test_far()
  call test_random()
  call test_codes()
  call test_shift()
  call test_moving()
  call finish_checks()
  call MPI_Finalize()

contains

  !> A cell that deforms: other edges of the same lattice, the gradient of its velocity, the images of a place, its state in words.
  subroutine test_moving()
    type(period_t) :: cell, later, again
    integer :: k(3), turns(3), shift(3), shifts(3, most_images), n, i
    integer(i8) :: words(period_words)
    real(dp) :: x(3), y(3), v(3), w(3), g(3, 3), f(3, 3)

    cell = period_t(length=[2.0_dp, 3.0_dp, 4.0_dp], origin=[-1.0_dp, 0.5_dp, 0.0_dp], tilt=[1.7_dp, -2.9_dp, 4.2_dp], moves=.true.)
    g(:, :) = 0.0_dp
    g(1, :) = [0.1_dp, 0.7_dp, -0.3_dp]
    g(2, 2:) = [-0.2_dp, 0.4_dp]
    g(3, 3) = 0.05_dp
    call cell%set_gradient(g)
    f(:, :) = cell%gradient()
    call check(maxval(abs(f - g)) < 1.0e-14_dp, "the gradient comes back")
    ! an image moves with the gradient
    shift(:) = [-2, 1, 2]
    x(:) = 0.0_dp
    v(:) = 0.0_dp
    call cell%add_shift(shift_code(shift), 1, x)
    call cell%add_velocity(shift, v)
    w(:) = gradient_times(g, x)
    call check(maxval(abs(v - w)) < 1.0e-14_dp, "an image moves with the cell")
    ! the same point of the lattice by other edges
    later = cell
    call later%straighten(k)
    call check(all(k == [1, -2, 1]), "edges taken")
    call check(all(abs(later%tilt) <= 0.5_dp*[2.0_dp, 2.0_dp, 3.0_dp]), "tilts are at most half a length")
    shift(2) = shift(2) + k(3)*shift(3)
    shift(1) = shift(1) + k(1)*shift(2) + k(2)*shift(3)
    y(:) = 0.0_dp
    w(:) = 0.0_dp
    ! beyond the codes: in two parts
    turns(:) = shift/2
    call later%add_shift(shift_code(turns), 1, y)
    turns(:) = shift - turns
    call later%add_shift(shift_code(turns), 1, y)
    call later%add_velocity(shift, w)
    call check(maxval(abs(x - y)) < 1.0e-14_dp, "straighten leaves the lattice as it is")
    call check(maxval(abs(v - w)) < 1.0e-14_dp, "and its velocities")
    call later%straighten(k)
    call check(all(k == 0), "straight edges stay")
    ! a place and its image inside
    x(:) = [7.3_dp, -5.1_dp, 9.9_dp]
    y(:) = x
    call later%wrap(y, turns)
    call check(all(y >= later%origin .and. y < later%origin + later%length), "wrapped into the box")
    w(1) = turns(1)*2.0_dp + turns(2)*later%tilt(1) + turns(3)*later%tilt(2)
    w(2) = turns(2)*3.0_dp + turns(3)*later%tilt(3)
    w(3) = turns(3)*4.0_dp
    call check(maxval(abs(x - y - w)) < 1.0e-13_dp, "by whole edges")
    call later%unwrap(turns, y)
    call check(maxval(abs(x - y)) < 1.0e-13_dp, "and back")
    call later%wrap(y, turns)
    ! all images near the box, each once
    call later%find_images(y, 0.9_dp, shifts, n)
    do i = 1, n
      x(:) = y
      call later%add_shift(shift_code(shifts(:, i)), 1, x)
      call check(all(x >= later%origin - 0.9_dp .and. x <= later%origin + later%length + 0.9_dp), "an image near the box")
    end do
    call check_equal(n, count_near(later, y, 0.9_dp), "images near the box")
    ! it deforms about its middle, and F takes images along
    again = later
    call again%move(0.25_dp)
    v(:) = again%centre()
    w(:) = later%centre()
    call check(maxval(abs(v - w)) < 1.0e-15_dp, "the middle stays")
    f(:, :) = again%strain_since(later)
    shift(:) = [1, -1, 1]
    x(:) = 0.0_dp
    y(:) = 0.0_dp
    call later%add_shift(shift_code(shift), 1, x)
    call again%add_shift(shift_code(shift), 1, y)
    w(:) = gradient_times(f, x)
    call check(maxval(abs(w - y)) < 1.0e-14_dp, "F takes images along")
    ! a quarter of a second at these rates, by any edges
    w(:) = 0.25_dp*[0.7_dp, -0.3_dp, 0.4_dp]
    call check(all(abs(later%shear) <= 0.0_dp) .and. maxval(abs(again%shear - w)) < 1.0e-14_dp, "the shear is counted")
    call again%straighten(k)
    call check(maxval(abs(again%shear - w)) < 1.0e-14_dp, "other edges are no shear")
    call again%get_state(words)
    later = cell
    call later%set_state(words)
    call check(all(abs(later%tilt - again%tilt) <= 0.0_dp) .and. all(abs(later%length - again%length) <= 0.0_dp) .and. &
      & all(abs(later%origin - again%origin) <= 0.0_dp) .and. all(abs(later%length_rate - again%length_rate) <= 0.0_dp) .and. &
      & all(abs(later%tilt_rate - again%tilt_rate) <= 0.0_dp), "the state comes back")
    call check(all(abs(later%shear - again%shear) <= 0.0_dp), "and its shear")
  end subroutine test_moving

  !> Images of a place within a margin of the box, by trial.
  integer function count_near(cell, place, margin) result(n)
    type(period_t), intent(in) :: cell
    real(dp), intent(in) :: place(3), margin
    real(dp) :: x(3)
    integer :: i, j, k, shift(3)

    n = 0
    do k = -2, 2
      do j = -2, 2
        do i = -2, 2
          x(:) = place
          shift(1) = i
          shift(2) = j
          shift(3) = k
          call cell%add_shift(shift_code(shift), 1, x)
          if (all(x >= cell%origin - margin .and. x <= cell%origin + cell%length + margin)) n = n + 1
        end do
      end do
    end do
  end function count_near

  subroutine check_wrap(x, origin, period, inside, turns)
    real(dp), intent(in) :: x, origin, period, inside
    integer, intent(in) :: turns
    real(dp) :: found
    integer :: n

    call wrap(x, origin, period, found, n)
    call check_close(found, inside, 0.0_dp, "coordinate inside")
    call check_equal(n, turns, "whole periods")
  end subroutine check_wrap

  !> Numbers that are exact.
  subroutine test_values()
    call check_wrap(0.25_dp, 0.0_dp, 2.0_dp, 0.25_dp, 0)
    call check_wrap(0.0_dp, 0.0_dp, 2.0_dp, 0.0_dp, 0)
    call check_wrap(2.0_dp, 0.0_dp, 2.0_dp, 0.0_dp, 1)
    call check_wrap(-0.5_dp, 0.0_dp, 2.0_dp, 1.5_dp, -1)
    call check_wrap(-4.0_dp, 0.0_dp, 2.0_dp, 0.0_dp, -2)
    call check_wrap(7.25_dp, -1.0_dp, 2.0_dp, -0.75_dp, 4)
    call check_wrap(7.25_dp, -1.0_dp, 0.0_dp, 7.25_dp, 0)
  end subroutine test_values

  !> Just below the origin: one period up rounds to the upper end, which belongs to the next period.
  subroutine test_rounding()
    call check_wrap(-1.0e-30_dp, 0.0_dp, 1.0_dp, 0.0_dp, 0)
    call check_wrap(-tiny(1.0_dp), 0.0_dp, 3.7_dp, 0.0_dp, 0)
    call check_wrap(nearest(1.0_dp, -1.0_dp), 0.0_dp, 1.0_dp, nearest(1.0_dp, -1.0_dp), 0)
  end subroutine test_rounding

  !> Places that no simulation survives end inside all the same.
  subroutine test_far()
    real(dp), parameter :: far(4) = [1.0e300_dp, -1.0e300_dp, 1.0e12_dp, -1.0e12_dp]
    real(dp) :: inside
    integer :: k, turns

    do k = 1, size(far)
      call wrap(far(k), 0.3_dp, 0.7_dp, inside, turns)
      call check(inside >= 0.3_dp .and. inside < 0.3_dp + 0.7_dp, "far away: inside")
      call check_equal(turns, merge(1, -1, far(k) > 0.0_dp)*huge(1), "far away: periods")
    end do
  end subroutine test_far

  !> Every shift has a code of its own, and comes back from it.
  subroutine test_codes()
    integer :: x, y, z, shift(3), again(3)
    logical :: same

    same = .true.
    do z = -2, 2
      do y = -2, 2
        do x = -2, 2
          shift(1) = x
          shift(2) = y
          shift(3) = z
          again(:) = shift_of_code(shift_code(shift))
          same = same .and. all(again == shift)
        end do
      end do
    end do
    call check(same, "shifts and their codes")
    shift(:) = 0
    call check_equal(shift_code(shift), no_shift, "the code of no shift")
  end subroutine test_codes

  !> Up to a million periods away: the roundings of coordinates below 1e7.
  subroutine test_random()
    real(dp) :: x, origin, period, inside
    integer :: k, turns
    logical :: within, same

    within = .true.
    same = .true.
    do k = 1, 20000
      origin = 4.0_dp*hash_uniform(1, int(k, i8), 1) - 2.0_dp
      period = 0.01_dp + 3.0_dp*hash_uniform(1, int(k, i8), 2)
      x = origin + period*(2.0_dp*hash_uniform(1, int(k, i8), 3) - 1.0_dp)*10.0_dp**mod(k, 7)
      if (mod(k, 3) == 0) x = origin + period*nint((x - origin)/period)
      call wrap(x, origin, period, inside, turns)
      within = within .and. inside >= origin .and. inside < origin + period
      same = same .and. abs(inside + turns*period - x) <= 8*epsilon(1.0_dp)*(abs(x) + abs(origin) + period)
    end do
    call check(within, "inside the period")
    call check(same, "whole periods away")
  end subroutine test_random

  !> Places go forth and back by whole periods, along periodic axes alone.
  subroutine test_shift()
    type(period_t) :: period
    real(dp) :: place(3)
    integer :: shift(3)

    period%length(:) = [2.0_dp, 0.0_dp, 8.0_dp]
    shift(:) = [1, 0, -1]
    place(:) = [0.5_dp, 0.25_dp, 1.0_dp]
    call period%add_shift(shift_code(shift), 1, place)
    call check(all(abs(place - [2.5_dp, 0.25_dp, -7.0_dp]) <= 0.0_dp), "a place that is shifted")
    call period%add_shift(shift_code(shift), -1, place(1:2))
    call check(all(abs(place - [0.5_dp, 0.25_dp, -7.0_dp]) <= 0.0_dp), "one of the plane that is shifted back")
    call period%add_shift(no_shift, 1, place)
    call check(all(abs(place - [0.5_dp, 0.25_dp, -7.0_dp]) <= 0.0_dp), "no shift")
  end subroutine test_shift

end program test_periodic
