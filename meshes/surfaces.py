"""The curved surfaces of a 3-D region, grains and bed, in its frame: first triangles, and projection."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from incipient.arrays import Floats
from incipient.geometry.space.beds import HalfSpaceAndBalls, Plane
from incipient.geometry.space.grains import Spheres, Triangulated
from incipient.geometry.space.remeshing import GRID, Draft, ExactSurface
from incipient.geometry.triangles import (
    Cloud,
    Surface,
    grid,
    halved,
    in_blocks,
    level_surface,
    tree,
)

from .regions import Frame, PlacedSolid, SolidRegion

# Of the smallest radius: valleys between balls, base and spheres of a clump are rounded with it, so that touching balls
# are bridged. The surface changes only where two pieces are nearer than this.
FILLET = 0.2
# First triangles along a grain, a ball, a feature of a bed.
PER_SIZE, PER_RADIUS, PER_FEATURE = 12.0, 3.0, 3.0
BEYOND = 1.3  # ratio of neighbouring cells of the first grid of a bed where it is level

Level = Callable[[Floats], Floats]


@dataclass(frozen=True, eq=False)
class Body(ExactSurface):
    """A grain's surface, or the half beyond the plane of symmetry."""

    placed: PlacedSolid
    frame: Frame
    symmetric: bool

    def draft(self) -> Draft:
        whole = self._whole()
        surface = Surface(
            self.frame.local(self.placed.placement.to_scene(whole.points)), whole.triangles
        )
        surface = halved(surface) if self.symmetric else surface
        held = np.zeros(surface.points.shape, dtype=bool)
        held[:, 1] = self.symmetric & (surface.points[:, 1] == 0.0)
        if self.placed.solid.spans_width:
            # Its ends, of which the plane of symmetry may be one, stay in the sides of the domain.
            across = surface.points[:, 1]
            held[:, 1] = (across == across.min()) | (across == across.max())
        return Draft(surface, held, self.placed.solid.sharp)

    def _whole(self) -> Surface:
        solid = self.placed.solid
        if isinstance(solid, Triangulated):
            return Surface(solid.vertices, solid.triangles)
        if not isinstance(solid, Spheres):
            return solid.surface(solid.size / PER_SIZE)
        step = min(solid.radii) / PER_RADIUS
        centres, radii = solid.tables
        low = (centres - radii[:, None]).min(axis=0) - 1.3 * step
        high = (centres + radii[:, None]).max(axis=0) + 1.3 * step
        x, y, z = (
            np.linspace(a, b, 1 + int(np.ceil((b - a) / step)))
            for a, b in zip(low, high, strict=True)
        )
        return level_surface(clump_level(solid), (x, y, z))

    @cached_property
    def _cloud(self) -> Cloud:
        solid = self.placed.solid
        surface = solid.surface(solid.size / 40.0)
        points = self.frame.local(self.placed.placement.to_scene(surface.points))
        return Cloud(Surface(points, surface.triangles))

    def distance(self, x: Floats) -> Floats:
        solid = self.placed.solid
        if not solid.level_is_distance:
            return self._cloud.distance(x)
        return solid.level(self.placed.placement.to_body(self.frame.scene(x))) / self.frame.length

    def project(self, x: Floats, held: np.ndarray) -> Floats:
        """Points along rays or normals; held coordinates are restored, and the rest is projected again."""
        for _ in range(1 + 3 * int(held.any())):
            body = self.placed.placement.to_body(self.frame.scene(x))
            nearest = self.placed.placement.to_scene(self._projected(body))
            x = np.where(held, x, (nearest - self.frame.origin) / self.frame.length)
        return x

    def _projected(self, x: Floats) -> Floats:
        solid = self.placed.solid
        if isinstance(solid, Spheres):
            free = np.zeros(x.shape, dtype=bool)
            return on_level(clump_level(solid), x, free, min(solid.radii))
        return solid.project(x)


def clump_level(solid: Spheres) -> Level:
    """The level of a clump with rounded valleys."""
    centres, radii = solid.tables
    return lambda x: rounded_union(
        np.linalg.norm(x - centres[:, None], axis=2) - radii[:, None], FILLET * radii.min()
    )


