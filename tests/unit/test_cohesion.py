"""Contacts that pull: N >= -c, |T| <= friction (N + c), against closed forms and linear programs."""

import math

import numpy as np
import pytest
from scipy.optimize import linprog

from incipient.contact import (
    Cases,
    Contacts,
    Load,
    incipient_motion,
    judge,
    judge_many,
    safety_factor,
)
from incipient.contact.friction import FrictionCone
from incipient.contact.safety import ConeState
from incipient.contact.verdict import Reason
from incipient.errors import SceneError
from incipient.judging.case import Case, judge_case
from incipient.scene import Contact, example, loads

pytestmark = pytest.mark.quick
FRICTION, PULL, WEIGHT, PUSH = 0.5, 0.3, 2.0, 1.5


def block(width: float, height: float) -> Contacts:
    """The lower corners of a block whose centre of mass is the origin."""
    points = [[side * 0.5 * width, -0.5 * height, 0.0] for side in (-1.0, 1.0)]
    return Contacts(np.array(points), np.array([[0.0, -1.0, 0.0]] * 2))


def pushed(force: list[float], torque: float = 0.0) -> Load:
    return Load(
        np.array(force), np.array([0.0, 0.0, torque]), np.array([0.0, -WEIGHT, 0.0]), np.zeros(3)
    )


def test_a_block_slides_when_friction_of_weight_and_cohesion_is_exceeded():
    """s F = friction (W + 2 c)."""
    contacts, law = block(4.0, 0.2), FrictionCone.of(FRICTION, PULL)
    found = safety_factor(pushed([PUSH, 0.0, 0.0]), contacts, law)
    assert found.value == pytest.approx(FRICTION * (WEIGHT + 2.0 * PULL) / PUSH)
    assert found.contact_forces[:, 1].sum() == pytest.approx(WEIGHT)
    assert found.contact_states == (ConeState.EDGE,) * 2


def test_a_block_topples_when_the_contact_behind_is_torn_off():
    """About the corner ahead: s F h/2 = W b/2 + c b."""
    width, height = 1.0, 3.0
    found = safety_factor(
        pushed([PUSH, 0.0, 0.0]), block(width, height), FrictionCone.of(5.0, PULL)
    )
    held = 0.5 * WEIGHT * width + PULL * width
    assert found.value == pytest.approx(held / (0.5 * PUSH * height))
    assert found.contact_forces[0, 1] == pytest.approx(-PULL)
    assert found.contact_states[0] is ConeState.UNLOADED  # nothing presses in the cone


@pytest.mark.parametrize("units", [1.0, 1e-13, 1e9])
def test_a_sphere_is_torn_off_a_plane(units):
    """s F = W + c; beyond, the centre accelerates by (F - W - c)/m. In units of any size."""
    contact = Contacts(np.array([[0.0, 0.0, -0.5]]), np.array([[0.0, 0.0, -1.0]]))
    law = FrictionCone.of(FRICTION, PULL * units)
    zero, weight = np.zeros(3), np.array([0.0, 0.0, -WEIGHT * units])
    load = Load(np.array([0.0, 0.0, 4.0 * units]), zero, weight, zero)
    assert safety_factor(load, contact, law).value == pytest.approx((WEIGHT + PULL) / 4.0)
    motion = incipient_motion(load, contact, law, 2.0 * units, 0.2 * units * np.eye(3))
    assert motion.first.acceleration == pytest.approx([0.0, 0.0, (4.0 - WEIGHT - PULL) / 2.0])
    assert motion.first.contact_forces[0] == pytest.approx([0.0, 0.0, -PULL * units])


