"""The paper's modified Coulomb friction over a general contact surface Gamma_c, with its scales c_1 and c_2.

    F_c   = c_1 int (F_reaction + F_friction) H(n . P) dGamma_c
    tau_c = c_1 int r ^ (F_reaction + F_friction) H(n . P) dGamma_c,    c_1 = c_2 / int H(n . P) dGamma_c

P is the force that presses at each place: F_flow&g in the print, F_tau of (6) for a couple, or their sum. One
scale serves the whole surface, fixed by the normal n* where P presses most: the reactions balance n* . P there,
c_1 = (n* . P) / int (n . P)(n . n*) H dGamma_c. On a plane under a force that gives c_2 = 1, the ordinary law.
"""

from dataclasses import dataclass

import numpy as np

from incipient.arrays import Floats
from incipient.contact.paper import friction as coulomb
from incipient.contact.paper.sharing import equal_shares
from incipient.geometry.contacts import Contacts


@dataclass(frozen=True, eq=False)
class Distribution:
    """Reaction and friction that one pressing force calls up all over the contact surface.

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
    couple: Floats  # tau_c about the centre, (3,)
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
        pressed, normals, measure, at, equal_shares(contacts.points[at], normals[at]), tolerance
    )
    held = coulomb.C_friction(pressing, normals, friction) * (pressed > 0.0)
    reaction = -(c_1 * measure * pressed)[:, None] * normals
    along = -(c_1 * measure * held)[:, None] * coulomb.tangential(pressing, normals)
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
        couple=np.cross(arms, reaction + along).sum(axis=0),
        unbalanced=np.where(pressed > 0.0, toward + normals @ reaction.sum(axis=0), 0.0),
    )


def measures(contacts: Contacts) -> Floats:
    """dGamma_c of every contact, (n,): its area where all have one, else one for each place of contact.

    Contacts at one place with one normal have a weight of one between them.
    """
    if contacts.areas is not None and (contacts.areas > 0.0).all():
        return contacts.areas
    shares = equal_shares(contacts.points, contacts.normals)
    return np.asarray(shares / shares.max())


def _scale(
    pressed: Floats,
    normals: Floats,
    measure: Floats,
    at: list[int],
    share: Floats,
    tolerance: float,
) -> float:
    """c_1, from the balance of n* . P; where several n* share, from that of their mean."""
    if not pressed[at].all():
        return 0.0
    wanted = float(share @ pressed[at])
    answered = (measure * pressed) @ (normals @ normals[at].T) @ share
    smallest = 1e-9 * float(measure.max()) * max(wanted, tolerance)
    return wanted / float(answered) if answered > smallest else float("nan")
