"""Closest points of a grain and a bed in 3-D: all local minima of the distance, lowering, contacts.

Smooth grains are minimised over their surface from samples of it; grains with cores (flat faces, round parts)
over every triangle of the core. Both by Newton's method with the second derivatives of the bed's distance.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from incipient.arrays import Floats, planar_cross, unit
from incipient.errors import SceneError
from incipient.geometry.contacts import ClosestPoints, Contacts, frame_of
from incipient.geometry.placement import Placement
from incipient.geometry.shape import Moments
from incipient.geometry.space.beds import Graph, Pieces, SmoothTerrain, Terrain
from incipient.geometry.space.grains import Solid, SphereSwept
from incipient.geometry.space.surfaces import (
    Surface,
    Triangles,
    connected,
    grouped,
    nearest_on_triangles,
    refined,
    vector_areas,
)

STILL = 1e-11  # grain sizes: a last step this short leaves an error of its square
THINNEST = 1e-9  # area of a patch, in grain sizes squared, below which it is none
SAMPLES, SAMPLES_PER_FEATURE = (
    24.0,
    6.0,
)  # along the grain's size and along the bed's smallest feature
STEEPEST = 0.02  # vertical component of a normal that lowering still counts on


def _cut(core: SphereSwept, spacing: float) -> SphereSwept:
    """A core with smaller triangles; round ones are sampled instead."""
    if core.radius > 0.0:
        return core
    fine = refined(Surface(core.points, core.triangles), spacing)
    return SphereSwept(fine.points, fine.triangles)


@dataclass(frozen=True, eq=False)
class SpatialProximity:
    """A grain and a bed in 3-D, prepared for questions about many placements.

    Parts of a core are numbered: its triangles from 0 on; corner i of n is -1 - i, edge j is -1 - n - j.
    """

    grain: Solid
    bed: Terrain

    @property
    def size(self) -> float:
        """The grain's size."""
        return self.grain.size

    @cached_property
    def spacing(self) -> float:
        """The distance of samples on the grain's surface."""
        return float(min(self.size / SAMPLES, self.bed.feature / SAMPLES_PER_FEATURE))

    @cached_property
    def _samples(self) -> Surface:
        return self.grain.surface(self.spacing)

    @cached_property
    def _neighbours(self) -> np.ndarray:
        """The samples next to each sample, (n, most)."""
        a, b = self._samples.edges.T
        return grouped(np.append(a, b), np.append(b, a), len(self._samples.points))

    @cached_property
    def cores(self) -> tuple[SphereSwept, ...]:
        """The grain's cores, on smooth beds cut finely enough that a triangle sees no two crests."""
        if not isinstance(self.bed, SmoothTerrain):
            return self.grain.cores
        return tuple(_cut(core, 0.5 * self.bed.feature) for core in self.grain.cores)

    @cached_property
    def _corners(self) -> tuple[np.ndarray, ...]:
        """Which points of each core are corners of the grain's own core, not of its finer triangles."""
        result = []
        for fine, coarse in zip(self.cores, self.grain.cores, strict=True):
            scale = 1e-7 * self.size
            own = {tuple(row) for row in np.round(coarse.points / scale).astype(int).tolist()}
            mine = np.round(fine.points / scale).astype(int).tolist()
            result.append(np.array([tuple(row) in own for row in mine]))
        return tuple(result)

    @cached_property
    def _edges(self) -> tuple[np.ndarray, ...]:
        """The ends of the edges of the grain's own cores, (e, 2 ends, 3) in the body frame."""
        result = []
        for core in self.grain.cores:
            edges = Surface(core.points, core.triangles).edges
            result.append(core.points[edges[edges[:, 0] != edges[:, 1]]])
        return tuple(result)

    def minima(self, placement: Placement, within: float) -> ClosestPoints:
        """All minima whose gap is at most `within` (a length): over the surface, or over each triangle of cores.

        A minimum over a triangle need not be one over the surface (see `locally_least`). Exact to round-off
        as long as different ones are farther apart than the samples.
        """
        pieces = self.bed.pieces(placement.centre[:2], self.size + max(within, 0.0))
        parts = [self._core_minima(placement, pieces, k, within) for k in range(len(self.cores))]
        if not parts:
            starts, which = self._valleys(placement, pieces, within)
            parts = [self._descended(placement, pieces, starts, which)]
        result = ClosestPoints.joined(parts)
        return result.only(result.gaps <= within)

    def tracked(self, placement: Placement, old: ClosestPoints) -> ClosestPoints:
        """The minima `old` followed to another placement close by."""
        pieces = old.pieces
        parts = [old.only(np.empty(0, dtype=int))]
        points = placement.to_scene(old.anchors)
        for k in np.unique(old.origin[:, 0]):
            mine = old.origin[:, 0] == k
            pieces_of = old.origin[mine, 2]
            if k < 0:
                parts.append(self._descended(placement, pieces, points[mine], pieces_of))
            else:
                parts.append(self._tracked_on_core(placement, old.only(mine), int(k)))
        return ClosestPoints.joined(parts)

    def _tracked_on_core(self, placement: Placement, old: ClosestPoints, k: int) -> ClosestPoints:
        """The lowest of the minima over the triangles around each old one; corners and edges stay what they are."""
        core = self.cores[k]
        fixed, free = np.flatnonzero(old.origin[:, 1] < 0), np.flatnonzero(old.origin[:, 1] >= 0)
        row, triangle = core.search.near(old.anchors[free], 0.1 * self.spacing)
        row = free[row]
        row, triangle = (
            np.concatenate([row, fixed]),
            np.concatenate([triangle, old.origin[fixed, 1]]),
        )
        start = placement.to_scene(
            nearest_on_triangles(old.anchors[row], self._spanned(k, triangle))
        )
        feet = (placement.to_scene(old.anchors[row]) - core.radius * old.normals[row])[:, :2]
        result = self._on_core(placement, old.pieces, k, triangle, old.origin[row, 2], start, feet)
        order = np.lexsort([result.gaps, row])
        return result.only(order[np.unique(row[order], return_index=True)[1]])

    def _valleys(
        self, placement: Placement, pieces: Pieces, within: float
    ) -> tuple[Floats, np.ndarray]:
        """Sampled points (m, 3) nearer to a piece (m,) than the samples around them."""
        points = placement.to_scene(self._samples.points)
        rough = pieces.distance_estimate(points)
        rough_bound = within + self._samples.spacing
        close = np.flatnonzero(rough.min(axis=1, initial=np.inf) <= rough_bound)
        starts, which = [np.empty(0, dtype=int)], [np.empty(0, dtype=int)]
        for piece in close:
            near = np.flatnonzero(rough[piece] <= rough_bound)
            lowest = rough[piece][self._neighbours[near]].min(axis=1)
            valley = near[rough[piece][near] <= lowest]
            starts.append(valley)
            which.append(np.full(len(valley), piece))
        return points[np.concatenate(starts)], np.concatenate(which)

    def _descended(
        self, placement: Placement, pieces: Pieces, points: Floats, which: np.ndarray
    ) -> ClosestPoints:
        """Minima over a smooth grain's surface from points (m, 3) near it, in distance from pieces (m,)."""
        points = placement.to_scene(self.grain.project(placement.to_body(points)))
        sight = pieces.closest(points, which, points[:, :2])
        last = np.full((len(points), 1), np.inf)
        for _ in range(30):
            tangents, step = self._newton_step(placement, points, sight)
            # On poles without curvature steps shrink by a constant factor: their sum is taken (Aitken).
            length = np.linalg.norm(step, axis=1, keepdims=True)
            ratio = length / np.maximum(last, 1e-300)
            slow, last = (ratio > 0.4) & (ratio < 0.97), length
            step = step / np.where(slow, 1.0 - np.minimum(ratio, 0.97), 1.0)
            moved = np.zeros(len(points))
            for _ in range(5):
                trial = points + np.einsum("nik,nk->ni", tangents, step)
                trial = placement.to_scene(self.grain.project(placement.to_body(trial)))
                seen = pieces.closest(trial, which, sight.feet[:, :2])
                lower = seen.gaps <= sight.gaps + 1e-16 * self.size
                moved = np.maximum(
                    moved, np.where(lower, np.abs(step).max(axis=1, initial=0.0), 0.0)
                )
                points = np.where(lower[:, None], trial, points)
                sight = sight.replaced(lower, seen)
                step = np.where(lower[:, None], 0.0, 0.25 * step)
                if lower.all():
                    break
            if moved.max(initial=0.0) <= 1e-12 * self.size:
                break
        origin = np.column_stack([np.full((len(which), 2), -1), which]).astype(int)
        anchors = placement.to_body(points)
        return ClosestPoints(sight.gaps, points, sight.normals, None, anchors, origin, None, pieces)

    def _newton_step(
        self, placement: Placement, points: Floats, sight: ClosestPoints
    ) -> tuple[Floats, Floats]:
        """Tangents (n, 3, 2) of the grain and the step along them (n, 2) towards the least distance."""
        outward = self._outward(placement, points)
        tangents = np.stack(frame_of(outward), axis=2)
        h = 1e-5 * self.size
        # All at once: (ahead or behind, 2 tangents, n, 3).
        shifts = np.multiply.outer([h, -h], np.moveaxis(tangents, 2, 0))
        around = self._outward(placement, (points + shifts).reshape(-1, 3)).reshape(shifts.shape)
        ahead, behind = np.moveaxis(around, 1, 3)
        curvature = np.swapaxes(tangents, 1, 2) @ (ahead - behind) / (2.0 * h)
        facing = -(outward * sight.normals).sum(axis=1)[:, None, None]
        bent = np.swapaxes(tangents, 1, 2) @ sight.hessians @ tangents + facing * curvature
        values, vectors = np.linalg.eigh(0.5 * (bent + np.swapaxes(bent, 1, 2)))
        values = np.maximum(np.abs(values), 1e-9 / self.size)
        slope = np.einsum("nik,ni->nk", tangents, sight.normals)
        step = -np.einsum("nij,nj->ni", vectors, np.einsum("nji,nj->ni", vectors, slope) / values)
        length = np.linalg.norm(step, axis=1, keepdims=True)
        return tangents, step * np.minimum(1.0, self.spacing / np.maximum(length, 1e-300))

    def _outward(self, placement: Placement, x: Floats) -> Floats:
        """The placed grain's unit normals (n, 3) at points (n, 3) of the scene."""
        return self.grain.normal(placement.to_body(x)) @ placement.rotation.T

    def _core_minima(
        self, placement: Placement, pieces: Pieces, k: int, within: float
    ) -> ClosestPoints:
        """Minima over the triangles of a core, and all its corners where they are close."""
        core = self.cores[k]
        points = placement.to_scene(core.points)
        bound = within + core.radius
        curved = isinstance(pieces, Graph)
        rough = pieces.distance_estimate(points) - (0.5 * self.spacing if curved else 0.0)
        # Balls are met by triangles as well as by corners; single points are no triangles.
        wanted = pieces.flat | curved | (len(points) == 1)
        piece, vertex = np.nonzero((rough <= bound) & wanted[:, None] & self._corners[k])
        tables = [(-1 - vertex, piece, points[vertex], points[vertex, :2])]
        if curved:
            tables.append(self._edges_near(placement, pieces, k, bound))
        if isinstance(pieces, Graph) and core.radius > 0.0:
            tables.append(self._round_starts(placement, pieces, k, within))
        else:
            tables.append(self._triangles_near(pieces, points[core.triangles], bound))
        columns = [np.concatenate(column) for column in zip(*tables, strict=True)]
        return self._on_core(placement, pieces, k, *columns)

    def _edges_near(
        self, placement: Placement, pieces: Pieces, k: int, bound: float
    ) -> tuple[np.ndarray, np.ndarray, Floats, Floats]:
        """Starts along the edges of a core that are close to a smooth bed: where one lies across a crest."""
        edges = self._edges[k]
        lengths = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)
        counts = np.maximum(np.ceil(2.0 * lengths / self.bed.feature), 1).astype(int)
        edge = np.repeat(np.arange(len(edges)), counts)
        place = (
            np.concatenate([np.arange(n) for n in counts]) if len(counts) else np.empty(0)
        ) + 0.5
        s = (place / counts[edge])[:, None]
        starts = placement.to_scene((1.0 - s) * edges[edge, 0] + s * edges[edge, 1])
        slack = (0.5 * lengths / counts)[edge] + 0.5 * self.spacing
        near = np.flatnonzero(pieces.distance_estimate(starts)[0] - slack <= bound)
        number = -1 - len(self.cores[k].points) - edge[near]
        return number, np.zeros(len(near), dtype=int), starts[near], starts[near, :2]

    def _triangles_near(
        self, pieces: Pieces, corners: Floats, bound: float
    ) -> tuple[np.ndarray, np.ndarray, Floats, Floats]:
        """Triangles and pieces that are not flat and may be within a bound, with starting points."""
        middle = corners.mean(axis=1)
        reach = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
        slack = reach + (reach + 0.5 * self.spacing if isinstance(pieces, Graph) else 0.0)
        proper = reach > 0.0
        close = (pieces.distance_estimate(middle) - slack <= bound) & proper & ~pieces.flat[:, None]
        piece, triangle = np.nonzero(close)
        return triangle, piece, middle[triangle], middle[triangle, :2]

    def _round_starts(
        self, placement: Placement, pieces: Pieces, k: int, within: float
    ) -> tuple[np.ndarray, np.ndarray, Floats, Floats]:
        """Starts on a smooth bed: where samples of the round surface are lowest, and the triangles below them."""
        core = self.cores[k]
        starts, _ = self._valleys(placement, pieces, within)
        corners = placement.to_scene(core.points)[core.triangles]
        nearest = nearest_on_triangles(starts[:, None], corners)
        apart = np.linalg.norm(nearest - starts[:, None], axis=2)
        mine = np.abs(apart.min(axis=1, initial=np.inf) - core.radius) <= 1e-6 * self.size
        # The minimum may lie on a triangle next to that below the sample.
        beside = apart <= apart.min(axis=1, keepdims=True, initial=np.inf) + self.spacing
        sample, triangle = np.nonzero(beside & mine[:, None])
        return (
            triangle,
            np.zeros(len(sample), dtype=int),
            nearest[sample, triangle],
            starts[sample, :2],
        )

    def _on_core(
        self,
        placement: Placement,
        pieces: Pieces,
        k: int,
        triangle: np.ndarray,
        piece: np.ndarray,
        start: Floats,
        near: Floats,
    ) -> ClosestPoints:
        """Minima over triangles, corners and edges (m,) of a core in distance from pieces (m,)."""
        core = self.cores[k]
        corners = placement.to_scene(self._spanned(k, triangle))
        points, sight = least_on_triangles(pieces, corners, piece, start, near, self.size)
        origin = np.column_stack([np.full(len(piece), k), triangle, piece]).astype(int)
        surface = points - core.radius * sight.normals
        gaps = sight.gaps - core.radius
        return ClosestPoints(
            gaps, surface, sight.normals, None, placement.to_body(points), origin, None, pieces
        )

    def _spanned(self, k: int, triangle: np.ndarray) -> Floats:
        """The corners (m, 3, 3) of triangles of a core, in the body frame; those of corners and edges repeat."""
        core = self.cores[k]
        corners = core.points[core.triangles[np.maximum(triangle, 0)]]
        single = (triangle < 0) & (triangle >= -len(core.points))
        corners[single] = core.points[-1 - triangle[single]][:, None]
        along = triangle < -len(core.points)
        corners[along] = self._edges[k][-1 - len(core.points) - triangle[along]][:, [0, 1, 1]]
        return corners

    def locally_least(
        self,
        placement: Placement,
        minima: ClosestPoints,
        corners: bool = False,
        slack: float = 0.0,
    ) -> ClosestPoints:
        """The `minima` that are local minima over the whole surface, each once; on request all corners, too.

        Points whose neighbourhood is lower by no more than `slack` (a length) count as minima.
        """
        slack = max(slack, 1e-9 * self.size)
        keep = np.ones(len(minima), dtype=bool)
        for k in range(len(self.cores)):
            mine = np.flatnonzero(minima.origin[:, 0] == k)
            # The distance grows from there into all triangles that meet there; normals are those in the body.
            anchors, normals = minima.anchors[mine], minima.normals[mine] @ placement.rotation
            keep[mine] = _grows(self.cores[k].search, anchors, normals, slack)
        if len(self.cores) > 1:
            keep &= self.grain.level(placement.to_body(minima.points)) >= -1e-9 * self.size
        if corners:
            keep |= self._is_corner(placement, minima)
        # Minima of smooth grains are told apart no farther than samples are.
        return minima.only(keep).distinct(1e-6 * self.size if self.cores else self.spacing)

    def _is_corner(self, placement: Placement, minima: ClosestPoints) -> np.ndarray:
        """Which minima are corners of the grain, or minima along an edge of it."""
        result = (minima.origin[:, 0] >= 0) & (minima.origin[:, 1] < 0)
        for k in range(len(self.cores)):
            mine = result & (minima.origin[:, 0] == k)
            corners = placement.to_scene(self._spanned(k, minima.origin[mine, 1]))
            rise = ((corners[:, 1] - corners[:, 0]) * minima.normals[mine]).sum(axis=1)
            result[mine] = np.abs(rise) <= 1e-6 * self.size
        return result

    def lowered(self, placement: Placement) -> Placement:
        """The placement, lowered (or raised) vertically until the grain touches the bed, to round-off."""
        samples = placement.to_scene(self._samples.points)
        drop = samples[:, 2] - self.bed.height(samples[:, :2])
        placement = placement.raised(-float(drop.min()))
        minima = self.minima(placement, self._samples.spacing)
        for _ in range(60):
            if len(minima) == 0:
                raise SceneError("the grain finds no bed below it; move it over the bed")
            lift = float((-minima.gaps / np.maximum(minima.normals[:, 2], STEEPEST)).max())
            placement = placement.raised(lift)
            if abs(lift) <= 4e-15 * self.size:
                break
            minima = self.tracked(placement, minima)
        return placement

    def contacts(self, placement: Placement, tolerance: float) -> Contacts:
        """All contacts whose distance from the bed is at most `tolerance` (a length); see `closest.touching`."""
        close = self.minima(placement, tolerance)
        patches: list[Patch] = []
        loose = np.ones(len(close), dtype=bool)
        for k, core in enumerate(self.cores):
            for piece in np.unique(close.origin[:, 2]):
                mine = (close.origin[:, 0] == k) & (close.origin[:, 2] == piece)
                if not mine.any():
                    continue
                result = _patches(self, placement, core, close.only(mine), tolerance)
                for patch in result:
                    slack = max(tolerance, 1e-9 * self.size)
                    loose[mine] &= ~patch.covers(close.points[mine], slack)
                patches += result
        points = self.locally_least(placement, close.only(loose), slack=tolerance)
        points = points.only(_extreme(points, 1e-7 * self.size))
        return _contacts(points, patches, tolerance)

    def clearance(self, placement: Placement) -> tuple[float, Floats, Floats]:
        """The least gap, and the points (3,) on grain and bed where it occurs; see `rest.clearance`."""
        drop = max(placement.centre[2] - self.lowered(placement).centre[2], 0.0)
        minima, reach = self.minima(placement, drop + 1e-9 * self.size), self.size
        while not len(
            minima
        ):  # next to a bed that overhangs it the grain is nearer than its way down says
            minima, reach = self.minima(placement, reach), 2.0 * reach
        k = int(np.argmin(minima.gaps))
        gap, point = float(minima.gaps[k]), minima.points[k]
        return gap, point, point - gap * minima.normals[k]


