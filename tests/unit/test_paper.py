"""The paper's criteria, and the exact ones beside them."""

import json
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_contacts import Case, changed, normal_and_shear, rotation
from test_safety_factor import DOWN, DOWN_3D, block, ends, pocket, ring
from test_safety_factor import load as plane_load

from incipient.contact import Classification, Contacts, Load, Mode, safety_factor
from incipient.contact import paper as criteria
from incipient.contact.acceleration import Mode as ExactMode
from incipient.contact.paper import Category, Criterion, category, classify, simultaneous
from incipient.contact.paper.equations import (
    Axis,
    away,
    can_vanish,
    distribute,
    equal_fractions,
    measures,
)
from incipient.contact.verdict import FAMILIES, FAMILY, Reason, compare, judge, judged
from incipient.errors import SceneError

# The paper's criteria of incipient motion: against exact statics, and stated where they disagree with it.
#
# Equation numbers are label keys of the paper's source (docs/explanation/criteria.md). In 2-D: x downstream, y up,
# torques counter-clockwise about the third axis; in 3-D z up; normals point out of the grain.


ABOUT_Z, CENTRE, TOLERANCE = np.array([0.0, 0.0, 1.0]), np.zeros(3), 1e-9
# The base of a box, half base 1, its centre of mass half a length above; a contact downstream; two that lean apart.
BASE = ends(depth=0.5)
DOWNSTREAM = Contacts([[0.5, -0.5, 0.0]], [DOWN])
APART = Contacts([[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0]], [[-0.6, -0.8, 0.0], [0.6, -0.8, 0.0]])


def load(force=(0.0, 0.0), torque=0.0, weight=(0.0, 0.0), centre=(0.0, 0.0)):
    return plane_load(force, torque, weight, centre)


def disc(force, torque, weight=1.0):
    """Load and contact of a disc of radius 1/2 on a plane under a shear force, a torque and its weight."""
    return load((force, 0.0), torque, (0.0, -weight), (0.0, 0.5)), Contacts([[0, 0, 0]], [DOWN])


def base(height=0.5):
    """The lower corners of a box of half sides 1 and 2."""
    corners = [[x, y, -height] for x in (-1.0, 1.0) for y in (-2.0, 2.0)]
    return Contacts(corners, [DOWN_3D] * 4, [2.0] * 4)


def in_3d(force=CENTRE, torque=CENTRE, weight=DOWN_3D):
    return Load(force, torque, weight, CENTRE)


