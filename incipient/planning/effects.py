"""Names of the physical effects, the decisions of a plan, and the accuracy that decisions are based on."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from ..scene import Numerics

if TYPE_CHECKING:
    from .flow_setup import Setup
    from .numbers import Numbers

SHARE = 0.1  # of the requested accuracy that an omitted effect may use up
USUAL_ACCURACY = 0.01
OSEEN = 3.0 / 16.0


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
    """The relative accuracy that a scene requests, or the default."""
    return numerics.accuracy if isinstance(numerics.accuracy, float) else USUAL_ACCURACY


def percent(share: float) -> str:
    """0.00075 as 0.08%."""
    return f"{100 * share:.1g}%" if share < 0.1 else f"{100 * share:.0f}%"


def inertia_of(setup: Setup, numbers: Numbers) -> Decision:
    """Present where Oseen's correction exceeds a fraction of the requested accuracy. Not collective.

    Its expected influence on the drag is Oseen's correction, 3/16 Re, with the Reynolds number of diameter and speed
    (Proudman & Pearson 1957, J. Fluid Mech. 2, 237). A grain away from walls feels inertia as far as the next wall: the
    flow of Stokes decays as slowly as the distance grows (Oseen 1910), and even more slowly in 2-D. For a sphere that
    touches a wall in shear G, lift over drag is 0.287 G a^2/nu (Leighton & Acrivos 1985, ZAMP 36, 174), that is 0.07 Re
    with the speed at its top: Oseen's is the larger.
    """
    scene, name = setup.scene, EffectName.INERTIA
    if not scene.fluid.inertia or scene.effects.inertia is False:
        key = "fluid.inertia" if not scene.fluid.inertia else "effects.inertia"
        return Decision(name, False, f"{key} = false", True, expected(scene.flow.kind, numbers))
    reynolds_text = f"Re = {scene.fluid.reynolds:g} on {scene.fluid.scale} scale"
    if scene.effects.inertia is True:
        return Decision(name, True, f"effects.inertia = true; {reynolds_text}", True)
    if scene.has_surface:
        return Decision(name, True, f"the free surface moves the fluid; {reynolds_text}")
    if scene.flow.kind == "still" and not scene.moves:
        return Decision(name, False, "the fluid is at rest", expected=0.0)
    change = expected(scene.flow.kind, numbers)
    which = "flow Re" if numbers.grain_reynolds is None else "grain Re"
    value = numbers.flow_reynolds if numbers.grain_reynolds is None else numbers.grain_reynolds
    if change > SHARE * accuracy_asked(scene.numerics):
        return Decision(name, True, reynolds_text, expected=change)
    reason = f"{which} {value:.2g}; estimated effect on drag {percent(change)}"
    return Decision(name, False, reason, expected=change)


def expected(kind: str, numbers: Numbers) -> float:
    """Relative change of the drag that convection makes in a kind of flow, by Oseen's term; at most one."""
    estimates = [OSEEN * (numbers.bed_reynolds or 0.0)]
    if kind in ("lid", "expression"):  # not parallel: inertia changes the base flow
        estimates.append(OSEEN * numbers.flow_reynolds)
    if numbers.grain_reynolds is not None:
        estimates.append(OSEEN * numbers.grain_reynolds * max(1.0, numbers.reach))
    elif kind != "still":
        estimates.append(OSEEN * numbers.flow_reynolds)
    return min(max(estimates), 1.0)
