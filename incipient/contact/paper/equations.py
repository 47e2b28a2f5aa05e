"""The paper's modified Coulomb friction at contacts with normals (n, 3) out of the grain.

Under the pressing force P, F_flow&g, F_tau of (6) or their sum, F_c = c_1 int (F_reaction +
F_friction) H(n . P) dGamma_c over a contact surface, with c_1 = c_2 / int H(n . P) dGamma_c = (n* .
P) / int (n . P)(n . n*) H dGamma_c from the balance of n* . P, n* the normal where P presses most;
c_2 = 1 on a plane.
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from incipient.arrays import Floats, cross
from incipient.geometry.contacts import Contacts, balance, coincident, nearest_motion


def pressing(force: Floats, normals: Floats) -> Floats:
    """Pressing force on each contact, max(n_out . F, 0), (n,)."""
    return np.maximum((normals * force).sum(axis=1), 0.0)


def tangential(force: Floats, normals: Floats) -> Floats:
    """F - (n . F) n, (n, 3)."""
    return force - (normals * force).sum(axis=1, keepdims=True) * normals


def reaction(force: Floats, normals: Floats) -> Floats:
    """Reaction of the bed, (31): (n_out . F) n_in H(n_out . F), (n, 3)."""
    return -pressing(force, normals)[:, None] * normals


def C_friction(force: Floats, normals: Floats, coefficient: float) -> Floats:
    """Mobilised fraction of friction, min {1, zeta (n_out . F) / |F - (n_out . F) n_out|}, (n,).

    One for sticking contacts, zero where a contact is not pressed.
    """
    press, along = pressing(force, normals), np.linalg.norm(tangential(force, normals), axis=1)
    limit = coefficient * press
    sticks = limit >= along
    mobilised = np.where(sticks, 1.0, limit / np.where(sticks, 1.0, along))
    return np.where(press > 0.0, mobilised, 0.0)


def friction(force: Floats, normals: Floats, coefficient: float) -> Floats:
    """Friction of the bed, (33): -C_friction [F - (n_out . F) n_out], (n, 3)."""
    return -C_friction(force, normals, coefficient)[:, None] * tangential(force, normals)


def equal_fractions(points: Floats, normals: Floats) -> Floats:
    """Equal fractions (k,) that sum to one; coincident contacts with equal normals share one."""
    # Coordinates of judged cases are rounded.
    fractions = 1.0 / coincident(points, normals, 1e-9 * np.abs(points).max(), 1e-9).sum(axis=1)
    return np.asarray(fractions / fractions.sum())


def can_vanish(torques: Floats, tolerance: float) -> bool:
    """Whether fractions exist for which the sum of `torques` (k, 3) vanishes to `tolerance`."""
    size = max(float(np.abs(torques).max()), tolerance)
    rows = np.column_stack([torques / size, np.ones(len(torques))])
    _, fractions = balance(rows, np.array([0.0, 0.0, 0.0, -1.0]))
    return bool(np.abs(fractions @ torques).max() <= tolerance * fractions.sum())


@dataclass(frozen=True, eq=False)
class Distribution:
    """Reaction and friction of the whole contact surface under a pressing force P.

    Forces act on the grain. `c_1` and `c_2` are 0 where nothing is pressed, NaN where no scale
    exists: the reactions elsewhere press x* as hard as its own relieves it.
    """

    surface: tuple[int, ...]  # contacts of n*, the greatest n . P
    measure: Floats  # dGamma_c, (n,): areas, or one per point of contact
    pertinent_area: float  # int H dGamma_c
    c_1: float
    c_2: float
    C_friction: Floats  # (n,)
    reaction: Floats  # (n, 3)
    friction_force: Floats  # (n, 3)
    force: Floats  # F_c, (3,)
    torque: Floats  # tau_c about the centre, (3,)
    unbalanced: Floats  # n . P less the reactions at pressed contacts, (n,); 0 at n*


def distribute(
    pressing: Floats, contacts: Contacts, arms: Floats, friction: float, tolerance: float
) -> Distribution:
    """Distribute the reaction to a pressing force P (3,) over the contacts, with arms x - c (n, 3).

    Contacts whose n . P is within `tolerance` (a force) of the greatest share n* equally.
    """
    normals, measure = contacts.normals, measures(contacts)
    toward = (normals * pressing).sum(axis=1)
    at = np.flatnonzero(toward >= toward.max() - tolerance).tolist()
    pressed = np.where(toward > tolerance, toward, 0.0)
    c_1 = _scale(
        pressed, normals, measure, at, equal_fractions(contacts.points[at], normals[at]), tolerance
    )
    held = C_friction(pressing, normals, friction) * (pressed > 0.0)
    reaction = -(c_1 * measure * pressed)[:, None] * normals
    along = -(c_1 * measure * held)[:, None] * tangential(pressing, normals)
    area = float(measure[pressed > 0.0].sum())
    return Distribution(
        surface=tuple(at),
        measure=measure,
        pertinent_area=area,
        c_1=c_1,
        c_2=c_1 * area,
        C_friction=held,
        reaction=reaction,
        friction_force=along,
        force=(reaction + along).sum(axis=0),
        torque=cross(arms, reaction + along).sum(axis=0),
        unbalanced=np.where(pressed > 0.0, toward + normals @ reaction.sum(axis=0), 0.0),
    )


def measures(contacts: Contacts) -> Floats:
    """Weights dGamma_c (n,): areas if all contacts have one, otherwise one per distinct contact."""
    if contacts.areas is not None and (contacts.areas > 0.0).all():
        return contacts.areas
    fractions = equal_fractions(contacts.points, contacts.normals)
    return np.asarray(fractions / fractions.max())


def _scale(
    pressed: Floats,
    normals: Floats,
    measure: Floats,
    at: list[int],
    fraction: Floats,
    tolerance: float,
) -> float:
    """c_1 from the balance of n* . P, or of the mean of several n*."""
    if not pressed[at].all():
        return 0.0
    wanted = float(fraction @ pressed[at])
    answered = (measure * pressed) @ (normals @ normals[at].T) @ fraction
    smallest = 1e-9 * float(measure.max()) * max(wanted, tolerance)
    return wanted / float(answered) if answered > smallest else float("nan")


# Rotation about an axis through p along a moves contact x into the bed at the rate a . ((x - p) ^ n), its lever; the
# rotation is away from the surface if all levers are negative (Fig. 4).


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
    if (length <= 1e-12).any():  # a normal parallel to the axis
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
