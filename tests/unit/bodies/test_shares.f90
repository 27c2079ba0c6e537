!> Kinds that grains are dealt out to by shares: fractions up to each, and what numbers draw.
program test_shares
  use gravier_kinds, only: dp
  use gravier_shares, only: accumulate, kind_at
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  real(dp) :: bound(3), one(1), huge_ones(2)

  bound(:) = [3.0_dp, 1.0_dp, 4.0_dp]
  call accumulate(bound)
  call check_close(bound(1), 0.375_dp, 1.0e-15_dp, "fraction of the first")
  call check_close(bound(2), 0.5_dp, 1.0e-15_dp, "fraction of the first and the second")
  call check_close(bound(3), 1.0_dp, 0.0_dp, "fraction of all")
  call check_equal(kind_at(bound, 0.37_dp), 1, "below the first bound")
  call check_equal(kind_at(bound, 0.38_dp), 2, "above the first bound")
  call check_equal(kind_at(bound, 0.49_dp), 2, "below the second bound")
  call check_equal(kind_at(bound, 0.51_dp), 3, "above the second bound")
  call check_equal(kind_at(bound, 1.0_dp), 3, "none is behind the last")
  one(:) = 7.0_dp
  call accumulate(one)
  call check_close(one(1), 1.0_dp, 0.0_dp, "a single kind has all")
  call check_equal(kind_at(one, 0.999_dp), 1, "a single kind")
  huge_ones(:) = huge(1.0_dp)
  call accumulate(huge_ones)
  call check_close(huge_ones(1), 0.5_dp, 1.0e-15_dp, "shares whose sum is none")
  call finish_checks()

end program test_shares
