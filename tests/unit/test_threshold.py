"""Finding the critical flow: the load between flows, the search on loads that are known, and what a threshold needs."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from scenes import POCKET
from scenes import on_bed as scene
from scipy.optimize import brentq
from turbulent import channel, grain

from incipient.contact import Load
from incipient.contact.safety import safety_factor
from incipient.effects.effect import SlowestFlow
from incipient.effects.turbulence import BY_SWEEP
from incipient.errors import ConvergenceError, SceneError
from incipient.evaluation.contact_verdict import find_contacts
from incipient.geometry.closest import touching
from incipient.geometry.placement import Placement
from incipient.geometry.space.beds import SphereBed
from incipient.geometry.space.grains import Sphere
from incipient.planning.flow_setup import Setup
from incipient.progress import Silent
from incipient.results.errorbars import ErrorBars
from incipient.results.loads import Forces, Torques
from incipient.scene import Disc, Flat, Fluid, Turbulence, loads
from incipient.scene.example import commented, grain_on_bed
from incipient.thresholds import meshes
from incipient.thresholds.bars import CriticalBars
from incipient.thresholds.critical import find_threshold
from incipient.thresholds.meshes import CriticalGoal
from incipient.thresholds.outcome import with_error
from incipient.thresholds.path import LoadPath
from incipient.thresholds.search import CriticalFlow, CriticalSearch, SolvedFlow

# Forces over the factor of the flow: along the stream, and pressing the grain into its pocket.
DRAG, PRESS = np.array([1.0, 0.5, 0, 0, 0, -0.15]), np.array([0.0, -1.0, 0, 0, 0, 0])


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

    def loads_at(self, run: Any, factor: float, start: float) -> tuple[Forces, Torques]:
        if factor not in (self.limit, *self.tried):
            self.tried.append(factor)
        self.fluid.reynolds = min(factor, self.limit) * self.plan.reynolds
        if factor > self.limit:
            raise ConvergenceError("no steady flow")
        flow, gravity = factor * self.load(factor), np.array([0.0, -1.0, 0.0])
        weight, buoyancy = 2.65 * 2.5 * np.pi * gravity, -2.5 * np.pi * gravity
        torque = Torques(flow[3:], flow[3:], np.zeros(3))
        return Forces(flow[:3], flow[:3], buoyancy, weight), torque

    def safety(self, factor: float) -> float:
        flow = factor * self.load(factor)
        weight = np.array([0.0, -1.65 * 2.5 * np.pi, 0.0])
        centre = np.array([*self.scene.placement.centre, 0.0])
        return safety_factor(Load(flow[:3], flow[3:], weight, centre), self.contacts, 0.5).value

    def from_rest(self) -> CriticalFlow:
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


@dataclass(frozen=True)
class Known:
    """A load by the factor, up to which factor its first loss is looked for, and what the search may take."""

    load: Callable[[float], np.ndarray]
    to: float
    flows: int = 40
    relative: float = 1e-5
    limit: float = np.inf
    reynolds: float = 20.0


KNOWN = {
    # From a load in proportion to the flow to one that goes with its square.
    "Stokes": Known(lambda f: 0.3 * DRAG, 100.0, flows=5),
    "inertia": Known(lambda f: DRAG * (0.3 + f), 100.0, flows=5, relative=1e-6),
    "more inertia": Known(lambda f: DRAG * (0.3 + 10.0 * f), 100.0, flows=5, relative=1e-6),
    "turns slowly": Known(
        lambda f: DRAG * (0.3 + np.sqrt(f)) + 0.2 * PRESS * np.log1p(3 * f), 100.0, flows=8
    ),
    # Held in Stokes flow of any strength; with inertia it moves.
    "slow flows press": Known(lambda f: PRESS + f * DRAG, 100.0),
    # Held without limit in the flow of the scene, and not in slower ones: the first loss counts.
    "a fast flow presses": Known(lambda f: 300.0 * (DRAG + 4.0 * f * PRESS), 1.0),
    # In a window of flows the grain moves, though both flows solved first hold it.
    "a window": Known(
        lambda f: DRAG * (0.1 + 16.0 * f * np.exp(-f)) + 2.0 * PRESS * f, 6.0, reynolds=5.0
    ),
    # The next step would be far too fast; the threshold lies below the first flow that fails.
    "a failed flow is a bound": Known(
        lambda f: 3.0 * PRESS + DRAG * f**4 / 20.0, 3.2, relative=1e-4, limit=3.2
    ),
    "the first flow fails": Known(
        lambda f: DRAG * (0.3 + 100.0 * f) + 30.0 * PRESS, 1.0, limit=1.0, reynolds=5.0
    ),
}


@pytest.mark.parametrize("known", KNOWN.values(), ids=KNOWN)
def test_threshold_of_a_known_load(known: Known) -> None:
    """Against the slowest of many flows whose load moves the grain."""
    pretended = Pretended(known.load, known.limit, known.reynolds)
    found = pretended.from_rest()
    assert found.factor == pytest.approx(pretended.first_loss(known.to), rel=known.relative)
    assert found.is_critical and found.held_to == found.factor
    assert len(found.trials) <= known.flows
    assert bool(found.unsolved) == (known.limit < np.inf)


def test_a_search_upwards_that_does_not_converge_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("incipient.thresholds.search.MOST_FLOWS", 2)
    found = Pretended(lambda f: DRAG * (0.3 + f)).from_rest()
    assert not found.is_critical and found.reason == "the search did not converge within 40 flows"


@pytest.mark.parametrize(("start", "first"), [(0.2, [0.2]), (20.0, [20.0, 1e-3])])
def test_a_search_of_a_mean_flow_begins_where_the_grain_is_held(
    monkeypatch: pytest.MonkeyPatch, start: float, first: list[float]
) -> None:
    """Where it is not held in the flow to start with the search begins with the slowest one."""
    bound, said = SlowestFlow(1e-3, "looked at", "", start, "five flows"), list[str]()
    monkeypatch.setattr("incipient.thresholds.search.slowest_flow", lambda setup: bound)
    pretended = Pretended(lambda f: DRAG * (0.3 + f))
    pretended.setup = SimpleNamespace(
        is_averaged=True,
        scene=SimpleNamespace(resolves_walls=True),
        geometry=SimpleNamespace(gdim=3),
    )
    monkeypatch.setattr(pretended.voice, "say", said.append)
    found = pretended.from_rest()
    assert said[0] == "five flows"
    assert [trial.factor for trial in found.trials[: len(first)]] == first
    assert found.factor == pytest.approx(pretended.first_loss(20.0), rel=1e-4)
    assert found.is_critical and len(found.trials) <= 4 + len(first)


def mean_flow(monkeypatch: pytest.MonkeyPatch, pretended: Pretended, bound: SlowestFlow) -> None:
    """Make a pretended simulation one of a mean flow in the plane, searched upwards from the slowest one."""
    monkeypatch.setattr("incipient.thresholds.search.slowest_flow", lambda setup: bound)
    pretended.setup = SimpleNamespace(
        is_averaged=True,
        scene=SimpleNamespace(resolves_walls=True),
        geometry=SimpleNamespace(gdim=2),
    )


def test_a_mean_flow_that_is_not_found_is_not_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is sought as a whole: what is left of it is no start, and the way from one to another is not gone in steps."""
    pretended, asked = Pretended(lambda f: 1e-3 * DRAG * (0.3 + f), limit=5.0), list[float]()
    mean_flow(monkeypatch, pretended, SlowestFlow(1e-3, "looked at", ""))

    def loads_at(run: Any, factor: float, start: float) -> tuple[Forces, Torques]:
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


