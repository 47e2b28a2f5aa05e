"""How a solved incipient motion is read: each contact, the whole grain, and whether it is the only one."""

import math
from collections.abc import Sequence
from enum import Enum

import numpy as np

from incipient.arrays import Floats


class ContactState(Enum):
    """What the grain does at a contact, by its acceleration there: normal, along the surface, and turning."""

    STICK = "stays where it is, and so does the whole grain"
    ROLL = "stays where it is while the grain turns"
    SLIDE = "keeps contact and accelerates along the surface"
    LIFT = "accelerates away from the surface"


class Mode(Enum):
    """What the whole grain begins to do.

    The definitions exclude one another and leave nothing out. With the states of all contacts, and the angular
    acceleration alpha of the grain:

    - REST: no acceleration at all.
    - Without alpha: SLIDING if any contact slides (others may lift), else all lift: LIFTING.
    - With alpha, no contact rolls: PIVOTING_AND_SLIDING if any contact slides, else LIFTING_AND_ROTATING.
    - With alpha, some contact rolls and another slides: PIVOTING_AND_SLIDING_APART.
    - With alpha, some contact rolls and none slides: PIVOTING if any contact lifts, SPINNING if none lifts and
      alpha is along the normals of all contacts, else ROLLING.

    At the instant of release rolling on a contact and pivoting about it are one motion; what tells them apart
    here is whether the grain keeps all its contacts or leaves some.
    """

    REST = "rest"
    SLIDING = "sliding: translation along at least one contact"
    LIFTING = "lifting: translation away from every contact"
    LIFTING_AND_ROTATING = "lifting off every contact and rotating"
    ROLLING = "rolling: every contact keeps its place while the grain turns"
    PIVOTING = "pivoting about the contacts that keep their place, lifting off the others"
    SPINNING = "spinning about the normal of its contacts, which keep their place"
    PIVOTING_AND_SLIDING = "turning and sliding at the same contacts, none keeps its place"
    PIVOTING_AND_SLIDING_APART = "pivoting about one contact while sliding on a different one"

    @property
    def moves(self) -> bool:
        """Whether the grain begins to move."""
        return self is not Mode.REST

    @property
    def label(self) -> str:
        """The name in words."""
        return self.name.lower().replace("_", " ")


class Uniqueness(Enum):
    """Whether the acceleration given is the only one that mechanics allows."""

    ONLY = "the only solution"
    SEVERAL = "one of several solutions"
    FAMILY = "one of a continuous family of solutions"
    NOT_EXCLUDED = "no other solution was found; others are not excluded"


def contact_states(accelerations: Floats, turns: bool, zero: float) -> list[ContactState]:
    """The states (k,) of contacts with local accelerations (k, 3), normal first; `zero` counts as none."""
    stays = ContactState.ROLL if turns else ContactState.STICK
    states = []
    for normal, *along in accelerations.tolist():
        slides = ContactState.SLIDE if math.hypot(*along) > zero else stays
        states.append(ContactState.LIFT if normal > zero else slides)
    return states


def mode(states: Sequence[ContactState], normals: Floats, angular: Floats, zero: float) -> Mode:
    """The mode of the grain by the states (k,) of its contacts, their normals (k, 3) and its turning (3,)."""
    present = set(states)
    if ContactState.STICK in present:
        return Mode.REST
    slides, lifts = ContactState.SLIDE in present, ContactState.LIFT in present
    if not angular.any():
        return Mode.SLIDING if slides else Mode.LIFTING
    if ContactState.ROLL not in present:
        return Mode.PIVOTING_AND_SLIDING if slides else Mode.LIFTING_AND_ROTATING
    if slides:
        return Mode.PIVOTING_AND_SLIDING_APART
    if lifts:
        return Mode.PIVOTING
    across = angular - (normals @ angular)[:, None] * normals
    return Mode.SPINNING if np.abs(across).max() <= zero else Mode.ROLLING