@dataclass(frozen=True, eq=False)
class Ground(ExactSurface):
    """A bed's surface within a region: exact where resolved, planar farther away.

    finer: factor by which the first triangles of a bed of balls are smaller
    """

    region: SolidRegion
    frame: Frame
    finer: float = 1.0

    @property
    def of_balls(self) -> bool:
        return self._balls is not None

    @property
    def flat(self) -> bool:
        return isinstance(self.region.bed, Plane)

    @cached_property
    def _reach(self) -> tuple[Floats, float]:
        low, high = self.region.rectangle
        if self.region.resolved is None:
            return 0.5 * (low + high), 0.51 * float(np.linalg.norm(high - low))
        resolved = self.region.resolved
        return np.asarray(resolved.centre, dtype=float), resolved.radius + resolved.passage

    @cached_property
    def _balls(self) -> HalfSpaceAndBalls | None:
        middle, reach = self._reach
        pieces = self.region.bed.pieces(middle, reach)
        return pieces if isinstance(pieces, HalfSpaceAndBalls) and not self.flat else None

    @property
    def _far(self) -> float:
        """Level of the planar far bed."""
        resolved = self.region.resolved
        return self.region.bed.origin_z if resolved is None else resolved.level

    def _share(self, x: Floats) -> Floats:
        resolved = self.region.resolved
        return np.zeros(len(x)) if resolved is None or self.flat else resolved.share(x[:, :2])

    def _height(self, x: Floats) -> Floats:
        share = self._share(x)
        own = self.region.bed.height(x[:, :2])
        return np.asarray(own if not share.any() else (1.0 - share) * own + share * self._far)

    def _level(self, x: Floats) -> Floats:
        if self._balls is None:
            slope = self.region.bed.gradient(x[:, :2]) * (1.0 - self._share(x))[:, None]
            return np.asarray((x[:, 2] - self._height(x)) / np.sqrt(1.0 + (slope**2).sum(axis=1)))
        own = rounded_union(self._distances(x), self._fillet)
        share = self._share(x)
        return np.asarray((1.0 - share) * own + share * (x[:, 2] - self._far))

    @cached_property
    def _fillet(self) -> float:
        assert self._balls is not None
        return FILLET * float(self._balls.radii.min(initial=np.inf))

    @cached_property
    def _search(self) -> tuple[Any, int]:
        """Spatial index of the centres of the balls, and the most balls that round a valley together."""
        assert self._balls is not None
        centres = tree(self._balls.centres)
        reach = 2.0 * (self._balls.radii.max(initial=0.0) + self._fillet)
        around = centres.query_ball_point(centres.data, reach, return_length=True)
        return centres, int(around.max(initial=1))

    def _distances(self, x: Floats) -> Floats:
        assert self._balls is not None
        balls = self._balls
        if balls.posts is not None:
            return balls.distance_estimate(x)
        centres, count = self._search
        above = (x - balls.origin) @ balls.normal
        away, which = centres.query(x, [*range(1, 1 + count)])  # infinite where there are fewer
        return np.vstack([above, (away - np.append(balls.radii, 0.0)[which]).T])

    def distance(self, x: Floats) -> Floats:
        return in_blocks(self._level, self.frame.scene(x)) / self.frame.length

    def project(self, x: Floats, held: np.ndarray) -> Floats:
        """Vertically onto graphs, along normals onto balls."""
        if self._balls is None:
            heights = self._height(self.frame.scene(x))
            return np.column_stack([x[:, :2], (heights - self.frame.origin[2]) / self.frame.length])
        scale = float(self._balls.radii.min(initial=np.inf)) / self.frame.length
        return on_level(self.distance, x, held, scale)

    def draft(self) -> Draft:
        """Two triangles of a plane, a grid over a graph, the level surface of balls."""
        xs, ys = (self._abscissae(axis) for axis in (0, 1))
        surface = self._grid(xs, ys) if self._balls is None else self._marched(xs, ys)
        points = surface.points.copy()
        held = np.zeros(points.shape, dtype=bool)
        for axis, ends in ((0, xs[[0, -1]]), (1, ys[[0, -1]])):
            held[:, axis] = np.isin(points[:, axis], ends)
        return Draft(Surface(points, surface.triangles), held)

    def _abscissae(self, axis: int) -> Floats:
        low, high = (float(side[axis]) for side in self.region.rectangle)
        middle, reach = self._reach
        step = self.region.bed.feature / (
            PER_FEATURE if self._balls is None else self.finer * PER_RADIUS
        )
        ends = (low - self.frame.origin[axis], high - self.frame.origin[axis])
        if not np.isfinite(step):
            return np.array(ends) / self.frame.length
        first, last = max(low, middle[axis] - reach), min(high, middle[axis] + reach)
        inner = np.linspace(first, last, 2 + int((last - first) / step))
        before, after = _widening(first - low, step), _widening(high - last, step)
        places = (
            np.concatenate([first - before[::-1], inner, last + after]) - self.frame.origin[axis]
        )
        places[[0, -1]] = ends
        return np.asarray(np.round(places / self.frame.length / GRID) * GRID)

    def _grid(self, xs: Floats, ys: Floats) -> Surface:
        places, triangles = grid(xs, ys)
        flat = np.column_stack([places, np.zeros(len(places))])
        return Surface(self.project(flat, np.zeros(flat.shape, dtype=bool)), triangles)

    def _marched(self, xs: Floats, ys: Floats) -> Surface:
        assert self._balls is not None
        balls, base = self._balls, self._balls.origin[2]
        step = self.region.bed.feature / (self.finer * PER_RADIUS)
        low = min(base, self._far) - 1.37 * step
        high = (
            max(float((balls.centres[:, 2] + balls.radii).max(initial=base)), self._far)
            + 1.29 * step
        )
        zs = np.linspace(low, high, 2 + int((high - low) / step)) - self.frame.origin[2]
        return level_surface(self.distance, (xs, ys, zs / self.frame.length))


