"""What a rigid body is and where: its inertia, its state of motion, and which of its motions are free.

Velocities U = (velocity, spin) are vectors (n,) in scene directions: n = 3 in the plane (x, y, counter-clockwise
turn), n = 6 in space. Units are those of the scene, the fluid's density is one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats, quarter_turned
from ..errors import SceneError
from ..geometry.placement import Placement

DEGREES = {
    3: ("velocity along x", "velocity along y", "spin"),
    6: (*(f"velocity along {axis}" for axis in "xyz"), *(f"spin about {axis}" for axis in "xyz")),
}
THINNEST = 0.05  # smallest ratio of moments by which a couple's share in the path is divided


class Shape(Protocol):
    """The properties of a grain of `incipient.geometry` that its mass follows from."""

    @property
    def gdim(self) -> int:
        """Dimension of the space."""

    @property
    def volume(self) -> float:
        """Area or volume."""

    @property
    def inertia(self) -> Floats:
        """Inertia (3, 3) about the centroid for unit density, in the body frame."""


@dataclass(frozen=True, eq=False)
class Inertia:
    """Mass, principal moments, and in space the principal axes in the body frame: columns (3, 3), right-handed.

    One moment (1,) in the plane, three (3,) in space. Mass and moments may be zero: then only the fluid that is
    moved along resists. Raises SceneError on values that no distribution of mass has.
    """

    mass: float
    moments: Floats
    axes: Floats | None = None

    def __post_init__(self) -> None:
        moments = np.atleast_1d(np.array(self.moments, dtype=float))
        if moments.shape not in ((1,), (3,)):
            raise SceneError(
                "a body has one moment of inertia in the plane, three in space; give as many"
            )
        if not (np.isfinite([self.mass, *moments]).all() and min(self.mass, *moments) >= 0.0):
            raise SceneError(
                f"mass {self.mass} and moments of inertia {moments} must be zero or more; change them"
            )
        if len(moments) == 3 and 2 * moments.max() > moments.sum() * (1 + 1e-9):
            raise SceneError(
                f"of the moments of inertia {moments} one exceeds the sum of the others; change it"
            )
        axes = np.eye(len(moments)) if self.axes is None else np.array(self.axes, dtype=float)
        if axes.shape != (len(moments),) * 2 or not np.allclose(
            axes.T @ axes, np.eye(len(axes)), atol=1e-9
        ):
            raise SceneError(
                "the principal axes must be the orthonormal columns of a matrix; change them"
            )
        object.__setattr__(self, "moments", moments)
        object.__setattr__(self, "axes", axes)

    @classmethod
    def of(cls, grain: Shape, density: float) -> Inertia:
        """The inertia of a uniform grain; `density` is relative to the fluid's."""
        tensor = density * np.asarray(grain.inertia, dtype=float)
        if grain.gdim == 2:
            return cls(density * grain.volume, np.array([tensor[2, 2]]))
        return cls.about(density * grain.volume, tensor)

    @classmethod
    def about(cls, mass: float, tensor: Floats) -> Inertia:
        """The inertia in space of a tensor (3, 3) about the centre of mass, in the body frame."""
        if np.count_nonzero(tensor - np.diag(np.diagonal(tensor))) == 0:
            return cls(mass, np.diagonal(tensor).copy())  # the axes as they are, in their order
        moments, axes = np.linalg.eigh(tensor)
        if np.linalg.det(axes) < 0.0:
            axes[:, 0] *= -1.0
        return cls(mass, np.maximum(moments, 0.0), axes)

    @property
    def gdim(self) -> int:
        """Dimension of the space."""
        return 2 if len(self.moments) == 1 else 3

    @cached_property
    def shape_moments(self) -> Floats:
        """Moments over the largest, at least THINNEST; ones without inertia. They shape paths, not balances."""
        largest = self.moments.max()
        return (
            np.maximum(self.moments / largest, THINNEST)
            if largest > 0.0
            else np.ones_like(self.moments)
        )

    def gyroscopic(self, spin: Floats) -> Floats:
        """The free rate of the spin in principal axes, (J W x W) / J: equations (331)-(333) without couple.

        Bounded by the spin squared, whatever the moments; zero about an axis without inertia.
        """
        if len(self.moments) == 1:
            return np.zeros(1)
        couple = cross(self.moments * spin, spin)
        return np.asarray(
            np.divide(couple, self.moments, out=np.zeros(3), where=self.moments > 0.0)
        )


