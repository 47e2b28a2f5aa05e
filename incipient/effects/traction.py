"""The traction of the fluid on a grain."""

from __future__ import annotations

from dataclasses import replace

from ..planning.effects import Decision, EffectName
from ..planning.flow_setup import Setup
from ..planning.numbers import Numbers
from ..results.quantity import OutputQuantity
from .effect import Effect

# What force and torque have parts of in results, with their names on a page.
_PARTS = {
    "flow": "flow, without buoyancy",
    "computed": "flow as computed, without corrections",
    "surface_integral": "flow as a surface integral, a check",
    "buoyancy": "buoyancy",
    "weight": "weight",
    "total": "total",
}


def _load(unit: str, part: str) -> OutputQuantity:
    words = _PARTS[part] if unit == "force" else f"torque of the {_PARTS[part]}"
    load = OutputQuantity(f"{unit}.{part}", words, unit, heading=unit)
    short = "" if unit == "force" else "torque"
    if part == "flow":
        short += " about the centre of mass" if short else ""
        error, line = f"error_bars.{unit}", "force of the flow"
        return replace(load, column=unit, error=error, line=line, short=short)
    if part == "computed":
        return replace(load, line="as computed", short=short, unlike=f"{unit}.flow")
    return load


class TractionEffect(Effect):
    """Force and torque of the fluid on the grain."""

    name = EffectName.TRACTION
    quantities = (
        *(_load(unit, part) for part in _PARTS for unit in ("force", "torque")),
        *(
            OutputQuantity(
                f"coefficients.{name}",
                name,
                column=name,
                heading="other numbers",
                line="coefficients",
            )
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
