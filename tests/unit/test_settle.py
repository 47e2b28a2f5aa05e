"""Where grains come to rest, in 2-D and 3-D."""

import functools
import itertools

import numpy as np
import pytest
import trimesh
from every_shape import SOLIDS, TERRAINS, TETRAHEDRON, vectors
from hypothesis import given, settings
from hypothesis import strategies as st
from settling import above, after_a_period, down, flaws, turned

from incipient.contact import touching
from incipient.errors import SceneError
from incipient.geometry import (
    Box,
    Disc,
    Discs,
    Ellipse,
    Ellipsoid,
    Flat,
    HalfDiscs,
    HeightMap,
    Placement,
    Plane,
    Polygon,
    Polyhedron,
    Polyline,
    Rectangle,
    Ridges,
    SettlingOutcome,
    Sinusoidal,
    Sphere,
    SphereBed,
    Spheres,
    Star,
    Superellipse,
    Superquadric,
    Triangulated,
    clearance,
    lifted,
    rest,
    settle,
)
from incipient.geometry.contacts import frame_of
from incipient.geometry.placement import product, rotation_by
from incipient.geometry.statics import hold

# Settling onto a bed: closed-form rests in the plane and in space, and equilibrium checked from the outside.
#
# Every rest is searched for `flaws`: contacts on both surfaces, nothing in the bed, and the weight balanced
# by non-negative least squares over forces in the friction cones, none of which uses the code under test.


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


# Forces within friction cones that balance a load: the conditions of the best ones, and a groove by hand


SIZE = 1.7


def cone(normals, friction, count=3600):
    """Generators (count, k, 3) of friction cones about unit normals (k, 3)."""
    first, second = frame_of(normals)
    angle = 2.0 * np.pi * np.arange(count)[:, None, None] / count
    return normals + friction * (np.cos(angle) * first + np.sin(angle) * second)


@pytest.mark.parametrize("seed", range(12))
def test_the_remainder_is_the_least_there_is(seed):
    """The remainder r is least if r . w >= 0 for all wrenches w of the cones and r . (r - load) = 0."""
    random = np.random.default_rng(seed)
    count, friction = int(random.integers(1, 5)), float(random.uniform(0.05, 1.2))
    normals, arms = random.normal(size=(2, count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    load = random.normal(size=6)
    held = hold(load, normals, arms, friction, SIZE)
    assert held.remainder == pytest.approx(load + held.factors @ held.rows, abs=1e-12)
    assert held.remainder @ (held.remainder - load) == pytest.approx(0.0, abs=1e-10)
    force = cone(normals, friction)
    power = force @ held.remainder[:3] + np.cross(arms, force) @ held.remainder[3:] / SIZE
    assert power.min() >= -1e-8
    used = held.rows[:, :3]  # generators: unit along the normal, friction across it
    along = (used * normals[held.owner]).sum(axis=1)
    across = np.linalg.norm(used - along[:, None] * normals[held.owner], axis=1)
    assert along == pytest.approx(1.0) and (across <= friction * (1.0 + 1e-12)).all()


@pytest.mark.parametrize("turn", np.linspace(0.0, 0.35, 5))
@pytest.mark.parametrize(("share", "held"), [(0.9995, True), (1.0005, False)])
def test_a_groove_holds_along_its_axis_up_to_the_cones_themselves(turn, share, held):
    """By hand: tan(a) = friction / (cos b sqrt(1 - (friction tan b)^2)) at the limit, with sides at b = 50 degrees.

    Friction f along the axis and t down each side, N = (W/2 + t sin b) / cos b and f^2 + t^2 = (friction N)^2: f is
    largest for t = friction^2 N tan b. An inscribed polygon of sixteen sides falls short of f by up to 2%.
    """
    friction, side = 0.4, np.radians(50.0)
    wedged = np.sqrt(1.0 - (friction * np.tan(side)) ** 2)
    slope = share * friction / (np.cos(side) * wedged)
    c, s = np.cos(turn), np.sin(turn)
    turned = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])  # about the vertical
    sides = np.array([[0.0, np.sin(side), np.cos(side)], [0.0, -np.sin(side), np.cos(side)]])
    normals = sides @ turned.T
    load = np.append(turned @ [slope, 0.0, -1.0], np.zeros(3)) / np.hypot(slope, 1.0)
    # Forces through the centre: the couple does not matter.
    remainder = hold(load, normals, np.zeros((2, 3)), friction, 1.0).remainder
    assert (np.abs(remainder).max() < 1e-9) == held


# Settling in space: spheres in pockets, solids on planes and on rough beds, searched for flaws from the outside


CUBE = Polyhedron([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)])


