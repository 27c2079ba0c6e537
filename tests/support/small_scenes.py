"""Scenes of a few grains for comparison with formulas: grains given in Python, a run, and all that it wrote as arrays.

What is compared is noted too: with the environment variable GRAVIER_VALIDATION_TABLE set to the path of a CSV file, each
comparison adds a row (case, quantity, accepted, measured, error, tolerance) to it."""
import functools
import os

import numpy as np

from gravier_runs import RunTestCase, merged, run_case, write

G = 9.81
EPS = np.finfo(float).eps
# moment of inertia of a disk or a sphere in units of m R^2
INERTIA = {2: 1 / 2, 3: 2 / 5}


class Grain:
    """A grain: place and velocity along the axes, spins (one in 2D), the group that glues it to others, its material."""

    def __init__(self, place, velocity=None, spin=None, radius=0.05, mass=0.7, group=0, material=1):
        dimension = len(place)
        self.place = [float(x) for x in place]
        self.velocity = [0.0] * dimension if velocity is None else [float(v) for v in velocity]
        self.spin = [0.0] * (2 * dimension - 3) if spin is None else [float(w) for w in np.atleast_1d(spin)]
        self.radius, self.mass, self.group, self.material = float(radius), float(mass), group, material


def bodies_csv(grains):
    """Text of a bodies file; identifiers from 1 on."""
    dimension = len(grains[0].place)
    axes = "xyz"[:dimension]
    spins = ["omega"] if dimension == 2 else ["wx", "wy", "wz"]
    rows = [",".join(["id", "radius", "mass", "group", "material", *axes, *("v" + axis for axis in axes), *spins])]
    for number, grain in enumerate(grains, 1):
        cells = [grain.radius, grain.mass, grain.group, grain.material, *grain.place, *grain.velocity, *grain.spin]
        rows.append(",".join([str(number), *(repr(cell) for cell in cells)]))
    return "\n".join(rows) + "\n"


class Record:
    """All written states of a run. Arrays (states, grains, components) with NaN for grains that have left. Contacts and
    boundaries are read when they are asked for."""

    def __init__(self, run, grains, dimension):
        self.run, self.dimension = run, dimension
        self.results = results = run.results()
        numbers = results.steps()
        self.step = np.array(numbers)
        self.time = np.array([results[f"/steps/{number}@time"].item() for number in numbers])
        self.present = results.of_steps("bodies/id")
        shape = (len(numbers), len(grains))
        self.position = np.full(shape + (dimension,), np.nan)
        self.all_velocities = np.full(shape + (3 * dimension - 3,), np.nan)
        self.image = np.zeros(shape + (dimension,), dtype=int)
        for array, name in ((self.position, "position"), (self.all_velocities, "velocity"), (self.image, "image")):
            for one, ids, values in zip(array, self.present, results.of_steps(f"bodies/{name}", name != "image")):
                if values is not None:
                    one[ids - 1] = values
        self.velocity = self.all_velocities[:, :, :dimension]
        self.spin = self.all_velocities[:, :, dimension:]

    def read(self, group, *names):
        """Of each state {name: array} of a group, all or the ones named; None where the run wrote no such group."""
        places = [f"/steps/{number}/{group}" for number in self.step]
        return [{name: self.results[f"{place}/{name}"] for name in names or self.results.names(place)}
                if place in self.results else None for place in places]

    @functools.cached_property
    def contacts(self):
        """Of each state {name: array}, or None where the run wrote no contacts: it does where its groups ask for them."""
        return self.read("contacts")

    @functools.cached_property
    def boundary(self):
        """Arrays (states, boundaries, components); none where the scene has no boundaries."""
        names = ("position", "normal", "velocity", "force")
        states = self.read("boundaries", *names)
        return {} if states[-1] is None else {name: np.array([state[name] for state in states]) for name in names}


def plane(point, normal, **more):
    return {"shape": "plane", "point": floats(point), "normal": floats(normal), **more}


def floats(values):
    return [float(value) for value in values]


class SmallScene(RunTestCase):
    """Runs of a few grains. Steps are a power of two, so that times are exact; a tolerance of round-off."""
    step = 1.0 / 512

    def play(self, title, grains, boundaries=(), gravity=None, steps=100, ranks=1, files=(), status=0, **groups):
        """Run `grains` between `boundaries` (lists of keys) and return what was written. Boundaries have the identifiers that
        follow on those of the grains. Without gravity none acts, or that of a table in the groups. Contacts, which take as long to write
        as all else, are written where the groups ask for them."""
        dimension = len(grains[0].place)
        if gravity is None and "gravity_table" not in groups.get("scene", {}):
            gravity = np.zeros(dimension)
        directory = self.here(title)
        os.makedirs(directory)
        write(os.path.join(directory, "bodies.csv"), bodies_csv(grains))
        for name, text in dict(files).items():
            write(os.path.join(directory, name), text)
        case = merged({
            "scene": {"dimension": dimension, "bodies": "file", "bodies_file": "bodies.csv",
                      "gravity": None if gravity is None else floats(gravity)},
            "boundary": [dict(keys) for keys in boundaries],
            "time": {"step": self.step, "steps": steps},
            "solver": {"criterion": "residual", "tolerance": 1e-13, "check_every": 1, "warm_start": False, "max_iterations": 20000},
            "output": {"directory": "results", "contacts": False},
        }, groups)
        run = run_case(case, ranks, directory)
        self.assert_status(run, status)
        return Record(run, grains, dimension)

    def both(self, check):
        """check(dimension) for disks and spheres."""
        for dimension in (2, 3):
            with self.subTest(dimension=dimension):
                check(dimension)

    def verify(self, case, quantity, measured, accepted, tolerance):
        """All numbers `measured` are those accepted, within an absolute tolerance; the worst of them goes into the table."""
        measured, accepted, tolerance = (np.asarray(value, dtype=float) for value in (measured, accepted, tolerance))
        measured, accepted, tolerance = np.broadcast_arrays(measured, accepted, tolerance)
        self.assertGreater(measured.size, 0, f"{case}: {quantity}: nothing was measured")
        error = np.abs(measured - accepted)
        worst = np.unravel_index(np.argmax(np.where(np.isnan(error), np.inf, error / tolerance)), error.shape)
        note(case, quantity, accepted[worst], measured[worst], error[worst], tolerance[worst])
        self.assertTrue(np.all(error <= tolerance), f"{case}: {quantity}: {measured[worst]!r}, accepted {accepted[worst]!r}, "
                        f"differs by {error[worst]:.3g}, tolerance {tolerance[worst]:.3g}")

    def rounding(self, record, scale):
        """What one addition a step of numbers no larger than `scale` may lose."""
        return 4 * max(record.step[-1], 10) * EPS * scale


def note(case, quantity, accepted, measured, error, tolerance):
    path = os.environ.get("GRAVIER_VALIDATION_TABLE")
    if not path:
        return
    # one write a row: tests that run side by side share the file
    with open(path, "a", encoding="ascii") as file:
        file.write(f'"{case}","{quantity}",{accepted:.9g},{measured:.9g},{error:.2g},{tolerance:.2g}\n')
