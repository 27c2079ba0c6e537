!> Bodies in packed arrays: records that keep every bit, what is renewed and what is written, reordering, dropping, appending.
program test_body_store
  use mpi_f08, only: MPI_Init, MPI_Finalize
  use gravier_kinds, only: dp, i8
  use gravier_random_hash, only: hash_uniform
  use gravier_body_store, only: body_layout_t, body_set_t, append_bodies, collect_fields, place_word, body_record
  use gravier_field_list, only: field_list_t
  use gravier_check, only: check, check_equal, finish_checks
  implicit none
  !> space dimensions, degrees of freedom with and without spin, entries of an image with and without periods
  integer, parameter :: kinds(3, 6) = reshape([2, 2, 0, 2, 3, 0, 3, 3, 0, 3, 6, 0, 2, 3, 2, 3, 6, 3], [3, 6])
  integer :: k

  call MPI_Init()
  call test_refit()
  do k = 1, size(kinds, 2)
    call test_records(kinds(:, k))
    call test_reorder(kinds(:, k))
    call test_keep_only(kinds(:, k))
    call test_append(kinds(:, k))
    call test_renewed(kinds(:, k))
    call test_written(kinds(:, k))
    call test_described(kinds(:, k))
    call test_invalid(kinds(:, k))
    call test_forces(kinds(:, k))
    call test_rest(kinds(:, k))
  end do
  call finish_checks()
  call MPI_Finalize()

