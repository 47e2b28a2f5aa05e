"""Ordinary differential equations y' = f(t, y): Runge-Kutta-Fehlberg 4(5), used as one uses SUNDIALS' CVODE.

`init`, then `step` (one internal step) or `advance` (to a given time, landing on it); `reinit` begins anew with
the same settings. The error of each step is held below the tolerances in CVODE's norm, the root mean square of
error_i / (relative |y_i| + absolute_i). Times may run backwards. Nothing here knows what y is.

Source of the first step and the step control: Hairer, Norsett & Wanner, Solving Ordinary Differential
Equations I, II.4.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats
from ..errors import ConvergenceError
from .fehlberg import CUBIC, NODES, QUARTIC, QUINTIC, STAGES, WEIGHTS, WITHIN

SAFETY, LARGEST_CUT, LARGEST_GROWTH, CUT_WITHOUT_ERROR = 0.9, 0.2, 5.0, 0.25
PROPORTIONAL, INTEGRAL = 0.7 / 5, 0.4 / 5  # exponents of the controller (Gustafsson 1991)
MOST_FAILURES = 40  # of one step
ROUND_OFF = 16 * float(np.finfo(float).eps)


@dataclass(frozen=True)
class Tolerances:
    """Relative tolerance, and absolute tolerance: a number or one for each component of y (n,)."""

    relative: float
    absolute: float | Floats

    def __post_init__(self) -> None:
        least = np.min(np.asarray(self.absolute, dtype=float))
        if not (self.relative >= 0.0 and least >= 0.0 and self.relative + least > 0.0):
            raise ValueError("tolerances must be zero or more, and not all zero")

    def norm(self, error: Floats, size: Floats) -> float:
        """The weighted root mean square of an error (n,) in a solution of a size (n,): at most 1 is accepted."""
        weight = self.relative * size + self.absolute
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(error == 0.0, 0.0, error / weight)
        return float(np.sqrt(np.mean(ratio**2))) if len(ratio) else 0.0


@dataclass(frozen=True)
class Event:
    """A change of sign of g(t, y): any, or only rising (direction 1) or falling (-1) in the way of integration.

    A terminal event ends the step where it happens; others are only noted. Two changes of sign within one step
    cancel and are not seen: bound the steps by `largest_step` where that may happen.
    """

    function: Callable[[float, Floats], float]
    direction: int = 0
    terminal: bool = True


@dataclass(frozen=True)
class Occurrence:
    """An event that happened: its index, when, and the solution then (n,)."""

    event: int
    time: float
    y: Floats


class Outcome(Enum):
    """Why `step` or `advance` came back."""

    STEP = "a step was taken"
    END = "the given time was reached"
    EVENT = "a terminal event happened"


@dataclass(frozen=True)
class Status:
    """Why the integrator came back, at what time, and the indices of the events that ended the step."""

    outcome: Outcome
    time: float
    events: tuple[int, ...] = ()


@dataclass
class Statistics:
    """What was done since `init`: counts, the lengths (signed) of all accepted steps, and of the next one."""

    evaluations: int = 0
    error_test_failures: int = 0
    next_step: float = 0.0
    step_sizes: list[float] = field(default_factory=list)

    @property
    def steps(self) -> int:
        """The number of accepted steps."""
        return len(self.step_sizes)

    @property
    def last_step(self) -> float:
        """The length of the last accepted step."""
        return self.step_sizes[-1] if self.step_sizes else 0.0


class Integrator:
    """Runge-Kutta-Fehlberg 4(5) with error control, dense output and events.

    Args:
        rate: f(t, y) -> (n,). A step in which it is not finite is taken again with a quarter of the length.
        tolerances: bounds of the error of one step.
        events: located on the dense output to the round-off of time.
        first_step: its length; None: estimated from the rate (one evaluation more).
        largest_step: bound of the length of all steps.
        max_steps: the number of steps that one `advance` may take.
        order: 5 goes on with the result of fifth order, 4 with that of fourth whose error is estimated.

    `t` and `y` (n,) are the present time and solution. Wrong arguments raise ValueError.
    """

    def __init__(
        self,
        rate: Callable[[float, Floats], Floats],
        tolerances: Tolerances,
        *,
        events: Sequence[Event] = (),
        first_step: float | None = None,
        largest_step: float = np.inf,
        max_steps: int = 10_000,
        order: int = 5,
    ) -> None:
        if order not in WEIGHTS or not largest_step > 0.0 or max_steps < 1:
            raise ValueError(
                "the order is 4 or 5, the largest step and the number of steps are positive"
            )
        if first_step is not None and not first_step > 0.0:
            raise ValueError("the first step is positive, in whichever way time runs")
        self.rate, self.tolerances, self.events = rate, tolerances, tuple(events)
        self.first_step, self.largest_step, self.max_steps, self.order = (
            first_step,
            largest_step,
            max_steps,
            order,
        )
        self.t, self.y = np.nan, np.empty(0)

    def init(self, t: float, y: ArrayLike) -> None:
        """Set time and solution (n,) and forget everything before. Raises ConvergenceError as `step`."""
        self.t, self.y = float(t), np.array(y, dtype=float)
        if self.y.ndim != 1 or not np.isfinite([self.t, *self.y]).all():
            raise ValueError("initial time and values must be finite numbers, the values a vector")
        if np.ndim(self.tolerances.absolute) and np.shape(self.tolerances.absolute) != self.y.shape:
            raise ValueError(
                "the absolute tolerance is a number or has as many components as the solution"
            )
        self.statistics, self.occurrences = Statistics(), list[Occurrence]()
        self._slope = self._evaluate(self.t, self.y)
        if self._slope.shape != self.y.shape:
            raise ValueError("the rate must have as many components as the solution")
        if not np.isfinite(self._slope).all():
            raise ConvergenceError(f"the rate of change at the initial time {t:.6g} is not finite")
        self._start, self._powers, self._degree, self._span = (
            (self.t, self.y),
            np.empty((0, 0)),
            0,
            0.0,
        )
        self._error_before, self._way, self._signs = 1.0, 0.0, np.empty(0)

    def reinit(self, t: float, y: ArrayLike) -> None:
        """Start again from another state: settings stay, statistics and history begin anew (CVodeReInit)."""
        self.init(t, y)

    def advance(self, t_end: float) -> Status:
        """Integrate to `t_end` exactly, or to the first terminal event before.

        Raises:
            ConvergenceError: more than `max_steps` steps, or as in `step`; t and y hold the last good state.
        """
        for _ in range(self.max_steps):
            status = self.step(t_end)
            if status.outcome is not Outcome.STEP:
                return status
        raise ConvergenceError(
            f"{self.max_steps} steps did not reach t = {t_end:.6g} from t = {self.t:.6g}; allow more steps or "
            "larger tolerances"
        )

    def step(self, t_stop: float | None = None) -> Status:
        """One internal step, not beyond `t_stop` (None: forwards, anywhere).

        Raises:
            ConvergenceError: the step becomes too small, because of the error or rates that are not finite.
        """
        if np.isnan(self.t):
            raise ValueError("call init first")
        if t_stop == self.t:
            return Status(Outcome.END, self.t)
        self._face(1.0 if t_stop is None or t_stop > self.t else -1.0)
        landed = self._accepted_step(t_stop)
        happened = self._happened()
        if happened:
            return Status(Outcome.EVENT, self.t, happened)
        return Status(Outcome.END if landed else Outcome.STEP, self.t)

    def interpolate(self, t: float) -> Floats:
        """The solution (n,) within the last step: a quintic, its error of order h^6 (h^5 with order 4).

        Its order is that of the step itself, everywhere in it; it costs three more evaluations a step, once.
        """
        start, y = self._start
        if (
            not min(start, self.t) - ROUND_OFF * abs(t)
            <= t
            <= max(start, self.t) + ROUND_OFF * abs(t)
        ):
            raise ValueError(f"{t} is not within the last step, from {start} to {self.t}")
        if t == self.t:
            return self.y.copy()
        return y if self._span == 0.0 else self._dense(t)

    def _evaluate(self, t: float, y: Floats) -> Floats:
        self.statistics.evaluations += 1
        return np.asarray(self.rate(t, y), dtype=float)

    def _face(self, way: float) -> None:
        """Make ready to go forwards or backwards: length of the first step, signs of the events beside here."""
        if way == self._way:
            return
        self._way = way
        if self.statistics.next_step == 0.0:
            self.statistics.next_step = self.first_step or self._estimated_first_step()
        # An event at the very start is none: what counts is the sign just after.
        beside = (
            way
            * 8
            * ROUND_OFF
            * max(abs(self.t), min(self.statistics.next_step, self.largest_step))
        )
        self._signs = self._all_signs(self.t + beside, self.y + beside * self._slope)

    def _estimated_first_step(self) -> float:
        """Hairer, Norsett & Wanner, II.4, for order 5."""
        size = np.abs(self.y)
        norm = self.tolerances.norm
        d0, d1 = norm(size, size), norm(self._slope, size)
        usable = min(d0, d1) > 1e-5 and np.isfinite(d0 + d1)
        h = 0.01 * d0 / d1 if usable else 1e-6
        ahead = self._evaluate(self.t + self._way * h, self.y + self._way * h * self._slope)
        d2 = norm(ahead - self._slope, size) / h
        most = max(d1, d2)
        if not np.isfinite(most):
            return h
        return min(100 * h, max(1e-6, 1e-3 * h) if most <= 1e-15 else float((0.01 / most) ** 0.2))

    def _accepted_step(self, t_stop: float | None) -> bool:
        """Take a step that passes the error test; whether it ends at `t_stop`."""
        for failures in range(MOST_FAILURES):
            length = min(self.statistics.next_step, self.largest_step)
            landing = t_stop is not None and abs(t_stop - self.t) <= length * (1 + 1e-10)
            if t_stop is not None and landing:
                end = t_stop
            else:
                end = self.t + self._way * length
                if length <= ROUND_OFF * abs(self.t):
                    break
            error, y, slope = self._trial(end)
            if error <= 1.0:
                self._accept(end, y, slope, error, landing, failures)
                return landing
            self.statistics.error_test_failures += 1
            cut = (
                max(LARGEST_CUT, SAFETY * error**-0.2) if np.isfinite(error) else CUT_WITHOUT_ERROR
            )
            self.statistics.next_step = abs(end - self.t) * min(cut, SAFETY)
        raise ConvergenceError(
            f"the step at t = {self.t:.6g} became too small ({self.statistics.next_step:.3g}): the solution is "
            "singular there, or the tolerances cannot be met"
        )

    def _trial(self, end: float) -> tuple[float, Floats, Floats]:
        """Error (weighted), solution (n,) and slope (n,) at `end`; the error is infinite if they are not finite."""
        h = end - self.t
        slopes = np.empty((6, len(self.y)))
        slopes[0] = self._slope
        for i in range(1, 6):
            slopes[i] = self._evaluate(
                self.t + NODES[i] * h, self.y + h * (STAGES[i, :i] @ slopes[:i])
            )
            if not np.isfinite(slopes[i]).all():
                return np.inf, self.y, self._slope
        y = self.y + h * (WEIGHTS[self.order] @ slopes)
        error = h * ((WEIGHTS[5] - WEIGHTS[4]) @ slopes)
        size = self.tolerances.norm(error, np.maximum(np.abs(self.y), np.abs(y)))
        if not size <= 1.0:
            return (size if np.isfinite(size) else np.inf), y, self._slope
        slope = self._evaluate(end, y)
        return (size if np.isfinite(slope).all() else np.inf), y, slope

    def _accept(
        self, end: float, y: Floats, slope: Floats, error: float, landing: bool, failures: int
    ) -> None:
        h = end - self.t
        mean = (y - self.y) / h
        self._start, self._span, self._degree = (self.t, self.y), h, 3
        self._powers = CUBIC @ np.array([self._slope, mean, slope])
        self._slopes = [self._slope, mean, slope]
        self.t, self.y, self._slope = end, y, slope
        grown = SAFETY * max(error, 1e-10) ** -PROPORTIONAL * self._error_before**INTEGRAL
        following = abs(h) * float(np.clip(grown, LARGEST_CUT, 1.0 if failures else LARGEST_GROWTH))
        # A step cut short to land says nothing against the length that was meant.
        self.statistics.next_step = (
            max(following, self.statistics.next_step) if landing else following
        )
        self._error_before = max(error, 1e-4)
        self.statistics.step_sizes.append(h)

    def _dense(self, t: float) -> Floats:
        """The continuous extension of the last step, raised to a quintic when it is first asked for."""
        for matrix, count in ((QUARTIC, 1), (QUINTIC, 2)):
            if self._degree < 3 + count:
                inner = [self._start[0] + s * self._span for s in WITHIN[:count]]
                within = [self._evaluate(place, self._polynomial(place)) for place in inner]
                self._powers, self._degree = matrix @ np.array(self._slopes + within), 3 + count
        return self._polynomial(t)

    def _polynomial(self, t: float) -> Floats:
        s = (t - self._start[0]) / self._span
        powers = s ** np.arange(1, len(self._powers) + 1)
        return np.asarray(self._start[1] + self._span * (powers @ self._powers))

    def _all_signs(self, t: float, y: Floats) -> Floats:
        return np.array([np.sign(event.function(t, y)) for event in self.events])

    def _happened(self) -> tuple[int, ...]:
        """Note the events of the step just taken; go back to the first terminal one, and give its index."""
        signs = self._all_signs(self.t, self.y)
        changed = [
            i
            for i, event in enumerate(self.events)
            if self._crossed(event, self._signs[i], signs[i])
        ]
        times = {i: self._root(self.events[i], signs[i]) for i in changed}
        terminal = [self._way * times[i] for i in changed if self.events[i].terminal]
        last = self._way * min(terminal) if terminal else self.t
        reach = ROUND_OFF * max(abs(last), abs(self._span)) if terminal else 0.0
        seen = [i for i in changed if self._way * (times[i] - last) <= reach]
        for i in sorted(seen, key=lambda i: self._way * times[i]):
            self.occurrences.append(Occurrence(i, times[i], self.interpolate(times[i])))
        if terminal and last != self.t:
            self._go_back(last)
            signs = np.array(
                [signs[i] if i in seen else s for i, s in enumerate(self._all_signs(last, self.y))]
            )
        self._signs = signs
        return tuple(i for i in seen if self.events[i].terminal)

    @staticmethod
    def _crossed(event: Event, before: float, after: float) -> bool:
        return before != 0.0 and after != before and event.direction * before <= 0.0

    def _root(self, event: Event, after: float) -> float:
        """The time in the last step at which the event's function vanishes, to round-off."""
        from scipy.optimize import brentq  # which takes time to import, and most paths meet nothing

        start, end = self._start[0], self.t
        if after == 0.0:
            return end
        tiny = max(
            0.25 * ROUND_OFF * max(abs(start), abs(end)), 1e-3 * ROUND_OFF * abs(end - start)
        )
        value = partial(self._value, event, after)
        return float(brentq(value, start, end, xtol=tiny, rtol=ROUND_OFF, maxiter=200))

    def _value(self, event: Event, after: float, t: float) -> float:
        """The event's function within the last step, at whose end it has the sign `after`."""
        g = event.function(t, self._dense(t))
        if t in (
            self._start[0],
            self.t,
        ):  # where the sign is known already; round-off must not change it
            known = after if t == self.t else -after
            return g if g * known > 0.0 else known
        return g

    def _go_back(self, t: float) -> None:
        """End the last step at a time within it."""
        self.y = self._dense(t)
        self.t, self._slope = t, self._evaluate(t, self.y)
        self.statistics.step_sizes[-1] = t - self._start[0]
        self.statistics.next_step = max(self.statistics.next_step, abs(self._span))
