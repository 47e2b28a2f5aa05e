"""Effects on the grain: traction, gravity, and contact with the bed."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..arrays import spatial
from ..planning.effects import Decision, EffectName
from ..planning.flow_setup import Setup
from ..planning.numbers import Numbers
from ..results.left_out import Omission
from ..results.of_runs import LOADS, VERDICT
from ..scene.grains import FRICTIONLESS, LEVEL
from ..scene.model import WIDE_GAP
from ..scene.settling import DEFAULT_FRICTION
from .effect import Effect, Solved

NEARER = 0.95  # smallest initial gap of a released grain relative to its contact gap


class TractionEffect(Effect):
    """Force and torque of the fluid on the grain."""

    name = EffectName.TRACTION
    quantities = LOADS

    def decide(self, setup: Setup, numbers: Numbers) -> Decision:
        """Present with a grain."""
        there = setup.scene.body is not None
        return Decision(
            self.name, there, "of the fluid on the grain" if there else "no [body] section"
        )


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
        """Exact weight and buoyancy."""
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

    def decide(self, setup: Setup, numbers: Numbers) -> Decision:
        """Present where a grain rests on a bed."""
        scene = setup.scene
        if not scene.rests:
            return Decision(self.name, False, "no grain rests on a bed")
        if scene.effects.contact is False:
            return Decision(self.name, False, "effects.contact = false: no verdict", True)
        reason = "the grain rests on the bed"
        if scene.body is not None and scene.body.settle == FRICTIONLESS:
            reason += ", where it settled without friction"
        elif scene.body is not None and scene.body.settle:
            friction = DEFAULT_FRICTION if scene.contact is None else scene.contact.friction
            reason += f", where it settled with friction {friction:g}"
            if scene.body.settle == LEVEL:
                reason += " on the level bed"
            else:
                reason += ' (settle = "frictionless" gives one rest to compare)'
        return Decision(self.name, True, reason, scene.effects.contact is True)

    def warnings(self, setup: Setup) -> Iterator[str]:
        """A wide gap, and a released grain that starts within the contact gap."""
        scene = setup.scene
        gap = scene.contact.gap if scene.contact is not None and not scene.closes_contacts else 0.0
        if gap > WIDE_GAP and scene.body is not None and (scene.rests or scene.body.moves):
            yield (
                f"contact.gap = {gap:g} is wide: contact is judged by the flow around a grain {gap:g} of its size "
                f"away from the bed; give {WIDE_GAP:g} or less"
            )
        if scene.body is None or scene.body.motion != "released":
            return
        begins, kept = setup.geometry.stance.gap, gap * setup.geometry.grain.size
        if begins < NEARER * kept:
            yield (
                f"the grain begins {begins:.3g} from its bed, nearer than its gap of {kept:.3g}, which the first step "
                "puts right: it stands on one side alone; set body.settle = true"
            )

    def left_out(self, solved: Solved, decision: Decision) -> Iterator[Omission]:
        """The missing verdict."""
        if decision.forced:
            yield Omission(self.name, None, "there is no verdict without it", False)
