"""What the effects left out would have changed, estimated from the flow that was computed."""

from __future__ import annotations

from dataclasses import replace

from ..planning.effects import accuracy_asked
from ..results.left_out import Omission
from . import known
from .effect import Solved


def omissions(solved: Solved) -> tuple[Omission, ...]:
    """The effects of the plan that were left out though the scene has them, and what they would change. Collective."""
    plan, accuracy = solved.run.plan, accuracy_asked(solved.run.scene.numerics)
    decided = {decision.name: decision for decision in plan.effects if not decision.present}
    return tuple(
        replace(one, exceeds=one.exceeds if one.relative is None else one.relative > accuracy)
        for effect in known.EFFECTS
        if effect.name in decided
        for one in effect.left_out(solved, decided[effect.name])
    )
