"""Contact forces between grains: their distribution, the friction that they mobilise, coordination, and how they depend on the direction."""
import numpy as np

from .anisotropies import Anisotropy, angle_of, direction_of, size_of
from .mixing import states_since
from .results import along, tangents
from .tables import ResultsError, Table

#: forces over their mean between which the exponent of strong forces is fitted
STRONG = (1.0, 5.0)
#: a contact slides where friction is mobilised to this, as `sliding_fraction` of history.csv has it
SLIDES = 1.0 - 1e-6
#: laws of a constant coefficient of friction that bounds the force itself
CONSTANT = ("coulomb", "frictionless", "elastic", "hertz")
#: bins of directions over half a turn, and in space over a quarter
BINS = {2: 18, 3: 9}


def contact_forces(run, mean=1, region=None, box=None, friction=None, since=0.0):
    """Forces of the contacts between free grains that push, in written states with contacts: a row for `mean` states after each other, with means of step and
    time, contacts, normal_mean [N], and of the forces over the mean of their state normal_median, below_mean, the share below 1, beta and alpha, the exponents of strong and weak
    forces; tangential_mean, over normal_mean, tangential_beta; mobilised, the mean of |f_t|/(mu f_n), and sliding, the share that slides; grains, coordination and rattlers; a_c, a_n, a_t, the anisotropies of
    contacts, normal and tangential forces, and in the plane angle_c, angle_n, angle_t, their directions to x [degrees], sin_phi_fitted, which follows from them, and sin_phi of the mean stress of these
    contacts. In space there are fabric_xx, ..., axis_c_x, ... and the same of n and t, q_over_p_fitted and q_over_p.

    Contacts count whose points lie in the window, and grains whose centres do: the `region` of a name, or `box`, the numbers x0, x1, y0, y1[, z0, z1]. `friction` is the coefficient mu of
    all contacts; without it, that of the case. doc/measures.md has the formulae."""
    return table_of(networks(run, region, box, friction, since), mean)


def force_distribution(run, width=0.2, region=None, box=None, friction=None, since=0.0):
    """The distribution of the forces of all states over the mean of their state, a row for each bin of a `width`: force, the middle of the bin, contacts, normal, the probability density of
    normal forces, and tangential, that of the sizes of tangential forces over their own mean. The other arguments are those of contact_forces."""
    return distribution_of(networks(run, region, box, friction, since), width)


def force_directions(run, bins=None, region=None, box=None, friction=None, since=0.0):
    """Contacts and forces of all states by direction: angle, the middle of the bin [degrees], count, contacts, their density over that of equal directions, normal and tangential, the mean forces over the
    mean normal force of all directions, and the same with _fitted. In the plane the direction is that of the normal to x, from 0 to 180, and tangential forces are those along the
    normal turned to the left. In space it is the angle between the normal and z, from 0 to 90, and tangential forces are those away from z. The other arguments are those of contact_forces."""
    return directions_of(networks(run, region, box, friction, since), bins)


class Network:
    """The contacts of a state that count: `normals` (n, d), `normal` and `tangential` (n, d), forces over the mean normal force, which is `mean` [N], `limit`, mu of each contact, NaN
    where it is not known, `stress`, the sum of f_i l_j [N m] (d, d); `grains` and, over these, `neighbours` that push them; `held` by two contacts or more."""

    def __init__(self, run, step_and_time, contacts, window, friction):
        self.step, self.time = step, _ = step_and_time
        bodies = run.bodies(step)
        row, other = run._rows(bodies, contacts)
        pushes = contacts.impulse[:, 0] > 0.0
        free = np.zeros(len(bodies) + 1, dtype=bool)
        free[:-1] = bodies.boundary == 0 if "boundary" in bodies else True
        inside = np.append(window(step, bodies.position), False)
        self._count_ends(contacts, row, other, pushes, free & inside)
        chosen = pushes & free[row] & free[other]
        if window.is_set:
            chosen[chosen] = window(step, run.forces(step).point[chosen])
        self.normals = contacts.normal[chosen]
        force = contacts.impulse[chosen] / run.time_step()
        self.mean = float(force[:, 0].mean()) if len(force) else np.nan
        self.normal = force[:, 0] / self.mean
        self.tangential = along(force[:, 1:], tangents(self.normals)) / self.mean
        self.limit = np.full(len(force), friction) if friction is not None else _frictions(run, step, bodies, row[chosen], other[chosen])
        total = along(force, [self.normals, *tangents(self.normals)])
        self.stress = total.T @ run._branches(step, bodies, contacts)[chosen]

    def _count_ends(self, contacts, row, other, pushes, counted):
        points, neighbours = ends_of(contacts, row, other, pushes, len(counted))
        self.grains, self.neighbours = int(counted.sum()), int(neighbours[counted].sum())
        self.held = int((points[counted] > 1.5).sum())


