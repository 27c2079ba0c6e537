#!/usr/bin/python3
"""How far a second compiler gets: it reads the sources in the order in which they use each other, without making code.

    /usr/bin/python3 tests/support/second_compiler.py [--compiler flang-new-19]

Debian's modules mpi_f08 and hdf5 are gfortran's. Stubs take their place: the names that the sources use, procedures without interfaces.
flang 19 takes a named constant of a derived type in a pure procedure for a variable that is saved; its message names that line. Where a
file has it, the constant's name is replaced by what it stands for, and the file is read once more.

Each layer prints one line, then each file that is refused, with the first message. Exit status 1 where a file is refused.
"""
import argparse
import collections
import os
import re
import subprocess
import sys
import tempfile

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
FOLDERS = ("modules", "src", "drivers")
#: the defect of flang 19, and what it is about
DEFECT = "may not be a local variable in a pure subprogram"
CONSTANT = re.compile(r"^ *type\(contact_rows_t\), parameter :: row = (\w+)\n", re.MULTILINE)
TYPES = {"MPI_COMM": "MPI_Comm", "MPI_INFO_NULL": "MPI_Info", "MPI_STATUS": "MPI_Status"}
DATA_TYPES = ("MPI_INTEGER", "MPI_INTEGER8", "MPI_DOUBLE_PRECISION", "MPI_CHARACTER", "MPI_LOGICAL")
OPERATIONS = ("MPI_SUM", "MPI_MIN", "MPI_MAX", "MPI_LOR", "MPI_LAND")
BUILD_INFO = "module gravier_build_info\n implicit none\n character(len=*), parameter :: {}\nend module\n"


def code(path):
    with open(path, encoding="utf-8") as file:
        return file.read()


def imported(texts, module):
    """Names that sources take from a module, each as first written."""
    names = {}
    for text in texts:
        for list_of in re.findall(rf"(?m)^ *use {module}, only: ((?:.*&\n)*.*)", text):
            for name in re.findall(r"\w+", list_of):
                names.setdefault(name.lower(), name)
    return sorted(names.values())


def mpi_stub(names):
    lines = ["module mpi_f08", " implicit none"]
    lines += [f" type :: {name}\n  integer :: mpi_val = 0, MPI_SOURCE = 0, MPI_TAG = 0\n end type"
              for name in ("MPI_Comm", "MPI_Request", "MPI_Status", "MPI_Info", "MPI_Datatype", "MPI_Op")]
    for name in names:
        if name in DATA_TYPES or name in OPERATIONS:
            lines.append(f" type({'MPI_Datatype' if name in DATA_TYPES else 'MPI_Op'}) :: {name}")
        elif name in ("MPI_COMM_WORLD", "MPI_COMM_SELF", "MPI_INFO_NULL", "MPI_STATUS_IGNORE"):
            lines.append(f" type({next(kind for start, kind in TYPES.items() if name.startswith(start))}) :: {name}")
        elif name == "MPI_STATUSES_IGNORE":
            lines.append(f" type(MPI_Status) :: {name}(1)")
        elif name.isupper():
            lines.append(f" integer, parameter :: {name} = 256")
        elif name not in ("MPI_Comm", "MPI_Request", "MPI_Status", "MPI_Info", "MPI_Datatype", "MPI_Op"):
            lines.append(f" procedure({'double_value' if name == 'MPI_Wtime' else ''}) :: {name}")
    return "\n".join(lines + [" abstract interface\n  double precision function double_value()\n  end function\n end interface",
                              "end module", ""])


def hdf5_stub(names):
    lines = ["module hdf5", " implicit none", " integer, parameter :: hid_t = 8, size_t = 8, hsize_t = 8"]
    for name in names:
        if name in ("hid_t", "size_t", "hsize_t"):
            continue
        if name.isupper():
            lines.append(f" integer{', parameter' if name.endswith('_KIND') else '(hid_t)'} :: {name} = 1")
        else:
            lines.append(f" procedure({'identifier' if name == 'h5kind_to_type' else ''}) :: {name}")
    return "\n".join(lines + [" abstract interface\n  integer(8) function identifier(kind, flag)\n   integer, intent(in) :: kind, flag",
                              "  end function\n end interface", "end module", ""])


