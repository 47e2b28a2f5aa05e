"""Searches for critical flows."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from operator import attrgetter
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest
from domains import rectangle
from mpi4py import MPI
from scenes import POCKET, SCENES, grain_in_pocket, grain_on_bed, on_bed
from scenes import on_bed as scene
from turbulent import grain

from incipient.accuracy.coarse_runs import changed, comparisons
from incipient.accuracy.dual import LARGEST, SMALLEST, Shares, resized
from incipient.accuracy.first_mesh import Attempt, first_attempt, rescaled
from incipient.accuracy.goal import Goal
from incipient.accuracy.search import AIM, SMALLEST_GAP, Estimate, Search, lessened
from incipient.accuracy.searches import (
    COMPARED,
    Compared,
    DualWeighted,
)
from incipient.arrays import spatial
from incipient.contact import Load
from incipient.contact.safety import safety_factor
from incipient.errors import ConvergenceError, SceneError
from incipient.meshes import Near, Sizes
from incipient.meshes.model import grid_cells
from incipient.planning.meshing import STEEPEST
from incipient.progress import Silent
from incipient.results.accuracy import Trial
from incipient.results.errorbars import NO_GRAIN, Loads, Term
from incipient.scene import Scene, Turbulence, loads
from incipient.scene import load as scene_load
from incipient.scene.file import example
from incipient.setup.setup import Setup
from incipient.simulation.state import Recorder
from incipient.thresholds import meshes
from incipient.thresholds.critical import find_threshold
from incipient.thresholds.outcome import SolvedFlow, with_range
from incipient.thresholds.search import EXPECTED, CriticalFlow, CriticalSearch

# Finding the critical flow: the load between flows, the search on loads that are known, and what a threshold needs.


# Forces over the factor of the flow: along the stream, and pressing the grain into its pocket.
DRAG, PRESS = np.array([1.0, 0.5, 0, 0, 0, -0.15]), np.array([0.0, -1.0, 0, 0, 0, 0])
BACK = np.array([-1.0, 0.5, 0, 0, 0, 0.15])


class Pretended:
    """A simulation of the disc in a pocket, whose load is known; no flow is found beyond `limit`."""

    def __init__(
        self, load: Callable[[float], np.ndarray], limit: float = np.inf, reynolds: float = 20.0
    ):
        self.scene = scene(*POCKET)
        self.contacts = Setup(self.scene).contacts
        self.plan = SimpleNamespace(
            has=lambda name: True, reynolds=20.0, numbers=SimpleNamespace(grain_reynolds=reynolds)
        )
        self.fluid = SimpleNamespace(
            reynolds=0.0, state=SimpleNamespace(x=SimpleNamespace(array=np.zeros(1)))
        )
        self.setup, self.states = SimpleNamespace(scene=self.scene), [self.fluid.state]
        self.voice, self.load, self.limit = Silent(), load, limit
        self.comm = MPI.COMM_SELF

    def loads_at(self, run: Any, factor: float, start: float) -> np.ndarray:
        self.fluid.reynolds = min(factor, self.limit) * self.plan.reynolds
        if factor > self.limit:
            raise ConvergenceError("no steady flow")
        return self.flows(factor)

    def flows(self, factor: float) -> np.ndarray:
        """Loads (instants, 6), in a steady flow of one instant."""
        return factor * np.atleast_2d(self.load(factor))

    def from_rest(self) -> CriticalFlow:
        return self.search().from_rest()

    def search(self) -> CriticalSearch:
        return CriticalSearch(self, self.loads_at)  # type: ignore[arg-type]


@dataclass(frozen=True)
class Known:
    """A load by the factor, the slowest flow that moves the grain, and what the search may take."""

    load: Callable[[float], np.ndarray]
    factor: float
    flows: int = 40
    relative: float = 1e-5
    limit: float = np.inf
    reynolds: float = 20.0


# A DRAG + B PRESS turn the disc about its contact downstream, (0.3, -0.4) from its centre, once 0.7 A > 0.3 (W + B),
# with W = 1.65 2.5 pi. Factors solve that, the first ones of as many.
KNOWN = {
    # From a load in proportion to the flow to one that goes with its square.
    "Stokes": Known(lambda f: 0.3 * DRAG, 18.5129567087, flows=5),
    "inertia": Known(lambda f: DRAG * (0.3 + f), 2.2114374886, flows=5, relative=1e-6),
    "more inertia": Known(lambda f: DRAG * (0.3 + 10.0 * f), 0.7303949968, flows=5, relative=1e-6),
    "turns slowly": Known(
        lambda f: DRAG * (0.3 + np.sqrt(f)) + 0.2 * PRESS * np.log1p(3 * f), 3.0189646967, flows=8
    ),
    # Held in Stokes flow of any strength; with inertia it moves.
    "slow flows press": Known(lambda f: PRESS + f * DRAG, 2.5806765062),
    # Held without limit in the flow of the scene, and not in slower ones: the first loss counts.
    "a fast flow presses": Known(lambda f: 300.0 * (DRAG + 4.0 * f * PRESS), 0.0191410354),
    # In a window of flows the grain moves, though both flows solved first hold it.
    "a window": Known(
        lambda f: DRAG * (0.1 + 16.0 * f * np.exp(-f)) + 2.0 * PRESS * f, 1.1106402428, reynolds=5.0
    ),
    # Slow flows demand most on the way back, fast ones on the way forth.
    "to and fro": Known(
        lambda f: 2.1 * np.array([DRAG * (0.5 + f), BACK * (0.52 + 0.985 * f), 0.1 * DRAG]),
        1.3953595669,
        flows=4,
    ),
    # The next step would be far too fast; the threshold lies below the first flow that fails.
    "a failed flow is a bound": Known(
        lambda f: 3.0 * PRESS + DRAG * f**4 / 20.0, 2.8378373123, relative=1e-4, limit=3.2
    ),
    "the first flow fails": Known(
        lambda f: DRAG * (0.3 + 100.0 * f) + 30.0 * PRESS, 0.3066728112, limit=1.0, reynolds=5.0
    ),
}


@pytest.mark.parametrize("known", KNOWN.values(), ids=KNOWN)
def test_threshold_of_a_known_load(known: Known) -> None:
    result = Pretended(known.load, known.limit, known.reynolds).from_rest()
    assert result.factor == pytest.approx(known.factor, rel=known.relative)
    assert result.is_critical and result.held_to == result.factor
    assert len(result.trials) <= known.flows
    assert bool(result.unsolved) == (known.limit < np.inf)


def test_a_search_that_does_not_converge_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """From rest, and where a load larger by a tenth has a threshold some percent away from that of another mesh."""
    before = Pretended(lambda f: DRAG * (0.3 + f)).from_rest()
    monkeypatch.setattr("incipient.thresholds.search.MOST_FLOWS", 1)
    flow = Pretended(lambda f: DRAG * (0.3 + f)).from_rest()
    assert not flow.is_critical and flow.reason == "the search did not converge within 40 flows"
    with pytest.raises(ConvergenceError, match="did not converge within 40 flows, the last two at"):
        Pretended(lambda f: 1.1 * DRAG * (0.3 + f)).search().near(before)


def mean_flow(
    monkeypatch: pytest.MonkeyPatch, pretended: Pretended, slowest: float, start: float, gdim: int
) -> None:
    """Make a pretended simulation one of a mean flow, searched upwards from the slowest one or from `start`."""
    bound = slowest, start
    monkeypatch.setattr("incipient.thresholds.search.slowest_flow", lambda setup: bound)
    pretended.setup = SimpleNamespace(
        scene=SimpleNamespace(is_averaged=True, resolves_walls=True, gdim=gdim)
    )


@pytest.mark.parametrize(("start", "first"), [(0.2, [0.2]), (20.0, [20.0, 1e-3])])
def test_a_search_of_a_mean_flow_begins_where_the_grain_is_held(
    monkeypatch: pytest.MonkeyPatch, start: float, first: list[float]
) -> None:
    """Where it is not held in the flow to start with the search begins with the slowest one."""
    pretended, said = Pretended(lambda f: DRAG * (0.3 + f)), list[str]()
    mean_flow(monkeypatch, pretended, 1e-3, start, gdim=3)
    monkeypatch.setattr(pretended.voice, "say", said.append)
    flow = pretended.from_rest()
    assert said[0] == EXPECTED
    assert [trial.factor for trial in flow.trials[: len(first)]] == first
    assert flow.factor == pytest.approx(KNOWN["inertia"].factor, rel=1e-4)
    assert flow.is_critical and len(flow.trials) <= 4 + len(first)


def test_a_grain_that_moves_in_the_slowest_mean_flow_is_to_be_heavier(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pretended = Pretended(lambda f: 1e6 * DRAG)
    mean_flow(monkeypatch, pretended, 1e-3, 0.0, gdim=2)
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
    pretended.contacts = Setup(pretended.scene).contacts
    if averaged:
        mean_flow(monkeypatch, pretended, 1e-3, 0.0, gdim=2)
    result = pretended.from_rest()
    assert result.factor == 0.0 and result.reason == "any flow moves the grain"
    assert len(result.trials) == 1
    weak = np.linalg.norm(result.load.flow_force)
    assert weak == pytest.approx(0.1 * np.linalg.norm(result.load.weight))


@pytest.mark.parametrize(("settle", "remedy"), [(False, "body.settle = true"), (True, "bed.slope")])
def test_a_grain_without_rest_is_told_what_it_lacks(settle: bool, remedy: str) -> None:
    """A disc on an inclined plane rolls by its weight; one that has settled, on the level, is not told to settle."""
    pretended = Pretended(lambda f: DRAG)
    pretended.scene = scene("bed.kind=inclined", "bed.slope=10")
    pretended.contacts = Setup(pretended.scene).contacts
    settled = pretended.scene.body.model_copy(update={"settle": settle})
    pretended.scene = pretended.scene.model_copy(update={"body": settled})
    result = pretended.from_rest()
    assert result.factor == 0.0
    assert result.reason.startswith("the grain moves without any flow")
    assert remedy in result.reason


def test_held_as_far_as_flows_are_found() -> None:
    result = Pretended(lambda f: 0.05 * DRAG * (1.0 + f), limit=5.0).from_rest()
    assert result.factor == np.inf and not result.is_critical
    assert 4.5 < result.held_to <= 5.0 < min(result.unsolved)
    assert "no steady flow" in result.reason and "about 10" in result.reason


def test_none_is_said_only_of_what_was_looked_at() -> None:
    result = Pretended(lambda f: PRESS * (1.0 + f), reynolds=10.0).from_rest()
    assert result.factor == np.inf and result.held_to == pytest.approx(
        100.0
    )  # grain Reynolds number 1000
    assert len(result.trials) <= 8


def test_the_same_search_on_another_mesh_needs_one_flow() -> None:
    """Where the load of the next mesh differs by a thousandth, the critical flow does, too."""
    before = Pretended(lambda f: DRAG * (0.3 + f)).from_rest()
    result = Pretended(lambda f: 1.001 * DRAG * (0.3 + f)).search().near(before)
    # Of moments as in `KNOWN`.
    assert result.factor == pytest.approx(2.2102624163, rel=1e-6)
    assert len(result.trials) == 1


@pytest.mark.parametrize(
    ("value", "ends", "told"),
    [
        (2.7573, (2.6034, 3.1112), "2.76 (2.60 to 3.12)"),
        (2.7573, (2.745, 2.7696), "2.757 (2.745 to 2.770)"),
        (1234.0, (1114.3, 1354.2), "1234 (1114 to 1355)"),
        (0.00835538, (0.0, 0.00912), "0.0084 (0.0000 to 0.0092)"),
        (2.7572768, None, "2.757"),
        (2.7572768, (0.0, np.inf), "2.8 (error without bound)"),
        (2.7572768, (2.6034, np.inf), "2.76 (2.60 or more)"),
        (2.7572768, (2.7572768, 2.7572768), "2.75728"),
        (2.7572768, (2.7572768, np.inf), "2.75728 or more"),
    ],
)
def test_no_more_digits_than_are_certain(
    value: float, ends: tuple[float, float] | None, told: str
) -> None:
    assert with_range(value, ends) == told


@pytest.mark.parametrize(
    ("override", "need"),
    [
        ("body.density=0.9", "a threshold needs a grain denser than the fluid"),
        ("gravity.acceleration=0.0", "a threshold needs gravity"),
        ("flow={kind = 'still'}", "a threshold needs a fluid that is not at rest"),
        (
            "flow={kind = 'log-law'}",
            "profile that keeps its shape as the flow grows, unlike a log-law; sweep fluid.reynolds",
        ),
        ("time={end = 1.0, step = 0.1}", "a threshold needs a steady flow"),
        ("numerics.accuracy=verdict", "numerics.accuracy: .* give"),
        (
            "numerics={accuracy=0.01, accuracy_includes='all'}",
            r"numerics\.accuracy_includes: .*leave it out",
        ),
    ],
)
def test_what_a_threshold_needs(override: str, need: str) -> None:
    with pytest.raises(SceneError, match=need):
        find_threshold(scene(override), MPI.COMM_WORLD)


SPHERE_IN_SI = """
domain = {length = 8.0, width = 6.0, height = 4.0}
fluid = {scale = "grain"}
flow = {kind = "log-law"}
body = {shape = "sphere", diameter = 1.0, x = 4.0}
bed = {kind = "flat"}
contact = {friction = 0.5}
units = {diameter = 1e-3, velocity = 0.05}
"""


def test_a_threshold_names_keys_that_the_scene_may_have() -> None:
    """Of a flow in SI units the Reynolds number is not one of them; three periods of 25 are 75."""
    with pytest.raises(SceneError, match=r"sweep units\.velocity instead"):
        find_threshold(loads(SPHERE_IN_SI), MPI.COMM_WORLD)
    waves = ["flow={kind = 'oscillatory', period = 25.0}", "time={end = 50.0, step = 0.5}"]
    with pytest.raises(SceneError, match=r"3 or more periods \(time\.end = 75 or later\)"):
        find_threshold(scene(*waves), MPI.COMM_WORLD)


def on_plane(inertia: float, limit: float = np.inf) -> Pretended:
    """An ellipse on a plane, which rocks, under a force along the stream."""
    along = np.array([1.0, 0, 0, 0, 0, 0])
    pretended = Pretended(lambda f: along * (0.3 + inertia * f), limit=limit)
    text = example().replace('shape = "disc"', 'shape = "ellipse"\nsemi_axes = [0.5, 0.3]')
    text = "\n".join(line for line in text.splitlines() if not line.startswith("diameter"))
    pretended.scene = loads(text, overrides=["body.settle=true", "contact.friction=0.8"])
    pretended.contacts = Setup(pretended.scene).contacts
    return pretended


@pytest.mark.slow
@pytest.mark.parametrize(("inertia", "factor"), [(1.0, 1.8919114), (0.0, 13.8230077)])
def test_an_ellipse_that_rocks_on_a_plane_leaves_at_its_largest_slope(
    inertia: float, factor: float
) -> None:
    """Turned by t its centre is h = sqrt(a^2 sin^2 t + b^2 cos^2 t) high, its contact h' beside: force/weight = h'/h.

    That is (a^2 - b^2)/(2 a b) at most. By a force along the stream alone, in proportion to the flow or growing faster:
    s (0.3 + inertia s) = 0.16/0.3 W, with the weight W = 1.65 0.15 pi 10.
    """
    result = on_plane(inertia).from_rest()
    assert result.rocking.mode == "rolling"
    assert result.is_critical and result.held_to == result.factor
    assert result.factor == pytest.approx(factor, rel=0.01)
    assert len(result.trials) <= 6
    assert result.trials[-1].safety_factor == pytest.approx(1.0, rel=0.01)


@pytest.mark.slow
def test_a_grain_that_rocks_where_no_steady_flow_is_found() -> None:
    """Its threshold, by force/weight = (a^2 - b^2)/(2 a b), is at some 2.5 times the flow; none is found beyond 1."""
    result = on_plane(1.0, limit=1.0).from_rest()
    assert not result.is_critical and result.rocking is not None and result.unsolved
    assert result.reason == "the grain rocks from rest to rest, and beyond no steady flow converged"
    assert result.held_to == 1.0


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
        return CriticalFlow(factor, factor, (SolvedFlow(12.0, 2.0),), (), "held", path)

    def near(self, before):
        assert before.factor == self.critical(self.made_for[-2])
        return self.from_rest()

    def load_at(self, factor):
        strength = (factor / self.critical(self.made_for[-1])) ** 2
        self.trials.append(SolvedFlow(factor, 1.0 / strength))
        return load(strength)

    def threshold(self, scene):
        return meshes.on_its_own_mesh(
            scene, MPI.COMM_SELF, Silent(), lambda run, search, result: result
        )


def load(strength):
    force, torque = np.array([1.0, 0.5, 0.0]), np.array([0.0, 0.0, 0.2])
    return Load(strength * force, strength * torque, np.zeros(3), np.zeros(3))


def test_the_mesh_is_made_anew_until_the_law_of_the_wall_is_its_own(monkeypatch):
    """On the second mesh the critical flow is 12% faster, as of a sphere between ridges; what is left is an error."""
    pretended = OnMeshes(monkeypatch, lambda speed: 1.24 + 0.34 * speed)
    result = pretended.threshold(grain(0.2))
    on_third = 1.24 + 0.34 * 1.7772
    assert pretended.made_for == pytest.approx([1.0, 1.58, 1.7772, on_third])
    assert result.factor == pytest.approx(on_third) and len(result.trials) == 3
    strength = (on_third / (1.24 + 0.34 * on_third)) ** 2
    assert result.own_mesh.safety_factor == pytest.approx(1.0 / strength)
    assert result.own_mesh.change == pytest.approx(
        (1.0 - strength) * np.array([1.0, 0.5, 0.0, 0.0, 0.0, 0.2])
    )


@pytest.mark.parametrize(
    ("critical", "speeds", "reason"),
    [
        # The second mesh is that of the critical flow itself.
        (1.02, [1.0, 1.02], "held"),
        # What faster flows hold on the first mesh is doubted.
        (float("inf"), [1.0], f"held; {meshes.OTHER_MESH}"),
    ],
)
def test_one_mesh_does_where_the_law_of_the_wall_hardly_changes_or_none_is_critical(
    monkeypatch, critical, speeds, reason
):
    pretended = OnMeshes(monkeypatch, lambda speed: critical)
    flow = pretended.threshold(grain(0.2))
    assert (flow.factor, flow.reason, pretended.made_for) == (critical, reason, speeds)
    own = flow.own_mesh
    assert own is None or (own.safety_factor == 1.0 and not own.change.any())


def test_a_threshold_that_no_mesh_agrees_on_is_refused(monkeypatch):
    pretended = OnMeshes(monkeypatch, lambda speed: 2.0 / speed)
    with pytest.raises(
        ConvergenceError, match=r"does not converge over meshes.*: it is 2, 1, 2, .* smaller"
    ):
        pretended.threshold(grain(0.2))
    assert len(pretended.made_for) == meshes.MOST_MESHES


@pytest.mark.parametrize(
    "asked", [Turbulence(wall_distance=0.006), Turbulence(wall="rough", roughness=0.01)]
)
def test_a_mesh_serves_all_flows_if_the_distance_of_the_law_or_the_roughness_is_given(asked):
    scene = grain(0.2).model_copy(update={"turbulence": asked})
    assert not meshes.outgrown(Setup(scene), 1.0, 3.0)


# Searches for an accuracy: cells and order from estimated errors, the least work in time, the loop, and its budget.


INERTIA = ("fluid.reynolds=20", "fluid.inertia=true")


def grid(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Points and triangles of the unit square, n cells along a side."""
    square = grid_cells(rectangle((0.0, 0.0), 1.0, 1.0, n, n))
    return square.points, square.cells


