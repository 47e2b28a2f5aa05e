"""Cost by stage and effect, tables and reports."""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jinja2 import Environment
from scenes import SCENES, TANK, rows_of
from scenes import on_bed as scene

import incipient
from incipient.accuracy.first_mesh import planned
from incipient.cost import frontier, measurement
from incipient.cost.ladder import RATIO, Rung, ladder, own_rung
from incipient.cost.measurement import MeasuredRun, Quantity
from incipient.cost.study import Study, run_ladder
from incipient.errors import ConvergenceError, OutputError
from incipient.parallel import environment_alone
from incipient.pictures import draw_apart
from incipient.pictures.directory_pictures import draw
from incipient.pictures.record import scene_of
from incipient.reporting import part
from incipient.reporting.page import (
    TEMPLATES,
    Bounded,
    Erring,
    cell,
    compact,
    embedded,
    environment,
)
from incipient.reporting.results import _budget, _in_si, _rows
from incipient.results import timing as ledgers
from incipient.results.kinds import CRITICAL, KINDS, THRESHOLD
from incipient.results.loads import Elevations
from incipient.results.of_runs import OF_PATH, PATH
from incipient.results.quantity import put, screen_lines, words_of
from incipient.results.si import in_si
from incipient.results.timing import Corrections, Ledger, Share, cost_lines
from incipient.scene import Scene, load, loads

# What accuracy costs: frontier, law, ladder, reference, sentence, the resumption of a study; and what a plan says.
#
# Runs are made up here, by laws whose constants must be found again; tests/end_to_end/test_accuracy.py has real ones.


TIMED = 'time={end = 1.0, step = 0.01, start = "stokes"}'
EXACT = {"force_x": 3.0, "force_y": 4.0, "torque_z": 0.5, "safety_factor": 1.5}
SAME = {"force": Quantity({"force_x": 3.0, "force_y": 4.0}, 5.0)}


class Runner:
    """Runs off by 0.02 (h/2)^(p+2), of 4000 h^-2 unknowns, that take 1 + 0.2 p h^-2 seconds.

    Counts them and is interrupted after the `most`; some fail.
    """

    def __init__(self, *failing: Rung, most: int = 99):
        self.rungs: list[Rung] = []
        self.failing, self.most = failing, most

    def __call__(self, scene: Scene, rung: Rung, task: str) -> MeasuredRun:
        if len(self.rungs) == self.most:
            raise KeyboardInterrupt
        self.rungs.append(rung)
        if rung in self.failing:
            return MeasuredRun(rung, 1.0, 0.5, failed='no steady flow, "of course", found')
        off = 1.0 + 0.02 * (rung.mesh_size / 2.0) ** (rung.order + 2)
        numbers = {name: value * off for name, value in EXACT.items()}
        force, torque = ({k: v for k, v in numbers.items() if k[0] == first} for first in "ft")
        values = {"force": Quantity(force, 5.0 * off), "torque": Quantity(torque, 0.5 * off)}
        cpu, unknowns = 1.0 + 0.2 * rung.order * rung.mesh_size**-2, 4000 * rung.mesh_size**-2
        return MeasuredRun(rung, 2.0 * cpu, cpu, 200.0, 800, round(unknowns), 5, values)


def quiet(text: str) -> None:
    """Say nothing."""


def studied(directory: Path, runner: Runner, *overrides: str, **keys: Any) -> Study:
    base, task = scene(*overrides), keys.pop("task", "run")
    return run_ladder(base, ladder(base, **keys), directory, runner, quiet, task)


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
    law = frontier.fitted([(t, 0.02 * (t - 1.3) ** -power) for t in times], start=1.3)
    assert (law.constant, law.power) == pytest.approx((0.02, power), rel=1e-9)
    assert law.time(0.02 * 2.0**-power) == pytest.approx(3.3)


