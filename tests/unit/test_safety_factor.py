"""The safety factor, its error bar, and many cases at once."""

from __future__ import annotations

import json
import math
import signal
import subprocess
import sys
from contextlib import suppress
from dataclasses import replace
from math import erf, sqrt
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from random_contacts import Case, safety_misses
from scenes import message, on_bed

from incipient.accuracy.errorbars import with_safety
from incipient.accuracy.goal import bar_of_safety
from incipient.contact import Cases, Contacts, Load, conic, judge_many, kernels
from incipient.contact.conic import interval_rows
from incipient.contact.friction import FrictionCone
from incipient.contact.kernels import Kernel
from incipient.contact.robustness import (
    Probability,
    StandardErrors,
    held_words,
    influences,
    probabilities,
    safety_range,
)
from incipient.contact.safety import ConeState, safety_factor
from incipient.contact.verdict import judged
from incipient.errors import ConvergenceError
from incipient.files import plain
from incipient.results.errorbars import ErrorBars, SafetyBar, Term
from incipient.setup.setup import Setup

# The safety factor against exact statics. Each test states its formula; weights are one unless said.
#
# In 2-D: x downstream, y up. In 3-D: x downstream, z up. Normals point out of the grain.


DOWN, DOWN_3D = [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]
ON_PLANE = Contacts([[0.0, 0.0, -0.5]], [DOWN_3D])


def load(force=(0.0, 0.0), torque=0.0, weight=(0.0, -1.0), centre=(0.0, 0.0)):
    """A load in 2-D."""
    return Load([*force, 0.0], [0.0, 0.0, torque], [*weight, 0.0], [*centre, 0.0])


def block(slope, half_base=1.0, height=0.5, force=(1.0, 0.0)):
    """Load and contacts of a block on an incline, coordinates along it, downhill +x."""
    contacts = Contacts([[-half_base, 0, 0], [half_base, 0, 0]], [DOWN, DOWN])
    return load(force, weight=(math.sin(slope), -math.cos(slope)), centre=(0.0, height)), contacts


def box(slope, force, height=0.5):
    """The same in 3-D on the four corners of its base."""
    corners = [[x, y, 0.0] for x in (-1.0, 1.0) for y in (-1.0, 1.0)]
    weight = [math.sin(slope), 0.0, -math.cos(slope)]
    return Load(force, [0, 0, 0], weight, [0.0, 0.0, height]), Contacts(corners, [DOWN_3D] * 4)


def pocket(angle, radius=0.5):
    """Contacts of a disc about the origin, normals at an angle to either side of down."""
    normals = np.array([[s * np.sin(angle), -np.cos(angle), 0.0] for s in (-1.0, 1.0)])
    return Contacts(radius * normals, normals)


def ring(count, lean=0.6, turn=0.0):
    """Contacts of a sphere of radius one half, `count` in a ring, their normals with that horizontal part."""
    around = np.radians(turn) + 2.0 * np.pi * np.arange(count) / count
    normals = np.column_stack(
        [lean * np.cos(around), lean * np.sin(around), np.full(count, -math.sqrt(1 - lean**2))]
    )
    return Contacts(0.5 * normals, normals)


def ends(half_base=1.0, depth=0.1):
    """Contacts of a block by the ends of its base, its centre of mass at the origin."""
    points = [[side * half_base, -depth, 0.0] for side in (-1.0, 1.0)]
    return Contacts(points, [DOWN, DOWN], [half_base] * 2)


def wedge(half_angle):
    """A wedge in a slot: a contact on each side, at an angle to the vertical, the load between."""
    normals = [[s * math.cos(half_angle), -math.sin(half_angle), 0.0] for s in (-1.0, 1.0)]
    return Contacts([[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]], normals)


def in_3d(force=(0, 0, 0), torque=(0, 0, 0), contacts=ON_PLANE):
    return Load(force, torque, DOWN_3D, [0, 0, 0]), contacts


def ladder(place):
    """At 60 degrees to the floor; a person's weight at `place` along it is the flow's load."""
    foot, top = np.zeros(3), np.array([0.5, math.sqrt(0.75), 0.0])
    torque = np.cross((place - 0.5) * (top - foot), [0.0, -1.0, 0.0])
    acting = Load([0.0, -1.0, 0.0], torque, DOWN, 0.5 * top)
    return acting, Contacts([foot, top], [DOWN, [1.0, 0.0, 0.0]])


