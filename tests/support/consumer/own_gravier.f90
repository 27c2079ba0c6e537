!> The program gravier with a shape, a law, a method and a diagnostic of one's own, a line each.
program own_gravier
  use gravier_program, only: run_program
  use gravier_surface_registry, only: register_surface
  use gravier_law_registry, only: register_law
  use gravier_method_registry, only: register_method
  use gravier_diagnostic_registry, only: register_diagnostic
  use capsule, only: capsule_t
  use saturated, only: saturated_t
  use two_sweeps, only: two_sweeps_t
  use fastest, only: fastest_t
  implicit none

  call register_surface(capsule_t())
  call register_law(saturated_t())
  call register_method(two_sweeps_t())
  call register_diagnostic(fastest_t())
  call run_program()
end program own_gravier
