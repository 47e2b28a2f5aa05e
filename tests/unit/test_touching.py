"""A grain on its bed: resting, contacts, gaps, the closed space beside them in 2-D, by elementary geometry."""

import itertools
import re

import numpy as np
import pytest
from every_shape import BEDS, GRAINS, SOLIDS, TERRAINS, TETRAHEDRON, pebble, vectors
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import message, on_bed, scene, sphere_on_plane
from scipy.ndimage import gaussian_filter
from scipy.optimize import minimize
from settling import rest, rotation_by, surface_points

from incipient.contact import Contacts, Load, touching
from incipient.coupled.tractions import load_of
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
    Sinusoidal,
    Sphere,
    SphereBed,
    Spheres,
    Superellipse,
    Triangulated,
)
from incipient.geometry.plane.closest import closing
from incipient.geometry.settle import proximity
from incipient.planning.plan import make_plan
from incipient.setup.setup import Setup

# Heights of centres at rest, by elementary geometry: triangles of centres, support functions of ellipses and boxes, ...
TURNS = [(0.0, 0.0, 0.0), (0.4, 0.7, 0.2), (-1.5, 0.3, 0.9), (2.0, -1.0, 0.1)]
UPRIGHT = [Placement((0, 0, 0), quaternion=rotation_by(turn)).rotation[2] for turn in TURNS]
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
    "disc in a trough above a base line": (Disc(1.0), Sinusoidal(0.02, 1.0, 0, 2), 0.75, 0, 2.48),
    # The contact is R along the normal: z = slope.x + R sqrt(1 + |slope|^2).
    "sphere on a slope": (
        *(Sphere(1.0), Plane((0.3, -0.2), 0.1), (2.0, 1.0), 0.0),
        0.1 + 0.3 * 2.0 - 0.2 * 1.0 + 0.5 * np.sqrt(1.0 + 0.09 + 0.04),
    ),
    # Distance of the centres R + r: z^2 = (R + r)^2 - |x|^2.
    "sphere on a ball beside its top": (
        *(Sphere(1.0), SphereBed.array(0.4, 3.0), (0.2, 0.1), 0.0),
        np.sqrt(0.9**2 - 0.2**2 - 0.1**2),
    ),
    # Downwards an ellipsoid reaches |diag(a, b, c) R^T e_z|, a box's core the sum of half sides times |R_zi|.
    **{
        f"{type(grain).__name__} turned by {turn}": (
            *(grain, Plane(), (0.0, 0.0), rotation_by(turn)),
            reach(np.abs(up)),
        )
        for turn, up in zip(TURNS, UPRIGHT, strict=True)
        for grain, reach in (
            (Ellipsoid((0.7, 0.5, 0.3)), lambda up: np.linalg.norm(up * [0.7, 0.5, 0.3])),
            (Box((1.0, 0.6, 0.4), 0.1), lambda up: up @ [0.4, 0.2, 0.1] + 0.1),
        )
    },
}


@pytest.mark.parametrize("case", AT_REST.values(), ids=AT_REST.keys())
def test_heights_at_rest(case):
    assert rest(*case[:4]).centre[-1] == pytest.approx(case[4], abs=1e-12)


def lowered_and_lifted(grain, bed, x, turn, gap):
    """Nowhere below the bed, and touching; lifted straight up, as far from it as asked."""
    placement, near = rest(grain, bed, x, turn), proximity(grain, bed)
    points = placement.to_scene(surface_points(grain))
    below = points[:, 0] if grain.gdim == 2 else points[:, :2]
    assert (points[:, -1] - bed.height(below)).min() >= -1e-12
    assert near.clearance(placement)[0] == pytest.approx(0.0, abs=1e-12 * grain.size)
    raised = near.lowered(placement, gap)
    distance, on_grain, on_bed = near.clearance(raised)
    assert distance == pytest.approx(gap, abs=1e-10)
    assert np.linalg.norm(on_grain - on_bed) == pytest.approx(gap, abs=1e-10)
    assert raised.centre[:-1] == placement.centre[:-1]
    assert raised.centre[-1] >= placement.centre[-1] + gap - 1e-10


