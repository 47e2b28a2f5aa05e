"""Many loads on one grain and its contacts: the exact judge's safety factor and mode for each.

What hangs on the contacts alone is found once: by `planar_batch` in the plane, by `spatial_batch` in space. What lies
too near to a boundary for that is judged one by one.
"""

from dataclasses import dataclass

import numpy as np

from incipient.arrays import Booleans, Floats, Integers
from incipient.contact.exact.judge import MassAndInertia, judged
from incipient.contact.exact.motion_modes import Mode
from incipient.contact.friction_law import FrictionLaw
from incipient.contact.loads.planar_batch import Planar
from incipient.contact.loads.spatial_batch import Spatial
from incipient.contact.model import Loads
from incipient.geometry.contacts import Contacts

__all__ = ["Batch", "Loads", "judge_batch"]

CHUNK = 100_000  # loads at a time


@dataclass(frozen=True, eq=False)
class Batch:
    """What the exact judge says of n loads."""

    factors: Floats  # (n,) safety factors
    held: Booleans  # (n,) whether the load as it is is balanced
    modes: Integers  # (n,) places in `labels`, which are as of `exact.Exact.label`
    labels: tuple[str, ...]
    alone: int  # how many loads were judged one by one


def judge_batch(
    loads: Loads,
    contacts: Contacts,
    friction: float | Floats,
    mass_and_inertia: MassAndInertia | None = None,
) -> Batch:
    """Judge loads one like the other: as `exact.judged` does each, to round-off. Not collective.

    friction: the coefficient, or that of each load (n,), of which each value is a batch of its own

    Raises SceneError as `exact.judged` does.
    """
    coefficients = np.broadcast_to(np.asarray(friction, dtype=float), len(loads))
    labels = ("rest", "moves", *(one.label for one in Mode if one is not Mode.REST))
    factors, held = np.empty(len(loads)), np.empty(len(loads), dtype=bool)
    modes, alone = np.empty(len(loads), dtype=np.int64), 0
    for law in map(FrictionLaw, np.unique(coefficients).tolist()):
        alike = np.flatnonzero(coefficients == law.coefficient)
        same = loads if len(alike) == len(loads) else loads.part(alike)
        given = contacts, law.coefficient, mass_and_inertia
        case = Planar.of(same, *given) or Spatial.of(same, *given)
        for start in range(0, len(alike), CHUNK):
            some = slice(start, start + CHUNK)
            rows, part, doubtful = alike[some], same.part(some), np.ones(len(alike[some]), dtype=bool)
            if case is not None:
                factors[rows], held[rows], modes[rows], doubtful = case.judged(part)
            left = rows[doubtful]
            if len(left):  # what comes several times is judged once
                _, first, place = np.unique(
                    part.table[doubtful], axis=0, return_index=True, return_inverse=True
                )
                one_by_one = [judged(loads.load(number), *given) for number in left[first].tolist()]
                place = place.ravel()
                factors[left] = np.array([exact.safety.value for exact in one_by_one])[place]
                held[left] = np.array([not exact.moves for exact in one_by_one])[place]
                modes[left] = np.array([labels.index(exact.label) for exact in one_by_one])[place]
            alone += len(left)
    return Batch(factors, held, modes, labels, alone)
