"""Closest points of a grain and a bed in 3-D.

Each part of the cores of a grain (flat faces, balls, rods), or the surface of a smooth grain, is searched by Newton's
method with the second derivatives of the bed's distance.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from incipient.arrays import Floats, planar_cross, unit
from incipient.errors import SceneError
from incipient.geometry.contacts import ClosestPoints, Contacts, tangents
from incipient.geometry.placement import Placement
from incipient.geometry.proximity import Proximity
from incipient.geometry.shape import Moments
from incipient.geometry.space.beds import Pieces, SmoothTerrain, Terrain, shortened
from incipient.geometry.space.grains import Solid
from incipient.geometry.triangles import (
    Surface,
    Triangles,
    connected,
    grouped,
    nearest_on_triangles,
    vector_areas,
)

SAME = 1e-9  # of the grain's size: lengths that are one
Starts = tuple[np.ndarray, np.ndarray, Floats, Floats]  # parts, pieces, points, places of the bed


@dataclass(frozen=True, eq=False)
class SpatialProximity(Proximity):
    """A grain and a bed in 3-D. A core's triangles, corners and edges are numbered as its parts."""

    grain: Solid
    bed: Terrain

    @cached_property
    def spacing(self) -> float:
        # 24 samples along the grain, 6 along a feature of the bed
        return float(min(self.size / 24.0, self.bed.feature / 6.0))

    @cached_property
    def _samples(self) -> Surface:
        return self.grain.surface(self.spacing)

    @property
    def sampling(self) -> float:
        return self._samples.spacing

    def drop(self, placement: Placement) -> float:
        samples = placement.to_scene(self._samples.points)
        return float((samples[:, 2] - self.bed.height(samples[:, :2])).min())

    @cached_property
    def _neighbours(self) -> np.ndarray:
        a, b = self._samples.topology.edges.T
        return grouped(np.append(a, b), np.append(b, a), len(self._samples.points))

    @cached_property
    def _places(self) -> list[tuple[np.ndarray, Floats]]:
        """Corners of each core, on smooth beds also points along edges, half a feature from each other at least."""
        result = []
        for core in self.grain.cores:
            first, corners = len(core.triangles), len(core.points)
            ends = (
                core.parts[first:]
                if isinstance(self.bed, SmoothTerrain)
                else core.parts[first:][:corners]
            )
            lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
            counts = np.maximum(np.ceil(2.0 * lengths / self.bed.feature), 1).astype(int)
            counts[(lengths > 0.0) & (lengths < 2.0 * self.spacing)] = 0  # as near are corners
            part = np.repeat(np.arange(len(ends)), counts)
            s = np.concatenate([(np.arange(n) + 0.5) / n for n in counts])[:, None]
            result.append((first + part, (1.0 - s) * ends[part, 0] + s * ends[part, 1]))
        return result

    def minima(self, placement: Placement, within: float) -> ClosestPoints:
        """Minima of at most `within` (a length) over the surface, or over each part of a core (see `locally_least`)."""
        pieces = self.bed.pieces(placement.centre[:2], self.size + max(within, 0.0))
        valleys = np.empty((0, 3)), np.empty(0, dtype=int)
        if isinstance(pieces, SmoothTerrain) or not self.grain.cores:
            valleys = self._valleys(placement, pieces, within)
        parts = [
            self._on_core(
                placement, pieces, k, *self._starts(placement, pieces, k, within, valleys[0])
            )
            for k in range(len(self.grain.cores))
        ] or [self._descended(placement, pieces, *valleys)]
        result = ClosestPoints.joined(parts)
        return result.only(result.gaps <= within)

    def tracked(self, placement: Placement, old: ClosestPoints) -> ClosestPoints:
        if not self.grain.cores:
            points = placement.to_scene(old.anchors)
            return self._descended(placement, old.pieces, points, old.origin[:, 2])
        parts = [old.only(np.empty(0, dtype=int))]
        for k in np.unique(old.origin[:, 0]):
            parts.append(self._tracked_on_core(placement, old.only(old.origin[:, 0] == k), int(k)))
        return ClosestPoints.joined(parts)

    def _tracked_on_core(self, placement: Placement, old: ClosestPoints, k: int) -> ClosestPoints:
        core = self.grain.cores[k]
        fixed = old.origin[:, 1] >= len(core.triangles)
        row, part = core.search.near(old.anchors, 0.1 * self.spacing)
        free = ~fixed[row]
        row = np.concatenate([row[free], np.flatnonzero(fixed)])
        part = np.concatenate([part[free], old.origin[fixed, 1]])
        start = nearest_on_triangles(old.anchors[row], core.parts[part])
        feet = (placement.to_scene(old.anchors[row]) - core.radius * old.normals[row])[:, :2]
        result = self._on_core(
            placement, old.pieces, k, part, old.origin[row, 2], placement.to_scene(start), feet
        )
        # A triangle beside may lead to another minimum, which may be lower.
        strays = np.linalg.norm(result.anchors - old.anchors[row], axis=1) > self.spacing
        order = np.lexsort([result.gaps, strays, row])
        return result.only(order[np.unique(row[order], return_index=True)[1]])

    def _valleys(
        self, placement: Placement, pieces: Pieces, within: float
    ) -> tuple[Floats, np.ndarray]:
        points = placement.to_scene(self._samples.points)
        rough = pieces.distance_estimate(points)
        close = rough <= within + self.sampling
        piece, sample = np.nonzero(close)
        lowest = rough[piece[:, None], self._neighbours[sample]].min(axis=1, initial=np.inf)
        least = rough[piece, sample] <= lowest
        return points[sample[least]], piece[least]

    def _descended(
        self, placement: Placement, pieces: Pieces, points: Floats, which: np.ndarray
    ) -> ClosestPoints:
        def onto(x: Floats) -> Floats:
            return placement.to_scene(self.grain.project(placement.to_body(x)))

        def step(x: Floats, sight: ClosestPoints, _: np.ndarray) -> Floats:
            return self._newton_step(placement, x, sight)

        points, sight = descended(pieces, onto(points), which, points[:, :2], step, onto, self.size)
        origin = np.column_stack([np.full((len(which), 2), -1), which]).astype(int)
        anchors = placement.to_body(points)
        return ClosestPoints(sight.gaps, points, sight.normals, None, anchors, origin, pieces)

    def _newton_step(self, placement: Placement, points: Floats, sight: ClosestPoints) -> Floats:
        h = 1e-5 * self.size
        outward = self.grain.normal(placement.to_body(points)) @ placement.rotation.T
        along = np.stack(tangents(outward), axis=1)  # (n, 2, 3)
        around = points[:, None] + h * np.concatenate([along, -along], axis=1)
        turned = self.grain.normal(placement.to_body(around.reshape(-1, 3))) @ placement.rotation.T
        ahead, behind = np.moveaxis(turned.reshape(-1, 2, 2, 3), 1, 0)
        curvature = (ahead - behind) @ np.swapaxes(along, 1, 2) / (2.0 * h)
        facing = -(outward * sight.normals).sum(axis=1)[:, None, None]
        bent = along @ sight.hessians @ np.swapaxes(along, 1, 2) + facing * curvature
        values, vectors = np.linalg.eigh(0.5 * (bent + np.swapaxes(bent, 1, 2)))
        values = np.maximum(np.abs(values), 1e-9 / self.size)
        slope = np.einsum("nki,ni->nk", along, sight.normals)
        steps = -np.einsum("nij,nj->ni", vectors, np.einsum("nji,nj->ni", vectors, slope) / values)
        return shortened(np.einsum("nki,nk->ni", along, steps), self.spacing)

    def _starts(
        self, placement: Placement, pieces: Pieces, k: int, within: float, valleys: Floats
    ) -> Starts:
        core, curved = self.grain.cores[k], isinstance(pieces, SmoothTerrain)
        parts, points = self._places[k]
        points, bound = placement.to_scene(points), within + core.radius
        slack = 0.5 * self.spacing + 0.25 * self.bed.feature if curved else 0.0
        # Balls are met by triangles as well as by corners; single points are no triangles.
        cornered = pieces.flat | curved | (len(core.points) == 1)
        close = pieces.distance_estimate(points) - slack <= bound
        piece, place = np.nonzero(close & cornered[:, None])
        corners = parts[place], piece, points[place], points[place, :2]
        if curved:
            triangles = self._below(placement, k, valleys)
        else:
            triangles = self._near_balls(
                pieces, placement.to_scene(core.parts[: len(core.triangles)]), bound
            )
        both = zip(corners, triangles, strict=True)
        part, piece, start, near = (np.concatenate(tables) for tables in both)
        return part, piece, start, near

    def _near_balls(self, pieces: Pieces, corners: Floats, bound: float) -> Starts:
        middle = corners.mean(axis=1)
        reach = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
        close = (pieces.distance_estimate(middle) - reach <= bound) & (reach > 0.0)
        piece, triangle = np.nonzero(close & ~pieces.flat[:, None])
        return triangle, piece, middle[triangle], middle[triangle, :2]

    def _below(self, placement: Placement, k: int, valleys: Floats) -> Starts:
        core, body = self.grain.cores[k], placement.to_body(valleys)
        feet, sample, triangle = core.search.nearest(body, self.spacing)
        own = np.abs(np.linalg.norm(feet - body, axis=1) - core.radius) <= 1e-6 * self.size
        sample, triangle = sample[own[sample]], triangle[own[sample]]
        nearest = nearest_on_triangles(body[sample], core.parts[triangle])
        pieces = np.zeros(len(sample), dtype=int)
        return triangle, pieces, placement.to_scene(nearest), valleys[sample, :2]

    def _on_core(
        self,
        placement: Placement,
        pieces: Pieces,
        k: int,
        part: np.ndarray,
        piece: np.ndarray,
        start: Floats,
        near: Floats,
    ) -> ClosestPoints:
        core = self.grain.cores[k]
        corners = placement.to_scene(core.parts[part])
        # A sixth of a feature, as samples are apart: no step leads across a crest.
        longest = self.bed.feature / 6.0 if isinstance(pieces, SmoothTerrain) else np.inf

        def step(x: Floats, sight: ClosestPoints, rows: np.ndarray) -> Floats:
            return shortened(_model_minimum(corners[rows], x, sight) - x, longest)

        points, sight = descended(pieces, start, piece, near, step, lambda x: x, self.size)
        origin = np.column_stack([np.full(len(piece), k), part, piece]).astype(int)
        surface, anchors = points - core.radius * sight.normals, placement.to_body(points)
        gaps = sight.gaps - core.radius
        return ClosestPoints(gaps, surface, sight.normals, None, anchors, origin, pieces)

    def locally_least(
        self,
        placement: Placement,
        minima: ClosestPoints,
        corners: bool = False,
        slack: float = 0.0,
    ) -> ClosestPoints:
        """Minima over the whole surface, each once; on request also all corners.

        Points whose neighbourhood is lower by at most `slack` (a length) count as minima.
        """
        slack = max(slack, SAME * self.size)
        keep = np.ones(len(minima), dtype=bool)
        if len(self.grain.cores) > 1:
            keep = self.grain.level(placement.to_body(minima.points)) >= -SAME * self.size
        for k, core in enumerate(self.grain.cores):
            mine = np.flatnonzero(minima.origin[:, 0] == k)
            normals, part = minima.normals[mine] @ placement.rotation, minima.origin[mine, 1]
            keep[mine] &= _grows(core.search, minima.anchors[mine], normals, slack)
            if corners:
                ends = core.parts[part]
                rise = ((ends[:, 1] - ends[:, 0]) * normals).sum(axis=1)
                keep[mine] |= (part >= len(core.triangles)) & (np.abs(rise) <= 1e-6 * self.size)
        # Minima of smooth grains are distinguished no better than samples are.
        return minima.only(keep).distinct(1e-6 * self.size if self.grain.cores else self.spacing)

    def contacts(self, placement: Placement, tolerance: float) -> Contacts:
        close, slack = self.minima(placement, tolerance), max(tolerance, SAME * self.size)
        loose, patches = np.ones(len(close), dtype=bool), list[Contacts]()
        for k, piece in np.unique(close.origin[:, [0, 2]], axis=0):
            mine = np.flatnonzero((close.origin[:, 0] == k) & (close.origin[:, 2] == piece))
            if k >= 0:
                for corners in self._flat(placement, k, close.only(mine), tolerance):
                    radius, anchors = (
                        self.grain.cores[k].radius,
                        placement.to_scene(close.anchors[mine]),
                    )
                    nearest = nearest_on_triangles(anchors[:, None], corners)
                    apart = np.linalg.norm(nearest - anchors[:, None], axis=2)
                    loose[mine] &= apart.min(axis=1) > slack
                    patches.append(_patch(corners, radius))
        points = self.locally_least(placement, close.only(loose), slack=tolerance)
        points = points.only(_extreme(points, 1e-7 * self.size))
        if not len(points) + len(patches):
            raise SceneError(
                f"the grain does not touch the bed within {tolerance:g}; settle it on the bed"
            )
        return Contacts(
            np.concatenate([points.points, *(patch.points for patch in patches)]),
            np.concatenate([-points.normals, *(patch.normals for patch in patches)]),
            np.concatenate([np.zeros(len(points)), *(patch.areas for patch in patches)])
            if patches
            else None,
        )

    def _flat(
        self, placement: Placement, k: int, close: ClosestPoints, tolerance: float
    ) -> list[Floats]:
        core, bound, piece = (
            self.grain.cores[k],
            self.grain.cores[k].radius + tolerance,
            close.origin[0, 2],
        )
        points = placement.to_scene(core.points)
        touching = close.pieces.distance_estimate(points)[piece] <= bound
        triangles = core.triangles[touching[core.triangles].all(axis=1)]
        areas = vector_areas(points[triangles])
        # A thin core has the same face on both sides: only that which faces the bed counts.
        faces = np.linalg.norm(areas, axis=1) > SAME * self.size**2
        triangles = triangles[faces & ((areas * close.normals[0]).sum(axis=1) < 0.0)]
        corners = points[triangles]
        # A curved bed may touch corners alone.
        between = np.stack(
            [corners.mean(axis=1), *(0.5 * (corners + np.roll(corners, 1, 1))).swapaxes(0, 1)]
        )
        flat = between.reshape(-1, 3)
        gaps = close.pieces.closest(flat, np.full(len(flat), piece), flat[:, :2]).gaps
        lies = (gaps.reshape(4, -1) <= bound).all(axis=0)
        label = connected(len(points), triangles[lies])[triangles[lies, 0]]
        return [corners[lies][label == item] for item in np.unique(label)]


