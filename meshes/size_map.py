"""Cell sizes at every point of a 3-D region, the boxes that give them to gmsh, and expected numbers of cells."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from incipient.arrays import Floats, planar_cross
from incipient.errors import MeshError
from incipient.geometry.triangles import in_blocks, tree

from .regions import Frame, Grid, Near, Region, Sizes, SolidRegion
from .surfaces import Body, Ground

BOX = 1.5  # the largest side of a box in units of the size within it
PER_VOLUME = 5.4  # tetrahedra of side h in a volume of h^3
PER_AREA = 2.3  # triangles of side h on an area of h^2
PARTS = 50  # of a boundary along which sizes grow


@dataclass(frozen=True, eq=False)
class SizeMap:
    """The target sizes in a region, in its frame.

    At points `spots` (k, 3) surfaces would cross if cells were larger than at_spots (k,).
    """

    region: SolidRegion
    sizes: Sizes
    frame: Frame
    ground: Ground
    bodies: dict[str, Body]
    spots: Floats = field(default_factory=lambda: np.empty((0, 3)))
    at_spots: Floats = field(default_factory=lambda: np.empty(0))

    @classmethod
    def of(cls, region: SolidRegion, sizes: Sizes) -> SizeMap:
        frame = region.frame
        bodies = {
            name: Body(placed, frame, region.symmetric) for name, placed in region.holes.items()
        }
        return cls(region, sizes, frame, Ground(region, frame), bodies)

    @property
    def surfaces(self) -> dict[str, Ground | Body]:
        """Bed and grains by name."""
        return {self.region.names[5]: self.ground, **self.bodies}

    def finer_at(self, points: Floats) -> SizeMap:
        """The sizes halved at points (n, 3) of the frame, once where points are nearer than a cell."""
        sizes = self(points)
        _, first = np.unique(np.round(points / sizes[:, None]), axis=0, return_index=True)
        points, sizes = points[first], 0.5 * sizes[first]
        spots, sizes = np.vstack([self.spots, points]), np.concatenate([self.at_spots, sizes])
        return replace(self, spots=spots, at_spots=sizes)

    def distance(self, name: str, x: Floats) -> Floats:
        if name in self.surfaces:
            return np.abs(self.surfaces[name].distance(x))
        return np.asarray(np.abs(x[:, 2] - 1.0))  # the ceiling, alone of the plane sides

    def __call__(self, x: Floats) -> Floats:
        return np.asarray(self.parts(x).min(axis=0))

    @property
    def names(self) -> list[str]:
        near = [near.boundary or "narrow places and corners" for near in self.sizes.near]
        return ["domain", *near, "narrow places", "adaptation"]

    def parts(self, x: Floats) -> Floats:
        """Sizes (names, n) for each feature at points (n, 3)."""
        wanted = {near.boundary for near in self.sizes.near if near.boundary}
        if np.isfinite(self.sizes.gap_part):
            wanted |= set(self.surfaces)
        distances = {name: self.distance(name, x) for name in sorted(wanted)}
        rows = [np.full(len(x), self.frame.size(self.sizes.far))]
        rows += [self._near(near, x, distances) for near in self.sizes.near]
        rows += [np.minimum(self._between(distances, len(x)), self._at_spots(x)), self._field(x)]
        return np.array(rows)

    def _near(self, near: Near, x: Floats, distances: dict[str, Floats]) -> Floats:
        size = np.full(len(x), self.frame.size(near.size))
        if near.away is not None:
            away, growth = self._from_points((near.away.point,), x), near.away.growth
            beyond = np.maximum(away - self.frame.size(near.away.level), 0.0)
            largest = self.frame.size(near.away.largest) + growth * beyond
            size = np.maximum(size, np.minimum(largest, growth * away))
        distance = self._from_points(near.points, x) if near.points else distances[near.boundary]
        return np.asarray(size + near.growth * distance)

    def _from_points(self, points: tuple[tuple[float, ...], ...], x: Floats) -> Floats:
        return _distances(x, self.frame.local(np.array(points))).min(axis=1)

    def _between(self, distances: dict[str, Floats], count: int) -> Floats:
        if not np.isfinite(self.sizes.gap_part) or not self.bodies:
            return np.full(count, np.inf)
        both = np.sort(np.array([distances[name] for name in self.surfaces]), axis=0)
        # Unknown narrow gaps are not resolved further.
        return np.asarray(
            np.maximum(self.sizes.gap_part * (both[0] + both[1]), 0.25 * self.least[-2])
        )

    def _at_spots(self, x: Floats) -> Floats:
        if not len(self.spots):
            return np.full(len(x), np.inf)
        # They grow with the distance from the spots.
        return np.asarray((self.at_spots + 0.3 * _distances(x, self.spots)).min(axis=1))

    @cached_property
    def _vertices(self) -> Any:
        assert self.sizes.field is not None
        return tree(self.frame.local(self.sizes.field.points))

    def _field(self, x: Floats) -> Floats:
        if self.sizes.field is None:
            return np.full(len(x), np.inf)
        return np.asarray(self.sizes.field.sizes[self._vertices.query(x)[1]] / self.frame.length)

    @property
    def least(self) -> Floats:
        known = [self.sizes.far, *(near.size for near in self.sizes.near)]
        adapted = np.inf if self.sizes.field is None else self.sizes.field.sizes.min()
        return np.array([self.frame.size(size) for size in (*known, min(known), adapted)])

    @cached_property
    def bounds(self) -> tuple[Floats, Floats]:
        low, high = (
            self.frame.local(np.array([*end, self.frame.origin[2]]))[:2]
            for end in self.region.rectangle
        )
        return low, high

    def outside(self, x: Floats) -> np.ndarray:
        low, high = self.bounds
        beyond = ((x[:, :2] < low) | (x[:, :2] > high)).any(axis=1) | (x[:, 2] > 1.0)
        return np.asarray(beyond | (self.ground.distance(x) < 0.0))

    def within(self, x: Floats) -> np.ndarray:
        inside, points = np.zeros(len(x), dtype=bool), self.frame.scene(x)
        for placed in self.region.holes.values():
            body = placed.placement.to_body(points)
            near = np.flatnonzero(np.linalg.norm(body, axis=1) < placed.solid.size)
            inside[near] |= placed.solid.level(body[near]) < 0.0
        return inside


def _distances(x: Floats, points: Floats) -> Floats:
    return np.asarray(np.linalg.norm(x[:, None] - points, axis=2))


@dataclass(frozen=True, eq=False)
class Boxes:
    """Cubes that fill a region: centres (n, 3), sides (n,), sizes at the corners (n, 8)."""

    centres: Floats
    sides: Floats
    sizes: Floats
    uncut: np.ndarray  # which (n,) are larger, because they would become too many
    growth: float = 1.0  # by what factor the last cut made larger the number of those to be cut on

    @property
    def corners(self) -> Floats:
        """(n, 8, 3) in gmsh's order."""
        return self.centres[:, None] + 0.5 * self.sides[:, None, None] * CORNERS


