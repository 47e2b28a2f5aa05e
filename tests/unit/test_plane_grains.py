"""Grains in the plane with smooth outlines and unions of discs: Green's theorem and closed formulae."""

import pickle

import numpy as np
import pytest

from incipient.errors import SceneError
from incipient.geometry import (
    Discs,
    Ellipse,
    Placement,
    Polygon,
    Rectangle,
    Star,
    Superellipse,
)

HEXAGON = [(np.cos(k * np.pi / 3), np.sin(k * np.pi / 3)) for k in range(6)]


class TestPlaneGrains:
    GRAINS = (
        Superellipse((0.7, 0.3), 4.0),
        Superellipse((0.5, 0.5), 2.5),
        Star(0.5, (0.1, 0.2, 0.05), (0.0, 0.1)),
        Star(0.5, (0.0, 0.0, 0.2 * np.cos(1.0)), (0.0, 0.0, -0.2 * np.sin(1.0))),
        Discs([(0, 0), (0.7, 0.2), (-0.3, 0.6)], [0.5, 0.3, 0.4]),
        Rectangle(1.0, 0.6, 0.1),
        Polygon([(0, 0), (2, 0.5), (1.5, 1.5), (-0.2, 1.0)]),
        Ellipse((0.7, 0.3)),
    )

    @pytest.mark.parametrize("grain", GRAINS, ids=lambda grain: type(grain).__name__)
    def test_outline_area_centroid_and_polar_moment(self, grain):
        """Green's theorem along the exact outline, Gauss rule on parts of each curve."""
        nodes, weights = np.polynomial.legendre.leggauss(20)
        total, h = np.zeros(4), 1e-5
        outline = grain.outline()
        for curve, following in zip(outline, (*outline[1:], outline[0]), strict=True):
            assert curve.end == pytest.approx(following.start, abs=1e-14)
            for part in range(16):
                s = (part + 0.5 * (nodes + 1.0)) / 16.0
                x, y = curve.point(s).T
                dx, dy = ((curve.point(s + h) - curve.point(s - h)) / (2.0 * h)).T * weights / 32.0
                total += [
                    (0.5 * (x * dy - y * dx)).sum(),
                    (0.5 * x * x * dy).sum(),
                    (-0.5 * y * y * dx).sum(),
                    ((x**3 * dy - y**3 * dx) / 3.0).sum(),
                ]
        assert total == pytest.approx([grain.volume, 0.0, 0.0, grain.inertia[2, 2]], abs=1e-8)
        assert grain.inertia == pytest.approx(np.diag([0.0, 0.0, grain.polar_moment]))

    @pytest.mark.parametrize("grain", GRAINS[:5], ids=lambda grain: type(grain).__name__)
    def test_outline_level_normal_and_size(self, grain):
        s = np.linspace(0.0, 1.0, 101)
        points = np.vstack([curve.point(s) for curve in grain.outline()])
        assert grain.level(points) == pytest.approx(0.0, abs=1e-14)
        apart = np.linalg.norm(points[:, None] - points, axis=2).max()
        assert apart <= grain.size * (1.0 + 1e-12)
        assert apart == pytest.approx(grain.size, rel=1e-3)
        for curve in grain.outline():
            tangents = curve.tangent(s[1:-1])
            outward = np.column_stack([tangents[:, 1], -tangents[:, 0]])
            assert grain.normal(curve.point(s[1:-1])) == pytest.approx(outward, abs=1e-9)

    @pytest.mark.parametrize("grain", GRAINS[:4], ids=lambda grain: type(grain).__name__)
    def test_splines_for_meshes_keep_to_the_outline(self, grain):
        """Where a mesh generator draws a cubic through the given points it errs by less than 1e-6 of the size."""
        from incipient.geometry import Spline

        for curve in grain.outline():
            points = Spline(curve.points).point(np.linspace(0.0, 1.0, 4001))
            assert np.abs(grain.level(points)).max() < 1e-6 * grain.size

    def test_superellipse_of_exponent_two_is_the_ellipse(self):
        grain, ellipse = Superellipse((0.7, 0.3), 2.0), Ellipse((0.7, 0.3))
        assert (grain.volume, grain.polar_moment) == pytest.approx(
            (ellipse.volume, ellipse.polar_moment)
        )
        assert grain.size == ellipse.size

    def test_one_disc_and_two_discs(self):
        one = Discs([(3.0, 1.0)], [0.5])
        assert (one.volume, one.polar_moment) == pytest.approx((np.pi / 4.0, np.pi / 32.0))
        # Two unit discs a distance 1 apart: each is cut by a segment of 2 pi/3, of area (2 pi/3 - sin(2 pi/3))/2.
        segment = 0.5 * (2.0 * np.pi / 3.0 - np.sin(2.0 * np.pi / 3.0))
        assert Discs([(0, 0), (1, 0)], [1, 1]).volume == pytest.approx(2.0 * np.pi - 2.0 * segment)

    def test_corners_of_a_union_are_exact(self):
        # The circles of radius 1 about (-1/2, 0) and (1/2, 0) meet in (0, +-sqrt(3)/2).
        starts = [curve.start for curve in Discs([(0, 0), (1, 0)], [1, 1]).outline()]
        for corner in ((0.0, np.sqrt(0.75)), (0.0, -np.sqrt(0.75))):
            assert min(np.hypot(x - corner[0], y - corner[1]) for x, y in starts) < 1e-15

    @pytest.mark.parametrize(
        ("make", "reason"),
        [
            (lambda: Superellipse((1.0, 1.0), 1.9), "exponent 1.9"),
            (lambda: Superellipse((1.0, 0.0), 3.0), "semi-axis"),
            (lambda: Star(1.0, (2.0,)), "-1 at 180 degrees"),
            (lambda: Discs([(0, 0), (3, 0)], [1, 1]), "number 1 .* does not overlap"),
            (lambda: Discs([(0, 0), (0.1, 0)], [1, 0.5]), "disc 1 .* lies within"),
            (lambda: Discs([(0, 0)], [1, 2]), "one radius"),
            (lambda: Discs([(0, 0)], [-1]), "positive"),
            (lambda: Discs(HEXAGON, [0.55] * 6), "hole"),
        ],
    )
    def test_bad_grains_are_refused(self, make, reason):
        with pytest.raises(SceneError, match=reason) as caught:
            make()
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "grain",
    [Superellipse((0.5, 0.3), 5.0), Star(0.5, (0.0, 0.1))],
    ids=["n = 5", "star"],
)
def test_smooth_grains_can_be_sent_to_other_ranks(grain):
    """Ranks exchange curves by pickling; their points and tangents stay what they are, also where they were moved."""
    s = np.linspace(0.0, 1.0, 7)
    for curve in grain.outline():
        moved = curve.moved(Placement((1.0, 2.0), 0.3)).moved(Placement((-0.5, 0.1), 0.4))
        other = pickle.loads(pickle.dumps(moved))
        assert (other.point(s) == moved.point(s)).all()
        turned = Placement((0.0, 0.0), 0.7)
        assert other.tangent(s) == pytest.approx(turned.to_scene(curve.tangent(s)), abs=1e-14)
        assert other.start == pytest.approx(other.point([0.0])[0], abs=1e-14)


@pytest.mark.parametrize("exponent", [6.0, 12.5, 20.0])
def test_blunt_corners_are_drawn_in_pieces_on_the_outline(exponent):
    grain = Superellipse((0.5, 0.3), exponent)
    pieces = grain.drawn()
    assert len(pieces) > 12
    for piece, following in zip(pieces, (*pieces[1:], pieces[0]), strict=True):
        assert piece.end == pytest.approx(following.start, abs=1e-12)
        assert np.abs(grain.level(piece.point(np.linspace(0.0, 1.0, 500)))).max() < 1e-6
        first, last = piece.tangent([0.0, 1.0])
        assert np.arccos(np.clip(first @ last, -1.0, 1.0)) < np.radians(30.0)


def test_larger_exponents_are_refused_with_the_reason():
    with pytest.raises(SceneError, match=r"exponent 50 .* too sharp to be meshed; use a rectangle"):
        Superellipse((0.5, 0.3), 50.0)
