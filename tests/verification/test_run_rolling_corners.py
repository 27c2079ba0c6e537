"""Polygons that roll over their corners on a plane: springs and bonds stay with the corner that touches, though all points of the pair
change their keys at once."""
import os
import unittest

import numpy as np

from gravier_runs import RunTestCase, merged, run_case, write

import gravier

SIDES, RADIUS = 20, 0.1
INNER = RADIUS * np.cos(np.pi / SIDES)
CASE = {"scene": {"bodies": "file", "bodies_file": "../gon.csv", "shapes": "../gon.shapes", "density": 2500.0, "wall_material": "m"},
        "boundary": {"name": "floor", "shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0]}, "material": {"name": "m"},
        "solver": {"accuracy": 1e-6, "tolerance": 1e-8, "velocity_scale": 0.01}, "output": {"directory": "results", "every": 20}}


class RollingCorners(RunTestCase):

    def play(self, title, body, *parts):
        """Runs of one body in which two corners touch the plane at each change of sides, or one does."""
        write(self.here("gon.shapes"), f"shape gon\nregular {SIDES} {RADIUS}\n")
        keys = list(body)
        write(self.here("gon.csv"), f"id,{','.join(keys)},shape,radius\n1,{','.join(repr(float(body[key])) for key in keys)},gon,\n")
        runs = []
        for alert in (None, 0.002):
            run = run_case(merged(CASE, *parts, {"scene": {"alert_distance": alert}}), directory=self.here(f"{title} {alert}"))
            self.assert_status(run, 0)
            runs.append(gravier.Run(os.path.join(run.directory, "results")))
        return runs

    def test_spring_of_a_corner(self):
        """A polygon rolls down a slope on springs that never slide. The friction of the corner that bears is continuous, and does not depend on
        how far corners in the air are looked for."""
        law = {"materials": ["m"], "kind": "elastic", "friction": 5.0, "normal_stiffness": 1e7, "spring_restitution": 0.3, "tangential_damping": 0.5}
        slope, spin, steps = 0.15, -2.0, 1200
        near, far = self.play("slope", {"x": 0.0, "y": INNER, "vx": -spin * INNER, "omega": spin},
                              {"scene": {"gravity": [9.81 * np.sin(slope), -9.81 * np.cos(slope)]}, "law": law, "time": {"step": 1e-4, "steps": steps}})
        for name in ("position", "velocity"):
            np.testing.assert_array_equal(near.body(1)[name], far.body(1)[name], name)
        self.assertGreater(max(len(near.contacts(step).gap) for step in near.steps[1:]), 1)
        turned = near.body(1).orientation[:, 0]
        # over a corner there and back, with two corners near the plane each time the side changes
        self.assertLess(turned[-1], -np.pi / SIDES)

    def test_bond_of_a_corner(self):
        """A polygon turns freely about the corner at which it is bonded to the plane."""
        tilt, rate, steps = 0.1, -1.0, 200
        corner = np.array([-RADIUS * np.sin(np.pi / SIDES), INNER])
        place = np.array([[np.cos(tilt), np.sin(tilt)], [-np.sin(tilt), np.cos(tilt)]]) @ corner
        law = {"materials": ["m"], "kind": "bonded", "friction": 0.3, "bond_strength": 1e4, "bond_friction": 10.0, "bond_distance": 5e-4}
        body = {"x": place[0], "y": place[1], "vx": -rate * place[1], "vy": rate * place[0], "omega": rate, "angle": -tilt}
        for run in self.play("hinge", body, {"scene": {"gravity": [0.0, 0.0]}, "law": law, "time": {"step": 1e-3, "steps": steps}}):
            found = run.body(1)
            angle = found.orientation[:, 0]
            self.assertLess(angle[-1], -tilt - 0.19)
            at = found.position + np.stack([-np.cos(angle) * corner[0] + np.sin(angle) * corner[1],
                                            -np.sin(angle) * corner[0] - np.cos(angle) * corner[1]], axis=1)
            np.testing.assert_allclose(at, 0.0, atol=2e-6)
            np.testing.assert_allclose(found.spin[:, 0], rate, rtol=2e-5)


if __name__ == "__main__":
    unittest.main()
