"""Settling onto a bed: closed-form rests in the plane and in space, and equilibrium checked from the outside.

Every rest is searched for `flaws`: contacts on both surfaces, nothing in the bed, and the weight balanced
by non-negative least squares over forces in the friction cones, none of which uses the code under test.
"""

import itertools

import numpy as np
import pytest
from settling import after_a_period, down, flaws, turned

from incipient.errors import SceneError
from incipient.geometry import (
    Disc,
    Discs,
    Ellipse,
    Ellipsoid,
    Flat,
    HalfDiscs,
    Placement,
    Plane,
    Polygon,
    Polyline,
    Rectangle,
    SettlingOutcome,
    Sinusoidal,
    Sphere,
    SphereBed,
    Star,
    Superellipse,
    settle,
)


class TestDiscs:
    @pytest.mark.parametrize("friction", [0.0, 0.3, np.inf])
    @pytest.mark.parametrize("x", [0.05, pytest.param(0.7, marks=pytest.mark.slow)])
    @pytest.mark.parametrize(("radius", "spacing", "diameter"), [(0.5, 1.0, 1.0), (0.3, 1.0, 1.0)])
    def test_in_the_pocket_of_two_half_discs(self, radius, spacing, diameter, x, friction):
        # Sides R + r, R + r and s of the triangle of centres.
        grain, bed = Disc(diameter), HalfDiscs(radius, spacing)
        found = settle(grain, bed, turned(x, 0.0), friction=friction)
        expected = np.sqrt((radius + 0.5 * diameter) ** 2 - 0.25 * spacing**2)
        assert found.placement.centre == pytest.approx((0.5 * spacing, expected), abs=1e-10)
        assert len(found.contacts) == 2
        assert not flaws(found, grain, bed, friction=friction)

    def test_on_a_plane_where_it_was_put(self):
        found = settle(Disc(1.0), Flat(0.2), turned(0.3, 0.0))
        assert found.placement.centre == pytest.approx((0.3, 0.7), abs=1e-12)
        assert len(found.contacts) == 1
        assert not flaws(found, Disc(1.0), Flat(0.2))

    def test_in_a_trough_of_ripples(self):
        # r = 0.2 is below the radius of curvature 1/(a k^2) = 0.253 in the trough at 3/4 of a wavelength.
        grain, bed = Disc(0.4), Sinusoidal(0.1, 1.0)
        found = settle(grain, bed, turned(0.6, 0.0))
        assert found.placement.centre == pytest.approx((0.75, 0.1), abs=1e-9)
        assert not flaws(found, grain, bed)
        shift, turn = after_a_period(found, grain, bed, turned(0.6, 0.0), (2.0, 0.0))
        assert (*shift, turn) == pytest.approx((2.0, 0.0, 0.0), abs=1e-9)

    def test_in_a_valley_of_lines(self):
        # Sides of slope -1 and 1: the centre is sqrt(2) r above the corner.
        grain, bed = Disc(1.0), Polyline([(-3, 3), (0, 0), (3, 3)])
        found = settle(grain, bed, turned(0.8, 0.0))
        assert found.placement.centre == pytest.approx((0.0, np.sqrt(0.5)), abs=1e-10)
        assert not flaws(found, grain, bed)


class TestEllipses:
    @pytest.mark.parametrize("friction", [0.0, 0.4, np.inf])
    @pytest.mark.parametrize("angle", [0.2, 2.0, pytest.param(-1.5, marks=pytest.mark.slow)])
    def test_falls_flat(self, angle, friction):
        grain = Ellipse((0.7, 0.3))
        found = settle(grain, Flat(), turned(0.3, angle), friction=friction)
        assert found.placement.centre[1] == pytest.approx(0.3, abs=1e-12)
        assert np.sin(found.placement.angle) == pytest.approx(0.0, abs=1e-9)
        if friction == 0.0:
            assert found.placement.centre[0] == pytest.approx(0.3, abs=1e-9)
        assert not flaws(found, grain, Flat(), friction=friction)

    def test_rolls_as_far_as_its_arc_is_long(self):
        # Without slip it moves by the arc from the first to the last contact; steps of the descent err a little.
        a, b, angle = 0.7, 0.3, 0.9
        found = settle(Ellipse((a, b)), Flat(), turned(0.0, angle), friction=np.inf)
        # Lowest point of the turned ellipse: parameter with tangent along x.
        lowest = np.arctan2(-b * np.cos(angle), -a * np.sin(angle))
        t = np.linspace(lowest, -0.5 * np.pi, 20001)
        speed = np.hypot(a * np.sin(t), b * np.cos(t))
        arc = abs(np.sum(0.5 * (speed[1:] + speed[:-1])) * (t[1] - t[0]))
        foot = np.cos(angle) * a * np.cos(lowest) - np.sin(angle) * b * np.sin(lowest)
        assert abs(found.placement.centre[0] - foot) == pytest.approx(arc, rel=0.05)

    @pytest.mark.parametrize("friction", [pytest.param(0.0, marks=pytest.mark.slow), 1.0])
    def test_in_a_pocket_lines_of_force_meet(self, friction):
        grain, bed, start = Ellipse((0.7, 0.4)), HalfDiscs(0.5, 1.0), turned(0.4, 0.6)
        found = settle(grain, bed, start, friction=friction)
        assert len(found.contacts) == 2
        assert not flaws(found, grain, bed, friction=friction)
        shift, turn = after_a_period(found, grain, bed, start, (1.0, 0.0), friction=friction)
        assert (*shift, turn) == pytest.approx((1.0, 0.0, 0.0), abs=1e-9)
        if friction == 0.0:
            # Three forces balance if their lines meet: the normals' on the vertical through the centre.
            (p, q), (m, n) = found.contacts.points[:, :2], found.contacts.normals[:, :2]
            s = np.linalg.solve(np.column_stack([m, -n]), q - p)[0]
            assert (p + s * m)[0] == pytest.approx(found.placement.centre[0], abs=1e-9)


