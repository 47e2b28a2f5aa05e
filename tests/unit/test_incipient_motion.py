"""Incipient accelerations against rigid-body mechanics. Each test states its formula; mass one unless said.

In the plane: x downstream, y up, couples counter-clockwise. In space: z up. Normals point out of the grain.
"""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from incipient.contact import Contacts, Load
from incipient.contact.acceleration import MOTIONS, ContactState, Mode, Uniqueness, incipient_motion
from incipient.contact.problem import ContactProblem
from incipient.contact.safety import safety_factor
from incipient.errors import SceneError

DOWN, UP = [0.0, -1.0, 0.0], [0.0, 1.0, 0.0]
BALL = 0.4 * 0.5**2 * np.eye(3)  # of a solid sphere of mass one and radius one half: 2/5 m r^2
STICK, ROLL, SLIDE, LIFT = ContactState


def load(force=(0.0, 0.0), couple=0.0, weight=(0.0, -1.0), centre=(0.0, 0.0)):
    """A load in the plane."""
    return Load([*force, 0.0], [0.0, 0.0, couple], [*weight, 0.0], [*centre, 0.0])


def pocket(angle, radius=0.5):
    """Contacts of a disc about the origin in a pocket: normals at an angle to either side of down."""
    normals = np.array(
        [[-np.sin(angle), -np.cos(angle), 0.0], [np.sin(angle), -np.cos(angle), 0.0]]
    )
    return Contacts(radius * normals, normals)


def box(force, half_base=1.0, height=0.5, slope=0.0, couple=(0.0, 0.0, 0.0)):
    """Load and contacts of a box in space on its four corners, downhill +x, unit weight, force at the centre."""
    corners = [[x, y, 0.0] for x in (-half_base, half_base) for y in (-half_base, half_base)]
    weight = [math.sin(slope), 0.0, -math.cos(slope)]
    return Load(force, couple, weight, [0.0, 0.0, height]), Contacts(
        corners, [[0.0, 0.0, -1.0]] * 4
    )


ON_PLANE = Contacts(
    [[0.0, 0.0, -0.5]], [[0.0, 0.0, -1.0]]
)  # a sphere of radius one half about the origin


def sphere(force=(0, 0, 0), couple=(0, 0, 0), weight=(0, 0, -1)):
    return Load(force, couple, weight, [0, 0, 0])


