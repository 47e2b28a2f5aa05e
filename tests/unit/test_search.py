"""Searches for an accuracy: cells and order from estimated errors, the least work in time, the loop, and its budget."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from scenes import POCKET, on_bed
from scipy.optimize import minimize_scalar

from incipient.accuracy.coarse_runs import changed, comparisons
from incipient.accuracy.goal import Goal
from incipient.accuracy.modelling import SMALLEST_GAP, lessened
from incipient.accuracy.next_mesh import (
    AIM,
    FINEST,
    SHORTEST,
    WORK,
    WORK_POWER,
    Refined,
    cheapest,
    finer,
    first,
    halved,
    highest_order,
    next_order,
    refined,
)
from incipient.accuracy.search import LEAST_WORK, Attempt, Estimate, Search
from incipient.accuracy.searches import COMPARED, DualWeighted, InTime
from incipient.accuracy.sizing import LARGEST, SMALLEST, Shares, resized
from incipient.accuracy.terms import order_in_space
from incipient.errors import ConvergenceError, SceneError
from incipient.geometry.plane.curves import Line
from incipient.meshes import Near, Region, SizeField, Sizes
from incipient.meshes.model import meshed
from incipient.planning.layout import STEEPEST
from incipient.progress import Silent
from incipient.results.adaptation import Adaptation, Trial
from incipient.results.errorbars import NO_GRAIN, Loads, Term
from incipient.results.quantity import as_stored
from incipient.scene import Scene, load, loads
from incipient.scene.example import commented, grain_on_bed
from incipient.simulation.recorder import Recorder

ZERO = np.zeros(3)
SCENES = Path(__file__).parents[2] / "demos" / "scenes"
INERTIA = ("fluid.reynolds=20", "fluid.inertia=true")


def grid(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Points and triangles of the unit square, n cells along a side."""
    x, y = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    lower = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    a, b, c, d = lower, lower + 1, lower + n + 1, lower + n + 2
    return np.column_stack([x.ravel(), y.ravel()]), np.vstack(
        [np.column_stack([a, b, d]), np.column_stack([a, d, c])]
    )


def test_equal_shares_refine_evenly() -> None:
    """Errors that go as h^(2k) fall sixteen times when cells of order two are halved."""
    points, triangles = grid(10)
    shares = Shares(points, triangles, np.ones(len(points)))
    assert shares.sizes == pytest.approx(0.1 * np.sqrt(2 / np.sqrt(3)))
    field, more = resized(shares, order=2, relative=1 / 16, comm=MPI.COMM_SELF)
    assert field is not None
    assert field.sizes == pytest.approx(0.5 * shares.sizes, rel=1e-6)
    assert more == pytest.approx(4.0, rel=1e-6)


def test_sizes_follow_the_shares_within_bounds() -> None:
    points, triangles = grid(40)
    errors = np.exp(-20.0 * np.hypot(*(points - 0.5).T))
    shares = Shares(points, triangles, errors)
    field, _ = resized(shares, order=2, relative=0.1, comm=MPI.COMM_SELF)
    assert field is not None
    factors = field.sizes / shares.sizes
    assert factors.min() == pytest.approx(factors[np.argmax(errors)])
    assert factors.min() >= SMALLEST - 1e-12 and factors.max() <= LARGEST + 1e-12
    a, b = triangles[:, 0], triangles[:, 1]
    growth = np.abs(np.diff(field.sizes[np.column_stack([a, b])]))[:, 0]
    assert np.all(growth <= STEEPEST * np.linalg.norm(points[a] - points[b], axis=1) + 1e-12)


def test_no_error_makes_cells_as_large_as_allowed() -> None:
    points, triangles = grid(5)
    shares = Shares(points, triangles, np.ones(len(points)))
    field, _ = resized(shares, order=2, relative=1e9, comm=MPI.COMM_SELF)
    assert field is not None
    assert field.sizes == pytest.approx(LARGEST * shares.sizes)


def test_mesh_has_the_sizes_of_the_field() -> None:
    """The field wants fine cells left of the middle; where it does not reach, other sizes hold."""
    points, triangles = grid(4)
    sizes = np.where(points[:, 0] < 0.4, 0.05, 0.5)
    corners = ((0.0, 0.0), (2.0, 0.0))
    region = Region((Line(*corners),), 1.0)
    mesh = meshed(region, Sizes(0.25, field=SizeField(points, triangles, sizes)), 1)
    centres = mesh.points[mesh.cells].mean(axis=1)
    left, right = (centres[:, 0] < 0.2).sum(), (centres[:, 0] > 1.2).sum()
    # Areas 0.2 and 0.8 in equilateral triangles of sides 0.05 and 0.25.
    assert left == pytest.approx(0.2 / (0.433 * 0.05**2), rel=0.1)
    # Thirty triangles: those between fine and coarse ones are smaller, so that there are 33.
    assert right == pytest.approx(0.8 / (0.433 * 0.25**2), rel=0.2)