def ends_of(contacts, row, other, pushes, count):
    """Points in which something pushes each of `count` bodies, the last of which stands for all boundaries, and neighbours that do. `row` and `other` are those of the contacts. Neighbours are as the
    diagnostic `structure` has them: the points in which a pair touches are one."""
    points, neighbours = np.zeros(count), np.zeros(count)
    pairs = np.unique(np.stack([contacts.candidate, contacts.antagonist], axis=1)[pushes], axis=0, return_index=True)[1]
    for rows in (row[pushes], other[pushes]):
        np.add.at(points, rows, 1.0)
        np.add.at(neighbours, rows[pairs], 1.0)
    return points, neighbours


class Window:
    """Which points count: those of a region, those of a box, or all."""

    def __init__(self, run, region, box):
        self.run, self.region, self.is_set = run, region, region is not None or box is not None
        if region is not None and box is not None:
            raise ResultsError(f"region {region!r} and a box: expected one of them")
        if box is not None:
            box = np.array(box, dtype=float)
            if box.shape != (2 * run.dimension,) or not np.all(box[::2] < box[1::2]):
                raise ResultsError(f"box {' '.join(f'{side:g}' for side in box.ravel())}: expected x0 x1 y0 y1{' z0 z1' if run.dimension == 3 else ''}, each lower side below the upper one")
        self.box = box

    def __call__(self, step, points):
        if not self.is_set:
            return np.ones(len(points), dtype=bool)
        if self.region is None:
            low, high = self.box[::2], self.box[1::2]
        else:
            rows = self.run.region(self.region, step)
            low, high = rows.lower.min(axis=0), rows.upper.max(axis=0)
        period = self._periods(step)
        # of the images of a point the first one above the lower side
        place = np.where(period > 0.0, np.mod(points - low, np.where(period > 0.0, period, 1.0)), points - low)
        return np.all((place >= 0.0) & (place < high - low), axis=1)

    def _periods(self, step):
        edges = self.run._edges(step).reshape(-1, self.run.dimension)
        if np.any(np.count_nonzero(edges, axis=1) > 1):
            raise ResultsError(f"{self.run.path}: step {step}: a cell that is sheared; expected no region and no box")
        return edges.sum(axis=0)


def networks(run, region=None, box=None, friction=None, since=0.0):
    """The contacts of the written states of a run from a time on, a Network each; states without contacts are left out."""
    if friction is not None and not 0.0 < friction < np.inf:
        raise ResultsError(f"friction {friction!r}: expected a number > 0")
    window, found = Window(run, region, box), []
    for step, time in states_since(run, since):
        # the start has contacts only after a restart, and no regions
        contacts = run.contacts(step) if step > 0 else None
        if contacts is not None:
            found.append(Network(run, (step, time), contacts, window, friction))
    if not found:
        raise ResultsError(f"{run.path}: no written state after the start has contacts; &output contacts = .true. writes them")
    return found


def table_of(found, mean=1):
    """The table of contact_forces, of the networks of a run."""
    if not isinstance(mean, (int, np.integer)) or not 1 <= mean <= len(found):
        raise ResultsError(f"mean {mean!r}: expected a whole number of states from 1 to {len(found)}, as many as there are")
    rows = [_figures(found[first:first + mean]) for first in range(0, len(found) - mean + 1, mean)]
    return Table({name: np.array([row[name] for row in rows]) for name in rows[0]})