def _widening(length: float, step: float) -> Floats:
    if length <= 1e-9 * step:
        return np.empty(0)
    count = max(1, int(np.ceil(np.log1p((BEYOND - 1.0) * length / step) / np.log(BEYOND))))
    sums = np.cumsum(BEYOND ** np.arange(count))
    return np.asarray(length * sums / sums[-1])


def rounded_union(distances: Floats, radius: float) -> Floats:
    """The level (n,) of the union of pieces with distances (k, n), its valleys rounded with a radius.

    Where two pieces meet at a right angle the surface is a circular fillet.
    """
    least = distances.min(axis=0)
    if not np.isfinite(radius):
        return np.asarray(least)
    within = np.maximum(radius - distances, 0.0)
    return np.asarray(np.maximum(radius, least) - np.sqrt((within**2).sum(axis=0)))


def on_level(level: Level, x: Floats, held: np.ndarray, scale: float) -> Floats:
    """Points (n, 3) near x where a level is zero, by Newton's method; held coordinates stay.

    scale: a length of the level's shape, of which differences are a small part
    """
    h, points, pending = 1e-6 * scale, x.copy(), np.arange(len(x))
    for _ in range(10):
        here = points[pending]
        values = level(here)
        away = np.abs(values) > 1e-12 * scale
        pending, here, values = pending[away], here[away], values[away]
        if not len(pending):
            break
        beside = here + h * np.vstack([np.eye(3), -np.eye(3)])[:, None]
        ahead, behind = level(beside.reshape(-1, 3)).reshape(2, 3, -1)
        slope = ((ahead - behind) / (2.0 * h)).T
        slope = np.where(held[pending], 0.0, slope)
        steepness = np.maximum((slope**2).sum(axis=1), 1e-3)
        move = -(values / steepness)[:, None] * slope
        length = np.linalg.norm(move, axis=1, keepdims=True)
        points[pending] = here + move * np.minimum(1.0, 0.3 * scale / np.maximum(length, 1e-300))
    return points
