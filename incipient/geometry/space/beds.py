"""Rigid beds z = b(x, y) in 3-D: height, normal, distance, and the pieces that a grain may touch.

A bed's solid is the union of its pieces, half-spaces and balls or one smooth graph, so that a grain is clear of the bed
if it is clear of every piece. Every bed takes `origin_z`, the height of its base plane in the scene. Lengths are scene
units, angles radians.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Floats, rows, unit
from incipient.errors import SceneError
from incipient.geometry.contacts import ClosestPoints
from incipient.geometry.shape import require_not_negative, require_positive
from incipient.geometry.space.surfaces import NearestOf

Sides = tuple[float, float]
Extent = tuple[Sides, Sides]
MOST_ACROSS = 1000  # points of the rule for means along each side
LOWEST = 0.5  # of the radius, by which a sphere in disorder may lie lower
AROUND = 2  # places of the lattice on either side at which a sphere above a point may belong


@dataclass(frozen=True, eq=False)
class HalfSpacesAndBalls:
    """Half-spaces below planes through `origins` (p, 3) with unit normals (p, 3), then balls.

    Balls have `centres` (b, 3) and `radii` (b,); those that are `posts` (b,) reach downwards without end.
    """

    origins: Floats
    directions: Floats
    centres: Floats
    radii: Floats
    posts: np.ndarray | None = None

    @property
    def flat(self) -> np.ndarray:
        """True for the half-spaces."""
        return np.arange(len(self.origins) + len(self.centres)) < len(self.origins)

    def distance_estimate(self, points: Floats) -> Floats:
        """The exact distances (k, n)."""
        above = points @ self.directions.T - (self.origins * self.directions).sum(axis=1)
        away = (
            np.linalg.norm(self._beside(points[:, None], np.arange(len(self.radii))), axis=2)
            - self.radii
        )
        return np.concatenate([above.T, away.T])

    def _beside(self, points: Floats, balls: np.ndarray) -> Floats:
        """Vectors (..., 3) to points from the centres of balls, from the axes of posts below these."""
        away = points - self.centres[balls]
        if self.posts is not None:
            away[..., 2] = np.where(self.posts[balls], np.maximum(away[..., 2], 0.0), away[..., 2])
        return np.asarray(away)

    def closest(self, points: Floats, which: np.ndarray, near: Floats) -> ClosestPoints:
        """Closed formulae; `near` does not matter."""
        gaps, normals = np.empty(len(points)), np.empty((len(points), 3))
        hessians = np.zeros((len(points), 3, 3))
        flat = which < len(self.origins)
        plane, ball = which[flat], which[~flat] - len(self.origins)
        normals[flat] = self.directions[plane]
        gaps[flat] = ((points[flat] - self.origins[plane]) * normals[flat]).sum(axis=1)
        away = self._beside(points[~flat], ball)
        length = np.maximum(np.linalg.norm(away, axis=1), 1e-300)
        normals[~flat] = away / length[:, None]
        gaps[~flat] = length - self.radii[ball]
        across = np.eye(3) - np.einsum("ni,nj->nij", normals[~flat], normals[~flat])
        hessians[~flat] = across / length[:, None, None]
        return ClosestPoints(gaps, points, normals, hessians)


@dataclass(frozen=True, eq=False)
class Graph:
    """A smooth bed z = b(x): `height`, `gradient` and `hessian` at points (n, 2); `feature` bounds the steps."""

    height: Callable[[Floats], Floats]
    gradient: Callable[[Floats], Floats]
    hessian: Callable[[Floats], Floats]  # (n, 2) -> (n, 2, 2)
    feature: float

    @property
    def flat(self) -> np.ndarray:
        """There is one piece, and it is none."""
        return np.array([False])

    def distance_estimate(self, points: Floats) -> Floats:
        """The height above the tangent plane straight below, (1, n)."""
        above = points[:, 2] - self.height(points[:, :2])
        slope = self.gradient(points[:, :2])
        return np.asarray(above / np.sqrt(1.0 + (slope**2).sum(axis=1)))[None]

    def closest(self, points: Floats, which: np.ndarray, near: Floats) -> ClosestPoints:
        """The local nearest points by Newton's method from `near`."""
        x = self._feet(points, near)
        height, slope, curvature = self.height(x), self.gradient(x), self.hessian(x)
        stretch = np.sqrt(1.0 + (slope**2).sum(axis=1))
        normals = np.column_stack([-slope, np.ones(len(x))]) / stretch[:, None]
        feet = np.column_stack([x, height])
        gaps = ((points - feet) * normals).sum(axis=1)
        second = _hessians(gaps, slope, -curvature / stretch[:, None, None])
        return ClosestPoints(gaps, points, normals, second)

    def _feet(self, points: Floats, near: Floats) -> Floats:
        """Where (n, 2) the vector to the points is normal to the bed."""
        x = near.copy()
        best, least = x.copy(), np.full(len(x), np.inf)
        pending = np.arange(len(x))
        for _ in range(30):
            residual, step = self._foot_step(points[pending], x[pending])
            size = np.abs(residual).max(axis=1, initial=0.0)
            better = size < least[pending]
            improved = pending[better]
            best[improved], least[improved] = x[improved], size[better]
            # Rows that get no better have reached round-off; others get two more tries.
            going = better & (size > 1e-15 * (self.feature + np.abs(x[pending]).max(axis=1)))
            x[pending] -= step
            pending = pending[going]
            if len(pending) == 0:
                break
        return best

    def _foot_step(self, points: Floats, x: Floats) -> tuple[Floats, Floats]:
        """What (n, 2) makes x no foot of the points, and Newton's step to remove it, bounded."""
        offset, slope = self.height(x) - points[:, 2], self.gradient(x)
        residual = x - points[:, :2] + offset[:, None] * slope
        matrix = np.eye(2) + np.einsum("ni,nj->nij", slope, slope)
        bent = matrix + offset[:, None, None] * self.hessian(x)
        convex = (np.linalg.det(bent) > 0.0) & (bent[:, 0, 0] > 0.0)
        step = np.linalg.solve(np.where(convex[:, None, None], bent, matrix), residual[..., None])[
            ..., 0
        ]
        length = np.linalg.norm(step, axis=1, keepdims=True)
        return residual, step * np.minimum(1.0, 0.25 * self.feature / np.maximum(length, 1e-300))