def _grows(search: Triangles, anchors: Floats, normals: Floats, slack: float) -> np.ndarray:
    size = float(np.abs(search.corners).max())
    row, triangle = search.near(anchors, SAME * size)
    corners = search.corners[triangle]
    nearest = nearest_on_triangles(anchors[row], corners)
    beside = np.linalg.norm(nearest - anchors[row], axis=1) <= SAME * size
    rises = ((corners - anchors[row, None]) * normals[row, None]).sum(axis=2)
    least = np.ones(len(anchors), dtype=bool)
    least[row[beside & (rises < -slack).any(axis=1)]] = False
    return least


def descended(
    pieces: Pieces,
    points: Floats,
    which: np.ndarray,
    near: Floats,
    step_of: Callable[[Floats, ClosestPoints, np.ndarray], Floats],
    onto: Callable[[Floats], Floats],
    size: float,
) -> tuple[Floats, ClosestPoints]:
    """Points of a surface at least distance from pieces (m,), next to points (m, 3), and their closest points.

    `step_of` gives steps (k, 3) from closest points of rows (k,); `onto` carries points back onto the surface. `near`
    (m, 2) lies near the feet on the bed.
    """
    points, sight = points.copy(), pieces.closest(points, which, near)
    pending = np.arange(len(points))
    for _ in range(30):
        step = step_of(points[pending], sight.only(pending), pending)
        moves = np.abs(step).max(axis=1) > 1e-15 * size  # a corner stays
        pending, step = pending[moves], step[moves]
        here, before, left = sight.only(pending), points[pending], np.arange(len(pending))
        for _ in range(5):
            if len(left) == 0:
                break
            trial, rows = onto(before[left] + step[left]), pending[left]
            seen = pieces.closest(trial, which[rows], here.feet[left, :2])
            better = seen.gaps <= here.gaps[left] + 1e-14 * size
            points[rows[better]] = trial[better]
            sight = sight.replaced(rows[better], seen.only(better))
            left = left[~better]
            step[left] *= 0.25
        # Newton's method squares errors: a last step this short leaves 1e-16.
        going = np.abs(step).max(axis=1) > 1e-8 * size
        going[left] = False
        pending = pending[going]
        if len(pending) == 0:
            break
    return points, sight