def test_what_a_geometry_needs_is_not_coarsened() -> None:
    sizes = Sizes(
        1.0, (Near(0.1, 0.2, points=((0.0, 0.0),), needed=True), Near(0.3, 0.6, boundary="bed"))
    )
    coarse = sizes.coarsened(4.0, 0.5)
    assert coarse.far == 4.0
    assert [(near.size, near.growth) for near in coarse.near] == [(0.1, 0.5), (1.2, 0.6)]


@pytest.mark.parametrize(
    ("order", "excess", "cheapest"),
    [(2, 1.5, 2), (2, 5.0, 2), (2, 10.0, 3), (2, 1000.0, 4), (3, 2.0, 3), (4, 1e6, 4)],
)
def test_order_with_the_fewest_unknowns(order: int, excess: float, cheapest: int) -> None:
    assert next_order(order, excess) == (
        cheapest,
        pytest.approx(excess * 0.1 ** (cheapest - order)),
    )


def test_no_order_is_tried_in_space_with_inertia_that_the_solver_does_not_serve() -> None:
    assert (highest_order(3, True), highest_order(3, False), highest_order(2, True)) == (2, 4, 4)
    assert [next_order(order, 1e3, 3, 2)[0] for order in (2, 3)] == [2, 3]


def test_a_smaller_gap_or_a_larger_domain() -> None:
    """A term is lessened by the power with which it falls: a gap of a quarter, a domain twice as large."""
    scene = grain_on_bed()
    gap, domain, datum = (Term(name, ZERO, ZERO, "") for name in ("gap", "domain", "datum"))
    closer = lessened(scene, gap, 0.25)
    assert closer is not None and closer.contact.gap == pytest.approx(0.0025)
    assert lessened(changed(scene, contact={"gap": SMALLEST_GAP}), gap, 0.25) is None
    larger = lessened(scene, domain, 0.25)
    assert larger is not None and (larger.domain.length, larger.domain.height) == (48.0, 40.0)
    box = loads(commented(scene), overrides=("domain.kind=box", "flow={kind='lid'}"))
    assert lessened(box, domain, 0.25) is None and lessened(scene, datum, 0.25) is None


# -- the quantity -----------------------------------------------------------------------------------


def loaded(force: float, torque: float) -> Loads:
    return Loads(np.array([force, 0.0, 0.0]), np.array([0.0, 0.0, torque]))


def wanting(**numerics: object) -> Scene:
    return changed(grain_on_bed(), numerics={"accuracy": 0.01, **numerics})


def test_relative_errors() -> None:
    loads_ = loaded(2.0, -0.5)
    errors = np.array([0.03, 0.04, 0.0]), np.array([0.0, 0.0, 0.01])
    assert Goal.of(wanting()).error(loads_, *errors) == pytest.approx(0.025)
    assert Goal.of(wanting(accuracy_of="torque")).error(loads_, *errors) == pytest.approx(0.02)
    vanishing = loaded(2.0, 0.0)
    # 1% of force times diameter stands for a torque that is smaller.
    assert Goal.of(wanting(accuracy_of="torque")).error(vanishing, *errors) == pytest.approx(0.5)


def test_goals_are_relative() -> None:
    loads_ = loaded(2.0, -0.5)
    assert np.allclose(Goal.of(wanting()).goals(loads_), [[0.5, 0, 0], [0, 0.5, 0]])
    assert np.allclose(Goal.of(wanting(accuracy_of="torque")).goals(loads_), [[0, 0, 2.0]])


def test_slope_of_the_safety_factor() -> None:
    """In a pocket: the change that its slope foretells is the change of its logarithm."""
    from incipient.arrays import spatial
    from incipient.contact import Load
    from incipient.contact.verdict import judged

    scene = on_bed(*POCKET, "numerics.accuracy=0.01", "numerics.accuracy_of=safety factor")
    goal = Goal.of(scene)
    (slope,) = goal.goals(loaded(1.0, -0.1))
    gravity, centre = spatial(scene.gravity_vector), spatial(scene.placement.centre)
    weight = (scene.mass - scene.grain.volume) * gravity  # submerged, by hand

    def factor(force: float) -> float:
        loads_ = loaded(force, -0.1)
        load = Load(loads_.force, loads_.torque, weight, centre)
        return judged(load, goal.contacts, 0.5).safety.value

    assert np.log(factor(1.01) / factor(0.99)) == pytest.approx(0.02 * slope[0], rel=1e-2)


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
    first = search.first()
    return search.within_budget(first, estimate, search.target(estimate))