class TestSpheres:
    def test_on_a_plane(self):
        found = settle(Sphere(1.0), Plane(), above(0.1, 0.2))
        assert found.placement.centre == pytest.approx((0.1, 0.2, 0.5), abs=1e-12)
        assert not flaws(found, Sphere(1.0), Plane())

    @pytest.mark.parametrize("friction", [0.0, 0.5])
    @pytest.mark.parametrize(
        "x", [(0.3, 0.1), (0.45, 0.3), pytest.param((0.6, 0.02), marks=pytest.mark.slow)]
    )
    @pytest.mark.parametrize("spacing", [0.9, 1.0, 1.3])
    def test_in_a_pocket_of_three(self, spacing, x, friction):
        # The centre is above that of an equilateral triangle, s/sqrt(3) from its corners.
        grain, bed = Sphere(1.0), SphereBed.array(0.5, spacing, "triangular")
        found = settle(grain, bed, above(x[0] * spacing, x[1] * spacing), friction=friction)
        expected = (0.5 * spacing, spacing / np.sqrt(12.0), np.sqrt(1.0 - spacing**2 / 3.0))
        assert found.placement.centre == pytest.approx(expected, abs=1e-10)
        assert len(found.contacts) == 3
        assert not flaws(found, grain, bed, friction=friction)

    @pytest.mark.parametrize(
        "x", [(0.3, 0.1), (0.5, 0.4), pytest.param((0.9, 0.8), marks=pytest.mark.slow)]
    )
    @pytest.mark.parametrize("spacing", [0.9, 1.0, 1.2])
    def test_in_a_pocket_of_four(self, spacing, x):
        # Half a diagonal, s/sqrt(2), from the corners of the square.
        grain, bed = Sphere(1.0), SphereBed.array(0.5, spacing, "square")
        found = settle(grain, bed, above(x[0] * spacing, x[1] * spacing))
        expected = (0.5 * spacing, 0.5 * spacing, np.sqrt(1.0 - 0.5 * spacing**2))
        assert found.placement.centre == pytest.approx(expected, abs=1e-10)
        assert len(found.contacts) == 4
        assert not flaws(found, grain, bed)

    @pytest.mark.parametrize(
        ("arrangement", "period"),
        [("square", (1.2, 2.4, 0.0)), ("triangular", (0.6, 1.2 * np.sqrt(0.75), 0.0))],
    )
    def test_in_a_pocket_of_another_period(self, arrangement, period):
        bed, start = SphereBed.array(0.5, 1.2, arrangement), above(0.3, 0.25)
        shift, turn = after_a_period(
            settle(Sphere(1.0), bed, start), Sphere(1.0), bed, start, period
        )
        assert (*shift, turn) == pytest.approx((*period, 0.0), abs=1e-9)

    def test_on_the_base_plane_of_sparse_half_balls(self):
        found = settle(Sphere(1.0), SphereBed.array(0.2, 4.0), above(2.0, 2.0))
        assert found.placement.centre == pytest.approx((2.0, 2.0, 0.5))