CORNERS = np.array(
    [[x, y, z] for z in (-1, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))], dtype=float
)
MOST_BOXES = (
    400_000  # from then on the boxes are larger than asked: so many stand for ten million cells
)
# Cubes of half a side each: no cell is much larger than the shortest side of its region.
MOST_FIRST = 1_000_000


def boxes(size: SizeMap, bottom: float, most: int = MOST_BOXES) -> Boxes:
    """Cubes from `bottom` (in the frame) on, cut into eight until they are about as small as the cells within.

    Those that would make more than `most` stay uncut. Raises MeshError for too flat a region.
    """
    frame, ends = size.frame, zip(size.region.rectangle, (0.0, size.region.ceiling), strict=True)
    low, high = ((np.array([*end, z]) - frame.origin) / frame.length for end, z in ends)
    low[2] = bottom - 0.01
    side = 0.51 * float((high - low).min())
    counts = np.ceil((high - low) / side).astype(int)
    if counts.prod() > MOST_FIRST:
        long, thick = (high - low).max() * frame.length, (high - low).min() * frame.length
        raise MeshError(
            f"the domain is too flat to be meshed: {long:.2g} long and {thick:.2g} across, it takes "
            f"{counts.prod():.2g} cubes half as large as that, more than {MOST_FIRST:.0e}; shorten its longest sides"
        )
    steps = np.stack(np.meshgrid(*(np.arange(n) for n in counts), indexing="ij"), axis=-1).reshape(
        -1, 3
    )
    centres = 0.5 * (low + high) + side * (steps + 0.5 - 0.5 * counts)
    levels, total, cut = [], 0, [1]
    while len(centres):
        corners = centres[:, None] + 0.5 * side * CORNERS
        values = in_blocks(size, corners.reshape(-1, 3)).reshape(-1, 8)
        least = np.minimum(values.min(axis=1), in_blocks(size, centres))
        split = side > BOX * least
        count, small = int(split.sum()), int((~split).sum())
        levels.append(
            (centres[~split], np.full(small, side), values[~split], np.zeros(small, dtype=bool))
        )
        total, cut = total + small, [*cut, count]
        if total + 8 * count > most:
            levels.append(
                (centres[split], np.full(count, side), values[split], np.ones(count, dtype=bool))
            )
            break
        centres = (centres[split][:, None] + 0.25 * side * CORNERS).reshape(-1, 3)
        side *= 0.5
    growth = float(np.clip(cut[-1] / max(cut[-2], 1), 1.0, 8.0))
    at, lengths, values, uncut = (np.concatenate(column) for column in zip(*levels, strict=True))
    return Boxes(at, lengths, values, uncut, growth)


