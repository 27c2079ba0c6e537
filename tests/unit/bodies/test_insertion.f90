!> Grains that are to enter: how many are owed by rates, limits and times; what each of them is; where it may be placed.
program test_insertion
  use gravier_kinds, only: dp, i8
  use gravier_motion, only: grain_mass, grain_volume
  use gravier_insertion, only: insertion_t, new_grain_t, insertion_words, candidates_a_grain, most_a_step
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none
  !> length of a step [s]
  real(dp), parameter :: h = 1.0e-3_dp
  integer :: nd

  do nd = 2, 3
    call test_number(nd)
    call test_mass(nd)
    call test_limits(nd)
    call test_grains(nd)
    call test_shapes(nd)
    call test_places(nd)
  end do
  call test_behind()
  call test_account()
  call finish_checks()

contains

  !> Grains of one radius in a box.
  pure type(insertion_t) function box_of(nd) result(insertion)
    integer, intent(in) :: nd

    insertion%name = "feed"
    insertion%nd = nd
    insertion%lower(:) = [0.1_dp, 0.2_dp, 0.3_dp]
    insertion%upper(:) = [0.3_dp, 0.5_dp, 0.7_dp]
    insertion%radii%nd = nd
    insertion%radii%radius = 0.01_dp
    insertion%density = 1000.0_dp
  end function box_of

  !> Let all grains that are owed enter, step by step.
  subroutine let_enter(insertion, steps)
    type(insertion_t), intent(inout) :: insertion
    integer, intent(in) :: steps
    type(new_grain_t), allocatable :: owed(:)
    logical :: more
    integer :: step, k

    do step = 0, steps - 1
      call insertion%list_owed(step*h, h, owed, more)
      do k = 1, size(owed)
        call check_equal(owed(k)%number, insertion%entered + 1, "grains come in the order of their numbers")
        insertion%entered = insertion%entered + 1
        insertion%mass = insertion%mass + owed(k)%mass
      end do
    end do
  end subroutine let_enter

  !> After each step the whole grains that the rate has made up, whatever rounding the times have.
  subroutine test_number(nd)
    integer, intent(in) :: nd
    type(insertion_t) :: insertion
    real(dp), parameter :: rates(4) = [1.0_dp, 333.0_dp, 1000.0_dp, 30000.0_dp]
    integer :: k

    do k = 1, size(rates)
      insertion = box_of(nd)
      insertion%rate = rates(k)
      call let_enter(insertion, 100)
      call check_equal(insertion%entered, int(rates(k)*0.1_dp + 1.0e-6_dp, i8), "grains by the rate")
      call let_enter(insertion, 50)
      call check_equal(insertion%entered, int(rates(k)*0.1_dp + 1.0e-6_dp, i8), "none beyond it")
    end do
  end subroutine test_number

  !> No more than the rate of mass makes up, and less by less than the next grain.
  subroutine test_mass(nd)
    integer, intent(in) :: nd
    type(insertion_t) :: insertion
    type(new_grain_t) :: next

    insertion = box_of(nd)
    insertion%radii%kind = "uniform"
    insertion%radii%radius_min = 0.005_dp
    insertion%radii%radius_max = 0.02_dp
    insertion%mass_rate = 20.0_dp
    call let_enter(insertion, 300)
    next = insertion%grain(insertion%entered + 1)
    call check(insertion%mass <= 6.0_dp*(1.0_dp + 1.0e-9_dp), "not more mass than the rate")
    call check(insertion%mass + next%mass > 6.0_dp, "not less by a grain")
    call check_close(insertion%planned(0.3_dp)*insertion%mean_mass(), 6.0_dp, 1.0e-12_dp, "planned mass")
  end subroutine test_mass

  subroutine test_limits(nd)
    integer, intent(in) :: nd
    type(insertion_t) :: insertion
    real(dp) :: mass

    insertion = box_of(nd)
    insertion%rate = 1000.0_dp
    insertion%start = 0.02_dp
    insertion%end = 0.05_dp
    call let_enter(insertion, 20)
    call check_equal(insertion%entered, 0_i8, "none before the start")
    call let_enter(insertion, 100)
    call check_equal(insertion%entered, 30_i8, "none after the end")
    insertion = box_of(nd)
    insertion%most_grains = 17
    call let_enter(insertion, 2)
    call check_equal(insertion%entered, 17_i8, "without a rate as many as may be")
    insertion = box_of(nd)
    mass = grain_mass(nd, 0.01_dp, 1000.0_dp)
    insertion%most_mass = 7.5_dp*mass
    call let_enter(insertion, 2)
    call check_equal(insertion%entered, 7_i8, "whole grains up to a mass")
    insertion = box_of(nd)
    insertion%most_mass = 7.0_dp*mass
    call let_enter(insertion, 2)
    call check_equal(insertion%entered, 7_i8, "a mass that is reached")
    insertion = box_of(nd)
    call let_enter(insertion, 1)
    call check_equal(insertion%entered, 1000_i8, "at most a thousand in a step")
    call check(insertion%planned(1.0_dp) >= huge(1.0_dp), "nothing bounds their number")
  end subroutine test_limits

  !> What a grain is depends on its number, the seed and the place of the insertion.
  subroutine test_grains(nd)
    integer, intent(in) :: nd
    type(insertion_t) :: insertion, other
    type(new_grain_t) :: grain, again
    real(dp) :: mean
    integer :: k

    insertion = box_of(nd)
    insertion%radii%kind = "uniform"
    insertion%radii%radius_min = 0.005_dp
    insertion%radii%radius_max = 0.02_dp
    insertion%velocity(1:nd) = 1.0_dp
    insertion%spread(nd) = 0.5_dp
    other = insertion
    other%place_in_scene = 2
    mean = 0.0_dp
    do k = 1, 1000
      grain = insertion%grain(int(k, i8))
      mean = mean + grain%radius/1000
      call check_close(grain%mass, grain_mass(nd, grain%radius, 1000.0_dp), 1.0e-12_dp, "mass")
      call check(abs(grain%velocity(1) - 1.0_dp) <= 0.0_dp .and. abs(grain%velocity(nd) - 1.0_dp) <= 0.5_dp, "velocity")
    end do
    ! five standard deviations of the mean
    call check_close(mean, 0.0125_dp, 5*0.015_dp/sqrt(12000.0_dp), "mean radius")
    grain = insertion%grain(5_i8)
    again = other%grain(5_i8)
    call check(abs(grain%radius - again%radius) > 0.0_dp, "each insertion has its own numbers")
    other = insertion
    other%seed = 2
    again = other%grain(5_i8)
    call check(abs(grain%radius - again%radius) > 0.0_dp, "and so has each seed")
  end subroutine test_grains

  !> Shapes by their shares, with masses of their volumes, and turned.
  subroutine test_shapes(nd)
    integer, intent(in) :: nd
    type(insertion_t) :: insertion
    type(new_grain_t) :: grain
    integer :: k, numbers(0:2)

    insertion = box_of(nd)
    insertion%shape = [2, 0, 1]
    insertion%bound = [0.5_dp, 0.75_dp, 1.0_dp]
    insertion%unit_volume = [1.5_dp, 0.0_dp, 2.5_dp]
    numbers(:) = 0
    do k = 1, 1000
      grain = insertion%grain(int(k, i8))
      numbers(grain%shape) = numbers(grain%shape) + 1
      if (grain%shape == 2) call check_close(grain%mass, 1500.0_dp*0.01_dp**nd, 1.0e-12_dp, "mass of a shape")
      if (grain%shape == 0) call check_close(grain%mass, grain_mass(nd, 0.01_dp, 1000.0_dp), 1.0e-12_dp, "mass of a ball")
      if (nd == 3) call check_close(norm2(grain%turn), 1.0_dp, 1.0e-12_dp, "a unit quaternion")
    end do
    ! five standard deviations
    call check(abs(numbers(2) - 500) < 80, "share of the first")
    call check(abs(numbers(0) - 250) < 69, "share of balls")
    call check_close(insertion%mean_mass(), 1000.0_dp*0.01_dp**nd*(0.75_dp + 0.625_dp + 0.25_dp*grain_volume(nd, 1.0_dp)), &
      & 1.0e-12_dp, "mean mass")
  end subroutine test_shapes

  !> Grains are wholly in the region, all over it.
  subroutine test_places(nd)
    integer, intent(in) :: nd
    type(insertion_t) :: insertion
    real(dp) :: place(nd), low(nd), high(nd), centre(nd), far, mean
    integer :: k

    insertion = box_of(nd)
    low(:) = 1.0_dp
    high(:) = 0.0_dp
    do k = 1, 2000
      call insertion%place(int(k, i8), 0.02_dp, place)
      low(:) = min(low, place)
      high(:) = max(high, place)
    end do
    call check(all(low >= insertion%lower(1:nd) + 0.02_dp .and. low < insertion%lower(1:nd) + 0.025_dp), "lower side of a box")
    call check(all(high <= insertion%upper(1:nd) - 0.02_dp .and. high > insertion%upper(1:nd) - 0.025_dp), "upper side of a box")
    call check(insertion%room_for(0.1_dp) .and. .not. insertion%room_for(0.11_dp), "room in a box")
    call check_close(insertion%volume(), 0.2_dp*0.3_dp*merge(1.0_dp, 0.4_dp, nd == 2), 1.0e-12_dp, "volume of a box")
    insertion%in_ball = .true.
    insertion%upper(1:nd) = insertion%lower(1:nd) + 0.2_dp
    centre(:) = insertion%lower(1:nd) + 0.1_dp
    far = 0.0_dp
    mean = 0.0_dp
    do k = 1, 2000
      call insertion%place(int(k, i8), 0.02_dp, place)
      far = max(far, norm2(place - centre))
      mean = mean + norm2(place - centre)**nd/2000
    end do
    call check(far <= 0.08_dp*(1.0_dp + 1.0e-12_dp) .and. far > 0.0795_dp, "side of a ball")
    ! the power nd of the distance is uniform: five standard deviations of its mean
    call check_close(mean/0.08_dp**nd, 0.5_dp, 5/sqrt(24000.0_dp), "places all over a ball")
    call check_close(insertion%volume(), grain_volume(nd, 0.1_dp), 1.0e-12_dp, "volume of a ball")
  end subroutine test_places

  !> What a rate owes that has not entered.
  subroutine test_behind()
    type(insertion_t) :: insertion
    type(new_grain_t), allocatable :: owed(:)
    real(dp) :: mass
    logical :: more

    insertion = box_of(2)
    insertion%rate = 1000.0_dp
    call check_equal(insertion%grains_behind(0.01_dp), 10_i8, "grains behind")
    call insertion%list_owed(0.01_dp, h, owed, more)
    call check_equal(size(owed), 11, "they are owed in the next step")
    call check(.not. more, "and no others")
    insertion%rate = 1.0e6_dp
    call insertion%list_owed(0.0_dp, h, owed, more)
    call check(size(owed) == most_a_step .and. .not. more, "as many as may enter in a step")
    insertion%rate = 1.001e6_dp
    call insertion%list_owed(0.0_dp, h, owed, more)
    call check(size(owed) == most_a_step .and. more, "one more")
    insertion%rate = 1000.0_dp
    insertion%most_grains = 4
    call check_equal(insertion%grains_behind(0.01_dp), 4_i8, "as far as they are to enter")
    insertion%entered = 4
    call check_equal(insertion%grains_behind(0.01_dp), 0_i8, "none behind")
    insertion = box_of(2)
    mass = grain_mass(2, 0.01_dp, 1000.0_dp)
    insertion%mass_rate = 1000.0_dp*mass
    call check_close(insertion%mass_behind(0.0101_dp), 10.1_dp*mass, 1.0e-12_dp, "mass behind")
    insertion%entered = 10
    insertion%mass = 10.0_dp*mass
    call check_close(insertion%mass_behind(0.0101_dp), 0.0_dp, 0.0_dp, "a fraction of a grain is not behind")
  end subroutine test_behind

  !> The account survives a checkpoint, and what no account can be is found out.
  subroutine test_account()
    type(insertion_t) :: insertion, again
    integer(i8) :: words(insertion_words), damaged(insertion_words)
    logical :: sound
    integer :: k

    insertion = box_of(2)
    insertion%entered = 12
    insertion%mass = 3.5_dp
    insertion%drawn = 20_i8*candidates_a_grain
    insertion%put_off = 2
    insertion%held_back = 3
    call insertion%get_state(words)
    again = box_of(2)
    call again%set_state(words, sound)
    call check(sound, "an account")
    call check_equal(again%entered, 12_i8, "grains")
    call check_close(again%mass, 3.5_dp, 0.0_dp, "mass")
    call check_equal(again%drawn, insertion%drawn, "places drawn")
    call check_equal(again%put_off, 2_i8, "steps put off")
    call check_equal(again%held_back, 3_i8, "steps in which more were to enter than may")
    do k = 1, insertion_words
      damaged(:) = words
      damaged(k) = -1
      call again%set_state(damaged, sound)
      call check(.not. sound, "a damaged account")
    end do
  end subroutine test_account

end program test_insertion