@settings(max_examples=20, deadline=None)
@given(
    grain=st.sampled_from([*GRAINS.values(), *(Polygon(pebble(n)) for n in (7, 60, 900))]),
    bed=st.sampled_from(list(BEDS.values())),
    x=st.floats(-1.5, 1.5),
    angle=st.floats(-np.pi, np.pi),
    gap=st.sampled_from([0.003, 0.02, 0.3]),
)
def test_resting_touches_and_lifting_opens_the_gap(grain, bed, x, angle, gap):
    lowered_and_lifted(grain, bed, x, angle, gap)


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(
    solid=st.sampled_from(list(SOLIDS.values())),
    bed=st.sampled_from(list(TERRAINS.values())),
    turn=vectors,
    x=st.tuples(st.floats(-0.7, 0.7), st.floats(-0.7, 0.7)),
)
def test_resting_in_space_touches_and_enters_nowhere(solid, bed, turn, x):
    lowered_and_lifted(solid, bed, x, rotation_by(turn), 0.003)


@pytest.mark.parametrize(
    ("grain", "bed", "x", "height"),
    [
        (Disc(1.0), HalfDiscs(0.4, 1.0), 0.5, np.sqrt(0.92**2 - 0.5**2)),
        (
            *(Sphere(1.0), SphereBed.array(0.5, 1.0, "triangular"), (0.5, np.sqrt(1 / 12))),
            np.sqrt(1.02**2 - 1.0 / 3.0),
        ),
    ],
)
def test_lifted_out_of_a_pocket(grain, bed, x, height):
    """The triangle of centres with sides R + r + gap."""
    raised = proximity(grain, bed).lowered(rest(grain, bed, x), 0.02)
    assert raised.centre[-1] == pytest.approx(height, abs=1e-10)


@pytest.mark.parametrize("away", [0.0, 0.003])
def test_off_a_steep_contact_a_grain_is_moved_along_its_normal(away):
    """In the corner of a pit, whose wall rises 100 on 1: raised until it has the gap it would leave the pit."""
    pit = "bed.points=[[0, 0], [5, 0], [5.01, -1], [6.2, -1], [6.21, 0], [24, 0]]"
    corner = on_bed("bed.kind=polyline", pit, f"body.x={5.704975001 - away}")
    stance = Setup(corner).stance
    shift = np.subtract(stance.placement.centre, stance.resting.centre)
    assert shift == pytest.approx([1e-4 + away - 0.01 * np.hypot(1.0, 0.01), 0.01], abs=1e-6)
    assert stance.gap == pytest.approx(0.01)
    assert not make_plan(corner).warnings


def test_raised_out_of_a_slot_a_grain_is_warned_of():
    """An ellipse in a slot wider by less than a gap, whose walls rise 100 on 1."""
    slot = "bed.points=[[0, 0], [5.4925, 0], [5.5025, -1], [6.4975, -1], [6.5075, 0], [24, 0]]"
    grain = 'body={shape="ellipse", semi_axes=[0.5, 0.3], x=6.0, density=2.65}'
    (warning,) = make_plan(on_bed("bed.kind=polyline", slot, grain)).warnings
    assert "the grain is raised by 0." in warning and "give a smaller contact.gap" in warning


@pytest.mark.parametrize(
    ("turn", "centre"),
    [
        # Above a hollow the gap curves downwards along the axis.
        ((0.971512, -0.034687, -0.163053, 0.168449), (3.903962, 3.000838, 0.387258)),
        # A step of half a feature leads across the crest between two minima.
        ((0.974449, -0.034954, -0.158353, 0.169879), (3.907947, 3.003576, 0.387493)),
    ],
)
def test_a_rod_is_nearest_where_its_axis_is(turn, centre):
    """Against a search for the least distance of a point of the axis and a point of the bed."""
    line, column = np.mgrid[0:40, 0:40]
    heights = 0.1 * np.sin(0.7 * column) + 0.05 * np.cos(0.5 * line)
    bed, rod = HeightMap(heights, (0.25, 0.25), (-1.0, -1.0, 0.0)), Box((0.6, 1.2, 0.6), 0.3)
    place = Placement(centre, quaternion=turn / np.linalg.norm(turn))
    ends = place.to_scene(np.array([[0.0, -0.3, 0.0], [0.0, 0.3, 0.0]]))

    def apart(unknowns):
        along, x, y = unknowns
        on_axis = (1.0 - along) * ends[0] + along * ends[1]
        return np.linalg.norm(on_axis - [x, y, bed.height([[x, y]])[0]])

    bounds = [(0.0, 1.0), (None, None), (None, None)]
    starts = [(s, *((1.0 - s) * ends[0] + s * ends[1])[:2]) for s in np.linspace(0.0, 1.0, 31)]
    result = (minimize(apart, start, bounds=bounds, tol=1e-14).fun for start in starts)
    assert proximity(rod, bed).clearance(place)[0] == pytest.approx(min(result) - 0.3, abs=1e-8)


