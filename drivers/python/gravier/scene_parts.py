"""Boundaries and the periodic cell of a run that is open: quantities by name, to be read, and some of them to be set."""
import ctypes

import numpy as np

from .arrays import reals
from .library import SimulationError, call, load


class Boundary:
    """A boundary: `position`, `normal`, `velocity`, `spin`, `force` of the grains on it in the last step, `applied_force`, `pressure` and
    `friction`. velocity, spin, applied_force, pressure and friction can be set, on all ranks alike, and hold from the next step on."""

    def __init__(self, simulation, number, name):
        object.__setattr__(self, "_place", (simulation, number))
        object.__setattr__(self, "name", name)

    def __getattr__(self, what):
        if what not in BOUNDARY_READS:
            raise AttributeError(f"no {what} of a boundary; expected one of {', '.join(BOUNDARY_READS)}")
        values, count = (ctypes.c_double * 3)(), ctypes.c_int()
        simulation, number = self._place
        call("get_boundary", simulation.handle, number, what.encode(), values, ctypes.byref(count))
        if what in ("pressure", "friction") or (what == "spin" and count.value == 1):
            return values[0]
        return np.array(values[:count.value])

    def __setattr__(self, what, values):
        if what not in BOUNDARY_SETS:
            raise AttributeError(f"{what} of a boundary cannot be set; expected one of {', '.join(BOUNDARY_SETS)}")
        values = reals(values, f"boundary '{self.name}': {what}").ravel()
        simulation, number = self._place
        call("set_boundary", simulation.handle, number, what.encode(), values.ctypes.data, len(values))


BOUNDARY_SETS = ("velocity", "spin", "applied_force", "pressure", "friction")
BOUNDARY_READS = ("position", "normal", "force", *BOUNDARY_SETS)


class Boundaries:
    """Boundaries by name."""

    def __init__(self, simulation):
        self._simulation = simulation

    def __len__(self):
        return self._simulation.whole("boundaries")

    def __iter__(self):
        handle = self._simulation.handle
        return iter([load().gravier_boundary_name(handle, k).decode() for k in range(len(self))])

    def __getitem__(self, name):
        number = ctypes.c_int()
        call("boundary", self._simulation.handle, str(name).encode(), ctypes.byref(number))
        return Boundary(self._simulation, number.value, name)


class Cell:
    """The periodic cell of a scene where it moves or is sheared: `length_x`, `tilt_xy`, `strain_x`, `shear_xy`, `strain_rate_x`,
    `shear_rate_xy`, `pressure_x`, `shear_stress_xy` and the like, by name as attributes. Rates can be set, on all ranks alike, and so can
    stresses of components that stresses drive in the case; they hold from the next step on. What is held is 0 where a rate moves a
    component."""

    def __init__(self, simulation):
        object.__setattr__(self, "_simulation", simulation)

    def __dir__(self):
        dimension = self._simulation.dimension
        lines = [f"{name}_{axis}" for name in ("length", "strain", "strain_rate", "pressure") for axis in "xyz"[:dimension]]
        planes = [f"{name}_{plane}" for name in ("tilt", "shear", "shear_rate", "shear_stress") for plane in ("xy", "xz", "yz")[:2 * dimension - 3]]
        return [*object.__dir__(self), *lines, *planes]

    def __getattr__(self, what):
        if what.startswith("_"):
            raise AttributeError(what)
        value = ctypes.c_double()
        self._call("get_cell", what, ctypes.byref(value))
        return value.value

    def __setattr__(self, what, value):
        self._call("set_cell", what, float(reals(value, f"cell: {what}", ())))

    def _call(self, name, what, value):
        """Call a procedure of the library; what a cell does not have is told as Python tells it of other objects."""
        try:
            call(name, self._simulation.handle, what.encode(), value)
        except SimulationError as error:
            if what in dir(self):
                raise
            raise AttributeError(str(error)) from None