def _grows(search: Triangles, anchors: Floats, normals: Floats, slack: float) -> np.ndarray:
    """Whether from anchors (m, 3) no triangle that meets there falls by more than `slack`."""
    size = float(np.abs(search.corners).max())
    row, triangle = search.near(anchors, 1e-9 * size)
    corners = search.corners[triangle]
    nearest = nearest_on_triangles(anchors[row], corners)
    beside = np.linalg.norm(nearest - anchors[row], axis=1) <= 1e-9 * size
    away = corners - anchors[row, None]
    falls = ((away * normals[row, None]).sum(axis=2) < -slack).any(axis=1)
    least = np.ones(len(anchors), dtype=bool)
    least[row[beside & falls]] = False
    return least


def least_on_triangles(
    pieces: Pieces, corners: Floats, which: np.ndarray, start: Floats, near: Floats, size: float
) -> tuple[Floats, ClosestPoints]:
    """Where on triangles (m, 3 corners, 3) the distance from pieces (m,) is least, and how they are seen there.

    Each step minimises the quadratic model of the distance over the triangle. Triangles may be segments or
    points. `start` (m, 3) lies in the triangles, `near` (m, 2) near the nearest points of the bed.
    """
    points = start.copy()
    sight = pieces.closest(points, which, near)
    pending = np.flatnonzero((np.ptp(corners, axis=1) > 0.0).any(axis=1))
    for _ in range(30):
        if len(pending) == 0:
            break
        here = sight.only(pending)
        before = points[pending]
        target = _model_minimum(corners[pending], before, here)
        seen = pieces.closest(target, which[pending], here.feet[:, :2])
        for _ in range(3):
            worse = seen.gaps > here.gaps + 1e-15 * size
            if not worse.any():
                break
            target = np.where(worse[:, None], 0.75 * before + 0.25 * target, target)
            seen = pieces.closest(target, which[pending], here.feet[:, :2])
        better = seen.gaps <= here.gaps + 1e-15 * size
        rows = pending[better]
        points[rows] = target[better]
        sight = sight.replaced(rows, seen, better)
        pending = pending[better & (np.abs(target - before).max(axis=1) > STILL * size)]
    return points, sight


