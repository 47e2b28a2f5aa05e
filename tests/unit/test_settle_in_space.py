"""Settling in space: spheres in pockets, solids on planes and on rough beds, searched for flaws from the outside."""

import numpy as np
import pytest
import trimesh
from every_shape import TETRAHEDRON
from settling import above, after_a_period, down, flaws

from incipient.geometry import (
    Box,
    Ellipsoid,
    HeightMap,
    Placement,
    Plane,
    Polyhedron,
    Ridges,
    SettlingOutcome,
    Sphere,
    SphereBed,
    Spheres,
    Superquadric,
    Triangulated,
    settle,
)
from incipient.geometry.placement import rotation_by

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
