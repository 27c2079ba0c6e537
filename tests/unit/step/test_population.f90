!> The least and the most that a scene has had of grains and of mass, and their way through a checkpoint.
program test_population
  use gravier_kinds, only: dp, i8
  use gravier_population, only: population_t, population_words
  use gravier_check, only: check_close, check_equal, finish_checks
  implicit none
  type(population_t) :: population, again
  integer(i8) :: words(population_words)

  call population%note(5_i8, 2.5_dp)
  call check_equal(population%fewest, 5_i8, "fewest at the start")
  call check_equal(population%most, 5_i8, "most at the start")
  call population%note(9_i8, 2.0_dp)
  call population%note(0_i8, 4.0_dp)
  call population%note(7_i8, 3.0_dp)
  call population%get_state(words)
  call again%set_state(words)
  call check_equal(again%fewest, 0_i8, "fewest")
  call check_equal(again%most, 9_i8, "most")
  call check_close(again%lightest, 2.0_dp, 0.0_dp, "lightest")
  call check_close(again%heaviest, 4.0_dp, 0.0_dp, "heaviest")
  call finish_checks()
end program test_population
