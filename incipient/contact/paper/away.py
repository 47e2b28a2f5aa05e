"""Rotations ``away from the surface'': axes that contact normals exclude (the paper's Fig. 4).

Rotation about an axis through p along a moves contact x into the bed at the rate a . ((x - p) ^ n),
its lever; the rotation is away from the surface if all levers are negative.
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from incipient.arrays import Floats, cross
from incipient.geometry.contacts import Contacts
from incipient.geometry.statics import nearest_motion

PARALLEL = 1e-12  # sine of the angle between a normal and a parallel axis


class Axis(Enum):
    """Effect of the contact normals on an axis, for one sense of rotation."""

    AWAY = "no normal meets or encircles it and every contact is left"
    INTERSECTED = "a normal meets it: that contact slides, the others are left"
    ENCIRCLED = (
        "normals to the contact surface can be drawn around it: some contact is pressed either way"
    )
    PRESSED = (
        "no contact is left and some are pressed: only the opposite turn is away from the surface"
    )


@dataclass(frozen=True, eq=False)
class Away:
    """Condition on the axis through the centre of mass along the torque, and the nearest admissible axis.

    `levers` (n,): lengths, negative where the contact opens. `nearest` (3,): pivot by the principle of least
    action; None, at infinite `distance`, if all axes are excluded.
    """

    direction: Floats
    levers: Floats
    axis: Axis
    nearest: Floats | None
    distance: float


def levers(points: Floats, direction: Floats, contacts: Contacts) -> Floats:
    """Levers (k, n) of all contacts for axes through `points` (k, 3) along a unit vector (3,)."""
    about_origin = cross(contacts.points, contacts.normals) @ direction
    return np.asarray(about_origin[None] - points @ cross(contacts.normals, direction).T)


def away(contacts: Contacts, centre: Floats, direction: Floats, tolerance: float) -> Away:
    """Test the axis through `centre` along the unit vector `direction`; `tolerance` is a length."""
    about_centre = levers(centre[None], direction, contacts)[0]
    nearest = nearest_axis(contacts, centre, direction, tolerance)
    return Away(
        direction=direction,
        levers=about_centre,
        axis=_kind(about_centre, tolerance),
        nearest=nearest,
        distance=float("inf") if nearest is None else float(np.linalg.norm(nearest - centre)),
    )


def nearest_axis(
    contacts: Contacts, centre: Floats, direction: Floats, tolerance: float
) -> Floats | None:
    """Point (3,) nearest to the centre with an admissible axis along `direction`, or None; `tolerance` is a length."""
    inward = cross(contacts.normals, direction)
    length = np.linalg.norm(inward, axis=1)
    if (length <= PARALLEL).any():
        return None  # that contact slides about every such axis
    edge = levers(centre[None], direction, contacts)[0] / length + 2.0 * tolerance
    inward, size = inward / length[:, None], float(np.abs(edge).max()) or 1.0
    nearest = size * nearest_motion(inward, edge / size, np.zeros(3))
    if (inward @ nearest < edge - tolerance).any():
        return None
    return np.asarray(centre if nearest @ nearest <= (8.0 * tolerance) ** 2 else centre + nearest)


def _kind(levers_of_one: Floats, tolerance: float) -> Axis:
    pressed, left = levers_of_one > tolerance, levers_of_one < -tolerance
    if pressed.any():
        return Axis.ENCIRCLED if left.any() else Axis.PRESSED
    return Axis.AWAY if left.all() else Axis.INTERSECTED
