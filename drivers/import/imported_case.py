"""The case that a DATBOX becomes: grains, boundaries, materials and laws."""
import math
from collections import defaultdict

import numpy as np
from body_shapes import ROUNDING, ShapeOfBody, turn_of
from bulks import Bulks
from contact_laws import ContactLaws
from datbox import GRAINS, HULLS, ROUND, WALLS
from imported_grain import Grain
from imported_walls import add_wall, axes_of, motion


#: what a body that moves freely may be made of
PIECES = ("DISKx", "DISKb", "SPHER", "SPHEb", "POLYG", "POLYR", "JONCx")


class Case:
    """The case that is made: grains, boundaries, laws with their materials, remarks for the user. `period` has a length for each axis or is
    empty."""

    def __init__(self, bodies, density, gravity, laws, sees, options):
        self.bodies, self.gravity, self.dimension = bodies, gravity, bodies[0].dimension
        self.planes, self.homogeneous, self.period = options.planes, options.homogeneous, options.period or []
        self.grains, self.boundaries, self.remarks = [], [], []
        #: contacts from whose forces the first solve starts, where there are some
        self.start = None
        #: grains and keys of boundaries that a body of LMGC90, by its number, has become
        self.parts = defaultdict(list)
        #: bodies whose inertia or centre of mass their shape decides, by --homogeneous
        self.replaced = set()
        #: lines of the file of shapes with their names, which bodies share
        self.shapes = {}
        self.free = [body for body in bodies if not body.drives and all(contactor.words[0] in PIECES for contactor in body.contactors)]
        if not self.free:
            bodies[0].start.refuse("no grain moves freely", "a body of DISKx, POLYG, JONCx, SPHER or POLYR that DRV_DOF.DAT does not drive")
        self.laws = ContactLaws(bodies, self.free, laws, sees, options, self.remarks)
        self.bulks = Bulks(density, self.dimension, self.remarks)
        self.centres = np.array([body.place() for body in self.free])

    def keep(self, body, grain):
        """Take a grain that a body becomes, or a part of it."""
        self.grains.append(grain)
        self.parts[body.rank].append(grain)

    def add_grain(self, body, contactor, place, group):
        radius = contactor.get("byrd")
        identifier = body.rank if contactor is body.contactors[0] else None
        velocity = body.velocity() if group == 0 else None
        self.keep(body, Grain(identifier, place, radius, self.bulks.mass(body, self.bulks.ball(radius)),
                              self.laws.material(self.laws.thing(contactor)), velocity, group))

    def is_ball(self, body):
        """Is it one disk or sphere about its centre?"""
        contactor = body.contactors[0]
        return len(body.contactors) == 1 and contactor.words[0] in GRAINS and not np.any(contactor.shift(self.dimension) != 0.0)

    def add_shaped(self, body, group):
        """A body with a shape; its place is that of its centre of mass."""
        things = sorted({self.laws.thing(contactor) for contactor in body.contactors})
        if len(things) > 1:
            body.contactors[-1].refuse(f"driven body {body.rank} has contactors {' and '.join(' '.join(thing) for thing in things)}",
                                       "contactors of one kind and one colour: a body with a shape has one material here")
        shape = ShapeOfBody(body)
        self.check_mass(body, shape)
        frame = body.frame()
        name = self.shapes.setdefault(shape.text(), f"{things[0][0]}_{len(self.shapes) + 1}")
        velocity = body.velocity(shape.centre) if group == 0 else None
        if things[0][0] == "JONCx":
            self.remarks.append(f"body {body.rank} JONCx: nothing drives it, it moves freely")
        if any(piece.kind in HULLS for piece in shape.pieces):
            self.remarks.append(f"corners and edges of polygons and polyhedra are round here, with at most {ROUNDING:g} of their size")
        self.keep(body, Grain(body.rank, body.centre(shape.centre), 0.0, self.bulks.mass(body, shape.volume),
                              self.laws.material(things[0]), velocity, group, name, turn_of(frame)))

    def check_mass(self, body, shape):
        """Refuse a centre of mass or an inertia that are given and are not those of the shape. The mass is as it is given."""
        given = body.bulk.get("avrd", 0.0) > 0.0
        beside = np.linalg.norm(shape.centre)
        if beside > ROUND * shape.size:
            if given and not body.drives:
                self.differs(body, f"body {body.rank} with avrd= {body.bulk.get('avrd'):g} and its centre of mass {beside:g} beside its node",
                             "contactors about their centre of mass, or avrd= 0")
            else:
                self.remarks.append(f"body {body.rank}: its place is the centre of mass of its contactors, {beside:g} beside its node")
        if body.drives:
            return
        gyration = body.bulk.get("gyrd", 0.0)
        if self.dimension == 2 and gyration > 0.0 and abs(gyration - shape.gyration()) > ROUND * gyration:
            self.differs(body, f"gyrd= {gyration:g}", f"0 or {shape.gyration():g}, that of its contactors, homogeneous")
        inertia = np.sort([body.bulk.get(name, 0.0) for name in ("I1", "I2", "I3")])
        if self.dimension == 3 and inertia[-1] > 0.0 and np.abs(inertia / inertia[-1] - shape.principal()).max() > ROUND:
            self.differs(body, f"moments of inertia as {', '.join(f'{x:g}' for x in inertia / inertia[-1])}",
                         f"as {', '.join(f'{x:g}' for x in shape.principal())}, those of its contactors, homogeneous")

    def differs(self, body, found, expected):
        """Inertia or centre of mass that are not those of the shape: refused, or replaced where --homogeneous says so."""
        if not self.homogeneous:
            body.bulk.refuse(found, f"{expected}; or --homogeneous, with which the shape decides and the mass stays")
        self.replaced.add(body.rank)

    def check_free(self, body):
        contactor = body.contactors[0]
        radius, gyration = contactor.get("byrd"), body.bulk.get("gyrd", 0.0)
        if self.dimension == 2 and gyration > 0.0 and abs(gyration - radius / math.sqrt(2.0)) > ROUND * radius:
            body.bulk.refuse(f"gyrd= {gyration:g}", f"0 or byrd/sqrt(2) = {radius / math.sqrt(2.0):g}, a homogeneous disk")
        inertia = [body.bulk.get(name, 0.0) for name in ("I1", "I2", "I3")]
        if max(inertia) - min(inertia) > ROUND * max(inertia):
            body.bulk.refuse(f"moments of inertia {inertia}", "three equal ones")

    def new_group(self):
        return 1 + max([grain.group for grain in self.grains], default=0)

    def add_glued(self, body):
        """A driven body of disks or spheres, or of polygons or polyhedra: grains glued to each other, each of its own material, or one grain
        with a shape."""
        seen = [self.laws.meet(self.laws.thing(contactor)) for contactor in body.contactors]
        keys, columns = motion(self, body, True)
        if not any(seen):
            if "free" in keys:
                body.start.refuse(f"body {body.rank} ({body.contactors[0].words[0]}) is moved by forces and no body without drives sees it",
                                  f"vlocy 1 to {len(keys['free'])} in DRV_DOF.DAT, or no drives: boundaries pass through each other here")
            self.remarks.append(f"body {body.rank} {body.contactors[0].words[0]}: no grain sees it, left out")
            return
        group = self.new_group()
        if any(contactor.words[0] in HULLS for contactor in body.contactors):
            self.add_shaped(body, group)
        else:
            for contactor, there in zip(body.contactors, seen):
                if there:
                    self.add_grain(body, contactor, axes_of(body, contactor)[0], group)
        self.boundaries.append(({"name": f"body {body.rank}", "shape": "grains", "group": group, **keys}, columns))

    def check_moved_by_forces(self):
        """Refuse bodies that forces move, and that see others with drives: they become boundaries, which do not meet each other."""
        driven = [body for body in self.bodies if body not in self.free]
        for body in driven:
            still = all(body.drives.get(k, ("force",))[0] == "vlocy" for k in range(1, self.dimension + 1))
            others = () if still else (other for other in driven if other is not body)
            for other in others:
                pairs = [{self.laws.thing(one), self.laws.thing(two)} for one in body.contactors for two in other.contactors]
                for pair, _, _, see in self.laws.sees:
                    if set(pair) in pairs:
                        see.refuse(f"body {body.rank} ({body.contactors[0].words[0]}), which forces move, sees body {other.rank} "
                                   f"({other.contactors[0].words[0]}), which has drives too",
                                   f"vlocy 1 to {self.dimension} of body {body.rank}, no drives of it, or no such line: boundaries pass through each other here")

    def build(self):
        self.check_moved_by_forces()
        for thing in sorted(self.laws.colours):
            self.laws.meet(thing)
        for body in self.bodies:
            kinds = {contactor.words[0] not in WALLS for contactor in body.contactors}
            if len(kinds) > 1 and body not in self.free:
                body.start.refuse(f"body {body.rank} has contactors of grains and of walls", "one kind")
            if body in self.free and self.is_ball(body):
                self.check_free(body)
                self.add_grain(body, body.contactors[0], body.place(), 0)
            elif body in self.free:
                self.add_shaped(body, 0)
            elif kinds == {True}:
                self.add_glued(body)
            else:
                add_wall(self, body)
        if not self.laws.used:
            self.free[0].start.refuse("the bodies that move freely see nothing", "a contact law: $seety of TACT_BEHAV.DAT")
        if self.replaced:
            self.remarks.append(f"{len(self.replaced)} bodies have the inertia and the centre of mass of their shapes here, not those of BODIES.DAT")
