"""A grain on its bed in the plane: resting, contacts, gaps, the closed space beside them, by elementary geometry."""

from itertools import pairwise

import numpy as np
import pytest
from every_shape import BEDS, GRAINS, dense
from hypothesis import given, settings
from hypothesis import strategies as st

from incipient.contact import Contacts, Load, touching
from incipient.coupled.tractions import load_of
from incipient.errors import SceneError
from incipient.geometry import (
    Disc,
    Discs,
    Ellipse,
    Flat,
    HalfDiscs,
    Placement,
    Polygon,
    Polyline,
    Rectangle,
    Sinusoidal,
    Superellipse,
    clearance,
    lifted,
    rest,
)
from incipient.geometry.closest import proximity
from incipient.geometry.plane.beds import Bed
from incipient.geometry.plane.closing import closing
from incipient.geometry.plane.curves import part

# Heights of centres at rest, by elementary geometry: triangles of centres, the support function of an ellipse, ...
AT_REST = {
    "disc on a plane": (Disc(1.0), Flat(0.3), 2.0, 0.0, 0.8),
    "disc in a pocket": (Disc(1.0), HalfDiscs(0.4, 1.0), 0.5, 0.0, np.sqrt(0.9**2 - 0.5**2)),
    "disc on a slope": (
        *(Disc(1.0), Polyline([(-4.0, -2.0), (4.0, 2.0)]), 1.0, 0.0),
        0.5 + 0.5 * np.hypot(1.0, 0.5),
    ),
    **{
        f"ellipse turned by {a:.1f}": (
            *(Ellipse((0.7, 0.3)), Flat(), 0.0, a),
            np.hypot(0.7 * np.sin(a), 0.3 * np.cos(a)),
        )
        for a in (0.0, 0.3, np.pi / 2, -2.0)
    },
    "square on its corner": (Rectangle(1.0, 1.0), Flat(), 0.0, np.pi / 4, np.sqrt(0.5)),
    "square on its side": (Rectangle(1.0, 1.0), Flat(), 0.0, 0.0, 0.5),
    "box on a peak between samples of its side": (
        *(Rectangle(1.0, 0.5), Polyline([(-3.0, -1.0), (0.1234567, 0.25), (3.0, -2.0)]), 0.0, 0.0),
        0.5,
    ),
    "disc on a crest": (Disc(1.0), Sinusoidal(0.02, 1.0), 0.25, 0.0, 0.52),
    "disc in a trough": (Disc(1.0), Sinusoidal(0.02, 1.0), 0.75, 0.0, 0.48),
}


class TestRest:
    def height(self, grain, bed, x, angle=0.0):
        return rest(grain, bed, x, angle).centre[1]

    @pytest.mark.parametrize("case", AT_REST.values(), ids=AT_REST.keys())
    def test_height(self, case):
        assert self.height(*case[:4]) == pytest.approx(case[4], abs=1e-12)

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