class TestSolidsOnPlanes:
    @pytest.mark.parametrize("friction", [0.0, 1.0])
    def test_ellipsoid_lies_on_its_shortest_axis(self, friction):
        grain = Ellipsoid((0.7, 0.5, 0.3))
        found = settle(
            grain,
            Plane(),
            Placement((0, 0, 3), 0.0, rotation_by((0.4, 0.7, 0.2))),
            friction=friction,
        )
        assert found.placement.centre[2] == pytest.approx(0.3, abs=1e-12)
        assert np.abs(found.placement.rotation[2]) == pytest.approx([0, 0, 1], abs=1e-8)
        assert not flaws(found, grain, Plane(), friction=friction)

    @pytest.mark.parametrize(
        ("grain", "height", "contacts"),
        [
            (Box((1.0, 0.6, 0.4)), 0.2, 4),
            (Box((1.0, 0.6, 0.4), 0.1), 0.2, 4),
            # Side 2 sqrt(2): a quarter of the height sqrt(2/3) s.
            (TETRAHEDRON, 1.0 / np.sqrt(3.0), 3),
            (CUBE, 0.5, 4),
            (Spheres([(0, 0, 0), (0.8, 0, 0), (0.4, 0.7, 0)], [0.5, 0.5, 0.5]), 0.5, 3),
        ],
        ids=["box", "rounded box", "tetrahedron", "cube", "triad"],
    )
    def test_falls_onto_a_face(self, grain, height, contacts):
        found = settle(grain, Plane(), above(0.0, 0.0))
        assert found.placement.centre[2] == pytest.approx(height, abs=1e-11)
        assert len(found.contacts) == contacts
        assert not flaws(found, grain, Plane())

    @pytest.mark.parametrize("subdivisions", [0, 1, pytest.param(2, marks=pytest.mark.slow)])
    def test_a_ball_of_triangles_rests_on_one_of_them(self, subdivisions):
        ball = trimesh.creation.icosphere(subdivisions, 0.5)
        grain = Triangulated(ball.vertices, ball.faces)
        found = settle(grain, Plane(), above(0.0, 0.0))
        # It comes as low as one of its triangles is near the centre.
        distances = (ball.face_normals * ball.triangles[:, 0]).sum(axis=1)
        assert np.abs(distances - found.placement.centre[2]).min() < 1e-9
        assert len(found.contacts) == 3
        assert not flaws(found, grain, Plane())

    def test_a_box_of_triangles_is_a_box(self):
        mesh = trimesh.creation.box((1.0, 0.6, 0.4))
        one, other = Triangulated(mesh.vertices, mesh.faces), Box((1.0, 0.6, 0.4))
        places = [settle(grain, Plane(), above(0.0, 0.0)).placement for grain in (one, other)]
        assert places[0].centre == pytest.approx(places[1].centre, abs=1e-9)
        assert places[0].rotation == pytest.approx(places[1].rotation, abs=1e-9)

    @pytest.mark.parametrize(("slope", "stays"), [(0.3, True), (0.45, True), (0.48, False)])
    def test_box_on_a_slope(self, slope, stays):
        grain, how = Box((1.0, 0.6, 0.4)), {"gravity": down(slope, 3), "friction": 0.5}
        found = settle(grain, Plane(), above(0.0, 0.0, rotation_by((0, 0, 0.5))), **how)
        if stays:
            assert not flaws(found, grain, Plane(), **how)
        else:
            assert (found.outcome, found.contacts) == (SettlingOutcome.ROLLS_OFF, None)

    @pytest.mark.parametrize(
        ("exponents", "turn", "height"),
        [
            pytest.param((4.0, 2.0), (0.1, 0.2, 0.1), 0.3, marks=pytest.mark.slow),
            ((10.0, 10.0), (0.3, 0.2, 0.1), 0.3),
            pytest.param((10.0, 10.0), (1.45, 0.0, 0.1), 0.4, marks=pytest.mark.slow),
        ],
    )
    def test_superquadric_lies_on_a_pole_without_curvature(self, exponents, turn, height):
        """On a side whose semi-axis is upright; the last start used to end after 2,000 steps."""
        grain = Superquadric((0.5, 0.4, 0.3), exponents)
        found = settle(grain, Plane(), above(0.6, 0.3, rotation_by(turn)), friction=0.5)
        assert found.stable and found.placement.centre[2] == pytest.approx(height, abs=1e-11)
        assert found.contacts.points[0, :2] == pytest.approx(found.placement.centre[:2], abs=1e-8)

    def test_superquadric_lies_on_its_side_which_is_curved_one_way_alone(self):
        """Its axis lies level and the shorter semi-axis across it upright, so that z = 0.5."""
        start = above(0.6, 0.3, rotation_by((1.45, 0.0, 0.1)))
        found = settle(Superquadric((0.6, 0.5, 0.4), (4.0, 2.0)), Plane(), start, friction=0.5)
        assert found.stable and found.steps < 200
        assert found.placement.centre[2] == pytest.approx(0.5, abs=1e-11)

    def test_box_on_a_sloping_plane(self):
        bed = Plane((0.2, 0.1), 0.3)
        found = settle(Box((1.0, 0.6, 0.4)), bed, above(0.0, 0.0), friction=0.5)
        assert found.placement.rotation @ [0, 0, 1] == pytest.approx(
            bed.normal([[0, 0]])[0], abs=1e-9
        )
        assert not flaws(found, Box((1.0, 0.6, 0.4)), bed, friction=0.5)


X, Y = np.meshgrid(np.linspace(-2.0, 2.0, 81), np.linspace(-2.0, 2.0, 81))


def height_map(heights):
    """A bed of these heights at X and Y, above z = 0.1."""
    return HeightMap(heights, (0.05, 0.05), (-2.0, -2.0, 0.1))


BOWL, TROUGH = height_map(0.3 * (X**2 + Y**2)), height_map(0.3 * (X**2 + 2.0 * Y**2))
EGG_CRATE = height_map(0.1 * (np.sin(2.0 * np.pi * X) + np.sin(2.0 * np.pi * Y / 1.2)))


