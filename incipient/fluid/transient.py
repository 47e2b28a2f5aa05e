"""Unsteady flow: first- and second-order backward differences with variable steps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..arrays import extrapolated
from ..errors import ConvergenceError
from .flow import Fluid
from .newton import NewtonReport

LEAST, MOST = 1e-9, 1e-4  # tolerance of a time step
MOST_REJECTED = 11  # attempts at one step: ten halvings
# Shortest step of a run relative to its first: a diverging flow must not halve steps without end.
SHORTEST = 0.5**MOST_REJECTED
SAFETY, LARGEST_GROWTH, LARGEST_CUT = 0.9, 2.0, 0.3
# Fraction of an impulsive first step from which Newton's method converges where it fails from the initial state.
IMPULSE = 0.01
ROUND_OFF = 1e-9  # relative, of times
# Growth of fixed steps that begin short or had to be halved.
GROWTH = 1.25


Tolerance = float | Literal["auto"]


def of_steps(tolerance: Tolerance) -> Tolerance:
    """Tolerance of time steps from `numerics.tolerance`."""
    return tolerance if tolerance == "auto" else max(tolerance, LEAST)


class Stepped:
    """Takes part in time steps with its parts, here without any other effect. All methods are collective."""

    parts: Sequence[Stepped] = ()

    def allowed(self, length: float) -> float:
        """Admissible length of the attempted step: shorter if a part makes contact."""
        return min([length, *(part.allowed(length) for part in self.parts)])

    def accept(self, step: TimeStep) -> None:
        """Take the attempted step."""
        for part in self.parts:
            part.accept(step)

    def restore(self) -> None:
        """Return to the last step."""
        for part in self.parts:
            part.restore()

    def forget(self) -> None:
        """Discard factorisations and convergence data, which later steps reuse."""
        for part in self.parts:
            part.forget()

    def velocities(self) -> np.ndarray:
        """Velocities (n,) at the end of the last attempt, whose error also limits the steps."""
        return np.concatenate([np.empty(0), *(part.velocities() for part in self.parts)])


class Interface(Stepped):
    """What is solved together with the flow, such as moving parts; here nothing. All methods are collective."""

    def __init__(self, fluid: Fluid):
        self.fluid = fluid

    def attempt(
        self, length: float, order: int, tolerance: float, before: NewtonReport | None = None
    ) -> NewtonReport:
        """Solve a step from the last state, including the fluid's, to an algebraic `tolerance`.

        before: report of the same step, which other changes of the flow require again from its end.
        """
        return self.fluid.solve(tolerance)


@dataclass(frozen=True)
class TimeStep:
    """An accepted step; `error` is None without enough history, `tolerance` algebraic."""

    number: int
    time: float
    length: float
    error: float | None
    rejected: int
    report: NewtonReport
    tolerance: float


def backward_difference(
    order: int, step: float, ratio: float
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Coefficients (a0, a1, a2) of dv/dt and (e1, e2) of the extrapolation.

    `ratio`: this step over the previous one.
    """
    if order == 1:
        return (1 / step, -1 / step, 0.0), (1.0, 0.0)
    r = ratio
    rate = ((1 + 2 * r) / (1 + r), -(1 + r), r**2 / (1 + r))
    return tuple(a / step for a in rate), (1 + r, -r)


@dataclass(frozen=True)
class Past:
    """A past state: time, the fluid's unknowns, velocities of the moving parts."""

    time: float
    state: np.ndarray
    velocities: np.ndarray


