"""Which effect the run's work was for: corrections of Newton's method, time steps, unknowns.

A linear flow needs one correction where it is steady, and two in a time step (the second shows that the factors kept
from earlier steps still hold). Corrections beyond those are inertia's, and so is the way to the Reynolds number and to
the order; time steps after the first are unsteadiness's. All are measured one by one.
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
    """Books corrections of Newton's method, within the stage "flow", on the effects they are for."""

    def __init__(self, ledger: Ledger, plan: Plan):
        self._ledger = ledger
        self._inertia, self._unsteadiness = (
            plan.has(EffectName.INERTIA),
            plan.has(EffectName.UNSTEADINESS),
        )
        self._laps: list[tuple[int, Share]] = []

    @contextmanager
    def begun(self) -> Iterator[None]:
        """Within the block corrections are booked; what has passed before is not theirs. Not collective."""
        self._ledger.lap(EffectName.FLOW)
        self._laps = []
        yield

    def record(self, iteration: int, size: float = 0.0) -> None:
        """The correction of this number in its solve, from zero, has been made."""
        self._laps.append((iteration, self._ledger.lap(EffectName.FLOW)))

    def watched_by(
        self, watch: Callable[[float, int, float], Any]
    ) -> Callable[[float, int, float], None]:
        """What to call after each correction of a steady solve, so that `watch` is called, too."""

        def record_and_pass_on(share: float, iteration: int, size: float) -> None:
            """Book the correction, then pass it on."""
            self.record(iteration, size)
            watch(share, iteration, size)

        return record_and_pass_on

    def book_steady(self, steps: Sequence[Step]) -> None:
        """A steady solve by these steps is over: its first correction at the last order is the flow's own."""
        before = sum(step.report.iterations for step in steps if step.order != steps[-1].order)
        laps, self._laps = self._laps, []
        for number, (_, share) in enumerate(laps):
            if number != before and self._inertia:
                self._ledger.transfer(EffectName.FLOW, EffectName.INERTIA, share)

    def book_step(self, number: int) -> None:
        """The time step of this number, from one, is over."""
        laps, self._laps = [*self._laps, (0, self._ledger.lap(EffectName.FLOW))], []
        for iteration, share in laps:
            if self._inertia and iteration >= LINEAR_CORRECTIONS:
                self._ledger.transfer(EffectName.FLOW, EffectName.INERTIA, share)
            elif self._unsteadiness and number > 1:
                self._ledger.transfer(EffectName.FLOW, EffectName.UNSTEADINESS, share)


def cost_lines(effects: dict[str, dict[str, Any]]) -> list[str]:
    """What each effect has cost, the dearest first, for a reader; what took less than a thousandth is left out."""
    total = sum(share["wall_time"] for share in effects.values()) or 1.0
    dearest = sorted(effects.items(), key=lambda item: -item[1]["wall_time"])
    return [
        f"{'' if row else 'cost by effect':<20}{name:<14}{share['wall_time']:8.2f} s "
        f"{100 * share['wall_time'] / total:5.1f}% {share['memory_mib']:7.0f} MiB {share['unknowns']:>8} unknowns"
        for row, (name, share) in enumerate(dearest)
        if share["wall_time"] >= 1e-3 * total
    ]
