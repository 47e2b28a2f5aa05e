"""Contact forces of least size, where several sets of forces do the same."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from incipient.contact import cones
from incipient.contact.model import Floats

RANK = 1e-10  # singular values below it, relative to the largest, count as zero
MISSED = 1e-9  # how far the wrench may be missed, in numbers of order one


@dataclass(frozen=True, eq=False)
class Balancing:
    """All x with columns x = -wrench: start, the shortest, + null z; `null` (m, z) is orthonormal."""

    start: Floats
    null: Floats

    @property
    def unique(self) -> bool:
        """Whether there is one x only."""
        return self.null.shape[1] == 0

    def inside(self, rows: Floats, triples: Floats) -> Floats | None:
        """The shortest x with rows x >= 0 (p, m) and triples x (3 q, m) in unit circular cones, if any."""
        if (rows @ self.start >= 0.0).all() and (cones.slack(triples @ self.start) >= 0.0).all():
            return self.start
        if self.unique:
            return None
        if len(triples) == 0:
            return _least_distance(self.start, self.null, rows)
        return _by_cones(self.start, self.null, rows, triples)


def balancing(columns: Floats, wrench: Floats) -> Balancing | None:
    """The factors of columns (6, m), wrenches of unit forces, that balance a wrench (6,); None if none do."""
    left, sizes, right = np.linalg.svd(columns)
    rank = int((sizes > RANK * sizes[0]).sum())
    start = -(right[:rank].T / sizes[:rank]) @ (left[:, :rank].T @ wrench)
    if np.abs(columns @ start + wrench).max() > MISSED:
        return None
    return Balancing(np.asarray(start), right[rank:].T)


def _by_cones(start: Floats, null: Floats, rows: Floats, triples: Floats) -> Floats | None:
    """The shortest z with start + null z in all cones, added to the start."""
    table = np.vstack([rows, triples])
    size = null.shape[1]
    found = cones.minimum(np.zeros(size), -table @ null, table @ start, len(rows), np.eye(size))
    if found is None:
        return None
    return np.asarray(start + null @ cones.snapped(triples @ start, triples @ null, found))


def _least_distance(start: Floats, null: Floats, rows: Floats) -> Floats | None:
    """The shortest z with rows (start + null z) >= 0 (Lawson and Hanson 1974, LDP), added to the start."""
    system = np.vstack([(rows @ null).T, -rows @ start])
    target = np.zeros(len(system))
    target[-1] = 1.0
    factors, rest = nnls(system, target)
    residual = system @ factors - target
    if rest <= 1e-12:
        return None
    return np.asarray(start - null @ (residual[:-1] / residual[-1]))
