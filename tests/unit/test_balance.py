"""How flow in time is made finer: the least work for an accuracy, from what step and mesh contribute to the error."""

from __future__ import annotations

import math

import pytest
from mpi4py import MPI
from scipy.optimize import minimize_scalar

from incipient.accuracy.coarse_runs import changed, comparisons
from incipient.accuracy.next_mesh import (
    FINEST,
    SHORTEST,
    WORK,
    WORK_POWER,
    Refined,
    cheapest,
    finer,
    first,
    halved,
    refined,
)
from incipient.accuracy.search import LEAST_WORK, Attempt, Estimate, Search
from incipient.accuracy.strategies import InTime
from incipient.accuracy.terms import order_in_space
from incipient.progress import Silent
from incipient.results.adaptation import Trial
from incipient.scene import Scene, loads
from incipient.scene.example import commented, grain_on_bed
from incipient.simulation.recorder import Recorder

IN_TIME = "time={end=10.0, step=0.1, start='steady'}"


def in_time(*overrides: str) -> Scene:
    return loads(
        commented(grain_on_bed()), overrides=(IN_TIME, "numerics.accuracy=0.01", *overrides)
    )


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
    assert cheapest(0.08, 0.001, 0.02, 2, 2).keeps_mesh(2) and not found.keeps_mesh(2)


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
    search = Search(scene, MPI.COMM_SELF, Recorder(), Silent(), InTime)
    search.report(tried(0.6, 0.0, seconds=100.0))
    allowed = search.refined(Attempt(scene), Estimate(0.6), 0.01)
    assert allowed is not None and LEAST_WORK < allowed.work < 7.0
    assert allowed.scene.time.step == pytest.approx(0.1 / allowed.work, rel=0.02)
    search.report(tried(0.6, 0.0, seconds=400.0))
    assert search.refined(Attempt(scene), Estimate(0.6), 0.01) is None
    why = "stopped at numerics.budget_seconds = 700: the next mesh would take about "
    assert search.reason.startswith(why)


def test_runs_are_few() -> None:
    search = Search(in_time(), MPI.COMM_SELF, Recorder(), Silent(), InTime)
    for _ in range(6):
        search.report(tried(0.02, 0.0))
    assert search.refined(Attempt(in_time()), Estimate(0.02), 0.3) is None
    assert search.reason == "not reached with 6 meshes"
