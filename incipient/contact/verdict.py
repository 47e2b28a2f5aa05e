"""Verdict on one case: both criteria, their agreement, and the reason for a difference."""

import math
from dataclasses import dataclass, replace
from enum import Enum, Flag, auto
from typing import Any

import numpy as np

from incipient.arrays import Floats
from incipient.contact.acceleration import IncipientMotion, checked_inertia, motion_of
from incipient.contact.acceleration import Mode as ExactMode
from incipient.contact.friction import FrictionCone, Law
from incipient.contact.paper import Classification, Criterion, Mode, classify
from incipient.contact.problem import ContactProblem, Load
from incipient.contact.safety import SafetyFactor, SafetyStatus, intervals, safety_of
from incipient.errors import ConvergenceError
from incipient.files import plain
from incipient.geometry.contacts import Contacts

MassAndInertia = tuple[float, Floats]  # mass, and inertia (3, 3) about the centre of mass
NEAR = 1e-6  # distance of the safety factor from one below which a case is on the boundary


class Family(Flag):
    """Components of a motion; REST has none."""

    REST = 0
    LIFTS = auto()
    SLIDES = auto()
    TURNS = auto()


# Families of the paper's outcomes. Pivoting with lifting keeps a contact or leaves it; a rotation away from the
# surface leaves all contacts, whether or not it is called lifting.
FAMILIES: dict[Mode, tuple[Family, ...]] = {
    Mode.SLIDING: (Family.SLIDES,),
    Mode.LIFTING: (Family.LIFTS,),
    Mode.SLIDING_WITH_AWAY_ROTATION: (Family.SLIDES | Family.TURNS,),
    Mode.LIFTING_WITH_AWAY_ROTATION: (Family.LIFTS | Family.TURNS,),
    Mode.LIFTING_WITH_PIVOTTING: (Family.LIFTS | Family.TURNS, Family.TURNS),
    Mode.PIVOTTING: (Family.TURNS,),
    Mode.AWAY_ROTATION: (Family.LIFTS | Family.TURNS, Family.TURNS),
    Mode.SLIDING_AND_PIVOTTING: (Family.SLIDES | Family.TURNS,),
    Mode.NO_INCIPIENT_MOTION: (Family.REST,),
}
FAMILY: dict[ExactMode, Family] = {
    ExactMode.REST: Family.REST,
    ExactMode.SLIDING: Family.SLIDES,
    ExactMode.LIFTING: Family.LIFTS,
    ExactMode.LIFTING_AND_ROTATING: Family.LIFTS | Family.TURNS,
    ExactMode.ROLLING: Family.TURNS,
    ExactMode.PIVOTING: Family.TURNS,
    ExactMode.SPINNING: Family.TURNS,
    ExactMode.PIVOTING_AND_SLIDING: Family.SLIDES | Family.TURNS,
    ExactMode.PIVOTING_AND_SLIDING_APART: Family.SLIDES | Family.TURNS,
}


class Reason(Enum):
    """Reason for a difference between the criteria, in a sentence."""

    BOUNDARY = "the load is on the boundary between rest and motion, where round-off decides"
    JAMMED = (
        "the contacts wedge the grain: together they hold any load, which no contact does alone"
    )
    STICK_ANSWERS_FORCE_AND_TORQUE = (
        "the contact can hold the load, but in the paper friction (24) also balances the torque, "
        "which leaves a residual force"
    )
    EQUAL_SHARING = "the significant contacts carry unequal fractions of the load, and the paper assumes equal ones"
    ONE_CONTACT_AT_A_TIME = (
        "the paper considers the significant contact only, the one pressed most, "
        "and other contacts also hold or guide the grain"
    )
    ROLLING_CALLED_SLIDING = (
        "the grain rolls or pivots, "
        "and (24) counts the force that accelerates its centre as sliding"
    )
    SLIP_IS_OVERESTIMATED = (
        "the paper lets a contact slip if it cannot hold the load at rest; "
        "a grain that turns as it moves loads it less"
    )
    FRICTION_TORQUE = (
        "friction's own torque turns the grain, "
        "and without a torque of the flow the paper classifies this as translation"
    )
    FORCES_NOT_ACCELERATIONS = (
        "the paper infers the motion from the residual force and torque; "
        "it also depends on mass and inertia"
    )
    COHESION = "contacts are cohesive, and the paper's criteria have no cohesion"
    NOT_UNIQUE = "with dry friction several motions are possible here, or none; the exact criterion says which"
    MODE_UNKNOWN = "both predict motion; the exact criterion names no mode, without mass and inertia or a solution"