class Sources:
    """The sources of the tree, templates expanded, and what the compiler says of each."""

    def __init__(self, compiler, place):
        self.compiler, self.place, self.said = compiler, place, {}
        listed = subprocess.run(["git", "-C", ROOT, "ls-files", *FOLDERS], capture_output=True, text=True, check=True).stdout.split()
        self.paths = {}
        for name in listed:
            if name.endswith((".f90", ".F90")):
                self.paths[name] = os.path.join(ROOT, name)
            elif name.endswith(".fypp"):
                self.paths[name] = os.path.join(place, "expanded", name[:-5] + ".f90")
                os.makedirs(os.path.dirname(self.paths[name]), exist_ok=True)
                subprocess.run(["fypp", "-I", os.path.join(ROOT, "modules"), os.path.join(ROOT, name), self.paths[name]], check=True)
        self.texts = {name: code(path) for name, path in self.paths.items()}
        self.module_of = {found.lower(): name for name, text in self.texts.items() for found in re.findall(r"(?im)^ *module +(\w+) *$", text)}
        self.uses = {name: {found.lower() for found in re.findall(r"(?im)^ *use(?:, *(?:non_)?intrinsic *::)? +(\w+)", text)}
                     for name, text in self.texts.items()}

    def write_stubs(self):
        texts = self.texts.values()
        info = ", ".join(f'{name} = "x"' for name in imported(texts, "gravier_build_info"))
        for name, text in (("mpi_f08", mpi_stub(imported(texts, "mpi_f08"))), ("hdf5", hdf5_stub(imported(texts, "hdf5"))),
                           ("gravier_build_info", BUILD_INFO.format(info))):
            path = os.path.join(self.place, name + ".f90")
            with open(path, "w", encoding="ascii") as file:
                file.write(text)
            refused = self.read(path)
            if refused:
                sys.exit(f"the stub {path} is refused:\n{refused}")

    def read(self, path):
        """Messages of the compiler, empty where it takes the file."""
        command = [self.compiler, "-fsyntax-only", "-I", self.place, "-I", "/usr/include", "-module-dir", self.place, path]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        return "" if done.returncode == 0 else done.stderr

    def visit(self, name):
        """Read a source after those that it uses."""
        if name in self.said:
            return
        self.said[name] = "waits for itself"
        for module in sorted(self.uses[name]):
            other = self.module_of.get(module, name)
            if other == name:
                continue
            self.visit(other)
            if self.said[other]:
                self.said[name] = f"uses {other}"
                return
        refused = self.read(self.paths[name])
        if DEFECT in refused:
            refused = self.read(self.without_constants(name))
        self.said[name] = refused

    def without_constants(self, name):
        """A copy in which the local name of a constant is what it stands for, procedure by procedure."""
        parts = CONSTANT.split(self.texts[name])
        text = parts[0]
        for constant, part in zip(parts[1::2], parts[2::2]):
            text += re.sub(r"\brow%", constant + "%", part)
        path = os.path.join(self.place, "copy_" + os.path.basename(self.paths[name]))
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)
        return path


def layer_of(name):
    return "/".join(name.split("/")[:2]) if name.startswith("modules") else name.split("/", maxsplit=1)[0]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n", maxsplit=1)[0])
    parser.add_argument("--compiler", default="flang-new-19")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="gravier-compiler-") as place:
        sources = Sources(options.compiler, place)
        sources.write_stubs()
        for name in sources.paths:
            sources.visit(name)
    counts = collections.defaultdict(lambda: [0, 0])
    for name, said in sources.said.items():
        counts[layer_of(name)][0] += not said
        counts[layer_of(name)][1] += 1
    for layer, (taken, number) in counts.items():
        print(f"{layer}: {taken} of {number} files")
    refused = {name: said for name, said in sources.said.items() if said and not said.startswith("uses ")}
    for name, said in refused.items():
        print(f"{name}: {next((line for line in said.splitlines() if 'error:' in line and 'Semantic errors' not in line), said[:200])}")
    sys.exit(1 if refused else 0)


if __name__ == "__main__":
    main()
