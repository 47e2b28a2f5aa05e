"""The traction of the fluid on a grain."""

from __future__ import annotations

from ..planning.effects import Decision, EffectName
from ..planning.flow_setup import Setup
from ..planning.numbers import Numbers
from ..results.quantity import OutputQuantity
from .effect import Effect


class TractionEffect(Effect):
    """Force and torque of the fluid on the grain."""

    name = EffectName.TRACTION
    quantities = (
        OutputQuantity("force.flow", "force of the flow", column="force", error="error_bars.force"),
        OutputQuantity(
            "couple.flow", "torque of the flow", column="couple", error="error_bars.couple"
        ),
        *(
            OutputQuantity(f"coefficients.{name}", name, column=name, heading="other numbers")
            for name in ("drag", "lift", "moment")
        ),
        *(
            OutputQuantity(f"coefficients.{name}", name.replace("_", " "), heading="other numbers")
            for name in ("reference_velocity", "reference_length")
        ),
        OutputQuantity("grain.size", "size of the grain", heading="other numbers"),
    )

    def decide(self, setup: Setup, numbers: Numbers) -> Decision:
        """Present with a grain."""
        there = setup.scene.body is not None
        return Decision(
            self.name, there, "of the fluid on the grain" if there else "no [body] section"
        )
