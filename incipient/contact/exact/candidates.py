"""One solution of the problem of incipient motion in numbers of order one, before it is read as a motion."""

from dataclasses import dataclass, replace

import numpy as np

from incipient.arrays import Floats

SAME = 1e-7  # accelerations nearer than this, relative to the free one, are one solution


@dataclass(frozen=True, eq=False)
class Candidate:
    """An acceleration (6,) of the centre and about it, with local contact forces (k, 3) that go with it.

    `family`: accelerations arbitrarily near to it are solutions too.
    """

    acceleration: Floats
    local: Floats
    family: bool = False


def add(found: list[Candidate], candidate: Candidate, scale: float) -> None:
    """Append a candidate, or if its acceleration is there already note whether it belongs to a family."""
    for place, other in enumerate(found):
        if np.abs(candidate.acceleration - other.acceleration).max() <= SAME * scale:
            found[place] = replace(other, family=other.family or candidate.family)
            return
    found.append(candidate)
