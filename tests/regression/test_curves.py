"""Curves of gravier_plot: the limits and labels of axes, and the steps of a profile."""
import contextlib
import io
import os
import pathlib
import sys
import unittest
from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np
from gravier_runs import SOURCE

sys.path.insert(0, os.path.join(SOURCE, "drivers/plot"))
import curve_pictures  # noqa: E402
import gravier  # noqa: E402
import gravier_plot  # noqa: E402


class Axes(unittest.TestCase):

    def test_limits(self):
        flat = np.full(50, 3.0)
        for values, scale, low, high in ((np.linspace(0.0, 2.0, 11), "linear", 0.0, 2.1), (np.linspace(10.0, 11.0, 11), "linear", 9.95, 11.05),
                                         (flat, "linear", 2.85, 3.15), (np.zeros(3), "linear", -0.5, 0.5),
                                         (np.linspace(-2.0, 0.0, 5), "linear", -2.1, 0.0), (np.array([np.nan]), "linear", 0.0, 1.0),
                                         (np.geomspace(1e-4, 1.0, 41), "log", 1e-4 / 1.5, 1.5)):
            found = curve_pictures.limits_of(values)
            self.assertEqual(found[0], scale)
            np.testing.assert_allclose(found[1:], (low, high), rtol=1e-12)
        # a few small values do not make logarithms, and on logarithms they do not take the space of the others
        self.assertEqual(curve_pictures.limits_of(np.append(flat, [1e-12, 1e-9]))[0], "linear")
        scale, low, _ = curve_pictures.limits_of(np.append(np.geomspace(1e-3, 1.0, 99), 1e-30))
        self.assertEqual(scale, "log")
        self.assertGreater(low, 1e-7)
        self.assertEqual(curve_pictures.limits_of(np.geomspace(1e-4, 1.0, 41), logarithms=False)[:2], ("linear", 0.0))
        # a value of 0 has no logarithm
        growing = np.append(0.0, np.geomspace(1e-4, 1.0, 41))
        self.assertEqual(curve_pictures.limits_of(growing)[:2], ("linear", 0.0))
        self.assertEqual(curve_pictures.limits_of(growing, zeros=True)[0], "log")

    def test_labels(self):
        for name, dimension, label in (("kinetic_energy", 2, "kinetic energy [J]"), ("max_overlap", 2, "largest overlap [m]"), ("contacts", 2, "contacts"),
                                       ("layers_pressure", 2, "layers pressure [N/m]"), ("stress_xx", 3, "stress xx [Pa]"),
                                       ("force_x:lid", 3, "force x on lid [N]"), ("moment_z:drum", 2, "moment z on drum [N m]"), ("power:drum", 2, "power of drum [W]"),
                                       ("spin_z:drum", 3, "spin z of drum [rad/s]"), ("velocity_x:lid", 3, "velocity x of lid [m/s]"), ("body_omega:12", 2, "spin of body 12 [rad/s]"), ("body_fx:12", 2, "force x on body 12 [N]"), ("body_y:3", 2, "place y of body 3 [m]"), ("left", 2, "grains that leave in a step"), ("dissipated_friction", 2, "dissipated by friction [J]"), ("force_max", 3, "largest normal force [N]"), ("energy_error", 2, "energy error [J]"),
                                       ("layers_velocity_x", 2, "layers velocity x [m/s]"), ("layers_volume", 3, "layers volume [m³]"),
                                       ("load_work", 2, "load work [J]"), ("boundary_work", 3, "boundary work [J]"),
                                       ("force_x:hard_work", 2, "force x on hard work [N]")):
            self.assertEqual(curve_pictures.label_of(name, dimension), label)
        for name, label in (("stress_xx", "stress xx [N/m in 2D, Pa in 3D]"), ("kinetic_energy", "kinetic energy [J]")):
            self.assertEqual(curve_pictures.label_of_all(name, [3, 2, 3]), label)
        figure, axes = plt.subplots()
        curve_pictures.Panel("energy [J]", [(np.arange(99), np.geomspace(1e-3, 1.0, 99), "a"), (np.arange(99), np.zeros(99), "b"),
                                            (np.arange(2), np.array([1.0, 1e-30]), "c")], zeros=True).draw(axes)
        self.assertEqual([text.get_text() for text in axes.get_legend().get_texts()], ["a", "b: 0", "c"])
        self.assertEqual([text.get_text() for text in axes.texts], ["values go down to 1e-30"])
        plt.close(figure)
        figure, axes = plt.subplots()
        curve_pictures.Panel("residual", [(np.arange(42), np.append(0.0, np.geomspace(1e-4, 1.0, 41)), None)], zeros=True).draw(axes)
        self.assertEqual([text.get_text() for text in axes.texts], ["values go down to 0"])
        plt.close(figure)
        figure, axes = plt.subplots()
        curve_pictures.fit_axis(axes.yaxis, np.array([0.0, 25000.0]), "pressure [Pa]")
        self.assertEqual((axes.get_ylabel(), axes.yaxis.get_major_formatter()(20000.0, 0)), ("pressure [$10^{3}$ Pa]", "20"))
        plt.close(figure)

    def test_expressions(self):
        """Opposites and ratios of columns; a name that is a column is no expression, and a ratio to 0 is no number."""
        history = {"stress_xy": np.array([1.0, -2.0, 3.0]), "stress_yy": np.array([2.0, 4.0, 0.0]), "force_y:a/b-c": np.ones(3),
                   "kinetic_energy": np.array([1.0, 2.0, 3.0]), "max_overlap": np.full(3, 2.0), "coordination": np.full(3, 4.0)}
        for text, values, label in (("stress_xy", [1.0, -2.0, 3.0], "stress xy [Pa]"), ("-stress_xy", [-1.0, 2.0, -3.0], "−stress xy [Pa]"),
                                    ("stress_xy/stress_yy", [0.5, -0.5, np.nan], "stress xy / stress yy"),
                                    ("-stress_xy/stress_yy", [-0.5, 0.5, np.nan], "−stress xy / stress yy"),
                                    ("force_y:a/b-c", [1.0, 1.0, 1.0], "force y on a/b-c [N]"),
                                    ("coordination/stress_yy", [2.0, 1.0, np.nan], "coordination /\nstress yy [1/(Pa)]"),
                                    ("kinetic_energy/max_overlap", [0.5, 1.0, 1.5], "kinetic energy /\nlargest overlap [J/(m)]")):
            curve = curve_pictures.Curve(text, history)
            np.testing.assert_array_equal(curve.values(history), values, text)
            self.assertEqual(curve.label([3]), label)
        self.assertEqual(curve_pictures.Curve("-a/b", history).names, ["a", "b"])
        # a difference; signs in names of boundaries are none where the names around another sign are columns
        history["force_y:c-d"] = np.array([1.0, 5.0, 2.0])
        for text, values, label in (("stress_yy-stress_xy", [1.0, 6.0, -3.0], "stress yy − stress xy [Pa]"), ("-stress_xy-stress_yy", [-3.0, -2.0, -3.0], "−stress xy − stress yy [Pa]"),
                                    ("force_y:c-d-force_y:a/b-c", [0.0, 4.0, 1.0], "force y on c-d −\nforce y on a/b-c [N]"),
                                    ("force_y:a/b-c/force_y:c-d", [1.0, 0.2, 0.5], "force y on a/b-c /\nforce y on c-d")):
            curve = curve_pictures.Curve(text, history)
            np.testing.assert_array_equal(curve.values(history), values, text)
            self.assertEqual(curve.label([3]), label)
        self.assertEqual(curve_pictures.Curve("a-b", history).names, ["a", "b"])
        with self.assertRaisesRegex(curve_pictures.PictureError, r"kinetic_energy-stress_xy: a difference of \[J\] and \[Pa\]; expected columns of one unit"):
            curve_pictures.Curve("kinetic_energy-stress_xy", history).label([3])

    def test_along(self):
        """Numbers of the axis that rows lie along have a power of ten beside its unit; residuals have logarithms, and forces that begin at 0 none."""
        step = np.arange(50.0)
        history = gravier.Table({"time": step, "stress_yy": 4e4 * step, "force_y:lid": step**3, "residual": 10.0**(-0.1 * step) * (step > 0), "contacts": step**3})
        run = SimpleNamespace(directory=pathlib.Path("run"), dimension=3, history=lambda: history)
        figure = curve_pictures.draw_history([run], ["force_y:lid", "residual", "contacts"], "stress_yy")
        self.assertEqual([axes.get_yscale() for axes in figure.axes], ["linear", "log", "linear"])
        self.assertEqual(figure.axes[-1].get_xlabel(), "stress yy [$10^{6}$ Pa]")
        self.assertEqual(figure.axes[-1].xaxis.get_major_formatter()(1.5e6, 0), "1.5")
        self.assertEqual(curve_pictures.draw_history([run], ["contacts"]).axes[0].get_xlabel(), "time [s]")
        plt.close("all")

    def test_window(self):
        """Rows after a time and up to another one, before means are taken; a window without rows is named with the times that there are."""
        times = np.arange(1, 11) / 10.0
        run = SimpleNamespace(directory=pathlib.Path("run"), dimension=2, history=lambda: gravier.Table({"time": times, "contacts": 10.0 * times}))
        for window, rows, drawn in (((None, None), 1, times), ((0.3, None), 1, times[3:]), ((None, 0.3), 1, times[:3]), ((0.2, 0.6), 1, times[2:6]), ((0.2, 0.6), 2, [0.35, 0.55])):
            x, y = curve_pictures.draw_history([run], ["contacts"], mean=rows, window=window).axes[0].lines[0].get_data()
            np.testing.assert_allclose(x, drawn, rtol=1e-14)
            np.testing.assert_allclose(y, 10.0 * np.asarray(drawn), rtol=1e-14)
        plt.close("all")
        for window, words in (((1.0, None), "no row after 1 s"), ((None, 0.05), "no row up to 0.05 s"), ((0.31, 0.39), "no row after 0.31 s and up to 0.39 s")):
            with self.assertRaisesRegex(curve_pictures.PictureError, f"run/history.csv: {words}; expected some of its times, 0.1 to 1 s"):
                curve_pictures.draw_history([run], ["contacts"], window=window)
        options = gravier_plot.parse(["history", "run", "--since", "-1e-3", "--until", "2", "--columns", "-a"])
        self.assertEqual((options.since, options.until, options.columns), (-1e-3, 2.0, "-a"))
        with self.assertRaises(SystemExit), contextlib.redirect_stderr(io.StringIO()) as said:
            gravier_plot.check(gravier_plot.parse(["history", "run", "--since", "2", "--until", "1"]))
        self.assertEqual(said.getvalue(), "gravier_plot: --since 2 --until 1: expected an end after the begin\n")
        self.assertEqual(gravier_plot.parse(["history", "run", "--columns", "-stress_xy/stress_yy,contacts"]).columns, "-stress_xy/stress_yy,contacts")

    def test_from_zero(self):
        """An axis begins at 0 where the values come down to a fifth of the largest one. That of places fits them in any case, without
        logarithms; a place that differs by rounding alone is constant."""
        for values, places, low, high in ((np.linspace(0.19, 1.0, 9), False, 0.0, 1.05), (np.linspace(0.3, 1.3, 11), False, 0.25, 1.35),
                                          (np.linspace(-1.0, -0.19, 9), False, -1.05, 0.0), (np.linspace(0.1, 1.1, 11), True, 0.05, 1.15),
                                          (np.geomspace(1e-4, 1.0, 41), True, -0.0499, 1.05), (np.linspace(-1.0, 0.0, 11), True, -1.05, 0.05),
                                          (0.2 + 1e-16 * np.arange(9), True, 0.19, 0.21)):
            scale, *found = curve_pictures.limits_of(values, places=places)
            self.assertEqual(scale, "linear")
            np.testing.assert_allclose(found, (low, high), atol=1e-4)
        figure, panels = plt.subplots(2)
        for name, axes in zip(("position_y:plate", "force_y:plate"), panels):
            curves = [(np.arange(99.0), np.linspace(0.2, 0.03, 99), None)]
            run = SimpleNamespace(directory="run", dimension=2, history=lambda: {"time": curves[0][0], name: curves[0][1]})
            drawn = curve_pictures.draw_history([run], [name]).axes[0]
            self.assertEqual(drawn.get_ylim()[0] > 0.02, name.startswith("position"), name)
        plt.close("all")

    def test_base(self):
        """Numbers of a narrow range are told from what they all begin with, which the label has; ticks are where they say."""
        figure, axes = plt.subplots()
        for low, high, words, place, text in ((0.257931, 0.257940, "height\n− 0.25793 m [$10^{-6}$ m]", 0.257936, "6"),
                                              (-0.257940, -0.257931, "height\n+ 0.25795 m [$10^{-6}$ m]", -0.257936, "14"),
                                              (123456.0, 123466.0, "height\n− 123400 m [m]", 123460.0, "60"), (0.1, 0.2, "height [m]", None, None)):
            curve_pictures.fit_axis(axes.yaxis, np.array([low, high]), "height [m]", places=True)
            self.assertEqual(axes.get_ylabel(), words)
            if text:
                self.assertEqual(axes.yaxis.get_major_formatter()(place, 0), text)
        curve_pictures.fit_axis(axes.yaxis, np.array([100000.0, 100001.0]), "contacts")
        self.assertEqual(axes.get_ylabel(), "contacts\n− 99990")
        plt.close(figure)


