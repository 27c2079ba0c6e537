"""gravier_fclib: problems in every storage form, local and global, judged again here; problems without a solution; statuses, tables and
bad input."""
import csv
import itertools
import os
import tempfile
import unittest

import h5py
import numpy as np

from fclib_problems import write_local, write_matrix
import impossible_problems
from gravier_runs import RunTestCase, gravier


def box_stack(boxes=3, slope=0.5, friction=0.3):
    """Bodies and contacts of unit cubes on an inclined plane: M, H, f and mu; frame (n, t, s) = (z, x, y)."""
    mass, step, gravity = 2.0, 0.01, 10.0
    h = np.zeros((6 * boxes, 12 * boxes))
    m = np.diag(np.tile([mass] * 3 + [mass / 6] * 3, boxes))
    pull = step * gravity * mass / np.hypot(1, slope)
    f = np.tile([pull * slope, 0, -pull, 0, 0, 0], boxes)
    for b in range(boxes):
        for c, (x, y) in enumerate([(0.5, 0.5), (0.5, -0.5), (-0.5, 0.5), (-0.5, -0.5)]):
            columns = slice(12 * b + 3 * c, 12 * b + 3 * c + 3)
            for body, z, sign in ((b, -0.5, 1), (b - 1, 0.5, -1)):
                if body >= 0:
                    axes = sign * np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]]).T
                    h[6 * body:6 * body + 6, columns] = np.vstack([axes, np.cross([x, y, z], axes.T).T])
    # at the same friction everywhere, boxes that slide as one would be about to slide on each other
    return m, h, f, np.repeat([friction, 2 * friction], [4, 4 * boxes - 4])


def local_problem(**arguments):
    m, h, f, mu = box_stack(**arguments)
    inverse = np.linalg.inv(m)
    return h.T @ inverse @ h, h.T @ inverse @ f, mu


def random_problem(dimension, contacts, seed=1):
    random = np.random.default_rng(seed)
    a = random.uniform(-1, 1, (dimension * contacts, dimension * contacts + 4))
    return a @ a.T, random.uniform(-1, 1, dimension * contacts), random.uniform(0, 1, contacts)


def write_global(path, m, h, f, mu, g=None, b=None, w=None, dimension=3):
    with h5py.File(path, "w") as file:
        group = file.create_group("fclib_global")
        group["spacedim"] = np.array([dimension], "i4")
        write_matrix(group.create_group("M"), m, "columns")
        write_matrix(group.create_group("H"), h, "triplets")
        if g is not None:
            write_matrix(group.create_group("G"), g)
            group["vectors/b"] = b
        group["vectors/f"], group["vectors/mu"] = f, mu
        group["vectors/w"] = np.zeros(h.shape[1]) if w is None else w


def hinged_rods(seed=4):
    """Two rods in a plane, hinged, with a contact each: W, q, mu and (V, R, s) of the hinge, made from random M, H, G, f and b."""
    random = np.random.default_rng(seed)
    m, h, g = np.diag(random.uniform(1, 2, 6)), random.uniform(-1, 1, (6, 4)), random.uniform(-1, 1, (6, 2))
    f, b, w = random.uniform(-1, 1, 6), random.uniform(-1, 1, 2), random.uniform(-1, 0, 4)
    inverse = np.linalg.inv(m)
    return (h.T @ inverse @ h, h.T @ inverse @ f + w, np.array([0.2, 0.6]),
            (h.T @ inverse @ g, g.T @ inverse @ g, g.T @ inverse @ f + b)), (m, h, g, f, b, w)


def solutions_in_plane(w, q, mu, constraints):
    """All (r, v, l) of contacts in a plane that are open, stick, or slip one way, found by trying every combination: v, r and l
    solve linear equations then."""
    v_matrix, r_matrix, s = constraints
    n, p = v_matrix.shape
    found = []
    for states in itertools.product(("open", "stick", 1, -1), repeat=len(mu)):
        # unknowns r, v, l
        a = np.zeros((2 * n + p, 2 * n + p))
        a[:n] = np.hstack([-w, np.eye(n), -v_matrix])
        a[n:n + p] = np.hstack([v_matrix.T, np.zeros((p, n)), r_matrix])
        for c, state in enumerate(states):
            rows, normal, tangent = slice(n + p + 2 * c, n + p + 2 * c + 2), 2 * c, 2 * c + 1
            if state == "open":
                a[rows, normal:normal + 2] = np.eye(2)
            elif state == "stick":
                a[rows, n + normal:n + normal + 2] = np.eye(2)
            else:
                a[rows, n + normal] = 1, 0
                a[rows, tangent] = 0, 1
                a[rows, normal] = 0, state * mu[c]
        x = np.linalg.solve(a, np.concatenate([q, -s, np.zeros(n)]))
        r, v = x[:n].reshape(-1, 2), x[n:2 * n].reshape(-1, 2)
        if all(v[c, 0] >= 0 if state == "open" else r[c, 0] >= 0 and (
                abs(r[c, 1]) <= mu[c] * r[c, 0] if state == "stick" else state * v[c, 1] >= 0)
               for c, state in enumerate(states)):
            found.append((x[:n], x[n:2 * n], x[2 * n:], states))
    return found


