"""Bodies with shapes that fly: a top with three moments of inertia beside a fine integration of Euler's equations; squares and cubes made of
several pieces beside those of one; scenes mirrored and turned by a quarter."""
import unittest

import numpy as np

from gravier_runs import RunTestCase, each, run_case
from shaped_scenes import body, box, lattice, prepare, shaped_case

EPS = np.finfo(float).eps
BRICK = "shape brick\nbox 0.3 0.2 0.1\n"
# moments of inertia of the brick over its mass, along its edges
MOMENTS = (0.3**2 + 0.2**2 + 0.1**2 - np.array([0.3, 0.2, 0.1]) ** 2) / 12.0
SPIN = np.array([1.0, 5.0, 0.5])
DURATION = 2.0


def axes_of(quaternion):
    """Matrix whose columns are the axes of a body."""
    w, x, y, z = quaternion
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def top(steps):
    """Spin in the axes of the brick and its quaternion after DURATION, by Runge and Kutta's method."""
    def rate(state):
        spin, (w, x, y, z) = state[:3], state[3:]
        turn = 0.5 * np.array([-x * spin[0] - y * spin[1] - z * spin[2], w * spin[0] + y * spin[2] - z * spin[1],
                               w * spin[1] + z * spin[0] - x * spin[2], w * spin[2] + x * spin[1] - y * spin[0]])
        return np.concatenate([np.cross(MOMENTS * spin, spin) / MOMENTS, turn])

    state, h = np.concatenate([SPIN, [1.0, 0.0, 0.0, 0.0]]), DURATION / steps
    for _ in range(steps):
        a = rate(state)
        b = rate(state + 0.5 * h * a)
        c = rate(state + 0.5 * h * b)
        state = state + h / 6.0 * (a + 2.0 * b + 2.0 * c + rate(state + h * c))
    return state[:3], state[3:] / np.linalg.norm(state[3:])