class Labels(unittest.TestCase):

    def test_long(self):
        """Labels are no longer than their panels: long ones have several lines, and short ones one."""
        names = ["kinetic energy", "force y: the floor of the hopper / force x: the floor of the hopper", "a/b", "a long name that goes on and on for ever / another one of the same kind [N/(m/s)]"]
        figure = curve_pictures.draw_panels([curve_pictures.Panel(name, [([0.0, 1.0], [0.0, 1.0], None)]) for name in names])
        figure.canvas.draw()
        for axes, name in zip(figure.axes, names):
            label = axes.yaxis.label
            self.assertEqual(label.get_text().replace("\n", " "), name)
            self.assertLessEqual(label.get_window_extent().height, axes.get_window_extent().height)
        self.assertEqual([axes.get_ylabel().count("\n") for axes in figure.axes][::2], [0, 0])
        plt.close(figure)


class Steps(unittest.TestCase):

    def test_of_a_profile(self):
        """Steps are all written ones but the start, numbers, or ranges with both ends, without one or without both."""
        run = SimpleNamespace(path="results.h5", steps=[0, 50, 100, 150, 200], find_step=lambda step: 200 if step is None else step)
        for text, steps in (("all", [50, 100, 150, 200]), ("150,50", [50, 150]), ("100:", [100, 150, 200]), ("60:150", [100, 150]), (":100", [50, 100]),
                            (":", [50, 100, 150, 200]), ("50,140:160", [50, 150]), ("100:150,150:", [100, 150, 200])):
            self.assertEqual(gravier.Run.steps_in(run, gravier_plot.steps_of(text)), steps, text)
        self.assertEqual(gravier.Run.steps_in(run, [None]), [200])
        with self.assertRaisesRegex(gravier.ResultsError, "results.h5: no written step from 110 to 140; expected some of 50 to 200"):
            gravier.Run.steps_in(run, [(110, 140)])
        with self.assertRaisesRegex(gravier.ResultsError, "no step after the start; expected one at least"):
            gravier.Run.steps_in(SimpleNamespace(path="results.h5", steps=[0]), "all")
        for text in ("", "a", "1:2:3", "-5", "1,,2", "1.5"):
            with self.assertRaisesRegex(gravier_plot.argparse.ArgumentTypeError, "expected all, or steps and ranges of them such as 100,5000:8000"):
                gravier_plot.steps_of(text)


if __name__ == "__main__":
    unittest.main()
