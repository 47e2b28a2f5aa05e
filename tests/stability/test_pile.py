"""Grains that rest on one another: which moves first, and at which multiple of the flow's loads."""

import math

import numpy as np
import pytest
from random_contacts import random_case
from scenes import CASES, message
from scipy.optimize import linprog

from incipient.cli import main
from incipient.contact import Contacts, Load, incipient_motion, safety_factor
from incipient.contact.friction import FrictionCone
from incipient.contact.pile import Interface, PileProblem, judge_pile
from incipient.contact.safety import ConeState, SafetyStatus, safety_of
from incipient.errors import SceneError
from incipient.judging.case import load_case
from incipient.judging.pile import judge_pile_case

DOWN, UNIT = [0.0, -1.0, 0.0], 0.1 * np.eye(3)
STACK = CASES / "block_on_block.toml"


def stack(slope, frictions, flows, height=0.5, lift=0.0):
    """Blocks of weights 2 and 1 and of widths 2 and 1 on an incline, coordinates along it, downhill +x."""
    loads = [
        Load(
            [flow, lift * place, 0.0],
            np.zeros(3),
            [weight * math.sin(slope), -weight * math.cos(slope), 0.0],
            [0.0, (place + 0.5) * height, 0.0],
        )
        for place, (flow, weight) in enumerate(zip(flows, (2.0, 1.0), strict=True))
    ]
    feet = [
        Contacts([[-0.5 * width, y, 0.0], [0.5 * width, y, 0.0]], [DOWN] * 2)
        for width, y in ((2.0, 0.0), (1.0, height))
    ]
    faces = [Interface(0, None, feet[0], frictions[0]), Interface(1, 0, feet[1], frictions[1])]
    return loads, faces, [2.0, 1.0], [UNIT, UNIT]


SLOPE = 0.1
SIN, COS = math.sin(SLOPE), math.cos(SLOPE)


@pytest.mark.parametrize(
    ("pile", "factor", "modes"),
    [
        # Both slide on the bed: friction (W1 + W2) cos - (W1 + W2) sin = s (F1 + F2).
        (
            stack(SLOPE, (0.2, 0.5), (0.1, 0.1)),
            (0.2 * COS - SIN) * 3.0 / 0.2,
            ("sliding", "carried"),
        ),
        # The upper one slides: friction W2 cos - W2 sin = s F2.
        (stack(SLOPE, (0.5, 0.2), (0.1, 0.1)), (0.2 * COS - SIN) / 0.1, ("rest", "sliding")),
        (stack(SLOPE, (0.5, FrictionCone.of(0.2, 0.25)), (0.1, 0.1)), (0.2 * (COS + 0.25) - SIN) / 0.1,
         ("rest", "sliding")),
        # It topples: (s F2 + W2 sin) height / 2 = W2 cos / 2.
        (stack(SLOPE, (2.0, 3.0), (0.0, 0.5), 1.25), (COS / 1.25 - SIN) / 0.5, ("rest", "pivoting")),
        # It is lifted by s L = W2, or with cohesion c = 0.5 by s L = W2 + c.
        (stack(0.0, (0.5, 0.5), (0.0, 0.0), lift=0.5), 2.0, ("rest", "lifting")),
        (stack(0.0, (0.5, FrictionCone.of(0.5, 0.5)), (0.0, 0.0), lift=0.5), 3.0, ("rest", "lifting")),
        # Nothing but inertia holds a frictionless block.
        (stack(0.0, (0.5, 0.0), (0.1, 0.1)), 0.0, ("rest", "sliding")),
    ],
)  # fmt: skip
def test_a_block_on_a_block(pile, factor, modes):
    verdict = judge_pile(*pile)
    assert verdict.safety.value == pytest.approx(factor, abs=1e-9)
    assert verdict.motion is not None and verdict.motion.modes == modes
    assert verdict.first == tuple(b for b, mode in enumerate(modes) if mode != "rest")
    assert misses(pile, verdict.safety.contact_forces, verdict.safety.factor) < 1e-9
    motion = verdict.motion
    inertial = [-m * a for m, a in zip(pile[2], motion.acceleration, strict=True)]
    assert misses(pile, motion.contact_forces, motion.factor, inertial) < 1e-9


