"""The safety factor against programs written here with scipy, at any scale, and for a patch that spins.

In 3-D friction cones are cut by tangent planes until the linear program's forces are inside: its value is exact.
"""

import math

import numpy as np
import pytest
from random_contacts import random_case
from scipy.optimize import linprog
from test_random_contacts import any_case

from incipient.contact import Contacts, Load, safety_factor
from incipient.contact.friction import FrictionCone

LARGE = 1e3  # a factor above it is not told from an infinite one by the linear programs


def reference(load, contacts, friction, pull=0.0):
    """The smallest and the largest balanced factor, by linear programs with cuts; None if there is none."""
    arms, normals = contacts.points - load.centre, contacts.normals
    k = len(arms)
    across = np.eye(3)[np.abs(normals).argmin(axis=1)]
    one = np.cross(normals, across)
    one /= np.linalg.norm(one, axis=1)[:, None]
    local = np.stack([-normals, one, np.cross(normals, one)], axis=1)
    forces = local.reshape(-1, 3).T
    wrenches = np.vstack([forces, np.cross(np.repeat(arms, 3, axis=0), forces.T).T])
    flow = np.concatenate([load.flow_force, load.flow_couple])
    balance = np.column_stack([wrenches, flow])
    weight = np.concatenate([load.weight, np.zeros(3)])

    def extreme(sign):
        cuts = [
            (i, angle)
            for i in range(k)
            for angle in np.linspace(0.0, 2 * np.pi, 12, endpoint=False)
        ]
        bounds = [(None if j % 3 else -pull, None) for j in range(3 * k)] + [(0, LARGE)]
        cost = np.zeros(3 * k + 1)
        cost[-1] = sign
        for _ in range(60):
            rows = np.zeros((len(cuts), 3 * k + 1))
            for row, (i, angle) in zip(rows, cuts, strict=True):
                row[3 * i : 3 * i + 3] = -friction, math.cos(angle), math.sin(angle)
            tight = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
            limit = np.full(len(cuts), friction * pull)
            result = linprog(cost, rows, limit, balance, -weight, bounds, "highs", options=tight)
            if result.x is None:
                return None
            table = result.x[:-1].reshape(-1, 3)
            outside = np.hypot(table[:, 1], table[:, 2]) - friction * (table[:, 0] + pull)
            if outside.max() <= 1e-10 * max(1.0, np.abs(table).max()):
                break
            for i in np.flatnonzero(outside > 1e-11):
                cuts.append((i, math.atan2(table[i, 2], table[i, 1])))
        return result.x[-1]

    ends = extreme(1.0), extreme(-1.0)
    return None if None in ends else ends


