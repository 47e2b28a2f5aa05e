"""Finding the critical flow: the load between flows, the search on loads that are known, and what a threshold needs."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from scipy.optimize import brentq

from incipient.contact import Load
from incipient.contact.safety import safety_factor
from incipient.critical.bars import CriticalBars, CriticalGoal
from incipient.critical.loadpath import LoadPath
from incipient.critical.outcome import with_error
from incipient.critical.search import CriticalSearch, Found
from incipient.critical.threshold import find_threshold
from incipient.effects.effect import SlowestFlow
from incipient.effects.turbulence.models import BY_SWEEP
from incipient.errors import ConvergenceError, SceneError
from incipient.evaluation.contact_verdict import find_contacts
from incipient.geometry.closest import touching
from incipient.geometry.placement import Placement
from incipient.geometry.space.beds import SphereBed
from incipient.geometry.space.grains import Sphere
from incipient.planning.flow_setup import Setup
from incipient.progress import Silent
from incipient.results.errorbars import ErrorBars
from incipient.results.loads import Couples, Forces
from incipient.scene import loads
from incipient.scene.example import commented, grain_on_bed

POCKET = ("bed.kind=half-discs", "bed.radius=0.5", "bed.spacing=1.2", "bed.offset=1.0")
# Forces over the factor of the flow: along the stream, and pressing the grain into its pocket.
DRAG, PRESS = np.array([1.0, 0.5, 0, 0, 0, -0.15]), np.array([0.0, -1.0, 0, 0, 0, 0])


def scene(*overrides: str):
    return loads(commented(grain_on_bed()), overrides=overrides)


class Pretended:
    """A simulation of the disc in a pocket, whose load is known; no flow is found beyond `limit`."""

    def __init__(
        self, load: Callable[[float], np.ndarray], limit: float = np.inf, reynolds: float = 20.0
    ):
        self.scene = scene(*POCKET)
        self.contacts = find_contacts(self.scene)
        self.plan = SimpleNamespace(
            has=lambda name: True, reynolds=20.0, numbers=SimpleNamespace(grain_reynolds=reynolds)
        )
        self.fluid = SimpleNamespace(
            reynolds=0.0, state=SimpleNamespace(x=SimpleNamespace(array=np.zeros(1)))
        )
        self.setup, self.states = SimpleNamespace(is_averaged=False), [self.fluid.state]
        self.voice, self.load, self.limit = Silent(), load, limit
        self.comm, self.tried = MPI.COMM_SELF, list[float]()

    def loads_at(self, run: Any, factor: float, start: float) -> tuple[Forces, Couples]:
        if factor not in (self.limit, *self.tried):
            self.tried.append(factor)
        self.fluid.reynolds = min(factor, self.limit) * self.plan.reynolds
        if factor > self.limit:
            raise ConvergenceError("no steady flow")
        flow, gravity = factor * self.load(factor), np.array([0.0, -1.0, 0.0])
        weight, buoyancy = 2.65 * 2.5 * np.pi * gravity, -2.5 * np.pi * gravity
        couple = Couples(flow[3:], flow[3:], np.zeros(3))
        return Forces(flow[:3], flow[:3], buoyancy, weight), couple

    def safety(self, factor: float) -> float:
        flow = factor * self.load(factor)
        weight = np.array([0.0, -1.65 * 2.5 * np.pi, 0.0])
        centre = np.array([*self.scene.placement.centre, 0.0])
        return safety_factor(Load(flow[:3], flow[3:], weight, centre), self.contacts, 0.5).value

    def from_rest(self) -> Found:
        return self.search().from_rest()

    def search(self) -> CriticalSearch:
        return CriticalSearch(self, self.loads_at)  # type: ignore[arg-type]

    def first_loss(self, to: float) -> float:
        """The slowest flow that moves the grain, by looking at many."""
        factors = np.geomspace(1e-3 * to, to, 100)
        lost = next(i for i, factor in enumerate(factors) if self.safety(factor) < 1.0)

        def excess(factor: float) -> float:
            return float(np.clip(self.safety(factor), 0.0, 2.0)) - 1.0

        return float(brentq(excess, factors[lost - 1], factors[lost], rtol=1e-12))


@pytest.mark.parametrize("inertia", [0.0, 0.1, 1.0, 10.0])
def test_threshold_of_a_load_that_grows(inertia: float) -> None:
    """From a load in proportion to the flow to one that goes with its square."""
    pretended = Pretended(lambda f: DRAG * (0.3 + inertia * f))
    found = pretended.from_rest()
    assert found.factor == pytest.approx(pretended.first_loss(100.0), rel=1e-6)
    assert found.is_critical and found.held_to == found.factor
    assert len(found.trials) <= 5


def test_threshold_of_a_load_that_turns_slowly() -> None:
    pretended = Pretended(lambda f: DRAG * (0.3 + np.sqrt(f)) + 0.2 * PRESS * np.log1p(3 * f))
    found = pretended.from_rest()
    assert found.factor == pytest.approx(pretended.first_loss(100.0), rel=1e-5)
    assert len(found.trials) <= 8


@pytest.mark.parametrize(("start", "first"), [(0.2, [0.2]), (20.0, [20.0, 1e-3])])
def test_a_search_of_a_mean_flow_begins_where_the_grain_is_held(
    monkeypatch: pytest.MonkeyPatch, start: float, first: list[float]
) -> None:
    """Where it is not held in the flow to start with the search begins with the slowest one."""
    bound, said = SlowestFlow(1e-3, "looked at", "", start, "five flows"), list[str]()
    effect = SimpleNamespace(slowest_flow=lambda setup: bound)
    monkeypatch.setattr("incipient.critical.search.EFFECTS", (effect,))
    pretended = Pretended(lambda f: DRAG * (0.3 + f))
    pretended.setup = SimpleNamespace(
        is_averaged=True, resolves_walls=True, geometry=SimpleNamespace(gdim=3)
    )
    monkeypatch.setattr(pretended.voice, "say", said.append)
    found = pretended.from_rest()
    assert said[0] == "five flows"
    assert [trial.factor for trial in found.trials[: len(first)]] == first
    assert found.factor == pytest.approx(pretended.first_loss(20.0), rel=1e-4)
    assert found.is_critical and len(found.trials) <= 4 + len(first)


def mean_flow(monkeypatch: pytest.MonkeyPatch, pretended: Pretended, bound: SlowestFlow) -> None:
    """Make a pretended simulation one of a mean flow in the plane, searched upwards from the slowest one."""
    effect = SimpleNamespace(slowest_flow=lambda setup: bound)
    monkeypatch.setattr("incipient.critical.search.EFFECTS", (effect,))
    pretended.setup = SimpleNamespace(
        is_averaged=True, resolves_walls=True, geometry=SimpleNamespace(gdim=2)
    )


def test_a_mean_flow_that_is_not_found_is_not_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is sought as a whole: what is left of it is no start, and the way from one to another is not gone in steps."""
    pretended, asked = Pretended(lambda f: 1e-3 * DRAG * (0.3 + f), limit=5.0), list[float]()
    mean_flow(monkeypatch, pretended, SlowestFlow(1e-3, "looked at", ""))

    def loads_at(run: Any, factor: float, start: float) -> tuple[Forces, Couples]:
        pretended.fluid.reynolds = (
            factor * pretended.plan.reynolds
        )  # as a mean flow takes it, before it is sought
        asked.append(factor)
        assert start != factor
        if factor > pretended.limit:
            raise ConvergenceError("no steady flow")
        return pretended.loads_at(run, factor, start)

    found = CriticalSearch(pretended, loads_at).from_rest()  # type: ignore[arg-type]
    assert len(asked) == len(set(asked))
    assert not found.is_critical and found.unsolved and 4.0 < found.held_to <= 5.0