@pytest.mark.parametrize(("relative", "factor"), [(1 / 16, 0.5), (1e9, LARGEST)])
def test_equal_shares_change_all_cells_alike(relative: float, factor: float) -> None:
    """Errors that go as h^(2k) fall sixteen times when cells of order two are halved; cells grow to a bound only."""
    points, triangles = grid(10)
    shares = Shares(points, triangles, np.ones(len(points)))
    assert shares.sizes == pytest.approx(0.1 * np.sqrt(2 / np.sqrt(3)))
    field, more = resized(shares, order=2, relative=relative, comm=MPI.COMM_SELF)
    assert field.sizes == pytest.approx(factor * shares.sizes, rel=1e-6)
    assert more == pytest.approx(factor**-2, rel=1e-6)


def test_sizes_follow_the_shares_within_bounds() -> None:
    points, triangles = grid(40)
    errors = np.exp(-20.0 * np.hypot(*(points - 0.5).T))
    shares = Shares(points, triangles, errors)
    field, _ = resized(shares, order=2, relative=0.1, comm=MPI.COMM_SELF)
    factors = field.sizes / shares.sizes
    assert factors.min() == pytest.approx(factors[np.argmax(errors)])
    assert factors.min() >= SMALLEST - 1e-12 and factors.max() <= LARGEST + 1e-12
    a, b = triangles[:, 0], triangles[:, 1]
    growth = np.abs(np.diff(field.sizes[np.column_stack([a, b])]))[:, 0]
    assert np.all(growth <= STEEPEST * np.linalg.norm(points[a] - points[b], axis=1) + 1e-12)