SLOPE = Polyline([(-4.0, -3.0), (4.0, 3.0)])  # its normal is (-3, 4)/5
DOWN, HIGH = (0.0, -1.0), np.sqrt(3.0) / 4.0
PLATEAUX = [(-3, 0), (-0.3, 0), (-0.2, -0.3), (0.0, 0.0), (0.1, -0.2), (0.4, 0), (3, 0)]
# Grain, bed, x, angle; points, normals and areas of the contacts from left to right
TOUCHING = {
    "disc on a plane": (Disc(1.0), Flat(0.2), 3.0, 0.0, [(3.0, 0.2)], [DOWN], None),
    "disc on a slope": (Disc(1.0), SLOPE, 0.4, 0.0, [(0.7, 0.525)], [(0.6, -0.8)], None),
    "disc on two half-discs": (
        *(Disc(1.0), HalfDiscs(0.5, 1.0), 0.5, 0.0),
        *([(0.25, HIGH), (0.75, HIGH)], [(-0.5, -2.0 * HIGH), (0.5, -2.0 * HIGH)], None),
    ),
    "corner on a slope": (WEDGE, SLOPE, 0.0, 0.0, [(0.0, 0.0)], [(0.6, -0.8)], None),
    "side on a corner of the bed": (
        *(Rectangle(1.0, 0.5), Polyline([(-3.0, -1.0), (0.1, 0.25), (3.0, -2.0)]), 0.0, 0.0),
        *([(0.1, 0.25)], [DOWN], None),
    ),
    "corner on corner: the bisector of 45 degrees and level": (
        *(WEDGE, Polyline([(-3.0, -3.0), (0.0, 0.0), (3.0, 0.0)]), 0.0, 0.0),
        *([(0.0, 0.0)], [(np.sin(np.pi / 8), -np.cos(np.pi / 8))], None),
    ),
    "corner in a valley of slopes -1/2 and 1": (
        *(WEDGE, Polyline([(-2.0, 1.0), (0.0, 0.0), (2.0, 2.0)]), 0.0, 0.0, [(0.0, 0.0)] * 2),
        *([(-1.0 / 5.0**0.5, -2.0 / 5.0**0.5), (0.5**0.5, -(0.5**0.5))], None),
    ),
    "box on a plane": (
        *(Rectangle(1.0, 0.5), Flat(), 0.0, 0.0),
        *([(-0.5, 0.0), (0.5, 0.0)], [DOWN] * 2, [0.5, 0.5]),
    ),
    "rounded box on a plane": (
        *(Rectangle(1.0, 0.5, 0.1), Flat(), 0.0, 0.0),
        *([(-0.4, 0.0), (0.4, 0.0)], [DOWN] * 2, [0.4, 0.4]),
    ),
    "box on a slope": (
        *(Rectangle(1.0, 0.5), SLOPE, 0.0, np.arctan2(3.0, 4.0)),
        *([(-0.25, -0.1875), (0.55, 0.4125)], [(0.6, -0.8)] * 2, [0.5, 0.5]),
    ),
    "points of a level polyline do not split a patch": (
        *(Rectangle(1.0, 0.5), Polyline([(-3, 0), (-0.1, 0), (0.2, 0), (3, 0)]), 0.1, 0.0),
        *([(-0.4, 0.0), (0.6, 0.0)], [DOWN] * 2, [0.5, 0.5]),
    ),
    "box across two plateaux and a peak": (
        *(Rectangle(1.0, 1.0), Polyline(PLATEAUX), 0.0, 0.0),
        [(-0.5, 0), (-0.3, 0), (0, 0), (0.4, 0), (0.5, 0)],
        *([DOWN] * 5, [0.1, 0.1, 0.0, 0.05, 0.05]),
    ),
    "box on three crests": (
        *(Rectangle(1.0, 0.5), HalfDiscs(0.1, 0.4), 0.0, 0.0),
        *([(-0.4, 0.1), (0.0, 0.1), (0.4, 0.1)], [DOWN] * 3, None),
    ),
    "box between half-discs": (
        *(Rectangle(0.8, 0.8), HalfDiscs(0.2, 2.0, 1.0), 0.0, 0.0),
        *([(-0.4, 0.0), (0.4, 0.0)], [DOWN] * 2, [0.4, 0.4]),
    ),
}


class TestContacts:
    @pytest.mark.parametrize("case", TOUCHING.values(), ids=TOUCHING.keys())
    def test_points_normals_and_areas(self, case):
        points, normals, areas = found(*case[:4])
        assert points == pytest.approx(plane(*case[4]), abs=1e-12)
        assert normals == pytest.approx(plane(*case[5]), abs=1e-12)
        assert (areas is None) == (case[6] is None)
        assert areas is None or areas == pytest.approx(case[6])

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


class TestTolerance:
    def test_lifted_grain_touches_only_within_the_gap(self):
        grain, bed = Disc(1.0), HalfDiscs(0.5, 1.0)
        raised = lifted(grain, rest(grain, bed, 0.5), bed, 1e-3)
        with pytest.raises(SceneError, match="does not touch"):
            touching(grain, raised, bed, 1e-4)
        assert len(touching(grain, raised, bed, 2e-3)) == 2

    def test_tolerance_must_be_positive(self):
        for tolerance in (0.0, float("nan")):
            with pytest.raises(SceneError, match="not a positive length"):
                touching(Disc(1.0), Placement((0.0, 0.5)), Flat(), tolerance)

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


@pytest.mark.parametrize("bed", [Flat(0.0), HalfDiscs(0.5, 1.0), HalfDiscs(0.3, 1.0), RIDGE])
def test_a_disc_is_nearest_where_the_bed_is_nearest_to_its_centre(bed: Bed) -> None:
    """The least gap is the distance of the bed from the centre less the radius, along the line to the nearest point."""
    random = np.random.default_rng(25)
    for radius, x, above in random.uniform((0.2, -2.0, 0.001), (0.8, 2.0, 0.6), (24, 3)):
        centre = np.array([x, float(bed.height([x])[0]) + radius + above])
        distance = float(bed.distance(centre[None])[0])
        if not radius < distance < radius + 0.3:
            continue
        found = proximity(Disc(2.0 * radius), bed).gaps(Placement(tuple(centre)), 0.3)
        least = int(np.argmin(found.gaps))
        assert found.gaps[least] == pytest.approx(distance - radius, abs=1e-12)
        foot = bed.nearest(centre[None])[0]
        assert found.feet[least] == pytest.approx(foot, abs=1e-8)
        assert found.normals[least] == pytest.approx((centre - foot) / distance, abs=1e-8)


