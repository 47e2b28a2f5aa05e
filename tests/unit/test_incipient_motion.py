"""Incipient motion: accelerations, impulses and rocking."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scenes import grain_on_bed
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from test_safety_factor import ON_PLANE, box, load, pocket, ring, wedge

from incipient.arrays import Floats
from incipient.body.contact_motion import ContactLaw, ContactMotion, momenta
from incipient.body.rigidbody import RigidBody
from incipient.body.state import BodyState, Inertia
from incipient.contact import Contacts, Load
from incipient.contact.acceleration import (
    ContactState,
    Mode,
    ReleaseProblem,
    Uniqueness,
    incipient_motion,
    inverses,
)
from incipient.contact.friction import FrictionCone
from incipient.contact.impulses import (
    contact_impulses,
)
from incipient.contact.problem import ContactProblem
from incipient.contact.rocking import Rocking, follow
from incipient.contact.safety import SafetyStatus, safety_factor
from incipient.contact.verdict import judge
from incipient.errors import SceneError
from incipient.geometry import Bed, Ellipse, Grain, Sinusoidal, settle
from incipient.geometry.contacts import tangents
from incipient.geometry.placement import Placement
from incipient.geometry.plane.beds import Flat
from incipient.geometry.plane.grains import Disc, Rectangle
from incipient.geometry.settle import proximity
from incipient.planning.effects import Decision
from incipient.reporting.results import _statements
from incipient.results.errorbars import SafetyBar
from incipient.scene import Scene, loads
from incipient.scene.grains import mass_and_inertia
from incipient.setup.setup import Setup
from incipient.simulation.loads import (
    OTHER_CONTACTS,
    ROCKS,
    bar_with_rocking,
    may_rock,
    standing,
    with_rocking,
)
from incipient.simulation.loads import followed as followed_in
from incipient.simulation.omitted import without_motion

# Incipient accelerations against rigid-body mechanics. Each test states its formula; mass one unless said.
#
# In 2-D: x downstream, y up, torques counter-clockwise. In 3-D: z up. Normals point out of the grain.


DOWN, UP = [0.0, -1.0, 0.0], [0.0, 1.0, 0.0]
BALL = 0.4 * 0.5**2 * np.eye(3)  # of a solid sphere of mass one and radius one half: 2/5 m r^2
STICK, ROLL, SLIDE, LIFT = ContactState


def motion(case, friction, inertia=BALL, mass=1.0):
    """The incipient motion of a load and contacts, and its first solution."""
    result = incipient_motion(*case, friction, mass, np.asarray(inertia))
    return result, result.first


def sphere(force=(0, 0, 0), torque=(0, 0, 0), weight=(0, 0, -1)):
    """Load and contact of a sphere of radius one half on a plane, its centre at the origin."""
    return Load(force, torque, weight, [0, 0, 0]), ON_PLANE


EYE, ZERO = np.eye(3), [0.0, 0.0, 0.0]
TOPPLES, TURNS = 0.2 / (0.5 + 1.0 + 4.0), (0.6 * 2.0 - 1.0) / (0.5 - (0.6 * 2.0 - 1.0))
# Pocket of three: heights of the line of two contacts below the centre, and ahead of it.
BELOW, AHEAD = 0.5 * math.sqrt(2.0 / 3.0), 0.25 / math.sqrt(3.0)
GAP = (0.6 * BELOW - AHEAD) / (0.1 + BELOW**2 + AHEAD**2)
WALL = Contacts([[0, 0, -0.5], [0, 0.5, 0]], [[0, 0, -1], [0, 1, 0]])
ALONG = (0.5 - 0.3 * 0.3) / (1.0 + 0.1 / 0.25)  # along the wall
SKEW, SQUARE = 0.1 * 0.5 / (0.1 + 0.25), math.sqrt(2.0)
OVER = [-(push * math.cos(0.5) - math.sin(0.5)) * 0.5 / (0.125 + 0.25) for push in (0.8, 1.5)]


def turned(case, torque):
    """A case with another torque of the flow."""
    return replace(case[0], flow_couple=torque), case[1]


def incline(slope):
    """A sphere on a slope, coordinates along it."""
    return sphere(weight=[math.sin(slope), 0.0, -math.cos(slope)])


# Case, friction, inertia, mode, states of contacts, acceleration, angular acceleration; mass one.
MOTIONS = [
    # a = g (sin - friction cos), without turning: low enough not to topple.
    *(
        (
            box(slope, ZERO, height=0.1),
            friction,
            EYE,
            Mode.SLIDING,
            (SLIDE,) * 4,
            [math.sin(slope) - friction * math.cos(slope), 0.0, 0.0],
            ZERO,
        )
        for slope in (0.35, 0.8)
        for friction in (0.0, 0.2)
    ),
    # About the downstream edge: (J + m (b^2 + h^2)) alpha = F h - W b, about +y, for friction enough.
    (
        box(0.0, [0.6, 0.0, 0.0], 2.0),
        5.0,
        np.diag([0.7, 0.5, 0.9]),
        Mode.PIVOTING,
        (LIFT, LIFT, ROLL, ROLL),
        [2.0 * TOPPLES, 0.0, TOPPLES],
        [0.0, TOPPLES, 0.0],
    ),
    # N = W + m a_z, a_z = b alpha; J alpha = friction N h - N b.
    (
        box(0.0, [3.0, 0.0, 0.0], 2.0),
        0.6,
        0.5 * EYE,
        Mode.PIVOTING_AND_SLIDING,
        (LIFT, LIFT, SLIDE, SLIDE),
        [3.0 - 0.6 * (1.0 + TURNS), 0.0, TURNS],
        [0.0, TURNS, 0.0],
    ),
    (box(0.0, [0, 0, 1.5]), 0.5, EYE, Mode.LIFTING, (LIFT,) * 4, [0.0, 0.0, 0.5], ZERO),
    (
        turned(box(0.0, [0.1, 0.0, 2.0]), [0.0, 0.1, 0.0]),
        0.5,
        2.0 * EYE,
        Mode.LIFTING_AND_ROTATING,
        (LIFT,) * 4,
        [0.1, 0.0, 1.0],
        [0.0, 0.05, 0.0],
    ),
    # A torque about the vertical, equal corners, friction W acting at r = sqrt(2): J alpha = tau - m W r.
    (
        turned(box(0.0, ZERO), [0, 0, 1.0]),
        0.3,
        EYE,
        Mode.PIVOTING_AND_SLIDING,
        (SLIDE,) * 4,
        ZERO,
        [0, 0, 1.0 - 0.3 * SQUARE],
    ),
    # a = g sin / (1 + J / (m r^2)) = 5/7 g sin, if tan(slope) <= 3.5 friction; else g (sin - m cos), m g cos r / J.
    *(
        (
            incline(slope),
            math.tan(slope) / 3.5 * 1.0001,
            BALL,
            Mode.ROLLING,
            (ROLL,),
            [5.0 / 7.0 * math.sin(slope), 0.0, 0.0],
            [0.0, 10.0 / 7.0 * math.sin(slope), 0.0],
        )
        for slope in (0.2, 0.9)
    ),
    (
        incline(0.9),
        math.tan(0.9) / 3.5 * 0.9999,
        BALL,
        Mode.PIVOTING_AND_SLIDING,
        (SLIDE,),
        [math.sin(0.9) * (1.0 - 0.9999 / 3.5), 0.0, 0.0],
        [0.0, math.sin(0.9) * 0.9999 / 3.5 * 0.5 / 0.1, 0.0],
    ),
    # a = tau r / (J + m r^2) across the torque: the paper calls this sliding.
    (
        sphere(torque=[0.06, -0.08, 0.0]),
        0.5,
        BALL,
        Mode.ROLLING,
        (ROLL,),
        [-0.8 * SKEW, -0.6 * SKEW, 0.0],
        [1.2 * SKEW, -1.6 * SKEW, 0.0],
    ),
    # Friction at its limit: a = m g, J alpha = tau - m W r. About the normal no arm: alpha = tau / J.
    (
        sphere(torque=[0.0, 1.0, 0.0]),
        0.2,
        BALL,
        Mode.PIVOTING_AND_SLIDING,
        (SLIDE,),
        [0.2, 0.0, 0.0],
        [0.0, (1.0 - 0.2 * 0.5) / 0.1, 0.0],
    ),
    (sphere(torque=[0, 0, 0.1]), 0.5, BALL, Mode.SPINNING, (ROLL,), ZERO, [0.0, 0.0, 1.0]),
    # Both at once are not planar: the spin adds to the rolling, and each has its own formula.
    (
        sphere([0.2, 0.0, 0.0], [0.0, 0.0, 0.1]),
        0.5,
        BALL,
        Mode.ROLLING,
        (ROLL,),
        [0.2 / 1.4, 0.0, 0.0],
        [0.0, 0.4 / 1.4, 1.0],
    ),
    # Balanced about the contact, which friction 0.3 would hold.
    (
        sphere([0.3, 0, 0], [0, -0.15, 0]),
        0.29,
        BALL,
        Mode.PIVOTING_AND_SLIDING,
        (SLIDE,),
        [0.01, 0, 0],
        [0.0, -0.15 / 0.1 + 0.29 * 0.5 / 0.1, 0.0],
    ),
    # About the contact downstream: (J + m R^2) alpha = (F cos - W sin) R, clockwise, with friction enough.
    *(
        (
            (load((push, 0.0)), pocket(0.5)),
            0.9,
            0.125 * EYE,
            Mode.PIVOTING,
            (LIFT, ROLL),
            [-0.5 * alpha * math.cos(0.5), -0.5 * alpha * math.sin(0.5), 0.0],
            [0.0, 0.0, alpha],
        )
        for push, alpha in zip((0.8, 1.5), OVER, strict=True)
    ),
    # Along the tangent at the contact downstream: m a = F cos - W sin.
    (
        (load((0.8, 0.0)), pocket(0.5)),
        0.0,
        EYE,
        Mode.SLIDING,
        (LIFT, SLIDE),
        (0.8 * math.cos(0.5) - math.sin(0.5)) * np.array([math.cos(0.5), math.sin(0.5), 0.0]),
        ZERO,
    ),
    # Through the gap of a pocket of three: moment about the line of two contacts, J + m times its squared distance.
    (
        (sphere([0.6, 0, 0])[0], ring(3, 1.0 / math.sqrt(3.0), 60.0)),
        0.8,
        BALL,
        Mode.PIVOTING,
        (ROLL, LIFT, ROLL),
        [GAP * BELOW, 0.0, GAP * AHEAD],
        [0.0, GAP, 0.0],
    ),
    # Both contacts slip, see test_safety_factor: J alpha = tau - m R (N1 + N2).
    (
        (load(torque=-0.5), pocket(0.6)),
        0.2,
        0.1 * EYE,
        Mode.PIVOTING_AND_SLIDING,
        (SLIDE, SLIDE),
        None,
        [0, 0, -(0.5 - 0.2 * 0.5 / (math.cos(0.6) * (1.0 + 0.2**2))) / 0.1],
    ),
    # The paper's open mode 6(b). The sphere rolls on the floor along x and rubs on a wall at +y, pressed to it by P:
    # floor friction T = J a / r^2, wall friction m P slows it and spins it about the vertical, J spin = m P r.
    (
        (sphere([0.5, 0.3, 0.0])[0], WALL),
        0.3,
        BALL,
        Mode.PIVOTING_AND_SLIDING_APART,
        (ROLL, SLIDE),
        [ALONG, 0.0, 0.0],
        [0.0, ALONG / 0.5, 0.3 * 0.3 * 0.5 / 0.1],
    ),
]


@pytest.mark.parametrize(
    ("case", "friction", "inertia", "mode", "states", "acceleration", "angular"), MOTIONS
)
def test_motions(case, friction, inertia, mode, states, acceleration, angular):
    _, first = motion(case, friction, inertia)
    assert (first.mode, first.contact_states) == (mode, states)
    assert first.angular_acceleration == pytest.approx(np.array(angular), abs=1e-9)
    if acceleration is not None:
        assert first.acceleration == pytest.approx(np.array(acceleration), abs=1e-9)


def test_a_block_rests_with_equal_forces():
    # Four corners, three equations: a quarter of the weight each is the least of all.
    result, first = motion(box(0.0, [0.0, 0.0, 0.0]), 0.5, np.eye(3))
    assert (first.mode, result.uniqueness, result.moves) == (Mode.REST, Uniqueness.ONLY, False)
    assert first.contact_forces == pytest.approx(np.tile([0.0, 0.0, 0.25], (4, 1)))
    assert first.contact_states == (STICK,) * 4 and not first.forces_unique


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_forces_of_a_row_loaded_at_its_end(friction):
    # The only forces that push: 0.1 and 0.9 on the last two for a load at 1.9 of contacts at -2 to 2.
    x = np.arange(-2.0, 3.0)
    contacts = Contacts(np.column_stack([x, np.zeros((5, 2))]), [DOWN] * 5)
    result, first = motion((load(centre=(1.9, 0.3)), contacts), friction, np.eye(3))
    assert (first.contact_forces[:, 1] > -1e-12).all()
    assert first.contact_forces[:, 0] == pytest.approx(np.zeros(5), abs=1e-12)
    assert not first.forces_unique
    assert first.contact_forces[:, 1].sum() == pytest.approx(1.0)
    assert x @ first.contact_forces[:, 1] == pytest.approx(1.9)
    assert not result.moves and result.residual < 1e-9


# A wedge pulled out; the same in 3-D with the four corners of its sides.
PULLED = load((0.0, 3.0))
SIDES = Contacts(
    np.vstack([wedge(0.4).points + np.array([0.0, 0.0, z]) for z in (-0.3, 0.3)]),
    np.vstack([wedge(0.4).normals] * 2),
)
FITTED = Contacts([[0.0, -0.5, 0.0], [0.0, 0.5, 0.0]], [DOWN, UP])
GRIP = Contacts([[0.0, -0.1, 0.0], [0.0, 0.1, 0.0], [0.0, -0.2, 0.0]], [DOWN, UP, DOWN])
# Case, friction, inertia, modes of all solutions, uniqueness, whether contacts jam, acceleration and angular
# acceleration of the last solution.
DEGENERATE = [
    # Below the friction angle forces of any size brace the wedge: it may stay, or leave with a = (F - W) / m.
    ((PULLED, wedge(0.4)), 0.5, EYE, ("REST", "LIFTING"), "SEVERAL", True, [0, 2, 0, 0, 0, 0]),
    ((PULLED, wedge(0.5)), 0.5, EYE, ("LIFTING",), "ONLY", False, [0, 2, 0, 0, 0, 0]),
    (
        (load((0.1, 3.0)), SIDES),
        0.5,
        np.diag([1.0, 2.0, 3.0]),
        ("REST", "LIFTING"),
        "SEVERAL",
        True,
        [0.1, 2, 0, 0, 0, 0],
    ),
    # A disc fitted between two walls, turned by a torque: the walls may press with any force 0 <= N <= tau / (2 m R),
    # so that alpha may be anything from tau / J down to nothing.
    (
        (load(torque=0.2, weight=(0.0, 0.0)), FITTED),
        0.5,
        0.1 * EYE,
        ("REST", "PIVOTING_AND_SLIDING"),
        "FAMILY",
        True,
        [0, 0, 0, 0, 0, 2],
    ),
    # A thin bar gripped by three contacts on one line of action, dragged along.
    (
        (load((1.0, 0.0), weight=(0.0, 0.0)), GRIP),
        0.5,
        EYE,
        ("REST", "PIVOTING_AND_SLIDING_APART", "SLIDING"),
        "FAMILY",
        True,
        [1, 0, 0, 0, 0, 0],
    ),
    # Four normals through the centre: their four forces are not determined, and with them friction's torque.
    (
        (sphere(torque=[0.1, 0.2, 0.9])[0], ring(4)),
        0.3,
        BALL,
        ("PIVOTING_AND_SLIDING",) * 2,
        "FAMILY",
        False,
        None,
    ),
]


@pytest.mark.parametrize(
    ("case", "friction", "inertia", "modes", "uniqueness", "jams", "last"), DEGENERATE
)
def test_several_motions(case, friction, inertia, modes, uniqueness, jams, last):
    result, _ = motion(case, friction, inertia)
    assert tuple(solution.mode.name for solution in result.solutions) == modes
    assert (result.uniqueness.name, result.jams) == (uniqueness, jams)
    assert result.residual < 1e-9
    if last is not None:
        fastest = result.solutions[-1]
        rates = [*fastest.acceleration, *fastest.angular_acceleration]
        assert rates == pytest.approx(last, abs=1e-9)


@pytest.mark.parametrize("acting", [load(weight=(0.0, 0.0)), load((0.0, 1.0))])
def test_no_load_rests(acting):
    result, first = motion((acting, pocket(0.5)), 0.5, np.eye(3))
    assert (first.mode, result.uniqueness) == (Mode.REST, Uniqueness.ONLY)
    assert not first.contact_forces.any()


@pytest.mark.parametrize("seed", range(40))
def test_planar_motions_solve_the_problem_in_3d(seed):
    # The enumeration in 2-D and Newton's method in 3-D know nothing of each other.
    random = np.random.default_rng(seed)
    angles = np.radians(random.uniform(200.0, 340.0, random.integers(1, 5)))
    normals = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))])
    points = 0.5 * normals + 0.1 * random.normal(size=normals.shape) * [1.0, 1.0, 0.0]
    case = load(random.normal(size=2), 0.3 * random.normal()), Contacts(points, normals)
    flat, _ = motion(case, 0.4, 0.1 * np.eye(3))
    problem = replace(ContactProblem.of(*case, 0.4), normal_axis=None)
    inverse = inverses(np.ones(1), 0.1 * np.eye(3)[None], problem.reach)
    solid = ReleaseProblem.of(problem, inverse, np.ones(1))
    (count,), in_3d, _ = solid.motions(12)
    known = [[*one.acceleration, *one.angular_acceleration] for one in flat.solutions]
    units = solid.acceleration_unit[0] / np.array([1.0] * 3 + [problem.reach[0]] * 3)
    assert count or not flat.moves
    if flat.uniqueness is not Uniqueness.FAMILY:
        for candidate in in_3d[0, :count, :-1]:
            misses = np.abs(units * candidate - np.array(known)).max(axis=1)
            assert misses.min() < 1e-7


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
def test_bad_inertia_is_refused(mass, inertia, match):
    with pytest.raises(SceneError, match=match):
        incipient_motion(load(), pocket(0.5), 0.5, mass, inertia)


def test_a_motion_as_plain_data():
    stored = motion((load((1.0, 0.0)), pocket(0.5)), 0.5, np.eye(3))[0].to_dict()
    assert (stored["mode"], stored["uniqueness"], stored["moves"]) == ("PIVOTING", "ONLY", True)
    assert len(stored["solutions"]) == 1 and stored["forces_unique"]
    aside = motion(sphere(torque=[0.06, -0.08, 0.0]), 0.5)[0]  # in no coordinate plane
    assert aside.uniqueness is Uniqueness.NOT_EXCLUDED


# Impulses at contacts obey Signorini's and Coulomb's laws, whatever the contacts.


INVERSE = np.diag([1.0, 1.0, 1.0, 10.0, 10.0, 10.0])


def pressed_from_below(random: np.random.Generator, count: int) -> tuple[Floats, Floats]:
    """Rows (3k, 6) of contacts of about a sphere with normals upwards, and the normals (k, 3)."""
    normals = random.normal(size=(count, 3))
    normals[:, 2] = np.abs(normals[:, 2]) + 0.3
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    points = -0.5 * normals + 0.05 * random.normal(size=(count, 3))
    first, second = tangents(normals)
    ways = np.stack([normals, first, second], axis=1)
    return momenta(points, ways, np.zeros(3))[: 3 * count], normals


def missed(gain: Floats, free: Floats, friction: Floats, impulses: Floats) -> float:
    """By how much impulses (k, 3) miss the laws, written out, relative to the largest velocity."""
    velocities = (gain @ impulses.ravel() + free).reshape(-1, 3)
    slip, rubbed = (np.hypot(one[:, 1], one[:, 2]) for one in (velocities, impulses))
    limit = friction * impulses[:, 0]
    power = (velocities[:, 1:] * impulses[:, 1:]).sum(axis=1)
    laws = (
        -velocities[:, 0],
        -impulses[:, 0],
        np.abs(velocities[:, 0] * impulses[:, 0]),
        rubbed - limit,
        np.abs(power + slip * limit),
    )
    return max(float(law.max()) for law in laws) / float(np.abs(free).max())


def test_a_thousand_random_grains_obey_both_laws() -> None:
    """One to five contacts, redundant ones too, each with a friction of its own, none among them."""
    random = np.random.default_rng(3)
    for _ in range(1000):
        count = int(random.integers(1, 6))
        rows, _ = pressed_from_below(random, count)
        falling = np.array([*random.normal(size=2), -1.0, *random.normal(size=3)])
        friction = random.choice([0.0, 0.2, 0.7, 1.5], size=count)
        gain, free = rows @ INVERSE @ rows.T, rows @ falling
        assert missed(gain, free, friction, contact_impulses(gain, free, friction)) < 1e-8


def test_painleves_rod_has_impulses_where_it_has_no_forces() -> None:
    """A rod that slides along on its lower end, which is ahead of it, jams; over a step it has an impulse.

    At 60 degrees and friction 2 a pressure on the end accelerates it into the ground (Painleve 1895).
    """
    angle, friction = np.radians(60.0), np.array([2.0])
    arm = 0.5 * np.array([[-np.cos(angle), -np.sin(angle), 0.0]])
    ways = np.array([[[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]])
    rows = momenta(arm, ways, np.zeros(3))[:3]
    gain = rows @ np.diag([1.0, 1.0, 1.0, 12.0, 12.0, 12.0]) @ rows.T
    assert min(gain[0, 0] + way * friction[0] * gain[0, 1] for way in (-1.0, 1.0)) < 0.0
    for way in (-1.0, 1.0):
        free = rows @ np.array([way, -0.01, 0.0, 0.0, 0.0, 0.0])
        impulses = contact_impulses(gain, free, friction)
        assert impulses[0, 0] > 0.0
        assert missed(gain, free, friction, impulses) < 1e-8


@pytest.mark.parametrize("density", [0.0, 1e-9, 1e6])
def test_bodies_without_mass_and_with_any_take_the_same_steps(density: float) -> None:
    """With added mass a body without mass rests on its bed as any other: no step is shortened."""
    grain = Disc(1.0)
    body = RigidBody(Inertia.about(density * grain.volume, density * grain.inertia, grain.gdim))
    moves = ContactMotion(body, proximity(grain, Flat()).gaps, ContactLaw(0.5), grain.size)
    state, load = BodyState.at(Placement((0.0, 0.5))), np.array([0.2, -1.0, 0.0])
    added = np.diag([1.0, 1.0, 0.1])
    taken = moves.step(state, 0.1, load, added)
    assert taken.end.place[1] == pytest.approx(0.5, abs=1e-8)
    assert abs(taken.end.velocity[1]) < 1e-9
    assert taken.contacts.forces(0.1)[0, 1] == pytest.approx(1.0, rel=1e-6)


# Rests followed as the load of the flow grows: closed forms of a disc, the fold of an ellipse's moment, continuity.
#
# A grain that rolls on a bed without slipping is in equilibrium where the moment of its load about the contact
# vanishes, and leaves its trough where no more load has a place at which it does.


HEIGHT, LENGTH = 0.05, 2.0  # of the sinusoidal bed, which is lowest at 1.5
WAVE = 2.0 * math.pi / LENGTH
STEEPEST = math.atan(HEIGHT * WAVE)
INERT = (1.0, np.eye(3))
RADIUS = 0.2


def followed(
    grain: Grain,
    force: tuple[float, float],
    couple: float,
    friction: float,
    bed: Bed | None = None,
    cohesion: float = 0.0,
) -> Rocking:
    """The rests of a grain of weight one from the bottom of the trough."""
    bed = bed or Sinusoidal(HEIGHT, LENGTH)
    law = FrictionCone.of(friction, cohesion)
    start = settle(grain, bed, Placement((1.5, 1.0)), friction=friction)
    load = Load([*force, 0.0], [0.0, 0.0, couple], [0.0, -1.0, 0.0], [*start.placement.centre, 0.0])
    return follow(grain, bed, start.placement, load, law, INERT, resolved=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("couple", [-0.02, pytest.param(0.0, marks=pytest.mark.slow)])
def test_a_disc_rests_where_the_bed_has_the_slope_of_its_load(couple: float) -> None:
    """Slope phi with R |L| sin(psi - phi) = couple, psi the load's angle; it leaves beyond the steepest slope."""
    force = (0.3, 0.05)
    result = followed(Disc(2.0 * RADIUS), force, couple, 0.8)

    def slope(factor: float) -> float:
        x, y = factor * force[0], 1.0 - factor * force[1]
        return math.atan2(x, y) - math.asin(factor * couple / (RADIUS * math.hypot(x, y)))

    for rest in result.rests:
        into_bed = rest.contacts.normals[0]
        assert math.atan2(into_bed[0], -into_bed[1]) == pytest.approx(slope(rest.low), abs=1e-9)
    critical = brentq(lambda factor: slope(factor) - STEEPEST, 0.0, 3.0)
    assert result.critical == pytest.approx(critical, rel=5e-3)
    assert result.critical < critical * (1.0 + 1e-9)
    assert result.mode == "rolling"
    assert result.leaves


