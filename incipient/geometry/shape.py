"""Properties of every rigid grain and every bed, and the integrals that those of grains follow from."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import factorial

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Floats, rows, unit
from incipient.errors import SceneError

Sides = tuple[float, float]  # least and largest coordinate along one axis
Extent = tuple[Sides, ...]  # one for each horizontal axis

# Rules exact for quadratic functions, by dimension of the simplex's space: barycentric nodes, weights
QUADRATIC = {
    2: (0.5 + np.array([[-0.5, 0.5], [0.5, -0.5]]) / np.sqrt(3.0), [0.5, 0.5]),
    3: (0.5 * (1.0 - np.eye(3)), [1.0 / 3.0] * 3),
}


@dataclass(frozen=True, eq=False)
class Moments:
    """Volume (in 2-D area), first moments (d,) and second moments (d, d)."""

    volume: float
    first: Floats
    second: Floats

    @property
    def centroid(self) -> Floats:
        return self.first / self.volume

    def about_centroid(self) -> Floats:
        return self.second - self.volume * np.outer(self.centroid, self.centroid)

    @staticmethod
    def within(corners: Floats) -> "Moments":
        """Moments within triangles (m, 3, 3) with outward normals, in 2-D sides (m, 2, 2): signed simplices."""
        content, d = np.linalg.det(corners), corners.shape[-1]
        nodes, weights = QUADRATIC[d]
        flux = np.outer(content / factorial(d - 1), weights).ravel()
        points = (nodes @ corners).reshape(-1, d)
        return Moments.integrated(flux, points)

    @staticmethod
    def integrated(flux: Floats, points: Floats) -> "Moments":
        """Moments within a surface of points (n, d), with x.n dS (n,) there.

        The divergence theorem: div(x) = d, div(x x_i) = (d + 1) x_i, div(x x_i x_j) = (d + 2) x_i x_j.
        """
        d = points.shape[1]
        second = (flux[:, None] * points).T @ points / (d + 2.0)
        return Moments(float(flux.sum()) / d, flux @ points / (d + 1.0), second)


class Shape(ABC):
    """A rigid grain f(x) = 0 in its body frame, centroid at the origin; lengths are scene units."""

    gdim: int  # dimension of the space the grain lives in

    @property
    @abstractmethod
    def size(self) -> float:
        """The largest diameter."""

    @property
    def moments(self) -> Moments:
        raise NotImplementedError

    @property
    def volume(self) -> float:
        return self.moments.volume

    @property
    def inertia(self) -> Floats:
        """Inertia (3, 3) about the centroid for unit density; in 2-D only the 33 component."""
        second = self.moments.about_centroid()
        return np.asarray(np.trace(second) * np.eye(3) - second)

    @abstractmethod
    def level(self, x: ArrayLike) -> Floats:
        """f (n,) at points (n, gdim): a length, negative inside, not always the distance."""

    @abstractmethod
    def normal(self, x: ArrayLike) -> Floats:
        """Outward unit normals (n, gdim) near the surface; at corners the bisector."""


class RigidBed(ABC):
    """A rigid surface below the fluid, a height over each horizontal position; lengths are scene units."""

    gdim: int  # dimension of the space it lies in

    @property
    @abstractmethod
    def feature(self) -> float:
        """The smallest horizontal length of the bed's shape (inf: none)."""

    @property
    def extent(self) -> Extent:
        return ((-np.inf, np.inf),) * (self.gdim - 1)

    @property
    def period(self) -> float | None:
        """Distance after which bedforms repeat (None: they do not)."""
        return None

    @property
    @abstractmethod
    def crest(self) -> float:
        """A height that the bed nowhere exceeds."""

    def crest_level(self, *sides: Sides) -> float:
        """Height that the crests reach over an interval or a rectangle, whatever the phase of a periodic bed."""
        return self.crest

    @abstractmethod
    def height(self, x: ArrayLike) -> Floats:
        """Heights (n,) at abscissae (n,), in 3-D at points (n, 2)."""


class Balls(Shape):
    """Connected discs or spheres, about the centroid of their union.

    Raises SceneError if one overlaps no other, or lies within another.
    """

    centres: tuple[tuple[float, ...], ...]
    radii: tuple[float, ...]
    _moments: Moments

    def __init__(
        self, centres: Sequence[Sequence[float]] | Floats, radii: Sequence[float] | Floats
    ) -> None:
        points, sizes = checked_balls(centres, radii, self.gdim)
        whole = self.union(points, sizes)
        about = Moments(whole.volume, np.zeros(self.gdim), whole.about_centroid())
        object.__setattr__(self, "_moments", about)
        centred = (points - whole.centroid).tolist()
        object.__setattr__(self, "centres", tuple(map(tuple, centred)))
        object.__setattr__(self, "radii", tuple(sizes.tolist()))

    @staticmethod
    @abstractmethod
    def union(centres: Floats, radii: Floats) -> Moments:
        """Moments of the union of balls with centres (n, d) and radii (n,)."""

    @property
    def moments(self) -> Moments:
        return self._moments

    @cached_property
    def tables(self) -> tuple[Floats, Floats]:
        return np.array(self.centres), np.array(self.radii)

    @property
    def size(self) -> float:
        centres, radii = self.tables
        apart = np.linalg.norm(centres[:, None] - centres, axis=2)
        return float((apart + np.add.outer(radii, radii)).max())

    def level(self, x: ArrayLike) -> Floats:
        centres, radii = self.tables
        return np.asarray((np.linalg.norm(rows(x)[:, None] - centres, axis=2) - radii).min(axis=1))

    def normal(self, x: ArrayLike) -> Floats:
        centres, radii = self.tables
        away = rows(x)[:, None] - centres
        distance = np.linalg.norm(away, axis=2) - radii
        nearest = distance <= distance.min(axis=1, keepdims=True) + 1e-12 * self.size
        return unit((unit(away) * nearest[..., None]).sum(axis=1))


def checked_balls(centres: ArrayLike, radii: ArrayLike, dimension: int) -> tuple[Floats, Floats]:
    """Centres (n, dimension) and radii (n,), checked to be connected and none to lie within another."""
    from scipy.sparse.csgraph import connected_components  # which takes time to import

    points, sizes = np.reshape(centres, (-1, dimension)).astype(float), np.array(radii, float)
    apart = np.linalg.norm(points[:, None] - points, axis=2)
    slack = 1e-6 * np.minimum.outer(sizes, sizes)  # balls that overlap by less are not connected
    parts, part = connected_components(apart < np.add.outer(sizes, sizes) - slack)
    if parts > 1:
        k = int(np.argmax(part != part[0]))
        raise SceneError(f"number {k} of the union does not overlap the others; move it closer")
    first, second = np.indices(apart.shape)
    larger = (sizes > sizes[:, None]) | ((sizes == sizes[:, None]) & (second > first))
    hidden = (larger & (apart <= sizes - sizes[:, None] + 1e-12 * sizes)).any(axis=1)
    if hidden.any():
        kind = {2: "disc", 3: "sphere"}[dimension]
        raise SceneError(
            f"{kind} {np.argmax(hidden)} of the union lies within the others; leave it out"
        )
    return points, sizes


def largest_distance(points: Floats) -> float:
    """Largest distance of two points (n, d); of many among those of their hull."""
    if len(points) <= 50:  # all pairs
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
