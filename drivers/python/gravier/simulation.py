"""A run whose loop is the user's: steps one by one, arrays of its bodies, drives and loads that change between steps.

    with gravier.Simulation("case.nml") as s:
        while s.goes_on:
            s.step()

On several ranks every rank runs the script: mpiexec -n 2 python3 script.py.
"""
import atexit
import ctypes
import os
import sys
import traceback

import numpy as np

from .arrays import plain, read_only, reals
from .library import SimulationError, call, load
from .scene_parts import Boundaries, Cell

RESTART, QUIET, FORCES, CHANGED = 1, 2, 4, 8
KINDS = {0: "<f8", 1: "<i8", 2: "<i4"}


class _Memory:
    """What numpy asks of memory that is not its own."""

    def __init__(self, address, shape, kind):
        self.__array_interface__ = {"data": (address, True), "shape": shape, "typestr": kind, "version": 3}


class Subdomain:
    """Bodies of a subdomain of this rank, in the order of `id`. Arrays are to be read, until the next step; `velocity`, `spin` and, with forces,
    `force` are set as a whole."""

    def __init__(self, simulation, number):
        self._simulation, self._number = simulation, number

    def _field(self, name):
        """A field where the library keeps it: to be copied before the library does anything else."""
        address, shape, kind = ctypes.c_void_p(), (ctypes.c_int64 * 2)(), ctypes.c_int()
        call("array", self._simulation.handle, name.encode(), self._number, ctypes.byref(address), shape, ctypes.byref(kind))
        size = (shape[0], shape[1])
        if not address.value:
            return np.zeros(size, KINDS[kind.value])
        return np.asarray(_Memory(address.value, size, KINDS[kind.value]))

    def _copy(self, name, columns=slice(None)):
        # whole rows are copied three times as fast as some of their columns
        return read_only(np.array(self._field(name))[:, columns], self._simulation)

    def _whole(self, name, values):
        """The field of the library that an array belongs to, and what it will be."""
        if name == "force":
            return name, reals(values, name, (len(self), self._simulation.dimension))
        whole = np.array(self._field("velocity"))
        columns = slice(None, self._simulation.dimension) if name == "velocity" else slice(self._simulation.dimension, None)
        whole[:, columns] = reals(values, name, whole[:, columns].shape)
        return "velocity", whole

    def _call(self, function, field, values):
        shape = (ctypes.c_int64 * 2)(*values.shape)
        call(function, self._simulation.handle, field.encode(), self._number, values.ctypes.data, shape)

    def __len__(self):
        return len(self._field("id"))

    @property
    def id(self):
        return self._copy("id", 0)

    @property
    def radius(self):
        return self._copy("radius", 0)

    @property
    def mass(self):
        return self._copy("mass", 0)

    @property
    def material(self):
        return self._copy("material", 0)

    @property
    def glued(self):
        return self._copy("glued", 0)

    @property
    def position(self):
        return self._copy("position")

    @property
    def orientation(self):
        return self._copy("orientation")

    @property
    def velocity(self):
        return self._copy("velocity", slice(None, self._simulation.dimension))

    @velocity.setter
    def velocity(self, values):
        self._call("set_array", *self._whole("velocity", values))

    @property
    def spin(self):
        return self._copy("velocity", slice(self._simulation.dimension, None))

    @spin.setter
    def spin(self, values):
        self._call("set_array", *self._whole("spin", values))

    @property
    def force(self):
        return self._copy("force")

    @force.setter
    def force(self, values):
        self._call("set_array", *self._whole("force", values))


class Bodies:
    """Bodies of this rank: those of its subdomains, one after the other. Arrays are read and set in the same way."""

    def __init__(self, subdomains, columns):
        object.__setattr__(self, "_subdomains", subdomains)
        #: numbers of a body in the arrays that have several
        object.__setattr__(self, "_columns", columns)

    def __len__(self):
        return sum(len(one) for one in self._subdomains)

    def __getattr__(self, name):
        if not isinstance(getattr(Subdomain, name, None), property):
            raise AttributeError(f"no array {name} of bodies")
        arrays = [getattr(one, name) for one in self._subdomains]
        if not arrays:
            return np.zeros((0, self._columns[name]) if name in self._columns else 0)
        return arrays[0] if len(arrays) == 1 else read_only(np.concatenate(arrays), arrays[0]._owner)

    def __setattr__(self, name, values):
        if getattr(getattr(Subdomain, name, None), "fset", None) is None:
            raise AttributeError(f"array {name} of bodies cannot be set; expected one of velocity, spin, force")
        counts = [len(one) for one in self._subdomains]
        values = reals(values, name)
        if values.shape != (sum(counts), self._columns[name]):
            raise SimulationError(f"{name}: an array of shape {values.shape}; expected ({sum(counts)}, {self._columns[name]}), a row for "
                                  "each body of this rank")
        parts = np.split(values, np.cumsum(counts)[:-1])
        wholes = [(one, *one._whole(name, part)) for one, part in zip(self._subdomains, parts)]
        # nothing is set where a subdomain refuses its part
        for function in ("check_array", "set_array"):
            for one, field, whole in wholes:
                one._call(function, field, whole)