Pieces = HalfSpacesAndBalls | Graph


def _hessians(gaps: Floats, slope: Floats, second: Floats) -> Floats:
    """Second derivatives (n, 3, 3) of the distance from a graph, its second form given in coordinates (n, 2, 2).

    At a distance d a curvature k of the bed becomes k / (1 + d k).
    """
    tangents = np.zeros((len(gaps), 3, 2))
    tangents[:, 0, 0] = tangents[:, 1, 1] = 1.0
    tangents[:, 2] = slope
    metric = np.eye(2) + np.einsum("ni,nj->nij", slope, slope)
    shape = np.linalg.solve(metric, second)
    denominator = np.eye(2) + gaps[:, None, None] * shape
    # Beyond the centre of curvature there is no nearest point; there the plain curvature does.
    regular = np.linalg.det(denominator) > 1e-6
    denominator = np.where(regular[:, None, None], denominator, np.eye(2))
    bent = shape @ np.linalg.inv(denominator)
    return np.asarray(tangents @ bent @ np.linalg.inv(metric) @ np.swapaxes(tangents, 1, 2))


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
            sights = [pieces.closest(points, which, points[:, :2] + offset) for offset in offsets]
        else:
            nearest = np.argmin(pieces.distance_estimate(points), axis=0)
            sights = [pieces.closest(points, nearest, points[:, :2])]
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
        origin, normal = np.array([[0.0, 0.0, self.origin_z]]), self.normal([[0.0, 0.0]])
        return HalfSpacesAndBalls(origin, normal, np.empty((0, 3)), np.empty(0))


class SphereBed(Terrain):
    """Spheres above the half-space below the plane z = origin_z; the bed's solid is the union."""

    @abstractmethod
    def near(self, middle: Floats, reach: float) -> tuple[np.ndarray, Floats, Floats, np.ndarray]:
        """Numbers (k,), centres, radii and posts of the spheres of which a part is within a horizontal distance."""

    def pieces(self, middle: ArrayLike, reach: float) -> Pieces:
        """The half-space and the spheres of which a part is within a horizontal distance of a point (2,)."""
        _, centres, radii, posts = self.near(np.asarray(middle, dtype=float), reach)
        base, up = np.array([[0.0, 0.0, self.origin_z]]), np.array([[0.0, 0.0, 1.0]])
        return HalfSpacesAndBalls(base, up, centres, radii, posts if posts.any() else None)

    def _seen(self, x: ArrayLike) -> tuple[Floats, np.ndarray, Floats]:
        """Heights (n,) at points (n, 2), which sphere is there, -1 on the base, and where its centre is (n, 3)."""
        points = rows(x)
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        reach = float(np.linalg.norm(points - middle, axis=1).max())
        number, centres, radii, _ = self.near(middle, reach)
        heights, which = np.full(len(points), self.origin_z), np.full(len(points), -1)
        over = np.zeros((len(points), 3))
        for k, below in enumerate(NearestOf(points).within(centres[:, :2], radii)):
            squared = ((points[below] - centres[k, :2]) ** 2).sum(axis=1)
            top = centres[k, 2] + np.sqrt(np.maximum(radii[k] ** 2 - squared, 0.0))
            higher = below[top > heights[below]]
            heights[higher], which[higher] = top[top > heights[below]], number[k]
            over[higher] = centres[k]
        return heights, which, over

    def height(self, x: ArrayLike) -> Floats:
        """b at points (n, 2), (n,)."""
        return self._seen(x)[0]

    def highest(self, x: ArrayLike) -> np.ndarray:
        """Which sphere is seen from above at points (n, 2), (n,); -1: the base plane."""
        return self._seen(x)[1]

    def gradient(self, x: ArrayLike) -> Floats:
        """The derivatives (n, 2), infinite at the equators of spheres."""
        heights, which, centres = self._seen(x)
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = (centres[:, :2] - rows(x)) / (heights - centres[:, 2])[:, None]
        return np.asarray(np.where((which < 0)[:, None], 0.0, slope))


