"""Incipient accelerations against rigid-body mechanics. Each test states its formula; mass one unless said.

In 2-D: x downstream, y up, torques counter-clockwise. In 3-D: z up. Normals point out of the grain.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from test_safety_factor import ON_PLANE, box, load, pocket, wedge

from incipient.contact import Contacts, Load
from incipient.contact.acceleration import (
    ContactState,
    Mode,
    ReleaseProblem,
    Uniqueness,
    incipient_motion,
)
from incipient.contact.impulses import CoulombLaw, differentiate
from incipient.contact.problem import ContactProblem
from incipient.contact.safety import safety_factor
from incipient.errors import SceneError

DOWN, UP = [0.0, -1.0, 0.0], [0.0, 1.0, 0.0]
BALL = 0.4 * 0.5**2 * np.eye(3)  # of a solid sphere of mass one and radius one half: 2/5 m r^2
STICK, ROLL, SLIDE, LIFT = ContactState


def motion(case, friction, inertia=BALL, mass=1.0):
    """The incipient motion of a load and contacts, and its first solution."""
    found = incipient_motion(*case, friction, mass, np.asarray(inertia))
    return found, found.first


def sphere(force=(0, 0, 0), torque=(0, 0, 0), weight=(0, 0, -1)):
    """Load and contact of a sphere of radius one half on a plane, its centre at the origin."""
    return Load(force, torque, weight, [0, 0, 0]), ON_PLANE


def ring(count, lean=0.6, turn=0.0):
    """Contacts of such a sphere, `count` in a ring, their normals with that horizontal part."""
    around = np.radians(turn) + 2.0 * np.pi * np.arange(count) / count
    normals = np.column_stack(
        [lean * np.cos(around), lean * np.sin(around), np.full(count, -math.sqrt(1 - lean**2))]
    )
    return Contacts(0.5 * normals, normals)


class TestBlock:
    @pytest.mark.parametrize("slope", np.radians([20.0, 45.0]))
    @pytest.mark.parametrize("friction", [0.0, 0.2])
    def test_slides_down_an_incline(self, slope, friction):
        # a = g (sin - friction cos), without turning: low enough not to topple.
        expected = math.sin(slope) - friction * math.cos(slope)
        _, first = motion(box(slope, [0, 0, 0], height=0.1), friction, np.eye(3))
        assert (first.mode, first.contact_states) == (Mode.SLIDING, (SLIDE,) * 4)
        assert first.acceleration == pytest.approx([expected, 0.0, 0.0], abs=1e-9)
        assert not first.angular_acceleration.any() and not first.forces_unique

    def test_in_2d(self):
        # a = (F - friction W) / m; the reactions shift by friction height / half base = 0.12 of W / 2.
        contacts = Contacts([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [DOWN, DOWN])
        found, first = motion((load((1.0, 0.0), centre=(0.0, 0.3)), contacts), 0.4, np.eye(3), 2.0)
        assert first.acceleration == pytest.approx([0.3, 0.0, 0.0])
        expected = np.array([[-0.176, 0.44, 0.0], [-0.224, 0.56, 0.0]])
        assert first.contact_forces == pytest.approx(expected)
        assert (first.mode, found.uniqueness) == (Mode.SLIDING, Uniqueness.ONLY)
        assert first.forces_unique

    @pytest.mark.parametrize("friction", [0.2, 0.45])
    def test_base_of_many_contacts(self, friction):
        # A row of seven: the same motion as on the two ends, with the shortest of all forces that give it, which
        # under two conditions, sum and moment, vary linearly along the row.
        row = np.column_stack([np.linspace(-1.0, 1.0, 7), np.zeros((7, 2))])
        acting = load((0.4, 0.0), centre=(0.0, 0.3))
        _, ends = motion((acting, Contacts(row[[0, -1]], [DOWN] * 2)), friction, np.eye(3))
        many, first = motion((acting, Contacts(row, [DOWN] * 7)), friction, np.eye(3))
        assert first.mode is ends.mode is (Mode.SLIDING if friction < 0.4 else Mode.REST)
        assert first.acceleration == pytest.approx(ends.acceleration, abs=1e-12)
        assert (many.uniqueness, first.forces_unique) == (Uniqueness.ONLY, False)
        if many.moves:
            assert np.diff(first.contact_forces[:, 1], 2) == pytest.approx(np.zeros(5), abs=1e-12)

    def test_topples(self):
        # About the downstream edge: (J + m (b^2 + h^2)) alpha = F h - W b, about +y, for friction enough.
        _, first = motion(box(0.0, [0.6, 0.0, 0.0], 2.0), 5.0, np.diag([0.7, 0.5, 0.9]))
        alpha = (0.6 * 2.0 - 1.0) / (0.5 + 1.0 + 4.0)
        assert (first.mode, first.contact_states) == (Mode.PIVOTING, (LIFT, LIFT, ROLL, ROLL))
        assert first.angular_acceleration == pytest.approx([0.0, alpha, 0.0], abs=1e-9)
        assert first.acceleration == pytest.approx([2.0 * alpha, 0.0, alpha], abs=1e-9)

    def test_topples_and_slides(self):
        # N = W + m a_z, a_z = b alpha; J alpha = friction N h - N b.
        _, first = motion(box(0.0, [3.0, 0.0, 0.0], 2.0), 0.6, 0.5 * np.eye(3))
        turn = 0.6 * 2.0 - 1.0
        alpha = turn / (0.5 - turn)
        assert first.mode is Mode.PIVOTING_AND_SLIDING
        assert first.angular_acceleration == pytest.approx([0.0, alpha, 0.0], abs=1e-9)
        expected = [3.0 - 0.6 * (1.0 + alpha), 0.0, alpha]
        assert first.acceleration == pytest.approx(expected, abs=1e-9)

    def test_rests_with_equal_forces(self):
        # Four corners, three equations: a quarter of the weight each is the least of all.
        found, first = motion(box(0.0, [0.0, 0.0, 0.0]), 0.5, np.eye(3))
        assert (first.mode, found.uniqueness, found.moves) == (Mode.REST, Uniqueness.ONLY, False)
        assert first.contact_forces == pytest.approx(np.tile([0.0, 0.0, 0.25], (4, 1)))
        assert first.contact_states == (STICK,) * 4 and not first.forces_unique

    @pytest.mark.parametrize("friction", [0.0, 0.5])
    def test_loaded_at_the_end_of_a_row(self, friction):
        # The only forces that push: 0.1 and 0.9 on the last two for a load at 1.9 of contacts at -2 to 2.
        x = np.arange(-2.0, 3.0)
        contacts = Contacts(np.column_stack([x, np.zeros((5, 2))]), [DOWN] * 5)
        found, first = motion((load(centre=(1.9, 0.3)), contacts), friction, np.eye(3))
        assert (first.contact_forces[:, 1] > -1e-12).all()
        assert first.contact_forces[:, 0] == pytest.approx(np.zeros(5), abs=1e-12)
        assert not first.forces_unique
        assert first.contact_forces[:, 1].sum() == pytest.approx(1.0)
        assert x @ first.contact_forces[:, 1] == pytest.approx(1.9)
        assert not found.moves and found.residual < 1e-9

    def test_lifts_and_rotates(self):
        _, lifted = motion(box(0.0, [0.0, 0.0, 1.5]), 0.5, np.eye(3), 2.0)
        assert (lifted.mode, lifted.contact_states) == (Mode.LIFTING, (LIFT,) * 4)
        assert lifted.acceleration == pytest.approx([0.0, 0.0, 0.25])
        assert not lifted.contact_forces.any()
        acting, contacts = box(0.0, [0.1, 0.0, 2.0])
        turned = replace(acting, flow_couple=[0.0, 0.1, 0.0])
        _, first = motion((turned, contacts), 0.5, 2.0 * np.eye(3))
        assert first.mode is Mode.LIFTING_AND_ROTATING
        assert first.acceleration == pytest.approx([0.1, 0.0, 1.0])
        assert first.angular_acceleration == pytest.approx([0.0, 0.05, 0.0])

    def test_turns_in_its_plane(self):
        # A torque about the vertical, equal corners, friction W acting at r = sqrt(2): J alpha = tau - m W r.
        acting, contacts = box(0.0, [0, 0, 0])
        turned = replace(acting, flow_couple=[0, 0, 1.0])
        _, first = motion((turned, contacts), 0.3, np.eye(3))
        assert first.mode is Mode.PIVOTING_AND_SLIDING
        expected = [0, 0, 1.0 - 0.3 * math.sqrt(2.0)]
        assert first.angular_acceleration == pytest.approx(expected, abs=1e-9)


class TestSphereOnAPlane:
    @pytest.mark.parametrize("slope", np.radians([10.0, 30.0, 50.0]))
    def test_rolls_down_an_incline(self, slope):
        # a = g sin / (1 + J / (m r^2)) = 5/7 g sin, if tan(slope) <= 3.5 friction.
        case = sphere(weight=[math.sin(slope), 0.0, -math.cos(slope)])
        _, first = motion(case, math.tan(slope) / 3.5 * 1.0001)
        assert first.mode is Mode.ROLLING
        assert first.acceleration == pytest.approx([5.0 / 7.0 * math.sin(slope), 0.0, 0.0])
        expected = [0.0, 10.0 / 7.0 * math.sin(slope), 0.0]
        assert first.angular_acceleration == pytest.approx(expected)
        _, slips = motion(case, math.tan(slope) / 3.5 * 0.9999)
        assert (slips.mode, slips.contact_states) == (Mode.PIVOTING_AND_SLIDING, (SLIDE,))

    def test_slips_down_an_incline(self):
        # a = g (sin - m cos), alpha = m g cos r / J.
        _, first = motion(sphere(weight=[math.sin(1.0), 0.0, -math.cos(1.0)]), 0.2)
        assert first.acceleration[0] == pytest.approx(math.sin(1.0) - 0.2 * math.cos(1.0))
        assert first.angular_acceleration[1] == pytest.approx(0.2 * math.cos(1.0) * 0.5 / 0.1)

    @pytest.mark.parametrize(
        ("torque", "uniqueness"),
        [([0.0, 0.1, 0.0], Uniqueness.ONLY), ([0.06, -0.08, 0.0], Uniqueness.NOT_EXCLUDED)],
    )
    def test_rolls_under_a_torque(self, torque, uniqueness):
        # a = tau r / (J + m r^2) across the torque: the paper calls this sliding. All motions are known in a coordinate
        # plane alone.
        found, first = motion(sphere(torque=torque), 0.5)
        size = 0.1 * 0.5 / (0.1 + 0.25)
        across = size * np.cross(torque, [0, 0, 1]) / 0.1
        assert (first.mode, found.uniqueness) == (Mode.ROLLING, uniqueness)
        assert first.acceleration == pytest.approx(across, abs=1e-12)
        along = 2.0 * size * np.array(torque) / 0.1
        assert first.angular_acceleration == pytest.approx(along, abs=1e-12)

    def test_slips_or_spins_under_a_torque(self):
        # Friction at its limit: a = m g, J alpha = tau - m W r. About the normal no arm: alpha = tau / J.
        _, slips = motion(sphere(torque=[0.0, 1.0, 0.0]), 0.2)
        assert slips.mode is Mode.PIVOTING_AND_SLIDING
        assert slips.acceleration == pytest.approx([0.2, 0.0, 0.0])
        assert slips.angular_acceleration == pytest.approx([0.0, (1.0 - 0.2 * 0.5) / 0.1, 0.0])
        _, spins = motion(sphere(torque=[0.0, 0.0, 0.1]), 0.5)
        assert (spins.mode, spins.contact_states) == (Mode.SPINNING, (ROLL,))
        assert spins.angular_acceleration == pytest.approx([0.0, 0.0, 1.0])
        assert spins.acceleration == pytest.approx(np.zeros(3), abs=1e-12)
        # Both at once are not planar: the spin adds to the rolling, and each has its own formula.
        _, both = motion(sphere([0.2, 0.0, 0.0], [0.0, 0.0, 0.1]), 0.5)
        assert both.mode is Mode.ROLLING
        assert both.acceleration == pytest.approx([0.2 / 1.4, 0.0, 0.0])
        assert both.angular_acceleration == pytest.approx([0.0, 0.4 / 1.4, 1.0])

    def test_rests_where_force_and_torque_balance(self):
        _, first = motion(sphere([0.3, 0, 0], [0, -0.15, 0]), 0.31)
        assert first.mode is Mode.REST
        assert first.contact_forces == pytest.approx(np.array([[-0.3, 0.0, 1.0]]))
        _, slips = motion(sphere([0.3, 0, 0], [0, -0.15, 0]), 0.29)
        assert slips.acceleration == pytest.approx([0.01, 0.0, 0.0])


class TestPocket:
    @pytest.mark.parametrize("push", [0.8, 1.5])
    def test_rolls_over_the_downstream_contact(self, push):
        # About that contact: (J + m R^2) alpha = (F cos - W sin) R, clockwise, with friction enough.
        angle, inertia = 0.5, 0.5 * 0.25
        found, first = motion((load((push, 0.0)), pocket(angle)), 0.9, inertia * np.eye(3))
        alpha = -(push * math.cos(angle) - math.sin(angle)) * 0.5 / (inertia + 0.25)
        assert (first.mode, first.contact_states) == (Mode.PIVOTING, (LIFT, ROLL))
        assert first.angular_acceleration == pytest.approx([0.0, 0.0, alpha])
        expected = [-0.5 * alpha * math.cos(angle), -0.5 * alpha * math.sin(angle), 0]
        assert first.acceleration == pytest.approx(expected)
        assert found.uniqueness is Uniqueness.ONLY

    def test_slides_over_it_without_friction(self):
        # Along the tangent at the downstream contact: m a = F cos - W sin.
        _, first = motion((load((0.8, 0.0)), pocket(0.5)), 0.0, np.eye(3))
        size = 0.8 * math.cos(0.5) - math.sin(0.5)
        assert (first.mode, first.contact_states) == (Mode.SLIDING, (LIFT, SLIDE))
        expected = [size * math.cos(0.5), size * math.sin(0.5), 0.0]
        assert first.acceleration == pytest.approx(expected)

    def test_sphere_over_a_gap(self):
        # Pocket of three, through the gap: turns about the line of two contacts, at height R cos below the
        # centre and R sin cos(60) ahead of it. Moment about it, and J + m times the square of the distance.
        sine, cosine = 1.0 / math.sqrt(3.0), math.sqrt(2.0 / 3.0)
        _, first = motion((sphere([0.6, 0, 0])[0], ring(3, sine, 60.0)), 0.8)
        below, ahead = 0.5 * cosine, 0.25 * sine
        alpha = (0.6 * below - ahead) / (0.1 + below**2 + ahead**2)
        assert (first.mode, first.contact_states) == (Mode.PIVOTING, (ROLL, LIFT, ROLL))
        assert first.angular_acceleration == pytest.approx([0.0, alpha, 0.0], abs=1e-9)
        assert first.acceleration == pytest.approx([alpha * below, 0.0, alpha * ahead], abs=1e-9)

    def test_spins_in_place(self):
        # Both contacts slip, see test_safety_factor: J alpha = tau - m R (N1 + N2).
        _, first = motion((load(torque=-0.5), pocket(0.6)), 0.2, 0.1 * np.eye(3))
        total = 1.0 / (math.cos(0.6) * (1.0 + 0.2**2))
        assert (first.mode, first.contact_states) == (Mode.PIVOTING_AND_SLIDING, (SLIDE, SLIDE))
        expected = [0, 0, -(0.5 - 0.2 * 0.5 * total) / 0.1]
        assert first.angular_acceleration == pytest.approx(expected)


class TestDifferentContacts:
    """The paper's open mode 6(b): pivoting about one contact and sliding on another."""

    def test_sphere_along_a_wall(self):
        # Rolls on the floor along x and rubs on a wall at +y, pressed to it by P: floor friction T = J a / r^2,
        # wall friction m P slows it and spins it about the vertical, J spin = m P r.
        contacts = Contacts([[0, 0, -0.5], [0, 0.5, 0]], [[0, 0, -1], [0, 1, 0]])
        _, first = motion((sphere([0.5, 0.3, 0.0])[0], contacts), 0.3)
        a = (0.5 - 0.3 * 0.3) / (1.0 + 0.1 / 0.25)
        assert first.mode is Mode.PIVOTING_AND_SLIDING_APART
        assert first.contact_states == (ROLL, SLIDE)
        assert first.acceleration == pytest.approx([a, 0.0, 0.0], abs=1e-9)
        expected = [0.0, a / 0.5, 0.3 * 0.3 * 0.5 / 0.1]
        assert first.angular_acceleration == pytest.approx(expected, abs=1e-9)

    def test_ladder_slips_at_both_ends(self):
        # Smooth floor and wall: alpha = 3 g cos / (2 L) with J = m L^2 / 12.
        foot, top = np.zeros(3), np.array([math.cos(1.0), math.sin(1.0), 0.0])
        case = Load([0] * 3, [0] * 3, DOWN, 0.5 * top), Contacts([foot, top], [DOWN, [1.0, 0, 0]])
        _, first = motion(case, 0.0, np.eye(3) / 12.0)
        assert (first.mode, first.contact_states) == (Mode.PIVOTING_AND_SLIDING, (SLIDE, SLIDE))
        assert first.angular_acceleration == pytest.approx([0, 0, -1.5 * math.cos(1.0)])
        rough, first = motion(case, 0.2, np.eye(3) / 12.0)
        assert (first.mode, rough.uniqueness) == (Mode.PIVOTING_AND_SLIDING, Uniqueness.ONLY)
        assert not motion(case, 0.5, np.eye(3) / 12.0)[0].moves


