"""Parts of study_masonry.py with one block, or a few: slopes, prisms, sliding and toppling, rocking, overhangs, wedges."""
import numpy as np
from masonry_scene import EXACT, GRAVITY, STEP, Scene, bisect, bisect_all, rectangle, regular, spread, turned

#: a block that moves is faster than this share of a free fall after one step from rest
MOVES = 1.0e-6
#: where bounds are near rounding
TIGHT = {**EXACT, "tolerance": 1.0e-13}


# ---- slope

def on_plane(tangent, width=0.5, height=1.0, friction=0.5, turn=0.0, mirror=False, rounding=1.0e-3, **keys):
    """A block on a plane with gravity that leans: the slope falls to the right. All of it is turned, and mirrored before that."""
    theta = np.arctan(tangent)
    side = -1.0 if mirror else 1.0
    gravity = GRAVITY * turned([side * np.sin(theta), -np.cos(theta)], turn)
    scene = Scene(friction=friction, gravity=gravity, **keys)
    scene.plane(turned([0.0, 1.0], turn))
    scene.brick(width, height, turned([0.0, 0.5 * height], turn), turn, rounding)
    return scene


def upright(velocity, turn, mirror):
    """A velocity of the turned and mirrored case in the axes of the first one."""
    v = np.array([*turned(velocity[:2], -turn), velocity[2]])
    return v * [-1.0, 1.0, -1.0] if mirror else v


def slope(table, quick):
    slope_statics(table)
    slope_invariance(table)
    slope_topples(table)


def slope_statics(table):
    """A block that stands, and one that slides."""
    width, height = 0.5, 1.0
    for tangent in (0.1, 0.3, 0.45):
        found = on_plane(tangent).run()
        c = found.contacts
        weight = found.mass[0] * GRAVITY * STEP
        theta = np.arctan(tangent)
        force = found.impulses_on(0)
        off = np.linalg.norm(force - weight * np.array([-np.sin(theta), np.cos(theta)])) / weight
        table.add("slope", f"stick, tan {tangent}: sum of impulses against the weight", np.linalg.norm(force) / weight, 1.0, off,
                  1.0e-10)
        # the side at the bottom runs to the right, and so do its ends
        place = (c.impulse[:, 0] * np.array([-0.5, 0.5]) * width).sum() / c.impulse[:, 0].sum()
        table.add("slope", f"stick, tan {tangent}: place of the resultant below the centre line", place, 0.5 * height * tangent,
                  accepted=1.0e-10)
    steps, tangent, friction = 20, 0.7, 0.5
    theta = np.arctan(tangent)
    found = on_plane(tangent, width=0.8, friction=friction).run(steps, solver=TIGHT)
    expected = GRAVITY * (np.sin(theta) - friction * np.cos(theta))
    table.add("slope", "slide, tan 0.7, friction 0.5: acceleration over 20 steps", found.velocity[0, 0] / (steps * STEP), expected,
              accepted=1.0e-11)
    table.add("slope", "slide: spin over acceleration", abs(found.velocity[0, 2]) / (steps * STEP), 0.0, None, 1.0e-11)


def slope_invariance(table):
    """Turns by right angles, mirror images, ranks, subdomains and the order of bodies change velocities by rounding."""
    for what, tangent, width, friction in (("slides", 0.7, 0.8, 0.5), ("topples", 0.6, 0.5, 1.0), ("does both", 0.9, 0.2, 0.5)):
        first = on_plane(tangent, width, friction=friction).run(20, solver=TIGHT)
        worst = 0.0
        for turn, mirror in ((0.0, True), (0.5 * np.pi, False), (np.pi, False), (-0.5 * np.pi, True)):
            found = on_plane(tangent, width, friction=friction, turn=turn, mirror=mirror).run(20, solver=TIGHT)
            worst = max(worst, np.abs(upright(found.velocity[0], turn, mirror) - first.velocity[0]).max())
        table.add("slope", f"turned by right angles, mirrored, {what}: velocity [m/s]", worst, 0.0, None, 1.0e-12)
    found = {}
    for subdomains in (1, 2, 4):
        for ranks in (1, 2):
            if ranks <= subdomains:
                found[subdomains, ranks] = pairs_on_slope().run(5, solver={**TIGHT, "method": "nscdd"}, ranks=ranks,
                                                                decomposition={"subdomains": subdomains})
    for subdomains in (2, 4):
        same = np.array_equal(found[subdomains, 1].velocity, found[subdomains, 2].velocity)
        table.add("slope", f"blocks on blocks in {subdomains} subdomains: 1 and 2 ranks agree to the bit", int(same), 1, None, 0.0)
        off = np.abs(found[subdomains, 1].velocity - found[1, 1].velocity).max()
        table.add("slope", f"blocks on blocks in {subdomains} subdomains against 1: velocity [m/s]", off, 0.0, None, 1.0e-12)
    off = np.abs(pairs_on_slope(True).run(5, solver=TIGHT).velocity[::-1] - pairs_on_slope().run(5, solver=TIGHT).velocity).max()
    table.add("slope", "blocks on blocks, the other order of bodies: velocity [m/s]", off, 0.0, None, 1.0e-12)


