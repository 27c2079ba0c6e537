!> Turns of sweeps and of Newton's steps: windows of accelerated sweeps that double, then plain sweeps that double.
program test_sweep_turns
  use gravier_kinds, only: dp
  use gravier_sweep_turns, only: sweep_turns_t
  use gravier_check, only: check, check_equal, finish_checks
  implicit none

  type(sweep_turns_t) :: turns
  integer :: k

  do k = 0, 2
    call check(turns%accelerate(), "the first turns are accelerated")
    call check_equal(turns%patience(), 100*2**k, "steps without progress")
    ! |r - y|^2 falls to a fifth in a window, then to two fifths, which is little
    call check_equal(sweeps_to_the_end([1.0_dp, 0.2_dp, 0.08_dp, 1.0e-9_dp], 100*2**k), 3*100*2**k, "windows of accelerated sweeps")
    call turns%finish()
  end do
  do k = 0, 7
    call check(.not. turns%accelerate(), "later turns are plain")
    call check_equal(turns%patience(), 40, "steps without progress after plain sweeps")
    call check_equal(sweeps_to_the_end([0.0_dp], huge(1)), 4000*2**min(k, 6), "plain sweeps")
    call turns%finish()
  end do
  call finish_checks()

contains

  !> Sweeps of a turn whose changes are these, each over a window.
  integer function sweeps_to_the_end(changes, window) result(n)
    real(dp), intent(in) :: changes(:)
    integer, intent(in) :: window
    logical :: over

    over = .false.
    n = 0
    do while (.not. over)
      call turns%count_sweep(changes(min(size(changes), 1 + n/window)), over)
      n = n + 1
    end do
  end function sweeps_to_the_end

end program test_sweep_turns