class TestDegenerate:
    def test_wedge_stays_or_leaves(self):
        # Below the friction angle forces of any size brace the wedge: it may stay although it is pulled out. It
        # may as well leave, a = (F - W) / m.
        pulled = load((0.0, 3.0))
        found, _ = motion((pulled, wedge(0.4)), 0.5, np.eye(3))
        assert (found.moves, found.uniqueness, found.jams) == (False, Uniqueness.SEVERAL, True)
        assert [solution.mode for solution in found.solutions] == [Mode.REST, Mode.LIFTING]
        assert found.solutions[1].acceleration == pytest.approx([0.0, 2.0, 0.0])
        free, first = motion((pulled, wedge(0.5)), 0.5, np.eye(3))
        assert (first.mode, free.uniqueness, free.jams) == (Mode.LIFTING, Uniqueness.ONLY, False)
        # The same wedge in 3-D with the four corners of its sides.
        points = np.vstack([wedge(0.4).points + np.array([0, 0, z]) for z in (-0.3, 0.3)])
        contacts = Contacts(points, np.vstack([wedge(0.4).normals] * 2))
        found, _ = motion((load((0.1, 3.0)), contacts), 0.5, np.diag([1.0, 2.0, 3.0]))
        assert (found.moves, found.uniqueness, found.jams) == (False, Uniqueness.SEVERAL, True)
        assert Mode.LIFTING in {solution.mode for solution in found.solutions}

    def test_braked_as_hard_as_one_likes(self):
        # A disc fitted between two walls, turned by a torque: the walls may press with any force
        # 0 <= N <= tau / (2 m R), so that alpha may be anything from tau / J down to nothing.
        walls = Contacts([[0.0, -0.5, 0.0], [0.0, 0.5, 0.0]], [DOWN, UP])
        case = load(torque=0.2, weight=(0.0, 0.0)), walls
        found, _ = motion(case, 0.5, 0.1 * np.eye(3))
        assert (found.moves, found.uniqueness, found.jams) == (False, Uniqueness.FAMILY, True)
        assert found.solutions[-1].angular_acceleration == pytest.approx([0.0, 0.0, 2.0])
        # A thin bar gripped by three contacts on one line of action, dragged along.
        grip = Contacts([[0.0, -0.1, 0.0], [0.0, 0.1, 0.0], [0.0, -0.2, 0.0]], [DOWN, UP, DOWN])
        found, _ = motion((load((1.0, 0.0), weight=(0.0, 0.0)), grip), 0.5, np.eye(3))
        assert (found.moves, found.uniqueness, found.jams) == (False, Uniqueness.FAMILY, True)
        assert found.solutions[-1].acceleration == pytest.approx([1.0, 0.0, 0.0])
        assert found.residual < 1e-9
        # Four normals through the centre: their four forces are not determined, and with them friction's torque.
        found, _ = motion((sphere(torque=[0.1, 0.2, 0.9])[0], ring(4)), 0.3)
        assert found.uniqueness is Uniqueness.FAMILY and found.residual < 1e-9

    def test_no_load_rests(self):
        for acting in (load(weight=(0.0, 0.0)), load((0.0, 1.0))):
            found, first = motion((acting, pocket(0.5)), 0.5, np.eye(3))
            assert (first.mode, found.uniqueness) == (Mode.REST, Uniqueness.ONLY)
            assert not first.contact_forces.any()

    def test_infinite_friction(self):
        # Two contacts that cannot slip jam the disc, or it turns about the downstream one: see TestPocket.
        found, _ = motion((load((1.0, 0.0)), pocket(0.5)), math.inf, np.eye(3) / 8.0)
        alpha = -(math.cos(0.5) - math.sin(0.5)) * 0.5 / (0.125 + 0.25)
        assert (found.moves, found.uniqueness, found.jams) == (False, Uniqueness.SEVERAL, True)
        turning = found.solutions[-1].angular_acceleration
        assert turning == pytest.approx([0.0, 0.0, alpha], rel=1e-5)
        _, toppled = motion(box(0.0, [0.6, 0.0, 0.0], 2.0), math.inf, np.eye(3))
        assert toppled.mode is Mode.PIVOTING
        assert toppled.angular_acceleration == pytest.approx([0.0, 0.2 / 6.0, 0.0], abs=1e-9)


