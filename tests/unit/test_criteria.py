"""The paper's criteria of incipient motion: against exact statics, and stated where they disagree with it.

Equation numbers are label keys of the paper's source (docs/paper.md). In the plane: x downstream, y up,
couples counter-clockwise about the third axis; normals point out of the grain.
"""

import json
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from incipient.contact import Classification, Contacts, Load, Mode, touching
from incipient.contact import paper as criteria
from incipient.contact.paper import equations as coulomb
from incipient.contact.paper.equations import can_vanish, equal_shares
from incipient.contact.paper.outcomes import Criterion, category, simultaneous
from incipient.errors import SceneError
from incipient.geometry import Disc, HalfDiscs, rest

DOWN = [0.0, -1.0, 0.0]


def load(force=(0.0, 0.0), couple=0.0, weight=(0.0, 0.0), centre=(0.0, 0.0)):
    """A load in the plane."""
    return Load([*force, 0.0], [0.0, 0.0, couple], [*weight, 0.0], [*centre, 0.0])


def block(half_base, height, slope):
    """Contacts and load of a block of unit weight on an incline, coordinates along it, no flow.

    The centre of mass is `height` above the base; gravity is turned by the slope, downhill is +x.
    """
    contacts = Contacts(
        [[-half_base, 0, 0], [half_base, 0, 0]], [DOWN, DOWN], [half_base, half_base]
    )
    return load(weight=(np.sin(slope), -np.cos(slope)), centre=(0.0, height)), contacts


def disc_on_plane(force, couple, weight=1.0, radius=0.5):
    """Contact and load of a disc on a plane at y = 0 under a shear force, a couple and its weight."""
    return load((force, 0.0), couple, (0.0, -weight), (0.0, radius)), Contacts([[0, 0, 0]], [DOWN])


def pocket(angle, weight=1.0, radius=0.5):
    """Contacts of a disc in a symmetric pocket, normals `angle` to either side of down; centre at 0."""
    normals = np.array(
        [[-np.sin(angle), -np.cos(angle), 0.0], [np.sin(angle), -np.cos(angle), 0.0]]
    )
    return Contacts(radius * normals, normals)


class TestBlockOnAnIncline:
    """Statics: the block slides if tan(slope) > friction, tips over if tan(slope) > half base / height."""

    @pytest.mark.parametrize("slope", np.radians([1.0, 15.0, 30.0, 44.0]))
    @pytest.mark.parametrize("friction", [0.0, 0.2, 0.5, 0.9])
    def test_slides_if_steeper_than_friction(self, slope, friction):
        verdict = criteria.classify(*block(1.0, 0.5, slope), friction)
        slides = np.tan(slope) > friction
        assert verdict.mode is (Mode.SLIDING if slides else Mode.NO_INCIPIENT_MOTION)
        # (3): the unbalanced part of the weight down the slope, sin - friction cos, in coordinates along it.
        down = max(np.sin(slope) - friction * np.cos(slope), 0.0)
        assert verdict.force == pytest.approx([down, 0.0, 0.0], abs=1e-12)
        assert verdict.criterion is Criterion.TRANSLATION_ONLY
        assert verdict.obstructed_by == ()

    def test_sharp_at_the_friction_angle(self):
        for factor, mode in ((0.999999, Mode.NO_INCIPIENT_MOTION), (1.000001, Mode.SLIDING)):
            assert criteria.classify(*block(1.0, 0.5, np.arctan(0.5 * factor)), 0.5).mode is mode

    def test_reaction_and_friction_are_those_of_statics(self):
        slope = np.radians(20.0)
        verdict = criteria.classify(*block(1.0, 0.5, slope), 0.5)
        # N = cos, T = sin for a weight of one; half at each end of the base.
        assert verdict.reaction == pytest.approx(np.tile([0.0, 0.5 * np.cos(slope), 0.0], (2, 1)))
        assert verdict.friction_force == pytest.approx(
            np.tile([-0.5 * np.sin(slope), 0.0, 0.0], (2, 1))
        )
        assert verdict.C_friction == pytest.approx([1.0, 1.0])
        assert verdict.minimum_2 == pytest.approx(-np.cos(slope))

    def test_patch_shares_equally_unless_that_alone_would_turn_it(self):
        # Equal halves leave the couple of friction about the centre, height sin, but the end downhill can
        # carry more: moving the reaction by height tan(slope), within the base, balances it. So: no motion.
        slope = np.radians(20.0)
        verdict = criteria.classify(*block(1.0, 0.5, slope), 0.5)
        assert verdict.share == pytest.approx([0.5, 0.5])
        assert verdict.couple == pytest.approx([0.0, 0.0, -0.5 * np.sin(slope)])
        assert verdict.held_by_sharing
        assert verdict.mode is Mode.NO_INCIPIENT_MOTION

    @pytest.mark.parametrize(("height", "topples"), [(2.7, False), (2.8, True)])
    def test_slender_block_topples(self, height, topples):
        # tan(20 degrees) = 0.36397 = 1 / 2.7475: the line of the weight leaves the base above that height.
        verdict = criteria.classify(*block(1.0, height, np.radians(20.0)), 0.5)
        assert verdict.mode is (Mode.PIVOTTING if topples else Mode.NO_INCIPIENT_MOTION)
        assert verdict.obstructed_by == ()


