"""The traction of the fluid on a grain."""

from __future__ import annotations

from ..planning.effects import Decision, EffectName
from ..planning.flow_setup import Setup
from ..planning.numbers import Numbers
from ..results.of_runs import LOADS
from .effect import Effect


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
