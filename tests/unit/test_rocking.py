"""Rests followed as the load of the flow grows: closed forms of a disc, the fold of an ellipse's moment, continuity.

A grain that rolls on a bed without slipping is in equilibrium where the moment of its load about the contact vanishes,
and leaves its trough where no more load has a place at which it does.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from incipient.contact import Load
from incipient.contact.rocking import Rocking, follow
from incipient.contact.safety import SafetyStatus, safety_factor
from incipient.contact.verdict import judge
from incipient.effects.effect import Solved
from incipient.effects.moving_grain import FreeBodyEffect
from incipient.evaluation.contact_verdict import (
    OTHER_CONTACTS,
    ROCKS,
    bar_with_rocking,
    find_contacts,
    may_rock,
    with_rocking,
)
from incipient.evaluation.contact_verdict import followed as followed_in
from incipient.geometry import (
    Bed,
    Disc,
    Ellipse,
    Flat,
    Grain,
    Placement,
    Rectangle,
    Sinusoidal,
    settle,
)
from incipient.planning.effects import Decision, EffectName
from incipient.results.errorbars import SafetyBar
from incipient.scene import Scene, loads
from incipient.scene.example import grain_on_bed
from incipient.scene.mass import mass_and_inertia

HEIGHT, LENGTH = 0.05, 2.0  # of the sinusoidal bed, which is lowest at 1.5
WAVE = 2.0 * math.pi / LENGTH
STEEPEST = math.atan(HEIGHT * WAVE)
INERT = (1.0, np.eye(3))
RADIUS = 0.2


def followed(
    grain: Grain, force: tuple[float, float], couple: float, friction: float, bed: Bed | None = None
) -> Rocking:
    """The rests of a grain of weight one from the bottom of the trough."""
    bed = bed or Sinusoidal(HEIGHT, LENGTH)
    start = settle(grain, bed, Placement((1.5, 1.0)), friction=friction)
    load = Load([*force, 0.0], [0.0, 0.0, couple], [0.0, -1.0, 0.0], [*start.placement.centre, 0.0])
    found = follow(grain, bed, start.placement, load, friction, INERT, resolved=2e-3)
    assert found is not None
    return found


@pytest.mark.slow
@pytest.mark.parametrize("couple", [-0.02, pytest.param(0.0, marks=pytest.mark.slow)])
def test_a_disc_rests_where_the_bed_has_the_slope_of_its_load(couple: float) -> None:
    """Slope phi with R |L| sin(psi - phi) = couple, psi the load's angle; it leaves beyond the steepest slope."""
    force = (0.3, 0.05)
    found = followed(Disc(2.0 * RADIUS), force, couple, 0.8)

    def slope(factor: float) -> float:
        x, y = factor * force[0], 1.0 - factor * force[1]
        return math.atan2(x, y) - math.asin(factor * couple / (RADIUS * math.hypot(x, y)))

    for rest in found.rests:
        into_bed = rest.contacts.normals[0]
        assert math.atan2(into_bed[0], -into_bed[1]) == pytest.approx(slope(rest.low), abs=1e-9)
    critical = brentq(lambda factor: slope(factor) - STEEPEST, 0.0, 3.0)
    assert found.critical == pytest.approx(critical, rel=5e-3)
    assert found.critical < critical * (1.0 + 1e-9)
    assert found.mode == "rolling"
    assert found.leaves


@pytest.mark.slow  # where it slips it settles nowhere, slowly
def test_a_disc_spins_where_friction_no_longer_holds_its_couple() -> None:
    """The contact force is vertical nearly, and has the arm R sin(atan(mu)) at most."""
    found = followed(Disc(2.0 * RADIUS), (0.01, 0.0), -0.1, 0.05)
    arm = RADIUS * math.sin(math.atan(0.05))
    critical = brentq(lambda factor: 0.1 * factor - arm * math.hypot(0.01 * factor, 1.0), 0.0, 3.0)
    assert found.critical == pytest.approx(critical, rel=5e-3)
    assert math.degrees(found.turned(found.last)) > 20.0


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

    found = solve_ivp(
        rates, (0.0, 0.45), [1.5, -0.5 * math.pi], rtol=1e-11, atol=1e-12, dense_output=True
    )
    x, t = found.sol(np.linspace(1e-4, 0.45, 4000))
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
    found = followed(grain, force, couple, 0.9)
    assert found.critical == pytest.approx(factors[fold], rel=5e-3)
    assert found.critical < factors[fold] * (1.0 + 1e-6)
    assert not found.leaves
    at = found.last
    assert at.low == pytest.approx(1.0, rel=1e-12)
    # It rolls in finite steps, whose slip is of their second order.
    place = np.interp(1.0, factors[:fold], centres[:fold, 0])
    assert at.placement.centre[0] == pytest.approx(place, abs=1e-4)
    assert found.turned(at) > 0.05
    assert found.drift(at) > found.turned(at)


def test_on_a_plane_any_load_rolls_a_disc_away() -> None:
    assert followed(Disc(1.0), (0.3, 0.0), 0.0, 0.8, Flat(0.0)).critical == 0.0


def test_a_disc_on_a_plane_is_not_followed(monkeypatch: pytest.MonkeyPatch) -> None:
    """As it has no other rest; to find that out would take longer than the flow."""
    scene, wanted = (
        grain_on_bed(),
        Load([0.3, 0.0, 0.0], np.zeros(3), [0.0, -1.0, 0.0], np.zeros(3)),
    )
    monkeypatch.setattr("incipient.evaluation.contact_verdict.follow", None)
    assert followed_in(scene, wanted) is None


