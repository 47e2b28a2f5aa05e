"""Inertia of the fluid: convection of momentum, without which the flow is that of Stokes.

Its expected influence on the drag is Oseen's correction, 3/16 Re, with the Reynolds number of diameter and speed
(Proudman & Pearson 1957, J. Fluid Mech. 2, 237). A grain away from walls feels inertia as far as the next wall: the
flow of Stokes decays as slowly as the distance grows (Oseen 1910), in the plane even more slowly. For a sphere that
touches a wall in shear G, lift over drag is 0.287 G a^2/nu (Leighton & Acrivos 1985, ZAMP 36, 174), that is 0.07 Re
with the speed at its top: Oseen's is the larger.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from ..planning.boundary_layer import is_convected
from ..planning.effects import SHARE, Decision, EffectName, accuracy_asked, percent
from ..planning.flow_setup import Setup
from ..planning.numbers import Numbers
from ..planning.plan import Plan
from ..results.left_out import Omission
from ..results.quantity import OutputQuantity
from .effect import Effect, Solved
from .run_part import Solving

if TYPE_CHECKING:
    from ..fluid import FlowModel

OSEEN = 3.0 / 16.0


def _largest_of_cells(run: Solving) -> float:
    from ..fluid.cell_reynolds import measured_cell_reynolds

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
        """Present where Oseen's correction exceeds a share of the accuracy asked for."""
        scene = setup.scene
        if not scene.fluid.inertia or scene.effects.inertia is False:
            key = "fluid.inertia" if not scene.fluid.inertia else "effects.inertia"
            return Decision(
                self.name, False, f"{key} = false", True, expected(scene.flow.kind, numbers)
            )
        told = f"Re = {scene.fluid.reynolds:g} on {scene.fluid.scale} scale"
        if scene.effects.inertia is True:
            return Decision(self.name, True, f"effects.inertia = true; {told}", True)
        if scene.has_surface:
            return Decision(self.name, True, f"the free surface moves the fluid; {told}")
        if scene.flow.kind == "still" and not scene.moves:
            return Decision(self.name, False, "the fluid is at rest", expected=0.0)
        change = expected(scene.flow.kind, numbers)
        which = "flow Re" if numbers.grain_reynolds is None else "grain Re"
        value = numbers.flow_reynolds if numbers.grain_reynolds is None else numbers.grain_reynolds
        if change > SHARE * accuracy_asked(scene.numerics):
            return Decision(self.name, True, told, expected=change)
        reason = f"{which} {value:.2g}; estimated effect on drag {percent(change)}"
        return Decision(self.name, False, reason, expected=change)

    def terms(self, model: FlowModel, setup: Setup, plan: Plan, unsteady: bool) -> FlowModel:
        """Convection, stabilised where cells need it; the steady start of a flow in time is upwinded for its solver."""
        start = plan.has(EffectName.UNSTEADINESS) and not unsteady
        upwind = plan.stabilisation.upwind or (start and plan.solver.name == "block")
        stabilised = plan.stabilisation.present and not upwind
        convected = (
            unsteady
            and plan.numbers is not None
            and is_convected(setup, plan.numbers.grain_reynolds)
        )
        return replace(
            model, inertia=True, stabilisation=stabilised, upwind=upwind, convected=convected
        )

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


def expected(kind: str, numbers: Numbers) -> float:
    """Relative change of the drag that convection makes in a kind of flow, by Oseen's term; at most one."""
    found = [OSEEN * (numbers.bed_reynolds or 0.0)]
    if kind in ("lid", "expression"):  # not parallel: inertia bends the flow itself
        found.append(OSEEN * numbers.flow_reynolds)
    if numbers.grain_reynolds is not None:
        found.append(OSEEN * numbers.grain_reynolds * max(1.0, numbers.reach))
    elif kind != "still":
        found.append(OSEEN * numbers.flow_reynolds)
    return min(max(found), 1.0)
