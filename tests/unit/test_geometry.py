"""Grains, beds, curves, and how a grain comes to rest: against closed formulae and against brute force."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from incipient.errors import SceneError
from incipient.geometry import (
    Arc,
    Curved,
    Disc,
    Ellipse,
    Flat,
    HalfDiscs,
    Line,
    Placement,
    Polygon,
    Polyline,
    Rectangle,
    Sinusoidal,
    Spline,
    clearance,
    lifted,
    rest,
)

GRAINS = {
    "disc": Disc(1.2),
    "ellipse, long side along x": Ellipse((0.7, 0.3)),
    "ellipse, long side along y": Ellipse((0.2, 0.5)),
    "sharp box": Rectangle(1.0, 0.6),
    "rounded box": Rectangle(1.0, 0.6, 0.1),
    "stadium": Rectangle(1.0, 0.6, 0.3),
    "quadrilateral": Polygon([(0, 0), (2, 0.5), (1.5, 1.5), (-0.2, 1.0)]),
    "clockwise arrow": Polygon([(0, 0), (-1, 2), (1, 0), (-1, -2)]),
}
BEDS = {
    "flat": Flat(0.2),
    "wavy": Sinusoidal(0.1, 1.0, 0.4, 0.2),
    "steep wavy": Sinusoidal(0.4, 0.7),
    "touching half-discs": HalfDiscs(0.5, 1.0, 0.1, 0.2),
    "spaced half-discs": HalfDiscs(0.2, 0.7),
    "polyline": Polyline([(-6, 0), (-0.5, 0.3), (0, 0.6), (0.4, -0.2), (1, 0), (6, 0.2)], 0.1),
    "smooth curve": Curved(
        [(-6, 0.2), (-2, 0.2), (-0.5, 0.3), (0.1, 0.6), (0.8, 0.1), (1.5, 0), (6, 0)], 0.1
    ),
}
S = np.linspace(0.0, 1.0, 401)
grains = pytest.mark.parametrize("grain", GRAINS.values(), ids=GRAINS.keys())
beds = pytest.mark.parametrize("bed", BEDS.values(), ids=BEDS.keys())


def dense(curves, count=4001):
    """Points all along a chain of curves."""
    return np.vstack([curve.point(np.linspace(0.0, 1.0, count)) for curve in curves])


def moments(grain):
    """Area and first moments inside the outline by Green's theorem, Gauss rule on each curve."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    s, w, h = 0.5 * (nodes + 1.0), 0.5 * weights, 1e-6
    total = np.zeros(3)
    for curve in grain.outline():
        x, y = curve.point(s).T
        dx, dy = ((curve.point(s + h) - curve.point(s - h)) / (2.0 * h)).T
        total += [w @ (0.5 * (x * dy - y * dx)), w @ (0.5 * x * x * dy), w @ (-0.5 * y * y * dx)]
    return total


class TestCurves:
    CURVES = (
        Line((0.0, 1.0), (2.0, -1.0)),
        Arc((1.0, 0.0), (0.0, 0.0), (0.0, 1.0)),
        Arc((0.0, 1.0), (0.0, 0.0), (1.0, 0.0)),
        Arc((2.0, 0.0), (0.0, 0.0), (0.0, 1.0), (2.0, 0.0)),
        Arc((1.0, 0.0), (0.0, 0.0), (0.0, -3.0), (0.0, -3.0)),
        Spline(np.column_stack([S, np.sin(S)])),
    )

    @pytest.mark.parametrize("curve", CURVES)
    def test_ends_and_tangents(self, curve):
        assert curve.point([0.0, 1.0]) == pytest.approx(
            np.array([curve.start, curve.end]), abs=1e-14
        )
        inner, h = S[1:-1] + 1e-4, 1e-6
        chord = curve.point(inner + h) - curve.point(inner - h)
        chord /= np.linalg.norm(chord, axis=1, keepdims=True)
        assert curve.tangent(inner) == pytest.approx(chord, abs=1e-7)

    @pytest.mark.parametrize("curve", CURVES)
    def test_moved_curve_is_the_curve_of_moved_points(self, curve):
        placement = Placement((0.3, -2.0), 0.7)
        assert curve.moved(placement).point(S) == pytest.approx(
            placement.to_scene(curve.point(S)), abs=1e-14
        )

    def test_arc_goes_the_short_way_round(self):
        middle = Arc((1.0, 0.0), (0.0, 0.0), (0.0, -1.0)).point([0.5])
        assert middle == pytest.approx(np.array([[np.sqrt(0.5), -np.sqrt(0.5)]]))

    def test_partial_ellipse_arc_keeps_the_ellipse(self):
        a, b, angle = 2.0, 0.5, np.array([0.3, 1.1])
        start, end = np.column_stack([a * np.cos(angle), b * np.sin(angle)])
        x, y = Arc(tuple(start), (0.0, 0.0), tuple(end), (a, 0.0)).point(S).T
        assert (x / a) ** 2 + (y / b) ** 2 == pytest.approx(np.ones(len(S)), abs=1e-13)

    def test_spline_refuses_too_few_points(self):
        with pytest.raises(ValueError, match="four"):
            Spline(np.zeros((3, 2)))

    def test_placement_there_and_back(self):
        placement, x = Placement((1.0, 2.0), 0.4), np.array([[0.3, -0.8]])
        assert placement.to_body(placement.to_scene(x)) == pytest.approx(x)
        assert placement.raised(0.5).centre == (1.0, 2.5)
        with pytest.raises(SceneError, match="finite"):
            Placement((0.0, np.nan))