TILT = np.pi / 6
# Load, contacts, friction, row of the table of outcomes, force of (3) or (24), contacts in the way; None: not asked.
OUTCOMES = [
    # Statics: a block slides if tan(slope) > friction, with the force sin - friction cos down the slope.
    *(
        (
            *block(slope, force=CENTRE[:2]),
            friction,
            "1a" if np.tan(slope) > friction else "7",
            [max(np.sin(slope) - friction * np.cos(slope), 0.0), 0.0, 0.0],
            (),
        )
        for slope in np.radians([1.0, 15.0, 30.0, 44.0])
        for friction in (0.0, 0.2, 0.5, 0.9)
    ),
    (*block(np.arctan(0.5 * 0.999999), force=CENTRE[:2]), 0.5, "7", None, ()),
    (*block(np.arctan(0.5 * 1.000001), force=CENTRE[:2]), 0.5, "1a", None, ()),
    # tan(20 degrees) = 1 / 2.7475: the line of the weight leaves the base of a block above that height.
    (*block(np.radians(20.0), height=2.7, force=CENTRE[:2]), 0.5, "7", None, None),
    (*block(np.radians(20.0), height=2.8, force=CENTRE[:2]), 0.5, "5a", None, None),
    # A box slides in any direction at the friction angle: what is left is the push beyond friction N = 0.4.
    *(
        (in_3d(push * ahead), base(), 0.4, row, max(push - 0.4, 0.0) * ahead, ())
        for angle in np.radians([0.0, 30.0, 77.0, 200.0])
        for ahead in [np.array([np.cos(angle), np.sin(angle), 0.0])]
        for push, row in ((0.39, "7"), (0.41, "1a"))
    ),
    # Pushed along x with 0.3 at the height h of the centre: over the edge at half = 1 once 0.3 h > 1.
    (in_3d([0.3, 0.0, 0.0]), base(3.3), 0.4, "7", None, None),
    (in_3d([0.3, 0.0, 0.0]), base(3.4), 0.4, "5a", None, None),
    # A disc on a plane. Shear turns it clockwise, and the torque about the contact is not balanced: it rolls; the paper
    # calls that sliding and pivotting. Pure torque: it rolls too, row 1a with F = -F_tau and tau = 0.
    (*disc(0.3, -0.1), 0.5, "6", [0.2, 0.0, 0.0], ()),
    (*disc(0.0, -0.1), 0.5, "1a", [0.2, 0.0, 0.0], ()),
    # By (3) friction holds the force, whose torque turns the disc: row 5.
    (*disc(0.3, 0.0), 0.5, "5a", [0.0, 0.0, 0.0], ()),
    # Torque = R force: statics holds it; the paper lets the contact answer force and F_tau, twice that.
    (*disc(0.3, 0.15), 1.0, "6", [-0.3, 0.0, 0.0], ()),
    (*disc(0.0, 0.0), 0.0, "7", [0.0, 0.0, 0.0], ()),
    # At rest under its weight and a torque of a thousandth statics shifts the reaction by a thousandth of the half
    # base. By (24) the contact answers F_tau too: F = -F_tau, the mean of torque (0.5, +-1) / 1.25 over the two ends.
    # About whichever end it turned, the other would enter the bed.
    (load(torque=-1e-3, weight=(0.0, -1.0)), BASE, 0.5, "1a", [4e-4, 0.0, 0.0], (0, 1)),
    # Buoyancy or lift above the weight: nothing answers. Counter-clockwise torque takes the contact downstream away.
    (load((0.2, 0.0), weight=(0.0, 0.5)), pocket(0.5), 0.5, "1b", [0.2, 0.5, 0.0], None),
    (in_3d([0.1, 0.0, 1.5]), ring(2, 0.5), 0.4, "1b", [0.1, 0.0, 0.5], None),
    (load((0.0, 1.0), 0.1), DOWNSTREAM, 0.5, "3", [0.0, 1.0, 0.0], None),
    (load((0.0, 1.0), -0.1), DOWNSTREAM, 0.5, "4", None, None),
    (load((0.0, 0.999), weight=(0.0, -1.0)), pocket(0.0), 0.5, "7", None, None),
    (load((0.0, 1.001), weight=(0.0, -1.0)), pocket(0.0), 0.5, "1b", None, None),
    # A pocket: statics lets the disc climb the neighbour downstream once push / weight > tan(30 degrees) = 0.57735. By
    # the paper it moves for any push; below the angle the contact upstream is in its way.
    *(
        (load((push, 0.0), weight=(0.0, -1.0)), pocket(TILT), friction, row, None, obstacles)
        for push, obstacles in ((0.57, (0,)), (0.58, ()))
        for friction, row in ((0.0, "1a"), (1.0, "5a"))
    ),
    (load((0.0, -1.0), 0.2), DOWNSTREAM, 0.5, "2", None, None),
    (load((0.0, -1.0), -0.2), DOWNSTREAM, 0.5, "6", None, None),
    (load(torque=-0.2), DOWNSTREAM, 0.0, "5a", None, None),
    # (8) with C = 1 gives tau = 0; what is left is -F_tau = 0.2 (0.5, 0.5) / 0.5, upward.
    (load(torque=-0.2), DOWNSTREAM, 1.0, "1b", [0.2, 0.2, 0.0], None),
    # F_tau is tangential at the contact: (7) = 0, no reaction, no friction, hence no counter torque by (8).
    *(
        (
            in_3d(torque=torque, weight=CENTRE),
            Contacts([[0.0, 0.0, -0.5]], [DOWN_3D]),
            0.5,
            "5b",
            CENTRE,
            None,
        )
        for torque in ([0.0, 0.3, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 0.2])
    ),
]


@pytest.mark.parametrize(("acting", "contacts", "friction", "row", "force", "obstructed"), OUTCOMES)
def test_outcomes(acting, contacts, friction, row, force, obstructed):
    result = classify(acting, contacts, friction)
    assert (result.mode.row, result.moves) == (row, row != "7")
    if force is not None:
        assert result.force == pytest.approx(np.array(force), abs=1e-12)
    if obstructed is not None:
        assert result.obstructed_by == obstructed


# One contact below the centre: (7) is zero, F_tau = (tau / R, 0), and (24), (25) can be written down.


@pytest.mark.parametrize("friction", [0.1, 0.5, 2.0])
@pytest.mark.parametrize(("force", "torque"), [(0.3, -0.1), (0.3, 0.1), (0.0, -0.2), (1.0, 0.5)])
def test_resultants_of_a_disc_on_a_plane(force, torque, friction):
    result = classify(*disc(force, torque), friction)
    # With R = 1/2 and N = 1: T = force + torque / R presses along the plane, friction answers C T.
    tangential = force + torque / 0.5
    mobilised = min(1.0, friction / abs(tangential))
    assert result.F_tau == pytest.approx(np.array([[torque / 0.5, 0.0, 0.0]]))
    assert result.quantity_22 == pytest.approx([-1.0])
    assert result.C_friction == pytest.approx([mobilised])
    assert result.force == pytest.approx([force - mobilised * tangential, 0.0, 0.0])
    assert result.torque == pytest.approx([0.0, 0.0, torque - 0.5 * mobilised * tangential])
    assert result.minima.sign_7 == 0


