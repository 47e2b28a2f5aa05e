"""Signorini's and Coulomb's laws for velocities u = W p + b and impulses p (normal, two tangential).

0 <= u_N, 0 <= p_N, u_N p_N = 0 and |p_T| <= friction p_N, with equality and p_T against u_T where
u_T is not zero (Moreau 1988; Jean 1999, Comput. Methods Appl. Mech. Eng. 177, 235), that is p =
projection of p - r u onto the cylinder of radius friction max(0, p_N - r u_N) for any r > 0 (Alart
and Curnier 1991), which is not convex: Newton's method starts from several p.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from incipient.arrays import Floats
from incipient.contact.friction import INFINITE
from incipient.contact.kernels import Kernel, add, dot
from incipient.errors import ConvergenceError

SINGULAR = 1e-9  # singular values below this leave a family of solutions open
STEPS = 14  # of Newton's method
# Residuals of a solution; the latter if a further step gives no improvement.
CONVERGED, STALLED = 1e-12, 1e-11
HALVINGS = 4  # of a step, until the squared residual falls by a tenth of that fraction of it


@dataclass(frozen=True, eq=False)
class CoulombLaw:
    """Contact laws with W `gain` (3k, 3k) and b; p - r u is p @ onto + offset."""

    gain: Floats
    friction: float
    onto: Floats
    offset: Floats

    @classmethod
    def of(cls, gain: Floats, free: Floats, friction: float) -> CoulombLaw:
        return cls(gain, friction, *projected(gain, free))

    def residual(self, local: Floats) -> float:
        """Largest violation of the contact laws by impulses (k, 3)."""
        trial, miss = np.empty_like(self.offset), np.empty_like(self.offset)
        _miss(self.onto, self.offset, self.friction, local.ravel(), trial, miss)
        return float(np.abs(miss).max())

    def is_open(self, local: Floats) -> bool:
        """Whether velocities may vary at a solution (k, 3)."""
        derivative = np.empty_like(self.onto)
        trial = local.ravel() @ self.onto + self.offset
        DERIVATIVE(self.onto, self.friction, trial, derivative)
        _, sizes, right = np.linalg.svd(derivative)
        ways = right[sizes <= SINGULAR * max(1.0, sizes[0])]
        return bool((np.abs(ways @ self.gain) > 1e3 * SINGULAR).any())

    def solutions(self, starts: Floats) -> Floats:
        """Solutions (s', 3k) from starts (s, 3k), or from random ones if none converges."""
        solutions = self._newton(starts)
        random = np.random.default_rng(0)  # fixed: results must be reproducible
        for count in (40, 200):
            if len(solutions) > 0:
                break
            sizes = 10.0 ** random.uniform(-2.0, 1.0, (count, 1))
            solutions = self._newton(sizes * random.normal(size=(count, starts.shape[1])))
        return solutions

    def _newton(self, starts: Floats) -> Floats:
        arguments = self.onto, self.offset, self.friction, starts, STEPS, 300
        return np.asarray(NEWTON(*arguments, rows=len(starts)))


def contact_impulses(gain: Floats, free: Floats, friction: Floats) -> Floats:
    """Impulses (k, 3) at contacts that satisfy both laws.

    gain: W (3k, 3k), contact velocities per impulse, need not be symmetric; free: b (3k,), contact
    velocities without impulses; friction: (k,) coefficients. Raises ConvergenceError.
    """
    count, speed = len(friction), float(np.abs(free).max(initial=0.0))
    if speed == 0.0 or free[::3].min(initial=0.0) >= 0.0:
        return np.zeros((count, 3))
    size = float(gain.diagonal().mean())
    # Scaling tangential velocities and impulses gives all contacts the same coefficient.
    coefficients = np.minimum(friction, INFINITE)
    most = float(coefficients.max())
    weight = np.ones((count, 3))
    weight[:, 1:] = (coefficients / most if most > 0.0 else np.zeros(count))[:, None]
    scale = weight.ravel()
    w, b, unit = scale[:, None] * gain * scale / size, scale * free / speed, speed / size
    w += 1e-12 * np.eye(3 * count)  # where impulses are not unique
    law = CoulombLaw.of(w, b, most)
    sticking = np.linalg.solve(w + 1e-9 * np.eye(3 * count), -b)
    solutions = law.solutions(np.stack([np.zeros(3 * count), sticking]))
    if len(solutions) == 0:
        raise ConvergenceError(
            "the impulses at the contacts of the moving grain did not converge: use a smaller time.step"
        )
    return np.asarray(unit * weight * solutions[0].reshape(count, 3))


def resisted_impulses(gain: Floats, free: Floats, friction: Floats, rolling: float) -> Floats:
    """Impulses (2k, 3) at k contacts with rolling resistance: contact impulses, then torques.

    Torques of at most rolling p_N (Ai, Chen, Rotter and Ooi 2011, Powder Technol. 206, 269, with a
    rigid spring) are friction at a second contact, whose normal velocity p' - p_N makes its
    pressure p' equal p_N.

    Args:
        gain, free: W (6k, 6k) and b (6k,), for each torque an unused entry and the turns about both
            tangents times a length.
        rolling: the largest torque over that length and the pressure.

    Raises ConvergenceError.
    """
    count = len(friction)
    pressures = 3 * np.arange(count)
    torques = pressures + 3 * count
    size = float(gain[pressures, pressures].mean())
    gain, free = gain.copy(), free.copy()
    gain[torques], gain[:, torques], free[torques] = 0.0, 0.0, 0.0
    gain[torques, torques], gain[torques, pressures] = size, -size
    return contact_impulses(gain, free, np.concatenate([friction, np.full(count, rolling)]))


# Kernels compiled by numba (`kernels.Kernel`).


def projected(gain: Floats, free: Floats) -> tuple[Floats, Floats]:
    """`onto` and `offset` of W and b; r is the inverse of the mean diagonal of W at each contact."""
    step = np.repeat(3.0 / np.diag(gain).reshape(-1, 3).sum(axis=1), 3)
    return np.ascontiguousarray(np.eye(len(step)) - gain.T * step), -step * free


def newton(
    onto: Floats, offset: Floats, friction: float, starts: Floats, few: int, many: int
) -> Floats:
    """Solutions (s', h) of damped Newton steps from starts (s, h); `many` steps if `few` give none."""
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
            # Singular where friction is exactly its largest: this start ends here. numba compiles no narrower `except`.
            try:
                change = np.linalg.solve(derivative, miss[i])
            except Exception:
                done[i] = 1.0
                continue
            part, lowest, best = 1.0, np.inf, 1.0
            start[:] = force[i]
            for tried in range(HALVINGS + 1):
                force[i] = start
                add(force[i], -(part if tried < HALVINGS else best), change)
                value = _miss(onto, offset, friction, force[i], trial[i], miss[i])
                if value < (1.0 - 0.1 * part) * merit[i] or tried == HALVINGS:
                    break
                if value < lowest:
                    best, lowest = part, value
                part *= 0.5
            merit[i] = value
    return solutions[:reached]


def _miss(
    onto: Floats, offset: Floats, friction: float, force: Floats, trial: Floats, miss: Floats
) -> float:
    """Fill in trial p - r u and residual of p (h,); returns the squared residual."""
    trial[:] = offset + force @ onto
    for i in range(0, len(force), 3):
        pressure = max(trial[i], 0.0)
        shear = max(math.hypot(trial[i + 1], trial[i + 2]), 1e-300)
        kept = min(friction * pressure / shear, 1.0)
        miss[i] = force[i] - pressure
        miss[i + 1] = force[i + 1] - kept * trial[i + 1]
        miss[i + 2] = force[i + 2] - kept * trial[i + 2]
    return dot(miss, miss)


def differentiate(onto: Floats, friction: float, trial: Floats, out: Floats) -> None:
    """Generalised Jacobian (h, h) of the residual; one-sided at kinks."""
    for i in range(0, len(trial), 3):
        pressure = max(trial[i], 0.0)
        shear = max(math.hypot(trial[i + 1], trial[i + 2]), 1e-300)
        kept = min(friction * pressure / shear, 1.0)
        slips, pressed = 1.0 if kept < 1.0 else 0.0, 1.0 if pressure > 0.0 else 0.0
        along, across = slips * trial[i + 1] / shear, slips * trial[i + 2] / shear
        for j in range(len(trial)):
            normal, first, second = pressed * onto[j, i], onto[j, i + 1], onto[j, i + 2]
            wider = friction * normal - kept * (along * first + across * second)
            out[i, j] = -normal
            out[i + 1, j] = -along * wider - kept * first
            out[i + 2, j] = -across * wider - kept * second
    for i in range(len(trial)):
        out[i, i] += 1.0 + 1e-11  # the derivative may be singular


NEWTON = Kernel(newton, interpreted=20)
DERIVATIVE = Kernel(differentiate)
