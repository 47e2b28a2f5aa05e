"""Steady flow at a Reynolds number reached by steps that steer themselves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import ConvergenceError
from .flow import Fluid
from .newton import NewtonReport

# A step on the way is only a better start for the next one.
TOLERANCE_ON_THE_WAY = 1e-2
ITERATIONS_ON_THE_WAY = 8
SMALLEST_STEP = 1e-3


@dataclass(frozen=True)
class Step:
    """One solve of the continuation: the share of the Reynolds number, and how Newton's method went."""

    share: float
    report: NewtonReport


def solve_steady(
    fluid: Fluid,
    tolerance: float,
    max_iterations: int = 25,
    first_share: float = 1.0,
    watch: Callable[[float, int, float], Any] = lambda share, iteration, size: None,
) -> tuple[Step, ...]:
    """Solve steadily at the fluid's Reynolds number, approaching it from `first_share` of it. Collective.

    The step grows while Newton's method converges and halves when it does not; each start is
    extrapolated linearly from the two solutions before. `watch` is told (share, iteration, size).

    Raises:
        ConvergenceError: the step became smaller than a thousandth; the fluid then holds the last
            converged state, at the Reynolds number it belongs to.
    """
    target, steps = fluid.reynolds, []
    path = _Path(fluid)
    share, reached, stride = min(first_share, 1.0), 0.0, first_share
    while True:
        last = share >= 1.0
        fluid.reynolds = target * share
        path.extrapolate(share)
        report = fluid.solve(
            tolerance if last else TOLERANCE_ON_THE_WAY,
            max_iterations if last else ITERATIONS_ON_THE_WAY,
            lambda iteration, size, share=share: watch(share, iteration, size),
        )
        steps.append(Step(share, report))
        if report.converged:
            path.accept(share)
            if last:
                return tuple(steps)
            reached, stride = share, stride * _growth(report)
        else:
            path.restore()
            stride = 0.5 * (share - reached)
            if stride < SMALLEST_STEP:
                fluid.reynolds = target * reached
                raise ConvergenceError(_explanation(reached, target))
        share = min(1.0, reached + stride)


def _growth(report: NewtonReport) -> float:
    """Steps grow more where Newton's method found its way quickly."""
    return float(np.clip(3.0 * 4 / max(report.iterations, 1), 1.5, 4.0))


def _explanation(reached: float, target: float) -> str:
    return (
        f"no steady flow found beyond {100 * reached:.3g}% of the Reynolds number: it may be unsteady "
        "(add a [time] section) or need a finer mesh (smaller numerics.mesh_size)"
    )


class _Path:
    """The last two converged states along the continuation."""

    def __init__(self, fluid: Fluid):
        self.fluid = fluid
        self.states: list[tuple[float, np.ndarray]] = [(0.0, fluid.state.x.array.copy())]

    def accept(self, share: float) -> None:
        self.states = [*self.states[-1:], (share, self.fluid.state.x.array.copy())]

    def restore(self) -> None:
        self.fluid.state.x.array[:] = self.states[-1][1]

    def extrapolate(self, share: float) -> None:
        """Secant through the two last states, in the logarithm of the Reynolds number."""
        if len(self.states) < 2 or self.states[0][0] == 0.0:
            return
        (before, old), (now, new) = self.states
        slope = np.log(share / now) / np.log(now / before)
        self.fluid.state.x.array[:] = new + min(slope, 1.0) * (new - old)
