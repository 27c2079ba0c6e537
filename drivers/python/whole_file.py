"""Files that are written aside and take their name when they are whole: whatever happens meanwhile, an older one stays."""
import contextlib
import os
import sys
from pathlib import Path


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


def save_figure(figure, path, **options):
    """Save a figure of matplotlib, or end the program with one line that says why not."""
    try:
        with whole_file(path) as part:
            figure.savefig(part, **options)
    except OSError as what:
        sys.exit(f"{Path(sys.argv[0]).name}: error: {path}: {what.strerror or what}")
