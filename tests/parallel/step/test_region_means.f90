!> Means over regions in a scene of many subdomains: the whole scene has the mean stress, bins have what their region has, and what
!> is known of a lattice at rest. Extents of scenes, branches of contacts.
program test_region_means
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_communicator, only: communicator_t, start_parallel, stop_parallel
  use gravier_mean_stress, only: mean_stress_t
  use gravier_scene_extent, only: find_extent
  use gravier_contact_branch, only: find_branch
  use gravier_region_samples, only: region_figures_t
  use gravier_region_means, only: region_means_t, regions_key
  use gravier_simulation, only: simulation_t, step_figures_t
  use gravier_test_simulations, only: make_scene
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  character(len=*), parameter :: regions = "&region name = 'all', bins = 5, axis = 'y' / "// &
    & "&region name = 'left', upper(1) = 0.31 / &region name = 'right', lower(1) = 0.31, bins = 3, axis = 'x' / "
  character(len=*), parameter :: others = "&solver method = 'nscdd' / &decomposition subdomains = 4 / "// &
    & "&output stress = .true. / &time step = 0.002, steps = 200 / "
  type(communicator_t), target :: comm

  call start_parallel()
  call comm%init()
  call test_whole("&scene bodies = 'lattice', lattice_count = 6, 5, radius_min = 0.04, radius_max = 0.06, friction = 0.4, "// &
    & "restitution = 0.5 / "//others//regions)
  call test_whole("&scene bodies = 'lattice', dimension = 3, lattice_count = 4, 4, 5, radius_min = 0.04, radius_max = 0.06, "// &
    & "period = 0.504, 0.504, 0 / "//others//regions)
  call test_extent()
  call finish_checks()
  call comm%free()
  call stop_parallel()

contains

  !> The whole scene has the stress, the volume and the solid fraction of `stress`, the parts of the scene add up to it, and so do
  !> bins.
  subroutine test_whole(text)
    character(len=*), intent(in) :: text
    type(simulation_t), target :: sim
    type(step_figures_t) :: figures
    type(error_t), allocatable :: error
    type(region_means_t), pointer :: means
    type(mean_stress_t), pointer :: stress
    type(region_figures_t), allocatable :: bins(:)
    real(dp) :: scale
    integer :: k, nd

    call make_scene(comm, text, sim)
    do k = 1, 200
      call sim%advance(figures, error)
    end do
    call check(.not. allocated(error), "steps are made")
    means => null()
    stress => null()
    select type (found => sim%diagnostics%asked(sim%diagnostics%place(regions_key))%diagnostic)
    type is (region_means_t)
      means => found
    end select
    select type (found => sim%diagnostics%asked(sim%diagnostics%place("stress"))%diagnostic)
    type is (mean_stress_t)
      stress => found
    end select
    nd = size(stress%stress, 1)
    scale = maxval(abs(stress%stress))
    call check(scale > 0.0_dp, "forces act")
    call check_branches(sim, stress)
    associate (all_of_it => means%figures(1), left => means%figures(2), right => means%figures(3))
      call check_close(all_of_it%volume(1), stress%volume, 1.0e-15_dp, "volume")
      call check_close(all_of_it%solid_fraction(1), stress%solid_fraction, 1.0e-13_dp, "solid fraction")
      call check_close(maxval(abs(all_of_it%stress(:, :, 1) - stress%stress))/scale, 0.0_dp, 1.0e-13_dp, "stress of the scene")
      call check_close(all_of_it%pressure(1)/scale, stress%pressure()/scale, 1.0e-13_dp, "pressure")
      call check_close(all_of_it%grains(1), real(sim%n_grains, dp), 0.0_dp, "grains")
      call check_close(left%grains(1) + right%grains(1), all_of_it%grains(1), 0.0_dp, "each grain is in one of two parts")
      call check_close(left%volume(1) + right%volume(1), all_of_it%volume(1), 1.0e-14_dp, "parts fill the scene")
      call check_close(left%volume(1)*left%solid_fraction(1) + right%volume(1)*right%solid_fraction(1), &
        & all_of_it%volume(1)*all_of_it%solid_fraction(1), 1.0e-14_dp, "volume of the grains of two parts")
      call check_close(maxval(abs(left%volume(1)*left%stress(:, :, 1) + right%volume(1)*right%stress(:, :, 1) - &
        & all_of_it%volume(1)*all_of_it%stress(:, :, 1)))/(scale*all_of_it%volume(1)), 0.0_dp, 1.0e-13_dp, "stress of two parts")
    end associate
    call means%find_profiles(sim%decomposition, sim%halo, sim%problem, sim%physics%h, bins)
    call check_equal(bins(1)%n, 5, "bins of the scene")
    call check_equal(bins(2)%n, 1, "a region without bins is one")
    do k = 1, 3
      associate (whole => means%figures(k), part => bins(k))
        call check_close(sum(part%grains), whole%grains(1), 0.0_dp, "grains of bins")
        call check_close(sum(part%volume), whole%volume(1), 1.0e-14_dp, "volume of bins")
        call check_close(sum(part%solid_fraction)/part%n, whole%solid_fraction(1), 1.0e-13_dp, "grains in bins")
        call check_close(maxval(abs(sum(part%stress, dim=3)/part%n - whole%stress(:, :, 1)))/scale, 0.0_dp, 1.0e-13_dp, &
          & "stress in bins")
        call check_close(sum(part%grains*part%contacts_per_grain), whole%grains(1)*whole%contacts_per_grain(1), 1.0e-9_dp, &
          & "contacts in bins")
      end associate
    end do
    call check(all(means%mass_at_start > 0.0_dp), "grains at the start")
  end subroutine test_whole

  !> Branches of contacts of a subdomain and their impulses make the mean stress.
  subroutine check_branches(sim, stress)
    type(simulation_t), intent(inout) :: sim
    type(mean_stress_t), intent(in) :: stress
    real(dp) :: branch(sim%decomposition%nd), p(sim%decomposition%nd), part(size(sim%problem%sub))
    integer :: s, c

    part(:) = 0.0_dp
    do s = 1, size(sim%problem%sub)
      do c = 1, sim%problem%sub(s)%n_contacts
        call find_branch(sim%problem%kernels, sim%problem%sub(s), c, branch)
        call sim%problem%impulse_on_candidate(s, c, p)
        part(s) = part(s) + dot_product(p, branch)
      end do
    end do
    call check_close(comm%sum_real(part)/(sim%physics%h*stress%volume*sim%decomposition%nd*stress%pressure()), 1.0_dp, 1.0e-12_dp, &
      & "trace of the stress")
  end subroutine check_branches

  !> From plane to plane, and up to grains where there is none; nothing without either.
  subroutine test_extent()
    type(simulation_t) :: sim
    real(dp) :: low(2), high(2), length(2)

    call make_scene(comm, &
      & "&scene bodies = 'column', column_count = 3, radius = 0.1, mass = 1 / &time step = 0.01, steps = 1 /", sim)
    call find_extent(sim%decomposition, .true., low, high, length)
    call check_close(length(1), 0.2_dp, 1.0e-15_dp, "a grain wide")
    call check_close(length(2), 0.6_dp, 1.0e-15_dp, "three grains high, from the ground")
    call check_close(maxval(abs(length - (high - low))), 0.0_dp, 0.0_dp, "length")
    call make_scene(comm, &
      & "&scene bodies = 'none' / &insertion lower = 0, 0, upper = 1, 1, rate = 1, radius = 0.1 / &time step = 0.01, "// &
      & "steps = 1 / &boundary shape = 'plane', normal = 0, 1, point = 0, -0.5 /", sim)
    call find_extent(sim%decomposition, .true., low, high, length)
    call check_close(low(2), -0.5_dp, 0.0_dp, "a plane alone")
    call check_close(maxval(length), 0.0_dp, 0.0_dp, "a scene without grains takes no space")
  end subroutine test_extent

end program test_region_means
