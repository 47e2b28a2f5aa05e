"""Rotations ``away from the surface'': which axes contact normals exclude (the paper's Fig. 4).

A turn about an axis through p along the unit vector a moves the contact x with normal n into the bed at the rate
a . ((x - p) ^ n), the lever of the contact. The turn is away from the surface, without reaction or friction, if
all levers are negative. In 2-D the lever says on which side of a contact's normal the point p lies, so
points around which normals can be drawn, some to the left and some to the right, are excluded for both senses.
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from incipient.arrays import Floats, cross
from incipient.geometry.contacts import Contacts
from incipient.geometry.statics import nearest_motion

PARALLEL = 1e-12  # sine of the angle to the axis below which a normal is along it


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
    """The condition on the axis through the centre of mass along the torque, and the nearest axis that meets it.

    `levers` (n,) are lengths, negative where the turn takes the contact away. `nearest` (3,) is where, by the
    paper's principle of least action, the grain is presumed to turn instead: on the edge of the nearest
    region that no normal excludes, the centre itself if it may; None if normals exclude every axis along the
    torque. `distance` is how far that is from the centre, infinite for None.
    """

    direction: Floats
    levers: Floats
    axis: Axis
    nearest: Floats | None
    distance: float


def levers(points: Floats, direction: Floats, contacts: Contacts) -> Floats:
    """The levers (k, n) of all contacts for turns about axes through `points` (k, 3) along one direction (3,).

    A positive lever presses the contact. `direction` is a unit vector; its sign is the sense of the turn.
    """
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
    """The point (3,) nearest to the centre at which an axis along `direction` lies beyond no normal.

    The points allowed are an intersection of half-planes across `direction`, one for each contact. A region must be
    wider than `tolerance`, a length, so that beside its edge there are axes that no normal meets.
    """
    inward = cross(contacts.normals, direction)
    length = np.linalg.norm(inward, axis=1)
    if (length <= PARALLEL).any():
        return None  # that contact's normal is along the axis: it rubs wherever the axis is
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
