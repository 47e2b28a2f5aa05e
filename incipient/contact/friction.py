"""Coulomb's friction cone at a contact; local forces are (normal, two tangential)."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from incipient.arrays import Floats
from incipient.errors import SceneError

FRICTIONLESS = 1e-9  # a coefficient below it counts as zero
INFINITE = (
    1e6  # a coefficient above it counts as infinite; in the equations of motion it stands for one
)


@dataclass(frozen=True)
class FrictionCone:
    """Forces N >= 0, |T| <= coefficient N, with a coefficient of static friction of at least 0 or infinite.

    Raises SceneError if the coefficient is negative or not a number.
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
        """(3,): cosine, sine, sine of the friction angle; the unit circular cone times it is the friction cone."""
        cosine = 1.0 / float(np.hypot(1.0, self.coefficient))
        sine = self.coefficient * cosine if np.isfinite(self.coefficient) else 1.0
        return np.array([cosine, sine, sine])

    def generators(self, planar: bool) -> Floats | None:
        """Local forces (g, 3) whose non-negative combinations are the cone; None if it is circular.

        In 2-D the last two are its edges, toward the first tangent and against it.
        """
        normal, sides = np.eye(3)[:1], np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
        if self.is_frictionless:
            return normal
        infinite = self.coefficient > INFINITE
        if planar:
            return np.vstack([normal, sides]) if infinite else self.scaling * (normal + sides)
        return np.vstack([normal, sides, sides[:, [0, 2, 1]]]) if infinite else None

    def margin(self, local: Floats) -> Floats:
        """Distance (...) of local forces (..., 3) from the edge of the cone, negative outside."""
        cosine, sine = self.scaling[:2]
        return np.asarray(sine * local[..., 0] - cosine * np.hypot(local[..., 1], local[..., 2]))

    def project(self, local: Floats) -> Floats:
        """Nearest forces in the cone to local forces (k, 3)."""
        cosine, sine = self.scaling[:2]
        shear = np.hypot(local[:, 1], local[:, 2])
        along = np.maximum(cosine * local[:, 0] + sine * shear, 0.0)
        edge = np.empty_like(local)
        edge[:, 0] = cosine * along
        edge[:, 1:] = (sine * along / np.maximum(shear, 1e-300))[:, None] * local[:, 1:]
        return np.where((self.margin(local) >= 0.0)[:, None], local, edge)

    def mobilised(self, pressure: Floats, shear: Floats) -> Floats:
        """Fraction (k,) of the shear that friction answers: 1 where a contact sticks.

        pressure, shear: magnitudes (k,) of the normal and tangential forces.
        """
        limit = self.coefficient * pressure
        sticks = limit >= shear
        return np.asarray(np.where(sticks, 1.0, limit / np.where(sticks, 1.0, shear)))