class TestSolidsOnRoughBeds:
    @pytest.mark.parametrize("bed", [BOWL, pytest.param(TROUGH, marks=pytest.mark.slow)])
    def test_a_sphere_finds_the_bottom_of_a_bowl(self, bed):
        # Curvatures 0.6 and 1.2 there, less than 1/r: cubics reproduce the parabola.
        found = settle(Sphere(0.6), bed, above(0.6, 0.3))
        assert found.placement.centre == pytest.approx((0.0, 0.0, 0.4), abs=1e-7)
        assert not flaws(found, Sphere(0.6), bed)

    @pytest.mark.parametrize(
        ("grain", "bed", "friction"),
        [
            (Ellipsoid((0.7, 0.5, 0.4)), SphereBed.array(0.5, 1.0, "triangular"), 1.0),
            pytest.param(
                *(Ellipsoid((0.7, 0.5, 0.4)), SphereBed.array(0.5, 1.0, "triangular"), 0.0),
                marks=pytest.mark.slow,
            ),
            (CUBE, SphereBed.array(0.5, 1.0), 1.0),
            (
                Spheres([(0, 0, 0), (0.7, 0, 0), (0.4, 0.5, 0)], [0.5, 0.4, 0.3]),
                SphereBed.array(0.5, 1.0),
                1.0,
            ),
            (Box((0.6, 0.4, 0.3)), TROUGH, 1.0),
            (Box((1.0, 0.6, 0.4), 0.1), Ridges(0.1, 1.0), 1.0),
            pytest.param(Ellipsoid((0.5, 0.4, 0.3)), Ridges(0.1, 1.0), 1.0, marks=pytest.mark.slow),
            (Sphere(0.6), EGG_CRATE, 1.0),
            (Superquadric((0.5, 0.4, 0.3), (3.0, 3.0)), SphereBed.array(0.5, 1.0), 1.0),
        ],
        ids=lambda value: type(value).__name__,
    )
    def test_equilibrium(self, grain, bed, friction):
        found = settle(grain, bed, above(0.3, 0.15), friction=friction)
        assert not flaws(found, grain, bed, friction=friction)


# Placements, rests and contacts of grains in 3-D, from elementary geometry.


@functools.cache
def surface_points(name):
    """Points (n, 3) of a grain's surface, without those of its parts that lie inside it."""
    points = SOLIDS[name].surface(SOLIDS[name].size / 60.0).points
    return points[np.abs(SOLIDS[name].level(points)) < 1e-12]


class TestRestInSpace:
    """Heights at rest from elementary geometry, stated case by case."""

    def height(self, grain, bed, x, quaternion=0.0):
        return rest(grain, bed, x, quaternion).centre[2]

    def test_sphere_on_a_slope(self):
        # The contact is R along the normal: z = slope.x + R sqrt(1 + |slope|^2).
        expected = 0.1 + 0.3 * 2.0 - 0.2 * 1.0 + 0.5 * np.sqrt(1.0 + 0.09 + 0.04)
        assert self.height(Sphere(1.0), Plane((0.3, -0.2), 0.1), (2.0, 1.0)) == pytest.approx(
            expected, abs=1e-13
        )

    def test_sphere_on_a_ball_beside_its_top(self):
        # Distance of the centres R + r: z^2 = (R + r)^2 - |x|^2.
        expected = np.sqrt(0.9**2 - 0.2**2 - 0.1**2)
        assert self.height(Sphere(1.0), SphereBed.array(0.4, 3.0), (0.2, 0.1)) == pytest.approx(
            expected, abs=1e-12
        )

    @settings(max_examples=40, deadline=None)
    @given(vectors)
    def test_ellipsoid_on_a_plane_by_its_support_function(self, turn):
        # Downwards it reaches |diag(a, b, c) R^T e_z|.
        placement = Placement((0, 0, 0)).moved((0, 0, 0), turn)
        expected = np.linalg.norm(np.array([0.7, 0.5, 0.3]) * placement.rotation[2])
        height = self.height(Ellipsoid((0.7, 0.5, 0.3)), Plane(), (0.0, 0.0), placement.quaternion)
        assert height == pytest.approx(expected, abs=1e-12)

    @settings(max_examples=40, deadline=None)
    @given(vectors)
    def test_rounded_box_on_a_plane_by_its_support_function(self, turn):
        # The core reaches sum of half sides times |R_zi| down, the ball r more.
        placement = Placement((0, 0, 0)).moved((0, 0, 0), turn)
        expected = np.array([0.4, 0.2, 0.1]) @ np.abs(placement.rotation[2]) + 0.1
        height = self.height(Box((1.0, 0.6, 0.4), 0.1), Plane(), (0.0, 0.0), placement.quaternion)
        assert height == pytest.approx(expected, abs=1e-13)

    @pytest.mark.slow
    @settings(max_examples=40, deadline=None)
    @given(
        name=st.sampled_from(list(SOLIDS)),
        bed=st.sampled_from(list(TERRAINS.values())),
        turn=vectors,
        x=st.tuples(st.floats(-0.7, 0.7), st.floats(-0.7, 0.7)),
    )
    def test_resting_touches_and_enters_nowhere(self, name, bed, turn, x):
        solid = SOLIDS[name]
        placement = rest(solid, bed, x, rotation_by(turn))
        assert placement.centre[:2] == x
        distance, on_grain, on_bed = clearance(solid, placement, bed)
        assert distance == pytest.approx(0.0, abs=1e-12 * solid.size)
        assert solid.level(placement.to_body([on_grain])) == pytest.approx(0.0, abs=1e-9)
        assert bed.height(on_bed[None, :2]) == pytest.approx(on_bed[2], abs=1e-9)
        points = placement.to_scene(surface_points(name))
        assert (points[:, 2] - bed.height(points[:, :2])).min() >= -1e-12

    @pytest.mark.parametrize("gap", [0.003, 0.05])
    def test_lifted_out_of_a_pocket(self, gap):
        # The triangle of centres with sides R + r + gap.
        bed = SphereBed.array(0.5, 1.0, "triangular")
        x = (0.5, np.sqrt(1.0 / 12.0))
        raised = lifted(Sphere(1.0), rest(Sphere(1.0), bed, x), bed, gap)
        assert raised.centre[2] == pytest.approx(np.sqrt((1.0 + gap) ** 2 - 1.0 / 3.0), abs=1e-10)
        assert clearance(Sphere(1.0), raised, bed)[0] == pytest.approx(gap, abs=1e-10)

    def test_overlap_is_negative(self):
        assert clearance(Sphere(1.0), Placement((0.0, 0.0, 0.3)), Plane())[0] == pytest.approx(-0.2)