class ShapeMotion(RunTestCase):

    def play(self, title, dimension, rows, boundaries=(), *parts, ranks=1, library=None):
        directory = prepare(self.here(title), dimension, rows, library)
        run = run_case(shaped_case(dimension, boundaries, *parts), ranks, directory)
        self.assert_status(run, 0)
        self.latest = run
        return run.results()

    def top(self, steps, theta):
        """Spin in the axes of the brick, its axes and its angular momentum over its mass, at the end; and the whole run."""
        results = self.play(f"top {steps} {theta}", 3, [body("brick", [0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], spin=SPIN)], (), {
            "scene": {"gravity": [0.0, 0.0, 0.0]}, "time": {"step": DURATION / steps, "steps": steps, "theta": theta},
            "output": {"every": steps // 4}}, library=BRICK)
        states = []
        for step in range(0, steps + 1, steps // 4):
            axes = axes_of(results[f"/steps/{step}/bodies/orientation"][0])
            spin = axes.T @ results[f"/steps/{step}/bodies/velocity"][0, 3:]
            states.append((spin, axes, axes @ (MOMENTS * spin)))
        return states

    def test_top(self):
        """The middle axis is that of the spin, so that the brick turns over. In its axes the spin is of second order for every theta; its
        orientation is so for theta = 0.5 and of first order for theta = 1. The energy and the size of the angular momentum are
        kept to rounding; the direction of the angular momentum drifts with the error of the orientation."""
        spin, quaternion = top(4000)
        axes = axes_of(quaternion)
        self.assertLess(spin[1], -3.5, "it does not turn over")
        for theta, order in ((0.5, 2.0), (1.0, 1.0)):
            errors = []
            for steps in (400, 800, 1600):
                states = self.top(steps, theta)
                for found, _, momentum in states:
                    np.testing.assert_allclose(MOMENTS @ found**2, MOMENTS @ SPIN**2, rtol=4 * steps * EPS)
                    np.testing.assert_allclose(np.linalg.norm(momentum), np.linalg.norm(MOMENTS * SPIN), rtol=4 * steps * EPS)
                found, turned, momentum = states[-1]
                errors.append([np.abs(found - spin).max(), np.abs(turned - axes).max(),
                               np.linalg.norm(momentum - MOMENTS * SPIN) / np.linalg.norm(MOMENTS * SPIN)])
            errors = np.array(errors)
            print(f"\ntheta {theta}: errors of spin, axes, direction of the angular momentum\n{errors}")
            orders = np.log2(errors[:-1] / errors[1:])
            np.testing.assert_allclose(orders[:, 0], 2.0, atol=0.05)
            np.testing.assert_allclose(orders[:, 1], order, atol=0.15)
            np.testing.assert_allclose(orders[:, 2], order, atol=0.15)
            self.assertLess(errors[-1].max(), 1e-3 if order == 2.0 else 3e-2)

    def test_pieces(self):
        """A square of 2 x 2 squares and a cube of 8 cubes have the mass and the inertia of those of one piece, and move as they do, onto the
        ground and on it: in space without friction, since points have cones of their own."""
        quarter = " ".join
        square = ["-0.1 -0.1  0 -0.1  0 0  -0.1 0", "0 -0.1  0.1 -0.1  0.1 0  0 0", "-0.1 0  0 0  0 0.1  -0.1 0.1", "0 0  0.1 0  0.1 0.1  0 0.1"]
        cubes = [quarter(["box 0.1 0.1 0.1", *(repr(0.05 * sign) for sign in signs)])
                 for signs in [(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)]]
        libraries = {
            2: ("shape body\nrounding 0.001\npolygon -0.1 -0.1  0.1 -0.1  0.1 0.1  -0.1 0.1\n",
                "shape body\nrounding 0.001\n" + "".join(f"polygon {corners}\n" for corners in square)),
            3: ("shape body\nrounding 0.001\nbox 0.2 0.2 0.2\n", "shape body\nrounding 0.001\n" + "\n".join(cubes) + "\n")}
        for dimension, pair in libraries.items():
            with self.subTest(dimension=dimension):
                turn = 0.3 if dimension == 2 else [1.0, 0.2, 0.3, -0.1]
                place = [0.0] * (dimension - 1) + [0.25]
                rows = [body("body", place, turn, [0.1] * dimension, [1.0] * (2 * dimension - 3), scale=1.0)]
                ground = [{"shape": "plane", "point": [0.0] * dimension, "normal": np.eye(dimension)[-1].tolist()}]
                found = [self.play(f"pieces {dimension} {k}", dimension, rows, ground, {
                    "scene": {"friction": 0.3 if dimension == 2 else 0.0}, "time": {"steps": 240, "step": 2e-3}, "output": {"every": 80},
                    "solver": {"method": "newton", "criterion": "residual", "tolerance": 1e-10, "max_iterations": 5000}}, library=library)
                    for k, library in enumerate(pair)]
                for name in ("mass", "radius"):
                    np.testing.assert_allclose(*(one[f"/steps/0/bodies/{name}"] for one in found), rtol=1e-14)
                radius = [one["/shapes/size"][0] for one in found]
                self.assertAlmostEqual(radius[0] / radius[1], 1.0, delta=1e-14)
                np.testing.assert_allclose(*(one["/shapes/inertia"] for one in found), rtol=1e-13)
                self.assertGreater(len(found[0]["/steps/240/contacts/gap"]), 0)
                for step in (80, 160, 240):
                    for name in ("position", "velocity"):
                        np.testing.assert_allclose(*(one[f"/steps/{step}/bodies/{name}"] for one in found), atol=1e-6,
                                                   err_msg=f"{name} in step {step}")

    def test_spinning_bar(self):
        """A bar that turns about its centre, which does not move, meets a plane: the impulse is that of the tip, w a/(1/m + a^2/J) with the lever
        a along the plane. Nothing in the scene moves but by spin, which is what errors of solves are compared with."""
        mass, inertia, spin, depth = 1.0, (1.0 + 0.01**2) / 12.0, 5.0, 0.3
        for dimension in (2, 3):
            library = "shape bar\n" + ("polygon -0.5 -0.005  0.5 -0.005  0.5 0.005  -0.5 0.005\n" if dimension == 2 else "box 1 0.01 0.01\n")
            # in space the bar lies along x and turns about y
            turn, turns = (0.0, spin) if dimension == 2 else ([1.0, 0.0, 0.0, 0.0], [0.0, spin, 0.0])
            plane = {"shape": "plane", "point": (-depth * np.eye(dimension)[-1]).tolist(), "normal": np.eye(dimension)[-1].tolist()}
            found = self.play(f"bar {dimension}", dimension, [body("bar", [0.0] * dimension, turn, spin=turns)], [plane], {
                "scene": {"gravity": [0.0] * dimension, "density": mass / 0.01 ** (dimension - 1)}, "time": {"steps": 200},
                "output": {"every": 200}}, library=library)
            # velocity errors are compared with 0.3 of the velocity that has the energy of the spin
            scale = self.latest.history()["velocity_scale"]
            np.testing.assert_allclose(np.max(scale), 0.3 * spin * np.sqrt(inertia / mass), rtol=1e-6)
            velocity = found["/steps/200/bodies/velocity"][0]
            # the lower corner of the leading edge touches when the tip is at the plane
            lever = np.sqrt(0.5**2 + 0.005**2 - depth**2)
            impulse = spin * lever / (1.0 / mass + lever**2 / inertia)
            np.testing.assert_allclose(velocity[dimension - 1], impulse / mass, rtol=5e-3)
            np.testing.assert_allclose(np.abs(velocity[dimension:]).max(), spin - impulse * lever / inertia, rtol=5e-3)

    def test_mirrored_and_turned(self):
        """A pour seen in a mirror, and one turned by a quarter together with gravity and walls, move as the pour does."""
        for dimension in (2, 3):
            counts = (3, 3) if dimension == 2 else (2, 2, 2)
            walls = box(counts, 0.19)
            gravity = np.array([0.0] * (dimension - 1) + [-9.81])
            # bodies that are their own mirror images
            rows = lattice(counts, spacing=0.19, names=["square", "grain", "pill"] if dimension == 2 else ["cube", "grain", "pill"])
            quarter = np.array([[0.0, -1.0], [1.0, 0.0]]) if dimension == 2 else np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
            mirror = np.diag([-1.0] + [1.0] * (dimension - 1))
            runs = each(lambda name, matrix, dimension=dimension, rows=rows, walls=walls, gravity=gravity: self.play(
                f"{name} {dimension}", dimension, [seen(row, matrix) for row in rows], [seen_wall(wall, matrix) for wall in walls], {
                    "scene": {"gravity": (matrix @ gravity).tolist(), "friction": 0.3}, "time": {"steps": 90, "step": 2e-3 if dimension == 2 else 1e-3},
                    "solver": {"method": "newton", "criterion": "residual", "tolerance": 1e-12, "max_iterations": 5000}}),
                [("pour", np.eye(dimension)), ("turned", quarter), ("mirrored", mirror)])
            for name, matrix, run in zip(("turned", "mirrored"), (quarter, mirror), runs[1:]):
                with self.subTest(name, dimension=dimension):
                    self.assertGreater(len(runs[0]["/steps/90/contacts/gap"]), 3)
                    there = runs[0]["/steps/90/bodies/position"] @ matrix.T
                    np.testing.assert_allclose(run["/steps/90/bodies/position"], there, atol=1e-12)
                    velocity = runs[0]["/steps/90/bodies/velocity"]
                    moving = velocity[:, :dimension] @ matrix.T
                    spin = np.linalg.det(matrix) * (velocity[:, dimension:] @ (matrix.T if dimension == 3 else np.eye(1)))
                    np.testing.assert_allclose(run["/steps/90/bodies/velocity"], np.hstack([moving, spin]), atol=1e-10)


def seen(row, matrix):
    """A body of a scene that a matrix turns or mirrors; a mirrored one must be its own mirror image."""
    row, dimension = dict(row), len(matrix)
    axes = "xyz"[:dimension]
    sense = np.linalg.det(matrix)
    for names in (axes, ["v" + axis for axis in axes]):
        row.update(zip(names, matrix @ [row[name] for name in names]))
    if dimension == 2:
        row["omega"] = sense * row["omega"]
        # the first axis goes where the matrix brings it; a mirror image has its second one on the other side
        row["angle"] = float(np.arctan2(*(matrix @ [np.cos(row["angle"]), np.sin(row["angle"])])[::-1]))
        return row
    row.update(zip(("wx", "wy", "wz"), sense * (matrix @ [row[name] for name in ("wx", "wy", "wz")])))
    quaternion = np.array([row[name] for name in ("qw", "qx", "qy", "qz")])
    axes = matrix @ axes_of(quaternion / np.linalg.norm(quaternion))
    axes[:, 0] *= sense
    row.update(zip(("qw", "qx", "qy", "qz"), quaternion_of(axes)))
    return row


def quaternion_of(axes):
    """Of a rotation, by the largest of its four parts."""
    a = axes
    squares = np.array([1 + a[0, 0] + a[1, 1] + a[2, 2], 1 + a[0, 0] - a[1, 1] - a[2, 2], 1 - a[0, 0] + a[1, 1] - a[2, 2],
                        1 - a[0, 0] - a[1, 1] + a[2, 2]])
    k = int(np.argmax(squares))
    products = np.array([[squares[0], a[2, 1] - a[1, 2], a[0, 2] - a[2, 0], a[1, 0] - a[0, 1]],
                         [a[2, 1] - a[1, 2], squares[1], a[0, 1] + a[1, 0], a[0, 2] + a[2, 0]],
                         [a[0, 2] - a[2, 0], a[0, 1] + a[1, 0], squares[2], a[1, 2] + a[2, 1]],
                         [a[1, 0] - a[0, 1], a[0, 2] + a[2, 0], a[1, 2] + a[2, 1], squares[3]]])
    return products[k] / np.linalg.norm(products[k])


def seen_wall(wall, matrix):
    return {**wall, "point": (matrix @ wall["point"]).tolist(), "normal": (matrix @ wall["normal"]).tolist()}


if __name__ == "__main__":
    unittest.main()
