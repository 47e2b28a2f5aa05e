"""Gravity: weight and buoyancy of the grain, and the hydrostatic pressure."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..arrays import spatial
from ..planning.effects import Decision, EffectName
from ..planning.flow_setup import Setup
from ..planning.numbers import Numbers
from ..results.left_out import Omission
from .effect import Effect, Solved


class GravityEffect(Effect):
    """Weight and buoyancy."""

    name = EffectName.GRAVITY

    def decide(self, setup: Setup, numbers: Numbers) -> Decision:
        """Present with [gravity]."""
        scene = setup.scene
        if scene.gravity is None:
            return Decision(self.name, False, "no [gravity] section")
        if scene.effects.gravity is False:
            return Decision(self.name, False, "effects.gravity = false", True)
        reason = "weight and buoyancy of the grain; analytical hydrostatic pressure, no unknowns"
        if scene.has_surface:
            reason = "on the free surface; " + reason
        return Decision(self.name, True, reason, scene.effects.gravity is True)

    def left_out(self, solved: Solved, decision: Decision) -> Iterator[Omission]:
        """Weight and buoyancy, which need no estimate."""
        scene, force = solved.run.scene, solved.force
        if not decision.forced or scene.gravity is None or scene.grain is None or force is None:
            return
        excess = (scene.mass or 0.0) - scene.grain.volume
        change = excess * scene.gravity.acceleration * spatial(scene.gravity_direction)
        relative = float(np.linalg.norm(change)) / max(float(np.linalg.norm(force.flow)), 1e-300)
        how, remedy = "weight and buoyancy, exact", 'set effects.gravity = "auto"'
        yield Omission(self.name, relative, how, False, remedy, change, np.zeros(3))