def test_minima_are_tracked_to_themselves_where_the_grain_stays():
    """Two on one face of a box: the triangle beside led from one to the other, which was lower."""
    heights = gaussian_filter(np.random.default_rng(3).normal(size=(41, 41)), 1.0)
    bed = HeightMap(0.15 * heights / heights.std(), (0.25, 0.25), (-5.0, -5.0, 0.0))
    near, turn = proximity(BRICK, bed), (0.57996866, 0.13155995, 0.32178034, 0.73673994)
    place = near.lowered(Placement((0.54784675, -0.92085314, 3.0), quaternion=turn))
    minima = near.locally_least(place, near.minima(place, 0.05))
    assert len(minima) == 2
    assert near.tracked(place, minima).anchors == pytest.approx(minima.anchors, abs=1e-9)


def test_a_steep_crest_is_not_seen_through_the_bed():
    """A cube whose edge leans on the rim of a pit, where the other side is nearer through the bed."""
    x, y = np.meshgrid(np.arange(-4.0, 4.1, 0.2), np.arange(-4.0, 4.1, 0.2))
    pit = HeightMap(np.where(np.maximum(abs(x), abs(y)) < 0.7, -0.8, 0.0), (0.2, 0.2), (-4, -4, 0))
    turn = (-0.15921074, 0.08107753, -0.4463696, -0.87683097)
    near = proximity(Box((1.0, 1.0, 1.0)), pit)
    low = near.lowered(Placement((0.02297346, -0.18869162, 0.5), quaternion=turn))
    assert near.clearance(low)[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("grain", "place", "bed"),
    [
        (Disc(1.0), (0.0, 0.3), Flat()),
        # Half-way up, the sides of the crest are nearer.
        (Disc(1.0), (0.0, 0.3), Polyline([(-3.0, -3.0), (0.0, 0.0), (3.0, -3.0)])),
        (Sphere(1.0), (0, 0, 0.3), Plane()),
    ],
)
def test_overlap_is_negative(grain, place, bed):
    assert proximity(grain, bed).clearance(Placement(place))[0] == pytest.approx(-0.2)


# Placements in space: turns there and back.


@settings(max_examples=30, deadline=None)
@given(vectors, vectors, vectors)
def test_turns_are_rotations_and_go_there_and_back(turn, shift, point):
    placement = Placement((0.1, 0.2, 0.3)).moved(shift, turn)
    rotation = placement.rotation
    assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-14)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    x = np.array([point])
    assert placement.to_body(placement.to_scene(x)) == pytest.approx(x, abs=1e-13)
    # A rotation leaves its own axis in place.
    assert rotation @ np.array(turn) == pytest.approx(np.array(turn), abs=1e-12)


def test_a_quarter_turn_about_the_vertical():
    placement = Placement((0.0, 0.0, 1.0)).moved((0, 0, 0), (0.0, 0.0, np.pi / 2)).raised(0.5)
    assert placement.to_scene([[1.0, 0.0, 0.0]]) == pytest.approx(np.array([[0.0, 1.0, 1.5]]))


# Contacts: points, normals and areas


TOLERANCE = 1e-6
WEDGE = Polygon([(0.0, 0.0), (0.5, 1.0), (-0.5, 1.0)])  # stands on its corner
PYRAMID = Polyhedron([(0, 0, 0), (0.5, 0.5, 1), (-0.5, 0.5, 1), (0.5, -0.5, 1), (-0.5, -0.5, 1)])
BRICK, ROUNDED = Box((1.0, 0.6, 0.4)), Box((1.0, 0.6, 0.4), 0.1)
TRIAD = Spheres([(0, 0, 0), (0.8, 0, 0), (0.4, 0.7, 0)], [0.5, 0.5, 0.5])


