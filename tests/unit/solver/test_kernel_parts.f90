!> The parts that the loops over contacts are made of: blocks and lanes, rows of the contact data, the table of the loops and the
!> choice among them.
program test_kernel_parts
  use gravier_kinds, only: dp
  use gravier_contact_data, only: contact_rows_t, lanes, n_blocks, block_of, lane_of, rows_2d_frictionless, rows_2d_friction, &
    & rows_2d_friction_shift, rows_2d_friction_rolling, rows_2d_friction_shift_rolling, rows_3d_frictionless, rows_3d_friction, &
    & rows_3d_friction_shift, rows_3d_friction_rolling, rows_3d_friction_shift_rolling, rows_2d_compliant, &
    & rows_2d_compliant_rolling, rows_3d_compliant, rows_3d_compliant_rolling
  use gravier_kernel_table, only: kernel_table_t
  use gravier_sweeps_2d, only: choose_sweeps_2d
  use gravier_sweeps_3d, only: choose_sweeps_3d
  use gravier_block_loops_2d, only: choose_loops_2d
  use gravier_block_loops_3d, only: choose_loops_3d
  use gravier_contact_vectors, only: tangents
  use gravier_check, only: check, check_close, check_equal, finish_checks
  implicit none

  call test_blocks()
  call check_rows("2D, no friction", rows_2d_frictionless, 4)
  call check_rows("2D, friction", rows_2d_friction, 8)
  call check_rows("2D, shift", rows_2d_friction_shift, 9)
  call check_rows("2D, rolling", rows_2d_friction_rolling, 11)
  call check_rows("2D, shift and rolling", rows_2d_friction_shift_rolling, 12)
  call check_rows("3D, no friction", rows_3d_frictionless, 5)
  call check_rows("3D, friction", rows_3d_friction, 9)
  call check_rows("3D, shift", rows_3d_friction_shift, 11)
  call check_rows("3D, rolling", rows_3d_friction_rolling, 13)
  call check_rows("3D, shift and rolling", rows_3d_friction_shift_rolling, 15)
  call check_rows("2D, compliant", rows_2d_compliant, 11)
  call check_rows("2D, compliant and rolling", rows_2d_compliant_rolling, 14)
  call check_rows("3D, compliant", rows_3d_compliant, 13)
  call check_rows("3D, compliant and rolling", rows_3d_compliant_rolling, 17)
  call test_choices()
  call test_drop()
  call test_tangents()
  call finish_checks()