class Transient:
    """Time stepping of an unsteady fluid, or a steady one between time-dependent boundary values. Collective.

    order: 1 (the paper's backward difference) or 2. tolerance: relative, algebraic; "auto": a tenth
    of the previous local time error, within limits. accuracy: admissible relative local error of
    the velocity; None: fixed steps. kinks: times at which the acceleration of boundary values jumps. least: speed to
    which errors of slower flows are relative. past: at most two states, newest first.
    """

    def __init__(
        self,
        fluid: Fluid,
        order: int = 2,
        tolerance: Tolerance = 1e-8,
        accuracy: float | None = None,
        interface: Interface | None = None,
        kinks: Sequence[float] = (),
        least: float = 0.0,
    ):
        self.fluid, self.order, self.tolerance, self.accuracy = fluid, order, tolerance, accuracy
        self.interface, self.least = interface or Interface(fluid), least
        # The sum of many steps has round-off.
        self.kinks = (1.0 - ROUND_OFF) * np.array(kinks)
        self.past: list[Past] = []
        self.number, self.next_length = 0, 0.0
        self.last_error: float | None = None
        # Time of the last remeshing: earlier states come from another mesh.
        self._new_mesh = -np.inf
        self._shortest, self._first = 0.0, np.inf

    def march(
        self, end: float, step: float, first: float = 1.0, stops: Sequence[float] = ()
    ) -> Iterator[TimeStep]:
        """Advance to `end`, yielding accepted steps with lengths that follow `accuracy` if set.

        Adaptive runs start with much shorter steps, fixed ones with `first` times `step`; steps
        below `step` grow by a quarter each, since second-order differences with ratios of 2.4 are
        unstable (Grigorieff 1983, Numer. Math. 42, 359). A step ends at each of `stops`.

        Raises ConvergenceError if a step failed after ten halvings, or below `SHORTEST` of the
        first; the fluid holds the last converged state.
        """
        shortened = first * step
        if self.accuracy is not None:
            shortened *= np.sqrt(self.accuracy)
            self._first = shortened
        self._shortest = SHORTEST * shortened
        self.next_length = self.next_length or shortened
        slight = ROUND_OFF * end  # also in a resumed run
        while end - self.fluid.time > slight:
            # Stops that differ by round-off are one.
            ahead = [time for time in stops if time - self.fluid.time > 100.0 * slight]
            stop = min([*ahead, end])
            taken = self.advance(_landing(stop - self.fluid.time, self.next_length))
            length = min(GROWTH * self.next_length, step)
            if self.accuracy is not None:
                length = taken.length
                if taken.error is not None:
                    factor = (self.accuracy / max(taken.error, 1e-300)) ** (1 / (self.order + 1))
                    length *= float(np.clip(SAFETY * factor, LARGEST_CUT, LARGEST_GROWTH))
            self.next_length = max(length, self._shortest)
            yield taken
        self.next_length = 0.0

    def advance(self, length: float) -> TimeStep:
        """Take one step of at most `length`, halved until accepted. Raises ConvergenceError as `march`."""
        state, velocities = self.fluid.state.x.array.copy(), self.interface.velocities()
        past = [Past(self.fluid.time, state, velocities), *self.past]
        # A difference across a kink would mix rates before and after: that step is of first order, and the next.
        now = past[0].time
        ahead = (self.kinks > now) & (self.kinks < (now + length) * (1.0 - 2.0 * ROUND_OFF))
        since = now if ahead.any() else self.kinks[self.kinks <= now].max(initial=-np.inf)
        self.past = [each for each in past if each.time >= since]
        try:
            # Without a past the error of an adaptive step is not known: it begins as short as at the start.
            taken = self._accepted(min(length, self._first) if len(self.past) == 1 else length)
        except ConvergenceError:
            self._restore()
            del self.past[0]
            raise
        self.interface.accept(taken)
        del self.past[2:]
        return taken

    def resume(
        self,
        number: int,
        next_length: float,
        past: Sequence[Past],
        last_error: float | None,
        new_mesh: float = -np.inf,
    ) -> None:
        """Restore the history after `number` steps, with `past` states newest first.

        The next `march` starts with `next_length`. `new_mesh`: time of the last remeshing.
        """
        self.number, self.past, self.last_error = number, list(past), last_error
        self._new_mesh = new_mesh
        self.next_length = next_length if number else 0.0

    def forget(self) -> None:
        """Discard factorisations and convergence data, so that a resumed run is identical."""
        self.fluid.renew_factors()
        self.interface.forget()

    def _accepted(self, length: float) -> TimeStep:
        for rejected in range(MOST_REJECTED):
            report = self._attempt(length)
            error = self._error(length) if report.converged else None
            good = report.converged and (error or 0.0) <= 1.5 * (self.accuracy or np.inf)
            allowed = self.interface.allowed(length) if good else 0.5 * length
            if allowed >= length:
                allowance = self._tolerance()
                from_new_mesh = min(p.time for p in self.past[: self.order + 1]) <= self._new_mesh
                if not from_new_mesh:
                    self.last_error = error
                elif error is not None and self.last_error is not None:
                    # States from another mesh distort it.
                    self.last_error = min(error, self.last_error)
                self.number += 1
                return TimeStep(
                    self.number, self.fluid.time, length, error, rejected, report, allowance
                )
            self._restore()
            if not report.converged:
                self.next_length = allowed
            if not good and allowed < self._shortest:
                break
            length = allowed
        implicit = self.fluid.model.convection == "implicit"
        linear = ', numerics.convection = "extrapolated"' if implicit else ""
        remedy = (
            f"use a finer mesh (smaller numerics.mesh_size){linear} or a smaller Reynolds number"
        )
        raise ConvergenceError(
            f"the step from t = {self.fluid.time:.6g} does not converge even at length {length:.3g}: "
            + (report.failure or remedy)
        )

    def _attempt(self, length: float) -> NewtonReport:
        """Solve a step; an impulsive start begins, if necessary, with a much shorter step."""
        if not self.fluid.model.unsteady:
            self.fluid.time = self.past[0].time + length
            return self.fluid.solve(self._tolerance(), keep_factors=True)
        self._discretise(length)
        report = self.interface.attempt(length, self._order, self._tolerance())
        if report.converged or len(self.past) > 1:
            return report
        self._restore()
        self._discretise(IMPULSE * length)
        if not self.fluid.solve(self._tolerance()).converged:
            return report
        set_off = self.fluid.state.x.array.copy()
        self._discretise(length)
        self.fluid.state.x.array[:] = set_off
        return self.interface.attempt(length, self._order, self._tolerance())

    @property
    def _order(self) -> int:
        return min(self.order, len(self.past))

    def _discretise(self, length: float) -> None:
        fluid, past = self.fluid, self.past
        ratio = length / (past[0].time - past[1].time) if len(past) > 1 else 1.0
        rate, extrapolation = backward_difference(self._order, length, ratio)
        times = past[0].time + length, past[0].time, past[min(1, len(past) - 1)].time
        fluid.discretise_time(rate, extrapolation, times)
        for function, before in zip(fluid.history, [*past[:2], past[-1]], strict=False):
            function.x.array[:] = before.state
        fluid.time = times[0]
        if self._order == 2:
            known = [each.state for each in past]
            fluid.state.x.array[:] = extrapolated([each.time for each in past], known, fluid.time)

    def _tolerance(self) -> float:
        if self.tolerance != "auto":
            return self.tolerance
        if self.last_error is None:
            return 1e-6
        return float(np.clip(0.1 * self.last_error, LEAST, MOST))

    def _restore(self) -> None:
        self.fluid.time = self.past[0].time
        self.fluid.state.x.array[:] = self.past[0].state
        self.interface.restore()

    def _error(self, length: float) -> float | None:
        order = self._order
        past = self.past[: order + 1]
        if len(self.past) <= self.order or not self.fluid.model.unsteady:
            return None
        now, times = self.fluid.time, [p.time for p in past]
        # The leading truncation error, v_tt/2 dt or v_ttt/6 dt (dt + previous dt), over a0.
        a0 = backward_difference(order, length, length / (times[0] - times[1]))[0][0]
        factor = 1 / (a0 * (now - times[-1]))

        def missed(values: np.ndarray, known: list[np.ndarray]) -> np.ndarray:
            return factor * (values - extrapolated(times, known, now))

        error = self.fluid.speed(missed(self.fluid.state.x.array, [p.state for p in past]))
        velocities, speed = self.interface.velocities(), max(self.fluid.speed(), self.least)
        change = float(np.linalg.norm(missed(velocities, [p.velocities for p in past])))
        size = max(float(np.linalg.norm(velocities)), speed)
        return max(error / speed, change / size) if speed else 0.0


def _landing(left: float, step: float) -> float:
    """Step adjusted to reach the end without a much shorter last one."""
    if left <= step * (1 + 1e-9):
        return left
    return 0.5 * left if left < 1.5 * step and left > step * (1 + 1e-6) else step