CLOSED_GRAINS = {
    "disc": Disc(1.0),
    "ellipse": Ellipse((0.7, 0.4)),
    "square": Polygon([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]),
    "superellipse": Superellipse((0.6, 0.4), 3.0),
    "two discs": Discs([[0.0, 0.0], [0.7, 0.0]], [0.4, 0.5]),
}
CLOSED_BEDS = {"flat": Flat(), "wavy": Sinusoidal(0.3, 1.5), "half-discs": HalfDiscs(0.5, 1.2)}


def closed(grain, bed, x=0.6, angle=0.0, width=0.01):
    placement = rest(grain, bed, x, angle)
    contacts = touching(grain, placement, bed, 1e-6).points[:, :2]
    return closing(
        tuple(curve.moved(placement) for curve in grain.drawn()), bed, contacts, width
    ), placement


@pytest.mark.parametrize("angle", [0.0, 0.3])
@pytest.mark.parametrize("bed", CLOSED_BEDS)
@pytest.mark.parametrize("grain", CLOSED_GRAINS)
def test_the_lines_are_as_long_as_the_width_and_the_outline_goes_from_one_to_the_other(
    grain, bed, angle
):
    found, _ = closed(CLOSED_GRAINS[grain], CLOSED_BEDS[bed], angle=angle)
    for line in (found.left, found.right):
        assert line.length == pytest.approx(
            0.01, rel=0.03
        )  # where a crumb of a curve is left out it is longer
        assert CLOSED_BEDS[bed].distance([line.start])[0] == pytest.approx(0.0, abs=1e-9)
    x = found.contacts[:, 0]
    assert found.left.start[0] <= x.min() and x.max() <= found.right.start[0]
    assert found.outline[0].start == pytest.approx(found.right.end, abs=1e-9)
    assert found.outline[-1].end == pytest.approx(found.left.end, abs=1e-9)
    for one, other in pairwise(found.outline):
        assert one.end == pytest.approx(other.start, abs=1e-9)
    s = np.linspace(0.0, 1.0, 50)
    distances = CLOSED_BEDS[bed].distance(np.vstack([curve.point(s) for curve in found.outline]))
    assert distances.min() > (0.0099 if grain == "disc" else 0.0)


@pytest.mark.parametrize("grain", CLOSED_GRAINS)
def test_a_pressure_that_is_the_same_all_round_neither_pushes_nor_turns(grain):
    """What is enclosed and what is exposed close the outline; the second by quadrature along its curves."""
    found, placement = closed(CLOSED_GRAINS[grain], CLOSED_BEDS["wavy"], angle=0.3)
    s = np.linspace(0.0, 1.0, 2001)
    exposed = np.vstack([curve.point(s) for curve in found.outline]) - placement.centre
    force, couple = load_of(exposed, np.full(len(exposed) - 1, 3.0))
    below = np.vstack([found.left.end, found.contacts, found.right.end]) - placement.centre
    others = load_of(below, np.full(len(below) - 1, 3.0))
    assert force + others[0] == pytest.approx(0.0, abs=1e-8)
    assert couple + others[1] == pytest.approx(0.0, abs=1e-8)


def test_the_load_of_a_pressure_below_a_disc_is_its_integral():
    """On the lower right quarter of a unit circle it is p (-1, 1), through the circle's centre."""
    angles = np.linspace(-np.pi / 2, 0.0, 3)
    arms = np.column_stack([2.0 + np.cos(angles), np.sin(angles)])
    force, couple = load_of(arms, np.array([1.5, 1.5]))
    # The centre lies two to the right of where the couple is about.
    assert force == pytest.approx([-1.5, 1.5, 0.0])
    assert couple == pytest.approx([0.0, 0.0, 2.0 * 1.5])


def test_a_part_of_a_curve_lies_on_it():
    for grain in CLOSED_GRAINS.values():
        curve = grain.drawn()[0]
        found = part(curve, 0.2, 0.7)
        assert found.start == pytest.approx(curve.point([0.2])[0], abs=1e-12)
        assert found.end == pytest.approx(curve.point([0.7])[0], abs=1e-12)
        middle = grain.level(found.point([0.5]))
        assert middle == pytest.approx(0.0, abs=1e-6)


def test_a_space_that_is_nowhere_wider_is_refused():
    with pytest.raises(SceneError, match=r"contact\.gap"):
        closed(CLOSED_GRAINS["disc"], CLOSED_BEDS["flat"], width=2.0)
