"""What drives bodies of a DATBOX: DRV_DOF.DAT."""
import math
import re

import numpy as np
from datbox_text import Refused, entries


#: rows to a period of a drive that oscillates
ROWS_PER_PERIOD = 200


class Function:
    """A driven value against time: constant, or its table of (time, value). A formula is a table up to the time `until` alone. Of one that
    is a constant and a wave, `wave` has its mean, its amplitude, the angular frequency, above 0, and the phase at the first step."""

    def __init__(self, constant=0.0, table=None, until=None, wave=None):
        self.constant, self.table, self.until, self.wave = constant, table, until, wave

    @staticmethod
    def of(entry, start, end):
        """[CT + AMP cos(OMEGA t + PHI)] min(1, RAMPI + RAMP t), or a file of times and values; times from `start` on."""
        if "evolution" in entry.words:
            path = entry.path.parent / entry.words[entry.words.index("evolution") + 1]
            try:
                # exponents as Fortran writes them
                text = re.sub(r"(?<=[0-9.])[dD](?=[-+0-9])", "e", path.read_text(encoding="latin-1"))
                table = np.loadtxt(text.splitlines(), ndmin=2) if text.strip() else np.empty((0, 0))
            except (OSError, ValueError) as problem:
                raise Refused(f"{entry.path}: line {entry.line}: {path}: {problem}: expected a file of times and values") from None
            if table.shape[1] < 2 or not np.all(np.isfinite(table[:, :2])) or np.any(np.diff(table[:, 0]) <= 0.0):
                entry.refuse(f"{path}", "two columns of finite numbers, times that rise and values")
            return Function(table=table[:, :2] - [start, 0.0])
        if len(entry.words) < 8:
            entry.refuse(f"{' '.join(entry.words)}", "six numbers: CT, AMP, OMEGA, PHI, RAMPI and RAMP")
        ct, amp, omega, phi, rampi, ramp = (entry.number(word) for word in entry.words[2:8])
        if (amp == 0.0 or omega == 0.0) and ramp == 0.0:
            return Function((ct + amp * math.cos(phi)) * min(1.0, rampi))
        times = [0.0, end - start]
        if ramp != 0.0 and 0.0 < (1.0 - rampi) / ramp - start < end - start:
            times.append((1.0 - rampi) / ramp - start)
        if amp * omega != 0.0:
            times += list(np.arange(0.0, end - start, 2.0 * math.pi / abs(omega) / ROWS_PER_PERIOD))
        times = np.unique(times)
        values = (ct + amp * np.cos(omega * (times + start) + phi)) * np.minimum(1.0, rampi + ramp * (times + start))
        wave = None
        if ramp == 0.0:
            share = min(1.0, rampi)
            wave = (share * ct, share * amp, abs(omega), math.copysign(1.0, omega) * phi + abs(omega) * start)
        return Function(table=np.stack([times, values], axis=1), until=end - start, wave=wave)

    def same(self, other):
        return self.constant == other.constant and np.array_equal(*([] if one.table is None else one.table for one in (self, other)))

    def at(self, times):
        return np.full(len(times), self.constant) if self.table is None else np.interp(times, *self.table.T)


def add_drive(body, entry, function):
    """Let a component of a body be driven. A drive that it has already has to be the same."""
    kind, component, entries_of_velocity = entry.words[0], int(entry.words[1]), 3 * body.dimension - 3
    if not 1 <= component <= entries_of_velocity:
        entry.refuse(f"{kind} {component} of body {body.rank}", f"a component from 1 to {entries_of_velocity}")
    older_kind, older, first = body.drives.setdefault(component, (kind, function, entry))
    if older_kind != kind or not older.same(function):
        entry.refuse(f"{kind} {component} of body {body.rank} differs from line {first.line}, which drives the same component", "one drive of a component")


def read_drives(path, bodies, start, end):
    body = None
    for keyword, entry in entries(path):
        if keyword == "$bdyty" and entry.words:
            rank = int(entry.words[1])
            if entry.words[0] != bodies[0].kind or not 1 <= rank <= len(bodies):
                entry.refuse(f"body {' '.join(entry.words[:2])}", f"a body of BODIES.DAT, {bodies[0].kind} 1 to {len(bodies)}")
            body = bodies[rank - 1]
        elif keyword == "$dofty" and entry.words and body and entry.words[0] in ("vlocy", "force"):
            add_drive(body, entry, Function.of(entry, start, end))
        elif keyword == "$dofty" and entry.words and entry.words[0] not in ("numbr",) and not entry.words[0].startswith("["):
            entry.refuse(f"a driven degree of freedom {entry.words[0]}", "vlocy or force")
