"""The three processes of study_dem.py as both codes read them, and what is measured of each: settling, shear and discharge."""
from dataclasses import dataclass, field

import numpy as np
from dem_codes import contacts_a_grain, mean_and_error, rate_and_error, read_dump, read_thermo, run_gravier, solid_fraction, touching
from study_support import lattice, read_bodies, read_history, states, write_hdf5

SMALLEST, LARGEST, DENSITY = 0.8e-3, 1.2e-3, 2600.0  # m, kg/m^3
CELL = 2.05 * LARGEST
GRAVITY = 9.81
RESTITUTION = 0.2
# of the springs of smooth DEM: damping over the critical one, and the mass by which LAMMPS scales its dashpots
DAMPING = -np.log(RESTITUTION) / np.hypot(np.pi, np.log(RESTITUTION))
MEAN_VOLUME = np.pi / 3.0 * (LARGEST**4 - SMALLEST**4) / (LARGEST - SMALLEST)
PAIR_MASS = 0.5 * DENSITY * MEAN_VOLUME


# of grains that fall past others, whose lists are otherwise made anew in almost every step
LONG_LISTS = {"alert_distance": 2.0e-4, "skin": 5.0e-4, "list_steps": 12}


@dataclass(frozen=True)
class Setting:
    """How Gravier runs a process: the step [s], and keys of &scene and &solver beside the defaults."""
    step: float
    scene: dict = field(default_factory=dict)
    solver: dict = field(default_factory=dict)

    @property
    def accuracy(self):
        return self.solver.get("accuracy", 0.1)

    @property
    def others(self):
        shown = {**self.scene, **self.solver}
        shown.pop("accuracy", None)
        return ", ".join(f"{key} = {value}" for key, value in shown.items()) or "defaults"


def lammps_head(stiffness, friction, skin, start, boundary):
    """The lines that all scripts share, and the words of a spring-dashpot with friction history that stand in each contact style. Several ranks
    divide the area of a scene, so that each has as many grains."""
    rate = 2.0 * DAMPING * np.sqrt(stiffness / PAIR_MASS)
    words = f"hooke/history {stiffness:.10g} {2.0 / 7.0 * stiffness:.10g} {rate:.10g} {0.5 * rate:.10g} {friction} 1"
    return words, [
        "units si", "atom_style sphere", f"boundary {boundary}", "newton on", "processors * * 1", "comm_modify vel yes", start,
        f"pair_style gran/{words}", "pair_coeff * *", f"neighbor {skin} bin", "neigh_modify delay 0 every 1 check yes"]


def lammps_data(path, centres, radii, kinds, box):
    """A data file of spheres of kinds 1, 2 ... in the box [(low, high)] along each axis."""
    with open(path, "w", encoding="ascii") as file:
        file.write(f"grains\n\n{len(radii)} atoms\n{kinds.max()} atom types\n\n")
        file.writelines(f"{low:.12g} {high:.12g} {axis}lo {axis}hi\n" for axis, (low, high) in zip("xyz", box))
        file.write("\nAtoms # sphere\n\n")
        file.writelines(f"{k + 1} {kinds[k]} {2.0 * radii[k]:.12g} {DENSITY} {x:.12g} {y:.12g} {z:.12g}\n"
                        for k, (x, y, z) in enumerate(centres))


