"""Forces that contacts can exert on a rigid grain, and the motions that they leave free.

Motions and loads are rows: translation (force), then rotation (torque) about the centre, with `size` as unit of
length; in 2-D 3 components, in 3-D 6.
"""

from dataclasses import dataclass

import numpy as np

from incipient.arrays import Floats, cross, planar_cross, unit
from incipient.geometry.contacts import tangents

BALANCED = 1e-12  # of the load: what remains of it that is nothing, and what a generator gains that is none


@dataclass(frozen=True, eq=False)
class Hold:
    """Contact forces that balance a load (n,) as far as friction allows.

    `rows` (m, n), each of the contact `owner` (m,), are combined with nonnegative `factors` (m,). `remainder` (n,) is
    the unbalanced part, the direction in which the load moves the grain.
    """

    rows: Floats
    owner: np.ndarray
    factors: Floats
    remainder: Floats


def wrenches(forces: Floats, arms: Floats, size: float) -> Floats:
    """Forces (m, d) at arms (m, d) from the centre with their torques, (m, 3 or 6)."""
    torque = planar_cross(arms, forces)[:, None] if forces.shape[1] == 2 else cross(arms, forces)
    return np.hstack([forces, torque / size])


def hold(load: Floats, normals: Floats, arms: Floats, friction: float, size: float) -> Hold:
    """Balance a load (n,) by forces within the friction cones of contacts (k,); friction may be 0 or infinite.

    Cones in 3-D are exact: the generators that oppose the remainder most are added until none reduces it.
    """
    along = [sense * tangent for tangent in tangents(normals) for sense in (1.0, -1.0)]
    if friction == 0.0:
        forces = [normals]
    elif np.isinf(friction):
        forces = [normals, *along]
    else:
        forces = [normals + friction * side for side in along]
    each = np.arange(len(normals))
    rows = np.vstack([wrenches(force, arms, size) for force in forces])
    owner = np.tile(each, len(forces))
    remainder, factors = balance(rows, load)
    round_cones = len(forces) == 4 and len(normals) > 0
    for _ in range(60 if round_cones else 0):
        velocity = remainder[:3] + cross(remainder[3:], arms) / size
        velocity -= (velocity * normals).sum(axis=1, keepdims=True) * normals
        opposing = wrenches(normals - friction * unit(velocity), arms, size)
        small = np.abs(remainder).max() <= BALANCED * np.abs(load).max()
        if small or (opposing @ remainder).min() >= -BALANCED:
            break
        rows, owner = np.vstack([rows, opposing]), np.append(owner, each)
        remainder, factors = balance(rows, load)
    return Hold(rows, owner, factors, remainder)


def balance(rows: Floats, load: Floats) -> tuple[Floats, Floats]:
    """The smallest unbalanced part (n,) of a load (n,) under forces along rows (m, n), and their factors (m,).

    The unbalanced part enters no contact.
    """
    if len(rows) == 0:
        return load, np.empty(0)
    factors = _least_squares(rows.T, -load)
    return load + factors @ rows, factors


def nearest_motion(rows: Floats, least: Floats, wish: Floats) -> Floats:
    """The motion (n,) closest to a wish (n,) with rows @ motion >= least (m,), least <= 0.

    Least distance programming (Lawson and Hanson 1974, chapter 23).
    """
    if len(rows) == 0:
        return wish
    levels = least - rows @ wish
    system = np.vstack([rows.T, levels])
    target = np.zeros(len(system))
    target[-1] = 1.0
    factors = _least_squares(system, target)
    residual = system @ factors - target
    return np.asarray(wish - residual[:-1] / min(residual[-1], -1e-300))


def _least_squares(system: Floats, target: Floats) -> Floats:
    from scipy.optimize import nnls

    factors, _ = nnls(system, target, maxiter=50 * max(system.shape))
    return np.asarray(factors)
