"""Cost by effect: Newton updates, time steps, unknowns.

A steady linear flow needs one Newton update, a time step two (the second confirms the reused LU factorisation). Further
updates, and the continuation in Reynolds number and order, count for inertia; time steps after the first count for
unsteadiness.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from ..planning.effects import EffectName
from ..planning.plan import Plan
from .timing import Ledger, Share

if TYPE_CHECKING:
    from ..fluid.steady import Step

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
        """Record the Newton updates of the block. Not collective."""
        self._ledger.lap(EffectName.FLOW)
        self._laps = []
        yield

    def record(self, iteration: int, size: float = 0.0) -> None:
        """Record a Newton update by its number in the solve, from zero."""
        self._laps.append((iteration, self._ledger.lap(EffectName.FLOW)))

    def watched_by(
        self, watch: Callable[[float, int, float], Any]
    ) -> Callable[[float, int, float], None]:
        """A callback for the updates of a steady solve that also calls `watch`."""

        def record_and_pass_on(share: float, iteration: int, size: float) -> None:
            """Record the update, then call `watch`."""
            self.record(iteration, size)
            watch(share, iteration, size)

        return record_and_pass_on

    def book_steady(self, steps: Sequence[Step]) -> None:
        """Attribute the updates of a steady solve: the first one at the last order belongs to the flow."""
        before = sum(step.report.iterations for step in steps if step.order != steps[-1].order)
        laps, self._laps = self._laps, []
        for number, (_, share) in enumerate(laps):
            if number != before and self._inertia:
                self._ledger.transfer(EffectName.FLOW, EffectName.INERTIA, share)

    def book_step(self, number: int) -> None:
        """Attribute the updates of a time step by its number, from one."""
        laps, self._laps = [*self._laps, (0, self._ledger.lap(EffectName.FLOW))], []
        for iteration, share in laps:
            if self._inertia and iteration >= LINEAR_CORRECTIONS:
                self._ledger.transfer(EffectName.FLOW, EffectName.INERTIA, share)
            elif self._unsteadiness and number > 1:
                self._ledger.transfer(EffectName.FLOW, EffectName.UNSTEADINESS, share)


def cost_lines(effects: dict[str, dict[str, Any]]) -> list[str]:
    """Cost of each effect as text, the costliest first; shares below a thousandth are omitted."""
    total = sum(share["wall_time"] for share in effects.values()) or 1.0
    dearest = sorted(effects.items(), key=lambda item: -item[1]["wall_time"])
    return [
        f"{'' if row else 'cost by effect':<20}{name:<14}{share['wall_time']:8.2f} s "
        f"{100 * share['wall_time'] / total:5.1f}% {share['memory_mib']:7.0f} MiB {share['unknowns']:>8} unknowns"
        for row, (name, share) in enumerate(dearest)
        if share["wall_time"] >= 1e-3 * total
    ]
