!> The outputs there are. A new output is a file in src/output and a line here.
module gravier_output_registry
  use gravier_output, only: output_t
  implicit none
  private
  public :: output_holder_t, registered_outputs

  type :: output_holder_t
    class(output_t), allocatable :: item
  end type output_holder_t

contains

  !> One output of each kind, in the order in which they are opened, written at a stage and closed.
  subroutine registered_outputs(outputs)
    type(output_holder_t), allocatable, intent(out) :: outputs(:)

    allocate (outputs(0))
    !&<
    block; use gravier_checkpoint_output, only: checkpoint_output_t; call add(checkpoint_output_t()); end block
    block; use gravier_results_output, only: results_output_t; call add(results_output_t()); end block
    block; use gravier_picture_output, only: picture_output_t; call add(picture_output_t()); end block
    block; use gravier_history_output, only: history_output_t; call add(history_output_t()); end block
    block; use gravier_trace_output, only: trace_output_t; call add(trace_output_t()); end block
    block; use gravier_problem_output, only: problem_output_t; call add(problem_output_t()); end block
    block; use gravier_final_bodies, only: final_bodies_output_t; call add(final_bodies_output_t()); end block
    !&>

  contains

    subroutine add(output)
      class(output_t), intent(in) :: output
      type(output_holder_t), allocatable :: longer(:)
      integer :: k

      allocate (longer(size(outputs) + 1))
      do k = 1, size(outputs)
        call move_alloc(outputs(k)%item, longer(k)%item)
      end do
      allocate (longer(size(longer))%item, source=output)
      call move_alloc(longer, outputs)
    end subroutine add

  end subroutine registered_outputs

end module gravier_output_registry
