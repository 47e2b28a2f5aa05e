"""Numbers to compare with, each with its source."""

from __future__ import annotations

from collections.abc import Mapping

from tables import ROOT, Row, read_rows

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


def ghia(reynolds: float) -> list[Row]:
    """Rows `line` (u on x = 0.5 or v on y = 0.5), `position`, `value` of Ghia, Ghia & Shin (1982).

    Without the ends (where the value is given) and the one known to be a slip of the print.
    """
    slip = "v", 400.0, 0.9063
    return [
        row
        for row in read_rows(ROOT / "benchmarks/reference/cavity_ghia_1982.csv")
        if row["re"] == reynolds
        and 0.0 < row["position"] < 1.0
        and (row["line"], row["re"], row["position"]) != slip
    ]


def errors(numbers: Mapping[str, float], reference: Mapping[str, float]) -> dict[str, float]:
    """Relative errors."""
    return {name: abs(numbers[name] / value - 1) for name, value in reference.items()}