def result(grain, bed, x, turn=0.0, tolerance=TOLERANCE):
    """The contacts of a grain turned and lowered onto a bed, sorted by x, then y, then the normal."""
    turn = turn if grain.gdim == 2 else rotation_by(turn or (0.0, 0.0, 0.0))
    contacts = touching(grain, rest(grain, bed, x, turn), bed, tolerance)
    keys = np.round([contacts.normals[:, 0], *contacts.points[:, 1::-1].T], 9)
    order = np.lexsort(keys)
    areas = None if contacts.areas is None else contacts.areas[order]
    return contacts.points[order], contacts.normals[order], areas


def pocket(arrangement, middle, spacing, ball):
    """A ball in a pocket: contacts divide the lines between centres by the radii 0.6 and 0.5."""
    bed, middle = SphereBed.array(0.5, spacing, arrangement), spacing * np.array(middle)
    centres = bed.near(middle, 0.75 * spacing - 0.5)[1]
    centres = centres[np.lexsort(np.round(centres[:, 1::-1].T, 9))]
    centre = np.array([*middle, np.sqrt(1.1**2 - ((centres[0, :2] - middle) ** 2).sum())])
    away = (centres - centre) / 1.1
    return ball, bed, middle, 0.0, centre + 0.6 * away, away, None


def ellipsoid_turned(turn):
    """The lowest point of x = R A u is A^2 R^T n / |A R^T n| in the body, with n down."""
    axes, rotation = np.array([0.7, 0.5, 0.3]), Placement((0, 0, 0)).moved((0, 0, 0), turn).rotation
    inward = -rotation[2]
    lowest = rotation @ (axes**2 * inward / np.linalg.norm(axes * inward))
    return Ellipsoid(tuple(axes)), Plane(), (0, 0), turn, [(*lowest[:2], 0.0)], [BELOW], None


