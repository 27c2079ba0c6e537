!> Shapes of a library by name, and what tells two libraries from each other.
module gravier_shape_names
  use gravier_kinds, only: i8
  use gravier_text, only: lower
  use gravier_random_hash, only: hash_words
  use gravier_convex_piece, only: convex_piece_t
  use gravier_shape_library, only: body_shape_t, shape_library_t
  implicit none
  private
  public :: find_shape, shape_names, is_reserved_name, library_digest

  !> names that files of bodies have for what is not in a library
  character(len=*), parameter :: reserved(4) = [character(len=6) :: "grain", "disk", "sphere", "plane"]

contains

  !> Number of the shape with that name, 0 where there is none.
  pure integer function find_shape(library, name) result(number)
    type(shape_library_t), intent(in) :: library
    character(len=*), intent(in) :: name

    do number = 1, library%n
      if (len(library%shape(number)%name) == len(name) .and. library%shape(number)%name == name) return
    end do
    number = 0
  end function find_shape

  !> All names in the order of their numbers, with `between` between two.
  pure function shape_names(library, between) result(text)
    type(shape_library_t), intent(in) :: library
    character(len=*), intent(in) :: between
    character(len=:), allocatable :: text
    integer :: k

    text = ""
    do k = 1, library%n
      if (k > 1) text = text//between
      text = text//library%shape(k)%name
    end do
  end function shape_names

  !> Whether a name stands for something that is not in a library, in capitals or not.
  pure logical function is_reserved_name(name)
    character(len=*), intent(in) :: name
    is_reserved_name = any(reserved == lower(name)) .and. len(name) > 0
  end function is_reserved_name

  !> A number that differs between libraries with other names, pieces or sizes.
  pure integer(i8) function library_digest(library) result(digest)
    type(shape_library_t), intent(in) :: library
    integer(i8) :: words(library%n)
    integer :: k

    do k = 1, library%n
      words(k) = shape_digest(library%shape(k))
    end do
    digest = hash_words(words)
  end function library_digest

  pure integer(i8) function shape_digest(shape) result(digest)
    type(body_shape_t), intent(in) :: shape
    integer(i8) :: words(size(shape%piece) + 2), letters(len(shape%name)), figures(5)
    integer :: k

    do k = 1, len(shape%name)
      letters(k) = iachar(shape%name(k:k))
    end do
    figures(1) = transfer(shape%size, 0_i8)
    figures(2) = transfer(shape%volume, 0_i8)
    do k = 1, 3
      figures(k + 2) = transfer(shape%inertia(k), 0_i8)
    end do
    words(1) = hash_words(letters)
    words(2) = hash_words(figures)
    do k = 1, size(shape%piece)
      words(k + 2) = piece_digest(shape%piece(k))
    end do
    digest = hash_words(words)
  end function shape_digest

  pure integer(i8) function piece_digest(piece) result(digest)
    type(convex_piece_t), intent(in) :: piece
    integer(i8) :: words(2*size(piece%vertex) + 1)
    integer :: v, d, n

    words(1) = transfer(piece%rounding, 0_i8)
    n = 1
    do v = 1, size(piece%vertex, 2)
      do d = 1, size(piece%vertex, 1)
        words(n + 1) = transfer(piece%vertex(d, v), 0_i8)
        words(n + 2) = transfer(piece%corner(d, v), 0_i8)
        n = n + 2
      end do
    end do
    digest = hash_words(words)
  end function piece_digest

end module gravier_shape_names