def _model_minimum(corners: Floats, points: Floats, sight: ClosestPoints) -> Floats:
    """The least point (m, 3) of n.(x - p) + (x - p).H (x - p)/2 over triangles."""
    # A bed that is curved one way alone has a line of minima: the nearest place of it is taken.
    largest = np.abs(sight.hessians).max(axis=(1, 2))[:, None, None]
    sight = replace(sight, hessians=sight.hessians + 1e-6 * largest * np.eye(3))
    away = corners - points[:, None]
    slopes = sight.normals[:, None] + np.einsum("mij,mkj->mki", sight.hessians, away)
    sides = np.roll(corners, -1, axis=1) - corners
    bends = np.einsum("mki,mij,mkj->mk", sides, sight.hessians, sides)
    falls = -(slopes * sides).sum(axis=2)
    curved = bends > 1e-300
    s = np.where(curved, falls / np.where(curved, bends, 1.0), np.where(falls > 0.0, 1.0, 0.0))
    on_sides = away + np.clip(s, 0.0, 1.0)[..., None] * sides
    # The stationary point within, from its first corner along both sides that meet there.
    frame = np.stack([sides[:, 0], -sides[:, 2]], axis=1)
    bent = frame @ sight.hessians @ np.swapaxes(frame, 1, 2)
    convex = np.linalg.det(bent) > 1e-12 * np.abs(bent[:, 0, 0] * bent[:, 1, 1])
    convex &= bent[:, 0, 0] > 0.0
    safe = np.where(convex[:, None, None], bent, np.eye(2))
    u = -np.linalg.solve(safe, (frame @ slopes[:, 0, :, None]))
    inside = convex & (u >= 0.0).all(axis=(1, 2)) & (u.sum(axis=(1, 2)) <= 1.0)
    within = away[:, 0] + (np.swapaxes(frame, 1, 2) @ u)[..., 0]
    candidates = np.concatenate([within[:, None], on_sides], axis=1)
    values = (candidates * sight.normals[:, None]).sum(axis=2)
    curvature = np.einsum("mki,mij,mkj->mk", candidates, sight.hessians, candidates)
    # Over a hollow of the bed the far end may be lower, but the way there leads up.
    values += 0.5 * np.maximum(curvature, 0.0)
    values[~inside, 0] = np.inf
    return np.asarray(points + candidates[np.arange(len(points)), np.argmin(values, axis=1)])