SLOPE, ALONG = Polyline([(-4.0, -3.0), (4.0, 3.0)]), Plane((0.75, 0.0))  # its normal is (-3, 4)/5
DOWN, BELOW, HIGH = (0.0, -1.0), (0.0, 0.0, -1.0), np.sqrt(3.0) / 4.0
TILTED, ASIDE = (0.6, 0.0, -0.8), (2.0 / 5.0**0.5, 0.0, -1.0 / 5.0**0.5)
WALL = (3.0 / 13.0**0.5, -2.0 / 13.0**0.5)
PLATEAUX = [(-3, 0), (-0.3, 0), (-0.2, -0.3), (0.0, 0.0), (0.1, -0.2), (0.4, 0), (3, 0)]
CORNERS = [(-1, -1), (-1, 1), (1, -1), (1, 1)]
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
    # A wall rises by 3:2 from the lower corner at the origin.
    "box with a wall before it": (
        *(Rectangle(1.0, 0.5), Polyline([(-2.0, 3.0), (0.0, 0.0), (3.0, 0.0)]), 0.5, 0.0),
        *([(0.0, 0.0), (0.0, 0.0), (1.0, 0.0)], [(-WALL[0], WALL[1]), DOWN, DOWN], [0.0, 0.5, 0.5]),
    ),
    "box with a wall behind it": (
        *(Rectangle(1.0, 0.5), Polyline([(-3.0, 0.0), (0.0, 0.0), (2.0, 3.0)]), -0.5, 0.0),
        *([(-1.0, 0.0), (0.0, 0.0), (0.0, 0.0)], [DOWN, DOWN, WALL], [0.5, 0.5, 0.0]),
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
    "sphere on a slope": (Sphere(1.0), ALONG, (0, 0), 0.0, [(0.3, 0.0, 0.225)], [TILTED], None),
    **{
        f"sphere between {count} balls, {spacing} apart": pocket(
            arrangement, middle, spacing, Sphere(1.2)
        )
        for count, arrangement, middle in (
            (4, "square", (0.5, 0.5)),
            (3, "triangular", (0.5, np.sqrt(1.0 / 12.0))),
        )
        for spacing in (0.9, 1.0, 1.2)
    },
    "cube rounded to a ball between four": pocket(
        "square", (0.5, 0.5), 1.0, Box((1.2, 1.2, 1.2), 0.6)
    ),
    "ellipsoid on a plane": ellipsoid_turned((0.4, 0.7, 0.2)),
    "corner takes the normal of the bed": (
        *(PYRAMID, ALONG, (0.2, 0.1), 0.0),
        *([(0.2, 0.1, 0.15)], [TILTED], None),
    ),
    # A slab of sides 2 covers nine crests at spacing 0.9; collinear ones count by their ends: a 3 x 3 grid.
    "face on half-balls takes its own normal": (
        *(Box((2.0, 2.0, 0.4)), SphereBed.array(0.3, 0.9), (0, 0), 0.0),
        [(0.9 * i, 0.9 * j, 0.3) for i in (-1, 0, 1) for j in (-1, 0, 1)],
        *([BELOW] * 9, None),
    ),
    # Turned by 45 degrees about x, the box stands with its edge along x on the crest below it.
    "edge on a half-ball": (
        *(Box((0.8, 0.4, 0.4)), SphereBed.array(0.5, 4.0), (0, 0), (0.25 * np.pi, 0, 0)),
        *([(0.0, 0.0, 0.5)], [BELOW], None),
    ),
    # The tip between two half-balls of spacing 1 and radius 0.48; its faces rise 2:1.
    "polyhedron between half-balls": (
        *(PYRAMID, SphereBed.array(0.48, 1.0, "square", (0.5, 0.0)), (0, 0), 0.0),
        [(s * (0.5 - 0.48 * ASIDE[0]), 0.0, -0.48 * ASIDE[2]) for s in (-1, 1)],
        *([(s * ASIDE[0], 0.0, ASIDE[2]) for s in (-1, 1)], None),
    ),
    # The centroid is 0.5 above the plane, each contact 0.5 below a centre.
    "union of spheres touches with each": (
        *(TRIAD, Plane(), (0, 0), 0.0),
        *([(*TRIAD.centres[k][:2], 0.0) for k in (0, 2, 1)], [BELOW] * 3, None),
    ),
    # About y by 45 degrees: the edge along y lies on the plane, shorter by the rounding.
    **{
        f"edge of rounding {grain.edge_radius} counts by its ends": (
            *(grain, Plane(), (0, 0), (0, 0.25 * np.pi, 0)),
            *([(None, y, 0.0) for y in (-0.3 + grain.edge_radius, 0.3 - grain.edge_radius)],),
            *([BELOW] * 2, None),
        )
        for grain in (BRICK, ROUNDED)
    },
    # Rounded until it is a capsule of radius 0.2: it touches along the 0.6 of its straight part.
    "rod on its line": (
        *(Box((1.0, 0.4, 0.4), 0.2), Plane(), (0, 0), 0.0),
        *([(-0.3, 0, 0), (0.3, 0, 0)], [BELOW] * 2, None),
    ),
    **{
        f"{name} has the corners of its face": (
            *(grain, Plane(), (0, 0), 0.0, [(a * i, b * j, 0) for i, j in CORNERS]),
            *([BELOW] * 4, [a * b] * 4),
        )
        for name, grain, (a, b) in (
            ("box", BRICK, (0.5, 0.3)),
            ("rounded box", ROUNDED, (0.4, 0.2)),
            (
                "box of triangles",
                Triangulated(BRICK.surface(0.2).points, BRICK.surface(0.2).triangles),
                (0.5, 0.3),
            ),
        )
    },
    # A slope of 3/4 is a turn about y by -atan(3/4); the centre is 0.2 above the face along the normal (-3, 0, 4)/5.
    "box along a slope": (
        *(BRICK, ALONG, (0, 0), (0, -np.arctan2(3, 4), 0)),
        [(0.4 * i + 0.12, 0.3 * j, 0.3 * i + 0.09) for i, j in CORNERS],
        *([TILTED] * 4, [0.15] * 4),
    ),
}


def plane(rows):
    """Rows in 2-D as rows in 3-D."""
    table = np.array(rows, dtype=float)
    return np.pad(table, ((0, 0), (0, 3 - table.shape[1])))


