"""Coulomb's law of friction at a contact: its coefficient, the cone of forces that it allows, and what slips.

Local forces are (normal, two along the surface).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from incipient.arrays import Floats
from incipient.errors import SceneError

FRICTIONLESS = 1e-9  # friction below it is computed as none
INFINITE = 1e9  # friction above it is computed as infinite


@dataclass(frozen=True)
class FrictionLaw:
    """Coulomb's law with a coefficient of static friction of at least 0, which may be infinite.

    Raises SceneError if it is negative or not a number.
    """

    coefficient: float

    def __post_init__(self) -> None:
        if not self.coefficient >= 0.0:
            raise SceneError(
                f"friction {self.coefficient} is not a coefficient; give a number that is not negative"
            )

    @property
    def is_frictionless(self) -> bool:
        """Whether the coefficient counts as zero."""
        return self.coefficient < FRICTIONLESS

    @cached_property
    def scaling(self) -> Floats:
        """(3,): cosine, sine, sine of the friction angle; a unit circular cone times it is the friction cone."""
        cosine = 1.0 / float(np.hypot(1.0, self.coefficient))
        sine = self.coefficient * cosine if np.isfinite(self.coefficient) else 1.0
        return np.array([cosine, sine, sine])

    def fan(self, planar: bool) -> Floats | None:
        """Local forces (g, 3) whose sums with factors >= 0 are the cone; None if it is circular.

        In the plane the last two are its edges, on the side of the first tangent and opposite.
        """
        normal, sides = np.eye(3)[:1], np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
        if self.is_frictionless:
            return normal
        wide = self.coefficient > INFINITE
        if planar:
            return np.vstack([normal, sides]) if wide else self.scaling * (normal + sides)
        return np.vstack([normal, sides, sides[:, [0, 2, 1]]]) if wide else None

    def room(self, local: Floats) -> Floats:
        """How far local forces (..., 3) are inside the cone, (...); negative outside."""
        cosine, sine = self.scaling[:2]
        return np.asarray(sine * local[..., 0] - cosine * np.hypot(local[..., 1], local[..., 2]))

    def nearest(self, local: Floats) -> Floats:
        """The forces in the cone that are nearest to local forces (k, 3): to take off round-off."""
        cosine, sine = self.scaling[:2]
        shear = np.hypot(local[:, 1], local[:, 2])
        along = np.maximum(cosine * local[:, 0] + sine * shear, 0.0)
        edge = np.empty_like(local)
        edge[:, 0] = cosine * along
        edge[:, 1:] = (sine * along / np.maximum(shear, 1e-300))[:, None] * local[:, 1:]
        return np.where((self.room(local) >= 0.0)[:, None], local, edge)

    def share(self, pressure: Floats, shear: Floats) -> Floats:
        """The share (k,) of the force along the surface that friction answers: 1 where a contact sticks.

        pressure, shear: sizes (k,) of the forces along the normal and along the surface, of at least 0.
        """
        most = self.coefficient * pressure
        sticks = most >= shear
        return np.asarray(np.where(sticks, 1.0, most / np.where(sticks, 1.0, shear)))
