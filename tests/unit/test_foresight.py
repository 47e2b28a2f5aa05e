"""What `incipient plan` says where the run chooses the mesh: the first one, and the last by laws that are known."""

from dataclasses import replace
from pathlib import Path

import pytest
from made_up_runs import TIMED, scene

from incipient.adaptive import halving
from incipient.adaptive.refinement import AIM, GAIN, UNKNOWNS
from incipient.cost import calibration
from incipient.cost.calibration import Calibration, KnownErrors
from incipient.cost.command import planned, predicted
from incipient.cost.counts import Counts
from incipient.cost.errorlaw import ErrorLaw, OrderLaw
from incipient.cost.forecast import Foresight, first_mesh, foresee
from incipient.cost.prices import Known, Work
from incipient.cost.times import Times
from incipient.planning.plan import Estimate, make_plan
from incipient.scene import Scene, load

SCENES = Path(__file__).parents[2] / "demos" / "scenes"
QUIET = "numerics.error_bars=false"
FIRST = Estimate(200, 1000, 200.0)


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def calibrated(made: Scene, law: OrderLaw, goal: str = "force") -> None:
    """A machine on which runs of a scene are known, and the law of one error."""
    counts = Counts(steps=10 if made.time else 0, newton=20, factorisations=4, krylov=20)
    step = made.time.step if made.time else None
    runs = [
        calibration.known(
            made,
            Work(calibration.kind(made), 2, n // 5, n, counts),
            1.0,
            step,
            start=0.5,
            cpu=1.0 + 1e-4 * n,
            peak_mib=250.0,
        )
        for n in (1000, 2000, 4000, 8000)
    ]
    errors = KnownErrors("", calibration.kind(made), {goal: ErrorLaw({2: law})})
    calibration.write(Calibration(tuple(runs), {calibration.digest(made): errors}))


def foreseen(made: Scene) -> Foresight:
    found = foresee(made, FIRST)
    assert isinstance(found, Foresight), found
    return found


# -- the first mesh -----------------------------------------------------------------------------------------


def test_the_plan_says_that_the_run_chooses() -> None:
    made = scene("numerics.accuracy=0.001", "numerics.budget_seconds=60")
    text = planned(made).text()
    sought = "mesh and order are chosen by the run, until the error of the force "
    sought += "(of discretisation) is below 0.001, within 60 s"
    assert f"numerics.accuracy: {sought}" in text
    assert "P2-P1 Taylor-Hood on cells of order 2 at first" in text
    assert "cell sizes x" not in text
    assert "first mesh: 342 cells, 1749 unknowns" in text, "as in docs/accuracy.md"
    assert not make_plan(scene()).sought
    assert "cell sizes x 1" in make_plan(scene()).text()
    assert "until the verdict is decided" in make_plan(scene("numerics.accuracy=verdict")).text()
    assert "mesh and steps are chosen" in make_plan(scene(TIMED, "numerics.accuracy=0.01")).text()


def test_the_first_mesh_in_time_is_that_of_the_coarsest_run() -> None:
    made = scene(TIMED, "numerics.accuracy=0.01")
    coarse = halving.first(made)
    assert (coarse.numerics.mesh_size, coarse.time.step) == (pytest.approx(2.0**1.5), pytest.approx(0.08))
    assert first_mesh(made).unknowns < 0.7 * planned(scene(TIMED)).estimate.unknowns


# -- the last mesh ------------------------------------------------------------------------------------------


def test_an_error_that_is_small_at_first() -> None:
    """0.02 (h/4)^2 percent at cells four times as large."""
    made = scene(QUIET, "numerics.accuracy=0.001")
    calibrated(made, OrderLaw(0.0002 / 16.0, 2.0, 0.0, 2.0, 1.0))
    found = foreseen(made)
    assert found.first.value == pytest.approx(2e-4)
    assert (found.runs, found.unknowns, found.order, found.reaches, found.own) == (1, 1000, 2, True, True)
    assert "the first mesh is expected to do" in found.text()


@pytest.mark.parametrize(("asked", "order"), [(4e-3, 2), (8e-4, 3), (2e-5, 4)])
def test_the_second_mesh_is_as_the_run_will_choose_it(asked: float, order: int) -> None:
    made = scene(QUIET, f"numerics.accuracy={asked}")
    calibrated(made, OrderLaw(0.01 / 16.0, 2.0, 0.0, 2.0, 1.0))
    found = foreseen(made)
    left = max(0.01 * GAIN ** (order - 2) / (AIM * asked), 1.0)
    unknowns = 1000 * UNKNOWNS[order] / UNKNOWNS[2] * left ** (1.0 / order)
    assert (found.runs, found.order) == (2, order)
    assert found.unknowns == pytest.approx(unknowns, rel=0.01)
    assert found.fewest < found.unknowns < found.most
    assert f"2 meshes expected, the last of about {float(f'{unknowns:.2g}'):.0f} unknowns" in found.text()
    times = Times.of(made, calibration.read())
    assert times is not None
    alone = times.prices.start + times.beyond_start(made, FIRST) + times.dual(FIRST, 2)
    assert max(alone, found.low) < found.cpu < found.high


def test_error_bars_come_on_top() -> None:
    made = scene("numerics.accuracy=0.001")
    calibrated(made, OrderLaw(1e-5, 2.0, 0.0, 2.0, 1.0))
    quiet = scene(QUIET, "numerics.accuracy=0.001")
    assert foreseen(made).cpu > foreseen(quiet).cpu


def test_flow_in_time_is_refined_until_two_runs_agree() -> None:
    """An error of 5 dt^2, dt in units of the flow's time: steps 0.08, 0.04, 0.02, 0.01, 0.005."""
    made = scene(TIMED, QUIET, "numerics.accuracy=0.001")
    unit = calibration.step_of_flow(made, 1.0)
    calibrated(made, OrderLaw(0.0, 2.0, 5.0 / unit**2, 2.0, 1.0))
    found = foreseen(made)
    assert found.first.value == pytest.approx(5.0 * 0.08**2)
    assert (found.runs, found.step, found.reaches) == (4, pytest.approx(0.01), True)
    assert found.fewest <= found.unknowns < found.most, (
        "with half the error as many runs, with twice one more"
    )
    easy = foreseen(scene(TIMED, QUIET, "numerics.accuracy=0.05"))
    assert (easy.runs, easy.step) == (2, pytest.approx(0.04)), "one run alone has no error"
    hard = foreseen(scene(TIMED, QUIET, "numerics.accuracy=1e-5"))
    assert (hard.runs, hard.reaches) == (6, False)
    assert "6 meshes expected, not to be reached, the last of about" in hard.text()


# -- what is not known --------------------------------------------------------------------------------------


def test_without_calibration_it_says_how_to_get_one() -> None:
    made = scene("numerics.accuracy=0.001")
    data, words = predicted(made, planned(made))
    assert data is None
    assert words.startswith(
        "  final mesh, time and memory: not known on this machine yet; run `incipient cost"
    )
    assert "`incipient calibrate`" in words


def test_what_has_no_law_is_not_known() -> None:
    made = scene("numerics.accuracy=0.001", "numerics.accuracy_of=couple")
    calibrated(made, OrderLaw(1e-3, 2.0, 0.0, 2.0, 1.0))
    unknown = "  final mesh, time and memory: not known: "
    assert foresee(made, FIRST) == (
        f"{unknown}no error of the couple is known for scenes of this kind; run `incipient cost SCENE` for this scene"
    )
    verdict = foresee(scene("numerics.accuracy=verdict"), FIRST)
    assert (
        verdict == f"{unknown}they hang on what decides the verdict; numerics.budget_seconds limits the time"
    )
    carried = load(SCENES / "pothole_4.toml", ["numerics.accuracy=0.01"])
    assert "the load on a grain that moves" in str(foresee(carried, FIRST))
    adaptive = scene(TIMED.replace("step", "tolerance = 1e-3, step"), "numerics.accuracy=0.01")
    calibrated(adaptive, OrderLaw(1e-3, 2.0, 0.0, 2.0, 1.0))
    assert "steps that adapt" in str(foresee(adaptive, FIRST))


def test_laws_of_other_scenes_are_trusted_less() -> None:
    made = scene(QUIET, "numerics.accuracy=0.002")
    calibrated(made, OrderLaw(0.01 / 16.0, 2.0, 0.0, 2.0, 1.0))
    other = scene(QUIET, "numerics.accuracy=0.002", "fluid.reynolds=21.0")
    own, foreign = foreseen(made), foreseen(other)
    assert own.own and not foreign.own
    assert foreign.first.high / foreign.first.low > own.first.high / own.first.low
    assert "by runs of other scenes on this machine" in foreign.text()


def test_what_is_kept_of_runs_is_read_again() -> None:
    """In files of any version the counts of a run's work stand beside its size."""
    run = Known(
        "a", Work("steady", 2, 10, 50, Counts(1, 2, 3, 4, 5)), 1.0, 0.0, 1.0, "implicit", 0.5, 1.0, 200.0
    )
    stored = Calibration((run,)).to_dict()
    size = {"kind": "steady", "order": 2, "cells": 10, "unknowns": 50}
    counts = {"steps": 1, "newton": 2, "factorisations": 3, "krylov": 4, "remeshings": 5}
    assert stored["runs"][0]["work"] == size | counts
    assert Calibration.of_dict(stored).runs == (run,)
    assert Calibration.of_dict(stored).runs != (replace(run, cpu=2.0),)
