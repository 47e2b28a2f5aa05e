"""One case, both judges, and what they say together: in numbers and in sentences."""

import math
from dataclasses import dataclass
from typing import Any

from incipient.contact.agreement import Agreement, Reason, compare
from incipient.contact.exact.judge import Exact, MassAndInertia, judged
from incipient.contact.exact.safety import SafetyFactor, SafetyStatus
from incipient.contact.model import Load
from incipient.contact.paper.criteria import Classification, classify
from incipient.geometry.contacts import Contacts


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

    Raises SceneError as `criteria.classify` and `equilibrium.incipient_motion` do.
    """
    paper = classify(load, contacts, friction)
    exact = judged(load, contacts, friction, mass_and_inertia)
    return Verdict(paper, exact, compare(paper, exact, mass_and_inertia))


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
        case SafetyStatus.AT_ONCE:
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