@pytest.mark.parametrize(
    "runs",
    [
        [(2.0, 0.1)],
        [(2.0, 0.1), (2.0, 0.2)],
        [(2.0, 0.1), (3.0, 0.2)],  # errors that grow with time
        [(2.0, 0.1), (3.0, 0.09)],  # errors that hardly differ
    ],
)
def test_too_little_makes_no_law(runs: list[tuple[float, float]]) -> None:
    assert frontier.fitted(runs, 1.0) is None


@pytest.mark.parametrize(
    ("time", "said"),
    [(0.25, "0.25 s"), (42.4, "42 s"), (119.0, "119 s"), (150.0, "2.5 min"), (3e5, "3.5 days")],
)
def test_times_in_words(time: float, said: str) -> None:
    assert frontier.seconds(time) == said


SAMPLED = np.linspace(0.0, 3.0, 30)


@pytest.mark.parametrize(
    ("times", "values", "ends"),
    [
        (SAMPLED, 1.0 - (SAMPLED - 1.234) ** 2, (1.0 - 1.766**2, 1.0)),
        (SAMPLED, SAMPLED, (0.0, 3.0)),
        (SAMPLED[:1], SAMPLED[:1], (0.0, 0.0)),
    ],
)
def test_peak_between_samples(
    times: np.ndarray, values: np.ndarray, ends: tuple[float, float]
) -> None:
    assert measurement.extremes(times, values) == pytest.approx(ends)


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
    times = np.append(np.arange(0.0, 3.0, 0.07), 3.0)
    heights = np.array([0.1, 0.1 * np.cos(np.pi / 4.0)])
    seen = Elevations(times, np.cos(times)[:, None] * heights, 0.1)
    (result,) = measurement.of_run(waves, SimpleNamespace(elevations=seen), []).values()
    at = 3.0 * np.arange(1, measurement.TIMES + 1) / measurement.TIMES
    exact = np.cos(at)[:, None] * heights
    assert [*result.numbers.values()] == pytest.approx(exact.ravel(), abs=1e-6)
    larger = {name: 1.01 * value for name, value in result.numbers.items()}
    assert result.error(larger) == pytest.approx(0.01)


# -- ladders ------------------------------------------------------------------------------------------------


SIZES = [2.0, RATIO, 1.0, 1.0 / RATIO, 0.5]
SPHERE, CHANNEL = SCENES / "sphere_on_plane.toml", SCENES / "turbulent_channel.toml"


@pytest.mark.parametrize(
    ("scene", "quick", "orders", "sizes", "reference"),
    [
        # Every order on every mesh, the scene's own among them; the reference is finer than all others.
        (scene("numerics.mesh_size=2.0"), False, (2, 3, 4), [2.0 * h for h in SIZES], 1.0 / RATIO),
        (scene(), True, (3,), SIZES[:3], 1.0 / RATIO),
        (load(SPHERE), False, (3,), SIZES[:3], 1.0 / RATIO),
        (load(SPHERE, ["numerics.order=2"]), False, (2,), SIZES[:3], 1.0 / RATIO),
        (load(CHANNEL), False, (2, 3), SIZES[:4], 0.5),
        (load(CHANNEL), True, (2,), SIZES[:3], 1.0 / RATIO),
    ],
)
def test_ladder_of_a_steady_scene(
    scene: Scene, quick: bool, orders: tuple[int, ...], sizes: list[float], reference: float
) -> None:
    every = [Rung(order, pytest.approx(size)) for order in orders for size in sizes]
    rungs = ladder(scene, quick)
    assert [*rungs] == [*every, Rung(orders[-1], pytest.approx(reference))]
    assert own_rung(scene) in rungs[:-1]


def test_ladder_in_time() -> None:
    """The scene's own is of order three, and so is the reference; a run has two steps at least."""
    own = scene(TIMED)
    rungs = ladder(own, orders=[2], sizes=[2.0, 1.0], steps=[4.0, 1.0])
    pairs = [(2.0, 0.04), (2.0, 0.01), (1.0, 0.04), (1.0, 0.01)]
    reference = Rung(3, 1.0 / RATIO, 0.005)
    assert rungs == (*(Rung(2, *pair) for pair in pairs), Rung(3, 1.0, 0.01), reference)
    longest = ladder(own, orders=[3], sizes=[1.0], steps=[80.0])
    assert [rung.step for rung in longest] == [0.5, 0.01, 0.005]