def test_what_a_geometry_needs_is_not_coarsened() -> None:
    sizes = Sizes(
        1.0, (Near(0.1, 0.2, points=((0.0, 0.0),), needed=True), Near(0.3, 0.6, boundary="bed"))
    )
    coarse = sizes.coarsened(4.0, 0.5)
    assert coarse.far == 4.0
    assert [(near.size, near.growth) for near in coarse.near] == [(0.1, 0.5), (1.2, 0.6)]


@pytest.mark.parametrize(
    ("name", "key", "value"),
    [("gap", "contact.gap", 0.0025), ("domain", "domain.length", 48.0), ("domain", "domain.height", 40.0)],
)  # fmt: skip
def test_a_smaller_gap_or_a_larger_domain(name: str, key: str, value: float) -> None:
    """A term is lessened by the power with which it falls: a gap of a quarter, a domain twice as large."""
    less = lessened(grain_on_bed(), Term(name, np.zeros(6), ""), 0.25)
    assert attrgetter(key)(less) == pytest.approx(value)


@pytest.mark.parametrize(
    ("scene", "name"),
    [
        (on_bed(f"contact.gap={SMALLEST_GAP}"), "gap"),
        (on_bed("domain.kind=box", "flow={kind='lid'}"), "domain"),
        (on_bed(), "datum"),
    ],
)
def test_a_term_that_no_other_scene_lessens(scene: Scene, name: str) -> None:
    assert lessened(scene, Term(name, np.zeros(6), ""), 0.25) is None


