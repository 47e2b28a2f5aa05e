"""Grains and curves of the plane: Green's theorem, elementary geometry, and every grain by the same questions."""

import pickle
from itertools import pairwise

import every_shape
import numpy as np
import pytest

from incipient.errors import SceneError
from incipient.geometry import (
    Arc,
    Discs,
    Ellipse,
    Line,
    Placement,
    Polygon,
    Rectangle,
    Spline,
    Star,
    Superellipse,
)

GRAINS = {
    **every_shape.GRAINS,
    "superellipse": Superellipse((0.7, 0.3), 4.0),
    "rounder superellipse": Superellipse((0.5, 0.5), 2.5),
    "star": Star(0.5, (0.1, 0.2, 0.05), (0.0, 0.1)),
    "turned star": Star(0.5, (0.0, 0.0, 0.2 * np.cos(1.0)), (0.0, 0.0, -0.2 * np.sin(1.0))),
    "discs": Discs([(0, 0), (0.7, 0.2), (-0.3, 0.6)], [0.5, 0.3, 0.4]),
}
HEXAGON = [(np.cos(k * np.pi / 3), np.sin(k * np.pi / 3)) for k in range(6)]
S = np.linspace(0.0, 1.0, 401)
grains = pytest.mark.parametrize("grain", GRAINS.values(), ids=GRAINS.keys())
CURVES = (
    Line((0.0, 1.0), (2.0, -1.0)),
    Arc((1.0, 0.0), (0.0, 0.0), (0.0, 1.0)),
    Arc((0.0, 1.0), (0.0, 0.0), (1.0, 0.0)),
    Arc((2.0, 0.0), (0.0, 0.0), (0.0, 1.0), (2.0, 0.0)),
    Arc((1.0, 0.0), (0.0, 0.0), (0.0, -3.0), (0.0, -3.0)),
    Spline(np.column_stack([S, np.sin(S)])),
    Superellipse((0.5, 0.3), 5.0).outline()[1],
    Star(0.5, (0.0, 0.1)).outline()[2],
)


@pytest.mark.parametrize("curve", CURVES, ids=lambda curve: type(curve).__name__)
def test_curves_have_ends_and_tangents_and_move_with_their_points(curve):
    """Also as another rank gets them, by pickling; tangents by differences."""
    assert curve.point([0.0, 1.0]) == pytest.approx(np.array([curve.start, curve.end]), abs=1e-14)
    inner, h = S[1:-1] + 1e-4, 1e-6
    chord = curve.point(inner + h) - curve.point(inner - h)
    chord /= np.linalg.norm(chord, axis=1, keepdims=True)
    assert curve.tangent(inner) == pytest.approx(chord, abs=1e-7)
    first, second = Placement((0.3, -2.0), 0.7), Placement((-0.5, 0.1), 0.4)
    moved = pickle.loads(pickle.dumps(curve.moved(first).moved(second)))
    there = second.to_scene(first.to_scene(curve.point(S)))
    assert moved.point(S) == pytest.approx(there, abs=1e-14)
    turned = Placement((0.0, 0.0), 1.1).to_scene(curve.tangent(S))
    # Splines have slopes by differences of points 1/4096 apart: round-off times 4096, at their ends a few times.
    assert moved.tangent(S) == pytest.approx(turned, abs=1e-11)


def test_arcs_go_the_short_way_round_and_keep_their_ellipse():
    middle = Arc((1.0, 0.0), (0.0, 0.0), (0.0, -1.0)).point([0.5])
    assert middle == pytest.approx(np.array([[np.sqrt(0.5), -np.sqrt(0.5)]]))
    a, b, angle = 2.0, 0.5, np.array([0.3, 1.1])
    start, end = np.column_stack([a * np.cos(angle), b * np.sin(angle)])
    x, y = Arc(tuple(start), (0.0, 0.0), tuple(end), (a, 0.0)).point(S).T
    assert (x / a) ** 2 + (y / b) ** 2 == pytest.approx(np.ones(len(S)), abs=1e-13)


@grains
def test_area_centroid_and_polar_moment(grain):
    """Green's theorem along the exact outline, which is closed, Gauss rule on parts of each curve."""
    nodes, weights = np.polynomial.legendre.leggauss(20)
    total, h, outline = np.zeros(4), 1e-5, grain.outline()
    for curve, following in zip(outline, (*outline[1:], outline[0]), strict=True):
        assert curve.end == pytest.approx(following.start, abs=1e-14)
        s = ((np.arange(16)[:, None] + 0.5 * (nodes + 1.0)) / 16.0).ravel()
        x, y = curve.point(s).T
        rates = (curve.point(s + h) - curve.point(s - h)) / (2.0 * h)
        dx, dy = rates.T * np.tile(weights, 16) / 32.0
        total[:3] += (x * dy - y * dx).sum() / 2, (x * x * dy).sum() / 2, -(y * y * dx).sum() / 2
        total[3] += ((x**3 * dy - y**3 * dx) / 3.0).sum()
    assert total == pytest.approx([grain.volume, 0.0, 0.0, grain.inertia[2, 2]], abs=1e-8)