def test_a_rung_changes_nothing_but_how_finely() -> None:
    base = scene(TIMED, "numerics.tolerance=1e-7", "numerics.accuracy=0.01")
    changed = Rung(2, 1.5, 0.02).of(base)
    assert (changed.numerics.tolerance, changed.numerics.accuracy) == (1e-7, None)
    assert not changed.numerics.error_bars and changed.time.step == 0.02
    coarse = ("numerics", "output", "time")
    assert changed.model_dump(exclude={*coarse}) == base.model_dump(exclude={*coarse})


# -- studies of runs that are made up -----------------------------------------------------------------------


def test_a_study_finds_errors_and_law(tmp_path: Path) -> None:
    """The errors and times of `Runner`; the scene's own is P3 with h = 1: 1 + 0.6 s and 0.02/32."""
    study = studied(tmp_path, Runner())
    force = study.reference.quantities["force"].numbers
    assert force["force_x"] == pytest.approx(3.0, rel=1e-6), "extrapolated"
    first = next(each for each in study.judged if each.run.rung == Rung(2, 2.0))
    assert first.errors == pytest.approx({"force": 0.02, "torque": 0.02}, rel=1e-3)
    assert study.own is not None and study.own.error == pytest.approx(0.02 / 32.0, rel=1e-3)
    assert study.law is not None and study.law.start == pytest.approx(1.0, abs=0.05)
    # 0.02 (h/2)^6 is below 0.0000625 for h = 0.707 in order four, which takes 1 + 0.8 x 2 s.
    assert study.sentence == (
        "As the scene stands (P3-P2, mesh_size 1) a run takes 1.6 s of CPU time without error bars for an error of "
        "0.062%; ten times less error (0.0062%) takes 2.6 s (P4-P3, mesh_size 0.7071)."
    )
    text = study.text()
    assert text.startswith(study.sentence) and text.count("\n*") == len(study.frontier) + 1
    assert text.count("(the scene's own)") == 1
    assert "not of gap and domain" in text


def test_prices_beyond_the_runs(tmp_path: Path) -> None:
    """An error ten times as small as that of P3, h = 1 (0.02/32) is reached by no other run of order two or three."""
    rungs = ladder(scene(), orders=[2, 3], sizes=[2.0, RATIO])
    study = run_ladder(scene(), rungs, tmp_path, Runner(), quiet)
    time = study.law.time(0.1 * study.own.error)
    assert study.sentence.endswith(
        f"takes about {frontier.seconds(time)} by extrapolation, {time / 1.6:.2g} times as much."
    )


AS_CHEAP = (
    "all runs agree to round-off, so that the cheapest is as accurate (P2-P1, mesh_size 2, 1.1 s)."
)
FINER = "Its error is below 1.9%, which these runs do not resolve; add finer cells by --sizes."


@pytest.mark.parametrize(
    ("rungs", "same", "doubt", "sentence"),
    [
        # Its neighbour differs by as much as errors are: of two runs alone nothing is known but that.
        ((Rung(3, 2.0), Rung(3, 1.0)), False, pytest.approx(0.02 * 31 / 32, rel=0.05), FINER),
        (ladder(scene()), True, 0.0, AS_CHEAP),
    ],
)
def test_a_reference_that_is_no_better_tells_no_errors(
    rungs: tuple[Rung, ...], same: bool, doubt: float, sentence: str
) -> None:
    runs = [Runner()(scene(), rung, "run") for rung in rungs]
    study = Study(scene(), [replace(run, quantities=SAME) for run in runs] if same else runs)
    assert study.reference.doubt == doubt and study.law is None
    assert not any(each.resolved for each in study.judged)
    assert all(each.said.startswith("<") for each in study.judged)
    assert study.sentence.endswith(sentence) and "along the frontier" not in study.text()


