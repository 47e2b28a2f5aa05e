"""Faults of scanned surfaces that can be put right without guessing: points twice, triangles twice, mixed senses."""

from __future__ import annotations

import numpy as np

from incipient.errors import SceneError
from incipient.geometry.space.crossings import crossed
from incipient.geometry.space.surfaces import Indices, Surface, connected, merged, sides

DIGITS = 2e-7  # of the extent: files of 32-bit numbers write the same point differently


def repaired(surface: Surface) -> Surface:
    """The surface with points that agree taken as one, each triangle once, and all triangles in one sense."""
    extent = float(np.ptp(surface.points, axis=0).max())
    surface = merged(surface.points, surface.triangles, DIGITS * max(extent, 1e-300))
    _, once = np.unique(np.sort(surface.triangles, axis=1), axis=0, return_index=True)
    return Surface(surface.points, _in_one_sense(surface.triangles[np.sort(once)]))


def require_plain(surface: Surface, name: str) -> None:
    """Refuse a surface that runs through itself.

    Raises:
        SceneError: it does; with the number of triangles.
    """
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
    links = np.stack([[first, second + count * against], [first + count, second + count * ~against]])
    sense = connected(2 * count, np.concatenate(links, axis=1).T)
    turned = sense[:count] != sense[starts]
    return np.where(turned[:, None], triangles[:, ::-1], triangles)