@dataclass(frozen=True, init=False, eq=False)
class SphereHeap(SphereBed):
    """Spheres with given centres (k, 3) and radii (k,), and the half-space below the plane z = origin_z.

    Those that are `posts` (k,) reach down to the plane as cylinders, so that no pores are below them. The bed's solid
    is the union; heights are those of its upper side. Raises SceneError if a number is not finite or a radius not
    positive.
    """

    centres: Floats
    radii: Floats
    origin_z: float
    posts: np.ndarray

    def __init__(
        self,
        centres: ArrayLike,
        radii: ArrayLike,
        origin_z: float = 0.0,
        posts: ArrayLike | None = None,
    ) -> None:
        points, sizes = np.array(centres, dtype=float).reshape(-1, 3), np.ravel(radii).astype(float)
        if len(points) != len(sizes) or not len(sizes):
            raise SceneError(
                f"{len(points)} centres and {len(sizes)} radii; give as many of both, one or more"
            )
        if not (np.isfinite(points).all() and np.isfinite(sizes).all() and (sizes > 0.0).all()):
            raise SceneError(
                "centres and radii are not finite or not positive; give finite, positive numbers"
            )
        standing = (
            np.zeros(len(sizes), dtype=bool) if posts is None else np.array(posts, dtype=bool)
        )
        values = {"centres": points, "radii": sizes, "origin_z": float(origin_z), "posts": standing}
        for name, value in values.items():
            object.__setattr__(self, name, value)

    @property
    def feature(self) -> float:
        """The smallest radius, of a sphere if there is one."""
        return float(self.radii[self.posts if self.posts.all() else ~self.posts].min())

    @property
    def crest(self) -> float:
        """The top of the highest sphere, or the base plane."""
        return max(float((self.centres[:, 2] + self.radii).max()), self.origin_z)

    def crest_level(self, x: Sides, y: Sides) -> float:
        """The height that spheres with centres over a rectangle reach."""
        low, high = np.array([x, y]).T
        inside = ((self.centres[:, :2] >= low) & (self.centres[:, :2] <= high)).all(axis=1)
        tops = (self.centres[:, 2] + self.radii)[inside]
        return max(float(tops.max(initial=-np.inf)), self.origin_z)

    def near(self, middle: Floats, reach: float) -> tuple[np.ndarray, Floats, Floats, np.ndarray]:
        """Numbers (k,) in the list, centres, radii and posts."""
        away = np.linalg.norm(self.centres[:, :2] - middle, axis=1)
        number = np.flatnonzero(away <= reach + self.radii)
        return number, self.centres[number], self.radii[number], self.posts[number]