# A disc between two others; centres joined at an angle to the vertical.


def test_equal_sharing_under_its_weight_needs_friction():
    # Statics holds the disc without friction. Half of (31) at each contact carries only cos^2 of the weight;
    # the general distribution, c_2 = 1 / cos^2, holds it.
    case = load(weight=(0.0, -1.0)), pocket(np.pi / 6)
    result = classify(*case, 0.0)
    assert (result.significant, result.obstructed_by) == ((0, 1), (0, 1))
    assert result.force == pytest.approx([0.0, np.cos(np.pi / 6) ** 2 - 1.0, 0.0])
    assert classify(*case, 0.6).mode is Mode.NO_INCIPIENT_MOTION
    assert result.distribution.c_2 == pytest.approx(4.0 / 3.0)
    assert result.distribution.force == pytest.approx([0.0, 1.0, 0.0], abs=1e-15)


# One test for each reading in docs/explanation/criteria.md that concerns contact.


def test_equivalent_force_leaves_out_the_spin():
    # (6): r ^ F_tau is tau without its part along r, and that part stays in the resultant (25).
    contacts = Contacts([[0.0, 0.0, -1.0]], [DOWN_3D])
    result = classify(Load(CENTRE, [0.1, 0.2, 0.3], DOWN_3D, CENTRE), contacts, 5.0)
    assert np.cross(contacts.points[0], result.F_tau[0]) == pytest.approx([0.1, 0.2, 0.0])
    assert result.C_friction == pytest.approx([1.0])
    assert result.torque == pytest.approx([0.0, 0.0, 0.3])


@pytest.mark.parametrize(("torque", "axis"), [(0.3, Axis.AWAY), (-0.3, Axis.PRESSED)])
def test_seven_keeps_its_sign(torque, axis):
    # Contact at r = (1, -2), normal down: F_tau = torque (2, 1) / 5, n . F_tau = -torque / 5, and
    # -|r|^2 (n . F_tau) |n . F_tau| = torque |torque| / 5: positive where the torque lifts the contact.
    result = classify(load(torque=torque), Contacts([[1.0, -2.0, 0.0]], [DOWN]), 0.5)
    assert result.minimum_7 == pytest.approx(torque * abs(torque) / 5.0)
    assert (result.away_from_surface, result.away.axis) == (torque > 0.0, axis)
    # (23) is read alike and is (7) where no force acts.
    assert result.quantity_23 == pytest.approx([result.minimum_7])


def test_away_rotation_only_without_a_force_along():
    # Row 5b asks for F = 0 and minimum (7) > 0, under a heading that says minimum (7) < 0.
    assert simultaneous(-1, 1, moves=False, turns=True) is Mode.AWAY_ROTATION
    result = classify(load(torque=0.3), Contacts([[1.0, -2.0, 0.0]], [DOWN]), 0.5)
    assert (result.criterion, result.mode) == (Criterion.ROTATION_ONLY, Mode.AWAY_ROTATION)
    assert not result.force.any()
    assert result.torque == pytest.approx([0.0, 0.0, 0.3])


def test_minimisers_share_equally():
    # The base of a box under a downward load: minimum (2) is the same at both ends.
    result = classify(load((0.1, -1.0), -0.2), BASE, 0.3)
    assert result.significant == (0, 1)
    assert result.fraction == pytest.approx([0.5, 0.5])
    assert result.reaction[:, 1] == pytest.approx(-0.5 * result.F_flow_g_and_tau[:, 1])
    points = np.array([[0.0, 0, 0], [0.0, 0, 0], [1.0, 0, 0]])
    assert equal_fractions(points, np.array([DOWN] * 3)) == pytest.approx([0.25, 0.25, 0.5])


ROWS = {
    key: simultaneous(*key[:2], bool(key[2]), bool(key[3]))
    for key in product((-1, 0, 1), (-1, 0, 1), (0, 1), (0, 1))
}