# Placements in space and in the plane: turns there and back, one after the other


class TestPlacementInSpace:
    @settings(max_examples=30, deadline=None)
    @given(vectors, vectors, vectors)
    def test_turns_are_rotations_and_go_there_and_back(self, turn, shift, point):
        placement = Placement((0.1, 0.2, 0.3)).moved(shift, turn)
        rotation = placement.rotation
        assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-14)
        assert np.linalg.det(rotation) == pytest.approx(1.0)
        x = np.array([point])
        assert placement.to_body(placement.to_scene(x)) == pytest.approx(x, abs=1e-13)
        # A rotation leaves its own axis in place.
        assert rotation @ np.array(turn) == pytest.approx(np.array(turn), abs=1e-12)

    def test_a_quarter_turn_about_the_vertical(self):
        placement = Placement((0.0, 0.0, 1.0)).moved((0, 0, 0), (0.0, 0.0, np.pi / 2))
        assert placement.to_scene([[1.0, 0.0, 0.0]]) == pytest.approx(np.array([[0.0, 1.0, 1.0]]))
        assert placement.raised(0.5).centre == (0.0, 0.0, 1.5)
        assert placement.raised(0.5).quaternion == placement.quaternion

    def test_turns_are_made_one_after_the_other(self):
        first, second = rotation_by((0.3, 0.0, 0.1)), rotation_by((0.0, -0.7, 0.2))
        both = Placement((0, 0, 0), quaternion=product(second, first)).rotation
        parts = [Placement((0, 0, 0), quaternion=q).rotation for q in (second, first)]
        assert both == pytest.approx(parts[0] @ parts[1])

    def test_in_the_plane_nothing_changes(self):
        placement = Placement((1.0, 2.0), 0.4)
        assert (placement.quaternion, placement.gdim) == (None, 2)
        assert placement.moved((0.5, 0.0), [0.1]) == Placement((1.5, 2.0), 0.5)

    @pytest.mark.parametrize(
        ("make", "reason"),
        [
            (lambda: Placement((0, 0, 0), 0.3), "no angle"),
            (lambda: Placement((0, 0), 0.0, (1, 0, 0, 0)), "no quaternion"),
            (lambda: Placement((0, 0, 0), quaternion=(1, 1, 0, 0)), "unit length"),
            (lambda: Placement((0, 0, 0), quaternion=(np.nan, 0, 0, 0)), "unit length"),
            (lambda: Placement((0, 0, np.inf)), "finite"),
        ],
    )
    def test_bad_placements_are_refused(self, make, reason):
        with pytest.raises(SceneError, match=reason):
            make()


# Contacts of grains in space: points, normals, lines and patches from elementary geometry


TOLERANCE = 1e-6
PYRAMID = Polyhedron([(0, 0, 0), (0.5, 0.5, 1), (-0.5, 0.5, 1), (0.5, -0.5, 1), (-0.5, -0.5, 1)])
UP = np.array([0.0, 0.0, 1.0])


def found(grain, bed, x=(0.0, 0.0), turn=(0.0, 0.0, 0.0), tolerance=TOLERANCE):
    """The contacts of a grain turned and lowered onto a bed, sorted by x, then y."""
    contacts = touching(grain, rest(grain, bed, x, rotation_by(turn)), bed, tolerance)
    order = np.lexsort(np.round(contacts.points[:, 1::-1].T, 9))
    areas = None if contacts.areas is None else contacts.areas[order]
    return contacts.points[order], contacts.normals[order], areas


