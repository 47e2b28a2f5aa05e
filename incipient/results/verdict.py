"""From the load on the grain and its contacts to the verdict of both judges, in plain data and in a sentence."""

from __future__ import annotations

from typing import Any

from ..arrays import spatial
from ..contact import Contacts, Load
from ..contact.exact import MassAndInertia
from ..contact.verdict import judge as judge_load
from ..geometry.placement import Placement
from ..geometry.touching import touching
from ..scene import Body, Scene
from ..scene.motion import inertia_tensor, mass
from .loads import Couples, Forces


def find_contacts(scene: Scene) -> Contacts:
    """Contacts of the resting grain with the bed, for a scene that has both."""
    grain, bed, resting = scene.grain, scene.bed_shape, scene.placement
    assert grain is not None and bed is not None and resting is not None
    return touching(grain, resting, bed, scene.contact_tolerance)


def load_of(scene: Scene, force: Forces, couple: Couples) -> Load:
    """The load on the contacts: the flow's force and couple, and the submerged weight at the centre of mass.

    The centre is that of the resting grain: contacts are where it touches, not where the gap has lifted it.
    """
    assert scene.placement is not None
    return Load(force.flow, couple.flow, force.weight + force.buoyancy, spatial(scene.placement.centre))


def judge(scene: Scene, contacts: Contacts, force: Forces, couple: Couples) -> dict[str, Any] | None:
    """The verdict of both judges with every quantity behind it, or None where there is nothing to judge."""
    if scene.contact is None or scene.body is None or scene.mass is None:
        return None
    inert = mass_and_inertia(scene.body, scene.placement)
    return judge_load(load_of(scene, force, couple), contacts, scene.contact.friction, inert).to_dict()


def mass_and_inertia(body: Body, placement: Placement | None = None) -> MassAndInertia | None:
    """Mass and inertia (3, 3) about the centre of mass of a placed grain, in the plane per unit depth.

    None for a grain without one of them. The fluid that moves along (added mass) is left out: it changes neither
    rest nor the safety factor.
    """
    heavy, inert = mass(body), inertia_tensor(body)
    if not heavy or inert is None or not inert.any():
        return None
    if body.gdim == 3 and placement is not None:
        inert = placement.rotation @ inert @ placement.rotation.T
    return heavy, inert