def test_every_combination_has_its_row():
    # Keys: signs of minima (2) and (7), then F != 0 by (24), tau != 0 by (25).
    rows = {key: mode.row for key, mode in ROWS.items()}
    assert {row for key, row in rows.items() if key[2:] == (0, 0)} == {"7"}
    for key, row in rows.items():
        if key[2:] == (1, 0):
            assert row == ("1b" if key[0] > 0 else "1a")
    expected = {(-1, 1, 1, 1): "2", (1, 1, 1, 1): "3", (1, -1, 1, 1): "4", (1, -1, 0, 1): "4"}
    expected |= {(-1, -1, 0, 1): "5a", (-1, 1, 0, 1): "5b", (-1, -1, 1, 1): "6"}
    # Where a minimum is zero the table is silent: see simultaneous.
    expected |= {(-1, 0, 1, 1): "6", (1, 0, 1, 1): "3", (0, -1, 1, 1): "6"}
    assert {key: rows[key] for key in expected} == expected


def test_rows_belong_to_items_of_the_list():
    for mode in Mode:
        item = category(mode, common_position=True)
        assert item.item[0] == mode.row[0] if mode.moves else item is None
    # Minima (2) > 0 and (7) < 0: the only rows that lead to item 4; pivotting alone is 5a.
    four = {key for key, mode in ROWS.items() if mode.row == "4"}
    assert four == {(1, -1, 0, 1), (1, -1, 1, 1)}


# x* when force and torque act together.


def test_a_contact_is_located_by_the_force_unless_it_lifts():
    pressed = classify(load((0.3, -1.0), 0.2), APART, 0.1)
    assert (pressed.located_by, pressed.significant) == ("force", (1,))
    assert pressed.minima.surface_7 == (0,)
    # Pivotting and sliding about different contacts: the paper's open mode.
    assert (pressed.mode, pressed.common_position) == (Mode.SLIDING_AND_PIVOTTING, False)
    assert pressed.category is Category.PIVOTTING_WITH_SLIDING_APART
    assert category(pressed.mode, True) is Category.PIVOTTING_WITH_SLIDING
    lifted = classify(load((0.3, 1.0), 0.2), APART, 0.5)
    assert (lifted.located_by, lifted.significant) == ("torque", (0,))


@pytest.mark.parametrize(
    ("contacts", "friction", "match"),
    [
        (pocket(0.3), -0.1, "friction"),
        (pocket(0.3), float("nan"), "friction"),
        (pocket(0.3), float("inf"), "friction"),
        (Contacts([[0.0] * 3, [1.0, 0.0, 0.0]], [DOWN] * 2), 0.5, "contact 0 lies at the cen"),
        (Contacts([[0.0, -0.5, 0.0]], [[0.0, 1.0, 0.0]]), 0.5, "point into the grain"),
    ],
)
def test_bad_friction_and_contacts_are_refused(contacts, friction, match):
    with pytest.raises(SceneError, match=match):
        classify(load((0.0, -1.0)), contacts, friction)


@pytest.mark.parametrize(
    ("shift", "vanishes"), [([0.9, 0.9, 0.0], 1), ([1.1, 0.0, 0.0], 0), ([0.0, 0.0, 0.1], 0)]
)
def test_sharing_that_lets_torques_vanish(shift, vanishes):
    square = np.array([[1.0, 1, 0], [1, -1, 0], [-1, -1, 0], [-1, 1, 0]])
    assert can_vanish(square + np.array(shift), 1e-9) == vanishes


# Reaction and friction over a general contact surface, with the paper's scales c_1 and c_2.


def distributed(force, contacts, friction=0.0):
    return distribute(np.array(force), contacts, contacts.points, friction, 1e-12)


@pytest.mark.parametrize("areas", [None, [0.2, 0.7, 0.1]])
@pytest.mark.parametrize("friction", [0.1, 0.4])
def test_ordinary_law_on_a_plane(areas, friction):
    contacts = Contacts([[0, 0, -1], [1, 0, -1], [0, 1, -1]], [DOWN_3D] * 3, areas)
    result = distributed([0.3, 0.0, -2.0], contacts, friction)
    assert result.c_2 == pytest.approx(1.0)
    assert result.pertinent_area == pytest.approx(3.0 if areas is None else 1.0)
    # Coulomb: N = 2, friction the smaller of 0.3 and friction N.
    assert result.force == pytest.approx([-min(0.3, 2.0 * friction), 0.0, 2.0])
    assert result.unbalanced == pytest.approx(np.zeros(3), abs=1e-15)
    parts = np.full(3, 1.0 / 3.0) if areas is None else np.array(areas)
    assert result.reaction[:, 2] == pytest.approx(2.0 * parts)


def test_one_scale_balances_one_component():
    # The paper's disturbing question. Normals 30 degrees to the left and 50 to the right of down, under
    # the weight 1: n . F = cos 30 and cos 50, n . n' = cos 80. The scale balances the first.
    a, b = np.radians(30.0), np.radians(50.0)
    normals = [[-np.sin(a), 0.0, -np.cos(a)], [np.sin(b), 0.0, -np.cos(b)]]
    result = distributed([0.0, 0.0, -1.0], Contacts(normals, normals))
    c_1 = np.cos(a) / (np.cos(a) + np.cos(b) * np.cos(a + b))
    assert result.surface == (0,)
    assert result.c_1 == pytest.approx(c_1)
    other = np.cos(b) - c_1 * (np.cos(a) * np.cos(a + b) + np.cos(b))
    assert result.unbalanced == pytest.approx([0.0, other])
    assert abs(other) > 0.01


