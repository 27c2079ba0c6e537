"""Masses and volumes of the bodies of a DATBOX."""
import math

from body_shapes import Piece
from datbox import HULLS
from datbox_text import ABOVE_0


#: bulks that are rigid; what a conducting one conducts is left out
BULKS = ("RIGID", "THERMO_RIGID", "ELECTRO_RIGID")


class Bulks:
    """Densities by nicknames of bulks, as the entries of BULK_BEHAV.DAT."""

    def __init__(self, density, dimension, remarks):
        self.density, self.dimension, self.remarks = density, dimension, remarks

    def mass(self, body, volume):
        name = body.bulk.words[3] if len(body.bulk.words) > 3 else ""
        if name not in self.density:
            body.bulk.refuse(f"material {name}", "one of BULK_BEHAV.DAT")
        kind = self.density[name].words[1]
        if kind not in BULKS:
            self.density[name].refuse(f"material {kind}", f"one of {', '.join(BULKS)}")
        if kind != "RIGID":
            self.remarks.append(f"material {name} {kind}: what it conducts is left out")
        average = body.bulk.get("avrd", 0.0)
        if average > 0.0:
            volume = self.ball(average)
        # what is driven may have no mass
        return self.density[name].within("Umas", 0.0 if body.drives else ABOVE_0) * volume

    def ball(self, radius):
        return math.pi * radius**2 if self.dimension == 2 else 4.0 / 3.0 * math.pi * radius**3

    def volume(self, contactor):
        shape = contactor.words[0]
        if shape == "JONCx":
            return 4.0 * contactor.size(1, "axe1") * contactor.size(2, "axe2") + math.pi * contactor.size(2, "axe2")**2
        if shape in HULLS:
            return Piece(contactor, self.dimension).moments[0]
        if shape == "PLANx":
            return 8.0 * math.prod(contactor.size(k, f"axe{k}") for k in (1, 2, 3))
        return self.ball(contactor.get("byrd"))

    def mass_of(self, body):
        """Mass of a body whose contactors do not overlap."""
        return self.mass(body, sum(self.volume(contactor) for contactor in body.contactors))