def pairs_on_slope(swapped=False):
    """Blocks that stand, each with one on it that slides."""
    scene = on_plane(0.55, 1.0, 0.5, 0.4, wall_friction=0.7)
    for k in range(16):
        if k > 0:
            scene.brick(1.0, 0.5, [1.5 * k, 0.25])
        scene.brick(0.5, 0.25, [1.5 * k + 0.02 * (k - 8), 0.625])
    if swapped:
        scene.blocks.reverse()
    return scene


def topplers():
    """Blocks that topple, each on a ramp of its own that is a fixed block: names, exact angles, and a function that says at which
    of so many angles they stand."""
    brick = [rectangle(0.5, 1.0)]
    variants = {
        **{f"rounding {rounding:g}": (brick, 0.5, rounding, {}) for rounding in (1.0e-3, 1.0e-2, 1.0e-4)},
        "to the other side": (brick, 0.5, 1.0e-3, {"mirror": True}), "upside down": (brick, 0.5, 1.0e-3, {"side": 2}),
        "on another side of the ramp": (brick, 0.5, 1.0e-3, {"ramp_side": 1}),
        "the block before its ramp in the file": (brick, 0.5, 1.0e-3, {"first": True}),
        "two pieces above each other": ([rectangle(0.5, 0.5) + [0, -0.25], rectangle(0.5, 0.5) + [0, 0.25]], 0.5, 1.0e-3, {}),
        "two pieces beside each other": ([rectangle(0.25, 1.0) + [-0.125, 0], rectangle(0.25, 1.0) + [0.125, 0]], 0.5, 1.0e-3, {}),
        **{f"regular, {n} sides": ([regular(n)], np.tan(np.pi / n), 1.0e-3, {}) for n in (3, 4, 5, 6, 8, 12)}}

    def stand(angles):
        scene = Scene(friction=3.0)
        pairs = [put_on_ramp(scene, shape, rounding, angle, at, **how)
                 for (shape, _, rounding, how), angle, at in zip(variants.values(), angles, spread(len(variants), 20.0))]
        found = scene.run()
        return [found.speed([k]) < MOVES for k in pairs]

    return list(variants), np.array([np.arctan(tangent) for _, tangent, _, _ in variants.values()]), stand


def slope_topples(table):
    """Angles at which blocks topple."""
    names, exact, stand = topplers()
    angles = bisect_all(stand, exact - 3.0e-3, exact + 2.5e-3, 5.0e-6)
    for name, angle, expected in zip(names, angles, exact):
        table.add("slope", f"toppling angle, {name}", angle, expected, None, 1.0e-4)
    theta = np.arctan(0.5)
    for what, keys in (("on a plane", {}), ("on a plane, turned by a right angle", {"turn": 0.5 * np.pi})):
        def stands(a, keys=keys):
            return on_plane(np.tan(a), friction=1.0, **keys).run().speed() < MOVES
        angle = bisect(stands, theta - 3.0e-3, theta + 2.5e-3, 1.0e-5)
        table.add("slope", f"toppling angle, {what}", angle, theta, None, 1.0e-4)
    for ranks in (1, 2):
        runs = [rows_of_blocks(theta + way).run(solver={**EXACT, "method": "nscdd"}, ranks=ranks, decomposition={"subdomains": 2})
                for way in (-1.0e-4, 1.0e-4)]
        right = [found.speed() < MOVES for found in runs] == [True, False]
        words = f"16 blocks stand 1e-4 below the angle, topple above: 2 subdomains, ranks {ranks}"
        table.add("slope", words, int(right), 1, None, 0.0)


def rows_of_blocks(angle):
    """Blocks of width 0.5 and height 1 beside each other on a slope."""
    scene = on_plane(np.tan(angle), friction=1.0)
    for k in range(1, 16):
        scene.brick(0.5, 1.0, [1.5 * k, 0.5])
    return scene


