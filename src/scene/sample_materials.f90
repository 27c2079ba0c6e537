!> Materials and velocities of the grains of a sample. What a grain draws depends on its identifier and the seed alone.
module gravier_sample_materials
  use gravier_kinds, only: dp
  use gravier_random_hash, only: hash_uniform
  use gravier_communicator, only: communicator_t
  use gravier_bodies_data, only: bodies_data_t
  use gravier_shares, only: accumulate, kind_at
  use gravier_config_types, only: config_t
  use gravier_config_names, only: count_names, get_name
  use gravier_config_laws, only: material_number
  implicit none
  private
  public :: draw_materials, draw_velocities

  !> streams of random numbers; those of shapes and turns are between them
  integer, parameter :: stream_of_materials = -8
  integer, parameter :: stream_of_velocities = -16

contains

  !> Deal the grains out to the materials of `grain_materials`; without it all are of the first.
  subroutine draw_materials(config, data)
    type(config_t), intent(in) :: config
    !> identifiers are known
    type(bodies_data_t), intent(inout) :: data
    character(len=:), allocatable :: name
    integer, allocatable :: number(:)
    real(dp), allocatable :: share(:)
    integer :: k, n

    n = count_names(config%sample%grain_materials)
    if (n == 0) return
    allocate (number(n), share(n))
    do k = 1, n
      call get_name(trim(config%sample%grain_materials), k, name)
      number(k) = material_number(config, name)
    end do
    share(:) = 1.0_dp
    if (any(config%sample%material_shares > 0.0_dp)) share(:) = config%sample%material_shares(:n)
    call accumulate(share)
    do k = 1, data%n
      data%material(k) = number(kind_at(share, hash_uniform(config%sample%seed, data%id(k), stream_of_materials)))
    end do
  end subroutine draw_materials

  !> Velocities within `velocity_spread` of `velocity`, moved together so that the sample as a whole has `velocity`: what is left
  !> of a mean velocity would outlast the motion of grains that lose energy to each other. Collective.
  subroutine draw_velocities(comm, config, data)
    type(communicator_t), intent(in) :: comm
    type(config_t), intent(in) :: config
    !> identifiers and masses are known
    type(bodies_data_t), intent(inout) :: data
    real(dp), allocatable :: momentum(:)
    real(dp) :: mean
    integer :: d, k

    do d = 1, data%dimension
      associate (velocity => config%sample%velocity(d), spread => config%sample%velocity_spread(d))
        if (spread > 0.0_dp) then
          do k = 1, data%n
            data%velocity(d, k) = spread*(2.0_dp*hash_uniform(config%sample%seed, data%id(k), stream_of_velocities + d) - 1.0_dp)
          end do
          momentum = data%mass*data%velocity(d, :)
          mean = comm%sum_real(momentum)/comm%sum_real(data%mass)
          data%velocity(d, :) = data%velocity(d, :) - mean
        end if
        data%velocity(d, :) = data%velocity(d, :) + velocity
      end associate
    end do
  end subroutine draw_velocities

end module gravier_sample_materials