class Settling:
    """Spheres on a loose lattice fall into a box."""

    name = "settling"
    friction, stiffness, lammps_step = 0.3, 2500.0, 9.0e-6
    outlet = -0.03

    def __init__(self, place, quick, seed):
        self.place, self.seed = place / self.name, seed
        self.count = (10, 10, 20) if quick else (20, 10, 50)
        self.duration = 0.2 if quick else 0.3
        self.width, self.depth, self.height = (number * CELL for number in self.count)
        alert = {"alert_distance": 2.0e-4}
        self.settings = [Setting(2.0e-4, alert)]
        if not quick:
            self.settings += [Setting(2.0e-4, alert, {"accuracy": 0.3}), Setting(4.0e-4, alert), Setting(4.0e-4, LONG_LISTS, {"accuracy": 0.3})]

    def prepare(self):
        self.place.mkdir(parents=True, exist_ok=True)
        rng = np.random.default_rng(self.seed)
        centres, radii = lattice([0.0] * 3, [self.width, self.depth, self.height], SMALLEST, LARGEST, rng)
        write_hdf5(self.place / "start.h5", centres, radii)
        lammps_data(self.place / "start.data", centres, radii, np.ones(len(radii), int),
                    [(0.0, self.width), (0.0, self.depth), (self.outlet, self.height + 0.005)])
        self.grains = len(radii)
        # the bed is this high, near enough: what lies near the floor and the surface is not looked at
        bed = MEAN_VOLUME * self.grains / (0.57 * self.width * self.depth)
        self.lower, self.upper = 0.15 * bed, 0.65 * bed

    def script(self):
        steps = round(self.duration / self.lammps_step)
        words, lines = lammps_head(self.stiffness, self.friction, 4.0e-4, "read_data ../start.data", "f f f")
        lines += ["fix move all nve/sphere", f"fix weight all gravity {GRAVITY} vector 0 0 -1", *self.sides(words),
                  f"fix floor all wall/gran {words} zplane 0 NULL", f"timestep {self.lammps_step}", "thermo_style custom step atoms ke",
                  "thermo 500", f"run {steps}", "write_restart settled.restart",
                  'write_dump all custom last.dump id x y z radius modify sort id format float %.12g']
        return "\n".join(lines) + "\n"

    def sides(self, words):
        return [f"fix side{axis} all wall/gran {words} {axis}plane 0 {width:.10g}" for axis, width in (("x", self.width), ("y", self.depth))]

    def planes(self):
        """The sides for Gravier."""
        return [{"name": "x0", "shape": "plane", "normal": [1.0, 0.0, 0.0]},
                {"name": "x1", "shape": "plane", "point": [self.width, 0.0, 0.0], "normal": [-1.0, 0.0, 0.0]},
                {"name": "y0", "shape": "plane", "normal": [0.0, 1.0, 0.0]},
                {"name": "y1", "shape": "plane", "point": [0.0, self.depth, 0.0], "normal": [0.0, -1.0, 0.0]}]

    def scene(self, setting, bodies):
        return {"dimension": 3, "bodies": "file", "bodies_file": bodies, "density": DENSITY, "friction": self.friction,
                "restitution": RESTITUTION, "wall_restitution": RESTITUTION, **setting.scene}

    def case(self, setting):
        steps = round(self.duration / setting.step)
        return ({"scene": self.scene(setting, "../start.h5"), "time": {"step": setting.step, "steps": steps}, "solver": setting.solver,
                 "output": {"directory": ".", "every": steps, "contacts": True, "final_bodies": True}},
                [*self.planes(), {"name": "floor", "shape": "plane", "normal": [0.0, 0.0, 1.0]}])

    def values(self, centres, radii, pairs):
        return {"solid fraction": (solid_fraction(centres[:, 2], radii, self.lower, self.upper, self.width * self.depth), 0.0),
                "contacts a grain": (contacts_a_grain(pairs, np.ones(len(radii), bool)), 0.0)}

    def of_lammps(self, place):
        *_, (_, last) = read_dump(place / "last.dump")
        centres, radii = np.column_stack([last[axis] for axis in "xyz"]), last["radius"]
        return self.values(centres, radii, touching(centres, radii))

    def of_gravier(self, place, _):
        for _, _, state in states(place / "results.h5"):
            last = state["bodies/position"][:], state["bodies/radius"][:], carrying(state)
        return self.values(*last)