@pytest.mark.parametrize(
    ("first", "count"), [(5000, 26), pytest.param(5026, 434, marks=pytest.mark.slow)]
)
def test_random_cases_against_programs_with_cuts(first, count):
    """The ends of the interval of balanced factors, or none, in 2-D and 3-D; half of the cases are cohesive."""
    statuses = set()
    for seed in range(first, first + count):
        case, pull = any_case(seed), 0.3 * (seed // 2 % 2)
        result = safety_factor(case.load, case.contacts, FrictionCone.of(case.friction, pull))
        expected = reference(case.load, case.contacts, case.friction, pull)
        statuses.add(result.status.name)
        if expected is None:
            assert result.interval is None, seed
            continue
        low, high = result.interval
        assert low == pytest.approx(expected[0], rel=1e-6, abs=1e-7), seed
        assert min(high, LARGE) == pytest.approx(expected[1], rel=1e-6, abs=1e-7), seed
    assert {"CRITICAL", "UNLIMITED", "HELD_BY_FLOW", "UNHELD"} <= statuses


# Points, normals to be made unit vectors, force, torque, friction: 2 of 16 in 240,000 random cases that had no answer
# while the steps of the dual variables carried the round-off of their scaling.
UNANSWERED = [
    (
        [[-0.32, -0.77, -0.55], [0.08, -0.5, -0.86], [-0.39, 0.79, -0.48], [0.36, -0.64, -0.67]],
        [[-0.3, -0.9, -0.4], [-0.1, -0.5, -0.9], [-0.2, 0.8, -0.6], [-0.1, -0.9, -0.5]],
        ([-0.02, 0.21, -0.19], [0.17, 0.18, -0.15], 0.8),
    ),
    (
        [[-0.05, -0.99, -0.09], [0.61, 0.64, -0.46], [-0.56, -0.26, -0.79], [0.06, -0.97, -0.24]],
        [[-0.1, -1.0, 0.1], [0.6, 0.6, -0.6], [-0.3, -0.4, -0.8], [0.3, -0.9, -0.2]],
        ([0.02, -0.33, -0.39], [0.0, 0.07, -0.03], 0.23),
    ),
]


@pytest.mark.parametrize("number", range(len(UNANSWERED)))
def test_no_case_is_left_without_an_answer(number):
    points, normals, (force, torque, friction) = UNANSWERED[number]
    normals = np.array(normals) / np.linalg.norm(normals, axis=1)[:, None]
    case = Load(force, torque, [0.0, 0.0, -1.0], np.zeros(3)), Contacts(points, normals), friction
    result, expected = safety_factor(*case), reference(*case)
    assert result.interval == pytest.approx(expected, rel=1e-6, abs=1e-7)


@pytest.mark.parametrize("distance", np.geomspace(1e-11, 1e-5, 19))
def test_contacts_near_one_another(distance):
    """Friction holds the push, whose torque is balanced: 0.5 W / F = 1.25 however near two of the contacts are."""
    foot, turned = np.array([0.0, 0.0, -1.0]), distance * np.array([0.6, 0.8, 0.0])
    load = Load([0.4, 0.0, 0.0], [0.0, -0.4, 0.0], [0.0, 0.0, -1.0], np.zeros(3))
    along = np.array([1.0, 0.0, 0.0])
    feet = [[foot - turned, foot + turned], [foot - along, foot + along, foot + along + turned]]
    if distance < 1e-7:  # the load passes through the first contact, to round-off over the distance
        feet += [[foot, foot + turned], [foot, foot + distance * along, foot + turned]]
    for points in feet:
        near = Contacts(np.array(points), [[0.0, 0.0, -1.0]] * len(points))
        assert safety_factor(load, near, 0.5).value == pytest.approx(1.25, rel=3e-7)


def test_a_patch_by_its_corners_is_an_upper_bound_when_it_spins():
    """Square of side 1, friction 0.5: all the load at the corners holds mu W sqrt(2)/2 = 0.354 about its normal.

    Even pressure holds mu W times the mean distance, (sqrt(2) + ln(1 + sqrt(2)))/6 = 0.383: 0.191. Points inside the
    patch cannot lower the factor, since rigid statics leaves the pressure free.
    """
    corners = np.array([[x, y, -0.5] for x in (-0.5, 0.5) for y in (-0.5, 0.5)])
    grid = np.linspace(-0.5, 0.5, 5)
    inside = np.array([[x, y, -0.5] for x in grid for y in grid])
    spin = Load(np.zeros(3), [0.0, 0.0, 1.0], [0.0, 0.0, -1.0], np.zeros(3))
    for points in (corners, inside):
        contacts = Contacts(points, np.tile([0.0, 0.0, -1.0], (len(points), 1)))
        assert safety_factor(spin, contacts, 0.5).value == pytest.approx(0.5 * math.sqrt(0.5))


def nearly_jammed(seed):
    """Three contacts, of which two oppose one another at 1e-8 to 0.1 from the friction angle of 45 degrees."""
    random = np.random.default_rng(seed)
    points, normals = random.normal(size=(2, 3, 3))
    along = points[1] - points[0]
    along /= np.linalg.norm(along)
    across = np.cross(along, random.normal(size=3))
    across /= np.linalg.norm(across)
    for contact, way in ((0, -along), (1, along)):
        angle = math.pi / 4.0 + random.choice([-1.0, 1.0]) * 10.0 ** random.uniform(-8.0, -1.0)
        normals[contact] = math.cos(angle) * way + math.sin(angle) * across
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    load = Load(random.normal(size=3), np.zeros(3), [0.0, 0.0, -1.0], np.zeros(3))
    return load, Contacts(points, normals), 1.0


@pytest.mark.parametrize("seed", [1622, 1692, 1806, 2969])
def test_contacts_that_nearly_jam_have_an_answer(seed):
    """Forces of 1e5 times the load and more: these had no answer, since the dual value was not exact to 1e-8."""
    acting = nearly_jammed(seed)
    answer, expected = safety_factor(*acting), reference(*acting)
    assert answer.residual < 1e-8
    assert (answer.interval is None) is (expected is None)
    if (
        expected is not None
    ):  # forces of the linear programs miss the cones by 1e-10 times their size
        assert answer.interval[0] == pytest.approx(expected[0], rel=1e-2, abs=1e-7)
        assert min(answer.interval[1], LARGE) == pytest.approx(expected[1], rel=1e-2, abs=1e-7)


def test_a_load_that_a_jam_nearly_holds_has_an_answer():
    """Its certificate of infeasibility, b.y = 4e-5, had to exceed the scale of the embedding by 1e11."""
    case = random_case(14384)
    assert reference(case.load, case.contacts, case.friction) is None
    assert safety_factor(case.load, case.contacts, case.friction).interval is None
