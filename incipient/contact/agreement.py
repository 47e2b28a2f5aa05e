"""Do the paper's criteria and the exact judge say the same of a case, and if not, why?

Two questions are compared: whether the grain moves, and if both say so, how: which of lifting, sliding and
turning there is. Every difference gets one reason, found by asking the exact judge again with less: with the
significant contacts alone, or of contact forces that brace one another.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np

from incipient.contact import equilibrium
from incipient.contact.assumptions import Assumption, broken
from incipient.contact.exact.judge import Exact, MassAndInertia
from incipient.contact.paper.criteria import Classification
from incipient.contact.paper.modes import Criterion, Mode
from incipient.geometry.contacts import Contacts

NEAR = 1e-6  # a safety factor nearer to one is a boundary case


class AgreementPart(Enum):
    """What a motion is made of."""

    LIFTS = "lifting"
    SLIDES = "sliding"
    TURNS = "turning"


Family = frozenset[AgreementPart]
_LIFTS = frozenset({AgreementPart.LIFTS})
_SLIDES = frozenset({AgreementPart.SLIDES})
_TURNS = frozenset({AgreementPart.TURNS})

# What the paper's outcomes are called by one who watches the contacts. Pivotting combined with lifting keeps a
# contact or leaves it; a rotation away from the surface leaves all, whether it is called lifting or not.
FAMILIES: dict[Mode, tuple[Family, ...]] = {
    Mode.SLIDING: (_SLIDES,),
    Mode.LIFTING: (_LIFTS,),
    Mode.SLIDING_WITH_AWAY_ROTATION: (_SLIDES | _TURNS,),
    Mode.LIFTING_WITH_AWAY_ROTATION: (_LIFTS | _TURNS,),
    Mode.LIFTING_WITH_PIVOTTING: (_LIFTS | _TURNS, _TURNS),
    Mode.PIVOTTING: (_TURNS,),
    Mode.AWAY_ROTATION: (_LIFTS | _TURNS, _TURNS),
    Mode.SLIDING_AND_PIVOTTING: (_SLIDES | _TURNS,),
    Mode.NO_INCIPIENT_MOTION: (frozenset(),),
}
FAMILY: dict[equilibrium.Mode, Family] = {
    equilibrium.Mode.REST: frozenset(),
    equilibrium.Mode.SLIDING: _SLIDES,
    equilibrium.Mode.LIFTING: _LIFTS,
    equilibrium.Mode.LIFTING_AND_ROTATING: _LIFTS | _TURNS,
    equilibrium.Mode.ROLLING: _TURNS,
    equilibrium.Mode.PIVOTING: _TURNS,
    equilibrium.Mode.SPINNING: _TURNS,
    equilibrium.Mode.PIVOTING_AND_SLIDING: _SLIDES | _TURNS,
    equilibrium.Mode.PIVOTING_AND_SLIDING_APART: _SLIDES | _TURNS,
}


class Reason(Enum):
    """Why the judges differ, in a sentence."""

    BOUNDARY = "the load is on the boundary between rest and motion, where round-off decides"
    JAMMED = "the contacts wedge the grain: bracing one another they hold any load, which no contact does alone"
    STICK_ANSWERS_FORCE_AND_COUPLE = (
        "the contact can hold the load, but the paper lets its friction answer the couple besides the force (24), "
        "and a force is left over"
    )
    EQUAL_SHARING = "the significant contacts hold the load by unequal shares of it, and the paper shares equally"
    ONE_CONTACT_AT_A_TIME = (
        "the paper asks the significant contact only, that pressed most, "
        "and others hold or guide the grain with it"
    )
    ROLLING_CALLED_SLIDING = (
        "the grain rolls or pivots, "
        "and the force that its centre needs for that counts as sliding in (24)"
    )
    SLIP_IS_OVERESTIMATED = (
        "the paper lets a contact slip that cannot hold the load at rest; "
        "turning as it moves, the grain asks less of it"
    )
    FRICTION_COUPLE = (
        "friction's own couple turns the grain, "
        "and without a couple of the flow the paper calls that translation"
    )
    FORCES_NOT_ACCELERATIONS = (
        "the paper reads the motion off the force and couple left over; "
        "it depends on mass and inertia as well"
    )
    NOT_UNIQUE = "with dry friction several motions are possible here, or none, and the exact judge names that"
    MODE_UNKNOWN = "both find motion; the exact judge names no mode, for want of mass and inertia or of a solution"


@dataclass(frozen=True)
class Agreement:
    """Whether the judges agree, on rest or motion and on its family, and the reason if they do not.

    `same_family` is None where a judge names no mode. `assumptions_broken`: what the paper assumes and the
    case does not fulfil; without any the judges must agree.
    """

    same_moves: bool
    same_family: bool | None
    reason: Reason | None
    assumptions_broken: tuple[Assumption, ...]

    @property
    def agree(self) -> bool:
        """Whether nothing said by one judge is denied by the other."""
        return self.same_moves and self.same_family is not False

    @property
    def explanation(self) -> str:
        """The reason in a sentence; empty where there is nothing to explain."""
        return "" if self.reason is None else self.reason.value

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "agree": self.agree,
            "same_moves": self.same_moves,
            "same_family": self.same_family,
            "reason": None if self.reason is None else self.reason.name,
            "explanation": self.explanation,
            "assumptions_broken": [assumption.value for assumption in self.assumptions_broken],
        }


def compare(
    paper: Classification, exact: Exact, mass_and_inertia: MassAndInertia | None = None
) -> Agreement:
    """Compare the two judges' answers to the same case; of several motions that are possible one must agree."""
    families = families_of(exact)
    same_moves = paper.moves == exact.moves
    same_family: bool | None = None
    if same_moves:
        same_family = not families.isdisjoint(FAMILIES[paper.mode]) if families else None
    reason = _reason(paper, exact, same_family)
    return Agreement(same_moves, same_family, reason, broken(paper, mass_and_inertia))