def carrying(state):
    """Rows of the pairs of grains whose contact carries an impulse, of an open step of results.h5."""
    if "contacts" not in state:
        return np.empty((0, 2), int)
    row = {number: k for k, number in enumerate(state["bodies/id"][:])}
    ends = np.column_stack([state["contacts/candidate"][:], state["contacts/antagonist"][:]])[state["contacts/impulse"][:, 0] > 0.0]
    return np.array([(row[a], row[b]) for a, b in ends if a in row and b in row], int).reshape(-1, 2)


class Discharge:
    """What has settled leaves through a slot across the floor."""

    name = "discharge"

    def __init__(self, place, quick, settling):
        self.place, self.settling = place / self.name, settling
        self.slot, self.duration = (0.012, 0.14) if quick else (0.014, 0.25)
        # what leaves takes 0.08 s down to where it is counted
        self.begin = 0.085 if quick else 0.1
        alert = {"alert_distance": 2.0e-4}
        self.settings = [Setting(2.0e-4, alert)]
        if not quick:
            self.settings += [Setting(2.0e-4, LONG_LISTS, {"accuracy": 0.3}), Setting(4.0e-4, LONG_LISTS, {"accuracy": 0.3})]

    def prepare(self):
        self.place.mkdir(parents=True, exist_ok=True)
        self.half = 0.5 * (self.settling.width - self.slot)

    def script(self):
        box, out = self.settling, 0.005
        words, lines = lammps_head(box.stiffness, box.friction, 4.0e-4, "read_restart ../../settling/lammps/settled.restart", "f f f")
        along = f"{-out} {box.depth + out:.10g} -0.0002 0 side out units box"
        lines += ["reset_timestep 0", "fix move all nve/sphere", f"fix weight all gravity {GRAVITY} vector 0 0 -1", *box.sides(words),
                  f"region left block {-out} {self.half:.10g} {along}",
                  f"region right block {box.width - self.half:.10g} {box.width + out:.10g} {along}",
                  f"fix left all wall/gran/region {words} region left", f"fix right all wall/gran/region {words} region right",
                  f"timestep {box.lammps_step}", "thermo_style custom step atoms ke", "thermo 50", "thermo_modify lost ignore",
                  f"run {round(self.duration / box.lammps_step)}"]
        return "\n".join(lines) + "\n"

    def case(self, setting):
        box, out = self.settling, 0.005
        steps = round(self.duration / setting.step)
        floor = [{"name": name, "shape": "rectangle", "point": [x, -out, 0.0], "edge_a": [self.half + out, 0.0, 0.0],
                  "edge_b": [0.0, box.depth + 2.0 * out, 0.0]} for name, x in (("left", -out), ("right", box.width - self.half))]
        return ({"scene": box.scene(setting, "../../settling/gravier/final_bodies.h5"), "time": {"step": setting.step, "steps": steps},
                 "solver": setting.solver, "output": {"directory": ".", "every": steps}},
                [*box.planes(), *floor, {"name": "out", "shape": "outlet", "point": [0.0, 0.0, box.outlet], "normal": [0.0, 0.0, 1.0]}])

    def values(self, time, grains):
        later = time >= self.begin
        rate, error = rate_and_error(time[later], grains[later])
        mass = DENSITY * MEAN_VOLUME
        return {"flow [kg/s]": (-rate * mass, error * mass)}

    def of_lammps(self, place):
        rows = read_thermo(place)
        return self.values(rows["Step"] * self.settling.lammps_step, rows["Atoms"])

    def of_gravier(self, place, _):
        rows = read_history(place)
        return self.values(rows["time"], rows["grains"])


