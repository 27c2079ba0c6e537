"""gravier_bench runs, its table is whole, and what it counts (contacts, bytes, unknowns) is right. No time is judged."""
import csv
import math
import os

import matplotlib.pyplot  # noqa: F401
import numpy as np

import forked_scripts
from gravier_runs import SOURCE, PROGRAMS, RunTestCase, each, gravier

SMALL = ["--contacts", "3000", "--spheres", "1500", "--rounds", "2", "--seconds", "0.001", "--iterations", "4", "--triad", "5000"]
PLACES = ["kernel_core_cache", "kernel_last_cache", "kernel_memory"]
KERNELS = ["2d_frictionless", "2d_friction", "2d_shaped", "3d_frictionless", "3d_friction", "3d_shaped"]
# rows of hot, components of an impulse, of a velocity and of the weights of a body
SHAPES = {"2d_frictionless": (4, 1, 2, 2), "2d_friction": (8, 2, 3, 3), "2d_shaped": (11, 2, 3, 3),
          "3d_frictionless": (5, 1, 3, 3), "3d_friction": (9, 3, 6, 4), "3d_shaped": (15, 3, 6, 9)}
# what effects make of them: rows of hot, components of an impulse, and the one compared with
EFFECTS = {"2d_frictionless": (4, 1, "2d_frictionless"), "2d_frictionless_restitution": (4, 1, "2d_frictionless"),
           "2d_friction": (8, 2, "2d_frictionless"), "2d_friction_restitution": (8, 2, "2d_friction"),
           "2d_friction_tangential": (9, 2, "2d_friction"), "2d_friction_rolling": (11, 3, "2d_friction"),
           "2d_friction_tangential_roll": (12, 3, "2d_friction"), "2d_shaped": (11, 2, "2d_friction"),
           "3d_frictionless": (5, 1, "3d_frictionless"), "3d_frictionless_restitution": (5, 1, "3d_frictionless"),
           "3d_friction": (9, 3, "3d_frictionless"), "3d_friction_restitution": (9, 3, "3d_friction"),
           "3d_friction_tangential": (11, 3, "3d_friction"), "3d_friction_rolling": (13, 6, "3d_friction"),
           "3d_friction_tangential_roll": (15, 6, "3d_friction"), "3d_shaped": (15, 3, "3d_friction")}
SCENE = ["list_build", "contacts", "iterations", "step", "solve", "solve_per_contact_iteration", "list_build_over_step"]
SHARES = ["share_" + name for name in ("sweeps", "exchange", "checks", "reductions", "detection", "lists_and_ghosts", "setup", "bodies",
                                       "rest")]
DETECTION = ["list_check_and_ghosts", "contact_search", "contact_packing", "interface_search"]