class TestBlock:
    @pytest.mark.parametrize("slope", np.radians([20.0, 45.0]))
    @pytest.mark.parametrize("friction", [0.0, 0.2])
    def test_slides_down_an_incline(self, slope, friction):
        # a = g (sin - friction cos), without turning: low enough not to topple.
        expected = math.sin(slope) - friction * math.cos(slope)
        result = incipient_motion(
            *box([0, 0, 0], height=0.1, slope=slope), friction, 1.0, np.eye(3)
        )
        assert result.mode is Mode.SLIDING
        assert result.acceleration == pytest.approx([expected, 0.0, 0.0], abs=1e-9)
        assert not result.angular_acceleration.any()
        assert result.contact_states == (SLIDE,) * 4
        assert not result.solutions[0].forces_unique

    def test_in_the_plane(self):
        contacts = Contacts([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [DOWN, DOWN])
        acting = load((1.0, 0.0), centre=(0.0, 0.3))
        result = incipient_motion(acting, contacts, 0.4, 2.0, np.eye(3))
        # a = (F - friction W) / m; the reactions shift by friction height / half base = 0.12 of W / 2.
        assert result.acceleration == pytest.approx([0.3, 0.0, 0.0])
        assert result.contact_forces[:, 1] == pytest.approx([0.44, 0.56])
        assert result.contact_forces[:, 0] == pytest.approx([-0.176, -0.224])
        assert (result.mode, result.uniqueness) == (Mode.SLIDING, Uniqueness.ONLY)
        assert result.solutions[0].forces_unique

    @pytest.mark.parametrize("friction", [0.2, 0.45])
    def test_base_of_many_contacts(self, friction):
        # A row of seven: the same motion as on the two ends, with the smallest of all forces that give it.
        row = np.column_stack([np.linspace(-1.0, 1.0, 7), np.zeros((7, 2))])
        acting = load((0.4, 0.0), centre=(0.0, 0.3))
        ends = incipient_motion(
            acting, Contacts(row[[0, -1]], [DOWN] * 2), friction, 1.0, np.eye(3)
        )
        many = incipient_motion(acting, Contacts(row, [DOWN] * 7), friction, 1.0, np.eye(3))
        assert many.mode is ends.mode is (Mode.SLIDING if friction < 0.4 else Mode.REST)
        assert many.acceleration == pytest.approx(ends.acceleration, abs=1e-12)
        assert (many.uniqueness, many.solutions[0].forces_unique) == (Uniqueness.ONLY, False)
        # Forces of least length under two conditions, sum and moment, vary linearly along the row, unless that
        # takes them out of a cone: at rest the last one upstream would slip.
        if many.moves:
            assert np.diff(many.contact_forces[:, 1], 2) == pytest.approx(np.zeros(5), abs=1e-12)

    def test_topples(self):
        # About the downstream edge: (J + m (b^2 + h^2)) alpha = F h - W b, about +y, for friction enough.
        inertia = np.diag([0.7, 0.5, 0.9])
        acting, contacts = box([0.6, 0.0, 0.0], height=2.0)
        result = incipient_motion(acting, contacts, 5.0, 1.0, inertia)
        alpha = (0.6 * 2.0 - 1.0) / (0.5 + 1.0 + 4.0)
        assert result.mode is Mode.PIVOTING
        assert result.angular_acceleration == pytest.approx([0.0, alpha, 0.0], abs=1e-9)
        assert result.acceleration == pytest.approx([2.0 * alpha, 0.0, alpha], abs=1e-9)
        assert result.contact_states == (LIFT, LIFT, ROLL, ROLL)

    def test_topples_and_slides(self):
        # Slips at its edge as it topples: (J + m b^2) alpha + ... for friction too small to pivot about it.
        # N = W + m a_z, a_z = b alpha; J alpha = friction N h - N b.
        acting, contacts = box([3.0, 0.0, 0.0], height=2.0)
        result = incipient_motion(acting, contacts, 0.6, 1.0, 0.5 * np.eye(3))
        turn = 0.6 * 2.0 - 1.0
        alpha = turn / (0.5 - turn)
        assert result.mode is Mode.PIVOTING_AND_SLIDING
        assert result.angular_acceleration == pytest.approx([0.0, alpha, 0.0], abs=1e-9)
        assert result.acceleration == pytest.approx(
            [3.0 - 0.6 * (1.0 + alpha), 0.0, alpha], abs=1e-9
        )

    def test_rests_with_its_smallest_forces(self):
        # Four corners, three equations: a quarter of the weight each is the least of all.
        result = incipient_motion(*box([0.0, 0.0, 0.0]), 0.5, 1.0, np.eye(3))
        assert (result.mode, result.uniqueness, result.moves) == (Mode.REST, Uniqueness.ONLY, False)
        assert result.contact_forces == pytest.approx(np.tile([0.0, 0.0, 0.25], (4, 1)))
        assert not result.solutions[0].forces_unique
        assert result.contact_states == (STICK,) * 4

    def test_lifts(self):
        result = incipient_motion(*box([0.0, 0.0, 1.5]), 0.5, 2.0, np.eye(3))
        assert (result.mode, result.contact_states) == (Mode.LIFTING, (LIFT,) * 4)
        assert result.acceleration == pytest.approx([0.0, 0.0, 0.25])
        assert not result.contact_forces.any()

    def test_lifts_and_rotates(self):
        result = incipient_motion(
            *box([0.1, 0.0, 2.0], couple=[0.0, 0.1, 0.0]), 0.5, 1.0, 2.0 * np.eye(3)
        )
        assert result.mode is Mode.LIFTING_AND_ROTATING
        assert result.acceleration == pytest.approx([0.1, 0.0, 1.0])
        assert result.angular_acceleration == pytest.approx([0.0, 0.05, 0.0])

    def test_turns_in_its_plane(self):
        # A couple about the vertical, equal corners, friction W acting at r = sqrt(2): J alpha = tau - m W r.
        result = incipient_motion(*box([0, 0, 0], couple=[0, 0, 1.0]), 0.3, 1.0, np.eye(3))
        assert result.mode is Mode.PIVOTING_AND_SLIDING
        assert result.angular_acceleration == pytest.approx(
            [0, 0, 1.0 - 0.3 * math.sqrt(2.0)], abs=1e-9
        )


class TestSphereOnAPlane:
    @pytest.mark.parametrize("slope", np.radians([10.0, 30.0, 50.0]))
    def test_rolls_down_an_incline(self, slope):
        # a = g sin / (1 + J / (m r^2)) = 5/7 g sin, if tan(slope) <= 3.5 friction.
        acting = sphere(weight=[math.sin(slope), 0.0, -math.cos(slope)])
        result = incipient_motion(acting, ON_PLANE, math.tan(slope) / 3.5 * 1.0001, 1.0, BALL)
        assert result.mode is Mode.ROLLING
        assert result.acceleration == pytest.approx([5.0 / 7.0 * math.sin(slope), 0.0, 0.0])
        assert result.angular_acceleration == pytest.approx(
            [0.0, 10.0 / 7.0 * math.sin(slope), 0.0]
        )
        slipping = incipient_motion(acting, ON_PLANE, math.tan(slope) / 3.5 * 0.9999, 1.0, BALL)
        assert slipping.mode is Mode.PIVOTING_AND_SLIDING
        assert slipping.contact_states == (SLIDE,)

    def test_slips_down_an_incline(self):
        # a = g (sin - m cos), alpha = m g cos r / J.
        slope, friction = 1.0, 0.2
        acting = sphere(weight=[math.sin(slope), 0.0, -math.cos(slope)])
        result = incipient_motion(acting, ON_PLANE, friction, 1.0, BALL)
        assert result.acceleration[0] == pytest.approx(math.sin(slope) - friction * math.cos(slope))
        assert result.angular_acceleration[1] == pytest.approx(
            friction * math.cos(slope) * 0.5 / 0.1
        )

    @pytest.mark.parametrize("couple", [[0.0, 0.1, 0.0], [0.06, -0.08, 0.0]])
    def test_rolls_under_a_couple(self, couple):
        # a = tau r / (J + m r^2) across the couple: the paper calls this sliding.
        result = incipient_motion(sphere(couple=couple), ON_PLANE, 0.5, 1.0, BALL)
        size = 0.1 * 0.5 / (0.1 + 0.25)
        assert result.mode is Mode.ROLLING
        assert result.acceleration == pytest.approx(
            size * np.cross(couple, [0, 0, 1]) / 0.1, abs=1e-12
        )
        assert result.angular_acceleration == pytest.approx(
            2.0 * size * np.array(couple) / 0.1, abs=1e-12
        )
        assert result.uniqueness is Uniqueness.ONLY

    def test_slips_under_a_couple(self):
        # Friction at its limit: a = m g, J alpha = tau - m W r.
        result = incipient_motion(sphere(couple=[0.0, 1.0, 0.0]), ON_PLANE, 0.2, 1.0, BALL)
        assert result.mode is Mode.PIVOTING_AND_SLIDING
        assert result.acceleration == pytest.approx([0.2, 0.0, 0.0])
        assert result.angular_acceleration == pytest.approx([0.0, (1.0 - 0.2 * 0.5) / 0.1, 0.0])

    def test_spins(self):
        # A point contact has no arm about its normal: alpha = tau / J.
        result = incipient_motion(sphere(couple=[0.0, 0.0, 0.1]), ON_PLANE, 0.5, 1.0, BALL)
        assert (result.mode, result.contact_states) == (Mode.SPINNING, (ROLL,))
        assert result.angular_acceleration == pytest.approx([0.0, 0.0, 1.0])
        assert result.acceleration == pytest.approx(np.zeros(3), abs=1e-12)

    def test_rests_where_force_and_couple_balance(self):
        result = incipient_motion(sphere([0.3, 0, 0], [0, -0.15, 0]), ON_PLANE, 0.31, 1.0, BALL)
        assert result.mode is Mode.REST
        assert result.contact_forces == pytest.approx(np.array([[-0.3, 0.0, 1.0]]))
        slipping = incipient_motion(sphere([0.3, 0, 0], [0, -0.15, 0]), ON_PLANE, 0.29, 1.0, BALL)
        assert slipping.acceleration == pytest.approx([0.01, 0.0, 0.0])

    def test_rolls_in_space_with_a_spin(self):
        # Not planar: the spin about the normal adds to the rolling, and each has its own formula.
        result = incipient_motion(
            sphere([0.2, 0.0, 0.0], [0.0, 0.0, 0.1]), ON_PLANE, 0.5, 1.0, BALL
        )
        assert result.mode is Mode.ROLLING
        assert result.acceleration == pytest.approx([0.2 / 1.4, 0.0, 0.0])
        assert result.angular_acceleration == pytest.approx([0.0, 0.4 / 1.4, 1.0])


class TestPocket:
    @pytest.mark.parametrize("push", [0.8, 1.5])
    def test_rolls_over_the_downstream_contact(self, push):
        # About that contact: (J + m R^2) alpha = (F cos - W sin) R, clockwise, with friction enough.
        angle, inertia = 0.5, 0.5 * 0.25
        result = incipient_motion(load((push, 0.0)), pocket(angle), 0.9, 1.0, inertia * np.eye(3))
        alpha = -(push * math.cos(angle) - math.sin(angle)) * 0.5 / (inertia + 0.25)
        assert result.mode is Mode.PIVOTING
        assert result.contact_states == (LIFT, ROLL)
        assert result.angular_acceleration == pytest.approx([0.0, 0.0, alpha])
        assert result.acceleration == pytest.approx(
            [-0.5 * alpha * math.cos(angle), -0.5 * alpha * math.sin(angle), 0]
        )
        assert result.uniqueness is Uniqueness.ONLY

    def test_slides_over_it_without_friction(self):
        # Along the tangent at the downstream contact: m a = F cos - W sin.
        result = incipient_motion(load((0.8, 0.0)), pocket(0.5), 0.0, 1.0, np.eye(3))
        size = 0.8 * math.cos(0.5) - math.sin(0.5)
        assert (result.mode, result.contact_states) == (Mode.SLIDING, (LIFT, SLIDE))
        assert result.acceleration == pytest.approx(
            [size * math.cos(0.5), size * math.sin(0.5), 0.0]
        )

    def test_sphere_over_a_gap(self):
        # Pocket of three, through the gap: turns about the line of two contacts, at height R cos below the
        # centre and R sin cos(60) ahead of it. Moment about it, and J + m times the square of the distance.
        sine, cosine = 1.0 / math.sqrt(3.0), math.sqrt(2.0 / 3.0)
        around = np.radians([60.0, 180.0, 300.0])
        normals = np.column_stack(
            [sine * np.cos(around), sine * np.sin(around), np.full(3, -cosine)]
        )
        result = incipient_motion(
            sphere([0.6, 0, 0]), Contacts(0.5 * normals, normals), 0.8, 1.0, BALL
        )
        below, ahead = 0.5 * cosine, 0.25 * sine
        alpha = (0.6 * below - ahead) / (0.1 + below**2 + ahead**2)
        assert result.mode is Mode.PIVOTING
        assert result.contact_states == (ROLL, LIFT, ROLL)
        assert result.angular_acceleration == pytest.approx([0.0, alpha, 0.0], abs=1e-9)
        assert result.acceleration == pytest.approx([alpha * below, 0.0, alpha * ahead], abs=1e-9)

    def test_spins_in_place(self):
        # Both contacts slip, see test_equilibrium: J alpha = tau - m R (N1 + N2).
        angle, friction = 0.6, 0.2
        result = incipient_motion(load(couple=-0.5), pocket(angle), friction, 1.0, 0.1 * np.eye(3))
        total = 1.0 / (math.cos(angle) * (1.0 + friction**2))
        assert (result.mode, result.contact_states) == (Mode.PIVOTING_AND_SLIDING, (SLIDE, SLIDE))
        assert result.angular_acceleration == pytest.approx(
            [0, 0, -(0.5 - friction * 0.5 * total) / 0.1]
        )


class TestDifferentContacts:
    """The paper's open mode 6(b): pivoting about one contact and sliding on another."""

    def test_sphere_along_a_wall(self):
        # Rolls on the floor along x and rubs on a wall at +y, pressed to it by P: floor friction T = J a / r^2,
        # wall friction m P slows it and spins it about the vertical, J spin = m P r.
        contacts = Contacts([[0, 0, -0.5], [0, 0.5, 0]], [[0, 0, -1], [0, 1, 0]])
        result = incipient_motion(sphere([0.5, 0.3, 0.0]), contacts, 0.3, 1.0, BALL)
        a = (0.5 - 0.3 * 0.3) / (1.0 + 0.1 / 0.25)
        assert result.mode is Mode.PIVOTING_AND_SLIDING_APART
        assert result.contact_states == (ROLL, SLIDE)
        assert result.acceleration == pytest.approx([a, 0.0, 0.0], abs=1e-9)
        assert result.angular_acceleration == pytest.approx(
            [0.0, a / 0.5, 0.3 * 0.3 * 0.5 / 0.1], abs=1e-9
        )

    def test_ladder_slips_at_both_ends(self):
        # Smooth floor and wall: alpha = 3 g cos / (2 L) with J = m L^2 / 12.
        angle = 1.0
        foot, top = np.zeros(3), np.array([math.cos(angle), math.sin(angle), 0.0])
        contacts = Contacts([foot, top], [DOWN, [1.0, 0.0, 0.0]])
        acting = Load([0, 0, 0], [0, 0, 0], DOWN, 0.5 * top)
        result = incipient_motion(acting, contacts, 0.0, 1.0, np.eye(3) / 12.0)
        assert (result.mode, result.contact_states) == (Mode.PIVOTING_AND_SLIDING, (SLIDE, SLIDE))
        assert result.angular_acceleration == pytest.approx([0, 0, -1.5 * math.cos(angle)])
        rough = incipient_motion(acting, contacts, 0.2, 1.0, np.eye(3) / 12.0)
        assert (rough.mode, rough.uniqueness) == (Mode.PIVOTING_AND_SLIDING, Uniqueness.ONLY)
        assert incipient_motion(acting, contacts, 0.5, 1.0, np.eye(3) / 12.0).mode is Mode.REST


class TestDegenerate:
    def wedge(self, half_angle):
        normals = np.array(
            [[s * math.cos(half_angle), -math.sin(half_angle), 0.0] for s in (-1.0, 1.0)]
        )
        return Contacts([[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]], normals)

    def test_wedge_stays_or_leaves(self):
        # Below the friction angle forces of any size brace the wedge: it may stay although it is pulled out. It
        # may as well leave, a = (F - W) / m.
        result = incipient_motion(load((0.0, 3.0)), self.wedge(0.4), 0.5, 1.0, np.eye(3))
        assert (result.mode, result.uniqueness, result.jams) == (
            Mode.REST,
            Uniqueness.SEVERAL,
            True,
        )
        assert [solution.mode for solution in result.solutions] == [Mode.REST, Mode.LIFTING]
        assert result.solutions[1].acceleration == pytest.approx([0.0, 2.0, 0.0])
        free = incipient_motion(load((0.0, 3.0)), self.wedge(0.5), 0.5, 1.0, np.eye(3))
        assert (free.mode, free.uniqueness, free.jams) == (Mode.LIFTING, Uniqueness.ONLY, False)

    def test_in_space_too(self):
        # The same wedge with the four corners of its sides.
        flat = self.wedge(0.4)
        points = np.vstack([flat.points + np.array([0, 0, z]) for z in (-0.3, 0.3)])
        contacts = Contacts(points, np.vstack([flat.normals] * 2))
        result = incipient_motion(load((0.1, 3.0)), contacts, 0.5, 1.0, np.diag([1.0, 2.0, 3.0]))
        assert (result.mode, result.uniqueness, result.jams) == (
            Mode.REST,
            Uniqueness.SEVERAL,
            True,
        )
        assert Mode.LIFTING in {solution.mode for solution in result.solutions}

    def test_disc_between_walls_is_braked_as_hard_as_one_likes(self):
        # Fitted between two walls, turned by a couple: the walls may press with any force 0 <= N <= tau / (2 m R),
        # so that alpha may be anything from tau / J down to nothing.
        contacts = Contacts([[0.0, -0.5, 0.0], [0.0, 0.5, 0.0]], [DOWN, UP])
        result = incipient_motion(
            load(couple=0.2, weight=(0.0, 0.0)), contacts, 0.5, 1.0, 0.1 * np.eye(3)
        )
        assert (result.mode, result.uniqueness, result.jams) == (Mode.REST, Uniqueness.FAMILY, True)
        assert result.solutions[-1].angular_acceleration == pytest.approx([0.0, 0.0, 2.0])

    def test_plate_between_facing_contacts(self):
        # A thin bar gripped by three contacts on one line of action, dragged along: 2 N - 2 N of pressure stay
        # free, so friction may brake it as hard as one likes.
        contacts = Contacts([[0.0, -0.1, 0.0], [0.0, 0.1, 0.0], [0.0, -0.2, 0.0]], [DOWN, UP, DOWN])
        result = incipient_motion(
            load((1.0, 0.0), weight=(0.0, 0.0)), contacts, 0.5, 1.0, np.eye(3)
        )
        assert (result.mode, result.uniqueness, result.jams) == (Mode.REST, Uniqueness.FAMILY, True)
        assert result.solutions[-1].acceleration == pytest.approx([1.0, 0.0, 0.0])
        assert result.residual < 1e-9

    def test_sphere_spinning_on_four_contacts(self):
        # Four normals through the centre: their four forces are not determined, and with them friction's couple.
        around = np.radians([0.0, 90.0, 180.0, 270.0])
        normals = np.column_stack([0.6 * np.cos(around), 0.6 * np.sin(around), np.full(4, -0.8)])
        contacts = Contacts(0.5 * normals, normals)
        result = incipient_motion(sphere(couple=[0.1, 0.2, 0.9]), contacts, 0.3, 1.0, BALL)
        assert result.uniqueness is Uniqueness.FAMILY
        assert result.residual < 1e-9

    def test_no_load_rests(self):
        result = incipient_motion(load(weight=(0.0, 0.0)), pocket(0.5), 0.5, 1.0, np.eye(3))
        assert (result.mode, result.uniqueness) == (Mode.REST, Uniqueness.ONLY)
        balanced = incipient_motion(load((0.0, 1.0)), pocket(0.5), 0.5, 1.0, np.eye(3))
        assert balanced.mode is Mode.REST
        assert not balanced.contact_forces.any()

    def test_infinite_friction(self):
        # Two contacts that cannot slip jam the disc, or it turns about the downstream one: see TestPocket.
        angle = 0.5
        result = incipient_motion(load((1.0, 0.0)), pocket(angle), math.inf, 1.0, np.eye(3) / 8.0)
        alpha = -(math.cos(angle) - math.sin(angle)) * 0.5 / (0.125 + 0.25)
        assert (result.mode, result.uniqueness, result.jams) == (
            Mode.REST,
            Uniqueness.SEVERAL,
            True,
        )
        assert result.solutions[-1].angular_acceleration == pytest.approx(
            [0.0, 0.0, alpha], rel=1e-5
        )
        acting, contacts = box([0.6, 0.0, 0.0], height=2.0)
        toppled = incipient_motion(acting, contacts, math.inf, 1.0, np.eye(3))
        assert toppled.mode is Mode.PIVOTING
        assert toppled.angular_acceleration == pytest.approx([0.0, 0.2 / 6.0, 0.0], abs=1e-9)


class TestConsistency:
    @pytest.mark.parametrize("friction", [0.0, 0.3, 0.7])
    @pytest.mark.parametrize("kind", ["plane", "space"])
    def test_rest_and_safety_change_together(self, friction, kind):
        acting, contacts = (
            (load((0.6, 0.1), -0.02), pocket(0.7))
            if kind == "plane"
            else (sphere([0.5, 0.2, 0.1], [0.0, 0.01, 0.0]), three_contacts())
        )
        critical = safety_factor(acting, contacts, friction).interval[1]
        for factor, rests in ((1.0 - 1e-6, True), (1.0 + 1e-6, False)):
            scaled = replace(
                acting,
                flow_force=critical * factor * acting.flow_force,
                flow_couple=critical * factor * acting.flow_couple,
            )
            motion = incipient_motion(scaled, contacts, friction, 1.0, BALL)
            if critical > 0.0:
                assert safety_factor(scaled, contacts, friction).held is rests
                assert motion.moves is not rests

    @pytest.mark.parametrize("seed", range(40))
    def test_planar_motions_solve_the_problem_in_space(self, seed):
        # The enumeration in the plane and Newton's method in space know nothing of each other.
        random = np.random.default_rng(seed)
        angles = np.radians(random.uniform(200.0, 340.0, random.integers(1, 5)))
        normals = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))])
        points = 0.5 * normals + 0.1 * random.normal(size=normals.shape) * [1.0, 1.0, 0.0]
        acting = load(random.normal(size=2), 0.3 * random.normal())
        flat = incipient_motion(acting, Contacts(points, normals), 0.4, 1.0, 0.1 * np.eye(3))
        problem = ContactProblem.of(acting, Contacts(points, normals), 0.4)
        wrench, size = problem.wrench(1.0)
        unit, inverse = np.linalg.norm(wrench), np.eye(6)
        inverse[3:, 3:] *= problem.reach**2 / 0.1
        one = problem.columns[None], inverse[None], np.array([0.4]), wrench[None] / unit
        (count,), in_space, _ = MOTIONS(*one, 12)
        known = [
            [*solution.acceleration, *solution.angular_acceleration] for solution in flat.solutions
        ]
        units = size * unit / np.array([1.0] * 3 + [problem.reach] * 3)
        assert count or not flat.moves
        if flat.uniqueness is not Uniqueness.FAMILY:
            for candidate in in_space[0, :count, :6]:
                misses = np.abs(units * candidate - np.array(known)).max(axis=1)
                assert misses.min() < 1e-7


