"""libgravier, as gravier.h describes it, by ctypes."""
import atexit
import ctypes
import functools
import os
import shutil
from pathlib import Path

from .case import find_program

NAME = "libgravier.so"
#: functions that all ranks call, whose errors all of them have
COLLECTIVE = ("open", "step", "stop", "checkpoint")


class SimulationError(Exception):
    """One line: what was found and what was expected. `status` is the exit status that the program would have: 2 for bad input or a wrong
    call, 4 for anything else. `of_all_ranks`: every rank has raised it, in a call that all of them make."""

    def __init__(self, message, status=2, of_all_ranks=False):
        super().__init__(message)
        self.status, self.of_all_ranks = status, of_all_ranks


def find_library():
    """Path of the library: $GRAVIER_LIBRARY, or beside the program in lib, lib64 or a folder of lib."""
    if "GRAVIER_LIBRARY" in os.environ:
        return os.environ["GRAVIER_LIBRARY"]
    program = shutil.which(find_program())
    for pattern in ("lib", "lib64", "lib/*-linux-*") if program else ():
        for folder in sorted(Path(program).resolve().parent.parent.glob(pattern)):
            if (folder / NAME).is_file():
                return str(folder / NAME)
    # where the system keeps libraries
    return NAME


#: functions and what they take; all but those in RESULTS return a status
ARGUMENTS = {
    "open": "ssiI*", "step": "h", "stop": "hs", "checkpoint": "h", "close": "h", "finalize": "", "abort": "", "error": "",
    "whole": "hs*", "real": "hs*", "array": "hsi***", "check_array": "hsi**", "set_array": "hsi**", "set_gravity": "h*i", "set_friction": "hd",
    "get_cell": "hs*", "set_cell": "hsd",
    "boundary": "hs*", "boundary_name": "hi", "get_boundary": "his**", "set_boundary": "his*i",
    "add_bodies": "hi*****", "remove_bodies": "hi*", "sum": "hi*", "highest": "hi*",
}
RESULTS = {"finalize": None, "abort": None, "error": ctypes.c_char_p, "boundary_name": ctypes.c_char_p, "sum": None, "highest": None}
TYPES = {"s": ctypes.c_char_p, "i": ctypes.c_int, "I": ctypes.POINTER(ctypes.c_int), "d": ctypes.c_double, "h": ctypes.c_void_p,
         "*": ctypes.c_void_p}


@functools.lru_cache(maxsize=None)
def load():
    """The library, loaded once. MPI that it starts ends with the process."""
    path = find_library()
    try:
        library = ctypes.CDLL(path)
    except OSError as reason:
        raise SimulationError(f"{path}: cannot load the library of Gravier: {' '.join(str(reason).split())}; expected {NAME} beside the "
                              "program, or its path in GRAVIER_LIBRARY", 4) from None
    for name, types in ARGUMENTS.items():
        function = getattr(library, "gravier_" + name, None)
        if function is None:
            raise SimulationError(f"{path}: no function gravier_{name}: a library of another version; expected that of this package, built anew or "
                                  "named by GRAVIER_LIBRARY", 4)
        function.argtypes = [TYPES[letter] for letter in types]
        function.restype = RESULTS.get(name, ctypes.c_int)
    atexit.register(library.gravier_finalize)
    return library


def call(name, *arguments):
    """Call a function; an error of it is raised."""
    library = load()
    status = getattr(library, "gravier_" + name)(*arguments)
    if status:
        raise SimulationError(library.gravier_error().decode(errors="replace"), status, name in COLLECTIVE)
