#!/usr/bin/env python3
"""The speed of sound through disks with springs, against exact linear theory and against effective medium theory.

    ./gravier study sound [--out DIR] [--quick]

Periodic cells of disks that press on each other get the velocities of one mode of vibration, and the frequency with which it swings is
measured: a chain, the triangular lattice, and a packing of unequal disks that came to rest, without friction and with tangential springs
that stick. Expected are the frequencies of the springs between the same disks, from the eigenvalues of their matrix, and of the lattice
the speeds of long waves, c = sqrt(9/8) d sqrt(k/m) of pressure and sqrt(3/8) d sqrt(k/m) of shear. Effective medium theory lets all disks
of the packing follow the plane wave, which is stiffer than what they do.

Leaves in DIR study_sound.csv and the runs. Exit status: 0 all rows are within their bounds; 1 one is not."""
import argparse
import sys
from pathlib import Path

import numpy as np
from oracle_table import Table
from study_support import OneLineParser, claimed, hdf5_file, read_bodies, run, run_study, states, whole_file, write_csv


RADIUS = 0.01  # m
DENSITY = 1000.0  # kg/m^2
MASS = DENSITY * np.pi * RADIUS**2
STIFFNESS = 1.0e5  # N/m
#: tangential over normal stiffness, where there is friction
RATIO = 2.0 / 7.0
#: of a spring and a disk of the mean mass [1/s]
FREQUENCY = np.sqrt(STIFFNESS / MASS)
#: overlap at rest over the diameter, and the displacements of a wave over that overlap
PRESSED, AMPLITUDE = 1.0e-4, 0.05
#: step times FREQUENCY
STEP = 0.1


class Cell:
    """Disks in a cell that is periodic along x and, if it says so, along y."""

    def __init__(self, centres, radii, lengths, friction):
        self.x, self.r, self.lengths, self.friction = np.asarray(centres, float), np.asarray(radii, float), lengths, friction
        self.mass = DENSITY * np.pi * self.r**2
        self.freedoms = 3 if friction else 2

    def contacts(self):
        """i, j, way from j to i, its length, overlap of all disks that touch."""
        i, j = np.triu_indices(len(self.r), 1)
        way = self.x[i] - self.x[j]
        for d, length in enumerate(self.lengths):
            if length:
                way[:, d] -= length * np.round(way[:, d] / length)
        long = np.linalg.norm(way, axis=1)
        overlap = self.r[i] + self.r[j] - long
        near = overlap > 0.0
        return i[near], j[near], way[near], long[near], overlap[near]

    def stiffness(self):
        """Matrix of the springs, of x, y and, with friction, the turn of each disk. The force at rest turns with the normal, which
        counts without friction alone, since its part is PRESSED."""
        n, k = self.freedoms, np.zeros((self.freedoms * len(self.r),) * 2)
        for i, j, way, long, overlap in zip(*self.contacts()):
            normal = way / long
            tangent = np.array([-normal[1], normal[0]])
            parts = [(STIFFNESS, normal, (0.0, 0.0))]
            if self.friction:
                parts.append((RATIO * STIFFNESS, tangent, (-self.r[i], -self.r[j])))
            else:
                parts.append((-STIFFNESS * overlap / long, tangent, (0.0, 0.0)))
            for spring, along, arms in parts:
                row = np.zeros(len(k))
                row[n * i:n * i + 2], row[n * j:n * j + 2] = along, -along
                if self.friction:
                    row[n * i + 2], row[n * j + 2] = arms
                at = np.flatnonzero(row)
                k[np.ix_(at, at)] += spring * np.outer(row[at], row[at])
        return k

    def masses(self):
        m = np.repeat(self.mass[:, None], self.freedoms, axis=1)
        if self.friction:
            m[:, 2] = 0.5 * self.mass * self.r**2
        return m.ravel()

    def plane_wave(self, number, direction):
        """Displacements of all disks along a direction, in a standing wave with so many lengths in the cell."""
        wave = np.zeros((len(self.r), self.freedoms))
        wave[:, direction] = np.sin(2.0 * np.pi * number * self.x[:, 0] / self.lengths[0])
        return wave.ravel()

    def mode(self, number, direction):
        """Frequency and displacements of the mode that is most of a plane wave, and the frequency of effective medium theory."""
        m, k = self.masses(), self.stiffness()
        root = np.sqrt(m)
        squares, modes = np.linalg.eigh(k / np.outer(root, root))
        wave = root * self.plane_wave(number, direction)
        # modes of one frequency share a wave
        share = (modes.T @ wave)**2
        best = np.argmax(share)
        same = np.abs(squares - squares[best]) <= 1e-6 * squares[best]
        if share[same].sum() < 0.99 * share.sum():
            same = np.arange(len(squares)) == best
        shape = modes[:, same] @ (modes[:, same].T @ wave) / root
        affine = np.sqrt((wave / root) @ k @ (wave / root) / (wave @ wave))
        return np.sqrt(squares[best]), shape, affine

    def write(self, path, velocity):
        with whole_file(path) as part, hdf5_file(part) as file:
            file["bodies/id"] = np.arange(1, len(self.r) + 1)
            file["bodies/position"], file["bodies/radius"], file["bodies/velocity"] = self.x, self.r, velocity

    def play(self, folder, velocity, step, steps, every, **law):
        """Run it."""
        folder.mkdir(parents=True, exist_ok=True)
        self.write(folder / "disks.h5", velocity)
        run(folder, {
            "scene": {"dimension": 2, "bodies": "file", "bodies_file": "disks.h5", "density": DENSITY, "gravity": [0.0, 0.0],
                      "start_overlap": 1.0, "period": list(self.lengths)},
            "material": [{"name": "disk"}],
            "law": [{"materials": ["disk"], "kind": "elastic", "normal_stiffness": STIFFNESS, "stiffness_ratio": RATIO,
                     "friction": 10.0 if self.friction else 0.0, **law}],
            "time": {"step": step, "steps": steps},
            "solver": {"criterion": "residual", "tolerance": 1.0e-12, "max_iterations": 20000},
            "output": {"directory": ".", "every": every, "final_bodies": True}})

    def swing(self, folder, number, direction, step=STEP, periods=1.5):
        """Measured and expected frequency of a mode, and that of effective medium theory."""
        expected, shape, affine = self.mode(number, direction)
        speeds = np.zeros((len(self.r), 3))
        size = AMPLITUDE * PRESSED * 2.0 * RADIUS * expected / np.abs(shape.reshape(-1, self.freedoms)[:, :2]).max()
        speeds[:, :self.freedoms] = size * shape.reshape(-1, self.freedoms)
        h = step / FREQUENCY
        self.play(folder, speeds, h, int(periods * 2.0 * np.pi / expected / h), 1, spring_theta=0.5)
        m, part = self.masses(), []
        for _, _, state in states(folder / "results.h5"):
            velocity = state["bodies/velocity"][:][:, :self.freedoms]
            part.append((m * velocity.ravel()) @ shape)
        part = np.array(part)
        # p(t + h) + p(t - h) = 2 cos(w h) p(t)
        middle, sides = part[1:-1], part[2:] + part[:-2]
        return np.arccos(0.5 * (middle @ sides) / (middle @ middle)) / h, expected, affine