def misses(pile, forces, factor, inertial=None):
    """Largest resultant force on a grain; the opposite of a contact force acts on the other grain."""
    loads, faces, *_ = pile
    whole = [load.weight + factor * load.flow_force for load in loads]
    whole = np.array(whole) + (0.0 if inertial is None else np.array(inertial))
    places = np.repeat(np.arange(len(faces)), [len(face.contacts) for face in faces])
    for place, force in zip(places, forces, strict=True):
        whole[faces[place].grain] += force
        if faces[place].other is not None:
            whole[faces[place].other] -= force
    return np.abs(whole).max()


def heap(friction, friction_of_bed, angles):
    """A sphere (in 2-D a cylinder) of radius and weight one on two or more, with the floor below them."""
    count, sine = len(angles), 1.0 if len(angles) == 2 else 2.0 / math.sqrt(3.0)
    ring = np.array([[sine * math.cos(a), 0.0, sine * math.sin(a)] for a in angles])
    centres = [*ring, [0.0, math.sqrt(4.0 - sine**2), 0.0]]
    loads = [Load(np.zeros(3), np.zeros(3), DOWN, centre) for centre in centres]
    faces = [
        Interface(place, None, Contacts([centre + DOWN], [DOWN]), friction_of_bed)
        for place, centre in enumerate(ring)
    ]
    for place, centre in enumerate(ring):
        way = 0.5 * (centre - centres[-1])
        faces.append(Interface(count, place, Contacts([centres[-1] + way], [way]), friction))
    return loads, faces, [1.0] * (count + 1), [0.4 * np.eye(3)] * (count + 1)


@pytest.mark.parametrize(
    ("angles", "sine"),
    [
        ((0.0, math.pi), 0.5),
        ((0.0, 2.0 * math.pi / 3.0, 4.0 * math.pi / 3.0), 1.0 / math.sqrt(3.0)),
    ],
)
def test_a_sphere_on_free_spheres_needs_friction(angles, sine):
    """By hand: weight and floor force of a lower sphere pass through its foot, so that the third force does too.

    Its angle to the line of centres, at theta to the vertical, is theta / 2. Of n lower spheres each carries W / n,
    so that its floor sees the tangent of theta / 2 over n + 1.
    """
    needed, count = math.tan(0.5 * math.asin(sine)), len(angles)
    for more, held in ((1e-6, True), (-1e-6, False)):
        for frictions in ((needed + more, 1.0), (1.0, needed / (count + 1) + more)):
            verdict = judge_pile(*heap(*frictions, angles))
            assert verdict.safety.held is held
            assert verdict.first == (() if held else tuple(range(count + 1)))


@pytest.mark.parametrize("seed", range(0, 60, 3))
def test_a_grain_on_a_heavy_one_is_as_on_the_bed(seed):
    """On a slab that stays where it is: factor and motion are those of the grain on the bed."""
    case = random_case(seed)
    slab = Load(np.zeros(3), np.zeros(3), [0.0, 0.0, -100.0], [0.0, 0.0, -3.0])
    feet = Contacts(
        [[x, y, -4.0] for x in (-5.0, 5.0) for y in (-5.0, 5.0)], [[0.0, 0.0, -1.0]] * 4
    )
    faces = [Interface(1, None, feet, 2.0), Interface(0, 1, case.contacts, case.friction)]
    verdict = judge_pile(
        [case.load, slab], faces, [case.mass, 100.0], [case.inertia, 1e3 * np.eye(3)]
    )
    alone = safety_factor(case.load, case.contacts, case.friction)
    assert verdict.safety.held is alone.held
    if math.isinf(alone.value):
        assert verdict.safety.value > 10.0  # which moves the slab as well
    else:
        assert verdict.safety.value == pytest.approx(alone.value, rel=1e-9, abs=1e-9)
    single = judge_pile(
        [case.load], [Interface(0, None, case.contacts, case.friction)], [case.mass], [case.inertia]
    )
    assert single.safety.value == pytest.approx(alone.value, rel=1e-9, abs=1e-9)
    if single.motion is not None:
        load, factor = case.load, single.motion.factor
        onset = Load(factor * load.flow_force, factor * load.flow_couple, load.weight, load.centre)
        motion = incipient_motion(onset, case.contacts, case.friction, case.mass, case.inertia)
        assert single.motion.modes == (motion.first.mode.label,)
        assert single.motion.acceleration[0] == pytest.approx(motion.first.acceleration, abs=1e-8)
        assert verdict.motion.modes == (*single.motion.modes, "rest")


