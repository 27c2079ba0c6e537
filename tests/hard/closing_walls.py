"""Scenes whose walls close on grains: they have no solution, or none from the step on in which the grains are in touch with all of
the walls. There is a scene for each way in which iterations could fail to notice."""
import numpy as np

from small_scenes import G, Grain, floats, plane

RADIUS = 0.05
SPEED = 0.1


def walls(width, dimension=2, speed=SPEED, axis=0, start=0.0):
    """Two planes at `start` and `start + width` along an axis that move towards each other."""
    def along(value):
        return floats(value * np.eye(dimension)[axis])

    return [plane(along(start), along(1.0), velocity=along(speed)),
            plane(along(start + width), along(-1.0), velocity=along(-speed))]


def row(count, dimension=2, gap=0.0, mass=None, height=RADIUS):
    """Grains side by side along x, the first one at a gap from the plane x = 0."""
    masses = [0.7] * count if mass is None else mass
    rest = [height] if dimension == 2 else [0.0, height]
    return [Grain([RADIUS * (2 * k + 1) + gap, *rest], mass=m) for k, m in enumerate(masses)]


def scene(grains, boundaries, dimension=2, friction=0.0, gravity=0.0, steps=20, subdomains=4, **more):
    """Grains and input groups. Small grains above those of the scene touch nothing: they make it large enough to be divided."""
    width = max(grain.place[0] for grain in grains) - min(grain.place[0] for grain in grains)
    if len(boundaries) < 2 * dimension:
        middle = [grains[0].place[0] + 0.5 * width] + [0.0] * (dimension - 2)
        grains = grains + [Grain([*middle, 0.5 + 0.2 * k], radius=0.1 * RADIUS) for k in range(4)]
    down = [0.0, -gravity, 0.0] if dimension == 2 else [0.0, 0.0, -gravity]
    return grains, {
        "scene": {"dimension": dimension, "bodies": "file", "bodies_file": "bodies.csv", "gravity": down, "friction": friction,
                  **more},
        "boundary": boundaries,
        "time": {"step": 1e-3, "steps": steps},
        "decomposition": {"subdomains": subdomains},
        "output": {"directory": "results"},
    }


def judged_by(velocity, made):
    """The scene with a velocity scale of its own [m/s]."""
    grains, groups = made
    return grains, {**groups, "solver": {"velocity_scale": velocity}}


def floor(dimension=2):
    return plane([0.0] * dimension, [0.0] * (dimension - 1) + [1.0])


def beside(count, dimension=2, place=2.0):
    """Grains on the floor, away from the walls: columns of three."""
    rest = [] if dimension == 2 else [0.0]
    return [Grain([place + 2.2 * RADIUS * k, *rest, RADIUS * (2 * j + 1)]) for k in range(count) for j in range(3)]


def block(rows, columns):
    """Disks on a square grid, from the corner of the planes x = 0 and y = 0 on."""
    return [Grain([RADIUS * (2 * i + 1), RADIUS * (2 * j + 1)]) for j in range(rows) for i in range(columns)]


def shrinking(count, rate, **more):
    """A row across a period that shrinks: nothing is prescribed but the motion of the cell."""
    return scene(row(count), [], cell_strain_rate=[-rate, 0.0], period=[2 * RADIUS * count, 0.0], **more)


def light_and_heavy(count, mass, heavy):
    """A row of light grains between walls, on a floor that a heavy grain lies on, too: the residual is relative to what it weighs."""
    far = plane([0.0, 0.0], [1.0, 0.0], velocity=[SPEED, 0.0])
    near = {"shape": "grains", "group": 1, "velocity": [-SPEED, 0.0]}
    grains = row(count, mass=[mass] * count) + [Grain([RADIUS * (2 * count + 1), RADIUS], group=1)]
    return scene(grains + [Grain([2.0 + 3.0 * RADIUS * k, RADIUS], mass=heavy) for k in range(3)], [far, near, floor()],
                 friction=0.3, gravity=G)


def cube(count):
    """Spheres on a cubic grid, from the corner of the planes x = 0, y = 0 and z = 0 on."""
    places = RADIUS * (2 * np.stack(np.meshgrid(*[np.arange(count)] * 3), axis=-1).reshape(-1, 3) + 1)
    return [Grain(place) for place in places]