def test_unevenly_spaced_cells_are_not_extrapolated() -> None:
    """Richardson's rule needs cells of equal ratios."""
    rungs = ladder(scene(), orders=[4], sizes=[3.0, 1.5])
    study = Study(scene(), [Runner()(scene(), rung, "run") for rung in rungs])
    assert study.reference.source == rungs[-1].name
    assert study.reference.quantities == study.finest.quantities


def test_a_study_resumes_where_it_was_interrupted(tmp_path: Path) -> None:
    """Every digit is kept; runs of a quick study are also on the whole ladder."""
    first, second, third, fourth = (Runner(most=most) for most in (3, 99, 99, 99))
    with pytest.raises(KeyboardInterrupt):
        studied(tmp_path, first, quick=True)
    whole = studied(tmp_path, second, quick=True)
    assert (len(first.rungs), len(second.rungs)) == (3, 1)
    again = studied(tmp_path, third, quick=True)
    assert not third.rungs and again.judged == whole.judged
    finer = studied(tmp_path, fourth, quick=False)
    assert len(fourth.rungs) == len(finer.judged) - 4


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


def test_runs_without_a_quantity_of_the_finest_are_left_out() -> None:
    """Here a coarse grain does not come to the bed, so that it has no time of contact."""
    runs = [Runner()(scene(), rung, "run") for rung in ladder(scene(), quick=True)]
    contact = {"time": Quantity({"time": 1.0}, 1.0)}
    late = [replace(run, quantities=run.quantities | contact) for run in runs[1:]]
    study = Study(scene(), [runs[0], *late])
    assert [run.failed for run in study.failed] == ["its result has no time"]
    assert len(study.judged) == 3 and "time" in study.judged[0].errors


def test_the_directory_of_another_study_is_refused(tmp_path: Path) -> None:
    studied(tmp_path, Runner(), quick=True)
    for overrides, task in ((("fluid.reynolds=3.0",), "run"), ((), "threshold")):
        with pytest.raises(OutputError, match="the study of another scene"):
            studied(tmp_path, Runner(), *overrides, quick=True, task=task)
    (tmp_path / "cost.json").write_text('{"runs": [{"rung": 1}]}')
    with pytest.raises(OutputError, match="delete it to start again"):
        studied(tmp_path, Runner(), quick=True)


def test_files_of_a_study(tmp_path: Path) -> None:
    study = studied(tmp_path, Runner(Rung(2, 2.0)))
    stored = json.loads((tmp_path / "cost.json").read_text())
    assert stored["sentence"] == study.sentence and len(stored["runs"]) == 16
    assert [row["name"] for row in stored["judged"] if row["own"]] == ["P3-P2, mesh_size 1"]
    rows = rows_of(tmp_path / "cost.csv")
    assert len(rows) == 15 and float(rows[0]["force_x"]) == study.judged[0].run.numbers["force_x"]
    assert draw(tmp_path)[0].read_bytes().startswith(b"\x89PNG")


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
    result = environment_alone()
    assert result["PATH"] == os.environ["PATH"]
    assert not any(name.startswith(("OMPI_COMM", "PMIX", "SLURM")) for name in result)


# -- what a plan says ---------------------------------------------------------------------------------------


SOUGHT = ("numerics.accuracy=0.001", "numerics.budget_seconds=60")


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        (
            SOUGHT,
            "numerics.accuracy: the mesh is chosen by the run, until the error of the force (of discretisation) is "
            "below 0.001, within 60 s",
        ),
        (SOUGHT, "P3-P2 Taylor-Hood on cells of order 3, "),
        (SOUGHT, "first mesh: 287 cells, 3465 unknowns"),
        (("numerics.accuracy=verdict",), "until the verdict is decided"),
        ((TIMED, "numerics.accuracy=0.01"), "steps and mesh are chosen"),
        ((), "cell sizes x 1"),
    ],
)
def test_the_plan_says_that_the_run_chooses(keys: tuple[str, ...], said: str) -> None:
    """Otherwise it has a factor of the cell sizes."""
    text = planned(scene(*keys)).text()
    assert said in text
    assert ("cell sizes x" in text) is (not keys)


