"""Rigid beds z = b(x, y) in space: height, normal, distance, and the pieces that a grain may touch.

Every bed takes `origin_z`, the height of its base plane in the scene. Lengths are scene units, angles radians.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Floats, rows, unit
from incipient.errors import SceneError
from incipient.geometry.shape import require_not_negative, require_positive
from incipient.geometry.space.pieces import Graph, HalfSpacesAndBalls, Pieces

Sides = tuple[float, float]
Extent = tuple[Sides, Sides]
MOST_ACROSS = 1000  # points of the rule for means along each side


class Terrain(ABC):
    """A rigid surface z = b(x, y) below the fluid."""

    gdim = 3  # dimension of the space it lies in
    origin_z: float

    @property
    @abstractmethod
    def feature(self) -> float:
        """The smallest horizontal length of the bed's shape, for choosing numbers of samples (inf: none)."""

    @property
    def extent(self) -> Extent:
        """The abscissae between which the bed is known, for both directions."""
        return (-np.inf, np.inf), (-np.inf, np.inf)

    @abstractmethod
    def height(self, x: ArrayLike) -> Floats:
        """b at points (n, 2), (n,)."""

    @property
    @abstractmethod
    def crest(self) -> float:
        """A height that the bed nowhere exceeds."""

    def crest_level(self, x: Sides, y: Sides) -> float:
        """The height that the crests reach over a rectangle of the plane; by default `crest`."""
        return self.crest

    def mean(self, x: Sides, y: Sides) -> float:
        """The mean height over a rectangle: over the middles of equal parts of it, ten of them to a feature."""
        places = []
        for low, high in (x, y):
            count = int(np.clip(10.0 * (high - low) / self.feature, 2, MOST_ACROSS))
            places.append(low + (high - low) * (np.arange(count) + 0.5) / count)
        return float(self.height(np.stack(np.meshgrid(*places), axis=-1).reshape(-1, 2)).mean())

    @abstractmethod
    def gradient(self, x: ArrayLike) -> Floats:
        """The derivatives of b at points (n, 2), (n, 2)."""

    @abstractmethod
    def pieces(self, middle: ArrayLike, reach: float) -> Pieces:
        """The pieces within a horizontal distance `reach` of a point (2,)."""

    def normal(self, x: ArrayLike) -> Floats:
        """Unit normals into the fluid at points (n, 2), (n, 3)."""
        slope = self.gradient(x)
        normals = np.column_stack([-slope, np.ones(len(slope))])
        # Where the bed is vertical the slope is infinite.
        steep = ~np.isfinite(slope).all(axis=1)
        outward = np.where(np.isfinite(slope[steep]), 0.0, -np.sign(slope[steep]))
        normals[steep] = np.column_stack([outward, np.zeros(len(outward))])
        return unit(normals)

    def nearest(self, points: ArrayLike) -> Floats:
        """The point of the bed nearest to each of the points (n, 3) in the fluid, (n, 3).

        On smooth beds the best of nine starts: exact where the distance is less than about a feature.
        """
        return self._distances_and_feet(rows(points))[1]

    def distance(self, points: ArrayLike) -> Floats:
        """The Euclidean distance of points (n, 3) from the bed, (n,), negative below it; see `nearest`."""
        return self._distances_and_feet(rows(points))[0]

    def _distances_and_feet(self, points: Floats) -> tuple[Floats, Floats]:
        """Signed distances (n,) and nearest points (n, 3)."""
        middle = 0.5 * (points[:, :2].min(axis=0) + points[:, :2].max(axis=0))
        above = np.abs(points[:, 2] - self.height(points[:, :2])).max()
        reach = float(np.linalg.norm(points[:, :2] - middle, axis=1).max() + above)
        pieces = self.pieces(middle, reach)
        if isinstance(pieces, Graph):
            step = 0.25 * min(pieces.feature, 4.0 * float(above))
            offsets = step * np.array([[i, j] for i in (0, -1, 1) for j in (0, -1, 1)])
            which = np.zeros(len(points), dtype=int)
            sights = [pieces.sight(points, which, points[:, :2] + offset) for offset in offsets]
        else:
            nearest = np.argmin(pieces.rough(points), axis=0)
            sights = [pieces.sight(points, nearest, points[:, :2])]
        gaps, feet = np.array([s.gaps for s in sights]), np.array([s.feet for s in sights])
        apart = np.linalg.norm(feet - points, axis=2)
        best = np.argmin(apart, axis=0)
        each = np.arange(len(points))
        return np.copysign(apart[best, each], gaps[best, each]), feet[best, each]