def put_on_ramp(scene, pieces, rounding, angle, at, mirror=False, side=0, ramp_side=0, first=False):
    """A block on a fixed one that slopes down to the right, or to the left. Returns the number of the block."""
    height = -min(piece[:, 1].min() for piece in pieces)
    sense = 1.0 if mirror else -1.0
    ramp = scene.shape([rectangle(4.0, 4.0)])
    places = [(ramp, turned([0.0, -2.0], sense * angle) + at, sense * angle + 0.5 * np.pi * ramp_side, True),
              (scene.shape(pieces, rounding), turned([0.0, height], sense * angle) + at, sense * angle + 0.5 * np.pi * side, False)]
    numbers = {}
    for shape, place, turn, fixed in places[::-1] if first else places:
        numbers[fixed] = scene.put(shape, place, turn, fixed=fixed)
    return numbers[False]


# ---- prisms in space

def quaternion(axis, angle):
    return np.array([np.cos(0.5 * angle), *(np.sin(0.5 * angle) * np.asarray(axis, float))])


def times(a, b):
    """Product of quaternions: first b, then a."""
    return np.array([a[0] * b[0] - a[1:] @ b[1:], *(a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:]))])


def rotated(q, x):
    """A vector turned by a quaternion."""
    return x + 2.0 * np.cross(q[1:], np.cross(q[1:], x) + q[0] * np.asarray(x, float))


def reach(base, direction):
    """Distance from the origin to the border of a convex base along a direction."""
    ends = np.roll(base, -1, axis=0)
    out = np.column_stack([ends[:, 1] - base[:, 1], base[:, 0] - ends[:, 0]])
    level = (out * base).sum(1)
    slope_of = out @ direction
    return (level[slope_of > 0] / slope_of[slope_of > 0]).min()


def prism_cases(quick):
    """Prisms and directions: name, base, height, direction of the fall, tangent of the angle at which it topples: where the
    vertical through the centre leaves the base."""
    cases = []
    for n, height in ((4, 2.0), (6, 3.0), (8, 3.0), (12, 3.0), (16, 3.0), (24, 3.0), (48, 3.0)):
        for share in (0.0, 0.3, 0.5, 1.0) if not quick else (0.0, 0.5):
            # from the middle of a side to a corner
            direction = -0.5 * np.pi + share * np.pi / n
            tangent = reach(regular(n), np.array([np.cos(direction), np.sin(direction)])) / (0.5 * height)
            name = f"{n} sides, {np.degrees(share * np.pi / n):.1f} degrees from a side"
            cases.append((name, regular(n), height, direction, tangent))
    cases.append(("cube", rectangle(2.0, 2.0), 2.0, 0.0, 1.0))
    for k in (1, 2):
        cases.append((f"12 sides, side {k}", regular(12), 3.0, (k / 6.0 - 0.5) * np.pi, 2.0 / 3.0))
    # a pair of pieces keeps 64 points: of more corners some are left out
    for k in range(2):
        cases.append((f"96 sides, 64 points, side {k}", regular(96), 3.0, (k / 48.0 - 0.5) * np.pi, 2.0 / 3.0))
    return cases


#: faces of 48 corners near their limit: sweeps end after 200 000 at residuals of 1e-8 to 1e-7
BY_NEWTON = {**EXACT, "method": "newton"}


def prisms_stand(cases):
    """A function that says at which of so many angles they stand on fixed blocks."""
    places = spread(len(cases), 20.0)

    def stand(angles):
        scene = Scene(3, friction=3.0)
        for (_, base, height, direction, _), angle, at in zip(cases, angles, places):
            # the slope falls along x
            lean = quaternion([0.0, 1.0, 0.0], angle)
            ramp = scene.prism(rectangle(8.0, 8.0), 8.0)
            scene.put(ramp, rotated(lean, np.array([0.0, 0.0, -4.0])) + [*at, 0.0], lean, fixed=True)
            scene.put(scene.prism(base, height), rotated(lean, np.array([0.0, 0.0, 0.5 * height])) + [*at, 0.0],
                      times(lean, quaternion([0.0, 0.0, 1.0], -direction)))
        found = scene.run(solver=BY_NEWTON)
        return [found.speed([2 * k + 1]) < MOVES for k in range(len(cases))]

    return stand


