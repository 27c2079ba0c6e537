!> The table of all groups and keys of an input file: names, kinds, units, defaults, allowed values, meanings.
!> The reader, its messages and the reference in doc/keys.md all come from this table.
module gravier_config_keys
  use gravier_text, only: to_text
  use gravier_config_types, only: text_length
  implicit none
  private
  public :: group_t, key_t, groups, keys
  public :: kind_integer, kind_real, kind_logical, kind_choice, kind_text
  public :: find_group, find_key, nearest_group, nearest_key, choices_text, expected_text

  !> what a value is
  integer, parameter :: kind_integer = 1
  integer, parameter :: kind_real = 2
  integer, parameter :: kind_logical = 3
  !> one of a few words, in quotes
  integer, parameter :: kind_choice = 4
  !> any text, in quotes
  integer, parameter :: kind_text = 5

  !> A namelist group.
  type :: group_t
    character(len=16) :: name
    !> must the file have it?
    logical :: required
    character(len=120) :: meaning
  end type group_t

  !> A key of a group.
  type :: key_t
    character(len=16) :: group
    character(len=20) :: name
    !> one of the kind_ constants
    integer :: kind
    !> the default, as it would be typed after the equal sign
    character(len=16) :: default
    !> a choice: the words, separated by blanks; otherwise a rule that follows "a finite real number", "an integer"
    character(len=48) :: allowed
    character(len=200) :: meaning
    !> number of entries
    integer :: count = 1
    character(len=24) :: unit = ""
    !> replaces the default in the reference where no constant can say it
    character(len=56) :: note = ""
    !> the kinds of bodies (&scene bodies) to which the key belongs; blank: all
    character(len=16) :: bodies = ""
    !> must the group give it?
    logical :: required = .false.
  end type key_t

  type(group_t), parameter :: groups(*) = [ &
                              group_t("scene", .true., "The bodies, their loads and their contact laws."), &
                              group_t("time", .true., "The time steps."), &
                              group_t("solver", .false., "The method that solves the contacts of every step, and when it stops."), &
                              group_t("decomposition", .false., "The subdomains of the domain decomposition methods."), &
           group_t("enriched", .false., "The enriched methods `schwarz_ec` and `nscdd_ep`; the other methods ignore this group."), &
                              group_t("output", .false., "The results.")]

  type(key_t), parameter :: scene_keys(*) = [ &
                            key_t("scene", "title", kind_text, "''", "", "a title for the log and the results"), &
                       key_t("scene", "dimension", kind_integer, "2", "2 or 3", "disks in the plane (2) or spheres in space (3)"), &
                key_t("scene", "gravity", kind_real, "0, -9.81, 0", "", "acceleration of gravity; its third component is 0 in 2D", &
                                  count=3, unit="m/s^2", note="`0, -9.81, 0` in 2D, `0, 0, -9.81` in 3D"), &
                            key_t("scene", "bodies", kind_choice, "''", "column lattice file", &
                        "where the bodies come from: a column of equal bodies, a loose lattice of random radii, or a bodies file", &
                                  note="required", required=.true.), &
           key_t("scene", "bodies_file", kind_text, "''", "not empty", "path of the bodies file", note="required", bodies="file"), &
                     key_t("scene", "column_count", kind_integer, "3", ">= 1", "number of bodies in the column", bodies="column"), &
                            key_t("scene", "radius", kind_real, "1.0", "> 0", "radius of each body", unit="m", bodies="column"), &
                            key_t("scene", "mass", kind_real, "1.0", "> 0", "mass of each body", unit="kg", bodies="column"), &
                            key_t("scene", "density", kind_real, "2500", "> 0", &
                                  "density of the bodies; with `bodies = 'file'`, where the file gives no masses", &
                                  unit="kg/m^3, kg/m^2 in 2D", bodies="lattice file"), &
                            key_t("scene", "lattice_count", kind_integer, "3*0", ">= 1", &
                  "number of bodies along each axis: two entries in 2D, three in 3D", count=3, note="required", bodies="lattice"), &
              key_t("scene", "radius_min", kind_real, "0", "> 0", "smallest radius", unit="m", note="required", bodies="lattice"), &
                            key_t("scene", "radius_max", kind_real, "0", "> 0", "largest radius, at least `radius_min`", &
                                  unit="m", note="required", bodies="lattice"), &
                            key_t("scene", "seed", kind_integer, "1", "", "seed of the random radii", bodies="lattice"), &
                            key_t("scene", "friction", kind_real, "0.0", ">= 0", "friction coefficient between bodies"), &
                         key_t("scene", "wall_friction", kind_real, "-1", ">= 0", "friction coefficient between bodies and walls", &
                                  note="the value of `friction`"), &
                            key_t("scene", "alert_distance", kind_real, "-1", ">= 0", "gap below which two bodies make a contact", &
                                  unit="m", note="0.1 of the largest radius")]

  type(key_t), parameter :: time_keys(*) = [ &
                key_t("time", "step", kind_real, "0", "> 0", "length of a time step", unit="s", note="required", required=.true.), &
                      key_t("time", "steps", kind_integer, "0", ">= 0", "number of time steps", note="required", required=.true.), &
                            key_t("time", "theta", kind_real, "0.5", "in [0.5, 1]", &
                                  "weight of the new velocity in the positions: 0.5 is the mid-point rule, 1 is implicit Euler")]

  type(key_t), parameter :: solver_keys(*) = [ &
                            key_t("solver", "method", kind_choice, "'nlgs'", "nlgs schwarz schwarz_ec nscdd nscdd_ep", &
                                  "nonlinear Gauss-Seidel on one domain; Schwarz-NSCD; Schwarz-NSCD-EC; NSCDD; NSCDD-EP"), &
                            key_t("solver", "criterion", kind_choice, "'residual'", "residual error", &
                                  "figure that is compared with the tolerance; `error` is known for `bodies = 'column'` only"), &
                  key_t("solver", "tolerance", kind_real, "1e-4", "> 0", "value of the criterion at which a solve has converged"), &
                      key_t("solver", "max_iterations", kind_integer, "10000", ">= 1", "iterations after which a solve gives up"), &
                            key_t("solver", "sweeps", kind_integer, "1", ">= 1", "Gauss-Seidel sweeps in one iteration"), &
                            key_t("solver", "relaxation", kind_real, "1.0", "in (0, 1]", &
                            "share of a change of the neighbours' impulses that is taken over (`schwarz` and `schwarz_ec` only)"), &
                key_t("solver", "check_every", kind_integer, "10", ">= 1", "iterations between two evaluations of the criterion"), &
                        key_t("solver", "warm_start", kind_logical, ".true.", "", "start from the impulses of the previous step"), &
                            key_t("solver", "on_failure", kind_choice, "'continue'", "continue stop discard", &
          "after a solve that gave up: go on; write the step and stop; stop without it. One that diverged always stops without it")]

  type(key_t), parameter :: decomposition_keys(*) = [ &
                            key_t("decomposition", "partition", kind_choice, "'grid'", "grid metis", &
                                  "equal boxes, or cells with grains in them shared out by METIS"), &
                            key_t("decomposition", "kind", kind_choice, "'dual'", "dual primal", &
                                  "a contact belongs to the subdomain of its midpoint, or of the centre of its candidate"), &
                            key_t("decomposition", "grid", kind_integer, "3*0", ">= 1", &
                                  "boxes along each axis, two entries in 2D, three in 3D; only with `partition = 'grid'`", &
                                  count=3, note="found from `subdomains`"), &
                            key_t("decomposition", "subdomains", kind_integer, "1", ">= 1", &
                              "number of subdomains; `method = 'nlgs'` has one", note="the product of `grid` if given, else `1`"), &
             key_t("decomposition", "repartition_every", kind_integer, "0", ">= 0", "steps between two partitions; 0: never again")]

  type(key_t), parameter :: enriched_keys(*) = [ &
                            key_t("enriched", "direction", kind_real, "0.3", ">= 0", "search direction l", unit="1/W_aa or kg"), &
                            key_t("enriched", "direction_unit", kind_choice, "'relative'", "relative absolute", &
                                  "l in units of 1/W_aa, the inverse of the local operator of each contact, or in kg"), &
                            key_t("enriched", "contacts", kind_choice, "'all'", "all active", &
                                  "contacts that take part: all, or those that carry an impulse"), &
                            key_t("enriched", "interface", kind_choice, "'mumps'", "mumps cg", &
                                  "interface solve: direct, or conjugate gradient (`nscdd_ep` only)"), &
                            key_t("enriched", "cg_tolerance", kind_real, "1e-12", "in (0, 1)", &
                             "relative residual at which the conjugate gradient stops (`nscdd_ep` with `interface = 'cg'` only)"), &
                            key_t("enriched", "cg_max_iterations", kind_integer, "10000", ">= 1", &
                                "iterations after which the conjugate gradient gives up (`nscdd_ep` with `interface = 'cg'` only)")]

  type(key_t), parameter :: output_keys(*) = [ &
                            key_t("output", "directory", kind_text, "'results'", "not empty", "directory of the results"), &
                  key_t("output", "every", kind_integer, "1", ">= 0", "steps between two written states; 0: the last state only"), &
                            key_t("output", "contacts", kind_logical, ".true.", "", "write the contacts of each written state"), &
                    key_t("output", "trace", kind_logical, ".false.", "", "write the convergence of every solve, check by check"), &
                            key_t("output", "final_bodies", kind_logical, ".false.", "", &
                                  "write `final_bodies.h5`, a bodies file from which another scene starts")]

  type(key_t), parameter :: keys(*) = [scene_keys, time_keys, solver_keys, decomposition_keys, enriched_keys, output_keys]