class TestGrains:
    @grains
    def test_outline_is_closed_and_is_the_zero_of_the_level(self, grain):
        outline = grain.outline()
        for curve, following in zip(outline, (*outline[1:], outline[0]), strict=True):
            assert curve.end == pytest.approx(following.start, abs=1e-14)
        assert grain.level(dense(outline)) == pytest.approx(0.0, abs=1e-13 * grain.size)

    @grains
    def test_area_and_centroid(self, grain):
        # Positive area by Green's theorem: the outline runs counter-clockwise.
        assert moments(grain) == pytest.approx([grain.volume, 0.0, 0.0], abs=1e-8)

    @grains
    def test_size_is_the_largest_diameter(self, grain):
        points = dense(grain.outline(), 101)
        assert np.linalg.norm(points[:, None] - points[None], axis=2).max() == pytest.approx(
            grain.size, 1e-3
        )

    @grains
    def test_normal_is_outward_and_level_grows_along_it(self, grain):
        for curve in grain.outline():
            inner = S[20:-20]
            points, tangents = curve.point(inner), curve.tangent(inner)
            normals = grain.normal(points)
            assert normals == pytest.approx(
                np.column_stack([tangents[:, 1], -tangents[:, 0]]), abs=1e-9
            )
            assert (grain.level(points + 1e-3 * normals) > 0.0).all()
            assert (grain.level(points - 1e-3 * normals) < 0.0).all()

    def test_normal_at_a_corner_is_the_bisector(self):
        bisector = np.array([[np.sqrt(0.5), -np.sqrt(0.5)]])
        square = Polygon([(0, 0), (1, 0), (1, 1), (0, 1)])
        assert Rectangle(1.0, 1.0).normal([[0.5, -0.5]]) == pytest.approx(bisector)
        assert square.normal([[0.5, -0.5]]) == pytest.approx(bisector)

    def test_level_is_the_distance_for_boxes_and_polygons(self):
        assert Rectangle(2.0, 1.0, 0.2).level([[2.0, 0.0], [0.0, 0.0]]) == pytest.approx(
            [1.0, -0.5]
        )
        assert Polygon([(0, 0), (1, 0), (1, 1), (0, 1)]).level(
            [[0.5 + 3.0, 0.5 + 4.0]]
        ) == pytest.approx(5.0)

    @pytest.mark.parametrize(
        ("make", "reason"),
        [
            (lambda: Disc(0.0), "diameter"),
            (lambda: Disc(float("nan")), "diameter"),
            (lambda: Ellipse((1.0, -1.0)), "semi-axis"),
            (lambda: Rectangle(1.0, 0.0), "height"),
            (lambda: Rectangle(1.0, 1.0, 0.6), "corner_radius"),
            (lambda: Polygon([(0, 0), (1, 0)]), "three vertices"),
            (lambda: Polygon([(0, 0), (1, 0), (2, 0)]), "no area"),
            (lambda: Polygon([(0, 0), (1, 0), (1, 0), (0, 1)]), "repeated"),
            (lambda: Polygon([(0, 0), (1, 1), (1, 0), (0, 1.5)]), "cross"),
        ],
    )
    def test_bad_grains_are_refused(self, make, reason):
        with pytest.raises(SceneError, match=reason):
            make()


