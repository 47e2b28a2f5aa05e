"""What accuracy costs: frontier, law, ladder, reference, sentence, the resumption of a study; and what a plan says.

Runs are made up here, by laws whose constants must be found again; tests/end_to_end/test_cost_command.py has real ones.
"""

import csv
import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import TANK
from scenes import on_bed as scene

from incipient.accuracy import next_mesh
from incipient.accuracy.first_mesh import first_mesh, planned
from incipient.cost import frontier, measurement, quantities
from incipient.cost.ladder import RATIO, Rung, ladder, own_rung
from incipient.cost.measurement import MeasuredRun
from incipient.cost.quantities import Quantity
from incipient.cost.study import Study, run_ladder
from incipient.errors import ConvergenceError, OutputError, SceneError
from incipient.parallel import environment_alone
from incipient.pictures.directory_pictures import draw
from incipient.planning.plan import make_plan
from incipient.scene import Scene, load, loads

DEMOS = Path(__file__).parents[2] / "demos/scenes"
TIMED = 'time={end = 1.0, step = 0.01, start = "stokes"}'
QUIET = "numerics.error_bars=false"
EXACT = {"force_x": 3.0, "force_y": 4.0, "torque_z": 0.5, "safety_factor": 1.5}
SAME = {"force": Quantity({"force_x": 3.0, "force_y": 4.0}, 5.0)}


class Runner:
    """Runs off by 0.02 (h/2)^(p+2), of 4000 h^-2 unknowns, that take 1 + 0.2 p h^-2 seconds; counts them; some fail."""

    def __init__(self, *failing: Rung):
        self.made: list[Rung] = []
        self.failing = failing

    def __call__(self, scene: Scene, rung: Rung, task: str) -> MeasuredRun:
        self.made.append(rung)
        if rung in self.failing:
            return MeasuredRun(rung, 1.0, 0.5, failed='no steady flow, "of course", found')
        off = 1.0 + 0.02 * (rung.mesh_size / 2.0) ** (rung.order + 2)
        numbers = {name: value * off for name, value in EXACT.items()}
        force, torque = ({k: v for k, v in numbers.items() if k[0] == first} for first in "ft")
        found = {"force": Quantity(force, 5.0 * off), "torque": Quantity(torque, 0.5 * off)}
        cpu, unknowns = 1.0 + 0.2 * rung.order * rung.mesh_size**-2, 4000 * rung.mesh_size**-2
        return MeasuredRun(rung, 2.0 * cpu, cpu, 200.0, 800, round(unknowns), 5, found)


def quiet(text: str) -> None:
    """Say nothing."""


def studied(directory: Path, runner: Runner, *overrides: str, **keys: bool) -> Study:
    made = scene(*overrides)
    return run_ladder(made, ladder(made, **keys), directory, runner, quiet)


# -- numbers ------------------------------------------------------------------------------------------------


@given(st.lists(st.tuples(st.floats(1, 100), st.floats(1e-6, 1)), min_size=1, max_size=12))
def test_nothing_beats_the_frontier(points: list[tuple[float, float]]) -> None:
    costs, errors = zip(*points, strict=True)
    kept = [points[i] for i in frontier.front(costs, errors)]
    assert kept == sorted(kept)
    assert set(kept) == {
        p for p in points if not any(a <= p[0] and b <= p[1] and (a, b) != p for a, b in points)
    }


@pytest.mark.parametrize("power", [0.5, 1.5, 4.0])
def test_a_law_is_found_again(power: float) -> None:
    """error = 0.02 (t - 1.3)^-p, exactly."""
    times = 1.3 + np.geomspace(0.1, 10.0, 5)
    law = frontier.fitted(list(times), list(0.02 * (times - 1.3) ** -power), start=1.3)
    assert law is not None
    assert (law.constant, law.power) == pytest.approx((0.02, power), rel=1e-9)
    assert law.time(0.02 * 2.0**-power) == pytest.approx(3.3)
    assert law.digit == pytest.approx(10.0 ** (1.0 / power))


def test_too_little_makes_no_law() -> None:
    assert frontier.fitted([2.0], [0.1], 1.0) is None
    assert frontier.fitted([2.0, 2.0], [0.1, 0.2], 1.0) is None
    assert frontier.fitted([2.0, 3.0], [0.1, 0.2], 1.0) is None, "errors that grow with time"
    assert frontier.fitted([2.0, 3.0], [0.1, 0.09], 1.0) is None, "errors that hardly differ"