class Simulation:
    """A run that is open. `restart` goes on from the checkpoint of the case, and `changed` beside it takes loads, drives and coefficients of contact
    that the case has changed since; `quiet` keeps the log off the terminal, `forces` gives bodies an array `force` [N]; `communicator` is one of
    mpi4py. All ranks of it make the same calls."""

    # a name that is misspelt is refused
    __slots__ = ("mark", "status", "dimension", "rank", "ranks", "_made", "subdomains", "bodies", "boundaries", "_handle", "__weakref__")

    #: the one that is open in this process
    _open = None

    def __init__(self, case, restart=False, quiet=False, forces=False, communicator=None, changed=False):
        #: counts steps: arrays of bodies are of one of them
        self.mark = 0
        #: exit status of the program for such a run, once it is closed
        self.status = None
        #: rank of this process, from 0, and number of ranks
        self.rank, self.ranks = 0, 1
        self._handle = ctypes.c_void_p()
        options = RESTART * bool(restart) + QUIET * bool(quiet) + FORCES * bool(forces) + CHANGED * bool(changed)
        number = None if communicator is None else ctypes.pointer(ctypes.c_int(communicator.py2f()))
        command = " ".join(["gravier.Simulation", *sys.argv]).encode(errors="replace")
        try:
            path = os.fsencode(case)
        except TypeError:
            raise SimulationError(f"{case!r}: expected the path of an input file") from None
        if Simulation._open is not None:
            raise SimulationError("open: a simulation is open in this process; expected that it is closed before, by gravier.Simulation.opened().close() "
                                  "if it is lost", of_all_ranks=True)
        sys.stdout.flush()
        call("open", path, command, options, number, ctypes.byref(self._handle))
        # a script that ends without close
        atexit.register(self._leave)
        Simulation._open = self
        self.dimension, self.rank, self.ranks = self.whole("dimension"), self.whole("rank"), self.whole("ranks")
        #: bodies by subdomain of this rank, bodies of this rank, boundaries by name
        self.subdomains = [Subdomain(self, k) for k in range(self.whole("subdomains"))]
        d = self.dimension
        self.bodies = Bodies(self.subdomains, {"position": d, "velocity": d, "force": d, "spin": self.whole("velocity_entries") - d, "orientation": 0})
        self.boundaries = Boundaries(self)

    @staticmethod
    def opened():
        """The simulation that is open in this process, also where no name of the script holds it any more; None where none is."""
        return Simulation._open

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        if self._handle is None:
            return
        if self._is_alone(error):
            traceback.print_exception(kind, error, trace)
            self._abort()
        try:
            if error is not None and self.goes_on:
                self.stop(f"an exception in its loop, {kind.__name__}")
            self.close()
        except SimulationError:
            if error is None:
                raise

    def _is_alone(self, error):
        """Whether this rank may be the only one with an exception: the others wait for it in their next call of all ranks."""
        return error is not None and self.ranks > 1 and not getattr(error, "of_all_ranks", False)

    @staticmethod
    def _abort():
        sys.stderr.flush()
        load().gravier_abort()

    def _leave(self):
        """At the end of a script that has not closed the run: an exception that ended it has been printed."""
        if self._is_alone(getattr(sys, "last_value", None)):
            self._abort()
        self.close()

    @property
    def handle(self):
        if self._handle is None:
            raise SimulationError("this simulation is closed; expected one that is open")
        return self._handle

    def whole(self, name):
        """A whole number by its name in gravier.h."""
        value = ctypes.c_int64()
        call("whole", self.handle, name.encode(), ctypes.byref(value))
        return value.value

    def real(self, name):
        """A real number by its name in gravier.h, or by that of a column that &output adds to history.csv, as of the last step."""
        value = ctypes.c_double()
        call("real", self.handle, name.encode(), ctypes.byref(value))
        return value.value

    def step(self):
        """Make one step, with its log and its outputs. Arrays of bodies that were taken before are no longer valid."""
        handle = self.handle
        self.mark += 1
        call("step", handle)

    def stop(self, reason="its loop has stopped it"):
        """End the run after the present step, with its last state and checkpoint written. Without effect once it is over."""
        call("stop", self.handle, str(reason).encode())

    def checkpoint(self):
        """Write checkpoint.h5 now."""
        call("checkpoint", self.handle)

    def close(self):
        """End the run, which is stopped if it goes on. Sets and returns `status`: 0, 3 where a solve missed its tolerance, 4 where the run was
        interrupted. An error of the run is raised."""
        if self._handle is None:
            return self.status
        atexit.unregister(self._leave)
        Simulation._open = None
        self._made = self.made
        handle, self._handle = self._handle, None
        self.mark += 1
        self.status = load().gravier_close(handle)
        line = load().gravier_error().decode(errors="replace")
        if line:
            raise SimulationError(line, self.status, True)
        return self.status

    goes_on = property(lambda self: bool(self.whole("goes_on")), doc="there is a step to make")
    made = property(lambda self: self._made if self._handle is None else self.whole("step"), doc="steps made so far")
    steps = property(lambda self: self.whole("steps"), doc="steps of the case")
    time = property(lambda self: self.real("time"), doc="[s]")
    time_step = property(lambda self: self.real("time_step"), doc="[s]")
    restarted = property(lambda self: bool(self.whole("restarted")), doc="the run goes on from a checkpoint")
    converged = property(lambda self: bool(self.whole("converged")), doc="the solve of the last step has reached its goal")
    iterations = property(lambda self: self.whole("iterations"), doc="of the last step")
    contacts = property(lambda self: self.whole("contacts"), doc="of the last step, on all ranks")
    cell = property(lambda self: Cell(self), doc="of the scene, where it moves or is sheared")
    kinetic_energy = property(lambda self: self.real("kinetic_energy"), doc="of all free bodies after the last step [J]")

    @property
    def gravity(self):
        """[m/s^2]; can be set, on all ranks alike."""
        return np.array([self.real("gravity_" + axis) for axis in "xyz"[:self.dimension]])

    @gravity.setter
    def gravity(self, values):
        values = reals(values, "gravity").ravel()
        call("set_gravity", self.handle, values.ctypes.data, len(values))

    @property
    def friction(self):
        """Coefficient between bodies; can be set, on all ranks alike."""
        return self.real("friction")

    @friction.setter
    def friction(self, value):
        call("set_friction", self.handle, float(reals(value, "friction", ())))

    def add_bodies(self, position, radius, velocity=None, mass=None, material=None):
        """Let disks or spheres enter at the start of the next step, in free places; on all ranks alike. They get the next identifiers. Their mass
        is that of the density of the material unless it is given."""
        position = reals(position, "position")
        if position.ndim != 2 or position.shape[1] != self.dimension:
            raise SimulationError(f"position: an array of shape {position.shape}; expected (bodies, {self.dimension})")
        n = len(position)

        def column(values, what, missing):
            return np.full(n, missing, float) if values is None else np.ascontiguousarray(np.broadcast_to(reals(values, what), n))

        try:
            # A mass of 0 means to the library that none is given. One that is given as 0 is passed as NaN, which the library refuses.
            given = None if mass is None else np.where(reals(mass, "mass") == 0.0, np.nan, reals(mass, "mass"))
            radius, mass, material = column(radius, "radius", 0.0), column(given, "mass", 0.0), column(material, "material", 1.0)
        except ValueError:
            raise SimulationError(f"radius, mass, material: expected one number, or one for each of {n} bodies") from None
        if not (np.isfinite(material).all() and (material == np.round(material)).all() and (np.abs(material) < 2**31).all()):
            raise SimulationError("material: expected whole numbers")
        velocity = np.zeros_like(position) if velocity is None else reals(velocity, "velocity", position.shape)
        material = material.astype(np.int32)
        call("add_bodies", self.handle, n, *(array.ctypes.data for array in (radius, mass, material, position, velocity)))

    def remove(self, ids):
        """Take free bodies out of the scene at the start of the next step; on all ranks alike."""
        ids = np.atleast_1d(np.array(plain(ids)))
        if ids.ndim != 1 or (ids.size and ids.dtype.kind not in "iu"):
            raise SimulationError("remove: expected identifiers, which are whole numbers")
        for number in ids[(ids < 0) | (ids > np.iinfo(np.int64).max)] if ids.size else ():
            raise SimulationError(f"remove: body {number}: no free body of the scene; expected an identifier of one")
        ids = ids.astype(np.int64)
        call("remove_bodies", self.handle, len(ids), ids.ctypes.data)

    def sum(self, values):
        """Sum of a number, or of each number of an array, over the ranks; the same bits whatever their order."""
        return self._reduced("sum", values)

    def highest(self, values):
        """The highest of a number, or of each number of an array, over the ranks."""
        return self._reduced("highest", values)

    def _reduced(self, name, values):
        found = reals(values, name)
        shape, found = found.shape, found.ravel()
        getattr(load(), "gravier_" + name)(self.handle, len(found), found.ctypes.data)
        return found.reshape(shape) if shape else float(found[0])