@pytest.mark.parametrize("case", TOUCHING.values(), ids=TOUCHING.keys())
def test_points_normals_and_areas(case):
    points, normals, areas = result(*case[:4])
    within, known = 1e-12 if case[0].gdim == 2 else 1e-9, plane(case[4])
    assert points.shape == known.shape
    assert np.nan_to_num(points - known) == pytest.approx(0.0, abs=within)
    assert normals == pytest.approx(plane(case[5]), abs=within)
    assert areas is None or areas == pytest.approx(case[6] or np.zeros(len(points)))
    assert areas is not None or case[6] is None


FLATTENED = {"shape": "superellipse", "semi_axes": (0.5, 0.3), "x": 4.0}
CUSHION = {"shape": "superquadric", "semi_axes": (0.5, 0.4, 0.3), "x": 4.0}


@pytest.mark.parametrize(
    ("build", "body"),
    [
        *((scene, FLATTENED | {"exponent": exponent}) for exponent in (2.2, 2.5, 6.0)),
        (sphere_on_plane, CUSHION | {"exponents": (2.5, 2.0)}),
    ],
)
def test_a_grain_nearly_flat_below_touches_the_bed_under_its_centroid(build, body):
    """Its distance from the bed hardly tells where, and elsewhere the weight would tip it."""
    made = build(body=body)
    (contact,) = Setup(made).contacts.points
    assert contact[: made.up] == pytest.approx(made.placement.centre[: made.up], abs=1e-12)


def test_a_single_contact_stays_where_a_hollow_lies_below_the_grain():
    """Half-way between the centres of two discs of one size, though the bed far below faces the grain, too."""
    bed = {"kind": "half-discs", "radius": 0.5, "spacing": 1.4, "offset": 0.7}
    body = {"shape": "disc", "diameter": 1.0, "x": 4.15}
    (contact,) = Setup(scene(bed=bed, body=body)).contacts.points
    assert contact == pytest.approx([3.825, 0.5 * np.sqrt(1.0 - 0.65**2), 0.0], abs=1e-12)


@pytest.mark.parametrize(
    ("grain", "turn", "area"),
    [
        # Face of a tetrahedron of side 2 sqrt(2): area sqrt(3)/4 s^2
        (
            TETRAHEDRON,
            np.arccos(1.0 / np.sqrt(3.0)) * np.array([-1.0, 1.0, 0.0]) / np.sqrt(2.0),
            2.0 * np.sqrt(3.0),
        ),
        # A trapezium of parallel sides 2 and 1, height 1
        (
            Polyhedron(
                [(x, y, z) for x, y in ((-1, 0), (1, 0), (0.5, 1), (-0.5, 1)) for z in (0.0, 0.5)]
            ),
            np.zeros(3),
            1.5,
        ),
    ],
)
def test_shares_of_a_face_keep_its_centroid(grain, turn, area):
    points, _, areas = result(grain, Plane(), (0.0, 0.0), tuple(turn))
    assert areas.sum() == pytest.approx(area)
    assert areas @ points / areas.sum() == pytest.approx(np.zeros(3), abs=1e-12)


def test_box_across_crests_touches_in_lines():
    """Crests of ridges at x = 1/4 + k: lines across the face, no area."""
    points, normals, areas = result(Box((2.2, 0.6, 0.4)), Ridges(0.1, 1.0), (0.25, 0.0))
    assert np.unique(np.round(points[:, 0], 6)) == pytest.approx([-0.75, 0.25, 1.25])
    assert np.abs(points[:, 1]).max() == pytest.approx(0.3, abs=1e-9)
    assert normals == pytest.approx(np.tile(BELOW, (len(points), 1)), abs=1e-9)
    assert areas is None or not areas.any()


SIMILAR = {
    "disc": (lambda s: (Disc(s), HalfDiscs(0.5 * s, s)), 0.5, 2),
    "sphere": (
        lambda s: (Sphere(s), SphereBed.array(0.5 * s, s, "triangular")),
        (0.5, np.sqrt(1.0 / 12.0)),
        3,
    ),
    "box": (lambda s: (Box((s, 0.6 * s, 0.4 * s)), Plane()), (0.0, 0.0), 4),
    "rounded box": (lambda s: (Box((s, 0.6 * s, 0.4 * s), 0.1 * s), Plane()), (0.0, 0.0), 4),
    "ellipsoid": (lambda s: (Ellipsoid((0.7 * s, 0.5 * s, 0.3 * s)), Plane()), (0.0, 0.0), 1),
}


