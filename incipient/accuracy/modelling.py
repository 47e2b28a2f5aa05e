"""Gap and domain of a search for an accuracy, chosen before the mesh if `numerics.accuracy_includes = "all"`."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from ..errors import IncipientError, SceneError
from ..results.errorbars import ErrorBars, Loads, Term
from ..scene import Scene
from ..scene.flows import Flow
from .coarse_runs import Solve, changed, coarse, farther
from .goal import Quantity, relative
from .next_mesh import AIM
from .terms import DECAY, SLOWEST_DECAY, has_no_far_sides, not_there, of_domain, of_the_model

SHARE = 0.5  # of the accuracy, for gap and domain together
MOST_STEPS = 6
SMALLEST_GAP = 1e-4  # of the grain's size
CLOSEST, FARTHEST = 1 / 32, 3.0  # largest factors on gap and domain in one step
# Keys of gap and domain by section.
KEYS = {
    "contact": ("gap",),
    "domain": ("origin", "length", "width", "height"),
    "surface": ("sponge",),
}
LEAST = 1e-3  # least fraction to which a term is reduced


@dataclass(frozen=True)
class Suited:
    """A scene with gap and domain for an accuracy.

    terms: their present errors; error: relative sum, infinite if not known
    unmet: why they are too large, or ""; errors: relative error of each term
    plain: the same without corrections
    """

    scene: Scene
    terms: tuple[Term, ...] = ()
    error: float = np.inf
    unmet: str = ""
    errors: dict[str, float] = field(default_factory=dict)
    plain: dict[str, float] = field(default_factory=dict)

    def changes(self, wished: Scene) -> tuple[str, ...]:
        changed = _keys(self.scene, wished).items()
        return tuple(f"{key} = {now} instead of {before}" for key, (now, before) in changed)


def suited(
    scene: Scene, accuracy: float, goal: Quantity, solve: Solve, report: Callable[[str], None]
) -> Suited:
    """Choose gap and domain with a total error of half a relative error. Collective.

    The last choice is kept if a coarse run fails or the budget is spent. The search ends if the domain's error does not
    fall as expected: it is then underestimated.
    """
    last = Suited(scene)
    for _ in range(MOST_STEPS):
        try:
            before, last = last, _looked_at(scene, goal, solve)
            errors = last.errors
            if _hardly_falls(before, last):
                return _ended(before, last, goal, solve)
            if _is_noise(before, last):
                return replace(
                    before, unmet="the error of the gap does not decrease as the gap closes"
                )
            if last.error <= SHARE * accuracy:
                return last
            parts = [f"error of the {name} {error:.1e}" for name, error in errors.items()]
            report("; ".join(parts))
            part = SHARE * accuracy / len(errors)
            for term in last.terms:
                if (error := errors[term.name]) > part:
                    scene = lessened(scene, term, AIM * part / error) or scene
        except IncipientError as error:
            return replace(last, unmet=f"further errors of gap and domain are unknown: {error}")
        if scene is last.scene:
            largest = max(errors, key=lambda name: errors[name])
            remedy = f"; {_of_datum(scene.flow)}" if largest == "datum" else ""
            why = f"the error of the {largest}, {errors[largest]:.1e}, cannot be reduced"
            return replace(last, unmet=why + remedy)
    return replace(last, unmet=f"errors of gap and domain are too large after {MOST_STEPS} steps")


def _looked_at(scene: Scene, goal: Quantity, solve: Solve, decay: float | None = None) -> Suited:
    estimates = of_the_model(scene)
    if not estimates:
        return Suited(scene, (), 0.0)
    if decay is not None:
        estimates["domain"] = partial(of_domain, scene, decay=decay)
    computed = solve(coarse(scene))
    terms = tuple(estimate(computed, solve) for estimate in estimates.values())
    errors, plain = (
        {term.name: relative(goal, computed, term) or 0.0 for term in which}
        for which in (terms, [term.uncorrected for term in terms])
    )
    return Suited(scene, terms, sum(errors.values()), errors=errors, plain=plain)


def _hardly_falls(before: Suited, now: Suited) -> bool:
    larger = now.scene.domain.length / before.scene.domain.length
    if larger <= 1.0 or "domain" not in before.plain or now.errors["domain"] <= 0.0:
        return False
    return now.plain["domain"] > before.plain["domain"] * larger ** (-0.5 * DECAY)


def _is_noise(before: Suited, now: Suited) -> bool:
    gaps = [each.errors.get("gap", 0.0) for each in (before, now)]
    alike = now.scene.domain == before.scene.domain and now.scene is not before.scene
    return alike and gaps[1] >= gaps[0] > 0.0


def _ended(before: Suited, now: Suited, goal: Quantity, solve: Solve) -> Suited:
    slowly = [_looked_at(each.scene, goal, solve, SLOWEST_DECAY) for each in (before, now)]
    best = min(slowly, key=lambda each: each.error)
    error = best.errors["domain"]
    why = f"the error of the domain, {error:.1e}, hardly decreases as the domain grows"
    return replace(best, unmet=why)


def not_estimated(scene: Scene) -> str:
    """Reason why the error of gap or domain cannot be estimated, or ""."""
    for name, reason in not_there(scene).items():
        if reason.startswith("not estimated"):
            return f"that of the {name} is {reason}"
    return ""


def remedies(
    scene: Scene, accuracy: float, goal: Quantity, loads: Loads, bars: ErrorBars
) -> tuple[str, ...]:
    """Remedies for errors of gap and domain above an accuracy, as text."""
    said = []
    for term in bars.terms:
        error = relative(goal, loads, term)
        if term.name == "discretisation" or error is None or error <= accuracy:
            continue
        remedy = _remedy(scene, term, accuracy / error)
        said.append(f"not included: the error of the {term.name}, {error:.1e}; {remedy}")
    if said:
        said.append('numerics.accuracy_includes = "all" lets the run change gap and domain')
    return tuple(said)


def _remedy(scene: Scene, term: Term, relative: float) -> str:
    if term.name == "datum":
        return _of_datum(scene.flow)
    better = None
    with suppress(SceneError):
        better = lessened(scene, term, AIM * relative, at_once=False)
    if better is None:
        return "it cannot be reduced enough"
    keys = _keys(better, scene).items()
    return f"{', '.join(f'{key} = {now}' for key, (now, _) in keys)} would be sufficient"


def _keys(scene: Scene, other: Scene) -> dict[str, tuple[str, str]]:
    keys: dict[str, tuple[str, str]] = {}
    for section, names in KEYS.items():
        now, before = (getattr(getattr(each, section), "__dict__", {}) for each in (scene, other))
        for name in names:
            pair = now.get(name), before.get(name)
            if None not in pair and pair[0] != pair[1]:
                keys[f"{section}.{name}"] = (_written(pair[0]), _written(pair[1]))
    return keys


def _written(value: Any) -> str:
    return str([float(f"{x:.4g}") for x in value]) if isinstance(value, tuple) else f"{value:.4g}"


def _of_datum(flow: Flow) -> str:
    if getattr(flow, "datum", "auto") in ("auto", "effective"):
        return "with inertia the effective height of the bed is not known more accurately"
    return 'flow.datum = "auto" reduces it'


def lessened(scene: Scene, term: Term, relative: float, at_once: bool = True) -> Scene | None:
    """The scene in which a term is expected to fall to a fraction `relative`; None if impossible.

    at_once: limit the change to a reliable expectation
    """
    relative = max(relative, LEAST)
    if term.name == "gap" and scene.contact is not None:
        smaller, before = relative ** (1.0 / term.power), scene.contact.gap
        gap = before * (max(smaller, CLOSEST) if at_once else smaller)
        if before <= SMALLEST_GAP or (gap < SMALLEST_GAP and not at_once):
            return None
        return changed(scene, contact={"gap": float(f"{max(gap, SMALLEST_GAP):.2g}")})
    # Without a section [contact] the gap stays: a new section would request a verdict.
    if term.name != "domain" or has_no_far_sides(scene):
        return None
    factor = float(np.ceil(10.0 * relative ** (-1.0 / DECAY))) / 10.0
    return farther(scene, min(factor, FARTHEST) if at_once else factor)
