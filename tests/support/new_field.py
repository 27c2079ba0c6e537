#!/usr/bin/python3
"""A field of a body is one line: add one to a copy of the tree, build the program, and look for the field in what it writes.

    python3 tests/support/new_field.py [DIRECTORY]

The copy has a temperature of 293 K in the table of body_store.fypp and no other change. Its program, built without optimisation in two
minutes, makes a run with pictures and a checkpoint and goes on from that on two ranks. The field must then be in every state of
results.h5 with its unit, in bodies.vtkhdf, and in the records of the checkpoint. The exit status is 0 only where it is. DIRECTORY is
made and kept; without one, the copy goes.
"""
import os
import shutil
import subprocess
import sys
import tempfile

import h5py

ROOT = os.path.abspath(os.path.join(os.path.dirname(__file__), "..", ".."))
STORE = "modules/bodies/store/body_store.fypp"
#: the line, and the one of the table that it stands before
LINE = '  & ("temperature", "real", "one", "bounded", ["renewed", "written", "from 293.0"], "K", "temperature"), &\n'
BEFORE = '  & ("inertia", '
CASE = """&scene dimension = 2, bodies = 'lattice', lattice_count = 6, 5, radius_min = 0.01, radius_max = 0.012, density = 1000.0, seed = 1 /
&time step = 1e-3, steps = {steps} /
&solver method = 'nscdd' /
&decomposition subdomains = 2 /
&output directory = 'out', every = 5, vtk = .true., checkpoint_every = 5 /
"""


def run(*command, directory):
    """Run a command; its words are shown where it fails."""
    done = subprocess.run(command, cwd=directory, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"status {done.returncode}: {' '.join(command)}\n{done.stdout[-2000:]}{done.stderr[-2000:]}")


def make(directory):
    """The copy of the tree with the line, built."""
    for name in subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split("\n"):
        if name and os.path.isfile(os.path.join(ROOT, name)):
            os.makedirs(os.path.dirname(os.path.join(directory, name)), exist_ok=True)
            shutil.copy(os.path.join(ROOT, name), os.path.join(directory, name))
    path = os.path.join(directory, STORE)
    with open(path, encoding="utf-8") as file:
        text = file.read()
    if text.count(BEFORE) != 1:
        sys.exit(f"{STORE}: the line that begins with {BEFORE.strip()!r} is not there once")
    with open(path, "w", encoding="utf-8") as file:
        file.write(text.replace(BEFORE, LINE + BEFORE))
    run("cmake", "-S", ".", "-B", "build", "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release", "-DCMAKE_Fortran_FLAGS_RELEASE=-O0",
        "-DGRAVIER_TESTS=OFF", directory=directory)
    run("cmake", "--build", "build", "--target", "gravier", directory=directory)


def look(directory):
    """Run, go on, and look for the field."""
    program = os.path.join(directory, "build/bin/gravier")
    mpiexec = [os.environ.get("MPIEXEC", "mpiexec"), "-n", "2"]
    for steps, restart in ((10, []), (20, ["--restart"])):
        with open(os.path.join(directory, "case.nml"), "w", encoding="utf-8") as case:
            case.write(CASE.format(steps=steps))
        run(*mpiexec, program, *restart, "case.nml", directory=directory)
    with h5py.File(os.path.join(directory, "out/results.h5")) as results:
        for step, state in results["steps"].items():
            field = state["bodies/temperature"]
            if len(field) != 30 or any(abs(field[:] - 293.0) > 0.0) or field.attrs["unit"] != b"K":
                sys.exit(f"results.h5: the temperature of step {step} is not 293 K")
        print(f"results.h5: {len(results['steps'])} states with a temperature of 293 K")
    with h5py.File(os.path.join(directory, "out/bodies.vtkhdf")) as picture:
        if "temperature" not in picture["VTKHDF/PointData"]:
            sys.exit("bodies.vtkhdf: no temperature")
    print("bodies.vtkhdf: temperature is there")
    print("a field of a body: 1 file, 1 line; a restart on 2 ranks kept it")


def main():
    """See above."""
    os.environ.setdefault("OMPI_ALLOW_RUN_AS_ROOT", "1")
    os.environ.setdefault("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
    os.environ.setdefault("OMPI_MCA_rmaps_base_oversubscribe", "1")
    if len(sys.argv) > 1:
        os.makedirs(sys.argv[1])
        make(os.path.abspath(sys.argv[1]))
        look(os.path.abspath(sys.argv[1]))
        return
    with tempfile.TemporaryDirectory(prefix="gravier-field-") as directory:
        make(directory)
        look(directory)


if __name__ == "__main__":
    main()
