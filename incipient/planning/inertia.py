"""Whether a scene's flow has inertia: convection of momentum, without which the flow is that of Stokes.

Its expected influence on the drag is Oseen's correction, 3/16 Re, with the Reynolds number of diameter and speed
(Proudman & Pearson 1957, J. Fluid Mech. 2, 237). A grain away from walls feels inertia as far as the next wall: the
flow of Stokes decays as slowly as the distance grows (Oseen 1910), in 2-D even more slowly. For a sphere that
touches a wall in shear G, lift over drag is 0.287 G a^2/nu (Leighton & Acrivos 1985, ZAMP 36, 174), that is 0.07 Re
with the speed at its top: Oseen's is the larger.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from .effects import SHARE, Decision, EffectName, accuracy_asked, percent
from .numbers import Numbers

if TYPE_CHECKING:
    from .flow_setup import Setup

OSEEN = 3.0 / 16.0


def inertia_of(setup: Setup, numbers: Numbers) -> Decision:
    """Present where Oseen's correction exceeds a share of the accuracy asked for. Not collective."""
    scene, name = setup.scene, EffectName.INERTIA
    if not scene.fluid.inertia or scene.effects.inertia is False:
        key = "fluid.inertia" if not scene.fluid.inertia else "effects.inertia"
        return Decision(name, False, f"{key} = false", True, expected(scene.flow.kind, numbers))
    told = f"Re = {scene.fluid.reynolds:g} on {scene.fluid.scale} scale"
    if scene.effects.inertia is True:
        return Decision(name, True, f"effects.inertia = true; {told}", True)
    if scene.has_surface:
        return Decision(name, True, f"the free surface moves the fluid; {told}")
    if scene.flow.kind == "still" and not scene.moves:
        return Decision(name, False, "the fluid is at rest", expected=0.0)
    change = expected(scene.flow.kind, numbers)
    which = "flow Re" if numbers.grain_reynolds is None else "grain Re"
    value = numbers.flow_reynolds if numbers.grain_reynolds is None else numbers.grain_reynolds
    if change > SHARE * accuracy_asked(scene.numerics):
        return Decision(name, True, told, expected=change)
    reason = f"{which} {value:.2g}; estimated effect on drag {percent(change)}"
    return Decision(name, False, reason, expected=change)


def expected(kind: str, numbers: Numbers) -> float:
    """Relative change of the drag that convection makes in a kind of flow, by Oseen's term; at most one."""
    found = [OSEEN * (numbers.bed_reynolds or 0.0)]
    if kind in ("lid", "expression"):  # not parallel: inertia bends the flow itself
        found.append(OSEEN * numbers.flow_reynolds)
    if numbers.grain_reynolds is not None:
        found.append(OSEEN * numbers.grain_reynolds * max(1.0, numbers.reach))
    elif kind != "still":
        found.append(OSEEN * numbers.flow_reynolds)
    return min(max(found), 1.0)
