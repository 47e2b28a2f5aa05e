"""A rigid body: its inertia and its state of motion; vectors as in `rigidbody`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, cross, point, quarter_turned, unit
from ..geometry.placement import Placement, rotation_of

DEGREES = {
    3: ("velocity along x", "velocity along y", "spin"),
    6: (*(f"velocity along {axis}" for axis in "xyz"), *(f"spin about {axis}" for axis in "xyz")),
}


@dataclass(frozen=True, eq=False)
class Inertia:
    """Mass, principal moments, and in 3-D the principal axes in the body frame: columns (3, 3).

    One moment (1,) in 2-D, three (3,) in 3-D; zero: only the added mass resists.
    """

    mass: float
    moments: Floats
    axes: Floats | None = None

    @classmethod
    def about(cls, mass: float, tensor: Floats, gdim: int) -> Inertia:
        """The inertia of a tensor (3, 3) about the centre of mass; in 2-D its last entry counts."""
        if gdim == 2:
            return cls(mass, tensor[2, 2:])
        if np.count_nonzero(tensor - np.diag(np.diagonal(tensor))) == 0:
            return cls(mass, np.diagonal(tensor).copy())  # the axes as they are, in their order
        moments, axes = np.linalg.eigh(tensor)
        return cls(mass, np.maximum(moments, 0.0), axes)

    @property
    def gdim(self) -> int:
        return 2 if len(self.moments) == 1 else 3

    def matrix(self, orientation: Floats) -> Floats:
        """Matrix (k, k) of mass and moments at an orientation; k = 3 in 2-D, 6 in 3-D."""
        axes = np.eye(len(self.moments)) if self.axes is None else self.axes
        if len(orientation) == 4:
            axes = rotation_of(orientation).as_matrix() @ axes
        d = self.gdim
        whole = self.mass * np.eye(3 * d - 3)
        whole[d:, d:] = (axes * self.moments) @ axes.T
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
        place, turned, velocity, spin = np.split(y, np.cumsum([d, turns, d]))
        return cls(place, turned if d == 2 else unit(turned), velocity, spin, time)

    def packed(self) -> Floats:
        """Position, orientation, velocity, spin as one vector: (6,) in 2-D, (13,) in 3-D."""
        return np.concatenate([self.place, self.orientation, self.velocity, self.spin])

    @property
    def velocities(self) -> Floats:
        return np.concatenate([self.velocity, self.spin])

    @property
    def placement(self) -> Placement:
        if len(self.place) == 2:
            return Placement(point(self.place), float(self.orientation[0]))
        return Placement(point(self.place), quaternion=point(self.orientation))


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
