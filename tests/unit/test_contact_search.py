"""Contacts of a resting grain and gaps of one near its bed in 2-D: elementary geometry."""

import math

import numpy as np
import pytest

from incipient.contact import Contacts, Load, touching
from incipient.errors import SceneError
from incipient.geometry import (
    Disc,
    Ellipse,
    Flat,
    HalfDiscs,
    Placement,
    Polygon,
    Polyline,
    Rectangle,
    Sinusoidal,
    lifted,
    rest,
)
from incipient.geometry.closest import NearBed
from incipient.geometry.plane.beds import Bed

TOLERANCE = 1e-6
WEDGE = Polygon([(0.0, 0.0), (0.5, 1.0), (-0.5, 1.0)])  # stands on its corner


def found(grain, bed, x, angle=0.0):
    """The contacts of a grain lowered onto a bed, sorted from left to right."""
    contacts = touching(grain, rest(grain, bed, x, angle), bed, TOLERANCE)
    order = np.lexsort(np.column_stack([contacts.normals[:, 0], contacts.points[:, 0]]).T)
    areas = None if contacts.areas is None else contacts.areas[order]
    return contacts.points[order], contacts.normals[order], areas


def plane(*rows):
    """Rows of the plane as rows of space."""
    return np.array([[x, y, 0.0] for x, y in rows])


class TestPoints:
    def test_disc_on_a_plane(self):
        points, normals, areas = found(Disc(1.0), Flat(0.2), 3.0)
        assert points == pytest.approx(plane((3.0, 0.2)), abs=1e-12)
        assert normals == pytest.approx(plane((0.0, -1.0)), abs=1e-12)
        assert areas is None

    def test_disc_on_a_slope(self):
        # Slope 3/4: the normal out of the disc is (3, -4)/5, the contact half a diameter along it.
        bed = Polyline([(-4.0, -3.0), (4.0, 3.0)])
        placement = rest(Disc(1.0), bed, 0.4)
        points, normals, _ = found(Disc(1.0), bed, 0.4)
        assert normals == pytest.approx(plane((0.6, -0.8)), abs=1e-12)
        assert points == pytest.approx(
            plane(placement.centre) + 0.5 * plane((0.6, -0.8)), abs=1e-12
        )

    def test_disc_in_a_pocket_touches_both_half_discs(self):
        # Equal radii that touch: the three centres are the corners of an equilateral triangle of side 1.
        points, normals, areas = found(Disc(1.0), HalfDiscs(0.5, 1.0), 0.5)
        assert points == pytest.approx(
            plane((0.25, np.sqrt(3) / 4), (0.75, np.sqrt(3) / 4)), abs=1e-11
        )
        assert normals == pytest.approx(
            plane((-0.5, -np.sqrt(3) / 2), (0.5, -np.sqrt(3) / 2)), abs=1e-11
        )
        assert areas is None

    def test_disc_beside_the_middle_of_a_pocket_touches_one(self):
        points, normals, _ = found(Disc(1.0), HalfDiscs(0.5, 1.0), 0.6)
        assert len(points) == 1
        # The centre of the half-disc at x = 1 lies on the normal.
        assert points[0] + 0.5 * normals[0] == pytest.approx([1.0, 0.0, 0.0], abs=1e-11)

    def test_disc_between_two_waves(self):
        points, normals, _ = found(Disc(0.5), Sinusoidal(0.3, 0.8), 0.6)
        assert len(points) == 2
        assert points.mean(axis=0)[0] == pytest.approx(0.6, abs=1e-11)
        assert normals[0] == pytest.approx(normals[1] * [-1.0, 1.0, 1.0], abs=1e-11)

    def test_ellipse_has_its_own_normal(self):
        grain, bed = Ellipse((0.7, 0.3)), HalfDiscs(0.3, 1.0)
        placement = rest(grain, bed, 0.2, 0.5)
        points, normals, _ = found(grain, bed, 0.2, 0.5)
        outward = grain.normal(placement.to_body(points[:, :2])) @ placement.rotation.T
        assert normals[:, :2] == pytest.approx(outward, abs=1e-9)
        # And it is minus that of the bed, because both are smooth there.
        assert normals[:, :2] == pytest.approx(-bed.normal(points[:, 0]), abs=1e-6)

    def test_corner_of_the_grain_takes_the_normal_of_the_bed(self):
        bed = Polyline([(-4.0, -3.0), (4.0, 3.0)])
        points, normals, areas = found(WEDGE, bed, 0.0)
        assert normals == pytest.approx(plane((0.6, -0.8)), abs=1e-12)
        assert points == pytest.approx(plane((0.0, 0.0)), abs=1e-12)
        assert areas is None

    def test_corner_of_the_bed_takes_the_normal_of_the_grain(self):
        bed = Polyline([(-3.0, -1.0), (0.1, 0.25), (3.0, -2.0)])
        points, normals, _ = found(Rectangle(1.0, 0.5), bed, 0.0)
        assert points == pytest.approx(plane((0.1, 0.25)), abs=1e-12)
        assert normals == pytest.approx(plane((0.0, -1.0)), abs=1e-12)

    def test_corner_on_corner_takes_the_bisector_of_the_bed(self):
        # Sides of the bed at 45 degrees up and level: their normals enclose 45 degrees.
        bed = Polyline([(-3.0, -3.0), (0.0, 0.0), (3.0, 0.0)])
        _, normals, _ = found(WEDGE, bed, 0.0)
        assert normals == pytest.approx(plane((np.sin(np.pi / 8), -np.cos(np.pi / 8))), abs=1e-12)

    def test_corner_in_a_valley_has_two_contacts(self):
        # Valley sides of slope -1/2 and 1, both flatter than the wedge's of slope 2.
        points, normals, _ = found(WEDGE, Polyline([(-2.0, 1.0), (0.0, 0.0), (2.0, 2.0)]), 0.0)
        assert points == pytest.approx(plane((0.0, 0.0), (0.0, 0.0)), abs=1e-12)
        left, right = np.array([-1.0, -2.0]) / np.sqrt(5.0), np.array([1.0, -1.0]) / np.sqrt(2.0)
        assert normals == pytest.approx(plane(left, right), abs=1e-12)