def _model_minimum(corners: Floats, points: Floats, sight: ClosestPoints) -> Floats:
    """The least point (m, 3) of n.(x - p) + (x - p).H (x - p)/2 over triangles."""
    candidates = [_inner(corners, points, sight)]
    for i in range(3):
        start, side = corners[:, i], corners[:, (i + 1) % 3] - corners[:, i]
        bend = np.einsum("mi,mij,mj->m", side, sight.hessians, side)
        slope = _slope(start, points, sight, side)
        curved = bend > 1e-300
        s = np.where(curved, -slope / np.where(curved, bend, 1.0), np.where(slope < 0.0, 1.0, 0.0))
        s = np.clip(s, 0.0, 1.0)[:, None]
        candidates.append((1.0 - s) * start + s * corners[:, (i + 1) % 3])
    values = np.array([_model(x, points, sight) for x in candidates])
    best = np.argmin(np.where(np.isnan(values), np.inf, values), axis=0)
    return np.asarray(np.stack(candidates)[best, np.arange(len(points))])


def _model(x: Floats, points: Floats, sight: ClosestPoints) -> Floats:
    away = x - points
    return np.asarray(
        (away * sight.normals).sum(axis=1)
        + 0.5 * np.einsum("mi,mij,mj->m", away, sight.hessians, away)
    )


