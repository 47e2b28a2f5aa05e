"""Where a body's step in a flow can be solved: exact coupling beside the naive iteration, point by point."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from hard import Naive, in_cavity, ride

RATIOS = (0.0, 1e-6, 1e-3, 1e-1, 1.0, 1e1, 1e2, 1e3, 1e6)
# What goes upwards in each panel; the others keep these values.
PANELS: dict[str, tuple[float, ...]] = {
    "step": (1e-4, 1e-3, 1e-2, 1e-1, 1.0),
    "reynolds": (0.1, 1.0, 10.0, 100.0, 1000.0),
    "gap": (1e-4, 1e-3, 1e-2, 1e-1, 1.0),
}
USUAL = {"step": 0.05, "reynolds": 10.0}
STEPS = 3
# The naive iteration gets many more than the exact one, whose limit is that of every run.
ITERATIONS = {True: 12, False: 40}


@dataclass(frozen=True)
class Point:
    """A point of the map: most corrections in a step, None where a step does not converge."""

    panel: str
    exact: bool
    ratio: float
    value: float
    corrections: int | None


def points(
    ratios: tuple[float, ...] = RATIOS, panels: dict[str, tuple[float, ...]] = PANELS
) -> Iterator[Point]:
    """All points, one ride of three steps each; steps are not shortened."""
    for panel, values in panels.items():
        for value in values:
            for ratio in ratios:
                for exact in (True, False):
                    yield Point(panel, exact, ratio, value, corrections(panel, value, ratio, exact))


def corrections(panel: str, value: float, ratio: float, exact: bool) -> int | None:
    """Most corrections in the first steps of a disc in the cavity whose lid is set off at once."""
    asked: dict[str, Any] = USUAL | {panel: value}
    with in_cavity(
        ratio, reynolds=asked["reynolds"], gap=asked.get("gap"), cell=0.1, far=0.2
    ) as found:
        if not exact:
            found.part.__class__ = Naive
        found.coupling.max_iterations = ITERATIONS[exact]
        with np.errstate(all="ignore"):
            told = ride(found, asked["step"], STEPS, once=True)
    return told.corrections if told.completed else None