class TestPatches:
    @pytest.mark.parametrize(("radius", "half"), [(0.0, 0.5), (0.1, 0.4)])
    def test_box_on_a_plane_has_the_ends_of_its_base(self, radius, half):
        points, normals, areas = found(Rectangle(1.0, 0.5, radius), Flat(), 0.0)
        assert points == pytest.approx(plane((-half, 0.0), (half, 0.0)), abs=1e-12)
        assert normals == pytest.approx(plane((0.0, -1.0), (0.0, -1.0)), abs=1e-12)
        assert areas == pytest.approx([half, half])

    def test_box_on_a_slope(self):
        bed = Polyline([(-4.0, -3.0), (4.0, 3.0)])
        _, normals, areas = found(Rectangle(1.0, 0.5), bed, 0.0, np.arctan2(3.0, 4.0))
        assert normals == pytest.approx(plane((0.6, -0.8), (0.6, -0.8)), abs=1e-12)
        assert areas == pytest.approx([0.5, 0.5])

    def test_points_of_a_polyline_do_not_split_a_patch(self):
        bed = Polyline([(-3.0, 0.0), (-0.1, 0.0), (0.2, 0.0), (3.0, 0.0)])
        points, _, areas = found(Rectangle(1.0, 0.5), bed, 0.1)
        assert points == pytest.approx(plane((-0.4, 0.0), (0.6, 0.0)), abs=1e-12)
        assert areas == pytest.approx([0.5, 0.5])

    def test_box_across_two_plateaux_and_a_peak(self):
        bed = Polyline(
            [(-3, 0), (-0.3, 0), (-0.2, -0.3), (0.0, 0.0), (0.1, -0.2), (0.4, 0), (3, 0)]
        )
        points, normals, areas = found(Rectangle(1.0, 1.0), bed, 0.0)
        assert points == pytest.approx(
            plane((-0.5, 0), (-0.3, 0), (0, 0), (0.4, 0), (0.5, 0)), abs=1e-12
        )
        assert normals == pytest.approx(np.tile([0.0, -1.0, 0.0], (5, 1)), abs=1e-12)
        assert areas == pytest.approx([0.1, 0.1, 0.0, 0.05, 0.05])

    def test_box_on_three_crests_has_three_points(self):
        points, _, areas = found(Rectangle(1.0, 0.5), HalfDiscs(0.1, 0.4), 0.0)
        assert points == pytest.approx(plane((-0.4, 0.1), (0.0, 0.1), (0.4, 0.1)), abs=1e-9)
        assert areas is None

    def test_box_on_the_base_line_between_half_discs(self):
        points, _, areas = found(Rectangle(0.8, 0.8), HalfDiscs(0.2, 2.0, 1.0), 0.0)
        assert points == pytest.approx(plane((-0.4, 0.0), (0.4, 0.0)), abs=1e-12)
        assert areas == pytest.approx([0.4, 0.4])