def _slope(x: Floats, points: Floats, sight: ClosestPoints, direction: Floats) -> Floats:
    """The derivative of the model at x along a direction."""
    gradient = sight.normals + np.einsum("mij,mj->mi", sight.hessians, x - points)
    return np.asarray((gradient * direction).sum(axis=1))


def _inner(corners: Floats, points: Floats, sight: ClosestPoints) -> Floats:
    """The stationary point of the model where it is a minimum inside the triangle, else NaN."""
    origin = corners[:, 0]
    sides = np.stack([corners[:, 1] - origin, corners[:, 2] - origin], axis=2)
    bent = np.einsum("mik,mij,mjl->mkl", sides, sight.hessians, sides)
    slope = np.stack([_slope(origin, points, sight, sides[..., k]) for k in (0, 1)], axis=1)
    determinant = np.linalg.det(bent)
    scale = bent[:, 0, 0] * bent[:, 1, 1]
    convex = (determinant > 1e-12 * np.abs(scale)) & (bent[:, 0, 0] > 0.0)
    safe = np.where(convex[:, None, None], bent, np.eye(2))
    u = -np.linalg.solve(safe, slope[..., None])[..., 0]
    inside = convex & (u >= 0.0).all(axis=1) & (u.sum(axis=1) <= 1.0)
    return np.where(inside[:, None], origin + np.einsum("mik,mk->mi", sides, u), np.nan)


