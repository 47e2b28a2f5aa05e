"""Time steps of a flow and its turbulence, iterated in turn until the flow stays."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from typing import Any

import numpy as np

from ..fluid import Fluid
from ..fluid.newton import NewtonReport
from ..fluid.transient import Interface, TimeStep
from .fields import TurbulenceFields

MOST_TURNS = 15  # within a time step
NO_STEP = "the flow with the eddy viscosity as it is does not converge: use a smaller time.step or numerics.mesh_size"


class InTime(Interface):
    """Turbulence as the interface of an unsteady flow, see `fluid.transient.Interface`.

    Flow and turbulence take the same backward difference. `past`: states (local unknowns,), newest first.
    """

    def __init__(
        self,
        fluid: Fluid,
        turbulence: TurbulenceFields,
        stage: Callable[[], AbstractContextManager[Any]] = nullcontext,
        moving: Interface | None = None,
    ):
        super().__init__(fluid)
        self.turbulence, self._stage = turbulence, stage
        self._moving, self._moves = moving or Interface(fluid), moving is not None
        self.past = [turbulence.state.x.array.copy()]

    def attempt(
        self, length: float, order: int, tolerance: float, before: NewtonReport | None = None
    ) -> NewtonReport:
        fluid, turbulence = self.fluid, self.turbulence
        rate = [float(a.value) for a in fluid.rate]
        sizes: list[float] = []
        report: NewtonReport | None = None
        failure = NO_STEP
        for _ in range(MOST_TURNS):
            state = fluid.state.x.array.copy()
            turbulence.look()
            report = self._moving.attempt(length, order, 0.1 * tolerance, report)
            self._follow()
            if not report.converged:
                return replace(report, failure=report.failure or NO_STEP)
            sizes.append(fluid.relative(fluid.state.x.array - state))
            if len(sizes) > 1 and sizes[-1] <= tolerance:
                return replace(report, corrections=tuple(sizes), error=sizes[-1])
            past = (self.past[0], self.past[-1])
            with self._stage():
                change = turbulence.step(rate, past, tolerance)
            if not np.isfinite(change):
                failure = f"{turbulence.names} do not converge: use a smaller time.step"
                break
        self.forget()
        return NewtonReport(False, tuple(sizes), np.inf, failure=failure)

    def _follow(self) -> None:
        if self._moves:
            self.turbulence.follow()

    def allowed(self, length: float) -> float:
        return self._moving.allowed(length)

    def accept(self, step: TimeStep) -> None:
        self.past = [self.turbulence.state.x.array.copy(), self.past[0]]
        self._moving.accept(step)

    def restore(self) -> None:
        self.turbulence.state.x.array[:] = self.past[0]
        self._moving.restore()
        self._follow()

    def forget(self) -> None:
        self.turbulence.renew_factors()
        self._moving.forget()

    def velocities(self) -> np.ndarray:
        return self._moving.velocities()