class Shear:
    """Simple shear at a pressure between rough walls, which are the outer layers of a compacted sample."""

    name = "shear"
    friction, stiffness, lammps_step = 0.5, 5000.0, 7.0e-6
    # what rigid contacts are compared with as well: springs so many times as stiff
    stiffer = 10.0
    pressure, number, mass, layer = 1000.0, 1.0e-3, 0.01, 2.0e-3
    begin = 0.05

    def __init__(self, place, quick, seed):
        self.place, self.seed = place / self.name, seed
        self.count, self.period, self.strain = (700, (0.020, 0.012), 0.12) if quick else (2900, (0.032, 0.020), 0.15)
        near = {"alert_distance": 2.0e-5, "skin": 1.0e-4}
        self.settings = [Setting(1.0e-4)]
        # 15 and 50 of LAMMPS's steps
        self.compliant = [Setting(15 * self.lammps_step), Setting(50 * self.lammps_step)]
        if not quick:
            self.settings += [Setting(step, near, {"accuracy": 0.3}) for step in (1.0e-4, 3.2e-4)]
            self.compliant.append(Setting(15 * self.lammps_step, near, {"accuracy": 0.3}))

    def prepare(self):
        sample = self.place / "sample"
        run_gravier(sample, {
            "scene": {"dimension": 3, "bodies": "sample", "density": DENSITY, "friction": 0.3, "period": [*self.period, 0.0]},
            "sample": {"preparation": "compacted", "count": self.count, "radii": "uniform", "radius_min": SMALLEST, "radius_max": LARGEST,
                       "solid_fraction": 0.32, "pressure": self.pressure, "rest_tolerance": 1.0e-5, "max_steps": 3000,
                       "seed": self.seed, "file": "sample.h5"},
            "time": {"step": 1.0e-4, "steps": 0}, "solver": {"tolerance": 1.0e-3}}, program="gravier_sample")
        centres, radii, _ = read_bodies(sample / "sample.h5")
        centres[:, :2] %= self.period
        low, high = (centres[:, 2] - radii).min(), (centres[:, 2] + radii).max()
        self.group = np.where(centres[:, 2] < low + self.layer, 1, np.where(centres[:, 2] > high - self.layer, 2, 0))
        self.gap = high - low - 2.0 * self.layer
        self.rate = self.number / (SMALLEST + LARGEST) * np.sqrt(self.pressure / DENSITY)
        self.duration = self.strain / self.rate
        self.lower, self.upper = low + self.layer + 0.25 * self.gap, low + self.layer + 0.75 * self.gap
        self.force = self.pressure * self.period[0] * self.period[1]
        write_hdf5(self.place / "start.h5", centres, radii, self.group)
        lammps_data(self.place / "start.data", centres, radii, self.group + 1,
                    [(0.0, self.period[0]), (0.0, self.period[1]), (low - 0.004, high + 0.012)])

    def script(self, times=1.0):
        """For springs `times` as stiff, in steps that are as much shorter as they swing faster."""
        words, lines = lammps_head(times * self.stiffness, self.friction, 3.0e-4, "read_data ../start.data", "p p f")
        step, every, top = self.lammps_step / np.sqrt(times), np.sqrt(times), (self.group == 2).sum()
        lines += [
            "neigh_modify exclude type 2 2 exclude type 3 3 exclude type 2 3", "group free type 1", "group top type 3",
            f"set type 3 mass {self.mass / top:.10g}", f"velocity top set {self.rate * self.gap:.10g} 0 0", "fix move free nve/sphere",
            "fix lid top nve", f"fix press top aveforce NULL NULL {-self.force / top:.10g}", "fix drag top setforce 0 0 NULL",
            f"timestep {step:.12g}", "compute place top property/atom z", "compute height top reduce ave c_place",
            "thermo_style custom step c_height f_drag[1] f_press[3]", f"thermo {round(100 * every)}",
            f"dump grains all custom {round(2000 * every)} grains.dump id x y z radius", "dump_modify grains sort id format float %.12g",
            f"run {round(self.duration / step)}"]
        return "\n".join(lines) + "\n"

    def case(self, setting, compliant=False):
        steps = round(self.duration / setting.step)
        scene = {"dimension": 3, "gravity": [0.0] * 3, "bodies": "file", "bodies_file": "../start.h5", "density": DENSITY,
                 "friction": self.friction, "period": [*self.period, 0.0], **setting.scene}
        groups = {"scene": scene, "time": {"step": setting.step, "steps": steps}, "solver": setting.solver,
                  "output": {"directory": ".", "every": round(2000 * self.lammps_step / setting.step), "contacts": True,
                             "boundary_forces": True}}
        if compliant:
            scene["wall_material"] = "glass"
            groups["material"] = {"name": "glass"}
            groups["law"] = {"materials": "glass", "kind": "elastic", "friction": self.friction, "normal_stiffness": self.stiffness,
                             "spring_restitution": rebound(DAMPING), "tangential_damping": 0.5}
        else:
            scene.update(restitution=RESTITUTION, wall_restitution=RESTITUTION)
        return groups, [{"name": "bottom", "shape": "grains", "group": 1},
                        {"name": "top", "shape": "grains", "group": 2, "velocity": [self.rate * self.gap, 0.0, 0.0],
                         "free": [False, False, True], "force": [0.0, 0.0, -self.force], "mass": self.mass}]

    def values(self, ratio, rise, snapshots):
        """Means over strains from `begin` on of the stress ratio, of how far the lid has risen [m] and of (centres, radii, pairs)."""
        filled = [solid_fraction(centres[:, 2], radii, self.lower, self.upper, self.period[0] * self.period[1])
                  for centres, radii, _ in snapshots]
        contacts = [contacts_a_grain(pairs, self.group == 0) for _, _, pairs in snapshots]
        mean, error = mean_and_error(rise)
        return {"stress ratio": mean_and_error(ratio), "volume over that at the start": (1.0 + mean / self.gap, error / self.gap),
                "solid fraction": mean_and_error(filled), "contacts a grain": mean_and_error(contacts)}

    def of_lammps(self, place, times=1.0):
        rows, strain = read_thermo(place), self.lammps_step / np.sqrt(times) * self.rate
        later = rows["Step"] * strain >= self.begin
        snapshots = []
        for step, state in read_dump(place / "grains.dump"):
            if step * strain >= self.begin:
                centres, radii = np.column_stack([state[axis] for axis in "xyz"]), state["radius"]
                snapshots.append((centres, radii, touching(centres, radii, [*self.period, 0.0])))
        # the drag is the sum of the forces on the lid before they are set to zero
        return self.values(-rows["f_drag[1]"][later] / self.force, rows["c_height"][later] - rows["c_height"][0], snapshots)

    def of_gravier(self, place, compliant):
        """Contacts are overlaps, as in LAMMPS, if they are compliant; rigid ones are those that carry."""
        rows = read_history(place)
        later = rows["time"] * self.rate >= self.begin
        snapshots = []
        for _, time, state in states(place / "results.h5"):
            if time * self.rate >= self.begin:
                centres, radii = state["bodies/position"][:], state["bodies/radius"][:]
                pairs = touching(centres, radii, [*self.period, 0.0]) if compliant else carrying(state)
                snapshots.append((centres, radii, pairs))
        place_of_lid = rows["position_z:top"]
        return self.values(-rows["force_x:top"][later] / rows["force_z:top"][later].mean(), place_of_lid[later] - place_of_lid[0], snapshots)


def rebound(damping):
    """Part of the velocity that an impact on a spring and a dashpot returns where bodies let go when the force vanishes
    (Schwager and Poeschel, Granular Matter 9, 2007); `damping` is over the critical one. The spring and dashpot of LAMMPS
    pull until the overlap is zero, and return RESTITUTION."""
    swing = np.sqrt(1.0 - damping**2)
    return float(np.exp(-damping / swing * (np.pi - np.arctan2(2.0 * damping * swing, swing**2 - damping**2))))
