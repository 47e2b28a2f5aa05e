"""Rigid beds z = b(x, y) in 3-D.

A bed is the union of its pieces, half-spaces and balls or one smooth graph. `origin_z` is the height of the base plane
in the scene.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Floats, rows, unit
from incipient.errors import SceneError
from incipient.geometry.contacts import ClosestPoints
from incipient.geometry.plane.beds import Sinusoidal
from incipient.geometry.shape import RigidBed, Sides

LOWEST = 0.5  # of the radius, by which a sphere in disorder may lie lower


@dataclass(frozen=True, eq=False)
class HalfSpaceAndBalls:
    """The half-space below the plane through `origin` (3,) with a unit `normal` (3,), then balls.

    Balls have `centres` (b, 3) and `radii` (b,); `posts` (b,) extend downwards without end.
    """

    origin: Floats
    normal: Floats
    centres: Floats
    radii: Floats
    posts: np.ndarray | None = None

    @property
    def flat(self) -> np.ndarray:
        return np.arange(1 + len(self.centres)) == 0

    def distance_estimate(self, points: Floats) -> Floats:
        away = self._beside(points[:, None], np.arange(len(self.radii)))
        above = (points - self.origin) @ self.normal
        return np.vstack([above, (np.linalg.norm(away, axis=2) - self.radii).T])

    def _beside(self, points: Floats, balls: np.ndarray) -> Floats:
        away = points - self.centres[balls]
        if self.posts is not None:
            away[..., 2] = np.where(self.posts[balls], np.maximum(away[..., 2], 0.0), away[..., 2])
        return np.asarray(away)

    def closest(self, points: Floats, which: np.ndarray, near: Floats) -> ClosestPoints:
        flat = which == 0
        away = np.tile(self.normal, (len(points), 1))
        away[~flat] = self._beside(points[~flat], which[~flat] - 1)
        length = np.maximum(np.linalg.norm(away, axis=1), 1e-300)
        normals = away / length[:, None]
        hessians = np.eye(3) - normals[:, :, None] * normals[:, None]
        hessians *= np.where(flat, 0.0, 1.0 / length)[:, None, None]
        gaps = length - np.append(0.0, self.radii)[which]
        gaps[flat] = (points[flat] - self.origin) @ self.normal
        return ClosestPoints(gaps, points, normals, hessians)


def _hessians(gaps: Floats, normals: Floats, turns: Floats) -> Floats:
    """Second derivatives (n, 3, 3) of the distance of points from a surface at their feet.

    At a distance d a curvature k becomes k / (1 + d k); `turns` (n, 3, 3), along the surface the derivatives of its
    normal.
    """
    along = np.eye(3) - normals[:, :, None] * normals[:, None]
    curvature = along @ turns @ along
    widened = np.eye(3) + gaps[:, None, None] * curvature
    # Beyond the centre of curvature there is no nearest point; there the plain curvature does.
    regular = np.linalg.det(widened) > 1e-6
    return np.linalg.solve(np.where(regular[:, None, None], widened, np.eye(3)), curvature)


class Terrain(RigidBed):
    """A rigid surface z = b(x, y) below the fluid."""

    gdim = 3
    origin_z: float

    def mean(self, x: Sides, y: Sides) -> float:
        """Mean height over a rectangle, by the midpoint rule with ten points per feature."""
        places = []
        for low, high in (x, y):
            count = int(np.clip(10.0 * (high - low) / self.feature, 2, 1000))
            places.append(low + (high - low) * (np.arange(count) + 0.5) / count)
        return float(self.height(np.stack(np.meshgrid(*places), axis=-1).reshape(-1, 2)).mean())

    @abstractmethod
    def gradient(self, x: ArrayLike) -> Floats:
        """The derivatives (n, 2) of b at points (n, 2)."""

    @abstractmethod
    def pieces(self, middle: ArrayLike, reach: float) -> Pieces:
        """The pieces within a horizontal distance `reach` of a point (2,)."""

    def normal(self, x: ArrayLike) -> Floats:
        slope = self.gradient(x)
        return unit(np.column_stack([-slope, np.ones(len(slope))]))

    def nearest(self, points: ArrayLike) -> Floats:
        """Points (n, 3) of the bed nearest to points (n, 3) close to it; on smooth beds locally nearest."""
        return self._closest(rows(points)).feet

    def distance(self, points: ArrayLike) -> Floats:
        return self._closest(rows(points)).gaps

    def _closest(self, points: Floats) -> ClosestPoints:
        middle = points[:, :2].mean(axis=0)
        above = np.abs(points[:, 2] - self.height(points[:, :2])).max()
        away = np.linalg.norm(points[:, :2] - middle, axis=1).max()
        pieces = self.pieces(middle, float(away + above))
        which = np.argmin(pieces.distance_estimate(points), axis=0)
        return pieces.closest(points, which, points[:, :2])


@dataclass(frozen=True)
class Plane(Terrain):
    """z = origin_z + slope[0] x + slope[1] y; the slopes are tangents of angles."""

    feature = np.inf
    slope: tuple[float, float] = (0.0, 0.0)
    origin_z: float = 0.0

    @property
    def crest(self) -> float:
        return float("inf") if any(self.slope) else self.origin_z

    def crest_level(self, *sides: Sides) -> float:
        return float(self.height([*product(*sides)]).max())

    def height(self, x: ArrayLike) -> Floats:
        return np.asarray(self.origin_z + rows(x) @ np.asarray(self.slope))

    def gradient(self, x: ArrayLike) -> Floats:
        return np.tile(np.asarray(self.slope, dtype=float), (len(rows(x)), 1))

    def pieces(self, middle: ArrayLike, reach: float) -> Pieces:
        origin, (normal,) = np.array([0.0, 0.0, self.origin_z]), self.normal([[0.0, 0.0]])
        return HalfSpaceAndBalls(origin, normal, np.empty((0, 3)), np.empty(0))


@dataclass(frozen=True, eq=False)
class SphereBed(Terrain):
    """Spheres above the half-space below the plane z = origin_z.

    Centres (k, 3) and radii (k,) repeat with two horizontal `periods`, if any. `posts` (k,) reach down to the plane
    as cylinders. A `seed` shifts each sphere of an array horizontally between its neighbours and lowers it by up to
    half a radius.
    """

    centres: Floats
    radii: Floats
    origin_z: float = 0.0
    posts: Any = None
    periods: Any = None
    seed: int | None = None

    def __post_init__(self) -> None:
        count = len(self.radii)
        posts = np.zeros(count, dtype=bool) if self.posts is None else self.posts
        if count == 0:
            raise SceneError("a bed of spheres has none; give one or more")
        object.__setattr__(self, "centres", np.asarray(self.centres, dtype=float))
        object.__setattr__(self, "radii", np.asarray(self.radii, dtype=float))
        object.__setattr__(self, "posts", np.asarray(posts, dtype=bool))

    @classmethod
    def array(
        cls,
        radius: float,
        spacing: float,
        arrangement: Literal["square", "triangular", "random"] = "square",
        offset: tuple[float, float] = (0.0, 0.0),
        origin_z: float = 0.0,
        angle: float = 0.0,
        layers: int = 1,
        seed: int = 0,
    ) -> SphereBed:
        """Equal spheres in a regular array; the centres of the lowest lie on the plane z = origin_z.

        arrangement "square": centres `spacing` apart along x and y; "triangular": rows along x with neighbours in
        equilateral triangles; "random": the triangular one in disorder, by its seed. Further layers lie in the
        pockets of those below. A centre is at `offset`; the whole is turned by `angle` about the vertical. Spheres
        may overlap.
        """
        square, c, s = arrangement == "square", np.cos(angle), np.sin(angle)
        second = [0.0, 1.0] if square else [0.5, np.sqrt(0.75)]
        periods = spacing * np.array([[1.0, 0.0], second]) @ np.array([[c, s], [-s, c]])
        pocket = np.full(2, 0.5 if square else 1.0 / 3.0) @ periods
        rise = np.sqrt(max(4.0 * radius**2 - pocket @ pocket, 0.0))
        if layers > 1 and rise == 0.0:
            raise SceneError(
                "spheres so far apart carry no further layer; reduce spacing or give layers = 1"
            )
        layer = np.arange(layers)
        places = np.asarray(offset) + np.multiply.outer(layer % 2, pocket)
        centres = np.column_stack([places, origin_z + layer * rise])
        disorder = seed if arrangement == "random" else None
        return cls(centres, np.full(layers, radius), origin_z, None, periods, disorder)

    @property
    def feature(self) -> float:
        free = self.radii[self.posts if self.posts.all() else ~self.posts]
        spacing = np.inf if self.periods is None else np.linalg.norm(self.periods[0])
        return float(min(free.min(), 0.5 * spacing))

    @property
    def period(self) -> float | None:
        return None if self.periods is None else float(np.linalg.norm(self.periods[0]))

    @property
    def crest(self) -> float:
        return max(float((self.centres[:, 2] + self.radii).max()), self.origin_z)

    def crest_level(self, *sides: Sides) -> float:
        """Height that spheres with centres over a rectangle reach; `crest` of an array."""
        if self.periods is not None:
            return self.crest
        low, high = np.transpose(sides)
        inside = ((self.centres[:, :2] >= low) & (self.centres[:, :2] <= high)).all(axis=1)
        tops = (self.centres[:, 2] + self.radii)[inside]
        return max(float(tops.max(initial=-np.inf)), self.origin_z)

    def near(self, middle: ArrayLike, reach: float) -> tuple[np.ndarray, Floats]:
        middle, which, centres = np.asarray(middle, float), np.arange(len(self.radii)), self.centres
        if self.periods is not None:
            away = (reach + self.radii.max()) / np.linalg.norm(self.periods[0])
            # A sphere in disorder above a point may belong two places of the lattice away.
            around = max(int(np.ceil(1.2 * away)), 0) + 2
            steps = np.arange(-around, around + 1)
            home = np.round(np.linalg.solve(self.periods.T, middle - centres[0, :2]))
            places = (home + np.stack(np.meshgrid(steps, steps), axis=-1)).reshape(-1, 2)
            which = np.repeat(which, len(places))
            places = np.tile(places, (len(centres), 1))
            shifts = places @ self.periods
            centres = centres[which] + np.column_stack([shifts, np.zeros(len(which))])
            if self.seed is not None:
                centres = centres + self._disorder(places, which)
        close = np.linalg.norm(centres[:, :2] - middle, axis=1) <= reach + self.radii[which]
        return which[close], centres[close]

    def _disorder(self, places: Floats, layer: np.ndarray) -> Floats:
        """Shifts (n, 3) of spheres, mixed as by Steele, Lea & Flood (2014)."""
        chances = []
        for number in range(3):
            state = np.zeros(len(places), dtype=np.uint64)
            for part in (self.seed, layer, number, *places.T.astype(np.int64)):
                state = (state ^ np.asarray(part).astype(np.uint64)) + np.uint64(0x9E3779B97F4A7C15)
                for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
                    state = (state ^ (state >> np.uint64(shift))) * np.uint64(factor)
                state ^= state >> np.uint64(31)
            chances.append((state >> np.uint64(11)) / 2.0**53)
        reach, turn, drop = chances
        spacing, radii = float(np.linalg.norm(self.periods[0])), self.radii[layer]
        room, angle = np.maximum(0.5 * spacing - radii, 0.0) * np.sqrt(reach), 2.0 * np.pi * turn
        return np.column_stack([room * np.cos(angle), room * np.sin(angle), -LOWEST * radii * drop])

    def pieces(self, middle: ArrayLike, reach: float) -> Pieces:
        which, centres = self.near(middle, reach)
        base, up, posts = (
            np.array([0.0, 0.0, self.origin_z]),
            np.array([0.0, 0.0, 1.0]),
            self.posts[which],
        )
        return HalfSpaceAndBalls(
            base, up, centres, self.radii[which], posts if posts.any() else None
        )

    def _seen(self, x: ArrayLike) -> tuple[Floats, np.ndarray, Floats]:
        from scipy.spatial import cKDTree  # which takes time to import

        points = rows(x)
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        which, centres = self.near(middle, float(np.linalg.norm(points - middle, axis=1).max()))
        heights, seen = np.full(len(points), self.origin_z), np.full(len(points), -1)
        over, radii = np.zeros((len(points), 3)), self.radii[which]
        covered = cKDTree(points).query_ball_point(centres[:, :2], radii) if len(which) else []
        for k, below in enumerate(covered):
            squared = ((points[below] - centres[k, :2]) ** 2).sum(axis=1)
            top = centres[k, 2] + np.sqrt(np.maximum(radii[k] ** 2 - squared, 0.0))
            higher = np.array(below, dtype=int)[top > heights[below]]
            heights[higher], seen[higher] = top[top > heights[below]], which[k]
            over[higher] = centres[k]
        return heights, seen, over

    def height(self, x: ArrayLike) -> Floats:
        return self._seen(x)[0]

    def highest(self, x: ArrayLike) -> np.ndarray:
        """Number (n,) of the highest sphere at points (n, 2); -1: the base plane."""
        return self._seen(x)[1]

    def gradient(self, x: ArrayLike) -> Floats:
        heights, seen, centres = self._seen(x)
        rise = np.maximum(heights - centres[:, 2], 1e-100)[:, None]
        slope = (centres[:, :2] - rows(x)) / rise
        return np.asarray(np.where((seen < 0)[:, None], 0.0, slope))


class SmoothTerrain(Terrain):
    """A bed with two derivatives."""

    @abstractmethod
    def shape(self, x: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Height (n,), gradient (n, 2) and second derivatives (n, 2, 2) at points (n, 2)."""

    def height(self, x: ArrayLike) -> Floats:
        return self.shape(x)[0]

    def gradient(self, x: ArrayLike) -> Floats:
        return self.shape(x)[1]

    def pieces(self, middle: ArrayLike, reach: float) -> SmoothTerrain:
        return self

    @property
    def flat(self) -> np.ndarray:
        return np.array([False])

    def distance_estimate(self, points: Floats) -> Floats:
        height, slope, _ = self.shape(points[:, :2])
        return np.asarray((points[:, 2] - height) / np.sqrt(1.0 + (slope**2).sum(axis=1)))[None]

    def closest(self, points: Floats, which: np.ndarray, near: Floats) -> ClosestPoints:
        result = self._at(points, self._feet(points, near))
        inside = np.flatnonzero(result.gaps < -1e-9 * self.feature)
        # Beside a steep crest the foot may be on its other side, seen through the bed.
        across = inside[points[inside, 2] > self.height(points[inside, :2])]
        if len(across):
            feet = self._feet(points[across], points[across, :2])
            result = result.replaced(across, self._at(points[across], feet))
        return result

    def _at(self, points: Floats, x: Floats) -> ClosestPoints:
        height, slope, curvature = self.shape(x)
        stretch = np.sqrt(1.0 + (slope**2).sum(axis=1))
        normals = np.column_stack([-slope, np.ones(len(x))]) / stretch[:, None]
        feet = np.column_stack([x, height])
        gaps = ((points - feet) * normals).sum(axis=1)
        turns = np.zeros((len(x), 3, 3))
        turns[:, :2, :2] = -curvature / stretch[:, None, None]
        return ClosestPoints(gaps, points, normals, _hessians(gaps, normals, turns))

    def _feet(self, points: Floats, near: Floats) -> Floats:
        best, least, pending = near.copy(), np.full(len(near), np.inf), np.arange(len(near))
        x = near
        for _ in range(30):
            residual, step = self._foot_step(points[pending], x)
            size = np.abs(residual).max(axis=1, initial=0.0)
            better = size < least[pending]
            best[pending[better]], least[pending[better]] = x[better], size[better]
            # A residual that gets no smaller is round-off; gaps err by the square of it.
            going = better & (size > 1e-12 * (self.feature + np.abs(x).max(axis=1)))
            x, pending = (x - step)[going], pending[going]
            if len(pending) == 0:
                break
        return best

    def _foot_step(self, points: Floats, x: Floats) -> tuple[Floats, Floats]:
        height, slope, curvature = self.shape(x)
        offset = height - points[:, 2]
        residual = x - points[:, :2] + offset[:, None] * slope
        matrix = np.eye(2) + np.einsum("ni,nj->nij", slope, slope)
        bent = matrix + offset[:, None, None] * curvature
        convex = (np.linalg.det(bent) > 0.0) & (bent[:, 0, 0] > 0.0)
        step = np.linalg.solve(np.where(convex[:, None, None], bent, matrix), residual[..., None])[
            ..., 0
        ]
        return residual, shortened(step, 0.25 * self.feature)


