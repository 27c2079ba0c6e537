!> Modules of a few lines: what numbers a scene may have, pauses, memory that stays with the process, the planes that shut a scene
!> in.
program test_small_modules
  use, intrinsic :: iso_fortran_env, only: int64
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_positive_inf
  use gravier_kinds, only: dp
  use gravier_magnitude, only: is_bounded, is_size, sharpest
  use gravier_process, only: pause_for, suggest_environment, forget_environment
  use gravier_lone_process, only: ease_start, start_is_over, n_suggested
  use gravier_allocator_tuning, only: keep_heap, give_back_arrays
  use gravier_room, only: free_memory
  use gravier_boundary, only: boundary_t
  use gravier_facing_planes, only: find_facing_planes
  use gravier_disjoint_sets, only: first_of, join_sets, number_sets
  use gravier_test_scenes, only: plane, change_shape
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  call check_magnitudes()
  call check_pause()
  call check_lone_process()
  call check_heap()
  call check_facing_planes()
  call check(first_of(4, [1, 1, 3, 2]) == 1 .and. first_of(3, [1, 1, 3, 2]) == 3, "the first of a set")
  call check_sets()
  call finish_checks()

contains

  !> Six numbers, of which pairs are joined in two orders.
  subroutine check_sets()
    integer :: before(6), first(6), n_sets, k

    do k = 1, size(before)
      before(k) = k
    end do
    call join_sets(6, 4, before)
    call join_sets(2, 5, before)
    call join_sets(5, 6, before)
    ! in one set already
    call join_sets(6, 5, before)
    do k = 1, size(before)
      first(k) = first_of(k, before)
    end do
    call check(all(first == [1, 2, 3, 2, 2, 2]), "sets joined two by two")
    call number_sets(before, n_sets)
    call check_equal(n_sets, 3, "number of sets")
    call check(all(before == [1, 2, 3, 2, 2, 2]), "numbers of sets")
    before(:) = [1, 1, 3, 3, 3, 6]
    call number_sets(before, n_sets)
    call check(all(before == [1, 1, 2, 2, 2, 3]), "sets are numbered by their first numbers")
  end subroutine check_sets

  subroutine check_magnitudes()
    real(dp) :: infinity

    infinity = ieee_value(infinity, ieee_positive_inf)
    call check(all(is_bounded([0.0_dp, -1.0e30_dp, 1.0e30_dp, 1.0e-300_dp])), "numbers of at most 1e30 in size")
    call check(.not. any(is_bounded([-1.1e30_dp, 1.1e30_dp])) .and. .not. is_bounded(infinity), &
      & "numbers beyond it")
    call check(all(is_size([1.0e-30_dp, 1.0_dp, 1.0e30_dp])), "sizes from 1e-30 to 1e30")
    call check(.not. any(is_size([0.0_dp, -1.0_dp, 0.9e-30_dp, 1.1e30_dp])) .and. .not. is_size(infinity), &
      & "numbers that are no sizes")
    call check_close(sharpest, 1.0e10_dp, 0.0_dp, "radii of the smallest grain that a scene may extend over")
  end subroutine check_magnitudes

  !> A process that no launcher has started suggests something to Open MPI, but for what the user has said; another one nothing.
  subroutine check_lone_process()
    character(len=*), parameter :: isolated = "OMPI_MCA_ess_singleton_isolated", pml = "OMPI_MCA_pml", &
      & pointers = "OMPI_MCA_sharedfp"
    character(len=*), parameter :: launchers(*) = [character(len=21) :: "PMIX_RANK", "PMIX_NAMESPACE", "PMI_RANK", "PMI_FD", &
      & "OMPI_COMM_WORLD_SIZE", "SLURM_STEP_ID", "FLUX_TASK_RANK", "ALPS_APP_PE", "PALS_RANKID"]
    logical :: is_new, eased(n_suggested)
    integer :: k

    do k = 1, size(launchers)
      call forget_environment(trim(launchers(k)))
    end do
    call forget_environment(isolated)
    call forget_environment(pml)
    call forget_environment(pointers)
    do k = 1, size(launchers)
      call suggest_environment(trim(launchers(k)), "0", is_new)
      call ease_start(eased)
      call check(value_of(isolated) == "" .and. value_of(pml) == "" .and. value_of(pointers) == "", &
        & "started by "//trim(launchers(k)))
      call forget_environment(trim(launchers(k)))
    end do
    call suggest_environment(pml, "of the user", is_new)
    call check(is_new, "a variable that was not set")
    call ease_start(eased)
    call check(value_of(isolated) == "1", "a process that is alone")
    call check(value_of(pml) == "of the user", "what the user says")
    call start_is_over(eased)
    call check(value_of(isolated) == "" .and. value_of(pml) == "of the user", "what was suggested is forgotten")
    call forget_environment(pml)
    call ease_start(eased)
    call check(value_of(pml) == "ob1", "no network is looked for")
    call start_is_over(eased)
    call check(value_of(pml) == "", "programs that it starts may do so")
    call check(value_of(pointers) == "individual", "files are opened after MPI_Init")
    call forget_environment(pointers)
  end subroutine check_lone_process

  !> Of a variable of the environment, empty where it is not set.
  function value_of(name) result(value)
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: value
    character(len=80) :: buffer
    integer :: length

    call get_environment_variable(name, buffer, length)
    value = buffer(1:length)
  end function value_of

  !> A pause takes its time, and not seconds more.
  subroutine check_pause()
    integer(int64) :: before, after, rate

    call system_clock(before, rate)
    call pause_for(20000)
    call system_clock(after)
    call check(real(after - before, dp)/real(rate, dp) >= 0.02_dp, "a pause of 20 ms takes 20 ms")
    call check(real(after - before, dp)/real(rate, dp) < 5.0_dp, "and not seconds")
  end subroutine check_pause

  !> Arrays are given back to the system after `give_back_arrays`. After `keep_heap` they stay: a second allocation of nearly as
  !> much takes no memory from the machine.
  subroutine check_heap()
    real(dp), allocatable :: a(:)
    integer(int64) :: first, second, third

    allocate (a(2000000))
    a(:) = 1.0_dp
    deallocate (a)
    call give_back_arrays()
    third = resident()
    allocate (a(1000000))
    a(:) = 1.0_dp
    first = resident()
    deallocate (a)
    second = resident()
    call check(third == 0 .or. (first - third > 7000_int64 .and. second - third < 1000_int64), "8 MB are given back")

    call keep_heap()
    allocate (a(4000000))
    a(:) = 1.0_dp
    first = resident()
    deallocate (a)
    second = resident()
    call check(free_memory() /= 0, "the machine says what is free")
    if (first == 0) return
    call check(second > first - 16000_int64, "memory of 32 MB that is given back stays with the process")
    ! buffers of the files read since may lie in it
    allocate (a(3900000))
    a(:) = 2.0_dp
    call check(resident() < first + 16000_int64, "and is used again")
    call check_close(sum(a)/size(a), 2.0_dp, 0.0_dp, "it holds what was written")
  end subroutine check_heap

  !> Memory of the process that is in use [kB], 0 where the system does not say.
  integer(int64) function resident()
    character(len=120) :: line
    integer :: unit, status

    resident = 0
    open (newunit=unit, file="/proc/self/status", status="old", action="read", iostat=status)
    do while (status == 0)
      read (unit, "(a)", iostat=status) line
      if (status /= 0) exit
      if (line(1:6) /= "VmRSS:") cycle
      read (line(7:), *) resident
      exit
    end do
    close (unit)
  end function resident

  !> The highest plane that faces up and the lowest one that faces down; slopes, circles and planes that are gone do not count.
  !> Planes that have turned count where they meet the line along the axis through a place.
  subroutine check_facing_planes()
    type(boundary_t) :: planes(6)
    real(dp), parameter :: origin(3) = 0.0_dp
    real(dp) :: low, high, angle
    integer :: k

    planes(1) = plane(1, [0.0_dp, 0.1_dp], [0.0_dp, 1.0_dp])
    planes(2) = plane(2, [5.0_dp, 0.3_dp], [0.0_dp, 1.0_dp])
    planes(3) = plane(3, [0.0_dp, 2.0_dp], [0.0_dp, -1.0_dp])
    planes(4) = plane(4, [0.0_dp, 0.9_dp], [0.6_dp, 0.8_dp])
    planes(5) = plane(5, [0.0_dp, 1.5_dp], [0.0_dp, -1.0_dp])
    planes(6) = plane(6, [-3.0_dp, 0.0_dp], [1.0_dp, 0.0_dp])
    planes(5)%present = .false.
    call find_facing_planes(planes, 2, origin, low, high)
    call check_close(low, 0.3_dp, 0.0_dp, "the highest floor")
    call check_close(high, 2.0_dp, 0.0_dp, "the lowest lid that is there")
    call find_facing_planes(planes, 1, origin, low, high)
    call check_close(low, -3.0_dp, 0.0_dp, "the plane that faces along x")
    call check(high >= huge(high), "nothing faces against x")
    call change_shape("circle", planes(2))
    call find_facing_planes(planes, 2, origin, low, high)
    call check_close(low, 0.1_dp, 0.0_dp, "a circle is no plane")
    planes(1) = plane(1, [0.0_dp, 0.0_dp], [1.0_dp, 0.0_dp])
    planes(2) = plane(2, [0.19_dp, 0.0_dp], [-1.0_dp, 0.0_dp])
    call check_equal(planes(2)%faces, -1, "a plane that faces down the first axis")
    do k = 0, 14
      angle = 0.1_dp*k
      planes(1)%surface%axis(1) = cos(angle)
      planes(1)%surface%axis(2) = -sin(angle)
      planes(2)%surface%axis(1:2) = -planes(1)%surface%axis(1:2)
      call find_facing_planes(planes(1:2), 1, [7.0_dp, 0.05_dp, 0.0_dp], low, high)
      call check_close(high - low, 0.19_dp, 1e-14_dp, "way between parallel planes that turn")
      call check_close(low, 0.05_dp*tan(angle), 1e-14_dp, "where a plane that turns about its foot is above it")
    end do
    planes(1)%surface%axis(1:2) = [cos(1.5_dp), -sin(1.5_dp)]
    call find_facing_planes(planes(1:2), 1, origin, low, high)
    call check(low <= -huge(low), "a plane that has turned by 86 degrees faces no more")
  end subroutine check_facing_planes

end program test_small_modules