@dataclass(frozen=True, eq=False)
class Patch:
    """A flat contact: its corners (k, 3) counter-clockwise, its normal (3,) out of the grain, its area."""

    corners: Floats
    normal: Floats
    area: float

    def shares(self) -> Floats:
        """The area in k parts that have the corners' hull's centroid: half of both triangles with the centroid."""
        first, second = (t[0] for t in frame_of(self.normal[None]))
        flat = self.corners @ np.column_stack([first, second])
        flat = flat - flat.mean(axis=0)
        away = flat - _centroid(flat)
        fans = np.abs(planar_cross(away, np.roll(away, -1, axis=0)))
        shares = fans + np.roll(fans, 1)
        return np.asarray(self.area * shares / shares.sum())

    def covers(self, points: Floats, tolerance: float) -> np.ndarray:
        """Which of the points (n, 3) lie on the patch, to a tolerance."""
        side = np.roll(self.corners, -1, axis=0) - self.corners
        inward = unit(np.cross(side, self.normal))
        away = points[:, None] - self.corners
        # Seen along the outward normal the corners run clockwise: the sign is that of the first corner's side.
        turned = np.sign((inward * (self.corners.mean(axis=0) - self.corners)).sum(axis=1))
        beside = ((away * (inward * turned[:, None])).sum(axis=2) >= -tolerance).all(axis=1)
        level = np.abs((away[:, 0] * self.normal).sum(axis=1)) <= 2.0 * tolerance
        return np.asarray(beside & level)


