"""What the studies and the scenes share: loose grains, bodies files, runs of the program, pictures of disks."""
import os
import platform
import shutil
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "python"))
try:
    import h5py
    import matplotlib
    import numpy as np

    import gravier
    from gravier import histories
    from gravier.case import ENVIRONMENT
    from gravier.tables import write_table as write_csv
except ImportError as missing:
    sys.exit(f"{Path(sys.argv[0]).name}: {missing}; expected a python3 with h5py, numpy and matplotlib")
matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.collections import EllipseCollection
from one_line import OneLineParser, positive, run_tool, whole  # noqa: F401
from whole_file import hdf5_file, whole_file

SOURCE = Path(__file__).resolve().parents[2]
BINARIES = Path(os.environ.get("GRAVIER_BIN_DIR", SOURCE / "build/release/bin"))


# ---- grains

def radii_by_volume(n, smallest, largest, dimension, rng):
    """n radii [m], as much volume of grains in each interval of radius as in any other one of its width."""
    # density r^-d: r^(1-d) is uniform
    power = 1.0 - dimension
    return (smallest**power + rng.random(n) * (largest**power - smallest**power))**(1.0 / power)


def loose(radii, lower, upper, rng, period=None, tries=20000):
    """Centres (n, d) [m] of grains that do not touch each other, at random in the box from lower to upper, or in a box that
    is periodic along the axes where `period` is true. The largest come first."""
    radii, lower, upper = np.asarray(radii), np.asarray(lower, float), np.asarray(upper, float)
    d, edge = len(lower), 2.0 * radii.max()
    wraps = np.zeros(d, bool) if period is None else np.asarray(period, bool)
    count = np.maximum(((upper - lower) / edge).astype(int), 1)
    offsets = np.stack(np.meshgrid(*[[-1, 0, 1]] * d, indexing="ij"), -1).reshape(-1, d)
    cells, centres = {}, np.empty((len(radii), d))
    for k in np.argsort(-radii, kind="stable"):
        margin = np.where(wraps, 0.0, radii[k])
        for _ in range(tries):
            x = lower + margin + rng.random(d) * (upper - lower - 2.0 * margin)
            home = np.minimum(((x - lower) / (upper - lower) * count).astype(int), count - 1)
            near = [j for o in offsets for j in cells.get(tuple(np.where(wraps, (home + o) % count, home + o)), ())]
            if near:
                gap = centres[near] - x
                gap -= np.where(wraps, np.round(gap / (upper - lower)), 0.0) * (upper - lower)
                if np.any((gap**2).sum(1) < (radii[near] + radii[k])**2):
                    continue
            centres[k] = x
            cells.setdefault(tuple(home), []).append(k)
            break
        else:
            sys.exit(f"no place for grain {k} of radius {radii[k]:.3g} m")
    return centres


def lattice(lower, upper, smallest, largest, rng, inside=None):
    """Centres (n, d) and radii (n), uniform from smallest to largest: a grain somewhere in each cell of edge 2.05 times the
    largest radius, where `inside(centres, largest)` is true."""
    lower, upper = np.asarray(lower, float), np.asarray(upper, float)
    edge = 2.05 * largest
    count = ((upper - lower) / edge + 1e-9).astype(int)
    axes = [lower[d] + (np.arange(count[d]) + 0.5) * edge for d in range(len(lower))]
    centres = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, len(lower))
    centres = centres[np.lexsort(centres.T)]
    if inside is not None:
        centres = centres[inside(centres, largest)]
    radii = smallest + (largest - smallest) * rng.random(len(centres))
    return centres + (rng.random(centres.shape) - 0.5) * (edge - 2.0 * radii)[:, None], radii


def write_hdf5(path, centres, radii, group=None, walls=()):
    """A bodies file of grains at rest; walls: (point, normal) of each plane. The directory is made if there is none."""
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as part, hdf5_file(part) as file:
        file["bodies/id"] = np.arange(1, len(radii) + 1)
        file["bodies/position"] = np.asarray(centres, float)
        file["bodies/radius"] = np.asarray(radii, float)
        if group is not None:
            file["bodies/group"] = np.asarray(group)
        if walls:
            file["walls/id"] = len(radii) + 1 + np.arange(len(walls))
            file["walls/point"] = np.array([point for point, _ in walls], float)
            file["walls/normal"] = np.array([normal for _, normal in walls], float)


def read_bodies(path):
    """Centres, radii and velocities of a bodies file."""
    with h5py.File(path) as file:
        return file["bodies/position"][:], file["bodies/radius"][:], file["bodies/velocity"][:]