# Wall time and memory by stage and by effect.


@pytest.fixture
def clock(monkeypatch):
    """A clock that only moves when it is told to, and memory likewise: `clock(seconds, mib)`."""
    now = {"time": 100.0, "memory": 50.0}
    monkeypatch.setattr(ledgers.time, "perf_counter", lambda: now["time"])
    monkeypatch.setattr(ledgers, "peak_memory_mib", lambda: now["memory"])

    def passes(seconds, mib=0.0):
        now["time"] += seconds
        now["memory"] += mib

    return passes


def corrections(ledger, *present):
    return Corrections(ledger, SimpleNamespace(order=4, has=lambda name: name in present))


def seconds(ledger):
    return {name: share.wall_time for name, share in ledger.effects.items() if share.wall_time}


def test_inner_stages_are_not_counted_twice(clock):
    """A stage that fails is closed."""
    ledger = Ledger(began=100.0)
    with pytest.raises(ValueError), ledger.stage("flow"):
        clock(1.0, 10.0)
        with ledger.stage("mesh motion"):
            clock(2.0, 5.0)
        clock(4.0)
        raise ValueError
    clock(8.0, 100.0)  # of no stage
    assert ledger.to_dict() == {"flow": 5.0, "mesh motion": 2.0, "total": 15.0}
    assert ledger.effects == {"flow": Share(5.0, 10.0), "moving mesh": Share(2.0, 5.0)}


def test_costs_since_the_last_booking_are_those_of_the_effect_booked_on(clock):
    """An earlier session's are counted as well."""
    ledger = Ledger(began=100.0)
    with ledger.stage("flow"):
        clock(1.0)
        ledger.charge("flow")
        clock(2.0, 3.0)
        ledger.charge("inertia")
        clock(4.0)
    assert ledger.effects == {"flow": Share(5.0, 0.0), "inertia": Share(2.0, 3.0)}
    ledger.count({"flow": 3.0, "interface": 2.0}, 7.0)
    assert ledger.total() == 14.0
    assert seconds(ledger) == {"flow": 8.0, "inertia": 2.0, "free body": 2.0}


@pytest.mark.parametrize(
    ("effects", "expected"), [(["inertia"], {"flow": 16.0, "inertia": 47.0}), ([], {"flow": 63.0})]
)
def test_the_first_correction_at_the_last_order_is_that_of_stokes_flow(clock, effects, expected):
    """Without inertia all are the flow's."""
    ledger = Ledger()
    with ledger.stage("flow"):
        watch = corrections(ledger, *effects).of_steady(lambda share, iteration, size: None)
        for order, times in ((2, (1.0, 2.0)), (4, (16.0, 4.0, 8.0)), (4, (32.0,))):
            for iteration, time in enumerate(times):
                clock(time)
                watch(order, 1.0, iteration, 0.1)
    assert seconds(ledger) == expected


def test_time_steps_after_the_first_are_unsteadiness_s(clock):
    """Of each, corrections beyond the two of a linear flow are inertia's; other stages within keep what is theirs."""
    ledger = Ledger()
    made = corrections(ledger, "inertia", "unsteadiness")
    for _ in range(2):
        with ledger.stage("flow", made.effect_of_step()):
            for iteration, time in enumerate((1.0, 2.0, 4.0)):
                clock(time)
                made.record(iteration)
            clock(64.0)
            with ledger.stage("tractions"):
                clock(32.0)
            clock(8.0)
    assert seconds(ledger) == {"flow": 75.0, "inertia": 8.0, "unsteadiness": 75.0, "traction": 64.0}