def rows(count, direction=-UP):
    return np.tile(direction, (count, 1))


class TestPoints:
    def test_sphere_on_a_slope(self):
        # Slope 3/4: the normal out of the sphere is (3, 0, -4)/5.
        points, normals, _ = found(Sphere(1.0), Plane((0.75, 0.0)))
        assert normals == pytest.approx(np.array([[0.6, 0.0, -0.8]]), abs=1e-12)
        assert points[0, 2] == pytest.approx(0.75 * points[0, 0], abs=1e-12)

    @pytest.mark.parametrize(
        ("arrangement", "middle", "count"),
        [("square", (0.5, 0.5), 4), ("triangular", (0.5, np.sqrt(1.0 / 12.0)), 3)],
    )
    @pytest.mark.parametrize("spacing", [0.9, 1.0, 1.2])
    def test_sphere_in_a_pocket(self, arrangement, middle, count, spacing):
        # Contacts divide the lines from the sphere's centre to those of the half-balls by their radii 0.6 and 0.5.
        bed, middle = SphereBed.array(0.5, spacing, arrangement), spacing * np.array(middle)
        points, normals, areas = found(Sphere(1.2), bed, middle)
        centres = bed.near(middle, 0.75 * spacing - 0.5)[1]
        assert len(points) == len(centres) == count and areas is None
        height = np.sqrt(1.1**2 - ((centres[0, :2] - middle) ** 2).sum())
        away = centres - [*middle, height]
        away = away[np.lexsort(np.round(centres[:, 1::-1].T, 9))] / 1.1
        assert normals == pytest.approx(away, abs=1e-10)
        assert points == pytest.approx([*middle, height] + 0.6 * away, abs=1e-10)

    def test_ellipsoid_on_a_plane(self):
        # The lowest point of x = R A u is A^2 R^T n / |A R^T n| in the body, with n down.
        axes, turn = np.array([0.7, 0.5, 0.3]), (0.4, 0.7, 0.2)
        rotation = Placement((0, 0, 0), quaternion=rotation_by(turn)).rotation
        inward = rotation.T @ -UP
        lowest = rotation @ (axes**2 * inward / np.linalg.norm(axes * inward))
        points, normals, areas = found(Ellipsoid(tuple(axes)), Plane(), turn=turn)
        assert points[0, :2] == pytest.approx(lowest[:2], abs=1e-9)
        assert normals == pytest.approx(rows(1), abs=1e-9)
        assert (len(points), areas) == (1, None)

    def test_corner_takes_the_normal_of_the_bed(self):
        points, normals, areas = found(PYRAMID, Plane((0.75, 0.0)), (0.2, 0.1))
        assert points == pytest.approx(np.array([[0.2, 0.1, 0.15]]), abs=1e-12)
        assert normals == pytest.approx(np.array([[0.6, 0.0, -0.8]]), abs=1e-12)
        assert areas is None

    def test_face_on_half_balls_takes_its_own_normal(self):
        # A slab of sides 2 covers nine crests at spacing 0.9; collinear ones count by their ends: a 3 x 3 grid.
        points, normals, areas = found(Box((2.0, 2.0, 0.4)), SphereBed.array(0.3, 0.9))
        assert normals == pytest.approx(rows(len(points)), abs=1e-12)
        assert points[:, 2] == pytest.approx(0.3, abs=1e-12)
        assert points[[0, -1], :2] == pytest.approx(np.array([[-0.9, -0.9], [0.9, 0.9]]), abs=1e-9)
        assert len(points) == 9 and areas is None

    def test_edge_on_a_half_ball(self):
        # Turned by 45 degrees about x, the box stands with its edge along x on the crest below it.
        points, normals, _ = found(
            Box((0.8, 0.4, 0.4)), SphereBed.array(0.5, 4.0), turn=(0.25 * np.pi, 0, 0)
        )
        assert points == pytest.approx(np.array([[0.0, 0.0, 0.5]]), abs=1e-9)
        assert normals == pytest.approx(rows(1), abs=1e-9)

    def test_polyhedron_between_half_balls(self):
        # The tip between two half-balls of spacing 1 and radius 0.48; its faces rise 2:1.
        bed = SphereBed.array(0.48, 1.0, "square", (0.5, 0.0))
        points, normals, _ = found(PYRAMID, bed)
        n = np.array([2.0, 0.0, -1.0]) / np.sqrt(5.0)
        assert normals == pytest.approx(np.array([n * [-1, 1, 1], n]), abs=1e-9)
        assert points == pytest.approx(
            np.array([[-0.5, 0, 0], [0.5, 0, 0]]) - 0.48 * normals, abs=1e-9
        )

    def test_union_of_spheres_touches_with_each(self):
        grain = Spheres([(0, 0, 0), (0.8, 0, 0), (0.4, 0.7, 0)], [0.5, 0.5, 0.5])
        points, normals, areas = found(grain, Plane())
        # The centroid is 0.5 above the plane, each contact 0.5 below a centre.
        assert points == pytest.approx(np.array(grain.centres)[[0, 2, 1]], abs=1e-9)
        assert normals == pytest.approx(rows(3), abs=1e-12)
        assert areas is None


