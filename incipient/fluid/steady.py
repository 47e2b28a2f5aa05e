"""Steady flow by continuation in element order and Reynolds number."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from ..errors import ConvergenceError
from .flow import LOWEST_ORDER, Fluid, lowered
from .newton import NewtonReport

# Intermediate steps only improve the next initial guess.
TOLERANCE_ON_THE_WAY = 1e-2
ITERATIONS_ON_THE_WAY = 8
SMALLEST_STEP = 1e-3
# Reynolds number below which flow counts as Stokes flow, whose pressure scales as 1/Re.
STOKES = 1e-3
# Fraction of the Reynolds number above which a known solution is a better start than a second-order one: in the demo
# reynolds_sweep at Re 200 two iterations suffice from 0.97 (tests/end_to_end/test_critical_flow.py).
NEAR = 0.9
# Tolerance of the second-order flow of the two-level solver, whose loads estimate the error.
TOLERANCE_BELOW = 1e-7

Watch = Callable[[int, float, int, float], Any]


def solve_steady(
    fluid: Fluid,
    tolerance: float,
    max_iterations: int = 25,
    first_share: float = 1.0,
    watch: Watch = lambda order, share, iteration, size: None,
    reached: float = 0.0,
    smallest_step: float = SMALLEST_STEP,
) -> tuple[NewtonReport, ...]:
    """Solve steadily at the fluid's Reynolds number from its present state, reporting each step. Collective.

    Higher-order elements start from the second-order solution, which is approached from the fraction
    `first_share` of the Reynolds number; with `reached`, the fraction solved by the present state, from `NEAR` on
    they start directly. `watch` receives (order, fraction, iteration, size of the Newton update).

    Raises ConvergenceError; the fluid then holds the last converged state and its Reynolds number.
    """
    climb = partial(
        approach,
        max_iterations=max_iterations,
        first_share=first_share,
        watch=watch,
        reached=reached,
        smallest_step=smallest_step,
    )
    if fluid.space.order == LOWEST_ORDER:
        return climb(fluid, tolerance)
    alone = fluid.coarse is None
    if alone and (fluid.model.linear or reached >= NEAR):
        return climb(fluid, tolerance)
    with lowered(fluid) as coarse:
        try:
            reports = climb(coarse, TOLERANCE_ON_THE_WAY if alone else TOLERANCE_BELOW)
        except ConvergenceError:
            fluid.reynolds = coarse.reynolds
            raise
        finally:
            fluid.interpolate(coarse)
    last = climb(fluid, tolerance, first_share=1.0, reached=0.0, smallest_step=SMALLEST_STEP)
    return (*reports, *last)


def approach(
    fluid: Fluid,
    tolerance: float,
    max_iterations: int,
    first_share: float,
    watch: Watch,
    reached: float = 0.0,
    smallest_step: float = SMALLEST_STEP,
) -> tuple[NewtonReport, ...]:
    """Approach the fluid's Reynolds number in adaptive steps from a solution at the fraction `reached`. Collective.

    Raises ConvergenceError below `smallest_step`; the fluid holds the last converged state, or the start.
    """
    target, reports = fluid.reynolds, []
    known = fluid.state.x.array.copy()
    stride = share = 1.0 if reached else min(first_share, 1.0)
    while True:
        last = share >= 1.0
        fluid.reynolds = target * share
        if 0.0 < target * reached < STOKES:
            fluid.state.x.array[fluid.space.pressure_map] *= reached / share
        try:
            report = fluid.solve(
                tolerance if last else TOLERANCE_ON_THE_WAY,
                max_iterations if last else ITERATIONS_ON_THE_WAY,
                partial(watch, fluid.space.order, share),
            )
        except ConvergenceError:
            _restore(fluid, known, target, reached)
            raise
        reports.append(report)
        if report.converged and last:
            return tuple(reports)
        if report.converged:
            known = fluid.state.x.array.copy()
            # Fast convergence allows larger steps.
            growth = float(np.clip(3.0 * 4 / max(report.iterations, 1), 1.5, 4.0))
            reached, stride = share, stride * growth
        else:
            _restore(fluid, known, target, reached)
            if report.failure and not report.corrections and not reached:
                raise ConvergenceError(report.failure)
            stride = 0.5 * (share - reached)
            if stride < smallest_step:
                raise ConvergenceError(
                    f"no steady flow beyond {100 * reached:.3g}% of the Reynolds number, {_how(report, share)}: "
                    "it may be unsteady (add a [time] section) or need a finer mesh (smaller numerics.mesh_size)"
                )
        share = min(1.0, reached + stride)


def _restore(fluid: Fluid, values: np.ndarray, target: float, share: float) -> None:
    fluid.state.x.array[:] = values
    # At the start, without a Reynolds number, zero would make the stress infinite.
    fluid.reynolds = target * (share or 1.0)


def _how(report: NewtonReport, share: float) -> str:
    number, at = report.iterations, f"at {100 * share:.3g}%"
    if report.failure:
        return f"{at} the linear system of Newton update {number + 1} is not solved"
    return f"{at} Newton update {number} is still {report.corrections[-1]:.2g} of the flow"
