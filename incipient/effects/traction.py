"""The traction of the fluid on a grain."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from ..planning.effects import Decision, EffectName
from ..planning.flow_setup import Setup
from ..planning.numbers import Numbers
from ..results.quantity import OutputQuantity, at
from .effect import Effect
from .run_part import Solving

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


def _viscous(unit: str, run: Solving) -> Any:
    """The viscous part (3,) of a computed load, None without a grain. Collective."""
    if run.probe is None:
        return None
    found = run.probe.viscous_resultant()
    return found.force if unit == "force" else found.couple


def _pressure(unit: str, stored: Mapping[str, Any]) -> Any:
    """The rest of the surface integral, None without a grain."""
    whole, viscous = (at(stored, f"{unit}.{part}") for part in ("surface_integral", "viscous"))
    return None if whole is None else whole - viscous


def _parts(unit: str) -> Iterator[OutputQuantity]:
    """The pressure and the viscous part of a computed load: no correction is known of either."""
    for part in ("pressure", "viscous"):
        yield OutputQuantity(
            f"{unit}.{part}",
            f"{part} part of the {'' if unit == 'force' else 'torque as a '}surface integral, not corrected",
            unit,
            column=f"{part}_{unit}",
            heading=unit,
            line=f"{part} part",
            short="" if unit == "force" else "torque",
            detail=True,
            measure=partial(_viscous, unit) if part == "viscous" else None,
            derive=partial(_pressure, unit) if part == "pressure" else None,
        )


class TractionEffect(Effect):
    """Force and torque of the fluid on the grain."""

    name = EffectName.TRACTION
    quantities = (
        *(_load(unit, part) for part in _PARTS for unit in ("force", "torque")),
        *_parts("force"),
        *_parts("torque"),
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