def _contacts(minima: ClosestPoints, patches: list[Patch], tolerance: float) -> Contacts:
    points = [minima.points, *(patch.corners for patch in patches)]
    normals = [
        -minima.normals,
        *(np.tile(patch.normal, (len(patch.corners), 1)) for patch in patches),
    ]
    areas = np.concatenate([np.zeros(len(minima)), *(patch.shares() for patch in patches)])
    if len(areas) == 0:
        raise SceneError(
            f"the grain does not touch the bed within {tolerance:g}; settle it on the bed"
        )
    return Contacts(np.vstack(points), np.vstack(normals), areas if patches else None)


def _patches(
    proximity: "SpatialProximity",
    placement: Placement,
    core: SphereSwept,
    close: ClosestPoints,
    tolerance: float,
) -> list[Patch]:
    """The parts of a core that lie on one piece of bed: connected triangles all of whose corners touch."""
    piece = close.origin[0, 2]
    points = placement.to_scene(core.points)
    touching = close.pieces.distance_estimate(points)[piece] <= core.radius + tolerance
    triangles = core.triangles[touching[core.triangles].all(axis=1)]
    corners = points[triangles]
    proper = np.linalg.norm(vector_areas(corners), axis=1) > THINNEST * proximity.size**2
    # A thin core has the same face on both sides: only that which faces the bed counts.
    inward = close.normals[0]
    proper &= (vector_areas(corners) * inward).sum(axis=1) < 0.0
    triangles, corners = triangles[proper], corners[proper]
    if len(triangles) and not close.pieces.flat[piece]:
        flat = _lies(close, corners, core.radius + tolerance)
        triangles, corners = triangles[flat], corners[flat]
    if not len(triangles):
        return []
    label = connected(len(core.points), triangles)[triangles[:, 0]]
    return [_patch(corners[label == item], core.radius) for item in np.unique(label)]


