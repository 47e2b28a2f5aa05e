"""The effects of a run."""

from __future__ import annotations

from dataclasses import replace

from ..planning.effects import EffectName, accuracy_asked
from ..planning.plan import Plan
from ..results.left_out import Omission
from ..results.of_runs import FLOW, LOADS, VERDICT
from ..results.quantity import OutputQuantity
from . import flow, free_surface, grain, moving_grain, turbulence
from .effect import Effect, Solved

# In the order of plans, results, and solution of the parts of a run.
EFFECTS: tuple[Effect, ...] = (
    Effect(
        EffectName.INERTIA,
        (flow.CELL_REYNOLDS,),
        flow.add_convection,
        left_out=flow.without_inertia,
    ),
    Effect(
        EffectName.UNSTEADINESS, terms=flow.add_rate_of_change, left_out=flow.without_unsteadiness
    ),
    Effect(EffectName.TRACTION, LOADS),
    Effect(EffectName.GRAVITY, left_out=grain.without_gravity),
    Effect(EffectName.CONTACT, VERDICT, left_out=grain.without_contact),
    Effect(EffectName.FLOW, FLOW, flow.add_base_flow),
    Effect(EffectName.MOVING_MESH, terms=flow.add_mesh_motion),
    Effect(
        EffectName.FREE_BODY,
        moving_grain.QUANTITIES,
        part_in_time=moving_grain.moving_grain,
        left_out=moving_grain.without_motion,
    ),
    Effect(
        EffectName.FREE_SURFACE,
        part_in_time=free_surface.moving_surface,
        left_out=free_surface.without_free_surface,
    ),
    Effect(EffectName.TURBULENCE, turbulence.QUANTITIES, left_out=turbulence.without_turbulence),
)


def quantities(plan: Plan | None = None) -> tuple[OutputQuantity, ...]:
    """Output quantities of the effects in a plan, or of all effects."""
    present = (effect for effect in EFFECTS if plan is None or plan.has(effect.name))
    return tuple(one for effect in present for one in effect.quantities)


def omissions(solved: Solved) -> tuple[Omission, ...]:
    """Omitted effects that the scene has, with their estimated changes. Collective."""
    plan, accuracy = solved.run.plan, accuracy_asked(solved.run.scene.numerics)
    decided = {decision.name: decision for decision in plan.effects if not decision.present}
    return tuple(
        replace(one, exceeds=one.exceeds if one.relative is None else one.relative > accuracy)
        for effect in EFFECTS
        if effect.name in decided
        for one in effect.left_out(solved, decided[effect.name])
    )