def prisms(table, quick):
    """Angles at which prisms topple in several directions."""
    cases = prism_cases(quick)
    exact = np.arctan([case[-1] for case in cases])
    # points that a face lacks make a prism topple early
    angles = bisect_all(prisms_stand(cases), 0.5 * exact, exact + 2.5e-3, 2.0e-5)
    for (name, *_), angle, expected in zip(cases, angles, exact):
        accepted = None if "64 points" in name else 1.0e-4
        table.add("prisms", f"toppling angle on a block, {name}", angle, expected, accepted=accepted)
    for name, base, height, direction, tangent in cases[:11:2] if quick else cases[:-2]:
        def stands(angle):
            scene = Scene(3, friction=3.0, gravity=GRAVITY * np.array([np.sin(angle), 0.0, -np.cos(angle)]))
            scene.plane([0.0, 0.0, 1.0])
            scene.put(scene.prism(base, height), [0.0, 0.0, 0.5 * height], quaternion([0.0, 0.0, 1.0], -direction))
            return scene.run(solver=BY_NEWTON).speed() < MOVES
        theta = np.arctan(tangent)
        angle = bisect(stands, 0.5 * theta, theta + 2.5e-3, 2.0e-5)
        table.add("prisms", f"toppling angle on a plane, {name}", angle, theta, None, 1.0e-4)


# ---- sliding and toppling

def regions(tangent, ratio, friction):
    """What a block of height 1 and width `ratio` does on a slope from rest: (slides, turns)."""
    theta = np.arctan(tangent)
    if tangent <= ratio:
        # it slides upright if the friction at its base does not turn it
        return (tangent > friction, tangent > friction and ratio < friction)
    # it turns about its lower corner, with the moment of inertia (w^2 + h^2)/3, if that does not slip
    spin_up = 1.5 * (np.sin(theta) - ratio * np.cos(theta)) / (ratio**2 + 1.0)
    along, across = np.sin(theta) - 0.5 * spin_up, np.cos(theta) + 0.5 * ratio * spin_up
    if abs(along) <= friction * across:
        return (False, True)
    return (True, ratio < friction)


def slide_topple(table, quick, n=None):
    n = n or (8 if quick else 20)
    friction = 0.5
    grid = [((i + 0.5) * 1.2 / n, (j + 0.5) * 1.2 / n) for i in range(n) for j in range(n)]
    scene = Scene(friction=friction)
    blocks = [put_on_ramp(scene, [rectangle(ratio, 1.0)], 1.0e-3, np.arctan(tangent), at)
              for (tangent, ratio), at in zip(grid, spread(len(grid), 20.0))]
    found = scene.run()
    right = 0
    for (tangent, ratio), k in zip(grid, blocks):
        v = found.velocity[k] / (GRAVITY * STEP)
        along = turned([1.0, 0.0], -np.arctan(tangent))
        arm = turned([0.5 * ratio, -0.5], -np.arctan(tangent))
        slip = (v[:2] + v[2] * np.array([-arm[1], arm[0]])) @ along
        right += (abs(slip) > MOVES, abs(v[2]) > MOVES) == regions(tangent, ratio, friction)
    table.add("map", f"sliding and toppling, {n} x {n} points: right ones", int(right), n * n, None, 0.0)


# ---- rocking

def fall_time(alpha, theta, rate):
    """Time that a block takes from rest at an angle to upright: the integral of the equation of motion, of any width."""
    # theta - u^2 takes the root at the start away
    place, weight = np.polynomial.legendre.leggauss(40)
    u, beta = 0.5 * np.sqrt(theta) * (place + 1.0), alpha - theta
    return (weight * 2.0 * u / np.sqrt(2.0 * (np.cos(beta) - np.cos(beta + u * u)))).sum() * 0.5 * np.sqrt(theta) / rate


