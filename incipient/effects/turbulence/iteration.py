"""The flow and its turbulence, solved in turn until both stay: steadily, and within the steps of a flow in time."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from ...errors import ConvergenceError
from ...fluid import Fluid
from ...fluid.newton import NewtonReport
from ...fluid.transient import Interface
from .fields import TurbulenceFields

MOST_ROUNDS = 200
# Steps of pseudo-time: the first, over the time in which the flow passes its depth; factors; shortest over first.
FIRST_STEP, GROWTH, CUT, SHORTEST = 1.0, 1.6, 0.25, 1e-4
# Factor by which the eddy viscosity is raised where there is no flow to begin with, and how often at most.
THICKER, MOST_THICKENINGS = 4.0, 8
# Within a step of pseudo-time, and of corrections of the flow over what is left in the end.
STEP_TOLERANCE, SHARE_OF_FLOW = 1e-2, 1e-2
# Corrections of the first flow, and in a round: where they do not do, a larger eddy viscosity or a shorter step will.
MOST_OF_FIRST, MOST_OF_FLOW = 7, 12
MOST_TURNS = 15  # within a time step
NO_STEP = "the flow with the eddy viscosity as it is does not converge: use a smaller time.step or numerics.mesh_size"
NO_FLOW = (
    "the flow with the eddy viscosity as it is does not converge: use a smaller numerics.mesh_size"
)


@dataclass(frozen=True)
class Round:
    """One solution of the flow and one step of pseudo-time of its turbulence, and how much they changed.

    loads: on the grain after it, where they are asked for; spread: by how much the last ones differ, over their size,
    where a flow is taken that still changes
    """

    number: int
    step: float
    of_flow: float
    of_turbulence: float
    loads: tuple[float, ...] = ()
    spread: float = 0.0


def solve_steadily(
    fluid: Fluid,
    turbulence: TurbulenceFields,
    time: float,
    tolerance: float,
    watch: Callable[[Round], None] = lambda found: None,
    stage: Callable[[], AbstractContextManager[Any]] = nullcontext,
    shortest: float = SHORTEST,
) -> tuple[Round, ...]:
    """Find the steady flow with its turbulence from their present states. Collective.

    In turn the flow is solved with the eddy viscosity as it is, and the turbulence takes an implicit step of
    pseudo-time in that flow, which becomes longer while it succeeds. Where there is no flow to begin with, the eddy
    viscosity is raised; where there is none after a step, that step is repeated, shorter. `time` is that in which the
    flow passes its depth; within `stage` both quantities are solved; `shortest` is the shortest step over the first.

    Raises:
        ConvergenceError: the flow does not converge, or both quantities still change after 200 rounds.
    """
    rounds: list[Round] = []
    step, flow, logarithms = FIRST_STEP * time, fluid.state.x.array, turbulence.state.x.array
    moved, past = 1.0, _begin(fluid, turbulence)
    for number in range(1, MOST_ROUNDS + 1):
        with stage():
            size = turbulence.step((1 / step, -1 / step, 0.0), (past, past), STEP_TOLERANCE)
        change, past_flow = turbulence.largest(logarithms - past), flow.copy()
        # The flow is found no better than its eddy viscosity is known, and with a factorisation kept while it serves.
        enough = SHARE_OF_FLOW * max(tolerance, moved)
        turbulence.look()
        if (
            not np.isfinite(size)
            or not fluid.solve(enough, MOST_OF_FLOW, keep_factors=True).converged
        ):
            logarithms[:], flow[:] = past, past_flow
            step *= CUT
            if step < shortest * time:
                raise ConvergenceError(NO_FLOW)
            continue
        moved, past = relative_change(fluid, flow - past_flow), logarithms.copy()
        rounds.append(Round(number, step, moved, change))
        watch(rounds[-1])
        if max(change, moved) <= tolerance:
            return tuple(rounds)
        step *= GROWTH
    raise ConvergenceError(
        f"{turbulence.names} are not steady after {MOST_ROUNDS} rounds: use a smaller numerics.mesh_size, or add [time]"
    )


def _begin(fluid: Fluid, turbulence: TurbulenceFields) -> np.ndarray:
    """Find the flow with the eddy viscosity as it is, or a larger one, which pseudo-time undoes; the logarithms."""
    start = fluid.state.x.array.copy()
    for _ in range(MOST_THICKENINGS + 1):
        turbulence.look()
        if fluid.solve(SHARE_OF_FLOW, MOST_OF_FIRST).converged:
            return turbulence.state.x.array.copy()
        fluid.state.x.array[:] = start
        turbulence.raise_eddy_viscosity(THICKER)
    raise ConvergenceError(NO_FLOW)


def relative_change(fluid: Fluid, change: np.ndarray) -> float:
    """Size of a change of the flow (owned unknowns, or all local ones), relative to it. Collective."""
    whole = fluid.squared_velocities(fluid.state.x.array)
    return float(np.sqrt(fluid.squared_velocities(change) / whole)) if whole else 0.0


class Moving(Interface, Protocol):
    """What moves with the flow, solved together with it for given turbulence fields."""

    def again(
        self, length: float, order: int, tolerance: float, before: NewtonReport
    ) -> NewtonReport:
        """Solve for the end of the step again, from the end found with other fields and the report of that."""
        ...


class InTime:
    """Turbulence as what is solved together with a flow in time, see `fluid.transient.Interface`.

    Flow and turbulence take the same backward difference, in turn until the flow stays. What moves with the flow
    is solved together with it each time: turbulence fields answer to a motion far less than the pressure does.

    Args:
        moving: a grain, and the mesh with it; None: nothing moves.

    Attributes:
        past: states (local unknowns,) of both logarithms, the present one first.
    """

    def __init__(
        self,
        fluid: Fluid,
        turbulence: TurbulenceFields,
        stage: Callable[[], AbstractContextManager[Any]] = nullcontext,
        moving: Moving | None = None,
    ):
        self._fluid, self.turbulence, self._stage, self._moving = fluid, turbulence, stage, moving
        self.past = [turbulence.state.x.array.copy()]
        self._failed = False

    def attempt(self, length: float, order: int, tolerance: float) -> NewtonReport:
        """Solve for the end of a step from the last state, the fluid's state included."""
        fluid, turbulence = self._fluid, self.turbulence
        rate = [float(a.value) for a in fluid.rate]
        sizes: list[float] = []
        self._failed, report = False, None
        for _ in range(MOST_TURNS):
            before = fluid.state.x.array.copy()
            turbulence.look()
            report = self._flow(length, order, 0.1 * tolerance, report)
            if not report.converged:
                return report
            sizes.append(relative_change(fluid, fluid.state.x.array - before))
            if len(sizes) > 1 and sizes[-1] <= tolerance:
                return replace(report, corrections=tuple(sizes), error=sizes[-1])
            past = (self.past[0], self.past[-1])
            with self._stage():
                self._failed = not np.isfinite(turbulence.step(rate, past, tolerance, lasting=True))
            if self._failed:
                break
        self.forget()
        return NewtonReport(False, tuple(sizes), np.inf)

    def _flow(
        self, length: float, order: int, tolerance: float, before: NewtonReport | None
    ) -> NewtonReport:
        """The flow, with what moves in it, for given turbulence fields; `before` is the report with earlier ones."""
        if self._moving is None:
            return self._fluid.solve(tolerance)
        if before is None:
            report = self._moving.attempt(length, order, tolerance)
        else:
            report = self._moving.again(length, order, tolerance, before)
        self.turbulence.follow()
        return report

    def allowed(self, length: float) -> float:
        """The length, or the shorter one after which what moves meets something."""
        return length if self._moving is None else self._moving.allowed(length)

    def accept(self) -> None:
        """The attempt holds."""
        self.past = [self.turbulence.state.x.array.copy(), self.past[0]]
        if self._moving is not None:
            self._moving.accept()

    def restore(self) -> None:
        """Go back to the last state."""
        self.turbulence.state.x.array[:] = self.past[0]
        if self._moving is not None:
            self._moving.restore()
            self.turbulence.follow()

    def forget(self) -> None:
        """Drop what earlier steps have taught about the iteration, and factors."""
        self.turbulence.renew_factors()
        if self._moving is not None:
            self._moving.forget()

    def velocities(self) -> np.ndarray:
        """(n,) velocities of what moves."""
        return np.empty(0) if self._moving is None else self._moving.velocities()

    def complaint(self) -> str:
        """Why the last attempt failed, and a remedy."""
        if self._failed:
            return f"{self.turbulence.names} do not converge: use a smaller time.step"
        return (self._moving.complaint() if self._moving is not None else "") or NO_STEP