def test_a_safety_factor_that_may_be_infinite_is_refined_step_by_step() -> None:
    """Its error is infinite, which tells nothing of the cells needed; the finest allowed would be 25 times as many."""
    search, estimate = searching(accuracy_of="safety factor")
    search._plain = np.inf
    wanted = following(search, replace(estimate, error=np.inf))
    assert wanted is not None and 1000.0 < wanted.unknowns < 6000.0


def test_a_budget_too_small_for_the_mesh_wanted_is_used_for_a_coarser_one() -> None:
    """The next mesh is the finest that the budget allows; the search ends where none is worth it."""
    wanted = following(*searching())
    assert wanted is not None
    allowed, estimate = searching(budget_seconds=6.0)
    milder = following(allowed, estimate)
    assert milder is not None and 1000.0 < milder.unknowns < 0.8 * wanted.unknowns
    assert allowed.reason == ""
    none, estimate = searching(budget_seconds=1.0)
    assert following(none, estimate) is None
    why = "stopped at numerics.budget_seconds = 1: the next mesh would take about"
    assert none.reason.startswith(why)


@pytest.mark.parametrize(
    ("plain", "corrected", "left"),
    [
        (0.003, None, COMPARED),  # not compared yet: one such mesh shows whether it is enough
        (0.03, 0.0075, AIM / 7.5),  # not enough yet
        (0.0015, None, AIM / 1.5),  # the load as computed soon is
    ],
)
def test_corrected_loads_that_agree_need_no_mesh_for_the_load_as_computed(
    plain: float, corrected: float | None, left: float
) -> None:
    """Their error is that on the mesh before: one such mesh shows it, and a finer one has less of it."""
    sphere = load(SCENES / "sphere_on_plane.toml", ["numerics.accuracy=0.001", *INERTIA])
    strategy = DualWeighted(sphere, MPI.COMM_SELF, Recorder(), Silent())
    strategy._plain, strategy._compared = plain, corrected is not None
    assert strategy.target(Estimate(corrected or plain)) == pytest.approx(left)


def test_a_range_with_an_infinite_end() -> None:
    """In a pocket a force that is small may within its error be none, which is held at any factor."""
    wanted = ("numerics.accuracy=0.01", "numerics.accuracy_of=safety factor")
    goal = Goal.of(on_bed(*POCKET, *wanted))
    loads_ = loaded(0.1, 0.0)
    errors = np.array([0.01, 0.0, 0.0]), np.zeros(3)
    assert goal.error(loads_, *errors) == pytest.approx(1.0 / 0.9 - 1.0 / 1.1)
    assert goal.error(loads_, 10.0 * errors[0], errors[1]) == np.inf


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
        cells = SimpleNamespace(size_global=100)
        mesh = SimpleNamespace(topology=SimpleNamespace(dim=2, index_map=lambda dim: cells))
        space = SimpleNamespace(unknowns=1000)
        domain, fluid = SimpleNamespace(mesh=mesh), SimpleNamespace(space=space)
        yield SimpleNamespace(error=error, domain=domain, fluid=fluid), Loads(NO_GRAIN, NO_GRAIN)

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


def test_three_failures_end_a_search() -> None:
    with pytest.raises(ConvergenceError, match="no flow"):
        Listed(["no flow"] * 3).result()


def test_an_accuracy_in_doubt_is_not_known_to_be_reached() -> None:
    search = DualWeighted(wanting(), MPI.COMM_SELF, Recorder(), Silent())
    search.conclude(0.005, "for a reason")
    assert (search.reason, search.met) == ("not known to be reached: for a reason", False)


# -- what may be asked for ----------------------------------------------------------------------------


@pytest.mark.parametrize("value", ["0", "1", "-0.1", "1e-7", "true", "high"])
def test_wrong_accuracies(value: str) -> None:
    with pytest.raises(
        SceneError, match=r"numerics\.accuracy: is .*give a relative error such as 0\.01"
    ):
        on_bed(f"numerics.accuracy={value}")


