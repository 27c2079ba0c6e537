!> Random numbers that depend on a seed and a counter only, so that any rank draws the same for the same body, and digests of words.
module gravier_random_hash
  use gravier_kinds, only: dp, i8
  implicit none
  private
  public :: hash_uniform, hash_words, hash_rows

contains

  !> A number in the open interval (0, 1) that is a function of (seed, counter, stream) alone.
  !> The mixer is a Feistel network of four half-word rounds, applied once per argument.
  pure real(dp) function hash_uniform(seed, counter, stream) result(x)
    integer, intent(in) :: seed
    !> for instance the identifier of a body
    integer(i8), intent(in) :: counter
    !> tells apart the several numbers drawn for one counter
    integer, intent(in) :: stream
    integer(i8) :: s

    s = mix(ieor(mix(int(seed, i8)), mix(counter + 1000003_i8)))
    s = mix(ieor(s, mix(int(stream, i8) + 77_i8)))
    x = (real(shiftr(s, 12), dp) + 0.5_dp)*2.0_dp**(-52)
  end function hash_uniform

  !> A number that tells sequences of words from each other: those that differ in one word never have the same.
  pure integer(i8) function hash_words(words) result(digest)
    integer(i8), intent(in) :: words(:)
    integer :: k

    digest = mix(int(size(words), i8))
    do k = 1, size(words)
      digest = mix(ieor(digest, words(k)))
    end do
  end function hash_words

  !> Checksum of rows of words: the exclusive or of a number for each row, which tells its place and its words. That of a table is
  !> the exclusive or of those of its parts, however it is cut.
  pure integer(i8) function hash_rows(rows, first) result(digest)
    !> (words of a row, rows)
    integer(i8), intent(in), contiguous :: rows(:, :)
    !> place of the first of these rows in the table, from 0
    integer(i8), intent(in) :: first
    integer(i8) :: row
    integer :: i, k

    digest = 0
    do i = 1, size(rows, 2)
      row = mix(first + i)
      do k = 1, size(rows, 1)
        row = mix(ieor(row, rows(k, i)))
      end do
      digest = ieor(digest, row)
    end do
  end function hash_rows

  !> Bijective mixing of 64 bits by shifts and multiplications of 32-bit halves, so that nothing overflows.
  pure integer(i8) function mix(word) result(z)
    integer(i8), intent(in) :: word
    integer(i8), parameter :: low_half = int(z'FFFFFFFF', i8)
    integer(i8), parameter :: factor(2) = [int(z'6C62272E', i8), int(z'5BD1E995', i8)]
    integer(i8) :: low, high
    integer :: k

    z = ieor(word, shiftr(word, 30))
    do k = 1, 2
      low = iand(z, low_half)
      high = shiftr(z, 32)
      ! one Feistel round on each half keeps the map bijective
      high = ieor(high, iand(shiftr(low*factor(k), 15), low_half))
      low = ieor(low, iand(shiftr(high*factor(3 - k), 13), low_half))
      high = iand(high + shiftr(low*factor(k), 17), low_half)
      low = iand(low + shiftr(high*factor(3 - k), 16) + 2654435769_i8, low_half)
      z = ior(shiftl(low, 32), high)
    end do
  end function mix

end module gravier_random_hash