@pytest.mark.parametrize(
    ("time", "said"),
    [(0.25, "0.25 s"), (42.4, "42 s"), (119.0, "119 s"), (150.0, "2.5 min"), (3e5, "3.5 days")],
)
def test_times_in_words(time: float, said: str) -> None:
    assert frontier.seconds(time) == said


def test_start_is_what_unknowns_do_not_change() -> None:
    """t = 1.2 + 3e-5 n + 1e-6 n s."""
    n, s = np.array([1e3, 4e3, 1e4, 4e4]), np.array([5, 8, 6, 9])
    assert frontier.overhead(1.2 + 3e-5 * n + 1e-6 * n * s, n, s) == pytest.approx(1.2)


def test_extrapolation() -> None:
    """2 + 3 h^4 at h, h/r, h/r^2; no limit is believed of numbers that oscillate or do not change."""
    three = [2.0 + 3.0 * (0.5 / RATIO**i) ** 4 for i in range(3)]
    assert frontier.extrapolated(three, RATIO) == pytest.approx(2.0)
    assert frontier.extrapolated([1.0, -1.0, 1.0], RATIO) is None
    assert frontier.extrapolated([1.0, 1.0, 1.0], RATIO) is None


def test_peak_between_samples() -> None:
    t = np.linspace(0.0, 3.0, 30)
    assert quantities.extremes(t, 1.0 - (t - 1.234) ** 2) == pytest.approx((1.0 - 1.766**2, 1.0))
    assert quantities.extremes(t, t) == (0.0, 3.0)
    assert quantities.extremes(t[:1], t[:1]) == (0.0, 0.0)


def test_elevations_are_compared_at_equal_times():
    """Of a wave sampled at steps that do not meet these times; from the elevation at time zero on."""
    waves = loads(
        f"""
{TANK}[surface]
elevation = "0.1*cos(pi*x)"
stations = [0.0, 0.25]
[time]
end = 3.0
step = 0.07
"""
    )
    times = np.append(np.arange(0.07, 3.0, 0.07), 3.0)
    heights = {"elevation_1": 0.1, "elevation_2": 0.1 * np.cos(np.pi / 4.0)}
    rows = [
        {"time": t} | {name: height * np.cos(t) for name, height in heights.items()} for t in times
    ]
    (found,) = quantities.of_run(waves, None, rows).values()
    at = 3.0 * np.arange(1, quantities.TIMES + 1) / quantities.TIMES
    exact = np.concatenate([height * np.cos(at) for height in heights.values()])
    assert [*found.numbers.values()] == pytest.approx(exact, abs=1e-6)
    larger = {name: 1.01 * value for name, value in found.numbers.items()}
    assert found.error(larger) == pytest.approx(0.01)


# -- ladders ------------------------------------------------------------------------------------------------


def test_ladder_of_a_steady_scene() -> None:
    """Every order on every mesh, the scene's own among them; the reference is finer than all others."""
    made = scene("numerics.mesh_size=2.0")
    rungs = ladder(made)
    assert len(rungs) == 16 and own_rung(made) == Rung(3, 2.0) in rungs
    assert max(rung.mesh_size for rung in rungs) == 4.0
    assert rungs[-1] == Rung(4, pytest.approx(1.0 / RATIO))
    quick = ladder(scene(), quick=True)
    assert [rung.mesh_size for rung in quick] == pytest.approx([2.0, RATIO, 1.0, 1.0 / RATIO])
    assert {rung.order for rung in quick} == {3}


def test_ladder_in_time() -> None:
    made = scene(TIMED)
    rungs = ladder(made, orders=[2], sizes=[2.0, 1.0], steps=[4.0, 1.0])
    pairs = [(2.0, 0.04), (2.0, 0.01), (1.0, 0.04), (1.0, 0.01)]
    # The scene's own is of order three, and so is the reference.
    reference = Rung(3, 1.0 / RATIO, 0.005)
    assert rungs == (*(Rung(2, *pair) for pair in pairs), Rung(3, 1.0, 0.01), reference)
    assert rungs[0].of(made).time.step == 0.04
    longest = ladder(made, orders=[3], sizes=[1.0], steps=[80.0])
    assert [rung.step for rung in longest] == [0.5, 0.01, 0.005], "two steps at least"