INF, (NONE, INSIDE, EDGE) = math.inf, ConeState
STEEP, UP60 = math.radians(40.0), math.radians(60.0)
# Both contacts of a pocket slip: with normal forces N1, N2 and friction m N along the surface
# sin (N1 - N2) + m cos (N1 + N2) = 0, cos (N1 + N2) + m sin (N1 - N2) = W, torque = m R (N1 + N2).
SLIPS = 0.2 * 0.5 / (math.cos(0.6) * (1.0 + 0.2**2))
CLIMBED = 0.3 * (math.sqrt(3.0) + 0.3) / (1.0 + 0.3**2)
# A pocket of three equal spheres: sine of the contacts' angle to the vertical; arm of the gap between two of them.
ARM, GAP = 0.25 / math.sqrt(3.0), np.array([0.5, math.sqrt(0.75), 0.0])
ABOVE = Contacts([[0.0, 0.5, 0.0]], [[0.0, 1.0, 0.0]])

# Load and contacts, friction, status, smallest and largest balanced factor, states of the contacts, and accuracy.
FACTORS = [
    # A block slides if s F + sin > friction cos, topples if (s F + sin) height > half base cos.
    *(
        (
            case,
            friction,
            "CRITICAL",
            (0.0, min(friction, 1.0 / height) * math.cos(slope) - math.sin(slope)),
            tuple(state for state in states for _ in case[1].points[::2]),
            near,
        )
        for slope in np.radians([0.0, 5.0, 15.0])
        for friction, height, states in (
            (0.3, 0.5, (EDGE, EDGE)),
            (0.4, 2.0, (EDGE, EDGE)),
            (5.0, 2.0, (NONE, INSIDE)),
        )
        for case, near in (
            (block(slope, height=height), 1e-12),
            (box(slope, [1.0, 0.0, 0.0], height), 1e-9),
        )
    ),
    # The circle of friction: sin^2 + (s F)^2 = (friction cos)^2, here with F = 2 along the contour.
    (
        box(0.2, [0.0, 2.0, 0.0], height=0.1),
        0.5,
        "CRITICAL",
        (0.0, 0.5 * math.sqrt((0.5 * math.cos(0.2)) ** 2 - math.sin(0.2) ** 2)),
        None,
        1e-9,
    ),
    # Steeper than friction, held by a flow uphill between sin - friction cos and sin + friction cos.
    (
        block(STEEP, height=0.1, force=(-1.0, 0.0)),
        0.3,
        "HELD_BY_FLOW",
        tuple(math.sin(STEEP) + sign * 0.3 * math.cos(STEEP) for sign in (-1.0, 1.0)),
        None,
        1e-12,
    ),
    # Disc in a pocket: s F = W tan(theta); at that load the contact upstream carries nothing.
    *(
        (
            (load((2.0, 0.0)), pocket(angle)),
            friction,
            "CRITICAL",
            (0.0, 0.5 * math.tan(angle)),
            (NONE, INSIDE if friction else EDGE),
            1e-12,
        )
        for angle in np.radians([10.0, 30.0, 60.0])
        for friction in (0.0, 0.5)
    ),
    # The line between the contacts is in both cones if friction >= cot(theta): then they hold anything.
    *(
        ((load((1.0, 0.0)), pocket(UP60)), part / math.tan(UP60), status, (0.0, high), None, 1e-12)
        for part, status, high in (
            (0.999, "CRITICAL", math.tan(UP60)),
            (1.001, "UNLIMITED", INF),
        )
    ),
    ((load(torque=-0.1), pocket(0.6)), 0.0, "NO_RESERVE", (0.0, 0.0), None, 1e-12),
    ((load(torque=-1.0), pocket(0.6)), 0.2, "CRITICAL", (0.0, SLIPS), (EDGE, EDGE), 1e-12),
    # Through a gap of a pocket of three, about the line of its two contacts: the torque R tau helps to turn over,
    # s (F R cos + L R sin cos(pi/3) + tau) = W R sin cos(pi/3).
    (
        in_3d(
            0.5 * GAP + [0.0, 0.0, 0.2],
            0.1 * np.array([-GAP[1], GAP[0], 0.0]),
            ring(3, 1.0 / math.sqrt(3.0)),
        ),
        0.8,
        "CRITICAL",
        (0.0, ARM / (0.25 * math.sqrt(2.0 / 3.0) + 0.2 * ARM + 0.1)),
        None,
        1e-9,
    ),
    # A ladder, friction on floor and wall at their limits: P = W (k - 1/2) / (place - k), k = m (tan + m) / (1 + m^2).
    *(
        (
            ladder(place),
            0.3,
            "CRITICAL",
            (0.0, (CLIMBED - 0.5) / (place - CLIMBED)),
            (EDGE, EDGE),
            1e-12,
        )
        for place in (0.7, 1.0)
    ),
    (ladder(0.99 * CLIMBED), 0.3, "UNLIMITED", (0.0, INF), None, 1e-12),
    # Nothing holds what turns a sphere about its contact.
    *(
        (in_3d(force, torque), 0.7, "NO_RESERVE", (0.0, 0.0), (INSIDE,), 1e-12)
        for force, torque in (
            ([0, 0, 0], [0, 0.1, 0]),
            ([0.1, 0, 0], [0, 0, 0]),
            ([0, 0, 0], [0, 0, 0.1]),
            ([0.1, 0.2, 0], [0, 0.1, 0.1]),
        )
    ),
    # F at the centre and the torque -F R: the contact answers -F up to s F = friction (W - s lift).
    (in_3d([0.3, 0.4, 0.0], [0.2, -0.15, 0.0]), 0.7, "CRITICAL", (0.0, 1.4), (EDGE,), 1e-10),
    (in_3d([0.3, 0.0, 0.2], [0.0, -0.15, 0.0]), 0.5, "CRITICAL", (0.0, 1.25), (EDGE,), 1e-10),
    # s L = W: no contact carries anything there.
    (box(0.0, [0.0, 0.0, 4.0]), 0.5, "CRITICAL", (0.0, 0.25), (NONE,) * 4, 1e-10),
    ((load(weight=(0.0, 0.0)), pocket(0.5)), 0.5, "NO_FLOW", (0.0, INF), (NONE, NONE), 1e-12),
    # Without weight there is no size to compare with: any or none.
    *(
        ((load(force, weight=(0.0, 0.0)), pocket(0.5)), 0.1, status, (0.0, high), None, 1e-12)
        for force, status, high in (
            ((0.2, -1.0), "UNLIMITED", INF),
            ((1.0, -0.2), "NO_RESERVE", 0.0),
            ((0.0, 1.0), "NO_RESERVE", 0.0),
        )
    ),
    # A contact above: the flow presses to it, the weight pulls sideways past all friction, or is held by the flow.
    ((load((0.0, 1.0), weight=(1.0, 0.0)), ABOVE), 0.0, "UNHELD", None, (NONE,), 1e-12),
    ((load((0.0, 1.0)), ABOVE), 0.5, "HELD_BY_FLOW", (1.0, INF), None, 1e-13),
    # Drag D, downward force P: s D = friction (W + s P) never binds if D <= friction P.
    (box(0.0, [0.29, 0.0, -1.0], height=0.01), 0.3, "UNLIMITED", (0.0, INF), None, 1e-7),
    (box(0.0, [0.31, 0.0, -1.0], height=0.01), 0.3, "CRITICAL", (0.0, 30.0), None, 1e-7),
    # Tiny friction, and a weight tiny beside the flow: s F = friction W.
    (box(0.0, [1.0, 0.0, 0.0]), 1e-6, "CRITICAL", (0.0, 1e-6), None, 1e-6),
    (block(0.0, force=(1e9, 0.0)), 0.5, "CRITICAL", (0.0, 0.5e-9), None, 1e-6),
]


