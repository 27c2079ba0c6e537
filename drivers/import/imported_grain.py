"""A row of the bodies file that a DATBOX becomes."""
from dataclasses import dataclass

import numpy as np


@dataclass
class Grain:
    """A body or a part of a glued one. One without a number gets one when the file is written."""
    identifier: int | None
    position: np.ndarray
    radius: float
    mass: float
    material: str
    #: translation, then spin; None at rest
    velocity: np.ndarray | None = None
    #: the boundary that it is glued to, 0 for none
    group: int = 0
    #: name in the file of shapes, empty for a disk or a sphere
    shape: str = ""
    #: angle or quaternion; None for none
    orientation: list | None = None
