!> When passes over layers are tried again after some were given up, and how that goes through a checkpoint.
program test_pass_backoff
  use gravier_kinds, only: i8
  use gravier_pass_backoff, only: pass_backoff_t, pass_backoff_words
  use gravier_check, only: check, check_equal, finish_checks
  implicit none
  type(pass_backoff_t) :: backoff, again
  integer(i8) :: words(pass_backoff_words)
  integer :: step, tries

  call check(backoff%allows(0), "the first solve may try a pass")
  call backoff%note(0, tried=.false., kept=.false.)
  call check(backoff%allows(1), "a solve without a pass changes nothing")
  do step = 1, 4
    call backoff%note(step, tried=.true., kept=.false.)
    call check(backoff%allows(step + 1), "four that are given up are followed by no pause")
  end do
  call backoff%note(5, tried=.true., kept=.false.)
  call check(.not. backoff%allows(6) .and. .not. backoff%allows(7), "two steps without one after the fifth")
  call check(backoff%allows(8), "and no more")
  call backoff%note(8, tried=.true., kept=.false.)
  call check(.not. backoff%allows(12) .and. backoff%allows(13), "four steps after the sixth")
  call backoff%get_state(words)
  call again%set_state(words)
  call check(.not. again%allows(12) .and. again%allows(13), "a restart knows when")
  call again%note(13, tried=.true., kept=.false.)
  call check(.not. again%allows(21) .and. again%allows(22), "and that the pause is eight steps next")
  call again%note(22, tried=.true., kept=.true.)
  call check(again%allows(23), "one that a solve went on from ends the pause")
  call again%note(23, tried=.true., kept=.false.)
  call check(again%allows(24), "and patience is there again")
  ! a scene in which all are given up: 0 to 4, 7, 12, 21, 38, 71, 136, then every 65 steps
  backoff = pass_backoff_t()
  tries = 0
  do step = 0, 999
    if (.not. backoff%allows(step)) cycle
    tries = tries + 1
    call backoff%note(step, tried=.true., kept=.false.)
  end do
  call check_equal(tries, 24, "passes of 1000 steps where none is of use")
  call finish_checks()
end program test_pass_backoff
