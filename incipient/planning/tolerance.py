"""Default tolerances of the algebraic equations of a steady flow."""

from typing import Literal

# Tolerance of steady iterations without an error estimate: the error after Newton's method is then far less.
STEADY = 1e-6
# The same where each Newton update is inexact, and the discretisation error of the loads is far larger.
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
