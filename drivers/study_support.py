"""What the studies and the scenes share: loose grains, bodies files, runs of the program, pictures of disks."""
import csv
import os
import subprocess
import sys
import time
from pathlib import Path

try:
    import h5py
    import matplotlib
    import numpy as np
except ImportError as missing:
    sys.exit(f"{Path(sys.argv[0]).name}: {missing}; expected a python3 with h5py, numpy and matplotlib")
matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.collections import EllipseCollection

SOURCE = Path(__file__).resolve().parent.parent
BINARIES = Path(os.environ.get("GRAVIER_BIN_DIR", SOURCE / "build/release/bin"))
ENVIRONMENT = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OPENBLAS_NUM_THREADS": "1"}


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
    """A bodies file of grains at rest; walls: (point, normal) of each plane."""
    with h5py.File(path, "w") as file:
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

def value_text(value):
    """A value as a namelist has it."""
    if isinstance(value, (bool, np.bool_)):
        return ".true." if value else ".false."
    if isinstance(value, str):
        return f"'{value}'"
    if isinstance(value, (list, tuple, np.ndarray)):
        return ", ".join(value_text(one) for one in value)
    return repr(value.item() if isinstance(value, np.generic) else value)


def run(directory, groups, boundaries=(), ranks=1, program=BINARIES / "gravier"):
    """Run the program in `directory` on the groups {name: {key: value}} and boundaries [{key: value}]; seconds it took."""
    directory = Path(directory)
    directory.mkdir(parents=True, exist_ok=True)
    all_groups = list(groups.items()) + [("boundary", keys) for keys in boundaries]
    (directory / "case.nml").write_text("".join(
        f"&{name}\n" + "".join(f"  {key} = {value_text(value)}\n" for key, value in keys.items()) + "/\n"
        for name, keys in all_groups))
    start = time.time()
    with open(directory / "terminal.log", "w", encoding="utf-8") as log:
        done = subprocess.run([os.environ.get("MPIEXEC", "mpiexec"), "-n", str(ranks), str(Path(program).resolve()), "case.nml"],
                              cwd=directory, env={**ENVIRONMENT, **os.environ}, stdout=log, stderr=subprocess.STDOUT,
                              stdin=subprocess.DEVNULL, check=False)
    # 3: some solve missed its tolerance, which history.csv tells
    if done.returncode not in (0, 3):
        sys.exit(f"{directory}: gravier ended with status {done.returncode}: {(directory / 'terminal.log').read_text()[-500:]}")
    seconds = time.time() - start
    print(f"{directory}: {seconds:.0f} s", flush=True)
    return seconds


def read_history(directory):
    """history.csv as {column: array}."""
    with open(Path(directory) / "history.csv", encoding="ascii") as file:
        rows = list(csv.DictReader(file))
    return {key: np.array([float(row[key]) for row in rows]) for key in rows[0]}


def states(path):
    """Steps of results.h5 in order: (number, time, group of the open file)."""
    with h5py.File(path) as file:
        for name in sorted(file["steps"], key=int):
            yield int(name), float(file[f"steps/{name}"].attrs["time"]), file[f"steps/{name}"]


def write_csv(path, columns):
    """{column: values} as a table."""
    names = list(columns)
    with open(path, "w", encoding="ascii", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(names)
        table.writerows([f"{value:.6g}" if isinstance(value, (float, np.floating)) else value for value in row]
                        for row in zip(*[columns[name] for name in names]))


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