contains

  !> `n` grains, of which every number follows from the identifier first + place - 1.
  subroutine fill(bodies, sizes, n, first)
    type(body_set_t), intent(inout) :: bodies
    integer, intent(in) :: sizes(3), n, first
    integer :: b, d

    call bodies%init(body_layout_t(sizes(1), sizes(2), sizes(3)), n)
    do b = 1, n
      bodies%id(b) = first + b - 1
      bodies%radius(b) = number(bodies%id(b), 1)
      bodies%mass(b) = number(bodies%id(b), 2)
      if (bodies%nv > bodies%nd) bodies%inertia(b) = number(bodies%id(b), 3)
      bodies%glued(b) = image_of(bodies%id(b), 1)
      bodies%material(b) = 3 + image_of(bodies%id(b), 1)
      do d = 1, sizes(1)
        bodies%position(d, b) = number(bodies%id(b), 3 + d)
      end do
      do d = 1, sizes(2)
        bodies%velocity(d, b) = number(bodies%id(b), 6 + d)
      end do
      do d = 1, sizes(3)
        bodies%image(d, b) = image_of(bodies%id(b), 1 + d)
      end do
    end do
  end subroutine fill

  pure real(dp) function number(id, stream)
    integer(i8), intent(in) :: id
    integer, intent(in) :: stream
    number = scale(hash_uniform(1, id, stream) - 0.5_dp, int(id)/3)
  end function number

  !> A whole number of either sign.
  pure integer function image_of(id, stream)
    integer(i8), intent(in) :: id
    integer, intent(in) :: stream
    image_of = int(2.0e9_dp*(hash_uniform(2, id, stream) - 0.5_dp))
  end function image_of

  pure logical function same(a, b)
    real(dp), intent(in) :: a, b
    same = transfer(a, 0_i8) == transfer(b, 0_i8)
  end function same

  !> Whether grain `b` is the one that `fill` makes for `id`, in all its numbers.
  logical function is_grain(bodies, b, id)
    type(body_set_t), intent(in) :: bodies
    integer, intent(in) :: b, id
    integer :: d

    is_grain = bodies%id(b) == id .and. same(bodies%radius(b), number(int(id, i8), 1)) .and. &
      & same(bodies%mass(b), number(int(id, i8), 2))
    if (bodies%nv > bodies%nd) is_grain = is_grain .and. same(bodies%inertia(b), number(int(id, i8), 3))
    do d = 1, bodies%nd
      is_grain = is_grain .and. same(bodies%position(d, b), number(int(id, i8), 3 + d))
    end do
    do d = 1, bodies%nv
      is_grain = is_grain .and. same(bodies%velocity(d, b), number(int(id, i8), 6 + d))
    end do
    is_grain = is_grain .and. bodies%glued(b) == image_of(int(id, i8), 1)
    is_grain = is_grain .and. bodies%material(b) == 3 + image_of(int(id, i8), 1)
    do d = 1, bodies%ni
      is_grain = is_grain .and. bodies%image(d, b) == image_of(int(id, i8), 1 + d)
    end do
  end function is_grain

  !> Whether the set holds just the grains of `id`, in this order, in arrays of its size.
  subroutine check_grains(bodies, sizes, id, name)
    type(body_set_t), intent(in) :: bodies
    integer, intent(in) :: sizes(3), id(:)
    character(len=*), intent(in) :: name
    integer :: b
    logical :: right

    right = bodies%n == size(id) .and. bodies%nd == sizes(1) .and. bodies%nv == sizes(2) .and. bodies%ni == sizes(3)
    right = right .and. size(bodies%id) == size(id) .and. size(bodies%radius) == size(id) .and. size(bodies%mass) == size(id)
    right = right .and. size(bodies%inertia) == merge(size(id), 0, sizes(2) > sizes(1)) .and. size(bodies%position, 2) == size(id)
    right = right .and. size(bodies%velocity, 2) == size(id) .and. size(bodies%position, 1) == sizes(1)
    right = right .and. size(bodies%velocity, 1) == sizes(2) .and. size(bodies%glued) == size(id)
    right = right .and. size(bodies%image, 1) == sizes(3) .and. size(bodies%image, 2) == size(id)
    call check(right, name//": sizes")
    if (.not. right) return
    do b = 1, size(id)
      right = right .and. is_grain(bodies, b, id(b))
    end do
    call check(right, name//": grains")
  end subroutine check_grains

  !> From a set to records and back, in the reverse order; numbers at the ends of their ranges too.
  subroutine test_records(sizes)
    !> space dimension, degrees of freedom, entries of an image
    integer, intent(in) :: sizes(3)
    type(body_set_t) :: bodies, back
    integer(i8), allocatable :: records(:, :)
    integer, parameter :: reverse(*) = [7, 6, 5, 4, 3, 2, 1]
    integer :: b

    call fill(bodies, sizes, 7, 1)
    call check_equal(bodies%record_words(), 5 + sum(sizes) + merge(1, 0, sizes(2) > sizes(1)), "words of a record")
    allocate (records(bodies%record_words(), 7))
    do b = 1, 7
      call bodies%get_record(b, records(:, b))
    end do
    call back%init(body_layout_t(sizes(1), sizes(2), sizes(3)), 7)
    do b = 1, 7
      call back%set_record(8 - b, records(:, b))
    end do
    call check_grains(back, sizes, reverse, "records")
    bodies%id(1) = huge(1_i8)
    bodies%radius(1) = transfer(1_i8, 0.0_dp)
    bodies%mass(1) = huge(1.0_dp)
    bodies%velocity(sizes(2), 1) = -0.0_dp
    bodies%position(sizes(1), 1) = -tiny(1.0_dp)
    bodies%glued(1) = huge(1)
    bodies%image(:, 1) = -huge(1)
    call bodies%get_record(1, records(:, 1))
    call back%set_record(2, records(:, 1))
    call check(back%id(2) == huge(1_i8) .and. same(back%radius(2), transfer(1_i8, 0.0_dp)) .and. &
      & same(back%mass(2), huge(1.0_dp)) .and. same(back%velocity(sizes(2), 2), -0.0_dp) .and. &
      & same(back%position(sizes(1), 2), -tiny(1.0_dp)) .and. back%glued(2) == huge(1) .and. &
      & all(back%image(:, 2) == -huge(1)), "records keep every bit")
    call check(same(transfer(records(place_word, 1), 0.0_dp), bodies%position(1, 1)), "where a record holds the place")
    call check(is_grain(back, 1, 7) .and. is_grain(back, 3, 5), "other grains stay")
  end subroutine test_records

  subroutine test_reorder(sizes)
    !> space dimension, degrees of freedom, entries of an image
    integer, intent(in) :: sizes(3)
    type(body_set_t) :: bodies
    integer, parameter :: order(*) = [5, 1, 4, 2, 3], some(*) = [4, 2], nobody(0) = 0

    call fill(bodies, sizes, 5, 1)
    call bodies%reorder(order)
    call check_grains(bodies, sizes, order, "a permutation")
    call fill(bodies, sizes, 5, 1)
    call bodies%reorder(some)
    call check_grains(bodies, sizes, some, "some left out")
    call bodies%reorder(nobody)
    call check_grains(bodies, sizes, nobody, "all left out")
  end subroutine test_reorder

  subroutine test_keep_only(sizes)
    !> space dimension, degrees of freedom, entries of an image
    integer, intent(in) :: sizes(3)
    type(body_set_t) :: bodies
    logical, parameter :: mask(*) = [.false., .true., .true., .false., .true.]
    integer, parameter :: kept(*) = [12, 13, 15], nobody(0) = 0
    logical :: all_of_them(3)

    call fill(bodies, sizes, 5, 11)
    call bodies%keep_only(mask)
    call check_grains(bodies, sizes, kept, "masked grains go, the others keep their order")
    all_of_them(:) = .true.
    call bodies%keep_only(all_of_them)
    call check_grains(bodies, sizes, kept, "all stay")
    all_of_them(:) = .false.
    call bodies%keep_only(all_of_them)
    call check_grains(bodies, sizes, nobody, "all go")
  end subroutine test_keep_only

  subroutine test_append(sizes)
    !> space dimension, degrees of freedom, entries of an image
    integer, intent(in) :: sizes(3)
    type(body_set_t) :: bodies, more, none, fresh
    integer, parameter :: both(*) = [1, 2, 3, 21, 22], behind(*) = [21, 22], front(*) = [1, 2, 3]

    call fill(bodies, sizes, 3, 1)
    call fill(more, sizes, 2, 21)
    call fill(none, sizes, 0, 1)
    call append_bodies(bodies, none)
    call check_grains(bodies, sizes, front, "nobody more")
    call append_bodies(bodies, more)
    call check_grains(bodies, sizes, both, "behind those that were there")
    call check_grains(more, sizes, behind, "what was added stays")
    call append_bodies(none, more)
    call check_grains(none, sizes, behind, "to an empty set")
    call append_bodies(fresh, more)
    call check_grains(fresh, sizes, behind, "to a set not made yet")
  end subroutine test_append

  !> Copies get place and velocity, in messages or from a set beside them, and nothing else.
  subroutine test_renewed(sizes)
    !> space dimension, degrees of freedom, entries of an image
    integer, intent(in) :: sizes(3)
    type(body_set_t) :: bodies, copies, beside
    integer(i8), allocatable :: record(:)

    call fill(bodies, sizes, 3, 1)
    call fill(copies, sizes, 3, 31)
    call fill(beside, sizes, 3, 31)
    call check_equal(bodies%renewed_words(), sizes(1) + sizes(2), "words that are renewed")
    allocate (record(bodies%renewed_words()))
    call bodies%get_renewed(2, record)
    call copies%set_renewed(3, record)
    call beside%renew(3, bodies, 2)
    call check(all(abs(copies%position(:, 3) - bodies%position(:, 2)) <= 0.0_dp) .and. &
      & all(abs(copies%velocity(:, 3) - bodies%velocity(:, 2)) <= 0.0_dp), "place and velocity by message")
    call check(all(abs(beside%position(:, 3) - bodies%position(:, 2)) <= 0.0_dp) .and. &
      & all(abs(beside%velocity(:, 3) - bodies%velocity(:, 2)) <= 0.0_dp), "place and velocity of a neighbour set")
    call check(is_grain(copies, 1, 31) .and. is_grain(copies, 2, 32) .and. is_grain(beside, 1, 31), "other copies stay")
    copies%position(:, 3) = bodies%position(:, 3)
    copies%velocity(:, 3) = bodies%velocity(:, 3)
    call check(copies%id(3) == 33 .and. same(copies%radius(3), number(33_i8, 1)) .and. &
      & same(copies%mass(3), number(33_i8, 2)) .and. copies%material(3) == 3 + image_of(33_i8, 1), &
      & "identifier, radius, mass and material are not renewed")
  end subroutine test_renewed

  !> What files get of the bodies of two sets: place, velocity with spin, radius, mass, material and, in a periodic scene, image.
  subroutine test_written(sizes)
    !> space dimension, degrees of freedom, entries of an image
    integer, intent(in) :: sizes(3)
    type(body_set_t) :: sets(2), none(0)
    type(field_list_t) :: table
    integer :: nd, nv

    nd = sizes(1)
    nv = sizes(2)
    call fill(sets(1), sizes, 4, 1)
    call fill(sets(2), sizes, 3, 11)
    call table%init("bodies", "id", 7)
    call collect_fields(sets(1)%body_layout_t, sets, table)
    call check_equal(table%n_fields, merge(6, 5, sizes(3) > 0), "fields that are written")
    associate (masses => table%field(table%place("mass")), places => table%field(table%place("position")))
      call check(masses%unit == "kg" .and. masses%scalar .and. .not. places%scalar, "one number, or one a direction")
      call check(same(masses%value(1, 3), number(3_i8, 2)) .and. same(masses%value(1, 5), number(11_i8, 2)), "masses")
      call check(same(places%value(nd, 7), number(13_i8, 3 + nd)), "places")
    end associate
    associate (velocities => table%field(table%place("velocity"))%value, materials => table%field(table%place("material")))
      call check_equal(size(velocities, 1), 3*nd - 3, "a velocity has a spin in files")
      call check(same(velocities(nv, 6), number(12_i8, 6 + nv)), "velocities")
      call check(all(abs(velocities(nv + 1:, :)) <= 0.0_dp), "bodies that do not turn have no spin")
      call check(materials%whole(1, 7) == 3 + image_of(13_i8, 1), "materials")
    end associate
    call table%init("bodies", "id", 0)
    call collect_fields(sets(1)%body_layout_t, none, table)
    call check_equal(table%n_fields, merge(6, 5, sizes(3) > 0), "fields without a body")
    if (sizes(3) == 0) return
    call table%init("bodies", "id", 7)
    call collect_fields(sets(1)%body_layout_t, sets, table)
    associate (images => table%field(table%place("image"))%whole)
      call check(images(sizes(3), 5) == image_of(11_i8, 1 + sizes(3)), "images")
    end associate
  end subroutine test_written

  !> Bodies that may sleep: what is known of their rest travels, and is the last that a checkpoint has; the others have none of it.
  subroutine test_rest(sizes)
    !> space dimension, degrees of freedom, entries of an image
    integer, intent(in) :: sizes(3)
    type(body_layout_t) :: layout
    type(body_set_t) :: bodies, others
    integer(i8), allocatable :: record(:), renewed(:)
    integer :: first

    layout = body_layout_t(sizes(1), sizes(2), sizes(3))
    call others%init(layout, 2)
    call check(.not. others%sleeps(1), "where none may sleep none does")
    call check_equal(size(others%rest) + size(others%wakes_at) + size(others%held) + size(others%wandered) + &
      & size(others%stirred), 0, &
      & "and nothing is kept for it")
    layout%nr = 1
    call bodies%init(layout, 2)
    call check(bodies%rest(2) == 0 .and. .not. bodies%sleeps(2), "a new body is awake")
    call check(bodies%awake%have_all(2) .and. size(bodies%steady) == 2 .and. .not. any(bodies%steady), &
      & "steps go through all of new bodies, and ask each")
    call check(others%awake%have_all(2) .and. size(others%steady) == 0, "steps go through all where none may sleep")
    bodies%id(:) = [3_i8, 5_i8]
    bodies%radius(:) = 1.0_dp
    bodies%mass(:) = 1.0_dp
    bodies%glued(:) = 0
    bodies%position(:, :) = 0.0_dp
    bodies%velocity(:, :) = 0.0_dp
    bodies%inertia(:) = 1.0_dp
    bodies%image(:, :) = 0
    bodies%rest(2) = 7
    call check(.not. bodies%sleeps(2), "a body that has rested for some steps is awake")
    bodies%wakes_at(2) = 0.25_dp
    bodies%held(:, 2) = 0.5_dp
    bodies%stirred(2) = 1
    bodies%wandered(:, 2) = 0.25_dp
    allocate (record(bodies%record_words()), renewed(bodies%renewed_words()))
    call bodies%get_record(2, record)
    first = others%saved_words() + 1
    call check_equal(record(first), 7_i8, "steps at rest come first of what is known of its rest")
    call others%init(layout, 2)
    call others%set_record(1, record)
    call check(others%sleeps(1) .and. others%rest(1) == 7, "a body that travels sleeps on")
    call check(size(others%held, 1) == sizes(2) .and. all(abs(others%held(:, 1) - 0.5_dp) < 1.0e-15_dp), &
      & "and bears what it has borne")
    call check_equal(others%stirred(1), 1, "it is known that this has changed")
    call check(size(others%wandered, 1) == sizes(2) .and. all(abs(others%wandered(:, 1) - 0.25_dp) < 1.0e-15_dp), &
      & "and how it has moved at rest")
    call bodies%get_renewed(2, renewed)
    call others%set_renewed(2, renewed)
    call check(others%sleeps(2), "its copies know of it")
    call others%awake%leave_out(others%wakes_at)
    others%steady(:) = .true.
    call check_equal(others%awake%n, 0, "steps pass over bodies that sleep")
    call others%wake(2)
    call check(others%awake%have_all(2), "and go through all from where one wakes")
    call check(others%steady(1) .and. .not. others%steady(2), "which is asked again when it sleeps")
    call check(.not. others%sleeps(2) .and. others%rest(2) == 0, "a body that wakes counts from the start")
    call others%wake(1)
    call check(.not. any(abs(others%held) > 0.0_dp), "and bears nothing of contacts that are left out")
    call check_equal(others%stirred(1), 0, "and its impulses have not changed")
    call check(.not. any(abs(others%wandered) > 0.0_dp), "nor has it moved at rest")
    record(first) = -1
    call check(layout%invalid_field(record, 0, 0, 0) == "rest", "no body has rested for less than no step")
  end subroutine test_rest

  !> Words of a body that did not turn, fitted to one that turns and may sleep, and back again.
  subroutine test_refit()
    type(body_layout_t) :: kept, layout
    type(body_set_t) :: bodies, others
    integer(i8), allocatable :: words(:), record(:), again(:)

    kept = body_layout_t(2, 2, 2)
    layout = body_layout_t(2, 3, 2)
    layout%nr = 1
    call bodies%init(kept, 1)
    bodies%id(1) = 7
    bodies%radius(1) = 0.5_dp
    bodies%mass(1) = 2.0_dp
    bodies%glued(1) = 0
    bodies%position(:, 1) = [1.0_dp, 2.0_dp]
    bodies%velocity(:, 1) = [3.0_dp, 4.0_dp]
    bodies%image(:, 1) = [-5, 6]
    allocate (words(kept%saved_words()), record(layout%saved_words()), again(kept%saved_words()))
    call bodies%get_record(1, words)
    call layout%refit(kept, words, record)
    call others%init(layout, 1)
    call others%set_record(1, record)
    call check(all(abs(others%velocity(:, 1) - [3.0_dp, 4.0_dp, 0.0_dp]) <= 0.0_dp), "it begins without a spin")
    call check(all(others%image(:, 1) == [-5, 6]) .and. others%rest(1) == 0 .and. .not. others%sleeps(1), &
      & "what lies behind keeps its words, and it is awake")
    call check(all(abs(others%position(:, 1) - [1.0_dp, 2.0_dp]) <= 0.0_dp) .and. abs(others%inertia(1)) <= 0.0_dp, &
      & "it is where it was, and has no inertia yet")
    call kept%refit(layout, record, again)
    call check(all(again == words), "the other way round")
  end subroutine test_refit

  !> Names and bytes of the fields add up to the record that travels.
  subroutine test_described(sizes)
    !> space dimension, degrees of freedom, entries of an image
    integer, intent(in) :: sizes(3)
    type(body_set_t) :: bodies
    character(len=:), allocatable :: name, names
    integer :: f, bytes, entries, words

    call bodies%init(body_layout_t(sizes(1), sizes(2), sizes(3)), 2)
    call check(all(bodies%material == 1), "the material of a new body")
    names = ""
    words = 0
    f = 0
    do
      f = f + 1
      call bodies%describe_field(f, name, bytes, entries)
      if (len(name) == 0) exit
      call check_equal(bytes, merge(4, 8, name == "glued" .or. name == "material" .or. name == "image" .or. name == "shape" .or. &
        & name == "rest" .or. name == "stirred"), &
        & "bytes of "//name)
      names = names//name//" "
      words = words + entries
    end do
    call check(trim(names) == body_record//" force", "names of the fields, of which checkpoints have all but the last")
    call check_equal(words, bodies%record_words(), "entries of the fields")
    call check(bytes == 0 .and. entries == 0, "nothing behind the last field")
  end subroutine test_described

  !> Each field that a file may hold wrongly is named.
  subroutine test_invalid(sizes)
    !> space dimension, degrees of freedom, entries of an image
    integer, intent(in) :: sizes(3)
    type(body_set_t) :: bodies
    !> infinity: comparisons with NaN trap where builds look for them
    real(dp) :: infinite

    infinite = transfer(9218868437227405312_i8, 0.0_dp)
    call bodies%init(body_layout_t(sizes(1), sizes(2), sizes(3)), 1)
    bodies%id = 7
    bodies%radius = 0.5_dp
    bodies%mass = 2.0_dp
    bodies%glued = 2
    bodies%position = -1.0_dp
    bodies%velocity = 3.0_dp
    bodies%image = -4
    bodies%inertia = 0.25_dp
    call expect_invalid(bodies, "", "a sound body")
    bodies%id = 0
    call expect_invalid(bodies, "id", "no identifier")
    bodies%id = 7
    bodies%radius = 0.0_dp
    call expect_invalid(bodies, "radius", "no radius")
    bodies%radius = infinite
    call expect_invalid(bodies, "radius", "a radius without bounds")
    bodies%radius = 0.5_dp
    bodies%mass = -2.0_dp
    call expect_invalid(bodies, "mass", "a mass below 0")
    bodies%mass = 2.0_dp
    bodies%glued = 4
    call expect_invalid(bodies, "glued", "a boundary that is not there")
    bodies%glued = -1
    call expect_invalid(bodies, "glued", "a boundary below 0")
    bodies%glued = 0
    bodies%material = 3
    call expect_invalid(bodies, "material", "a material that is not there")
    bodies%material = 2
    bodies%position(sizes(1), 1) = infinite
    call expect_invalid(bodies, "position", "a place without bounds")
    bodies%position = 0.0_dp
    bodies%velocity(1, 1) = 1.0e31_dp
    call expect_invalid(bodies, "velocity", "a velocity beyond bounds")
    bodies%velocity = 0.0_dp
    call expect_invalid(bodies, "", "a sound body again")
  end subroutine test_invalid

  !> Applied forces, 0 at first, travel and stay with their bodies, and are in no checkpoint.
  subroutine test_forces(sizes)
    !> space dimension, degrees of freedom, entries of an image
    integer, intent(in) :: sizes(3)
    type(body_set_t) :: bodies, back, copies
    integer, parameter :: order(*) = [3, 1]
    integer(i8), allocatable :: record(:), renewed(:)
    integer :: b, words

    call fill(bodies, sizes, 3, 1)
    words = bodies%record_words()
    call check(words == bodies%saved_words() .and. size(bodies%force) == 0, "no forces unless asked for")
    call bodies%take_forces()
    call check(size(bodies%force, 1) == sizes(1) .and. size(bodies%force, 2) == 3 .and. &
      & all(abs(bodies%force) <= 0.0_dp), "forces of 0")
    call check_equal(bodies%record_words(), words + sizes(1), "a record has forces")
    call check_equal(bodies%saved_words(), words, "a checkpoint has none")
    do b = 1, 3
      bodies%force(:, b) = real(b, dp)
    end do
    allocate (record(bodies%record_words()), renewed(bodies%renewed_words()))
    call back%init(bodies, 3)
    call copies%init(bodies, 3)
    do b = 1, 3
      call bodies%get_record(b, record)
      call back%set_record(b, record)
      call bodies%get_renewed(b, renewed)
      call copies%set_renewed(b, renewed)
    end do
    call check(all(abs(back%force - bodies%force) <= 0.0_dp), "forces travel")
    call check(all(abs(copies%force - bodies%force) <= 0.0_dp), "copies get them in every step")
    copies%force(:, :) = 0.0_dp
    call copies%renew(2, bodies, 3)
    call check(all(abs(copies%force(:, 2) - 3.0_dp) <= 0.0_dp), "copies in the same process, too")
    call back%reorder(order)
    call check(all(abs(back%force(:, 1) - 3.0_dp) <= 0.0_dp) .and. all(abs(back%force(:, 2) - 1.0_dp) <= 0.0_dp), &
      & "forces stay with bodies")
    call append_bodies(back, bodies)
    call check(back%n == 5 .and. all(abs(back%force(:, 4) - 2.0_dp) <= 0.0_dp), "forces of bodies that are appended")
  end subroutine test_forces

  !> The field of the first body that is named as invalid, among 3 boundaries and 2 materials.
  subroutine expect_invalid(bodies, field, name)
    type(body_set_t), intent(in) :: bodies
    character(len=*), intent(in) :: field, name
    integer(i8) :: record(bodies%record_words())

    call bodies%get_record(1, record)
    call check(bodies%invalid_field(record, n_boundaries=3, n_materials=2, n_shapes=4) == field, name)
  end subroutine expect_invalid

end program test_body_store
