!> The mass matrix of a body, of a disk that turns, a sphere, and a boundary that moves along one axis: products and inverses.
program test_body_mass
  use gravier_kinds, only: dp
  use gravier_body_mass, only: can_move, inverse_of_translation, mass_column, multiply_mass, mass_product, add_inverse_mass, &
    & subtract_inverse_mass, multiply_symmetric, invert_symmetric, apply_inverse_mass, velocities_under, inverse_product, &
    & inverse_products, are_uneven
  use gravier_check, only: check, check_close, finish_checks
  implicit none

  real(dp), parameter :: rounding = 1.0e-14_dp
  !> a disk of 2 kg and 0.5 kg m^2, a sphere of 2 kg and 0.5 kg m^2, a boundary of 4 kg that moves along y
  real(dp), parameter :: disk(3) = [0.5_dp, 0.5_dp, 2.0_dp], sphere(4) = [0.5_dp, 0.5_dp, 0.5_dp, 2.0_dp]
  real(dp), parameter :: lid(3) = [0.0_dp, 0.25_dp, 0.0_dp]
  !> a stone of 2 kg with a symmetric matrix, of eigenvalues above 0, in the place of one over an inertia
  real(dp), parameter :: stone(9) = [0.5_dp, 0.5_dp, 0.5_dp, 2.0_dp, 1.5_dp, 3.0_dp, 0.25_dp, -0.5_dp, 0.125_dp]

  call test_rows()
  call test_inverse()
  call test_products()
  call test_all_bodies()
  call test_stone()
  call check(are_uneven(11.0_dp, 110.0_dp, 1.001e4_dp), "one body of 100 kg beside ten of 1 kg")
  call check(.not. are_uneven(11.0_dp, 110.0_dp, 1.1e3_dp), "eleven of 10 kg")
  call finish_checks()