def test_unknowns_stand_beside_the_time():
    ledger = Ledger(effects={"flow": Share(3.0), "contact": Share(1.0)})
    result = ledger.by_effect({"flow": 1000})
    assert result["flow"] == {"wall_time": 3.0, "memory_mib": 0.0, "unknowns": 1000}
    first, second = cost_lines(result)
    assert first.split()[:6] == ["cost", "by", "effect", "flow", "3.00", "s"] and "75.0%" in first
    assert "1000 unknowns" in first and "contact" in second


def test_the_memory_of_the_process_that_started_this_one_is_not_counted() -> None:
    """A test runner of 800 MB starts a run of 200 MB."""
    child = f"from {ledgers.__name__} import peak_memory_mib; print(peak_memory_mib())"
    parent = (
        "import subprocess, sys; held = bytearray(b'x') * 600_000_000\n"
        f"print(subprocess.run([sys.executable, '-c', {child!r}], capture_output=True, text=True).stdout)"
    )
    done = subprocess.run(
        [sys.executable, "-c", parent], capture_output=True, text=True, timeout=60
    )
    assert 5.0 < float(done.stdout) < 300.0


# What stands on a page of results: cells, vectors, numbers in SI units; what is escaped and refused.


GUSTS = {
    "title": "<b>&</b>",
    "static": 2.5,
    "steady": "2.5 times the flow of the scene",
    "points": [
        {"duration": 1.0, "strength": 3.0, "error": 0.5, "held": 2.9, "leaves": 3.1}
        | {"impulse": 2.0, "runs": 7}
    ],
}


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (1.23456789, '<data value="1.23456789">1.23457</data>'),
        (-0.0, '<data value="-0.0">0</data>'),
        (math.inf, '<data value="inf">∞</data>'),
        (None, "–"),
        (True, "yes"),
        (7, '<data value="7">7</data>'),
        ("<b>", "&lt;b&gt;"),
        (
            Erring(2.0, 0.125),
            '<data value="2.0">2</data> <small>± <data value="0.125">1.2e−01</data></small>',
        ),
        (
            Bounded(1.5, 1.0, math.inf),
            '<data value="1.5">1.5</data> <small>(<data value="1.0">1</data> to <data value="inf">∞</data>)</small>',
        ),
        # A component lost in round-off is shown as zero, and kept in full for programs.
        ((1e-17, -1.0), '(<data value="1e-17">0</data>, <data value="-1.0">−1</data>)'),
    ],
)
def test_a_cell_has_its_number_in_full(value: Any, shown: str) -> None:
    assert cell(value) == shown
    if isinstance(value, float):
        assert cell(np.float64(value)) == shown


def test_errors_of_loads_are_vectors_and_of_others_the_largest() -> None:
    """Of two terms the second is unknown in one component; fractions are of the norm of the force, 1."""
    one = {
        "name": "gap",
        "how": "x",
        "force": [0.3, 0.4, None],
        "torque": [0.0, 0.0, None],
        "level": [0.1, 0.2],
        "parts": [],
    }
    other = one | {"name": "domain", "torque": None}
    bars = {"terms": [one, other], "force": [0.6, 0.8, 0.0], "torque": [0.0, 0.0, 1.0]}
    heads, rows = _budget(True, bars | {"level": [0.2, 0.4]})
    assert heads[1:4] == ["force", "torque", "elevation at the end"]
    assert rows[0][1] == (0.3, 0.4) and math.isnan(rows[0][2]) and rows[0][3:5] == [0.2, "50 %"]
    assert rows[1][2] == "" and [row[0] for row in rows] == ["gap", "domain", "all"]
    # The page has a column for whatever a term has errors of: the end of a path, the x of separation.
    ends = {"place": [0.25, 0.5, 0.125], "separated": [2.0, 1.0]}
    moving = {"name": "time step", "how": "x", "force": None, "torque": None, "parts": [], **ends}
    bars = {"terms": [moving], **ends}
    heads, (row,) = _budget(True, bars)
    assert heads[1:3] == ["end of the path with rotation [rad]", "x of separation"]
    assert row[1:4] == [0.5, 2.0, "100 %"]


