"""Fields on a grid as files of VTK in XML, which ParaView reads: image data, or a structured grid of a periodic cell that leans."""
import base64

import numpy as np

from .tables import ResultsError

#: columns that say where a cell is and of which state, which the grid itself and the time do
PLACES = ("step", "time", "states", "x", "y", "z")
#: what is said to lean, over the lengths
LEANS = 1e-9


def ending_of(fields):
    """The ending of the file of some fields."""
    edges = fields.edges
    return ".vts" if np.abs(edges - np.diag(np.diag(edges))).max() > LEANS * np.abs(edges).max() else ".vti"


def write_image(path, fields):
    """Write `gravier.Fields` as cells of image data (.vti) or of a structured grid (.vts)."""
    ending = ending_of(fields)
    if not str(path).endswith(ending):
        raise ResultsError(f"{path}: expected a name that ends in {ending}")
    counts = [fields.shape[fields.axes.index(axis)] if axis in fields.axes else 0 for axis in "xyz"]
    extent = " ".join(f"0 {count}" for count in counts)
    kind = "ImageData" if ending == ".vti" else "StructuredGrid"
    lines = ['<?xml version="1.0"?>', f'<VTKFile type="{kind}" version="1.0" byte_order="LittleEndian" header_type="UInt64">']
    corner, edges = np.zeros(3), np.eye(3)
    d = len(fields.corner)
    corner[:d], edges[:d, :d] = fields.corner, fields.edges
    for axis, name in enumerate("xyz"[:d]):
        if name not in fields.axes:
            # the grid lies in the middle of what its fields are means over
            corner += 0.5 * edges[axis]
    if kind == "ImageData":
        spacing = [edges[axis, axis] / max(1, count) for axis, count in enumerate(counts)]
        lines.append(f'<ImageData WholeExtent="{extent}" Origin="{_numbers(corner)}" Spacing="{_numbers(spacing)}">')
    else:
        lines.append(f'<StructuredGrid WholeExtent="{extent}">')
    lines.append('<FieldData>' + _array("TimeValue", fields.time[:1], 'NumberOfTuples="1"') + '</FieldData>')
    lines.append(f'<Piece Extent="{extent}">')
    if kind == "StructuredGrid":
        lines.append(f"<Points>{_array('points', _corners(corner, edges, counts))}</Points>")
    lines.append("<CellData>")
    lines += [_array(name, _cells(values, fields)) for name, values in fields.items() if name not in PLACES]
    lines += ["</CellData>", "</Piece>", f"</{kind}>", "</VTKFile>", ""]
    with open(path, "w", encoding="ascii") as file:
        file.write("\n".join(lines))


def _numbers(values):
    return " ".join(repr(float(value)) for value in values)


def _array(name, values, more=""):
    values = np.ascontiguousarray(values, dtype="<f8")
    parts = f' NumberOfComponents="{values.shape[1]}"' if values.ndim > 1 else ""
    coded = base64.b64encode(np.uint64(values.nbytes).tobytes() + values.tobytes()).decode("ascii")
    return f'<DataArray type="Float64" Name="{name}"{parts} {more} format="binary">{coded}</DataArray>'


def _cells(values, fields):
    """A column with the first axis the fastest, vectors and tensors with three components along each side."""
    box = np.moveaxis(values.reshape(*fields.shape, *values.shape[1:]), range(len(fields.shape)), range(len(fields.shape))[::-1])
    rows = box.reshape(len(values), *values.shape[1:])
    if rows.ndim == 1:
        return rows
    wide = np.zeros((len(rows),) + (3,) * (rows.ndim - 1))
    wide[(slice(None), *(slice(count) for count in rows.shape[1:]))] = rows
    return wide.reshape(len(rows), -1)


def _corners(corner, edges, counts):
    """Corners of the cells, the first axis the fastest."""
    z, y, x = np.meshgrid(*(np.arange(count + 1) / max(1, count) for count in counts[::-1]), indexing="ij")
    return corner + np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1) @ edges