def measures(w, q, mu, r):
    """e and es of the impulses, from their definition."""
    d = len(q) // len(mu)
    v = (w @ r + q).reshape(-1, d)
    r = r.reshape(-1, d)
    v_hat = v.copy()
    v_hat[:, 0] += mu * np.linalg.norm(v[:, 1:], axis=1)
    stiffness = np.array([np.diag(w)[d * a:d * a + d].mean() for a in range(len(mu))])

    def project(x):
        p = x.copy()
        for a in range(len(mu)):
            t = np.linalg.norm(x[a, 1:])
            if t > mu[a] * x[a, 0]:
                n = max(0, (x[a, 0] + mu[a] * t) / (1 + mu[a]**2))
                p[a, 0], p[a, 1:] = n, x[a, 1:] * (mu[a] * n / t) if n > 0 else 0
        return p

    e = np.linalg.norm(r - project(r - v_hat)) / max(np.linalg.norm(q), np.linalg.norm(r), np.linalg.norm(v))
    s = stiffness[:, None]
    return e, np.linalg.norm(s * (r - project(r - v_hat / s))) / np.linalg.norm(q)


def read_table(path):
    """A table as {column: list of texts}."""
    with open(path, newline="", encoding="ascii") as file:
        rows = list(csv.DictReader(file))
    return {name: [row[name] for row in rows] for name in rows[0]}


