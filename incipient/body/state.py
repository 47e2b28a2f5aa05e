"""A rigid body: its inertia, its state of motion, and its degrees of freedom; vectors as in `rigidbody`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats, cross, quarter_turned
from ..errors import SceneError
from ..geometry.placement import Placement, rotation_of

DEGREES = {
    3: ("velocity along x", "velocity along y", "spin"),
    6: (*(f"velocity along {axis}" for axis in "xyz"), *(f"spin about {axis}" for axis in "xyz")),
}
THINNEST = 0.05  # smallest ratio of moments that shapes the path within a step


@dataclass(frozen=True, eq=False)
class Inertia:
    """Mass, principal moments, and in 3-D the principal axes in the body frame: columns (3, 3), right-handed.

    One moment (1,) in 2-D, three (3,) in 3-D; zero: only the added mass resists. Raises SceneError on values of no
    distribution of mass.
    """

    mass: float
    moments: Floats
    axes: Floats | None = None

    def __post_init__(self) -> None:
        moments = self.moments
        if not (np.isfinite([self.mass, *moments]).all() and min(self.mass, *moments) >= 0.0):
            raise SceneError(
                f"mass {self.mass} and moments of inertia {moments} must be zero or more; change them"
            )
        if len(moments) == 3 and 2 * moments.max() > moments.sum() * (1 + 1e-9):
            raise SceneError(
                f"of the moments of inertia {moments} one exceeds the sum of the others; change it"
            )

    @classmethod
    def about(cls, mass: float, tensor: Floats, gdim: int) -> Inertia:
        """The inertia of a tensor (3, 3) about the centre of mass; in 2-D its last entry counts."""
        if gdim == 2:
            return cls(mass, tensor[2, 2:])
        if np.count_nonzero(tensor - np.diag(np.diagonal(tensor))) == 0:
            return cls(mass, np.diagonal(tensor).copy())  # the axes as they are, in their order
        moments, axes = np.linalg.eigh(tensor)
        if np.linalg.det(axes) < 0.0:
            axes[:, 0] *= -1.0
        return cls(mass, np.maximum(moments, 0.0), axes)

    @property
    def gdim(self) -> int:
        return 2 if len(self.moments) == 1 else 3

    @cached_property
    def path_moments(self) -> Floats:
        """Moments over the largest, at least `THINNEST`; ones without inertia."""
        largest = self.moments.max()
        if largest == 0.0:
            return np.ones_like(self.moments)
        return np.asarray(np.maximum(self.moments / largest, THINNEST))

    def matrix(self, orientation: Floats, mass: float, moments: Floats) -> Floats:
        """Matrix (k, k) of mass and moments at an orientation; k = 3 in 2-D, 6 in 3-D."""
        axes = np.eye(len(self.moments)) if self.axes is None else self.axes
        if len(orientation) == 4:
            axes = rotation_of(orientation).as_matrix() @ axes
        d = self.gdim
        whole = mass * np.eye(3 * d - 3)
        whole[d:, d:] = (axes * moments) @ axes.T
        return whole


@dataclass(frozen=True, eq=False)
class BodyState:
    """Position, orientation and velocities of a body at a time.

    place: of the centre of mass (gdim,)
    orientation: in 2-D the angle (1,), unbounded; in 3-D a unit quaternion w, x, y, z (4,)
    velocity, spin: (gdim,) and (1,) or (3,), in scene directions
    """

    place: Floats
    orientation: Floats
    velocity: Floats
    spin: Floats
    time: float = 0.0

    @classmethod
    def at(
        cls, placement: Placement, velocities: ArrayLike | None = None, time: float = 0.0
    ) -> BodyState:
        """State of a placement, with velocities (3,) or (6,), zero by default."""
        d = placement.gdim
        u = np.zeros(3 * (d - 1)) if velocities is None else np.array(velocities, dtype=float)
        turned = [placement.angle] if placement.quaternion is None else placement.quaternion
        return cls(np.array(placement.centre), np.array(turned), u[:d], u[d:], time)

    @classmethod
    def unpacked(cls, vector: ArrayLike, time: float = 0.0) -> BodyState:
        """State of a vector made by `packed`, its quaternion normalised."""
        y = np.array(vector, dtype=float)
        d, turns = (2, 1) if len(y) == 6 else (3, 4)
        turned = y[d : d + turns]
        turned = turned if turns == 1 else turned / np.linalg.norm(turned)
        return cls(y[:d], turned, y[d + turns : 2 * d + turns], y[2 * d + turns :], time)

    def packed(self) -> Floats:
        """Position, orientation, velocity, spin as one vector: (6,) in 2-D, (13,) in 3-D."""
        return np.concatenate([self.place, self.orientation, self.velocity, self.spin])

    @property
    def velocities(self) -> Floats:
        return np.concatenate([self.velocity, self.spin])

    @property
    def placement(self) -> Placement:
        centre = tuple(self.place.tolist())
        if len(centre) == 2:
            return Placement(centre, float(self.orientation[0]))
        w, x, y, z = self.orientation.tolist()
        return Placement(centre, 0.0, (w, x, y, z))


@dataclass(frozen=True)
class Freedom:
    """Which degrees of freedom (n,) are free; the others stand still or follow `motion(time)`.

    Rotations are components of the spin in scene directions. `motion` gives all velocities (n,).
    """

    free: tuple[bool, ...]
    motion: Callable[[float], ArrayLike] | None = None

    @cached_property
    def mask(self) -> NDArray[np.bool_]:
        return np.array(self.free)

    def imposed(self, time: float) -> Floats:
        if self.motion is None:
            return np.zeros(len(self.free))
        return np.array(self.motion(time), dtype=float)


def turning(orientation: Floats, spin: Floats) -> Floats:
    """Rate of an angle (1,) or a quaternion (4,) with a spin (1,) or (3,) in scene directions: (335)."""
    if len(orientation) == 1:
        return spin
    w, v = orientation[0], orientation[1:]
    return 0.5 * np.array([-(spin @ v), *(w * spin + cross(spin, v))])


def rigid_velocity(state: BodyState, x: Floats) -> Floats:
    """Velocities (n, gdim) of a body's points (n, gdim)."""
    return state.velocity + turned(state.spin, x - state.place)


def turned(spin: Floats, arms: Floats) -> Floats:
    """spin x arms, (n, gdim); the spin is (1,) in 2-D."""
    if arms.shape[1] == 2:
        return spin[0] * quarter_turned(arms)
    return np.cross(spin, arms)