def rocking(table, quick, cases=((1.0e-3, 1.0e-2, 2.0e-3), (1.0e-4, 2.0e-3, 1.0e-3))):
    """A block let go at half of the angle at which it is in balance, against the rocking of Housner (1963)."""
    # a round corner stands further inside than a sharp one, and rolls: of first order in the rounding over the width
    for rounding, accepted_time, accepted_ratio in cases:
        for width in (0.2, 0.4):
            alpha = np.arctan(width)
            theta = 0.5 * alpha
            rate = np.sqrt(1.5 * GRAVITY / np.hypot(width, 1.0))
            quarter = fall_time(alpha, theta, rate)
            step = 1.0e-4
            scene = Scene(friction=2.0)
            scene.plane([0.0, 1.0])
            # the lower right corner stands on the plane
            corner = turned([0.5 * width - rounding, -0.5 + rounding], -theta)
            scene.brick(width, 1.0, [0.0, rounding - corner[1]], -theta, rounding)
            found = scene.run(int(1.5 * quarter / step), step, output={"energy": True, "contacts": False})
            h = found.history
            last = int(np.argmax(h.kinetic_energy[:int(1.2 * quarter / step)]))
            # energy above that of the block at rest
            above = h.kinetic_energy + h.potential_energy - found.mass[0] * GRAVITY * 0.5
            name = f"width {width}, rounding {rounding:g}"
            simple = np.arccosh(1.0 / (1.0 - theta / alpha)) / rate
            table.add("rocking", f"{name}: quarter period over the exact one", h.time[last] / quarter, 1.0, None, accepted_time)
            table.add("rocking", f"{name}: quarter period over Housner's for slender blocks", h.time[last] / simple)
            table.add("rocking", f"{name}: spin after over before the impact", np.sqrt(above[last + 10] / above[last - 10]),
                      1.0 - 1.5 * np.sin(alpha)**2, None, accepted_ratio)


# ---- overhang

STACKS = (1, 2, 4, 8)


def stacks_stand(shares):
    """Which stacks over an edge stand at such shares of the harmonic overhang."""
    scene, stacks = Scene(friction=0.5), []
    for n, share, at in zip(STACKS, shares, spread(len(STACKS), 20.0)):
        scene.brick(4.0, 1.0, at + [-2.0, -0.5], fixed=True)
        x, numbers = 0.0, []
        for k in range(n, 0, -1):
            # the k-th from above reaches over the one below it by 1/(2k)
            x += share * 0.5 / k
            numbers.append(scene.brick(1.0, 0.25, at + [x - 0.5, 0.125 + 0.25 * (n - k)]))
        stacks.append(numbers)
    found = scene.run()
    return [found.speed(numbers) < MOVES for numbers in stacks]


def overhang(table, quick):
    """Stacks over an edge: each block, counted from above, overhangs by the harmonic part of its length."""
    for share, words, expected in ((0.999, "stands", True), (1.001, "falls", False)):
        for n, stands in zip(STACKS, stacks_stand([share] * len(STACKS))):
            table.add("overhang", f"{n} blocks at {share} of the harmonic value: {words}", int(stands == expected), 1, None, 0.0)
    found = bisect_all(stacks_stand, [0.99] * len(STACKS), [1.01] * len(STACKS), 1.0e-5)
    for n, share in zip(STACKS, found):
        table.add("overhang", f"{n} blocks: share of the harmonic value at which they fall", share, 1.0, None, 1.0e-4)


# ---- wedge

def wedge_stands(angle, friction, above=1.0):
    """Whether a wedge with so much between its sides is held by two blocks that a weight presses on it: gravity acts along -x, one
    block is fixed, and the other slides between planes without friction."""
    beta = 0.5 * angle
    scene = Scene(friction=friction, gravity=[-GRAVITY, 0.0])
    half, back = 1.0, 1.0
    lean = half * np.tan(beta)
    left = np.array([[-3.0, -half], [-back + lean, -half], [-back - lean, half], [-3.0, half]])
    right = np.array([[back - lean, -half], [3.0, -half], [3.0, half], [back + lean, half]])
    cut = 0.5
    wide, narrow = back + cut * np.tan(beta), back - cut * np.tan(beta)
    wedge = np.array([[-narrow, -cut], [narrow, -cut], [wide, cut], [-wide, cut]])
    scene.put(scene.shape([left]), [0.0, 0.0], fixed=True)
    block = scene.put(scene.shape([wedge]), [0.0, 0.0])
    scene.put(scene.shape([right]), [0.0, 0.0])
    scene.plane([0.0, 1.0], [0.0, -half], friction=0.0)
    scene.plane([0.0, -1.0], [0.0, half], friction=0.0)
    return scene.run().speed([block]) < MOVES


def wedge(table, quick):
    for friction in (0.2, 0.5, 0.8):
        limit = 2.0 * np.arctan(friction)
        found = bisect(lambda angle, mu=friction: wedge_stands(angle, mu), limit - 0.01, limit + 0.0123, 2.0e-5)
        table.add("wedge", f"friction {friction}: largest angle of a wedge that two blocks hold", found, limit, None, 1.0e-4)