class Fclib(RunTestCase):
    def setUp(self):
        self.directory = tempfile.mkdtemp(dir=self.scratch)

    def solve(self, *arguments, status=0, ranks=1):
        run = gravier(*arguments, ranks=ranks, directory=self.directory, program="gravier_fclib")
        self.assert_status(run, status)
        return run

    def path(self, name):
        return os.path.join(self.directory, name)

    def bytes_of(self, *names):
        found = {}
        for name in names:
            with open(self.path(name), "rb") as file:
                found[name] = file.read()
        return found

    def impulses(self, name):
        with h5py.File(self.path(name)) as file:
            return file["solution/r"][()], file["solution/u"][()]

    def multipliers(self, name):
        with h5py.File(self.path(name)) as file:
            return file["solution/l"][()]

    def test_storage_forms_are_one_problem(self):
        w, q, mu = random_problem(3, 12)
        w[3, 4] += 0.01  # not symmetric: rows and columns are told apart
        for form in ("rows", "columns", "triplets"):
            write_local(self.path(f"{form}.hdf5"), w, q, mu, form)
        self.solve("rows.hdf5", "columns.hdf5", "triplets.hdf5", "--write", "out", "--tolerance", "1e-11")
        for form in ("rows", "columns", "triplets"):
            r, u = self.impulses(f"out/{form}.hdf5")
            # the measure counts what the sums of an entry in two parts and of other orders round differently
            self.assertLess(measures(w, q, mu, r)[1], 1.01e-11)
            np.testing.assert_allclose(u, w @ r + q, atol=1e-12)

    def test_every_method_and_the_measures(self):
        problems = {"boxes": local_problem(), "plane": random_problem(2, 10), "space": random_problem(3, 10)}
        for name, (w, q, mu) in problems.items():
            write_local(self.path(f"{name}.h5"), w, q, mu, dimension=len(q) // len(mu))
        for method in ("auto", "nlgs", "momentum", "newton"):
            self.solve(".", "--method", method, "--csv", "results.csv", "--write", method)
            rows = read_table(self.path("results.csv"))
            self.assertEqual(list(rows["problem"]), ["boxes.h5", "plane.h5", "space.h5"])
            for k, name in enumerate(problems):
                w, q, mu = problems[name]
                e, es = measures(w, q, mu, self.impulses(f"{method}/{name}.h5")[0])
                self.assertLess(es, 1e-8)
                # both sides lose what |q| rounds to
                np.testing.assert_allclose([float(rows["e"][k]), float(rows["es"][k])], [e, es], rtol=1e-3, atol=1e-14)
                self.assertEqual(int(rows["converged"][k]), 1)
                self.assertEqual(int(rows["contacts"][k]), len(mu))

    def test_written_problem_is_the_problem(self):
        w, q, mu = random_problem(2, 6)
        write_local(self.path("a.h5"), w, q, mu, "columns", dimension=2)
        self.solve("a.h5", "--write", "out")
        with h5py.File(self.path("out/a.h5")) as file:
            local = file["fclib_local"]
            back = np.zeros_like(w)
            for i in range(len(q)):
                for k in range(local["W/p"][i], local["W/p"][i + 1]):
                    back[i, local["W/i"][k]] += local["W/x"][k]
            np.testing.assert_array_equal(back, w)
            np.testing.assert_array_equal(local["vectors/q"], q)
            np.testing.assert_array_equal(local["vectors/mu"], mu)
            self.assertEqual([int(local[f"W/{key}"][0]) for key in ("m", "n", "nz", "nzmax")], [12, 12, -2, len(local["W/x"])])
            self.assertEqual(int(local["spacedim"][0]), 2)

    def test_warm_start(self):
        write_local(self.path("a.h5"), *local_problem())
        self.solve("a.h5", "--write", "solved", "--tolerance", "1e-9")
        r, u = self.impulses("solved/a.h5")
        note = "gravier_fclib: note: {}: --warm found neither /solution/r nor /guesses/1/r: the solve starts from zero impulses\n"
        self.assertEqual(self.solve("a.h5", "solved/a.h5", "--warm", "--csv", "warm.csv").stderr, note.format("a.h5"))
        cold, warm = (int(sweeps) for sweeps in read_table(self.path("warm.csv"))["sweeps"])
        self.assertGreater(cold, 10)
        # the first check of a start that is a solution already
        self.assertEqual(warm, 1)
        # as libfclib writes them, and where older versions of Gravier put them; the first of several counts
        names = ["solution", "fclib_local/solution", "guesses/1", "fclib_local/guesses/1"]
        for k, name in enumerate(names):
            write_local(self.path("b.h5"), *local_problem())
            with h5py.File(self.path("b.h5"), "a") as file:
                file[f"{name}/r"], file[f"{name}/u"] = r, u
                for later in names[k + 1:]:
                    file[f"{later}/r"] = np.zeros_like(r)
            self.assertEqual(self.solve("b.h5", "--warm", "--csv", "warm.csv").stderr, "")
            self.assertEqual(read_table(self.path("warm.csv"))["sweeps"], ["1"], name)
        # without --warm nothing is said, and nothing is taken
        self.assertEqual(self.solve("solved/a.h5", "--csv", "cold.csv").stderr, "")
        self.assertEqual(read_table(self.path("cold.csv"))["sweeps"], [str(cold)])

    def test_warm_start_of_a_global_problem(self):
        m, h, f, mu = box_stack()
        write_global(self.path("a.h5"), m, h, f, mu)
        self.solve("a.h5", "--write", "solved", "--tolerance", "1e-9")
        for name in ("solution", "fclib_global/solution", "guesses/1"):
            write_global(self.path("b.h5"), m, h, f, mu)
            with h5py.File(self.path("b.h5"), "a") as file:
                file[f"{name}/r"] = self.impulses("solved/a.h5")[0]
            self.assertEqual(self.solve("b.h5", "--warm", "--csv", "warm.csv").stderr, "")
            self.assertEqual(read_table(self.path("warm.csv"))["sweeps"], ["1"], name)

    def test_info_is_kept(self):
        def describe(group, matrix):
            for name in ("title", "description", "math_info"):
                group[f"info/{name}"] = np.bytes_(f"{name} of {group.name}")
            group["info"].attrs["number"] = np.array([7], "i4")
            group[f"{matrix}/comment"], group[f"{matrix}/rank"] = np.bytes_("made here"), np.array([3], "i4")

        (w, q, mu, constraints), (m, h, g, f, b, shift) = hinged_rods(7)
        write_local(self.path("local.h5"), w, q, mu, dimension=2)
        write_local(self.path("hinged.h5"), w, q, mu, dimension=2, constraints=constraints)
        write_global(self.path("global.h5"), m, h, f, mu, g, b, shift, dimension=2)
        for name, group, matrix in (("local", "fclib_local", "W"), ("hinged", "fclib_local", "W"), ("global", "fclib_global", "M")):
            with h5py.File(self.path(f"{name}.h5"), "a") as file:
                describe(file[group], matrix)
        self.solve("local.h5", "hinged.h5", "global.h5", "--write", "out", ranks=2)
        for name, group in (("local", "fclib_local"), ("hinged", "fclib_local"), ("global", "fclib_global")):
            with h5py.File(self.path(f"out/{name}.h5")) as file:
                info = file["fclib_local/info"]
                self.assertEqual({key: info[key][()] for key in info}, {
                    key: f"{key} of /{group}".encode() for key in ("title", "description", "math_info")})
                self.assertEqual(info.attrs["number"], [7])
                # what is said of W holds where W is the same
                self.assertEqual("rank" in file["fclib_local/W"], name == "local")
                self.assertEqual("comment" in file["fclib_local/W"], name == "local")

    def test_scalars(self):
        w, q, mu = random_problem(3, 1)
        for form in ("rows", "triplets"):
            write_local(self.path("a.h5"), w, q, mu, form)
            with h5py.File(self.path("a.h5"), "a") as file:
                local = file["fclib_local"]
                for name in ("spacedim", "W/m", "W/n", "W/nz", "W/nzmax", "vectors/mu"):
                    value = local[name][0]
                    del local[name]
                    local[name] = value
                    self.assertEqual(local[name].shape, ())
            for ranks in (1, 2):
                self.solve("a.h5", "--write", "out", ranks=ranks)
                self.assertLess(measures(w, q, mu, self.impulses("out/a.h5")[0])[1], 1.01e-8)
        with h5py.File(self.path("a.h5"), "a") as file:
            del file["fclib_local/spacedim"]
            file["fclib_local/spacedim"] = h5py.Empty("i4")
        self.assertIn("a.h5: /fclib_local/spacedim: ", self.solve("a.h5", status=2).stderr)

    def test_half_of_a_symmetric_matrix(self):
        m, h, f, mu = box_stack()
        # bodies that are not their principal axes: M is no diagonal
        m = m + np.kron(np.eye(len(f) // 6), 0.1 * np.eye(6)[[3, 4, 5, 0, 1, 2]])
        w, q = h.T @ np.linalg.solve(m, h), h.T @ np.linalg.solve(m, f)
        rods, mu_rods, (v, r, s) = hinged_rods(3)[0][:2], hinged_rods(3)[0][2], hinged_rods(3)[0][3]
        for side, half in (("above", np.triu), ("below", np.tril)):
            for form in ("rows", "columns", "triplets"):
                write_local(self.path("w.h5"), half(w), q, mu, form)
                write_local(self.path("r.h5"), half(rods[0]), rods[1], mu_rods, form, 2, (v, half(r), s))
                write_global(self.path("m.h5"), half(m), h, f, mu)
                write_global(self.path("whole.h5"), m, h, f, mu)
                run = self.solve("w.h5", "r.h5", "m.h5", "whole.h5", "--write", "out", "--tolerance", "1e-11")
                words = f"has entries {side} the diagonal alone and is read as half of a symmetric matrix"
                self.assertEqual(run.stderr, f"gravier_fclib: note: w.h5: /fclib_local/W {words}\n"
                                 f"gravier_fclib: note: r.h5: /fclib_local/W {words}; /fclib_local/R {words}\n"
                                 f"gravier_fclib: note: m.h5: /fclib_global/M {words}\n")
                for name in ("w", "m", "whole"):
                    self.assertLess(measures(w, q, mu, self.impulses(f"out/{name}.h5")[0])[1], 1.01e-11)
                (exact, *_), = solutions_in_plane(*rods, mu_rods, (v, r, s))
                np.testing.assert_allclose(self.impulses("out/r.h5")[0], exact, atol=1e-9)
        # a triangular matrix that is half of nothing
        wrong = np.triu(w)
        wrong[2, 5] = 2 * np.abs(w).max()
        write_local(self.path("w.h5"), wrong, q, mu)
        self.assertIn("w.h5: /fclib_local/W: entries above the diagonal alone, and row 3 has one that no positive semidefinite matrix has: "
                      "expected all entries, or one half of a symmetric matrix", self.solve("w.h5", status=2).stderr)

    def test_global_problems_are_reduced(self):
        m, h, f, mu = box_stack()
        shift = np.tile([1e-3, 2e-3, -1e-3], len(mu))
        # the lowest cube slides as if on a rail along y: a bilateral constraint on its velocity along x
        g = np.zeros((len(f), 1))
        g[0, 0] = 1
        write_global(self.path("free.h5"), m, h, f, mu, w=shift)
        write_global(self.path("rail.h5"), m, h, f, mu, g, np.array([-0.02]))
        self.solve("free.h5", "rail.h5", "--write", "out")
        saddle = np.block([[m, -g], [g.T, np.zeros((1, 1))]])
        h_rail = np.vstack([h, np.zeros((1, h.shape[1]))])
        expected = {"free": (h.T @ np.linalg.solve(m, h), h.T @ np.linalg.solve(m, f) + shift),
                    "rail": (h_rail.T @ np.linalg.solve(saddle, h_rail),
                             h_rail.T @ np.linalg.solve(saddle, np.append(f, 0.02)))}
        for name, (w, q) in expected.items():
            with h5py.File(self.path(f"out/{name}.h5")) as file:
                np.testing.assert_allclose(file["fclib_local/vectors/q"], q, atol=1e-13)
            r, u = self.impulses(f"out/{name}.h5")
            np.testing.assert_allclose(u, w @ r + q, atol=1e-12)
            self.assertLess(measures(w, q, mu, r)[1], 1.01e-8)
        # u of the rail: the velocity that b prescribes, whatever the impulses, by the force of the rail
        np.testing.assert_allclose(u[1:12:3].mean(), 0.02, atol=1e-12)
        np.testing.assert_allclose(self.multipliers("out/rail.h5"), [m[0, 0] * 0.02 - h[0] @ r - f[0]], atol=1e-12)

    def test_bilateral_constraints(self):
        states = set()
        for seed, form in enumerate(("rows", "columns", "triplets", "rows", "rows", "rows")):
            w, q, mu, constraints = hinged_rods(seed)[0]
            write_local(self.path("a.h5"), w, q, mu, form, 2, constraints)
            self.solve("a.h5", "--write", "out", "--tolerance", "1e-12")
            (r, v, multipliers, state), = solutions_in_plane(w, q, mu, constraints)
            for found, exact in zip((*self.impulses("out/a.h5"), self.multipliers("out/a.h5")), (r, v, multipliers)):
                np.testing.assert_allclose(found, exact, atol=1e-10)
            states.update(state)
        self.assertEqual(states, {"open", "stick", 1, -1})
        # the written problem is one of contacts alone
        self.solve("out/a.h5", "--warm", "--write", "again", "--csv", "warm.csv", "--tolerance", "1e-12")
        np.testing.assert_array_equal(self.impulses("again/a.h5"), self.impulses("out/a.h5"))
        self.assertEqual(read_table(self.path("warm.csv"))["sweeps"], ["1"])
        with h5py.File(self.path("again/a.h5")) as file:
            self.assertNotIn("l", file["solution"])

    def test_constraints_of_bodies_and_of_contacts(self):
        # one problem by M, H and G, and by W, V and R
        (w, q, mu, constraints), (m, h, g, f, b, shift) = hinged_rods(7)
        write_global(self.path("bodies.h5"), m, h, f, mu, g, b, shift, dimension=2)
        write_local(self.path("contacts.h5"), w, q, mu, dimension=2, constraints=constraints)
        self.solve("bodies.h5", "contacts.h5", "--write", "out", "--tolerance", "1e-12")
        for name in ("bodies", "contacts"):
            r, u = self.impulses(f"out/{name}.h5")
            multipliers = self.multipliers(f"out/{name}.h5")
            velocity = np.linalg.solve(m, h @ r + g @ multipliers + f)
            np.testing.assert_allclose(g.T @ velocity, -b, atol=1e-12)
            np.testing.assert_allclose(h.T @ velocity + shift, u, atol=1e-12)
            np.testing.assert_allclose(r, self.impulses("out/bodies.h5")[0], atol=1e-10)

    def test_many_constraints(self):
        # cubes that may not turn, each by three constraints on its velocities: they slide as points do
        m, h, f, mu = box_stack(boxes=30)
        turns = np.eye(len(f))[:, np.arange(len(f)) % 6 > 2]
        inverse = np.linalg.inv(m)
        v, r, s = h.T @ inverse @ turns, turns.T @ inverse @ turns, turns.T @ inverse @ f
        write_local(self.path("a.h5"), h.T @ inverse @ h, h.T @ inverse @ f, mu, constraints=(v, r, s))
        self.solve("a.h5", "--write", "out")
        found = self.impulses("out/a.h5")[0]
        np.testing.assert_allclose(self.multipliers("out/a.h5"), -np.linalg.solve(r, v.T @ found + s), atol=1e-12)
        straight = np.delete(np.eye(len(f)), np.flatnonzero(turns.any(axis=1)), axis=1)
        w = h.T @ straight @ np.linalg.inv(straight.T @ m @ straight) @ straight.T @ h
        self.assertLess(measures(w, h.T @ inverse @ f, mu, found)[1], 1.01e-8)

    def test_ranks_do_not_matter(self):
        w, q, mu = local_problem()
        write_local(self.path("a.h5"), w, q, mu)
        self.solve("a.h5", "--write", "one", "--csv", "one.csv")
        self.solve("a.h5", "--write", "two", "--csv", "two.csv", ranks=2)
        np.testing.assert_array_equal(self.impulses("one/a.h5")[0], self.impulses("two/a.h5")[0])
        self.assertEqual(len(read_table(self.path("two.csv"))["problem"]), 1)

    def test_directory_of_any_name(self):
        os.mkdir(self.path("a[b]*?"))
        for name in ("2.h5", "1.hdf5", "10.hdf5", "notes.txt"):
            write_local(self.path(f"a[b]*?/{name}"), *random_problem(2, 2), dimension=2)
        self.solve("a[b]*?", "--csv", "results.csv")
        self.assertEqual(read_table(self.path("results.csv"))["problem"], ["1.hdf5", "10.hdf5", "2.h5"])

    def test_unsolved_is_status_3(self):
        write_local(self.path("a.h5"), *local_problem())
        run = self.solve("a.h5", "--max-iterations", "2", "--csv", "results.csv", status=3)
        self.assertIn("NOT CONVERGED", run.stdout)
        self.assertIn("1 of 1 solves did NOT reach the tolerance", run.stdout)
        self.assertEqual(int(read_table(self.path("results.csv"))["converged"][0]), 0)

    def test_problems_without_a_solution(self):
        problems = impossible_problems.impossible()
        self.assertGreaterEqual(len(problems), 24)
        impossible_problems.write_problems(self.directory)
        for method in ("auto", "nlgs", "momentum", "newton"):
            with self.subTest(method):
                # default limits; plain sweeps would take 1e6 of them on masses of ratio 1e6
                run = self.solve("impossible", "--method", method, "--csv", "results.csv", "--write", method, status=3)
                rows = read_table(self.path("results.csv"))
                verdicts = dict(zip(rows["problem"], rows["verdict"]))
                creeping = {"chain_2d_masses.h5"} if method == "nlgs" else set()
                self.assertEqual(set(verdicts), {f"{name}.h5" for name in problems})
                self.assertEqual({name for name, verdict in verdicts.items() if verdict != "no_solution"}, creeping)
                self.assertNotIn("1", rows["converged"])
                self.assertLess(max(map(float, rows["seconds"])), 5)
                found = len(problems) - len(creeping)
                self.assertIn(f"*** {found} of {len(problems)} solves found NO solution: loads grow without bound", run.stdout)
                self.assertEqual(run.stdout.count("no solution found: loads grow without bound, most at contact "), found)
                # there is no proof by normal impulses alone where friction jams a grain in a wedge
                proven = {name for name, proof in zip(rows["problem"], rows["proof"]) if proof == "1"}
                self.assertEqual({name for name in proven if name.startswith("wedge")}, set())
                if method == "auto":
                    self.assertEqual({name for name in verdicts if not name.startswith("wedge")}, proven)
                self.assertEqual(run.stdout.count(" (proven)"), len(proven))

    def test_named_contact_grows(self):
        # four solvable contacts come first; the squeezed row has contacts 5 to 8, where one impulse grows as the others
        w, q, mu, dimension = impossible_problems.impossible()["chain_2d_beside"]
        write_local(self.path("a.h5"), w, q, mu, dimension=dimension)
        run = self.solve("a.h5", status=3)
        self.assertRegex(run.stdout, r"no solution found: loads grow without bound, most at contact [5-8] \(proven\)")

    def test_near_neighbours_have_solutions(self):
        problems = impossible_problems.solvable()
        impossible_problems.write_problems(self.directory)
        for method in ("auto", "newton"):
            self.solve("solvable", "--method", method, "--csv", "results.csv", "--write", method)
            rows = read_table(self.path("results.csv"))
            self.assertEqual((set(rows["verdict"]), set(rows["proof"])), ({"solved"}, {"0"}))
            self.assertEqual(len(rows["verdict"]), len(problems))
            for name, (w, q, mu, _) in problems.items():
                r, u = self.impulses(f"{method}/{name}.h5")
                self.assertLess(measures(w, q, mu, r)[1], 1.01e-8, name)
                # a tenth of the approach counts; u is rounded as W r is
                approach = -(w @ r + q).reshape(len(mu), -1)[:, 0].min()
                rounding = 1e-15 * (np.abs(w) @ np.abs(r)).max()
                self.assertLessEqual(approach, 1e-7 * np.linalg.norm(q.reshape(len(mu), -1), axis=1).max() + rounding, name)
        # plain sweeps creep where masses are in a ratio of 1e6, but do not say that there is no solution
        for method in ("nlgs", "momentum"):
            self.solve("solvable", "--method", method, "--csv", "results.csv", status=3)
            rows = read_table(self.path("results.csv"))
            self.assertEqual({name for name, verdict in zip(rows["problem"], rows["verdict"]) if verdict != "solved"},
                             {"masses_2d.h5", "masses_3d.h5"})
            self.assertNotIn("no_solution", rows["verdict"])

    def test_heavy_on_light_is_no_proof(self):
        """A disk of 1 kg on the ground bears one of M kg: impulses of M times the load of the light one are a solution, however large."""
        for mass in (1e6, 1e7, 9e7, 1e9, 1e12):
            w = np.array([[1.0, 0, -1, 0], [0, 3, 0, 1], [-1, 0, 1 + 1 / mass, 0], [0, 1, 0, 3 + 3 / mass]])
            write_local(self.path(f"heavy{mass:.0e}.h5"), w, np.array([-0.1, 0, 0, 0]), np.full(2, 0.5), dimension=2)
        for method in ("auto", "nlgs", "momentum", "newton"):
            self.solve(*(f"heavy{mass:.0e}.h5" for mass in (1e6, 1e7, 9e7, 1e9, 1e12)), "--method", method, "--csv", "results.csv", status=3)
            rows = read_table(self.path("results.csv"))
            self.assertEqual(set(rows["proof"]), {"0"}, method)
            if method in ("auto", "newton"):
                self.assertEqual(rows["verdict"][:2], ["solved"] * 2)

    def test_impulses_beyond_loads_end(self):
        # a wedge so narrow that the grain slides out by impulses of 5e9: a solution, but none that loads can make, and Newton's
        # method comes to where rounding hides what a step could change
        w, q, mu = impossible_problems.wedge(2, 0.0, 1e-5).problem()
        write_local(self.path("a.h5"), w, q, mu, dimension=2)
        for method in ("newton", "auto"):
            self.solve("a.h5", "--method", method, "--csv", "results.csv", status=3)
            self.assertEqual(read_table(self.path("results.csv"))["verdict"], ["not_converged"])
        # proximal points that are found at once count: the limit holds wherever the steps end
        self.solve("a.h5", "--method", "newton", "--csv", "results.csv", status=3)
        steps = int(read_table(self.path("results.csv"))["newton_steps"][0])
        for limit in range(1, steps):
            self.solve("a.h5", "--method", "newton", "--max-iterations", str(limit), "--csv", "results.csv", status=3)
            self.assertEqual(read_table(self.path("results.csv"))["newton_steps"], [str(limit)])

    def test_huge_impulses_are_no_solution(self):
        # two walls that move alike: the start is in balance, but q is lost beside it
        w, q, mu = impossible_problems.one_grain(2, 0.5, (1.0, 1.0))[0].problem()
        write_local(self.path("a.h5"), w, q, mu, dimension=2)
        with h5py.File(self.path("a.h5"), "a") as file:
            file["guesses/1/r"] = np.array([1e17, 0, 1e17, 0])
        run = self.solve("a.h5", "--warm", "--method", "nlgs", "--max-iterations", "1", "--csv", "results.csv", status=3)
        self.assertRegex(run.stdout, r"NOT CONVERGED: the impulse of contact [12] is beyond what loads can make")
        rows = read_table(self.path("results.csv"))
        self.assertLess(float(rows["es"][0]), 1e-8)
        self.assertEqual((rows["verdict"], rows["converged"]), (["not_converged"], ["0"]))

    def test_profile(self):
        for name, problem in {"a": random_problem(3, 8), "b": random_problem(3, 30, 2), "c": local_problem()}.items():
            write_local(self.path(f"{name}.h5"), *problem)
        # plain sweeps do not solve them all
        self.solve(".", "--method", "all", "--max-iterations", "60", "--csv", "results.csv", "--profile", "profile.csv", status=3)
        rows = read_table(self.path("results.csv"))
        seconds = np.where(np.array(rows["converged"]) == "1", np.array(rows["seconds"], float), np.inf).reshape(3, 4)
        self.assertTrue(np.isinf(seconds).any() and np.isfinite(seconds).any(axis=1).all(), seconds)
        profile = read_table(self.path("profile.csv"))
        for k, ratio in enumerate(np.array(profile["ratio"], float)):
            # two solves of as many ticks of the clock differ by rounding
            least, most = (np.mean((seconds <= ratio * near * seconds.min(axis=1, keepdims=True)) & np.isfinite(seconds), axis=0)
                           for near in (1 - 1e-9, 1 + 1e-9))
            found = np.array([float(profile[method][k]) for method in ("auto", "nlgs", "momentum", "newton")])
            self.assertTrue((least - 1e-9 <= found).all() and (found <= most + 1e-9).all(), f"ratio {ratio}: {least} {found} {most}")

    def test_bad_files(self):
        w, q, mu = random_problem(3, 4)

        def spoil(change):
            write_local(self.path("bad.h5"), w, q, mu)
            with h5py.File(self.path("bad.h5"), "a") as file:
                change(file["fclib_local"])

        def replace(name, value):
            def change(group):
                del group[name]
                if value is not None:
                    group[name] = value
            return change

        cases = [
            (replace("vectors/q", None), "/fclib_local/vectors/q: missing"),
            (replace("vectors/q", q[:-1]), "/fclib_local/vectors/q: 11 numbers: expected 12"),
            (replace("vectors/q", np.append(q[:-1], np.nan)), "/fclib_local/vectors/q: expected finite numbers"),
            (replace("vectors/mu", -mu), "/fclib_local/vectors/mu: expected coefficients of friction >= 0"),
            (replace("vectors/mu", mu[:0]), "/fclib_local/vectors/mu: expected at least one contact"),
            (replace("spacedim", np.array([4])), "/fclib_local/spacedim = 4: expected 2 or 3"),
            (replace("spacedim", np.array([2.5])), "/fclib_local/spacedim: not made of integers"),
            (replace("W", None), "/fclib_local/W/m: missing"),
            (replace("W/x", None), "/fclib_local/W/x: missing"),
            (replace("W/x", np.full(144, np.inf)), "/fclib_local/W/x: expected finite numbers"),
            (replace("W/x", np.ones(100)), "/fclib_local/W/x"),
            # what these are measured by is lost beside 0 or overflows
            (replace("W/x", w.ravel() * 1e200), "/fclib_local/W/x: expected numbers of at most 1e30 in size"),
            (replace("W/x", w.ravel() * 1e-200), "contact 1: mean diagonal of W is "),
            (replace("vectors/q", q * 1e200), "/fclib_local/vectors/q: expected numbers of at most 1e30 in size"),
            (replace("vectors/q", q * 1e-200), "velocities without impulses of at most "),
            (replace("W/m", np.array([11])), "/fclib_local/W: a matrix of 11 rows and 12 columns: expected 12 and 12"),
            (replace("W/nz", np.array([-3])), "/fclib_local/W/nz = -3: expected -2 (rows), -1 (columns)"),
            (replace("W/i", np.full(144, 12)), "/fclib_local/W/i: expected numbers from 0 to 11"),
            (replace("W/p", np.arange(13)[::-1]), "/fclib_local/W/p: expected numbers that rise from 0"),
            (replace("W/p", np.arange(5)), "/fclib_local/W/p: 5 numbers: expected 13"),
            (replace("W/x", np.zeros(144)), "contact 1: normal and mean diagonal of W"),
        ]
        hinge = np.random.default_rng(2).uniform(-1, 1, (12, 2))
        # four constraints of which two follow from the others, but for rounding
        four = np.random.default_rng(3).uniform(-1, 1, (12, 4))

        def constrain(**changes):
            def change(group):
                for name, value in {"V": hinge, "R": np.eye(2), "s": [0.1, 0.2], **changes}.items():
                    if name == "s":
                        group["vectors/s"] = np.array(value)
                    elif value is not None:
                        write_matrix(group.create_group(name), value)
            return change

        cases += [
            (constrain(R=None), "/fclib_local/R/m: missing"),
            (constrain(s=[0.1]), "/fclib_local/V: a matrix of 12 rows and 2 columns: expected 12 and 1"),
            (constrain(V=hinge[:11]), "/fclib_local/V: a matrix of 11 rows and 2 columns: expected 12 and 2"),
            (constrain(R=np.eye(3)), "/fclib_local/R: a matrix of 3 rows and 3 columns: expected 2 and 2"),
            (constrain(R=np.zeros((2, 2))), "/fclib_local/R: expected a regular one ("),
            (constrain(R=np.ones((2, 2))), "/fclib_local/R: expected a regular one ("),
            (constrain(V=four, R=four[:2].T @ four[:2], s=np.zeros(4)), "/fclib_local/R: expected a regular one ("),
        ]
        write_local(self.path("good.h5"), w, q, mu)
        for change, message in cases:
            with self.subTest(message):
                spoil(change)
                run = self.solve("good.h5", "bad.h5", "--csv", "results.csv", status=2)
                self.assertEqual(run.stderr.count("\n"), 1, str(run))
                self.assertIn(f"gravier_fclib: error: bad.h5: {message}", run.stderr)
                # nothing is solved or written before all is read
                self.assertEqual(run.stdout, "")
                self.assertFalse(os.path.exists(self.path("results.csv")))

    def test_singular_masses(self):
        m, h, f, mu = box_stack()
        m[0, 0] = 0
        write_global(self.path("a.h5"), m, h, f, mu)
        run = self.solve("a.h5", status=2)
        self.assertIn("a.h5: the matrix of masses and constraints: expected a regular one", run.stderr)
        # three constraints of which one follows from the others, but for rounding
        m, h, f, mu = box_stack()
        g = np.zeros((len(f), 3))
        g[:2, :2] = [[0.1, 0.7], [0.3, 0.2]]
        g[:, 2] = 0.3 * g[:, 0] + 0.7 * g[:, 1]
        write_global(self.path("a.h5"), m, h, f, mu, g, np.zeros(3))
        run = self.solve("a.h5", status=2)
        self.assertIn("a.h5: the matrix of masses and constraints: expected a regular one", run.stderr)

    def test_no_input_is_replaced(self):
        os.makedirs(self.path("same/deep"))
        os.mkdir(self.path("other"))
        for name in ("same/a.h5", "other/a.h5", "same/b.h5"):
            write_local(self.path(name), *random_problem(3, 4))
        os.symlink("same", self.path("link"))
        os.symlink("../same/b.h5", self.path("other/b.h5"))
        os.mkdir(self.path("hard"))
        os.link(self.path("same/b.h5"), self.path("hard/b.h5"))
        before = self.bytes_of("same/a.h5", "other/a.h5", "same/b.h5")
        another = "expected another directory than that of {}, which {} would replace"
        cases = [("same/a.h5", directory, another.format("same/a.h5", f"{directory}/a.h5"))
                 for directory in ("same", "./same/", "same/../same", "same/deep/..", "link", "../" + os.path.basename(self.directory) + "/same",
                                   self.path("same"))]
        cases += [("link/a.h5", "same", another.format("link/a.h5", "same/a.h5")),
                  ("same", "link", another.format("same/a.h5", "link/a.h5")),
                  # what the path leads to counts, by links of either kind
                  ("same/b.h5", "other", another.format("same/b.h5", "other/b.h5")),
                  ("same/b.h5", "hard", another.format("same/b.h5", "hard/b.h5")),
                  # another input is in the way
                  ("same/a.h5 other/b.h5", "hard", another.format("other/b.h5", "hard/b.h5")),
                  ("same/a.h5 other/a.h5", "new", "expected files of different names, but same/a.h5 and other/a.h5 both become new/a.h5"),
                  ("same/a.h5 ./same/a.h5", "new", "expected files of different names, but same/a.h5 and ./same/a.h5 both become new/a.h5")]
        for inputs, directory, message in cases:
            with self.subTest(message):
                run = self.solve(*inputs.split(), "--write", directory, status=2)
                self.assertEqual(run.stderr, f"gravier_fclib: error: --write '{directory}': {message}\n")
                self.assertFalse(os.path.exists(self.path("new")))
                self.assertEqual(self.bytes_of(*before), before)
        write_local(self.path("t.csv.part"), *random_problem(3, 4))
        run = self.solve("t.csv.part", "--csv", "t.csv", status=2)
        self.assertEqual(run.stderr, "gravier_fclib: error: t.csv.part: expected a problem elsewhere than where t.csv is written until it is whole\n")
        # the directory of another input is none of its files
        self.solve("same/a.h5", "other/a.h5", "--csv", "t.csv")
        self.solve("same/b.h5", "--write", "other/new", "--csv", "other/new/b.csv")

    def test_bad_usage(self):
        write_local(self.path("a.h5"), *random_problem(3, 4))
        with h5py.File(self.path("empty.h5"), "w"):
            pass
        os.mkdir(self.path("nothing"))
        for arguments, message in [
            ((), "no file given"),
            (("missing.h5",), "missing.h5"),
            (("empty.h5",), "empty.h5: expected a group /fclib_local or /fclib_global"),
            (("nothing",), "nothing: expected a directory with files *.hdf5 or *.h5"),
            (("a.h5", "--method", "simplex"), "--method 'simplex': expected auto, nlgs, momentum, newton, or all"),
            (("a.h5", "--method", "nlgs,"), "--method 'nlgs,': expected auto"),
            (("a.h5", "--tolerance", "0"), "--tolerance '0': expected a finite real number > 0"),
            (("a.h5", "--tolerance", "1-1"), "--tolerance '1-1': expected a finite real number > 0"),
            (("a.h5", "--max-iterations", "2147483648"), "--max-iterations '2147483648': expected an integer >= 1"),
            (("a.h5", "--max-iterations", "-1"), "--max-iterations '-1': expected an integer >= 1"),
            (("a.h5", "--csv"), "--csv '': expected a path"),
            (("a.h5", "--write", "."), "--write '.': expected another directory than that of a.h5"),
            (("nothing/../a.h5", "--write", "nothing/.."), "expected another directory than that of nothing/../a.h5"),
            (("a.h5", "--speed"), "unknown option '--speed'"),
            (("a.h5", "--csv", "t.csv", "--profile", "./t.csv"), "./t.csv: expected a file of its own for each of --csv, --profile"),
            (("a.h5", "--csv", "nothing/../a.h5"), "nothing/../a.h5: expected another file for a table than the problem a.h5"),
            (("a.h5", "--csv", "new/a.h5", "--write", "new"), "new/a.h5: expected a file of its own"),
        ]:
            with self.subTest(message):
                run = self.solve(*arguments, status=2)
                self.assertEqual(run.stderr.count("\n"), 1, str(run))
                self.assertIn(message, run.stderr)


if __name__ == "__main__":
    unittest.main()
