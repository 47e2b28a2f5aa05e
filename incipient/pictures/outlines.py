"""Outlines of grains and beds, and a sketch of a grain with known contacts only."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from ..geometry.placement import Placement
from ..geometry.space.surfaces import sphere
from .judged import Judged

_PIECES = 48  # straight pieces a curve is shown with
_SPACING = 0.04  # of the triangles of a grain's surface, in grain sizes
_FINE = 40  # parts of the sides of the icosahedron that a sphere is drawn with
_ROUND = 1e-3  # of the longest arm: contacts of a disc or a sphere, rounded by hand
Outline = np.ndarray  # points (n, 2) around a grain
Solid = tuple[np.ndarray, np.ndarray]  # points (n, 3) and triangles (m, 3) of a grain's surface


def grain_outline(grain: Any, placement: Any) -> Outline:
    """Counter-clockwise points (n, 2) around a placed 2-D grain."""
    return np.vstack([_along(curve.moved(placement))[:-1] for curve in grain.outline()])


def hull(points: np.ndarray) -> Outline:
    """Convex hull of points (n, 2), in order; all of collinear ones."""
    try:
        return points[ConvexHull(points).vertices]
    except QhullError:
        return points


def seen_from_the_side(grain: Any, placement: Placement) -> tuple[Outline, np.ndarray]:
    """Outline (n, 2) of a placed grain along x and upwards, and a line (2, 2) along its first axis to its surface."""
    if placement.gdim == 2:
        points = grain_outline(grain, placement)
        local = placement.to_body(points)
        tip = points[np.argmin(np.abs(np.arctan2(local[:, 1], local[:, 0])))]
        return points, np.array([placement.centre, tip])
    points, _ = placed_surface(grain, placement)
    arm = placement.to_body(points)[:, 0].max()
    ends = placement.to_scene([[0.0, 0.0, 0.0], [arm, 0.0, 0.0]])
    return hull(points[:, [0, 2]]), ends[:, [0, 2]]


def bed_line(bed: Any, x0: float, x1: float) -> np.ndarray:
    """Points (n, 2) along a 2-D bed from left to right, as far as it is known."""
    low, high = bed.extent
    curves: Iterable[Any] = bed.curves(max(x0, low), min(x1, high))
    return np.vstack([_along(curve) for curve in curves])


def placed_surface(grain: Any, placement: Any, spacing: float = _SPACING) -> Solid:
    """Surface of a placed grain: points (n, 3) and triangles (m, 3); `spacing` in grain sizes."""
    surface = grain.surface(spacing * grain.size)
    return placement.to_scene(surface.points), surface.triangles


def sketched(case: Judged) -> Solid:
    """A surface through the contacts: a sphere if it fits, otherwise a convex polyhedron; in 2-D points alone."""
    radius, centre = round_radius(case), case.load.centre
    if radius is not None:
        ball = sphere(_FINE)
        return centre + radius * ball.points, ball.triangles
    arms = case.contacts.points - centre
    points = np.vstack([centre + arms, centre - arms])
    try:
        return points, ConvexHull(points).simplices
    except QhullError:
        return points, np.empty((0, 3), dtype=int)


def round_radius(case: Judged) -> float | None:
    """Radius of a disc or sphere with these contacts: equal arms along the normals; None if they do not fit."""
    arms = case.contacts.points - case.load.centre
    lengths = np.linalg.norm(arms, axis=1)
    longest = float(lengths.max())
    aligned = np.abs(arms - lengths[:, None] * case.contacts.normals).max() <= _ROUND * longest
    return longest if aligned and np.ptp(lengths) <= _ROUND * longest else None


def _along(curve: Any) -> np.ndarray:
    return np.asarray(curve.point(np.linspace(0.0, 1.0, _PIECES + 1)))