def distribution_of(found, width=0.2):
    """The table of force_distribution, of the networks of a run."""
    normal, tangential = _normal(found), _sizes(found)
    if len(normal) == 0:
        raise ResultsError("no contact between grains pushes; expected some")
    if not 0.0 < width <= normal.max():
        raise ResultsError(f"width {width!r}: expected a number above 0, at most the largest force over the mean, {normal.max():g}")
    edges = width * np.arange(int(np.ceil(normal.max() / width)) + 1)
    edges[-1] = max(edges[-1], np.nextafter(normal.max(), np.inf))
    count = np.histogram(normal, edges)[0]
    mean = tangential.mean()
    return Table(force=width * (np.arange(len(count)) + 0.5), contacts=count, normal=count / (len(normal) * width),
                 tangential=np.histogram(tangential / mean, edges)[0] / (len(normal) * width) if mean > 0.0 else np.full(len(count), np.nan))


def directions_of(found, bins=None):
    """The table of force_directions, of the networks of a run."""
    normals, normal, tangential = _joined(found, "normals"), _normal(found), _joined(found, "tangential")
    d = normals.shape[1]
    bins, whole = BINS[d] if bins is None else bins, np.pi if d == 2 else 0.5 * np.pi
    if not isinstance(bins, (int, np.integer)) or bins < 1:
        raise ResultsError(f"bins {bins!r}: expected a whole number above 0")
    fit = Anisotropy(normals, normal, tangential)
    if d == 2:
        angle, across = np.arctan2(normals[:, 1], normals[:, 0]) % np.pi, np.sum(tangential * tangents(normals)[0], axis=1)
    else:
        # of a normal and its opposite the one that points up
        up, flat = np.where(normals[:, 2] < 0.0, -1.0, 1.0), np.linalg.norm(normals[:, :2], axis=1)
        angle = np.arctan2(flat, up * normals[:, 2])
        outward = np.sum(tangential[:, :2] * normals[:, :2], axis=1) / np.where(flat > 0.0, flat, 1.0)
        across = up * (normals[:, 2] * outward - flat * tangential[:, 2])
    width = whole / bins
    if d == 2:
        # bins about 0, one width, ...: directions of crystals are not at their ends
        place, middle, share = np.rint(angle / width).astype(int) % bins, width * np.arange(bins), np.full(bins, 1.0 / bins)
    else:
        place, middle = np.minimum((angle / width).astype(int), bins - 1), width * (np.arange(bins) + 0.5)
        share = -np.diff(np.cos(np.linspace(0.0, whole, bins + 1)))
    count = np.bincount(place, minlength=bins)
    with np.errstate(invalid="ignore", divide="ignore"):
        return Table(angle=np.degrees(middle), count=count, contacts=count / (len(normals) * share), contacts_fitted=_along_angle(fit.contacts, middle)[0],
                     normal=np.bincount(place, normal, bins) / count / fit.mean, normal_fitted=_along_angle(fit.normal, middle)[0],
                     tangential=np.bincount(place, across, bins) / count / fit.mean, tangential_fitted=_along_angle(fit.tangential, middle)[1])


def _along_angle(tensor, angle):
    """1 + n.D n and the part of D n across n, of the directions n at angles to x or, in space, the means of those at an angle to z."""
    if len(tensor) == 2:
        cosine, sine = np.cos(2.0 * angle), np.sin(2.0 * angle)
        return 1.0 + tensor[0, 0] * cosine + tensor[0, 1] * sine, tensor[0, 1] * cosine - tensor[0, 0] * sine
    return 1.0 + tensor[2, 2] * (1.5 * np.cos(angle)**2 - 0.5), -0.75 * tensor[2, 2] * np.sin(2.0 * angle)


def tail_exponent(forces, low=STRONG[0], high=STRONG[1]):
    """beta of a distribution exp(-beta f) of the forces from `low` to `high`, that of largest likelihood; NaN of less than two."""
    x, width = forces[(forces >= low) & (forces < high)] - low, high - low
    if len(x) < 2:
        return np.nan
    ends = [-50.0 / width, 500.0 / width]
    # the mean of an exponential that is cut at the width falls as beta grows
    for _ in range(60):
        trial = 0.5 * (ends[0] + ends[1])
        mean = 1.0 / trial - width / np.expm1(trial * width) if abs(trial * width) > 1e-6 else width * (0.5 - trial * width / 12.0)
        ends[0 if mean > x.mean() else 1] = trial
    return 0.5 * (ends[0] + ends[1])