class TestTolerance:
    def test_lifted_grain_touches_only_within_the_gap(self):
        grain, bed = Disc(1.0), HalfDiscs(0.5, 1.0)
        raised = lifted(grain, rest(grain, bed, 0.5), bed, 1e-3)
        with pytest.raises(SceneError, match="does not touch"):
            touching(grain, raised, bed, 1e-4)
        assert len(touching(grain, raised, bed, 2e-3)) == 2

    def test_tolerance_must_be_positive(self):
        with pytest.raises(SceneError, match="tolerance"):
            touching(Disc(1.0), Placement((0.0, 0.5)), Flat(), 0.0)

    @pytest.mark.parametrize("scale", [1e-3, 1e3])
    def test_scale_does_not_matter(self, scale):
        grain, bed = Disc(scale), HalfDiscs(0.5 * scale, scale)
        contacts = touching(grain, rest(grain, bed, 0.5 * scale), bed, TOLERANCE * scale)
        assert contacts.points[:, 0] / scale == pytest.approx([0.25, 0.75], abs=1e-11)


class TestBadInput:
    """Each is one clear line."""

    DOWN = ((0.0, -1.0, 0.0),)

    @pytest.mark.parametrize(
        ("points", "normals", "areas", "reason"),
        [
            ([], [], None, "none"),
            ([[0, 0]], [[0, -1]], None, "shape"),
            ([[0, 0, 0]], [[0, -1, 0]] * 2, None, "1 points but 2 normals"),
            ([[0, 0, np.nan]], DOWN, None, "finite"),
            ([[0, 0, 0]], [[0, -1.01, 0]], None, "normal 0 has length 1.01"),
            ([[0, 0, 0]], [[0, 0, 0]], None, "length 0"),
            ([[0, 0, 0]], DOWN, [1.0, 2.0], "areas have shape"),
            ([[0, 0, 0]], DOWN, [-1.0], "not negative"),
        ],
    )
    def test_contacts(self, points, normals, areas, reason):
        with pytest.raises(SceneError, match=reason) as caught:
            Contacts(points, normals, areas)
        assert "\n" not in str(caught.value)

    def test_load(self):
        zero = np.zeros(3)
        with pytest.raises(SceneError, match="flow_couple has shape"):
            Load(zero, 1.0, zero, zero)
        with pytest.raises(SceneError, match=r"weight is .* finite"):
            Load(zero, zero, [0.0, np.inf, 0.0], zero)

    def test_input_is_copied_and_kept(self):
        points = np.array([[0.0, 0.0, 0.0]])
        contacts = Contacts(points, self.DOWN)
        points += 1.0
        assert contacts.points == pytest.approx(0.0)
        with pytest.raises(ValueError, match="read-only"):
            contacts.points[0, 0] = 1.0


RIDGE = Polyline(
    ((-9.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.5, 0.2), (1.0, 0.2), (1.4, -0.3), (9.0, 0.4))
)


def test_a_disc_between_two_half_discs_touches_both() -> None:
    """Its centre is sqrt((r + R)^2 - (s/2)^2) high where it rests: the triangle of centres."""
    height = math.sqrt(0.75)
    found = NearBed(Disc(1.0), HalfDiscs(0.5, 1.0)).gaps(Placement((0.5, height)), 0.1)
    assert found.gaps == pytest.approx([0.0, 0.0], abs=1e-12)
    assert sorted(found.normals[:, 0]) == pytest.approx([-0.5, 0.5], abs=1e-12)
    assert found.normals[:, 1] == pytest.approx([height, height])


@pytest.mark.parametrize("bed", [Flat(0.0), HalfDiscs(0.5, 1.0), HalfDiscs(0.3, 1.0), RIDGE])
def test_a_disc_is_nearest_where_the_bed_is_nearest_to_its_centre(bed: Bed) -> None:
    """The least gap is the distance of the bed from the centre less the radius, along the line to the nearest point."""
    random = np.random.default_rng(25)
    for radius, x, above in random.uniform((0.2, -2.0, 0.001), (0.8, 2.0, 0.6), (24, 3)):
        centre = np.array([x, float(bed.height([x])[0]) + radius + above])
        distance = float(bed.distance(centre[None])[0])
        if not radius < distance < radius + 0.3:
            continue
        found = NearBed(Disc(2.0 * radius), bed).gaps(Placement(tuple(centre)), 0.3)
        least = int(np.argmin(found.gaps))
        assert found.gaps[least] == pytest.approx(distance - radius, abs=1e-12)
        foot = bed.nearest(centre[None])[0]
        assert found.feet[least] == pytest.approx(foot, abs=1e-8)
        assert found.normals[least] == pytest.approx((centre - foot) / distance, abs=1e-8)
