!> The registry of methods: each is found by its name, takes the options of the input, and is in the sentences made from it.
program test_method_registry
  use gravier_kinds, only: dp
  use gravier_check, only: check, check_equal, finish_checks
  use gravier_method, only: method_t
  use gravier_method_options, only: method_features_t, method_options_t, held_list_t, default_always, default_on_active
  use gravier_method_registry, only: method_holder_t, registered_methods, make_method, features_of, method_words, quoted_names, &
    & all_methods, that_decompose, with_moments, that_relax, accelerated, accelerated_on_active
  implicit none

  call test_names()
  call test_options()
  call test_directions()
  call test_held()
  call finish_checks()

contains

  !> Names are different, have no blanks within, and lead back to what they were taken from.
  subroutine test_names()
    type(method_holder_t), allocatable :: methods(:)
    type(method_features_t) :: features, found
    class(method_t), allocatable :: made
    integer :: k

    call registered_methods(methods)
    do k = 1, size(methods)
      features = methods(k)%method%features()
      call check(features%name /= "" .and. index(trim(features%name), " ") == 0, "name "//features%name)
      call check(features%meaning /= "", "meaning of "//features%name)
      found = features_of(trim(features%name))
      call check_equal(trim(found%name), trim(features%name), "features by name")
      call make_method(trim(features%name), method_options_t(), made)
      call check(allocated(made), "made by name")
      if (allocated(made)) call check(same_type_as(made, methods(k)%method), "type of "//features%name)
    end do
    found = features_of("no such method")
    call check_equal(trim(found%name), "", "features of a name that is none")
    call make_method("no such method", method_options_t(), made)
    call check(.not. allocated(made), "nothing is made by a name that is none")
    call check_equal(method_words(all_methods), "nlgs schwarz schwarz_ec nscdd nscdd_ep newton", "all words")
    call check_equal(method_words(that_relax), "schwarz schwarz_ec", "words of those with a relaxation factor")
    call check_equal(quoted_names(that_decompose, "'", "or"), "'schwarz', 'schwarz_ec', 'nscdd', 'nscdd_ep' or 'newton'", &
      & "those on subdomains")
    call check_equal(quoted_names(with_moments, "'", "or"), "'nlgs', 'schwarz', 'nscdd' or 'newton'", "those with moments")
    call check_equal(quoted_names(accelerated, "`", "and"), "`nlgs` and `nscdd`", "those with momentum by default")
    call check_equal(quoted_names(accelerated_on_active, "`", "and"), "`nscdd_ep`", "one name alone")
  end subroutine test_names

  !> Sweeps and momentum reach every method; Newton's always has momentum.
  subroutine test_options()
    class(method_t), allocatable :: method
    type(method_holder_t), allocatable :: methods(:)
    type(method_features_t) :: features
    integer :: k

    call registered_methods(methods)
    do k = 1, size(methods)
      features = methods(k)%method%features()
      call make_method(trim(features%name), method_options_t(sweeps=7, acceleration=.true.), method)
      call check_equal(method%sweeps, 7, "sweeps of "//features%name)
      call check(method%acceleration%on, "momentum of "//features%name)
      call make_method(trim(features%name), method_options_t(), method)
      call check(method%acceleration%on .eqv. features%name == "newton", "no momentum of "//features%name)
    end do
    features = features_of("nlgs")
    call check_equal(features%accelerated_by_default, default_always, "momentum of nlgs by default")
    features = features_of("nscdd_ep")
    call check_equal(features%accelerated_by_default, default_on_active, "momentum of nscdd_ep by default")
  end subroutine test_options

  !> The search direction that the log names.
  subroutine test_directions()
    class(method_t), allocatable :: method

    call make_method("nlgs", method_options_t(), method)
    call check_equal(method%direction_text, "", "no direction")
    call make_method("nscdd_ep", method_options_t(active_only=.true.), method)
    call check_equal(method%direction_text, "l = 1.00E+02/W_aa (automatic), active contacts", "nscdd_ep on active contacts")
    call make_method("nscdd_ep", method_options_t(), method)
    call check_equal(method%direction_text, "l = 3.00E-01/W_aa (automatic), all contacts", "nscdd_ep on all contacts")
    call make_method("schwarz_ec", method_options_t(), method)
    call check_equal(method%direction_text, "l = 3.00E+00/W_aa (automatic), all contacts", "schwarz_ec")
    call make_method("schwarz_ec", method_options_t(direction_given=.true., direction=2.5_dp, direction_relative=.false.), method)
    call check_equal(method%direction_text, "l = 2.50E+00 kg, all contacts", "a given direction")
  end subroutine test_directions

  !> Momentum holds the impulses and velocities of one iteration, Newton's method more.
  subroutine test_held()
    class(method_t), allocatable :: method
    type(held_list_t) :: plain, momentum, newton

    call make_method("nscdd", method_options_t(), method)
    call method%held(3, 6, plain)
    call check_equal(plain%n, 0, "nothing without momentum")
    call make_method("nscdd", method_options_t(acceleration=.true.), method)
    call method%held(3, 6, momentum)
    call check_equal(bytes_of("nscdd", .true.), 8*(3 + 6), "bytes of momentum")
    call check_equal(bytes_of("schwarz_ec", .false.), 8*(3*3 + 6 + 3), "bytes of an enriched matrix and a safeguard")
    call check_equal(bytes_of("schwarz_ec", .true.), 8*(3*3 + 6 + 3 + 3 + 6), "the same with momentum")
    call check_equal(bytes_of("nscdd_ep", .false.), 8*(3*3 + 6 + 3), "bytes of NSCDD-EP on all contacts")
    call check_equal(bytes_of("nscdd_ep", .false., active_only=.true.), 8*(3*3 + 6 + 3 + 3 + 6), "bytes of NSCDD-EP with feedback")
    call make_method("newton", method_options_t(), method)
    call method%held(3, 6, newton)
    call check(newton%n > momentum%n, "Newton's method holds what momentum does and more")
  end subroutine test_held

  !> Bytes that a method says to hold for a contact of three components and a body of six.
  integer function bytes_of(name, acceleration, active_only) result(bytes)
    character(len=*), intent(in) :: name
    logical, intent(in) :: acceleration
    logical, intent(in), optional :: active_only
    class(method_t), allocatable :: method
    type(method_options_t) :: options
    type(held_list_t) :: held
    integer :: k

    options%acceleration = acceleration
    if (present(active_only)) options%active_only = active_only
    call make_method(name, options, method)
    call method%held(3, 6, held)
    bytes = 0
    do k = 1, held%n
      bytes = bytes + held%item(k)%bytes*held%item(k)%values
    end do
  end function bytes_of

end program test_method_registry
