"""What a run costs: wall time by stage, iterations, unknowns, memory."""

from __future__ import annotations

import resource
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any


@dataclass
class Ledger:
    """Wall times of named stages in seconds, in the order in which they first ran."""

    wall_time: dict[str, float] = field(default_factory=dict)
    began: float = field(default_factory=time.perf_counter)
    _open: list[float] = field(default_factory=list)  # for each open stage, the time its inner stages took

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the block's wall time to the stage, less that of stages within it. Not collective."""
        start = time.perf_counter()
        self._open.append(0.0)
        try:
            yield
        finally:
            taken = time.perf_counter() - start
            self.wall_time[name] = self.wall_time.get(name, 0.0) + taken - self._open.pop()
            if self._open:
                self._open[-1] += taken

    def total(self) -> float:
        """Seconds since the ledger was opened."""
        return time.perf_counter() - self.began

    def count(self, wall_time: dict[str, float], total: float) -> None:
        """Count what an earlier session has taken as well: by stage, and in all."""
        for name, taken in wall_time.items():
            self.wall_time[name] = self.wall_time.get(name, 0.0) + taken
        self.began -= total

    def to_dict(self) -> dict[str, Any]:
        """Wall times by stage, and the total."""
        return {**self.wall_time, "total": self.total()}


def peak_memory_mib() -> float:
    """Largest resident memory of this process so far, in MiB (Linux counts it in KiB)."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
