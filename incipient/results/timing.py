"""Cost of a run: wall time and memory by stage and effect, Newton updates by effect.

Stages nest; time counts for the innermost stage and its effect. A steady linear flow needs one Newton update, a time
step two (the second confirms the reused LU factorisation): further updates and the continuation count for inertia,
time steps after the first for unsteadiness.
"""

from __future__ import annotations

import resource
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..planning.effects import EffectName
from ..planning.plan import Plan

if TYPE_CHECKING:
    from ..fluid.steady import Step

# The default effect of each stage.
EFFECT_OF_STAGE: dict[str, str] = {
    "plan": "program",
    "import": "program",
    "mesh": EffectName.FLOW,
    "forms": EffectName.FLOW,
    "flow": EffectName.FLOW,
    "tractions": EffectName.TRACTION,
    "contact": EffectName.CONTACT,
    "mesh motion": EffectName.MOVING_MESH,
    "remeshing": EffectName.MOVING_MESH,
    "interface": EffectName.FREE_BODY,
    "free surface": EffectName.FREE_SURFACE,
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

    wall_time: dict[str, float] = field(default_factory=dict)
    effects: dict[str, Share] = field(default_factory=dict)
    began: float = field(default_factory=time.perf_counter)
    _open: list[list[str]] = field(default_factory=list)  # stage and effect, the innermost last
    _laps: dict[str, Share] = field(default_factory=dict)
    _since: float = 0.0
    _peak: float = field(default_factory=lambda: peak_memory_mib())

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        self._settle()
        self._open.append([name, EFFECT_OF_STAGE.get(name, name)])
        try:
            yield
        finally:
            self._settle()
            self._open.pop()

    def lap(self, effect: str) -> Share:
        self._settle()
        now, before = self.effects.get(effect, Share()), self._laps.get(effect, Share())
        self._laps[effect] = Share(now.wall_time, now.memory_mib)
        return Share(now.wall_time - before.wall_time, now.memory_mib - before.memory_mib)

    def transfer(self, source: str, target: str, share: Share) -> None:
        for effect, sign in ((source, -1), (target, 1)):
            of_effect = self.effects.setdefault(effect, Share())
            of_effect.wall_time += sign * share.wall_time
            of_effect.memory_mib += sign * share.memory_mib
        mark = self._laps.get(source)
        if mark is not None:
            self._laps[source] = Share(
                mark.wall_time - share.wall_time, mark.memory_mib - share.memory_mib
            )

    def _settle(self) -> None:
        now, peak = time.perf_counter(), peak_memory_mib()
        if self._open:
            name, effect = self._open[-1]
            self.wall_time[name] = self.wall_time.get(name, 0.0) + now - self._since
            share = self.effects.setdefault(effect, Share())
            share.wall_time += now - self._since
            share.memory_mib += peak - self._peak
        self._since, self._peak = now, peak

    def total(self) -> float:
        return time.perf_counter() - self.began

    def count(self, wall_time: dict[str, float], total: float) -> None:
        for name, taken in wall_time.items():
            self.wall_time[name] = self.wall_time.get(name, 0.0) + taken
            effect = EFFECT_OF_STAGE.get(name, name)
            self.effects.setdefault(effect, Share()).wall_time += taken
        self.began -= total

    def to_dict(self) -> dict[str, Any]:
        self._settle()
        return {**self.wall_time, "total": self.total()}

    def by_effect(self, unknowns: dict[str, int]) -> dict[str, dict[str, Any]]:
        self._settle()
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


LINEAR_CORRECTIONS = 2  # of a time step


class Corrections:
    """Attributes Newton updates within the stage "flow" to effects."""

    def __init__(self, ledger: Ledger, plan: Plan):
        self._ledger = ledger
        self._inertia, self._unsteadiness = (
            plan.has(EffectName.INERTIA),
            plan.has(EffectName.UNSTEADINESS),
        )
        self._laps: list[tuple[int, Share]] = []

    @contextmanager
    def begun(self) -> Iterator[None]:
        self._ledger.lap(EffectName.FLOW)
        self._laps = []
        yield

    def record(self, iteration: int, size: float = 0.0) -> None:
        self._laps.append((iteration, self._ledger.lap(EffectName.FLOW)))

    def watched_by(
        self, watch: Callable[[float, int, float], Any]
    ) -> Callable[[float, int, float], None]:
        def record_and_pass_on(share: float, iteration: int, size: float) -> None:
            self.record(iteration, size)
            watch(share, iteration, size)

        return record_and_pass_on

    def book_steady(self, steps: Sequence[Step]) -> None:
        """Attribute the updates of a steady solve: the first at the last order belongs to the flow."""
        before = sum(step.report.iterations for step in steps if step.order != steps[-1].order)
        laps, self._laps = self._laps, []
        for number, (_, share) in enumerate(laps):
            if number != before and self._inertia:
                self._ledger.transfer(EffectName.FLOW, EffectName.INERTIA, share)

    def book_step(self, number: int) -> None:
        laps, self._laps = [*self._laps, (0, self._ledger.lap(EffectName.FLOW))], []
        for iteration, share in laps:
            if self._inertia and iteration >= LINEAR_CORRECTIONS:
                self._ledger.transfer(EffectName.FLOW, EffectName.INERTIA, share)
            elif self._unsteadiness and number > 1:
                self._ledger.transfer(EffectName.FLOW, EffectName.UNSTEADINESS, share)


def cost_lines(effects: dict[str, dict[str, Any]]) -> list[str]:
    """Cost of each effect as text, the costliest first; fractions below a thousandth are omitted."""
    total = sum(share["wall_time"] for share in effects.values()) or 1.0
    dearest = sorted(effects.items(), key=lambda item: -item[1]["wall_time"])
    return [
        f"{'' if row else 'cost by effect':<20}{name:<14}{share['wall_time']:8.2f} s "
        f"{100 * share['wall_time'] / total:5.1f}% {share['memory_mib']:7.0f} MiB {share['unknowns']:>8} unknowns"
        for row, (name, share) in enumerate(dearest)
        if share["wall_time"] >= 1e-3 * total
    ]
