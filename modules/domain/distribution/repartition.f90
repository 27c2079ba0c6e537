!> When space is divided into subdomains, and how.
module gravier_repartition
  use gravier_kinds, only: dp
  use gravier_errors, only: error_t
  use gravier_text, only: to_text
  use gravier_body_store, only: body_set_t
  use gravier_box_counts, only: choose_boxes, check_subdomains
  use gravier_partition, only: partition_t
  use gravier_decomposition, only: decomposition_t
  use gravier_halo, only: halo_t
  implicit none
  private
  public :: repartition_rule_t, divide, repartition, repartition_is_due

  !> How space is to be divided, and how often.
  type :: repartition_rule_t
    !> cells with grains in them, distributed by METIS; else boxes
    logical :: by_graph = .false.
    !> boxes along each axis; where some are 0, they are chosen by the number of subdomains
    integer :: grid(3) = 0
    integer :: subdomains = 1
    !> steps between two divisions, 0 for never
    integer :: every = 0
    !> largest over mean number of contacts of a subdomain that asks for a new division, 0 for none
    real(dp) :: imbalance = 0.0_dp
    !> space is divided in another way than this, by a run before a restart: the next step divides it
    logical :: overdue = .false.
  contains
    procedure :: text => repartition_rule_text
  end type repartition_rule_t

  !> times the imbalance that the last division reached: one that is worth another division
  real(dp), parameter :: worth_dividing = 1.1_dp

contains

  !> How space is divided, in a word or a few: two rules with the same text divide it in the same way.
  pure function repartition_rule_text(self) result(text)
    class(repartition_rule_t), intent(in) :: self
    character(len=:), allocatable :: text
    integer :: d

    text = "metis"
    if (self%by_graph) return
    text = "grid"
    do d = 1, size(self%grid)
      text = text//" "//to_text(self%grid(d))
    end do
  end function repartition_rule_text

  !> Whether step `step` starts from a new partition: because one is overdue, by schedule, or because contacts lie unevenly, and
  !> more so than just after the last one. What that could not cure is tried again, ever more rarely: grains that fall or flow on
  !> may have made it curable.
  pure logical function repartition_is_due(rule, step, imbalance, reached) result(due)
    type(repartition_rule_t), intent(in) :: rule
    integer, intent(in) :: step
    !> largest over mean number of contacts of a subdomain: in the last step, and just after the last division
    real(dp), intent(in) :: imbalance, reached

    due = rule%overdue
    if (step == 0 .or. rule%subdomains == 1 .or. due) return
    if (rule%every > 0) due = mod(step, rule%every) == 0
    if (rule%imbalance > 0.0_dp .and. imbalance > rule%imbalance) due = due .or. imbalance > worth_dividing*reached .or. &
      & is_one_of_few(step)
  end function repartition_is_due

  !> Whether a number of steps made is one of 16, 20, 24, 28, 32, 40, 48, 56, 64, 80 ...: four in each doubling.
  pure logical function is_one_of_few(step) result(is)
    integer, intent(in) :: step
    integer :: n

    n = step
    do while (n >= 8 .and. mod(n, 2) == 0)
      n = n/2
    end do
    is = step >= 16 .and. n < 8
  end function is_one_of_few

  !> Divide space for the grains given. Collective.
  subroutine divide(rule, halo, bodies, decomposition, error)
    type(repartition_rule_t), intent(in) :: rule
    !> near pairs as far as they are known
    type(halo_t), intent(in) :: halo
    !> of this rank, however grouped
    type(body_set_t), intent(in) :: bodies(:)
    type(decomposition_t), intent(inout) :: decomposition
    type(error_t), allocatable, intent(inout) :: error
    real(dp) :: lower(decomposition%nd), upper(decomposition%nd), edge

    call decomposition%bounding_box(bodies, lower, upper)
    edge = decomposition%rule%cell_edge()
    ! without grains any edge serves
    if (.not. edge > 0.0_dp) edge = 1.0_dp
    call check_subdomains(lower, upper, edge, rule%subdomains, error)
    if (.not. allocated(error)) call cut()
    call decomposition%comm%agree(error)

  contains

    !> Cut the box [lower, upper] as the rule says. Collective.
    subroutine cut()
      real(dp), allocatable :: points(:, :)
      integer, allocatable :: weights(:)
      integer :: boxes(3)

      associate (partition => decomposition%partition)
        partition%period(:) = decomposition%period%length
        ! a cell that moves is cut as the box that it is, and its images are found by the decomposition
        if (decomposition%period%moves) partition%period(:) = 0.0_dp
        call partition%set_box(lower, upper)
        if (rule%by_graph) then
          call collect_weights(decomposition%nd, halo, bodies, points, weights)
          call partition%init_graph(decomposition%comm, edge, points, weights, rule%subdomains, error)
        else
          boxes(:) = rule%grid
          if (any(boxes < 1)) boxes(:) = choose_boxes(lower, upper, rule%subdomains, decomposition%period%length)
          call partition%init_grid(boxes, edge, error)
        end if
      end associate
    end subroutine cut

  end subroutine divide

  !> Divide space anew; where that cannot be, as in a scene that has come to fill fewer cells than there are subdomains, the old
  !> partition stays. Collective.
  subroutine repartition(rule, halo, decomposition, refusal)
    !> is not overdue afterwards
    type(repartition_rule_t), intent(inout) :: rule
    type(halo_t), intent(in) :: halo
    type(decomposition_t), intent(inout) :: decomposition
    !> why it stays; not allocated where space was divided
    character(len=:), allocatable, intent(out) :: refusal
    type(body_set_t), allocatable :: bodies(:)
    type(partition_t) :: old
    type(error_t), allocatable :: error

    rule%overdue = .false.
    old = decomposition%partition
    call move_alloc(decomposition%owned, bodies)
    call divide(rule, halo, bodies, decomposition, error)
    call move_alloc(bodies, decomposition%owned)
    if (.not. allocated(error)) return
    refusal = error%message
    decomposition%partition = old
  end subroutine repartition

  !> What a subdomain has to carry: grains, and as far as they are known near pairs, at their candidates.
  subroutine collect_weights(nd, halo, bodies, points, weights)
    integer, intent(in) :: nd
    type(halo_t), intent(in) :: halo
    type(body_set_t), intent(in) :: bodies(:)
    !> (nd, n) [m]; (n)
    real(dp), allocatable, intent(out) :: points(:, :)
    integer, allocatable, intent(out) :: weights(:)
    integer :: s, p, k, n, n_points

    n_points = sum(bodies%n)
    if (halo%builds > 0) then
      do s = 1, size(halo%view)
        n_points = n_points + halo%view(s)%bodies%n
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
    if (halo%builds == 0) return
    do s = 1, size(halo%view)
      associate (view => halo%view(s))
        points(:, n + 1:n + view%bodies%n) = view%bodies%position
        do p = 1, view%list%n
          weights(n + view%list%candidate(p)) = weights(n + view%list%candidate(p)) + 1
        end do
        n = n + view%bodies%n
      end associate
    end do
  end subroutine collect_weights

end module gravier_repartition
