"""The checksums of Gravier (modules/base/numerics/random_hash.f90): of each dataset that it writes whole, as an attribute of it, and of tables in
CSV whose first line has one."""
import numpy as np
from whole_file import whole_file

from .case import CaseError

#: what the first line of a sealed table begins with
SEAL = b"# checksum "
_LOW = np.uint64(0xFFFFFFFF)
_FACTORS = (np.uint64(0x6C62272E), np.uint64(0x5BD1E995))
_STEP = np.uint64(2654435769)


def _shift(words, bits):
    return words >> np.uint64(bits)


def _mix(words):
    """Bijective mixing of 64 bits."""
    words = words ^ _shift(words, 30)
    for k in range(2):
        low, high = words & _LOW, _shift(words, 32)
        high = high ^ (_shift(low * _FACTORS[k], 15) & _LOW)
        low = low ^ (_shift(high * _FACTORS[1 - k], 13) & _LOW)
        high = (high + _shift(low * _FACTORS[k], 17)) & _LOW
        low = (low + _shift(high * _FACTORS[1 - k], 16) + _STEP) & _LOW
        words = (low << np.uint64(32)) | high
    return words


def checksum(values):
    """Of an array of 64-bit numbers, or of texts of whole words, by rows: the exclusive or of a number for each row, which tells its
    place and its words."""
    values = np.ascontiguousarray(values)
    if len(values) == 0:
        return 0
    words = values.view(np.uint8).reshape(len(values), -1).view(np.uint64)
    return int(_of_rows(words, np.arange(1, len(words) + 1, dtype=np.uint64)).astype(np.int64))


def _of_rows(words, places):
    """Of words (rows, words of a row) at places (rows)."""
    rows = _mix(places)
    for column in words.T:
        rows = _mix(rows ^ column)
    return np.bitwise_xor.reduce(rows)


def is_whole(dataset, values):
    """Whether the values read from an h5py dataset have the checksum with which it was written; True where it has none."""
    return "checksum" not in dataset.attrs or int(dataset.attrs["checksum"]) == checksum(values)


def seal(path):
    """Put the checksum of a table in CSV into its first line: Gravier then refuses the file once it is damaged or changed. A table that
    is sealed already is sealed anew. What is no table, or is a table that a run writes, is refused."""
    with open(path, "rb") as file:
        text = file.read()
    wrong = "not a text" if b"\0" in text else "a table that a run writes" if text.startswith(b"step,") else None
    if wrong:
        raise CaseError(f"{path}: {wrong}; expected a table in CSV that a case names")
    lines = text.split(b"\n")
    if lines[0].startswith(SEAL):
        del lines[0]
    with whole_file(path) as part:
        part.write_bytes(b"\n".join([SEAL + b"%016x" % _of_lines(lines), *lines]))


def sealed_as(text):
    """Whether a table in CSV is what its first line has the checksum of; True where it has none."""
    first, _, rest = text.partition(b"\n")
    return not first.startswith(SEAL) or first[len(SEAL):].strip() == b"%016x" % _of_lines(rest.split(b"\n"))


def _of_lines(lines):
    """The checksum of a table in CSV without its first line that seals it."""
    digest = np.uint64(0)
    # an end of the last line makes no line more
    for k, line in enumerate(lines if lines[-1] else lines[:-1]):
        padded = line.ljust(8 * (len(line) // 8 + 1))
        words = np.append(np.frombuffer(padded, dtype=np.uint64), np.uint64(len(line)))
        digest ^= _of_rows(words[None, :], np.array([k + 3], dtype=np.uint64))
    return int(digest)
