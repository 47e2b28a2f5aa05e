"""The paper's judge beside the exact one: where they must agree, and the reason named where they differ.

In the plane: x downstream, y up, couples counter-clockwise about the third axis; weight one, inertia of a disc.
"""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from incipient.contact import Contacts, Load, safety_factor
from incipient.contact import paper as criteria
from incipient.contact.acceleration import Mode as ExactMode
from incipient.contact.paper.outcomes import Mode
from incipient.contact.verdict import (
    FAMILIES,
    FAMILY,
    Family,
    Reason,
    compare,
    judge,
    judged,
)

DOWN = [0.0, -1.0, 0.0]
INERT = (1.0, 0.125 * np.eye(3))  # a disc of radius 1/2: m r^2 / 2
DISC = Contacts([[0.0, -0.5, 0.0]], [DOWN])


def load(force=(0.0, 0.0), couple=0.0, weight=1.0):
    """A load in the plane about a centre of mass at the origin."""
    return Load([*force, 0.0], [0.0, 0.0, couple], [0.0, -weight, 0.0], [0.0, 0.0, 0.0])


def pocket(angle, radius=0.5):
    """Contacts of a disc in a symmetric pocket, normals `angle` to either side of down."""
    normals = np.array(
        [[-np.sin(angle), -np.cos(angle), 0.0], [np.sin(angle), -np.cos(angle), 0.0]]
    )
    return Contacts(radius * normals, normals)


def box(height, half=0.5):
    """The base of a box by its ends."""
    return Contacts([[-half, -height, 0.0], [half, -height, 0.0]], [DOWN, DOWN], [half, half])


def compared(acting, contacts, friction, inert=INERT):
    paper = criteria.classify(acting, contacts, friction)
    return compare(paper, judged(acting, contacts, friction, inert))


class TestReasons:
    """One case for each reason, with what statics or dynamics says about it."""

    def test_balanced_disc(self):
        # Couple = R force and friction above the force: contact forces (-force, weight) hold it.
        found = compared(load((0.3, 0.0), 0.15), DISC, 1.0)
        assert not found.same_moves
        assert found.reason is Reason.STICK_ANSWERS_FORCE_AND_TORQUE

    def test_equal_sharing_in_a_pocket(self):
        # Half of (31) at each contact carries cos^2 of the weight; statics needs 1 / (2 cos^2) of it at each.
        found = compared(load(), pocket(np.pi / 6), 0.0)
        assert (found.same_moves, found.reason) == (False, Reason.EQUAL_SHARING)

    @pytest.mark.parametrize("push", [0.2, 0.57])
    def test_pocket_needs_the_other_contact(self, push):
        # Without friction it stays until push / weight exceeds tan(30 degrees) = 0.577.
        found = compared(load((push, 0.0)), pocket(np.pi / 6), 0.0)
        assert (found.same_moves, found.reason) == (False, Reason.ONE_CONTACT_AT_A_TIME)

    def test_wedge(self):
        # Walls 80 degrees from down, friction above tan(10 degrees) = 0.176: the line between the contacts
        # is in both cones, so they can brace one another against any load.
        found = compared(load((0.0, 5.0), 0.1), pocket(np.radians(80.0)), 0.3)
        assert (found.same_moves, found.reason) == (False, Reason.JAMMED)

    def test_rolling(self):
        # A couple of 0.1 on a disc: it rolls if friction > (2/3) tau / (R N) = 0.133.
        found = compared(load(couple=-0.1), DISC, 0.5)
        assert (found.same_moves, found.same_family) == (True, False)
        assert found.reason is Reason.ROLLING_CALLED_SLIDING

    @pytest.mark.parametrize(
        ("friction", "reason"), [(0.2, Reason.SLIP_IS_OVERESTIMATED), (0.05, None)]
    )
    def test_friction_that_a_rolling_disc_needs(self, friction, reason):
        # Pushed with 0.3: rest would need friction 0.3, rolling needs a third of that. In between it rolls,
        # and the paper slides it. With a couple against the push both turn and slide below.
        found = compared(load((0.3, 0.0), 1e-3), DISC, friction)
        assert found.reason is reason

    def test_friction_turns_what_the_paper_translates(self):
        # Without a couple of the flow the disc slides, friction 0.05 < 0.1, and friction makes it spin.
        found = compared(load((0.3, 0.0)), DISC, 0.05)
        assert (found.same_family, found.reason) == (False, Reason.FRICTION_TORQUE)

    def test_inertia_decides_what_lifting_becomes(self):
        # The force lifts by 0.1 and the couple presses less, n . (F + F_tau) = -0.1 + 0.05 0.4 / 0.25. But the
        # contact accelerates into the bed at -0.1 / m + 0.05 0.4 / J: a small inertia presses it.
        contacts = Contacts([[0.4, -0.3, 0.0]], [DOWN])
        acting = Load([0.0, 1.1, 0.0], [0.0, 0.0, -0.05], [0.0, -1.0, 0.0], [0.0, 0.0, 0.0])
        light, heavy = (compared(acting, contacts, 0.0, (1.0, j * np.eye(3))) for j in (0.1, 10.0))
        assert light.reason is Reason.FORCES_NOT_ACCELERATIONS
        assert heavy.agree

    def test_boundary(self):
        # Friction equal to push / weight: round-off decides, and decides alike or is named.
        for push in (0.5, 0.5 * (1.0 + 1e-12), 0.5 * (1.0 - 1e-12), 0.5 * (1.0 + 3e-9)):
            found = compared(load((push, 0.0)), box(0.1), 0.5)
            assert found.same_moves or found.reason is Reason.BOUNDARY

    def test_several_motions(self):
        # A tall body pushed at its head, with much friction and little inertia (as in Painleve's example): it
        # can slip on both contacts, pivot about one, or slip on one and leave the other; the paper translates it.
        lean = np.array([0.0, 0.1])
        normals = np.column_stack([np.sin(lean), -np.cos(lean), 0.0 * lean])
        contacts = Contacts([[-0.75, -0.16, 0.0], [-0.88, -1.44, 0.0]], normals)
        acting, inert = load((-1.73, 0.526)), (1.0, 0.02 * np.eye(3))
        found = compared(acting, contacts, 1.533, inert)
        assert (found.same_moves, found.reason) == (True, Reason.NOT_UNIQUE)
        assert (
            "one of several motions that are possible"
            in judge(acting, contacts, 1.533, inert).sentence
        )

    def test_without_mass_the_mode_is_unknown(self):
        found = compared(load((0.6, 0.0)), box(0.1), 0.5, None)
        assert (found.same_moves, found.same_family) == (True, None)
        assert found.agree
        assert found.reason is Reason.MODE_UNKNOWN

    def test_every_reason_is_a_sentence(self):
        for reason in Reason:
            assert reason.value[0].islower()
            assert not reason.value.endswith(".")