def test_short_lists_of_settings_stand_on_a_line() -> None:
    made = compact("x = [\n    1.0,\n    2.0,\n]\ny = [\n    [\n        1,\n    ],\n]\n")
    assert made == "x = [1.0, 2.0]\ny = [\n    [1],\n]\n"


def test_every_record_has_a_template_that_can_be_read() -> None:
    names = {f"{kind.name}.html" for kind in KINDS} | {"sweep.html", "page.html"}
    for path in TEMPLATES.glob("*.html"):
        Environment().parse(path.read_text(encoding="utf-8"))
        names.discard(path.name)
        assert not re.search(r"\bsafe\b", path.read_text()), "nothing is exempt from escaping"
    assert not names


def test_titles_paths_and_texts_are_escaped(tmp_path: Path) -> None:
    """In a directory and a scene with names that are HTML, and a picture that cannot be drawn."""
    directory = tmp_path / "<i>out<"
    directory.mkdir()
    (directory / "gusts.json").write_text(json.dumps(GUSTS))
    (directory / "scene.toml").write_text('title = "<b>&</b>"')
    page = incipient.report(directory).read_text()
    assert "<title>&lt;b&gt;&amp;&lt;/b&gt;</title>" in page
    assert "<b>" not in page and "<i>" not in page
    text, _ = part(directory / "gusts.json", [f"missing: {directory}"])
    assert "&lt;i&gt;out&lt;" in text and "<i>" not in text


@pytest.mark.parametrize("name", ["steady", "points"])
def test_what_a_record_lacks_is_named(name: str, tmp_path: Path) -> None:
    record = tmp_path / "gusts.json"
    record.write_text(json.dumps({key: value for key, value in GUSTS.items() if key != name}))
    with pytest.raises(OutputError, match=rf"gusts\.json: holds no {name}; compute it again"):
        part(record)


def test_a_critical_number_without_upper_bound_keeps_its_lower_one() -> None:
    stored = {"shields": 0.02, "ranges": {"shields": [0.018, None]}}
    rows = dict(_rows(stored, THRESHOLD.quantities, CRITICAL))
    assert rows["critical Shields number"] == Bounded(0.02, 0.018, math.inf)


def test_numbers_in_si_units() -> None:
    """A grain of 1 mm in water in shear G = 5 1/s: the stress on the bed is rho nu G; the time is counted by 1/G."""
    scene = incipient.load(
        SCENES / "grain_on_bed.toml",
        [
            "units={diameter=1e-3, shear_rate=5.0}",
            "fluid={scale='grain'}",
            "gravity={}",
            "body.density=2.65",
        ],
    )
    shown = environment(in_si=_in_si).get_template("numbers.html").module
    page = shown.si(in_si(scene))
    row = r'row">([^<]*)</th><td class="number"><data value="([^"]*)">'
    told = {name: float(value) for name, value in re.findall(row, page)}
    assert told["stress on the bed [Pa]"] == pytest.approx(5e-3)
    assert told["one unit of time of the scene [s]"] == pytest.approx(0.2)
    assert not shown.si(None).strip()


@pytest.mark.parametrize("content", [b"no picture", b"\x89PNG\r\n\x1a\n\0\0", b""])
def test_what_is_no_picture_is_named(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "flow.png").write_bytes(content)
    with pytest.raises(OutputError, match=r"flow\.png: cannot be read as a picture; remove it"):
        embedded(tmp_path / "flow.png")


def test_a_page_does_not_replace_a_result(tmp_path: Path) -> None:
    (tmp_path / "result.json").write_text("{}")
    with pytest.raises(
        OutputError, match=r"result\.json: is not a valid name for this file; .* \.html"
    ):
        incipient.report(tmp_path, tmp_path / "result.json")
    (tmp_path / "mine.html").write_text("mine")
    with pytest.raises(OutputError, match=r"mine\.html: was not written by incipient"):
        incipient.report(tmp_path, tmp_path / "mine.html")
    assert (tmp_path / "mine.html").read_text() == "mine"