contains

  subroutine test_blocks()
    integer :: c

    call check_equal(n_blocks(0), 0, "no contacts take no block")
    call check_equal(n_blocks(lanes), 1, "as many contacts as lanes take a block")
    call check_equal(n_blocks(lanes + 1), 2, "one more takes another block")
    do c = 1, 3*lanes
      call check_equal((block_of(c) - 1)*lanes + lane_of(c), c, "blocks and lanes number contacts in their order")
      call check(lane_of(c) >= 1 .and. lane_of(c) <= lanes, "lanes are within the block")
    end do
  end subroutine test_blocks

  !> Each row from 1 to the last has one name.
  subroutine check_rows(what, row, total)
    character(len=*), intent(in) :: what
    type(contact_rows_t), intent(in) :: row
    integer, intent(in) :: total
    integer :: named(17), k

    call check_equal(row%total, total, what//": rows")
    named(1) = row%nx
    named(2) = row%ny
    named(3) = row%nz
    named(4) = row%shift
    named(5) = row%per_wnn
    named(6) = row%per_wtt
    named(7) = row%lever_i
    named(8) = row%lever_j
    named(9) = row%friction
    named(10) = row%shift_t
    named(11) = row%shift_s
    named(12) = row%rolling_radius
    named(13) = row%per_wrr
    named(14) = row%rolling_friction
    named(15) = row%pivoting_friction
    named(16) = row%compliance_n
    named(17) = row%compliance_t
    do k = 1, total
      call check_equal(count(named == k), 1, what//": each row has one name")
    end do
    call check_equal(count(named > 0), total, what//": each name has one row")
    call check(all(named <= total), what//": names are within the rows")
  end subroutine check_rows

  !> Each set of effects has loops of its own.
  subroutine test_choices()
    type(kernel_table_t) :: tables(20)
    logical, parameter :: friction(10) = [.false., .true., .true., .true., .true., .true., .true., .true., .true., .true.]
    logical, parameter :: shifted(10) = [.false., .false., .true., .false., .true., .false., .true., .true., .true., .true.]
    logical, parameter :: rolling(10) = [.false., .false., .false., .true., .true., .false., .false., .false., .true., .false.]
    logical, parameter :: shaped(10) = [.false., .false., .false., .false., .false., .true., .true., .false., .false., .true.]
    integer :: k, l

    do k = 1, 10
      call choose_sweeps_2d(tables(k), friction(k), shifted(k), rolling(k), shaped(k), k > 7)
      call choose_loops_2d(tables(k), friction(k), shifted(k), rolling(k), shaped(k), k > 7)
      call choose_sweeps_3d(tables(10 + k), friction(k), shifted(k), rolling(k), shaped(k), k > 7)
      call choose_loops_3d(tables(10 + k), friction(k), shifted(k), rolling(k), shaped(k), k > 7)
    end do
    do k = 1, size(tables)
      call check(associated(tables(k)%sweep_recording) .and. associated(tables(k)%sweep_momentum_recording) &
        & .and. associated(tables(k)%contact_velocity) .and. associated(tables(k)%set_operators) &
        & .and. associated(tables(k)%make_tests), "all loops are chosen")
      do l = 1, k - 1
        call check(.not. associated(tables(k)%sweep, tables(l)%sweep), "sweeps differ")
        call check(.not. associated(tables(k)%sweep_momentum, tables(l)%sweep_momentum), "sweeps with momentum differ")
        call check(.not. associated(tables(k)%add_reaction, tables(l)%add_reaction), "reactions differ")
        call check(.not. associated(tables(k)%residual, tables(l)%residual), "residuals differ")
      end do
    end do
  end subroutine test_choices

  !> A sphere of 2 kg that falls on the ground at 3 m/s, without friction: a sweep stops it, by an impulse of 6 N s.
  subroutine test_drop()
    type(kernel_table_t) :: kernels
    real(dp) :: hot(lanes, 5, 1), weight(3, 2), velocity(3, 2), impulse(lanes, 1, 1), sums(2), reaction(3, 2), residuals(3)
    integer :: pair(2, lanes)

    call choose_sweeps_3d(kernels, .false., .false., .false., .false., .false.)
    call choose_loops_3d(kernels, .false., .false., .false., .false., .false.)
    pair(:, :) = 1
    pair(2, 1) = 2
    hot(:, :, :) = 0.0_dp
    hot(1, rows_3d_frictionless%nz, 1) = 1.0_dp
    weight(:, :) = 0.0_dp
    weight(:, 1) = 0.5_dp
    velocity(:, :) = 0.0_dp
    velocity(3, 1) = -3.0_dp
    impulse(:, :, :) = 0.0_dp
    call kernels%residual(pair, hot, weight, velocity, impulse, residuals)
    call check_close(residuals(1), 36.0_dp, 1.0e-12_dp, "the residual is the square of the missing impulse")
    call kernels%set_operators(pair, hot, weight, [1.0_dp, 1.0_dp, 1.0_dp])
    hot(2:, :, :) = 0.0_dp
    call check_close(hot(1, rows_3d_frictionless%per_wnn, 1), 2.0_dp, 1.0e-14_dp, "1/W_nn is the mass")
    call kernels%sweep(0, pair, hot, weight, velocity, impulse, sums)
    call check_close(impulse(1, 1, 1), 6.0_dp, 1.0e-14_dp, "impulse of a sphere that falls")
    call check_close(velocity(3, 1), 0.0_dp, 1.0e-14_dp, "a sphere that has fallen rests")
    call check_close(sums(1), 36.0_dp, 1.0e-12_dp, "the sum of the squared changes")
    reaction(:, :) = 0.0_dp
    call kernels%add_reaction(pair, hot, impulse, reaction)
    call check_close(reaction(3, 2), -6.0_dp, 1.0e-14_dp, "the ground has the opposite of the impulse")
  end subroutine test_drop

  subroutine test_tangents()
    real(dp) :: n(3), t(3), s(3)

    n(:) = [0.48_dp, -0.6_dp, -0.64_dp]
    call tangents(n, t, s)
    call check_close(dot_product(n, t), 0.0_dp, 1.0e-15_dp, "t is at a right angle to n")
    call check_close(norm2(t), 1.0_dp, 1.0e-15_dp, "t is a unit vector")
    call check_close(n(2)*t(3) - n(3)*t(2), s(1), 1.0e-15_dp, "s is n times t")
  end subroutine test_tangents

end program test_kernel_parts