def _lies(close: ClosestPoints, corners: Floats, bound: float) -> np.ndarray:
    """Which triangles (m, 3, 3) lie on a curved piece of bed also between their corners."""
    middles = corners.mean(axis=1, keepdims=True), 0.5 * (corners + np.roll(corners, 1, axis=1))
    points = np.concatenate(middles, axis=1).reshape(-1, 3)
    sight = close.pieces.closest(points, np.full(len(points), close.origin[0, 2]), points[:, :2])
    return np.asarray((sight.gaps.reshape(-1, 4) <= bound).all(axis=1))


def _patch(corners: Floats, radius: float) -> Patch:
    """The convex hull of triangles (m, 3, 3) in one plane, carried outward by the radius."""
    areas = vector_areas(corners)
    normal = unit(areas.sum(axis=0)[None])[0]
    points = corners.reshape(-1, 3)
    first, second = (t[0] for t in frame_of(normal[None]))
    order = _hull(points @ np.column_stack([first, second]))
    return Patch(
        points[order] + radius * normal, normal, float(np.linalg.norm(areas, axis=1).sum())
    )


def _hull(points: Floats) -> np.ndarray:
    """The corners of the convex hull of points (n, 2) in counter-clockwise order, none on the side of another."""
    from scipy.spatial import ConvexHull

    _, first = np.unique(points, axis=0, return_index=True)
    order = np.asarray(first[ConvexHull(points[first]).vertices])
    side = np.roll(points[order], -1, axis=0) - points[order]
    turns = planar_cross(np.roll(side, 1, axis=0), side)
    return order[turns > 1e-9 * float(np.ptp(points, axis=0).max()) ** 2]


def _centroid(corners: Floats) -> Floats:
    """The centroid (2,) of a polygon's corners (n, 2)."""
    return Moments.within(np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)).centroid


def _extreme(minima: ClosestPoints, tolerance: float) -> np.ndarray:
    """Which points to keep where several of one normal lie on a straight line of contact: its two ends."""
    keep = np.ones(len(minima), dtype=bool)
    label = np.round(minima.normals, 6)
    for normal in np.unique(label, axis=0):
        mine = np.flatnonzero((label == normal).all(axis=1))
        if len(mine) < 3:
            continue
        points = minima.points[mine]
        away = points - points.mean(axis=0)
        direction = np.linalg.svd(away, full_matrices=False)[2][0]
        along = away @ direction
        if np.abs(away - np.outer(along, direction)).max() <= tolerance:
            keep[mine] = False
            keep[mine[[np.argmin(along), np.argmax(along)]]] = True
    return keep