def expected_cells(shape: Region | SolidRegion | Grid, sizes: Sizes) -> dict[str, float]:
    """Expected number of cells due to each part of the sizes, by name, without those of wall layers."""
    if isinstance(shape, Grid):
        return {"domain": float(shape.cells)}
    if isinstance(shape, SolidRegion):
        return _expected_tetrahedra(shape, sizes)
    left, right = shape.bottom[0].start, shape.bottom[-1].end
    height = shape.top - min(min(curve.start[1], curve.end[1]) for curve in shape.bottom)
    lengths = {
        shape.sides[0]: sum(curve.length for curve in shape.bottom),
        shape.sides[2]: right[0] - left[0],
        **{name: sum(curve.length for curve in outline) for name, outline in shape.inner.items()},
    }
    counts = {"domain": PER_AREA * (right[0] - left[0]) * height / sizes.far**2}
    # Points lie on boundaries, whose own sizes are smaller from some distance on.
    beside = min([2.0 * near.size for near in sizes.near if near.boundary], default=sizes.far)
    for near in sizes.near:
        name = near.boundary or "narrow places and corners"
        most = min(beside, sizes.far) if near.points else sizes.far
        counts[name] = counts.get(name, 0.0) + PER_AREA * _integral(near, most, height, lengths)
    # Four triangles about a curve that is shorter than the cells next to it
    counts["single curves"] = 4.0 * (len(shape.bottom) + sum(map(len, shape.inner.values())))
    if sizes.field is not None:
        counts["adaptation"] = PER_AREA * _integral_of_field(sizes)
    return counts


def _integral(near: Near, far: float, height: float, lengths: dict[str, float]) -> float:
    size = np.minimum(_along(near, lengths), far)
    reach = np.minimum((far - size) / near.growth, height)
    ratio = 1.0 + near.growth * reach / size
    if near.points:
        return float(
            len(near.points) * np.pi / near.growth**2 * (np.log(ratio) - 1.0 + 1.0 / ratio)[0]
        )
    return float(lengths[near.boundary] * np.mean((1.0 - 1.0 / ratio) / (near.growth * size)))


def _along(near: Near, lengths: dict[str, float]) -> Floats:
    if near.away is None or near.points:
        return np.array([near.size])
    distances = 0.5 * lengths[near.boundary] * (np.arange(PARTS) + 0.5) / PARTS
    return np.maximum(near.size, np.minimum(near.away.largest, near.away.growth * distances))


def _integral_of_field(sizes: Sizes) -> float:
    assert sizes.field is not None
    a, b, c = sizes.field.points[sizes.field.triangles].transpose(1, 0, 2)
    doubled = np.abs(planar_cross(b - a, c - a))
    return float(
        (0.5 * doubled * (sizes.field.sizes[sizes.field.triangles] ** -2.0).mean(axis=1)).sum()
    )


def _expected_tetrahedra(region: SolidRegion, sizes: Sizes) -> dict[str, float]:
    size = SizeMap.of(region, sizes)
    # With more boxes the estimate takes a minute.
    cubes = boxes(size, float(size.ground.draft().surface.points[:, 2].min()), 50_000)
    share = ~(size.outside(cubes.centres) | size.within(cubes.centres))
    count = PER_VOLUME * share * cubes.sides**3 * (cubes.sizes**-3.0).mean(axis=1)
    asking = np.argmin(size.parts(cubes.centres), axis=0)
    # Were the others cut on, to the smallest size of what asks for it, their number would grow as it did; but as many
    # are about a point at each distance.
    halvings = np.log2(cubes.sides / (BOX * size.least[asking])).clip(0.0)
    about_points = np.array([False, *(bool(near.points) for near in sizes.near), False, False])[
        asking
    ]
    grown = np.where(about_points, halvings, cubes.growth**halvings)
    count = np.where(cubes.uncut, np.maximum(count, PER_VOLUME * share * BOX**3 * grown), count)
    counts: dict[str, float] = {}
    for number, name in enumerate(size.names):
        counts[name] = counts.get(name, 0.0) + float(count[asking == number].sum())
    return counts
