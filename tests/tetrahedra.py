"""Regions in space for tests, and what can be measured of their meshes."""

from __future__ import annotations

from typing import Any

import numpy as np

from incipient.geometry import Plane
from incipient.geometry.closest import clearance, lifted, rest
from incipient.geometry.space.beds import Terrain
from incipient.geometry.space.grains import Solid
from incipient.meshes import Near, PlacedSolid, Resolved, Sizes, SolidRegion
from incipient.meshes.simplices import EDGES, Simplices

KEAST = np.array([[0.25] * 4] + [[0.5 if i == j else 1 / 6 for j in range(4)] for i in range(4)])
KEAST_WEIGHTS = np.array([-0.8, 0.45, 0.45, 0.45, 0.45])  # exact for cubics (Keast 1986)


def grain_above(
    solid: Solid, bed: Terrain | None = None, gap: float = 0.02, half: float = 2.0, **options: Any
) -> tuple[SolidRegion, np.ndarray]:
    """A grain lowered onto a bed and lifted by a gap in a box, and the point of the grain where the gap is."""
    bed = bed or Plane()
    placement = lifted(solid, rest(solid, bed, (0.0, 0.0)), bed, gap)
    _, point, _ = clearance(solid, placement, bed)
    options = {"resolved": Resolved((0.0, 0.0), 1.0, 0.5)} | options
    sides: tuple[float, float] = (-half, half)
    return SolidRegion(
        sides, sides, 2.0 * half, bed, {"body": PlacedSolid(solid, placement)}, **options
    ), point


def finer_in_the_gap(size: float, gap: float, point: np.ndarray) -> Sizes:
    """Cells of a size at the grain, of half the gap where it is least."""
    x, y, z = point.tolist()
    narrow = Near(0.5 * gap, 0.18, points=((x, y, z),), needed=True)
    return Sizes(1.0, (Near(size, 0.3, boundary="body"), narrow), gap_part=0.8)


def cells(mesh: Simplices) -> np.ndarray:
    """The nodes of all tetrahedra, (m, 4 or 10, 3)."""
    return mesh.points[mesh.cells]


def faces(mesh: Simplices, name: str) -> np.ndarray:
    """The nodes of the triangles of a named surface, (m, 3 or 6, 3)."""
    return mesh.points[mesh.sides[name]]


def stretches(nodes: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Determinants (m, points) of the maps of tetrahedra at barycentric coordinates."""
    corners = nodes[:, 1:4] - nodes[:, :1]
    if nodes.shape[1] == 4:
        return np.tile(np.linalg.det(corners)[:, None], (1, len(points)))
    by = np.zeros((len(points), 10, 4))
    for i in range(4):
        by[:, i, i] = 4.0 * points[:, i] - 1.0
    for k, (a, b) in enumerate(EDGES[3]):
        by[:, 4 + k, a], by[:, 4 + k, b] = 4.0 * points[:, b], 4.0 * points[:, a]
    return np.linalg.det(np.einsum("pke,mkd->mpde", by[..., 1:] - by[..., :1], nodes))


def volume(mesh: Simplices) -> float:
    return float((stretches(cells(mesh), KEAST) @ KEAST_WEIGHTS).sum() / 6.0)


def area(triangles: np.ndarray) -> float:
    """The area of triangles of order one or two, by a rule with an error far below that of the shape."""
    if triangles.shape[1] == 3:
        a, b, c = triangles.transpose(1, 0, 2)
        return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    nodes, weights = np.polynomial.legendre.leggauss(4)
    total = 0.0
    for u, wu in zip(0.5 + 0.5 * nodes, 0.5 * weights, strict=True):
        for v, wv in zip(0.5 + 0.5 * nodes, 0.5 * weights, strict=True):
            at = np.array([1.0 - u, u * (1.0 - v), u * v])
            by = np.zeros((6, 3))
            for i in range(3):
                by[i, i] = 4.0 * at[i] - 1.0
            for k, (i, j) in enumerate(EDGES[2]):
                by[3 + k, i], by[3 + k, j] = 4.0 * at[j], 4.0 * at[i]
            along = np.einsum("ke,mkd->med", by[:, 1:] - by[:, :1], triangles)
            total += (
                u
                * wu
                * wv
                * float(np.linalg.norm(np.cross(along[:, 0], along[:, 1]), axis=1).sum())
            )
    return total


def roundness(nodes: np.ndarray) -> np.ndarray:
    """Three times the ratio of inscribed to circumscribed radius (m,): 1 for regular tetrahedra."""
    a, b, c, d = nodes[:, :4].transpose(1, 0, 2)
    six = np.abs(np.linalg.det(np.stack([b - a, c - a, d - a], axis=1)))

    def length(p: np.ndarray, q: np.ndarray) -> np.ndarray:
        return np.linalg.norm(p - q, axis=1)

    def twice(p: np.ndarray, q: np.ndarray, r: np.ndarray) -> np.ndarray:
        return np.linalg.norm(np.cross(q - p, r - p), axis=1)

    surface = 0.5 * (twice(a, b, c) + twice(a, b, d) + twice(a, c, d) + twice(b, c, d))
    p, q, r = (
        length(*s) * length(*t) for s, t in (((a, b), (c, d)), ((a, c), (b, d)), ((a, d), (b, c)))
    )
    circumscribed = np.sqrt(
        np.maximum((p + q + r) * (p + q - r) * (p - q + r) * (q + r - p), 0.0)
    ) / (4.0 * six)
    return 1.5 * six / surface / circumscribed