def test_where_no_single_scale_exists():
    # Five contacts face x* across a cleft: n . n* = cos 160, n . F = cos 85 against cos 75, and
    # cos 75 + 5 cos 85 cos 160 < 0. Their reactions press x* harder than its own relieves it.
    a, b = np.radians(75.0), np.radians(85.0)
    across = [[np.sin(b), 0.0, -np.cos(b)]] * 5
    normals = np.array([[-np.sin(a), 0.0, -np.cos(a)], *across])
    points = normals + np.array([[0, 0, 0], *[[0, y, 0] for y in range(5)]])
    result = distributed([0.0, 0.0, -1.0], Contacts(points, normals))
    assert np.isnan(result.c_1) and np.isnan(result.c_2)


@pytest.mark.parametrize(
    ("areas", "expected"),
    [
        (None, [0.5, 0.5, 1.0]),
        ([0.2, 0.3, 0.1], [0.2, 0.3, 0.1]),
        ([0.2, 0.0, 0.1], [0.5, 0.5, 1.0]),
    ],
)
def test_measures_of_contacts(areas, expected):
    """Points weigh one a place; areas count where all have one."""
    contacts = Contacts([[0, 0, -1], [0, 0, -1], [1, 0, -1]], [DOWN_3D] * 3, areas)
    assert measures(contacts) == pytest.approx(expected)


# Rotations away from the surface: which axes the contact normals exclude (the paper's Fig. 4).


@pytest.mark.parametrize(
    ("contacts", "place", "counterclockwise", "clockwise"),
    [
        # Normals through both ends of a base divide the plane; the sense decides between the outer parts:
        # counter-clockwise about a point to the left both ends rise.
        (BASE, (-2.0, 3.0), Axis.AWAY, Axis.PRESSED),
        (BASE, (0.0, 0.3), Axis.ENCIRCLED, Axis.ENCIRCLED),
        (BASE, (2.0, -1.0), Axis.PRESSED, Axis.AWAY),
        # About a point above the left end, that end slides and the other rises.
        (BASE, (-1.0, 7.0), Axis.INTERSECTED, Axis.PRESSED),
        (BASE, (1.0, 0.0), Axis.PRESSED, Axis.INTERSECTED),
        # A pocket's normals cross in the centre of the disc: above and below it both senses are excluded.
        (pocket(np.pi / 4), (0.0, 1.0), Axis.ENCIRCLED, Axis.ENCIRCLED),
        (pocket(np.pi / 4), (0.0, -1.0), Axis.ENCIRCLED, Axis.ENCIRCLED),
        (pocket(np.pi / 4), (-1.0, 0.0), Axis.AWAY, Axis.PRESSED),
        (pocket(np.pi / 4), (1.0, 0.0), Axis.PRESSED, Axis.AWAY),
        (pocket(np.pi / 4), (0.0, 0.0), Axis.INTERSECTED, Axis.INTERSECTED),
    ],
)
def test_regions_of_figure_4(contacts, place, counterclockwise, clockwise):
    point = np.array([*place, 0.0])
    senses = [away(contacts, point, sense * ABOUT_Z, TOLERANCE).axis for sense in (1.0, -1.0)]
    assert senses == [counterclockwise, clockwise]


@pytest.mark.parametrize(
    ("contacts", "direction", "expected", "kind"),
    [
        # A box in 3-D, torque about y: beside the edge x = 1, where a turn about +y presses.
        (base(), [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], Axis.ENCIRCLED),
        # The contact below rises if the axis is left of it, x < -1, and the contact on the left leaves its
        # wall if the axis is above it, y > 2: the corner of both.
        (
            Contacts([[-1.0, -3.0, 0.0], [-3.0, 2.0, 0.0]], [DOWN, [-1.0, 0.0, 0.0]]),
            ABOUT_Z,
            [-1.0, 2.0, 0.0],
            Axis.PRESSED,
        ),
        (DOWNSTREAM, ABOUT_Z, [0.0, 0.0, 0.0], Axis.AWAY),
        # A disc's normals all meet its centre, on the edge of what is allowed.
        (Contacts([[0.0, -0.5, 0.0]], [DOWN]), ABOUT_Z, [0.0, 0.0, 0.0], Axis.INTERSECTED),
        # Normals from all around, and a spin about a normal, which always rubs: none.
        (ring(3, 1.0), ABOUT_Z, None, Axis.INTERSECTED),
        (Contacts([[0.0, 0.0, -0.5]], [DOWN_3D]), ABOUT_Z, None, Axis.INTERSECTED),
        (
            Contacts([[x, -0.5, 0.0] for x in np.linspace(-1.0, 1.0, 200)], [DOWN] * 200),
            ABOUT_Z,
            [-1.0, 0.0, 0.0],
            Axis.ENCIRCLED,
        ),
    ],
)
def test_the_nearest_axis_of_a_rotation_away(contacts, direction, expected, kind):
    result = away(contacts, CENTRE, np.array(direction), TOLERANCE)
    assert result.axis is kind
    if expected is None:
        assert result.nearest is None and result.distance == np.inf
    else:
        assert result.nearest == pytest.approx(np.array(expected), abs=1e-8)
        assert result.distance == pytest.approx(np.linalg.norm(expected), abs=1e-8)


