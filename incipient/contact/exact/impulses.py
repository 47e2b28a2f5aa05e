"""Impulses at the contacts of a moving grain over a time step: Signorini's and Coulomb's laws on velocities.

With the local velocities u = W P + b of the grain at its contacts at the end of the step, (normal, two along the
surface) at each, and P the impulses there:

    0 <= u_N, 0 <= P_N, u_N P_N = 0,    |P_T| <= friction P_N, where u_T != 0 with equality and P_T against u_T

(Moreau 1988; Jean 1999, Comput. Methods Appl. Mech. Eng. 177, 235). W (3k, 3k) is what velocities gain by impulses, b
the velocities without any. The laws have the form of those for accelerations at the instant of release, and are solved
by the same Newton's method (`spatial_motion`).

Resistance to rolling is friction of the same form: a couple against the turn about the directions along the surface,
at most a coefficient times P_N (Ai, Chen, Rotter & Ooi 2011, Powder Technol. 206, 269, with a rigid spring).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import brentq

from incipient.arrays import Floats
from incipient.contact.exact.release import LARGEST
from incipient.contact.exact.spatial_motion import (
    PATIENCE,
    RANDOM_STARTS,
    Law,
    law_residual,
    newton,
)
from incipient.errors import ConvergenceError

GOOD = 1e-9  # what a solution may miss the laws by, in impulses of order one
EXACT = 1e-13  # the same where the laws are linear: what is held does not creep
FEW_SWEEPS, MANY_SWEEPS = 100, 5000  # of the iteration contact by contact
LEAST = 1e-9  # singular values, relative to the largest, that count as none
REGULAR = 1e-12  # added to the diagonal of W, relative to its mean: contacts whose impulses are not unique


def contact_impulses(
    gain: Floats, free: Floats, friction: Floats, start: Floats | None = None
) -> Floats:
    """The impulses (k, 3) at contacts that obey both laws; of several solutions the one next to `start`.

    Args:
        gain: W (3k, 3k), what the velocities at the contacts gain by impulses there; need not be symmetric.
        free: b (3k,), the velocities there without impulses.
        friction: (k,) coefficients of the contacts.
        start: (k, 3) impulses to start from, such as those of the last step; None: none.

    Raises:
        ConvergenceError: no impulses were found.
    """
    count = len(friction)
    speed, diagonal = float(np.abs(free).max(initial=0.0)), gain.diagonal()
    if speed == 0.0 or free[::3].min(initial=0.0) >= 0.0:
        return np.zeros((count, 3))
    size = float(diagonal.mean())
    # At contacts with less friction the velocities along the surface count for less, those of impulses for more.
    coefficients = np.minimum(friction, LARGEST)
    most = float(coefficients.max())
    weight = np.ones((count, 3))
    weight[:, 1:] = (coefficients / most if most > 0.0 else np.zeros(count))[:, None]
    scale = weight.ravel()
    w, b, unit = scale[:, None] * gain * scale / size, scale * free / speed, speed / size
    if (local := _by_cases(law_of(w, b, most))) is not None:
        return np.asarray(unit * weight * local)
    w += REGULAR * np.eye(3 * count)
    law = law_of(w, b, most)
    sticking = np.linalg.solve(w + 1e-9 * np.eye(3 * count), -b).reshape(-1, 3)
    starts = [np.zeros((count, 3)), sticking]
    if start is not None:
        starts.insert(0, start / (np.where(weight > 0.0, weight, 1.0) * unit))
    for tried in _starts(law, np.array(starts)):
        for local in newton(law, tried, PATIENCE):
            if law_residual(law, local) <= GOOD * max(1.0, float(np.abs(local).max())):
                return np.asarray(unit * weight * local)
    raise ConvergenceError(
        "the impulses at the contacts of the moving grain were not found: use shorter steps"
    )


def resisted_impulses(gain: Floats, free: Floats, friction: Floats, rolling: float) -> Floats:
    """The impulses (2k, 3) at k contacts that resist rolling: pressure and friction of each, then its couples.

    The couple takes the place of friction at a second contact, whose pressure P' is P_N of the first: Signorini's law
    has that answer where the normal velocity of the second one is P' - P_N.

    Args:
        gain, free: W (6k, 6k) and b (6k,); behind those of the contacts a triple each, the first unused, then the turns
            about both directions along the surface, times a length.
        friction: (k,) coefficients of the contacts.
        rolling: the couple over that length and the pressure, at most.

    Raises ConvergenceError if no impulses were found.
    """
    count = len(friction)
    pressures = 3 * np.arange(count)
    couples = pressures + 3 * count
    size = float(gain[pressures, pressures].mean())
    gain, free = gain.copy(), free.copy()
    gain[couples], gain[:, couples], free[couples] = 0.0, 0.0, 0.0
    gain[couples, couples], gain[couples, pressures] = size, -size
    return contact_impulses(gain, free, np.concatenate([friction, np.full(count, rolling)]))


def _by_cases(law: Law) -> Floats | None:
    """Impulses (k, 3) of one or two contacts in the plane, by trying what each may do; None: not found so.

    It sticks, slides either way or opens: in each case the laws are linear equations. Where forces are not unique
    these are the smallest ones.
    """
    gain, free = law.compliance, law.free
    count = len(free) // 3
    if count > 2 or gain[2::3].any() or free[2::3].any():
        return None
    sticks = np.eye(2, 3)
    slides = [np.array([[1.0, way * law.friction, 0.0]]) for way in (1.0, -1.0)]
    # Between two contacts that stick friction may hold against any load: that is taken where nothing else is found.
    each = (sticks, *slides, np.zeros((0, 3)))
    for cases in product(each if count == 1 else each[::-1], repeat=count):
        pushes, asked = block_diag(*cases), block_diag(*(sticks[: len(case)] for case in cases))
        sizes = np.linalg.lstsq(asked @ gain @ pushes.T, -asked @ free, rcond=LEAST)[0]
        local = (sizes @ pushes).reshape(-1, 3)
        if law_residual(law, local) <= EXACT * max(1.0, float(np.abs(local).max())):
            return np.asarray(local)
    return None


def _starts(law: Law, first: Floats) -> Iterator[Floats]:
    """Sets of impulses (s, k, 3) to start from: the first; those with less friction; others, the same every time."""
    yield first
    local = [first[-1]]
    for part in np.linspace(0.0, 0.95, 20):
        local.extend(newton(replace(law, friction=part * law.friction), local[-1][None]))
    yield np.array(local)
    yield _in_turn(law, first[0], FEW_SWEEPS)[None]
    random = np.random.default_rng(0)
    sizes = 10.0 ** random.uniform(-2.0, 1.0, (RANDOM_STARTS, 1, 1))
    yield sizes * random.normal(size=(RANDOM_STARTS, *first[0].shape))
    yield _in_turn(law, first[0], MANY_SWEEPS)[None]


def law_of(gain: Floats, free: Floats, friction: float) -> Law:
    """Both laws for velocities `gain` P + `free` of order one, as the equations that Newton's method solves."""
    step = 3.0 / gain.diagonal().reshape(-1, 3).sum(axis=1)
    each = np.repeat(step, 3)
    onto = np.eye(len(each)) - gain.T * each
    return Law(gain, free, step, onto, -each * free, friction)