# ---- runs

#: the file that says of a directory that a study has made it
MARK = ".made_by_a_study"


def refuse_foreign(directory):
    """A directory with anything that no study has made ends the study with status 2."""
    made = directory.is_dir() and (not any(directory.iterdir()) or (directory / MARK).exists() or any(directory.glob(f"*/{MARK}")))
    if directory.exists() and not made:
        print(f"{Path(sys.argv[0]).stem}: {directory}: there is something that no study has made, which is not replaced; expected another --out",
              file=sys.stderr)
        sys.exit(2)


def claimed(directory):
    """The directory in which a study leaves its tables and runs, made if there is none. What an older study has left there stays until it is
    replaced; a directory with anything else ends the study with status 2."""
    directory = Path(directory)
    refuse_foreign(directory)
    directory.mkdir(parents=True, exist_ok=True)
    (directory / MARK).touch()
    return directory


def emptied(directory):
    """An empty directory for a run of a study. What an older study has left there goes; a directory with anything else ends the study with
    status 2."""
    directory = Path(directory)
    refuse_foreign(directory)
    shutil.rmtree(directory, ignore_errors=True)
    directory.mkdir(parents=True)
    (directory / MARK).touch()
    return directory


def run_study(main):
    """Run a study and exit with its status. A file that cannot be read or written is told in one line, with status 2."""
    def told():
        try:
            return main()
        except OSError as error:
            said = f"{error.filename}: {error.strerror}" if error.filename else " ".join(str(error).split())
            print(f"{Path(sys.argv[0]).stem}: {said}", file=sys.stderr)
            return 2
    run_tool(told)


def run(directory, groups, boundaries=(), ranks=1, program=BINARIES / "gravier"):
    """Run the program in `directory` on the groups {name: {key: value}} and boundaries [{key: value}]; seconds it took."""
    start = time.time()
    try:
        # a solve that missed its tolerance is told by history.csv
        gravier.run({**groups, "boundary": list(boundaries)}, directory, ranks, Path(program).resolve())
    except gravier.CaseError as reason:
        sys.exit(str(reason))
    seconds = time.time() - start
    print(f"{directory}: {seconds:.0f} s", flush=True)
    return seconds


def read_history(directory):
    """history.csv as {column: array}."""
    return histories.read_history(Path(directory))


def error_of(values, parts=8):
    """Standard error of a mean, by parts of the time."""
    means = [part.mean() for part in np.array_split(values, parts)]
    return np.std(means, ddof=1) / np.sqrt(parts)


def states(path):
    """Steps of results.h5 in order: (number, time, group of the open file)."""
    with h5py.File(path) as file:
        for name in sorted(file["steps"], key=int):
            yield int(name), float(file[f"steps/{name}"].attrs["time"]), file[f"steps/{name}"]


def write_measured(path, columns):
    """The same with the machine and the version of the program in each row."""
    said = subprocess.run([str((BINARIES / "gravier").resolve()), "--version"], env={**ENVIRONMENT, **os.environ}, stdin=subprocess.DEVNULL,
                          stdout=subprocess.PIPE, text=True, check=False).stdout
    machine = platform.machine()
    if os.path.exists("/proc/cpuinfo"):
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            machine = next((line.split(":", 1)[1].strip() for line in file if line.startswith("model name")), machine)
    rows = len(next(iter(columns.values()), ()))
    write_csv(path, {**columns, "machine": [machine] * rows, "version": [" ".join(said.split())] * rows})


# ---- options

def sized(options, full, quick):
    """Options that were not given take their values of the full form, or of the quick one with --quick."""
    for name, value in (quick if options.quick else full).items():
        if getattr(options, name) is None:
            setattr(options, name, value)
    return options


# ---- pictures

def draw_disks(axes, centres, radii, values=None, cmap="viridis", limits=None):
    """Disks coloured by `values`."""
    diameter = 2.0 * np.asarray(radii)
    disks = EllipseCollection(diameter, diameter, np.zeros_like(diameter), units="xy", offsets=centres,
                              offset_transform=axes.transData, linewidths=0.15, edgecolors="0.3")
    if values is None:
        disks.set_facecolor("#9ecae1")
    else:
        disks.set_array(values)
        disks.set_cmap(cmap)
        if limits is not None:
            disks.set_clim(*limits)
    axes.add_collection(disks)
    axes.set_aspect("equal")
    axes.autoscale_view()
    return disks