def test_everything_is_in_the_dictionary_for_json():
    stored = classify(load((0.3, 0.0), 0.1, (0.0, -1.0)), BASE, 0.5).to_dict()
    assert set(Classification.__dataclass_fields__) <= set(json.loads(json.dumps(stored)))
    assert stored["away"]["axis"] == "ENCIRCLED"
    assert classify(load((0.3, 0.0), 0.0, (0.0, -1.0)), BASE, 0.5).away is None


@st.composite
def cases(draw):
    """A load and one to six contacts on the lower half of a rounded grain, in 2-D or 3-D, from a seed."""
    rng, gdim = np.random.default_rng(draw(st.integers(0, 10**6))), draw(st.sampled_from([2, 3]))
    count, down = draw(st.integers(1, 6)), np.eye(3)[gdim - 1]
    flat = np.array([1.0, 1.0, float(gdim == 3)])
    normals = (rng.normal(size=(count, 3)) - down) * flat
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    normals[:, gdim - 1] = -np.abs(normals[:, gdim - 1])
    points = normals * rng.uniform(0.4, 0.6, (count, 1)) + 0.05 * rng.normal(size=(count, 3)) * flat
    torque = draw(st.sampled_from([0.0, 0.2])) * rng.normal(size=3)
    torque *= 1.0 if gdim == 3 else ABOUT_Z
    areas = rng.uniform(0.1, 1.0, count) if draw(st.booleans()) else None
    weight = -draw(st.sampled_from([0.0, 1.0])) * down
    acting = Load(rng.normal(size=3) * flat, torque, weight, np.zeros(3))
    return acting, Contacts(points, normals, areas), float(rng.uniform(0.0, 1.5))


@settings(max_examples=150, deadline=None)
@given(
    case=cases(),
    seed=st.integers(0, 1000),
    length=st.sampled_from([1e-3, 1.0, 40.0]),
    strength=st.sampled_from([1e-6, 300.0]),
)
def test_turned_moved_and_in_other_units(case, seed, length, strength):
    rng, turn = np.random.default_rng(seed), rotation(seed)
    order = rng.permutation(len(case[1]))
    first = Case(*case, 1.0, np.eye(3))
    other = changed(first, turn, length * rng.normal(size=3), (length, strength, 1.0), order)
    before = classify(first.load, first.contacts, first.friction)
    after = classify(other.load, other.contacts, other.friction)
    assert (after.mode, after.category) == (before.mode, before.category)
    assert {int(order[k]) for k in after.significant} == set(before.significant)
    assert {int(order[k]) for k in after.obstructed_by} == set(before.obstructed_by)
    near = 1e-9 * strength * before.force_scale
    assert after.force == pytest.approx(strength * turn @ before.force, abs=near)
    torque = strength * length * turn @ before.torque
    assert after.torque == pytest.approx(torque, abs=near * length)
    shared, again = before.distribution, after.distribution
    assert again.c_2 == pytest.approx(shared.c_2, rel=1e-6, nan_ok=True)
    size = strength * np.linalg.norm(shared.force)
    assert np.linalg.norm(again.force) == pytest.approx(size, 1e-6, near, nan_ok=True)
    assert (after.away is None) == (before.away is None)
    if before.away is not None:
        assert after.away.axis is before.away.axis
        far = length * before.away.distance
        assert after.away.distance == pytest.approx(far, rel=1e-5, abs=1e-7 * length)


