"""Means over regions and profiles against what is known exactly: a column of disks whose stress grows with depth, a lattice of known solid
fraction, plugs and shear, parts of disks and balls between sides, the sum of bins, any ranks and subdomains, restarts, bad input.

Static columns are solved to a residual of 1e-13, and their forces are exact to about 1e-10 of the largest. Sums of volumes and velocities
are exact to rounding, some units of the last place of what is added up."""
import os
import signal
import subprocess
import sys
import unittest

import numpy as np

from packings import POURS, poured_shapes
from shaped_scenes import box, prepare, shaped_case
from gravier_runs import SOURCE, RunTestCase, differences, gravier, merged, namelist, run_case, steps_of, write
import gravier as package

G = 9.81
R = 0.01
MASS = 0.5
AXES = "xyz"
#: a run that the system ends two steps after a checkpoint
KILLED = """
import os
import signal
import gravier

s = gravier.Simulation("case.nml", quiet=True)
while s.made < 15:
    s.step()
os.kill(os.getpid(), signal.SIGKILL)
"""


def grains(path, positions, velocities=None, radius=R):
    """A bodies file of equal grains."""
    positions = np.asarray(positions, dtype=float)
    velocities = np.zeros_like(positions) if velocities is None else np.asarray(velocities, dtype=float)
    axes = AXES[:positions.shape[1]]
    text = "id,radius,mass," + ",".join([*axes, *("v" + axis for axis in axes)]) + "\n"
    for k, (x, v) in enumerate(zip(positions, velocities)):
        text += f"{k + 1},{radius!r},{MASS!r}," + ",".join(repr(float(number)) for number in (*x, *v)) + "\n"
    return write(path, text)


def free(path, dimension=2, **scene):
    """A scene in which nothing acts."""
    return {"scene": {"dimension": dimension, "bodies": "file", "bodies_file": path, "gravity": [0.0] * dimension, **scene},
            "time": {"step": 1e-4, "steps": 1}, "solver": {"method": "nscdd"}, "output": {"every": 1}}


def disk_below(t):
    """Part of a disk of radius 1 below y = t, by the trapezoids of 20,000 strips: an error of about 1e-6."""
    y = np.linspace(-1.0, t, 20001)
    width = 2.0 * np.sqrt(np.maximum(1.0 - y**2, 0.0))
    return np.sum(0.5 * (width[1:] + width[:-1]) * np.diff(y)) / np.pi