def test_every_mode_of_both_judges_has_a_family():
    assert set(FAMILIES) == set(Mode)
    assert set(FAMILY) == set(ExactMode)
    assert [mode for mode, family in FAMILY.items() if not family] == [ExactMode.REST]
    assert FAMILIES[Mode.SLIDING_AND_PIVOTTING] == (Family.SLIDES | Family.TURNS,)


class TestRest:
    @pytest.mark.parametrize("slope", np.radians([10.0, 25.0, 40.0]))
    @pytest.mark.parametrize("friction", [0.0, 0.3, 0.6])
    @pytest.mark.parametrize("height", [0.2, 0.9, 3.0])
    def test_block_on_an_incline(self, slope, friction, height):
        # It slides if tan(slope) > friction, else topples if tan(slope) > half base / height.
        acting = Load([0, 0, 0], [0, 0, 0], [np.sin(slope), -np.cos(slope), 0.0], [0, 0, 0])
        inert = (1.0, (4 * height**2 + 1.0) / 12.0 * np.eye(3))
        found = compared(acting, box(height), friction, inert)
        slides, topples = np.tan(slope) > friction, np.tan(slope) > 0.5 / height
        assert judged(acting, box(height), friction).moves == (slides or topples)
        if not slides and not topples:
            assert found.agree


thirds = st.integers(-6, 6).map(lambda k: k / 3.0)


@st.composite
def cases(draw):
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
        load((draw(thirds), draw(thirds)), couple),
        Contacts(points, normals),
        draw(st.integers(0, 9)) / 7.0,
    )


class TestTheorems:
    @settings(max_examples=300, deadline=None)
    @given(case=cases())
    def test_rest_by_the_paper_is_rest_by_statics(self, case):
        # (24) and (25) vanish with contact forces in their cones: those balance the load.
        acting, contacts, friction = case
        if not criteria.classify(acting, contacts, friction).moves:
            assert safety_factor(acting, contacts, friction).held

    @settings(max_examples=300, deadline=None)
    @given(case=cases())
    def test_every_difference_has_a_reason(self, case):
        found = compared(*case)
        assert found.agree == (found.reason in (None, Reason.MODE_UNKNOWN))


class TestVerdict:
    @pytest.mark.parametrize(
        ("acting", "contacts", "friction", "words"),
        [
            # Safety factor friction N / F = 0.5 / 0.2, and 0.5 / 0.8.
            (
                load((0.2, 0.0)),
                box(0.1),
                0.5,
                ["stays at rest", "safety factor 2.5: ", "in agreement"],
            ),
            (
                load((0.8, 0.0)),
                box(0.1),
                0.5,
                ["begins to move (sliding)", "factor 0.625: ", "would hold"],
            ),
            (load((0.0, -1.0)), box(0.1), 0.5, ["stays at rest", "safety factor infinite"]),
            (load(), box(0.1), 0.5, ["the flow exerts no load", "there is no incipient motion"]),
            (load((0.0, 2.0), weight=-1.0), box(0.1), 0.5, ["factor 0: its weight alone moves it"]),
            (
                load((0.0, -2.0), weight=-1.0),
                box(0.1),
                0.5,
                ["at rest", "weight alone moves it, 0.5 to any"],
            ),
            (
                load((0.2, 0.0)),
                pocket(0.5),
                0.0,
                ["they differ: the paper considers the significant contact", "so it rests"],
            ),
        ],
    )
    def test_sentence(self, acting, contacts, friction, words):
        verdict = judge(acting, contacts, friction, INERT)
        for word in words:
            assert word in verdict.sentence
        assert verdict.sentence.index("grain") < verdict.sentence.index("by the paper's criteria")

    def test_for_json(self):
        verdict = judge(load((0.8, 0.0)), box(0.1), 0.5, INERT)
        stored = json.loads(json.dumps(verdict.to_dict()))
        assert (stored["moves"], stored["mode"]) == (True, "sliding")
        assert stored["safety_factor"] == pytest.approx(0.625)
        assert set(stored["judges"]) == {"criteria", "equilibrium"}
        assert stored["agreement"]["agree"] is True
        assert stored["judges"]["equilibrium"]["motion"]["mode"] == "SLIDING"
        unlimited = judge(load((0.0, -1.0)), box(0.1), 0.5).to_dict()
        assert (unlimited["safety_factor"], unlimited["safety_status"]) == (None, "UNLIMITED")
