"""Laws of contact of a DATBOX as materials and laws here: one material for each contactor and colour, one law for each line of the table of
visibility that free bodies have part in."""
import math

from datbox import GRAINS, ROUND
from datbox_text import ABOVE_0


LAWS = ("IQS_CLB", "IQS_CLB_g0", "IQS_DS_CLB", "IQS_MOHR_DS_CLB", "IQS_WET_DS_CLB", "RST_CLB", "RST_DS_CLB")


class ContactLaws:
    """`materials`, `met` (keys of laws by pairs of materials) and `used` (their alert distances) of the free bodies."""

    def __init__(self, bodies, free, laws, sees, options, remarks):
        self.laws, self.slip, self.drop_g0, self.dimension = laws, options.slip, options.drop_g0, bodies[0].dimension
        self.sees = self.one_for_each_pair(sees, {self.named(contactor.words[0], contactor.words[3]) for body in free for contactor in body.contactors})
        self.remarks, self.materials, self.met, self.used = remarks, [], {}, []
        #: contactor and colour: that which stands for it, since bodies have contactors of both
        self.stands_for = {}
        self.merge_kinds(free)
        self.colours = {self.thing(body.contactors[0]) for body in free}
        #: radii by contactor and colour: none of flat walls
        self.radii = {}
        for contactor in (contactor for body in bodies for contactor in body.contactors):
            self.radii.setdefault(self.thing(contactor), set()).update([contactor.get("byrd")] if contactor.words[0] in GRAINS else [])

    @staticmethod
    def named(kind, colour):
        """Contactor and colour, by which the table of visibility names it."""
        return {"DISKb": "DISKx", "SPHEb": "SPHER"}.get(kind, kind), colour

    @staticmethod
    def one_for_each_pair(sees, free):
        """The table of visibility without repeats. Lines of one pair that differ are refused where a body that moves freely has part in it."""
        found = {}
        for pair, law, alert, see in sees:
            _, older, distance, first = found.setdefault(frozenset(pair), (pair, law, alert, see))
            if (older, distance) != (law, alert) and pair & free:
                see.refuse(f"{' and '.join(' '.join(thing) for thing in sorted(pair))} with law {law} and alert= {alert:g}, and with law {older} and "
                           f"alert= {distance:g} on line {first.line}", "one $seety for a pair")
        return list(found.values())

    def thing(self, contactor):
        """Contactor and colour, or those that stand for them."""
        thing = self.named(contactor.words[0], contactor.words[3])
        return self.stands_for.get(thing, thing)

    def merge_kinds(self, free):
        """A body has one material: contactors of several kinds or colours that make up bodies become one thing, where what they see and
        under which laws is the same for all of them."""
        for body in free:
            things = list(dict.fromkeys(self.thing(contactor) for contactor in body.contactors))
            for other in things[1:]:
                self.stands_for = {thing: things[0] if stands == other else stands for thing, stands in self.stands_for.items()}
                self.stands_for[other] = things[0]
        if not self.stands_for:
            return
        members = {}
        for thing, stands in self.stands_for.items():
            members.setdefault(stands, [stands]).append(thing)
        lines = {}
        for pair, law, alert, see in self.sees:
            merged = frozenset(self.stands_for.get(thing, thing) for thing in pair)
            lines.setdefault(merged, []).append((pair, law, alert, see))
        self.sees = []
        for merged, found in lines.items():
            groups = [members.get(thing, [thing]) for thing in (min(merged), max(merged))]
            wanted = {frozenset((one, other)) for one in groups[0] for other in groups[1]}
            # pairs of which no body has both sides, and walls by themselves, need no line
            if len(wanted) > 1 and ({frozenset(pair) for pair, *_ in found} != wanted or len({law for _, law, _, _ in found}) > 1):
                found[0][3].refuse(f"contactors {' and '.join(' '.join(thing) for thing in max(groups, key=len))} of one body that do not see the same under "
                                   "one law", "the same lines $seety for each of them: a body has one material here")
            self.sees.append((set(merged), found[0][1], max(alert for _, _, alert, _ in found), found[0][3]))

    def material(self, thing):
        """Name of its material: the colour, where no other contactor has it."""
        name = thing[1] if sum(other[1] == thing[1] for other in self.radii) == 1 else " ".join(thing)
        if name not in self.materials:
            self.materials.append(name)
        return name

    def meet(self, thing):
        """Take over the laws between the free grains and a contactor of a colour; False where no grain sees it. Things that do not see each
        other pass through each other."""
        lines = {grain: see for grain in sorted(self.colours) for see in self.sees if see[0] == {grain, thing}}
        if not lines and thing not in self.colours:
            return False
        for grain in sorted(self.colours - lines.keys()):
            self.met[tuple(sorted((self.material(grain), self.material(thing))))] = {"kind": "none"}
            one, other = sorted((grain, thing))
            self.remarks.append(f"{' '.join(one)} does not see {' '.join(other)}: they pass through each other")
        for pair, law, alert, see in lines.values():
            names = sorted(self.material(each) for each in pair)
            self.met[tuple(names)] = self.keys_of(law, alert, see, pair)
            self.used.append(alert)
        return bool(lines)

    def keys_of(self, nickname, alert, see, pair):
        """Keys of the &law that a line of the table of visibility becomes."""
        if nickname not in self.laws:
            see.refuse(f"law {nickname}", "a law of this file")
        entry = self.laws[nickname]
        name = entry.words[1]
        if name not in LAWS:
            entry.refuse(f"law {name}", f"one of {', '.join(LAWS)}")
        keys = self.friction_of(entry, name)
        if name.startswith("RST"):
            keys.update(restitution=entry.within("rstn", most=1.0), tangential_restitution=entry.within("rstt", most=1.0))
        if name == "IQS_WET_DS_CLB":
            return {"kind": "adhesive", **keys, "adhesion": entry.within("cohn"), "adhesion_range": min(entry.within("Wthk", ABOVE_0), alert)}
        if name == "IQS_MOHR_DS_CLB":
            return {"kind": "bonded", **keys, **self.bond_of(entry, alert, pair)}
        return {"kind": "velocity" if "slip_scale" in keys else "coulomb", **keys}

    def friction_of(self, entry, name):
        """Keys of friction: one coefficient, or a static and a dynamic one where the law here has both."""
        if name == "IQS_CLB_g0" and not self.drop_g0:
            entry.refuse("law IQS_CLB_g0, whose gaps count from those of the start", "--drop-g0, with which they count from contact")
        if name == "IQS_CLB_g0":
            self.remarks.append(f"law {entry.words[0]} IQS_CLB_g0: gaps count from contact here, not from those of the start")
        if name in ("IQS_CLB", "IQS_CLB_g0", "RST_CLB"):
            return {"friction": entry.within("fric")}
        static, dynamic = entry.within("stfr"), entry.within("dyfr")
        if static == dynamic:
            return {"friction": static}
        if name in ("IQS_WET_DS_CLB", "IQS_MOHR_DS_CLB"):
            entry.refuse(f"law {name} with stfr= {static:g} and dyfr= {dynamic:g}", "equal ones: this law has one coefficient here")
        if self.slip is None:
            entry.refuse(f"law {name} with stfr= {static:g} and dyfr= {dynamic:g}",
                         "--slip V, the slip [m/s] over which friction falls from the one to the other")
        return {"static_friction": static, "dynamic_friction": dynamic, "slip_scale": self.slip}

    def bond_of(self, entry, alert, pair):
        """Keys of a bond. Cohesion is a stress in LMGC90, of a contact as large as R* = R_i R_j/(R_i + R_j) in 2D, pi R*^2 in 3D, with the
        radius of the grain against a flat wall."""
        if not {thing[0] for thing in pair} <= {"DISKx", "SPHER", "JONCx", "PLANx"}:
            entry.refuse(f"law IQS_MOHR_DS_CLB of {' and '.join(sorted({thing[0] for thing in pair}))}", "disks or spheres, JONCx and PLANx")
        cohesion, shear = entry.get("cohn"), entry.get("coht")
        if not (cohesion > 0.0 and shear > 0.0):
            entry.refuse(f"law IQS_MOHR_DS_CLB with cohn= {cohesion:g} and coht= {shear:g}", "both > 0")
        first, last = min(pair), max(pair)
        sizes = []
        for choose in (min, max):
            one, other = (choose(self.radii[thing], default=math.inf) for thing in (first, last))
            reduced = 1.0 / (1.0 / one + 1.0 / other)
            sizes.append(reduced if self.dimension == 2 else math.pi * reduced**2)
        if sizes[1] - sizes[0] > ROUND * sizes[1]:
            entry.refuse(f"law IQS_MOHR_DS_CLB between several radii, with bonds of {cohesion * sizes[0]:g} to {cohesion * sizes[1]:g} N",
                         "one radius: the bonds of a law are of one strength here")
        self.remarks.append(f"law {entry.words[0]} IQS_MOHR_DS_CLB: bodies bonded across a gap keep it, LMGC90 draws them together")
        return {"bond_strength": cohesion * sizes[1], "bond_friction": shear / cohesion, "bond_distance": alert}
