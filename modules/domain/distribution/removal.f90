!> Grains that leave the scene: behind outlets, or with the boundary that they are glued to.
module gravier_removal
  use gravier_kinds, only: dp, i8
  use gravier_decomposition, only: decomposition_t
  implicit none
  private
  public :: some_leave, remove_grains

contains

  !> Whether grain `k` of subdomain `s` of this rank stays in the scene: its centre lies behind no outlet, and the
  !> boundary that it is glued to is there.
  pure logical function stays(decomposition, s, k)
    type(decomposition_t), intent(in) :: decomposition
    integer, intent(in) :: s, k
    integer :: b
    real(dp) :: distance, normal(decomposition%nd)

    stays = .true.
    associate (boundaries => decomposition%boundaries, owned => decomposition%owned(s))
      if (owned%glued(k) > 0) then
        stays = boundaries(owned%glued(k))%present
        return
      end if
      do b = 1, size(boundaries)
        if (.not. (boundaries(b)%lets_out() .and. boundaries(b)%present)) cycle
        call boundaries(b)%locate(owned%position(:, k), distance, normal)
        if (distance < 0.0_dp) stays = .false.
      end do
    end associate
  end function stays

  !> Whether the scene has an outlet.
  pure logical function has_outlet(decomposition)
    type(decomposition_t), intent(in) :: decomposition
    integer :: b

    has_outlet = .false.
    do b = 1, size(decomposition%boundaries)
      has_outlet = has_outlet .or. decomposition%boundaries(b)%lets_out()
    end do
  end function has_outlet

  !> Whether some grain leaves the scene now. Collective.
  logical function some_leave(decomposition)
    type(decomposition_t), intent(in) :: decomposition
    integer :: s, k

    some_leave = .false.
    if (.not. has_outlet(decomposition)) return
    do s = 1, size(decomposition%owned)
      do k = 1, decomposition%owned(s)%n
        if (.not. stays(decomposition, s, k)) some_leave = .true.
      end do
    end do
    some_leave = decomposition%comm%any_true(some_leave)
  end function some_leave

  !> Take the grains that leave out of the scene. Collective.
  subroutine remove_grains(decomposition, has_glued, n_free, n_glued, mass)
    type(decomposition_t), intent(inout) :: decomposition
    !> some grain of the scene is glued to a boundary
    logical, intent(in) :: has_glued
    !> grains of all ranks that leave
    integer(i8), intent(out) :: n_free, n_glued
    !> of the free ones that leave [kg]
    real(dp), intent(out) :: mass
    logical, allocatable :: mask(:)
    integer(i8) :: counts(2)
    real(dp) :: parts(size(decomposition%owned))
    integer :: s, k

    n_free = 0
    n_glued = 0
    mass = 0.0_dp
    if (.not. has_outlet(decomposition) .and. (.not. has_glued .or. all(decomposition%boundaries%present))) return
    counts(:) = 0
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        allocate (mask(owned%n))
        do k = 1, owned%n
          mask(k) = stays(decomposition, s, k)
        end do
        counts(2) = counts(2) + count(.not. mask .and. owned%glued > 0)
        counts(1) = counts(1) + count(.not. mask .and. owned%glued == 0)
        parts(s) = sum(owned%mass, mask=.not. mask .and. owned%glued == 0)
        if (.not. all(mask)) call owned%keep_only(mask)
        deallocate (mask)
      end associate
    end do
    call decomposition%comm%sum_counts(counts)
    n_free = counts(1)
    n_glued = counts(2)
    if (n_free > 0) mass = decomposition%comm%sum_real(parts)
  end subroutine remove_grains

end module gravier_removal
