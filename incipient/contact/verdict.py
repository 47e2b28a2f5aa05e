"""The verdict on one case: both criteria, whether they agree, and why not.

Two questions are compared: whether the grain moves, and if both say so, how: which of lifting, sliding and turning
there is. Every difference has one reason, found by asking the exact criterion again with less: with the significant
contacts alone, or of contact forces that brace one another.
"""

import math
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np

from incipient.arrays import Floats
from incipient.contact.acceleration import IncipientMotion, checked_inertia, incipient_motion
from incipient.contact.acceleration import Mode as ExactMode
from incipient.contact.paper import Classification, classify
from incipient.contact.paper.outcomes import Criterion, Mode
from incipient.contact.problem import Load
from incipient.contact.safety import SafetyFactor, SafetyStatus, safety_factor
from incipient.errors import ConvergenceError
from incipient.geometry.contacts import Contacts

MassAndInertia = tuple[float, Floats]  # mass, and inertia (3, 3) about the centre of mass
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
FAMILY: dict[ExactMode, Family] = {
    ExactMode.REST: frozenset(),
    ExactMode.SLIDING: _SLIDES,
    ExactMode.LIFTING: _LIFTS,
    ExactMode.LIFTING_AND_ROTATING: _LIFTS | _TURNS,
    ExactMode.ROLLING: _TURNS,
    ExactMode.PIVOTING: _TURNS,
    ExactMode.SPINNING: _TURNS,
    ExactMode.PIVOTING_AND_SLIDING: _SLIDES | _TURNS,
    ExactMode.PIVOTING_AND_SLIDING_APART: _SLIDES | _TURNS,
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

    `same_family` is None where a judge names no mode.
    """

    same_moves: bool
    same_family: bool | None
    reason: Reason | None

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
        }


@dataclass(frozen=True, eq=False)
class Exact:
    """The safety factor, and the incipient motion where the grain moves.

    `motion` is None where the grain rests, where mass and inertia are not given, and where no solution was
    found, which `unsolved` then says.
    """

    safety: SafetyFactor
    motion: IncipientMotion | None
    unsolved: str = ""

    @property
    def moves(self) -> bool:
        """Whether no contact forces in the friction cones balance the load as it is."""
        return not self.safety.held

    @property
    def label(self) -> str:
        """The mode in words; where it is not known only that the grain moves."""
        if self.motion is not None and self.motion.moves:
            return self.motion.mode.label
        return "moves" if self.moves else "rest"

    def to_dict(self) -> dict[str, Any]:
        """Both answers as plain data for JSON."""
        motion = None if self.motion is None else self.motion.to_dict()
        said = {"moves": self.moves, "mode": self.label, "unsolved": self.unsolved}
        return said | {"safety": self.safety.to_dict(), "motion": motion}


def judged(
    load: Load, contacts: Contacts, friction: float, mass_and_inertia: MassAndInertia | None = None
) -> Exact:
    """The safety factor and, if the grain moves, how it does.

    Raises SceneError as `safety_factor` and `incipient_motion` do.
    """
    if mass_and_inertia is not None:  # also where the grain rests, and neither is used
        checked_inertia(*mass_and_inertia)
    safety = safety_factor(load, contacts, friction)
    if safety.held or mass_and_inertia is None:
        return Exact(safety, None)
    try:
        motion = incipient_motion(load, contacts, friction, *mass_and_inertia, safety)
        return Exact(safety, motion)
    except ConvergenceError as error:
        return Exact(safety, None, str(error))


def compare(paper: Classification, exact: Exact) -> Agreement:
    """Compare the two judges' answers to the same case; of several motions that are possible one must agree."""
    families = families_of(exact)
    same_moves = paper.moves == exact.moves
    same_family: bool | None = None
    if same_moves:
        same_family = not families.isdisjoint(FAMILIES[paper.mode]) if families else None
    return Agreement(same_moves, same_family, _reason(paper, exact, same_family))


def families_of(exact: Exact) -> frozenset[Family]:
    """The families of all motions that the exact judge found possible; empty where it names none."""
    if not exact.moves:
        return frozenset({FAMILY[ExactMode.REST]})
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
    if not safety_factor(paper.load, alone, paper.friction).held:
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


@dataclass(frozen=True, eq=False)
class Verdict:
    """The paper's judgement, the exact one, and whether they agree."""

    criteria: Classification
    equilibrium: Exact
    agreement: Agreement

    @property
    def moves(self) -> bool:
        """Whether the grain begins to move, by the exact judge."""
        return self.equilibrium.moves

    @property
    def sentence(self) -> str:
        """The exact judge's verdict with the safety factor, the paper's, and whether they agree."""
        return f"{exact_sentence(self.equilibrium)}; {paper_sentence(self)}"

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain data for JSON; an infinite safety factor is None with the status UNLIMITED."""
        safety = self.equilibrium.safety
        return {
            "moves": self.moves,
            "mode": self.equilibrium.label,
            "sentence": self.sentence,
            "safety_factor": safety.value if math.isfinite(safety.value) else None,
            "safety_status": safety.status.name,
            "judges": {
                "criteria": self.criteria.to_dict(),
                "equilibrium": self.equilibrium.to_dict(),
            },
            "agreement": self.agreement.to_dict(),
        }


def judge(
    load: Load, contacts: Contacts, friction: float, mass_and_inertia: MassAndInertia | None = None
) -> Verdict:
    """Both judges on one case; without mass and inertia the exact one does not say how the grain moves.

    Raises SceneError as `classify` and `incipient_motion` do.
    """
    paper = classify(load, contacts, friction)
    exact = judged(load, contacts, friction, mass_and_inertia)
    return Verdict(paper, exact, compare(paper, exact))


def exact_sentence(exact: Exact) -> str:
    """Rest or motion by the exact judge, and the safety factor with what it means."""
    if not exact.moves:
        return f"the grain stays at rest, {_margin(exact.safety)}"
    return f"the grain begins to move{_how(exact)}, {_margin(exact.safety)}"


def _how(exact: Exact) -> str:
    if exact.motion is None or not exact.motion.moves:
        return ""
    several = len(exact.motion.solutions) > 1
    return f" ({exact.label}{', one of several motions that are possible' if several else ''})"


def paper_sentence(verdict: Verdict) -> str:
    """What the paper's criteria say, whether that agrees, and why not."""
    said = f"by the paper's criteria {_of_paper(verdict.criteria)}"
    agreement = verdict.agreement
    if agreement.agree:
        return f"{said}, in agreement"
    alone = verdict.criteria.moves and not verdict.moves and agreement.reason is not Reason.BOUNDARY
    rests = ", so it rests" if alone else ""
    return f"{said}; they differ: {agreement.explanation}{rests}"


def _of_paper(paper: Classification) -> str:
    if not paper.moves:
        return "there is no incipient motion"
    words = (
        paper.mode.wording
        if paper.category is None
        else f"{paper.mode.wording} [{paper.category.item}]"
    )
    return f"it begins to move, {words}"


def _margin(safety: SafetyFactor) -> str:
    match safety.status:
        case SafetyStatus.NO_FLOW:
            return "there being no load of the flow"
        case SafetyStatus.UNLIMITED:
            return "safety factor infinite: no multiple of the flow's load moves it"
        case SafetyStatus.NO_RESERVE:
            return "safety factor 0: any part of the flow's load moves it"
        case SafetyStatus.UNHELD:
            return "safety factor 0: its weight alone moves it"
        case SafetyStatus.HELD_BY_FLOW:
            low, high = (_number(end) for end in safety.interval or (math.nan, math.nan))
            return f"safety factor 0: its weight alone moves it, {low} to {high} times the flow's load hold it"
        case SafetyStatus.CRITICAL:
            word = "would hold" if safety.value < 1.0 else "could still be held"
            return f"safety factor {_number(safety.value)}: that multiple of the flow's load {word}"
    raise AssertionError(safety.status)


def _number(value: float) -> str:
    return f"{value:.4g}" if math.isfinite(value) else "any number of"
