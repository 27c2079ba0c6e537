"""Contact problems written in the HDF5 format of FCLIB."""
import h5py
import numpy as np


def write_matrix(group, matrix, form="rows"):
    """Rows, columns, or triplets in any order, one entry in two parts, with room to spare."""
    i, j = np.nonzero(matrix)
    x = matrix[i, j]
    group["m"], group["n"] = np.array([matrix.shape[0]], "i4"), np.array([matrix.shape[1]], "i4")
    if form == "triplets":
        order = np.random.default_rng(0).permutation(len(x))
        i, j, x = np.append(i[order], i[0]), np.append(j[order], j[0]), np.append(x[order], 0.25 * x[0])
        x[np.flatnonzero((i == i[-1]) & (j == j[-1]))[0]] -= x[-1]
        group["nz"], group["i"], group["p"] = np.array([len(x)], "i4"), i.astype("i4"), j.astype("i4")
        group["nzmax"] = np.array([len(x) + 3], "i4")
        group["x"] = np.append(x, [7.0, 7.0, 7.0])
        return
    if form == "columns":
        order = np.lexsort((i, j))
        i, j, x = j[order], i[order], x[order]
    lines = matrix.shape[1 if form == "columns" else 0]
    group["nz"] = np.array([-1 if form == "columns" else -2], "i4")
    group["nzmax"] = np.array([len(x)], "i4")
    group["p"] = np.searchsorted(i, np.arange(lines + 1)).astype("i4")
    group["i"], group["x"] = j.astype("i4"), x


def write_local(path, w, q, mu, form="rows", dimension=3, constraints=None):
    """v = W r + V l + q; the constraints V^T r + R l + s = 0 are (V, R, s)."""
    with h5py.File(path, "w") as file:
        local = file.create_group("fclib_local")
        local["spacedim"] = np.array([dimension], "i4")
        write_matrix(local.create_group("W"), w, form)
        local["vectors/q"], local["vectors/mu"] = q, mu
        if constraints:
            write_matrix(local.create_group("V"), constraints[0], form)
            write_matrix(local.create_group("R"), constraints[1], form)
            local["vectors/s"] = constraints[2]
