"""Files that are written aside and take their name when they are whole: whatever happens meanwhile, an older one stays. Which files a program
may write. And the lock by which one program at a time writes a file, that of modules/io/files/output_lock.f90."""
import contextlib
import errno
import fcntl
import os
import re
import socket
import sys
from pathlib import Path

from one_line import plain

#: what files of a kind begin with, by the ending of their names
PICTURES = {".png": rb"\x89PNG", ".svg": rb"(?s).*<svg"}
MOVIES = {".gif": rb"GIF8", ".mp4": rb"(?s).{4}ftyp"}
#: errors of a place where no file can be
NOWHERE = (FileExistsError, FileNotFoundError, IsADirectoryError, NotADirectoryError, PermissionError)
#: bytes in which the beginning of a file is looked for
HEAD = 4096


class Misplaced(Exception):
    """A file that a program may not write: one line."""


def check_place(path, kinds, reads=()):
    """Raise Misplaced unless a program may write `path`: the name has the ending of what is written, it is none of the files that the program
    `reads`, and a file that is there is empty or one of those that the program makes. `kinds` says by the ending what these begin with; of
    an HDF5 file it is the name of the program, which is the attribute `made_by`."""
    path = Path(path)
    if path.suffix not in kinds:
        raise Misplaced(f"{path}: expected a name that ends in {' or '.join(kinds)}")
    try:
        wrong = path.exists() and _wrong_with(path, kinds[path.suffix], reads)
    except OSError as what:
        wrong = f"{what.strerror or what}; expected a file that can be written"
    if wrong:
        raise Misplaced(f"{path}: {wrong}")


def _wrong_with(path, kind, reads):
    """Why what is there is not replaced; None where it is."""
    if not path.is_file():
        return "there is a directory or a device; expected the name of a file"
    if any(os.path.exists(other) and os.path.samefile(path, other) for other in reads):
        return "this file is read; expected another name for what is written"
    own = _made_by(path) == kind if path.suffix in (".h5", ".hdf5") else re.match(kind, _head(path))
    if not own and path.stat().st_size > 0:
        return "there is a file of another kind or origin, which is not replaced; expected the name of no file, or of one that was made in the same way"
    return None


def _head(path):
    with open(path, "rb") as file:
        return file.read(HEAD)


def _made_by(path):
    """The program that has made an HDF5 file, as it says itself; None where it does not."""
    import h5py

    try:
        with h5py.File(path) as file:
            return file.attrs.get("made_by")
    except OSError:
        return None


def claim(path, kinds, reads=()):
    """check_place for a program, which ends with one line and status 2 where it may not write `path`."""
    try:
        check_place(path, kinds, reads)
    except Misplaced as refused:
        print(f"{_program()}: error: {plain(refused)}", file=sys.stderr)
        sys.exit(2)


def _program():
    return Path(sys.argv[0]).name.removesuffix(".py")


@contextlib.contextmanager
def whole_file(path):
    """A path beside `path`, with the same ending, to write to: what is there at the end takes the name; after an error it is removed."""
    path = Path(path)
    part = path.with_name(f"{path.stem}.part{path.suffix}")
    try:
        yield part
        give_names({path: part})
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def give_names(parts):
    """Give files that were written aside, as {path: where it is}, their names in this order, once all of them are on the disk."""
    for part in parts.values():
        with open(part, "rb") as file:
            os.fsync(file.fileno())
    for path, part in parts.items():
        os.replace(part, path)


class Locked(Exception):
    """Another program writes here; the words say which."""


@contextlib.contextmanager
def output_lock(path, program):
    """Hold the lock of a file, which need not exist: two bytes of .NAME.lock beside it, which says who holds it. Raises Locked where
    another program does. A file system without locks keeps none."""
    path = Path(path)
    lock = path.with_name(f".{path.name}.lock")
    while True:
        with open(lock, "a+", encoding="utf-8", errors="replace") as file:
            try:
                fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB, 2, 0)
            except OSError as what:
                if what.errno in (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP):
                    yield
                    return
                if what.errno not in (errno.EACCES, errno.EAGAIN):
                    raise
                file.seek(0)
                said = file.read().splitlines()
                raise Locked(f"{path}: another program writes here{': ' + said[1] if said[1:] else f', {lock} is locked'}; "
                             "expected a place that no other program writes to") from None
            # a program that has ended meanwhile has removed the file: others do not see a lock on that one
            if not lock.exists() or not os.path.samestat(os.fstat(file.fileno()), os.stat(lock)):
                continue
            file.truncate(0)
            file.write(f"{socket.gethostname()}\n{program}, process {os.getpid()}\n")
            file.flush()
            try:
                yield
            finally:
                lock.unlink(missing_ok=True)
            return


@contextlib.contextmanager
def written(path, kinds, reads=()):
    """A path to write to, as whole_file has it, in a directory that is made if need be. What `claim` or the system refuses ends the program
    with one line: status 2 where there is no such place, 4 else, as on a full disk."""
    claim(path, kinds, reads)
    try:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as part:
            yield part
    except OSError as what:
        print(f"{_program()}: error: {path}: {' '.join(str(what.strerror or what).split())}; expected a file that "
              "can be written", file=sys.stderr)
        sys.exit(2 if isinstance(what, NOWHERE) else 4)


@contextlib.contextmanager
def hdf5_file(path, program=None):
    """An HDF5 file to fill in, which is in memory and goes to `path` at the end: HDF5 itself can neither close nor forget a file whose
    headers find no room on the disk, and crashes. `program` is its attribute `made_by`, for check_place."""
    import h5py

    with h5py.File(path, "w", driver="core", backing_store=False) as file:
        if program:
            file.attrs["made_by"] = program
        yield file
        file.flush()
        image = file.id.get_file_image()
    Path(path).write_bytes(image)


def save_figure(figure, path, **options):
    """Save a figure of matplotlib, or end the program with one line that says why not."""
    with written(path, PICTURES) as part:
        figure.savefig(part, **options)