@dataclass(frozen=True, eq=False)
class BodyState:
    """Where a body is and how it moves at a time.

    Place (gdim,) of the centre of mass; orientation: the angle (1,), unbounded, in the plane, a unit quaternion
    w, x, y, z (4,) in space; velocity (gdim,); spin (1,) or (3,), in scene directions.
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
        """The state at a placement, with velocities (n,), by default at rest."""
        d = placement.gdim
        u = np.zeros(3 * (d - 1)) if velocities is None else np.array(velocities, dtype=float)
        turned = [placement.angle] if placement.quaternion is None else placement.quaternion
        return cls(np.array(placement.centre), np.array(turned), u[:d], u[d:], time)

    @classmethod
    def unpacked(cls, vector: ArrayLike, time: float = 0.0) -> BodyState:
        """The state from a vector (6,) or (13,) as `packed` makes it; the quaternion is normalised."""
        y = np.array(vector, dtype=float)
        d, turns = (2, 1) if len(y) == 6 else (3, 4)
        turned = y[d : d + turns]
        turned = turned if turns == 1 else turned / np.linalg.norm(turned)
        return cls(y[:d], turned, y[d + turns : 2 * d + turns], y[2 * d + turns :], time)

    def packed(self) -> Floats:
        """Place, orientation, velocity, spin as one vector: (6,) in the plane, (13,) in space."""
        return np.concatenate([self.place, self.orientation, self.velocity, self.spin])

    @property
    def velocities(self) -> Floats:
        """Velocity and spin (n,)."""
        return np.concatenate([self.velocity, self.spin])

    @property
    def placement(self) -> Placement:
        """The placement of the body's frame, as the geometry knows it."""
        centre = tuple(self.place.tolist())
        if len(centre) == 2:
            return Placement(centre, float(self.orientation[0]))
        w, x, y, z = self.orientation.tolist()
        return Placement(centre, 0.0, (w, x, y, z))

    def rotation(self) -> Floats:
        """The matrix (gdim, gdim) that turns body coordinates into scene directions."""
        return self.placement.rotation


@dataclass(frozen=True)
class Freedom:
    """Which degrees of freedom (n,) are free; the others stand still or follow `motion(time)`.

    In space the rotational ones are the components of the spin in scene directions. `motion` gives all
    velocities (n,); those of free degrees are not looked at.
    """

    free: tuple[bool, ...]
    motion: Callable[[float], ArrayLike] | None = None

    def __post_init__(self) -> None:
        if len(self.free) not in DEGREES:
            raise SceneError(
                "a body has three degrees of freedom in the plane, six in space; name as many"
            )

    @classmethod
    def whole(cls, gdim: int) -> Freedom:
        """All free."""
        return cls((True,) * (3 * (gdim - 1)))

    @classmethod
    def none(cls, gdim: int, motion: Callable[[float], ArrayLike] | None = None) -> Freedom:
        """All held, or all following a motion."""
        return cls((False,) * (3 * (gdim - 1)), motion)

    @cached_property
    def mask(self) -> NDArray[np.bool_]:
        """True where free, (n,)."""
        return np.array(self.free)

    def imposed(self, time: float) -> Floats:
        """The velocities (n,) that locked degrees have at a time."""
        if self.motion is None:
            return np.zeros(len(self.free))
        return np.array(self.motion(time), dtype=float)


def rotation_matrix(quaternion: Floats) -> Floats:
    """The rotation (3, 3) of a quaternion w, x, y, z (4,) of any length but zero."""
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + 2.0 * (w * across + across @ across))


def cross(a: Floats, b: Floats) -> Floats:
    """a ^ b of two vectors (3,): what numpy's does, in a tenth of the time."""
    (a1, a2, a3), (b1, b2, b3) = a.tolist(), b.tolist()
    return np.array([a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1])


def turning(orientation: Floats, spin: Floats) -> Floats:
    """The rate of an angle (1,) or a quaternion (4,) with a spin (1,) or (3,) in scene directions: (335)."""
    if len(orientation) == 1:
        return spin
    w, v = orientation[0], orientation[1:]
    return 0.5 * np.array([-(spin @ v), *(w * spin + cross(spin, v))])


def rigid_velocity(state: BodyState, x: Floats) -> Floats:
    """Velocities (n, gdim) of a body's points (n, gdim)."""
    return state.velocity + turned(state.spin, x - state.place)


def turned(spin: Floats, arms: Floats) -> Floats:
    """spin x arms, (n, gdim); the spin is (1,) in the plane."""
    if arms.shape[1] == 2:
        return spin[0] * quarter_turned(arms)
    return np.cross(spin, arms)