@settings(max_examples=200, deadline=None)
@given(case=cases())
def test_newton_and_coulomb_hold(case):
    # The resultants are the load and the contact forces together; each contact force is in its cone.
    acting, contacts, friction = case
    result = classify(acting, contacts, friction)
    at, answer = list(result.significant), result.reaction + result.friction_force
    moments = np.cross(contacts.points[at] - acting.centre, answer).sum(axis=0)
    assert result.force == pytest.approx(acting.force + answer.sum(axis=0), abs=1e-12)
    assert result.torque == pytest.approx(acting.flow_couple + moments, abs=1e-12)
    inward, along = normal_and_shear(answer, contacts.normals[at])
    assert (inward >= -1e-12).all()
    assert (np.linalg.norm(along, axis=1) <= friction * inward + 1e-9).all()


# The paper's judge beside the exact one: where they must agree, and the reason named where they differ.
#
# In the plane: x downstream, y up, couples counter-clockwise about the third axis; weight one, inertia of a disc.


INERT = (1.0, 0.125 * np.eye(3))  # a disc of radius 1/2: m r^2 / 2
LIGHT = (1.0, 0.1 * np.eye(3))
DISC = Contacts([[0.0, -0.5, 0.0]], [DOWN])
BOX = ends(0.5)


def compared(acting, contacts, friction, inert=INERT):
    paper = criteria.classify(acting, contacts, friction)
    return compare(paper, judged(acting, contacts, friction, inert))


SIDE = Contacts([[0.4, -0.3, 0.0]], [DOWN])
LEAN = np.array([0.0, 0.1])
# A tall body pushed at its head, with much friction and little inertia (as in Painleve's example): it can slip on both
# contacts, pivot about one, or slip on one and leave the other; the paper translates it.
TALL = Contacts(
    [[-0.75, -0.16, 0.0], [-0.88, -1.44, 0.0]],
    np.column_stack([np.sin(LEAN), -np.cos(LEAN), 0.0 * LEAN]),
)
# Hangs on a ledge, whose contact has its normal into the grain, and leans on a wall: 2/3 of the weight, as moments say.
HOOK = Contacts([[1.0, 1.0, 0.0], [0.5, -0.5, 0.0]], [DOWN, [1.0, 0.0, 0.0]])
REASONS = [
    # Couple = R force and friction above the force: contact forces (-force, weight) hold it.
    ((0.3, 0.0), 0.15, DISC, 1.0, INERT, (False, None, "STICK_ANSWERS_FORCE_AND_TORQUE")),
    # Half of (31) at each contact carries cos^2 of the weight; statics needs 1 / (2 cos^2) of it at each.
    ((0.0, 0.0), 0.0, pocket(np.pi / 6), 0.0, INERT, (False, None, "EQUAL_SHARING")),
    # Without friction it stays until push / weight exceeds tan(30 degrees) = 0.577.
    ((0.2, 0.0), 0.0, pocket(np.pi / 6), 0.0, INERT, (False, None, "ONE_CONTACT_AT_A_TIME")),
    ((0.57, 0.0), 0.0, pocket(np.pi / 6), 0.0, INERT, (False, None, "ONE_CONTACT_AT_A_TIME")),
    # The ledge alone does not hold the moment of the weight; that its normal points inward was an error.
    ((0.0, 0.0), 0.0, HOOK, 1.0, INERT, (False, None, "ONE_CONTACT_AT_A_TIME")),
    # Walls 80 degrees from down, friction above tan(10 degrees) = 0.176: the line between the contacts is in both
    # cones, so they can brace one another against any load.
    ((0.0, 5.0), 0.1, pocket(np.radians(80.0)), 0.3, INERT, (False, None, "JAMMED")),
    # A couple of 0.1 on a disc: it rolls if friction > (2/3) tau / (R N) = 0.133.
    ((0.0, 0.0), -0.1, DISC, 0.5, INERT, (True, False, "ROLLING_CALLED_SLIDING")),
    # Pushed with 0.3: rest would need friction 0.3, rolling needs a third of that. In between it rolls, and the paper
    # slides it. With a couple against the push both turn and slide below.
    ((0.3, 0.0), 1e-3, DISC, 0.2, INERT, (True, False, "SLIP_IS_OVERESTIMATED")),
    ((0.3, 0.0), 1e-3, DISC, 0.05, INERT, (True, True, None)),
    # Without a couple of the flow the disc slides, friction 0.05 < 0.1, and friction makes it spin.
    ((0.3, 0.0), 0.0, DISC, 0.05, INERT, (True, False, "FRICTION_TORQUE")),
    # The force lifts by 0.1 and the couple presses less, n . (F + F_tau) = -0.1 + 0.05 0.4 / 0.25. But the contact
    # accelerates into the bed at -0.1 / m + 0.05 0.4 / J: a small inertia presses it.
    ((0.0, 1.1), -0.05, SIDE, 0.0, LIGHT, (True, False, "FORCES_NOT_ACCELERATIONS")),
    ((0.0, 1.1), -0.05, SIDE, 0.0, (1.0, 10.0 * np.eye(3)), (True, True, None)),
    ((-1.73, 0.526), 0.0, TALL, 1.533, (1.0, 0.02 * np.eye(3)), (True, False, "NOT_UNIQUE")),
    ((0.6, 0.0), 0.0, BOX, 0.5, None, (True, None, "MODE_UNKNOWN")),
]


