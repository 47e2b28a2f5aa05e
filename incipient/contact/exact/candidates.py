"""One solution of the problem of incipient motion in numbers of order one, before it is read as a motion."""

from dataclasses import dataclass, replace

import numpy as np

from incipient.arrays import Floats

SAME = 1e-7  # accelerations nearer than this, relative to the free one, are one solution


@dataclass(frozen=True, eq=False)
class Candidate:
    """An acceleration, with contact forces that go with it."""

    acceleration: Floats  # (6,) of the centre and about it
    local: Floats  # forces (k, 3)
    family: bool = False  # whether accelerations arbitrarily near to it are solutions too


def add(found: list[Candidate], candidate: Candidate, scale: float) -> None:
    """Append a candidate, or if its acceleration is there already note whether it belongs to a family."""
    for place, other in enumerate(found):
        if np.abs(candidate.acceleration - other.acceleration).max() <= SAME * scale:
            found[place] = replace(other, family=other.family or candidate.family)
            return
    found.append(candidate)
