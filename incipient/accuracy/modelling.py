"""Gap and domain of a search for an accuracy with `numerics.accuracy_includes = "all"`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..results.errorbars import ErrorBars, Loads, Term
from ..scene import Scene
from ..scene.flows import Flow
from .coarse_runs import changed, farther
from .goal import Goal, relative
from .terms import DECAY, has_no_far_sides

AIM = 0.6  # fraction of the accuracy aimed at, as a margin
SHARE = 0.5  # of the accuracy, for gap and domain together
SMALLEST_GAP = 1e-4  # of the grain's size
CLOSEST, FARTHEST = 1 / 32, 3.0  # largest factors on gap and domain in one step
# Keys of gap and domain by section.
KEYS = {
    "contact": ("gap",),
    "domain": ("origin", "length", "width", "height"),
    "surface": ("sponge",),
}
LEAST = 1e-3  # least fraction to which a term is reduced


def less_of_the_model(
    scene: Scene, accuracy: float, terms: Sequence[Term], errors: Mapping[str, float]
) -> Scene:
    """The scene with gap and domain for errors that add up to half of an accuracy; the same if they cannot."""
    part = SHARE * accuracy / len(errors)
    for term in terms:
        if errors[term.name] > part:
            scene = lessened(scene, term, AIM * part / errors[term.name]) or scene
    return scene


def slowly_falling(
    scene: Scene,
    terms: Sequence[Term],
    errors: Mapping[str, float],
    before: Scene,
    errors_before: Mapping[str, float],
) -> str:
    """The term that falls by less than the root of what its smaller gap or larger domain lets expect, or ""."""
    expected = {"domain": (before.domain.length / scene.domain.length) ** DECAY}
    if scene.contact is not None and before.contact is not None:
        power = next((term.power for term in terms if term.name == "gap"), 1.0)
        expected["gap"] = (scene.contact.gap / before.contact.gap) ** power
    for name, change in expected.items():
        now = errors.get(name, 0.0)
        if change < 1.0 and now > errors_before.get(name, np.inf) * change**0.5:
            return name
    return ""


def irreducible(scene: Scene, errors: Mapping[str, float]) -> str:
    """Why errors of gap, domain and datum stay too large."""
    name = max(errors, key=lambda name: errors[name])
    remedy = f"; {_of_datum(scene.flow)}" if name == "datum" else ""
    return f"the error of the {name}, {errors[name]:.1e}, cannot be reduced{remedy}"


def not_included(accuracy: float, goal: Goal, loads: Loads, bars: ErrorBars) -> tuple[str, ...]:
    """The errors of gap, domain and datum above an accuracy that does not include them, as text."""
    errors = {term.name: relative(goal, loads, term) or 0.0 for term in bars.terms}
    large = [
        f"{name} {error:.1e}"
        for name, error in errors.items()
        if name != "discretisation" and error > accuracy
    ]
    if not large:
        return ()
    remedy = 'numerics.accuracy_includes = "all" lets the run reduce those of gap and domain'
    return (f"not included: errors of {', '.join(large)}; {remedy}",)


def keys_of(scene: Scene, other: Scene) -> dict[str, tuple[str, str]]:
    """Keys of gap and domain that differ, with both values as text."""
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


def lessened(scene: Scene, term: Term, relative: float) -> Scene | None:
    """The scene in which a term is expected to fall to a fraction `relative` in one step; None if impossible."""
    relative = max(relative, LEAST)
    if term.name == "gap" and scene.contact is not None:
        before = scene.contact.gap
        gap = max(before * max(relative ** (1.0 / term.power), CLOSEST), SMALLEST_GAP)
        closer = changed(scene, contact={"gap": float(f"{gap:.2g}")})
        return closer if before > SMALLEST_GAP else None
    # Without a section [contact] the gap stays: a new section would request a verdict.
    if term.name != "domain" or has_no_far_sides(scene):
        return None
    factor = float(np.ceil(10.0 * relative ** (-1.0 / DECAY))) / 10.0
    return farther(scene, min(factor, FARTHEST))
