!> Which pairs are near, how long they stay listed, and which subdomain owns them.
module gravier_neighbour_rule
  use gravier_kinds, only: dp
  use gravier_material_filter, only: material_filter_t
  implicit none
  private
  public :: neighbour_rule_t, owner_point, rule_dual, rule_primal

  !> a pair of grains belongs to the subdomain that holds the midpoint of the centres (paper, section 2.1)
  integer, parameter :: rule_dual = 1
  !> a pair belongs to the subdomain that holds the centre of its candidate; pairs of a grain and a boundary always do
  integer, parameter :: rule_primal = 2

  type :: neighbour_rule_t
    !> pairs whose gap is at most this are contacts [m]
    real(dp) :: alert_distance = 0.0_dp
    !> lists last until a body has moved by half of this, or by more where it is fast [m]
    real(dp) :: skin = 0.0_dp
    !> time for which lists are to last where bodies are fast [s], and the largest margin that a body is given for that [m]
    real(dp) :: duration = 0.0_dp, most_travel = 0.0_dp
    !> largest extent of all bodies; found when lists are made [m]
    real(dp) :: largest_extent = 0.0_dp
    !> largest and mean radius of the scene [m]
    real(dp) :: largest_radius = 0.0_dp, mean_radius = 0.0_dp
    !> rule_dual or rule_primal
    integer :: kind = rule_dual
    !> pairs that are never contacts
    type(material_filter_t) :: filter
  contains
    procedure :: range => rule_range
    procedure :: margin => rule_margin
    procedure :: extent => rule_extent
    procedure :: reach => rule_reach
    procedure :: cell_edge => rule_cell_edge
    procedure :: sweep_edge => rule_sweep_edge
  end type neighbour_rule_t

contains

  !> Largest gap up to which pairs are listed, of bodies as fast as may be [m].
  pure real(dp) function rule_range(self) result(range)
    class(neighbour_rule_t), intent(in) :: self
    range = self%alert_distance + max(self%skin, 2.0_dp*self%most_travel)
  end function rule_range

  !> How far a body may go before lists are made anew [m].
  pure real(dp) function rule_margin(self, speed) result(margin)
    class(neighbour_rule_t), intent(in) :: self
    !> of the body when the lists are made [m/s]
    real(dp), intent(in) :: speed
    margin = max(0.5_dp*self%skin, min(self%duration*speed, self%most_travel))
  end function rule_margin

  !> Radius of a body with its margin [m].
  pure real(dp) function rule_extent(self, radius, speed) result(extent)
    class(neighbour_rule_t), intent(in) :: self
    !> of the body [m], and when the lists are made [m/s]
    real(dp), intent(in) :: radius, speed
    extent = radius + self%margin(speed)
  end function rule_extent

  !> How far from its centre a grain's pairs may have the point that decides their owner, or the candidate whose owner
  !> needs it [m].
  pure real(dp) function rule_reach(self, radius, speed) result(reach)
    class(neighbour_rule_t), intent(in) :: self
    !> of the grain [m], [m/s]
    real(dp), intent(in) :: radius, speed
    reach = self%extent(radius, speed) + self%largest_extent + self%alert_distance
    if (self%kind /= rule_primal) reach = 0.5_dp*reach
  end function rule_reach

  !> Smallest edge of the cells that make up subdomains [m]: what decides the owner of a pair lies in a cell next to those of its
  !> grains.
  pure real(dp) function rule_cell_edge(self) result(edge)
    class(neighbour_rule_t), intent(in) :: self
    real(dp) :: farthest

    farthest = 2.0_dp*self%largest_radius + self%range()
    if (self%kind /= rule_primal) farthest = 0.5_dp*farthest
    edge = max(farthest, 2.0_dp*self%largest_radius + self%alert_distance + self%skin)
  end function rule_cell_edge

  !> Edge of the cells in whose order contacts are swept [m].
  pure real(dp) function rule_sweep_edge(self) result(edge)
    class(neighbour_rule_t), intent(in) :: self
    edge = 2.0_dp*self%mean_radius + self%alert_distance
    if (.not. edge > 0.0_dp) edge = 1.0_dp
  end function rule_sweep_edge

  !> The point whose subdomain owns a pair of grains: the midpoint of the centres (dual), the candidate's centre (primal).
  pure function owner_point(kind, candidate, antagonist) result(point)
    integer, intent(in) :: kind
    !> centres, the antagonist's shifted to where it meets the candidate (nd) [m]
    real(dp), intent(in) :: candidate(:), antagonist(:)
    real(dp) :: point(size(candidate))

    if (kind == rule_primal) then
      point(:) = candidate
    else
      point(:) = 0.5_dp*(candidate + antagonist)
    end if
  end function owner_point

end module gravier_neighbour_rule
