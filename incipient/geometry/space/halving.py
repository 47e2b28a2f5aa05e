"""The half of a triangulated surface on one side of a plane."""

import numpy as np

from incipient.arrays import Floats
from incipient.geometry.space.surfaces import Surface

NEAR = 0.2  # of the length of its sides: a vertex so near the plane is moved onto it


def halved(surface: Surface) -> Surface:
    """The part of a surface with y >= 0, cut in the plane y = 0, on which the new edge's vertices lie exactly."""
    points = surface.points.copy()
    sides = np.linalg.norm(points[surface.edges[:, 0]] - points[surface.edges[:, 1]], axis=1)
    shortest = np.full(len(points), np.inf)
    for end in (0, 1):
        np.minimum.at(shortest, surface.edges[:, end], sides)
    points[np.abs(points[:, 1]) < NEAR * shortest, 1] = 0.0
    sign = np.sign(points[:, 1])[surface.triangles]
    kept = surface.triangles[(sign >= 0).all(axis=1) & (sign > 0).any(axis=1)]
    crossed = surface.triangles[(sign > 0).any(axis=1) & (sign < 0).any(axis=1)]
    cut, places = _cut(points, crossed)
    points = np.vstack([points, places])
    triangles = np.vstack([kept, cut])
    used, number = np.unique(triangles, return_inverse=True)
    return Surface(points[used], number.reshape(-1, 3))


def _cut(points: Floats, triangles: np.ndarray) -> tuple[np.ndarray, Floats]:
    """The parts with y >= 0 of triangles (m, 3) that cross the plane, and the points (k, 3) added for them."""
    added: dict[tuple[int, int], int] = {}
    places: list[Floats] = []
    found: list[tuple[int, int, int]] = []
    for triangle in triangles.tolist():
        corners: list[int] = []
        for a, b in zip(triangle, triangle[1:] + triangle[:1], strict=True):
            if points[a, 1] >= 0.0:
                corners.append(a)
            if points[a, 1] * points[b, 1] < 0.0:
                key = (min(a, b), max(a, b))
                if key not in added:
                    added[key] = len(points) + len(places)
                    share = points[key[0], 1] / (points[key[0], 1] - points[key[1], 1])
                    place = (1.0 - share) * points[key[0]] + share * points[key[1]]
                    places.append(place * [1.0, 0.0, 1.0])
                corners.append(added[key])
        found += [(corners[0], corners[k], corners[k + 1]) for k in range(1, len(corners) - 1)]
    return np.array(found, dtype=int).reshape(-1, 3), np.array(places).reshape(-1, 3)
