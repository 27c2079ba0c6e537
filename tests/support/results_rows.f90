!> Bodies, contacts and boundaries of tests as arrays with names, and what makes tables of a results file from them.
module gravier_test_results_rows
  use gravier_kinds, only: dp, i8
  use gravier_errors, only: error_t
  use gravier_field_list, only: field_list_t
  use gravier_results_file, only: results_file_t, accuracy_t
  use gravier_run_provenance, only: provenance_t
  implicit none
  private
  public :: body_rows_t, contact_rows_t, boundary_rows_t, run_of, write_rows, write_boundaries

  !> Bodies of this rank.
  type :: body_rows_t
    !> (n), global, >= 1
    integer(i8), allocatable :: id(:)
    !> (dimension, n), (3 or 6, n), (n)
    real(dp), allocatable :: position(:, :), velocity(:, :), radius(:)
    !> (dimension, n); allocated on all ranks or on none
    integer, allocatable :: image(:, :)
  end type body_rows_t

  !> All boundaries, the same on all ranks.
  type :: boundary_rows_t
    integer(i8), allocatable :: id(:)
    !> (dimension, n); a normal that is not allocated is not written
    real(dp), allocatable :: position(:, :), normal(:, :)
    !> (3 or 6, n), (dimension, n)
    real(dp), allocatable :: velocity(:, :), force(:, :)
  end type boundary_rows_t

  !> Contacts of this rank.
  type :: contact_rows_t
    integer(i8), allocatable :: candidate(:), antagonist(:)
    !> (dimension, n), (n), (dimension, n)
    real(dp), allocatable :: normal(:, :), gap(:), impulse(:, :)
  end type contact_rows_t

contains

  !> What was run, by its input file and its dimension.
  type(provenance_t) function run_of(input_text, dimension) result(run)
    character(len=*), intent(in) :: input_text
    integer, intent(in) :: dimension

    run%version = "0.1.0"
    run%command = "gravier case.nml"
    run%input_text = input_text
    run%dimension = dimension
  end function run_of

  !> Write a step with these bodies and with what else is present.
  subroutine write_rows(results, step, time, bodies, error, contacts, boundaries, accuracy)
    type(results_file_t), intent(inout) :: results
    integer, intent(in) :: step
    real(dp), intent(in) :: time
    type(body_rows_t), intent(in) :: bodies
    type(error_t), allocatable, intent(inout) :: error
    type(contact_rows_t), intent(in), optional :: contacts
    type(boundary_rows_t), intent(in), optional :: boundaries
    type(accuracy_t), intent(in), optional :: accuracy
    type(field_list_t) :: table

    call results%begin_step(step, time, error, accuracy)
    call make_bodies(bodies, table)
    call results%write_step_table(table, error)
    if (present(contacts)) then
      call make_contacts(contacts, table)
      call results%write_step_table(table, error)
    end if
    if (present(boundaries)) then
      call make_boundaries(boundaries, table)
      call results%write_step_table(table, error)
    end if
    call results%end_step(error)
  end subroutine write_rows

  subroutine make_bodies(bodies, table)
    type(body_rows_t), intent(in) :: bodies
    type(field_list_t), intent(out) :: table
    integer(i8), allocatable :: whole(:, :)

    call table%init("bodies", "id", size(bodies%id))
    table%key(1, :) = bodies%id
    call add(table, "position", "m", bodies%position)
    call add(table, "velocity", "m/s, rad/s", bodies%velocity)
    call add_scalar(table, "radius", "m", bodies%radius)
    if (.not. allocated(bodies%image)) return
    allocate (whole(size(bodies%image, 1), size(bodies%image, 2)))
    whole(:, :) = bodies%image
    call table%add_whole("image", "", whole)
  end subroutine make_bodies

  subroutine make_contacts(contacts, table)
    type(contact_rows_t), intent(in) :: contacts
    type(field_list_t), intent(out) :: table

    call table%init("contacts", "candidate antagonist", size(contacts%candidate))
    table%key(1, :) = contacts%candidate
    table%key(2, :) = contacts%antagonist
    call add(table, "normal", "", contacts%normal)
    call add(table, "impulse", "N s", contacts%impulse)
    call add_scalar(table, "gap", "m", contacts%gap)
  end subroutine make_contacts

  subroutine make_boundaries(boundaries, table)
    type(boundary_rows_t), intent(in) :: boundaries
    type(field_list_t), intent(out) :: table

    call table%init("boundaries", "id", size(boundaries%id))
    table%key(1, :) = boundaries%id
    table%everywhere = .true.
    call add(table, "position", "m", boundaries%position)
    if (allocated(boundaries%normal)) call add(table, "normal", "", boundaries%normal)
    call add(table, "velocity", "m/s, rad/s", boundaries%velocity)
    call add(table, "force", "N", boundaries%force)
  end subroutine make_boundaries

  !> Write /boundaries.
  subroutine write_boundaries(results, id, name, shape, normal, error)
    type(results_file_t), intent(inout) :: results
    integer(i8), intent(in) :: id(:)
    character(len=*), intent(in) :: name(:), shape(:)
    real(dp), intent(in) :: normal(:, :)
    type(error_t), allocatable, intent(inout) :: error
    type(field_list_t) :: table

    call table%init("boundaries", "id", size(id))
    table%key(1, :) = id
    table%everywhere = .true.
    call table%add_texts("name", name)
    call table%add_texts("shape", shape)
    call add(table, "normal", "", normal)
    call results%write_table(table, error)
  end subroutine write_boundaries

  subroutine add(table, name, unit, values)
    type(field_list_t), intent(inout) :: table
    character(len=*), intent(in) :: name, unit
    real(dp), intent(in) :: values(:, :)
    real(dp), allocatable :: copy(:, :)

    allocate (copy, source=values)
    call table%add_reals(name, unit, copy)
  end subroutine add

  subroutine add_scalar(table, name, unit, values)
    type(field_list_t), intent(inout) :: table
    character(len=*), intent(in) :: name, unit
    real(dp), intent(in) :: values(:)
    real(dp), allocatable :: copy(:, :)

    allocate (copy(1, size(values)))
    copy(1, :) = values
    call table%add_reals(name, unit, copy, .true.)
  end subroutine add_scalar

end module gravier_test_results_rows
