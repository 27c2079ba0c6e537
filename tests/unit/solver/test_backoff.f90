!> When something costly is tried again after some tries were in vain, and how that goes through a checkpoint.
program test_backoff
  use gravier_kinds, only: i8
  use gravier_backoff, only: backoff_t, backoff_words
  use gravier_check, only: check, check_equal, finish_checks
  implicit none
  type(backoff_t) :: backoff, again
  integer(i8) :: words(backoff_words)
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
  ! where one of use makes good one in vain alone, every other one of use keeps patience, and one in three does not
  backoff = backoff_t(forgiven=1)
  do step = 0, 99
    call check(backoff%allows(step), "tries of which every other is of use")
    call backoff%note(step, tried=.true., kept=mod(step, 2) == 1)
  end do
  tries = 0
  do step = 100, 399
    if (.not. backoff%allows(step)) cycle
    tries = tries + 1
    call backoff%note(step, tried=.true., kept=mod(tries, 3) == 0)
  end do
  call check(tries > 10 .and. tries < 40, "tries of which one in three is of use")
  ! a scene in which all are given up: 0 to 4, 7, 12, 21, 38, 71, 136, then every 65 steps
  backoff = backoff_t()
  tries = 0
  do step = 0, 999
    if (.not. backoff%allows(step)) cycle
    tries = tries + 1
    call backoff%note(step, tried=.true., kept=.false.)
  end do
  call check_equal(tries, 24, "passes of 1000 steps where none is of use")
  call finish_checks()
end program test_backoff
