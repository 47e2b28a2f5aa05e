"""The errors of gap and domain, which no mesh reduces: what of the scene would make them small enough."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import numpy as np

from ..errors import SceneError
from ..results.errorbars import ErrorBars, Term
from ..scene import Scene
from ..scene.flows import Flow
from .coarse_runs import changed, farther
from .goal import Computed, Quantity, relative
from .next_mesh import AIM
from .terms import DECAY, has_no_far_sides

SMALLEST_GAP = 1e-4  # of the grain's size
CLOSEST, FARTHEST = 1 / 32, 3.0  # how much smaller a gap and larger a domain become at once
# Keys that change gap and domain, by section.
KEYS = {
    "contact": ("gap",),
    "domain": ("origin", "length", "width", "height"),
    "surface": ("sponge",),
}
LEAST = 1e-3  # to which fraction a term is sought to be lessened, at most


def remedies(
    scene: Scene, accuracy: float, goal: Quantity, computed: Computed, bars: ErrorBars
) -> tuple[str, ...]:
    """Remedies for errors of gap and domain that exceed an accuracy, in words. Not collective."""
    said = []
    for term in bars.terms:
        error = relative(goal, computed, term)
        if term.name == "discretisation" or error is None or error <= accuracy:
            continue
        remedy = _remedy(scene, term, accuracy / error)
        said.append(f"beside it the error of the {term.name}, {error:.1e}; {remedy}")
    return tuple(said)


def _remedy(scene: Scene, term: Term, relative: float) -> str:
    """Remedy that reduces a term to a fraction `relative` of it, in words."""
    if term.name == "datum":
        return _of_datum(scene.flow)
    better = None
    with suppress(SceneError):
        better = lessened(scene, term, AIM * relative, at_once=False)
    if better is None:
        return "it cannot be made small enough"
    return f"{', '.join(_changes(better, scene))} would do"


def _changes(scene: Scene, other: Scene) -> Iterator[str]:
    """The keys of gap and domain in which a scene differs from another, as they are set."""
    for section, names in KEYS.items():
        now, before = (getattr(each, section) for each in (scene, other))
        for name in names if now is not None else ():
            value = getattr(now, name)
            if value != getattr(before, name, value):
                numbers = [float(f"{x:.4g}") for x in value] if isinstance(value, tuple) else None
                yield f"{section}.{name} = {numbers or f'{value:.4g}'}"


def _of_datum(flow: Flow) -> str:
    if getattr(flow, "datum", "auto") in ("auto", "effective"):
        return "with inertia the effective height of the bed is not known better"
    return 'flow.datum = "auto" reduces it'


def lessened(scene: Scene, term: Term, relative: float, at_once: bool = True) -> Scene | None:
    """The scene in which a term is expected to be `relative` times what it is; None where that cannot be had.

    at_once: not all the way where that is far, since what is expected is then not worth much
    """
    relative = max(relative, LEAST)
    if term.name == "gap" and scene.contact is not None:
        smaller, before = relative ** (1.0 / term.power), scene.contact.gap
        gap = before * (max(smaller, CLOSEST) if at_once else smaller)
        if before <= SMALLEST_GAP or (gap < SMALLEST_GAP and not at_once):
            return None
        return changed(scene, contact={"gap": float(f"{max(gap, SMALLEST_GAP):.2g}")})
    # A gap without a section [contact] stays: a section of its own would call for a verdict.
    if term.name != "domain" or has_no_far_sides(scene):
        return None
    factor = float(np.ceil(10.0 * relative ** (-1.0 / DECAY))) / 10.0
    return farther(scene, min(factor, FARTHEST) if at_once else factor)
