"""Loads known within a box: which factors some of them are held at, which all, and every mode they can have.

Against closed formulas, and against the exact judge asked about many loads of random boxes.
"""

import math
from dataclasses import dataclass

import numpy as np
import pytest

from incipient.contact import Contacts, Load, batch, problem, robustness, safety
from incipient.contact.batch import Cases, judge_many
from incipient.contact.problem import Kernel
from incipient.contact.robustness import ErrorBox, held_words, safety_range
from incipient.contact.safety import safety_factor
from incipient.errors import ConvergenceError

ALONG_X, COUPLE = np.eye(6)[0], np.eye(6)[5]
ROUND_OFF = 1e-7


def planar(force, couple=0.0, weight=(0.0, -1.0)):
    return Load([*force, 0.0], [0.0, 0.0, couple], [*weight, 0.0], np.zeros(3))


def pocket(degrees):
    """A disc of diameter one on two contacts, each so far to the side of its lowest point."""
    s, c = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
    normals = np.array([[-s, -c, 0.0], [s, -c, 0.0]])
    return Contacts(0.5 * normals, normals)


def flat(height, *places):
    """Contacts below a centre of mass at some height, all of them on a plane."""
    points = np.array([[*place, -height] for place in places])
    return Contacts(points, np.tile([0.0, 0.0, -1.0], (len(points), 1)))


