!> Stretches of places: all of them, or those without the ones that are left out.
program test_stretches
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp
  use gravier_stretches, only: stretches_t
  use gravier_check, only: check, finish_checks
  implicit none

  call MPI_Init()
  call test_all()
  call test_left_out()
  call finish_checks()
  call MPI_Finalize()

contains

  subroutine test_all()
    type(stretches_t) :: stretches

    call check(.not. stretches%have_all(3), "no stretch has no place")
    call stretches%take_all(3)
    call check(matches(stretches, [.true., .true., .true.]), "all places")
    call check(stretches%have_all(3) .and. .not. stretches%have_all(4), "how many all are")
    call stretches%take_all(5)
    call check(matches(stretches, [.true., .true., .true., .true., .true.]), "all places of a longer set")
    call stretches%take_all(0)
    call check(stretches%have_all(0), "all places of none")
    call check(matches(stretches, [.false.]), "a set without places")
  end subroutine test_all

  !> Every pattern of seven places.
  subroutine test_left_out()
    type(stretches_t) :: stretches
    real(dp) :: value(7)
    logical :: stays(7), right, fewest, known
    integer :: pattern, k, rises

    right = .true.
    fewest = .true.
    known = .true.
    do pattern = 0, 2**size(stays) - 1
      do k = 1, size(stays)
        stays(k) = btest(pattern, k - 1)
      end do
      value(:) = merge(0.0_dp, 0.25_dp, stays)
      call stretches%leave_out(value)
      right = matches(stretches, stays) .and. right
      rises = count(stays(2:) .and. .not. stays(:size(stays) - 1)) + merge(1, 0, stays(1))
      fewest = fewest .and. stretches%n == rises
      known = known .and. (stretches%have_all(size(stays)) .eqv. all(stays))
    end do
    call check(right, "the places that are not left out, in ascending order")
    call check(fewest, "places beside each other are in one stretch")
    call check(known, "whether all places are in it")
    call stretches%take_all(size(stays))
    stays(:) = .true.
    call check(matches(stretches, stays), "all places again")
  end subroutine test_left_out

  !> Whether two loops over stretches come by those places that are wanted, once and in ascending order.
  logical function matches(stretches, wanted)
    type(stretches_t), intent(in) :: stretches
    logical, intent(in) :: wanted(:)
    logical :: comes_by(size(wanted))
    integer :: r, k, before

    comes_by(:) = .false.
    matches = .true.
    before = 0
    do r = 1, stretches%n
      do k = stretches%first(r), stretches%last(r)
        matches = matches .and. k > before .and. k <= size(wanted)
        if (.not. matches) return
        comes_by(k) = .true.
        before = k
      end do
    end do
    matches = all(comes_by .eqv. wanted)
  end function matches

end program test_stretches
