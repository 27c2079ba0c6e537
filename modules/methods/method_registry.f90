!> The methods there are. A new method is a file in a room of modules/methods and a line here.
module gravier_method_registry
  use gravier_scheme, only: scheme_t
  use gravier_method_options, only: method_features_t, method_options_t, default_always, default_on_active
  implicit none
  private
  public :: method_holder_t, registered_methods, make_method, features_of, method_words, quoted_names
  public :: all_methods, that_decompose, with_moments, with_sleeping, that_relax, with_momentum, with_momentum_on_active

  !> what `quoted_names` and `method_words` choose by
  integer, parameter :: all_methods = 0, that_decompose = 1, with_moments = 2, with_sleeping = 3, that_relax = 4
  integer, parameter :: with_momentum = 5, with_momentum_on_active = 6

  type :: method_holder_t
    class(scheme_t), allocatable :: method
  end type method_holder_t

contains

  !> One method of each kind. The first is the default.
  subroutine registered_methods(methods)
    type(method_holder_t), allocatable, intent(out) :: methods(:)

    allocate (methods(0))
    !&<
    block; use gravier_nlgs, only: nlgs_t; call add(nlgs_t()); end block
    block; use gravier_schwarz, only: schwarz_t; call add(schwarz_t()); end block
    block; use gravier_schwarz_ec, only: schwarz_ec_t; call add(schwarz_ec_t()); end block
    block; use gravier_nscdd, only: nscdd_t; call add(nscdd_t()); end block
    block; use gravier_nscdd_ep, only: nscdd_ep_t; call add(nscdd_ep_t()); end block
    block; use gravier_newton, only: newton_t; call add(newton_t()); end block
    !&>

  contains

    subroutine add(method)
      class(scheme_t), intent(in) :: method
      type(method_holder_t), allocatable :: longer(:)
      integer :: k

      allocate (longer(size(methods) + 1))
      do k = 1, size(methods)
        call move_alloc(methods(k)%method, longer(k)%method)
      end do
      allocate (longer(size(longer))%method, source=method)
      call move_alloc(longer, methods)
    end subroutine add

  end subroutine registered_methods

  !> The method of that name, as the options ask for it; not allocated where there is none.
  subroutine make_method(name, options, method)
    character(len=*), intent(in) :: name
    type(method_options_t), intent(in) :: options
    class(scheme_t), allocatable, intent(out) :: method
    type(method_holder_t), allocatable :: methods(:)
    type(method_features_t) :: features
    integer :: k

    call registered_methods(methods)
    do k = 1, size(methods)
      features = methods(k)%method%features()
      if (features%name /= name) cycle
      call move_alloc(methods(k)%method, method)
      call method%set(options)
      return
    end do
  end subroutine make_method

  !> What the method of that name serves; without a name where there is none.
  type(method_features_t) function features_of(name) result(features)
    character(len=*), intent(in) :: name
    type(method_holder_t), allocatable :: methods(:)
    integer :: k

    call registered_methods(methods)
    do k = 1, size(methods)
      features = methods(k)%method%features()
      if (features%name == name) return
    end do
    features = method_features_t()
  end function features_of

  !> The names of methods, with blanks between.
  function method_words(which) result(words)
    !> one of the constants above
    integer, intent(in) :: which
    character(len=:), allocatable :: words
    words = listed(which, "", " ", " ")
  end function method_words

  !> The names of methods as a sentence has them: 'a', 'b' and 'c', in the given quotes.
  function quoted_names(which, mark, last) result(text)
    !> one of the constants above
    integer, intent(in) :: which
    !> the quote; what stands before the last name
    character(len=*), intent(in) :: mark, last
    character(len=:), allocatable :: text
    text = listed(which, mark, ", ", " "//last//" ")
  end function quoted_names

  !> The names of methods, each in marks, and what stands between two of them and between the last two.
  function listed(which, mark, between, before_last) result(text)
    integer, intent(in) :: which
    character(len=*), intent(in) :: mark, between, before_last
    character(len=:), allocatable :: text
    type(method_holder_t), allocatable :: methods(:)
    type(method_features_t) :: features
    character(len=:), allocatable :: last
    integer :: k

    call registered_methods(methods)
    text = ""
    last = ""
    do k = 1, size(methods)
      features = methods(k)%method%features()
      if (.not. belongs(features, which)) cycle
      if (text /= "" .and. last /= "") text = text//between
      text = text//last
      last = mark//trim(features%name)//mark
    end do
    if (text /= "") text = text//before_last
    text = text//last
  end function listed

  pure logical function belongs(features, which)
    type(method_features_t), intent(in) :: features
    integer, intent(in) :: which

    select case (which)
    case (that_decompose)
      belongs = features%decomposes
    case (with_moments)
      belongs = features%moments
    case (with_sleeping)
      belongs = features%sleeping
    case (that_relax)
      belongs = features%relaxes
    case (with_momentum)
      belongs = features%momentum_by_default == default_always
    case (with_momentum_on_active)
      belongs = features%momentum_by_default == default_on_active
    case default
      belongs = .true.
    end select
  end function belongs

end module gravier_method_registry
