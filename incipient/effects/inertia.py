"""Inertia of the fluid: convection of momentum, without which the flow is that of Stokes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from ..planning.effects import Decision, EffectName
from ..planning.flow_setup import Setup
from ..planning.numbers import Numbers
from ..planning.plan import Plan
from ..results.left_out import Omission
from ..results.quantity import OutputQuantity
from .effect import Effect, Solved
from .run_part import Solving

if TYPE_CHECKING:
    from ..fluid import FlowModel


def _largest_of_cells(run: Solving) -> float:
    from ..fluid.derived import measured_cell_reynolds

    return measured_cell_reynolds(run.fluid)


class InertiaEffect(Effect):
    """Convection of momentum."""

    name = EffectName.INERTIA
    quantities = (
        OutputQuantity(
            "measured_cell_reynolds",
            "largest Reynolds number of a cell",
            heading="other numbers",
            measure=_largest_of_cells,
        ),
    )

    def decide(self, setup: Setup, numbers: Numbers) -> Decision:
        """Repeat the setup's decision, on which the elements depend."""
        return setup.inertia

    def terms(self, model: FlowModel, setup: Setup, plan: Plan, unsteady: bool) -> FlowModel:
        """Convection, stabilised where cells need it; the steady start of a flow in time is upwinded for its solver."""
        start = plan.has(EffectName.UNSTEADINESS) and not unsteady
        upwind = plan.stabilisation.upwind or (start and plan.solver.name == "block")
        stabilised = plan.stabilisation.present and not upwind
        return replace(model, inertia=True, stabilisation=stabilised, upwind=upwind)

    def left_out(self, solved: Solved, decision: Decision) -> Iterator[Omission]:
        """Convection weighted with the dual solutions; without error bars Oseen's term."""
        if decision.expected == 0.0:
            return
        remedy = "set fluid.inertia = true and effects.inertia = true"
        if not solved.run.scene.numerics.error_bars:
            how = "by Oseen's term, at most"
            yield Omission(self.name, decision.expected, how, False, remedy)
            return
        from ..forms.terms import convection
        from .missing_term import weighted

        where = solved.run.fluid.reference_map
        yield weighted(solved, self.name, lambda v, w: convection(v, v, w, where), remedy)
