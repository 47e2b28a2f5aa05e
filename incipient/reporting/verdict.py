"""The sections of a page that every verdict has: forces at the contacts, and what both judges say."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..pictures.judged import Judged, pressed, sentence
from ..pictures.style import STATES
from .page import Cell, PageSection, Rows, section, table, words

AXES = ("x", "y", "z")


def components(vector: Sequence[float] | np.ndarray, planar: bool) -> tuple[float, ...]:
    """The components of a vector (3,) that are shown."""
    return tuple(float(one) for one in vector[: 2 if planar else 3])


def turning(couple: Sequence[float] | np.ndarray, planar: bool) -> Cell:
    """A couple (3,), in the plane its one component."""
    return float(couple[2]) if planar else components(couple, planar)


def of_contacts(case: Judged) -> tuple[PageSection, ...]:
    """Where the grain touches, and with what force."""
    contacts, planar = case.contacts, case.planar
    normal, along = pressed(case.forces, contacts.normals)
    rows: Rows = []
    for index, state in enumerate(case.states):
        place = components(contacts.points[index], planar)
        outwards = components(contacts.normals[index], planar)
        force = float(normal[index]), float(along[index])
        rows.append((str(index + 1), place, outwards, *force, STATES[state][1]))
    head = (
        "contact",
        "where",
        "normal, out of the grain",
        "pressed by",
        "along the surface",
        "state",
    )
    return section("Contacts", words(f"Forces: {case.occasion}."), table(head, rows))


def of_judges(verdict: dict[str, Any], case: Judged) -> tuple[PageSection, ...]:
    """What exact mechanics and the paper's criteria say, and whether they agree."""
    paper = verdict["judges"]["criteria"]
    planar = case.planar
    exact: Rows = [
        ("mode", case.mode),
        ("safety factor on the flow's load", case.safety_factor),
        ("coefficient of static friction", case.friction),
    ]
    if case.motion is not None:
        exact.append(("acceleration of the centre", components(case.motion.acceleration, planar)))
        exact.append(("angular acceleration", turning(case.motion.angular, planar)))
    force, couple = case.left
    printed: Rows = [
        ("row of its table", case.outcome),
        ("moves", bool(paper["moves"])),
        ("force left over", components(force, planar)),
        ("couple left over", turning(couple, planar)),
    ]
    explained = verdict["agreement"]["explanation"]
    agree = "Both judges agree" if verdict["agreement"]["agree"] else "The judges differ"
    return section(
        "Both judges",
        words(f"{agree}: {explained}." if explained else f"{agree}."),
        table(("exact mechanics", ""), exact),
        table(("the paper's criteria", ""), printed),
    )


def of_load(case: Judged) -> tuple[PageSection, ...]:
    """The load that is judged."""
    planar = case.planar
    rows: Rows = [(name, components(force, planar)) for name, force in case.acting.items()]
    rows.append(("couple about the centre of mass", turning(case.load.flow_couple, planar)))
    rows.append(("centre of mass", components(case.load.centre, planar)))
    return section("Load on the grain", table(("", "components"), rows))


def statements(case: Judged, verdict: dict[str, Any]) -> tuple[str, ...]:
    """The verdict in sentences, the exact judge's first."""
    note = sentence(verdict["note"]) if "note" in verdict else ""
    return tuple(filter(None, (*case.sentences, note)))
