"""The contacts of a grain in space with its bed: points, and patches by the corners of their convex hull."""

from dataclasses import dataclass

import numpy as np

from incipient.arrays import Floats, planar_cross, unit
from incipient.errors import SceneError
from incipient.geometry import moments
from incipient.geometry.contacts import Contacts
from incipient.geometry.placement import Placement
from incipient.geometry.space.closest import DistanceMinima, SpatialProximity
from incipient.geometry.space.solid import Core, frame_of
from incipient.geometry.space.surfaces import connected, vector_areas

THINNEST = 1e-9  # area of a patch, in grain sizes squared, below which it is none


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
        away = flat - moments.polygon(flat).centroid
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


def footprint(proximity: SpatialProximity, placement: Placement, tolerance: float) -> Contacts:
    """All contacts whose distance from the bed is at most `tolerance` (a length).

    Raises SceneError if nothing touches.
    """
    close = proximity.minima(placement, tolerance)
    patches: list[Patch] = []
    loose = np.ones(len(close), dtype=bool)
    for k, core in enumerate(proximity.cores):
        for piece in np.unique(close.origin[:, 2]):
            mine = (close.origin[:, 0] == k) & (close.origin[:, 2] == piece)
            if not mine.any():
                continue
            found = _patches(proximity, placement, core, close.only(mine), tolerance)
            for patch in found:
                loose[mine] &= ~patch.covers(
                    close.points[mine], max(tolerance, 1e-9 * proximity.size)
                )
            patches += found
    points = proximity.locally_least(placement, close.only(loose), slack=tolerance)
    points = points.only(_extreme(points, 1e-7 * proximity.size))
    return _contacts(points, patches, tolerance)


def _contacts(minima: DistanceMinima, patches: list[Patch], tolerance: float) -> Contacts:
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
    proximity: SpatialProximity,
    placement: Placement,
    core: Core,
    close: DistanceMinima,
    tolerance: float,
) -> list[Patch]:
    """The parts of a core that lie on one piece of bed: connected triangles all of whose corners touch."""
    piece = close.origin[0, 2]
    points = placement.to_scene(core.points)
    touching = close.pieces.rough(points)[piece] <= core.radius + tolerance
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
    return [_patch(corners[label == one], core.radius) for one in np.unique(label)]


def _lies(close: DistanceMinima, corners: Floats, bound: float) -> np.ndarray:
    """Which triangles (m, 3, 3) lie on a curved piece of bed also between their corners."""
    middles = corners.mean(axis=1, keepdims=True), 0.5 * (corners + np.roll(corners, 1, axis=1))
    points = np.concatenate(middles, axis=1).reshape(-1, 3)
    sight = close.pieces.sight(points, np.full(len(points), close.origin[0, 2]), points[:, :2])
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


def _extreme(minima: DistanceMinima, tolerance: float) -> np.ndarray:
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
