"""Cost of a run: wall time and memory by stage and effect, Newton updates by effect.

Stages nest; time counts for the innermost stage and its effect. A steady linear flow needs one Newton update, a time
step two (the second confirms the reused LU factorisation): further updates and the continuation count for inertia,
time steps after the first for unsteadiness.
"""

from __future__ import annotations

import resource
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..planning.plan import Plan
from .quantity import labelled

if TYPE_CHECKING:
    from ..fluid.steady import Watch

# The default effect of each stage.
EFFECT_OF_STAGE: dict[str, str] = {
    "plan": "program",
    "import": "program",
    "mesh": "flow",
    "forms": "flow",
    "flow": "flow",
    "tractions": "traction",
    "contact": "contact",
    "mesh motion": "moving mesh",
    "remeshing": "moving mesh",
    "interface": "free body",
    "free surface": "free surface",
    "fields": "output",
    "checkpoint": "output",
    "error bars": "estimates",
    "omitted effects": "estimates",
}


@dataclass
class Share:
    """Cost of an effect: wall time [s], and growth of the process's peak memory [MiB]."""

    wall_time: float = 0.0
    memory_mib: float = 0.0


@dataclass
class Ledger:
    """Wall times of named stages [s], in the order of their first run, and costs of effects."""

    wall_time: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    effects: dict[str, Share] = field(default_factory=lambda: defaultdict(Share))
    began: float = field(default_factory=time.perf_counter)
    # Names and effects of stages, the innermost last.
    _open: list[tuple[str, str]] = field(default_factory=list)
    _since: float = 0.0
    _peak: float = field(default_factory=lambda: peak_memory_mib())

    @contextmanager
    def stage(self, name: str, effect: str = "") -> Iterator[None]:
        self.charge()
        self._open.append((name, effect or EFFECT_OF_STAGE.get(name, name)))
        try:
            yield
        finally:
            self.charge()
            self._open.pop()

    def charge(self, effect: str = "") -> None:
        """Book on an effect (default: that of the open stage) what the stage has cost since the last booking."""
        now, peak = time.perf_counter(), peak_memory_mib()
        if self._open:
            name, usual = self._open[-1]
            self.wall_time[name] += now - self._since
            share = self.effects[effect or usual]
            share.wall_time += now - self._since
            share.memory_mib += peak - self._peak
        self._since, self._peak = now, peak

    def total(self) -> float:
        return time.perf_counter() - self.began

    def count(self, wall_time: dict[str, float], total: float) -> None:
        for name, taken in wall_time.items():
            self.wall_time[name] += taken
            self.effects[EFFECT_OF_STAGE.get(name, name)].wall_time += taken
        self.began -= total

    def to_dict(self) -> dict[str, Any]:
        self.charge()
        return {**self.wall_time, "total": self.total()}

    def by_effect(self, unknowns: dict[str, int]) -> dict[str, dict[str, Any]]:
        self.charge()
        return {
            name: {**asdict(share), "unknowns": unknowns.get(name, 0)}
            for name, share in self.effects.items()
        }


def peak_memory_mib() -> float:
    """Peak resident memory of this process [MiB].

    /proc is preferred: `getrusage` includes the memory of the parent process.
    """
    # Called several times a step: parsing the whole table takes five times as long.
    with suppress(OSError, IndexError), Path("/proc/self/status").open("rb", buffering=0) as status:
        _, _, peak = status.read(4096).partition(b"VmHWM:")
        return int(peak.split(maxsplit=1)[0]) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


class Corrections:
    """Books Newton updates within the stage "flow" on effects."""

    def __init__(self, ledger: Ledger, plan: Plan):
        self._ledger, self._plan = ledger, plan
        self._steps = 0

    def of_steady(self, watch: Callable[[float, int, float], Any]) -> Watch:
        """Watch a steady solve: its first update at the order of the plan belongs to the flow."""
        first = True

        def record(order: int, share: float, iteration: int, size: float) -> None:
            nonlocal first
            linear = first and order == self._plan.order
            first = first and not linear
            self._ledger.charge("flow" if linear or not self._plan.has("inertia") else "inertia")
            watch(share, iteration, size)

        return record

    def effect_of_step(self) -> str:
        """Effect of the next time step: the flow or, after the first step, unsteadiness."""
        self._steps += 1
        return "unsteadiness" if self._steps > 1 and self._plan.has("unsteadiness") else "flow"

    def record(self, iteration: int, size: float = 0.0) -> None:
        further = iteration >= 2 and self._plan.has("inertia")  # a linear step needs two
        self._ledger.charge("inertia" if further else "")


def cost_lines(effects: dict[str, dict[str, Any]]) -> list[str]:
    """Cost of each effect as text, the costliest first; fractions below a thousandth are omitted."""
    total = sum(share["wall_time"] for share in effects.values()) or 1.0
    dearest = sorted(effects.items(), key=lambda item: -item[1]["wall_time"])
    return labelled(
        "cost by effect",
        *(
            f"{name:<14}{share['wall_time']:8.2f} s {100 * share['wall_time'] / total:5.1f}% "
            f"{share['memory_mib']:7.0f} MiB {share['unknowns']:>8} unknowns"
            for name, share in dearest
            if share["wall_time"] >= 1e-3 * total
        ),
    )