def families_of(exact: Exact) -> frozenset[Family]:
    """The families of all motions that the exact judge found possible; empty where it names none."""
    if not exact.moves:
        return frozenset({FAMILY[equilibrium.Mode.REST]})
    if exact.motion is None:
        return frozenset()
    return frozenset(FAMILY[solution.mode] for solution in exact.motion.solutions)


def _reason(paper: Classification, exact: Exact, same_family: bool | None) -> Reason | None:
    if paper.moves != exact.moves:
        return _why_only_one_moves(paper, exact)
    if same_family is None:
        return Reason.MODE_UNKNOWN
    return None if same_family else _why_another_motion(paper, exact)


def _why_only_one_moves(paper: Classification, exact: Exact) -> Reason:
    if any(abs(end - 1.0) <= NEAR for end in exact.safety.interval or ()) or exact.moves:
        return Reason.BOUNDARY  # contact forces that satisfy the paper's rest satisfy statics, too
    if exact.safety.jams and np.isinf(exact.safety.value):
        return Reason.JAMMED
    some = list(paper.significant)
    alone = Contacts(paper.contacts.points[some], paper.contacts.normals[some])
    if not equilibrium.safety_factor(paper.load, alone, paper.friction).held:
        return Reason.ONE_CONTACT_AT_A_TIME
    if paper.criterion is Criterion.TRANSLATION_ONLY:
        return Reason.EQUAL_SHARING
    return Reason.STICK_ANSWERS_FORCE_AND_COUPLE


def _why_another_motion(paper: Classification, exact: Exact) -> Reason:
    assert exact.motion is not None
    family = FAMILY[exact.motion.mode]
    if len(families_of(exact)) > 1:
        return Reason.NOT_UNIQUE
    if not family or any(abs(end - 1.0) <= NEAR for end in exact.safety.interval or ()):
        return Reason.BOUNDARY
    if set(paper.obstructed_by) - set(paper.significant) or _others_pressed(paper, exact):
        return Reason.ONE_CONTACT_AT_A_TIME
    said = FAMILIES[paper.mode]
    if family == _TURNS and all(AgreementPart.SLIDES in one for one in said):
        stuck = bool((paper.C_friction >= 1.0).all())
        return Reason.ROLLING_CALLED_SLIDING if stuck else Reason.SLIP_IS_OVERESTIMATED
    if (
        paper.criterion is Criterion.TRANSLATION_ONLY
        and AgreementPart.TURNS in family
        and _SLIDES in said
    ):
        return Reason.FRICTION_COUPLE
    return Reason.FORCES_NOT_ACCELERATIONS


def _others_pressed(paper: Classification, exact: Exact) -> bool:
    """Whether contacts beside the significant ones carry force in the exact motion."""
    assert exact.motion is not None
    sizes = np.linalg.norm(exact.motion.contact_forces, axis=1)
    sizes[list(paper.significant)] = 0.0
    return bool(sizes.max() > NEAR * paper.force_scale)