def three_contacts():
    around = np.radians([10.0, 120.0, 250.0])
    normals = np.column_stack([0.6 * np.cos(around), 0.6 * np.sin(around), np.full(3, -0.8)])
    return Contacts(0.5 * normals, normals)


class TestInput:
    @pytest.mark.parametrize(
        ("mass", "inertia", "match"),
        [
            (0.0, np.eye(3), "mass"),
            (-1.0, np.eye(3), "mass"),
            (math.nan, np.eye(3), "mass"),
            (1.0, np.eye(2), "shape"),
            (1.0, np.diag([1.0, 1.0, 0.0]), "positive definite"),
            (1.0, np.diag([1.0, 1.0, -1.0]), "positive definite"),
            (1.0, np.array([[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), "symmetric"),
            (1.0, np.full((3, 3), math.nan), "finite"),
        ],
    )
    def test_bad_inertia(self, mass, inertia, match):
        with pytest.raises(SceneError, match=match):
            incipient_motion(load(), pocket(0.5), 0.5, mass, inertia)

    @pytest.mark.parametrize("friction", [-0.1, math.nan])
    def test_bad_friction(self, friction):
        with pytest.raises(SceneError, match="friction"):
            incipient_motion(load(), pocket(0.5), friction, 1.0, np.eye(3))

    def test_no_contact(self):
        with pytest.raises(SceneError, match="there is none"):
            incipient_motion(load(), Contacts([], []), 0.5, 1.0, np.eye(3))

    def test_json(self):
        result = incipient_motion(load((1.0, 0.0)), pocket(0.5), 0.5, 1.0, np.eye(3))
        stored = json.loads(json.dumps(result.to_dict(), allow_nan=False))
        assert (stored["mode"], stored["uniqueness"]) == (result.mode.name, "ONLY")
        assert len(stored["solutions"]) == 1
