"""The steps of a flow in time with its turbulence: both in turn until the flow stays."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from ..fluid import Fluid
from ..fluid.newton import NewtonReport
from ..fluid.transient import Interface
from .coupled_flow import relative_change
from .fields import TurbulenceFields

MOST_TURNS = 15  # within a time step
NO_STEP = "the flow with the eddy viscosity as it is does not converge: use a smaller time.step or numerics.mesh_size"


class Moving(Interface, Protocol):
    """What moves with the flow, solved together with it for given turbulence fields."""

    def again(
        self, length: float, order: int, tolerance: float, before: NewtonReport
    ) -> NewtonReport:
        """Solve for the end of the step again, from the end computed with other fields and its report."""
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
