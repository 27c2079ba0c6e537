"""What is in HDF5 files that runs wrote, as arrays by name: {path: array} and {path@attribute: value}."""
import collections.abc

import h5py
import numpy as np


def contents(path):
    """Everything in an HDF5 file."""
    found = {}
    with h5py.File(path, "r") as file:
        _collect(file.id, "", found)
    return found


class Results(collections.abc.Mapping):
    """A file as it is now. What is asked for by its name is read alone, in a tenth of the time that all takes; all is read where names
    are listed."""

    def __init__(self, path):
        # a copy: the file itself may be written to by the next run in its directory
        with open(path, "rb") as file:
            self._file = h5py.h5f.open_file_image(file.read())
        self._known, self._whole = {}, False

    def __getitem__(self, name):
        if name not in self._known:
            path, at, attribute = name.partition("@")
            if self._whole or not name.startswith(("/", "@")):
                raise KeyError(name)
            node = h5py.h5o.open(self._file, (path or "/").encode())
            self._known[name] = _attribute(node, h5py.h5a.open(node, attribute.encode())) if at else _value(node)
        return self._known[name]

    def __iter__(self):
        return iter(self._all())

    def __len__(self):
        return len(self._all())

    def _all(self):
        if not self._whole:
            self._known, self._whole = {}, True
            _collect(self._file, "", self._known)
        return self._known

    def steps(self):
        """Numbers of the steps whose states it holds, in ascending order."""
        return sorted(int(name) for name in self.names("/steps"))

    def arrays(self):
        """All but attributes, in half the time."""
        _collect(self._file, "", self._known, False)
        return {name: value for name, value in self._known.items() if "@" not in name and name[0] == "/"}

    def names(self, path):
        """What is in a group; nothing where there is no such group."""
        return [name.decode() for name in h5py.h5g.open(self._file, path.encode())] if path in self else []

    def of_steps(self, name, needed=True):
        """What is called so in each state, in the order of steps; None in a state that has none and needs none."""
        steps = h5py.h5g.open(self._file, b"/steps")
        found = []
        for number in self.steps():
            try:
                found.append(_value(h5py.h5o.open(steps, f"{number}/{name}".encode())))
            except KeyError:
                if needed:
                    raise
                found.append(None)
        return found


def _collect(group, path, found, attributes=True):
    """Put all below a group into `found`, by the library's own calls, in half the time that h5py's objects take."""
    for k in range(group.get_num_objs()):
        name = group.get_objname_by_idx(k)
        place = f"{path}/{name.decode()}"
        node = h5py.h5o.open(group, name)
        for number in range(h5py.h5a.get_num_attrs(node) if attributes else 0):
            attribute = h5py.h5a.open(node, index=number)
            found[f"{place}@{attribute.name.decode()}"] = _attribute(node, attribute)
        found[place] = _value(node)
        if isinstance(node, h5py.h5g.GroupID):
            _collect(node, place, found, attributes)


def _attribute(node, attribute):
    kind = attribute.dtype
    if kind.kind == "O":
        return np.asarray(h5py.AttributeManager(_OfNode(node))[attribute.name])
    values = np.empty(attribute.shape, kind)
    attribute.read(values)
    return values


def _value(node):
    if isinstance(node, h5py.h5g.GroupID):
        return "group"
    kind = node.dtype
    if kind.kind == "O":
        return h5py.Dataset(node)[()]
    values = np.empty(node.shape, kind)
    node.read(h5py.h5s.ALL, h5py.h5s.ALL, values)
    return values[()]


class _OfNode:
    """What h5py asks of the owner of attributes."""

    def __init__(self, node):
        self.id = node


def steps_of(results):
    """Numbers of the steps of a results file, in ascending order."""
    if isinstance(results, Results):
        return results.steps()
    return sorted(int(name.split("/")[2]) for name in results if name.startswith("/steps/") and name.count("/") == 2
                  and "@" not in name)
