"""Contacts of grains in space: points, normals, lines and patches from elementary geometry."""

import numpy as np
import pytest
from every_shape import TETRAHEDRON

from incipient.contact import touching
from incipient.errors import SceneError
from incipient.geometry import (
    Box,
    Disc,
    Ellipsoid,
    Flat,
    Placement,
    Plane,
    Polyhedron,
    Ridges,
    Sphere,
    SphereBed,
    Spheres,
    Triangulated,
    rest,
)
from incipient.geometry.placement import product, rotation_by

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


GRAINS = {
    "sphere": (Sphere(1.0), SphereBed.array(0.5, 1.0, "triangular"), (0.5, np.sqrt(1.0 / 12.0)), 3),
    "box": (Box((1.0, 0.6, 0.4)), Plane(), (0.0, 0.0), 4),
    "rounded box": (Box((1.0, 0.6, 0.4), 0.1), Plane(), (0.0, 0.0), 4),
    "ellipsoid": (Ellipsoid((0.7, 0.5, 0.3)), Plane(), (0.0, 0.0), 1),
}
grains = pytest.mark.parametrize(("grain", "bed", "x", "count"), GRAINS.values(), ids=GRAINS.keys())


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
        grain, bed, _, _ = GRAINS[name]
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
