"""Contacts and stability of a moving grain that has met the bed or rests on it.

Contacts are the points within `contact.gap`; both criteria use the loads of that moment,
including the fluid's resistance to the motion.
"""

from __future__ import annotations

import math
from typing import Any

from ..body.state import BodyState
from ..contact import Contacts
from ..contact.safety import safety_factor
from ..coupled.grain_on_bed import REST
from ..errors import IncipientError
from ..geometry.closest import touching
from ..results.contact_verdict import load_of, standing
from ..results.loads import Forces, Torques
from ..scene.sections import Contact
from ..setup.geometry import Clearance
from ..setup.setup import Setup
from .loads import verdict_of

# Largest distance of other contacts relative to that at which the grain has met the bed.
FARTHER = 1.01
SUPPOSED = "at rest where it met the {bed}, under the loads at the end of the run"
STANDS = "at rest where it is, under the loads at the end of the run"
AT_REST = "no error bar of the safety factor: for one run a steady scene of the grain at rest"
ROLLING = "contact.rolling_resistance, which also holds the grain, is not in the safety factor"


def landing(
    setup: Setup, state: BodyState, met: Clearance, force: Forces, torque: Torques, does: str = ""
) -> tuple[Contacts | None, dict[str, Any] | None, str]:
    """Contacts and verdict as plain data of a grain that has met a boundary, or rests or moves there.

    Either may be None; the last value is the reason for a missing verdict.
    """
    scene, bed, stands = setup.scene, setup.sides.bottom, does == REST
    if does and not stands:
        return None, None, f"the grain moves: {does}"
    if met.other != bed:
        return None, None, f"the grain met the {met.other}, which is not the bed"
    try:
        contacts = contacts_at(setup, state, met.distance)
    except IncipientError as error:
        why_not = f"the contacts where the grain met the {bed} were not computed: {error}"
        return None, None, why_not
    if why_not := _missing(setup):
        return contacts, None, why_not
    assert scene.contact is not None
    try:
        verdict = verdict_of(scene, state.placement, contacts, force, torque)
    except IncipientError as error:
        return contacts, None, str(error)
    verdict["supposed"] = STANDS if stands else SUPPOSED.format(bed=bed)
    verdict["sentence"] = f"{verdict['supposed']}, {verdict['sentence']}"
    if not stands:
        return contacts, verdict | {"note": _note(state)}, ""
    factor = _factor_where_it_touches(setup, state, contacts, (force, torque))
    verdict |= {"note": _left_open(scene.contact, factor), "touching_factor": factor}
    return contacts, verdict, ""


def _factor_where_it_touches(
    setup: Setup, state: BodyState, contacts: Contacts, loads: tuple[Forces, Torques]
) -> float | None:
    """Safety factor under the same load with the contact gap closed, or None."""
    scene, geometry = setup.scene, setup.geometry
    assert scene.contact is not None
    placement = geometry.near_bed.with_gap(state.placement, 0.0, contacts.points, scene.contact_gap)
    try:
        closed = touching(scene.grain, placement, geometry.near_bed.bed, scene.contact_tolerance)
        factor = safety_factor(load_of(placement, *loads), closed, scene.contact.law)
    except IncipientError:
        return None
    return factor.value if math.isfinite(factor.value) else None


def _left_open(contact: Contact, factor: float | None) -> str:
    where = f"without the gap at which contact acts, {contact.gap:g} of its size"
    said = [] if factor is None else [f"{where}, the safety factor is {factor:.4g}"]
    said += [ROLLING] if contact.rolling_resistance else []
    return "; ".join([*said, AT_REST])


def _note(state: BodyState) -> str:
    return (
        "no error bar of the safety factor: it is that of the load at one moment, and how that load depends on gap and "
        "time step is not estimated; the load at the end holds the fluid's resistance to the grain's motion; for a "
        f"grain that has come to rest run a scene with {standing(state.placement)} instead of centre and motion"
    )


def _missing(setup: Setup) -> str:
    scene = setup.scene
    needs = (
        (scene.contact is not None, "it needs a section [contact] with a friction"),
        (scene.effects.contact is not False, "effects.contact is false"),
        (scene.mass is not None, "it needs body.density or body.mass"),
        (
            scene.body is None or not scene.body.locked,
            "body.locked holds motions of the grain, which contacts do not",
        ),
    )
    return next((why for met, why in needs if not met), "")


def contacts_at(setup: Setup, state: BodyState, distance: float) -> Contacts:
    """Contacts of a grain with the bed at a `distance` [length]. Raises SceneError without any."""
    near, gap = setup.geometry.near_bed, setup.scene.contact_gap
    return touching(near.grain, state.placement, near.bed, FARTHER * max(distance, gap))
