"""Anisotropy of contacts and of their forces: how many contacts have a direction, and how large the forces are along it."""
import numpy as np

#: of a fit whose directions leave a component open: it is 0 there
OPEN = 1e-10


class Anisotropy:
    """The fit of contacts with unit normals n, normal forces and tangential forces in d dimensions:

        E(n) = (1 + n.C n)/S,   f_n(n) = f0 (1 + n.N n),   f_t(n) = f0 (T n - n (n.T n)),

    with the whole angle S and tensors `contacts` C, `normal` N and `tangential` T without trace; `mean` is f0. In the plane n.C n = a_c cos 2(theta - theta_c)
    and f_t along the normal turned to the left is -f0 a_t sin 2(theta - theta_t), as Rothenburg and Bathurst have it. `shape` gives the size and the
    direction of a tensor, `stress` what the fit says of the stress. What too few contacts do not tell is NaN."""

    def __init__(self, normals, normal, tangential):
        count, d = normals.shape
        self.dimension = d
        parts = _deviators(d)
        self.contacts, self.normal, self.tangential = (np.full((d, d), np.nan) for _ in range(3))
        self.mean = np.nan
        self.fabric = normals.T @ normals / count if count else np.full((d, d), np.nan)
        if count <= len(parts):
            return
        # of E the mean of n n is 1/d + 2 C/(d (d + 2))
        self.contacts = 0.5 * d * (d + 2) * (self.fabric - np.eye(d) / d)
        along = np.stack([np.einsum("ci,ij,cj->c", normals, part, normals) for part in parts], axis=1)
        mean, *size = _least_squares(np.column_stack([np.ones(count), along]), normal)
        across = np.stack([normals @ part - normals * values[:, None] for part, values in zip(parts, along.T)], axis=2)
        turned = _least_squares(across.reshape(-1, len(parts)), tangential.ravel())
        self.mean = float(mean)
        if self.mean > 0.0:
            self.normal = np.tensordot(size, parts, 1) / self.mean
            self.tangential = np.tensordot(turned, parts, 1) / self.mean

    def stress(self):
        """Deviator of the stress over its mean pressure, as the fit says, for branches of one length along the normals: a tensor without trace."""
        d = self.dimension
        pressure = 1.0 + 2.0 / (d * (d + 2)) * np.sum(self.contacts * self.normal)
        return 2.0 / (d + 2) * (self.contacts + self.normal + 0.5 * d * self.tangential) / pressure


def size_of(tensor):
    """Size of a tensor without trace: a where it is that of a cos 2(theta - theta_0) in the plane, in space the root of 3/2 of the sum of its squares, which is
    the difference of its largest value and the others where these are equal."""
    return float(np.sqrt((0.5 if len(tensor) == 2 else 1.5) * np.sum(tensor * tensor)))


def direction_of(tensor):
    """Unit vector along which a symmetric tensor has its largest value, its largest component above 0 (d)."""
    if not np.isfinite(tensor).all():
        return np.full(len(tensor), np.nan)
    vector = np.linalg.eigh(tensor)[1][:, -1]
    return vector * np.sign(vector[np.argmax(np.abs(vector))])


def angle_of(vector):
    """Of a direction in the plane to x, from 0 up to 180 [degrees]."""
    return float(np.degrees(np.arctan2(vector[1], vector[0])) % 180.0)


def _deviators(d):
    """Tensors without trace that all others are sums of (d (d + 1)/2 - 1, d, d)."""
    parts = []
    for a in range(d):
        for b in range(a + 1, d):
            parts.append(np.zeros((d, d)))
            parts[-1][a, b] = parts[-1][b, a] = 1.0
    for a in range(d - 1):
        parts.append(np.zeros((d, d)))
        parts[-1][a, a], parts[-1][d - 1, d - 1] = 1.0, -1.0
    return np.array(parts)


def _least_squares(matrix, values):
    """Factors of the columns of a matrix whose sum is nearest to the values; the smallest ones where several are."""
    return np.linalg.lstsq(matrix.T @ matrix, matrix.T @ values, rcond=OPEN)[0]