def shortened(steps: Floats, longest: float) -> Floats:
    """Steps (n, d) of at most a length."""
    length = np.maximum(np.linalg.norm(steps, axis=1, keepdims=True), 1e-300)
    return np.asarray(steps * np.minimum(1.0, longest / length))


Pieces = HalfSpaceAndBalls | SmoothTerrain


@dataclass(frozen=True)
class Ridges(SmoothTerrain):
    """z = origin_z + amplitude sin(2 pi (x cos(angle) + y sin(angle)) / wavelength + phase)."""

    amplitude: float
    wavelength: float
    angle: float = 0.0
    phase: float = 0.0
    origin_z: float = 0.0

    @cached_property
    def profile(self) -> Sinusoidal:
        """The bed in a plane across the crests."""
        return Sinusoidal(self.amplitude, self.wavelength, self.phase, self.origin_z)

    @property
    def feature(self) -> float:
        return self.profile.feature

    @property
    def period(self) -> float:
        return self.wavelength

    @property
    def crest(self) -> float:
        return self.profile.crest

    def mean(self, x: Sides, y: Sides) -> float:
        return self.origin_z

    def shape(self, x: ArrayLike) -> tuple[Floats, Floats, Floats]:
        across = np.array([np.cos(self.angle), np.sin(self.angle)])
        along = rows(x) @ across
        height, (slope, _) = self.profile.height(along), self.profile.slopes(along)
        bent = -((2.0 * np.pi / self.wavelength) ** 2) * (height - self.origin_z)
        return height, np.outer(slope, across), np.multiply.outer(bent, np.outer(across, across))
