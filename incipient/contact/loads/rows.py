"""Many contact problems with equally many contacts each, in numbers of order one, row by row.

Lengths are divided by the longest arm from the centre of mass, as of `exact.grasp`; forces keep their unit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from incipient.arrays import Booleans, Floats, Integers

CLEAR = 1e-7  # of unit vectors: what is nearer to a boundary than that is judged by itself
TURNS, SLIDES, ROLLS, LIFTS, SPINS = (
    1,
    2,
    4,
    8,
    16,
)  # what a motion is made of; DOUBTFUL: it is not sure
DOUBTFUL = -1


@dataclass(frozen=True, eq=False)
class Rows:
    """n problems of k contacts: arms and inward normals (n, k, 3), friction (n,), and wrenches (n, 6) about the centre.

    inertia: (n, 3, 3) over mass and squared length; NaN where it is not known.
    """

    arms: Floats
    inward: Floats
    friction: Floats
    inertia: Floats
    flow: Floats
    weight: Floats

    def __len__(self) -> int:
        return len(self.friction)

    def part(self, rows: Integers | Booleans | slice) -> Rows:
        """The problems at places `rows`."""
        return Rows(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    @property
    def tells(self) -> Booleans:
        """Whose inertia is known, (n,): how they begin to move is told."""
        return np.isfinite(self.inertia[:, 0, 0])

    def turned(self, axis: int) -> Rows:
        """The problems with coordinates exchanged in a circle, so that an axis becomes the third."""
        order = (np.arange(3) + axis + 1) % 3
        both = np.concatenate([order, order + 3])
        inertia = self.inertia[:, order][:, :, order]
        return Rows(
            self.arms[..., order],
            self.inward[..., order],
            self.friction,
            inertia,
            self.flow[:, both],
            self.weight[:, both],
        )


@dataclass(frozen=True, eq=False)
class Answers:
    """What is said of n problems: safety factors, whether held, modes as of `batch.LABELS`, and which are doubtful."""

    factors: Floats
    held: Booleans
    modes: Integers
    doubtful: Booleans


def unit_and_size(wrenches: Floats) -> tuple[Floats, Floats]:
    """Vectors (n, d) at length one, or zero, and their lengths (n,)."""
    size = np.linalg.norm(wrenches, axis=1)
    return wrenches / np.where(size > 0.0, size, 1.0)[:, None], size