@grains
def test_level_normal_and_size(grain):
    """Zero on the outline and a distance across it; the size is the largest distance of two points."""
    s = np.linspace(0.0, 1.0, 101)
    points = np.vstack([curve.point(s) for curve in grain.outline()])
    assert grain.level(points) == pytest.approx(0.0, abs=1e-14)
    apart = np.linalg.norm(points[:, None] - points, axis=2).max()
    assert apart <= grain.size * (1.0 + 1e-12)
    assert apart == pytest.approx(grain.size, rel=1e-3)
    for curve in grain.outline():
        inner, tangents = curve.point(s[1:-1]), curve.tangent(s[1:-1])
        outward = np.column_stack([tangents[:, 1], -tangents[:, 0]])
        assert grain.normal(inner) == pytest.approx(outward, abs=1e-9)
        for step in (1e-3, -1e-3):
            assert grain.level(inner + step * outward) == pytest.approx(step, abs=1e-12)


def test_distances_from_boxes_and_polygons_and_the_bisector_at_corners():
    square, corner = Polygon([(0, 0), (1, 0), (1, 1), (0, 1)]), [[0.5, -0.5]]
    bisector = np.array([[np.sqrt(0.5), -np.sqrt(0.5)]])
    assert Rectangle(1.0, 1.0).normal(corner) == pytest.approx(bisector)
    assert square.normal(corner) == pytest.approx(bisector)
    assert Rectangle(2.0, 1.0, 0.2).level([[2.0, 0.0], [0.0, 0.0]]) == pytest.approx([1.0, -0.5])
    assert square.level([[3.5, 4.5], [0.0, 0.1]]) == pytest.approx([5.0, -0.4])
    arrow = GRAINS["clockwise arrow"]  # inside, nearest to the corner that points inwards
    (notch,) = [x for x in arrow.vertices if np.hypot(*x) < 0.6]
    assert arrow.level([np.add(notch, [0.1, 0.0])]) == pytest.approx(-0.1)


def test_ellipses_and_discs_as_special_cases():
    """Two unit discs a distance 1 apart: each loses a segment of 2 pi/3, of area (2 pi/3 - sin(2 pi/3))/2."""
    grain, ellipse = Superellipse((0.7, 0.3), 2.0), Ellipse((0.7, 0.3))
    assert grain.size == ellipse.size
    assert grain.volume == pytest.approx(ellipse.volume)
    assert grain.inertia == pytest.approx(ellipse.inertia)
    single, double = Discs([(3.0, 1.0)], [0.5]), Discs([(0, 0), (1, 0)], [1, 1])
    assert (single.volume, single.inertia[2, 2]) == pytest.approx((np.pi / 4.0, np.pi / 32.0))
    segment = 0.5 * (2.0 * np.pi / 3.0 - np.sin(2.0 * np.pi / 3.0))
    assert double.volume == pytest.approx(2.0 * np.pi - 2.0 * segment)
    starts = np.array([curve.start for curve in double.outline()])
    for corner in ((0.0, np.sqrt(0.75)), (0.0, -np.sqrt(0.75))):
        assert np.linalg.norm(starts - corner, axis=1).min() < 1e-12


@pytest.mark.parametrize("name", ["superellipse", "rounder superellipse", "star", "turned star"])
def test_splines_for_meshes_keep_to_the_outline(name):
    """Where a mesh generator draws a cubic through the given points it errs by less than 1e-6 of the size."""
    grain = GRAINS[name]
    for curve in grain.drawn():
        assert (
            np.abs(grain.level(curve.point(np.linspace(0.0, 1.0, 4001)))).max() < 1e-6 * grain.size
        )


@pytest.mark.parametrize("exponent", [6.0, 12.5, 20.0])
def test_blunt_corners_are_drawn_in_pieces_on_the_outline(exponent):
    grain = Superellipse((0.5, 0.3), exponent)
    pieces = grain.drawn()
    assert len(pieces) > 12
    for piece, following in pairwise((*pieces, pieces[0])):
        assert piece.end == pytest.approx(following.start, abs=1e-12)
        assert np.abs(grain.level(piece.point(np.linspace(0.0, 1.0, 500)))).max() < 1e-6
        first, last = piece.tangent([0.0, 1.0])
        assert np.arccos(np.clip(first @ last, -1.0, 1.0)) < np.radians(30.0)


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda: Polygon([(0, 0), (1, 0), (2, 0)]), "no area"),
        (lambda: Polygon([(0, 0), (1, 0), (1, 0), (0, 1)]), "twice"),
        (lambda: Polygon([(0, 0), (1, 1), (1, 0), (0, 1.5)]), "vertices 0 and 2 meet"),
        (lambda: Superellipse((1.0, 1.0), 1.9), "exponent 1.9"),
        (lambda: Superellipse((0.5, 0.3), 50.0), r"exponent 50 .* too sharp .* use a rectangle"),
        (lambda: Star(1.0, (2.0,)), "-1 at 180 degrees"),
        (lambda: Discs([(0, 0), (3, 0)], [1, 1]), "number 1 .* does not overlap"),
        (lambda: Discs([(0, 0), (0.1, 0)], [1, 0.5]), "disc 1 .* lies within"),
        (lambda: Discs(HEXAGON, [0.55] * 6), "hole"),
    ],
)
def test_bad_grains_are_refused(make, reason):
    with pytest.raises(SceneError, match=reason) as caught:
        make()
    assert "\n" not in str(caught.value)
