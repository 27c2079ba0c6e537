!> Grains that leave the scene: behind outlets, with the boundary that they are glued to, or because they were dismissed.
module gravier_removal
  use gravier_kinds, only: dp, i8
  use gravier_sorting, only: find_sorted
  use gravier_body_store, only: body_set_t
  use gravier_decomposition, only: decomposition_t
  use gravier_halo, only: mask_t, halo_t
  implicit none
  private
  public :: some_leave, remove_grains, drop_grains, find_staying

contains

  !> Whether a grain stays in the scene: its centre lies behind no outlet, the boundary that it is glued to is there, and it was not
  !> dismissed.
  pure logical function stays(decomposition, bodies, k)
    type(decomposition_t), intent(in) :: decomposition
    type(body_set_t), intent(in) :: bodies
    integer, intent(in) :: k
    integer :: b
    real(dp) :: distance, normal(3)

    stays = .true.
    associate (boundaries => decomposition%boundaries)
      if (bodies%glued(k) > 0) then
        stays = boundaries(bodies%glued(k))%present
        return
      end if
      if (allocated(decomposition%dismissed)) stays = find_sorted(decomposition%dismissed, bodies%id(k)) == 0
      do b = 1, size(boundaries)
        if (.not. (boundaries(b)%lets_out() .and. boundaries(b)%present)) cycle
        call boundaries(b)%locate(bodies%position(:, k), distance, normal(1:decomposition%nd))
        if (distance < 0.0_dp) stays = .false.
      end do
    end associate
  end function stays

  !> Which bodies of a set stay.
  subroutine find_staying(decomposition, bodies, mask)
    type(decomposition_t), intent(in) :: decomposition
    type(body_set_t), intent(in) :: bodies
    logical, allocatable, intent(out) :: mask(:)
    integer :: k

    allocate (mask(bodies%n))
    do k = 1, bodies%n
      mask(k) = stays(decomposition, bodies, k)
    end do
  end subroutine find_staying

  !> Whether free grains may leave now: the scene has an outlet, or some were dismissed.
  pure logical function some_may_leave(decomposition)
    type(decomposition_t), intent(in) :: decomposition
    integer :: b

    some_may_leave = allocated(decomposition%dismissed)
    do b = 1, size(decomposition%boundaries)
      some_may_leave = some_may_leave .or. decomposition%boundaries(b)%lets_out()
    end do
  end function some_may_leave

  !> Whether some grain leaves the scene now. Collective.
  logical function some_leave(decomposition)
    type(decomposition_t), intent(in) :: decomposition
    integer :: s, k

    some_leave = .false.
    if (.not. some_may_leave(decomposition)) return
    do s = 1, size(decomposition%owned)
      do k = 1, decomposition%owned(s)%n
        if (.not. stays(decomposition, decomposition%owned(s), k)) some_leave = .true.
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
    integer :: s

    n_free = 0
    n_glued = 0
    mass = 0.0_dp
    if (.not. some_may_leave(decomposition) .and. (.not. has_glued .or. all(decomposition%boundaries%present))) return
    counts(:) = 0
    do s = 1, size(decomposition%owned)
      associate (owned => decomposition%owned(s))
        call find_staying(decomposition, owned, mask)
        counts(2) = counts(2) + count(.not. mask .and. owned%glued > 0)
        counts(1) = counts(1) + count(.not. mask .and. owned%glued == 0)
        parts(s) = sum(owned%mass, mask=.not. mask .and. owned%glued == 0)
        if (.not. all(mask)) call owned%keep_only(mask)
      end associate
    end do
    if (allocated(decomposition%dismissed)) deallocate (decomposition%dismissed)
    call decomposition%comm%sum_counts(counts)
    n_free = counts(1)
    n_glued = counts(2)
    if (n_free > 0) mass = decomposition%comm%sum_real(parts)
  end subroutine remove_grains

  !> Take the grains that leave out of views and lists, which stay valid for the others, before `remove_grains` takes them out of
  !> the scene. The views are up to date.
  subroutine drop_grains(decomposition, halo)
    type(decomposition_t), intent(in) :: decomposition
    type(halo_t), intent(inout) :: halo
    type(mask_t) :: owned_stays(size(decomposition%owned)), view_stays(size(decomposition%owned))
    integer :: s

    do s = 1, size(decomposition%owned)
      call find_staying(decomposition, decomposition%owned(s), owned_stays(s)%of)
      call find_staying(decomposition, halo%view(s)%bodies, view_stays(s)%of)
    end do
    call halo%drop(owned_stays, view_stays)
  end subroutine drop_grains

end module gravier_removal
