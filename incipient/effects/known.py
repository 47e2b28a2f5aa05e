"""The effects of a run."""

from __future__ import annotations

from dataclasses import replace

from ..planning.effects import EffectName, accuracy_asked
from ..planning.plan import Plan
from ..results.left_out import Omission
from ..results.of_runs import LOADS
from ..results.quantity import OutputQuantity
from .effect import Effect, Solved
from .flow import (
    FlowEffect,
    InertiaEffect,
    MovingMeshEffect,
    UnsteadinessEffect,
)
from .free_surface import FreeSurfaceEffect
from .grain import ContactEffect, GravityEffect
from .moving_grain import FreeBodyEffect
from .turbulence import TurbulenceEffect

# In the order of plans, results, and solution of the parts of a run.
EFFECTS: tuple[Effect, ...] = (
    InertiaEffect(),
    UnsteadinessEffect(),
    Effect(EffectName.TRACTION, *LOADS),
    GravityEffect(),
    ContactEffect(),
    FlowEffect(),
    MovingMeshEffect(),
    FreeBodyEffect(),
    FreeSurfaceEffect(),
    TurbulenceEffect(),
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
