"""Numbers to compare with, each with its source."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

GHIA = Path(__file__).parent / "reference" / "cavity_ghia_1982.csv"

# Schaefer & Turek (1996), benchmark 2D-1, in the digits of Nabh (1998).
CYLINDER = {"drag": 5.57953523384, "lift": 0.010618948146}

# Botella & Peyret (1998), Computers & Fluids 27, 421: Chebyshev collocation, Re = 1000.
CAVITY = {"minimum of v1": -0.3885698, "maximum of v2": 0.3769447, "minimum of v2": -0.5270771}
CAVITY_PLACES = {"minimum of v1": 0.1717, "maximum of v2": 0.1578, "minimum of v2": 0.9092}

# Schaefer & Turek (1996), benchmark 2D-2: intervals.
VORTEX_STREET = {"drag": (3.22, 3.24), "lift": (0.99, 1.01), "strouhal": (0.295, 0.305)}

# John (2004), Int. J. Numer. Methods Fluids 44, 777, benchmark 2D-3.
PULSATING = {
    "drag": 2.950921575,
    "drag at": 3.93625,
    "lift": 0.47795,
    "lift at": 5.693125,
    "pressure": -0.1116,
}


@dataclass(frozen=True)
class Point:
    """A value of Ghia, Ghia & Shin (1982); `line` is u on x = 0.5 or v on y = 0.5."""

    line: str
    reynolds: float
    position: float
    value: float


def ghia() -> list[Point]:
    """All points but the ends (where the value is given) and the one known to be a slip of the print."""
    lines = [line for line in GHIA.read_text().splitlines() if not line.startswith("#")]
    points = [
        Point(row["line"], float(row["re"]), float(row["position"]), float(row["value"]))
        for row in csv.DictReader(lines)
    ]
    return [p for p in points if 0.0 < p.position < 1.0 and not _slip(p)]


def _slip(point: Point) -> bool:
    return (point.line, point.reynolds, point.position) == ("v", 400.0, 0.9063)


def errors(found: Mapping[str, float], reference: Mapping[str, float]) -> dict[str, float]:
    """Relative errors."""
    return {name: abs(found[name] / value - 1) for name, value in reference.items()}
