"""Parts of study_masonry.py with blocks that move: dominoes, and scenes that are turned, mirrored or made of other pieces."""
import numpy as np
from masonry_scene import GRAVITY, Scene, rectangle, turned


# ---- dominoes

def row_of_dominoes(count, thickness, pitch, scale, friction):
    """Upright dominoes of height 1 times the scale, the first one pushed over. They do not slide on the floor."""
    scene = Scene(friction=friction, wall_friction=3.0, alert_distance=0.02 * scale, skin=0.05 * scale)
    scene.plane([0.0, 1.0])
    for k in range(count):
        # it turns about its lower right corner
        spin = -1.0 / np.sqrt(scale) if k == 0 else 0.0
        velocity = [-0.5 * scale * spin, -0.5 * thickness * scale * spin, spin]
        scene.brick(thickness * scale, scale, [k * pitch * scale, 0.5 * scale], rounding=5.0e-4 * scale, velocity=velocity)
    return scene


def wave_speed(count, thickness, pitch, scale=1.0, friction=0.0, steps_of_unit=1000):
    """Speed of the front in the second half of the row [m/s], from the times at which dominoes lean by 0.02."""
    step = np.sqrt(scale / GRAVITY) / steps_of_unit
    scene = row_of_dominoes(count, thickness, pitch, scale, friction)
    # the front travels about the height in such a unit of time
    steps = int((1.1 * count * pitch + 1.0) * steps_of_unit)
    found = scene.run(steps, step, solver={"criterion": "residual", "tolerance": 1.0e-6, "max_iterations": 1000},
                      output={"every": 20, "contacts": False})
    times = np.array([t for t, _ in found.turns])
    lean = np.array([-angle[:, 0] for _, angle in found.turns])
    passed = np.flatnonzero(lean[-1] > 0.02)
    when = []
    for i in (count // 2, passed[-1]):
        k = np.argmax(lean[:, i] > 0.02)
        when.append(np.interp(0.02, lean[k - 1:k + 1, i], times[k - 1:k + 1]))
    return (passed[-1] - count // 2) * pitch * scale / (when[1] - when[0])


def model_speed(thickness, pitch, count=60, points=400):
    """Speed over sqrt(g height) in the model of van Leeuwen (arXiv:physics/0401018) without friction between dominoes: they turn
    about their lower corners, lean on each other once they have met, and meet without rebound."""
    meet = np.arcsin(pitch - thickness)
    inertia = (1.0 + thickness**2) / 3.0
    # angles of the front domino, finer at the start, and of those behind it
    front = meet * np.linspace(0.0, 1.0, points)**2

    def energies(n):
        """Effective inertia and potential energy of the front and n - 1 dominoes behind it, of mass and gravity 1."""
        angle, rate = front.copy(), np.ones(points)
        total, height = np.zeros(points), np.zeros(points)
        for k in range(n):
            total += inertia * rate**2
            height += 0.5 * (np.cos(angle) + thickness * np.sin(angle))
            behind = angle + np.arcsin(np.clip(pitch * np.cos(angle) - thickness, -1.0, 1.0))
            # of sin(behind - angle) = pitch cos(angle) - thickness
            rate = rate * (1.0 - pitch * np.sin(angle) / np.cos(behind - angle))
            angle = behind
        return total, height

    spin, period = 0.5, np.nan
    for n in range(1, count):
        total, height = energies(n)
        moving = np.sqrt(np.maximum(total[0] * spin**2 + 2.0 * (height[0] - height), 1.0e-12) / total)
        period = (np.diff(front) * 0.5 * (1.0 / moving[1:] + 1.0 / moving[:-1])).sum()
        # the one in front takes its share
        spin = moving[-1] * total[-1] / (total[-1] + inertia)
    return pitch / period


def dominoes(table, quick):
    count, unit = 30, 250 if quick else 1000
    for pitch in (0.5,) if quick else (0.35, 0.5, 0.7):
        words = f"thickness 0.15, pitch {pitch} of the height"
        speed = wave_speed(count, 0.15, pitch, steps_of_unit=unit)
        for scale, accepted in ((0.25, 1.0e-12), (0.5, 1.0e-3)):
            # powers of 2 leave all digits as they are, other ones round, and solves stop elsewhere
            small = wave_speed(count, 0.15, pitch, scale, steps_of_unit=unit)
            ratio, expected = speed / small, np.sqrt(1.0 / scale)
            table.add("dominoes", f"{words}: speed over that of {scale:g} of the size", ratio, expected, None, accepted)
        table.add("dominoes", f"{words}: speed over sqrt(g height), against the model of van Leeuwen", speed / np.sqrt(GRAVITY),
                  model_speed(0.15, pitch), abs(speed / np.sqrt(GRAVITY) / model_speed(0.15, pitch) - 1.0), 0.03)
        if not quick:
            rough = wave_speed(count, 0.15, pitch, friction=0.2, steps_of_unit=unit)
            table.add("dominoes", f"{words}: the same with friction 0.2 between them", rough / np.sqrt(GRAVITY))


# ---- the same scene turned, mirrored, in other pieces

def falling(turn=0.0, mirror=False, seed=7):
    """Polygons that fall into a corner of three planes, turned by an angle, and mirrored before that."""
    rng = np.random.default_rng(seed)
    side = -1.0 if mirror else 1.0
    scene = Scene(friction=0.4, gravity=turned([0.0, -GRAVITY], turn))
    for normal, point in (([0.0, 1.0], [0.0, 0.0]), ([1.0, 0.0], [-1.6, 0.0]), ([-1.0, 0.0], [1.6, 0.0])):
        scene.plane(turned(np.array(normal) * [side, 1.0], turn), turned(np.array(point) * [side, 1.0], turn))
    for k in range(12):
        n = 3 + k % 5
        angles = np.sort(rng.random(n) * 0.6 + np.arange(n)) * 2.0 * np.pi / n
        corners = 0.3 * np.column_stack([np.cos(angles), np.sin(angles)])
        place = np.array([-1.05 + 0.7 * (k % 4), 0.5 + 0.7 * (k // 4)])
        velocity = np.array([*(rng.random(2) - 0.5), 2.0 * rng.random() - 1.0])
        if mirror:
            # corners go on running anticlockwise, from the same one
            corners = np.roll((corners * [-1.0, 1.0])[::-1], 1, axis=0)
            place, velocity = place * [-1.0, 1.0], velocity * [-1.0, 1.0, -1.0]
        velocity[:2] = turned(velocity[:2], turn)
        scene.put(scene.shape([corners]), turned(place, turn), turn, velocity)
    return scene


def invariance(table, quick):
    """Velocities before rounding grows: 12 polygons that have fallen on each other."""
    solver = {"criterion": "residual", "tolerance": 1.0e-14, "max_iterations": 20000}
    steps = 250
    first = falling().run(steps, solver=solver)
    table.add("turned", f"falling polygons: contacts after {steps} steps", float(first.history.contacts[-1]))
    for words, turn, mirror in (("turned by a right angle", 0.5 * np.pi, False), ("turned by two", np.pi, False),
                                ("mirrored", 0.0, True), ("mirrored and turned by a right angle", -0.5 * np.pi, True)):
        found = falling(turn, mirror).run(steps, solver=solver)
        v = np.column_stack([turned(found.velocity[:, :2], -turn), found.velocity[:, 2]])
        if mirror:
            v = v * [-1.0, 1.0, -1.0]
        off = np.abs(v - first.velocity).max()
        table.add("turned", f"falling polygons {words}, {steps} steps: velocity [m/s]", off, 0.0, None, 1.0e-12)
    quarter = rectangle(0.25, 0.25)
    pieces = [[rectangle(0.5, 0.5)], [quarter + [x, y] for y in (-0.125, 0.125) for x in (-0.125, 0.125)]]
    # the square falls on its side, on a corner, and on another one
    for words, make in (("falls on its side and slides", lambda s: square(s, [0.3, 0.0, 0.0], 0.0, 0.26)),
                        ("falls on its corner", lambda s: square(s, [0.3, -1.0, 1.0], 0.3, 0.4)),
                        ("falls on another one", lambda s: square(s, [0.1, -1.0, 0.0], 0.0, 0.8, True))):
        runs = [make(shape).run(200, solver=solver) for shape in pieces]
        off = max(np.abs(runs[0].velocity - runs[1].velocity).max(), np.abs(runs[0].position - runs[1].position).max())
        table.add("pieces", f"a square of 2 x 2 squares against one, {words}: velocity [m/s], place [m]", off, 0.0, None, 1.0e-12)
    # what falls and slides meets another one in the last steps, with a gap and a tangential impulse that turns it
    for words, make in (("square that falls on its corner", lambda s: square(pieces[0], [0.3, -1.0, 0.5], 0.0, 0.8, True, s)),
                        ("tall brick that falls upright", tall)):
        runs = [make(swapped).run(42, solver=solver) for swapped in (False, True)]
        off = np.abs(runs[0].velocity - runs[1].velocity[::-1]).max()
        table.add("turned", f"a {words}, bodies in the other order: velocity [m/s]", off, 0.0, None, 1.0e-12)


def square(pieces, velocity, angle, height, other=False, swapped=False):
    """A square over a plane, or over another one that stands there."""
    scene = Scene(friction=0.4)
    scene.plane([0.0, 1.0])
    if other:
        scene.put(scene.shape(pieces), [0.1, 0.25])
    scene.put(scene.shape(pieces), [0.0, height], angle, velocity)
    if swapped:
        scene.blocks.reverse()
    return scene


def tall(swapped):
    """A tall brick that falls and slides on a wide one."""
    scene = Scene(friction=0.4)
    scene.plane([0.0, 1.0])
    scene.brick(1.0, 0.5, [0.0, 0.25])
    scene.brick(0.2, 1.0, [0.0, 1.0493], velocity=[3.0, -1.0, 0.0])
    if swapped:
        scene.blocks.reverse()
    return scene


def landing(table, quick):
    """Bricks that fall on a plane and on a fixed block, leaning a little to one side or the other, lie flat at the end.
    Corners that reach farther as the angle falls leave an overlap, at most a hundredth of the rounding of 1e-3."""
    for words, on_block in (("plane", False), ("block", True)):
        for lean in (-0.01, 0.01):
            scene = Scene(friction=0.5)
            if on_block:
                scene.brick(4.0, 1.0, [0.0, -0.5], fixed=True)
            else:
                scene.plane([0.0, 1.0])
            k = scene.brick(1.0, 0.5, [0.0, 0.27], lean)
            found = scene.run(400)
            off = max(abs(found.turn[k, 0]), abs(found.position[k, 1] - 0.25))
            table.add("landing", f"a brick that leans by {lean} lands on a {words}: angle, height [m]", off, 0.0, None, 1.0e-5)