class TestDiscOnAPlane:
    """One contact below the centre: (7) is zero, F_tau = (tau / R, 0), and (24), (25) can be written down."""

    @pytest.mark.parametrize("friction", [0.1, 0.5, 2.0])
    @pytest.mark.parametrize(
        ("force", "couple"), [(0.3, -0.1), (0.3, 0.1), (0.0, -0.2), (1.0, 0.5)]
    )
    def test_resultants(self, force, couple, friction):
        verdict = criteria.classify(*disc_on_plane(force, couple), friction)
        # With R = 1/2 and N = 1: T = force + couple / R presses along the plane, friction answers C T.
        tangential = force + couple / 0.5
        mobilised = min(1.0, friction / abs(tangential)) if tangential else 1.0
        assert verdict.F_tau == pytest.approx(np.array([[couple / 0.5, 0.0, 0.0]]))
        assert verdict.quantity_22 == pytest.approx([-1.0])
        assert verdict.C_friction == pytest.approx([mobilised])
        assert verdict.force == pytest.approx([force - mobilised * tangential, 0.0, 0.0])
        assert verdict.couple == pytest.approx([0.0, 0.0, couple - 0.5 * mobilised * tangential])
        assert verdict.minima.sign_7 == 0

    def test_rolls_under_shear(self):
        # Shear pushes it downstream and turns it clockwise: the moment about the contact, couple - R force,
        # is not balanced, and the grain rolls downstream. The paper calls it sliding and pivotting.
        verdict = criteria.classify(*disc_on_plane(0.3, -0.1), 0.5)
        assert verdict.couple_about_contact == pytest.approx(np.array([[0.0, 0.0, -0.25]]))
        assert verdict.mode is Mode.SLIDING_AND_PIVOTTING
        assert verdict.force[0] > 0.0
        assert verdict.obstructed_by == ()

    def test_pure_couple_is_called_sliding(self):
        # Mechanics: it rolls. (24), (25) with C = 1 give F = -F_tau and tau = 0, which is row 1a.
        verdict = criteria.classify(*disc_on_plane(0.0, -0.1), 0.5)
        assert verdict.mode is Mode.SLIDING
        assert verdict.force == pytest.approx([0.2, 0.0, 0.0])
        assert verdict.couple == pytest.approx(np.zeros(3), abs=1e-15)

    def test_force_held_by_friction_turns_the_disc(self):
        # No couple of the flow: by (3) friction holds the force, and its couple R force turns the disc: row
        # 5.
        verdict = criteria.classify(*disc_on_plane(0.3, 0.0), 0.5)
        assert verdict.force == pytest.approx(np.zeros(3), abs=1e-15)
        assert verdict.couple == pytest.approx([0.0, 0.0, -0.15])
        assert verdict.mode is Mode.PIVOTTING

    def test_balanced_disc_moves_by_the_paper_although_statics_holds_it(self):
        # Couple = R force and friction above the force: contact forces (-force, weight) balance everything.
        # The paper lets the contact answer the force and F_tau = force together, twice what it has to.
        verdict = criteria.classify(*disc_on_plane(0.3, 0.15), 1.0)
        assert verdict.couple_about_contact == pytest.approx(np.zeros((1, 3)), abs=1e-15)
        assert verdict.force == pytest.approx([-0.3, 0.0, 0.0])
        assert verdict.mode is Mode.SLIDING_AND_PIVOTTING

    def test_weight_alone_rests(self):
        verdict = criteria.classify(*disc_on_plane(0.0, 0.0), 0.0)
        assert verdict.mode is Mode.NO_INCIPIENT_MOTION
        assert not verdict.moves
        assert verdict.couple == pytest.approx(np.zeros(3))