@pytest.mark.parametrize(("case", "friction", "status", "interval", "states", "near"), FACTORS)
def test_factors(case, friction, status, interval, states, near):
    result = safety_factor(*case, friction)
    assert result.status.name == status
    assert result.interval == (interval and pytest.approx(interval, rel=near, abs=1e-12))
    held = status not in ("HELD_BY_FLOW", "UNHELD")
    assert result.value == (result.interval[1] if held else 0.0)
    if states is not None:
        assert result.contact_states == states
    if interval is not None:
        assert safety_misses(Case(*case, friction, 1.0, np.eye(3)), result) < 1e-10
        assert result.held is (interval[0] <= 1.0 <= interval[1])


@pytest.mark.parametrize("friction", [1e3, 1e7, 3e8, math.inf])
def test_huge_friction_leaves_toppling(friction):
    """s F height = W half base."""
    for case, near in ((box(0.0, [1.0, 0.0, 0.0], 2.0), 1e-6), (block(0.0, height=2.0), 1e-8)):
        assert safety_factor(*case, friction).value == pytest.approx(0.5, rel=near)


def test_a_safety_factor_as_plain_data():
    stored = plain(safety_factor(load((0.0, -1.0)), pocket(0.5), 0.5))
    assert (stored["value"], stored["status"], stored["interval"]) == (
        None,
        "UNLIMITED",
        [0.0, None],
    )
    assert json.loads(json.dumps(stored, allow_nan=False)) == stored


FRESH = """
import sys
import numpy as np
from incipient.contact import Contacts, Load, judge
corners = [[x, y, 0] for x in (-1, 1) for y in (-1, 1)]
for push in (0.1, 0.7):
    load = Load([push, 0.1, 0], [0, 0, 0], [0, 0, -1], [0, 0, 1])
    print(judge(load, Contacts(corners, [[0, 0, -1]] * 4), 0.5, (1.0, np.eye(3))).moves)
print(*(name in sys.modules for name in ("numba", "clarabel", "dolfinx")))
"""


