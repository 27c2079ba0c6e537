!> When space is divided into subdomains, and how &decomposition wants it.
module gravier_division
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_body_store, only: body_set_t
  use gravier_partition, only: partition_t, choose_boxes, check_subdomains
  use gravier_decomposition, only: decomposition_t
  use gravier_neighbourhood, only: neighbourhoods_t
  use gravier_config_types, only: config_t, decomposition_config_t
  implicit none
  private
  public :: divide, divide_again, division_is_due

  !> times the imbalance that the last division reached: one that is worth another division
  real(dp), parameter :: worth_dividing = 1.1_dp

contains

  !> Whether step `step` starts from a new partition: by schedule, or because contacts lie unevenly, and more so than just after
  !> the last one: what that could not cure is not tried again.
  pure logical function division_is_due(config, step, imbalance, reached) result(due)
    type(decomposition_config_t), intent(in) :: config
    integer, intent(in) :: step
    !> largest over mean number of contacts of a subdomain: in the last step, and just after the last division
    real(dp), intent(in) :: imbalance, reached

    due = .false.
    if (step == 0 .or. config%subdomains == 1) return
    if (config%repartition_every > 0) due = mod(step, config%repartition_every) == 0
    if (config%repartition_imbalance > 0.0_dp) due = due .or. &
      & imbalance > max(config%repartition_imbalance, worth_dividing*reached)
  end function division_is_due

  !> Divide space for the grains given. Collective.
  subroutine divide(config, neighbourhoods, bodies, decomposition, error)
    type(config_t), intent(in) :: config
    !> near pairs as far as they are known
    type(neighbourhoods_t), intent(in) :: neighbourhoods
    !> of this rank, however grouped
    type(body_set_t), intent(in) :: bodies(:)
    type(decomposition_t), intent(inout) :: decomposition
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: lower(decomposition%nd), upper(decomposition%nd), edge

    call decomposition%bounding_box(bodies, lower, upper)
    edge = 2.0_dp*decomposition%rule%largest_radius + decomposition%rule%range()
    ! without grains any edge serves
    if (.not. edge > 0.0_dp) edge = 1.0_dp
    call check_subdomains(lower, upper, edge, config%decomposition%subdomains, error)
    if (.not. allocated(error)) call cut()
    if (allocated(error)) error%message = config%file//": "//error%message
    call decomposition%comm%agree(error)

  contains

    !> Cut the box [lower, upper] as &decomposition says. Collective.
    subroutine cut()
      real(dp), allocatable :: points(:, :)
      integer, allocatable :: weights(:)
      integer :: boxes(3)

      associate (wanted => config%decomposition, partition => decomposition%partition)
        partition%period(:) = decomposition%period%length
        if (wanted%partition == "metis") then
          call collect_weights(decomposition%nd, neighbourhoods, bodies, points, weights)
          call partition%init_graph(decomposition%comm, lower, upper, edge, points, weights, wanted%subdomains, error)
        else
          boxes(:) = wanted%grid
          if (any(boxes < 1)) boxes(:) = choose_boxes(lower, upper, wanted%subdomains, decomposition%period%length)
          call partition%init_grid(lower, upper, boxes, edge, error)
        end if
      end associate
    end subroutine cut

  end subroutine divide

  !> Divide space anew; where the scene has come to fill fewer cells than there are subdomains, the old partition
  !> stays. Collective.
  subroutine divide_again(config, neighbourhoods, decomposition, refused)
    type(config_t), intent(in) :: config
    type(neighbourhoods_t), intent(in) :: neighbourhoods
    type(decomposition_t), intent(inout) :: decomposition
    logical, intent(out) :: refused
    type(body_set_t), allocatable :: bodies(:)
    type(partition_t) :: old
    type(error_t), allocatable :: error

    old = decomposition%partition
    call move_alloc(decomposition%home, bodies)
    call divide(config, neighbourhoods, bodies, decomposition, error)
    call move_alloc(bodies, decomposition%home)
    refused = allocated(error)
    if (refused) decomposition%partition = old
  end subroutine divide_again

  !> What a subdomain has to carry: grains, and as far as they are known near pairs, at their candidates.
  subroutine collect_weights(nd, neighbourhoods, bodies, points, weights)
    integer, intent(in) :: nd
    type(neighbourhoods_t), intent(in) :: neighbourhoods
    type(body_set_t), intent(in) :: bodies(:)
    !> (nd, n) [m]; (n)
    real(dp), allocatable, intent(out) :: points(:, :)
    integer, allocatable, intent(out) :: weights(:)
    integer :: s, p, k, n, n_points

    n_points = sum(bodies%n)
    if (neighbourhoods%builds > 0) then
      do s = 1, size(neighbourhoods%view)
        n_points = n_points + neighbourhoods%view(s)%bodies%n
      end do
    end if
    allocate (points(nd, n_points))
    allocate (weights(n_points), source=0)
    n = 0
    do s = 1, size(bodies)
      do k = 1, bodies(s)%n
        n = n + 1
        points(:, n) = bodies(s)%position(:, k)
        weights(n) = 1
      end do
    end do
    if (neighbourhoods%builds == 0) return
    do s = 1, size(neighbourhoods%view)
      associate (view => neighbourhoods%view(s))
        points(:, n + 1:n + view%bodies%n) = view%bodies%position
        do p = 1, view%list%n
          weights(n + view%list%candidate(p)) = weights(n + view%list%candidate(p)) + 1
        end do
        n = n + view%bodies%n
      end associate
    end do
  end subroutine collect_weights

end module gravier_division