def test_accuracy_without_a_grain() -> None:
    cavity = '[domain]\nkind="box"\nlength=1\nheight=1\n[fluid]\nreynolds=100\nscale="flow"\n[flow]\nkind="lid"\n'
    with pytest.raises(
        SceneError, match=r"numerics\.accuracy: .*there is neither; add a section \[body\]"
    ) as caught:
        loads(cavity + "[numerics]\naccuracy=0.01\n")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (
            ("numerics.budget_seconds=5",),
            r"numerics\.budget_seconds: .*none is requested; add numerics\.accuracy",
        ),
        (("numerics.accuracy=0.01", "flow={kind='still'}"), r"a fluid at rest exerts no force"),
        (("numerics.accuracy=0.01", "numerics.accuracy_of=drag"), r'"drag" is not known'),
        (
            ("numerics.accuracy=verdict", "time={end=1.0, step=0.1}"),
            r'"verdict" is for steady flow',
        ),
    ],
)
def test_contradictions(overrides: tuple[str, ...], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        on_bed(*overrides)


@pytest.mark.parametrize(
    "key", ["accuracy='verdict'", "accuracy=0.01\naccuracy_of='safety factor'"]
)
def test_a_verdict_needs_what_a_verdict_needs(key: str) -> None:
    stream = (
        '[domain]\nlength=8\nheight=4\n[fluid]\nreynolds=20\nscale="grain"\n[flow]\nkind="uniform"\n'
        '[body]\nshape="disc"\ndiameter=1\ncentre=[3.0, 2.0]\n'
    )
    with pytest.raises(
        SceneError,
        match=r"needs a grain that rests on a bed, its density and friction; give body\.x",
    ):
        loads(f"{stream}[numerics]\n{key}\n")


def test_what_is_said() -> None:
    trials = (Trial(2, 200, 1000, 0.02, 0.5), Trial(3, 300, 3000, 0.004, 1.0))
    said = Adaptation(0.01, "force", 0.004, True, "reached", trials)
    first, *rest = said.lines()
    assert first.split(None, 1) == [
        "accuracy",
        "error of the force 4.0e-03 (of discretisation), asked for 0.01: reached",
    ]
    assert [line.split()[0] for line in rest] == ["P2", "P3"]
    assert as_stored(said)["trials"][1]["unknowns"] == 3000


# -- in time -----------------------------------------------------------------------------------------------


IN_TIME = "time={end=10.0, step=0.1, start='steady'}"


def in_time(*overrides: str) -> Scene:
    return on_bed(IN_TIME, "numerics.accuracy=0.01", *overrides)


def tried(of_step: float, of_mesh: float, seconds: float = 1.0) -> Trial:
    return Trial(2, 500, 2500, of_step + of_mesh, seconds, 0.1, of_step=of_step, of_mesh=of_mesh)


# -- the least work -------------------------------------------------------------------------------------------


def least_work(of_step: float, of_mesh: float, aim: float, order: int, q: int) -> float:
    """By a general minimiser over the logarithm of the steps relative to before: cells take what they leave."""
    s = order_in_space(order)

    def work(log_of_steps: float) -> float:
        left = aim - of_step * math.exp(q * log_of_steps)
        log_of_cells = min(0.0, math.log(left / of_mesh) / s) if of_mesh else 0.0
        return -log_of_steps - WORK_POWER * log_of_cells

    longest = min(0.0, math.log(aim / of_step) / q)
    found = minimize_scalar(
        work, bounds=(-12.0, longest), method="bounded", options={"xatol": 1e-12}
    )
    assert found.success
    return math.exp(found.fun)


@pytest.mark.parametrize("q", [1, 2])
@pytest.mark.parametrize("parts", [(0.04, 0.04), (0.05, 0.002), (0.001, 0.05), (0.09, 0.0)])
def test_no_choice_is_cheaper(parts: tuple[float, float], q: int) -> None:
    found = cheapest(*parts, 0.01, 2, q)
    s = order_in_space(found.order)
    assert parts[0] * found.shorter**q + parts[1] * found.finer**s == pytest.approx(0.01)
    works = {k: least_work(*parts, 0.01, k, q) * WORK[k] for k in WORK}
    assert found.work == pytest.approx(min(works.values()), rel=1e-5)
    assert found.order == min(works, key=lambda k: works[k])


def test_what_does_not_err_stays() -> None:
    """Only what errs is made finer, and a mesh whose error is small is as before."""
    assert cheapest(0.08, 0.0, 0.02, 2, 2) == Refined(0.5, 1.0, 2, 2.0)
    found = cheapest(0.0, 0.012, 0.01, 2, 2)
    assert (found.shorter, found.finer) == (1.0, pytest.approx(1.2 ** (-1 / 3)))
    assert cheapest(0.08, 0.001, 0.02, 2, 2).finer == 1.0


def test_a_mesh_that_errs_much_gets_a_higher_order() -> None:
    orders = [cheapest(0.0, excess, 1.0, 2, 2).order for excess in (1.5, 50.0, 1e4)]
    assert orders == sorted(orders) and orders[0] == 2 and orders[-1] > 2


def test_far_ways_are_gone_in_parts() -> None:
    """Half of the way in the error's logarithm, and again: steps a hundred times as short become ten times so."""
    assert refined(in_time(), tried(1.0, 0.0), 1e-4).shorter == pytest.approx(0.1)
    fine = refined(in_time(), tried(1.0, 1.0), 1e-7)
    assert fine.shorter >= SHORTEST and fine.finer >= FINEST


# -- scenes -----------------------------------------------------------------------------------------------------


def test_the_first_run_is_coarse_but_has_some_steps() -> None:
    coarse = first(in_time())
    assert coarse.time is not None
    assert (coarse.numerics.mesh_size, coarse.time.step) == (
        pytest.approx(2.0**1.5),
        pytest.approx(0.8),
    )
    few = first(in_time("time.step=1.0"))
    assert few.time is not None and few.time.step == 1.0
    adapting = first(in_time("time.tolerance=1e-5", "time.scheme='bdf1'"))
    assert adapting.time is not None and adapting.time.tolerance == pytest.approx(8**2 * 1e-5)


def test_comparisons_end_where_steps_do() -> None:
    for shorter in (0.9, 0.7, 0.31, 0.1):
        for scene in (in_time(), in_time("time.step=1.0")):
            time = finer(scene, Refined(shorter, 1.0, 2, 1.0)).time
            assert time is not None and scene.time is not None
            steps = time.end / time.step
            assert steps == pytest.approx(round(steps), abs=1e-9)
            assert time.step <= shorter * scene.time.step * (1.0 + 1e-9)
            assert steps < scene.time.end / scene.time.step / shorter + 4.0
            longer = comparisons(changed(scene, time={"step": time.step}))[0].time
            if steps >= 32.0 or steps <= 16.0:
                assert longer is not None and time.end / longer.step == pytest.approx(
                    round(time.end / longer.step)
                )


def test_what_is_wanted_becomes_the_scene() -> None:
    scene = finer(in_time("time.tolerance=1e-3"), Refined(0.5, 0.25, 3, 1.0))
    assert scene.time is not None
    assert (scene.time.step, scene.time.tolerance) == (0.05, pytest.approx(1e-3 / 8.0))
    assert (scene.numerics.mesh_size, scene.numerics.order) == (0.25, 3)
    same = finer(in_time(), Refined(1.0, 0.5, 2, 1.0))
    assert same.time == in_time().time


def test_what_is_not_known_is_halved() -> None:
    scene = in_time()
    unknown = Trial(2, 500, 2500, None, 1.0, 0.1, "not compared: no mesh")
    assert refined(scene, unknown, 0.01) == refined(scene, tried(math.inf, math.inf), 0.01)
    assert refined(scene, unknown, 0.01) == halved(2) and halved(2).shorter == 0.5
    # An error that is more than its parts is looked at as that: a sixteenth of it is a quarter of the steps.
    more = Trial(2, 500, 2500, 0.16, 1.0, 0.1, of_step=0.04, of_mesh=0.0)
    assert refined(scene, more, 0.01 / 0.16).shorter == pytest.approx(0.25)


# -- what a budget allows ------------------------------------------------------------------------------------------


def test_a_budget_is_spent_on_what_it_allows() -> None:
    """An error of 100 times the accuracy takes ten times the steps; a budget of seven runs allows a part of that."""
    scene = in_time("numerics.budget_seconds=700")
    search = InTime(scene, MPI.COMM_SELF, Recorder(), Silent())
    search.report(tried(0.6, 0.0, seconds=100.0))
    allowed = search.within_budget(Attempt(scene), Estimate(0.6), 0.01)
    assert allowed is not None and LEAST_WORK < allowed.work < 7.0
    assert allowed.scene.time.step == pytest.approx(0.1 / allowed.work, rel=0.02)
    search.report(tried(0.6, 0.0, seconds=400.0))
    assert search.within_budget(Attempt(scene), Estimate(0.6), 0.01) is None
    why = "stopped at numerics.budget_seconds = 700: the next mesh would take about "
    assert search.reason.startswith(why)


def test_runs_are_few() -> None:
    search = InTime(in_time(), MPI.COMM_SELF, Recorder(), Silent())
    for _ in range(6):
        search.report(tried(0.02, 0.0))
    assert search.within_budget(Attempt(in_time()), Estimate(0.02), 0.3) is None
    assert search.reason == "not reached with 6 meshes"
