"""How well the algebraic equations of a steady flow are solved, where the scene leaves it open."""

from typing import Literal

# What steady iterations may leave where nothing is known of the error: Newton's method then has left far less.
STEADY = 1e-6
# Likewise where each of Newton's corrections is a rough one, and loads err far more by the cells.
BY_TWO_LEVELS = 1e-5

# Likewise of a flow with its turbulence: limiters of the k-omega model switch at single nodes.
TURBULENT = 1e-4


def of_steady(asked: float | Literal["auto"], two_levels: bool = False) -> float:
    """The tolerance of a steady flow, from `numerics.tolerance`; by two levels it may be larger. Not collective."""
    if asked != "auto":
        return asked
    return BY_TWO_LEVELS if two_levels else STEADY


def of_turbulent(asked: float | Literal["auto"]) -> float:
    """The tolerance of a steady turbulent flow and of its logarithms, from `numerics.tolerance`. Not collective."""
    return TURBULENT if asked == "auto" else asked
