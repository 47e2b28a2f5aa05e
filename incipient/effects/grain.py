"""Effects on the grain: gravity, and contact with the bed."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..arrays import spatial
from ..planning.effects import Decision, EffectName
from ..results.left_out import Omission
from ..results.of_runs import VERDICT
from .effect import Effect, Solved


class GravityEffect(Effect):
    """Weight and buoyancy."""

    name = EffectName.GRAVITY

    def left_out(self, solved: Solved, decision: Decision) -> Iterator[Omission]:
        scene, force = solved.run.scene, solved.force
        if not decision.forced or scene.gravity is None or scene.grain is None or force is None:
            return
        excess = (scene.mass or 0.0) - scene.grain.volume
        change = excess * scene.gravity.acceleration * spatial(scene.gravity_direction)
        relative = float(np.linalg.norm(change)) / max(float(np.linalg.norm(force.flow)), 1e-300)
        how, remedy = "weight and buoyancy, exact", 'set effects.gravity = "auto"'
        yield Omission(self.name, relative, how, False, remedy, change, np.zeros(3))


class ContactEffect(Effect):
    """Contact forces between a resting grain and its bed, for both criteria."""

    name = EffectName.CONTACT
    quantities = VERDICT

    def left_out(self, solved: Solved, decision: Decision) -> Iterator[Omission]:
        if decision.forced:
            yield Omission(self.name, None, "without it there is no verdict", False)