# -- the quantity -----------------------------------------------------------------------------------


def wanting(**numerics: object) -> Scene:
    return changed(grain_on_bed(), numerics={"accuracy": 0.01, **numerics})


def force_and_torque(force: float, torque: float) -> Loads:
    return Loads(np.array([force, 0.0, 0.0, 0.0, 0.0, torque]))


@pytest.mark.parametrize(
    ("quantity", "torque", "error", "goals"),
    [
        ("force", -0.5, 0.025, [[0.5, 0, 0], [0, 0.5, 0]]),
        ("torque", -0.5, 0.02, [[0, 0, 2.0]]),
        # 1% of force times diameter stands for a torque that is smaller.
        ("torque", 0.0, 0.5, [[0, 0, 50.0]]),
    ],
)
def test_errors_and_goals_are_relative(
    quantity: str, torque: float, error: float, goals: list[list[float]]
) -> None:
    goal, computed = Goal.of(wanting(accuracy_of=quantity)), force_and_torque(2.0, torque)
    errors = np.array([0.03, 0.04, 0.0, 0.0, 0.0, 0.01])
    assert goal.error(computed, errors) == pytest.approx(error)
    assert np.allclose(goal.goals(computed), goals)


def test_range_of_the_safety_factor() -> None:
    """Within its error a small force may be none, which is held at any factor: the range has an infinite end."""
    scene = on_bed(*POCKET, "numerics.accuracy=0.01", "numerics.accuracy_of=safety factor")
    goal = Goal.of(scene)
    small, error = force_and_torque(0.1, 0.0), 0.01 * np.eye(6)[0]
    assert goal.error(small, error) == pytest.approx(1.0 / 0.9 - 1.0 / 1.1)
    assert goal.error(small, 10.0 * error) == np.inf
    # A critical flow whose load goes as its square changes by the root; its error is one-sided.
    critical = replace(goal, name="critical flow", power=2.0)
    slopes = [each.goals(force_and_torque(1.0, -0.1))[0] for each in (goal, critical)]
    assert slopes[1] == pytest.approx(0.5 * slopes[0])
    assert critical.error(small, error) == pytest.approx((1.0 / 0.9) ** 0.5 - 1.0)


