"""Gap and domain of a search for an accuracy with `numerics.accuracy_includes = "all"`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..results.errorbars import Term
from ..scene import Scene
from .coarse_runs import changed, farther
from .terms import DECAY, has_no_far_sides

AIM = 0.6  # fraction of the accuracy aimed at, as a margin
SHARE = 0.5  # of the accuracy, for gap and domain together
SMALLEST_GAP = 1e-4  # of the grain's size
CLOSEST, FARTHEST = 1 / 32, 3.0  # largest factors on gap and domain in one step
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


def irreducible(scene: Scene, name: str, error: float) -> str:
    """Why a term of the model stays too large."""
    remedy = ""
    if name == "datum":
        remedy = "; with inertia the effective height of the bed is not known more accurately"
        if getattr(scene.flow, "datum", "auto") not in ("auto", "effective"):
            remedy = '; flow.datum = "auto" reduces it'
    return f"the error of the {name}, {error:.1e}, cannot be reduced{remedy}"


def changes_of_the_model(scene: Scene, before: Scene) -> tuple[str, ...]:
    """Keys of gap and domain that differ, with both values."""
    changes = []
    for section in ("contact", "domain", "surface"):
        now, then = (dict(getattr(each, section) or ()) for each in (scene, before))
        for key in (key for key in then if now[key] != then[key]):
            value, old = (
                ", ".join(f"{x:.4g}" for x in np.ravel(each[key])) for each in (now, then)
            )
            changes.append(f"{section}.{key} = {value} instead of {old}")
    return tuple(changes)


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
