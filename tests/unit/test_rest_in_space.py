"""Placements, rests and contacts of grains in 3-D, from elementary geometry."""

import functools

import numpy as np
import pytest
from every_shape import SOLIDS, TERRAINS, TETRAHEDRON, vectors
from hypothesis import given, settings
from hypothesis import strategies as st

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
    clearance,
    lifted,
    rest,
)
from incipient.geometry.placement import product, rotation_by


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
