"""The rigid body of equations (331)-(336): inertia, state, freedom, and the motion over one time step.

Velocities U = (velocity, spin) and loads = (force, couple about the centre of mass) are vectors (n,) in scene
directions: n = 3 in the plane (x, y, counter-clockwise turn), n = 6 in space. Units are those of the scene, the
fluid's density is one. The plane and space share all code; only what turns a frame differs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats
from ..errors import ConvergenceError, SceneError
from .rkf45 import Integrator, Root, Tolerances
from .state import DEGREES, BodyState, Freedom, Inertia, rotation_matrix, turning

PATH_TOLERANCES = Tolerances(1e-11, 1e-13)
SINGULAR = 1e-13  # scaled eigenvalue below which mass and added mass together count as none
ROUND_OFF = 1e-15  # of what is added up in a balance of momentum
MAX_ITERATIONS = 25  # of Broyden's method


@dataclass(frozen=True, eq=False)
class Motion:
    """The motion over one time step: its end, and everything between."""

    body: RigidBody
    start: BodyState
    end: BodyState
    drive: Floats

    def at(self, time: float) -> BodyState:
        """The state at a time within the step."""
        return self.body.driven(self.start, time, self.end.time, self.drive)

    def first(self, distance: Callable[[BodyState], float]) -> BodyState | None:
        """The state in which a function of the state first falls below zero within the step; None: it does not."""

        def root(t: float, y: Floats) -> float:
            return distance(BodyState.unpacked(y, t))

        end = self.end.time
        state = self.body.driven(self.start, end, end, self.drive, root)
        return state if state.time < end else None


class RigidBody:
    """A rigid body that advances over time steps under the mean load of each.

    Over a step of length dt, with mean load F (n,), body force b per mass, added mass A (n, n) and the velocities
    U* of the last iterate of the coupling, the velocities U at the end satisfy, in every free degree,

        momentum(U) - momentum(start) + A (U - U*) = dt (F + m b),     momentum = (m velocity, J spin).

    With A = (dt / a0) A_u this is the fluid's load linearised about U*, F(U) = F(U*) - A_u (U - U*); it cancels
    when U = U*, and the momentum gained is then dt (F + m b) exactly: the angular one too, for the couple keeps
    its direction in space and J is taken as turned at the end. Nothing is divided by m or J. Between the ends
    the body moves as if free, under a constant drive p (n,) in space that is solved for (Broyden's method):

        velocity' = b + p,    spin' = H (J W x W) / J + H K^-1 H^T p,    W = H^T spin,

    K the moments over the largest, at least 0.05 (ones without inertia). So the path does not depend on A once
    converged; it is the exact one for constant loads unless the body is thinner than that, and always for no
    load; in the plane velocities vary linearly in time, at zero mass, too. RKF45 integrates it with the place
    and the orientation. Locked velocities follow what is imposed, and the constraint's load drops out.

    Args:
        inertia: mass and moments.
        freedom: None: all free.
        body_force: (X/V^2) b of (334), (gdim,), per mass, or a function of time; buoyancy is part of the load.
        tolerances: those of the integrator.
    """

    def __init__(
        self,
        inertia: Inertia,
        freedom: Freedom | None = None,
        body_force: ArrayLike | Callable[[float], ArrayLike] | None = None,
        tolerances: Tolerances = PATH_TOLERANCES,
    ) -> None:
        self.inertia, self.tolerances = inertia, tolerances
        self.freedom = freedom or Freedom.whole(inertia.gdim)
        self.gdim, self.size = inertia.gdim, 3 * (inertia.gdim - 1)
        if len(self.freedom.free) != self.size:
            raise SceneError(
                "inertia and freedom are not of the same dimension; use both in the plane or in space"
            )
        self.body_force = np.zeros(self.gdim) if body_force is None else body_force

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
            dt: length of the step, positive.
            load_mean: mean force and couple (n,) over the step, without the body force.
            added: added mass (n, n), symmetric, positive semi-definite; None: none.
            guess: velocities (n,) at the end in the last iterate; None: those at the start.

        Raises:
            SceneError: a free degree of freedom has neither inertia nor added mass.
            ConvergenceError: the body turns too far in the step, or loads are not finite.
        """
        start = self.consistent(state)
        last = start.velocities if guess is None else np.array(guess, dtype=float)
        load = np.array(load_mean, dtype=float)
        added = np.zeros((self.size, self.size)) if added is None else np.array(added, dtype=float)
        self._require_usable(dt, load, added, last)
        last[~self.mask] = self.freedom.imposed(start.time + dt)[~self.mask]
        return self._solved(start, dt, dt * load, added, last)

    def consistent(self, state: BodyState) -> BodyState:
        """The state with locked velocities replaced by those imposed at its time."""
        u = np.where(self.mask, state.velocities, self.freedom.imposed(state.time))
        return replace(state, velocity=u[: self.gdim], spin=u[self.gdim :])

    def velocities_by_impulses(self, state: BodyState, added: Floats | None = None) -> Floats:
        """(n, n) velocities that a body gains by unit impulses, with an added mass (n, n); none in locked degrees.

        Raises SceneError if neither mass nor added mass resists.
        """
        gain = np.zeros((self.size, self.size))
        gain[np.ix_(self.mask, self.mask)] = self._inverse(state, gain if added is None else added)
        return gain

    def kinetic_energy(self, state: BodyState) -> float:
        """(m v^2 + spin . J spin) / 2."""
        return 0.5 * float(state.velocities @ self.momentum(state))

    def angular_momentum(self, state: BodyState) -> Floats:
        """J spin about the centre of mass, in scene directions, (1,) or (3,)."""
        frame = self._frame(state.orientation)
        return np.asarray(frame @ (self.inertia.moments * (frame.T @ state.spin)))

    def momentum(self, state: BodyState) -> Floats:
        """Linear and angular momentum (n,)."""
        return np.concatenate([self.inertia.mass * state.velocity, self.angular_momentum(state)])

    @property
    def mask(self) -> NDArray[np.bool_]:
        """True for the free degrees of freedom, (n,)."""
        return self.freedom.mask

    def driven(
        self, start: BodyState, time: float, end: float, drive: Floats, root: Root | None = None
    ) -> BodyState:
        """The state at a time, or at the first root before it, under a constant drive (n,).

        `end` is that of the time step, over which accelerations imposed on locked degrees are averaged.
        """
        rate = self._rate(start.time, end, drive)
        path = Integrator(rate, self.tolerances, first_step=end - start.time)
        path.init(start.time, start.packed())
        path.advance(time, root)
        return self.consistent(BodyState.unpacked(path.y, path.t))

    def _require_usable(self, dt: float, load: Floats, added: Floats, last: Floats) -> None:
        n = self.size
        if load.shape != (n,) or last.shape != (n,) or added.shape != (n, n) or not dt > 0.0:
            raise ValueError(
                f"loads and velocities are ({n},), added masses ({n}, {n}), steps positive"
            )
        if not all(np.isfinite(part).all() for part in (load, added, last)):
            raise ConvergenceError(
                "the load on the body is not finite: the flow did not converge; shorten the step"
            )

    def _field(self, time: float) -> Floats:
        """The body force per mass; none on a body without mass."""
        if self.inertia.mass == 0.0:
            return np.zeros(self.gdim)
        return np.asarray(
            self.body_force(time) if callable(self.body_force) else self.body_force, dtype=float
        )

    def _frame(self, orientation: Floats) -> Floats:
        """Principal axes in scene directions, as columns: (3, 3) in space; a turn in the plane keeps its axis."""
        axes = np.asarray(self.inertia.axes)
        return axes if self.gdim == 2 else rotation_matrix(orientation) @ axes

    def _mobility(self, frame: Floats, power: float = -1.0) -> Floats:
        """What gives accelerations from a drive, (n, n); with power 1 its inverse."""
        whole = np.eye(self.size)
        whole[self.gdim :, self.gdim :] = (frame * self.inertia.shape_moments**power) @ frame.T
        return whole

    def _acceleration(
        self, time: float, velocities: Floats, frame: Floats, drive: Floats
    ) -> Floats:
        """Accelerations (n,) under a drive."""
        d, inertia = self.gdim, self.inertia
        spinning = (
            inertia.gyroscopic(frame.T @ velocities[d:])
            + (frame.T @ drive[d:]) / inertia.shape_moments
        )
        return np.concatenate([self._field(time) + drive[:d], frame @ spinning])

    def _constrained(
        self, time: float, velocities: Floats, frame: Floats, drive: Floats, slope: Floats
    ) -> Floats:
        """This load with the constraint's share, which gives the locked degrees the accelerations `slope`."""
        free = self.mask
        mobility = self._mobility(frame)
        acceleration = self._acceleration(time, velocities, frame, np.where(free, drive, 0.0))
        share = np.linalg.solve(mobility[np.ix_(~free, ~free)], slope - acceleration[~free])
        return np.asarray(acceleration + mobility[:, ~free] @ share)

    def _rate(self, start: float, end: float, drive: Floats) -> Callable[[float, Floats], Floats]:
        d, n, free = self.gdim, self.size, self.mask
        imposed, whole = self.freedom.imposed, bool(free.all())
        slope = (imposed(end) - imposed(start))[~free] / (end - start)

        def rate(t: float, y: Floats) -> Floats:
            """The derivative of place, orientation and velocities, packed as in `BodyState`."""
            turned, u = y[d:-n], y[-n:]
            frame = self._frame(turned)
            if whole:
                acceleration = self._acceleration(t, u, frame, drive)
            else:
                u = np.where(free, u, imposed(t))
                acceleration = self._constrained(t, u, frame, drive, slope)
            return np.concatenate([u[:d], turning(turned, u[d:]), acceleration])

        return rate

    def _solved(
        self, start: BodyState, dt: float, impulse: Floats, added: Floats, last: Floats
    ) -> Motion:
        """The motion whose drive satisfies the balance of momentum."""
        f, end = self.mask, start.time + dt
        inverse = self._inverse(start, added)
        if self.gdim == 2 and f.all() and not callable(self.body_force):
            # In the plane velocities are linear in time, and the balance is linear in them.
            falls = np.append(self._field(start.time), 0.0)
            gain = inverse @ (impulse - added @ (start.velocities + dt * falls - last)) + dt * falls
            way = dt * (start.velocities + 0.5 * gain)
            state = BodyState.unpacked(start.packed() + np.concatenate([way, gain]), end)
            return Motion(self, start, state, gain / dt - falls)
        frame = self._frame(start.orientation)
        sizes = self._mobility(frame, 1.0)[np.ix_(f, f)]
        drive = np.zeros(self.size)
        free_acceleration = self._acceleration(start.time, start.velocities, frame, drive)
        drive[f] = sizes @ ((last - start.velocities) / dt - free_acceleration)[f]
        slope, residual, change = sizes @ inverse / dt, None, np.empty(0)
        for _ in range(MAX_ITERATIONS):
            state = self.driven(start, end, end, drive)
            before = residual
            residual = self._residual(start, state, dt, drive, impulse, added, last)[f]
            gained = np.abs(impulse) + np.abs(added) @ (np.abs(state.velocities) + np.abs(last))
            noise = ROUND_OFF * np.abs(inverse) @ gained[f]
            if self._small(inverse @ residual, (start, state), inverse @ impulse[f], noise):
                return Motion(self, start, state, drive)
            if before is not None:
                image = slope @ (residual - before)
                slope = slope + np.outer(change - image, change @ slope) / (change @ image)
            change = -slope @ residual
            drive[f] += change
        raise ConvergenceError(
            f"the body turns too far in a step of {dt:.3g} at t = {start.time:.6g}; shorten it"
        )

    def _inverse(self, start: BodyState, added: Floats) -> Floats:
        """The inverse of mass and added mass in the free degrees."""
        d = self.gdim
        frame, whole = self._frame(start.orientation), added.copy()
        whole[:d, :d] += self.inertia.mass * np.eye(d)
        whole[d:, d:] += (frame * self.inertia.moments) @ frame.T
        names = [
            name for name, free in zip(DEGREES[self.size], self.freedom.free, strict=True) if free
        ]
        part = whole[np.ix_(self.mask, self.mask)]
        scale = np.sqrt(np.maximum(np.diag(part), 0.0))
        missing = [name for name, size in zip(names, scale, strict=True) if size == 0.0]
        if not missing and names:
            scaled = part / np.outer(scale, scale)
            values, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
            if values[0] > SINGULAR:
                return np.asarray(np.linalg.inv(part))
            missing = [names[int(np.argmax(np.abs(vectors[:, 0])))]]
        if missing:
            raise SceneError(
                f"neither mass nor fluid resists a change of {', '.join(missing)}: give the body mass"
            )
        return part

    def _residual(
        self,
        start: BodyState,
        end: BodyState,
        dt: float,
        drive: Floats,
        impulse: Floats,
        added: Floats,
        last: Floats,
    ) -> Floats:
        """Momentum gained beyond what the load gave, (n,); the body force's part is left out on both sides."""
        linear = self.inertia.mass * dt * drive[: self.gdim]
        angular = self.angular_momentum(end) - self.angular_momentum(start)
        return np.concatenate([linear, angular]) - impulse + added @ (end.velocities - last)

    def _small(
        self, error: Floats, states: tuple[BodyState, BodyState], gain: Floats, noise: Floats
    ) -> bool:
        """Whether errors of the free velocities are at the integrator's tolerance, relative to their kind, or noise."""
        scale = np.max([np.abs(state.velocities) for state in states], axis=0)
        scale[self.mask] = np.maximum(scale[self.mask], np.abs(gain))
        kinds = np.where(
            np.arange(self.size) < self.gdim, scale[: self.gdim].max(), scale[self.gdim :].max()
        )
        return bool(
            (np.abs(error) <= np.maximum(self.tolerances.relative * kinds[self.mask], noise)).all()
        )


@dataclass(frozen=True, eq=False)
class MeanLoad:
    """The mean load over a step that makes the body's step the fluid's own backward difference.

    With dt dU/dt = a0 U(n+1) + a1 U(n) + a2 U(n-1), a0 + a1 + a2 = 0, the balance m dU/dt = F(n+1) reads
    m (U(n+1) - U(n)) = dt Fm(n+1), if m (U(n) - U(n-1)) = dt(n) Fm(n) and

        Fm(n+1) = (a2 / a0) (dt(n) / dt(n+1)) Fm(n) + F(n+1) / a0.

    The weights add up to one, so a constant load is its own mean. The first step is a BDF1 step (Fm = F).
    A value, not a process: keep the old one to go back, store its fields to resume.
    """

    order: int = 2
    previous: Floats | None = None
    last_step: float | None = None

    def coefficients(self, dt: float) -> tuple[float, float, float]:
        """a0, a1, a2, dimensionless, of a step of length dt."""
        if self.order == 1 or self.last_step is None:
            return 1.0, -1.0, 0.0
        r = dt / self.last_step
        return (1 + 2 * r) / (1 + r), -(1 + r), r**2 / (1 + r)

    def mean(self, end_load: ArrayLike, dt: float) -> Floats:
        """The mean load (n,) over a step of length dt, from that at its end (n,)."""
        a0, _, a2 = self.coefficients(dt)
        now = np.asarray(end_load, dtype=float) / a0
        if self.previous is None or self.last_step is None:
            return now
        return np.asarray(now + (a2 / a0) * (self.last_step / dt) * self.previous)

    def added(self, added_resistance: ArrayLike, dt: float) -> Floats:
        """The added mass (n, n) = (dt / a0) A_u that goes with -dF/dU = A_u (n, n)."""
        return np.asarray(added_resistance, dtype=float) * (dt / self.coefficients(dt)[0])

    def accept(self, end_load: ArrayLike, dt: float) -> MeanLoad:
        """The mean load for the next step, after a step of length dt with a load (n,) at its end."""
        return replace(self, previous=self.mean(end_load, dt), last_step=dt)