contains

  subroutine test_rows()
    real(dp) :: shared(3), column(3)

    call check(can_move(sphere, 6) .and. can_move(disk, 3), "grains move and turn")
    call check(can_move(lid, 2) .and. .not. can_move(lid, 1) .and. .not. can_move(lid, 3), "a lid moves along one axis")
    call check_close(inverse_of_translation(lid, 2), 0.25_dp, rounding, "one over the mass of a lid")
    call check_close(inverse_of_translation(lid(1:1), 1), 0.0_dp, rounding, "what cannot move")
    shared(:) = 2.0_dp*disk
    call mass_column(disk, shared, 1, column)
    call check_close(norm2(column - [1.0_dp, 0.0_dp, 0.0_dp]), 0.0_dp, rounding, "half of a mass that two share")
    call mass_column(disk, shared, 3, column)
    call check_close(norm2(column - [0.0_dp, 0.0_dp, 0.25_dp]), 0.0_dp, rounding, "half of its inertia")
    call mass_column(lid, lid, 1, column)
    call check_close(norm2(column), 0.0_dp, rounding, "no mass along what is fixed")
  end subroutine test_rows

  !> M^-1 M v = v where the body can move.
  subroutine test_inverse()
    real(dp) :: v(6), p(6), w(6), u(3)

    v(:) = [1.0_dp, -2.0_dp, 3.0_dp, 0.5_dp, 4.0_dp, -1.0_dp]
    p(:) = v
    call multiply_mass(sphere, sphere, p)
    call check_close(p(2), -4.0_dp, rounding, "momentum of a sphere")
    call check_close(p(5), 2.0_dp, rounding, "angular momentum of a sphere")
    call apply_inverse_mass(sphere, p, w)
    call check_close(norm2(w - v), 0.0_dp, rounding, "the inverse of the mass matrix")
    call add_inverse_mass(sphere, p, w)
    call check_close(norm2(w - 2.0_dp*v), 0.0_dp, rounding, "an impulse is added")
    call subtract_inverse_mass(sphere, p, w)
    call check_close(norm2(w - v), 0.0_dp, rounding, "and taken away")
    u(:) = 1.0_dp
    call multiply_mass(lid, lid, u)
    call check_close(abs(u(1)) + abs(u(3)), 0.0_dp, rounding, "no momentum along what is fixed")
    call check_close(u(2), 4.0_dp, rounding, "momentum of a lid")
  end subroutine test_inverse

  !> a M b and x M^-1 y against each other, and the six products of three impulses.
  subroutine test_products()
    real(dp) :: a(6), b(6), p(6), q(6), sums(6), inverse_mass(4, 2), x(6, 2), y(6, 2), z(6, 2)
    real(dp) :: factors(2)
    integer :: copies(2), k

    a(:) = [1.0_dp, -2.0_dp, 3.0_dp, 0.5_dp, 4.0_dp, -1.0_dp]
    b(:) = [-1.0_dp, 1.5_dp, 2.0_dp, -2.0_dp, 1.0_dp, 3.0_dp]
    p(:) = a
    q(:) = b
    call multiply_mass(sphere, sphere, p)
    call multiply_mass(sphere, sphere, q)
    ! 2 (-1 - 3 + 6) + 0.5 (-1 + 4 - 3)
    call check_close(mass_product(sphere, a, b), 4.0_dp, rounding, "product of two velocities")
    call check_close(inverse_product(sphere, p, q), 4.0_dp, rounding, "product of two impulses")
    call check_close(mass_product(lid, a(1:3), b(1:3)), -12.0_dp, rounding, "product of velocities of a lid")
    ! each of two bodies, one of which has two copies
    do k = 1, 2
      inverse_mass(:, k) = sphere
      x(:, k) = p
      y(:, k) = q
      z(:, k) = a
    end do
    copies(:) = [1, 2]
    call inverse_products(inverse_mass, copies, x, y, z, sums)
    call check_close(sums(1), 1.5_dp*inverse_product(sphere, p, p), 10*rounding, "x with x")
    call check_close(sums(2), 6.0_dp, rounding, "x with y, once and half")
    call check_close(sums(3), 1.5_dp*inverse_product(sphere, q, q), 10*rounding, "y with y")
    call check_close(sums(4), 1.5_dp*dot_product(a, a), 10*rounding, "x with z")
    call check_close(sums(5), 1.5_dp*dot_product(a, b), rounding, "y with z")
    call check_close(sums(6), 1.5_dp*inverse_product(sphere, a, a), 10*rounding, "z with z")
    ! of masses with factors: 1/4 of the first body, 1/2 of the half of the second one
    factors(:) = [4.0_dp, 2.0_dp]
    call inverse_products(inverse_mass, copies, x, y, z, sums, factors)
    call check_close(sums(2), 0.5_dp*4.0_dp, rounding, "x with y, with factors of the masses")
    call check_close(sums(6), 0.5_dp*inverse_product(sphere, a, a), 10*rounding, "z with z, with factors of the masses")
  end subroutine test_products

  subroutine test_all_bodies()
    real(dp) :: inverse_mass(4, 2), p(6, 2), v_free(6, 2), v(6, 2)

    inverse_mass(:, 1) = sphere
    inverse_mass(:, 2) = 0.0_dp
    p(:, :) = 2.0_dp
    v_free(:, :) = 1.0_dp
    v(:, :) = 0.0_dp
    call velocities_under(inverse_mass, p, v_free, v)
    call check_close(v(3, 1), 2.0_dp, rounding, "velocity of a sphere under an impulse")
    call check_close(v(4, 1), 5.0_dp, rounding, "spin of a sphere under an impulse")
    call check_close(v(6, 1), 5.0_dp, rounding, "spin about the last axis")
    call check_close(norm2(v(:, 2) - v_free(:, 2)), 0.0_dp, rounding, "what moves as prescribed does so under impulses")
  end subroutine test_all_bodies

  !> The same procedures for a body with a symmetric matrix, against the matrix written out.
  subroutine test_stone()
    real(dp) :: inverse(6), product(3), v(6), p(6), w(6), column(6), sums(6), copies_of(9, 1)
    real(dp), parameter :: unit(6) = [0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 1.0_dp, 0.0_dp]
    real(dp), dimension(6, 1) :: x, y, z

    call check(can_move(stone, 4) .and. can_move(stone, 6), "a stone turns")
    p(:) = [1.0_dp, -2.0_dp, 3.0_dp, 0.5_dp, 4.0_dp, -1.0_dp]
    call multiply_symmetric(stone(4:9), p(4:6), product)
    w(4:6) = under(p, 4, 6)
    call check_close(norm2(product - w(4:6)), 0.0_dp, rounding, "a symmetric matrix and a vector")
    call invert_symmetric(stone(4:9), inverse)
    call multiply_symmetric(inverse, product, v(4:6))
    call check_close(norm2(v(4:6) - p(4:6)), 0.0_dp, 10*rounding, "its inverse")
    call apply_inverse_mass(stone, p, v)
    w(:) = under(p, 1, 6)
    call check_close(norm2(v - w), 0.0_dp, rounding, "the velocity that an impulse gives a stone")
    w(:) = v
    call multiply_mass(stone, stone, w)
    call check_close(norm2(w - p), 0.0_dp, 10*rounding, "the impulse that gives it")
    call mass_column(stone, stone, 5, column)
    w(:) = under(column, 1, 6)
    call check_close(norm2(w - unit), 0.0_dp, 10*rounding, &
      & "a column of the mass matrix of a stone")
    w(:) = 1.0_dp
    call add_inverse_mass(stone, p, w)
    call check_close(norm2(w - 1.0_dp - v), 0.0_dp, 10*rounding, "an impulse is added to a stone")
    call subtract_inverse_mass(stone, p, w)
    call check_close(norm2(w - 1.0_dp), 0.0_dp, 10*rounding, "and taken away")
    call check_close(mass_product(stone, v, v), dot_product(p, v), 100*rounding, "product of velocities of a stone")
    call check_close(inverse_product(stone, p, p), dot_product(p, v), 100*rounding, "product of impulses on a stone")
    copies_of(:, 1) = stone
    x(:, 1) = p
    y(:, 1) = [0.5_dp, 1.0_dp, -1.0_dp, 2.0_dp, -3.0_dp, 1.0_dp]
    w(:) = under(y(:, 1), 1, 6)
    call inverse_products(copies_of, [2], x, y, y, sums)
    call check_close(sums(1), 0.5_dp*dot_product(p, v), 100*rounding, "x with x of a stone that two share")
    call check_close(sums(2), 0.5_dp*dot_product(y(:, 1), v), 100*rounding, "x with y")
    call check_close(sums(3), 0.5_dp*dot_product(y(:, 1), w), 100*rounding, "y with y")
    z(:, :) = 0.0_dp
    call velocities_under(copies_of, y, z, x)
    call check_close(norm2(x(:, 1) - w), 0.0_dp, 100*rounding, "the velocities of all stones")
  end subroutine test_stone

  !> The matrix of the stone, written out, times a vector: rows `first` to `last` of it.
  pure function under(a, first, last) result(b)
    real(dp), intent(in) :: a(6)
    integer, intent(in) :: first, last
    real(dp) :: b(last - first + 1), matrix(6, 6)
    integer :: r, c

    matrix(:, :) = 0.0_dp
    do r = 1, 3
      matrix(r, r) = 0.5_dp
    end do
    matrix(4, 4:6) = [2.0_dp, 0.25_dp, -0.5_dp]
    matrix(5, 4:6) = [0.25_dp, 1.5_dp, 0.125_dp]
    matrix(6, 4:6) = [-0.5_dp, 0.125_dp, 3.0_dp]
    b(:) = 0.0_dp
    do r = first, last
      do c = 1, 6
        b(r - first + 1) = b(r - first + 1) + matrix(r, c)*a(c)
      end do
    end do
  end function under

end program test_body_mass