class TestBoxes:
    @pytest.mark.parametrize("radius", [0.0, 0.1])
    @pytest.mark.parametrize(
        ("angle", "height"), [(0.4, 0.25), (-0.9, 0.25), (1.4, 0.5), (1.7, 0.5), (3.0, 0.25)]
    )
    def test_falls_onto_the_side_beneath_it(self, angle, height, radius):
        grain = Rectangle(1.0, 0.5, radius)
        found = settle(grain, Flat(), turned(0.3, angle))
        assert found.placement.centre[1] == pytest.approx(height, abs=1e-12)
        # A patch: both ends of the side, which share its length.
        side = (1.0 if height == 0.25 else 0.5) - 2.0 * radius
        assert found.contacts.areas == pytest.approx([0.5 * side] * 2)
        assert not flaws(found, grain, Flat())

    @pytest.mark.parametrize(("slope", "stays"), [(0.3, True), (0.46, True), (0.47, False)])
    def test_on_a_slope_it_stays_within_friction(self, slope, stays):
        # tan(0.4636) = 1/2.
        grain, how = Rectangle(1.0, 0.5), {"gravity": down(slope), "friction": 0.5}
        found = settle(grain, Flat(), turned(0.3, 0.0), **how)
        if stays:
            assert found.placement.centre == pytest.approx((0.3, 0.25))
            assert not flaws(found, grain, Flat(), **how)
        else:
            assert (found.outcome, found.contacts, found.stable) == (
                SettlingOutcome.ROLLS_OFF,
                None,
                False,
            )

    @pytest.mark.parametrize(("width", "topples"), [(0.67, True), (0.70, False)])
    def test_on_a_slope_a_tall_one_topples(self, width, topples):
        # The weight leaves the base if tan(slope) > w/h; tan(0.6) = 0.684. It then lies on its long side.
        grain, how = Rectangle(width, 1.0), {"gravity": down(0.6), "friction": 1.0}
        found = settle(grain, Flat(), turned(0.3, 0.0), **how)
        assert found.placement.centre[1] == pytest.approx(0.5 * width if topples else 0.5)
        assert not flaws(found, grain, Flat(), **how)

    def test_on_a_slope_of_the_bed(self):
        bed = Polyline([(-8.0, -2.4), (8.0, 2.4)])
        found = settle(Rectangle(1.0, 0.5), bed, turned(0.0, 0.0), friction=0.5)
        assert np.tan(found.placement.angle) == pytest.approx(0.3)
        assert not flaws(found, Rectangle(1.0, 0.5), bed, friction=0.5)


GRAINS = (
    Superellipse((0.7, 0.3), 4.0),
    Star(0.5, (0.0, 0.2), (0.0, 0.1)),
    Discs([(0, 0), (0.7, 0.2), (-0.3, 0.6)], [0.5, 0.3, 0.4]),
    Polygon([(0, 0), (2, 0.5), (1.5, 1.5), (-0.2, 1.0)]),
)
BEDS = (
    HalfDiscs(0.5, 1.2),
    Sinusoidal(0.1, 1.2),
    Polyline([(-6, 0), (-0.5, 0.3), (0, 0.6), (0.4, -0.2), (6, 0.2)]),
)
# By default each grain on one bed, and each bed under one or two grains.
USUAL = ("Superellipse-HalfDiscs", "Star-Polyline", "Discs-Polyline", "Polygon-Sinusoidal")


def pair(grain, bed):
    """A grain and a bed for a test by their names."""
    name = f"{type(grain).__name__}-{type(bed).__name__}"
    return pytest.param(grain, bed, id=name, marks=() if name in USUAL else pytest.mark.slow)


