"""Cost of a run: wall time and memory by stage and by effect.

Stages nest. Time counts for the innermost stage and for its effect, unless transferred to another effect
(`incipient.results.cost_of_effects`).
"""

import resource
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from ..planning.effects import EffectName

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
        """Add the block's wall time to the stage, without that of nested stages. Not collective."""
        self._settle()
        self._open.append([name, EFFECT_OF_STAGE.get(name, name)])
        try:
            yield
        finally:
            self._settle()
            self._open.pop()

    def lap(self, effect: str) -> Share:
        """Cost of an effect since its last lap. Not collective."""
        self._settle()
        now, before = self.effects.get(effect, Share()), self._laps.get(effect, Share())
        self._laps[effect] = Share(now.wall_time, now.memory_mib)
        return Share(now.wall_time - before.wall_time, now.memory_mib - before.memory_mib)

    def transfer(self, source: str, target: str, share: Share) -> None:
        """Transfer a cost to another effect. Not collective."""
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
        """Add the time since the last call to the innermost open stage."""
        now, peak = time.perf_counter(), peak_memory_mib()
        if self._open:
            name, effect = self._open[-1]
            self.wall_time[name] = self.wall_time.get(name, 0.0) + now - self._since
            share = self.effects.setdefault(effect, Share())
            share.wall_time += now - self._since
            share.memory_mib += peak - self._peak
        self._since, self._peak = now, peak

    def total(self) -> float:
        """Seconds since the start of the clock."""
        return time.perf_counter() - self.began

    def count(self, wall_time: dict[str, float], total: float) -> None:
        """Add the times of an earlier session, by stage and in total; stages count for their default effects."""
        for name, taken in wall_time.items():
            self.wall_time[name] = self.wall_time.get(name, 0.0) + taken
            effect = EFFECT_OF_STAGE.get(name, name)
            self.effects.setdefault(effect, Share()).wall_time += taken
        self.began -= total

    def to_dict(self) -> dict[str, Any]:
        """Wall times by stage, and the total."""
        self._settle()
        return {**self.wall_time, "total": self.total()}

    def by_effect(self, unknowns: dict[str, int]) -> dict[str, dict[str, Any]]:
        """Wall time, growth of memory and unknowns of each effect with a cost."""
        self._settle()
        return {
            name: {**asdict(share), "unknowns": unknowns.get(name, 0)}
            for name, share in self.effects.items()
        }


def peak_memory_mib() -> float:
    """Peak resident memory of this process [MiB].

    /proc is preferred: the value of `getrusage` includes the memory of the parent process.
    """
    # Called several times a step: parsing the whole table takes five times as long.
    with suppress(OSError, IndexError), Path("/proc/self/status").open("rb", buffering=0) as status:
        _, _, peak = status.read(4096).partition(b"VmHWM:")
        return int(peak.split(maxsplit=1)[0]) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
