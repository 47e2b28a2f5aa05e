"""Default tolerances of the algebraic equations of a steady flow."""

from typing import Literal

# Tolerance of steady iterations without an error estimate: the error after Newton's method is then far less.
STEADY = 1e-6
# The same where each Newton update is inexact, and the discretisation error of the loads is far larger.
BY_TWO_LEVELS = 1e-5

# Likewise of a flow with its turbulence: limiters of the k-omega model switch at single nodes.
TURBULENT = 1e-4
# Tolerance of logarithms over that of the flow, in 3-D: in the wake of a sphere on a level bed at u* d/nu = 86 they
# change by 1e-4 in the root mean square for ever, the flow by 2e-5. With changes of 4e-4 its loads changed by 2e-5 of
# them.
IN_WAKES = 10.0


def of_steady(asked: float | Literal["auto"], two_levels: bool = False) -> float:
    """The tolerance of a steady flow, from `numerics.tolerance`; by two levels it may be larger. Not collective."""
    if asked != "auto":
        return asked
    return BY_TWO_LEVELS if two_levels else STEADY


def of_turbulent(asked: float | Literal["auto"], in_space: bool) -> tuple[float, float]:
    """Tolerances of a steady turbulent flow and of its logarithms, from `numerics.tolerance`. Not collective."""
    tolerance = TURBULENT if asked == "auto" else asked
    return tolerance, (IN_WAKES if in_space else 1.0) * tolerance