class TestOtherGrainsInThePlane:
    @pytest.mark.parametrize(
        ("grain", "bed"), [pair(*both) for both in itertools.product(GRAINS, BEDS)]
    )
    def test_rests_on_every_bed(self, grain, bed):
        assert not flaws(settle(grain, bed, turned(0.2, 0.5)), grain, bed)

    @pytest.mark.parametrize("exponent", [pytest.param(4.0, marks=pytest.mark.slow), 20.0])
    def test_superellipse_lies_on_its_flat_side(self, exponent):
        # Its flat side has no curvature: the couple is a root of the angle.
        found = settle(Superellipse((0.7, 0.3), exponent), Flat(), turned(0.2, 0.3), friction=0.0)
        assert found.stable
        assert found.placement.centre == pytest.approx((0.2, 0.3), abs=1e-9)
        assert found.placement.angle == pytest.approx(0.0, abs=1e-9)

    def test_superellipse_lies_on_its_flat_side_on_a_slope(self):
        """Of slope 1/10: its contact is beneath the centre, h/10 off the middle of its side, closed to 1e-16 there."""
        bed = Polyline([(-50.0, -5.0), (50.0, 5.0)])
        found = settle(Superellipse((0.5, 0.4), 20.0), bed, turned(0.2, 0.5), friction=0.5)
        assert found.stable and found.placement.angle == pytest.approx(np.arctan(0.1), abs=1e-9)
        assert found.contacts.points[0, 0] == pytest.approx(found.placement.centre[0], abs=1e-8)

    def test_two_discs_lie_side_by_side(self):
        grain = Discs([(0, 0), (0.7, 0)], [0.4, 0.4])
        found = settle(grain, Flat(), turned(0.0, 1.0))
        assert found.placement.centre[1] == pytest.approx(0.4)
        assert len(found.contacts) == 2
        assert not flaws(found, grain, Flat())


class TestOutcomes:
    @pytest.mark.parametrize(
        ("grain", "bed", "start"),
        [
            (Ellipse((0.7, 0.3)), Flat(), turned(0.3, 0.5 * np.pi)),
            (Rectangle(1.0, 1.0), Flat(), turned(0.3, 0.25 * np.pi)),
            (Disc(1.0), HalfDiscs(0.5, 1.0), turned(0.0, 0.0)),
            (Sphere(1.0), SphereBed.array(0.5, 1.0), Placement((0, 0, 3))),
            (Ellipsoid((0.3, 0.3, 0.6)), Plane(), Placement((0, 0, 3))),
        ],
    )
    def test_started_on_its_summit_it_balances(self, grain, bed, start):
        found = settle(grain, bed, start)
        assert (found.outcome, found.stable, len(found.contacts)) == (
            SettlingOutcome.BALANCES,
            False,
            1,
        )
        assert found.placement.centre[:-1] == pytest.approx(start.centre[:-1])

    def test_started_beside_its_summit_it_falls(self):
        """A tenth of a degree from where it would balance on its end; it comes to lie, half its width high."""
        start = turned(0.3, np.radians(89.9))
        found = settle(Ellipse((0.7, 0.3)), Flat(), start)
        assert found.stable and found.placement.centre[1] == pytest.approx(0.3, abs=1e-9)

    @pytest.mark.parametrize(
        ("grain", "bed", "how"),
        [
            (Disc(1.0), Flat(), {"gravity": down(0.1)}),
            (Sphere(1.0), Plane((0.2, 0.1)), {}),
            (Disc(1.0), Polyline([(-1.0, 0.2), (1.0, -0.2)]), {"reach": 100.0}),
        ],
        ids=["disc", "sphere", "off the end of the bed"],
    )
    def test_what_is_round_rolls_off_a_slope(self, grain, bed, how):
        found = settle(grain, bed, Placement((*[0.0] * (grain.gdim - 1), 3.0)), **how)
        assert (found.outcome, found.contacts) == (SettlingOutcome.ROLLS_OFF, None)

    def test_too_few_steps(self):
        found = settle(Disc(1.0), HalfDiscs(0.5, 1.0), turned(0.3, 0.0), max_steps=2)
        assert (found.outcome, found.contacts, found.steps) == (SettlingOutcome.UNSETTLED, None, 2)
        assert found.imbalance > 0.1

    @pytest.mark.parametrize(
        ("how", "reason"),
        [
            ({"friction": -0.1}, "friction -0.1 is not a coefficient"),
            ({"friction": float("nan")}, "friction nan"),
            ({"gravity": (0.0, 1.0)}, r"gravity \[0.0, 1.0\] does not point down; give 2 numbers"),
            ({"gravity": (1.0, 0.0)}, "does not point down"),
            ({"gravity": (0.0, 0.0, -1.0)}, "give 2 numbers"),
            ({"gravity": (np.nan, -1.0)}, "does not point down"),
            (
                {"start": Placement((0, 0, 3))},
                "placement in 3 dimensions does not fit a grain in 2",
            ),
            ({"bed": Plane()}, "one is planar, the other is not"),
            (
                {"grain": Sphere(1.0), "start": Placement((0, 0, 3))},
                "one is planar, the other is not",
            ),
        ],
    )
    def test_bad_input_is_one_line(self, how, reason):
        arguments = {"grain": Disc(1.0), "bed": Flat(), "start": turned(0.0, 0.0)} | how
        with pytest.raises(SceneError, match=reason) as caught:
            settle(**arguments)
        assert "\n" not in str(caught.value)
