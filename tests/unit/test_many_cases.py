"""Many cases at once, loads known within a box, and cases drawn at random: against formulas and single verdicts."""

from __future__ import annotations

import math
import subprocess
import sys
from dataclasses import replace
from math import erf, sqrt
from typing import Any

import numpy as np
import pytest
from scenes import message
from test_safety_factor import block, box, load, pocket

from incipient.contact import Cases, Contacts, Load, conic, judge_many
from incipient.contact.friction import FrictionCone
from incipient.contact.kernels import Kernel
from incipient.contact.problem import plain
from incipient.contact.robustness import (
    ErrorBox,
    Probability,
    StandardErrors,
    draw,
    held_words,
    influences,
    probabilities,
    safety_range,
)
from incipient.contact.safety import safety_factor
from incipient.contact.verdict import judged
from incipient.errors import ConvergenceError, SceneError

ALONG_X, TORQUE = np.eye(6)[0], np.eye(6)[5]
ROUND_OFF = 1e-7
DISC = Contacts([[0.0, -0.5, 0.0]], [[0.0, -1.0, 0.0]])
BLOCK = Contacts([[-1.0, -0.1, 0.0], [1.0, -0.1, 0.0]], [[0.0, -1.0, 0.0]] * 2)
INERT = (1.0, np.eye(3))
UNKNOWN = (np.nan, np.full((3, 3), np.nan))


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
    weight = np.tile([0.1, 0.0, 0.0] - down, (count, 1))
    inertia = np.tile(np.diag([0.3, 0.4, 0.5]), (count, 1, 1))
    law = FrictionCone(rng.uniform(0.2, 0.8, count))
    rest = np.zeros((count, 3)), law, np.ones(count), inertia
    return Cases(points, normals, force, 0.3 * torque, weight, *rest)


def cases_of(points: Any, normals: Any, push: Any, weight: Any, friction: Any, inert: Any) -> Cases:
    """n cases with their centres at the origin, pushed along x, without torque."""
    count = len(push)
    none, mass, inertia = np.zeros((count, 3)), *inert
    force = np.asarray(push)[:, None] * [1.0, 0.0, 0.0]
    table = np.tile(inertia, (count, 1, 1))
    law = FrictionCone(np.asarray(friction))
    return Cases(points, normals, force, none, weight, none, law, np.full(count, mass), table)