@pytest.mark.parametrize("averaged", [False, True])
def test_any_flow_moves_a_disc_on_a_plane(monkeypatch: pytest.MonkeyPatch, averaged: bool) -> None:
    """It rolls under any torque about its only contact, whatever its weight; the load at the threshold is weak."""
    pretended = Pretended(lambda f: DRAG * f if averaged else DRAG)
    pretended.scene = scene("bed.kind=flat")
    pretended.contacts = find_contacts(pretended.scene)
    if averaged:
        mean_flow(monkeypatch, pretended, SlowestFlow(1e-3, "looked at", BY_SWEEP))
    found = pretended.from_rest()
    assert found.factor == 0.0 and found.reason == "any flow moves the grain"
    assert len(found.trials) == 1
    assert np.linalg.norm(found.load.flow_force) < np.linalg.norm(found.load.weight)


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
    monkeypatch.setattr("incipient.thresholds.search.MOST_FLOWS", 1)
    before = CriticalFlow(2.2, 2.2, path([1e-6, 1.0], lambda f: DRAG * (0.3 + f)), ())
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


@pytest.mark.parametrize(
    ("flow", "slope", "power"),
    [
        ("{kind = 'shear'}", 1.0, 1),
        ("{kind = 'poiseuille', velocity = 2.0}", 6.0 * 2.0 / 20.0, 1),
        ("{kind = 'open-channel', velocity = 2.0}", 3.0 * 2.0 / 20.0, 1),
        ("{kind = 'log-law'}", None, 2),
    ],
)
def test_bed_stress(flow: str, slope: float | None, power: int) -> None:
    """nu du/dz: of shear its rate, of a parabola of mean V over H 6 V/H, of half a parabola 3 V/H.

    A faster profile that keeps its shape has it in proportion; a log law three times as fast has (3 u*)^2.
    """
    flowing = scene(f"flow={flow}")
    setup = Setup(flowing)
    if slope is not None:
        assert setup.bed_stress() == pytest.approx(flowing.viscosity * slope, rel=1e-5)
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
    (goal,) = CriticalGoal(CriticalFlow(factor, factor, path, ()), 3, halved).goals(None, None)  # type: ignore[arg-type]
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


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_grain_that_rocks_where_no_steady_flow_is_found() -> None:
    """Its threshold, by force/weight = (a^2 - b^2)/(2 a b), is at some 2.5 times the flow; none is found beyond 1."""
    found = on_plane(1.0, limit=1.0).from_rest()
    assert not found.is_critical and found.rocking is not None and found.unsolved
    assert found.reason == "the grain rocks from rest to rest, and beyond no steady flow converged"
    assert found.held_to == 1.0


