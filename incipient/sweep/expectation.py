"""Expected time, by the laws of studies, and memory, by their meshes, of cases before they are computed."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

from ..errors import IncipientError
from ..installed import free_bytes, memory_of_libraries
from ..meshes.expected import expected_cells
from ..planning import meshing
from ..planning.flow_setup import Setup
from .cases import SweepCase

SHARE = 0.8  # of the memory that is free
OF_JUDGE = 150.0  # MiB of a process that judges, measured
BESIDE_THE_MESH = {"title", "output", "gravity", "fluid", "effects"}  # no mesh depends on these


@dataclass(frozen=True)
class Expected:
    """Processor time [s] and memory [MiB] of a case; None where they are not known."""

    seconds: float | None = None
    memory_mib: float | None = None


class Foresight:
    """Forecasts of cases, which use those of cases before them.

    One case of those with the same forms is predicted by making its mesh; the others by how many more cells than that
    one's are expected of theirs.
    """

    def __init__(self) -> None:
        self._first: dict[str, tuple[Expected, float | None]] = {}
        self._cells: dict[str, float | None] = {}

    def of(self, cases: Sequence[SweepCase]) -> dict[str, Expected]:
        """Expected time and memory of cases, by identity. Not collective."""
        return {case.identity: self._expected(case) for case in cases}

    def _expected(self, case: SweepCase) -> Expected:
        if case.scene is None:
            return Expected(None, OF_JUDGE)
        drawn = str(case.scene.model_dump(mode="json", exclude=BESIDE_THE_MESH))
        if drawn not in self._cells:
            self._cells[drawn] = _cells(Setup(case.scene))
        if case.forms not in self._first:
            self._first[case.forms] = (_predicted(case), self._cells[drawn])
        known, of_known = self._first[case.forms]
        return _scaled(known, of_known, self._cells[drawn])


def _cells(setup: Setup) -> float | None:
    """Expected number of cells of the mesh."""
    from ..effects.plan import plan_of

    with suppress(IncipientError, ImportError, OSError):
        layout = meshing.lay_out(setup, plan_of(setup))
        return sum(expected_cells(layout.shape, layout.sizes).values())
    return None


def _predicted(case: SweepCase) -> Expected:
    from ..adaptive.first_mesh import planned

    assert case.scene is not None
    try:
        estimate = planned(case.scene).estimate
    except IncipientError:  # the case itself will say what is wrong
        return Expected()
    return Expected(None, None if estimate is None else estimate.memory_mib)


def _scaled(known: Expected, of_known: float | None, cells: float | None) -> Expected:
    ratio = cells / of_known if cells and of_known else 1.0
    seconds, memory, least = known.seconds, known.memory_mib, memory_of_libraries()
    memory = None if memory is None else least + max(memory - least, 0.0) * ratio
    return Expected(None if seconds is None else seconds * ratio, memory)


def free_memory_mib() -> float:
    """The share of this machine's, or this container's, free memory that a sweep may take."""
    return SHARE * free_bytes() / 2**20


def cores() -> int:
    """How many cores this process may use."""
    return len(my_cores())


def my_cores() -> frozenset[int]:
    """The cores that this process may use, by the numbers of the system."""
    if hasattr(os, "sched_getaffinity"):
        return frozenset(os.sched_getaffinity(0))
    return frozenset(range(os.cpu_count() or 1))


def total(expected: Mapping[str, Expected]) -> float | None:
    """Processor time [s] of cases together; None where that of one is not known."""
    times = [one.seconds for one in expected.values()]
    return None if None in times else sum(time for time in times if time is not None)
