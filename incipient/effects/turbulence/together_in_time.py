"""The flow in time and its turbulence, solved together within a step by Newton's method."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np

from ... import compat
from ...errors import ConvergenceError
from ...fluid import Fluid
from ...fluid.newton import Contraction, NewtonReport, solve_by_chords
from .coupled_flow import CoupledFlow, bound
from .fields import LARGEST_CORRECTION, TurbulenceFields
from .iteration import InTime, relative_change

# In a step, in the first one from rest over forms, and of these how many are made whole however large they are.
MOST_CORRECTIONS, MOST_FROM_REST, WHOLE_FROM_REST = 20, 40, 5
# Size of corrections that is small enough also where a flow hardly changes; of the tolerance, what counts as none; and
# the weight of logarithms beside it: at a few nodes they go to and fro for ever, as in steps of pseudo-time.
FINEST, NONE, OF_LOGARITHMS = 1e-6, 0.3, 0.01
# Size of a correction, over the last one, from which on only half of it is made: where a limiter takes turns between
# two states they would else go to and fro for ever.
SLOW = 0.7
# Corrections, or first ones of the step before, beyond which the derivative is no longer that of the state, and beyond
# which both are corrected by turns: set off from rest a channel has no step else.
FAR, NEAR = 0.3, 0.05
LOST = 20.0  # correction from which there is no way back
FARTHEST = 0.1  # change of the flow in a step up to which its end is guessed by the states before
PATIENCE = 5  # corrections of a step after which the derivative that is kept is too old


class InTimeTogether(InTime):
    """Turbulence in time as one system with its flow, in space, where nothing moves. Every method is collective.

    Both take the same backward difference. The derivative is assembled, and factors of it are made, only when
    corrections with those of an earlier step shrink too slowly. A step that is not found so, as the first one from
    rest past a sphere amid the flow, is sought by turns, the flow each time for given turbulence.

    Args:
        finest: what the tolerance of a step is not below.
        from_rest: whether the step is the first one, set off from rest over forms of a bed. Its corrections are found
            as one system from the start, and after some only half of each is made while they are large: limiters at
            nodes between the forms take turns.

    Attributes:
        last: size of the last correction.
    """

    def __init__(
        self,
        fluid: Fluid,
        turbulence: TurbulenceFields,
        stage: Callable[[], AbstractContextManager[Any]] = nullcontext,
        finest: float = 0.0,
        from_rest: bool = False,
    ):
        super().__init__(fluid, turbulence, stage)
        self._system: CoupledFlow | None = (
            None  # made at the first step: the steady start has one of its own
        )
        self._aged, self._contraction = True, Contraction()
        # Sizes of the first correction of the step before, of the last one, and of the first; infinite: there is none.
        self._first = self.last = self._begun = float("inf")
        self._from_rest, self._made = from_rest, 0
        self._finest = self._tolerance = finest

    def attempt(self, length: float, order: int, tolerance: float) -> NewtonReport:
        """Solve for the end of a step from the last state, the fluid's state included; by turns if need be."""
        report = self.together(length, order, tolerance)
        if report.converged:
            return report
        self._fluid.state.x.array[:] = self._fluid.history[0].x.array
        self.turbulence.state.x.array[:] = self.past[0]
        return super().attempt(length, order, max(tolerance, self._finest))

    def together(self, length: float, order: int, tolerance: float) -> NewtonReport:
        """Solve for the end of a step as one system."""
        fluid, turbulence = self._fluid, self.turbulence
        rate = [float(a.value) for a in fluid.rate]
        before = fluid.history[0].x.array
        if relative_change(fluid, fluid.state.x.array - before) > FARTHEST:
            fluid.state.x.array[:] = before
        elif order == 2:
            turbulence.state.x.array[:] -= (rate[1] * length + 1.0) * (self.past[0] - self.past[1])
        self.last, self._tolerance = np.inf, max(tolerance, self._finest)
        known = self._contraction if self._first <= NEAR else None
        with self._stage():
            self._system = self._system or CoupledFlow(fluid, turbulence, in_time=True)
            fluid.constraints.update(fluid.time)
            compat.impose(fluid.state.x.array, fluid.constraints.dirichlet)
            turbulence.impose()
            turbulence.discretise_time(rate, (self.past[0], self.past[-1]))
            most = MOST_FROM_REST if self._from_rest else MOST_CORRECTIONS
            report = solve_by_chords(self, *(self._tolerance, most, fluid.watch, self._aged, known))
        self._first = self._begun if report.converged else np.inf
        turbulence.look()
        self._contraction = report.contraction
        self._failed = not report.converged
        self._aged = self._failed or report.iterations > PATIENCE
        return report

    def chord_correction(self, fresh: bool) -> float:
        """One correction of both; its size relative to the flow, or that of logarithms by their weight if larger."""
        fluid, turbulence = self._fluid, self.turbulence
        assert self._system is not None
        try:
            known = min(self._first, self.last)
            by_turns = known > NEAR and not self._from_rest
            of_flow, of_logarithms = self._system.next_correction(
                fresh or known > FAR, by_turns=by_turns
            )
        except ConvergenceError:
            return float("inf")
        bound(fluid, of_flow)
        of_both = relative_change(fluid, of_flow), turbulence.of_most(of_logarithms)
        if (size := max(of_both)) < LOST:
            self._made += 1
            halved = self._from_rest and self._made > WHOLE_FROM_REST and size > NEAR
            part = 0.5 if halved or size >= SLOW * self.last else 1.0
            if not np.isfinite(self.last):
                self._begun = size
            self._first, self.last = np.inf, size
            bounded = np.clip(of_logarithms, -LARGEST_CORRECTION, LARGEST_CORRECTION)
            self._system.carry_out(part * of_flow, part * bounded)
        found = max(of_both[0], OF_LOGARITHMS * of_both[1]) if size < LOST else np.inf
        return found if found > NONE * self._tolerance else 0.0

    def forget(self) -> None:
        """Drop what earlier steps have taught about the iteration, and factors."""
        self._aged, self._contraction, self._first = True, Contraction(), np.inf
        if self._system is not None:
            self._system.renew_factors()

    def complaint(self) -> str:
        """Why the last attempt failed, and a remedy."""
        return f"flow, {self.turbulence.names} do not converge: use a smaller time.step"

    def destroy(self) -> None:
        """Free PETSc's memory."""
        if self._system is not None:
            self._system.destroy()


class SetOffTogether(InTime):
    """Turbulence in time, by turns with its flow and what moves in it, whose first step begins as one system.

    Set off from rest over forms of a bed neither flow nor turbulence of the first step is found for the other one as it
    was. Both are found as one system while all stands still, and turns with what moves begin from there. Every method
    is collective.
    """

    def attempt(self, length: float, order: int, tolerance: float) -> NewtonReport:
        """Solve for the end of a step from the last state, the fluid's state included."""
        if len(self.past) > 1:
            return super().attempt(length, order, tolerance)
        fluid, turbulence = self._fluid, self.turbulence
        standing = InTimeTogether(fluid, turbulence, self._stage, FINEST, from_rest=True)
        near = standing.together(length, order, tolerance).converged or standing.last < NEAR
        if not near:
            fluid.state.x.array[:], turbulence.state.x.array[:] = (
                fluid.history[0].x.array,
                self.past[0],
            )
        standing.destroy()
        return super().attempt(length, order, tolerance)

    def complaint(self) -> str:
        """Why the last attempt failed, and a remedy."""
        said = super().complaint()
        return (
            said
            if len(self.past) > 1
            else f'{said}; from rest over bed forms use time.start = "steady"'
        )
