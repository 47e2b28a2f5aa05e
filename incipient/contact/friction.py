"""Coulomb friction cone, shifted by cohesion; local forces are (normal, two tangential)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from functools import cached_property

import numpy as np

from incipient.arrays import Booleans, Floats, Integers
from incipient.errors import SceneError

FRICTIONLESS = 1e-9  # smaller coefficients count as zero
INFINITE = 1e6  # in place of larger coefficients
# Edges (2, 3) of a 45-degree cone in 2-D, and axes (3, 3) of one in 3-D, whose multipliers are in the unit cone.
EDGES, AXES = np.array([[1.0, 1.0, 0.0], [1.0, -1.0, 0.0]]), np.eye(3)

Rows = Integers | Booleans | slice | int


@dataclass(frozen=True, eq=False)
class FrictionCone:
    """Forces N >= 0, |T| <= coefficient N, where N is the normal force plus cohesion.

    `coefficient`: a number, possibly infinite, or (n,), all zero or none.
    `cohesion`: largest pull of a contact [force], same shape; the points of a patch share it.
    """

    coefficient: Floats
    cohesion: Floats = field(default_factory=lambda: np.zeros(()))

    @classmethod
    def of(cls, law: Law, cohesion: float = 0.0) -> FrictionCone:
        """Return a law, or build it from a coefficient; raises SceneError for invalid values."""
        cone = (
            law
            if isinstance(law, FrictionCone)
            else cls(np.asarray(law, float), np.asarray(cohesion, float))
        )
        if not (cone.coefficient >= 0.0).all():
            raise SceneError(
                f"friction {cone.coefficient} is not a coefficient; give a number that is not negative"
            )
        if not ((cone.cohesion >= 0.0) & np.isfinite(cone.cohesion)).all():
            raise SceneError(
                f"cohesion {cone.cohesion} is not allowed; give a finite number that is not negative"
            )
        return cone

    def rows(self, count: int) -> FrictionCone:
        return self._each(lambda number: np.broadcast_to(number, count))

    def __getitem__(self, rows: Rows) -> FrictionCone:
        return self._each(lambda number: number[rows] if number.shape else number)

    def _each(self, change: Callable[[Floats], Floats]) -> FrictionCone:
        return replace(
            self, **{item.name: change(getattr(self, item.name)) for item in fields(self)}
        )

    def changed(self, change: float) -> FrictionCone:
        return replace(self, coefficient=np.maximum(self.coefficient + change, 0.0))

    @property
    def is_cohesive(self) -> bool:
        return bool((self.cohesion > 0.0).any())

    @property
    def is_usual(self) -> Booleans:
        """Mask of cases with non-zero friction and valid cohesion."""
        pulls = (self.cohesion >= 0.0) & np.isfinite(self.cohesion)
        return pulls & (self.coefficient > FRICTIONLESS)

    @property
    def is_frictionless(self) -> bool:
        return bool(self.coefficient.flat[0] < FRICTIONLESS)

    @cached_property
    def bounded(self) -> Floats:
        """The coefficient, or zero or `INFINITE` where it counts as that."""
        bounded = np.minimum(self.coefficient, INFINITE)
        return np.where(self.coefficient < FRICTIONLESS, 0.0, bounded)

    @cached_property
    def scaling(self) -> Floats:
        """Cosine, sine, sine of the friction angle, (..., 3)."""
        scaling = np.empty((*self.coefficient.shape, 3))
        scaling[..., 0] = 1.0 / np.hypot(1.0, self.bounded)
        scaling[..., 1:] = np.sin(np.arctan(self.bounded))[..., None]
        return scaling

    def generators(self, planar: bool) -> Floats:
        """Local forces (..., g, 3) that span the cone: normal, edges in 2-D, or axes in 3-D."""
        units = EDGES if planar else AXES
        return self.scaling[..., None, :] * (AXES[:1] if self.is_frictionless else units)

    def margin(self, local: Floats) -> Floats:
        """Signed distance (..., k) of local forces (..., k, 3) from the cone's surface, negative outside."""
        cosine, sine = self.scaling[..., 0, None], self.scaling[..., 1, None]
        return np.asarray(sine * local[..., 0] - cosine * np.hypot(local[..., 1], local[..., 2]))

    def edge(self, shear: Floats) -> Floats:
        """Unit forces (..., k, 3) on the cone's surface along tangential directions (..., k, 2)."""
        edge = np.ones((*shear.shape[:-1], 3))
        size = np.maximum(np.hypot(shear[..., :1], shear[..., 1:]), 1e-300)
        np.divide(shear, size, out=edge[..., 1:])
        return self.scaling[..., None, :] * edge

    def project(self, local: Floats) -> Floats:
        """The nearest forces (..., 3) in the cone."""
        outside = self.margin(local) < 0.0
        if not outside.any():
            return local
        edge = self.edge(local[..., 1:])
        along = np.maximum((edge * local).sum(axis=-1), 0.0)
        return np.where(outside[..., None], along[..., None] * edge, local)


Law = FrictionCone | float  # contact law, or a coefficient of static friction
