"""Reaction and friction over a general contact surface, with the paper's scales c_1 and c_2, against formulae."""

import numpy as np
import pytest

from incipient.contact import Contacts, Load
from incipient.contact import paper as criteria
from incipient.contact.paper.equations import distribute, measures

DOWN = [0.0, 0.0, -1.0]


def distributed(force, contacts, friction=0.0, centre=(0.0, 0.0, 0.0)):
    """The distribution under a force alone."""
    pressing = np.broadcast_to(np.array(force, dtype=float), contacts.points.shape)
    return distribute(pressing, contacts, contacts.points - np.array(centre), friction, 1e-12)


def ring(count, angle, radius=0.5):
    """Contacts of a sphere about the origin, `count` of them at `angle` from straight down."""
    turn = 2.0 * np.pi * np.arange(count) / count
    lean = np.full(count, np.sin(angle))
    normals = np.column_stack(
        [lean * np.cos(turn), lean * np.sin(turn), np.full(count, -np.cos(angle))]
    )
    return Contacts(radius * normals, normals)


class TestPlane:
    """On a plane the general law is the ordinary one: c_2 = 1, whatever the parts of the surface."""

    @pytest.mark.parametrize("areas", [None, [0.2, 0.7, 0.1]])
    @pytest.mark.parametrize("friction", [0.1, 0.4])
    def test_ordinary_law(self, areas, friction):
        contacts = Contacts([[0, 0, -1], [1, 0, -1], [0, 1, -1]], [DOWN] * 3, areas)
        found = distributed([0.3, 0.0, -2.0], contacts, friction)
        assert found.c_2 == pytest.approx(1.0)
        assert found.pertinent_area == pytest.approx(3.0 if areas is None else 1.0)
        # Coulomb: N = 2, friction the smaller of 0.3 and friction N.
        assert found.force == pytest.approx([-min(0.3, 2.0 * friction), 0.0, 2.0])
        assert found.unbalanced == pytest.approx(np.zeros(3), abs=1e-15)
        parts = np.full(3, 1.0 / 3.0) if areas is None else np.array(areas)
        assert found.reaction[:, 2] == pytest.approx(2.0 * parts)

    def test_couple_of_a_patch_is_that_of_its_centroid(self):
        contacts = Contacts([[-1, 0, -1], [2, 0, -1]], [DOWN] * 2, [2.0, 1.0])
        # Areas 2 and 1 at -1 and 2: the centroid lies below the centre, so the reaction has no couple.
        assert distributed([0.0, 0.0, -3.0], contacts).couple == pytest.approx(
            np.zeros(3), abs=1e-15
        )

    def test_a_force_that_lifts_is_not_answered(self):
        found = distributed([0.0, 0.0, 1.0], Contacts([[0, 0, -1]], [DOWN]))
        assert (found.c_1, found.c_2, found.pertinent_area) == (0.0, 0.0, 0.0)
        assert found.force == pytest.approx(np.zeros(3))


class TestCurved:
    @pytest.mark.parametrize("count", [2, 3, 4, 7])
    @pytest.mark.parametrize("angle", np.radians([10.0, 35.0, 44.0]))
    def test_sphere_in_a_ring_of_contacts(self, count, angle):
        # All n . F = W cos(angle), and the sum of n . n* over the ring is count cos^2: c_2 = 1 / cos^2, with
        # which the weight is balanced. (31) with c_2 = 1 would leave the fraction sin^2 of it.
        found = distributed([0.0, 0.0, -1.0], ring(count, angle))
        assert found.c_1 == pytest.approx(1.0 / (count * np.cos(angle) ** 2))
        assert found.c_2 == pytest.approx(1.0 / np.cos(angle) ** 2)
        assert found.force == pytest.approx([0.0, 0.0, 1.0])
        assert found.couple == pytest.approx(np.zeros(3), abs=1e-15)

    def test_spherical_cup(self):
        # A sphere in a cup that fits it, up to the angle a: c_2 = area / int cos^2 dA
        # = 3 (1 - cos a) / (1 - cos^3 a).
        edge, rings = np.radians(60.0), 400
        angles = (np.arange(rings) + 0.5) * edge / rings
        parts = [ring(8, angle) for angle in angles]
        areas = np.repeat(np.sin(angles) / 8.0, 8)
        cup = Contacts(
            np.vstack([p.points for p in parts]), np.vstack([p.normals for p in parts]), areas
        )
        found = distributed([0.0, 0.0, -1.0], cup)
        # n* is the innermost ring, half a step from straight down.
        assert found.c_2 == pytest.approx(
            3.0 * (1.0 - np.cos(edge)) / (1.0 - np.cos(edge) ** 3), rel=1e-4
        )
        assert found.force == pytest.approx([0.0, 0.0, 1.0], rel=1e-4)

    def test_one_scale_balances_one_component(self):
        # The paper's disturbing question. Normals 30 degrees to the left and 50 to the right of down, under
        # the weight 1: n . F = cos 30 and cos 50, n . n' = cos 80. The scale balances the first.
        a, b = np.radians(30.0), np.radians(50.0)
        normals = [[-np.sin(a), 0.0, -np.cos(a)], [np.sin(b), 0.0, -np.cos(b)]]
        found = distributed([0.0, 0.0, -1.0], Contacts(normals, normals))
        c_1 = np.cos(a) / (np.cos(a) + np.cos(b) * np.cos(a + b))
        assert found.surface == (0,)
        assert found.c_1 == pytest.approx(c_1)
        other = np.cos(b) - c_1 * (np.cos(a) * np.cos(a + b) + np.cos(b))
        assert found.unbalanced == pytest.approx([0.0, other])
        assert abs(other) > 0.01

    def test_where_no_single_scale_exists(self):
        # Five contacts face x* across a cleft: n . n* = cos 160, n . F = cos 85 against cos 75, and
        # cos 75 + 5 cos 85 cos 160 < 0. Their reactions press x* harder than its own relieves it.
        a, b = np.radians(75.0), np.radians(85.0)
        across = [[np.sin(b), 0.0, -np.cos(b)]] * 5
        normals = np.array([[-np.sin(a), 0.0, -np.cos(a)], *across])
        points = normals + np.array([[0, 0, 0], *[[0, y, 0] for y in range(5)]])
        found = distributed([0.0, 0.0, -1.0], Contacts(points, normals))
        assert np.isnan(found.c_1)
        assert np.isnan(found.c_2)