def test_ladders_in_3d_and_with_turbulence() -> None:
    sphere = load(DEMOS / "sphere_on_plane.toml")
    sizes = [2.0, RATIO, 1.0, 1.0 / RATIO]
    assert [one.mesh_size for one in ladder(sphere)] == pytest.approx(sizes)
    assert {one.order for one in ladder(sphere)} == {3}
    of_order_two = ladder(load(DEMOS / "sphere_on_plane.toml", ["numerics.order=2"]))
    assert {one.order for one in of_order_two} == {2}
    channel = load(DEMOS / "turbulent_channel.toml")
    usual = [Rung(order, pytest.approx(size)) for order in (2, 3) for size in sizes]
    assert [*ladder(channel)] == [*usual, Rung(3, pytest.approx(0.5))]
    assert {one.order for one in ladder(channel, quick=True)} == {2}


def test_wrong_ladders() -> None:
    for keys in ({"sizes": [0.0]}, {"steps": [1.0]}, {"orders": [5]}):
        with pytest.raises(SceneError, match=f"--{next(iter(keys))}: "):
            ladder(scene(), **keys)


def test_a_rung_changes_nothing_but_how_finely() -> None:
    base = scene(TIMED, "numerics.tolerance=1e-7", "numerics.accuracy=0.01")
    changed = Rung(2, 1.5, 0.02).of(base)
    assert changed.numerics.tolerance == 1e-7 and changed.numerics.accuracy is None
    assert not changed.numerics.error_bars
    for section in ("domain", "fluid", "flow", "body", "bed", "contact", "effects"):
        assert getattr(changed, section) == getattr(base, section)


# -- studies of runs that are made up -----------------------------------------------------------------------


def test_a_study_finds_errors_and_law(tmp_path: Path) -> None:
    """The errors and times of `Runner`; the scene's own is P3 with h = 1: 1 + 0.6 s and 0.02/32."""
    study = studied(tmp_path, Runner())
    force = study.reference.quantities["force"].numbers
    assert force["force_x"] == pytest.approx(3.0, rel=1e-6), "extrapolated"
    first = next(one for one in study.judged if one.run.rung == Rung(2, 2.0))
    assert first.errors == pytest.approx({"force": 0.02, "torque": 0.02}, rel=1e-3)
    assert study.own is not None and study.own.error == pytest.approx(0.02 / 32.0, rel=1e-3)
    assert study.law is not None and study.law.start == pytest.approx(1.0, abs=0.05)
    said = study.sentence
    own = "(P3-P2, mesh_size 1) a run takes 1.6 s of CPU time without error bars for an error of 0.062%; "
    assert own in said
    # 0.02 (h/2)^6 is below 0.0000625 for h = 0.707 in order four, which takes 1 + 0.8 x 2 s.
    assert said.endswith("ten times less error (0.0062%) takes 2.6 s (P4-P3, mesh_size 0.7071).")
    text = study.text()
    assert text.startswith(said) and text.count("\n*") == len(study.frontier) + 1
    assert sum("(the scene's own)" in line for line in text.splitlines()) == 1


def test_prices_beyond_the_runs(tmp_path: Path) -> None:
    """An error ten times as small as that of P3, h = 1 (0.02/32) is reached by no other run of order two or three."""
    made = scene()
    rungs = ladder(made, orders=[2, 3], sizes=[2.0, RATIO])
    study = run_ladder(made, rungs, tmp_path, Runner(), quiet)
    assert study.law is not None and study.own is not None
    target = 0.1 * study.own.error
    time = study.law.time(target)
    assert study.sentence.endswith(
        f"takes about {frontier.seconds(time)} by extrapolation, {time / 1.6:.2g} times as much."
    )