class TestLifting:
    """Buoyancy or lift above the weight: minimum (2) is positive, nothing answers."""

    def test_without_couple(self):
        verdict = criteria.classify(load((0.2, 0.0), weight=(0.0, 0.5)), pocket(0.5), 0.5)
        assert verdict.mode is Mode.LIFTING
        # The contact least lifted: n_in . F at the two normals is 0.5 cos(0.5) +- 0.2 sin(0.5).
        assert verdict.minimum_2 == pytest.approx(0.5 * np.cos(0.5) - 0.2 * np.sin(0.5))
        assert verdict.force == pytest.approx([0.2, 0.5, 0.0])
        assert verdict.couple == pytest.approx(np.zeros(3))
        assert verdict.reaction == pytest.approx(np.zeros((1, 3)))

    def test_disc_with_couple_turns_freely(self):
        # A disc's normals pass through its centre: its couple presses on nothing, minimum (7) = 0.
        verdict = criteria.classify(load((0.0, 0.5), 0.2), pocket(0.5), 0.5)
        assert verdict.mode is Mode.LIFTING_WITH_AWAY_ROTATION
        assert verdict.couple == pytest.approx([0.0, 0.0, 0.2])

    @pytest.mark.parametrize(("couple", "row"), [(0.1, "3"), (-0.1, "4")])
    def test_couple_decides_between_rows_3_and_4(self, couple, row):
        # One contact downstream of the centre: counter-clockwise takes it away from the bed, clockwise
        # presses.
        contacts = Contacts([[0.5, -0.5, 0.0]], [DOWN])
        verdict = criteria.classify(load((0.0, 1.0), couple), contacts, 0.5)
        assert verdict.mode.row == row
        assert verdict.away_from_surface is (couple > 0.0)

    @pytest.mark.parametrize("factor", [0.999, 1.001])
    def test_threshold_of_lifting(self, factor):
        verdict = criteria.classify(load((0.0, factor), weight=(0.0, -1.0)), pocket(0.0), 0.5)
        assert verdict.mode is (Mode.LIFTING if factor > 1.0 else Mode.NO_INCIPIENT_MOTION)


class TestPocket:
    """A disc between two others; centres joined at `angle` to the vertical."""

    @pytest.mark.parametrize(("push", "contact"), [(0.4, 1), (-0.4, 0)])
    def test_significant_surface_is_downstream(self, push, contact):
        grain, bed = Disc(1.0), HalfDiscs(0.5, 1.0)
        placement = rest(grain, bed, 0.5)
        contacts = touching(grain, placement, bed, 1e-6)
        acting = load((push, 0.0), weight=(0.0, -1.0), centre=placement.centre)
        verdict = criteria.classify(acting, contacts, 0.3)
        assert verdict.significant == (contact,)
        assert np.sign(contacts.points[contact, 0] - 0.5) == np.sign(push)
        # Equal touching radii: the normals are 30 degrees from the vertical.
        toward = -(np.cos(np.pi / 6) + 0.4 * np.sin(np.pi / 6))
        assert verdict.minimum_2 == pytest.approx(toward, abs=1e-9)

    @pytest.mark.parametrize(("push", "obstacles"), [(0.57, (0,)), (0.58, ())])
    def test_statics_needs_the_pivot_angle(self, push, obstacles):
        # Without friction statics lets the disc climb the downstream neighbour once push / weight > tan(30
        # degrees) = 0.57735. By the paper it slides for any push; below the angle the motion it finds goes
        # down into the pocket, and `obstructed_by` names the upstream contact, which the paper leaves out.
        verdict = criteria.classify(load((push, 0.0), weight=(0.0, -1.0)), pocket(np.pi / 6), 0.0)
        assert verdict.mode is Mode.SLIDING
        assert verdict.obstructed_by == obstacles

    @pytest.mark.parametrize(("push", "obstacles"), [(0.57, (0,)), (0.58, ())])
    def test_with_friction_it_would_turn_about_the_downstream_contact(self, push, obstacles):
        verdict = criteria.classify(load((push, 0.0), weight=(0.0, -1.0)), pocket(np.pi / 6), 1.0)
        assert verdict.mode is Mode.PIVOTTING
        assert verdict.force == pytest.approx(np.zeros(3), abs=1e-15)
        assert verdict.obstructed_by == obstacles

    def test_equal_sharing_under_its_weight_needs_friction(self):
        # Statics holds the disc without friction. Half of (31) at each contact carries only cos^2 of the
        # weight.
        verdict = criteria.classify(load(weight=(0.0, -1.0)), pocket(np.pi / 6), 0.0)
        assert verdict.significant == (0, 1)
        assert verdict.force == pytest.approx([0.0, np.cos(np.pi / 6) ** 2 - 1.0, 0.0])
        assert verdict.obstructed_by == (0, 1)
        held = criteria.classify(load(weight=(0.0, -1.0)), pocket(np.pi / 6), 0.6)
        assert held.mode is Mode.NO_INCIPIENT_MOTION


