"""Surfaces that run through themselves: which triangles are crossed by edges of others."""

from __future__ import annotations

import numpy as np

from incipient.arrays import Floats
from incipient.geometry.space.nearest import Triangles
from incipient.geometry.space.surfaces import Surface

# Of an edge's length, and of a triangle's barycentric coordinates: what only touches does not cross.
BESIDE = 1e-9


def crossed(surface: Surface) -> np.ndarray:
    """The triangles (k,) that edges of triangles elsewhere, with which they share no point, run through."""
    edges, corners = surface.edges, surface.corners
    ends = surface.points[edges]
    half = 0.5 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    # Triangles of like size are looked for together: a large one would make the search for small ones wide.
    kind = np.round(np.log2(np.maximum(longest, 1e-300))).astype(int)
    found = [np.empty(0, dtype=int)]
    for one in np.unique(kind):
        mine = np.flatnonzero(kind == one)
        row, triangle = Triangles(corners[mine]).near(ends.mean(axis=1), half)
        triangle = mine[triangle]
        apart = (edges[row][:, :, None] != surface.triangles[triangle][:, None]).all(axis=(1, 2))
        row, triangle = row[apart], triangle[apart]
        found.append(triangle[_runs_through(ends[row], corners[triangle])])
    return np.unique(np.concatenate(found))


def _runs_through(ends: Floats, corners: Floats) -> np.ndarray:
    """Which segments (n, 2 ends, 3) run through the triangles (n, 3 corners, 3) (Moeller, Trumbore 1997)."""
    along = ends[:, 1] - ends[:, 0]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    across = np.cross(along, second)
    determinant = (first * across).sum(axis=1)
    scale = np.linalg.norm(along, axis=1) * np.linalg.norm(np.cross(first, second), axis=1)
    proper = np.abs(determinant) > BESIDE * scale
    inverse = 1.0 / np.where(proper, determinant, 1.0)
    away = ends[:, 0] - corners[:, 0]
    turned = np.cross(away, first)
    u, v = inverse * (away * across).sum(axis=1), inverse * (along * turned).sum(axis=1)
    t = inverse * (second * turned).sum(axis=1)
    inside = (np.minimum(u, v) > BESIDE) & (u + v < 1.0 - BESIDE) & (t > BESIDE) & (t < 1.0 - BESIDE)
    return np.asarray(proper & inside)