class TestBatch:
    @pytest.mark.parametrize("flat", [False, True])
    @pytest.mark.parametrize(
        ("contacts", "gdim"), [(1, 2), (2, 2), (3, 2), (4, 2), (1, 3), (2, 3), (4, 3)]
    )
    def test_as_one_by_one(self, contacts: int, gdim: int, flat: bool) -> None:
        """In 2-D to 1e-12; in 3-D to 1e-9, which is what the cone solver leaves."""
        cases = random_cases(120, contacts, gdim, flat)
        batch = judge_many(cases)
        exact = [judged(*cases.case(number)) for number in range(len(cases))]
        assert batch.mode_names == [one.label for one in exact]
        assert batch.held.tolist() == [not one.moves for one in exact]
        near = 1e-9 if gdim == 3 else 1e-12
        factors = [one.safety.value for one in exact]
        assert batch.factors == pytest.approx(factors, rel=near, abs=near)
        assert batch.alone <= (11 if gdim == 3 else 0) and not batch.reasons

    @pytest.mark.parametrize("gdim", [2, 3])
    def test_without_inertia_under_weights_of_their_own(self, gdim: int) -> None:
        """As each alone, with weights from half to twice the usual one: at rest or moving, by no mode."""
        acting, contacts, friction, _ = random_cases(1, 3, gdim).case(0)
        rng = np.random.default_rng(5)
        force, torque = rng.standard_normal((2, 60, 3))
        if gdim == 2:
            force, torque = force * [1.0, 1.0, 0.0], torque * [0.0, 0.0, 1.0]
        weight = acting.weight * rng.uniform(0.5, 2.0, (60, 1))
        surface = contacts.points, contacts.normals
        cases = Cases(*surface, 0.5 * force, 0.1 * torque, weight, acting.centre, friction)
        batch = judge_many(cases)
        exact = [judged(*cases.case(number)) for number in range(60)]
        assert batch.mode_names == [one.label for one in exact]
        assert set(batch.mode_names) == {"rest", "moves"} and batch.alone < 5
        factors = [one.safety.value for one in exact]
        assert batch.factors == pytest.approx(factors, rel=1e-9, abs=1e-9)

    @pytest.mark.parametrize("gdim", [2, 3])
    def test_loads_on_the_boundary_and_none_at_all(self, gdim: int) -> None:
        """Loads at, and to round-off at, the critical one, twice the same, along the weight, and no load."""
        acting, contacts = (
            (load((0.8, 0.1), -0.02), pocket(0.5)) if gdim == 2 else box(0.1, [0.5, 0.2, 0.1])
        )
        factor = safety_factor(acting, contacts, 0.4).value
        near = np.array([1e-9, 1e-6, 1e-3])
        shares = factor * np.array([0.0, 0.5, 1.0, *(1.0 - near), *(1.0 + near), 2.0])[:, None]
        force = np.vstack([shares * acting.flow_force, np.outer([1.0, -0.5, -2.0], acting.weight)])
        torque = np.vstack([shares * acting.flow_couple, np.zeros((3, 3))])
        surface = contacts.points, contacts.normals
        cases = Cases(
            *surface, force, torque, acting.weight, acting.centre, FrictionCone.of(0.4), *INERT
        )
        batch = judge_many(cases).complete()
        for number in range(len(cases)):
            alone = judged(*cases.case(number))
            assert batch.labels[batch.modes[number]] == alone.label
            assert batch.factors[number] == pytest.approx(alone.safety.value, rel=1e-9, abs=1e-9)

    def test_blocks_slide_or_tip_in_any_plane(self) -> None:
        """A block of half width b pushed at height h: at mu W it slides, at W b / h it tips; in a tilted plane too.

        In a tilted plane the case counts as one in 3-D, whose factors are good to 1e-9 (3.6e-11 measured).
        """
        rng, count = np.random.default_rng(0), 3000
        half, height, friction = (rng.uniform(0.2, 1.0, count) for _ in range(3))
        push, weight = rng.uniform(0.1, 1.0, count), rng.uniform(0.5, 2.0, count)
        points = np.zeros((count, 2, 3))
        points[:, 0, 0], points[:, 1, 0], points[..., 1] = -half, half, -height[:, None]
        normals = np.broadcast_to([0.0, -1.0, 0.0], points.shape)
        down = weight[:, None] * [0.0, -1.0, 0.0]
        cases = cases_of(points, normals, push, down, friction, INERT)
        expected = np.minimum(friction, half / height) * weight / push
        slides = (friction < half / height) & (expected < 1.0)
        tilt = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        for turn, near in (
            (np.eye(3), 1e-12),
            (np.roll(np.eye(3), 1, axis=0), 1e-12),
            (tilt, 1e-9),
        ):
            vectors = ("points", "normals", "force", "weight")
            turned = {name: getattr(cases, name) @ turn.T for name in vectors}
            batch = judge_many(replace(cases, **turned))
            assert batch.factors == pytest.approx(expected, rel=near)
            assert {batch.mode_names[place] for place in np.flatnonzero(slides)} == {"sliding"}
            assert batch.alone == 0

    def test_spheres_in_pockets_of_three(self) -> None:
        """Unit spheres on three of size s, pushed along the line from one of them to the middle: they pivot.

        Contacts lie at sine q = 2 s / (sqrt 3 (1 + s)) off the vertical. The sphere leaves the back one and turns about
        the two in front when F cos q = W sin q / 2 times the push.
        """
        rng, count = np.random.default_rng(1), 400
        size, push = rng.uniform(0.5, 1.5, count), rng.uniform(0.05, 0.4, count)
        sine = 2.0 * size / (np.sqrt(3.0) * (1.0 + size))
        cosine = np.sqrt(1.0 - sine**2)
        around = np.radians([180.0, 60.0, -60.0])
        flat = [sine[:, None] * np.cos(around), sine[:, None] * np.sin(around)]
        points = np.stack([*flat, np.tile(-cosine[:, None], 3)], axis=2)
        weight = np.tile([0.0, 0.0, -1.0], (count, 1))
        batch = judge_many(cases_of(points, points, push, weight, np.full(count, 0.5), UNKNOWN))
        assert batch.factors == pytest.approx(0.5 * sine / cosine / push, rel=1e-9)
        assert set(batch.mode_names) == {"rest", "moves"} and batch.alone < 20

    def test_chunks_say_the_same(self, monkeypatch: pytest.MonkeyPatch) -> None:
        cases = random_cases(90, 2, 2)
        once = judge_many(cases)
        monkeypatch.setattr("incipient.contact.batch.CHUNK", 40)
        parts = judge_many(cases)
        assert parts.mode_names == once.mode_names and np.array_equal(parts.factors, once.factors)

    def test_wrong_loads_are_refused(self) -> None:
        good, none, surface = np.zeros((2, 3)), np.zeros(3), (BLOCK.points, BLOCK.normals)
        law, laws = FrictionCone.of(0.5), FrictionCone(np.array([0.5, 0.4, 0.3]))
        wrong = message(lambda: Cases(*surface, good, np.zeros((3, 3)), none, none, law))
        assert wrong == "cases: torque does not fit 2 cases; give a row for each, or one for all"
        assert "law does not fit" in message(lambda: Cases(*surface, good, good, none, none, laws))
        batch = judge_many(Cases(*surface, good + np.nan, good, none, none, law))
        assert "give finite numbers" in message(batch.complete)


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
    done = subprocess.run(
        [sys.executable, "-c", ALONE], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split()[-1] == "lifting" and done.stdout.split()[0] != "rest"


class TestErrorBox:
    def test_all_corners_move_and_a_load_between_them_rests(self) -> None:
        """Friction 0.1 holds a torque of 0.0572 at most; without one the disc rests at any factor."""
        acting, box_, angle = load((0.0, 0.0), 0.1), ErrorBox.of(0.25 * TORQUE), math.pi / 6
        corners = [
            safety_factor(acting.shifted(change), pocket(angle), 0.1) for change in box_.corners()
        ]
        assert not any(corner.held for corner in corners)
        found = safety_range(acting, pocket(angle), 0.1, box_)
        assert not found.moves and not found.rests
        assert found.high == math.inf
        assert found.low == pytest.approx(min(corner.value for corner in corners))

    def test_block_in_3d(self) -> None:
        """It slides once s |F| > friction W, and the least |F| is on a side of the box, not at a corner."""
        case = box(0.0, [0.3, 0.0, 0.0], height=0.1)
        errors = ErrorBox.of(np.array([0.1, 0.15, 0.0, 0.0, 0.0, 0.0]))
        found = safety_range(*case, 0.3, errors)
        assert (found.low, found.high) == pytest.approx((0.3 / math.hypot(0.4, 0.15), 0.3 / 0.2))
        assert not found.moves and not found.rests
        assert safety_range(*case, 0.45, errors).rests
        assert safety_range(*case, 0.19, errors).moves

    @pytest.mark.parametrize("friction", [0.0, 0.5])
    def test_one_contact_in_3d(self, friction: float) -> None:
        """No torque about the contact is balanced: the loads that are held are so few that none is ever drawn."""
        contact = Contacts([[0.0, 0.0, -0.5]], [[0.0, 0.0, -1.0]])
        acting = Load([0.05, 0.0, 0.0], np.zeros(3), [0.0, 0.0, -1.0], np.zeros(3))
        errors = ErrorBox.of(np.array([0.1, 0.1, 0.0, 0.01, 0.01, 0.0]))
        found = safety_range(acting, contact, friction, errors)
        assert (found.low, found.high) == (0.0, math.inf)
        aside = safety_range(acting.shifted(0.1 * ALONG_X), contact, friction, errors)
        assert aside.high == pytest.approx(0.0, abs=1e-9)

    @pytest.mark.parametrize("error", [0.0, 0.1, 0.95])
    def test_held_by_the_flow(self, error: float) -> None:
        """The weight pulls along the plane with 0.6, friction holds 0.5, the flow pushes back with 1 +- error."""
        acting = load((-1.0, 0.0), weight=(0.6, -1.0))
        base = Contacts([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], BLOCK.normals)
        found = safety_range(acting, base, 0.5, ErrorBox.of(error * ALONG_X))
        assert (found.low, found.high) == (0.0, 0.0)
        assert found.possible == pytest.approx((0.1 / (1.0 + error), 1.1 / (1.0 - error)))
        if (
            error == 0.95
        ):  # 0.1 / 0.05 times would hold the weakest, 1.1 / 1.95 at most the strongest
            assert found.guaranteed is None
        else:
            assert found.guaranteed == pytest.approx((0.1 / (1.0 - error), 1.1 / (1.0 + error)))
        assert found.rests == (error < 0.1 + ROUND_OFF) and not found.moves

    def test_words_of_what_the_flow_holds(self) -> None:
        assert held_words(None, None) == "no multiple of the flow's load holds it"
        assert held_words((0.0, 0.0), (0.0, 0.0)) == "any fraction of the flow's load moves it"
        may = "0.1 to 1 times the flow's load may hold it, none for certain"
        assert held_words((0.1, 1.0), None) == may
        assert held_words((0.1, math.inf), (0.2, 3.0)).endswith("0.2 to 3 times do for certain")

    def test_no_weight_and_no_errors(self) -> None:
        """Any factor or none: what presses to the plane within the friction angle is held."""
        weightless = load((0.3, -1.0), weight=(0.0, 0.0))
        base = Contacts([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], BLOCK.normals)
        sure, unsure, moving = (
            safety_range(weightless, base, friction, ErrorBox.of(error * ALONG_X))
            for friction, error in ((0.4, 0.05), (0.4, 0.2), (0.05, 0.2))
        )
        assert (sure.low, sure.high, sure.rests) == (math.inf, math.inf, True)
        assert (unsure.low, unsure.high, moving.moves) == (0.0, math.inf, True)
        acting = load((0.3, 0.1), 0.02)
        found = safety_range(acting, pocket(0.5), 0.3, ErrorBox.of(np.zeros(6)))
        interval = safety_factor(acting, pocket(0.5), 0.3).interval
        assert found.possible == found.guaranteed == interval

    def test_friction_that_is_not_known(self) -> None:
        base = Contacts([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], BLOCK.normals)
        errors = ErrorBox(0.1 * ALONG_X[:, None], friction=0.1)
        found = safety_range(load((0.3, 0.0)), base, 0.5, errors)
        assert (found.low, found.high) == pytest.approx((0.4 / 0.4, 0.6 / 0.2))

    def test_a_program_without_answer_claims_nothing(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Stopped after one step the method has no answer: the grain may then rest at any factor."""
        acting, square = box(0.0, [0.6, 0.0, 0.0], height=0.1)
        errors = ErrorBox.of(0.05 * ALONG_X)
        assert safety_range(acting, square, 0.3, errors).moves
        monkeypatch.setattr(conic, "ITERATIONS", 1)  # which compiled code would not see
        monkeypatch.setattr("incipient.contact.kernels.AT_ONCE", math.inf)
        interpreted = Kernel(conic.interval_rows, interpreted=math.inf)
        for module in ("safety", "robustness"):
            monkeypatch.setattr(f"incipient.contact.{module}.INTERVALS", interpreted)
        for box_ in (errors, ErrorBox.of(np.zeros(6))):
            stopped = safety_range(acting, square, 0.3, box_)
            assert not stopped.moves and not stopped.rests
            assert (stopped.low, stopped.high) == (0.0, math.inf)
        with pytest.raises(ConvergenceError, match="no answer"):
            safety_factor(acting, square, 0.3)
        arms = (square.points - acting.centre)[None]
        rows = cases_of(arms, square.normals[None], [0.6], acting.weight[None], [0.3], UNKNOWN)
        stopped_rows = judge_many(rows)
        assert "no answer" in stopped_rows.reasons[0]
        assert np.isnan(stopped_rows.factors[0]) and not stopped_rows.held[0]

    @pytest.mark.parametrize("gdim", [2, 3])
    def test_no_load_of_random_boxes_is_outside(self, gdim: int) -> None:
        """And both ends are reached: the lower one at a corner, the upper one by a search that knows no programs."""
        rng, said, reached = np.random.default_rng(gdim), set(), 0
        cases = random_cases(60, 3, gdim)

        def margin(factor: float) -> float:
            return factor / (1.0 + factor) if math.isfinite(factor) else 1.0

        for number in range(len(cases)):
            acting, contacts, friction, _ = cases.case(number)
            part = 0.5 if gdim == 2 else 0.3
            torque = part * acting.flow_couple
            acting = replace(acting, flow_force=part * acting.flow_force, flow_couple=torque)
            which = np.array([1, 1, 0, 0, 0, 1] if gdim == 2 else np.ones(6)) * (
                rng.random(6) < 0.8
            )
            sizes = rng.uniform(0.0, 0.3, 6) * [1.0, 1.0, 1.0, 0.2, 0.2, 0.2]
            errors = ErrorBox.of(sizes * which * rng.choice([0.2, 1.0]))
            found = safety_range(acting, contacts, friction, errors)
            said.add((found.rests, found.moves))
            ways = errors.error_directions
            count = ways.shape[1]

            def at(share: Any, case: Any = (acting, contacts, friction), ways: Any = ways) -> Any:
                return safety_factor(case[0].shifted(ways @ share), *case[1:])

            for share in rng.uniform(-1.0, 1.0, (12, count)):
                alone = at(share)
                low, high = margin(found.low) - ROUND_OFF, margin(found.high) + ROUND_OFF
                assert low <= margin(alone.value) <= high
                assert alone.held or not found.rests
                assert not (alone.held and found.moves)
                if alone.interval is not None:
                    assert margin(found.possible[0]) - ROUND_OFF <= margin(alone.interval[0])
                    assert margin(alone.interval[1]) <= margin(found.possible[1]) + ROUND_OFF
                if found.guaranteed is not None:
                    assert margin(alone.interval[0]) <= margin(found.guaranteed[0]) + ROUND_OFF
                    assert margin(found.guaranteed[1]) - ROUND_OFF <= margin(alone.interval[1])
            if reached < 6 and count < 6 and 0.05 < margin(found.high) < 0.95:
                corners = [
                    safety_factor(acting.shifted(change), contacts, friction).value
                    for change in errors.corners()
                ]
                assert min(corners) == pytest.approx(found.low, abs=ROUND_OFF)
                best, step, place = margin(at(np.zeros(count)).value), 1.0, np.zeros(count)
                while step > 1e-4 and best < margin(found.high) - 1e-3:
                    tried = np.clip(place + step * rng.normal(size=(12, count)), -1.0, 1.0)
                    values = [margin(at(share).value) for share in tried]
                    step *= 1.0 if max(values) > best else 0.6
                    if max(values) > best:
                        best, place = max(values), tried[int(np.argmax(values))]
                assert best == pytest.approx(margin(found.high), abs=0.01)
                reached += 1
        assert reached == 6
        assert said == {(True, False), (False, True), (False, False)}


def pushed(force: float, torque: float = 0.0) -> Load:
    """A flat block of unit weight, centre of mass at the origin, pushed along its plane."""
    return load((force, 0.0), torque)


class TestProbabilities:
    @pytest.mark.parametrize(("force", "error"), [(0.3, 0.1), (0.45, 0.05), (0.5, 0.2)])
    def test_block_pushed_with_an_error(self, force: float, error: float) -> None:
        # It slides if |F| > friction N = 0.5: P = 1 - Phi((0.5 - f) / s) + Phi((-0.5 - f) / s).
        ends = [erf((value - force) / (error * sqrt(2.0))) for value in (0.5, -0.5)]
        exact = 1.0 - 0.5 * (ends[0] - ends[1])
        found = probabilities(pushed(force), BLOCK, 0.5, StandardErrors([error, 0, 0]), 400, 3)
        for judge in (found.moves_equilibrium, found.moves_criteria):
            assert abs(judge.value - exact) < 4.0 * judge.standard_error
        # On a plane and without a torque both judges say the same of every case.
        assert (found.same.value, found.most) == (1.0, "flow_force x")

    def test_block_on_a_plane_of_uncertain_friction(self) -> None:
        # It slides if friction < F / N = 0.3.
        found = probabilities(pushed(0.3), BLOCK, 0.35, StandardErrors(friction=0.05), 400, 5)
        exact = 0.5 * (1.0 + erf((0.3 - 0.35) / (0.05 * sqrt(2.0))))
        moves = found.moves_equilibrium
        assert abs(moves.value - exact) < 4.0 * moves.standard_error
        assert set(found.influence) == {"friction"} and found.influence["friction"] > 0.95

    def test_modes_of_each_judge_add_up_to_one(self) -> None:
        errors = StandardErrors([0.2, 0.2, 0.0], [0.0, 0.0, 0.2], 0.1)
        case = pushed(0.4, -0.1), BLOCK, 0.5, errors, 100
        found, again, other = (probabilities(*case, seed, INERT) for seed in (1, 1, 2))
        for judge in (found.criteria, found.equilibrium):
            chances = [chance.value for chance in judge.values()]
            assert sum(chances) == pytest.approx(1.0)
            assert chances == sorted(chances, reverse=True)
        rest = found.equilibrium.get("rest", Probability.of(0, 100)).value
        assert rest == pytest.approx(1.0 - found.moves_equilibrium.value)
        assert found.margin == tuple(sorted(found.margin))
        assert "probability" in found.sentence
        assert plain(found) == plain(again) and found.margin != other.margin

    def test_without_errors_one_case_is_all(self) -> None:
        found = probabilities(pushed(0.6), BLOCK, 0.5, StandardErrors(), 12, 0)
        assert found.moves_equilibrium.value == 1.0
        assert (found.influence, found.most) == ({}, None)

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
    def test_words_and_standard_error(self, count: int, total: int, words: str) -> None:
        # Where none of n cases moves, (1 - p)^(n + 1) = 5% is the largest p that is not unlikely.
        # Beta(k + 1, n - k + 1): variance a b / ((a + b)^2 (a + b + 1)).
        a, b = count + 1, total - count + 1
        found = Probability.of(count, total)
        assert (found.value, found.words) == (count / total, words)
        assert found.standard_error == pytest.approx(sqrt(a * b / ((a + b) ** 2 * (a + b + 1))))

    def test_a_load_that_is_held_but_never_drawn(self) -> None:
        # A disc on a plane is held only without a torque about the contact, which has a probability of zero.
        errors = StandardErrors([0, 0, 0], [0, 0, 0.1])
        found = probabilities(pushed(0.0, 0.1), DISC, 0.5, errors, 100)
        assert found.moves_equilibrium.words == ">97.1%"
        assert (found.within.low, found.within.high) == (0.0, np.inf)
        assert "it may rest and it may move" in found.within.sentence
        assert not found.within.certain

    @pytest.mark.parametrize(
        ("force", "says"),
        [(0.2, "it rests for certain"), (0.45, "it may rest"), (0.8, "it moves for certain")],
    )
    def test_what_is_certain(self, force: float, says: str) -> None:
        # It slides if F > friction: 0.5 / F, with F to 0.1 and friction to 0.05.
        errors = StandardErrors([0.05, 0, 0], friction=0.025)
        within = probabilities(pushed(force), BLOCK, 0.5, errors, 10).within
        assert (within.low, within.high) == pytest.approx(
            (0.45 / (force + 0.1), 0.55 / (force - 0.1))
        )
        assert says in within.sentence and within.certain == ("certain" in says)

    def test_torque_about_the_contact(self) -> None:
        # Known about the contact the torque there is zero whatever the force: it rests in all cases, otherwise in none.
        case = pushed(0.3, 0.15), DISC, 10.0
        for about, certain in (([0.0, -0.5, 0.0], True), (None, False)):
            errors = StandardErrors([0.1, 0.0, 0.0], about=about)
            found = probabilities(*case, errors, 50)
            assert found.within.certain is certain
            assert found.moves_equilibrium.value == (0.0 if certain else 1.0)
        drawn = draw(
            pushed(0.3, 0.15), 10.0, StandardErrors([0.1, 0, 0], about=[0, -0.5, 0]), 50, 0
        )
        assert drawn["flow_couple z"] == pytest.approx(np.zeros(50), abs=1e-15)

    def test_influence(self) -> None:
        # Y = 2 X1 + X2, unit variances: first-order fractions 4/5 and 1/5, none of X3; Y = X1 X2: none of both.
        # Y = X^2 is not correlated with X, and yet X decides it (but for its spread within classes).
        x = np.random.default_rng(0).standard_normal((20000, 3))
        found = influences({"a": x[:, 0], "b": x[:, 1], "c": x[:, 2]}, 2.0 * x[:, 0] + x[:, 1])
        assert list(found.values()) == pytest.approx([0.8, 0.2, 0.0], abs=0.02)
        assert found["c"] == pytest.approx(0.0, abs=0.005)
        product = influences({"a": x[:, 0], "b": x[:, 1]}, x[:, 0] * x[:, 1])
        assert max(product.values()) < 0.01
        assert influences({"x": x[:5000, 0]}, x[:5000, 0] ** 2)["x"] > 0.8
        assert influences({"x": np.arange(10.0)}, np.ones(10)) == {}
        # Without the correction for classes, 10 classes in 100 cases of noise would show a tenth.
        noise = x[:8000].reshape(80, 100, 3)
        assert np.mean([influences({"x": one[:, 0]}, one[:, 1])["x"] for one in noise]) < 0.05

    def test_drawing(self) -> None:
        errors = StandardErrors([0.1, 0.2, 0.3], [0.4, 0.5, 0.6], 0.05)
        drawn = draw(pushed(1.0, 2.0), 0.5, errors, 20000, 0)
        spreads = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.05]
        assert [values.std() for values in drawn.values()] == pytest.approx(spreads, rel=0.03)
        means = [1.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.5]
        assert [values.mean() for values in drawn.values()] == pytest.approx(means, abs=0.02)
        assert drawn["flow_force x"].mean() == pytest.approx(1.0, abs=0.005)
        none = draw(pushed(1.0), 0.05, StandardErrors(friction=0.5), 1000, 0)
        assert none["friction"].min() == 0.0 and np.ptp(none["flow_force x"]) == 0.0

    @pytest.mark.parametrize(
        ("wrong", "match"),
        [
            ({"flow_force": [-0.1, 0, 0]}, "flow_force"),
            ({"flow_couple": [0.1, 0.2]}, "flow_couple"),
            ({"friction": math.nan}, "friction"),
        ],
    )
    def test_refused(self, wrong: dict[str, Any], match: str) -> None:
        with pytest.raises(SceneError, match=match):
            StandardErrors(**wrong)
        with pytest.raises(SceneError, match="samples is 0"):
            probabilities(*block(0.1), 0.5, StandardErrors(), 0)