class TestHowThePrintIsRead:
    """One test for each reading in docs/paper.md that concerns contact."""

    def test_equivalent_force_leaves_out_the_spin(self):
        # (6): r ^ F_tau is tau without its part along r, and that part stays in the resultant (25).
        contacts = Contacts([[0.0, 0.0, -1.0]], [[0.0, 0.0, -1.0]])
        acting = Load([0, 0, 0], [0.1, 0.2, 0.3], [0, 0, -1], [0, 0, 0])
        verdict = criteria.classify(acting, contacts, 5.0)
        moment = np.cross(contacts.points[0], verdict.F_tau[0])
        assert moment == pytest.approx([0.1, 0.2, 0.0])
        assert verdict.C_friction == pytest.approx([1.0])
        assert verdict.couple == pytest.approx([0.0, 0.0, 0.3])

    @pytest.mark.parametrize("couple", [0.3, -0.3])
    def test_seven_keeps_its_sign(self, couple):
        # Contact at r = (1, -2), normal down: F_tau = couple (2, 1) / 5, n . F_tau = -couple / 5, and
        # -|r|^2 (n . F_tau) |n . F_tau| = couple |couple| / 5: positive where the couple lifts the contact.
        verdict = criteria.classify(load(couple=couple), Contacts([[1.0, -2.0, 0.0]], [DOWN]), 0.5)
        assert verdict.minimum_7 == pytest.approx(couple * abs(couple) / 5.0)
        assert verdict.away_from_surface is (couple > 0.0)
        # (23) is read alike and is (7) where no force acts.
        assert verdict.quantity_23 == pytest.approx([verdict.minimum_7])

    @pytest.mark.parametrize("friction", [0.1, 10.0])
    def test_couple_has_its_arm(self, friction):
        # (25) with (x* - c) ^: in units of length ten times as large all lengths and couples are ten times as
        # small. Without the arm, friction would be added to the couple as it is.
        def verdict(unit):
            contacts = Contacts([[0.2 / unit, -0.5 / unit, 0.0]], [DOWN])
            return criteria.classify(load((0.3, -1.0), -0.1 / unit), contacts, friction)

        assert verdict(10.0).force == pytest.approx(verdict(1.0).force)
        assert verdict(10.0).couple == pytest.approx(verdict(1.0).couple / 10.0)

    def test_couple_is_about_a_stated_point(self):
        # The couple of (21) moves with the point by d ^ F, so it is independent of it only if F = 0. Given
        # about the centre of mass it must be: about another point the same load gives another verdict.
        contacts = Contacts([[0.0, -0.5, 0.0]], [DOWN])
        about_centre = criteria.classify(load((0.3, -1.0), -0.1), contacts, 0.5)
        force, shift = np.array([0.3, -1.0, 0.0]), np.array([0.2, 0.0, 0.0])
        moved = [0.0, 0.0, -0.1] - np.cross(shift, force)
        elsewhere = criteria.classify(Load(force, moved, [0, 0, 0], shift), contacts, 0.5)
        assert elsewhere.couple_about_contact == pytest.approx(about_centre.couple_about_contact)
        assert elsewhere.minima.sign_7 != about_centre.minima.sign_7

    def test_away_rotation_only_without_a_force_along(self):
        # Row 5b asks for F = 0 and minimum (7) > 0, under a heading that says minimum (7) < 0.
        assert simultaneous(-1, 1, moves=False, turns=True) is Mode.AWAY_ROTATION
        verdict = criteria.classify(load(couple=0.3), Contacts([[1.0, -2.0, 0.0]], [DOWN]), 0.5)
        assert verdict.criterion is Criterion.ROTATION_ONLY
        assert verdict.mode is Mode.AWAY_ROTATION
        assert verdict.force == pytest.approx(np.zeros(3))
        assert verdict.couple == pytest.approx([0.0, 0.0, 0.3])

    def test_minimisers_share_equally(self):
        # The base of a box under a downward load: minimum (2) is the same at both ends.
        contacts = Contacts([[-1.0, -0.5, 0.0], [1.0, -0.5, 0.0]], [DOWN, DOWN])
        verdict = criteria.classify(load((0.1, -1.0), -0.2), contacts, 0.3)
        assert verdict.significant == (0, 1)
        assert verdict.share == pytest.approx([0.5, 0.5])
        assert verdict.reaction[:, 1] == pytest.approx(-0.5 * verdict.F_flow_g_and_tau[:, 1])

    def test_a_contact_listed_twice_counts_once(self):
        points, normals = np.array([[0.0, 0, 0], [0.0, 0, 0], [1.0, 0, 0]]), np.array([DOWN] * 3)
        assert equal_shares(points, normals) == pytest.approx([0.25, 0.25, 0.5])

    def test_any_couple_on_a_pressed_contact_moves_the_grain(self):
        # A box of half base 1 at rest under its weight and a couple of a thousandth: statics shifts the
        # reaction by a thousandth of the half base. By (24) the contact answers F_tau too, F = -F_tau,
        # which is not zero.
        contacts = Contacts([[-1.0, -0.5, 0.0], [1.0, -0.5, 0.0]], [DOWN, DOWN])
        verdict = criteria.classify(load((0.0, 0.0), -1e-3, (0.0, -1.0)), contacts, 0.5)
        assert verdict.mode is Mode.SLIDING
        # Mean of F_tau = couple (0.5, +-1) / 1.25 over the two ends.
        assert verdict.force == pytest.approx([1e-3 * 0.5 / 1.25, 0.0, 0.0])
        # The caveat: about whichever end it turned, the other would have to go into the bed.
        assert verdict.obstructed_by == (0, 1)