SQUARE = flat(0.1, (1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))
BASE = Contacts([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [[0.0, -1.0, 0.0], [0.0, -1.0, 0.0]])


class TestClosedFormulas:
    def test_all_corners_move_and_a_load_between_them_rests(self):
        """Friction 0.1 holds a couple of 0.0572 at most; without one the disc rests at any factor."""
        load, friction = planar([0.0, 0.0], 0.1), 0.1
        box = ErrorBox.of(0.25 * COUPLE)
        corners = [
            safety_factor(load.shifted(change), pocket(30.0), friction) for change in box.corners()
        ]
        assert not any(corner.held for corner in corners)
        found = safety_range(load, pocket(30.0), friction, box)
        assert not found.moves and not found.rests
        assert found.high == math.inf
        assert found.low == pytest.approx(min(corner.value for corner in corners))

    def test_block_in_space(self):
        """It slides once s |F| > friction W, and the least |F| is on a side of the box, not at a corner."""
        load = Load([0.3, 0.0, 0.0], np.zeros(3), [0.0, 0.0, -1.0], np.zeros(3))
        box = ErrorBox.of(np.array([0.1, 0.15, 0.0, 0.0, 0.0, 0.0]))
        found = safety_range(load, SQUARE, 0.3, box)
        assert (found.low, found.high) == pytest.approx((0.3 / math.hypot(0.4, 0.15), 0.3 / 0.2))
        assert not found.moves and not found.rests
        assert safety_range(load, SQUARE, 0.45, box).rests
        assert safety_range(load, SQUARE, 0.19, box).moves

    @pytest.mark.parametrize("friction", [0.0, 0.5])
    def test_one_contact_in_space(self, friction):
        """No couple about the contact is balanced: the loads that are held are so few that none is ever drawn."""
        load = Load([0.05, 0.0, 0.0], np.zeros(3), [0.0, 0.0, -1.0], np.zeros(3))
        box = ErrorBox.of(np.array([0.1, 0.1, 0.0, 0.01, 0.01, 0.0]))
        found = safety_range(load, flat(0.5, (0.0, 0.0)), friction, box)
        assert (found.low, found.high) == (0.0, math.inf)
        aside = load.shifted(0.1 * ALONG_X)
        assert safety_range(aside, flat(0.5, (0.0, 0.0)), friction, box).high == pytest.approx(
            0.0, abs=1e-9
        )

    @pytest.mark.parametrize("error", [0.0, 0.1, 0.95])
    def test_held_by_the_flow(self, error):
        """The weight pulls along the plane with 0.6, friction holds 0.5, the flow pushes back with 1 +- error."""
        load = planar([-1.0, 0.0], weight=(0.6, -1.0))
        found = safety_range(load, BASE, 0.5, ErrorBox.of(error * ALONG_X))
        assert (found.low, found.high) == (0.0, 0.0)
        assert found.possible == pytest.approx((0.1 / (1.0 + error), 1.1 / (1.0 - error)))
        if (
            error == 0.95
        ):  # 0.1 / 0.05 = 2 times would hold the weakest, 1.1 / 1.95 = 0.56 at most the strongest
            assert found.guaranteed is None
        else:
            assert found.guaranteed == pytest.approx((0.1 / (1.0 - error), 1.1 / (1.0 + error)))
        assert found.rests == (error < 0.1 + ROUND_OFF)
        assert not found.moves

    def test_words_of_what_the_flow_holds(self):
        assert held_words(None, None) == "no multiple of the flow's load holds it"
        assert held_words((0.0, 0.0), (0.0, 0.0)) == "any part of the flow's load moves it"
        assert (
            held_words((0.1, 1.0), None)
            == "0.1 to 1 times the flow's load may hold it, none for certain"
        )
        assert held_words((0.1, math.inf), (0.2, 3.0)).endswith("0.2 to 3 times do for certain")

    def test_no_weight(self):
        """Any factor or none: what presses to the plane within the friction angle is held."""
        weightless = Load([0.3, -1.0, 0.0], np.zeros(3), np.zeros(3), np.zeros(3))
        centred = Contacts([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], BASE.normals)
        found = {
            error: safety_range(weightless, centred, 0.4, ErrorBox.of(error * ALONG_X))
            for error in (0.05, 0.2)
        }
        assert (found[0.05].low, found[0.05].high, found[0.05].rests) == (math.inf, math.inf, True)
        assert (found[0.2].low, found[0.2].high) == (0.0, math.inf)
        assert safety_range(weightless, centred, 0.05, ErrorBox.of(0.2 * ALONG_X)).moves

    def test_friction_that_is_not_known(self):
        box = ErrorBox(0.1 * ALONG_X[:, None], friction=0.1)
        found = safety_range(planar([0.3, 0.0]), BASE, 0.5, box)
        assert (found.low, found.high) == pytest.approx((0.4 / 0.4, 0.6 / 0.2))

    def test_no_errors(self):
        load = planar([0.3, 0.1], 0.02)
        found = safety_range(load, pocket(30.0), 0.3, ErrorBox.of(np.zeros(6)))
        alone = safety_factor(load, pocket(30.0), 0.3)
        assert found.possible == found.guaranteed == alone.interval

    def test_a_program_without_answer_claims_nothing(self, monkeypatch):
        """Stopped after one step the method has no answer: the grain may then rest at any factor."""
        load = Load([0.6, 0.0, 0.0], np.zeros(3), [0.0, 0.0, -1.0], np.zeros(3))
        box = ErrorBox.of(0.05 * ALONG_X)
        assert safety_range(load, SQUARE, 0.3, box).moves
        monkeypatch.setattr(safety, "ITERATIONS", 1)  # which compiled code would not see
        monkeypatch.setattr(problem, "AT_ONCE", math.inf)
        interpreted = Kernel(safety.safety_rows, interpreted=math.inf)
        for module in (safety, robustness, batch):
            monkeypatch.setattr(module, "SAFETY", interpreted)
        for errors in (box, ErrorBox.of(np.zeros(6))):
            stopped = safety_range(load, SQUARE, 0.3, errors)
            assert not stopped.moves and not stopped.rests
            assert (stopped.low, stopped.high) == (0.0, math.inf)
        with pytest.raises(ConvergenceError, match="no answer"):
            safety_factor(load, SQUARE, 0.3)
        rows = np.array([load.flow_force]), np.zeros((1, 3)), np.array([load.weight])
        cases = SQUARE.points[None], SQUARE.normals[None], *rows, np.zeros((1, 3)), np.array([0.3])
        judged = judge_many(Cases(*cases, np.full(1, np.nan), np.full((1, 3, 3), np.nan)))
        assert "no answer" in judged.reasons[0]
        assert np.isnan(judged.factors[0]) and not judged.held[0]


@dataclass(frozen=True)
class Case:
    load: Load
    contacts: Contacts
    friction: float
    box: ErrorBox

    def at(self, shares):
        """The safety factor of one load of the box."""
        return safety_factor(
            self.load.shifted(self.box.error_directions @ shares), self.contacts, self.friction
        )


def random_case(rng, gdim):
    """One to five contacts around a disc or a sphere or near it; errors in any of the components."""
    count = int(rng.integers(gdim - 1, 6))
    angles = rng.uniform(-2.4, -0.7, count) if gdim == 2 else rng.uniform(0.0, 2.0 * np.pi, count)
    if gdim == 2:
        normals = np.stack([np.cos(angles), np.sin(angles), np.zeros(count)], axis=1)
        load = planar(0.5 * rng.normal(size=2), 0.1 * rng.normal())
    else:
        lean = rng.uniform(0.3, 0.9)
        normals = np.stack([np.sin(lean) * np.cos(angles), np.sin(lean) * np.sin(angles)], axis=1)
        normals = np.column_stack([normals, np.full(count, -np.cos(lean))])
        load = Load(
            0.15 * rng.normal(size=3), 0.03 * rng.normal(size=3), [0.0, 0.0, -1.0], np.zeros(3)
        )
    points = normals * rng.uniform(0.4, 0.6, (count, 1))
    which = np.array([1, 1, 0, 0, 0, 1] if gdim == 2 else np.ones(6)) * (rng.random(6) < 0.8)
    errors = (
        rng.uniform(0.0, 0.3, 6) * [1.0, 1.0, 1.0, 0.2, 0.2, 0.2] * which * rng.choice([0.2, 1.0])
    )
    return Case(
        load, Contacts(points, normals), float(rng.choice([0.1, 0.5, 1.0])), ErrorBox.of(errors)
    )


def margin(factor):
    return factor / (1.0 + factor) if math.isfinite(factor) else 1.0


def climbed(case, rng, wanted):
    """The largest margin that a blind search in the box finds, which ends once it is near to the one wanted."""
    count = case.box.error_directions.shape[1]
    at, best, step = np.zeros(count), margin(case.at(np.zeros(count)).value), 1.0
    while step > 1e-4 and best < wanted - 1e-3:
        for shares in np.clip(at + step * rng.normal(size=(12, count)), -1.0, 1.0):
            found = margin(case.at(shares).value)
            if found > best:
                at, best = shares, found
                break
        else:
            step *= 0.6
    return best


class TestAgainstManyLoads:
    @pytest.mark.parametrize("gdim", [2, 3])
    def test_no_load_is_outside(self, gdim):
        rng, said = np.random.default_rng(gdim), set()
        for _ in range(60):
            case = random_case(rng, gdim)
            found = safety_range(case.load, case.contacts, case.friction, case.box)
            said.add((found.rests, found.moves))
            for shares in rng.uniform(-1.0, 1.0, (12, case.box.error_directions.shape[1])):
                alone = case.at(shares)
                assert (
                    margin(found.low) - ROUND_OFF
                    <= margin(alone.value)
                    <= margin(found.high) + ROUND_OFF
                )
                assert alone.held or not found.rests
                assert not (alone.held and found.moves)
                if alone.interval is not None:
                    assert margin(found.possible[0]) - ROUND_OFF <= margin(alone.interval[0])
                    assert margin(alone.interval[1]) <= margin(found.possible[1]) + ROUND_OFF
                if found.guaranteed is not None:
                    assert margin(alone.interval[0]) <= margin(found.guaranteed[0]) + ROUND_OFF
                    assert margin(found.guaranteed[1]) - ROUND_OFF <= margin(alone.interval[1])
        assert said == {(True, False), (False, True), (False, False)}

    @pytest.mark.parametrize("gdim", [2, 3])
    def test_both_ends_are_reached(self, gdim):
        """The lower one at a corner, the upper one wherever a search that knows nothing of programs finds it."""
        rng, reached = np.random.default_rng(10 + gdim), 0
        while reached < 6:
            case = random_case(rng, gdim)
            found = safety_range(case.load, case.contacts, case.friction, case.box)
            if not 0.05 < margin(found.high) < 0.95 or case.box.error_directions.shape[1] > 4:
                continue
            assert climbed(case, rng, margin(found.high)) == pytest.approx(
                margin(found.high), abs=0.01
            )
            corners = [
                safety_factor(case.load.shifted(change), case.contacts, case.friction)
                for change in case.box.corners()
            ]
            assert min(corner.value for corner in corners) == pytest.approx(
                found.low, abs=ROUND_OFF
            )
            reached += 1