@pytest.mark.parametrize("name", SIMILAR)
def test_just_below_and_above_the_gap_and_in_any_unit(name):
    (make, x, count), gap = SIMILAR[name], 1e-4
    grain, bed = make(1.0)
    placement = rest(grain, bed, x)
    # Straight up, the distance from a piece grows as the vertical part of its normal.
    steep = abs(touching(grain, placement, bed, 1e-9).normals[0, grain.gdim - 1])
    raised = placement.raised(gap / steep)
    with pytest.raises(SceneError, match=r"does not touch the bed within .*; (settle|rest) it on"):
        touching(grain, raised, bed, 0.99 * gap)
    assert len(touching(grain, raised, bed, 1.01 * gap)) == count
    expected, directions, shares = result(grain, bed, x)
    for scale in (1e-3, 1e3):
        other = result(*make(scale), scale * np.array(x), tolerance=TOLERANCE * scale)
        assert other[0] / scale == pytest.approx(expected, abs=1e-10)
        assert other[1] == pytest.approx(directions, abs=1e-10)
        assert (other[2] is None) == (shares is None)
        assert shares is None or other[2] / scale ** (grain.gdim - 1) == pytest.approx(shares)


def test_tilted_within_the_tolerance_it_is_still_a_patch():
    placement = rest(BRICK, Plane(), (0.0, 0.0), rotation_by((0.0, 1e-5, 0.0)))
    assert touching(BRICK, placement, Plane(), 2e-5).areas.sum() == pytest.approx(0.6)
    assert len(touching(BRICK, placement, Plane(), 5e-6)) == 2


RIDGE = Polyline(
    ((-9.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.5, 0.2), (1.0, 0.2), (1.4, -0.3), (9.0, 0.4))
)


@pytest.mark.parametrize("bed", [Flat(0.0), HalfDiscs(0.5, 1.0), HalfDiscs(0.3, 1.0), RIDGE])
def test_a_disc_is_nearest_where_the_bed_is_nearest_to_its_centre(bed):
    """The least gap is the distance of the bed from the centre less the radius, along the line to the nearest point."""
    random = np.random.default_rng(25)
    for radius, x, above in random.uniform((0.2, -2.0, 0.001), (0.8, 2.0, 0.6), (24, 3)):
        centre = np.array([x, float(bed.height([x])[0]) + radius + above])
        distance, foot = bed.distance(centre[None]), bed.nearest(centre[None])
        if distance[0] < radius:  # beside a slope it would overlap the bed
            continue
        near = proximity(Disc(2.0 * radius), bed).gaps(Placement(tuple(centre)), 1.0)
        least = near.only([np.argmin(near.gaps)])
        assert least.gaps == pytest.approx(distance - radius, abs=1e-12)
        assert least.feet == pytest.approx(foot, abs=1e-8)
        assert least.normals == pytest.approx((centre - foot) / distance, abs=1e-8)


# Bad input: each is one clear line


