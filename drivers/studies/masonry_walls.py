"""Parts of study_masonry.py with many blocks at rest: arches, walls and towers against linear programs, and long rests."""
import numpy as np
from masonry_limit import Blocks, threshold
from masonry_scene import GRAVITY, Scene, bisect, rectangle

#: for the minimum thickness, friction that does not let joints slide
ROUGH = 2.0
#: speed after one step over that of a free fall: half of the lack of thickness over the thickness makes so much
STANDS = 1.0e-5
#: minimum thickness over radius, and friction at it, of a semicircular arch of thin voussoirs (weight where it is)
CONTINUUM_THICKNESS, CONTINUUM_FRICTION = 0.107478038, 0.395265
#: pieces of the whole arch: chords in the place of arcs take from the weight, and move its centre, by less than a part in 10^4
CHORDS = 324


# ---- arch

def voussoir(n, thickness):
    """Pieces of one of n voussoirs of a semicircle of radius 1, about the axis x: several trapezoids, as it is not convex."""
    parts = -(-CHORDS // n)
    inner, outer = 1.0 - 0.5 * thickness, 1.0 + 0.5 * thickness
    angle = np.pi / n * (np.arange(parts + 1) / parts - 0.5)
    way = np.column_stack([np.cos(angle), np.sin(angle)])
    return [np.array([inner * way[k], outer * way[k], outer * way[k + 1], inner * way[k + 1]]) for k in range(parts)]


def arch(n, thickness, friction, rounding=1.0e-3, **keys):
    """The arch on a plane; the rounding is over the thickness."""
    scene = Scene(friction=friction, **keys)
    scene.plane([0.0, 1.0])
    shape = scene.shape(voussoir(n, thickness), rounding * thickness)
    for k in range(n):
        scene.put(shape, [0.0, 0.0], np.pi * (k + 0.5) / n)
    return scene


def arch_joints(n, thickness, friction):
    """Its linear program."""
    scene = arch(n, thickness, friction)
    blocks = Blocks()
    for block in scene.blocks:
        blocks.add(block.centre, block.shape.area)
    for k in range(n + 1):
        angle = np.pi * k / n
        way = np.array([np.cos(angle), np.sin(angle)])
        ends = [(1.0 - 0.5 * thickness) * way, (1.0 + 0.5 * thickness) * way]
        # block k stands on block k - 1
        normal = np.array([-way[1], way[0]])
        if k < n:
            blocks.joint(k, k - 1 if k > 0 else None, ends, normal)
        else:
            blocks.joint(n - 1, None, ends, -normal)
    return blocks


class Judge:
    """Says whether scenes stand, and counts the solves that missed their tolerance."""

    #: sweeps alone wander near the limit; of 81 voussoirs a residual of 1e-9 leaves speeds of 4e-5 at rest
    SOLVER = {"method": "newton", "criterion": "residual", "tolerance": 1.0e-11, "max_iterations": 200000}

    def __init__(self):
        self.missed = 0

    def run(self, scene):
        found = scene.run(solver=self.SOLVER)
        self.missed += not found.converged
        return found

    def stands(self, scene):
        return self.run(scene).speed() < STANDS


def arches(table, quick, counts=None):
    judge = Judge()
    for n in counts or ((9, 27) if quick else (9, 27, 81)):
        program = threshold(lambda t, n=n: arch_joints(n, t, ROUGH).lack(ROUGH), 0.09, 0.12)
        found = bisect(lambda t, n=n: judge.stands(arch(n, t, ROUGH)), program + 1.0e-3, program - 1.1e-3, 4.0e-6)
        table.add("arch", f"{n} voussoirs: minimum thickness over radius, against the program", found, program, None, 1.0e-4)
        table.add("arch", f"{n} voussoirs: the same, of thin voussoirs", found, CONTINUUM_THICKNESS)
        for thickness in (0.15,) if quick else (0.11, 0.15, 0.25):
            blocks = arch_joints(n, thickness, ROUGH)
            program = threshold(blocks.lack, 0.25, 0.5)
            found = bisect(lambda mu, n=n, t=thickness: judge.stands(arch(n, t, mu)), program + 4.0e-3, program - 4.1e-3, 1.0e-5)
            words = f"{n} voussoirs: least friction at thickness {thickness}, against the program"
            table.add("arch", words, found, program, None, 1.0e-4)
    program = threshold(arch_joints(27, CONTINUUM_THICKNESS, ROUGH).lack, 0.25, 0.5)
    words = "27 voussoirs: least friction at thickness 0.107478 by the program, of thin voussoirs"
    table.add("arch", words, program, CONTINUUM_FRICTION)
    table.add("arch", "solves that missed their tolerance", judge.missed, 0, None, 0.0)


# ---- walls and towers

def leaning(friction, lean, gap, keys):
    """A scene with gravity and so much of it along x, whose joints between bricks beside each other are so wide."""
    if gap > 0.0:
        keys = {"alert_distance": 0.2 * gap, **keys}
    return Scene(friction=friction, gravity=[lean * GRAVITY, -GRAVITY], **keys)


def wall(columns, courses, friction, lean=0.0, gap=0.0, **keys):
    """A wall in running bond on a plane, under gravity and so much of it along x. Bricks beside each other touch, or are apart."""
    width, height = 1.0, 0.5
    scene = leaning(friction, lean, gap, keys)
    scene.plane([0.0, 1.0])
    for row in range(courses):
        x, y = 0.0, (row + 0.5) * height
        ends = [0.5 * width] if row % 2 else []
        for length in ends + [width] * (columns - len(ends)) + ends:
            scene.put(scene.shape([rectangle(length - gap, height)]), [x + 0.5 * length, y])
            x += length
    return scene


def tower(courses, friction, lean=0.0, gap=0.0, **keys):
    """Courses of two bricks beside each other and of one long brick in turn."""
    scene = leaning(friction, lean, gap, keys)
    scene.plane([0.0, 1.0])
    for row in range(courses):
        y = 0.25 * (row + 0.5)
        if row % 2:
            scene.brick(1.0, 0.25, [0.0, y])
        else:
            scene.brick(0.5 - gap, 0.25, [-0.25, y])
            scene.brick(0.5 - gap, 0.25, [0.25, y])
    return scene


def brick_joints(scene):
    """Linear program of upright bricks on the plane y = 0: joints between sides that touch along a line."""
    boxes = []
    for k in range(len(scene.blocks)):
        corners = scene.corners(k)[0]
        boxes.append((corners.min(0), corners.max(0)))
    blocks = Blocks()
    for block in scene.blocks:
        blocks.add(block.centre, block.shape.area)
    near = 1.0e-9
    for i, (low, high) in enumerate(boxes):
        if abs(low[1]) < near:
            blocks.joint(i, None, [low, [high[0], low[1]]], [0.0, 1.0])
        for j, (other_low, other_high) in enumerate(boxes):
            for along, across in ((0, 1), (1, 0)):
                start, end = max(low[along], other_low[along]), min(high[along], other_high[along])
                if end - start < near or abs(low[across] - other_high[across]) > near:
                    continue
                ends = np.zeros((2, 2))
                ends[:, along] = start, end
                ends[:, across] = low[across]
                blocks.joint(i, j, ends, [float(across == 0), float(across == 1)])
    return blocks


def tilts(table, quick):
    """The part of gravity along the wall at which it falls. Where joints slide, rest and motion may both be solutions: from the
    least load at which the motion that was found can begin to the most that the static program allows. Both are the same where
    none slides."""
    cases = [("wall of 4 x 4", wall, (4, 4), 0.6, 0.0), ("wall of 3 x 8", wall, (3, 8), 0.6, 0.0),
             ("wall of 3 x 8, open", wall, (3, 8), 0.6, 0.02), ("tower of 6 courses", tower, (6,), 0.7, 0.0)]
    if not quick:
        cases += [("wall of 6 x 6, open", wall, (6, 6), 0.7, 0.02), ("wall of 10 x 10", wall, (10, 10), 0.6, 0.0),
                  ("wall of 10 x 10", wall, (10, 10), 0.3, 0.0), ("wall of 10 x 10, open", wall, (10, 10), 0.6, 0.02),
                  ("wall of 10 x 10, open", wall, (10, 10), 0.8, 0.02), ("tower of 16 courses", tower, (16,), 0.7, 0.0),
                  ("tower of 16 courses, open", tower, (16,), 0.7, 0.02)]
    judge = Judge()
    for name, make, size, friction, gap in cases:
        def scene(lean, make=make, size=size, friction=friction, gap=gap):
            return make(*size, friction, lean=lean, gap=gap)
        joints = brick_joints(scene(0.0))
        most = joints.largest(friction, (1.0, 0.0))
        found = bisect(lambda lean, scene=scene: judge.stands(scene(lean)), most - 0.1, most + 3.1e-3, 2.0e-5)
        least = joints.least_of_motion(friction, judge.run(scene(found + 1.0e-3)).velocity, (1.0, 0.0))
        table.add("tilt", f"{name}, friction {friction}: acceleration along it over g", found, f"{least:.5f} to {most:.5f}",
                  np.max([least - found, found - most, 0.0]), 1.0e-4)
    table.add("tilt", "solves that missed their tolerance", judge.missed, 0, None, 0.0)


# ---- long rests

def rest(table, quick):
    """Many steps at rest with the settings that a user gets, and with a finer accuracy. Rest is the last fifth of the steps."""
    # an arch is small, and takes some 2000 steps to come to rest at the finer accuracy
    scenes = {"wall of 20 x 20": (lambda: wall(20, 20, 0.5), 0.5, 1000 if quick else 10000),
              "arch of 27, thickness 0.15": (lambda: arch(27, 0.15, 0.8), 0.15, 3000 if quick else 10000)}
    for name, (make, size, steps) in scenes.items():
        for settings, solver in (("defaults", {}), ("accuracy 0.01", {"accuracy": 0.01})):
            scene = make()
            found = scene.run(steps, solver=solver, output={"contacts": False})
            words = f"{name}, {settings}, {steps} steps"
            start = np.array([block.centre for block in scene.blocks])
            angles = np.array([block.angle for block in scene.blocks])
            late = found.iterations[-steps // 5:].mean()
            table.add("rest", f"{words}: iterations a step, first 200 steps", found.iterations[:200].mean())
            table.add("rest", f"{words}: iterations a step, all steps", found.iterations.mean())
            table.add("rest", f"{words}: iterations a step at rest", late, "at most 5", max(0.0, late - 5.0), 0.0)
            missed = found.history.converged == 0
            table.add("rest", f"{words}: solves that missed the accuracy, all steps", int(missed.sum()))
            table.add("rest", f"{words}: solves that missed the accuracy at rest", int(missed[-steps // 5:].sum()), 0, None, 0.0)
            sunk = (start - found.position)[:, 1].max() / size
            table.add("rest", f"{words}: largest sinking over the height of a block", sunk, 0.0, None, 1.0e-3)
            turn = np.abs(found.turn[:, 0] - angles).max()
            table.add("rest", f"{words}: largest turn [rad]", turn, 0.0, None, 1.0e-3)
            # rocking would show as motion that goes on
            energy = found.history.kinetic_energy[-steps // 5:].max() / (found.mass.sum() * GRAVITY * size)
            table.add("rest", f"{words}: kinetic energy at rest over m g height", energy, 0.0, None, 1.0e-7)