def read(path):
    """{(group, case, size, ranks, quantity): row}"""
    with open(path, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {(row["group"], row["case"], int(row["size"]), int(row["ranks"]), row["quantity"]): row for row in rows}, len(rows)


def uniform(seed, counter, stream):
    """hash_uniform of modules/base/numerics/random_hash.f90."""
    low_half, factor = 0xFFFFFFFF, (0x6C62272E, 0x5BD1E995)

    def mix(z):
        z ^= z >> 30
        for k in range(2):
            low, high = z & low_half, z >> 32
            high ^= (low * factor[k] >> 15) & low_half
            low ^= (high * factor[1 - k] >> 13) & low_half
            high = high + (low * factor[k] >> 17) & low_half
            low = low + (high * factor[1 - k] >> 16) + 2654435769 & low_half
            z = low << 32 | high
        return z

    state = mix(mix(mix(seed) ^ mix(counter + 1000003)) ^ mix(stream + 77))
    return ((state >> 12) + 0.5) * 2.0 ** -52


def packing(dimension, grains):
    """Centres and radii of the packing of about so many grains, lengths in units of the largest radius, and the grains along
    each axis, from the description in drivers/bench/bench_packing.f90."""
    edge = math.sqrt(grains * math.sqrt(0.75)) if dimension == 2 else (grains * math.sqrt(0.5)) ** (1 / 3)
    count = [max(2, round(edge))] * (dimension - 1)
    count.append(max(2, math.ceil(grains / count[0] ** (dimension - 1))))
    spacing, layer = 2.002, 2.002 * math.sqrt(0.75 if dimension == 2 else 0.5)
    centres, radii = [], []
    for number in range(1, math.prod(count) + 1):
        place, rest = [], number - 1
        for n in count:
            place.append(rest % n)
            rest //= n
        centre = [1.001 + place[d] * (layer if d == dimension - 1 else spacing) + 0.001 * (uniform(2, number, d + 1) - 0.5)
                  + (0.5 * spacing * (place[-1] % 2) if d < dimension - 1 else 0) for d in range(dimension)]
        centres.append(centre)
        radii.append(0.98 + 0.02 * uniform(1, number, 0))
    return np.array(centres), np.array(radii), count


def contacts_of(dimension, grains):
    """Contacts of the packing, all pairs tried: between grains, with the floor and with the walls."""
    centres, radii, count = packing(dimension, grains)
    alert = 0.002 + 0.02 * (1.1835 if dimension == 2 else 1.0871)
    distance = np.sqrt(((centres[:, None] - centres[None]) ** 2).sum(axis=2))
    gap = distance - radii[:, None] - radii[None]
    contacts = np.count_nonzero(np.triu(gap <= alert, 1)) + np.count_nonzero(centres[:, -1] - radii <= alert)
    for d in range(dimension - 1):
        contacts += np.count_nonzero(centres[:, d] - radii <= alert)
        contacts += np.count_nonzero((count[d] + 0.5) * 2.002 - centres[:, d] - radii <= alert)
    return contacts


class Bench(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.runs = {}
        for ranks in (1, 2):
            os.makedirs(os.path.join(cls.scratch, str(ranks)))
            cls.runs[ranks] = gravier(*SMALL, "--csv", "table.csv", ranks=ranks, directory=os.path.join(cls.scratch, str(ranks)),
                                      program="gravier_bench")

    def table(self, ranks):
        self.assert_status(self.runs[ranks], 0)
        return read(self.runs[ranks].path("table.csv"))

    def test_rows(self):
        for ranks in (1, 2):
            rows, count = self.table(ranks)
            self.assertEqual(len(rows), count, "a row stands twice")
            self.assertEqual(sorted(os.listdir(self.runs[ranks].directory)), ["table.csv"], "nothing else is left")
            had = {(group, case, of, quantity) for group, case, _, of, quantity in rows}
            wanted = set()
            for of in range(1, ranks + 1):
                wanted |= {("triad", "triad", of, quantity) for quantity in ("bandwidth", "bytes_per_element")}
                exchange = ["exchange", "shared_bodies", "copies_values", "seconds_per_value"]
                exchange += ["messages_between_ranks", "values_between_ranks"] * (of > 1)
                wanted |= {("exchange", "average_copies", of, quantity) for quantity in exchange}
                wanted |= {("interface", solver, of, quantity) for solver in ("mumps", "cg")
                           for quantity in ("factorisation", "interface_solve")} | {("interface", "cg", of, "iterations")}
                for group, ratios in (("strong_scaling", ("speedup_solve", "speedup_step")),
                                      ("weak_scaling", ("efficiency_solve", "efficiency_step"))):
                    wanted |= {(group, "nscdd", of, quantity) for quantity in SCENE + SHARES}
                    wanted |= {(group, "nscdd", of, quantity) for quantity in ratios if of > 1}
            wanted |= {("step", "nlgs", 1, quantity) for quantity in SCENE + SHARES + DETECTION +
                       ["write_state", "write_state_over_step"]}
            wanted |= {(place, name + version, 1, quantity) for place in PLACES for name in KERNELS
                       for version in ("", "_recording", "_momentum") for quantity in
                       ("relaxations", "bytes_per_relaxation", "ratio_to_triad", "bodies", "share_of_pressing_contacts")}
            wanted |= {("effect", name, 1, quantity) for name in EFFECTS for quantity in
                       ("seconds_per_relaxation", "unknowns", "bytes_per_contact", "seconds_over_without", "bytes_over_without")}
            self.assertEqual(had, wanted)
            for key, row in rows.items():
                values = [float(row[name]) for name in ("low", "median", "high")]
                self.assertTrue(all(math.isfinite(value) for value in values), key)
                self.assertTrue(values[0] > 0 or (key[-1].startswith("share_") and values[0] >= 0), key)
                self.assertTrue(values[0] <= values[1] <= values[2], key)
                self.assertEqual(int(row["repeats"]), 2, key)
                self.assertRegex(row["date"], r"^\d{4}-\d\d-\d\d$")
                for name in ("machine", "compiler", "flags", "build", "version", "revision"):
                    self.assertNotEqual(row[name], "", f"{key} {name}")

    def test_contacts_are_those_of_the_packing(self):
        """All pairs of grains, tried one by one."""
        rows, _ = self.table(1)
        for name in KERNELS:
            dimension = int(name[0])
            grains = round(2000 / (1.95 if dimension == 2 else 3.35))
            sizes = {size for group, case, size, _, _ in rows if group == "kernel_core_cache" and case == name}
            self.assertEqual(sizes, {contacts_of(dimension, grains)}, name)

    def test_bytes_are_those_of_the_arrays(self):
        rows, _ = self.table(1)
        for (group, case, size, _, quantity), row in rows.items():
            if quantity != "bytes_per_relaxation":
                continue
            name = case.removesuffix("_recording").removesuffix("_momentum")
            hot, impulse, velocity, weight = SHAPES[name]
            passes = {"": 2, "_recording": 3, "_momentum": 4}[case.removeprefix(name)]
            bodies = float(rows[group, case, size, 1, "bodies"]["median"])
            # contacts lie in blocks of 16
            padded = 16 * math.ceil(size / 16)
            expected = (8 * padded * (1 + hot + passes * impulse) + 8 * (2 * velocity + weight) * bodies) / size
            # a quotient and its text of 17 digits
            self.assertAlmostEqual(float(row["median"]), expected, delta=1e-12 * expected, msg=f"{group} {case}")

    def test_effects_are_of_the_same_contacts(self):
        """All of a dimension have as many, and bytes are those of pair, hot and impulse."""
        rows, _ = self.table(1)
        for dimension in "23":
            self.assertEqual(len({size for group, case, size, _, _ in rows if group == "effect" and case[0] == dimension}), 1)
        value = {(case, quantity): float(row["median"]) for (group, case, _, _, quantity), row in rows.items() if group == "effect"}
        for name, (hot, impulse, base) in EFFECTS.items():
            self.assertEqual(value[name, "unknowns"], impulse)
            self.assertEqual(value[name, "bytes_per_contact"], 8 * (1 + hot + impulse), name)
            self.assertAlmostEqual(value[name, "bytes_over_without"], value[name, "bytes_per_contact"] / value[base, "bytes_per_contact"],
                                   delta=1e-12)
            if name == base:
                self.assertEqual(value[name, "seconds_over_without"], 1.0)

    def test_ratio_is_of_rate_and_bandwidth(self):
        """With one round it can be told from the table."""
        directory = self.here("ratio")
        os.makedirs(directory)
        run = gravier(*SMALL, "--contacts", "500", "--spheres", "300", "--rounds", "1", directory=directory, program="gravier_bench")
        self.assert_status(run, 0)
        rows, _ = read(run.path("gravier_bench.csv"))
        value = {key: float(row["median"]) for key, row in rows.items()}
        bandwidth = value["triad", "triad", 5000, 1, "bandwidth"]
        for (group, case, size, ranks, quantity), ratio in value.items():
            if quantity == "ratio_to_triad":
                of = (group, case, size, ranks)
                expected = value[(*of, "relaxations")] * value[(*of, "bytes_per_relaxation")] / bandwidth
                self.assertAlmostEqual(ratio, expected, delta=1e-12 * expected)

    def test_scenes_do_not_depend_on_the_ranks(self):
        rows, _ = self.table(2)
        for group, quantity in (("strong_scaling", "contacts"), ("exchange", "copies_values"), ("exchange", "shared_bodies"),
                                ("interface", "iterations")):
            found = {}
            for (of, case, size, ranks, what), row in rows.items():
                if of == group and what == quantity:
                    found.setdefault((case, size), {})[ranks] = row["median"]
            self.assertTrue(found)
            for case, values in found.items():
                self.assertEqual(values[1], values[2], f"{group} {case}")
        sizes = {ranks: size for group, _, size, ranks, _ in rows if group == "weak_scaling"}
        self.assertEqual(sizes[2], 2 * sizes[1])
        self.assertEqual({row["median"] for (group, *_, quantity), row in rows.items()
                          if quantity == "iterations" and group.endswith("scaling")}, {"4.0000000000000000E+000"})

    def test_one_kernel(self):
        for extra in ([], ["--recording"]):
            run = gravier("--kernel", "3d_friction", "--sweeps", "3", *extra, directory=self.scratch, program="gravier_bench")
            self.assert_status(run, 0)
            self.assertEqual(run.stdout, f"3d_friction: {contacts_of(3, round(2000 / 3.35))} contacts, 3 sweeps\n")

    def test_bad_usage(self):
        directory = self.here("bad")
        os.makedirs(directory)
        bad = [(["--what"], "unknown argument '--what'"), (["--csv"], "--csv ''"), (["--csv", "none/x.csv"], "--csv 'none/x.csv'"),
               (["--rounds", "0"], "--rounds '0': expected an integer >= 1"), (["--contacts", "1e6"], "--contacts '1e6'"),
               (["--spheres", "-3"], "--spheres '-3'"), (["--iterations"], "--iterations ''"),
               (["--triad", "99999999999"], "--triad '99999999999'"), (["--seconds", "inf"], "--seconds 'inf'"),
               (["--seconds", "1e999"], "--seconds '1e999'"), (["--kernel", "3d_friction"], "go together"),
               (["--kernel", "4d", "--sweeps", "1"], "--kernel '4d': expected one of 2d"), (["--sweeps", "2"], "go together"),
               (["--recording"], "--recording goes")]
        for (arguments, expected), run in zip(bad, each(lambda a, _: gravier(*a, ranks=2, directory=directory,
                                                                             program="gravier_bench"), bad)):
            self.assert_status(run, 2)
            self.assertEqual(run.stderr.count("\n"), 1, str(run))
            self.assertIn(expected, run.stderr)
            self.assertEqual(run.stdout, "")
        self.assertEqual(os.listdir(directory), [])

    def test_help(self):
        run = gravier("--help", ranks=2, directory=self.scratch, program="gravier_bench")
        self.assert_status(run, 0)
        self.assertEqual(run.stdout.count("usage: gravier_bench"), 1)

    def test_figures(self):
        """plot_bench.py draws and prints the table, and refuses another."""
        self.table(2)
        path = os.path.join(SOURCE, "drivers/bench/plot_bench.py")
        done = forked_scripts.script(path, self.runs[2].path("table.csv"), "--out", self.here("figures"))
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertEqual(sorted(os.listdir(self.here("figures"))), ["bench_kernels.png", "bench_kernels.svg", "bench_step.png",
                                                                    "bench_step.svg"])
        done = forked_scripts.script(path, self.runs[2].path("table.csv"), "--markdown")
        self.assertEqual(done.returncode, 0)
        self.assertEqual(done.stdout.count("`3d_friction_recording`"), 1)
        done = forked_scripts.script(path, os.path.join(SOURCE, "README.md"), "--out", self.here("none"))
        self.assertEqual(done.returncode, 1)
        self.assertIn("expected the table of gravier_bench", done.stderr)
        self.assertTrue(os.path.exists(os.path.join(PROGRAMS, "gravier_bench")))