@pytest.mark.parametrize("mirrored", [True, False])
def test_goal_of_a_threshold_in_space(monkeypatch: pytest.MonkeyPatch, mirrored: bool) -> None:
    """By what the critical factor of a sphere in a pocket changes with each component of the load, found anew."""
    sphere = grain_in_pocket()
    monkeypatch.setattr(Setup, "mirrored", mirrored)
    goal = Goal("critical flow", sphere, Setup(sphere).contacts, 1.0)
    flow, centre = np.array([1.0, 0.0, 0.05, 0.0, 0.25, 0.0]), spatial(sphere.placement.centre)
    weight = (sphere.mass - sphere.grain.volume) * spatial(sphere.gravity_vector)

    def critical(changed: np.ndarray) -> float:
        load = Load(changed[:3], changed[3:], weight, centre)
        return safety_factor(load, goal.contacts, sphere.contact.law).value

    (slope,), step = goal.goals(Loads(flow)), 1e-4
    for place in (0, 2, 4) if mirrored else range(6):
        ahead, behind = (critical(flow + sign * step * np.eye(6)[place]) for sign in (1.0, -1.0))
        expected = np.log(ahead / behind) / (2.0 * step)
        assert slope[place] == pytest.approx(expected, rel=1e-3, abs=1e-3)
    assert slope[0] < 0.0 and (not mirrored or not slope[[1, 3, 5]].any())


