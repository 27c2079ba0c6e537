"""The sieve curve of bodies: how much of their mass passes a sieve, by the size of its holes."""
import numpy as np

from .bodies_table import BodiesTable
from .heaps import radii_of
from .results import BodiesFile
from .tables import ResultsError, Table

#: sieves of a curve unless told
SIEVES = 40
#: a size differs from a hole by rounding
ROUNDING = 1e-12


def sizes_and_masses(run, step=None):
    """Sizes [m] and masses of the free bodies of a state, from the smallest size on. The size of a disk or sphere is its diameter, that of a body with a shape the diameter of the disk or
    sphere of its volume. Masses are volumes where the file has none."""
    bodies = run.bodies() if isinstance(run, BodiesTable) else run.bodies(step)
    if isinstance(run, BodiesFile) and "shape" in bodies and np.any(bodies.shape != 0):
        raise ResultsError(f"{run.path}: bodies with shapes, whose volumes this file does not have; expected the directory of a run, whose results have them")
    diameter = 2.0 * (bodies.radius if isinstance(run, BodiesTable) else radii_of(run, bodies))
    # what is glued to a boundary: by its identifier in results, by its group in bodies files
    free = next((bodies[name] == 0 for name in ("boundary", "group") if name in bodies), np.ones(len(bodies), dtype=bool))
    if not free.any():
        raise ResultsError(f"{run.path}: no free body; expected one at least")
    mass = (bodies.mass if "mass" in bodies else diameter**run.dimension)[free]
    order = np.argsort(diameter[free], kind="stable")
    return diameter[free][order], mass[order]


def sieve(run, step=None, sieves=None):
    """The sieve curve of the free bodies of a state, the last one unless told: a row for each of `sieves`, sizes of holes [m], with size, passing, the percentage of the mass that passes, and
    grains, the number that passes. Unless told they go in equal ratios from the smallest body to the largest one. `run` is a Run, a BodiesFile or a BodiesTable."""
    size, mass = sizes_and_masses(run, step)
    if sieves is None:
        sieves = np.geomspace(size[0], size[-1], SIEVES) if size[-1] > size[0] * (1.0 + ROUNDING) else size[-1:]
    sieves = np.sort(np.atleast_1d(np.asarray(sieves, float)))
    if not (np.isfinite(sieves).all() and np.all(sieves > 0.0)):
        raise ResultsError("sieves: expected sizes above 0")
    grains = np.searchsorted(size, sieves * (1.0 + ROUNDING), side="right")
    below = np.append(0.0, np.cumsum(mass))
    # all of the mass is 100 to the last bit
    return Table(size=sieves, passing=100.0 * (below[grains] / below[-1]), grains=grains)


def sieve_sizes(run, step=None):
    """Sizes [m] D10, D30, D50, D60 of the sieve curve, the least that 10, 30, 50, 60 % of the mass pass; C_u = D60/D10, the coefficient of uniformity, and C_c = D30^2/(D10 D60), that of curvature: a
    table of one row."""
    size, mass = sizes_and_masses(run, step)
    share = np.cumsum(mass)
    share /= share[-1]
    found = {f"D{part}": size[np.searchsorted(share, 0.01 * part * (1.0 - ROUNDING))] for part in (10, 30, 50, 60)}
    return Table({**{name: np.array([value]) for name, value in found.items()}, "C_u": np.array([found["D60"] / found["D10"]]),
                  "C_c": np.array([found["D30"]**2 / (found["D10"] * found["D60"])])})