def _patch(triangles: Floats, radius: float) -> Contacts:
    """Corners of the convex hull of coplanar triangles (m, 3, 3), carried outward by the radius.

    The area of each keeps the hull's centroid.
    """
    from scipy.spatial import ConvexHull  # which takes time to import

    areas = vector_areas(triangles)
    normal = unit(areas.sum(axis=0))
    points = np.unique(triangles.reshape(-1, 3), axis=0)
    flat = points @ np.stack(tangents(normal[None]), axis=2)[0]
    order = ConvexHull(flat).vertices
    side = np.roll(flat[order], -1, axis=0) - flat[order]
    # None on the side of another.
    turns = planar_cross(np.roll(side, 1, axis=0), side)
    order = order[turns > SAME * np.ptp(flat, axis=0).max() ** 2]
    hull = flat[order] - flat[order].mean(axis=0)
    away = hull - Moments.within(np.stack([hull, np.roll(hull, -1, axis=0)], axis=1)).centroid
    fans = np.abs(planar_cross(away, np.roll(away, -1, axis=0)))
    parts = (fans + np.roll(fans, 1)) / (2.0 * fans.sum()) * np.linalg.norm(areas, axis=1).sum()
    return Contacts(points[order] + radius * normal, np.tile(normal, (len(order), 1)), parts)


def _extreme(minima: ClosestPoints, tolerance: float) -> np.ndarray:
    keep = np.ones(len(minima), dtype=bool)
    _, label = np.unique(np.round(minima.normals, 6), axis=0, return_inverse=True)
    for item in np.unique(label):
        mine = np.flatnonzero(label.ravel() == item)
        away = minima.points[mine] - minima.points[mine].mean(axis=0)
        direction = np.linalg.svd(away, full_matrices=False)[2][0]
        along = away @ direction
        if len(mine) > 2 and np.abs(away - np.outer(along, direction)).max() <= tolerance:
            keep[mine] = np.isin(along, [along.min(), along.max()])
    return keep