def searching(seconds: float = 1.0, **numerics: object) -> tuple[Search, Estimate]:
    """A search on its first mesh, which took a time [s] and has an error of 0.1, all of it shared alike."""
    scene = wanting(**{"accuracy": 1e-3, **numerics})
    search = DualWeighted(scene, MPI.COMM_SELF, Recorder(), Silent())
    search.report(Trial(2, 200, 1000, 0.1, seconds))
    points, triangles = grid(10)
    shares = Shares(points, triangles, np.full(len(points), 0.1 / len(points)))
    search._plain = 0.1
    return search, Estimate(0.1, shares=shares)


def following(search: Search, estimate: Estimate) -> Attempt | None:
    return search.within_budget(search.first(), estimate, search.target(estimate))


def test_a_safety_factor_that_may_be_infinite_is_refined_step_by_step() -> None:
    """Its error is infinite, which tells nothing of the cells needed; the finest allowed would be 25 times as many."""
    search, estimate = searching(accuracy_of="safety factor")
    search._plain = np.inf
    wanted = following(search, replace(estimate, error=np.inf))
    assert wanted is not None and 1.0 < wanted.growth < 6.0


def test_a_budget_too_small_for_the_mesh_wanted_is_used_for_a_coarser_one() -> None:
    """The next mesh is the finest that the budget allows; the search ends where none is worth it."""
    wanted = following(*searching())
    allowed, estimate = searching(budget_seconds=6.0)
    milder = following(allowed, estimate)
    assert milder is not None and 1.0 < milder.growth < 0.8 * wanted.growth
    assert allowed.reason == ""
    none, estimate = searching(budget_seconds=1.0)
    assert following(none, estimate) is None
    why = "stopped at numerics.budget_seconds = 1: the next mesh would take about"
    assert none.reason.startswith(why)


