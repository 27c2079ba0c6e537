"""Small nasty scenes made at random, each from its number alone."""
import numpy as np

from gravier_runs import merged
from hard_cases import METHODS, MOMENTS, Case
from small_scenes import G, Grain, plane


def scene(number):
    """A Case of a few grains whose masses span up to 6 decades and radii up to 2, which overlap, turn and fly, with any friction
    and restitution, step, walls and subdomains; with rolling friction, tangential restitution as the normal one, or adhesion."""
    rng = np.random.default_rng(number)
    dimension = int(rng.choice([2, 3]))
    count = int(rng.integers(2, 16))
    decades = rng.choice([0.0, 0.5, 2.0])
    radii = 0.05 * 10.0 ** (-decades * rng.random(count))
    masses = 10.0 ** (rng.choice([0.0, 1.0, 6.0]) * (rng.random(count) - 0.5))
    speed = rng.choice([0.0, 1.0, 100.0])
    # a dense cluster: each grain touches, overlaps or nearly touches one before it
    places = [np.zeros(dimension)]
    for k in range(1, count):
        other = int(rng.integers(k))
        way = rng.normal(size=dimension)
        distance = (radii[k] + radii[other]) * rng.choice([1.0, 1.0, rng.uniform(0.8, 1.0), rng.uniform(1.0, 1.1)])
        places.append(places[other] + way / np.linalg.norm(way) * distance)
    places = np.array(places)
    low = (places - radii[:, None]).min(0)
    high = (places + radii[:, None]).max(0)
    grains = [Grain(place, rng.normal(size=dimension) * speed, rng.normal(size=2 * dimension - 3) * speed / radius, radius, mass)
              for place, radius, mass in zip(places, radii, masses)]
    boundaries = []
    for d in range(dimension):
        for side, edge in ((1.0, low), (-1.0, high)):
            if rng.random() < 0.6:
                normal = np.eye(dimension)[d] * side
                boundaries.append(plane(np.eye(dimension)[d] * (edge[d] - side * rng.choice([0.0, 0.01])), normal))
    friction = float(rng.choice([0.0, 0.3, 1.0, 10.0]))
    restitution = float(rng.choice([0.0, 0.0, 0.5, 1.0]))
    gravity = np.zeros(3)
    gravity[:dimension] = rng.normal(size=dimension) * rng.choice([0.0, G])
    step = float(rng.choice([1e-5, 1e-3, 1e-1]))
    cells = np.maximum(np.floor((places.max(0) - places.min(0)) / (2.5 * radii.max())), 1.0).prod()
    groups = {"scene": {"gravity": [float(g) for g in gravity], "friction": friction, "restitution": restitution,
                        # small grains lie within large ones
                        "start_overlap": 1e3},
              "time": {"step": step}, "decomposition": {"kind": str(rng.choice(["dual", "primal"]))},
              "solver": {"max_iterations": 500, "check_every": int(rng.choice([1, 10]))}}
    more = effects(rng, dimension, masses, radii, friction, restitution)
    if "law" in more:
        friction = max(more["law"][0]["friction"], friction)
    groups = merged(groups, more)
    return Case(f"random scene {number}", "made at random", grains, boundaries, groups, steps=6, dimension=dimension,
                refuses=MOMENTS if any("rolling_friction" in keys for keys in (more.get("scene", {}), *more.get("law", []))) else "",
                subdomains=int(min(cells, rng.integers(1, 7))), may_fail=("all",),
                # without friction the velocities of a step are unique; what follows may part, since projections of overlaps end
                # before they are exact and leave other places on other partitions
                agree=1e-4 if friction == 0.0 else 0.0, agree_until=1)


def effects(rng, dimension, masses, radii, friction, restitution):
    """Groups of what a scene has beyond friction and restitution: in half of the scenes nothing."""
    kind = rng.choice(["none", "none", "none", "rolling", "tangential", "adhesion"])
    rolling = {"rolling_friction": float(rng.choice([0.01, 0.3, 10.0]))}
    if dimension == 3:
        rolling["pivoting_friction"] = float(rng.choice([0.0, 0.1, 10.0]))
    if kind == "rolling":
        return {"scene": rolling}
    if kind == "tangential":
        return {"scene": {"tangential_restitution": restitution}}
    if kind == "adhesion":
        law = {"materials": "sticky", "kind": "adhesive", "friction": friction,
               "adhesion": float(np.median(masses) * G * rng.choice([0.1, 10.0, 1e4])),
               "adhesion_range": float(radii.min() * rng.choice([1e-3, 0.2]))}
        law.update(rolling if rng.random() < 0.3 else {})
        # restitution of pairs without the law stays
        return {"material": [{"name": "sticky"}], "law": [law], **({"scene": {"wall_material": "sticky"}} if rng.random() < 0.5 else {})}
    return {}


def methods(number, count=2):
    """Titles of the methods that a scene is given to: all of them in turn, the first one always nlgs."""
    others = [title for title in METHODS if title != "nlgs"]
    return ["nlgs"] + [others[(number * (count - 1) + k) % len(others)] for k in range(count - 1)]
