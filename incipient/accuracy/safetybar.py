"""What errors of force and couple mean for the verdict: the range of safety factors, and what is certain within it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..arrays import Floats
from ..contact import Contacts, Load
from ..contact.robustness import ErrorBox, SafetyRange, safety_range
from ..contact.verdict import Exact, MassAndInertia, judged
from ..evaluation.contact_verdict import load_of, mass_and_inertia
from ..results.loads import Couples, Forces
from ..results.safetybar import SafetyBar
from ..scene import Scene

# Errors (6,) of force and couple by the name of what they come from.
Errors = Mapping[str, Floats]
# What the exact judge is asked about: load, contacts, friction, mass and inertia.
JudgedCase = tuple[Load, Contacts, float, MassAndInertia | None]


def bar_of_scene(
    scene: Scene, contacts: Contacts, force: Forces, couple: Couples, errors: Errors
) -> SafetyBar | None:
    """The bar of a scene's grain under the loads computed; None where there is nothing to judge. Not collective."""
    if scene.contact is None or scene.body is None or scene.mass is None:
        return None
    load, inert = (
        load_of(scene.placement, force, couple),
        mass_and_inertia(scene.body, scene.placement),
    )
    return bar_of_safety(load, contacts, scene.contact.friction, inert, errors)


def bar_of_safety(
    load: Load,
    contacts: Contacts,
    friction: float,
    inert: MassAndInertia | None,
    errors: Errors,
) -> SafetyBar:
    """What is proved of all loads within the sum of the errors, by `safety_range`. Not collective."""

    def within(names: set[str]) -> SafetyRange:
        """What the loads in the box of the terms named have in common."""
        box = ErrorBox.of(sum((errors[name] for name in sorted(names)), np.zeros(6)))
        return safety_range(load, contacts, friction, box)

    found = within(set(errors))
    widths = {name: within(set(errors) - {name}).width for name in errors}
    case = load, contacts, friction, inert
    exact = judged(*case)
    modes, complete = _modes(case, found, exact)
    value = exact.safety.value
    return SafetyBar(
        value=value,
        low=min(found.low, value),
        high=max(found.high, value),
        certain=found.rests or found.moves,
        modes=modes,
        complete=complete,
        decisive=min(widths, key=lambda name: widths[name], default=""),
        some=found.possible,
        every=found.guaranteed,
    )


def _modes(case: JudgedCase, found: SafetyRange, exact: Exact) -> tuple[tuple[str, ...], bool]:
    """What loads of the box do, and whether that is all they can do."""
    if found.rests:
        return ("rest",), True
    worst = judged(found.worst, *case[1:])
    labels = [exact.label, worst.label] + ([] if found.moves else ["rest"])
    return tuple(dict.fromkeys(labels)), False