def test_a_single_verdict_needs_no_compiler():
    done = subprocess.run([sys.executable, "-c", FRESH], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True", "False", "False", "False"]


def test_compiled_and_interpreted_agree():
    """Factors to a tenth of what docs/explanation/criteria.md promises, forces to the root of that.

    They were 1e-11 apart: round-off of the interior-point method's last steps.
    """
    random = np.random.default_rng(5)
    one = random.normal(size=(3, 6, 12)), *random.normal(size=(2, 3, 6)), 0
    kernel = Kernel(interval_rows)
    slow = kernel(*one)
    kernel.left = 0
    fast = kernel(*one)
    assert kernel.compiled is not None
    for before, after, close in zip(slow, fast, (1e-10, 1e-10, 0.0, 1e-7), strict=True):
        assert after == pytest.approx(before, nan_ok=True, abs=close)


def test_an_interrupt_while_a_kernel_is_compiled_is_not_lost(monkeypatch):
    """The compiler's callbacks dropped it, printed a traceback, and the batch went on."""

    def compiled(matrices):
        with suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        return matrices

    monkeypatch.setattr(kernels, "_compiled", lambda function: compiled)
    kernel = Kernel(interval_rows, interpreted=0)
    with pytest.raises(KeyboardInterrupt):
        kernel(np.zeros((1, 3, 3)))


# What errors of the loads mean for safety factor and verdict.


ZERO = np.zeros(3)


def test_not_certain_and_what_decides() -> None:
    """A disc in a pocket without friction is tipped over by a horizontal force equal to its weight."""
    errors = {"discretisation": 0.005, "gap": 0.03, "domain": 0.01}
    of_loads = {name: error * ALONG_X for name, error in errors.items()}
    computed = bar_of_safety(load((0.98, 0.0)), pocket(math.pi / 4), 0.0, of_loads)
    assert not computed.certain
    assert computed.low < 1.0 < computed.high
    assert computed.decisive == "gap"
    assert "reduce the error of the gap" in computed.sentence


def held_disc(torque: float, error: float, friction: float = 0.1) -> SafetyBar:
    """A disc of weight one between two contacts 30 degrees to either side of its lowest point, turned by a torque."""
    errors = {"gap": error * np.eye(6)[5]}
    return bar_of_safety(load(torque=torque), pocket(math.pi / 6), friction, errors)


def test_no_certainty_from_corners_that_move() -> None:
    """At every corner it moves; without a torque, which is within the bars, it rests at any factor."""
    computed = held_disc(0.1, 0.25)
    assert not computed.certain
    assert computed.low == pytest.approx(0.1633, abs=1e-4)
    assert computed.high == np.inf
    assert computed.relative == np.inf
    assert "NOT certain" in computed.sentence


@pytest.mark.parametrize(
    ("torque", "error", "friction", "outcome"),
    [
        (0.1, 0.02, 0.1, "it moves"),
        (0.02, 0.01, 0.1, "it rests"),
        (0.6, 0.3, 0.7, "it moves"),
    ],
)
def test_what_is_certain_is_said(
    torque: float, error: float, friction: float, outcome: str
) -> None:
    computed = held_disc(torque, error, friction)
    assert computed.certain and computed.rests == (outcome == "it rests")
    assert f"certain within the error bars: {outcome}; safety factor" in computed.sentence


def test_an_infinite_safety_factor_is_no_number() -> None:
    """A disc without a load of the flow."""
    said = held_disc(0.0, 0.0).sentence
    assert said == "certain within the error bars: it rests; safety factor infinite"


def term(doubt: str = "") -> Term:
    return Term("discretisation", 1e-4 * np.eye(6)[0], "how", doubt=doubt)


@pytest.mark.parametrize("doubt", ["", "for a reason"])
def test_nothing_is_certain_in_doubt(doubt: str) -> None:
    scene = on_bed("contact.friction=5", "body.density=9")
    run: Any = SimpleNamespace(
        scene=scene, contacts=Setup(scene).contacts, wall_report=lambda: None
    )
    load = np.array([0.01, 0.0, 0.0, 0.0, 0.0, 1e-4])
    bars = with_safety(ErrorBars((term(doubt),)), run, load)
    sure = with_safety(ErrorBars((term(),)), run, load).safety
    assert sure is not None and sure.certain
    assert bars.safety.certain == (not doubt)
    assert bars.safety.decisive == "discretisation"
    assert any("more than twice as large: for a reason" in line for line in bars.lines()) == bool(
        doubt
    )


# Many cases at once, loads known within a box, and cases drawn at random: against formulas and single verdicts.


ALONG_X = np.eye(6)[0]
ROUND_OFF = 1e-7
DISC = Contacts([[0.0, -0.5, 0.0]], [[0.0, -1.0, 0.0]])
BLOCK = ends()
INERT = (1.0, np.eye(3))


def random_cases(count: int, contacts: int, gdim: int, flat: bool = False) -> Cases:
    """Contacts anywhere below the centre with normals up to 0.4 off, or on a flat bed: wedged and lifting ones too."""
    rng = np.random.default_rng([contacts, gdim == 3, flat])
    points = rng.standard_normal((count, contacts, 3)) - [0.0, 0.0, 1.5]
    if gdim == 2:
        angles = rng.uniform(-np.pi, 0.0, (count, contacts))
        points = np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=2)
    points /= np.linalg.norm(points, axis=2, keepdims=True)
    normals = points + rng.uniform(-0.4, 0.4, points.shape) * [1.0, 1.0, float(gdim == 3)]
    down = np.eye(3)[gdim - 1]
    if flat:
        points[..., gdim - 1] = -1.0
        normals = -np.broadcast_to(down, points.shape)
    force, torque = rng.standard_normal((2, count, 3))
    if gdim == 2:
        force, torque = force * [1.0, 1.0, 0.0], torque * [0.0, 0.0, 1.0]
    normals = normals / np.linalg.norm(normals, axis=2, keepdims=True)
    return Cases(
        points,
        normals,
        force,
        0.3 * torque,
        np.array([0.1, 0.0, 0.0]) - down,
        np.zeros(3),
        FrictionCone(rng.uniform(0.2, 0.8, count)),
        1.0,
        np.diag([0.3, 0.4, 0.5]),
    )


