"""Arrays that the loop of a run hands out, which are valid for one step, and numbers that it takes."""
import numpy as np

from .library import SimulationError


class StaleArray(Exception):
    """An array of bodies is used after the step for which it is valid."""


#: attributes of an array that say nothing of its values
WITHOUT_VALUES = frozenset(("_owner", "_mark", "shape", "ndim", "size", "dtype", "itemsize", "nbytes", "flags", "__class__", "__dict__", "__len__"))


class View(np.ndarray):
    """A field of bodies, in memory of its own: to be read, until the next step. numpy asks nobody before numpy.array and numpy.asarray: they
    give the values of the step that it is of."""

    def __array_finalize__(self, other):
        self._owner, self._mark = getattr(other, "_owner", None), getattr(other, "_mark", None)

    def __getattribute__(self, name):
        if name not in WITHOUT_VALUES:
            refuse_stale(self)
        return np.ndarray.__getattribute__(self, name)

    def __getitem__(self, key):
        refuse_stale(self)
        return super().__getitem__(key)

    def __array_ufunc__(self, ufunc, method, *inputs, **keywords):
        return getattr(ufunc, method)(*(plain(one) for one in inputs), **{key: plain(one) for key, one in keywords.items()})

    def __array_function__(self, function, types, arguments, keywords):
        return function(*plain(arguments), **plain(keywords))

    def copy(self, order="C"):
        return plain(self).copy(order)


def _guarded(name):
    """A special method, which Python does not look up among the attributes of an array."""
    return lambda self, *arguments: getattr(plain(self), name)(*plain(arguments))


# numpy forgets an exception within == and !=
for _name in ("bool", "complex", "contains", "copy", "deepcopy", "eq", "float", "format", "index", "int", "iter", "ne", "reduce", "reduce_ex", "repr",
              "str"):
    setattr(View, f"__{_name}__", _guarded(f"__{_name}__"))


def refuse_stale(view):
    owner = np.ndarray.__getattribute__(view, "_owner")
    if owner is not None and owner.mark != np.ndarray.__getattribute__(view, "_mark"):
        raise StaleArray("this array of bodies is of a step that is over; expected one that is taken anew, or a copy: numpy.array(...)")


def read_only(array, owner):
    """An array as it is handed out, which is not to be written to, since nobody would notice."""
    array.flags.writeable = False
    view = array.view(View)
    view._owner, view._mark = owner, owner.mark
    return view


def plain(value):
    """Views in arguments as arrays of numpy."""
    if isinstance(value, View):
        refuse_stale(value)
        return np.ndarray.view(value, np.ndarray)
    if isinstance(value, (list, tuple)):
        return type(value)(plain(one) for one in value)
    if isinstance(value, dict):
        return {key: plain(one) for key, one in value.items()}
    return value


#: kinds of arrays whose values are no numbers, although numpy makes numbers of some of them
NO_NUMBERS = "USVmM"


def reals(values, what, shape=None):
    """An array of doubles, of a shape where one is asked for."""
    if isinstance(values, np.ma.MaskedArray):
        raise SimulationError(f"{what}: a masked array; expected numbers for all entries")
    try:
        found = np.asarray(plain(values))
        if found.dtype.kind == "c":
            raise SimulationError(f"{what}: an array of complex numbers; expected real ones")
        if found.dtype.kind in NO_NUMBERS or (found.dtype.kind == "O" and any(np.asarray(one).dtype.kind in NO_NUMBERS for one in found.flat)):
            raise SimulationError(f"{what}: expected numbers")
        found = np.array(found, dtype=np.float64, order="C")
    except (TypeError, ValueError):
        raise SimulationError(f"{what}: expected numbers") from None
    if shape is not None and found.shape != shape:
        raise SimulationError(f"{what}: an array of shape {found.shape}; expected {shape}")
    return found