class TestLines:
    @pytest.mark.parametrize("radius", [0.0, 0.1])
    def test_an_edge_on_a_plane_counts_by_its_ends(self, radius):
        # About y by 45 degrees: the edge along y lies on the plane, shorter by the rounding.
        points, normals, areas = found(
            Box((1.0, 0.6, 0.4), radius), Plane(), turn=(0, 0.25 * np.pi, 0)
        )
        half = 0.3 - radius
        assert points[:, 1:] == pytest.approx(np.array([[-half, 0.0], [half, 0.0]]), abs=1e-9)
        assert normals == pytest.approx(rows(2), abs=1e-9)
        assert areas is None or not areas.any()

    def test_a_rod_lies_on_its_line(self):
        # Rounded until it is a capsule of radius 0.2: it touches along the 0.6 of its straight part.
        points, normals, areas = found(Box((1.0, 0.4, 0.4), 0.2), Plane())
        assert points == pytest.approx(np.array([[-0.3, 0, 0], [0.3, 0, 0]]), abs=1e-9)
        assert normals == pytest.approx(rows(2), abs=1e-9)
        assert areas is None or not areas.any()


class TestPatches:
    @pytest.mark.parametrize(("radius", "half"), [(0.0, (0.5, 0.3)), (0.1, (0.4, 0.2))])
    def test_box_on_a_plane_has_the_corners_of_its_face(self, radius, half):
        points, normals, areas = found(Box((1.0, 0.6, 0.4), radius), Plane())
        a, b = half
        assert points == pytest.approx(
            np.array([[-a, -b, 0], [-a, b, 0], [a, -b, 0], [a, b, 0]]), abs=1e-12
        )
        assert normals == pytest.approx(rows(4), abs=1e-12)
        assert areas == pytest.approx([a * b] * 4)

    def test_triangle_has_its_area_and_centroid(self):
        # Face of a tetrahedron of side 2 sqrt(2): area sqrt(3)/4 s^2, shares that keep the centroid.
        turn = np.arccos(1.0 / np.sqrt(3.0)) * np.array([1.0, -1.0, 0.0]) / np.sqrt(2.0)
        points, normals, areas = found(TETRAHEDRON, Plane(), turn=-turn)
        assert areas.sum() == pytest.approx(2.0 * np.sqrt(3.0))
        assert areas @ points / areas.sum() == pytest.approx(np.zeros(3), abs=1e-9)
        assert normals == pytest.approx(rows(3), abs=1e-9)

    def test_shares_of_an_uneven_face_keep_its_centroid(self):
        # A trapezium of parallel sides 2 and 1, height 1: centroid at (2 + 2)/(3 * 3) = 4/9 of the height.
        base = [(-1, 0), (1, 0), (0.5, 1), (-0.5, 1)]
        grain = Polyhedron([(x, y, z) for x, y in base for z in (0.0, 0.5)])
        points, _, areas = found(grain, Plane())
        assert areas.sum() == pytest.approx(1.5)
        assert areas @ points / areas.sum() == pytest.approx(np.zeros(3), abs=1e-12)
        assert points[:, 1].min() == pytest.approx(-4.0 / 9.0)

    def test_box_of_triangles_has_the_box_s_patch(self):
        box = Box((1.0, 0.6, 0.4))
        surface = box.surface(0.2)
        points, _, areas = found(Triangulated(surface.points, surface.triangles), Plane())
        expected, _, shares = found(box, Plane())
        assert points == pytest.approx(expected, abs=1e-9)
        assert areas == pytest.approx(shares)

    def test_box_lies_along_a_slope(self):
        # A slope of 3/4 is a turn about y by -atan(3/4).
        _, normals, areas = found(
            Box((1.0, 0.6, 0.4)), Plane((0.75, 0.0)), turn=(0, -np.arctan2(3, 4), 0)
        )
        assert normals == pytest.approx(rows(4, np.array([0.6, 0.0, -0.8])), abs=1e-12)
        assert areas.sum() == pytest.approx(0.6)

    def test_box_across_crests_touches_in_lines(self):
        # Crests of ridges at x = 1/4 + k: lines across the face, no area.
        points, normals, areas = found(Box((2.2, 0.6, 0.4)), Ridges(0.1, 1.0), (0.25, 0.0))
        assert np.unique(np.round(points[:, 0], 6)) == pytest.approx([-0.75, 0.25, 1.25])
        assert np.abs(points[:, 1]).max() == pytest.approx(0.3, abs=1e-9)
        assert normals == pytest.approx(rows(len(points)), abs=1e-9)
        assert areas is None or not areas.any()


