!> gravier CASE.nml: dense granular matter by nonsmooth contact dynamics, with domain decomposition.
program gravier
  use gravier_program, only: run_program
  implicit none

  call run_program()
end program gravier