@pytest.mark.parametrize(("error", "left"), [(0.03, COMPARED), (0.0015, AIM / 1.5)])
def test_a_corrected_load_needs_no_mesh_for_the_load_as_computed(error: float, left: float) -> None:
    """Its error is that on the mesh before: one such mesh shows it, and a finer one has less of it."""
    sphere = scene_load(SCENES / "sphere_on_plane.toml", ["numerics.accuracy=0.001", *INERTIA])
    strategy = DualWeighted(sphere, MPI.COMM_SELF, Recorder(), Silent())
    assert strategy.target(Estimate(error)) == pytest.approx(left)


# -- the loop -----------------------------------------------------------------------------------------


class Listed(Search):
    """Meshes with listed errors, one after the other; text is why one has no flow."""

    def __init__(self, errors: list[float | str]):
        super().__init__(wanting(), MPI.COMM_SELF, Recorder(), Silent())
        self._errors = errors

    def first(self, failures: int = 0) -> Attempt:
        return Attempt(self.scene, note=str(len(self.trials)))

    @contextmanager
    def solved(self, attempt: Attempt) -> Iterator[Any]:
        error = self._errors[int(attempt.note)]
        if isinstance(error, str):
            raise ConvergenceError(error)
        run = MagicMock(error=error)
        run.fluid.space.unknowns = 1000
        yield run, Loads(NO_GRAIN)

    def estimate(self, run: Any, computed: Loads) -> Estimate:
        return Estimate(run.error)

    def refined(self, attempt: Attempt, estimate: Estimate, left: float) -> Attempt:
        return self.first()

    def concluded(self, run: Any) -> float:
        return float(run.error)