@dataclass(frozen=True)
class Plane(Terrain):
    """z = origin_z + slope[0] x + slope[1] y; the slopes are tangents of angles."""

    feature = np.inf
    slope: tuple[float, float] = (0.0, 0.0)
    origin_z: float = 0.0

    def __post_init__(self) -> None:
        if not np.isfinite([*self.slope, self.origin_z]).all():
            raise SceneError(f"the plane's slope {self.slope} is not finite; give finite numbers")

    @property
    def crest(self) -> float:
        """`origin_z` of a level plane; a slope has no crest."""
        return float("inf") if any(self.slope) else self.origin_z

    def crest_level(self, x: Sides, y: Sides) -> float:
        """The highest corner of the rectangle."""
        return float(self.height([[a, b] for a in x for b in y]).max())

    def height(self, x: ArrayLike) -> Floats:
        """b at points (n, 2), (n,)."""
        return np.asarray(self.origin_z + rows(x) @ np.asarray(self.slope))

    def gradient(self, x: ArrayLike) -> Floats:
        """The slope everywhere, (n, 2)."""
        return np.tile(np.asarray(self.slope, dtype=float), (len(rows(x)), 1))

    def pieces(self, middle: ArrayLike, reach: float) -> Pieces:
        """The half-space below."""
        return _with_balls(self.origin_z, self.normal([[0.0, 0.0]]), np.empty((0, 3)), np.empty(0))


def _with_balls(origin_z: float, normal: Floats, centres: Floats, radii: Floats) -> Pieces:
    return HalfSpacesAndBalls(np.array([[0.0, 0.0, origin_z]]), normal, centres, radii)


class BallLattice(Terrain):
    """Balls of one size on a regular array in or above a plane."""

    radius: float
    spacing: float
    arrangement: str
    offset: tuple[float, float]
    angle: float

    @property
    def feature(self) -> float:
        """The radius, or half the spacing where that is smaller."""
        return min(self.radius, 0.5 * self.spacing)

    @cached_property
    def _lattice(self) -> Floats:
        """The two steps from one centre to its neighbours, in rows."""
        steps = (
            np.eye(2)
            if self.arrangement == "square"
            else np.array([[1.0, 0.0], [0.5, np.sqrt(0.75)]])
        )
        c, s = np.cos(self.angle), np.sin(self.angle)
        return np.asarray(self.spacing * steps @ np.array([[c, s], [-s, c]]))

    def _places(self, middle: Floats, reach: float, beyond: int) -> Floats:
        """Whole steps (k, 2) from the first centre to all within a distance of a point (2,), and some beyond."""
        home = np.round(np.linalg.solve(self._lattice.T, middle - np.asarray(self.offset)))
        around = int(np.ceil(1.2 * reach / self.spacing)) + beyond
        steps = np.arange(-around, around + 1)
        return np.asarray(home + np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2))

    @abstractmethod
    def centres(self, middle: ArrayLike, reach: float) -> Floats:
        """All centres (k, 3) within a horizontal distance of a point (2,)."""

    def pieces(self, middle: ArrayLike, reach: float) -> Pieces:
        """The half-space below the base plane, and the balls."""
        centres = self.centres(middle, reach + self.radius)
        up = np.array([[0.0, 0.0, 1.0]])
        return _with_balls(self.origin_z, up, centres, np.full(len(centres), self.radius))


