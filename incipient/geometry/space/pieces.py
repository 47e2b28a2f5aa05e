"""What beds in space are made of: half-spaces and balls, or one smooth graph, each with its signed distance.

The bed's solid is the union of its pieces, so that a grain is clear of the bed if it is clear of every piece. Pieces
are numbered from 0: `flat` (k,) says which are half-spaces, `rough` gives the distances (k, n) of all from points (n,
3), exact or good near the bed, `sight` piece `which` (m,) from each of points (m, 3), of several nearest points that by
`near` (m, 2).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from incipient.arrays import Floats


@dataclass(frozen=True, eq=False)
class Sight:
    """A piece seen from points (m, 3): signed distances (m,), the nearest points and the normals there (m, 3).

    `bends` (m, 3, 3) are the second derivatives of the signed distance.
    """

    gaps: Floats
    feet: Floats
    normals: Floats
    bends: Floats


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

    def rough(self, points: Floats) -> Floats:
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

    def sight(self, points: Floats, which: np.ndarray, near: Floats) -> Sight:
        """Closed formulae; `near` does not matter."""
        gaps, normals = np.empty(len(points)), np.empty((len(points), 3))
        bends = np.zeros((len(points), 3, 3))
        flat = which < len(self.origins)
        plane, ball = which[flat], which[~flat] - len(self.origins)
        normals[flat] = self.directions[plane]
        gaps[flat] = ((points[flat] - self.origins[plane]) * normals[flat]).sum(axis=1)
        away = self._beside(points[~flat], ball)
        length = np.maximum(np.linalg.norm(away, axis=1), 1e-300)
        normals[~flat] = away / length[:, None]
        gaps[~flat] = length - self.radii[ball]
        across = np.eye(3) - np.einsum("ni,nj->nij", normals[~flat], normals[~flat])
        bends[~flat] = across / length[:, None, None]
        return Sight(gaps, points - gaps[:, None] * normals, normals, bends)


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

    def rough(self, points: Floats) -> Floats:
        """The height above the tangent plane straight below, (1, n)."""
        above = points[:, 2] - self.height(points[:, :2])
        slope = self.gradient(points[:, :2])
        return np.asarray(above / np.sqrt(1.0 + (slope**2).sum(axis=1)))[None]

    def sight(self, points: Floats, which: np.ndarray, near: Floats) -> Sight:
        """The local nearest points by Newton's method from `near`."""
        x = self._feet(points, near)
        height, slope, curvature = self.height(x), self.gradient(x), self.hessian(x)
        stretch = np.sqrt(1.0 + (slope**2).sum(axis=1))
        normals = np.column_stack([-slope, np.ones(len(x))]) / stretch[:, None]
        feet = np.column_stack([x, height])
        gaps = ((points - feet) * normals).sum(axis=1)
        return Sight(gaps, feet, normals, _bends(gaps, slope, -curvature / stretch[:, None, None]))

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


def _bends(gaps: Floats, slope: Floats, second: Floats) -> Floats:
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
