"""The section of numbers in SI units, of scenes that say what their units are."""

from __future__ import annotations

from typing import Any

from ..results.si import FLOW
from .page import PageSection, Rows, section, table
from .verdict import components, turning

OF_SCENE = {"length": "m", "time": "s", "velocity": "m/s", "stress": "Pa"}


def of_si(found: dict[str, Any] | None) -> tuple[PageSection, ...]:
    """Flow and loads in SI units as `results.si` stores them, and what one of the scene's units is."""
    if found is None:
        return ()
    planar = found["dimension"] == 2
    rows: Rows = [("nominal diameter", found["nominal_diameter"], "m")]
    rows += [(name, found[key], unit) for key, (unit, name) in FLOW.items() if key in found]
    if "force" in found:
        rows.append(
            ("force of the flow", components(found["force"], planar), "N/m" if planar else "N")
        )
        rows.append(
            ("couple of the flow", turning(found["couple"], planar), "N" if planar else "N m")
        )
    if "end" in found:
        rows.append(("ends after", found["end"], "s"))
    rows += [
        (f"one unit of {name} of the scene", found["units"][name], unit)
        for name, unit in OF_SCENE.items()
    ]
    return section("In SI units", table(("", "value", "unit"), rows))
