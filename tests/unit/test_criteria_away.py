"""Rotations away from the surface: which axes the contact normals exclude (the paper's Fig. 4)."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from incipient.contact import Contacts, Load
from incipient.contact import paper as criteria
from incipient.contact.paper.away import Axis, away, kinds_of_axes, levers, nearest_axis
from incipient.contact.paper.outcomes import Category, Mode, category
from incipient.errors import SceneError

DOWN = [0.0, -1.0, 0.0]
ABOUT_Z, CENTRE, TOLERANCE = np.array([0.0, 0.0, 1.0]), np.zeros(3), 1e-9

# The base of a box, half base 1, its centre of mass half a length above.
BASE = Contacts([[-1.0, -0.5, 0.0], [1.0, -0.5, 0.0]], [DOWN, DOWN])


def kinds(points, contacts, direction=ABOUT_Z):
    return kinds_of_axes(np.array(points, dtype=float), direction, contacts, TOLERANCE)


class TestRegionsOfFigure4:
    """Normals through both ends of a base divide the plane; the sense decides between the outer parts."""

    def test_box(self):
        points = [[-2.0, 3.0, 0], [0.0, 0.3, 0], [2.0, -1.0, 0], [-1.0, 7.0, 0], [1.0, 0.0, 0]]
        assert (
            kinds(points, BASE)
            == [
                Axis.AWAY,  # counter-clockwise about a point to the left: both ends rise
                Axis.ENCIRCLED,
                Axis.PRESSED,
                Axis.INTERSECTED,  # about a point above the left end, that end slides and the other rises
                Axis.PRESSED,
            ]
        )
        assert kinds(points, BASE, -ABOUT_Z) == [
            Axis.PRESSED,
            Axis.ENCIRCLED,
            Axis.AWAY,
            Axis.PRESSED,
            Axis.INTERSECTED,
        ]

    def test_pocket_excludes_both_senses_above_and_below(self):
        # Normals 45 degrees to either side cross in the centre of the disc. Above and below it they pass on
        # both sides; to the left and to the right of it one sense is free.
        normals = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0]]) / np.sqrt(2.0)
        pocket = Contacts(normals, normals)
        found = kinds([[0, 1, 0], [0, -1, 0], [-1, 0, 0], [1, 0, 0], [0, 0, 0]], pocket)
        # Counter-clockwise about a point to the left both contacts, right of it, rise.
        assert found == [Axis.ENCIRCLED, Axis.ENCIRCLED, Axis.AWAY, Axis.PRESSED, Axis.INTERSECTED]

    def test_lever_is_the_rate_at_which_a_contact_is_pressed(self):
        rng = np.random.default_rng(1)
        points, normals = rng.normal(size=(5, 3)), rng.normal(size=(5, 3))
        contacts = Contacts(points, normals / np.linalg.norm(normals, axis=1)[:, None])
        axis, through = np.array([0.0, 0.6, 0.8]), rng.normal(size=(1, 3))
        velocity = np.cross(axis, points - through)
        assert levers(through, axis, contacts)[0] == pytest.approx(
            (velocity * contacts.normals).sum(axis=1)
        )


class TestNearestAxis:
    """The paper's principle of least action: the nearest point to the centre of mass that is not excluded."""

    @pytest.mark.parametrize(("direction", "x"), [(ABOUT_Z, -1.0), (-ABOUT_Z, 1.0)])
    def test_box_turns_about_a_point_beside_its_end(self, direction, x):
        found = away(BASE, CENTRE, direction, TOLERANCE)
        assert found.axis is Axis.ENCIRCLED
        assert found.levers == pytest.approx([-x, x])
        assert found.nearest == pytest.approx([x, 0.0, 0.0], abs=1e-8)
        assert found.distance == pytest.approx(1.0)

    def test_box_in_space(self):
        # The base's corners at x = +-1, y = +-2, couple about y: as in the plane, beside the edge x = 1,
        # where a turn about +y (which takes +x down) presses.
        corners = np.array([[x, y, -0.5] for x in (-1.0, 1.0) for y in (-2.0, 2.0)])
        base = Contacts(corners, np.tile([0.0, 0.0, -1.0], (4, 1)))
        found = nearest_axis(base, CENTRE, np.array([0.0, 1.0, 0.0]), TOLERANCE)
        assert found == pytest.approx([1.0, 0.0, 0.0], abs=1e-8)

    def test_corner_of_two_normals(self):
        # Counter-clockwise the contact below rises if the axis is left of it, x < -1, and the contact on the
        # left leaves its wall if the axis is above it, y > 2. Nearest to the centre: (-1, 2).
        contacts = Contacts([[-1.0, -3.0, 0.0], [-3.0, 2.0, 0.0]], [DOWN, [-1.0, 0.0, 0.0]])
        found = nearest_axis(contacts, CENTRE, ABOUT_Z, TOLERANCE)
        assert found == pytest.approx([-1.0, 2.0, 0.0], abs=1e-8)

    def test_the_centre_itself(self):
        one = Contacts([[0.5, -0.5, 0.0]], [DOWN])
        assert nearest_axis(one, CENTRE, ABOUT_Z, TOLERANCE) == pytest.approx(CENTRE)
        # A disc's normals all meet its centre, on the edge of what is allowed.
        disc = Contacts([[0.0, -0.5, 0.0]], [DOWN])
        found = away(disc, CENTRE, ABOUT_Z, TOLERANCE)
        assert (found.axis, found.distance) == (Axis.INTERSECTED, 0.0)

    def test_none_where_normals_come_from_all_around(self):
        angles = 2.0 * np.pi * np.arange(3) / 3
        normals = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(3)])
        held = away(Contacts(normals, normals), CENTRE, ABOUT_Z, TOLERANCE)
        assert held.nearest is None
        assert held.distance == np.inf

    def test_spin_about_a_normal_always_rubs(self):
        sphere = Contacts([[0.0, 0.0, -0.5]], [[0.0, 0.0, -1.0]])
        found = away(sphere, CENTRE, ABOUT_Z, TOLERANCE)
        assert found.axis is Axis.INTERSECTED
        assert found.nearest is None

    @settings(max_examples=100, deadline=None)
    @given(seed=st.integers(0, 10**6), count=st.integers(1, 6))
    def test_nothing_nearer_is_allowed(self, seed, count):
        # Against a search on a grid of points around the centre.
        rng = np.random.default_rng(seed)
        angles = rng.uniform(np.pi, 2.0 * np.pi, count)
        points = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(count)])
        leaning = angles + rng.uniform(-0.5, 0.5, count)
        contacts = Contacts(
            points, np.column_stack([np.cos(leaning), np.sin(leaning), np.zeros(count)])
        )
        found = nearest_axis(contacts, CENTRE, ABOUT_Z, TOLERANCE)
        x, y = np.meshgrid(np.linspace(-3, 3, 41), np.linspace(-3, 3, 41))
        grid = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
        free = grid[(levers(grid, ABOUT_Z, contacts) < -1e-6).all(axis=1)]
        if found is None:
            assert len(free) == 0
            return
        assert (levers(found[None], ABOUT_Z, contacts) <= 1e-8).all()
        assert len(free) == 0 or np.linalg.norm(free, axis=1).min() >= np.linalg.norm(found) - 1e-7

    def test_hundreds_of_contacts(self):
        x = np.linspace(-1.0, 1.0, 200)
        patch = Contacts(np.column_stack([x, np.full(200, -0.5), np.zeros(200)]), [DOWN] * 200)
        assert nearest_axis(patch, CENTRE, ABOUT_Z, TOLERANCE) == pytest.approx(
            [-1.0, 0.0, 0.0], abs=1e-8
        )