def test_a_grain_that_moves_in_the_slowest_mean_flow_is_to_be_heavier(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pretended = Pretended(lambda f: 1e6 * DRAG)
    mean_flow(monkeypatch, pretended, SlowestFlow(1e-3, "looked at", BY_SWEEP))
    with pytest.raises(
        SceneError,
        match=r"moves in the slowest flow looked at.*heavier grain, or sweep fluid\.reynolds",
    ):
        pretended.from_rest()


def test_any_turbulent_flow_moves_a_disc_on_a_plane(monkeypatch: pytest.MonkeyPatch) -> None:
    """No weight helps: a couple about its only contact rolls it."""
    pretended = Pretended(lambda f: DRAG * f)
    pretended.scene = scene("bed.kind=flat")
    pretended.contacts = find_contacts(pretended.scene)
    mean_flow(monkeypatch, pretended, SlowestFlow(1e-3, "looked at", BY_SWEEP))
    found = pretended.from_rest()
    assert found.factor == 0.0 and found.reason == "any flow moves the grain"


def test_slow_flows_that_press_are_no_proof() -> None:
    """The grain is held in Stokes flow whatever its strength, and by its weight; with inertia it moves."""
    pretended = Pretended(lambda f: PRESS + f * DRAG)
    assert pretended.safety(1e-3) == np.inf
    found = pretended.from_rest()
    assert found.factor == pytest.approx(pretended.first_loss(100.0), rel=1e-6)


def test_a_fast_flow_that_presses_is_no_proof() -> None:
    """Held without limit in the flow of the scene, and not in slower ones: the first loss counts."""
    pretended = Pretended(lambda f: 300.0 * (DRAG + 4.0 * f * PRESS))
    assert pretended.safety(1.0) == np.inf
    found = pretended.from_rest()
    assert found.factor == pytest.approx(pretended.first_loss(1.0), rel=1e-6)
    assert found.factor < 0.1


def test_motion_between_flows_that_hold() -> None:
    """In a window of flows the grain moves: the search sees it although both flows solved first hold the grain."""
    pretended = Pretended(
        lambda f: DRAG * (0.1 + 16.0 * f * np.exp(-f)) + 2.0 * PRESS * f, reynolds=5.0
    )
    assert pretended.safety(1.5) < 1.0 < min(pretended.safety(0.5), pretended.safety(6.0))
    found = pretended.from_rest()
    assert found.trials[1].factor == pytest.approx(6.0)
    assert found.factor == pytest.approx(pretended.first_loss(6.0), rel=1e-5)


def test_a_failed_flow_is_a_bound() -> None:
    """The next step would be far too fast; the threshold lies below where no flow is found any more."""
    pretended = Pretended(lambda f: 3.0 * PRESS + DRAG * f**4 / 20.0, limit=3.2)
    exact = pretended.first_loss(3.2)
    found = pretended.from_rest()
    assert found.unsolved and min(found.unsolved) > pretended.limit > exact
    assert found.factor == pytest.approx(exact, rel=1e-4)


def test_a_first_flow_that_fails_lets_the_search_go_down() -> None:
    pretended = Pretended(
        lambda f: DRAG * (0.3 + 100.0 * f) + 30.0 * PRESS, limit=1.0, reynolds=5.0
    )
    found = pretended.from_rest()
    assert found.unsolved[0] > 1.0
    assert found.factor == pytest.approx(pretended.first_loss(1.0), rel=1e-5)


def test_held_as_far_as_flows_are_found() -> None:
    found = Pretended(lambda f: 0.05 * DRAG * (1.0 + f), limit=5.0).from_rest()
    assert found.factor == np.inf and not found.is_critical
    assert 4.5 < found.held_to <= 5.0 < min(found.unsolved)
    assert "no steady flow" in found.reason and "about 10" in found.reason


def test_none_is_said_only_of_what_was_looked_at() -> None:
    found = Pretended(lambda f: PRESS * (1.0 + f), reynolds=10.0).from_rest()
    assert found.factor == np.inf and found.held_to == pytest.approx(
        100.0
    )  # grain Reynolds number 1000
    assert len(found.trials) <= 8


def test_any_flow_moves_it_only_if_the_slowest_does() -> None:
    """A disc on a plane rolls under any couple; the load at the threshold is a weak one."""
    pretended = Pretended(lambda f: DRAG)
    pretended.scene = scene()
    pretended.contacts = find_contacts(pretended.scene)
    found = pretended.from_rest()
    assert found.factor == 0.0 and len(found.trials) == 1
    assert np.linalg.norm(found.load.flow_force) < np.linalg.norm(found.load.weight)


def test_the_same_search_on_another_mesh_needs_one_flow() -> None:
    """Where the load of the next mesh differs by a thousandth, the critical flow does, too."""
    before = Pretended(lambda f: DRAG * (0.3 + f)).from_rest()
    finer = Pretended(lambda f: 1.001 * DRAG * (0.3 + f))
    found = finer.search().near(before)
    assert found.factor == pytest.approx(finer.first_loss(100.0), rel=1e-6)
    assert len(found.trials) == 1


def path(factors: list[float], load: Callable[[float], np.ndarray]) -> LoadPath:
    pretended: Any = Pretended(load)
    centre = np.array([*pretended.scene.placement.centre, 0.0])
    rest = Load(np.zeros(3), np.zeros(3), np.array([0.0, -13.0, 0.0]), centre)
    return LoadPath(
        np.array(factors), np.array([load(f) for f in factors]), rest, pretended.contacts, 0.5
    )


def test_a_search_that_does_not_converge_names_no_critical_flow(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A load larger by a tenth has a threshold some percent away: one flow is not enough to be near it."""
    monkeypatch.setattr("incipient.critical.search.MOST_FLOWS", 1)
    before = Found(2.2, 2.2, path([1e-6, 1.0], lambda f: DRAG * (0.3 + f)), ())
    with pytest.raises(ConvergenceError, match="did not converge within 40 flows, the last two at"):
        Pretended(lambda f: 1.1 * DRAG * (0.3 + f)).search().near(before)


def test_loads_between_flows_are_those_of_a_parabola() -> None:
    given = path([1e-6, 1.0, 2.5], lambda f: DRAG * (1.0 + f + f**2))
    assert given.over_factor(1.7) == pytest.approx(DRAG * (1.0 + 1.7 + 1.7**2))


def test_rest_is_doubted_where_the_load_may_bend_that_far() -> None:
    """A change of the load is harmless where it is small, and not where it might hide a loss in between."""
    weak = path([1e-6, 1.0], lambda f: DRAG * (0.1 + f))
    strong = path([1e-6, 1.0], lambda f: 14.0 * DRAG * (1.0 - f))
    assert weak.loss(1e-6, 1.0) is None and weak.doubtful(1e-6, 1.0, 1.0) is None
    assert strong.loss(1e-6, 1.0) is None and strong.doubtful(1e-6, 1.0, 1.0) is not None


@pytest.mark.parametrize(
    ("value", "error", "told"),
    [
        (2.7573, 0.2539, "2.8 +- 0.3"),
        (2.7573, 0.0123, "2.757 +- 0.013"),
        (55.1455, 5.08, "55 +- 6"),
        (1234.0, 120.0, "1234 +- 120"),
        (0.00835538, 0.00077, "0.0084 +- 0.0008"),
        (2.7572768, None, "2.757"),
        (2.7572768, np.inf, "2.8 (error without bound)"),
        (2.7572768, 0.0, "2.75728"),
    ],
)
def test_no_more_digits_than_are_certain(value: float, error: float | None, told: str) -> None:
    assert with_error(value, error) == told


def test_bed_stress_of_exact_profiles() -> None:
    """Shear: nu rate; parabola of mean V over H: 6 nu V/H; half a parabola: 3 nu V/H."""
    shear = scene()
    assert Setup(shear).bed_stress() == pytest.approx(shear.viscosity * 1.0, rel=1e-9)
    for kind, factor in (("poiseuille", 6.0), ("open-channel", 3.0)):
        channel = scene(f"flow={{kind = '{kind}', velocity = 2.0}}")
        assert Setup(channel).bed_stress() == pytest.approx(
            factor * channel.viscosity * 2.0 / 20.0, rel=1e-5
        )


@pytest.mark.parametrize(
    ("flow", "power"),
    [("{kind = 'shear'}", 1), ("{kind = 'poiseuille'}", 1), ("{kind = 'log-law'}", 2)],
)
def test_bed_stress_of_a_faster_flow(flow: str, power: int) -> None:
    """A profile that keeps its shape: nu du/dz, in proportion; a log law three times as fast: (3 u*)^2."""
    setup = Setup(scene(f"flow={flow}"))
    assert setup.bed_stress(3.0) == pytest.approx(3.0**power * setup.bed_stress())
    assert (setup.bed_stress(0.0), setup.bed_stress(np.inf)) == (0.0, np.inf)


@pytest.mark.parametrize(
    ("override", "need"),
    [
        ("body.density=0.9", "a threshold needs a grain denser than the fluid"),
        ("gravity.acceleration=0.0", "a threshold needs gravity"),
        ("flow={kind = 'still'}", "a threshold needs a flow"),
        (
            "flow={kind = 'log-law'}",
            "a threshold needs a profile that keeps its shape as the flow grows",
        ),
        ("time={end = 1.0, step = 0.1}", "a threshold needs a steady flow"),
        ("numerics.accuracy=verdict", "numerics.accuracy: .* give"),
    ],
)
def test_what_a_threshold_needs(override: str, need: str) -> None:
    with pytest.raises(SceneError, match=need):
        find_threshold(scene(override), MPI.COMM_WORLD)


@pytest.mark.parametrize("halved", [True, False])
def test_goal_of_a_threshold_in_space(halved: bool) -> None:
    """By what the critical factor of a bead in a pocket changes with each component of the load, found anew."""
    height = np.sqrt(2.0 / 3.0)
    bed = SphereBed.array(0.5, 1.0, "triangular", (np.sqrt(1.0 / 12.0), 0.5), 0.0, np.pi / 2.0)
    centre = np.array([0.0, 0.0, height])
    contacts = touching(Sphere(1.0), Placement((0.0, 0.0, float(height))), bed, 1e-6)
    flow, weight = np.array([0.2, 0.0, 0.01, 0.0, 0.05, 0.0]), np.array([0.0, 0.0, -1.0])

    def critical(changed: np.ndarray) -> float:
        return safety_factor(Load(changed[:3], changed[3:], weight, centre), contacts, 0.5).value

    factor = critical(flow)
    path = LoadPath(
        np.ones(1), flow[None], Load(np.zeros(3), np.zeros(3), weight, centre), contacts, 0.5
    )
    (goal,) = CriticalGoal(Found(factor, factor, path, ()), 3, halved).goals(None, None)  # type: ignore[arg-type]
    step = 1e-5
    for place in (0, 2, 4) if halved else range(6):
        ahead, behind = (
            critical(flow + sign * step / factor * np.eye(6)[place]) for sign in (1.0, -1.0)
        )
        assert goal[place] == pytest.approx(
            np.log(ahead / behind) / (2.0 * step), rel=1e-3, abs=1e-3
        )
    assert goal[0] < 0.0 < -goal[4] and (not halved or not goal[[1, 3, 5]].any())


def test_the_parts_of_an_error_are_told_to_be_absolute_and_added() -> None:
    bars = CriticalBars(2.0, 1.5, 2.4, {"gap": 0.3, "domain": 0.2}, ErrorBars(()))
    assert bars.lines() == [
        "error bars          absolute errors of that multiple, added in full: gap 3.0e-01, domain 2.0e-01"
    ]
    assert CriticalBars(2.0, 2.0, 2.0, {}, ErrorBars(())).lines() == [
        "error bars          none is known"
    ]


def on_plane(inertia: float, limit: float = np.inf) -> Pretended:
    """An ellipse on a plane, which rocks, under a force along the stream."""
    along = np.array([1.0, 0, 0, 0, 0, 0])
    pretended = Pretended(lambda f: along * (0.3 + inertia * f), limit=limit)
    text = commented(grain_on_bed()).replace(
        'shape = "disc"', 'shape = "ellipse"\nsemi_axes = [0.5, 0.3]'
    )
    text = "\n".join(line for line in text.splitlines() if not line.startswith("diameter"))
    pretended.scene = loads(text, overrides=["body.settle=true", "contact.friction=0.8"])
    pretended.contacts = find_contacts(pretended.scene)
    return pretended


@pytest.mark.parametrize("inertia", [1.0, pytest.param(0.0, marks=pytest.mark.slow)])
def test_an_ellipse_that_rocks_on_a_plane_leaves_at_its_largest_slope(inertia: float) -> None:
    """Turned by t its centre is h = sqrt(a^2 sin^2 t + b^2 cos^2 t) high, its contact h' beside: force/weight = h'/h.

    That is (a^2 - b^2)/(2 a b) at most. By a force along the stream alone, in proportion to the flow or growing faster.
    """
    pretended = on_plane(inertia)
    found = pretended.from_rest()
    weight = float(np.linalg.norm(found.load.weight))

    def excess(factor: float) -> float:
        return factor * (0.3 + inertia * factor) / weight - 0.16 / 0.3

    assert found.rocking is not None
    assert found.rocking.mode == "rolling"
    assert found.is_critical and found.held_to == found.factor
    assert found.factor == pytest.approx(float(brentq(excess, 0.0, 100.0)), rel=0.01)
    assert len(found.trials) <= 6
    assert found.trials[-1].safety_factor == pytest.approx(1.0, rel=0.01)


def test_a_grain_that_rocks_where_no_steady_flow_is_found() -> None:
    """Its threshold, by force/weight = (a^2 - b^2)/(2 a b), is at some 2.5 times the flow; none is found beyond 1."""
    found = on_plane(1.0, limit=1.0).from_rest()
    assert not found.is_critical and found.rocking is not None and found.unsolved
    assert found.reason == "the grain rocks from rest to rest, and beyond no steady flow was found"
    assert found.held_to == 1.0