def _in_turn(law: Law, start: Floats, sweeps: int) -> Floats:
    """Impulses (k, 3) found by solving for those of one contact after the other: near a solution, or one."""
    local = start.copy()
    for _ in range(sweeps):
        for k in range(len(local)):
            mine = slice(3 * k, 3 * k + 3)
            own = law.compliance[mine, mine]
            seen = law.free[mine] + law.compliance[mine] @ local.ravel() - own @ local[k]
            local[k] = one_contact(own, seen, law.friction)
    return local


def one_contact(gain: Floats, free: Floats, friction: float) -> Floats:
    """The impulse (3,) at a single contact, W (3, 3) positive definite: none, sticking, or sliding.

    Sliding, P_T = -(W_TT + a)^-1 (W_TN P_N + b_T) and u_N = 0 for the a >= 0 at which |P_T| = friction P_N: there is
    one, since the friction needed falls from more than there is at a = 0 to none as a grows.
    """
    if free[0] >= 0.0:
        return np.zeros(3)
    stuck = np.linalg.solve(gain, -free)
    if stuck[0] >= 0.0 and np.hypot(stuck[1], stuck[2]) <= friction * stuck[0]:
        return np.asarray(stuck)

    def sliding(a: float) -> Floats:
        """The impulse (3,) that leaves no normal velocity and opposes the slip with a resistance a."""
        answer = np.linalg.inv(gain[1:, 1:] + a * np.eye(2))
        normal = (-free[0] + gain[0, 1:] @ answer @ free[1:]) / (
            gain[0, 0] - gain[0, 1:] @ answer @ gain[1:, 0]
        )
        return np.array([normal, *(-answer @ (gain[1:, 0] * normal + free[1:]))])

    def lacking(part: float) -> float:
        """By how much the friction asked for exceeds the coefficient, at a = size part/(1 - part)."""
        if part >= 1.0:
            return -1.0
        found = sliding(size * part / (1.0 - part))
        if found[0] <= 0.0:
            return 1.0
        return float(np.hypot(found[1], found[2]) / found[0] - friction)

    size = float(np.trace(gain))
    if lacking(0.0) <= 0.0:
        return np.asarray(sliding(0.0))
    if friction == 0.0:
        return np.array([-free[0] / gain[0, 0], 0.0, 0.0])
    part = brentq(lacking, 0.0, 1.0, xtol=1e-15, rtol=1e-14)
    return sliding(size * part / (1.0 - part))
