"""What errors of force and couple mean for the verdict: the range of safety factors, and what is certain within it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats
from ..contact import Contacts, Load
from ..contact.exact.judge import Exact, MassAndInertia, judged
from ..contact.exact.planar_modes import modes_within
from ..contact.loads.error_box import ErrorBox, SafetyRange, safety_range
from ..evaluation.contact_verdict import load_of, mass_and_inertia
from ..results.loads import Couples, Forces
from ..results.safetybar import SafetyBar
from ..scene import Scene

if TYPE_CHECKING:
    from ..results.errorbars import Term

# Errors (6,) of force and couple by the name of what they come from.
Errors = Mapping[str, Floats]
# What the exact judge is asked about: load, contacts, friction, mass and inertia.
JudgedCase = tuple[Load, Contacts, float, MassAndInertia | None]


def bar_of_scene(
    scene: Scene, contacts: Contacts, force: Forces, couple: Couples, errors: Errors, *terms: Term
) -> SafetyBar | None:
    """The bar of a scene's grain under the loads computed; None where there is nothing to judge. Not collective.

    `terms` are those of `errors` that change the safety factor at the same load.
    """
    if scene.contact is None or scene.body is None or scene.mass is None:
        return None
    load, inert = (
        load_of(scene.placement, force, couple),
        mass_and_inertia(scene.body, scene.placement),
    )
    return bar_of_safety(load, contacts, scene.contact.friction, inert, errors, *terms)


def bar_of_safety(
    load: Load,
    contacts: Contacts,
    friction: float,
    inert: MassAndInertia | None,
    errors: Errors,
    *terms: Term,
) -> SafetyBar:
    """What is proved of all loads within the sum of the errors, by `safety_range`. Not collective.

    `terms` are those of `errors` that change the safety factor at the same load.
    """

    def within(names: set[str]) -> tuple[ErrorBox, SafetyRange]:
        """The box of the terms named, and what the loads in it have in common."""
        box = ErrorBox.of(sum((errors[name] for name in sorted(names)), np.zeros(6)))
        ratio = math.prod(term.ratio for term in terms if term.name in names)
        return box, safety_range(load, contacts, friction, box).widened(ratio)

    box, found = within(set(errors))
    widths = {name: within(set(errors) - {name})[1].width for name in errors}
    case = load, contacts, friction, inert
    exact = judged(*case)
    modes, complete = _modes(case, box, found, exact)
    if not found.rests:
        others = dict.fromkeys(mode for term in terms for mode in term.modes)
        complete = complete and others.keys() <= set(modes)
        modes = tuple(dict.fromkeys([*modes, *others]))
    value = exact.safety.value
    return SafetyBar(
        value=value,
        low=min(found.low, value),
        high=max(found.high, value),
        certain=found.rests or found.moves,
        modes=modes,
        complete=complete,
        decisive=min(widths, key=lambda name: widths[name], default=""),
        some=found.some,
        every=found.every,
    )


def _modes(
    case: JudgedCase, box: ErrorBox, found: SafetyRange, exact: Exact
) -> tuple[tuple[str, ...], bool]:
    """What loads of the box do, and whether that is all they can do."""
    load, contacts, friction, inert = case
    if found.rests:
        return ("rest",), True
    if found.moves and inert is not None:
        proved = modes_within(load, contacts, friction, box.ways, *inert)
        if proved:
            return tuple(mode.label for mode in proved), True
    worst = judged(found.worst, contacts, friction, inert)
    labels = [exact.label, worst.label] + ([] if found.moves else ["rest"])
    return tuple(dict.fromkeys(labels)), False
