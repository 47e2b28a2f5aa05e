"""From the load on the grain and its contacts to the verdict, in plain data and in a sentence."""

from __future__ import annotations

from typing import Any

import numpy as np

from .contact import Classification, Contacts, Load, criteria
from .contact.search import touching
from .result import Couples, Forces
from .scene import Scene


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
    return Load(force.flow, couple.flow, force.weight + force.buoyancy, np.array([*scene.placement.centre, 0.0]))


def judge(scene: Scene, contacts: Contacts, force: Forces, couple: Couples) -> dict[str, Any] | None:
    """The paper's verdict with every intermediate quantity, or None where there is nothing to judge."""
    if scene.contact is None or scene.body is None or scene.body.density is None:
        return None
    outcome = criteria.classify(load_of(scene, force, couple), contacts, scene.contact.friction)
    return {
        "moves": outcome.moves,
        "mode": outcome.mode.name.lower().replace("_", " "),
        "wording": outcome.mode.wording,
        "sentence": _sentence(outcome),
        "judges": {"criteria": outcome.to_dict()},
    }


def _sentence(outcome: Classification) -> str:
    if not outcome.moves:
        return "by the paper's criteria the grain stays at rest"
    sentence = f"by the paper's criteria the grain begins to move: {outcome.mode.wording}"
    if outcome.obstructed_by:
        which = ", ".join(str(index + 1) for index in outcome.obstructed_by)
        sentence += f"; but that motion runs into contact {which}, which they do not weigh"
    return sentence