def impossible():
    """{name: (grains, groups)}."""
    d = 2 * RADIUS
    wedge = 0.2
    lean = [plane([0.0, 0.0], [np.cos(wedge), np.sin(wedge)], velocity=[SPEED, 0.0]),
            plane([0.0, 0.0], [-np.cos(wedge), np.sin(wedge)], velocity=[-SPEED, 0.0])]
    decades = [10.0 ** (k - 3) for k in range(6)]
    found = {
        "one disk": scene(row(1), walls(d), subdomains=2),
        "one disk, friction 0.3": scene(row(1), walls(d), friction=0.3, subdomains=2),
        "one disk, friction 1, gravity": scene(row(1), [*walls(d), floor()], friction=1.0, gravity=G, subdomains=2),
        # walls that close by 2 % of g h in a step are within the accuracy, unless the user says what counts
        "one disk, slow walls, gravity": judged_by(1e-4, scene(row(1), [*walls(d, speed=1e-4), floor()], gravity=G, subdomains=2)),
        "one sphere": scene(row(1, 3), walls(d, 3), 3, subdomains=2),
        "one sphere, friction 0.5, gravity": scene(row(1, 3), [*walls(d, 3), floor(3)], 3, 0.5, G, subdomains=2),
        "chain of 3": scene(row(3), walls(3 * d), friction=0.3),
        "chain of 10": scene(row(10), walls(10 * d)),
        "chain of 10, friction 1, gravity": scene(row(10), [*walls(10 * d), floor()], friction=1.0, gravity=G),
        "chain of 40": scene(row(40), walls(40 * d), friction=0.3),
        "chain of 10 spheres, friction 0.5": scene(row(10, 3), walls(10 * d, 3), 3, 0.5),
        "chain, masses over five decades": scene(row(6, mass=decades), walls(6 * d), friction=0.3),
        "gaps that close within the first step": scene(row(3, gap=2e-5), walls(3 * d + 4e-5), friction=0.3),
        "gaps that close in the fifth step": scene(row(3, gap=4.5e-4), walls(3 * d + 9e-4), friction=0.3),
        "one disk, others beside": scene(row(1) + beside(20), [
            # the other wall is of grains, so that there may be some beyond it
            walls(d)[0], {"shape": "grains", "group": 1, "velocity": [-SPEED, 0.0]}, floor()], friction=0.3, gravity=G),
        "one sphere, others beside": scene(row(1, 3) + beside(12, 3), [walls(d, 3)[0], {
            "shape": "grains", "group": 1, "velocity": [-SPEED, 0.0, 0.0]}, floor(3)], 3, 0.3, G),
        "disks in a box, sides close": scene(block(4, 4), [*walls(4 * d), floor()], friction=0.3, gravity=G),
        "disks in a box, all sides close": scene(block(3, 3), walls(3 * d) + walls(3 * d, axis=1), friction=0.5),
        "wedge of friction": scene([Grain([0.0, RADIUS / np.sin(wedge)])], lean, friction=1.0, gravity=G, subdomains=2),
        "restitution": scene(row(3), walls(3 * d), restitution=0.5, wall_restitution=0.5),
        "spheres in a box, all sides close": scene(
            cube(2), [wall for axis in range(3) for wall in walls(2 * d, 3, axis=axis)], 3, friction=0.5),
        "light chain beside heavy disks": light_and_heavy(10, 1e-3, 1e3),
        # the walls slide as they like, and move along their normals as prescribed
        "walls that forces move along the other axis": scene(
            row(3), [{**wall, "free": [False, True], "force": [0.0, 1.0], "mass": 1.0} for wall in walls(3 * d)], friction=0.3),
        "one wall closes, the other one is at rest": scene(row(3), [walls(3 * d)[0], plane([3 * d, 0.0], [-1.0, 0.0])], friction=0.3),
        "row across a period that shrinks": shrinking(10, 1.0, friction=0.3),
        "rolling friction": scene(row(3), [*walls(3 * d), floor()], friction=0.5, gravity=G, rolling_friction=0.1),
    }
    for name in ("one disk, others beside", "one sphere, others beside"):
        grains = found[name][0]
        rest = [RADIUS] if name.startswith("one disk") else [0.0, RADIUS]
        grains.insert(1, Grain([3 * RADIUS, *rest], group=1))
    return found
