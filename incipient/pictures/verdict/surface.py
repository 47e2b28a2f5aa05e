"""The grain's surface with the traction on it, point by point around the grain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import planar_cross, quarter_turned
from ...output.series_file import StoredStep
from ..flow.mesh import directed, enclosed_area


@dataclass(frozen=True)
class GrainSurface:
    """Points, unit normals out of the grain and tractions, (n, 2) each, anticlockwise around the grain.

    is_closed: whether they go all round; else no flow reaches the grain between the last point and the first
    """

    points: np.ndarray
    normals: np.ndarray
    tractions: np.ndarray
    is_closed: bool = True

    @classmethod
    def of(cls, step: StoredStep) -> GrainSurface:
        """Put the edges of a surface series in order around the grain."""
        points = step.points[:, :2]
        edges = directed(step.cells)
        if enclosed_area(points, edges) < 0:
            edges = edges[::-1][:, [1, 0, 2]]
        is_closed = bool(edges[-1, 1] == edges[0, 0])
        nodes = np.append(edges[:, [0, 2]].ravel(), [] if is_closed else edges[-1:, 1]).astype(int)
        normals = -quarter_turned(_tangents(points, edges, is_closed))
        return cls(points[nodes], normals, step.fields["traction"][nodes, :2], is_closed)

    @property
    def size(self) -> float:
        """Largest extent along an axis."""
        return float(np.ptp(self.points, axis=0).max())

    @property
    def normal_part(self) -> np.ndarray:
        """(n,) traction along the outward normal; negative where the grain is pressed."""
        return np.sum(self.tractions * self.normals, axis=1)

    @property
    def tangential_part(self) -> np.ndarray:
        """(n,) traction along the surface, positive anticlockwise."""
        return planar_cross(self.normals, self.tractions)

    def spaced(self, count: int) -> np.ndarray:
        """Indices of at most `count` points, at about equal distances along the surface."""
        steps = np.linalg.norm(np.diff(self.points, axis=0, append=self.points[:1]), axis=1)
        reached = np.cumsum(steps) - steps
        wanted = np.arange(count) * steps.sum() / count
        return np.unique(np.minimum(np.searchsorted(reached, wanted), len(reached) - 1))

    def angles(self, centre: np.ndarray) -> np.ndarray:
        """(n,) directions of the points from a centre, degrees from 0 to 360, anticlockwise from +x."""
        across, up = (self.points - centre).T
        return np.degrees(np.arctan2(up, across)) % 360


def _tangents(points: np.ndarray, edges: np.ndarray, is_closed: bool) -> np.ndarray:
    """(2 n, 2) unit tangents at starts and middles of edges, between two their mean, and at an open curve's end."""
    start, end, middle = (points[edges[:, i]] for i in range(3))
    leaving, arriving = 4 * middle - 3 * start - end, 3 * end + start - 4 * middle
    leaving, arriving = (t / np.linalg.norm(t, axis=1)[:, None] for t in (leaving, arriving))
    before = np.roll(arriving, 1, axis=0)
    if not is_closed:
        before[0] = leaving[0]
    tangents = np.stack([leaving + before, end - start], axis=1).reshape(-1, 2)
    tangents = np.vstack([tangents, arriving[:0] if is_closed else arriving[-1:]])
    return tangents / np.linalg.norm(tangents, axis=1)[:, None]