def chain(count):
    spacing = 2.0 * RADIUS * (1.0 - PRESSED)
    centres = np.stack([(np.arange(count) + 0.5) * spacing, np.zeros(count)], 1)
    return Cell(centres, np.full(count, RADIUS), (count * spacing, 0.0), False)


def triangular(count, friction, radii=None, pressed=PRESSED):
    """Rows along x, as many as disks in a row."""
    spacing = 2.0 * RADIUS * (1.0 - pressed)
    column, row = (a.ravel() for a in np.meshgrid(np.arange(count), np.arange(count)))
    centres = np.stack([(column + 0.5 * (row % 2) + 0.25) * spacing, (row + 0.5) * spacing * np.sqrt(0.75)], 1)
    return Cell(centres, np.full(count**2, RADIUS) if radii is None else radii, (count * spacing, count * spacing * np.sqrt(0.75)), friction)


def packing(count, folder):
    """Disks of unequal radii on the lattice, which come to rest."""
    rng = np.random.default_rng(7)
    cell = triangular(count, False, RADIUS * (1.0 + 0.08 * (2.0 * rng.random(count**2) - 1.0)), 0.05)
    cell.play(folder, np.zeros((len(cell.r), 3)), 1.0 / FREQUENCY, 3000, 0, spring_restitution=0.05)
    x, r, v = read_bodies(folder / "final_bodies.h5")
    return Cell(x, r, cell.lengths, False), np.abs(v).max()


def main():
    parser = OneLineParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("out/sound"), help="default: out/sound")
    parser.add_argument("--quick", action="store_true", help="smaller cells")
    options = parser.parse_args()
    claimed(options.out)
    table = Table()
    count = 32
    line = chain(count)
    for number in (1, 4, 8):
        found, expected, _ = line.swing(options.out / f"chain_{number}", number, 0)
        exact = 2.0 * FREQUENCY * np.sin(np.pi * number / count)
        table.add("chain", f"frequency of {number} waves in {count} disks [1/s]", found, exact, abs(found / exact - 1.0), 3e-3)
        if number == 8:
            fine = line.swing(options.out / "chain_fine", number, 0, 0.5 * STEP)[0]
            order = np.log2(abs(found / expected - 1.0) / abs(fine / expected - 1.0))
            table.add("chain", "order of convergence in the step", order, 2.0, abs(order - 2.0), 0.1)
    count = 8 if options.quick else 16
    for friction in (False, True):
        cell = triangular(count, friction)
        name = "sticking" if friction else "lattice"
        for direction, wave in enumerate(("pressure", "shear")):
            found, expected, _ = cell.swing(options.out / f"{name}_{wave}", 1, direction)
            table.add(name, f"frequency of a {wave} wave in {count} x {count} disks [1/s]", found, expected, abs(found / expected - 1.0), 1e-3)
            speed = found * cell.lengths[0] / (2.0 * np.pi)
            if not friction:
                exact = np.sqrt((9.0, 3.0)[direction] / 8.0) * 2.0 * RADIUS * FREQUENCY
                table.add(name, f"speed of the {wave} wave, against that of long waves [m/s]", speed, exact, abs(speed / exact - 1.0),
                          1.5 * (2.0 * np.pi / count)**2 / 24.0)
    cell, fastest = packing(count, options.out / "packing_rest")
    table.add("packing", "fastest disk at rest over the speed of sound", fastest / (2.0 * RADIUS * FREQUENCY), 0.0, None, 1e-9)
    for direction, wave in enumerate(("pressure", "shear")):
        found, expected, affine = cell.swing(options.out / f"packing_{wave}", 1, direction)
        table.add("packing", f"frequency of a {wave} wave in {count} x {count} unequal disks [1/s]", found, expected,
                  abs(found / expected - 1.0), 1e-3)
        table.add("packing", f"speed of the {wave} wave over that of effective medium theory", found / affine)
    write_csv(options.out / "study_sound.csv", {name: [row[k] for row in table.rows] for k, name in enumerate(table.HEADER)})
    sys.exit(1 if table.misses else 0)


if __name__ == "__main__":
    run_study(main)