def test_exact_values(tmp_path: Path) -> None:
    """Against them the finest run has an error, too."""
    made = scene()
    rungs = ladder(made, quick=True)
    study = run_ladder(made, rungs, tmp_path, Runner(), quiet, exact={"force_x": 3.0})
    finest = next(one for one in study.judged if one.run.rung == rungs[-1])
    assert finest.errors == pytest.approx({"force_x": 0.02 * (0.5 / RATIO) ** 5})
    assert all(one.resolved for one in study.judged)
    for wrong in ({"force_q": 3.0}, {"force_x": 0.0}):
        with pytest.raises(SceneError, match=r"--exact: .* some of force_x, force_y"):
            Study(made, [one.run for one in study.judged], wrong)


def test_a_reference_that_is_no_better_tells_no_errors(tmp_path: Path) -> None:
    """Its neighbour differs by as much as errors are: of two runs alone nothing is known but that."""
    runs = [Runner()(scene(), rung, "run") for rung in (Rung(3, 2.0), Rung(3, 1.0))]
    study = Study(scene(), runs)
    assert study.reference.doubt == pytest.approx(0.02 * 31 / 32, rel=0.05)
    assert not any(one.resolved for one in study.judged)
    assert all(one.said.startswith("<") for one in study.judged)
    assert study.sentence.endswith(
        "Its error is below 1.9%, which these runs do not resolve; add finer cells by --sizes."
    )


def test_runs_that_agree_make_no_law() -> None:
    alike = [replace(Runner()(scene(), rung, "run"), quantities=SAME) for rung in ladder(scene())]
    study = Study(scene(), alike)
    assert study.law is None and not any(one.resolved for one in study.judged)
    assert "along the frontier" not in study.text()
    assert study.sentence.endswith(
        "all runs agree to round-off, so that the cheapest is as accurate (P2-P1, mesh_size 2, 1.1 s)."
    )


def test_unevenly_spaced_cells_are_not_extrapolated() -> None:
    """Richardson's rule needs cells of equal ratios."""
    rungs = ladder(scene(), orders=[4], sizes=[3.0, 1.5])
    study = Study(scene(), [Runner()(scene(), rung, "run") for rung in rungs])
    assert study.reference.source == rungs[-1].name
    assert study.reference.quantities == study.finest.quantities


def test_a_study_resumes_where_it_was_interrupted(tmp_path: Path) -> None:
    class Stopped(Runner):
        def __call__(self, scene: Scene, rung: Rung, task: str) -> MeasuredRun:
            if len(self.made) == 3:
                raise KeyboardInterrupt
            return super().__call__(scene, rung, task)

    first, second, third = Stopped(), Runner(), Runner()
    with pytest.raises(KeyboardInterrupt):
        studied(tmp_path, first, quick=True)
    whole = studied(tmp_path, second, quick=True)
    assert (len(first.made), len(second.made)) == (3, 1)
    again = studied(tmp_path, third, quick=True)
    assert not third.made and again.judged == whole.judged, "every digit is kept"
    finer = studied(tmp_path, fourth := Runner(), quick=False)
    assert len(fourth.made) == len(finer.judged) - 4, "all four are on this ladder, too"


def test_failed_runs(tmp_path: Path) -> None:
    """One that fails is told; without its reference the finest of the others serves; all that fail end the study."""
    rungs = ladder(scene(), quick=True)
    study = studied(tmp_path / "coarse", Runner(rungs[0]), quick=True)
    assert f'failed: {rungs[0].name}: no steady flow, "of course", found' in study.text()
    study = studied(tmp_path / "reference", Runner(rungs[-1]), quick=True)
    assert study.finest.rung == rungs[-2] and len(study.judged) == 3
    own = studied(tmp_path / "own", Runner(rungs[2]), quick=True)
    assert own.sentence == "As the scene stands (P3-P2, mesh_size 1) its run failed."
    with pytest.raises(ConvergenceError, match=r"fewer than two runs .* succeeded: no steady flow"):
        studied(tmp_path / "all", Runner(*rungs), quick=True)


def test_runs_without_a_quantity_of_the_finest_are_left_out(tmp_path: Path) -> None:
    """Here a coarse grain does not come to the bed, so that it has no time of contact."""

    class Late(Runner):
        def __call__(self, scene: Scene, rung: Rung, task: str) -> MeasuredRun:
            run = super().__call__(scene, rung, task)
            contact = {} if rung.mesh_size == 2.0 else {"time": Quantity({"time": 1.0}, 1.0)}
            return replace(run, quantities=run.quantities | contact)

    study = studied(tmp_path, Late(), quick=True)
    assert [run.failed for run in study.failed] == ["its result has no time"]
    assert len(study.judged) == 3 and "time" in study.judged[0].errors


