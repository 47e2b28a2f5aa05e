"""A flow that is steady at every moment: it follows what drives it at once, without a rate of change."""

from __future__ import annotations

from .newton import NewtonReport
from .transient import Transient


class QuasiSteady(Transient):
    """Advances a steady fluid whose boundary values change in time. All methods are collective.

    As `Transient`, for a fluid built with `FlowModel(unsteady=False)`: each step is steady, started from that
    of the step before. There is no error in time, and so no adaptive step.
    """

    def _attempt(self, length: float) -> NewtonReport:
        self.fluid.time = self._past[0].time + length
        return self.fluid.solve(self._tolerance(), keep_factors=True)

    def _error(self, length: float) -> float | None:
        return None
