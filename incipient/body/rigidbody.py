"""The rigid body of equations (331)-(336): inertia, state, freedom, and the motion over one time step.

Velocities U = (velocity, spin) and loads = (force, torque about the centre of mass) are vectors (n,) in scene
directions: n = 3 in 2-D (x, y, turn), n = 6 in 3-D. The fluid's density is one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats
from ..errors import ConvergenceError, SceneError
from .rkf45 import Integrator
from .state import DEGREES, BodyState, Inertia, turning

RELATIVE, ABSOLUTE = 1e-11, 1e-13  # tolerances of the path
THINNEST = 0.05  # smallest ratio of moments that shapes the path within a step
MAX_ITERATIONS = 25  # of Broyden's method


@dataclass(frozen=True, eq=False)
class Motion:
    """The motion over one time step."""

    body: RigidBody
    start: BodyState
    end: BodyState
    drive: Floats

    def first(self, distance: Callable[[BodyState], float]) -> BodyState | None:
        """The state in which a function of the state first falls below zero within the step, or None."""
        state = self.body.driven(self.start, self.end.time, self.drive, distance)
        return state if state.time < self.end.time else None


class RigidBody:
    """A rigid body that advances over time steps under the mean load of each.

    Over a step of length dt, with mean load F (n,), added mass A (n, n) and the velocities U* of the last iterate of
    the coupling, the velocities U at the end satisfy, in every free degree,

        momentum(U) - momentum(start) + A (U - U*) = dt F,     momentum = (m velocity, J spin).

    With A = (dt / a0) A_u this is the fluid's load linearised about U*, F(U) = F(U*) - A_u (U - U*). Between the ends a
    body of mass one and moments K moves under a constant load p (Broyden's method):

        (velocity, K spin) = (velocity, K spin) at the start + (t - start) p,     place' = velocity.

    K are the moments over the largest, at least 0.05 (equal without inertia): Euler's equations (331)-(333) hold
    unless the body is thinner than that. RKF45 integrates position and orientation, (335). Velocities
    that are not `free`, which are components in scene directions, are zero or those that `prescribed(time)` (n,) gives.
    """

    def __init__(
        self,
        inertia: Inertia,
        free: Sequence[bool] | None = None,
        prescribed: Callable[[float], ArrayLike] | None = None,
    ) -> None:
        self.inertia, self.prescribed = inertia, prescribed
        self.gdim, self.size = inertia.gdim, 3 * (inertia.gdim - 1)
        self.mask = np.array([True] * self.size if free is None else free)
        moments = inertia.moments / (inertia.moments.max() or 1.0)
        self._path = Inertia(1.0, np.maximum(moments, THINNEST), inertia.axes)
        self._free, self._bound = np.ix_(self.mask, self.mask), np.ix_(self.mask, ~self.mask)

    def motion(
        self,
        state: BodyState,
        dt: float,
        load_mean: ArrayLike,
        added: ArrayLike | None = None,
        guess: ArrayLike | None = None,
    ) -> Motion:
        """The motion over a step.

        Args:
            state: at the start; locked velocities are replaced by those imposed.
            load_mean: mean force and torque (n,) over the step.
            added: added mass (n, n), symmetric, positive semi-definite; None: none.
            guess: velocities (n,) at the end in the last iterate; None: those at the start.

        Raises:
            SceneError: a free degree of freedom has neither inertia nor added mass.
            ConvergenceError: the body turns too far in the step, or loads are not finite.
        """
        start, f, end = self.consistent(state), self.mask, state.time + dt
        last = start.velocities if guess is None else np.array(guess, dtype=float)
        impulse = dt * np.array(load_mean, dtype=float)
        added = np.zeros((self.size, self.size)) if added is None else np.array(added, dtype=float)
        if not all(np.isfinite(part).all() for part in (impulse, added, last)):
            raise ConvergenceError(
                "the load on the body is not finite: the flow did not converge; use a smaller time.step"
            )
        last[~f] = self.imposed(end)[~f]
        inverse, path = self._inverse(start, added), self._path.matrix(start.orientation)
        drive = np.where(f, path @ (last - start.velocities) / dt, 0.0)
        slope, residual, change = path[self._free] @ inverse / dt, None, np.empty(0)
        for _ in range(MAX_ITERATIONS):
            state, before = self.driven(start, end, drive), residual
            gained = self.momentum(state) - self.momentum(start) - impulse
            residual = (gained + added @ (state.velocities - last))[f]
            gained = np.abs(impulse) + np.abs(added) @ (np.abs(state.velocities) + np.abs(last))
            # Round-off of what is added up in the balance of momentum
            noise = 1e-15 * np.abs(inverse) @ gained[f]
            if self._small(inverse @ residual, (start, state), inverse @ impulse[f], noise):
                return Motion(self, start, state, drive)
            if before is not None:
                image = slope @ (residual - before)
                slope = slope + np.outer(change - image, change @ slope) / (change @ image)
            change = -slope @ residual
            drive[f] += change
        raise ConvergenceError(
            f"the grain turns too far in a step of {dt:.3g} at t = {start.time:.6g}; use a smaller time.step"
        )

    def imposed(self, time: float) -> Floats:
        """Velocities (n,) of the degrees of freedom that are not free."""
        return np.array(self.prescribed(time) if self.prescribed else np.zeros(self.size), float)

    def consistent(self, state: BodyState) -> BodyState:
        u = np.where(self.mask, state.velocities, self.imposed(state.time))
        return replace(state, velocity=u[: self.gdim], spin=u[self.gdim :])

    def velocities_by_impulses(self, state: BodyState, added: Floats | None = None) -> Floats:
        """Velocities (n, n) gained by unit impulses, with an added mass (n, n).

        Raises SceneError if neither mass nor added mass resists.
        """
        gain = np.zeros((self.size, self.size))
        gain[self._free] = self._inverse(state, gain if added is None else added)
        return gain

    def kinetic_energy(self, state: BodyState) -> float:
        return 0.5 * float(state.velocities @ self.momentum(state))

    def momentum(self, state: BodyState) -> Floats:
        """Linear and angular momentum (n,), the latter about the centre of mass."""
        return self.inertia.matrix(state.orientation) @ state.velocities

    def driven(
        self,
        start: BodyState,
        time: float,
        drive: Floats,
        root: Callable[[BodyState], float] | None = None,
    ) -> BodyState:
        """The state at a time, or at the first root before it, from a start under a constant load (n,)."""
        d, f = self.gdim, self.mask
        if d == 2 and root is None and self.prescribed is None:
            dt = time - start.time
            way = dt * (start.velocities + 0.5 * dt * drive)
            return BodyState.unpacked(start.packed() + np.concatenate([way, dt * drive]), time)
        momentum = self._path.matrix(start.orientation) @ start.velocities

        def state(t: float, y: Floats) -> BodyState:
            u = self.imposed(t)
            at = BodyState(y[:d], y[d:], u[:d], u[d:], t)
            path = self._path.matrix(at.orientation)
            right = (momentum + (t - start.time) * drive)[f] - path[self._bound] @ u[~f]
            u[f] = np.linalg.solve(path[self._free], right)
            return at

        def rate(t: float, y: Floats) -> Floats:
            at = state(t, y)
            return np.concatenate([at.velocity, turning(at.orientation, at.spin)])

        path = Integrator(rate, RELATIVE, ABSOLUTE)
        path.init(start.time, np.concatenate([start.place, start.orientation]))
        path.advance(time, None if root is None else lambda t, y: root(state(t, y)))
        end = state(path.t, path.y)
        return BodyState.unpacked(end.packed(), path.t)

    def _inverse(self, state: BodyState, added: Floats) -> Floats:
        part = (added + self.inertia.matrix(state.orientation))[self._free]
        scale = np.sqrt(np.maximum(np.diag(part), 0.0))
        scale[scale == 0.0] = 1.0
        scaled = part / np.outer(scale, scale)
        values, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
        if values.min(initial=1.0) <= 1e-13:  # round-off
            weakest = np.flatnonzero(self.mask)[int(np.argmax(np.abs(vectors[:, 0])))]
            raise SceneError(
                f"neither mass nor fluid resists a change of {DEGREES[self.size][weakest]}; "
                "give body.density or body.mass"
            )
        return np.asarray(np.linalg.inv(part))

    def _small(
        self, error: Floats, states: tuple[BodyState, BodyState], gain: Floats, noise: Floats
    ) -> bool:
        scale, d = np.max([np.abs(state.velocities) for state in states], axis=0), self.gdim
        scale[self.mask] = np.maximum(scale[self.mask], np.abs(gain))
        kinds = np.repeat([scale[:d].max(), scale[d:].max()], [d, self.size - d])[self.mask]
        return bool((np.abs(error) <= np.maximum(RELATIVE * kinds, noise)).all())


@dataclass(frozen=True, eq=False)
class MeanLoad:
    """The mean load over a step that makes the body's step the backward difference of the fluid.

    With dt dU/dt = a0 U(n+1) + a1 U(n) + a2 U(n-1), a0 + a1 + a2 = 0, the balance m dU/dt = F(n+1) reads
    m (U(n+1) - U(n)) = dt Fm(n+1), if m (U(n) - U(n-1)) = dt(n) Fm(n) and

        Fm(n+1) = (r Fm(n) + (1 + r) F(n+1)) / (1 + 2r),    r = dt(n+1) / dt(n),    a0 = (1 + 2r) / (1 + r).

    A constant load is its own mean. The first step, and with `order` one every step, is a BDF1 step (r = 0).
    """

    order: int = 2
    previous: Any = 0.0  # Fm(n), (n,)
    last_step: float = np.inf

    def _ratio(self, dt: float) -> float:
        return 0.0 if self.order == 1 else dt / self.last_step

    def mean(self, end_load: ArrayLike, dt: float) -> Floats:
        """The mean load (n,) over a step of length dt, from that at its end (n,)."""
        r = self._ratio(dt)
        return np.asarray((r * self.previous + (1 + r) * np.asarray(end_load)) / (1 + 2 * r))

    def added(self, added_resistance: ArrayLike, dt: float) -> Floats:
        """The added mass (n, n) = (dt / a0) A_u for -dF/dU = A_u (n, n)."""
        r = self._ratio(dt)
        return np.asarray(added_resistance) * (dt * (1 + r) / (1 + 2 * r))

    def accept(self, end_load: ArrayLike, dt: float) -> MeanLoad:
        """The mean load for the next step, after a step of length dt with a load (n,) at its end."""
        return replace(self, previous=self.mean(end_load, dt), last_step=dt)