class TestTable:
    @pytest.mark.parametrize("couple", [[0.0, 0.3, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 0.2]])
    def test_sphere_under_a_pure_couple_rotates_away_from_the_surface(self, couple):
        # F_tau is tangential at the contact: (7) = 0, no reaction, no friction, hence no counter torque by (8).
        contacts = Contacts([[0.0, 0.0, -0.5]], [[0.0, 0.0, -1.0]])
        found = criteria.classify(Load([0, 0, 0], couple, [0, 0, 0], [0, 0, 0]), contacts, 0.5)
        assert (found.minimum_7, found.mode.row) == (0.0, "5b")
        assert not found.reaction.any() and not found.friction_force.any()
        assert found.couple.tolist() == couple

    def test_row_4_is_item_4_of_the_list(self):
        # Minima (2) > 0 and (7) < 0: the only row that leads to item 4; pivotting alone is 5a.
        rows = {
            key: simultaneous(*key[:2], bool(key[2]), bool(key[3]))
            for key in product((-1, 0, 1), (-1, 0, 1), (0, 1), (0, 1))
        }
        items = {key: category(mode, True) for key, mode in rows.items()}
        four = {key for key, item in items.items() if item and item.item == "4"}
        assert four == {(1, -1, 0, 1), (1, -1, 1, 1)}
        assert items[-1, -1, 0, 1].item == "5" and "pivotting" in rows[-1, -1, 0, 1].wording

    def test_every_combination_has_its_row(self):
        # Keys: signs of minima (2) and (7), then F != 0 by (24), tau != 0 by (25).
        rows = {
            key: simultaneous(key[0], key[1], bool(key[2]), bool(key[3])).row
            for key in product((-1, 0, 1), (-1, 0, 1), (0, 1), (0, 1))
        }
        assert {rows[key] for key in rows if key[2:] == (0, 0)} == {"7"}
        assert {rows[key] for key in rows if key[2:] == (1, 0) and key[0] <= 0} == {"1a"}
        assert {rows[key] for key in rows if key[2:] == (1, 0) and key[0] > 0} == {"1b"}
        assert rows[-1, 1, 1, 1] == "2"
        assert rows[1, 1, 1, 1] == "3"
        assert rows[1, -1, 1, 1] == rows[1, -1, 0, 1] == "4"
        assert rows[-1, -1, 0, 1] == "5a"
        assert rows[-1, 1, 0, 1] == "5b"
        assert rows[-1, -1, 1, 1] == "6"
        # Where a minimum is zero the table is silent: see modes.simultaneous.
        assert (rows[-1, 0, 1, 1], rows[1, 0, 1, 1], rows[0, -1, 1, 1]) == ("6", "3", "6")

    @pytest.mark.parametrize(
        ("couple", "force", "friction", "row"),
        [
            (0.2, (0.0, -1.0), 0.5, "2"),
            (-0.2, (0.0, -1.0), 0.5, "6"),
            (-0.2, (0.0, 0.0), 0.0, "5a"),
        ],
    )
    def test_rows_reached_with_one_contact_downstream(self, couple, force, friction, row):
        contacts = Contacts([[0.5, -0.5, 0.0]], [DOWN])
        assert criteria.classify(load(force, couple), contacts, friction).mode.row == row

    def test_rotation_stopped_by_friction_leaves_the_force_of_uncoupling(self):
        # (8) with C = 1 gives tau = 0; what is left is -F_tau, upward at a contact pressed downstream:
        # F_tau = -0.2 (0.5, 0.5) / 0.5.
        verdict = criteria.classify(load(couple=-0.2), Contacts([[0.5, -0.5, 0.0]], [DOWN]), 1.0)
        assert verdict.couple == pytest.approx(np.zeros(3), abs=1e-15)
        assert verdict.force == pytest.approx([0.2, 0.2, 0.0])
        assert verdict.mode is Mode.LIFTING

    def test_modes_carry_the_rows_and_the_wording(self):
        assert [mode.row for mode in Mode] == ["1a", "1b", "2", "3", "4", "5a", "5b", "6", "7"]
        assert Mode.NO_INCIPIENT_MOTION.wording == "no incipient motion"
        assert [mode for mode in Mode if not mode.moves] == [Mode.NO_INCIPIENT_MOTION]

    def test_no_load_rests(self):
        assert criteria.classify(load(), pocket(0.5), 0.5).criterion is Criterion.NO_LOAD


