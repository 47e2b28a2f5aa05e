"""Faults of scanned surfaces: points twice, triangles twice and mixed senses are put right, crossings are found."""

import numpy as np

from incipient.arrays import Floats
from incipient.errors import SceneError
from incipient.geometry.space.nearest import Triangles
from incipient.geometry.space.surfaces import Indices, Surface, connected, merged, sides

DIGITS = 2e-7  # of the extent: files of 32-bit numbers write the same point differently
# Part of an edge's length, and of barycentric coordinates in a triangle: what only touches does not cross.
BESIDE = 1e-9


def repaired(surface: Surface) -> Surface:
    """The surface with points that agree taken as one, each triangle once, and all triangles in one sense."""
    extent = float(np.ptp(surface.points, axis=0).max())
    surface = merged(surface.points, surface.triangles, DIGITS * max(extent, 1e-300))
    _, once = np.unique(np.sort(surface.triangles, axis=1), axis=0, return_index=True)
    return Surface(surface.points, _in_one_sense(surface.triangles[np.sort(once)]))


def require_plain(surface: Surface, name: str) -> None:
    """Refuse a surface that runs through itself. Raises SceneError with the number of triangles."""
    count = len(crossed(surface))
    if count:
        raise SceneError(f"{name} runs through itself in {count} triangles; remesh it")


def _in_one_sense(triangles: Indices) -> Indices:
    """The triangles turned so that neighbours have the sense of the first of their part."""
    directed = sides(triangles)
    _, edge = np.unique(np.sort(directed, axis=1), axis=0, return_inverse=True)
    forward = directed[:, 0] < directed[:, 1]
    order = np.argsort(edge.ravel(), kind="stable")
    paired = np.flatnonzero(np.diff(edge.ravel()[order]) == 0)
    a, b = order[paired], order[paired + 1]
    # Neighbours in one sense go along their common side in opposite directions.
    against, count = forward[a] == forward[b], len(triangles)
    first, second = a % count, b % count
    part = connected(count, np.column_stack([first, second]))
    starts = np.unique(part, return_index=True)[1][part]
    # Number k is triangle k as given, k + count the same turned; those of one sense are linked.
    links = np.stack(
        [[first, second + count * against], [first + count, second + count * ~against]]
    )
    sense = connected(2 * count, np.concatenate(links, axis=1).T)
    turned = sense[:count] != sense[starts]
    return np.where(turned[:, None], triangles[:, ::-1], triangles)


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
    inside = (
        (np.minimum(u, v) > BESIDE) & (u + v < 1.0 - BESIDE) & (t > BESIDE) & (t < 1.0 - BESIDE)
    )
    return np.asarray(proper & inside)
