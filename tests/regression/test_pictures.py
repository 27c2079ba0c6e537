"""What gravier_plot draws: axes that fit the data, colours that the colour-blind tell apart, legends that cover nothing, walls and numbers in
space, regions and their profiles; and, where a python3 with vtk is found ($GRAVIER_VTK_PYTHON, or the one that runs this), a picture by VTK."""
import itertools
import os
import subprocess
import sys
import types
import unittest
import unittest.mock
from types import SimpleNamespace

import matplotlib.colors
import matplotlib.image
import matplotlib.pyplot as plt
import numpy as np
from gravier_runs import SOURCE, RunTestCase, merged, write

import gravier

sys.path.insert(0, os.path.join(SOURCE, "drivers/plot"))
import curve_pictures  # noqa: E402
import gravier_plot  # noqa: E402
import packing_picture  # noqa: E402
import palette  # noqa: E402
import picture_space  # noqa: E402
from picture_style import SPEEDS, TURNS, PictureError, colours_of_kinds  # noqa: E402

VTK = next((python for python in (os.environ.get("GRAVIER_VTK_PYTHON"), sys.executable) if python
            and subprocess.run([python, "-c", "import vtk"], capture_output=True, check=False).returncode == 0), None)
#: what is left of linear colours to eyes without red, green or blue cones (Machado, Oliveira, Fernandes 2009, severity 1)
EYES = {"protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
        "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
        "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]}
DISKS = {"scene": {"bodies": "lattice", "lattice_count": [6, 6], "radius_min": 0.008, "radius_max": 0.012, "friction": 0.3,
                   "wall_material": "plate"},
         "material": [{"name": "sand"}, {"name": "plate"}],
         "law": [{"materials": ["sand", "sand"], "kind": "coulomb", "friction": 0.3}, {"materials": ["sand", "plate"], "kind": "coulomb",
                                                                                          "friction": 0.3}],
         "region": [{"name": "middle", "lower": [0.03, 0.02], "upper": [0.1, 0.08]}, {"name": "layers", "axis": "y", "bins": 4}],
         "time": {"step": 1e-3, "steps": 150},
         "output": {"directory": "results", "every": 50, "vtk": True}}
CYLINDER = {"scene": {"dimension": 3, "bodies": "file", "bodies_file": "bodies.csv"},
            "boundary": [{"name": "drum", "shape": "cylinder", "axis": [0.0, 1.0, 0.0], "point": [0.0, 0.0, 0.0], "radius": 0.1},
                         {"name": "front", "shape": "plane", "normal": [0.0, 1.0, 0.0]},
                         {"name": "back", "shape": "plane", "point": [0.0, 0.06, 0.0], "normal": [0.0, -1.0, 0.0]}],
            "region": [], "material": [], "law": [],
            "time": {"step": 1e-3, "steps": 1}, "output": {"directory": "results"}}


def lightness_and_hue(colours, eye=None):
    """CIELAB coordinates (n, 3) of colours of a screen, as such eyes see them."""
    colours = np.array(colours)[:, :3]
    linear = np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055)**2.4)
    if eye:
        linear = np.clip(linear @ np.array(EYES[eye]).T, 0.0, 1.0)
    xyz = linear @ np.array([[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]).T
    ratio = xyz / np.array([0.95047, 1.0, 1.08883])
    f = np.where(ratio > 216 / 24389, np.cbrt(ratio), (24389 / 27 * ratio + 16) / 116)
    return np.column_stack([116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])])


class Colours(unittest.TestCase):

    def test_kinds_and_curves(self):
        """No two colours of a list are alike to any eyes; a difference of 2 is just seen, one of 10 at a glance."""
        for name, colours in (("LINES", palette.LINES), ("KINDS", palette.KINDS), ("grades", ["#0072B2", "#B45F00", "#A3210F", "#666666"])):
            numbers = [[int(colour[k:k + 2], 16) / 255 for k in (1, 3, 5)] for colour in colours]
            for eye in (None, *EYES):
                seen = lightness_and_hue(numbers, eye)
                for (a, one), (b, other) in itertools.combinations(enumerate(seen), 2):
                    self.assertGreater(np.linalg.norm(one - other), 12.0, f"{name}: {colours[a]} and {colours[b]} to {eye} eyes")

    def test_maps(self):
        """Of quantities the lightness falls all the way, of those with a sign from the middle to both ends, to all eyes."""
        for eye in (None, *EYES):
            for cmap in (SPEEDS, curve_pictures.GREYS, *map(curve_pictures.times_of, range(5))):
                light = lightness_and_hue(cmap(np.linspace(0.0, 1.0, 33)), eye)[:, 0]
                self.assertTrue(np.all(np.diff(light) < 0.0), f"{cmap.name}: {eye}")
            light = lightness_and_hue(plt.get_cmap(TURNS)(np.linspace(0.0, 1.0, 33)), eye)[:, 0]
            self.assertTrue(np.all(np.diff(light[:15]) > 0.0) and np.all(np.diff(light[18:]) < 0.0), f"{TURNS}: {eye}")
        kinds = colours_of_kinds(20)
        found = [tuple(kinds["cmap"](kinds["norm"](number))) for number in range(1, 21)]
        self.assertEqual(len(set(found)), 16)
        self.assertEqual(found[16:], found[:4])