def test_the_directory_of_another_study_is_refused(tmp_path: Path) -> None:
    studied(tmp_path, Runner(), quick=True)
    with pytest.raises(OutputError, match="the study of another scene"):
        studied(tmp_path, Runner(), "fluid.reynolds=3.0", quick=True)
    with pytest.raises(OutputError, match="the study of another scene"):
        made = scene()
        run_ladder(made, ladder(made), tmp_path, Runner(), quiet, task="threshold")
    (tmp_path / "cost.json").write_text('{"runs": [{"rung": 1}]}')
    with pytest.raises(OutputError, match="delete it to start again"):
        studied(tmp_path, Runner(), quick=True)


def test_files_of_a_study(tmp_path: Path) -> None:
    study = studied(tmp_path, Runner(Rung(2, 2.0)))
    stored = json.loads((tmp_path / "cost.json").read_text())
    assert stored["sentence"] == study.sentence and len(stored["runs"]) == 16
    assert [one["name"] for one in stored["judged"] if one["own"]] == ["P3-P2, mesh_size 1"]
    rows = list(csv.DictReader((tmp_path / "cost.csv").open()))
    assert len(rows) == 15 and float(rows[0]["force_x"]) == study.judged[0].run.numbers["force_x"]
    (picture,) = draw(tmp_path)
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_forms_compiled_by_a_run_do_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    runs = iter(
        [(MeasuredRun(Rung(2, 1.0), cpu=9.0), True), (MeasuredRun(Rung(2, 1.0), cpu=2.0), False)]
    )
    monkeypatch.setattr(measurement, "_once", lambda *given: next(runs))
    assert measurement.measure(scene(), Rung(2, 1.0), "run").cpu == 2.0


@pytest.mark.parametrize(
    ("script", "why"),
    [
        ("kill -9 $$", "ended by signal 9 (9: often by a lack of memory)"),
        ("echo first >&2; echo incipient: last >&2; exit 4", "last"),
        ("exit 7", "exit code 7"),
    ],
)
def test_a_process_that_fails_says_why(
    script: str, why: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    program = tmp_path / "python"
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)
    monkeypatch.setattr(measurement.sys, "executable", str(program))
    assert measurement.measure(scene(), Rung(2, 1.0), "run") == MeasuredRun(
        Rung(2, 1.0), failed=why
    )


def test_a_run_takes_no_part_in_a_parallel_one(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "SLURM_JOB_ID"):
        monkeypatch.setenv(name, "2")
    found = environment_alone()
    assert found["PATH"] == os.environ["PATH"]
    assert not any(name.startswith(("OMPI_COMM", "PMIX", "SLURM")) for name in found)


# -- what a plan says ---------------------------------------------------------------------------------------


def test_the_plan_says_that_the_run_chooses() -> None:
    made = scene("numerics.accuracy=0.001", "numerics.budget_seconds=60")
    text = planned(made).text()
    sought = "mesh and order are chosen by the run, until the error of the force "
    sought += "(of discretisation) is below 0.001, within 60 s"
    assert f"numerics.accuracy: {sought}" in text
    assert "P2-P1 Taylor-Hood on cells of order 2 at first" in text
    assert "cell sizes x" not in text
    assert "first mesh: 342 cells, 1749 unknowns" in text, "as in docs/contribute/defaults.md"
    assert not make_plan(scene()).sought
    assert "cell sizes x 1" in make_plan(scene()).text()
    assert "until the verdict is decided" in make_plan(scene("numerics.accuracy=verdict")).text()
    in_time = make_plan(scene(TIMED, "numerics.accuracy=0.01")).text()
    assert "steps, mesh and order are chosen" in in_time


def test_the_first_mesh_in_time_is_that_of_the_coarsest_run() -> None:
    made = scene(TIMED, "numerics.accuracy=0.01")
    coarse = next_mesh.first(made)
    assert coarse.numerics.mesh_size == pytest.approx(2.0**1.5)
    assert coarse.time.step == pytest.approx(0.08)
    assert first_mesh(made).unknowns < 0.7 * planned(scene(TIMED, QUIET)).estimate.unknowns
