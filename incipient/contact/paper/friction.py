"""The paper's modified Coulomb friction: what a contact with outward normal n answers to a force.

Arrays are rows of contacts: normals (n, 3) out of the grain, forces (3,) or (n, 3), one for each contact. A
contact answers only where the force presses the grain onto it, n . F > 0: the Heaviside factor H of the
paper.
"""

import numpy as np

from incipient.arrays import Floats
from incipient.contact.friction_law import FrictionLaw


def pressing(force: Floats, normals: Floats) -> Floats:
    """n_out . F where it is positive, else zero: how hard the force presses on each contact, (n,)."""
    return np.maximum((normals * force).sum(axis=1), 0.0)


def tangential(force: Floats, normals: Floats) -> Floats:
    """F - (n . F) n: the part of the force along each contact, (n, 3)."""
    return force - (normals * force).sum(axis=1, keepdims=True) * normals


def reaction(force: Floats, normals: Floats) -> Floats:
    """(31): (n_out . F) n_in H(n_out . F), the force (n, 3) of the bed on the grain along the normals."""
    return -pressing(force, normals)[:, None] * normals


def C_friction(force: Floats, normals: Floats, coefficient: float) -> Floats:
    """min {1, zeta (n_out . F) / |F - (n_out . F) n_out|}, (n,): the share of friction.

    One where the contact is pressed and sticks, less where it slips, zero where it is not pressed.
    """
    press, along = pressing(force, normals), np.linalg.norm(tangential(force, normals), axis=1)
    return np.where(press > 0.0, FrictionLaw(coefficient).share(press, along), 0.0)


def friction(force: Floats, normals: Floats, coefficient: float) -> Floats:
    """(33): -C_friction [F - (n_out . F) n_out], the friction (n, 3) of the bed on the grain."""
    return -C_friction(force, normals, coefficient)[:, None] * tangential(force, normals)