def linear_program(load: Load, contacts: Contacts, friction: float, pull: float) -> float:
    """The safety factor by a linear program in the forces themselves, N and T of each contact of the plane."""
    inward = -contacts.normals[:, :2]
    along = np.column_stack([-inward[:, 1], inward[:, 0]])
    arms = (contacts.points - load.centre)[:, :2]

    def rows(vectors):
        return np.vstack([vectors.T, arms[:, 0] * vectors[:, 1] - arms[:, 1] * vectors[:, 0]])

    flow = np.append(load.flow_force[:2], load.flow_couple[2])
    balance = np.column_stack([rows(inward), rows(along), flow])
    count = len(inward)
    bounds = [(-pull, None)] * count + [(None, None)] * count + [(0.0, None)]
    limit = np.zeros((2 * count, 2 * count + 1))
    limit[:count, :count] = limit[count:, :count] = -friction * np.eye(count)
    limit[:count, count : 2 * count], limit[count:, count : 2 * count] = (
        np.eye(count),
        -np.eye(count),
    )
    weight = np.append(load.weight[:2], 0.0)

    def least(direction: float) -> float:
        """The smallest of the factor times a direction; infinite without an end, NaN without a solution."""
        cost = np.append(np.zeros(2 * count), direction)
        found = linprog(
            cost,
            A_ub=limit,
            b_ub=np.full(2 * count, friction * pull),
            A_eq=balance,
            b_eq=-weight,
            bounds=bounds,
        )
        return {2: math.nan, 3: -math.inf}.get(found.status, found.fun)

    return -least(-1.0) if least(1.0) <= 1e-9 else 0.0  # zero where the weight alone is not held


def random_case(seed: int) -> tuple[Load, Contacts, float, float]:
    random = np.random.default_rng(seed)
    count = int(random.integers(1, 4))
    angles = random.uniform(-0.9, 0.9, count) - 0.5 * np.pi
    outward = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(count)])
    force = [*random.normal(size=2), 0.0]
    return (
        pushed(force, 0.3 * random.normal()),
        Contacts(0.5 * outward, outward),
        *random.uniform(0.1, 1.0, 2),
    )


def test_random_cases_of_the_plane_are_those_of_linear_programs():
    rows, expected = [random_case(seed) for seed in range(120)], []
    for load, contacts, friction, pull in rows:
        expected.append(linear_program(load, contacts, friction, pull))
        found = safety_factor(load, contacts, FrictionCone.of(friction, pull)).value
        assert found == pytest.approx(expected[-1], rel=1e-6, abs=1e-9)
    points, normals = np.full((120, 3, 3), np.nan), np.full((120, 3, 3), np.nan)
    for place, (_, contacts, *_) in enumerate(rows):
        points[place, : len(contacts.points)] = contacts.points
        normals[place, : len(contacts.points)] = contacts.normals
    names = ("flow_force", "flow_couple", "weight", "centre")
    loads = [np.array([getattr(row[0], name) for row in rows]) for name in names]
    law = FrictionCone(np.array([row[2] for row in rows]), np.array([row[3] for row in rows]))
    batch = judge_many(Cases(points, normals, *loads, law, np.nan, np.nan))
    assert batch.factors == pytest.approx(np.array(expected), rel=1e-6, abs=1e-9)


def test_the_paper_s_criteria_know_no_cohesion():
    verdict = judge(
        pushed([PUSH, 0.0, 0.0]), block(4.0, 0.2), FrictionCone.of(FRICTION, 10.0 * PULL)
    )
    assert not verdict.moves and verdict.criteria.moves
    assert verdict.agreement.reason is Reason.COHESION


def test_cohesion_is_a_key_of_scenes_and_cases():
    assert Contact(friction=0.4, cohesion=2.0).law.cohesion == 2.0
    corners = block(4.0, 0.2)
    case = Case.model_validate(
        {
            "load": {
                "weight": [0, -WEIGHT],
                "flow_force": [PUSH, 0],
                "flow_couple": 0,
                "centre": [0, 0],
            },
            "contacts": {
                "points": corners.points[:, :2].tolist(),
                "normals": corners.normals[:, :2].tolist(),
                "friction": FRICTION,
                "cohesion": PULL,
            },
        }
    )
    assert judge_case(case)["verdict"]["safety_factor"] == pytest.approx(
        FRICTION * (WEIGHT + 2.0 * PULL) / PUSH
    )


def test_a_grain_that_never_touches_the_bed_has_none():
    free = ["body={shape='disc', diameter=1.0, centre=[20.0, 5.0], density=2.0, motion='free'}"]
    settings = [*free, "time={end=1.0, step=0.1}", "contact={friction=0.5, cohesion=1.0}"]
    with pytest.raises(SceneError, match=r"contact\.cohesion: .*never touches the bed"):
        loads(example(), overrides=settings)


@pytest.mark.parametrize("pull", [-0.1, math.nan, math.inf])
def test_a_pull_that_is_none_is_refused(pull):
    with pytest.raises(SceneError, match=r"cohesion .* is not allowed"):
        safety_factor(
            pushed([1.0, 0.0, 0.0]), block(1.0, 1.0), FrictionCone(np.array(0.5), np.array(pull))
        )