def random_pile(seed):
    """Three grains in the plane with contacts anywhere, of which the second and third rest on the first."""
    random = np.random.default_rng(seed)
    flat = np.array([1.0, 1.0, 0.0])
    centres = random.normal(size=(3, 3)) * flat
    loads = [
        Load(random.normal(size=3) * flat, [0.0, 0.0, random.normal()], [0.0, -1.0, 0.0], centre)
        for centre in centres
    ]
    faces = []
    for grain, other in ((0, None), (1, 0), (2, 0), (1, None), (2, None)):
        angles = random.uniform(-2.5, -0.6, size=2)
        normals = np.array([np.cos(angles), np.sin(angles), 0.0 * angles]).T
        points = centres[grain] + random.uniform(0.5, 1.5, size=(2, 1)) * normals
        faces.append(Interface(grain, other, Contacts(points, normals), random.uniform(0.2, 1.0)))
    return loads, faces


def extreme_factor(loads, faces, sign):
    """Least or largest balanced factor by a linear program with the edges of the cones, up to 1e3; None without."""
    columns = []
    for face in faces:
        for point, normal in zip(face.contacts.points, face.contacts.normals, strict=True):
            across = np.array([-normal[1], normal[0], 0.0])
            for force in (-normal + face.law * across, -normal - face.law * across):
                column = np.zeros((len(loads), 3))
                for grain, way in ((face.grain, 1.0), (face.other, -1.0)):
                    if grain is not None:
                        torque = np.cross(point - loads[grain].centre, way * force)[2]
                        column[grain] = [*(way * force[:2]), torque]
                columns.append(column.ravel())
    flow = [[*load.flow_force[:2], load.flow_couple[2]] for load in loads]
    weight = [[*load.weight[:2], 0.0] for load in loads]
    rows = np.column_stack([*columns, np.ravel(flow)])
    bounds = [(0.0, None)] * len(columns) + [(0.0, 1e3)]
    answer = linprog(
        [0.0] * len(columns) + [sign], A_eq=rows, b_eq=-np.ravel(weight), bounds=bounds
    )
    return None if answer.x is None else answer.x[-1]


@pytest.mark.parametrize(
    ("seeds", "expected"),
    [
        (range(20), {SafetyStatus.CRITICAL, SafetyStatus.UNHELD, SafetyStatus.UNLIMITED}),
        pytest.param(
            range(20, 40), {SafetyStatus.CRITICAL, SafetyStatus.UNHELD}, marks=pytest.mark.slow
        ),
    ],
)
def test_random_piles_against_linear_programs(seeds, expected):
    statuses = set()
    for seed in seeds:
        loads, faces = random_pile(seed)
        safety = safety_of(PileProblem.of_grains(loads, faces))
        statuses.add(safety.status)
        ends = [extreme_factor(loads, faces, sign) for sign in (1.0, -1.0)]
        if None in ends:
            assert safety.interval is None, seed
        else:
            low, high = safety.interval
            assert [low, min(high, 1e3)] == pytest.approx(ends, rel=1e-6, abs=1e-7), seed
    assert expected <= statuses


def test_states_of_contacts_that_differ_in_friction():
    """The upper block is about to slide; the lower one is not."""
    edge, inside = ConeState.EDGE, ConeState.INSIDE
    states = judge_pile(*stack(0.0, (0.5, 0.2), (0.0, 0.1))).safety.contact_states
    assert states[2:] == (edge, edge) and inside in states[:2]


