"""Results in SI units for a reader, of scenes that say what their units are."""

from typing import Any

from .loads import couple_words, force_words

# Numbers of a flow, with their units and names for a reader.
FLOW = {
    "shear_rate": ("1/s", "shear rate"),
    "velocity": ("m/s", "velocity"),
    "bed_stress": ("Pa", "stress on the bed"),
    "shear_velocity": ("m/s", "shear velocity"),
}


def si_lines(found: dict[str, Any] | None) -> list[str]:
    """The lines of a result in SI units, as `evaluation.si_units.in_si` gives them; none without."""
    if found is None:
        return []
    flow = [f"{name} {found[key]:.4g} {unit}" for key, (unit, name) in FLOW.items() if key in found]
    head = f"nominal diameter {found['nominal_diameter']:.4g} m"
    lines = [f"{'in SI units':<20}{', '.join([head, *flow])}"]
    if "force" in found:
        gdim = found["dimension"]
        force, couple = (
            force_words(found["force"], gdim, ".4g"),
            couple_words(found["couple"], gdim, ".4g"),
        )
        units = ("N/m", "N") if gdim == 2 else ("N", "N m")
        lines.append(f"{'':<20}force of the flow {force} {units[0]}, couple {couple} {units[1]}")
    if "end" in found:
        unit = found["units"]["time"]
        lines.append(f"{'':<20}ends after {found['end']:.4g} s; one unit of time is {unit:.4g} s")
    return lines