GRAINS_IN_SPACE = {
    "sphere": (Sphere(1.0), SphereBed.array(0.5, 1.0, "triangular"), (0.5, np.sqrt(1.0 / 12.0)), 3),
    "box": (Box((1.0, 0.6, 0.4)), Plane(), (0.0, 0.0), 4),
    "rounded box": (Box((1.0, 0.6, 0.4), 0.1), Plane(), (0.0, 0.0), 4),
    "ellipsoid": (Ellipsoid((0.7, 0.5, 0.3)), Plane(), (0.0, 0.0), 1),
}
grains = pytest.mark.parametrize(
    ("grain", "bed", "x", "count"), GRAINS_IN_SPACE.values(), ids=GRAINS_IN_SPACE.keys()
)


class TestTolerance:
    @grains
    def test_just_below_and_above_the_gap(self, grain, bed, x, count):
        gap = 1e-4
        placement = rest(grain, bed, x)
        # Straight up, the distance from a piece grows as the vertical part of its normal.
        raised = placement.raised(gap / abs(touching(grain, placement, bed, 1e-9).normals[0, 2]))
        with pytest.raises(
            SceneError, match=r"does not touch the bed within .*; settle it on the bed"
        ):
            touching(grain, raised, bed, 0.99 * gap)
        assert len(touching(grain, raised, bed, 1.01 * gap)) == count

    def test_tilted_within_the_tolerance_it_is_still_a_patch(self):
        grain, tilt = Box((1.0, 0.6, 0.4)), rotation_by((0.0, 1e-5, 0.0))
        placement = rest(grain, Plane(), (0.0, 0.0), tilt)
        assert touching(grain, placement, Plane(), 2e-5).areas.sum() == pytest.approx(0.6)
        assert len(touching(grain, placement, Plane(), 5e-6)) == 2

    def test_planar_and_spatial_do_not_mix(self):
        for grain, placement, bed in (
            (Disc(1.0), Placement((0, 0.5)), Plane()),
            (Sphere(1.0), Placement((0, 0, 0.5)), Flat()),
        ):
            with pytest.raises(SceneError, match="one is planar, the other is not"):
                touching(grain, placement, bed, TOLERANCE)


class TestFrames:
    @grains
    @pytest.mark.parametrize("scale", [1e-3, 1e3])
    def test_scale_does_not_matter(self, grain, bed, x, count, scale):
        larger = {
            Sphere: lambda: Sphere(scale),
            Box: lambda: Box(tuple(scale * s for s in grain.sides), scale * grain.edge_radius),
            Ellipsoid: lambda: Ellipsoid(tuple(scale * a for a in grain.semi_axes)),
        }[type(grain)]()
        on = (
            Plane() if isinstance(bed, Plane) else SphereBed.array(0.5 * scale, scale, "triangular")
        )
        points, normals, areas = found(larger, on, scale * np.array(x), tolerance=TOLERANCE * scale)
        expected, directions, shares = found(grain, bed, x)
        assert points / scale == pytest.approx(expected, abs=1e-10)
        assert normals == pytest.approx(directions, abs=1e-10)
        assert (areas is None) == (shares is None)
        assert areas is None or areas / scale**2 == pytest.approx(shares)

    @pytest.mark.parametrize("angle", [0.3, 1.0, 2.5])
    @pytest.mark.parametrize("name", ["box", "rounded box", "ellipsoid"])
    def test_turned_about_the_vertical_and_shifted(self, name, angle):
        grain, bed, _, _ = GRAINS_IN_SPACE[name]
        tilt = rotation_by((0.2, 0.1, 0.0)) if name == "ellipsoid" else (1.0, 0.0, 0.0, 0.0)
        turn = rotation_by((0.0, 0.0, angle))
        first = touching(grain, rest(grain, bed, (0, 0), tilt), bed, TOLERANCE)
        other = touching(grain, rest(grain, bed, (3.0, -2.0), product(turn, tilt)), bed, TOLERANCE)
        rotation = Placement((0, 0, 0), quaternion=turn).rotation
        expected = first.points @ rotation.T + [3.0, -2.0, 0.0]
        apart = np.linalg.norm(other.points[:, None] - expected, axis=2)
        assert apart.min(axis=1) == pytest.approx(0.0, abs=1e-9)
        assert apart.min(axis=0) == pytest.approx(0.0, abs=1e-9)
        assert (other.areas is None) == (first.areas is None)
