"""From the load on the grain and its contacts to the verdict, in plain data and in a sentence."""

from __future__ import annotations

from typing import Any

from .contact import Contacts, Load, criteria
from .contact.search import touching
from .result import Couples, Forces
from .scene import Scene


def find_contacts(scene: Scene) -> Contacts:
    """Contacts of the resting grain with the bed, for a scene that has both."""
    grain, bed, resting = scene.grain, scene.bed_shape, scene.placement
    assert grain is not None and bed is not None and resting is not None
    return touching(grain, resting, bed, scene.contact_tolerance)


def load_of(force: Forces, couple: Couples) -> Load:
    """The load on the contacts: the flow's force and couple, and the submerged weight at the centre of mass."""
    return Load(force.flow, couple.flow, force.weight + force.buoyancy, couple.about)


def judge(scene: Scene, contacts: Contacts, force: Forces, couple: Couples) -> dict[str, Any] | None:
    """The paper's verdict with every intermediate quantity, or None where there is nothing to judge."""
    if scene.contact is None or scene.body is None or scene.body.density is None:
        return None
    outcome = criteria.classify(load_of(force, couple), contacts, scene.contact.friction)
    return {
        "moves": outcome.moves,
        "mode": outcome.mode.name.lower().replace("_", " "),
        "wording": outcome.mode.wording,
        "sentence": _sentence(outcome),
        "judges": {"criteria": outcome.to_dict()},
    }


def _sentence(outcome: Any) -> str:
    if not outcome.moves:
        return "the grain stays at rest (the paper's criteria)"
    return f"the grain begins to move: {outcome.mode.wording} (the paper's criteria)"