class TestBeds:
    @beds
    def test_curves_join_and_lie_on_the_bed(self, bed):
        x0, x1 = -2.3, 3.1
        curves = bed.curves(x0, x1)
        assert (curves[0].start[0], curves[-1].end[0]) == (x0, x1)
        for curve, following in pairwise(curves):
            assert curve.end == following.start
        points = dense(curves, 301)
        # Only the spline of the wavy beds is an approximation: to 1e-6 of the wavelength, which is at most 1.
        assert bed.height(points[:, 0]) == pytest.approx(points[:, 1], abs=1e-6)

    @beds
    def test_normals_by_differences(self, bed):
        x, h = np.linspace(-2.0, 2.0, 173) + 1e-3, 1e-7
        smooth = np.abs(np.subtract(*bed.side_normals(x))).max(axis=1) == 0.0
        slope = (bed.height(x + h) - bed.height(x - h)) / (2.0 * h)
        normal = np.column_stack([-slope, np.ones(len(x))]) / np.hypot(slope, 1.0)[:, None]
        steep = np.abs(slope) > 5.0
        assert bed.normal(x)[smooth & ~steep] == pytest.approx(normal[smooth & ~steep], abs=1e-5)

    @beds
    def test_nearest_point_against_brute_force(self, bed):
        generator = np.random.default_rng(1)
        x = generator.uniform(-2.0, 2.0, 60)
        points = np.column_stack([x, bed.height(x) + generator.uniform(0.0, 1.5, 60)])
        track = np.linspace(-5.0, 5.0, 400001)
        track = np.column_stack([track, bed.height(track)])
        brute, _ = cKDTree(track, balanced_tree=False).query(points)
        feet = bed.nearest(points)
        assert bed.height(feet[:, 0]) == pytest.approx(feet[:, 1], abs=1e-7)
        # Brute force can only be too large, by its spacing of 2.5e-5 on the steepest flank.
        assert np.all(bed.distance(points) <= np.array(brute) + 1e-12)
        assert bed.distance(points) == pytest.approx(brute, abs=2e-4)

    def test_distance_is_negative_below(self):
        assert Flat(1.0).distance([[0.0, 0.4], [0.0, 1.4]]) == pytest.approx([-0.6, 0.4])

    def test_half_discs(self):
        bed = HalfDiscs(0.5, 2.0, 0.25, 1.0)
        assert bed.height([0.25, 0.75, 1.25, 2.25]) == pytest.approx([1.5, 1.0, 1.0, 1.5])
        assert bed.corners(0.0, 2.0) == pytest.approx([0.75, 1.75])
        kinds = [type(curve) for curve in bed.curves(0.25, 2.25)]
        assert kinds == [Arc, Line, Arc]
        assert [type(c) for c in HalfDiscs(0.5, 1.0).curves(-0.5, 1.5)] == [Arc] * 4

    def test_half_disc_cut_at_its_foot_has_no_sliver(self):
        for x0 in (-0.5 - 1e-13, -0.5, -0.5 + 1e-13):
            curves = HalfDiscs(0.5, 2.0).curves(x0, 0.0)
            assert len(curves) == 1
            assert curves[0].start == (x0, 0.0)

    def test_spline_error_is_below_a_millionth_of_the_wavelength(self):
        for amplitude in (0.01, 0.1, 0.5):
            bed = Sinusoidal(amplitude, 2.0, 1.0)
            (curve,) = bed.curves(0.3, 4.9)
            x, y = curve.point(np.linspace(0.0, 1.0, 20011)).T
            assert np.abs(bed.height(x) - y).max() < 1e-6 * 2.0

    @pytest.mark.parametrize(
        ("make", "reason"),
        [
            (lambda: HalfDiscs(0.5, 0.9), "overlap"),
            (lambda: HalfDiscs(-0.5, 0.9), "radius"),
            (lambda: Sinusoidal(0.1, 0.0), "wavelength"),
            (lambda: Sinusoidal(-0.1, 1.0), "amplitude"),
            (lambda: Polyline([(0, 0)]), "two points"),
            (lambda: Polyline([(0, 0), (1, 0), (0.5, 1)]), "point 2 .* sort"),
            (lambda: Polyline([(0, 0), (1, 0)]).curves(0.0, 2.0), "reaches from"),
            (lambda: Flat().curves(1.0, 0.0), "empty"),
        ],
    )
    def test_bad_beds_are_refused(self, make, reason):
        with pytest.raises(SceneError, match=reason):
            make()