class TestInTheClassification:
    @pytest.mark.parametrize(("couple", "axis"), [(0.3, Axis.AWAY), (-0.3, Axis.PRESSED)])
    def test_agrees_with_minimum_7(self, couple, axis):
        acting = Load([0, 0, 0], [0, 0, couple], [0, 0, 0], [0, 0, 0])
        verdict = criteria.classify(acting, Contacts([[1.0, -2.0, 0.0]], [DOWN]), 0.5)
        assert verdict.away.axis is axis
        assert verdict.away_from_surface is (axis is Axis.AWAY)

    def test_without_a_couple_there_is_no_axis(self):
        acting = Load([0.3, 0, 0], [0, 0, 0], [0, -1, 0], [0, 0, 0])
        assert criteria.classify(acting, BASE, 0.5).away is None

    def test_in_json(self):
        acting = Load([0.3, 0, 0], [0, 0, 0.1], [0, -1, 0], [0, 0, 0])
        stored = json.loads(json.dumps(criteria.classify(acting, BASE, 0.5).to_dict()))
        assert stored["away"]["axis"] == Axis.ENCIRCLED.value
        assert stored["distributions"]["of_force"]["c_2"] == pytest.approx(1.0)
        assert stored["category"]["item"].startswith("6")


class TestListOfModes:
    """The paper's list, with 6(a) and 6(b) apart, beside its table of outcomes."""

    def test_every_outcome_has_its_item(self):
        assert [item.item for item in Category] == ["1", "2", "3", "4", "5", "6(a)", "6(b)"]
        for mode in Mode:
            item = category(mode, common_position=True)
            assert (item is None) == (not mode.moves)
            assert item is None or item.item[0] == mode.row[0]

    def test_pivot_and_slide_apart(self):
        # Force pressed at the right, couple at the left: (2) and (7) have their minima at different contacts.
        contacts = Contacts(
            [[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0]], [[-0.6, -0.8, 0.0], [0.6, -0.8, 0.0]]
        )
        acting = Load([0.3, -1.0, 0.0], [0, 0, 0.2], [0, 0, 0], [0, 0, 0])
        verdict = criteria.classify(acting, contacts, 0.1)
        assert (verdict.mode, verdict.common_position) == (Mode.SLIDING_AND_PIVOTTING, False)
        assert verdict.category is Category.PIVOTTING_WITH_SLIDING_APART
        assert category(verdict.mode, True) is Category.PIVOTTING_WITH_SLIDING


def test_normals_into_the_grain_are_refused():
    acting = Load([0, 0, 0], [0, 0, 0], [0, -1, 0], [0, 0, 0])
    with pytest.raises(SceneError, match="point into the grain"):
        criteria.classify(acting, Contacts([[0.0, -0.5, 0.0]], [[0.0, 1.0, 0.0]]), 0.5)