def test_a_directory_of_poses_is_shown_and_reported(tmp_path: Path) -> None:
    """Two thresholds of four poses, one of which has no rest; one run has failed."""
    stored = {"shields": [0.02, 0.05], "modes": {"rolling": 2}, "poses": 4, "refused": 1}
    record = json.dumps(stored | {"reason": "rolls away", "failed": 1})
    (tmp_path / "poses.json").write_text(record)
    page = incipient.report(tmp_path).read_text()
    assert (tmp_path / "poses.png").is_file() and "4 poses: 2 thresholds, failed runs: 1." in page
    assert "Poses without a rest: 1, the first: rolls away." in page
    assert '<th scope="row">median</th><td class="number"><data value="0.02">' in page


def test_results_of_an_earlier_version_are_refused_with_what_to_do(tmp_path: Path) -> None:
    """A scene may have a key that is retired."""
    text = (SCENES / "grain_on_bed.toml").read_text()
    retired = text.replace("[numerics]", "[numerics]\nform = 'advective'")
    (tmp_path / "scene.toml").write_text(retired)
    with pytest.raises(
        OutputError, match=r"results of another version.*numerics\.form: .*leave it o"
    ):
        scene_of(tmp_path)
    (tmp_path / "threshold.json").write_text("{}")
    complaint = draw_apart(tmp_path).complaint
    assert complaint.endswith("show them with that version, or run the scene again, changed so")


def test_quantities_of_a_moving_grain_stand_on_screen_page_and_in_tables() -> None:
    """A disc that left its pocket: each number by its one description; coordinates with two decimals at least."""
    course = {"mode": "rolling", "first_motion": 0.5, "left_pocket": None, "force": [1.0, 2.0]}
    works = {"flow": 3.0, "gravity": -2.0, "friction": -0.25, "impact": 0.0}
    path: dict[str, Any] = {
        "ended": {"by": "out-of-pocket", "time": 2.35, "without_verdict": ""},
        "place": [350004.767, 0.5],
        "angle": -1.5,
        "velocity": [0.25, -0.125],
        "spin": -0.75,
        "interface_iterations": {"mean": 2.5, "most": 4},
        "remeshings": [{}, {}],
        "on_bed": course | {"works": works},
    }
    stored = {"scene": {"domain": {}}, "trajectory": path}
    for quantity in OF_PATH:
        if quantity.derive is not None:
            put(stored, quantity.key, quantity.derive(stored))
    text = "\n".join(screen_lines(OF_PATH, stored, details=True))
    for line in (
        "path                ended by out-of-pocket   at t = 2.35",
        "position            (350004.77, 0.5)   turned by [rad] -1.5",
        "velocity            (0.25, -0.125)   spin -0.75",
        "on its bed          mode at the end rolling   force of contact (1, 2)",
        "works               flow 3   gravity -2   friction -0.25   impact 0",
        "interface           iterations a step 2.5   at most 4   new meshes 2",
    ):
        assert line in text
    assert words_of([1.0, 0.5, 0.25, 0.0], "", 3) == "(1, 0.5, 0.25, 0)"  # as of a quaternion
    assert "interface" not in "\n".join(screen_lines(OF_PATH, stored))
    columns = {k: v for q in OF_PATH for k, v in q.columns(stored).items()}
    assert columns == {
        "ended": "out-of-pocket",
        "velocity_x": 0.25,
        "velocity_y": -0.125,
        "spin": -0.75,
        "does": "rolling",
        "first_motion": 0.5,
    }
    rows = dict(_rows(stored, OF_PATH, PATH))
    assert rows["position [length]"] == path["place"] and rows["work of gravity [energy]"] == -2.0
    assert "left its pocket [time]" not in rows and rows["new meshes"] == 2