@dataclass(frozen=True)
class Hemispheres(SphereBed):
    """Spheres of one size in a regular array; the centres of the lowest lie on the plane z = origin_z.

    arrangement "square": centres `spacing` apart along x and y; "triangular": rows along x, each shifted by half a
    spacing against the one before, so that neighbours form equilateral triangles; every further layer lies in the
    pockets of that below it. "random": the triangular array whose every sphere is shifted horizontally as far as its
    neighbours leave room, and lowered by at most half a radius, by chance: the same for the same seed, wherever the bed
    is looked at. A centre of the array is at `offset`; the whole is turned by `angle` about the vertical. Spheres
    closer than their diameter overlap.
    """

    radius: float
    spacing: float
    arrangement: Literal["square", "triangular", "random"] = "square"
    offset: tuple[float, float] = (0.0, 0.0)
    origin_z: float = 0.0
    angle: float = 0.0
    layers: int = 1
    seed: int = 0

    def __post_init__(self) -> None:
        require_positive("radius", self.radius)
        require_positive("spacing", self.spacing)
        if self.arrangement not in ("square", "triangular", "random"):
            raise SceneError(
                f'arrangement "{self.arrangement}" is not known; use "square" or "triangular"'
            )
        if self.layers < 1:
            raise SceneError(f"layers {self.layers} is none; give one or more")
        if self.layers > 1 and not self._rise > 0.0:
            raise SceneError(
                "spheres so far apart carry no further layer; reduce spacing or give layers = 1"
            )

    @property
    def feature(self) -> float:
        """The radius, or half the spacing where that is smaller."""
        return min(self.radius, 0.5 * self.spacing)

    @property
    def crest(self) -> float:
        """The top of the uppermost spheres, in disorder of one that is not lowered."""
        return self.origin_z + (self.layers - 1) * self._rise + self.radius

    def crest_level(self, x: Sides, y: Sides) -> float:
        """`crest`."""
        return self.crest

    @cached_property
    def _lattice(self) -> Floats:
        """The two steps from one centre to its neighbours, in rows."""
        second = [0.0, 1.0] if self.arrangement == "square" else [0.5, np.sqrt(0.75)]
        c, s = np.cos(self.angle), np.sin(self.angle)
        return np.asarray(
            self.spacing * np.array([[1.0, 0.0], second]) @ np.array([[c, s], [-s, c]])
        )

    @property
    def _pocket(self) -> Floats:
        """Where, in steps of the lattice, the pockets of a layer are."""
        return np.full(2, 0.5 if self.arrangement == "square" else 1.0 / 3.0)

    @property
    def _rise(self) -> float:
        """The height of a layer above that below it."""
        across = float(np.linalg.norm(self._pocket @ self._lattice))
        return float(np.sqrt(max(4.0 * self.radius**2 - across**2, 0.0)))

    def _at(self, places: np.ndarray, layer: int) -> Floats:
        """The centres (n, 3) of the spheres of a layer at whole places (n, 2) of the lattice."""
        ideal = np.asarray(self.offset) + (places + layer % 2 * self._pocket) @ self._lattice
        height = np.full(
            len(places), self.origin_z + layer * self._rise if layer else self.origin_z
        )
        if self.arrangement != "random":
            return np.column_stack([ideal, height])
        reach, turn, drop = (self._chance(places, layer, number) for number in range(3))
        room = max(0.5 * self.spacing - self.radius, 0.0) * np.sqrt(reach)
        angle = 2.0 * np.pi * turn
        shift = room[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        return np.column_stack([ideal + shift, height - LOWEST * self.radius * drop])

    def _chance(self, places: np.ndarray, layer: int, number: int) -> Floats:
        """Numbers (n,) from 0 to 1 that belong to places (n, 2): bits mixed as by Steele, Lea & Flood (2014)."""
        key = np.array([self.seed, layer, number], dtype=np.uint64)
        state = np.zeros(len(places), dtype=np.uint64)
        with np.errstate(over="ignore"):
            for part in (*key, *places.T.astype(np.int64).astype(np.uint64)):
                state = (state ^ part) + np.uint64(0x9E3779B97F4A7C15)
                state = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
                state = (state ^ (state >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
                state ^= state >> np.uint64(31)
        return np.asarray((state >> np.uint64(11)) / 2.0**53)

    def centres_near(self, middle: ArrayLike, reach: float) -> Floats:
        """All centres (k, 3) within a horizontal distance of a point (2,)."""
        middle = np.asarray(middle, dtype=float)
        home = np.round(np.linalg.solve(self._lattice.T, middle - np.asarray(self.offset)))
        around = int(np.ceil(1.2 * reach / self.spacing)) + AROUND
        steps = np.arange(-around, around + 1)
        places = (home + np.stack(np.meshgrid(steps, steps), axis=-1)).reshape(-1, 2)
        result = np.vstack([self._at(places, layer) for layer in range(self.layers)])
        return np.asarray(result[np.linalg.norm(result[:, :2] - middle, axis=1) <= reach])

    def near(self, middle: Floats, reach: float) -> tuple[np.ndarray, Floats, Floats, np.ndarray]:
        """Numbers from the first one near, centres, radii, no posts."""
        centres = self.centres_near(middle, reach + self.radius)
        each = np.arange(len(centres))
        return each, centres, np.full(len(each), self.radius), np.zeros(len(each), dtype=bool)


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