def weak_exponent(forces):
    """alpha of a distribution f^alpha of the forces below 1, that of largest likelihood; NaN where there are none."""
    weak = forces[(forces > 0.0) & (forces < 1.0)]
    return -1.0 / np.log(weak).mean() - 1.0 if len(weak) else np.nan


def _joined(found, name):
    return np.concatenate([getattr(network, name) for network in found])


def _normal(found):
    return _joined(found, "normal")


def _sizes(found):
    return np.linalg.norm(_joined(found, "tangential"), axis=1)


def _figures(found):
    """A row of contact_forces: of some networks together."""
    normal, size, limit = _normal(found), _sizes(found), _joined(found, "limit")
    there = len(normal) > 0
    known = limit > 0.0
    used = size[known] / (limit * normal)[known]
    grains = sum(network.grains for network in found)
    means = [network.mean for network in found if np.isfinite(network.mean)]
    row = {"step": np.mean([network.step for network in found]), "time": np.mean([network.time for network in found]), "contacts": len(normal) / len(found),
           "normal_mean": np.mean(means) if means else np.nan, "normal_median": np.median(normal) if there else np.nan, "below_mean": np.mean(normal < 1.0) if there else np.nan,
           "beta": tail_exponent(normal), "alpha": weak_exponent(normal), "tangential_mean": size.mean() if there else np.nan,
           "tangential_beta": tail_exponent(size / size.mean()) if there and size.any() else np.nan,
           "mobilised": used.mean() if len(used) else np.nan, "sliding": np.mean(used >= SLIDES) if len(used) else np.nan, "grains": grains / len(found),
           "coordination": sum(network.neighbours for network in found) / grains if grains else np.nan,
           "rattlers": (grains - sum(network.held for network in found)) / len(found)}
    fit = Anisotropy(_joined(found, "normals"), normal, _joined(found, "tangential"))
    row.update({f"a_{letter}": size_of(tensor) for letter, tensor in _tensors(fit)})
    stress = sum(network.stress for network in found)
    stress = 0.5 * (stress + stress.T)
    pressure = np.trace(stress) / len(stress)
    deviator = stress / pressure - np.eye(len(stress)) if pressure > 0.0 else np.full(stress.shape, np.nan)
    if fit.dimension == 2:
        row.update({f"angle_{letter}": angle_of(direction_of(tensor)) for letter, tensor in _tensors(fit)})
        # (s1 - s2)/(s1 + s2)
        row.update(sin_phi_fitted=size_of(fit.stress()), sin_phi=size_of(deviator))
        return row
    axes = "xyz"
    row.update({f"fabric_{axes[a]}{axes[b]}": fit.fabric[a, b] for a in range(3) for b in range(a, 3)})
    row.update({f"axis_{letter}_{axis}": part for letter, tensor in _tensors(fit) for axis, part in zip(axes, direction_of(tensor))})
    row.update(q_over_p_fitted=size_of(fit.stress()), q_over_p=size_of(deviator))
    return row


def _tensors(fit):
    return (("c", fit.contacts), ("n", fit.normal), ("t", fit.tangential))


def _frictions(run, step, bodies, row, other):
    """The coefficient of friction of contacts between bodies, from the case; NaN of laws in which it is not a constant that bounds the force."""
    case = run.case_at(step)
    found = np.full(len(row), float(case.get("scene", [{}])[0].get("friction", 0.0)))
    if "material" not in bodies:
        return found
    pair = np.sort(np.stack([bodies.material[row], bodies.material[other]]), axis=0)
    number = {group.get("name"): k for k, group in enumerate(case.get("material", []), 1)}
    for law in case.get("law", []):
        names = law["materials"] if isinstance(law["materials"], list) else [law["materials"]]
        first, last = sorted((number[names[0]], number[names[-1]]))
        constant = law.get("kind") in CONSTANT and not law.get("pull_off_force")
        found[(pair[0] == first) & (pair[1] == last)] = float(law.get("friction", 0.0)) if constant else np.nan
    return found
