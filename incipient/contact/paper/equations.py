"""The paper's modified Coulomb friction, its sharing among contacts, and its distribution over a contact surface.

Arrays are rows of contacts: normals (n, 3) out of the grain, forces (3,) or (n, 3), one for each contact. A contact
answers only where the force presses the grain onto it, n . F > 0: the Heaviside factor H of the paper. Over a general
contact surface Gamma_c

    F_c   = c_1 int (F_reaction + F_friction) H(n . P) dGamma_c
    tau_c = c_1 int r ^ (F_reaction + F_friction) H(n . P) dGamma_c,    c_1 = c_2 / int H(n . P) dGamma_c

P is the force that presses at each place: F_flow&g in the print, F_tau of (6) for a torque, or their sum. One
scale serves the whole surface, fixed by the normal n* where P presses most: the reactions balance n* . P there,
c_1 = (n* . P) / int (n . P)(n . n*) H dGamma_c. On a plane under a force that gives c_2 = 1, the ordinary law.
"""

from dataclasses import dataclass

import numpy as np

from incipient.arrays import Floats, cross
from incipient.contact.friction import FrictionCone
from incipient.geometry.contacts import Contacts
from incipient.geometry.statics import balance

SAME_PLACE = 1e-9  # of the size of the contact surface


def pressing(force: Floats, normals: Floats) -> Floats:
    """n_out . F where positive, otherwise zero: the force that presses on each contact, (n,)."""
    return np.maximum((normals * force).sum(axis=1), 0.0)


def tangential(force: Floats, normals: Floats) -> Floats:
    """F - (n . F) n: the part of the force along each contact, (n, 3)."""
    return force - (normals * force).sum(axis=1, keepdims=True) * normals


def reaction(force: Floats, normals: Floats) -> Floats:
    """(31): (n_out . F) n_in H(n_out . F), the force (n, 3) of the bed on the grain along the normals."""
    return -pressing(force, normals)[:, None] * normals


def C_friction(force: Floats, normals: Floats, coefficient: float) -> Floats:
    """min {1, zeta (n_out . F) / |F - (n_out . F) n_out|}, (n,): the fraction of friction mobilised.

    One where the contact is pressed and sticks, less where it slips, zero where it is not pressed.
    """
    press, along = pressing(force, normals), np.linalg.norm(tangential(force, normals), axis=1)
    return np.where(press > 0.0, FrictionCone.of(coefficient).mobilised(press, along), 0.0)


def friction(force: Floats, normals: Floats, coefficient: float) -> Floats:
    """(33): -C_friction [F - (n_out . F) n_out], the friction (n, 3) of the bed on the grain."""
    return -C_friction(force, normals, coefficient)[:, None] * tangential(force, normals)


def equal_fractions(points: Floats, normals: Floats) -> Floats:
    """Equal fractions (k,) that sum to one; contacts at one place with one normal count as one between them."""
    size = max(float(np.ptp(points, axis=0).max()), float(np.abs(points).max()), 1e-300)
    apart = np.abs(points[:, None] - points[None]).max(axis=2) > SAME_PLACE * size
    turned = np.abs(normals[:, None] - normals[None]).max(axis=2) > SAME_PLACE
    fractions = 1.0 / (~(apart | turned)).sum(axis=1)
    return np.asarray(fractions / fractions.sum())


def can_vanish(torques: Floats, tolerance: float) -> bool:
    """Whether some sharing makes the sum of fractions times `torques` (k, 3) vanish to `tolerance`.

    True if the origin lies in their convex hull.
    """
    size = max(float(np.abs(torques).max()), tolerance)
    rows = np.column_stack([torques / size, np.ones(len(torques))])
    _, fractions = balance(rows, np.array([0.0, 0.0, 0.0, -1.0]))
    return bool(np.abs(fractions @ torques).max() <= tolerance * fractions.sum())


@dataclass(frozen=True, eq=False)
class Distribution:
    """Reaction and friction of the whole contact surface under one pressing force.

    Arrays have one row a contact. Contact forces act on the grain and carry c_1 and their part of the surface.
    `c_1` and `c_2` are 0 where nothing is pressed, and not a number where no single scale exists: the
    reactions elsewhere then press x* as hard as its own relieves it.
    """

    pressing: Floats  # P, (n, 3)
    surface: tuple[int, ...]  # where n . P is greatest: n* of the scale
    measure: Floats  # dGamma_c, (n,): areas, or a weight of one for each place of contact
    pertinent_area: float  # int H dGamma_c
    c_1: float
    c_2: float
    C_friction: Floats  # (n,)
    reaction: Floats  # (n, 3)
    friction_force: Floats  # (n, 3)
    force: Floats  # F_c, (3,)
    torque: Floats  # tau_c about the centre, (3,)
    unbalanced: (
        Floats  # n . P less what the reactions balance of it at pressed contacts, (n,); 0 at n*
    )


def distribute(
    pressing: Floats, contacts: Contacts, arms: Floats, friction: float, tolerance: float
) -> Distribution:
    """Spread the answer to `pressing` (n, 3) over the contacts; `arms` (n, 3) are x - c.

    Contacts whose n . P is within `tolerance` (a force) of the greatest share equally in n*.
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
        pressing=pressing,
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
    """dGamma_c of every contact, (n,): its area where all have one, otherwise one for each point of contact.

    Contacts at one place with one normal have a weight of one between them.
    """
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
    """c_1, from the balance of n* . P; where several n* share, from that of their mean."""
    if not pressed[at].all():
        return 0.0
    wanted = float(fraction @ pressed[at])
    answered = (measure * pressed) @ (normals @ normals[at].T) @ fraction
    smallest = 1e-9 * float(measure.max()) * max(wanted, tolerance)
    return wanted / float(answered) if answered > smallest else float("nan")
