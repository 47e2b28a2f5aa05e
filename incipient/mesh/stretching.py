"""Places of a mesh's nodes in a larger box, and with a grain that is a little farther from the bed.

The cells stay the same ones, so that two flows on them differ by what was changed and hardly by their errors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from ..meshes import SYMMETRY
from .domain import Domain
from .motion import MeshMotion, Potentials

# Smallest quality of a moved cell, over that of the cell as it was made, with which it still serves.
LEAST_QUALITY = 0.02


@dataclass(frozen=True)
class KeptBox:
    """The least and the largest coordinates (3,) of a region."""

    low: Floats
    high: Floats


def stretched(x: Floats, centre: Floats, kept: Floats, old: KeptBox, new: KeptBox) -> Floats | None:
    """Points (n, 3) of one box in another; None where there is no room to stretch. Not collective.

    On each axis a point stays as it is within `kept` (3,) of the centre; beyond, it goes by a parabola that begins
    there and takes the old side to the new one.
    """
    moved = x.copy()
    for axis in range(3):
        for side, one, other in ((1.0, old.high, new.high), (-1.0, old.low, new.low)):
            way = side * (other[axis] - one[axis])
            room = side * (one[axis] - centre[axis]) - kept[axis]
            if abs(way) < 1e-12 * float((old.high - old.low).max()):
                continue
            if room <= 0.0 or way <= -0.5 * room:  # a shorter way back would fold the cells
                return None
            beyond = np.maximum(side * (x[:, axis] - centre[axis]) - kept[axis], 0.0)
            moved[:, axis] += side * way * (beyond / room) ** 2
    return moved


class Lifting:
    """Moves the nodes with a body, less the farther from it, and not at all on other boundaries. Collective.

    Those on the plane of symmetry move along it.
    """

    def __init__(self, domain: Domain, boundary: str):
        self._weights = Potentials(domain).weights(boundary, (SYMMETRY,), rigid=1.0)[:, None]

    def at(self, shift: Floats) -> Floats:
        """(n, 3) displacements of the mesh's nodes when the body is shifted by (3,). Not collective."""
        return np.asarray(self._weights * shift)


def serves(motion: MeshMotion, places: Floats) -> bool:
    """Whether a mesh with its nodes at other places (n, 3) is good enough to compute a flow on. Collective."""
    return motion.quality(places).relative > LEAST_QUALITY
