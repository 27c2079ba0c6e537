"""Bodies with round corners that bounce on springs, without friction and damping: contacts have a potential, and keep the energy."""
import os
import unittest

import numpy as np

from gravier_runs import RunTestCase, run_case, write

#: corners of 27 degrees at the base, whose sharp corners are far outside the round ones
TRIANGLE = np.array([[-0.1, 0.0], [0.1, 0.0], [0.0, 0.05]])
AREA, DENSITY, SPEED, STEPS_OF_A_SWING = 0.005, 2500.0, 0.5, 120


class Bounces(RunTestCase):

    def bounce(self, dimension, rounding, tilt, stiffness):
        """Energy after an impact on a plane, and the largest on the way, over that before."""
        corners = TRIANGLE - TRIANGLE.mean(axis=0)
        mass = DENSITY * AREA * (1.0 if dimension == 2 else 0.2)
        turn = np.array([[np.cos(tilt), -np.sin(tilt)], [np.sin(tilt), np.cos(tilt)]])
        height = 1e-4 - (corners @ turn.T)[:, 1].min()
        swing = np.pi * np.sqrt(mass / stiffness)
        step = 2.0 * swing / STEPS_OF_A_SWING
        # until the other end has come down, too, and has swung
        steps = int((0.8 * tilt / SPEED + 3e-4 / SPEED + 25.0 * swing) / step)
        if dimension == 2:
            shape = "polygon " + " ".join(map(str, TRIANGLE.ravel()))
            rows = f"id,x,y,vy,angle,shape,radius\n1,0,{height},{-SPEED},{tilt},body,\n"
        else:
            shape = "hull " + " ".join(f"{x} {y} {z}" for y in (-0.1, 0.1) for x, z in TRIANGLE)
            rows = "id,x,y,z,vz,qw,qx,qy,qz,shape,radius\n" \
                   f"1,0,0,{height},{-SPEED},{np.cos(0.5 * tilt)},0,{-np.sin(0.5 * tilt)},0,body,\n"
        place = self.here(f"{dimension} {rounding} {tilt} {stiffness}")
        os.makedirs(place)
        write(os.path.join(place, "body.shapes"), f"shape body\nrounding {rounding}\n{shape}\n")
        write(os.path.join(place, "body.csv"), rows)
        up = np.eye(dimension)[-1].tolist()
        run = run_case({"scene": {"dimension": dimension, "bodies": "file", "bodies_file": "body.csv", "shapes": "body.shapes", "density": DENSITY,
                                  "gravity": [0.0] * dimension, "wall_material": "m"},
                        "material": {"name": "m"}, "law": {"materials": "m", "kind": "elastic", "normal_stiffness": stiffness, "spring_theta": 0.5},
                        "boundary": {"name": "plane", "shape": "plane", "point": [0.0] * dimension, "normal": up},
                        "time": {"step": step, "steps": steps}, "solver": {"accuracy": 1e-8, "tolerance": 1e-12, "velocity_scale": SPEED},
                        "output": {"directory": "results", "every": 0, "energy": True}}, directory=place)
        self.assert_status(run, 0)
        history = run.history()
        energy = sum(history[name] for name in ("kinetic_translation", "kinetic_rotation", "elastic_energy")) / (0.5 * mass * SPEED**2)
        self.assertLess(history["elastic_energy"][-1], 1e-12 * mass)
        self.assertGreater(history["elastic_energy"].max(), 0.01 * mass * SPEED**2)
        return energy[-1], energy.max()

    def test_energy(self):
        for dimension, cases in ((2, ((0.01, 0.004, 1e8), (0.01, 0.008, 1e10), (0.003, 0.03, 1e8), (2e-4, 0.004, 1e8))), (3, ((0.01, 0.004, 1e8), (0.01, 0.015, 1e8)))):
            for case in cases:
                with self.subTest(dimension=dimension, case=case):
                    np.testing.assert_allclose(self.bounce(dimension, *case), 1.0, atol=5e-3)

    def test_seam(self):
        """Two squares side by side in one cluster come to rest on springs. With the deeper point of their seam they rocked for good, since it went
        from one side of the seam to the other with the sign of the lean."""
        for rounding in (0.001, 0.01):
            place = self.here(f"seam {rounding}")
            os.makedirs(place)
            write(os.path.join(place, "body.shapes"), f"shape body\nrounding {rounding}\npolygon -0.1 -0.05 0 -0.05 0 0.05 -0.1 0.05\n"
                                                      "polygon 0 -0.05 0.1 -0.05 0.1 0.05 0 0.05\n")
            write(os.path.join(place, "body.csv"), "id,x,y,vy,angle,shape,radius\n1,0,0.0502,0,0.001,body,\n")
            run = run_case({"scene": {"dimension": 2, "bodies": "file", "bodies_file": "body.csv", "shapes": "body.shapes", "density": DENSITY,
                                      "wall_material": "m"},
                            "material": {"name": "m"}, "law": {"materials": "m", "kind": "elastic", "normal_stiffness": 1e6, "friction": 0.5,
                                                               "spring_restitution": 0.3, "tangential_damping": 0.5},
                            "boundary": {"name": "plane", "shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0]},
                            "time": {"step": 2e-4, "steps": 4000}, "solver": {"accuracy": 1e-8, "tolerance": 1e-12, "velocity_scale": 0.1},
                            "output": {"directory": "results", "every": 0, "energy": True}}, directory=place)
            self.assert_status(run, 0)
            history = run.history()
            self.assertGreater(history["kinetic_rotation"].max(), 1e-6)
            self.assertLess(history["kinetic_rotation"][-1000:].max(), 1e-18)

    def test_seams_over_seams(self):
        """A cluster of two squares at rest on its like presses in three points, whose springs bear a third of its weight each, whether their seams
        lie exactly over each other or not."""
        mass, stiffness, found = DENSITY * 0.02, 1e6, []
        for shift in (0.0, 1e-5, 0.004):
            place = self.here(f"seams {shift}")
            os.makedirs(place)
            write(os.path.join(place, "body.shapes"), "shape body\nrounding 0.01\npolygon -0.1 -0.05 0 -0.05 0 0.05 -0.1 0.05\n"
                                                      "polygon 0 -0.05 0.1 -0.05 0.1 0.05 0 0.05\n")
            write(os.path.join(place, "body.csv"), f"id,x,y,shape,radius\n1,0,0.05,body,\n2,{shift},0.15,body,\n")
            run = run_case({"scene": {"dimension": 2, "bodies": "file", "bodies_file": "body.csv", "shapes": "body.shapes", "density": DENSITY,
                                      "gravity": [0.0, -9.81], "wall_material": "m"},
                            "material": {"name": "m"}, "law": {"materials": "m", "kind": "elastic", "normal_stiffness": stiffness, "friction": 0.5,
                                                               "spring_restitution": 0.1, "tangential_damping": 0.5},
                            "boundary": {"name": "plane", "shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0]},
                            "time": {"step": 5e-4, "steps": 1000}, "solver": {"accuracy": 1e-8, "tolerance": 1e-12, "velocity_scale": 0.1},
                            "output": {"directory": "results", "every": 0}}, directory=place)
            self.assert_status(run, 0)
            lower, upper = run.results()["/steps/1000/bodies/position"][:, 1]
            found.append((0.1 - (upper - lower)) * stiffness / (mass * 9.81))
        # a shift tilts the upper one a little
        np.testing.assert_allclose(found, 1.0 / 3.0, rtol=5e-3)


if __name__ == "__main__":
    unittest.main()