@dataclass(frozen=True)
class Agreement:
    """Agreement of the criteria; `same_family` is None where a criterion names no mode."""

    same_moves: bool
    same_family: bool | None
    reason: Reason | None

    @property
    def agree(self) -> bool:
        return self.same_moves and self.same_family is not False

    @property
    def explanation(self) -> str:
        return "" if self.reason is None else self.reason.value


@dataclass(frozen=True, eq=False)
class Exact:
    """Safety factor and incipient motion; `motion` is None at rest, without inertia, or if `unsolved`."""

    safety: SafetyFactor
    motion: IncipientMotion | None
    unsolved: str = ""

    @property
    def moves(self) -> bool:
        return not self.safety.held

    @property
    def cohesion(self) -> float:
        return float(self.safety.problem.law.cohesion[0])

    @property
    def label(self) -> str:
        if self.motion is not None and self.motion.moves:
            return self.motion.first.mode.label
        return "moves" if self.moves else "rest"


def judged(
    load: Load, contacts: Contacts, law: Law, mass_and_inertia: MassAndInertia | None = None
) -> Exact:
    """Compute the safety factor and, if the grain moves, its incipient motion; raises SceneError."""
    known = None if mass_and_inertia is None else checked_inertia(*mass_and_inertia)
    problem = ContactProblem.of(load, contacts, law, known and known[1][0])
    safety = safety_of(problem)
    if safety.held or known is None:
        return Exact(safety, None)
    try:
        return Exact(safety, motion_of(problem, *known, safety))
    except ConvergenceError as error:
        return Exact(safety, None, str(error))


def compare(paper: Classification, exact: Exact) -> Agreement:
    """Compare both criteria on one case; of several possible motions one must agree."""
    if paper.moves != exact.moves:
        return Agreement(False, None, _why_only_one_moves(paper, exact))
    if exact.moves and exact.motion is None:
        return Agreement(True, None, Reason.MODE_UNKNOWN)
    families = _families(exact)
    if families.isdisjoint(FAMILIES[paper.mode]):
        return Agreement(True, False, _why_another_motion(paper, exact, families))
    return Agreement(True, True, None)


def _families(exact: Exact) -> set[Family]:
    if exact.motion is None or not exact.moves:
        return {Family.REST}
    return {FAMILY[solution.mode] for solution in exact.motion.solutions}


def _at_boundary(exact: Exact) -> bool:
    return any(abs(end - 1.0) <= NEAR for end in exact.safety.interval or ())


def _why_only_one_moves(paper: Classification, exact: Exact) -> Reason:
    if _at_boundary(exact) or exact.moves:
        return Reason.BOUNDARY  # rest by the paper's criteria implies static equilibrium
    if exact.safety.jams and np.isinf(exact.safety.value):
        return Reason.JAMMED
    load, some = paper.load, list(paper.significant)
    surface = paper.contacts.points[None, some] - load.centre, paper.contacts.normals[None, some]
    law = FrictionCone.of(paper.friction).rows(1)
    if not intervals(ContactProblem.of_rows(*surface, load.wrenches[None], law, None)).held[0]:
        return Reason.ONE_CONTACT_AT_A_TIME
    if paper.criterion is Criterion.TRANSLATION_ONLY:
        return Reason.EQUAL_SHARING
    return Reason.STICK_ANSWERS_FORCE_AND_TORQUE


def _why_another_motion(paper: Classification, exact: Exact, families: set[Family]) -> Reason:
    assert exact.motion is not None
    if len(families) > 1:
        return Reason.NOT_UNIQUE
    (family,), paper_families = families, FAMILIES[paper.mode]
    if not family or _at_boundary(exact):
        return Reason.BOUNDARY
    others = np.linalg.norm(exact.motion.first.contact_forces, axis=1)
    others[list(paper.significant)] = 0.0
    pressed = bool(others.max() > NEAR * paper.force_scale)
    if pressed or set(paper.obstructed_by) - set(paper.significant):
        return Reason.ONE_CONTACT_AT_A_TIME
    if family is Family.TURNS and all(Family.SLIDES in other for other in paper_families):
        stuck = bool((paper.C_friction >= 1.0).all())
        return Reason.ROLLING_CALLED_SLIDING if stuck else Reason.SLIP_IS_OVERESTIMATED
    translates = paper.criterion is Criterion.TRANSLATION_ONLY and Family.SLIDES in paper_families
    if translates and Family.TURNS in family:
        return Reason.FRICTION_TORQUE
    return Reason.FORCES_NOT_ACCELERATIONS


