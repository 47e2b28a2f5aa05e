"""Ordinary differential equations y' = f(t, y): Runge-Kutta-Fehlberg 4(5) with an interface like SUNDIALS' CVODE.

The error of a step is held below the tolerances in CVODE's norm, the root mean square of error_i / (relative |y_i| +
absolute_i); the solution of fifth order is propagated.

Sources: E. Fehlberg, NASA TR R-315 (1969), formula 2; Hairer, Norsett & Wanner, Solving Ordinary Differential Equations
I, II.4 (safety factors); Gustafsson, ACM TOMS 17 (1991) (proportional-integral control).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats
from ..errors import ConvergenceError

NODES = np.array([0.0, 1 / 4, 3 / 8, 12 / 13, 1.0, 1 / 2])
STAGES = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0],
        [1 / 4, 0.0, 0.0, 0.0, 0.0],
        [3 / 32, 9 / 32, 0.0, 0.0, 0.0],
        [1932 / 2197, -7200 / 2197, 7296 / 2197, 0.0, 0.0],
        [439 / 216, -8.0, 3680 / 513, -845 / 4104, 0.0],
        [-8 / 27, 2.0, -3544 / 2565, 1859 / 4104, -11 / 40],
    ]
)
FOURTH = np.array([25 / 216, 0.0, 1408 / 2565, 2197 / 4104, -1 / 5, 0.0])
FIFTH = np.array([16 / 135, 0.0, 6656 / 12825, 28561 / 56430, -9 / 50, 2 / 55])

SAFETY, LARGEST_CUT, LARGEST_GROWTH, CUT_WITHOUT_ERROR = 0.9, 0.2, 5.0, 0.25
PROPORTIONAL, INTEGRAL = 0.7 / 5, 0.4 / 5
MAX_STEPS = 10_000  # of one `advance`
ROUND_OFF = 16 * float(np.finfo(float).eps)

Rate = Callable[[float, Floats], Floats]
Root = Callable[[float, Floats], float]


class Integrator:
    """Runge-Kutta-Fehlberg 4(5) with error control, dense output and a root; at time `t` with solution `y` (n,).

    `rate` is f(t, y) -> (n,); the tolerances of steps are relative and absolute. A step in which the rate is not finite
    is repeated with a quarter of the length.
    """

    def __init__(self, rate: Rate, relative: float, absolute: float) -> None:
        self.rate, self.relative, self.absolute = rate, relative, absolute

    def init(self, t: float, y: ArrayLike) -> None:
        """Set time and solution (n,). Raises ConvergenceError if the rate is not finite."""
        self.t, self.y = float(t), np.array(y, dtype=float)
        self._length, self._error = 0.0, 1.0  # of the next step, and the last one's
        self._slope = np.asarray(self.rate(self.t, self.y), dtype=float)
        if not np.isfinite(self._slope).all():
            raise ConvergenceError(f"the rate of change at the initial time {t:.6g} is not finite")
        self._start = (self.t, self.y, self._slope)

    def advance(self, end: float, root: Root | None = None) -> bool:
        """Integrate to the time `end`, or to the first fall of `root`(t, y) through zero before it.

        Returns whether a root ended the integration. A root at the present time does not count; two changes of sign
        within one step are not seen.

        Raises:
            ConvergenceError: the step becomes too small, or steps do not suffice; t and y hold the last accepted state.
        """
        self._length = self._length or end - self.t
        ahead = 8 * ROUND_OFF * max(abs(self.t), self._length)
        value = 0.0 if root is None else root(self.t + ahead, self.y + ahead * self._slope)
        for _ in range(MAX_STEPS):
            if self.t >= end:
                return False
            self._step(end)
            if root is not None:
                before, value = value, root(self.t, self.y)
                if before > 0.0 >= value:
                    self._go_back_to(root, before)
                    return True
        raise ConvergenceError(
            f"{MAX_STEPS} steps did not reach t = {end:.6g} from t = {self.t:.6g}; use a smaller time.step"
        )

    def interpolate(self, t: float) -> Floats:
        """The solution (n,) at a time within the last step: the step itself, taken to that time."""
        start, y, slope = self._start
        if t == self.t:
            return self.y
        return y + (t - start) * (FIFTH @ self._slopes(start, y, slope, t))

    def _slopes(self, t: float, y: Floats, slope: Floats, end: float) -> Floats:
        slopes, h = np.full((6, len(y)), np.nan), end - t
        slopes[0] = slope
        for i in range(1, 6):
            slopes[i] = self.rate(t + NODES[i] * h, y + h * (STAGES[i, :i] @ slopes[:i]))
            if not np.isfinite(slopes[i]).all():
                break
        return slopes

    def _step(self, stop: float) -> None:
        for failures in range(40):
            lands = stop - self.t <= self._length * (1 + 1e-10)
            end = stop if lands else self.t + self._length
            if not lands and self._length <= ROUND_OFF * abs(self.t):
                break
            h, slopes = end - self.t, self._slopes(self.t, self.y, self._slope, end)
            y = self.y + h * (FIFTH @ slopes)
            size = np.maximum(np.abs(self.y), np.abs(y))
            ratio = h * ((FIFTH - FOURTH) @ slopes) / (self.relative * size + self.absolute)
            error = float(np.sqrt(np.mean(ratio**2)))  # CVODE's norm
            slope = np.asarray(self.rate(end, y)) if error <= 1.0 else slopes[0]
            if error <= 1.0 and np.isfinite(slope).all():
                self._start = (self.t, self.y, self._slope)
                self.t, self.y, self._slope = end, y, slope
                growth = SAFETY * max(error, 1e-10) ** -PROPORTIONAL * self._error**INTEGRAL
                following = h * min(max(growth, LARGEST_CUT), 1.0 if failures else LARGEST_GROWTH)
                # A step cut short to land says nothing against the length that was meant.
                self._length = max(following, self._length) if lands else following
                self._error = max(error, 1e-4)
                return
            cut = max(LARGEST_CUT, SAFETY * error**-0.2) if error > 1.0 else CUT_WITHOUT_ERROR
            self._length = h * min(cut, SAFETY)
        raise ConvergenceError(
            f"the step at t = {self.t:.6g} became too small ({self._length:.3g}): the solution "
            "is singular there, or the tolerances cannot be met"
        )

    def _go_back_to(self, root: Root, before: float) -> None:
        from scipy.optimize import brentq  # takes time to import, and most paths meet nothing

        start, tiny = self._start[0], ROUND_OFF * max(abs(self._start[0]), abs(self.t))

        def value(t: float) -> float:
            return before if t == start else root(t, self.interpolate(t))

        t = float(brentq(value, start, self.t, xtol=tiny))
        self.y, self.t = self.interpolate(t), t
        self._slope = np.asarray(self.rate(self.t, self.y), dtype=float)
