"""Position and rotation of a grain."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Floats
from incipient.errors import SceneError
from incipient.geometry.contacts import UNIT_TOLERANCE

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

Quaternion = tuple[float, float, float, float]


@dataclass(frozen=True)
class Placement:
    """Position of a grain's centroid, and rotation.

    In 2-D `angle` (radians, counter-clockwise); in 3-D the unit `quaternion` (w, x, y, z). Raises SceneError on invalid
    numbers.
    """

    centre: tuple[float, ...]
    angle: float = 0.0
    quaternion: Quaternion | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", tuple(map(float, self.centre)))
        object.__setattr__(self, "angle", float(self.angle))
        if not np.isfinite([*self.centre, self.angle]).all():
            raise SceneError(
                f"the placement {self.centre}, {self.angle} is not finite; give finite numbers"
            )
        if len(self.centre) == 3:
            object.__setattr__(self, "quaternion", self._unit_quaternion())
        elif self.quaternion is not None:
            raise SceneError("a 2-D placement has no quaternion; give its angle")

    def _unit_quaternion(self) -> Quaternion:
        if self.angle != 0.0:
            raise SceneError("a 3-D placement has no angle; give a quaternion (w, x, y, z)")
        if self.quaternion is None:
            return 1.0, 0.0, 0.0, 0.0
        listed = np.array(self.quaternion, dtype=float)
        length = float(np.linalg.norm(listed)) if listed.shape == (4,) else np.nan
        if not abs(length - 1.0) <= UNIT_TOLERANCE:
            raise SceneError(
                f"the quaternion {self.quaternion} is not of unit length; normalise it"
            )
        w, x, y, z = (listed / length).tolist()
        return w, x, y, z

    @property
    def gdim(self) -> int:
        return len(self.centre)

    @cached_property
    def rotation(self) -> Floats:
        """Read-only matrix (gdim, gdim) from body coordinates to scene directions."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        matrix = (
            np.array([[c, -s], [s, c]])
            if self.quaternion is None
            else rotation_of(self.quaternion).as_matrix()
        )
        matrix.flags.writeable = False
        return matrix

    def to_scene(self, x: ArrayLike) -> Floats:
        return np.asarray(x, dtype=float) @ self.rotation.T + np.asarray(self.centre)

    def to_body(self, x: ArrayLike) -> Floats:
        return np.asarray((np.asarray(x, dtype=float) - np.asarray(self.centre)) @ self.rotation)

    def raised(self, height: float) -> "Placement":
        return Placement((*self.centre[:-1], self.centre[-1] + height), self.angle, self.quaternion)

    def moved(self, shift: ArrayLike, turn: ArrayLike) -> "Placement":
        """Shifted by (gdim,) and turned about the centroid by an angle (1,), in 3-D a scene rotation vector (3,)."""
        centre = tuple((np.asarray(self.centre) + np.asarray(shift, dtype=float)).tolist())
        vector = np.atleast_1d(np.asarray(turn, dtype=float))
        if self.quaternion is None:
            return Placement(centre, self.angle + float(vector[0]))
        from scipy.spatial.transform import Rotation  # which takes time to import

        turned = Rotation.from_rotvec(vector) * rotation_of(self.quaternion)
        x, y, z, w = turned.as_quat().tolist()
        return Placement(centre, 0.0, (w, x, y, z))

    def turn_since(self, first: "Placement") -> Floats:
        """The angle (1,), in 3-D the shortest rotation vector (3,), from `first` to this [radians]."""
        if self.quaternion is None or first.quaternion is None:
            return np.array([self.angle - first.angle])
        turn = rotation_of(self.quaternion) * rotation_of(first.quaternion).inv()
        return np.asarray(turn.as_rotvec())


def rotation_of(quaternion: Sequence[float] | Floats) -> "Rotation":
    """Rotation by a quaternion (w, x, y, z) of any length."""
    from scipy.spatial.transform import Rotation  # which takes time to import

    w, x, y, z = quaternion
    return Rotation.from_quat([x, y, z, w])