@pytest.mark.parametrize(("force", "couple", "contacts", "friction", "inert", "said"), REASONS)
def test_why_the_criteria_differ(force, couple, contacts, friction, inert, said):
    """One case for each reason, with what statics or dynamics says about it."""
    case = plane_load(force, couple), contacts, friction, inert
    result = compared(*case)
    reason = result.reason and result.reason.name
    assert (result.same_moves, result.same_family, reason) == said
    several = "one of several motions that are possible" in judge(*case).sentence
    assert several == (reason == "NOT_UNIQUE")


@pytest.mark.parametrize("push", 0.5 * (1.0 + np.array([0.0, 1e-12, -1e-12, 3e-9])))
def test_on_the_boundary_round_off_decides_alike_or_is_named(push):
    result = compared(plane_load((push, 0.0)), BOX, 0.5)
    assert result.same_moves or result.reason is Reason.BOUNDARY


def test_every_mode_of_both_judges_has_a_family():
    assert set(FAMILIES) == set(Mode)
    assert set(FAMILY) == set(ExactMode)


thirds = st.integers(-6, 6).map(lambda k: k / 3.0)


@st.composite
def cases_of_agreement(draw):
    """A plane load, one to four contacts below a round grain, friction; often without a couple."""
    count = draw(st.integers(1, 4))
    place = [draw(st.integers(1, 39)) * np.pi / 40 for _ in range(count)]
    tilt = draw(st.sampled_from([None, 0.0, 0.3]))
    points = np.array([[np.cos(a), -np.sin(a), 0.0] for a in place])
    if tilt is None:
        points[:, 1] = -0.7
        normals = np.tile(DOWN, (count, 1))
    else:
        lean = [a + tilt * draw(st.integers(-1, 1)) for a in place]
        normals = np.array([[np.cos(a), -np.sin(a), 0.0] for a in lean])
    couple = draw(st.sampled_from([0.0, 0.0, -0.2, 0.5]))
    return (
        plane_load((draw(thirds), draw(thirds)), couple),
        Contacts(points, normals),
        draw(st.integers(0, 9)) / 7.0,
    )


@settings(max_examples=300, deadline=None)
@given(case=cases_of_agreement())
def test_rest_by_the_paper_is_rest_by_statics(case):
    # (24) and (25) vanish with contact forces in their cones: those balance the load.
    acting, contacts, friction = case
    if not criteria.classify(acting, contacts, friction).moves:
        assert safety_factor(acting, contacts, friction).held


@settings(max_examples=300, deadline=None)
@given(case=cases_of_agreement())
def test_every_difference_has_a_reason(case):
    result = compared(*case)
    assert result.agree == (result.reason in (None, Reason.MODE_UNKNOWN))


@pytest.mark.parametrize(
    ("acting", "contacts", "friction", "words"),
    [
        # Safety factor friction N / F = 0.5 / 0.2, and 0.5 / 0.8.
        (
            plane_load((0.2, 0.0)),
            BOX,
            0.5,
            ["stays at rest", "safety factor 2.5: ", "in agreement"],
        ),
        (
            plane_load((0.8, 0.0)),
            BOX,
            0.5,
            ["begins to move (sliding)", "factor 0.625: ", "would hold"],
        ),
        (
            plane_load((0.0, -1.0)),
            BOX,
            0.5,
            ["stays at rest", "safety factor infinite"],
        ),
        (
            plane_load(),
            BOX,
            0.5,
            ["the flow exerts no load", "there is no incipient motion"],
        ),
        (
            plane_load((0.0, 2.0), weight=(0.0, 1.0)),
            BOX,
            0.5,
            ["factor 0: it moves without any flow"],
        ),
        (
            plane_load((0.0, -2.0), weight=(0.0, 1.0)),
            BOX,
            0.5,
            ["at rest", "moves without any flow, 0.5 to any"],
        ),
        (
            plane_load((0.2, 0.0)),
            pocket(0.5),
            0.0,
            ["they differ: the paper considers the significant contact", "so it rests"],
        ),
    ],
)
def test_the_sentence_of_a_verdict(acting, contacts, friction, words):
    verdict = judge(acting, contacts, friction, INERT)
    for word in words:
        assert word in verdict.sentence
    assert verdict.sentence.index("grain") < verdict.sentence.index("by the paper's criteria")