class OnMeshes:
    """Searches on meshes whose critical flow is a function of what they are made for, S going as its square."""

    def __init__(self, monkeypatch, critical):
        self.made_for, self.critical, self.trials = [], critical, []
        monkeypatch.setattr(meshes, "prepared", self._prepared)
        monkeypatch.setattr(meshes, "CriticalSearch", lambda run: self)

    def _prepared(self, scene, comm, accounts, voice, speed):
        self.made_for.append(speed)
        return nullcontext(SimpleNamespace())

    def from_rest(self):
        factor = self.critical(self.made_for[-1])
        path = SimpleNamespace(load=lambda at: load(1.0))
        return CriticalFlow(factor, factor, path, (SolvedFlow(12.0, 2.0),), reason="held")

    def near(self, before):
        assert before.factor == self.critical(self.made_for[-2])
        return self.from_rest()

    def load_at(self, factor):
        strength = (factor / self.critical(self.made_for[-1])) ** 2
        self.trials.append(SolvedFlow(factor, 1.0 / strength))
        return load(strength)

    def threshold(self, scene):
        return meshes.on_its_own_mesh(
            scene, MPI.COMM_SELF, Silent(), lambda run, search, found: found
        )


def load(strength):
    force, torque = np.array([1.0, 0.5, 0.0]), np.array([0.0, 0.0, 0.2])
    return Load(strength * force, strength * torque, np.zeros(3), np.zeros(3))


def test_the_mesh_is_made_anew_until_the_law_of_the_wall_is_its_own(monkeypatch):
    """On the second mesh the critical flow is 12% faster, as of a sphere between ridges; what is left is an error."""
    pretended = OnMeshes(monkeypatch, lambda speed: 1.24 + 0.34 * speed)
    found = pretended.threshold(grain(0.2))
    on_third = 1.24 + 0.34 * 1.7772
    assert pretended.made_for == pytest.approx([1.0, 1.58, 1.7772, on_third])
    assert found.factor == pytest.approx(on_third) and len(found.trials) == 3
    strength = (on_third / (1.24 + 0.34 * on_third)) ** 2
    assert found.own_mesh.safety_factor == pytest.approx(1.0 / strength)
    assert found.own_mesh.change == pytest.approx(
        (1.0 - strength) * np.array([1.0, 0.5, 0.0, 0.0, 0.0, 0.2])
    )


@pytest.mark.parametrize("critical", [1.02, float("inf")])
def test_one_mesh_does_where_the_law_of_the_wall_hardly_changes_or_none_is_critical(
    monkeypatch, critical
):
    """The second mesh is that of the critical flow itself; what faster flows hold on the first is doubted."""
    pretended = OnMeshes(monkeypatch, lambda speed: critical)
    found = pretended.threshold(grain(0.2))
    assert found.factor == critical
    if found.is_critical:
        assert pretended.made_for == [1.0, 1.02]
        assert found.own_mesh.safety_factor == 1.0 and not found.own_mesh.change.any()
    else:
        assert pretended.made_for == [1.0] and found.reason == f"held; {meshes.OTHER_MESH}"


def test_a_threshold_that_no_mesh_agrees_on_is_refused(monkeypatch):
    pretended = OnMeshes(monkeypatch, lambda speed: 2.0 / speed)
    with pytest.raises(
        ConvergenceError, match=r"does not converge over meshes.*: it is 2, 1, 2, .* smaller"
    ):
        pretended.threshold(grain(0.2))
    assert len(pretended.made_for) == meshes.MOST_MESHES


def test_a_mesh_serves_as_long_as_the_distance_of_the_law_does():
    """It is 50 nu/u* and goes nearly as the inverse of the flow, unless it or the sand is given."""
    smooth = grain(0.2)
    ratio = Setup(smooth).walls.nearest / Setup(smooth).faster(1.5).walls.nearest
    assert 1.4 < ratio < 1.5
    assert meshes.outgrown(Setup(smooth), 1.0, 1.5) and meshes.outgrown(Setup(smooth), 1.5, 1.0)
    assert not meshes.outgrown(Setup(smooth), 1.5, 1.52)
    for asked in (Turbulence(wall_distance=0.006), Turbulence(wall="rough", roughness=0.01)):
        given = channel(
            fluid=Fluid(reynolds=2e5, scale="flow"),
            body=Disc(diameter=0.2, x=4),
            bed=Flat(),
            turbulence=asked,
        )
        assert not meshes.outgrown(Setup(given), 1.0, 3.0)
