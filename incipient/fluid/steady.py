"""Steady flow: higher-order elements from second-order ones, large Reynolds numbers from smaller ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ..errors import ConvergenceError
from .flow import LOWEST_ORDER, Fluid, lowered
from .newton import NewtonReport

# A step on the way is only a better start for the next one.
TOLERANCE_ON_THE_WAY = 1e-2
ITERATIONS_ON_THE_WAY = 8
SMALLEST_STEP = 1e-3
# Reynolds number below which a flow is as good as Stokes flow, whose pressure goes as 1/Re.
STOKES = 1e-3
# Fraction of the Reynolds number from which on a known solution is a better start than a second-order one: in the demo
# reynolds_sweep at Re 200 two iterations lead from 0.97, none from order two (tests/end_to_end/test_critical_flow.py).
NEAR = 0.9
# The same for the second-order flow below a flow of two levels, whose loads estimate the error.
TOLERANCE_BELOW = 1e-7

Watch = Callable[[float, int, float], Any]


@dataclass(frozen=True)
class Step:
    """One solve: order of the velocity, fraction of the Reynolds number, report of Newton's method."""

    order: int
    share: float
    report: NewtonReport


def solve_steady(
    fluid: Fluid,
    tolerance: float,
    max_iterations: int = 25,
    first_share: float = 1.0,
    watch: Watch = lambda share, iteration, size: None,
    reached: float = 0.0,
    smallest_step: float = SMALLEST_STEP,
) -> tuple[Step, ...]:
    """Solve steadily at the fluid's Reynolds number from its present state. Collective.

    Higher-order elements start from the solution in second-order elements on the same mesh, which costs less. Without
    such a solution, and for second order, the Reynolds number is approached from `first_share` of it. From a solution
    that is `NEAR` higher-order elements start directly: at large Reynolds numbers the second-order flow may be farther
    away, and is then the fallback. Flows of two levels always start from second order. `watch` is called with
    (fraction, iteration, size of the Newton update).

    Args:
        reached: fraction of the Reynolds number that the present state is the solution of; 0: of none.
        smallest_step: fraction of the Reynolds number below which a step is no longer halved.

    Raises:
        ConvergenceError: the fluid then holds the last converged state, at the Reynolds number it belongs to.
    """
    climb = partial(
        approach,
        max_iterations=max_iterations,
        first_share=first_share,
        watch=watch,
        reached=reached,
        smallest_step=smallest_step,
    )
    if fluid.space.order == LOWEST_ORDER or (fluid.model.linear and fluid.coarse is None):
        return climb(fluid, tolerance)
    if reached < NEAR or fluid.coarse is not None:
        return _from_order_two(fluid, tolerance, climb)
    before, target = fluid.state.x.array.copy(), fluid.reynolds
    try:
        return climb(fluid, tolerance)
    except ConvergenceError:
        fluid.state.x.array[:], fluid.reynolds = before, target
        return _from_order_two(fluid, tolerance, climb)


def _from_order_two(
    fluid: Fluid, tolerance: float, climb: Callable[..., tuple[Step, ...]]
) -> tuple[Step, ...]:
    """Solve in higher-order elements from the second-order solution; `climb` is `approach`. Collective."""
    before = fluid.state.x.array.copy()
    on_the_way = TOLERANCE_ON_THE_WAY if fluid.coarse is None else TOLERANCE_BELOW
    with lowered(fluid) as coarse:
        try:
            steps = climb(coarse, on_the_way)
        except ConvergenceError:
            if fluid.coarse is not None:
                fluid.interpolate(coarse)
                fluid.reynolds = coarse.reynolds
                raise
            # A mesh too coarse for second order may suffice for the requested order.
            fluid.state.x.array[:] = before
            return climb(fluid, tolerance)
        fluid.interpolate(coarse)
    return (
        *steps,
        *climb(fluid, tolerance, first_share=1.0, reached=0.0, smallest_step=SMALLEST_STEP),
    )