@pytest.mark.parametrize(
    ("errors", "reason", "last"),
    [
        ([0.1, 0.004], "reached", 0.004),
        (["no flow", "no flow", 0.004], "reached", 0.004),
        ([0.1, 0.02, "no flow"], "the next mesh failed: no flow", 0.02),
        ([0.1, 0.02, *[0.03] * 10], "not reached with 12 meshes", 0.02),
    ],
)
def test_a_search_ends_with_the_least_error_that_it_found(
    errors: list[float | str], reason: str, last: float
) -> None:
    search = Listed(errors)
    assert search.result() == search.adaptation().reached == last
    assert (search.reason, search.met) == (reason, reason == "reached")
    assert len(search.trials) == len(errors)


# -- in time -----------------------------------------------------------------------------------------------


IN_TIME = "time={end=10.0, step=0.1, start='steady'}"


def in_time(*overrides: str) -> Scene:
    return on_bed(IN_TIME, "numerics.accuracy=0.01", *overrides)


@pytest.mark.parametrize("scheme", ["bdf1", "bdf2"])
@pytest.mark.parametrize(
    ("parts", "left"), [((0.04, 0.04), (0.005, 0.005)), ((0.05, 0.002), (0.005, 0.002))]
)
def test_steps_and_cells_leave_half_of_the_error_each(
    parts: tuple[float, float], left: tuple[float, float], scheme: str
) -> None:
    """Of 0.01 in all: errors go as the step to the order of the scheme, and as cells to the power 3 of order two.

    The number of steps is a multiple of four.
    """
    scene = in_time(f"time.scheme={scheme}", "numerics.order=2", "time.step=0.001")
    finer = refined(scene, parts, 0.01 / sum(parts))
    steps, cells = finer.time.step / 0.001, finer.numerics.mesh_size / scene.numerics.mesh_size
    assert parts[0] * steps ** int(scheme[-1]) == pytest.approx(left[0], rel=1e-3)
    assert parts[1] * cells**3 == pytest.approx(left[1])


def refined(scene: Scene, parts: tuple[float | None, float | None], left: float) -> Scene:
    search = Compared(scene, MPI.COMM_SELF, Recorder(), Silent())
    search.report(Trial(2, 200, 1000, None, 1.0))
    return search.refined(Attempt(scene), Estimate(None, parts=parts), left).scene


@pytest.mark.parametrize(
    ("parts", "step", "cells"),
    [((None, None), 0.5, 0.5**0.5), ((np.inf, 1.0), 0.5, 0.5**0.5), ((1.0, 1.0), 1 / 16, 1 / 4)],
)
def test_unknown_errors_are_halved_and_far_ways_are_gone_in_parts(
    parts: tuple[float | None, float | None], step: float, cells: float
) -> None:
    finer = refined(in_time("time.step=0.125"), parts, 1e-9)
    assert finer.time is not None and finer.time.step == pytest.approx(step * 0.125)
    assert finer.numerics.mesh_size == pytest.approx(cells)


# -- scenes -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("overrides", "steps", "tolerance"),
    [
        ((), 16, None),
        (("time.step=1.0",), 12, None),  # eight steps or more
        # Two steps or more in a gust, sixteen in a period, in a multiple of four.
        (("flow.gust={start=1.0, duration=0.8, strength=2.0}",), 28, None),
        (("time={end=10.0, step=0.1}", "flow={kind='oscillatory', period=5.0}"), 52, None),
        (("time.tolerance=1e-5", "time.scheme='bdf1'"), 16, pytest.approx(6.25**2 * 1e-5)),
        (("time.tolerance=1e-5",), 16, pytest.approx(6.25**3 * 1e-5)),
    ],
)
def test_the_first_run_is_coarse_but_has_some_steps(
    overrides: tuple[str, ...], steps: int, tolerance: Any
) -> None:
    coarse = first_attempt(in_time(*overrides)).scene
    assert coarse.time is not None and coarse.numerics.mesh_size == pytest.approx(2.0**1.5)
    assert (coarse.time.step, coarse.time.tolerance) == (pytest.approx(10.0 / steps), tolerance)


@pytest.mark.parametrize("step", [0.1, 1.0, 0.13])
@pytest.mark.parametrize("halved", range(3))
def test_comparisons_end_where_steps_do(step: float, halved: int) -> None:
    scene = rescaled(first_attempt(in_time(f"time.step={step}")).scene, 0.5**halved, 1.0)
    for time in (scene.time, comparisons(scene)[0].time):
        assert time.end / time.step == pytest.approx(round(time.end / time.step))


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