class TestMeasure:
    def test_points_weigh_one_a_place(self):
        contacts = Contacts([[0, 0, -1], [0, 0, -1], [1, 0, -1]], [DOWN] * 3)
        assert measures(contacts) == pytest.approx([0.5, 0.5, 1.0])

    def test_areas_where_all_have_one(self):
        points = [[0, 0, -1], [1, 0, -1]]
        assert measures(Contacts(points, [DOWN] * 2, [0.2, 0.3])) == pytest.approx([0.2, 0.3])
        assert measures(Contacts(points, [DOWN] * 2, [0.2, 0.0])) == pytest.approx([1.0, 1.0])

    @pytest.mark.parametrize("areas", [None, [0.3, 0.4, 0.5]])
    def test_splitting_a_contact_changes_nothing(self, areas):
        whole = ring(3, 0.4)
        whole = Contacts(whole.points, whole.normals, areas)
        again = [0, 0, 1, 2]
        parts = None if areas is None else [0.1, 0.2, 0.4, 0.5]
        split = Contacts(whole.points[again], whole.normals[again], parts)
        before, after = (distributed([0.2, 0.1, -1.0], c, 0.2) for c in (whole, split))
        assert after.force == pytest.approx(before.force)
        assert after.couple == pytest.approx(before.couple)
        assert after.c_2 == pytest.approx(before.c_2)


class TestInTheClassification:
    def test_a_couple_at_one_contact_gives_the_force_of_uncoupling(self):
        # Below (8): F = (n . F_tau) n_in - C [F_tau - (n . F_tau) n]: the distribution with c_2 = 1.
        contacts = Contacts([[0.5, -0.5, 0.0]], [[0.0, -1.0, 0.0]])
        acting = Load([0, 0, 0], [0, 0, -0.2], [0, 0, 0], [0, 0, 0])
        verdict = criteria.classify(acting, contacts, 0.3)
        spread = verdict.distributions.of_couple
        assert spread.c_2 == pytest.approx(1.0)
        assert spread.force == pytest.approx(verdict.force)
        assert verdict.distributions.couple_left == pytest.approx(verdict.couple)

    def test_force_and_couple_press_together(self):
        # At one contact (24) and (25) are the distribution of both.
        contacts = Contacts([[0.2, -0.5, 0.0]], [[0.0, -1.0, 0.0]])
        acting = Load([0.3, -1.0, 0.0], [0, 0, -0.1], [0, 0, 0], [0, 0, 0])
        verdict = criteria.classify(acting, contacts, 0.1)
        assert verdict.distributions.of_both.pressing == pytest.approx(verdict.F_flow_g_and_tau)
        assert verdict.distributions.force_left == pytest.approx(verdict.force)
        assert verdict.distributions.couple_left == pytest.approx(verdict.couple)

    def test_pocket_that_one_scale_balances(self):
        # Equal sharing of (31) leaves the disc unsupported, see test_criteria.py::TestPocket; the general
        # distribution holds it.
        pocket = ring(2, np.pi / 6)
        verdict = criteria.classify(Load([0, 0, 0], [0, 0, 0], [0, 0, -1], [0, 0, 0]), pocket, 0.0)
        assert verdict.moves
        assert verdict.distributions.of_force.c_2 == pytest.approx(4.0 / 3.0)
        assert verdict.distributions.force_left == pytest.approx(np.zeros(3), abs=1e-15)
