"""The names of the physical effects, what a plan decides on each, and the accuracy that decisions go by."""

from dataclasses import dataclass
from enum import StrEnum

from ..scene import Numerics

SHARE = 0.1  # of the accuracy asked for that an effect left out by the plan may use up
USUAL_ACCURACY = 0.01


class EffectName(StrEnum):
    """The physical effects that the program knows, by the names that plan and result show."""

    INERTIA = "inertia"
    UNSTEADINESS = "unsteadiness"
    TRACTION = "traction"
    GRAVITY = "gravity"
    CONTACT = "contact"
    FLOW = "flow"
    MOVING_MESH = "moving mesh"
    FREE_BODY = "free body"
    FREE_SURFACE = "free surface"
    TURBULENCE = "turbulence"
    THIRD_DIMENSION = "third dimension"


@dataclass(frozen=True)
class Decision:
    """Whether one physical effect is simulated, and the reason."""

    name: EffectName
    present: bool
    reason: str
    forced: bool = False  # the scene says so, not the plan
    # Relative change of the drag that the effect makes, by its leading term; None: no estimate
    expected: float | None = None


def accuracy_asked(numerics: Numerics) -> float:
    """The relative accuracy that a scene asks for, or what is usual."""
    return numerics.accuracy if isinstance(numerics.accuracy, float) else USUAL_ACCURACY


def percent(share: float) -> str:
    """0.00075 as 0.08%."""
    return f"{100 * share:.1g}%" if share < 0.1 else f"{100 * share:.0f}%"
