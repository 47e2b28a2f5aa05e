"""Properties of every rigid grain, in the plane and in space."""

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Floats
from incipient.errors import SceneError
from incipient.geometry.moments import Moments, inertia_of

FEW = 50  # points of which all pairs are looked at


class Shape(ABC):
    """A rigid grain f(x) = 0 in its body frame, centroid at the origin; lengths are scene units."""

    gdim: int  # dimension of the space the grain lives in

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


def require_not_negative(name: str, value: float) -> None:
    """Refuse a length that is negative or no finite number."""
    if not (np.isfinite(value) and value >= 0.0):
        raise SceneError(f"{name} {value} is not a length; give a number that is not negative")


def largest_distance(points: Floats) -> float:
    """The largest distance of two points (n, d); for many points among those of their hull."""
    if len(points) <= FEW:
        return float(np.linalg.norm(points[:, None] - points, axis=2).max())
    from scipy.spatial import ConvexHull  # which takes time to import
    from scipy.spatial.distance import cdist

    points = points[ConvexHull(points).vertices]
    away = np.linalg.norm(points - points.mean(axis=0), axis=1)
    ends = cdist(points[[np.argmax(away)]], points)
    # Two points are at most as far apart as both are from the middle together; equal ones differ by round-off.
    points = points[away + away.max() >= (1.0 - 1e-9) * ends.max()]
    blocks = np.array_split(points, 1 + len(points) // 500)
    return max(float(cdist(block, points).max(initial=0.0)) for block in blocks)
