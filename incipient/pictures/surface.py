"""The grain's surface with the traction on it, point by point around the grain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import planar_cross, quarter_turned
from ..output.series_file import Step
from .mesh import directed, enclosed_area


@dataclass(frozen=True)
class Surface:
    """Points, unit normals out of the grain and tractions, (n, 2) each, anticlockwise around the grain."""

    points: np.ndarray
    normals: np.ndarray
    tractions: np.ndarray

    @classmethod
    def of(cls, step: Step) -> Surface:
        """Put the edges of a surface series in order around the grain."""
        points = step.points[:, :2]
        edges = directed(step.cells)
        if enclosed_area(points, edges) < 0:
            edges = edges[::-1][:, [1, 0, 2]]
        nodes = edges[:, [0, 2]].ravel()
        along = _tangents(points, edges)
        normals = -quarter_turned(along)
        return cls(points[nodes], normals, step.fields["traction"][nodes, :2])

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


def _tangents(points: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """(2 n, 2) unit tangents at the start and middle of each edge; between two edges their mean."""
    start, end, middle = (points[edges[:, i]] for i in range(3))
    leaving, arriving = 4 * middle - 3 * start - end, 3 * end + start - 4 * middle
    leaving, arriving = (t / np.linalg.norm(t, axis=1)[:, None] for t in (leaving, arriving))
    tangents = np.stack([leaving + np.roll(arriving, 1, axis=0), end - start], axis=1).reshape(-1, 2)
    return tangents / np.linalg.norm(tangents, axis=1)[:, None]
