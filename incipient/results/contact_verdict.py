"""The verdict of both criteria on the grain's load and contacts, as data and as a sentence."""

import math
from dataclasses import replace
from typing import Any

from ..arrays import spatial
from ..contact import Contacts, Load
from ..contact.rocking import Rocking, follow
from ..contact.verdict import Verdict, judge
from ..geometry.placement import Placement
from ..scene import Scene
from ..scene.grains import mass_and_inertia, orientation_of
from ..setup.setup import Setup
from .errorbars import SafetyBar
from .loads import Forces, Torques

ROCKS = "rocks to another rest"  # mode of motion
RENEWED = (
    "this uses the load of the first pose; in the second pose the load may differ by about {drift:.0%}{more}: to "
    "check, run a scene with {keys} and settle = false, and see whether the flow's load holds the grain (without the "
    "flow it would roll back)"
)

OTHER_CONTACTS = ", or more, since a contact has opened or closed"


def find_contacts(scene: Scene) -> Contacts:
    """Contacts of the resting grain with the bed."""
    return Setup(scene).geometry.contacts


def load_of(placement: Placement | None, force: Forces, torque: Torques) -> Load:
    """Load on the contacts: the flow's force and torque, and the submerged weight at the centre of mass.

    placement: of the grain in contact with the bed, without the gap
    """
    assert placement is not None
    return Load(force.flow, torque.flow, force.weight + force.buoyancy, spatial(placement.centre))


def verdict_on(
    scene: Scene, contacts: Contacts, load: Load, placement: Placement | None
) -> Verdict:
    """Verdict of both criteria on a scene's grain, placed, under a load."""
    assert scene.body is not None and scene.contact is not None
    return judge(load, contacts, scene.contact.law, mass_and_inertia(scene.body, placement))


def followed(scene: Scene, load: Load) -> Rocking | None:
    """Equilibria of a scene's grain as the flow's load grows up to `load` and beyond; None without any.

    The first is close to the scene's placement.
    """
    body, contact, bed = scene.body, scene.contact, scene.bed
    assert body is not None and contact is not None and scene.placement is not None
    if body.shape in ("disc", "sphere") and bed is not None and bed.kind in ("flat", "inclined"):
        return None
    inert = mass_and_inertia(body, scene.placement)
    return follow(scene.grain, scene.bed_shape, scene.placement, load, contact.law, inert)


def with_rocking(verdict: dict[str, Any], rocking: Rocking) -> dict[str, Any]:
    """The verdict on a grain that rocks before it leaves its pocket, or without leaving it."""
    factor = rocking.critical
    paper = verdict["sentence"].partition("; ")[2]
    return verdict | {
        "moves": rocking.leaves,
        "mode": rocking.mode if rocking.leaves else ROCKS,
        "sentence": f"{rocking.sentence}; {paper}",
        "safety_factor": factor if math.isfinite(factor) else None,
        "safety_status": "ROCKS",
        "rocking": rocking.to_dict(),
        "note": RENEWED.format(
            drift=rocking.drift(rocking.last),
            more=OTHER_CONTACTS
            if len(rocking.last.contacts) != len(rocking.rests[0].contacts)
            else "",
            keys=standing(rocking.last.placement),
        ),
    }


def bar_with_rocking(bar: SafetyBar, factor: float | None, share: float, drift: float) -> SafetyBar:
    """The bar of a rocking grain, computed with a frozen load: nothing is certain.

    Args:
        factor: the safety factor, None for an infinite one.
        share: relative error of the load.
        drift: relative change of the load between the first and the last pose.
    """
    value, error = math.inf if factor is None else factor, share + drift
    low, high = value / (1.0 + error), value / (1.0 - error) if error < 1.0 else math.inf
    return replace(
        bar,
        value=value,
        low=low,
        high=high,
        certain=False,
        rests=False,
        frozen=drift,
    )


def standing(placement: Placement) -> str:
    """The scene's keys for a placement."""
    if placement.gdim == 2:
        angle = math.degrees(placement.angle) % 360.0
        return f"body.x = {placement.centre[0]:.10g} and body.angle = {angle:.6g}"
    x, y, _ = placement.centre
    about = ", ".join(f"{angle:.6g}" for angle in orientation_of(placement))
    return f"body.x = {x:.10g}, body.y = {y:.10g} and body.orientation = [{about}]"


def may_rock(verdict: dict[str, Any]) -> bool:
    """Whether the contacts balance the weight but no load of the flow, so that another equilibrium may exist."""
    return verdict["moves"] and verdict["safety_status"] == "NO_RESERVE"