class Pictures(RunTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        gravier.run(DISKS, cls.here(cls, "disks"))
        gravier.run(merged(DISKS, {"time": {"steps": 60}}), cls.here(cls, "fewer"))
        os.makedirs(cls.here(cls, "cylinder"))
        write(cls.here(cls, "cylinder/bodies.csv"), "id,x,y,z,radius\n1,0,0.03,-0.08,0.02\n2,0.03,0.03,0,0.01\n")
        gravier.run(CYLINDER, cls.here(cls, "cylinder"))
        cls.disks, cls.cylinder = gravier.Run(cls.here(cls, "disks/results")), gravier.Run(cls.here(cls, "cylinder/results"))

    def options(self, **changes):
        return types.SimpleNamespace(**{"view": (-60.0, 20.0), "size": 5.0, "colour": "speed", "chains": False, "regions": False, "box": None, **changes})

    def boxes(self, figure, things):
        """Where things are on the picture, in points: (left, bottom, right, top) each."""
        figure.canvas.draw()
        return [thing.get_window_extent().extents for thing in things]

    def assert_apart(self, one, other, words):
        apart = one[2] <= other[0] + 1.0 or other[2] <= one[0] + 1.0 or one[3] <= other[1] + 1.0 or other[3] <= one[1] + 1.0
        self.assertTrue(apart, f"{words}: {one} and {other} overlap")

    def test_legends_cover_nothing(self):
        """Legends of curves and chains are over the panels, the bar of colours beside it, and none covers a title."""
        fewer = gravier.Run(self.here("fewer/results"))
        figures = [curve_pictures.draw_history([self.disks, fewer], ["iterations", "kinetic_energy"]),
                   packing_picture.draw_packing(self.disks, None, self.options(chains=True)),
                   curve_pictures.draw_profile(self.disks, "layers", None, ["solid_fraction", "velocity", "stress"], False)]
        for figure, number in zip(figures, (1, 1, 2)):
            legends = [axes.get_legend() for axes in figure.axes if axes.get_legend()]
            self.assertEqual(len(legends), number)
            panels = self.boxes(figure, [axes for axes in figure.axes if axes.get_visible()])
            for legend in self.boxes(figure, legends):
                for panel in panels:
                    self.assert_apart(legend, panel, "legend and panel")
            titles = self.boxes(figure, [axes.title for axes in figure.axes] + [axes._left_title for axes in figure.axes])
            for legend, title in itertools.product(self.boxes(figure, legends), titles):
                if title[2] - title[0] > 1.0:
                    self.assert_apart(legend, title, "legend and title")
            plt.close(figure)

    def test_colours_of_bodies(self):
        bodies = self.disks.bodies()
        values, label, how = packing_picture.colours(self.disks, 150, bodies, "velocity_y")
        factor = values[0] / bodies.velocity[0, 1]
        np.testing.assert_allclose(values, factor * bodies.velocity[:, 1], rtol=1e-12)
        self.assertIn("velocity along y", label)
        self.assertEqual(how["norm"].vmin, -how["norm"].vmax)
        with self.assertRaisesRegex(PictureError, "a scene of the plane has no velocity_z; expected velocity_x or velocity_y"):
            packing_picture.colours(self.disks, 150, bodies, "velocity_z")
        for keys, names in (({"grid": [2, 2]}, "1234"), ({"subdomains": 3}, "123"), ({}, "12")):
            run = types.SimpleNamespace(dimension=2, case={"decomposition": [keys]}, subdomain=lambda step: np.array([1, 2]))
            self.assertEqual("".join(packing_picture.kinds(run, 0, bodies, "subdomain")[1]), names, "a subdomain without a body has its colour")
        figure = packing_picture.draw_packing(self.disks, None, self.options(colour="material"))
        figure.canvas.draw()
        bar = figure.axes[0].child_axes[0]
        # each band of the bar has its name, also where no body has the material
        self.assertEqual([text.get_text() for text in bar.get_yticklabels()], ["sand", "plate"])
        plt.close(figure)

    def test_at_rest(self):
        """Colours end at speeds that are told from errors of the solve: bodies at rest are not coloured by rounding."""
        bodies, scale = self.disks.bodies(150), self.disks.history().velocity_scale[-1]
        rest = gravier.Table({**bodies, "velocity": 1e-18 * np.arange(bodies.velocity.size).reshape(bodies.velocity.shape), "spin": 1e-18 * bodies.spin})
        for kind, top in (("speed", 0.1 * scale), ("velocity_y", 0.1 * scale), ("rotation", 0.1 * scale / bodies.radius.mean())):
            values, label, how = packing_picture.colours(self.disks, 150, rest, kind)
            power = 1.0 if "10^" not in label else 10.0**int(label.split("{")[1].split("}")[0])
            self.assertAlmostEqual(how["norm"].vmax * power / top, 1.0, 12, kind)
            self.assertLess(np.abs(values).max() * power, 1e-12)
        faster = packing_picture.spread(np.linalg.norm(self.disks.bodies(50).velocity, axis=1), "speed", 0.1 * scale)
        self.assertGreater(faster[1], scale)

    def test_part(self):
        """A box shows the bodies that reach into it, of a 3D scene a slice of those whose centres are in it, and colours fit these."""
        bodies = self.disks.bodies()
        middle = np.median(bodies.position, axis=0)
        numbers = [middle[0] - 0.02, middle[0] + 0.02, middle[1] - 0.02, middle[1] + 0.02]
        figure = packing_picture.draw_packing(self.disks, None, self.options(box=numbers, chains=True))
        reach = bodies.radius[:, None]
        inside = np.all((bodies.position + reach >= middle - 0.02) & (bodies.position - reach <= middle + 0.02), axis=1)
        drawn = next(one for one in figure.axes[0].collections if isinstance(one, matplotlib.collections.EllipseCollection))
        np.testing.assert_array_equal(drawn.get_offsets(), bodies.position[inside])
        self.assertTrue(3 < inside.sum() < len(bodies) / 2)
        self.assertIn(f"{inside.sum()} of 36 disks", figure.axes[0].get_title(loc="left"))
        self.assertLess(np.ptp(figure.axes[0].get_xlim()), 0.05)
        segments = np.concatenate([one.get_segments() for one in figure.axes[0].collections if isinstance(one, matplotlib.collections.LineCollection)
                                   and len(one.get_segments()) > 0])
        self.assertTrue(np.all(np.min(np.linalg.norm(segments - middle, axis=2), axis=1) < 0.03))
        plt.close(figure)
        slice_of = [-0.1, 0.1, 0.0, 0.06, -0.1, -0.05]
        figure = packing_picture.draw_packing(self.cylinder, None, self.options(box=slice_of))
        self.assertIn("1 of 2 spheres", figure.axes[0].get_title(loc="left"))
        plt.close(figure)
        for run, box, words in ((self.disks, [0, 1, 0], "--box 0 1 0: expected 4 numbers, X0 X1 Y0 Y1, the lower one of each two first"),
                                (self.disks, [1, 0, 0, 1], "--box 1 0 0 1: expected 4 numbers"),
                                (self.cylinder, [0, 1, 0, 1], "--box 0 1 0 1: expected 6 numbers, X0 X1 Y0 Y1 Z0 Z1"),
                                (self.disks, [7, 8, 7, 8], "no body in this --box; expected one at least of those from")):
            with self.assertRaisesRegex(PictureError, words):
                packing_picture.draw_packing(run, None, self.options(box=box))
        # a movie in some of whose pictures the box is empty, and numbers that begin with a minus
        high = self.disks.bodies(0).position[:, 1].max()
        self.assertLess((self.disks.bodies(150).position[:, 1] + self.disks.bodies(150).radius).max(), high)
        for colour in ("speed", "radius", "material"):
            options = self.options(box=[-1.0, 1.0, high, high + 1.0], colour=colour, chains=True)
            frame = packing_picture.shared_frame(self.disks, [0, 150], options)
            for step in (0, 150):
                plt.close(packing_picture.draw_packing(self.disks, step, options, frame))
        self.assertEqual(gravier_plot.parse(["packing", "run", "--box", "-1e-3", "0.5", "-.1", "5"]).box, [-1e-3, 0.5, -0.1, 5.0])
        # facets of meshes outside of it
        walls = picture_space.Walls(self.cylinder, 0)
        walls.facets = np.array([np.eye(3), np.eye(3) + 5.0])
        walls.keep(np.zeros(3), np.ones(3))
        np.testing.assert_array_equal(walls.facets, [np.eye(3)])

    def test_against(self):
        """Curves against another column than the time."""
        figure = curve_pictures.draw_history([self.disks], ["kinetic_energy", "contacts"], "max_overlap")
        history = self.disks.history()
        for axes, name in zip(figure.axes, ("kinetic_energy", "contacts")):
            np.testing.assert_array_equal(axes.lines[0].get_xydata(), np.column_stack([history.max_overlap, history[name]]))
        self.assertEqual(figure.axes[1].get_xlabel(), "largest overlap [$10^{-6}$ m]")
        plt.close(figure)
        with self.assertRaisesRegex(PictureError, "history.csv: no column strain; expected one of"):
            curve_pictures.draw_history([self.disks], ["contacts"], "strain")
        figure = curve_pictures.draw_history([self.disks], ["contacts"], mean=50)
        np.testing.assert_array_equal(figure.axes[0].lines[0].get_xydata()[:, 1], history.contacts.reshape(3, 50).mean(axis=1))
        plt.close(figure)
        figure = curve_pictures.draw_history([self.disks], ["contacts"])
        self.assertEqual(figure.axes[0].get_xlabel(), "time [s]")
        plt.close(figure)

    def test_narrow(self):
        """The bar of colours of a picture that is ten times as high as wide can be read, and its title is not much wider than the picture."""
        column = {"scene": {"bodies": "column", "column_count": 20, "radius": 0.01, "wall_material": None}, "material": [], "law": [], "region": [],
                  "time": {"step": 1e-3, "steps": 10}, "output": {"vtk": False}}
        gravier.run(merged(DISKS, {"scene": {"lattice_count": None, "radius_min": None, "radius_max": None}}, column), self.here("column"))
        figure = packing_picture.draw_packing(gravier.Run(self.here("column/results")), None, self.options())
        box = self.boxes(figure, [figure.axes[0].child_axes[0]])[0]
        self.assertGreater((box[2] - box[0]) / figure.dpi, 0.08)
        contacts = gravier.Run(self.here("column/results")).contacts()
        self.assertEqual(" ".join(figure.axes[0].get_title(loc="left").split()), f"step 10, t = 0.01 s: 20 disks, {len(contacts)} carrying contacts")
        # what bears no force does not count
        contacts["impulse"][:7] = 0.0
        run = gravier.Run(self.here("column/results"))
        self.assertEqual(packing_picture.title_of(run, 10, run.bodies(), contacts, None), f"step 10, t = 0.01 s: 20 disks, {len(contacts) - 7} carrying contacts")
        title = self.boxes(figure, [figure.axes[0]._left_title])[0]
        self.assertLess((title[2] - title[0]) / figure.dpi, figure.get_figwidth())
        plt.close(figure)

    def test_pulls(self):
        """Bonds that pull are drawn, as thick as their force, in a colour of their own."""
        case = {"scene": {"bodies": "column", "column_count": 4, "radius": 0.01, "gravity": [0.0, 9.81], "wall_material": "m"},
                "material": [{"name": "m"}], "law": [{"materials": ["m"], "kind": "bonded", "bond_strength": 1e3, "bond_friction": 0.5, "bond_distance": 1e-6}],
                "time": {"step": 1e-3, "steps": 5}, "output": {"directory": "results", "every": 5, "contacts": True}}
        self.assertEqual(gravier.run(case, self.here("hanging")), 0)
        figure = packing_picture.draw_packing(gravier.Run(self.here("hanging/results")), None, self.options(chains=True))
        drawn = next(one for one in figure.axes[0].collections if hasattr(one, "get_segments") and one.get_segments()
                     and tuple(one.get_colors()[0]) == matplotlib.colors.to_rgba(palette.PULLS))
        np.testing.assert_allclose(sorted(drawn.get_linewidths()), packing_picture.WIDEST * np.array([0.25, 0.5, 0.75, 1.0]), rtol=1e-3)
        self.assertRegex(figure.axes[0].get_legend().get_texts()[0].get_text(), r"^pull \S+ N$")
        plt.close(figure)

    def test_cell_that_moves(self):
        """The whole outline of a sheared cell is on the picture."""
        case = {"scene": {"bodies": "lattice", "lattice_count": [5, 5], "radius_min": 0.008, "radius_max": 0.008, "period": [0.1, 0.1],
                          "cell_shear_rate": 5.0, "gravity": [0.0, 0.0]},
                "time": {"step": 1e-3, "steps": 100}, "output": {"directory": "results", "every": 100}}
        self.assertEqual(gravier.run(case, self.here("sheared")), 0)
        run = gravier.Run(self.here("sheared/results"))
        corners = packing_picture.cell_corners(run, 100)
        self.assertGreater(np.ptp(corners[:, 0]), 0.12)
        figure = packing_picture.draw_packing(run, None, self.options())
        limits = np.array([figure.axes[0].get_xlim(), figure.axes[0].get_ylim()]).T
        self.assertTrue(np.all(corners >= limits[0]) and np.all(corners <= limits[1]))
        # all disks stand in the cell that is drawn, though the run keeps them in an upright box, and chains begin at their centres
        cell = run.cell(100)
        parts = [(points - corners[0]) @ np.linalg.inv(cell.edge) for points in (run.bodies(100).position, np.asarray(figure.axes[0].collections[0].get_offsets()))]
        self.assertFalse(np.all((parts[0] >= 0.0) & (parts[0] <= 1.0)))
        self.assertTrue(np.all((parts[1] >= -1e-12) & (parts[1] <= 1.0 + 1e-12)))
        plt.close(figure)

    def test_walls_that_turn(self):
        """A segment that turns about its middle, and a cylinder whose axis does, are drawn as they lie, and a gate up to the step before it goes."""
        flat = {"scene": {"bodies": "lattice", "lattice_count": [1, 1], "radius_min": 0.01, "radius_max": 0.01, "gravity": [0.0, 0.0]},
                "boundary": [{"name": "bar", "shape": "segment", "point": [1.0, 1.0], "end": [3.0, 1.0], "pivot": [2.0, 1.0], "rotation": 1.0},
                             {"name": "gate", "shape": "plane", "point": [0.0, -1.0], "normal": [0.0, 1.0], "remove_at": 0.5},
                             {"name": "none", "shape": "plane", "point": [0.0, -1.0], "normal": [0.0, 1.0], "remove_at": 0.0}],
                "time": {"step": 1e-2, "steps": 100}, "output": {"directory": "results", "every": 10}}
        space = {"scene": {**flat["scene"], "dimension": 3, "lattice_count": [1, 1, 1], "gravity": [0.0, 0.0, 0.0]},
                 "boundary": [{"name": "drum", "shape": "cylinder", "point": [0.0, 0.0, 0.0], "axis": [0.0, 2.0, 0.0], "radius": 5.0, "rotation": [1.0, 0.0, 0.0]},
                              {"name": "plate", "shape": "rectangle", "point": [1.0, 0.0, 0.0], "edge_a": [2.0, 0.0, 0.0], "edge_b": [0.0, 1.0, 0.0],
                               "pivot": [1.0, 0.0, 0.0], "rotation": [1.0, 0.0, 0.0]}],
                 "time": flat["time"], "output": flat["output"]}
        along = np.array([np.cos(1.0), np.sin(1.0)])
        for name, case in (("bar", flat), ("drum", space)):
            self.assertEqual(gravier.run(case, self.here(name)), 0)
            walls = picture_space.Walls(gravier.Run(self.here(name + "/results")), 100)
            if name == "bar":
                np.testing.assert_allclose(list(walls.polygons()), [[[2.0, 1.0] - along, [2.0, 1.0] + along]], rtol=1e-9)
                for step, there in ((0, True), (50, True), (60, False)):
                    names = picture_space.Walls(gravier.Run(self.here(name + "/results")), step).rows.name.tolist()
                    self.assertEqual(["gate" in names, "none" in names], [there, False])
            else:
                np.testing.assert_allclose([axis for _, axis, _ in walls.cylinders()], [[0.0, *along]], atol=1e-9)
                corners = np.array([[1.0, 0.0, 0.0], [3.0, 0.0, 0.0], [3.0, *along], [1.0, *along]])
                np.testing.assert_allclose(list(walls.polygons()), [corners], atol=1e-9)

    def test_walls_in_space(self):
        """The box holds the whole drum between its planes; circles are drawn at both ends; numbers lie on no other and on no body."""
        bodies, walls = self.cylinder.bodies(), picture_space.Walls(self.cylinder, 1)
        low, high = picture_space.box_around(bodies, walls)
        np.testing.assert_allclose([low, high], [[-0.1, 0.0, -0.1], [0.1, 0.06, 0.1]], atol=1e-12)
        # balls around bodies with shapes reach through the planes, and do not move the faces of the box away from them
        wide = gravier.Table({**bodies, "radius": np.full(2, 0.05)})
        np.testing.assert_allclose([one[1] for one in picture_space.box_around(wide, walls)], [0.0, 0.06], atol=1e-12)
        figure = packing_picture.draw_packing(self.cylinder, None, self.options())
        axes = figure.axes[0]
        view = picture_space.View(3, -60.0, 20.0)
        for y in (0.0, 0.06):
            ring = view.place(np.array([[0.1 * np.cos(a), y, 0.1 * np.sin(a)] for a in np.linspace(0.0, 6.28, 30)]))
            drawn = [patch.get_xy() for patch in axes.patches]
            self.assertTrue(any(all(np.linalg.norm(points - place, axis=1).min() < 0.004 for place in ring) for points in drawn), f"no circle at y = {y}")
        # two planes are behind the drum or before it: one face of the box is grey
        grey = [patch for patch in axes.patches if patch.get_facecolor()[:3] == (0.94, 0.94, 0.94)]
        self.assertEqual(len(grey), 1)
        numbers = [text for text in axes.texts if text.get_text()]
        self.assertEqual(sorted(text.get_text() for text in numbers if "[m]" in text.get_text()), ["x [m]", "y [m]", "z [m]"])
        self.assertGreater(len(numbers), 9)
        places = self.boxes(figure, numbers)
        for (a, one), (b, other) in itertools.combinations(enumerate(places), 2):
            self.assert_apart(one, other, f"{numbers[a].get_text()} and {numbers[b].get_text()}")
        centres = axes.transData.transform(view.place(bodies.position))
        reach = np.linalg.norm(axes.transData.transform([[1.0, 0.0]]) - axes.transData.transform([[0.0, 0.0]])) * bodies.radius
        for box, (centre, radius) in itertools.product(places, zip(centres, reach)):
            self.assert_apart(box, (*(centre - radius), *(centre + radius)), "a number and a sphere")
        plt.close(figure)

    def test_rectangles_among_bodies(self):
        """Bodies hide the pieces of the outline of a rectangle that lie behind them, and none that lie before them or beside them; transparent ones
        hide nothing. A body with a shape hides what its faces cover, not what the sphere around it covers."""
        square = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
        walls = SimpleNamespace(planes=lambda: (np.zeros((0, 3)), np.zeros((0, 3))), polygons=lambda: [square], cylinders=lambda: [], facets=np.zeros((0, 3, 3)))
        view, corners = picture_space.View(3, 0.0, 90.0), np.array([[x, y, z] for x in (-0.2, 0.2) for y in (-0.2, 0.2) for z in (-0.2, 0.2)])
        box = [corners[[0, 1, 3, 2]], corners[[4, 6, 7, 5]], corners[[0, 4, 5, 1]], corners[[2, 3, 7, 6]], corners[[0, 2, 6, 4]], corners[[1, 5, 7, 3]]]
        for height, shaped, reach in ((0.5, False, 0.5), (-0.6, False, 0.0), (0.5, True, 0.2), (-0.3, True, 0.0), (0.5, None, 0.0)):
            bodies = gravier.Table({"position": np.array([[1.0, 0.0, height]]), "radius": np.array([0.5])})
            figure, axes = plt.subplots()
            found = [[face + bodies.position[0] for face in box]] if shaped else None
            picture_space.draw_space(axes, view, walls, np.array([-2.0, -2.0, -3.0]), np.array([2.0, 2.0, 1.0]), None if shaped is None else bodies, found)
            pieces = np.concatenate([collection.get_segments() for collection in axes.collections] or [np.zeros((0, 2, 2))]).reshape(-1, 2, 2)
            drawn = np.linalg.norm(pieces[:, 1] - pieces[:, 0], axis=1).sum()
            self.assertAlmostEqual(drawn, 0.0 if shaped is None else 8.0 - 2.0 * reach, delta=0.07, msg=f"{height} {shaped}")
            self.assertEqual(len([patch for patch in axes.patches if len(patch.get_xy()) == 5 and np.ptp(patch.get_xy()) == 2.0]), 1 if shaped is None else 0)
            plt.close(figure)

    def test_planes_within_the_box(self):
        """A plane along the axes that is no face of the box is drawn: filled behind its bodies, an outline before them."""
        rows = gravier.Table({"shape": np.array(["plane"] * 4), "position": np.array([[0.5, 0.0, 0.0], [0.7, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
                              "normal": np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]])})
        walls = SimpleNamespace(planes=lambda: (rows.position, rows.normal), polygons=lambda: [], cylinders=lambda: [], facets=np.zeros((0, 3, 3)))
        view = picture_space.View(3, 20.0, 20.0)
        figure, axes = plt.subplots()
        low, high = np.zeros(3), np.ones(3)
        picture_space.draw_space(axes, view, walls, low, high)
        drawn = {}
        for patch in axes.patches:
            for x in (0.5, 0.7):
                corners = view.place(np.array([[x, y, z] for y in (0.0, 1.0) for z in (0.0, 1.0)]))
                if all(np.linalg.norm(patch.get_xy() - corner, axis=1).min() < 1e-9 for corner in corners):
                    drawn[x] = patch.get_facecolor()
        self.assertEqual(sorted(drawn), [0.5, 0.7])
        self.assertEqual([drawn[0.5][3], drawn[0.7][3]], [1.0, 0.0])
        # the floor is a face, and a plane on the far face that looks away from the box is none of its walls
        self.assertEqual([picture_space.is_face(point, normal, low, high) for point, normal in zip(rows.position, rows.normal)], [False, False, True, False])
        plt.close(figure)

    def test_cut_box(self):
        """A plane through the middle of a cube across its diagonal cuts a regular hexagon out of it."""
        points = picture_space.cut_box(np.full(3, 0.5), np.full(3, 3.0**-0.5), np.zeros(3), np.ones(3))
        self.assertEqual(len(points), 6)
        sides = np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1)
        np.testing.assert_allclose(sides, np.full(6, 0.5**0.5), rtol=1e-12)
        self.assertEqual(len(picture_space.cut_box(np.full(3, 5.0), np.full(3, 3.0**-0.5), np.zeros(3), np.ones(3))), 0)

    def test_regions(self):
        """Boxes are where the means are taken; regions of insertion make the picture larger; entries may be given one by one."""
        figure = packing_picture.draw_packing(self.disks, None, self.options(regions=True))
        lines = np.concatenate([segment for one in figure.axes[0].collections if hasattr(one, "get_segments") for segment in one.get_segments()])
        rows = self.disks.region("layers")
        for corner in (*rows.lower, *rows.upper, [0.03, 0.02], [0.1, 0.08]):
            self.assertLess(np.linalg.norm(lines - corner, axis=1).min(), 1e-12, corner)
        self.assertEqual([text.get_text() for text in figure.axes[0].texts], ["region middle", "region layers"])
        # the corner of the upper one is above the picture, and its name is in it
        for text in figure.axes[0].texts:
            place = np.array([text.xy, text.xy])
            np.testing.assert_array_equal(place, np.clip(place, *np.transpose([figure.axes[0].get_xlim(), figure.axes[0].get_ylim()])))
        plt.close(figure)
        # the start has no means: its bins are cut from the scene, whose lower end is the floor
        figure = packing_picture.draw_packing(self.disks, 0, self.options(regions=True))
        cuts = np.concatenate([segment for one in figure.axes[0].collections if hasattr(one, "get_segments") for segment in one.get_segments()
                               if matplotlib.colors.to_hex(one.get_colors()[0]) == "#000000"])
        bodies, floor = self.disks.bodies(0), self.disks.boundaries(0).position[:, 1].min()
        for place in np.linspace(floor, (bodies.position[:, 1] + bodies.radius).max(), 5):
            self.assertLess(np.abs(cuts[:, 1] - place).min(), 1e-9, place)
        plt.close(figure)
        case = {"insertion": [{"lower": [0.0, 1.0], "upper(1)": 2.0, "upper(2)": 3.0}, {"region": "ball", "centre": [5.0, 5.0], "region_radius": 1.0}]}
        np.testing.assert_array_equal(packing_picture.region_corners(case, 2), [[0, 1], [2, 3], [4, 4], [6, 6]])
        np.testing.assert_array_equal(gravier.entries({"a(2:3)": [7, 8], "b": 1}, "a", [0, 0, 0]), [0, 7, 8])
        np.testing.assert_array_equal(gravier.entries({"a": [None, 5]}, "a", [1, 2, 3]), [1, 5, 3])

    def test_profiles(self):
        """Curves are the means of the bins, the mean is that over the steps."""
        rows = [self.disks.region("layers", step) for step in (50, 100, 150)]
        figure = curve_pictures.draw_profile(self.disks, None, [150], ["solid_fraction", "velocity", "stress"], False)
        curves = [[line.get_xdata() for line in axes.lines] for axes in figure.axes]
        np.testing.assert_array_equal(curves[0], [rows[2].solid_fraction])
        np.testing.assert_array_equal(curves[1], rows[2].velocity.T)
        np.testing.assert_array_equal(curves[2], [rows[2].stress[:, 0, 0], rows[2].stress[:, 1, 1], rows[2].stress[:, 0, 1]])
        np.testing.assert_array_equal(figure.axes[0].lines[0].get_ydata(), rows[2].centre[:, 1])
        plt.close(figure)
        figure = curve_pictures.draw_profile(self.disks, "layers", None, ["pressure"], True)
        np.testing.assert_allclose(figure.axes[0].lines[0].get_xdata(), np.mean([row.pressure for row in rows], axis=0), rtol=1e-12)
        self.assertIn("step 50 to 150: mean of 3 states", figure._suptitle.get_text())
        plt.close(figure)
        figure = curve_pictures.draw_profile(self.disks, "layers", "all", ["pressure"], False)
        self.assertEqual(len(figure.axes[0].lines), 3)
        plt.close(figure)
        gravier_plot.main(["profile", self.here("disks/results"), "--steps", "60:", "--out", self.here("profile.png")])
        self.assertGreater(matplotlib.image.imread(self.here("profile.png"))[:, :, :3].std(), 0.03)
        for name, columns, words in (("middle", ["pressure"], "no region middle with bins; expected one of layers"),
                                     (None, ["speed"], "no column speed of a profile; expected one of solid_fraction")):
            with self.assertRaisesRegex(PictureError, words):
                curve_pictures.draw_profile(self.disks, name, None, columns, False)
        with self.assertRaisesRegex(gravier.ResultsError, "no region layers/stress in step 150; expected one of layers, middle$"):
            self.disks.region("layers/stress")
        with self.assertRaisesRegex(PictureError, "no single region has bins; expected one of none, the case has none"):
            curve_pictures.draw_profile(self.cylinder, None, None, ["pressure"], False)

    def test_numbers_of_neighbours(self):
        """Numbers below panels side by side do not touch."""
        figure = curve_pictures.draw_profile(self.disks, "layers", [150], ["velocity", "solid_fraction", "stress", "pressure"], False)
        for axes, value in zip(figure.axes, (-1.04, 0.8, 6700.0, 123456.0)):
            axes.set_xlim(min(0.0, value), max(0.13, value))
        figure.canvas.draw()
        numbers = [self.boxes(figure, [label for label, place in zip(axes.get_xticklabels(), axes.get_xticks()) if axes.get_xlim()[0] <= place <= axes.get_xlim()[1]])
                   for axes in figure.axes]
        for left, right in zip(numbers, numbers[1:]):
            self.assertLess(max(box[2] for box in left) + 2.0, min(box[0] for box in right))
        plt.close(figure)

    def test_shared_colours(self):
        """The colours of a movie are those of 98 % of the bodies of all of its states together: one fast state does not make the others pale."""
        speeds = {step: np.linspace(0.0, 1.0, 40) * (500.0 if step == 7 else 1.0) for step in range(100)}
        scene = SimpleNamespace(path="run", dimension=2, case={}, region=None)
        with unittest.mock.patch.multiple(packing_picture, error_speeds=lambda run: {}, Walls=lambda run, step: None, points_of=lambda *_: (),
                                          bodies_shown=lambda run, step: step, frame_around=lambda *_: (np.zeros(2), np.ones(2)),
                                          quantity=lambda run, step, bodies, kind: (speeds[step], "m/s", "speed"), least_colour=lambda *_: 0.0):
            frame = packing_picture.shared_frame(scene, list(speeds), self.options(chains=False))
        self.assertEqual(frame.limits[0], 0.0)
        self.assertTrue(0.9 < frame.limits[1] <= 1.0, frame.limits)

    def test_empty_bins(self):
        """A bin without grains has no velocity: curves have a gap."""
        def rows(fractions, speeds):
            return gravier.results.Table(solid_fraction=np.array(fractions), velocity=np.array([[0.0, speed] for speed in speeds]), grains=np.array(fractions))
        np.testing.assert_array_equal(curve_pictures.components(rows([0.5, 0.0, 0.0], [-1.0, 0.0, 0.0]), "velocity", 2, 1)["y"], [-1.0, np.nan, np.nan])
        np.testing.assert_array_equal(curve_pictures.components(rows([0.5, 0.0, 0.0], [-1.0, 0.0, 0.0]), "solid_fraction", 2, 1)[None], [0.5, 0.0, 0.0])

    def test_components_of_profiles(self):
        """The shear stresses are those across the axis of the bins; a component is a column of its own, with its unit."""
        rows = gravier.Table(stress=np.arange(27.0).reshape(3, 3, 3), velocity=np.ones((3, 3)), solid_fraction=np.array([0.5, 0.5, 0.0]))
        for axis, names in enumerate((["xy", "xz"], ["xy", "yz"], ["xz", "yz"])):
            found = curve_pictures.components(rows, "stress", 3, axis)
            self.assertEqual(list(found), ["xx", "yy", "zz", *names])
            for name, values in found.items():
                np.testing.assert_array_equal(values, rows.stress[:, "xyz".index(name[0]), "xyz".index(name[1])])
        np.testing.assert_array_equal(curve_pictures.components(rows, "stress_yx", 3, 2)[None], rows.stress[:, 1, 0])
        np.testing.assert_array_equal(curve_pictures.components(rows, "velocity_z", 3, 2)[None], [1.0, 1.0, np.nan])
        # of several states each of the five has a dash and a colour of its own
        figure, axes = plt.subplots()
        states = gravier.Table({**rows, "centre": np.zeros((3, 3))})
        with unittest.mock.patch.object(axes, "plot") as plot:
            curve_pictures.draw_column(axes, 3, [states, states], "stress", 2, [0.0, 1.0])
        self.assertEqual(len({str(call.kwargs["linestyle"]) for call in plot.call_args_list[:5]}), 5)
        self.assertEqual(len({str(call.kwargs["color"]) for call in plot.call_args_list}), 10)
        plt.close(figure)
        figure = curve_pictures.draw_profile(self.disks, "layers", None, ["stress_xy", "velocity_x"], False)
        self.assertEqual([axes.get_xlabel().split(" [")[0] for axes in figure.axes], ["stress xy", "velocity x"])
        np.testing.assert_array_equal(figure.axes[0].lines[0].get_xdata(), self.disks.region("layers").stress[:, 0, 1])
        plt.close(figure)
        with self.assertRaisesRegex(PictureError, "no column stress_xz of a profile; expected one of .*velocity_y, stress_xx, stress_xy, stress_yx, stress_yy$"):
            curve_pictures.draw_profile(self.disks, "layers", None, ["stress_xz"], False)

    def test_colours_of_states(self):
        """A state has the colour that the bar gives to its time, in whatever order and at whatever distances the steps are told."""
        for steps in ([150, 50], [100, 50, 150], "all"):
            figure = curve_pictures.draw_profile(self.disks, "layers", steps, ["pressure"], False)
            panel, bar = figure.axes
            shades = curve_pictures.TIMES((bar.get_ylim()[1] - np.array([0.05, 0.1, 0.15])) / -np.ptp(bar.get_ylim()) + 1.0)
            for line in panel.lines:
                step = next(step for step in (50, 100, 150) if np.array_equal(self.disks.region("layers", step).pressure, line.get_xdata()))
                np.testing.assert_allclose(line.get_color(), shades[step // 50 - 1], atol=0.01, err_msg=f"{steps}: step {step}")
            self.assertIn(f"step 50 to 150: {len(panel.lines)} states", figure._suptitle.get_text())
            plt.close(figure)

    @unittest.skipUnless(VTK, "NO VTK: no python3 with vtk; set GRAVIER_VTK_PYTHON")
    def test_by_vtk(self):
        """A scene in 2D fills its picture, with a legend of the colours beside it."""
        out = self.here("vtk.png")
        done = subprocess.run([VTK, os.path.join(SOURCE, "drivers/plot/render_vtk.py"), self.here("disks/results"), "--out", out], capture_output=True,
                              text=True, check=False)
        self.assertEqual((done.returncode, done.stdout), (0, out + "\n"), done.stderr)
        picture = matplotlib.image.imread(out)[:, :, :3]
        height, width = picture.shape[:2]
        blue = (picture[:, :, 2] > picture[:, :, 0] + 0.01)
        scene, legend = blue[:, :width - 150], blue[:, width - 150:]
        for axis in (0, 1):
            found = np.flatnonzero(scene.any(axis=axis))
            self.assertGreater(np.ptp(found), 0.75 * scene.shape[1 - axis])
        self.assertGreater(np.ptp(np.flatnonzero(legend.any(axis=1))), 0.6 * height)


if __name__ == "__main__":
    unittest.main()