ZERO, ONE, OUT = np.zeros(3), [[0, 0, 0]], [[0.0, -1.0, 0.0]]


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda: Contacts([], []), "none"),
        (lambda: Contacts([[0, 0]], [[0, -1]]), "shape"),
        (lambda: Contacts(ONE, OUT * 2), "1 points but 2 normals"),
        (lambda: Contacts([[0, 0, np.nan]], OUT), "finite"),
        (lambda: Contacts(ONE, [[0, -1.01, 0]]), "normal 0 has length 1.01"),
        (lambda: Contacts(ONE, ONE), "length 0"),
        (lambda: Contacts(ONE, OUT, [1.0, 2.0]), "areas have shape"),
        (lambda: Contacts(ONE, OUT, [-1.0]), "not negative"),
        (lambda: Load(ZERO, 1.0, ZERO, ZERO), "flow_couple has shape"),
        (lambda: Load(ZERO, ZERO, [0.0, np.inf, 0.0], ZERO), r"weight is .* finite"),
        (lambda: touching(Disc(1.0), Placement((0, 0.5)), Flat(), 0.0), "not a positive length"),
        (lambda: touching(Disc(1.0), Placement((0, 0.5)), Flat(), np.nan), "not a positive length"),
        (
            lambda: touching(Disc(1.0), Placement((0, 0.5)), Plane(), 1.0),
            "one is planar, the other",
        ),
        (lambda: Placement((0, 0, 0), 0.3), "no angle"),
        (lambda: Placement((0, 0), 0.0, (1, 0, 0, 0)), "no quaternion"),
        (lambda: Placement((0, 0, 0), quaternion=(1, 1, 0, 0)), "unit length"),
        (lambda: Placement((0, 0, 0), quaternion=(np.nan, 0, 0, 0)), "unit length"),
        (lambda: Placement((0, 0, np.inf)), "finite"),
        # A space that is nowhere wider.
        (lambda: closed(CLOSED_GRAINS["disc"], CLOSED_BEDS["flat"], width=2.0), r"contact\.gap"),
    ],
)
def test_bad_input_is_refused_in_one_line(make, reason):
    assert re.search(reason, message(make))


def test_input_is_copied_and_kept():
    points = np.array([[0.0, 0.0, 0.0]])
    contacts = Contacts(points, OUT)
    points += 1.0
    assert contacts.points == pytest.approx(0.0)
    with pytest.raises(ValueError, match="read-only"):
        contacts.points[0, 0] = 1.0


# The closed space beside contacts in 2-D


CLOSED_GRAINS = {
    "disc": Disc(1.0),
    "ellipse": Ellipse((0.7, 0.4)),
    "square": Polygon([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]),
    "superellipse": Superellipse((0.6, 0.4), 3.0),
    "two discs": Discs([[0.0, 0.0], [0.7, 0.0]], [0.4, 0.5]),
}
CLOSED_BEDS = {"flat": Flat(), "wavy": Sinusoidal(0.3, 1.5), "half-discs": HalfDiscs(0.5, 1.2)}


def closed(grain, bed, angle=0.0, width=0.01):
    placement = rest(grain, bed, 0.6, angle)
    contacts = touching(grain, placement, bed, 1e-6).points[:, :2]
    outline = tuple(curve.moved(placement) for curve in grain.outline())
    return closing(outline, bed, contacts, width), placement


@pytest.mark.parametrize("angle", [0.0, 0.3])
@pytest.mark.parametrize(("name", "bed"), itertools.product(CLOSED_GRAINS, CLOSED_BEDS))
def test_the_outline_goes_from_one_line_to_the_other(name, bed, angle):
    grain, bed = CLOSED_GRAINS[name], CLOSED_BEDS[bed]
    space, placement = closed(grain, bed, angle)
    for line in (space.left, space.right):
        # Where a crumb of a curve is left out it is longer.
        assert line.length == pytest.approx(0.01, rel=0.03)
        assert bed.distance([line.start])[0] == pytest.approx(0.0, abs=1e-9)
    x = space.contacts[:, 0]
    assert space.left.start[0] <= x.min() and x.max() <= space.right.start[0]
    starts = [curve.start for curve in space.outline]
    ends = [curve.end for curve in space.outline]
    joined = np.subtract([space.right.end, *ends], [*starts, space.left.end])
    assert joined == pytest.approx(0.0, abs=1e-9)
    s = np.linspace(0.0, 1.0, 51)
    points = np.vstack([curve.point(s) for curve in space.outline])
    assert grain.level(placement.to_body(points)) == pytest.approx(0.0, abs=1e-6)
    assert bed.distance(points).min() > (0.0099 if name == "disc" else 0.0)


def test_the_load_of_a_pressure_below_a_disc_is_its_integral():
    """On the lower right quarter of a unit circle it is p (-1, 1), through the circle's centre."""
    angles = np.linspace(-np.pi / 2, 0.0, 3)
    arms = np.column_stack([2.0 + np.cos(angles), np.sin(angles)])
    force, couple = load_of(arms, np.array([1.5, 1.5]))
    # The centre lies two to the right of where the couple is about.
    assert force == pytest.approx([-1.5, 1.5, 0.0])
    assert couple == pytest.approx([0.0, 0.0, 2.0 * 1.5])