contains

  !> Position of a group in the table, 0 if there is none of that (lower case) name.
  pure integer function find_group(name) result(at)
    character(len=*), intent(in) :: name
    do at = size(groups), 1, -1
      if (groups(at)%name == name) return
    end do
  end function find_group

  !> Position of a key in the table, 0 if there is none of that group and name (lower case).
  pure integer function find_key(group, name) result(at)
    character(len=*), intent(in) :: group, name
    do at = size(keys), 1, -1
      if (keys(at)%group == group .and. keys(at)%name == name) return
    end do
  end function find_key

  !> The group whose name is nearest, 0 if none is near.
  pure integer function nearest_group(name) result(at)
    character(len=*), intent(in) :: name
    integer :: i, distance, least
    at = 0
    least = farthest(name) + 1
    if (least == 0) return
    do i = 1, size(groups)
      distance = edit_distance(name, trim(groups(i)%name))
      if (distance >= least) cycle
      least = distance
      at = i
    end do
  end function nearest_group

  !> The key of the group whose name is nearest, 0 if none is near.
  pure integer function nearest_key(group, name) result(at)
    character(len=*), intent(in) :: group, name
    integer :: i, distance, least
    at = 0
    least = farthest(name) + 1
    if (least == 0) return
    do i = 1, size(keys)
      if (keys(i)%group /= group) cycle
      distance = edit_distance(name, trim(keys(i)%name))
      if (distance >= least) cycle
      least = distance
      at = i
    end do
  end function nearest_key

  !> Edits within which a name still looks like a misspelling; negative for a name longer than any in the table.
  pure integer function farthest(name)
    character(len=*), intent(in) :: name
    farthest = max(1, len(name)/3)
    if (len(name) > 2*len(keys%name)) farthest = -1
  end function farthest

  !> Insertions, deletions, replacements and swaps of neighbours that lead from one name to the other.
  pure integer function edit_distance(from, to) result(distance)
    character(len=*), intent(in) :: from, to
    integer :: d(0:len(from), 0:len(to)), i, j, change

    do i = 0, len(from)
      d(i, 0) = i
    end do
    do j = 1, len(to)
      d(0, j) = j
      do i = 1, len(from)
        change = merge(0, 1, from(i:i) == to(j:j))
        d(i, j) = min(d(i - 1, j) + 1, d(i, j - 1) + 1, d(i - 1, j - 1) + change)
        if (swapped(from, to, i, j)) d(i, j) = min(d(i, j), d(max(i - 2, 0), max(j - 2, 0)) + 1)
      end do
    end do
    distance = d(len(from), len(to))
  end function edit_distance

  !> Are the two characters that end at i and at j the same two, swapped?
  pure logical function swapped(from, to, i, j)
    character(len=*), intent(in) :: from, to
    integer, intent(in) :: i, j
    swapped = .false.
    if (i < 2 .or. j < 2) return
    swapped = from(i:i) == to(j - 1:j - 1) .and. from(i - 1:i - 1) == to(j:j)
  end function swapped

  !> Words separated by blanks as a quoted list: 'a', 'b' or 'c'.
  pure function choices_text(words) result(text)
    character(len=*), intent(in) :: words
    character(len=:), allocatable :: text
    character(len=:), allocatable :: rest
    integer :: blank

    rest = trim(words)
    text = ""
    do
      blank = index(rest, " ")
      if (blank == 0) exit
      if (len(text) > 0) text = text//", "
      text = text//"'"//rest(:blank - 1)//"'"
      rest = trim(adjustl(rest(blank:)))
    end do
    if (len(text) > 0) text = text//" or "
    text = text//"'"//rest//"'"
  end function choices_text

  !> What a value of the key must be: "a finite real number > 0 (m)", "'a' or 'b'".
  pure function expected_text(key) result(text)
    type(key_t), intent(in) :: key
    character(len=:), allocatable :: text

    select case (key%kind)
    case (kind_integer)
      text = number_text("an integer", "3 integers", key)
    case (kind_real)
      text = number_text("a finite real number", "3 finite real numbers", key)
    case (kind_logical)
      text = ".true. or .false."
    case (kind_choice)
      text = choices_text(key%allowed)
    case default
      text = "a text in quotes"
      if (key%allowed /= "") text = text//", "//trim(key%allowed)
      text = text//", at most "//to_text(text_length)//" characters"
    end select
  end function expected_text

  pure function number_text(one, several, key) result(text)
    !> the kind in words, for a single value and for three
    character(len=*), intent(in) :: one, several
    type(key_t), intent(in) :: key
    character(len=:), allocatable :: text

    text = one
    if (key%count > 1) text = "at most "//several
    if (key%allowed /= "") text = text//" "//trim(key%allowed)
    if (key%unit /= "") text = text//" ("//trim(key%unit)//")"
  end function number_text

end module gravier_config_keys
