"""Contacts and stability of a moving grain that has met the bed or rests on it.

Contacts are the points within `contact.gap`; both criteria use the loads of that moment,
including the fluid's resistance to the motion.
"""

from __future__ import annotations

import math
from typing import Any

from ..arrays import Floats
from ..body.state import BodyState
from ..contact import Contacts
from ..contact.safety import safety_factor
from ..coupled.grain_on_bed import REST
from ..errors import IncipientError, SceneError, refuse_broken
from ..scene import Contact
from ..setup.geometry import Clearance
from ..setup.setup import Setup
from .loads import load_of, standing, verdict_on

# Largest distance of other contacts relative to that at which the grain has met the bed.
FARTHER = 1.01


def landing(
    setup: Setup, state: BodyState, met: Clearance, load: Floats, does: str = ""
) -> tuple[Contacts | None, dict[str, Any] | None, str]:
    """Contacts and verdict as plain data of a grain under a load (6,) that has met a boundary, or rests or moves there.

    Either may be None; the last value is the reason for a missing verdict.
    """
    scene, bed, stands = setup.scene, setup.sides.bottom, does == REST
    contacts = None
    try:
        refuse_broken(
            (does and not stands, f"the grain moves: {does}"),
            (met.other != bed, f"the grain met the {met.other}, which is not the bed"),
        )
        contacts = contacts_at(setup, state, met.distance)
        body = scene.body
        refuse_broken(
            (scene.contact is None, "it needs a section [contact] with a friction"),
            (scene.effects.contact is False, "effects.contact is false"),
            (scene.mass is None, "it needs body.density or body.mass"),
            (
                body is not None and bool(body.locked),
                "body.locked holds motions of the grain, which contacts do not",
            ),
        )
        acting = load_of(scene, load, state.placement)
        verdict = verdict_on(scene, contacts, acting, state.placement).to_dict()
    except IncipientError as error:
        return contacts, None, str(error)
    where = "it is" if stands else f"it met the {bed}"
    supposed = f"at rest where {where}, under the loads at the end of the run"
    verdict |= {"supposed": supposed, "sentence": f"{supposed}, {verdict['sentence']}"}
    if stands and scene.contact is not None:
        factor = _factor_where_it_touches(setup, state, contacts, load)
        verdict |= {"touching_factor": factor, "note": _left_open(scene.contact, factor)}
    else:
        verdict["note"] = (
            "no error bar of the safety factor: it is that of the load at one moment, and how that load depends on gap "
            "and time step is not estimated; the load at the end holds the fluid's resistance to the grain's motion; "
            f"for a grain that has come to rest run a scene with {standing(state.placement)} instead of centre and "
            "motion"
        )
    return contacts, verdict, ""


def _factor_where_it_touches(
    setup: Setup, state: BodyState, contacts: Contacts, load: Floats
) -> float | None:
    """Safety factor under the same load with the contact gap closed, or None."""
    scene, near = setup.scene, setup.scene.near_bed
    assert scene.contact is not None
    placement = near.with_gap(state.placement, 0.0, contacts.points, scene.contact_gap)
    try:
        closed = near.contacts(placement, scene.contact_tolerance)
        factor = safety_factor(load_of(scene, load, placement), closed, scene.contact.law)
    except IncipientError:
        return None
    return factor.value if math.isfinite(factor.value) else None


def _left_open(contact: Contact, factor: float | None) -> str:
    where = f"without the gap at which contact acts, {contact.gap:g} of its size"
    said = [] if factor is None else [f"{where}, the safety factor is {factor:.4g}"]
    if contact.rolling_resistance:
        said.append(
            "contact.rolling_resistance, which also holds the grain, is not in the safety factor"
        )
    said.append(
        "no error bar of the safety factor: for one run a steady scene of the grain at rest"
    )
    return "; ".join(said)


def contacts_at(setup: Setup, state: BodyState, distance: float) -> Contacts:
    """Contacts of a grain with the bed at a `distance` [length]. Raises SceneError without any."""
    reach = FARTHER * max(distance, setup.scene.contact_gap)
    try:
        return setup.scene.near_bed.contacts(state.placement, reach)
    except IncipientError as error:
        raise SceneError(
            f"the contacts where the grain met the {setup.sides.bottom} were not computed: {error}"
        ) from error