def test_what_contacts_hold_is_held_up_to_the_safety_factor() -> None:
    """A box tips over its edge where the moment of weight, b/2, is that of the force, h/2 s F."""
    found = followed(Rectangle(0.8, 0.4), (2.5, 0.0), 0.0, 5.0, Flat(0.0))
    assert found.critical == pytest.approx(0.8, rel=1e-6)
    assert len(found.rests) == 1
    assert found.mode == "pivoting"


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
    assert scene.placement is not None
    down = scene.gravity_direction
    load = Load([0.05, 0.0, 0.01], [0.0, 0.012, 0.0], down, np.asarray(scene.placement.centre))
    return scene, load


def test_a_pebble_that_rocks_is_held_as_well_as_one_that_has_rocked() -> None:
    """It lies on two of the bed's spheres while the bed is level, on a third one, too, where it slopes by a degree."""
    scene, load = pebble(1.0)
    on_three = safety_factor(load, find_contacts(scene), 0.6)
    assert (len(find_contacts(scene)), on_three.status) == (3, SafetyStatus.CRITICAL)
    factors = []
    for slope in (0.0, 0.3):
        scene, load = pebble(slope)
        assert safety_factor(load, find_contacts(scene), 0.6).status is SafetyStatus.NO_RESERVE
        found = followed_in(scene, load)
        assert found is not None
        assert [len(rest.contacts) for rest in found.rests] == [2, 3]
        factors.append(found.critical)
    # Downhill the weight's pull grows in proportion to the slope, and the factor falls nearly in a line.
    assert factors[0] > factors[1] > on_three.value
    assert factors[0] - factors[1] == pytest.approx(0.3 * (factors[0] - on_three.value), rel=0.1)
    assert factors[0] == pytest.approx(on_three.value, rel=0.02)


def test_what_only_rocks_is_not_said_to_begin_to_move() -> None:
    scene, load = pebble(0.0)
    inert = mass_and_inertia(scene.body, scene.placement)
    said = judge(load, find_contacts(scene), 0.6, inert).to_dict()
    assert may_rock(said)
    rocking = followed_in(scene, load)
    assert rocking is not None
    told = with_rocking(said, rocking)
    assert (told["moves"], told["mode"], told["safety_status"]) == (False, ROCKS, "ROCKS")
    assert told["safety_factor"] == rocking.critical
    first = told["sentence"].partition(";")[0]
    assert first.startswith("the grain rocks to another rest, turned by ")
    assert "begins to move" not in first
    assert "body.orientation = [" in told["note"]
    assert told["judges"] == said["judges"]
    box = SafetyBar(0.0, 0.0, 0.0, True, ("rolling",), True, "gap", None, None)
    bar = bar_with_rocking(box, rocking.critical, ROCKS, 0.05, rocking.drift(rocking.last))
    assert (bar.certain, bar.complete, bar.modes) == (False, False, (ROCKS,))
    assert bar.low < rocking.critical < bar.high
    assert bar.sentence().startswith("likely, but not proved: safety factor")
    assert not may_rock(judge(load, find_contacts(pebble(1.0)[0]), 0.6, inert).to_dict())
    assert OTHER_CONTACTS in told["note"]
    # Contacts that hold it up to a part of the load open: it moves, as its threshold says.
    scene, load = pebble(1.0)
    strong = replace(load, flow_force=20.0 * load.flow_force, flow_couple=20.0 * load.flow_couple)
    moved = judge(strong, find_contacts(scene), 0.6, inert).to_dict()
    assert (moved["moves"], moved["safety_status"], may_rock(moved)) == (True, "CRITICAL", False)


def test_what_leaves_its_pocket_begins_to_move() -> None:
    scene, load = pebble(0.0)
    strong = Load(20.0 * load.flow_force, 20.0 * load.flow_couple, load.weight, load.centre)
    rocking = followed_in(scene, strong)
    assert rocking is not None
    assert rocking.leaves
    assert rocking.sentence.startswith(
        "the grain begins to move (pivoting), having rocked, turned by "
    )
    weak = followed_in(scene, load)
    assert weak is not None
    assert 20.0 * rocking.critical == pytest.approx(weak.critical, rel=1e-4)


def test_times_and_histories_of_a_grain_that_rocks_are_those_of_its_first_pose() -> None:
    """What is said of a grain held in time that would move: whether it leaves its pocket, and how that was judged."""
    at = Decision(EffectName.FREE_BODY, False, "")

    def said(**verdict: object) -> list[str]:
        return [one.how for one in FreeBodyEffect().left_out(Solved(None, None, None, verdict), at)]  # type: ignore[arg-type]

    assert said(first_motion=None, rocking=None) == []
    assert said(first_motion=0.1, rocking=None) == ["the grain moves from t = 0.1 on, but was held"]
    pose = "; this time and the history are judged in the first pose"
    assert said(first_motion=0.1, rocking={"leaves": False}) == [
        f"the grain rocks from t = 0.1 on, but was held{pose}"
    ]
    assert said(first_motion=0.1, rocking={"leaves": True}) == [
        f"the grain moves from t = 0.1 on, but was held{pose}"
    ]
