"""The point of a triangle that is nearest to a piece of the bed: Newton's method within the triangle."""

import numpy as np

from incipient.arrays import Floats
from incipient.geometry.space.pieces import Pieces, Sight

STILL = 1e-11  # grain sizes: a last step this short leaves an error of its square


def least_on_triangles(
    pieces: Pieces, corners: Floats, which: np.ndarray, start: Floats, near: Floats, size: float
) -> tuple[Floats, Sight]:
    """Where on triangles (m, 3 corners, 3) the distance from pieces (m,) is least, and how they are seen there.

    Each step minimises the quadratic model of the distance over the triangle. Triangles may be segments or
    points. `start` (m, 3) lies in the triangles, `near` (m, 2) near the nearest points of the bed.
    """
    points = start.copy()
    sight = pieces.sight(points, which, near)
    pending = np.flatnonzero((np.ptp(corners, axis=1) > 0.0).any(axis=1))
    for _ in range(30):
        if len(pending) == 0:
            break
        here = _rows(sight, pending)
        before = points[pending]
        target = _model_minimum(corners[pending], before, here)
        seen = pieces.sight(target, which[pending], here.feet[:, :2])
        for _ in range(3):
            worse = seen.gaps > here.gaps + 1e-15 * size
            if not worse.any():
                break
            target = np.where(worse[:, None], 0.75 * before + 0.25 * target, target)
            seen = pieces.sight(target, which[pending], here.feet[:, :2])
        better = seen.gaps <= here.gaps + 1e-15 * size
        rows = pending[better]
        points[rows] = target[better]
        for name in ("gaps", "feet", "normals", "bends"):
            getattr(sight, name)[rows] = getattr(seen, name)[better]
        pending = pending[better & (np.abs(target - before).max(axis=1) > STILL * size)]
    return points, sight


def _rows(sight: Sight, index: np.ndarray) -> Sight:
    return Sight(sight.gaps[index], sight.feet[index], sight.normals[index], sight.bends[index])


def _model_minimum(corners: Floats, points: Floats, sight: Sight) -> Floats:
    """The least point (m, 3) of n.(x - p) + (x - p).H (x - p)/2 over triangles."""
    candidates = [_inner(corners, points, sight)]
    for i in range(3):
        start, side = corners[:, i], corners[:, (i + 1) % 3] - corners[:, i]
        bend = np.einsum("mi,mij,mj->m", side, sight.bends, side)
        slope = _slope(start, points, sight, side)
        curved = bend > 1e-300
        s = np.where(curved, -slope / np.where(curved, bend, 1.0), np.where(slope < 0.0, 1.0, 0.0))
        s = np.clip(s, 0.0, 1.0)[:, None]
        candidates.append((1.0 - s) * start + s * corners[:, (i + 1) % 3])
    values = np.array([_model(x, points, sight) for x in candidates])
    best = np.argmin(np.where(np.isnan(values), np.inf, values), axis=0)
    return np.asarray(np.stack(candidates)[best, np.arange(len(points))])


def _model(x: Floats, points: Floats, sight: Sight) -> Floats:
    away = x - points
    return np.asarray(
        (away * sight.normals).sum(axis=1)
        + 0.5 * np.einsum("mi,mij,mj->m", away, sight.bends, away)
    )


def _slope(x: Floats, points: Floats, sight: Sight, direction: Floats) -> Floats:
    """The derivative of the model at x along a direction."""
    gradient = sight.normals + np.einsum("mij,mj->mi", sight.bends, x - points)
    return np.asarray((gradient * direction).sum(axis=1))


def _inner(corners: Floats, points: Floats, sight: Sight) -> Floats:
    """The stationary point of the model where it is a minimum inside the triangle, else NaN."""
    origin = corners[:, 0]
    sides = np.stack([corners[:, 1] - origin, corners[:, 2] - origin], axis=2)
    bent = np.einsum("mik,mij,mjl->mkl", sides, sight.bends, sides)
    slope = np.stack([_slope(origin, points, sight, sides[..., k]) for k in (0, 1)], axis=1)
    determinant = np.linalg.det(bent)
    scale = bent[:, 0, 0] * bent[:, 1, 1]
    convex = (determinant > 1e-12 * np.abs(scale)) & (bent[:, 0, 0] > 0.0)
    safe = np.where(convex[:, None, None], bent, np.eye(2))
    u = -np.linalg.solve(safe, slope[..., None])[..., 0]
    inside = convex & (u >= 0.0).all(axis=1) & (u.sum(axis=1) <= 1.0)
    return np.where(inside[:, None], origin + np.einsum("mik,mk->mi", sides, u), np.nan)
