"""Outlines of grains and beds from their curves, and a sketch of a grain of which only contacts are known."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from ..geometry.space.surfaces import sphere
from .judged import Judged

_PIECES = 48  # straight pieces a curve is shown with
SPACING = 0.04  # of the triangles of a grain's surface, in grain sizes
_FINE = 40  # parts of the sides of the icosahedron that a sphere is drawn with
_SHADOW = (
    0.05  # of a grain's size: distance of the points of its surface that its silhouette is made of
)
_ROUND = 1e-3  # of the longest arm: contacts of a disc or a sphere, rounded by hand
Outline = np.ndarray  # points (n, 2) around a grain
Solid = tuple[np.ndarray, np.ndarray]  # points (n, 3) and triangles (m, 3) of a grain's surface


def grain_outline(grain: Any, placement: Any) -> Outline:
    """Points (n, 2) around a plane grain at its place, counter-clockwise."""
    return np.vstack([_along(curve.moved(placement))[:-1] for curve in grain.outline()])


def grain_silhouette(grain: Any, placement: Any) -> Outline:
    """Points (n, 2) around a 3-D grain at its place as seen from the side: the convex hull of its shadow."""
    return hull(placement.to_scene(grain.surface(_SHADOW * grain.size).points)[:, [0, 2]])


def hull(points: np.ndarray) -> Outline:
    """The convex hull of points (n, 2), in order; all of them where they are on a line."""
    try:
        return points[ConvexHull(points).vertices]
    except QhullError:
        return points


def spoke(outline: Outline, placement: Any) -> np.ndarray:
    """(2, 2) from a plane grain's centre along its first axis to its outline, points (n, 2)."""
    local = placement.to_body(outline)
    tip = outline[np.argmin(np.abs(np.arctan2(local[:, 1], local[:, 0])))]
    return np.array([placement.centre, tip])


def bed_line(bed: Any, x0: float, x1: float) -> np.ndarray:
    """Points (n, 2) along a plane bed from left to right, as far as it is known."""
    low, high = bed.extent
    curves: Iterable[Any] = bed.curves(max(x0, low), min(x1, high))
    return np.vstack([_along(curve) for curve in curves])


def placed_surface(grain: Any, placement: Any) -> Solid:
    """A grain's surface at its place: points (n, 3) and triangles (m, 3)."""
    surface = grain.surface(SPACING * grain.size)
    return placement.to_scene(surface.points), surface.triangles


def sketched_outline(case: Judged) -> Outline:
    """A plane outline (n, 2) through the contacts: a circle if they could be a disc's, otherwise a polygon.

    The polygon is the convex hull of the contacts and their mirror images in the centre of mass.
    """
    radius = round_radius(case)
    centre = case.load.centre[:2]
    if radius is not None:
        angles = np.linspace(0.0, 2.0 * np.pi, 181)[:-1]
        return centre + radius * np.column_stack([np.cos(angles), np.sin(angles)])
    return hull(mirrored(case)[:, :2])


def sketched_solid(case: Judged) -> Solid:
    """A surface through the contacts: a sphere if they could be a sphere's, otherwise a polyhedron.

    The polyhedron is the convex hull of the contacts and their mirror images in the centre of mass; where it
    has no volume there are only its points, without triangles.
    """
    radius = round_radius(case)
    if radius is not None:
        ball = sphere(_FINE)
        return case.load.centre + radius * ball.points, ball.triangles
    points = mirrored(case)
    try:
        return points, ConvexHull(points).simplices
    except QhullError:
        return points, np.empty((0, 3), dtype=int)


def round_radius(case: Judged) -> float | None:
    """The radius of a disc or sphere with these contacts: equal arms along the normals; None if they do not fit."""
    lengths = np.linalg.norm(case.arms, axis=1)
    longest = float(lengths.max())
    aligned = np.abs(case.arms - lengths[:, None] * case.contacts.normals).max() <= _ROUND * longest
    return longest if aligned and np.ptp(lengths) <= _ROUND * longest else None


def mirrored(case: Judged) -> np.ndarray:
    """The contacts and their mirror images in the centre of mass, (2 n, 3)."""
    return np.vstack([case.load.centre + case.arms, case.load.centre - case.arms])


def _along(curve: Any) -> np.ndarray:
    return np.asarray(curve.point(np.linspace(0.0, 1.0, _PIECES + 1)))