@pytest.mark.parametrize("flat", [False, True])
@pytest.mark.parametrize(
    ("contacts", "gdim"), [(1, 2), (2, 2), (3, 2), (4, 2), (1, 3), (2, 3), (4, 3)]
)
def test_a_batch_is_judged_as_one_by_one(contacts: int, gdim: int, flat: bool) -> None:
    """In 2-D to 1e-12; in 3-D to 1e-9, which is what the cone solver leaves.

    A tenth of them without inertia, a quarter with one contact only, half of them cohesive.
    """
    cases, rng = random_cases(120, contacts, gdim, flat), np.random.default_rng(5)
    row = np.arange(120)
    known = row % 10 > 0
    missing = (row[:, None, None] % 4 == 1) & (np.arange(contacts)[:, None] > 0)
    surface = (np.where(missing, np.nan, one) for one in (cases.points, cases.normals))
    law = FrictionCone(cases.law.coefficient, 0.3 * (row // 2 % 2))
    inertia = np.where(known[:, None, None], cases.inertia, np.nan)
    weight = cases.weight * rng.uniform(0.5, 2.0, (120, 1))
    mass = np.where(known, 1.0, np.nan)
    cases = Cases(*surface, cases.force, cases.torque, weight, cases.centre, law, mass, inertia)
    batch = judge_many(cases)
    exact = [judged(*cases.case(number)) for number in range(len(cases))]
    assert batch.mode_names == [one.label for one in exact]
    assert batch.held.tolist() == [not one.moves for one in exact]
    near = 1e-9 if gdim == 3 else 1e-12
    factors = [one.safety.value for one in exact]
    assert batch.factors == pytest.approx(factors, rel=near, abs=near)
    assert batch.alone <= (11 if gdim == 3 else 0) and not batch.reasons


@pytest.mark.parametrize("unit", [1e-13, 1e13])
def test_units_of_force_change_nothing(unit: float) -> None:
    """Batches of forces of 1e-13 N are judged as those of 1 N, together."""
    cases = random_cases(40, 4, 3)
    loads = unit * cases.force, unit * cases.torque, unit * cases.weight, cases.centre
    batch = judge_many(Cases(cases.points, cases.normals, *loads, cases.law))
    assert batch.alone == 0
    assert batch.factors == pytest.approx(judge_many(cases).factors, rel=1e-9)


TWO = np.zeros((2, 3))


def on_block(force: Any = TWO, couple: Any = TWO, friction: Any = 0.5) -> Cases:
    """Two loads on a block."""
    law = FrictionCone.of(friction)
    return Cases(BLOCK.points, BLOCK.normals, force, couple, ZERO, ZERO, law)


@pytest.mark.parametrize(
    ("build", "said"),
    [
        (lambda: safety_factor(load(), pocket(0.5), -0.1), "friction"),
        (lambda: safety_factor(load(), pocket(0.5), math.nan), "friction"),
        (
            lambda: safety_factor(load(), replace(pocket(0.5), normals=-pocket(0.5).normals), 0.5),
            "into the grain",
        ),
        (
            lambda: on_block(couple=np.zeros((3, 3))),
            "cases: torque does not fit 2 cases; give a row for each, or one for all",
        ),
        (lambda: on_block(friction=np.array([0.5, 0.4, 0.3])), "law does not fit"),
        (lambda: judge_many(on_block(TWO + np.nan)).complete(), "give finite numbers"),
        (lambda: probabilities(*block(0.1), 0.5, StandardErrors(), 0), "samples is 0"),
    ],
)
def test_wrong_contacts_loads_and_numbers_are_refused(build: Any, said: str) -> None:
    assert said in message(build)


ALONE = """
import sys
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in OTHERS:
            raise ModuleNotFoundError(name, name=name)
OTHERS = set("pydantic tomli_w trimesh rich matplotlib PIL numba clarabel mpi4py dolfinx gmsh".split())
sys.meta_path.insert(0, Absent())
import numpy as np
from incipient.contact import Cases, Contacts, judge_many
from incipient.contact.friction import FrictionCone
contacts = Contacts(np.array([[0.0, 0.0, -1.0]]), np.array([[0.0, 0.0, -1.0]]))
force = np.array([[0.25, 0.0, 0.0], [0.0, 0.0, 2.0]])
acting = force, 0.0 * force, [0.0, 0.0, -1.0], np.zeros(3)
law = FrictionCone.of(0.5)
batch = judge_many(Cases(contacts.points, contacts.normals, *acting, law, 1.0, np.eye(3)))
print(*(batch.labels[mode] for mode in batch.modes))
"""


def test_numpy_and_scipy_are_enough() -> None:
    """A point under the centre holds no push along the ground without turning; a lift twice the weight lifts."""
    done = subprocess.run([sys.executable, "-c", ALONE], capture_output=True, text=True, check=True)
    assert done.stdout.split()[-1] == "lifting" and done.stdout.split()[0] != "rest"


# A push with errors along and across: it slides once s |F| > friction W, and the least |F| is on a side of the box,
# not at a corner. One contact in 3-D, pushed, and pushed beside the torque that holds it: no torque about the contact
# is balanced, and the loads that are held are so few that none is ever drawn. Without weight any factor or none: what
# presses to the plane within the friction angle is held.
SLID = box(0.0, [0.3, 0.0, 0.0], height=0.1)
AROUND, TURNING = [0.1, 0.15, 0.0, 0.0, 0.0, 0.0], [0.1, 0.1, 0.0, 0.01, 0.01, 0.0]
SINGLE, BESIDE = (in_3d([push, 0.0, 0.0]) for push in (0.05, 0.15))
WEIGHTLESS = load((0.3, -1.0), weight=(0.0, 0.0)), ends(depth=0.0)
# Case, friction, errors, smallest and largest safety factor, and the verdict.
RANGES = [
    *(
        (SLID, friction, AROUND, (friction / math.hypot(0.4, 0.15), friction / 0.2), says)
        for friction, says in ((0.3, "either"), (0.45, "rests"), (0.19, "moves"))
    ),
    *((SINGLE, friction, TURNING, (0.0, INF), "either") for friction in (0.0, 0.5)),
    *((BESIDE, friction, TURNING, (0.0, 0.0), "moves") for friction in (0.0, 0.5)),
    (WEIGHTLESS, 0.4, 0.05 * ALONG_X, (INF, INF), "rests"),
    (WEIGHTLESS, 0.4, 0.2 * ALONG_X, (0.0, INF), "either"),
    (WEIGHTLESS, 0.05, 0.2 * ALONG_X, (0.0, 0.0), "moves"),
]


@pytest.mark.parametrize(("case", "friction", "errors", "ends", "says"), RANGES)
def test_ranges_of_an_error_box(
    case: Any, friction: float, errors: Any, ends: Any, says: str
) -> None:
    computed = safety_range(*case, friction, np.diag(errors))
    assert (computed.low, computed.high) == pytest.approx(ends, abs=1e-9)
    assert (computed.rests, computed.moves) == (says == "rests", says == "moves")


@pytest.mark.parametrize("error", [0.0, 0.1, 0.95])
def test_ranges_where_the_flow_holds_the_grain(error: float) -> None:
    """The weight pulls along the plane with 0.6, friction holds 0.5, the flow pushes back with 1 +- error."""
    acting = load((-1.0, 0.0), weight=(0.6, -1.0))
    computed = safety_range(acting, ends(depth=0.0), 0.5, np.diag(error * ALONG_X))
    assert (computed.low, computed.high) == (0.0, 0.0)
    assert computed.possible == pytest.approx((0.1 / (1.0 + error), 1.1 / (1.0 - error)))
    if error == 0.95:  # 0.1 / 0.05 times would hold the weakest, 1.1 / 1.95 at most the strongest
        assert computed.guaranteed is None
    else:
        assert computed.guaranteed == pytest.approx((0.1 / (1.0 - error), 1.1 / (1.0 + error)))
    assert computed.rests == (error < 0.1 + ROUND_OFF) and not computed.moves


def test_words_of_what_the_flow_holds() -> None:
    assert held_words(None, None) == "no multiple of the flow's load holds it"
    assert held_words((0.0, 0.0), (0.0, 0.0)) == "any fraction of the flow's load moves it"
    may = "0.1 to 1 times the flow's load may hold it, none for certain"
    assert held_words((0.1, 1.0), None) == may
    assert held_words((0.1, math.inf), (0.2, 3.0)).endswith("0.2 to 3 times do for certain")


def test_a_program_without_answer_claims_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stopped after one step the method has no answer: the grain may then rest at any factor."""
    acting, square = box(0.0, [0.6, 0.0, 0.0], height=0.1)
    errors = np.diag(0.05 * ALONG_X)
    assert safety_range(acting, square, 0.3, errors).moves
    monkeypatch.setattr(conic, "ITERATIONS", 1)  # which compiled code would not see
    monkeypatch.setattr("incipient.contact.kernels.AT_ONCE", math.inf)
    interpreted = Kernel(conic.interval_rows, interpreted=math.inf)
    monkeypatch.setattr("incipient.contact.safety.INTERVALS", interpreted)
    for box_ in (errors, np.zeros((1, 6))):
        stopped = safety_range(acting, square, 0.3, box_)
        assert not stopped.moves and not stopped.rests
        assert (stopped.low, stopped.high) == (0.0, math.inf)
    with pytest.raises(ConvergenceError, match="no answer"):
        safety_factor(acting, square, 0.3)
    loads = acting.flow_force[None], acting.flow_couple, acting.weight, acting.centre
    cases = Cases(square.points, square.normals, *loads, FrictionCone.of(0.3))
    stopped_rows = judge_many(cases)
    assert "no answer" in stopped_rows.reasons[0]
    assert np.isnan(stopped_rows.factors[0]) and not stopped_rows.held[0]


@pytest.mark.parametrize("gdim", [2, 3])
def test_no_load_of_random_boxes_is_outside(gdim: int) -> None:
    """Nor outside the guaranteed interval; the lower end is that of a corner."""
    rng, said = np.random.default_rng(gdim), set()
    cases = random_cases(60, 3, gdim)

    def margin(factor: float) -> float:
        return factor / (1.0 + factor) if math.isfinite(factor) else 1.0

    for number in range(len(cases)):
        acting, contacts, friction, _ = cases.case(number)
        part = 0.5 if gdim == 2 else 0.3
        torque = part * acting.flow_couple
        acting = replace(acting, flow_force=part * acting.flow_force, flow_couple=torque)
        which = np.array([1, 1, 0, 0, 0, 1] if gdim == 2 else np.ones(6)) * (rng.random(6) < 0.8)
        sizes = rng.uniform(0.0, 0.3, 6) * [1.0, 1.0, 1.0, 0.2, 0.2, 0.2]
        errors = np.diag(sizes * which * rng.choice([0.2, 1.0]))
        computed = safety_range(acting, contacts, friction, errors)
        said.add((computed.rests, computed.moves))
        ways = errors[errors.any(axis=1)].T
        count = ways.shape[1]

        def at(share: Any, case: Any = (acting, contacts, friction), ways: Any = ways) -> Any:
            return safety_factor(case[0].shifted(ways @ share), *case[1:])

        for share in rng.uniform(-1.0, 1.0, (12, count)):
            alone = at(share)
            low, high = margin(computed.low) - ROUND_OFF, margin(computed.high) + ROUND_OFF
            assert low <= margin(alone.value) <= high
            assert alone.held or not computed.rests
            assert not (alone.held and computed.moves)
            if alone.interval is not None:
                assert margin(computed.possible[0]) - ROUND_OFF <= margin(alone.interval[0])
                assert margin(alone.interval[1]) <= margin(computed.possible[1]) + ROUND_OFF
            if computed.guaranteed is not None:
                assert margin(alone.interval[0]) <= margin(computed.guaranteed[0]) + ROUND_OFF
                assert margin(computed.guaranteed[1]) - ROUND_OFF <= margin(alone.interval[1])
    assert said == {(True, False), (False, True), (False, False)}


@pytest.mark.parametrize(
    ("force", "error", "of"),
    [(0.3, 0.1, "flow_force x"), (0.5, 0.2, "flow_force x"), (0.45, 0.05, "friction")],
)
def test_block_pushed_with_an_error(force: float, error: float, of: str) -> None:
    # It slides if |F| > friction N = 0.5: P = 1 - Phi((0.5 - f) / s) + Phi((-0.5 - f) / s).
    ends = [erf((value - force) / (error * sqrt(2.0))) for value in (0.5, -0.5)]
    exact = 1.0 - 0.5 * (ends[0] - ends[1])
    errors = StandardErrors(friction=error) if of == "friction" else StandardErrors([error, 0, 0])
    computed = probabilities(load((force, 0.0)), BLOCK, 0.5, errors, 400, 3)
    for judge in (computed.moves_equilibrium, computed.moves_criteria):
        assert abs(judge.value - exact) < 4.0 * judge.standard_error
    # On a plane and without a torque both judges say the same of every case.
    assert (computed.same.value, computed.most) == (1.0, of)


def test_modes_of_each_judge_add_up_to_one() -> None:
    errors = StandardErrors([0.2, 0.2, 0.0], [0.0, 0.0, 0.2], 0.1)
    case = load((0.4, 0.0), -0.1), BLOCK, 0.5, errors, 100
    computed, again, other = (probabilities(*case, seed, INERT) for seed in (1, 1, 2))
    for judge in (computed.criteria, computed.equilibrium):
        chances = [chance.value for chance in judge.values()]
        assert sum(chances) == pytest.approx(1.0)
        assert chances == sorted(chances, reverse=True)
    rest = computed.equilibrium.get("rest", Probability.of(0, 100)).value
    assert rest == pytest.approx(1.0 - computed.moves_equilibrium.value)
    assert computed.margin == tuple(sorted(computed.margin))
    assert "probability" in computed.sentence
    assert plain(computed) == plain(again) and computed.margin != other.margin


@pytest.mark.parametrize(
    ("count", "total", "words"),
    [
        (0, 500, "<0.6%"),
        (500, 500, ">99.4%"),
        (0, 100_000, "<0.003%"),
        (2, 500, "0.4 +- 0.3%"),
        (5, 100_000, "0.005 +- 0.002%"),
        (170, 500, "34.0 +- 2.1%"),
    ],
)
def test_words_and_standard_error(count: int, total: int, words: str) -> None:
    # Where none of n cases moves, (1 - p)^(n + 1) = 5% is the largest p that is not unlikely.
    # Beta(k + 1, n - k + 1): variance a b / ((a + b)^2 (a + b + 1)).
    a, b = count + 1, total - count + 1
    computed = Probability.of(count, total)
    assert (computed.value, computed.words) == (count / total, words)
    assert computed.standard_error == pytest.approx(sqrt(a * b / ((a + b) ** 2 * (a + b + 1))))


@pytest.mark.parametrize(
    ("force", "says"),
    [(0.2, "it rests for certain"), (0.45, "it may rest"), (0.8, "it moves for certain")],
)
def test_what_is_certain_within_standard_errors(force: float, says: str) -> None:
    # It slides if F > friction: 0.5 / F, with F to 0.1 and friction to 0.05.
    errors = StandardErrors([0.05, 0, 0], friction=0.025)
    within = probabilities(load((force, 0.0)), BLOCK, 0.5, errors, 10).within
    assert (within.low, within.high) == pytest.approx((0.45 / (force + 0.1), 0.55 / (force - 0.1)))
    assert says in within.sentence and within.certain == ("certain" in says)


@pytest.mark.parametrize(("about", "certain"), [([0.0, -0.5, 0.0], True), (None, False)])
def test_torque_about_the_contact(about: list[float] | None, certain: bool) -> None:
    """Known about the contact the torque there is zero whatever the force: it rests in all cases, otherwise in none."""
    errors = StandardErrors([0.1, 0.0, 0.0], about=about)
    computed = probabilities(load((0.3, 0.0), 0.15), DISC, 10.0, errors, 50)
    assert computed.within.certain is certain
    assert computed.moves_equilibrium.value == (0.0 if certain else 1.0)


def test_influence_of_each_input() -> None:
    # Y = 2 X1 + X2, unit variances: first-order fractions 4/5 and 1/5, none of X3; Y = X1 X2: none of both.
    # Y = X^2 is not correlated with X, and yet X decides it (but for its spread within classes).
    x = np.random.default_rng(0).standard_normal((20000, 3))
    computed = influences({"a": x[:, 0], "b": x[:, 1], "c": x[:, 2]}, 2.0 * x[:, 0] + x[:, 1])
    assert list(computed.values()) == pytest.approx([0.8, 0.2, 0.0], abs=0.02)
    assert computed["c"] == pytest.approx(0.0, abs=0.005)
    assert max(influences({"a": x[:, 0], "b": x[:, 1]}, x[:, 0] * x[:, 1]).values()) < 0.01
    assert influences({"x": x[:5000, 0]}, x[:5000, 0] ** 2)["x"] > 0.8
    assert influences({"x": np.arange(10.0)}, np.ones(10)) == {}
    # Without the correction for classes, 10 classes in 100 cases of noise would show a tenth.
    noise = x[:8000].reshape(80, 100, 3)
    assert np.mean([influences({"x": one[:, 0]}, one[:, 1])["x"] for one in noise]) < 0.05