class TestRest:
    """Heights at rest from elementary geometry, stated case by case."""

    def height(self, grain, bed, x, angle=0.0):
        return rest(grain, bed, x, angle).centre[1]

    def test_disc_on_a_plane(self):
        assert self.height(Disc(1.0), Flat(0.3), 2.0) == pytest.approx(0.8, abs=1e-12)

    def test_disc_in_a_pocket_of_two_half_discs(self):
        # The centres of the three circles form a triangle with sides R + r, R + r and the spacing.
        expected = np.sqrt((0.5 + 0.4) ** 2 - 0.5**2)
        assert self.height(Disc(1.0), HalfDiscs(0.4, 1.0), 0.5) == pytest.approx(
            expected, abs=1e-12
        )

    def test_disc_on_a_slope(self):
        # The contact is R along the normal from the centre: y = slope x + R / cos(angle).
        bed = Polyline([(-4.0, -2.0), (4.0, 2.0)])
        expected = 0.5 * 1.0 + 0.5 * np.hypot(1.0, 0.5)
        assert self.height(Disc(1.0), bed, 1.0) == pytest.approx(expected, abs=1e-12)

    @pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 2, -2.0])
    def test_ellipse_on_a_plane(self, angle):
        # The support function of an ellipse in the direction straight down.
        expected = np.hypot(0.7 * np.sin(angle), 0.3 * np.cos(angle))
        assert self.height(Ellipse((0.7, 0.3)), Flat(), 0.0, angle) == pytest.approx(
            expected, abs=1e-12
        )

    def test_square_on_its_corner_and_on_its_side(self):
        square = Rectangle(1.0, 1.0)
        assert self.height(square, Flat(), 0.0, np.pi / 4) == pytest.approx(np.sqrt(0.5), abs=1e-12)
        assert self.height(square, Flat(), 0.0) == pytest.approx(0.5, abs=1e-15)

    def test_box_on_a_peak_of_the_bed(self):
        # The side of the box passes over the peak, between the samples of the side.
        bed = Polyline([(-3.0, -1.0), (0.1234567, 0.25), (3.0, -2.0)])
        assert self.height(Rectangle(1.0, 0.5), bed, 0.0) == pytest.approx(0.5, abs=1e-12)

    def test_disc_on_a_crest_and_in_a_trough(self):
        # Flatter than the disc: it touches in one point, crest or trough.
        crest, trough = 0.25, 0.75
        assert self.height(Disc(1.0), Sinusoidal(0.02, 1.0), crest) == pytest.approx(
            0.52, abs=1e-12
        )
        assert self.height(Disc(1.0), Sinusoidal(0.02, 1.0), trough) == pytest.approx(
            0.48, abs=1e-12
        )

    def test_base_line_counts(self):
        low = self.height(Ellipse((0.5, 0.2)), Sinusoidal(0.1, 1.0), 0.3, 0.2)
        high = self.height(Ellipse((0.5, 0.2)), Sinusoidal(0.1, 1.0, origin_y=2.0), 0.3, 0.2)
        assert high - low == pytest.approx(2.0)

    @settings(max_examples=15, deadline=None)
    @given(
        grain=st.sampled_from(list(GRAINS.values())),
        bed=st.sampled_from(list(BEDS.values())),
        x=st.floats(-1.5, 1.5),
        angle=st.floats(-np.pi, np.pi),
        gap=st.sampled_from([0.003, 0.02, 0.3]),
    )
    def test_resting_touches_and_lifting_opens_the_gap(self, grain, bed, x, angle, gap):
        placement = rest(grain, bed, x, angle)
        outline = dense([curve.moved(placement) for curve in grain.outline()], 1001)
        # Nowhere below the bed, and touching.
        assert (outline[:, 1] - bed.height(outline[:, 0])).min() >= -1e-12
        assert clearance(grain, placement, bed)[0] == pytest.approx(0.0, abs=1e-12)
        raised = lifted(grain, placement, bed, gap)
        distance, on_grain, on_bed = clearance(grain, raised, bed)
        assert distance == pytest.approx(gap, abs=1e-10)
        assert np.linalg.norm(on_grain - on_bed) == pytest.approx(gap, abs=1e-10)
        assert raised.centre[0] == placement.centre[0]
        assert raised.centre[1] >= placement.centre[1] + gap - 1e-10