@pytest.mark.slow  # where it slips it settles nowhere, slowly
@pytest.mark.parametrize(("cohesion", "critical"), [(0.0, 0.0998753), (0.5, 0.1497195)])
def test_a_disc_spins_where_friction_no_longer_holds_its_couple(
    cohesion: float, critical: float
) -> None:
    """T = couple/R of the contact force, which balances the load, reaches mu (N + c).

    With a factor s that is s/2 = 0.05 (sqrt(1 + (0.01 s)^2 - (s/2)^2) + c).
    """
    result = followed(Disc(2.0 * RADIUS), (0.01, 0.0), -0.1, 0.05, cohesion=cohesion)
    assert result.critical == pytest.approx(critical, rel=5e-3)
    assert math.degrees(result.turned(result.last)) > 20.0


def moments(grain: Ellipse, axes: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Centres (n, 2) and contacts (n, 2) of an ellipse that rolls up the trough, by arcs of equal length.

    Independent of the package: the ellipse is (a cos t, b sin t) of semi-axes (a, b), the bed y = h sin(k x), and both
    arcs grow at one rate from the bottom, where the ellipse stands on its short axis.
    """
    a, b = axes

    def rates(_: float, state: np.ndarray) -> list[float]:
        x, t = state
        along_bed = math.hypot(1.0, HEIGHT * WAVE * math.cos(WAVE * x))
        return [1.0 / along_bed, 1.0 / math.hypot(a * math.sin(t), b * math.cos(t))]

    result = solve_ivp(
        rates, (0.0, 0.45), [1.5, -0.5 * math.pi], rtol=1e-11, atol=1e-12, dense_output=True
    )
    x, t = result.sol(np.linspace(1e-4, 0.45, 4000))
    contacts = np.column_stack([x, HEIGHT * np.sin(WAVE * x)])
    turn = np.arctan(HEIGHT * WAVE * np.cos(WAVE * x)) - np.arctan2(b * np.cos(t), -a * np.sin(t))
    body = np.column_stack([a * np.cos(t), b * np.sin(t)])
    c, s = np.cos(turn), np.sin(turn)
    arms = np.column_stack([c * body[:, 0] - s * body[:, 1], s * body[:, 0] + c * body[:, 1]])
    return contacts - arms, contacts


@pytest.mark.slow
@pytest.mark.parametrize("couple", [0.0, pytest.param(-0.02, marks=pytest.mark.slow)])
def test_an_ellipse_leaves_at_the_fold_of_its_potential(couple: float) -> None:
    axes, force = (0.5, 0.3), (0.3, 0.05)
    grain = Ellipse(axes)
    centres, contacts = moments(grain, axes)
    arm = centres - contacts
    of_weight = -arm[:, 0]
    of_flow = arm[:, 0] * force[1] - arm[:, 1] * force[0] + couple
    factors = -of_weight / of_flow  # at which each place is one of equilibrium
    fold = int(np.argmax(factors))
    assert 0 < fold < len(factors) - 1
    result = followed(grain, force, couple, 0.9)
    assert result.critical == pytest.approx(factors[fold], rel=5e-3)
    assert result.critical < factors[fold] * (1.0 + 1e-6)
    assert not result.leaves
    at = result.last
    assert at.low == pytest.approx(1.0, rel=1e-12)
    # It rolls in finite steps, whose slip is of their second order.
    place = np.interp(1.0, factors[:fold], centres[:fold, 0])
    assert at.placement.centre[0] == pytest.approx(place, abs=1e-4)
    assert result.turned(at) > 0.05
    assert result.drift(at) > result.turned(at)


def test_an_ellipse_on_a_plane_leaves_at_its_steepest_equilibrium() -> None:
    """F = W (a^2 - b^2)/(2 a b), where tan of its angle is b/a: 5/12 W of semi-axes 0.6 and 0.4.

    With 0.2515 W the factor of the actual load was rounded below one and tried again until the end: it "left" there.
    """
    result = followed(Ellipse((0.6, 0.4)), (0.2515, 0.0), 0.0, 0.9, Flat(0.0))
    assert result.critical == pytest.approx(5.0 / 12.0 / 0.2515, rel=5e-3)
    assert result.last.low == 1.0
    assert not result.leaves
    assert result.drift(result.last) > result.turned(result.last) > 0.05


def test_on_a_plane_any_load_rolls_a_disc_away() -> None:
    assert followed(Disc(1.0), (0.3, 0.0), 0.0, 0.8, Flat(0.0)).critical == 0.0


def test_a_disc_on_a_plane_is_not_followed(monkeypatch: pytest.MonkeyPatch) -> None:
    """As it has no other rest; to find that out would take longer than the flow."""
    scene, wanted = (
        grain_on_bed(),
        Load([0.3, 0.0, 0.0], np.zeros(3), [0.0, -1.0, 0.0], np.zeros(3)),
    )
    monkeypatch.setattr("incipient.contact.rocking.follow", None)
    assert followed_in(scene, wanted) is None


@pytest.mark.parametrize("cohesion", [0.0, 0.5])
def test_what_contacts_hold_is_held_up_to_the_safety_factor(cohesion: float) -> None:
    """A box tips over its edge where the moment of weight and cohesion, (1 + c) b/2, is that of the force, h/2 s F."""
    result = followed(Rectangle(0.8, 0.4), (2.5, 0.0), 0.0, 5.0, Flat(0.0), cohesion)
    assert result.critical == pytest.approx(0.8 * (1.0 + cohesion), rel=1e-6)
    assert len(result.rests) == 1
    assert result.mode == "pivoting"


def test_no_rest_no_path() -> None:
    grain, bed = Ellipse((0.5, 0.3)), Flat(0.0)
    load = Load([0.1, 0.0, 0.0], np.zeros(3), [0.0, -1.0, 0.0], np.zeros(3))
    assert follow(grain, bed, Placement((0.0, 0.25), math.pi / 2.2), load, 0.5) is None


PEBBLE = """
[domain]
length = 10.0
height = 5.0
width = 10.0
[fluid]
reynolds = 1.0
scale = "grain"
[flow]
kind = "shear"
[body]
shape = "ellipsoid"
semi_axes = [0.58, 0.52, 0.34]
density = 2.65
x = 5.0
settle = true
[bed]
kind = "spheres"
radius = 0.5
spacing = 1.05
arrangement = "random"
seed = 2
[gravity]
acceleration = 10.0
[contact]
friction = 0.6
"""


def pebble(slope: float) -> tuple[Scene, Load]:
    """An ellipsoid on random spheres, and a load that turns with the slope of the bed as its weight does."""
    scene = loads(PEBBLE, overrides=[f"bed.slope={slope}"])
    down = scene.gravity_direction
    load = Load([0.05, 0.0, 0.01], [0.0, 0.012, 0.0], down, np.asarray(scene.placement.centre))
    return scene, load


def test_a_pebble_that_rocks_is_held_as_well_as_one_that_has_rocked() -> None:
    """It lies on two of the bed's spheres while the bed is level, on a third one, too, where it slopes by a degree."""
    scene, load = pebble(1.0)
    on_three = safety_factor(load, Setup(scene).contacts, 0.6)
    assert (len(Setup(scene).contacts), on_three.status) == (3, SafetyStatus.CRITICAL)
    factors = []
    for slope in (0.0, 0.3):
        scene, load = pebble(slope)
        assert safety_factor(load, Setup(scene).contacts, 0.6).status is SafetyStatus.NO_RESERVE
        result = followed_in(scene, load)
        assert [len(rest.contacts) for rest in result.rests] == [2, 3]
        factors.append(result.critical)
    # With cohesion it rocks to the same three contacts, which hold more.
    cohesive = followed_in(
        loads(PEBBLE, overrides=["bed.slope=0.3", "contact.cohesion=0.05"]), load
    )
    assert cohesive is not None and [len(rest.contacts) for rest in cohesive.rests] == [2, 3]
    assert cohesive.critical > factors[1]
    # Downhill the weight's pull grows in proportion to the slope, and the factor falls nearly in a line.
    assert factors[0] > factors[1] > on_three.value
    assert factors[0] - factors[1] == pytest.approx(0.3 * (factors[0] - on_three.value), rel=0.1)
    assert factors[0] == pytest.approx(on_three.value, rel=0.02)


def test_what_only_rocks_is_not_said_to_begin_to_move() -> None:
    scene, load = pebble(0.0)
    inert = mass_and_inertia(scene.body, scene.placement)
    said = judge(load, Setup(scene).contacts, 0.6, inert).to_dict()
    assert may_rock(said)
    rocking = followed_in(scene, load)
    told = with_rocking(said, rocking)
    assert (told["moves"], told["mode"], told["safety_status"]) == (False, ROCKS, "ROCKS")
    assert told["safety_factor"] == rocking.critical
    first = told["sentence"].partition(";")[0]
    assert first.startswith("the grain rocks to another rest, turned by ")
    assert "begins to move" not in first
    assert "body.orientation = [" in told["note"]
    assert told["judges"] == said["judges"]
    box = SafetyBar(0.0, 0.0, 0.0, True, False, "gap", None, None)
    bar = bar_with_rocking(box, rocking.critical, 0.05, rocking.drift(rocking.last))
    assert not bar.certain
    assert bar.low < rocking.critical < bar.high
    assert bar.sentence.startswith("likely, but not proved: safety factor")
    assert not may_rock(judge(load, Setup(pebble(1.0)[0]).contacts, 0.6, inert).to_dict())
    assert OTHER_CONTACTS in told["note"]
    # Contacts that hold it up to a part of the load open: it moves, as its threshold says.
    scene, load = pebble(1.0)
    strong = replace(load, flow_force=20.0 * load.flow_force, flow_couple=20.0 * load.flow_couple)
    moved = judge(strong, Setup(scene).contacts, 0.6, inert).to_dict()
    assert (moved["moves"], moved["safety_status"], may_rock(moved)) == (True, "CRITICAL", False)


def test_a_pose_is_told_without_round_off() -> None:
    """A turn by 0.05 about y is one of 9/pi degrees."""
    pose = Placement((1.0, 2.0, 3.0)).moved(np.zeros(3), np.array([1e-17, 0.05, -1e-17]))
    assert standing(pose) == "body.x = 1, body.y = 2 and body.orientation = [0, 2.86479, 0]"


def test_what_leaves_its_pocket_begins_to_move() -> None:
    scene, load = pebble(0.0)
    strong = Load(20.0 * load.flow_force, 20.0 * load.flow_couple, load.weight, load.centre)
    rocking = followed_in(scene, strong)
    assert rocking.leaves
    assert rocking.sentence.startswith(
        "the grain begins to move (pivoting), having rocked, turned by "
    )
    weak = followed_in(scene, load)
    assert 20.0 * rocking.critical == pytest.approx(weak.critical, rel=1e-4)


POSE = "; this time and the history are judged in the first pose"


@pytest.mark.parametrize(
    ("first_motion", "rocking", "said"),
    [
        (None, None, None),
        (0.1, None, "the grain moves from t = 0.1 on, but was held"),
        (0.1, {"leaves": False}, f"the grain rocks from t = 0.1 on, but was held{POSE}"),
        (0.1, {"leaves": True}, f"the grain moves from t = 0.1 on, but was held{POSE}"),
    ],
)
def test_times_and_histories_of_a_grain_that_rocks_are_those_of_its_first_pose(
    first_motion: float | None, rocking: dict[str, bool] | None, said: str | None
) -> None:
    """What is said of a grain held in time that would move: whether it leaves its pocket, and how that was judged."""
    verdict = {"first_motion": first_motion, "rocking": rocking}
    held = Decision("free body", False, "")
    omitted = without_motion(None, SimpleNamespace(verdict=verdict), held)  # type: ignore[arg-type]
    assert (omitted and omitted.how) == said


@pytest.mark.parametrize(
    ("verdict", "said"),
    [
        ({}, ""),
        ({"first_motion": None}, "at the end of the run: the flow would have moved it at no step."),
        ({"moves": True, "first_motion": 0.1}, "at the end of the run: the flow would have moved"),
        (
            {"first_motion": 0.1},
            "at the end of the run: the flow would have moved it from t = 0.1 on.",
        ),
        (
            {"safety_status": "UNHELD"},
            "With body.settle = true it first rolls and tips to a position of rest",
        ),
        ({"safety_status": "UNHELD", "note": "it has landed"}, "It has landed."),
    ],
)
def test_pages_have_the_remarks_on_a_verdict(verdict: dict[str, object], said: str) -> None:
    stored = {"moves": False, "safety_status": "CRITICAL"} | verdict
    run = {"verdict": stored, "scene": {"body": {"settle": False}}}
    _, *more = _statements(run, SimpleNamespace(sentences=["It moves."]))
    assert len(more) == bool(said) and said in "".join(more)
