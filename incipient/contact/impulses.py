"""Signorini's and Coulomb's laws at the contacts, as equations, and the impulses that obey them over a time step.

With local velocities u = W p + b (normal, two tangential at each of k contacts) and local impulses p,

    0 <= u_N, 0 <= p_N, u_N p_N = 0,    |p_T| <= friction p_N, and where u_T is not zero p_T opposes it in full

(Moreau 1988; Jean 1999, Comput. Methods Appl. Mech. Eng. 177, 235), that is p = projection of p - r u onto the cylinder
of radius friction max(0, p_N - r u_N), for any r > 0 (Alart and Curnier 1991). Accelerations and forces at the instant
of release obey the same equations (`acceleration`). They are not convex: Newton's method is started from several p.

Rolling resistance is friction of the same form: a torque against the turn about the tangents of at most a coefficient
times p_N (Ai, Chen, Rotter and Ooi 2011, Powder Technol. 206, 269, with a rigid spring).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain, product

import numpy as np
from scipy.linalg import block_diag

from incipient.arrays import Floats
from incipient.contact.friction import INFINITE, FrictionCone
from incipient.contact.kernels import Kernel, add, dot
from incipient.errors import ConvergenceError

GOOD = 1e-9  # residual of a solution in the laws, dimensionless
EXACT = 1e-13  # the same where the laws are linear: a held grain must not creep
SINGULAR = 1e-9  # singular values below it leave a family of solutions open
RANK = 1e-9  # singular values below it, relative to the largest, count as zero
REGULAR = 1e-12  # added to the diagonal of W, over its mean, for impulses that are not unique
STEPS, PATIENCE = 14, 300  # of Newton's method, the latter where the former do not converge
# Residuals of a solution; the latter if one more step leaves no better.
CONVERGED, STALLED = 1e-12, 1e-11
HALVINGS, FALL = 4, 0.1  # of a step, until the squared residual falls by that fraction of it
SHIFT = 1e-11  # of the derivative, which may be singular
RANDOM_STARTS = (40, 200)


@dataclass(frozen=True, eq=False)
class CoulombLaw:
    """The laws at k contacts: `gain` W (3k, 3k), `free` b (3k,); p - r u is p @ onto + offset."""

    gain: Floats
    free: Floats
    friction: float
    onto: Floats
    offset: Floats

    @classmethod
    def of(cls, gain: Floats, free: Floats, friction: float) -> CoulombLaw:
        """The laws with r the inverse of the mean diagonal of W at each contact."""
        step = np.repeat(3.0 / gain.diagonal().reshape(-1, 3).sum(axis=1), 3)
        onto = np.eye(len(step)) - gain.T * step
        return cls(gain, free, friction, np.ascontiguousarray(onto), -step * free)

    def residual(self, local: Floats) -> float:
        """Residual of impulses p (k, 3) in the contact laws."""
        trial = (local.ravel() @ self.onto + self.offset).reshape(-1, 3)
        pressure = np.maximum(trial[:, 0], 0.0)
        shear = np.hypot(trial[:, 1], trial[:, 2])
        projected = trial * FrictionCone.of(self.friction).mobilised(pressure, shear)[:, None]
        projected[:, 0] = pressure
        return float(np.abs(local - projected).max())

    def is_open(self, local: Floats) -> bool:
        """Whether the equations at a solution (k, 3) leave a direction open in which velocities change."""
        derivative = np.empty_like(self.onto)
        trial = local.ravel() @ self.onto + self.offset
        DERIVATIVE(self.onto, self.friction, trial, derivative, rows=2.0 / len(local) ** 3)
        _, sizes, right = np.linalg.svd(derivative)
        ways = right[sizes <= SINGULAR * max(1.0, sizes[0])]
        return bool((np.abs(ways @ self.gain) > 1e3 * SINGULAR).any())

    def newton(self, starts: Floats, steps: int = PATIENCE) -> Floats:
        """Solutions (s', k, 3) reached from starts (s, k, 3), by STEPS steps or, if these reach none, by `steps`."""
        flat = np.ascontiguousarray(starts.reshape(len(starts), -1))
        return np.asarray(
            NEWTON(self.onto, self.offset, self.friction, flat, STEPS, steps)
        ).reshape(-1, *starts.shape[1:])

    def solutions(self, start: Floats) -> Iterator[Floats]:
        """Sets of solutions (s', k, 3), each from more and farther starts than the one before, from p (k, 3) on."""
        path = [start]
        for part in np.linspace(0.0, 0.95, 20):
            path.extend(replace(self, friction=part * self.friction).newton(path[-1][None]))
        yield self.newton(np.array(path))
        random = np.random.default_rng(0)  # the same every time: answers must not change
        for count in RANDOM_STARTS:
            sizes = 10.0 ** random.uniform(-2.0, 1.0, (count, 1, 1))
            yield self.newton(sizes * random.normal(size=(count, *start.shape)))


def contact_impulses(gain: Floats, free: Floats, friction: Floats) -> Floats:
    """The impulses (k, 3) at contacts that obey both laws.

    Args:
        gain: W (3k, 3k), the velocities at the contacts per impulse there; need not be symmetric.
        free: b (3k,), the velocities there without impulses.
        friction: (k,) coefficients of the contacts.

    Raises:
        ConvergenceError: the impulses did not converge.
    """
    count, speed = len(friction), float(np.abs(free).max(initial=0.0))
    if speed == 0.0 or free[::3].min(initial=0.0) >= 0.0:
        return np.zeros((count, 3))
    size = float(gain.diagonal().mean())
    # At contacts with less friction tangential velocities are scaled down and impulses up: one coefficient for all.
    coefficients = np.minimum(friction, INFINITE)
    most = float(coefficients.max())
    weight = np.ones((count, 3))
    weight[:, 1:] = (coefficients / most if most > 0.0 else np.zeros(count))[:, None]
    scale = weight.ravel()
    w, b, unit = scale[:, None] * gain * scale / size, scale * free / speed, speed / size
    local = _by_cases(CoulombLaw.of(w, b, most))
    if local is not None:
        return np.asarray(unit * weight * local)
    w += REGULAR * np.eye(3 * count)
    law = CoulombLaw.of(w, b, most)
    sticking = np.linalg.solve(w + 1e-9 * np.eye(3 * count), -b).reshape(-1, 3)
    starts = np.stack([np.zeros((count, 3)), sticking])
    for solutions in chain([law.newton(starts)], law.solutions(sticking)):
        for local in solutions:
            if law.residual(local) <= GOOD * max(1.0, float(np.abs(local).max())):
                return np.asarray(unit * weight * local)
    raise ConvergenceError(
        "the impulses at the contacts of the moving grain did not converge: use shorter steps"
    )


def resisted_impulses(gain: Floats, free: Floats, friction: Floats, rolling: float) -> Floats:
    """The impulses (2k, 3) at k contacts that resist rolling: those of the contacts, then their torques.

    The torque stands for friction at a second contact whose pressure p' is p_N of the first: Signorini's law
    gives that if the normal velocity of the second is p' - p_N.

    Args:
        gain, free: W (6k, 6k) and b (6k,); after those of the contacts a triple each, the first unused, then the
            turns about both tangents, times a length.
        friction: (k,) coefficients of the contacts.
        rolling: the largest torque over that length and the pressure.

    Raises ConvergenceError if the impulses do not converge.
    """
    count = len(friction)
    pressures = 3 * np.arange(count)
    torques = pressures + 3 * count
    size = float(gain[pressures, pressures].mean())
    gain, free = gain.copy(), free.copy()
    gain[torques], gain[:, torques], free[torques] = 0.0, 0.0, 0.0
    gain[torques, torques], gain[torques, pressures] = size, -size
    return contact_impulses(gain, free, np.concatenate([friction, np.full(count, rolling)]))


def _by_cases(law: CoulombLaw) -> Floats | None:
    """Impulses (k, 3) of one or two contacts in 2-D, where each case is linear; None: there are none.

    A contact sticks, slides either way or opens. Where impulses are not unique these are the smallest.
    """
    count = len(law.free) // 3
    if count > 2 or law.gain[2::3].any() or law.free[2::3].any():
        return None
    sticks = np.eye(2, 3)
    slides = [np.array([[1.0, way * law.friction, 0.0]]) for way in (1.0, -1.0)]
    # Between two contacts that stick friction may hold any load: that is taken only if there is no other solution.
    each = (sticks, *slides, np.zeros((0, 3)))
    for cases in product(each if count == 1 else each[::-1], repeat=count):
        pushes, zero = block_diag(*cases), block_diag(*(sticks[: len(case)] for case in cases))
        sizes = np.linalg.lstsq(zero @ law.gain @ pushes.T, -zero @ law.free, rcond=RANK)[0]
        local = (sizes @ pushes).reshape(-1, 3)
        if law.residual(local) <= EXACT * max(1.0, float(np.abs(local).max())):
            return np.asarray(local)
    return None


# From here on kernels, which numba compiles (`kernels.Kernel`).


def newton(
    onto: Floats, offset: Floats, friction: float, starts: Floats, few: int, many: int
) -> Floats:
    """Solutions (s', h) of Coulomb's law by damped Newton steps from starts (s, h), `many` if `few` reach none."""
    count, width = starts.shape
    force, trial, miss = starts.copy(), np.empty((count, width)), np.empty((count, width))
    merit, done, near = np.empty(count), np.zeros(count), np.zeros(count)
    solutions, reached = np.empty((count, width)), 0
    derivative, start = np.empty((width, width)), np.empty(width)
    for i in range(count):
        merit[i] = _miss(onto, offset, friction, force[i], trial[i], miss[i])
    for step in range(many):
        if reached == count or (step == few and reached > 0):
            break
        for i in range(count):
            if done[i] > 0.0:
                continue
            size, was_near = max(1.0, dot(force[i], force[i])), near[i]
            near[i] = 1.0 if merit[i] <= STALLED**2 * size else 0.0
            if merit[i] <= CONVERGED**2 * size or was_near * near[i] > 0.0:
                done[i] = 1.0
                solutions[reached] = force[i]
                add(solutions[reached], -1.0, miss[i])
                reached += 1
                continue
            differentiate(onto, friction, trial[i], derivative)
            change, part, lowest, best = np.linalg.solve(derivative, miss[i]), 1.0, np.inf, 1.0
            start[:] = force[i]
            for tried in range(HALVINGS + 1):
                force[i] = start
                add(force[i], -(part if tried < HALVINGS else best), change)
                value = _miss(onto, offset, friction, force[i], trial[i], miss[i])
                if value < (1.0 - FALL * part) * merit[i] or tried == HALVINGS:
                    break
                if value < lowest:
                    best, lowest = part, value
                part *= 0.5
            merit[i] = value
    return solutions[:reached]


def _miss(
    onto: Floats, offset: Floats, friction: float, force: Floats, trial: Floats, miss: Floats
) -> float:
    """Fill in the trial f - r A and what forces (h,) miss their projection by; returns its square."""
    trial[:] = offset
    for i in range(len(force)):
        add(trial, force[i], onto[i])
    for i in range(0, len(force), 3):
        pressure = max(trial[i], 0.0)
        shear = max(math.hypot(trial[i + 1], trial[i + 2]), 1e-300)
        kept = min(friction * pressure / shear, 1.0)
        miss[i] = force[i] - pressure
        miss[i + 1] = force[i + 1] - kept * trial[i + 1]
        miss[i + 2] = force[i + 2] - kept * trial[i + 2]
    return dot(miss, miss)


def differentiate(onto: Floats, friction: float, trial: Floats, out: Floats) -> None:
    """Fill in the generalised Jacobian (h, h) of the miss; at kinks one of the one-sided derivatives."""
    for i in range(0, len(trial), 3):
        pressure = max(trial[i], 0.0)
        shear = max(math.hypot(trial[i + 1], trial[i + 2]), 1e-300)
        kept = min(friction * pressure / shear, 1.0)
        slips, pressed = 1.0 if kept < 1.0 else 0.0, 1.0 if pressure > 0.0 else 0.0
        one, two = slips * trial[i + 1] / shear, slips * trial[i + 2] / shear
        wider = friction * pressed
        for j in range(len(trial)):
            normal, first, second = onto[j, i], onto[j, i + 1], onto[j, i + 2]
            longer = one * first + two * second
            out[i, j] = -pressed * normal
            out[i + 1, j] = -wider * one * normal - kept * (first - one * longer)
            out[i + 2, j] = -wider * two * normal - kept * (second - two * longer)
    for i in range(len(trial)):
        out[i, i] += 1.0 + SHIFT


NEWTON = Kernel(newton, interpreted=20)
DERIVATIVE = Kernel(differentiate)
