"""Properties of every rigid grain, in the plane and in space."""

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Floats
from incipient.errors import SceneError
from incipient.geometry.moments import Moments, inertia_of


class Shape(ABC):
    """A rigid grain f(x) = 0 in its body frame, centroid at the origin; lengths are scene units."""

    gdim: int  # dimension of the space the grain lives in

    @property
    def centroid(self) -> Floats:
        """The centre of mass of a uniform grain (gdim,): the origin of the body frame."""
        return np.zeros(self.gdim)

    @property
    @abstractmethod
    def size(self) -> float:
        """The largest diameter."""

    @property
    def _moments(self) -> Moments:
        """Integrals over the grain in its body frame, of grains whose volume and inertia follow from these."""
        raise NotImplementedError

    @property
    def volume(self) -> float:
        """The volume; in the plane the area, which is the volume per unit depth."""
        return self._moments.volume

    @property
    def inertia(self) -> Floats:
        """The inertia (3, 3) about the centroid for unit density: in the plane only the 33 component."""
        return inertia_of(self._moments.about_centroid())

    @abstractmethod
    def level(self, x: ArrayLike) -> Floats:
        """f at points (n, gdim), (n,): negative inside, zero on the surface; a length, not always distance."""

    @abstractmethod
    def normal(self, x: ArrayLike) -> Floats:
        """Outward unit normals (n, gdim) at points (n, gdim) on or near the surface; at corners the bisector."""


def require_positive(name: str, *values: float) -> None:
    """Refuse lengths that are not positive numbers."""
    for value in values:
        if not (np.isfinite(value) and value > 0.0):
            raise SceneError(f"{name} {value} is not a positive length; give a positive number")
