"""The paper's criteria in space: blocks and spheres by formula, and frame indifference of every quantity."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from incipient.contact import Contacts, Load, Mode
from incipient.contact import paper as criteria
from incipient.contact.paper.outcomes import Category

DOWN = [0.0, 0.0, -1.0]


def base(half=(1.0, 2.0), height=0.5):
    """The corners of a box's base, a quarter of the area each; the centre of mass is the origin."""
    corners = [[x, y, -height] for x in (-half[0], half[0]) for y in (-half[1], half[1])]
    return Contacts(corners, [DOWN] * 4, [half[0] * half[1]] * 4)


def load(force=(0.0, 0.0, 0.0), couple=(0.0, 0.0, 0.0)):
    """A load about the origin with a weight of one."""
    return Load(force, couple, DOWN, np.zeros(3))


class TestBlock:
    @pytest.mark.parametrize("direction", np.radians([0.0, 30.0, 77.0, 200.0]))
    @pytest.mark.parametrize(
        ("push", "mode"), [(0.39, Mode.NO_INCIPIENT_MOTION), (0.41, Mode.SLIDING)]
    )
    def test_slides_in_any_direction_at_the_friction_angle(self, direction, push, mode):
        ahead = np.array([np.cos(direction), np.sin(direction), 0.0])
        verdict = criteria.classify(load(push * ahead), base(), 0.4)
        assert verdict.mode is mode
        # (3): what is left is the push beyond friction N = 0.4, and the scale of a plane is one.
        assert verdict.force == pytest.approx(max(push - 0.4, 0.0) * ahead, abs=1e-12)
        assert verdict.distributions.of_force.c_2 == pytest.approx(1.0)

    @pytest.mark.parametrize(("height", "topples"), [(3.3, False), (3.4, True)])
    def test_topples_over_the_nearer_edge(self, height, topples):
        # Pushed along x with 0.3 at the height of the centre: over the edge at half = 1 once 0.3 h > 1.
        verdict = criteria.classify(load((0.3, 0.0, 0.0)), base(height=height), 0.4)
        assert verdict.mode is (Mode.PIVOTTING if topples else Mode.NO_INCIPIENT_MOTION)
        if topples:
            assert verdict.category is Category.ROTATION_ONLY
            assert verdict.couple[1] > 0.0

    def test_spin_of_a_block_presses_nothing(self):
        # A couple along the normals: minimum (7) is zero. Each corner is pressed by the load of the paper.
        verdict = criteria.classify(load(couple=(0.0, 0.0, 0.2)), base(), 0.4)
        assert verdict.minima.sign_7 == 0
        assert not verdict.away_from_surface
        assert verdict.moves


class TestSphere:
    def test_lifts(self):
        normals = np.array([[0.5, 0.0, -np.sqrt(0.75)], [-0.25, 0.433013, -np.sqrt(0.75)]])
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        verdict = criteria.classify(load((0.1, 0.0, 1.5)), Contacts(0.5 * normals, normals), 0.4)
        assert verdict.mode is Mode.LIFTING
        assert verdict.force == pytest.approx([0.1, 0.0, 0.5])

    def test_downstream_contact_is_significant(self):
        angles = np.radians([60.0, -60.0, 180.0])
        normals = np.column_stack(
            [np.cos(angles), np.sin(angles), np.full(3, -np.sqrt(2.0))]
        ) / np.sqrt(3.0)
        contacts = Contacts(0.5 * normals, normals)
        for push, contact in (((0.1, 0.1, 0.0), 0), ((0.1, -0.1, 0.0), 1), ((-0.1, 0.0, 0.0), 2)):
            assert criteria.classify(load(push), contacts, 0.3).significant == (contact,)
        # Through the gap between the first two: both.
        assert criteria.classify(load((0.1, 0.0, 0.0)), contacts, 0.3).significant == (0, 1)


@st.composite
def cases(draw):
    """A load in space and one to six contacts on the lower half of a rounded grain, from a seed."""
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    count = draw(st.integers(1, 6))
    normals = rng.normal(size=(count, 3)) * [1.0, 1.0, 0.5] - [0.0, 0.0, 1.0]
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    points = normals * rng.uniform(0.4, 0.6, (count, 1)) + 0.05 * rng.normal(size=(count, 3))
    couple = rng.normal(size=3) * draw(st.sampled_from([0.0, 0.2]))
    areas = rng.uniform(0.1, 1.0, count) if draw(st.booleans()) else None
    acting = Load(
        rng.normal(size=3), couple, [0.0, 0.0, -draw(st.sampled_from([0.0, 1.0]))], np.zeros(3)
    )
    return acting, Contacts(points, normals, areas), float(rng.uniform(0.0, 1.5))


def turned(seed):
    """A random rotation (3, 3)."""
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.linalg.det(q)


class TestFrameIndifference:
    @settings(max_examples=150, deadline=None)
    @given(
        case=cases(),
        seed=st.integers(0, 1000),
        length=st.sampled_from([1e-3, 1.0, 40.0]),
        strength=st.sampled_from([1e-6, 300.0]),
    )
    def test_every_quantity(self, case, seed, length, strength):
        acting, contacts, friction = case
        rng, turn = np.random.default_rng(seed), turned(seed)
        shift, order = rng.normal(size=3), rng.permutation(len(contacts))
        before = criteria.classify(acting, contacts, friction)
        moved = Load(
            strength * turn @ acting.flow_force,
            strength * length * turn @ acting.flow_couple,
            strength * turn @ acting.weight,
            length * turn @ shift,
        )
        points = length * (contacts.points + shift) @ turn.T
        areas = None if contacts.areas is None else length**2 * contacts.areas[order]
        normals = contacts.normals[order] @ turn.T
        after = criteria.classify(moved, Contacts(points[order], normals, areas), friction)
        assert (after.mode, after.category) == (before.mode, before.category)
        scale = strength * before.force_scale
        assert after.force == pytest.approx(strength * turn @ before.force, abs=1e-9 * scale)
        assert after.couple == pytest.approx(
            strength * length * turn @ before.couple, abs=1e-9 * scale * length
        )
        self.same_distributions(before, after, scale)
        assert (after.away is None) == (before.away is None)
        if before.away is not None:
            assert after.away.axis is before.away.axis
            far = length * before.away.distance
            assert after.away.distance == pytest.approx(far, rel=1e-5, abs=1e-7 * length)

    @staticmethod
    def same_distributions(before, after, scale):
        for name in ("of_force", "of_couple", "of_both"):
            one, other = getattr(before.distributions, name), getattr(after.distributions, name)
            assert other.c_2 == pytest.approx(one.c_2, rel=1e-6, nan_ok=True)
            size = np.linalg.norm(one.force)
            assert np.linalg.norm(other.force) == pytest.approx(
                scale / before.force_scale * size, rel=1e-6, abs=1e-9 * scale, nan_ok=True
            )

    @settings(max_examples=100, deadline=None)
    @given(case=cases(), times=st.integers(2, 4))
    def test_splitting_a_contact(self, case, times):
        acting, contacts, friction = case
        before = criteria.classify(acting, contacts, friction)
        again = [0] * times + list(range(1, len(contacts)))
        areas = None
        if contacts.areas is not None:
            areas = contacts.areas[again]
            areas[:times] /= times
        after = criteria.classify(
            acting, Contacts(contacts.points[again], contacts.normals[again], areas), friction
        )
        assert after.mode is before.mode
        assert after.force == pytest.approx(before.force, abs=1e-12)
        assert after.distributions.of_both.c_2 == pytest.approx(
            before.distributions.of_both.c_2, rel=1e-9, nan_ok=True
        )