class TestConsistency:
    @pytest.mark.parametrize("friction", [0.0, 0.3, 0.7])
    @pytest.mark.parametrize(
        "case",
        [
            (load((0.6, 0.1), -0.02), pocket(0.7)),
            (sphere([0.5, 0.2, 0.1], [0.0, 0.01, 0.0])[0], ring(3, turn=10.0)),
        ],
        ids=["2-D", "3-D"],
    )
    def test_rest_and_safety_change_together(self, friction, case):
        acting, contacts = case
        critical = safety_factor(acting, contacts, friction).interval[1]
        for factor, rests in ((1.0 - 1e-6, True), (1.0 + 1e-6, False)):
            part = critical * factor
            force, torque = part * acting.flow_force, part * acting.flow_couple
            scaled = replace(acting, flow_force=force, flow_couple=torque)
            found, _ = motion((scaled, contacts), friction)
            if critical > 0.0:
                assert safety_factor(scaled, contacts, friction).held is rests
                assert found.moves is not rests

    @pytest.mark.parametrize("seed", range(40))
    def test_planar_motions_solve_the_problem_in_3d(self, seed):
        # The enumeration in 2-D and Newton's method in 3-D know nothing of each other.
        random = np.random.default_rng(seed)
        angles = np.radians(random.uniform(200.0, 340.0, random.integers(1, 5)))
        normals = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))])
        points = 0.5 * normals + 0.1 * random.normal(size=normals.shape) * [1.0, 1.0, 0.0]
        case = load(random.normal(size=2), 0.3 * random.normal()), Contacts(points, normals)
        flat, _ = motion(case, 0.4, 0.1 * np.eye(3))
        problem = replace(ContactProblem.of(*case, 0.4), plane=None)
        solid = ReleaseProblem.of(problem, np.ones(1), 0.1 * np.eye(3)[None])
        (count,), in_3d, _ = solid.motions(12)
        known = [[*one.acceleration, *one.angular_acceleration] for one in flat.solutions]
        units = solid.acceleration_unit[0] / np.array([1.0] * 3 + [problem.reach[0]] * 3)
        assert count or not flat.moves
        if flat.uniqueness is not Uniqueness.FAMILY:
            for candidate in in_3d[0, :count]:
                misses = np.abs(units * candidate - np.array(known)).max(axis=1)
                assert misses.min() < 1e-7

    def test_derivative_of_coulombs_law(self):
        # Central differences at forces on neither side of a kink, of the projection written out.
        problem = ContactProblem.of(
            Load([0.5, 0.2, 0.1], [0.0, 0.01, 0.02], [0.0, 0.0, -1.0], [0.0] * 3), ring(3), 0.4
        )
        law: CoulombLaw = ReleaseProblem.of(problem, np.ones(1), 0.1 * np.eye(3)[None]).coulomb
        near, found = 1e-6 * np.eye(9), np.empty((9, 9))

        def missed(force):
            projection = (force @ law.onto + law.offset).reshape(-1, 3)
            projection[:, 0] = np.maximum(projection[:, 0], 0.0)
            size = np.hypot(projection[:, 1], projection[:, 2])
            projection[:, 1:] *= np.minimum(law.friction * projection[:, 0] / size, 1.0)[:, None]
            return force - projection.ravel()

        for force in np.random.default_rng(1).normal(size=(40, 9)):
            differentiate(law.onto, law.friction, force @ law.onto + law.offset, found)
            expected = [(missed(force + d) - missed(force - d)) / 2e-6 for d in near]
            assert found == pytest.approx(np.transpose(expected), abs=1e-8)


class TestInput:
    @pytest.mark.parametrize(
        ("mass", "inertia", "match"),
        [
            (0.0, np.eye(3), "mass 0.0 is not positive"),
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

    def test_plain_data(self):
        stored = motion((load((1.0, 0.0)), pocket(0.5)), 0.5, np.eye(3))[0].to_dict()
        assert (stored["mode"], stored["uniqueness"], stored["moves"]) == ("PIVOTING", "ONLY", True)
        assert len(stored["solutions"]) == 1