class Regions(RunTestCase):

    def setUp(self):
        #: what the package has read of runs
        self.read = {}

    def play(self, title, groups, ranks=1, options=(), status=0):
        run = run_case(groups, ranks=ranks, directory=self.here(title), options=options)
        self.assert_status(run, status)
        return run

    def region(self, run, name, step=None):
        if run not in self.read:
            self.read[run] = package.Run(os.path.join(run.directory, "results"))
        return self.read[run].region(name, step)

    # ---- contacts

    def test_contacts_of_grains_that_cross(self):
        """Ten spheres roll over the side of a region in the second half of a step, beside one at rest in it: each has one contact, on
        whichever side it is counted."""
        places = [[0.0, 0.05 * k, R] for k in range(10)] + [[-0.05, 0.0, R]]
        velocities = [[1.0, 0.0, 0.0]] * 10 + [[0.0, 0.0, 0.0]]
        case = {"scene": {"dimension": 3, "bodies": "file", "bodies_file": grains(self.here("cross.csv"), places, velocities)},
                "boundary": {"name": "floor", "shape": "plane", "normal": [0, 0, 1]},
                "region": {"name": "left", "upper": [0.0098]}, "time": {"step": 1e-3, "steps": 20},
                "solver": {"method": "nscdd"}, "decomposition": {"subdomains": 4}, "output": {"every": 1}}
        history = self.play("cross", case, ranks=2).history()
        self.assertEqual(history["left_grains"].tolist(), [11] * 9 + [1] * 11)
        self.assertEqual(history["left_contacts_per_grain"].tolist(), [1] * 20)

    # ---- stress

    def test_column(self):
        """The stress in a column of disks grows by the weight of a disk from one contact to the next, in bins that cut branches too."""
        count, width, gap = 12, 0.05, 2.0 * R
        path = grains(self.here("column.csv"), [[0.5 * width, R + gap * k] for k in range(count)])
        case = {"scene": {"bodies": "file", "bodies_file": path, "friction": 0.0},
                "boundary": [{"name": "floor", "shape": "plane", "normal": [0.0, 1.0]},
                             {"name": "left", "shape": "plane", "normal": [1.0, 0.0]},
                             {"name": "right", "shape": "plane", "normal": [-1.0, 0.0], "point": [width, 0.0]}],
                "time": {"step": 1e-3, "steps": 2},
                "solver": {"method": "nlgs", "criterion": "residual", "tolerance": 1e-13, "max_iterations": 100000},
                "output": {"every": 1, "stress": True},
                "region": [{"name": "all"}, {"name": "profile", "axis": "y", "bins": count, "lower": [-1e30, 0.0], "upper": [1e30, count * gap]},
                           {"name": "fine", "axis": "y", "bins": 5 * count, "lower": [-1e30, 0.0], "upper": [1e30, count * gap]},
                           {"name": "lower", "upper": [1e30, 0.5 * count * gap]}]}
        run = self.play("column", case)
        weight = MASS * G
        # the contact below disk k carries what is above it; its branch reaches from the centre below to its own, half a bin on each side
        carried = weight * (count - np.arange(count + 1))
        profile = self.region(run, "profile")
        # per bin: half of the branch below its disk, but that of the floor, which is half as long, all of it; and half of that above
        np.testing.assert_allclose(profile.stress[:, 1, 1], 0.5 * (carried[:-1] + carried[1:]) / width, rtol=1e-9)
        self.assertLess(np.abs(profile.stress[:, [0, 0, 1], [0, 1, 0]]).max(), 1e-9 * weight / width)
        # linear with depth: minus the weight of a disk a diameter
        slope = np.polyfit(profile.centre[:, 1], profile.stress[:, 1, 1], 1)[0]
        self.assertAlmostEqual(slope * gap * width / weight, -1.0, delta=1e-8)
        np.testing.assert_allclose(profile.grains, 1.0)
        np.testing.assert_allclose(profile.solid_fraction, np.pi * R**2 / (gap * width), rtol=1e-12)
        np.testing.assert_allclose(profile.contacts_per_grain, [2.0] * (count - 1) + [1.0])
        np.testing.assert_allclose(profile.volume, gap * width, rtol=1e-13)
        # five bins a disk: the force of a contact acts up to the next centre, in the middle of the third bin
        fine = self.region(run, "fine").stress[:, 1, 1].reshape(count, 5) * width
        expected = np.stack([carried[:-1], carried[:-1], 0.5 * (carried[:-1] + carried[1:]), carried[1:], carried[1:]], axis=1)
        np.testing.assert_allclose(fine, expected, rtol=1e-9, atol=1e-9 * weight)
        history = run.history()
        for name in ("stress_xx", "stress_xy", "stress_yx", "stress_yy", "pressure", "volume", "solid_fraction"):
            np.testing.assert_allclose(history["all_" + name], history[name], rtol=1e-13, atol=1e-13 * weight / width)
        half = 0.5 * count
        self.assertAlmostEqual(history["lower_stress_yy"][-1] * width / (weight * 0.75 * count), 1.0, delta=1e-9)
        self.assertEqual(history["lower_grains"][-1], half)

    # ---- grains

    def test_lattice(self):
        """A box of whole cells of a lattice has its solid fraction, wherever the sides cut the disks or balls."""
        for dimension, ball in ((2, np.pi / 4), (3, np.pi / 6)):
            with self.subTest(dimension):
                counts = (6, 7, 5)[:dimension]
                grid = np.stack(np.meshgrid(*(np.arange(count) for count in counts), indexing="ij"), axis=-1).reshape(-1, dimension)
                path = grains(self.here(f"lattice{dimension}.csv"), 2.0 * R * (grid + 0.5))
                # whole cells, shifted along y alone: the solid fraction is that of the lattice
                cell = {"name": "cells", "lower": [2 * R, 2.6 * R, 2 * R][:dimension], "upper": [8 * R, 10.6 * R, 6 * R][:dimension]}
                bins = {"name": "bins", "axis": "y", "bins": 7}
                run = self.play(f"lattice{dimension}", {**free(path, dimension), "region": [cell, bins]})
                self.assertAlmostEqual(run.history()["cells_solid_fraction"][-1], ball, delta=1e-13)
                self.assertEqual(run.history()["cells_grains"][-1], 3 * 4 * (2 if dimension == 3 else 1))
                found = self.region(run, "bins")
                np.testing.assert_allclose(found.solid_fraction, ball, rtol=1e-12)
                np.testing.assert_allclose(found.grains, np.prod(counts) / 7)
                np.testing.assert_array_equal(found.bin, np.arange(1, 8))

    def test_segments(self):
        """A disk across bins has its segments there."""
        path = grains(self.here("disk.csv"), [[0.0, 0.0]])
        region = {"name": "cut", "lower": [-1.0, -2 * R], "upper": [1.0, 2 * R], "axis": "y", "bins": 16}
        run = self.play("disk", {**free(path), "region": [region]})
        found = self.region(run, "cut")
        sides = np.append(found.lower[:, 1], found.upper[-1, 1]) / R
        parts = np.diff([disk_below(min(max(t, -1.0), 1.0)) for t in sides])
        np.testing.assert_allclose(found.solid_fraction * found.volume / (np.pi * R**2), parts, atol=4e-6)
        self.assertAlmostEqual((found.solid_fraction * found.volume).sum() / (np.pi * R**2), 1.0, delta=1e-14)
        np.testing.assert_array_equal(found.velocity, 0.0)

    def test_mass_inside(self):
        """The velocity of a layer is that of the mass in it: of 27/32 of one ball and half of another."""
        path = grains(self.here("two.csv"), [[0.0, 0.0, 0.5 * R], [1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0], [0.0, -2.0, 0.0]])
        run = self.play("two", {**free(path, 3), "region": [{"name": "above", "lower": [-1e30, -1e30, 0.0]}]})
        parts = np.array([27.0 / 32.0, 0.5])
        mean = (parts @ [1.0, -2.0]) / parts.sum()
        self.assertAlmostEqual(run.history()["above_velocity_y"][-1], mean, delta=1e-14)
        self.assertAlmostEqual(run.history()["above_granular_temperature"][-1],
                               (parts @ (np.array([1.0, -2.0]) - mean)**2) / parts.sum() / 3.0, delta=1e-14)
        self.assertEqual(run.history()["above_grains"][-1], 2)

    def test_bricks_between_walls(self):
        """Bricks whose sides lie on walls and on sides of regions are all inside, and cut ones count by their area."""
        library = "shape brick\nrounding 0.002\npolygon  0 0  0.2 0  0.2 0.1  0 0.1\n"
        directory = prepare(self.here("bricks"), 2, [], library)
        write(os.path.join(directory, "bodies.csv"), "id,shape,mass,x,y\n1,brick,1,0.1,0.05\n2,brick,1,0.1,0.15\n")
        walls = [{"shape": "plane", "point": [0.0, 0.0], "normal": [1.0, 0.0]}, {"shape": "plane", "point": [0.2, 0.0], "normal": [-1.0, 0.0]}]
        run = run_case(shaped_case(2, walls, {"scene": {"gravity": [0.0, 0.0]}, "time": {"steps": 1}, "output": {"every": 1}, "region": [
            {"name": "room", "lower": [0.0, 0.0], "upper": [0.2, 0.4]}, {"name": "corner", "lower": [0.0, 0.0], "upper": [0.05, 0.125]},
            {"name": "left", "upper": [0.05]}, {"name": "bins", "axis": "y", "bins": 4, "lower": [0.0, 0.0], "upper": [0.2, 0.4]}]}), 1, directory)
        self.assert_status(run, 0)
        history = run.history()
        self.assertAlmostEqual(history["room_solid_fraction"][-1], 0.5, delta=1e-12)
        self.assertAlmostEqual(history["corner_solid_fraction"][-1], 1.0, delta=1e-12)
        self.assertAlmostEqual(history["left_solid_fraction"][-1], 1.0, delta=1e-12)
        np.testing.assert_allclose(self.region(run, "bins").solid_fraction, [1.0, 1.0, 0.0, 0.0], atol=1e-12)

    def test_shapes_fill_space(self):
        """Polygons, polyhedra and clusters: regions that fill space have the whole of their volume, and all figures are the same on any ranks."""
        for dimension in (2, 3):
            counts, spacing, _ = POURS[dimension]
            side = 0.5 * counts[0] * spacing
            parts = [{"name": f"part{k}", "lower": [side if k & 1 << d else -1e30 for d in range(dimension)],
                      "upper": [1e30 if k & 1 << d else side for d in range(dimension)]} for k in range(2**dimension)]
            case = shaped_case(dimension, box(counts, spacing), {
                "scene": {"bodies_file": "bodies.h5", "friction": 0.3}, "time": {"steps": 2}, "solver": {"method": "nscdd"},
                "decomposition": {"subdomains": 4}, "output": {"every": 1, "stress": True},
                "region": [*parts, {"name": "bins", "axis": AXES[dimension - 1], "bins": 9}]})
            runs = []
            for ranks in (1, 2):
                directory = self.here(f"shapes{dimension} {ranks}")
                poured_shapes(directory, dimension)
                runs.append(run_case(case, ranks, directory))
                self.assert_status(runs[-1], 0)
            history = runs[0].history()
            self.same_history(*runs)
            volume = history["volume"] * history["solid_fraction"]
            shares = [history[part["name"] + "_volume"] * history[part["name"] + "_solid_fraction"] for part in parts]
            np.testing.assert_allclose(np.sum(shares, axis=0), volume, rtol=1e-13)
            self.assertGreater(np.min(shares), 0.0)
            bins = self.region(runs[0], "bins")
            np.testing.assert_allclose((bins.volume * bins.solid_fraction).sum(), volume[-1], rtol=1e-13)

    def test_plug_and_shear(self):
        """A plug has one velocity and no temperature; in a shear flow the velocity is linear, and the temperature that of a layer."""
        count, rate = 10, 3.0
        grid = np.stack(np.meshgrid(np.arange(4), np.arange(count), indexing="ij"), axis=-1).reshape(-1, 2)
        place = 2.4 * R * (grid + 0.5)
        speed = np.stack([rate * place[:, 1], np.full(len(place), -0.2)], axis=1)
        path = grains(self.here("shear.csv"), place, speed)
        bins = {"name": "layers", "axis": "y", "bins": count, "lower": [-1e30, 0.0], "upper": [1e30, 2.4 * R * count]}
        run = self.play("shear", {**free(path), "region": [bins, {"name": "two", "upper": [1e30, 4.8 * R]}]})
        layers = self.region(run, "layers")
        np.testing.assert_allclose(layers.velocity[:, 0], rate * layers.centre[:, 1], rtol=1e-12)
        np.testing.assert_allclose(layers.velocity[:, 1], -0.2, rtol=1e-13)
        self.assertLess(layers.granular_temperature.max(), 1e-14)
        np.testing.assert_array_equal(layers.stress, 0.0)
        # two layers that differ by 2.4 R rate
        self.assertAlmostEqual(run.history()["two_granular_temperature"][-1] / ((1.2 * R * rate)**2 / 2), 1.0, delta=1e-9)
        self.assertAlmostEqual(run.history()["two_velocity_x"][-1], 2.4 * R * rate, delta=1e-13)

    def test_periods(self):
        """A plug that goes round a cell: bins over a period always have all of it, and a region across the period has its own."""
        count, length = 8, 0.32
        path = grains(self.here("round.csv"), [[0.04 * k + 0.02, 0.0] for k in range(count)], [[20.0, 0.0]] * count)
        case = merged(free(path, period=[length, 0.0]), {"time": {"step": 1e-4, "steps": 40}})
        case["region"] = [{"name": "all", "axis": "x", "bins": 5}, {"name": "across", "lower": [0.24], "upper": [0.40]}]
        run = self.play("round", case)
        history, volume = run.history(), count * np.pi * R**2
        np.testing.assert_allclose(history["all_volume"] * history["all_solid_fraction"], volume, rtol=1e-13)
        np.testing.assert_allclose(history["across_volume"], 0.16 * 2 * R, rtol=1e-12)
        np.testing.assert_allclose(history["across_solid_fraction"], volume / (length * 2 * R), rtol=1e-12)
        np.testing.assert_allclose(history["across_velocity_x"], 20.0, rtol=1e-13)
        for step in range(1, 41):
            found = self.region(run, "all", step)
            self.assertAlmostEqual((found.volume * found.solid_fraction).sum() / volume, 1.0, delta=1e-13)
            self.assertEqual(found.grains.sum(), count)

    def test_means_over_states(self):
        """Two disks cross ten bins one after the other: means over states have the mass and the momentum of all, and bins that are always empty have no
        velocity. The mean of the velocities of single states would count a corner of a disk as much as the whole of it."""
        path = grains(self.here("passing.csv"), [[0.03, 0.0], [0.11, 0.05]], [[4.0, 0.0], [-1.0, 0.0]])
        case = merged(free(path), {"time": {"step": 1e-3, "steps": 20}, "output": {"every": 2}})
        case["region"] = [{"name": "way", "axis": "x", "bins": 10, "lower": [0.0, -0.02], "upper": [0.2, 0.07]}]
        run = package.Run(os.path.join(self.play("passing", case).directory, "results"))
        steps = [step for step in run.steps if step > 0]
        found = run.region_mean("way")
        rows = [run.region("way", step) for step in steps]
        momentum = np.mean([(each.solid_fraction * each.volume)[:, None] * each.velocity for each in rows], axis=0)
        there = found.solid_fraction > 0.0
        self.assertTrue(2 < there.sum() < 10)
        np.testing.assert_allclose((found.solid_fraction * found.volume)[there, None] * found.velocity[there], momentum[there], rtol=1e-12)
        self.assertTrue(np.isnan(found.velocity[~there]).all())
        np.testing.assert_allclose(found.velocity[1], [4.0, 0.0], rtol=1e-12)
        np.testing.assert_array_equal(run.region_mean("way", [20]).velocity[there & (rows[-1].solid_fraction > 0)],
                                      rows[-1].velocity[there & (rows[-1].solid_fraction > 0)])
        with self.assertRaisesRegex(package.ResultsError, "no step with means over regions"):
            run.region_mean("way", [])

    # ---- where it is computed

    def stirred(self, dimension):
        """Grains that fall into a heap, with boundaries that move, an outlet and insertion: regions see all of it."""
        up = dimension - 1
        low, high = [0.0] * dimension, [0.16] * dimension
        low[up], high[up] = 0.14, 0.22
        down = [0.0] * dimension
        down[up] = -0.6
        stir = [0.0] * dimension
        stir[0] = 0.3
        shape = [8, 5] if dimension == 2 else [4, 4, 4]
        walls = [{"name": "hole", "shape": "outlet", "point": [0.0] * up + [-0.02], "normal": [0.0] * up + [1.0]},
                 {"name": "bar", "shape": "plane", "point": [0.0] * dimension, "normal": [1.0, 0.05][:2] + [0.0] * (dimension - 2), "velocity": stir}]
        return {"scene": {"dimension": dimension, "bodies": "lattice", "lattice_count": shape, "radius_min": 0.006, "radius_max": 0.01,
                          "friction": 0.3, "restitution": 0.2}, "boundary": walls,
                "insertion": [{"lower": low, "upper": high, "rate": 300.0, "radius": 0.008, "velocity": down}],
                "time": {"step": 1e-3, "steps": 60}, "solver": {"method": "nscdd"}, "decomposition": {"subdomains": 4},
                "output": {"every": 20, "checkpoint_every": 30, "stress": True},
                "region": [{"name": "all"}, {"name": "box", "lower": [0.02] * dimension, "upper": [0.09] * dimension},
                           {"name": "bins", "axis": AXES[up], "bins": 6, "upper": [1e30] * up + [0.1]}]}

    def same_history(self, one, other):
        for name, values in one.history().items():
            if not name.endswith("_seconds"):
                np.testing.assert_array_equal(other.history()[name], values, name)

    def test_ranks_and_restart(self):
        """The same bits on 1 and 4 ranks in 2D, on 1 and 2 in 3D, and through a restart on other ranks."""
        for dimension in (2, 3):
            with self.subTest(dimension):
                case = self.stirred(dimension)
                whole = self.play(f"whole{dimension}", case)
                self.assertGreater(whole.history()["box_pressure"].max(), 0.0)
                self.assertGreater(whole.history()["entered"].sum(), 0)
                other = self.play(f"ranks{dimension}", case, ranks=4 if dimension == 2 else 2)
                self.same_history(whole, other)
                self.assertEqual([name for name in differences(whole.results(), other.results()) if "/run@" not in name], [])
                part = self.play(f"part{dimension}", merged(case, {"time": {"steps": 30}}))
                write(os.path.join(part.directory, "case.nml"), namelist(case))
                again = gravier("--restart", "case.nml", ranks=2, directory=part.directory)
                self.assert_status(again, 0)
                self.same_history(whole, again)
                for step in (20, 40, 60):
                    for name in ("all", "box", "bins"):
                        first, second = (self.region(run, name, step) for run in (whole, again))
                        for key in first:
                            np.testing.assert_array_equal(first[key], second[key], f"{name} {key}")

    def test_parts(self):
        """In each written state bins add up to their region, and the region without sides is the scene."""
        for dimension in (2, 3):
            run = self.play(f"parts{dimension}", self.stirred(dimension))
            history = run.history()
            scale = np.abs(history["stress_" + 2 * AXES[dimension - 1]]).max()
            for name in [key for key in history if key.startswith("all_stress")] + ["all_volume", "all_solid_fraction", "all_pressure"]:
                np.testing.assert_allclose(history[name], history[name[4:]], rtol=1e-12, atol=1e-12 * scale)
            np.testing.assert_array_equal(history["all_grains"], history["grains"])
            self.assertGreater(np.abs(history["all_stress_xy"] - history["all_stress_yx"]).max(), 1e-6 * scale)
            axes = AXES[:dimension]
            for step in (20, 40, 60):
                # a region without bins has the same tensor in both files; that of grains that move is not symmetric
                stress = self.region(run, "all", step).stress[0]
                np.testing.assert_array_equal(stress, [[history[f"all_stress_{a}{b}"][step - 1] for b in axes] for a in axes])
                bins = self.region(run, "bins", step)
                for key, name in (("solid_fraction", "solid_fraction"), ("pressure", "pressure")):
                    np.testing.assert_allclose((bins[key] * bins.volume).sum() / bins.volume.sum(), history["bins_" + name][step - 1],
                                               rtol=1e-12, atol=1e-12 * scale)
                self.assertEqual(bins.grains.sum(), history["bins_grains"][step - 1])

    def test_subdomains(self):
        """Other subdomains have other rounding and nothing else: one step after the start of a scene without impulses, and a plug."""
        grid = np.stack(np.meshgrid(np.arange(9), np.arange(9), indexing="ij"), axis=-1).reshape(-1, 2)
        speed = np.random.default_rng(2).normal(0.0, 0.3, grid.shape)
        path = grains(self.here("many.csv"), 2.3 * R * (grid + 0.5), speed)
        case = {**free(path), "region": [{"name": "box", "lower": [0.031, 0.047], "upper": [0.11, 0.13], "axis": "x", "bins": 9}]}
        one, many = (self.play(f"sub{n}", merged(case, {"decomposition": {"subdomains": n}})) for n in (1, 6))
        first, second = self.region(one, "box"), self.region(many, "box")
        self.assertEqual(first.grains.dtype.kind, "i")
        for key in first:
            np.testing.assert_allclose(second[key], first[key], rtol=1e-12, atol=1e-14, err_msg=key)

    # ---- what is off, and what is wrong

    def test_samples(self):
        """Bins of a region that is sampled are the means of the steps sampled since the last written state and of that of the state, of which a
        run that writes each step has the figures: velocities weighted by mass, stresses by volume. They are the same bits on two ranks, and
        after a kill between two states."""
        for dimension in (2, 3):
            case = self.stirred(dimension)
            sampled = merged(case, {"region": [{**region, "sample_every": 3} for region in case["region"]],
                                    "time": {"steps": 20}, "output": {"every": 8, "checkpoint_every": 13}})
            each = self.play(f"each step {dimension}", merged(case, {"time": {"steps": 20}, "output": {"every": 1}}))
            runs = [self.play(f"sampled {dimension}", sampled), self.play(f"sampled on two {dimension}", sampled, ranks=2)]
            here = self.killed(f"killed {dimension}", sampled)
            runs.append(gravier("--restart", "case.nml", ranks=1, directory=here))
            self.assert_status(runs[2], 0)
            for region in case["region"]:
                name, last = region["name"], 0
                for state in (8, 16, 20):
                    taken = sorted({step for step in range(last + 1, state + 1) if step % 3 == 0} | {state})
                    last = state
                    found = self.region(runs[0], name, state)
                    self.assertEqual(list(found.samples), [len(taken)] * len(found.samples))
                    self.compare_samples(found, [self.region(each, name, step) for step in taken])
                    for other in (self.region(run, name, state) for run in runs[1:]):
                        for key, values in found.items():
                            np.testing.assert_array_equal(other[key], values, f"{name} {state} {key}")

    def killed(self, title, case):
        """A run that is killed after step 15; its directory."""
        here = self.here(title)
        os.makedirs(here)
        write(os.path.join(here, "case.nml"), namelist(case))
        killed = subprocess.run([sys.executable, "-c", KILLED], cwd=here, env={**os.environ, "PYTHONPATH": os.path.join(SOURCE, "drivers/python")},
                                stderr=subprocess.PIPE, text=True, check=False)
        self.assertEqual(killed.returncode, -signal.SIGKILL, killed.stderr)
        return here

    def test_samples_of_another_question(self):
        """A region whose name, sides, bins or sampling differ at a restart begins anew there; the others go on."""
        case = self.stirred(2)
        regions = [{**region, "sample_every": 1} for region in case["region"]]
        plan = merged(case, {"time": {"steps": 20}, "output": {"every": 20, "checkpoint_every": 13}})
        for title, asked, change, samples in (("same", "all", {}, 20), ("sides", "box", {"lower": [0.01, 0.02]}, 7),
                                              ("bins", "bins", {"bins": 5}, 7), ("every", "box", {"sample_every": 2}, 4)):
            here = self.killed(title, merged(plan, {"region": regions}))
            changed = [{**region, **(change if region["name"] == asked else {})} for region in regions]
            write(os.path.join(here, "case.nml"), namelist(merged(plan, {"region": changed})))
            run = gravier("--restart", "case.nml", ranks=1, directory=here)
            self.assert_status(run, 0)
            for region in changed:
                found = self.region(run, region["name"], 20).samples
                self.assertEqual(list(found), [samples if region["name"] == asked else 20] * len(found), title)

    def compare_samples(self, found, one):
        """Means over steps against those of each step. The mass in a bin is told by its momentum alone, so that of equal grains its solid
        fraction stands for it."""
        weight = np.array([state.solid_fraction * state.volume for state in one])
        for key in ("volume", "grains", "lower", "upper"):
            np.testing.assert_allclose(found[key], np.mean([state[key] for state in one], axis=0), rtol=1e-12, atol=1e-12, err_msg=key)
        whole = weight.sum(axis=0)
        for key in ("velocity", "granular_temperature"):
            values = np.array([state[key] for state in one])
            mean = np.einsum("sk,sk...->k...", weight, values) / np.where(whole > 0.0, whole, 1.0).reshape(-1, *[1] * (values.ndim - 2))
            np.testing.assert_allclose(found[key], mean, rtol=1e-9, atol=1e-12, err_msg=key)
        volume = np.array([state.volume for state in one])
        np.testing.assert_allclose(found.solid_fraction, whole / volume.sum(axis=0), rtol=1e-12)
        stress = np.array([state.stress for state in one])
        np.testing.assert_allclose(found.stress, np.einsum("sk,skab->kab", volume, stress) / volume.sum(axis=0)[:, None, None], rtol=1e-9,
                                   atol=1e-12 * np.abs(stress).max())

    def test_off(self):
        """A scene without regions has no columns and no groups more, and one with them nothing else that differs."""
        case = self.stirred(2)
        with_regions = self.play("with", case)
        without = self.play("without", {group: keys for group, keys in case.items() if group != "region"})
        plain = without.history()
        self.assertFalse([name for name in without.results() if "region" in name and "/run" not in name])
        self.assertEqual(len(with_regions.history()) - len(plain), 3 * (3 + 2 + 1 + 4 + 2))
        for name, values in plain.items():
            if not name.endswith("_seconds"):
                np.testing.assert_array_equal(with_regions.history()[name], values, name)
        self.assertEqual(steps_of(without.results()), steps_of(with_regions.results()))
        run = package.Run(os.path.join(with_regions.directory, "results"))
        self.assertEqual(run.regions(20), ["all", "bins", "box"])
        self.assertEqual(run.regions(0), [])
        with self.assertRaisesRegex(package.ResultsError, "no region lit in step 60; expected one of all, bins, box"):
            run.region("lit")

    def test_warning(self):
        path = grains(self.here("far.csv"), [[0.0, 0.0]])
        run = self.play("far", {**free(path), "region": [{"name": "away", "lower": [1.0, 1.0], "upper": [2.0, 2.0]}, {"name": "all"}]})
        self.assertEqual(run.stdout.count("no grain reaches into it"), 1)
        self.assertIn("warning     &region 'away': no grain reaches into it at the start", run.stdout)
        for name, values in run.history().items():
            if name.startswith("away_") and name != "away_volume":
                np.testing.assert_array_equal(values, 0.0, name)

    def test_refused(self):
        path = grains(self.here("one.csv"), [[0.0, 0.0]])
        case = free(path, period=[0.4, 0.0])
        box = {"name": "a", "lower": [0.0, 0.0], "upper": [0.1, 0.1]}
        lines = {
            "&region (the 1st) name is missing: expected a text in quotes": [{"lower": [0.0, 0.0]}],
            "name = '2x': expected letters, digits and underscores after a letter, at most 64 of them": [{**box, "name": "2x"}],
            "name = 'a,b': expected letters, digits": [{**box, "name": "a,b"}],
            "name = 'a/b': expected letters, digits": [{**box, "name": "a/b"}],
            "name = '': expected letters, digits": [{**box, "name": ""}],
            f"name = '{'a' * 65}': expected letters, digits": [{**box, "name": "a" * 65}],
            "&region (the 2nd, 'a') name = 'a': expected a name of its own, but the 1st has it too": [box, box],
            "&region (the 1st, 'a') upper = 0.1, 0.0: expected components above those of lower, here lower = 0.0, 0.0": [{**box, "upper": [0.1, 0.0]}],
            "&region (the 1st, 'a') lower = 0.0, 0.0, 1.0: expected a third component of 0": [{**box, "lower": [0.0, 0.0, 1.0]}],
            "&region (the 1st, 'a') lower = 1e+30: expected components below 1e30": [{"name": "a", "lower": [1e30]}],
            "&region (the 1st, 'a') axis is missing: expected 'x', 'y' or 'z', required by bins": [{**box, "bins": 3}],
            "&region (the 1st, 'a') bins is missing: expected an integer from 1 to 10000, required by axis": [{**box, "axis": "x"}],
            "&region (the 1st, 'a') bins = 0: expected an integer from 1 to 10000": [{**box, "bins": 0, "axis": "x"}],
            "&region (the 1st, 'a') bins = 10001: expected an integer from 1 to 10000": [{**box, "bins": 10001, "axis": "x"}],
            "&region (the 1st, 'a') axis = 'z': expected 'x' or 'y' in 2D": [{**box, "bins": 3, "axis": "z"}],
            "&region (the 1st, 'a') sample_every = 0: expected an integer >= 1": [{**box, "sample_every": 0}],
            "&region (the 1st, 'a') sample_every = 2: expected at most the steps between two written states, here every = 1":
                [{**box, "sample_every": 2}],
            "&region 'a': from 0.000E+00 m to 5.000E-01 m along x: expected a region with an inside, no longer than the period, 4.000E-01 m":
                [{**box, "upper": [0.5, 0.1]}],
            "&region 'a': from 6.000E-01 m to 4.000E-01 m along x: expected a region with an inside": [{"name": "a", "lower": [0.6]}],
            "&region 'a': from 1.000E+12 m to 1.000E+12 m along x: expected a region with an inside, no longer than the period, 4.000E-01 m, "
            "and within two periods of the cell": [{**box, "lower": [1e12, 0.0], "upper": [1e12 + 0.1, 1.0]}],
        }
        for line, regions in lines.items():
            with self.subTest(line):
                run = self.play("bad", {**case, "region": regions}, options=("--check",), status=2)
                self.assertEqual(len(run.stderr.splitlines()), 1, run.stderr)
                self.assertIn(line, run.stderr)


if __name__ == "__main__":
    unittest.main()