def test_wrong_grains():
    loads, faces, masses, inertias = stack(0.0, (0.5, 0.5), (0.1, 0.1))
    outward = Contacts([[0.0, 0.5, 0.0]], [[0.0, 1.0, 0.0]])
    for wrong, match in (
        ((faces[:1], masses), "grain 1 has no contact"),
        ((faces, [1.0, -1.0]), "grain 1: mass is not positive"),
        (([faces[0], Interface(1, 0, outward, 0.5)], masses), "all normals point into the grain"),
    ):
        with pytest.raises(SceneError, match=match):
            judge_pile(loads, *wrong, inertias)


def test_a_case_file_says_which_grain_moves_first():
    """By hand: 0.4 / 0.3 for the upper block; at 6 times the load of the lower one 0.5 * 3 / 0.9."""
    stored = judge_pile_case(STACK)
    assert stored["safety_factor"] == pytest.approx(4.0 / 3.0)
    assert (stored["first"], stored["moves"]) == (["upper"], False)
    assert stored["pairs"] == 2 * [["lower", "bed"]] + 2 * [["upper", "lower"]]
    assert stored["sentences"][1].endswith("lower: rest, upper: sliding.")
    lower = judge_pile_case(STACK, ["grains.lower.flow_force=[2.0, 0.0]"])
    assert lower["safety_factor"] == pytest.approx(1.5 / 2.3)
    assert (lower["first"], lower["moves"]) == (["lower", "upper"], True)


def test_a_page_has_the_motion_of_each_grain(tmp_path, said_by):
    assert main(["judge", str(STACK), "--out", str(tmp_path)]) == 0
    assert "has no pictures; read it with: incipient report" in said_by("show", tmp_path, code=5)
    assert main(["report", str(tmp_path)]) == 0
    page = (tmp_path / "report.html").read_text()
    assert "lower: rest, upper: sliding." in page and "upper, lower" in page


def test_where_a_case_has_a_single_grain_a_pile_is_refused():
    with pytest.raises(
        SceneError, match=r"grains: are several, .*; give the file to incipient judge alone$"
    ):
        load_case(STACK)


GRAIN = "{weight=[0,-1],centre=[0,0],mass=1,inertia=1}"
TURNED = [
    ("grains.lower.mass=-1", "grains.lower.mass: is -1; give a number greater than 0"),
    ("grains.lower.mas=1", 'grains.lower.mas: unknown key; did you mean "mass"?'),
    ("contacts.upper.lower.frict=1", 'contacts.upper.lower.frict: unknown key; did you mean "fr'),
    ("grains.lower.weight=[0,0,-1]", "is for 2-D, grains.lower.weight has 3 components"),
    ("grains.upper.centre=[0,0,0.75]", "grains.upper.centre: is for 3-D, grains.lower.weight has 2 components"),
    ("contacts.upper.lower.points=[[-0.5,0,0.5],[0.5,0.5]]", "lower.points[0]: is for 3-D, grains.lower.weight has 2"),
    ("contacts.upper.lower.normals=[[0,1],[0,1]]", "lower.normals[0]: points into the grain"),
    ("contacts.upper.lower.points=[[0,0.5]]", "normals: 2 given for 1 point; give one for each"),
    (f"grains.bed={GRAIN}", "grains.bed: is the name of the bed; give the grain another name"),
    # A name may be a number, which is no place in a list.
    (f"grains.3={GRAIN}", f"--set grains.3={GRAIN}: grains.3: has no contact; add [contacts.3.bed]"),
    ("contacts.upper={low={points=[[0,0.5]],normals=[[0,-1]],friction=1}}",
     "contacts.upper.low: is not a pair of grains, or of a grain and the bed; write"),
    ("contacts.lower.upper={points=[[0,0.5]],normals=[[0,1]],friction=0.4,cohesion=0.1}",
     "contacts.upper.lower: are contacts of a pair of grains that has others; add them to [contacts.lower.upper]"),
]  # fmt: skip


@pytest.mark.parametrize(("override", "said"), TURNED)
def test_wrong_keys(override, said):
    assert said in message(lambda: judge_pile_case(STACK, [override]))