@dataclass(frozen=True)
class Hemispheres(BallLattice):
    """Half-balls centred on the plane z = origin_z in a regular array, one of them at `offset`.

    arrangement "square": centres `spacing` apart along x and y; "triangular": rows along x, each shifted by
    half a spacing against the one before, so that neighbours form equilateral triangles; the whole is turned by
    `angle` about the vertical. Half-balls closer than their diameter overlap.
    """

    radius: float
    spacing: float
    arrangement: Literal["square", "triangular"] = "square"
    offset: tuple[float, float] = (0.0, 0.0)
    origin_z: float = 0.0
    angle: float = 0.0

    def __post_init__(self) -> None:
        require_positive("radius", self.radius)
        require_positive("spacing", self.spacing)
        if self.arrangement not in ("square", "triangular"):
            raise SceneError(
                f'arrangement "{self.arrangement}" is not known; use "square" or "triangular"'
            )

    @property
    def crest(self) -> float:
        """The top of the half-balls."""
        return self.origin_z + self.radius

    def centres(self, middle: ArrayLike, reach: float) -> Floats:
        """All centres (k, 3) within a horizontal distance of a point (2,)."""
        middle = np.asarray(middle, dtype=float)
        centres = np.asarray(self.offset) + self._places(middle, reach, 1) @ self._lattice
        centres = centres[np.linalg.norm(centres - middle, axis=1) <= reach]
        return np.column_stack([centres, np.full(len(centres), self.origin_z)])

    def _away(self, x: ArrayLike) -> Floats:
        """The vectors (n, 2) from the nearest centre to points (n, 2)."""
        relative = rows(x) - np.asarray(self.offset)
        home = np.round(np.linalg.solve(self._lattice.T, relative.T).T)
        around = np.array([[i, j] for i in (-1, 0, 1) for j in (-1, 0, 1)])
        away = relative[:, None] - (home[:, None] + around) @ self._lattice
        best = np.argmin((away**2).sum(axis=2), axis=1)
        return np.asarray(away[np.arange(len(relative)), best])

    def height(self, x: ArrayLike) -> Floats:
        """b at points (n, 2), (n,)."""
        squared = (self._away(x) ** 2).sum(axis=1)
        return np.asarray(self.origin_z + np.sqrt(np.maximum(self.radius**2 - squared, 0.0)))

    def gradient(self, x: ArrayLike) -> Floats:
        """The derivatives (n, 2), infinite at the feet of half-balls."""
        away = self._away(x)
        below = self.radius**2 - (away**2).sum(axis=1, keepdims=True)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(below >= 0.0, -away / np.sqrt(np.maximum(below, 0.0)), 0.0)


class SmoothTerrain(Terrain):
    """A bed with two derivatives."""

    @property
    def steepest(self) -> float:
        """The tangent of the steepest slope between places as close as the bed's shape is known; 0: it is not known."""
        return 0.0

    @abstractmethod
    def hessian(self, x: ArrayLike) -> Floats:
        """The second derivatives of b at points (n, 2), (n, 2, 2)."""

    def pieces(self, middle: ArrayLike, reach: float) -> Pieces:
        """The whole bed."""
        return Graph(self.height, self.gradient, self.hessian, self.feature)


@dataclass(frozen=True)
class Ridges(SmoothTerrain):
    """z = origin_z + amplitude sin(2 pi (x cos(angle) + y sin(angle)) / wavelength + phase)."""

    amplitude: float
    wavelength: float
    angle: float = 0.0
    phase: float = 0.0
    origin_z: float = 0.0

    def __post_init__(self) -> None:
        require_positive("wavelength", self.wavelength)
        require_not_negative("amplitude", self.amplitude)

    @property
    def steepest(self) -> float:
        """Midway between crests and troughs."""
        return 2.0 * np.pi * self.amplitude / self.wavelength

    @property
    def _wave(self) -> Floats:
        """The wave vector (1, 2)."""
        k = 2.0 * np.pi / self.wavelength
        return np.array([[k * np.cos(self.angle), k * np.sin(self.angle)]])

    @property
    def feature(self) -> float:
        """Half the wavelength, or the radius of curvature at a crest where that is smaller."""
        number = float(np.linalg.norm(self._wave, axis=1)[0])
        curvature = self.amplitude * (number * number)
        return min(np.pi / number, 1.0 / curvature if curvature > 0.0 else np.inf)

    @property
    def crest(self) -> float:
        """The height of the crests."""
        return self.origin_z + self.amplitude

    def mean(self, x: Sides, y: Sides) -> float:
        """`origin_z`, the mean over a wavelength."""
        return self.origin_z

    def height(self, x: ArrayLike) -> Floats:
        """b at points (n, 2), (n,)."""
        return np.asarray(self.origin_z + self.amplitude * np.sin(self._phases(x))[:, 0])

    def gradient(self, x: ArrayLike) -> Floats:
        """The derivatives (n, 2)."""
        return np.asarray(np.cos(self._phases(x)) * (self.amplitude * self._wave))

    def hessian(self, x: ArrayLike) -> Floats:
        """The second derivatives (n, 2, 2)."""
        sines = -self.amplitude * np.sin(self._phases(x))
        return np.einsum("nk,ki,kj->nij", sines, self._wave, self._wave)

    def _phases(self, x: ArrayLike) -> Floats:
        """The arguments (n, 1) of the sine at points (n, 2)."""
        return np.asarray(rows(x) @ self._wave.T + self.phase)