@dataclass(frozen=True, eq=False)
class Verdict:
    """Outcome of both criteria, and their agreement."""

    criteria: Classification
    equilibrium: Exact
    agreement: Agreement

    @property
    def moves(self) -> bool:
        """Whether the grain begins to move, by the exact criterion."""
        return self.equilibrium.moves

    @property
    def sentence(self) -> str:
        """Both verdicts in words."""
        return f"{exact_sentence(self.equilibrium)}; {paper_sentence(self)}"

    def to_dict(self) -> dict[str, Any]:
        """JSON data; an infinite safety factor is None with status UNLIMITED."""
        exact, agreement = self.equilibrium, self.agreement
        motion = None if exact.motion is None else exact.motion.to_dict()
        factor = plain(exact.safety.value)
        safety = plain(exact.safety) | {"jams": exact.safety.jams}
        return {
            "moves": self.moves,
            "mode": exact.label,
            "sentence": self.sentence,
            "safety_factor": factor,
            "safety_status": exact.safety.status.name,
            "judges": {
                "criteria": self.criteria.to_dict(),
                "equilibrium": {"safety": safety, "motion": motion, "unsolved": exact.unsolved}
                | {"moves": exact.moves, "mode": exact.label, "cohesion": exact.cohesion},
            },
            "agreement": plain(agreement)
            | {"agree": agreement.agree, "explanation": agreement.explanation},
        }


def judge(
    load: Load, contacts: Contacts, law: Law, mass_and_inertia: MassAndInertia | None = None
) -> Verdict:
    """Evaluate both criteria on one case; without mass and inertia the exact criterion names no mode.

    Raises SceneError as `classify` and `incipient_motion` do.
    """
    paper = classify(load, contacts, law)
    exact = judged(load, contacts, law, mass_and_inertia)
    agreement = compare(paper, exact)
    if isinstance(law, FrictionCone) and law.is_cohesive and not agreement.agree:
        loose = FrictionCone.of(paper.friction)
        without = compare(paper, judged(load, contacts, loose, mass_and_inertia))
        if without.agree or (without.same_moves and not agreement.same_moves):
            agreement = replace(agreement, reason=Reason.COHESION)
    return Verdict(paper, exact, agreement)


def exact_sentence(exact: Exact) -> str:
    """Verdict of the exact criterion in words."""
    words = margin(exact.safety)
    if not exact.moves:
        return f"the grain stays at rest, {words}"
    if exact.motion is None or not exact.motion.moves:
        return f"the grain begins to move, {words}"
    several = ", one of several motions that are possible" * (len(exact.motion.solutions) > 1)
    return f"the grain begins to move ({exact.label}{several}), {words}"


def paper_sentence(verdict: Verdict) -> str:
    """Verdict of the paper's criteria in words, with the reason for a difference."""
    paper, agreement = verdict.criteria, verdict.agreement
    verdict_text = "by the paper's criteria there is no incipient motion"
    if paper.moves:
        item = "" if paper.category is None else f" [{paper.category.item}]"
        verdict_text = f"by the paper's criteria it begins to move, {paper.mode.wording}{item}"
    if agreement.agree:
        return f"{verdict_text}, in agreement"
    alone = paper.moves and not verdict.moves and agreement.reason is not Reason.BOUNDARY
    return f"{verdict_text}; they differ: {agreement.explanation}{', so it rests' if alone else ''}"


def margin(safety: SafetyFactor) -> str:
    """The safety factor in words."""
    low, high = (
        f"{end:.4g}" if math.isfinite(end) else "any number of"
        for end in safety.interval or (math.nan, math.nan)
    )
    held = "would hold" if safety.value < 1.0 else "could still be held"
    return {
        SafetyStatus.NO_FLOW: "the flow exerts no load",
        SafetyStatus.UNLIMITED: "safety factor infinite: no multiple of the flow's load moves it",
        SafetyStatus.NO_RESERVE: "safety factor 0: any fraction of the flow's load moves it",
        SafetyStatus.UNHELD: "safety factor 0: it moves without any flow",
        SafetyStatus.HELD_BY_FLOW: "safety factor 0: it moves without any flow, "
        f"{low} to {high} times the flow's load hold it",
        SafetyStatus.CRITICAL: f"safety factor {safety.value:.4g}: "
        f"that multiple of the flow's load {held}",
    }[safety.status]