class TestLifted:
    def test_above_a_plane_the_lift_is_the_gap(self):
        grain = Rectangle(1.0, 0.5, 0.1)
        placement = rest(grain, Flat(), 0.0)
        assert lifted(grain, placement, Flat(), 0.01).centre[1] == pytest.approx(0.26, abs=1e-12)
        assert lifted(grain, placement, Flat(), 0.0).centre[1] == pytest.approx(0.25, abs=1e-12)

    def test_out_of_a_pocket(self):
        # The triangle of centres with sides R + r + gap.
        grain, bed = Disc(1.0), HalfDiscs(0.4, 1.0)
        raised = lifted(grain, rest(grain, bed, 0.5), bed, 0.02)
        assert raised.centre[1] == pytest.approx(np.sqrt(0.92**2 - 0.5**2), abs=1e-10)

    def test_clearance_of_a_raised_disc_from_a_corner(self):
        # The nearest point of the bed is the corner at (0, 1).
        bed = Polyline([(-5.0, 0.0), (0.0, 1.0), (5.0, 0.0)])
        distance, on_grain, on_bed = clearance(Disc(1.0), Placement((0.1, 2.0)), bed)
        assert on_bed == pytest.approx([0.0, 1.0])
        assert distance == pytest.approx(np.hypot(0.1, 1.0) - 0.5, abs=1e-12)
        direction = np.array([0.1, 1.0]) / np.hypot(0.1, 1.0)
        assert on_grain == pytest.approx(np.array([0.1, 2.0]) - 0.5 * direction)

    def test_overlap_is_negative(self):
        assert clearance(Disc(1.0), Placement((0.0, 0.3)), Flat())[0] == pytest.approx(-0.2)

    def test_bad_gap_is_refused(self):
        with pytest.raises(SceneError, match="gap"):
            lifted(Disc(1.0), Placement((0.0, 0.5)), Flat(), -0.1)


def test_the_nearest_place_on_a_long_smooth_curve_is_found():
    """Two hundred waves, for which its lines are long: distances as from four million points on it."""
    x = np.linspace(0.0, 400.0, 1601)
    bed = Curved(np.column_stack([x, 0.1 * np.cos(np.pi * x)]))
    above, dense = np.array([[150.3, 0.35], [201.12, 0.02]]), np.linspace(149.0, 203.0, 4_000_001)
    away = [np.hypot(dense - one[0], bed.height(dense) - one[1]).min() for one in above]
    assert np.linalg.norm(above - bed.nearest(above), axis=1) == pytest.approx(away, abs=1e-9)


def test_a_smooth_curve_through_points_of_a_circle_is_that_circle():
    """Radius 2 between two level stretches: as high as the circle to 1e-4, and its radius found from the points."""
    x = np.linspace(-1.0, 1.0, 41)
    arc = np.column_stack([x, np.sqrt(4.0 - x**2) - np.sqrt(3.0)])
    bed = Curved([(-4.0, 0.0), *arc, (4.0, 0.0)])
    within = np.linspace(-0.9, 0.9, 301)
    assert bed.height(within) == pytest.approx(np.sqrt(4.0 - within**2) - np.sqrt(3.0), abs=1e-4)
    assert bed.nearest([[0.5, 1.0]]) == pytest.approx(
        np.array([[0.5, 1.0 + 3.0**0.5]]) * 2.0 / np.hypot(0.5, 1.0 + 3.0**0.5) - [0.0, 3.0**0.5],
        abs=2e-3,
    )
    assert Curved(arc).feature == pytest.approx(2.0, rel=1e-3)
    assert [type(one) for one in bed.curves(-3.0, 3.0)] == [Line, Spline, Line]
    assert not np.isfinite(Curved([(0.0, 0.0), (1.0, 0.5), (3.0, 1.5)]).feature)
    with pytest.raises(SceneError, match="a smooth bed has a step"):
        Curved([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (2.0, 1.0)])


def test_a_polyline_may_step_vertically():
    """The x of the step belongs to its right side; it is a line of the bed, and it has no part in the mean."""
    bed = Polyline([(0, 1), (2, 1), (2, 0), (6, 0)])
    assert bed.feature == 1.0 and bed.mean(0, 6) == pytest.approx(2 / 6)
    assert bed.height([1.9, 2.0, 2.1]) == pytest.approx([1, 0, 0])
    assert [(line.start, line.end) for line in bed.curves(1, 6)] == [
        ((1, 1), (2, 1)),
        ((2, 1), (2, 0)),
        ((2, 0), (6, 0)),
    ]
    assert bed.nearest([(2.5, 0.7)]) == pytest.approx(np.array([[2.0, 0.7]]))
    assert bed.corners(0, 6) == pytest.approx([0, 2, 6])
    with pytest.raises(
        SceneError, match="polyline point 1 lies to the left of, or at, the one before"
    ):
        Polyline([(0, 1), (0, 1), (2, 1)])