class TestLocation:
    """x* when force and couple act together."""

    CONTACTS = Contacts(
        [[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0]], [[-0.6, -0.8, 0.0], [0.6, -0.8, 0.0]]
    )

    def test_force_first_unless_it_lifts(self):
        pressed = criteria.classify(load((0.3, -1.0), 0.2), self.CONTACTS, 0.5)
        assert (pressed.located_by, pressed.significant) == ("force", (1,))
        assert pressed.minima.surface_7 == (0,)
        assert not pressed.common_position
        lifted = criteria.classify(load((0.3, 1.0), 0.2), self.CONTACTS, 0.5)
        assert (lifted.located_by, lifted.significant) == ("couple", (0,))

    def test_either_can_be_asked_for(self):
        verdict = criteria.classify(load((0.3, -1.0), 0.2), self.CONTACTS, 0.5, located_by="couple")
        assert (verdict.located_by, verdict.significant) == ("couple", (0,))
        with pytest.raises(SceneError, match="located_by"):
            criteria.classify(load((0.3, -1.0), 0.2), self.CONTACTS, 0.5, located_by="chance")


class TestFriction:
    def test_coulomb(self):
        normals = np.array([DOWN, DOWN, DOWN, [0.0, 1.0, 0.0]])
        force = np.array([[0.2, -1.0, 0], [0.9, -1.0, 0], [0.0, -1.0, 0], [0.9, -1.0, 0]])
        assert coulomb.C_friction(force, normals, 0.5) == pytest.approx([1.0, 0.5 / 0.9, 1.0, 0.0])
        assert coulomb.reaction(force, normals)[:, 1] == pytest.approx([1.0, 1.0, 1.0, 0.0])
        assert coulomb.friction(force, normals, 0.5)[:, 0] == pytest.approx([-0.2, -0.5, 0.0, 0.0])

    @pytest.mark.parametrize("friction", [-0.1, float("nan"), float("inf")])
    def test_bad_coefficient(self, friction):
        with pytest.raises(SceneError, match="friction"):
            criteria.classify(load((0.0, -1.0)), pocket(0.3), friction)

    def test_contact_at_the_centre(self):
        contacts = Contacts([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [DOWN, DOWN])
        with pytest.raises(SceneError, match="contact 0 lies at the centre"):
            criteria.classify(load((0.0, -1.0)), contacts, 0.5)

    def test_sharing_that_lets_couples_vanish(self):
        square = np.array([[1.0, 1, 0], [1, -1, 0], [-1, -1, 0], [-1, 1, 0]])
        assert can_vanish(square + np.array([0.9, 0.9, 0.0]), 1e-9)
        assert not can_vanish(square + np.array([1.1, 0.0, 0.0]), 1e-9)
        assert not can_vanish(square + np.array([0.0, 0.0, 0.1]), 1e-9)


def test_everything_is_in_the_dictionary_for_json():
    verdict = criteria.classify(*disc_on_plane(0.3, -0.1), 0.5)
    stored = json.loads(json.dumps(verdict.to_dict()))
    assert stored["mode"] == "SLIDING_AND_PIVOTTING"
    assert (stored["row"], stored["moves"]) == ("6", True)
    assert set(Classification.__dataclass_fields__) <= set(stored)
    assert stored["minima"]["surface_2"] == [0]


hundredths = st.integers(-200, 200).map(lambda k: k / 100.0)


@st.composite
def cases(draw):
    """A plane load and one to four contacts below a round grain, their normals near the radius."""
    count = draw(st.integers(1, 4))
    place = [draw(st.integers(0, 40)) * np.pi / 40 for _ in range(count)]
    tilt = [draw(st.integers(-4, 4)) * 0.1 for _ in range(count)]
    points = np.array([[np.cos(a), -np.sin(a), 0.0] for a in place])
    normals = np.array(
        [[np.cos(a + t), -np.sin(a + t), 0.0] for a, t in zip(place, tilt, strict=True)]
    )
    acting = load(
        (draw(hundredths), draw(hundredths)), draw(hundredths), (draw(hundredths), draw(hundredths))
    )
    return acting, Contacts(points, normals), draw(st.integers(0, 20)) / 10.0


class TestFrameIndifference:
    """Turning, moving, rescaling a case, re-ordering its contacts or listing one twice changes nothing."""

    @settings(max_examples=200, deadline=None)
    @given(
        case=cases(),
        angle=st.floats(-np.pi, np.pi),
        shift=st.tuples(hundredths, hundredths),
        length=st.sampled_from([1e-3, 1.0, 40.0]),
        strength=st.sampled_from([1e-6, 1.0, 300.0]),
        seed=st.integers(0, 100),
    )
    def test_verdict(self, case, angle, shift, length, strength, seed):
        acting, contacts, friction = case
        before = criteria.classify(acting, contacts, friction)
        turn = np.array(
            [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
        )
        order = np.random.default_rng(seed).permutation(len(contacts))
        order = np.append(order, order[0])
        offset = np.array([*shift, 0.0])
        moved = Load(
            strength * turn @ acting.flow_force,
            strength * length * acting.flow_couple,
            strength * turn @ acting.weight,
            length * turn @ (acting.centre + offset),
        )
        points = length * (contacts.points + offset) @ turn.T
        after = criteria.classify(
            moved, Contacts(points[order], contacts.normals[order] @ turn.T), friction
        )
        assert after.mode is before.mode
        scale = strength * before.force_scale
        assert after.force == pytest.approx(strength * turn @ before.force, abs=1e-7 * scale)
        assert after.couple == pytest.approx(
            strength * length * before.couple, abs=1e-7 * scale * length
        )
        assert {int(order[k]) for k in after.significant} == set(before.significant)
        assert {int(order[k]) for k in after.obstructed_by} == set(before.obstructed_by)

    @settings(max_examples=200, deadline=None)
    @given(case=cases())
    def test_newton_and_coulomb_hold(self, case):
        # The resultants are the load and the contact forces together; each contact force is in its cone.
        acting, contacts, friction = case
        verdict = criteria.classify(acting, contacts, friction)
        at = list(verdict.significant)
        answer = verdict.reaction + verdict.friction_force
        arms = contacts.points[at] - acting.centre
        assert verdict.force == pytest.approx(acting.force + answer.sum(axis=0), abs=1e-12)
        assert verdict.couple == pytest.approx(
            acting.couple + np.cross(arms, answer).sum(axis=0), abs=1e-12
        )
        inward = -(answer * contacts.normals[at]).sum(axis=1)
        assert (inward >= -1e-12).all()
        along = np.linalg.norm(answer + inward[:, None] * contacts.normals[at], axis=1)
        assert (along <= friction * inward + 1e-9).all()