def approach(
    fluid: Fluid,
    tolerance: float,
    max_iterations: int,
    first_share: float,
    watch: Watch,
    reached: float = 0.0,
    smallest_step: float = SMALLEST_STEP,
) -> tuple[Step, ...]:
    """Approach the fluid's Reynolds number in adaptive steps. Collective.

    The step grows while Newton's method converges and halves when it does not; each start is extrapolated from the two
    solutions before. From the solution at a fraction `reached` the full Reynolds number is tried first.

    Raises:
        ConvergenceError: the step became smaller than `smallest_step`, the first linear system was not solved, or the
            memory is too small for a factorisation; the fluid then holds the last converged state at its Reynolds
            number, or the start if there is none.
    """
    target, steps = fluid.reynolds, []
    path = _Path(fluid, reached)
    stride = share = 1.0 if reached else min(first_share, 1.0)
    while True:
        last = share >= 1.0
        fluid.reynolds = target * share
        path.extrapolate(share)
        try:
            report = fluid.solve(
                tolerance if last else TOLERANCE_ON_THE_WAY,
                max_iterations if last else ITERATIONS_ON_THE_WAY,
                partial(watch, share),
            )
        except ConvergenceError:
            path.restore()
            raise
        steps.append(Step(fluid.space.order, share, report))
        if report.converged:
            path.accept(share)
            if last:
                return tuple(steps)
            # Steps grow faster where Newton's method converged quickly.
            growth = float(np.clip(3.0 * 4 / max(report.iterations, 1), 1.5, 4.0))
            reached, stride = share, stride * growth
        else:
            path.restore()
            if report.failure and not report.corrections and not reached:
                raise ConvergenceError(report.failure)
            stride = 0.5 * (share - reached)
            if stride < smallest_step:
                raise ConvergenceError(
                    f"no steady flow beyond {100 * reached:.3g}% of the Reynolds number, {_how(report, share)}: "
                    "it may be unsteady (add a [time] section) or need a finer mesh (smaller numerics.mesh_size)"
                )
        share = min(1.0, reached + stride)


def _how(report: NewtonReport, share: float) -> str:
    """The failure of Newton's method at a fraction of the Reynolds number."""
    number, at = report.iterations, f"at {100 * share:.3g}%"
    if report.failure:
        return f"{at} the linear system of correction {number + 1} is not solved"
    return f"{at} correction {number} is still {report.corrections[-1]:.2g} of the flow"


class _Path:
    """The last two converged states along the continuation."""

    def __init__(self, fluid: Fluid, reached: float):
        self.fluid, self.target = fluid, fluid.reynolds
        self.states: list[tuple[float, np.ndarray]] = [(reached, fluid.state.x.array.copy())]

    def accept(self, share: float) -> None:
        """Keep the state at this fraction of the Reynolds number, and the one before it."""
        self.states = [*self.states[-1:], (share, self.fluid.state.x.array.copy())]

    def restore(self) -> None:
        """Put back the last converged state, or the start, and the Reynolds number it belongs to."""
        share, values = self.states[-1]
        self.fluid.state.x.array[:] = values
        # The start belongs to no Reynolds number; zero would make the stress infinite.
        self.fluid.reynolds = self.target * (share or 1.0)

    def extrapolate(self, share: float) -> None:
        """Secant through the two last states, in the logarithm of the Reynolds number."""
        if len(self.states) < 2:
            self._scale_pressure(share)
            return
        if self.states[0][0] == 0.0:
            return
        (before, old), (now, new) = self.states
        slope = np.log(share / now) / np.log(now / before)
        self.fluid.state.x.array[:] = new + min(slope, 1.0) * (new - old)

    def _scale_pressure(self, share: float) -> None:
        """Start from Stokes flow with its pressure at a fraction of the Reynolds number."""
        ((reached, start),) = self.states
        if 0.0 < self.target * reached < STOKES:
            pressures = self.fluid.space.pressure_map
            self.fluid.state.x.array[pressures] = reached / share * start[pressures]
